"""Run time against error: tolerances 1e-2 to 1e-7, three meshes, skips on and off, orders 2 and 5, damping.

Scenes S1, S3 and the V-system (the short version leaves it out); the error is the RMS distance of markers
from a converged run of the finest mesh.
Prints a table, writes it as CSV and draws one picture; the defaults of cablesim follow from it.
"""

from __future__ import annotations

from common import CASES, Evidence, output_folder, parser, write_csv  # isort: skip - sets the threads

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import cablesim
from cablesim.scene import Numerics, Scene

DEFAULT = Numerics().relative_tolerance
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, DEFAULT, 1e-6, 1e-7)
REFINEMENTS = (1, 2, 4)  # segments of a case are divided by these
TIME_LIMIT = 10.0  # [s] of one run; undamped waves at order 5 take longer
COMPARED = 50  # times at which positions are compared


@dataclass(frozen=True)
class Subject:
    """A scene to be measured: a case, its duration [s], its coarsest segments [m].

    `undamped`: whether a converged run without structural damping takes a bearable time.
    """

    case: str
    label: str
    duration: float
    segment_length: float
    undamped: bool = True

    def scene(self, refinement: int, **changes: Any) -> Scene:
        """The case on a finer mesh, with other settings; `damping` is the structural one [s]."""
        scene = cablesim.build_scene(cablesim.load_case(CASES / f"{self.case}.yaml"))
        damping = changes.pop("damping", None)
        cable = scene.cable if damping is None else replace(scene.cable, structural_damping=damping)
        refinements = tuple(
            replace(r, segment_length=2 * r.segment_length / refinement) for r in scene.mesh.refinements
        )
        return replace(
            scene,
            cable=cable,
            duration=self.duration,
            mesh=replace(
                scene.mesh, segment_length=self.segment_length / refinement, refinements=refinements
            ),
            numerics=replace(scene.numerics, time_limit=TIME_LIMIT, **changes),
            output=replace(
                scene.output,
                interval=self.duration / COMPARED,
                variables=("marker_position",),
                markers=np.linspace(0.0, scene.cable.length, 16),
            ),
        )


SUBJECTS = (
    Subject("sway", "S1", 10.0, 0.1),
    Subject("pendulum", "S3", 6.0, 0.1),
    Subject("v_rest", "V-system", 10.0, 0.1, undamped=False),
)

# name -> settings that differ from the defaults
VARIANTS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "no skips": {"skip": False},
    "order 5": {"max_order": 5},
    "no damping": {"damping": 0.0},
    "order 5, no damping": {"max_order": 5, "damping": 0.0},
}


def reference(subject: Subject, finest: int, **physics: Any) -> np.ndarray:
    """Marker positions (time, marker, 3) of a run that is converged."""
    scene = subject.scene(2 * finest, relative_tolerance=1e-7, **physics)
    run = cablesim.simulate(replace(scene, numerics=replace(scene.numerics, time_limit=None)))
    return run.marker_position.values


def measure(scene: Scene, exact: np.ndarray) -> dict[str, Any]:
    """Shortest of three integrations, calls and error."""
    simulation = cablesim.Simulation(scene)
    walls = []
    for _ in range(3):
        simulation.reset()
        run = simulation.run()
        walls.append(float(run.attrs["wall_seconds"]))
        if walls[-1] > 1.0:
            break
    finished = run.attrs["status"] == "completed"
    found = run.marker_position.values
    error = float(1e3 * np.sqrt(((found - exact) ** 2).sum(axis=-1).mean())) if finished else np.nan
    return {
        "wall [ms]": 1e3 * min(walls),
        "residual calls": int(run.attrs["residual_calls"]),
        "RMS [mm]": error,
        "status": run.attrs["status"],
    }


