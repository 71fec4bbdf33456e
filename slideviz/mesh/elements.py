"""The element types of SU2 (VTK numbering), one row each.

Facets are listed with outward normals for a cell of positive volume; ``corners`` lists, for
every corner Jacobian of the quality metric, the corner and its neighbours in right-handed
order (thesis Eq. 2.39 to 2.42 and Table 2.3). A triangle and a tetrahedron need only one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ElementType:
    """One element type."""

    vtk: int
    """The identifier in VTK and SU2 files."""
    name: str
    """Singular English name."""
    n_nodes: int
    dim: int
    """`n_nodes`, `dim`: number of nodes, dimension (0 for a vertex to 3)."""
    facets: tuple[tuple[int, ...], ...] = ()
    """Local nodes of each side (dimension ``dim - 1``), with outward normal."""
    edges: tuple[tuple[int, int], ...] = ()
    """Local nodes of each edge."""
    corners: tuple[tuple[int, ...], ...] = ()
    """``(k, a, b[, c])``: local nodes of the corner and its neighbours, right-handed; empty for
    vertex and line."""


_ROWS = (
    ElementType(1, "vertex", 1, 0),
    ElementType(3, "line", 2, 1, ((0,), (1,)), ((0, 1),)),
    ElementType(
        5, "triangle", 3, 2, ((0, 1), (1, 2), (2, 0)), ((0, 1), (1, 2), (2, 0)), ((0, 1, 2),)
    ),
    ElementType(
        9,
        "quadrilateral",
        4,
        2,
        ((0, 1), (1, 2), (2, 3), (3, 0)),
        ((0, 1), (1, 2), (2, 3), (3, 0)),
        ((0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)),
    ),
    ElementType(
        10,
        "tetrahedron",
        4,
        3,
        ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
        ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
        ((0, 1, 2, 3),),
    ),
    ElementType(
        12,
        "hexahedron",
        8,
        3,
        ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
        (
            *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
            *((0, 4), (1, 5), (2, 6), (3, 7)),
        ),
        (
            *((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7)),
            *((4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)),
        ),
    ),
    ElementType(
        13,
        "prism",
        6,
        3,
        ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
        ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
    ),
    ElementType(
        14,
        "pyramid",
        5,
        3,
        ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
        ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
        ((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
    ),
)

ELEMENTS: dict[int, ElementType] = {row.vtk: row for row in _ROWS}  # element type by VTK identifier

SIZES = np.zeros(256, np.int64)
DIMS = np.zeros(256, np.int64)
"""Number of nodes and dimension of an element type, by VTK identifier; 0 where there is no type."""
for _row in _ROWS:
    SIZES[_row.vtk] = _row.n_nodes
    DIMS[_row.vtk] = _row.dim
