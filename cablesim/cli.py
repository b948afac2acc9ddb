"""The command line: new, validate, info, statics, run, plot, report, animate, export, imu, schema.

Depends on: all of cablesim, imported when a command needs it.

Exit codes, the highest that applies when there are several cases:

====  ===========================================================================================
0     everything completed
1     a run stopped before its end; the file with what was computed is written
2     a case, or the command line, was refused
3     a file could not be read or written
130   interrupted by Ctrl-C; the file with what was computed is written
====  ===========================================================================================

Results go to standard output; progress, messages and errors to standard error.  With the environment
variable ``CABLESIM_DEBUG`` set, the log is shown in full.
"""

from __future__ import annotations

import _thread
import functools
import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console

    from cablesim.batch import RunSummary
    from cablesim.scene import Scene
    from cablesim.simulation import Simulation

EXIT_CODES = (
    "Exit codes: 0 all completed; 1 a run stopped before its end (the file with what was computed is "
    "written); 2 a case or the command line was refused; 3 a file could not be read or written; "
    "130 interrupted by Ctrl-C (the file with what was computed is written)."
)

app = typer.Typer(
    help="Dynamics of tethers in water.",
    epilog=EXIT_CODES,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


class Starter(StrEnum):
    """Names of the starter cases."""

    SWAY = "sway"
    TOW = "tow"
    BUOYS = "buoys"
    WINCH = "winch"


class Format(StrEnum):
    """What a result can be exported to."""

    CSV = "csv"
    VTK = "vtk"


class ImuFrame(StrEnum):
    """Local frames of the cable in which sensors can be mounted."""

    TRANSPORTED = "transported"
    PAPER = "paper"


class ImuErrorPreset(StrEnum):
    """Sensors whose errors are known."""

    NONE = "none"
    BMX160 = "bmx160"


CasePath = Annotated[Path, typer.Argument(metavar="CASE", help="Case file (YAML).")]
CasePaths = Annotated[list[Path], typer.Argument(metavar="CASE...", help="Case files (YAML).")]
ResultPath = Annotated[Path, typer.Argument(metavar="RESULT", help="Result file (netCDF).")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a value of the case, e.g. simulation.relative_tolerance=1e-5; repeatable.",
    ),
]


# Terminal ---------------------------------------------------------------------------------------


@functools.cache
def _console(*, stderr: bool = False) -> Console:
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else 1000  # a pipe has no edge at which to fold a table
    return Console(stderr=stderr, width=width, highlight=False, markup=False, emoji=False, soft_wrap=True)


def _say(text: Any) -> None:
    _console().print(text)


def _tell(text: str, *, style: str | None = None) -> None:
    """Write a message to standard error."""
    _console(stderr=True).print(text, style=style)


def _table(*columns: str, title: str | None = None) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_header=any(columns))
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


class _TerminalLog(logging.Handler):
    """Shows the library's messages on standard error, each once."""

    def __init__(self) -> None:
        super().__init__()
        self._seen: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        if text not in self._seen:
            self._seen.add(text)
            _tell(text, style="dim")


def _show_log(*, quiet: bool = False) -> None:
    log = logging.getLogger("cablesim")
    for handler in [handler for handler in log.handlers if isinstance(handler, _TerminalLog)]:
        log.removeHandler(handler)
    log.addHandler(_TerminalLog())
    debug = bool(os.environ.get("CABLESIM_DEBUG"))
    log.setLevel(logging.DEBUG if debug else logging.WARNING if quiet else logging.INFO)


def _pass_over(failure: Any) -> None:
    """Keep quiet about errors in clean-up, as of an interrupted compiler, but do not lose a Ctrl-C to one."""
    if issubclass(failure.exc_type, KeyboardInterrupt):
        _thread.interrupt_main()
    logging.getLogger("cablesim").debug("%s", failure.exc_value)


