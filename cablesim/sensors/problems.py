"""What is wrong with sensors or with what is asked of them: an error, or a warning with an answer.

Depends on: nothing of ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

NEAREST = 1e-3
"""Smallest distance of two sensors along the cable [m]: nearer ones are taken for one place given twice."""


class SensorError(ValueError):
    """Sensor signals cannot be made or used; the message says what is wrong and what to do."""


class SensorWarning(UserWarning):
    """An estimate is given, but the sensors cannot well tell it; the message says why and what to do."""


def ordered_places(s: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Order of sensors along the cable, and their places in this order [m].

    Raises
    ------
    SensorError
        If there are fewer than two, or two are at the same place.
    """
    places = np.asarray(s, dtype=float)
    order = np.argsort(places)
    if places.size < 2 or (np.diff(places[order]) < NEAREST).any():
        raise SensorError(
            f"The sensors are at s = {places.tolist()} m: give two or more, each at a place of its own."
        )
    return order, places[order]


def number_of(names: Sequence[str], name: str) -> int:
    """Number of a sensor among known names.

    Raises
    ------
    SensorError
        If it is not among them.
    """
    if name not in names:
        raise SensorError(f"There is no sensor {name!r}: there are {', '.join(names)}.")
    return names.index(name)
