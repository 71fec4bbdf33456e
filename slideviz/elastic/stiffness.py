"""Stiffness matrix of the mesh as an elastic body, with its boundary conditions, as in SU2.

Young's modulus E of a cell comes from its volume or its distance to walls (`MODULI`), Poisson's
ratio nu is one number, with plane strain in two dimensions (SU2's DEFORM_STIFFNESS_TYPE and
DEFORM_COEFF):

    mu = E / (2 (1 + nu)),    lam = nu E / ((1 + nu) (1 - 2 nu)).

Beyond nu = 1, as in SU2's default of 1e6, lam is about -mu: enlarging a cell alike along all axes
costs nothing in 2D, and in 3D gains energy. Conditions are eliminated during assembly, node by
node: the displacement of node i is

    u_i = T_i z_k + g_i,      k = place_i

with T_i = R_i P_k: P_k projects on the directions in which the node is free, R_i rotates
displacements of its representative periodic image into its own. Known nodes have no block of
unknowns, only g_i. The matrix is symmetric with blocks d by d, as the solver takes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from functools import cache

import numpy as np
from scipy.sparse import bsr_array, csr_array
from scipy.spatial import KDTree

from slideviz.argument_types import record
from slideviz.errors import DeformError
from slideviz.mesh.jacobians import cross3, dot3, row3
from slideviz.mesh.model import Cells, FloatArray, IntArray, frozen_array, sealed
from slideviz.rbf.evaluate import Tick, no_tick
from slideviz.system.jit_cache import njit
from slideviz.terms import StiffnessType

PYRAMID = 14

_CORNERS = {
    5: ((0, 0), (1, 0), (0, 1)),
    9: ((0, 0), (1, 0), (1, 1), (0, 1)),
    10: ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    12: (
        *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
        *((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
    ),
    13: ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
    14: ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1)),
}
"""The corners of the reference elements in the order of SU2's (VTK's) nodes."""

_ORDER = {5: 1, 9: 2, 10: 1, 12: 2}
"""Degree of the polynomials that the integration rule integrates exactly."""


@record
class ReferenceShape:
    """A reference element."""

    gradients: FloatArray
    """(q, a, d): of the a shape functions, at q integration points, in the reference element."""
    weights: FloatArray
    """(q,): of the integration points; their sum is the reference element's volume."""


@cache
def shape(vtk: int) -> ReferenceShape:
    """Return the shape functions of a VTK element type, in the order of SU2's nodes."""
    if vtk == PYRAMID:
        return _pyramid()
    # Late: scikit-fem takes 0.1 s.
    import skfem

    element = {
        5: skfem.ElementTriP1,
        9: skfem.ElementQuad1,
        10: skfem.ElementTetP1,
        12: skfem.ElementHex1,
        13: skfem.ElementWedge1,
    }[vtk]()
    x, weights = _quadrature(vtk, element)
    corners = [tuple(round(v) for v in row) for row in element.doflocs.tolist()]
    local = [corners.index(corner) for corner in _CORNERS[vtk]]
    gradients = [np.asarray(element.lbasis(x, i)[1], float) for i in local]
    # (a, d) or (a, d, q), depending on whether the gradients are constant.
    full = [np.broadcast_to(g.reshape(len(x), -1), x.shape).T for g in gradients]
    return ReferenceShape(
        np.ascontiguousarray(np.stack(full, axis=1)), np.ascontiguousarray(weights)
    )


def _quadrature(vtk: int, element: object) -> tuple[FloatArray, FloatArray]:
    """Return integration points (d, q) and weights (q,)."""
    # Late: scikit-fem takes 0.1 s.
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefLine, RefTri

    if vtk in _ORDER:
        x, weights = get_quadrature(element, _ORDER[vtk])
        return np.asarray(x), np.asarray(weights)
    # A prism: triangle times line. scikit-fem's own rule for it has its centre at x = 1/2.
    flat, area = get_quadrature(RefTri, 2)
    height, length = get_quadrature(RefLine, 2)
    x = np.concatenate([np.repeat(flat, len(length), axis=1), np.tile(height, len(area))])
    return x, np.repeat(area, len(length)) * np.tile(length, len(area))