def _guarded(command: Callable[..., None]) -> Callable[..., None]:
    """Turn whatever a command raises into a message and an exit code."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        _show_log(quiet=kwargs.get("quiet", False))
        sys.unraisablehook = _pass_over
        try:
            with _odd_things_shown():
                command(*args, **kwargs)
        except (typer.Exit, BrokenPipeError):
            raise
        except (Exception, KeyboardInterrupt) as error:
            _leave(error)

    return guarded


@contextmanager
def _odd_things_shown() -> Iterator[None]:
    """Show warnings about a case as messages, and hide those meant for programmers."""

    def show(message: Any, category: type[Warning], *_: Any, **__: Any) -> None:
        if issubclass(category, UserWarning):
            _tell(f"warning: {message}", style="yellow")

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        yield


def _leave(error: BaseException) -> None:
    """Say what went wrong and end with its exit code."""
    from cablesim.batch import explain_failure

    outcome, _, message = explain_failure(error)
    if type(error).__name__ in (
        "ExportError",
        "PlotError",
        "SensorError",
    ):  # about a file; their modules are slow to import
        outcome, message = outcome.FILE_PROBLEM, str(error)
    if isinstance(error, KeyboardInterrupt):
        message = "interrupted"
    _tell(message, style="red")
    raise typer.Exit(int(outcome))


# Commands ---------------------------------------------------------------------------------------


@app.command(epilog=EXIT_CODES)
@_guarded
def new(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="Default: <starter>.yaml")] = None,
    starter: Annotated[Starter, typer.Option("--from", help="What to start from.")] = Starter.SWAY,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file if it is there.")] = False,
) -> None:
    """Write a commented case to start from."""
    from cablesim.batch import OutputError
    from cablesim.starters import starter_text

    file = Path(f"{starter}.yaml") if file is None else file
    if file.exists() and not force:
        raise OutputError(f"{file} is already there. Choose another name, or overwrite it with --force.")
    with _writing(file):
        file.write_text(starter_text(starter, str(file), file.stem), encoding="utf-8")
    _say(f"{file} written; next: cablesim run {file}")


@app.command(epilog=EXIT_CODES)
@_guarded
def validate(cases: CasePaths) -> None:
    """Check cases and list everything that is wrong with each."""
    from cablesim.batch import explain_failure, load_scene

    worst = 0
    for path in cases:
        try:
            load_scene(path)
        except Exception as error:
            outcome, _, message = explain_failure(error)
            worst = max(worst, int(outcome))
            _tell(message if str(path) in message else f"{path}: {message}")
        else:
            _say(f"{path}: ok")
    raise typer.Exit(worst)


@app.command(epilog=EXIT_CODES)
@_guarded
def info(case: CasePath, overrides: Overrides = None) -> None:
    """Say what a case amounts to: mesh, unknowns, what is skipped, weights, natural scales."""
    from cablesim.batch import load_scene

    scene = load_scene(case, overrides or ())
    simulation = _initialised(scene)
    for title, rows in (
        ("mesh", _mesh_rows(simulation)),
        ("computed and skipped", _needs_rows(simulation)),
        ("weights", _weight_rows(simulation)),
        ("natural scales", _scale_rows(simulation)),
    ):
        table = _table("", "", title=f"{scene.name}: {title}")
        for name, value in rows.items():
            table.add_row(name, value)
        _say(table)


@app.command(epilog=EXIT_CODES)
@_guarded
def statics(
    case: CasePath,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Also write it to this file.")] = None,
    overrides: Overrides = None,
) -> None:
    """Find the rest shape of a case, its ends held where they are at t = 0."""
    from dataclasses import replace

    from cablesim.batch import check_writable, load_scene, write_result
    from cablesim.scene import EquilibriumShape, MarkerShape

    if output is not None:
        check_writable(output)
    scene = load_scene(case, overrides or ())
    if not isinstance(scene.initial, EquilibriumShape):
        guess = scene.initial.positions if isinstance(scene.initial, MarkerShape) else None
        scene = replace(scene, initial=EquilibriumShape(guess=guess))
    simulation = _initialised(replace(scene, output=replace(scene.output, variables=())))
    rest = _dataset_at_start(simulation)
    table = _table("", "", title=f"{scene.name}: rest shape")
    for name, value in _rest_rows(simulation, rest).items():
        table.add_row(name, value)
    _say(table)
    if output is not None:
        write_result(rest, output)
        _say(f"{output} written")


@app.command(epilog=EXIT_CODES)
@_guarded
def run(
    cases: CasePaths,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Existing folder, or for one case a file ending in .nc.")
    ] = Path("."),
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Cases computed side by side.")] = 1,
    overrides: Overrides = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only say what went wrong.")] = False,
) -> None:
    """Run cases; each writes <case>.nc, also when it stops early."""
    from cablesim.batch import plan_runs, run_all

    runs = plan_runs(cases, output, overrides or ())
    with _watcher(cases, quiet=quiet) as watcher:
        summaries = run_all(runs, jobs, watcher)
    if len(summaries) > 1 and not quiet:
        _say(_summary_table(summaries))
    raise typer.Exit(max(int(summary.outcome) for summary in summaries))


@app.command(epilog=EXIT_CODES)
@_guarded
def plot(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture (png, pdf, svg); default: <result>.png")
    ] = None,
) -> None:
    """Draw shapes, tensions and distances of a result."""
    from cablesim.batch import OutputError, check_writable
    from cablesim.plot import plot_run

    output = Path(f"{result.stem}.png") if output is None else output
    check_writable(output)
    figure = plot_run(_read_result(result))
    kinds = figure.canvas.get_supported_filetypes()
    if output.suffix[1:].lower() not in kinds:
        raise OutputError(f"cannot write {output}: its name must end in one of {', '.join(sorted(kinds))}.")
    with _writing(output):
        figure.savefig(output)
    _say(f"{output} written")


@app.command(epilog=EXIT_CODES)
@_guarded
def report(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="HTML file; default: <result>.html")
    ] = None,
) -> None:
    """Write a result as one HTML file: moving picture, lines against time, key numbers, case."""
    from cablesim.batch import OutputError, check_writable
    from cablesim.report import write_report

    output = Path(f"{result.stem}.html") if output is None else output
    if output.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"cannot write {output}: its name must end in .html.")
    check_writable(output)
    dataset = _read_result(result)
    with _writing(output):
        write_report(dataset, output)
    _say(f"{output} written ({output.stat().st_size / 1e6:.1f} MB); open it in a browser")


@app.command(epilog=EXIT_CODES)
@_guarded
def animate(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Film (mp4, gif); default: <result>.mp4")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Pictures per second of film; default 25, for a GIF 10.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Simulated seconds per second of film.")] = 1.0,
) -> None:
    """Write a result as a film of the cable in space, with tensions and distances beside it."""
    from cablesim import animation
    from cablesim.batch import check_writable

    output = Path(f"{result.stem}.mp4") if output is None else output
    check_writable(output)
    dataset = _read_result(result)
    with _writing(output):
        count = animation.animate(dataset, output, fps=fps, speed=speed)
    _say(f"{output} written, {count} pictures")


@app.command(epilog=EXIT_CODES)
@_guarded
def export(
    result: ResultPath,
    format: Annotated[Format, typer.Option("--format", "-f", help="Tables, or polylines for ParaView.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder; default: <result>_<format>, made if needed")
    ] = None,
) -> None:
    """Write a result as tables (csv) or as polylines for ParaView (vtk)."""
    from cablesim.batch import check_writable
    from cablesim.export import export_csv, export_vtk

    folder = Path(f"{result.stem}_{format}") if output is None else output
    check_writable(folder / "file" if folder.exists() else folder)
    dataset = _read_result(result)
    with _writing(folder / "file" if folder.exists() else folder):
        files = (
            export_csv(dataset, folder) if format is Format.CSV else export_vtk(dataset, folder, result.stem)
        )
    what = (
        f"{files[0].name} and {len(files) - 1} more" if len(files) > 6 else ", ".join(f.name for f in files)
    )
    _say(f"{folder}: {what} written")


@app.command(epilog=EXIT_CODES)
@_guarded
def imu(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File ending in .nc; default: <result>_imu.nc")
    ] = None,
    rate: Annotated[float, typer.Option("--rate", min=1e-3, help="Samples a second [Hz].")] = 100.0,
    frame: Annotated[
        ImuFrame, typer.Option("--frame", help="Frame of the cable: without twist, or the paper's.")
    ] = ImuFrame.TRANSPORTED,
    errors: Annotated[
        ImuErrorPreset, typer.Option("--errors", help="What the sensors do wrong.")
    ] = ImuErrorPreset.NONE,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the errors.")] = 0,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Folder for a table of each sensor too, made if needed")
    ] = None,
) -> None:
    """Write what the IMUs of a result's case would read."""
    from cablesim.batch import check_writable
    from cablesim.sensors import export_imu_csv, imu_signals
    from cablesim.trajectory.file import write

    output = Path(f"{result.stem}_imu.nc") if output is None else output
    place = None if csv is None else csv / "file" if csv.exists() else csv
    for file in (output, place):
        if file is not None:
            check_writable(file)
    chosen = None if errors is ImuErrorPreset.NONE else str(errors)
    signals = imu_signals(_read_result(result), rate=rate, frame=str(frame), errors=chosen, seed=seed)
    with _writing(output):
        write(signals, output)
    _say(f"{output}: {signals.sizes['imu']} sensors, {signals.sizes['time']} samples written")
    if csv is not None and place is not None:
        with _writing(place):
            files = export_imu_csv(signals, csv)
        _say(f"{csv}: {', '.join(file.name for file in files)} written")


