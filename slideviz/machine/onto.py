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

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import facet_vectors, find_joints, unit

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
WALL_ROUNDS = 5  # projections onto wall and target in turn
STILL = 1e-6  # weight of the change in a round, without which a matrix might be singular
OFF_WALL = 1e-3
"""How far a rim may leave its wall to meet the target, over the boundary's size: walls are faceted
and targets may be rough."""
BENT = 0.05
"""How much farther it may, over its distance beyond the end of the wall, which is continued flat:
walls end where the boundary was."""

Nearest = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Returns for points (m, d) their closest points on a surface and its unit normals there; or on
edges, and their unit tangents, which are 0 for corners in 2D."""


class Wall(NamedTuple):
    """A surface that some nodes at the rim of a boundary stay on."""

    rows: IntArray  # (r,): these nodes, as rows of the boundary's points
    nearest: Nearest


@dataclass(frozen=True, eq=False)
class Target:
    """A surface to lay a boundary onto, its normals oriented alike: all inwards, or all outwards.

    ``edges`` are its sharp edges, ``rim`` is where it ends; None where there are none.
    """

    surface: Nearest
    edges: Nearest | None = None
    rim: Nearest | None = None


@dataclass(frozen=True, eq=False)
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
    sharp = sharp[_dots(normals[pairs[:, 0]], normals[pairs[:, 1]]) < SHARP]
    sides = facets.reshape(-1, 1)
    if dim == 3:
        sides = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
        sides = np.sort(sides[sides[:, 0] != sides[:, 1]], axis=1)
    sides, count = np.unique(sides, axis=0, return_counts=True)
    return sharp, sides[count == 1]


def lay_onto(
    points: FloatArray, facets: IntArray, target: Target, walls: Sequence[Wall] = ()
) -> Laid:
    """Return a boundary laid onto a target surface.

    Parameters
    ----------
    points : (k, d)
        The nodes of the boundary.
    facets : (f, 2) or (f, 4)
        Its facets, as rows of ``points``, oriented alike; a triangle repeats its last node.
    target : Target
        The surface, of which the rim counts where it is at the walls.
    walls : sequence of Wall
        What nodes at the boundary's rim stay on.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    size = float(np.ptp(points, axis=0).max())
    bending = _bending(points, facets)
    guide = _Guide(facets, target, walls)
    guide.sign = 1.0 if guide.facing(points).sum() >= 0.0 else -1.0
    moved = fitted = _fit(points, guide)
    if target.edges is not None:
        edge = np.unique(find_edges(points, facets)[0])
        near = np.linalg.norm(target.edges(moved[edge])[0] - moved[edge], axis=1)
        guide.edge = edge[near <= NEAR_EDGE * size]
    for weight in SMOOTHNESS:
        matrix, right = guide.equations(moved)
        change = weight * (bending @ (fitted - moved).ravel())
        system = matrix + weight * bending + diags_array(np.full(points.size, STILL))
        moved = moved + splu(system.tocsc()).solve(right + change).reshape(points.shape)
    rows = np.flatnonzero(guide.facing(moved) > AGREE)
    moved[rows] = target.surface(moved[rows])[0]
    moved = guide.on_edges(moved)
    for _ in range(WALL_ROUNDS):
        for wall in walls:
            off, _, normals = _beyond(moved[wall.rows], wall)
            moved[wall.rows] = target.surface(moved[wall.rows] - off * normals)[0]
        moved = guide.on_edges(moved)
    for wall in walls:
        moved[wall.rows] = guide.near_wall(moved[wall.rows], wall, OFF_WALL * size)
    distances = np.linalg.norm(target.surface(moved)[0] - moved, axis=1)
    return Laid(moved - points, distances, guide.facing(moved))


