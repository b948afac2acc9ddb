"""What sensors read, against motions known in closed form, real runs, and the data sheet's statistics."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from runs import result
from scenes import FREE, G, TautShape, body, cable, scene
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from shapes import dataset as make_dataset
from shapes import helix, pendulum, resting, turning
from v_system import V_REST, winch_run

import cablesim
from cablesim.scene import Imu
from cablesim.sensors import (
    BMX160,
    AxisErrors,
    ImuErrors,
    OrientationErrors,
    SensorError,
    add_errors,
    calibrated,
    export_imu_csv,
    imu_signals,
    read_imu_csv,
)
from cablesim.sensors.interpolation import follow_points, read_nodes
from cablesim.trajectory.basis import local_basis

S = np.linspace(0.0, 2.0, 41)
TIMES = np.linspace(0.0, 3.0, 601)
PLACES = {"low": 0.31, "middle": 1.0, "high": 1.777}
FIELD = np.array([2e-5, 1e-5, -4e-5])


def signals(data, imus=PLACES, **options):
    return imu_signals(data, imus, gravity=G, magnetic_field=FIELD, **options)


def frames(read):
    """Rotations from sensor to world, flat over time and sensors."""
    return Rotation.from_quat(read.orientation.values.reshape(-1, 4))


def in_world(read, name):
    return frames(read).apply(read[name].values.reshape(-1, 3)).reshape(read[name].shape)


def tangents(read):
    return frames(read).apply([1.0, 0.0, 0.0]).reshape(*read.angular_velocity.shape)


# Exact motions ----------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["transported", "paper"])
@pytest.mark.parametrize("rate", [100.0, 73.0])
def test_rigid_pendulum(frame, rate):
    data, *_ = pendulum(TIMES, S)
    read = signals(data, rate=rate, frame=frame)
    _, angle, turn, second = pendulum(read.time.values, S)
    out, up = np.array([np.cos(0.3), np.sin(0.3), 0.0]), np.array([0.0, 0.0, 1.0])
    tangent = np.sin(angle)[:, None] * out - np.cos(angle)[:, None] * up
    across = np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * up
    np.testing.assert_allclose(tangents(read), np.tile(tangent[:, None], (1, 3, 1)), atol=1e-6)
    if frame == "transported":  # a plane motion turns about the normal of its plane only
        omega = turn[:, None] * np.cross(tangent, across)
        np.testing.assert_allclose(
            in_world(read, "angular_velocity"), np.tile(omega[:, None], (1, 3, 1)), atol=1e-6
        )
    s = read.s.values[None, :, None]
    inertial = s * (second[:, None] * across - (turn**2)[:, None] * tangent)[:, None] + G * up
    np.testing.assert_allclose(in_world(read, "specific_force"), inertial, atol=1e-6)
    along = -(turn**2)[:, None] * read.s.values - G * np.cos(angle)[:, None]
    np.testing.assert_allclose(read.specific_force.sel(axis="x"), along, atol=1e-6)
    np.testing.assert_allclose(
        in_world(read, "magnetic_field"), np.broadcast_to(FIELD, read.magnetic_field.shape)
    )


def test_rigid_curve_that_turns_has_the_spin_of_a_frame_without_twist():
    """omega = Omega - (Omega . t_b) t: nothing about the tangent at end B, one twist-free rod elsewhere."""
    spin = np.array([0.4, -0.7, 1.1])
    shape = helix()
    data = turning(TIMES, S, shape, spin)
    read = signals(data)
    tangent = tangents(read)
    turn = Rotation.from_rotvec(read.time.values[:, None] * spin)
    last = turn.apply((shape(S)[-1] - shape(S)[-2]) / np.linalg.norm(shape(S)[-1] - shape(S)[-2]))
    expected = spin - (last @ spin)[:, None, None] * tangent
    np.testing.assert_allclose(in_world(read, "angular_velocity"), expected, atol=1e-6)
    place = np.stack(
        [turn.apply(point) for point in follow_points(read_nodes(data), read.s).place[0, :, 0].T], 1
    )
    centripetal = np.cross(spin, np.cross(spin, place)) + np.array([0.0, 0.0, G])
    np.testing.assert_allclose(in_world(read, "specific_force"), centripetal, atol=1e-5)


@pytest.mark.parametrize("reference", ["a", "b", 1.0])
def test_neighbouring_frames_differ_by_the_smallest_rotation(reference):
    data = turning(TIMES, S, helix(), [0.4, -0.7, 1.1])
    middles = data.s_segment.values
    read = signals(data, {str(k): s for k, s in enumerate(middles)}, rate=10.0, reference=reference)
    q = Rotation.from_quat(read.orientation.values[17])
    t = q.apply([1.0, 0.0, 0.0])
    for k in range(len(middles) - 1):
        step = (q[k + 1] * q[k].inv()).as_rotvec()
        assert step @ t[k] == pytest.approx(0.0, abs=2e-5)  # of a curvature of 1/m over 5 cm
        assert np.linalg.norm(step) == pytest.approx(np.arccos(t[k] @ t[k + 1]), abs=1e-6)


def test_frame_on_a_cone_turns_by_the_solid_angle():
    """After a round of a cone of half-angle 0.6 a transported frame lags by its solid angle."""
    half = 0.6
    direction = np.array([np.sin(half), 0.0, np.cos(half)])
    data = turning(np.linspace(0.0, 2 * np.pi, 201), S, lambda s: s[:, None] * direction, [0.0, 0.0, 1.0])
    q = Rotation.from_quat(signals(data, rate=1000.0 / (2 * np.pi)).orientation.values[[0, -1], 0])
    gained = (q[0].inv() * q[1]).as_rotvec()
    solid = 2 * np.pi * (1.0 - np.cos(half))
    np.testing.assert_allclose(gained, [solid, 0.0, 0.0], atol=1e-6)


def test_integrated_gyroscope_returns_the_orientation_of_exact_motion():
    read = signals(turning(TIMES, S, helix(), [0.4, -0.7, 1.1]), rate=400.0)
    assert np.all(gyroscope_drift(read) < 1e-3)


def gyroscope_drift(read):
    """Angle [deg] between the last orientation and the integral of the angular rate, for each sensor."""
    step = np.diff(read.time.values)[:, None]
    drift = []
    for name in read.imu.values:
        rate = read.angular_velocity.sel(imu=name).values
        q = Rotation.from_quat(read.orientation.sel(imu=name).values)
        integral = q[0]
        for turn in Rotation.from_rotvec(0.5 * (rate[1:] + rate[:-1]) * step):
            integral = integral * turn
        drift.append(np.degrees((integral.inv() * q[-1]).magnitude()))
    return np.array(drift)


# Conventions ------------------------------------------------------------------------------------


def test_paper_frame_has_the_papers_basis_and_angles():
    data = turning(TIMES, S, helix(), [0.4, -0.7, 1.1])
    read = signals(data, frame="paper", rate=50.0)
    matrices = frames(read).as_matrix()
    t = matrices[..., 0]
    normal, binormal = local_basis(t)
    np.testing.assert_allclose(matrices[..., 1], normal, atol=1e-12)
    np.testing.assert_allclose(matrices[..., 2], binormal, atol=1e-12)
    theta, phi = -np.arcsin(t[:, 1]), np.arctan2(-t[:, 2], t[:, 0])
    euler = Rotation.from_euler("YZX", np.stack((phi, -theta, np.full_like(phi, -np.pi / 2)), axis=1))
    assert (euler.inv() * frames(read)).magnitude().max() < 1e-7
    assert np.all(gyroscope_drift(signals(data, frame="paper", rate=400.0)) < 1e-2)


def test_quaternions_have_the_scalar_last_and_no_jumps():
    read = signals(turning(np.linspace(0.0, 30.0, 3001), S, helix(), [0.4, -0.7, 1.1]))
    q = read.orientation.values
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-12)
    assert np.einsum("tmc,tmc->tm", q[1:], q[:-1]).min() > 0.99
    assert list(read.component.values) == ["x", "y", "z", "w"]


def test_straight_cable_along_x_carries_the_identity_turned_to_the_papers_normal():
    for name in ("transported", "paper"):
        read = signals(resting(S, S[:, None] * [1.0, 0.0, 0.0]), frame=name)
        matrix = Rotation.from_quat(read.orientation.values[0, 0]).as_matrix()
        np.testing.assert_allclose(matrix, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)


def test_mounting_turns_the_sensor_in_the_cables_frame():
    mounting = Rotation.from_rotvec([0.3, -0.5, 0.2])
    data = turning(TIMES, S, helix(), [0.4, -0.7, 1.1])
    plain = signals(data, [Imu(name="m", position=0.8, mounting=np.array([0, 0, 0, 1.0]))])
    turned = signals(data, [Imu(name="m", position=0.8, mounting=mounting.as_quat())])
    for name in ("angular_velocity", "specific_force", "magnetic_field"):
        expected = mounting.inv().apply(plain[name].values[:, 0])
        np.testing.assert_allclose(turned[name].values[:, 0], expected, atol=1e-12)
    assert (frames(plain) * mounting * frames(turned).inv()).magnitude().max() < 1e-7
    np.testing.assert_allclose(turned.mounting.values[0], mounting.as_quat())


def test_units_frames_and_settings_are_said():
    read = signals(resting(S, S[:, None] * [1.0, 0.0, 0.0]))
    assert all({"units", "long_name"} <= set(variable.attrs) for variable in read.data_vars.values())
    assert read.attrs["frame"] == "transported"
    assert read.attrs["errors"] == "none"
    np.testing.assert_allclose(read.s.values, list(PLACES.values()))


# Interpolation ----------------------------------------------------------------------------------


def order(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_position_is_of_third_and_tangent_of_second_order_along_the_cable():
    shape, points = helix(), np.linspace(0.37, 1.63, 50)
    stretch = np.hypot(0.4, 0.5)
    turn = points / stretch
    exact = np.stack((-0.4 * np.sin(turn), 0.4 * np.cos(turn), np.full_like(turn, 0.5)), axis=-1) / stretch
    place, tangent = [], []
    for segments in (40, 80, 160):
        s = 2.0 * (
            np.linspace(0.0, 1.0, segments + 1) + 0.02 * np.sin(6 * np.linspace(0.0, 1.0, segments + 1))
        )
        s[-1] = 2.0
        found = follow_points(read_nodes(resting(s, shape(s))), points)
        place.append(np.abs(found.place[0, :, 0].T - shape(points)).max())
        tangent.append(np.abs(found.gradient[0, :, 0].T - exact).max())
    assert np.all(order(place) > 2.8)
    assert np.all(order(tangent) > 1.9)


def test_tangent_is_continuous_through_nodes():
    data = resting(S, helix()(S))
    left, at, right = follow_points(read_nodes(data), [S[7] - 1e-9, S[7], S[7] + 1e-9]).gradient[0, :, 0].T
    np.testing.assert_allclose(left, at, atol=1e-7)
    np.testing.assert_allclose(right, at, atol=1e-7)
    np.testing.assert_allclose(at, (data.position.values[0, 8] - data.position.values[0, 6]) / (S[8] - S[6]))


@pytest.mark.parametrize(
    ("name", "lowest"), [("orientation", 5.5), ("angular_velocity", 3.7), ("specific_force", 2.8)]
)
def test_order_in_time(name, lowest):
    """Orientation of sixth, angular rate of fourth, acceleration of third order in the output interval."""
    errors = []
    for count in (16, 31, 61):
        data = pendulum(np.linspace(0.0, 3.0, count), S)[0]
        exact = signals(pendulum(np.linspace(0.0, 3.0, 3001), S)[0], rate=97.0)
        errors.append(np.abs(signals(data, rate=97.0)[name].values - exact[name].values).max())
    assert np.all(order(errors) > lowest)


def test_stored_accelerations_are_read_as_they_are_at_the_stored_times():
    data = pendulum(np.linspace(0.0, 3.0, 31), S)[0]
    read = signals(data, {"node": S[20]}, rate=10.0)
    force = in_world(read, "specific_force")[:, 0] - [0.0, 0.0, G]
    np.testing.assert_allclose(force, data.acceleration.values[:, 20], atol=1e-9)


def test_single_state_is_a_reading_at_rest():
    read = signals(resting(S, helix()(S), times=[0.0]))
    assert read.sizes["time"] == 1
    np.testing.assert_allclose(in_world(read, "specific_force")[0], [[0.0, 0.0, G]] * 3, atol=1e-12)
    np.testing.assert_array_equal(read.angular_velocity, 0.0)


# Real runs --------------------------------------------------------------------------------------


def test_at_rest_the_specific_force_is_g_up():
    """A statics result: no velocity, no acceleration, whatever the shape."""
    rest = cablesim.Simulation(scene(segments=40))
    seen = rest.observe()
    data = resting(rest.mesh.nodes, seen.position)
    read = signals(data)
    np.testing.assert_allclose(in_world(read, "specific_force") - [0.0, 0.0, G], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(read.specific_force, axis=-1), G, atol=1e-9)


@pytest.mark.parametrize("frame", ["transported", "paper"])
@pytest.mark.parametrize("kind", ["buoys", "sway"])
def test_integrated_gyroscope_returns_the_orientation_of_a_run(kind, frame):
    data = result(kind)
    length = float(data.s[-1])
    read = imu_signals(data, {f"at {k}": k * length for k in (0.2, 0.5, 0.8)}, rate=100.0, frame=frame)
    assert np.all(gyroscope_drift(read) < 0.1)


def test_stiff_taut_rope_in_vacuum_is_a_pendulum():
    """A heavy body on a light stiff rope, let go at 45 degrees: theta'' = -g sin(theta) / L."""
    rope = cable(density=0.0, mass_per_length=1e-5, length=1.0, axial_stiffness=1e6, displaced_section=0.0)
    released = scene(
        rope=rope,
        b=FREE,
        segments=8,
        attachments=[body(1.0, mass=1.0)],
        density=0.0,
        initial=TautShape(direction=np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)),
        duration=2.0,
        interval=0.01,
        relative_tolerance=1e-7,
    )
    read = signals(cablesim.simulate(released), {"m": 0.6}, rate=90.0)
    times = read.time.values
    exact = solve_ivp(
        lambda t, y: [y[1], -G * np.sin(y[0])], (0.0, 2.0), [np.pi / 4, 0.0], "DOP853", times, rtol=1e-11
    ).y
    angle = np.arctan2(tangents(read)[:, 0, 0], -tangents(read)[:, 0, 2])
    np.testing.assert_allclose(angle, exact[0], atol=1e-3)
    settled = times > 0.5  # the rope itself rings when it is let go
    across = np.linalg.norm(read.angular_velocity.values[settled, 0], axis=-1)
    np.testing.assert_allclose(across, np.abs(exact[1, settled]), atol=2e-3)
    along = -0.6 * exact[1] ** 2 - G * np.cos(exact[0])
    np.testing.assert_allclose(read.specific_force.values[settled, 0, 0], along[settled], atol=2e-2)


def test_sensors_of_the_case_are_found_with_their_mountings():
    text = V_REST.to_yaml()
    turned = text.replace("name: imu_2\n", "name: imu_2\n  mounting: {rotation_vector: [0.1, 0.2, 0.3]}\n")
    data = resting(np.linspace(0.0, 4.0, 81), np.linspace(0.0, 4.0, 81)[:, None] * [1.0, 0.0, 0.0])
    data.attrs["case"] = turned
    read = imu_signals(data)
    assert list(read.imu.values) == [f"imu_{k}" for k in range(1, 6)]
    np.testing.assert_allclose(read.s.values, [1.0, 1.3, 1.6, 1.9, 2.2])
    np.testing.assert_allclose(Rotation.from_quat(read.mounting[1]).as_rotvec(), [0.1, 0.2, 0.3])
    assert read.attrs["gravity"] == 9.81


# A winch ----------------------------------------------------------------------------------------


def paid_out(times, s, place, velocity, acceleration, length, speed, second):
    """Hide what is on the drum: the last slot is the outlet, a point of the same cable at s = length(t)."""
    data = make_dataset(times, s, place(s), velocity(s), acceleration(s))
    deployed, rate, second_rate = length(times), speed(times), second(times)
    at = [
        np.stack([f(np.array([x]))[k, 0] for k, x in enumerate(deployed)])
        for f in (place, velocity, acceleration)
    ]
    slope = np.stack(
        [(place(np.array([x + 1e-4])) - place(np.array([x - 1e-4])))[k, 0] for k, x in enumerate(deployed)]
    )
    slope /= 2e-4
    turn = np.stack(
        [
            (velocity(np.array([x + 1e-4])) - velocity(np.array([x - 1e-4])))[k, 0]
            for k, x in enumerate(deployed)
        ]
    )
    turn /= 2e-4
    outlet = (
        at[0],
        at[1] + rate[:, None] * slope,
        at[2] + second_rate[:, None] * slope + 2 * rate[:, None] * turn,
    )
    hidden = s[None, :] > deployed[:, None] - 0.01
    for name, values in zip(("position", "velocity", "acceleration"), outlet, strict=True):
        data[name].values[hidden] = np.nan
        data[name].values[:, -1] = values
    return data.assign(deployed_length=("time", deployed))


@pytest.fixture
def swinging_winch():
    """A straight cable that turns about its end A while it is paid out, 1.02 to 1.52 m."""
    spin, direction = np.array([0.2, 0.5, -0.8]), np.array([0.6, 0.0, -0.8])
    tangent = Rotation.from_rotvec(TIMES[:, None] * spin).apply(direction)
    turn = np.cross(spin, tangent)
    parts = (tangent, turn, np.cross(spin, turn))
    place, velocity, acceleration = (lambda s, part=part: s[None, :, None] * part[:, None] for part in parts)
    return paid_out(
        TIMES,
        S,
        place,
        velocity,
        acceleration,
        lambda t: 1.02 + 0.5 * (t / 3.0) ** 2,
        lambda t: 1.0 * t / 9.0,
        lambda t: np.full_like(t, 1.0 / 9.0),
    )


def test_sensors_on_a_cable_being_paid_out(swinging_winch):
    places = {"out": 0.8, "leaves": 1.2, "stays": 1.8}
    spin, direction = np.array([0.2, 0.5, -0.8]), np.array([0.6, 0.0, -0.8])
    read = signals(swinging_winch, places)
    whole = signals(turning(TIMES, S, lambda s: s[:, None] * direction, spin), places)
    times = read.time.values
    out = 1.02 + 0.5 * (times / 3.0) ** 2 >= 1.2
    there = np.isfinite(read.orientation.values).all(axis=-1)
    assert there[:, 0].all()
    assert not there[:, 2].any()
    assert np.array_equal(there[:, 1][2:], out[2:])  # to a sample
    for name in ("angular_velocity", "specific_force", "magnetic_field"):
        np.testing.assert_allclose(read[name].values[there], whole[name].values[there], atol=2e-5)


def test_sensors_near_the_winch_of_a_curved_cable_approach_those_of_the_whole_cable():
    """The last segment is taken as straight: an error of first order in its length, gone beyond it."""
    spin, shape = np.array([0.0, 0.3, 1.0]), helix()
    turns = Rotation.from_rotvec(TIMES[:, None] * spin).as_matrix()

    def place(s):
        return np.einsum("tij,nj->tni", turns, shape(s))

    data = paid_out(
        TIMES,
        S,
        place,
        lambda s: np.cross(spin, place(s)),
        lambda s: np.cross(spin, np.cross(spin, place(s))),
        lambda t: 1.52 + 0.1 * t,
        lambda t: np.full_like(t, 0.1),
        np.zeros_like,
    )
    places = {"low": 0.4, "near": 1.5}
    whole = signals(turning(TIMES, S, shape, spin), places, reference="a")
    read = signals(data, places, reference="a")
    difference = np.abs(in_world(read, "angular_velocity") - in_world(whole, "angular_velocity"))
    assert difference[:, 0].max() < 1e-6
    assert difference[:, 1].max() < 0.05
    assert np.isfinite(read.specific_force).all()


def test_frame_does_not_turn_about_the_cable_at_the_outlet_of_a_winch(swinging_winch):
    """A straight cable: the spin is nought at the winch, so it is nought at the sensor."""
    read = signals(swinging_winch, {"out": 0.8})
    np.testing.assert_allclose(read.angular_velocity.sel(axis="x"), 0.0, atol=1e-7)


def test_sensors_of_a_run_with_a_winch():
    """The paper's round trip: the V stays out, a sensor leaves the drum, another stays on it."""
    data = winch_run()
    length = data.deployed_length.values
    assert np.ptp(length) > 0.1
    leaves = float(0.5 * (length.min() + length.max()))
    read = imu_signals(data, {"v": 1.1, "leaves": leaves, "stays": 7.5}, rate=200.0)
    there = np.isfinite(read.orientation.values).all(axis=-1)
    out = np.interp(read.time, data.time, length) > leaves
    assert there[:, 0].all()
    assert not there[:, 2].any()
    assert (there[:, 1] != out).mean() < 0.05
    assert gyroscope_drift(read.isel(imu=[0]))[0] < 0.1
    force = np.linalg.norm(read.specific_force.values[there], axis=-1)
    assert np.abs(force - G).max() < 0.5
    every = imu_signals(data, {"v": 1.1}, rate=200.0)  # far from the winch: all times at once
    np.testing.assert_allclose(every.specific_force[:, 0], read.specific_force[:, 0], atol=1e-9)


