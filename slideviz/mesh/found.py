"""What was found out about a mesh, as long as the mesh is there."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from slideviz.mesh.model import Mesh
from slideviz.mesh.topology import Boundary, find_boundary

_BOUNDARIES: WeakKeyDictionary[Mesh, Boundary] = WeakKeyDictionary()


def boundary_of(mesh: Mesh) -> Boundary:
    """Return the oriented boundary of a mesh, found once for opening it and for all its runs.

    Raises
    ------
    MeshError
        A marker element is no side of any cell.
    """
    found = _BOUNDARIES.get(mesh)
    if found is None:
        found = _BOUNDARIES[mesh] = find_boundary(mesh)
    return found
