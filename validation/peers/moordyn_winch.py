"""The winch cycle in MoorDyn 2.7.2, whose line stretches or shrinks all its segments, against ours.

MoorDyn is told the unstretched length and its rate before every step of 5 ms; its 60 segments of 5 cm become
8.3 cm long at 5 m, and bodies on it would move along the cable.  What is compared is the force at A: its
ringing is what a high pass of 2 Hz lets through while cable is paid out and reeled in at an even speed, where
the true force changes slowly; its difference is that from our run with segments of 1.25 cm.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common import CASES, print_table  # isort: skip - sets the threads

import time
from typing import Any

import moordyn
import moordyn_scenes as peer
import numpy as np
import xarray as xr
from scipy.signal import butter, sosfiltfilt

import cablesim

INTERVAL = 0.005  # [s]
EVEN = ((2.0, 7.5), (10.0, 18.0))  # [s], paid out and reeled in at an even speed


def moordyn_force(
    program: xr.DataArray, scheme: str, damping: float, step: float
) -> tuple[np.ndarray, float]:
    """Force at A [N] at the times of a deployed length, and the wall time of the integration [s]."""
    setting = peer.Scene(duration=float(program.time[-1]), span=1.5)
    nodes = peer._hanging_chain(setting, 60, peer.STIFFNESS)
    deck = peer._input_deck(setting, nodes, scheme, step, peer.STIFFNESS, damping)
    place, rest = (nodes[-1] + peer._down()).tolist(), [0.0, 0.0, 0.0]
    lengths, times = program.values, program.time.values
    rates = np.gradient(lengths, times)
    forces, wall = [], 0.0
    with peer._started(deck, nodes, setting) as system:
        line = moordyn.GetLine(system, 1)
        forces.append(_tension(line))
        for k, now in enumerate(times[:-1]):
            peer.set_length(line, float(lengths[k]), float(rates[k]))
            begin = time.perf_counter()
            moordyn.Step(system, place, rest, float(now), INTERVAL)
            wall += time.perf_counter() - begin
            forces.append(_tension(line))
    return np.array(forces), wall


def _tension(line: Any) -> float:
    return float(np.linalg.norm(moordyn.GetLineNodeTen(line, 0)))


def ringing(times: np.ndarray, force: np.ndarray, fine: np.ndarray) -> dict[str, float]:
    """Part above 2 Hz and difference from a finer run while the speed is even, in percent."""
    high = sosfiltfilt(butter(4, 2.0, "highpass", fs=1.0 / INTERVAL, output="sos"), force)
    even = np.any([(times > first) & (times < last) for first, last in EVEN], axis=0)
    return {
        "ringing, RMS %": 100 * float(np.sqrt(np.mean(high[even] ** 2))) / force[even].mean(),
        "largest %": 100 * float(np.abs(high[even]).max()) / force[even].mean(),
        "difference, RMS %": 100 * float(np.sqrt(np.mean((force - fine)[even] ** 2))) / force[even].mean(),
    }


def ours(case: cablesim.Case, segment: float, rtol: float) -> tuple[xr.Dataset, np.ndarray]:
    """Our run of the winch cycle, and its force at A [N]."""
    changes = {
        "simulation": {"relative_tolerance": rtol},
        "output": {"interval": INTERVAL},
        "mesh": {"segment_length": segment},
    }
    parts = {part: getattr(case, part).model_copy(update=values) for part, values in changes.items()}
    run = cablesim.simulate(case.model_copy(update=parts))
    return run, np.linalg.norm(run["end_force"].sel(end="a").values, axis=1)


def main() -> None:
    """Print the table."""
    case = cablesim.load_case(CASES / "winch_cycle.yaml")
    _, fine = ours(case, 0.0125, 1e-6)
    rows: list[dict[str, Any]] = []
    for rtol in (1e-4, 1e-5):
        run, force = ours(case, 0.05, rtol)
        found = ringing(run.time.values, force, fine)
        rows.append({"code": f"cablesim, rtol {rtol:g}", "wall [s]": run.attrs["wall_seconds"]} | found)
    program = run["deployed_length"]
    for scheme, damping, step in (("rk4", 0.0, 1e-4), ("rk2", 0.5, 5e-5), ("rk2", 2.0, 5e-5)):
        label = f"MoorDyn {scheme}, BA {damping:g} N s, {1e3 * step:g} ms"
        try:
            force, wall = moordyn_force(program, scheme, damping, step)
            rows.append({"code": label, "wall [s]": wall} | ringing(program.time.values, force, fine))
        except RuntimeError:
            rows.append({"code": f"{label}: not a number", **dict.fromkeys(list(rows[0])[1:], np.nan)})
    print_table(rows, "winch cycle: ringing of the force at A while cable runs at an even speed")


if __name__ == "__main__":
    main()
