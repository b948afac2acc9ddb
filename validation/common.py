"""What the scripts of this folder share: output folders, tables, and timing on one thread.

Import it first: it keeps numerical libraries to one thread, which is how everything here is timed.
"""

from __future__ import annotations

import os

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")})

import argparse
import csv
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

CASES = Path(__file__).resolve().parents[1] / "cases"
RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"


def parser(text: str | None) -> argparse.ArgumentParser:
    """Command line with the options that every script has; `text` is the script's docstring."""
    result = argparse.ArgumentParser(description=(text or "").split("\n\n")[0])
    result.add_argument(
        "-o", "--output", type=Path, help="folder for tables and pictures (default: a new one)"
    )
    result.add_argument("--small", action="store_true", help="a short version")
    return result


def output_folder(given: Path | None) -> Path:
    """The folder asked for, made if need be, or a new temporary one."""
    if given is None:
        return Path(tempfile.mkdtemp(prefix="cablesim-"))
    given.mkdir(parents=True, exist_ok=True)
    return given


def write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write rows with the same keys as a table."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    print(f"wrote {path}")


def print_table(rows: Iterable[dict[str, Any]], title: str = "") -> None:
    """Print rows with the same keys in columns."""
    rows = list(rows)
    if title:
        print(f"\n{title}")
    if not rows:
        print("  (none)")
        return
    cells = [list(rows[0]), *([_text(value) for value in row.values()] for row in rows)]
    widths = [max(len(line[k]) for line in cells) for k in range(len(cells[0]))]
    for line in cells:
        print("  " + "  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)).rstrip())


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)


def best_time(work: Callable[[], Any], repeats: int) -> float:
    """Shortest wall time of `work` in a few repeats [s]."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)
