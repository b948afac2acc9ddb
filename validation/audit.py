"""Runs one random scene and audits it.

Audited: the status and its sentence; finite numbers in the dataset and in the netCDF file read back; the
closing of the cable; mass; and energy.
"""

from __future__ import annotations

import signal
import tempfile
import traceback
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr
from energy_balance import energy_created
from random_scenes import Plan, describe, make_scene

from cablesim import Simulation, StaticsError, read, write
from cablesim.physics.parameters import MASS
from cablesim.scene import Scene

CLOSURE_LIMIT = 10.0  # closure error over rtol and length
ENERGY_LIMIT = 30.0  # energy created over rtol and the energy that was turned over
HANG_FACTOR, HANG_EXTRA = 8.0, 60.0  # a scene hangs after this many time limits, and seconds to compile in


@dataclass(frozen=True, kw_only=True)
class Report:
    """What came of one scene.

    `outcome` is ``completed``, a status of a stopped run, ``no rest shape``, ``hung`` or ``error``;
    `faults` names what the audit found, and is empty for a good run.
    """

    index: int
    outcome: str
    message: str
    faults: str
    wall: float = 0.0  # [s] of the integration
    reached: float = 0.0  # share of the duration
    calls: int = 0  # of the residual
    closure: float = 0.0  # largest closure error over rtol and length
    energy: float = float("nan")  # energy created over rtol and turnover; NaN where there is a current
    mass: float = 0.0  # relative error
    damped: bool = True
    scene: str = ""


class _Hung(Exception):  # noqa: N818
    pass


def audit(plan: Plan, index: int) -> Report:
    """Make, run and audit one scene; never raises."""
    scene = make_scene(plan, index)
    about = {"index": index, "damped": scene.cable.structural_damping > 0.0, "scene": describe(scene)}
    try:
        with warnings.catch_warnings(record=True) as caught, _alarm(plan.time_limit):
            warnings.simplefilter("always")
            simulation = Simulation(scene)
            dataset = simulation.run()
            report = _examine(index, scene, simulation, dataset)
    except StaticsError as error:
        return Report(outcome="no rest shape", message=str(error), faults="", **about)
    except _Hung:
        return Report(outcome="hung", message="", faults="hung", **about)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return Report(outcome="error", message=text, faults="error", **about)
    said = sorted({f"warning: {w.message} ({Path(w.filename).name}:{w.lineno})" for w in caught})
    return replace(report, faults="; ".join([*filter(None, [report.faults]), *said]), **about)


class _alarm:  # noqa: N801
    """Raises _Hung in the main thread long after the time limit should have stopped the run."""

    def __init__(self, time_limit: float) -> None:
        self._seconds = HANG_FACTOR * time_limit + HANG_EXTRA

    def __enter__(self) -> None:
        self._before = signal.signal(signal.SIGALRM, self._ring)
        signal.setitimer(signal.ITIMER_REAL, self._seconds)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._before)

    @staticmethod
    def _ring(*_: object) -> None:
        raise _Hung


def _examine(index: int, scene: Scene, simulation: Simulation, dataset: xr.Dataset) -> Report:
    rtol, status = scene.numerics.relative_tolerance, dataset.attrs["status"]
    closure = float(dataset.closure_error.max()) / (rtol * scene.cable.length)
    energy = energy_created(scene, dataset, ENERGY_LIMIT)
    mass = _mass_error(scene, simulation)
    checks = {
        "not finite": not _finite(dataset),
        "file differs": not _same_from_file(dataset),
        "no sentence": not str(dataset.attrs["message"]).rstrip().endswith("."),
        "stopped silently": status == "completed" and abs(dataset.time.values[-1] - scene.duration) > 1e-9,
        "closure": closure > CLOSURE_LIMIT,
        "energy created": energy > ENERGY_LIMIT,
        "mass": mass > 1e-9,
    }
    return Report(
        index=index,
        outcome=status,
        message=dataset.attrs["message"],
        faults="; ".join(name for name, bad in checks.items() if bad),
        wall=dataset.attrs["wall_seconds"],
        reached=float(dataset.time.values[-1]) / scene.duration,
        calls=dataset.attrs["residual_calls"],
        closure=closure,
        energy=energy,
        mass=mass,
    )


def _finite(dataset: xr.Dataset) -> bool:
    numbers = (variable for variable in dataset.variables.values() if variable.dtype.kind == "f")
    return all(bool(np.isfinite(variable.values).all()) for variable in numbers)


def _same_from_file(dataset: xr.Dataset) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.nc"
        write(dataset, path)
        again = read(path)
    return _finite(again) and bool(again.equals(dataset))


def _mass_error(scene: Scene, simulation: Simulation) -> float:
    """Dry mass on the nodes of the model against that of the scene."""
    mass = scene.cable.mass_per_length * scene.cable.length + sum(a.mass for a in scene.attachments)
    return abs(float(simulation.model.loads(0.0)[:, MASS].sum()) / mass - 1.0)
