"""The preconditioner of elastic bodies: one multigrid cycle of a Laplacian for each component.

With the gradient of each component weighted by the cell's stiffness, the Laplacian of a mesh is
equivalent to its elasticity (Korn's inequality), does not care how cells are turned, and has one
number where elasticity has d by d. In relaxation it depends on the undeformed mesh and on which
nodes move together only, so one hierarchy serves all steps, runs and designs of a mesh.

Nodes are coupled along edges alone: what couples others is small or, in skewed cells, is left out
of the diagonals, too. Levels are made by smoothed aggregation (Vanek, Mandel and Brezina 1996) of
strong couplings, those across layers first, since the smoother ends only those errors. Components
that are held at different nodes share aggregates and the finest matrix, and have numbers of their
own, side by side, in all others. Rows are smoothed in parts of fixed size, side by side. What
couples a row to other parts is added to its diagonal, so that the sweep converges whatever the
parts are (Baker, Falgout, Kolev and Yang 2011, Multigrid smoothers for ultraparallel computing,
section 5), with the same bits for any number of threads. Matrices are stored in single precision,
and vectors in double: the cycle is a symmetric matrix to rounding, as derivatives need it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
from numba import prange
from pyamg.aggregation import standard_aggregation
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse import csr_array

from slideviz.argument_types import record
from slideviz.elastic.distortion import write_couplings
from slideviz.elastic.stiffness import by_node
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.jacobians import CORNERS, add3, row3
from slideviz.mesh.model import FloatArray, IntArray, offsets_of
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.solve import enough_threads
from slideviz.rbf.tape import transform, value
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

COARSE = 300  # largest number of unknowns of the coarsest level, which has a dense factor

RIDGE = 1e-12
"""Added to the diagonal of the coarsest matrix, relative to it. A mesh that may slide as a whole
makes the matrix singular; its right-hand side is consistent then."""

HELD = 1e60  # on the diagonal of the coarsest matrix, in rows of nothing

PART = 16384  # rows that are smoothed one after the other

SPARE = 0.5
"""What couples a row to other parts may be this part of its diagonal before that grows by half of
the rest: with D the diagonal and O these couplings, the sweep converges where D + 2 growth - O is
positive definite."""

CHUNKS = 16  # into how many parts long matrices are cut while they are made

WEAK_FINEST = 0.25
WEAK = 0.1
"""Entries of the finest matrix, and of others, that are weak: below this part of the geometric mean
of the largest ones of both nodes. These share no aggregates then: in layers, which are columns."""

OMEGA = 4.0 / 3.0  # damping of the Jacobi step that smooths prolongations, by row sums


Sparse = tuple[np.ndarray, np.ndarray, np.ndarray]
"""indptr, indices and data (k, w) of a sparse matrix; w = 1, or a number for each group of
components."""


def _numbers(edges: Sequence[Sequence[int]]) -> IntArray:
    """Return the number (8, 8) of the edge between two nodes of a cell; -1: there is none."""
    out = np.full((8, 8), -1)
    for number, (i, j) in enumerate(edges):
        out[i, j] = out[j, i] = number
    return out


EDGES = {vtk: _numbers(row.edges) for vtk, row in ELEMENTS.items()}


class CellPart(Protocol):
    """Cells of one type."""

    @property
    def vtk(self) -> int:
        """Return the VTK identifier of the type."""

    @property
    def nodes(self) -> IntArray:
        """Return the nodes (m, n) of the cells."""


class ElasticBody(Protocol):
    """What a Laplacian is made of."""

    @property
    def points(self) -> FloatArray:
        """Return the points (n, d) where the body has no stresses."""

    @property
    def parts(self) -> Sequence[CellPart]:
        """Return the cells of each type."""

    @property
    def weights(self) -> FloatArray:
        """Return what the gradients in each cell are multiplied by, (m,), in the parts' order."""


@record
class LaplacianLevel:
    """A level of the hierarchy."""

    matrix: Sparse
    middle: np.ndarray
    """(k,): in each row, the place of its first entry that is not left of the diagonal."""
    inverse: FloatArray
    """(k, w): of the diagonal, with what couples a row to other parts added; zero in rows that are
    held."""
    up: Sparse
    down: Sparse  # `up`, `down`: prolongation from the next coarser level, and restriction to it


