"""The netCDF file of a trajectory.

Depends on: coordinates.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr

from cablesim.trajectory.coordinates import with_material_indices

_SMALL = 1000  # numbers, below which there is nothing to gain


def write(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a trajectory to a netCDF-4 file, compressed.

    Raises
    ------
    OSError
        When the file cannot be written.
    """
    encoding = {str(name): _encoding(variable) for name, variable in dataset.variables.items()}
    for name in dataset.coords:  # no coordinate may be missing
        encoding[str(name)]["_FillValue"] = None
    dataset.to_netcdf(Path(path), engine="netcdf4", encoding=encoding)


def _encoding(variable: xr.Variable) -> dict[str, Any]:
    """How a variable is stored.

    Level 1 of zlib takes twice as much time as none and saves two thirds; levels 2 to 9 save 2 % more.
    Text is an array of characters: CF counts a variable of strings with the name of its dimension among
    the coordinates, which must be numbers.
    """
    if variable.dtype.kind in "OUS":
        return {"dtype": "S1"}
    return {"zlib": True, "complevel": 1, "shuffle": True} if variable.size > _SMALL else {}


def read(path: str | Path) -> xr.Dataset:
    """Read a trajectory written by `write`.

    Raises
    ------
    OSError
        When the file is missing or is not netCDF.
    """
    with xr.open_dataset(path, engine="netcdf4") as dataset:
        return with_material_indices(dataset.load())
