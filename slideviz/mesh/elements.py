"""The element types of SU2 (VTK numbering), one row each.

Facets are listed with outward normals for a cell of positive volume; ``corners`` lists, for
every corner Jacobian of the quality metric, the corner and its neighbours in right-handed
order (thesis Eq. 2.39 to 2.42 and Table 2.3). A triangle and a tetrahedron need only one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.argument_types import frozen
from slideviz.system.tables import table_beside

Nodes = Sequence[Sequence[int]]
"""Local nodes of the sides, edges or corners of an element type."""


@frozen
class ElementType:
    """One element type."""

    vtk: int
    """The identifier in VTK and SU2 files."""
    name: str
    """Singular English name."""
    n_nodes: int
    dim: int
    """`n_nodes`, `dim`: number of nodes, dimension (0 for a vertex to 3)."""
    facets: Nodes = ()
    """Local nodes of each side (dimension ``dim - 1``), with outward normal."""
    edges: Nodes = ()
    """Local nodes of each edge."""
    corners: Nodes = ()
    """``(k, a, b[, c])``: local nodes of the corner and its neighbours, right-handed; empty for
    vertex and line."""


ELEMENTS: dict[int, ElementType] = {
    row["vtk"]: ElementType(name=name, **row) for name, row in table_beside(__file__).items()
}
"""Element type by VTK identifier; the table is ``elements.toml``."""

CELL_NAMES = {vtk: row.name for vtk, row in ELEMENTS.items()} | {7: "polygon", 42: "polyhedron"}
"""Names of the types of cells that files have, by VTK identifier."""

SIZES = np.zeros(256, np.int64)
DIMS = np.zeros(256, np.int64)
"""Number of nodes and dimension of an element type, by VTK identifier; 0 where there is no type."""
for _row in ELEMENTS.values():
    SIZES[_row.vtk] = _row.n_nodes
    DIMS[_row.vtk] = _row.dim
