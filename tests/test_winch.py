"""The winch: insertion and removal as pure functions, exactness, transients, stops and hard cases."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scenes import FREE, VACUUM, body, cable, driven, held, scene, straight

from cablesim import Simulation, simulate, write
from cablesim.control import Measurement
from cablesim.mesh import FEWEST, LONGEST_BEYOND, ON_DRUM, SHORTEST, build_mesh
from cablesim.motion import earliest_fall, payout_waypoints, recorded_length
from cablesim.physics.model import CableModel, build_model
from cablesim.physics.needs import SPACE
from cablesim.physics.parameters import MASS
from cablesim.physics.winch import insert_node, material_velocity, remove_node
from cablesim.saved_state import read_saved_state
from cablesim.scene import Control, Scene, Winch
from cablesim.statics import find_initial_state
from cablesim.status import Status

Array = NDArray[np.float64]

CYCLE = [[0, 0], [0.5, 0.25], [8, 0.25], [8.5, 0], [9, -0.25], [18.5, -0.25], [19, 0]]


def winched(original: Scene, deployed: float, payout: ArrayLike | Control, **limits: float) -> Scene:
    """A scene whose end B is a winch; `payout` gives waypoints (t, speed) or a control."""
    if not isinstance(payout, Control):
        table = np.asarray(payout, dtype=float)
        payout = payout_waypoints(deployed, table[:, 0], table[:, 1])
    return replace(original, winch=Winch(deployed_length=deployed, payout=payout, **limits))


def cycle(*, segment: float = 0.05, payout: ArrayLike = CYCLE, **changes: Any) -> Scene:
    """The winch cycle: 3 m of rope between ends 1.5 m apart, paid out to 5 m and reeled in to 2.5 m."""
    length = changes.pop("length", 5.4)
    values: dict[str, Any] = {"duration": 30.0, "interval": 0.02, "relative_tolerance": 1e-5}
    return winched(
        scene(rope=cable(length=length), segments=round(length / segment), **(values | changes)), 3.0, payout
    )


@cache
def run(segment: float = 0.05, rtol: float = 1e-5) -> xr.Dataset:
    return simulate(cycle(segment=segment, relative_tolerance=rtol))


def end_forces(dataset: xr.Dataset) -> Array:
    """Size of the force on what holds each end."""
    return np.linalg.norm(dataset["end_force"].values, axis=2)


# Nodes that come and go ---------------------------------------------------------------------------


def test_mesh_of_the_whole_cable_stays_where_it_is() -> None:
    whole = build_mesh(scene(rope=cable(length=6.0), segments=60, attachments=[body(2.0), body(5.0)]))
    part = whole.deployed(45, 4.53)
    assert np.array_equal(part.nodes[:-1], whole.nodes[:45])
    assert part.nodes[-1] == 4.53
    assert list(part.attachment_nodes) == [20, ON_DRUM]
    assert list(part.in_water()) == [(0, 20)]
    assert part.node_lengths.sum() == pytest.approx(4.53, abs=1e-15)
    np.testing.assert_allclose(part.reference_lengths, 0.1, rtol=1e-12)


@pytest.mark.parametrize("length", [0.31, 1.0, 2.04, 2.0401, 2.98, 3.0])
def test_start_leaves_room_to_both_sides(length: float) -> None:
    whole = build_mesh(scene(segments=30))
    segments = whole.segments_at(length)
    rest = length - whole.nodes[segments - 1]
    assert SHORTEST * 0.1 < rest <= (1.0 + LONGEST_BEYOND) * 0.1
    assert whole.removal_length(segments) < length
    assert (whole.insertion_length(segments) or np.inf) > length


def test_bounds_do_not_chatter() -> None:
    whole = build_mesh(scene(segments=30))
    for segments in range(FEWEST + 1, 30):
        appears = whole.insertion_length(segments)
        assert appears is not None
        gone = whole.removal_length(segments + 1)
        # the node that has come goes again only when a fifth of a segment has been reeled in
        assert appears - gone == pytest.approx((LONGEST_BEYOND - SHORTEST) * 0.1)
        assert whole.insertion_length(segments - 1) < appears


def hanging(*, segments: int = 20, bending: float = 0.0) -> tuple[CableModel, CableModel, Array, float]:
    """A cable at rest when its next node is to come out: models before and after, state, length."""
    rope = cable(length=4.0, bending_stiffness=bending)
    base = scene(rope=rope, segments=2 * segments, skip=False, strain_feedback=0.0)
    whole = build_mesh(base)
    length = whole.insertion_length(segments)
    assert length is not None
    base = winched(base, length, [[0.0, 0.0]])
    start = find_initial_state(base, whole.deployed(segments, length))
    return (
        start.model,
        build_model(base, whole.deployed(segments + 1, length), start.model.frame),
        start.y,
        length,
    )


def chord_sum(model: CableModel, y: Array) -> Array:
    return model.node_places(0.0, y)[-1]


def after_insertion(old: CableModel, new: CableModel, y: Array) -> Array:
    return insert_node(0.0, y, old.consistent_rates(0.0, y), old, new)


def on_chord(old: CableModel, new: CableModel, y: Array) -> Array:
    """The new node on the chord, with one tension for both parts."""
    result, share = after_insertion(old, new, y), 1.0 / (1.0 + LONGEST_BEYOND)
    layout, q = new.layout, old.layout.chord(y)[-1]
    layout.tension(result)[-2:] = old.layout.tension(y)[-1]
    layout.chord(result)[-2:] = share * q, (1.0 - share) * q
    return result


def test_insertion_keeps_closure_length_and_mass() -> None:
    old, new, y, length = hanging()
    after = after_insertion(old, new, y)
    np.testing.assert_allclose(chord_sum(new, after), chord_sum(old, y), rtol=0, atol=1e-15)
    assert new.lengths(0.0).sum() == pytest.approx(length, rel=1e-15)
    mass = [model.loads(0.0)[:, MASS].sum() for model in (old, new)]
    assert mass[1] == pytest.approx(mass[0], rel=1e-14)
    np.testing.assert_allclose(after[: old.layout.cell * 19], y[: old.layout.cell * 19], rtol=0, atol=1e-15)


def test_cable_at_rest_stays_at_rest() -> None:
    """The new node is balanced, its neighbour better at each refinement; not so on the chord."""
    worst = []
    for segments in (20, 40, 80):
        old, new, y, _ = hanging(segments=segments)
        rates = new.consistent_rates(0.0, after_insertion(old, new, y))
        accelerations = np.linalg.norm(new.layout.velocity(rates), axis=1)
        assert accelerations[-1] < 1e-5
        assert accelerations[:-2].max() < 1e-9
        worst.append(accelerations[-2])
        rates = new.consistent_rates(0.0, on_chord(old, new, y))
        assert np.linalg.norm(new.layout.velocity(rates)[-1]) > 0.5 * 9.81
    assert worst[0] < 3e-3 * 9.81
    assert worst[0] / worst[1] == pytest.approx(2.0, rel=0.1)
    assert worst[1] / worst[2] == pytest.approx(2.0, rel=0.1)


def test_new_node_of_a_cable_that_bends_is_balanced() -> None:
    old, new, y, _ = hanging(bending=5e-3)
    rates = new.consistent_rates(0.0, after_insertion(old, new, y))
    assert np.linalg.norm(new.layout.velocity(rates)[-1]) < 1e-5
    assert np.linalg.norm(new.layout.velocity(rates), axis=1).max() < 0.1 * 9.81


def test_removal_undoes_insertion() -> None:
    old, new, y, _ = hanging()
    rng = np.random.default_rng(3)
    old.layout.velocity(y)[:] = 0.1 * rng.normal(size=old.layout.velocity(y).shape)
    yp = old.consistent_rates(0.0, y)
    after = insert_node(0.0, y, yp, old, new)
    back = remove_node(0.0, after, new.consistent_rates(0.0, after), new, old)
    np.testing.assert_allclose(old.layout.velocity(back), old.layout.velocity(y), rtol=0, atol=1e-6)
    for kind in (old.layout.tension, old.layout.chord, old.layout.end_place):
        np.testing.assert_allclose(kind(back), kind(y), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("comes", [True, False])
def test_tension_goes_on_changing_at_its_rate(comes: bool) -> None:
    """Velocities are right to a tolerance only: in a short stiff segment that would knock the tension."""
    old, new, y, _ = hanging()
    before, after = (old, new) if comes else (new, old)
    state = y if comes else after_insertion(old, new, y)
    yp = before.consistent_rates(0.0, state)
    noisy = state + 1e-3 * np.random.default_rng(2).normal(size=state.size)
    change = insert_node if comes else remove_node
    result = change(0.0, noisy, yp, before, after)
    noise = before.layout.tension(before.consistent_rates(0.0, noisy))[-1]
    assert abs(noise) > 0.1
    kept = after.layout.tension(after.consistent_rates(0.0, result))[-2 if comes else -1 :]
    np.testing.assert_allclose(kept, before.layout.tension(yp)[-1], rtol=0, atol=0.01 * abs(noise))
    moved = np.abs(after.layout.velocity(result)[:18] - before.layout.velocity(noisy)[:18])
    assert moved.max() < 5e-3


def test_slack_cable_takes_a_node_near_its_chord() -> None:
    old, new, y, _ = hanging()
    y = y.copy()
    old.layout.tension(y)[:] = 0.0
    after = after_insertion(old, new, y)
    assert np.isfinite(after).all()
    np.testing.assert_allclose(chord_sum(new, after), chord_sum(old, y), rtol=0, atol=1e-15)
    places = new.node_places(0.0, after)[-3:]
    chord = (places[2] - places[0]) / np.linalg.norm(places[2] - places[0])
    beside = places[1] - places[0] - ((places[1] - places[0]) @ chord) * chord
    assert np.linalg.norm(beside) < 0.02


def test_new_node_lies_near_the_curve() -> None:
    """Its distance from the rest shape of a finer mesh, over that of a node on the chord."""
    old, new, y, length = hanging(segments=20)
    where = float(new.parameters.constants[-1])
    fine = Simulation(scene(rope=cable(length=length), segments=416)).observe().position
    on_curve = np.array([np.interp(where, np.linspace(0, length, 417), fine[:, k]) for k in range(3)])
    curved, straight_on = (
        np.linalg.norm(new.node_places(0.0, put(old, new, y))[-2] - on_curve)
        for put in (after_insertion, on_chord)
    )
    assert curved < 0.2 * straight_on


# The winch cycle ----------------------------------------------------------------------------------


def test_tension_agrees_with_a_finer_mesh() -> None:
    coarse, fine = end_forces(run()), end_forces(run(segment=0.0125))
    assert np.abs(coarse - fine)[:, 0].max() < 0.01 * np.ptp(fine[:, 0])


def test_nothing_jumps_when_nodes_come_and_go() -> None:
    dataset = simulate(cycle(duration=7.0, interval=2e-3))
    times, force = dataset["time"].values, end_forces(dataset)
    events = dataset["winch_event_time"].values
    events = events[(events > 0.6) & (events < 6.9)]
    assert len(events) > 25
    after = np.searchsorted(times, events)
    for end in (0, 1):
        foretold = 2.0 * force[after - 1, end] - force[after - 2, end]
        jumps = np.abs(force[after, end] - foretold) / force[after, end]
        assert jumps.max() < 2e-3
    energy = np.interp(dataset["winch_event_time"], times, dataset["kinetic_energy"])
    assert np.abs(dataset["winch_event_energy_change"] / energy).max() < 1e-3


def test_no_line_at_the_insertion_rate() -> None:
    dataset = run()
    steady = dataset.sel(time=slice(2.0, 8.0))
    times, force = steady["time"].values, end_forces(steady)
    for end in (0, 1):
        smooth = np.polyval(np.polyfit(times - 5.0, force[:, end], 7), times - 5.0)
        window = np.hanning(len(times))
        spectrum = 2.0 * np.abs(np.fft.rfft((force[:, end] - smooth) * window)) / window.sum()
        frequency = np.fft.rfftfreq(len(times), times[1] - times[0])
        line = spectrum[np.abs(frequency - 0.25 / 0.05) < 0.4].max()
        assert line < 5e-5 * force[:, end].mean()


def test_rest_shape_after_the_cycle_is_the_static_one() -> None:
    """Quadratic drag lets a swing of a millimetre fade like 1/t only: 0.8 mm at 30 s, so wait for 150 s."""
    dataset = simulate(cycle(duration=150.0, interval=0.5, relative_tolerance=1e-4))
    assert float(dataset["deployed_length"][-1]) == pytest.approx(2.5, abs=1e-12)
    still = Simulation(scene(rope=cable(length=2.5), segments=50)).observe()
    places = dataset["position"][-1].dropna("node")
    assert np.linalg.norm(places.values - still.position, axis=1).max() < 3e-4


def test_length_mass_and_closure_are_exact() -> None:
    simulation = Simulation(cycle(relative_tolerance=1e-4))
    program = simulation.scene.winch.payout
    for t in np.linspace(0.37, 19.5, 40):
        simulation.step(float(t) - simulation.time)
        now, y, model = simulation.time, simulation.state[0], simulation.model
        length = program.position(now)[0]
        assert model.lengths(now).sum() == pytest.approx(length, abs=1e-12)
        assert model.loads(now)[:, MASS].sum() == pytest.approx(0.055 * length, abs=1e-12)
        assert np.linalg.norm(chord_sum(model, y) - model.end_place_and_velocity("b", 0.0)[0]) < 1e-9
    dataset = run()
    assert dataset["closure_error"].max() < 1e-9
    np.testing.assert_allclose(
        dataset["deployed_length"], program.position(dataset["time"].values)[:, 0], rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(
        dataset["deployed_mass"], 0.055 * dataset["deployed_length"], rtol=0, atol=1e-12
    )


def test_closure_while_both_ends_move() -> None:
    """Vessel and vehicle move, the winch works: at default tolerance B is where it should be to 0.3 mm."""
    moves = [[0, 0, 0, 0], [1, 0.3, 0.2, 0.1], [4, -0.4, 0.1, -0.2], [9, 0.2, -0.3, 0.1], [12, 0, 0, 0]]
    speeds = [[0, 0], [1, 0.4], [4, 0.4], [5, -0.4], [8, -0.4], [9, 0.2], [13, 0.2], [14, 0]]
    ends = {
        "a": driven([0.0, 0.0, 0.0], moves),
        "b": driven([1.5, 0.0, 0.0], -np.array(moves) * [-1, 1, 1, 1]),
    }
    dataset = simulate(cycle(payout=speeds, duration=20.0, relative_tolerance=1e-4, **ends))
    assert dataset.attrs["status"] == "completed"
    assert dataset.sizes["winch_event"] > 60
    closure = dataset["closure_error"]
    assert closure.max() < 3e-4
    assert closure.sel(time=slice(14.0, None)).max() < 1e-5


def test_refinement_converges() -> None:
    """Second order in the segment's length, and smaller errors with smaller tolerances."""

    def force(segment: float, rtol: float) -> Array:
        return end_forces(run(segment, rtol).sel(time=slice(2.0, 7.5)))[:, 0]

    exact = force(0.0125, 1e-6)
    errors = [np.sqrt(np.mean((force(h, 1e-6) - exact) ** 2)) for h in (0.1, 0.05)]
    assert errors[0] / errors[1] > 3.0
    by_tolerance = [np.sqrt(np.mean((force(0.0125, r) - exact) ** 2)) for r in (1e-4, 1e-5)]
    assert by_tolerance[0] > by_tolerance[1]


