"""Read a current map in space and time from a netCDF file.

Depends on: case, recording, scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cablesim.case.errors import suggestion
from cablesim.case.models import MapCurrent
from cablesim.case.quantities import UnitError, length_factor, speed_factor, time_factor
from cablesim.recording.source import kind_of_binary
from cablesim.scene import GriddedCurrent, Vector


def read_current_map(file: Path, given: MapCurrent) -> GriddedCurrent:
    """Read a current on a grid; a coordinate that is not in the file means constant along it.

    Parameters
    ----------
    file : Path
        A netCDF file.
    given : MapCurrent
        Names of its coordinates and variables, as the case gives them.

    Returns
    -------
    GriddedCurrent
        Velocities [m/s] on increasing coordinates, z up; times count from the first one where the
        file gives dates.  Units attributes are honoured; without them numbers are SI.

    Raises
    ------
    ValueError
        If the file is no netCDF, a variable is missing, has other dimensions or units, or holds numbers
        that are not finite, or a coordinate named depth does not say which way it is positive.
    """
    import netCDF4

    try:
        data = netCDF4.Dataset(file)
    except OSError as error:
        kind = kind_of_binary(file) or "text"
        raise ValueError(f"is {kind}, not a netCDF file ({error}); convert it") from None
    with data:
        names = (given.time, given.x, given.y, given.z)
        axes = [_read_axis(data, name, is_time=name == given.time) for name in names]
        sizes = tuple(len(axis) for axis in axes)
        components = [
            np.zeros(sizes) if name is None else _read_component(data, name, names, sizes)
            for name in (given.u, given.v, given.w)
        ]
    velocities = np.stack(components, axis=-1)
    for number in range(4):
        order = np.argsort(axes[number], kind="stable")
        axes[number] = axes[number][order]
        velocities = np.take(velocities, order, axis=number)
        if (np.diff(axes[number]) <= 0).any():
            raise ValueError(f"the coordinate '{names[number]}' holds a value twice")
    time, x, y, z = axes
    return GriddedCurrent(times=time, x=x, y=y, z=z, velocities=np.ascontiguousarray(velocities))


def _read_axis(data: Any, name: str, *, is_time: bool) -> Vector:
    if name not in data.variables:
        if name in data.dimensions:
            raise ValueError(f"the dimension '{name}' has no coordinate of that name")
        return np.zeros(1)
    variable = data.variables[name]
    values: Vector = np.ma.filled(np.ma.asarray(variable[:], dtype=float), np.nan).reshape(-1)
    if not np.isfinite(values).all():
        raise ValueError(f"the coordinate '{name}' holds values that are not finite")
    unit, since, _ = str(getattr(variable, "units", "") or ("s" if is_time else "m")).partition(" since ")
    try:
        if is_time:
            return (values - values[0] if since else values) * time_factor(unit)
        return values * (_upward(variable, name) * length_factor(unit))
    except UnitError:
        what = "a time" if is_time else "a length; project it"
        raise ValueError(f"the coordinate '{name}' is in '{unit}', not in {what}") from None


def _upward(variable: Any, name: str) -> float:
    """-1 for a coordinate that counts downwards, as its attributes say."""
    positive = str(getattr(variable, "positive", "")).lower()
    if positive in ("up", "down"):
        return -1.0 if positive == "down" else 1.0
    if str(getattr(variable, "standard_name", "")).startswith("depth"):
        return -1.0
    if "depth" in name.lower():
        raise ValueError(
            f"the coordinate '{name}' does not say which way it is positive; give it the attribute "
            "'positive', 'up' or 'down'"
        )
    return 1.0


def _read_component(data: Any, name: str, names: Sequence[str], sizes: Sequence[int]) -> Vector:
    if name not in data.variables:
        raise ValueError(f"has no variable '{name}'; {suggestion(name, data.variables)}")
    variable = data.variables[name]
    other = [dimension for dimension in variable.dimensions if dimension not in names]
    if other:
        raise ValueError(f"the variable '{name}' has the unknown dimension '{other[0]}'")
    values: Vector = np.ma.filled(np.ma.asarray(variable[:], dtype=float), np.nan)
    if not np.isfinite(values).all():
        raise ValueError(f"the variable '{name}' is not finite everywhere; fill the gaps first")
    unit = str(getattr(variable, "units", "") or "m/s")
    try:
        values = values * speed_factor(unit)
    except UnitError:
        raise ValueError(f"the variable '{name}' is in '{unit}', not in a speed") from None
    order = [variable.dimensions.index(axis) for axis in names if axis in variable.dimensions]
    shape = [size if axis in variable.dimensions else 1 for axis, size in zip(names, sizes, strict=True)]
    return np.broadcast_to(values.transpose(order).reshape(shape), tuple(sizes))
