"""What the commands show as tables and lines: a case's mesh and scales, a rest shape, how runs ended.

Depends on: terminal, and what it describes, imported when needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cablesim.cli.terminal import table

if TYPE_CHECKING:
    import xarray as xr

    from cablesim.batch import RunSummary
    from cablesim.scene import Scene
    from cablesim.simulation import Simulation


def mesh_rows(simulation: Simulation) -> dict[str, str]:
    """Cable, attachments, winch, number of unknowns and of states."""
    lengths, scene = simulation.mesh.lengths, simulation.scene
    states = int(scene.duration / scene.output.interval + 1e-9) + 1
    bodies = ", ".join(f"{a.name} at {a.position:g} m" for a in scene.attachments)
    return {
        "cable": f"{scene.cable.length:g} m in {lengths.size} segments of {_range(lengths, 'm')}",
        "attachments": bodies or "none",
        "winch": _winch_text(scene),
        "unknowns": f"{simulation.model.layout.size}{' at the start' if scene.winch else ''}",
        "run": f"{scene.duration:g} s, a state kept every {scene.output.interval:g} s ({states} states)",
    }


_COMPRESSED = (0.35, 0.85)
"""Least and largest share of its numbers that a file takes; nine runs took 0.37 to 0.82."""

_PROGRAM, _COPIES, _COPIES_ON_WINCH = 260e6, 2.0, 3.5
"""Bytes of the program itself, and how often what is kept is in memory at the end, measured likewise."""


def size_rows(simulation: Simulation, start: xr.Dataset) -> dict[str, str]:
    """About how large the result file and the memory of a run will be.

    `start` is the result of no duration, whose variables are those of the run.
    """
    scene = simulation.scene
    states = int(scene.duration / scene.output.interval + 1e-9) + 1
    kept = states * sum(given.nbytes for given in start.data_vars.values() if "time" in given.dims)
    low, high = (f"{share * kept / 1e6:.2g}" for share in _COMPRESSED)
    unknowns = simulation.model.layout.dimension * 2 + simulation.model.layout.cell * simulation.mesh.segments
    history = 2 * 8 * states * unknowns
    copies = _COPIES if scene.winch is None else _COPIES_ON_WINCH
    memory = _PROGRAM + copies * (kept + history)
    return {
        "result file": f"some {low} to {high} MB",
        "memory": f"some {memory / 1e9:.2g} GB",
    }


def _winch_text(scene: Scene) -> str:
    """What is out at the start and who says what goes in and out."""
    from cablesim.scene import Control

    if scene.winch is None:
        return "none"
    payout = scene.winch.payout
    if isinstance(payout, Control):
        driver = f"a controller every {payout.period:g} s"
    else:
        driver = f"a program of up to {payout.speed_limit(scene.duration):.3g} m/s"
    return f"{scene.winch.deployed_length:g} m out at the start; driven by {driver}"


def needs_rows(simulation: Simulation) -> dict[str, str]:
    """What is computed and what is skipped."""
    from cablesim.physics.needs import describe_needs

    return describe_needs(simulation.model.features)


def weight_rows(simulation: Simulation) -> dict[str, str]:
    """Weights of cable and bodies, dry and in water, and the sections of weight and added mass."""
    scene = simulation.scene
    cable = scene.cable
    total, largest = cable.wet_weight * cable.length, abs(cable.wet_weight * cable.length)
    rows = {
        "cable, dry": f"{cable.mass_per_length * cable.length:.4g} kg",
        "cable, in water": f"{cable.wet_weight * cable.length:.4g} N ({cable.wet_weight:.4g} N/m)",
        "displaced section": _section_text(cable.displaced_section, cable.diameter),
        "section of added mass": _section_text(cable.added_mass_section, cable.diameter),
    }
    for body in scene.attachments:
        weight = (body.mass - scene.water.density * body.volume) * scene.gravity
        rows[f"{body.name}, in water"] = f"{weight:.4g} N"
        total, largest = total + weight, max(largest, abs(weight))
    if abs(total) <= 1e-12 * largest:
        return rows | {"all, in water": "0 N (neutral)"}
    return rows | {"all, in water": f"{total:.4g} N ({'sinks' if total > 0 else 'floats'})"}


def _section_text(section: float, diameter: float) -> str:
    """A section and what it is of the circle of the outer diameter."""
    from math import pi

    share = section / (pi * diameter**2 / 4)
    of_circle = "the outer section" if abs(share - 1) < 1e-9 else f"{100 * share:.3g} % of the outer section"
    return f"{1e6 * section:.4g} mm^2 ({of_circle})"


def scale_rows(simulation: Simulation) -> dict[str, str]:
    """Wave speeds, and the highest frequencies of a chain of equal shortest segments."""
    from math import pi, sqrt

    cable, shortest = simulation.scene.cable, float(simulation.mesh.lengths.min())
    axial = sqrt(cable.axial_stiffness / cable.mass_per_length)
    added = cable.added_mass_normal * simulation.scene.water.density * cable.added_mass_section
    scales = simulation.scales
    rows = {
        "tension": f"{scales.tension:.4g} N",
        "velocity": f"{scales.velocity:.4g} m/s",
        "axial wave speed": f"{axial:.4g} m/s (sqrt(EA/m))",
        "transverse wave speed": f"{sqrt(scales.tension / (cable.mass_per_length + added)):.4g} m/s",
        "highest mesh frequency": f"{axial / (pi * shortest):.4g} Hz (axial)",
    }
    if cable.bending_stiffness > 0:
        bending = 2 / pi * sqrt(cable.bending_stiffness / (cable.mass_per_length + added)) / shortest**2
        rows["highest bending frequency"] = f"{bending:.4g} Hz"
    return rows


def rest_rows(simulation: Simulation, rest: xr.Dataset) -> dict[str, str]:
    """How a rest shape was found, its tensions and its lowest point."""
    import numpy as np

    from cablesim.results import material_coordinates

    initial = simulation.initial
    position = rest["position"].isel(time=0).values
    lowest = int(np.nanargmin(position[:, 2]))
    place = ", ".join(f"{value:.4g}" for value in position[lowest])
    s = material_coordinates(rest)[0, lowest]
    tension = rest["tension"].isel(time=0).dropna("segment").values
    return {
        "found by": f"{initial.rung.value}, {initial.iterations} Newton iterations",
        "force left on a node": f"{initial.residual:.2g} N",
        "tension at end A": f"{tension[0]:.4g} N",
        "tension at end B": f"{tension[-1]:.4g} N",
        "tension along the cable": _range(tension, "N"),
        "lowest point": f"({place}) m, s = {s:.4g} m",
    }


def _range(values: Any, unit: str) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def result_line(summary: RunSummary) -> str:
    """Tell status, simulated time, wall time, real-time factor, work and file on one line."""
    from cablesim.batch import name_of

    name = name_of(summary.case)
    if summary.file is None:
        return f"{name}: {summary.status}"
    return (
        f"{name}: {summary.status}, {summary.simulated_seconds:g} s in {summary.wall_seconds:.3g} s, "
        f"{summary.real_time_factor:.3g} x real time, {summary.residual_calls} residual calls, {summary.file}"
    )


def summary_table(summaries: list[RunSummary]) -> Any:
    """How each run ended, a line each."""
    shown = table("case", "status", "simulated", "wall", "x real time", "file")
    for summary in summaries:
        numbers = ["", "", ""]
        if summary.file is not None:
            numbers = [
                f"{summary.simulated_seconds:g} s",
                f"{summary.wall_seconds:.3g} s",
                f"{summary.real_time_factor:.3g}",
            ]
        shown.add_row(summary.case.stem, summary.status, *numbers, str(summary.file or "-"))
    return shown
