"""Motions against analytic integrals, independent integration and their own derivatives."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cablesim.motion import (
    Motion,
    fixed,
    harmonic,
    payout_waypoints,
    recorded,
    recorded_length,
    rov_heading,
    rov_waypoints,
    velocity_waypoints,
)
from cablesim.motion.recordings import refuse_overshoot

START = np.array([1.0, -2.0, -3.0])
OFFSET = np.array([-0.3, 0.1, 0.2])

# paper, Table IV, "Turn": time, surge, yaw
TURN = np.array(
    [
        [0, 0, 0],
        [1, 0.2, 0],
        [2, 0.2, 0],
        [3, 0.2, -0.4],
        [6, 0.2, -0.4],
        [7, 0.2, 0],
        [8, 0.2, 0],
        [10, 0, 0],
        [15, 0, 0],
    ]
)


def turn_rates():
    rates = np.zeros((len(TURN), 4))
    rates[:, 0], rates[:, 3] = TURN[:, 1], TURN[:, 2]
    return rates


def turned(angle, vector):
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ vector


def noisy_sine(noise=1e-3, seed=7):
    """Times, true positions, true velocities and noisy samples of a slow oscillation."""
    times = np.arange(0, 10, 0.03)
    amplitude, omega = np.array([0.5, 0.2, 0.1]), 2 * np.pi / 5
    truth = np.sin(omega * times)[:, None] * amplitude
    velocity = omega * np.cos(omega * times)[:, None] * amplitude
    samples = truth + noise * np.random.default_rng(seed).standard_normal(truth.shape)
    return times, truth, velocity, samples


def every_motion():
    times, _, _, samples = noisy_sine()
    return {
        "fixed": fixed(START),
        "velocity": velocity_waypoints(START, [0, 2, 2, 5], [[0, 0, 0], [1, 0, 2], [0, 1, 0], [0, 0, 0]]),
        "rov": rov_waypoints(START, 0.3, TURN[:, 0], turn_rates(), OFFSET),
        "harmonic": harmonic(START, [0.1, 0, 0.5], 4.0, duration=12.0, phase=0.4, ramp=3.0),
        "recorded": recorded(times, samples, 1e-3),
    }


@pytest.fixture(params=["fixed", "velocity", "rov", "harmonic", "recorded"])
def motion(request):
    return every_motion()[request.param]


def test_fixed_point_stays():
    motion = fixed(START)
    np.testing.assert_array_equal(motion.position([0.0, 1.0, 1e12]), np.tile(START, (3, 1)))
    assert not motion.velocity(3.0).any()
    assert motion.speed_limit(10.0) == 0.0
    assert motion.end_time == math.inf


def test_ramp_integrates_to_half_its_area():
    motion = velocity_waypoints(START, [0, 2, 4, 6], [[0, 0, 0], [0.2, 0, 0], [0.2, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(motion.position(2.0) - START, [0.2, 0, 0], atol=1e-15)
    np.testing.assert_allclose(motion.position(1.0) - START, [0.05, 0, 0], atol=1e-15)
    np.testing.assert_allclose(motion.position(6.0) - START, [0.8, 0, 0], atol=1e-15)
    np.testing.assert_array_equal(motion.corners, [2.0, 4.0, 6.0])
    assert motion.jumps.size == 0


def test_velocity_is_held_after_the_last_waypoint():
    motion = velocity_waypoints(START, [0, 1], [[0, 0, 0], [0, 0.5, 0]])
    np.testing.assert_allclose(motion.position(101.0) - START, [0, 50.25, 0], rtol=1e-13)
    np.testing.assert_array_equal(motion.velocity(1e12), [0, 0.5, 0])


def test_position_is_given_at_zero_when_waypoints_begin_earlier():
    motion = velocity_waypoints(START, [-2, 2], [[0, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(motion.position(0.0), START, atol=1e-15)
    np.testing.assert_allclose(motion.velocity(0.0), [0.5, 0, 0], atol=1e-15)


def test_equal_times_make_a_right_continuous_jump():
    motion = velocity_waypoints(START, [0, 2, 2, 5], [[1, 0, 0], [1, 0, 0], [0, 2, 0], [0, 2, 0]])
    np.testing.assert_array_equal(motion.jumps, [2.0])
    assert motion.corners.size == 0
    np.testing.assert_array_equal(motion.velocity(2.0), [0, 2, 0])
    np.testing.assert_array_equal(motion.velocity(np.nextafter(2.0, 0.0)), [1, 0, 0])
    np.testing.assert_allclose(motion.position(2.0), START + np.array([2.0, 0, 0]))


def test_equal_times_without_a_change_are_neither_jump_nor_corner():
    motion = velocity_waypoints(START, [0, 1, 2, 2, 3], [[1, 0, 0]] * 5)
    assert motion.jumps.size == 0
    assert motion.corners.size == 0


def test_a_jump_at_the_start_is_not_an_event():
    motion = velocity_waypoints(START, [0, 0, 1], [[0, 0, 0], [1, 0, 0], [1, 0, 0]])
    assert motion.jumps.size == 0
    np.testing.assert_array_equal(motion.velocity(0.0), [1, 0, 0])


def test_constant_surge_and_yaw_is_a_circle():
    surge, yaw, heading = 0.5, 0.25, 0.7
    motion = rov_waypoints(START, heading, [0, 30], [[surge, 0, 0, yaw]] * 2)
    times = np.linspace(0, 30, 2001)
    angle = heading + yaw * times
    circle = np.stack([np.sin(angle) - np.sin(heading), np.cos(heading) - np.cos(angle), 0 * angle], axis=1)
    assert np.abs(motion.position(times) - START - surge / yaw * circle).max() < 1e-9
    assert np.linalg.norm(motion.velocity(times), axis=1) == pytest.approx(surge, abs=1e-8)
    assert np.linalg.norm(motion.acceleration(times), axis=1) == pytest.approx(surge * yaw, abs=1e-6)
    assert len(motion.coefficients) < 100
    assert motion.corners.size == 0


def test_yaw_about_the_reference_moves_the_attachment_on_its_own_circle():
    motion = rov_waypoints(START, 0.0, [0, 20], [[0, 0, 0, -0.3]] * 2, OFFSET)
    reference = START - OFFSET
    for t in np.linspace(0, 20, 37):
        expected = reference + turned(-0.3 * t, OFFSET)
        np.testing.assert_allclose(motion.position(t), expected, atol=1e-9)


def test_turn_of_the_paper_agrees_with_independent_integration():
    motion = rov_waypoints(START, 0.3, TURN[:, 0], turn_rates(), OFFSET)
    heading = rov_heading(0.3, TURN[:, 0], TURN[:, 2])

    def slope(t, state):
        forward = turned(state[3], [np.interp(t, TURN[:, 0], TURN[:, 1]), 0, 0])
        return np.append(forward, np.interp(t, TURN[:, 0], TURN[:, 2]))

    state = np.append(START - turned(0.3, OFFSET), 0.3)
    for begin, end in zip(TURN[:-1, 0], TURN[1:, 0], strict=True):
        times = np.linspace(begin, end, 41)
        solution = solve_ivp(
            slope, (begin, end), state, method="DOP853", rtol=1e-13, atol=1e-13, dense_output=True
        )
        states = solution.sol(times).T
        attached = [row[:3] + turned(row[3], OFFSET) for row in states]
        assert np.abs(motion.position(times) - attached).max() < 1e-9
        assert np.abs(heading(times) - states[:, 3]).max() < 1e-12
        state = solution.y[:, -1]


def test_only_real_corners_of_the_paper_s_turn_count():
    at_reference = rov_waypoints(START, 0.3, TURN[:, 0], turn_rates())
    # a kink of the yaw rate alone leaves the acceleration of the reference point continuous
    np.testing.assert_array_equal(at_reference.corners, [1.0, 8.0, 10.0])
    beside = rov_waypoints(START, 0.3, TURN[:, 0], turn_rates(), OFFSET)
    np.testing.assert_array_equal(beside.corners, [1, 2, 3, 6, 7, 8, 10])
    assert beside.jumps.size == 0


def test_a_jump_of_the_yaw_rate_jumps_the_velocity_only_away_from_the_reference():
    times, rates = [0, 2, 2, 4, 4], np.zeros((5, 4))
    rates[:, 0] = 0.3
    rates[2:4, 3] = 0.2
    at_reference = rov_waypoints(START, 0.0, times, rates)
    assert at_reference.jumps.size == 0
    np.testing.assert_array_equal(at_reference.corners, [2.0, 4.0])
    np.testing.assert_array_equal(rov_waypoints(START, 0.0, times, rates, OFFSET).jumps, [2.0, 4.0])


def test_straight_rov_motion_is_an_exact_polynomial():
    rates = [[0, 0, 0, 0], [0.2, 0.1, -0.1, 0], [0, 0, 0, 0]]
    motion = rov_waypoints(START, 0.6, [0, 2, 4], rates, OFFSET)
    assert len(motion.coefficients) == 3
    forward = turned(0.6, np.array([0.2, 0.1, -0.1]))
    np.testing.assert_allclose(motion.position(4.0) - START, 2 * forward, atol=1e-14)


def test_a_vehicle_that_still_yaws_ends_with_its_last_waypoint():
    motion = rov_waypoints(START, 0.0, [0, 5], [[0.1, 0, 0, 0.2]] * 2)
    assert motion.end_time == 5.0
    with pytest.raises(ValueError, match=r"asked at t = 6 s.*0 to 5 s"):
        motion.position([1.0, 6.0])


def test_heading_is_a_continuous_angle():
    heading = rov_heading(1.0, [-1, 0, 2, 2, 3], [0.5, 0.5, 0.5, -1.0, -1.0])
    assert float(heading(0.0)) == pytest.approx(1.0)
    assert float(heading(2.0)) == pytest.approx(2.0)
    assert float(heading(5.0)) == pytest.approx(-1.0)
    np.testing.assert_allclose(heading([0.0, 1.0]), [1.0, 1.5])


@pytest.mark.parametrize("ramp", [0.0, 0.05, 3.0, 20.0])
def test_harmonic_agrees_with_its_formula(ramp):
    stroke, period, phase = np.array([0.1, 0, 0.5]), 4.0, 0.4
    motion = harmonic(START, stroke, period, duration=12.0, phase=phase, ramp=ramp)
    times = np.linspace(0, 12, 3001)
    x = np.ones_like(times) if ramp == 0 else np.minimum(times / ramp, 1.0)
    wave = np.sin(2 * np.pi * times / period + phase) * (10 * x**3 - 15 * x**4 + 6 * x**5)
    error = motion.position(times) - START - wave[:, None] * stroke
    assert np.abs(error).max() < 1e-9 * 0.5 + 1e-15
    assert motion.end_time == 12.0
    assert motion.corners.size == motion.jumps.size == 0


def test_harmonic_speed_limit_is_the_amplitude_of_the_velocity():
    motion = harmonic(START, [0, 0, 0.5], 4.0, duration=12.0)
    assert motion.speed_limit(12.0) == pytest.approx(0.5 * 2 * np.pi / 4, rel=1e-4)


def test_speed_limit_counts_both_sides_of_a_jump_and_only_the_duration():
    motion = velocity_waypoints(START, [0, 2, 2, 9], [[0, 0, 0], [3, 0, 0], [0, 0, 0], [9, 0, 0]])
    assert motion.speed_limit(2.0) == pytest.approx(3.0)
    assert motion.speed_limit(1.0) == pytest.approx(1.5)
    assert motion.speed_limit(0.0) == 0.0
    assert motion.speed_limit(1e3) == pytest.approx(9.0)


def test_interpolation_passes_through_the_samples():
    times, _, _, samples = noisy_sine()
    motion = recorded(times, samples, 0.0)
    np.testing.assert_allclose(motion.position(times), samples, atol=1e-13)


def test_a_quintic_is_recovered_from_uneven_samples():
    times = np.sort(np.random.default_rng(1).uniform(0, 2, 40))
    polynomial = np.polynomial.Polynomial([0.1, -0.3, 0.5, 0.2, -0.4, 0.1])
    samples = np.stack([polynomial(times)] * 3, axis=1)
    motion = recorded(times, samples, 0.0, start=float(times[3]))
    t = times[3:-3] - times[3]
    np.testing.assert_allclose(motion.velocity(t)[:, 1], polynomial.deriv()(times[3:-3]), atol=1e-9)


def test_smoothing_leaves_the_noise_level_and_improves_the_velocity():
    times, _, velocity, samples = noisy_sine(noise=1e-3)
    smooth, rough = recorded(times, samples, 1e-3), recorded(times, samples, 0.0)
    residual = np.sqrt(np.mean((smooth.position(times) - samples) ** 2, axis=0))
    np.testing.assert_allclose(residual, 1e-3, rtol=2e-3)  # FITPACK stops within 1e-3 of the sum of squares
    errors = [np.sqrt(np.mean((m.velocity(times) - velocity) ** 2)) for m in (smooth, rough)]
    assert errors[0] < 0.1 * errors[1]
    assert len(smooth.coefficients) < len(times) / 5


def test_a_spline_that_swings_between_the_samples_is_refused():
    # samples where a wave passes through zero say nothing of the wave in between
    wave = harmonic([0, 0, 0], [0, 0, 5.0], 0.2, duration=2.0)
    times = np.arange(20) * 0.1
    samples = np.zeros((20, 3))
    with pytest.raises(
        ValueError, match=r"strays by 3\.54 m between the samples 0 and 1; give the real noise"
    ):
        refuse_overshoot(wave, times, samples, 1e-3)
    refuse_overshoot(fixed([0, 0, 0]), times, samples, 1e-3)


def test_start_shifts_the_recording():
    times, _, _, samples = noisy_sine()
    whole, later = recorded(times, samples, 1e-3), recorded(times + 36.8, samples, 1e-3, start=39.8)
    t = np.linspace(0, 5, 11)
    np.testing.assert_allclose(later.position(t), whole.position(t + 3.0), atol=1e-9)
    assert later.end_time == pytest.approx(times[-1] - 3.0)


def test_a_recording_is_not_continued():
    times, _, _, samples = noisy_sine()
    motion = recorded(times, samples, 1e-3)
    motion.position(motion.end_time)
    with pytest.raises(ValueError, match="shorten the simulation"):
        motion.velocity(motion.end_time + 0.1)
    with pytest.raises(ValueError, match="known only from 0"):
        motion.position(-0.1)


def test_shapes_follow_the_times(motion):
    assert motion.position(1.0).shape == (3,)
    assert motion.velocity([1.0, 2.0]).shape == (2, 3)
    assert motion.acceleration(np.array([1.0])).shape == (1, 3)
    np.testing.assert_array_equal(motion.position([0.5, 1.5])[1], motion.position(1.5))


def test_tables_suit_a_compiled_kernel(motion):
    assert motion.coefficients.dtype == motion.breaks.dtype == np.float64
    assert motion.coefficients.flags.c_contiguous
    assert motion.coefficients.shape == (motion.breaks.size - 1, 6, 3)
    assert motion.breaks[0] <= 0


def test_derivatives_agree_with_differences(motion):
    h = 1e-4
    events = np.concatenate([motion.corners, motion.jumps])
    times = np.linspace(0.01, 9.5, 203)
    times = times[[bool(np.all(np.abs(events - t) > 2 * h)) for t in times]]
    velocity = (motion.position(times + h) - motion.position(times - h)) / (2 * h)
    acceleration = (motion.velocity(times + h) - motion.velocity(times - h)) / (2 * h)
    np.testing.assert_allclose(motion.velocity(times), velocity, atol=1e-6)
    np.testing.assert_allclose(motion.acceleration(times), acceleration, atol=1e-5)


def test_continuity_away_from_events(motion):
    inner = motion.breaks[1:-1]
    before = np.nextafter(inner, -np.inf)
    np.testing.assert_allclose(motion.position(before), motion.position(inner), atol=1e-12)
    smooth = ~np.isin(inner, motion.jumps)
    np.testing.assert_allclose(motion.velocity(before[smooth]), motion.velocity(inner[smooth]), atol=1e-11)
    smooth &= ~np.isin(inner, motion.corners)
    np.testing.assert_allclose(
        motion.acceleration(before[smooth]), motion.acceleration(inner[smooth]), atol=1e-8
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fixed([1, 2]), r"fixed: position has shape \(2,\).*give three numbers"),
        (lambda: fixed([1, 2, math.nan]), r"position\[2\] is nan; give a finite number"),
        (
            lambda: velocity_waypoints(START, [1, 2], np.zeros((2, 3))),
            r"times\[0\] is 1 s; add a waypoint at 0",
        ),
        (
            lambda: velocity_waypoints(START, [0, 2, 1], np.zeros((3, 3))),
            r"times\[2\] is 1 s after 2 s; sort",
        ),
        (
            lambda: velocity_waypoints(START, [0, 1, 1, 1], np.zeros((4, 3))),
            r"times\[3\] is 1 s for the third",
        ),
        (
            lambda: velocity_waypoints(START, [0, 1], np.zeros((3, 3))),
            r"velocities has shape \(3, 3\); give \(2, 3\)",
        ),
        (lambda: velocity_waypoints(START, [], np.zeros((0, 3))), "at least one waypoint"),
        (
            lambda: rov_waypoints(START, 0.0, [0, 1], np.zeros((2, 3))),
            r"rates has shape \(2, 3\); give \(2, 4\)",
        ),
        (lambda: rov_waypoints(START, math.inf, [0, 1], np.zeros((2, 4))), "heading is inf"),
        (lambda: rov_waypoints(START, 0.0, [0], [[0, 0, 0, 1]]), "turn the vehicle for ever"),
        (lambda: rov_waypoints(START, 0.0, [0, 1e6], [[1, 0, 0, 1]] * 2), "more than 100000 pieces"),
        (lambda: harmonic(START, [0, 0, 1], 0.0, duration=1.0), "period is 0.0 s; give a positive time"),
        (lambda: harmonic(START, [0, 0, 1], 1.0, duration=-1.0), "duration is -1.0 s"),
        (lambda: harmonic(START, [0, 0, 1], 1.0, duration=1.0, ramp=-1.0), "ramp is -1.0 s"),
        (lambda: recorded(range(5), np.zeros((5, 3)), 0.0), r"shape \(5,\); give at least 6 samples"),
        (lambda: recorded([0, 1, 2, 2, 4, 5], np.zeros((6, 3)), 0.0), r"times\[3\] is 2 s after 2 s"),
        (lambda: recorded(range(6), np.full((6, 3), np.nan), 0.0), r"positions\[0, 0\] is nan"),
        (lambda: recorded(range(6), np.zeros((6, 3)), -1.0), "noise_level is -1.0 m"),
        (lambda: recorded(range(6), np.zeros((6, 3)), 0.0, start=7.0), "start is 7 s.*from 0 to 5 s"),
        (lambda: fixed(START).speed_limit(math.inf), "duration is inf s"),
        (lambda: Motion(breaks=np.array([1.0, 2]), coefficients=np.zeros((1, 6, 3))), "not be after t = 0"),
        (lambda: Motion(breaks=np.array([0.0, 2]), coefficients=np.zeros((2, 6, 3))), r"give \(m\+1,\)"),
    ],
)
def test_bad_input_is_refused_with_place_and_remedy(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_recording_that_does_not_move_stays_where_it_is() -> None:
    place = np.array([1.3, 2.7, -11.1])
    motion = recorded(np.arange(0.0, 3.0, 0.03), np.tile(place, (100, 1)), 0.0)
    found = motion.position(np.linspace(0.0, 2.9, 50))
    np.testing.assert_allclose(found, np.tile(place, (50, 1)), atol=1e-12)


# Deployed length --------------------------------------------------------------------------------


def test_payout_integrates_its_speeds() -> None:
    program = payout_waypoints(3.0, [0, 0.5, 2.0, 3.0], [0, 0.25, 0.25, -0.15])
    assert program.coefficients.shape == (4, 6, 1)
    assert program.coefficients.flags.c_contiguous
    found = program.position([0.0, 0.5, 2.0, 3.0, 4.0])
    assert found.shape == (5, 1)
    np.testing.assert_allclose(found[:, 0], 3.0 + np.array([0, 0.0625, 0.4375, 0.4875, 0.3375]), atol=1e-14)
    np.testing.assert_allclose(program.velocity([0.25, 1.0, 10.0])[:, 0], [0.125, 0.25, -0.15])
    np.testing.assert_array_equal(program.corners, [0.5, 2.0, 3.0])
    assert program.jumps.size == 0
    assert program.end_time == math.inf
    assert program.speed_limit(10.0) == pytest.approx(0.25)


def test_payout_jumps_between_two_waypoints_at_one_time() -> None:
    program = payout_waypoints(3.0, [0, 2, 2], [0.1, 0.1, -0.2])
    np.testing.assert_array_equal(program.jumps, [2.0])
    np.testing.assert_allclose(program.velocity([np.nextafter(2.0, 0.0), 2.0])[:, 0], [0.1, -0.2])
    np.testing.assert_allclose(program.position([2.0, 4.0])[:, 0], [3.2, 2.8])


def test_payout_begins_with_the_length_though_its_waypoints_begin_earlier() -> None:
    program = payout_waypoints(3.0, [-2, 0, 2], [0.5, 0.1, 0.1])
    np.testing.assert_allclose(program.position([0.0, 1.0])[:, 0], [3.0, 3.1])


def test_recorded_length_is_smoothed_like_a_position() -> None:
    times, truth, velocity, samples = noisy_sine(noise=1e-3)
    program = recorded_length(times, 3.0 + samples[:, 0], 1e-3)
    assert program.coefficients.shape[1:] == (6, 1)
    whole = recorded(times, samples, 1e-3)
    t = np.linspace(0.5, 9.0, 40)
    np.testing.assert_allclose(program.velocity(t)[:, 0], whole.velocity(t)[:, 0], atol=2e-3)
    assert np.sqrt(np.mean((program.position(times)[:, 0] - 3.0 - truth[:, 0]) ** 2)) < 1e-3
    assert np.sqrt(np.mean((program.velocity(times)[:, 0] - velocity[:, 0]) ** 2)) < 0.02
    assert program.end_time == times[-1]
    exact = recorded_length(times + 5.0, samples[:, 0], 0.0, start=float(times[10]) + 5.0)
    np.testing.assert_allclose(exact.position(times[10:] - times[10])[:, 0], samples[10:, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: payout_waypoints(3.0, [1, 2], [0, 0]), r"times\[0\] is 1 s; add a waypoint at 0"),
        (lambda: payout_waypoints(3.0, [0, 2, 1], [0, 0, 0]), r"times\[2\] is 1 s after 2 s; sort"),
        (lambda: payout_waypoints(3.0, [0, 1], [0, 0, 0]), r"speeds has shape \(3, 1\); give \(2, 1\)"),
        (lambda: payout_waypoints(3.0, [0, 1], [0, math.nan]), r"speeds\[1, 0\] is nan"),
        (lambda: payout_waypoints(math.inf, [0, 1], [0, 0]), r"position\[0\] is inf"),
        (lambda: recorded_length(range(5), np.zeros(5), 0.0), "give at least 6 samples"),
        (lambda: recorded_length(range(6), np.zeros(7), 0.0), r"lengths has shape \(7, 1\); give \(6, 1\)"),
        (lambda: recorded_length(range(6), np.zeros(6), 0.0, start=9.0), "start is 9 s"),
    ],
)
def test_bad_programs_are_refused_with_place_and_remedy(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()
