"""Motions of the cable's ends as piecewise polynomials with known corners.

Depends on: nothing of ours.

Every motion is one table of quintic polynomials in time, so that a compiled kernel reads all kinds
of motion in the same way, and velocity and acceleration are exact derivatives of the position.
World frame, z up, SI units, angles in radians.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]

POSITION_TOLERANCE = 1e-9
"""Largest error of a fitted piece: [m] for a turning vehicle, times the amplitude for a harmonic motion."""

MAXIMUM_PIECES = 100_000
"""Most pieces that one interval between waypoints, or one harmonic motion, is cut into."""

_FAR = 1e9  # [s]; a final piece of constant velocity reaches so far
_PIECE_TURN = 0.15  # [rad] of turn in a first trial piece: 2e-10 of the turning radius
_PIECES_PER_PERIOD = 40  # 3e-10 of the amplitude
_CHECKS = 4  # sub-intervals of a piece at whose ends the fit is checked
_JUMP_TOLERANCE = 1e-9  # of the greatest speed at a waypoint
_CORNER_TOLERANCE = 1e-6  # of the greatest acceleration at a waypoint
_RATE_SAMPLES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a piece, for the bound on its rate
_RATE_MARGIN = 1.05  # on the fastest of them
_MINIMUM_SAMPLES = 6  # a quintic has six coefficients

# Times (k,) from 0 on -> positions, velocities, accelerations (k, 3)
_Sampler = Callable[[Vector], tuple[Vector, Vector, Vector]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A point's position, or the deployed length of a cable, as a function of time.

    On piece i, breaks[i] <= t < breaks[i+1], the position is
    ``sum_k coefficients[i, k, :] * (t - breaks[i])**k``.  Before the first break the first piece is
    continued.  The functions of this module end a motion without an end (`end_time` infinite) with
    a piece of constant velocity, so that continuing the last piece is always right.

    Attributes
    ----------
    breaks : ndarray, shape (m+1,)
        Strictly increasing times [s], the first not after 0.
    coefficients : ndarray, shape (m, 6, d)
        C-contiguous polynomial coefficients [m/s^k], lowest power first; d is 3 for a point and 1 for
        a length.
    corners : ndarray, shape (k,)
        Times > 0 [s] where the acceleration jumps and the velocity does not.
    jumps : ndarray, shape (k,)
        Times > 0 [s] where the velocity jumps.
    end_time : float
        Last time [s] at which the motion is known; infinite when it goes on for ever.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, or the breaks do not increase from <= 0.
    """

    breaks: Vector
    coefficients: Vector
    corners: Vector = field(default_factory=lambda: np.empty(0))
    jumps: Vector = field(default_factory=lambda: np.empty(0))
    end_time: float = math.inf

    def __post_init__(self) -> None:
        for name in ("breaks", "coefficients", "corners", "jumps"):
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, _finite(f"Motion.{name}", values))
        pieces = (self.breaks.size - 1, 6)
        if self.breaks.ndim != 1 or self.coefficients.shape not in ((*pieces, 3), (*pieces, 1)):
            raise ValueError(
                f"Motion: breaks has shape {self.breaks.shape} and coefficients "
                f"{self.coefficients.shape}; give (m+1,) and (m, 6, 3), or (m, 6, 1) for a length."
            )
        _increasing("Motion.breaks", self.breaks)
        if self.breaks[0] > 0:
            raise ValueError(f"Motion.breaks[0] is {self.breaks[0]:g} s; it must not be after t = 0.")

    def position(self, t: ArrayLike) -> Vector:
        """Position at `t` [m]; a scalar gives shape (d,), times of shape (k,) give (k, d).

        Raises
        ------
        ValueError
            If `t` lies outside a motion that is known only up to `end_time`.
        """
        return self._evaluate(t, 0)

    def velocity(self, t: ArrayLike) -> Vector:
        """Velocity at `t` [m/s], after the jump where it jumps; shapes and errors as in `position`."""
        return self._evaluate(t, 1)

    def acceleration(self, t: ArrayLike) -> Vector:
        """Acceleration at `t` [m/s2], after the corner at a corner; shapes and errors as in `position`."""
        return self._evaluate(t, 2)

    def speed_limit(self, duration: float) -> float:
        """Greatest speed over 0 <= t <= `duration` [m/s], sampled at 17 points of every piece.

        Both ends of a piece are among them, so that no jump is missed.  What lies after
        `end_time` does not count.

        Raises
        ------
        ValueError
            If `duration` is negative or not finite.
        """
        if not (math.isfinite(duration) and duration >= 0):
            raise ValueError(f"speed_limit: duration is {duration!r} s; give a finite time >= 0.")
        # the last piece goes on beyond its break
        ends = np.append(self.breaks[1:-1], np.inf)
        ends = np.minimum(ends, min(duration, self.end_time))
        starts = np.maximum(self.breaks[:-1], 0.0)
        touched = (ends >= starts) & (self.breaks[:-1] <= duration)
        fractions = np.linspace(0.0, 1.0, 17)
        times = starts[touched, None] + (ends - starts)[touched, None] * fractions
        local = times - self.breaks[:-1][touched, None]
        velocities = evaluate_pieces(self.coefficients[touched][:, None], local, 1)
        return float(np.linalg.norm(velocities, axis=-1).max())

    def _evaluate(self, t: ArrayLike, derivative: int) -> Vector:
        times = np.asarray(t, dtype=np.float64)
        if math.isfinite(self.end_time):
            self._refuse_unknown(times)
        piece = np.searchsorted(self.breaks, times, side="right") - 1
        piece = np.clip(piece, 0, len(self.coefficients) - 1)
        return evaluate_pieces(self.coefficients[piece], times - self.breaks[piece], derivative)

    def _refuse_unknown(self, times: Vector) -> None:
        slack = 1e-9 * max(1.0, abs(self.end_time))  # times added up by a caller
        unknown = ~((times >= self.breaks[0] - slack) & (times <= self.end_time + slack))
        if unknown.any():
            raise ValueError(
                f"Motion: asked at t = {times[unknown].flat[0]:g} s, but known only from "
                f"{self.breaks[0]:g} to {self.end_time:g} s; shorten the simulation or give a longer motion."
            )


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
    coefficients[0, 0] = _vector("fixed: position", position)
    return Motion(breaks=np.array([0.0, _FAR]), coefficients=coefficients)


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
    start = _vector("velocity_waypoints: position", position)
    when = _waypoint_times("velocity_waypoints: times", times)
    speeds = _table("velocity_waypoints: velocities", velocities, when.size, 3)
    pieces = [
        _linear_velocity_piece(speeds[i], speeds[i + 1], when[i + 1] - when[i])
        for i in np.flatnonzero(np.diff(when) > 0)
    ]
    pieces.append(_linear_velocity_piece(speeds[-1], speeds[-1], _FAR))
    return _join(pieces, when, start)


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
    rates = _table("payout_waypoints: speeds", np.asarray(speeds, float).reshape(-1, 1), np.size(times), 1)
    return _along_x(velocity_waypoints(_on_x(np.array([length]))[0], times, _on_x(rates[:, 0])))


