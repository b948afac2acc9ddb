"""Water that moves differently from place to place accelerates what is in it with dU/dt + (U.grad) U."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scenes import FREE, GriddedCurrent, ProfileCurrent, body, cable, held, scene, straight

from cablesim.scene import Attachment, Cable, Current, MarkerShape, StartVelocity
from cablesim.simulation import Simulation, simulate

RATE, OFF = 0.3, 0.5  # of v = 0.3 y, and where the cable starts [m]
NEUTRAL = 1000.0 * np.pi * 5e-3**2 / 4.0  # what a metre of the cable displaces [kg]
BALL = body(1.5, mass=0.2, volume=2e-4, added_mass=0.5)
LIGHT: dict[str, Any] = {"wet_weight": 0.0, "drag_normal": 0.0, "drag_tangential": 0.0}
FLOATING = cable(**LIGHT, mass_per_length=NEUTRAL)
ALONG_X = straight((0.0, OFF, 0.0), (1.0, 0.0, 0.0), 3.0)
Place = tuple[float, float, float]


def stretching(decay: float = 0.0) -> GriddedCurrent:
    """v = 0.3 y, or less by the second."""
    times = np.array([0.0, 10.0])
    velocities = np.zeros((2, 1, 2, 1, 3))
    velocities[:, 0, :, 0, 1] = RATE * np.outer([1.0, 1.0 - 10.0 * decay], [-1.0, 1.0])
    return GriddedCurrent(
        times=times, x=np.zeros(1), y=np.array([-1.0, 1.0]), z=np.zeros(1), velocities=velocities
    )


def drifting(
    rope: Cable, bodies: Sequence[Attachment], current: Current, start: MarkerShape, velocity: Place
) -> xr.Dataset:
    """Run of a cable without held ends that starts with one velocity."""
    begun = StartVelocity(arc=np.zeros(1), velocities=np.array([velocity]))
    return simulate(
        scene(
            rope=rope,
            a=FREE,
            b=FREE,
            initial=replace(start, velocity=begun),
            current=current,
            attachments=bodies,
            relative_tolerance=1e-8,
            max_order=5,
            duration=2.0,
            segments=6,
        )
    )


def test_neutral_cable_and_body_go_with_stretching_water() -> None:
    """dy/dt = 0.3 y."""
    result = drifting(FLOATING, [BALL], stretching(), ALONG_X, (0.0, RATE * OFF, 0.0))
    wanted = OFF * np.exp(RATE * result.time.values)[:, None] * np.ones(7)
    np.testing.assert_allclose(result.position.values[..., 1], wanted, rtol=1e-5)


def test_neutral_cable_and_body_go_with_stretching_water_that_slows_down() -> None:
    """dy/dt = 0.3 (1 - t/5) y."""
    result = drifting(FLOATING, [BALL], stretching(decay=0.2), ALONG_X, (0.0, RATE * OFF, 0.0))
    t = result.time.values
    wanted = OFF * np.exp(RATE * (t - 0.1 * t**2))[:, None] * np.ones(7)
    np.testing.assert_allclose(result.position.values[..., 1], wanted, rtol=1e-5)


@pytest.mark.parametrize("added", [0.0, 0.8])
@pytest.mark.parametrize("mass", [NEUTRAL, 0.055])
def test_stretching_water_takes_along_what_is_at_rest(mass: float, added: float) -> None:
    """Without drag: (m + Ca rho A) d2y/dt2 = rho A (1 + Ca) 0.3^2 y (Auton, Hunt and Prud'homme 1988)."""
    rope = cable(**LIGHT, mass_per_length=mass, added_mass_normal=added)
    result = drifting(rope, [], stretching(), ALONG_X, (0.0, 0.0, 0.0))
    rate = RATE * np.sqrt(NEUTRAL * (1.0 + added) / (mass + NEUTRAL * added))
    wanted = OFF * np.cosh(rate * result.time.values)[:, None] * np.ones(7)
    np.testing.assert_allclose(result.position.values[..., 1], wanted, rtol=1e-5)


def test_neutral_cable_and_body_rise_through_sheared_water() -> None:
    """u = 0.2 + 0.5 z while the water rises at 0.1 m/s: x'' = 0.05 m/s2."""
    heights = np.array([-5.0, 5.0])
    current = ProfileCurrent(
        heights=heights, velocities=np.stack([0.2 + 0.5 * heights, 0 * heights, 0.1 + 0 * heights], axis=1)
    )
    along_y = straight((0.0, 0.0, -0.3), (0.0, 1.0, 0.0), 3.0)
    result = drifting(FLOATING, [BALL], current, along_y, (0.05, 0.0, 0.1))
    t = result.time.values[:, None] * np.ones(7)
    np.testing.assert_allclose(result.position.values[..., 0], 0.05 * t + 0.025 * t**2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(result.position.values[..., 2], -0.3 + 0.1 * t, rtol=0, atol=1e-6)


def test_held_end_feels_the_push_of_steady_stretching_water() -> None:
    """On half a segment at rest: rho A (1 + Ca) 0.3^2 y."""
    case = scene(
        rope=FLOATING,
        a=held([0.0, OFF, 0.0]),
        b=held([3.0, OFF, 0.0]),
        initial=ALONG_X,
        current=stretching(),
        segments=6,
    )
    force = Simulation(case).present().end_force.values[0, :, 1]
    np.testing.assert_allclose(force, 0.25 * NEUTRAL * 2.0 * RATE**2 * OFF, rtol=1e-9)
