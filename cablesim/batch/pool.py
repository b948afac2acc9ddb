"""Runs in worker processes, side by side.

Depends on: interrupts, plan, execute, summary.
"""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import signal
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from logging.handlers import QueueHandler
from multiprocessing import connection
from multiprocessing.connection import Connection
from typing import Any

from cablesim.batch.execute import execute, not_started
from cablesim.batch.plan import Run
from cablesim.batch.summary import Outcome, RunSummary, Watcher
from cablesim.interrupts import SIGNALS, mask_interrupts, on_interrupt

log = logging.getLogger("cablesim")

_LOOK_AT_PROGRESS = 0.2  # [s]


class SideBySide:
    """Worker processes on a list of runs; one that dies takes the run it has with it, and no other.

    Each has a connection of its own: nothing is shared that it could leave locked or half written.
    """

    def __init__(self, runs: Sequence[Run], jobs: int, watcher: Watcher) -> None:
        self._runs = runs
        self._jobs = min(jobs, len(runs))
        self._watcher = watcher
        self._context = multiprocessing.get_context("spawn")
        self._board = _Board(self._context, len(runs))
        self._idle: list[_Worker] = []
        self._busy: list[_Worker] = []
        self._summaries: dict[int, RunSummary] = {}

    def summaries(self) -> list[RunSummary]:
        """Run everything."""
        waiting = deque(range(len(self._runs)))
        # first interrupt: stop the runs and write what they have; second: end the processes
        with on_interrupt(self._interrupt):
            try:
                while waiting or self._busy:
                    while waiting and len(self._busy) < self._jobs:
                        self._hand_out(waiting.popleft())
                    self._listen()
            finally:
                self._dismiss()
        return [self._summaries[index] for index in range(len(self._runs))]

    def _hand_out(self, index: int) -> None:
        worker = self._idle.pop() if self._idle else _Worker(self._context, self._board)
        worker.index = index
        self._busy.append(worker)
        try:
            worker.connection.send((index, self._runs[index]))
        except OSError:
            self._lose(worker)

    def _listen(self) -> None:
        """Take what the workers say, and look how far they are."""
        by_connection = {worker.connection: worker for worker in self._busy}
        for ready in connection.wait(list(by_connection), _LOOK_AT_PROGRESS):
            worker = by_connection[ready]
            try:
                said = worker.connection.recv()
            except (EOFError, OSError):
                self._lose(worker)
                continue
            if isinstance(said, RunSummary):
                self._busy.remove(worker)
                self._idle.append(worker)
                self._finish(worker.index, said)
            else:
                log.handle(said)
        for worker in self._busy:
            now, duration = self._board.get(worker.index)
            if duration > 0:
                self._watcher.progressed(worker.index, now, duration)

    def _lose(self, worker: _Worker) -> None:
        self._busy.remove(worker)
        run = self._runs[worker.index]
        if self._board.stopping:
            summary = replace(not_started(run), message="Interrupted at once; nothing was written.")
        else:
            summary = RunSummary(
                case=run.case, outcome=Outcome.STOPPED, status="worker died", message=worker.obituary()
            )
        self._finish(worker.index, summary)

    def _finish(self, index: int, summary: RunSummary) -> None:
        self._summaries[index] = summary
        self._watcher.finished(index, summary)

    def _interrupt(self) -> None:
        if self._board.stopping:
            for worker in self._busy:
                worker.process.kill()
        self._board.stop()

    def _dismiss(self) -> None:
        """Let the workers end; those that are busy after a failure here write what they have."""
        if self._busy:
            self._board.stop()
        for worker in (*self._idle, *self._busy):
            worker.connection.close()
        for worker in (*self._idle, *self._busy):
            worker.process.join()


class _Worker:
    """A process, the connection to it, and the run that it has."""

    def __init__(self, context: Any, board: _Board) -> None:
        self.index = -1
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, board, log.getEffectiveLevel()))
        mask_interrupts("SIG_BLOCK")  # the process must not see one before it ignores them
        try:
            self.process.start()
        finally:
            mask_interrupts("SIG_UNBLOCK")
        theirs.close()

    def obituary(self) -> str:
        """Say how the process ended."""
        self.process.join()
        code = self.process.exitcode
        if code < 0:
            name = signal.Signals(-code).name
            why = f"was killed by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")
        else:
            why = f"ended with exit code {code}"
        return f"The worker process of this case {why}; nothing was written. Run the case again by itself."


def _serve(parent: Connection, board: _Board, level: int) -> None:
    """Take runs from the parent until it hangs up.

    Interrupts are left to the parent, which stops its workers through the board.
    """
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    mask_interrupts("SIG_UNBLOCK")
    to_parent = _ToParent(parent)
    log.addHandler(to_parent)
    log.setLevel(level)
    try:
        while True:
            index, run = parent.recv()
            to_parent.enqueue(not_started(run) if board.stopping else execute(run, partial(board.set, index)))
    except (EOFError, OSError):
        return


class _ToParent(QueueHandler):
    """Sends records, and summaries, over the connection to the parent."""

    def __init__(self, parent: Connection) -> None:
        super().__init__(parent)  # type: ignore[arg-type]
        self._sending = threading.Lock()

    def enqueue(self, record: Any) -> None:
        with self._sending:
            self.queue.send(record)  # type: ignore[attr-defined]


class _Board:
    """Memory that all processes see: how far each run is, and whether to stop."""

    def __init__(self, context: Any, runs: int) -> None:
        self._times = context.RawArray(ctypes.c_double, 2 * runs)
        self._stop = context.RawValue(ctypes.c_bool, False)

    @property
    def stopping(self) -> bool:
        """Whether the runs are to end, as they also are when the parent is gone."""
        parent = multiprocessing.parent_process()
        return bool(self._stop.value) or (parent is not None and not parent.is_alive())

    def stop(self) -> None:
        """Have all runs end."""
        self._stop.value = True

    def set(self, index: int, now: float, duration: float) -> None:
        """Note how far a run is; this is also where a worker learns that it is to stop."""
        self._times[2 * index], self._times[2 * index + 1] = now, duration
        if self.stopping:
            raise KeyboardInterrupt

    def get(self, index: int) -> tuple[float, float]:
        """How far a run is, and its duration [s]."""
        return self._times[2 * index], self._times[2 * index + 1]
