"""The winch of a running simulation: when nodes come and go, and the equations of each size.

Depends on: mesh, motion, status, physics.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cablesim.mesh import FEWEST, Mesh
from cablesim.motion import earliest_fall
from cablesim.physics.model import CableModel
from cablesim.physics.parameters import WINCH_START_
from cablesim.physics.winch import insert_node, remove_node
from cablesim.status import Status

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Part of the cable's length by which its end or the minimum may be passed before the run stops."""

AT_REST = 1e-12
"""Payout speed [m/s] up to which the winch is at rest."""

GUARD = 0.5
"""Part of the shortest winch segment that a step may reel in beyond the length at which its node goes."""

KEPT_BYTES, FEWEST_MODELS = 50e6, 4
"""Most bytes of equations kept for other sizes (a long motion makes each of them big), and fewest of them."""

COMMANDED = 64
"""Largest table of a motion that can be a command from outside; larger ones are the scene's own."""


@dataclass(frozen=True)
class Bounds:
    """Deployed lengths [m] between which the present nodes serve, and what happens there.

    `at_low` and `at_high` are the status with which the run ends; ``None``: a node goes, or comes.
    """

    low: float
    high: float
    at_low: Status | None
    at_high: Status | None


def bounds_at(mesh: Mesh, segments: int, minimum_length: float) -> Bounds:
    """Bounds of a mesh of the whole cable of which `segments` segments are deployed."""
    slack = ROUNDING * mesh.nodes[-1]
    low, at_low = mesh.removal_length(segments), None
    if mesh.carries_attachment(segments - 1):
        at_low = Status.ATTACHMENT_AT_WINCH
    elif segments <= FEWEST:
        at_low = Status.MINIMUM_LENGTH
    if minimum_length - slack >= low:
        low, at_low = minimum_length - slack, Status.MINIMUM_LENGTH
    high = mesh.insertion_length(segments)
    if high is None:
        return Bounds(low, float(mesh.nodes[-1]) + slack, at_low, Status.DRUM_EMPTY)
    return Bounds(low, high, at_low, None)


@dataclass(frozen=True)
class Limit:
    """Where the winch can go no further.

    Attributes
    ----------
    status : Status
        What a run that goes on towards it ends with.
    side : int
        Sign of the payout speeds that it forbids.
    """

    status: Status
    side: int

    def forbids(self, speed: float, rate: float = 0.0) -> bool:
        """Whether a payout speed [m/s], or its rate [m/s2] at rest, goes on towards it."""
        towards = self.side * speed
        return towards > AT_REST or (towards >= -AT_REST and self.side * rate > 0.0)


class Winding:
    """Nodes that are out, and the models of the sizes met lately; for the integrator, its event functions.

    Parameters
    ----------
    mesh : Mesh
        Of the whole cable.
    minimum_length : float
        Deployed length at which the run ends [m].
    model : CableModel
        Equations at the start.
    build : callable
        Makes the equations of a mesh.
    """

    count = 2  # event functions: distances to the lower and the upper bound

    def __init__(
        self, mesh: Mesh, minimum_length: float, model: CableModel, build: Callable[[Mesh], CableModel]
    ) -> None:
        self._mesh = mesh
        self._minimum = minimum_length
        self._build = build
        self._models = OrderedDict({model.layout.segments: model})
        self.use(model)

    def __call__(self, t: float, out: Array) -> None:
        """Distances to both bounds: what the integrator looks for the zeros of."""
        length = self.model.deployed_length(t)[0]
        out[0] = length - self.bounds.low
        out[1] = self.bounds.high - length

    def use(self, model: CableModel) -> None:
        """Go on with these equations."""
        self.model = self._models[model.layout.segments] = model
        self.bounds = bounds_at(self._mesh, model.layout.segments, self._minimum)

    def limit_at(self, t: float) -> Limit | None:
        """The limit at which the winch is, if it is at one."""
        length = self.model.deployed_length(t)[0]
        near = 0.5 * ROUNDING * float(self._mesh.nodes[-1])
        if self.bounds.at_low is not None and length <= self.bounds.low + near:
            return Limit(self.bounds.at_low, -1)
        if self.bounds.at_high is not None and length >= self.bounds.high - near:
            return Limit(self.bounds.at_high, 1)
        return None

    def ended(self, t: float) -> Status | None:
        """The status of a winch that is at a limit and goes on towards it."""
        limit = self.limit_at(t)
        if limit is None or not limit.forbids(*self.model.deployed_motion(t)[1:]):
            return None
        return limit.status

    def cross(self, t: float, y: Array, yp: Array) -> tuple[Status, Array]:
        """Put a node on the drum or take one from it, at the bound that has been reached.

        Returns the status with which the run ends (``COMPLETED``: it goes on) and the state; the
        equations are then those of `model`.
        """
        length, _ = self.model.deployed_length(t)
        at_low = length - self.bounds.low < self.bounds.high - length
        end = self.bounds.at_low if at_low else self.bounds.at_high
        if end is not None:
            return end, y
        old, segments = self.model, self.model.layout.segments
        self.use(self._model_of(segments - 1 if at_low else segments + 1))
        if at_low:
            return Status.COMPLETED, remove_node(t, y, yp, old, self.model)
        return Status.COMPLETED, insert_node(t, y, yp, old, self.model)

    def guard_time(self, t: float) -> float:
        """Time [s] at which a step must end at the latest.

        IDA looks for zeros only after a step, and until then the last segment must keep some length.
        """
        parameters = self.model.parameters
        beyond = GUARD * (self.bounds.low - float(parameters.constants[WINCH_START_]))
        fall = self.model.deployed_length(t)[0] - self.bounds.low + beyond
        return earliest_fall(parameters.winch_breaks, parameters.winch_coefficients[:, :, 0], t, fall)

    def _model_of(self, segments: int) -> CableModel:
        """Equations of another size, with the motions of the present ones."""
        if segments not in self._models:
            full = float(self._mesh.nodes[segments])
            self._models[segments] = self._build(self._mesh.deployed(segments, full))
            kept = max(FEWEST_MODELS, int(KEPT_BYTES / self._models[segments].bytes))
            while len(self._models) > kept:
                self._models.popitem(last=False)
        self._models.move_to_end(segments)
        model, now = self._models[segments], self.model.parameters
        if all(getattr(now, name).shape == getattr(model.parameters, name).shape for name in _MOTIONS):
            for name in _MOTIONS:
                if getattr(now, name).size <= COMMANDED:
                    getattr(model.parameters, name)[:] = getattr(now, name)
            return model
        changes = {name: getattr(now, name) for name in _MOTIONS}
        return model.with_parameters(model.parameters._replace(**changes))


_MOTIONS = (
    "winch_breaks",
    "winch_coefficients",
    "breaks_a",
    "coefficients_a",
    "breaks_b",
    "coefficients_b",
)
