"""Where to put the sensors: errors of layouts over runs, a search for better ones, a picture.

Depends on: case, plot (for its exception), and all other modules of this package.

A run is prepared once, with exact virtual sensors at all candidate places; a layout picks some of them, then
errors are added to those it picked, so that no place owes its success to a lucky sensor.

Estimators that are given the very numbers with which a run was made are judged too well: simulate a plant
that differs (stiffness, buoyancy, places, mesh) and say with `case` what the estimators believe.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.case import Case
from cablesim.plot import PlotError
from cablesim.sensors import truth as true
from cablesim.sensors.distance import rigid_arm_distance, weigh_tangents, weighted_distance
from cablesim.sensors.errors import BMX160, ImuErrors, add_errors, calibrated
from cablesim.sensors.estimators import pair_curvature, turning_angles
from cablesim.sensors.imu import imu_signals, stored_case
from cablesim.sensors.problems import SensorError, SensorWarning
from cablesim.sensors.pull import outer_force
from cablesim.sensors.shape import (
    case_bodies,
    estimate_shape,
    opening_at_rest,
    shape_curvature,
    shape_distance,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

QUANTITIES = {
    "distance": ("m", "distance of the buoys, from the shape"),
    "distance at rest": ("m", "the same, its offset taken once at rest"),
    "straight arms": ("m", "distance of the buoys by equation (9)"),
    "straight arms at rest": ("m", "the same, its offset taken once at rest"),
    "weights": ("m", "distance of the buoys from weights of all tangents, calibrated on another run"),
    "weights at rest": ("m", "the same, its offset taken once at rest"),
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
        Of the velocities from them, which are drawn to that of the vehicle, see `outer_force` [s].
    """

    errors: ImuErrors | None = None
    memory: float = np.inf


EXACT = Sensors()
KINDS = {"exact": EXACT, "BMX160": Sensors(BMX160, 10.0), "calibrated": Sensors(calibrated(BMX160))}
"""Kinds of sensors that are compared: exact, the paper's, and those with a tenth of their constant errors."""


@dataclass(frozen=True)
class Scales:
    """Errors that count the same when a layout is judged; a quantity without a scale does not count.

    The distance is that with its offset taken at rest.
    """

    distance: float = 0.01
    curvature: float = 1.0
    turning: float = np.radians(2.0)
    pull: float = 0.01

    @property
    def of_quantities(self) -> dict[str, float]:
        """Quantity that counts -> its scale."""
        return {
            "distance at rest": self.distance,
            "curvature": self.curvature,
            "turning": self.turning,
            "pull": self.pull,
        }


@dataclass(frozen=True, eq=False)
class StudyRun:
    """A run with sensors at all candidate places, and what is to be found from them.

    Attributes
    ----------
    name : str
        Of the case.
    case : Case
        What the estimators believe of the cable and its bodies.
    signals : Dataset
        Of exact sensors at the candidate places.
    truth : mapping of quantity to ndarray, shape (q,)
        True values at the times of the signals.
    rest : float
        Seconds of rest before the run, which the signals begin with but the errors do not count.
    still : bool
        Whether the run starts from rest.
    vehicle_velocity : ndarray, shape (q', 3)
        Velocity of end A at the times of the signals, which a vehicle knows from its own instruments [m/s].
    """

    name: str
    case: Case
    signals: xr.Dataset
    truth: Mapping[str, Array]
    rest: float
    still: bool
    vehicle_velocity: Array

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
    dataset: xr.Dataset,
    *,
    case: Case | None = None,
    step: float = 0.02,
    rate: float = 20.0,
    rest: float = 10.0,
) -> StudyRun:
    """Put sensors at all candidate places of a run, from its first to its last body.

    Parameters
    ----------
    dataset : Dataset
        Result of a run whose case has two buoys and a ballast between them, or more bodies.
    case : Case, optional
        What the estimators believe; default: what was simulated, which judges them too well.
    step : float
        Distance of candidate places [m]; bodies are always among them.
    rate : float
        Samples a second [Hz].
    rest : float
        Seconds of rest put before a run that starts from rest, in which accelerometers find their offsets.

    Raises
    ------
    SensorError
        If the result holds no case, or one of the cases has fewer than three bodies.
    """
    text = dataset.attrs.get("case")
    if not text:
        raise SensorError("The result holds no case, which says where the buoys are: run it with cablesim.")
    plant = stored_case(text)
    believed = plant if case is None else case
    places = _candidates(_three_bodies(believed), step)
    signals = imu_signals(dataset, {f"{s:.4f}": s for s in places}, rate=rate)
    signals.attrs["case"] = text if case is None else believed.to_yaml()
    times = signals["time"].values
    bodies = _three_bodies(plant)
    first, ballast, last = bodies[0], _ballast(plant), bodies[-1]
    line = true.places(dataset, [first, last], times).diff("point").isel(point=0)
    still = float(np.abs(dataset["velocity"].isel(time=0)).max()) < _STILL
    truth = {
        "distance": true.distance(dataset, first, last, times).values,
        "curvature": true.curvature(dataset, [ballast], times).values[:, 0],
        "turning": turning_angles(line, 0.0).values,
        "pull": true.pull(dataset, first, last, times).values,
    }
    before = rest if still else 0.0
    signals = _after_rest(signals, before)
    end_a = dataset["velocity"].isel(node=0).transpose("time", "axis").values
    vehicle = [np.interp(signals["time"], dataset["time"], part) for part in end_a.T]
    return StudyRun(plant.name, believed, signals, truth, before, still, np.stack(vehicle, axis=1))


