"""The simplices of a surface in space: distances from them, and which sides they part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.boxes import BoxTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slideviz.mesh.model import FloatArray, IntArray
    from slideviz.mesh.simplices import Surface

ANGLE = 1e-6
"""A direction that is off a simplex by less than this angle, in radians, lies in it."""


@dataclass(frozen=True, eq=False)
class Planes:
    """A surface at some points, with its search tree.

    Attributes
    ----------
    corners : (s, d, d) float64
        The corners of the simplices.
    normals : (s, d) float64
        Unit normals; not a number where a simplex is flat, so that nothing meets it.
    inwards : (s, d, d) float64
        For each corner the unit normal, within the simplex, of the side that begins there.
    tree : BoxTree
        The boxes around the simplices.
    margin : float
        What is as near as this lies on the surface.
    """

    corners: FloatArray
    normals: FloatArray
    inwards: FloatArray
    tree: BoxTree
    margin: float

    @classmethod
    def of(cls, points: FloatArray, surface: Surface, margin: float) -> Planes:
        """Return the planes of a surface that is not empty, with its nodes at ``points``."""
        corners = points[surface.nodes]
        sides = np.roll(corners, -1, axis=1) - corners
        upright = normals(corners)
        inwards = np.cross(upright[:, None], sides) if corners.shape[2] == 3 else sides
        tree = BoxTree.of(corners.min(axis=1), corners.max(axis=1))
        return cls(corners, upright, _unit(inwards), tree, margin)

    def near(self, corners: FloatArray, axes: FloatArray) -> tuple[IntArray, IntArray]:
        """Return sorted pairs of a query and a simplex that may touch (see `BoxTree.near`)."""
        i, j = self.tree.near(corners, axes, self.margin)
        order = np.lexsort((j, i))
        return i[order], j[order]

    def heights(self, x: FloatArray, j: IntArray) -> FloatArray:
        """Return signed distances (p, k) of points (p, k, d) from the planes ``j`` (p,)."""
        return np.einsum("pkd,pd->pk", x - self.corners[j, :1], self.normals[j])

    def depths(self, x: FloatArray, j: IntArray) -> FloatArray:
        """Return how far (p, d) points (p, d) of the planes ``j`` are inside each side."""
        return np.einsum("pkd,pkd->pk", x[:, None] - self.corners[j], self.inwards[j])

    def part(self, x: FloatArray, near: IntArray, ends: FloatArray) -> bool:
        """Tell whether the surface around a point of it parts ``ends`` from each other.

        Close to ``x`` the surface is a fan of simplices, a cone, and each of them a plane, half
        a plane or a wedge. Two directions lie on different sides of a fan that is closed around
        ``x`` where a path between them crosses it an odd number of times. The paths go by way of
        each of several fixed directions; around an open border they disagree.

        Parameters
        ----------
        x : (d,)
            A point on the surface.
        near : (p,)
            The simplices among which are those that hold ``x``.
        ends : (r, d)
            Other points, which give directions only. One along the surface is on neither side.
        """
        here = np.broadcast_to(x, (len(near), len(x)))
        depth = self.depths(here, near)
        fan = (np.abs(self.heights(here[:, None], near)[:, 0]) <= self.margin) & (
            depth >= -self.margin
        ).all(axis=1)
        inner = (depth > self.margin)[fan]
        normal, inward = self.normals[near[fan]], self.inwards[near[fan]]
        way = _unit(ends - x)
        height, side = way @ normal.T, np.einsum("rd,fkd->rfk", way, inward)
        along = (np.abs(height) <= ANGLE) & (inner | (side >= -ANGLE)).all(axis=2)
        height, side = height[~along.any(axis=1)], side[~along.any(axis=1)]
        if len(height) < 2:
            return False
        via = _VIA[len(x)]
        turn, swing = via @ normal.T, np.einsum("vd,fkd->vfk", via, inward)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = height[:, None] / (height[:, None] - turn)
        at = side[:, None] + share[..., None] * (swing - side[:, None])
        crosses = (height[:, None] * turn < 0) & (inner | (at > 0)).all(axis=3)
        odd = crosses.sum(axis=2) % 2 == 1
        return bool((odd != odd[0]).all(axis=1).any())


def normals(corners: FloatArray) -> FloatArray:
    """Return unit normals (s, d) of simplices (s, d, d); not a number where one is flat."""
    side = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        return _unit(np.stack((-side[:, 0, 1], side[:, 0, 0]), axis=1))
    return _unit(np.cross(side[:, 0], side[:, 1]))


def line_normals(ways: FloatArray) -> FloatArray:
    """Return unit vectors (w, c, d) normal to lines (w, 2, d): one in 2D, three in 3D."""
    if ways.shape[2] == 2:
        return normals(ways)[:, None]
    return _unit(np.cross((ways[:, 1] - ways[:, 0])[:, None], np.eye(3)))


def _unit(vectors: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# Directions that are special to no mesh, spread over all sides.
_VIA: dict[int, NDArray[np.float64]] = {
    d: _unit(np.random.default_rng(7).normal(size=(8, d))) for d in (2, 3)
}
