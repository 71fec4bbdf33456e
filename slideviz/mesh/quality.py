"""Size-skew quality of cells, and how many are inverted (thesis section 2.7; Knupp 2003).

``f_ss = √f_size · f_skew`` (De Boer, Van der Schoot, Bijl 2007), all in 0 to 1, 1 is best.
``f_size`` compares with the undeformed cell: ``min(τ, 1/τ)``, where τ is the sum of the cell's
corner Jacobians over that of the undeformed cell. ``f_skew`` is that of `slideviz.mesh.skew`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import check_types, record
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.check import check_size
from slideviz.mesh.jacobians import (
    CORNERS,
    INVERTED,
    UNPROVEN,
    VALID,
    check_cells,
    coords_of,
    corners,
    decide_unproven,
    measure,
)
from slideviz.mesh.model import (
    NO_NODES,
    BoolArray,
    FloatArray,
    Index,
    IntArray,
    Mesh,
    Signs,
    checked_reference,
    run_begins,
    sealed,
)
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality_derivative import QualityDerivative, derivative_of
from slideviz.mesh.skew import SKEW_METRICS, ordered_sum
from slideviz.terms import SkewMetric

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slideviz.case.limits import LimitResult

__all__ = [
    "INVERTED",
    "UNPROVEN",
    "VALID",
    "Quality",
    "QualityTotals",
    "corner_jacobians",
    "lowest",
    "quality",
    "quality_totals",
]


PIECE = 1 << 22  # values of cells that are summed up at a time, at most
FINE = 10_000
"""Intervals of 0 to 1 in which cells are counted by quality; bars of a histogram join some."""


@record
class QualityTotals:
    """Counts and size-skew qualities of all cells of a mesh, summed up."""

    cells: int
    min: float
    mean: float
    inverted: int
    unproven: int
    fine_counts: IntArray
    """(FINE,) or (0,): the number of cells, without inverted ones, in equal intervals of their
    quality from 0 to 1."""
    worst: IntArray
    """(k,): the numbers of the cells of lowest value, worst first, ties by number."""


def quality_totals(
    values: FloatArray,
    status: NDArray[np.uint8],
    release: Callable[[], object] = lambda: None,
    worst: int = 0,
) -> QualityTotals:
    """Return the totals of the size-skew qualities and statuses (m,) of all cells of a mesh.

    ``release``: called after each piece was read (`PIECE`): arrays in a file may not fit into
    memory.
    ``worst``: the number of worst cells wanted; with 0, they are not counted in fine intervals,
    either.
    """
    least = np.inf
    inverted = 0
    unproven = 0
    counts = np.zeros(FINE if worst else 0, np.int64)

    def add(piece: slice) -> None:
        nonlocal least, inverted, unproven
        some = values[piece]
        states = status[piece]
        bad = states == INVERTED
        least = min(least, float(some.min(initial=np.inf)))
        inverted += int(np.count_nonzero(bad))
        unproven += int(np.count_nonzero(states == UNPROVEN))
        if worst:
            places = np.minimum((some[~bad] * FINE).astype(np.int64), FINE - 1)
            counts[:] += np.bincount(places, minlength=FINE)
        release()

    mean = pairwise_sum(values, add) / max(len(values), 1)
    some = lowest(values, worst, release=release)
    return QualityTotals(len(values), least, mean, inverted, unproven, counts, some)


def pairwise_sum(
    values: FloatArray, visit: Callable[[slice], object], first: int = 0, last: int | None = None
) -> float:
    """Return the sum of ``values[first:last]``, piece by piece, with the bits of ``numpy.sum``.

    Like NumPy, it halves the range recursively; the length of each first half is a multiple of 8.
    ``visit`` is called with the slice of each piece after it was read.
    """
    last = len(values) if last is None else last
    half = (last - first) // 2 // 8 * 8
    if last - first > PIECE:
        middle = first + half
        return pairwise_sum(values, visit, first, middle) + pairwise_sum(
            values, visit, middle, last
        )
    partial_sum = float(values[first:last].sum())
    visit(slice(first, last))
    return partial_sum


def lowest(
    values: FloatArray,
    count: int,
    only: BoolArray | None = None,
    release: Callable[[], object] = lambda: None,
) -> IntArray:
    """Return the indices (k,) of the ``count`` lowest values (m,), ascending, ties by index.

    ``only`` (m,) is a mask of those that count; ``release`` as for `quality_totals`.
    """
    ids = NO_NODES
    for first in range(0, len(values) if count > 0 else 0, PIECE):
        part = values[first : first + PIECE]
        if only is not None:
            part = np.where(only[first : first + PIECE], part, np.inf)
        limit = np.partition(part, count - 1)[count - 1] if len(part) > count else np.inf
        ids = np.concatenate([ids, first + np.flatnonzero(part <= limit)])
        if only is not None:
            ids = ids[only[ids]]
        ids = ids[np.argsort(values[ids], kind="stable")[:count]]
        release()
    return ids


@record
class Quality:
    """Quality of every cell of a mesh, in the order of the cells."""

    values: FloatArray
    """(m,): size-skew, 0 to 1; 0 for an inverted cell, as are its ``size`` and ``skew``."""
    size: FloatArray
    skew: FloatArray
    """`size`, `skew` (m,): the two factors: ``values = √size · skew``."""
    status: NDArray[np.uint8]
    """(m,): ``VALID`` (positive Jacobian in the whole cell, proved), ``INVERTED`` (a point was
    found where it is not positive) or ``UNPROVEN`` (a hexahedron that is neither)."""
    signs: Signs
    """(m,): 1, or -1 for a cell that is numbered the other way round."""
    metric: SkewMetric
    """``knupp``, or ``rbf-slide``: hexahedra with exponent 1 instead of 2/3 in ``f_skew``, as the
    program of the thesis has it, for comparison with its figures."""
    halo: BoolArray | None = None
    """(m,): the cells of the halo. They have values like all others, but are copies: numbers of the
    whole mesh (minimum, mean, counts, histogram, worst cells) leave them out."""
    first: BoolArray | None = None
    """(m,): the first part of each polyhedron, and all other cells; the parts of a polyhedron have
    the values of its lowest one, and count as one cell. None: there are no polyhedra."""
    derivative: QualityDerivative | None = None
    """By the points, if it was asked for; of parts of polyhedra, each by itself."""
    of_mesh: QualityTotals | None = None
    """Those of all cells of the mesh, where the arrays are of a part of them or in a file."""
    limits: tuple[LimitResult, ...] = ()
    """Whether the mesh meets each limit that `slideviz.quality` was asked for."""

    def __len__(self) -> int:
        return len(self.values)

    @property
    def counted(self) -> BoolArray | slice:
        """Return an index (slice or mask) into ``values`` that leaves out `copies`."""
        return slice(None) if self.copies is None else ~self.copies

    @property
    def file_rows(self) -> BoolArray | slice:
        """Return an index into ``values`` that has each cell of the file once."""
        return slice(None) if self.first is None else self.first

    @property
    def copies(self) -> BoolArray | None:
        """Return a mask (m,) of the halo's cells, or of the further parts of polyhedra, or None."""
        return self.halo if self.first is None else ~self.first

    @cached_property
    def totals(self) -> QualityTotals:
        """Return counts, minimum and mean of all cells, without those of the halo."""
        if self.of_mesh is not None:
            return self.of_mesh
        return quality_totals(self.values[self.counted], self.status[self.counted])

    @property
    def cells(self) -> int:
        """Return the number of cells, without those of the halo."""
        return self.totals.cells

    @property
    def min(self) -> float:
        """Return the lowest value."""
        return self.totals.min

    @property
    def mean(self) -> float:
        """Return the arithmetic mean of the values."""
        return self.totals.mean

    @property
    def inverted(self) -> int:
        """Return the number of inverted cells."""
        return self.totals.inverted

    @property
    def unproven(self) -> int:
        """Return the number of cells that are neither proved valid nor found inverted."""
        return self.totals.unproven

    @property
    def valid(self) -> int:
        """Return the number of cells that are proved valid."""
        return self.cells - self.inverted - self.unproven

    def take(self, ids: IntArray) -> Quality:
        """Return the quality of the cells ``ids`` (k,), in that order."""
        halo = None if self.halo is None else self.halo[ids]
        return Quality(
            self.values[ids],
            self.size[ids],
            self.skew[ids],
            self.status[ids],
            self.signs[ids],
            self.metric,
            halo,
        )

    @classmethod
    def joined(cls, parts: Sequence[Quality]) -> Quality:
        """Return the quality of the cells of some parts, one after the other."""
        if len(parts) == 1:
            return parts[0]
        arrays = zip(*(part._arrays for part in parts), strict=True)
        values, size, skew, status, signs = map(np.concatenate, arrays)
        return cls(values, size, skew, status, signs, parts[0].metric)

    @property
    def _arrays(self) -> tuple[NDArray, ...]:
        return self.values, self.size, self.skew, self.status, self.signs

    @check_types
    def worst(self, n: int) -> IntArray:
        """Return the ids of the ``n`` cells of lowest value, worst first, ties by id."""
        return lowest(self.values, n, None if self.copies is None else ~self.copies)

    @check_types
    def inverted_cells(self, n: int | None = None) -> IntArray:
        """Return the ids, ascending, of the (first ``n``) inverted cells, without the halo's."""
        return self.cells_with(INVERTED)[:n]

    def cells_with(self, status: int) -> IntArray:
        """Return the ids, ascending, of the cells with a ``status``, without the halo's."""
        mask = self.status == status
        return np.flatnonzero(mask if self.copies is None else mask & ~self.copies)

    @check_types
    def histogram(self, bins: int = 20) -> tuple[IntArray, FloatArray]:
        """Return the counts (bins,) and the edges (bins + 1,) of equal bins over 0 to 1."""
        counts, edges = np.histogram(self.values[self.counted], bins, range=(0.0, 1.0))
        return counts.astype(np.int64), edges

    def summary(self) -> dict[str, object]:
        """Return the numbers for a report, as plain Python values."""
        numbers: dict[str, object] = {
            "min": self.min,
            "mean": self.mean,
            "inverted": self.inverted,
            "unproven": self.unproven,
            "valid": self.valid,
            "cells": self.cells,
        }
        if self.halo is not None:
            beyond = int(np.count_nonzero(self.status[self.halo] == INVERTED))
            numbers["halo"] = {"cells": len(self) - self.cells, "inverted": beyond}
        return numbers


