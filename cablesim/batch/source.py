"""A case from its file, with what is set on the command line.

Depends on: case, build (imported when a scene is made).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cablesim.case import Case, CaseError, Problem
from cablesim.case.errors import path_text
from cablesim.case.read import read_yaml

if TYPE_CHECKING:
    from cablesim.scene import Scene


def load_scene(path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Read a case, set what is overridden, and build its scene.

    Parameters
    ----------
    path : path
        Case file.
    overrides : iterable of str
        ``key=value`` with a dotted key, ``attachments.0.mass=2 kg`` in lists; the value is YAML.

    Raises
    ------
    CaseError
        With everything that is wrong with the case.
    OSError
        If the file cannot be read.
    """
    from cablesim.build import build_scene

    try:
        with Path(path).open("rb"):
            pass
    except OSError as error:  # a file that cannot be read is not a case that is wrong
        raise OSError(f"{path}: {error.strerror or error}. Name a case file (YAML).") from None
    overrides = tuple(overrides)
    if not overrides:
        from cablesim.case import load_case

        return build_scene(load_case(path))
    text = _text_of(Path(path))
    data, lines = read_yaml(text, str(path))
    for override in overrides if isinstance(data, dict) else ():
        set_value(data, override)
    try:
        return build_scene(Case.from_dict(data, directory=Path(path).resolve().parent))
    except CaseError as error:
        places = {path_text(location): line for location, line in lines.items()}
        raise CaseError(
            _placed(problem, str(path), places, overrides) for problem in error.problems
        ) from None


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        problem = Problem(path="", message="is not text in UTF-8", remedy="Name a case file.", file=str(path))
        raise CaseError([problem]) from None


def _placed(problem: Problem, file: str, places: dict[str, int], overrides: Sequence[str]) -> Problem:
    """Say where a value stands: on a line of the file, or on the command line."""
    keys = [path_text(_location(override.partition("=")[0])) for override in overrides]
    if any(problem.path == key or problem.path.startswith((f"{key}.", f"{key}[")) for key in keys):
        return replace(problem, file="--set", line=None)
    return replace(problem, file=file, line=places.get(problem.path))


def _location(key: str) -> tuple[str | int, ...]:
    parts = key.strip().replace("[", ".").replace("]", "").split(".")
    return tuple(int(part) if part.isdigit() else part for part in parts)


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
