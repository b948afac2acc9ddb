"""What is odd about a scene before it is run.

Depends on: scene.
"""

from __future__ import annotations

import math

import numpy as np

from cablesim.scene import EquilibriumShape, GriddedCurrent, Scene, StillWater

LARGEST_DIAMETER = 1.0  # [m]
SMALLEST_DIAMETER = 1e-4  # [m]
WATER = (500.0, 2500.0)  # [kg/m3], brines and muds included
CABLE = (50.0, 23_000.0)  # [kg/m3], from foam to osmium
GRAVITY = (0.1, 30.0)  # [m/s2], from an asteroid's to Jupiter's
BODY = (1.0, 23_000.0)  # [kg/m3], from a balloon to osmium


def check_scene(scene: Scene) -> tuple[str, ...]:
    """Sentences on what is odd about a scene.

    Parameters
    ----------
    scene : Scene
        What is to be simulated.
    """
    found = [
        _diameter(scene) or _cable_density(scene),
        _water_density(scene),
        _gravity(scene),
        *_body_densities(scene),
        _bend_radius(scene),
        _map_duration(scene),
        _any_rest_shape(scene),
    ]
    return tuple(sentence for sentence in found if sentence is not None)


def _diameter(scene: Scene) -> str | None:
    diameter = scene.cable.diameter
    if diameter > LARGEST_DIAMETER:
        return f"cable.diameter is {diameter:g} m; did you mean {diameter:g} mm?"
    if diameter < SMALLEST_DIAMETER:
        return f"cable.diameter is {diameter:g} m; did you mean {1e3 * diameter:g} m?"
    return None


def _cable_density(scene: Scene) -> str | None:
    cable = scene.cable
    density = cable.mass_per_length / (math.pi * cable.diameter**2 / 4)
    if CABLE[0] <= density <= CABLE[1]:
        return None
    return (
        f"cable.mass_per_length {cable.mass_per_length:g} kg/m and cable.diameter {cable.diameter:g} m make "
        f"a cable of {density:.3g} kg/m3; check their units."
    )


def _water_density(scene: Scene) -> str | None:
    density = scene.water.density
    if density == 0 or WATER[0] <= density <= WATER[1]:
        return None
    meant = f"did you mean {1e3 * density:g} kg/m3?" if density < 10 else "water has some 1000."
    return f"water.density is {density:g} kg/m3; {meant}"


def _gravity(scene: Scene) -> str | None:
    if scene.gravity == 0 or GRAVITY[0] <= scene.gravity <= GRAVITY[1]:
        return None
    return f"gravity is {scene.gravity:g} m/s2; the Earth's is 9.81."


def _body_densities(scene: Scene) -> list[str]:
    return [
        f"attachment '{body.name}' has {body.mass:g} kg in {body.volume:g} m3, that is "
        f"{body.mass / body.volume:.3g} kg/m3; check the units of mass and volume."
        for body in scene.attachments
        if body.volume > 0 and body.mass > 0 and not BODY[0] <= body.mass / body.volume <= BODY[1]
    ]


def _bend_radius(scene: Scene) -> str | None:
    if scene.cable.minimum_bend_radius is None or scene.cable.bending_stiffness > 0:
        return None
    return (
        "cable.minimum_bend_radius cannot be judged: a cable without cable.bending_stiffness bends sharply; "
        "give the stiffness."
    )


def _map_duration(scene: Scene) -> str | None:
    current = scene.water.current
    if not isinstance(current, GriddedCurrent) or current.times.size < 2:
        return None
    first, last = float(current.times[0]), float(current.times[-1])
    if first <= 0 and last >= scene.duration * (1 - 1e-9):
        return None
    return (
        f"the current map is known from {first:g} to {last:g} s, the run lasts {scene.duration:g} s: "
        "outside, the map's first and last hold; give a longer map."
    )


def _any_rest_shape(scene: Scene) -> str | None:
    """A slack cable that nothing pulls and that does not bend rests in any shape."""
    a, b = scene.end_a.motion, scene.end_b.motion
    start, cable = scene.initial, scene.cable
    if not isinstance(start, EquilibriumShape) or start.guess is not None or a is None or b is None:
        return None
    lifts = [scene.gravity * (body.mass - scene.water.density * body.volume) for body in scene.attachments]
    pulled = any(abs(force) > 1e-12 for force in (cable.wet_weight, *lifts))
    slack = np.linalg.norm(b.position(0.0) - a.position(0.0)) < scene.start_length
    still = isinstance(scene.water.current, StillWater)
    if pulled or not still or cable.bending_stiffness > 0 or not slack:
        return None
    return (
        "nothing pulls at the slack cable: any shape is at rest, and one was chosen; say which with "
        "initial.through, or with the shape `markers`."
    )
