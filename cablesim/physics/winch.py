"""A node appears at the winch or goes on its drum: pure functions on the state.

Depends on: physics.

The winch's segment reaches from the last free node to the winch.  It is cut where the next material
node has come out, and joined with the one before when too little of it is left.  Both keep what the
discrete equations hold:

* closure: the chords of the two parts add up to the chord of the whole, so that the sum of all
  chords does not change by more than rounding;
* mass and length: the lengths of the parts add up, and the lumped masses with them;
* balance of forces: tension is linear along the parts and the new node lies on the parabola that
  goes on with the curvature of the joint before it.  For a cable at rest under even loads both are
  exact, so that neither node starts to move;
* compatibility: each part stretches at the rate of the whole.

On the chord itself, with one tension for both parts, the new node is out of balance by all the weight
on it and the node before by what it has lost: the segments then swing and ring after each insertion
(README, design notes, has the measured difference).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.model import CableModel
from cablesim.physics.parameters import EA_, LENGTH, REFERENCE_LENGTH, WINCH_START_

Array = NDArray[np.float64]

LARGEST_OFFSET = 0.25
"""Farthest that a new node is put from the chord, over the shorter part: a folded joint has no curvature."""


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


def insert_node(t: float, y: Array, old: CableModel, new: CableModel, *, loaded: bool = False) -> Array:
    """State after the next material node has come out.

    Parameters
    ----------
    t : float
        Time [s].
    y : ndarray, shape (old.layout.size,)
        State before.
    old, new : CableModel
        Equations before and after; `new` has one segment more.
    loaded : bool
        Whether the last free node carries an attachment: its kink is then no curvature of the cable.

    Returns
    -------
    ndarray, shape (new.layout.size,)
        State after.
    """
    layout, parameters = old.layout, old.parameters
    chords = parameters.segments[-2:, REFERENCE_LENGTH, None] * layout.chord(y)[-2:]
    first, second = _parts(t, new)
    whole = first + second
    direction, before = chords[1] / np.linalg.norm(chords[1]), chords[0] / np.linalg.norm(chords[0])
    stretch = 1.0 + layout.tension(y)[-1] / parameters.constants[EA_]
    between = 0.5 * (parameters.segments[-2, LENGTH] + whole)
    curvature = np.zeros_like(direction) if loaded else stretch * (direction - before) / between
    gradient = 0.0 if loaded else float(np.diff(layout.tension(y)[-2:])[0]) / between

    offset = -0.5 * first * second * curvature
    offset -= (offset @ direction) * direction
    offset *= min(1.0, LARGEST_OFFSET * min(first, second) / max(float(np.linalg.norm(offset)), 1e-300))
    across = material_velocity(t, y, old) - layout.velocity(y)[-1]
    # the last term turns the offset with the chord, so that both parts stretch as the whole did
    velocity = layout.velocity(y)[-1] + first / whole * across - (offset @ across) / whole * direction

    result = np.empty(new.layout.size)
    _copy_cells(layout.segments - 1, old, y, new, result)
    new.layout.velocity(result)[-2:] = layout.velocity(y)[-1], velocity
    tension = layout.tension(y)[-1]
    new.layout.tension(result)[-2:] = tension - 0.5 * gradient * second, tension + 0.5 * gradient * first
    parts = np.stack((first / whole * chords[1] + offset, second / whole * chords[1] - offset))
    new.layout.chord(result)[-2:] = parts / new.parameters.segments[-2:, REFERENCE_LENGTH, None]
    return result


def remove_node(t: float, y: Array, old: CableModel, new: CableModel) -> Array:
    """State after the last free node has gone on the drum; the inverse of `insert_node`.

    The chord of a kinked pair is shorter than the pair.  The tension is not computed from it, which
    would give a false -EA kink^2/8; the feedback beta lets the difference fade.

    Parameters
    ----------
    t : float
        Time [s].
    y : ndarray, shape (old.layout.size,)
        State before.
    old, new : CableModel
        Equations before and after; `new` has one segment less.

    Returns
    -------
    ndarray, shape (new.layout.size,)
        State after.
    """
    layout = old.layout
    chords = old.parameters.segments[-2:, REFERENCE_LENGTH, None] * layout.chord(y)[-2:]
    parts = np.array(_parts(t, old))
    result = np.empty(new.layout.size)
    _copy_cells(layout.segments - 2, old, y, new, result)
    new.layout.velocity(result)[-1] = layout.velocity(y)[-2]
    new.layout.tension(result)[-1] = parts @ layout.tension(y)[-2:] / parts.sum()
    new.layout.chord(result)[-1] = chords.sum(axis=0) / new.parameters.segments[-1, REFERENCE_LENGTH]
    return result


def _parts(t: float, model: CableModel) -> tuple[float, float]:
    """Unstretched lengths of the last two segments at time t."""
    length = model.deployed_length(t)[0] - model.parameters.constants[WINCH_START_]
    return float(model.parameters.segments[-2, LENGTH]), length


def _copy_cells(cells: int, old: CableModel, y: Array, new: CableModel, result: Array) -> None:
    """Copy the first cells, and the closing one."""
    body, closing = cells * old.layout.cell, 2 * old.layout.dimension
    result[:body] = y[:body]
    result[-closing:] = y[-closing:]