def _pyramid() -> ReferenceShape:
    """Return the pyramid of SU2: rational shape functions, five integration points.

    With p = 1 - z the function of the corner at x = 1 is ((p + x)^2 - y^2) / (4 p), others by
    symmetry, and z that of the apex.
    """
    side = 0.5
    near = 0.1531754163448146
    far = 0.6372983346207416
    places = [(side, 0, near), (0, side, near), (-side, 0, near), (0, -side, near), (0, 0, far)]
    gradients = np.zeros((len(places), 5, 3))
    for q, (x, y, z) in enumerate(places):
        p = 1.0 - z
        for a, (s, t, _) in enumerate(_CORNERS[PYRAMID][:4]):
            along = p + s * x + t * y
            across = t * x + s * y
            gradients[q, a, 0] = (s * along - t * across) / (2.0 * p)
            gradients[q, a, 1] = (t * along - s * across) / (2.0 * p)
            gradients[q, a, 2] = (along**2 - across**2) / (4.0 * p**2) - along / (2.0 * p)
        gradients[q, 4, 2] = 1.0
    return ReferenceShape(gradients, np.full(len(places), 2.0 / 15.0))


@record
class ShapeBlock:
    """The elements of a mesh that have one shape."""

    vtk: int
    nodes: IntArray  # (m, a)
    cell: IntArray  # (m,): the cell of the mesh that each element is

    @property
    def shape(self) -> ReferenceShape:
        """Return the reference element."""
        return shape(self.vtk)


def blocks(cells: Cells) -> list[ShapeBlock]:
    """Return all cells as elements, a block for each type."""
    return [ShapeBlock(vtk, nodes, ids) for vtk, (ids, nodes) in cells.by_type.items()]


CHUNK = 20_000  # elements between two calls of tick: some tens of milliseconds

POISSON = 0.3  # Poisson's ratio of a case that names none, and of relaxation


@record
class Stiffness:
    """How stiff the cells of a body are."""

    kind: StiffnessType = "INVERSE_VOLUME"
    poisson: float = POISSON
    walls: IntArray = field(default_factory=lambda: np.empty(0, np.int64))  # their nodes, (w,)

    def moduli(self, points: FloatArray, parts: list[ShapeBlock]) -> FloatArray:
        """Return Young's modulus (c,) of each cell at positions (n, d); inf without volume."""
        with np.errstate(divide="ignore"):
            return np.where(
                cell_volumes(points, parts) > 0.0, MODULI[self.kind](points, parts, self), np.inf
            )

    @property
    def lame(self) -> tuple[float, float]:
        """Return mu and lam for a modulus of 1."""
        nu = self.poisson
        return 1.0 / (2.0 * (1.0 + nu)), nu / ((1.0 + nu) * (1.0 - 2.0 * nu))


def _near_walls(points: FloatArray, parts: list[ShapeBlock], stiffness: Stiffness) -> FloatArray:
    """Return one over the mean distance (c,) of the cells' nodes to the nearest node of a wall.

    A cell between nodes of walls alone is as stiff as the stiffest of the others.
    """
    distance = np.asarray(KDTree(points[stiffness.walls]).query(points, workers=-1)[0])
    mean = np.zeros(_count(parts))
    for part in parts:
        mean[part.cell] = distance[part.nodes].mean(axis=1)
    some = mean > 0.0
    return np.asarray(1.0 / np.where(some, mean, mean[some].min(initial=np.inf)))


MODULI: dict[StiffnessType, Callable[[FloatArray, list[ShapeBlock], Stiffness], FloatArray]] = {
    "SOLID_WALL_DISTANCE": _near_walls,
    "INVERSE_VOLUME": lambda points, parts, _: 1.0 / cell_volumes(points, parts),
    "CONSTANT_STIFFNESS": lambda _, parts, __: np.ones(_count(parts)),
}
"""Young's modulus (c,) of each cell, by kind of stiffness, from positions (n, d) and elements."""


@record
class Conditions:
    """Boundary conditions of all nodes, u_i = T_i z_k + g_i."""

    place: IntArray
    """(n,): number of each node's block of unknowns; -1 for known nodes. Periodic images share
    one."""
    turn: FloatArray  # (n, d, d): T_i; the identity for most
    plain: np.ndarray  # (n,): whether T_i is the identity
    known: FloatArray  # (n, d): g_i
    free: FloatArray  # (k, d, d): P_k of each block of unknowns


