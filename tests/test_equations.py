"""The compiled equations against a plain NumPy twin, finite differences and an energy."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy_twin as twin
import pytest
from numpy.typing import NDArray
from scenes import (
    FREE,
    GriddedCurrent,
    MarkerShape,
    ProfileCurrent,
    UniformCurrent,
    body,
    cable,
    driven,
    rotation,
    scene,
    uniform_in_time,
)

from cablesim.mesh import Mesh, build_mesh
from cablesim.motion import payout_waypoints
from cablesim.physics.model import CableModel, build_model
from cablesim.physics.needs import scene_frame
from cablesim.scene import Scene, Winch

Array = NDArray[np.float64]

TIME = 0.3  # [s], within the second piece of the motions below
SEGMENTS = 7
BODIES = (
    body(1.0, mass=0.2, volume=5e-5, drag_area=1e-3, added_mass=0.5),
    body(3.0, mass=0.1, drag_area=2e-3),
)
MOVES = [[0.0, 0.3, 0.1, -0.2], [0.2, 0.1, -0.4, 0.3], [1.0, 0.2, 0.5, 0.1]]
STIFF = cable(bending_stiffness=0.02, added_mass_tangential=0.1)
TURN = rotation(0.3)
CLAMP_A, CLAMP_B = np.array([0.8, 0.0, 0.6]), np.array([0.6, 0.8, 0.0])
PROFILE = ProfileCurrent(
    heights=np.array([-2.0, -0.5, 1.0]), velocities=np.array([[0.1, 0.2, 0], [0.4, -0.1, 0.1], [0, 0, 0]])
)


def planar(waypoints: list[list[float]]) -> Array:
    """Waypoints kept in the vertical plane through the turned x axis."""
    table = np.array(waypoints)
    table[:, 2] = 0.0
    table[:, 1:] = table[:, 1:] @ TURN.T
    return table


def grid() -> GriddedCurrent:
    velocities = 0.3 * np.random.default_rng(5).standard_normal((3, 2, 3, 4, 3))
    axes = {"x": np.array([-1.0, 1.0]), "y": np.array([-1.0, 0.2, 1.0]), "z": np.linspace(-2.0, 0.5, 4)}
    return GriddedCurrent(times=np.array([0.0, 0.2, 2.0]), velocities=velocities, **axes)


@cache
def scenes() -> dict[str, Scene]:
    """One scene for each set of features; the other tests compile few others."""
    a, b = driven([0.2, -0.1, 0.3], MOVES), driven([1.5, 0.4, 0.1], MOVES)
    plane_a = driven([0.2, -0.1, 0.3], planar(MOVES))
    plane_b = driven(np.array([0.2, -0.1, 0.3]) + TURN @ [1.5, 0.0, 0.1], planar(MOVES))
    undamped = cable(structural_damping=0.0)
    clamped: dict[str, Any] = {"a": replace(a, clamp=CLAMP_A), "b": replace(b, clamp=CLAMP_B)}
    parts: dict[str, Any] = {"attachments": BODIES, "segments": SEGMENTS}
    return {
        "planar": scene(a=plane_a, b=plane_b, segments=SEGMENTS),
        "planar, free end": scene(a=plane_a, b=FREE, segments=SEGMENTS),
        "planar, free end, undamped": scene(rope=undamped, a=plane_a, b=FREE, segments=SEGMENTS),
        "planar, bending, clamp, free end a": scene(
            rope=STIFF, a=FREE, b=replace(plane_b, clamp=TURN @ [0.6, 0.0, 0.8]), segments=SEGMENTS
        ),
        "space": scene(a=a, b=b, segments=SEGMENTS),
        "space, all, uniform": scene(
            rope=STIFF, current=UniformCurrent(velocity=np.array([0.2, -0.3, 0.1])), **clamped, **parts
        ),
        "space, all, profile": scene(rope=STIFF, a=a, b=b, current=PROFILE, **parts),
        "space, all, profile, free end": scene(rope=STIFF, a=a, b=FREE, current=PROFILE, skip=False, **parts),
        "space, map, both ends free": scene(a=FREE, b=FREE, current=grid(), initial=line(), **parts),
        "planar, winch": wound(scene(a=plane_a, b=plane_b, segments=SEGMENTS)),
        "space, all, uniform, winch": wound(
            scene(rope=STIFF, current=UniformCurrent(velocity=np.array([0.2, -0.3, 0.1])), **clamped, **parts)
        ),
    }


def wound(original: Scene) -> Scene:
    """The same cable with some of it, and a body, on a drum that speeds up."""
    payout = payout_waypoints(2.3, [0.0, 1.0], [0.4, -0.9])
    return replace(original, winch=Winch(deployed_length=2.3, payout=payout))


def line() -> MarkerShape:
    return MarkerShape(arc=np.array([0.0, 3.0]), positions=np.array([[0.0, 0, 0], [2.0, 1.0, -2.0]]))


NAMES = list(scenes())


def in_still_places(original: Scene) -> Scene:
    """The same features with water that moves the same everywhere: the Jacobian leaves out the rest."""
    current = original.water.current
    if isinstance(current, ProfileCurrent):
        current = ProfileCurrent(heights=current.heights, velocities=np.tile(current.velocities[1], (3, 1)))
    if isinstance(current, GriddedCurrent):
        current = uniform_in_time(current.times, current.velocities[:, 0, 0, 0])
    return replace(original, water=replace(original.water, current=current))


def compiled(original: Scene) -> tuple[CableModel, Mesh]:
    mesh = build_mesh(original)
    if original.winch is not None:
        length = original.winch.payout.position(TIME)[0]
        mesh = mesh.deployed(mesh.segments_at(length), length)
    plane = TURN @ [0.6, 0.0, 0.8]
    return build_model(original, mesh, scene_frame(original, plane[None])), mesh


def random_state(model: CableModel, seed: int) -> tuple[Array, Array]:
    """A state whose segments turn by well under a right angle from one to the next, and rates."""
    rng, layout = np.random.default_rng(seed), model.layout
    y, yp = 0.5 * rng.standard_normal((2, layout.size))
    chord = model.frame.vectors_in(TURN @ [0.6, 0.1, 0.8]) + 0.25 * rng.standard_normal(layout.chord(y).shape)
    layout.chord(y)[:] = (
        chord / np.linalg.norm(chord, axis=1)[:, None] * rng.uniform(0.9, 1.1, (len(chord), 1))
    )
    layout.tension(y)[:] = 5.0 * rng.standard_normal(layout.segments)
    layout.tension(yp)[:] = 1e3 * rng.standard_normal(layout.segments)
    return y, yp


def unknowns(model: CableModel, state: Array, *, is_place: bool) -> twin.Unknowns:
    """State in the world; the place of B counts from A when A is held, else from the origin."""
    layout, out = model.layout, model.frame.vectors_out
    w = out(layout.end_place(state))
    if is_place and model.features.free_a:
        w = model.frame.places_out(layout.end_place(state))
    return twin.Unknowns(out(layout.node_velocity(state)), layout.tension(state), out(layout.chord(state)), w)


def compiled_residual(model: CableModel, y: Array, yp: Array) -> Array:
    out = np.empty_like(y)
    model.residual(TIME, y, yp, out)
    return out


def finite_differences(model: CableModel, y: Array, yp: Array, c_j: float) -> Array:
    """dF/dY + c_j dF/dY' by central differences."""
    columns = []
    for i in range(y.size):
        h = np.zeros_like(y)
        h[i] = 1e-6 * max(1.0, abs(y[i]))
        plus, minus = (compiled_residual(model, y + s * h, yp + s * c_j * h) for s in (1.0, -1.0))
        columns.append((plus - minus) / (2.0 * h[i]))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_residual_equals_twin(name: str, seed: int) -> None:
    model, mesh = compiled(scenes()[name])
    y, yp = random_state(model, seed)
    found = unknowns(model, compiled_residual(model, y, yp), is_place=False)
    state, rate = unknowns(model, y, is_place=True), unknowns(model, yp, is_place=False)
    wanted = twin.residual(scenes()[name], mesh, TIME, state, rate)
    for kind in ("V", "T", "q", "w"):
        rows = getattr(wanted, kind)
        np.testing.assert_allclose(
            getattr(found, kind), rows, rtol=0, atol=1e-12 * np.abs(rows).max(), err_msg=kind
        )


