"""Draws a run: shapes, tensions and distances between attachments (matplotlib, imported when asked for).

Depends on: results; works on the dataset of a run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cablesim.results import check_whole, missing_variable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SNAPSHOTS = 12
"""Shapes drawn, evenly spread over the run, its first and last among them."""

LABELLED = 8
"""Attachments that get a name in the picture, and distances that get one in the legend."""

FLAT = 0.1
"""Height over width of what is seen, or width over height, below which each gets a scale of its own."""

_PLANE = 1e-6  # width of the motion, over its size, up to which it is drawn as a plane
_TURNS = np.pi * np.array([0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0])
_COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6d31"]


class PlotError(RuntimeError):
    """Nothing can be drawn; the message says why."""


@dataclass(frozen=True)
class _View:
    """Projection of world places on the paper: what is to the right, what is up."""

    title: str
    right: Array
    up: Array
    right_label: str
    up_label: str

    def __call__(self, places: Array) -> tuple[Array, Array]:
        return places @ self.right, places @ self.up


def plot_run(dataset: xr.Dataset) -> Figure:
    """Draw a run on one page of 1600 x 1000 pixels.

    Shapes at up to 12 times, from the side and from above (only the side when all motion stays in one
    vertical plane), below them the tensions against time and, where there are two attachments or
    more, the distances between neighbours; with a winch the deployed length.  A single state has its
    tension along the cable instead.  A panel whose variable was not kept says so.

    Parameters
    ----------
    dataset : Dataset
        Result of a run.

    Returns
    -------
    matplotlib.figure.Figure
        Save it with ``figure.savefig("run.png")``.

    Raises
    ------
    PlotError
        If matplotlib is missing, or the result holds nothing to draw, or not the whole cable.
    """
    figure_class = _import_figure()
    check_whole(dataset, PlotError)
    if not {"position", "tension", "end_tension", "attachment_position"} & set(dataset.data_vars):
        raise PlotError(missing_variable(dataset, "position"))
    figure = figure_class(figsize=(16, 10), dpi=100, layout="constrained")
    figure.suptitle(_title(dataset))
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.45, 1])
    top, bottom = parts
    _draw_shapes(top, dataset)
    panels = _lower_panels(dataset)
    for axes, draw in zip(bottom.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        draw(axes, dataset)
        axes.grid(alpha=0.3)
    figure.draw_without_rendering()
    for axes in top.axes:
        _keep_apart(axes)
    return figure


def _lower_panels(dataset: xr.Dataset) -> list[Callable[[Axes, xr.Dataset], None]]:
    if dataset.sizes["time"] == 1:
        return [_draw_tension_along]
    panels: list[Callable[[Axes, xr.Dataset], None]] = [_draw_tensions]
    if dataset.sizes.get("attachment", 0) > 1:
        panels.append(_draw_distances)
    if "deployed_length" in dataset:
        panels.append(_draw_deployed_length)
    return panels


def _import_figure() -> type[Figure]:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise PlotError("Drawing needs matplotlib: pip install 'cablesim[plot]'") from None
    return Figure


def _title(dataset: xr.Dataset) -> str:
    """Name of the case, and how its run ended unless all went well."""
    name, status = dataset.attrs.get("title", "cable"), dataset.attrs.get("status", "completed")
    if status == "completed":
        return str(name)
    return f"{name} ({status} at {float(dataset['time'][-1]):.4g} s)"


def _note(axes: Axes, text: str) -> None:
    """Say in an empty panel why it is empty."""
    axes.text(0.5, 0.5, text, ha="center", va="center", wrap=True, transform=axes.transAxes, color="0.4")
    axes.set(xticks=[], yticks=[])


# Shapes -----------------------------------------------------------------------------------------


def _draw_shapes(part: Any, dataset: xr.Dataset) -> None:
    if "position" not in dataset:
        _note(part.subplots(), missing_variable(dataset, "position"))
        return
    drawn = dataset.isel(time=np.flatnonzero(_is_somewhere(dataset)))
    if drawn.sizes["time"] == 0:
        _note(part.subplots(), "No position of the result is a number.")
        return
    _draw_views(part, drawn)


def _is_somewhere(dataset: xr.Dataset) -> NDArray[np.bool_]:
    """Whether any node has a place (time,)."""
    return np.asarray(dataset["position"].notnull().all("axis").any("node").values)


def _draw_views(part: Any, dataset: xr.Dataset) -> None:
    position = dataset["position"].transpose("time", "node", "axis").values
    shown = snapshot_indices(dataset["time"].values, position)
    views = _views(_there(position.reshape(-1, 3)))
    panels = part.subplots(1, len(views), squeeze=False)[0]
    colour = _colour_scale(dataset["time"].values[shown])
    for axes, view in zip(panels, views, strict=True):
        for index in shown:
            x, y = view(position[index])
            axes.plot(x, y, color=colour.to_rgba(dataset["time"].values[index]), lw=1.4)
        last = np.stack(view(_there(position[shown[-1]])), axis=1)
        _mark_attachments(axes, view, dataset, shown, colour)
        _name_attachments(axes, view, dataset, last)
        _mark_ends(axes, last)
        axes.set(title=view.title, xlabel=view.right_label, ylabel=view.up_label)
        _set_scales(axes, view, _there(position[shown].reshape(-1, 3)))
        axes.grid(alpha=0.3)
    if shown.size > 1:
        part.colorbar(colour, ax=list(panels), label="time [s]", pad=0.01, fraction=0.03, aspect=25)


def _set_scales(axes: Axes, view: _View, places: Array) -> None:
    """One scale for both directions, unless that would make a line of what is seen; the title says so."""
    axes.margins(0.08)
    spans = [float(np.ptp(along)) for along in view(places)]
    if 0.0 < min(spans) < FLAT * max(spans):
        axes.set_title(f"{view.title}, scales differ")
    else:
        axes.set_aspect("equal", adjustable="datalim")


def _there(places: Array) -> Array:
    """Leave out nodes that are not deployed."""
    return places[np.isfinite(places).all(axis=-1)]


def snapshot_indices(times: Array, position: Array) -> NDArray[np.int64]:
    """Choose times at which the shape is drawn: first, last, and more where it changes faster.

    Parameters
    ----------
    times : ndarray, shape (k,)
        [s].
    position : ndarray, shape (k, n+1, 3)
        [m].
    """
    if times.size <= SNAPSHOTS:
        return np.arange(times.size)
    moved = np.nan_to_num(np.linalg.norm(np.diff(position, axis=0), axis=2)).mean(axis=1)
    clock = np.diff(times) / (times[-1] - times[0]) + moved / max(moved.sum(), 1e-300)
    passed = np.concatenate(([0.0], np.cumsum(clock)))
    wanted = np.linspace(0.0, passed[-1], SNAPSHOTS)
    return np.unique(np.abs(passed[:, None] - wanted).argmin(axis=0))


def _colour_scale(times: Array) -> Any:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    last = times[-1] if times[-1] > times[0] else times[0] + 1.0
    # the light end of viridis is lost on white
    return ScalarMappable(Normalize(times[0], last), _darker_viridis())


def _darker_viridis() -> Any:
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("viridis_dark", colormaps["viridis"](np.linspace(0, 0.9, 256)))


def _views(places: Array) -> list[_View]:
    """Side and top view, or the plane in which all places (m, 3) lie."""
    up = np.array([0.0, 0.0, 1.0])
    horizontal = places[:, :2] - places[:, :2].mean(axis=0)
    _, size, axes = np.linalg.svd(horizontal, full_matrices=False)
    extent = np.ptp(places, axis=0)
    if size[-1] <= _PLANE * np.linalg.norm(places - places.mean(axis=0)):
        return [_plane_view(axes[0], extent, up)]
    letter, right = ("x", [1.0, 0.0, 0.0]) if extent[0] >= extent[1] else ("y", [0.0, 1.0, 0.0])
    side = _View("side view", np.array(right), up, f"{letter} [m]", "z [m]")
    top = _View("top view", np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), "x [m]", "y [m]")
    return [side, top]


def _plane_view(direction: Array, extent: Array, up: Array) -> _View:
    if extent[:2].max() <= _PLANE * extent.max():
        direction = np.array([1.0, 0.0])
    direction = direction * (1.0 if direction[np.abs(direction).argmax()] > 0 else -1.0)
    title = "side view (all motion is in this plane)"
    for letter, axis in (("x", [1.0, 0.0]), ("y", [0.0, 1.0])):
        if np.abs(direction - axis).max() < 1e-6:
            return _View(title, np.array([*axis, 0.0]), up, f"{letter} [m]", "z [m]")
    label = f"distance along ({direction[0]:.3f}, {direction[1]:.3f}) [m]"
    return _View(title, np.array([*direction, 0.0]), up, label, "z [m]")


def _mark_ends(axes: Axes, shape: Array) -> None:
    """Letters beyond the ends of the last shape (n, 2)."""
    if len(shape) < 2:
        return
    axes.plot(*shape[[0, -1]].T, "s", color="0.2", ms=5, zorder=5, ls="")
    for letter, place, outward in (
        ("A", shape[0], shape[0] - shape[1]),
        ("B", shape[-1], shape[-1] - shape[-2]),
    ):
        _write(axes, letter, place, _unit(outward), weight="bold")


def _mark_attachments(
    axes: Axes, view: _View, dataset: xr.Dataset, shown: NDArray[np.int64], colour: Any
) -> None:
    """Dots at every shape."""
    if "attachment_position" not in dataset:
        return
    places = dataset["attachment_position"].transpose("time", "attachment", "axis").values
    times = dataset["time"].values
    for index in shown:
        x, y = view(places[index])
        axes.plot(x, y, "o", ms=5, mfc=colour.to_rgba(times[index]), mec="black", mew=0.6, zorder=4, ls="")


def _name_attachments(axes: Axes, view: _View, dataset: xr.Dataset, shape: Array) -> None:
    """Names beside the last shape (n, 2), on its outer side."""
    if "attachment_position" not in dataset or dataset.sizes["attachment"] > LABELLED:
        return
    last = dataset["attachment_position"].isel(time=-1).transpose("attachment", "axis").values
    places = np.stack(view(last), axis=1)
    middle = _there(places).mean(axis=0) if len(_there(places)) > 1 else shape.mean(axis=0)
    for name, place in zip(dataset["attachment"].values, places, strict=True):
        if not np.isfinite(place).all():
            continue
        nearest = int(np.linalg.norm(shape - place, axis=1).argmin())
        along = shape[min(nearest + 1, len(shape) - 1)] - shape[max(nearest - 1, 0)]
        aside = np.array([-along[1], along[0]])
        aside *= 1.0 if aside @ (place - middle) >= 0 else -1.0
        _write(axes, str(name), place, _unit(aside))


def _keep_apart(axes: Axes) -> None:
    """Turn and move labels, once all is laid out, until none covers another or an end's letter."""
    labels: list[Any] = [text for text in axes.texts if hasattr(text, "xyann")]
    placed: list[Any] = []
    for label in reversed(labels):  # the letters of the ends first
        wanted = np.array(label.xyann)
        for reach, angle in ((reach, angle) for reach in (1.0, 2.0, 3.0) for angle in _TURNS):
            turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ wanted
            label.xyann = tuple(reach * turned)
            label.set(**_alignment(_unit(turned)))
            box = label.get_window_extent()
            if not any(box.overlaps(other) for other in placed):
                break
        placed.append(box)


