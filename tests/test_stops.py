"""Times that mean the same instant: stops, and steps of every size beside the corners of the inputs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenes import driven, scene
from test_winch import winched

from cablesim import Simulation, Status, simulate
from cablesim.control import ConstantLength
from cablesim.motion import velocity_waypoints
from cablesim.scene import Control, Scene
from cablesim.stops import NEVER, SAME_TIME, Stop, Stops, same_time

WAYPOINTS = [[0, 0, 0, 0], [0.5, 0, 0.2, 0], [0.5, 0, -0.1, 0], [1.1, 0, 0.3, 0], [1.7, 0, 0.0, 0]]
CORNERS = (0.5, 1.1, 1.7)


def cornered(**changes: float) -> Scene:
    """An end with a jump at 0.5 s and corners after it, and a winch whose program has a corner at 1.1 s."""
    base = scene(b=driven([1.5, 0, 0], WAYPOINTS), segments=20, duration=3.0, interval=0.1, **changes)
    return winched(base, 2.0, [[0, 0.0], [1.1, 0.1], [3, 0.1]])


def test_instants_that_differ_by_rounding_are_one_stop() -> None:
    rates = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]]
    stops = Stops([velocity_waypoints(np.zeros(3), [0, t, 5, 6], rates) for t in (0.3, 0.1 * 3)], 10.0)
    assert 0.3 != 0.1 * 3
    assert stops.after(0.0) == Stop(0.3, 0.1 * 3, False)
    assert stops.after(0.3).time == 5.0
    assert stops.snapped(math.nextafter(0.3, 0)) == 0.1 * 3
    assert stops.after(10.0) is NEVER


def test_a_jump_beside_a_corner_is_a_jump_seen_after_both() -> None:
    corner = velocity_waypoints(np.zeros(3), [0, 0.3, 9], [[0, 0, 0], [1, 0, 0], [1, 0, 0]])
    jump = velocity_waypoints(np.zeros(3), [0, 0.1 * 3, 0.1 * 3], [[0, 0, 0], [0, 0, 0], [1, 0, 0]])
    stop = Stops([corner, jump], 10.0).after(0.0)
    assert stop == Stop(0.3, 0.1 * 3, True)
    assert stop.limit < 0.3


def test_same_time_holds_for_sums_of_many_steps_and_for_weeks() -> None:
    assert same_time(math.fsum([0.1] * 180), sum([0.1] * 180))
    assert same_time(2e6, math.nextafter(2e6, math.inf))
    assert not same_time(18.0, 18.0 + 2 * SAME_TIME)
    assert not same_time(18.0, math.inf)


@pytest.mark.parametrize("seed", range(6))
def test_steps_of_any_size_beside_corners(seed: int) -> None:
    """Steps that end from one unit in the last place to 1e-3 s beside corners and jumps, with restarts."""
    draw = np.random.default_rng(seed)
    simulation = Simulation(cornered())
    while simulation.time < 2.0:
        ahead = [corner for corner in CORNERS if corner > simulation.time + 2 * SAME_TIME]
        target = simulation.time + draw.uniform(0.05, 0.3)
        if ahead and draw.random() < 0.8:
            distance = 10.0 ** draw.uniform(-17, -3) * draw.choice([-1, 1])
            target = max(ahead[0] + distance, simulation.time + 2 * SAME_TIME)
        before = simulation.time
        seen = simulation.step(target - before)
        assert seen.status is Status.COMPLETED
        assert abs(seen.time - target) <= 2 * SAME_TIME
        if draw.random() < 0.7:
            simulation.restore(simulation.snapshot())
    end = cornered().end_b.motion
    assert end is not None
    np.testing.assert_allclose(seen.position[-1], end.position(seen.time), atol=1e-5)
    np.testing.assert_allclose(seen.velocity[-1], end.velocity(seen.time), atol=1e-4)
    program = cornered().winch.payout
    assert seen.deployed_length == pytest.approx(float(program.position(seen.time)[0]), abs=1e-9)


def test_steps_that_add_up_to_a_corner_reach_it() -> None:
    """The sum of 11 steps of 0.1 s is 1.0999999999999999; begun anew there, the next one must not stumble."""
    simulation = Simulation(cornered())
    for _ in range(11):
        simulation.step(0.1)
    assert sum([0.1] * 11) != 1.1 == simulation.time
    simulation.restore(simulation.snapshot())
    assert simulation.step(0.1).status is Status.COMPLETED


def test_driven_steps_that_add_up_to_a_corner_of_another_input() -> None:
    simulation = Simulation(cornered())
    for _ in range(11):
        simulation.step(0.1, payout_speed=0.0)
    simulation.restore(simulation.snapshot())
    seen = simulation.step(0.1, payout_speed=0.0)
    assert seen.status is Status.COMPLETED
    assert seen.deployed_length == pytest.approx(2.0)


@pytest.mark.parametrize("shift", [-1e-16, 1e-16, 1e-13, -1e-10, 1e-10])
def test_runs_with_samples_and_outputs_beside_corners(shift: float) -> None:
    """Samples of a controller and output times a rounding away from a jump and from each other."""
    corner = [[0, 0, 0, 0], [0.3, 0, 0.1, 0], [1.0, 0, 0.1, 0]]
    jump = [[0, 0, 0, 0], [0.3 + shift, 0, 0.0, 0], [0.3 + shift, 0, -0.1, 0]]
    base = scene(
        a=driven([0.0, 0, 0], corner),
        b=driven([1.5, 0, 0], jump),
        segments=20,
        duration=0.9 + shift,
        interval=0.1,
        skip=False,
    )
    control = Control(period=0.1, delay=0.1, make=lambda: ConstantLength(length=2.2, proportional=1.0))
    result = simulate(winched(base, 2.0, control))
    assert result.attrs["status"] == "completed"
    np.testing.assert_allclose(result.time, 0.1 * np.arange(10), atol=2e-10)
    np.testing.assert_allclose(result.position.values[3:, -1, 1], -0.1 * (result.time[3:] - 0.3), atol=5e-5)


def test_jump_beyond_the_end_of_the_case_is_met_by_steps() -> None:
    base = replace(cornered(), duration=0.4)
    simulation = Simulation(base)
    seen = simulation.step(1.0)
    assert seen.status is Status.COMPLETED
    assert base.end_b.motion is not None
    np.testing.assert_allclose(seen.position[-1], base.end_b.motion.position(1.0), atol=1e-5)


def test_steps_end_where_a_motion_is_no_longer_known() -> None:
    from cablesim.motion import harmonic
    from cablesim.scene import End

    swing = harmonic([1.5, 0, 0], [0, 0.1, 0], 1.0, duration=1.0, ramp=0.5)
    simulation = Simulation(scene(b=End(motion=swing), segments=20, duration=1.0, interval=0.1))
    for _ in range(10):
        assert simulation.step(0.1).status is Status.COMPLETED
    with pytest.raises(ValueError, match=r"known only up to 1 s, and the step ends at 1\.1 s"):
        simulation.step(0.1)
    assert simulation.step(0.1, velocity_b=[0.0, 0.0, 0.0]).status is Status.COMPLETED


def test_step_shorter_than_an_instant_is_refused() -> None:
    with pytest.raises(ValueError, match="above 1e-09"):
        Simulation(cornered()).step(1e-10)
