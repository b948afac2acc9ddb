"""What the simulation asks of an integrator, and what an integrator asks of the equations.

Depends on: nothing of ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Advance(StrEnum):
    """How an advance ended."""

    REACHED = "reached"
    EVENT = "event"
    INTERRUPTED = "interrupted"
    STEP_LIMIT = "step limit"
    ERROR_TEST_FAILURES = "error test failures"
    CONVERGENCE_FAILURE = "convergence failure"
    NOT_FINITE = "not finite"
    TIME_LIMIT = "time limit"


class Events(Protocol):
    """Functions of time that end an advance where they fall through nought."""

    count: int

    def __call__(self, t: float, out: Array) -> None:
        """Write the values, shape (count,), to `out`."""
        ...


class Equations(Protocol):
    """A system F(t, Y, Y') = 0 with a banded Jacobian."""

    @property
    def bandwidths(self) -> tuple[int, int]:
        """Lower and upper half-bandwidth."""
        ...

    def residual(self, t: float, y: Array, yp: Array, out: Array) -> None:
        """Write F to `out`."""
        ...

    def jacobian(self, t: float, y: Array, yp: Array, c_j: float, out: Array) -> None:
        """Write the band of dF/dY + c_j dF/dY' to the full matrix `out`."""
        ...

    def band_jacobian(self, t: float, y: Array, yp: Array, c_j: float, rows_above: int = 0) -> Array:
        """Return it in LAPACK band storage."""
        ...


@dataclass
class Counters:
    """Work done, and when it must end; integrators of several sizes share it.

    Attributes
    ----------
    residual_calls, jacobian_calls, starts : int
        So far.
    deadline : float
        Instant of ``time.monotonic()`` at which an advance ends with ``TIME_LIMIT``.
    """

    residual_calls: int = 0
    jacobian_calls: int = 0
    starts: int = 0
    deadline: float = math.inf


class Integrator(Protocol):
    """Advances a state; the caller decides when, and restarts it where the state jumps."""

    counters: Counters

    def start(self, t: float, y: Array, yp: Array) -> None:
        """Begin at a consistent state (the order falls to 1)."""
        ...

    def advance(self, t: float, t_stop: float) -> tuple[Advance, float, Array, Array]:
        """Go to `t`, never evaluating beyond `t_stop`; returns outcome, time reached, Y and Y'.

        The outcome is ``EVENT`` where an event function has fallen through nought on the way.
        """
        ...
