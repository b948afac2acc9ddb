"""Decides once, when a scene is compiled, what its equations need and what they can skip.

Depends on: scene, physics.parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.parameters import GRIDDED, PROFILE, STILL, UNIFORM, Features
from cablesim.scene import (
    Current,
    End,
    GriddedCurrent,
    ProfileCurrent,
    Scene,
    StillWater,
    UniformCurrent,
)

Array = NDArray[np.float64]

IN_PLANE = 1e-12  # horizontal distance out of the plane, over the distance in it


@dataclass(frozen=True)
class Frame:
    """The coordinates in which a scene is solved: the world's, or those of a vertical plane.

    Attributes
    ----------
    axes : ndarray, shape (D, 3)
        Orthonormal world vectors of the D coordinates; the last one is up.
    origin : ndarray, shape (3,)
        World place of the frame's origin [m].
    """

    axes: Array
    origin: Array

    @property
    def dimension(self) -> int:
        """Number of coordinates D."""
        return self.axes.shape[0]

    def vectors_in(self, world: Array) -> Array:
        """Components (..., D) of world vectors (..., 3)."""
        return world @ self.axes.T

    def vectors_out(self, local: Array) -> Array:
        """World vectors (..., 3) of components (..., D)."""
        return local @ self.axes

    def places_in(self, world: Array) -> Array:
        """Coordinates (..., D) of world places (..., 3)."""
        return (world - self.origin) @ self.axes.T

    def places_out(self, local: Array) -> Array:
        """World places (..., 3) of coordinates (..., D)."""
        return local @ self.axes + self.origin


SPACE = Frame(np.eye(3), np.zeros(3))


def scene_frame(scene: Scene, vectors: Array) -> Frame:
    """Vertical plane that holds all motion of a scene, or the whole space.

    Parameters
    ----------
    scene : Scene
        Ends, currents and attachments.
    vectors : ndarray, shape (m, 3)
        Directions of the segments of the first shape, and its velocities when it moves.

    Returns
    -------
    Frame
        Two coordinates when every vector of the scene lies in one vertical plane, else three.
    """
    if not scene.numerics.skip or isinstance(scene.water.current, GriddedCurrent):
        return SPACE
    origin = _origin(scene)
    horizontal = np.concatenate(
        [
            vectors,
            *(_end_vectors(end, origin) for end in (scene.end_a, scene.end_b)),
            _current_vectors(scene),
        ]
    )[:, :2]
    lengths = np.linalg.norm(horizontal, axis=1)
    vertical = lengths.max() <= IN_PLANE
    axis = np.array([1.0, 0.0]) if vertical else horizontal[lengths.argmax()] / lengths.max()
    across = np.abs(horizontal @ [-axis[1], axis[0]])
    if across.max() > IN_PLANE * max(lengths.max(), 1.0):
        return SPACE
    return Frame(np.array([[axis[0], axis[1], 0.0], [0.0, 0.0, 1.0]]), origin)


def _origin(scene: Scene) -> Array:
    """A place in the plane: the start of the first end that has one."""
    for end in (scene.end_a, scene.end_b):
        if end.motion is not None:
            return end.motion.position(0.0)
    return np.zeros(3)


def _end_vectors(end: End, origin: Array) -> Array:
    """Vectors (m, 3) that span the motion of an end: it lies in a plane when all of them do."""
    vectors = [np.zeros((1, 3))]
    if end.motion is not None:
        places = end.motion.coefficients[:, 0] - origin
        vectors += [places, end.motion.coefficients[:, 1:].reshape(-1, 3)]
    if end.clamp is not None:
        vectors.append(end.clamp[None])
    return np.concatenate(vectors)


def _current_vectors(scene: Scene) -> Array:
    current = scene.water.current
    if isinstance(current, UniformCurrent):
        return current.velocity[None]
    if isinstance(current, ProfileCurrent):
        return current.velocities
    return np.zeros((1, 3))


def scene_features(scene: Scene, frame: Frame) -> Features:
    """Features that a scene's equations are compiled for."""
    needs_all = not scene.numerics.skip
    bending = scene.cable.bending_stiffness > 0.0
    return Features(
        dimension=frame.dimension,
        bending=bending or needs_all,
        damping=scene.damping_time > 0.0 or needs_all,
        point_drag=any(a.drag_area > 0.0 for a in scene.attachments) or needs_all,
        current=_current_kind(scene.water.current, needs_all),
        free_a=scene.end_a.motion is None,
        free_b=scene.end_b.motion is None,
        clamp_a=bending and scene.end_a.clamp is not None,
        clamp_b=bending and scene.end_b.clamp is not None,
        winch=scene.winch is not None,
    )


def _current_kind(current: Current, needs_all: bool) -> int:
    if isinstance(current, GriddedCurrent):
        return GRIDDED
    if isinstance(current, ProfileCurrent) or needs_all:
        return PROFILE
    return STILL if isinstance(current, StillWater) else UNIFORM


def describe_needs(features: Features) -> dict[str, str]:
    """What is computed and what is skipped, in words, for people.

    Returns
    -------
    dict
        Name of the feature -> "skipped: why" or "computed: what".
    """
    currents = {
        STILL: "skipped: still water, no positions needed",
        UNIFORM: "computed: uniform, no positions needed",
        PROFILE: "computed: profile, positions followed",
        GRIDDED: "computed: grid in space and time, positions followed",
    }
    planar = features.dimension == 2
    return {
        "third dimension": "skipped: all motion stays in one vertical plane" if planar else "computed",
        "bending": "computed" if features.bending else "skipped: no bending stiffness",
        "structural damping": "computed" if features.damping else "skipped: damping time is zero",
        "attachment drag": "computed" if features.point_drag else "skipped: no attachment has a drag area",
        "current": currents[features.current],
        "winch": "computed" if features.winch else "skipped: fixed length",
    }
