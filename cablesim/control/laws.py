"""The built-in controllers of the winch.

Depends on: control.measurement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cablesim.control.measurement import Measurement

Array = NDArray[np.float64]


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
        speed = 0.0 if self._velocity is None else math.hypot(*self._velocity)
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
