"""The code of a user's controller as text: where it is, and what can be said of it without running it.

Depends on: nothing of ours.

A case that somebody sends must not name what is already on the reader's disk and do harm with it: the
module `os`, the class `subprocess.Popen`, or the same by way of some installed package.  So a case names
code that comes with it (a file, or a module below its folder), or a module of an installed package that
declares controllers itself, under the entry points `cablesim.controllers`.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any, NoReturn

ENTRY_POINTS = "cablesim.controllers"
"""Group under which an installed package names the modules that hold its controllers."""

_OWN = "cablesim.control"
_LIBRARIES = ("stdlib", "platstdlib", "purelib", "platlib")
_INSTALLED = frozenset({"site-packages", "dist-packages"})


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


@dataclass(frozen=True)
class Source:
    """Where a controller is defined.

    Attributes
    ----------
    home, name : str
        What the reference says before and after its colon.
    file : Path or None
        Its code; ``None`` for a module of an installed package that has no Python source.
    """

    home: str
    name: str
    file: Path | None

    @property
    def is_module(self) -> bool:
        """Whether it is imported by its name."""
        return not self.home.endswith(".py")


def find_source(reference: str, directory: Path) -> Source:
    """Find the code that a reference names, without running any.

    Parameters
    ----------
    reference : str
        ``file.py:name`` or ``package.module:name``.
    directory : Path
        Folder of the case.

    Returns
    -------
    Source
        Where it is.

    Raises
    ------
    ControllerLoadError
        When it is not there, or is of those that a case may not name.
    """
    home, _, name = reference.rpartition(":")
    if not home or not name:
        raise ControllerLoadError(
            f"{reference} does not name a function in a file or module",
            "Write file.py:name or package.module:name.",
        )
    if home.endswith(".py"):
        return Source(home, name, _own_file(directory / home))
    return Source(home, name, _module_source(home, directory))


def _own_file(path: Path) -> Path:
    if not path.is_file():
        siblings = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
        remedy = nearest(path.name, siblings) or "Paths are relative to the case file."
        raise ControllerLoadError(f"there is no file {path}", remedy)
    path = path.resolve()
    if is_installed(path):
        raise ControllerLoadError(
            f"{path} belongs to Python or an installed package", "Name a file of your own, beside the case."
        )
    return path


def is_installed(path: Path) -> bool:
    """Whether a file belongs to Python or an installed package."""
    libraries = [Path(sysconfig.get_path(name)).resolve() for name in _LIBRARIES]
    return bool(_INSTALLED & set(path.parts)) or any(path.is_relative_to(library) for library in libraries)


def _module_source(home: str, directory: Path) -> Path | None:
    parts = home.split(".")
    if not all(part.isidentifier() for part in parts):
        raise ControllerLoadError(
            f"{home} is neither a file nor a module", "Write file.py:name or package.module:name."
        )
    if parts[0] in sys.stdlib_module_names:
        raise ControllerLoadError(
            f"{home} is of Python's standard library", "Write a function of your own and name its file."
        )
    below = _file_of(directory, parts)
    if below is not None:
        return _own_file(below)
    if any(home == known or home.startswith(f"{known}.") for known in _declared()):
        return _installed_file(parts)
    raise ControllerLoadError(
        f"there is no module {home} below {directory}, and no installed package declares it",
        f"Name a file (file.py:name), or let the package list it under the entry points {ENTRY_POINTS}.",
    )


def _declared() -> Iterator[str]:
    from importlib.metadata import entry_points

    yield _OWN
    for entry in entry_points(group=ENTRY_POINTS):
        yield entry.module


def _installed_file(parts: Sequence[str]) -> Path | None:
    spec = PathFinder.find_spec(parts[0])
    if spec is None or spec.origin is None:
        return None
    origin = Path(spec.origin)
    return _file_of(origin.parent.parent if spec.submodule_search_locations else origin.parent, parts)


def _file_of(folder: Path, parts: Sequence[str]) -> Path | None:
    place = folder.joinpath(*parts)
    candidates = (place.with_suffix(".py"), place / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


# What the text says -------------------------------------------------------------------------------


def check_source(reference: str, directory: Path, options: Mapping[str, Any]) -> None:
    """Refuse a controller that cannot be had, as far as its text says so.

    Parameters
    ----------
    reference : str
        ``file.py:name`` or ``package.module:name``.
    directory : Path
        Folder of the case.
    options : mapping
        Keyword arguments that it is to be given.

    Raises
    ------
    ControllerLoadError
        When there is no such code, it has no such name, it is no Python, or it plainly cannot be called
        with what it would be given.
    """
    source = find_source(reference, directory)
    if source.file is None:
        return
    definitions = _definitions(_parsed(source), source)
    if len(definitions) != 1:
        return
    (node,) = definitions
    if isinstance(node, ast.ClassDef):
        _check_class(reference, node, options)
    elif isinstance(node, ast.FunctionDef) and not node.decorator_list:
        check_call(reference, _signature(node.args), (None,), options)
    elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
        refuse_no_function(reference, node.value.value)


def _parsed(source: Source) -> ast.Module:
    assert source.file is not None
    try:
        return ast.parse(source.file.read_bytes(), filename=str(source.file))
    except (SyntaxError, ValueError, RecursionError) as error:  # ValueError: null bytes
        line = f" ({source.file.name}, line {error.lineno})" if isinstance(error, SyntaxError) else ""
        text = error.msg if isinstance(error, SyntaxError) else str(error)
        raise ControllerLoadError(
            f"{source.home} is no Python that can be run: {type(error).__name__}: {text}{line}",
            "Correct the code.",
        ) from error


def _definitions(module: ast.Module, source: Source) -> list[ast.stmt]:
    """Statements that may define the name; none where the names of the module cannot be told."""
    found: list[ast.stmt] = []
    names: set[str] = set()
    for statement in _top_level(module.body):
        defined = set(_names(statement))
        if {"*", "__getattr__"} & defined:
            return []
        names |= defined
        if source.name in defined:
            found.append(statement)
    if not found:
        refuse_missing(source, names)
    return found


def _top_level(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements of a module, those within `if`, `try`, `with` and loops included."""
    for statement in body:
        yield statement
        if not isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            for field in ("body", "orelse", "finalbody"):
                yield from _top_level(getattr(statement, field, ()))
            for branch in (*getattr(statement, "handlers", ()), *getattr(statement, "cases", ())):
                yield from _top_level(branch.body)