def _three_bodies(case: Case) -> Array:
    """Places of the bodies of a case, three or more [m]."""
    bodies = np.array([body.at for body in case_bodies(case)])
    if bodies.size < 3:
        raise SensorError(
            f"The case {case.name} has {bodies.size} bodies: two buoys and a ballast are needed."
        )
    return bodies


def _candidates(bodies: Array, step: float) -> Array:
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)) + 1)[1:] for a, b in pairwise(bodies)]
    return np.concatenate(([bodies[0]], *pieces))


def _ballast(case: Case) -> float:
    """Place of the heaviest body in water between the first and the last [m]."""
    inner = case_bodies(case)[1:-1]
    return max(inner, key=lambda body: body.mass - case.water.density * body.volume).at


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
    calibration: StudyRun | None = None,
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
    calibration : StudyRun, optional
        Run with the same candidate places whose distance is known: exact sensors of the layout find their
        weights there.

    Returns
    -------
    DataArray
        ``quantity, statistic`` (`QUANTITIES`; rms and max), each in the unit of the quantity.
    """
    index = _nearest(run.places, places)
    chosen = run.signals.isel(imu=index)
    weights = None if calibration is None else _calibrate(calibration, index)
    if sensors.errors is None:
        found = [_errors(run, chosen, 0.0, sensors.memory, weights)]
    else:
        reads = [add_errors(chosen, sensors.errors, seed) for seed in seeds]
        found = [_errors(run, read, run.rest, sensors.memory, weights) for read in reads]
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


def _calibrate(run: StudyRun, index: NDArray[np.int64]) -> xr.DataArray:
    moving = run.signals.isel(imu=index, time=_counted(run))
    return weigh_tangents(moving, run.truth["distance"])


def _counted(run: StudyRun) -> slice:
    """Samples behind the rest before a run."""
    return slice(run.signals.sizes["time"] - run.truth["distance"].size, None)


def _errors(
    run: StudyRun, signals: xr.Dataset, rest: float, memory: float, weights: xr.DataArray | None
) -> Array:
    """RMS and largest errors (quantity, statistic); NaN where a layout cannot tell."""
    bodies = [body.at for body in case_bodies(run.case)]
    ballast = _ballast(run.case)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SensorWarning)  # what they warn of is what is measured here
        shape = estimate_shape(signals, bodies[0], bodies[-1])
        force = outer_force(
            signals,
            run.case,
            shape=shape,
            rest=rest,
            memory=memory,
            vehicle_velocity=run.vehicle_velocity,
        )
        opened = _opened_at_rest(run, signals, bodies[0], bodies[-1])
    arms = _by_arms(signals, bodies[0], ballast, bodies[-1])
    weighted = np.full(arms.shape, np.nan) if weights is None else weighted_distance(signals, weights).values
    counted = _counted(run)
    turning = turning_angles(shape["position"].isel(point=-1, time=counted), 0.0).values
    away = np.mod(turning - run.truth["turning"] + np.pi, 2.0 * np.pi) - np.pi
    distance, curvature = run.truth["distance"], run.truth["curvature"]
    estimates = {
        "distance": (shape_distance(shape).values[counted], distance),
        "distance at rest": (opened[counted], distance),
        "straight arms": (arms[counted], distance),
        "straight arms at rest": (_offset_at_rest(run, arms)[counted], distance),
        "weights": (weighted[counted], distance),
        "weights at rest": (_offset_at_rest(run, weighted)[counted], distance),
        "curvature": (shape_curvature(shape, [ballast]).values[counted, 0], curvature),
        "neighbours": (_by_neighbours(signals, ballast)[counted], curvature),
        "turning": (away, np.zeros_like(away)),
        "pull": (force["pull"].values[counted], run.truth["pull"]),
    }
    rows = [_statistics(*pair) for pair in estimates.values()]
    wrong = 1.0 - true.agreement_of_sign(force["pull"].values[counted], run.truth["pull"], PULL_THRESHOLD)
    return np.array([*rows, [wrong, wrong]])


def _at_rest(run: StudyRun) -> slice:
    """Samples of the rest before a run and its first one."""
    return slice(0, _counted(run).start + 1)


def _offset_at_rest(run: StudyRun, distance: Array) -> Array:
    """Distances (q,) moved by what they are off at rest; unknown where a run does not start there."""
    if not run.still:
        return np.full(distance.shape, np.nan)
    return distance - distance[_at_rest(run)].mean() + run.truth["distance"][0]


def _opened_at_rest(run: StudyRun, signals: xr.Dataset, first: float, last: float) -> Array:
    """Distances (q,) of a shape that is opened at rest, as it is if that cannot mend it."""
    if not run.still:
        return np.full(signals.sizes["time"], np.nan)
    resting = signals.isel(time=_at_rest(run))
    try:
        opening = opening_at_rest(resting, run.truth["distance"][0], first, last)
    except SensorError:  # beyond what an offset may be
        opening = 0.0
    return shape_distance(estimate_shape(signals, first, last, opening=opening)).values


def _statistics(estimate: Array, truth: Array) -> list[float]:
    if not np.isfinite(estimate - truth).any():
        return [np.nan] * len(STATISTICS)
    found = true.errors_of(estimate, truth)
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
    calibration: StudyRun | None = None,
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
    calibration : StudyRun, optional
        As in `layout_errors`.

    Returns
    -------
    DataArray
        ``layout, run, sensors, quantity, statistic``, with the coordinate ``places`` of each layout (text).
    """
    values = [
        [
            [layout_errors(run, places, kind, calibration=calibration) for kind in kinds.values()]
            for run in runs
        ]
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
    """RMS errors of `layout_errors` over their scales, their mean; NaN if one is not known."""
    limits = (Scales() if scales is None else scales).of_quantities
    rms = found.sel(statistic="rms")
    return float(np.mean([rms.sel(quantity=name) / limit for name, limit in limits.items()]))


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

    Raises
    ------
    SensorError
        If a run does not start from rest, or a symmetric search starts from a layout that is not.
    """
    moving = [run.name for run in runs if not run.still]
    if moving:
        raise SensorError(f"The run {moving[0]} does not start from rest, where the distance is measured.")
    candidates, ballast = runs[0].places, _ballast(runs[0].case)
    known: dict[tuple[int, ...], float] = {}

    def judge(free: Array) -> float:
        whole = _unfolded(free, ballast) if symmetric else free
        try:
            key = tuple(_nearest(candidates, whole).tolist())
            if key not in known:
                found = [score(layout_errors(run, candidates[list(key)], sensors), scales) for run in runs]
                known[key] = float(np.nan_to_num(np.mean(found), nan=np.inf))
        except SensorError:  # two sensors have met, or an arm has none
            return np.inf
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
    shown = list(Scales().of_quantities)
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
