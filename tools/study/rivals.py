"""Methods that users would take instead, and slideviz does not have: each from its publication.

Both hold every boundary node; sliding and periodic boundaries stay where they are.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RBFInterpolator

import slideviz as sv
from slideviz.case.moving_nodes import moving_nodes
from slideviz.mesh.model import FloatArray, IntArray

POWERS = 3.0, 5.0
ALPHA = 0.25
"""Powers of the distance and the part of near nodes: the defaults of IDWarp."""

CHUNK = 4_000_000
"""Most distances at once."""


def inverse_distance(mesh: sv.Mesh, case: sv.Case) -> sv.Mesh:
    """Deform as IDWarp: each boundary node moves the mesh as a body, by its inverse distance.

    With w = A ((L/r)^3 + (alpha L/r)^5), u(x) = sum w (R x + b - x) / sum w; R turns the node's
    normal to that of the deformed boundary, A is the node's area, and L the size of the mesh.
    Source: E. Luke, E. Collins, E. Blades, "A fast mesh deformation method using explicit
    interpolation", J. Comput. Phys. 231 (2012); N. Secco et al., AIAA J. 59 (2021).
    """
    nodes, moved = _boundary(mesh, case)
    before = mesh.points
    after = before.copy()
    after[nodes] += moved
    first = _area_vectors(mesh, before)[nodes]
    last = _area_vectors(mesh, after)[nodes]
    turn = _turns(first, last)
    area = np.linalg.norm(first, axis=1)
    size = np.linalg.norm(before - before.mean(axis=0), axis=1).max()
    shift = moved - np.einsum("bij,bj->bi", turn - np.eye(mesh.dim), before[nodes])
    inner = np.setdiff1d(np.arange(len(before)), nodes)
    affine = np.concatenate([(turn - np.eye(mesh.dim)).reshape(len(nodes), -1), shift], axis=1)
    for some in np.array_split(inner, max(1, len(inner) * len(nodes) // CHUNK)):
        x = before[some]
        near = size / np.linalg.norm(x[:, None] - before[nodes], axis=2)
        weight = area * (near ** POWERS[0] + (ALPHA * near) ** POWERS[1])
        mean = weight @ affine / weight.sum(axis=1)[:, None]
        matrix = mean[:, : -mesh.dim].reshape(-1, mesh.dim, mesh.dim)
        after[some] = x + np.einsum("mij,mj->mi", matrix, x) + mean[:, -mesh.dim :]
    return mesh.with_points(after)


def thin_plate(mesh: sv.Mesh, case: sv.Case) -> sv.Mesh:
    """Deform by SciPy's thin-plate spline through all boundary nodes."""
    nodes, moved = _boundary(mesh, case)
    inner = np.setdiff1d(np.arange(len(mesh.points)), nodes)
    spline = RBFInterpolator(mesh.points[nodes], moved, kernel="thin_plate_spline")
    after = mesh.points.copy()
    after[nodes] += moved
    after[inner] += spline(mesh.points[inner])
    return mesh.with_points(after)


def _boundary(mesh: sv.Mesh, case: sv.Case) -> tuple[IntArray, FloatArray]:
    """Return the nodes (b,) of all boundaries that hold, and their displacements (b, d)."""
    inside = case.markers_with("internal")
    held = [marker.nodes for marker in mesh.markers if marker.name not in inside]
    nodes = np.unique(np.concatenate(held))
    asked = moving_nodes(case, mesh)
    moved = np.zeros((len(nodes), mesh.dim))
    moved[np.searchsorted(nodes, asked.nodes)] = asked.vectors
    return nodes, moved


def _area_vectors(mesh: sv.Mesh, points: FloatArray) -> FloatArray:
    """Return for each node (n, d) the sum of the area vectors of its boundary facets."""
    total = np.zeros_like(points)
    for marker in mesh.markers:
        for _, facets in marker.cells.by_type.values():
            corners = points[facets]
            if mesh.dim == 2:
                side = corners[:, 1] - corners[:, 0]
                vector = np.column_stack([side[:, 1], -side[:, 0]])
            else:
                ahead = np.roll(corners, -1, axis=1)
                vector = 0.5 * np.cross(corners, ahead).sum(axis=1)
            for column in facets.T:
                np.add.at(total, column, vector / facets.shape[1])
    return total


def _turns(first: FloatArray, last: FloatArray) -> FloatArray:
    """Return the smallest rotations (b, d, d) from directions (b, d) to others."""
    a = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    b = last / np.maximum(np.linalg.norm(last, axis=1, keepdims=True), 1e-300)
    axis = np.einsum("bi,bj->bij", b, a) - np.einsum("bi,bj->bij", a, b)
    cosine = np.einsum("bi,bi->b", a, b)
    part = 1.0 / np.maximum(1.0 + cosine, 1e-9)
    return np.eye(first.shape[1]) + axis + part[:, None, None] * (axis @ axis)
