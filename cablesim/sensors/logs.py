"""Sensor signals as tables (CSV) with the field names of ROS 2, written from simulations and read from logs.

Depends on: imu, interpolation (for its exception).

One file for each sensor.  The columns are the fields of sensor_msgs/Imu and sensor_msgs/MagneticField in SI:
``header.stamp.sec, header.stamp.nanosec, header.frame_id, orientation.x ... w, angular_velocity.x ... z,
linear_acceleration.x ... z`` (the specific force, gravity included, as ROS means it) and
``magnetic_field.x ... z``; before them ``time`` [s], for readers that want one number.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from cablesim.sensors.imu import AXES, COMPONENTS, imu_dataset
from cablesim.sensors.interpolation import SensorError

Array = NDArray[np.float64]

FIELDS = {
    "orientation": "orientation",
    "angular_velocity": "angular_velocity",
    "specific_force": "linear_acceleration",
    "magnetic_field": "magnetic_field",
}
"""Variable of the dataset -> field of the ROS 2 messages."""

_PLAIN = [0.0, 0.0, 0.0, 1.0]


def export_imu_csv(signals: xr.Dataset, directory: str | Path) -> list[Path]:
    """Write ``<name of the sensor>.csv`` for each sensor; numbers in full, empty cells while on the drum.

    Parameters
    ----------
    signals : Dataset
        Of `imu_signals`.
    directory : path
        Folder, made when it is not there.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    SensorError
        If two sensors would share a file.
    OSError
        If a file cannot be written.
    """
    directory = Path(directory)
    names = [str(name) for name in signals["imu"].values]
    files = [directory / f"{name.replace('/', '_')}.csv" for name in names]
    if len(set(files)) < len(files):
        raise SensorError(f"The sensors {', '.join(names)} share file names: give each a name of its own.")
    directory.mkdir(exist_ok=True)
    stamps = _stamps(signals["time"].values)
    for number, (name, file) in enumerate(zip(names, files, strict=True)):
        columns = {**stamps, "header.frame_id": np.full(signals.sizes["time"], name)}
        columns.update(_field_columns(signals.isel(imu=number)))
        table = xr.Dataset({header: ("row", values) for header, values in columns.items()})
        table.to_dataframe().to_csv(file, index=False, lineterminator="\n")
    return files


def _stamps(times: Array) -> dict[str, NDArray]:
    nanoseconds = np.round(times * 1e9).astype(np.int64)
    seconds, rest = np.divmod(nanoseconds, 1_000_000_000)
    return {"time": times, "header.stamp.sec": seconds, "header.stamp.nanosec": rest}


def _field_columns(sensor: xr.Dataset) -> dict[str, Array]:
    return {
        f"{field}.{part}": sensor[name].values[:, index]
        for name, field in FIELDS.items()
        for index, part in enumerate(_parts(name))
    }


def _parts(name: str) -> list[str]:
    return COMPONENTS if name == "orientation" else AXES


def read_imu_csv(
    files: Mapping[str, str | Path],
    positions: Mapping[str, float],
    mountings: Mapping[str, ArrayLike] | None = None,
) -> xr.Dataset:
    """Logs of real sensors in the form that the estimators take.

    Sensors that were not sampled together are brought to the times of the first one, as far as all of them
    reach: vectors linearly, orientations by the shortest turn.

    Parameters
    ----------
    files : mapping of name to path
        One table for each sensor, with the columns of this module; ``time`` or the stamp, and whatever
        fields the sensor has (a field that is absent becomes NaN).
    positions : mapping of name to float
        Material coordinate s of each sensor [m].
    mountings : mapping of name to array_like, shape (4,), optional
        Quaternion from sensor to the cable's local frame, scalar last; default: x along the cable.

    Raises
    ------
    SensorError
        If a table lacks its time, holds something that is no number, or no time is common to all.
    OSError
        If a file cannot be read.
    """
    missing = [name for name in files if name not in positions]
    if missing or not files:
        what = f"no position for {missing[0]!r}" if missing else "no files"
        raise SensorError(f"There is {what}: name one file and one s [m] for each sensor.")
    logs = [_read_table(Path(file)) for file in files.values()]
    start, end = max(log["time"][0, 0] for log in logs), min(log["time"][-1, 0] for log in logs)
    times = logs[0]["time"][:, 0]
    times = times[(times >= start) & (times <= end)]
    if not times.size:
        raise SensorError(f"The logs of {', '.join(files)} have no time in common: check their clocks.")
    readings = {name: np.stack([_resample(log, name, times) for log in logs], axis=1) for name in FIELDS}
    mounting = np.array([(mountings or {}).get(name, _PLAIN) for name in files], dtype=float)
    return imu_dataset(times, list(files), [positions[name] for name in files], readings, mounting)


def _read_table(file: Path) -> dict[str, Array]:
    """Time (q, 1) and fields (q, 3 or 4) of a log; NaN where a field is absent."""
    with file.open(newline="", encoding="utf-8-sig") as stream:
        rows = csv.reader(stream)
        header = [name.strip() for name in next(rows, [])]
        body = [row for row in rows if row]
    columns = {name: index for index, name in enumerate(header)}

    def read(names: Sequence[str]) -> Array:
        if not set(names) <= set(columns):
            return np.full((len(body), len(names)), np.nan)
        try:
            return np.array([[float(row[columns[name]] or "nan") for name in names] for row in body])
        except (ValueError, IndexError) as error:
            raise SensorError(
                f"{file} cannot be read: {error}; {', '.join(names)} must be numbers."
            ) from None

    time = read(["time"])
    if "time" not in columns:
        stamp = read(["header.stamp.sec", "header.stamp.nanosec"])
        time = stamp[:, :1] + 1e-9 * stamp[:, 1:]
    if not body or np.isnan(time).any() or (np.diff(time[:, 0]) <= 0).any():
        raise SensorError(
            f"{file} holds no increasing time: it needs rows, and a column `time` [s] or the columns "
            "`header.stamp.sec` and `header.stamp.nanosec`."
        )
    fields = {name: read([f"{field}.{part}" for part in _parts(name)]) for name, field in FIELDS.items()}
    return {"time": time, **fields}


def _resample(log: dict[str, Array], name: str, times: Array) -> Array:
    stored, values = log["time"][:, 0], log[name]
    if np.array_equal(stored, times):
        return values
    if name != "orientation":
        return np.stack([np.interp(times, stored, column) for column in values.T], axis=1)
    known = np.isfinite(values).all(axis=1)
    if known.sum() < 2:
        return np.full((times.size, 4), np.nan)
    inside = (times >= stored[known][0]) & (times <= stored[known][-1])
    turned = np.full((times.size, 4), np.nan)
    turned[inside] = Slerp(stored[known], Rotation.from_quat(values[known]))(times[inside]).as_quat()
    return turned
