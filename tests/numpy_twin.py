"""The equations of the cable in plain NumPy, in three dimensions, from the table of the design notes.

Written to be read against that table: arrays over nodes and segments, cross products for the
moments, places of the nodes always known.  Slow, and of use only to check the compiled equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from cablesim.mesh import Mesh
from cablesim.scene import GriddedCurrent, ProfileCurrent, Scene, StillWater, UniformCurrent

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unknowns:
    """Node velocities (n+1, 3), tensions (n,), chords over unstretched lengths (n, 3), place of B (3,)."""

    V: Array
    T: Array
    q: Array
    w: Array


def residual(scene: Scene, mesh: Mesh, t: float, state: Unknowns, rate: Unknowns) -> Unknowns:
    """Rows of F, named after the unknowns in whose place they stand."""
    tangent = unit(state.q)
    balance = inertia_drag_and_weight(scene, mesh, t, state, rate)
    tau = scene.cable.structural_damping
    force = (state.T + tau * rate.T)[:, None] * tangent + shear(scene, mesh, state.q + tau * rate.q)
    balance[:-1] -= force
    balance[1:] += force
    return Unknowns(
        V=held_ends(scene, t, state, balance),
        T=tension_rows(scene, mesh, t, state, rate),
        q=rate.q - np.diff(state.V, axis=0) / mesh.reference_lengths[:, None],
        w=rate.w - state.V[-1] + end_velocity(scene.end_a, t),
    )


def tension_rows(scene: Scene, mesh: Mesh, t: float, state: Unknowns, rate: Unknowns) -> Array:
    """Compatibility along the tangent, and the feedback that ties T to the length of the chord."""
    EA, beta = scene.cable.axial_stiffness, scene.numerics.strain_feedback
    stretching = np.sum(np.diff(state.V, axis=0) * unit(state.q), axis=1)
    if scene.winch is not None:
        stretching[-1] -= scene.winch.payout.velocity(t)[0] * (1.0 + state.T[-1] / EA)
    strain = chord_lengths(mesh, state.q) / mesh.lengths - 1.0
    return rate.T / EA - stretching / mesh.lengths - beta * (strain - state.T / EA)


def chord_lengths(mesh: Mesh, q: Array) -> Array:
    """Distances between neighbouring nodes."""
    return mesh.reference_lengths * np.linalg.norm(q, axis=1)


def held_ends(scene: Scene, t: float, state: Unknowns, balance: Array) -> Array:
    """Balance of forces, but for the rows of prescribed ends."""
    rows = balance.copy()
    if scene.end_a.motion is not None:
        rows[0] = state.V[0] - scene.end_a.motion.velocity(t)
    if scene.end_b.motion is not None:
        gap = scene.end_b.motion.position(t) - place_of_a(scene, t) - state.w
        rows[-1] = state.V[-1] - scene.end_b.motion.velocity(t) - scene.numerics.closure_feedback * gap
    return rows


# Bending ------------------------------------------------------------------------------------------


def joint_tangents(scene: Scene, q: Array) -> tuple[Array, Array]:
    """Tangents before and after each of the n+1 joints; a ball joint goes straight on."""
    tangent = unit(q)
    first = tangent[0] if scene.end_a.clamp is None else scene.end_a.clamp
    last = tangent[-1] if scene.end_b.clamp is None else scene.end_b.clamp
    return np.vstack((first, tangent)), np.vstack((tangent, last))


def moments(scene: Scene, mesh: Mesh, q: Array) -> Array:
    """M_j = 2 EI (t_(j-1) x t_j) / (1 + t_(j-1).t_j) / lbar_j."""
    before, after = joint_tangents(scene, q)
    opening = (1.0 + np.sum(before * after, axis=1)) * mesh.node_lengths
    return 2.0 * scene.cable.bending_stiffness * np.cross(before, after) / opening[:, None]


def shear(scene: Scene, mesh: Mesh, q: Array) -> Array:
    """Q_e = t_e x (M_(e+1) - M_e) / stretched length."""
    length = chord_lengths(mesh, q)
    return np.cross(unit(q), np.diff(moments(scene, mesh, q), axis=0)) / length[:, None]


def bending_energy(scene: Scene, mesh: Mesh, q: Array) -> float:
    """Its derivative by the angle a between two segments is |M_j| = 2 EI tan(a/2) / lbar."""
    before, after = joint_tangents(scene, q)
    angle = np.arctan2(np.linalg.norm(np.cross(before, after), axis=1), np.sum(before * after, axis=1))
    return float(np.sum(-4.0 * scene.cable.bending_stiffness / mesh.node_lengths * np.log(np.cos(angle / 2))))


# Nodes --------------------------------------------------------------------------------------------


def inertia_drag_and_weight(scene: Scene, mesh: Mesh, t: float, state: Unknowns, rate: Unknowns) -> Array:
    """All of the balance of forces that does not come from the segments' pull."""
    U, A = water(scene, t, places(scene, mesh, t, state))
    v, a = state.V - U, rate.V - A
    rows = bodies(scene, mesh, v, rate.V, A)
    tangent, half = unit(state.q), 0.5 * mesh.lengths[:, None]
    for ends in (slice(0, -1), slice(1, None)):  # the half segments after, and before, their nodes
        rows[ends] += half * per_metre(scene, tangent, v[ends], a[ends], rate.V[ends], A[ends])
    return rows