@pytest.mark.parametrize("c_j", [0.0, 300.0])
@pytest.mark.parametrize("name", NAMES)
def test_jacobian_equals_finite_differences(name: str, c_j: float) -> None:
    model, _ = compiled(in_still_places(scenes()[name]))
    y, yp = random_state(model, 3)
    wanted = finite_differences(model, y, yp, c_j)
    found = np.zeros_like(wanted)
    model.jacobian(TIME, y, yp, c_j, found)
    row_scale = np.abs(wanted).max(axis=1, keepdims=True) + 1e-12
    assert np.abs((found - wanted) / row_scale).max() < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_nothing_of_the_jacobian_lies_outside_its_band(name: str) -> None:
    model, _ = compiled(in_still_places(scenes()[name]))
    y, yp = random_state(model, 4)
    lower, upper = model.bandwidths
    full = finite_differences(model, y, yp, 50.0)
    outside = full - np.triu(np.tril(full, upper), -lower)
    # a profile's weights (1 - w) + w leave rounding behind
    assert np.abs(outside).max() <= 1e-12 * np.abs(full).max()


@pytest.mark.parametrize("rows_above", [0, 5])
@pytest.mark.parametrize("name", NAMES)
def test_full_matrix_and_band_storage_agree(name: str, rows_above: int) -> None:
    model, _ = compiled(scenes()[name])
    y, yp = random_state(model, 5)
    full = np.zeros((y.size, y.size))
    model.jacobian(TIME, y, yp, 20.0, full)
    band = model.band_jacobian(TIME, y, yp, 20.0, rows_above)
    lower, upper = model.bandwidths
    wanted = np.zeros_like(band)
    for offset in range(-lower, upper + 1):
        diagonal = np.diagonal(full, offset)
        start = max(offset, 0)
        wanted[rows_above + upper - offset, start : start + diagonal.size] = diagonal
    assert np.array_equal(band, wanted)


