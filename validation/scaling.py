"""How run time and memory grow with the mesh, what each skip gains, and where the time goes.

Four tables: run time and peak memory from 60 to 10 000 segments (each size in a process of its own), band
against Krylov solver below 1000 segments, the gain of each skip, and the parts of a run of S1.
"""

from __future__ import annotations

from common import CASES, Evidence, best_time, parser  # isort: skip - sets the threads

import json
import resource
import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
from sksundae.ida import IDA

import cablesim
from cablesim.scene import MeshRules, Scene

SIZES = (60, 125, 250, 428, 500, 1000, 2000, 5000, 10_000)
SMALL_SIZES = (60, 250, 1000)


def gallery(name: str) -> Scene:
    """A case of the gallery, its positions alone kept at ten times."""
    scene = cablesim.build_scene(cablesim.load_case(CASES / f"{name}.yaml"))
    return replace(
        scene,
        output=replace(
            scene.output, interval=scene.duration / 10, variables=("position",), markers=np.empty(0)
        ),
    )


def numerics(scene: Scene, **changes: Any) -> Scene:
    """The scene with other settings of the integrator."""
    return replace(scene, numerics=replace(scene.numerics, **changes))


def long_rope(segments: int, solver: str = "auto") -> Scene:
    """S1 with a rope as long as it has segments of 5 cm, and all lengths of its motion with it."""
    scene = gallery("sway")
    factor = segments / 60
    motion_b = scene.end_b.motion
    assert motion_b is not None
    stretched = replace(
        motion_b, coefficients=motion_b.coefficients * np.array([factor] + [1.0] * 5)[None, :, None]
    )
    # the end's places are scaled, its speed is not: join the pieces again
    places = stretched.coefficients
    places[1:, 0] = places[0, 0] + (motion_b.coefficients[1:, 0] - motion_b.coefficients[0, 0])
    return numerics(
        replace(
            scene,
            cable=replace(scene.cable, length=scene.cable.length * factor),
            mesh=MeshRules(segment_length=0.05),
            end_b=replace(scene.end_b, motion=stretched),
        ),
        linear_solver=solver,
    )


def integration(scene: Scene, repeats: int) -> tuple[float, cablesim.Simulation]:
    """Shortest integration of a scene [s], set-up and compilation left out."""
    simulation = cablesim.Simulation(scene)
    walls = []
    for _ in range(repeats):
        simulation.reset()
        walls.append(float(simulation.run().attrs["wall_seconds"]))
    return min(walls), simulation


def calls(simulation: cablesim.Simulation) -> tuple[int, int]:
    """Residual and Jacobian calls of the run just made."""
    simulation.reset()
    run = simulation.run()
    return int(run.attrs["residual_calls"]), int(run.attrs["jacobian_calls"])


# Growth ---------------------------------------------------------------------------------------------


def measure(segments: int, solver: str) -> dict[str, Any]:
    """One size, in this process; memory is the growth of the peak while the scene is built and run."""
    integration(long_rope(20), 1)  # imports and compiled code are there before the memory is read
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    wall, simulation = integration(long_rope(segments, solver), 3 if segments < 2000 else 1)
    residual_calls, jacobian_calls = calls(simulation)
    return {
        "segments": segments,
        "solver": solver,
        "wall [s]": wall,
        "residual calls": residual_calls,
        "Jacobians": jacobian_calls,
        "per call [us]": 1e6 * wall / residual_calls,
        "memory [MB]": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024,
    }


def measured_apart(segments: int, solver: str) -> dict[str, Any]:
    """`measure` in a new process."""
    command = [sys.executable, __file__, "--one", str(segments), solver]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def exponent(rows: list[dict[str, Any]], quantity: str) -> float:
    """Power of the number of segments with which a quantity grows."""
    x, y = ([float(row[key]) for row in rows] for key in ("segments", quantity))
    return float(np.polyfit(np.log(x), np.log(np.maximum(y, 1e-3)), 1)[0])


# Skips ----------------------------------------------------------------------------------------------


def skip_rows(repeats: int) -> list[dict[str, Any]]:
    """Each skip alone: a scene as it is compiled for, against the full three-dimensional kernel."""
    rows = []
    for name in ("sway", "pendulum", "v_rest"):
        scene = numerics(gallery(name), relative_tolerance=1e-6)
        skipped, lean = integration(scene, repeats)
        full_wall, full = integration(numerics(scene, skip=False), repeats)
        places = [s.run().position.values for s in (_reset(lean), _reset(full))]
        rows.append(
            {
                "case": name,
                "unknowns": lean.model.layout.size,
                "of full": full.model.layout.size,
                "residual [us]": residual_time(lean),
                "full [us]": residual_time(full),
                "per call [us]": 1e6 * skipped / calls(lean)[0],
                "full per call [us]": 1e6 * full_wall / calls(full)[0],
                "run: full/lean": full_wall / skipped,
                "largest difference [m]": float(np.abs(places[0] - places[1]).max()),
            }
        )
    return rows


