"""Runs random scenes and audits each one: does it finish, or say why not, and does physics hold?

A scene follows from the seed and its index alone, so that ``--only INDEX`` repeats it.  EA spans 1e2 to
1e8 N, EI 0 to 1 N m2, rtol 1e-2 to 1e-7; cables float, sink or are neutral; they are slack, taut or snap
taut; they start in balance, or kinked; ends are held, moved, jerked, shaken by noise, or free.

Audited: the status and its sentence; finite numbers in the dataset and in the netCDF file read back; the
closing of the cable; mass; and energy.  In still water the energy balance is

    E(t) - E(0) = W_ends + W_added - drag - damping,    drag, damping >= 0,

so that E - W_ends - W_added must never rise by more than the tolerance of the run.  W_ends is the
integral of -end_force . end_velocity (end_force is that of the cable on what holds it).  W_added is the
work of the added mass when the cable turns: the fluid's inertia is M(t) V', as in every Morison model,
and not (M(t) V)', so that 1/2 V.M.V has a source of its own, -(m_n - m_t)(V.t)(V.t') at each node.
"""

from __future__ import annotations

import common  # isort: skip  (first: it sets the number of threads)

import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from cablesim import Simulation, StaticsError, read, write
from cablesim import motion as motions
from cablesim.physics.parameters import MASS
from cablesim.scene import (
    Attachment,
    Cable,
    CatenaryShape,
    Current,
    End,
    EquilibriumShape,
    InitialShape,
    MarkerShape,
    MeshRules,
    Numerics,
    Output,
    ProfileCurrent,
    Scene,
    StillWater,
    TautShape,
    UniformCurrent,
    Water,
)

Rng = np.random.Generator
Vector = np.ndarray
MotionMaker = Callable[[float], motions.Motion]  # share of its full speed -> motion

GRAVITY = 9.81
OUTPUTS = 1000  # per run: the energy balance is integrated over them
LOAD_LIMIT = 0.2  # weight and drag at 1 m/s, over EA: cables of rubber are small
CLOSURE_LIMIT = 10.0  # closure error over rtol and length
ENERGY_LIMIT = 30.0  # energy created over rtol and the energy that was turned over
SLOWEST, TENSION_FACTOR = 0.05, 100.0  # [m/s] and [-]: what absolute tolerances are made of
HANG_FACTOR, HANG_EXTRA = 3.0, 60.0  # a scene hangs after this many time limits, and seconds to compile in


# Scenes ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """What the equations of a scene are compiled for; some seconds each, so many scenes share one."""

    planar: bool
    bending: bool
    damped: bool
    bodies: bool
    current: str  # none, uniform or profile
    free: str  # "", a, b or ab
    clamped: bool
    skip: bool


def draw_kind(rng: Rng) -> Kind:
    bending = _chance(rng, 0.5)
    return Kind(
        planar=_chance(rng, 0.35),
        bending=bending,
        damped=_chance(rng, 0.65),
        bodies=_chance(rng, 0.5),
        current=str(rng.choice(["none", "uniform", "profile"], p=[0.6, 0.2, 0.2])),
        free=str(rng.choice(["", "a", "b", "ab"], p=[0.5, 0.12, 0.26, 0.12])),
        clamped=bending and _chance(rng, 0.3),
        skip=_chance(rng, 0.85),
    )


@dataclass(frozen=True)
class Plan:
    """Which scenes to make: `kinds` sets of equations, runs of `shortest` to `longest` seconds."""

    seed: int = 1
    kinds: int = 24
    shortest: float = 1.0
    longest: float = 20.0
    time_limit: float = 60.0


def make_scene(plan: Plan, index: int) -> Scene:
    """Scene `index` of a plan."""
    kind = draw_kind(np.random.default_rng([plan.seed, 1, index % plan.kinds]))
    return _Draft(np.random.default_rng([plan.seed, 2, index]), kind, plan).scene(
        f"seed {plan.seed} #{index}"
    )


