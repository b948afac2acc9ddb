"""What estimates from five IMUs are worth when the cable, the water or the sensors are not as believed.

Runs the paper's round trip, turn and dive with plants that differ from what the estimators believe, always on
another mesh, and compares for the distance of the buoys: equation (9), the shape from statics, and weights
of all tangents that were calibrated on the dive of the case as it is; each as it comes, and with its offset
taken once at rest.  Then the pull on the V, as it comes and with ten seconds of rest for the accelerometers.
The short version has the turn alone.
"""

from __future__ import annotations

from common import Evidence, parser  # isort: skip - sets the threads

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from plants import SEVERAL, believed, plant
from scipy.spatial.transform import Rotation

import cablesim
from cablesim.sensors import BMX160, ImuErrors, OrientationErrors, add_errors, calibrated, outer_force, truth
from cablesim.sensors.errors import AxisErrors
from cablesim.sensors.placement import EXACT, Sensors, StudyRun, layout_errors, prepare_run

SCENES = ("round_trip", "turn", "dive")
BALLAST = 1.4  # its place, and those of the paper's sensors [m]
PAPER = [0.8, 1.1, BALLAST, 1.7, 2.0]
DISTANCES = {
    "straight arms": "(9)",
    "straight arms at rest": "(9), rest",
    "distance": "shape",
    "distance at rest": "shape, rest",
    "weights": "weights",
    "weights at rest": "weights, rest",
}
"""Quantity of the study -> heading of its column."""

PLANTS: Mapping[str, Mapping[str, Any]] = {
    "mesh alone": {},
    "EI 0.7": {"stiffness": 0.7},
    "EI 1.5": {"stiffness": 1.5},
    "lift 0.9": {"lift": 0.9},
    "lift 1.1": {"lift": 1.1},
    "buoys 2 cm inwards": {"inwards": 0.02},
    "buoys 2 cm outwards": {"inwards": -0.02},
    "drag 0.7": {"drag": 0.7},
    "drag 1.5": {"drag": 1.5},
    "current 0.1 m/s along": {"current": (0.1, 0.0, 0.0)},
    "current 0.1 m/s across": {"current": (0.0, 0.1, 0.0)},
}

DEGREE = np.pi / 180.0


def pitched(signals: xr.Dataset, angle: float) -> xr.Dataset:
    """Signals of sensors whose reported pitch is off by `angle`, with the signs that matter most [rad].

    The two on each arm turn together, those on the other arm the other way: about the horizontal normal of
    the plane in which the cable is at rest.
    """
    sign = np.sign(np.round(BALLAST - signals["s"].values, 6))
    turn = Rotation.from_rotvec(-angle * sign[:, None] * [0.0, 1.0, 0.0])
    quaternions = signals["orientation"].values
    turned = np.stack(
        [
            (each * Rotation.from_quat(part)).as_quat()
            for each, part in zip(turn, quaternions.transpose(1, 0, 2), strict=True)
        ],
        axis=1,
    )
    return signals.assign(orientation=signals["orientation"].copy(data=turned))


def mounted(signals: xr.Dataset, angle: float, seed: int = 1) -> xr.Dataset:
    """Signals of sensors that sit on the cable turned by `angle` about an axis of chance [rad]."""
    axes = np.random.default_rng(seed).standard_normal((signals.sizes["imu"], 3))
    turns = Rotation.from_rotvec(angle * axes / np.linalg.norm(axes, axis=1, keepdims=True))
    changed = signals.copy()
    flat = signals["orientation"].values.transpose(1, 0, 2)
    changed["orientation"] = signals["orientation"].copy(
        data=np.stack(
            [(Rotation.from_quat(part) * each).as_quat() for part, each in zip(flat, turns, strict=True)], 1
        )
    )
    for name in ("specific_force", "angular_velocity", "magnetic_field"):
        parts = signals[name].values.transpose(1, 0, 2)
        turned = [each.inv().apply(part) for part, each in zip(parts, turns, strict=True)]
        changed[name] = signals[name].copy(data=np.stack(turned, 1))
    return changed


