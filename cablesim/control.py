"""Controllers of the winch: what they may know, and what they ask for.

Depends on: scene.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cablesim.scene import Control, Winch

Array = NDArray[np.float64]

SAME_INSTANT = 1e-9  # [s]


class ControlError(RuntimeError):
    """A controller failed, or asked for something that is no speed."""


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

    def sample(self, measured: Measurement) -> float:
        """Payout speed [m/s] that the winch will have at the next sampling instant.

        Parameters
        ----------
        measured : Measurement
            The world now; the controller is given the newest one that is old enough.

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
        return limited_speed(asked, measured.payout_speed, self._control.period, self._winch)

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
