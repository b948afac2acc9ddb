"""Controllers of the winch: what they may know, and what they ask for.

Depends on: nothing of ours.
"""

from __future__ import annotations

import copy
import difflib
import importlib
import inspect
import math
import sys
import traceback
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ControllerError(ValueError):
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


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a controller is given at a sampling instant: the world as it was `delay` seconds before.

    Attributes
    ----------
    time : float
        When it was measured [s].
    deployed_length, payout_speed : float
        Of the winch [m], [m/s].
    tension_a, tension_b : float
        Tension of the cable at its two ends [N].
    locate : callable
        Takes the name of an attachment, or ``a`` or ``b``, and returns its place and velocity in
        the world frame, each (3,) [m], [m/s]; an attachment on the drum is where the winch is.
    """

    time: float
    deployed_length: float
    payout_speed: float
    tension_a: float
    tension_b: float
    locate: Callable[[str], tuple[Array, Array]]

    def position(self, name: str) -> Array:
        """Place (3,) of an attachment or end in the world frame [m]."""
        return self.locate(name)[0]

    def velocity(self, name: str) -> Array:
        """Velocity (3,) of an attachment or end in the world frame [m/s]."""
        return self.locate(name)[1]

    def distance(self, first: str, second: str) -> float:
        """Distance between two attachments or ends [m]."""
        return float(np.linalg.norm(self.position(first) - self.position(second)))


class Controller(Protocol):
    """Anything that turns a measurement into the payout speed it wants at the next sampling instant."""

    def __call__(self, measured: Measurement) -> float:
        """Payout speed asked for [m/s]; the winch goes there as fast as its limits allow."""
        ...


# Built-in controllers ---------------------------------------------------------------------------


@dataclass(kw_only=True, eq=False)
class BuoyGap:
    """Keeps two buoys of the cable at a distance.

    Two buoys lift the cable on both sides of a V that hangs slack between them.  When the distance
    between them grows beyond the set point the V is being pulled open and cable must go out:

        payout speed = proportional (gap - set point) + derivative d gap / dt

    The set point may depend on how fast the buoys travel: on the speed of the point half way between
    them.  Both rates are differences of successive samples, all that a camera or an acoustic modem
    can tell; at the first sample they are taken as zero.

    Attributes
    ----------
    buoys : tuple of str
        Names of the two.
    proportional : float
        Payout speed per metre of distance too much [1/s].
    derivative : float
        Payout speed per speed at which they part [-].
    speeds, gaps : ndarray, shape (m,)
        Set point [m] against increasing speed [m/s], linear in between, end values outside.
    speed_time : float
        Time constant of the low-pass filter on the measured velocity [s]; 0 filters nothing.
    """

    buoys: tuple[str, str]
    proportional: float
    derivative: float
    speeds: Sequence[float] | Array
    gaps: Sequence[float] | Array
    speed_time: float = 0.0
    _before: tuple[float, float, Array] | None = field(default=None, init=False)
    _widening: float = field(default=0.0, init=False)
    _velocity: Array | None = field(default=None, init=False)

    def __call__(self, measured: Measurement) -> float:
        """Payout speed asked for [m/s]."""
        gap = measured.distance(*self.buoys)
        first, second = (measured.position(name) for name in self.buoys)
        self._update(measured.time, gap, (first + second) / 2)
        speed = 0.0 if self._velocity is None else float(np.linalg.norm(self._velocity))
        too_wide = gap - float(np.interp(speed, self.speeds, self.gaps))
        return self.proportional * too_wide + self.derivative * self._widening

    def _update(self, time: float, gap: float, middle: Array) -> None:
        """Take the differences to the sample before; rates stay what they are without a newer one."""
        if self._before is not None:
            elapsed = time - self._before[0]
            if elapsed <= 0:
                return
            self._widening = (gap - self._before[1]) / elapsed
            self._smooth((middle - self._before[2]) / elapsed, elapsed)
        self._before = time, gap, middle

    def _smooth(self, velocity: Array, elapsed: float) -> None:
        if self._velocity is None or self.speed_time == 0:
            self._velocity = velocity
        else:
            share = -math.expm1(-elapsed / self.speed_time)
            self._velocity = self._velocity + share * (velocity - self._velocity)


@dataclass(kw_only=True, eq=False)
class ConstantTension:
    """Pays cable out when it pulls more than it should, and reels in when it pulls less.

        payout speed = proportional (T - tension) + integral x (time integral of T - tension)

    The speed is held within `speed_limit`, and the integral does not grow while the speed is at the
    limit on the side to which the error pushes: no wind-up.

    Attributes
    ----------
    tension : float
        Tension to keep [N].
    proportional : float
        Payout speed per newton too much [m/s/N].
    integral : float
        Payout speed gained per second and newton too much [m/s2/N].
    end : str
        Where tension is measured, ``a`` or ``b`` (the winch).
    speed_limit : float
        Greatest speed asked for [m/s].
    """

    tension: float
    proportional: float
    integral: float = 0.0
    end: str = "b"
    speed_limit: float = math.inf
    _before: float | None = field(default=None, init=False)
    _gained: float = field(default=0.0, init=False)

    def __call__(self, measured: Measurement) -> float:
        """Payout speed asked for [m/s]."""
        error = (measured.tension_a if self.end == "a" else measured.tension_b) - self.tension
        elapsed = 0.0 if self._before is None else max(measured.time - self._before, 0.0)
        self._before = measured.time
        gained = self._gained + self.integral * error * elapsed
        speed = self.proportional * error + gained
        if abs(speed) <= self.speed_limit or speed * error < 0:
            self._gained = gained
        return max(-self.speed_limit, min(speed, self.speed_limit))


@dataclass(kw_only=True, eq=False)
class ConstantLength:
    """Brings the deployed length to a value: payout speed = proportional (length - deployed length).

    Attributes
    ----------
    length : float
        Deployed length to keep [m].
    proportional : float
        Payout speed per metre too short [1/s].
    """

    length: float
    proportional: float

    def __call__(self, measured: Measurement) -> float:
        """Payout speed asked for [m/s]."""
        return self.proportional * (self.length - measured.deployed_length)


# Controllers of the user's ----------------------------------------------------------------------


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
    ControllerError
        If the file, the module or the name is not there, importing or making it raises an
        exception, or it cannot be called with what it would be given.
    """
    found = _named(reference, Path(directory))
    given = copy.deepcopy(dict(options))
    if not isinstance(found, type):
        if not callable(found):
            raise ControllerError(
                f"{reference} is no function but {found!r:.60}",
                "Name a function of one measurement, or a class whose instances are such functions.",
            )
        _check_call(reference, found, (None,), given)
        return partial(found, **given) if given else found
    _check_call(reference, found, (), given)
    try:
        controller = found(**given)
    except Exception as error:
        raise ControllerError(
            f"{reference} cannot be made: {_told(error)}", "Check the class and its `options`."
        ) from error
    if not callable(controller):
        raise ControllerError(
            f"instances of {reference} cannot be called",
            "Give the class a method `__call__(self, measured)` that returns a payout speed.",
        )
    _check_call(f"an instance of {reference}", controller, (None,), {})
    return controller