@record
class LaplacianCycle:
    """One V-cycle for the Laplacian of each component: a symmetric, positive definite map."""

    levels: tuple[LaplacianLevel, ...]  # finest first, without the coarsest
    factors: tuple[Any, ...]
    """Dense Cholesky factors of the coarsest level, of each group of components."""
    group: IntArray  # (3,): the group of each component: those that are held at the same nodes
    axes: FloatArray
    """(k, d, d) or (d, d): rows are the axes of the components; Cartesian ones if (d, d)."""

    @classmethod
    def of(
        cls,
        body: ElasticBody,
        place: IntArray,
        held: np.ndarray,
        axes: FloatArray,
        stiffness: FloatArray | None = None,
    ) -> LaplacianCycle:
        """Return the cycle of an elastic body, or of other curvatures of it.

        ``place`` (n,) is the number of each node's unknown, -1 for known nodes.
        ``held`` (k, d): which components of the unknowns stay zero. Rows of ``axes`` (k, d, d) or
        (d, d) are the axes of these components: orthonormal, (d, d) for Cartesian ones.
        ``stiffness`` (m, d, d, d): curvatures of each component in each cell; written over.
        """
        names: list[object] = [column.tobytes() for column in held.T]
        weights: list[FloatArray | None] = [None]
        if stiffness is not None:
            if axes.ndim == 3:
                stiffness[:] = stiffness.mean(axis=1, keepdims=True)
            names = list(range(held.shape[1]))
            weights = [stiffness[:, component] for component in range(held.shape[1])]
        each = [laplacian(body, place, len(held), weight) for weight in weights]
        matrix = *each[0][:2], np.concatenate([data for *_, data in each], axis=1)
        columns = dict(zip(names, held.T, strict=True))  # each once
        group = [list(columns).index(name) for name in names]
        free = ~np.stack(list(columns.values()), axis=1)
        levels, factors = _hierarchy(matrix, free.astype(float))
        # A plane has a third component, which is zero.
        return cls(levels, factors, np.array([*group, 0][:3]), axes)

    def __call__(self, right: FloatArray) -> FloatArray:
        """Return what one V-cycle makes of a right-hand side (k, d)."""
        turned = self.axes.ndim == 3
        d = right.shape[1]
        wide = np.zeros((len(right), 3))
        wide[:, :d] = value(transform(self.axes, right)) if turned else right
        out = self._cycle(wide, 0)[:, :d]
        return value(transform(np.swapaxes(self.axes, 1, 2), out)) if turned else out

    def _cycle(self, right: FloatArray, depth: int) -> FloatArray:
        """Return what one V-cycle from a level on makes of a right-hand side (k, 3)."""
        out = np.empty_like(right)
        if depth == len(self.levels):
            for g, factor in enumerate(self.factors):
                mine = self.group == g
                with enough_threads(0.0):  # the same bits for any number of threads
                    out[:, mine] = cho_solve(factor, right[:, mine], check_finite=False)
            return out
        level = self.levels[depth]
        x = np.empty_like(right)
        group = tuple(self.group.tolist())
        with one_at_a_time(3 * len(level.matrix[1])):
            forward(level.matrix, level.middle, level.inverse, group, right, x, out)
            residual(level.matrix, level.middle, group, x, out)
        coarse = np.zeros((len(level.down[0]) - 1, 3))
        with one_at_a_time(3 * len(level.down[1])):
            add_product(level.down, group, out, coarse)
        coarse = self._cycle(coarse, depth + 1)
        with one_at_a_time(3 * len(level.matrix[1])):
            add_product(level.up, group, coarse, x)
            backward(level.matrix, level.inverse, group, right, x, out)
        return out


def _hierarchy(
    matrix: Sparse, free: FloatArray
) -> tuple[tuple[LaplacianLevel, ...], tuple[Any, ...]]:
    """Return the levels of a matrix in double precision, and the factors of the coarsest one.

    ``free`` (k, w): 1 in the rows of each group that are not held, 0 in others.
    """
    levels: list[LaplacianLevel] = []
    modes = free
    while len(modes) > COARSE:
        strong = _strong(matrix, WEAK if levels else WEAK_FINEST)
        up, modes_below = _prolongation(strong, modes)
        count = len(modes_below)
        down = _rearranged(up, lambda each: each.T.tocsr(), count)
        below = _product(down, _product(matrix, up, count), count)
        below = _rearranged(below, lambda each: each.sorted_indices(), count)
        levels.append(_level(matrix, modes > 0.0, up, down))
        matrix = below
        modes = modes_below
    factors = []
    for g in range(modes.shape[1]):
        dense = _of_group(matrix, g).toarray() * np.outer(modes[:, g] > 0.0, modes[:, g] > 0.0)
        factors.append(_factor(dense))
    return tuple(levels), tuple(factors)


