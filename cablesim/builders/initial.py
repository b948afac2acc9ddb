"""The shape at the start of a case.

Depends on: review, case, motion, recording, saved_state, scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cablesim import recording, scene
from cablesim.builders.review import STRAIN_LIMIT, Review, Stop
from cablesim.case import models
from cablesim.case.errors import Location
from cablesim.saved_state import SavedStateError, read_saved_state
from cablesim.scene import Vector

_STRAIGHT = 1e-6  # slack over length that still counts as taut
_SPEED = 1e-3  # part of its speed by which a start may miss that of a held end
_SPAN = 1e-3  # part of the length by which markers may miss the ends of the cable
_OFF_END = 0.05  # part of the length by which a marker may miss the end it stands for


def build_initial(
    review: Review,
    cable: scene.Cable | None,
    ends: tuple[scene.End, scene.End] | None,
    attachments: tuple[tuple[scene.Attachment, ...], tuple[scene.Imu, ...]] | None,
) -> scene.InitialShape:
    """Make the shape at t = 0; a part that was refused already is ``None``."""
    given = review.case.initial
    if isinstance(given, models.StateStart):
        return _saved_state(review, given, ends)
    if isinstance(given, models.MarkersStart):
        arc, positions = _markers(review, given)
        shape: scene.GivenShape = _marker_shape(review, arc, positions, ends)
    elif cable is None or ends is None or attachments is None:
        raise Stop  # refused already; what follows needs them
    elif isinstance(given, models.TautStart):
        shape = _taut(review, given, ends)
    elif isinstance(given, models.CatenaryStart):
        shape = _catenary(review, cable, ends)
    else:
        shape = _equilibrium(review, given, cable, ends, attachments[0])
    return replace(shape, velocity=_velocity(review, given, ends))


def _equilibrium(
    review: Review,
    given: models.EquilibriumStart,
    cable: scene.Cable,
    ends: tuple[scene.End, scene.End],
    bodies: Sequence[scene.Attachment],
) -> scene.EquilibriumShape:
    if all(end.motion is None for end in ends):
        _check_drifting(review, given, cable, bodies)
    return scene.EquilibriumShape(guess=None if given.through is None else np.array(given.through))


# How it moves ------------------------------------------------------------------------------------


def _velocity(
    review: Review, given: models.MovingStart, ends: tuple[scene.End, scene.End] | None
) -> scene.StartVelocity | None:
    """The velocity that the case gives, as its held ends have it too."""
    if given.velocity is None and given.velocities is None:
        return None
    rows = np.array([[0.0, *given.velocity]] if given.velocity is not None else given.velocities)
    where: Location = ("initial", "velocity" if given.velocity is not None else "velocities")
    arc, length = rows[:, 0], review.start_length
    falls = np.flatnonzero(np.diff(arc) <= 0)
    if falls.size:
        raise review.refuse(
            (*where, int(falls[0]) + 1, 0),
            f"does not lie beyond the row above it, {arc[falls[0]]:g} m",
            "Sort the rows from A to B and leave out repeated ones.",
        )
    beyond = np.flatnonzero((arc < 0) | (arc > length * (1 + _STRAIGHT)))
    if beyond.size:
        raise review.refuse(
            (*where, int(beyond[0]), 0),
            f"is not on the cable, which goes from 0 to {length:g} m",
            f"Give a place on it, or correct `{review.length_key}`.",
        )
    velocity = scene.StartVelocity(arc=arc, velocities=rows[:, 1:])
    for name, end, there in zip("ab", ends or (), velocity.at(np.array([0.0, length])), strict=False):
        if end.motion is not None:
            _check_velocity_of_end(review, where, name, there, end.motion.velocity(0.0))
    return velocity


def _check_velocity_of_end(review: Review, where: Location, name: str, given: Vector, moved: Vector) -> None:
    """Refuse a velocity that a held end contradicts by more than the digits of a case."""
    if np.linalg.norm(given - moved) > _SPEED * max(np.linalg.norm(given), np.linalg.norm(moved)):
        raise review.refuse(
            where,
            f"moves end {name.upper()} with {np.round(given, 4).tolist()} m/s, but ends.{name} moves it with "
            f"{np.round(moved, 4).tolist()} m/s at t = 0",
            f"Let ends.{name} start with that velocity, free it, or give `velocities` that agree with it.",
        )


# Shapes -------------------------------------------------------------------------------------------


def _saved_state(
    review: Review, given: models.StateStart, ends: tuple[scene.End, scene.End] | None
) -> scene.SavedState:
    file = review.file(given.file, ("initial", "file"))
    try:
        state = read_saved_state(file, given.time)
    except SavedStateError as error:
        raise review.refuse(("initial", "file"), str(error), "Give another result or time.") from error
    length = review.start_length
    if abs(state.arc[-1] - length) > 1e-6 * length:
        raise review.refuse(
            ("initial", "file"),
            f"is the state of {state.arc[-1]:g} m of cable, not of {length:g} m",
            f"Give a {review.length_key} of {state.arc[-1]:.9g} m, or the state of such a cable.",
        )
    for end, place, name in zip(ends or (), state.positions[[0, -1]], "ab", strict=False):
        if end.motion is not None:
            _check_saved_end(review, name, float(np.linalg.norm(end.motion.position(0.0) - place)))
    return state


def _check_saved_end(review: Review, name: str, distance: float) -> None:
    if distance > _SPAN * review.start_length:
        raise review.refuse(
            ("initial", "file"),
            f"has end {name} {distance:.3g} m from where ends.{name} begins",
            f"Let ends.{name} begin where the earlier run ended.",
        )


def _check_drifting(
    review: Review, given: models.EquilibriumStart, cable: scene.Cable, bodies: Sequence[scene.Attachment]
) -> None:
    """With both ends free only a neutral cable can rest, and only where it is put."""
    weights = [(body.mass - review.case.water.density * body.volume) * review.case.gravity for body in bodies]
    dry = cable.mass_per_length * review.case.gravity
    neutral = abs(cable.wet_weight) <= 1e-9 * dry and all(abs(weight) <= 1e-9 for weight in weights)
    if not neutral:
        raise review.refuse(
            ("initial",),
            "there is no equilibrium: both ends are free and the cable is not neutral",
            "Start `taut` with a `direction`, or hold an end.",
            None,
        )
    if given.through is None:
        raise review.refuse(
            ("initial",),
            "any shape of a free neutral cable is in equilibrium",
            "Say which with `through`, or start `taut` with a `direction`.",
            None,
        )


def _taut(review: Review, given: models.TautStart, ends: tuple[scene.End, scene.End]) -> scene.TautShape:
    direction = None if given.direction is None else review.unit(given.direction, ("initial", "direction"))
    motion_a, motion_b = ends[0].motion, ends[1].motion
    if motion_a is not None and motion_b is not None:
        _check_taut_span(review, given, direction, motion_b.position(0.0) - motion_a.position(0.0))
        return scene.TautShape(stretched=given.stretched)
    if direction is None:
        raise review.refuse(
            ("initial",),
            "`taut` with a free end does not say its direction",
            "Add `direction`, from A to B, for instance [0, 0, -1].",
            None,
        )
    places = _places_of_free_ends(review, direction) if motion_a is None and motion_b is None else None
    return scene.TautShape(direction=direction, places=places, stretched=given.stretched)


def _check_taut_span(
    review: Review, given: models.TautStart, direction: Vector | None, chord: Vector
) -> None:
    """Refuse a straight cable that does not fit between its two held ends."""
    length, distance = review.start_length, float(np.linalg.norm(chord))
    if distance < length * (1 - _STRAIGHT):
        raise review.refuse(
            ("initial", "shape"),
            f"the ends are {distance:.6g} m apart and the cable is {length:g} m long: it hangs slack",
            "Use `catenary` or `equilibrium`, or move the ends apart.",
        )
    if not given.stretched and distance > length * (1 + _STRAIGHT):
        raise review.refuse(
            ("initial", "stretched"),
            f"the ends are {distance:.7g} m apart and the cable is {length:g} m long: it is stretched",
            f"Leave it out, bring the ends together, or give a {review.length_key} of {distance:.9g} m.",
        )
    if direction is not None and np.linalg.norm(direction - chord / distance) > 0.01:
        raise review.refuse(
            ("initial", "direction"),
            "is not the direction between the two prescribed ends",
            f"Leave it out; it is {np.round(chord / distance, 4).tolist()}.",
        )


def _places_of_free_ends(review: Review, direction: Vector) -> Vector:
    """Places (2, 3) of the ends of a straight cable that nothing holds, as one of them says."""
    length = review.start_length
    free_a, free_b = (getattr(end, "position", None) for end in (review.case.ends.a, review.case.ends.b))
    if free_a is None and free_b is None:
        raise review.refuse(
            ("ends",),
            "both ends are free and none says where it starts",
            "Add `position` to one of them.",
            None,
        )
    if free_a is None:
        return np.array([np.array(free_b) - length * direction, free_b])
    places = np.array([free_a, np.array(free_a) + length * direction])
    if free_b is not None and np.linalg.norm(places[1] - free_b) > _STRAIGHT * length:
        raise review.refuse(
            ("ends", "b", "position"),
            "is not where a straight cable from end A ends",
            f"Leave it out; it is {np.round(places[1], 6).tolist()}.",
        )
    return places


def _catenary(review: Review, cable: scene.Cable, ends: tuple[scene.End, scene.End]) -> scene.CatenaryShape:
    where: Location = ("initial", "shape")
    held = [end.motion for end in ends if end.motion is not None]
    if len(held) < 2:
        raise review.refuse(
            where, "hangs between two prescribed ends, one is free", "Use `taut` with a `direction`."
        )
    distance = float(np.linalg.norm(held[1].position(0.0) - held[0].position(0.0)))
    neutral = abs(cable.wet_weight) <= 1e-9 * max(cable.mass_per_length * review.case.gravity, 1e-12)
    if neutral and distance < review.start_length:
        raise review.refuse(
            where,
            "does not exist for a neutral cable with slack",
            "Give its shape with `markers`, or use `equilibrium` with `through`.",
        )
    return scene.CatenaryShape()


def _markers(review: Review, given: models.MarkersStart) -> tuple[Vector, Vector]:
    if given.file is None:
        arc, positions = np.array(given.arc), np.array(given.positions)
        if len(arc) != len(positions):
            raise review.refuse(
                ("initial", "positions"),
                f"has {len(positions)} rows for {len(arc)} values of `arc`",
                "Give one position for each marker.",
            )
        return arc, positions
    where: Location = ("initial", "file")
    file = review.file(given.file, where)
    options: dict[str, Any] = {"unit_factor": review.length_factor(given.unit, ("initial", "unit"))}
    if given.columns is not None:
        options["columns"] = given.columns
    with review.trying(where, "Check the file, `arc_column`, `columns` and `where`."):
        arc, positions = recording.read_markers(
            file, arc_column=str(given.arc_column), where=given.where, **options
        )
        if isinstance(given.origin, models.MeanOfRows):
            rows = recording.read_recording(
                file, format="csv", sample_interval=1.0, where=given.origin.where, **options
            )  # the times do not matter for a mean
            centre = rows[1].mean(axis=0)
        else:
            centre = np.array(given.origin)
    return arc, review.upright(positions - centre, given.up, ("initial",))


def _marker_shape(
    review: Review, arc: Vector, positions: Vector, ends: tuple[scene.End, scene.End] | None
) -> scene.MarkerShape:
    length = review.start_length
    where: Location = ("initial",) if getattr(review.case.initial, "file", None) else ("initial", "arc")
    falls = np.flatnonzero(np.diff(arc) <= 0)
    if falls.size:
        raise review.refuse(
            (*where, int(falls[0]) + 1),
            f"the markers' arc does not increase: {arc[falls[0] + 1]:g} m after {arc[falls[0]]:g} m",
            "Sort the markers from A to B and leave out repeated ones.",
            None,
        )
    if abs(arc[0]) > _SPAN * length or abs(arc[-1] - length) > _SPAN * length:
        raise review.refuse(
            where,
            f"the markers span {arc[0]:g} to {arc[-1]:g} m of a cable from 0 to {length:g} m",
            f"Add markers at both ends, or correct `{review.length_key}`.",
            None,
        )
    arc = arc.copy()
    arc[[0, -1]] = 0.0, length
    if ends is not None:
        positions = _tie(review, positions, ends)
    chords, arcs = np.linalg.norm(np.diff(positions, axis=0), axis=1), np.diff(arc)
    worst = int(np.argmax(chords / arcs))
    if chords[worst] > arcs[worst] * (1 + STRAIN_LIMIT):
        raise review.refuse(
            where,
            f"markers {worst} and {worst + 1} are {chords[worst]:.4g} m apart "
            f"with {arcs[worst]:.4g} m of cable between them",
            "Check units, `arc` and positions: a chord cannot be longer than its arc.",
            None,
        )
    return scene.MarkerShape(arc=arc, positions=positions)


def _tie(review: Review, positions: Vector, ends: tuple[scene.End, scene.End]) -> Vector:
    """Put the outermost markers exactly on the prescribed ends; they differ by measurement noise."""
    positions = positions.copy()
    for name, index, end in (("a", 0, ends[0]), ("b", -1, ends[1])):
        if end.motion is None:
            continue
        place = end.motion.position(0.0)
        off = float(np.linalg.norm(place - positions[index]))
        if off > _OFF_END * review.start_length:
            raise review.refuse(
                ("initial",),
                f"the {'first' if name == 'a' else 'last'} marker is {off:.4g} m from end {name.upper()} "
                f"at t = 0, {np.round(place, 4).tolist()}",
                "Check `origin`, `up` and the order of the markers (from A to B).",
                np.round(positions[index], 4).tolist(),
            )
        positions[index] = place
    return positions
