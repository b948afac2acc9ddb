"""Dynamics against what is known exactly, symmetries, conserved quantities and orders of convergence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from scenes import (
    FREE,
    VACUUM,
    EquilibriumShape,
    G,
    TautShape,
    body,
    cable,
    driven,
    held,
    mirrored,
    pendulum,
    rotation,
    scene,
    straight,
    sway,
    towed,
    uniform_in_time,
)
from scipy.linalg import eig, eigh
from scipy.special import jn_zeros

from cablesim.mesh import build_mesh
from cablesim.physics.parameters import MASS
from cablesim.scene import MeshRules, Numerics, Scene
from cablesim.simulation import Simulation, simulate
from cablesim.statics import find_initial_state

Array = NDArray[np.float64]

DOWN = TautShape(direction=np.array([0.0, 0.0, -1.0]))
STILL = uniform_in_time([0.0, 1e3], np.zeros((2, 3)))
SPECK = body(1.5, drag_area=1e-12)  # compiles point drag in, as in `test_equations`


def run(case: Scene) -> xr.Dataset:
    result = simulate(case)
    assert result.attrs["status"] == "completed", result.attrs["message"]
    return result


# Frequencies --------------------------------------------------------------------------------------


def frequencies(case: Scene) -> Array:
    """Angular frequencies of small motions about rest, ascending: E x' + A x = 0."""
    state = find_initial_state(case, build_mesh(case))
    model, zero = state.model, np.zeros_like(state.y)
    stiffness, both = np.zeros((2, zero.size, zero.size))
    model.jacobian(0.0, state.y, zero, 0.0, stiffness)
    model.jacobian(0.0, state.y, zero, 1.0, both)
    with np.errstate(divide="ignore", invalid="ignore"):  # algebraic rows have no frequency
        values = eig(-stiffness, both - stiffness, right=False)
    values = values[np.isfinite(values)]
    return np.sort(values.imag[(values.imag > 1e-3) & (np.abs(values.real) < 1e-3 * np.abs(values.imag))])


def extrapolated(frequency: Any, segments: int) -> Array:
    """Frequencies for an infinitely fine mesh, from two meshes and order two."""
    coarse, fine = frequency(segments), frequency(2 * segments)
    return fine + (fine - coarse) / 3.0


def test_hanging_chain_swings_at_the_zeros_of_bessel() -> None:
    """Howell & Triantafyllou: omega_n = j_(0,n)/2 sqrt(g/L)."""

    def found(segments: int) -> Array:
        rope = cable(density=VACUUM, structural_damping=0.0, axial_stiffness=1e7)
        case = scene(rope=rope, density=VACUUM, b=FREE, segments=segments, initial=EquilibriumShape())
        return frequencies(case)[:3]

    wanted = jn_zeros(0, 3) / 2.0 * np.sqrt(G / 3.0)
    np.testing.assert_allclose(extrapolated(found, 30), wanted, rtol=1e-3)
    np.testing.assert_allclose(found(60), found_by_masses_on_a_string(60), rtol=1e-6)


def found_by_masses_on_a_string(segments: int) -> Array:
    """What lumping alone makes of the hanging chain: M x'' + K x = 0."""
    length, mass = 3.0 / segments, np.full(segments, 0.055 * 3.0 / segments)
    mass[-1] *= 0.5
    pull = np.cumsum(mass[::-1])[::-1] * G / length
    stiffness = np.diag(pull + np.append(pull[1:], 0.0)) - np.diag(pull[1:], 1) - np.diag(pull[1:], -1)
    return np.sqrt(eigh(stiffness, np.diag(mass), eigvals_only=True)[:3])


def taut_frequencies(segments: int) -> Array:
    rope = cable(density=VACUUM, gravity=0.0, structural_damping=1e-12)
    return frequencies(
        scene(rope=rope, density=VACUUM, gravity=0.0, b=held([3.003, 0.0, 0.0]), segments=segments)
    )


def test_taut_string_swings_at_multiples_of_its_wave_speed() -> None:
    """The pull of 10 N stretches the string by 1 in 1000, which counts."""
    wanted = np.arange(1, 4) * np.pi / 3.0 * np.sqrt(1e4 * 1e-3 / (0.055 * 1.001))
    np.testing.assert_allclose(taut_frequencies(60)[:3], wanted, rtol=2e-3)
    np.testing.assert_allclose(extrapolated(lambda n: taut_frequencies(n)[:3], 30), wanted, rtol=1e-5)


def test_taut_string_rings_at_multiples_of_the_speed_of_sound() -> None:
    wanted = np.arange(1, 4) * np.pi / 3.0 * np.sqrt(1e4 / 0.055)

    def found(segments: int) -> Array:
        every = taut_frequencies(segments)
        return np.array([every[np.argmin(np.abs(every - omega))] for omega in wanted])

    np.testing.assert_allclose(found(60), wanted, rtol=2e-3)
    np.testing.assert_allclose(extrapolated(found, 30), wanted, rtol=1e-5)


