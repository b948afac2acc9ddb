"""Who pulls on the V, vehicle or winch: from the distance of the buoys, or from the dynamics.

Depends on: builders, case, imu, problems, rotations, shape.

Two things are positive when the winch's side pulls more.  The paper's tension difference T_b - T_a is that
of the tangential forces beyond the last body and before the first one; the paper relates it to the distance.
The pull is the part along the line of the two bodies of N_b - N_a, the whole internal forces there; it
follows from the balance of momentum, and it alone says which way the V is drawn.  Where the cable is steep
beside the bodies, as at rest, the tension difference holds twice their mean vertical force too and can have
the other sign.

What the pull is worth: in the paper's three scenes it has 77 mN RMS.  Exact sensors tell it to 1.2 mN, but
water of 0.1 m/s along the V that the estimator does not know of puts it 107 mN off (1.7 when it is given as
`current`), drag 1.5 times what is believed 35, and a vertical that is off by 0.5 degrees 24, if `rest` has
found the accelerometers' offsets (650 without); its direction is right most of the time then
(validation/estimators.py).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

from cablesim.builders.cable import added_mass_section, outer_section
from cablesim.case import Case
from cablesim.case import models as case_models
from cablesim.sensors.imu import stored_case
from cablesim.sensors.problems import SensorError, SensorWarning, ordered_places
from cablesim.sensors.rotations import rotate, rotate_back
from cablesim.sensors.shape import case_bodies, estimate_shape

Array = NDArray[np.float64]

# The phase relation -----------------------------------------------------------------------------


@dataclass(frozen=True)
class PhaseRelation:
    """The paper's relation of tension difference and distance, made linear about the rest distance.

    T_b - T_a = stiffness (d - rest) + damping dd/dt + inertia d2d/dt2 + offset.

    Attributes
    ----------
    rest : float
        Distance at rest [m].
    stiffness, damping, inertia : float
        [N/m], [N s/m], [N s2/m].
    offset : float
        Tension difference at rest [N].
    """

    rest: float
    stiffness: float
    damping: float
    inertia: float
    offset: float

    def __call__(self, distance: xr.DataArray) -> xr.DataArray:
        """Tension difference (time) for a distance (time) [N]."""
        columns = _distance_columns(distance, self.rest)
        values = columns @ [self.stiffness, self.damping, self.inertia, self.offset]
        return _of_time(distance, values, "tension difference from the distance")


def fit_phase_relation(distance: xr.DataArray, difference: ArrayLike, rest: float) -> PhaseRelation:
    """Fit the relation to runs whose tension difference is known, by least squares.

    Times at which something is unknown are left out.

    Parameters
    ----------
    distance : DataArray
        ``time`` [m].
    difference : array_like, shape (q,)
        Tension difference at the same times [N].
    rest : float
        Distance at rest [m].
    """
    columns, wanted = _distance_columns(distance, rest), np.asarray(difference, dtype=float)
    known = np.isfinite(columns).all(axis=1) & np.isfinite(wanted)
    if known.sum() < columns.shape[1]:
        raise SensorError(
            f"Distance and difference are known together at {known.sum()} times: four are needed."
        )
    coefficients = np.linalg.lstsq(columns[known], wanted[known], rcond=None)[0]
    return PhaseRelation(rest, *map(float, coefficients))


def phase_lag(first: xr.DataArray, second: ArrayLike, longest: float = 3.0) -> tuple[float, float]:
    """Time by which `second` follows `first` with the greatest correlation [s], and that correlation.

    Times at which one of them is unknown are left out.

    Parameters
    ----------
    first : DataArray
        ``time``, sampled evenly.
    second : array_like, shape (q,)
        At the same times.
    longest : float
        Longest lag looked at, to both sides [s].
    """
    times = first["time"].values
    step = float(np.median(np.diff(times)))
    reach = min(int(longest / step), times.size // 2)
    a, b = first.values, np.asarray(second, dtype=float)
    lags = range(-reach, reach + 1)
    found = [_correlation(a, b, lag) for lag in lags]
    if np.isnan(found).all():
        raise SensorError("The two signals have no time in common at which both are known and change.")
    best = int(np.nanargmax(found))
    return lags[best] * step, found[best]


def _correlation(a: Array, b: Array, lag: int) -> float:
    """Correlation of `a` with what `b` is `lag` samples later; NaN where one of them does not change."""
    inside = slice(max(-lag, 0), a.size - max(lag, 0))
    here, later = a[inside], np.roll(b, -lag)[inside]
    known = np.isfinite(here) & np.isfinite(later)
    here, later = here[known], later[known]
    if here.size < 2 or np.ptp(here) == 0.0 or np.ptp(later) == 0.0:
        return np.nan
    return float(np.corrcoef(here, later)[0, 1])


def _distance_columns(distance: xr.DataArray, rest: float) -> Array:
    times = distance["time"].values
    rate = np.gradient(distance.values, times)
    return np.stack((distance.values - rest, rate, np.gradient(rate, times), np.ones(times.size)), axis=1)


# The dynamics -----------------------------------------------------------------------------------


def world_accelerations(signals: xr.Dataset, gravity: float, rest: float = 0.0) -> Array:
    """Accelerations (q, m, 3) of the sensors in the world frame [m/s2].

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals` or `read_imu_csv`.
    gravity : float
        [m/s2].
    rest : float
        Seconds at the start in which nothing moves: the mean reading then is taken as the sensor's offset.
    """
    force = signals["specific_force"].transpose("axis", "time", "imu").values
    quaternion = signals["orientation"].transpose("component", "time", "imu").values
    times = signals["time"].values
    up = np.array([0.0, 0.0, gravity])[:, None, None]
    if rest > 0.0:
        still = times <= times[0] + rest
        offset = (force - rotate_back(quaternion, up))[:, still]
        known = np.isfinite(offset)
        total = np.where(known, offset, 0.0).sum(axis=1, keepdims=True)
        # a sensor that says nothing in the rest has an offset that is not known
        force = force - np.where(known.any(axis=1, keepdims=True), total, np.nan) / np.maximum(
            known.sum(axis=1, keepdims=True), 1
        )
    return np.moveaxis(rotate(quaternion, force) - up, 0, -1)


def outer_force(
    signals: xr.Dataset,
    case: Case | None = None,
    *,
    shape: xr.Dataset | None = None,
    rest: float = 0.0,
    memory: float = np.inf,
    vehicle_velocity: ArrayLike = (0.0, 0.0, 0.0),
    current: ArrayLike | None = None,
) -> xr.Dataset:
    """Force of the cable outside on the part between the first and the last body: the balance of momentum.

        F = sum over bodies and cable between of (mass and added mass) a + weight in water + drag,

    with the accelerations of the sensors, linear along the cable between them (the paper's rigid portions),
    and velocities integrated from them.  F is N_b - N_a, the internal forces beside the two
    bodies, shear included; its part along the line from the first to the last body is the pull.  (Solving
    F = T_b t_b - T_a t_a for two tensions was tried: they hang on the shear and on steep tangents.)

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals` or `read_imu_csv`.
    case : Case, optional
        Masses, volumes, drag; default: the case that is stored with the signals.
    shape : Dataset, optional
        Of `estimate_shape`; default: from the same signals.
    rest : float
        Seconds of rest at the start, from which the accelerometers' offsets are found.
    memory : float
        Velocities are drawn to that of the vehicle with this time constant, so that errors do not add up [s].
    vehicle_velocity : array_like, shape (3,) or (q, 3)
        Velocity of the vehicle in the world frame, as its own instruments tell it [m/s].
    current : array_like, shape (3,) or (q, 3), optional
        Velocity of the water at the bodies in the world frame [m/s]; default: the uniform current of the
        case, else still water.

    Returns
    -------
    Dataset
        ``force`` (time, axis) [N] in the world frame; ``pull`` (time) [N], positive towards the winch.

    Raises
    ------
    SensorError
        If there is no case, it has fewer than two bodies, or two sensors share a place.

    Warns
    -----
    SensorWarning
        If the current of the case depends on the place, which the sensors do not know, and none is given.
    """
    case = _case(signals) if case is None else case
    bodies = case_bodies(case)
    if len(bodies) < 2:
        raise SensorError(f"The case {case.name} has {len(bodies)} bodies: the cable between two is needed.")
    if shape is None:
        shape = estimate_shape(signals, bodies[0].at, bodies[-1].at, case=case)
    s = shape["s"].values
    tangent = shape["tangent"].transpose("time", "point", "axis").values
    at_sensors = world_accelerations(signals, case.gravity, rest)
    vehicle = np.broadcast_to(np.asarray(vehicle_velocity, dtype=float), at_sensors[:, 0].shape)
    velocity = _integrate(at_sensors + vehicle[:, None] / memory, signals["time"].values, memory)
    velocity = velocity - np.broadcast_to(_water_velocity(case, current), vehicle.shape)[:, None]
    weights = _linear_weights(signals["s"].values, s)
    acceleration, velocity = (np.einsum("pm,tmc->tpc", weights, part) for part in (at_sensors, velocity))
    force = _cable_force(case, s, tangent, acceleration, velocity)
    for body in bodies:
        index = int(np.argmin(np.abs(s - body.at)))
        force += _body_force(case, body, acceleration[:, index], velocity[:, index])
    position = shape["position"].transpose("time", "point", "axis").values
    line = position[:, -1] - position[:, 0]
    pull = np.einsum("tc,tc->t", force, line) / np.linalg.norm(line, axis=-1)
    return xr.Dataset(
        {
            "force": (("time", "axis"), force, {"units": "N", "long_name": "force of the cable outside"}),
            "pull": _of_time(signals, pull, "force of the cable outside along the line of the bodies"),
        },
        {"time": signals["time"], "axis": shape["axis"].values},
    )


def _case(signals: xr.Dataset) -> Case:
    text = signals.attrs.get("case")
    if not text:
        raise SensorError("The signals hold no case: give `case`, with the masses of the bodies.")
    return stored_case(text)


def _water_velocity(case: Case, given: ArrayLike | None) -> Array:
    """Velocity of the water (3,) or (q, 3): what is given, else what the case says [m/s]."""
    current = case.water.current
    if given is not None:
        return np.asarray(given, dtype=float)
    if isinstance(current, case_models.UniformCurrent):
        return np.asarray(current.velocity, dtype=float)
    if current != "none":
        warnings.warn(
            f"The current of {case.name} depends on the place: still water is taken. Give `current`, the "
            "velocity of the water at the bodies [m/s].",
            SensorWarning,
            stacklevel=3,
        )
    return np.zeros(3)


def _integrate(acceleration: Array, times: Array, memory: float) -> Array:
    """Integrals (q, m, 3) from nought, by the trapezoidal rule; what is older than `memory` fades.

    Gaps are bridged linearly and stay unknown: the integral goes on behind them.
    """
    unknown = ~np.isfinite(acceleration)
    acceleration = _bridged(acceleration, times)
    step = float(np.median(np.diff(times))) if times.size > 1 else 0.0
    fade = 0.5 * step / memory
    gain, keep = 0.5 * step / (1.0 + fade), (1.0 - fade) / (1.0 + fade)
    velocity = lfilter([gain, gain], [1.0, -keep], acceleration, axis=0)
    start = gain * keep ** np.arange(times.size)  # of the first reading, before which nothing moved
    velocity = velocity - start[:, None, None] * acceleration[0]
    return np.where(unknown, np.nan, velocity)


def _bridged(values: Array, times: Array) -> Array:
    """Values (q, ...) with gaps filled linearly in time; a column without any value stays unknown."""
    columns = values.reshape(times.size, -1).copy()
    for column in columns.T:
        known = np.isfinite(column)
        if known.any() and not known.all():
            column[~known] = np.interp(times[~known], times[known], column[known])
    return columns.reshape(values.shape)


def _linear_weights(sensors: Array, s: Array) -> Array:
    """Weights (p, m) of the sensors at places between them; beyond the outermost, theirs."""
    order, places = ordered_places(sensors)
    weights = np.empty((s.size, sensors.size))
    for row, index in enumerate(order):
        weights[:, index] = np.interp(s, places, np.eye(sensors.size)[row])
    return weights


def _cable_force(case: Case, s: Array, tangent: Array, acceleration: Array, velocity: Array) -> Array:
    """Force (q, 3) that moves the cable between the first and the last place."""
    cable, density = case.cable, case.water.density
    section = cable.displaced_section
    if section is None and cable.wet_weight is not None and density > 0.0:
        section = (cable.mass_per_length - cable.wet_weight / case.gravity) / density
    if section is None:
        section = outer_section(cable)
    along = np.einsum("tpc,tpc->tp", acceleration, tangent)[..., None] * tangent
    added = (
        density
        * added_mass_section(cable)
        * (cable.added_mass_normal * (acceleration - along) + cable.added_mass_tangential * along)
    )
    slip = np.einsum("tpc,tpc->tp", velocity, tangent)[..., None] * tangent
    across = velocity - slip
    drag = cable.drag_normal * np.linalg.norm(across, axis=-1, keepdims=True) * across
    drag = drag + np.pi * cable.drag_tangential * np.linalg.norm(slip, axis=-1, keepdims=True) * slip
    each = cable.mass_per_length * acceleration + added + 0.5 * density * cable.diameter * drag
    each[..., 2] += (cable.mass_per_length - density * section) * case.gravity
    return np.trapezoid(each, s, axis=1)


def _body_force(case: Case, body: case_models.Body, acceleration: Array, velocity: Array) -> Array:
    """Force (q, 3) that moves one body."""
    density = case.water.density
    speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
    force = (body.mass + body.added_mass * density * body.volume) * acceleration
    force = force + 0.5 * density * body.drag_area * speed * velocity
    force[:, 2] += (body.mass - density * body.volume) * case.gravity
    return force


def _of_time(like: xr.DataArray | xr.Dataset, values: Array, meaning: str) -> xr.DataArray:
    return xr.DataArray(values, {"time": like["time"]}, ("time",), attrs={"units": "N", "long_name": meaning})
