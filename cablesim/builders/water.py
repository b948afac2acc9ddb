"""The water of a case and its current.

Depends on: review, case, current_map, scene.
"""

from __future__ import annotations

import numpy as np

from cablesim import scene
from cablesim.builders.review import Review
from cablesim.case import models
from cablesim.case.errors import Location
from cablesim.current_map import read_current_map


def build_water(review: Review) -> scene.Water:
    """Make the water and its current."""
    given = review.case.water
    if given.current == "none":
        return scene.Water(density=given.density, surface=given.surface)
    where: Location = ("water", "current")
    if given.density == 0:
        raise review.refuse(
            where, "there is no current in vacuum (water.density is 0)", "Leave one of them out.", None
        )
    return scene.Water(
        density=given.density, surface=given.surface, current=_current(review, given.current, where)
    )


def _current(
    review: Review,
    given: models.UniformCurrent | models.ProfileCurrent | models.MapCurrent,
    where: Location,
) -> scene.Current:
    if isinstance(given, models.UniformCurrent):
        return scene.UniformCurrent(velocity=np.array(given.velocity))
    if isinstance(given, models.ProfileCurrent):
        return _profile(review, given, where)
    file = review.file(given.file, (*where, "file"))
    with review.trying((*where, "file"), "Check the file and the names of its variables."):
        return read_current_map(file, given)


def _profile(review: Review, given: models.ProfileCurrent, where: Location) -> scene.ProfileCurrent:
    heights, velocities = np.array(given.heights), np.array(given.velocities)
    if len(heights) != len(velocities):
        raise review.refuse(
            (*where, "velocities"),
            f"has {len(velocities)} rows for {len(heights)} heights",
            "Give one velocity for each height.",
        )
    falls = np.flatnonzero(np.diff(heights) <= 0)
    if falls.size:
        raise review.refuse(
            (*where, "heights", int(falls[0]) + 1),
            f"is not above the height before it, {heights[falls[0]]:g} m",
            "Sort the heights upwards (z is up, depths are negative).",
        )
    return scene.ProfileCurrent(heights=heights, velocities=velocities)
