"""Where the winch can go no further: a driver stays there, and leaves the other way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import body
from test_winch import cycle, winched

from cablesim import Simulation, Status
from cablesim.mesh import SHORTEST
from cablesim.scene import Control, Scene

STILL = [[0, 0]]

LIMITS = {
    "drum empty": (cycle(payout=STILL, length=3.3), 0.4, Status.DRUM_EMPTY, 3.3),
    "minimum length": (
        winched(cycle(), 3.0, STILL, minimum_length=2.7),
        -0.4,
        Status.MINIMUM_LENGTH,
        2.7,
    ),
    "mesh": (cycle(payout=STILL, segment=1.35), -0.4, Status.MINIMUM_LENGTH, (1 + SHORTEST) * 1.35),
    "attachment at winch": (
        cycle(payout=STILL, attachments=[body(2.7, mass=0.1)]),
        -0.4,
        Status.ATTACHMENT_AT_WINCH,
        2.7 + SHORTEST * 0.05,
    ),
}


@pytest.fixture(params=LIMITS, ids=str)
def limit(request: pytest.FixtureRequest) -> tuple[Scene, float, Status, float]:
    return LIMITS[request.param]


def driven_to(base: Scene, speed: float) -> tuple[Simulation, Any]:
    """A simulation driven to its limit, and what it said there."""
    simulation = Simulation(base)
    for _ in range(40):
        seen = simulation.step(0.1, payout_speed=speed)
        if seen.status is not Status.COMPLETED:
            return simulation, seen
    raise AssertionError("no limit was met")


def test_driver_stays_at_the_limit(limit: tuple[Scene, float, Status, float]) -> None:
    base, speed, status, length = limit
    simulation, first = driven_to(base, speed)
    assert first.status is status
    for order in ({"payout_speed": speed}, {}, {"payout_speed": 2 * speed}, {"velocity_b": [0, 0, 0]}):
        seen = simulation.step(0.1, **order)
        assert (seen.status, seen.time) == (status, first.time)
        assert seen.deployed_length == pytest.approx(length, abs=1e-8)
        np.testing.assert_array_equal(seen.position, first.position)


def test_driver_leaves_the_limit_the_other_way(limit: tuple[Scene, float, Status, float]) -> None:
    base, speed, _, length = limit
    simulation, first = driven_to(base, speed)
    simulation.step(0.1, payout_speed=speed)
    seen = simulation.step(0.5, payout_speed=-speed)
    assert seen.status is Status.COMPLETED
    assert seen.time == pytest.approx(first.time + 0.5)
    assert seen.payout_speed == pytest.approx(-speed)
    assert seen.deployed_length == pytest.approx(length - 0.25 * speed, abs=1e-8)  # from rest
    assert np.isfinite(seen.tension).all()
    # and comes back to it
    again = [simulation.step(0.1, payout_speed=speed) for _ in range(30)]
    assert again[-1].status is first.status
    assert again[-1].deployed_length == pytest.approx(length, abs=1e-8)


def test_driver_may_rest_at_the_limit(limit: tuple[Scene, float, Status, float]) -> None:
    base, speed, status, length = limit
    simulation, first = driven_to(base, speed)
    resting = [simulation.step(0.1, payout_speed=0.0) for _ in range(3)]
    assert all(seen.status is Status.COMPLETED for seen in resting)
    assert resting[-1].time == pytest.approx(first.time + 0.3)
    assert resting[-1].deployed_length == pytest.approx(length, abs=1e-8)
    assert simulation.step(0.1, payout_speed=speed).status is status
    assert simulation.step(0.1, payout_speed=-speed).status is Status.COMPLETED


def test_moment_at_the_limit_comes_back(limit: tuple[Scene, float, Status, float]) -> None:
    base, speed, status, _ = limit
    simulation, first = driven_to(base, speed)
    moment = simulation.snapshot()
    simulation.step(0.5, payout_speed=-speed)
    simulation.restore(moment)
    seen = simulation.step(0.1)
    assert (seen.status, seen.time) == (status, first.time)
    assert simulation.step(0.1, payout_speed=-speed).status is Status.COMPLETED


def test_program_ends_at_the_limit_and_a_driver_takes_over() -> None:
    simulation = Simulation(cycle(payout=[[0, 0.4]], length=3.3))
    seen = [simulation.step(0.2) for _ in range(6)]
    assert {one.status for one in seen[4:]} == {Status.DRUM_EMPTY}
    assert seen[-1].time == seen[4].time == pytest.approx(0.75, abs=1e-6)
    assert simulation.run().attrs["status"] == "drum empty"
    assert simulation.step(0.2, payout_speed=-0.2).status is Status.COMPLETED


def test_controller_ends_at_the_limit() -> None:
    control = Control(period=0.05, delay=0.0, make=lambda: lambda measured: 0.4)
    simulation = Simulation(winched(cycle(length=3.3), 3.0, control))
    seen = [simulation.step(0.2) for _ in range(8)]
    assert {one.status for one in seen[5:]} == {Status.DRUM_EMPTY}
    assert seen[-1].deployed_length == pytest.approx(3.3, abs=1e-8)
    assert simulation.step(0.2, payout_speed=-0.2).status is Status.COMPLETED


@pytest.mark.parametrize("seed", range(3))
def test_no_cable_is_invented_by_any_orders(seed: int) -> None:
    """Wild orders between the minimum and the end of the drum."""
    draw = np.random.default_rng(seed)
    simulation = Simulation(
        winched(cycle(length=3.3, relative_tolerance=1e-4), 3.0, STILL, minimum_length=2.7)
    )
    met = set()
    for _ in range(60):
        seen = simulation.step(draw.uniform(0.05, 0.3), payout_speed=draw.uniform(-1.0, 1.0))
        assert 2.7 - 1e-8 <= seen.deployed_length <= 3.3 + 1e-8
        met.add(seen.status)
    assert met == {Status.COMPLETED, Status.MINIMUM_LENGTH, Status.DRUM_EMPTY}
