"""Boundaries as lines (2D) or triangles (3D), to ask where they meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slideviz.errors import MeshError
from slideviz.mesh.elements import ELEMENTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slideviz.mesh.model import Cells, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Surface:
    """Simplices in the order of the facets that they are part of.

    Attributes
    ----------
    nodes : (s, d) int64
        Two or three nodes each.
    facet : (s,) int64
        The element each is part of: a quadrilateral is two triangles.
    """

    nodes: IntArray
    facet: IntArray

    @classmethod
    def of(cls, cells: Cells, dim: int) -> Surface:
        """Return the simplices of a boundary of a mesh of dimension ``dim``.

        Raises
        ------
        MeshError
            An element has another dimension than a boundary.
        """
        parts, facets = [np.empty((0, dim), np.int64)], [np.empty(0, np.int64)]
        for vtk, (ids, nodes) in cells.by_type.items():
            row = ELEMENTS[vtk]
            if row.dim != dim - 1:
                raise MeshError(
                    f"a boundary of a mesh of dimension {dim} has a {row.name} (dimension "
                    f"{row.dim}); its elements must have dimension {dim - 1}"
                )
            for first in range(1, row.n_nodes - dim + 2):
                parts.append(nodes[:, [0, *range(first, first + dim - 1)]])
                facets.append(ids)
        found, facet = np.concatenate(parts), np.concatenate(facets)
        order = np.argsort(facet, kind="stable")
        return cls(found[order], facet[order])

    def __len__(self) -> int:
        return len(self.nodes)

    def keep(self, wanted: NDArray[np.bool_]) -> Surface:
        """Return the simplices where ``wanted`` (s,) is true."""
        return Surface(self.nodes[wanted], self.facet[wanted])

    def without(self, nodes: IntArray) -> Surface:
        """Return the surface without the facets that have any of ``nodes``."""
        held = self.facet[np.isin(self.nodes, nodes).any(axis=1)]
        return self.keep(~np.isin(self.facet, held)) if len(held) else self

    def within(self, points: FloatArray, other: Surface, margin: float) -> Surface:
        """Return the simplices that the box around ``other`` touches; points are (n, d)."""
        if not len(other):
            return other
        space, corners = points[other.nodes.ravel()], points[self.nodes]
        low, high = space.min(axis=0) - margin, space.max(axis=0) + margin
        meets = (corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)
        return self.keep(meets.all(axis=1))

    @property
    def edges(self) -> IntArray:
        """Return the edges in both directions, sorted, each once: (e, 2)."""
        size = self.nodes.shape[1]
        pairs = [(i, k) for i in range(size) for k in range(size) if i != k]
        return np.unique(self.nodes[:, pairs].reshape(-1, 2), axis=0)
