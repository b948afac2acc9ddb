"""Where to put the sensors: errors of layouts over runs, a search for better ones, a picture.

Depends on: case, plot (for its exception), and all other modules of this package.

A run is prepared once, with exact virtual sensors at all candidate places; a layout picks some of them, then
errors are added to those it picked, so that no place owes its success to a lucky sensor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.case import Case
from cablesim.plot import PlotError
from cablesim.sensors.errors import BMX160, ImuErrors, add_errors, calibrated
from cablesim.sensors.estimators import pair_curvature, rigid_arm_distance, turning_angles
from cablesim.sensors.imu import imu_signals, stored_case
from cablesim.sensors.interpolation import SensorError
from cablesim.sensors.pull import outer_force
from cablesim.sensors.shape import case_bodies, estimate_shape, shape_curvature, shape_distance
from cablesim.sensors.truth import (
    agreement_of_sign,
    errors_of,
    true_curvature,
    true_distance,
    true_outer_force,
    true_places,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

QUANTITIES = {
    "distance": ("m", "distance of the buoys, from the shape"),
    "straight arms": ("m", "distance of the buoys by equation (9)"),
    "curvature": ("m-1", "curvature at the ballast, from the shape"),
    "neighbours": ("m-1", "curvature at the ballast by equation (11)"),
    "turning": ("rad", "horizontal direction of the line between the buoys"),
    "pull": ("N", "pull of the cable outside, from the dynamics"),
    "wrong direction": ("1", "share of the time in which the direction of pull is wrong"),
}
"""Quantity that a layout is judged by -> unit and meaning."""

STATISTICS = ("rms", "max")

PULL_THRESHOLD = 0.01
"""Smallest pull that has a direction [N]."""

_STILL = 1e-3  # greatest speed of a cable at rest [m/s]


@dataclass(frozen=True)
class Sensors:
    """A kind of sensors, and how far their integrated accelerations are trusted.

    Attributes
    ----------
    errors : ImuErrors or None
        ``None``: exact.
    memory : float
        Of the velocities from them, see `outer_force` [s].
    """

    errors: ImuErrors | None = None
    memory: float = np.inf


EXACT = Sensors()
KINDS = {"exact": EXACT, "BMX160": Sensors(BMX160, 10.0), "calibrated": Sensors(calibrated(BMX160))}
"""Kinds of sensors that are compared: exact, the paper's, and those with a tenth of their constant errors."""


@dataclass(frozen=True)
class Scales:
    """Errors that count the same when a layout is judged; a quantity without a scale does not count."""

    distance: float = 0.01
    curvature: float = 1.0
    turning: float = np.radians(2.0)
    pull: float = 0.01


@dataclass(frozen=True, eq=False)
class StudyRun:
    """A run with sensors at all candidate places, and what is to be found from them.

    Attributes
    ----------
    name : str
        Of the case.
    case : Case
        What was simulated.
    signals : Dataset
        Of exact sensors at the candidate places.
    truth : mapping of quantity to ndarray, shape (q,)
        True values at the times of the signals.
    rest : float
        Seconds of rest before the run, which the signals begin with but the errors do not count.
    """

    name: str
    case: Case
    signals: xr.Dataset
    truth: Mapping[str, Array]
    rest: float

    @property
    def places(self) -> Array:
        """Candidate places [m]."""
        return self.signals["s"].values


@dataclass(frozen=True)
class Layout:
    """Places of sensors and how they did.

    Attributes
    ----------
    places : tuple of float
        Material coordinates [m].
    score : float
        Mean over runs and counted quantities of RMS error over its scale.
    """

    places: tuple[float, ...]
    score: float = field(compare=False)