# Drag, weight and moving water --------------------------------------------------------------------


def test_horizontal_cable_sinks_at_its_terminal_velocity() -> None:
    rope = cable()
    case = scene(
        a=FREE,
        b=FREE,
        initial=straight([0.0, 0, 0], [1.0, 0, 0], 3.0),
        current=STILL,
        attachments=[SPECK],
        duration=4.0,
    )
    result = run(case)
    terminal = np.sqrt(rope.wet_weight / (0.5 * 1000.0 * rope.drag_normal * rope.diameter))
    np.testing.assert_allclose(result.velocity.values[-1, :, 2], -terminal, rtol=1e-4)
    assert np.abs(result.velocity.values[-1, :, :2]).max() < 1e-6


POROUS = {"displaced_section": 1e-5}
GIVEN = {"displaced_section": 1e-5, "added_mass_section": 3e-5}


@pytest.mark.parametrize("sections", [{}, POROUS, GIVEN])
def test_sinking_follows_the_exact_law_from_rest(sections: dict[str, float]) -> None:
    """v = v_end tanh(t/T) with T = (m + added mass) v_end / w."""
    rope = cable(**sections)
    start = straight([0.0, 0, 0], [1.0, 0, 0], 3.0)
    case = scene(
        rope=rope,
        a=FREE,
        b=FREE,
        initial=start,
        current=STILL,
        attachments=[SPECK],
        relative_tolerance=1e-8,
    )
    result = run(case)
    terminal = np.sqrt(rope.wet_weight / (0.5 * 1000.0 * rope.drag_normal * rope.diameter))
    slowness = (rope.mass_per_length + 1000.0 * rope.added_mass_section) * terminal / rope.wet_weight
    wanted = -terminal * np.tanh(result.time.values / slowness)
    np.testing.assert_allclose(result.velocity.values[:, 7, 2], wanted, rtol=0, atol=1e-5 * terminal)


def test_heavy_body_sinks_at_its_terminal_velocity() -> None:
    """It pulls down a cable without weight or drag."""
    ball = body(0.0, mass=0.5, volume=1e-4, drag_area=5e-3, added_mass=0.5)
    rope = cable(wet_weight=0.0, drag_normal=0.0, drag_tangential=0.0)
    case = scene(
        rope=rope,
        a=FREE,
        b=FREE,
        attachments=[ball],
        current=STILL,
        initial=straight([0.0, 0, 0], [0.0, 0, 1.0], 3.0),
        duration=6.0,
    )
    terminal = np.sqrt((0.5 - 0.1) * G / (0.5 * 1000.0 * 5e-3))
    np.testing.assert_allclose(run(case).velocity.values[-1, :, 2], -terminal, rtol=1e-4)


def test_neutral_cable_is_towed_straight() -> None:
    case = scene(
        rope=cable(wet_weight=0.0), a=towed([0.0] * 3, [1.0, 0, 0]), b=FREE, initial=DOWN, duration=60.0
    )
    last = run(case).isel(time=-1)
    assert np.abs(np.diff(last.position.values, axis=0)[:, 2]).max() < 1e-3
    rope = case.cable
    drag = 0.5 * 1000.0 * rope.drag_tangential * np.pi * rope.diameter * 3.0
    assert float(last.end_force.sel(end="a", axis="x")) == pytest.approx(-drag, rel=1e-3)


def critical_angle(rope: Any, speed: float) -> float:
    """Root of w cos a = 1/2 rho d Cn V^2 sin^2 a."""
    ratio = 0.5 * 1000.0 * rope.diameter * rope.drag_normal * speed**2 / rope.wet_weight
    return float(np.arccos((np.sqrt(1.0 + 4.0 * ratio**2) - 1.0) / (2.0 * ratio)))


@pytest.mark.parametrize("speed", [0.2, 0.5, 1.0])
def test_heavy_cable_is_towed_at_the_critical_angle(speed: float) -> None:
    start = towed([0.0, 0.0, 0.0], [speed, 0.0, 0.0])
    case = scene(a=start, b=FREE, initial=DOWN, duration=60.0 / speed)
    chords = np.diff(run(case).position.values[-1], axis=0)
    angles = np.arctan2(-chords[:, 2], -chords[:, 0])
    np.testing.assert_allclose(angles, critical_angle(case.cable, speed), rtol=0, atol=1e-3)


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_tow_can_start_in_its_steady_state(speed: float) -> None:
    start = towed([0.0, 0.0, 0.0], [speed, 0.0, 0.0])
    result = run(scene(a=start, b=FREE, duration=2.0))
    chords = np.diff(result.position.values, axis=1)
    angles = np.arctan2(-chords[..., 2], -chords[..., 0])
    np.testing.assert_allclose(angles, critical_angle(cable(), speed), rtol=0, atol=1e-6)


