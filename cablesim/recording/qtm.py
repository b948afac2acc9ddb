"""Exports of Qualisys Track Manager (docs.qualisys.com, "Motion data (.tsv)").

Depends on: source, table.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cablesim.recording.source import RecordingError, Samples, Vector, nearest, regular_times, text_lines
from cablesim.recording.table import Table, column, is_number, number, value_columns

_UNIT = "mm"


def read_qtm(path: Path, marker: str | None, sample_interval: float | None) -> Samples:
    """Read the positions of one marker of an export."""
    header, table = _load_qtm(path)
    markers = [name.strip() for name in header.get("MARKER_NAMES", []) if name.strip()]
    if not markers or header.get("DATA_INCLUDED", ["3D"])[0] != "3D":
        raise RecordingError(
            f"{path}: no MARKER_NAMES, or data that are not 3D; export 3D trajectories with the TSV header."
        )
    index = _marker_index(path, markers, marker)
    leading = _leading_columns(path, table, len(markers))
    names = [f"column {i}" for i in range(leading)]
    names += [f"{name} {axis}" for name in markers for axis in "XYZ"]
    named = Table(path=path, names=names, rows=table.rows, lines=table.lines)
    axes = [f"{markers[index]} {axis}" for axis in "XYZ"]
    positions = value_columns(named, axes)
    positions[np.all(positions == 0.0, axis=1)] = np.nan
    times = _qtm_times(named, header, leading, sample_interval)
    places = [f"line {line}" for line in table.lines]
    return Samples(times=times, values=positions, places=places, units=(_UNIT,) * 3)


def _load_qtm(path: Path) -> tuple[dict[str, list[str]], Table]:
    """Header words with their values, and the rows of numbers."""
    header: dict[str, list[str]] = {}
    rows: list[list[str]] = []
    lines: list[int] = []
    for line, text in enumerate(text_lines(path), start=1):
        cells = [cell.strip() for cell in text.split("\t")]
        if rows or (not re.fullmatch(r"[A-Z][A-Z0-9_]*", cells[0]) and not _is_column_header(cells)):
            # a frame in which every marker was lost may be nothing but tabs
            if text:
                rows.append(cells)
                lines.append(line)
        elif not _is_column_header(cells):
            header.setdefault(cells[0], cells[1:])
    return header, Table(path=path, names=[], rows=rows, lines=lines)


def _is_column_header(cells: list[str]) -> bool:
    return cells[0] == "Frame" or cells[0].endswith(" X")


def _marker_index(path: Path, markers: list[str], marker: str | None) -> int:
    if marker is None and len(markers) == 1:
        return 0
    if marker not in markers:
        hint = nearest(marker, markers) if marker else "; name one of them"
        raise RecordingError(f"{path}: no marker {marker!r}; markers: {', '.join(markers)}{hint}.")
    return markers.index(marker)


def _leading_columns(path: Path, table: Table, markers: int) -> int:
    """Count the columns before the positions: 0, or 2 for frame and time; cut a trailing tab off."""
    if not table.rows:
        raise RecordingError(f"{path}: no frames after the header; export the file again.")
    width = len(table.rows[0])
    leading = 2 if width - 3 * markers in (2, 3) else 0
    expected = leading + 3 * markers
    for line, row in zip(table.lines, table.rows, strict=True):
        if len(row) < expected or any(row[expected:]):
            raise RecordingError(
                f"{path}, line {line}: {len(row)} cells for {markers} markers; expected {3 * markers}, "
                f"or {3 * markers + 2} with frame and time. Export the file again."
            )
        del row[expected:]
    return leading


def _qtm_times(
    table: Table, header: dict[str, list[str]], leading: int, sample_interval: float | None
) -> Vector:
    if sample_interval is None and leading:
        return column(table, table.names[1])
    frequency = header.get("FREQUENCY", [""])[0]
    if sample_interval is None and is_number(frequency) and number(frequency) > 0:
        sample_interval = 1.0 / number(frequency)
    if sample_interval is None:
        raise RecordingError(
            f"{table.path}: no time column and FREQUENCY is {frequency!r}; give sample_interval."
        )
    return regular_times(len(table.rows), sample_interval)
