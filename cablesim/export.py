"""Results as plain tables (CSV) and as polylines for ParaView (VTK XML).

Depends on: results; works on the dataset of a run.
"""

from __future__ import annotations

import base64
from collections.abc import Hashable, Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cablesim.results import check_whole, material_coordinates, missing_variable, segment_coordinates

Array = NDArray[np.float64]

TABLES = {
    ("time",): "time",
    ("time", "node"): "nodes",
    ("time", "segment"): "segments",
    ("time", "end"): "ends",
    ("time", "attachment"): "attachments",
    ("time", "marker"): "markers",
}
"""Dimensions of a table, its `axis` spread over columns -> name of the file."""


class ExportError(ValueError):
    """A result holds nothing that can be exported; the message says what is missing."""


# CSV --------------------------------------------------------------------------------------------


def export_csv(dataset: xr.Dataset, directory: str | Path) -> list[Path]:
    """Write one table for each set of dimensions, one row for each time and place.

    ``nodes.csv`` has the columns ``time [s], node, s [m], position_x [m], ...``; likewise
    ``segments.csv``, ``ends.csv``, ``attachments.csv``, ``markers.csv``, and ``time.csv`` for what
    depends on time alone.  Numbers are written in full; a cell is empty where there is none.

    Parameters
    ----------
    dataset : Dataset
        Result of a run.
    directory : path
        Folder, made when it is not there.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ExportError
        If the result holds no table, or not the whole cable.
    OSError
        If a file cannot be written.
    """
    check_whole(dataset, ExportError)
    dataset = dataset.transpose("time", ...)
    directory = Path(directory)
    files = []
    for dimensions, name in TABLES.items():
        variables = [v for v in dataset.data_vars if _without_axis(dataset[v]) == dimensions]
        if not variables:
            continue
        directory.mkdir(exist_ok=True)
        file = directory / f"{name}.csv"
        table = {**_index_columns(dataset, dimensions), **_value_columns(dataset, variables)}
        _write_table(table, file)
        files.append(file)
    if not files:
        raise ExportError(missing_variable(dataset, "position"))
    return files


def _without_axis(variable: xr.DataArray) -> tuple[Hashable, ...]:
    return tuple(dimension for dimension in variable.dims if dimension != "axis")


_COORDINATES = {"s": material_coordinates, "s_segment": segment_coordinates}


def _index_columns(dataset: xr.Dataset, dimensions: tuple[str, ...]) -> dict[str, NDArray]:
    """Time, place by number or name, and its material coordinate, which changes at the outlet of a winch."""
    sizes = [dataset.sizes[dimension] for dimension in dimensions]
    columns = {}
    for number, dimension in enumerate(dimensions):
        named = dimension in dataset.coords
        values = dataset[dimension].values if named else np.arange(sizes[number])
        header = _header(dimension, dataset[dimension]) if named else dimension
        columns[header] = _spread(values, sizes, number)
        for name, coordinate in dataset.coords.items():
            if coordinate.dims == (dimension,) and name != dimension:
                moving = _COORDINATES.get(str(name))
                fixed = _spread(coordinate.values, sizes, number)
                columns[_header(str(name), coordinate)] = moving(dataset).ravel() if moving else fixed
    return columns


def _spread(values: NDArray, sizes: list[int], number: int) -> NDArray:
    """Repeat the values of one dimension over all rows of a table."""
    shape = [1] * len(sizes)
    shape[number] = sizes[number]
    return np.broadcast_to(values.reshape(shape), sizes).ravel()


def _value_columns(dataset: xr.Dataset, variables: list[Hashable]) -> dict[str, NDArray]:
    columns = {}
    for name in variables:
        variable = dataset[name]
        if "axis" not in variable.dims:
            columns[_header(str(name), variable)] = variable.values.ravel()
            continue
        for axis in dataset["axis"].values:
            columns[_header(f"{name}_{axis}", variable)] = variable.sel(axis=axis).values.ravel()
    return columns


def _header(name: str, variable: xr.DataArray) -> str:
    units = variable.attrs.get("units")
    return f"{name} [{units}]" if units else name


def _write_table(table: dict[str, NDArray], file: Path) -> None:
    frame = xr.Dataset({name: ("row", values) for name, values in table.items()}).to_dataframe()
    frame.to_csv(file, index=False, lineterminator="\n")


