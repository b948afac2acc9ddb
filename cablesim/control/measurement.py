"""What a controller of the winch may know, and what it is.

Depends on: nothing of ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a controller is given at a sampling instant: the world as it was `delay` seconds before.

    Attributes
    ----------
    time : float
        When it was measured [s].
    deployed_length, payout_speed : float
        Of the winch [m], [m/s].
    tension_a, tension_b : float
        Tension of the cable at its two ends [N].
    locate : callable
        Takes the name of an attachment, or ``a`` or ``b``, and returns its place and velocity in
        the world frame, each (3,) [m], [m/s]; an attachment on the drum is where the winch is.
    """

    time: float
    deployed_length: float
    payout_speed: float
    tension_a: float
    tension_b: float
    locate: Callable[[str], tuple[Array, Array]]

    def position(self, name: str) -> Array:
        """Place (3,) of an attachment or end in the world frame [m]."""
        return self.locate(name)[0]

    def velocity(self, name: str) -> Array:
        """Velocity (3,) of an attachment or end in the world frame [m/s]."""
        return self.locate(name)[1]

    def distance(self, first: str, second: str) -> float:
        """Distance between two attachments or ends [m]."""
        return math.dist(self.position(first), self.position(second))


@dataclass(frozen=True, eq=False)
class Places:
    """Where everything is at one moment, in the world frame: what `Measurement.locate` calls.

    Attributes
    ----------
    positions, velocities : ndarray, shape (n+1, 3)
        Of the nodes between the ends [m], [m/s].
    nodes : mapping
        Node of each name; one beyond the last is where the winch is.
    """

    positions: Array
    velocities: Array
    nodes: Mapping[str, int]

    def __call__(self, name: str) -> tuple[Array, Array]:
        """Place and velocity, each (3,), of an attachment or end."""
        if name not in self.nodes:
            raise KeyError(f"there is no attachment {name!r}; known are {', '.join(self.nodes)}")
        node = min(self.nodes[name], len(self.positions) - 1)
        return self.positions[node].copy(), self.velocities[node].copy()


class Controller(Protocol):
    """Anything that turns a measurement into the payout speed it wants."""

    def __call__(self, measured: Measurement) -> float:
        """Payout speed asked for [m/s]; the winch goes there as fast as its limits allow."""
        ...
