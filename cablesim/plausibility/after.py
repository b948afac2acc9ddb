"""What is odd about the states of a run.

Depends on: scene, trajectory.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cablesim.scene import GriddedCurrent
from cablesim.trajectory.quantities import Quantities

Array = NDArray[np.float64]

_ROUNDING = 1e-6  # of the cable's length
_NO_LENGTH = 1e-9  # [m]

STRAIN = 0.05
TURN = math.radians(45.0)
PASSING = 0.05  # of the states: a whip that runs out of a free end
PUSH = 0.05  # of the largest tension: what axial waves may do in passing


def check_run(run: Quantities) -> tuple[str, ...]:
    """Sentences on what is odd about a run.

    Parameters
    ----------
    run : Quantities
        States and all that follows from them.
    """
    checks = (_strain, _compression, _breaking_load, _turns, _bend_radius, _surface, _map)
    return tuple(sentence for sentence in (check(run) for check in checks) if sentence is not None)


def _strain(run: Quantities) -> str | None:
    strain = _deployed(run, run.strain_tension) / run.scene.cable.axial_stiffness
    most, where = _largest(run, strain)
    if most <= STRAIN:
        return None
    return (
        f"the cable stretches by {most:.1%} ({where}); the law of tension is linear, and most cables break "
        "before: check cable.axial_stiffness and what pulls."
    )


def _compression(run: Quantities) -> str | None:
    """Buckling that the mesh resolves keeps a push below Euler's load of a segment."""
    tension = _deployed(run, run.tension)
    euler = math.pi**2 * run.scene.cable.bending_stiffness / np.maximum(run.lengths, _NO_LENGTH) ** 2
    explained = euler + _weight(run) + PUSH * max(float(np.nanmax(tension)), 0.0)
    push, where = _largest(run, np.where(-tension > explained, -tension, np.nan))
    if push < 0:
        return None
    return (
        f"the cable pushes with {push:.3g} N ({where}), more than its bending stiffness and weight explain: "
        "a real one buckles; give cable.bending_stiffness or shorter segments, and do not use this force."
    )


def _weight(run: Quantities) -> float:
    """Sum of the sizes of all weights in water [N]."""
    scene = run.scene
    bodies = sum(abs(body.mass - scene.water.density * body.volume) for body in scene.attachments)
    return abs(scene.cable.wet_weight) * scene.cable.length + bodies * scene.gravity


def _breaking_load(run: Quantities) -> str | None:
    limit = run.scene.cable.breaking_load
    if limit is None:
        return None
    most, where = _largest(run, _deployed(run, run.tension))
    if most <= limit:
        return None
    return (
        f"the tension reaches {most:.4g} N ({where}), above cable.breaking_load, {limit:g} N: the real cable "
        "breaks; pull less."
    )


def _turns(run: Quantities) -> str | None:
    turn = _turning(run)
    limits = np.full(run.mesh.segments + 1, TURN)  # of all nodes, of which the inner ones are joints
    # a body hangs in a kink of a cable without stiffness, and in a sharp bend of one with it
    limits[run.mesh.attachment_nodes] = math.inf if run.scene.cable.bending_stiffness == 0 else 2 * TURN
    sharp = turn > limits[1:-1]
    if sharp.any(axis=1).mean() <= PASSING:
        return None
    most, where = _largest(run, np.where(sharp, turn, np.nan), at_joints=True)
    return (
        f"neighbouring segments turn by {math.degrees(most):.0f} degrees ({where}): the mesh is too coarse "
        "for this bend; refine it there with mesh.refine, or give cable.bending_stiffness."
    )


def _bend_radius(run: Quantities) -> str | None:
    limit = run.scene.cable.minimum_bend_radius
    if limit is None or run.scene.cable.bending_stiffness == 0:
        return None
    lengths = np.broadcast_to(run.lengths, run.tension.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        curvature = 2 * np.tan(_turning(run) / 2) / (0.5 * (lengths[:, 1:] + lengths[:, :-1]))
    most, where = _largest(run, curvature, at_joints=True)
    if most * limit <= 1:
        return None
    return (
        f"the cable bends to a radius of {1 / most:.3g} m ({where}), below cable.minimum_bend_radius, "
        f"{limit:g} m: guide it there, or pull more."
    )


def _surface(run: Quantities) -> str | None:
    height, surface = run.position[..., 2], run.scene.water.surface
    margin = _ROUNDING * run.scene.cable.length
    if surface is None:
        if run.scene.water.density == 0 or height[0].max() >= -margin:
            return None
        surface = 0.0
    time, node = np.unravel_index(int(np.argmax(height)), height.shape)
    above = float(height[time, node]) - surface
    if above <= margin:
        return None
    return (
        f"the cable rises {above:.3g} m above the surface, z = {surface:g} m (t = {run.times[time]:.4g} s, "
        f"s = {_node_places(run)[time, node]:.4g} m), and is computed as if in water there: lower it, or say "
        "in water.surface where the surface is."
    )


def _map(run: Quantities) -> str | None:
    current = run.scene.water.current
    if not isinstance(current, GriddedCurrent):
        return None
    beyond = [
        f"{name} = {low:.4g} to {high:.4g} m of {axis[0]:.4g} to {axis[-1]:.4g} m"
        for name, axis, places in zip(
            "xyz", (current.x, current.y, current.z), np.moveaxis(run.position, -1, 0), strict=True
        )
        if axis.size > 1
        for low, high in [(float(places.min()), float(places.max()))]
        if low < axis[0] or high > axis[-1]
    ]
    if not beyond:
        return None
    return (
        f"the cable leaves the current map ({'; '.join(beyond)}): outside, the values at its edge hold; "
        "give a larger map."
    )


def _deployed(run: Quantities, values: Array) -> Array:
    """Values of segments, NaN for what is on the drum."""
    return np.where(np.arange(values.shape[1]) <= run.last_segment, values, np.nan)


def _turning(run: Quantities) -> Array:
    """Angle between neighbouring segments (time, segment - 1), NaN on the drum."""
    tangent = run.tangent
    cosine = np.einsum("tec,tec->te", tangent[:, 1:], tangent[:, :-1])
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.where(np.arange(1, tangent.shape[1]) <= run.last_segment, angle, np.nan)


def _node_places(run: Quantities) -> Array:
    """Material coordinates of the nodes (time, node); nodes on the drum are at the outlet."""
    lengths = np.broadcast_to(run.lengths, run.tension.shape)
    return np.pad(np.cumsum(lengths, axis=1), ((0, 0), (1, 0)))


def _largest(run: Quantities, values: Array, *, at_joints: bool = False) -> tuple[float, str]:
    """Largest value at segments or at the joints between them, with time and place in words."""
    if not np.isfinite(values).any():
        return -math.inf, ""
    time, index = np.unravel_index(int(np.nanargmax(values)), values.shape)
    places = _node_places(run)[time]
    s = places[index + 1] if at_joints else 0.5 * (places[index] + places[index + 1])
    return float(values[time, index]), f"t = {run.times[time]:.4g} s, s = {s:.4g} m"