def _factor(dense: FloatArray) -> Any:
    """Return the Cholesky factor of a symmetric matrix (k, k), semidefinite but for rounding.

    A mesh that may move as a whole makes it singular, and the sums of much larger numbers, of which
    it is made, indefinite: its diagonal grows until it is definite. Rows of nothing are held.
    """
    diagonal = np.diag(dense)
    ridge = RIDGE
    while True:
        shifted = dense + np.diag(np.where(diagonal > 0, ridge * diagonal, HELD))
        try:
            with enough_threads(0.0):
                return cho_factor(shifted, lower=True, check_finite=False)
        except LinAlgError:
            if ridge > len(dense):  # definite by now, unless a number is not finite
                raise
            ridge *= 100.0


def _strong(matrix: Sparse, weak: float) -> Sparse:
    """Return a matrix without its weak entries, which are added to the diagonal."""
    indptr = np.zeros_like(matrix[0])
    indices = np.empty_like(matrix[1])
    data = np.empty_like(matrix[2])
    stop = write_strong(matrix, weak, indptr, indices, data)
    return indptr, indices[:stop], data[:stop]


def _prolongation(matrix: Sparse, modes: FloatArray) -> tuple[Sparse, FloatArray]:
    """Return the prolongation to the rows of a matrix, and the modes (l, w) of the coarser level.

    ``matrix``: of strong entries.
    ``modes`` (k, w) of each group are those that it keeps: nearly constant, zero in held rows.
    """
    aggregates = standard_aggregation(_of_group(matrix, 0))[0].tocsr()
    below = np.sqrt(aggregates.T @ modes**2)
    owned = np.flatnonzero(np.diff(aggregates.indptr))
    tentative = np.zeros_like(modes)
    tentative[owned] = modes[owned] / np.maximum(below[aggregates.indices], 1e-300)
    plain = aggregates.indptr, aggregates.indices, tentative[owned]
    up = _product(matrix, plain, len(below))
    free = modes > 0.0
    size = np.empty_like(modes)
    absolute_sums(matrix, free, size)
    scale = np.divide(OMEGA, size, out=np.zeros_like(modes), where=free & (size > 0.0))
    owner = np.full(len(modes), -1)
    owner[owned] = aggregates.indices
    smooth(up, scale, owner, tentative)
    return up, below


def _of_group(matrix: Sparse, group: int) -> csr_array:
    """Return the square matrix of a group of components."""
    indptr, indices, data = matrix
    column = data[:, min(group, data.shape[1] - 1)]
    return csr_array((column, indices, indptr), shape=(len(indptr) - 1,) * 2)


def _rearranged(matrix: Sparse, change: Callable[[csr_array], csr_array], columns: int) -> Sparse:
    """Return a matrix whose entries ``change`` puts into another order."""
    indptr, indices, data = matrix
    shape = len(indptr) - 1, columns
    changed = change(csr_array((np.arange(len(indices)), indices, indptr), shape=shape))
    return changed.indptr, changed.indices, data[changed.data]


def _product(one: Sparse, two: Sparse, columns: int) -> Sparse:
    """Return the product of two matrices for each group; ``two`` has ``columns`` columns."""
    indptr = np.zeros(len(one[0]), np.int32)
    nothing = np.empty(0, np.int32), np.empty((0, two[2].shape[1]))
    with one_at_a_time(len(one[1]) * 10):
        add_rows(one, two, columns, indptr, *nothing)
        np.cumsum(indptr, out=indptr)
        indices = np.empty(indptr[-1], np.int32)
        data = np.empty((indptr[-1], two[2].shape[1]))
        add_rows(one, two, columns, indptr, indices, data)
    return indptr, indices, data


def held_components(axes: FloatArray, free: FloatArray) -> np.ndarray:
    """Return which components (k, d), along ``axes`` (d, d) or (k, d, d), stay zero.

    ``free`` (k, d, d): the projections on the directions in which the unknowns may move. As many
    stay zero as are not free, those along which an unknown moves least.
    """
    along = np.einsum("kii->ki", axes @ free @ np.swapaxes(axes, -1, -2))
    count = np.rint(along.sum(axis=1)).astype(int)
    rank = np.argsort(np.argsort(-along, axis=1, kind="stable"), axis=1, kind="stable")
    return np.asarray(rank >= count[:, None])


