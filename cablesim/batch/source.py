"""A case from its file or standard input, with what is set on the command line.

Depends on: files, case, build (imported when a scene is made).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cablesim.case import Case, CaseError, Problem
from cablesim.case.errors import path_text
from cablesim.case.read import read_yaml
from cablesim.files import STANDARD_INPUT, real_path

if TYPE_CHECKING:
    from cablesim.scene import Scene


_LARGEST = 64 << 20  # bytes of a case; devices such as /dev/zero have no end


def load_scene(path: str | Path, overrides: Iterable[str] = (), text: str | None = None) -> Scene:
    """Read a case, set what is overridden, and build its scene; see `read_case`."""
    from cablesim.build import build_scene

    overrides = tuple(overrides)
    with _blaming(overrides):
        return build_scene(read_case(path, overrides, text))


def read_case(path: str | Path, overrides: Iterable[str] = (), text: str | None = None) -> Case:
    """Read a case and set what is overridden.

    Parameters
    ----------
    path : path
        Case file, or ``-`` for standard input, where relative paths start in the working directory.
    overrides : iterable of str
        ``key=value`` with a dotted key, ``attachments.0.mass=2 kg`` in lists; the value is YAML.
    text : str, optional
        What `case_text` read there before.

    Raises
    ------
    CaseError
        With everything that is wrong with the case.
    OSError
        If the file cannot be read.
    """
    path, overrides = Path(path), tuple(overrides)
    name = name_of(path)
    data, lines = read_yaml(case_text(path) if text is None else text, name)
    for override in overrides if isinstance(data, dict) else ():
        set_value(data, override)
    place = Path.cwd() if read_once(path) else real_path(path).parent
    with _blaming(overrides):
        return Case.from_dict(data, directory=place, file=name, lines=lines)


def name_of(path: Path) -> str:
    """What people call the source of a case."""
    return "standard input" if path == STANDARD_INPUT else str(path)


def read_once(path: Path) -> bool:
    """Whether a source is gone when it has been read: standard input or a pipe, as of ``<(...)``."""
    return path == STANDARD_INPUT or path.is_fifo()


def case_text(path: Path) -> str:
    """Text of a case file, or of standard input, which can be read once."""
    try:
        if path == STANDARD_INPUT:
            raw = sys.stdin.buffer.read(_LARGEST + 1)
        else:
            with path.open("rb") as stream:
                raw = stream.read(_LARGEST + 1)
    except OSError as error:  # a file that cannot be read is not a case that is wrong
        raise OSError(f"{name_of(path)}: {error.strerror or error}. Name a case file (YAML).") from None
    if len(raw) > _LARGEST:
        raise _no_case(path, f"is longer than {_LARGEST >> 20} MiB")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _no_case(path, "is not text in UTF-8") from None


def _no_case(path: Path, message: str) -> CaseError:
    return CaseError([Problem(path="", message=message, remedy="Name a case file.", file=name_of(path))])


def files_read(case: Case) -> set[Path]:
    """Files that a case names: any text in it that is the path of one, also before ``:name``."""
    texts = set(_texts(case.model_dump(mode="json")))
    candidates = texts | {text.rpartition(":")[0] for text in texts}
    return {case.directory / text for text in candidates if text and _is_file(case.directory / text)}


def _texts(data: Any) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict | list):
        for part in data.values() if isinstance(data, dict) else data:
            yield from _texts(part)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long for a name, or with letters that no name has
        return False


@contextmanager
def _blaming(overrides: Sequence[str]) -> Iterator[None]:
    """Say of values from the command line that they stand there, and not on a line of the file."""
    keys = [path_text(_location(override.partition("=")[0])) for override in overrides]

    def placed(problem: Problem) -> Problem:
        if any(problem.path == key or problem.path.startswith((f"{key}.", f"{key}[")) for key in keys):
            return replace(problem, file="--set", line=None)
        return problem

    try:
        yield
    except CaseError as error:
        raise CaseError(map(placed, error.problems)) from None


def _location(key: str) -> tuple[str | int, ...]:
    parts = key.strip().replace("[", ".").replace("]", "").split(".")
    return tuple(int(part) if part.isdecimal() else part for part in parts)


def set_value(data: Any, override: str) -> None:
    """Set one ``key=value`` in plain data; groups that are not there yet are made."""
    key, equals, text = override.partition("=")
    if not equals or not all(part != "" for part in _location(key)):
        raise _bad_override(override, "is not of the form key=value", "Write, e.g., simulation.duration=5")
    value, _ = read_yaml(text, "--set")
    *groups, last = _location(key)
    node = data
    try:
        for item in groups:
            if isinstance(node, dict) and isinstance(item, str):
                node = node.setdefault(item, {})
            else:
                node = node[item]
        node[last] = value
    except (KeyError, IndexError, TypeError):
        raise _bad_override(
            override, "does not fit the case", "Use the keys of the case file, and numbers in lists"
        ) from None


def _bad_override(override: str, message: str, remedy: str) -> CaseError:
    return CaseError([Problem(path=override, message=message, remedy=f"{remedy}.", file="--set")])
