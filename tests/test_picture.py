"""What moving pictures show is what the result says."""

import numpy as np
import pytest
import xarray as xr
from runs import only, result, with_imus, with_winch

from cablesim.picture import (
    bodies,
    energy_panel,
    imu_frames,
    material_coordinates,
    node_positions,
    tension_range,
    time_panels,
)
from cablesim.plot import PlotError


@pytest.fixture
def buoys():
    return with_imus(result("buoys"), imu_1=4.0, imu_2=6.13, imu_3=8.0)


def test_kinds_of_attachments_come_from_the_case(buoys):
    assert [(body.name, body.kind) for body in bodies(buoys)] == [("float", "buoy"), ("weight", "ballast")]
    assert bodies(result("sway")) == []


@pytest.mark.parametrize("case", [None, "", "name: [", "name: of another version"])
def test_a_case_that_is_not_understood_leaves_plain_bodies_and_no_imus(buoys, case):
    buoys.attrs["case"] = case
    assert {body.kind for body in bodies(buoys)} == {"body"}
    assert imu_frames(buoys).names == []
    assert imu_frames(buoys).position.shape == (buoys.sizes["time"], 0, 3)


def test_an_imu_at_a_node_is_there_with_the_mean_tangent_of_both_segments(buoys):
    frames = imu_frames(buoys)
    assert frames.names == ["imu_1", "imu_2", "imu_3"]
    for imu, attachment in ((0, 0), (2, 1)):
        np.testing.assert_allclose(
            frames.position[:, imu], buoys["attachment_position"].values[:, attachment]
        )
    node = int(np.abs(buoys["s"].values - 4.0).argmin())
    chords = np.diff(buoys["position"].values[:, node - 1 : node + 2], axis=1)
    mean = (chords / np.linalg.norm(chords, axis=2, keepdims=True)).sum(axis=1)
    expected = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    np.testing.assert_allclose(frames.axes[:, 0, 0], expected, atol=1e-12)


def test_imu_frames_are_right_handed_unit_vectors(buoys):
    axes = imu_frames(buoys).axes
    np.testing.assert_allclose(
        axes @ np.swapaxes(axes, -1, -2), np.broadcast_to(np.eye(3), axes.shape), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)


def test_imus_on_the_drum_are_nowhere(buoys):
    last = float(buoys["s"][-1])
    winch = with_winch(with_imus(result("buoys"), here=0.5 * last, drum=0.99 * last))
    frames = imu_frames(winch)
    assert np.isfinite(frames.position[:, 0]).all()
    assert np.isnan(frames.position[:, 1]).all()
    assert np.isnan(frames.axes[:, 1]).all()


def test_an_imu_between_the_last_node_and_the_outlet_is_on_that_line(buoys):
    winch = with_winch(result("buoys"))
    s, present = winch["s"].values, np.isfinite(winch["position"].values[0, :, 0])
    before, outlet = s[:-1][present[:-1]][-1], float(winch["deployed_length"][0])
    frames = imu_frames(with_imus(winch, imu=0.5 * (before + outlet)))
    ends = winch["position"].values[0][present][-2:]
    np.testing.assert_allclose(frames.position[0, 0], ends.mean(axis=0))
    np.testing.assert_allclose(material_coordinates(winch)[:, -1], winch["deployed_length"])


def test_panels_hold_the_numbers_of_the_result(buoys):
    tension, distance = time_panels(buoys)
    np.testing.assert_array_equal(tension.lines["end B"], buoys["end_tension"].values[:, 1])
    np.testing.assert_array_equal(tension.band[1], buoys["tension"].values.max(axis=1))
    places = buoys["attachment_position"].values
    gap = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    np.testing.assert_array_equal(distance.lines["float to weight"], gap)
    np.testing.assert_array_equal(energy_panel(buoys).lines["bending"], buoys["bending_energy"].values)


def test_a_winch_has_panels_of_its_own(buoys):
    panels = {panel.title: panel for panel in time_panels(with_winch(buoys))}
    assert list(panels) == ["Tension", "Distance between attachments", "Deployed length", "Payout"]
    assert np.isfinite(panels["Tension"].band).all()


def test_panels_say_what_they_lack(buoys):
    bare = only(buoys, "position")
    assert "no `end_tension`: add it to output.variables" in time_panels(bare)[0].note
    assert "no `attachment_position`: add it" in time_panels(bare)[1].note
    assert "no `kinetic_energy`: add it" in energy_panel(bare).note
    assert tension_range(bare) is None


def test_what_cannot_be_drawn_is_refused(buoys):
    with pytest.raises(PlotError, match="no `position`: add it to output"):
        node_positions(buoys.drop_vars("position"))
    with pytest.raises(PlotError, match="is it a result of cablesim"):
        node_positions(xr.Dataset({"temperature": ("month", [1.0])}))