def recorded_length(
    times: ArrayLike, lengths: ArrayLike, noise_level: float, *, start: float | None = None
) -> Motion:
    """Deployed length through recorded values, smoothed before it is differentiated; see `recorded`.

    Parameters
    ----------
    times : array_like, shape (k,)
        Strictly increasing times of the samples [s]; k >= 6.
    lengths : array_like, shape (k,)
        Measured deployed lengths [m].
    noise_level : float
        Standard deviation of the measurement error [m]; 0 interpolates.
    start : float, optional
        Time of the recording [s] that becomes t = 0; by default the first sample.

    Raises
    ------
    ValueError
        As `recorded`.
    """
    samples = _table("recorded_length: lengths", np.asarray(lengths, float).reshape(-1, 1), np.size(times), 1)
    return _along_x(recorded(times, _on_x(samples[:, 0]), noise_level, start=start))


def _on_x(values: Vector) -> Vector:
    """Numbers (k,) as points (k, 3) on the x axis."""
    return np.stack([values, np.zeros_like(values), np.zeros_like(values)], axis=1)


def _along_x(motion: Motion) -> Motion:
    """The x component of a motion, as a length."""
    return Motion(
        breaks=motion.breaks,
        coefficients=motion.coefficients[:, :, :1],
        corners=motion.corners,
        jumps=motion.jumps,
        end_time=motion.end_time,
    )


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
    start = _vector("rov_waypoints: position", position)
    when = _waypoint_times("rov_waypoints: times", times)
    table = _table("rov_waypoints: rates", rates, when.size, 4)
    offset = _vector("rov_waypoints: attachment_offset", attachment_offset)
    yaw = table[:, 3]
    # the attachment's velocity in the vehicle's frame: that of the reference plus yaw times z x offset
    speeds = table[:, :3] + yaw[:, None] * np.array([-offset[1], offset[0], 0.0])
    angles = rov_heading(heading, when, yaw)(when)
    pieces = [
        _rov_piece(angles[i], yaw[i : i + 2], speeds[i : i + 2], when[i + 1] - when[i])
        for i in np.flatnonzero(np.diff(when) > 0)
    ]
    if yaw[-1] == 0.0:
        pieces.append(_rov_piece(angles[-1], yaw[[-1, -1]], speeds[[-1, -1]], _FAR))
        return _join(pieces, when, start)
    if when[-1] <= 0:
        raise ValueError(
            f"rov_waypoints: the last waypoint is at {when[-1]:g} s with a yaw rate of {yaw[-1]:g} rad/s, "
            "which would turn the vehicle for ever; add a waypoint at the end of the simulation."
        )
    return _join(pieces, when, start, end_time=float(when[-1]))


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
    when = _waypoint_times("rov_heading: times", times)
    rates = _table("rov_heading: yaw_rates", np.reshape(yaw_rates, (-1, 1)), when.size, 1)[:, 0]
    lengths = np.diff(when)
    first = np.append(np.flatnonzero(lengths > 0), when.size - 1)
    turned = np.append(0.0, np.cumsum((rates[:-1] + rates[1:]) / 2 * lengths))
    accelerations = np.zeros(when.size)
    accelerations[first[:-1]] = np.diff(rates)[first[:-1]] / lengths[first[:-1]]
    coefficients = np.stack([turned, rates, accelerations / 2], axis=1)[first]
    at_zero = Heading(breaks=when[first], coefficients=coefficients)(0.0)
    coefficients[:, 0] += float(_finite("rov_heading: heading", np.asarray(heading, float))) - at_zero
    return Heading(breaks=when[first], coefficients=coefficients)


