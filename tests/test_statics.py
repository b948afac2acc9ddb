"""Rest shapes and first states against catenaries, elasticas and balances."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import (
    FREE,
    VACUUM,
    CatenaryShape,
    EquilibriumShape,
    G,
    MarkerShape,
    TautShape,
    UniformCurrent,
    body,
    cable,
    held,
    pendulum,
    scene,
    towed,
    uniform_in_time,
)
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipe, ellipk

from cablesim.mesh import build_mesh
from cablesim.physics.parameters import DRAG_TANGENTIAL, TAU_, WET_WEIGHT
from cablesim.scene import Cable, Scene
from cablesim.simulation import Simulation, simulate
from cablesim.statics import InitialState, Rung, StaticsError, elastic_catenary, find_initial_state

Array = NDArray[np.float64]

# Bisshopp & Drucker 1945: P L^2/EI, transverse deflection and horizontal span over L
CANTILEVER = [
    (0.25, 0.082746, 0.995882),
    (0.5, 0.162144, 0.984081),
    (1.0, 0.301721, 0.943567),
    (1.5, 0.410978, 0.892058),
    (2.0, 0.493457, 0.839358),
    (3.0, 0.603253, 0.745580),
    (4.0, 0.669964, 0.671059),
    (5.0, 0.713792, 0.612372),
    (6.0, 0.744571, 0.565411),
    (8.0, 0.784982, 0.495172),
    (10.0, 0.810609, 0.445004),
    (20.0, 0.868696, 0.316114),
    (50.0, 0.917155, 0.200000),
]
ENDS = [(1.5, 0.0, 0.0), (1.2, 0.9, 1.5), (1.6, -0.8, -0.9)]
STEEP = (0.6, -0.3, -2.2)
STIFFNESSES = [1e2, 1e4, 1e6]


def start_of(case: Scene) -> InitialState:
    return find_initial_state(case, build_mesh(case))


def nodes_of(state: InitialState) -> Array:
    return state.model.frame.places_out(state.model.node_places(0.0, state.y))


def tension_of(state: InitialState) -> Array:
    return state.model.layout.tension(state.y)


def balance_at_rest(state: InitialState) -> Array:
    """Rows of the balance of forces of all nodes with Y' = 0, (n+1, D)."""
    out = np.empty_like(state.y)
    state.model.residual(0.0, state.y, np.zeros_like(state.y), out)
    return state.model.layout.node_velocity(out)


# Catenary -----------------------------------------------------------------------------------------


def catenary_places(force: Array, s: Array, weight: float, EA: float) -> Array:
    """Irvine's places at s of a cable that is pulled with `force` at s = 0."""
    across, vertical = np.hypot(force[0], force[1]), force[2] + weight * s
    start = np.hypot(across, force[2])
    x = across / weight * (np.arcsinh(vertical / across) - np.arcsinh(force[2] / across)) + across * s / EA
    z = (np.hypot(across, vertical) - start) / weight + (force[2] + weight * s / 2.0) * s / EA
    return np.stack((x * force[0] / across, x * force[1] / across, z), axis=1)


def integrated_places(force: Array, s: Array, weight: float, EA: float) -> Array:
    """The same by Gauss-Legendre quadrature of r' = (1 + T/EA) F/T, F = force + weight s."""
    points, shares = np.polynomial.legendre.leggauss(400)
    places = np.arange(3) * 0.0
    arc = 0.5 * s[:, None] * (points + 1.0)
    pull = force + weight * arc[..., None] * np.array([0.0, 0.0, 1.0])
    tension = np.linalg.norm(pull, axis=-1, keepdims=True)
    slope = (1.0 + tension / EA) * pull / tension
    return places + 0.5 * s[:, None] * np.einsum("p,spc->sc", shares, slope)


