"""A case under review: what is wrong with it is collected, so that all of it is said at once.

Depends on: case, recording, scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablesim import recording
from cablesim.case import Case, Problem
from cablesim.case.errors import Location, nearest
from cablesim.case.quantities import UnitError, length_factor
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
    """

    def __init__(self, case: Case, directory: Path) -> None:
        self.case = case
        self.directory = directory
        self.problems: list[Problem] = []

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

    def length_factor(self, unit: str, where: Location) -> float:
        """Metres in one `unit` of length."""
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
