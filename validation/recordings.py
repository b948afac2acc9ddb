"""Recorded experiments that stand beside the project and are not part of it (`../shared/recordings`).

Cable 6 of the COSMER tank: all 18 runs with the recorded motion of the robot, nothing fitted; of two of them
the angle gamma is known by which the plane of the fitted catenary leans; here it is that of the plane through
both ends and the point of largest sag, as how the fit weighed the cable was not published. Lowe and
Langley (2006): tension at the top of a flexible jumper of 170 m whose top is moved; in case 3 it rises 5 m
out of the water, which is not modelled. Holcombe et al. (2025): a lazy wave with 20 discrete modules of
buoyancy at rest; whether its hang-off was a pin or a vertical clamp is not known.
"""

from __future__ import annotations

from common import CASES, RECORDINGS, Evidence, parser  # isort: skip - sets the threads

import csv
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from run0024 import UP
from scipy.interpolate import CubicSpline

import cablesim
from cablesim.recording import rotate_to_vertical

GRAVITY = 9.807  # [m/s2], of the jumper and the lazy wave


# Cable 6 ------------------------------------------------------------------------------------------

AUTHORS_UP = (0.0208, -0.1436, 0.9894)  # the vertical that the published angles were taken with
LEAN_BOUNDS = {"y200dis2_0028": 0.3, "x200dis2_0031": 0.5}  # RMS [deg]
LEAN_MISSED = "kept with the added mass on the section that the porous rope displaces"


def tank_case(trajectory: Path) -> cablesim.Case:
    """Cable 6 behind the robot of a recorded run, from its rest shape."""
    data = cablesim.load_case(CASES / "cable6_run0024.yaml").model_dump()
    samples = len(trajectory.read_text(encoding="utf-8").splitlines()) - 1
    data["ends"]["b"] |= {"file": str(trajectory), "start": 0.0}
    data["initial"] = {"shape": "equilibrium"}
    data["simulation"]["duration"] = 0.03 * (samples - 1)
    return cablesim.Case.from_dict(data)


def lean(run: xr.Dataset) -> np.ndarray:
    """Angle about the chord from the authors' vertical plane to the point of largest sag [deg]."""
    down = -rotate_to_vertical(np.array([AUTHORS_UP]), UP)[0]
    nodes = run["position"].values
    places = CubicSpline(np.arange(nodes.shape[1]), nodes, axis=1)(np.linspace(0, nodes.shape[1] - 1, 500))
    chord = nodes[:, -1] / np.linalg.norm(nodes[:, -1], axis=1, keepdims=True)
    sagging = down - (chord @ down)[:, None] * chord
    sagging /= np.linalg.norm(sagging, axis=1, keepdims=True)
    sideways = np.cross(sagging, chord)
    sag = (places * sagging[:, None]).sum(axis=-1)
    lowest = places[np.arange(len(places)), sag.argmax(axis=1)]
    return np.degrees(np.arctan2((lowest * sideways).sum(axis=1), sag.max(axis=1)))


def tank_runs(evidence: Evidence, folder: Path) -> None:
    """All runs of cable 6, and the angle of two."""
    rows = []
    for trajectory in sorted((folder / "robot_end_trajectories").glob("*dynamique6*")):
        name = trajectory.stem.removeprefix("trajectory_L_dynamique6")
        run = cablesim.simulate(tank_case(trajectory))
        speed = np.gradient(run["position"].values[:, -1], run["time"].values, axis=0)
        rows.append(
            {
                "run": name,
                "status": run.attrs["status"],
                "duration [s]": float(run["time"][-1]),
                "robot, fastest [m/s]": float(np.linalg.norm(speed, axis=1).max()),
                "calls": run.attrs["residual_calls"],
            }
        )
        if name in LEAN_BOUNDS:
            series = folder / "augmented_catenary_series" / f"gamma_L_dynamique6{name}.txt"
            times, recorded = np.loadtxt(series, comments="%").T
            error = np.interp(times, run["time"].values, lean(run)) - np.degrees(recorded)
            text = f"cable 6, run {name[-4:]}: angle gamma of the cable's plane, RMS"
            evidence.claim(
                text, float(np.sqrt(np.mean(error**2))), "deg", at_most=LEAN_BOUNDS[name], missed=LEAN_MISSED
            )
    evidence.table(rows, "all runs of cable 6, from the recorded motion of the robot")


# The jumper of Lowe and Langley -------------------------------------------------------------------

JUMPER_MOVES = {1: ("x", 0.15), 2: ("y", 0.15), 3: ("z", None)}  # direction, bound [kN]
PERIOD = 27.0  # [s]


