"""Structured grids, whose points and cells are computed from their numbers.

Any part of such a mesh can be made without the rest, so that its file can be larger than memory.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import CaseError
from slideviz.formats.su2b.write import ZoneContent
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh

LINE, QUADRILATERAL, HEXAHEDRON = 3, 9, 12
"""VTK identifiers."""
LARGEST = 200_000_000
"""Most cells of a mesh that is written block by block."""


class Structured(Protocol):
    """A grid of quadrilaterals (2D) or hexahedra (3D), parts of which are computed on demand."""

    @property
    def dim(self) -> int:
        """Return 2 or 3."""

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""

    def points(self, nodes: IntArray) -> FloatArray:
        """Return the coordinates (k, d) of nodes (k,)."""

    def cells(self, ids: IntArray) -> IntArray:
        """Return the nodes (k, 4) in 2D, (k, 8) in 3D, of cells (k,)."""

    def markers(self) -> tuple[Marker, ...]:
        """Return the boundaries."""


def mesh_of(grid: Structured, name: str) -> Mesh:
    """Return the whole mesh of a grid."""
    cells = Cells.from_blocks([(_element(grid), grid.cells(np.arange(grid.n_cells)))])
    return Mesh(grid.points(np.arange(grid.n_points)), cells, grid.markers(), name=name)


def zone_of(grid: Structured) -> ZoneContent:
    """Return the zone of a grid's mesh, to be written to a file block by block.

    Raises
    ------
    CaseError
        The mesh has more than ``LARGEST`` cells.
    """
    if grid.n_cells > LARGEST:
        raise CaseError(f"{grid.n_cells} cells are too many; a sample has {LARGEST} at most")

    def types(i: int, j: int) -> NDArray[np.uint8]:
        return np.full(j - i, _element(grid), np.uint8)

    def cells(i: int, j: int) -> tuple[NDArray[np.uint8], IntArray, IntArray]:
        ids = np.arange(i, j)
        return types(i, j), grid.cells(ids).ravel(), ids

    return ZoneContent(
        dim=grid.dim,
        n_cells=grid.n_cells,
        n_points=grid.n_points,
        cells=cells,
        types=types,
        points=lambda i, j: grid.points(np.arange(i, j)),
        markers=grid.markers(),
    )


def _element(grid: Structured) -> int:
    """Return the VTK identifier of the cells."""
    return QUADRILATERAL if grid.dim == 2 else HEXAHEDRON
