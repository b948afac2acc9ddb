"""What shows the runs while they go on and end: a line each, and bars on a terminal.

Depends on: terminal, tables, batch (imported when a run begins).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from cablesim.cli.tables import result_line
from cablesim.cli.terminal import console, say, tell, warn

if TYPE_CHECKING:
    from cablesim.batch import RunSummary


@contextmanager
def watcher(names: Sequence[str], *, quiet: bool) -> Iterator[Any]:
    """Make what shows the runs: with bars on a terminal."""
    from cablesim.batch import Outcome, Watcher, name_of

    bars = sys.stderr.isatty() and not quiet
    show = tell if bars and sys.stdout.isatty() else say  # above the bars, not across them

    class Reporter(Watcher):
        """Says how each run ended."""

        def finished(self, index: int, summary: RunSummary) -> None:
            warn(*(f"{name_of(summary.case)}: {text}" for text in summary.warnings))
            if not quiet:
                show(result_line(summary))
            if summary.outcome is not Outcome.COMPLETED:
                tell(summary.message, style="red")

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
                    self._tasks[index] = progress.add_task(names[index], total=duration)
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
        console=console(stderr=True),
        transient=True,
        redirect_stdout=False,
    )
