"""Motions to and fro.

Depends on: motion.checks, motion.pieces, motion.fit.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cablesim.motion.checks import check_positive, checked_vector
from cablesim.motion.fit import POSITION_TOLERANCE, Sampler, quintic_pieces
from cablesim.motion.pieces import Motion

Vector = NDArray[np.float64]

_PIECES_PER_PERIOD = 40  # 3e-10 of the amplitude


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
    centre = checked_vector("harmonic: position", position)
    stroke = checked_vector("harmonic: amplitude", amplitude)
    check_positive("harmonic: period", period)
    check_positive("harmonic: duration", duration)
    if not (math.isfinite(ramp) and ramp >= 0 and math.isfinite(phase)):
        raise ValueError(f"harmonic: ramp is {ramp!r} s, phase {phase!r} rad; give a ramp >= 0 and a phase.")
    tolerance = POSITION_TOLERANCE * max(float(np.abs(stroke).max()), 1e-12)
    breaks = [0.0, ramp, duration] if 0 < ramp < duration else [0.0, duration]
    pieces = []
    for start, end in itertools.pairwise(breaks):
        sample = _harmonic_sampler(start, stroke, period, phase, ramp)
        count = max(2, math.ceil(_PIECES_PER_PERIOD * (end - start) / period))
        pieces.append(quintic_pieces(sample, end - start, count, tolerance))
    lengths = np.concatenate([length for length, _ in pieces])
    coefficients = np.concatenate([table for _, table in pieces])
    coefficients[:, 0] += centre
    return Motion(
        breaks=np.append(0.0, np.cumsum(lengths)), coefficients=coefficients, end_time=float(duration)
    )


def _harmonic_sampler(start: float, stroke: Vector, period: float, phase: float, ramp: float) -> Sampler:
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
