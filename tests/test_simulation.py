"""Stepping, driving, snapshots, jumps, failures, and the dataset of a run."""

from __future__ import annotations

import gc
import tracemalloc
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from scenes import (
    FREE,
    VACUUM,
    body,
    cable,
    driven,
    held,
    pendulum,
    scene,
    sway,
)

from cablesim.build import build_scene
from cablesim.case import Case, load_case
from cablesim.integrate import IdaIntegrator
from cablesim.physics.parameters import MASS
from cablesim.scene import Scene
from cablesim.simulation import Observation, Progress, Simulation, simulate
from cablesim.status import Status
from cablesim.trajectory.file import read, write
from cablesim.trajectory.variables import VARIABLES

Array = NDArray[np.float64]

SHORT: dict[str, Any] = {"segments": 20, "duration": 2.0, "interval": 0.1, "variables": ()}
TOLERANCE = 5e-4  # [m], of a sway at the default relative tolerance of 1e-4


def short_sway(**changes: Any) -> Simulation:
    return Simulation(sway(**(SHORT | changes)))


def end_b(observation: Observation) -> Array:
    return observation.position[-1]


# Stepping -----------------------------------------------------------------------------------------


def test_steps_to_a_time_equal_a_run_to_it() -> None:
    simulation = short_sway()
    steps = [simulation.step(0.1) for _ in range(20)]
    whole = short_sway().run()
    found = np.stack([step.position for step in steps])
    assert np.abs(found - whole.position.values[1:]).max() < TOLERANCE
    assert simulation.time == pytest.approx(2.0, abs=1e-12)
    assert all(step.status is Status.COMPLETED for step in steps)


def test_large_step_equals_small_steps() -> None:
    few, many = short_sway(), short_sway()
    few.step(2.0)
    for _ in range(200):
        last = many.step(0.01)
    assert np.abs(last.position - few.observe().position).max() < TOLERANCE


def test_run_goes_on_from_where_steps_ended() -> None:
    simulation = short_sway()
    simulation.step(0.73)
    rest = simulation.run()
    whole = short_sway().run()
    np.testing.assert_allclose(rest.time.values, [0.73, *np.arange(8, 21) * 0.1], rtol=0, atol=1e-12)
    assert np.abs(rest.position.values[1:] - whole.position.values[8:]).max() < TOLERANCE


def test_reset_begins_anew() -> None:
    simulation = short_sway()
    first = simulation.step(0.5).position
    simulation.step(0.5, velocity_b=[0.0, 0.3, 0.0])
    simulation.reset()
    assert simulation.time == 0.0
    np.testing.assert_array_equal(simulation.step(0.5).position, first)


