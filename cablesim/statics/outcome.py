"""What a start has found, and the error when it finds nothing.

Depends on: physics.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.model import CableModel

Array = NDArray[np.float64]


class Rung(StrEnum):
    """Which step of the ladder gave the initial state."""

    TAUT = "taut"
    CATENARY = "catenary"
    NEWTON = "newton"
    RELAXATION = "relaxation"
    MARKERS = "markers"
    SAVED = "saved state"


class StaticsError(RuntimeError):
    """No rest shape was found; the message says how far the search came and what to try."""


@dataclass(frozen=True)
class InitialState:
    """A state that fulfils the discrete equations at t = 0.

    Attributes
    ----------
    model : CableModel
        The equations it belongs to.
    y : ndarray, shape (size,)
        State.
    rung : Rung
        How it was found.
    residual : float
        Largest unbalanced force on a node, were the cable held at rest [N].
    iterations : int
        Newton iterations spent.
    """

    model: CableModel
    y: Array
    rung: Rung
    residual: float
    iterations: int

    @property
    def message(self) -> str:
        """One sentence on how the state was found."""
        return (
            f"initial shape by {self.rung.value}: {self.iterations} Newton iterations, "
            f"largest unbalanced force {self.residual:.2g} N"
        )
