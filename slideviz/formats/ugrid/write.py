"""Writing UGRID: numbers of 4 and 8 bytes, big-endian (``.b8.ugrid``) or little (``.lb8.ugrid``).

The order of the parts is that of the page "AFLR3 Grid File Format": counts, points, nodes of
triangles and quadrilaterals, numbers of their boundaries, tetrahedra, pyramids, prisms, hexahedra.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slideviz.errors import path_error
from slideviz.formats.meshio.write import boundary_blocks
from slideviz.formats.openfoam_paths import ending_of
from slideviz.formats.table import WriteOptions, write_blocks
from slideviz.mesh.model import Mesh

SIDES = (5, 9)
CELLS = (10, 14, 13, 12)
"""VTK identifiers of boundary elements and of cells, in the order of the file."""
PYRAMID = np.array([1, 0, 4, 2, 3])
"""Node of a VTK pyramid at each place: its third node is the apex."""


def write_ugrid(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh as UGRID, whose boundaries are numbers; raise MeshError if it cannot be."""
    require_ugrid(mesh, path)
    order = "<" if ending_of(path) == ".lb8.ugrid" else ">"
    write_blocks(path, _blocks(mesh, order), options)


def require_ugrid(mesh: Mesh, path: Path) -> None:
    """Raise MeshError if a file, ``path``, cannot hold a mesh: it is 2D, or has too many points."""
    if mesh.dim != 3 or len(mesh.points) > np.iinfo(np.int32).max:
        raise path_error(
            path, "cannot be written: UGRID holds 3D meshes of up to 2^31 points; write .su2"
        )


def _blocks(mesh: Mesh, order: str) -> Iterator[bytes]:
    whole = f"{order}i4"
    sides = {vtk: (nodes, numbers) for vtk, nodes, numbers in boundary_blocks(mesh)}
    parts = [sides[vtk] for vtk in SIDES if vtk in sides]
    cells = {vtk: nodes for vtk, (_, nodes) in mesh.cells.by_type.items()}
    if 14 in cells:
        cells[14] = cells[14][:, PYRAMID]
    counts = [len(mesh.points)]
    counts += [len(sides[vtk][0]) if vtk in sides else 0 for vtk in SIDES]
    counts += [len(cells.get(vtk, ())) for vtk in CELLS]
    yield np.array(counts, whole).tobytes()
    yield mesh.points.astype(f"{order}f8").tobytes()
    for nodes, _ in parts:
        yield (nodes + 1).astype(whole).tobytes()
    for _, numbers in parts:
        yield numbers.astype(whole).tobytes()
    for vtk in CELLS:
        if vtk in cells:
            yield (cells[vtk] + 1).astype(whole).tobytes()