@app.command(epilog=EXIT_CODES)
@_guarded
def schema(
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Default: standard output.")] = None,
) -> None:
    """Write the JSON Schema of case files, for editors."""
    import json

    from cablesim.case import case_schema

    text = json.dumps(case_schema(), indent=2, ensure_ascii=False)
    if output is None:
        _say(text)
        return
    with _writing(output):
        output.write_text(text + "\n", encoding="utf-8")
    _say(f"{output} written")


# What the commands show -------------------------------------------------------------------------


def _initialised(scene: Scene) -> Simulation:
    from cablesim.simulation import Simulation

    return Simulation(scene)


@contextmanager
def _writing(file: Path) -> Iterator[None]:
    """Check that a file can be written, and name it when that fails half-way."""
    from cablesim.batch import OutputError, check_writable

    check_writable(file)
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {file}: {error.strerror or error}. Is the disk full?") from None


def _dataset_at_start(simulation: Simulation) -> xr.Dataset:
    """Make a result of no duration: the initial state alone."""
    return simulation.present({"status": "completed", "message": "Rest shape."})


def _read_result(path: Path) -> xr.Dataset:
    from cablesim.batch import OutputError
    from cablesim.trajectory.file import read

    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise OutputError(f"{path} {what}. Name a result file, as `cablesim run` writes it.")
    try:
        return read(path)
    except Exception as error:  # netCDF4 and xarray raise many kinds for a damaged file
        reason = getattr(error, "strerror", None) or str(error).partition("\n")[0]
        raise OutputError(f"{path} cannot be read as a result (netCDF): {reason}.") from None