class _Draft:
    """The dice of one scene; each method throws a few of them."""

    def __init__(self, rng: Rng, kind: Kind, plan: Plan) -> None:
        self.rng, self.kind = rng, kind
        self.duration = _log_uniform(rng, plan.shortest, plan.longest)
        self.time_limit = plan.time_limit
        self.density = float(rng.choice([1000.0, 1025.0]))

    def scene(self, name: str) -> Scene:
        """Throw all of them."""
        rng, kind = self.rng, self.kind
        cable, attachments = self._cable_and_bodies()
        segments = rng.integers(6, 121)
        end_a, end_b = self._ends(cable)
        return Scene(
            name=name,
            gravity=GRAVITY,
            water=Water(density=self.density, current=self._current()),
            cable=cable,
            mesh=MeshRules(segment_length=cable.length / segments),
            attachments=attachments,
            imus=(),
            end_a=end_a,
            end_b=end_b,
            initial=self._initial(cable, end_a, end_b),
            duration=self.duration,
            numerics=Numerics(
                relative_tolerance=_log_uniform(rng, 1e-7, 1e-2), time_limit=self.time_limit, skip=kind.skip
            ),
            output=Output(interval=self.duration / OUTPUTS, markers=np.linspace(0.0, cable.length, 7)),
        )

    # Cable

    def _cable_and_bodies(self) -> tuple[Cable, tuple[Attachment, ...]]:
        rng = self.rng
        length, diameter = _log_uniform(rng, 1.0, 200.0), _log_uniform(rng, 2e-3, 4e-2)
        stiffness = _log_uniform(rng, 1e2, 1e8)
        relative_density = float(rng.choice([1.0, rng.uniform(0.5, 0.98), _log_uniform(rng, 1.02, 8.0)]))
        bodies = self._bodies()
        size = 1.0
        while self._load(size, length, diameter, relative_density, bodies) > LOAD_LIMIT * stiffness:
            size *= 0.8
        length, section = size * length, np.pi / 4.0 * (size * diameter) ** 2
        cable = Cable(
            length=length,
            diameter=size * diameter,
            mass_per_length=relative_density * self.density * section,
            displaced_section=section,
            added_mass_section=section,
            wet_weight=(relative_density - 1.0) * self.density * section * GRAVITY,
            axial_stiffness=stiffness,
            bending_stiffness=self._bending_stiffness(stiffness, size * diameter),
            drag_normal=rng.uniform(0.8, 2.0),
            drag_tangential=_log_uniform(rng, 5e-3, 0.1),
            added_mass_normal=rng.uniform(0.5, 1.5),
            added_mass_tangential=float(rng.choice([0.0, 0.1])),
            structural_damping=float(rng.choice([1e-4, 1e-3])) if self.kind.damped else 0.0,
        )
        return cable, tuple(self._body(k, length, size * r, d) for k, (r, d) in enumerate(bodies))

    def _bending_stiffness(self, axial_stiffness: float, diameter: float) -> float:
        """At most that of a solid rod."""
        if not self.kind.bending:
            return 0.0
        return min(_log_uniform(self.rng, 1e-6, 1.0), axial_stiffness * diameter**2 / 16.0)

    def _bodies(self) -> list[tuple[float, float]]:
        """Radius [m] and relative density of each body."""
        if not self.kind.bodies:
            return []
        count = int(self.rng.choice([1, 3, 8, 30]))
        return [(_log_uniform(self.rng, 0.01, 0.08), _log_uniform(self.rng, 0.2, 8.0)) for _ in range(count)]

    def _load(self, size: float, length: float, diameter: float, relative: float, bodies: list) -> float:
        """Weights and drag at 1 m/s [N] of everything scaled by `size`."""
        section = np.pi / 4.0 * diameter**2
        weights = abs(relative - 1.0) * section * length
        weights += sum(abs(d - 1.0) * 4.19 * r**3 for r, d in bodies)
        areas = diameter * length + sum(1.5 * r**2 for r, _ in bodies)
        return self.density * (GRAVITY * weights * size**3 + 0.5 * areas * size**2)

    def _body(self, number: int, length: float, radius: float, relative_density: float) -> Attachment:
        place = self.rng.uniform(0.0, 1.0) if _chance(self.rng, 0.9) else self.rng.integers(0, 2)
        volume = 4.0 / 3.0 * np.pi * radius**3
        return Attachment(
            name=f"body_{number}",
            kind="body",
            position=float(np.round(place * 500.0) / 500.0 * length),  # never nearly on one another
            mass=relative_density * self.density * volume,
            volume=volume,
            drag_area=0.47 * np.pi * radius**2,
            added_mass=0.5,
        )

    def _current(self) -> Current:
        rng = self.rng
        if self.kind.current == "none":
            return StillWater()
        if self.kind.current == "uniform":
            return UniformCurrent(velocity=_log_uniform(rng, 0.05, 1.0) * self._horizontal())
        heights = np.sort(rng.uniform(-50.0, 50.0, 4))
        speeds = rng.uniform(0.0, 1.0, 4)
        heading = self._horizontal()
        turn = [heading if self.kind.planar else self._horizontal() for _ in speeds]
        return ProfileCurrent(heights=heights, velocities=speeds[:, None] * np.array(turn))

    # Ends

    def _ends(self, cable: Cable) -> tuple[End, End]:
        """Ends in motion, slowed until the cable need not stretch more than a little."""
        rng, free = self.rng, self.kind.free
        stretch = _log_uniform(rng, 1e-5, min(1e-2, 0.5 * LOAD_LIMIT))
        style = str(rng.choice(["slack", "taut", "snap"], p=[0.6, 0.2, 0.2]))
        slackness = {"slack": _log_uniform(rng, 1.01, 3.0), "taut": 1.0 / (1.0 + 0.9 * stretch)}
        distance = cable.length / slackness.get(style, rng.uniform(1.02, 1.3))
        direction = self._direction()
        place_a = 10.0 * self._direction()
        place_b = place_a + distance * direction
        reach = cable.length * (1.0 + stretch)
        make_a = self._motion(place_a)
        make_b = (
            self._snap(place_b, direction, reach - distance) if style == "snap" else self._motion(place_b)
        )
        share = 1.0
        while not free and _farthest(make_a(share), make_b(share), self.duration) > reach:
            share = 0.0 if share < 1e-3 else 0.6 * share
        end_a = End(motion=None if "a" in free else make_a(share), clamp=self._clamp(direction))
        end_b = End(motion=None if "b" in free else make_b(share), clamp=self._clamp(direction))
        return (
            replace(end_a, clamp=None) if "a" in free else end_a,
            replace(end_b, clamp=None) if "b" in free else end_b,
        )

    def _clamp(self, direction: Vector) -> Vector | None:
        return (
            _unit(direction + 0.7 * self._direction())
            if self.kind.clamped and _chance(self.rng, 0.7)
            else None
        )

    def _motion(self, place: Vector) -> MotionMaker:
        makers = [self._rest, self._waypoints, self._jumps, self._harmonic, self._recorded]
        return makers[self.rng.choice(5, p=[0.3, 0.2, 0.2, 0.15, 0.15])](place)

    def _rest(self, place: Vector) -> MotionMaker:
        return lambda share: motions.fixed(place)

    def _waypoints(self, place: Vector) -> MotionMaker:
        count = self.rng.integers(2, 8)
        times = np.append(0.0, np.sort(self.rng.uniform(0.02, 1.0, count))) * self.duration
        velocities = self._velocities(count + 1)
        velocities[0] *= float(self.rng.integers(0, 2))
        return lambda share: motions.velocity_waypoints(place, times, share * velocities)

    def _jumps(self, place: Vector) -> MotionMaker:
        count = self.rng.integers(1, 6)
        steps = np.sort(self.rng.choice(np.arange(10, OUTPUTS), count, replace=False))  # on output times
        times = np.repeat(np.append(0, steps), 2)[1:] * (self.duration / OUTPUTS)
        velocities = np.repeat(self._velocities(count + 1), 2, axis=0)[:-1]
        return lambda share: motions.velocity_waypoints(place, times, share * velocities)

    def _harmonic(self, place: Vector) -> MotionMaker:
        period = _log_uniform(self.rng, 0.3, 10.0)
        amplitude = self._velocities(1)[0] * period / (2.0 * np.pi)
        ramp = float(self.rng.choice([0.0, 0.5 * self.duration]))
        return lambda share: motions.harmonic(
            place, share * amplitude, period, duration=self.duration, ramp=ramp
        )

    def _recorded(self, place: Vector) -> MotionMaker:
        """A slow wander sampled at 30 Hz with the noise of an optical system, smoothed or not."""
        rng = self.rng
        times = np.arange(0.0, self.duration + 0.2, 1.0 / 30.0)
        velocity = self._velocities(1)[0]
        path = np.sin(times / rng.uniform(1.0, 5.0))[:, None] * velocity
        noise = rng.uniform(3e-4, 1e-3)
        samples = place + path + self._in_plane(rng.normal(0.0, noise, path.shape))
        level = float(rng.choice([noise, 0.7 * noise, 0.0]))

        def make(share: float) -> motions.Motion:
            if share == 0.0:
                return motions.fixed(place)
            return motions.recorded(times, place + share * (samples - place), share * level)

        return make

    def _snap(self, place: Vector, direction: Vector, way: float) -> MotionMaker:
        """Pulls the cable taut halfway through the run, and lets go."""
        ramp = 0.05 * self.duration
        speed = way / (0.45 * self.duration)
        times = np.array([0.0, 0.05, 0.45, 0.55, 1.0]) * self.duration
        velocities = np.outer([0.0, speed, speed, -speed, -speed], direction)
        full = motions.velocity_waypoints(place, times, velocities)
        farthest = np.linalg.norm(full.position(np.linspace(0.0, self.duration, 400)) - place, axis=1).max()
        scale = way / max(farthest, ramp * 1e-9)
        return lambda share: motions.velocity_waypoints(place, times, share * scale * velocities)

    def _velocities(self, count: int) -> Vector:
        speed = _log_uniform(self.rng, 0.02, 2.0)
        return speed * np.array([self._direction() for _ in range(count)])

    # Start

    def _initial(self, cable: Cable, end_a: End, end_b: End) -> InitialShape:
        rng, free = self.rng, self.kind.free
        if free == "ab":
            return self._kinked(cable, self._direction(), 10.0 * self._direction(), rng.uniform(0.5, 0.95))
        held = [end.motion.position(0.0) for end in (end_a, end_b) if end.motion is not None]
        if free:
            return self._hanging(cable, held[0])
        span = held[1] - held[0]
        distance = float(np.linalg.norm(span))
        if distance >= cable.length:
            return TautShape()
        if _chance(rng, 0.45) and distance < 0.995 * cable.length:
            return self._kinked(cable, span / distance, held[0], distance / cable.length)
        return CatenaryShape() if _chance(rng, 0.3) else EquilibriumShape()

    def _hanging(self, cable: Cable, held: Vector) -> InitialShape:
        style = self.rng.choice(["equilibrium", "taut", "kinked"])
        if style == "equilibrium":
            return EquilibriumShape()
        direction = self._direction()
        if style == "taut":
            return TautShape(direction=direction)
        share = self.rng.uniform(0.5, 0.95)
        origin = held if self.kind.free == "b" else held - share * cable.length * direction
        return self._kinked(cable, direction, origin, share)

    def _kinked(self, cable: Cable, direction: Vector, origin: Vector, share: float) -> MarkerShape:
        """A polyline of the cable's length between two points `share` of it apart, with corners."""
        rng = self.rng
        corners = rng.integers(1, 9)
        along = np.sort(np.concatenate(([0.0, 1.0], rng.uniform(0.05, 0.95, corners))))
        aside = np.array([self._direction() for _ in along])
        aside[[0, -1]] = 0.0

        def line(height: float) -> Vector:
            return share * np.outer(along, direction) + height * aside

        height = brentq(lambda h: _polyline_arc(line(h))[-1] - 1.0, 0.0, 100.0)
        shape = line(height)
        arc = _polyline_arc(shape)
        fine = np.unique(np.concatenate((np.linspace(0.0, 1.0, 60), arc / arc[-1])))
        fine = fine[np.append(True, np.diff(fine) > 1e-6)]
        places = np.stack([np.interp(fine, arc / arc[-1], shape[:, c]) for c in range(3)], axis=1)
        return MarkerShape(arc=cable.length * fine, positions=origin + cable.length * places)

    # Directions

    def _direction(self) -> Vector:
        """Unit vector, sometimes exactly along an axis."""
        vector = self.rng.normal(size=3)
        if _chance(self.rng, 0.25):
            vector = np.eye(3)[self.rng.integers(3)] * np.sign(vector[0])
        if self.kind.planar and abs(vector[1]) == 1.0:
            vector = vector[[1, 0, 2]]
        return _unit(self._in_plane(vector))

    def _horizontal(self) -> Vector:
        vector = self.rng.normal(size=3) * [1.0, 1.0, 0.0]
        return _unit(self._in_plane(vector))

    def _in_plane(self, vectors: Vector) -> Vector:
        return vectors * [1.0, 0.0, 1.0] if self.kind.planar else vectors