def harmonic(
    position: ArrayLike,
    amplitude: ArrayLike,
    period: float,
    *,
    duration: float,
    phase: float = 0.0,
    ramp: float = 0.0,
) -> Motion:
    """Motion ``position + f(t) * amplitude * sin(2 pi t / period + phase)``, known up to `duration`.

    The factor f rises from 0 to 1 within `ramp` seconds as ``10 x**3 - 15 x**4 + 6 x**5``, without a
    jump in the acceleration.  The pieces are quintics, right to `POSITION_TOLERANCE` times the amplitude.

    Parameters
    ----------
    position : array_like, shape (3,)
        World position about which the point moves [m].
    amplitude : array_like, shape (3,)
        Half the stroke along each axis [m]; ``(0, 0, 0.5)`` heaves by a metre from trough to crest.
    period : float
        Period [s].
    duration : float
        For how long the motion is needed [s]; its `end_time`.
    phase : float
        Phase at t = 0 [rad].
    ramp : float
        Time over which the motion grows to its full amplitude [s]; 0 starts at full amplitude.

    Raises
    ------
    ValueError
        If a number is not finite, `period` or `duration` is not positive, `ramp` is negative,
        or more than `MAXIMUM_PIECES` pieces are needed.
    """
    centre = _vector("harmonic: position", position)
    stroke = _vector("harmonic: amplitude", amplitude)
    _positive("harmonic: period", period)
    _positive("harmonic: duration", duration)
    if not (math.isfinite(ramp) and ramp >= 0 and math.isfinite(phase)):
        raise ValueError(f"harmonic: ramp is {ramp!r} s, phase {phase!r} rad; give a ramp >= 0 and a phase.")
    tolerance = POSITION_TOLERANCE * max(float(np.abs(stroke).max()), 1e-12)
    breaks = [0.0, ramp, duration] if 0 < ramp < duration else [0.0, duration]
    pieces = []
    for start, end in itertools.pairwise(breaks):
        sample = _harmonic_sampler(start, stroke, period, phase, ramp)
        count = max(2, math.ceil(_PIECES_PER_PERIOD * (end - start) / period))
        pieces.append(_quintic_pieces(sample, end - start, count, tolerance))
    lengths = np.concatenate([length for length, _ in pieces])
    coefficients = np.concatenate([table for _, table in pieces])
    coefficients[:, 0] += centre
    return Motion(
        breaks=np.append(0.0, np.cumsum(lengths)), coefficients=coefficients, end_time=float(duration)
    )