def pushed(mass_per_length: float, **changes: Any) -> xr.Dataset:
    """A cable without weight across water that gains 0.4 m/s every second."""
    water = uniform_in_time([0.0, 10.0], [[0.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    rope = cable(mass_per_length=mass_per_length, wet_weight=0.0, **changes)
    start = straight([0.0, 0, 0], [1.0, 0, 0], 3.0)
    return run(
        scene(rope=rope, a=FREE, b=FREE, initial=start, current=water, attachments=[SPECK], duration=2.0)
    )


def test_accelerating_water_takes_a_neutral_cable_along() -> None:
    displaced = 1000.0 * np.pi * 5e-3**2 / 4.0
    result = pushed(displaced)
    np.testing.assert_allclose(
        result.velocity.values[:, :, 1], 0.4 * result.time.values[:, None] * np.ones(21), atol=1e-6
    )


def test_accelerating_water_pushes_a_dense_cable_with_its_own_and_the_added_mass() -> None:
    """Without drag: (m + Ca rho A) dV/dt = rho A (1 + Ca) dU/dt."""
    displaced, mass, added = 1000.0 * np.pi * 5e-3**2 / 4.0, 0.055, 0.8
    result = pushed(mass, added_mass_normal=added, drag_normal=0.0, drag_tangential=0.0)
    rate = 0.4 * displaced * (1.0 + added) / (mass + added * displaced)
    np.testing.assert_allclose(
        result.velocity.values[:, :, 1], rate * result.time.values[:, None] * np.ones(21), atol=1e-6
    )


# Conserved quantities -----------------------------------------------------------------------------


@pytest.mark.parametrize(("rtol", "bound"), [(1e-4, 1e-3), (1e-5, 3e-4)])
def test_rope_in_vacuum_keeps_its_energy(rtol: float, bound: float) -> None:
    result = run(pendulum(density=VACUUM, relative_tolerance=rtol))
    energy = (result.kinetic_energy + result.potential_energy + result.elastic_energy).values
    assert np.abs(energy - energy[0]).max() < bound * abs(energy[0])


def thrown() -> Simulation:
    """A free rope in vacuum that tumbles and waves while it falls."""
    start = straight([0.0, 0, 0], [1.0, 0.5, 0.2], 3.0)
    case = scene(
        density=VACUUM,
        a=FREE,
        b=FREE,
        initial=start,
        current=STILL,
        attachments=[SPECK],
        relative_tolerance=1e-7,
    )
    simulation = Simulation(case)
    before = simulation.snapshot()
    y, s = before.y.copy(), np.linspace(0.0, 3.0, 21)[:, None]
    velocity = np.cross([0.3, -0.4, 1.0], s * [1.0, 0.5, 0.2]) + 0.5 * np.sin(np.pi * s) * [0.0, 0.4, 1.0]
    simulation.model.layout.velocity(y)[:] = velocity[:-1]
    simulation.model.layout.end_velocity(y)[:] = velocity[-1]
    simulation.restore(replace(before, y=y, yp=simulation.model.consistent_rates(0.0, y)))
    return simulation


def test_free_cable_in_vacuum_keeps_its_momentum() -> None:
    simulation = thrown()
    result = simulation.run()
    mass = simulation.model.loads(0.0)[:, MASS]
    t = result.time.values[:, None]
    momentum = mass @ result.velocity.values + mass.sum() * G * t * [0.0, 0.0, 1.0]
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0, atol=1e-7)


def test_free_cable_in_vacuum_keeps_its_angular_momentum() -> None:
    """About its centre of mass; its shape changes all the while."""
    simulation = thrown()
    result = simulation.run()
    mass = simulation.model.loads(0.0)[:, MASS]
    share = mass / mass.sum()
    arm = result.position.values - np.einsum("n,tnc->tc", share, result.position.values)[:, None]
    spin = np.einsum("n,tnc->tc", mass, np.cross(arm, result.velocity.values))
    assert np.linalg.norm(spin - spin[0], axis=1).max() < 1e-5 * np.linalg.norm(spin[0])
    assert np.ptp(np.linalg.norm(arm[:, -1] - arm[:, 0], axis=1)) > 0.05


# Symmetries ---------------------------------------------------------------------------------------

TIGHT: dict[str, Any] = {
    "relative_tolerance": 1e-8,
    "max_order": 5,
    "segments": 12,
    "variables": ("position",),
}


def turned(result: xr.Dataset, angle: float) -> Array:
    return result.position.values @ rotation(angle).T


def through_the_y_axis(angle: float) -> Scene:
    """A taut cable that sweeps from one side of +y to the other, all turned about z by `angle`."""
    turn = rotation(angle)
    waypoints = np.array([[0.0, 0, 0, 0], [0.3, -1.0, 0, 0], [1.5, -1.0, 0, 0], [1.8, 0, 0, 0]])
    waypoints[:, 1:] = waypoints[:, 1:] @ turn.T
    end = driven(turn @ [0.75, 2.88, 0.0], waypoints)
    return scene(b=end, duration=2.0, interval=0.1, **TIGHT)


@pytest.mark.parametrize("angle", [0.7, np.pi / 2.0, 2.5])
def test_sway_does_not_depend_on_its_heading(angle: float) -> None:
    case = {**TIGHT, "duration": 3.0, "interval": 0.1}
    straight_on, away = run(sway(**case)), run(sway(heading=angle, **case))
    assert np.abs(away.position.values - turned(straight_on, angle)).max() < 1e-6


@pytest.mark.parametrize("angle", [0.7, np.pi / 2.0])
def test_cable_may_pass_through_the_y_axis(angle: float) -> None:
    straight_on, away = run(through_the_y_axis(0.0)), run(through_the_y_axis(angle))
    assert np.abs(away.position.values - turned(straight_on, angle)).max() < 1e-6


@pytest.mark.parametrize("heading", [(1.0, 0.0), (0.0, 1.0), (0.6, -0.8)])
def test_pendulum_does_not_depend_on_its_plane(heading: tuple[float, float]) -> None:
    """Along +y too; solved in its plane and in space."""
    direction = np.array([*heading, -1.0]) / np.sqrt(2.0)
    case = {**TIGHT, "duration": 1.0, "interval": 0.1}
    reference = run(pendulum(**case)).position.values
    for skip in (True, False):
        found = run(pendulum(initial=TautShape(direction=direction), skip=skip, **case)).position.values
        along = found[..., :2] @ heading
        assert np.abs(along - reference[..., 0]).max() < 1e-6
        assert np.abs(found[..., 2] - reference[..., 2]).max() < 1e-6


MIRRORED = {
    "sway": sway(duration=2.0, interval=0.1, **TIGHT),
    "pendulum": pendulum(duration=1.0, interval=0.1, **TIGHT),
    "clamped": scene(
        rope=cable(bending_stiffness=0.05),
        a=FREE,
        b=held([0.0, 0.0, 0.0], clamp=[1.0, 0.0, 0.0]),
        initial=TautShape(direction=np.array([1.0, 0.0, 0.0])),
        **TIGHT,
    ),
}


@pytest.mark.parametrize("name", MIRRORED)
def test_swapping_the_ends_mirrors_the_result(name: str) -> None:
    one, other = run(MIRRORED[name]), run(mirrored(MIRRORED[name]))
    assert np.abs(one.position.values - other.position.values[:, ::-1]).max() < 1e-6


# Orders of convergence ----------------------------------------------------------------------------


def rms(difference: Array) -> float:
    """Root of the mean square distance."""
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=-1))))