# Against formulas ---------------------------------------------------------------------------------


def test_load_lowered_on_a_cable() -> None:
    """A weight on a vertical cable in vacuum: the winch holds (M + m L)(g - L'')."""
    rope = cable(length=4.0, density=VACUUM, axial_stiffness=1e5)
    load = body(0.0, mass=0.5)
    base = scene(
        rope=rope,
        a=FREE,
        b=held([0.0, 0.0, 0.0]),
        attachments=[load],
        density=VACUUM,
        segments=80,
        initial=straight([0.0, 0.0, -1.0], [0.0, 0.0, 1.0], 1.0),
        duration=3.0,
        interval=0.01,
        relative_tolerance=1e-6,
    )
    dataset = simulate(winched(base, 1.0, [[0, 0], [1, 0], [2, 0.8], [3, 0.8]]))
    length, force = dataset["deployed_length"].values, -dataset["end_force"].values[:, 1, 2]
    weight = 0.5 + 0.055 * length
    settled = dataset["time"].values > 0.3
    quiet = settled & (np.abs(dataset["time"].values % 1.0 - 0.65) < 0.34)
    gain = np.where((dataset["time"].values > 1.0) & (dataset["time"].values < 2.0), 0.8, 0.0)
    np.testing.assert_allclose(force[quiet], (weight * (9.81 - gain))[quiet], rtol=2e-3)
    sunk = -dataset["position"].values[:, 0, 2]
    np.testing.assert_allclose(sunk, length * (1.0 + 0.55 * 9.81 / 1e5), atol=2e-4)


