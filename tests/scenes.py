"""Scenes for the tests, made directly from the dataclasses; every helper takes changes by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablesim import motion
from cablesim.scene import (
    Attachment,
    Cable,
    CatenaryShape,
    Current,
    End,
    EquilibriumShape,
    GriddedCurrent,
    InitialShape,
    MarkerShape,
    MeshRules,
    Numerics,
    Output,
    ProfileCurrent,
    Scene,
    StillWater,
    TautShape,
    UniformCurrent,
    Water,
)

G = 9.81
WATER, VACUUM = 1000.0, 0.0
FREE = End(motion=None)


def cable(*, density: float = WATER, gravity: float = G, **changes: Any) -> Cable:
    """The rope of the peers' scenes; the wet weight follows from the section unless given."""
    values: dict[str, Any] = {
        "length": 3.0,
        "diameter": 5e-3,
        "mass_per_length": 0.055,
        "axial_stiffness": 1e4,
        "bending_stiffness": 0.0,
        "drag_normal": 1.2,
        "drag_tangential": 0.01,
        "added_mass_normal": 1.0,
        "added_mass_tangential": 0.0,
        "structural_damping": 1e-3,
    }
    values |= changes
    circle = np.pi * values["diameter"] ** 2 / 4.0
    values = {"displaced_section": circle, "added_mass_section": circle} | values
    buoyancy = density * values["displaced_section"]
    values.setdefault("wet_weight", (values["mass_per_length"] - buoyancy) * gravity)
    return Cable(**values)


def body(position: float, **changes: Any) -> Attachment:
    """A point body without any property but those given."""
    values: dict[str, Any] = {"mass": 0.0, "volume": 0.0, "drag_area": 0.0, "added_mass": 0.0}
    return Attachment(name=f"body_{position:g}", kind="body", position=position, **(values | changes))


def held(position: ArrayLike, clamp: ArrayLike | None = None) -> End:
    """An end at rest."""
    return End(motion=motion.fixed(position), clamp=None if clamp is None else np.asarray(clamp, float))


def towed(position: ArrayLike, velocity: ArrayLike) -> End:
    """An end in uniform motion."""
    return End(motion=motion.velocity_waypoints(position, [0.0], np.array([velocity])))


def driven(position: ArrayLike, waypoints: ArrayLike) -> End:
    """An end whose velocity is linear between waypoints (t, x, y, z)."""
    table = np.asarray(waypoints, dtype=float)
    return End(motion=motion.velocity_waypoints(position, table[:, 0], table[:, 1:]))


def scene(
    *,
    rope: Cable | None = None,
    a: End | None = None,
    b: End | None = None,
    segments: int = 20,
    attachments: Sequence[Attachment] = (),
    density: float = WATER,
    gravity: float = G,
    current: Current | None = None,
    initial: InitialShape | None = None,
    duration: float = 1.0,
    interval: float | None = None,
    variables: tuple[str, ...] = (),
    markers: ArrayLike = (),
    **numerics: Any,
) -> Scene:
    """A scene; by default the rope hangs at rest between two points 1.5 m apart; the mesh damps nothing."""
    rope = cable(density=density, gravity=gravity) if rope is None else rope
    return Scene(
        name="test",
        gravity=gravity,
        water=Water(density=density, current=StillWater() if current is None else current),
        cable=rope,
        mesh=MeshRules(segment_length=rope.length / segments),
        attachments=tuple(attachments),
        imus=(),
        end_a=held([0.0, 0.0, 0.0]) if a is None else a,
        end_b=held([1.5, 0.0, 0.0]) if b is None else b,
        initial=EquilibriumShape() if initial is None else initial,
        duration=duration,
        numerics=Numerics(**({"mesh_damping": 0.0} | numerics)),
        output=Output(
            interval=duration / 10.0 if interval is None else interval,
            variables=variables,
            markers=np.asarray(markers, dtype=float),
        ),
        source="name: test\n",
    )


def straight(start: ArrayLike, direction: ArrayLike, length: float) -> MarkerShape:
    """A straight first shape that also says where a cable without held ends is."""
    unit = np.asarray(direction, dtype=float)
    unit = unit / np.linalg.norm(unit)
    arc = np.linspace(0.0, length, 5)
    return MarkerShape(arc=arc, positions=np.asarray(start, float) + arc[:, None] * unit)


def uniform_in_time(times: ArrayLike, velocities: ArrayLike) -> GriddedCurrent:
    """Water that moves the same everywhere, linearly in time between the given velocities."""
    one = np.zeros(1)
    table = np.asarray(velocities, dtype=float)[:, None, None, None, :]
    return GriddedCurrent(times=np.asarray(times, float), x=one, y=one, z=one, velocities=table)


# The scenes of the peers ------------------------------------------------------------------------

SWAY = [[0.0, 0, 0.0, 0], [0.5, 0, 0.5, 0], [4.0, 0, 0.5, 0], [4.5, 0, 0.0, 0]]
PEER_MARKERS = np.linspace(0.0, 3.0, 16)


def sway(*, heading: float = 0.0, **changes: Any) -> Scene:
    """S1: one end of a hanging rope is moved 2 m sideways; all turned by `heading` about z."""
    turn = rotation(heading)
    waypoints = np.array(SWAY)
    waypoints[:, 1:] = waypoints[:, 1:] @ turn.T
    values: dict[str, Any] = {
        "b": driven(turn @ [1.5, 0.0, 0.0], waypoints),
        "segments": 60,
        "duration": 10.0,
        "interval": 0.02,
        "variables": ("position", "marker_position"),
        "markers": PEER_MARKERS,
    }
    return scene(**(values | changes))


def pendulum(*, density: float = WATER, **changes: Any) -> Scene:
    """S3, or S3v in vacuum: a rope at 45 degrees is let go at its lower end."""
    vacuum = density == VACUUM
    values: dict[str, Any] = {
        "rope": cable(density=density, structural_damping=0.0 if vacuum else 1e-3),
        "b": FREE,
        "initial": TautShape(direction=np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)),
        "segments": 60,
        "duration": 3.0 if vacuum else 6.0,
        "interval": 0.02,
        "markers": PEER_MARKERS,
    }
    return scene(density=density, **(values | changes))


def rotation(angle: float) -> np.ndarray:
    """Matrix that turns vectors by `angle` about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def mirrored(original: Scene) -> Scene:
    """The same scene with s counted from the other end; clamps point the other way."""
    length = original.cable.length
    ends = [replace(e, clamp=None if e.clamp is None else -e.clamp) for e in (original.end_b, original.end_a)]
    bodies = [replace(a, position=length - a.position) for a in original.attachments]
    initial = original.initial
    if isinstance(initial, TautShape) and initial.direction is not None:
        initial = TautShape(direction=-initial.direction)
    return replace(original, end_a=ends[0], end_b=ends[1], attachments=tuple(bodies), initial=initial)


__all__ = [
    "FREE",
    "PEER_MARKERS",
    "VACUUM",
    "WATER",
    "CatenaryShape",
    "EquilibriumShape",
    "G",
    "GriddedCurrent",
    "MarkerShape",
    "ProfileCurrent",
    "TautShape",
    "UniformCurrent",
    "body",
    "cable",
    "driven",
    "held",
    "mirrored",
    "pendulum",
    "rotation",
    "scene",
    "straight",
    "sway",
    "towed",
    "uniform_in_time",
]
