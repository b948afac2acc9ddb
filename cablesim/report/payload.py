"""The numbers that a report carries, in few bytes: base64 of little-endian 32-bit floats.

Depends on: picture, results; works on the dataset of a run.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.picture import (
    Panel,
    bodies,
    energy_panel,
    imu_frames,
    node_positions,
    tension_range,
    time_panels,
)
from cablesim.results import material_coordinates, missing_variable

MOST_NODES = 400
"""Nodes drawn; a longer list is thinned evenly, both ends kept."""

STATE_BYTES = 6_000_000
"""Room for the moving picture in the file."""

SERIES_BYTES = 1_000_000
"""Room for the lines against time in the file."""

_BYTES_PER_NUMBER = 16 / 3  # four bytes, and four letters of base64 for every three


@dataclass(frozen=True, eq=False)
class Thinning:
    """Which times and nodes of a dataset a report carries.

    Attributes
    ----------
    states : ndarray of int
        Times of the moving picture; all of them are in `series`.
    series : ndarray of int
        Times of the lines.
    nodes : ndarray of int
        Nodes of the moving picture.
    note : str
        What was left out, in a sentence.
    """

    states: NDArray[np.int64]
    series: NDArray[np.int64]
    nodes: NDArray[np.int64]
    note: str


def choose_thinning(dataset: xr.Dataset) -> Thinning:
    """Choose every k-th time and node such that a report stays small.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`.
    """
    times, all_nodes = dataset.sizes["time"], dataset.sizes["node"]
    node_step = math.ceil((all_nodes - 1) / (MOST_NODES - 1)) or 1
    nodes = _every(node_step, all_nodes)
    lines = 1 + sum(len(panel.lines) + 2 * bool(panel.band) for panel in _panels(dataset))
    series_step = _step(lines * times, SERIES_BYTES)
    numbers = 4 * nodes.size + 3 * dataset.sizes.get("attachment", 0) + 12 * _imu_count(dataset)
    state_step = series_step * _step(numbers * math.ceil(times / series_step), STATE_BYTES)
    return Thinning(
        _every(state_step, times),
        _every(series_step, times),
        nodes,
        _thinning_note((state_step, times), (series_step, times), (node_step, all_nodes)),
    )


def payload(dataset: xr.Dataset, thinning: Thinning) -> dict[str, Any]:
    """Everything that the viewer needs, ready for JSON.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`.
    thinning : Thinning
        What of it to carry.

    Returns
    -------
    dict
        Arrays as ``{"shape": [...], "data": base64}``.

    Raises
    ------
    PlotError
        If the result holds no time, or no `position`.
    """
    states, series = dataset.isel(time=thinning.states), dataset.isel(time=thinning.series)
    frames = imu_frames(states)
    carried: dict[str, Any] = {
        "time": encode(states["time"].values),
        "position": encode(node_positions(states)[:, thinning.nodes]),
        "s": encode(dataset["s"].values[thinning.nodes]),
        "outlet": encode(material_coordinates(states)[:, -1]),
        "bodies": [{"name": body.name, "kind": body.kind} for body in bodies(dataset)],
        "imus": frames.names,
        "imuPosition": encode(frames.position),
        "imuAxes": encode(frames.axes),
        "seriesTime": encode(series["time"].values),
        "panels": [_encode_panel(panel) for panel in _panels(series)],
        "profile": _encode_panel(_profile_panel(dataset, thinning)),
    }
    if "attachment_position" in dataset:
        places = states["attachment_position"].transpose("time", "attachment", "axis").values
        carried["bodyPosition"] = encode(places)
    if "tension" in dataset:
        tension = dataset["tension"].transpose("time", "segment").values
        carried["tension"] = encode(tension[thinning.states][:, _segments(thinning.nodes)])
        carried["tensionRange"] = tension_range(dataset)
        carried["profileS"] = encode(dataset["s_segment"].values[_profile_segments(dataset, thinning)])
    return carried


def encode(values: ArrayLike) -> dict[str, Any]:
    """Shape of an array and the base64 text of its numbers."""
    numbers = np.ascontiguousarray(values, dtype="<f4")
    return {"shape": list(numbers.shape), "data": base64.b64encode(numbers.tobytes()).decode("ascii")}


def _panels(dataset: xr.Dataset) -> list[Panel]:
    return [*time_panels(dataset), energy_panel(dataset)]


def _profile_panel(dataset: xr.Dataset, thinning: Thinning) -> Panel:
    """Range of the tension along the cable in the whole run."""
    title, unit = "Tension along the cable", "N"
    if "tension" not in dataset:
        return Panel(title, unit, note=missing_variable(dataset, "tension"))
    kept = dataset["tension"].isel(segment=_profile_segments(dataset, thinning))
    return Panel(title, unit, band=(kept.min("time").values, kept.max("time").values))


def _profile_segments(dataset: xr.Dataset, thinning: Thinning) -> NDArray[np.int64]:
    """Segments of the kept nodes; not the one at a winch, which has no fixed place."""
    segments = _segments(thinning.nodes)
    return segments[:-1] if "deployed_length" in dataset else segments


def _encode_panel(panel: Panel) -> dict[str, Any]:
    return {
        "title": panel.title,
        "unit": panel.unit,
        "lines": [{"label": label, "values": encode(values)} for label, values in panel.lines.items()],
        "band": [encode(bound) for bound in panel.band or ()],
        "note": panel.note,
    }


def _imu_count(dataset: xr.Dataset) -> int:
    return len(imu_frames(dataset.isel(time=[0])).names)


def _segments(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Segment after each kept node but the last two; the last segment ends at end B, or is the winch's."""
    segments = nodes[:-1].copy()
    segments[-1] = nodes[-1] - 1
    return segments


def _step(numbers: int, room: int) -> int:
    return max(1, math.ceil(numbers * _BYTES_PER_NUMBER / room))


def _every(step: int, count: int) -> NDArray[np.int64]:
    """Every `step`-th of `count`, and the last."""
    return np.unique(np.append(np.arange(0, count, step), count - 1))


def _thinning_note(states: tuple[int, int], series: tuple[int, int], nodes: tuple[int, int]) -> str:
    kept = {"state": states, "node": nodes, "value of the lines against time": series}
    left_out = [
        f"every {_ordinal(step)} {what} of {count}" for what, (step, count) in kept.items() if step > 1
    ]
    if not left_out:
        return f"All {states[1]} states and all {nodes[1]} nodes of the result are in this file."
    return (
        f"Decimated to keep this file small: it holds {', '.join(left_out)}, the last always among them. "
        "The key numbers are of the whole result."
    )


def _ordinal(number: int) -> str:
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if number % 100 in (11, 12, 13) else ending}"
