"""Datasets of cables whose motion is known in closed form, in the form of a run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

G = 9.81


def dataset(times, s, position, velocity, acceleration, **variables):
    """A dataset with the motion of the nodes (time, node, 3), without a case."""
    dimensions = ("time", "node", "axis")
    return xr.Dataset(
        {
            "position": (dimensions, position),
            "velocity": (dimensions, velocity),
            "acceleration": (dimensions, acceleration),
            **variables,
        },
        {
            "time": ("time", times),
            "s": ("node", s),
            "s_segment": ("segment", 0.5 * (s[1:] + s[:-1])),
            "axis": ["x", "y", "z"],
        },
    )


def pendulum(times, s, amplitude=0.7, rate=2.0, heading=0.3):
    """A straight cable that swings about its end A in a vertical plane; its angle and both rates."""
    angle = amplitude * np.sin(rate * times)
    turn = amplitude * rate * np.cos(rate * times)
    second = -(rate**2) * angle
    out = np.array([np.cos(heading), np.sin(heading), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    tangent = np.sin(angle)[:, None] * out - np.cos(angle)[:, None] * up
    across = np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * up
    first = turn[:, None] * across
    both = second[:, None] * across - (turn**2)[:, None] * tangent
    along = s[None, :, None]
    data = dataset(times, s, *(along * part[:, None] for part in (tangent, first, both)))
    return data, angle, turn, second


def turning(times, s, shape: Callable, spin) -> xr.Dataset:
    """A rigid curve `shape(s)` (n, 3) that turns about the origin with a constant angular velocity."""
    spin = np.asarray(spin, dtype=float)
    place = np.einsum("tij,nj->tni", Rotation.from_rotvec(times[:, None] * spin).as_matrix(), shape(s))
    velocity = np.cross(spin, place)
    return dataset(times, s, place, velocity, np.cross(spin, velocity))


def helix(radius=0.4, pitch=0.5):
    """A curve of unit speed in s with curvature and torsion."""
    stretch = np.hypot(radius, pitch)

    def shape(s):
        turn = s / stretch
        return np.stack((radius * np.cos(turn), radius * np.sin(turn), pitch * turn), axis=-1)

    return shape


def resting(s, place, times=(0.0, 1.0), **variables):
    """A cable at rest through `place` (n, 3)."""
    position = np.broadcast_to(place, (len(times), *place.shape)).copy()
    return dataset(
        np.asarray(times), s, position, np.zeros_like(position), np.zeros_like(position), **variables
    )
