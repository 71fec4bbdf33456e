"""Rims: nodes that moving boundaries share with walls, put back on these, with the rows beside.

A rim goes to the closest point of its wall, or of all its walls at once where several meet. The
other nodes of its body, a connected part of the moving boundaries, follow smoothly: they take the
correction of the rim, continued harmonically over the body, times a share. The share falls from 1
at the rim to 0 at the nodes farthest from it, with a slope of 0 at both: so the rows beside the rim
go with it nearly as they are, and what is far from all walls has the motion that is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import (
    FloatArray,
    IntArray,
    largest_coordinate,
    largest_size,
    places_in,
    row_dots,
    row_norms,
)
from slideviz.mesh.topology import TINY, unit, vertex_normals
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.frames import Frame
from slideviz.rbf.projection import projection_matrices, simplex_vectors
from slideviz.rbf.tape import (
    Array,
    Variable,
    linear,
    over_columns,
    placed,
    summed,
    sums,
    take,
    transform,
    value,
)

ROUNDING = 1e-13
"""Part of the largest coordinate by which a rim may be off its wall and stays where it is: so a
motion along the wall changes no bit."""
ROUNDS = 30  # most steps to where several walls meet; on flat ones the first gets there
ENOUGH = 1e-15  # part of the largest coordinate: a shorter step is the last one
PARALLEL = 1e-6  # walls count as one where the sine of the angle between them is below this
STEEPEST = 1e6  # largest weight of the side of a triangle, where its opposite angle is very thin
BULGE = 0.25
"""Distance of a smooth wall from an edge of its facets, over the edge times the difference of the
normals at its ends: twice the 1/8 of an arc, since normals at nodes are estimates."""


@record
class FlatWall:
    """A plane, in 2D a line, which goes on beyond its boundary."""

    names: tuple[str, ...]  # its boundaries that have the nodes
    rows: IntArray  # (k,): these nodes, as places in the rim
    point: FloatArray
    normal: FloatArray
    """`point`, `normal` (d,): of the plane."""
    bulge: float = 0.0

    def closest(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the feet of nodes at (k, d), and their derivatives (k, d, d)."""
        slopes = np.eye(len(self.normal)) - np.outer(self.normal, self.normal)
        return self.across(positions), np.broadcast_to(slopes, (len(positions), *slopes.shape))

    def across(self, positions: FloatArray) -> FloatArray:
        """Return the feet (k, d) of nodes at (k, d)."""
        return positions - ((positions - self.point) @ self.normal)[:, None] * self.normal


