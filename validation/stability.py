"""Runs random scenes and audits each one: does it finish, or say why not, and does physics hold?

A scene follows from the seed and its index alone, so that ``--only INDEX`` repeats it (`random_scenes.py`).
What is audited stands in `audit.py`, the balance of energy in `energy_balance.py`.
"""

from __future__ import annotations

import common  # isort: skip  (first: it sets the number of threads)

import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context

import numpy as np
from audit import Report, audit
from random_scenes import Plan


def run_all(plan: Plan, indices: list[int], jobs: int) -> list[Report]:
    """Audit scenes, side by side if asked; scenes of one kind follow each other and compile once."""
    order = sorted(indices, key=lambda index: (index % plan.kinds, index))
    if jobs == 1:
        return sorted((audit(plan, index) for index in order), key=lambda report: report.index)
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        reports = pool.map(audit, [plan] * len(order), order, chunksize=max(1, len(order) // plan.kinds))
        return sorted(reports, key=lambda report: report.index)


def summarise(reports: list[Report], evidence: common.Evidence) -> None:
    """Outcomes, faults and worst cases."""
    outcomes = Counter(report.outcome for report in reports)
    damped = Counter(report.outcome for report in reports if report.damped)
    rows = (
        {
            "outcome": name,
            "scenes": n,
            "%": 100.0 * n / len(reports),
            "damped": damped[name],
            "tau = 0": n - damped[name],
        }
        for name, n in outcomes.most_common()
    )
    evidence.table(rows, "outcomes, of scenes with structural damping and without")
    evidence.claim(
        "random scenes that finish", 100.0 * outcomes["completed"] / len(reports), "%", at_least=99.0
    )
    faults = sum(bool(report.faults) for report in reports)
    evidence.claim("random scenes with NaN or a fault of energy, closure or output", faults, at_most=0)
    columns = ("index", "outcome", "faults", "wall", "reached", "message", "scene")
    odd = [report for report in reports if report.outcome != "completed" or report.faults]
    print(f"\nNot completed, or with faults: {len(odd)}")
    for report in odd:
        print("  " + " | ".join(_short(getattr(report, name)) for name in columns))
    done = [report for report in reports if report.outcome == "completed"]
    for name in ("wall", "calls", "closure", "energy"):
        worst = sorted((r for r in done if np.isfinite(getattr(r, name))), key=lambda r: -getattr(r, name))[
            :5
        ]
        common.print_table(
            ({"index": r.index, name: getattr(r, name), "scene": r.scene} for r in worst), f"Largest {name}"
        )
    walls = np.array([report.wall for report in done])
    if walls.size:
        median, most = np.quantile(walls, [0.5, 0.9])
        print(f"\nwall time [s]: median {median:.3g}, 90 % {most:.3g}, max {walls.max():.3g}")


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def main() -> int:
    parser = common.parser(__doc__)
    parser.add_argument("--count", type=int, help="number of scenes (default 200, with --small 40)")
    parser.add_argument("--seed", type=int, default=Plan.seed)
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    parser.add_argument("--kinds", type=int, help="sets of compiled equations (default 24, with --small 6)")
    parser.add_argument("--only", type=int, nargs="+", metavar="INDEX", help="run these scenes again")
    parser.add_argument(
        "--time-limit", type=float, default=Plan.time_limit, help="wall-clock seconds a scene"
    )
    options = parser.parse_args()
    plan = Plan(
        seed=options.seed,
        kinds=options.kinds or (6 if options.small else Plan.kinds),
        time_limit=options.time_limit,
    )
    indices = options.only or list(range(options.count or (40 if options.small else 200)))
    started = time.perf_counter()
    reports = run_all(plan, indices, options.jobs)
    summarise(reports, common.Evidence(__file__, __doc__, options))
    print(f"{len(reports)} scenes in {time.perf_counter() - started:.0f} s, compiling included")
    folder = common.output_folder(options.output)
    common.write_csv(folder / "stability.csv", [asdict(report) for report in reports])
    return int(any(report.faults for report in reports))


if __name__ == "__main__":
    sys.exit(main())
