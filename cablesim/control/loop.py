"""A controller at work: sampled, delayed and kept within what the winch can do.

What a controller answers at one sampling instant the winch begins to do at the next: it goes there
evenly and has the speed asked for one period later.  Digital controllers work so; and as the motion
is known a period ahead, the integrator steps over sampling instants as if they were not there.
Without that, each instant cuts a step short, and the changing steps ask for new Jacobians (README,
design notes, has the figures).

Depends on: scene, control.measurement.
"""

from __future__ import annotations

import math
from collections import deque

from cablesim.control.measurement import Controller, Measurement
from cablesim.scene import Control, Winch

SAME_INSTANT = 1e-9  # [s]


class ControlError(RuntimeError):
    """A controller failed, or asked for something that is no speed."""


class ControlLoop:
    """A controller at work: when it is sampled, what it is given, and what the winch makes of its answer.

    Parameters
    ----------
    control : Control
        The controller, its sampling period and the delay of its measurements.
    winch : Winch
        Limits of speed and acceleration.
    """

    def __init__(self, control: Control, winch: Winch) -> None:
        self._control, self._winch = control, winch
        self._controller: Controller = control.make()
        self._measured: deque[Measurement] = deque()
        self._samples = 0

    @property
    def next_sample(self) -> float:
        """Next sampling instant [s]; they are multiples of the period."""
        return self._samples * self._control.period

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return self._control.period

    @property
    def known_until(self) -> float:
        """Time up to which the winch's motion is settled [s]."""
        return self.next_sample + self._control.period

    def sample(self, measured: Measurement, speed_ahead: float) -> float:
        """Payout speed [m/s] that the winch will have two sampling instants from now.

        Parameters
        ----------
        measured : Measurement
            The world now; the controller is given the newest one that is old enough.
        speed_ahead : float
            Payout speed that the winch will have at the next sampling instant [m/s].

        Raises
        ------
        ControlError
            When the controller raises an exception or its answer is not a finite number.
        """
        self._samples += 1
        self._measured.append(measured)
        latest = measured.time - self._control.delay + SAME_INSTANT
        while len(self._measured) > 1 and self._measured[1].time <= latest:
            self._measured.popleft()
        asked = self._ask(self._measured[0])
        return limited_speed(asked, speed_ahead, self._control.period, self._winch)

    def _ask(self, known: Measurement) -> float:
        try:
            asked = float(self._controller(known))
        except Exception as error:  # whatever a user's function raises, the run keeps what it has
            raise ControlError(
                f"The winch's controller failed at t = {known.time:g} s: {type(error).__name__}: {error}."
            ) from error
        if not math.isfinite(asked):
            raise ControlError(
                f"The winch's controller asked for a payout speed of {asked} m/s at t = {known.time:g} s; "
                "it must return a finite number."
            )
        return asked


def limited_speed(asked: float, present: float, duration: float, winch: Winch) -> float:
    """Payout speed [m/s] nearest to the one asked for that the winch can have after `duration` [s].

    Parameters
    ----------
    asked, present : float
        Payout speeds asked for and now [m/s].
    duration : float
        Time to get there [s].
    winch : Winch
        Its limits.

    Returns
    -------
    float
        [m/s].
    """
    change = winch.maximum_acceleration * duration
    within = min(max(asked, -winch.maximum_speed), winch.maximum_speed)
    return min(max(within, present - change), present + change)
