"""Vectors and quaternions as arrays of components: the few operations of which there are many.

Depends on: nothing of ours.

Components come first, (3, ...) and (4, ...) with the scalar last, so that each is contiguous.  Products of
many rotations are ten times as fast here as in `scipy.spatial.transform`, whose conventions these are, and
what is not known (a sensor on the drum) stays NaN instead of being refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dot(a: Array, b: Array) -> Array:
    """Scalar products (...) of vectors (3, ...)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Array, b: Array) -> Array:
    """Vector products (3, ...)."""
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def triple(a: Array, b: Array, c: Array) -> Array:
    """Triple products (a x b) . c (...)."""
    return (
        (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2]
    )


def direction(vector: Array, rate: Array) -> tuple[Array, Array, Array]:
    """Direction (3, ...) of vectors, its rate, and the length (...), from the vectors' rates."""
    length = np.sqrt(dot(vector, vector))
    unit = vector / length
    return unit, (rate - dot(rate, unit) * unit) / length, length


def multiply(first: Array, second: Array) -> Array:
    """Quaternions (4, ...) of rotations by `second`, then by `first`."""
    x, y, z, w = first
    p, q, r, s = second
    return np.stack(
        (
            w * p + x * s + y * r - z * q,
            w * q - x * r + y * s + z * p,
            w * r + x * q - y * p + z * s,
            w * s - x * p - y * q - z * r,
        )
    )


def smallest(start: Array, end: Array) -> Array:
    """Quaternions (4, ...) of the smallest rotations from unit vectors `start` to `end`."""
    quaternion = np.concatenate((cross(start, end), (1.0 + dot(start, end))[None]))
    return quaternion / np.sqrt((quaternion * quaternion).sum(axis=0))


def about(axis: int, angle: Array) -> Array:
    """Quaternions (4, ...) of rotations about a coordinate axis by angles (...) [rad]."""
    quaternion = np.zeros((4, *np.shape(angle)))
    quaternion[axis], quaternion[3] = np.sin(0.5 * angle), np.cos(0.5 * angle)
    return quaternion


def turn(vector: Array) -> Array:
    """Quaternions (4, ...) of rotations by rotation vectors (3, ...) [rad]."""
    half = 0.5 * np.sqrt(dot(vector, vector))
    return np.concatenate((0.5 * np.sinc(half / np.pi) * vector, np.cos(half)[None]))


def rotate(quaternion: Array, vector: Array) -> Array:
    """Vectors (3, ...) turned by rotations (4, ...)."""
    twice = 2.0 * cross(quaternion[:3], vector)
    return vector + quaternion[3] * twice + cross(quaternion[:3], twice)


def rotate_back(quaternion: Array, vector: Array) -> Array:
    """Vectors (3, ...) turned by the inverse of rotations (4, ...)."""
    return rotate(np.concatenate((-quaternion[:3], quaternion[3:])), vector)
