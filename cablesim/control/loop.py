"""A controller at work: sampled, delayed and kept within what the winch can do.

What a controller answers at one sampling instant the winch begins to do at the next: it goes there
evenly and has the speed asked for one period later.  Digital controllers work so; and as the motion
is known a period ahead, the integrator steps over sampling instants as if they were not there.
Without that, each instant cuts a step short, and the changing steps ask for new Jacobians (README,
design notes, has the figures).

Depends on: scene, stops, control.measurement, control.deadline, control.user.
"""

from __future__ import annotations

import copy
import math
from collections import deque
from typing import Any

import numpy as np

from cablesim.control.deadline import call_until
from cablesim.control.measurement import Controller, Measurement
from cablesim.control.user import told
from cablesim.scene import Control, Winch
from cablesim.stops import same_time


class ControllerRunError(RuntimeError):
    """A controller at work failed, or asked for something that is no speed."""


class ControlLoop:
    """A controller at work: when it is sampled, what it is given, and what the winch makes of its answer.

    The controller is made when it is first asked.

    Parameters
    ----------
    control : Control
        The controller, its sampling period and the delay of its measurements.
    winch : Winch
        Limits of speed and acceleration.
    """

    def __init__(self, control: Control, winch: Winch) -> None:
        self._control, self._winch = control, winch
        self._controller: Controller | None = None
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

    def due(self, t: float) -> bool:
        """Whether it is time for the next sample."""
        return t >= self.next_sample or same_time(t, self.next_sample)

    def sample(self, measured: Measurement, speed_ahead: float, deadline: float = math.inf) -> float:
        """Payout speed [m/s] that the winch will have two sampling instants from now.

        Parameters
        ----------
        measured : Measurement
            The world now; the controller is given the newest one that is old enough.
        speed_ahead : float
            Payout speed that the winch will have at the next sampling instant [m/s].
        deadline : float
            Instant of ``time.monotonic()`` at which the controller must have answered.

        Raises
        ------
        ControllerRunError
            When the controller raises an exception or its answer is not a finite number.
        OutOfTime
            When it has not answered at the deadline.
        """
        if self._controller is None:
            self._controller = call_until(deadline, self._control.make)
        self._samples += 1
        self._measured.append(measured)
        latest = measured.time - self._control.delay
        while len(self._measured) > 1 and _no_later(self._measured[1].time, latest):
            self._measured.popleft()
        asked = self._ask(self._controller, self._measured[0], deadline)
        return limited_speed(asked, speed_ahead, self._control.period, self._winch)

    def _ask(self, controller: Controller, known: Measurement, deadline: float) -> float:
        try:
            answer = _number(call_until(deadline, controller, known))
        except (
            Exception,
            SystemExit,
        ) as error:  # whatever a user's function raises, the run keeps what it has
            raise ControllerRunError(
                f"The winch's controller failed at t = {known.time:g} s: {told(error)}."
            ) from error
        if not math.isfinite(answer):
            raise ControllerRunError(
                f"The winch's controller asked for a payout speed of {answer} m/s at t = {known.time:g} s; "
                "it must return a finite number."
            )
        return answer

    def __deepcopy__(self, memo: dict[int, Any]) -> ControlLoop:
        twin = ControlLoop(self._control, self._winch)
        twin._controller, twin._measured, twin._samples = copy.deepcopy(
            (self._controller, self._measured, self._samples), memo
        )
        return twin

    def __reduce__(self) -> tuple[Any, ...]:
        # a controller from a file is of a module that only making one brings into a process
        memory = getattr(self._controller, "__dict__", {})
        return _unpickled, (self._control, self._winch, memory, self._measured, self._samples)


def _unpickled(
    control: Control,
    winch: Winch,
    memory: dict[str, Any],
    measured: deque[Measurement],
    samples: int,
) -> ControlLoop:
    loop = ControlLoop(control, winch)
    if memory:
        loop._controller = control.make()
        vars(loop._controller).update(memory)
    loop._measured, loop._samples = measured, samples
    return loop


def _no_later(time: float, latest: float) -> bool:
    return time <= latest or same_time(time, latest)


def _number(answer: Any) -> float:
    """The number that a controller has returned, be it in an array."""
    array = np.asarray(answer)
    if array.size != 1 or array.dtype.kind not in "buifO":
        raise TypeError(f"it returned {answer!r:.60}, which is not one number")
    return float(array.item())


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
