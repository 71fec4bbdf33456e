"""What was found out about a mesh, as long as the mesh is there."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from slideviz.mesh.model import IntArray, Marker, Mesh
from slideviz.mesh.outer import outer_facets
from slideviz.mesh.topology import Boundary, find_boundary

_BOUNDARIES: WeakKeyDictionary[Mesh, Boundary] = WeakKeyDictionary()
_SHELLS: WeakKeyDictionary[Mesh, IntArray] = WeakKeyDictionary()


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


def shell_of(mesh: Mesh) -> IntArray:
    """Return the oriented sides of single cells, (f, 2) or (f, 4), whatever is in markers.

    They are closed where markers are not: where some boundary has none, or where cells go on
    beyond the periodic sides, as those that SU2 adds for them.
    """
    found = _SHELLS.get(mesh)
    if found is None:
        marker = Marker("shell", outer_facets(mesh))
        found = find_boundary(Mesh(mesh.points, mesh.cells, (marker,), name=mesh.name)).facets
        _SHELLS[mesh] = found
    return found