def recorded(
    times: ArrayLike, positions: ArrayLike, noise_level: float, *, start: float | None = None
) -> Motion:
    """Motion through recorded positions, smoothed before it is differentiated.

    Each component is a quintic smoothing spline with as few knots as leave a root mean square
    residual of `noise_level` (sum of squares k * noise_level**2).  It has four continuous
    derivatives, so there are no corners.  A `noise_level` of 0 interpolates the samples; noise in
    measured positions then becomes noise in the velocity, which rings the cable's axial waves.

    Parameters
    ----------
    times : array_like, shape (k,)
        Strictly increasing times of the samples [s], not necessarily evenly spaced; k >= 6.
    positions : array_like, shape (k, 3)
        Measured positions [m].
    noise_level : float
        Standard deviation of one coordinate's measurement error [m]; 0.5 to 1 mm is usual for
        motion capture under water.
    start : float, optional
        Time of the recording [s] that becomes t = 0; by default the first sample.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, there are fewer than 6 samples, times do not
        increase, `noise_level` is negative or far below the noise of the samples, or `start` is outside
        the recording.
    """
    when = _finite("recorded: times", np.asarray(times, dtype=np.float64))
    if when.ndim != 1 or when.size < _MINIMUM_SAMPLES:
        raise ValueError(
            f"recorded: times has shape {when.shape}; give at least {_MINIMUM_SAMPLES} samples, shape (k,)."
        )
    _increasing("recorded: times", when)
    samples = _table("recorded: positions", positions, when.size, 3)
    if not (math.isfinite(noise_level) and noise_level >= 0):
        raise ValueError(f"recorded: noise_level is {noise_level!r} m; give 0 (interpolate) or more.")
    origin = float(when[0]) if start is None else float(start)
    if not when[0] <= origin < when[-1]:
        raise ValueError(
            f"recorded: start is {origin:g} s, but the recording lasts from {when[0]:g} to "
            f"{when[-1]:g} s; give a start within it."
        )
    breaks, coefficients = _smoothing_pieces(when - origin, samples, noise_level)
    motion = Motion(breaks=breaks, coefficients=coefficients, end_time=float(breaks[-1]))
    _refuse_overshoot(motion, when - origin, samples, noise_level)
    return motion