@record
class ElasticMesh:
    """A mesh as an elastic body, at given positions."""

    points: FloatArray  # (n, d)
    parts: list[ShapeBlock]  # the elements
    moduli: FloatArray  # (c,): Young's modulus of each cell
    lame: tuple[float, float]  # mu and lam for a modulus of 1

    @classmethod
    def at(cls, points: FloatArray, parts: list[ShapeBlock], stiffness: Stiffness) -> ElasticMesh:
        """Return the body at positions (n, d). Raises DeformError if an element has no volume."""
        points = frozen_array(points, np.float64)  # as those of a mesh are: the loops compile once
        moduli = stiffness.moduli(points, parts)
        if not (moduli < np.inf).all():
            raise _no_volume(int(np.flatnonzero(~(moduli < np.inf))[0]))
        return cls(points, parts, moduli, stiffness.lame)

    def matrix(self, conditions: Conditions, tick: Tick = no_tick) -> bsr_array:
        """Return the matrix (k d, k d) of the unknowns z.

        Raises DeformError if an element has no volume. Inverted elements count with the absolute
        value of their Jacobian, so that the matrix stays positive definite (with nu below 0.5).
        """
        count = len(conditions.free)
        d = self.points.shape[1]
        indptr, indices = _pattern(self.parts, conditions.place, count)
        data = np.zeros((len(indices), d, d))
        entry = conditions.place, conditions.turn, conditions.plain
        total = sum(len(part.nodes) for part in self.parts)
        done = 0
        for part in self.parts:
            for start in range(0, len(part.nodes), CHUNK):
                rows = slice(start, start + CHUNK)
                cell = part.cell[rows]
                elements = self._elements(part, rows)
                bad = add(elements, self.moduli[cell], self.lame, entry, (indptr, indices), data)
                if bad >= 0:
                    raise _no_volume(int(cell[bad]))
                done += len(cell)
                tick(done / total)
        _fill_held_diagonal(indptr, indices, data, conditions.free)
        return bsr_array((data, indices, indptr), shape=(count * d, count * d))

    @property
    def weights(self) -> FloatArray:
        """Return the weights (c,) of the Laplacian like it, in the order of the parts."""
        size = self.lame[0] * self.moduli * cell_volumes(self.points, self.parts)
        return np.concatenate([size[part.cell] for part in self.parts])

    def forces(self, moved: FloatArray) -> FloatArray:
        """Return the forces (n, d) of a displacement (n, d), by its differences in each element.

        So a body that moves as a whole has none, to the bit. The entries of the matrix cancel to
        rounding only, and what the stiffest cells leave pulls soft ones far away.
        """
        out = np.zeros(moved.shape)
        for part in self.parts:
            elements = self._elements(part, slice(None))
            add_forces(elements, self.moduli[part.cell], self.lame, moved, out)
        return out

    def _elements(
        self, part: ShapeBlock, rows: slice
    ) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
        shape = part.shape
        return self.points, sealed(part.nodes[rows]), shape.gradients, shape.weights


def _no_volume(cell: int) -> DeformError:
    return DeformError(
        f"cell {cell} has no volume, so linear elasticity cannot give it a stiffness; use more "
        "STEPS, or METHOD= rbf, or repair the mesh"
    )


def cell_volumes(points: FloatArray, parts: list[ShapeBlock]) -> FloatArray:
    """Return the volume (area in 2D) of each cell, (c,)."""
    out = np.zeros(_count(parts))
    for part in parts:
        each = np.empty(len(part.nodes))
        shape = part.shape
        volumes(sealed(points), sealed(part.nodes), shape.gradients, shape.weights, each)
        out[part.cell] = each
    return out


def _count(parts: list[ShapeBlock]) -> int:
    """Return the number of cells."""
    return max((int(p.cell.max(initial=-1)) + 1 for p in parts), default=0)


