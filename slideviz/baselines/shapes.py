"""Shape functions of SU2's element types at integration points, from scikit-fem.

Triangles and tetrahedra have one integration point, quadrilaterals four, prisms six and
hexahedra eight, as in SU2's mesh deformation. scikit-fem has no linear pyramid, and no pyramid
has shape functions with polynomial gradients: a pyramid is the mean of its two divisions into two
tetrahedra, so that its four base corners are treated alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from slideviz.mesh.model import Cells, FloatArray, IntArray, frozen_array

PYRAMID = 14
TETRAHEDRON = 10
PYRAMID_PARTS = ((0, 1, 2, 4), (0, 2, 3, 4), (0, 1, 3, 4), (1, 2, 3, 4))
"""The tetrahedra of both divisions of a pyramid, by its corners; each counts half."""

_CORNERS = {
    5: ((0, 0), (1, 0), (0, 1)),
    9: ((0, 0), (1, 0), (1, 1), (0, 1)),
    10: ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    12: (
        *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
        *((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
    ),
    13: ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
}
"""The corners of the reference elements in the order of SU2's (VTK's) nodes."""

_ORDER = {5: 1, 9: 2, 10: 1, 12: 2}
"""Degree of the polynomials that the integration rule integrates exactly."""


@dataclass(frozen=True, eq=False)
class ReferenceShape:
    """A reference element."""

    gradients: FloatArray
    """(q, a, d): of the a shape functions, at q integration points, in the reference element."""
    weights: FloatArray
    """(q,): of the integration points; their sum is the reference element's volume."""


@cache
def shape(vtk: int) -> ReferenceShape:
    """Return the shape functions of a VTK element type, in the order of SU2's nodes."""
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
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefLine, RefTri

    if vtk in _ORDER:
        x, weights = get_quadrature(element, _ORDER[vtk])
        return np.asarray(x), np.asarray(weights)
    # A prism: triangle times line. scikit-fem's own rule for it has its centre at x = 1/2.
    (flat, area), (height, length) = get_quadrature(RefTri, 2), get_quadrature(RefLine, 2)
    x = np.concatenate([np.repeat(flat, len(length), axis=1), np.tile(height, len(area))])
    return x, np.repeat(area, len(length)) * np.tile(length, len(area))


@dataclass(frozen=True, eq=False)
class ShapeBlock:
    """The elements of a mesh that have one shape."""

    shape: ReferenceShape
    nodes: IntArray
    """(m, a)."""
    cell: IntArray
    """(m,): the cell of the mesh that each element is (a part of)."""
    share: float
    """Weight of each element: 1, or 1/2 for the parts of pyramids."""


def blocks(cells: Cells) -> list[ShapeBlock]:
    """Return all cells as elements, a block for each type; pyramids as parts of tetrahedra."""
    found = []
    for vtk, (ids, nodes) in cells.by_type.items():
        if vtk == PYRAMID:
            # Read-only like the mesh's own, for which the loops are compiled.
            parts = frozen_array(np.concatenate([nodes[:, p] for p in PYRAMID_PARTS]), np.int64)
            found.append(
                ShapeBlock(shape(TETRAHEDRON), parts, np.tile(ids, len(PYRAMID_PARTS)), 0.5)
            )
        else:
            found.append(ShapeBlock(shape(vtk), nodes, ids, 1.0))
    return found
