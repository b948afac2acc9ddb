"""Nodes of the cable in material coordinates, with every attachment on a node.

Depends on: scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cablesim.scene import MeshRules, Scene


@dataclass(frozen=True)
class Mesh:
    """Material nodes and who sits on them.

    Attributes
    ----------
    nodes : ndarray, shape (n+1,)
        Material coordinate s of each node, from 0 at end A to the deployed length at end B [m].
    attachment_nodes : ndarray of int, shape (number of attachments,)
        Node of each attachment, in the order of the scene.
    """

    nodes: NDArray[np.float64]
    attachment_nodes: NDArray[np.int64]

    @property
    def segments(self) -> int:
        """Number of segments n."""
        return self.nodes.size - 1

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Unstretched segment lengths, shape (n,) [m]."""
        return np.diff(self.nodes)

    @property
    def node_lengths(self) -> NDArray[np.float64]:
        """Half of both neighbouring segments, shape (n+1,) [m]; their sum is the cable's length."""
        halves = 0.5 * self.lengths
        return np.concatenate((halves, [0.0])) + np.concatenate(([0.0], halves))


def build_mesh(scene: Scene) -> Mesh:
    """Mesh of a scene's cable.

    The cable is cut at every attachment and at the borders of every refinement; each piece is
    divided evenly, into segments no longer than asked for there.

    Parameters
    ----------
    scene : Scene
        Cable, attachments and mesh rules.

    Returns
    -------
    Mesh
        Nodes and attachment nodes.
    """
    places = np.array([attachment.position for attachment in scene.attachments])
    cuts = _cuts(scene.cable.length, places, scene.mesh)
    pieces = [
        np.linspace(left, right, _segment_count(left, right, scene.mesh) + 1)[1:]
        for left, right in pairwise(cuts)
    ]
    nodes = np.concatenate(([0.0], *pieces))
    return Mesh(nodes, np.array([int(np.argmin(np.abs(nodes - place))) for place in places], dtype=np.int64))


def _cuts(length: float, places: NDArray[np.float64], rules: MeshRules) -> NDArray[np.float64]:
    """Sorted places where the mesh must have a node; near-equal ones are merged, attachments kept."""
    borders = [p for r in rules.refinements for p in (r.position - r.within, r.position + r.within)]
    needed = np.concatenate(([0.0, length], places))
    near = 1e-3 * min([rules.segment_length, *(r.segment_length for r in rules.refinements)])
    optional = [b for b in borders if 0.0 < b < length and np.min(np.abs(needed - b)) > near]
    cuts = np.unique(np.concatenate((needed, optional)))
    return cuts[np.concatenate(([True], np.diff(cuts) > 1e-12 * length))]


def _segment_count(left: float, right: float, rules: MeshRules) -> int:
    """Segments between two cuts, at the shortest length asked for at the middle."""
    middle = 0.5 * (left + right)
    target = min(
        [rules.segment_length]
        + [r.segment_length for r in rules.refinements if abs(middle - r.position) <= r.within]
    )
    return max(1, int(np.ceil((right - left) / target - 1e-9)))