def test_energy_of_a_cable_in_vacuum_is_what_the_winch_gives() -> None:
    """Kinetic, potential and elastic energy gain the work at the winch and what flows in."""
    rope = cable(length=4.0, density=VACUUM)
    base = scene(
        rope=rope, density=VACUUM, segments=160, duration=1.5, interval=2e-3, relative_tolerance=1e-7
    )
    d = simulate(winched(base, 2.5, [[0, 0], [0.3, 0.4], [1.2, 0.4], [1.5, 0]]))
    energy = (d["kinetic_energy"] + d["potential_energy"] + d["elastic_energy"]).values
    speed, velocity = d["payout_speed"].values, d["velocity"].values[:, -1]
    force = -d["end_force"].values[:, 1]  # of the winch on the cable
    kinetic = 0.5 * 0.055 * np.sum(velocity**2, axis=1)  # of a metre at the winch; its height is nought
    power = np.sum(force * velocity, axis=1) + speed * kinetic
    times = d["time"].values
    work = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(times))))
    assert np.abs(energy - energy[0] - work).max() < 0.01 * np.ptp(work)


# Hard cases ---------------------------------------------------------------------------------------


def test_turning_back_right_at_an_event() -> None:
    whole = build_mesh(cycle())
    appears = whole.insertion_length(60)
    assert appears is not None
    half = 2.0 * (appears - 3.0) / 0.2  # ramps up and down reach exactly so far
    speeds = [
        [0, 0],
        [half / 2, 0.2],
        [half, 0],
        [1.5 * half, -0.2],
        [2 * half, 0],
        [2.5 * half, 0.2],
        [3 * half, 0],
    ]
    dataset = simulate(cycle(payout=speeds, duration=3 * half + 0.5))
    assert dataset.attrs["status"] == "completed"
    assert dataset.sizes["winch_event"] <= 6
    assert float(dataset["deployed_length"][-1]) == pytest.approx(appears, abs=1e-12)


