"""What a case keeps of its run.

Depends on: review, case, scene, and the names of what a trajectory holds.
"""

from __future__ import annotations

import math

import numpy as np

from cablesim import scene
from cablesim.builders.review import STATES_LIMIT, Review
from cablesim.case import models
from cablesim.case.errors import Location, suggestion
from cablesim.scene import Vector
from cablesim.stops import SAME_TIME
from cablesim.trajectory.attributes import OF_THE_USER
from cablesim.trajectory.variables import VARIABLES

_MARKERS = 100_000  # most places whose positions are kept


def build_output(review: Review) -> scene.Output:
    """Make what is kept of the run."""
    given, duration = review.case.output, review.case.simulation.duration
    interval = default_interval(duration) if given.interval is None else given.interval
    if duration <= SAME_TIME:
        review.note(
            ("simulation", "duration"),
            f"is no longer than {SAME_TIME:g} s, which counts as no time",
            "Give a longer run.",
        )
    if interval > duration * (1 + 1e-9):
        review.note(
            ("output", "interval"),
            f"is longer than the run of {duration:g} s",
            f"Give {default_interval(duration):g} s, for instance.",
        )
    if duration / interval > STATES_LIMIT:
        review.note(
            ("output", "interval"),
            f"makes {duration / interval:.3g} states to keep, more than {STATES_LIMIT}",
            f"Give {default_interval(duration):g} s, for instance.",
        )
    for index, name in enumerate(given.variables):
        if name not in VARIABLES:
            review.note(
                ("output", "variables", index),
                "is not a variable of a trajectory",
                suggestion(name, VARIABLES),
            )
    for name in given.attributes:
        if name not in OF_THE_USER:
            review.note(
                ("output", "attributes", name),
                "is not an attribute that a case can give",
                suggestion(name, OF_THE_USER),
            )
    return scene.Output(
        interval=interval,
        variables=given.variables,
        markers=_output_markers(review),
        precision=given.precision,
        attributes=given.attributes,
    )


def _output_markers(review: Review) -> Vector:
    given, length = review.case.output.markers, review.case.cable.length
    where: Location = ("output", "markers")
    if isinstance(given, models.SpacedMarkers):
        spacing = length if given.spacing is None else given.spacing
        count = length / spacing + 1 if given.count is None else given.count
        if count > _MARKERS:
            raise review.refuse(where, f"makes {count:.3g} markers, more than {_MARKERS}", "Keep fewer.")
        if given.count is not None:
            return np.linspace(0.0, length, given.count)
        if spacing > length:
            raise review.refuse(
                (*where, "spacing"), f"is longer than the cable, {length:g} m", "Give a shorter one."
            )
        return np.minimum(np.arange(int(length / spacing * (1 + 1e-12)) + 1) * spacing, length)
    for index, position in enumerate(given):
        if position > length:
            review.note((*where, index), f"is beyond the cable, {length:g} m", f"Give 0 to {length:g} m.")
    return np.array(given, dtype=float)


def default_interval(duration: float) -> float:
    """Choose a round time (1, 2 or 5 times a power of ten) that cuts `duration` into 500 to 1250 parts.

    It is 1 ms at the least, unless the run is shorter.
    """
    target = duration / 500
    decade = 10.0 ** math.floor(math.log10(target) + 1e-9)
    step = max(factor for factor in (1, 2, 5) if factor * decade <= target * (1 + 1e-9)) * decade
    return min(max(float(f"{step:.3g}"), 1e-3), duration)