def _chance(rng: Rng, probability: float) -> bool:
    return bool(rng.random() < probability)


def _log_uniform(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _unit(vector: Vector) -> Vector:
    return vector / np.linalg.norm(vector)


def _polyline_arc(places: Vector) -> Vector:
    return np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))))


def _farthest(motion_a: motions.Motion, motion_b: motions.Motion, duration: float) -> float:
    times = np.linspace(0.0, duration, 2000)
    return float(np.linalg.norm(motion_b.position(times) - motion_a.position(times), axis=1).max())


# Audit ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Report:
    """What came of one scene.

    `outcome` is ``completed``, a status of a stopped run, ``no rest shape``, ``hung`` or ``error``;
    `faults` names what the audit found, and is empty for a good run.
    """

    index: int
    outcome: str
    message: str
    faults: str
    wall: float = 0.0  # [s] of the integration
    reached: float = 0.0  # share of the duration
    calls: int = 0  # of the residual
    closure: float = 0.0  # largest closure error over rtol and length
    energy: float = float("nan")  # energy created over rtol and turnover; NaN where there is a current
    mass: float = 0.0  # relative error
    damped: bool = True
    scene: str = ""


class _Hung(Exception):  # noqa: N818
    pass


def audit(plan: Plan, index: int) -> Report:
    """Make, run and audit one scene; never raises."""
    scene = make_scene(plan, index)
    about = {"index": index, "damped": scene.cable.structural_damping > 0.0, "scene": describe(scene)}
    try:
        with warnings.catch_warnings(record=True) as caught, _alarm(plan.time_limit):
            warnings.simplefilter("always")
            simulation = Simulation(scene)
            dataset = simulation.run()
            report = _examine(index, scene, simulation, dataset)
    except StaticsError as error:
        return Report(outcome="no rest shape", message=str(error), faults="", **about)
    except _Hung:
        return Report(outcome="hung", message="", faults="hung", **about)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return Report(outcome="error", message=text, faults="error", **about)
    said = sorted({f"warning: {w.message} ({Path(w.filename).name}:{w.lineno})" for w in caught})
    return replace(report, faults="; ".join([*filter(None, [report.faults]), *said]), **about)


