"""Accuracy against an independent code: scenes S1, S3 and S3v, energy, order in space, slope in tolerance.

Needs the recordings of the peers (see `common.RECORDINGS`); the orders are from our own runs, also of a V
that kinks at its bodies.
"""

from __future__ import annotations

from common import CASES, RECORDINGS, parser, print_table  # isort: skip - sets the threads

from dataclasses import replace
from itertools import pairwise

import numpy as np
import xarray as xr

import cablesim
from cablesim.scene import MeshRules, Scene

SCENES = {"S1": "sway", "S3": "pendulum", "S3v": "pendulum_vacuum", "kinked V": "kinked_v"}


def scene(name: str, *, segment_length: float | None = None, rtol: float | None = None) -> Scene:
    """A gallery case with another mesh or tolerance."""
    result = cablesim.build_scene(cablesim.load_case(CASES / f"{SCENES[name]}.yaml"))
    if segment_length is not None:
        result = replace(result, mesh=MeshRules(segment_length=segment_length))
    if rtol is not None:
        result = replace(result, numerics=replace(result.numerics, relative_tolerance=rtol))
    return result


def markers(name: str, **changes: float) -> np.ndarray:
    """Marker positions (time, marker, 3) of a run."""
    return cablesim.simulate(scene(name, **changes)).marker_position.values


def rms(a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square distance over markers and times [mm]."""
    return 1e3 * float(np.sqrt(((a - b) ** 2).sum(axis=-1).mean()))


def against_peer(name: str, until: float = np.inf, **changes: float) -> float:
    """RMS marker distance from the peer's finest run [mm]."""
    peer = xr.open_dataset(RECORDINGS / "peers" / f"moordyn_{name}_ref.nc")
    early = peer.time.values <= until + 1e-9
    return rms(markers(name, **changes)[early], peer.pos.values[early])


def peer_rows() -> list[dict[str, object]]:
    """Differences from the independent code, with the bound that each has to meet."""
    runs = [
        ("S1", "5 cm, rtol 1e-6", 0.10, {"segment_length": 0.05, "rtol": 1e-6}),
        ("S3", "5 cm, rtol 1e-6", 0.075, {"segment_length": 0.05, "rtol": 1e-6}),
        ("S3v", "5 cm, rtol 1e-6, to 0.82 s", 0.29, {"segment_length": 0.05, "rtol": 1e-6, "until": 0.82}),
        ("S1", "1.25 cm, rtol 1e-6", 0.05, {"segment_length": 0.0125, "rtol": 1e-6}),
        ("S1", "defaults", 0.5, {}),
        ("S3", "defaults", 0.5, {}),
    ]
    return [
        {"scene": name, "settings": text, "RMS [mm]": against_peer(name, **changes), "bound [mm]": bound}
        for name, text, bound, changes in runs
    ]


def energy_rows() -> list[dict[str, object]]:
    """Largest change of energy of the rope swinging in vacuum."""
    rows = []
    for rtol, bound in ((1e-4, 1e-3), (1e-5, 3e-4)):
        run = cablesim.simulate(scene("S3v", rtol=rtol))
        energy = (run.kinetic_energy + run.potential_energy + run.elastic_energy).values
        change = float(np.abs(energy - energy[0]).max())
        swing = float(np.ptp(run.potential_energy.values))
        relative = change / abs(energy[0])
        rows.append({"rtol": rtol, "of |E(0)|": relative, "bound": bound, "of the swing": change / swing})
    return rows


def order_rows(lengths: tuple[float, ...]) -> list[dict[str, object]]:
    """Order in space from three meshes each, tolerance out of the way (Richardson)."""
    rows = []
    for name in ("S1", "S3", "kinked V"):
        runs = [markers(name, segment_length=length, rtol=1e-8) for length in lengths]
        steps = [rms(a, b) for a, b in pairwise(runs)]
        for k in range(len(steps) - 1):
            order = float(np.log2(steps[k] / steps[k + 1]))
            meshes = " / ".join(f"{100 * h:g}" for h in lengths[k : k + 3])
            rows.append(
                {
                    "scene": name,
                    "meshes [cm]": meshes,
                    "last step [mm]": steps[k + 1],
                    "order": round(order, 3),
                }
            )
    return rows


def tolerance_rows() -> list[dict[str, object]]:
    """Error against tolerance over four decades, on one mesh."""
    rows = []
    for name in ("S1", "S3"):
        exact = markers(name, rtol=1e-8)
        errors = [rms(markers(name, rtol=rtol), exact) for rtol in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)]
        slope = float(np.polyfit(np.arange(5.0), -np.log10(errors), 1)[0])
        texts = {f"1e-{k}": float(e) for k, e in enumerate(errors, start=2)}
        rows.append({"scene": name, **texts, "slope": round(slope, 2)})
    return rows


def main() -> None:
    """Print all tables."""
    options = parser(__doc__).parse_args()
    if (RECORDINGS / "peers").is_dir():
        print_table(peer_rows(), "difference from the independent code")
    else:
        print(f"no recordings at {RECORDINGS}: the comparison with the independent code is left out")
    print_table(energy_rows(), "energy of the rope in vacuum, largest change over 3 s")
    lengths = (0.2, 0.1, 0.05) if options.small else (0.2, 0.1, 0.05, 0.025, 0.0125)
    print_table(order_rows(lengths), "order in space")
    print_table(tolerance_rows(), "RMS error [mm] against tolerance, same mesh")


if __name__ == "__main__":
    main()
