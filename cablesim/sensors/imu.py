"""What inertial sensors on the cable read: orientation, angular rate, specific force, magnetic field.

Depends on: case, scene, frames, interpolation, errors; works on the dataset of a run.

A sensor is massless and sits on the cable's axis.  Its frame is the cable's local frame (x along the
tangent) turned by its mounting; it reads at its own rate, whatever the output interval of the run was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from cablesim.case import Case
from cablesim.case import models as case_models
from cablesim.scene import Imu
from cablesim.sensors.errors import ImuErrors, add_errors
from cablesim.sensors.frames import paper_frame, transported_frame
from cablesim.sensors.interpolation import cubic_rate, follow_points, locate, read_nodes, sample_times
from cablesim.sensors.problems import SensorError
from cablesim.sensors.rotations import multiply, rotate_back

Array = NDArray[np.float64]

EARTH_FIELD = (23.0e-6, 0.0, -40.0e-6)
"""Magnetic field in the world frame [T], about that of southern France with +x magnetic north (assumed)."""

READINGS = {
    "orientation": ("1", "quaternion from the sensor to the world frame, scalar last"),
    "angular_velocity": ("rad s-1", "angular velocity in the sensor frame"),
    "specific_force": ("m s-2", "specific force in the sensor frame, g up at rest"),
    "magnetic_field": ("T", "magnetic field in the sensor frame"),
}
"""Variables of a sensor's dataset -> units and meaning."""

AXES = ["x", "y", "z"]
COMPONENTS = ["x", "y", "z", "w"]


def imu_signals(
    dataset: xr.Dataset,
    imus: Sequence[Imu] | Mapping[str, float] | None = None,
    *,
    rate: float = 100.0,
    frame: str = "transported",
    reference: str | float = "b",
    gravity: float | None = None,
    magnetic_field: ArrayLike = EARTH_FIELD,
    errors: ImuErrors | str | None = None,
    seed: int = 0,
) -> xr.Dataset:
    """Signals of inertial sensors on the cable of a run.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`, `velocity` and `acceleration`.
    imus : sequence of Imu, mapping of name to s [m], or None
        The sensors; default: those of the case that is stored with the result.
    rate : float
        Samples a second [Hz], from the first stored time on; unrelated to the output interval.
    frame : ``transported`` or ``paper``
        Local frame of the cable: the material frame of a cable without torsion (see `frames`), or the
        paper's (t, n, b), Fig. 2, which is not defined along +-y.
    reference : ``a``, ``b`` or float
        Where a transported frame does not turn about the tangent; default: the winch's end.
    gravity : float, optional
        Acceleration of gravity along -z [m/s2]; default: that of the case.
    magnetic_field : array_like, shape (3,)
        Earth's field in the world frame [T].
    errors : ImuErrors or name of a preset, optional
        What the sensors do wrong; default: nothing.
    seed : int
        Of the errors.

    Returns
    -------
    Dataset
        Dimensions ``time``, ``imu``, ``axis`` (x, y, z), ``component`` (x, y, z, w), with the
        coordinate ``s`` of each sensor and the variables ``orientation`` (quaternion from the sensor
        to the world frame, scalar last, continuous in sign), ``angular_velocity`` [rad/s],
        ``specific_force`` [m/s2] (g up at rest) and ``magnetic_field`` [T] in the sensor frame, and
        ``mounting`` (quaternion from the sensor to the cable's local frame).  NaN on the drum.

    Raises
    ------
    SensorError
        If the result lacks a variable, a sensor is not on the cable, or an argument is not understood.
    """
    chosen = _choose(dataset, imus)
    g = _gravity(dataset) if gravity is None else float(gravity)
    s = np.array([imu.position for imu in chosen])
    mounting = np.array([imu.mounting for imu in chosen])
    nodes = read_nodes(dataset)
    points = follow_points(nodes, s)
    samples = locate(nodes.times, sample_times(nodes.times, rate))
    if frame == "transported":
        local, spin = transported_frame(nodes, points, s, samples, reference)
    elif frame == "paper":
        local, spin = paper_frame(points, samples)
    else:
        raise SensorError(f"frame is {frame!r}: give 'transported' or 'paper'.")
    orientation = _continuous(multiply(local, mounting.T[:, None]))
    force = cubic_rate(samples, points.place[1], points.place[2])
    force[2] += g
    earth = np.asarray(magnetic_field, dtype=float)
    readings = [rotate_back(orientation, vector) for vector in (spin, force, earth[:, None, None])]
    attributes = {
        "title": dataset.attrs.get("title", "cable"),
        "source": dataset.attrs.get("source", "cablesim"),
        "case": dataset.attrs.get("case", ""),
        "frame": frame,
        "rate": rate,
        "gravity": g,
        "earth_field": earth,
        "errors": "none",
    }
    names = [imu.name for imu in chosen]
    arrays = {
        name: np.ascontiguousarray(np.moveaxis(part, 0, -1))
        for name, part in zip(READINGS, (orientation, *readings), strict=True)
    }
    signals = imu_dataset(samples.times, names, s, arrays, mounting, attributes)
    return signals if errors is None else add_errors(signals, errors, seed)


