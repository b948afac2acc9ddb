"""Commands on cases: new, validate, info, statics, run, schema.

Depends on: application, terminal, tables, progress; batch, simulation, starters, imported when a command
needs them.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cablesim.cli import tables
from cablesim.cli.application import CasePath, CasePaths, Force, Overrides, command
from cablesim.cli.progress import watcher
from cablesim.cli.terminal import say, table, tell, warn

if TYPE_CHECKING:
    import xarray as xr

    from cablesim.scene import Scene
    from cablesim.simulation import Simulation


class Starter(StrEnum):
    """Names of the starter cases."""

    SWAY = "sway"
    TOW = "tow"
    BUOYS = "buoys"
    WINCH = "winch"


@command
def new(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="Default: <starter>.yaml")] = None,
    starter: Annotated[Starter, typer.Option("--from", help="What to start from.")] = Starter.SWAY,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file if it is there.")] = False,
) -> None:
    """Write a commented case to start from."""
    from cablesim.files import STANDARD_INPUT, OutputError, check_writable, replacing
    from cablesim.starters import starter_text

    file = Path(f"{starter}.yaml") if file is None else file
    if file == STANDARD_INPUT or not file.name.isprintable():
        raise OutputError(
            f"{str(file)!r} is no name for a case: other commands could not read it. Choose another."
        )
    if file.exists() and not force:
        raise OutputError(f"{file} is already there. Choose another name, or overwrite it with --force.")
    check_writable(file)
    with replacing(file) as part:
        part.write_text(starter_text(starter, str(file), file.stem), encoding="utf-8")
    say(f"{file} written; next: cablesim run {file}")


@command
def validate(cases: CasePaths) -> None:
    """Check cases and list everything that is wrong with each."""
    from cablesim.batch import explain_failure, load_scene, name_of

    worst = 0
    for path in cases:
        name = name_of(path)
        try:
            scene = load_scene(path)
        except Exception as error:
            outcome, _, message = explain_failure(error)
            worst = max(worst, int(outcome))
            tell(message if name in message else f"{name}: {message}")
        else:
            warn(*(f"{name}: {text}" for text in scene.warnings))
            say(f"{name}: ok")
    raise typer.Exit(worst)


@command
def info(case: CasePath, overrides: Overrides = None) -> None:
    """Say what a case amounts to: mesh, unknowns, what is skipped, weights, scales, size of the result."""
    from cablesim.batch import load_scene
    from cablesim.plausibility import warnings_of

    scene = load_scene(case, overrides or ())
    simulation = _initialised(scene)
    start = _dataset_at_start(simulation)
    for title, rows in (
        ("mesh", tables.mesh_rows(simulation)),
        ("computed and skipped", tables.needs_rows(simulation)),
        ("weights", tables.weight_rows(simulation)),
        ("natural scales", tables.scale_rows(simulation)),
        ("size", tables.size_rows(simulation, start)),
    ):
        shown = table("", "", title=f"{scene.name}: {title}")
        for name, value in rows.items():
            shown.add_row(name, value)
        say(shown)
    warn(*warnings_of(start))


@command
def statics(
    case: CasePath,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Also write it to this file.")] = None,
    overrides: Overrides = None,
    force: Force = False,
) -> None:
    """Find the rest shape of a case, its ends held where they are at t = 0."""
    from dataclasses import replace

    from cablesim.batch import load_scene, plan_statics, write_result
    from cablesim.plausibility import warnings_of
    from cablesim.scene import EquilibriumShape, StartShape

    planned = None if output is None else plan_statics(case, output, overrides or (), force=force)
    scene = load_scene(case, overrides or (), None if planned is None else planned.text)
    if not isinstance(scene.initial, EquilibriumShape):
        guess = scene.initial.polyline if isinstance(scene.initial, StartShape) else None
        scene = replace(scene, initial=EquilibriumShape(guess=guess))
    simulation = _initialised(replace(scene, output=replace(scene.output, variables=())))
    rest = _dataset_at_start(simulation)
    shown = table("", "", title=f"{scene.name}: rest shape")
    for name, value in tables.rest_rows(simulation, rest).items():
        shown.add_row(name, value)
    say(shown)
    warn(*warnings_of(rest))
    if planned is not None:
        write_result(rest, planned.product())
        say(f"{planned.file} written")


@command
def run(
    cases: CasePaths,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Existing folder, or for one case a file ending in .nc.")
    ] = Path("."),
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Cases computed side by side.")] = 1,
    overrides: Overrides = None,
    force: Force = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only say what went wrong.")] = False,
) -> None:
    """Run cases; each writes <case>.nc, also when it stops early."""
    from cablesim.batch import plan_runs, run_all

    runs = plan_runs(cases, output, overrides or (), force=force)
    with watcher([run.file.stem for run in runs], quiet=quiet) as told:
        summaries = run_all(runs, jobs, told)
    if len(summaries) > 1 and not quiet:
        say(tables.summary_table(summaries))
    raise typer.Exit(max(int(summary.outcome) for summary in summaries))


@command
def schema(
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Default: standard output.")] = None,
    force: Force = False,
) -> None:
    """Write the JSON Schema of case files, for editors."""
    import json

    from cablesim.case import case_schema
    from cablesim.files import Product, replacing

    if output is None:
        say(json.dumps(case_schema(), indent=2, ensure_ascii=False))
        return
    product = Product(output, "cablesim schema --output")
    product.check(force=force)
    marked = {"$comment": product.mark, **case_schema()}
    with replacing(output) as part:
        part.write_text(json.dumps(marked, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    say(f"{output} written")


def _initialised(scene: Scene) -> Simulation:
    from cablesim.simulation import Simulation

    return Simulation(scene)


def _dataset_at_start(simulation: Simulation) -> xr.Dataset:
    """Make a result of no duration: the initial state alone."""
    return simulation.present({"status": "completed", "message": "Rest shape."})