def earliest_fall(breaks: Vector, coefficients: Vector, t: float, fall: float) -> float:
    """Time before which a piecewise polynomial cannot have fallen by `fall` from its value at `t`.

    Parameters
    ----------
    breaks : ndarray, shape (m+1,)
        As in `Motion`.
    coefficients : ndarray, shape (m, 6)
        As in `Motion`, of one component.
    t, fall : float
        Time [s], and a positive fall [m].

    Returns
    -------
    float
        A lower bound [s], near the time itself where the rate is even; infinite when it never falls.
    """
    first = min(max(int(np.searchsorted(breaks, t, side="right")) - 1, 0), len(coefficients) - 1)
    for piece in range(first, len(coefficients)):
        c = coefficients[piece].tolist()
        origin = float(breaks[piece])
        start = max(t - origin, 0.0)
        length = float(breaks[piece + 1]) - origin - start
        fastest = 0.0
        for share in _RATE_SAMPLES:
            x = start + share * length
            rate = c[1] + x * (2.0 * c[2] + x * (3.0 * c[3] + x * (4.0 * c[4] + x * 5.0 * c[5])))
            fastest = max(fastest, -rate)
        fastest *= _RATE_MARGIN
        if fastest * length >= fall:
            return origin + start + fall / fastest
        fall -= fastest * length
    return math.inf


def evaluate_pieces(coefficients: Vector, local: Vector, derivative: int) -> Vector:
    """Evaluate a derivative of polynomials (..., 6, 3) at local times (...); shape (..., 3)."""
    shape = np.broadcast_shapes(coefficients.shape[:-2], local.shape)
    result = np.zeros((*shape, coefficients.shape[-1]))
    for order in range(5, derivative - 1, -1):
        factor = math.perm(order, derivative)
        result = result * local[..., None] + factor * coefficients[..., order, :]
    return result


def _linear_velocity_piece(first: Vector, last: Vector, length: float) -> tuple[Vector, Vector]:
    """Length (1,) and coefficients (1, 6, 3), from 0, of a piece from velocity `first` to `last`."""
    coefficients = np.zeros((1, 6, 3))
    coefficients[0, 1] = first
    coefficients[0, 2] = (last - first) / (2 * length)
    return np.array([length]), coefficients


def _rov_piece(heading: float, yaw: Vector, speeds: Vector, length: float) -> tuple[Vector, Vector]:
    """Lengths (p,) and coefficients (p, 6, 3), from 0, of one interval between waypoints.

    `yaw` (2,) and the attachment's `speeds` (2, 3) in the vehicle's frame hold at its two ends.
    """
    if not yaw.any():
        turned = _turn(np.full(2, heading), speeds)
        return _linear_velocity_piece(turned[0], turned[1], length)
    sample = _rov_sampler(heading, yaw, speeds, length)
    greatest_turn = float(np.abs(yaw).max()) * length
    travelled = float(np.linalg.norm(speeds, axis=1).max()) * length
    tolerance = max(POSITION_TOLERANCE, 1e-13 * travelled)
    return _quintic_pieces(sample, length, math.ceil(greatest_turn / _PIECE_TURN), tolerance)


def _rov_sampler(heading: float, yaw: Vector, speeds: Vector, length: float) -> _Sampler:
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


def _harmonic_sampler(start: float, stroke: Vector, period: float, phase: float, ramp: float) -> _Sampler:
    """Sampler of the displacement of a harmonic motion, with times counted from `start`."""
    omega = 2 * math.pi / period

    def sample(times: Vector) -> tuple[Vector, Vector, Vector]:
        angle = omega * (start + times) + phase
        wave = np.sin(angle)
        wave_rate, wave_acceleration = omega * np.cos(angle), -(omega**2) * wave
        grown, growth, growth_rate = _smooth_ramp(start + times, ramp)
        shape = grown * wave
        rate = grown * wave_rate + growth * wave
        acceleration = grown * wave_acceleration + 2 * growth * wave_rate + growth_rate * wave
        return (
            shape[:, None] * stroke,
            rate[:, None] * stroke,
            acceleration[:, None] * stroke,
        )

    return sample


