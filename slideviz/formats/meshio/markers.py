"""Named boundaries of a mesh that meshio read, in whatever way its format names them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slideviz.mesh.cached_boundary import outer_facets, smooth_parts
from slideviz.mesh.model import Cells, IntArray, Marker, Mesh

if TYPE_CHECKING:
    import meshio

Groups = dict[str, list[tuple[int, IntArray]]]
"""Blocks of boundary elements, VTK identifier and nodes (m, n), by the name of the boundary."""
Name = TypeVar("Name")

# Cell data with the number of a boundary, in order of preference, and the word before a number
# without a name.
_TAGS = {
    "marker": "marker",
    "gmsh:physical": "physical",
    "cell_tags": "family",
    "medit:ref": "ref",
    "ugrid:ref": "ref",
    "nastran:ref": "ref",
    "netgen:index": "index",
    "gmsh:geometrical": "geometrical",
}
# Cell data whose numbers a table in the file names.
_NAMED = ("marker", "gmsh:physical", "cell_tags", "netgen:index")
# Cell data in which 0 means that the element is in no group.
_ZERO_IS_NONE = ("marker", "gmsh:physical", "cell_tags")


@dataclass(frozen=True, eq=False)
class MeshioBlock:
    """Elements of one type: index in meshio's list of blocks, VTK identifier, nodes (m, n)."""

    index: int
    vtk: int
    nodes: IntArray


def find_markers(mesh: Mesh, data: meshio.Mesh, sides: Sequence[MeshioBlock]) -> tuple[Marker, ...]:
    """Return the boundaries of a mesh.

    They are found by the first of these that the file has: named sets of boundary elements, numbers
    on boundary elements (with names where the file has them), named sets of points. Without any,
    they are the parts of the outer surface, divided at its edges. ``mesh``: points and cells.
    ``data``: what meshio read. ``sides``: its elements of one dimension less than the mesh.
    """
    groups = _by_cell_sets(data, sides) or _by_tags(mesh, data, sides)
    if groups:
        return tuple(Marker(name, Cells.from_blocks(parts)) for name, parts in groups.items())
    facets = outer_facets(mesh)
    return _by_point_sets(mesh, data, facets) or smooth_parts(mesh, facets)


def _by_cell_sets(data: meshio.Mesh, sides: Sequence[MeshioBlock]) -> Groups:
    groups: Groups = {}
    for name, members in data.cell_sets.items():
        if name is not None and name.startswith("gmsh:"):
            continue
        for block in sides:
            # Some readers leave out the blocks at the end, or put None for an empty set.
            chosen = members[block.index] if block.index < len(members) else None
            if chosen is not None and len(chosen):
                _add(groups, name, block.vtk, block.nodes[np.asarray(chosen, np.int64)])
    return groups


def _by_tags(mesh: Mesh, data: meshio.Mesh, sides: Sequence[MeshioBlock]) -> Groups:
    """Return boundary elements grouped by the first cell data that has numbers of groups."""
    others = [key for key in data.cell_data if key not in _TAGS]
    for key in [*_TAGS, *others]:
        values = _numbers(data, key, sides)
        if values is None:
            continue
        names = _names(data, mesh.dim - 1) if key in _NAMED else {}
        groups: Groups = {}
        # By size, for MED counts downward from -1.
        for number in sorted(np.unique(np.concatenate(values)).tolist(), key=abs):
            if number == 0 and key in _ZERO_IS_NONE and 0 not in names:
                continue
            for name in names.get(number, [f"{_TAGS.get(key, key)}_{number}"]):
                for block, numbers in zip(sides, values, strict=True):
                    _add(groups, name, block.vtk, block.nodes[numbers == number])
        if groups:
            return groups
    return {}


def _numbers(data: meshio.Mesh, key: str, sides: Sequence[MeshioBlock]) -> list[NDArray] | None:
    """Return the integers (m,) of cell data ``key`` on each block of boundary elements, or None.

    None if there are none, or nearly all differ: then they are identifiers, not groups.
    """
    if not sides or key not in data.cell_data:
        return None
    values = [np.asarray(data.cell_data[key][block.index]) for block in sides]
    if any(array.ndim != 1 or array.dtype.kind not in "iu" for array in values):
        return None
    if key not in _TAGS:
        # A different number on each element is an identifier, not a group.
        distinct = len(np.unique(np.concatenate(values)))
        if distinct > 1 and distinct > 0.5 * sum(map(len, values)):
            return None
    return values


def _names(data: meshio.Mesh, dim: int) -> dict[int, list[str]]:
    """Return the names in the file for each number of a group of elements of dimension ``dim``."""
    found: dict[int, list[str]] = {}
    for name, value in data.field_data.items():
        pair = np.ravel(value)
        if pair.dtype.kind in "iu" and len(pair) == 2 and pair[1] == dim:
            found.setdefault(int(pair[0]), []).append(str(name))
    for number, names in getattr(data, "cell_tags", {}).items():
        found.setdefault(int(number), []).extend(names)
    return found


def _add(groups: Groups, name: str | None, vtk: int, nodes: IntArray) -> None:
    """Add elements to the group of a name, cleaned of what is not printable, or ``unnamed``."""
    # Readers give None to a set that its file does not name.
    clean = "".join(c for c in name or "" if c.isprintable()).strip() or "unnamed"
    groups.setdefault(clean, []).append((vtk, nodes))


def _by_point_sets(mesh: Mesh, data: meshio.Mesh, facets: Cells) -> tuple[Marker, ...]:
    """Return a marker for each named set of points that has all nodes of some outer facets."""
    groups: Groups = {}
    for name, parts in in_node_sets(len(mesh.points), facets, data.point_sets).items():
        for vtk, nodes in parts:
            _add(groups, name, vtk, nodes)
    return tuple(Marker(name, Cells.from_blocks(parts)) for name, parts in groups.items())


def in_node_sets(
    n_points: int, facets: Cells, sets: Mapping[Name, ArrayLike]
) -> dict[Name, list[tuple[int, IntArray]]]:
    """Return for each set of nodes the facets with all their nodes in it, as blocks of one type.

    A facet goes only to the smallest of such sets, so that a set of all points takes none from
    the others.
    """
    free = np.ones(len(facets), bool)
    sets_of: dict[Name, list[tuple[int, IntArray]]] = {name: [] for name in sets}
    members = {name: np.asarray(nodes, np.int64) for name, nodes in sets.items()}
    for name, chosen in sorted(members.items(), key=lambda item: len(item[1])):
        inside = np.zeros(n_points, bool)
        inside[chosen] = True
        for vtk, (ids, nodes) in facets.by_type.items():
            taken = free[ids] & inside[nodes].all(axis=1)
            free[ids[taken]] = False
            if taken.any():
                sets_of[name].append((vtk, nodes[taken]))
    return sets_of
