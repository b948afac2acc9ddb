"""Points at rest, and motions with rates that are linear between waypoints.

Depends on: motion.checks, motion.pieces.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cablesim.motion.checks import checked_table, checked_vector, checked_waypoint_times
from cablesim.motion.pieces import FOREVER, Motion, along_x, evaluate_pieces, on_x

Vector = NDArray[np.float64]

_JUMP_TOLERANCE = 1e-9  # of the greatest speed at a waypoint
_CORNER_TOLERANCE = 1e-6  # of the greatest acceleration at a waypoint


def fixed(position: ArrayLike) -> Motion:
    """Motion of a point at rest.

    Parameters
    ----------
    position : array_like, shape (3,)
        World position [m].

    Raises
    ------
    ValueError
        If `position` is not three finite numbers.
    """
    coefficients = np.zeros((1, 6, 3))
    coefficients[0, 0] = checked_vector("fixed: position", position)
    return Motion(breaks=np.array([0.0, FOREVER]), coefficients=coefficients)


def velocity_waypoints(position: ArrayLike, times: ArrayLike, velocities: ArrayLike) -> Motion:
    """Motion with a velocity that is linear in time between waypoints and constant after the last.

    Parameters
    ----------
    position : array_like, shape (3,)
        World position at t = 0 [m].
    times : array_like, shape (m,)
        Times of the waypoints [s], the first at or before 0; two equal times make the velocity jump.
    velocities : array_like, shape (m, 3)
        World velocities at the waypoints [m/s].

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, times decrease, one occurs more than twice,
        or the first is after 0.
    """
    start = checked_vector("velocity_waypoints: position", position)
    when = checked_waypoint_times("velocity_waypoints: times", times)
    speeds = checked_table("velocity_waypoints: velocities", velocities, when.size, 3)
    pieces = [
        linear_velocity_piece(speeds[i], speeds[i + 1], when[i + 1] - when[i])
        for i in np.flatnonzero(np.diff(when) > 0)
    ]
    pieces.append(linear_velocity_piece(speeds[-1], speeds[-1], FOREVER))
    return join(pieces, when, start)


def payout_waypoints(length: float, times: ArrayLike, speeds: ArrayLike) -> Motion:
    """Deployed length whose rate is linear in time between waypoints and constant after the last.

    Parameters
    ----------
    length : float
        Deployed length at t = 0 [m].
    times : array_like, shape (m,)
        Times of the waypoints [s], as in `velocity_waypoints`.
    speeds : array_like, shape (m,)
        Payout speeds at the waypoints [m/s], positive when cable goes out.

    Raises
    ------
    ValueError
        As `velocity_waypoints`.
    """
    rates = checked_table(
        "payout_waypoints: speeds", np.asarray(speeds, float).reshape(-1, 1), np.size(times), 1
    )
    return along_x(velocity_waypoints(on_x(np.array([length]))[0], times, on_x(rates[:, 0])))


def linear_velocity_piece(first: Vector, last: Vector, length: float) -> tuple[Vector, Vector]:
    """Length (1,) and coefficients (1, 6, 3), from 0, of a piece from velocity `first` to `last`."""
    coefficients = np.zeros((1, 6, 3))
    coefficients[0, 1] = first
    coefficients[0, 2] = (last - first) / (2 * length)
    return np.array([length]), coefficients


def join(
    intervals: list[tuple[Vector, Vector]], waypoints: Vector, start: Vector, end_time: float = math.inf
) -> Motion:
    """Motion of consecutive intervals, each given from 0, that passes through `start` at t = 0."""
    nodes = np.unique(waypoints)
    breaks, tables = [nodes[:1]], []
    reached = np.zeros(3)
    for index, (lengths, coefficients) in enumerate(intervals):
        placed = coefficients.copy()
        placed[:, 0] += reached
        reached = evaluate_pieces(placed[-1], lengths[-1], 0)
        ends = nodes[index] + np.cumsum(lengths)
        if index + 1 < nodes.size:
            ends[-1] = nodes[index + 1]  # exactly, where the sum of lengths may miss it by an ulp
        tables.append(placed)
        breaks.append(ends)
    times, table = np.concatenate(breaks), np.concatenate(tables)
    at_zero = Motion(breaks=times, coefficients=table).position(0.0)
    table[:, 0] += start - at_zero
    corners, jumps = _discontinuities(times, table, waypoints)
    return Motion(breaks=times, coefficients=table, corners=corners, jumps=jumps, end_time=end_time)


def _discontinuities(breaks: Vector, coefficients: Vector, waypoints: Vector) -> tuple[Vector, Vector]:
    """Corners and jumps after t = 0 among the waypoints."""
    inner = np.flatnonzero(np.isin(breaks[1:-1], waypoints)) + 1
    inner = inner[breaks[inner] > 0]
    lengths = breaks[inner] - breaks[inner - 1]
    velocity_before = evaluate_pieces(coefficients[inner - 1], lengths, 1)
    acceleration_before = evaluate_pieces(coefficients[inner - 1], lengths, 2)
    velocity_after, acceleration_after = coefficients[inner, 1], 2 * coefficients[inner, 2]
    jumping = _differs(velocity_before, velocity_after, _JUMP_TOLERANCE)
    bending = _differs(acceleration_before, acceleration_after, _CORNER_TOLERANCE)
    return breaks[inner[bending & ~jumping]], breaks[inner[jumping]]


def _differs(before: Vector, after: Vector, tolerance: float) -> NDArray[np.bool_]:
    """Whether rows (k, 3) differ by more than `tolerance` times the greatest number among them."""
    scale = max(float(np.abs(before).max(initial=0.0)), float(np.abs(after).max(initial=0.0)))
    return np.abs(after - before).max(axis=1, initial=0.0) > tolerance * scale
