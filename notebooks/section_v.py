"""What the notebooks on the paper's three scenes share: a run, estimates from its IMUs, and its figure."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import cablesim
from cablesim import sensors

CASES = Path(__file__).parent.parent / "cases"
BUOY_A, BALLAST, BUOY_B = 0.8, 1.4, 2.0  # material coordinates [m]
MIDWAY = 0.5 * (1.1 + BALLAST)  # between IMU 2 and IMU 3 [m]


def run(name: str) -> xr.Dataset:
    """Trajectory of a case of the gallery."""
    return cablesim.simulate(cablesim.load_case(CASES / f"{name}.yaml"))


def estimates(trajectory: xr.Dataset, errors: str | None = None) -> xr.Dataset:
    """What five IMUs tell of a run, 100 times a second, and what is true.

    Distances of the buoys [m] by equation (9) and from the shape through the tangents; curvature [1/m] midway
    between IMU 2 and IMU 3 by equation (11) and from that shape; tensions beside the buoys [N].
    """
    signals = sensors.imu_signals(trajectory, rate=100.0, errors=errors)
    times = signals["time"]
    shape = sensors.estimate_shape(signals)
    pairs = sensors.pair_curvature(signals)["magnitude"]

    def of_time(values: np.ndarray) -> tuple[tuple[str], np.ndarray]:
        return ("time",), np.asarray(values)

    return xr.Dataset(
        {
            "distance": of_time(sensors.truth.distance(trajectory, BUOY_A, BUOY_B, times)),
            "distance (9)": of_time(sensors.rigid_arm_distance(signals)),
            "distance, shape": of_time(sensors.shape_distance(shape)),
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
    """Print RMS and largest errors of each estimate."""
    print(f"{'estimate':20s}{'RMS':>12s}{'largest':>12s}{'correlation':>13s}")
    for kind, unit in (("distance", "m"), ("curvature", "1/m")):
        for way in (f"{kind} ({'9' if kind == 'distance' else '11'})", f"{kind}, shape"):
            error = sensors.truth.errors_of(found[way], found[kind])
            together = np.corrcoef(found[way], found[kind])[0, 1]
            print(f"{way:20s}{error['rms']:8.4f} {unit:3s}{error['max']:8.4f} {unit:3s}{together:13.3f}")


def figure(found: xr.Dataset) -> Figure:
    """Distance, tension at the buoys and curvature against time, as in the paper's Figures 5 to 7."""
    drawn, (distance, tension, curvature) = plt.subplots(
        3, 1, figsize=(10, 8), sharex=True, layout="constrained"
    )
    styles = {"": ("black", "-"), " (9)": ("tab:red", "--"), ", shape": ("tab:blue", ":")}
    for ending, (colour, line) in styles.items():
        distance.plot(found.time, found[f"distance{ending}"], line, color=colour, label=_named(ending))
        ending = ending.replace("9", "11")
        curvature.plot(found.time, found[f"curvature{ending}"], line, color=colour, label=_named(ending))
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


def _named(ending: str) -> str:
    return {"": "simulated", ", shape": "from the shape"}.get(ending, f"equation{ending}")
