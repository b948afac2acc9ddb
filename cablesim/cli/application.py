"""The application: its exit codes, the arguments that commands share, and what a command is made with.

Depends on: terminal, batch (imported when something goes wrong).
"""

from __future__ import annotations

import _thread
import functools
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from cablesim.cli.terminal import odd_things_shown, say, show_log, tell

EXIT_CODES = (
    "Exit codes: 0 all completed; 1 a run stopped before its end (the file with what was computed is "
    "written); 2 a case or the command line was refused; 3 a file could not be read or written; "
    "130 interrupted by Ctrl-C (the file with what was computed is written)."
)

app = typer.Typer(
    help="Dynamics of tethers in water. A case file is trusted input: running it runs the controller that it "
    "names.",
    epilog=EXIT_CODES,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

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


def _show_version(wanted: bool) -> None:
    if wanted:
        from cablesim import __version__

        say(f"cablesim {__version__}")
        raise typer.Exit


@app.callback()
def _application(
    version: Annotated[
        bool,
        typer.Option("--version", help="Say which version this is.", callback=_show_version, is_eager=True),
    ] = False,
) -> None:
    pass


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Make a function a command of the application."""
    return app.command(epilog=EXIT_CODES)(_guarded(function))


def _pass_over(failure: Any) -> None:
    """Keep quiet about errors in clean-up, as of an interrupted compiler, but do not lose a Ctrl-C to one."""
    if issubclass(failure.exc_type, KeyboardInterrupt):
        _thread.interrupt_main()
    logging.getLogger("cablesim").debug("%s", failure.exc_value)


def _guarded(command: Callable[..., None]) -> Callable[..., None]:
    """Turn whatever a command raises into a message and an exit code."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        show_log(quiet=kwargs.get("quiet", False))
        sys.unraisablehook = _pass_over
        try:
            with odd_things_shown():
                command(*args, **kwargs)
        except (typer.Exit, BrokenPipeError):
            raise
        except (Exception, KeyboardInterrupt) as error:
            _leave(error)

    return guarded


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
    tell(message, style="red")
    raise typer.Exit(int(outcome))
