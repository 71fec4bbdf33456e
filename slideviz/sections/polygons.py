"""Polygons that belong to cells of a mesh, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, Mesh, offsets_of, ranges
from slideviz.mesh.polyhedra import whole_polygons
from slideviz.mesh.topology import single_edges
from slideviz.terms import Range

ONLY_INVERTED = (-1.0, -0.5)
"""The threshold for inverted cells alone: a range from below 0, which no value is in."""


@frozen
class CellsInRange:
    """The cells of a mesh within a threshold; instances with the same cells are equal."""

    key: bytes  # the mask, packed to bits, for comparing and hashing
    mask: BoolArray = field(compare=False, repr=False)  # (m,): whether each cell is within
    words: str = field(compare=False)  # the range in words

    @classmethod
    def of(cls, values: FloatArray, threshold: Range) -> CellsInRange:
        """Return the cells whose value is in a range (see `cells_in_range`)."""
        mask = np.zeros(len(values), bool)
        mask[cells_in_range(values, threshold)] = True
        mask.flags.writeable = False
        return cls(np.packbits(mask).tobytes(), mask, range_words(threshold))

    def among(self, polygons: Polygons) -> Polygons:
        """Return the polygons whose cells are in the range; all points stay."""
        return polygons.take(np.flatnonzero(self.mask[polygons.cells]))


def cells_in_range(values: FloatArray, threshold: Range) -> IntArray:
    """Return the ascending numbers of the cells whose value is in a closed range.

    ``values`` (m,): nan for an inverted cell, as ``StepFrame.shown_values`` has them. Inverted
    cells are in, too, where the lowest value of the range is 0 or below.
    """
    low, high = threshold
    inside = (values >= low) & (values <= high)
    return np.flatnonzero(inside | np.isnan(values) if low <= 0.0 else inside)


def range_words(threshold: Range) -> str:
    """Return a threshold in words."""
    if threshold[1] < 0.0:
        return "inverted cells"
    return f"{threshold[0]:.3g} to {threshold[1]:.3g}"


@record
class Polygons:
    """Polygons, or lines where the mesh is 2D, each with the cell it belongs to."""

    points: FloatArray  # (p, 3): the corners of all polygons
    offsets: IntArray  # (q + 1,): polygon i has the corners connectivity[offsets[i]:offsets[i + 1]]
    connectivity: IntArray  # (k,): indices into points
    cells: IntArray  # (q,): the cell of the mesh that each polygon is a part of

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def sizes(self) -> IntArray:
        """Return the number of corners of each polygon, (q,)."""
        return np.diff(self.offsets)

    @property
    def cell_ids(self) -> IntArray:
        """Return the numbers of the cells that have polygons, sorted, each once."""
        return np.unique(self.cells)

    def with_points(self, points: FloatArray) -> Polygons:
        """Return the same polygons at other points, (p, 3)."""
        return replace(self, points=points)

    def of_file_cells(self, mesh: Mesh, *, sides: bool) -> Polygons:
        """Return the polygons as those of the cells of the mesh's file (see `whole_polygons`)."""
        if mesh.whole_cells is None:
            return self
        polygons = self.offsets, self.connectivity, self.cells
        offsets, corners, kept = whole_polygons(mesh, *polygons, sides=sides)
        return Polygons(self.points, offsets, corners, mesh.first_parts(self.cells[kept]))

    def take(self, order: IntArray) -> Polygons:
        """Return the polygons with the numbers ``order`` (t,), in that order; all points stay."""
        sizes = self.sizes[order]
        corners = self.connectivity[ranges(self.offsets[order], sizes)]
        return Polygons(self.points, offsets_of(sizes), corners, self.cells[order])

    def outline(self) -> Polygons:
        """Return the lines, of two corners, that only one polygon has: around all of them."""
        start = self.connectivity
        after = np.roll(self.connectivity, -1)
        after[self.offsets[1:] - 1] = start[self.offsets[:-1]]
        edges = np.column_stack([start, after])
        lines = np.flatnonzero(single_edges(edges))
        cells = np.repeat(self.cells, self.sizes)[lines]
        return Polygons(
            self.points, offsets_of(np.full(len(lines), 2)), edges[lines].ravel(), cells
        )

    def with_last(self, chosen: BoolArray) -> Polygons:
        """Return all polygons, those of the mask ``chosen`` (q,) last: they are drawn on top."""
        return self.take(np.argsort(chosen, kind="stable")) if chosen.any() else self

    def by_depth(self) -> Polygons:
        """Return all polygons by the mean z of their corners, ascending: the nearest is last."""
        depth = np.add.reduceat(self.points[self.connectivity, 2], self.offsets[:-1]) / self.sizes
        return self.take(np.argsort(depth, kind="stable"))


def joined(pieces: Sequence[Polygons]) -> Polygons:
    """Return several sets of polygons as one; coinciding points are not merged."""
    starts = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    corners = [piece.connectivity + start for piece, start in zip(pieces, starts, strict=False)]
    return Polygons(
        np.concatenate([piece.points for piece in pieces]),
        offsets_of(np.concatenate([piece.sizes for piece in pieces])),
        np.concatenate(corners),
        np.concatenate([piece.cells for piece in pieces]),
    )
