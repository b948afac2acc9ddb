"""Compute the trajectories `validation/recorded/moordyn_*.nc` again with MoorDyn 2.7.2 (some six minutes).

Segments of 1.25 cm, Runge-Kutta of order 4 at 25 us, no damping, end B moved every 0.5 ms: the mesh error is
a sixteenth of what segments of 5 cm have. In the winch scene MoorDyn stretches all segments instead of
feeding material at B, so there it is not the same problem to the last millimetre.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import moordyn_scenes as peer
import numpy as np
import xarray as xr

SETTINGS = {"segment_length": 0.0125, "scheme": "rk4", "time_step": 2.5e-5, "coupling_interval": 5e-4}
PACKED = {
    "dtype": "i4",
    "scale_factor": 1e-6,  # a micrometre
    "_FillValue": -(2**31),
    "zlib": True,
    "complevel": 9,
    "shuffle": True,
}


def recording(scene: str) -> xr.Dataset:
    """Marker positions of a scene, with everything that defines it."""
    setting = peer.SCENES[scene]
    run = peer.run_scene(scene, **SETTINGS)
    times = np.arange(len(run.positions)) * peer.OUTPUT_INTERVAL
    velocity, payout = (
        np.array(table or ((0.0,) * 2,), float) for table in (setting.velocity, setting.payout)
    )
    return xr.Dataset(
        {
            "marker_position": (
                ("time", "marker", "axis"),
                run.positions,
                {"units": "m", "long_name": "markers equally spaced in unstretched length"},
            ),
            "end_b_velocity": (("corner", "axis"), velocity[:, 1:], {"units": "m s-1"}),
            "payout_speed": (("payout_corner",), payout[:, 1], {"units": "m s-1"}),
        },
        coords={
            "time": ("time", times, {"units": "s"}),
            "axis": ["x", "y", "z"],
            "corner": ("corner", velocity[:, 0], {"units": "s"}),
            "payout_corner": ("payout_corner", payout[:, 0], {"units": "s"}),
        },
        attrs={
            "title": f"scene {scene}, computed with MoorDyn 2.7.2",
            "length": peer.LENGTH,
            "diameter": peer.DIAMETER,
            "mass_per_length": peer.MASS_PER_LENGTH,
            "axial_stiffness": peer.STIFFNESS,
            "water_density": setting.water_density,
            "span": np.nan if setting.span is None else setting.span,
            **SETTINGS,
        },
    )


def main() -> None:
    """Write a file a scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=list(peer.SCENES), help="names of scenes (default: all)")
    parser.add_argument("-o", "--output", type=Path, default=peer.RECORDED)
    options = parser.parse_args()
    for scene in options.scenes:
        data = recording(scene)
        file = options.output / f"moordyn_{scene}.nc"
        data.to_netcdf(file, encoding={"marker_position": PACKED})
        print(f"wrote {file}, {file.stat().st_size / 1024:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