@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_five_metres_a_second(speed: float) -> None:
    start = 3.0 if speed > 0 else 8.0
    rope = cable(length=9.0)
    base = scene(rope=rope, segments=180, duration=1.1, interval=0.1)
    dataset = simulate(winched(base, start, [[0, 0], [0.1, speed], [1.0, speed], [1.1, 0]]))
    assert dataset.attrs["status"] == "completed"
    assert dataset.sizes["winch_event"] == pytest.approx(100, abs=2)
    assert float(dataset["deployed_length"][-1]) == pytest.approx(start + speed, abs=1e-12)
    assert np.isfinite(dataset["position"].isel(node=0)).all()
    assert np.nanmax(np.abs(dataset["tension"])) < 100.0


def test_speed_step_without_ramp() -> None:
    dataset = simulate(
        cycle(payout=[[0, 0], [0.5, 0], [0.5, 0.5], [2, 0.5], [2, -0.5], [3, -0.5]], duration=3.0)
    )
    assert dataset.attrs["status"] == "completed"
    assert float(dataset["deployed_length"][-1]) == pytest.approx(3.25, abs=1e-12)


def test_slack_then_taut() -> None:
    """Reeled in until it is taut and beyond: the tension is that of the strain."""
    rope = cable(length=3.0, axial_stiffness=1e4)
    base = scene(rope=rope, segments=60, duration=8.0, interval=0.05)
    dataset = simulate(winched(base, 1.9, [[0, 0], [0.5, -0.1], [4, -0.1], [4.5, 0]]))
    assert dataset.attrs["status"] == "completed"
    length = float(dataset["deployed_length"][-1])
    assert length < 1.51
    tight = winched(base, 1.52, [[0, 0], [0.5, -0.02], [2.0, -0.02], [2.5, 0]])
    end = simulate(tight).isel(time=-1)
    strain = 1.5 / float(end["deployed_length"]) - 1.0
    assert strain > 0.01
    assert float(end["end_tension"][0]) == pytest.approx(1e4 * strain, rel=0.01)


