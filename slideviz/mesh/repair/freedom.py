"""Freedom of nodes: in which directions a repair may move each, and which move as one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray, sealed

Project = Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Takes nodes (k,) that slide on curved boundaries, with all images and copies of each, and
their points (k, d). Returns the points on the boundary (k, d), images where they belong, and
the maps T (k, d, d) there."""


@record
class Freedom:
    """Which nodes may move, and how: ``x_i = x_i⁰ + T_i q_b``, q_b the unknowns of its block.

    The displacement q_b (d,) of a block is common to a node, its periodic images and its copies in
    a halo. T_i is R_i P: P projects on the directions in which the node may move (all for a node
    of the interior; the tangents of its surface, or its edge, for one that slides), R_i turns
    to the image (I for the node itself). These are ``place`` and ``turn`` of
    `slideviz.elastic.stiffness.Conditions`, too.
    """

    place: IntArray
    """(n,): the block of each node, from 0; -1 for a node that is held (moving, fixed)."""
    bound: IntArray  # (m,): the nodes of blocks whose map is not the identity
    maps: FloatArray  # (m, d, d): their maps T_i
    curved: IntArray  # (s,): the nodes that slide on a boundary that may be curved
    project: Project | None = None
    """Puts them back after each outer round; None if no boundary is curved."""

    @classmethod
    def within(cls, dim: int, held: BoolArray) -> Freedom:
        """Return the freedom of nodes that move anywhere, but for those of the mask held (n,)."""
        place = np.where(held, -1, np.cumsum(~held) - 1)
        none = NO_NODES
        return cls(sealed(place), none, np.empty((0, dim, dim)), none)

    def of_part(self, nodes: IntArray) -> Freedom:
        """Return the freedom of some nodes (k,), in that order, as of a mesh of its own.

        Blocks keep their numbers. `project` of the whole gets the numbers of the whole.
        """
        bound = np.isin(self.bound, nodes)
        whole = self.project

        def project(some: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
            assert whole is not None
            return whole(nodes[some], points)

        return Freedom(
            sealed(self.place[nodes]),
            places(nodes, self.bound[bound]),
            self.maps[bound],
            places(nodes, self.curved[np.isin(self.curved, nodes)]),
            None if whole is None else project,
        )

    def embedded(self, places: IntArray, count: int) -> Freedom:
        """Return the freedom of ``count`` nodes, of which these are at ``places`` (n,), ascending.

        All others move anywhere.
        """
        place = self.place.max(initial=-1) + 1 + np.arange(count)
        place[places] = self.place
        whole = self.project

        def project(some: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
            assert whole is not None
            return whole(np.searchsorted(places, some), points)

        bound = places[self.bound]
        curved = places[self.curved]
        return Freedom(sealed(place), bound, self.maps, curved, None if whole is None else project)

    def without(self, held: IntArray) -> Freedom:
        """Return the freedom in which some nodes (h,) and their images are held, too."""
        blocks = self.place[held]
        place = np.where(np.isin(self.place, blocks[blocks >= 0]), -1, self.place)
        return replace(self, place=sealed(place))

    def only(self, moves: BoolArray) -> Freedom:
        """Return the freedom in which the nodes of the mask (n,) move alone; blocks from 0."""
        _, first, block = np.unique(self.place[moves], return_index=True, return_inverse=True)
        every = np.full(len(moves), -1)
        every[moves] = np.argsort(np.argsort(first))[block]
        bound = moves[self.bound]
        return Freedom(
            sealed(every),
            self.bound[bound],
            self.maps[bound],
            self.curved[moves[self.curved]],
            self.project,
        )


def places(nodes: IntArray, some: IntArray) -> IntArray:
    """Return where ``some`` of the nodes (k,), which may be in any order, are among these."""
    order = np.argsort(nodes)
    return order[np.searchsorted(nodes, some, sorter=order)]
