"""Runs in worker processes, side by side.

Depends on: plan, execute, summary, interrupts.
"""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import signal
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import partial
from logging.handlers import QueueHandler, QueueListener
from typing import Any

from cablesim.batch.execute import execute, not_started
from cablesim.batch.interrupts import mask_interrupts, on_interrupt
from cablesim.batch.plan import Run
from cablesim.batch.summary import Outcome, RunSummary, Watcher

log = logging.getLogger("cablesim")


class _Board:
    """Memory that all processes see: how far each run is, and whether to stop."""

    def __init__(self, context: Any, runs: int) -> None:
        self._times = context.RawArray(ctypes.c_double, 2 * runs)
        self._stop = context.RawValue(ctypes.c_bool, False)

    @property
    def stopping(self) -> bool:
        return bool(self._stop.value)

    def stop(self) -> None:
        self._stop.value = True

    def set(self, index: int, now: float, duration: float) -> None:
        """Note how far a run is; this is also where a worker learns that it is to stop."""
        self._times[2 * index], self._times[2 * index + 1] = now, duration
        if self.stopping:
            raise KeyboardInterrupt

    def get(self, index: int) -> tuple[float, float]:
        return self._times[2 * index], self._times[2 * index + 1]


_board: _Board | None = None  # of this worker process


def _startworker(board: _Board, queue: Any) -> None:
    """Leave Ctrl-C to the parent, which stops its workers through the board."""
    global _board
    _board = board
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    mask_interrupts("SIG_UNBLOCK")
    log.addHandler(QueueHandler(queue))
    log.setLevel(logging.INFO)


def work(index: int, run: Run) -> RunSummary:
    """Run one case in a worker process."""
    assert _board is not None
    if _board.stopping:
        return not_started(run)
    return execute(run, partial(_board.set, index))


class SideBySide:
    """Worker processes on a list of runs."""

    def __init__(self, runs: Sequence[Run], jobs: int, watcher: Watcher) -> None:
        self._runs = runs
        self._jobs = min(jobs, len(runs))
        self._watcher = watcher
        self._context = multiprocessing.get_context("spawn")
        self._board = _Board(self._context, len(runs))
        self._others = multiprocessing.active_children()
        self._summaries: dict[int, RunSummary] = {}

    def summaries(self) -> list[RunSummary]:
        """Run everything."""
        queue = self._context.Queue()
        listener = QueueListener(queue, _Relay())
        listener.start()
        try:
            # first Ctrl-C: stop the runs and write what they have; second: end the processes
            with self._pool(queue) as pool, on_interrupt(self._interrupt):
                self._wait(self._submit(pool))
        finally:
            listener.stop()
        return [self._summaries[index] for index in range(len(self._runs))]

    def _pool(self, queue: Any) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._jobs,
            mp_context=self._context,
            initializer=_startworker,
            initargs=(self._board, queue),
        )

    def _submit(self, pool: ProcessPoolExecutor) -> dict[Future[RunSummary], int]:
        """Hand out the work; the processes, which start now, must not see Ctrl-C before they ignore it."""
        mask_interrupts("SIG_BLOCK")
        try:
            return {pool.submit(work, index, run): index for index, run in enumerate(self._runs)}
        finally:
            mask_interrupts("SIG_UNBLOCK")

    def _wait(self, futures: dict[Future[RunSummary], int]) -> None:
        pending = set(futures)
        while pending:
            done, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
            for future in done:
                self._finish(futures[future], future)
            for future in pending:
                now, duration = self._board.get(futures[future])
                if duration > 0:
                    self._watcher.progressed(futures[future], now, duration)

    def _finish(self, index: int, future: Future[RunSummary]) -> None:
        try:
            summary = future.result()
        except BrokenProcessPool:
            summary = self._died(self._runs[index])
        self._summaries[index] = summary
        self._watcher.finished(index, summary)

    def _died(self, run: Run) -> RunSummary:
        if self._board.stopping:
            return replace(not_started(run), message="Interrupted at once; nothing was written.")
        return RunSummary(
            case=run.case,
            outcome=Outcome.STOPPED,
            status="worker died",
            message="A worker process was killed (out of memory?). Run this case again, with fewer jobs.",
        )

    def _interrupt(self) -> None:
        if self._board.stopping:
            for child in multiprocessing.active_children():
                if child not in self._others:
                    child.terminate()
        self._board.stop()


class _Relay(logging.Handler):
    """Hands the records of the workers to this process's logger."""

    def emit(self, record: logging.LogRecord) -> None:
        log.handle(record)
