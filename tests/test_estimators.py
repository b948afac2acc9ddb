"""Estimates from sensors, on shapes and motions known in closed form and on a run of the V-system."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation
from shapes import G, dataset, resting, turning
from v_system import V_REST, v_run

import cablesim
from cablesim.scene import Imu
from cablesim.sensors import (
    SensorError,
    add_errors,
    angle_curvature,
    estimate_shape,
    export_imu_csv,
    fit_phase_relation,
    imu_signals,
    outer_force,
    pair_curvature,
    phase_lag,
    read_imu_csv,
    rigid_arm_distance,
    shape_curvature,
    shape_distance,
    tangent_angles,
    tangents,
    truth,
    turning_angles,
    vehicle_heading,
)

PAPER = {"imu_1": 0.0, "imu_2": 0.3, "imu_3": 0.6, "imu_4": 0.9, "imu_5": 1.2}
S = np.linspace(0.0, 1.2, 121)


def signals(data, imus=PAPER, **options):
    return imu_signals(data, imus, gravity=G, **{"rate": 50.0, **options})


def arcs(read, start=None, end=None):
    """A shape of circular arcs between the sensors: no case says how the cable bends."""
    return estimate_shape(read, start, end, bending_length=np.inf)


def v_shape(opening, tilt=0.0):
    """Two straight arms of 0.6 m with an angle of `opening` between them, turned by `tilt` about x."""
    half = 0.5 * opening
    down, up = np.array([np.sin(half), 0.0, -np.cos(half)]), np.array([np.sin(half), 0.0, np.cos(half)])
    turn = Rotation.from_rotvec([tilt, 0.0, 0.0])

    def shape(s):
        return turn.apply(np.minimum(s, 0.6)[:, None] * down + np.maximum(s - 0.6, 0.0)[:, None] * up)

    return shape


def arc(radius, tilt=0.0):
    """A circular arc in a plane turned by `tilt` about x from the vertical one through x."""
    turn = Rotation.from_rotvec([tilt, 0.0, 0.0])

    def shape(s):
        angle = s / radius - 1.0
        return turn.apply(radius * np.stack((np.sin(angle), 0.0 * angle, -np.cos(angle)), axis=-1))

    return shape


def hanging_v(length, segments=1200):
    """Two long arms of a heavy-bottomed cable: the elastica whose curvature is 2 sin(delta/2)/length."""
    s = np.linspace(0.0, 1.2, segments + 1)
    delta = 4.0 * np.arctan(np.tan(np.pi / 8.0) * np.exp(-np.abs(s - 0.6) / length))
    steep = np.pi / 2.0 - delta
    tangent = np.stack((np.cos(steep), 0.0 * s, np.sign(s - 0.6) * np.sin(steep)), axis=-1)
    steps = 0.5 * (s[1] - s[0]) * (tangent[1:] + tangent[:-1])
    return s, np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))


# Tangents and angles ----------------------------------------------------------------------------


def test_tangents_do_not_depend_on_frame_or_mounting():
    data = turning(np.linspace(0.0, 1.0, 51), S, arc(0.5, 0.4), [0.3, 0.8, -0.5])
    mounted = [
        Imu(name=name, position=s, mounting=Rotation.from_rotvec([s, 1.0, -s]).as_quat())
        for name, s in PAPER.items()
    ]
    exact = truth.tangents(data, list(PAPER.values()), signals(data).time)
    for frame in ("paper", "transported"):
        found = tangents(signals(data, mounted, frame=frame))
        np.testing.assert_allclose(found, exact, atol=1e-9)
        assert found.dims == ("time", "imu", "axis")


def test_angles_are_those_of_equation_8():
    data = turning(np.linspace(0.0, 4.0, 201), S, arc(0.5, 0.4), [0.0, 2.5, 0.0])
    read = signals(data)
    angles, t = tangent_angles(read), tangents(read).values
    theta, phi = angles.theta.values, angles.phi.values
    back = np.stack((np.cos(phi) * np.cos(theta), -np.sin(theta), -np.sin(phi) * np.cos(theta)), axis=-1)
    np.testing.assert_allclose(back, t, atol=1e-9)
    assert np.abs(np.diff(phi, axis=0)).max() < 0.2  # unwrapped


def test_estimates_of_sensors_on_the_drum_are_missing():
    read = signals(resting(S, arc(0.5)(S)))
    read["orientation"].values[1:, 4] = np.nan
    assert np.isnan(tangents(read).values[1:, 4]).all()
    assert np.isfinite(rigid_arm_distance(read)).all()
    assert np.isnan(angle_curvature(read).values[1:, 3]).all()


# Distance ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("opening", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_distance_of_straight_arms_is_exact(opening, tilt):
    data = turning(np.linspace(0.0, 1.0, 51), S, v_shape(opening, tilt), [0.3, 0.2, -0.5])
    read = signals(data)
    np.testing.assert_allclose(rigid_arm_distance(read), 1.2 * np.sin(0.5 * opening), atol=1e-9)
    np.testing.assert_allclose(truth.distance(data, 0.0, 1.2, read.time), 1.2 * np.sin(0.5 * opening))


@pytest.mark.parametrize(
    "places", [[0.0, 1.2], [0.3, 0.9], [0.05, 0.41, 0.77, 1.1], list(np.linspace(0.0, 1.2, 7))]
)
def test_arcs_reconstruct_a_circle_from_any_sensors(places):
    data = turning(np.linspace(0.0, 1.0, 51), S, arc(0.5, 0.4), [0.3, 0.2, -0.5])
    read = signals(data, {str(s): s for s in places})
    inside = places[0] < 0.1
    shape = arcs(read, 0.0, 1.2) if inside else arcs(read)
    if len(places) > 1 and places[0] == 0.0:
        chord = 2 * 0.5 * np.sin(1.2 / (2 * 0.5))
        np.testing.assert_allclose(shape_distance(shape), chord, atol=1e-4)
    inner = shape_distance(shape, places[0], places[-1])
    np.testing.assert_allclose(inner, np.sin(places[-1] - places[0]), atol=1e-4)
    np.testing.assert_allclose(shape_curvature(shape, [0.5 * sum(places[:2])]), 2.0, rtol=1e-3)
    assert np.all(np.diff(shape.s) <= 0.01 + 1e-12)


def test_shape_has_the_length_of_the_cable():
    shape = arcs(signals(resting(S, arc(0.5)(S))), 0.0, 1.2)
    steps = np.linalg.norm(np.diff(shape.position, axis=1), axis=-1)
    np.testing.assert_allclose(steps.sum(axis=1), 1.2, rtol=1e-4)


@pytest.mark.parametrize(
    "places", [[0.0, 0.3, 0.6, 0.9, 1.2], [0.1, 0.45, 0.6, 0.75, 1.1], [0.15, 0.5, 0.7, 1.05]]
)
def test_elastic_shape_of_a_hanging_v(places):
    """The linear beam against the elastica: some millimetres where straight arms miss by decimetres."""
    length = 0.0778
    s, place = hanging_v(length)
    data = resting(s, place)
    exact = np.linalg.norm(place[-1] - place[0])
    read = signals(data, {str(x): x for x in places})
    shape = estimate_shape(read, 0.0, 1.2, bodies=[0.0, 0.6, 1.2], bending_length=length)
    assert shape_distance(shape).values == pytest.approx(exact, abs=0.009)
    curvature = shape_curvature(shape, [0.6]).values
    assert curvature == pytest.approx(2.0 * np.sin(np.pi / 4.0) / length, rel=0.06)
    paper = rigid_arm_distance(signals(data)).values
    assert np.all(np.abs(paper - exact) > 0.1)


def test_elastic_weights_reproduce_the_sensors_they_were_given():
    s, place = hanging_v(0.0778)
    read = signals(resting(s, place), {str(x): x for x in np.linspace(0.0, 1.2, 7)})
    shape = estimate_shape(read, bodies=[0.6], bending_length=0.05)
    at_sensors = [int(np.argmin(np.abs(shape.s.values - x))) for x in read.s.values]
    np.testing.assert_allclose(shape.tangent.values[:, at_sensors], tangents(read), atol=1e-9)


# Curvature --------------------------------------------------------------------------------------


def test_curvature_of_a_vertical_circle():
    read = signals(resting(S, arc(0.5)(S)))
    found = pair_curvature(read)
    np.testing.assert_allclose(found.magnitude, 2.0, rtol=1e-5)
    np.testing.assert_allclose(found.binormal, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.normal, -2.0, rtol=1e-5)  # it bends upwards, n points down
    np.testing.assert_allclose(found.s, [0.15, 0.45, 0.75, 1.05])
    assert list(found.pair.values)[:2] == ["imu_1-imu_2", "imu_2-imu_3"]


def test_curvature_of_a_tilted_circle():
    data = resting(S, arc(0.5, 0.8)(S))
    read = signals(data)
    np.testing.assert_allclose(angle_curvature(read), 2.0, rtol=1e-5)
    paper = pair_curvature(signals(data, {str(s): s for s in (0.6, 0.62)}))
    np.testing.assert_allclose(paper.magnitude, 2.0, rtol=1e-3)  # exact as the sensors come together
    np.testing.assert_allclose(truth.curvature(data, [0.3, 0.555], [0.5]), 2.0, rtol=1e-4)


def test_curvature_11_approaches_10():
    """Of a curve in space, of second order in the distance of the sensors, in both components."""
    s = np.linspace(0.0, 1.2, 1201)
    turn = 1.7 * s
    tangent = np.stack((np.cos(turn), np.sin(turn) * 0.6, -0.8 * np.sin(turn)), axis=-1)
    tangent = Rotation.from_rotvec([0.0, 0.2, 0.1]).apply(tangent)
    steps = 0.5 * (s[1] - s[0]) * (tangent[1:] + tangent[:-1])
    data = resting(s, np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0))))
    errors = []
    for gap in (0.2, 0.1):
        found = pair_curvature(signals(data, {"a": 0.6 - gap / 2, "b": 0.6 + gap / 2}))
        errors.append(abs(found.magnitude.values[0, 0] - 1.7))
    assert errors[1] < 0.3 * errors[0]


def test_angle_curvature_of_a_right_angle():
    corner = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.6, 0.0, 0.6]])
    place = np.array([np.interp(S, [0.0, 0.6, 1.2], corner[:, k]) for k in range(3)]).T
    found = angle_curvature(signals(resting(S, place), {"a": 0.2, "b": 1.0}))
    np.testing.assert_allclose(found, np.pi / 2 / 0.8)


# Turning ----------------------------------------------------------------------------------------


def test_turning_angles_have_a_sign():
    times = np.linspace(0.0, 9.0, 451)
    data = turning(times, S, lambda s: s[:, None] * [0.8, 0.0, -0.6], [0.0, 0.0, 0.5])
    read = signals(data, {"m": 0.5})
    angle = turning_angles(tangents(read), 0.2).values[:, 0]
    np.testing.assert_allclose(angle, 0.5 * read.time.values - 0.2, atol=1e-6)
    ahead = turning_angles(tangents(read), 0.5 * read.time.values + 1.0)
    np.testing.assert_allclose(ahead, -1.0, atol=1e-6)
    behind = turning_angles(tangents(read), 0.5 * read.time.values + np.pi - 0.1, behind=True)
    np.testing.assert_allclose(behind, 0.1, atol=1e-6)


def test_vertical_tangents_have_no_turning_angle():
    read = signals(resting(S, S[:, None] * [0.0, 0.0, 1.0]), {"m": 0.5})
    assert turning_angles(tangents(read), 0.0).isnull().all()


def test_heading_of_the_vehicle_of_a_case():
    end = {
        "motion": "rov_waypoints",
        "position": [0, 0, 0],
        "heading": 0.5,
        "channels": ["surge", "yaw"],
        "waypoints": [[0, 0, 0], [2, 0.1, -0.4], [4, 0, 0]],
    }
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["ends"]["a"] = end
    text = cablesim.Case.from_dict(data).to_yaml()
    run = xr.Dataset(attrs={"case": text})
    np.testing.assert_allclose(vehicle_heading(run, [0.0, 1.0, 2.0, 4.0]), [0.5, 0.4, 0.1, -0.3])
    with pytest.raises(SensorError, match="end A that is fixed"):
        vehicle_heading(xr.Dataset(attrs={"case": V_REST.to_yaml()}), [0.0])


# Who pulls --------------------------------------------------------------------------------------


def test_force_on_a_v_that_moves_without_turning():
    """F = (mass + added mass) a + drag of a straight cable with its three bodies, in closed form."""
    s = np.linspace(0.0, 4.0, 81)
    direction = np.array([0.8, 0.0, -0.6])
    times = np.linspace(0.0, 3.0, 301)
    push = np.array([0.3, 0.1, 0.05])
    way, speed, gain = 1.0 - np.cos(times), np.sin(times), np.cos(times)
    place = s[None, :, None] * direction + (way[:, None] * push)[:, None]
    velocity, acceleration = (np.repeat((f[:, None] * push)[:, None], s.size, axis=1) for f in (speed, gain))
    data = dataset(times, s, place, velocity, acceleration).assign_attrs(case=V_REST.to_yaml())
    read = imu_signals(data, rate=100.0)
    found = outer_force(read)

    v, a = np.sin(read.time.values)[:, None] * push, np.cos(read.time.values)[:, None] * push
    expected = np.zeros_like(v)
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    for mass, volume, area, added in (
        (24.675e-3, 65.45e-6, 9.23e-4, 0.5),
        (93.455e-3, 11.905e-6, 5.48e-4, 0.6),
        (24.675e-3, 65.45e-6, 9.23e-4, 0.5),
    ):
        expected += (mass + 1000.0 * added * volume) * a + 500.0 * area * speed * v
        expected[:, 2] += (mass - 1000.0 * volume) * G
    section = 12.57e-6  # neutral
    along_v, along_a = (v @ direction)[:, None] * direction, (a @ direction)[:, None] * direction
    across = v - along_v
    drag = 1.2 * np.linalg.norm(across, axis=1, keepdims=True) * across
    drag += 0.01 * np.pi * np.linalg.norm(along_v, axis=1, keepdims=True) * along_v
    expected += 1.2 * (12.57e-3 * a + 1000.0 * section * (a - along_a) + 500.0 * 4e-3 * drag)
    np.testing.assert_allclose(found.force, expected, atol=2e-5)
    np.testing.assert_allclose(found.pull, expected @ direction, atol=2e-5)


def test_offsets_of_accelerometers_are_found_at_rest():
    data = resting(
        np.linspace(0.0, 4.0, 81), np.linspace(0.0, 4.0, 81)[:, None] * [1.0, 0.0, 0.0], times=[0.0, 20.0]
    )
    read = imu_signals(data.assign_attrs(case=V_REST.to_yaml()), rate=20.0)
    read["specific_force"] = read.specific_force + 0.3
    assert np.abs(outer_force(read).force).max() > 0.5
    np.testing.assert_allclose(outer_force(read, rest=1.0).force, 0.0, atol=1e-6)


def test_velocity_is_drawn_to_that_of_the_vehicle():
    """Sensors with an offset: without the vehicle's velocity the drag grows for ever."""
    s = np.linspace(0.0, 4.0, 81)
    times = np.linspace(0.0, 60.0, 601)
    velocity = np.broadcast_to([0.2, 0.0, 0.0], (601, 81, 3))
    place = s[None, :, None] * np.array([0.0, 0.6, -0.8]) + 0.2 * times[:, None, None] * [1.0, 0.0, 0.0]
    data = dataset(times, s, place, velocity, np.zeros_like(velocity)).assign_attrs(case=V_REST.to_yaml())
    read = imu_signals(data, rate=20.0)
    found = outer_force(read, memory=3.0, vehicle_velocity=[0.2, 0.0, 0.0]).force.values[-1]
    drag = 500.0 * (2 * 9.23e-4 + 5.48e-4 + 1.2 * 1.2 * 4e-3) * 0.2**2
    np.testing.assert_allclose(found, [drag, 0.0, 0.0], atol=1e-5)
    assert np.abs(outer_force(read).force.values[-1, 0]) < 1e-9


