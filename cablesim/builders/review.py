"""A case under review: what is wrong with it is collected, so that all of it is said at once.

Depends on: case, motion, recording, scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablesim import recording
from cablesim.case import Case, Problem
from cablesim.case.errors import Location, nearest
from cablesim.case.quantities import UnitError, length_factor
from cablesim.motion import Motion
from cablesim.scene import Vector

STRAIN_LIMIT = 0.05
"""Strain a cable may need to span its ends at t = 0, or a measured chord over its arc."""

STATES_LIMIT = 10_000_000
"""Most states kept of a run, and most samples that a controller is asked for."""


class Stop(Exception):  # noqa: N818
    """Leaves the part of the case that has just been refused."""


class Review:
    """A case on its way to a scene, and what was found wrong with it.

    Attributes
    ----------
    case : Case
        The case.
    directory : Path
        Where relative paths in it start.
    problems : list of Problem
        What was found wrong so far.
    warnings : list of str
        What is odd, but can be run.
    """

    def __init__(self, case: Case, directory: Path) -> None:
        self.case = case
        self.directory = directory
        self.problems: list[Problem] = []
        self.warnings: list[str] = []

    @property
    def start_length(self) -> float:
        """Unstretched length between A and B at t = 0 [m]."""
        winch = self.case.winch
        return self.case.cable.length if winch is None else winch.deployed_length

    @property
    def length_key(self) -> str:
        """Where the case says this length."""
        return "cable.length" if self.case.winch is None else "winch.deployed_length"

    @contextmanager
    def collect(self) -> Iterator[None]:
        """Go on after this part of the case when it is refused."""
        with suppress(Stop):
            yield

    def note(self, path: Location, message: str, remedy: str, received: Any = ...) -> None:
        """Note a problem and go on; parameters as of `Case.problem`."""
        self.problems.append(self.case.problem(path, message, remedy, received))

    def refuse(self, path: Location, message: str, remedy: str, received: Any = ...) -> Stop:
        """Note a problem and return what the caller raises to leave the part."""
        self.note(path, message, remedy, received)
        return Stop()

    @contextmanager
    def trying(self, path: Location, remedy: str) -> Iterator[None]:
        """Turn what a reader or a motion refuses into a problem of the case."""
        try:
            yield
        except (ValueError, OverflowError, OSError) as error:
            if isinstance(error, OSError) and error.strerror:
                message = f"cannot be read: {error.strerror}"
            else:
                message, remedy = _message_and_remedy(str(error), remedy)
            raise self.refuse(path, message, remedy) from None

    def file(self, name: str, path: Location) -> Path:
        """Find a file that the case names at `path`."""
        file = self.directory / name
        if file.is_file():
            return file
        if file.exists():
            raise self.refuse(path, f"{file} is no ordinary file", "Name a file.")
        siblings = [entry.name for entry in file.parent.iterdir()] if file.parent.is_dir() else []
        close = nearest(file.name, siblings)
        hint = f"Did you mean '{close}'?" if close else "Paths are relative to the case file."
        raise self.refuse(path, f"there is no file {file}", hint)

    def unit(self, direction: ArrayLike, path: Location) -> Vector:
        """Scale a direction to length 1."""
        vector = np.asarray(direction, dtype=float)
        norm = float(np.linalg.norm(vector))
        if not norm > 0:
            raise self.refuse(path, "has no length", "Give a direction such as [1, 0, 0].")
        return vector / norm

    def waypoint_times(self, rows: Sequence[Sequence[float]], where: Location) -> None:
        """Refuse waypoints that begin after t = 0 or are not sorted by their time, the first column."""
        times = np.array([row[0] for row in rows])
        if times[0] > 0:
            raise self.refuse(
                (*where, 0, 0), "is after the start", "Add a first waypoint at 0 s: how the motion begins."
            )
        falls = np.flatnonzero(np.diff(times) < 0)
        if falls.size:
            raise self.refuse(
                (*where, int(falls[0]) + 1, 0),
                f"is before the waypoint above it, {times[falls[0]]:g} s",
                "Sort the waypoints by time; two at one time make a jump.",
            )

    def known_long_enough(self, motion: Motion, what: str, where: Location) -> None:
        """Refuse a motion that ends before the run."""
        duration = self.case.simulation.duration
        if motion.end_time < duration * (1 - 1e-9):
            raise self.refuse(
                where,
                f"the {what} ends {motion.end_time:g} s after the start, before the run of {duration:g} s",
                f"Give `simulation.duration` of {motion.end_time:g} s or less, or a longer {what}.",
                None,
            )

    def length_factor(self, unit: str | None, where: Location) -> float | None:
        """Metres in one `unit` of length; ``None`` leaves it to the file."""
        if unit is None:
            return None
        try:
            return length_factor(unit)
        except UnitError as error:
            raise self.refuse(where, error.message, error.remedy) from None

    def upright(self, positions: Vector, up: ArrayLike | None, where: Location) -> Vector:
        """Turn measured positions so that their vertical, if it was measured, is z."""
        if up is None:
            return positions
        return recording.rotate_to_vertical(positions, self.unit(up, (*where, "up")))


def _message_and_remedy(text: str, remedy: str) -> tuple[str, str]:
    """Split what a reader or a motion says, ``what is wrong; what to do``."""
    message, semicolon, rest = text.rstrip(".").rpartition("; ")
    return (message, f"{rest[0].upper()}{rest[1:]}.") if semicolon and rest else (text.rstrip("."), remedy)
