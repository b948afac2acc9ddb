"""Run the peer scenes in MoorDyn 2.7.2 and time its integration loop.

The scenes are those of `validation/recorded/README.md`. Called as a script, this prints wall time against
marker error for a list of meshes and time schemes; `run_scene` gives one run to another script, and
`moordyn_recordings.py` keeps converged ones.

Every run is 60 m down, because MoorDyn takes a segment at z = 0 for partly dry. MoorDyn has no call that sets
node positions, so the start shape goes in through the byte image of `moordyn.Serialize`.

How long a step may be follows from the fastest axial mode, omega = (2/l) sqrt(EA/m), and from the damping
ratio zeta that BA gives it. While every segment is taut: RK4 omega dt < 2.83 (zeta = 0), RK2 < 2.18
(zeta = 0.75), Euler < 2 zeta (zeta <= 1; with BA = EA dt it is the symplectic Euler method). A slack segment
keeps its BA but has no stiffness, which adds omega dt < 1/zeta for RK2 and Euler. S3 goes slack. S1 does so
when the jumps of end B's velocity between two calls of MoorDyn exceed the tension, dv sqrt(EA m) > T.
"""

import os

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")})

import argparse
import contextlib
import ctypes
import math
import statistics
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moordyn
import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

LENGTH = 3.0  # m, unstretched
DIAMETER = 0.005  # m
MASS_PER_LENGTH = 0.055  # kg/m, in air
GRAVITY = 9.81  # m/s2
STIFFNESS = 1e4  # N
DEPTH = 60.0  # m
OUTPUT_INTERVAL = 0.02  # s
COUPLING_INTERVAL = 0.005  # s
MARKERS = 16

RECORDED = Path(__file__).resolve().parents[1] / "recorded"


@dataclass(frozen=True)
class Scene:
    """What tells one scene from another; speeds are linear between their waypoints."""

    duration: float  # s
    water_density: float = 1000.0  # kg/m3
    span: float | None = None  # m, between the ends at the start, along x; None: end B is free
    velocity: tuple[tuple[float, ...], ...] = ((0.0, 0.0, 0.0, 0.0),)  # of end B: t, vx, vy, vz
    payout: tuple[tuple[float, float], ...] = ()  # of a winch at B: t, speed


SCENES = {
    "S1": Scene(
        duration=10.0,
        span=1.5,
        velocity=((0.0, 0, 0, 0), (0.5, 0, 0.5, 0), (4.0, 0, 0.5, 0), (4.5, 0, 0, 0)),
    ),
    "S2": Scene(
        duration=14.0,
        span=0.7,
        velocity=(
            (0.0, 0, 0, 0),
            (0.5, 0.5, 0, 0),
            (4.2, 0.5, 0, 0),
            (4.7, 0, 0, 0),
            (5.7, 0, 0, 0),
            (6.2, -0.5, 0, 0),
            (9.9, -0.5, 0, 0),
            (10.4, 0, 0, 0),
        ),
    ),
    "S3": Scene(duration=6.0),
    "S3v": Scene(duration=3.0, water_density=0.0),
    "winch": Scene(
        duration=20.0,
        span=1.5,
        payout=((0.0, 0), (1.0, 0.1), (8.0, 0.1), (9.0, 0), (11.0, -0.1), (18.0, -0.1), (19.0, 0)),
    ),
}


@dataclass(frozen=True)
class PeerRun:
    """Marker positions every 0.02 s, the wall time of the `Step` calls, and the step really taken."""

    positions: np.ndarray  # (time, marker, 3), m
    wall_seconds: float
    time_step: float  # s


