"""The one pull that, added to those of all segments, makes their chords reach a place.

Depends on: nothing of ours.

A segment that is pulled with p spans l (1 + f |p|) p/|p|, f its flexibility 1/EA.  The vector x that is to be
added to every pull is the minimum of the complementary energy

    sum l (|p + x| + f |p + x|^2 / 2) - x . target,

which is convex: there is one answer, and Newton's method finds it from anywhere.  As the same x is added to
all, what the pulls of neighbouring segments differ by, the load on the node between them, stays what it was.
With true pulls and their flexibility the answer is the discrete elastic catenary; with unit directions and
without flexibility it is the least turning with which segments of given lengths reach the target.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ITERATIONS = 200
OVERSHOOT = 0.5  # slope along a step, over that at its start, from which on it went too far
GAP = 1e-13  # of the chords from the target, over the length


def unit(vectors: Array) -> Array:
    """The directions (n, D) of vectors (n, D)."""
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def reaching_pulls(pulls: Array, lengths: Array, target: Array, flexibility: float = 0.0) -> Array:
    """Pulls that differ from the given ones by the same vector, with chords that reach the target.

    Parameters
    ----------
    pulls : ndarray, shape (n, D)
        Pull on each segment, from A to B; its unit does not matter where there is no flexibility [N].
    lengths : ndarray, shape (n,)
        Unstretched lengths [m].
    target : ndarray, shape (D,)
        What the chords are to add up to [m].
    flexibility : float
        Strain per newton, 1/EA [1/N]; with 0 the target must be nearer than the cable is long.

    Returns
    -------
    ndarray, shape (n, D)
        The best that was found; how well it reaches the target is for the caller to see.
    """
    identity, added = np.eye(target.size), np.zeros(target.size)

    def gap_of(added: Array) -> Array:
        pull = pulls + added
        size = np.maximum(np.linalg.norm(pull, axis=1), 1e-300)
        return target - (lengths * (1.0 / size + flexibility)) @ pull

    gap = gap_of(added)
    for _ in range(ITERATIONS):
        if np.linalg.norm(gap) <= GAP * lengths.sum():
            break
        pull = pulls + added
        size = np.maximum(np.linalg.norm(pull, axis=1), 1e-300)
        along = pull * np.sqrt(lengths / size**3)[:, None]
        hessian = ((lengths / size).sum() + flexibility * lengths.sum()) * identity - along.T @ along
        step = np.linalg.lstsq(hessian, gap, rcond=None)[0]
        while gap_of(added + step) @ step < -OVERSHOOT * (gap @ step):
            step = 0.5 * step
        if np.linalg.norm(step) <= 1e-16 * np.linalg.norm(added):
            break
        added = added + step
        gap = gap_of(added)
    return pulls + added
