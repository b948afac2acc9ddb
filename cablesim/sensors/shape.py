"""Shape of the cable from the tangents that sensors on it report.

Depends on: case, imu, interpolation, problems, rotations.

Between sensors the tangent follows the cable's statics.  A cable of bending stiffness EI under a tension N
between point loads obeys EI d2t/ds2 = N (t - t_N) across the tangent: it leaves the direction t_N of the
internal force by exponentials of length sqrt(EI/N), and t_N jumps at bodies (buoys, ballast) only.  The
coefficients are those that agree with the sensors, tangent and moment being continuous at bodies; what
several sensors on one piece leave over is spread linearly between them.  An infinite length gives circular
arcs.

The length is that of a case, which is never quite that of the cable: sensors lean on their mountings, buoys
are not where they should be.  Nearly all of what that does to the distance of the ends is constant, so one
look at rest, where the distance can be measured, takes most of it out (`opening_at_rest`).

Tangents are developed into the plane along the great circles between neighbouring sensors: exact for a plane
curve, and free of singular directions.  The weights of the sensors are constant in time.
"""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from cablesim.case import Case
from cablesim.case import models as case_models
from cablesim.sensors.imu import AXES, stored_case
from cablesim.sensors.interpolation import linear_along
from cablesim.sensors.problems import NEAREST, SensorError, SensorWarning, ordered_places
from cablesim.sensors.rotations import rotate, rotate_back, turn

Array = NDArray[np.float64]

STEP = 0.01
"""Greatest distance of the places at which a shape is found [m]."""

WIDEST = 0.6
"""Largest angle by which one look at rest may turn the ends of a shape [rad]."""

_EXTRAPOLATED = 0.2  # part of a shape beyond the outermost sensor from which on a warning is given
# height of a ballast above the line of its buoys that is not believed, of the cable between them
_UPSIDE_DOWN = 0.05
_ENERGY = 1e-6  # weight of bending energy against disagreement with the sensors: it decides what they do not


def tangents(signals: xr.Dataset) -> xr.DataArray:
    """Tangent vectors (8) of the cable at the sensors, from their orientations and mountings.

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals` or `read_imu_csv`.

    Returns
    -------
    DataArray
        ``time, imu, axis``: unit vectors in the world frame, from A to B.
    """
    mounting = signals["mounting"].transpose("component", "imu").values
    axis = rotate_back(mounting, np.array([[1.0], [0.0], [0.0]]))  # the tangent in the sensor frame
    quaternion = signals["orientation"].transpose("component", "time", "imu").values
    vectors = np.moveaxis(rotate(quaternion, axis[:, None]), 0, -1)
    return world_vectors(signals, vectors, "tangent of the cable", "1")


def world_vectors(signals: xr.Dataset, values: Array, meaning: str, units: str) -> xr.DataArray:
    """Vectors (time, imu, 3) in the world frame, labelled."""
    coordinates = {name: signals[name] for name in ("time", "imu", "s")}
    attributes = {"units": units, "long_name": f"{meaning} in the world frame, z up"}
    return xr.DataArray(values, {**coordinates, "axis": AXES}, ("time", "imu", "axis"), attrs=attributes)