@check_types
def quality(
    mesh: Mesh,
    reference: Mesh | None = None,
    metric: SkewMetric = "knupp",
    going_on: Callable[[], object] = lambda: None,
    *,
    derivative: bool = False,
    p: float = 50.0,
) -> Quality:
    """Return the quality of each cell, compared with the undeformed mesh.

    Parameters and errors as of `slideviz.quality`, which also checks limits.
    """
    if metric not in SKEW_METRICS:
        raise CaseError(f"quality metric {metric!r} is unknown; use {' or '.join(SKEW_METRICS)}")
    check_cells(mesh)
    check_size(mesh)
    base = mesh if reference is None else checked_reference(reference, mesh).undeformed
    sums, signs = reference_of(base)
    values, size, skew = np.empty((3, len(mesh.cells)))
    status = np.empty(len(mesh.cells), np.uint8)

    def of_part(vtk: int, rows: Index, nodes: IntArray) -> None:
        result = cell_quality(mesh.points, vtk, nodes, signs[rows].copy(), sums[rows], metric)
        size[rows], skew[rows], status[rows] = result
        values[rows] = np.sqrt(result[0]) * result[1]

    mesh.cells.in_parts(of_part, going_on)
    result = Quality(
        values=sealed(values),
        size=sealed(size),
        skew=sealed(skew),
        status=sealed(status),
        signs=signs,
        metric=metric,
        halo=None if mesh.halo is None else mesh.halo.cells,
    )
    if derivative:
        before = None if reference is None else sums
        result = replace(result, derivative=derivative_of(mesh, result, before, p, going_on))
    return result if mesh.whole_cells is None else _of_whole(result, mesh.whole_cells)


