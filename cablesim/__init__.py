"""Dynamics of tethers in water: an implicit DAE on SUNDIALS IDA, results as labelled datasets.

>>> import cablesim
>>> case = cablesim.load_case("cases/sway.yaml")  # doctest: +SKIP
>>> trajectory = cablesim.simulate(case)  # doctest: +SKIP

Public names are loaded when first used, so that importing the package stays quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from cablesim.build import build_scene as build_scene
    from cablesim.case import Case as Case
    from cablesim.case import CaseError as CaseError
    from cablesim.case import case_schema as case_schema
    from cablesim.case import load_case as load_case
    from cablesim.scene import Scene as Scene
    from cablesim.simulation import Observation as Observation
    from cablesim.simulation import Progress as Progress
    from cablesim.simulation import Simulation as Simulation
    from cablesim.simulation import Snapshot as Snapshot
    from cablesim.simulation import simulate as simulate
    from cablesim.statics import StaticsError as StaticsError
    from cablesim.trajectory.file import read as read
    from cablesim.trajectory.file import write as write

_HOMES = {
    "Case": "case",
    "CaseError": "case",
    "case_schema": "case",
    "load_case": "case",
    "build_scene": "build",
    "Scene": "scene",
    "Status": "status",
    "Observation": "simulation",
    "Progress": "simulation",
    "Simulation": "simulation",
    "Snapshot": "simulation",
    "simulate": "simulation",
    "StaticsError": "statics",
    "read": "trajectory.file",
    "write": "trajectory.file",
}

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("cablesim")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
