"""Natural scales of a scene, and the absolute tolerances that follow from them.

Depends on: scene, physics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.model import CableModel
from cablesim.physics.parameters import DRAG_NORMAL, DRAG_POINT, MASS, WET_WEIGHT
from cablesim.scene import Scene

Array = NDArray[np.float64]

# Absolute tolerance of each kind of unknown = rtol * scale * factor.  Measured on S1, S3 and the
# V-system: directions cost least when they are held tighter than the rest, and a tension held
# tighter than this makes IDA follow axial waves that move nothing (README, design notes).
VELOCITY_FACTOR = 2.0
CHORD_FACTOR = 0.1
TENSION_FACTOR = 100.0
PLACE_FACTOR = 0.3

SLOWEST = 0.05  # [m/s]
WEAKEST = 1e-3  # [N]


@dataclass(frozen=True)
class Scales:
    """Length [m], velocity [m/s] and tension [N] that are typical of a scene."""

    length: float
    velocity: float
    tension: float


def scene_scales(scene: Scene, model: CableModel, y: Array) -> Scales:
    """Scales of a scene that starts at state `y`."""
    length = scene.cable.length
    velocity = max(_input_speed(scene, model), _falling_speed(scene, model), SLOWEST)
    loads = model.loads(0.0)
    weight = float(np.abs(loads[:, WET_WEIGHT]).sum())
    drag = float(loads[:, [DRAG_NORMAL, DRAG_POINT]].sum()) * velocity**2
    start = float(np.sqrt(np.mean(model.layout.tension(y) ** 2)))
    return Scales(length, velocity, max(start, 0.5 * weight, 0.5 * drag, WEAKEST))


def absolute_tolerances(scales: Scales, model: CableModel, rtol: float) -> Array:
    """Absolute tolerance of every unknown, shape (size,)."""
    layout = model.layout
    atol = np.empty(layout.size)
    layout.velocity(atol)[:] = VELOCITY_FACTOR * scales.velocity
    layout.end_velocity(atol)[:] = VELOCITY_FACTOR * scales.velocity
    layout.chord(atol)[:] = CHORD_FACTOR
    layout.tension(atol)[:] = TENSION_FACTOR * scales.tension
    layout.end_place(atol)[:] = PLACE_FACTOR * scales.length
    return rtol * atol


def _input_speed(scene: Scene, model: CableModel) -> float:
    """Fastest prescribed end, or water."""
    ends = [end.motion.speed_limit(scene.duration) for end in (scene.end_a, scene.end_b) if end.motion]
    water = float(np.sqrt((model.parameters.current_velocity**2).sum(axis=-1).max()))
    return max([water, *ends])


def _falling_speed(scene: Scene, model: CableModel) -> float:
    """Speed at which the cable sinks sideways, or falls through its own length where drag is weak."""
    loads = model.loads(0.0)
    weight = float(np.abs(loads[:, WET_WEIGHT]).sum())
    drag = float(loads[:, [DRAG_NORMAL, DRAG_POINT]].sum())
    falling = np.sqrt(2.0 * weight / float(loads[:, MASS].sum()) * scene.cable.length)
    return float(min(falling, np.sqrt(weight / drag) if drag > 0.0 else np.inf))
