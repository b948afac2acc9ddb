"""Frames along the cable in time: the twist-free material frame, and the paper's.

Depends on: rotations, interpolation.

The cable carries no torsion, so its material frame follows from its tangents t(s, t) but for one angle.
Along s it is parallel transported (Bishop's frame: its rate of turning kappa along s has no part along t);
in time it is parallel transported at one place, the reference, where its angular velocity omega has no
part along t.  That is the frame of a cable that does not twist and cannot turn about itself at that place,
while the ball joint at the other end passes no torque.  Compatibility, d(kappa)/dt - d(omega)/ds =
omega x kappa, with kappa . t = 0 gives the spin w = omega . t everywhere else:

    dw/ds = -(t x dt/ds) . dt/dt,    omega = t x dt/dt + w t.

Here t is constant on each segment.  Parallel transport from tangent a to tangent b is the smallest rotation
that takes a to b.  Against the field of frames that the smallest rotations make from a pole p, it turns the
frame about the tangent by the area of the spherical triangle (p, a, b); its spin jumps by
-(a x b) . (da/dt + db/dt) / (1 + a . b).  Both are exact for a chain of segments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cablesim.sensors.interpolation import Nodes, PointMotion, Samples, cubic, quintic
from cablesim.sensors.problems import SensorError
from cablesim.sensors.rotations import about, cross, direction, dot, multiply, smallest, triple

Array = NDArray[np.float64]

# Any pole will do; the opposite of this one is no tangent in the planes and along the axes of which scenes
# are made.  Vectors are turned into axes of which it is the first: that saves a third of the work.
_POLE = np.array([0.36, 0.83, 0.42]) / np.linalg.norm([0.36, 0.83, 0.42])
_X = np.array([1.0, 0.0, 0.0])
_FROM_POLE = smallest(_X, _POLE)
_TO_POLE = Rotation.from_quat(_FROM_POLE).as_matrix().T

_BLOCK = 10_000  # segments times stored times that are worked on at once: they stay in the cache


def sample_tangents(gradient: Array, samples: Samples) -> tuple[Array, Array]:
    """Unit tangents and their rates (3, q, m) at wanted times, from the gradients of a `PointMotion`.

    The tangents come from the stored gradients and both their rates, the rates of the tangents from the
    stored rates of the gradients: neither differences what the integrator has found to tolerance only.
    """
    rate = cubic(samples, gradient[1], gradient[2])
    tangent, turn, _ = direction(quintic(samples, *gradient), rate)
    return tangent, turn


def transported_frame(
    nodes: Nodes, points: PointMotion, s: Array, samples: Samples, reference: str | float = "b"
) -> tuple[Array, Array]:
    """Twist-free material frame of points on the cable.

    At the first time it is the paper's frame at the reference.

    Parameters
    ----------
    nodes : Nodes
        Motion of the nodes.
    points : PointMotion
        Motion of the points.
    s : ndarray, shape (m,)
        Their material coordinates [m].
    samples : Samples
        Wanted times.
    reference : ``a``, ``b`` or float
        Where the frame does not turn about the tangent: an end, or the segment at this s [m].

    Returns
    -------
    orientation : ndarray, shape (4, q, m)
        Quaternions from the frame (x along the tangent) to the world, scalar last.
    angular_velocity : ndarray, shape (3, q, m)
        In the world frame [rad/s].
    """
    gradient = np.matmul(_TO_POLE, points.gradient.reshape(3, 3, -1)).reshape(points.gradient.shape)
    stored, stored_turn, _ = direction(gradient[0], gradient[1])
    angle, spin = _stored_angles(nodes, stored, stored_turn, s, reference)
    tangent, turn = sample_tangents(gradient, samples)
    before = samples.before
    angle_now = angle[before] + _area(stored[:, before], tangent)
    angle_now += _turned_since(stored, stored_turn, angle, spin, samples)
    orientation = multiply(smallest(_column(_X), tangent), about(0, angle_now))
    rate = cross(tangent, turn) + _sampled_spin(nodes.times, spin, samples) * tangent
    return multiply(_column(_FROM_POLE), orientation), np.tensordot(_TO_POLE.T, rate, axes=1)


def paper_frame(points: PointMotion, samples: Samples) -> tuple[Array, Array]:
    """Frame of the paper (t, n, b) with n = (-sin phi, 0, -cos phi): Fig. 2 with psi = -pi/2.

    It is turned about y by phi, then about its own z by -theta, then about its own x by psi; its angular
    velocity is t x dt/dt - (dphi/dt sin theta) t.  Along +-y it is not defined and NaN.

    Returns
    -------
    orientation, angular_velocity : ndarray, shape (4, q, m), (3, q, m)
        As of `transported_frame`.
    """
    tangent, turn = sample_tangents(points.gradient, samples)
    x, y, z = tangent
    level = np.where(np.abs(y) < 1.0 - 1e-12, x * x + z * z, np.nan)
    phi, theta = np.arctan2(-z, x), -np.arctan2(y, np.sqrt(level))
    orientation = multiply(multiply(about(1, phi), about(2, -theta)), _column(about(0, np.array(-np.pi / 2))))
    phi_rate = (z * turn[0] - x * turn[2]) / level
    return orientation, cross(tangent, turn) + (phi_rate * y) * tangent


# Transport --------------------------------------------------------------------------------------


def _stored_angles(
    nodes: Nodes, own: Array, own_turn: Array, s: Array, reference: str | float
) -> tuple[Array, Array]:
    """Angle to the pole's frames and spin (k, m) of points; tangents and rates are in the pole's axes."""
    middles = 0.5 * (nodes.s[1:] + nodes.s[:-1])
    joined = np.minimum(np.searchsorted(middles, s), middles.size - 1)
    wanted = np.append(joined, _reference_segment(nodes.s, reference))
    tangent, turn, areas, jumps = _transport(nodes, wanted)
    area, jump = _hop(own, tangent[..., :-1], own_turn + turn[..., :-1])
    area += areas[:, -1:] - areas[:, :-1]
    jump += jumps[:, -1:] - jumps[:, :-1]
    at_base = _angle_in_time(nodes.times, tangent[..., -1], turn[..., -1])
    return at_base[:, None] - area, -jump


def _transport(nodes: Nodes, wanted: NDArray[np.int64]) -> tuple[Array, Array, Array, Array]:
    """Tangents and rates (3, k, w) of wanted segments; areas and jumps (k, w) up to them from the first."""
    first, end = int(wanted.min()), int(wanted.max()) + 1
    vectors = np.empty((2, 3, nodes.times.size, wanted.size))
    sums = np.zeros((2, nodes.times.size, wanted.size))
    block = max(1, _BLOCK // (end - first))
    for start in range(0, nodes.times.size, block):
        rows = slice(start, start + block)
        tangent, turn = _segment_tangents(nodes.at(rows), first, end)
        vectors[0, :, rows], vectors[1, :, rows] = tangent[..., wanted - first], turn[..., wanted - first]
        steps = _hop(tangent[..., :-1], tangent[..., 1:], turn[..., :-1] + turn[..., 1:])
        sums[:, rows] = [_sum_from_first(step)[:, wanted - first] for step in steps]
    return vectors[0], vectors[1], sums[0], sums[1]


def _reference_segment(s: Array, reference: str | float) -> int:
    if reference in ("a", "b"):
        return 0 if reference == "a" else s.size - 2
    if isinstance(reference, str) or not 0.0 <= reference <= s[-1]:
        raise SensorError(f"reference is {reference!r}: give 'a', 'b' or s between 0 and {s[-1]:g} m.")
    return int(np.clip(np.searchsorted(s, reference, side="right") - 1, 0, s.size - 2))


def _segment_tangents(nodes: Nodes, first: int, end: int) -> tuple[Array, Array]:
    """Tangents and their rates (3, k, segments) in the pole's axes; those on the drum as the last one out."""
    position, velocity = nodes.columns(0, first, end + 1), nodes.columns(1, first, end + 1)
    if nodes.deployed is None:
        chord, rate = np.diff(position), np.diff(velocity)
    else:
        chord, rate = _with_drum(nodes, position, velocity)
    chord, rate = (np.dot(_TO_POLE, part.reshape(3, -1)).reshape(part.shape) for part in (chord, rate))
    return direction(chord, rate)[:2]


