"""From a case to a scene: SI data with the motions made, and a refusal of what cannot run.

Depends on: builders, case, scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from cablesim import scene
from cablesim.builders.attachments import build_attachments
from cablesim.builders.cable import SEGMENTS_LIMIT as SEGMENTS_LIMIT
from cablesim.builders.cable import build_cable, build_mesh_rules
from cablesim.builders.ends import STRETCH_LIMIT as STRETCH_LIMIT
from cablesim.builders.ends import build_ends
from cablesim.builders.initial import build_initial
from cablesim.builders.output import build_output
from cablesim.builders.output import default_interval as default_interval
from cablesim.builders.review import STATES_LIMIT as STATES_LIMIT
from cablesim.builders.review import STRAIN_LIMIT as STRAIN_LIMIT
from cablesim.builders.review import Review
from cablesim.builders.water import build_water
from cablesim.builders.winch import build_winch
from cablesim.case import Case, CaseError, models
from cablesim.plausibility.before import check_scene


def build_scene(case: Case, *, directory: str | Path | None = None) -> scene.Scene:
    """Turn a case into the data a simulation needs, and refuse a case that cannot run.

    Parameters
    ----------
    case : Case
        The case.
    directory : path, optional
        Where relative paths in the case start; default: the directory of the case.

    Raises
    ------
    CaseError
        With everything found wrong: place in the case, value received, remedy.
    """
    review = Review(case, case.directory if directory is None else Path(directory))
    parts = _build_parts(review)
    if review.problems:
        raise CaseError(sorted(review.problems, key=lambda problem: problem.line or 0))
    bodies, imus = parts["attachments"]
    end_a, end_b = parts["ends"]
    built = scene.Scene(
        name=case.name,
        gravity=case.gravity,
        water=parts["water"],
        cable=parts["cable"],
        mesh=parts["mesh"],
        attachments=bodies,
        imus=imus,
        end_a=end_a,
        end_b=end_b,
        initial=parts["initial"],
        duration=case.simulation.duration,
        numerics=_numerics(case.simulation),
        output=parts["output"],
        description=case.description,
        source=case.to_yaml(),
        winch=parts["winch"],
    )
    return replace(built, warnings=(*review.warnings, *check_scene(built)))


def _build_parts(review: Review) -> dict[str, Any]:
    """Parts of the scene by name; one that was refused is missing."""
    parts: dict[str, Any] = {}

    def build(name: str, builder: Callable[..., Any], *others: str) -> None:
        with review.collect():
            parts[name] = builder(review, *(parts.get(other) for other in others))

    build("cable", build_cable)
    build("water", build_water)
    build("mesh", build_mesh_rules)
    build("attachments", build_attachments)
    build("winch", build_winch)
    build("ends", build_ends, "winch")
    build("output", build_output)
    build("initial", build_initial, "cable", "ends", "attachments")
    return parts


def _numerics(given: models.Simulation) -> scene.Numerics:
    return scene.Numerics(
        relative_tolerance=given.relative_tolerance,
        max_order=given.max_order,
        max_step=given.max_step,
        max_steps=given.max_steps,
        time_limit=given.time_limit,
        linear_solver=given.linear_solver,
        strain_feedback=given.strain_feedback,
        closure_feedback=given.closure_feedback,
        mesh_damping=given.mesh_damping,
        skip=given.skip,
    )
