"""A run that starts from the state of an earlier one goes on as if it had not stopped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cablesim
from cablesim.saved_state import SavedStateError, read_saved_state
from cablesim.scene import SavedState

SWAY: dict[str, Any] = {
    "name": "sway",
    "cable": {"length": 3, "diameter": 0.005, "mass_per_length": 0.055, "axial_stiffness": 1e4},
    "mesh": {"segment_length": 0.1},
    "ends": {
        "a": {"motion": "fixed", "position": [0, 0, 0]},
        "b": {
            "motion": "velocity_waypoints",
            "position": [1.5, 0, 0],
            "waypoints": [[0, 0, 0, 0], [1, 0, 0.4, 0]],
        },
    },
    "simulation": {"duration": 2, "relative_tolerance": 1e-7},
    "output": {"interval": 0.1},
}


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("earlier") / "first.nc"
    cablesim.write(cablesim.simulate(cablesim.Case.from_dict(SWAY)), file)
    return file


def resumed(earlier: Path, **changes: Any) -> cablesim.Case:
    """The second second of the run, from the state at 1 s."""
    end_b = {
        "motion": "velocity_waypoints",
        "position": [1.5, 0.2, 0],
        "waypoints": [[0, 0, 0.4, 0]],
    }
    data = {
        **SWAY,
        "ends": {**SWAY["ends"], "b": end_b},
        "initial": {"shape": "state", "file": str(earlier), "time": 1},
        "simulation": {**SWAY["simulation"], "duration": 1},
        **changes,
    }
    return cablesim.Case.from_dict(data)


def test_resumed_run_goes_on_as_if_it_had_not_stopped(earlier: Path) -> None:
    whole = cablesim.read(earlier).sel(time=slice(0.999, None))
    rest = cablesim.simulate(resumed(earlier))
    assert rest.attrs["status"] == "completed"
    np.testing.assert_allclose(rest.position.values, whole.position.values, atol=2e-6)
    np.testing.assert_allclose(rest.tension.values[1:], whole.tension.values[1:], atol=2e-4)


def test_state_at_the_start_is_the_saved_one(earlier: Path) -> None:
    saved = cablesim.read(earlier).sel(time=1.0, method="nearest")
    first = cablesim.simulate(resumed(earlier)).isel(time=0)
    np.testing.assert_allclose(first.velocity.values, saved.velocity.values, atol=1e-6)
    np.testing.assert_allclose(first.tension.values, saved.tension.values, atol=1e-6)


def test_another_mesh_gives_nearly_the_same_run(earlier: Path) -> None:
    whole = cablesim.read(earlier)
    rest = cablesim.simulate(resumed(earlier, mesh={"segment_length": 0.05}))
    middle = rest.position.isel(time=-1).values[::2]
    assert np.abs(middle - whole.position.isel(time=-1).values).max() < 2e-3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"initial": {"shape": "state", "file": "nowhere.nc"}}, ["initial.file", "nowhere.nc"]),
        ({"initial.time": 7}, ["no state at 7 s", "0 to 2 s"]),
        ({"cable": {**SWAY["cable"], "length": 3.5}}, ["3 m of cable, not of 3.5 m", "cable.length"]),
        ({"ends": SWAY["ends"]}, ["end b", "0.2 m from where ends.b begins"]),
    ],
)
def test_states_that_do_not_fit_are_refused(earlier: Path, changes: dict[str, Any], words: list[str]) -> None:
    if "initial.time" in changes:
        changes = {"initial": {"shape": "state", "file": str(earlier), "time": changes["initial.time"]}}
    with pytest.raises(cablesim.CaseError) as refused:
        cablesim.build_scene(resumed(earlier, **changes))
    for word in words:
        assert word in str(refused.value)


def test_file_that_is_no_result_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("not netCDF")
    with pytest.raises(cablesim.CaseError, match="cannot be read as netCDF"):
        cablesim.build_scene(resumed(tmp_path / "text.nc"))


# States of a run with a winch ---------------------------------------------------------------------

DEPLOYED = 2.25  # m of 4 m, with nodes every 0.5 m: those at 2.5 m and beyond are on the drum


def write_winch_run(file: Path, *, without: str = "", failed: bool = False) -> None:
    """Two states of a straight cable along x, the places of nodes on the drum empty."""
    netCDF4 = pytest.importorskip("netCDF4")
    s = np.linspace(0.0, 4.0, 9)
    lengths = np.array([3.0, DEPLOYED])
    with netCDF4.Dataset(file, "w") as data:
        for name, size in (("time", 2), ("node", 9), ("segment", 8), ("axis", 3)):
            data.createDimension(name, size)

        def put(name: str, dimensions: tuple[str, ...], values: np.ndarray) -> None:
            if name != without:
                data.createVariable(name, "f8", dimensions)[:] = np.ma.masked_invalid(values)

        out = s < lengths[:, None]
        out[:, -1] = True
        places = np.where(out, np.minimum(s, lengths[:, None]), np.nan)
        places[:, -1] = lengths
        # the segment from the last node before the winch is in the last place
        tension = np.where(s[1:] < lengths[:, None], 10.0 + s[1:], np.nan)
        tension[:, -1] = 99.0
        if failed:
            places[:] = np.nan
        put("time", ("time",), np.array([0.0, 1.0]))
        put("s", ("node",), s)
        put("deployed_length", ("time",), lengths)
        put("position", ("time", "node", "axis"), places[..., None] * np.array([1.0, 0.0, 0.0]))
        put("velocity", ("time", "node", "axis"), 0.1 * places[..., None] * np.array([0.0, 1.0, 0.0]))
        put("tension", ("time", "segment"), tension)


def test_winch_state_ends_at_the_outlet(tmp_path: Path) -> None:
    write_winch_run(tmp_path / "winch.nc")
    state = read_saved_state(tmp_path / "winch.nc", None)
    np.testing.assert_allclose(state.arc, [0, 0.5, 1, 1.5, 2, DEPLOYED])
    np.testing.assert_allclose(state.positions[:, 0], state.arc)
    np.testing.assert_allclose(state.velocities[:, 1], 0.1 * state.arc)
    np.testing.assert_allclose(state.tension, [10.5, 11, 11.5, 12, 99])
    earlier = read_saved_state(tmp_path / "winch.nc", 0.0)
    np.testing.assert_allclose(earlier.arc, [0, 0.5, 1, 1.5, 2, 2.5, 3])
    assert earlier.tension.size == 6


def from_winch_run(directory: Path, deployed: float) -> cablesim.Case:
    data = {
        **SWAY,
        "cable": {**SWAY["cable"], "length": 4},
        "winch": {
            "deployed_length": deployed,
            "payout": {"kind": "waypoints", "waypoints": [[0, 0.1]]},
        },
        "ends": {**SWAY["ends"], "b": {"motion": "fixed", "position": [DEPLOYED, 0, 0]}},
        "initial": {"shape": "state", "file": "winch.nc"},
    }
    return cablesim.Case.from_dict(data, directory=directory)


def test_a_run_can_start_from_the_state_of_a_winch_run(tmp_path: Path) -> None:
    write_winch_run(tmp_path / "winch.nc")
    scene = cablesim.build_scene(from_winch_run(tmp_path, DEPLOYED))
    assert isinstance(scene.initial, SavedState)
    assert scene.initial.arc[-1] == scene.start_length == DEPLOYED
    with pytest.raises(cablesim.CaseError, match=r"2\.25 m of cable, not of 2\.5 m.*winch\.deployed_length"):
        cablesim.build_scene(from_winch_run(tmp_path, 2.5))


def test_winch_states_that_cannot_start_a_run_are_refused(tmp_path: Path) -> None:
    write_winch_run(tmp_path / "short.nc", without="deployed_length")
    with pytest.raises(SavedStateError, match="part of a cable and no deployed_length"):
        read_saved_state(tmp_path / "short.nc", None)
    write_winch_run(tmp_path / "failed.nc", failed=True)
    with pytest.raises(SavedStateError, match="not finite; choose an earlier time"):
        read_saved_state(tmp_path / "failed.nc", None)
