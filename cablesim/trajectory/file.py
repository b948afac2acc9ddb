"""The netCDF file of a trajectory.

Depends on: nothing of ours.
"""

from __future__ import annotations

from pathlib import Path

import xarray as xr


def write(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a trajectory to a netCDF-4 file.

    Raises
    ------
    OSError
        When the file cannot be written.
    """
    dataset.to_netcdf(path, engine="netcdf4")


def read(path: str | Path) -> xr.Dataset:
    """Read a trajectory written by `write`.

    Raises
    ------
    OSError
        When the file is missing or is not netCDF.
    """
    with xr.open_dataset(path, engine="netcdf4") as dataset:
        return dataset.load()
