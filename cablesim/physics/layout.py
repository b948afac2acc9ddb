r"""Where each unknown stands in the state vector Y: the one place that knows.

Depends on: nothing of ours.

With D components (3, or 2 in a vertical plane) and n segments, Y is n cells of 2 D + 1
unknowns and one closing cell of 2 D:

======================  ====================  =============================================
cell                    unknowns              meaning
======================  ====================  =============================================
j = 0 .. n-1            V_j       (D)         velocity of node j, world frame [m/s]
\                       T_j       (1)         tension of segment j [N]
\                       q_j       (D)         chord of segment j over its reference length [-]
n                       V_n       (D)         velocity of node n [m/s]
\                       w         (D)         place of end B, integrated: measured from end A,
                                              or from the origin where end A is free [m]
======================  ====================  =============================================

The residual rows have the same order: balance of forces (2) in the V rows, the tension row in
T, compatibility (3) in q, and w' = V_n - V_A in w.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StateLayout:
    """Named views of Y (or Y', or a whole history of them) for `dimension` D and `segments` n.

    Every view takes an array of shape (..., size) and shares its memory.
    """

    dimension: int
    segments: int

    @property
    def cell(self) -> int:
        """Unknowns in one cell."""
        return 2 * self.dimension + 1

    @property
    def size(self) -> int:
        """Length of Y."""
        return self.segments * self.cell + 2 * self.dimension

    def velocity(self, state: Array) -> Array:
        """Node velocities V of nodes 0 .. n-1, shape (..., n, D); see `end_velocity` for node n."""
        return self._cells(state)[..., : self.dimension]

    def end_velocity(self, state: Array) -> Array:
        """Velocity of node n, shape (..., D)."""
        start = self.segments * self.cell
        return state[..., start : start + self.dimension]

    def tension(self, state: Array) -> Array:
        """Segment tensions T, shape (..., n)."""
        return self._cells(state)[..., self.dimension]

    def chord(self, state: Array) -> Array:
        """Segment vectors q, shape (..., n, D)."""
        return self._cells(state)[..., self.dimension + 1 :]

    def end_place(self, state: Array) -> Array:
        """Integrated place w of end B, shape (..., D)."""
        return state[..., self.segments * self.cell + self.dimension :]

    def node_velocity(self, state: Array) -> Array:
        """Velocities of all nodes 0 .. n as a copy, shape (..., n+1, D)."""
        return np.concatenate((self.velocity(state), self.end_velocity(state)[..., None, :]), axis=-2)

    def describe(self, index: int) -> tuple[str, int]:
        """Kind of unknown `index` in words, and its node."""
        cell, within = divmod(index, self.cell)
        if cell == self.segments:
            return ("velocity" if within < self.dimension else "place of end B"), cell
        if within < self.dimension:
            return "velocity", cell
        return ("tension" if within == self.dimension else "direction"), cell

    def _cells(self, state: Array) -> Array:
        cells = state[..., : self.segments * self.cell]
        return cells.reshape(*state.shape[:-1], self.segments, self.cell)

    def bandwidths(self, *, bending: bool) -> tuple[int, int]:
        """Lower and upper half-bandwidth of the Jacobian."""
        if bending:
            return 2 * self.cell - 2, 2 * self.cell - 1
        return self.cell - 1, self.cell - 1
