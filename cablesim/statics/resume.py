"""The state of an earlier run as a start.

Depends on: scene, mesh, physics, statics.closing, statics.search.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cablesim.mesh import Mesh
from cablesim.physics.model import CableModel
from cablesim.scene import SavedState, Scene
from cablesim.statics.closing import sum_of_chords
from cablesim.statics.outcome import InitialState, Rung
from cablesim.statics.search import unbalanced_force

Array = NDArray[np.float64]


def saved_chords(saved: SavedState, nodes: Array) -> Array:
    """Chords (n, 3) of a saved cable on a mesh, as they are where the mesh is the same."""
    places = np.stack([np.interp(nodes, saved.arc, saved.positions[:, c]) for c in range(3)], axis=1)
    return np.diff(places, axis=0)


def resumed(saved: SavedState, scene: Scene, mesh: Mesh, model: CableModel) -> InitialState:
    """The state of an earlier run, on its own mesh exactly, on another by linear interpolation."""
    layout, frame, constants = model.layout, model.frame, model.parameters.constants
    y = np.zeros(layout.size)
    velocity = np.stack([np.interp(mesh.nodes, saved.arc, saved.velocities[:, c]) for c in range(3)], axis=1)
    layout.velocity(y)[:] = frame.vectors_in(velocity[:-1])
    layout.end_velocity(y)[:] = frame.vectors_in(velocity[-1])
    layout.chord(y)[:] = frame.vectors_in(saved_chords(saved, mesh.nodes)) / mesh.reference_lengths[:, None]
    free_a = scene.end_a.motion is None
    layout.end_place(y)[:] = frame.places_in(saved.positions[-1]) if free_a else sum_of_chords(y, model)
    middle, saved_middle = (0.5 * (nodes[1:] + nodes[:-1]) for nodes in (mesh.nodes, saved.arc))
    force = np.interp(middle, saved_middle, saved.tension)
    # force = T + tau T', and the tension row gives T' = EA (stretching/l + beta (strain - T/EA))
    size = np.linalg.norm(layout.chord(y), axis=1)
    change = np.diff(layout.node_velocity(y), axis=0)
    stretching = np.sum(change * layout.chord(y), axis=1) / (size * mesh.lengths)
    stiffness, tau, beta = constants[0], constants[2], constants[3]
    rate = stiffness * (stretching + beta * (size / model.unstretched(0.0) - 1.0))
    layout.tension(y)[:] = (force - tau * rate) / (1.0 - tau * beta)
    model.impose_end_velocities(0.0, y)
    return InitialState(model, y, Rung.SAVED, unbalanced_force(model, y), 0)