# VTK --------------------------------------------------------------------------------------------


def export_vtk(dataset: xr.Dataset, directory: str | Path, name: str = "cable") -> list[Path]:
    """Write a PolyData file for each time, and a collection that ParaView opens as an animation.

    A segment is a line of its own with its `tension` (cell data), a node a point with its `velocity`
    and material coordinate `s` (point data).  Nodes without a position (on the drum) are left out,
    and so are their segments.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`.
    directory : path
        Folder, made when it is not there.
    name : str
        Start of the file names: ``cable.pvd``, ``cable_0000.vtp``, ...

    Returns
    -------
    list of Path
        The collection, then the files it names.

    Raises
    ------
    ExportError
        If the result holds no positions, or not the whole cable.
    OSError
        If a file cannot be written.
    """
    check_whole(dataset, ExportError)
    if "position" not in dataset:
        raise ExportError(missing_variable(dataset, "position"))
    directory = Path(directory)
    directory.mkdir(exist_ok=True)
    digits = max(4, len(str(dataset.sizes["time"] - 1)))
    files = [directory / f"{name}_{index:0{digits}d}.vtp" for index in range(dataset.sizes["time"])]
    for file, text in zip(files, _polydata(dataset), strict=True):
        file.write_text(text, encoding="ascii")
    collection = directory / f"{name}.pvd"
    collection.write_text(_collection(dataset["time"].values, files), encoding="utf-8")
    return [collection, *files]


def _polydata(dataset: xr.Dataset) -> Iterator[str]:
    """One document for each time."""
    axes = ["x", "y", "z"]
    position = dataset["position"].sel(axis=axes).transpose("time", "node", "axis").values
    point_data = {n: dataset[n] for n in ("velocity",) if n in dataset}
    velocity = {n: v.sel(axis=axes).transpose("time", "node", "axis").values for n, v in point_data.items()}
    tension = {n: dataset[n].transpose("time", "segment").values for n in ("tension",) if n in dataset}
    s = material_coordinates(dataset)
    for index, places in enumerate(position):
        points = {name: values[index] for name, values in velocity.items()} | {"s": s[index]}
        yield _document(places, points, {name: values[index] for name, values in tension.items()})


def _document(places: Array, point_data: dict[str, Array], cell_data: dict[str, Array]) -> str:
    there: NDArray[np.bool_] = np.asarray(np.isfinite(places).all(axis=1))
    both = there[:-1] & there[1:]
    number = np.cumsum(there) - 1
    lines = np.stack([number[:-1], number[1:]], axis=1)[both]
    parts = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<PolyData>",
        f'<Piece NumberOfPoints="{there.sum()}" NumberOfVerts="0" NumberOfLines="{len(lines)}"'
        ' NumberOfStrips="0" NumberOfPolys="0">',
        "<PointData>",
        *(_data_array(name, values[there]) for name, values in point_data.items()),
        "</PointData>",
        "<CellData>",
        *(_data_array(name, values[both]) for name, values in cell_data.items()),
        "</CellData>",
        "<Points>",
        _data_array("Points", places[there]),
        "</Points>",
        "<Lines>",
        _data_array("connectivity", lines.ravel()),
        _data_array("offsets", 2 * np.arange(1, len(lines) + 1)),
        "</Lines>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>",
    ]
    return "\n".join(parts) + "\n"


def _data_array(name: str, values: NDArray) -> str:
    """Write a DataArray in VTK's inline binary form: size in bytes, then the bytes, in base64."""
    kind, code = ("Float64", "<f8") if values.dtype.kind == "f" else ("Int64", "<i8")
    raw = np.ascontiguousarray(values, dtype=code).tobytes()
    text = base64.b64encode(np.array([len(raw)], dtype="<u8").tobytes() + raw).decode("ascii")
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return f'<DataArray type="{kind}" Name="{name}"{components} format="binary">{text}</DataArray>'


def _collection(times: Array, files: list[Path]) -> str:
    entries = [
        f'<DataSet timestep="{float(time)!r}" group="" part="0" file={quoteattr(file.name)}/>'
        for time, file in zip(times, files, strict=True)
    ]
    head = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">',
        "<Collection>",
    ]
    return "\n".join([*head, *entries, "</Collection>", "</VTKFile>"]) + "\n"
