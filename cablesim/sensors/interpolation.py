"""Motion of any material point between the nodes and between the stored times of a run.

Depends on: problems, rotations, export (for a message); works on the dataset of a run.

Along s, cubic Hermite polynomials through the nodes whose slopes come from parabolas (Catmull and Rom
on uneven nodes): once continuously differentiable, position to third and tangent to second order in the
segment length, which is the order of the nodes themselves.  The weights are constant in time, so that
velocities and accelerations of points between nodes are those of the interpolated curve, exactly.

In time, Hermite polynomials of the stored states and their rates: quintic (sixth order) for what has two
rates, cubic (fourth order) for what has one.  No rate is found by differencing stored positions.

A state that is stored at the very instant at which a node comes or goes is the exception: its accelerations
are those of an integrator that restarts on another mesh, up to 1 m/s2 off beside the winch of a light cable
with a heavy load, while its velocities are continuous.  There the acceleration is the slope of a spline
through the velocities around.  (States that are stored later, even 1 ms, are as good as any others.)

Arrays have their components first, then stored times, then points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.results import check_whole, missing_variable
from cablesim.sensors.problems import SensorError
from cablesim.sensors.rotations import direction, dot

Array = NDArray[np.float64]

MOST_SAMPLES = 20_000_000  # of one sensor: some gigabytes

_SAME_TIME = 2e-7  # between an event and a stored time that coincide, of the time: also in single precision


@dataclass(frozen=True, eq=False)
class Nodes:
    """Motion of the nodes of a run, and which of them are off the drum.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Stored times [s].
    s : ndarray, shape (n+1,)
        Material coordinates, the last one that of the end of the cable [m].
    motion : tuple of three ndarrays, shape (k, n+1, 3)
        Position, velocity and acceleration in the world frame; NaN on the drum.
    deployed : ndarray of float, shape (k,), or None
        Material coordinate of the winch, where the last node is [m]; ``None`` without a winch.
    """

    times: Array
    s: Array
    motion: tuple[Array, Array, Array]
    deployed: Array | None

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of material nodes off the drum at each stored time, shape (k,)."""
        if self.deployed is None:
            return np.full(self.times.size, self.s.size)
        return np.isfinite(self.motion[0][:, :-1, 0]).sum(axis=1)

    def columns(self, derivative: int, first: int, end: int) -> Array:
        """Position, velocity or acceleration (3, k, end - first) of neighbouring nodes."""
        return np.ascontiguousarray(self.motion[derivative][:, first:end].transpose(2, 0, 1))

    def at(self, rows: NDArray[np.bool_] | slice) -> Nodes:
        """The same at some of the stored times."""
        position, velocity, acceleration = (part[rows] for part in self.motion)
        deployed = None if self.deployed is None else self.deployed[rows]
        return Nodes(self.times[rows], self.s, (position, velocity, acceleration), deployed)


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Motion of m material points at the stored times; NaN while a point is on the drum.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Stored times [s].
    place : ndarray, shape (3, 3, k, m)
        Position, velocity, acceleration in the world frame [m], [m/s], [m/s2].
    gradient : ndarray, shape (3, 3, k, m)
        Derivative of the position by s, along the tangent, and its first two rates [-], [1/s], [1/s2].
    """

    times: Array
    place: Array
    gradient: Array


# Along the cable --------------------------------------------------------------------------------


def read_nodes(dataset: xr.Dataset) -> Nodes:
    """Motion of the nodes of a run, as plain arrays; nodes that never leave the drum are left out.

    Raises
    ------
    SensorError
        If the dataset lacks position, velocity or acceleration, or is not a whole result.
    """
    for name in ("position", "velocity", "acceleration"):
        if name not in dataset:
            raise SensorError(missing_variable(dataset, name))
    check_whole(dataset, SensorError)
    position, velocity, acceleration = (
        dataset[name].transpose("time", "node", "axis").values.astype(float, copy=False)
        for name in ("position", "velocity", "acceleration")
    )
    nodes = Nodes(dataset["time"].values, dataset["s"].values, (position, velocity, acceleration), None)
    if "deployed_length" not in dataset:
        return nodes
    nodes = replace(nodes, deployed=dataset["deployed_length"].values)
    out = int(nodes.counts.max())  # and the outlet; slices are copied faster than picked nodes
    position, velocity, acceleration = (
        np.concatenate((part[:, :out], part[:, -1:]), axis=1) for part in nodes.motion
    )
    if "winch_event_time" in dataset:
        _replace_restarts(nodes.times, velocity, acceleration, dataset["winch_event_time"].values)
    return replace(nodes, s=np.append(nodes.s[:out], nodes.s[-1]), motion=(position, velocity, acceleration))


def _replace_restarts(times: Array, velocity: Array, acceleration: Array, events: Array) -> None:
    """Take accelerations (k, n, 3) stored at an event from the velocities: a spline's slope, in place.

    Where a node has just come out, and at the last stored time, a parabola's.  Four rounds, because the
    neighbours of a state may be stored at events too: what is wrong in one counts a quarter in the next.
    """
    slack = _SAME_TIME * np.maximum(1.0, np.abs(events))
    row = np.minimum(np.searchsorted(times, events - slack), times.size - 1)
    row = np.unique(row[(row > 0) & (np.abs(times[row] - events) <= slack)])
    step = np.diff(times)[:, None, None]
    rise = np.diff(velocity, axis=0) / step
    for k in np.tile(row, 4):
        estimates = [2.0 * rise[k - 1] - acceleration[k - 1]]
        if k < times.size - 1:
            after = 2.0 * rise[k] - acceleration[k + 1]
            before, gap, next_gap = estimates[0], step[k - 1], step[k]
            spline = (next_gap * (before + rise[k - 1]) + gap * (after + rise[k])) / (2.0 * (gap + next_gap))
            estimates = [spline, after]
        for estimate in reversed(estimates):
            acceleration[k] = np.where(np.isfinite(estimate), estimate, acceleration[k])


def follow_points(nodes: Nodes, s: ArrayLike) -> PointMotion:
    """Motion of material points at the stored times.

    Between the last material node and the winch the cable is taken as straight: the winch does not move
    with the material, so it is no node of the interpolation, but the direction to it and its rates are
    those of the cable there.

    Parameters
    ----------
    nodes : Nodes
        Motion of the nodes.
    s : array_like, shape (m,)
        Material coordinates [m].

    Raises
    ------
    SensorError
        If a point is not on the cable.
    """
    points = np.asarray(s, dtype=float)
    length = nodes.s[-1]
    outside = points[~((points >= 0.0) & (points <= length * (1.0 + 1e-12)))]
    if outside.size:
        raise SensorError(f"s = {outside[0]:g} m is not on the cable: give 0 to {length:g} m.")
    counts = nodes.counts
    least = int(counts.min())
    if np.ptp(counts) == 0 or (least > 2 and points.max(initial=0.0) < nodes.s[least - 2]):
        return PointMotion(nodes.times, *_follow(nodes, least, points))
    motion = np.empty((2, 3, 3, nodes.times.size, points.size))
    for count in np.unique(counts):
        rows = counts == count
        motion[..., rows, :] = _follow(nodes.at(rows), int(count), points)
    return PointMotion(nodes.times, motion[0], motion[1])


def _follow(nodes: Nodes, count: int, points: Array) -> Array:
    """Place and gradient (2, 3, 3, k, m) of points while the first `count` nodes are off the drum."""
    known = (points <= nodes.s[count - 1]) & (count > 1)
    if known.all():
        return _between_nodes(nodes, count, points)
    motion = np.empty((2, 3, 3, nodes.times.size, points.size))
    if known.any():
        motion[..., known] = _between_nodes(nodes, count, points[known])
    motion[..., ~known] = _near_winch(nodes, count - 1, points[~known])
    return motion


def _between_nodes(nodes: Nodes, count: int, points: Array) -> Array:
    """Place and gradient (2, 3, 3, k, m) of points between the first `count` nodes."""
    first, weights = _weights(nodes.s[:count], points)
    end = first + weights.shape[1]
    near = [nodes.columns(derivative, first, end) @ weights.T for derivative in range(3)]
    return np.stack(
        (
            np.stack([part[..., : points.size] for part in near]),
            np.stack([part[..., points.size :] for part in near]),
        )
    )


def _weights(s: Array, points: Array) -> tuple[int, Array]:
    """First node used, and weights (2 m, nodes used) of the positions, then of their derivatives by s."""
    last = s.size - 2
    j = np.clip(np.searchsorted(s, points, side="right") - 1, 0, last)
    first, end = max(0, int(j.min()) - 1), min(s.size, int(j.max()) + 3)
    slopes = _slope_weights(s[first:end])
    j = j - first
    h = np.diff(s[first:end])[j][:, None]
    x = (points[:, None] - s[first + j][:, None]) / h
    nodes = np.eye(end - first)
    here, there = nodes[j], nodes[j + 1]
    rise = x * x * (3.0 - 2.0 * x)
    bend = x * (1.0 - x) * ((1.0 - x) * slopes[j] - x * slopes[j + 1])
    place = (1.0 - rise) * here + rise * there + h * bend
    slope = 6.0 * x * (1.0 - x) / h * (there - here)
    slope += (1.0 - x) * (1.0 - 3.0 * x) * slopes[j] + x * (3.0 * x - 2.0) * slopes[j + 1]
    return first, np.concatenate((place, slope))


def _slope_weights(s: Array) -> Array:
    """Weights (n+1, n+1) of the derivative at each node: of the parabola through it and its neighbours."""
    h = np.diff(s)
    nodes = np.eye(s.size)
    chords = (nodes[1:] - nodes[:-1]) / h[:, None]
    if h.size == 1:
        return chords[[0, 0]]
    share = (h[:-1] / (h[:-1] + h[1:]))[:, None]
    inner = (1.0 - share) * chords[:-1] + share * chords[1:]
    return np.concatenate((2.0 * chords[:1] - inner[:1], inner, 2.0 * chords[-1:] - inner[-1:]))


def _near_winch(nodes: Nodes, node: int, points: Array) -> Array:
    """Place and gradient (2, 3, 3, k, m) of points on the straight segment from `node` to the winch."""
    assert nodes.deployed is not None  # without a winch every point has a node beyond it
    start = np.stack([nodes.columns(derivative, node, node + 1) for derivative in range(3)])
    end = np.stack([nodes.columns(derivative, nodes.s.size - 1, nodes.s.size) for derivative in range(3)])
    chord, rate, second_rate = end - start
    tangent, turn, distance = direction(chord, rate)
    second_turn = (second_rate - dot(second_rate, tangent) * tangent) / distance
    second_turn -= 2.0 * dot(rate, tangent) / distance * turn + dot(turn, turn) * tangent
    deployed = nodes.deployed[:, None]
    gradient = np.stack((tangent, turn, second_turn)) * (distance / (deployed - nodes.s[node]))
    place = start + (points - nodes.s[node]) * gradient
    motion = np.stack((place, np.broadcast_to(gradient, place.shape)))
    return np.where(points > deployed, np.nan, motion)


def linear_along(s: Array, values: Array, points: Array) -> Array:
    """Values (k, m, ...) at points (m,), linear between places s (n,) with values (k, n, ...)."""
    j = np.clip(np.searchsorted(s, points, side="right") - 1, 0, s.size - 2)
    share = ((points - s[j]) / (s[j + 1] - s[j])).reshape((-1,) + (1,) * (values.ndim - 2))
    return (1.0 - share) * values[:, j] + share * values[:, j + 1]


# In time ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Samples:
    """Where wanted times lie between stored ones.

    Attributes
    ----------
    times : ndarray, shape (q,)
        Wanted times [s].
    before, after : ndarray of int, shape (q,)
        Stored times on both sides.
    step, share : ndarray, shape (q, 1)
        Time between these two [s], and the part of it that has passed.
    """

    times: Array
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    step: Array
    share: Array


def sample_times(stored: Array, rate: float) -> Array:
    """Times from the first to the last stored time at a rate of a sensor's own.

    Parameters
    ----------
    stored : ndarray, shape (k,)
        Stored times [s].
    rate : float
        Samples a second [Hz].

    Raises
    ------
    SensorError
        If the rate is not positive, or gives more than `MOST_SAMPLES`.
    """
    if not 0.0 < rate < np.inf:
        raise SensorError(f"rate is {rate:g} Hz: give a positive number of samples a second.")
    if (stored[-1] - stored[0]) * rate > MOST_SAMPLES:
        raise SensorError(f"rate is {rate:g} Hz: in {stored[-1] - stored[0]:g} s these are too many samples.")
    count = int(np.floor((stored[-1] - stored[0]) * rate * (1.0 + 1e-12) + 1e-9)) + 1
    return np.minimum(stored[0] + np.arange(count) / rate, stored[-1])


def locate(stored: Array, times: ArrayLike) -> Samples:
    """Find wanted times between stored ones.

    Raises
    ------
    SensorError
        If a wanted time lies before the first or after the last stored one.
    """
    wanted = np.asarray(times, dtype=float)
    slack = 1e-9 * max(1.0, abs(stored[-1]))
    outside = wanted[~((wanted >= stored[0] - slack) & (wanted <= stored[-1] + slack))]
    if outside.size:
        raise SensorError(f"t = {outside[0]:g} s is outside the run, {stored[0]:g} to {stored[-1]:g} s.")
    before = np.clip(np.searchsorted(stored, wanted, side="right") - 1, 0, max(stored.size - 2, 0))
    after = np.minimum(before + 1, stored.size - 1)
    step = stored[after] - stored[before]
    step[step == 0.0] = 1.0  # a single state does not move
    share = (wanted - stored[before]) / step
    return Samples(wanted, before, after, step[:, None], share[:, None])


def cubic(samples: Samples, value: Array, rate: Array) -> Array:
    """Cubic Hermite interpolation in time; arrays (..., k, m) at stored times give (..., q, m)."""
    start, end, start_rate, end_rate = _both_sides(samples, value, rate)
    x, h = samples.share, samples.step
    return (
        start
        + (x * x * (3.0 - 2.0 * x)) * (end - start)
        + (h * x * (1.0 - x) ** 2) * start_rate
        - (h * x * x * (1.0 - x)) * end_rate
    )


def cubic_rate(samples: Samples, value: Array, rate: Array) -> Array:
    """Rate of the cubic Hermite interpolation: the stored rate at the stored times."""
    start, end, start_rate, end_rate = _both_sides(samples, value, rate)
    x, h = samples.share, samples.step
    change = (6.0 * x * (1.0 - x) / h) * (end - start)
    return change + ((1.0 - x) * (1.0 - 3.0 * x)) * start_rate + (x * (3.0 * x - 2.0)) * end_rate


def quintic(samples: Samples, value: Array, rate: Array, second_rate: Array) -> Array:
    """Quintic Hermite interpolation in time; arrays (..., k, m) at stored times give (..., q, m)."""
    start, end, start_rate, end_rate = _both_sides(samples, value, rate)
    x, h = samples.share, samples.step
    y = 1.0 - x
    bend = (0.5 * h * h * (x * y) ** 2) * y, (0.5 * h * h * (x * y) ** 2) * x
    return (
        start
        + (x**3 * (10.0 - 15.0 * x + 6.0 * x * x)) * (end - start)
        + (h * x * y**3 * (1.0 + 3.0 * x)) * start_rate
        - (h * y * x**3 * (1.0 + 3.0 * y)) * end_rate
        + bend[0] * second_rate[..., samples.before, :]
        + bend[1] * second_rate[..., samples.after, :]
    )


def _both_sides(samples: Samples, value: Array, rate: Array) -> tuple[Array, Array, Array, Array]:
    b, a = samples.before, samples.after
    return value[..., b, :], value[..., a, :], rate[..., b, :], rate[..., a, :]
