"""Runs many cases, side by side if asked, writes one result file each and says how each ended.

Depends on: case, files; build, simulation, trajectory, imported when a run begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cablesim.batch.execute import execute, not_started
from cablesim.batch.execute import write_result as write_result
from cablesim.batch.plan import Run as Run
from cablesim.batch.plan import plan_runs as plan_runs
from cablesim.batch.plan import plan_statics as plan_statics
from cablesim.batch.source import load_scene as load_scene
from cablesim.batch.source import name_of as name_of
from cablesim.batch.source import read_case as read_case
from cablesim.batch.summary import Outcome as Outcome
from cablesim.batch.summary import RunSummary as RunSummary
from cablesim.batch.summary import Watcher as Watcher
from cablesim.batch.summary import explain_failure as explain_failure
from cablesim.files import OutputError as OutputError
from cablesim.interrupts import Interrupts


def run_many(
    paths: Sequence[str | Path],
    output_directory: str | Path = ".",
    jobs: int = 1,
    *,
    overrides: Sequence[str] = (),
    force: bool = False,
    watcher: Watcher | None = None,
) -> list[RunSummary]:
    """Run cases and write ``<case stem>.nc`` for each; one that fails does not stop the others.

    Parameters
    ----------
    paths : sequence of paths
        Case files; one may be ``-``, standard input.
    output_directory : path
        An existing folder.
    jobs : int
        Number of worker processes; with 1 the cases run in this process, one after the other.
        More need the ``if __name__ == "__main__":`` of multiprocessing around the calling script.
    overrides : sequence of str
        ``key=value``, set in every case, for instance ``simulation.relative_tolerance=1e-5``.
    force : bool
        Replace also files that are no earlier results of the same case.
    watcher : Watcher, optional
        Told how the runs go.

    Returns
    -------
    list of RunSummary
        In the order of `paths`.

    Raises
    ------
    OutputError
        If a result could not be written there, or would replace what it must not; nothing has run then.
    """
    return run_all(plan_runs(paths, output_directory, overrides, force=force), jobs, watcher)


def run_all(runs: Sequence[Run], jobs: int = 1, watcher: Watcher | None = None) -> list[RunSummary]:
    """Run what `plan_runs` planned; see `run_many`."""
    watcher = Watcher() if watcher is None else watcher
    if jobs > 1 and len(runs) > 1:
        from cablesim.batch.pool import SideBySide

        return SideBySide(runs, jobs, watcher).summaries()
    return _one_after_the_other(runs, watcher)


def _one_after_the_other(runs: Sequence[Run], watcher: Watcher) -> list[RunSummary]:
    summaries: list[RunSummary] = []
    with Interrupts() as interrupts:

        def progressed(index: int, now: float, duration: float) -> None:
            interrupts.check()
            watcher.progressed(index, now, duration)

        for index, run in enumerate(runs):
            go_on = not interrupts.seen
            summary = execute(run, partial(progressed, index)) if go_on else not_started(run)
            watcher.finished(index, summary)
            summaries.append(summary)
    return summaries
