"""Controllers that a user wrote: a Python function or class named in the case file.

Depends on: control.measurement.
"""

from __future__ import annotations

import copy
import difflib
import importlib
import inspect
import sys
import traceback
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from cablesim.control.measurement import Controller


class ControllerLoadError(ValueError):
    """A controller of the user's that cannot be had.

    Attributes
    ----------
    message, remedy : str
        What is wrong, and what to do about it.
    """

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message, remedy)
        self.message = message
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.message}. {self.remedy}"


def user_controller(reference: str, directory: str | Path, options: Mapping[str, Any]) -> Controller:
    """Make a fresh controller from a Python function or class.

    A file is run anew each time, so that its global variables are fresh too; a module is imported
    as Python does it, once.  The directory, and that of the file, are searched for what they import.

    Parameters
    ----------
    reference : str
        ``file.py:name`` or ``package.module:name``.
    directory : path
        Where a relative path starts.
    options : mapping
        Keyword arguments: a class is made with them, a function gets them with each measurement.

    Returns
    -------
    Controller
        The function, or an instance of the class; a callable from `Measurement` to payout speed [m/s].

    Raises
    ------
    ControllerLoadError
        If the file, the module or the name is not there, importing or making it raises an
        exception, or it cannot be called with what it would be given.
    """
    found = _named(reference, Path(directory))
    given = copy.deepcopy(dict(options))
    if not isinstance(found, type):
        if not callable(found):
            raise ControllerLoadError(
                f"{reference} is no function but {found!r:.60}",
                "Name a function of one measurement, or a class whose instances are such functions.",
            )
        _check_call(reference, found, (None,), given)
        return partial(found, **given) if given else found
    _check_call(reference, found, (), given)
    try:
        controller = found(**given)
    except (Exception, SystemExit) as error:
        raise ControllerLoadError(
            f"{reference} cannot be made: {told(error)}", "Check the class and its `options`."
        ) from error
    if not callable(controller):
        raise ControllerLoadError(
            f"instances of {reference} cannot be called",
            "Give the class a method `__call__(self, measured)` that returns a payout speed.",
        )
    _check_call(f"an instance of {reference}", controller, (None,), {})
    return controller


def _named(reference: str, directory: Path) -> Any:
    """Find what a reference names."""
    home, _, name = reference.rpartition(":")
    if not home or not name:
        raise ControllerLoadError(
            f"{reference} does not name a function in a file or module",
            "Write file.py:name or package.module:name.",
        )
    module = _run_file(directory / home) if home.endswith(".py") else _import_module(home, directory)
    if not hasattr(module, name):
        public = [known for known in vars(module) if not known.startswith("_")]
        raise ControllerLoadError(
            f"{home} has no {name}", _nearest(name, public) or f"Define `{name}` there, or correct the name."
        )
    return getattr(module, name)


def _run_file(path: Path) -> ModuleType:
    if not path.is_file():
        siblings = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
        remedy = _nearest(path.name, siblings) or "Paths are relative to the case file."
        raise ControllerLoadError(f"there is no file {path}", remedy)
    path = path.resolve()
    module = ModuleType(f"{path.stem}_{zlib.crc32(str(path).encode()):08x}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses and pickle look there
    with _importable(path.parent):
        try:
            code = compile(path.read_bytes(), str(path), "exec", dont_inherit=True)
            exec(code, module.__dict__)
        except (Exception, SystemExit) as error:
            _refuse_import(str(path), error)
    return module


def _import_module(name: str, directory: Path) -> ModuleType:
    with _importable(directory):
        try:
            return importlib.import_module(name)
        except (Exception, SystemExit) as error:
            _refuse_import(name, error)


def _refuse_import(home: str, error: BaseException) -> NoReturn:
    raise ControllerLoadError(
        f"importing {home} raised {told(error)}", "Correct the code, or install what it needs."
    ) from error


@contextmanager
def _importable(directory: Path) -> Iterator[None]:
    """Let modules of `directory` be imported meanwhile."""
    sys.path.insert(0, str(directory))
    try:
        yield
    finally:
        with suppress(ValueError):  # the code may have taken it out again
            sys.path.remove(str(directory))


def _check_call(what: str, function: Any, arguments: tuple[Any, ...], options: Mapping[str, Any]) -> None:
    """Refuse what cannot be called so, where that can be told without calling it."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # of some compiled functions
        return
    try:
        signature.bind(*arguments, **options)
    except TypeError as error:
        taken = [name for name in signature.parameters if name not in ("args", "kwargs")]
        given = [*(["the measurement"] if arguments else []), *options]
        raise ControllerLoadError(
            f"{what} takes ({', '.join(taken)}) and would be given ({', '.join(given)}): {error}",
            "Let names in `options` and arguments agree; a measurement is the first argument.",
        ) from error


def told(error: BaseException) -> str:
    """Kind and text of an exception, and the line of the user's code where it arose."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).parent != Path(__file__).parent and not frame.filename.startswith("<")
    ]
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def _nearest(name: str, known: Iterable[str]) -> str:
    """Write ``Did you mean 'x'?``, or nothing."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"Did you mean '{close[0]}'?" if close else ""