@record
class CurvedWall:
    """Facets that go on flat beyond the rim."""

    names: tuple[str, ...]  # its boundaries that have the nodes
    rows: IntArray  # (k,): these nodes, as places in the rim
    coords: FloatArray
    facets: IntArray
    """`coords`, `facets` (u, d), (f, k): its nodes, and its facets among them."""
    simplices: FloatArray  # (s, c, d): of the facets, which may differ in them on an axis
    shift: FloatArray | None  # (d,): the period by which it goes on
    ends: FloatArray  # (e, c - 1, d): sides of simplices at the rim

    @cached_property
    def bulge(self) -> float:
        """Return how far nodes on it may be off its facets."""
        return bulge_of(self.coords, self.facets)

    @cached_property
    def _surface(self) -> ClosestPoints:
        return ClosestPoints(self.simplices, self.shift, self.ends)

    def closest(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closest points of nodes at (k, d), and their derivatives (k, d, d)."""
        closest, which = self._surface.nearest(positions)
        return closest, projection_matrices(self._surface.simplices(which), positions, closest)

    def across(self, positions: FloatArray) -> FloatArray:
        """Return the feet (k, d) of nodes at (k, d) on the planes of the facets closest to them."""
        closest, which = self._surface.nearest(positions)
        normals = unit(simplex_vectors(self._surface.simplices(which)))
        return positions - row_dots(positions - closest, normals)[:, None] * normals


RimWall = FlatWall | CurvedWall
"""A smooth surface, in 2D a curve, that nodes of a rim are on."""


@record
class FrozenRim:
    """Where a rim is at a reference, and its closest points on the walls, linear around it."""

    at: FloatArray
    closest: FloatArray
    """`at`, `closest` (r, d)."""
    slopes: FloatArray  # (r, d, d): of the closest points by ``at``


Keep = Callable[[Callable[[], FrozenRim]], FrozenRim]
"""Returns what its argument returned when it was called first."""


@record
class Bodies:
    """The connected moving boundaries that have rims, as a graph; periodic images are one place."""

    edges: IntArray  # (e, 2): places
    weights: FloatArray  # (e,): of the edges in the Laplacian
    rim: IntArray  # (r,): the places of the rim
    share: FloatArray  # (b,): of the correction that each place takes

    @cached_property
    def inner(self) -> IntArray:
        """Return the places (i,) that are not in the rim."""
        return np.setdiff1d(np.arange(len(self.share)), self.rim)

    @cached_property
    def _harmonic(self) -> tuple[Callable[[FloatArray], FloatArray], Any]:
        """Return the inverse of the Laplacian at the inner places, and its columns of the rim."""
        # Late: scipy.sparse takes 0.1 s.
        from scipy.sparse import coo_array, diags_array
        from scipy.sparse.linalg import splu

        count = len(self.share)
        one, two = self.edges.T
        links = coo_array((self.weights, (one, two)), (count, count)).tocsr()
        links = links + links.T
        rows = (diags_array(links.sum(axis=1)) - links).tocsr()[self.inner]
        # Symmetric, positive definite: no pivots, and the order of least degree.
        factor = splu(
            rows[:, self.inner].tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return factor.solve, rows[:, self.rim]

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: not the factor, which is computed again."""
        return {name: part for name, part in self.__dict__.items() if name != "_harmonic"}

    def prepare(self) -> None:
        """Compute what `spread` keeps."""
        self.spread(np.ones((len(self.rim), 1)))

    def spread(self, of_rim: FloatArray) -> FloatArray:
        """Return the correction (..., b, d) of all places, of that of the rim (..., r, d)."""
        out = placed(of_rim, self.rim, len(self.share))
        if len(self.inner) and of_rim.any():
            solve, columns = self._harmonic
            inner = over_columns(lambda x: solve(-(columns @ x)), of_rim)
            out[..., self.inner, :] = self.share[self.inner, None] * inner
        return out

    def gathered(self, adjoint: FloatArray) -> FloatArray:
        """Return the transpose of `spread`, (..., r, d), of an adjoint (..., b, d)."""
        out = adjoint[..., self.rim, :]
        if len(self.inner):
            solve, columns = self._harmonic
            inner = self.share[self.inner, None] * adjoint[..., self.inner, :]
            out = out - over_columns(lambda x: columns.T @ solve(x), inner)
        return out


@record
class Rims:
    """The rims of all moving nodes, in a frame.

    Of periodic images only the one that represents them is in a rim; all have its correction.
    """

    frame: Frame
    nodes: IntArray  # (m,): the moving nodes, ascending
    start: FloatArray  # (m, d): their undeformed coordinates
    representative: IntArray  # (m,): for each the place of the one that represents its images
    rim: IntArray  # (r,): those of the rim, as places among them
    walls: tuple[RimWall, ...]
    bodies: Bodies | None
    """By which rims are put back on their walls (RIMS= SLIDE); None: they are where they are."""
    place: IntArray  # (m,): the place of each in the bodies; -1: its body has no rim

    @cached_property
    def walls_of(self) -> IntArray:
        """Return the number of walls of each node of the rim, (r,)."""
        rows = np.concatenate([wall.rows for wall in self.walls])
        return np.bincount(rows, minlength=len(self.rim))

    def off(self, wall: RimWall, points: FloatArray) -> FloatArray:
        """Return the distances (k,) of the nodes of a wall from it, now at Cartesian points (k, d).

        Of those that are on other walls, too, from the plane of the wall: where they leave
        another, this one ends.
        """
        positions = self.frame.coords(points)
        corner = self.walls_of[wall.rows] > 1
        there = np.where(corner[:, None], wall.across(positions), wall.closest(positions)[0])
        return row_norms(self.frame.points(there) - points)

    @property
    def least(self) -> float:
        """Return the length up to which a correction is rounding."""
        return ROUNDING * largest_coordinate(self.start)

    def projected(self, positions: Array, keep: Keep | None = None) -> Array:
        """Return the coordinates (..., m, d) of the moving nodes with their rims on the walls.

        ``positions`` (..., m, d): where they would be without. ``keep``: of derivatives.
        """
        if self.bodies is None:
            return positions
        here = take(positions, self.rim)
        if keep is None:
            off: Array = self.closest(value(here))[0] - value(here)
        else:
            frozen = keep(lambda: FrozenRim(value(here), *self.closest(value(here))))
            moved = here - frozen.at
            off = transform(frozen.slopes, moved) - moved + (frozen.closest - frozen.at)
        exact = value(off)
        exact = np.where(np.abs(exact).max(axis=-1, keepdims=True) <= self.least, 0.0, exact)
        if isinstance(off, Variable):
            off = Variable(exact, off.tape, off.place)
        elif not exact.any():
            return positions
        else:
            off = exact
        more = self._spread(self.bodies, off)
        x = value(positions)
        by = value(more)
        # Adding zero would turn -0.0 into 0.0.
        return summed(np.where(by == 0.0, x, x + by), positions, more)

    def _spread(self, bodies: Bodies, of_rim: Array) -> Array:
        there = np.flatnonzero(self.place >= 0)
        place = self.place[there]
        count = len(self.place)
        size = len(bodies.share)

        def spread(x: FloatArray) -> FloatArray:
            return placed(bodies.spread(x)[..., place, :], there, count)

        def gathered(g: FloatArray) -> FloatArray:
            return bodies.gathered(sums(g[..., there, :], place, size))

        return linear(of_rim, spread, gathered)

    def closest(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closest points (r, d) on the walls, and their derivatives (r, d, d).

        ``positions`` (r, d): coordinates of the rim. Where several walls meet, Newton's method goes
        to a point that is on all of them: each time to the closest one of their tangent planes.
        """
        count, dim = positions.shape
        closest = positions.copy()
        slopes = np.zeros((count, dim, dim))
        for wall in self.walls:
            rows = wall.rows[self.walls_of[wall.rows] == 1]
            closest[rows], slopes[rows] = wall.closest(positions[rows])
        corners = np.flatnonzero(self.walls_of > 1)
        enough = ENOUGH * largest_coordinate(self.start)
        for _ in range(ROUNDS if len(corners) else 0):
            across, ways = self._across(closest)
            across = across[corners]
            ways = ways[corners]
            inverse = np.linalg.pinv(across, rcond=PARALLEL)
            step = np.einsum("cdq,cq->cd", inverse, ways)
            closest[corners] += step
            slopes[corners] = np.eye(dim) - inverse @ across
            if np.abs(step).max() <= enough:
                break
        return closest, slopes

    def _across(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return for nodes of several walls the parts of a step across them, and those needed.

        They are (r, q, d) and (r, q), zero where a node has fewer walls than others, or one.
        """
        count, dim = positions.shape
        across = np.zeros((count, int(self.walls_of.max()), dim, dim))
        ways = np.zeros(across.shape[:3])
        filled = np.zeros(count, np.int64)
        for wall in self.walls:
            rows = wall.rows[self.walls_of[wall.rows] > 1]
            closest, slopes = wall.closest(positions[rows])
            across[rows, filled[rows]] = np.eye(dim) - slopes
            ways[rows, filled[rows]] = closest - positions[rows]
            filled[rows] += 1
        return across.reshape(count, -1, dim), ways.reshape(count, -1)

    def displaced(self, nodes: IntArray, points: FloatArray, vectors: FloatArray) -> FloatArray:
        """Return Cartesian displacements (k, d) after which rims are on their walls.

        ``nodes`` (k,): of those that move, ``points`` (k, d) undeformed and Cartesian.
        ``vectors`` (k, d): their displacements; images that are not among them move alike.
        """
        place = places_in(self.nodes, nodes)
        rows = np.flatnonzero(place >= 0)[::-1]  # of images the first one counts
        shift = np.zeros_like(self.start)
        shift[self.representative[place[rows]]] = self.frame.difference(points[rows], vectors[rows])
        positions = self.start + shift[self.representative]
        now = value(self.projected(positions))
        rows = rows[(now != positions)[place[rows]].any(axis=1)]
        out = vectors.copy()
        change = place[rows]
        out[rows] += self.frame.points(now[change]) - self.frame.points(positions[change])
        return out


def bulge_of(coords: FloatArray, facets: IntArray) -> float:
    """Return how far a smooth surface through nodes (n, d) may be off its facets (f, k)."""
    nodes, normals = vertex_normals(coords, facets)
    one = facets.ravel()
    two = np.roll(facets, -1, axis=1).ravel()
    at_nodes = unit(normals)
    first = at_nodes[np.searchsorted(nodes, one)]
    second = at_nodes[np.searchsorted(nodes, two)]
    off = row_dots(coords[two] - coords[one], second - first)
    return BULGE * largest_size(off)


def side_weights(points: FloatArray, facets: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the edges (e, 2) of facets (f, k), and their weights (e,) in a Laplacian.

    ``points`` (n, d), Cartesian. In 2D an edge weighs as the inverse of its length, in 3D as half
    the cotangent of the angle opposite to it in a triangle, if that is positive (U. Pinkall and
    K. Polthier, Computing discrete minimal surfaces and their conjugates, 1993). A quadrilateral is
    the mean of both its divisions into triangles. Edges occur once for each triangle.
    """
    if facets.shape[1] == 2:
        length = row_norms(points[facets[:, 1]] - points[facets[:, 0]])
        return facets, 1.0 / np.maximum(length, TINY)
    quads = facets[:, 2] != facets[:, 3]
    halves = [np.roll(facets[quads], -k, axis=1)[:, :3] for k in range(4)]
    triangles = np.concatenate([facets[~quads, :3], *halves])
    parts = np.where(np.arange(len(triangles)) < np.count_nonzero(~quads), 0.5, 0.25)
    edges = []
    weights = []
    for k in range(3):
        tip, one, two = np.roll(triangles, -k, axis=1).T
        a = points[one] - points[tip]
        b = points[two] - points[tip]
        sine = np.maximum(row_norms(np.cross(a, b)), TINY)
        cotangent = row_dots(a, b) / sine
        edges.append(np.stack([one, two], axis=1))
        weights.append(parts * np.clip(cotangent, 0.0, STEEPEST))
    return np.concatenate(edges), np.concatenate(weights)