def prepare_run(
    dataset: xr.Dataset, *, step: float = 0.02, rate: float = 20.0, rest: float = 10.0
) -> StudyRun:
    """Put sensors at all candidate places of a run, from its first to its last body.

    Parameters
    ----------
    dataset : Dataset
        Result of a run whose case has two buoys and a ballast between them, or more bodies.
    step : float
        Distance of candidate places [m]; bodies are always among them.
    rate : float
        Samples a second [Hz].
    rest : float
        Seconds of rest put before a run that starts from rest, in which accelerometers find their offsets.

    Raises
    ------
    SensorError
        If the result holds no case, or its case has fewer than three bodies.
    """
    text = dataset.attrs.get("case")
    if not text:
        raise SensorError("The result holds no case, which says where the buoys are: run it with cablesim.")
    case = stored_case(text)
    bodies = np.array([body.at for body in case_bodies(case)])
    if bodies.size < 3:
        raise SensorError(
            f"The case {case.name} has {bodies.size} bodies: two buoys and a ballast are needed."
        )
    places = _candidates(bodies, step)
    signals = imu_signals(dataset, {f"{s:.4f}": s for s in places}, rate=rate)
    times = signals["time"].values
    first, ballast, last = bodies[0], _ballast(case), bodies[-1]
    ends = true_places(dataset, [first, last], times)
    line = ends[:, 1] - ends[:, 0]
    force = true_outer_force(dataset, first, last, times)
    still = float(np.abs(dataset["velocity"].isel(time=0)).max()) < _STILL
    truth = {
        "distance": true_distance(dataset, first, last, times),
        "curvature": true_curvature(dataset, [ballast], times)[:, 0],
        "turning": turning_angles(_labelled(line, signals), 0.0).values,
        "pull": np.einsum("tc,tc->t", force, line) / np.linalg.norm(line, axis=-1),
    }
    before = rest if still else 0.0
    return StudyRun(case.name, case, _after_rest(signals, before), truth, before)


def _candidates(bodies: Array, step: float) -> Array:
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)) + 1)[1:] for a, b in pairwise(bodies)]
    return np.concatenate(([bodies[0]], *pieces))


def _ballast(case: Case) -> float:
    """Place of the heaviest body in water between the first and the last [m]."""
    inner = case_bodies(case)[1:-1]
    return max(inner, key=lambda body: body.mass - case.water.density * body.volume).at


def _labelled(line: Array, signals: xr.Dataset) -> xr.DataArray:
    return xr.DataArray(line, {"time": signals["time"], "axis": ["x", "y", "z"]}, ("time", "axis"))


def _after_rest(signals: xr.Dataset, rest: float) -> xr.Dataset:
    """Put the first readings before the signals for so many seconds: nothing moves until they start."""
    times = signals["time"].values
    count = round(rest / float(times[1] - times[0])) if rest > 0.0 else 0
    index = np.concatenate((np.zeros(count, dtype=int), np.arange(times.size)))
    earlier = times[0] - (times[1] - times[0]) * np.arange(count, 0, -1)
    return signals.isel(time=index).assign_coords(time=np.concatenate((earlier, times)))


# Errors of a layout -----------------------------------------------------------------------------


def layout_errors(
    run: StudyRun,
    places: ArrayLike,
    sensors: Sensors = EXACT,
    seeds: Iterable[int] = (1, 2, 3),
) -> xr.DataArray:
    """Errors of what a layout of sensors tells in a run.

    Parameters
    ----------
    run : StudyRun
        Of `prepare_run`.
    places : array_like, shape (m,)
        Material coordinates of two or more sensors [m]; the nearest candidate places are taken.
    sensors : Sensors
        What they do wrong; with errors the accelerometers' offsets are found in the rest before the run.
    seeds : iterable of int
        Sets of errors that are averaged.

    Returns
    -------
    DataArray
        ``quantity, statistic`` (`QUANTITIES`; rms and max), each in the unit of the quantity.
    """
    chosen = run.signals.isel(imu=_nearest(run.places, places))
    if sensors.errors is None:
        found = [_errors(run, chosen, 0.0, sensors.memory)]
    else:
        reads = [add_errors(chosen, sensors.errors, seed) for seed in seeds]
        found = [_errors(run, read, run.rest, sensors.memory) for read in reads]
    coordinates = {"quantity": list(QUANTITIES), "statistic": list(STATISTICS)}
    return xr.DataArray(np.mean(found, axis=0), coordinates, ("quantity", "statistic"), name="error")


def _nearest(candidates: Array, places: ArrayLike) -> NDArray[np.int64]:
    wanted = np.atleast_1d(np.asarray(places, dtype=float))
    index = np.unique(np.abs(candidates[:, None] - wanted).argmin(axis=0))
    if index.size < max(2, wanted.size):
        raise SensorError(
            f"The layout {wanted.tolist()} m has {index.size} places of the study: give two or more, "
            f"further apart than {np.diff(candidates).max():.3g} m."
        )
    return index


