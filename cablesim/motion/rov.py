"""The attachment of a cable on a level vehicle that surges, sways, heaves and yaws.

Depends on: motion.checks, motion.pieces, motion.fit, motion.waypoints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cablesim.motion.checks import checked_finite, checked_table, checked_vector, checked_waypoint_times
from cablesim.motion.fit import POSITION_TOLERANCE, Sampler, quintic_pieces
from cablesim.motion.pieces import FOREVER, Motion
from cablesim.motion.waypoints import join, linear_velocity_piece

Vector = NDArray[np.float64]

_PIECE_TURN = 0.15  # [rad] of turn in a first trial piece: 2e-10 of the turning radius


def rov_waypoints(
    position: ArrayLike,
    heading: float,
    times: ArrayLike,
    rates: ArrayLike,
    attachment_offset: ArrayLike = (0.0, 0.0, 0.0),
) -> Motion:
    """Motion of a cable's attachment on a level vehicle that follows surge, sway, heave and yaw rates.

    The rates are linear in time between waypoints.  Intervals without yaw are exact polynomials.
    The others are integrated by Gauss-Legendre quadrature and cut into quintics that match
    position, velocity and acceleration at both their ends; the cut is refined until the position
    between the ends is right to `POSITION_TOLERANCE` (or 1e-13 of the way travelled in the
    interval), with at most `MAXIMUM_PIECES` pieces an interval.

    After the last waypoint the rates stay what they are.  A vehicle that then still yaws would turn
    for ever: such a motion ends with its last waypoint (`end_time`).

    Parameters
    ----------
    position : array_like, shape (3,)
        World position of the attachment at t = 0 [m].
    heading : float
        Angle of the surge direction about +z from +x at t = 0 [rad].
    times : array_like, shape (m,)
        Times of the waypoints [s], the first at or before 0; two equal times make the rates jump.
    rates : array_like, shape (m, 4)
        Surge, sway, heave [m/s] and yaw [rad/s] of the vehicle's reference point in the vehicle's
        frame (x forward, y to port, z up) at the waypoints.
    attachment_offset : array_like, shape (3,)
        From the reference point to the attachment, in the vehicle's frame [m].

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, times decrease, one occurs more than twice,
        the first is after 0, or an interval needs more than `MAXIMUM_PIECES` pieces.

    See Also
    --------
    rov_heading : the heading that goes with it.

    Notes
    -----
    Corners are where the acceleration of the attachment really jumps: with the attachment at the
    reference point, a kink of the yaw rate alone is none, and a jump of the yaw rate is a corner.
    """
    start = checked_vector("rov_waypoints: position", position)
    when = checked_waypoint_times("rov_waypoints: times", times)
    table = checked_table("rov_waypoints: rates", rates, when.size, 4)
    offset = checked_vector("rov_waypoints: attachment_offset", attachment_offset)
    yaw = table[:, 3]
    # the attachment's velocity in the vehicle's frame: that of the reference plus yaw times z x offset
    speeds = table[:, :3] + yaw[:, None] * np.array([-offset[1], offset[0], 0.0])
    angles = rov_heading(heading, when, yaw)(when)
    pieces = [
        _rov_piece(angles[i], yaw[i : i + 2], speeds[i : i + 2], when[i + 1] - when[i])
        for i in np.flatnonzero(np.diff(when) > 0)
    ]
    if yaw[-1] == 0.0:
        pieces.append(_rov_piece(angles[-1], yaw[[-1, -1]], speeds[[-1, -1]], FOREVER))
        return join(pieces, when, start)
    if when[-1] <= 0:
        raise ValueError(
            f"rov_waypoints: the last waypoint is at {when[-1]:g} s with a yaw rate of {yaw[-1]:g} rad/s, "
            "which would turn the vehicle for ever; add a waypoint at the end of the simulation."
        )
    return join(pieces, when, start, end_time=float(when[-1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Heading:
    """A vehicle's heading as a function of time: call it with t.

    Attributes
    ----------
    breaks : ndarray, shape (m,)
        Times at which a piece starts [s].
    coefficients : ndarray, shape (m, 3)
        Heading [rad], yaw rate [rad/s] and half the yaw acceleration [rad/s2] at each break.
    """

    breaks: Vector
    coefficients: Vector

    def __call__(self, t: ArrayLike) -> Vector:
        """Angle of the surge direction about +z from +x at `t` [rad], not wrapped; shape of `t`."""
        times = np.asarray(t, dtype=np.float64)
        piece = np.maximum(np.searchsorted(self.breaks, times, side="right") - 1, 0)
        local = times - self.breaks[piece]
        heading, rate, half_acceleration = np.moveaxis(self.coefficients[piece], -1, 0)
        return heading + local * (rate + local * half_acceleration)


def rov_heading(heading: float, times: ArrayLike, yaw_rates: ArrayLike) -> Heading:
    """Heading of a vehicle whose yaw rate is linear between waypoints and constant after the last.

    Parameters
    ----------
    heading : float
        Heading at t = 0 [rad].
    times : array_like, shape (m,)
        Times of the waypoints [s], as in `rov_waypoints`.
    yaw_rates : array_like, shape (m,)
        Yaw rates [rad/s], positive from +x to +y.

    Raises
    ------
    ValueError
        As `rov_waypoints`.
    """
    when = checked_waypoint_times("rov_heading: times", times)
    rates = checked_table("rov_heading: yaw_rates", np.reshape(yaw_rates, (-1, 1)), when.size, 1)[:, 0]
    lengths = np.diff(when)
    first = np.append(np.flatnonzero(lengths > 0), when.size - 1)
    turned = np.append(0.0, np.cumsum((rates[:-1] + rates[1:]) / 2 * lengths))
    accelerations = np.zeros(when.size)
    accelerations[first[:-1]] = np.diff(rates)[first[:-1]] / lengths[first[:-1]]
    coefficients = np.stack([turned, rates, accelerations / 2], axis=1)[first]
    at_zero = Heading(breaks=when[first], coefficients=coefficients)(0.0)
    coefficients[:, 0] += float(checked_finite("rov_heading: heading", np.asarray(heading, float))) - at_zero
    return Heading(breaks=when[first], coefficients=coefficients)


def _rov_piece(heading: float, yaw: Vector, speeds: Vector, length: float) -> tuple[Vector, Vector]:
    """Lengths (p,) and coefficients (p, 6, 3), from 0, of one interval between waypoints.

    `yaw` (2,) and the attachment's `speeds` (2, 3) in the vehicle's frame hold at its two ends.
    """
    if not yaw.any():
        turned = _turn(np.full(2, heading), speeds)
        return linear_velocity_piece(turned[0], turned[1], length)
    sample = _rov_sampler(heading, yaw, speeds, length)
    greatest_turn = float(np.abs(yaw).max()) * length
    travelled = float(np.linalg.norm(speeds, axis=1).max()) * length
    tolerance = max(POSITION_TOLERANCE, 1e-13 * travelled)
    return quintic_pieces(sample, length, math.ceil(greatest_turn / _PIECE_TURN), tolerance)


def _rov_sampler(heading: float, yaw: Vector, speeds: Vector, length: float) -> Sampler:
    """Sampler of the attachment's motion, from 0, within one interval between waypoints."""
    yaw_slope = (yaw[1] - yaw[0]) / length
    speed_slope = (speeds[1] - speeds[0]) / length
    nodes, weights = np.polynomial.legendre.leggauss(8)

    def angles(times: Vector) -> Vector:
        return heading + times * (yaw[0] + times * yaw_slope / 2)

    def velocities(times: Vector) -> Vector:
        return _turn(angles(times), speeds[0] + times[..., None] * speed_slope)

    def sample(times: Vector) -> tuple[Vector, Vector, Vector]:
        steps = np.diff(times)
        points = times[:-1, None] + steps[:, None] * (nodes + 1) / 2
        moves = np.einsum("pqc,q->pc", velocities(points), weights) * steps[:, None] / 2
        positions = np.concatenate([np.zeros((1, 3)), np.cumsum(moves, axis=0)])
        speed = velocities(times)
        rate = (yaw[0] + times * yaw_slope)[:, None]
        across = np.stack([-speed[:, 1], speed[:, 0], np.zeros(times.size)], axis=1)
        gained = _turn(angles(times), np.broadcast_to(speed_slope, speed.shape))
        return positions, speed, gained + rate * across

    return sample


def _turn(angles: Vector, vectors: Vector) -> Vector:
    """Vectors (..., 3) turned about z by angles (...)."""
    cosine, sine = np.cos(angles), np.sin(angles)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