def _pattern(parts: list[ShapeBlock], place: IntArray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return indptr and indices of the matrix blocks: pairs of unknowns that share an element."""
    rows = []
    columns = []
    offset = 0
    for part in parts:
        at = place[part.nodes]
        element = offset + np.arange(len(at))[:, None] + np.zeros_like(at)
        rows.append(at[at >= 0])
        columns.append(element[at >= 0])
        offset += len(at)
    row = np.concatenate(rows).astype(np.int32)
    column = np.concatenate(columns).astype(np.int32)
    touches = csr_array((np.ones(len(row), np.int32), (row, column)), shape=(count, offset))
    touches.data[:] = 1
    pattern = csr_array(touches @ touches.T)
    pattern.sort_indices()
    return pattern.indptr, pattern.indices


def _fill_held_diagonal(
    indptr: np.ndarray, indices: np.ndarray, data: FloatArray, free: FloatArray
) -> None:
    """Fill the diagonal blocks of ``data`` (nnz, d, d) in the directions that ``free`` removes.

    ``free`` (k, d, d) are the projections P_k. Else the matrix would be singular.
    """
    held = np.eye(free.shape[1]) - free
    rows = np.flatnonzero(np.any(held != 0, axis=(1, 2)))
    row_of = np.repeat(np.arange(len(free)), np.diff(indptr))
    diagonal = np.flatnonzero(row_of == indices)[rows]
    there = data[diagonal]
    size = np.einsum("kii->k", there) / np.maximum(np.einsum("kii->k", free[rows]), 1.0)
    data[diagonal] += np.where(size > 0, size, 1.0)[:, None, None] * held[rows]


@njit
def _jacobian(corners, gradients, q, inverse):  # type: ignore[no-untyped-def]
    """Return det J of an element with ``corners`` (a, d) at integration point q.

    Writes J^-1 to ``inverse`` (3, 3).
    """
    d = corners.shape[1]
    J = np.zeros((3, 3))
    J[2, 2] = 1.0
    for i in range(d):
        for j in range(d):
            total = 0.0
            for a in range(corners.shape[0]):
                total += gradients[q, a, i] * corners[a, j]
            J[i, j] = total
    one = row3(J, 0)
    two = row3(J, 1)
    three = row3(J, 2)
    x = cross3(two, three)
    y = cross3(three, one)
    z = cross3(one, two)
    det = dot3(one, x)
    for i in range(3):
        inverse[i, 0] = x[i] / det
        inverse[i, 1] = y[i] / det
        inverse[i, 2] = z[i] / det
    return det


@njit
def _gather(points, nodes, e, x):  # type: ignore[no-untyped-def]
    """Write the corners (a, d) of an element; number by number, as rows take seconds to compile."""
    for a in range(x.shape[0]):
        for i in range(x.shape[1]):
            x[a, i] = points[nodes[e, a], i]


@njit
def _slopes(gradients, inverse, slopes):  # type: ignore[no-untyped-def]
    """Write grad N_a to ``slopes`` (a, d), from that in the reference element."""
    n, d = slopes.shape
    for a in range(n):
        for i in range(d):
            total = 0.0
            for j in range(d):
                total += inverse[i, j] * gradients[a, j]
            slopes[a, i] = total


@njit
def volumes(points, nodes, gradients, weights, out):  # type: ignore[no-untyped-def]
    """Write the volumes (areas) of elements to ``out`` (m,), positive for any orientation."""
    inverse = np.empty((3, 3))
    x = np.empty((nodes.shape[1], points.shape[1]))
    for e in range(len(nodes)):
        _gather(points, nodes, e, x)
        out[e] = 0.0
        for q in range(len(weights)):
            out[e] += weights[q] * abs(_jacobian(x, gradients, q, inverse))


@njit
def _products(x, gradients, weights, inverse, g, m):  # type: ignore[no-untyped-def]
    """Write the integrals of grad_i N_a grad_j N_b to m (a d, a d).

    Returns False for an element without volume. ``inverse`` and ``g`` are scratch.
    """
    n, d = x.shape
    slopes = g.reshape(n, d)
    m[:] = 0.0
    for q in range(len(weights)):
        size = abs(_jacobian(x, gradients, q, inverse)) * weights[q]
        if not size > 0.0:
            return False
        _slopes(gradients[q], inverse, slopes)
        for row in range(n * d):
            scaled = size * g[row]
            for column in range(n * d):
                m[row, column] += scaled * g[column]
    return True


@njit
def add(elements, modulus, lame, conditions, pattern, data):  # type: ignore[no-untyped-def]
    """Add elements to the matrix blocks ``data``.

    Returns the first element without volume, at which it ends, or -1. ``elements``: points, nodes,
    gradients and weights; ``modulus`` (m,); ``lame``: mu and lam for a modulus of 1;
    ``conditions``: place, turn and plain; ``pattern``: indptr and indices.
    """
    points, nodes, gradients, weights = elements
    place, turn, plain = conditions
    indptr, indices = pattern
    n = nodes.shape[1]
    d = points.shape[1]
    inverse = np.empty((3, 3))
    x = np.empty((n, d))
    g = np.empty(n * d)
    m = np.empty((n * d, n * d))
    block = np.empty((d, d))
    half = np.empty((d, d))
    for e in range(len(nodes)):
        _gather(points, nodes, e, x)
        if not _products(x, gradients, weights, inverse, g, m):
            return e
        mu = modulus[e] * lame[0]
        lam = modulus[e] * lame[1]
        for a in range(n):
            first = nodes[e, a]
            row = place[first]
            if row < 0:
                continue
            for b in range(n):
                second = nodes[e, b]
                column = place[second]
                if column < 0:
                    continue
                trace = 0.0
                for i in range(d):
                    trace += m[a * d + i, b * d + i]
                for i in range(d):
                    for j in range(d):
                        block[i, j] = lam * m[a * d + i, b * d + j] + mu * m[a * d + j, b * d + i]
                    block[i, i] += mu * trace
                if not plain[first]:
                    _into(turn[first], block, half, True)
                if not plain[second]:
                    _into(turn[second], block, half, False)
                low = indptr[row]
                high = indptr[row + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < column:
                        low = middle + 1
                    else:
                        high = middle
                for i in range(d):
                    for j in range(d):
                        data[low, i, j] += block[i, j]
    return -1


@njit
def add_forces(elements, modulus, lame, moved, out):  # type: ignore[no-untyped-def]
    """Add the forces of a displacement (n, d) to ``out`` (n, d); parameters as of ``add``."""
    points, nodes, gradients, weights = elements
    n = nodes.shape[1]
    d = points.shape[1]
    inverse = np.empty((3, 3))
    x = np.empty((n, d))
    y = np.empty((n, d))
    g = np.empty((d, d))
    slopes = np.empty((n, d))
    f = np.empty((n, d))
    for e in range(len(nodes)):
        _gather(points, nodes, e, x)
        _gather(moved, nodes, e, y)
        f[:] = 0.0
        for q in range(len(weights)):
            size = modulus[e] * abs(_jacobian(x, gradients, q, inverse)) * weights[q]
            g[:] = 0.0
            _slopes(gradients[q], inverse, slopes)
            for a in range(n):
                for i in range(d):
                    for j in range(d):
                        g[i, j] += (y[a, i] - y[0, i]) * slopes[a, j]
            trace = 0.0
            for i in range(d):
                trace += g[i, i]
            for a in range(1, n):
                for i in range(d):
                    total = lame[1] * trace * slopes[a, i]
                    for j in range(d):
                        total += lame[0] * (g[i, j] + g[j, i]) * slopes[a, j]
                    f[a, i] += size * total
                    f[0, i] -= size * total
        for a in range(n):
            for i in range(d):
                out[nodes[e, a], i] += f[a, i]


@njit
def _into(turn, block, half, left):  # type: ignore[no-untyped-def]
    """Replace a block (d, d) by T^T block (``left``) or block T, in place; ``half`` is scratch."""
    d = len(block)
    for i in range(d):
        for j in range(d):
            total = 0.0
            for k in range(d):
                total += turn[k, i] * block[k, j] if left else block[i, k] * turn[k, j]
            half[i, j] = total
    for i in range(d):
        for j in range(d):
            block[i, j] = half[i, j]


def by_node(nodes: np.ndarray, count: int) -> tuple[IntArray, IntArray]:
    """Return indptr (count + 1,) and the places in ``nodes`` (m,) of each node, in order."""
    indptr = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(nodes, minlength=count), out=indptr[1:])
    out: IntArray = np.empty(len(nodes), np.int32 if len(nodes) < 2**31 else np.int64)
    _invert(nodes, indptr[:-1].copy(), out)
    return indptr, out


@njit
def _invert(nodes, at, out):  # type: ignore[no-untyped-def]
    """Write the places of each node in ``nodes`` (m,) to out (m,), from ``at`` (n,) on."""
    for k in range(len(nodes)):
        out[at[nodes[k]]] = k
        at[nodes[k]] += 1
