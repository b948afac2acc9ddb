"""The search for rest.

Depends on: physics, statics.closing.

Newton and relaxation are one thing here.  A step of the implicit Euler method of length h on the
equations of motion, with the velocities set back to nought before it, is Newton's method on the
static residual when h is long, and a heavily damped motion downhill when h is short.  It needs no
equations of its own, and closure and compatibility, which are linear, hold at every iterate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_banded

from cablesim.motion.drive import uniform
from cablesim.physics.model import CableModel
from cablesim.physics.parameters import (
    DRAG_NORMAL,
    DRAG_POINT,
    DRAG_TANGENTIAL,
    EA_,
    EI_,
    WET_WEIGHT,
    Parameters,
)
from cablesim.statics.closing import sum_of_chords
from cablesim.statics.outcome import InitialState, Rung, StaticsError

Array = NDArray[np.float64]

NEWTON_ITERATIONS = 30
LONGEST_TURN = 0.5  # largest change of a segment vector in one Newton iteration
STATIC_STEP = 1e6  # [s] implicit Euler step that makes inertia vanish
FIRST_STEP, LAST_STEP = 1e-2, 1e5  # [s] of relaxation
RELAXATION_STEPS = 400
GROWTH = ((8, 3.0), (20, 1.5))  # Newton iterations up to which a step grows by a factor
LONGEST_RELAXATION = 1.0  # a longer step swings joints that are folded over, to and fro for ever
SMALLEST_LOAD_STEP = 1.0 / 64.0
REST_TOLERANCE = 1e-9  # unbalanced force on a node at rest, over the scene's largest force


class Search:
    """Looks for rest: the model with its ends stopped, and counters for the report."""

    def __init__(self, model: CableModel, velocity: Array) -> None:
        self.moving = model
        self.model = model.with_parameters(_stopped(model, velocity))
        self.velocity = velocity
        self.iterations = 0

    def equilibrium(self, y: Array, rung: Rung) -> InitialState:
        """Climb the ladder from a first shape."""
        y = self._at_rest(y)
        if not self._many_rest_shapes():
            for climb in (self._newton, self._load_continuation):
                found = climb(y)
                if found is not None and self._balanced(found):
                    return self._report(found, rung if rung is Rung.TAUT else Rung.NEWTON)
        found = self._relaxation(y)
        if self._balanced(found):
            return self._report(found, Rung.RELAXATION)
        raise StaticsError(
            f"No rest shape was found: after {self.iterations} Newton iterations a force of "
            f"{self._unbalanced(found):.3g} N is left on a node, where the largest force is "
            f"{self._force_scale(found):.3g} N. "
            "Start from markers or a taut shape and let the dynamic simulation settle, or give "
            "'through' points near the rest shape."
        )

    def _many_rest_shapes(self) -> bool:
        """A slack cable that bends, or weighs nothing, has many rest shapes: go downhill to a stable one."""
        if self.model.features.bending:
            return True
        return float(np.abs(self.model.loads(0.0)[1:-1, WET_WEIGHT]).max()) == 0.0

    def _balanced(self, y: Array) -> bool:
        tolerance = REST_TOLERANCE * self._force_scale(y)
        return bool(np.isfinite(y).all()) and self._unbalanced(y) <= tolerance

    def _force_scale(self, y: Array) -> float:
        """Largest of tensions, total weight and total drag [N]."""
        parameters, layout = self.model.parameters, self.model.layout
        loads = self.model.loads(0.0)
        weight = np.abs(loads[:, WET_WEIGHT]).sum()
        bending = parameters.constants[EI_] / self.model.lengths(0.0).sum() ** 2
        fastest = float((parameters.current_velocity**2).sum(axis=-1).max())
        drag = loads[:, [DRAG_NORMAL, DRAG_TANGENTIAL, DRAG_POINT]].sum() * fastest
        rounding = 1e-9 * parameters.constants[EA_]  # a slack cable without weight holds no force at all
        return max(weight, bending, drag, float(np.abs(layout.tension(y)).max()), rounding)

    def _report(self, y: Array, rung: Rung) -> InitialState:
        y = self._at_rest(y)
        self.model.layout.end_place(y)[:] += _closure_defect(y, self.model)
        self.moving.impose_end_velocities(0.0, y)  # ends that start with a jump leave the cable behind
        return InitialState(self.moving, y, rung, self._unbalanced(y), self.iterations)

    def _at_rest(self, y: Array) -> Array:
        return _moving(y, self.model, self.velocity)

    def _unbalanced(self, y: Array) -> float:
        return unbalanced_force(self.model, y, self.velocity)

    def _newton(self, y: Array) -> Array | None:
        """Two long steps: the second takes out what the first left of the closing of the cable."""
        first = self._step(y, STATIC_STEP, self.model)
        return None if first is None else self._step(first, STATIC_STEP, self.model)

    def _load_continuation(self, y: Array) -> Array | None:
        """From the bare cable in still water to the full loads, in steps that adapt."""
        load, step = 0.0, 0.25
        while load < 1.0:
            trial = min(1.0, load + step)
            found = self._step(y, STATIC_STEP, self.model.with_parameters(_loaded(self.model, trial)))
            if found is not None:
                y, load, step = found, trial, 2.0 * step
            else:
                step *= 0.5
                if step < SMALLEST_LOAD_STEP:
                    return None
        return self._step(y, STATIC_STEP, self.model)

    def _relaxation(self, y: Array) -> Array:
        """Steps that grow while Newton converges: first downhill, in the end Newton's method."""
        h = FIRST_STEP
        for _ in range(RELAXATION_STEPS):
            before = self.iterations
            found = self._step(y, h, self.model)
            if found is None or self._turn(y, found) > LONGEST_RELAXATION:
                h *= 0.25
                continue
            y = found
            if h >= LAST_STEP and self._balanced(y):
                break
            h = min(LAST_STEP, h * _growth(self.iterations - before))
        return y

    def _turn(self, y: Array, other: Array) -> float:
        return float(np.abs(self.model.layout.chord(other) - self.model.layout.chord(y)).max())

    def _step(self, y: Array, h: float, model: CableModel) -> Array | None:
        """One implicit Euler step of length h from rest; None when Newton does not converge."""
        start = self._at_rest(y)
        new = start.copy()
        out = np.empty_like(y)
        layout = model.layout
        scale = self._force_scale(y)
        for _ in range(NEWTON_ITERATIONS):
            self.iterations += 1
            rates = (new - start) / h
            if model.features.free_a:  # the place of end B is absolute then, and moves with the whole cable
                layout.end_place(rates)[:] += self.velocity
            model.residual(0.0, new, rates, out)
            try:
                change = solve_banded(
                    model.bandwidths, model.band_jacobian(0.0, new, rates, 1.0 / h), -out, check_finite=False
                )
            except LinAlgError:
                return None
            turn = float(np.abs(layout.chord(change)).max())
            if not np.isfinite(turn):
                return None
            new = new + min(1.0, LONGEST_TURN / max(turn, 1e-300)) * change
            if turn < 1e-11 and np.abs(layout.tension(change)).max() < 1e-9 * scale:
                return new
        return None


