"""Results that were edited, and calls of Python that mean nothing, are refused in words."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import cable, scene

import cablesim
from cablesim import load_case, simulate
from cablesim.export import ExportError, export_csv
from cablesim.sensors import SensorError, imu_signals, truth
from cablesim.starters import starter_text


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "sway.yaml"
    path.write_text(starter_text("sway", "sway.yaml", "sway").replace("duration: 10 s", "duration: 0.5 s"))
    return simulate(load_case(path))


def in_other_units(run, name, unit, factor):
    edited = run.assign({name: run[name] * factor})
    edited[name].attrs = run[name].attrs | {"units": unit}
    return edited


EDITED = {
    "one time twice": (lambda run: run.isel(time=[0, 1, 1, 2]), "do not rise"),
    "places in mm": (lambda run: in_other_units(run, "position", "mm", 1e3), "`position` is in mm"),
    "tensions in kN": (lambda run: in_other_units(run, "tension", "kN", 1e-3), "`tension` is in kN"),
    "an infinite place": (
        lambda run: run.assign(position=run.position.where(run.time > 0, np.inf)),
        "infinite",
    ),
}


@pytest.mark.parametrize("name", EDITED)
def test_edited_results_are_refused(run, name, tmp_path):
    edit, words = EDITED[name]
    with pytest.raises(ExportError, match=words):
        export_csv(edit(run), tmp_path / "tables")
    with pytest.raises(SensorError, match=words):
        imu_signals(edit(run), {"imu": 1.0})


def test_tables_of_a_result_with_times_last(run, tmp_path):
    export_csv(run, tmp_path / "first")
    export_csv(run.transpose(..., "time"), tmp_path / "last")
    tables = sorted(path.name for path in (tmp_path / "first").glob("*.csv"))
    assert len(tables) > 1
    for name in tables:
        assert (tmp_path / "last" / name).read_text() == (tmp_path / "first" / name).read_text()


@pytest.mark.parametrize("order", [[2, 1, 0], [0, 1, 1]])
def test_states_of_a_result_whose_times_do_not_rise(run, order, tmp_path):
    cablesim.write(run.isel(time=order), tmp_path / "odd.nc")
    text = starter_text("sway", "sway.yaml", "sway").replace(
        "shape: equilibrium", "{shape: state, file: odd.nc}"
    )
    (tmp_path / "case.yaml").write_text(text.replace("initial:\n  {", "initial: {"))
    with pytest.raises(cablesim.CaseError, match="times do not rise"):
        simulate(load_case(tmp_path / "case.yaml"))


def test_more_samples_than_memory_holds(run):
    with pytest.raises(SensorError, match="too many samples"):
        imu_signals(run, {"imu": 1.0}, rate=1e9)


def test_errors_of_arrays_that_do_not_match():
    with pytest.raises(SensorError, match="give both alike"):
        truth.errors_of([1.0, 2.0], [1.0])


@pytest.mark.parametrize("thing", ["sway.yaml", None, 3])
def test_what_is_no_case(thing):
    with pytest.raises(TypeError, match="load_case"):
        simulate(thing)


@pytest.mark.parametrize("name", ["length", "mass_per_length", "axial_stiffness"])
@pytest.mark.parametrize("value", [0.0, -3.0, float("nan")])
def test_cables_that_cannot_be(name, value):
    with pytest.raises(ValueError, match=f"{name} is .*positive finite number"):
        replace(cable(), **{name: value})


@pytest.mark.parametrize(
    "velocity",
    [
        "north",
        [True, False, False],
        ["1", "0", "0"],
        [0.0, float("nan"), 0.0],
        np.ma.array([0.1, 0.2, 0.3], mask=[0, 1, 0]),
    ],
)
def test_velocities_that_are_none(velocity):
    simulation = cablesim.Simulation(scene())
    with pytest.raises(ValueError, match="three finite numbers"):
        simulation.step(0.1, velocity_b=velocity)


@pytest.mark.parametrize("duration", [True, "0.1", [0.1, 0.2], None])
def test_durations_that_are_none(duration):
    with pytest.raises(ValueError, match="give a positive number"):
        cablesim.Simulation(scene()).step(duration)


def test_a_snapshot_that_is_none():
    with pytest.raises(TypeError, match="snapshot"):
        cablesim.Simulation(scene()).restore(None)