@pytest.mark.parametrize(
    ("payout", "attachments", "limits", "status", "length"),
    [
        ([[0, 0.5]], [], {}, Status.DRUM_EMPTY, 5.4),
        ([[0, -0.5]], [body(2.0, mass=0.1)], {}, Status.ATTACHMENT_AT_WINCH, 2.0 + SHORTEST * 0.05),
        ([[0, -0.5]], [], {"minimum_length": 2.2}, Status.MINIMUM_LENGTH, 2.2),
    ],
)
def test_winch_stops_with_a_reason(payout, attachments, limits, status, length) -> None:
    base = scene(
        rope=cable(length=5.4), segments=108, attachments=attachments, duration=10.0, b=held([0.5, 0, 0])
    )
    dataset = simulate(winched(base, 3.0, payout, **limits))
    assert dataset.attrs["status"] == status.value
    assert f"{length:.6g} m deployed" in dataset.attrs["message"]
    assert float(dataset["deployed_length"][-1]) == pytest.approx(length, abs=1e-6)
    assert np.isfinite(dataset["end_force"].values).all()


def test_body_comes_from_the_drum() -> None:
    """A float on the drum is out of the water until it is paid out; then it pulls up."""
    buoy = body(3.5, mass=0.02, volume=1e-4, drag_area=1e-3, added_mass=0.5)
    base = scene(rope=cable(length=5.4), segments=108, attachments=[buoy], duration=8.0, interval=0.05)
    dataset = simulate(winched(base, 3.0, [[0, 0], [0.5, 0.25], [7.0, 0.25], [7.5, 0]]))
    assert dataset.attrs["status"] == "completed"
    out = dataset["deployed_length"] > 3.5 + LONGEST_BEYOND * 0.05
    there = np.isfinite(dataset["attachment_position"]).all(dim=("attachment", "axis"))
    assert np.array_equal(there.values, out.values)
    assert dataset["attachment_position"].isel(time=-1, attachment=0).sel(axis="z") > -0.6