def run_scene(
    scene: str,
    *,
    segment_length: float,
    scheme: str,
    time_step: float,
    axial_stiffness: float = STIFFNESS,
    axial_damping: float = 0.0,
    coupling_interval: float = COUPLING_INTERVAL,
) -> PeerRun:
    """Run one scene.

    Parameters
    ----------
    scene : str
        A name in `SCENES`.
    segment_length : float
        Unstretched length of a segment [m].
    scheme : str
        MoorDyn's name of the time scheme, e.g. "rk4".
    time_step : float
        Largest inner step [s]; it is shortened to divide `coupling_interval`.
    axial_stiffness, axial_damping : float
        EA [N] and BA [N s].
    coupling_interval : float
        Time between two calls of MoorDyn [s], a divisor of 0.02 s; end B moves at constant speed in between.

    Returns
    -------
    PeerRun
        Positions with end A at the origin.

    Raises
    ------
    RuntimeError
        From MoorDyn, when the integration gives NaN.
    """
    setting = SCENES[scene]
    segments = round(LENGTH / segment_length)
    inner_step = coupling_interval / math.ceil(coupling_interval / time_step - 1e-9)
    nodes = _start_shape(setting, segments, axial_stiffness)
    deck = _input_deck(setting, nodes, scheme, inner_step, axial_stiffness, axial_damping)
    with _started(deck, nodes, setting) as system:
        node_record, wall_seconds = _integrate(system, setting, segments, coupling_interval)
    return PeerRun(_markers(node_record), wall_seconds, inner_step)


def _start_shape(setting: Scene, segments: int, axial_stiffness: float) -> np.ndarray:
    """Return the node positions (node, 3) at t = 0: hanging between the ends in S1, straight otherwise."""
    if setting.span is not None:
        return _hanging_chain(setting, segments, axial_stiffness)
    distance = np.linspace(0.0, LENGTH, segments + 1)[:, None]
    return distance * np.array([1.0, 0.0, -1.0]) / math.sqrt(2.0)


def _hanging_chain(setting: Scene, segments: int, axial_stiffness: float) -> np.ndarray:
    """Return the static equilibrium of MoorDyn's own chain of springs with lumped weights, ends level."""
    length = LENGTH / segments
    displaced = setting.water_density * math.pi * DIAMETER**2 / 4.0
    weight = (MASS_PER_LENGTH - displaced) * GRAVITY * length
    vertical = weight * (np.arange(segments) - (segments - 1) / 2.0)

    def steps(horizontal: float) -> np.ndarray:
        tension = np.hypot(horizontal, vertical)
        stretched = length * (1.0 + tension / axial_stiffness)
        components = np.column_stack([np.full(segments, horizontal), np.zeros(segments), vertical])
        return stretched[:, None] * components / tension[:, None]

    horizontal = brentq(lambda h: steps(h)[:, 0].sum() - setting.span, 1e-6, 10.0, xtol=1e-14, rtol=1e-14)
    return np.vstack([np.zeros(3), np.cumsum(steps(horizontal), axis=0)])


def _input_deck(
    setting: Scene, nodes: np.ndarray, scheme: str, inner_step: float, stiffness: float, damping: float
) -> str:
    """Return the text of the MoorDyn input file."""
    x, y, z = nodes[-1]
    end_b = "Free" if setting.span is None else "Coupled"
    # dtM a hair long: otherwise rounding leaves a last step of 1e-19 s in every coupling interval
    return f"""---- MoorDyn input file ----
peer scene
---- LINE TYPES ----
TypeName Diam Mass/m EA BA EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s) (N-m2) (-) (-) (-) (-)
rope {DIAMETER} {MASS_PER_LENGTH} {float(stiffness)!r} {float(damping)!r} 0 1.2 1.0 0.01 0
---- POINTS ----
ID Attachment X Y Z Mass Volume CdA Ca
(-) (-) (m) (m) (m) (kg) (m3) (m2) (-)
1 Fixed 0 0 {-DEPTH} 0 0 0 0
2 {end_b} {float(x)!r} {float(y)!r} {float(z) - DEPTH!r} 0 0 0 0
---- LINES ----
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(-) (-) (-) (-) (m) (-) (-)
1 rope 1 2 {LENGTH} {len(nodes) - 1} -
---- OPTIONS ----
{scheme} tscheme
{float(inner_step) * (1.0 + 1e-12)!r} dtM
{setting.water_density} WtrDnsty
{GRAVITY} g
1000 WtrDpth
0 TmaxIC
1 disableOutput
1 disableOutTime
---- need this line ----
"""


@contextlib.contextmanager
def _started(deck: str, nodes: np.ndarray, setting: Scene) -> Iterator[Any]:
    """Give a MoorDyn system at rest in the wanted shape, and close it afterwards."""
    with tempfile.TemporaryDirectory() as folder, _console_silenced():
        path = Path(folder) / "lines.txt"
        path.write_text(deck)
        system = moordyn.Create(str(path))
        moordyn.SetVerbosity(system, moordyn.LEVEL_ERR)
        try:
            end_b = (nodes[-1] + _down()).tolist() if setting.span is not None else []
            moordyn.Init(system, end_b, [0.0] * len(end_b))
            _put_shape(system, nodes + _down())
            yield system
        finally:
            moordyn.Close(system)


