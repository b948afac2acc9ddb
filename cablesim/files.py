"""Files that are written: whole or not at all.

Depends on: nothing of ours.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path


class OutputError(OSError):
    """Something cannot be written where it was asked for; the message says why."""


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


def check_folder(folder: Path) -> None:
    """Raise an `OutputError` unless `folder` can be filled; it is made when it is not there."""
    check_writable(folder / "file" if folder.exists() else folder)


@contextlib.contextmanager
def filling(folder: Path) -> Iterator[None]:
    """Name a folder when writing into it fails."""
    try:
        yield
    except OSError as error:
        raise _failed(folder, error) from None


@contextlib.contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Write a file beside its place, and move it there when it is whole.

    An earlier file stays as it was unless all of the new one is there, also when the process is killed.

    Yields
    ------
    Path
        Where to write; it has the ending of `file`.

    Raises
    ------
    OutputError
        If it cannot be written, for instance because the disk is full.
    """
    place = file.resolve()  # what a symbolic link points to is replaced, not the link
    part = place.with_name(f".{place.stem[:40]}.{os.getpid()}-{threading.get_native_id()}.part{place.suffix}")
    try:
        yield part
        if place.exists():
            shutil.copymode(place, part)
        part.replace(place)
    except OSError as error:
        raise _failed(file, error) from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def _failed(place: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot write {place}: {error.strerror or error}. Is the disk full?")
