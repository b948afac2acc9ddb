"""Motions through what was recorded.

Depends on: motion.checks, motion.pieces.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cablesim.motion.checks import check_increasing, checked_finite, checked_table
from cablesim.motion.pieces import Motion, along_x, on_x

Vector = NDArray[np.float64]

_MINIMUM_SAMPLES = 6  # a quintic has six coefficients


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
    when = checked_finite("recorded: times", np.asarray(times, dtype=np.float64))
    if when.ndim != 1 or when.size < _MINIMUM_SAMPLES:
        raise ValueError(
            f"recorded: times has shape {when.shape}; give at least {_MINIMUM_SAMPLES} samples, shape (k,)."
        )
    check_increasing("recorded: times", when)
    samples = checked_table("recorded: positions", positions, when.size, 3)
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
    if noise_level > 0:  # what interpolates is as rough as its samples
        refuse_overshoot(motion, when - origin, samples, noise_level)
    return motion


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
    samples = checked_table(
        "recorded_length: lengths", np.asarray(lengths, float).reshape(-1, 1), np.size(times), 1
    )
    return along_x(recorded(times, on_x(samples[:, 0]), noise_level, start=start))


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


def refuse_overshoot(motion: Motion, times: Vector, samples: Vector, noise_level: float) -> None:
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
