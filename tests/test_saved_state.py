"""A run that starts from the state of an earlier one goes on as if it had not stopped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cablesim

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