def test_phase_relation_is_recovered():
    times = np.linspace(0.0, 20.0, 2001)
    distance = xr.DataArray(
        0.3 + 0.1 * np.sin(0.7 * times) + 0.02 * np.sin(2.1 * times), {"time": times}, ("time",)
    )
    rate = 0.07 * np.cos(0.7 * times) + 0.042 * np.cos(2.1 * times)
    second = -0.049 * np.sin(0.7 * times) - 0.0882 * np.sin(2.1 * times)
    difference = 0.5 * (distance.values - 0.3) - 0.4 * rate + 0.2 * second + 0.01
    relation = fit_phase_relation(distance, difference, 0.3)
    assert relation.stiffness == pytest.approx(0.5, rel=1e-2)
    assert relation.damping == pytest.approx(-0.4, rel=1e-3)
    assert relation.inertia == pytest.approx(0.2, rel=1e-2)
    assert relation.offset == pytest.approx(0.01, rel=1e-2)
    assert truth.errors_of(relation(distance)[10:-10], difference[10:-10])["max"] < 1e-3


@pytest.mark.parametrize("lag", [-0.8, 0.0, 1.3])
def test_lag_of_a_signal_that_follows(lag):
    times = np.linspace(0.0, 30.0, 601)
    first = xr.DataArray(np.exp(-((times - 12.0) ** 2)), {"time": times}, ("time",))
    found, correlation = phase_lag(first, np.exp(-((times - 12.0 - lag) ** 2)))
    assert found == pytest.approx(lag, abs=0.026)
    assert correlation > 0.999


