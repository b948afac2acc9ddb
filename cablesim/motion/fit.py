"""Quintics through a motion that is no polynomial, as many as its error asks for.

Depends on: motion.pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cablesim.motion.pieces import evaluate_pieces

Vector = NDArray[np.float64]

POSITION_TOLERANCE = 1e-9
"""Largest error of a fitted piece: [m] for a turning vehicle, times the amplitude for a harmonic motion."""

MAXIMUM_PIECES = 100_000
"""Most pieces that one interval between waypoints, or one harmonic motion, is cut into."""

_CHECKS = 4  # sub-intervals of a piece at whose ends the fit is checked

# Times (k,) from 0 on -> positions, velocities, accelerations (k, 3)
Sampler = Callable[[Vector], tuple[Vector, Vector, Vector]]


def quintic_pieces(sample: Sampler, length: float, count: int, tolerance: float) -> tuple[Vector, Vector]:
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
