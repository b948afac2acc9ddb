"""Starts in a given shape, taut and nearly taut: elastic catenaries and measured markers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import CatenaryShape, MarkerShape, cable, held, scene
from scipy.integrate import solve_bvp

from cablesim.mesh import build_mesh
from cablesim.scene import Scene
from cablesim.simulation import simulate
from cablesim.statics import InitialState, find_initial_state

Array = NDArray[np.float64]

LENGTH, SEGMENTS = 3.0, 60


def start_of(case: Scene) -> InitialState:
    return find_initial_state(case, build_mesh(case))


def nodes_of(state: InitialState) -> Array:
    return state.model.frame.places_out(state.model.node_places(0.0, state.y))


def tension_of(state: InitialState) -> Array:
    return state.model.layout.tension(state.y)


def strain_of(state: InitialState) -> Array:
    return np.linalg.norm(np.diff(nodes_of(state), axis=0), axis=1) / (LENGTH / SEGMENTS) - 1.0


# Catenaries ---------------------------------------------------------------------------------------


def elastic_rope(s: Array, span: tuple[float, float], weight: float, EA: float) -> Array:
    """Places (x, z) and pulls (H, V) at s, shape (4, len(s)), from a boundary value problem."""

    def slopes(_: Array, y: Array) -> Array:
        size = np.hypot(y[2], y[3])
        stretch = 1.0 / size + 1.0 / EA
        return np.stack((y[2] * stretch, y[3] * stretch, 0.0 * size, weight + 0.0 * size))

    def ends(left: Array, right: Array) -> Array:
        return np.array([left[0], left[1], right[0] - span[0], right[1] - span[1]])

    mesh = np.linspace(0.0, LENGTH, 200)
    pull = max(EA * (np.hypot(*span) / LENGTH - 1.0), weight * LENGTH)
    start = np.stack(
        (span[0] * mesh / LENGTH, span[1] * mesh / LENGTH, pull + 0.0 * mesh, weight * (mesh - 1.5))
    )
    solution = solve_bvp(slopes, ends, mesh, start, tol=1e-10, max_nodes=50_000)
    assert solution.success
    return solution.sol(s)


TAUT = {
    "as long as the span": ((3.0, 0.0), 1e4),
    "a little short": ((2.9999, 0.0), 1e4),
    "a thousandth more": ((3.003, 0.0), 1e4),
    "rubber": ((3.2, 0.0), 1e2),
    "stiff": ((3.003, 0.0), 1e7),
    "inclined": ((2.4, 1.8018), 1e4),
    "steep": ((0.3, -2.99), 1e4),
}


@pytest.mark.parametrize("name", TAUT)
def test_taut_catenary_is_the_elastic_one(name: str) -> None:
    span, EA = TAUT[name]
    rope = cable(axial_stiffness=EA)
    state = start_of(
        scene(rope=rope, b=held([span[0], 0.0, span[1]]), segments=SEGMENTS, initial=CatenaryShape())
    )
    s = np.linspace(0.0, LENGTH, 2 * SEGMENTS + 1)
    wanted = elastic_rope(s, span, rope.wet_weight, EA)
    sag = np.abs(wanted[1] - span[1] / span[0] * wanted[0]).max()
    off = np.linalg.norm(nodes_of(state)[:, [0, 2]] - wanted[:2, ::2].T, axis=1).max()
    assert off < 1e-3 * sag + 1e-9
    np.testing.assert_allclose(tension_of(state), np.hypot(wanted[2], wanted[3])[1::2], rtol=2e-4)
    np.testing.assert_allclose(nodes_of(state)[-1], [span[0], 0.0, span[1]], rtol=0, atol=1e-12)


def test_taut_catenary_stays_at_rest() -> None:
    """3 m of rope between ends 3.003 m apart hold 12.8 N, not the 10.0 N of a straight one."""
    result = simulate(scene(b=held([3.003, 0.0, 0.0]), segments=SEGMENTS, initial=CatenaryShape()))
    tension = result.tension.values
    assert tension[0].mean() == pytest.approx(12.77, abs=0.02)
    assert np.ptp(tension, axis=0).max() < 1e-6
    assert np.abs(result.position.values - result.position.values[0]).max() < 1e-7


# Markers ------------------------------------------------------------------------------------------


def sagging(distance: float, sag: float) -> MarkerShape:
    """Seven markers on a half sine that goes `sag` below the line between ends `distance` apart."""
    share = np.linspace(0.0, 1.0, 7)
    places = np.stack((distance * share, 0.0 * share, -sag * np.sin(np.pi * share)), axis=1)
    return MarkerShape(arc=LENGTH * share, positions=places)


def needed_sag(distance: float) -> float:
    """Sag of an inextensible shallow cable of this length [m]: 8/3 sag^2 / distance = slack."""
    return float(np.sqrt(0.375 * distance * max(LENGTH - distance, 0.0)))


DISTANCES = [2.97, 2.9903, 2.999, 2.9999, 2.99999, 2.9999999, 3.0, 3.0000001, 3.0001, 3.003, 3.03]


@pytest.mark.parametrize("weight", [0.35, 0.0, -0.2])
@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize("sag", [0.0, 1e-3, -1e-3])
def test_markers_on_a_taut_cable_are_taken(distance: float, sag: float, weight: float) -> None:
    """The cable is where the markers are, but for the sag that its length asks for, on their side."""
    case = scene(
        rope=cable(wet_weight=weight),
        b=held([distance, 0.0, 0.0]),
        segments=SEGMENTS,
        initial=sagging(distance, sag),
    )
    state = start_of(case)
    nodes = nodes_of(state)
    np.testing.assert_allclose(nodes[-1], [distance, 0.0, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(strain_of(state) * 1e4, tension_of(state), rtol=0, atol=1e-9)
    side = -np.sign(sag) if sag else (-1.0 if weight >= 0.0 else 1.0)
    sideways = side * nodes[:, 2]
    assert sideways.min() > -1e-12
    assert sideways.max() < 1.2 * max(needed_sag(distance), abs(sag)) + 1e-9
    assert sideways.max() >= 0.85 * needed_sag(distance)


@pytest.mark.parametrize("sag", [0.0, 1e-3])
@pytest.mark.parametrize("distance", [3.0001, 3.003, 3.03])
def test_taut_markers_say_how_far_the_cable_is_stretched(distance: float, sag: float) -> None:
    """The arc of the half sine is longer than its chord by (pi sag)^2 / (4 distance)."""
    state = start_of(scene(b=held([distance, 0.0, 0.0]), segments=SEGMENTS, initial=sagging(distance, sag)))
    strain = (distance + (np.pi * sag) ** 2 / (4.0 * distance)) / LENGTH - 1.0
    np.testing.assert_allclose(tension_of(state), 1e4 * strain, rtol=1e-3)
    assert -nodes_of(state)[:, 2].min() == pytest.approx(sag, rel=1e-2)


@pytest.mark.parametrize("distance", [2.97, 2.9999, 3.0, 3.003])
def test_markers_on_a_cable_at_rest_give_it_back(distance: float) -> None:
    at_rest = start_of(scene(b=held([distance, 0.0, 0.0]), segments=SEGMENTS, initial=CatenaryShape()))
    shape = MarkerShape(arc=np.linspace(0.0, LENGTH, 31), positions=nodes_of(at_rest)[::2])
    again = start_of(scene(b=held([distance, 0.0, 0.0]), segments=SEGMENTS, initial=shape))
    assert np.abs(nodes_of(again) - nodes_of(at_rest)).max() < 1e-3
    np.testing.assert_allclose(tension_of(again), tension_of(at_rest), rtol=0.05)


def test_markers_on_a_straight_line_turn_to_where_the_cable_hangs() -> None:
    """In space, with the ends one above the other, to any side."""
    case = scene(b=held([0.0, 0.0, -2.99]), segments=SEGMENTS, initial=sagging_down(2.99), skip=False)
    nodes = nodes_of(start_of(case))
    assert np.hypot(nodes[:, 0], nodes[:, 1]).max() == pytest.approx(needed_sag(2.99), rel=0.2)
    np.testing.assert_allclose(nodes[-1], [0.0, 0.0, -2.99], rtol=0, atol=1e-12)


def sagging_down(distance: float) -> MarkerShape:
    share = np.linspace(0.0, 1.0, 7)
    return MarkerShape(arc=LENGTH * share, positions=np.outer(share, [0.0, 0.0, -distance]))
