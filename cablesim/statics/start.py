"""The state with which a scene begins.

Depends on: scene, mesh, physics, and all of statics.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cablesim.mesh import Mesh
from cablesim.physics.model import CableModel, build_model
from cablesim.physics.needs import scene_frame
from cablesim.scene import EquilibriumShape, SavedState, Scene, TautShape
from cablesim.statics.closing import close
from cablesim.statics.given import balance_tension, set_velocities, state_of
from cablesim.statics.guess import first_guess
from cablesim.statics.outcome import InitialState
from cablesim.statics.resume import resumed
from cablesim.statics.search import Search, unbalanced_force

Array = NDArray[np.float64]


def find_initial_state(scene: Scene, mesh: Mesh) -> InitialState:
    """Initial state of a scene, as its `initial` shape asks.

    Parameters
    ----------
    scene : Scene
        What is simulated.
    mesh : Mesh
        Its nodes.

    Returns
    -------
    InitialState
        State, model and how it was found.

    Raises
    ------
    StaticsError
        When no rest shape is found.
    """
    shape = scene.initial
    guess = first_guess(scene, mesh)
    vectors = [guess.directions]
    if isinstance(shape, SavedState):
        vectors.append(shape.velocities)
    elif shape.velocity is not None:
        vectors.append(shape.velocity.velocities)
    model = build_model(scene, mesh, scene_frame(scene, np.concatenate(vectors)))
    if isinstance(shape, SavedState):
        return resumed(shape, scene, mesh, model)
    y = state_of(guess, model, scene)
    if isinstance(shape, EquilibriumShape):
        state = Search(model, _frame_velocity(scene, model)).equilibrium(y, guess.rung)
        if shape.velocity is not None:
            set_velocities(state.y, scene, mesh, model)
        return state
    directions = model.frame.vectors_in(guess.directions)
    close(y, model, directions, guess.tension / scene.cable.axial_stiffness)
    set_velocities(y, scene, mesh, model)
    if not isinstance(shape, TautShape) or shape.stretched:
        balance_tension(y, model, directions)
    return InitialState(model, y, guess.rung, unbalanced_force(model, y), 0)


def _frame_velocity(scene: Scene, model: CableModel) -> Array:
    """Velocity (D,) with which the whole cable may move at rest relative to its ends."""
    velocities = [
        model.frame.vectors_in(end.motion.velocity(0.0))
        for end in (scene.end_a, scene.end_b)
        if end.motion is not None
    ]
    if velocities and np.ptp(np.stack(velocities), axis=0).max() < 1e-12:
        return velocities[0]
    return np.zeros(model.layout.dimension)