@contextlib.contextmanager
def _console_silenced() -> Iterator[None]:
    """Send what the C++ library prints to nowhere."""
    saved = os.dup(1), os.dup(2)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        for number, copy in enumerate(saved, start=1):
            os.dup2(copy, number)
            os.close(copy)


def _down() -> np.ndarray:
    """Return the shift from the scene's origin to where MoorDyn has it."""
    return np.array([0.0, 0.0, -DEPTH])


def _put_shape(system: Any, nodes: np.ndarray) -> None:
    """Overwrite the inner nodes' positions wherever they stand in the byte image of the system."""
    image = moordyn.Serialize(system)
    for found, wanted in zip(_read_nodes(system, len(nodes))[1:-1], nodes[1:-1], strict=True):
        image = image.replace(found.tobytes(), wanted.tobytes())
    moordyn.Deserialize(system, image)
    if not np.allclose(_read_nodes(system, len(nodes)), nodes, rtol=0.0, atol=1e-12):
        raise RuntimeError("MoorDyn did not take the start shape")


def _read_nodes(system: Any, count: int) -> np.ndarray:
    line = moordyn.GetLine(system, 1)
    return np.array([moordyn.GetLineNodePos(line, node) for node in range(count)])


def _integrate(
    system: Any, setting: Scene, segments: int, coupling_interval: float
) -> tuple[np.ndarray, float]:
    """Advance to the end; return the node positions (time, node, 3) and the seconds spent in `Step`."""
    every = round(OUTPUT_INTERVAL / coupling_interval)
    calls = every * round(setting.duration / OUTPUT_INTERVAL)
    times = np.arange(calls + 1) * coupling_interval
    positions, velocities = _end_motion(setting, times)
    lengths, rates = _deployed(setting, times)
    line = moordyn.GetLine(system, 1)
    record = [_read_nodes(system, segments + 1)]
    wall_seconds = 0.0
    for step, now in enumerate(times[:-1].tolist()):
        begin = time.perf_counter()
        if setting.payout:
            set_length(line, lengths[step], rates[step])
        moordyn.Step(system, positions[step], velocities[step], now, coupling_interval)
        wall_seconds += time.perf_counter() - begin
        if (step + 1) % every == 0:
            record.append(_read_nodes(system, segments + 1))
    return np.array(record) - _down(), wall_seconds


def set_length(line: Any, length: float, rate: float) -> None:
    """Tell MoorDyn the unstretched length of a line [m] and its rate [m/s].

    Both calls return None without owning it, and the interpreter ends when none is left: they get one.
    """
    for call, value in (
        (moordyn.SetLineUnstretchedLength, length),
        (moordyn.SetLineUnstretchedLengthVel, rate),
    ):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(None))
        call(line, value)


def _end_motion(setting: Scene, times: np.ndarray) -> tuple[list[list[float]], list[list[float]]]:
    """Return end B's position at all `times` but the last, and the velocity that leads to the next one."""
    if setting.span is None:
        return [[]] * (len(times) - 1), [[]] * (len(times) - 1)
    moved = _integral(np.array(setting.velocity, dtype=float), times)
    positions = np.array([setting.span, 0.0, -DEPTH]) + moved
    velocities = np.diff(positions, axis=0) / np.diff(times)[:, None]
    return positions[:-1].tolist(), velocities.tolist()


def _deployed(setting: Scene, times: np.ndarray) -> tuple[list[float], list[float]]:
    """Return the unstretched length at all `times` but the last, and the rate that leads to the next one."""
    lengths = LENGTH + _integral(np.array(setting.payout or ((0.0, 0.0),), dtype=float), times)[:, 0]
    return lengths[:-1].tolist(), (np.diff(lengths) / np.diff(times)).tolist()


