"""The preconditioner of relaxation: one multigrid cycle of a Laplacian for each component.

With the gradient of each component weighted by the cell's stiffness, the Laplacian of a mesh is
equivalent to its elasticity (Korn's inequality), does not care how cells are turned, and has one
number where elasticity has d by d. It depends on the undeformed mesh and on which nodes move
together only, so one hierarchy serves all steps, runs and designs of a mesh.

Rows are smoothed in parts of fixed size, side by side. What couples a row to other parts is added
to its diagonal, so that the sweep converges whatever the parts are (Baker, Falgout, Kolev and Yang
2011, Multigrid smoothers for ultraparallel computing, section 5), with the same bits for any
number of threads. Matrices are stored in single precision, and vectors in double: the cycle is a
symmetric matrix to rounding, as derivatives need it.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import prange
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array, csr_matrix, diags_array

from slideviz.elastic.forces import _at
from slideviz.elastic.multigrid import RIDGE
from slideviz.elastic.stiffness import OPTIONS, ShapeBlock, cell_volumes
from slideviz.mesh.model import FloatArray, IntArray, sealed
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.tape import transform, value
from slideviz.system.jit_cache import njit

COARSE = 300
"""Largest number of unknowns of the coarsest level, which has a dense factor."""

HELD = 1e60
"""On the diagonal of the coarsest matrix, in rows of nothing."""

PART = 4096
"""Rows that are smoothed one after the other."""

ELEMENTS = 200_000
"""Elements that are added to the matrix at a time, to save memory."""


Sparse = tuple[np.ndarray, np.ndarray, np.ndarray]
"""indptr, indices and data of a sparse matrix."""


@dataclass(frozen=True, eq=False)
class LaplacianLevel:
    """A level of the hierarchy."""

    matrix: Sparse
    inverse: FloatArray
    """(k,): of the diagonal, with what couples a row to other parts added; zero in rows that are
    held."""
    up: Sparse
    down: Sparse
    """`up`, `down`: prolongation from the next coarser level, and restriction to it."""


@dataclass(frozen=True, eq=False)
class LaplacianHierarchy:
    """A hierarchy for the components that are held at the same nodes."""

    components: IntArray
    levels: tuple[LaplacianLevel, ...]
    """Finest first, without the coarsest."""
    factor: Any
    """Dense Cholesky factor of the coarsest level."""

    def cycle(self, right: FloatArray, depth: int = 0) -> FloatArray:
        """Return what one V-cycle from a level on makes of a right-hand side (k, c)."""
        if depth == len(self.levels):
            return np.asarray(cho_solve(self.factor, right, check_finite=False))
        level = self.levels[depth]
        x = _smoothed(level, right, backward=False)
        left = right - times(level.matrix, x)
        x += times(level.up, self.cycle(times(level.down, left), depth + 1))
        x += _smoothed(level, right - times(level.matrix, x), backward=True)
        return x


@dataclass(frozen=True, eq=False)
class LaplacianCycle:
    """One V-cycle for the Laplacian of each component: a symmetric, positive definite map."""

    parts: tuple[LaplacianHierarchy, ...]
    axes: FloatArray
    """(k, d, d) or (d, d): rows are the axes of the components; Cartesian ones if (d, d)."""

    @classmethod
    def of(
        cls,
        points: FloatArray,
        parts: list[ShapeBlock],
        place: IntArray,
        held: np.ndarray,
        axes: FloatArray,
    ) -> LaplacianCycle:
        """Return the cycle of a mesh.

        Parameters
        ----------
        points : (n, d)
            Undeformed.
        place : (n,)
            Number of each node's unknown; -1 for known nodes.
        held : (k, d)
            Which components of the unknowns stay zero.
        axes : (k, d, d) or (d, d)
            Rows are the axes of these components: orthonormal, (d, d) for Cartesian ones.
        """
        matrix = laplacian(points, parts, place, len(held))
        shared = _single(matrix)
        columns, group = np.unique(held, axis=1, return_inverse=True)
        made = [
            _hierarchy(matrix, shared, columns[:, k], np.flatnonzero(group.ravel() == k))
            for k in range(columns.shape[1])
        ]
        return cls(tuple(made), axes)

    def __call__(self, right: FloatArray) -> FloatArray:
        """Return what one V-cycle makes of a right-hand side (k, d)."""
        turned = self.axes.ndim == 3
        right = np.ascontiguousarray(value(transform(self.axes, right)) if turned else right)
        out = np.empty_like(right)
        for part in self.parts:
            alone = len(self.parts) == 1
            out[:, part.components] = part.cycle(right if alone else right[:, part.components])
        return value(transform(np.swapaxes(self.axes, 1, 2), out)) if turned else out


def _hierarchy(
    matrix: csr_array, shared: Sparse, held: np.ndarray, components: IntArray
) -> LaplacianHierarchy:
    """Return the hierarchy of a matrix (k, k) without the rows and columns ``held`` (k,).

    Its finest level has the matrix itself, ``shared`` between hierarchies.
    """
    import pyamg

    free = diags_array((~held).astype(float))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyamg tells of conversions that are meant
        made = pyamg.smoothed_aggregation_solver(
            csr_matrix(free @ matrix @ free if held.any() else matrix),
            # By row sums: the spectral radius that is the default is found from random numbers.
            smooth=("jacobi", {"omega": 4.0 / 3.0, "weighting": "local"}),
            improve_candidates=None,
            presmoother=None,
            postsmoother=None,
            max_coarse=COARSE,
        ).levels
    dense = made[-1].A.toarray()
    # A mesh that may move as a whole makes the matrix singular; rows of nothing are held.
    diagonal = np.diag(dense)
    dense[np.diag_indices_from(dense)] += np.where(diagonal > 0, RIDGE * diagonal, HELD)
    factor = cho_factor(dense, lower=True, check_finite=False)
    levels = [_level(level) for level in made[:-1]]
    if levels:
        levels[0] = replace(levels[0], matrix=shared)
    return LaplacianHierarchy(components, tuple(levels), factor)


def laplacian(
    points: FloatArray, parts: list[ShapeBlock], place: IntArray, count: int
) -> csr_array:
    """Return the matrix (count, count) of the Laplacian; parameters as of `LaplacianCycle`."""
    total = csr_array((count, count))
    volume = cell_volumes(points, parts)
    for part in parts:
        a = part.nodes.shape[1]
        for start in range(0, len(part.nodes), ELEMENTS):
            nodes = sealed(part.nodes[start : start + ELEMENTS])
            data = np.empty((len(nodes), a, a))
            elements = sealed(points), nodes, part.shape.gradients, part.shape.weights
            gradients(elements, part.share / volume[part.cell[start : start + ELEMENTS]], data)
            at = place[nodes].astype(np.int32)
            row, column = np.broadcast_arrays(at[:, :, None], at[:, None, :])
            inside = (row >= 0) & (column >= 0)
            entries = data[inside], (row[inside], column[inside])
            total = total + csr_array(entries, shape=(count, count))
    # Unknowns of no element, and cells without volume, do not spoil the others.
    total.data[~np.isfinite(total.data)] = 0.0
    total.sort_indices()
    return total


def _level(level: Any) -> LaplacianLevel:
    matrix = csr_array(level.A)
    matrix.sort_indices()
    row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    outside = row // PART != matrix.indices // PART
    diagonal = matrix.diagonal()
    diagonal = diagonal + np.bincount(row, np.abs(matrix.data) * outside, minlength=len(diagonal))
    inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
    up = csr_array(level.P)
    return LaplacianLevel(_single(matrix), inverse, _single(up), _single(csr_array(up.T)))


def _single(matrix: csr_array) -> Sparse:
    return matrix.indptr, matrix.indices, matrix.data.astype(np.float32)


def _smoothed(level: LaplacianLevel, right: FloatArray, *, backward: bool) -> FloatArray:
    """Return what one sweep from zero makes of a right-hand side (k, c)."""
    x = np.empty_like(right)
    with one_at_a_time(len(level.matrix[1]) * right.shape[1]):
        smooth(level.matrix, level.inverse, right, x, backward)
    return x


def times(matrix: Sparse, x: FloatArray) -> FloatArray:
    """Return the product of a sparse matrix (m, k) with x (k, d)."""
    out = np.empty((len(matrix[0]) - 1, x.shape[1]))
    with one_at_a_time(len(matrix[1]) * x.shape[1]):
        multiply(matrix, x, out)
    return out


@njit(**OPTIONS)
def gradients(elements, modulus, out):  # type: ignore[no-untyped-def]
    """Write the integrals of modulus * grad N_a . grad N_b of elements to ``out`` (m, a, a)."""
    points, nodes, _, weights = elements
    n, d = nodes.shape[1], points.shape[1]
    inverse, x, slopes = np.empty((3, 3)), np.empty((n, d)), np.empty((n, d))
    out[:] = 0.0
    for e in range(len(nodes)):
        for q in range(len(weights)):
            size = modulus[e] * _at(elements, e, q, x, inverse, slopes)
            for a in range(n):
                for b in range(n):
                    total = 0.0
                    for i in range(d):
                        total += slopes[a, i] * slopes[b, i]
                    out[e, a, b] += size * total


@njit(parallel=True, nogil=True, cache=True)
def multiply(matrix, x, out):  # type: ignore[no-untyped-def]
    """Write the product of a sparse matrix with x (k, d) to out (m, d); sums keep their order."""
    indptr, indices, data = matrix
    d = x.shape[1]
    for row in prange(len(out)):
        for i in range(d):
            out[row, i] = 0.0
        for k in range(indptr[row], indptr[row + 1]):
            for i in range(d):
                out[row, i] += data[k] * x[indices[k], i]


@njit(parallel=True, nogil=True, cache=True)
def smooth(matrix, inverse, right, x, backward):  # type: ignore[no-untyped-def]
    """Write what one Gauss-Seidel sweep from zero makes of ``right`` (k, d) to x (k, d)."""
    indptr, indices, data = matrix
    rows, d = x.shape
    for part in prange((rows + PART - 1) // PART):
        first, last = part * PART, min(rows, (part + 1) * PART)
        for step in range(last - first):
            row = last - 1 - step if backward else first + step
            low, high = (row + 1, last) if backward else (first, row)
            for i in range(d):
                x[row, i] = right[row, i]
            for k in range(indptr[row], indptr[row + 1]):
                column = indices[k]
                if low <= column < high:
                    for i in range(d):
                        x[row, i] -= data[k] * x[column, i]
            for i in range(d):
                x[row, i] *= inverse[row]