def _smooth_ramp(times: Vector, ramp: float) -> tuple[Vector, Vector, Vector]:
    """Value, first and second derivative of the quintic step from 0 to 1 within `ramp`."""
    if ramp == 0:
        return np.ones_like(times), np.zeros_like(times), np.zeros_like(times)
    x = np.clip(times / ramp, 0.0, 1.0)
    value = x**3 * (10 - 15 * x + 6 * x**2)
    slope = 30 * x**2 * (1 - x) ** 2 / ramp
    bend = 60 * x * (1 - x) * (1 - 2 * x) / ramp**2
    return value, slope, bend


def _quintic_pieces(sample: _Sampler, length: float, count: int, tolerance: float) -> tuple[Vector, Vector]:
    """Lengths (p,) and coefficients (p, 6, 3) of quintics fitted to `sample`, at least `count` of them."""
    while count <= MAXIMUM_PIECES:
        times = np.linspace(0.0, length, _CHECKS * count + 1)
        positions, velocities, accelerations = sample(times)
        nodes = times[::_CHECKS]
        coefficients = _hermite(nodes, positions[::_CHECKS], velocities[::_CHECKS], accelerations[::_CHECKS])
        piece = np.repeat(np.arange(count), _CHECKS)
        fitted = evaluate_pieces(coefficients[piece], times[:-1] - nodes[piece], 0)
        if np.abs(fitted - positions[:-1]).max() <= tolerance:
            return np.diff(nodes), coefficients
        count = math.ceil(1.5 * count)
    raise ValueError(
        f"motion: {length:g} s need more than {MAXIMUM_PIECES} pieces for an error of {tolerance:g} m; "
        "give a shorter duration or slower rates."
    )


def _hermite(times: Vector, positions: Vector, velocities: Vector, accelerations: Vector) -> Vector:
    """Coefficients (p, 6, 3) of the quintics between p+1 nodes that match all three at both ends."""
    step = np.diff(times)[:, None]
    start_velocity, start_acceleration = velocities[:-1], accelerations[:-1]
    # what the first three coefficients leave to be done by the last three, made dimensionless
    move = np.diff(positions, axis=0) - step * (start_velocity + step * start_acceleration / 2)
    gain = step * (np.diff(velocities, axis=0) - step * start_acceleration)
    bend = step**2 * np.diff(accelerations, axis=0)
    return np.stack(
        [
            positions[:-1],
            start_velocity,
            start_acceleration / 2,
            (10 * move - 4 * gain + bend / 2) / step**3,
            (-15 * move + 7 * gain - bend) / step**4,
            (6 * move - 3 * gain + bend / 2) / step**5,
        ],
        axis=1,
    )


