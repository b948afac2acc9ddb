"""What the paper reads from the sensors: angles (8), curvature (10)-(11), turning angles.

Depends on: shape, problems, motion, case.

All take datasets of sensor signals, simulated or logged, and return labelled arrays over time.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.case import models as case_models
from cablesim.motion import rov_heading
from cablesim.sensors.imu import stored_case
from cablesim.sensors.problems import SensorError, ordered_places
from cablesim.sensors.shape import tangents

Array = NDArray[np.float64]

LEVEL = 0.05
"""Shortest horizontal projection of a tangent that still has a direction."""


def tangent_angles(signals: xr.Dataset) -> xr.Dataset:
    """Angles theta and phi of equation (8) at the sensors [rad], phi unwrapped in time."""
    t = tangents(signals)
    x, y, z = np.moveaxis(t.values, -1, 0)
    values = {"theta": -np.arcsin(np.clip(y, -1.0, 1.0)), "phi": _unwrap(np.arctan2(-z, x), 0)}
    return xr.Dataset(
        {
            name: (("time", "imu"), angle, {"units": "rad", "long_name": f"angle {name} of equation (8)"})
            for name, angle in values.items()
        },
        {name: signals[name] for name in ("time", "imu", "s")},
    )


def pair_curvature(signals: xr.Dataset) -> xr.Dataset:
    """Curvature midway between neighbouring sensors (11), in the paper's local frame there.

    gamma = (0, dphi/ds cos theta, -dtheta/ds) (10) with differences of neighbours for derivatives and their
    mean theta.  Near +-y, where phi is not defined, it is meaningless; see `angle_curvature`.

    Returns
    -------
    Dataset
        ``normal``, ``binormal``, ``magnitude`` [1/m] with dimensions ``time, pair`` and the coordinate
        ``s`` midway [m].
    """
    angles = tangent_angles(signals)
    order, s = ordered_places(signals["s"].values)
    theta, phi = (angles[name].transpose("time", "imu").values[:, order] for name in ("theta", "phi"))
    gap = np.diff(s)
    turn = (np.diff(phi, axis=1) + np.pi) % (2.0 * np.pi) - np.pi
    normal = turn / gap * np.cos(0.5 * (theta[:, 1:] + theta[:, :-1]))
    binormal = -np.diff(theta, axis=1) / gap
    parts = {"normal": normal, "binormal": binormal, "magnitude": np.hypot(normal, binormal)}
    return xr.Dataset(
        {name: _of_pairs(signals, values, f"curvature, {name}") for name, values in parts.items()}
    )


def angle_curvature(signals: xr.Dataset) -> xr.DataArray:
    """Mean curvature between neighbouring sensors [1/m]: the angle of their tangents over their distance.

    The same as (11) for a curve in a vertical plane, without a singular direction.  Exact for circular arcs;
    a lower bound of the mean curvature always.

    Returns
    -------
    DataArray
        ``time, pair``, with the coordinate ``s`` midway [m].
    """
    order, s = ordered_places(signals["s"].values)
    t = tangents(signals).values[:, order]
    sine = np.linalg.norm(np.cross(t[:, :-1], t[:, 1:]), axis=-1)
    angle = np.arctan2(sine, np.einsum("tmc,tmc->tm", t[:, :-1], t[:, 1:]))
    return _of_pairs(signals, angle / np.diff(s), "curvature from the angle of tangents")


def _of_pairs(signals: xr.Dataset, values: Array, meaning: str) -> xr.DataArray:
    order, s = ordered_places(signals["s"].values)
    names = signals["imu"].values[order]
    pairs = [f"{a}-{b}" for a, b in pairwise(names)]
    coordinates = {"time": signals["time"], "pair": pairs, "s": ("pair", 0.5 * (s[1:] + s[:-1]))}
    attributes = {"units": "m-1", "long_name": meaning}
    return xr.DataArray(values, coordinates, ("time", "pair"), attrs=attributes)


# Turning ----------------------------------------------------------------------------------------


def turning_angles(vectors: xr.DataArray, heading: ArrayLike, *, behind: bool = False) -> xr.DataArray:
    """Angles alpha from a vehicle's heading to the horizontal projections of vectors [rad].

    The paper takes them from the scalar product; here they have a sign, positive from +x towards +y.
    Tangents point from the vehicle to the winch, so a cable that trails has an angle of half a turn, or
    none when it is counted from straight behind.

    Parameters
    ----------
    vectors : DataArray
        With the dimensions ``time`` and ``axis``: `tangents` of the sensors, or the line between two places
        of a shape.
    heading : array_like, scalar or shape (q,)
        Heading of the vehicle, about z from +x [rad]; see `vehicle_heading`.
    behind : bool
        Count from straight behind the vehicle instead.

    Returns
    -------
    DataArray
        Without ``axis``, unwrapped in time; NaN where a vector is steeper than has a direction (`LEVEL`).
    """
    x, y = (vectors.sel(axis=axis, drop=True) for axis in ("x", "y"))
    size = np.sqrt((vectors**2).sum("axis", skipna=False))
    there = np.hypot(x, y) > LEVEL * size
    facing = xr.DataArray(np.broadcast_to(np.asarray(heading, float), vectors.sizes["time"]), dims="time")
    if behind:
        facing = facing + np.pi
    angle = (xr.apply_ufunc(np.arctan2, y, x) - facing).where(there)
    angle = angle.copy(data=_unwrap(angle.values, angle.get_axis_num("time")))
    angle.attrs = {"units": "rad", "long_name": "horizontal angle from the vehicle's heading"}
    return angle


def _unwrap(angle: Array, axis: int) -> Array:
    """Angles in (-pi, pi] at first, without jumps; gaps are bridged."""

    def one(values: Array) -> Array:
        known = np.isfinite(values)
        if known.any():
            first = values[known][0]
            turns = np.round(first / (2.0 * np.pi))
            values[known] = np.unwrap(values[known]) - 2.0 * np.pi * turns
        return values

    return np.apply_along_axis(one, axis, angle.copy())


def vehicle_heading(dataset: xr.Dataset, times: ArrayLike) -> Array:
    """Heading (q,) of the vehicle at end A, from the case that is stored with a result [rad].

    Raises
    ------
    SensorError
        If there is no case, or its end A does not move by `rov_waypoints`.
    """
    text = dataset.attrs.get("case")
    end = stored_case(text).ends.a if text else None
    if not isinstance(end, case_models.RovWaypointsEnd):
        what = "holds no case" if end is None else f"has an end A that is {end.motion}, without a heading"
        raise SensorError(f"The result {what}: give the heading yourself [rad].")
    table = np.array(end.waypoints, dtype=float)
    column = 1 + end.channels.index("yaw") if "yaw" in end.channels else None
    rates = np.zeros(len(table)) if column is None else table[:, column]
    return rov_heading(end.heading, table[:, 0], rates)(np.asarray(times, dtype=float))
