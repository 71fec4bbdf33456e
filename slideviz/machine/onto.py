"""A boundary laid onto another surface: closest points with normals, smoothed, in a few rounds.

Only distances along normals count, so that nodes may slide along the target; those of sharp edges
slide along its edges. First the boundary moves by the quadratic polynomial that fits best. What
remains is kept smooth by the graph's Laplacian, with a weight that falls from round to round, until
it follows each detail.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import NO_NODES, FloatArray, IntArray, row_dots, row_norms
from slideviz.mesh.topology import (
    distinct_edges,
    facet_edges,
    facet_vectors,
    find_joints,
    single_edges,
    unit,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SMOOTHNESS = np.geomspace(10.0, 1e-4, 6)
"""Weight of the smoothness of the displacement in each round."""
FITS = 10
"""Number of fits of the polynomial; each has other closest points."""
DAMPING = 1e-2
"""Weight of the polynomial's coefficients: those that slide along the target stay small."""
AGREE = 0.3
"""Least cosine of normals that face each other: it keeps both sides of a thin edge apart."""
SHARP = -0.3
"""Cosine of the normals of two facets below which their edge is sharp, as a trailing edge."""
NEAR_EDGE = 0.1
"""Largest distance of a sharp edge from one of the target, once the polynomial has been fitted,
over the boundary's size; beyond it, the edge has no counterpart."""
STIFF = 100.0  # weight of the distance of a rim from its wall, relative to that from the target
STILL = 1e-6  # weight of the change in a round, without which a matrix might be singular
LAST = 8  # Newton steps of each node to where target, edges and walls meet
TANGENT = 1e-3  # weight of the change in these, where two of them are nearly tangent
ENOUGH = 1e-2
MOST = 100
"""Residual of the equations of a round, relative to their right side, and most iterations."""

