"""Ctrl-C while runs go on.

Depends on: nothing of ours.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator


class Interrupts:
    """Remembers Ctrl-C: the interrupt itself gets lost when it arrives inside a compiler's callback."""

    def __init__(self) -> None:
        self.seen = False

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
        raise KeyboardInterrupt


@contextlib.contextmanager
def on_interrupt(handle: Callable[[], None]) -> Iterator[None]:
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


def mask_interrupts(how: str) -> None:
    """Block or unblock SIGINT where the system has it; children inherit the mask."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(getattr(signal, how), {signal.SIGINT})