@dataclass
class _Guide:
    """The surfaces and edges that a boundary is drawn to."""

    facets: IntArray
    target: Target
    walls: Sequence[Wall]
    edge: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    """(e,): the nodes of sharp edges that have a counterpart."""
    sign: float = 1.0
    """-1 where normals of the target have the other direction than the boundary's, else 1."""

    def facing(self, points: FloatArray) -> FloatArray:
        """Return the cosine of the normals of boundary and target at each node."""
        vectors, normals = facet_vectors(points, self.facets), np.zeros_like(points)
        for column in self.facets.T:
            np.add.at(normals, column, vectors)
        return self.sign * _dots(unit(normals), self.target.surface(points)[1])

    def on_edges(self, points: FloatArray) -> FloatArray:
        """Return the points with those of sharp edges on the edges of the target."""
        if self.target.edges is None or not len(self.edge):
            return points
        moved = points.copy()
        moved[self.edge] = self.target.edges(points[self.edge])[0]
        return moved

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
        return rows, directions, _dots(ways, directions), weights

    def equations(self, moved: FloatArray) -> tuple[csr_array, FloatArray]:
        """Return matrix and right side of the least squares of the conditions."""
        from scipy.sparse import coo_array, diags_array

        rows, directions, ways, weights = self.conditions(moved)
        dim = moved.shape[1]
        columns = dim * rows[:, None] + np.arange(dim)
        lines = np.repeat(np.arange(len(rows)), dim)
        entries = directions.ravel(), (lines, columns.ravel())
        matrix = coo_array(entries, (len(rows), moved.size)).tocsr()
        weighted = diags_array(weights) @ matrix
        return matrix.T @ weighted, weighted.T @ ways

    def near_wall(self, x: FloatArray, wall: Wall, near: float) -> FloatArray:
        """Return points (r, d) that are on the target, and ``near`` the wall.

        They are on the target's rim where that is as near.
        """
        off, beyond, normals = _beyond(x, wall)
        reach = near + BENT * beyond
        if self.target.rim is not None:
            at = self.target.rim(x)[0]
            meets = np.linalg.norm(at - x, axis=1, keepdims=True) <= reach
            meets &= ~np.isin(wall.rows, self.edge)[:, None]
            x = np.where(meets, at, x)
            off, _, normals = _beyond(x, wall)
        return x - np.sign(off) * np.maximum(np.abs(off) - reach, 0.0) * normals


def _beyond(x: FloatArray, wall: Wall) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how far points (r, d) are off a wall, and beyond its end, (r, 1), and its normals."""
    at, normals = wall.nearest(x)
    off = _dots(x - at, normals)[:, None]
    return off, np.linalg.norm(x - at - off * normals, axis=1, keepdims=True), normals


def _fit(points: FloatArray, guide: _Guide) -> FloatArray:
    """Return the points moved by the quadratic polynomial that takes them nearest to the target."""
    k, dim = points.shape
    x = (points - points.mean(axis=0)) / np.ptp(points, axis=0).max()
    pairs = combinations_with_replacement(range(dim), 2)
    terms = np.stack([np.ones(k), *x.T, *(x[:, i] * x[:, j] for i, j in pairs)], axis=1)
    moved, before = points, np.zeros(terms.shape[1] * dim)
    for _ in range(FITS):
        rows, directions, ways, weights = guide.conditions(moved)
        use = weights > 0.0
        matrix = (terms[rows, :, None] * directions[:, None, :]).reshape(len(rows), -1)[use]
        damping = DAMPING * max(len(matrix), 1) / matrix.shape[1]
        equations = matrix.T @ matrix + damping * np.eye(matrix.shape[1])
        before = np.linalg.solve(equations, matrix.T @ (ways[use] + matrix @ before))
        moved = points + terms @ before.reshape(-1, dim)
    return moved


def _bending(points: FloatArray, facets: IntArray) -> csr_array:
    """Return the square of the graph's Laplacian, for each component: (k d, k d).

    Edges weigh as the inverse of their lengths, and the weights of a node are 1 together.
    """
    from scipy.sparse import coo_array, diags_array, kron

    one, two = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    edges = np.sort(np.stack([one, two], axis=1)[one != two], axis=1)
    one, two = np.unique(edges, axis=0).T
    k, weights = len(points), 1.0 / np.linalg.norm(points[one] - points[two], axis=1)
    links = coo_array((weights, (one, two)), (k, k)).tocsr()
    links = links + links.T
    laplacian = diags_array(np.ones(k)) - diags_array(1.0 / links.sum(axis=1)) @ links
    return kron(laplacian.T @ laplacian, np.eye(points.shape[1]), format="csr")


def _dots(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the scalar products (m,) of vectors (m, d)."""
    return np.einsum("md,md->m", one, other)
