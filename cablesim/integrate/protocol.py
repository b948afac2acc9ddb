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


class Status(StrEnum):
    """How an advance, or a whole run, ended."""

    COMPLETED = "completed"
    EVENT = "event"
    ATTACHMENT_AT_WINCH = "attachment at winch"
    DRUM_EMPTY = "drum empty"
    MINIMUM_LENGTH = "minimum length"
    CONTROLLER_FAILED = "controller failed"
    INTERRUPTED = "interrupted"
    STEP_LIMIT = "step limit"
    ERROR_TEST_FAILURES = "error test failures"
    CONVERGENCE_FAILURE = "convergence failure"
    NOT_FINITE = "not finite"
    TIME_LIMIT = "time limit"

    @property
    def sentence(self) -> str:
        """What happened and what to try."""
        return _SENTENCES[self]


_SENTENCES = {
    Status.COMPLETED: "The run reached its end.",
    Status.EVENT: "An event function went through nought.",
    Status.ATTACHMENT_AT_WINCH: (
        "Reeling in brought an attachment to the winch: stop the winch earlier, or place the attachment "
        "nearer to end A."
    ),
    Status.DRUM_EMPTY: "All cable is out: pay out less, or give a longer cable.length.",
    Status.MINIMUM_LENGTH: (
        "The deployed length fell to its minimum, winch.minimum_length or what the mesh needs: reel in "
        "less, or give shorter segments."
    ),
    Status.CONTROLLER_FAILED: "What was computed is kept.",
    Status.INTERRUPTED: "The run was interrupted; what was computed is kept.",
    Status.STEP_LIMIT: (
        "The number of steps reached simulation.max_steps: the tolerance may be too tight for the noise in a "
        "recorded motion (raise its 'noise'), or structural_damping too small."
    ),
    Status.ERROR_TEST_FAILURES: (
        "The error test failed at the smallest step: an input jumps where it was declared smooth, or the "
        "tolerance is below what rounding allows; try a larger relative_tolerance."
    ),
    Status.CONVERGENCE_FAILURE: (
        "Newton's iteration did not converge at the smallest step: look at the shape near the node named; "
        "a finer mesh there, more structural_damping or a little bending_stiffness usually helps."
    ),
    Status.NOT_FINITE: "A number that is not finite appeared; the last good state is kept.",
    Status.TIME_LIMIT: (
        "The wall-clock limit simulation.time_limit was reached; what was computed is kept. "
        "Where structural_damping is 0 axial waves set the step: 1e-5 s of it is often enough."
    ),
}


class Events(Protocol):
    """Functions of time whose zeros end an advance."""

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

    def advance(self, t: float, t_stop: float) -> tuple[Status, float, Array, Array]:
        """Go to `t`, never evaluating beyond `t_stop`; returns status, time reached, Y and Y'.

        The status is ``EVENT`` where an event function has gone through nought on the way.
        """
        ...