def test_observation_tells_place_velocity_and_tension() -> None:
    seen = short_sway().step(1.0)
    assert (seen.position.shape, seen.velocity.shape, seen.tension.shape) == ((21, 3), (21, 3), (20,))
    np.testing.assert_allclose(end_b(seen), [1.5, 0.375, 0.0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(seen.velocity[-1], [0.0, 0.5, 0.0], rtol=0, atol=1e-4)
    assert seen.time == 1.0


def test_state_is_a_copy() -> None:
    simulation = short_sway()
    simulation.state[0][:] = np.nan
    assert np.isfinite(simulation.step(0.1).position).all()


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan")])
def test_step_must_be_positive(duration: float) -> None:
    with pytest.raises(ValueError, match="positive"):
        short_sway().step(duration)


# Driving ------------------------------------------------------------------------------------------


def test_driven_end_moves_as_told() -> None:
    simulation = short_sway()
    place, velocity = np.array([1.5, 0.0, 0.0]), np.zeros(3)
    for command in ([0.0, 0.2, 0.0], [-0.1, 0.2, 0.3], [0.0, -0.4, 0.0], [0.0, 0.0, 0.0]):
        seen = simulation.step(0.25, velocity_b=command)
        place = place + 0.125 * (velocity + command)
        velocity = np.array(command)
        np.testing.assert_allclose(end_b(seen), place, rtol=0, atol=1e-6)
        np.testing.assert_allclose(seen.velocity[-1], velocity, rtol=0, atol=1e-5)


def test_driven_end_keeps_its_velocity_until_told_otherwise() -> None:
    simulation = short_sway()
    simulation.step(0.2, velocity_b=[0.0, 0.3, 0.0])
    seen = simulation.step(1.0)
    np.testing.assert_allclose(end_b(seen), [1.5, 0.33, 0.0], rtol=0, atol=1e-6)


def test_both_ends_may_be_driven() -> None:
    simulation = Simulation(scene(**(SHORT | {"skip": False})))
    for _ in range(5):
        seen = simulation.step(0.2, velocity_a=[0.0, 0.1, 0.0], velocity_b=[0.0, 0.1, 0.0])
    np.testing.assert_allclose(seen.position[[0, -1], 1], 0.01 + 0.08, rtol=0, atol=1e-6)


def test_driving_is_the_same_as_a_motion_of_the_case() -> None:
    """A ramp to 0.5 m/s in 0.5 s and on, told in steps."""
    told = Simulation(scene(**(SHORT | {"skip": False})))
    for k in range(20):
        seen = told.step(0.1, velocity_b=[0.0, min(0.1 * (k + 1), 0.5), 0.0])
    assert np.abs(seen.position - short_sway().run().position.values[-1]).max() < TOLERANCE


def test_run_after_driving_goes_on_at_the_last_velocity() -> None:
    simulation = short_sway()
    simulation.step(0.5, velocity_b=[0.0, 0.2, 0.0])
    result = simulation.run()
    np.testing.assert_allclose(result.position.values[-1, -1], [1.5, 0.05 + 0.3, 0.0], rtol=0, atol=1e-6)
    assert result.closure_error.max() < 1e-4
    np.testing.assert_allclose(result.acceleration.values[5:, -1], 0.0, rtol=0, atol=1e-9)


def test_dataset_places_a_cable_whose_end_a_was_driven() -> None:
    simulation = short_sway()
    seen = simulation.step(0.5, velocity_a=[0.0, 0.2, 0.0])
    first = simulation.run().isel(time=0)
    np.testing.assert_allclose(first.position.values, seen.position, rtol=0, atol=1e-9)


def test_free_end_cannot_be_driven() -> None:
    with pytest.raises(ValueError, match="velocity_b drives a free end"):
        Simulation(pendulum(**SHORT)).step(0.1, velocity_b=[0.0, 0.0, 0.0])


def test_planar_scene_cannot_be_driven_out_of_its_plane() -> None:
    simulation = Simulation(scene(**SHORT))
    with pytest.raises(ValueError, match=r"0\.1.*simulation\.skip"):
        simulation.step(0.1, velocity_b=[0.0, 0.1, 0.0])


@pytest.mark.parametrize("command", [[0.0, 0.1], 0.3, [0.0, float("nan"), 0.0]])
def test_command_must_be_three_numbers(command: Any) -> None:
    with pytest.raises(ValueError, match="velocity_b"):
        short_sway().step(0.1, velocity_b=command)


# Snapshots ----------------------------------------------------------------------------------------


def test_restored_moment_repeats() -> None:
    simulation = short_sway()
    simulation.step(0.6)
    before = simulation.snapshot()
    once = simulation.step(1.0)
    simulation.restore(before)
    assert simulation.time == pytest.approx(0.6, abs=1e-12)
    again = simulation.step(1.0)
    assert np.abs(once.position - again.position).max() < TOLERANCE


def test_snapshot_is_not_changed_by_what_follows() -> None:
    simulation = short_sway()
    simulation.step(0.6)
    before = simulation.snapshot()
    y, yp = before.y.copy(), before.yp.copy()
    simulation.step(1.0, velocity_b=[0.1, 0.0, 0.0])
    np.testing.assert_array_equal(before.y, y)
    np.testing.assert_array_equal(before.yp, yp)


def test_two_futures_of_one_moment() -> None:
    simulation = short_sway()
    before = simulation.snapshot()
    left = simulation.step(0.5, velocity_b=[0.0, 0.4, 0.0])
    simulation.restore(before)
    right = simulation.step(0.5, velocity_b=[0.0, -0.4, 0.0])
    np.testing.assert_allclose(left.position * [1.0, -1.0, 1.0], right.position, rtol=0, atol=TOLERANCE)


def test_driven_moment_comes_back_driven() -> None:
    simulation = short_sway()
    simulation.step(0.5, velocity_b=[0.0, 0.2, 0.0])
    before = simulation.snapshot()
    simulation.step(0.7, velocity_b=[0.0, -0.2, 0.1])
    simulation.restore(before)
    np.testing.assert_allclose(end_b(simulation.step(0.5)), [1.5, 0.15, 0.0], rtol=0, atol=1e-6)


def test_snapshot_serves_another_simulation_of_the_case() -> None:
    one, other = short_sway(), short_sway()
    one.step(0.5, velocity_b=[0.0, 0.2, 0.0])
    other.restore(one.snapshot())
    assert np.abs(other.step(0.5).position - one.step(0.5).position).max() < TOLERANCE


def test_many_snapshots_take_no_memory() -> None:
    simulation = short_sway()
    simulation.step(0.1)
    before = simulation.snapshot()

    def cycles(count: int) -> int:
        for _ in range(count):
            simulation.restore(before)
            simulation.step(1e-3, velocity_b=[0.0, 0.1, 0.0])
            simulation.snapshot()
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        sizes = [cycles(400) for _ in range(4)]
    finally:
        tracemalloc.stop()
    # free lists of the interpreter fill now and then; what leaks grows every time, by 5 kB a snapshot
    assert min(late - early for early, late in pairwise(sizes)) < 5_000


# Corners and jumps --------------------------------------------------------------------------------

JUMPS = [[0.0, 0, 0.0, 0], [0.5, 0, 0.0, 0], [0.5, 0, 0.4, 0], [1.2, 0, 0.4, 0], [1.2, 0, -0.1, 0]]


def jumping() -> xr.Dataset:
    return simulate(scene(b=driven([1.5, 0.0, 0.0], JUMPS), **(SHORT | {"interval": 0.05})))


def test_jumps_of_velocity_are_followed() -> None:
    result = jumping()
    wanted = driven([1.5, 0.0, 0.0], JUMPS).motion
    assert wanted is not None
    assert result.attrs["status"] == "completed"
    np.testing.assert_allclose(
        result.position.values[:, -1], wanted.position(result.time.values), rtol=0, atol=1e-4
    )
    np.testing.assert_allclose(
        result.velocity.values[:, -1], wanted.velocity(result.time.values), rtol=0, atol=2e-3
    )


def test_integrator_restarts_at_jumps_and_not_at_corners() -> None:
    assert jumping().attrs["starts"] == 3
    assert short_sway().run().attrs["starts"] == 1


def test_jump_between_outputs_is_not_missed() -> None:
    fine, coarse = jumping(), simulate(scene(b=driven([1.5, 0.0, 0.0], JUMPS), **(SHORT | {"interval": 2.0})))
    assert np.abs(fine.position.values[-1] - coarse.position.values[-1]).max() < TOLERANCE


def test_jump_at_the_start_of_a_step_is_not_repeated() -> None:
    simulation = Simulation(scene(b=driven([1.5, 0.0, 0.0], JUMPS), **SHORT))
    simulation.step(0.5)
    before = simulation.snapshot()
    simulation.restore(before)
    np.testing.assert_allclose(end_b(simulation.step(0.5)), [1.5, 0.2, 0.0], rtol=0, atol=1e-4)


# Output -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("duration", "interval", "last"),
    [(1.0, 0.1, [0.9, 1.0]), (1.0, 0.3, [0.9, 1.0]), (0.25, 1.0, [0.0, 0.25])],
)
def test_output_times(duration: float, interval: float, last: list[float]) -> None:
    times = short_sway(duration=duration, interval=interval).run().time.values
    np.testing.assert_allclose(times[-2:], last, rtol=0, atol=1e-12)
    np.testing.assert_allclose(times[:-1], interval * np.arange(times.size - 1), rtol=0, atol=1e-12)


def everything() -> Scene:
    """A scene that has all variables."""
    return scene(
        rope=cable(bending_stiffness=0.02),
        attachments=[body(1.0, mass=0.1, drag_area=1e-3)],
        b=driven([1.5, 0.0, 0.0], [[0.0, 0, 0, 0], [1.0, 0, 0.3, 0.1]]),
        markers=[0.0, 0.7, 3.0],
        skip=False,
        **(SHORT | {"duration": 1.0}),
    )


@pytest.fixture(scope="module")
def full() -> xr.Dataset:
    return simulate(everything())


def test_every_variable_has_units_and_a_name(full: xr.Dataset) -> None:
    assert set(full.data_vars) == {name for name, v in VARIABLES.items() if v.needed(everything())}
    for name, variable in full.data_vars.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    for name in ("time", "s", "s_segment", "marker_s"):
        assert {"units", "long_name"} <= set(full[name].attrs), name


def test_everything_is_finite(full: xr.Dataset) -> None:
    assert all(np.isfinite(variable.values).all() for variable in full.data_vars.values())


def test_attributes_follow_the_conventions(full: xr.Dataset) -> None:
    assert full.attrs["Conventions"].startswith("CF-")
    assert {"title", "source", "history", "status", "message", "case", "skipped"} <= set(full.attrs)
    assert full.time.attrs["units"] == "s"


def test_only_what_is_asked_for_is_kept() -> None:
    result = short_sway(variables=("tension", "closure_error")).run()
    assert set(result.data_vars) == {"tension", "closure_error"}


def test_velocity_is_the_rate_of_position() -> None:
    fine = simulate(replace(everything(), output=replace(everything().output, interval=1e-3)))
    t, inner = fine.time.values, slice(300, 900)
    slope = np.gradient(fine.position.values, t, axis=0)
    assert np.abs(slope - fine.velocity.values)[inner].max() < 2e-3


def test_paper_s_frame_holds_the_vectors(full: xr.Dataset) -> None:
    """|V|^2 from components; tangent from theta and phi, equation (8)."""
    parts = full.velocity_tangential**2 + full.velocity_normal**2 + full.velocity_binormal**2
    np.testing.assert_allclose(parts, (full.velocity**2).sum("axis"), rtol=1e-10, atol=1e-14)
    theta, phi = full.theta.values, full.phi.values
    wanted = np.stack((np.cos(phi) * np.cos(theta), -np.sin(theta), -np.sin(phi) * np.cos(theta)), axis=-1)
    chords = np.diff(full.position.values, axis=1)
    np.testing.assert_allclose(
        chords / np.linalg.norm(chords, axis=-1)[..., None], wanted, rtol=0, atol=1e-12
    )


def test_end_forces_accelerate_the_whole() -> None:
    """Without water: what holds the ends, and the weight, make up the change of momentum."""
    rope = cable(density=VACUUM)
    case = replace(
        everything(), cable=rope, attachments=(), water=replace(everything().water, density=VACUUM)
    )
    simulation = Simulation(case)
    result = simulation.run()
    mass = simulation.model.loads(0.0)[:, MASS]
    change = np.einsum("n,tnc->tc", mass, result.acceleration.values)
    push = -result.end_force.values.sum(axis=1) - mass.sum() * 9.81 * np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(push, change, rtol=0, atol=1e-3 * np.abs(push).max())


def test_markers_lie_on_the_cable(full: xr.Dataset) -> None:
    np.testing.assert_array_equal(full.marker_position.values[:, [0, 2]], full.position.values[:, [0, -1]])
    s = full.s.values
    wanted = [np.interp(0.7, s, full.position.values[-1, :, k]) for k in range(3)]
    np.testing.assert_allclose(full.marker_position.values[-1, 1], wanted, rtol=0, atol=1e-12)


def test_attachment_sits_on_its_node(full: xr.Dataset) -> None:
    node = int(np.argmin(np.abs(full.s.values - 1.0)))
    np.testing.assert_array_equal(full.attachment_position.values[:, 0], full.position.values[:, node])


def test_cable_closes_at_default_tolerance() -> None:
    assert short_sway(duration=10.0, segments=60).run().closure_error.max() < 1e-4


def test_cable_closes_at_rest() -> None:
    assert simulate(scene(**SHORT)).closure_error.max() < 1e-6


def test_file_gives_the_dataset_back(full: xr.Dataset, tmp_path: Path) -> None:
    write(full, tmp_path / "run.nc")
    xr.testing.assert_identical(read(tmp_path / "run.nc"), full)


def test_result_holds_its_case(tmp_path: Path) -> None:
    """The case kept with the results runs again."""
    root = Path(__file__).resolve().parent.parent
    case = load_case(root / "cases" / "pendulum.yaml")
    result = simulate(replace(build_scene(case), duration=0.1))
    (tmp_path / "again.yaml").write_text(result.attrs["case"])
    again = load_case(tmp_path / "again.yaml")
    assert isinstance(again, Case)
    assert build_scene(again).cable == build_scene(case).cable


def test_progress_is_told_at_every_output() -> None:
    told: list[Progress] = []
    short_sway().run(told.append)
    np.testing.assert_allclose([each.time for each in told], 0.1 * np.arange(1, 21), rtol=0, atol=1e-12)
    assert told[-1].duration == 2.0
    assert told[-1].residual_calls > told[0].residual_calls


# Runs that end early ------------------------------------------------------------------------------


def check_partial(result: xr.Dataset, status: Status) -> None:
    """Finite, shorter than asked for, and says when, where and what."""
    assert result.attrs["status"] == status.value
    assert result.time.values[-1] < 2.0
    assert (np.diff(result.time.values) > 0.0).all()
    assert all(np.isfinite(variable.values).all() for variable in result.data_vars.values())
    message = result.attrs["message"]
    assert f"t = {result.time.values[-1]:.6g} s" in message
    assert "at node" in message
    assert status.sentence in message


def test_step_limit_keeps_what_was_computed() -> None:
    result = short_sway(max_steps=3).run()
    check_partial(result, Status.STEP_LIMIT)
    assert any(
        kind in result.attrs["message"] for kind in ("velocity", "tension", "direction", "place of end B")
    )


def test_time_limit_keeps_what_was_computed() -> None:
    check_partial(short_sway(time_limit=1e-9, relative_tolerance=1e-8).run(), Status.TIME_LIMIT)


def test_interrupt_keeps_what_was_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    original = IdaIntegrator._residual

    def interrupted(self: IdaIntegrator, t: float, y: Array, yp: Array, out: Array) -> None:
        if t > 1.0:
            raise KeyboardInterrupt
        original(self, t, y, yp, out)

    monkeypatch.setattr(IdaIntegrator, "_residual", interrupted)
    result = short_sway().run()
    check_partial(result, Status.INTERRUPTED)
    assert 0.8 < result.time.values[-1] <= 1.0


def test_end_may_start_in_motion() -> None:
    """A velocity at t = 0 is a jump from rest."""
    moving = driven([1.5, 0.0, 0.0], [[0.0, 0.0, 0.2, 0.1]])
    result = simulate(scene(b=moving, **SHORT))
    assert result.attrs["status"] == "completed", result.attrs["message"]
    np.testing.assert_allclose(result.position.values[-1, -1], [1.5, 0.4, 0.2], rtol=0, atol=1e-4)


def test_jump_a_rounding_away_from_an_output_time() -> None:
    """0.05 * 24 is 1.2000000000000002, too close after 1.2 for IDA to start towards it: it means 1.2."""
    result = jumping()
    times = result.time.values
    assert 0.05 * 24 > times[24] == 1.2
    np.testing.assert_allclose(result.velocity.values[24, -1], [0.0, -0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(times, 0.05 * np.arange(41), rtol=0, atol=1e-12)


def test_restored_moment_a_rounding_before_an_output_time() -> None:
    simulation = short_sway()
    for _ in range(8):
        simulation.step(0.1)  # 0.7999999999999999
    simulation.restore(simulation.snapshot())
    assert simulation.run().attrs["status"] == "completed"


def test_number_that_is_not_finite_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    original = IdaIntegrator._residual

    def spoiled(self: IdaIntegrator, t: float, y: Array, yp: Array, out: Array) -> None:
        original(self, t, y, yp, out)
        if t > 1.0:
            out[:] = np.nan

    monkeypatch.setattr(IdaIntegrator, "_residual", spoiled)
    result = short_sway().run()
    assert result.attrs["status"] in {Status.NOT_FINITE.value, Status.CONVERGENCE_FAILURE.value}
    check_partial(result, Status(result.attrs["status"]))


def test_failed_step_reports_its_status() -> None:
    seen = short_sway(max_steps=3).step(1.0)
    assert seen.status is Status.STEP_LIMIT
    assert 0.0 <= seen.time < 1.0
    assert np.isfinite(seen.position).all()


def test_simulation_goes_on_after_an_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    original, armed = IdaIntegrator._residual, [True]

    def interrupted_once(self: IdaIntegrator, t: float, y: Array, yp: Array, out: Array) -> None:
        if t > 1.0 and armed:
            armed.clear()
            raise KeyboardInterrupt
        original(self, t, y, yp, out)

    monkeypatch.setattr(IdaIntegrator, "_residual", interrupted_once)
    simulation = short_sway()
    assert simulation.run().attrs["status"] == "interrupted"
    simulation.restore(simulation.snapshot())
    rest = simulation.run()
    monkeypatch.undo()
    assert rest.attrs["status"] == "completed"
    assert np.abs(rest.position.values[-1] - short_sway().run().position.values[-1]).max() < TOLERANCE


def test_exception_of_the_progress_callback_reaches_the_caller() -> None:
    def stop(progress: Progress) -> None:
        raise RuntimeError(f"enough at {progress.time:g}")

    with pytest.raises(RuntimeError, match=r"enough at 0\.1"):
        short_sway().run(stop)


# Solvers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["band", "krylov"])
def test_linear_solvers_agree(solver: str) -> None:
    reference = short_sway(relative_tolerance=1e-7, max_order=5).run().position.values
    found = short_sway(relative_tolerance=1e-6, linear_solver=solver).run()
    assert found.attrs["status"] == "completed"
    assert np.abs(found.position.values - reference).max() < 5e-5


def test_longest_step_is_kept() -> None:
    calls = [short_sway(max_step=step).run().attrs["residual_calls"] for step in (None, 1e-3)]
    assert calls[1] > 2000 > calls[0]


def test_free_end_and_held_end_run_in_one_process() -> None:
    for case in (
        sway(**SHORT),
        pendulum(**SHORT),
        scene(b=FREE, **SHORT),
        scene(b=held([1.0, 1.0, 0.5]), **SHORT),
    ):
        assert simulate(case).attrs["status"] == "completed"
