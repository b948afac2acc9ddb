"""States at the output times, and what happened at the winch.

Depends on: physics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.layout import StateLayout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WinchEvent:
    """A node that appeared at the winch or went on its drum.

    Attributes
    ----------
    time : float
        [s].
    change : int
        +1 for a node that appeared, -1 for one that went.
    energy_change : float
        Change of kinetic energy [J].
    momentum_change : float
        Size of the change of momentum, added mass included [kg m/s].
    """

    time: float
    change: int
    energy_change: float
    momentum_change: float


class History:
    """States at the output times, as far as the run came.

    States of a cable on a winch are kept on the mesh of the whole cable, with all that is on the drum
    drawn together at the winch: segments without length that go on with the last tension and direction.
    So every formula holds for them as it stands; `build_dataset` takes them out in the end.

    Parameters
    ----------
    times : ndarray, shape (k,)
        Output times [s].
    layout : StateLayout
        Of the model, or for a winch that of the whole cable.
    """

    def __init__(self, times: Array, layout: StateLayout) -> None:
        self.times = times
        self.layout = layout
        self.events: list[WinchEvent] = []
        self._y = np.empty((times.size, layout.size))
        self._yp = np.empty((times.size, layout.size))
        self._segments = np.full(times.size, layout.segments)
        self._deployed = np.zeros((times.size, 3))
        self._count = 0

    def record(self, y: Array, yp: Array, deployed: Array | None = None) -> None:
        """Keep the state of the next output time.

        `deployed` is the deployed length [m] of a winch, its speed [m/s] and acceleration [m/s2].
        """
        k = self._count
        self._fill(self._y[k], y)
        self._fill(self._yp[k], yp)
        if deployed is not None:
            self._segments[k] = (y.size - 2 * self.layout.dimension) // self.layout.cell
            self._deployed[k] = deployed
        self._count += 1

    def close(self, t: float, y: Array, yp: Array, deployed: Array | None = None) -> None:
        """End early: keep the last good state when it is later than the last output."""
        if t > self.times[self._count - 1]:
            self.times[self._count] = t
            self.record(y, yp, deployed)
        self.times = self.times[: self._count]

    def _fill(self, row: Array, y: Array) -> None:
        """Write a state, and in the place of missing cells the winch's velocity and the last segment."""
        if y.size == row.size:
            row[:] = y
            return
        d, cell = self.layout.dimension, self.layout.cell
        there = y.size - 2 * d
        row[:there], row[-2 * d :] = y[:there], y[there:]
        on_drum = row[there : -2 * d].reshape(-1, cell)
        on_drum[:, :d], on_drum[:, d:] = y[there : there + d], y[there - cell + d : there]

    @property
    def y(self) -> Array:
        """States, shape (recorded, size)."""
        return self._y[: self._count]

    @property
    def yp(self) -> Array:
        """Their rates, shape (recorded, size)."""
        return self._yp[: self._count]

    @property
    def segments(self) -> NDArray[np.int64]:
        """Segments deployed, shape (recorded,)."""
        return self._segments[: self._count]

    @property
    def deployed(self) -> Array:
        """Deployed length, its speed and acceleration, shape (recorded, 3)."""
        return self._deployed[: self._count]
