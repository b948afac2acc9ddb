"""SUNDIALS IDA (variable-order BDF) through scikit-sundae, behind the integrator protocol.

Depends on: integrate.protocol, integrate.messages.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgbtrf, dgbtrs
from sksundae._cy_ida import IDA
from sksundae.ida import IDAJacTimes, IDAPrecond

from cablesim.integrate.messages import silence
from cablesim.integrate.protocol import Advance, Array, Counters, Equations, Events

# IDA's return codes -> what they mean to the caller
_OUTCOMES = {
    -1: Advance.STEP_LIMIT,
    -2: Advance.ERROR_TEST_FAILURES,
    -3: Advance.ERROR_TEST_FAILURES,
    -4: Advance.CONVERGENCE_FAILURE,
}

_ROOT_RETURN = 2

LARGEST_BAND_SYSTEM = 1800
"""Unknowns up to which the band solver is used.

scikit-sundae hands its Jacobian a full matrix, whose rows soon leave the caches.  In three runs on a shared
machine a call took 0.6 to 0.9 times as long as with GMRES at 1750 unknowns (and 90 MB), 0.7 to 1.4 times at
3500 (375 MB), 3 to 6 times at 7000 (1.5 GB).
"""

LARGEST_BAND_OF_MANY = 1100
"""The same where events change the number of unknowns, so that there are integrators of many sizes.

Each has a full matrix of its own, whose memory is new to it.  A winch that moves 17 nodes a second took
0.9 times as long with the band solver as with GMRES at 900 unknowns, as long at 1100, three times at 1500.
"""

_CALLS_BETWEEN_CLOCKS = 256


@dataclass(frozen=True, kw_only=True)
class IdaOptions:
    """What IDA is told; names as in scikit-sundae.

    Attributes
    ----------
    rtol : float
        Relative tolerance.
    atol : ndarray, shape (size,)
        Absolute tolerances.
    max_order : int
        IDA's own default is 5; ours is 2, because orders 3 to 5 are unstable for the hardly damped
        waves of a cable.
    first_step : float
        First step after a start [s].  Left to itself IDA derives it from the first output time, and
        then runs differ with the interval of their outputs.
    max_step : float or None
        Longest step [s].
    max_steps : int
        Steps in one advance; IDA's own default is 500.
    linear_solver : str
        ``auto``, ``band`` or ``krylov``.
    """

    rtol: float
    atol: Array
    max_order: int = 2
    first_step: float = 0.0
    max_step: float | None = None
    max_steps: int = 1_000_000
    linear_solver: str = "auto"


class _NotFinite(Exception):  # noqa: N818 - a status says it
    """The equations gave a number that is not finite."""


class _TimeLimit(Exception):  # noqa: N818 - it is not an error
    """The wall clock ran out."""


class IdaIntegrator:
    """IDA on one system of fixed size.

    Parameters
    ----------
    equations : Equations
        Residual and Jacobian.
    options : IdaOptions
        Tolerances and limits.
    events : Events, optional
        Functions that are positive until the event: IDA looks for where they fall through nought.
    counters : Counters, optional
        Where to count the work; default: counters of its own.
    """

    def __init__(
        self,
        equations: Equations,
        options: IdaOptions,
        *,
        events: Events | None = None,
        counters: Counters | None = None,
    ) -> None:
        self.counters = Counters() if counters is None else counters
        self.equations = equations
        self._options = options
        self._roots = None if events is None else _Roots(events)
        self._ida = IDA(self._residual, **self._ida_options())
        self._silent = False
        if self._roots is not None:
            self._roots.keep_nothing()

    def close(self) -> None:
        """Give back the solver's memory at once: it holds this object, and this object holds it."""
        del self._ida

    def start(self, t: float, y: Array, yp: Array) -> None:
        """Begin at a consistent state (the order falls to 1)."""
        self.counters.starts += 1
        self._t, self._y, self._yp = t, y, yp
        self._ida.init_step(t, y, yp)
        if not self._silent:
            silence(self._ida)
            self._silent = True

    def advance(self, t: float, t_stop: float) -> tuple[Advance, float, Array, Array]:
        """Go to `t`, never evaluating beyond `t_stop`.

        A result that is not finite is never returned: the last good one is, with the outcome.
        """
        outcome = Advance.REACHED
        try:
            result = self._ida.step(t, "normal", t_stop)
        except KeyboardInterrupt:
            outcome = Advance.INTERRUPTED
        except _TimeLimit:
            outcome = Advance.TIME_LIMIT
        except _NotFinite:
            outcome = Advance.NOT_FINITE
        else:
            if result.status < 0:
                outcome = _OUTCOMES.get(result.status, Advance.CONVERGENCE_FAILURE)
            elif not math.isfinite(result.y.sum()):
                outcome = Advance.NOT_FINITE
            else:
                self._t, self._y, self._yp = result.t, result.y, result.yp
                if result.status == _ROOT_RETURN:
                    outcome = Advance.EVENT
        return outcome, self._t, self._y, self._yp

    def _residual(self, t: float, y: Array, yp: Array, out: Array) -> None:
        # A Python function stands between IDA and the compiled one, because it is where Ctrl-C and
        # the clock are noticed during a long advance.
        counters = self.counters
        counters.residual_calls += 1
        self.equations.residual(t, y, yp, out)
        if counters.residual_calls % _CALLS_BETWEEN_CLOCKS == 0:
            if time.monotonic() > counters.deadline:
                raise _TimeLimit
            if not math.isfinite(out.sum()):  # IDA itself would go on to max_steps
                raise _NotFinite

    def _jacobian(self, t: float, y: Array, yp: Array, _res: Array, c_j: float, out: Array) -> None:
        self.counters.jacobian_calls += 1
        self.equations.jacobian(t, y, yp, c_j, out)

    def _ida_options(self) -> dict:
        options = self._options
        common = {
            "rtol": options.rtol,
            "atol": options.atol,
            "max_order": options.max_order,
            "max_num_steps": options.max_steps,
            "first_step": options.first_step,
            "max_step": options.max_step or 0.0,
        }
        if self._roots is not None:
            common |= {"eventsfn": self._roots, "num_events": self._roots.count}
        if self._solver() == "band":
            lower, upper = self.equations.bandwidths
            return common | {"linsolver": "band", "lband": lower, "uband": upper, "jacfn": self._jacobian}
        factors = _BandedFactors(self)
        return common | {
            "linsolver": "gmres",
            "precond": IDAPrecond(factors.setup, factors.solve),
            "jactimes": IDAJacTimes(None, factors.times),
        }

    def _solver(self) -> str:
        chosen = self._options.linear_solver
        if chosen != "auto":
            return chosen
        largest = LARGEST_BAND_SYSTEM if self._roots is None else LARGEST_BAND_OF_MANY
        return "band" if np.size(self._options.atol) <= largest else "krylov"


