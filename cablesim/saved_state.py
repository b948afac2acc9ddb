"""Read the state at one time from a result file.

Depends on: scene.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablesim.scene import SavedState, Vector

NEEDED = {
    "time": ("time",),
    "s": ("node",),
    "position": ("time", "node", "axis"),
    "velocity": ("time", "node", "axis"),
    "tension": ("time", "segment"),
}
"""Variables of a file that holds states -> their dimensions."""

STATE = ("position", "velocity", "tension")


class SavedStateError(ValueError):
    """A result file does not hold the state asked for; the message says what it holds."""


def read_saved_state(path: str | Path, time: float | None) -> SavedState:
    """State of an earlier run.

    With a winch the file has a place for every node of the whole cable.  Nodes on the drum are NaN,
    and the last place is that of the outlet, end B: its material coordinate is the deployed length.
    The last segment is the one that ends there.

    Parameters
    ----------
    path : path
        Result file written by `cablesim.write`.
    time : float or None
        Simulated time [s], which must be one of the file's; ``None`` takes the last.

    Returns
    -------
    SavedState
        Nodes that were deployed then.

    Raises
    ------
    SavedStateError
        When the file is not netCDF, a variable is missing, or the time is not in it.
    """
    import netCDF4

    try:
        with netCDF4.Dataset(path) as file:
            missing = [name for name in NEEDED if name not in file.variables]
            if missing:
                raise SavedStateError(
                    f"{path}: holds no {', '.join(missing)}; keep position, velocity and tension in the "
                    "'output.variables' of the run that starts another."
                )
            _check_whole(path, file)
            times = np.asarray(file["time"][:])
            if not (np.diff(times) > 0).all():
                raise SavedStateError(
                    f"{path}: its times do not rise from one to the next; give a whole result."
                )
            index = _index_of(path, times, time)
            # missing numbers are masked, whatever stands for them in the file
            values = {name: np.ma.filled(file[name][index].astype(float), np.nan) for name in STATE}
            arc = _arc(path, file, index, values["position"])
    except OSError as error:
        raise SavedStateError(
            f"{path}: cannot be read as netCDF ({error}); give a file that 'run' wrote."
        ) from error
    return _deployed(path, arc, **values)


def _check_whole(path: str | Path, file: Any) -> None:
    """Refuse what was selected from a result."""
    found = {name: file[name].dimensions for name in NEEDED}
    if found != NEEDED or len(file.dimensions["time"]) == 0:
        raise SavedStateError(
            f"{path}: holds no times, or not all dimensions of a result; give a whole result."
        )
    nodes, segments = len(file.dimensions["node"]), len(file.dimensions["segment"])
    if nodes != segments + 1:
        raise SavedStateError(
            f"{path}: holds a part of a cable, {nodes} nodes and {segments} segments; give a whole result."
        )


def _index_of(path: str | Path, times: Vector, time: float | None) -> int:
    if time is None:
        return times.size - 1
    index = int(np.argmin(np.abs(times - time)))
    if abs(times[index] - time) > 1e-6 * max(1.0, abs(time)):
        raise SavedStateError(
            f"{path}: has no state at {time:g} s; it holds {times[0]:g} to {times[-1]:g} s, the nearest is "
            f"{times[index]:g} s."
        )
    return index


def _arc(path: str | Path, file: Any, index: int, position: Vector) -> Vector:
    """Material coordinates of the nodes at one time; with a winch the last is the deployed length."""
    arc = np.array(file["s"][:], dtype=float)
    if "deployed_length" in file.variables:
        arc[-1] = float(file["deployed_length"][index])
    elif np.isfinite(position[-1]).all() and np.isnan(position).any():
        raise SavedStateError(
            f"{path}: holds part of a cable and no deployed_length; keep deployed_length in the "
            "'output.variables' of the run that starts another."
        )
    return arc


def _deployed(
    path: str | Path, arc: Vector, position: Vector, velocity: Vector, tension: Vector
) -> SavedState:
    """The part of the arrays that is in the water; nodes on the drum are NaN."""
    there: NDArray[np.bool_] = np.asarray(np.isfinite(position).all(axis=1))
    segments = there[1:] & there[:-1]
    segments[-1] = True  # it ends at the outlet, wherever its other end is
    state = SavedState(
        arc=arc[there], positions=position[there], velocities=velocity[there], tension=tension[segments]
    )
    if there.sum() < 2 or not all(np.isfinite(part).all() for part in (state.velocities, state.tension)):
        raise SavedStateError(f"{path}: numbers of the state are not finite; choose an earlier time.")
    return state