def per_metre(scene: Scene, tangent: Array, v: Array, a: Array, V_rate: Array, A: Array) -> Array:
    """Of bare cable with these tangents; v and a are relative to the water."""
    cable, rho = scene.cable, scene.water.density
    around = rho * cable.added_mass_section
    (v_n, v_t), (a_n, a_t) = split(v, tangent), split(a, tangent)
    rows = cable.mass_per_length * V_rate - rho * cable.displaced_section * A
    rows += around * (cable.added_mass_normal * a_n + cable.added_mass_tangential * a_t)
    rows += 0.5 * rho * cable.drag_normal * cable.diameter * size(v_n) * v_n
    rows += 0.5 * rho * cable.drag_tangential * np.pi * cable.diameter * size(v_t) * v_t
    return rows + cable.wet_weight * np.array([0.0, 0.0, 1.0])


def bodies(scene: Scene, mesh: Mesh, v: Array, V_rate: Array, A: Array) -> Array:
    """Of the attachments, on their nodes."""
    rows = np.zeros_like(v)
    for index, j in mesh.in_water():
        attachment = scene.attachments[index]
        displaced = scene.water.density * attachment.volume
        rows[j] += attachment.mass * V_rate[j] - displaced * A[j]
        rows[j] += attachment.added_mass * displaced * (V_rate[j] - A[j])
        rows[j] += 0.5 * scene.water.density * attachment.drag_area * np.linalg.norm(v[j]) * v[j]
        rows[j, 2] += (attachment.mass - displaced) * scene.gravity
    return rows


def places(scene: Scene, mesh: Mesh, t: float, state: Unknowns) -> Array:
    """Nodes: from A on, or back from B when A is free."""
    steps = np.cumsum(mesh.reference_lengths[:, None] * state.q, axis=0)
    from_a = np.vstack((np.zeros(3), steps))
    if scene.end_a.motion is None:
        return state.w - from_a[-1] + from_a
    return place_of_a(scene, t) + from_a


def place_of_a(scene: Scene, t: float) -> Array:
    """Place of end A, or the origin when it is free."""
    return np.zeros(3) if scene.end_a.motion is None else scene.end_a.motion.position(t)


def end_velocity(end, t: float) -> Array:
    """Prescribed velocity of an end, nought when it is free."""
    return np.zeros(3) if end.motion is None else end.motion.velocity(t)


def water(scene: Scene, t: float, nodes: Array) -> tuple[Array, Array]:
    """Velocity of the water and acceleration of its particles, dU/dt + (U.grad) U, at each node."""
    U, rate = water_at(scene, t, nodes)
    h = 1e-3  # [m]; along each axis the water is linear between its grid points
    for axis, step in enumerate(h * np.eye(3)):
        ahead, behind = (water_at(scene, t, nodes + sign * step)[0] for sign in (1.0, -1.0))
        rate = rate + U[:, axis, None] * (ahead - behind) / (2.0 * h)
    return U, rate


def water_at(scene: Scene, t: float, nodes: Array) -> tuple[Array, Array]:
    """Velocity of the water and its rate at a fixed place, at each node."""
    current, still = scene.water.current, np.zeros_like(nodes)
    if isinstance(current, StillWater):
        return still, still
    if isinstance(current, UniformCurrent):
        return still + current.velocity, still
    if isinstance(current, ProfileCurrent):
        columns = [np.interp(nodes[:, 2], current.heights, column) for column in current.velocities.T]
        return np.stack(columns, axis=1), still
    assert isinstance(current, GriddedCurrent)
    return gridded(current, t, nodes)


def gridded(current: GriddedCurrent, t: float, nodes: Array) -> tuple[Array, Array]:
    """Interpolate each stored instant in space, then in time; t must lie within the times."""
    grid = (current.x, current.y, current.z)
    inside = np.stack([np.clip(nodes[:, k], grid[k][0], grid[k][-1]) for k in range(3)], axis=1)
    fields = np.stack([RegularGridInterpolator(grid, table)(inside) for table in current.velocities])
    after = int(np.searchsorted(current.times, t, side="right"))
    t0, t1 = current.times[after - 1], current.times[after]
    slope = (fields[after] - fields[after - 1]) / (t1 - t0)
    return fields[after - 1] + (t - t0) * slope, slope


def split(vectors: Array, tangent: Array) -> tuple[Array, Array]:
    """Parts normal to and along the tangents."""
    along = np.sum(vectors * tangent, axis=1, keepdims=True) * tangent
    return vectors - along, along


def size(vectors: Array) -> Array:
    return np.linalg.norm(vectors, axis=1, keepdims=True)


def unit(vectors: Array) -> Array:
    return vectors / size(vectors)
