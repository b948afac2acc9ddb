"""Default tolerances: their error against that of the mesh, in the gallery and in three harder scenes.

Tolerance error: from a run of the same mesh at rtol 1e-7. Mesh error: of that run, four thirds of its change
when segments are halved. Tension: that of the held ends, and of free ends that carry a body, RMS in % of its
range. The candidates are other tolerances and other weights: absolute tolerance of velocity over rtol and the
scene's speed, and of tension over rtol and what an axial wave of that speed carries.
"""

from __future__ import annotations

from common import CASES, Evidence, parser  # isort: skip - sets the threads

from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import xarray as xr

import cablesim
from cablesim.physics import scales
from cablesim.scene import Numerics, Scene

HARDER = Path(__file__).resolve().parent / "scenes"
GALLERY = tuple(sorted(file.stem for file in CASES.glob("*.yaml")))
NAMED = tuple(sorted(file.stem for file in HARDER.glob("*.yaml")))
SMALL = ("pendulum", "sway", "turn", "heaved_load")
UNTIL = {"pendulum_vacuum": 0.82}  # [s]; then its free end whips
TIGHT = 1e-7
NO_TENSION = 0.02  # of the range at the other end: a free end
ABOUT_NOTHING = 1e-6  # of the cable's length: mesh errors below that are those of a straight cable


@dataclass(frozen=True)
class Candidate:
    """Settings to be judged."""

    rtol: float = Numerics().relative_tolerance
    velocity: float = scales.VELOCITY_FACTOR
    wave: float = scales.WAVE_FACTOR


DEFAULT = Candidate()
CANDIDATES = (
    Candidate(rtol=1e-4),
    Candidate(rtol=3e-5),
    Candidate(rtol=1e-5),
    DEFAULT,
    Candidate(rtol=2e-6),
    Candidate(velocity=8.0),
    Candidate(velocity=0.5),
    Candidate(wave=40.0),
    Candidate(wave=1.0),
)


def scene(name: str, candidate: Candidate, refinement: int = 1) -> Scene:
    """A scene with markers and end tensions, at the candidate's tolerance."""
    folder = CASES if name in GALLERY else HARDER
    base = cablesim.build_scene(cablesim.load_case(folder / f"{name}.yaml"))
    refinements = tuple(
        replace(part, segment_length=part.segment_length / refinement) for part in base.mesh.refinements
    )
    return replace(
        base,
        duration=UNTIL.get(name, base.duration),
        mesh=replace(
            base.mesh, segment_length=base.mesh.segment_length / refinement, refinements=refinements
        ),
        numerics=replace(base.numerics, relative_tolerance=candidate.rtol),
        output=replace(
            base.output,
            interval=min(base.output.interval, UNTIL.get(name, base.duration) / 100),
            variables=("marker_position", "end_tension"),
            markers=np.linspace(0.0, base.cable.length, 21),
        ),
    )


def run(name: str, candidate: Candidate, refinement: int = 1) -> xr.Dataset:
    """The trajectory; a run that stops early ends the evidence."""
    with patch.multiple(scales, VELOCITY_FACTOR=candidate.velocity, WAVE_FACTOR=candidate.wave):
        found = cablesim.simulate(scene(name, candidate, refinement))
    if found.attrs["status"] != "completed":
        raise SystemExit(f"{name}: {found.attrs['message']}")
    return found


def distance(one: xr.Dataset, other: xr.Dataset) -> float:
    """RMS distance of the markers that are out [mm]."""
    squares = ((one.marker_position.values - other.marker_position.values) ** 2).sum(axis=-1)
    return 1e3 * float(np.sqrt(np.nanmean(squares)))


def tension_error(found: xr.Dataset, exact: xr.Dataset) -> float:
    """RMS error of the end tension over its range, at the worse end [%]."""
    wanted = exact.end_tension.values
    span = np.ptp(wanted, axis=0)
    rms = np.sqrt(((found.end_tension.values - wanted) ** 2).mean(axis=0))
    carries = span > NO_TENSION * span.max()
    return 100.0 * float((rms[carries] / span[carries]).max())


@dataclass(frozen=True)
class Judge:
    """The converged run of a scene on its own mesh, and the error of that mesh [mm]."""

    name: str
    exact: xr.Dataset
    mesh_error: float

    @classmethod
    def of(cls, name: str) -> Judge:
        """Compute both."""
        exact, finer = (run(name, Candidate(rtol=TIGHT), refinement) for refinement in (1, 2))
        return cls(name, exact, 4.0 / 3.0 * distance(exact, finer))

    def row(self, candidate: Candidate) -> dict[str, str | float]:
        """What a candidate reaches in this scene."""
        found = run(self.name, candidate)
        return {
            "scene": self.name,
            "mesh [mm]": self.mesh_error,
            "tolerance [mm]": distance(found, self.exact),
            "tension [%]": tension_error(found, self.exact),
            "calls": int(found.attrs["residual_calls"]),
        }


def summary(candidate: Candidate, rows: list[dict], default: list[dict]) -> dict[str, str | float]:
    """A candidate over all scenes: the worst of each error, and the cost."""
    ratio = [row["tolerance [mm]"] / row["mesh [mm]"] for row in rows]
    tension = [row["tension [%]"] for row in rows]
    cost = [row["calls"] / usual["calls"] for row, usual in zip(rows, default, strict=True)]
    return {
        "rtol": candidate.rtol,
        "velocity": candidate.velocity,
        "tension": candidate.wave,
        "below the mesh error": f"{sum(value < 1.0 for value in ratio)} of {len(rows)}",
        "tolerance over mesh, median": float(np.median(ratio)),
        "worst tension [%]": max(tension),
        "in": rows[int(np.argmax(tension))]["scene"],
        "calls, of the default's": float(np.exp(np.mean(np.log(cost)))),
    }


def claim(evidence: Evidence, row: dict, length: float) -> None:
    """The two bounds of a scene of the gallery."""
    straight = row["mesh [mm]"] < 1e3 * ABOUT_NOTHING * length
    evidence.claim(
        f"{row['scene']}: tolerance error of places over mesh error",
        row["tolerance [mm]"] / row["mesh [mm]"],
        at_most=1.0,
        missed="the mesh error of a straight cable is below a millionth of its length" if straight else "",
    )
    evidence.claim(f"{row['scene']}: tolerance error of tension", row["tension [%]"], "%", at_most=1.0)


def main() -> None:
    """Judge the default, then the other candidates."""
    options = parser(__doc__).parse_args()
    evidence = Evidence(__file__, __doc__, options)
    judges = [Judge.of(name) for name in (SMALL if options.small else GALLERY + NAMED)]
    usual = [judge.row(DEFAULT) for judge in judges]
    evidence.table(usual, "at default tolerances")
    for judge, row in zip(judges, usual, strict=True):
        if judge.name in GALLERY:
            claim(evidence, row, scene(judge.name, DEFAULT).cable.length)
    rows = []
    for candidate in CANDIDATES[::3] if options.small else CANDIDATES:
        rows.append(summary(candidate, [judge.row(candidate) for judge in judges], usual))
    evidence.table(rows, "candidates over all these scenes")


if __name__ == "__main__":
    main()