@pytest.mark.parametrize("weight", [0.35, -0.2])
@pytest.mark.parametrize("EA", STIFFNESSES)
@pytest.mark.parametrize("span", [*ENDS, STEEP])
def test_elastic_catenary_reaches_the_other_end(span: tuple, EA: float, weight: float) -> None:
    force = elastic_catenary(np.array(span), 3.0, weight, EA)
    reached = integrated_places(force, np.array([3.0]), weight, EA)[0]
    np.testing.assert_allclose(reached, span, rtol=0, atol=1e-9)


def test_elastic_catenary_equals_a_boundary_value_problem() -> None:
    weight, EA, length, across, rise = 0.35, 20.0, 3.0, 1.5, 0.8

    def slopes(s: Array, y: Array) -> Array:
        tension = np.hypot(y[2], y[3])
        stretch = (1.0 + tension / EA) / tension
        return np.stack((y[2] * stretch, y[3] * stretch, 0.0 * s, weight + 0.0 * s))

    def ends(left: Array, right: Array) -> Array:
        return np.array([left[0], left[1], right[0] - across, right[1] - rise])

    s = np.linspace(0.0, length, 50)
    guess = np.stack((s * across / length, s * rise / length, 0.3 + 0.0 * s, weight * (s - 1.5)))
    solution = solve_bvp(slopes, ends, s, guess, tol=1e-8, max_nodes=20_000)
    assert solution.success
    found = elastic_catenary(np.array([across, 0.0, rise]), length, weight, EA)
    np.testing.assert_allclose(found[[0, 2]], solution.y[2:, 0], rtol=1e-6)


def distance_from_irvine(state: InitialState, force: Array, rope: Cable) -> float:
    s = np.linspace(0.0, rope.length, len(nodes_of(state)))
    wanted = catenary_places(force, s, rope.wet_weight, rope.axial_stiffness)
    return float(np.linalg.norm(nodes_of(state) - wanted, axis=1).max())


@pytest.mark.parametrize("weight", [0.35, -0.2])
@pytest.mark.parametrize("EA", STIFFNESSES)
@pytest.mark.parametrize("span", ENDS)
def test_discrete_catenary_equals_irvine(span: tuple, EA: float, weight: float) -> None:
    rope = cable(axial_stiffness=EA, wet_weight=weight)
    state = start_of(scene(rope=rope, b=held(span), segments=200))
    force = elastic_catenary(np.array(span), 3.0, weight, EA)
    assert state.rung is Rung.NEWTON
    assert distance_from_irvine(state, force, rope) < 1e-5 * 3.0
    middle = force + weight * np.outer(np.linspace(0.0, 3.0, 401)[1::2], [0.0, 0.0, 1.0])
    wanted_tension = np.linalg.norm(middle, axis=1)
    assert np.abs(tension_of(state) - wanted_tension).max() < 1e-4 * wanted_tension.max()


def test_discrete_catenary_converges_with_order_two() -> None:
    """Steep legs turn within a few segments at the bottom: the error is larger, its order the same."""
    rope = cable()
    force = elastic_catenary(np.array(STEEP), 3.0, rope.wet_weight, rope.axial_stiffness)
    coarse, fine = (
        distance_from_irvine(start_of(scene(b=held(STEEP), segments=n)), force, rope) for n in (200, 400)
    )
    assert 1.9 < np.log2(coarse / fine) < 2.1
    assert coarse < 4e-5 * 3.0


def test_catenary_as_first_shape_is_irvine_s() -> None:
    rope = cable()
    state = start_of(scene(b=held(ENDS[1]), segments=200, initial=CatenaryShape()))
    force = elastic_catenary(np.array(ENDS[1]), 3.0, rope.wet_weight, rope.axial_stiffness)
    assert state.rung is Rung.CATENARY
    assert distance_from_irvine(state, force, rope) < 1e-5 * 3.0


def test_slack_neutral_cable_finds_a_shape_without_tension() -> None:
    state = start_of(scene(rope=cable(wet_weight=0.0)))
    assert np.abs(tension_of(state)).max() < 1e-9
    assert np.abs(nodes_of(state)[-1] - [1.5, 0.0, 0.0]).max() < 1e-12
    lengths = np.linalg.norm(np.diff(nodes_of(state), axis=0), axis=1)
    np.testing.assert_allclose(lengths, 0.15, rtol=1e-9)


