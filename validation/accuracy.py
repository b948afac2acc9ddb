"""Accuracy against an independent code, energy, order in space and slope in tolerance.

The independent code is MoorDyn 2.7.2 with segments of 1.25 cm (`validation/recorded`). One rope of 3 m: S1,
one end moved 2 m sideways; S2, 2.1 m away and back; S3, released at 45 degrees in water; S3v, the same in
vacuum, compared until its free end whips; and a winch that pays out 0.8 m and reels it in again, where
MoorDyn stretches all segments instead of feeding material at the winch. Orders are from our own runs, also
of a V that kinks at its bodies.
"""

from __future__ import annotations

from common import CASES, RECORDED, Evidence, parser  # isort: skip - sets the threads

from dataclasses import replace
from itertools import pairwise

import numpy as np
import xarray as xr

import cablesim
from cablesim.motion import payout_waypoints, velocity_waypoints
from cablesim.scene import MeshRules, Scene, Winch

GALLERY = {"S1": "sway", "S3": "pendulum", "S3v": "pendulum_vacuum", "kinked V": "kinked_v"}
FINE = {"segment_length": 0.05, "rtol": 1e-6}
FINEST = {"segment_length": 0.0125, "rtol": 1e-6}

COARSE_AT_KINKS = "meshes too coarse for the rate to show; it is 2.0 from 5 cm on"
NEAR_THE_FREE_END = "the last markers near the free end once the cable hangs; it rises with refinement"

# RMS of the markers from MoorDyn: scene, settings in words, until, bound [mm], settings
PEER_RUNS = (
    ("S1", "5 cm, rtol 1e-6", 10.0, 0.10, FINE),
    ("S2", "5 cm, rtol 1e-6", 14.0, 0.165, FINE),
    ("S3", "5 cm, rtol 1e-6", 6.0, 0.075, FINE),
    ("S3v", "5 cm, rtol 1e-6, to 0.82 s", 0.82, 0.285, FINE),
    ("S1", "1.25 cm, rtol 1e-6", 10.0, 0.0035, FINEST),
    ("S2", "1.25 cm, rtol 1e-6", 14.0, 0.008, FINEST),
    ("S1", "defaults", 10.0, 0.11, {}),
    ("S3", "defaults", 6.0, 0.09, {}),
    ("winch", "5 cm, rtol 1e-6", 20.0, 1.0, FINE),
)


def scene(name: str, *, segment_length: float | None = None, rtol: float | None = None) -> Scene:
    """A scene of the independent code with another mesh or tolerance."""
    result = cablesim.build_scene(cablesim.load_case(CASES / f"{GALLERY.get(name, 'sway')}.yaml"))
    if name not in GALLERY:
        result = as_recorded(result, name)
    if segment_length is not None:
        result = replace(result, mesh=MeshRules(segment_length=segment_length))
    if rtol is not None:
        result = replace(result, numerics=replace(result.numerics, relative_tolerance=rtol))
    return result


def recording(name: str) -> xr.Dataset:
    """What MoorDyn computed for a scene."""
    return xr.load_dataset(RECORDED / f"moordyn_{name}.nc")


def as_recorded(rope: Scene, name: str) -> Scene:
    """The rope with the motion of end B and the winch that a recording states."""
    data = recording(name)
    start = [data.attrs["span"], 0.0, 0.0]
    motion = velocity_waypoints(start, data["corner"].values, data["end_b_velocity"].values)
    length, speeds = rope.cable.length, data["payout_speed"].values
    changed = replace(rope, end_b=replace(rope.end_b, motion=motion), duration=float(data["time"][-1]))
    if not speeds.any():
        return changed
    return replace(
        changed,
        cable=replace(rope.cable, length=2 * length),  # drum included
        winch=Winch(
            deployed_length=length, payout=payout_waypoints(length, data["payout_corner"].values, speeds)
        ),
        output=replace(rope.output, markers=np.empty(0)),
    )


