"""What estimates are compared with: places, distances, curvature and tension in the run itself.

Depends on: export (for a message), interpolation, rotations.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.export import missing_variable
from cablesim.sensors.interpolation import (
    SensorError,
    follow_points,
    linear_along,
    locate,
    quintic,
    read_nodes,
)
from cablesim.sensors.rotations import direction

Array = NDArray[np.float64]


def true_places(dataset: xr.Dataset, s: ArrayLike, times: ArrayLike) -> Array:
    """Positions (q, m, 3) of material points at any times of a run [m]; NaN on the drum."""
    nodes = read_nodes(dataset)
    place = quintic(locate(nodes.times, times), *follow_points(nodes, s).place)
    return np.moveaxis(place, 0, -1)


def true_tangents(dataset: xr.Dataset, s: ArrayLike, times: ArrayLike) -> Array:
    """Unit tangents (q, m, 3) at material points at any times of a run."""
    nodes = read_nodes(dataset)
    gradient = quintic(locate(nodes.times, times), *follow_points(nodes, s).gradient)
    return np.moveaxis(direction(gradient, gradient)[0], 0, -1)


def true_distance(dataset: xr.Dataset, first: float, second: float, times: ArrayLike) -> Array:
    """Distance (q,) of two material points [m]."""
    place = true_places(dataset, [first, second], times)
    return np.linalg.norm(place[:, 1] - place[:, 0], axis=-1)


def true_curvature(dataset: xr.Dataset, s: ArrayLike, times: ArrayLike) -> Array:
    """Curvature (q, m) at material points [1/m]: angles of neighbouring segments over their length.

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
    curvature = np.pad(2.0 * angle / (h[:-1] + h[1:]), ((0, 0), (1, 1)))
    return _in_time(nodes.times, linear_along(nodes.s[:there], curvature, np.asarray(s, dtype=float)), times)


def true_tension(dataset: xr.Dataset, s: float, side: str, times: ArrayLike) -> Array:
    """Tension (q,) of the segment that ends (side ``a``) or begins (side ``b``) at a material point [N]."""
    if "tension" not in dataset:
        raise SensorError(missing_variable(dataset, "tension"))
    if side not in ("a", "b"):
        raise SensorError(f"side is {side!r}: give 'a' or 'b'.")
    nodes = dataset["s"].values
    tension = dataset["tension"].transpose("time", "segment").values
    last = tension.shape[1] - 1
    if side == "a":
        segment = int(np.clip(np.searchsorted(nodes, s - 1e-9) - 1, 0, last))
    else:
        segment = int(np.clip(np.searchsorted(nodes, s + 1e-9, side="right") - 1, 0, last))
    return _in_time(dataset["time"].values, tension[:, [segment]], times)[:, 0]


def true_outer_force(dataset: xr.Dataset, first: float, second: float, times: ArrayLike) -> Array:
    """Force (q, 3) of the cable outside on the part between two bodies, at nodes: N_b - N_a [N].

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
    return _in_time(dataset["time"].values, internal[:, node[1]] - internal[:, node[0] - 1], times)


def errors_of(estimate: ArrayLike, truth: ArrayLike) -> dict[str, float]:
    """RMS, largest and mean error of an estimate, in its unit; places without a value are left out."""
    error = np.asarray(estimate, dtype=float) - np.asarray(truth, dtype=float)
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
