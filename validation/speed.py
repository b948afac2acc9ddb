"""Speed on scene S1 against MoorDyn at equal error, both on one core and timed in turn in one run.

Needs ``pip install '.[peers]'``. Set-up is left out on both sides: for MoorDyn only its Step calls count, for
cablesim only the integration; neither stores the 500 output frames in the timed runs (a second run of each,
with the same settings, gives the error). cablesim with its frames is shown beside.
"""

from __future__ import annotations

from common import Evidence, parser  # isort: skip - sets the threads

import statistics
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from accuracy import recording, rms, scene

import cablesim
from cablesim.scene import Scene

sys.path.insert(0, str(Path(__file__).parent / "peers"))
from moordyn_scenes import PeerRun, run_scene


@dataclass(frozen=True)
class Ours:
    """A setting of cablesim."""

    segment_length: float
    rtol: float
    axial_stiffness: float = 1e4

    def scene(self) -> Scene:
        """S1 with this setting."""
        base = scene("S1", segment_length=self.segment_length, rtol=self.rtol)
        return replace(base, cable=replace(base.cable, axial_stiffness=self.axial_stiffness))


@dataclass(frozen=True)
class Theirs:
    """A setting of MoorDyn; damping in N s."""

    segment_length: float
    scheme: str
    time_step: float
    axial_damping: float = 0.0
    coupling_interval: float = 0.005
    axial_stiffness: float = 1e4

    def run(self) -> PeerRun:
        """S1 with this setting."""
        return run_scene(
            "S1",
            segment_length=self.segment_length,
            scheme=self.scheme,
            time_step=self.time_step,
            axial_damping=self.axial_damping,
            axial_stiffness=self.axial_stiffness,
            coupling_interval=self.coupling_interval,
        )


# per target: our setting, MoorDyn's fastest with its Runge-Kutta schemes, and with the Euler scheme, which
# with BA = EA dt is the symplectic Euler method and faster still
TARGETS = {
    "0.1 mm": (
        Ours(0.04, 1.75e-4),
        Theirs(0.05, "rk2", 1.22e-4, 0.879),
        Theirs(0.05, "euler", 1.11e-4, 1.17),
    ),
    "0.1 mm, EA 1e6 N": (
        Ours(0.04, 2e-4, axial_stiffness=1e6),
        Theirs(0.05, "rk2", 1.11e-5, 5.86, axial_stiffness=1e6),
        Theirs(0.05, "euler", 1.11e-5, 11.7, coupling_interval=0.001, axial_stiffness=1e6),
    ),
    "1.7 mm": (
        Ours(0.17, 1.5e-3),
        Theirs(0.2, "rk4", 6.45e-4, coupling_interval=0.02),
        Theirs(0.2, "euler", 4.44e-4, 4.69, coupling_interval=0.02),
    ),
}


class Timed:
    """Our integration, with and without the output frames."""

    def __init__(self, ours: Ours) -> None:
        self.with_frames = cablesim.Simulation(ours.scene())
        silent = replace(ours.scene().output, interval=ours.scene().duration)
        self.without_frames = cablesim.Simulation(replace(ours.scene(), output=silent))

    def seconds(self, simulation: cablesim.Simulation, repeats: int) -> float:
        """Shortest of a few integrations."""
        times = []
        for _ in range(repeats):
            simulation.reset()
            times.append(simulation.run().attrs["wall_seconds"])
        return min(times)

    def positions(self) -> np.ndarray:
        """Marker positions (time, marker, 3)."""
        self.with_frames.reset()
        return self.with_frames.run().marker_position.values


def compare(target: str, repeats: int, reference: np.ndarray | None) -> list[dict[str, object]]:
    """Both codes in turn, `repeats` times each; medians."""
    ours, runge_kutta, euler = TARGETS[target]
    timed = Timed(ours)
    walls: dict[str, list[float]] = {"ours": [], "ours with frames": [], "rk": [], "euler": []}
    runs: dict[str, PeerRun] = {}
    for _ in range(repeats):
        walls["ours"].append(timed.seconds(timed.without_frames, 5))
        walls["ours with frames"].append(timed.seconds(timed.with_frames, 5))
        for name, theirs in (("rk", runge_kutta), ("euler", euler)):
            runs[name] = theirs.run()
            walls[name].append(runs[name].wall_seconds)
    middle = {name: statistics.median(values) for name, values in walls.items()}
    # with EA = 1e6 N there is no recorded reference: a converged run of ours stands in
    exact = (
        reference
        if reference is not None
        else Timed(replace(ours, segment_length=0.0125, rtol=1e-7)).positions()
    )
    rows: list[dict[str, object]] = [
        {
            "target": target,
            "code": f"cablesim {100 * ours.segment_length:g} cm, rtol {ours.rtol:g}",
            "wall [ms]": 1e3 * middle["ours"],
            "with frames [ms]": 1e3 * middle["ours with frames"],
            "RMS [mm]": rms(timed.positions(), exact),
            "times slower": 1.0,
        }
    ]
    for name, theirs in (("rk", runge_kutta), ("euler", euler)):
        rows.append(
            {
                "target": target,
                "code": f"MoorDyn {100 * theirs.segment_length:g} cm, {theirs.scheme}",
                "wall [ms]": 1e3 * middle[name],
                "with frames [ms]": "",
                "RMS [mm]": rms(runs[name].positions, exact),
                "times slower": middle[name] / middle["ours"],
            }
        )
    return rows


def main() -> None:
    """Print the table."""
    options = parser(__doc__).parse_args()
    evidence = Evidence(__file__, __doc__, options)
    reference = recording("S1").marker_position.values
    rows: list[dict[str, object]] = []
    for target, (ours, _, _) in TARGETS.items():
        exact = reference if ours.axial_stiffness == 1e4 else None
        rows += compare(target, 1 if options.small else 3, exact)
    evidence.table(rows, "S1, 10 s simulated, one core")
    for row in rows:
        if "MoorDyn" in str(row["code"]):
            text = f"S1 at {row['target']}: times faster than {row['code']}"
            evidence.claim(text, float(row["times slower"]))


if __name__ == "__main__":
    main()