# Bending ------------------------------------------------------------------------------------------


def cantilever(alpha: float, segments: int) -> tuple[float, float]:
    """Transverse deflection and span of a tip-loaded beam of length 1, clamped at B along x."""
    EI = 0.1
    rope = cable(length=1.0, wet_weight=0.0, bending_stiffness=EI, axial_stiffness=1e7)
    case = scene(
        rope=rope,
        density=VACUUM,
        a=FREE,
        b=held([0.0, 0.0, 0.0], clamp=[1.0, 0.0, 0.0]),
        attachments=[body(0.0, mass=alpha * EI / G)],
        segments=segments,
    )
    tip = nodes_of(start_of(case))[0]
    return -tip[2], -tip[0]


@pytest.mark.parametrize(("alpha", "deflection", "span"), CANTILEVER)
def test_cantilever_with_tip_load(alpha: float, deflection: float, span: float) -> None:
    found = cantilever(alpha, 40)
    np.testing.assert_allclose(found, (deflection, span), rtol=2e-3)


@pytest.mark.parametrize("alpha", [1.0, 5.0])
def test_cantilever_converges_with_order_two(alpha: float) -> None:
    coarse, middle, fine = (np.array(cantilever(alpha, n)) for n in (20, 40, 80))
    order = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
    assert 1.8 < order < 2.2


def test_slack_elastica_is_symmetric() -> None:
    rope = cable(wet_weight=0.0, bending_stiffness=0.01)
    nodes = nodes_of(start_of(scene(rope=rope, segments=40)))
    mirror = nodes[::-1] * [-1.0, 1.0, 1.0] + [1.5, 0.0, 0.0]
    assert np.abs(nodes - mirror).max() < 1e-7
    assert nodes[:, 2].min() < -0.5


def test_slack_elastica_has_the_end_force_of_euler() -> None:
    """A pinned elastica at half its length: P L^2/EI and sag from the elliptic integrals."""
    modulus = fsolve(lambda k: 2.0 * ellipe(k**2) / ellipk(k**2) - 1.0 - 0.5, 0.6)[0]
    load, sag = 4.0 * ellipk(modulus**2) ** 2, modulus / ellipk(modulus**2)
    EI, length = 0.01, 3.0
    state = start_of(
        scene(rope=cable(wet_weight=0.0, bending_stiffness=EI, axial_stiffness=1e6), segments=80)
    )
    assert -nodes_of(state)[:, 2].min() == pytest.approx(sag * length, rel=1e-3)
    assert np.abs(balance_at_rest(state)[1:-1]).max() < 1e-9
    middle = tension_of(state)[39:41].mean()
    assert -middle == pytest.approx(load * EI / length**2, rel=2e-3)


# Balance ------------------------------------------------------------------------------------------

AT_REST = {
    "in space": scene(b=held(ENDS[1]), skip=False),
    "stiff rope": scene(rope=cable(axial_stiffness=1e7)),
    "soft rope": scene(rope=cable(axial_stiffness=1e2), b=held(ENDS[1])),
    "floating": scene(rope=cable(wet_weight=-0.2)),
    "taut": scene(b=held([3.01, 0.0, 0.0])),
    "hanging": scene(b=FREE),
    "ballast and buoy": scene(attachments=[body(0.9, mass=0.2), body(2.1, mass=0.01, volume=5e-5)]),
    "cantilever": scene(
        rope=cable(bending_stiffness=0.05), a=FREE, b=held([0.0, 0.0, 0.0], clamp=[1.0, 0.0, 0.0])
    ),
}


@pytest.mark.parametrize("name", AT_REST)
def test_nothing_starts_to_move_from_rest(name: str) -> None:
    result = simulate(AT_REST[name])
    assert result.attrs["status"] == "completed"
    assert np.abs(result.position.values - result.position.values[0]).max() < 1e-7