def _with_drum(nodes: Nodes, position: Array, velocity: Array) -> tuple[Array, Array]:
    """Chords and their rates (3, k, segments); segments on the drum have those of the last one out."""
    winch = [nodes.columns(derivative, nodes.s.size - 1, nodes.s.size) for derivative in (0, 1)]
    rows, last = np.arange(nodes.times.size), nodes.counts - 1
    last_out = [
        winch[derivative] - nodes.motion[derivative][rows, last].T[..., None] for derivative in (0, 1)
    ]
    on_drum = np.isnan(position)
    chord = np.diff(np.where(on_drum, winch[0], position))
    rate = np.diff(np.where(on_drum, winch[1], velocity))
    empty = ~chord.any(axis=0)
    return np.where(empty, last_out[0], chord), np.where(empty, last_out[1], rate)


def _hop(start: Array, end: Array, turns: Array) -> tuple[Array, Array]:
    """Gain of angle and spin (...) of a frame transported between tangents; `turns` is their rates' sum."""
    normal, opening = cross(start, end), 1.0 + dot(start, end)
    area = 2.0 * np.arctan2(normal[0], opening + start[0] + end[0])
    return area, -dot(normal, turns) / np.maximum(opening, 1e-12)


def _area(start: Array, end: Array) -> Array:
    """Areas (...) of the spherical triangles of the pole with unit vectors (3, ...)."""
    normal = start[1] * end[2] - start[2] * end[1]
    return 2.0 * np.arctan2(normal, 1.0 + dot(start, end) + start[0] + end[0])