# Errors -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def at_rest():
    data = resting(S, S[:, None] * [1.0, 0.0, 0.0], times=[0.0, 400.0])
    return signals(data, {f"imu_{k}": 0.1 * k for k in range(1, 9)})


def only(**errors):
    return ImuErrors(
        gyroscope=AxisErrors(**errors), accelerometer=AxisErrors(**errors), magnetometer=AxisErrors(**errors)
    )


def test_no_errors_unless_asked_for(at_rest):
    for name, variable in add_errors(at_rest, ImuErrors()).data_vars.items():
        np.testing.assert_allclose(variable, at_rest[name], atol=1e-12, err_msg=name)


def test_the_seed_decides(at_rest):
    first, again, other = (add_errors(at_rest, "bmx160", seed) for seed in (1, 1, 2))
    xr.testing.assert_identical(first, again)
    assert not np.allclose(first.specific_force, other.specific_force)


def test_noise_has_its_density_whatever_the_rate(at_rest):
    """The standard deviation of means over a time T is density / sqrt(2 T): the Allan deviation's slope."""
    read = add_errors(at_rest, only(noise_density=0.02), 3).specific_force - at_rest.specific_force
    noise = read.values[:-1].reshape(400, 100, -1)
    assert noise.std() == pytest.approx(0.02 * np.sqrt(50.0), rel=0.01)
    means = noise.mean(axis=1)  # over 1 s
    allan = np.sqrt(0.5 * (np.diff(means, axis=0) ** 2).mean())
    assert allan == pytest.approx(0.02 / np.sqrt(2.0), rel=0.03)
    assert np.abs(noise.mean()) < 0.001


