"""What estimates are compared with: places, tangents, distances, curvature and forces in the run itself.

Depends on: export (for a message), imu, interpolation, problems, rotations.

All return labelled arrays over the wanted times, as the estimators do.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.results import missing_variable
from cablesim.sensors.imu import AXES
from cablesim.sensors.interpolation import follow_points, linear_along, locate, quintic, read_nodes
from cablesim.sensors.problems import SensorError
from cablesim.sensors.rotations import direction

Array = NDArray[np.float64]


def places(dataset: xr.Dataset, s: ArrayLike, times: ArrayLike) -> xr.DataArray:
    """Positions (time, point, axis) of material points at any times of a run [m]; NaN on the drum."""
    nodes = read_nodes(dataset)
    place = quintic(locate(nodes.times, times), *follow_points(nodes, s).place)
    return _of_points(np.moveaxis(place, 0, -1), s, times, "m", "position")


def tangents(dataset: xr.Dataset, s: ArrayLike, times: ArrayLike) -> xr.DataArray:
    """Unit tangents (time, point, axis) at material points at any times of a run."""
    nodes = read_nodes(dataset)
    gradient = quintic(locate(nodes.times, times), *follow_points(nodes, s).gradient)
    return _of_points(np.moveaxis(direction(gradient, gradient)[0], 0, -1), s, times, "1", "tangent")


def distance(dataset: xr.Dataset, first: float, second: float, times: ArrayLike) -> xr.DataArray:
    """Distance (time) of two material points [m]."""
    place = places(dataset, [first, second], times).values
    return _of_time(np.linalg.norm(place[:, 1] - place[:, 0], axis=-1), times, "m", "distance")


def curvature(dataset: xr.Dataset, s: ArrayLike, times: ArrayLike) -> xr.DataArray:
    """Curvature (time, point) at material points [1/m]: angles of neighbouring segments over their length.

    Linear between nodes, and between stored times; nought at the ends, unknown near a winch.
    """
    nodes = read_nodes(dataset)
    there = nodes.s.size if nodes.deployed is None else nodes.s.size - 1
    chord = np.diff(nodes.motion[0][:, :there], axis=1)
    tangent = chord / np.linalg.norm(chord, axis=-1, keepdims=True)
    before, after = tangent[:, :-1], tangent[:, 1:]
    sine = np.linalg.norm(np.cross(before, after), axis=-1)
    angle = np.arctan2(sine, np.einsum("tec,tec->te", before, after))
    h = np.diff(nodes.s[:there])
    at_nodes = np.pad(2.0 * angle / (h[:-1] + h[1:]), ((0, 0), (1, 1)))
    at_points = linear_along(nodes.s[:there], at_nodes, np.asarray(s, dtype=float))
    return _of_points(_in_time(nodes.times, at_points, times), s, times, "m-1", "curvature")


def tension(dataset: xr.Dataset, s: float, side: str, times: ArrayLike) -> xr.DataArray:
    """Tension (time) of the segment that ends (side ``a``) or begins (``b``) at a material point [N]."""
    if "tension" not in dataset:
        raise SensorError(missing_variable(dataset, "tension"))
    if side not in ("a", "b"):
        raise SensorError(f"side is {side!r}: give 'a' or 'b'.")
    nodes = dataset["s"].values
    stored = dataset["tension"].transpose("time", "segment").values
    last = stored.shape[1] - 1
    if side == "a":
        segment = int(np.clip(np.searchsorted(nodes, s - 1e-9) - 1, 0, last))
    else:
        segment = int(np.clip(np.searchsorted(nodes, s + 1e-9, side="right") - 1, 0, last))
    values = _in_time(dataset["time"].values, stored[:, [segment]], times)[:, 0]
    return _of_time(values, times, "N", "tension")


def outer_force(dataset: xr.Dataset, first: float, second: float, times: ArrayLike) -> xr.DataArray:
    """Force (time, axis) of the cable outside on the part between two bodies, at nodes: N_b - N_a [N].

    N is the internal force T_t t + T_n n + T_b b of the segments before the first and beyond the second.
    """
    needed = ("tension", "shear_normal", "shear_binormal", "phi", "position")
    for name in needed:
        if name not in dataset:
            raise SensorError(missing_variable(dataset, name))
    along, normal, binormal = (
        dataset[name].transpose("time", "segment").values[..., None] for name in needed[:3]
    )
    chord = np.diff(dataset["position"].transpose("time", "node", "axis").values, axis=1)
    tangent = chord / np.linalg.norm(chord, axis=-1, keepdims=True)
    phi = dataset["phi"].transpose("time", "segment").values
    across = np.stack((-np.sin(phi), np.zeros_like(phi), -np.cos(phi)), axis=-1)  # n of the paper's frame
    internal = along * tangent + normal * across + binormal * np.cross(tangent, across)
    node = np.argmin(np.abs(dataset["s"].values - np.array([[first], [second]])), axis=1)
    values = _in_time(dataset["time"].values, internal[:, node[1]] - internal[:, node[0] - 1], times)
    coordinates = {"time": _plain(times), "axis": AXES}
    attributes = {"units": "N", "long_name": "force of the cable outside"}
    return xr.DataArray(values, coordinates, ("time", "axis"), attrs=attributes)


def pull(dataset: xr.Dataset, first: float, second: float, times: ArrayLike) -> xr.DataArray:
    """Part (time) of `outer_force` along the line from the first to the second body, to the winch [N]."""
    ends = places(dataset, [first, second], times).values
    line = ends[:, 1] - ends[:, 0]
    force = outer_force(dataset, first, second, times).values
    values = np.einsum("tc,tc->t", force, line) / np.linalg.norm(line, axis=-1)
    return _of_time(values, times, "N", "force of the cable outside along the line of the bodies")


def errors_of(estimate: ArrayLike, truth: ArrayLike) -> dict[str, float]:
    """RMS, largest and mean error of an estimate, in its unit; places without a value are left out."""
    found, true = np.asarray(estimate, dtype=float), np.asarray(truth, dtype=float)
    if found.shape != true.shape:
        raise SensorError(f"The estimate has shape {found.shape}, the truth {true.shape}: give both alike.")
    error = found - true
    error = error[np.isfinite(error)]
    if not error.size:
        raise SensorError("The estimate and the truth have no time in common at which both are known.")
    return {
        "rms": float(np.sqrt((error**2).mean())),
        "max": float(np.abs(error).max()),
        "mean": float(error.mean()),
    }


def agreement_of_sign(estimate: ArrayLike, truth: ArrayLike, threshold: float) -> float:
    """Share of the time in which an estimate has the truth's sign, of that in which |truth| > threshold."""
    true, found = np.asarray(truth, dtype=float), np.asarray(estimate, dtype=float)
    counted = (np.abs(true) > threshold) & np.isfinite(found)
    if not counted.any():
        return float("nan")
    return float((np.sign(found[counted]) == np.sign(true[counted])).mean())


def _in_time(stored: Array, values: Array, times: ArrayLike) -> Array:
    """Values (q, m) at wanted times, linear between stored ones (k, m)."""
    samples = locate(stored, times)
    before, after = values[samples.before], values[samples.after]
    return (1.0 - samples.share) * before + samples.share * after


def _plain(times: ArrayLike) -> Array:
    return np.asarray(times, dtype=float)


def _of_time(values: Array, times: ArrayLike, units: str, meaning: str) -> xr.DataArray:
    attributes = {"units": units, "long_name": meaning}
    return xr.DataArray(values, {"time": _plain(times)}, ("time",), attrs=attributes)


def _of_points(values: Array, s: ArrayLike, times: ArrayLike, units: str, meaning: str) -> xr.DataArray:
    """Values (q, m) or (q, m, 3) of material points, labelled."""
    coordinates: Mapping[str, object] = {"time": _plain(times), "s": ("point", np.asarray(s, dtype=float))}
    dimensions = ("time", "point", "axis")[: values.ndim]
    attributes = {"units": units, "long_name": meaning}
    if values.ndim == 3:
        coordinates = {**coordinates, "axis": AXES}
    return xr.DataArray(values, coordinates, dimensions, attrs=attributes)
