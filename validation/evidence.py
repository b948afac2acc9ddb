"""Run the scripts of this folder and write what they found to `validation/README.md`.

`evidence.py` runs all of them, `evidence.py accuracy winch` these; what they find is kept in
`validation/results`, one file a script. The page and the figures in the project's README are written from all
that is kept there. `--small` runs short versions and leaves all that alone; `--pages` writes the pages alone.

Ends with 1 where a script fails, or misses a bound that is not known to be missed.
"""

from __future__ import annotations

from common import bounds, markdown, measured, met, write_between  # isort: skip - sets the threads

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
SCRIPTS = (
    "run0024",
    "accuracy",
    "gallery",
    "recordings",
    "tolerances",
    "work_precision",
    "stability",
    "winch",
    "buoy_gap_gains",
    "v_gap",
    "estimators",
    "imu_placement",
    "scaling",
    "speed",
)
SHORT = tuple(name for name in SCRIPTS if name not in ("recordings", "speed"))  # need what a clone has not
PICTURES = ("run0024.png", "work_precision.png", "imu_placement.png")

# The figures of the project's README: script, claim, and the claim in fewer words
FIGURES = (
    (
        "run0024",
        "run 0024, nothing fitted: P50 of 587 residuals",
        "markers of a recorded tank experiment, nothing fitted: median distance (the paper 12.4 mm)",
    ),
    (
        "recordings",
        "cable 6, run 0028: angle gamma of the cable's plane, RMS",
        "another of its runs: lean of the cable, up to 18 degrees, RMS",
    ),
    (
        "recordings",
        "jumper, case 1, top moved along x: tension, RMS",
        "tension of a flexible jumper of 170 m, moved at its top (11 kN of range), RMS",
    ),
    (
        "accuracy",
        "S1, defaults: RMS of the markers from MoorDyn's run",
        "3 m of rope moved 2 m sideways, defaults: markers from MoorDyn's converged run, RMS",
    ),
    ("accuracy", "order in space, S1, 5 cm and halved twice", "order in space"),
    (
        "accuracy",
        "S3v, rtol 1e-05: change of energy over 3 s, of E(0)",
        "energy of a rope swinging in vacuum, rtol 1e-5: largest change in 3 s",
    ),
    (
        "winch",
        "jump of the force at A where nodes come and go, largest",
        "jump of the force at the vehicle where a winch adds or takes a node",
    ),
    (
        "speed",
        "S1 at 0.1 mm: times faster than MoorDyn 5 cm, euler",
        "times faster than MoorDyn's fastest scheme at equal error, 3 m of rope, 0.1 mm",
    ),
    (
        "stability",
        "random scenes that finish",
        "random scenes that finish within a minute, without a fault of energy or closure",
    ),
    (
        "estimators",
        "distance, shape from statics, offset at rest",
        "distance of the buoys of the V from five IMUs, offset taken at rest, RMS",
    ),
)


# Runs -----------------------------------------------------------------------------------------------


def run(script: str, folder: Path, small: bool) -> bool:
    """Run one script; whether it ended well and kept its bounds."""
    print(f"--- validation/{script}.py{' --small' if small else ''}", flush=True)
    command = [sys.executable, str(HERE / f"{script}.py"), "-o", str(folder), *(["--small"] if small else [])]
    done = subprocess.run(command, env={**os.environ, "MPLBACKEND": "Agg"}, check=False)
    if done.returncode:
        print(f"validation/{script}.py ended with {done.returncode}")
        return False
    missed = [claim["claim"] for claim in read(folder / f"{script}.json")["claims"] if fails(claim)]
    for text in missed:
        print(f"missed: {text}")
    return not missed


def read(file: Path) -> dict[str, Any]:
    """What a script found."""
    return json.loads(file.read_text(encoding="utf-8"))


def fails(claim: dict[str, Any]) -> bool:
    """Whether a claim misses its bounds and is not known to."""
    return not met(claim) and not claim["missed"]


def keep(script: str, folder: Path) -> None:
    """Take the results of a script into the repository."""
    RESULTS.mkdir(exist_ok=True)
    for file in (folder / f"{script}.json", *(folder / name for name in PICTURES if name.startswith(script))):
        shutil.copy(file, RESULTS)


# The page -------------------------------------------------------------------------------------------


def kept() -> dict[str, dict[str, Any]]:
    """What all scripts found, in their order."""
    files = {name: RESULTS / f"{name}.json" for name in SCRIPTS}
    return {name: read(file) for name, file in files.items() if file.is_file()}


def sections(results: dict[str, dict[str, Any]]) -> str:
    """The page of evidence below its introduction."""
    return "\n".join(section(*found) for found in results.items())


def section(script: str, found: dict[str, Any]) -> str:
    """One script: what it does, its figures, its tables, its picture."""
    title, _, text = found["text"].strip().partition("\n\n")
    parts = [f"## {title.replace(chr(10), ' ').rstrip('.')}\n"]
    if text:
        parts.append(f"{text}\n")
    if found["claims"]:
        parts.append(markdown([claim_row(claim) for claim in found["claims"]]))
    for table in found["tables"]:
        parts.append(f"**{table['title'][0].upper()}{table['title'][1:]}.** {table['note']}".strip() + "\n")
        parts.append(markdown(table["rows"]))
    parts += [f"![{script}](results/{name})\n" for name in PICTURES if name.startswith(script)]
    length = "short version, " if found["small"] else ""
    made = f"{length}{found['seconds']:.0f} s on {found['date']}, {found['machine']}"
    parts.append(f"`validation/{script}.py`: {made}.\n")
    return "\n".join(parts)


def claim_row(claim: dict[str, Any]) -> dict[str, str]:
    """A claim as a row of the page."""
    value, bound = measured(claim), bounds(claim) or "stated"
    if not met(claim):
        value, bound = f"**{value}**", f"{bound}, missed: {claim['missed']}"
    return {"figure": claim["claim"], "measured": value, "bound": bound}


def figures(results: dict[str, dict[str, Any]]) -> str:
    """The table of the project's README."""
    rows = []
    for script, text, words in FIGURES:
        if script not in results:
            continue
        claim = next(claim for claim in results[script]["claims"] if claim["claim"] == text)
        rows.append({**claim_row(claim), "figure": words, "script": f"`{script}.py`"})
    return markdown(rows)


def write_pages() -> None:
    """Write the page of evidence and the figures of the project's README."""
    results = kept()
    write_between(HERE / "README.md", "results", sections(results))
    write_between(HERE.parent / "README.md", "figures", figures(results))


def main() -> int:
    """Run scripts, keep what they find, write the pages."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("scripts", nargs="*", metavar="NAME", help=f"of {', '.join(SCRIPTS)} (default: all)")
    parser.add_argument("--small", action="store_true", help="short versions; nothing is kept")
    parser.add_argument(
        "--pages", action="store_true", help="write the pages from what is kept, without a run"
    )
    options = parser.parse_args()
    ended_well = True
    if not options.pages:
        with tempfile.TemporaryDirectory() as folder:
            for script in options.scripts or (SHORT if options.small else SCRIPTS):
                well = run(script, Path(folder), options.small)
                ended_well &= well
                if well and not options.small:
                    keep(script, Path(folder))
    if not options.small:
        write_pages()
    return int(not ended_well)


if __name__ == "__main__":
    sys.exit(main())
