"""The energy balance of a run in still water, from its outputs.

    E(t) - E(0) = W_ends + W_added - drag - damping,    drag, damping >= 0,

so that E - W_ends - W_added must never rise by more than the tolerance of the run.  W_ends is the
integral of -end_force . end_velocity (end_force is that of the cable on what holds it).  W_added is the
work of the added mass when the cable turns: the fluid's inertia is M(t) V', as in every Morison model,
and not (M(t) V)', so that 1/2 V.M.V has a source of its own, -(m_n - m_t)(V.t)(V.t') at each node.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from cablesim import simulate
from cablesim.scene import Scene, StillWater

Vector = np.ndarray

SLOWEST, TENSION_FACTOR = 0.05, 100.0  # [m/s] and [-]: what absolute tolerances are made of
FINER = 8  # outputs in the place of one, where a rise may be what the samples miss

ENERGIES = ("kinetic_energy", "potential_energy", "elastic_energy", "bending_energy")
NEEDED = (*ENERGIES, "position", "velocity", "end_force")


def energy_created(scene: Scene, dataset: xr.Dataset, limit: float) -> float:
    """Largest rise of E - W_ends - W_added, over rtol and the turnover.

    Axial waves may be faster than the samples from which the work of the ends is integrated, and trapezia
    then invent work.  A rise above `limit` is therefore looked at again with finer samples.  NaN where
    there is a current, which does work of its own.

    After a jump, or a kink in a shaken end's wave, that work shrinks no faster than the interval: what is
    left of two refinements is extrapolated to none.
    """
    if not isinstance(scene.water.current, StillWater) or dataset.sizes["time"] < 3:
        return float("nan")
    created = _rise(scene, dataset)
    if created <= limit:
        return created
    reached = replace(scene, duration=float(dataset.time.values[-1]))
    fine, finer = (_sampled_rise(reached, FINER**power) for power in (1, 2))
    return max(0.0, (FINER * finer - fine) / (FINER - 1))


def _sampled_rise(scene: Scene, times: int) -> float:
    output = replace(scene.output, interval=scene.output.interval / times, variables=NEEDED)
    return _rise(scene, simulate(replace(scene, output=output)))


def _rise(scene: Scene, dataset: xr.Dataset) -> float:
    energies = np.stack([dataset[name].values for name in ENERGIES])
    ends = _integrated(dataset.time.values, _end_power(scene, dataset), _jump_steps(scene, dataset))
    ends += _impulses(scene, dataset)
    balance = energies.sum(axis=0) - ends - _added_mass_work(scene, dataset)
    rise = float((balance - np.minimum.accumulate(balance)).max())
    rtol = scene.numerics.relative_tolerance
    level = rtol * _turnover(scene, dataset, energies, ends) + 1e-12 * float(np.abs(energies).max())
    return rise / level


def _turnover(scene: Scene, dataset: xr.Dataset, energies: Vector, ends: Vector) -> float:
    """Energy of which the run's rtol is a share [J].

    Absolute tolerances count too (see `cablesim.physics.scales`): velocities are not known better than rtol
    times SLOWEST, and tensions 100 times less well than the rest.
    """
    held = np.linalg.norm(dataset.end_force.values, axis=-1).max()
    slow_work = float(held) * SLOWEST * scene.duration
    slow_motion = 0.5 * float(_node_masses(scene, dataset).sum()) * SLOWEST**2
    moved = max(float(np.ptp(energies, axis=1).max()), float(energies[[0, 3]].max()), float(np.ptp(ends)))
    return moved + TENSION_FACTOR * float(energies[2].max()) + slow_work + slow_motion


def _end_power(scene: Scene, dataset: xr.Dataset) -> Vector:
    """Power that prescribed ends give to the cable, shape (time,) [W]."""
    held = [scene.end_a.motion is not None, scene.end_b.motion is not None]
    velocity = dataset.velocity.values[:, [0, -1]]
    return -np.einsum("tec,tec,e->t", dataset.end_force.values, velocity, np.array(held, dtype=float))


def _integrated(times: Vector, power: Vector, skip: Vector) -> Vector:
    """Integral by trapezia, shape (time,); of steps in `skip`, which end with a jump, the left one counts."""
    steps, change = np.diff(times), np.diff(power)
    half = np.where(np.isin(np.arange(steps.size), skip), 0.0, 0.5)
    return np.append(0.0, np.cumsum(steps * (power[:-1] + half * change)))


def _jumps(scene: Scene) -> Iterator[tuple[int, float]]:
    for end, motion in enumerate((scene.end_a.motion, scene.end_b.motion)):
        if motion is not None:
            yield from ((end, float(t)) for t in motion.jumps if t <= scene.duration)


def _step_before(dataset: xr.Dataset, time_of_jump: float) -> int:
    return int(np.searchsorted(dataset.time.values, time_of_jump * (1.0 - 1e-12))) - 1


def _jump_steps(scene: Scene, dataset: xr.Dataset) -> Vector:
    return np.array([_step_before(dataset, t) for _, t in _jumps(scene)], dtype=int)


def _impulses(scene: Scene, dataset: xr.Dataset) -> Vector:
    """Work of the blows that make the end nodes jump: what their kinetic energy gains, shape (time,)."""
    work = np.zeros(dataset.sizes["time"])
    masses = (scene.end_a.motion, scene.end_b.motion)
    for end, t in _jumps(scene):
        last, step = -end, _step_before(dataset, t)  # node, and segment, at this end
        if step + 1 >= work.size:
            continue
        before, after = masses[end].velocity(np.nextafter(t, 0.0)), masses[end].velocity(t)
        along = _tangents(dataset)[step + 1, last]
        gain = _node_masses(scene, dataset)[last] * (after @ after - before @ before)
        gain -= _softer_halves(scene, dataset)[last] * ((after @ along) ** 2 - (before @ along) ** 2)
        work[step + 1 :] += 0.5 * gain
    return work


def _node_masses(scene: Scene, dataset: xr.Dataset) -> Vector:
    """Mass with the normal added mass of each node [kg]."""
    cable, s = scene.cable, dataset.s.values
    length = 0.5 * (np.append(np.diff(s), 0.0) + np.append(0.0, np.diff(s)))
    around = scene.water.density * cable.added_mass_section * length
    mass = cable.mass_per_length * length + cable.added_mass_normal * around
    for body in scene.attachments:
        node = int(np.abs(s - body.position).argmin())
        mass[node] += body.mass + body.added_mass * scene.water.density * body.volume
    return mass


def _softer_halves(scene: Scene, dataset: xr.Dataset) -> Vector:
    """By how much less the added mass of half a segment is along it than across [kg]."""
    cable = scene.cable
    around = 0.5 * scene.water.density * cable.added_mass_section * np.diff(dataset.s.values)
    return (cable.added_mass_normal - cable.added_mass_tangential) * around


def _tangents(dataset: xr.Dataset) -> Vector:
    chords = np.diff(dataset.position.values, axis=1)
    return chords / np.linalg.norm(chords, axis=-1, keepdims=True)


def _added_mass_work(scene: Scene, dataset: xr.Dataset) -> Vector:
    """Work of the turning added mass, shape (time,)."""
    tangent, velocity = _tangents(dataset), dataset.velocity.values
    turn, middle_t = np.diff(tangent, axis=0), 0.5 * (tangent[1:] + tangent[:-1])
    middle_v = 0.5 * (velocity[1:] + velocity[:-1])
    steps = np.zeros(turn.shape[0])
    for v in (middle_v[:, :-1], middle_v[:, 1:]):  # of the halves after, and before, their nodes
        along, across = (np.einsum("tec,tec->te", v, vector) for vector in (middle_t, turn))
        steps -= (along * across) @ _softer_halves(scene, dataset)
    return np.append(0.0, np.cumsum(steps))
