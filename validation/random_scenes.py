"""Random scenes, each from a seed and its index alone.

EA spans 1e2 to 1e8 N, EI 0 to 1 N m2, rtol 1e-2 to 1e-7; cables float, sink or are neutral; they are slack,
taut or snap taut; they start in balance, or kinked; ends are held, moved, jerked, shaken by
noise, or free.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from cablesim import motion as motions
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
OUTPUTS = 1000  # per run
LOAD_LIMIT = 0.2  # weight and drag at 1 m/s, over EA: cables of rubber are small


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
