"""Cables whose chords reach from end A to end B exactly.

Depends on: physics, statics.pull.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cablesim.physics.model import CableModel
from cablesim.physics.parameters import EA_, WET_WEIGHT
from cablesim.statics.outcome import StaticsError
from cablesim.statics.pull import reaching_pulls, unit

Array = NDArray[np.float64]

STRAIGHT = 1e-12  # slack over length below which a cable is straight
COLLINEAR = 1e-6  # [rad] root mean square angle to one line below which a cable gets a bow ...
BOW = 1e-3  # [rad] ... with this angle at its ends, before turning makes it what is needed
ROUNDS = 5


def sum_of_chords(y: Array, model: CableModel) -> Array:
    """From A to B along the chords, (D,) [m]."""
    return model.parameters.lengths @ model.layout.chord(y)


def held_span(model: CableModel) -> Array | None:
    """From end A to end B at t = 0, (D,) [m], when both are held."""
    if model.features.free_a or model.features.free_b:
        return None
    return model.end_place_and_velocity("b", 0.0)[0] - model.end_place_and_velocity("a", 0.0)[0]


def slack(model: CableModel) -> float:
    """Part of the cable's length that its ends do not need: 1 with a free end, negative when taut."""
    span = held_span(model)
    if span is None:
        return 1.0
    return 1.0 - float(np.linalg.norm(span)) / float(model.lengths(0.0).sum())


def close(y: Array, model: CableModel, directions: Array, strain: Array) -> None:
    """Write segments of nearly these directions (n, D) and strains (n,) that reach from A to B.

    They are turned as little as it takes; where the ends are further apart than the cable so strained is
    long, it is straight and strained evenly further.  Tensions are those of the strains.

    Raises
    ------
    StaticsError
        When the gap is not closed.
    """
    layout, span = model.layout, held_span(model)
    if span is not None:
        lengths = model.lengths(0.0) * (1.0 + strain)
        further = float(np.linalg.norm(span)) / float(lengths.sum())
        if further <= 1.0 - STRAIGHT:
            directions = _turned(directions, lengths, span, _sag(model))
        elif not _closed(directions, lengths, span):
            directions = np.tile(span / np.linalg.norm(span), (len(lengths), 1))
            strain = further * (1.0 + strain) - 1.0
    layout.chord(y)[:] = ((1.0 + strain) * model.unstretched(0.0))[:, None] * directions
    layout.tension(y)[:] = model.parameters.constants[EA_] * strain
    if not model.features.free_a:
        layout.end_place(y)[:] = sum_of_chords(y, model)


def _sag(model: CableModel) -> Array:
    """Unit vector (D,) to which a slack cable hangs: down, up when it floats."""
    vertical = np.zeros(model.layout.dimension)
    vertical[-1] = -1.0 if model.loads(0.0)[:, WET_WEIGHT].sum() >= 0.0 else 1.0
    return vertical


def _closed(directions: Array, lengths: Array, target: Array) -> bool:
    return bool(np.linalg.norm(target - lengths @ directions) < 1e-14 * lengths.sum())


def _turned(directions: Array, lengths: Array, target: Array, sag: Array) -> Array:
    """Directions near these with which segments of these lengths reach `target`, by least turning.

    Along the line of a straight cable, or one folded on itself, there is no telling to which side it is to
    turn: it is bent a little to that of `sag` first.  A cable that leaves its line turns to the side on
    which it is.
    """
    along, aside = _line(directions, lengths, sag)
    if np.sqrt((lengths / lengths.sum()) @ (1.0 - (directions @ along) ** 2).clip(0.0)) < COLLINEAR:
        middle = (np.cumsum(lengths) - 0.5 * lengths) / lengths.sum()
        directions = unit(directions + np.outer(BOW * (1.0 - 2.0 * middle), aside))
    for _ in range(ROUNDS):  # sums of unit vectors are exact to rounding, those of tiny pulls are not
        if _closed(directions, lengths, target):
            break
        directions = unit(reaching_pulls(directions, lengths, target))
    gap = float(np.linalg.norm(target - lengths @ directions))
    if not gap < 1e-9 * lengths.sum():
        raise StaticsError(
            f"The first shape could not be closed: {gap:.3g} m are missing between the ends. "
            "Start from 'equilibrium', or give markers nearer to a possible shape."
        )
    return directions


def _line(directions: Array, lengths: Array, sag: Array) -> tuple[Array, Array]:
    """Unit vectors (D,) along the line from which directions differ least, and across it towards `sag`."""
    _, axes = np.linalg.eigh((directions * lengths[:, None]).T @ directions)
    along = axes[:, -1]
    across = sag - (sag @ along) * along
    if np.linalg.norm(across) < 1e-9:  # the line is vertical
        across = axes[:, 0]
    return along, across / np.linalg.norm(across)