def laplacian(
    body: ElasticBody, place: IntArray, count: int, weight: FloatArray | None = None
) -> Sparse:
    """Return the matrix (count, count) of the Laplacian; ``place`` as of `LaplacianCycle.of`.

    ``weight`` (m, d, d): what the gradients in each cell are multiplied by; None: the body's.

    Rows have entries for the unknowns with which they share an edge. The diagonal is less the sum
    of the others and of those of known nodes: entries are rounded to single precision, but
    constants still have no energy.
    """
    cells = np.array([len(part.nodes) for part in body.parts])
    nodes = np.array([part.nodes.shape[1] for part in body.parts])
    tables = np.stack([EDGES[part.vtk] for part in body.parts])
    edges = tables.max(axis=(1, 2)) + 1
    ends = np.cumsum(cells)
    stops = np.cumsum(cells * edges)
    couplings = np.empty(stops[-1], np.float32)
    given = body.weights if weight is None else weight
    for part, table, end, stop in zip(body.parts, tables, ends, stops, strict=True):
        m = len(part.nodes)
        e = int(table.max()) + 1
        out = couplings[stop - m * e : stop].reshape(m, e)
        in_parts(partial(_write_part, body.points, part, table, given[end - m : end], out), m)
    corners = np.concatenate([place[part.nodes].ravel() for part in body.parts]).astype(np.int32)
    begins = offsets_of(np.repeat(nodes, cells)).astype(np.int32)
    starts, order = by_node(corners + 1, count + 1)
    cell = np.repeat(np.arange(ends[-1], dtype=np.int32), np.repeat(nodes, cells))
    graph = starts[1:], cell[order], begins, corners
    most = 1 + int(np.diff(starts[1:]).max()) * len(tables[0])
    kinds = ends, edges, stops, tables, most
    indptr = np.zeros(count + 1, np.int32)
    with one_at_a_time(len(corners) * 10):
        assemble(graph, kinds, couplings, indptr, np.empty(0, np.int32), np.empty((0, 1)))
        np.cumsum(indptr, out=indptr)
        indices = np.empty(indptr[-1], np.int32)
        data = np.empty((indptr[-1], 1))
        assemble(graph, kinds, couplings, indptr, indices, data)
    return indptr, indices, data


def _write_part(
    points: FloatArray,
    part: CellPart,
    table: IntArray,
    weight: FloatArray,
    out: np.ndarray,
    rows: slice,
) -> None:
    own = weight[rows]
    if own.ndim == 1:
        own = own[:, None, None] * np.eye(points.shape[1])
    own = np.ascontiguousarray(own)
    write_couplings(points, part.nodes[rows], CORNERS[part.vtk], table, own, out[rows])


def _level(matrix: Sparse, free: np.ndarray, up: Sparse, down: Sparse) -> LaplacianLevel:
    middle = np.empty(len(free), np.int32)
    inverse = np.empty(free.shape)
    diagonals(matrix, free, middle, inverse)
    return LaplacianLevel(_single(matrix), middle, inverse, _single(up), _single(down))


def _single(matrix: Sparse) -> Sparse:
    return matrix[0], matrix[1], matrix[2].astype(np.float32)