def estimate_shape(
    signals: xr.Dataset,
    start: float | None = None,
    end: float | None = None,
    *,
    case: Case | None = None,
    bodies: ArrayLike | None = None,
    bending_length: float | None = None,
    opening: float = 0.0,
) -> xr.Dataset:
    """Shape of the cable between two places, from the orientations of the sensors alone.

    Positions are the integral of the tangents, so that the length of the cable between any two places is
    exact.  Two to seven sensors, or more, anywhere; sensors outside the two places count too.

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals` or `read_imu_csv`.
    start, end : float, optional
        Material coordinates [m]; default: the first and last body of the case, else the outermost sensors.
    case : Case, optional
        Of the cable; default: the case that is stored with the signals.
    bodies : array_like, optional
        Material coordinates of point loads [m]; default: the bodies of the case.
    bending_length : float, optional
        sqrt(EI/N) [m], ``inf`` for circular arcs; default: with the stiffness and the mean net lift of the
        buoys in the case, but at least a quarter of `STEP`.
    opening : float
        Offset that was found at rest, see `opening_at_rest` [rad].

    Returns
    -------
    Dataset
        ``position`` [m], from the first place, and ``tangent``, with dimensions ``time, point, axis`` in the
        world frame and the coordinate ``s`` [m].

    Raises
    ------
    SensorError
        If there are fewer than two sensors, two share a place, a piece between bodies has none, the two
        places are not in order, or neither a case nor `bending_length` says how the cable bends.

    Warns
    -----
    SensorWarning
        If more than a fifth of the shape lies beyond the outermost sensor, or sensors seem to be mounted the
        other way round or to be elsewhere.
    """
    case = _case(signals) if case is None else case
    loads = _body_places(case) if bodies is None else np.sort(np.asarray(bodies, dtype=float))
    length = _bending_length(case) if bending_length is None else float(bending_length)
    order, places = ordered_places(signals["s"].values)
    outer = loads if loads.size > 1 else places
    first, last = (outer[0] if start is None else start), (outer[-1] if end is None else end)
    if not first < last:
        raise SensorError(
            f"The shape was asked for from {first:g} to {last:g} m: give an end beyond the start."
        )
    _check_span(places, first, last, loads)
    grid = shape_grid(first, last, loads)
    weights = tangent_weights(places, grid, loads, length)
    known = tangents(signals).values[:, order]
    along = interpolate_tangents(known, places, grid, weights)
    if opening != 0.0:
        along = _opened(grid, along, opening)
    position = _summed(grid, along)
    _check_sense([str(name) for name in signals["imu"].values[order]], places, known, loads)
    _check_bodies(grid, position, case)
    dimensions = ("time", "point", "axis")
    meaning = {"units": "m", "long_name": "estimated position from the start"}
    return xr.Dataset(
        {
            "position": (dimensions, position, meaning),
            "tangent": (dimensions, along, {"units": "1", "long_name": "estimated tangent"}),
        },
        {"time": signals["time"], "s": ("point", grid, {"units": "m"}), "axis": AXES},
        {"bending_length": length, "opening": opening, "case": signals.attrs.get("case", "")},
    )


def opening_at_rest(
    signals: xr.Dataset,
    distance: float,
    start: float | None = None,
    end: float | None = None,
    *,
    case: Case | None = None,
    bodies: ArrayLike | None = None,
    bending_length: float | None = None,
) -> float:
    """Offset of a shape, from its distance measured once at rest.

    The shape is opened (or closed) in the plane of its ends and its middle: tangents are turned by an angle
    that goes evenly from `opening` at the first place to its opposite at the last, so that the length is
    kept and a taut cable is left alone.

    Parameters
    ----------
    signals : Dataset
        Of the rest alone, for instance ``signals.sel(time=slice(0, 5))``: its mean is taken.
    distance : float
        Of the first from the last place of the shape, measured then [m].
    start, end, case, bodies, bending_length
        As in `estimate_shape`, and the same there.

    Returns
    -------
    float
        For `estimate_shape` [rad].

    Raises
    ------
    SensorError
        If no opening up to `WIDEST` gives the distance: then something else is wrong.
    """
    shape = estimate_shape(signals, start, end, case=case, bodies=bodies, bending_length=bending_length)
    grid = shape["s"].values
    along = shape["tangent"].mean("time").values[None]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)

    def missing(opening: float) -> float:
        return float(np.linalg.norm(_summed(grid, _opened(grid, along, opening))[0, -1]) - distance)

    least, found, most = (missing(opening) + distance for opening in (-WIDEST, 0.0, WIDEST))
    if not least < distance < most:
        raise SensorError(
            f"A distance of {distance:g} m at rest is out of reach: the sensors tell {found:.3g} m, and "
            f"{least:.3g} to {most:.3g} m with all that an offset may do. Check the distance, and where and "
            "how the sensors sit."
        )
    return float(brentq(missing, -WIDEST, WIDEST, xtol=1e-9))


def _summed(grid: Array, along: Array) -> Array:
    """Positions (q, p, 3) from the first place, the integral of the tangents."""
    steps = 0.5 * np.diff(grid)[:, None] * (along[:, 1:] + along[:, :-1])
    return np.concatenate((np.zeros_like(along[:, :1]), np.cumsum(steps, axis=1)), axis=1)


