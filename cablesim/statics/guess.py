"""First shapes: a straight line, an arc, an elastic catenary, or what the case gives.

Depends on: scene, mesh, statics.catenary, statics.pull, statics.resume.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from cablesim.mesh import Mesh
from cablesim.scene import CatenaryShape, EquilibriumShape, MarkerShape, SavedState, Scene, TautShape
from cablesim.statics.catenary import elastic_catenary
from cablesim.statics.outcome import Rung
from cablesim.statics.pull import reaching_pulls, unit
from cablesim.statics.resume import saved_chords

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guess:
    """First shape: unit directions (n, 3) from A to B, tensions (n,) and the rung it stands for."""

    directions: Array
    tension: Array
    rung: Rung


def first_guess(scene: Scene, mesh: Mesh) -> Guess:
    """First shape of a scene's cable, as its `initial` shape asks."""
    shape = scene.initial
    if isinstance(shape, SavedState):
        return Guess(saved_chords(shape, mesh.nodes), np.zeros(mesh.segments), Rung.SAVED)
    if isinstance(shape, MarkerShape):
        return _through_markers(shape, scene, mesh)
    if isinstance(shape, EquilibriumShape) and shape.guess is not None:
        arc = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(shape.guess, axis=0), axis=1))))
        arc *= scene.start_length / arc[-1]
        directions = unit(marker_chords(arc, shape.guess, mesh.nodes))
        return Guess(directions, np.zeros(mesh.segments), Rung.MARKERS)
    if isinstance(shape, TautShape) and shape.direction is not None:
        return _straight(shape.direction, 0.0, mesh)
    if scene.end_a.motion is None or scene.end_b.motion is None:
        return _hanging(scene, mesh)
    return _between_ends(scene, mesh)


def _through_markers(shape: MarkerShape, scene: Scene, mesh: Mesh) -> Guess:
    """Directions of the markers' curve and, between held ends, the tension of a cable as long as it."""
    chords = marker_chords(shape.arc, shape.positions, mesh.nodes)
    strain = 0.0
    if scene.end_a.motion is not None and scene.end_b.motion is not None:
        strain = max(0.0, float(np.linalg.norm(chords, axis=1).sum()) / scene.start_length - 1.0)
    return Guess(unit(chords), np.full(mesh.segments, scene.cable.axial_stiffness * strain), Rung.MARKERS)


def _straight(direction: Array, tension: float, mesh: Mesh) -> Guess:
    return Guess(np.tile(direction, (mesh.segments, 1)), np.full(mesh.segments, tension), Rung.TAUT)


def _hanging(scene: Scene, mesh: Mesh) -> Guess:
    """Straight up or down from the held end, as the whole weight in water asks."""
    weight = _node_weights(scene, mesh)
    from_a = scene.end_b.motion is None
    sinks = weight.sum() >= 0.0
    beyond = np.cumsum(weight[::-1])[::-1][1:] if from_a else np.cumsum(weight)[:-1]
    direction = np.array([0.0, 0.0, -1.0 if sinks == from_a else 1.0])
    return Guess(np.tile(direction, (mesh.segments, 1)), beyond if sinks else -beyond, Rung.TAUT)


def _node_weights(scene: Scene, mesh: Mesh) -> Array:
    weight = scene.cable.wet_weight * mesh.node_lengths
    for index, node in mesh.in_water():
        attachment = scene.attachments[index]
        weight[node] += (attachment.mass - scene.water.density * attachment.volume) * scene.gravity
    return weight


def _between_ends(scene: Scene, mesh: Mesh) -> Guess:
    """Straight if asked for, else a catenary; without weight straight when taut, and an arc when slack."""
    assert scene.end_a.motion is not None
    assert scene.end_b.motion is not None
    span = scene.end_b.motion.position(0.0) - scene.end_a.motion.position(0.0)
    distance, length = float(np.linalg.norm(span)), scene.start_length
    whole_weight = float(_node_weights(scene, mesh).sum())
    if not isinstance(scene.initial, TautShape) and _hangs(scene, whole_weight):
        return _catenary(span, scene, mesh)
    if distance >= length:
        return _straight(span / distance, scene.cable.axial_stiffness * (distance / length - 1.0), mesh)
    middle = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    directions = _arc_directions(span, length, middle, down=whole_weight >= 0.0)
    return Guess(directions, np.zeros(mesh.segments), Rung.CATENARY)


def _hangs(scene: Scene, whole_weight: float) -> bool:
    """Whether the weight of the bare cable says how it hangs; for a search it must be a part of the whole."""
    weight = abs(scene.cable.wet_weight) * scene.start_length
    return weight > (0.0 if isinstance(scene.initial, CatenaryShape) else 1e-3 * abs(whole_weight))


def _catenary(span: Array, scene: Scene, mesh: Mesh) -> Guess:
    """The elastic catenary, with the pulls with which the chords of the mesh reach the other end."""
    cable = scene.cable
    force = elastic_catenary(span, scene.start_length, cable.wet_weight, cable.axial_stiffness)
    middle = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    pulls = force + np.outer(middle, [0.0, 0.0, cable.wet_weight])
    pulls = reaching_pulls(pulls, mesh.lengths, span, 1.0 / cable.axial_stiffness)
    return Guess(unit(pulls), np.linalg.norm(pulls, axis=1), Rung.CATENARY)


def _arc_directions(span: Array, length: float, arc: Array, *, down: bool) -> Array:
    """Directions (n, 3), at places `arc`, along a circular arc through both ends in a vertical plane."""
    distance = float(np.linalg.norm(span))
    along = span / distance if distance > 1e-9 * length else np.array([1.0, 0.0, 0.0])
    side = np.array([0.0, 0.0, -1.0 if down else 1.0])
    side -= (side @ along) * along
    if np.linalg.norm(side) < 1e-9:  # ends one above the other: sag to +x
        side = np.array([1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    half = np.pi
    if distance > 1e-9 * length:
        half = brentq(lambda a: np.sin(a) / a - distance / length, 1e-9, np.pi)
    angle = half * (1.0 - 2.0 * arc / length)
    return np.outer(np.cos(angle), along) + np.outer(np.sin(angle), side)


def marker_chords(arc: Array, positions: Array, nodes: Array) -> Array:
    """Chords (n, 3) between the nodes on a smooth curve through markers [m].

    Parameters
    ----------
    arc : ndarray, shape (m,)
        Material coordinate of each marker [m].
    positions : ndarray, shape (m, 3)
        World positions [m].
    nodes : ndarray, shape (n+1,)
        Material coordinates of the mesh [m].

    Returns
    -------
    ndarray, shape (n, 3)
        From A to B.  Shape-preserving cubics: markers with errors do not make loops.
    """
    return np.diff(PchipInterpolator(arc, positions, extrapolate=True)(nodes), axis=0)