@njit(parallel=True)
def assemble(graph, kinds, couplings, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Write the rows of the Laplacian, sorted; where ``indices`` is empty, count their entries.

    The number of a row's entries goes to indptr[row + 1]. ``graph``: the cells of each unknown
    (indptr, indices), and the unknowns of each cell (indptr, indices), -1 of known nodes.
    ``kinds``: of each part the cells and the couplings up to its end, its edges, and their numbers
    by nodes; and the largest number of entries of a row.
    """
    starts, cells, begins, corners = graph
    ends, edges, stops, tables, most = kinds
    rows = len(indptr) - 1
    chunk = max(PART, rows // CHUNKS + 1)
    for part in prange((rows + chunk - 1) // chunk):
        found = np.empty(most, np.int32)
        sums = np.empty(most)
        for row in range(part * chunk, min(rows, (part + 1) * chunk)):
            count = 1
            found[0] = row
            sums[0] = 0.0
            for k in range(starts[row], starts[row + 1]):
                cell = cells[k]
                if k > starts[row] and cell == cells[k - 1]:
                    continue  # with an image of itself
                p = 0
                while cell >= ends[p]:
                    p += 1
                first = stops[p] - (ends[p] - cell) * edges[p]
                begin = begins[cell]
                size = begins[cell + 1] - begin
                for i in range(size):
                    if corners[begin + i] != row:
                        continue
                    for j in range(size):
                        column = corners[begin + j]
                        edge = tables[p, i, j]
                        if edge < 0 or column == row:
                            continue
                        coupling = np.float64(couplings[first + edge])
                        sums[0] += coupling
                        if column < 0:
                            continue
                        at = 1
                        while at < count and found[at] != column:
                            at += 1
                        if at == count:
                            found[at] = column
                            sums[at] = 0.0
                            count += 1
                        sums[at] -= coupling
            if len(indices) == 0:
                indptr[row + 1] = count
                continue
            base = indptr[row]
            for k in range(count):
                at = base + k
                while at > base and indices[at - 1] > found[k]:
                    indices[at] = indices[at - 1]
                    data[at, 0] = data[at - 1, 0]
                    at -= 1
                indices[at] = found[k]
                data[at, 0] = sums[k]


@njit(parallel=True)
def add_rows(one, two, columns, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Write the product of two sparse matrices; where ``indices`` is empty, count its entries.

    As `assemble` does. ``two`` has ``columns`` columns; ``one`` may have one number for all groups.
    """
    rows = len(indptr) - 1
    top = one[2].shape[1] - 1
    width = two[2].shape[1]
    chunk = max(PART, rows // CHUNKS + 1)
    for part in prange((rows + chunk - 1) // chunk):
        place = np.full(columns, -1)
        stop = np.int64(indptr[part * chunk]) if len(indices) else np.int64(0)
        for row in range(part * chunk, min(rows, (part + 1) * chunk)):
            base = stop
            for k in range(one[0][row], one[0][row + 1]):
                j = one[1][k]
                for m in range(two[0][j], two[0][j + 1]):
                    column = two[1][m]
                    if place[column] < base:
                        place[column] = stop
                        if len(indices):
                            indices[stop] = column
                            data[stop] = 0.0
                        stop += 1
                    if len(indices):
                        for g in range(width):
                            data[place[column], g] += one[2][k, min(g, top)] * two[2][m, g]
            if len(indices) == 0:
                indptr[row + 1] = stop - base


@njit
def write_strong(matrix, weak, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Write a matrix as `_strong` returns it, from the begin of arrays; return their length."""
    before, columns, entries = matrix
    sizes = np.zeros(len(columns))
    own = np.zeros(len(indptr) - 1)
    for row in range(len(own)):
        for k in range(before[row], before[row + 1]):
            for g in range(entries.shape[1]):
                sizes[k] += abs(entries[k, g])
            if columns[k] != row:
                own[row] = max(own[row], sizes[k])
    stop = 0
    for row in range(len(own)):
        middle = stop
        for k in range(before[row], before[row + 1]):
            j = columns[k]
            if j == row:
                middle = stop
            if j == row or sizes[k] >= weak * np.sqrt(own[row] * own[j]):
                indices[stop] = j
                for g in range(entries.shape[1]):
                    data[stop, g] = entries[k, g]
                stop += 1
        for k in range(before[row], before[row + 1]):
            j = columns[k]
            if j != row and not sizes[k] >= weak * np.sqrt(own[row] * own[j]):
                for g in range(entries.shape[1]):
                    data[middle, g] += entries[k, g]
        indptr[row + 1] = stop
    return stop


@njit
def smooth(up, scale, aggregate, tentative):  # type: ignore[no-untyped-def]
    """Replace the product of a matrix with a tentative prolongation by the smoothed one."""
    indptr, indices, data = up
    for row in range(len(scale)):
        for k in range(indptr[row], indptr[row + 1]):
            for g in range(data.shape[1]):
                data[k, g] *= -scale[row, g]
                if indices[k] == aggregate[row]:
                    data[k, g] += tentative[row, g]


@njit
def absolute_sums(matrix, free, out):  # type: ignore[no-untyped-def]
    """Write the sums of absolute values of a matrix in columns that are free to out (k, w)."""
    indptr, indices, data = matrix
    for row in range(len(out)):
        for g in range(out.shape[1]):
            out[row, g] = 0.0
            for k in range(indptr[row], indptr[row + 1]):
                if free[indices[k], g]:
                    out[row, g] += abs(data[k, min(g, data.shape[1] - 1)])


@njit
def diagonals(matrix, free, middle, inverse):  # type: ignore[no-untyped-def]
    """Write ``middle`` and ``inverse`` of a `LaplacianLevel`; ``free`` (k, w): what is not held."""
    indptr, indices, data = matrix
    for row in range(len(middle)):
        middle[row] = indptr[row]
        for k in range(indptr[row], indptr[row + 1]):
            middle[row] += indices[k] < row
        for g in range(free.shape[1]):
            own = 0.0
            outside = 0.0
            for k in range(indptr[row], indptr[row + 1]):
                size = abs(data[k, min(g, data.shape[1] - 1)])
                if indices[k] == row:
                    own = size
                elif indices[k] // PART != row // PART:
                    outside += size
            inverse[row, g] = own + 0.5 * max(0.0, outside - SPARE * own)
            used = free[row, g] and inverse[row, g] > 0.0
            inverse[row, g] = 1.0 / inverse[row, g] if used else 0.0


@njit(inline="always")
def _columns(group, data):  # type: ignore[no-untyped-def]
    """Return the columns of data (k, w) that the components of three groups have."""
    top = data.shape[1] - 1
    return min(group[0], top), min(group[1], top), min(group[2], top)


@njit(inline="always")
def _plus(s, sign, data, k, columns, x, j):  # type: ignore[no-untyped-def]
    """Return the triple s plus entry k of a matrix times row j of x (n, 3)."""
    a, b, c = columns
    return (
        s[0] + sign * data[k, a] * x[j, 0],
        s[1] + sign * data[k, b] * x[j, 1],
        s[2] + sign * data[k, c] * x[j, 2],
    )


@njit(inline="always")
def _scaled(s, inverse, row, group):  # type: ignore[no-untyped-def]
    """Return the triple s times the inverse diagonal of a row."""
    a, b, c = group
    return s[0] * inverse[row, a], s[1] * inverse[row, b], s[2] * inverse[row, c]


@njit(inline="always")
def _write(s, out, row):  # type: ignore[no-untyped-def]
    out[row, 0], out[row, 1], out[row, 2] = s


@njit(parallel=True)
def forward(matrix, middle, inverse, group, right, x, left):  # type: ignore[no-untyped-def]
    """Write what a Gauss-Seidel sweep from zero makes of ``right`` (k, 3) to x (k, 3).

    And to ``left`` (k, 3) what it subtracted from.
    """
    indptr, indices, data = matrix
    rows = len(x)
    columns = _columns(group, data)
    for part in prange((rows + PART - 1) // PART):
        first = part * PART
        for row in range(first, min(rows, first + PART)):
            s = row3(right, row)
            for k in range(indptr[row], middle[row]):
                if indices[k] >= first:
                    s = _plus(s, -1.0, data, k, columns, x, indices[k])
            _write(s, left, row)
            _write(_scaled(s, inverse, row, group), x, row)


@njit(parallel=True)
def residual(matrix, middle, group, x, left):  # type: ignore[no-untyped-def]
    """Subtract from ``left`` (k, 3), as `forward` left it, what it did not yet."""
    indptr, indices, data = matrix
    rows = len(x)
    columns = _columns(group, data)
    for part in prange((rows + PART - 1) // PART):
        first = part * PART
        for row in range(first, min(rows, first + PART)):
            s = row3(left, row)
            for k in range(indptr[row], indptr[row + 1]):
                if indices[k] < first or k >= middle[row]:
                    s = _plus(s, -1.0, data, k, columns, x, indices[k])
            _write(s, left, row)


@njit(parallel=True)
def backward(matrix, inverse, group, right, x, out):  # type: ignore[no-untyped-def]
    """Write what a backward sweep makes of x (k, 3) to out (k, 3): the transpose of `forward`."""
    indptr, indices, data = matrix
    rows = len(x)
    columns = _columns(group, data)
    for part in prange((rows + PART - 1) // PART):
        first = part * PART
        last = min(rows, (part + 1) * PART)
        for row in range(last - 1, first - 1, -1):
            s = row3(right, row)
            for k in range(indptr[row], indptr[row + 1]):
                j = indices[k]
                if row < j < last:
                    s = _plus(s, -1.0, data, k, columns, out, j)
                else:
                    s = _plus(s, -1.0, data, k, columns, x, j)
            _write(add3(row3(x, row), _scaled(s, inverse, row, group)), out, row)


@njit(parallel=True)
def add_product(matrix, group, x, out):  # type: ignore[no-untyped-def]
    """Add the product of a sparse matrix with x (k, 3) to out (m, 3); sums keep their order."""
    indptr, indices, data = matrix
    columns = _columns(group, data)
    for row in prange(len(out)):
        s = row3(out, row)
        for k in range(indptr[row], indptr[row + 1]):
            s = _plus(s, 1.0, data, k, columns, x, indices[k])
        _write(s, out, row)