def _opened(grid: Array, along: Array, opening: float) -> Array:
    """Tangents (q, p, 3) turned in the plane of ends and middle, at the ends by the opening."""
    position = _summed(grid, along)
    middle = position[:, grid.size // 2]
    normal = np.cross(middle, position[:, -1] - middle)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    axis = normal / np.maximum(size, 1e-12)  # of a straight cable there is none, and nothing to open
    share = 1.0 - 2.0 * (grid - grid[0]) / (grid[-1] - grid[0])
    turns = turn(opening * axis.T[..., None] * share)
    return np.moveaxis(rotate(turns, np.moveaxis(along, -1, 0)), 0, -1)


def shape_distance(
    shape: xr.Dataset, first: float | None = None, second: float | None = None
) -> xr.DataArray:
    """Distance between two material points of an estimated shape [m], by default its ends."""
    s = shape["s"].values
    near, far = (s[0] if first is None else first), (s[-1] if second is None else second)
    for place in (near, far):
        if not s[0] - 1e-9 <= place <= s[-1] + 1e-9:
            raise SensorError(f"s = {place:g} m is not in the shape, {s[0]:g} to {s[-1]:g} m.")
    position = shape["position"].transpose("time", "point", "axis").values
    ends = linear_along(s, position, np.array([near, far]))
    distance = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
    attributes = {"units": "m", "long_name": "distance"}
    return xr.DataArray(distance, {"time": shape["time"]}, ("time",), attrs=attributes)


def shape_curvature(shape: xr.Dataset, s: ArrayLike) -> xr.DataArray:
    """Curvature of an estimated shape at material points (m,) [1/m], dimensions ``time, point``."""
    grid, points = shape["s"].values, np.asarray(s, dtype=float)
    slope = np.gradient(shape["tangent"].transpose("time", "point", "axis").values, grid, axis=1)
    values = linear_along(grid, np.linalg.norm(slope, axis=-1), points)
    coordinates = {"time": shape["time"], "s": ("point", points)}
    attributes = {"units": "m-1", "long_name": "curvature"}
    return xr.DataArray(values, coordinates, ("time", "point"), attrs=attributes)


# Checks -----------------------------------------------------------------------------------------


def _check_span(places: Array, first: float, last: float, loads: Array) -> None:
    """Refuse pieces between bodies that no sensor is on; warn of what is extrapolated."""
    for a, b in pairwise(_cuts(first, last, loads)):
        if not ((places > a - NEAREST) & (places < b + NEAREST)).any():
            raise SensorError(
                f"No sensor is on the cable from {a:g} to {b:g} m, so nothing tells where it goes; they are "
                f"at {_list(places)} m. Put one there, or ask for a shape (`start`, `end`) with some on each "
                "piece between bodies."
            )
    beyond = max(places[0] - first, last - places[-1])
    if beyond > _EXTRAPOLATED * (last - first):
        warnings.warn(
            f"The sensors, at {_list(places)} m, do not span the shape from {first:g} to {last:g} m: "
            f"{beyond:.3g} m beyond the outermost are extrapolated. Put sensors nearer to its ends, or ask "
            "for less of it (`start`, `end`).",
            SensorWarning,
            stacklevel=3,
        )


def _check_sense(names: list[str], places: Array, known: Array, loads: Array) -> None:
    """Warn of the sensor whose tangents (q, m, 3) are nearer to those of its neighbours when reversed.

    Neighbours count with the cosine in the middle of the log, those beyond a body do not.
    """
    cosines = np.einsum("tmc,tmc->tm", known[:, :-1], known[:, 1:])
    agreement = np.zeros(len(names))
    for k, cosine in enumerate(cosines.T):
        apart = (loads > places[k] + NEAREST) & (loads < places[k + 1] - NEAREST)
        there = cosine[np.isfinite(cosine)]
        if there.size and not apart.any():
            agreement[k : k + 2] += np.median(there)
    worst = int(np.argmin(agreement))
    if len(names) > 2 and agreement[worst] < 0.0:
        warnings.warn(
            f"{names[worst]}, at {places[worst]:g} m, points away from its neighbours most of the time: is "
            "it mounted the other way round (`mounting`), or elsewhere?",
            SensorWarning,
            stacklevel=3,
        )


def _check_bodies(grid: Array, position: Array, case: Case | None) -> None:
    """Warn of what sinks if it comes out above the line between its neighbours, both of which float."""
    if case is None:
        return
    inside = [body for body in case_bodies(case) if grid[0] <= body.at <= grid[-1]]
    for first, body, last in zip(inside, inside[1:], inside[2:], strict=False):
        lifts = [_net_lift(case, each) for each in (first, body, last)]
        if not (lifts[0] > 0.0 > lifts[1] and lifts[2] > 0.0):
            continue
        index = [int(np.argmin(np.abs(grid - each.at))) for each in (first, body, last)]
        height = position[:, index, 2]
        share = (body.at - first.at) / (last.at - first.at)
        above = height[:, 1] - (1.0 - share) * height[:, 0] - share * height[:, 2]
        above = above[np.isfinite(above)]
        if above.size and np.median(above) > _UPSIDE_DOWN * (last.at - first.at):
            warnings.warn(
                f"The sensors say that {body.name}, which sinks, is {np.median(above):.2g} m above the line "
                f"from {first.name} to {last.name}, which float: are the sensors mounted the other way round "
                "(`mounting`), or their places exchanged?",
                SensorWarning,
                stacklevel=3,
            )


def _list(places: Array) -> str:
    return ", ".join(f"{place:g}" for place in places)


# Weights ----------------------------------------------------------------------------------------


def shape_grid(first: float, last: float, bodies: Array) -> Array:
    """Places (p,) from `first` to `last`, no further apart than `STEP`, with all bodies among them."""
    cuts = pairwise(_cuts(first, last, bodies))
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / STEP - 1e-9)) + 1)[1:] for a, b in cuts]
    return np.concatenate(([first], *pieces))