def _integral(waypoints: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the integral of rates that are linear between waypoints (t, ...); corners lie on `times`."""
    rates = np.column_stack([np.interp(times, waypoints[:, 0], column) for column in waypoints[:, 1:].T])
    return cumulative_trapezoid(rates, times, axis=0, initial=0.0)


def _markers(node_record: np.ndarray) -> np.ndarray:
    """Return the markers' positions (time, marker, 3), on the straight segments between the nodes."""
    segments = node_record.shape[1] - 1
    place = np.linspace(0.0, segments, MARKERS)
    left = np.minimum(place.astype(int), segments - 1)
    share = (place - left)[:, None]
    return (1.0 - share) * node_record[:, left] + share * node_record[:, left + 1]


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    scene: str
    segment_length: float  # m
    scheme: str
    time_step: float  # s
    axial_damping: float = 0.0  # N s
    axial_stiffness: float = STIFFNESS  # N
    coupling_interval: float = COUPLING_INTERVAL  # s

    def run(self) -> PeerRun:
        options = vars(self).copy()
        return run_scene(options.pop("scene"), **options)


def _scaled_case(
    scene: str,
    segment_length: float,
    scheme: str,
    omega_dt: float,
    damping_ratio: float = 0.0,
    axial_stiffness: float = STIFFNESS,
    coupling_interval: float = COUPLING_INTERVAL,
) -> Case:
    """Give a case by omega dt and zeta of the fastest axial mode (see the top of the file)."""
    omega = 2.0 / segment_length * math.sqrt(axial_stiffness / MASS_PER_LENGTH)
    return Case(
        scene,
        segment_length,
        scheme,
        time_step=omega_dt / omega,
        axial_damping=2.0 * damping_ratio * axial_stiffness / omega,
        axial_stiffness=axial_stiffness,
        coupling_interval=coupling_interval,
    )


CASES = (
    *(_scaled_case("S1", length, "rk4", 2.8, coupling_interval=0.02) for length in (0.3, 0.2, 0.1)),
    _scaled_case("S1", 0.05, "rk4", 2.8),
    Case("S1", 0.05, "rk2", time_step=1e-4, axial_damping=1.17),
    _scaled_case("S1", 0.05, "rk2", 2.1, 0.75),
    *(_scaled_case("S1", length, "euler", 1.9, 1.0, coupling_interval=0.02) for length in (0.3, 0.2)),
    *(_scaled_case("S1", length, "euler", 1.9, 1.0) for length in (0.1, 0.05)),
    _scaled_case("S1", 0.05, "rk4", 2.8, axial_stiffness=1e6),
    _scaled_case("S1", 0.05, "rk2", 1.9, 0.5, axial_stiffness=1e6),
    _scaled_case("S1", 0.05, "euler", 1.9, 1.0, axial_stiffness=1e6, coupling_interval=0.001),
    *(_scaled_case("S3", length, "rk4", 2.8, coupling_interval=0.02) for length in (0.1, 0.05)),
    *(_scaled_case("S3", length, "rk2", 1.9, 0.5, coupling_interval=0.02) for length in (0.1, 0.05)),
    *(_scaled_case("S3", length, "euler", 1.39, 0.7, coupling_interval=0.02) for length in (0.1, 0.05)),
    _scaled_case("S3v", 0.05, "rk4", 2.8, coupling_interval=0.02),
)


def _rms_difference(case: Case, run: PeerRun) -> float:
    """Return the RMS distance [mm] of the markers from MoorDyn's own 1.25 cm run, NaN where there is none."""
    if case.axial_stiffness != STIFFNESS:
        return math.nan
    with xr.open_dataset(RECORDED / f"moordyn_{case.scene}.nc") as reference:
        compared = reference.time.values < (0.83 if case.scene == "S3v" else math.inf)
        distance = np.linalg.norm(run.positions - reference.marker_position.values, axis=-1)[compared]
    return 1e3 * float(np.sqrt(np.mean(distance**2)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs per row; the median wall time counts")
    options = parser.parse_args()
    print("scene  segment [m]  EA [N]  scheme  BA [N s]   dt [s]  coupling [s]  wall [s]  RMS [mm]")
    for case in CASES:
        runs = [case.run() for _ in range(options.repeat)]
        wall_seconds = statistics.median(run.wall_seconds for run in runs)
        print(
            f"{case.scene:5} {case.segment_length:12.3g} {case.axial_stiffness:7.0e}  {case.scheme:6}"
            f" {case.axial_damping:9.3g} {runs[0].time_step:8.2e} {case.coupling_interval:13.3g}"
            f" {wall_seconds:9.3f} {_rms_difference(case, runs[0]):9.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
