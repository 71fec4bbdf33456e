"""Checks that a mesh can be used: node numbers, element types, names and coordinates."""

from __future__ import annotations

import numpy as np

from slideviz.errors import MeshError, Message
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import BoolArray, Cells, FloatArray, Index, IntArray, Mesh

LARGEST = 1e50
"""Largest absolute coordinate that is computed with, so that products of several are finite."""


def first_fault(cells: Cells, n_points: int) -> tuple[int, str] | None:
    """Return the index of a wrong element and a sentence on what is wrong, or None.

    Wrong are node indices that are negative or not below ``n_points``, and a node that an element
    has twice.
    """
    flat = cells.connectivity
    if len(flat) and (flat.min() < 0 or flat.max() >= n_points):
        at = int(np.argmax((flat < 0) | (flat >= n_points)))
        element = int(np.searchsorted(cells.offsets, at, "right")) - 1
        return element, no_node(str(flat[at]), n_points)
    repeated = _first_repeated(cells)
    if repeated is None:
        return None
    element, node = repeated
    name = ELEMENTS[int(cells.types[element])].name
    return element, (
        f"node {node} occurs twice in one {name}; replace the collapsed element by one with "
        "fewer nodes"
    )


def no_node(node: str, n_points: int) -> str:
    """Return the error message for an element whose ``node`` does not exist."""
    return (
        f"node {node} does not exist: the {n_points} points are numbered "
        f"from 0 to {n_points - 1}; correct the element or the points"
    )


def _first_repeated(cells: Cells) -> tuple[int, int] | None:
    """Return the index of the first element that has a node twice, and that node, or None."""
    repeated: list[tuple[int, int]] = []

    def look(_vtk: int, rows: Index, nodes: IntArray) -> None:
        ordered = np.sort(nodes, axis=1)
        same: BoolArray = ordered[:, 1:] == ordered[:, :-1]
        if same.any():
            k = int(np.argmax(same.any(axis=1)))
            cell = int(np.arange(len(cells))[rows][k])
            repeated.append((cell, int(ordered[k, int(np.argmax(same[k]))])))

    cells.in_parts(look)
    return min(repeated, default=None)


def check_mesh(mesh: Mesh) -> None:
    """Raise if the coordinates, elements or marker names of a mesh cannot be used.

    Raises MeshError if a coordinate is not finite, an element has the wrong dimension or wrong
    nodes, or two markers have one name.
    """
    check_points(mesh)
    if len(mesh.cells) == 0:
        raise MeshError(f"{mesh.name}: there are no cells; mesh the volume, not only its surface")
    groups = [("cell", mesh.dim, mesh.cells)]
    groups += [(f"marker {m.name!r}: element", mesh.dim - 1, m.cells) for m in mesh.markers]
    for what, dim, cells in groups:
        for vtk, (ids, _) in cells.by_type.items():
            if ELEMENTS[vtk].dim != dim:
                raise MeshError(
                    f"{mesh.name}: {what} {ids[0]} is a {ELEMENTS[vtk].name}, but dimension {dim} "
                    "is needed; remove it"
                )
        fault = first_fault(cells, len(mesh.points))
        if fault:
            raise MeshError(f"{mesh.name}: {what} {fault[0]}: {fault[1]}")
    names = mesh.marker_names
    for name in names:
        if names.count(name) > 1:
            raise MeshError(f"{mesh.name}: two markers are named {name!r}; rename one of them")


def check_points(mesh: Mesh) -> None:
    """Raise if a coordinate is not finite.

    Raises MeshError if a coordinate is NaN or infinite.
    """
    if not within(mesh.points, np.finfo(float).max):
        k = int(np.argmax(~np.isfinite(mesh.points).all(axis=1)))
        raise MeshError(
            f"{mesh.name}: point {k} is at {tuple(mesh.points[k].tolist())}, which is not finite; "
            "correct the file or the displacement that put it there"
        )


def within(points: FloatArray, largest: float) -> bool:
    """Return whether no coordinate is NaN or larger than ``largest`` in absolute value."""
    return not points.size or bool(points.min() >= -largest and points.max() <= largest)


def check_size(mesh: Mesh, name: str = "") -> None:
    """Raise if a finite coordinate is too large to be computed with; ``name`` is for the message.

    Raises MeshError if the absolute value of a coordinate is above ``LARGEST``.
    """
    if within(mesh.points, LARGEST):
        return
    # What is not finite is reported elsewhere, or makes its cells inverted.
    bad = ((np.abs(mesh.points) > LARGEST) & np.isfinite(mesh.points)).any(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise too_large(name or mesh.name, k, mesh.points[k])


def too_large(name: str, k: int, point: FloatArray) -> MeshError:
    """Return the error for a ``point`` (d,), number ``k``, with a coordinate above ``LARGEST``."""
    return MeshError(
        Message(
            f"point {k} is at {tuple(point.tolist())}; nothing can be computed with coordinates "
            f"larger than {LARGEST:g}, so correct it or scale the mesh",
            place=(name,),
        )
    )