# A run of the V-system --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run():
    data = v_run()
    assert data.attrs["status"] == "completed"
    return data


def test_shape_beats_straight_arms_twentyfold(run):
    read = imu_signals(run, rate=50.0)
    exact = truth.distance(run, 1.0, 2.2, read.time)
    paper = truth.errors_of(rigid_arm_distance(read), exact)
    shape = truth.errors_of(shape_distance(estimate_shape(read)), exact)
    assert np.ptp(exact.values) > 0.1
    assert paper["rms"] > 0.1
    assert shape["rms"] < 0.05 * paper["rms"]
    assert shape["max"] < 0.012


def test_curvature_at_the_ballast(run):
    read = imu_signals(run, rate=50.0)
    exact = truth.curvature(run, [1.6], read.time).isel(point=0)
    shape = truth.errors_of(shape_curvature(estimate_shape(read), [1.6])[:, 0], exact)
    paper = truth.errors_of(pair_curvature(read).magnitude.values[:, 1], exact)
    assert shape["rms"] < 0.1 * exact.mean()
    assert paper["rms"] > 5 * shape["rms"]


def test_outer_force_of_a_run(run):
    read = imu_signals(run, rate=50.0)
    found, exact = outer_force(read), truth.outer_force(run, 1.0, 2.2, read.time)
    assert np.sqrt(((found.force - exact) ** 2).mean()) < 0.02 * np.abs(exact).max()
    pull = truth.pull(run, 1.0, 2.2, read.time)
    assert np.abs(pull).max() > 0.03
    assert truth.agreement_of_sign(found.pull, pull, 0.005) > 0.99
    assert truth.tension(run, 1.0, "a", read.time).max() > truth.tension(run, 1.0, "a", [0.0])[0] + 0.03


