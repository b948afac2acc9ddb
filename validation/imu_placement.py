"""How many sensors the V-system needs, and where: errors of layouts over manoeuvres of the vehicle.

Runs the paper's round trip, turn and dive (the short version the turn alone) with a plant that is not what
the estimators believe (another mesh, stiffness, lift, places and drag), puts virtual IMUs at candidate places
every 2 cm, and compares layouts of 2 to 7 of them: exact ones, the paper's BMX160, and the same calibrated;
then it moves the sensors to better places.  Distances come raw, with their offset taken once at rest, and
from weights that were calibrated on the dive as believed.  Keeps a table, writes all runs as CSV, draws a
picture.
"""

from __future__ import annotations

from common import Evidence, output_folder, parser, write_csv  # isort: skip - sets the threads

from typing import Any

import numpy as np
import xarray as xr
from plants import SEVERAL, believed, plant

import cablesim
from cablesim.sensors.placement import (
    KINDS,
    StudyRun,
    compare_layouts,
    improve_layout,
    plot_layouts,
    prepare_run,
)

RUNS = ("round_trip", "turn", "dive")

# fractions of an arm from the ballast, to both sides; 0 is the ballast, 1 a buoy
LAYOUTS = {
    "2: arm middles": [0.5],
    "2: near the ballast": [0.25],
    "3: ballast, arm middles": [0, 0.5],
    "3: ballast, buoys": [0, 1],
    "4: arm middles, buoys": [0.5, 1],
    "4: spread": [0.2, 0.75],
    "5: the paper's": [0, 0.5, 1],
    "5: nearer the ballast": [0, 0.25, 0.8],
    "6: spread": [0.15, 0.5, 1],
    "7: spread": [0, 0.2, 0.5, 1],
}
STARTS = {2: [0.25], 3: [0, 0.3], 4: [0.2, 0.75], 5: [0, 0.25, 0.8], 6: [0.15, 0.5, 1], 7: [0, 0.2, 0.5, 1]}


def places(run: StudyRun, fractions: list[float]) -> np.ndarray:
    """Material coordinates of a symmetric layout [m]."""
    first, last = run.places[[0, -1]]
    middle, arm = 0.5 * (first + last), 0.5 * (last - first)
    return np.unique([middle + sign * arm * f for f in fractions for sign in (-1, 1)])


def rows_of(compared: xr.DataArray) -> list[dict[str, Any]]:
    """One row a layout, run and kind of sensors."""
    rows = []
    for layout in compared["layout"].values:
        for run in compared["run"].values:
            for kind in compared["sensors"].values:
                found = compared.sel(layout=layout, run=run, sensors=kind)
                rms, most = (found.sel(statistic=name) for name in ("rms", "max"))
                rows.append(
                    {
                        "layout": str(layout),
                        "s [m]": str(found["places"].item()),
                        "run": str(run),
                        "sensors": str(kind),
                        "d [mm]": 1e3 * float(rms.sel(quantity="distance")),
                        "d, rest [mm]": 1e3 * float(rms.sel(quantity="distance at rest")),
                        "d, rest, max [mm]": 1e3 * float(most.sel(quantity="distance at rest")),
                        "(9) [mm]": 1e3 * float(rms.sel(quantity="straight arms")),
                        "(9), rest [mm]": 1e3 * float(rms.sel(quantity="straight arms at rest")),
                        "weights [mm]": 1e3 * float(rms.sel(quantity="weights")),
                        "weights, rest [mm]": 1e3 * float(rms.sel(quantity="weights at rest")),
                        "curv. RMS [1/m]": float(rms.sel(quantity="curvature")),
                        "curv. max [1/m]": float(most.sel(quantity="curvature")),
                        "curv. (11) RMS [1/m]": float(rms.sel(quantity="neighbours")),
                        "turn RMS [deg]": np.degrees(float(rms.sel(quantity="turning"))),
                        "turn max [deg]": np.degrees(float(most.sel(quantity="turning"))),
                        "pull RMS [mN]": 1e3 * float(rms.sel(quantity="pull")),
                        "pull max [mN]": 1e3 * float(most.sel(quantity="pull")),
                        "wrong way [%]": 100.0 * float(rms.sel(quantity="wrong direction")),
                    }
                )
    return rows


def main() -> None:
    """Compare layouts, search better ones, draw."""
    options = parser(__doc__).parse_args()
    evidence, folder = Evidence(__file__, __doc__, options), output_folder(options.output)
    names = ("turn",) if options.small else RUNS
    step = 0.05 if options.small else 0.02
    runs = []
    for name in names:
        trajectory = cablesim.simulate(plant(name, **SEVERAL))
        print(f"{name}: {trajectory.attrs['status']}, {float(trajectory.time[-1]):g} s")
        runs.append(prepare_run(trajectory, case=believed(name), step=step))
    calibration = prepare_run(cablesim.simulate(believed("dive")), case=believed("dive"), step=step)
    layouts = {name: places(runs[0], fractions) for name, fractions in LAYOUTS.items()}
    if options.small:
        layouts = {name: layouts[name] for name in ("2: arm middles", "5: the paper's")}
    for count, fractions in STARTS.items():
        if options.small and count != 3:
            continue
        best = improve_layout(
            runs, places(runs[0], fractions), sensors=KINDS["calibrated"], sweeps=1 if options.small else 3
        )
        layouts[f"{count}: searched"] = np.array(best.places)
    compared = compare_layouts(runs, layouts, calibration=calibration)
    rows = rows_of(compared)
    mean = compared.mean("run").expand_dims(run=["mean of runs"]).transpose(*compared.dims)
    evidence.table(
        rows_of(mean),
        "Layouts of IMUs, RMS errors, mean over the runs",
        "The plant differs from what the estimators believe: "
        + ", ".join(f"{name} {value:g}" for name, value in SEVERAL.items())
        + ", a mesh of 2.5 cm instead of 5.",
    )
    write_csv(folder / "imu_placement.csv", rows)
    figure = plot_layouts(compared, layouts)
    figure.savefig(folder / "imu_placement.png")
    print(f"wrote {folder / 'imu_placement.png'}")


if __name__ == "__main__":
    main()
