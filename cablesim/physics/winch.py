"""A node appears at the winch or goes on its drum: pure functions on the state.

Depends on: physics.

The winch's segment reaches from the last free node to the winch.  It is cut where the next material
node has come out, and joined with the one before when too little of it is left.  Both keep what the
discrete equations hold:

* closure: the chords of the two parts add up to the chord of the whole, so that the sum of all
  chords does not change by more than rounding;
* mass and length: the lengths of the parts add up, and the lumped masses with them;
* compatibility (3): each part stretches at the rate of the whole, the one at which its tension
  changes.  The velocities at hand fulfil that only to the integrator's tolerance, which in a short stiff
  segment is a hundred times that rate; the rest of the cable takes up the difference evenly;
* balance of forces (2): the new node lies beside the chord, and the tensions of the parts differ, by
  so much that it moves as the material around it does.  For a cable at rest both its neighbours
  then stay at rest, too.

Put on the chord itself, with one tension for both parts, the new node is out of balance by all of its
weight, and the one before by what it has lost: they fall, swing and ring after each insertion (README,
design notes, has the measured difference).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.model import CableModel
from cablesim.physics.parameters import EA_

Array = NDArray[np.float64]

LARGEST_OFFSET = 0.2
"""Farthest that a new node is put from the chord, over the shorter part: a slack or folded cable has no
tension that would hold it anywhere."""

NEWTON_STEPS = 2
DIFFERENCE = 1e-6  # of the chord, and of the tension, for the derivatives


def material_velocity(t: float, y: Array, model: CableModel) -> Array:
    """Velocity (D,) of the material at the winch: V_n - L' (1 + eps) t.

    Parameters
    ----------
    t : float
        Time [s].
    y : ndarray, shape (size,)
        State.
    model : CableModel
        Its equations.

    Returns
    -------
    ndarray, shape (D,)
        [m/s]; V_n itself is the velocity of the winch.
    """
    layout = model.layout
    chord = layout.chord(y)[-1]
    stretch = 1.0 + layout.tension(y)[-1] / model.parameters.constants[EA_]
    return layout.end_velocity(y) - model.deployed_length(t)[1] * stretch * chord / np.linalg.norm(chord)


def insert_node(t: float, y: Array, yp: Array, old: CableModel, new: CableModel) -> Array:
    """State after the next material node has come out.

    Parameters
    ----------
    t : float
        Time [s].
    y, yp : ndarray, shape (old.layout.size,)
        State before, and its rates.
    old, new : CableModel
        Equations before and after; `new` has one segment more.

    Returns
    -------
    ndarray, shape (new.layout.size,)
        State after.
    """
    cut = _Cut(t, y, old, new)
    rates = _split_rates(t, y, yp, old, new)
    velocity = new.layout.node_velocity(cut.state(np.zeros(new.layout.dimension)))[-3:]
    new.layout.chord(rates)[-2:] = np.diff(velocity, axis=0) / new.parameters.lengths[-2:, None]
    out = np.empty(new.layout.size)
    node = (new.layout.segments - 1) * new.layout.cell
    row = slice(node, node + new.layout.dimension)

    def unbalanced(unknowns: Array) -> Array:
        new.residual(t, cut.state(unknowns), rates, out)
        return out[row].copy()

    # Newton's method on the balance of forces of the new node; nearly linear, so two steps do
    unknowns = np.zeros(new.layout.dimension)
    for _ in range(NEWTON_STEPS):
        force = unbalanced(unknowns)
        slopes = [(unbalanced(unknowns + step) - force) / step.sum() for step in cut.differences]
        try:
            unknowns = cut.limited(unknowns - np.linalg.solve(np.stack(slopes, axis=1), force))
        except np.linalg.LinAlgError:  # slack without any force
            break
    result = cut.state(unknowns)
    _keep_tension_rates(t, result, new, new.layout.tension(rates)[-2:])
    return result


class _Cut:
    """The winch's segment cut in two: states for any place of the new node and difference of tension.

    The unknowns are D numbers: the offset from the chord along D - 1 normals [m], and the tension of
    the second part less that of the first [N].
    """

    def __init__(self, t: float, y: Array, old: CableModel, new: CableModel) -> None:
        layout = old.layout
        self._y, self._old, self._new = y, old, new
        self._parts = new.lengths(t)[-2:]
        self._whole = float(self._parts.sum())
        self._chord = old.parameters.lengths[-1] * layout.chord(y)[-1]
        self._size = float(np.linalg.norm(self._chord))
        self._direction = self._chord / self._size
        self._normals = np.linalg.svd(self._direction[None])[2][1:]
        self._tension = float(layout.tension(y)[-1])
        self._free = layout.velocity(y)[-1]
        self._across = material_velocity(t, y, old) - self._free
        scales = np.full(layout.dimension, self._size)
        scales[-1] = max(abs(self._tension), 1e-6 * old.parameters.constants[EA_])
        self.differences = np.diag(DIFFERENCE * scales)
        self._limits = np.full(layout.dimension, LARGEST_OFFSET * self._parts.min())
        self._limits[-1] = np.inf

    def limited(self, unknowns: Array) -> Array:
        """The unknowns within what makes sense."""
        return np.clip(unknowns, -self._limits, self._limits)

    def state(self, unknowns: Array) -> Array:
        """State of the new equations."""
        offset = unknowns[:-1] @ self._normals
        share = self._parts / self._whole
        # the last term turns the offset with the chord, so that both parts stretch as the whole does
        velocity = self._free + share[0] * self._across
        velocity -= (offset @ self._across) / self._size * self._direction
        layout, result = self._new.layout, np.empty(self._new.layout.size)
        _copy_cells(self._old.layout.segments - 1, self._old, self._y, self._new, result)
        layout.velocity(result)[-2:] = self._free, velocity
        # by these shares the mean over the length of both is the tension of the whole
        layout.tension(result)[-2:] = self._tension + unknowns[-1] * np.array([-share[1], share[0]])
        parts = share[:, None] * self._chord + np.stack((offset, -offset))
        layout.chord(result)[-2:] = parts / self._new.parameters.lengths[-2:, None]
        return result


def _split_rates(t: float, y: Array, yp: Array, old: CableModel, new: CableModel) -> Array:
    """Rates with which the new node moves as the material around it: acceleration linear along the chord."""
    layout, rates = old.layout, np.empty(new.layout.size)
    _copy_cells(layout.segments, old, yp, new, rates)
    chord = layout.chord(y)[-1]
    gain = old.deployed_motion(t)[2] * chord / np.linalg.norm(chord)
    first, second = new.lengths(t)[-2:]
    free = layout.velocity(yp)[-1]
    at_winch = layout.end_velocity(yp) - gain
    new.layout.velocity(rates)[-1] = free + first / (first + second) * (at_winch - free)
    new.layout.tension(rates)[-1] = layout.tension(yp)[-1]
    return rates


def remove_node(t: float, y: Array, yp: Array, old: CableModel, new: CableModel) -> Array:
    """State after the last free node has gone on the drum; the inverse of `insert_node`.

    The chord of a kinked pair is shorter than the pair.  The tension is not computed from it, which
    would give a false -EA kink^2/8; the feedback beta lets the difference fade.

    Parameters
    ----------
    t : float
        Time [s].
    y, yp : ndarray, shape (old.layout.size,)
        State before, and its rates.
    old, new : CableModel
        Equations before and after; `new` has one segment less.

    Returns
    -------
    ndarray, shape (new.layout.size,)
        State after.
    """
    layout = old.layout
    chords = old.parameters.lengths[-2:, None] * layout.chord(y)[-2:]
    parts = old.lengths(t)[-2:]
    share = parts / parts.sum()
    result = np.empty(new.layout.size)
    _copy_cells(layout.segments - 2, old, y, new, result)
    new.layout.velocity(result)[-1] = layout.velocity(y)[-2]
    new.layout.tension(result)[-1] = share @ layout.tension(y)[-2:]
    new.layout.chord(result)[-1] = chords.sum(axis=0) / new.parameters.lengths[-1]
    _keep_tension_rates(t, result, new, share[None] @ layout.tension(yp)[-2:])
    return result


def _keep_tension_rates(t: float, y: Array, model: CableModel, wanted: Array) -> None:
    """Change velocities along the cable so that its last one or two tensions change at these rates [N/s].

    The node between the two takes what the second lacks; the nodes before, evenly, the rest.
    """
    layout, rates, out = model.layout, np.zeros(y.size), np.empty(y.size)
    layout.tension(rates)[-wanted.size :] = wanted
    model.residual(t, y, rates, out)
    lengths = model.lengths(t)
    lacking = lengths[-wanted.size :] * layout.tension(out)[-wanted.size :]
    before = layout.segments - wanted.size + 1  # nodes up to the first of these segments
    arc = np.concatenate(([0.0], np.cumsum(lengths[: before - 1])))
    chords = layout.chord(y)
    units = chords / np.sqrt(np.einsum("ec,ec->e", chords, chords))[:, None]
    layout.velocity(y)[:before] -= (lacking.sum() / arc[-1] * arc)[:, None] * units[:before]
    layout.velocity(y)[before:] -= lacking[1:, None] * units[before:]


def _copy_cells(cells: int, old: CableModel, y: Array, new: CableModel, result: Array) -> None:
    """Copy the first cells, and the closing one."""
    body, closing = cells * old.layout.cell, 2 * old.layout.dimension
    result[:body] = y[:body]
    result[-closing:] = y[-closing:]