def _growth(iterations: int) -> float:
    """By how much the next step of relaxation may be longer than one that took Newton so many iterations."""
    return next((growth for most, growth in GROWTH if iterations <= most), 1.0)


def _closure_defect(y: Array, model: CableModel) -> Array:
    """What is missing (rounding) between the integrated place of end B and the sum of the chords."""
    if model.features.free_a:
        return np.zeros(model.layout.dimension)
    return sum_of_chords(y, model) - model.layout.end_place(y)


def _stopped(model: CableModel, velocity: Array) -> Parameters:
    """Parameters with both ends in uniform motion through their places at t = 0, and the winch at rest."""
    length = np.array([model.deployed_length(0.0)[0]])
    tables = {
        "a": uniform(model.end_place_and_velocity("a", 0.0)[0], velocity),
        "b": uniform(model.end_place_and_velocity("b", 0.0)[0], velocity),
    }
    changes: dict[str, Array] = {}
    for end, (breaks, coefficients) in tables.items():
        changes |= {f"breaks_{end}": breaks, f"coefficients_{end}": coefficients}
    changes["winch_breaks"], changes["winch_coefficients"] = uniform(length, np.zeros(1))
    return model.parameters._replace(**changes)


def _loaded(model: CableModel, load: float) -> Parameters:
    """Parameters with a share of the point loads and of the current; the bare cable at 0."""
    bodies = model.parameters.bodies.copy()
    bodies[:, [WET_WEIGHT, DRAG_POINT]] *= load
    return model.parameters._replace(bodies=bodies, current_velocity=load * model.parameters.current_velocity)


def unbalanced_force(model: CableModel, y: Array, velocity: Array | float = 0.0) -> float:
    """Largest force on a node, were all of the cable to move with one velocity (D,) [N]."""
    layout, out = model.layout, np.empty_like(y)
    model.residual(0.0, _moving(y, model, velocity), np.zeros_like(y), out)
    free = [model.features.free_a, *[True] * (layout.segments - 1), model.features.free_b]
    return float(np.linalg.norm(layout.node_velocity(out)[free], axis=1).max())


def _moving(y: Array, model: CableModel, velocity: Array | float) -> Array:
    """The state with one velocity everywhere, as a copy."""
    y = y.copy()
    model.layout.velocity(y)[:] = velocity
    model.layout.end_velocity(y)[:] = velocity
    return y
