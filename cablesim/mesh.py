"""Nodes of the cable in material coordinates, with every attachment on a node.

Depends on: scene.

The mesh of the whole cable is fixed in material coordinates, also of what is on the drum of a winch.
The winch only reveals nodes: `Mesh.deployed` is the part between end A and the winch.  Its last
segment, from the last free node to the winch, has any length between SHORTEST and 1 + LONGEST_BEYOND
of a segment.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cablesim.scene import MeshRules, Scene

SHORTEST = 0.4
"""A free node goes on the drum when so much of its segment is left between it and the winch."""

LONGEST_BEYOND = 0.6
"""The next node appears when so much of the segment beyond it is out.

More than `SHORTEST`: a winch that turns back right after an insertion must go back by a fifth of a
segment before the node is taken away again.
"""

FEWEST = 2
"""Segments that stay deployed: an insertion looks at the joint before the winch's segment."""

ON_DRUM = -1


@dataclass(frozen=True)
class Mesh:
    """Material nodes and who sits on them.

    Attributes
    ----------
    nodes : ndarray, shape (n+1,)
        Material coordinate s of each node, from 0 at end A to end B, or to the end on the drum [m].
    attachment_nodes : ndarray of int, shape (number of attachments,)
        Node of each attachment, in the order of the scene; `ON_DRUM` for one that is not deployed.
    last_reference : float or None
        Length of the material segment of which the last one is the part that is out [m].
    """

    nodes: NDArray[np.float64]
    attachment_nodes: NDArray[np.int64]
    last_reference: float | None = None

    @property
    def segments(self) -> int:
        """Number of segments n."""
        return self.nodes.size - 1

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Unstretched segment lengths, shape (n,) [m]."""
        return np.diff(self.nodes)

    @property
    def reference_lengths(self) -> NDArray[np.float64]:
        """The lengths, but for the last one that of its material segment, shape (n,) [m]."""
        lengths = self.lengths
        return lengths if self.last_reference is None else np.append(lengths[:-1], self.last_reference)

    @property
    def node_lengths(self) -> NDArray[np.float64]:
        """Half of both neighbouring segments, shape (n+1,) [m]; their sum is the cable's length."""
        halves = 0.5 * self.lengths
        return np.concatenate((halves, [0.0])) + np.concatenate(([0.0], halves))

    def in_water(self) -> Iterator[tuple[int, int]]:
        """Index of each deployed attachment, and its node."""
        for attachment, node in enumerate(self.attachment_nodes):
            if node != ON_DRUM:
                yield attachment, int(node)

    # The winch, for the mesh of a whole cable of which `segments` segments are deployed -----------

    def deployed(self, segments: int, length: float) -> Mesh:
        """The part between end A and a winch that has paid out `length` [m], cut into `segments`."""
        there = self.attachment_nodes < segments
        return Mesh(
            np.append(self.nodes[:segments], length),
            np.where(there, self.attachment_nodes, ON_DRUM),
            float(self.lengths[segments - 1]),
        )

    def segments_at(self, length: float) -> int:
        """Segments of a deployed length [m] with which a run starts: as many as may be."""
        shortest = self.nodes[:-1] + SHORTEST * self.lengths * (1.0 + 1e-9)
        return max(FEWEST, int(np.searchsorted(shortest, length, side="left")))

    def insertion_length(self, segments: int) -> float | None:
        """Deployed length [m] at which the next node appears; ``None``: none is left on the drum."""
        if segments >= self.segments:
            return None
        return float(self.nodes[segments] + LONGEST_BEYOND * self.lengths[segments])

    def removal_length(self, segments: int) -> float:
        """Deployed length [m] at which the last free node goes on the drum."""
        return float(self.nodes[segments - 1] + SHORTEST * self.lengths[segments - 1])

    def carries_attachment(self, node: int) -> bool:
        """Whether a node may not go on the drum."""
        return bool((self.attachment_nodes == node).any())


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
