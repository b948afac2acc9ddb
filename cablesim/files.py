"""Files that are written: whole or not at all, never over what was read, and over nothing but their own kind.

Depends on: nothing of ours.

Every file that a command writes says in itself which command makes it again (its maker, ``cablesim run
../sway.yaml --set mesh.segments=80``, paths as seen from the file's folder).  A file may be replaced
without being told so only where its maker is the one that would replace it.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import shutil
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

STANDARD_INPUT = Path("-")

ABOUT = "about.json"
"""In a folder of tables: what made them, and the attributes of the result that they hold."""

_MARK = re.compile(rb"\[(cablesim [ -Z^-~]*)\]")
_LOOKED_AT = 1 << 17  # bytes at either end of a file in which its mark stands


class OutputError(OSError):
    """Something cannot be written where it was asked for; the message says why."""


@dataclass(frozen=True)
class Product:
    """A file, or a folder of files, that a command makes.

    Attributes
    ----------
    file : Path
        Where it goes.
    maker : str
        The command that makes it again.
    case : str
        Text of the case that it shows, with all its defaults; empty where there is none.
    """

    file: Path
    maker: str
    case: str = ""

    @classmethod
    def of(cls, file: Path, command: str, source: Path, *options: str, case: str = "") -> Product:
        """Product of ``cablesim <command> <source> <options>``."""
        return cls(file, shlex.join(["cablesim", command, _seen_from(file, source), *options]), case)

    @property
    def mark(self) -> str:
        """The maker in letters that mean nothing to any format in which it is kept."""
        return f"[{quote(self.maker, safe=' /=.,:+').replace('--', '%2D%2D')}]"

    def check(self, reads: Mapping[Path, str] | None = None, *, force: bool = False) -> None:
        """Raise an `OutputError` unless the file can be written and nothing is lost by it.

        Parameters
        ----------
        reads : mapping
            Files that are read, which nothing may replace -> who reads them.
        force : bool
            Replace also what is no earlier result of the same case.
        """
        check_writable(self.file)
        for path, reader in (reads or {}).items():
            if _same_file(self.file, path):
                raise OutputError(f"cannot write {self.file}: {reader} reads it. Give --output another name.")
        if self.file.exists() and not force:
            maker, case = maker_and_case(self.file)
            if not self._is_earlier(maker, case):
                raise _taken(self.file, maker)

    def _is_earlier(self, maker: str, case: str) -> bool:
        """Whether a file with this maker and case is an earlier one of the same."""
        command, source = shlex.split(self.maker)[1:3]
        if maker == self.maker and source != str(STANDARD_INPUT):
            return True
        same_kind = not maker or shlex.split(maker)[1] == command
        return same_kind and bool(case) and case == self.case

    @contextlib.contextmanager
    def filling(self, attributes: Mapping[str, Any], *, force: bool = False) -> Iterator[Path]:
        """Fill a folder, which is made when it is not there; an earlier filling is replaced as a whole.

        Parameters
        ----------
        attributes : mapping
            Written to ``about.json`` in the folder.
        force : bool
            Replace also files that no earlier filling has made.

        Yields
        ------
        Path
            Folder in which to write; what is in it in the end is moved.

        Raises
        ------
        OutputError
            If a file is in the way, or something cannot be written.
        """
        folder = self.file
        try:
            beside = folder if folder.is_dir() else folder.parent
            with tempfile.TemporaryDirectory(prefix=".", suffix=".part", dir=beside) as made:
                yield Path(made)
                new = sorted(os.listdir(made))
                old = self._earlier_filling()
                in_the_way = [name for name in (*new, ABOUT) if (folder / name).exists() and name not in old]
                if in_the_way and not force:
                    raise _taken(folder / in_the_way[0], "")
                shown = {name: str(value) for name, value in attributes.items()}
                about = {"maker": self.maker, "files": new, "result": shown}
                (Path(made) / ABOUT).write_text(
                    json.dumps(about, indent=2, ensure_ascii=False), encoding="utf-8"
                )
                folder.mkdir(exist_ok=True)
                for name in (*new, ABOUT):
                    os.replace(Path(made) / name, folder / name)
                for name in set(old) - {*new, ABOUT}:
                    (folder / name).unlink(missing_ok=True)
        except OutputError:
            raise
        except OSError as error:
            raise _failed(folder, error) from None

    def _earlier_filling(self) -> list[str]:
        """Names of the files that this command has put in the folder before."""
        try:
            about = json.loads((self.file / ABOUT).read_text(encoding="utf-8"))
            return [*about["files"], ABOUT] if about["maker"] == self.maker else []
        except (OSError, ValueError, TypeError, KeyError):
            return []


def maker_and_case(file: Path) -> tuple[str, str]:
    """The command that made a file, and the case that it shows; empty where it does not say."""
    with file.open("rb") as stream:
        start = stream.read(_LOOKED_AT)
        stream.seek(max(0, file.stat().st_size - _LOOKED_AT))
        end = stream.read()
    if start.startswith((b"\x89HDF", b"CDF")):
        return _attributes(file)
    found = _MARK.search(start) or _MARK.search(end)
    return ("", "") if found is None else (unquote(found[1].decode("ascii")), "")


def _attributes(file: Path) -> tuple[str, str]:
    import netCDF4

    try:
        with netCDF4.Dataset(file) as dataset:
            made_here = str(getattr(dataset, "source", "")).startswith("cablesim ")
            return str(getattr(dataset, "maker", "")), str(getattr(dataset, "case", "")) if made_here else ""
    except (OSError, RuntimeError):
        return "", ""


def _seen_from(file: Path, source: Path) -> str:
    if source == STANDARD_INPUT:
        return str(source)
    try:
        return Path(os.path.relpath(real_path(source), real_path(file).parent)).as_posix()
    except ValueError:  # on another drive
        return real_path(source).as_posix()


def real_path(path: Path) -> Path:
    """The path without links; of one that leads to itself as far as it goes, where `resolve` raises."""
    return Path(os.path.realpath(path))


def _same_file(one: Path, other: Path) -> bool:
    """Whether two paths name one file, also by links."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return real_path(one) == real_path(other)


