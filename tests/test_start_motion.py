"""How a case says that its cable moves at the start, and whether it is stretched then."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cablesim import CaseError, Simulation, simulate
from cablesim.build import build_scene
from cablesim.case import Case
from cablesim.mesh import build_mesh
from cablesim.statics import InitialState, find_initial_state

Array = NDArray[np.float64]

G, LENGTH, MASS = 9.81, 3.0, 0.055
HELD = {"motion": "fixed", "position": [0, 0, 0]}
FREE = {"motion": "free"}


def towed(position: list[float], velocity: list[float]) -> dict[str, Any]:
    return {"motion": "velocity_waypoints", "position": position, "waypoints": [[0, *velocity]]}


def case(**changes: Any) -> Case:
    """A rope in vacuum that is held at A, without gravity."""
    values: dict[str, Any] = {
        "name": "moving",
        "gravity": 0,
        "water": {"density": 0},
        "cable": {
            "length": LENGTH,
            "diameter": 0.005,
            "mass_per_length": MASS,
            "axial_stiffness": 1e5,
            "structural_damping": 1e-3,
        },
        "mesh": {"segment_length": 0.05},
        "ends": {"a": HELD, "b": FREE},
        "initial": {"shape": "taut", "direction": [1, 0, 0]},
        "simulation": {"duration": 2.0, "relative_tolerance": 1e-6},
    }
    return Case.from_dict({**values, **changes})


def start_of(given: Case) -> InitialState:
    scene = build_scene(given)
    return find_initial_state(scene, build_mesh(scene))


def nodes_of(state: InitialState) -> Array:
    return state.model.frame.places_out(state.model.node_places(0.0, state.y))


def velocity_of(state: InitialState) -> Array:
    return state.model.frame.vectors_out(state.model.layout.node_velocity(state.y))


# Motion -------------------------------------------------------------------------------------------

WHIRL = 2.0  # [rad/s]
WHIRLING = {
    "shape": "taut",
    "direction": [1, 0, 0],
    "velocities": [[0, 0, 0, 0], [LENGTH, 0, WHIRL * LENGTH, 0]],
}


def centrifugal(s: Array) -> Array:
    """Tension of a rope that whirls about its end at s = 0 [N]."""
    return 0.5 * MASS * WHIRL**2 * (LENGTH**2 - s**2)


def test_whirling_rope_starts_with_its_centrifugal_tension() -> None:
    state = start_of(case(initial=WHIRLING))
    middle = 0.05 * (np.arange(60) + 0.5)
    np.testing.assert_allclose(
        state.model.layout.tension(state.y), centrifugal(middle), rtol=1e-3, atol=1e-3 * centrifugal(0.0)
    )
    np.testing.assert_allclose(velocity_of(state)[:, 1], WHIRL * 0.05 * np.arange(61), atol=1e-12)


def test_whirling_rope_goes_on_whirling() -> None:
    result = simulate(build_scene(case(initial=WHIRLING)))
    angle = WHIRL * result.time.values
    circle = np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    wanted = result.s.values[:, None] * circle[:, None, :]
    assert np.linalg.norm(result.position.values - wanted, axis=2).max() < 2e-3 * LENGTH
    tension = result.tension.values
    assert np.abs(tension - tension[0]).max() < 2e-3 * centrifugal(0.0)


@pytest.mark.parametrize("stretched", [True, False])
def test_thrown_rope_falls_on_a_parabola(stretched: bool) -> None:
    velocity = np.array([1.0, -0.5, 2.0])
    thrown = case(
        gravity=G,
        ends={"a": FREE, "b": {"motion": "free", "position": [0, 0, 1]}},
        initial={
            "shape": "taut",
            "direction": [0.6, 0, 0.8],
            "velocity": velocity.tolist(),
            "stretched": stretched,
        },
    )
    result = simulate(build_scene(thrown))
    time = result.time.values[:, None]
    fallen = velocity * time - 0.5 * G * time**2 * [0.0, 0.0, 1.0]
    np.testing.assert_allclose(result.position.values[0, -1], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(
        result.position.values, result.position.values[0] + fallen[:, None], rtol=0, atol=1e-4
    )


def test_kicked_pendulum_rises_as_high_as_its_energy_says() -> None:
    kick = 1.0
    pendulum = case(
        gravity=G,
        cable={
            "length": 1.0,
            "diameter": 0.005,
            "mass_per_length": 1e-4,
            "axial_stiffness": 1e6,
            "structural_damping": 1e-4,
        },
        attachments=[{"kind": "body", "name": "bob", "at": 1.0, "mass": 1.0, "volume": 0}],
        mesh={"segment_length": 0.125},
        initial={"shape": "equilibrium", "velocities": [[0, 0, 0, 0], [1, kick, 0, 0]]},
        simulation={"duration": 1.0, "relative_tolerance": 1e-6},
        output={"interval": 0.002},
    )
    bob = simulate(build_scene(pendulum)).position.values[:, -1]
    assert bob[0, 2] == pytest.approx(-1.0, abs=1e-4)
    assert bob[:, 2].max() - bob[0, 2] == pytest.approx(kick**2 / (2.0 * G), rel=2e-3)


CARRIED = {
    "catenary": {"shape": "catenary"},
    "equilibrium": {"shape": "equilibrium"},
    "markers": {"shape": "markers", "arc": [0, 1.5, 3], "positions": [[0, 0, 0], [1, 0, -1], [2, 0, 0]]},
}


@pytest.mark.parametrize("name", CARRIED)
def test_velocity_of_both_ends_carries_the_whole_cable(name: str) -> None:
    """What the case says is what it is without saying it: both ends move alike."""
    ends = {"a": towed([0, 0, 0], [0.2, 0.1, 0]), "b": towed([2, 0, 0], [0.2, 0.1, 0])}
    wet: dict[str, Any] = {"gravity": G, "water": {"density": 1000}, "ends": ends}
    said = start_of(case(**wet, initial={**CARRIED[name], "velocity": [0.2, 0.1, 0]}))
    unsaid = start_of(case(**wet, initial=CARRIED[name]))
    np.testing.assert_array_equal(said.y, unsaid.y)
    np.testing.assert_allclose(velocity_of(said), np.tile([0.2, 0.1, 0.0], (61, 1)), atol=1e-12)


def test_velocity_out_of_the_plane_of_the_shape_is_kept() -> None:
    rows = [[0, 0, 0, 0], [1.5, 0, 0.3, 0], [3, 0, 0, 0]]
    ends = {"a": HELD, "b": {"motion": "fixed", "position": [2, 0, 0]}}
    simulation = Simulation(
        build_scene(
            case(gravity=G, ends=ends, initial={"shape": "catenary", "velocities": rows}),
        )
    )
    velocity = simulation.observe().velocity
    s = np.linspace(0.0, LENGTH, 61)
    np.testing.assert_allclose(velocity[:, 1], np.interp(s, [0.0, 1.5, 3.0], [0.0, 0.3, 0.0]), atol=1e-12)


def test_end_gets_its_own_velocity_to_the_last_digit() -> None:
    ends = {"a": towed([0, 0, 0], [1 / 3, 0, 0]), "b": FREE}
    state = start_of(
        case(ends=ends, initial={"shape": "taut", "direction": [0, 0, -1], "velocity": [0.3333, 0, 0]})
    )
    assert velocity_of(state)[0, 0] == pytest.approx(1 / 3, abs=1e-13)
    assert velocity_of(state)[1, 0] == pytest.approx(0.3333, abs=1e-13)


# Stretch ------------------------------------------------------------------------------------------


def test_unstretched_cable_has_no_tension_and_its_own_length() -> None:
    hanging: dict[str, Any] = {"shape": "taut", "direction": [0.6, 0, -0.8]}
    stretched = start_of(case(gravity=G, initial=hanging))
    unstretched = start_of(case(gravity=G, initial={**hanging, "stretched": False}))
    assert stretched.model.layout.tension(stretched.y).max() > 0.5
    np.testing.assert_array_equal(unstretched.model.layout.tension(unstretched.y), 0.0)
    lengths = np.linalg.norm(np.diff(nodes_of(unstretched), axis=0), axis=1)
    np.testing.assert_allclose(lengths, 0.05, rtol=1e-12)


def test_unstretched_cable_fits_between_two_ends() -> None:
    ends = {"a": HELD, "b": {"motion": "fixed", "position": [2.4, 0, 1.8]}}
    state = start_of(case(gravity=G, ends=ends, initial={"shape": "taut", "stretched": False}))
    assert np.abs(state.model.layout.tension(state.y)).max() < 1e-8


# Refused ------------------------------------------------------------------------------------------

BOTH_HELD = {"a": HELD, "b": {"motion": "fixed", "position": [2, 0, 0]}}
REFUSED: dict[str, tuple[dict[str, Any], list[str]]] = {
    "end at rest": (
        {"initial": {"shape": "taut", "direction": [1, 0, 0], "velocity": [0.5, 0, 0]}},
        ["initial.velocity", "[0.5, 0, 0]", "end A", "ends.a moves it with [0.0, 0.0, 0.0]", "`velocities`"],
    ),
    "end that moves otherwise": (
        {
            "ends": {"a": towed([0, 0, 0], [0.2, 0, 0]), "b": FREE},
            "initial": {"shape": "equilibrium", "velocities": [[0, 0.3, 0, 0], [3, 1, 0, 0]]},
        },
        ["initial.velocities", "end A with [0.3, 0.0, 0.0]", "ends.a moves it with [0.2, 0.0, 0.0]"],
    ),
    "end beyond the last row": (
        {"ends": BOTH_HELD, "initial": {"shape": "equilibrium", "velocities": [[0, 0, 0, 0], [1, 0, 0, 1]]}},
        ["initial.velocities", "end B with [0.0, 0.0, 1.0]", "ends.b"],
    ),
    "both": (
        {"initial": {"shape": "equilibrium", "velocity": [0, 0, 0], "velocities": [[0, 0, 0, 0]]}},
        ["initial", "`velocity` and `velocities`", "Keep one"],
    ),
    "rows out of order": (
        {"initial": {"shape": "equilibrium", "velocities": [[0, 0, 0, 0], [2, 0, 0, 0], [1, 1, 0, 0]]}},
        ["initial.velocities[2][0]", "2 m", "Sort the rows"],
    ),
    "row beyond the cable": (
        {"initial": {"shape": "equilibrium", "velocities": [[0, 0, 0, 0], [3.5, 0, 0, 0]]}},
        ["initial.velocities[1][0]", "3.5", "0 to 3 m", "cable.length"],
    ),
    "row too short": (
        {"initial": {"shape": "equilibrium", "velocities": [[0, 0, 0]]}},
        ["initial.velocities[0]", "3 entries", "Give 4"],
    ),
    "another unit": (
        {"initial": {"shape": "equilibrium", "velocity": ["1 m", 0, 0]}},
        ["initial.velocity[0]", "1 m", "m/s"],
    ),
    "unstretched between ends too far apart": (
        {
            "ends": {"a": HELD, "b": {"motion": "fixed", "position": [3.01, 0, 0]}},
            "initial": {"shape": "taut", "stretched": False},
        },
        ["initial.stretched", "3.01 m apart", "3 m long", "cable.length of 3.01 m"],
    ),
    "velocity of a saved state": (
        {"initial": {"shape": "state", "file": "a.nc", "velocity": [0, 0, 0]}},
        ["initial.velocity", "is not known here"],
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_contradictions_are_refused_in_words(name: str) -> None:
    changes, said = REFUSED[name]
    with pytest.raises(CaseError) as caught:
        build_scene(case(**changes))
    for words in said:
        assert words in str(caught.value)
