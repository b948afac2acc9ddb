"""The one notion of time of a run: which instants are the same, and where its inputs have corners and jumps.

Depends on: motion.

Times come from many hands: corners of motions, multiples of output and sampling intervals, sums that a
caller adds up, zeros of event functions.  They differ by rounding where they mean the same instant, and no
integrator can take a step from one to the other.  So instants closer than `SAME_TIME` are one everywhere:
a step that would end beside a stop ends at it, and what comes next comes later than that.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

from cablesim.motion import Motion

SAME_TIME = 1e-9
"""[s]; nothing that a cable does is so short, and the sum of a million steps of 0.1 s is right to 2e-6 s."""

ROUNDING = 1e-14
"""The same over the time itself, for runs of weeks: some 50 units in the last place."""


def same_time(first: float, second: float) -> bool:
    """Whether two times [s], the first of them finite, mean the same instant."""
    return abs(first - second) <= max(SAME_TIME, ROUNDING * abs(first))


@dataclass(frozen=True)
class Stop:
    """An instant up to which an advance may look.

    Attributes
    ----------
    time, resume : float
        First and last of the times that mean it [s].
    jump : bool
        Whether a velocity jumps there, so that the integrator begins anew; otherwise it is a corner.
    """

    time: float
    resume: float
    jump: bool

    @property
    def limit(self) -> float:
        """Last time that may be evaluated before it [s]: the motion after a jump must not be seen."""
        return math.nextafter(self.time, 0.0) if self.jump else self.time


NEVER = Stop(math.inf, math.inf, False)


class Stops:
    """Corners and jumps of motions, and the end of the case, in order; equal instants are one stop.

    Parameters
    ----------
    motions : iterable of Motion
        The inputs that follow the case.
    end : float
        End of the case [s].
    """

    def __init__(self, motions: Iterable[Motion], end: float) -> None:
        events = {end: False}
        for motion in motions:
            events |= {float(t): False for t in motion.corners if float(t) not in events}
            events |= {float(t): True for t in motion.jumps}
        self._stops: list[Stop] = []
        for time, jump in sorted(events.items()):
            if self._stops and same_time(time, self._stops[-1].resume):
                first = self._stops.pop()
                self._stops.append(Stop(first.time, time, first.jump or jump))
            else:
                self._stops.append(Stop(time, time, jump))
        self._times = [stop.resume for stop in self._stops]

    def after(self, t: float) -> Stop:
        """The first stop that is later than `t`; `NEVER` when there is none."""
        index = bisect_right(self._times, t)
        while index < len(self._stops) and same_time(t, self._stops[index].time):
            index += 1
        return self._stops[index] if index < len(self._stops) else NEVER

    def snapped(self, t: float) -> float:
        """The time of the stop that `t` means, or `t` itself."""
        index = bisect_right(self._times, t)
        for stop in self._stops[max(index - 1, 0) : index + 1]:
            if same_time(t, stop.time) or same_time(t, stop.resume):
                return stop.resume
        return t
