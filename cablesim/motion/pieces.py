"""Piecewise polynomials with known corners: how everything that is prescribed moves.

Depends on: motion.checks.

Every motion is one table of quintic polynomials in time, so that a compiled kernel reads all kinds
of motion in the same way, and velocity and acceleration are exact derivatives of the position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cablesim.motion.checks import check_increasing, checked_finite

Vector = NDArray[np.float64]

FOREVER = 1e9
"""[s]; a final piece of constant velocity reaches so far."""

_RATE_SAMPLES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a piece, for the bound on its rate
_RATE_MARGIN = 1.05  # on the fastest of them


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
            object.__setattr__(self, name, checked_finite(f"Motion.{name}", values))
        pieces = (self.breaks.size - 1, 6)
        if self.breaks.ndim != 1 or self.coefficients.shape not in ((*pieces, 3), (*pieces, 1)):
            raise ValueError(
                f"Motion: breaks has shape {self.breaks.shape} and coefficients "
                f"{self.coefficients.shape}; give (m+1,) and (m, 6, 3), or (m, 6, 1) for a length."
            )
        check_increasing("Motion.breaks", self.breaks)
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


def evaluate_pieces(coefficients: Vector, local: Vector, derivative: int) -> Vector:
    """Evaluate a derivative of polynomials (..., 6, 3) at local times (...); shape (..., 3)."""
    shape = np.broadcast_shapes(coefficients.shape[:-2], local.shape)
    result = np.zeros((*shape, coefficients.shape[-1]))
    for order in range(5, derivative - 1, -1):
        factor = math.perm(order, derivative)
        result = result * local[..., None] + factor * coefficients[..., order, :]
    return result


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


def on_x(values: Vector) -> Vector:
    """Numbers (k,) as points (k, 3) on the x axis."""
    return np.stack([values, np.zeros_like(values), np.zeros_like(values)], axis=1)


def along_x(motion: Motion) -> Motion:
    """The x component of a motion, as a length."""
    return Motion(
        breaks=motion.breaks,
        coefficients=motion.coefficients[:, :, :1],
        corners=motion.corners,
        jumps=motion.jumps,
        end_time=motion.end_time,
    )
