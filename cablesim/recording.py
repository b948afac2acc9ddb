"""Read recorded positions and lengths from CSV, netCDF or a Qualisys QTM export.

Depends on: nothing of ours.

A marker that was lost (empty cells in CSV, fill values in netCDF, empty or 0 0 0 in a QTM export)
leaves a gap in time, which is logged.
Anything else that is not a finite number is refused, with its place in the file.
"""

from __future__ import annotations

import csv
import difflib
import logging
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray

Vector = NDArray[np.float64]

FORMATS = ("auto", "csv", "netcdf", "qtm")

_MILLIMETRE = 1e-3  # unit of QTM exports
_NETCDF_STARTS = (b"CDF", b"\x89HDF")
_SECONDS = {"", "s", "sec", "second", "seconds"}

_logger = logging.getLogger(__name__)

# File, its data, names of variables -> values (k, d) and the dimension along which they are
_Extractor = Callable[[Path, "xarray.Dataset", Sequence[str]], tuple[Vector, str]]


class RecordingError(ValueError):
    """A recording that cannot be read: says the file, the place, what stands there and what to do."""


@dataclass(frozen=True, kw_only=True)
class _Table:
    """Rows of text with the number of the line each stands on."""

    path: Path
    names: list[str]
    rows: list[list[str]]
    lines: list[int]


def read_recording(
    path: str | Path,
    *,
    format: str = "auto",
    time_column: str | None = None,
    sample_interval: float | None = None,
    columns: Sequence[str] = ("x", "y", "z"),
    where: Mapping[str, Any] | None = None,
    marker: str | None = None,
    unit_factor: float = 1.0,
) -> tuple[Vector, Vector]:
    """Read the positions of one point against time.

    Parameters
    ----------
    path : str or Path
        The file.
    format : {'auto', 'csv', 'netcdf', 'qtm'}
        ``auto`` looks into the file.  ``csv`` is a table with a line of names at its top, separated
        by tabs, semicolons, commas or spaces; ``qtm`` is a TSV motion export of Qualisys Track Manager.
    time_column : str, optional
        Name of the times [s].  netCDF: by default the coordinate along the positions.
    sample_interval : float, optional
        Time between samples [s], the first at 0, for a file without times.  QTM: overrides the file.
    columns : sequence of str
        Names of x, y and z.  netCDF: or one name, of a variable that has a dimension of length 3.
    where : mapping, optional
        Values that named columns (netCDF: coordinates) must have, to pick rows; not for QTM.
    marker : str, optional
        Name of the marker in a QTM export; not needed when there is only one.
    unit_factor : float
        What positions are multiplied with to become metres.  A QTM export is in millimetres, which
        is already taken care of.

    Returns
    -------
    times : ndarray, shape (k,)
        Strictly increasing [s].
    positions : ndarray, shape (k, 3)
        Positions [m]; samples at which the marker was lost are left out.

    Raises
    ------
    RecordingError
        If the file, a column or the marker is not found, the times are not known or do not
        increase, a cell is not a finite number, or fewer than two samples remain.
    """
    source = _existing(path)
    kind = _format(source, format)
    if sample_interval is not None and not (math.isfinite(sample_interval) and sample_interval > 0):
        raise RecordingError(f"{source}: sample_interval is {sample_interval!r} s; give a positive time.")
    if marker is not None and kind != "qtm":
        raise RecordingError(
            f"{source}: marker {marker!r} is for QTM exports, this is {kind}; pick rows with `where`."
        )
    if kind == "qtm":
        if where or time_column:
            raise RecordingError(
                f"{source}: `where` and `time_column` have no meaning in a QTM export; use `marker`."
            )
        times, positions, places = _read_qtm(source, marker, sample_interval)
    elif kind == "netcdf":
        times, positions, places = _read_netcdf(source, time_column, sample_interval, columns, where or {})
    else:
        _require_three(source, columns)
        times, positions, places = _read_csv(source, time_column, sample_interval, columns, where or {})
    return _without_gaps(source, times, positions * unit_factor, places)