@pytest.mark.parametrize("name", AT_REST)
def test_ends_carry_the_whole_weight(name: str) -> None:
    simulation = Simulation(replace(AT_REST[name], duration=0.1))
    force = simulation.run().end_force.values[0]
    weight = simulation.model.loads(0.0)[:, WET_WEIGHT].sum()
    np.testing.assert_allclose(
        force.sum(axis=0), [0.0, 0.0, -weight], rtol=0, atol=1e-8 * max(1.0, np.abs(force).max())
    )


def test_ends_carry_drag_in_a_current() -> None:
    """A taut rope across a uniform current: each node's drag by hand."""
    current = UniformCurrent(velocity=np.array([0.0, 0.4, 0.0]))
    rope = cable(wet_weight=0.0, axial_stiffness=1e7)
    result = simulate(scene(rope=rope, b=held([3.03, 0.0, 0.0]), current=current, duration=0.1, skip=False))
    drag = 0.5 * 1000.0 * 1.2 * 5e-3 * 3.0 * 0.4**2
    np.testing.assert_allclose(result.end_force.values[0, :, 1], drag / 2.0, rtol=1e-3)


def test_towed_cable_is_at_rest_in_the_moving_frame() -> None:
    velocity = np.array([0.5, 0.0, 0.0])
    case = scene(a=towed([0.0, 0.0, 0.0], velocity), b=towed([1.5, 0.0, 0.0], velocity))
    result = simulate(case)
    moved = result.position.values - velocity * result.time.values[:, None, None]
    assert np.abs(moved - moved[0]).max() < 1e-6


# Given shapes -------------------------------------------------------------------------------------


def bow(side: float) -> MarkerShape:
    """Markers on a half sine of length 3 from (0, 0, 0) to (1.5, 0, 0) that leaves its plane by `side`."""
    share = np.linspace(0.0, 1.0, 2001)

    def curve(depth: float) -> Array:
        return np.stack(
            (1.5 * share, side * np.sin(2.0 * np.pi * share), -depth * np.sin(np.pi * share)), axis=1
        )

    def arc(depth: float) -> Array:
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve(depth), axis=0), axis=1)))

    depth = brentq(lambda d: arc(d)[-1] - 3.0, 0.1, 3.0)
    return MarkerShape(arc=arc(depth)[::100], positions=curve(depth)[::100])


def test_marker_shape_closes_exactly_and_starts_at_the_markers() -> None:
    markers = bow(0.2)
    state = start_of(scene(segments=120, initial=markers))
    nodes = nodes_of(state)
    assert state.rung is Rung.MARKERS
    np.testing.assert_allclose(nodes[-1], [1.5, 0.0, 0.0], rtol=0, atol=1e-12)
    near = [np.interp(markers.arc, np.linspace(0.0, 3.0, 121), column) for column in nodes.T]
    assert np.linalg.norm(np.stack(near, axis=1) - markers.positions, axis=1).max() < 5e-3


@pytest.mark.parametrize("EA", STIFFNESSES)
def test_tension_and_stretch_of_a_marker_shape_agree(EA: float) -> None:
    state = start_of(scene(rope=cable(axial_stiffness=EA), segments=60, initial=bow(0.2)))
    stretch = np.linalg.norm(np.diff(nodes_of(state), axis=0), axis=1) / 0.05
    np.testing.assert_allclose(EA * (stretch - 1.0), tension_of(state), rtol=0, atol=1e-6)


def test_markers_of_a_rest_shape_give_it_back() -> None:
    at_rest = start_of(scene(segments=60))
    arc = np.linspace(0.0, 3.0, 31)  # every other node
    shape = MarkerShape(arc=arc, positions=nodes_of(at_rest)[::2])
    again = start_of(scene(segments=60, initial=shape))
    assert np.abs(nodes_of(again) - nodes_of(at_rest)).max() < 2e-3
    assert np.abs(tension_of(again) - tension_of(at_rest)).max() < 0.05 * tension_of(at_rest).max()


