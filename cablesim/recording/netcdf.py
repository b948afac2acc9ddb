"""Recordings in netCDF.

Depends on: source, table, case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cablesim.case.quantities import UnitError, time_factor
from cablesim.recording.source import RecordingError, Samples, Vector, nearest, refuse_partial, regular_times
from cablesim.recording.table import same

if TYPE_CHECKING:
    import xarray

# File, its data, names of variables -> values (k, d) and the dimension along which they are
_Extractor = Callable[[Path, "xarray.Dataset", Sequence[str]], tuple[Vector, str]]


def read_netcdf(
    path: Path,
    time_column: str | None,
    sample_interval: float | None,
    columns: Sequence[str],
    where: Mapping[str, Any],
    extract: _Extractor | None = None,
) -> Samples:
    """Read variables against time; `extract` picks them, by default positions."""
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
    refuse_partial(path, values, places)
    if sample_interval is not None:
        if time_column is not None:
            raise RecordingError(f"{path}: both time_column and sample_interval given; give one of them.")
        times = regular_times(len(values), sample_interval)
    else:
        times = _netcdf_times(path, dataset, time_column or dimension, dimension)
    said = [dataset[name].attrs.get("units") for name in columns]
    units = tuple(None if unit in (None, "") else str(unit) for unit in said)
    return Samples(times=times, values=values, places=places, units=units)


def _require_variable(path: Path, dataset: xarray.Dataset, name: str) -> None:
    names = [str(variable) for variable in dataset.variables]
    if name not in names:
        raise RecordingError(
            f"{path}: no variable {name!r}; variables: {', '.join(names)}{nearest(name, names)}."
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
        matching = [i for i, item in enumerate(found) if same(item, value)]
        if not matching:
            raise RecordingError(
                f"{path}: no {name} = {value!r}; found {', '.join(found[:8])}{nearest(str(value), found)}."
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


def netcdf_lengths(path: Path, dataset: xarray.Dataset, columns: Sequence[str]) -> tuple[Vector, str]:
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
    unit, since, _ = str(variable.attrs.get("units", "") or "s").partition(" since ")
    try:
        factor = time_factor(unit.strip())
    except UnitError:
        factor = None
    if variable.dims != (dimension,) or factor is None:
        raise RecordingError(
            f"{path}: {name!r} has dimensions {variable.dims} and unit {unit!r}; "
            f"times must be along {dimension!r} and in a unit of time."
        )
    times = _floats(path, variable) * factor
    if since and times.size:
        times -= times[0]
    if np.isnan(times).any():
        raise RecordingError(f"{path}, {name}[{int(np.argmax(np.isnan(times)))}]: not a number; correct it.")
    return times