def _cuts(first: float, last: float, bodies: Array) -> Array:
    """Two places and the bodies between them, in order [m]."""
    return np.unique(np.concatenate(([first, last], bodies[(bodies > first) & (bodies < last)])))


def tangent_weights(sensors: Array, grid: Array, bodies: ArrayLike, bending_length: float) -> Array:
    """Weights (p, m) of the sensors' developed tangents in those at places between them.

    Parameters
    ----------
    sensors : ndarray, shape (m,)
        Material coordinates of the sensors, increasing [m].
    grid : ndarray, shape (p,)
        Places [m].
    bodies : array_like
        Material coordinates of point loads [m].
    bending_length : float
        sqrt(EI/N) [m]; ``inf``: circular arcs.
    """
    linear = np.stack([np.interp(grid, sensors, row) for row in np.eye(sensors.size)], axis=1)
    if not np.isfinite(bending_length):
        return linear
    ends = min(grid[0], sensors[0]), max(grid[-1], sensors[-1])
    inside = np.asarray(bodies, dtype=float)
    inside = inside[(inside > ends[0]) & (inside < ends[1])]
    edges = np.concatenate(([ends[0]], inside, [ends[1]]))
    free = _continuous(edges, bending_length)
    found = _elastic(sensors, edges, bending_length) @ free
    energy = free.T @ _energy(edges, bending_length) @ free
    solve = np.linalg.solve(found.T @ found + _ENERGY * energy, found.T)
    left_over = np.eye(sensors.size) - found @ solve
    return _elastic(grid, edges, bending_length) @ free @ solve + linear @ left_over


def _elastic(
    s: Array, edges: Array, length: float, derivative: int = 0, side: Literal["left", "right"] = "right"
) -> Array:
    """Constant and both exponentials of each piece (p, 3 pieces), or their derivatives times the length."""
    pieces = edges.size - 1
    piece = np.clip(np.searchsorted(edges, s, side=side) - 1, 0, pieces - 1)
    row = np.arange(s.size)
    result = np.zeros((s.size, 3 * pieces))
    result[row, 3 * piece] = 0.0 if derivative else 1.0
    result[row, 3 * piece + 1] = (-1.0 if derivative else 1.0) * np.exp(-(s - edges[piece]) / length)
    result[row, 3 * piece + 2] = np.exp((s - edges[piece + 1]) / length)
    return result


def _continuous(edges: Array, length: float) -> Array:
    """Basis (3 pieces, free) of the coefficients with which tangent and moment are continuous."""
    inner = edges[1:-1]
    if not inner.size:
        return np.eye(3)
    jumps = [
        _elastic(inner, edges, length, derivative, "right")
        - _elastic(inner, edges, length, derivative, "left")
        for derivative in (0, 1)
    ]
    return np.linalg.svd(np.concatenate(jumps))[2][2 * inner.size :].T


def _energy(edges: Array, length: float) -> Array:
    """Energy of bending and of the tension in it, as a form (3 pieces, 3 pieces) of the coefficients."""
    s = np.linspace(edges[0], edges[-1], 601)
    bent, away = _elastic(s, edges, length, 1), _elastic(s, edges, length)
    away[:, ::3] = 0.0
    return (s[1] - s[0]) * (bent.T @ bent + away.T @ away)


# Development ------------------------------------------------------------------------------------


