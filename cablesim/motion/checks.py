"""Refusals of what no motion can be made of, in the words of who asked.

Depends on: nothing of ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]


def checked_vector(where: str, value: ArrayLike) -> Vector:
    """Three finite numbers."""
    vector = np.asarray(value, dtype=np.float64)
    if vector.shape != (3,):
        raise ValueError(f"{where} has shape {vector.shape}, received {value!r}; give three numbers x, y, z.")
    return checked_finite(where, vector)


def checked_table(where: str, value: ArrayLike, rows: int, columns: int) -> Vector:
    """Finite numbers, one row for each time."""
    table = np.asarray(value, dtype=np.float64)
    if table.shape != (rows, columns):
        raise ValueError(
            f"{where} has shape {table.shape}; give ({rows}, {columns}), a row for each of the {rows} times."
        )
    return checked_finite(where, table)


def checked_finite(where: str, values: Vector) -> Vector:
    """The values, where all are finite numbers."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        index = tuple(int(i) for i in bad[0])
        place = f"[{', '.join(map(str, index))}]" if index else ""
        raise ValueError(f"{where}{place} is {values[index]}; give a finite number or leave the row out.")
    return values


def check_positive(where: str, value: float) -> None:
    """Refuse what is no positive time."""
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{where} is {value!r} s; give a positive time.")


def check_increasing(where: str, times: Vector) -> None:
    """Refuse times that do not strictly increase."""
    bad = np.flatnonzero(np.diff(times) <= 0)
    if bad.size:
        index = int(bad[0]) + 1
        raise ValueError(
            f"{where}[{index}] is {times[index]:g} s after {times[index - 1]:g} s; "
            "sort the times and leave out repeated ones."
        )


def checked_waypoint_times(where: str, value: ArrayLike) -> Vector:
    """Non-decreasing times from <= 0 on, none of them more than twice."""
    times = checked_finite(where, np.asarray(value, dtype=np.float64))
    if times.ndim != 1 or times.size == 0:
        raise ValueError(f"{where} has shape {times.shape}; give at least one waypoint, shape (m,).")
    if times[0] > 0:
        raise ValueError(f"{where}[0] is {times[0]:g} s; add a waypoint at 0 s to say how the motion begins.")
    steps = np.diff(times)
    if (steps < 0).any():
        index = int(np.argmax(steps < 0)) + 1
        raise ValueError(
            f"{where}[{index}] is {times[index]:g} s after {times[index - 1]:g} s; sort the waypoints."
        )
    repeated = (steps[1:] == 0) & (steps[:-1] == 0)
    if repeated.any():
        index = int(np.argmax(repeated)) + 2
        raise ValueError(
            f"{where}[{index}] is {times[index]:g} s for the third time; "
            "two waypoints make a jump, leave the others out."
        )
    return times