class _alarm:  # noqa: N801
    """Raises _Hung in the main thread long after the time limit should have stopped the run."""

    def __init__(self, time_limit: float) -> None:
        self._seconds = HANG_FACTOR * time_limit + HANG_EXTRA

    def __enter__(self) -> None:
        self._before = signal.signal(signal.SIGALRM, self._ring)
        signal.setitimer(signal.ITIMER_REAL, self._seconds)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._before)

    @staticmethod
    def _ring(*_: object) -> None:
        raise _Hung


def _examine(index: int, scene: Scene, simulation: Simulation, dataset: xr.Dataset) -> Report:
    rtol, status = scene.numerics.relative_tolerance, dataset.attrs["status"]
    closure = float(dataset.closure_error.max()) / (rtol * scene.cable.length)
    energy, certain = energy_created(scene, dataset)
    mass = _mass_error(scene, simulation)
    checks = {
        "not finite": not _finite(dataset),
        "file differs": not _same_from_file(dataset),
        "no sentence": not str(dataset.attrs["message"]).rstrip().endswith("."),
        "stopped silently": status == "completed" and abs(dataset.time.values[-1] - scene.duration) > 1e-9,
        "closure": closure > CLOSURE_LIMIT,
        "energy created": energy > ENERGY_LIMIT and certain,
        "mass": mass > 1e-9,
    }
    return Report(
        index=index,
        outcome=status,
        message=dataset.attrs["message"],
        faults="; ".join(name for name, bad in checks.items() if bad),
        wall=dataset.attrs["wall_seconds"],
        reached=float(dataset.time.values[-1]) / scene.duration,
        calls=dataset.attrs["residual_calls"],
        closure=closure,
        energy=energy,
        mass=mass,
    )


