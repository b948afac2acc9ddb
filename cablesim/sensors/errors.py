"""What real inertial sensors do wrong, added to exact signals: seeded, and off unless asked for.

Depends on: problems, rotations; works on datasets of sensor signals.

Each axis of each sensor reads

    quantised(clipped((1 + scale) (signal turned by the misalignment) + bias + walk + noise)).

Constants (bias, scale, misalignment, tilt) are drawn once a run, evenly within plus or minus their limit.
White noise of one-sided density N has the standard deviation N sqrt(rate/2) in samples at `rate`: the sensor
is taken to filter at half its rate.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cablesim.sensors.problems import SensorError
from cablesim.sensors.rotations import about, multiply, turn

Array = NDArray[np.float64]

_G = 9.80665  # standard gravity, the unit of data sheets [m/s2]
_DEGREE = np.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class AxisErrors:
    """Errors of a three-axis sensor, in the unit u of its signal; all nought unless given.

    Attributes
    ----------
    bias : float
        Largest constant offset of an axis [u].
    random_walk : float
        Standard deviation of the change of the bias in a time T is this times sqrt(T) [u/sqrt(s)].
    noise_density : float
        One-sided density of white noise [u/sqrt(Hz)].
    noise : float
        White noise that does not depend on the rate, standard deviation [u].
    scale : float
        Largest error of an axis' scale factor [-].
    misalignment : float
        Largest rotation of the axes about each of them [rad].
    limit : tuple of three floats
        Largest magnitude of each axis that can be read [u].
    resolution : float
        Least significant bit [u]; 0 does not quantise.
    """

    bias: float = 0.0
    random_walk: float = 0.0
    noise_density: float = 0.0
    noise: float = 0.0
    scale: float = 0.0
    misalignment: float = 0.0
    limit: tuple[float, float, float] = (np.inf, np.inf, np.inf)
    resolution: float = 0.0


@dataclass(frozen=True, kw_only=True)
class OrientationErrors:
    """Errors of the orientation that a sensor reports: a fused estimate, taken as truth that drifts.

    Attributes
    ----------
    heading_drift : float
        Rate at which the heading runs away, up or down by chance [rad/s].
    tilt : float
        Largest constant error of the vertical, about each of the world's horizontal axes [rad].
    noise : float
        White noise of the rotation about each axis of the sensor, standard deviation [rad].
    """

    heading_drift: float = 0.0
    tilt: float = 0.0
    noise: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ImuErrors:
    """Errors of the gyroscope [rad/s], accelerometer [m/s2], magnetometer [T] and of the orientation."""

    gyroscope: AxisErrors = field(default_factory=AxisErrors)
    accelerometer: AxisErrors = field(default_factory=AxisErrors)
    magnetometer: AxisErrors = field(default_factory=AxisErrors)
    orientation: OrientationErrors = field(default_factory=OrientationErrors)
    name: str = "custom"


BMX160 = ImuErrors(
    gyroscope=AxisErrors(
        bias=3.0 * _DEGREE,
        random_walk=2e-4 * _DEGREE,  # assumed: the data sheet gives none; some degrees an hour
        noise_density=0.007 * _DEGREE,
        scale=0.03,  # not verified
        misalignment=0.02,  # not verified: cross-axis sensitivity of 2 %
        limit=(250.0 * _DEGREE,) * 3,
        resolution=500.0 / 2**16 * _DEGREE,
    ),
    accelerometer=AxisErrors(
        bias=0.040 * _G,
        random_walk=2e-5 * _G,  # assumed: the data sheet gives none
        noise_density=180e-6 * _G,
        scale=0.01,  # not verified
        misalignment=0.01,  # not verified: cross-axis sensitivity of 1 %
        limit=(2.0 * _G,) * 3,
        resolution=4.0 / 2**16 * _G,
    ),
    magnetometer=AxisErrors(
        bias=1e-6,  # assumed: what is left of the offset (40 uT and more) after the usual calibration
        noise=0.6e-6,  # regular preset; 1.4 uT in the low-power one
        scale=0.02,  # not verified
        misalignment=0.01,  # not verified
        limit=(1150e-6, 1150e-6, 2500e-6),
        resolution=0.3e-6,
    ),
    orientation=OrientationErrors(
        heading_drift=0.01 * _DEGREE,  # the paper, Section V-A
        tilt=0.5 * _DEGREE,  # assumed: 9 mg of the accelerometer's offset are left in what tells the vertical
        noise=0.1 * _DEGREE,  # assumed
    ),
    name="bmx160",
)
"""The paper's sensor (Bosch BMX160) in ranges of 2 g and 250 deg/s; typical values of its data sheet as far
as known, the others marked.  Its gyroscope's and accelerometer's offsets are those before any calibration."""

PRESETS = {"bmx160": BMX160}


def calibrated(errors: ImuErrors, left: float = 0.1) -> ImuErrors:
    """The same sensors after a calibration: a part of bias, scale, misalignment and tilt is left."""

    def better(part: AxisErrors) -> AxisErrors:
        return replace(
            part, bias=left * part.bias, scale=left * part.scale, misalignment=left * part.misalignment
        )

    return replace(
        errors,
        gyroscope=better(errors.gyroscope),
        accelerometer=better(errors.accelerometer),
        magnetometer=better(errors.magnetometer),
        orientation=replace(errors.orientation, tilt=left * errors.orientation.tilt),
        name=f"{errors.name} calibrated to {left:g}",
    )


def add_errors(signals: xr.Dataset, errors: ImuErrors | str, seed: int = 0) -> xr.Dataset:
    """Signals as sensors with errors read them.

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals`, or in the same form.
    errors : ImuErrors or name of a preset
        What the sensors do wrong.
    seed : int
        The same seed gives the same errors; sensors differ.

    Returns
    -------
    Dataset
        The same variables with errors; the attributes name the errors and the seed.

    Raises
    ------
    SensorError
        If there is no preset of that name.
    """
    model = _preset(errors) if isinstance(errors, str) else errors
    times = signals["time"].values
    random = np.random.default_rng(seed)
    changed = signals.copy()
    for name, part in (
        ("angular_velocity", model.gyroscope),
        ("specific_force", model.accelerometer),
        ("magnetic_field", model.magnetometer),
    ):
        variable = signals[name].transpose("time", "imu", "axis")
        changed[name] = variable.copy(data=read_axes(variable.values, times, part, random))
    variable = signals["orientation"].transpose("time", "imu", "component")
    reported = _report_orientation(variable.values, times, model.orientation, random)
    changed["orientation"] = variable.copy(data=reported)
    changed.attrs.update(errors=model.name, seed=seed)
    return changed


def _preset(name: str) -> ImuErrors:
    if name not in PRESETS:
        raise SensorError(f"errors are {name!r}: give one of {', '.join(PRESETS)}, or an ImuErrors.")
    return PRESETS[name]


def read_axes(signal: Array, times: Array, errors: AxisErrors, random: np.random.Generator) -> Array:
    """Readings (q, m, 3) of three-axis sensors that measure `signal` (q, m, 3) at `times` (q,)."""
    sensors = signal.shape[1]
    step = np.diff(times, prepend=times[0])
    rate = 1.0 / np.median(step[1:]) if times.size > 1 else 0.0
    constant = (sensors, 3)
    scale = random.uniform(-errors.scale, errors.scale, constant)
    bias = random.uniform(-errors.bias, errors.bias, constant)
    turns = np.array(random.uniform(-errors.misalignment, errors.misalignment, constant))
    walk = np.cumsum(np.sqrt(step)[:, None, None] * random.standard_normal(signal.shape), axis=0)
    deviation = np.hypot(errors.noise, errors.noise_density * np.sqrt(rate / 2.0))
    noise = deviation * random.standard_normal(signal.shape)
    reading = np.einsum("mij,tmj->tmi", Rotation.from_rotvec(turns).as_matrix(), signal)
    reading = (1.0 + scale) * reading + bias + errors.random_walk * walk + noise
    reading = np.clip(reading, -np.asarray(errors.limit), errors.limit)
    return errors.resolution * np.round(reading / errors.resolution) if errors.resolution > 0.0 else reading


def _report_orientation(
    orientation: Array, times: Array, errors: OrientationErrors, random: np.random.Generator
) -> Array:
    """Quaternions (q, m, 4) with a heading that drifts, a vertical that is off and a little noise."""
    shape = orientation.shape[:2]
    rates = errors.heading_drift * random.choice([-1.0, 1.0], shape[1])
    drift = about(2, (times - times[0])[:, None] * rates)
    noise = turn(np.array(errors.noise * random.standard_normal((3, *shape))))
    horizontal = random.uniform(-errors.tilt, errors.tilt, (2, 1, shape[1]))
    tilt = turn(np.concatenate((horizontal, np.zeros((1, 1, shape[1])))))
    world = multiply(multiply(drift, tilt), np.moveaxis(orientation, -1, 0))
    return np.moveaxis(multiply(world, noise), 0, -1)
