"""What a controller of the winch may know, and what it is.

Depends on: nothing of ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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


class Controller(Protocol):
    """Anything that turns a measurement into the payout speed it wants."""

    def __call__(self, measured: Measurement) -> float:
        """Payout speed asked for [m/s]; the winch goes there as fast as its limits allow."""
        ...
