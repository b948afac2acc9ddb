"""The winch of a case: its program as a motion of the deployed length, or its controller.

Depends on: review, case, control, motion, recording, scene.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cablesim import control, recording, scene
from cablesim import motion as motions
from cablesim.builders.review import STATES_LIMIT, Review, Stop
from cablesim.case import models
from cablesim.case.errors import CaseError, Location, Problem, path_text, suggestion
from cablesim.plausibility.recordings import check_samples
from cablesim.scene import Vector

_WHERE: Location = ("winch", "payout")
_SEGMENTS = 3  # least number of segments between A and B at t = 0
_START_TOLERANCE = 0.01  # by which a recording may miss the deployed length at t = 0 [m]
_EXCESS = 1 + 1e-9  # over a limit of the winch: rounding
_SAMPLES = 17  # of a piece of a program, both ends included


def build_winch(review: Review) -> scene.Winch | None:
    """Make the winch; ``None`` when the case has none."""
    given = review.case.winch
    if given is None:
        return None
    _check_lengths(review, given)
    if isinstance(review.case.ends.b, models.FreeEnd):
        review.note(
            ("ends", "b", "motion"),
            "lets end B go, where the winch is",
            "Hold it (`fixed`, `velocity_waypoints`, ...), or leave `winch` out.",
        )
    return scene.Winch(
        deployed_length=given.deployed_length,
        payout=_payout(review, given),
        maximum_speed=_limit(given.maximum_speed),
        maximum_acceleration=_limit(given.maximum_acceleration),
        minimum_length=given.minimum_length,
    )


def _limit(value: float | None) -> float:
    return math.inf if value is None else value


def _check_lengths(review: Review, given: models.Winch) -> None:
    where: Location = ("winch", "deployed_length")
    segment, length = review.case.mesh.segment_length, review.case.cable.length
    if given.deployed_length > length:
        review.note(
            where,
            f"is more than the whole cable, {length:g} m",
            "Give less, or a longer `cable.length`: it counts the drum too.",
        )
    if given.deployed_length < _SEGMENTS * segment * (1 - 1e-9):
        review.note(
            where,
            f"is shorter than {_SEGMENTS} segments of {segment:g} m",
            f"Give {_SEGMENTS * segment:g} m or more, or a shorter `mesh.segment_length`.",
        )
    if given.minimum_length > given.deployed_length:
        review.note(
            ("winch", "minimum_length"),
            f"is more than winch.deployed_length, {given.deployed_length:g} m: the run would not begin",
            "Give less; the run stops when the cable is reeled in so far.",
        )


def _payout(review: Review, winch: models.Winch) -> motions.Motion | scene.Control:
    given = winch.payout
    if isinstance(given, models.WaypointsPayout):
        motion = _waypoints(review, given, winch.deployed_length)
        _check_limits(review, motion, winch, np.array(given.waypoints)[:, 0])
        return motion
    if isinstance(given, models.RecordedPayout):
        motion = _recorded(review, given, winch.deployed_length)
        _check_limits(review, motion, winch, None)
        return motion
    _check_sampling(review, given.period)
    if isinstance(given, models.BuoyGapPayout):
        make: Any = _buoy_gap(review, given)
    elif isinstance(given, models.ConstantTensionPayout):
        make = _constant_tension(given, winch)
    elif isinstance(given, models.ConstantLengthPayout):
        make = _constant_length(review, given, winch)
    else:
        make = _function(review, given)
    return scene.Control(period=given.period, delay=given.delay, make=make)


# Programs ---------------------------------------------------------------------------------------


def _waypoints(review: Review, given: models.WaypointsPayout, length: float) -> motions.Motion:
    where = (*_WHERE, "waypoints")
    review.waypoint_times(given.waypoints, where)
    table = np.array(given.waypoints)
    with review.trying(where, "Check the rows."):
        return motions.payout_waypoints(length, table[:, 0], table[:, 1])


def _recorded(review: Review, given: models.RecordedPayout, length: float) -> motions.Motion:
    where = (*_WHERE, "file")
    file = review.file(given.file, where)
    factor = review.length_factor(given.unit, (*_WHERE, "unit"))
    with review.trying(where, "Check the file, `format`, `column` and `where`."):
        times, lengths = recording.read_lengths(
            file,
            column=given.column,
            format=given.format,
            time_column=given.time_column,
            sample_interval=given.sample_interval,
            where=given.where,
            unit_factor=factor,
        )
    review.warnings += check_samples(path_text(_WHERE), times, lengths[:, None], given.noise)
    with review.trying(_WHERE, "Check the recording, `noise` and `start`."):
        motion = motions.recorded_length(times, lengths, given.noise, start=given.start)
    review.known_long_enough(motion, "recording", where)
    return _starting_at(review, motion, length)


def _starting_at(review: Review, motion: motions.Motion, length: float) -> motions.Motion:
    """Let a recording begin exactly at the deployed length; more than its error is refused."""
    first = float(motion.position(0.0)[0])
    if abs(first - length) > _START_TOLERANCE:
        raise review.refuse(
            ("winch", "deployed_length"),
            f"is not what the recording begins with, {first:.4g} m",
            f"Give {first:.4g} m, or another `start` of the recording.",
        )
    coefficients = motion.coefficients.copy()
    coefficients[:, 0] += length - first
    return replace(motion, coefficients=coefficients)


def _check_limits(
    review: Review, program: motions.Motion, winch: models.Winch, waypoints: Vector | None
) -> None:
    """Refuse a program that asks for more than the winch can do."""
    duration = review.case.simulation.duration

    def place(time: float) -> Location:
        if waypoints is None:
            return (*_WHERE, "file")
        return (*_WHERE, "waypoints", int(np.argmin(np.abs(waypoints - time))))

    time, speed = _greatest(program, 1, duration)
    if abs(speed) > _limit(winch.maximum_speed) * _EXCESS:
        review.note(
            place(time),
            f"asks for {speed:.4g} m/s at {time:.4g} s, beyond winch.maximum_speed, "
            f"{winch.maximum_speed:g} m/s",
            "Slow the program down, or raise the limit.",
        )
    if winch.maximum_acceleration is None:
        return
    time, acceleration = _greatest(program, 2, duration)
    jumps = program.jumps[program.jumps < duration]
    if jumps.size:
        time, acceleration = float(jumps[0]), math.inf
    if abs(acceleration) > winch.maximum_acceleration * _EXCESS:
        asked = "a jump of the speed" if jumps.size else f"{acceleration:.4g} m/s2"
        review.note(
            place(time),
            f"asks for {asked} at {time:.4g} s, beyond winch.maximum_acceleration, "
            f"{winch.maximum_acceleration:g} m/s2",
            "Let the speed change more slowly, or raise the limit.",
        )


def _greatest(program: motions.Motion, derivative: int, duration: float) -> tuple[float, float]:
    """When, up to `duration`, a derivative is greatest, and its value then; both sides of a jump count."""
    starts = np.maximum(program.breaks[:-1], 0.0)
    ends = np.minimum(np.append(program.breaks[1:-1], np.inf), duration)
    run = ends > starts
    times = starts[run, None] + (ends - starts)[run, None] * np.linspace(0.0, 1.0, _SAMPLES)
    local = times - program.breaks[:-1][run, None]
    values = motions.evaluate_pieces(program.coefficients[run][:, None], local, derivative)[..., 0]
    worst = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    return float(times[worst]), float(values[worst])


# Controllers ------------------------------------------------------------------------------------


def _check_sampling(review: Review, period: float) -> None:
    where, duration = (*_WHERE, "period"), review.case.simulation.duration
    if period > duration:
        review.note(where, f"is longer than the run of {duration:g} s", "Give a shorter one.")
    if duration / period > STATES_LIMIT:
        review.note(
            where,
            f"makes {duration / period:.3g} samples, more than {STATES_LIMIT}",
            "Give a longer one; controllers of winches run at some 10 to 100 Hz.",
        )
    for index, attachment in enumerate(review.case.attachments):
        if attachment.name in ("a", "b"):
            review.note(
                ("attachments", index, "name"),
                "is how a controller calls an end of the cable",
                "Give it another name.",
            )


def _buoy_gap(review: Review, given: models.BuoyGapPayout) -> Any:
    places = {body.name: body.at for body in review.case.attachments if isinstance(body, models.Body)}
    unknown = [index for index, name in enumerate(given.buoys) if name not in places]
    for index in unknown:
        review.note(
            (*_WHERE, "buoys", index),
            "is no buoy or other body on this cable",
            suggestion(given.buoys[index], places),
        )
    if given.buoys[0] == given.buoys[1]:
        raise review.refuse((*_WHERE, "buoys"), "names the same buoy twice", "Name two.")
    if unknown:
        raise Stop
    between = abs(places[given.buoys[0]] - places[given.buoys[1]])
    speeds, gaps = _set_points(review, given)
    if gaps.max() > between:
        raise review.refuse(
            (*_WHERE, "gap" if given.table is None else "table"),
            f"asks for a gap of {gaps.max():g} m with {between:g} m of cable between the buoys",
            f"Give less than {between:g} m.",
        )
    return partial(
        control.BuoyGap,
        buoys=given.buoys,
        proportional=given.proportional,
        derivative=given.derivative,
        speeds=speeds,
        gaps=gaps,
        speed_time=given.speed_time,
    )


def _set_points(review: Review, given: models.BuoyGapPayout) -> tuple[Vector, Vector]:
    """Speeds [m/s] and the gap [m] to keep at each."""
    if given.table is None:
        return np.zeros(1), np.array([given.gap])
    where = (*_WHERE, "table")
    file = review.file(given.table, where)
    with review.trying(where, "Give a csv file with the columns speed and gap."):
        table = recording.read_columns(file, ("speed", "gap"))
    if not len(table):
        raise review.refuse(where, "has no rows", "Add at least one row with a speed and a gap.")
    speeds, gaps = table.T
    falls = np.flatnonzero(np.diff(speeds) <= 0)
    if falls.size:
        raise review.refuse(
            where,
            f"has a speed of {speeds[falls[0] + 1]:g} m/s after {speeds[falls[0]]:g} m/s",
            "Sort the rows by speed and leave out repeated ones.",
        )
    if not (gaps > 0).all():
        row = int(np.argmin(gaps > 0))
        raise review.refuse(
            where, f"has a gap of {gaps[row]:g} m at {speeds[row]:g} m/s", "Give gaps above 0 m."
        )
    return speeds, gaps


def _constant_tension(given: models.ConstantTensionPayout, winch: models.Winch) -> Any:
    limit = winch.maximum_speed if given.speed_limit is None else given.speed_limit
    return partial(
        control.ConstantTension,
        tension=given.tension,
        proportional=given.proportional,
        integral=given.integral,
        end=given.end,
        speed_limit=_limit(limit),
    )


def _constant_length(review: Review, given: models.ConstantLengthPayout, winch: models.Winch) -> Any:
    length = review.case.cable.length
    if not winch.minimum_length <= given.length <= length:
        raise review.refuse(
            (*_WHERE, "length"),
            f"is not between winch.minimum_length, {winch.minimum_length:g} m, and the whole cable, "
            f"{length:g} m",
            "Give a length in between.",
        )
    return partial(control.ConstantLength, length=given.length, proportional=given.proportional)


def _function(review: Review, given: models.FunctionPayout) -> Any:
    """What makes a user's controller when the case is run; here its code is only read."""
    where, directory = (*_WHERE, "function"), review.directory.resolve()
    try:
        control.check_source(given.function, directory, given.options)
    except control.ControllerLoadError as error:
        raise review.refuse(where, error.message, error.remedy) from error
    place = review.case.problem(where, "", "")
    return partial(_user_controller, given.function, directory, given.options, place)


def _user_controller(
    reference: str, directory: Path, options: dict[str, Any], place: Problem
) -> control.Controller:
    try:
        return control.user_controller(reference, directory, options)
    except control.ControllerLoadError as error:
        raise CaseError([replace(place, message=error.message, remedy=error.remedy)]) from error
