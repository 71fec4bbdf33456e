"""Find out whether two boundaries pass through each other.

A mesh whose boundaries cross cannot be deformed into a valid one, whatever the method; so this
is asked before the deformation, of the moved boundary alone.

Touching is not crossing: what goes into another boundary by no more than ``TOLERANCE`` of the
extent counts as lying on it. So boundaries that coincide (the two sides of a thin plate) or
rest on one another are not reported. Where the moved boundary hangs on the other one because
they share nodes, the facets of both that hold these nodes are not tested: those of the moved
one lie on the other's surface only roughly, and those of the other are stretched until its
remaining nodes have followed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.piercing import pierced, swept
from slideviz.mesh.planes import Planes
from slideviz.mesh.simplices import Surface

if TYPE_CHECKING:
    from collections.abc import Sequence

    from slideviz.mesh.model import Cells, FloatArray

TOLERANCE = 1e-8
"""Depth, as a share of the largest extent of both boundaries, up to which they only touch."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """Where the moved boundary goes through another.

    Attributes
    ----------
    marker : str
        Name of the other boundary.
    point : (d,) float64
        A point of both.
    facet, other_facet : int
        The two elements, counted from 0 in the moved and in the other boundary.
    """

    marker: str
    point: FloatArray
    facet: int
    other_facet: int


def first_crossing(
    points: FloatArray, moved: Cells, others: Sequence[tuple[str, Cells]]
) -> Crossing | None:
    """Return where the moved boundary goes through the first of the others, or None.

    Parameters
    ----------
    points : (n, d) float64
        All points of the mesh, those of the moved boundary at their new place.
    moved : Cells
        Its elements: lines in 2D, triangles and quadrilaterals (as two triangles) in 3D.
    others : sequence of (str, Cells)
        The other boundaries by name. Leave out those that will move along, such as periodic
        ones with periodic displacement: their place in ``points`` is the old one.

    Raises
    ------
    MeshError
        An element has another dimension than a boundary.
    """
    points = np.asarray(points, np.float64)
    body = Surface.of(moved, points.shape[1])
    for name, cells in others:
        wall = Surface.of(cells, points.shape[1]).without(moved.nodes)
        free = body.without(cells.nodes)
        margin = _margin(points, free, wall)
        hit = pierced(points, free, wall, margin)
        if hit is None and (back := pierced(points, wall, free, margin)) is not None:
            hit = back[0], back[2], back[1]
        if hit is not None:
            return Crossing(name, *hit)
    return None


def swept_crossing(
    before: FloatArray, after: FloatArray, moved: Cells, others: Sequence[tuple[str, Cells]]
) -> Crossing | None:
    """Return where a node of the moved boundary goes through another on its way, or None.

    The way is straight, as the steps of a deformation divide it; so a body is found that has
    jumped over a wall. Facets of the others that move themselves are not tested. For a curved
    way ask piece by piece.

    Parameters
    ----------
    before, after : (n, d) float64
        All points of the mesh, before and after the motion.
    moved, others
        As in `first_crossing`.

    Raises
    ------
    MeshError
        An element has another dimension than a boundary.
    """
    before, after = np.asarray(before, np.float64), np.asarray(after, np.float64)
    going = np.flatnonzero((before != after).any(axis=1))
    body = Surface.of(moved, after.shape[1])
    for name, cells in others:
        wall = Surface.of(cells, after.shape[1]).without(going)
        free = body.without(cells.nodes)
        nodes = np.intersect1d(free.nodes, going)
        if not (len(nodes) and len(wall)):
            continue
        margin = max(_margin(before, free, wall), _margin(after, free, wall))
        hit = swept(np.stack((before[nodes], after[nodes]), axis=1), Planes.of(after, wall, margin))
        if hit is not None:
            point, k, other = hit
            facet = free.facet[(free.nodes == nodes[k]).any(axis=1).argmax()]
            return Crossing(name, point, int(facet), int(wall.facet[other]))
    return None


def _margin(points: FloatArray, a: Surface, b: Surface) -> float:
    """Return ``TOLERANCE`` as a length."""
    used = points[np.concatenate((a.nodes, b.nodes)).ravel()]
    return TOLERANCE * float(np.ptp(used, axis=0).max()) if len(used) else 0.0