def _alignment(direction: Array) -> dict[str, Any]:
    """Side of a text that is at its place when the text lies in a direction from it."""
    horizontal = abs(direction[0]) > 0.5
    return {
        "ha": ("left" if direction[0] > 0 else "right") if horizontal else "center",
        "va": "center" if horizontal else "bottom" if direction[1] > 0 else "top",
    }


def _unit(vector: Array) -> Array:
    norm = float(np.linalg.norm(vector))
    return vector / norm if norm > 0 else np.array([0.0, 1.0])


def _write(axes: Axes, text: str, place: Array, direction: Array, **style: Any) -> None:
    """Write a label off a place, in a direction of unit length; it stays readable on top of lines."""
    from matplotlib.patheffects import withStroke

    axes.annotate(
        text,
        (float(place[0]), float(place[1])),
        xytext=(11 * direction[0], 11 * direction[1]),
        textcoords="offset points",
        **_alignment(direction),
        fontsize=10,
        zorder=6,
        path_effects=[withStroke(linewidth=3, foreground="white")],
        **style,
    )


# Against time -----------------------------------------------------------------------------------


def _draw_tensions(axes: Axes, dataset: xr.Dataset) -> None:
    axes.set_ylabel("tension [N]")
    if not {"tension", "end_tension"} & set(dataset.data_vars):
        _note(axes, missing_variable(dataset, "tension"))
        return
    time = dataset["time"].values
    if "tension" in dataset:
        low, high = dataset["tension"].min("segment").values, dataset["tension"].max("segment").values
        axes.fill_between(time, low, high, color="0.92", lw=0, label="smallest to largest along the cable")
        for bound in (low, high):  # wider than the ends' lines, which often lie on them
            axes.plot(time, bound, color="0.7", lw=3.5)
    if "end_tension" in dataset:
        for end, colour in zip(dataset["end"].values, _COLOURS[:2], strict=True):
            values = dataset["end_tension"].sel(end=end).values
            axes.plot(time, values, color=colour, lw=1.6, label=f"end {str(end).upper()}")
    _against_time(axes, time)
    _legend(axes)