def test_error_falls_with_the_tolerance() -> None:
    case: dict[str, Any] = {"segments": 30, "interval": 0.1, "duration": 6.0}

    def places(rtol: float, order: int = 2) -> Array:
        return run(sway(relative_tolerance=rtol, max_order=order, **case)).position.values

    reference = places(1e-9, 5)
    tolerances = np.array([1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
    errors = np.array([rms(places(rtol) - reference) for rtol in tolerances])
    slope = np.polyfit(np.log10(tolerances), np.log10(errors), 1)[0]
    print(f"errors {errors}, slope {slope:.2f}")
    assert (errors[1:] < 0.8 * errors[:-1]).all()
    assert slope > 0.5
    assert errors[1] < 5e-4


# From 2.5 s on the free end, coming to hang, brings the order down: 1.8, 1.86, 1.9 as meshes refine.
IN_SPACE = {"sway": sway(duration=10.0), "pendulum": pendulum(duration=2.0)}


@pytest.mark.parametrize("name", IN_SPACE)
def test_order_in_space_is_two(name: str) -> None:
    base = replace(
        IN_SPACE[name], output=replace(IN_SPACE[name].output, interval=0.1, variables=("marker_position",))
    )
    base = replace(base, numerics=Numerics(relative_tolerance=1e-8, max_order=5))
    coarse, middle, fine, finest = (
        run(replace(base, mesh=MeshRules(segment_length=length))).marker_position.values
        for length in (0.1, 0.05, 0.025, 0.0125)
    )
    steps = np.array([rms(coarse - middle), rms(middle - fine), rms(fine - finest)])
    orders = np.log2(steps[:-1] / steps[1:])
    print(f"{name}: differences {1e3 * steps} mm, orders {orders}")
    assert (np.abs(orders - 2.0) < 0.1).all()
