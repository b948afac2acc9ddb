"""How a run ended, for people and for programs.

Depends on: case, files.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from cablesim.case import CaseError
from cablesim.files import OutputError

log = logging.getLogger("cablesim")


class Outcome(IntEnum):
    """How a run ended; the value is the exit code of the command line."""

    COMPLETED = 0
    STOPPED = 1
    REFUSED = 2
    FILE_PROBLEM = 3
    INTERRUPTED = 130


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """How one run ended.

    Attributes
    ----------
    case : Path
        The case file.
    outcome : Outcome
        What it means for the caller.
    status, message : str
        As in the result's attributes: a word, and a sentence.
    file : Path or None
        The result, when one was written.
    simulated_seconds, wall_seconds : float
        How far the run came, and how long the integration took [s].
    residual_calls : int
        Work done by the integrator.
    warnings : tuple of str
        What is odd about the case and its result.
    """

    case: Path
    outcome: Outcome
    status: str
    message: str
    file: Path | None = None
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    residual_calls: int = 0
    warnings: tuple[str, ...] = ()

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall-clock seconds."""
        return self.simulated_seconds / self.wall_seconds if self.wall_seconds > 0 else 0.0


class Watcher:
    """Told how the runs go, by their index; this one does nothing."""

    def progressed(self, index: int, time: float, duration: float) -> None:
        """Learn that a run came to `time` of `duration` [s]."""

    def finished(self, index: int, summary: RunSummary) -> None:
        """Learn that a run ended."""


def explain_failure(error: BaseException) -> tuple[Outcome, str, str]:
    """Outcome, status and message of what went wrong before there was a result."""
    if isinstance(error, KeyboardInterrupt):
        return Outcome.INTERRUPTED, "interrupted", "Interrupted before there was anything to write."
    if isinstance(error, CaseError) or type(error).__name__ == "StaticsError":  # its module is slow to import
        return Outcome.REFUSED, "refused", str(error)
    if isinstance(error, OSError):
        return Outcome.FILE_PROBLEM, "file problem", _os_message(error)
    if isinstance(error, MemoryError):
        return (
            Outcome.STOPPED,
            "out of memory",
            "Not enough memory: take fewer segments, or keep fewer states.",
        )
    log.debug("unexpected", exc_info=error)
    text = f"{type(error).__name__}: {error}. This is a mistake in cablesim; please report it."
    return Outcome.STOPPED, "internal error", text


def _os_message(error: OSError) -> str:
    if isinstance(error, OutputError) or error.strerror is None:
        return str(error)
    return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