def _mesh_rows(simulation: Simulation) -> dict[str, str]:
    lengths, scene = simulation.mesh.lengths, simulation.scene
    states = int(scene.duration / scene.output.interval + 1e-9) + 1
    bodies = ", ".join(f"{a.name} at {a.position:g} m" for a in scene.attachments)
    return {
        "cable": f"{scene.cable.length:g} m in {lengths.size} segments of {_range(lengths, 'm')}",
        "attachments": bodies or "none",
        "winch": _winch_text(scene),
        "unknowns": f"{simulation.model.layout.size}{' at the start' if scene.winch else ''}",
        "run": f"{scene.duration:g} s, a state kept every {scene.output.interval:g} s ({states} states)",
    }


def _winch_text(scene: Scene) -> str:
    """What is out at the start and who says what goes in and out."""
    from cablesim.scene import Control

    if scene.winch is None:
        return "none"
    payout = scene.winch.payout
    if isinstance(payout, Control):
        driver = f"a controller every {payout.period:g} s"
    else:
        driver = f"a program of up to {payout.speed_limit(scene.duration):.3g} m/s"
    return f"{scene.winch.deployed_length:g} m out at the start; driven by {driver}"


def _needs_rows(simulation: Simulation) -> dict[str, str]:
    from cablesim.physics.needs import describe_needs

    return describe_needs(simulation.model.features)


def _weight_rows(simulation: Simulation) -> dict[str, str]:
    scene = simulation.scene
    cable = scene.cable
    total, largest = cable.wet_weight * cable.length, abs(cable.wet_weight * cable.length)
    rows = {
        "cable, dry": f"{cable.mass_per_length * cable.length:.4g} kg",
        "cable, in water": f"{cable.wet_weight * cable.length:.4g} N ({cable.wet_weight:.4g} N/m)",
    }
    for body in scene.attachments:
        weight = (body.mass - scene.water.density * body.volume) * scene.gravity
        rows[f"{body.name}, in water"] = f"{weight:.4g} N"
        total, largest = total + weight, max(largest, abs(weight))
    if abs(total) <= 1e-12 * largest:
        return rows | {"all, in water": "0 N (neutral)"}
    return rows | {"all, in water": f"{total:.4g} N ({'sinks' if total > 0 else 'floats'})"}


