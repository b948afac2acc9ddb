"""One run: its case is built, simulated and written.

Depends on: source, plan, summary; interrupts, files; simulation and trajectory when the run begins.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from cablesim.batch.plan import Run
from cablesim.batch.source import load_scene
from cablesim.batch.summary import Outcome, RunSummary, explain_failure
from cablesim.files import Product, replacing
from cablesim.interrupts import on_interrupt

if TYPE_CHECKING:
    import xarray as xr

    from cablesim.simulation import Progress


def not_started(run: Run) -> RunSummary:
    """Summarise a run that an interrupt kept from starting."""
    return RunSummary(
        case=run.case, outcome=Outcome.INTERRUPTED, status="interrupted", message="The run was not started."
    )


def execute(run: Run, progressed: Callable[[float, float], None]) -> RunSummary:
    """Run one case and write its result; every failure ends in a summary, none in an exception."""
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            summary = _simulate_and_write(run, progressed)
    except (Exception, KeyboardInterrupt) as error:
        summary = _failed(run, error)
    odd = [str(warning.message) for warning in caught if issubclass(warning.category, UserWarning)]
    return replace(summary, warnings=(*odd, *summary.warnings))


def _simulate_and_write(run: Run, progressed: Callable[[float, float], None]) -> RunSummary:
    scene = load_scene(run.case, run.overrides, run.text)
    from cablesim.simulation import simulate

    def report(progress: Progress) -> None:
        progressed(progress.time, progress.duration)

    return _write(run, simulate(scene, progress=report))


def _write(run: Run, dataset: xr.Dataset) -> RunSummary:
    status = str(dataset.attrs.get("status", "completed"))
    from cablesim.plausibility import warnings_of

    with on_interrupt(lambda: None):  # a second Ctrl-C must not cost the result
        write_result(dataset, run.product())
    return RunSummary(
        case=run.case,
        outcome=_OUTCOMES.get(status, Outcome.STOPPED),
        status=status,
        message=str(dataset.attrs.get("message", "")),
        file=run.file,
        simulated_seconds=float(dataset["time"][-1] - dataset["time"][0]),
        wall_seconds=float(dataset.attrs.get("wall_seconds", 0.0)),
        residual_calls=int(dataset.attrs.get("residual_calls", 0)),
        warnings=warnings_of(dataset),
    )


_OUTCOMES = {
    "completed": Outcome.COMPLETED,
    "interrupted": Outcome.INTERRUPTED,
    "refused": Outcome.REFUSED,
}


def write_result(dataset: xr.Dataset, product: Product) -> None:
    """Write a result, and in it what made it; an earlier file stays unless all of the new one is there.

    Raises
    ------
    OutputError
        If it cannot be written, for instance because the disk is full.
    """
    from cablesim.trajectory.file import write

    with replacing(product.file) as part:
        try:
            write(dataset.assign_attrs(maker=product.maker), part)
        except RuntimeError as error:  # what netCDF4 makes of some errors of the disk
            raise OSError(str(error)) from None


def _failed(run: Run, error: BaseException) -> RunSummary:
    outcome, status, message = explain_failure(error)
    return RunSummary(case=run.case, outcome=outcome, status=status, message=message)