def one_feature_rows(repeats: int) -> list[dict[str, Any]]:
    """S1 with one more feature compiled in that changes nothing: time of a residual and of a call."""
    base = gallery("sway")
    cable, water = base.cable, base.water
    still = cablesim.scene.ProfileCurrent(heights=np.array([-10.0, 10.0]), velocities=np.zeros((2, 3)))
    body = cablesim.scene.Attachment(
        name="nothing", kind="body", position=1.5, mass=0.0, volume=0.0, drag_area=1e-30, added_mass=0.0
    )
    scenes = {
        "S1": base,
        "with bending": replace(base, cable=replace(cable, bending_stiffness=1e-30)),
        "with attachment drag": replace(base, attachments=(body,)),
        "with positions (profile)": replace(base, water=replace(water, current=still)),
        "without damping": replace(base, cable=replace(cable, structural_damping=0.0)),
    }
    rows = []
    for name, scene in scenes.items():
        wall, simulation = integration(scene, repeats)
        count = calls(simulation)[0]
        rows.append(
            {
                "scene": name,
                "residual [us]": residual_time(simulation),
                "run [ms]": 1e3 * wall,
                "residual calls": count,
                "per call [us]": 1e6 * wall / count,
            }
        )
    return rows


def _reset(simulation: cablesim.Simulation) -> cablesim.Simulation:
    simulation.reset()
    return simulation


# Parts of a run -------------------------------------------------------------------------------------


def residual_time(simulation: cablesim.Simulation) -> float:
    """Time of one call of the compiled residual from Python [us]."""
    simulation.reset()
    y, yp = simulation.state
    out = np.empty_like(y)
    y.flags.writeable = yp.flags.writeable = False
    model = simulation.model
    return 1e3 * best_time(lambda: [model.residual(0.1, y, yp, out) for _ in range(1000)], 5)


def jacobian_time(simulation: cablesim.Simulation) -> float:
    """Time of one call of the compiled Jacobian from Python [us]."""
    simulation.reset()
    y, yp = simulation.state
    matrix = np.zeros((y.size, y.size))
    y.flags.writeable = yp.flags.writeable = False
    model = simulation.model
    return 1e4 * best_time(lambda: [model.jacobian(0.1, y, yp, 100.0, matrix) for _ in range(100)], 5)


def python_time() -> float:
    """Time of a call of a compiled function that does nothing, through the same two Python functions [us]."""
    small = long_rope(3)
    return residual_time(cablesim.Simulation(small))


def idle_call(size: int, bandwidths: tuple[int, int]) -> float:
    """Time of a call of IDA's band solver when the equations are next to nothing [us]."""
    count = 0

    def residual(t: float, y: np.ndarray, yp: np.ndarray, out: np.ndarray) -> None:
        nonlocal count
        count += 1
        np.add(y, yp, out=out)
        out -= np.sin(5.0 * t)

    def jacobian(_t, _y, _yp, _res, c_j, matrix) -> None:
        np.fill_diagonal(matrix, 1.0 + c_j)

    lower, upper = bandwidths
    solver = IDA(
        residual,
        linsolver="band",
        lband=lower,
        uband=upper,
        jacfn=jacobian,
        max_order=2,
        rtol=1e-4,
        max_num_steps=10**6,
    )
    started = time.perf_counter()
    solver.solve(np.array([0.0, 20.0]), np.zeros(size), np.zeros(size))
    return 1e6 * (time.perf_counter() - started) / count


def parts(repeats: int) -> list[dict[str, Any]]:
    """Where the time of S1 goes at default settings, without output frames."""
    wall, simulation = integration(gallery("sway"), repeats)
    residual_calls, jacobian_calls = calls(simulation)
    dispatch = python_time()
    size, bandwidths = simulation.model.layout.size, simulation.model.bandwidths
    banded, diagonal = (min(idle_call(size, widths) for _ in range(3)) for widths in (bandwidths, (0, 0)))
    kernels = residual_calls * (residual_time(simulation) - dispatch)
    kernels += jacobian_calls * (jacobian_time(simulation) - dispatch)
    python = (residual_calls + jacobian_calls) * dispatch
    algebra = residual_calls * (banded - diagonal)
    rest = 1e6 * wall - kernels - python - algebra
    shares = {
        "compiled residual and Jacobian": kernels,
        "their calls from Python": python,
        "linear algebra (a band of this width against a diagonal)": algebra,
        "rest: IDA's vectors, scikit-sundae's arrays, the loop": rest,
    }
    return [
        {"part": name, "ms": share / 1e3, "%": 100 * share / (1e6 * wall)} for name, share in shares.items()
    ]


def main() -> None:
    """Print all tables."""
    arguments = parser(__doc__)
    arguments.add_argument("--one", nargs=2, metavar=("SEGMENTS", "SOLVER"), help="measure one size, as JSON")
    options = arguments.parse_args()
    if options.one:
        print(json.dumps(measure(int(options.one[0]), options.one[1])))
        return
    evidence = Evidence(__file__, __doc__, options)
    repeats = 5 if options.small else 15
    rows = [measured_apart(size, "auto") for size in (SMALL_SIZES if options.small else SIZES)]
    evidence.table(rows, "growth with the mesh, 5 cm segments, 10 s")
    text = "power of the number of segments with which the time of a call grows"
    evidence.claim(text, exponent(rows, "per call [us]"))
    rows = [
        measured_apart(size, solver)
        for size in ((60,) if options.small else (60, 125, 250, 428, 500, 1000))
        for solver in ("band", "krylov")
    ]
    evidence.table(rows, "band solver against Krylov solver with an exact preconditioner")
    rows = skip_rows(repeats)
    evidence.table(rows, "what the skips of a case gain together (rtol 1e-6)")
    text = "largest difference that the skips make, rtol 1e-6"
    evidence.claim(text, 1e3 * max(row["largest difference [m]"] for row in rows), "mm", at_most=0.05)
    evidence.table(one_feature_rows(repeats), "what each feature costs when it does nothing")
    evidence.table(parts(repeats), "where the time of S1 goes (defaults, no frames)")


if __name__ == "__main__":
    main()