def markers(name: str, **changes: float) -> np.ndarray:
    """Marker positions (time, marker, 3) of a run."""
    return cablesim.simulate(scene(name, **changes)).marker_position.values


def rms(a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square distance over markers and times [mm]."""
    return 1e3 * float(np.sqrt(((a - b) ** 2).sum(axis=-1).mean()))


def against_peer(name: str, until: float = np.inf, **changes: float) -> float:
    """RMS marker distance from MoorDyn's run [mm]."""
    peer = recording(name)
    early = peer["time"].values <= until + 1e-9
    run = cablesim.simulate(scene(name, **changes)).sel(time=peer["time"].values, method="nearest")
    found = spread_markers(run) if "deployed_length" in run else run["marker_position"].values
    return rms(found[early], peer["marker_position"].values[early])


def spread_markers(run: xr.Dataset) -> np.ndarray:
    """Positions (time, marker, 3) of markers that divide the deployed length evenly, as MoorDyn's do."""
    markers = []
    for places, length in zip(run["position"].values, run["deployed_length"].values, strict=True):
        out = np.isfinite(places[:, 0])
        s = np.minimum(run["s"].values[out], length)
        s[-1] = length
        wanted = np.linspace(0.0, length, 16)
        markers.append(np.column_stack([np.interp(wanted, s, column) for column in places[out].T]))
    return np.array(markers)


def energy_change(rtol: float) -> tuple[float, float]:
    """Largest change of energy of the rope swinging in vacuum, of |E(0)| and of the swing."""
    run = cablesim.simulate(scene("S3v", rtol=rtol))
    energy = (run.kinetic_energy + run.potential_energy + run.elastic_energy).values
    change = float(np.abs(energy - energy[0]).max())
    return change / abs(energy[0]), change / float(np.ptp(run.potential_energy.values))


def orders(name: str, lengths: tuple[float, ...]) -> list[float]:
    """Order in space from each three meshes that follow each other, tolerance out of the way (Richardson)."""
    runs = [markers(name, segment_length=length, rtol=1e-8) for length in lengths]
    steps = [rms(a, b) for a, b in pairwise(runs)]
    return [float(np.log2(a / b)) for a, b in pairwise(steps)]


def tolerance_row(name: str) -> dict[str, object]:
    """Error against tolerance over four decades, on one mesh."""
    exact = markers(name, rtol=1e-8)
    errors = [rms(markers(name, rtol=rtol), exact) for rtol in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)]
    slope = float(np.polyfit(np.arange(5.0), -np.log10(errors), 1)[0])
    return {"scene": name, **{f"1e-{k}": e for k, e in enumerate(errors, start=2)}, "slope": slope}


def main() -> None:
    """Compare and measure."""
    options = parser(__doc__).parse_args()
    evidence = Evidence(__file__, __doc__, options)
    for name, settings, until, bound, changes in PEER_RUNS:
        text = f"{name}, {settings}: RMS of the markers from MoorDyn's run"
        evidence.claim(text, against_peer(name, until, **changes), "mm", at_most=bound)
    for rtol, bound in ((1e-4, 1e-3), (1e-5, 3e-4)):
        relative, of_swing = energy_change(rtol)
        evidence.claim(f"S3v, rtol {rtol:g}: change of energy over 3 s, of E(0)", relative, at_most=bound)
        evidence.claim(f"S3v, rtol {rtol:g}: the same, of the energy of the swing", of_swing)
    lengths = (0.2, 0.1, 0.05) if options.small else (0.2, 0.1, 0.05, 0.025, 0.0125)
    for name, missed in (("S1", ""), ("S3", NEAR_THE_FREE_END), ("kinked V", COARSE_AT_KINKS)):
        for first, order in zip(lengths, orders(name, lengths), strict=False):
            text = f"order in space, {name}, {100 * first:g} cm and halved twice"
            evidence.claim(text, order, at_least=1.9, at_most=2.1, missed=missed)
    evidence.table(
        [tolerance_row(name) for name in ("S1", "S3")], "RMS error [mm] against tolerance, same mesh"
    )


if __name__ == "__main__":
    main()