def jumper_case(axis: str) -> cablesim.Case:
    """The jumper with its top end moved by 10 m along an axis; the records begin when the ramp is over."""
    return cablesim.Case.from_dict(
        {
            "name": "jumper",
            "gravity": GRAVITY,
            "cable": {
                "length": 170,
                "diameter": 0.396,
                "mass_per_length": 165,
                "axial_stiffness": 500e6,
                "bending_stiffness": 120.8e3,
                "drag_normal": 1.0,
                "drag_tangential": 0.0,
            },
            "mesh": {"segment_length": 1.7},
            "ends": {
                "a": {"motion": "fixed", "position": [-100, 0, -55]},
                "b": {
                    "motion": "harmonic",
                    "position": [0, 0, -5],
                    "amplitude": [10.0 if name == axis else 0.0 for name in "xyz"],
                    "period": PERIOD,
                    "ramp": PERIOD,
                },
            },
            "initial": {"shape": "equilibrium"},
            "simulation": {"duration": 4 * PERIOD},
            "output": {"interval": 0.1},
        }
    )


def jumper(evidence: Evidence, folder: Path) -> None:
    """Tension at the top in three directions of motion."""
    for number, (axis, bound) in JUMPER_MOVES.items():
        times, recorded = np.loadtxt(folder / f"case{number}.csv", delimiter=",").T
        run = cablesim.simulate(jumper_case(axis))
        top = 1e-3 * np.linalg.norm(run["end_force"].sel(end="b").values, axis=1)
        error = np.interp(times + PERIOD, run["time"].values, top) - recorded
        text = f"jumper, case {number}, top moved along {axis}: tension, RMS"
        evidence.claim(text, float(np.sqrt(np.mean(error**2))), "kN", at_most=bound)


# The lazy wave of Holcombe and others ---------------------------------------------------------------

HANG_OFF = (0.075561, 0.0, -0.290105)
WAVE_LENGTH = 3.67  # [m]


def lifted(name: str, s: float, mass: float, buoyancy: float) -> dict[str, Any]:
    """A body of a mass [kg] and a buoyant force [N] at `s` metres from the hang-off, which is end B."""
    volume = buoyancy / (1000.0 * GRAVITY)
    return {"kind": "body", "name": name, "at": WAVE_LENGTH - s, "mass": mass, "volume": volume}


def wave_case(markers: np.ndarray, clamp: list[float] | None) -> cablesim.Case:
    """The lazy wave; its shape is looked for near the line through the markers (s, x, z)."""
    modules = [lifted(f"module_{k}", s, 1.36e-3, 27.3e-3) for k, s in enumerate(np.linspace(2.14, 3.23, 20))]
    spheres = [lifted(f"marker_{k}", s, 1.1e-3, 14.1e-3) for k, s in enumerate(markers[:-1, 0])]
    end = {"motion": "fixed", "position": list(HANG_OFF)}
    through = [[x, 0.0, z] for _, x, z in markers[::-1]]
    return cablesim.Case.from_dict(
        {
            "name": "lazy_wave",
            "gravity": GRAVITY,
            "cable": {
                "length": WAVE_LENGTH,
                "diameter": 2.3e-3,
                "mass_per_length": 0.0127,
                "axial_stiffness": 65.5e3,
                "bending_stiffness": 6.25e-4,
            },
            "mesh": {"segment_length": 0.02},
            "attachments": modules + spheres,
            "ends": {
                "a": {"motion": "fixed", "position": through[0]},
                "b": end if clamp is None else {**end, "clamp": clamp},
            },
            "initial": {"shape": "equilibrium", "through": [*through, list(HANG_OFF)]},
            "simulation": {"duration": 1},
        }
    )


def wave(evidence: Evidence, file: Path) -> None:
    """Distance of the seven markers from the rest shape."""
    with file.open(newline="", encoding="utf-8") as stream:
        rows = [[float(row[k]) for k in ("material_arc_m", "x_m", "z_m")] for row in csv.DictReader(stream)]
    markers = np.array(rows)
    for text, clamp, bound in (("a pin", None, 45.0), ("a vertical clamp", [0.0, 0.0, 1.0], None)):
        simulation = cablesim.Simulation(cablesim.build_scene(wave_case(markers, clamp)))
        places = simulation.observe().position[:, [0, 2]]
        s = WAVE_LENGTH - simulation.mesh.nodes
        found = np.column_stack([np.interp(markers[:, 0], s[::-1], column[::-1]) for column in places.T])
        rms = 1e3 * float(np.sqrt(((found - markers[:, 1:]) ** 2).sum(axis=1).mean()))
        evidence.claim(f"lazy wave hung off by {text}: markers at rest, RMS", rms, "mm", at_most=bound)


def main() -> None:
    """Compare with all recordings."""
    options = parser(__doc__).parse_args()
    if not RECORDINGS.is_dir():
        raise SystemExit(f"no recordings at {RECORDINGS}: nothing to compare with")
    evidence = Evidence(__file__, __doc__, options)
    tank_runs(evidence, RECORDINGS / "cosmer_cable6")
    jumper(evidence, RECORDINGS / "lowe_langley_jumper")
    wave(evidence, RECORDINGS / "holcombe_lazywave" / "experimental_markers.csv")


if __name__ == "__main__":
    main()
