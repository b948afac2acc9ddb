"""What moving pictures of a run show: the places there are, bodies, IMU frames, lines against time.

Depends on: case, trajectory, plot, results; works on the dataset of a run.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cablesim.case import Case, CaseError
from cablesim.plot import PlotError, attachment_distances
from cablesim.results import check_whole, material_coordinates, missing_variable
from cablesim.trajectory.basis import local_basis

Array = NDArray[np.float64]

_OUTLIERS = 0.005
_ENERGIES = {"kinetic_energy": "kinetic", "elastic_energy": "stretching", "bending_energy": "bending"}


@dataclass(frozen=True)
class Body:
    """Name of an attachment, and its kind: ``buoy``, ``ballast`` or ``body``."""

    name: str
    kind: str


@dataclass(frozen=True, eq=False)
class ImuFrames:
    """Where the IMUs are and how the cable lies there.

    Attributes
    ----------
    names : list of str
        Of the k IMUs.
    position : ndarray, shape (time, k, 3)
        World places [m]; NaN on the drum.
    axes : ndarray, shape (time, k, 3, 3)
        Unit vectors: tangent, normal, binormal.
    """

    names: list[str]
    position: Array
    axes: Array


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines against time that belong on one pair of axes.

    Attributes
    ----------
    title, unit : str
        What the lines are, and their unit.
    lines : dict
        Label -> values (time,).
    band : tuple of ndarray, or None
        Smallest and largest value along the cable, each (time,).
    note : str
        Why the panel is empty, when it is.
    """

    title: str
    unit: str
    lines: dict[str, Array] = field(default_factory=dict)
    band: tuple[Array, Array] | None = None
    note: str = ""


# Places -----------------------------------------------------------------------------------------


def node_positions(dataset: xr.Dataset) -> Array:
    """World places of the nodes (time, node, 3) [m]; NaN on the drum.

    Raises
    ------
    PlotError
        If the result holds no time, no `position`, none that is a number, or not the whole cable.
    """
    check_whole(dataset, PlotError)
    if "position" not in dataset:
        raise PlotError(missing_variable(dataset, "position"))
    places = dataset["position"].transpose("time", "node", "axis").values
    if not there(places).any():
        raise PlotError("The result holds no position that is a number: there is nothing to draw.")
    return places


def there(places: Array) -> NDArray[np.bool_]:
    """Whether places (..., 3) are in the water, and not on the drum."""
    return np.asarray(np.isfinite(places).all(axis=-1))


def tension_range(dataset: xr.Dataset) -> tuple[float, float] | None:
    """Ends of a colour scale for the tension [N]; None without `tension`, or where none is a number.

    The scale leaves out 0.5 % at either end, so that a spike does not make all the rest one colour.
    """
    if "tension" not in dataset or not bool(dataset["tension"].notnull().any()):
        return None
    low, high = np.nanquantile(dataset["tension"].values, [_OUTLIERS, 1.0 - _OUTLIERS])
    return float(low), float(high)


# Bodies and IMUs --------------------------------------------------------------------------------


def bodies(dataset: xr.Dataset) -> list[Body]:
    """Attachments of a run; a body where the case does not tell more."""
    if "attachment" not in dataset.coords:
        return []
    case = _case(dataset)
    kinds = {} if case is None else {given.name: given.kind for given in case.attachments}
    names = [str(name) for name in dataset["attachment"].values]
    return [Body(name, kinds.get(name, "body")) for name in names]


def description(dataset: xr.Dataset) -> str:
    """What the case says about itself; nothing where it says nothing."""
    case = _case(dataset)
    return "" if case is None else case.description or ""


def imu_frames(dataset: xr.Dataset) -> ImuFrames:
    """Frames of the cable at its IMUs: tangent, and the paper's normal and binormal.

    The rotation between cable and sensor (`mounting`) is left out: these are not the sensors' axes.
    """
    case = _case(dataset)
    imus = [] if case is None else [given for given in case.attachments if given.kind == "imu"]
    at = np.array([imu.at for imu in imus])
    position, tangent = _along(node_positions(dataset), material_coordinates(dataset), at)
    axes = np.stack((tangent, *local_basis(tangent)), axis=2)
    axes[~there(position)] = np.nan
    return ImuFrames([imu.name for imu in imus], position, axes)


def _case(dataset: xr.Dataset) -> Case | None:
    """Case of a run; None for data of another origin or a case that is no longer understood."""
    try:
        return Case.from_yaml(dataset.attrs.get("case") or "")
    except CaseError:
        return None


def _along(nodes: Array, s: Array, at: Array) -> tuple[Array, Array]:
    """Places and unit tangents (time, k, 3) at the k material coordinates `at`; NaN on the drum."""
    places, tangents = np.full((2, len(nodes), at.size, 3), np.nan)
    for index in range(len(nodes) if at.size else 0):
        present = there(nodes[index])
        if present.sum() < 2:
            continue
        here, arc = nodes[index][present], s[index][present]
        # the last node may be a rounding error short of the end of the cable
        inside = np.where(at <= arc[-1] + 1e-9, np.minimum(at, arc[-1]), np.nan)
        places[index] = _interpolate(inside, arc, here)
        tangents[index] = _units(_interpolate(inside, arc, _node_tangents(here)))
    return places, tangents


def _interpolate(at: Array, arc: Array, values: Array) -> Array:
    return np.stack([np.interp(at, arc, column) for column in values.T], axis=1)


def _node_tangents(places: Array) -> Array:
    """Mean of the segments on both sides, as everywhere in cablesim."""
    chords = _units(np.diff(places, axis=0))
    return _units(np.concatenate((chords[:1], chords[1:] + chords[:-1], chords[-1:])))


def _units(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


# Against time -----------------------------------------------------------------------------------


def time_panels(dataset: xr.Dataset) -> list[Panel]:
    """Tensions, distances between attachments and, with a winch, deployed length and payout speed."""
    panels = [_tension_panel(dataset)]
    if dataset.sizes.get("attachment", 0) > 1:
        panels.append(_distance_panel(dataset))
    for name, title, unit in (("deployed_length", "Deployed length", "m"), ("payout_speed", "Payout", "m/s")):
        if name in dataset:
            panels.append(Panel(title, unit, {title.lower(): dataset[name].values}))
    return panels


def energy_panel(dataset: xr.Dataset) -> Panel:
    """Energies of motion, stretching and bending, as far as they were kept."""
    kept = {label: dataset[name].values for name, label in _ENERGIES.items() if name in dataset}
    return Panel("Energy", "J", kept, note="" if kept else missing_variable(dataset, "kinetic_energy"))


def _tension_panel(dataset: xr.Dataset) -> Panel:
    lines, band = {}, None
    if "end_tension" in dataset:
        ends = dataset["end_tension"].transpose("time", "end")
        lines = {f"end {str(end).upper()}": ends.sel(end=end).values for end in ends["end"].values}
    if "tension" in dataset:
        band = (dataset["tension"].min("segment").values, dataset["tension"].max("segment").values)
    note = "" if lines or band else missing_variable(dataset, "end_tension")
    return Panel("Tension", "N", lines, band, note)


def _distance_panel(dataset: xr.Dataset) -> Panel:
    title = "Distance between attachments"
    if "attachment_position" not in dataset:
        return Panel(title, "m", note=missing_variable(dataset, "attachment_position"))
    return Panel(title, "m", attachment_distances(dataset))
