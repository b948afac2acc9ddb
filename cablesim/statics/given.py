"""States from shapes that the case gives: directions, velocities and the tensions that go with them.

Depends on: scene, mesh, physics, statics.closing, statics.guess.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from cablesim.mesh import Mesh
from cablesim.physics.model import CableModel
from cablesim.physics.parameters import EA_
from cablesim.scene import Scene, StartShape, StartVelocity
from cablesim.statics.closing import close, slack, sum_of_chords
from cablesim.statics.guess import Guess
from cablesim.statics.outcome import StaticsError

Array = NDArray[np.float64]

BALANCING_ROUNDS = 3
SLACK_FOR_STRAIN = 0.25  # largest strain that balancing gives, over the slack of the cable


def state_of(guess: Guess, model: CableModel, scene: Scene) -> Array:
    """State with the guess's directions and tensions, at rest."""
    layout = model.layout
    y = np.zeros(layout.size)
    strain = guess.tension / scene.cable.axial_stiffness
    layout.chord(y)[:] = (
        model.frame.vectors_in(guess.directions) * ((1.0 + strain) * model.unstretched(0.0))[:, None]
    )
    layout.tension(y)[:] = guess.tension
    if scene.end_a.motion is None:
        layout.end_place(y)[:] = _start_of_end_b(scene, model)
    else:
        layout.end_place(y)[:] = sum_of_chords(y, model)
    return y


def _start_of_end_b(scene: Scene, model: CableModel) -> Array:
    if scene.end_b.motion is not None:
        return model.frame.places_in(scene.end_b.motion.position(0.0))
    polyline = scene.initial.polyline if isinstance(scene.initial, StartShape) else None
    if polyline is None:
        raise StaticsError(
            "Both ends are free and nothing says where the cable is: give the shape by markers or a polyline."
        )
    return model.frame.places_in(polyline[-1])


def set_velocities(y: Array, scene: Scene, mesh: Mesh, model: CableModel) -> None:
    """Write the velocities that the case gives, or such as vary linearly from one held end to the other."""
    velocity = scene.initial.velocity if isinstance(scene.initial, StartShape) else None
    given = velocity or _between_ends(scene)
    if given is None:
        return
    layout, world = model.layout, given.at(mesh.nodes)
    layout.velocity(y)[:] = model.frame.vectors_in(world[:-1])
    layout.end_velocity(y)[:] = model.frame.vectors_in(world[-1])
    model.impose_end_velocities(0.0, y)


def _between_ends(scene: Scene) -> StartVelocity | None:
    """Velocity that is linear between the ends, or that of the only one that is held."""
    ends = ((scene.end_a, 0.0), (scene.end_b, scene.start_length))
    held = [(arc, end.motion.velocity(0.0)) for end, arc in ends if end.motion is not None]
    if not held:
        return None
    return StartVelocity(arc=np.array([arc for arc, _ in held]), velocities=np.array([v for _, v in held]))


def balance_tension(y: Array, model: CableModel, directions: Array) -> None:
    """Give a slack cable of nearly these directions (n, D) the tension with which no axial wave starts.

    The tension stretches it, which turns it, which changes the tension: some rounds do.  As a cable that is
    all but taut would sag far more for a little stretch, a strain beyond a part of the slack is not given:
    such a cable stays where it was put, with less tension.  A taut one has the tension of its stretch.
    """
    room = slack(model)
    if room <= 0.0:
        return
    stiffness, small = model.parameters.constants[EA_], SLACK_FOR_STRAIN * room
    largest = max(float(model.layout.tension(y).max()) / stiffness, small)
    for _ in range(BALANCING_ROUNDS):
        strain = (model.layout.tension(y) + _missing_tension(y, model)) / stiffness
        beyond = max(float(strain.max()) / largest, -float(strain.min()) / small, 1.0)
        close(y, model, directions, strain / beyond)


def _missing_tension(y: Array, model: CableModel) -> Array:
    """Tensions (n,) to add so that the momentum rows hold best in the least-squares sense (paper, III-B).

    Weighted with the inverse of the mass this is Gauss' principle of least constraint: no segment's rate of
    stretch changes at the first instant.  Tri-diagonal.
    """
    layout = model.layout
    n = layout.segments
    force = np.empty(layout.size)
    model.residual(0.0, y, np.zeros(layout.size), force)
    chord = layout.chord(y) * model.parameters.lengths[:, None]
    size = np.linalg.norm(chord, axis=1)
    tangent = chord / size[:, None]
    free = np.ones(n + 1)
    free[0], free[n] = float(model.features.free_a), float(model.features.free_b)
    acceleration = -model.accelerations(0.0, y, layout.node_velocity(force)) * free[:, None]
    right = free[1:, None] * model.accelerations(0.0, y, tangent, slice(1, None))
    left = free[:-1, None] * model.accelerations(0.0, y, tangent, slice(0, n))
    diagonal = np.sum(tangent * (left + right), axis=1)
    coupling = -np.sum(
        tangent[1:] * free[1:-1, None] * model.accelerations(0.0, y, tangent[:-1], slice(1, n)), axis=1
    )
    diagonal += 1e-12 * diagonal.max()
    turning = np.diff(layout.node_velocity(y), axis=0)
    turning -= np.sum(turning * tangent, axis=1)[:, None] * tangent
    lengthening = np.sum(tangent * np.diff(acceleration, axis=0), axis=1) + np.sum(turning**2, axis=1) / size
    return solveh_banded(np.stack((np.concatenate(([0.0], coupling)), diagonal)), lengthening)
