"""Run 0024 of cable 6 (recordings/cosmer_cable6): measured markers against a simulation without any fit."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cablesim.case import load_case
from cablesim.recording import rotate_to_vertical
from cablesim.simulation import simulate

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = Path(os.environ.get("CABLESIM_RECORDINGS", ROOT.parent / "shared" / "recordings"))
MARKERS = RECORDINGS / "cosmer_cable6" / "cable6_y200dis1_0024_markers.csv"
UP = (0.006, -0.083, 0.9965)
RECORD_START = 0.03  # [s] of the record at t = 0 of the simulation

pytestmark = pytest.mark.skipif(
    not MARKERS.is_file(), reason=f"no recording {MARKERS}; set CABLESIM_RECORDINGS to where they are"
)

Array = NDArray[np.float64]


def measured() -> tuple[Array, Array, Array]:
    """Time, arc length and place from the fixed end of every marker seen, vertical upright."""
    with MARKERS.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["x_m"]]
    places = np.array([[float(row[f"{axis}_m"]) for axis in "xyz"] for row in rows])
    fixed = places[[row["point"] == "rod_end" for row in rows]].mean(axis=0)
    on_cable = [row["point"].startswith("cable_") for row in rows]
    table = np.array([[float(row["t_s"]), float(row["arc_m"])] for row in rows])[on_cable]
    return table[:, 0], table[:, 1], rotate_to_vertical(places[on_cable] - fixed, UP)


def case_file(folder: Path) -> Path:
    """The case of the gallery, beside the recordings wherever these are."""
    text = (ROOT / "cases" / "cable6_run0024.yaml").read_text()
    moved = folder / "case.yaml"
    moved.write_text(text.replace("../../shared/recordings", str(RECORDINGS)))
    return moved


def residuals(folder: Path) -> Array:
    """Distances of all markers in all frames [mm]."""
    result = simulate(load_case(case_file(folder)))
    assert result.attrs["status"] == "completed"
    times, arcs, places = measured()
    frame = np.rint((times - RECORD_START) / 0.01).astype(int)
    np.testing.assert_allclose(result.time.values[frame], times - RECORD_START, rtol=0, atol=1e-6)
    marker = np.abs(result.marker_s.values[None] - arcs[:, None]).argmin(axis=1)
    np.testing.assert_allclose(result.marker_s.values[marker], arcs, rtol=0, atol=1e-3)
    return 1e3 * np.linalg.norm(result.marker_position.values[frame, marker] - places, axis=1)


def test_run_0024(tmp_path: Path) -> None:
    found = residuals(tmp_path)
    percentiles = np.percentile(found, [1, 25, 50, 75, 99])
    print(f"{found.size} residuals, P1/P25/P50/P75/P99 = {percentiles.round(2)} mm")
    assert percentiles[2] <= 6.8
    assert percentiles[4] <= 17.0
