"""IMU signals where stored states fall on the instants at which nodes come and go at a winch."""

import numpy as np
import pytest
from shapes import dataset as make_dataset
from shapes import pendulum

import cablesim
from cablesim.sensors import imu_signals
from cablesim.sensors.interpolation import read_nodes

S = np.linspace(0.0, 2.0, 41)

HANGING = """
name: hanging
mesh: {segment_length: 5 cm}
cable: {length: 6 m, diameter: 3.5 mm, mass_per_length: 10 g/m, axial_stiffness: 10 kN}
attachments:
  - {kind: body, name: load, at: 0 m, mass: 1 kg, volume: 100 cm^3, drag_area: 20 cm^2, added_mass: 0.5}
winch:
  deployed_length: 3.5 m
  maximum_speed: 0.5 m/s
  maximum_acceleration: 1 m/s^2
  minimum_length: 1 m
  payout: {kind: waypoints, waypoints: [[0, 0], [1, -0.1], [8, -0.1]]}
ends:
  a: {motion: free}
  b: {motion: harmonic, position: [0, 0, 0], amplitude: [0.1, 0, 0], period: 2 s, ramp: 1 s}
initial: {shape: equilibrium}
simulation: {duration: 6 s}
output: {interval: 50 ms}
"""


@pytest.mark.parametrize("precision", ["double", "single"])
def test_no_sample_on_a_removal_spikes(precision):
    """A heavy load on a light tether: an output time falls on a removal (5.3 s), a sensor just below it."""
    text = HANGING.replace("interval: 50 ms", f"interval: 50 ms, precision: {precision}")
    data = cablesim.simulate(cablesim.Case.from_yaml(text))
    assert np.abs(data.winch_event_time - data.time).min() < 1e-6
    read = imu_signals(data, {"near": 2.98, "far": 0.5}, rate=100.0)
    start = int(np.searchsorted(read.time, 5.0))  # near the winch all is smooth from there to 5.5 s
    force = read.specific_force.values[start : start + 50]
    bends = np.linalg.norm(force[1:-1] - 0.5 * (force[:-2] + force[2:]), axis=-1)
    assert bends.max() < 0.05


def test_accelerations_stored_at_events_come_from_the_velocities():
    """They may be anything there; also at neighbouring times, where a node comes out, and at the end."""
    times = np.linspace(0.0, 3.0, 61)
    exact = make_dataset(times, S, *hidden_beyond(times, 1.5)).assign(
        deployed_length=("time", np.full(61, 1.9))
    )
    events = times[[9, 20, 21, 22, 60]]
    spoilt = exact.copy(deep=True).assign(winch_event_time=("winch_event", events))
    rows = [9, 20, 21, 22, 60]
    spoilt.acceleration.values[rows] += 5.0
    wanted, found = (read_nodes(data).motion[2] for data in (exact, spoilt))
    np.testing.assert_array_equal(np.isnan(found), np.isnan(wanted))
    np.testing.assert_array_equal(np.delete(found, rows, axis=0), np.delete(wanted, rows, axis=0))
    error = np.nanmax(np.abs(found - wanted), axis=(1, 2))
    assert np.all(error[rows] < [0.025, 5e-3, 5e-3, 5e-3, 0.025])  # parabolas: third order, splines: fourth


def hidden_beyond(times, s_out):
    """A straight cable that swings; the nodes beyond `s_out` come out at the ninth stored time."""
    swing = pendulum(times, S)[0]
    parts = [swing[name].values.copy() for name in ("position", "velocity", "acceleration")]
    for part in parts:
        part[:9, (s_out < S) & (S[-1] > S)] = np.nan
        part[:, (S > 1.9) & (S[-1] > S)] = np.nan
    return parts
