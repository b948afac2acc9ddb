"""Write what follows from files: the gallery of `cases/README.md`, the modules of `cablesim/README.md`.

The words are those at the top of each case file and module. `--pictures` also runs the cases, or those that
are named, and draws them (needs matplotlib).
"""

from __future__ import annotations

from common import CASES, markdown, write_between  # isort: skip - sets the threads

import argparse
import ast
import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import cablesim

PACKAGE = CASES.parent / "cablesim"
PICTURES = CASES / "pictures"
SHAPES = 14
COLOURS = {"buoy": "#d55e00", "ballast": "#333333", "body": "#333333", "imu": "#009e73"}


def words(file: Path) -> str:
    """The comment at the top of a case file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    return "\n".join(line.removeprefix("#").strip() for line in lines[:first])


def projection(places: np.ndarray) -> np.ndarray:
    """From the world to the paper, (3, 2): the widest horizontal direction to the right, z up, oblique."""
    flat = places[..., :2].reshape(-1, 2)
    flat = flat[np.isfinite(flat[:, 0])]
    widest = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[2][0]
    widest = widest if widest[np.abs(widest).argmax()] > 0 else -widest
    right, depth = np.array([*widest, 0.0]), np.array([-widest[1], widest[0], 0.0])
    return np.column_stack([right + 0.35 * depth, np.array([0.0, 0.0, 1.0]) + 0.25 * depth])


def draw(run: xr.Dataset, case: cablesim.Case, axes: Axes) -> None:
    """Shapes of a run with its ends and bodies."""
    places = run["position"].values
    paper = projection(places)
    out = np.isfinite(places[..., 0])
    times = np.unique(np.linspace(0, len(places) - 1, SHAPES).round().astype(int))
    for end, mark in ((0, "^"), (-1, "s")):
        path = np.array([shape[there][end] for shape, there in zip(places, out, strict=True)]) @ paper
        axes.plot(*path.T, color="0.75", lw=0.8, zorder=1)
        axes.plot(*path[-1], mark, color="black", ms=5, zorder=5)
    for step, k in enumerate(times):
        colour = mpl.colormaps["viridis"](0.9 * step / max(1, len(times) - 1))
        axes.plot(*(places[k] @ paper).T, color=colour, lw=1.1, zorder=2)
        for body in case.attachments:
            s = run["s"].values
            node = int(np.abs(s - body.at).argmin())
            if out[k, node] and body.kind != "imu":
                axes.plot(*(places[k, node] @ paper), "o", color=COLOURS[body.kind], ms=3.2, zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("m", fontsize=7)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.25, lw=0.5)


def picture(name: str) -> None:
    """Run a case and draw it, as a small picture of few colours."""
    case = cablesim.load_case(CASES / f"{name}.yaml")
    scene = cablesim.build_scene(case)
    run = cablesim.simulate(scene)
    figure = Figure(figsize=(5.2, 3.2), layout="constrained")
    draw(run, case, figure.add_subplot())
    PICTURES.mkdir(exist_ok=True)
    file = PICTURES / f"{name}.png"
    figure.savefig(file, dpi=110)
    Image.open(file).convert("RGB").quantize(48).save(file, optimize=True)
    print(f"wrote {file}, {file.stat().st_size / 1024:.0f} kB", flush=True)


def gallery() -> str:
    """A section a case: its picture and its words."""
    files = sorted(CASES.glob("*.yaml"))
    return "\n".join(f"## {f.stem}\n\n![{f.stem}](pictures/{f.stem}.png)\n\n{words(f)}\n" for f in files)


def modules() -> str:
    """A row for each module and package: its first sentence, and what it depends on."""
    rows = []
    for file in sorted([*PACKAGE.glob("[!_]*.py"), *PACKAGE.glob("*/__init__.py")]):
        first, _, rest = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition(
            "\n\n"
        )
        needs = re.search(r"Depends on: (.*?)\.(?:\s|$)", f"{rest}\n{first}", flags=re.DOTALL)
        name = f"{file.parent.name}/" if file.name == "__init__.py" else file.name
        rows.append({"module": f"`{name}`", "holds": first, "depends on": needs[1] if needs else "-"})
    return markdown([{key: " ".join(cell.split()) for key, cell in row.items()} for row in rows])


def main() -> None:
    """Draw if asked, and write the pages."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    arguments.add_argument("--pictures", nargs="*", metavar="CASE", help="draw these again (default: all)")
    wanted = arguments.parse_args().pictures
    for name in [] if wanted is None else wanted or [file.stem for file in sorted(CASES.glob("*.yaml"))]:
        picture(name)
    write_between(CASES / "README.md", "gallery", gallery())
    write_between(PACKAGE / "README.md", "modules", modules())


if __name__ == "__main__":
    main()
