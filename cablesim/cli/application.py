"""The application: its exit codes, the arguments that commands share, and what a command is made with.

Depends on: terminal; interrupts, batch (imported when something goes wrong).
"""

from __future__ import annotations

import _thread
import functools
import inspect
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from cablesim.cli.terminal import lost_output, odd_things_shown, say, show_log, tell
from cablesim.interrupts import on_interrupt, raise_interrupt

FILE_PROBLEM = 3

EXIT_CODES = (
    "Exit codes: 0 all completed; 1 a run stopped before its end (the file with what was computed is "
    "written); 2 a case or the command line was refused; 3 a file could not be read or written; "
    "130 interrupted by Ctrl-C, SIGTERM or SIGHUP (the file with what was computed is written)."
)

app = typer.Typer(
    help="Dynamics of tethers in water. A case file is trusted input: running it runs the controller that it "
    "names.",
    epilog=EXIT_CODES,
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

CasePath = Annotated[Path, typer.Argument(metavar="CASE", help="Case file (YAML); - for standard input.")]
CasePaths = Annotated[
    list[Path], typer.Argument(metavar="CASE...", help="Case files (YAML); - for standard input.")
]
ResultPath = Annotated[Path, typer.Argument(metavar="RESULT", help="Result file (netCDF).")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a value of the case, e.g. simulation.relative_tolerance=1e-5; repeatable.",
    ),
]
Force = Annotated[
    bool,
    typer.Option("--force", help="Replace also a file that is no earlier result of the same case or result."),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Also show the log of the program's work.")]


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
    """Make a function a command of the application, with an option that shows the whole log.

    Whatever it raises becomes a message and an exit code.
    """

    @functools.wraps(function)
    def guarded(*args: Any, verbose: bool = False, **kwargs: Any) -> None:
        show_log(quiet=kwargs.get("quiet", False), verbose=verbose)
        sys.unraisablehook = _pass_over
        try:
            with odd_things_shown(), on_interrupt(raise_interrupt):
                function(*args, **kwargs)
            code = 0
        except typer.Exit as leaving:
            code = leaving.exit_code
        except (Exception, KeyboardInterrupt) as error:
            code = _explain(error)
        lost = lost_output()
        if lost:
            tell(lost, style="red")
            code = max(code, FILE_PROBLEM)
        raise typer.Exit(code)

    signature = inspect.signature(function, eval_str=True)
    option = inspect.Parameter("verbose", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Verbose)
    parameters = [*signature.parameters.values(), option]
    guarded.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    guarded.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return app.command(epilog=EXIT_CODES)(guarded)


def _pass_over(failure: Any) -> None:
    """Keep quiet about errors in clean-up, as of an interrupted compiler, but do not lose a Ctrl-C to one."""
    if issubclass(failure.exc_type, KeyboardInterrupt):
        _thread.interrupt_main()
    logging.getLogger("cablesim").debug("%s", failure.exc_value)


def _explain(error: BaseException) -> int:
    """Say what went wrong; returns its exit code."""
    from cablesim.batch import explain_failure

    outcome, _, message = explain_failure(error)
    # about a file; the modules of these are slow to import
    if type(error).__name__ in ("ExportError", "PlotError", "SensorError"):
        outcome, message = outcome.FILE_PROBLEM, str(error)
    if isinstance(error, KeyboardInterrupt):
        message = "interrupted"
    tell(message, style="red")
    return int(outcome)