def test_biases_fill_their_range_and_stay(at_rest):
    read = (add_errors(at_rest, only(bias=0.5), 4).angular_velocity - at_rest.angular_velocity).values
    assert np.ptp(read, axis=0).max() < 1e-12
    assert 0.35 < np.abs(read).max() <= 0.5
    assert np.unique(read[0].round(9)).size == read[0].size


def test_bias_walks_with_the_root_of_time(at_rest):
    read = (add_errors(at_rest, only(random_walk=0.1), 5).angular_velocity - at_rest.angular_velocity).values
    steps = read[100::100] - read[:-100:100]  # 1 s apart
    assert steps.std() == pytest.approx(0.1, rel=0.05)
    longer = read[1600::1600] - read[:-1600:1600]
    assert longer.std() == pytest.approx(0.4, rel=0.1)


def test_scale_and_misalignment(at_rest):
    force = at_rest.specific_force.values
    read = add_errors(at_rest, only(scale=0.02), 6).specific_force.values
    ratio = read[0, :, 1] / force[0, :, 1]  # the y axis points down
    assert np.all(np.abs(ratio - 1.0) <= 0.02)
    assert np.ptp(ratio) > 0.005
    read = add_errors(at_rest, only(misalignment=0.01), 7).specific_force.values
    np.testing.assert_allclose(np.linalg.norm(read, axis=-1), G)
    assert 1e-3 < np.abs(read[0, :, [0, 2]]).max() <= 0.011 * G


