"""Standard output and standard error: text, tables, the log and warnings.

Depends on: nothing of ours.
"""

from __future__ import annotations

import functools
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


@functools.cache
def console(*, stderr: bool = False) -> Console:
    """What prints to a stream; made once for each."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else 1000  # a pipe has no edge at which to fold a table
    return Console(stderr=stderr, width=width, highlight=False, markup=False, emoji=False, soft_wrap=True)


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


def show_log(*, quiet: bool = False) -> None:
    """Show the library's log on standard error."""
    log = logging.getLogger("cablesim")
    for handler in [handler for handler in log.handlers if isinstance(handler, _TerminalLog)]:
        log.removeHandler(handler)
    log.addHandler(_TerminalLog())
    debug = bool(os.environ.get("CABLESIM_DEBUG"))
    log.setLevel(logging.DEBUG if debug else logging.WARNING if quiet else logging.INFO)


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
