"""The sample ``turbine-row``, a linear supersonic cascade (thesis section 4.1.3), flat and in 3D.

A layer of quadrilaterals lies around the vane, and triangles fill the rest of the channel. The
meshes are files; ``tools/study/vane_mesh.py`` made them, and makes that of the thesis.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, IntArray, Marker, Mesh

LINE = 3  # VTK identifiers
TRIANGLE = 5
QUADRILATERAL = 9
HEXAHEDRON = 12
PRISM = 13
SIZES = (5_000, 20_000)  # the numbers of cells of the files
SPAN = 0.0465  # length of the vane from hub to shroud in 3D
SIZES_3D = (10_000, 200_000)  # least and largest number of cells in 3D


def row_mesh(size: int) -> Mesh:
    """Return the mesh of ``turbine-row``; raise CaseError if ``size`` is not one of ``SIZES``."""
    if size not in SIZES:
        sizes = " or ".join(map(str, SIZES))
        raise CaseError(f"there is no turbine row of {size} cells; use {sizes}")
    with np.load(Path(__file__).with_name(f"turbine_row_{size}.npz")) as file:
        arrays = dict(file)
    points = arrays.pop("points")
    blocks = [(QUADRILATERAL, arrays.pop("quads")), (TRIANGLE, arrays.pop("triangles"))]
    cells = Cells.from_blocks(blocks)
    markers = [Marker(name, Cells.from_blocks([(LINE, side)])) for name, side in arrays.items()]
    return Mesh(points, cells, tuple(markers), name="turbine-row")


def extruded_row(size: int) -> Mesh:
    """Return the mesh of the sample ``turbine-row-3d``, of about ``size`` cells.

    Raises CaseError if ``size`` is not within ``SIZES_3D``.
    """
    low, high = SIZES_3D
    if not low <= size <= high:
        raise CaseError(f"size {size} is out of range; a turbine row in 3D has {low} to {high}")
    return extruded(row_mesh(SIZES[0]), round(size / SIZES[0]))


def extruded(flat: Mesh, levels: int) -> Mesh:
    """Return a mesh of ``turbine-row`` from hub to shroud, along z: hexahedra and prisms."""
    count = len(flat.points)
    z = np.linspace(0.0, SPAN, levels + 1)
    points = np.column_stack([np.tile(flat.points, (levels + 1, 1)), np.repeat(z, count)])
    shift = count * np.arange(levels)[:, None, None]

    def stacked(nodes: IntArray, order: slice) -> IntArray:
        column = np.concatenate([nodes, nodes[:, order] + count], axis=1)
        return (column + shift).reshape(-1, column.shape[1])

    plane = {vtk: nodes for vtk, (_, nodes) in flat.cells.by_type.items()}
    solids = {QUADRILATERAL: HEXAHEDRON, TRIANGLE: PRISM}
    blocks = [(solids[vtk], stacked(nodes, slice(None))) for vtk, nodes in plane.items()]
    ends = {
        "HUB": [(vtk, nodes[:, ::-1]) for vtk, nodes in plane.items()],
        "SHROUD": [(vtk, nodes + levels * count) for vtk, nodes in plane.items()],
    }
    strips = {
        marker.name: [
            (QUADRILATERAL, stacked(marker.cells.by_type[LINE][1], slice(None, None, -1)))
        ]
        for marker in flat.markers
    }
    markers = [Marker(name, Cells.from_blocks(b)) for name, b in (strips | ends).items()]
    return Mesh(points, Cells.from_blocks(blocks), tuple(markers), name="turbine-row-3d")