def test_jacobian_leaves_what_lies_outside_the_band_alone() -> None:
    model, _ = compiled(scenes()["space, all, uniform"])
    y, yp = random_state(model, 6)
    lower, upper = model.bandwidths
    full = np.full((y.size, y.size), 7.0)
    model.jacobian(TIME, y, yp, 20.0, full)
    inside = np.triu(np.tril(np.ones_like(full), upper), -lower) > 0.0
    assert (full[~inside] == 7.0).all()


@pytest.mark.parametrize("name", ["space, all, uniform", "planar, bending, clamp, free end a"])
def test_bending_force_is_the_gradient_of_the_bending_energy(name: str) -> None:
    model, mesh = compiled(scenes()[name])
    y, _ = random_state(model, 7)
    found = nodal_bending_force(model, y)
    q = model.frame.vectors_out(model.layout.chord(y))
    wanted = np.zeros((mesh.segments + 1, 3))
    for e in range(mesh.segments):
        for axis in range(3):
            dq = np.zeros_like(q)
            dq[e, axis] = 1e-5
            energies = [twin.bending_energy(scenes()[name], mesh, q + s * dq) for s in (1.0, -1.0)]
            slope = (energies[0] - energies[1]) / 2e-5 / mesh.lengths[e]  # by the chord
            wanted[e, axis] -= slope  # the chord runs from node e to node e+1
            wanted[e + 1, axis] += slope
    kept = free_nodes(model)
    expected = model.frame.vectors_in(wanted)[kept]
    np.testing.assert_allclose(found[kept], expected, rtol=0, atol=1e-8 * np.abs(expected).max())


def nodal_bending_force(model: CableModel, y: Array) -> Array:
    """Rows of the balance of forces with EI less those without, (n+1, D)."""
    constants = model.parameters.constants.copy()
    constants[1] = 0.0
    limp = model.with_parameters(model.parameters._replace(constants=constants))
    yp = np.zeros_like(y)
    return model.layout.node_velocity(compiled_residual(model, y, yp) - compiled_residual(limp, y, yp))


def free_nodes(model: CableModel) -> slice:
    return slice(0 if model.features.free_a else 1, None if model.features.free_b else -1)


def test_planar_equations_are_the_spatial_ones_in_the_plane() -> None:
    flat, _ = compiled(scenes()["planar"])
    solid, _ = compiled(replace(scenes()["planar"], end_a=off_the_plane(scenes()["planar"])))
    assert (flat.layout.dimension, solid.layout.dimension) == (2, 3)
    y, yp = random_state(flat, 8)
    found = unknowns(flat, compiled_residual(flat, y, yp), is_place=False)
    lifted = [packed(solid, unknowns(flat, vector, is_place=False)) for vector in (y, yp)]
    wanted = unknowns(solid, compiled_residual(solid, *lifted), is_place=False)
    for kind in ("T", "q"):
        np.testing.assert_allclose(getattr(found, kind), getattr(wanted, kind), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.V[1:-1], wanted.V[1:-1], rtol=1e-12, atol=1e-12)


def off_the_plane(original: Scene):
    """End A with a motion that leaves the plane: it makes the scene spatial, its rows are not compared."""
    return driven([0.2, -0.1, 0.3], [[0.0, 0.0, 0.0, 0.0], [1.0, -0.3, 1.0, 0.0]])


def packed(model: CableModel, state: twin.Unknowns) -> Array:
    y, layout = np.zeros(model.layout.size), model.layout
    layout.velocity(y)[:], layout.end_velocity(y)[:] = state.V[:-1], state.V[-1]
    layout.tension(y)[:], layout.chord(y)[:], layout.end_place(y)[:] = state.T, state.q, state.w
    return y


@pytest.mark.parametrize("name", NAMES)
def test_rates_are_consistent(name: str) -> None:
    model, _ = compiled(scenes()[name])
    y, _ = random_state(model, 9)
    model.impose_end_velocities(TIME, y)
    yp = model.consistent_rates(TIME, y)
    assert np.abs(compiled_residual(model, y, yp)).max() < 1e-9
