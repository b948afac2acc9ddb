"""Natural scales of a scene, and the absolute tolerances that follow from them.

Depends on: scene, motion, physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cablesim.motion import Motion
from cablesim.physics.model import CableModel
from cablesim.physics.parameters import DRAG_NORMAL, DRAG_POINT, MASS, WET_WEIGHT
from cablesim.scene import Scene

Array = NDArray[np.float64]

# Absolute tolerance of each kind of unknown = rtol * scale * factor (`validation/work_precision.py` has
# the alternatives).  Tensions and velocities go together: an error of velocity passes on as an axial
# wave of tension.  A tension held much tighter than that jumps, in units of its tolerance, whenever the
# step changes; IDA then falls back to first order and stays there.
VELOCITY_FACTOR = 2.0
CHORD_FACTOR = 0.1
WAVE_FACTOR = 4.0
TENSION_FACTOR = 100.0
PLACE_FACTOR = 0.3

SLOWEST = 0.05  # [m/s]
WEAKEST = 1e-3  # [N]


@dataclass(frozen=True)
class Scales:
    """What is typical of a scene.

    Attributes
    ----------
    length : float
        Length of the cable [m].
    velocity : float
        Fastest motion that is prescribed, or that the cable takes up when it starts out of balance [m/s].
    tension : float
        What weight, drag and the start load the cable with [N].
    wave : float
        Tension of an axial wave of the typical velocity, sqrt(EA m) V with the bodies' share in m [N].
    """

    length: float
    velocity: float
    tension: float
    wave: float


def scene_scales(scene: Scene, model: CableModel, y: Array, yp: Array) -> Scales:
    """Scales of a scene that starts at state `y` with rates `yp`."""
    loads = model.loads(0.0)
    velocity = max(_input_speed(scene, model, y), _falling_speed(scene, model, yp), SLOWEST)
    weight = float(np.abs(loads[:, WET_WEIGHT]).sum())
    drag = float(loads[:, [DRAG_NORMAL, DRAG_POINT]].sum()) * velocity**2
    start = float(np.sqrt(np.mean(model.layout.tension(y) ** 2)))
    mass_per_length = float(loads[:, MASS].sum()) / scene.start_length
    impedance = math.sqrt(scene.cable.axial_stiffness * mass_per_length)
    return Scales(
        length=scene.cable.length,
        velocity=velocity,
        tension=max(start, 0.5 * weight, 0.5 * drag, WEAKEST),
        wave=impedance * velocity,
    )


def absolute_tolerances(scales: Scales, model: CableModel, rtol: float) -> Array:
    """Absolute tolerance of every unknown, shape (size,)."""
    layout = model.layout
    atol = np.empty(layout.size)
    layout.velocity(atol)[:] = VELOCITY_FACTOR * scales.velocity
    layout.end_velocity(atol)[:] = VELOCITY_FACTOR * scales.velocity
    layout.chord(atol)[:] = CHORD_FACTOR
    layout.tension(atol)[:] = min(WAVE_FACTOR * scales.wave, TENSION_FACTOR * scales.tension)
    layout.end_place(atol)[:] = PLACE_FACTOR * scales.length
    return rtol * atol


def _input_speed(scene: Scene, model: CableModel, y: Array) -> float:
    """Fastest prescribed end, program of the winch, water or part of the cable at the start."""
    motions = [scene.end_a.motion, scene.end_b.motion, scene.winch.payout if scene.winch else None]
    speeds = [motion.speed_limit(scene.duration) for motion in motions if isinstance(motion, Motion)]
    for velocities in (model.parameters.current_velocity, model.layout.node_velocity(y)):
        speeds.append(float(np.sqrt((velocities**2).sum(axis=-1).max())))
    return max(speeds)


def _falling_speed(scene: Scene, model: CableModel, yp: Array) -> float:
    """Speed that the cable takes up by itself.

    Out of balance it falls through its own length with the acceleration of the start, that of its
    weight at most; where drag is strong it sinks sideways at an even speed.
    """
    loads = model.loads(0.0)
    mass, weight = loads[:, MASS], float(np.abs(loads[:, WET_WEIGHT]).sum())
    drag = float(loads[:, [DRAG_NORMAL, DRAG_POINT]].sum())
    accelerations = (model.layout.node_velocity(yp) ** 2).sum(axis=-1)
    start = math.sqrt(float(mass @ accelerations / mass.sum()))
    falling = math.sqrt(2.0 * min(start, weight / float(mass.sum())) * scene.cable.length)
    return min(falling, math.sqrt(weight / drag) if drag > 0.0 else math.inf)