def imu_dataset(
    times: Array,
    names: Sequence[str],
    s: ArrayLike,
    readings: Mapping[str, Array],
    mounting: Array,
    attributes: Mapping[str, object] | None = None,
) -> xr.Dataset:
    """Dataset of sensor signals, simulated or logged: the form that the estimators take.

    Parameters
    ----------
    times : ndarray, shape (q,)
        Sampling times [s].
    names, s : sequence of str, array_like, shape (m,)
        Sensors and their material coordinates [m].
    readings : mapping of name to ndarray, shape (q, m, 4 or 3)
        ``orientation, angular_velocity, specific_force, magnetic_field`` as `imu_signals` gives them.
    mounting : ndarray, shape (m, 4)
        Quaternions from the sensor to the cable's local frame.
    attributes : mapping, optional
        Attributes of the dataset.
    """
    data: dict[str, object] = {}
    for name, (units, meaning) in READINGS.items():
        last = "component" if name == "orientation" else "axis"
        data[name] = (("time", "imu", last), readings[name], {"units": units, "long_name": meaning})
    meaning = "quaternion from the sensor to the cable's local frame, scalar last"
    data["mounting"] = (("imu", "component"), mounting, {"units": "1", "long_name": meaning})
    coordinates = {
        "time": ("time", times, {"units": "s", "long_name": "time of the sample", "axis": "T"}),
        "imu": ("imu", list(names), {"long_name": "name of the sensor"}),
        "s": (
            "imu",
            np.asarray(s, dtype=float),
            {"units": "m", "long_name": "unstretched coordinate from end A"},
        ),
        "axis": ("axis", AXES, {"long_name": "axis of the sensor frame, x along the cable before mounting"}),
        "component": ("component", COMPONENTS, {"long_name": "component of a quaternion"}),
    }
    return xr.Dataset(data, coordinates, attributes)


@lru_cache(maxsize=16)
def stored_case(text: str) -> Case:
    """The case that is stored with a result, parsed once."""
    return Case.from_yaml(text)


def _choose(dataset: xr.Dataset, imus: Sequence[Imu] | Mapping[str, float] | None) -> list[Imu]:
    straight = np.array([0.0, 0.0, 0.0, 1.0])
    if isinstance(imus, Mapping):
        chosen = [Imu(name=name, position=float(s), mounting=straight) for name, s in imus.items()]
    elif imus is not None:
        chosen = list(imus)
    else:
        text = dataset.attrs.get("case")
        if not text:
            raise SensorError("The result holds no case: name the sensors, for instance imus={'imu_1': 1.2}.")
        parts = stored_case(text).attachments
        chosen = [_from_case(part) for part in parts if isinstance(part, case_models.Imu)]
    if not chosen:
        raise SensorError("There is no IMU: add attachments of kind imu to the case, or give `imus`.")
    return chosen


def _from_case(part: case_models.Imu) -> Imu:
    quaternion = np.array([0.0, 0.0, 0.0, 1.0])
    if part.mounting is not None and part.mounting.rotation_vector is not None:
        quaternion = Rotation.from_rotvec(part.mounting.rotation_vector).as_quat()
    elif part.mounting is not None and part.mounting.quaternion is not None:
        quaternion = np.asarray(part.mounting.quaternion) / np.linalg.norm(part.mounting.quaternion)
    return Imu(name=part.name, position=part.at, mounting=quaternion)


def _gravity(dataset: xr.Dataset) -> float:
    text = dataset.attrs.get("case")
    if not text:
        raise SensorError("The result holds no case: give `gravity`, for instance 9.81.")
    return stored_case(text).gravity


def _continuous(quaternions: Array) -> Array:
    """Quaternions (4, q, m) of the same rotations whose sign does not jump from one sample to the next."""
    turned = (quaternions[:, 1:] * quaternions[:, :-1]).sum(axis=0) < 0.0
    quaternions[:, 1:] *= np.where(np.cumsum(turned, axis=0) % 2, -1.0, 1.0)
    return quaternions
