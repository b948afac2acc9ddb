"""A run as a film, MP4 or GIF: the cable in space, lines against time beside it (matplotlib, when asked for).

Depends on: picture, plot; works on the dataset of a run.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cablesim.picture import (
    Body,
    ImuFrames,
    Panel,
    bodies,
    imu_frames,
    node_positions,
    tension_range,
    there,
    time_panels,
)
from cablesim.plot import PlotError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

FPS = {".mp4": 25.0, ".gif": 10.0}
"""Ending of a film's name -> pictures per second, unless told otherwise."""

MOST_GIF_FRAMES = 1000
"""Pictures of a GIF: all of them are in memory until it is written, about 1 MB each."""

MOST_FRAMES = 1_000_000
"""Pictures of any film: eleven hours of it at 25 a second."""

_SIZE = {".mp4": (12.8, 7.2), ".gif": (9.6, 5.4)}  # hundreds of pixels
_COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6d31"]
_MARKS = {"buoy": ("o", "#ef8a17"), "ballast": ("s", "#44525c"), "body": ("o", "#8a6fb3")}
_TRIAD = ("#d43d2f", "#1e9255", "#2f6fe0")  # tangent, normal, binormal


def animate(
    dataset: xr.Dataset,
    path: str | Path,
    *,
    fps: float | None = None,
    speed: float = 1.0,
    comment: str = "made by cablesim",
) -> int:
    """Write a run as a film.

    Every picture shows a state of the result, the last one before its time; none is made up in between.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`.
    path : path
        File ending in ``.mp4`` (needs the program ffmpeg) or ``.gif``.
    fps : float
        Pictures per second of film [1/s]; default 25, for a GIF 10.
    speed : float
        Simulated seconds per second of film.
    comment : str
        Kept in the file, where no viewer shows it.

    Returns
    -------
    int
        Number of pictures.

    Raises
    ------
    PlotError
        If matplotlib or ffmpeg is missing, the result holds no positions, or a number makes no sense
        or a film without end.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in FPS:
        raise PlotError(f"cannot write {path}: its name must end in .mp4 or .gif.")
    fps = FPS[kind] if fps is None else fps
    for name, value in (("fps", fps), ("speed", speed)):
        if not (np.isfinite(value) and value > 0):
            raise PlotError(f"{name} must be a number above 0; received {value:g}.")
    node_positions(dataset)  # refuses what cannot be drawn before anything is written
    times = dataset["time"].values
    asked = (times[-1] - times[0]) * fps / speed
    if asked > MOST_FRAMES:
        raise PlotError(
            f"A film of {asked:.3g} pictures is too long, {MOST_FRAMES} are the most. "
            "Raise the speed, or lower the fps."
        )
    states = frame_states(times, fps, speed)
    if kind == ".gif" and states.size > MOST_GIF_FRAMES:
        raise PlotError(
            f"A GIF of {states.size} pictures is too large, {MOST_GIF_FRAMES} are the most. "
            "Raise the speed, lower the fps, or write an .mp4."
        )
    writer = _writer(kind, fps, comment)
    film = _Film(dataset.isel(time=states), dataset, _SIZE[kind])
    with writer.saving(film.figure, str(path), dpi=100):
        for index in range(states.size):
            film.show(index)
            writer.grab_frame()
    if kind == ".gif":  # its writer keeps no metadata; what follows the end of a GIF is passed over
        with path.open("ab") as film_file:
            film_file.write(comment.encode())
    return int(states.size)


def frame_states(times: Array, fps: float, speed: float) -> NDArray[np.int64]:
    """Index of the state that each picture shows: the last one before its time, then the last of all.

    Parameters
    ----------
    times : ndarray, shape (k,)
        Rising [s].
    fps : float
        Pictures per second of film [1/s].
    speed : float
        Simulated seconds per second of film.
    """
    whole = int((times[-1] - times[0]) * fps / speed + 1e-9)
    wanted = times[0] + np.arange(whole + 1) * speed / fps
    # rounding errors of the wanted times must not show the state before the one that is meant
    states = np.searchsorted(times, wanted + 1e-9 * max(abs(times[-1]), 1.0), side="right") - 1
    return states if states[-1] == times.size - 1 else np.append(states, times.size - 1)


def _writer(kind: str, fps: float, comment: str) -> Any:
    try:
        from matplotlib import animation
    except ImportError:
        raise PlotError("Drawing needs matplotlib: pip install 'cablesim[plot]'") from None
    writers: Any = animation  # declares whole numbers for fps, and takes all
    if kind == ".gif":
        return writers.PillowWriter(fps=fps)
    if not writers.FFMpegWriter.isAvailable():
        raise PlotError(
            "An .mp4 needs the program ffmpeg, which was not found. Install it (https://ffmpeg.org, or your "
            "system's package ffmpeg), or write a .gif."
        )
    return writers.FFMpegWriter(fps=fps, metadata={"comment": comment})


class _Film:
    """One page whose lines move.

    Parameters
    ----------
    shown : Dataset
        States of the pictures.
    whole : Dataset
        The run, for the lines against time.
    size : tuple
        Width and height of the page, in hundreds of pixels.
    """

    def __init__(self, shown: xr.Dataset, whole: xr.Dataset, size: tuple[float, float]) -> None:
        from matplotlib.figure import Figure

        self.figure = Figure(figsize=size, dpi=100, layout="constrained")
        self._times = shown["time"].values
        self._decimals = _decimals(self._times)
        parts: Any = self.figure.subfigures(1, 2, width_ratios=[1.5, 1])
        self._title = self.figure.suptitle(" ", family="monospace")
        self._name = str(shown.attrs.get("title", "cable"))
        self._scene = _Scene(parts[0], shown, tension_range(whole))
        self._cursors = _draw_panels(parts[1], time_panels(whole), whole["time"].values)
        self.show(0)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # laid out once: half of the work, and nothing jumps

    def show(self, index: int) -> None:
        """Draw the index-th picture."""
        time = float(self._times[index])
        self._title.set_text(f"{self._name}   t = {time:.{self._decimals}f} s")
        self._scene.show(index)
        for cursor in self._cursors:
            cursor.set_xdata([time, time])


def _decimals(times: Array) -> int:
    """Decimals that tell neighbouring times apart."""
    steps = np.diff(times)
    shortest = float(steps[steps > 0].min()) if (steps > 0).any() else 1.0
    return int(np.clip(np.ceil(-np.log10(shortest) - 1e-6), 1, 4))


# In space ---------------------------------------------------------------------------------------


class _Scene:
    """The cable in space, its attachments and IMU frames."""

    def __init__(self, part: Any, dataset: xr.Dataset, colours: tuple[float, float] | None) -> None:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        self._position = node_positions(dataset)
        self._tension = _tensions(dataset)
        self._bodies, self._places = _bodies_of(dataset)
        self._imus = imu_frames(dataset)
        self._axes = part.add_subplot(projection="3d")
        self._cable = Line3DCollection([], linewidths=2.5, cmap="viridis", capstyle="round")
        self._axes.add_collection3d(self._cable, autolim=False)
        self._ends = [self._mark("s", "0.15", f" {letter}") for letter in "AB"]
        self._marks = [self._mark(*_MARKS[body.kind], f" {body.name}") for body in self._bodies]
        self._triads = [self._axes.plot([], [], [], color=colour, lw=1.6)[0] for colour in _TRIAD]
        self._set_limits()
        self._colour(part, colours)

    def _mark(self, marker: str, colour: str, name: str) -> tuple[Artist, Artist]:
        (dot,) = self._axes.plot([], [], [], marker, color=colour, mec="white", ms=8, zorder=5)
        return dot, self._axes.text(0.0, 0.0, 0.0, name, fontsize=8, zorder=6)

    def _set_limits(self) -> None:
        """One scale for all axes, in a box that holds the whole run."""
        places = self._position[there(self._position)]
        low, high = places.min(axis=0), places.max(axis=0)
        half = np.maximum(0.53 * (high - low), 0.12 * max(float((high - low).max()), 1e-3))
        middle = 0.5 * (low + high)
        for name, centre, reach in zip("xyz", middle, half, strict=True):
            self._axes.set(**{f"{name}lim": (centre - reach, centre + reach)})
            getattr(self._axes, f"set_{name}label")(f"{name} [m]", labelpad=2 if name == "z" else 8)
        self._axes.set_box_aspect(half, zoom=1.02)
        self._axes.view_init(elev=20, azim=-60 if half[0] >= half[1] else -30)
        self._axes.locator_params(nbins=5)
        self._length = 0.06 * 2 * float(half.max())

    def _colour(self, part: Any, colours: tuple[float, float] | None) -> None:
        """Colour the cable by its tension, where that was kept."""
        if colours is None:
            self._cable.set_color(_COLOURS[0])
            return
        self._cable.set_clim(*colours)
        part.colorbar(
            self._cable, ax=self._axes, label="tension [N]", location="bottom", fraction=0.03, pad=0.02
        )

    def show(self, index: int) -> None:
        """Move everything to the index-th picture."""
        nodes = np.flatnonzero(there(self._position[index]))
        shape = self._position[index][nodes]
        self._cable.set_segments(np.stack((shape[:-1], shape[1:]), axis=1))
        if self._tension is not None:
            # the last segment is the winch's when nodes before the outlet are on the drum
            segments = np.append(nodes[:-2], self._tension.shape[1] - 1)[: max(nodes.size - 1, 0)]
            self._cable.set_array(self._tension[index][segments])
        ends = shape[[0, -1]] if nodes.size else np.full((2, 3), np.nan)
        for marks, places in ((self._ends, ends), (self._marks, self._places[index])):
            for mark, place in zip(marks, places, strict=True):
                _move(mark, place)
        for number, line in enumerate(self._triads):
            line.set_data_3d(*_whiskers(self._imus, index, number, self._length))


def _move(mark: tuple[Any, Any], place: Array) -> None:
    dot, name = mark
    visible = bool(there(place))
    dot.set_visible(visible)
    name.set_visible(visible)
    if visible:
        dot.set_data_3d(*place[:, None])
        name.set_position_3d(place)


def _whiskers(imus: ImuFrames, index: int, axis: int, length: float) -> Array:
    """One line (3, m) through all axes of a kind, interrupted between IMUs."""
    start = imus.position[index]
    parts = np.stack((start, start + length * imus.axes[index, :, axis], np.full_like(start, np.nan)), axis=1)
    return parts.reshape(-1, 3).T


def _tensions(dataset: xr.Dataset) -> Array | None:
    return dataset["tension"].transpose("time", "segment").values if "tension" in dataset else None


def _bodies_of(dataset: xr.Dataset) -> tuple[list[Body], Array]:
    """Attachments and their places (time, attachment, 3)."""
    if "attachment_position" not in dataset:
        return [], np.empty((dataset.sizes["time"], 0, 3))
    return bodies(dataset), dataset["attachment_position"].transpose("time", "attachment", "axis").values


# Against time -----------------------------------------------------------------------------------


def _draw_panels(part: Any, panels: list[Panel], time: Array) -> list[Any]:
    """Draw the lines once; only the cursors, which are returned, move."""
    cursors = []
    room = 0.01 * max(time[-1] - time[0], 1e-3)
    for axes, panel in zip(part.subplots(len(panels), 1, squeeze=False)[:, 0], panels, strict=True):
        axes.set_ylabel(f"{panel.title.lower()} [{panel.unit}]", fontsize=8)
        axes.tick_params(labelsize=8)
        if panel.note:
            axes.text(0.5, 0.5, panel.note, ha="center", va="center", wrap=True, transform=axes.transAxes)
            axes.set(xticks=[], yticks=[])
            continue
        _draw_lines(axes, panel, time)
        axes.set_xlim(time[0] - room, time[-1] + room)
        cursors.append(axes.axvline(time[0], color="0.2", lw=1))
    part.supxlabel("time [s]", fontsize=9)
    return cursors


def _draw_lines(axes: Axes, panel: Panel, time: Array) -> None:
    if panel.band:
        axes.fill_between(time, *panel.band, color="0.88", lw=0, label="smallest to largest")
    for number, (label, values) in enumerate(panel.lines.items()):
        axes.plot(time, values, color=_COLOURS[number % len(_COLOURS)], lw=1.4, label=label)
    axes.grid(alpha=0.3)
    if len(panel.lines) > 1 or panel.band:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 0.98), fontsize=7, frameon=False, ncols=4, handlelength=1
        )