def _join(
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


def _smoothing_pieces(times: Vector, positions: Vector, noise_level: float) -> tuple[Vector, Vector]:
    """Fit one quintic spline to each component: breaks (m+1,) and coefficients (m, 6, 3)."""
    from scipy.interpolate import BSpline, make_interp_spline

    if noise_level == 0:
        splines = [make_interp_spline(times, component, k=5) for component in positions.T]
    else:
        splines = [BSpline(*_smooth(times, component, noise_level)) for component in positions.T]
    # each component has knots of its own; all are sample times, so equal ones are equal exactly
    breaks = np.unique(np.concatenate([spline.t for spline in splines]))
    coefficients = np.empty((breaks.size - 1, 6, 3))
    for axis, spline in enumerate(splines):
        for order in range(6):
            coefficients[:, order, axis] = spline(breaks[:-1], nu=order) / math.factorial(order)
    return breaks, coefficients


def _refuse_overshoot(motion: Motion, times: Vector, samples: Vector, noise_level: float) -> None:
    """Refuse a spline that leaves the samples between them faster than the samples ever move.

    With a noise level far below the noise of the samples, FITPACK puts a knot at nearly every
    sample and its spline may swing by kilometres in between: so it did in 11 of 36 recordings of the
    COSMER tank (noise 0.5 to 1 mm) at 0.01 mm, and in none at 0.1 mm.
    """
    steps = np.diff(times)[:, None]
    moves = np.diff(samples, axis=0)
    rounding = 1e-9 * (1 + np.abs(samples).max())  # of a recording that does not move
    allowed = np.abs(moves / steps).max() * steps + 10 * noise_level + rounding
    for fraction in (0.25, 0.5, 0.75):
        strayed = motion.position(times[:-1] + fraction * steps[:, 0]) - samples[:-1] - fraction * moves
        bad = np.flatnonzero((np.abs(strayed) > allowed).any(axis=1))
        if bad.size:
            raise ValueError(
                f"recorded: with a noise_level of {noise_level:g} m the spline strays by "
                f"{np.abs(strayed[bad[0]]).max():.3g} m between the samples {bad[0]} and {bad[0] + 1}; "
                "give the real noise level of the samples, or 0 to interpolate."
            )


def _smooth(times: Vector, component: Vector, noise_level: float) -> tuple[Vector, Vector, int]:
    """Knots, coefficients and degree of the smoothing spline of one component."""
    from scipy.interpolate import splrep

    target = times.size * noise_level**2
    spline, residual, flag, message = splrep(times, component, k=5, s=target, full_output=True, quiet=True)
    # flags above 0 are doubts, many of them harmless: only a spline that misses the samples is refused
    if flag > 0 and not residual <= 1.1 * target:
        raise ValueError(
            f"recorded: found no smoothing spline with a residual of {noise_level:g} m "
            f"(reached {math.sqrt(residual / times.size):g} m: {str(message).strip().splitlines()[0]}); "
            "give a larger noise_level, or 0 to interpolate."
        )
    return spline


def _vector(where: str, value: ArrayLike) -> Vector:
    """Three finite numbers."""
    vector = np.asarray(value, dtype=np.float64)
    if vector.shape != (3,):
        raise ValueError(f"{where} has shape {vector.shape}, received {value!r}; give three numbers x, y, z.")
    return _finite(where, vector)


def _table(where: str, value: ArrayLike, rows: int, columns: int) -> Vector:
    """Finite numbers, one row for each time."""
    table = np.asarray(value, dtype=np.float64)
    if table.shape != (rows, columns):
        raise ValueError(
            f"{where} has shape {table.shape}; give ({rows}, {columns}), a row for each of the {rows} times."
        )
    return _finite(where, table)


def _finite(where: str, values: Vector) -> Vector:
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        index = tuple(int(i) for i in bad[0])
        place = f"[{', '.join(map(str, index))}]" if index else ""
        raise ValueError(f"{where}{place} is {values[index]}; give a finite number or leave the row out.")
    return values


def _positive(where: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{where} is {value!r} s; give a positive time.")


def _increasing(where: str, times: Vector) -> None:
    bad = np.flatnonzero(np.diff(times) <= 0)
    if bad.size:
        index = int(bad[0]) + 1
        raise ValueError(
            f"{where}[{index}] is {times[index]:g} s after {times[index - 1]:g} s; "
            "sort the times and leave out repeated ones."
        )


def _waypoint_times(where: str, value: ArrayLike) -> Vector:
    """Non-decreasing times from <= 0 on, none of them more than twice."""
    times = _finite(where, np.asarray(value, dtype=np.float64))
    if times.ndim != 1 or times.size == 0:
        raise ValueError(f"{where} has shape {times.shape}; give at least one waypoint, shape (m,).")
    if times[0] > 0:
        raise ValueError(f"{where}[0] is {times[0]:g} s; add a waypoint at 0 s to say how the motion begins.")
    steps = np.diff(times)
    if (steps < 0).any():
        index = int(np.argmax(steps < 0)) + 1
        raise ValueError(
            f"{where}[{index}] is {times[index]:g} s after {times[index - 1]:g} s; sort the waypoints."
        )
    repeated = (steps[1:] == 0) & (steps[:-1] == 0)
    if repeated.any():
        index = int(np.argmax(repeated)) + 2
        raise ValueError(
            f"{where}[{index}] is {times[index]:g} s for the third time; "
            "two waypoints make a jump, leave the others out."
        )
    return times