def read_lengths(
    path: str | Path,
    *,
    column: str,
    format: str = "auto",
    time_column: str | None = None,
    sample_interval: float | None = None,
    where: Mapping[str, Any] | None = None,
    unit_factor: float = 1.0,
) -> tuple[Vector, Vector]:
    """Read one length, such as the deployed length of a winch, against time.

    Parameters
    ----------
    path : str or Path
        The file.
    column : str
        Name of the column or variable with the length.
    format, time_column, sample_interval, where, unit_factor
        As of `read_recording`; a QTM export holds positions only.

    Returns
    -------
    times : ndarray, shape (k,)
        Strictly increasing [s].
    lengths : ndarray, shape (k,)
        Lengths [m]; rows without one are left out.

    Raises
    ------
    RecordingError
        As `read_recording`.
    """
    source = _existing(path)
    kind = _format(source, format)
    if kind == "qtm":
        raise RecordingError(f"{source}: a QTM export holds positions, no lengths; give csv or netCDF.")
    if kind == "netcdf":
        values = _read_netcdf(
            source, time_column, sample_interval, (column,), where or {}, extract=_netcdf_lengths
        )
    else:
        values = _read_csv(source, time_column, sample_interval, (column,), where or {})
    times, lengths = _without_gaps(source, *values)
    return times, lengths[:, 0] * unit_factor


def read_columns(path: str | Path, names: Sequence[str]) -> Vector:
    """Read columns of numbers from a CSV file with a line of names at its top.

    Parameters
    ----------
    path : str or Path
        The file.
    names : sequence of str
        Names of the columns.

    Returns
    -------
    ndarray, shape (k, len(names))
        The numbers, one row for each line, in the file's units.

    Raises
    ------
    RecordingError
        If the file or a column is not found, or a cell is not a finite number.
    """
    table = _load_table(_existing(path))
    return np.stack([_column(table, name) for name in names], axis=1)


def read_markers(
    path: str | Path,
    *,
    arc_column: str,
    columns: Sequence[str] = ("x", "y", "z"),
    where: Mapping[str, Any] | None = None,
    unit_factor: float = 1.0,
) -> tuple[Vector, Vector]:
    """Read the positions of markers along a cable, from a CSV file with a row for each marker.

    Parameters
    ----------
    path : str or Path
        The file: a table with a line of names at its top.
    arc_column : str
        Name of the material coordinates [m].
    columns : sequence of str
        Names of x, y and z.
    where : mapping, optional
        Values that named columns must have, such as ``{"frame": 3}``.
    unit_factor : float
        What positions (not material coordinates) are multiplied with to become metres.

    Returns
    -------
    arc : ndarray, shape (k,)
        Strictly increasing material coordinates [m].
    positions : ndarray, shape (k, 3)
        Positions [m]; markers with empty cells are left out.

    Raises
    ------
    RecordingError
        If the file or a column is not found, a cell is not a finite number, a material coordinate
        occurs twice, or fewer than two markers remain.
    """
    table = _pick(_load_table(_existing(path)), where or {})
    _require_three(table.path, columns)
    positions = _value_columns(table, columns) * unit_factor
    seen = ~np.isnan(positions[:, 0])
    arc = _column(table, arc_column)[seen]
    positions = positions[seen]
    if arc.size < 2:
        raise RecordingError(
            f"{table.path}: found {arc.size} markers with a position; a shape needs two, check `where`."
        )
    order = np.argsort(arc, kind="stable")
    arc, positions = arc[order], positions[order]
    repeated = np.flatnonzero(np.diff(arc) == 0)
    if repeated.size:
        line = np.asarray(table.lines)[seen][order][repeated[0] + 1]
        raise RecordingError(
            f"{table.path}, line {line}: {arc_column} = {arc[repeated[0]]:g} occurs twice; "
            "pick one moment with `where`."
        )
    return arc, positions


