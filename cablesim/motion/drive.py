"""Motions that are told while they go on: ramps of the velocity, as tables of pieces.

Depends on: motion.pieces.

Breaks (m+1,) and coefficients (m, 6, D) as in `Motion`, for a point as well as for a length (D = 1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cablesim.motion.pieces import FOREVER

Vector = NDArray[np.float64]


def ramp(start: float, end: float, place: Vector, now: Vector, then: Vector) -> tuple[Vector, Vector]:
    """A velocity that goes evenly from `now` to `then` between two times, and stays there.

    Parameters
    ----------
    start, end : float
        Times between which it changes [s].
    place, now, then : ndarray, shape (D,)
        Place at the start [m], velocity there and from the end on [m/s].

    Returns
    -------
    breaks : ndarray, shape (3,)
        [s].
    coefficients : ndarray, shape (2, 6, D)
        [m/s^k].
    """
    duration = end - start
    coefficients = np.zeros((2, 6, np.size(place)))
    coefficients[0, :3] = place, now, 0.5 * (then - now) / duration
    coefficients[1, :2] = place + 0.5 * (now + then) * duration, then
    return np.array([start, end, start + FOREVER]), coefficients


def uniform(place: Vector, velocity: Vector) -> tuple[Vector, Vector]:
    """A place at t = 0 that moves with one velocity, or rests: one piece."""
    coefficients = np.zeros((1, 6, np.size(place)))
    coefficients[0, :2] = place, velocity
    return np.array([0.0, FOREVER]), coefficients
