"""Errors of a case: where, what was received, what to do about it, all of a file at once.

Depends on: nothing of ours.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Location = tuple[str | int, ...]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One thing that is wrong with a case.

    Attributes
    ----------
    path : str
        Place in the case, for instance ``attachments[2].at``; empty for the case as a whole.
    message : str
        What is wrong.
    received : str or None
        The value as it was written; ``None`` where there was nothing to repeat.
    remedy : str
        What to write instead.
    file : str or None
        The case file, when the case came from one.
    line : int or None
        Line in that file, counted from 1.
    """

    path: str
    message: str
    remedy: str
    received: str | None = None
    file: str | None = None
    line: int | None = None

    def __str__(self) -> str:
        place = [text for text in (self._file_and_line(), self.path) if text]
        sentence = self.message if self.received is None else f"{self.message}; received {self.received}"
        return f"{': '.join([*place, sentence])}. {self.remedy}"

    def _file_and_line(self) -> str:
        if self.line is None:
            return self.file or ""
        return f"{self.file}:{self.line}" if self.file else f"line {self.line}"


class CaseError(ValueError):
    """A case that cannot be read or cannot run.

    Attributes
    ----------
    problems : tuple of Problem
        Everything found wrong, in the order of the case.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self._text())

    def _text(self) -> str:
        if len(self.problems) == 1:
            return str(self.problems[0])
        lines = [f"{len(self.problems)} problems:", *(f"- {problem}" for problem in self.problems)]
        return "\n".join(lines)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.problems,)


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where a case came from, so that a message can name the file and the line.

    Attributes
    ----------
    directory : Path
        Relative paths in the case start here.
    file : str or None
        The case file as it was named by the caller.
    lines : mapping
        Line (from 1) of each place of the case, by its path as a tuple of keys and indices.
    raw : dict or None
        The case as it was written, before units were converted.
    """

    directory: Path
    file: str | None = None
    lines: Mapping[Location, int] | None = None
    raw: Any = None

    def line(self, location: Location) -> int | None:
        """Line of `location`, or of the nearest enclosing place that has one."""
        for end in range(len(location), -1, -1):
            found = (self.lines or {}).get(location[:end])
            if found is not None:
                return found
        return None

    def problem(self, location: Location, message: str, remedy: str, received: Any = ...) -> Problem:
        """Make the problem at `location`; the value is looked up in the case unless it is given.

        Pass ``received=None`` to repeat nothing.
        """
        if received is ...:
            received = self.written(location)
            received = None if received is ... else short(received)
        elif received is not None and not isinstance(received, str):
            received = short(received)
        return Problem(
            path=path_text(location),
            message=message,
            remedy=remedy,
            received=received,
            file=self.file,
            line=self.line(location),
        )

    def written(self, location: Location) -> Any:
        """Look up the value at `location` as the user wrote it; ``...`` when it is not there."""
        node = self.raw
        for item in location:
            try:
                node = node[item]
            except (KeyError, IndexError, TypeError):
                return ...
        return node if location else ...


def path_text(location: Location) -> str:
    """Write a path as people do: ``attachments[2].at``."""
    text = ""
    for item in location:
        text += f"[{item}]" if isinstance(item, int) else f".{item}" if text else str(item)
    return text


def short(value: Any, length: int = 70) -> str:
    """Repeat a value on one short line."""
    text = repr(value)
    return text if len(text) <= length else f"{text[: length - 3]}..."


def nearest(word: object, known: Iterable[str]) -> str | None:
    """Return the known name most like `word`, or ``None`` when none is close."""
    found = difflib.get_close_matches(str(word), list(known), n=1, cutoff=0.6)
    return found[0] if found else None


def suggestion(word: object, known: Iterable[str]) -> str:
    """Write ``Did you mean 'x'?``, followed by the known names."""
    names = sorted(known)
    listed = f"Known here: {', '.join(names)}." if names else "Nothing is known here."
    close = nearest(word, names)
    return f"Did you mean '{close}'? {listed}" if close else listed
