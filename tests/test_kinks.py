"""A cable that kinks at its bodies converges as a smooth one does: each half segment has its own tangent."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cablesim import Simulation, build_scene, load_case, simulate
from cablesim.scene import MeshRules, Scene

V = build_scene(load_case(Path(__file__).parents[1] / "cases" / "kinked_v.yaml"))


def kinked(segment_length: float) -> Scene:
    """The V of the gallery on another mesh, its tolerance out of the way."""
    numerics = replace(V.numerics, relative_tolerance=1e-7)
    output = replace(V.output, variables=("marker_position",))
    return replace(V, mesh=MeshRules(segment_length=segment_length), numerics=numerics, output=output)


@cache
def markers(segment_length: float) -> NDArray[np.float64]:
    result = simulate(kinked(segment_length))
    assert result.attrs["status"] == "completed"
    return result.marker_position.values


def rms(first: float, second: float) -> float:
    """Distance between two meshes over markers and times [mm]."""
    difference = markers(first) - markers(second)
    return 1e3 * float(np.sqrt(np.mean(np.sum(difference**2, axis=-1))))


def test_kinked_cable_is_of_second_order() -> None:
    """With the mean tangent of both segments beside a node: order 1.03, and 0.33 mm at 5 cm."""
    for length in (0.1, 0.05):
        order = np.log2(rms(length, length / 2) / rms(length / 2, length / 4))
        assert order == pytest.approx(2.0, abs=0.05)
    assert rms(0.05, 0.0125) < 0.03


def test_kinks_are_there() -> None:
    chords = np.diff(Simulation(kinked(0.1)).observe().position, axis=0)
    tangents = chords / np.linalg.norm(chords, axis=1)[:, None]
    turns = np.degrees(np.arccos(np.sum(tangents[1:] * tangents[:-1], axis=1)))
    np.testing.assert_allclose(turns[[13, 29, 45]], [44.0, 149.0, 44.0], rtol=0, atol=1.0)