def _errors(run: StudyRun, signals: xr.Dataset, rest: float, memory: float) -> Array:
    """RMS and largest errors (quantity, statistic); NaN where a layout cannot tell."""
    bodies = [body.at for body in case_bodies(run.case)]
    ballast = _ballast(run.case)
    shape = estimate_shape(signals, bodies[0], bodies[-1])
    force = outer_force(signals, run.case, shape=shape, rest=rest, memory=memory)
    counted = slice(signals.sizes["time"] - run.truth["distance"].size, None)
    signals, shape, force = (part.isel(time=counted) for part in (signals, shape, force))
    turning = turning_angles(shape["position"].isel(point=-1), 0.0).values
    away = np.mod(turning - run.truth["turning"] + np.pi, 2.0 * np.pi) - np.pi
    estimates = {
        "distance": (shape_distance(shape).values, run.truth["distance"]),
        "straight arms": (_by_arms(signals, bodies[0], ballast, bodies[-1]), run.truth["distance"]),
        "curvature": (shape_curvature(shape, [ballast]).values[:, 0], run.truth["curvature"]),
        "neighbours": (_by_neighbours(signals, ballast), run.truth["curvature"]),
        "turning": (away, np.zeros_like(away)),
        "pull": (force["pull"].values, run.truth["pull"]),
    }
    rows = [_statistics(*pair) for pair in estimates.values()]
    wrong = 1.0 - agreement_of_sign(force["pull"], run.truth["pull"], PULL_THRESHOLD)
    return np.array([*rows, [wrong, wrong]])


def _statistics(estimate: Array, truth: Array) -> list[float]:
    if not np.isfinite(estimate - truth).any():
        return [np.nan] * len(STATISTICS)
    found = errors_of(estimate, truth)
    return [found[name] for name in STATISTICS]


def _by_arms(signals: xr.Dataset, first: float, ballast: float, last: float) -> Array:
    """Distance (9) with the sensors nearest to the middles of the arms, if each arm has one."""
    s, names = signals["s"].values, [str(name) for name in signals["imu"].values]
    chosen = []
    for start, end in ((first, ballast), (ballast, last)):
        inside = np.flatnonzero((s > start) & (s < end))
        if not inside.size:
            return np.full(signals.sizes["time"], np.nan)
        chosen.append(names[inside[np.abs(s[inside] - 0.5 * (start + end)).argmin()]])
    return rigid_arm_distance(signals, chosen[0], chosen[1], (ballast - first, last - ballast)).values


def _by_neighbours(signals: xr.Dataset, ballast: float) -> Array:
    """Curvature (11) of the pair of sensors whose middle is nearest to the ballast."""
    found = pair_curvature(signals)
    return found["magnitude"].isel(pair=int(np.abs(found["s"].values - ballast).argmin())).values


def compare_layouts(
    runs: Sequence[StudyRun],
    layouts: Mapping[str, ArrayLike],
    kinds: Mapping[str, Sensors] = KINDS,
) -> xr.DataArray:
    """Errors of several layouts of several kinds of sensors in several runs.

    Parameters
    ----------
    runs : sequence of StudyRun
        Of `prepare_run`.
    layouts : mapping of name to array_like
        Material coordinates of the sensors of each [m].
    kinds : mapping of name to Sensors
        Kinds of sensors; default: `KINDS`.

    Returns
    -------
    DataArray
        ``layout, run, sensors, quantity, statistic``, with the coordinate ``places`` of each layout (text).
    """
    values = [
        [[layout_errors(run, places, kind) for kind in kinds.values()] for run in runs]
        for places in layouts.values()
    ]
    coordinates = {
        "layout": list(layouts),
        "run": [run.name for run in runs],
        "sensors": list(kinds),
        "quantity": list(QUANTITIES),
        "statistic": list(STATISTICS),
        "places": ("layout", [_text(places) for places in layouts.values()]),
    }
    dimensions = ("layout", "run", "sensors", "quantity", "statistic")
    return xr.DataArray(np.array(values), coordinates, dimensions, name="error")


def _text(places: ArrayLike) -> str:
    return " ".join(f"{place:.3g}" for place in np.sort(np.asarray(places, dtype=float)))


# Search -----------------------------------------------------------------------------------------


def score(found: xr.DataArray, scales: Scales | None = None) -> float:
    """RMS errors of `layout_errors` over their scales, their mean."""
    limits = vars(Scales() if scales is None else scales)
    return float(
        np.mean([found.sel(quantity=name, statistic="rms") / limit for name, limit in limits.items()])
    )


