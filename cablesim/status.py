"""How a run, or a step of one, ended.

Depends on: integrate.protocol.
"""

from __future__ import annotations

from enum import StrEnum

from cablesim.integrate.protocol import Advance


class Status(StrEnum):
    """How a run, or a step of one, ended."""

    COMPLETED = "completed"
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

    @classmethod
    def of(cls, outcome: Advance) -> Status:
        """What the outcome of an advance without an event means for the run."""
        return cls.COMPLETED if outcome is Advance.REACHED else cls[outcome.name]

    @property
    def sentence(self) -> str:
        """What happened and what to try."""
        return _SENTENCES[self]


WINCH_STOPS = frozenset({Status.ATTACHMENT_AT_WINCH, Status.DRUM_EMPTY, Status.MINIMUM_LENGTH})
"""What ends a run because the winch can go no further that way."""

_SENTENCES = {
    Status.COMPLETED: "The run reached its end.",
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
        "Where axial waves set the step, structural_damping or simulation.mesh_damping (1 damps those of two "
        "segments critically) shortens the run, and so does a larger relative_tolerance."
    ),
}