def late(signals: xr.Dataset, delay: float) -> xr.Dataset:
    """Signals that arrive with a delay [s]."""
    step = float(signals["time"][1] - signals["time"][0])
    index = np.maximum(np.arange(signals.sizes["time"]) - round(delay / step), 0)
    return signals.isel(time=index).assign_coords(time=signals["time"])


NOISE = ImuErrors(
    gyroscope=replace(BMX160.gyroscope, bias=0.0, scale=0.0, misalignment=0.0),
    accelerometer=replace(BMX160.accelerometer, bias=0.0, scale=0.0, misalignment=0.0),
    magnetometer=AxisErrors(),
    orientation=replace(BMX160.orientation, tilt=0.0),
    name="noise and drift of a BMX160",
)
MEMORY = 10.0  # of velocities from sensors with errors [s]
SENSORS: Mapping[str, tuple[Callable[[xr.Dataset], xr.Dataset] | None, Sensors]] = {
    "mounting 2 deg": (lambda signals: mounted(signals, 2.0 * DEGREE), Sensors(None, MEMORY)),
    "tilt 0.5 deg": (None, Sensors(ImuErrors(orientation=OrientationErrors(tilt=0.5 * DEGREE)), MEMORY)),
    "tilt 0.5 deg, worst signs": (lambda signals: pitched(signals, 0.5 * DEGREE), Sensors(None, MEMORY)),
    "tilt 2 deg, worst signs": (lambda signals: pitched(signals, 2.0 * DEGREE), Sensors(None, MEMORY)),
    "noise and drift of a BMX160": (None, Sensors(NOISE, MEMORY)),
    "all of a BMX160": (None, Sensors(BMX160, MEMORY)),
    "BMX160 calibrated": (None, Sensors(calibrated(BMX160), MEMORY)),
    "delay 100 ms": (lambda signals: late(signals, 0.1), EXACT),
}
"""Mismatch of the sensors -> what it does to exact signals, and the errors that are added to them."""


def simulate(scene: str, changes: Mapping[str, Any]) -> StudyRun:
    """A plant's run, prepared for estimators that believe the gallery's case."""
    found = cablesim.simulate(plant(scene, **changes))
    return prepare_run(found, case=believed(scene), step=0.3)


def simulate_believed(scene: str) -> StudyRun:
    """The gallery's own run: what weights are calibrated on."""
    case = believed(scene)
    return prepare_run(cablesim.simulate(case), case=case, step=0.3)


def errors(runs: list[StudyRun], sensors: Sensors, calibration: StudyRun) -> xr.DataArray:
    """RMS errors (quantity) over runs, the mean of their squares."""
    found = [layout_errors(run, PAPER, sensors, calibration=calibration) for run in runs]
    return np.sqrt((xr.concat(found, "run").sel(statistic="rms") ** 2).mean("run"))


def row(name: str, runs: list[StudyRun], sensors: Sensors, calibration: StudyRun) -> dict[str, Any]:
    """One row of the table of distances [mm]."""
    rms = errors(runs, sensors, calibration)
    columns = {heading: 1e3 * float(rms.sel(quantity=name)) for name, heading in DISTANCES.items()}
    return {"mismatch": name, **{heading: round(value, 1) for heading, value in columns.items()}}


def changed(runs: list[StudyRun], change: Callable[[xr.Dataset], xr.Dataset] | None) -> list[StudyRun]:
    """The same runs with other signals."""
    return runs if change is None else [replace(run, signals=change(run.signals)) for run in runs]