def sweep(
    subject: Subject, tolerances: tuple[float, ...], refinements: tuple[int, ...]
) -> list[dict[str, Any]]:
    """All variants of a subject; what converges to another answer (damping) has its own reference."""
    rows = []
    damped = reference(subject, refinements[-1])
    undamped = reference(subject, refinements[-1], damping=0.0) if subject.undamped else None
    for name, refinement in itertools.product(VARIANTS, refinements):
        settings = VARIANTS[name]
        if settings.get("damping") == 0.0 and undamped is None:
            continue
        exact = undamped if settings.get("damping") == 0.0 else damped
        for rtol in tolerances:
            scene = subject.scene(refinement, relative_tolerance=rtol, **settings)
            rows.append(
                {
                    "scene": subject.label,
                    "variant": name,
                    "segment [cm]": 100 * scene.mesh.segment_length,
                    "rtol": rtol,
                    **measure(scene, exact),
                }
            )
    return rows


def draw(rows: list[dict[str, Any]], file: Path) -> None:
    """One panel a scene and mesh; one line a variant; a dot a tolerance."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    meshes = {
        s: list(dict.fromkeys(row["segment [cm]"] for row in rows if row["scene"] == s)) for s in scenes
    }
    columns = max(len(found) for found in meshes.values())
    figure, axes = plt.subplots(
        len(scenes),
        columns,
        figsize=(4.2 * columns, 3.4 * len(scenes)),
        layout="constrained",
        squeeze=False,
        sharex=True,
        sharey="row",
    )
    for (i, scene), k in itertools.product(enumerate(scenes), range(columns)):
        panel = axes[i, k]
        for name in VARIANTS:
            mine = [
                row
                for row in rows
                if (row["scene"], row["variant"], row["segment [cm]"]) == (scene, name, meshes[scene][k])
            ]
            style = {"lw": 2.2, "zorder": 3} if name == "defaults" else {"lw": 1.0}
            panel.loglog(
                [r["RMS [mm]"] for r in mine], [r["wall [ms]"] for r in mine], "o-", ms=3, label=name, **style
            )
            default = [r for r in mine if name == "defaults" and r["rtol"] == DEFAULT]
            panel.loglog(
                [r["RMS [mm]"] for r in default], [r["wall [ms]"] for r in default], "ks", ms=7, mfc="none"
            )
        panel.set_title(f"{scene}, segments of {meshes[scene][k]:g} cm", fontsize=10)
        lost = [
            r
            for r in rows
            if (r["scene"], r["segment [cm]"]) == (scene, meshes[scene][k]) and np.isnan(r["RMS [mm]"])
        ]
        counts = {name: sum(r["variant"] == name for r in lost) for name in VARIANTS}
        text = "\n".join(f"{name}: {n} not finished in {TIME_LIMIT:g} s" for name, n in counts.items() if n)
        panel.text(0.98, 0.5, text, transform=panel.transAxes, ha="right", fontsize=7, color="0.3")
        panel.grid(which="major", alpha=0.3)
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.yaxis.set_minor_formatter(NullFormatter())
        if i == len(scenes) - 1:
            panel.set_xlabel("RMS error [mm]")
        if k == 0:
            panel.set_ylabel("run time [ms]")
    axes[0, -1].legend(fontsize=8, title=f"square: default, rtol {DEFAULT:g}", title_fontsize=8)
    figure.savefig(file, dpi=130)
    print(f"wrote {file}")


def main() -> None:
    """Measure, print, write and draw."""
    options = parser(__doc__).parse_args()
    tolerances = TOLERANCES[:4:2] if options.small else TOLERANCES
    refinements = (1, 2) if options.small else REFINEMENTS
    evidence = Evidence(__file__, __doc__, options)
    rows = []
    for subject in SUBJECTS[:2] if options.small else SUBJECTS:
        found = sweep(subject, tolerances, refinements)
        evidence.table([row for row in found if row["variant"] == "defaults"], f"{subject.label}, defaults")
        rows += found
    folder = output_folder(options.output)
    write_csv(folder / "work_precision.csv", rows)
    draw(rows, folder / "work_precision.png")


if __name__ == "__main__":
    main()