Nearest = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Returns for points (m, d) their closest points on a surface and its unit normals there; or on
edges, and their unit tangents, which are 0 for corners in 2D."""


class Wall(NamedTuple):
    """A surface that some nodes at the rim of a boundary stay on."""

    rows: IntArray  # (r,): these nodes, as rows of the boundary's points
    nearest: Nearest


@record
class Target:
    """A surface to lay a boundary onto, its normals oriented alike: all inwards, or all outwards.

    ``edges`` are its sharp edges; None where there are none.
    """

    surface: Nearest
    edges: Nearest | None = None


@record
class Laid:
    """A boundary laid onto a target surface."""

    vectors: FloatArray  # (k, d): the displacements of its nodes
    distances: FloatArray  # (k,): of its nodes from the target, afterwards
    facing: FloatArray  # (k,): cosine of its normals and those of the target, afterwards


def find_edges(points: FloatArray, facets: IntArray) -> tuple[IntArray, IntArray]:
    """Return the sharp edges of a surface, and those at its rim: nodes (e, 2), in 2D (e, 1).

    ``facets`` (f, 2) or (f, 4), where a triangle repeats its last node.
    """
    dim = points.shape[1]
    pairs, sharp = find_joints(facets, dim)
    normals = unit(facet_vectors(points, facets))
    sharp = sharp[row_dots(normals[pairs[:, 0]], normals[pairs[:, 1]]) < SHARP]
    if dim == 3:
        edges = facet_edges(facets)
        return sharp, distinct_edges(edges[single_edges(edges)])
    nodes, count = np.unique(facets, return_counts=True)
    return sharp, nodes[count == 1, None]


def lay_onto(points: FloatArray, facets: IntArray, target: Target, walls: Sequence[Wall]) -> Laid:
    """Return a boundary laid onto a target surface.

    Parameters
    ----------
    points : (k, d)
        The nodes of the boundary.
    facets : (f, 2) or (f, 4)
        Its facets, as rows of ``points``, oriented alike; a triangle repeats its last node.
    target : Target
        The surface; it goes on flat beyond its end.
    walls : sequence of Wall
        What nodes at the boundary's rim stay on.
    """
    size = float(np.ptp(points, axis=0).max())
    bending = _bending(points, facets)
    guide = _Guide(facets, target, walls)
    guide.sign = 1.0 if guide.facing(points).sum() >= 0.0 else -1.0
    moved = fitted = _fit(points, guide)
    if target.edges is not None:
        edge = np.unique(find_edges(points, facets)[0])
        near = row_norms(target.edges(moved[edge])[0] - moved[edge])
        guide.edge = edge[near <= NEAR_EDGE * size]
    for weight in SMOOTHNESS:
        moved = moved + guide.change(moved, weight * bending, fitted - moved)
    for _ in range(LAST):
        blocks, right = guide.equations(moved)
        blocks += TANGENT * np.eye(points.shape[1])
        moved = moved + np.linalg.solve(blocks, right[..., None])[..., 0]
        for wall in walls:
            moved[wall.rows] = wall.nearest(moved[wall.rows])[0]
    distances = row_norms(target.surface(moved)[0] - moved)
    return Laid(moved - points, distances, guide.facing(moved))


@dataclass
class _Guide:
    """The surfaces and edges that a boundary is drawn to."""

    facets: IntArray
    target: Target
    walls: Sequence[Wall]
    edge: IntArray = field(default_factory=lambda: NO_NODES)
    """(e,): the nodes of sharp edges that have a counterpart."""
    sign: float = 1.0
    """-1 where normals of the target have the other direction than the boundary's, else 1."""

    def facing(self, points: FloatArray) -> FloatArray:
        """Return the cosine of the normals of boundary and target at each node."""
        vectors = facet_vectors(points, self.facets)
        normals = np.zeros_like(points)
        for column in self.facets.T:
            np.add.at(normals, column, vectors)
        return self.sign * row_dots(unit(normals), self.target.surface(points)[1])

    def conditions(self, moved: FloatArray) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Return conditions that draw nodes at ``moved`` to where they belong.

        Rows (m,), directions (m, d), the ways to go along these (m,), and weights (m,).
        """
        nodes = np.arange(len(moved))
        at, normals = self.target.surface(moved)
        found = [(nodes, normals, at - moved, (self.facing(moved) > AGREE).astype(float))]
        for rows, nearest in self.walls:
            at, normals = nearest(moved[rows])
            found.append((rows, normals, at - moved[rows], np.full(len(rows), STIFF)))
        if self.target.edges is not None and len(self.edge):
            at, tangents = self.target.edges(moved[self.edge])
            for axis, along in enumerate(np.eye(moved.shape[1])):
                across = along - tangents[:, axis, None] * tangents
                found.append((self.edge, across, at - moved[self.edge], np.ones(len(self.edge))))
        rows, directions, ways, weights = map(np.concatenate, zip(*found, strict=True))
        return rows, directions, row_dots(ways, directions), weights

    def equations(self, moved: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return matrices (k, d, d) and right sides (k, d) of the least squares of each node."""
        rows, directions, ways, weights = self.conditions(moved)
        blocks = np.zeros((*moved.shape, moved.shape[1]))
        right = np.zeros_like(moved)
        weighted = weights[:, None] * directions
        np.add.at(blocks, rows, weighted[:, :, None] * directions[:, None])
        np.add.at(right, rows, weighted * ways[:, None])
        return blocks, right

    def change(self, moved: FloatArray, bending: csr_array, ahead: FloatArray) -> FloatArray:
        """Return the change (k, d) of a round, whose difference from ``ahead`` (k, d) is smooth.

        Conjugate gradients solve for it. Their preconditioner has one factor for all components,
        with the mean of the conditions of a node over all directions.
        """
        # Late: scipy.sparse takes 0.1 s.
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import LinearOperator, cg, splu

        blocks, right = self.equations(moved)
        mean = np.einsum("kdd->k", blocks) / moved.shape[1] + STILL
        # Symmetric, positive definite: no pivots, and the order of least degree.
        symmetric = {"SymmetricMode": True}
        factor = splu(
            (bending + diags_array(mean)).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options=symmetric,
        )

        def apply(u: FloatArray) -> FloatArray:
            u = u.reshape(moved.shape)
            return (np.einsum("kde,ke->kd", blocks, u) + bending @ u + STILL * u).ravel()

        shape = moved.size, moved.size
        change, _ = cg(
            LinearOperator(shape, apply),
            (right + bending @ ahead).ravel(),
            rtol=ENOUGH,
            maxiter=MOST,
            M=LinearOperator(shape, lambda r: factor.solve(r.reshape(moved.shape)).ravel()),
        )
        return change.reshape(moved.shape)


def _fit(points: FloatArray, guide: _Guide) -> FloatArray:
    """Return the points moved by the quadratic polynomial that takes them nearest to the target."""
    k, dim = points.shape
    x = (points - points.mean(axis=0)) / np.ptp(points, axis=0).max()
    pairs = combinations_with_replacement(range(dim), 2)
    terms = np.stack([np.ones(k), *x.T, *(x[:, i] * x[:, j] for i, j in pairs)], axis=1)
    moved = points
    before = np.zeros(terms.shape[1] * dim)
    for _ in range(FITS):
        blocks, right = guide.equations(moved)
        matrix = np.einsum("kt,kde,ks->tdse", terms, blocks, terms, optimize=True)
        right += np.einsum("kde,ke->kd", blocks, moved - points)
        damping = DAMPING * k / before.size * np.eye(before.size)
        before = np.linalg.solve(matrix.reshape(damping.shape) + damping, (terms.T @ right).ravel())
        moved = points + terms @ before.reshape(-1, dim)
    return moved


def _bending(points: FloatArray, facets: IntArray) -> csr_array:
    """Return the square of the graph's Laplacian, (k, k).

    Edges weigh as the inverse of their lengths, and the weights of a node are 1 together.
    """
    # Late: scipy.sparse takes 0.1 s.
    from scipy.sparse import coo_array, diags_array

    one, two = distinct_edges(facet_edges(facets)).T
    k = len(points)
    weights = 1.0 / row_norms(points[one] - points[two])
    links = coo_array((weights, (one, two)), (k, k)).tocsr()
    links = links + links.T
    laplacian = diags_array(np.ones(k)) - diags_array(1.0 / links.sum(axis=1)) @ links
    return (laplacian.T @ laplacian).tocsr()