def _finite(dataset: xr.Dataset) -> bool:
    numbers = (variable for variable in dataset.variables.values() if variable.dtype.kind == "f")
    return all(bool(np.isfinite(variable.values).all()) for variable in numbers)


def _same_from_file(dataset: xr.Dataset) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.nc"
        write(dataset, path)
        again = read(path)
    return _finite(again) and bool(again.equals(dataset))


def _mass_error(scene: Scene, simulation: Simulation) -> float:
    """Dry mass on the nodes of the model against that of the scene."""
    mass = scene.cable.mass_per_length * scene.cable.length + sum(a.mass for a in scene.attachments)
    return abs(float(simulation.model.loads(0.0)[:, MASS].sum()) / mass - 1.0)


def energy_created(scene: Scene, dataset: xr.Dataset) -> tuple[float, bool]:
    """Largest rise of E - W_ends - W_added, over rtol and the turnover, and whether sampling explains it not.

    NaN where there is a current, which does work of its own.
    """
    if not isinstance(scene.water.current, StillWater) or dataset.sizes["time"] < 3:
        return float("nan"), False
    kinds = ("kinetic", "potential", "elastic", "bending")
    energies = np.stack([dataset[f"{kind}_energy"].values for kind in kinds])
    ends, blur_ends = _integrated(
        dataset.time.values, _end_power(scene, dataset), _jump_steps(scene, dataset)
    )
    ends += _impulses(scene, dataset)
    added, blur_added = _added_mass_work(scene, dataset)
    balance = energies.sum(axis=0) - ends - added
    created = float((balance - np.minimum.accumulate(balance)).max())
    rtol = scene.numerics.relative_tolerance
    level = rtol * _turnover(scene, dataset, energies, ends) + 1e-12 * float(np.abs(energies).max())
    return created / level, created > 3.0 * (blur_ends + blur_added)


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


