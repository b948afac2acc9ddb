"""Controllers that a user wrote: a Python function or class named in the case file.

Depends on: control.measurement, control.source.
"""

from __future__ import annotations

import copy
import importlib
import inspect
import sys
import traceback
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from cablesim.control.measurement import Controller
from cablesim.control.source import (
    ControllerLoadError,
    Source,
    check_call,
    find_source,
    is_installed,
    refuse_missing,
    refuse_no_function,
    refuse_not_callable,
)


def user_controller(reference: str, directory: str | Path, options: Mapping[str, Any]) -> Controller:
    """Make a fresh controller from a Python function or class: this runs the user's code.

    A file is run anew each time, so that its global variables are fresh too; a module is imported
    as Python does it, once.  The directory, and that of the file, are searched for what they import.

    Parameters
    ----------
    reference : str
        ``file.py:name`` or ``package.module:name``; see `control.source` for what may be named.
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
        If the file, the module or the name is not there or may not be named, importing or making it
        raises an exception, or it cannot be called with what it would be given.
    """
    found = _named(find_source(reference, Path(directory)), Path(directory))
    given = copy.deepcopy(dict(options))
    if not isinstance(found, type):
        if not callable(found):
            refuse_no_function(reference, found)
        _check_object(reference, found, (None,), given)
        return partial(found, **given) if given else found
    _check_object(reference, found, (), given)
    try:
        controller = found(**given)
    except (Exception, SystemExit) as error:
        raise ControllerLoadError(
            f"{reference} cannot be made: {told(error)}", "Check the class and its `options`."
        ) from error
    if not callable(controller):
        refuse_not_callable(reference)
    _check_object(f"an instance of {reference}", controller, (None,), {})
    return controller


def _named(source: Source, directory: Path) -> Any:
    """Run the code and return what is named."""
    module = _import_module(source, directory) if source.is_module else _run_file(source)
    if not hasattr(module, source.name):
        refuse_missing(source, vars(module))
    return getattr(module, source.name)


def _run_file(source: Source) -> ModuleType:
    path = source.file
    assert path is not None
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


def _import_module(source: Source, directory: Path) -> ModuleType:
    with _importable(directory):
        try:
            module = importlib.import_module(source.home)
        except (Exception, SystemExit) as error:
            _refuse_import(source.home, error)
    home = getattr(module, "__file__", None)
    if source.file is not None and (home is None or Path(home).resolve() != source.file.resolve()):
        raise ControllerLoadError(
            f"the name {source.home} is taken by another module, {home or module!r}",
            f"Name the file instead: {source.home.replace('.', '/')}.py:{source.name}.",
        )
    return module


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


def _check_object(what: str, function: Any, arguments: tuple[Any, ...], options: Mapping[str, Any]) -> None:
    """Refuse what cannot be called so, where that can be told without calling it."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # of some compiled functions
        return
    check_call(what, signature, arguments, options)


def told(error: BaseException) -> str:
    """Kind and text of an exception, and the line of the user's code where it arose."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).parent != Path(__file__).parent and not frame.filename.startswith("<")
    ]
    own = [frame for frame in frames if not is_installed(Path(frame.filename))]
    place = next((f" ({Path(one.filename).name}, line {one.lineno})" for one in reversed(own or frames)), "")
    return f"{type(error).__name__}: {error}{place}"
