"""Every case of the gallery at its own settings against its converged run in `validation/recorded`.

The converged runs are ours: segments a quarter of the case's, relative tolerance 1e-7. Each file states by
how much it changes from segments of half the case's; at order 2 its own mesh error is a third of that.
`--remake` computes them again (some ten minutes): needed when a case or the physics changes.
"""

from __future__ import annotations

from common import CASES, RECORDED, Evidence, parser  # isort: skip - sets the threads

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import cablesim
from cablesim.scene import Scene

NAMES = tuple(sorted(file.stem for file in CASES.glob("*.yaml")))
TIMES, MARKERS = 50, 16
TOLERANCE = 1e-7
UNTIL = {"pendulum_vacuum": 0.82}  # [s]; then its free end whips, and what follows depends on every detail


# what a case at its own settings keeps: the quantities, and a bound for each just above what was found
QUANTITIES = ("RMS [mm]", "force at A, RMS %", "at B, RMS %")
BOUNDS = {
    "buoy_from_drum": (11.0, 2.7, 2.9),
    "cable6_run0024": (0.31, 2.1, 1.8),
    "dive": (4.8, 0.5, 1.9),
    "kinked_v": (0.03, 0.12, 0.17),
    "long_cable": (0.39, 0.88, 0.39),
    "moonpool_heave": (0.02, 0.0, 0.83),
    "pendulum": (0.088, 0.021, 0.0),
    "pendulum_vacuum": (0.23, 0.35, 0.0),
    "round_trip": (6.1, 0.6, 2.0),
    "sheared_current": (0.74, 0.063, 0.062),
    "sway": (0.11, 0.078, 0.099),
    "tow": (3.4, 0.053, 0.0),
    "turn": (6.8, 0.78, 3.0),
    "v_rest": (0.33, 12.0, 13.0),
    "winch_cycle": (0.18, 0.015, 0.037),
}


def scene(name: str, refinement: int = 1, rtol: float | None = None) -> Scene:
    """A case of the gallery with markers and end forces at fifty times, on a refined mesh if asked."""
    base = cablesim.build_scene(cablesim.load_case(CASES / f"{name}.yaml"))
    mesh = replace(
        base.mesh,
        segment_length=base.mesh.segment_length / refinement,
        refinements=tuple(
            replace(part, segment_length=part.segment_length / refinement) for part in base.mesh.refinements
        ),
    )
    output = replace(
        base.output,
        interval=base.duration / TIMES,
        variables=("marker_position", "end_force"),
        markers=np.linspace(0.0, base.cable.length, MARKERS),
    )
    numerics = base.numerics if rtol is None else replace(base.numerics, relative_tolerance=rtol)
    return replace(base, mesh=mesh, numerics=numerics, output=output)


def difference(name: str, run: xr.Dataset, exact: xr.Dataset) -> dict[str, float]:
    """How far a run is from another: markers [mm], RMS and most; force at A and B, RMS in % of its range.

    A free end has no force.
    """
    run, exact = (data.sel(time=slice(0.0, UNTIL.get(name))) for data in (run, exact))
    squares = ((run["marker_position"].values - exact["marker_position"].values) ** 2).sum(axis=-1)
    both = squares[np.isfinite(squares)]
    found, wanted = (np.linalg.norm(data["end_force"].values, axis=-1) for data in (run, exact))
    rms, span = np.sqrt(np.mean((found - wanted) ** 2, axis=0)), np.ptp(wanted, axis=0)
    ends = (scene(name).end_a, scene(name).end_b)
    share = [
        0.0 if end.motion is None else 100 * float(r / s) for end, r, s in zip(ends, rms, span, strict=True)
    ]
    return {
        "RMS [mm]": 1e3 * float(np.sqrt(both.mean())),
        "max [mm]": 1e3 * float(np.sqrt(both.max())),
        "force at A, RMS %": share[0],
        "at B, RMS %": share[1],
    }


def recording(name: str) -> Path:
    """Where the converged run of a case is kept."""
    return RECORDED / f"gallery_{name}.nc"


def compare(name: str) -> dict[str, Any]:
    """A row: the case at its own settings against its converged run."""
    run = cablesim.simulate(scene(name))
    with xr.open_dataset(recording(name)) as exact:
        return {"case": name, "calls": run.attrs["residual_calls"], **difference(name, run, exact)}


def remake(name: str) -> None:
    """Compute and keep the converged run of a case."""
    half, quarter = (cablesim.simulate(scene(name, refinement, TOLERANCE)) for refinement in (2, 4))
    for run in (half, quarter):
        if run.attrs["status"] != "completed":
            raise SystemExit(f"{name}: {run.attrs['message']}")
    change = difference(name, half, quarter)
    kept = quarter[["marker_position", "end_force"]]
    kept = kept.drop_vars(set(kept.coords) - {"time", "end", "axis"})
    kept.attrs = {
        "title": f"cases/{name}.yaml, converged: segments a quarter of the case's",
        "segment_length": scene(name, 4).mesh.segment_length,
        "relative_tolerance": TOLERANCE,
        "change_from_half [mm, RMS]": change["RMS [mm]"],
    }
    span = float(np.nanmax(np.abs(kept["marker_position"].values)))
    encoding = {
        "marker_position": {"dtype": "i4", "scale_factor": span * 5e-7, "_FillValue": -(2**31)},
        "end_force": {"dtype": "f4"},
    }
    kept.to_netcdf(recording(name), format="NETCDF3_CLASSIC", encoding=encoding)  # the smallest of its forms
    print(f"{name}: {recording(name).stat().st_size / 1024:.0f} kB, {change}", flush=True)


def main() -> None:
    """Compare all cases, or compute what they are compared with."""
    arguments = parser(__doc__)
    arguments.add_argument("--remake", nargs="*", metavar="CASE", help="compute these again (default: all)")
    options = arguments.parse_args()
    if options.remake is not None:
        for name in options.remake or NAMES:
            remake(name)
        return
    evidence = Evidence(__file__, __doc__, options)
    rows = [compare(name) for name in NAMES]
    evidence.table(rows, "the gallery at its own settings")
    for row in rows:
        text = f"{row['case']}: RMS of the markers from its converged run"
        evidence.claim(text, row[QUANTITIES[0]], "mm", at_most=BOUNDS[row["case"]][0])


if __name__ == "__main__":
    main()
