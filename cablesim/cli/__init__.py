"""The command line: new, validate, info, statics, run, plot, report, animate, export, imu, schema.

Depends on: all of cablesim, imported when a command needs it.

Exit codes, the highest that applies when there are several cases:

====  ===========================================================================================
0     everything completed
1     a run stopped before its end; the file with what was computed is written
2     a case, or the command line, was refused
3     a file could not be read or written
130   interrupted by Ctrl-C, SIGTERM or SIGHUP; the file with what was computed is written
====  ===========================================================================================

Results go to standard output; progress, messages and errors to standard error.
"""

from cablesim.cli import on_cases, on_results
from cablesim.cli.application import app as app
from cablesim.cli.terminal import open_closed_streams, show_all_letters

__all__ = ["app", "main", "on_cases", "on_results"]


def main() -> None:
    """Run the command line."""
    open_closed_streams()
    show_all_letters()
    app()
