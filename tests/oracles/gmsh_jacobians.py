"""Smallest Jacobians of cells by Gmsh, as judge of `slideviz.mesh.jacobians`: Bézier bounds, cut
into parts until they are sharp (Johnen, Remacle and Geuzaine, J. Comput. Phys. 233, 2013)."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.mesh.model import Mesh

TYPES = {5: 6, 9: 5, 10: 4, 12: 5, 13: 6, 14: 7}
"""Gmsh's number of an element type by VTK's; both have the same order of nodes. Those in a plane
are prisms and hexahedra of height 1, for Gmsh has no sign of the Jacobian of a surface."""


def smallest_jacobians(gmsh: Any, mesh: Mesh) -> np.ndarray:
    """The least Jacobian determinant of each cell, (m,), by the installed module ``gmsh``.

    Positive where a cell is valid in the order of its nodes; the unit is Gmsh's.
    """
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("cells")
        entity, points, n = gmsh.model.addDiscreteEntity(3), mesh.points, len(mesh.points)
        if mesh.dim == 2:
            points = np.concatenate([np.c_[points, np.full(n, z)] for z in (0.0, 1.0)])
        gmsh.model.mesh.addNodes(3, entity, np.arange(1, len(points) + 1), points.ravel())
        for vtk, (ids, nodes) in mesh.cells.by_type.items():
            nodes = nodes if mesh.dim == 3 else np.hstack([nodes, nodes + n])
            gmsh.model.mesh.addElementsByType(entity, TYPES[vtk], ids + 1, nodes.ravel() + 1)
        tags = np.arange(1, len(mesh.cells) + 1)
        return np.array(gmsh.model.mesh.getElementQualities(tags, "minDetJac"))
    finally:
        gmsh.finalize()
