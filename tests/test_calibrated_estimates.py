"""What one look at rest and a calibration do for estimates, and sensors that cannot tell what is asked."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation
from shapes import G, resting, turning
from v_system import V_REST, v_run

import cablesim
from cablesim.sensors import (
    ImuErrors,
    OrientationErrors,
    SensorError,
    SensorWarning,
    add_errors,
    calibrated,
    estimate_shape,
    fit_phase_relation,
    imu_signals,
    opening_at_rest,
    outer_force,
    phase_lag,
    rigid_arm_distance,
    shape_distance,
    tangent_angles,
    truth,
    weigh_tangents,
    weighted_distance,
)

S = np.linspace(0.0, 4.0, 81)
PAPER = {"imu_1": 1.0, "imu_2": 1.3, "imu_3": 1.6, "imu_4": 1.9, "imu_5": 2.2}


@pytest.fixture(scope="module")
def read():
    return imu_signals(v_run(), rate=20.0)


@pytest.fixture(scope="module")
def exact(read):
    return truth.distance(v_run(), 1.0, 2.2, read.time)


def changed(**cable):
    """The case of the V with another cable."""
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["cable"].update(cable)
    return cablesim.Case.from_dict(data)


# Offset at rest ---------------------------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [0.7, 1.5])
def test_one_look_at_rest_takes_out_what_a_wrong_stiffness_does(read, exact, stiffness):
    """The estimator believes in another cable than that of the run, which moves and turns."""
    case = changed(bending_stiffness=stiffness * V_REST.cable.bending_stiffness)
    raw = truth.errors_of(shape_distance(estimate_shape(read, case=case)), exact)
    opening = opening_at_rest(read.isel(time=[0]), float(exact[0]), case=case)
    rest = shape_distance(estimate_shape(read, case=case, opening=opening))
    assert raw["rms"] > 0.012
    assert truth.errors_of(rest, exact)["rms"] < 0.25 * raw["rms"]
    assert rest[0] == pytest.approx(float(exact[0]), abs=1e-6)


def test_equation_9_is_off_by_a_constant(read, exact):
    error = rigid_arm_distance(read) - exact
    assert abs(float(error.mean())) > 10 * float(error.std())


def test_an_opened_shape_keeps_its_length_and_a_taut_one_its_place(read):
    shape = estimate_shape(read, opening=0.2)
    steps = np.linalg.norm(np.diff(shape.position, axis=1), axis=-1)
    np.testing.assert_allclose(steps.sum(axis=1), 1.2, rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(shape.tangent, axis=-1), 1.0, atol=1e-12)
    assert np.all(shape_distance(shape) > shape_distance(estimate_shape(read)) + 0.02)
    taut = imu_signals(resting(S, S[:, None] * [0.8, 0.0, 0.6]), PAPER, gravity=G, rate=1.0)
    straight = estimate_shape(taut, case=V_REST, opening=0.2)
    np.testing.assert_allclose(shape_distance(straight), 1.2, atol=1e-9)


def test_a_distance_out_of_reach_is_refused(read):
    with pytest.raises(
        SensorError, match=r"A distance of 1\.1 m at rest is out of reach: the sensors tell 0\.2"
    ):
        opening_at_rest(read.isel(time=[0]), 1.1)


# Calibrated weights -----------------------------------------------------------------------------


def test_weights_are_recovered_where_they_are_exact():
    """Two straight arms that open and turn: (9) is exact, whatever the lengths of the arms."""
    angle = np.linspace(0.3, 1.2, 40)
    arms = np.array([[np.cos(angle), np.sin(angle), 0 * angle], [np.cos(angle), -np.sin(angle), 0 * angle]])
    level = resting(S, S[:, None] * [1.0, 0, 0], times=np.arange(40.0))
    signals = imu_signals(level, {"p": 1.0, "q": 2.0}, gravity=G, rate=1.0)
    for number, sign in enumerate((1.0, -1.0)):
        turned = Rotation.from_rotvec(sign * angle[:, None] * [0.0, 0.0, 1.0])
        before = Rotation.from_quat(signals["orientation"].values[:, number])
        signals["orientation"].values[:, number] = (turned * before).as_quat()
    distance = np.linalg.norm(0.7 * arms[0] + 0.4 * arms[1], axis=0)
    weights = weigh_tangents(signals, distance)
    assert weights.attrs["residual"] < 1e-8
    np.testing.assert_allclose(weighted_distance(signals, weights), distance, atol=1e-8)
    np.testing.assert_allclose(
        weighted_distance(signals.isel(imu=[1, 0]), weights), weighted_distance(signals, weights)
    )


def test_weights_of_a_run_hold_for_its_other_half(read, exact):
    """Found while the V opens, told while it closes: far better than (9), without a model."""
    half = read.sizes["time"] // 2
    weights = weigh_tangents(read.isel(time=slice(0, half)), exact[:half])
    assert weights.attrs["residual"] < 2e-3
    later = truth.errors_of(weighted_distance(read, weights)[half:], exact[half:])
    assert later["rms"] < 5e-3
    assert truth.errors_of(rigid_arm_distance(read)[half:], exact[half:])["rms"] > 0.15


def test_calibration_leaves_out_what_is_not_known(read, exact):
    holes, gaps = read.copy(deep=True), exact.copy(deep=True)
    holes["orientation"].values[5, 2] = np.nan
    gaps[9] = np.nan
    known = np.delete(np.arange(read.sizes["time"]), [5, 9])
    expected = weigh_tangents(read.isel(time=known), exact[known])
    np.testing.assert_allclose(weigh_tangents(holes, gaps), expected, atol=1e-9)


def test_calibrations_that_cannot_be(read, exact):
    with pytest.raises(SensorError, match="3 distances for 161 times"):
        weigh_tangents(read, exact[:3])
    with pytest.raises(SensorError, match="known together at 4 times: 5 sensors need"):
        weigh_tangents(read.isel(time=slice(0, 4)), exact[:4])


# Sensors that cannot tell -----------------------------------------------------------------------


def test_sensors_on_one_arm_are_refused(read):
    with pytest.raises(SensorError, match=r"No sensor is on the cable from 1\.6 to 2\.2 m.*at 1, 1\.3 m"):
        estimate_shape(read.isel(imu=[0, 1]))
    assert shape_distance(estimate_shape(read.isel(imu=[0, 1]), 1.0, 1.3)).max() < 0.3


def test_sensors_that_do_not_span_the_bodies_are_said(read):
    with pytest.warns(SensorWarning, match=r"do not span the shape from 1 to 2\.2 m: 0\.3 m beyond"):
        estimate_shape(read.isel(imu=[1, 2, 3]))


def test_signals_without_a_case_are_refused(read):
    without = read.assign_attrs(case="")
    with pytest.raises(SensorError, match="hold no case, which says how the cable bends"):
        estimate_shape(without)
    assert estimate_shape(without, bending_length=np.inf).attrs["bending_length"] == np.inf


def test_circular_arcs_are_said_where_nothing_floats(read):
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["attachments"] = [part for part in data["attachments"] if part["kind"] != "buoy"]
    with pytest.warns(SensorWarning, match="circular arcs are taken"):
        estimate_shape(read, case=cablesim.Case.from_dict(data))


def test_a_cable_without_stiffness_has_straight_arms():
    """Not circular arcs."""
    slope = np.where(
        (S[:-1] > 1.0 - 1e-9) & (S[:-1] < 1.6 - 1e-9), -1.0, np.where(S[:-1] < 2.2 - 1e-9, 1.0, -1.0)
    )
    steps = 0.05 * np.stack((np.full(80, 0.5), np.zeros(80), np.sqrt(0.75) * slope), axis=-1)
    data = resting(S, np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0))))
    read = imu_signals(data, PAPER, gravity=G, rate=1.0)
    exact = float(truth.distance(data, 1.0, 2.2, [0.0])[0])
    found = shape_distance(estimate_shape(read, case=changed(bending_stiffness=0.0)))
    assert found[0] == pytest.approx(exact, abs=0.015)  # the sensors at the kinks read their mean
    assert (
        abs(float(shape_distance(estimate_shape(read, case=V_REST, bending_length=np.inf))[0]) - exact) > 0.1
    )


def test_two_sensors_at_one_place_are_refused(read):
    twice = read.isel(imu=[0, 1, 1, 3, 4])
    twice = twice.assign_coords(s=("imu", [1.0, 1.3, 1.3 + 1e-9, 1.9, 2.2]))
    for ask in (estimate_shape, lambda signals: outer_force(signals, V_REST, shape=estimate_shape(read))):
        with pytest.raises(SensorError, match="each at a place of its own"):
            ask(twice)


@pytest.mark.parametrize("number", [0, 1, 3, 4])
def test_a_sensor_the_wrong_way_round_is_named(read, number):
    wrong = read.copy(deep=True)
    about = Rotation.from_rotvec([0.0, 0.0, np.pi])
    wrong["orientation"].values[:, number] = (
        Rotation.from_quat(read.orientation.values[:, number]) * about
    ).as_quat()
    with pytest.warns(SensorWarning, match=f"imu_{number + 1}, at .* points away"):
        estimate_shape(wrong)


def test_all_sensors_the_wrong_way_round_or_exchanged_are_said(read):
    wrong = read.copy(deep=True)
    about = Rotation.from_rotvec([0.0, 0.0, np.pi])
    for number in range(5):
        turned = Rotation.from_quat(read.orientation.values[:, number]) * about
        wrong["orientation"].values[:, number] = turned.as_quat()
    with pytest.warns(SensorWarning, match="which sinks, is .* m above the line"):
        estimate_shape(wrong)
    with pytest.warns(SensorWarning, match="or elsewhere|above the line"):
        estimate_shape(read.assign_coords(s=("imu", [1.0, 1.9, 1.6, 1.3, 2.2])))
    with pytest.raises(SensorError, match=r"'imu_4' is at 1\.9 m and 'imu_2' at 1\.3 m"):
        rigid_arm_distance(read, "imu_4", "imu_2")


# Gaps -------------------------------------------------------------------------------------------


def test_a_gap_stays_where_it_is(read):
    """Through unwrapping and through the integral of the accelerations."""
    holes = read.copy(deep=True)
    holes["orientation"].values[40, 1] = np.nan
    holes["specific_force"].values[60:63, 2] = np.nan
    angles, whole = tangent_angles(holes), tangent_angles(read)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(angles.phi).any("imu")), [40])
    np.testing.assert_allclose(angles.phi[41:], whole.phi[41:], atol=1e-12)
    found, expected = outer_force(holes, rest=1.0), outer_force(read, rest=1.0)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.pull)), [40, 60, 61, 62])
    assert np.abs(found.pull[63:] - expected.pull[63:]).max() < 2e-3


def test_a_sensor_without_a_reading_in_the_rest_has_no_offset(read):
    holes = read.copy(deep=True)
    holes["specific_force"].values[:5, 0] = np.nan
    part = outer_force(holes, rest=0.5)
    assert np.isfinite(part.pull[5:]).all()
    holes["specific_force"].values[:11, 0] = np.nan
    assert np.isnan(outer_force(holes, rest=0.5).pull).all()


def test_relations_and_lags_leave_out_gaps():
    times = np.linspace(0.0, 20.0, 2001)
    distance = xr.DataArray(0.3 + 0.1 * np.sin(0.7 * times), {"time": times}, ("time",))
    difference = 0.5 * (distance.values - 0.3) - 0.4 * 0.07 * np.cos(0.7 * times)
    holes, gaps = distance.copy(), difference.copy()
    holes[100], gaps[200:210] = np.nan, np.nan
    found, expected = (fit_phase_relation(*pair, 0.3) for pair in ((holes, gaps), (distance, difference)))
    assert found.damping == pytest.approx(expected.damping, rel=1e-3)
    assert phase_lag(holes, gaps)[0] == pytest.approx(phase_lag(distance, difference)[0], abs=0.011)
    with pytest.raises(SensorError, match="no time in common"):
        phase_lag(distance, np.full(2001, np.nan))


# What sensors and water do ----------------------------------------------------------------------


def test_tilt_turns_the_vertical_and_not_the_heading():
    level = imu_signals(resting(S, S[:, None] * [1.0, 0, 0]), {str(k): 0.1 * k for k in range(30)}, gravity=G)
    model = ImuErrors(orientation=OrientationErrors(tilt=0.02))
    read = add_errors(level, model, 3)
    turned = (
        Rotation.from_quat(read.orientation.values[-1])
        * Rotation.from_quat(level.orientation.values[-1]).inv()
    )
    vector = turned.as_rotvec()
    np.testing.assert_allclose(vector[:, 2], 0.0, atol=1e-12)
    assert 0.015 < np.abs(vector[:, :2]).max() <= 0.02
    np.testing.assert_array_equal(read.orientation[0], read.orientation[-1])
    assert calibrated(model, 0.1).orientation.tilt == pytest.approx(0.002)


def test_a_v_at_rest_in_a_current_is_pulled_by_its_drag():
    """Drag of three bodies and of a cable across the current, in closed form; the case's or the user's."""
    flow, down = np.array([0.0, 0.1, 0.0]), np.array([0.8, 0.0, -0.6])
    still = resting(S, S[:, None] * down, times=[0.0, 1.0]).assign_attrs(case=V_REST.to_yaml())
    read = imu_signals(still, rate=20.0)
    drag = 500.0 * (2 * 9.23e-4 + 5.48e-4 + 1.2 * 1.2 * 4e-3) * 0.1**2
    expected = [0.0, -drag, 0.0]
    np.testing.assert_allclose(outer_force(read).force, 0.0, atol=1e-6)
    given = outer_force(read, current=flow).force
    np.testing.assert_allclose(given, np.tile(expected, (21, 1)), atol=1e-6)
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["water"]["current"] = {"kind": "uniform", "velocity": flow.tolist()}
    np.testing.assert_allclose(outer_force(read, cablesim.Case.from_dict(data)).force, given)
    data["water"]["current"] = {
        "kind": "profile",
        "heights": [-1.0, 0.0],
        "velocities": [[0, 0, 0], [0, 1, 0]],
    }
    with pytest.warns(SensorWarning, match="depends on the place: still water is taken"):
        outer_force(read, cablesim.Case.from_dict(data))


def test_truth_is_labelled(read):
    data = turning(np.linspace(0.0, 1.0, 51), S, lambda s: s[:, None] * [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    places = truth.places(data, [0.0, 1.0], [0.5])
    assert places.dims == ("time", "point", "axis")
    np.testing.assert_allclose(places[0, 1], [np.cos(0.5), np.sin(0.5), 0.0], atol=1e-6)
    np.testing.assert_allclose(truth.tangents(data, [1.0], [0.5])[0, 0], places[0, 1], atol=1e-6)
    pull, force = truth.pull(v_run(), 1.0, 2.2, read.time), truth.outer_force(v_run(), 1.0, 2.2, read.time)
    line = truth.places(v_run(), [1.0, 2.2], read.time).diff("point").isel(point=0)
    np.testing.assert_allclose(pull, (force * line).sum("axis") / np.sqrt((line**2).sum("axis")))
    assert {"units", "long_name"} <= set(pull.attrs)
