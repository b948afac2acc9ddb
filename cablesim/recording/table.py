"""Tables of text: a line of names, then rows of numbers.

Depends on: source, case.
"""

from __future__ import annotations

import csv
import datetime
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cablesim.case.quantities import UnitError, length_factor, time_factor
from cablesim.recording.source import (
    RecordingError,
    Samples,
    Vector,
    nearest,
    refuse_partial,
    regular_times,
    text_lines,
)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of text with the number of the line each stands on."""

    path: Path
    names: list[str]
    rows: list[list[str]]
    lines: list[int]


def read_csv(
    path: Path,
    time_column: str | None,
    sample_interval: float | None,
    columns: Sequence[str],
    where: Mapping[str, Any],
) -> Samples:
    """Read columns of a table against time."""
    table = pick(load_table(path), where)
    if (time_column is None) == (sample_interval is None):
        given = "neither" if time_column is None else "both"
        raise RecordingError(
            f"{path}: {given} of time_column and sample_interval given; name the column of the times "
            f"(columns: {', '.join(table.names)}), or give the time between samples of a file without."
        )
    values = value_columns(table, columns)
    if time_column is not None:
        times = _times(table, time_column)
    else:
        times = regular_times(len(table.rows), sample_interval or 0.0)
    places = [f"line {line}" for line in table.lines]
    return Samples(times=times, values=values, places=places, units=length_units(columns))


def length_units(names: Sequence[str]) -> tuple[str | None, ...]:
    """Units of length that stand in brackets in the names of columns, ``x [mm]``."""
    return tuple(_unit_in(name, length_factor) for name in names)


def _unit_in(name: str, factor_of: Callable[[str], float]) -> str | None:
    """Unit in the brackets at the end of a name; ``None`` where something else stands there."""
    found = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    if found is None:
        return None
    try:
        factor_of(found[1])
    except UnitError:
        return None
    return found[1]


def _times(table: Table, name: str) -> Vector:
    """Times [s] of the rows; dates count from the first."""
    cells = [row[_index(table, name)] for row in table.rows]
    if cells and not is_number(cells[0]) and _date(cells[0]) is not None:
        dates = _dates(table, name, cells)
        return np.array([(date - dates[0]).total_seconds() for date in dates])
    unit = _unit_in(name, time_factor)
    return column(table, name) * (1.0 if unit is None else time_factor(unit))


def _dates(table: Table, name: str, cells: list[str]) -> list[datetime.datetime]:
    dates = []
    for cell, line in zip(cells, table.lines, strict=True):
        date = _date(cell)
        if date is None:
            raise RecordingError(
                f"{table.path}, line {line}, column {name!r}: {cell!r} is not a date as in the rows above; "
                "correct it."
            )
        dates.append(date)
    return dates


def _date(cell: str) -> datetime.datetime | None:
    """Read a date and time of ISO 8601; without a zone it is UTC."""
    try:
        date = datetime.datetime.fromisoformat(cell)
    except ValueError:
        return None
    return date if date.tzinfo else date.replace(tzinfo=datetime.UTC)


def load_table(path: Path) -> Table:
    """Read names and rows; the names may stand in a comment line, as numpy.savetxt writes them."""
    texts = [(number, text) for number, text in enumerate(text_lines(path), start=1) if text.strip()]
    comments = [text for _, text in texts if text.startswith("#")]
    texts = [(number, text) for number, text in texts if not text.startswith("#")]
    if not texts:
        raise RecordingError(f"{path}: no rows; give a file with a line of names and rows of numbers.")
    header = texts[0][1].lstrip("% ")
    if all(is_number(cell) for cell in _split(header, _delimiter(header))):
        if not comments:
            raise RecordingError(
                f"{path}, line {texts[0][0]}: numbers where the names of the columns should be "
                f"({header.strip()!r}); add a first line with the names, such as 'x y z'."
            )
        header = comments[-1].lstrip("# ")
    else:
        texts = texts[1:]
    delimiter = _delimiter(header)
    names = _split(header, delimiter)
    rows = [_row(path, number, _split(text, delimiter), names) for number, text in texts]
    return Table(path=path, names=names, rows=rows, lines=[number for number, _ in texts])


def _delimiter(header: str) -> str | None:
    """Return the separator of a line of names; ``None`` is any amount of white space."""
    return next((candidate for candidate in "\t;," if candidate in header), None)


def _split(text: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return text.split()
    return [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter))]


def _row(path: Path, line: int, cells: list[str], names: list[str]) -> list[str]:
    if len(cells) < len(names) or any(cells[len(names) :]):
        raise RecordingError(
            f"{path}, line {line}: {len(cells)} cells under {len(names)} names ({', '.join(names)}); "
            "leave the cells of a lost marker empty but keep their separators."
        )
    return cells[: len(names)]


def is_number(cell: str) -> bool:
    """Whether a cell holds a number."""
    try:
        number(cell)
    except ValueError:
        return False
    return True


def number(cell: str) -> float:
    """Read a number, with a point or a comma."""
    if cell.count(",") == 1 and "." not in cell:
        cell = cell.replace(",", ".")  # a comma left in a cell is a decimal comma
    return float(cell)


def _index(table: Table, name: str) -> int:
    if name not in table.names:
        raise RecordingError(
            f"{table.path}: no column {name!r}; columns: {', '.join(table.names)}"
            f"{nearest(name, table.names)}."
        )
    return table.names.index(name)


def pick(table: Table, where: Mapping[str, Any]) -> Table:
    """Keep the rows whose cells equal the values of `where`."""
    kept = list(range(len(table.rows)))
    for name, value in where.items():
        column = _index(table, name)
        matching = [i for i in kept if same(table.rows[i][column], value)]
        if not matching:
            found = sorted({table.rows[i][column] for i in kept})
            shown = ", ".join(found[:8]) + (", ..." if len(found) > 8 else "")
            raise RecordingError(
                f"{table.path}: no row with {name} = {value!r}; found {shown}{nearest(str(value), found)}."
            )
        kept = matching
    return Table(
        path=table.path,
        names=table.names,
        rows=[table.rows[i] for i in kept],
        lines=[table.lines[i] for i in kept],
    )


def same(cell: str, value: Any) -> bool:
    """Whether a cell holds `value`, compared as numbers if both are."""
    if is_number(cell) and is_number(str(value)):
        return math.isclose(number(cell), number(str(value)), rel_tol=1e-9, abs_tol=1e-12)
    return cell == str(value)


def column(table: Table, name: str, empty: float | None = None) -> Vector:
    """Convert a column to numbers; an empty cell becomes `empty`, or is refused."""
    index = _index(table, name)
    values = np.empty(len(table.rows))
    for i, row in enumerate(table.rows):
        if row[index] == "" and empty is not None:
            values[i] = empty
            continue
        values[i] = number(row[index]) if is_number(row[index]) else math.nan
        if not math.isfinite(values[i]):
            raise RecordingError(
                f"{table.path}, line {table.lines[i]}, column {name!r}: {row[index]!r} is not a finite "
                "number; correct it, or leave the cells empty where nothing was measured."
            )
    return values


def require_three(path: Path, columns: Sequence[str]) -> None:
    """Refuse names of columns that are not those of x, y and z."""
    if isinstance(columns, str) or len(columns) != 3:
        raise RecordingError(f"{path}: columns is {columns!r}; give the names of x, y and z.")


def value_columns(table: Table, columns: Sequence[str]) -> Vector:
    """Values (k, number of columns), NaN in the whole row where its cells are empty."""
    values = np.stack([column(table, name, empty=math.nan) for name in columns], axis=1)
    refuse_partial(table.path, values, [f"line {line}" for line in table.lines])
    return values
