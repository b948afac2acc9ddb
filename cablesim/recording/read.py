"""Read recorded positions and lengths against time, and markers along a cable.

Depends on: source, table, netcdf, qtm.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablesim.recording.netcdf import netcdf_lengths, read_netcdf
from cablesim.recording.qtm import read_qtm
from cablesim.recording.source import RecordingError, Samples, Vector, existing, file_format
from cablesim.recording.table import (
    column,
    length_units,
    load_table,
    pick,
    read_csv,
    require_three,
    value_columns,
)

_logger = logging.getLogger(__name__)


def read_recording(
    path: str | Path,
    *,
    format: str = "auto",
    time_column: str | None = None,
    sample_interval: float | None = None,
    columns: Sequence[str] = ("x", "y", "z"),
    where: Mapping[str, Any] | None = None,
    marker: str | None = None,
    unit_factor: float | None = None,
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
    unit_factor : float, optional
        What positions are multiplied with to become metres.  By default what the file says: units
        attributes in netCDF, units in brackets after the names of columns in CSV (``x [mm]``),
        millimetres in a QTM export; metres where it says nothing.

    Returns
    -------
    times : ndarray, shape (k,)
        Strictly increasing [s]; dates count from the first.
    positions : ndarray, shape (k, 3)
        Positions [m]; samples at which the marker was lost are left out.

    Raises
    ------
    RecordingError
        If the file, a column or the marker is not found, the times are not known or do not
        increase, a cell is not a finite number, the file says another unit than `unit_factor`, or fewer
        than two samples remain.
    """
    source = existing(path)
    kind = file_format(source, format)
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
        samples = read_qtm(source, marker, sample_interval)
    elif kind == "netcdf":
        samples = read_netcdf(source, time_column, sample_interval, columns, where or {})
    else:
        require_three(source, columns)
        samples = read_csv(source, time_column, sample_interval, columns, where or {})
    return _without_gaps(source, samples, unit_factor)


def read_lengths(
    path: str | Path,
    *,
    column: str,
    format: str = "auto",
    time_column: str | None = None,
    sample_interval: float | None = None,
    where: Mapping[str, Any] | None = None,
    unit_factor: float | None = None,
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
    source = existing(path)
    kind = file_format(source, format)
    if kind == "qtm":
        raise RecordingError(f"{source}: a QTM export holds positions, no lengths; give csv or netCDF.")
    if kind == "netcdf":
        samples = read_netcdf(
            source, time_column, sample_interval, (column,), where or {}, extract=netcdf_lengths
        )
    else:
        samples = read_csv(source, time_column, sample_interval, (column,), where or {})
    times, lengths = _without_gaps(source, samples, unit_factor)
    return times, lengths[:, 0]


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
    table = load_table(existing(path))
    return np.stack([column(table, name) for name in names], axis=1)


def read_markers(
    path: str | Path,
    *,
    arc_column: str,
    columns: Sequence[str] = ("x", "y", "z"),
    where: Mapping[str, Any] | None = None,
    unit_factor: float | None = None,
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
    unit_factor : float, optional
        What positions (not material coordinates) are multiplied with to become metres; by default what
        stands in brackets after the names of their columns, or 1.

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
    table = pick(load_table(existing(path)), where or {})
    require_three(table.path, columns)
    places = [f"line {line}" for line in table.lines]
    samples = Samples(
        times=np.zeros(len(places)),
        values=value_columns(table, columns),
        places=places,
        units=length_units(columns),
    )
    positions = samples.in_metres(table.path, unit_factor)
    seen = ~np.isnan(positions[:, 0])
    arc = column(table, arc_column)[seen]
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


def _without_gaps(path: Path, samples: Samples, unit_factor: float | None) -> tuple[Vector, Vector]:
    """Times [s] and values [m] without lost samples; check that what remains is a recording."""
    seen = ~np.isnan(samples.values[:, 0])
    kept = np.flatnonzero(seen)
    times, values = samples.times[seen], samples.in_metres(path, unit_factor)[seen]
    if times.size < 2:
        raise RecordingError(
            f"{path}: {times.size} of {seen.size} rows hold a position or length; a recording needs two "
            "at least, check `where`, `marker` and `columns`."
        )
    bad = np.flatnonzero(np.diff(times) <= 0)
    if bad.size:
        index = int(bad[0]) + 1
        raise RecordingError(
            f"{path}, {samples.places[kept[index]]}: time {times[index]:g} s comes after "
            f"{times[index - 1]:g} s; sort the rows, and pick one marker with `where`."
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
