"""Runs many cases, side by side if asked, writes one result file each and says how each ended.

Depends on: case, build, simulation, trajectory (the last three are imported when a run begins).
"""

from __future__ import annotations

import contextlib
import ctypes
import logging
import multiprocessing
import os
import signal
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from logging.handlers import QueueHandler, QueueListener
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cablesim.case import Case, CaseError, Problem
from cablesim.case.errors import path_text
from cablesim.case.read import read_yaml

if TYPE_CHECKING:
    import xarray as xr

    from cablesim.scene import Scene
    from cablesim.simulation import Progress

log = logging.getLogger("cablesim")


class Outcome(IntEnum):
    """How a run ended; the value is the exit code of the command line."""

    COMPLETED = 0
    STOPPED = 1
    REFUSED = 2
    FILE_PROBLEM = 3
    INTERRUPTED = 130


class OutputError(OSError):
    """A result cannot be written where it was asked for; the message says why."""


@dataclass(frozen=True)
class Run:
    """One case, the file its result goes to, and what is changed in it (``key=value``)."""

    case: Path
    file: Path
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """How one run ended.

    Attributes
    ----------
    case : Path
        The case file.
    outcome : Outcome
        What it means for the caller.
    status, message : str
        As in the result's attributes: a word, and a sentence.
    file : Path or None
        The result, when one was written.
    simulated_seconds, wall_seconds : float
        How far the run came, and how long the integration took [s].
    residual_calls : int
        Work done by the integrator.
    warnings : tuple of str
        What is odd about the case.
    """

    case: Path
    outcome: Outcome
    status: str
    message: str
    file: Path | None = None
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    residual_calls: int = 0
    warnings: tuple[str, ...] = ()

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall-clock seconds."""
        return self.simulated_seconds / self.wall_seconds if self.wall_seconds > 0 else 0.0


class Watcher:
    """Told how the runs go, by their index; this one does nothing."""

    def progressed(self, index: int, time: float, duration: float) -> None:
        """Learn that a run came to `time` of `duration` [s]."""

    def finished(self, index: int, summary: RunSummary) -> None:
        """Learn that a run ended."""


def run_many(
    paths: Sequence[str | Path],
    output_directory: str | Path = ".",
    jobs: int = 1,
    *,
    overrides: Sequence[str] = (),
    watcher: Watcher | None = None,
) -> list[RunSummary]:
    """Run cases and write ``<case stem>.nc`` for each; one that fails does not stop the others.

    Parameters
    ----------
    paths : sequence of paths
        Case files.
    output_directory : path
        An existing folder.
    jobs : int
        Number of worker processes; with 1 the cases run in this process, one after the other.
        More need the ``if __name__ == "__main__":`` of multiprocessing around the calling script.
    overrides : sequence of str
        ``key=value``, set in every case, for instance ``simulation.relative_tolerance=1e-5``.
    watcher : Watcher, optional
        Told how the runs go.

    Returns
    -------
    list of RunSummary
        In the order of `paths`.

    Raises
    ------
    OutputError
        If a result could not be written there; nothing has run then.
    """
    return run_all(plan_runs(paths, output_directory, overrides), jobs, watcher)


def plan_runs(
    paths: Sequence[str | Path], output: str | Path = ".", overrides: Sequence[str] = ()
) -> list[Run]:
    """Decide where each result goes, and check before anything runs that it can be written there.

    Parameters
    ----------
    paths : sequence of paths
        Case files.
    output : path
        An existing folder, or for a single case a file ending in ``.nc``.
    overrides : sequence of str
        ``key=value``, set in every case.

    Raises
    ------
    OutputError
        If a folder is missing or not writable, or two results would have the same name.
    """
    cases, output = [Path(path) for path in paths], Path(output)
    if output.suffix == ".nc" and not output.is_dir():
        if len(cases) > 1:
            raise OutputError(f"{output} is one file for {len(cases)} cases. Give a folder with --output.")
        files = [output]
    else:
        files = [output / f"{case.stem}.nc" for case in cases]
    for index, file in enumerate(files):
        if file in files[:index]:
            first = cases[files.index(file)]
            raise OutputError(f"{first} and {cases[index]} would both be written to {file}. Rename one.")
        check_writable(file)
    return [Run(case, file, tuple(overrides)) for case, file in zip(cases, files, strict=True)]


def check_writable(file: Path) -> None:
    """Raise an `OutputError` unless `file` can be written."""
    folder = file.parent
    if not folder.is_dir():
        what = (
            "is not a folder. Name one" if folder.exists() else "does not exist. Create it, or name another"
        )
        raise OutputError(f"cannot write {file}: {folder} {what}.")
    if file.is_dir():
        raise OutputError(f"cannot write {file}: it is a folder. Name a file in it.")
    if file.exists() and not os.access(file, os.W_OK):
        raise OutputError(f"cannot write {file}: the file is there and write-protected.")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"cannot write {file}: {error.strerror or error}.") from None


def run_all(runs: Sequence[Run], jobs: int = 1, watcher: Watcher | None = None) -> list[RunSummary]:
    """Run what `plan_runs` planned; see `run_many`."""
    watcher = Watcher() if watcher is None else watcher
    if jobs > 1 and len(runs) > 1:
        return _SideBySide(runs, jobs, watcher).summaries()
    return _one_after_the_other(runs, watcher)


def _one_after_the_other(runs: Sequence[Run], watcher: Watcher) -> list[RunSummary]:
    summaries: list[RunSummary] = []
    with _Interrupts() as interrupts:

        def progressed(index: int, now: float, duration: float) -> None:
            interrupts.check()
            watcher.progressed(index, now, duration)

        for index, run in enumerate(runs):
            go_on = not interrupts.seen
            summary = _execute(run, partial(progressed, index)) if go_on else _not_started(run)
            watcher.finished(index, summary)
            summaries.append(summary)
    return summaries


class _Interrupts:
    """Remembers Ctrl-C: the interrupt itself gets lost when it arrives inside a compiler's callback."""

    def __init__(self) -> None:
        self.seen = False

    def __enter__(self) -> _Interrupts:
        self._undo = contextlib.ExitStack()
        self._undo.enter_context(_on_interrupt(self._handle))
        return self

    def __exit__(self, *_: object) -> None:
        self._undo.close()

    def check(self) -> None:
        """Raise the interrupt that was seen."""
        if self.seen:
            raise KeyboardInterrupt

    def _handle(self) -> None:
        self.seen = True
        raise KeyboardInterrupt