def _draw_tension_along(axes: Axes, dataset: xr.Dataset) -> None:
    axes.set(xlabel="material coordinate s, from A to B [m]", ylabel="tension [N]")
    if "tension" not in dataset:
        _note(axes, missing_variable(dataset, "tension"))
        return
    axes.plot(dataset["s_segment"].values, dataset["tension"].isel(time=0).values, color=_COLOURS[0], lw=1.6)
    axes.margins(x=0.01)


def _against_time(axes: Axes, time: Array) -> None:
    room = 0.01 * (time[-1] - time[0])
    axes.set(xlabel="time [s]", xlim=(time[0] - room, time[-1] + room))


def _begin_at_zero(axes: Axes) -> None:
    """Show zero where that costs little of the panel."""
    low, high = axes.get_ylim()
    if low < 0.6 * high:
        axes.set_ylim(0.0, high)


def _draw_distances(axes: Axes, dataset: xr.Dataset) -> None:
    axes.set_ylabel("distance between attachments [m]")
    if "attachment_position" not in dataset:
        _note(axes, missing_variable(dataset, "attachment_position"))
        return
    time = dataset["time"].values
    for number, (name, values) in enumerate(attachment_distances(dataset).items()):
        colour = _COLOURS[number] if number < LABELLED else "0.6"
        label = name if number < LABELLED else None
        axes.plot(time, values, color=colour, lw=1.6, label=label)
    _begin_at_zero(axes)
    _against_time(axes, time)
    _legend(axes)


def _draw_deployed_length(axes: Axes, dataset: xr.Dataset) -> None:
    time = dataset["time"].values
    axes.plot(time, dataset["deployed_length"].values, color=_COLOURS[0], lw=1.6)
    axes.set_ylabel("deployed length [m]")
    _against_time(axes, time)


def attachment_distances(dataset: xr.Dataset) -> dict[str, Array]:
    """Distance of each attachment from the next, and of the first from the last when there are three or more.

    Parameters
    ----------
    dataset : Dataset
        With `attachment_position`.

    Returns
    -------
    dict
        Names of the two -> distances (time,) [m].
    """
    names = [str(name) for name in dataset["attachment"].values]
    places = dataset["attachment_position"].transpose("time", "attachment", "axis").values
    pairs = [(index, index + 1) for index in range(len(names) - 1)]
    if len(names) > 2:
        pairs.append((0, len(names) - 1))
    return {
        f"{names[first]} to {names[second]}": np.linalg.norm(places[:, first] - places[:, second], axis=1)
        for first, second in pairs
    }


def _legend(axes: Axes) -> None:
    """Above the panel, where it covers no line."""
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, fontsize=9, borderaxespad=0.2
    )