def _named(reference: str, directory: Path) -> Any:
    """Find what a reference names."""
    home, _, name = reference.rpartition(":")
    if not home or not name:
        raise ControllerError(
            f"{reference} does not name a function in a file or module",
            "Write file.py:name or package.module:name.",
        )
    module = _run_file(directory / home) if home.endswith(".py") else _import_module(home, directory)
    if not hasattr(module, name):
        public = [known for known in vars(module) if not known.startswith("_")]
        raise ControllerError(
            f"{home} has no {name}", _nearest(name, public) or f"Define `{name}` there, or correct the name."
        )
    return getattr(module, name)


def _run_file(path: Path) -> ModuleType:
    if not path.is_file():
        siblings = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
        remedy = _nearest(path.name, siblings) or "Paths are relative to the case file."
        raise ControllerError(f"there is no file {path}", remedy)
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
    raise ControllerError(
        f"importing {home} raised {_told(error)}", "Correct the code, or install what it needs."
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
        raise ControllerError(
            f"{what} takes ({', '.join(taken)}) and would be given ({', '.join(given)}): {error}",
            "Let names in `options` and arguments agree; a measurement is the first argument.",
        ) from error


def _told(error: BaseException) -> str:
    """Kind and text of an exception, and the line of the user's code where it arose."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename != __file__ and not frame.filename.startswith("<frozen")
    ]
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def _nearest(name: str, known: Iterable[str]) -> str:
    """Write ``Did you mean 'x'?``, or nothing."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"Did you mean '{close[0]}'?" if close else ""