@contextlib.contextmanager
def _on_interrupt(handle: Callable[[], None]) -> Iterator[None]:
    """Call `handle` at Ctrl-C, where it is this thread's to handle and not ignored (as under nohup)."""
    in_main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    if not in_main or before is None or before is signal.SIG_IGN:
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: handle())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _not_started(run: Run) -> RunSummary:
    return RunSummary(
        case=run.case, outcome=Outcome.INTERRUPTED, status="interrupted", message="The run was not started."
    )


# One run ----------------------------------------------------------------------------------------


def _execute(run: Run, progressed: Callable[[float, float], None]) -> RunSummary:
    """Run one case and write its result; every failure ends in a summary, none in an exception."""
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            summary = _simulate_and_write(run, progressed)
    except (Exception, KeyboardInterrupt) as error:
        summary = _failed(run, error)
    odd = tuple(str(warning.message) for warning in caught if issubclass(warning.category, UserWarning))
    return replace(summary, warnings=odd)


def _simulate_and_write(run: Run, progressed: Callable[[float, float], None]) -> RunSummary:
    scene = load_scene(run.case, run.overrides)
    from cablesim.simulation import simulate

    def report(progress: Progress) -> None:
        progressed(progress.time, progress.duration)

    return _write(run, simulate(scene, progress=report))


def _write(run: Run, dataset: xr.Dataset) -> RunSummary:
    status = str(dataset.attrs.get("status", "completed"))
    with _on_interrupt(lambda: None):  # a second Ctrl-C must not cost the result
        write_result(dataset, run.file)
    return RunSummary(
        case=run.case,
        outcome=_OUTCOMES.get(status, Outcome.STOPPED),
        status=status,
        message=str(dataset.attrs.get("message", "")),
        file=run.file,
        simulated_seconds=float(dataset["time"][-1] - dataset["time"][0]),
        wall_seconds=float(dataset.attrs.get("wall_seconds", 0.0)),
        residual_calls=int(dataset.attrs.get("residual_calls", 0)),
    )


_OUTCOMES = {
    "completed": Outcome.COMPLETED,
    "interrupted": Outcome.INTERRUPTED,
    "refused": Outcome.REFUSED,
}


def write_result(dataset: xr.Dataset, file: Path) -> None:
    """Write a result; an earlier file stays as it was unless all of the new one is there.

    Raises
    ------
    OutputError
        If it cannot be written, for instance because the disk is full.
    """
    from cablesim.trajectory.file import write

    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        write(dataset, part)
        part.replace(file)
    except (OSError, RuntimeError) as error:  # netCDF4 raises RuntimeError for some errors of the disk
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"cannot write {file}: {reason}. Is the disk full?") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def _failed(run: Run, error: BaseException) -> RunSummary:
    outcome, status, message = explain_failure(error)
    return RunSummary(case=run.case, outcome=outcome, status=status, message=message)


def explain_failure(error: BaseException) -> tuple[Outcome, str, str]:
    """Outcome, status and message of what went wrong before there was a result."""
    if isinstance(error, KeyboardInterrupt):
        return Outcome.INTERRUPTED, "interrupted", "Interrupted before there was anything to write."
    if isinstance(error, CaseError) or type(error).__name__ == "StaticsError":  # its module is slow to import
        return Outcome.REFUSED, "refused", str(error)
    if isinstance(error, OSError):
        return Outcome.FILE_PROBLEM, "file problem", _os_message(error)
    if isinstance(error, MemoryError):
        return (
            Outcome.STOPPED,
            "out of memory",
            "Not enough memory: take fewer segments, or keep fewer states.",
        )
    log.debug("unexpected", exc_info=error)
    text = f"{type(error).__name__}: {error}. This is a mistake in cablesim; please report it."
    return Outcome.STOPPED, "internal error", text


