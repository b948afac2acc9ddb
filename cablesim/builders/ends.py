"""What the ends of the cable of a case do.

Depends on: review, case, motion, recording, scene.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cablesim import motion as motions
from cablesim import recording, scene
from cablesim.builders.review import STRAIN_LIMIT, Review, Stop
from cablesim.case import models
from cablesim.case.errors import Location, path_text
from cablesim.plausibility.recordings import check_samples
from cablesim.scene import Vector

STRETCH_LIMIT = 0.5
"""Strain that the motions of the ends may impose later: more is a mistake in a path or a length."""

_SAMPLES = 400  # times at which the distance of the ends is checked


def build_ends(review: Review, winch: scene.Winch | None) -> tuple[scene.End, scene.End]:
    """Make the motions and clamps of both ends; refuse ends that would tear the cable.

    `winch` is ``None`` also when it was refused already.
    """
    ends: list[scene.End] = []
    for name in ("a", "b"):
        with review.collect():
            ends.append(_end(review, getattr(review.case.ends, name), ("ends", name)))
    if len(ends) < 2:
        raise Stop
    end_a, end_b = ends
    if end_a.motion is not None and end_b.motion is not None:
        _check_start(review, end_a.motion, end_b.motion)
        _check_run(review, end_a.motion, end_b.motion, winch)
    return end_a, end_b


def _end(review: Review, given: Any, where: Location) -> scene.End:
    clamp = None
    if given.clamp is not None:
        clamp = review.unit(given.clamp, (*where, "clamp"))
        if isinstance(given, models.FreeEnd):
            review.note((*where, "clamp"), "clamps a free end", "Leave it out, or prescribe a motion.")
        if review.case.cable.bending_stiffness == 0:
            review.note(
                (*where, "clamp"),
                "clamps a cable without bending stiffness",
                "Leave it out, or give `cable.bending_stiffness`.",
            )
    if isinstance(given, models.FreeEnd):
        return scene.End(motion=None, clamp=clamp)
    motion = _motion(review, given, where)
    what = "recording" if isinstance(given, models.RecordedEnd) else "motion"
    review.known_long_enough(motion, what, (*where, "motion"))
    return scene.End(motion=motion, clamp=clamp)


def _motion(review: Review, given: Any, where: Location) -> motions.Motion:
    if isinstance(given, models.FixedEnd):
        return motions.fixed(given.position)
    if isinstance(given, models.RecordedEnd):
        return _recorded(review, given, where)
    if isinstance(given, models.HarmonicEnd):
        with review.trying(where, "Check period, ramp and duration."):
            return motions.harmonic(
                given.position,
                given.amplitude,
                given.period,
                phase=given.phase,
                ramp=given.ramp,
                duration=review.case.simulation.duration,
            )
    review.waypoint_times(given.waypoints, (*where, "waypoints"))
    table = np.array(given.waypoints, dtype=float)
    with review.trying((*where, "waypoints"), "Check the rows."):
        if isinstance(given, models.VelocityWaypointsEnd):
            return motions.velocity_waypoints(given.position, table[:, 0], table[:, 1:])
        rates = np.zeros((len(table), 4))
        order = ("surge", "sway", "heave", "yaw")
        rates[:, [order.index(channel) for channel in given.channels]] = table[:, 1:]
        return motions.rov_waypoints(
            given.position, given.heading, table[:, 0], rates, given.attachment_offset
        )


def _recorded(review: Review, given: models.RecordedEnd, where: Location) -> motions.Motion:
    file = review.file(given.file, (*where, "file"))
    factor = review.length_factor(given.unit, (*where, "unit"))
    options: dict[str, Any] = {
        "format": given.format,
        "time_column": given.time_column,
        "sample_interval": given.sample_interval,
        "marker": given.marker,
        "unit_factor": factor,
    }
    if given.columns is not None:
        options["columns"] = given.columns
    with review.trying((*where, "file"), "Check the file, `format`, `columns` and `where`."):
        times, positions = recording.read_recording(file, where=given.where, **options)
        if isinstance(given.origin, models.MeanOfRows):
            centre = recording.read_recording(file, where=given.origin.where, **options)[1].mean(axis=0)
        else:
            centre = np.array(given.origin)
    review.warnings += check_samples(path_text(where), times, positions, given.noise)
    positions = review.upright(positions - centre, given.up, where)
    with review.trying(where, "Check the recording, `noise` and `start`."):
        return motions.recorded(times, positions, given.noise, start=given.start)


def _check_start(review: Review, motion_a: motions.Motion, motion_b: motions.Motion) -> None:
    """Refuse ends farther apart at t = 0 than the cable between them can span."""
    length = review.start_length
    distance = float(np.linalg.norm(motion_b.position(0.0) - motion_a.position(0.0)))
    strain = distance / length - 1
    if strain > STRAIN_LIMIT:
        force = review.case.cable.axial_stiffness * strain
        longer = "a longer cable" if review.case.winch is None else "a longer `winch.deployed_length`"
        raise review.refuse(
            ("ends",),
            f"the ends are {distance:.4g} m apart at the start, a cable of {length:g} m would need "
            f"{strain:.1%} strain ({force:.3g} N)",
            f"Bring them within {length:g} m, or give {longer}.",
            None,
        )


def _check_run(
    review: Review, motion_a: motions.Motion, motion_b: motions.Motion, winch: scene.Winch | None
) -> None:
    """Refuse motions that tear the cable later, as far as its length is known then."""
    times = np.linspace(0.0, review.case.simulation.duration, _SAMPLES)
    lengths = np.full(times.size, review.case.cable.length)
    if winch is not None and isinstance(winch.payout, motions.Motion):
        times, lengths = _deployed(winch.payout, winch.minimum_length, times, review.case.cable.length)
    distances = np.linalg.norm(motion_b.position(times) - motion_a.position(times), axis=-1)
    torn = distances > lengths * (1 + STRETCH_LIMIT)
    if torn.any():
        first, far = int(np.argmax(torn)), int(np.argmax(np.where(torn, distances, 0.0)))
        raise review.refuse(
            ("ends",),
            f"the motions take the ends {distances[far]:.4g} m apart (t = {times[far]:.4g} s), "
            f"a cable of {lengths[first]:.4g} m would be torn at t = {times[first]:.4g} s",
            "Shorten the run or the way, or give a longer cable.",
            None,
        )


def _deployed(
    payout: motions.Motion, shortest: float, times: Vector, longest: float
) -> tuple[Vector, Vector]:
    """Times and deployed lengths of a program until it leaves the cable it has: there the run stops."""
    lengths = payout.position(times)[:, 0]
    outside = (lengths <= shortest) | (lengths > longest)
    count = int(np.argmax(outside)) if outside.any() else times.size
    return times[:count], lengths[:count]