def _names(statement: ast.stmt) -> Iterator[str]:
    """Names that a statement of a module may bind."""
    if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
        yield statement.name
    elif isinstance(statement, (ast.Import, ast.ImportFrom)):
        for alias in statement.names:
            yield alias.asname or alias.name.partition(".")[0]
    else:
        for node in ast.walk(statement):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                yield node.id


def _check_class(reference: str, node: ast.ClassDef, options: Mapping[str, Any]) -> None:
    if node.bases or node.keywords or node.decorator_list:  # what it has may come from elsewhere
        return
    methods = {one.name: one for one in node.body if isinstance(one, ast.FunctionDef)}
    if "__call__" not in {name for one in node.body for name in _names(one)}:
        refuse_not_callable(reference)
    if "__new__" not in methods:
        made = methods.get("__init__")
        signature = inspect.Signature() if made is None else _signature(made.args, method=True)
        check_call(reference, signature, (), options)
    called = methods.get("__call__")
    if called is not None and not called.decorator_list:
        check_call(f"an instance of {reference}", _signature(called.args, method=True), (None,), {})


def _signature(arguments: ast.arguments, *, method: bool = False) -> inspect.Signature:
    """Signature of a definition; of a method without its first argument."""
    kinds = inspect.Parameter
    positional = [
        *((one, kinds.POSITIONAL_ONLY) for one in arguments.posonlyargs),
        *((one, kinds.POSITIONAL_OR_KEYWORD) for one in arguments.args),
    ]
    required = len(positional) - len(arguments.defaults)
    parameters = [
        kinds(one.arg, kind, default=kinds.empty if index < required else None)
        for index, (one, kind) in enumerate(positional)
    ][int(method) :]
    if arguments.vararg:
        parameters.append(kinds(arguments.vararg.arg, kinds.VAR_POSITIONAL))
    for one, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        given = kinds.empty if default is None else None
        parameters.append(kinds(one.arg, kinds.KEYWORD_ONLY, default=given))
    if arguments.kwarg:
        parameters.append(kinds(arguments.kwarg.arg, kinds.VAR_KEYWORD))
    return inspect.Signature(parameters)


# Refusals, the same before and after the code has run ------------------------------------------------


def check_call(
    what: str, signature: inspect.Signature, arguments: tuple[Any, ...], options: Mapping[str, Any]
) -> None:
    """Refuse what cannot be called with these arguments and options."""
    try:
        signature.bind(*arguments, **options)
    except TypeError as error:
        taken = [name for name in signature.parameters if name not in ("args", "kwargs")]
        given = [*(["the measurement"] if arguments else []), *options]
        raise ControllerLoadError(
            f"{what} takes ({', '.join(taken)}) and would be given ({', '.join(given)}): {error}",
            "Let names in `options` and arguments agree; a measurement is the first argument.",
        ) from error


def refuse_missing(source: Source, names: Iterable[str]) -> NoReturn:
    """Refuse a name that its home does not have."""
    public = [name for name in names if not name.startswith("_")]
    raise ControllerLoadError(
        f"{source.home} has no {source.name}",
        nearest(source.name, public) or f"Define `{source.name}` there, or correct the name.",
    )


def refuse_no_function(reference: str, found: Any) -> NoReturn:
    """Refuse what cannot be called."""
    raise ControllerLoadError(
        f"{reference} is no function but {found!r:.60}",
        "Name a function of one measurement, or a class whose instances are such functions.",
    )


def refuse_not_callable(reference: str) -> NoReturn:
    """Refuse a class whose instances cannot be called."""
    raise ControllerLoadError(
        f"instances of {reference} cannot be called",
        "Give the class a method `__call__(self, measured)` that returns a payout speed.",
    )


def nearest(name: str, known: Iterable[str]) -> str:
    """Write ``Did you mean 'x'?``, or nothing."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"Did you mean '{close[0]}'?" if close else ""
