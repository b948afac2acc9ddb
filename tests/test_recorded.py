"""Runs against what was measured and what an independent code computed (`validation/recorded`)."""

from __future__ import annotations

import accuracy
import numpy as np
import pytest
import run0024


@pytest.mark.parametrize(
    ("name", "until", "bound", "changes"),
    [pytest.param(name, *rest, id=f"{name}, {text}") for name, text, *rest in accuracy.PEER_RUNS],
)
def test_markers_of_moordyn(name: str, until: float, bound: float, changes: dict[str, float]) -> None:
    assert accuracy.against_peer(name, until, **changes) <= bound


def test_markers_of_run_0024() -> None:
    lengths = 1e3 * np.linalg.norm(run0024.compared().vector, axis=1)
    assert lengths.size == 587
    for percentile, bound in run0024.BOUNDS.items():
        assert np.percentile(lengths, percentile) <= bound