# Around it ----------------------------------------------------------------------------------------


def test_drum_is_nowhere_in_the_results() -> None:
    dataset = run()
    deployed = dataset["deployed_length"].values[:, None]
    s = dataset["s"].values
    there = np.isfinite(dataset["position"].values).all(axis=2)
    assert there[:, -1].all()
    assert not (there[:, :-1] & (s[:-1] >= deployed)).any()
    assert there[:, :-1][s[:-1] < deployed - 1.6 * 0.05].all()
    at_winch = dataset["position"].values[:, -1]
    np.testing.assert_allclose(at_winch, np.broadcast_to([1.5, 0.0, 0.0], at_winch.shape), atol=1e-6)
    assert np.isfinite(dataset["tension"].values[:, -1]).all()


def test_skips_change_nothing() -> None:
    part = {"duration": 3.0, "relative_tolerance": 1e-7, "interval": 0.1}
    flat, solid = simulate(cycle(**part)), simulate(cycle(skip=False, **part))
    np.testing.assert_allclose(flat["position"], solid["position"], rtol=0, atol=1e-6)


def test_snapshot_comes_back_across_events() -> None:
    simulation = Simulation(cycle(relative_tolerance=1e-6))
    simulation.step(1.0)
    before = simulation.snapshot()
    first = simulation.step(2.0)
    simulation.restore(before)
    again = simulation.step(2.0)
    assert len(first.position) == len(again.position) > 60
    np.testing.assert_allclose(again.position, first.position, rtol=0, atol=1e-6)