def _os_message(error: OSError) -> str:
    if isinstance(error, OutputError) or error.strerror is None:
        return str(error)
    return f"{error.filename}: {error.strerror}" if error.filename else error.strerror


# Cases with overrides ---------------------------------------------------------------------------


def load_scene(path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Read a case, set what is overridden, and build its scene.

    Parameters
    ----------
    path : path
        Case file.
    overrides : iterable of str
        ``key=value`` with a dotted key, ``attachments.0.mass=2 kg`` in lists; the value is YAML.

    Raises
    ------
    CaseError
        With everything that is wrong with the case.
    OSError
        If the file cannot be read.
    """
    from cablesim.build import build_scene

    try:
        with Path(path).open("rb"):
            pass
    except OSError as error:  # a file that cannot be read is not a case that is wrong
        raise OSError(f"{path}: {error.strerror or error}. Name a case file (YAML).") from None
    overrides = tuple(overrides)
    if not overrides:
        from cablesim.case import load_case

        return build_scene(load_case(path))
    text = _text_of(Path(path))
    data, lines = read_yaml(text, str(path))
    for override in overrides if isinstance(data, dict) else ():
        _override(data, override)
    try:
        return build_scene(Case.from_dict(data, directory=Path(path).resolve().parent))
    except CaseError as error:
        places = {path_text(location): line for location, line in lines.items()}
        raise CaseError(
            _placed(problem, str(path), places, overrides) for problem in error.problems
        ) from None


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        problem = Problem(path="", message="is not text in UTF-8", remedy="Name a case file.", file=str(path))
        raise CaseError([problem]) from None


def _placed(problem: Problem, file: str, places: dict[str, int], overrides: Sequence[str]) -> Problem:
    """Say where a value stands: on a line of the file, or on the command line."""
    keys = [path_text(_location(override.partition("=")[0])) for override in overrides]
    if any(problem.path == key or problem.path.startswith((f"{key}.", f"{key}[")) for key in keys):
        return replace(problem, file="--set", line=None)
    return replace(problem, file=file, line=places.get(problem.path))


def _location(key: str) -> tuple[str | int, ...]:
    parts = key.strip().replace("[", ".").replace("]", "").split(".")
    return tuple(int(part) if part.isdigit() else part for part in parts)


def _override(data: Any, override: str) -> None:
    """Set one ``key=value`` in plain data; groups that are not there yet are made."""
    key, equals, text = override.partition("=")
    if not equals or not all(part != "" for part in _location(key)):
        raise _bad_override(override, "is not of the form key=value", "Write, e.g., simulation.duration=5")
    value, _ = read_yaml(text, "--set")
    *groups, last = _location(key)
    node = data
    try:
        for item in groups:
            if isinstance(node, dict) and isinstance(item, str):
                node = node.setdefault(item, {})
            else:
                node = node[item]
        node[last] = value
    except (KeyError, IndexError, TypeError):
        raise _bad_override(
            override, "does not fit the case", "Use the keys of the case file, and numbers in lists"
        ) from None


def _bad_override(override: str, message: str, remedy: str) -> CaseError:
    return CaseError([Problem(path=override, message=message, remedy=f"{remedy}.", file="--set")])


# Side by side -----------------------------------------------------------------------------------


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


def _start_worker(board: _Board, queue: Any) -> None:
    """Leave Ctrl-C to the parent, which stops its workers through the board."""
    global _board
    _board = board
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _mask_interrupts("SIG_UNBLOCK")
    log.addHandler(QueueHandler(queue))
    log.setLevel(logging.INFO)


def _work(index: int, run: Run) -> RunSummary:
    assert _board is not None
    if _board.stopping:
        return _not_started(run)
    return _execute(run, partial(_board.set, index))


def _mask_interrupts(how: str) -> None:
    """Block or unblock SIGINT where the system has it; children inherit the mask."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(getattr(signal, how), {signal.SIGINT})


class _SideBySide:
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
            with self._pool(queue) as pool, _on_interrupt(self._interrupt):
                self._wait(self._submit(pool))
        finally:
            listener.stop()
        return [self._summaries[index] for index in range(len(self._runs))]

    def _pool(self, queue: Any) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._jobs,
            mp_context=self._context,
            initializer=_start_worker,
            initargs=(self._board, queue),
        )

    def _submit(self, pool: ProcessPoolExecutor) -> dict[Future[RunSummary], int]:
        """Hand out the work; the processes, which start now, must not see Ctrl-C before they ignore it."""
        _mask_interrupts("SIG_BLOCK")
        try:
            return {pool.submit(_work, index, run): index for index, run in enumerate(self._runs)}
        finally:
            _mask_interrupts("SIG_UNBLOCK")

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
            return replace(_not_started(run), message="Interrupted at once; nothing was written.")
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
