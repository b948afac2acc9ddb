"""Distance of the buoys from the tangents alone: equation (9), and weights that are calibrated.

Depends on: problems, shape (for the tangents).

Both are d = |sum of w_i t_i|.  Equation (9) takes the arms as straight and gives the sensors on their middles
the arms' lengths; nearly all of its error is a constant, which one look at rest takes out (subtract it).
Weights of all sensors that are fitted to a run whose distance is known, a dive in a tank say, know how
the cable bends between the sensors without a model of it.  They hold for the cable, the buoys, the places and
the mountings with which they were found.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.sensors.problems import SensorError, number_of, ordered_places
from cablesim.sensors.shape import tangents

Array = NDArray[np.float64]


def rigid_arm_distance(
    signals: xr.Dataset, first: str = "imu_2", second: str = "imu_4", arms: tuple[float, float] = (0.6, 0.6)
) -> xr.DataArray:
    """Distance between the buoys (9), d = |l1 t_2 + l2 t_4|: the arms to the ballast taken as straight.

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals` or `read_imu_csv`.
    first, second : str
        Sensors on the two arms, from A to B; default: the paper's.
    arms : tuple of two floats
        Lengths of the arms [m].

    Returns
    -------
    DataArray
        ``time`` [m].

    Raises
    ------
    SensorError
        If there is no such sensor, or `second` is not beyond `first`.
    """
    names = [str(name) for name in signals["imu"].values]
    pair = signals.isel(imu=[number_of(names, first), number_of(names, second)])
    if not pair["s"].values[0] < pair["s"].values[1]:
        raise SensorError(
            f"Sensor {first!r} is at {pair['s'].values[0]:g} m and {second!r} at {pair['s'].values[1]:g} m: "
            "name one on the arm towards A, then one on the arm towards B."
        )
    found = weighted_distance(pair, xr.DataArray(list(arms), {"imu": pair["imu"]}, ("imu",)))
    return found.assign_attrs(long_name="distance of the buoys, equation (9)")


def weigh_tangents(signals: xr.Dataset, distance: ArrayLike) -> xr.DataArray:
    """Weights of all sensors' tangents that give a known distance best: a calibration.

    Parameters
    ----------
    signals : Dataset
        Of a run in which the distance changes; times at which something is unknown are left out.
    distance : array_like, shape (q,)
        True distance at the times of the signals [m].

    Returns
    -------
    DataArray
        ``imu`` [m], for `weighted_distance`; its attribute ``residual`` is the RMS that is left [m].

    Raises
    ------
    SensorError
        If the distance has other times, or fewer of them are known than there are sensors.
    """
    from scipy.optimize import least_squares

    wanted = np.asarray(distance, dtype=float)
    known = tangents(signals).values
    if wanted.shape != known.shape[:1]:
        raise SensorError(f"There are {wanted.size} distances for {known.shape[0]} times: give one for each.")
    there = np.isfinite(known).all(axis=(1, 2)) & np.isfinite(wanted)
    if there.sum() < max(known.shape[1], 2):
        raise SensorError(
            f"Signals and distance are known together at {there.sum()} times: {known.shape[1]} sensors need "
            "as many or more."
        )
    known, wanted = known[there], wanted[there]

    def residual(weights: Array) -> Array:
        return np.linalg.norm(np.einsum("tmc,m->tc", known, weights), axis=-1) - wanted

    def jacobian(weights: Array) -> Array:
        total = np.einsum("tmc,m->tc", known, weights)
        return np.einsum("tmc,tc->tm", known, total / np.linalg.norm(total, axis=-1, keepdims=True))

    fit = least_squares(residual, _lengths_beside(signals["s"].values), jacobian, x_scale=0.1)
    attributes = {
        "units": "m",
        "long_name": "weights of the tangents in the distance",
        "residual": float(np.sqrt(np.mean(fit.fun**2))),
    }
    return xr.DataArray(fit.x, {"imu": signals["imu"]}, ("imu",), attrs=attributes)


def _lengths_beside(s: Array) -> Array:
    """Length of cable that is nearest to each sensor, between the outermost of them [m]."""
    order, places = ordered_places(s)
    edges = np.concatenate((places[:1], 0.5 * (places[1:] + places[:-1]), places[-1:]))
    lengths = np.empty_like(places)
    lengths[order] = np.diff(edges)
    return lengths


def weighted_distance(signals: xr.Dataset, weights: xr.DataArray) -> xr.DataArray:
    """Distance |sum of w_i t_i| of the buoys [m], with weights (imu) such as those of `weigh_tangents`."""
    names = [str(name) for name in signals["imu"].values]
    index = [number_of(names, str(name)) for name in weights["imu"].values]
    total = np.einsum("tmc,m->tc", tangents(signals).values[:, index], weights.values)
    attributes = {"units": "m", "long_name": "distance of the buoys, from weighted tangents"}
    return xr.DataArray(
        np.linalg.norm(total, axis=-1), {"time": signals["time"]}, ("time",), attrs=attributes
    )