def _of_whole(parts: Quality, cell: IntArray) -> Quality:
    """Return the quality in which each cell has that of the lowest part of its polyhedron.

    ``cell`` (m,), ascending: the number of the polyhedron that each is in.
    """
    first = run_begins(cell)
    worst = np.lexsort((parts.values, cell))[first][np.cumsum(first) - 1]
    rank = np.array([VALID, UNPROVEN, INVERTED])  # from the best to the worst, and back
    states = rank[np.maximum.reduceat(rank[parts.status], np.flatnonzero(first))]
    return replace(
        parts,
        values=sealed(parts.values[worst]),
        size=sealed(parts.size[worst]),
        skew=sealed(parts.skew[worst]),
        status=sealed(states[np.cumsum(first) - 1].astype(np.uint8)),
        first=sealed(first),
    )


def cell_quality(
    points: FloatArray,
    vtk: int,
    nodes: IntArray,
    signs: Signs,
    sums: FloatArray,
    metric: SkewMetric,
) -> tuple[FloatArray, FloatArray, NDArray[np.uint8]]:
    """Return size, skew and status (m,) of cells of one type, ``nodes`` (m, n).

    ``sums`` (m,) are the sums of the corner Jacobians of the undeformed cells.
    """
    table = CORNERS[vtk]
    status = np.empty(len(nodes), np.uint8)
    alpha, spread = np.empty((2, len(table), len(nodes)))
    measure(vtk, points, nodes, table, signs, alpha, spread, status)
    open_ = np.flatnonzero(status == UNPROVEN)
    if len(open_):
        status[open_] = decide_unproven(vtk, coords_of(points[nodes[open_]]), signs[open_])
    good = status != INVERTED
    with np.errstate(all="ignore"):
        size = np.where(good, _ratio(ordered_sum(alpha), sums), 0.0)
        # 1 is the bound of every formula; a value above it by rounding would be in no bin.
        skew = np.where(good, np.minimum(SKEW_METRICS[metric][vtk](spread, alpha), 1.0), 0.0)
    return size, skew, status


def corner_jacobians(mesh: Mesh, cell: int, sign: int = 1) -> FloatArray:
    """Return the corner Jacobians (k,) of one cell, in the order of its corners.

    ``cell`` is its index from 0, ``sign`` is ``Quality.signs[cell]``, so that a valid cell has
    positive Jacobians. Raises MeshError if there is no such cell.
    """
    if not 0 <= cell < len(mesh.cells):
        raise MeshError(f"no cell {cell}; {mesh.name} has the cells 0 to {len(mesh.cells) - 1}")
    begin, end = mesh.cells.offsets[cell : cell + 2]
    table = CORNERS[int(mesh.cells.types[cell])]
    alpha = np.empty((len(table), 1))
    corners(coords_of(mesh.points[mesh.cells.connectivity[None, begin:end]]), table, 1, alpha)
    return sign * alpha[:, 0]


def _ratio(now: FloatArray, before: FloatArray) -> FloatArray:
    """Return ``min(τ, 1/τ)`` with τ = now / before, and 0 unless both are positive, (m,)."""
    sound = (now > 0) & (before > 0)
    return np.where(sound, np.minimum(now, before) / np.maximum(now, before), 0.0)