def _integrated(times: Vector, power: Vector, skip: Vector) -> tuple[Vector, float]:
    """Integral by trapezia, shape (time,), and what may be lost between the samples.

    Of the steps in `skip`, which end with a jump, only the left value counts.
    """
    steps, change = np.diff(times), np.diff(power)
    half = np.where(np.isin(np.arange(steps.size), skip), 0.0, 0.5)
    work = np.append(0.0, np.cumsum(steps * (power[:-1] + half * change)))
    return work, float(np.sqrt(np.sum((0.5 * steps * change) ** 2)))


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


def _added_mass_work(scene: Scene, dataset: xr.Dataset) -> tuple[Vector, float]:
    """Work of the turning added mass, shape (time,), and what may be lost between the samples."""
    tangent, velocity = _tangents(dataset), dataset.velocity.values
    turn, middle_t = np.diff(tangent, axis=0), 0.5 * (tangent[1:] + tangent[:-1])
    middle_v = 0.5 * (velocity[1:] + velocity[:-1])
    steps = np.zeros(turn.shape[0])
    for v in (middle_v[:, :-1], middle_v[:, 1:]):  # of the halves after, and before, their nodes
        along, across = (np.einsum("tec,tec->te", v, vector) for vector in (middle_t, turn))
        steps -= (along * across) @ _softer_halves(scene, dataset)
    return np.append(0.0, np.cumsum(steps)), float(np.sqrt(np.sum((0.5 * np.diff(steps)) ** 2)))


# Many scenes ----------------------------------------------------------------------------------------