def _taken(file: Path, maker: str) -> OutputError:
    there = f"what is there was made by `{maker}`" if maker else "what is there was not made by this command"
    return OutputError(
        f"cannot write {file}: {there}. Give --output another name, or replace it with --force."
    )


def check_writable(file: Path) -> None:
    """Raise an `OutputError` unless `file` can be written."""
    folder = file.parent
    if not folder.is_dir():
        what = (
            "is not a folder. Name one" if folder.exists() else "does not exist. Create it, or name another"
        )
        raise OutputError(f"cannot write {file}: {folder} {what}.")
    try:
        with contextlib.suppress(FileNotFoundError):
            file.stat()  # raises what `exists` passes over, such as a link to itself
        if file.is_dir():
            raise OutputError(f"cannot write {file}: it is a folder. Name a file in it.")
        if file.exists() and not file.is_file():
            raise OutputError(f"cannot write {file}: it is no ordinary file. Name one.")
        if file.exists() and not os.access(file, os.W_OK):
            raise OutputError(f"cannot write {file}: the file is there and write-protected.")
        with tempfile.TemporaryFile(dir=real_path(file).parent):
            pass
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {file}: {error.strerror or error}.") from None


def check_folder(folder: Path) -> None:
    """Raise an `OutputError` unless `folder` can be filled; it is made when it is not there."""
    check_writable(folder / "file" if folder.exists() else folder)


def check_ending(file: Path, endings: Iterable[str]) -> None:
    """Raise an `OutputError` unless the name of `file` ends in one of `endings`."""
    *others, last = endings
    if file.suffix.lower() not in (*others, last):
        listed = f"{', '.join(others)} or {last}" if others else last
        raise OutputError(f"cannot write {file}: its name must end in {listed}.")


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
    place = real_path(file)  # what a symbolic link points to is replaced, not the link
    part = place.with_name(
        f".{place.stem[:40]}.{os.getpid()}-{threading.get_native_id()}.part{place.suffix[:20]}"
    )
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
