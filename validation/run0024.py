"""Run 0024 of cable 6 (Table II, trajectory 5): simulated against recorded markers, nothing fitted.

Percentiles of the residuals as in Table III of the paper, and which part of them is a static offset (the mean
residual vector of each marker while the robot keeps its station) and which is motion.
"""

from __future__ import annotations

from common import CASES, RECORDED, Evidence, output_folder, parser  # isort: skip - sets the threads

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import cablesim
from cablesim.recording import rotate_to_vertical

UP = (0.006, -0.083, 0.9965)  # measured vertical of that day (README of the recording)
RECORD_START = 0.03  # record time of the first frame, where the simulation starts [s]
STATION_KEEPING = 2.2  # the command starts at 2 s; the robot has not moved the cable before [s]
PERCENTILES = (1, 25, 50, 75, 99)
PAPER = (0.47, 5.85, 12.38, 15.80, 22.59)  # Table III, trajectory 5 (three runs)
BOUNDS = {50: 6.8, 99: 17.0}


@dataclass(frozen=True)
class Residuals:
    """Record times (k,), marker names (k,) and residual vectors simulated - recorded (k, 3) [m]."""

    time: np.ndarray
    marker: np.ndarray
    vector: np.ndarray


def recorded_markers(file: Path) -> list[dict[str, str]]:
    """Rows of the marker file in which the point was seen."""
    with file.open(newline="") as stream:
        return [row for row in csv.DictReader(stream) if row["x_m"]]


def place(row: dict[str, str]) -> np.ndarray:
    """Position of a row in the camera frame [m]."""
    return np.array([float(row[f"{axis}_m"]) for axis in "xyz"])


def residuals(run: xr.Dataset, rows: list[dict[str, str]]) -> Residuals:
    """Simulated minus recorded positions of all cable markers in all frames."""
    rod = np.mean([place(row) for row in rows if row["point"] == "rod_end"], axis=0)
    seen = [row for row in rows if row["point"].startswith("cable")]
    times = np.array([float(row["t_s"]) for row in seen])
    arcs = np.array([float(row["arc_m"]) for row in seen])
    recorded = rotate_to_vertical(np.array([place(row) for row in seen]) - rod, UP)
    simulated = run.position.swap_dims(node="s").interp(
        time=xr.DataArray(np.clip(times - RECORD_START, 0.0, float(run.time[-1])), dims="sample"),
        s=xr.DataArray(arcs, dims="sample"),
    )
    vectors = simulated.transpose("sample", "axis").values - recorded
    return Residuals(times, np.array([row["point"] for row in seen]), vectors)


def static_offset(found: Residuals) -> np.ndarray:
    """Mean residual vector of each sample's marker while the robot keeps its station, (k, 3)."""
    offset = np.empty_like(found.vector)
    for marker in np.unique(found.marker):
        mine = found.marker == marker
        offset[mine] = found.vector[mine & (found.time < STATION_KEEPING)].mean(axis=0)
    return offset


def percentiles(vectors: np.ndarray) -> dict[str, float]:
    """Percentiles of the lengths of vectors [mm]."""
    lengths = 1e3 * np.linalg.norm(vectors, axis=1)
    return {f"P{p}": round(float(np.percentile(lengths, p)), 2) for p in PERCENTILES}


def draw(found: Residuals, file: Path) -> None:
    """Residual of every marker against time, and its median per frame."""
    import matplotlib.pyplot as plt

    lengths = 1e3 * np.linalg.norm(found.vector, axis=1)
    moving = 1e3 * np.linalg.norm(found.vector - static_offset(found), axis=1)
    frames = np.unique(found.time)
    figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
    axes.plot(found.time, lengths, ".", color="0.75", label="each marker")
    for values, label in ((lengths, "median of a frame"), (moving, "the same without static offset")):
        axes.plot(frames, [np.median(values[found.time == t]) for t in frames], "-o", ms=3, label=label)
    axes.set(
        xlabel="time of the record [s]", ylabel="residual [mm]", ylim=(0, None), title="Run 0024 of cable 6"
    )
    axes.legend()
    figure.savefig(file, dpi=150)
    print(f"wrote {file}")


def compared() -> Residuals:
    """Residuals of the case in the gallery."""
    run = cablesim.simulate(cablesim.load_case(CASES / "cable6_run0024.yaml"))
    return residuals(run, recorded_markers(RECORDED / "cable6_y200dis1_0024_markers.csv"))


def main() -> None:
    """Compare; with -o also draw."""
    options = parser(__doc__).parse_args()
    evidence = Evidence(__file__, __doc__, options)
    found = compared()
    offset = static_offset(found)
    keeping = found.time < STATION_KEEPING
    parts: dict[str, Any] = {
        f"all ({len(found.vector)})": percentiles(found.vector),
        "the paper, Table III (3 runs)": dict(zip(percentiles(offset), PAPER, strict=True)),
        f"before the command ({keeping.sum()})": percentiles(found.vector[keeping]),
        "static offset alone": percentiles(offset),
        "motion: without the offset": percentiles(found.vector - offset),
    }
    everything = percentiles(found.vector)
    for percentile, bound in BOUNDS.items():
        text = f"run 0024, nothing fitted: P{percentile} of {len(found.vector)} residuals"
        evidence.claim(text, everything[f"P{percentile}"], "mm", at_most=bound)
    evidence.table([{"residuals [mm]": name, **row} for name, row in parts.items()], "run 0024")
    if options.output:
        draw(found, output_folder(options.output) / "run0024.png")


if __name__ == "__main__":
    main()
