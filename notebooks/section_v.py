"""What the notebooks on the paper's three scenes share: a run, estimates from its IMUs, figure and tables.

The plant is never what the estimators believe: it has another mesh here, and more in the table of mismatches.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import cablesim
from cablesim import sensors
from cablesim.sensors.placement import StudyRun, prepare_run

sys.path.append(str(Path(__file__).parent.parent / "validation"))
from estimators import DISTANCES, PLANTS, SENSORS, changed, row, simulate, simulate_believed
from plants import SEVERAL, believed, plant

BUOY_A, BALLAST, BUOY_B = 0.8, 1.4, 2.0  # material coordinates [m]
MIDWAY = 0.5 * (1.1 + BALLAST)  # between IMU 2 and IMU 3 [m]
STILL = 0.1  # in which the vehicle has moved by half a millimetre [s]
MISMATCHES = ("EI 1.5", "buoys 2 cm inwards", "current 0.1 m/s along")


def run(name: str) -> xr.Dataset:
    """Trajectory of a scene of the gallery, on a finer mesh."""
    return cablesim.simulate(plant(name))


def study(name: str, *, as_believed: bool = False) -> StudyRun:
    """A scene with sensors every 5 cm, by default of a plant of which several things are not as believed."""
    case = believed(name)
    trajectory = cablesim.simulate(case if as_believed else plant(name, **SEVERAL))
    return prepare_run(trajectory, case=case, step=0.05)


@cache
def weights() -> xr.DataArray:
    """Weights of the five tangents in the distance of the buoys, calibrated on the gallery's dive [m]."""
    dive = cablesim.simulate(believed("dive"))
    signals = sensors.imu_signals(dive, rate=20.0)
    return sensors.weigh_tangents(signals, sensors.truth.distance(dive, BUOY_A, BUOY_B, signals["time"]))


def estimates(trajectory: xr.Dataset, errors: str | None = None) -> xr.Dataset:
    """What five IMUs tell of a run, 100 times a second, and what is true.

    Distances of the buoys [m] by equation (9), from the shape through the tangents, both also with the
    offset that they have at rest taken out, and from calibrated weights; curvature [1/m] midway between IMU 2
    and IMU 3 by equation (11) and from that shape; tensions beside the buoys [N].  The estimators believe the
    case of the gallery.
    """
    signals = sensors.imu_signals(trajectory, rate=100.0, errors=errors)
    signals.attrs["case"] = believed(cablesim.Case.from_yaml(trajectory.attrs["case"]).name).to_yaml()
    times = signals["time"]
    distance = sensors.truth.distance(trajectory, BUOY_A, BUOY_B, times)
    still = times < STILL
    shape = sensors.estimate_shape(signals)
    opening = sensors.opening_at_rest(signals.isel(time=still.values), float(distance[0]))
    opened = sensors.estimate_shape(signals, opening=opening)
    arms = sensors.rigid_arm_distance(signals)
    pairs = sensors.pair_curvature(signals)["magnitude"]

    def of_time(values: np.ndarray) -> tuple[tuple[str], np.ndarray]:
        return ("time",), np.asarray(values)

    return xr.Dataset(
        {
            "distance": of_time(distance),
            "distance (9)": of_time(arms),
            "distance (9), rest": of_time(arms - arms.where(still).mean() + distance[0]),
            "distance, shape": of_time(sensors.shape_distance(shape)),
            "distance, shape, rest": of_time(sensors.shape_distance(opened)),
            "distance, weights": of_time(sensors.weighted_distance(signals, weights())),
            "curvature": of_time(sensors.truth.curvature(trajectory, [MIDWAY], times)[:, 0]),
            "curvature (11)": of_time(pairs[:, int(np.argmin(np.abs(pairs["s"].values - MIDWAY)))]),
            "curvature, shape": of_time(sensors.shape_curvature(shape, [MIDWAY])[:, 0]),
            "tension, vehicle's side": of_time(sensors.truth.tension(trajectory, BUOY_A, "a", times)),
            "tension, winch's side": of_time(sensors.truth.tension(trajectory, BUOY_B, "b", times)),
            "payout speed": of_time(np.interp(times, trajectory["time"], trajectory["payout_speed"])),
        },
        {"time": times},
    )


def error_table(found: xr.Dataset) -> None:
    """Print errors of each estimate: RMS, mean, and what is left without the mean."""
    print(f"{'estimate':24s}{'RMS':>10s}{'mean':>10s}{'deviation':>11s}{'largest':>10s}{'correlation':>13s}")
    for way in found.data_vars:
        kind = str(way).replace(",", " ").split()[0]
        if way == kind or kind not in ("distance", "curvature"):
            continue
        error = sensors.truth.errors_of(found[way], found[kind])
        values = error["rms"], error["mean"], float((found[way] - found[kind]).std()), error["max"]
        scale, unit = (1e3, "mm") if kind == "distance" else (1.0, "1/m")
        print(
            f"{way:24s}",
            *(f"{scale * value:9.1f}" for value in values),
            f"{np.corrcoef(found[way], found[kind])[0, 1]:12.3f}  {unit}",
        )


def mismatch_table(name: str) -> list[dict[str, float]]:
    """Print and return RMS errors [mm] of the distance when cable, water or sensors are not as believed."""
    calibration = simulate_believed("dive")
    runs = {what: [simulate(name, PLANTS[what])] for what in ("mesh alone", *MISMATCHES)}
    exact = SENSORS["delay 100 ms"][1]
    rows = [row(what, found, exact, calibration) for what, found in runs.items()]
    rows += [
        row(what, changed(runs["mesh alone"], change), errors, calibration)
        for what, (change, errors) in SENSORS.items()
    ]
    print(f"{'':30s}", *(f"{heading:>14s}" for heading in DISTANCES.values()))
    for entry in rows:
        print(f"{entry['mismatch']:30s}", *(f"{entry[heading]:14.1f}" for heading in DISTANCES.values()))
    return rows


def figure(found: xr.Dataset) -> Figure:
    """Distance, tension at the buoys and curvature against time, as in the paper's Figures 5 to 7."""
    drawn, (distance, tension, curvature) = plt.subplots(
        3, 1, figsize=(10, 8), sharex=True, layout="constrained"
    )
    styles = {
        "distance": ("simulated", "k-"),
        "distance (9)": ("equation (9)", "r--"),
        "distance (9), rest": ("equation (9), offset at rest", "r-"),
        "distance, shape, rest": ("from the shape, offset at rest", "b:"),
        "curvature": ("simulated", "k-"),
        "curvature (11)": ("equation (11)", "r--"),
        "curvature, shape": ("from the shape", "b:"),
    }
    for way, (label, style) in styles.items():
        axes = distance if way.startswith("distance") else curvature
        axes.plot(found.time, found[way], style, label=label)
    for side in ("vehicle's side", "winch's side"):
        tension.plot(found.time, found[f"tension, {side}"], label=side)
    difference = found["tension, winch's side"] - found["tension, vehicle's side"]
    tension.plot(found.time, difference, "k--", label="difference")
    for axes, label in zip(
        (distance, tension, curvature),
        ("distance of the buoys [m]", "tension at the buoys [N]", "curvature, IMU 2 to 3 [1/m]"),
        strict=True,
    ):
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(loc="best")
    curvature.set_xlabel("time [s]")
    return drawn