def interpolate_tangents(known: Array, sensors: Array, grid: Array, weights: Array) -> Array:
    """Tangents (q, p, 3) at places, from those of the sensors (q, m, 3) and their weights (p, m)."""
    plane, first, second = _develop(known)
    wanted = np.einsum("pm,tmc->tpc", weights, plane)
    result = np.empty((known.shape[0], grid.size, 3))
    after = np.clip(np.searchsorted(sensors, grid, side="right"), 1, sensors.size - 1)
    for j in range(1, sensors.size):
        here = np.flatnonzero(after == j)
        share = np.clip((grid[here] - sensors[j - 1]) / (sensors[j] - sensors[j - 1]), 0.0, 1.0)[:, None]
        sides = [
            _exponential(wanted[:, here] - plane[:, [k]], known[:, k], first[:, k], second[:, k])
            for k in (j - 1, j)
        ]
        mixed = (1.0 - share) * sides[0] + share * sides[1]
        result[:, here] = mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
    return result


def _develop(known: Array) -> tuple[Array, Array, Array]:
    """Tangents rolled into the plane (q, m, 2), and two unit vectors across each, (q, m, 3)."""
    plane = np.zeros((*known.shape[:2], 2))
    first, second = np.empty_like(known), np.empty_like(known)
    steep = np.abs(known[:, 0, 1]) > 0.9
    across = np.cross(known[:, 0], np.where(steep[:, None], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    first[:, 0] = across / np.linalg.norm(across, axis=-1, keepdims=True)
    second[:, 0] = np.cross(known[:, 0], first[:, 0])
    for j in range(1, known.shape[1]):
        before, now = known[:, j - 1], known[:, j]
        cosine = np.einsum("tc,tc->t", before, now)
        components = np.stack([np.einsum("tc,tc->t", now, e[:, j - 1]) for e in (first, second)], axis=-1)
        sine = np.linalg.norm(components, axis=-1)
        angle = np.arctan2(sine, cosine)
        plane[:, j] = (
            plane[:, j - 1]
            + components * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)[:, None]
        )
        reach = (before + now) / np.maximum(1.0 + cosine, 1e-12)[:, None]
        first[:, j] = first[:, j - 1] - components[:, :1] * reach
        second[:, j] = np.cross(now, first[:, j])
    return plane, first, second


def _exponential(offset: Array, tangent: Array, first: Array, second: Array) -> Array:
    """Unit vectors (q, p, 3) at offsets (q, p, 2) in the plane from tangents (q, 3)."""
    angle = np.linalg.norm(offset, axis=-1, keepdims=True)
    sideways = offset[..., :1] * first[:, None] + offset[..., 1:] * second[:, None]
    return np.cos(angle) * tangent[:, None] + np.sinc(angle / np.pi) * sideways


# Case -------------------------------------------------------------------------------------------


def _case(signals: xr.Dataset) -> Case | None:
    text = signals.attrs.get("case")
    return stored_case(text) if text else None


def case_bodies(case: Case) -> list[case_models.Body]:
    """The buoys, ballasts and bodies of a case, from A to B."""
    bodies = [part for part in case.attachments if isinstance(part, case_models.Body)]
    return sorted(bodies, key=lambda body: body.at)


def _body_places(case: Case | None) -> Array:
    return np.array([body.at for body in case_bodies(case)] if case is not None else [], dtype=float)


def _net_lift(case: Case, body: case_models.Body) -> float:
    """Buoyancy less weight of a body [N]."""
    return (case.water.density * body.volume - body.mass) * case.gravity


def _bending_length(case: Case | None) -> float:
    """sqrt(EI/N) with N the mean net lift of what floats: it hangs the cable between buoys and ballast."""
    if case is None:
        raise SensorError(
            "The signals hold no case, which says how the cable bends between the sensors: give `case`, or "
            "`bodies` and `bending_length` (inf: circular arcs)."
        )
    lifts = [_net_lift(case, body) for body in case_bodies(case)]
    upwards = [lift for lift in lifts if lift > 0.0]
    if not upwards:
        warnings.warn(
            f"Nothing on the cable of {case.name} floats, so its tension between the sensors is not known: "
            "circular arcs are taken. Give `bending_length` (inf: circular arcs, without this warning).",
            SensorWarning,
            stacklevel=3,
        )
        return np.inf
    return max(float(np.sqrt(case.cable.bending_stiffness / np.mean(upwards))), 0.25 * STEP)