def pull_row(name: str, runs: list[StudyRun], sensors: Sensors, current: Any = None) -> dict[str, Any]:
    """The pull, and errors of that from the dynamics, RMS [mN]."""
    true, raw, rested, ways = [], [], [], []
    for run in runs:
        counted = slice(run.signals.sizes["time"] - run.truth["pull"].size, None)
        reads = [run.signals]
        if sensors.errors is not None:
            reads = [add_errors(run.signals, sensors.errors, seed) for seed in (1, 2, 3)]
        for read in reads:
            for rest, into in ((0.0, raw), (run.rest, rested)):
                force = outer_force(
                    read,
                    run.case,
                    rest=rest,
                    memory=sensors.memory,
                    vehicle_velocity=run.vehicle_velocity,
                    current=current,
                )
                pull = force["pull"].values[counted]
                into.append(truth.errors_of(pull, run.truth["pull"])["rms"])
            ways.append(1.0 - truth.agreement_of_sign(pull, run.truth["pull"], 0.01))
        true.append(float(np.sqrt(np.mean(run.truth["pull"] ** 2))))

    def rms(values: list[float]) -> float:
        return round(1e3 * float(np.sqrt(np.mean(np.square(values)))), 1)

    return {
        "mismatch": name,
        "pull": rms(true),
        "error": rms(raw),
        "error, rest": rms(rested),
        "wrong way, rest [%]": round(100.0 * float(np.nanmean(ways)), 1),
    }


def main() -> None:
    """Simulate the plants, judge the estimators."""
    options = parser(__doc__).parse_args()
    evidence = Evidence(__file__, __doc__, options)
    scenes = ("turn",) if options.small else SCENES
    plants = {name: PLANTS[name] for name in ("mesh alone", "EI 1.5")} if options.small else PLANTS
    calibration = simulate_believed("dive")
    runs = {name: [simulate(scene, changes) for scene in scenes] for name, changes in plants.items()}
    nominal = runs["mesh alone"]
    distances = [row(name, found, EXACT, calibration) for name, found in runs.items()]
    pulls = [pull_row(name, found, EXACT) for name, found in runs.items()]
    for name, found in runs.items():
        if "current" in plants[name]:
            pulls.append(pull_row(f"{name}, known", found, EXACT, plants[name]["current"]))
    for name, (change, sensors) in SENSORS.items():
        distances.append(row(name, changed(nominal, change), sensors, calibration))
        pulls.append(pull_row(name, changed(nominal, change), sensors))
    if not options.small:
        several = [simulate(scene, SEVERAL) for scene in scenes]
        turned = changed(several, lambda signals: mounted(signals, DEGREE))
        distances.append(row("several at once", turned, Sensors(BMX160, MEMORY), calibration))
        pulls.append(pull_row("several at once", turned, Sensors(BMX160, MEMORY)))
    evidence.table(
        distances,
        "Distance of the buoys from five IMUs, RMS error [mm]",
        "Rows: what differs from what the estimators believe, always on a mesh of 2.5 instead of 5 cm. "
        "Columns: as it comes; with the offset taken once at rest; weights calibrated on the gallery's dive. "
        "Several at once: "
        + ", ".join(f"{name} {value:g}" for name, value in SEVERAL.items())
        + ", mounting 1 deg, all of a BMX160.",
    )
    evidence.table(
        pulls,
        "Pull on the V from five IMUs [mN]",
        "RMS of the true pull over the runs, and of its errors; rest: accelerometers' offsets found in ten "
        "seconds of rest. A known current is given to the estimator. Velocities of sensors with errors are "
        "drawn to that of the vehicle within ten seconds.",
    )
    first = distances[0]
    evidence.claim("distance, equation (9), offset at rest", first["(9), rest"], "mm", at_most=20.0)
    evidence.claim("distance, shape from statics, offset at rest", first["shape, rest"], "mm", at_most=4.0)
    evidence.claim("distance, calibrated weights, offset at rest", first["weights, rest"], "mm", at_most=4.0)
    worst = max(entry["shape, rest"] for entry in distances)
    evidence.claim("distance, shape, offset at rest, worst mismatch", worst, "mm", at_most=15.0)
    evidence.claim("pull, exact sensors on another mesh", pulls[0]["error"], "mN", at_most=2.0)


if __name__ == "__main__":
    main()
