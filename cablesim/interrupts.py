"""What ends a run from outside: Ctrl-C, and the signals of a terminal that closes and of a job that is ended.

Depends on: nothing of ours.
"""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


PRESS = 2.0  # [s] in which further interrupts mean the first one: a key pressed twice costs no result


class Interrupts:
    """Remembers an interrupt: the exception gets lost when it arrives inside a compiler's callback."""

    def __init__(self) -> None:
        self.seen = False
        self._last = -math.inf

    def __enter__(self) -> Interrupts:
        self._undo = contextlib.ExitStack()
        self._undo.enter_context(on_interrupt(self._handle))
        return self

    def __exit__(self, *_: object) -> None:
        self._undo.close()

    def check(self) -> None:
        """Raise the interrupt that was seen."""
        if self.seen:
            raise KeyboardInterrupt

    def _handle(self) -> None:
        self.seen = True
        before, self._last = self._last, time.monotonic()
        if self._last - before > PRESS:
            raise KeyboardInterrupt


def raise_interrupt() -> None:
    """Do as Ctrl-C does."""
    raise KeyboardInterrupt


@contextlib.contextmanager
def on_interrupt(handle: Callable[[], None]) -> Iterator[None]:
    """Call `handle` at an interrupt, where it is this thread's to handle and not ignored (as under nohup)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in SIGNALS}
    handled = [number for number, old in before.items() if old not in (None, signal.SIG_IGN)]
    for number in handled:
        signal.signal(number, lambda *_: handle())
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, before[number])


def mask_interrupts(how: str) -> None:
    """Block or unblock interrupts where the system can; children inherit the mask."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(getattr(signal, how), SIGNALS)