def describe(scene: Scene) -> str:
    """A scene in one line."""
    cable, numerics = scene.cable, scene.numerics
    ends = "-".join(
        "free" if end.motion is None else f"{end.motion.breaks.size - 1}p{len(end.motion.jumps)}j"
        for end in (scene.end_a, scene.end_b)
    )
    return (
        f"L {cable.length:.3g} d {1e3 * cable.diameter:.2g}mm EA {cable.axial_stiffness:.1e} "
        f"EI {cable.bending_stiffness:.0e} w {cable.wet_weight:.1e} tau {cable.structural_damping:g} "
        f"n {round(cable.length / scene.mesh.segment_length)} bodies {len(scene.attachments)} "
        f"{type(scene.initial).__name__[:-5].lower()} ends {ends} {type(scene.water.current).__name__} "
        f"rtol {numerics.relative_tolerance:.0e} {scene.duration:.2g}s{'' if numerics.skip else ' noskip'}"
    )


def run_all(plan: Plan, indices: list[int], jobs: int) -> list[Report]:
    """Audit scenes, side by side if asked; scenes of one kind follow each other and compile once."""
    order = sorted(indices, key=lambda index: (index % plan.kinds, index))
    if jobs == 1:
        return sorted((audit(plan, index) for index in order), key=lambda report: report.index)
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        reports = pool.map(audit, [plan] * len(order), order, chunksize=max(1, len(order) // plan.kinds))
        return sorted(reports, key=lambda report: report.index)


def summarise(reports: list[Report], evidence: common.Evidence) -> None:
    """Outcomes, faults and worst cases."""
    outcomes = Counter(report.outcome for report in reports)
    damped = Counter(report.outcome for report in reports if report.damped)
    rows = (
        {
            "outcome": name,
            "scenes": n,
            "%": 100.0 * n / len(reports),
            "damped": damped[name],
            "tau = 0": n - damped[name],
        }
        for name, n in outcomes.most_common()
    )
    evidence.table(rows, "outcomes, of scenes with structural damping and without")
    evidence.claim(
        "random scenes that finish", 100.0 * outcomes["completed"] / len(reports), "%", at_least=99.0
    )
    faults = sum(bool(report.faults) for report in reports)
    evidence.claim("random scenes with NaN or a fault of energy, closure or output", faults, at_most=0)
    columns = ("index", "outcome", "faults", "wall", "reached", "message", "scene")
    odd = [report for report in reports if report.outcome != "completed" or report.faults]
    print(f"\nNot completed, or with faults: {len(odd)}")
    for report in odd:
        print("  " + " | ".join(_short(getattr(report, name)) for name in columns))
    done = [report for report in reports if report.outcome == "completed"]
    for name in ("wall", "calls", "closure", "energy"):
        worst = sorted((r for r in done if np.isfinite(getattr(r, name))), key=lambda r: -getattr(r, name))[
            :5
        ]
        common.print_table(
            ({"index": r.index, name: getattr(r, name), "scene": r.scene} for r in worst), f"Largest {name}"
        )
    walls = np.array([report.wall for report in done])
    if walls.size:
        median, most = np.quantile(walls, [0.5, 0.9])
        print(f"\nwall time [s]: median {median:.3g}, 90 % {most:.3g}, max {walls.max():.3g}")


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def main() -> int:
    parser = common.parser(__doc__)
    parser.add_argument("--count", type=int, help="number of scenes (default 200, with --small 40)")
    parser.add_argument("--seed", type=int, default=Plan.seed)
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    parser.add_argument("--kinds", type=int, help="sets of compiled equations (default 24, with --small 6)")
    parser.add_argument("--only", type=int, nargs="+", metavar="INDEX", help="run these scenes again")
    parser.add_argument(
        "--time-limit", type=float, default=Plan.time_limit, help="wall-clock seconds a scene"
    )
    options = parser.parse_args()
    plan = Plan(
        seed=options.seed,
        kinds=options.kinds or (6 if options.small else Plan.kinds),
        time_limit=options.time_limit,
    )
    indices = options.only or list(range(options.count or (40 if options.small else 200)))
    started = time.perf_counter()
    reports = run_all(plan, indices, options.jobs)
    summarise(reports, common.Evidence(__file__, __doc__, options))
    print(f"{len(reports)} scenes in {time.perf_counter() - started:.0f} s, compiling included")
    folder = common.output_folder(options.output)
    common.write_csv(folder / "stability.csv", [asdict(report) for report in reports])
    return int(any(report.faults for report in reports))


if __name__ == "__main__":
    sys.exit(main())
