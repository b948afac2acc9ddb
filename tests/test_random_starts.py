"""Random scenes that found no start: what they were refused for has an answer."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from cablesim.mesh import build_mesh
from cablesim.statics import InitialState, Rung, find_initial_state


@pytest.fixture(scope="module")
def random_scenes() -> ModuleType:
    folder = str(Path(__file__).resolve().parents[1] / "validation")
    sys.path.insert(0, folder)
    try:
        import random_scenes
    finally:
        sys.path.remove(folder)
    return random_scenes


def start_of(random_scenes: ModuleType, seed: int, index: int) -> InitialState:
    scene = random_scenes.make_scene(random_scenes.Plan(seed=seed), index)
    return find_initial_state(scene, build_mesh(scene))


def test_a_kinked_cable_of_rubber_is_not_pushed_to_nothing(random_scenes: ModuleType) -> None:
    """What balances its first instant is a push of more than EA: that strain leaves no length to close."""
    state = start_of(random_scenes, 12, 381)
    layout, parameters = state.model.layout, state.model.parameters
    strain = np.linalg.norm(layout.chord(state.y), axis=1) / state.model.unstretched(0.0) - 1.0
    assert np.abs(strain).max() < 0.25
    np.testing.assert_allclose(
        layout.tension(state.y), parameters.constants[0] * strain, rtol=1e-9, atol=1e-9
    )
    span = [state.model.end_place_and_velocity(end, 0.0)[0] for end in "ab"]
    np.testing.assert_allclose(state.model.node_places(0.0, state.y)[[0, -1]], span, rtol=0, atol=1e-13)


def test_a_cable_that_creeps_over_itself_comes_to_rest(random_scenes: ModuleType) -> None:
    """157 m in a shear that turns: relaxation was still under way after its 400 steps."""
    state = start_of(random_scenes, 12, 46)
    largest = float(np.abs(state.model.layout.tension(state.y)).max())
    assert state.rung is Rung.RELAXATION
    assert state.residual < 1e-9 * largest