def improve_layout(
    runs: Sequence[StudyRun],
    places: ArrayLike,
    *,
    symmetric: bool = True,
    sensors: Sensors = EXACT,
    scales: Scales | None = None,
    sweeps: int = 4,
) -> Layout:
    """Move the sensors of a layout, one after the other, to where the score is best, until none moves.

    Parameters
    ----------
    runs : sequence of StudyRun
        Over which the score is the mean.
    places : array_like, shape (m,)
        Where the search starts [m].
    symmetric : bool
        Keep sensors in pairs about the ballast, and one that is on it there.
    sensors : Sensors
        Of which kind they are.
    scales : Scales, optional
        Errors that count the same.
    sweeps : int
        Most rounds over all sensors.

    Returns
    -------
    Layout
        The best one found; it depends on the start, so try a few.
    """
    candidates, ballast = runs[0].places, _ballast(runs[0].case)
    known: dict[tuple[int, ...], float] = {}

    def judge(free: Array) -> float:
        whole = _unfolded(free, ballast) if symmetric else free
        try:
            key = tuple(_nearest(candidates, whole).tolist())
        except SensorError:  # two sensors have met
            return np.inf
        if key not in known:
            found = [score(layout_errors(run, candidates[list(key)], sensors), scales) for run in runs]
            known[key] = float(np.mean(found))
        return known[key]

    free = _folded(places, ballast) if symmetric else np.sort(np.asarray(places, dtype=float))
    choices = np.unique(np.round(candidates[candidates > ballast] - ballast, 9)) if symmetric else candidates
    best = judge(free)
    for _ in range(sweeps):
        before = best
        for number in range(free.size):
            if symmetric and free[number] == 0.0:
                continue
            trials = [np.concatenate((free[:number], [choice], free[number + 1 :])) for choice in choices]
            scores = [judge(trial) for trial in trials]
            if min(scores) < best:
                best, free = min(scores), trials[int(np.argmin(scores))]
        if best == before:
            break
    whole = _unfolded(free, ballast) if symmetric else free
    return Layout(tuple(candidates[_nearest(candidates, whole)].tolist()), best)


def _folded(places: ArrayLike, ballast: float) -> Array:
    """Distances from the ballast of one half of a symmetric layout, 0 for a sensor on the ballast."""
    away = np.round(np.asarray(places, dtype=float) - ballast, 9)
    half = np.sort(away[away >= 0.0])
    if not np.allclose(_unfolded(half, ballast), np.sort(np.asarray(places, dtype=float))):
        raise SensorError(
            f"The layout {_text(places)} m is not symmetric about the ballast: say symmetric=False."
        )
    return half


def _unfolded(half: Array, ballast: float) -> Array:
    return np.sort(ballast + np.concatenate((-half[half > 0.0], half)))


# Picture ----------------------------------------------------------------------------------------


def plot_layouts(compared: xr.DataArray, layouts: Mapping[str, ArrayLike]) -> Figure:
    """Draw where the sensors of each layout are, and its RMS errors, the mean over the runs.

    Parameters
    ----------
    compared : DataArray
        Of `compare_layouts`.
    layouts : mapping of name to array_like
        The same layouts.

    Returns
    -------
    matplotlib.figure.Figure
        Save it with ``figure.savefig("placement.png")``.

    Raises
    ------
    PlotError
        If matplotlib is missing.
    """
    try:
        from matplotlib.figure import Figure
        from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
    except ImportError:
        raise PlotError("Drawing needs matplotlib: pip install 'cablesim[plot]'") from None
    shown = ["distance", "curvature", "turning", "pull"]
    figure = Figure(figsize=(16, 1.5 + 0.4 * len(layouts)), dpi=100, layout="constrained")
    panels = figure.subplots(1, 1 + len(shown), sharey=True, width_ratios=[1.6] + [1.0] * len(shown))
    rows = np.arange(len(layouts))
    for row, places in zip(rows, layouts.values(), strict=True):
        panels[0].plot(np.asarray(places), np.full(np.size(places), row), "o-", color="0.3")
    panels[0].set(yticks=rows, yticklabels=list(layouts), xlabel="s [m]", title="sensors")
    panels[0].invert_yaxis()
    for axes, name in zip(panels[1:], shown, strict=True):
        errors = compared.sel(quantity=name, statistic="rms").mean("run")
        for kind, marker in zip(compared["sensors"].values, "ox+sd^v", strict=False):
            axes.plot(errors.sel(sensors=kind), rows, marker, label=kind)
        axes.set(xscale="log", xlabel=f"RMS [{QUANTITIES[name][0]}]", title=name)
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    panels[1].legend()
    return figure
