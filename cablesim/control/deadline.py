"""Calls a function that may hang, and comes back.

Depends on: nothing of ours.

In the main thread of a system that has it, the alarm clock of the process ends the call, a sleep or a wait
for input included; its handler and what was left of an alarm of the caller's are put back.  In another
thread, and where an alarm of the caller's is running, a second thread raises the exception: that is noticed
between two instructions of Python, so not within a sleep or in compiled code that never returns.  Neither
can end a loop that catches every exception.
"""

from __future__ import annotations

import ctypes
import math
import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeVar

Result = TypeVar("Result")

REPEAT = 0.05
"""Seconds after which an alarm rings again: the first may have been caught by what it was to end."""


class OutOfTime(BaseException):
    """The deadline has passed."""


def call_until(deadline: float, function: Callable[..., Result], *arguments: Any) -> Result:
    """Call a function that must have returned at a deadline.

    Parameters
    ----------
    deadline : float
        Instant of ``time.monotonic()``; infinite sets no watch.
    function : callable
        What to call.
    *arguments
        What it is given.

    Returns
    -------
    object
        What the function returns.

    Raises
    ------
    OutOfTime
        At the deadline.
    """
    if math.isinf(deadline):
        return function(*arguments)
    seconds = deadline - time.monotonic()
    if seconds <= 0:
        raise OutOfTime
    watch = _Alarm() if _alarm_is_free() else _Watcher()
    watch.start(seconds)
    try:
        return function(*arguments)
    finally:
        watch.armed = False  # before any call, at which the exception might still come
        watch.stop()


def _alarm_is_free() -> bool:
    in_main = threading.current_thread() is threading.main_thread()
    return in_main and hasattr(signal, "setitimer") and signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


class _Alarm:
    """Raises `OutOfTime` in the main thread from the handler of the process's alarm."""

    armed = True

    def start(self, seconds: float) -> None:
        self._former = signal.signal(signal.SIGALRM, self._ring)
        signal.setitimer(signal.ITIMER_REAL, seconds, REPEAT)

    def stop(self) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._former)

    def _ring(self, _signal: int, _frame: FrameType | None) -> None:
        if self.armed:
            raise OutOfTime


class _Watcher:
    """Raises `OutOfTime` in the thread that starts it, from another thread."""

    armed = True

    def start(self, seconds: float) -> None:
        self._caller = threading.get_ident()
        self._lock, self._over = threading.Lock(), threading.Event()
        threading.Thread(target=self._watch, args=(seconds,), daemon=True).start()

    def stop(self) -> None:
        self._over.set()
        with self._lock:  # what rang this instant is taken back
            _raise_in(self._caller, None)

    def _watch(self, seconds: float) -> None:
        while not self._over.wait(seconds):
            with self._lock:
                if not self.armed:
                    return
                _raise_in(self._caller, OutOfTime)
            seconds = REPEAT


def _raise_in(thread: int, exception: type[BaseException] | None) -> None:
    what = None if exception is None else ctypes.py_object(exception)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), what)