def test_driven_from_outside_as_by_a_program() -> None:
    simulation = Simulation(cycle(payout=[[0, 0]], relative_tolerance=1e-6))
    simulation.step(0.5, payout_speed=0.25)
    observed = simulation.step(2.5)
    assert (observed.deployed_length, observed.payout_speed) == pytest.approx((3.6875, 0.25))
    wanted = run(rtol=1e-6).sel(time=3.0)["position"].dropna("node")
    np.testing.assert_allclose(observed.position, wanted, rtol=0, atol=2e-5)


def test_end_that_jumps_is_followed_while_the_winch_is_driven() -> None:
    """Driving the winch leaves the ends to their motions: a jump of velocity restarts the integrator."""
    jump = [[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0.4, 0], [3, 0, 0.4, 0]]
    by_program = Simulation(cycle(payout=[[0, 0.1]], a=driven([0.0, 0, 0], jump), relative_tolerance=1e-6))
    by_hand = Simulation(cycle(payout=[[0, 0.1]], a=driven([0.0, 0, 0], jump), relative_tolerance=1e-6))
    by_hand.step(0.5, payout_speed=0.1)
    observed = by_hand.step(1.5)
    assert observed.status is Status.COMPLETED
    np.testing.assert_allclose(observed.position, by_program.step(2.0).position, rtol=0, atol=2e-5)
    np.testing.assert_allclose(observed.velocity[0], [0.0, 0.4, 0.0], atol=1e-9)


def test_limits_hold_for_commands_from_outside() -> None:
    base = winched(cycle(), 3.0, [[0, 0]], maximum_speed=0.3, maximum_acceleration=0.5)
    simulation = Simulation(base)
    assert simulation.step(0.2, payout_speed=1.0).payout_speed == pytest.approx(0.1)
    assert simulation.step(2.0, payout_speed=1.0).payout_speed == pytest.approx(0.3)


def proportional(measured: Measurement) -> float:
    return 2.0 * (3.4 - measured.deployed_length)


def test_controller_at_20_hz_costs_no_restarts() -> None:
    control = Control(period=0.05, delay=0.0, make=lambda: proportional)
    dataset = simulate(winched(cycle(duration=4.0, interval=0.05), 3.0, control))
    assert dataset.attrs["starts"] == 1 + dataset.sizes["winch_event"]
    # an answer is reached two periods after its sample; L gains the mean of both speeds of a period
    length, speeds = 3.0, [0.0, 0.0]
    for k in range(20):
        speeds.append(2.0 * (3.4 - length))
        length += 0.5 * 0.05 * (speeds[k] + speeds[k + 1])
    assert float(dataset["deployed_length"].sel(time=1.0)) == pytest.approx(length, abs=1e-12)


def test_a_failing_controller_ends_the_run_with_what_it_said() -> None:
    def fails(measured: Measurement) -> float:
        if measured.time > 0.5:
            raise ValueError("no idea")
        return 0.1

    dataset = simulate(winched(cycle(), 3.0, Control(period=0.05, delay=0.0, make=lambda: fails)))
    assert dataset.attrs["status"] == "controller failed"
    assert "ValueError: no idea" in dataset.attrs["message"]
    assert float(dataset["time"][-1]) == pytest.approx(0.55)


def test_controller_is_told_old_news() -> None:
    seen: list[tuple[float, float]] = []
    simulation: Simulation

    def listens(measured: Measurement) -> float:
        seen.append((simulation.time, measured.time))
        return 0.0

    simulation = Simulation.__new__(Simulation)
    simulation.__init__(winched(cycle(), 3.0, Control(period=0.05, delay=0.12, make=lambda: listens)))
    simulation.step(0.6)
    ages = [now - then for now, then in seen if now > 0.2]
    np.testing.assert_allclose(ages, 0.15, atol=1e-9)