def rotate_to_vertical(positions: ArrayLike, up: ArrayLike) -> Vector:
    """Turn measured positions by the smallest rotation that makes the direction `up` vertical.

    Parameters
    ----------
    positions : array_like, shape (k, 3) or (3,)
        Positions in the frame of the measurement [m].
    up : array_like, shape (3,)
        Direction measured to point upwards in that frame, of any length; it becomes +z.

    Returns
    -------
    ndarray, shape of `positions`
        Positions [m] turned about the origin of the measured frame.

    Raises
    ------
    RecordingError
        If `up` is not three finite numbers or is zero.
    """
    from scipy.spatial.transform import Rotation

    direction = np.asarray(up, dtype=np.float64)
    length = float(np.linalg.norm(direction))
    if direction.shape != (3,) or not math.isfinite(length) or length == 0:
        raise RecordingError(f"rotate_to_vertical: up is {up!r}; give three numbers, not all zero.")
    axis: Vector = np.cross(direction, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    # upside down: every horizontal axis is as good
    axis = axis / sine if sine > 0 else np.array([1.0, 0.0, 0.0])
    rotation = Rotation.from_rotvec(axis * math.atan2(sine, direction[2]))
    return np.asarray(rotation.apply(np.asarray(positions, dtype=np.float64)), dtype=np.float64)


def _existing(path: str | Path) -> Path:
    source = Path(path)
    if source.is_file():
        return source
    siblings = [entry.name for entry in source.parent.iterdir()] if source.parent.is_dir() else []
    raise RecordingError(
        f"{source}: no such file (looked in {source.parent.resolve()}){_nearest(source.name, siblings)}."
    )


def _format(path: Path, name: str) -> str:
    if name not in FORMATS:
        raise RecordingError(f"{path}: format {name!r} is unknown; choose one of {', '.join(FORMATS)}.")
    if name != "auto":
        return name
    with path.open("rb") as file:
        start = file.read(64)
    if start.startswith(_NETCDF_STARTS):
        return "netcdf"
    text = start.decode("utf-8-sig", errors="replace")
    return "qtm" if text.startswith(("NO_OF_FRAMES", "FILE_VERSION")) else "csv"


def _nearest(name: str, candidates: Iterable[str]) -> str:
    """Half a sentence that proposes the most similar name, or nothing."""
    lowered = {candidate.lower(): candidate for candidate in candidates}
    found = difflib.get_close_matches(name.lower(), lowered, n=1)
    return f"; did you mean {lowered[found[0]]!r}?" if found else ""


def _text_lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8-sig", errors="replace").splitlines()


def _regular_times(count: int, interval: float) -> Vector:
    return np.arange(count, dtype=np.float64) * interval


# --- CSV


def _read_csv(
    path: Path,
    time_column: str | None,
    sample_interval: float | None,
    columns: Sequence[str],
    where: Mapping[str, Any],
) -> tuple[Vector, Vector, list[str]]:
    table = _pick(_load_table(path), where)
    if (time_column is None) == (sample_interval is None):
        given = "neither" if time_column is None else "both"
        raise RecordingError(
            f"{path}: {given} of time_column and sample_interval given; name the column of the times "
            f"(columns: {', '.join(table.names)}), or give the time between samples of a file without."
        )
    values = _value_columns(table, columns)
    if time_column is not None:
        times = _column(table, time_column)
    else:
        times = _regular_times(len(table.rows), sample_interval or 0.0)
    return times, values, [f"line {line}" for line in table.lines]


def _load_table(path: Path) -> _Table:
    """Read names and rows; the names may stand in a comment line, as numpy.savetxt writes them."""
    texts = [(number, text) for number, text in enumerate(_text_lines(path), start=1) if text.strip()]
    comments = [text for _, text in texts if text.startswith("#")]
    texts = [(number, text) for number, text in texts if not text.startswith("#")]
    if not texts:
        raise RecordingError(f"{path}: no rows; give a file with a line of names and rows of numbers.")
    header = texts[0][1].lstrip("% ")
    if all(_is_number(cell) for cell in _split(header, _delimiter(header))):
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
    return _Table(path=path, names=names, rows=rows, lines=[number for number, _ in texts])


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


def _is_number(cell: str) -> bool:
    try:
        _number(cell)
    except ValueError:
        return False
    return True


def _number(cell: str) -> float:
    if cell.count(",") == 1 and "." not in cell:
        cell = cell.replace(",", ".")  # a comma left in a cell is a decimal comma
    return float(cell)


def _index(table: _Table, name: str) -> int:
    if name not in table.names:
        raise RecordingError(
            f"{table.path}: no column {name!r}; columns: {', '.join(table.names)}"
            f"{_nearest(name, table.names)}."
        )
    return table.names.index(name)


def _pick(table: _Table, where: Mapping[str, Any]) -> _Table:
    """Keep the rows whose cells equal the values of `where`."""
    kept = list(range(len(table.rows)))
    for name, value in where.items():
        column = _index(table, name)
        matching = [i for i in kept if _same(table.rows[i][column], value)]
        if not matching:
            found = sorted({table.rows[i][column] for i in kept})
            shown = ", ".join(found[:8]) + (", ..." if len(found) > 8 else "")
            raise RecordingError(
                f"{table.path}: no row with {name} = {value!r}; found {shown}{_nearest(str(value), found)}."
            )
        kept = matching
    return _Table(
        path=table.path,
        names=table.names,
        rows=[table.rows[i] for i in kept],
        lines=[table.lines[i] for i in kept],
    )


def _same(cell: str, value: Any) -> bool:
    """Whether a cell holds `value`, compared as numbers if both are."""
    if _is_number(cell) and _is_number(str(value)):
        return math.isclose(_number(cell), _number(str(value)), rel_tol=1e-9, abs_tol=1e-12)
    return cell == str(value)


def _column(table: _Table, name: str, empty: float | None = None) -> Vector:
    """Convert a column to numbers; an empty cell becomes `empty`, or is refused."""
    index = _index(table, name)
    values = np.empty(len(table.rows))
    for i, row in enumerate(table.rows):
        if row[index] == "" and empty is not None:
            values[i] = empty
            continue
        values[i] = _number(row[index]) if _is_number(row[index]) else math.nan
        if not math.isfinite(values[i]):
            raise RecordingError(
                f"{table.path}, line {table.lines[i]}, column {name!r}: {row[index]!r} is not a finite "
                "number; correct it, or leave the cells empty where nothing was measured."
            )
    return values


def _require_three(path: Path, columns: Sequence[str]) -> None:
    if isinstance(columns, str) or len(columns) != 3:
        raise RecordingError(f"{path}: columns is {columns!r}; give the names of x, y and z.")


def _value_columns(table: _Table, columns: Sequence[str]) -> Vector:
    """Values (k, number of columns), NaN in the whole row where its cells are empty."""
    values = np.stack([_column(table, name, empty=math.nan) for name in columns], axis=1)
    _refuse_partial(table.path, values, [f"line {line}" for line in table.lines])
    return values


def _refuse_partial(path: Path, positions: Vector, places: Sequence[str]) -> None:
    missing = np.isnan(positions)
    partial = np.flatnonzero(missing.any(axis=1) & ~missing.all(axis=1))
    if partial.size:
        raise RecordingError(
            f"{path}, {places[partial[0]]}: position {positions[partial[0]]} is incomplete; "
            "leave x, y and z all empty where the marker was lost."
        )


def _without_gaps(path: Path, times: Vector, values: Vector, places: Sequence[str]) -> tuple[Vector, Vector]:
    """Leave out lost samples and check that what remains is a recording."""
    seen = ~np.isnan(values[:, 0])
    kept = np.flatnonzero(seen)
    times, values = times[seen], values[seen]
    if times.size < 2:
        raise RecordingError(
            f"{path}: {times.size} of {seen.size} rows hold a position or length; a recording needs two "
            "at least, check `where`, `marker` and `columns`."
        )
    bad = np.flatnonzero(np.diff(times) <= 0)
    if bad.size:
        index = int(bad[0]) + 1
        raise RecordingError(
            f"{path}, {places[kept[index]]}: time {times[index]:g} s comes after {times[index - 1]:g} s; "
            "sort the rows, and pick one marker with `where` if the file holds several."
        )
    if kept.size < seen.size:
        _logger.warning(
            "%s: measurement lost in %d of %d samples, longest gap %.3g s",
            path,
            seen.size - kept.size,
            seen.size,
            float(np.diff(times).max()),
        )
    return times, values


# --- netCDF


def _read_netcdf(
    path: Path,
    time_column: str | None,
    sample_interval: float | None,
    columns: Sequence[str],
    where: Mapping[str, Any],
    extract: _Extractor | None = None,
) -> tuple[Vector, Vector, list[str]]:
    import xarray

    if isinstance(columns, str):
        columns = (columns,)
    try:
        with xarray.open_dataset(path, decode_times=False) as opened:
            for name in (*columns, *where, *([] if time_column is None else [time_column])):
                _require_variable(path, opened, name)
            dataset = _select(path, opened, where).load()
    except (OSError, ValueError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path}: not a readable netCDF file ({error}); check `format`.") from error
    values, dimension = (extract or _netcdf_positions)(path, dataset, columns)
    places = [f"{dimension}[{i}]" for i in range(len(values))]
    _refuse_partial(path, values, places)
    if sample_interval is not None:
        if time_column is not None:
            raise RecordingError(f"{path}: both time_column and sample_interval given; give one of them.")
        return _regular_times(len(values), sample_interval), values, places
    return _netcdf_times(path, dataset, time_column or dimension, dimension), values, places


def _require_variable(path: Path, dataset: xarray.Dataset, name: str) -> None:
    names = [str(variable) for variable in dataset.variables]
    if name not in names:
        raise RecordingError(
            f"{path}: no variable {name!r}; variables: {', '.join(names)}{_nearest(name, names)}."
        )


def _select(path: Path, dataset: xarray.Dataset, where: Mapping[str, Any]) -> xarray.Dataset:
    """Keep the places where one-dimensional variables equal the values of `where`."""
    for name, value in where.items():
        variable = dataset[name]
        if variable.ndim != 1:
            raise RecordingError(
                f"{path}: `where` {name!r} has dimensions {variable.dims}; name one with a single dimension."
            )
        found = [str(item) for item in variable.values]
        matching = [i for i, item in enumerate(found) if _same(item, value)]
        if not matching:
            raise RecordingError(
                f"{path}: no {name} = {value!r}; found {', '.join(found[:8])}{_nearest(str(value), found)}."
            )
        single = len(matching) == 1
        dataset = dataset.isel({variable.dims[0]: matching[0] if single else matching})
    return dataset


def _netcdf_positions(path: Path, dataset: xarray.Dataset, columns: Sequence[str]) -> tuple[Vector, str]:
    """Positions (k, 3) and the name of the dimension along which they are."""
    if len(columns) == 1:
        variable = dataset[columns[0]]
        axes = [dimension for dimension in variable.dims if dataset.sizes[dimension] == 3]
        if variable.ndim != 2 or not axes:
            raise RecordingError(
                f"{path}: {columns[0]!r} has dimensions {dict(variable.sizes)}; a position needs one of "
                "length 3 and one along time, pick from the others with `where`."
            )
        variable = variable.transpose(..., axes[-1])
        return _floats(path, variable), str(variable.dims[0])
    if len(columns) != 3:
        raise RecordingError(f"{path}: columns is {columns!r}; give the names of x, y and z, or one name.")
    parts = [dataset[name] for name in columns]
    if parts[0].ndim != 1 or any(part.dims != parts[0].dims for part in parts):
        raise RecordingError(
            f"{path}: {', '.join(columns)} have dimensions {[part.dims for part in parts]}; "
            "they need one and the same, pick from the others with `where`."
        )
    return np.stack([_floats(path, part) for part in parts], axis=1), str(parts[0].dims[0])


def _netcdf_lengths(path: Path, dataset: xarray.Dataset, columns: Sequence[str]) -> tuple[Vector, str]:
    """Lengths (k, 1) and the name of the dimension along which they are."""
    variable = dataset[columns[0]]
    if variable.ndim != 1:
        raise RecordingError(
            f"{path}: {columns[0]!r} has dimensions {dict(variable.sizes)}; a length needs one alone, "
            "pick from the others with `where`."
        )
    return _floats(path, variable)[:, None], str(variable.dims[0])


def _floats(path: Path, variable: xarray.DataArray) -> Vector:
    if variable.dtype.kind not in "iuf":
        raise RecordingError(f"{path}: variable {variable.name!r} is of type {variable.dtype}; give numbers.")
    values = np.asarray(variable.values, dtype=np.float64)
    if np.isinf(values).any():
        raise RecordingError(
            f"{path}, {variable.name}{list(map(int, np.argwhere(np.isinf(values))[0]))}: infinite; "
            "mark lost samples with the fill value."
        )
    return values


def _netcdf_times(path: Path, dataset: xarray.Dataset, name: str, dimension: str) -> Vector:
    if name not in dataset.variables:
        raise RecordingError(
            f"{path}: dimension {name!r} has no coordinate; give time_column or sample_interval."
        )
    variable = dataset[name]
    unit = str(variable.attrs.get("units", "")).split(" since ")[0].strip()
    if variable.dims != (dimension,) or unit not in _SECONDS:
        raise RecordingError(
            f"{path}: {name!r} has dimensions {variable.dims} and unit {unit!r}; "
            f"times must be along {dimension!r} and in seconds."
        )
    times = _floats(path, variable)
    if np.isnan(times).any():
        raise RecordingError(f"{path}, {name}[{int(np.argmax(np.isnan(times)))}]: not a number; correct it.")
    return times


# --- Qualisys Track Manager (docs.qualisys.com, "Motion data (.tsv)")


def _read_qtm(
    path: Path, marker: str | None, sample_interval: float | None
) -> tuple[Vector, Vector, list[str]]:
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
    named = _Table(path=path, names=names, rows=table.rows, lines=table.lines)
    axes = [f"{markers[index]} {axis}" for axis in "XYZ"]
    positions = _value_columns(named, axes)
    positions[np.all(positions == 0.0, axis=1)] = np.nan
    times = _qtm_times(named, header, leading, sample_interval)
    return times, positions * _MILLIMETRE, [f"line {line}" for line in table.lines]


def _load_qtm(path: Path) -> tuple[dict[str, list[str]], _Table]:
    """Header words with their values, and the rows of numbers."""
    header: dict[str, list[str]] = {}
    rows: list[list[str]] = []
    lines: list[int] = []
    for number, text in enumerate(_text_lines(path), start=1):
        cells = [cell.strip() for cell in text.split("\t")]
        if rows or (not re.fullmatch(r"[A-Z][A-Z0-9_]*", cells[0]) and not _is_column_header(cells)):
            # a frame in which every marker was lost may be nothing but tabs
            if text:
                rows.append(cells)
                lines.append(number)
        elif not _is_column_header(cells):
            header.setdefault(cells[0], cells[1:])
    return header, _Table(path=path, names=[], rows=rows, lines=lines)


def _is_column_header(cells: list[str]) -> bool:
    return cells[0] == "Frame" or cells[0].endswith(" X")


def _marker_index(path: Path, markers: list[str], marker: str | None) -> int:
    if marker is None and len(markers) == 1:
        return 0
    if marker not in markers:
        hint = _nearest(marker, markers) if marker else "; name one of them"
        raise RecordingError(f"{path}: no marker {marker!r}; markers: {', '.join(markers)}{hint}.")
    return markers.index(marker)


def _leading_columns(path: Path, table: _Table, markers: int) -> int:
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
    table: _Table, header: dict[str, list[str]], leading: int, sample_interval: float | None
) -> Vector:
    if sample_interval is None and leading:
        return _column(table, table.names[1])
    frequency = header.get("FREQUENCY", [""])[0]
    if sample_interval is None and _is_number(frequency) and _number(frequency) > 0:
        sample_interval = 1.0 / _number(frequency)
    if sample_interval is None:
        raise RecordingError(
            f"{table.path}: no time column and FREQUENCY is {frequency!r}; give sample_interval."
        )
    return _regular_times(len(table.rows), sample_interval)