class _Roots:
    """An event function in the form of scikit-sundae."""

    def __init__(self, events: Events) -> None:
        self._events = events
        self.count = events.count
        self.terminal = [True] * events.count
        self.direction = [-1] * events.count

    def __call__(self, t: float, y: Array, yp: Array, out: Array) -> None:
        self._events(t, out)

    def keep_nothing(self) -> None:
        """Replace the lists in which the binding collects all events of an IDA object's life.

        They would grow without end, and be copied into arrays at every step.
        """
        self._i = self._t = self._y = self._yp = deque[Array](maxlen=0)


class _BandedFactors:
    """An exact factorisation of the Jacobian as preconditioner: GMRES then ends after one iteration.

    This is how long cables keep linear time and memory, see `LARGEST_BAND_SYSTEM`.  Between two
    factorisations the Jacobian stands for itself at another c_j by the factor with which IDA scales
    the corrections of its direct solvers, 2/(1 + c_j/c_j').
    """

    def __init__(self, integrator: IdaIntegrator) -> None:
        self._integrator = integrator

    def setup(self, t: float, y: Array, yp: Array, _res: Array, c_j: float) -> None:
        """Factor the Jacobian anew."""
        self._integrator.counters.jacobian_calls += 1
        equations = self._integrator.equations
        self._lower, self._upper = equations.bandwidths
        band = equations.band_jacobian(t, y, yp, c_j, rows_above=self._lower)
        self._lu, self._pivots, _ = dgbtrf(band, self._lower, self._upper, overwrite_ab=True)
        self._factored_c_j = c_j
        self._multiplied = False

    def solve(self, _t, _y, _yp, _res, right, out, c_j, _delta) -> None:
        """Solve with the factors."""
        if self._multiplied:
            self._multiplied = False
            out[:] = right
            return
        out[:] = dgbtrs(self._lu, self._lower, self._upper, right, self._pivots)[0]
        out *= 2.0 / (1.0 + c_j / self._factored_c_j)

    def times(self, _t, _y, _yp, _res, vector, out, _c_j) -> None:
        """Jacobian times a vector, which GMRES preconditions at once: together the identity."""
        out[:] = vector
        self._multiplied = True
