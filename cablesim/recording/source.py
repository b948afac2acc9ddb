"""What all recordings have in common: a file of some form, and words for what is wrong with it.

Depends on: case.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cablesim.case.quantities import UnitError, length_factor

Vector = NDArray[np.float64]

FORMATS = ("auto", "csv", "netcdf", "qtm")

_NETCDF_STARTS = (b"CDF", b"\x89HDF")


_OTHER_KINDS = {
    b"PK\x03\x04": "a zip archive or an Excel workbook",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
    b"%PDF": "a PDF",
    b"\x1f\x8b": "a gzip archive",
    b"MATLAB": "a MATLAB file",
    b"#ROSBAG": "a ROS bag",
    b"SQLite format 3": "a database, perhaps a ROS 2 bag",
    b"\xff\xfe": "text in UTF-16",
    b"\x89HDF": "an HDF5 or netCDF file",
    b"CDF": "a netCDF file",
}


class RecordingError(ValueError):
    """A recording that cannot be read: says the file, the place, what stands there and what to do."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """What was read from a recording, in the units of the file.

    Attributes
    ----------
    times : ndarray, shape (k,)
        [s]; dates count from the first.
    values : ndarray, shape (k, d)
        Positions or lengths, NaN in the whole row where nothing was measured.
    places : list of str
        Where each row stands in the file, for messages.
    units : tuple of str or None, length d
        What the file says the values are in; ``None`` where it does not.
    """

    times: Vector
    values: Vector
    places: list[str]
    units: tuple[str | None, ...]

    def in_metres(self, path: Path, factor: float | None) -> Vector:
        """Values in metres; `factor` is what the user says of their unit, if anything."""
        return self.values * [_length_factor(path, unit, factor) for unit in self.units]


def _length_factor(path: Path, unit: str | None, told: float | None) -> float:
    if unit is None:
        return 1.0 if told is None else told
    try:
        factor = length_factor(unit)
    except UnitError:
        raise RecordingError(f"{path}: holds values in {unit!r}, which is no length; project them.") from None
    if told is not None and not math.isclose(told, factor, rel_tol=1e-9):
        raise RecordingError(
            f"{path}: says that its values are in {unit!r}, and the case that they are in units of "
            f"{told:g} m; leave `unit` out, or correct the file."
        )
    return factor


def existing(path: str | Path) -> Path:
    """Return the path of a file, or say what is near it."""
    source = Path(path)
    if source.is_file():
        return source
    siblings = [entry.name for entry in source.parent.iterdir()] if source.parent.is_dir() else []
    raise RecordingError(
        f"{source}: no such file (looked in {source.parent.resolve()}){nearest(source.name, siblings)}."
    )


def file_format(path: Path, name: str) -> str:
    """Return the format that is named, or for ``auto`` the one that the file has."""
    if name not in FORMATS:
        raise RecordingError(f"{path}: format {name!r} is unknown; choose one of {', '.join(FORMATS)}.")
    start = _first_bytes(path)
    if name == "netcdf" or (name == "auto" and start.startswith(_NETCDF_STARTS)):
        return "netcdf"
    text = start.decode("utf-8-sig", errors="replace")
    return "qtm" if name == "qtm" or text.startswith(("NO_OF_FRAMES", "FILE_VERSION")) else "csv"


def kind_of_binary(path: Path) -> str | None:
    """Say in words what a file that is not text is; ``None`` for text."""
    start = _first_bytes(path)
    known = next((words for magic, words in _OTHER_KINDS.items() if start.startswith(magic)), None)
    return known or ("a binary file" if b"\0" in start else None)


def _first_bytes(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(1024)


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Half a sentence that proposes the most similar name, or nothing."""
    lowered = {candidate.lower(): candidate for candidate in candidates}
    found = difflib.get_close_matches(name.lower(), lowered, n=1)
    return f"; did you mean {lowered[found[0]]!r}?" if found else ""


def text_lines(path: Path) -> list[str]:
    """Lines of a text file; refuse files of another kind."""
    other = kind_of_binary(path)
    if other is not None:
        raise RecordingError(f"{path}: is {other}, not a table of text; export it as CSV.")
    return path.read_text(encoding="utf-8-sig", errors="replace").splitlines()


def regular_times(count: int, interval: float) -> Vector:
    """Times of samples at equal intervals, the first at 0."""
    return np.arange(count, dtype=np.float64) * interval


def refuse_partial(path: Path, positions: Vector, places: Sequence[str]) -> None:
    """Refuse rows in which some numbers are missing and others not."""
    missing = np.isnan(positions)
    partial = np.flatnonzero(missing.any(axis=1) & ~missing.all(axis=1))
    if partial.size:
        raise RecordingError(
            f"{path}, {places[partial[0]]}: position {positions[partial[0]]} is incomplete; "
            "leave x, y and z all empty where the marker was lost."
        )
