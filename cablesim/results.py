"""What every reader of a result asks of it: is it whole, what is missing, where along the cable a value is.

Depends on: nothing of ours; works on the dataset of a run.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PLACES = ("position", "velocity")
_UNITS = {"position": "m", "velocity": "m s-1", "tension": "N", "time": "s", "s": "m", "s_segment": "m"}


def missing_variable(dataset: xr.Dataset, name: str) -> str:
    """Say that a result lacks a variable, and how to get it."""
    if dataset.attrs.get("case") is None:
        return f"The file holds no `{name}`; is it a result of cablesim?"
    return f"The result holds no `{name}`: add it to output.variables in the case, or leave that list out."


def check_whole(dataset: xr.Dataset, error: type[Exception]) -> None:
    """Raise `error` unless a result holds times, and all of the cable at each of them.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, or what was selected from one.
    error : type
        What to raise; the message says what is missing.
    """
    if "time" not in dataset.dims or "time" not in dataset.coords or dataset.sizes["time"] == 0:
        raise error(
            "The file holds no times; is it a result of cablesim? Select times with a list, if at all."
        )
    if not np.isfinite(dataset["time"].values).all() or not (np.diff(dataset["time"].values) > 0).all():
        raise error("The times of the file do not rise from one to the next; is it a result of cablesim?")
    _check_values(dataset, error)
    nodes, segments = dataset.sizes.get("node"), dataset.sizes.get("segment")
    along_nodes = all("node" in dataset[name].dims for name in _PLACES if name in dataset)
    along_segments = "tension" not in dataset or "segment" in dataset["tension"].dims
    if not (along_nodes and along_segments) or (nodes and segments and nodes != segments + 1):
        counts = f"{nodes or 'one'} of its nodes and {segments or 'one'} of its segments"
        raise error(f"The file holds a part of a cable, {counts}. Select times of a result, not places.")
    if any(list(dataset[name]["axis"].values) != ["x", "y", "z"] for name in _PLACES if name in dataset):
        raise error("The file does not hold the axes x, y, z in this order. Select times of a result only.")
    if dataset["time"].dtype.kind not in "iuf":
        raise error("The times of the file are no plain numbers: give them in seconds, as runs do.")
    for dimension, places in (("node", "s"), ("segment", "s_segment")):
        if dimension in dataset.dims and places not in dataset:
            raise error(
                f"The file holds no `{places}`, the places along the cable; is it a result of cablesim?"
            )


def _check_values(dataset: xr.Dataset, error: type[Exception]) -> None:
    """Raise `error` where values are in another unit than results are, or infinite."""
    for name in (*_PLACES, "tension", "time", "s", "s_segment"):
        if name not in dataset:
            continue
        variable = dataset[name]
        unit = variable.attrs.get("units", _UNITS[name])
        if unit != _UNITS[name]:
            raise error(f"`{name}` is in {unit}: results are in {_UNITS[name]}.")
        values = variable.values
        if name in ("s", "s_segment") and not np.isfinite(values).all():
            raise error(f"`{name}` is not known for every place; is it a result of cablesim?")
        if np.isinf(values).any():
            raise error(f"`{name}` is infinite somewhere; is it a result of cablesim?")


def material_coordinates(dataset: xr.Dataset) -> Array:
    """Unstretched coordinates s of the nodes (time, node) [m].

    With a winch the last node is the outlet, so its coordinate is the deployed length; NaN where that
    was not kept.
    """
    s = np.tile(np.asarray(dataset["s"].values, dtype=float), (dataset.sizes["time"], 1))
    if "deployed_length" in dataset:
        s[:, -1] = dataset["deployed_length"].values
    elif any(_some_on_drum(dataset[name], "node") for name in _PLACES if name in dataset):
        s[:, -1] = np.nan
    return s


def segment_coordinates(dataset: xr.Dataset) -> Array:
    """Unstretched coordinates s of the middles of the segments (time, segment) [m].

    With a winch the last segment is the one that ends at the outlet; NaN where it cannot be told how
    long that is.
    """
    middles = np.tile(np.asarray(dataset["s_segment"].values, dtype=float), (dataset.sizes["time"], 1))
    if "deployed_length" in dataset:
        begins = _begin_of_last(dataset)
        middles[:, -1] = 0.5 * (begins + dataset["deployed_length"].values)
    elif "tension" in dataset and _some_on_drum(dataset["tension"], "segment"):
        middles[:, -1] = np.nan
    return middles


def _begin_of_last(dataset: xr.Dataset) -> Array:
    """Coordinate s (time,) at which the segment at the outlet begins, that of the last node before it."""
    s = np.asarray(dataset["s"].values, dtype=float)
    if "tension" in dataset:
        tension = dataset["tension"].transpose("time", "segment").values
        return s[np.isfinite(tension[:, :-1]).sum(axis=1)]
    if "position" in dataset:
        there = np.isfinite(dataset["position"].isel(axis=0).transpose("time", "node").values[:, :-1])
        return s[np.maximum(there.sum(axis=1) - 1, 0)]
    return s[np.maximum(np.searchsorted(s[:-1], dataset["deployed_length"].values) - 1, 0)]


def _some_on_drum(variable: xr.DataArray, dimension: str) -> bool:
    """Whether places are without a value while the last, which is at the winch, has one."""
    empty = variable.isnull()
    return bool((empty.any(dimension) & ~empty.isel({dimension: -1})).any())
