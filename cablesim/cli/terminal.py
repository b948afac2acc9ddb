"""Standard output and standard error: text, tables, the log and warnings.

Depends on: nothing of ours.

A reader of the output that went away (``| head``, a terminal that was closed) costs no result: what it
would have read is dropped, and the command goes on.
"""

from __future__ import annotations

import errno
import functools
import io
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


class _Stream:
    """A standard stream that keeps its first failure instead of raising it."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.failure: OSError | None = None

    def __getattr__(self, attribute: str) -> Any:
        return getattr(getattr(sys, self._name), attribute)

    def write(self, text: str) -> int:
        with self._failing_quietly():
            getattr(sys, self._name).write(text)
        return len(text)

    def flush(self) -> None:
        with self._failing_quietly():
            getattr(sys, self._name).flush()

    @contextmanager
    def _failing_quietly(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.failure = self.failure or error
            nowhere = os.open(os.devnull, os.O_WRONLY)
            with suppress(OSError):  # what is left in the stream's buffer must not fail again
                os.dup2(nowhere, self.fileno())
            os.close(nowhere)


_STDOUT, _STDERR = _Stream("stdout"), _Stream("stderr")


def open_closed_streams() -> None:
    """Give a process that was started without standard streams some that lead nowhere.

    Else the first file that it opens takes their place, and gets what libraries print.
    """
    for descriptor, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest descriptor that is free
            setattr(sys, name, os.fdopen(descriptor, mode))


def show_all_letters() -> None:
    """Let streams that lack a letter, as in the locale C, show its number and not end the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def lost_output() -> str:
    """What kept standard output from being written; nothing where its reader only went away."""
    failure = _STDOUT.failure
    if failure is None or failure.errno in (errno.EPIPE, errno.EIO):
        return ""
    return f"cannot write to standard output: {failure.strerror or failure}."


@functools.cache
def console(*, stderr: bool = False) -> Console:
    """What prints to a stream; made once for each."""
    from rich.console import Console

    stream: Any = _STDERR if stderr else _STDOUT
    width = None if stream.isatty() else 1000  # a pipe has no edge at which to fold a table
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False, soft_wrap=True)


def say(text: Any) -> None:
    """Write a result to standard output."""
    console().print(text)


def tell(text: str, *, style: str | None = None) -> None:
    """Write a message to standard error."""
    console(stderr=True).print(text, style=style)


def table(*columns: str, title: str | None = None) -> Any:
    """Make an empty table; without names of columns it has no head."""
    from rich import box
    from rich.table import Table

    shown = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_header=any(columns))
    for column in columns:
        shown.add_column(column, overflow="fold")
    return shown


class _TerminalLog(logging.Handler):
    """Shows the library's messages on standard error, each once."""

    def __init__(self) -> None:
        super().__init__()
        self._seen: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        if text not in self._seen:
            self._seen.add(text)
            tell(text, style="dim")


def show_log(*, quiet: bool = False, verbose: bool = False) -> None:
    """Show the library's log on standard error."""
    log = logging.getLogger("cablesim")
    for handler in [handler for handler in log.handlers if isinstance(handler, _TerminalLog)]:
        log.removeHandler(handler)
    log.addHandler(_TerminalLog())
    log.setLevel(logging.DEBUG if verbose else logging.WARNING if quiet else logging.INFO)


def warn(*texts: str) -> None:
    """Write warnings to standard error."""
    for text in texts:
        tell(f"warning: {text}", style="yellow")


@contextmanager
def odd_things_shown() -> Iterator[None]:
    """Show warnings about a case as messages, and hide those meant for programmers."""

    def show(message: Any, category: type[Warning], *_: Any, **__: Any) -> None:
        if issubclass(category, UserWarning):
            warn(str(message))

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        yield
