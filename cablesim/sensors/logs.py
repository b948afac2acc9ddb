"""Sensor signals as tables (CSV) with the field names of ROS 2, written from simulations and read from logs.

Depends on: case, imu, problems.

One file for each sensor.  The columns are the fields of sensor_msgs/Imu and sensor_msgs/MagneticField in SI:
``header.stamp.sec, header.stamp.nanosec, header.frame_id, orientation.x ... w, angular_velocity.x ... z,
linear_acceleration.x ... z`` (the specific force, gravity included, as ROS means it) and
``magnetic_field.x ... z``; before them ``time`` [s], for readers that want one number.
"""

from __future__ import annotations

import csv
import difflib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from cablesim.case import Case
from cablesim.sensors.imu import AXES, COMPONENTS, imu_dataset
from cablesim.sensors.problems import SensorError, SensorWarning

Array = NDArray[np.float64]

FIELDS = {
    "orientation": "orientation",
    "angular_velocity": "angular_velocity",
    "specific_force": "linear_acceleration",
    "magnetic_field": "magnetic_field",
}
"""Variable of the dataset -> field of the ROS 2 messages."""

_PLAIN = [0.0, 0.0, 0.0, 1.0]
_STAMP = ["header.stamp.sec", "header.stamp.nanosec"]
_UNIT = 0.01  # largest error of the length of a quaternion that rounding explains
_IN_G = (0.5, 2.0)  # specific force at rest when it is in g, not in m/s2


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
        column: sensor[name].values[:, index]
        for name in FIELDS
        for index, column in enumerate(_columns_of(name))
    }


def _parts(name: str) -> list[str]:
    return COMPONENTS if name == "orientation" else AXES


def _columns_of(name: str) -> list[str]:
    return [f"{FIELDS[name]}.{part}" for part in _parts(name)]


_KNOWN = ["time", *_STAMP, "header.frame_id", *(column for name in FIELDS for column in _columns_of(name))]


def read_imu_csv(
    files: Mapping[str, str | Path],
    positions: Mapping[str, float],
    mountings: Mapping[str, ArrayLike] | None = None,
    *,
    case: Case | None = None,
) -> xr.Dataset:
    """Logs of real sensors in the form that the estimators take.

    Sensors that were not sampled together are brought to the times of the first one, as far as all of them
    reach: vectors linearly, orientations by the shortest turn.  Nothing is made up in gaps.

    Parameters
    ----------
    files : mapping of name to path
        One table for each sensor, with the columns of this module; ``time`` or the stamp, and whatever
        fields the sensor has (a field that is absent becomes NaN).  Other columns are left alone.
    positions : mapping of name to float
        Material coordinate s of each sensor [m].
    mountings : mapping of name to array_like, shape (4,), optional
        Quaternion from sensor to the cable's local frame, scalar last; default: x along the cable.
    case : Case, optional
        Of the cable on which the sensors are: kept with the signals for the estimators, which otherwise
        have to be told how the cable bends, where its bodies are and what they weigh.

    Raises
    ------
    SensorError
        If a table lacks its time or any field, has a part of a field only, a column whose name is nearly that
        of one that is missing, something that is no number, or a quaternion that is none; if a position or
        mounting is missing or of no sensor, or no time is common to all.
    OSError
        If a file cannot be read.

    Warns
    -----
    SensorWarning
        If a table has no orientation, rows in which something is missing, or forces that look like g.
    """
    _check_names(files, positions, mountings or {})
    logs = [_read_table(Path(file)) for file in files.values()]
    start, end = max(log["time"][0, 0] for log in logs), min(log["time"][-1, 0] for log in logs)
    times = logs[0]["time"][:, 0]
    times = times[(times >= start) & (times <= end)]
    if not times.size:
        raise SensorError(f"The logs of {', '.join(files)} have no time in common: check their clocks.")
    readings = {name: np.stack([_resample(log, name, times) for log in logs], axis=1) for name in FIELDS}
    mounting = np.array([(mountings or {}).get(name, _PLAIN) for name in files], dtype=float)
    attributes = {} if case is None else {"case": case.to_yaml()}
    s = [positions[name] for name in files]
    return imu_dataset(times, list(files), s, readings, mounting, attributes)


def _check_names(
    files: Mapping[str, str | Path], positions: Mapping[str, float], mountings: Mapping[str, ArrayLike]
) -> None:
    missing = [name for name in files if name not in positions]
    if missing or not files:
        what = f"no position for {missing[0]!r}" if missing else "no files"
        raise SensorError(f"There is {what}: name one file and one s [m] for each sensor.")
    strangers = [name for name in mountings if name not in files]
    if strangers:
        raise SensorError(
            f"There is a mounting for {strangers[0]!r}, but no file: there are {', '.join(files)}."
        )


