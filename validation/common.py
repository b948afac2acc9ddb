"""What the scripts of this folder share: output folders, results and tables, and timing on one thread.

Import it first: it keeps numerical libraries to one thread, which is how everything here is timed.
"""

from __future__ import annotations

import os

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")})

import argparse
import csv
import json
import platform
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

CASES = Path(__file__).resolve().parents[1] / "cases"
RECORDED = Path(__file__).resolve().parent / "recorded"
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


class Evidence:
    """What a script found: printed as it comes, and kept in `<folder>/<script>.json` for the page.

    Parameters
    ----------
    script : str
        The script's `__file__`.
    text : str or None
        The script's docstring; it introduces its section of the page.
    options : argparse.Namespace
        Of `parser`; where `output` is given, the results are kept there.
    """

    def __init__(self, script: str, text: str | None, options: argparse.Namespace) -> None:
        self._started = time.perf_counter()
        self._folder = options.output and output_folder(options.output)
        self._name = Path(script).stem
        self._found: dict[str, Any] = {
            "text": text or "",
            "small": options.small,
            "date": time.strftime("%Y-%m-%d"),
            "machine": _machine(),
            "claims": [],
            "tables": [],
        }
        self._keep()

    def claim(
        self,
        text: str,
        value: float,
        unit: str = "",
        *,
        at_most: float | None = None,
        at_least: float | None = None,
        missed: str = "",
    ) -> None:
        """Keep one figure with the bounds it has to meet, none if it is only stated.

        A bound that is known to be missed says in `missed` why; any other miss fails the evidence.
        """
        claim = {
            "claim": text,
            "value": float(value),
            "unit": unit,
            "at_most": at_most,
            "at_least": at_least,
            "missed": missed,
        }
        self._found["claims"].append(claim)
        print(f"{text}: {measured(claim)}; {verdict(claim)}")
        self._keep()

    def table(self, rows: Iterable[dict[str, Any]], title: str, note: str = "") -> None:
        """Keep and print rows with the same keys; `note` is a sentence on what they show."""
        rows = list(rows)
        self._found["tables"].append({"title": title, "note": note, "rows": rows})
        print_table(rows, title)
        self._keep()

    def _keep(self) -> None:
        self._found["seconds"] = round(time.perf_counter() - self._started, 1)
        if self._folder:
            text = json.dumps(self._found, indent=1, default=lambda number: number.item())
            (self._folder / f"{self._name}.json").write_text(text + "\n", encoding="utf-8")


def measured(claim: dict[str, Any]) -> str:
    """The figure of a claim with its unit."""
    return f"{_text(claim['value'])} {claim['unit']}".strip()


def bounds(claim: dict[str, Any]) -> str:
    """The bounds of a claim in words; empty for a figure that is only stated."""
    low, high = claim["at_least"], claim["at_most"]
    parts = [f"at least {low:g}"] if low is not None else []
    return " and ".join(parts + ([f"at most {high:g}"] if high is not None else []))


def met(claim: dict[str, Any]) -> bool:
    """Whether a claim keeps its bounds; what is not a number does not."""
    low = -float("inf") if claim["at_least"] is None else claim["at_least"]
    high = float("inf") if claim["at_most"] is None else claim["at_most"]
    return bool(low <= claim["value"] <= high)


def verdict(claim: dict[str, Any]) -> str:
    """What is to be said of a claim: stated, met or missed."""
    if not bounds(claim):
        return "stated" if met(claim) else "not a number: MISSED"
    return f"{bounds(claim)}: {'met' if met(claim) else 'MISSED'}"


def markdown(rows: list[dict[str, Any]]) -> str:
    """Rows with the same keys as a table."""
    if not rows:
        return "(none)\n"
    lines = [list(rows[0]), ["---"] * len(rows[0]), *([_cell(v) for v in row.values()] for row in rows)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines) + "\n"


def _cell(value: Any) -> str:
    return _text(value).replace("|", "\\|")


def between(file: Path, name: str) -> str:
    """The text between the lines `<!-- name -->` and `<!-- end of name -->` of a page."""
    rest = file.read_text(encoding="utf-8").split(f"<!-- {name} -->\n")[1]
    return rest.split(f"<!-- end of {name} -->\n")[0]


def write_between(file: Path, name: str, text: str) -> None:
    """Replace what is between these lines."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    before = f"{begin}{between(file, name)}{end}"
    page = file.read_text(encoding="utf-8").replace(before, f"{begin}{text}{end}")
    file.write_text(page, encoding="utf-8")


def _machine() -> str:
    """Processor, cores and interpreter, in words."""
    cpu = platform.processor() or platform.machine()
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        names = [
            line.split(":")[1] for line in listing.read_text().splitlines() if line.startswith("model name")
        ]
        cpu = names[0].strip() if names else cpu
    return f"{cpu}, {os.cpu_count()} cores, Python {platform.python_version()}"


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