def _scale_rows(simulation: Simulation) -> dict[str, str]:
    """Wave speeds, and the highest frequencies of a chain of equal shortest segments."""
    from math import pi, sqrt

    from cablesim.physics.scales import scene_scales

    cable, shortest = simulation.scene.cable, float(simulation.mesh.lengths.min())
    axial = sqrt(cable.axial_stiffness / cable.mass_per_length)
    added = cable.added_mass_normal * simulation.scene.water.density * cable.displaced_section
    scales = scene_scales(simulation.scene, simulation.model, simulation.initial.y)
    rows = {
        "tension": f"{scales.tension:.4g} N",
        "velocity": f"{scales.velocity:.4g} m/s",
        "axial wave speed": f"{axial:.4g} m/s (sqrt(EA/m))",
        "transverse wave speed": f"{sqrt(scales.tension / (cable.mass_per_length + added)):.4g} m/s",
        "highest mesh frequency": f"{axial / (pi * shortest):.4g} Hz (axial)",
    }
    if cable.bending_stiffness > 0:
        bending = 2 / pi * sqrt(cable.bending_stiffness / (cable.mass_per_length + added)) / shortest**2
        rows["highest bending frequency"] = f"{bending:.4g} Hz"
    return rows


def _rest_rows(simulation: Simulation, rest: xr.Dataset) -> dict[str, str]:
    initial = simulation.initial
    position = rest["position"].isel(time=0).dropna("node").values
    lowest = int(position[:, 2].argmin())
    place = ", ".join(f"{value:.4g}" for value in position[lowest])
    tension = rest["tension"].isel(time=0).dropna("segment").values
    return {
        "found by": f"{initial.rung.value}, {initial.iterations} Newton iterations",
        "force left on a node": f"{initial.residual:.2g} N",
        "tension at end A": f"{tension[0]:.4g} N",
        "tension at end B": f"{tension[-1]:.4g} N",
        "tension along the cable": _range(tension, "N"),
        "lowest point": f"({place}) m, s = {simulation.mesh.nodes[lowest]:.4g} m",
    }


def _range(values: Any, unit: str) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _result_line(summary: RunSummary) -> str:
    """Tell status, simulated time, wall time, real-time factor, work and file on one line."""
    if summary.file is None:
        return f"{summary.case}: {summary.status}"
    return (
        f"{summary.case}: {summary.status}, {summary.simulated_seconds:g} s in {summary.wall_seconds:.3g} s, "
        f"{summary.real_time_factor:.3g} x real time, {summary.residual_calls} residual calls, {summary.file}"
    )


def _summary_table(summaries: list[RunSummary]) -> Any:
    table = _table("case", "status", "simulated", "wall", "x real time", "file")
    for summary in summaries:
        numbers = ["", "", ""]
        if summary.file is not None:
            numbers = [
                f"{summary.simulated_seconds:g} s",
                f"{summary.wall_seconds:.3g} s",
                f"{summary.real_time_factor:.3g}",
            ]
        table.add_row(summary.case.stem, summary.status, *numbers, str(summary.file or "-"))
    return table


@contextmanager
def _watcher(cases: list[Path], *, quiet: bool) -> Iterator[Any]:
    """Make what shows the runs: with bars on a terminal."""
    from cablesim.batch import Outcome, Watcher

    bars = sys.stderr.isatty() and not quiet
    say = _tell if bars and sys.stdout.isatty() else _say  # above the bars, not across them

    class Reporter(Watcher):
        """Says how each run ended."""

        def finished(self, index: int, summary: RunSummary) -> None:
            for text in summary.warnings:
                _tell(f"warning: {summary.case}: {text}", style="yellow")
            if not quiet:
                say(_result_line(summary))
            if summary.outcome is not Outcome.COMPLETED:
                _tell(summary.message, style="red")

    if not bars:
        yield Reporter()
        return
    with _progress() as progress:

        class Bars(Reporter):
            """Also shows how far each run is."""

            def __init__(self) -> None:
                self._tasks: dict[int, Any] = {}

            def progressed(self, index: int, time: float, duration: float) -> None:
                if index not in self._tasks:
                    self._tasks[index] = progress.add_task(cases[index].stem, total=duration)
                progress.update(self._tasks[index], completed=time)

            def finished(self, index: int, summary: RunSummary) -> None:
                if index in self._tasks:
                    progress.remove_task(self._tasks[index])
                super().finished(index, summary)

        yield Bars()


def _progress() -> Any:
    """Bars with simulated time and real-time factor."""
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.text import Text

    class Pace(ProgressColumn):
        """Simulated over wall-clock time."""

        def render(self, task: Task) -> Text:
            elapsed = task.finished_time or task.elapsed
            return Text(f"{task.completed / elapsed:.3g} x real time" if elapsed else "")

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.4g} of {task.total:g} s"),
        Pace(),
        console=_console(stderr=True),
        transient=True,
        redirect_stdout=False,
    )


def main() -> None:
    """Run the command line."""
    app()
