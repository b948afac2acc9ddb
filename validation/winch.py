"""The winch: transients and convergence through events, an hour of cranking, speed of the round trip.

Every figure is measured here: against a run of four times finer segments and a hundredth of the tolerance,
against the static shape, and by the clock.
"""

from __future__ import annotations

from common import CASES, Evidence, parser  # isort: skip  (sets the threads)

import resource
import time
from collections import Counter, defaultdict
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from scaling import idle_call, jacobian_time, python_time, residual_time

import cablesim
from cablesim.control import ConstantLength
from cablesim.integrate import IdaIntegrator
from cablesim.motion import payout_waypoints, velocity_waypoints
from cablesim.scene import (
    Attachment,
    Cable,
    Control,
    End,
    EquilibriumShape,
    MeshRules,
    Numerics,
    Output,
    Refinement,
    Scene,
    StillWater,
    UniformCurrent,
    Water,
    Winch,
)
from cablesim.trajectory.history import History

CORNERS = (0.0, 0.5, 8.0, 8.5, 9.0, 18.5, 19.0)  # [s] of the winch cycle's speed


def gallery(name: str) -> Scene:
    """A case of the gallery."""
    return cablesim.build_scene(cablesim.load_case(CASES / f"{name}.yaml"))


def changed(scene: Scene, *, segment: float, rtol: float, interval: float | None = None) -> Scene:
    """A scene on another mesh, at another tolerance."""
    wanted = ("end_force", "kinetic_energy", "winch_event_time", "winch_event_energy_change")
    output = replace(scene.output, interval=interval or scene.output.interval, variables=wanted)
    return replace(
        scene,
        mesh=replace(scene.mesh, segment_length=segment),
        numerics=replace(scene.numerics, relative_tolerance=rtol),
        output=output,
    )


def forces(dataset: xr.Dataset) -> np.ndarray:
    """Force on what holds each end [N], shape (time, 2)."""
    return np.linalg.norm(dataset["end_force"].values, axis=2)


# The winch cycle ----------------------------------------------------------------------------------


def cycle_row(scene: Scene, label: str, rtol: float, fine: xr.Dataset) -> dict[str, Any]:
    """How a run of the winch cycle differs from a finer one, in percent of the range of the force."""
    run = cablesim.simulate(changed(scene, segment=0.05, rtol=rtol, interval=0.005))
    exact, found, times = forces(fine), forces(run), run["time"].values
    error = 100 * np.abs(found - exact) / np.ptp(exact, axis=0)
    near = np.any([(times >= corner) & (times < corner + 0.1) for corner in CORNERS], axis=0)
    energy = np.interp(run["winch_event_time"], times, run["kinetic_energy"])
    line = insertion_line(run, fine)
    return {
        "run": label,
        "calls": run.attrs["residual_calls"],
        "A, max %": error[:, 0].max(),
        "A, 0.1 s after corners left out %": error[~near, 0].max(),
        "B, max %": error[:, 1].max(),
        "energy jump, max %": 100 * float(np.abs(run["winch_event_energy_change"].values / energy).max()),
        "line at A, % of force": 100 * line[0],
        "at B": 100 * line[1],
    }


def insertion_line(run: xr.Dataset, fine: xr.Dataset) -> np.ndarray:
    """Amplitude at the insertion rate over the mean force while cable is paid out at an even speed."""
    steady = slice(2.0, 8.0)
    force = forces(run.sel(time=steady))
    difference = force - forces(fine.sel(time=steady))
    window = np.hanning(len(force))[:, None]
    spectrum = 2 * np.abs(np.fft.rfft(difference * window, axis=0)) / window.sum()
    frequency = np.fft.rfftfreq(len(force), 0.005)
    return spectrum[np.abs(frequency - 0.25 / 0.05) < 0.4].max(axis=0) / force.mean(axis=0)