def length_accelerations(state: InitialState) -> Array:
    """Second time derivative of the segments' lengths [m/s2], their damping left out."""
    constants = state.model.parameters.constants.copy()
    constants[TAU_] = 0.0
    model = state.model.with_parameters(state.model.parameters._replace(constants=constants))
    rates = model.layout.node_velocity(model.consistent_rates(0.0, state.y))
    chord = model.layout.chord(state.y)
    return np.sum(np.diff(rates, axis=0) * chord, axis=1) / np.linalg.norm(chord, axis=1)


GAUSS = {
    "let go at an angle": pendulum(),
    "let go when bent": scene(b=FREE, initial=bow(0.0), segments=60),
    "held, in its plane": scene(initial=bow(0.0), segments=60),
    "held, in space": scene(initial=bow(0.2), segments=60),
}


@pytest.mark.parametrize("name", GAUSS)
def test_least_squares_tension_keeps_lengths_at_the_first_instant(name: str) -> None:
    """Gauss' principle of least constraint."""
    assert np.abs(length_accelerations(start_of(GAUSS[name]))).max() < 1e-6 * G


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.6, 0.0, -0.8)])
def test_taut_shape_with_a_free_end_is_straight(direction: tuple) -> None:
    state = start_of(scene(b=FREE, initial=TautShape(direction=np.array(direction))))
    wanted = np.outer(np.linspace(0.0, 3.0, 21), direction)
    assert state.rung is Rung.TAUT
    assert np.abs(nodes_of(state) - wanted).max() < 1e-4


def test_taut_shape_between_two_ends_carries_its_stretch() -> None:
    state = start_of(scene(b=held([3.03, 0.0, 0.0]), initial=TautShape()))
    np.testing.assert_allclose(tension_of(state), 1e4 * 0.01, rtol=1e-6)
    np.testing.assert_allclose(nodes_of(state)[:, 0], np.linspace(0.0, 3.03, 21), rtol=0, atol=1e-12)


def test_hanging_cable_carries_what_is_below() -> None:
    state = start_of(scene(b=FREE))
    weight = cable().wet_weight * 3.0
    middle = (np.arange(20) + 0.5) / 20.0
    np.testing.assert_allclose(tension_of(state), weight * (1.0 - middle), rtol=1e-6)
    stretched = np.append(0.0, np.cumsum(0.15 * (1.0 + tension_of(state) / 1e4)))
    np.testing.assert_allclose(nodes_of(state)[:, 2], -stretched, rtol=0, atol=1e-9)


def loose(**changes: Any) -> Scene:
    """A cable without held ends, compiled as in `test_equations`."""
    still = uniform_in_time([0.0, 1e3], np.zeros((2, 3)))
    return scene(a=FREE, b=FREE, current=still, attachments=[body(1.5, drag_area=1e-12)], **changes)


def test_free_cable_without_a_place_is_refused() -> None:
    with pytest.raises(StaticsError, match=r"Both ends are free.*markers or a polyline"):
        start_of(loose())


def test_cable_without_rest_says_how_far_the_search_came() -> None:
    """A free sinking cable has no rest shape."""
    guess = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    with pytest.raises(
        StaticsError, match=r"after \d+ Newton iterations a force of .* N is left .*'through' points"
    ):
        start_of(loose(initial=EquilibriumShape(guess=guess)))


def test_report_names_rung_iterations_and_balance() -> None:
    state = start_of(pendulum())
    assert "taut" in state.message
    assert start_of(scene()).residual < 1e-9
    assert "Newton iterations" in start_of(scene()).message


def test_steady_tow_needs_drag_along_the_cable_only() -> None:
    """A neutral cable trails straight behind its tow; tension is the drag of what is behind."""
    case = scene(rope=cable(wet_weight=0.0), a=towed([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]), b=FREE)
    state = start_of(case)
    behind = 3.0 * (1.0 - (np.arange(20) + 0.5) / 20.0)
    drag = state.model.parameters.cable[DRAG_TANGENTIAL]
    np.testing.assert_allclose(tension_of(state), drag * behind, rtol=1e-4)
    assert np.abs(nodes_of(state)[:, 1:]).max() < 1e-6
    assert nodes_of(state)[-1, 0] < -2.99
