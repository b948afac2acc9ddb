"""Against MoorDyn's converged trajectories of three scenes (recordings/peers), RMS over markers and times."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scenes import VACUUM, pendulum, sway

from cablesim.scene import Scene
from cablesim.simulation import simulate

ROOT = Path(__file__).resolve().parent.parent
PEERS = Path(os.environ.get("CABLESIM_RECORDINGS", ROOT.parent / "shared" / "recordings")) / "peers"

pytestmark = pytest.mark.skipif(
    not PEERS.is_dir(), reason=f"no recordings in {PEERS}; set CABLESIM_RECORDINGS to where they are"
)

FINE: dict[str, Any] = {"relative_tolerance": 1e-6, "variables": ("marker_position",)}


def distance(case: Scene, name: str, until: float = np.inf) -> float:
    """RMS distance of the markers from the reference [mm]."""
    result = simulate(case)
    assert result.attrs["status"] == "completed"
    with xr.open_dataset(PEERS / f"moordyn_{name}_ref.nc") as reference:
        np.testing.assert_allclose(result.time.values, reference.time.values, rtol=0, atol=1e-9)
        compared = result.time.values <= until + 1e-9
        difference = (result.marker_position.values - reference.pos.values)[compared]
    found = 1e3 * float(np.sqrt(np.mean(np.sum(difference**2, axis=-1))))
    print(f"{name}: {found:.4f} mm, {case.cable.length / case.mesh.segment_length:.0f} segments")
    return found


def test_sway() -> None:
    assert distance(sway(**FINE), "S1") <= 0.10


def test_sway_on_a_fine_mesh() -> None:
    assert distance(sway(segments=240, **FINE), "S1") < 0.05


def test_pendulum() -> None:
    assert distance(pendulum(**FINE), "S3") <= 0.075


def test_pendulum_in_vacuum_until_it_whips() -> None:
    assert distance(pendulum(density=VACUUM, **FINE), "S3v", until=0.82) <= 0.29


@pytest.mark.parametrize(("make", "name"), [(sway, "S1"), (pendulum, "S3")])
def test_default_settings(make: Any, name: str) -> None:
    assert distance(make(), name) < 0.5
