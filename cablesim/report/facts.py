"""Key numbers of a run.

Depends on: plot, results; works on the dataset of a run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cablesim.plot import attachment_distances
from cablesim.results import material_coordinates, segment_coordinates

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fact:
    """A number, or the two ends of a range, with the unit and what else there is to say."""

    label: str
    values: tuple[float, ...]
    unit: str
    detail: str = ""


def key_facts(dataset: xr.Dataset) -> list[Fact]:
    """Key numbers, as far as the result holds what they are made of.

    Parameters
    ----------
    dataset : Dataset
        Result of a run.
    """
    facts = [_duration(dataset)]
    for name, describe in _DESCRIBED.items():
        if name in dataset and bool(dataset[name].notnull().any()):
            facts += describe(dataset)
    return facts


def _duration(dataset: xr.Dataset) -> Fact:
    time, wall = float(dataset["time"][-1]), float(dataset.attrs.get("wall_seconds", 0.0))
    detail = f"in {wall:.3g} s, {time / wall:.3g} x real time" if wall > 0 else ""
    return Fact("Simulated", (time,), "s", detail)


def _tension(dataset: xr.Dataset) -> list[Fact]:
    tension = dataset["tension"].transpose("time", "segment").values
    time, segment = np.unravel_index(np.nanargmax(tension), tension.shape)
    where = f"s = {_number(segment_coordinates(dataset)[time, segment])} m"
    detail = f"largest at {_number(dataset['time'][time])} s, {where}"
    return [Fact("Tension", (float(np.nanmin(tension)), float(np.nanmax(tension))), "N", detail)]


def _speed(dataset: xr.Dataset) -> list[Fact]:
    speed = np.linalg.norm(dataset["velocity"].transpose("time", "node", "axis").values, axis=2)
    time, node = np.unravel_index(np.nanargmax(speed), speed.shape)
    detail = (
        f"at {_number(dataset['time'][time])} s, s = {_number(material_coordinates(dataset)[time, node])} m"
    )
    return [Fact("Largest speed of a node", (float(speed[time, node]),), "m/s", detail)]


def _distance(dataset: xr.Dataset) -> list[Fact]:
    """Distance of the first attachment from the last: the gap of the buoys."""
    if dataset.sizes["attachment"] < 2:
        return []
    label, values = list(attachment_distances(dataset).items())[-1]
    return _range(label, values)


def _deployed(dataset: xr.Dataset) -> list[Fact]:
    return _range("Deployed length", dataset["deployed_length"].values)


def _range(label: str, values: Array) -> list[Fact]:
    if not np.isfinite(values).any():
        return []
    least, most = float(np.nanmin(values)), float(np.nanmax(values))
    if least == most:
        return [Fact(label, (least,), "m", "unchanged")]
    return [Fact(label, (least, most), "m", f"first {_number(values[0])} m, last {_number(values[-1])} m")]


def _closure(dataset: xr.Dataset) -> list[Fact]:
    return [Fact("Closure error", (float(dataset["closure_error"].max()),), "m", "largest of the run")]


def _number(value: object) -> str:
    return f"{float(value):.4g}"  # type: ignore[arg-type]


_DESCRIBED: dict[str, Callable[[xr.Dataset], list[Fact]]] = {
    "tension": _tension,
    "attachment_position": _distance,
    "deployed_length": _deployed,
    "velocity": _speed,
    "closure_error": _closure,
}
