"""What is odd about measurements as they are read.

Depends on: nothing of ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GAP = 5.0  # times the usual interval
OUTLIER = 10.0  # times what neighbours usually leave


def check_samples(name: str, times: Array, values: Array, noise: float) -> tuple[str, ...]:
    """Sentences on gaps and outliers of a recording.

    Parameters
    ----------
    name : str
        What it is the recording of.
    times : ndarray, shape (k,)
        Times of the samples [s].
    values : ndarray, shape (k, d)
        Measured [m].
    noise : float
        Standard deviation of the measurement error [m], as the case gives it.
    """
    found = (_gap(name, times), _outliers(name, times, values, noise))
    return tuple(sentence for sentence in found if sentence is not None)


def _gap(name: str, times: Array) -> str | None:
    steps = np.diff(times)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    if not gaps.size:
        return None
    longest = int(np.argmax(steps))
    return (
        f"{name}: {gaps.size} gap{'s' if gaps.size > 1 else ''} in the recording, the longest of "
        f"{steps[longest]:.3g} s at {times[longest]:.4g} s with samples every {usual:.3g} s; a smooth curve "
        "bridges them: check it there."
    )


def _outliers(name: str, times: Array, values: Array, noise: float) -> str | None:
    """Samples far from the line between their neighbours, which agree with each other."""
    if len(times) < 5:
        return None
    share = ((times[1:-1] - times[:-2]) / (times[2:] - times[:-2]))[:, None]
    between = values[:-2] + share * (values[2:] - values[:-2])
    off = np.linalg.norm(values[1:-1] - between, axis=1)
    usual = max(float(np.median(off)), noise)
    far = np.zeros(len(times), dtype=bool)
    far[1:-1] = (off > OUTLIER * usual) & (off > np.linalg.norm(values[2:] - values[:-2], axis=1))
    if usual == 0 or not far.any():
        return None
    worst = 1 + int(np.argmax(np.where(far[1:-1], off, 0.0)))
    return (
        f"{name}: {np.count_nonzero(far)} outlier{'s' if far.sum() > 1 else ''} in the recording, the worst "
        f"{off[worst - 1]:.3g} m off its neighbours at {times[worst]:.4g} s; leave its cells empty."
    )