def force_jumps(scene: Scene) -> dict[str, Any]:
    """Largest change of the force at an event against what the two outputs before it foretell."""
    run = cablesim.simulate(replace(changed(scene, segment=0.05, rtol=1e-5, interval=0.002), duration=20.0))
    times, force = run["time"].values, forces(run)
    events = run["winch_event_time"].values
    away = np.all([(events < corner) | (events > corner + 0.1) for corner in CORNERS], axis=0)
    after = np.searchsorted(times, events[away])
    foretold = 2 * force[after - 1] - force[after - 2]
    jumps = 100 * np.abs(force[after] - foretold) / force[after]
    return {"events": int(away.sum()), "A, max %": jumps[:, 0].max(), "B, max %": jumps[:, 1].max()}


def rest_rows(scene: Scene) -> list[dict[str, Any]]:
    """Distance from the static shape of 2.5 m after the cycle: quadratic drag lets a swing fade like 1/t."""
    rows = []
    still = replace(scene, winch=None, cable=replace(scene.cable, length=2.5))
    wanted = cablesim.Simulation(still).observe().position
    output = replace(scene.output, interval=0.1, variables=("position",))
    run = cablesim.simulate(replace(scene, duration=300.0, output=output))
    for t in (30.0, 60.0, 120.0, 300.0):
        swing = run["position"].sel(time=slice(t - 8.0, t)).dropna("node").values
        off = np.linalg.norm(swing - wanted, axis=2).max(axis=1)
        mean = np.linalg.norm(swing.mean(axis=0) - wanted, axis=1).max()
        rows.append({"time [s]": t, "swing [mm]": 1e3 * off.max(), "its mean [mm]": 1e3 * mean})
    return rows


def convergence(
    scene: Scene, meshes: tuple[float, ...], tolerances: tuple[float, ...]
) -> list[dict[str, Any]]:
    """Error of the force at A through all events of the cycle, by mesh and by tolerance.

    Meshes at the tightest tolerance, the last of them being the exact one; tolerances on that mesh.
    """

    def force(segment: float, rtol: float) -> tuple[np.ndarray, int]:
        run = cablesim.simulate(replace(changed(scene, segment=segment, rtol=rtol), duration=20.0))
        return forces(run)[:, 0], run.sizes["winch_event"]

    finest, tightest = meshes[-1], tolerances[-1]
    exact, _ = force(finest, tightest)
    rows: list[dict[str, Any]] = []
    for segment, rtol in [*((h, tightest) for h in meshes[:-1]), *((finest, r) for r in tolerances[:-1])]:
        found, events = force(segment, rtol)
        error = 100 * np.sqrt(np.mean((found - exact) ** 2)) / exact.mean()
        order = np.log2(rows[-1]["RMS error %"] / error) if rows and segment < rows[-1]["segment"] else np.nan
        rows.append(
            {"segment": segment, "rtol": rtol, "events": events, "RMS error %": error, "order": float(order)}
        )
    for row in rows:  # an order tells of meshes only
        row["order"] = row["order"] if row["segment"] > finest else np.nan
    return rows


# An hour of cranking ------------------------------------------------------------------------------


def cranked(scene: Scene, duration: float) -> Scene:
    """Random speeds of the winch and random motions of both ends; everything stays within bounds."""
    rng = np.random.default_rng(20240324)
    times = np.arange(0.0, duration + 2.0, 2.0)

    def wandering(scale: float, width: int) -> np.ndarray:
        """Rates whose integral, a Brownian motion pulled back to nought, stays within a few `scale`."""
        place, rates = np.zeros(width), [np.zeros(width)]
        for _ in times[1:]:
            aim = scale * rng.uniform(-1.0, 1.0, width)
            rates.append((aim - place - rates[-1]) / 2.0)
            place = place + rates[-2] + rates[-1]
        return np.array(rates)

    payout = payout_waypoints(3.5, times, wandering(1.0, 1)[:, 0])
    ends = [
        End(motion=velocity_waypoints(end.motion.position(0.0), times, wandering(0.15, 3)))
        for end in (scene.end_a, scene.end_b)
    ]
    return replace(
        scene,
        cable=replace(scene.cable, length=8.0),
        winch=replace(scene.winch, deployed_length=3.5, payout=payout),
        end_a=ends[0],
        end_b=ends[1],
        duration=duration,
        numerics=replace(scene.numerics, relative_tolerance=1e-4),
        output=replace(scene.output, interval=1.0, variables=("closure_error", "winch_event_time")),
    )