def test_turning_of_the_v(run):
    """The line between the buoys, from the sensors, against the true one."""
    read = imu_signals(run, rate=50.0)
    shape, heading = estimate_shape(read), vehicle_heading(run, read.time)
    line = truth.places(run, [1.0, 2.2], read.time).diff("point").isel(point=0)
    exact = turning_angles(line, heading, behind=True)
    found = turning_angles(shape.position.isel(point=-1), heading, behind=True)
    assert np.degrees(np.ptp(exact.values)) > 20.0
    assert np.degrees(np.abs(found - exact).max()) < 1.0


def test_logs_of_real_sensors_give_the_same_estimates(run, tmp_path):
    """Through tables: masses and places are given by the user, or all of the case with the logs."""
    read = imu_signals(run, rate=50.0)
    files = dict(zip(read.imu.values, export_imu_csv(read, tmp_path), strict=True))
    log = read_imu_csv(files, dict(zip(read.imu.values, read.s.values, strict=True)))
    case = cablesim.Case.from_yaml(run.attrs["case"])
    shape = estimate_shape(log, bodies=[1.0, 1.6, 2.2], bending_length=np.sqrt(2.42e-3 / 0.4))
    np.testing.assert_allclose(shape_distance(shape), shape_distance(estimate_shape(read)), atol=1e-4)
    np.testing.assert_allclose(
        shape_distance(estimate_shape(log, case=case)), shape_distance(shape), atol=1e-4
    )
    np.testing.assert_allclose(outer_force(log, case).force, outer_force(read).force, atol=1e-4)
    places = dict(zip(read.imu.values, read.s.values, strict=True))
    with_case = read_imu_csv(files, places, case=case)
    np.testing.assert_allclose(shape_distance(estimate_shape(with_case)), shape_distance(shape), atol=1e-4)