def test_range_and_resolution(at_rest):
    read = add_errors(at_rest, only(noise=3.0, limit=(1.0, 2.0, 10.0), resolution=0.25), 8).angular_velocity
    assert np.abs(read).max(("time", "imu")).values == pytest.approx([1.0, 2.0, 10.0])
    np.testing.assert_array_equal(read % 0.25, 0.0)


def test_heading_drifts_and_tilt_does_not(at_rest):
    rate = np.radians(0.01)
    model = ImuErrors(orientation=OrientationErrors(heading_drift=rate))
    read = add_errors(at_rest, model, 9)
    turned = (frames(read) * frames(at_rest).inv()).as_rotvec().reshape(*at_rest.angular_velocity.shape)
    np.testing.assert_allclose(turned[..., :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(turned[-1, :, 2]), 400.0 * rate, rtol=1e-6)
    assert {-1.0, 1.0} == set(np.sign(turned[-1, :, 2]))


def test_errors_leave_what_is_on_the_drum_unknown(swinging_winch):
    exact = signals(swinging_winch, {"out": 0.8, "leaves": 1.2})
    read = add_errors(exact, "bmx160", 1)
    for name in exact.data_vars:
        np.testing.assert_array_equal(np.isnan(read[name]), np.isnan(exact[name]))


def test_preset_has_the_data_sheets_noise(at_rest):
    read = add_errors(at_rest, "bmx160", 10)
    deviation = read.specific_force.std("time").values / 9.80665
    np.testing.assert_allclose(deviation, 180e-6 * np.sqrt(50.0), rtol=0.05)
    deviation = np.degrees(read.angular_velocity.diff("time").std("time").values) / np.sqrt(2.0)
    np.testing.assert_allclose(deviation, 0.007 * np.sqrt(50.0), rtol=0.05)
    step = read.magnetic_field.values / 0.3e-6
    np.testing.assert_allclose(step, np.round(step), atol=1e-6)
    expected = replace(BMX160.accelerometer, bias=0.004 * 9.80665, scale=0.001, misalignment=0.001)
    assert calibrated(BMX160, 0.1).accelerometer == expected
    assert read.attrs["errors"] == "bmx160"


# Tables -----------------------------------------------------------------------------------------


def test_table_has_the_fields_of_ros(at_rest, tmp_path):
    read = at_rest.isel(time=slice(0, 300), imu=slice(0, 2))
    files = export_imu_csv(read, tmp_path / "logs")
    assert [file.name for file in files] == ["imu_1.csv", "imu_2.csv"]
    with files[1].open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    row = rows[123]
    assert (row["header.stamp.sec"], row["header.stamp.nanosec"], row["header.frame_id"]) == (
        "1",
        "230000000",
        "imu_2",
    )
    assert float(row["orientation.w"]) == read.orientation.values[123, 1, 3]
    assert float(row["linear_acceleration.y"]) == read.specific_force.values[123, 1, 1]
    assert float(row["magnetic_field.z"]) == read.magnetic_field.values[123, 1, 2]


def test_tables_read_back_equal(tmp_path):
    read = add_errors(signals(pendulum(TIMES, S)[0]), "bmx160", 1)
    files = export_imu_csv(read, tmp_path)
    back = read_imu_csv(dict(zip(PLACES, files, strict=True)), PLACES)
    for name in read.data_vars:
        np.testing.assert_array_equal(back[name], read[name], err_msg=name)
    np.testing.assert_array_equal(back.s, read.s)


def test_logs_of_sensors_with_clocks_of_their_own(tmp_path):
    data = pendulum(TIMES, S)[0]
    slow, fast = signals(data, {"a": 0.5}, rate=50.0), signals(data, {"b": 1.0}, rate=130.0)
    files = {
        "a": export_imu_csv(slow, tmp_path)[0],
        "b": export_imu_csv(fast.isel(time=slice(20, None)), tmp_path)[0],
    }
    both = read_imu_csv(files, {"a": 0.5, "b": 1.0})
    exact = signals(data, {"a": 0.5, "b": 1.0}, rate=50.0).sel(time=both.time, method="nearest")
    assert both.time.values[0] == pytest.approx(0.16)
    np.testing.assert_allclose(both.angular_velocity, exact.angular_velocity, atol=1e-4)
    turn = frames(both).inv() * frames(exact)
    assert turn.magnitude().max() < 1e-4


# Refusals ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"imus": {"m": 2.1}}, "s = 2.1 m is not on the cable: give 0 to 2 m"),
        ({"imus": {"m": np.nan}}, "is not on the cable"),
        ({"imus": []}, "There is no IMU"),
        ({"imus": None}, "holds no case: name the sensors"),
        ({"gravity": None}, "holds no case: give `gravity`"),
        ({"rate": 0.0}, "rate is 0 Hz"),
        ({"frame": "body"}, "frame is 'body'"),
        ({"reference": "c"}, "reference is 'c'"),
        ({"reference": 3.0}, "reference is 3"),
        ({"errors": "mpu9250"}, "errors are 'mpu9250': give one of bmx160"),
    ],
)
def test_refusals_repeat_what_was_given(options, message):
    values = {"imus": PLACES, "gravity": G, **options}
    with pytest.raises(SensorError, match=message):
        imu_signals(resting(S, S[:, None] * [1.0, 0.0, 0.0]), **values)


def test_missing_variable_is_named():
    data = resting(S, S[:, None] * [1.0, 0.0, 0.0]).drop_vars("acceleration").assign_attrs(case="name: x")
    with pytest.raises(SensorError, match=r"no `acceleration`: add it to output\.variables"):
        signals(data)