def cranking(scene: Scene, duration: float) -> list[dict[str, Any]]:
    """Cost for an event, memory and closure in each quarter of the run."""
    simulation = cablesim.Simulation(cranked(scene, duration))
    rows, calls = [], 0
    for quarter in range(1, 5):
        simulation.scene = replace(simulation.scene, duration=quarter * duration / 4)
        started = time.perf_counter()
        run = simulation.run()
        spent = time.perf_counter() - started
        events = run.sizes["winch_event"]
        rows.append(
            {
                "until [s]": float(run["time"][-1]),
                "status": run.attrs["status"],
                "events": events,
                "calls for an event": (run.attrs["residual_calls"] - calls) / events,
                "ms for an event": 1e3 * spent / events,
                "closure, max [mm]": 1e3 * float(run["closure_error"].max()),
                "memory, peak [MB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            }
        )
        calls = run.attrs["residual_calls"]
    return rows


# Random winches -----------------------------------------------------------------------------------


def random_scene(seed: int) -> Scene:
    """A cable, bodies, water, ends, a mesh and a winch of any kind, up to 4 m/s."""
    rng = np.random.default_rng(seed)
    length, diameter = rng.uniform(2.0, 12.0), rng.uniform(2e-3, 12e-3)
    section, relative = 0.25 * np.pi * diameter**2, rng.uniform(0.8, 3.0)
    bending = 10 ** rng.uniform(-4, -1) if rng.random() < 0.5 else 0.0
    cable = Cable(
        length=length,
        diameter=diameter,
        mass_per_length=1000 * section * relative,
        displaced_section=section * (relative if rng.random() < 0.3 else 1.0),
        added_mass_section=section,
        wet_weight=0.0,
        axial_stiffness=10 ** rng.uniform(2.5, 6),
        bending_stiffness=bending,
        drag_normal=1.2,
        drag_tangential=0.01,
        added_mass_normal=1.0,
        added_mass_tangential=0.0,
        structural_damping=rng.choice([1e-4, 1e-3, 5e-3]),
    )
    weight = 9.81 * (cable.mass_per_length - 1000 * cable.displaced_section)
    deployed = rng.uniform(0.4, 0.9) * length
    times = np.arange(0.0, 6.1, 0.75)
    speeds = 10 ** rng.uniform(-1.5, 0.6) * rng.uniform(-1, 1, times.size)
    direction = rng.normal(size=3)
    place = rng.uniform(0.3, 0.95) * deployed * direction / np.linalg.norm(direction)
    moves = rng.uniform(-0.3, 0.3, (2, times.size, 3)) * rng.integers(0, 2, (2, 1, 1))
    clamp = rng.normal(size=3)
    bodies = tuple(
        Attachment(
            name=f"body {k}",
            kind="body",
            position=rng.uniform(0.05, 0.98) * length,
            mass=rng.uniform(0.01, 0.3),
            volume=rng.uniform(0.0, 3e-4),
            drag_area=1e-3,
            added_mass=0.5,
        )
        for k in range(rng.integers(0, 4))
    )
    segment = length / rng.integers(15, 90)
    near = tuple(Refinement(position=b.position, within=0.3, segment_length=segment / 4) for b in bodies[:1])
    current = UniformCurrent(velocity=rng.uniform(-0.5, 0.5, 3)) if rng.random() < 0.3 else StillWater()
    payout: Any = payout_waypoints(deployed, times, np.where(times == 0.0, 0.0, speeds))
    if rng.random() < 0.25:
        payout = Control(
            period=0.05,
            delay=rng.choice([0.0, 0.1]),
            make=partial(ConstantLength, length=0.7 * deployed, proportional=1.0),
        )
    return Scene(
        name=f"random {seed}",
        gravity=9.81,
        water=Water(density=1000.0, current=current),
        cable=replace(cable, wet_weight=weight),
        mesh=MeshRules(segment_length=segment, refinements=near if rng.random() < 0.4 else ()),
        attachments=bodies,
        imus=(),
        end_a=End(motion=velocity_waypoints([0.0, 0.0, 0.0], times, moves[0])),
        end_b=End(
            motion=velocity_waypoints(place, times, moves[1]),
            clamp=clamp / np.linalg.norm(clamp) if bending and rng.random() < 0.5 else None,
        ),
        initial=EquilibriumShape(),
        duration=5.0,
        numerics=Numerics(relative_tolerance=10 ** rng.uniform(-5, -3), time_limit=60.0),
        output=Output(interval=0.05),
        winch=Winch(
            deployed_length=deployed,
            payout=payout,
            maximum_speed=3.0,
            maximum_acceleration=5.0,
            minimum_length=0.2 * deployed,
        ),
    )


def stress(count: int) -> tuple[list[dict[str, Any]], list[int]]:
    """How many random scenes end in which way, and the numbers of those with a fault."""
    ends: Counter[str] = Counter()
    faults = []
    for seed in range(count):
        try:
            run = cablesim.simulate(random_scene(seed))
        except cablesim.StaticsError:
            ends["no rest shape found"] += 1
            continue
        ends[run.attrs["status"]] += 1
        if not np.isfinite(run["end_force"].values).all() or run["closure_error"].max() > 1e-3:
            faults.append(seed)
    return [{"end": end, "scenes": number} for end, number in ends.most_common()], faults


# Speed of the round trip ----------------------------------------------------------------------------


def counts(scene: Scene, repeats: int) -> tuple[cablesim.Simulation, xr.Dataset, float]:
    """Run a scene several times; the fastest in seconds."""
    simulation = cablesim.Simulation(scene)
    walls = []
    for _ in range(repeats):
        simulation.reset()
        run = simulation.run()
        walls.append(run.attrs["wall_seconds"])
    return simulation, run, min(walls)


def speed_row(name: str, repeats: int) -> dict[str, Any]:
    """Run time and work of a case at its settings."""
    scene = gallery(name)
    _, run, wall = counts(scene, repeats)
    return {
        "case": name,
        "segments": run.sizes["segment"],
        "wall [ms]": 1e3 * wall,
        "times real time": scene.duration / wall,
        "residual calls": run.attrs["residual_calls"],
        "Jacobians": run.attrs["jacobian_calls"],
        "starts": run.attrs["starts"],
        "events": run.sizes["winch_event"],
    }


def split(repeats: int) -> list[dict[str, Any]]:
    """Where the time of the round trip goes."""
    scene = gallery("round_trip")
    _, run, wall = counts(scene, repeats)
    clocks = clocked(scene)
    advance = clocks["advance"]
    still = replace(scene, winch=None, cable=replace(scene.cable, length=4.3))
    model = cablesim.Simulation(still)
    dispatch = python_time()
    residuals, jacobians = run.attrs["residual_calls"], run.attrs["jacobian_calls"]
    size, widths = model.model.layout.size, model.model.bandwidths
    banded, diagonal = (min(idle_call(size, w) for _ in range(3)) for w in (widths, (0, 0)))
    kernels = 1e-6 * (
        residuals * (residual_time(model) - dispatch) + jacobians * (jacobian_time(model) - dispatch)
    )
    python = 1e-6 * (residuals + jacobians) * dispatch
    algebra = 1e-6 * residuals * (banded - diagonal)
    shares = {
        "IDA: compiled residual and Jacobian": kernels,
        "IDA: their calls from Python": python,
        "IDA: linear algebra (a band of this width against a diagonal)": algebra,
        "IDA: rest (its vectors, event function, scikit-sundae's arrays)": advance
        - kernels
        - python
        - algebra,
        "nodes that come and go, with the restarts": clocks["_wind"],
        "controller, with its measurements": clocks["_sample_controller"],
        "keeping the states": clocks["record"],
    }
    shares["rest: the loop"] = wall - sum(shares.values())
    return [{"part": name, "ms": 1e3 * s, "%": 100 * s / wall} for name, s in shares.items()]


def clocked(scene: Scene) -> dict[str, float]:
    """Seconds spent in parts of a warm run; each is wrapped in a clock."""
    spent: dict[str, float] = defaultdict(float)
    parts = [
        (IdaIntegrator, "advance"),
        (cablesim.Simulation, "_wind"),
        (cablesim.Simulation, "_sample_controller"),
        (History, "record"),
    ]
    originals = [getattr(owner, name) for owner, name in parts]

    def clock(function: Any, name: str) -> Any:
        def timed(*args: Any, **kwargs: Any) -> Any:
            started = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                spent[name] += time.perf_counter() - started

        return timed

    simulation = cablesim.Simulation(scene)
    simulation.run()
    for (owner, name), original in zip(parts, originals, strict=True):
        setattr(owner, name, clock(original, name))
    try:
        simulation.reset()
        spent.clear()
        simulation.run()
    finally:
        for (owner, name), original in zip(parts, originals, strict=True):
            setattr(owner, name, original)
    return spent


# All of it -------------------------------------------------------------------------------------------


def cycle_evidence(evidence: Evidence, scene: Scene, small: bool) -> None:
    """Forces of the winch cycle: against a finer run, at events, and after it."""
    fine = cablesim.simulate(changed(scene, segment=0.0125, rtol=1e-5 if small else 1e-6, interval=0.005))
    tolerances = (1e-5,) if small else (1e-4, 1e-5, 1e-6)
    rows = [cycle_row(scene, f"rtol {rtol:g}", rtol, fine) for rtol in tolerances]
    evidence.table(rows, "winch cycle, 5 cm, against 1.25 cm: force at the ends, % of its range")
    middle = rows[0 if small else 1]
    evidence.claim("winch cycle, 5 cm, rtol 1e-5: force at A, largest", middle["A, max %"], "%", at_most=1.0)
    evidence.claim("jump of the kinetic energy at an event", middle["energy jump, max %"], "%", at_most=0.1)
    jumps = force_jumps(scene)
    for end in "AB":
        text = f"jump of the force at {end} where nodes come and go, largest"
        evidence.claim(text, jumps[f"{end}, max %"], "%", at_most=0.2)
    rows = rest_rows(scene)
    evidence.table(
        rows, "after the cycle: distance from the rest shape", "Quadratic drag: a swing fades like 1/t."
    )
    evidence.claim(
        "distance from the rest shape 300 s after the start", rows[-1]["swing [mm]"], "mm", at_most=0.3
    )


def convergence_evidence(evidence: Evidence, scene: Scene, small: bool) -> None:
    """Orders through events."""
    meshes = (0.2, 0.1, 0.05) if small else (0.1, 0.05, 0.025, 0.0125)
    tolerances = (1e-4, 1e-6) if small else (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
    rows = convergence(scene, meshes, tolerances)
    evidence.table(rows, "convergence of the force at A through events")
    for row in rows:
        if np.isfinite(row["order"]):
            text = f"order in space through events, to {100 * row['segment']:g} cm"
            evidence.claim(text, row["order"], at_least=1.8)


def main() -> None:
    """Measure everything."""
    options = parser(__doc__).parse_args()
    small = options.small
    evidence = Evidence(__file__, __doc__, options)
    scene = gallery("winch_cycle")
    rows = cranking(scene, 120.0 if small else 3600.0)
    evidence.table(rows, "random cranking, both ends moving, default tolerance, by quarters")
    evidence.claim("random cranking: closure, largest", rows[-1]["closure, max [mm]"], "mm", at_most=0.3)
    growth = rows[-1]["calls for an event"] / rows[0]["calls for an event"]
    evidence.claim("the same: calls for an event in the last quarter over the first", growth, at_most=1.25)
    cycle_evidence(evidence, scene, small)
    convergence_evidence(evidence, scene, small)
    if not small:  # each kind of scene is compiled once, which takes longer than its run
        rows, faults = stress(300)
        evidence.table(rows, "how 300 random winches end")
        evidence.claim("of these with a fault", len(faults), at_most=0)
    repeats = 3 if small else 15
    rows = [speed_row(name, repeats) for name in ("round_trip", "turn", "dive", "winch_cycle")]
    evidence.table(rows, "speed of the cases")
    for row in rows[:3]:
        evidence.claim(f"{row['case']}, defaults: times real time", row["times real time"])
    evidence.table(split(repeats), "where the time of the round trip goes")


if __name__ == "__main__":
    main()