def test_sensor_errors_cost_millimetres(run):
    read = imu_signals(run, rate=50.0)
    exact = truth.distance(run, 1.0, 2.2, read.time)
    with_errors = shape_distance(estimate_shape(add_errors(read, "bmx160", 3)))
    assert truth.errors_of(with_errors, exact)["rms"] < 0.015


# Refusals ---------------------------------------------------------------------------------------


def test_refusals_repeat_what_was_given():
    read = signals(resting(S, arc(0.5)(S)))
    with pytest.raises(SensorError, match="no sensor 'imu_9': there are imu_1, imu_2"):
        rigid_arm_distance(read, "imu_9")
    with pytest.raises(SensorError, match=r"sensors are at s = \[0\.6\] m: give two or more"):
        arcs(read.isel(imu=[2]))
    with pytest.raises(SensorError, match=r"sensors are at s = \[0\.6, 0\.6\] m"):
        angle_curvature(read.isel(imu=[2, 2]))
    with pytest.raises(SensorError, match="from 1 to 0 m"):
        arcs(read, 1.0, 0.0)
    with pytest.raises(SensorError, match="s = 2 m is not in the shape"):
        shape_distance(arcs(read), 0.0, 2.0)
    with pytest.raises(SensorError, match="hold no case: give `case`"):
        outer_force(read)
    with pytest.raises(SensorError, match="holds no case: give the heading"):
        vehicle_heading(read, [0.0])
    with pytest.raises(SensorError, match="no time in common"):
        truth.errors_of([np.nan], [1.0])
    with pytest.raises(SensorError, match="side is 'c'"):
        truth.tension(
            resting(S, arc(0.5)(S), tension=(("time", "segment"), np.zeros((2, 120)))), 0.5, "c", [0.0]
        )
