"""What can be computed but should make its reader look twice is said, once, wherever a result is seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import cablesim
from cablesim.build import build_scene
from cablesim.cli import app
from cablesim.plausibility import warnings_of
from cablesim.plausibility.recordings import check_samples
from cablesim.report import report_html
from cablesim.scene import GriddedCurrent, Scene

CASE: dict[str, Any] = {
    "name": "odd",
    "cable": {"length": 3, "diameter": 0.005, "mass_per_length": 0.055, "axial_stiffness": 1e4},
    "mesh": {"segment_length": 0.1},
    "ends": {
        "a": {"motion": "fixed", "position": [0, 0, -2]},
        "b": {"motion": "fixed", "position": [1.5, 0, -2]},
    },
    "simulation": {"duration": 1.0},
}


def case(*, name: str = "odd", **changes: Any) -> cablesim.Case:
    """The case, with changes to the keys of its groups."""
    given = {key: dict(value) if isinstance(value, dict) else value for key, value in CASE.items()}
    for key, value in changes.items():
        given[key] = {**given.get(key, {}), **value} if isinstance(value, dict) else value
    return cablesim.Case.from_dict({**given, "name": name})


def moving(velocity: list[float], position: tuple[float, ...] = (1.5, 0.0, -2.0)) -> dict[str, Any]:
    waypoints = [[0, 0, 0, 0], [0.2, *velocity]]
    end = {"motion": "velocity_waypoints", "position": list(position), "waypoints": waypoints}
    return {"b": end}


def before(**changes: Any) -> tuple[str, ...]:
    return build_scene(case(**changes)).warnings


def after(**changes: Any) -> tuple[str, ...]:
    return warnings_of(cablesim.simulate(case(**changes)))


def only(found: tuple[str, ...], *words: str) -> None:
    """There is one warning, and it says what, where and what to do."""
    assert len(found) == 1, found
    assert all(word in found[0] for word in words), found[0]
    assert found[0].endswith((".", "?"))


# Before a run -----------------------------------------------------------------------------------


def test_nothing_is_said_of_a_usual_scene() -> None:
    assert before() == ()
    dataset = cablesim.simulate(case())
    assert "warnings" not in dataset.attrs


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cable": {"diameter": 5}}, ["cable.diameter is 5 m", "did you mean 5 mm?"]),
        ({"cable": {"diameter": 5e-6}}, ["cable.diameter is 5e-06 m", "did you mean 0.005 m?"]),
        ({"cable": {"mass_per_length": 55}}, ["55 kg/m", "0.005 m", "2.8e+06 kg/m3"]),
        ({"cable": {"mass_per_length": 5.5e-5, "displaced_section": 0}}, ["2.8 kg/m3", "check their units"]),
        ({"water": {"density": 1.025}}, ["water.density is 1.025 kg/m3", "did you mean 1025 kg/m3?"]),
        ({"water": {"density": 1e6}}, ["water.density is 1e+06"]),
        (
            {"cable": {"minimum_bend_radius": 0.1}},
            ["cable.minimum_bend_radius", "give the stiffness"],
        ),
    ],
)
def test_other_units_are_suspected(changes: dict[str, Any], words: list[str]) -> None:
    only(before(**changes), *words)


@pytest.mark.parametrize(("mass", "volume", "density"), [(50.0, 60e-6, "8.33e+05"), (0.05, 60.0, "0.000833")])
def test_bodies_of_impossible_density(mass: float, volume: float, density: str) -> None:
    body = {"kind": "buoy", "name": "float", "at": 1.2, "mass": mass, "volume": volume}
    only(before(attachments=[body]), "'float'", f"{density} kg/m3", "check the units of mass and volume")


@pytest.mark.parametrize("density", [0.0, 920.0, 1025.0, 1200.0])
def test_usual_water_passes(density: float) -> None:
    assert before(water={"density": density}) == ()


# After a run ------------------------------------------------------------------------------------


def test_a_long_stretch_is_said_with_time_and_place() -> None:
    """A massless-like cord pulled straight by 0.4 m/s over 3 m: T = EA (d/L - 1), known at its end."""
    found = after(
        cable={"axial_stiffness": 100.0},
        ends=moving([2.0, 0, 0]),
        simulation={"duration": 1.1},
    )
    only(found, "the cable stretches by", "t = 1.1 s", "cable.axial_stiffness")
    reach = 1.5 + 2.0 * (0.1 + 0.9)
    stretch = float(found[0].split("by ")[1].split("%")[0]) / 100
    assert stretch == pytest.approx(reach / 3.0 - 1.0, abs=0.03)


def test_breaking_load() -> None:
    """A cable that hangs by one end carries its weight there: 3 m of 0.347 N/m are 1.04 N."""
    hanging = {"b": {"motion": "free"}}
    weight = (0.055 - 1000 * np.pi * 0.005**2 / 4) * 9.81 * 3
    start = {"shape": "taut", "direction": [0, 0, -1]}
    parts = {"ends": hanging, "initial": start}
    assert after(cable={"breaking_load": 1.02 * weight}, **parts) == ()
    only(after(cable={"breaking_load": 0.9 * weight}, **parts), "cable.breaking_load", "s = 0.05 m", "N")


def test_bending_radius_of_a_hanging_loop() -> None:
    """A catenary of EI nearly 0 bends at its bottom to a radius of H / w."""
    cable = {"bending_stiffness": 1e-6, "minimum_bend_radius": 0.05}
    ends = {"b": {"motion": "fixed", "position": [2.0, 0, -2]}}
    weight = (0.055 - 1000 * np.pi * 0.005**2 / 4) * 9.81
    dataset = cablesim.simulate(case(cable=cable, ends=ends))
    assert warnings_of(dataset) == ()
    radius = abs(float(dataset.end_force[-1].sel(axis="x")[0])) / weight
    only(
        after(cable={**cable, "minimum_bend_radius": 1.1 * radius}, ends=ends),
        f"radius of {radius:.2g}"[:12],
        "s = 1.5 m",
        "cable.minimum_bend_radius",
    )


def test_a_bend_too_sharp_for_the_mesh() -> None:
    ends = {"b": {"motion": "fixed", "position": [0.05, 0, -2]}}
    only(after(ends=ends), "turn by", "s = 1.5 m", "mesh.refine")


def test_a_body_may_hang_in_a_kink() -> None:
    ends = {"b": {"motion": "fixed", "position": [1.0, 0, -2]}}
    body = {"kind": "ballast", "name": "weight", "at": 1.5, "mass": 2.0, "volume": 1e-4}
    assert after(ends=ends, attachments=[body]) == ()


def test_a_push_that_neither_stiffness_nor_weight_explains() -> None:
    """Weightless cable shortened along its axis."""
    parts = {
        "cable": {"wet_weight": 0.0, "axial_stiffness": 1e3},
        "ends": moving([-1.0, 0, 0], (3.0, 0.0, -2.0)),
        "initial": {"shape": "taut"},
        "simulation": {"duration": 0.5, "skip": False},
    }
    only(after(**parts), "the cable pushes with", "cable.bending_stiffness")
    stiff = {**parts, "cable": {**parts["cable"], "bending_stiffness": 10.0}}
    assert after(**stiff) == ()
    fine = {"segment_length": 0.1, "refine": [{"at": 2.9, "within": 0.1, "segment_length": 0.01}]}
    soft = {**parts, "cable": {**parts["cable"], "bending_stiffness": 2e-4}, "mesh": fine}
    only(after(**soft), "the cable pushes with")  # the fine segments do not excuse the others


def test_above_the_surface() -> None:
    rising = {"ends": moving([0, 0, 3.0]), "simulation": {"duration": 1.0}}
    only(after(**rising), "above the surface, z = 0 m", "t = 1 s", "s = 3 m", "water.surface")
    assert after(**rising, water={"surface": 5.0}) == ()
    only(after(water={"surface": -2.5}), "rises 0.5 m above the surface, z = -2.5 m")


@pytest.mark.parametrize("height", [0.0, 1.0])
def test_a_scene_that_does_not_start_under_the_origin_has_no_surface(height: float) -> None:
    end = {"motion": "fixed", "position": [0, 0, height]}
    rising = moving([0, 0, 3.0], (1.5, 0.0, height))
    assert after(ends={"a": end, **rising}) == ()


def map_scene(**changes: Any) -> Scene:
    grid = {"times": [0.0, 5.0], "x": [-1.0, 2.0], "y": [0.0], "z": [-5.0, 0.0]} | changes
    axes = {name: np.array(values) for name, values in grid.items()}
    current = GriddedCurrent(**axes, velocities=np.zeros((*(axis.size for axis in axes.values()), 3)))
    scene = build_scene(case())
    return replace(scene, water=replace(scene.water, current=current))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x": [0.5, 2.0]}, ["x = 0 to 1.5 m of 0.5 to 2 m"]),
        ({"z": [-2.5, 0.0]}, ["z = -3.", "of -2.5 to 0 m"]),
    ],
)
def test_a_cable_that_leaves_the_map(changes: dict[str, Any], words: list[str]) -> None:
    only(warnings_of(cablesim.simulate(map_scene(**changes))), "leaves the current map", *words, "larger map")


def test_a_cable_within_the_map() -> None:
    assert warnings_of(cablesim.simulate(map_scene())) == ()
    assert warnings_of(cablesim.simulate(map_scene(x=[0.0], z=[0.0]))) == ()  # constant along them


def test_a_map_that_is_shorter_than_the_run(tmp_path: Path) -> None:
    netCDF4 = pytest.importorskip("netCDF4")
    with netCDF4.Dataset(tmp_path / "map.nc", "w") as file:
        file.createDimension("time", 2)
        file.createVariable("time", "f8", ("time",))[:] = [0.0, 0.5]
        for name in ("u", "v"):
            file.createVariable(name, "f8", ("time",))[:] = [0.0, 0.1]
    current = {"kind": "map", "file": str(tmp_path / "map.nc")}
    only(before(water={"current": current}), "from 0 to 0.5 s", "lasts 1 s", "longer map")


def test_what_is_on_the_drum_is_not_judged() -> None:
    """On the drum segments have no length and any direction."""
    payout = {"kind": "waypoints", "waypoints": [[0, 0], [0.5, 0.2]]}
    winch = {"deployed_length": 2.0, "payout": payout}
    cable = {"bending_stiffness": 1e-6, "minimum_bend_radius": 0.01, "breaking_load": 100.0}
    assert after(cable=cable, winch=winch) == ()


# Recordings -------------------------------------------------------------------------------------

TIMES = np.linspace(0.0, 5.0, 251)
PATH = np.column_stack((np.sin(TIMES), 0.1 * TIMES, np.zeros_like(TIMES)))


def measured() -> np.ndarray:
    return PATH + np.random.default_rng(3).normal(0.0, 7e-4, PATH.shape)


def test_a_clean_recording_passes() -> None:
    assert check_samples("ends.b", TIMES, measured(), 7e-4) == ()
    assert check_samples("ends.b", TIMES, PATH, 0.0) == ()


def test_gaps() -> None:
    kept = np.delete(np.arange(TIMES.size), slice(50, 70))
    only(check_samples("ends.b", TIMES[kept], measured()[kept], 7e-4), "ends.b: 1 gap", "0.42 s at 0.98 s")


def test_outliers() -> None:
    jumped = measured()
    jumped[[100, 180], 1] += [0.05, 0.3]
    only(check_samples("ends.b", TIMES, jumped, 7e-4), "2 outliers", "0.301 m off", "at 3.6 s", "empty")


def test_a_step_is_no_outlier() -> None:
    stepped = measured()
    stepped[100:, 0] += 0.5
    assert check_samples("ends.b", TIMES, stepped, 7e-4) == ()


def test_a_case_says_what_its_recording_lacks(tmp_path: Path) -> None:
    kept = np.delete(np.arange(TIMES.size), slice(50, 70))
    rows = np.column_stack((TIMES, measured() + np.array([1.5, 0, -2])))[kept]
    np.savetxt(tmp_path / "motion.csv", rows, delimiter=",", header="t,x,y,z", comments="")
    end = {"motion": "recorded", "file": str(tmp_path / "motion.csv"), "time_column": "t"}
    only(before(ends={"b": end}), "ends.b: 1 gap")


# Where they are seen ----------------------------------------------------------------------------

ODD = {"cable": {"breaking_load": 0.1}, "water": {"density": 1.025}}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "odd.yaml").write_text(case(**ODD).to_yaml())
    return tmp_path / "odd.yaml"


def call(*arguments: object) -> tuple[str, str]:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    return done.stdout, done.stderr


def test_commands_say_them_once(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    out, err = call("validate", file.name)
    assert out == "odd.yaml: ok\n"
    assert err.count("warning: odd.yaml: water.density is 1.025 kg/m3") == err.count("warning") == 1
    for command in ("info", "statics"):
        _, err = call(command, file.name)
        assert err.count("warning: water.density") == err.count("warning: the tension reaches") == 1
    _, err = call("run", file.name, "--quiet")
    assert err.count("warning: odd.yaml: water.density") == err.count("warning: odd.yaml: the tension") == 1
    kept = warnings_of(cablesim.read("odd.nc"))
    assert [sentence.split()[0] for sentence in kept] == ["water.density", "the"]


def test_a_report_shows_them() -> None:
    dataset = cablesim.simulate(case(**ODD))
    page = report_html(dataset)
    for sentence in warnings_of(dataset):
        assert page.count(f"<li>{sentence}</li>") == 1
    assert 'aria-label="Warnings"' not in report_html(cablesim.simulate(case()))


def test_a_simulation_says_them_at_any_time() -> None:
    simulation = cablesim.Simulation(case(cable={"breaking_load": 50.0}, ends=moving([0.0, 0, 0])))
    assert simulation.warnings == ()
    simulation.step(1.0, velocity_b=[3.2, 0.0, 0.0])
    assert any("cable.breaking_load" in sentence for sentence in simulation.warnings)


GALLERY = sorted((Path(__file__).parents[1] / "cases").glob("*.yaml"))


@pytest.mark.parametrize("file", GALLERY, ids=lambda file: file.stem)
def test_the_gallery_runs_without_any(file: Path) -> None:
    given = cablesim.load_case(file)
    kept = given.output.model_copy(update={"variables": ("closure_error",), "markers": ()})
    dataset = cablesim.simulate(given.model_copy(update={"output": kept}))
    assert dataset.attrs["status"] == "completed"
    assert warnings_of(dataset) == ()