def test_much_cranking_leaves_nothing_behind() -> None:
    """Hundreds of events keep one solver object for each size, and cost no more late than early."""
    times = np.arange(0.0, 121.0, 1.0)
    speeds = 0.45 * np.sin(0.7 * times) + 0.45 * np.sin(0.31 * times + 1.0) - 0.45 * np.sin(1.0)
    program = np.stack((times, speeds), axis=1)
    lengths = payout_waypoints(3.0, times, speeds).position(np.linspace(0, 120, 2000))[:, 0]
    speeds -= (lengths[-1] - 3.0) / 120.0
    program[:, 1] = speeds
    simulation = Simulation(
        cycle(payout=program, segment=0.05, relative_tolerance=1e-4, duration=120.0, length=9.0)
    )
    dataset = simulation.run()
    assert dataset.attrs["status"] == "completed"
    events = dataset["winch_event_time"].values
    assert len(events) > 400
    sizes = 1 + np.ptp(np.cumsum(dataset["winch_event_change"].values))
    assert len(simulation._integrators) <= sizes + 1
    assert dataset.attrs["starts"] == len(events) + 1
    assert dataset.attrs["residual_calls"] / len(events) < 60


def test_bound_on_the_time_of_a_fall() -> None:
    program = payout_waypoints(3.0, [0.0, 1.0, 2.0], [0.5, -1.0, -1.0])
    table = program.coefficients[:, :, 0]
    for start in (0.0, 0.4, 1.0, 1.7, 5.0):
        for fall in (0.01, 0.3, 2.0):
            bound = earliest_fall(program.breaks, table, start, fall)
            times = np.linspace(start, bound, 200)
            assert program.position(times)[:, 0].min() >= program.position(start)[0] - fall - 1e-12
            assert bound > start
    assert earliest_fall(program.breaks[:2], np.array([[3.0, 0.5, 0, 0, 0, 0]]), 0.0, 0.1) == np.inf


def test_material_at_the_winch_moves_with_the_drum() -> None:
    simulation = Simulation(cycle())
    simulation.step(2.0)
    y, _ = simulation.state
    velocity = material_velocity(simulation.time, y, simulation.model)
    chord = simulation.model.layout.chord(y)[-1]
    assert np.linalg.norm(velocity) == pytest.approx(0.25, rel=1e-3)
    assert velocity @ chord < 0.0  # away from the winch
    assert simulation.model.frame is not SPACE


def test_run_goes_on_from_a_saved_state(tmp_path: Path) -> None:
    """A second run that starts from the state of the first at 2 s goes on as the first does."""
    whole = simulate(cycle(duration=4.0, relative_tolerance=1e-6))
    write(whole, tmp_path / "first.nc")
    state = read_saved_state(tmp_path / "first.nc", 2.0)
    deployed = float(whole["deployed_length"].sel(time=2.0))
    assert state.arc[-1] == pytest.approx(deployed, abs=1e-12)
    again = cycle(duration=2.0, relative_tolerance=1e-6, initial=state, payout=[[0, 0.25]])
    payout = payout_waypoints(deployed, [0.0], [0.25])
    again = replace(again, winch=replace(again.winch, deployed_length=deployed, payout=payout))
    found = simulate(again).isel(time=-1)["position"].dropna("node")
    np.testing.assert_allclose(found, whole.isel(time=-1)["position"].dropna("node"), rtol=0, atol=5e-5)


def test_recorded_length_plays_a_run_again() -> None:
    first = simulate(cycle(duration=6.0, interval=0.02))
    program = recorded_length(first["time"], first["deployed_length"], 0.0)
    second = cycle(duration=5.9)
    second = simulate(replace(second, winch=replace(second.winch, payout=program)))
    assert second.attrs["status"] == "completed"
    first, second = (d["position"].sel(time=5.8).dropna("node") for d in (first, second))
    np.testing.assert_allclose(second, first, rtol=0, atol=1e-4)