def _read_table(file: Path) -> dict[str, Array]:
    """Time (q, 1) and fields (q, 3 or 4) of a log; NaN where a field is absent or not known."""
    with file.open(newline="", encoding="utf-8-sig") as stream:
        rows = csv.reader(stream)
        header = [name.strip() for name in next(rows, [])]
        body, lines = [], []
        for row in rows:
            if row:
                body.append(row)
                lines.append(rows.line_num)
    _check_header(file, header)
    columns = {name: index for index, name in enumerate(header)}

    def read(names: Sequence[str]) -> Array:
        if not set(names) <= set(columns):
            return np.full((len(body), len(names)), np.nan)
        values = np.empty((len(body), len(names)))
        for number, row in enumerate(body):
            try:
                values[number] = [float(row[columns[name]] or "nan") for name in names]
            except (ValueError, IndexError) as error:
                raise SensorError(
                    f"{file}, line {lines[number]}, cannot be read: {error}; {', '.join(names)} must "
                    "be numbers."
                ) from None
        return np.where(np.isfinite(values), values, np.nan)

    time = read(["time"])
    if "time" not in columns:
        stamp = read(_STAMP)
        time = stamp[:, :1] + 1e-9 * stamp[:, 1:]
    _check_time(file, time[:, 0], lines)
    fields = {name: read(_columns_of(name)) for name in FIELDS}
    fields["orientation"] = _unit_quaternions(file, fields["orientation"], lines)
    there = {name: values for name, values in fields.items() if _columns_of(name)[0] in columns}
    _warn_of_gaps(file, there, lines)
    return {"time": time, **fields}


def _check_header(file: Path, header: Sequence[str]) -> None:
    """Refuse misspelt columns, and fields of which a part is missing."""
    if "time" not in header and not set(_STAMP) <= set(header):
        raise SensorError(
            f"{file} holds no time: it needs a first line with the names of its columns, among them `time` "
            f"[s] or `{_STAMP[0]}` and `{_STAMP[1]}`; there are: {', '.join(header) or 'none'}."
        )
    missing = {name.lower(): name for name in _KNOWN if name not in header}
    for name in header:
        near = difflib.get_close_matches(name.lower(), list(missing), 1, cutoff=0.85)
        if name not in _KNOWN and near:
            raise SensorError(f"{file} has a column {name!r}: is it `{missing[near[0]]}`? Rename it.")
    for name in FIELDS:
        there = [column for column in _columns_of(name) if column in header]
        if there and len(there) < len(_parts(name)):
            lost = [column for column in _columns_of(name) if column not in header]
            raise SensorError(f"{file} has {', '.join(there)}, but not {', '.join(lost)}: give all or none.")
    if not any(_columns_of(name)[0] in header for name in FIELDS):
        raise SensorError(
            f"{file} holds no reading: give columns such as {', '.join(_columns_of('orientation'))}; "
            f"there are: {', '.join(header)}."
        )


def _check_time(file: Path, time: Array, lines: Sequence[int]) -> None:
    if not time.size:
        raise SensorError(f"{file} holds no rows under its header.")
    unknown = np.flatnonzero(np.isnan(time))
    if unknown.size:
        raise SensorError(f"{file}, line {lines[unknown[0]]}, holds no time.")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        raise SensorError(
            f"{file}, line {lines[back[0] + 1]}: time {time[back[0] + 1]:.9g} s follows {time[back[0]]:.9g} "
            "s, but must increase. Sort the rows, and drop those that repeat a time."
        )


def _unit_quaternions(file: Path, values: Array, lines: Sequence[int]) -> Array:
    """Quaternions (q, 4) of unit length, from rounded ones."""
    size = np.linalg.norm(values, axis=1)
    wrong = np.flatnonzero(np.abs(size - 1.0) > _UNIT)
    if wrong.size:
        raise SensorError(
            f"{file}, line {lines[wrong[0]]}: the orientation has the length {size[wrong[0]]:.3g}, but a "
            "unit quaternion has 1. Leave cells empty where it is not known."
        )
    rounded = np.abs(size - 1.0) > 1e-9
    return np.where(rounded[:, None], values / np.where(rounded, size, 1.0)[:, None], values)


def _warn_of_gaps(file: Path, fields: Mapping[str, Array], lines: Sequence[int]) -> None:
    """Say what a log lacks, and what looks like another unit."""
    said = []
    if "orientation" not in fields:
        said.append("has no orientation: tangents, and all that follows from them, are not known")
    for name, values in fields.items():
        lost = np.flatnonzero(np.isnan(values).any(axis=1))
        if lost.size:
            said.append(
                f"lacks {FIELDS[name]} in {lost.size} of {len(lines)} rows, first in line {lines[lost[0]]}: "
                "estimates are missing there"
            )
    force = np.linalg.norm(fields.get("specific_force", np.empty((0, 3))), axis=1)
    force = force[np.isfinite(force)]
    if force.size and _IN_G[0] < np.median(force) < _IN_G[1]:
        said.append(f"has forces of {np.median(force):.3g} m/s2 in the middle: are they in g? Give m/s2")
    for sentence in said:
        warnings.warn(f"{file} {sentence}.", SensorWarning, stacklevel=4)


def _resample(log: dict[str, Array], name: str, times: Array) -> Array:
    """Values (q, 3 or 4) at other times; NaN beside stored rows that are not known."""
    stored, values = log["time"][:, 0], log[name]
    if np.array_equal(stored, times):
        return values
    if name != "orientation":
        return np.stack([np.interp(times, stored, column) for column in values.T], axis=1)
    known = np.isfinite(values.sum(axis=1))
    after = np.searchsorted(stored, times)  # all times are within the log
    before = after - np.not_equal(stored[after], times)
    inside = known[before] & known[after]
    turned = np.full((times.size, 4), np.nan)
    if known.sum() > 1 and inside.any():
        turned[inside] = Slerp(stored[known], Rotation.from_quat(values[known]))(times[inside]).as_quat()
    return turned