def _carried_spin(start: Array, tangent: Array, turn: Array) -> Array:
    """Spin (...) about its tangent of a frame carried by the smallest rotation from `start`."""
    return -triple(start, tangent, turn) / np.maximum(1.0 + dot(start, tangent), 1e-12)


def _sum_from_first(steps: Array) -> Array:
    """Sums (k, segments) of steps (k, segments - 1), from the first segment to each."""
    sums = np.zeros((steps.shape[0], steps.shape[1] + 1))
    np.cumsum(steps, axis=1, out=sums[:, 1:])
    return sums


def _angle_in_time(times: Array, tangent: Array, turn: Array) -> Array:
    """Angle (k,) of a frame transported in time with a tangent (3, k), at first the paper's frame.

    Between two stored times the tangent leaves the great circle; the area between them is the integral
    of the spin of the frame carried by smallest rotations, by Simpson's rule on the tangent's cubic.
    """
    here, there = tangent[:, :-1], tangent[:, 1:]
    step = np.diff(times)
    middle = 0.5 * (here + there) + (step / 8.0) * (turn[:, :-1] - turn[:, 1:])
    middle_turn = (1.5 / step) * (there - here) - 0.25 * (turn[:, :-1] + turn[:, 1:])
    middle, middle_turn, _ = direction(middle, middle_turn)
    carried = 4.0 * _carried_spin(here, middle, middle_turn) + _carried_spin(here, there, turn[:, 1:])
    gain = _area(here, there) - step / 6.0 * carried
    return _first_angle(tangent[:, 0]) + np.concatenate(([0.0], np.cumsum(gain)))


def _first_angle(tangent: Array) -> float:
    """Angle to the pole's frame of the paper's, or along +-y of one like it."""
    world = tangent @ _TO_POLE
    steep = abs(world[1]) > 0.999999
    normal = np.array([0.0, 0.0, -1.0]) if steep else np.array([world[2], 0.0, -world[0]])
    frame = Rotation.from_quat(multiply(_FROM_POLE, smallest(_X, tangent))).as_matrix()
    return float(np.arctan2(normal @ frame[:, 2], normal @ frame[:, 1]))


def _turned_since(stored: Array, stored_turn: Array, angle: Array, spin: Array, samples: Samples) -> Array:
    """Turn (q, m) about the tangent since the stored time before, beside the smallest rotation: a cubic."""
    before, after = samples.before, samples.after
    here, there = stored[:, :-1], stored[:, 1:]
    turned = (np.diff(angle, axis=0) - _area(here, there) + np.pi) % (2.0 * np.pi) - np.pi
    rate = spin[1:] - _carried_spin(here, there, stored_turn[:, 1:])
    if not turned.size:
        return np.zeros((before.size, angle.shape[1]))
    x, h = samples.share, samples.step
    return (
        (x * x * (3.0 - 2.0 * x)) * turned[before]
        + (h * x * (1.0 - x) ** 2) * spin[before]
        - (h * x * x * (1.0 - x)) * rate[after - 1]
    )


def _sampled_spin(times: Array, spin: Array, samples: Samples) -> Array:
    """Spin (q, m) between stored times, by a cubic whose slopes are those of parabolas."""
    slope = np.gradient(spin, times, axis=0) if times.size > 1 else np.zeros_like(spin)
    just_out = np.isfinite(spin) & np.isnan(slope)  # of the drum
    return cubic(samples, spin, np.where(just_out, 0.0, slope))


def _column(vector: Array) -> Array:
    """Components (c,) in the shape (c, 1, 1)."""
    return vector[:, None, None]
