"""Corner Jacobians and Bernstein coefficients of the Jacobian determinant of cells.

Arrays here have the cells last, ``(..., m)``, so that every operation runs over contiguous
memory. ``at`` is (d, n, m): the coordinates of the n nodes of m cells of one type.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from slideviz.errors import MeshError
from slideviz.mesh.elements import ELEMENTS

if TYPE_CHECKING:
    from slideviz.mesh.model import FloatArray, IntArray, Mesh

CHUNK = 4096
"""Cells handled at a time: small enough that the temporary arrays stay in the cache."""


def check_cells(mesh: Mesh) -> None:
    """Raise if the mesh has no cells, cells of another dimension, or nodes out of range.

    Raises
    ------
    MeshError
        Any of these.
    """
    if not len(mesh.cells):
        raise MeshError(f"{mesh.name} has no cells; a quality needs at least one")
    for vtk, (ids, _) in mesh.cells.by_type.items():
        row = ELEMENTS[vtk]
        if row.dim != mesh.dim:
            raise MeshError(
                f"cell {ids[0]} of {mesh.name} is a {row.name} (dimension {row.dim}), but the "
                f"mesh has dimension {mesh.dim}; keep only cells of the mesh's dimension"
            )
    flat = mesh.cells.connectivity
    wrong = (flat < 0) | (flat >= len(mesh.points))
    if wrong.any():
        raise MeshError(
            f"{mesh.name} has {len(mesh.points)} points, but a cell has node "
            f"{flat[wrong.argmax()]} (counted from 0); node indices must be in that range"
        )


def chunks(nodes: IntArray) -> Iterator[slice]:
    """Yield slices that cut (m, n) ``nodes`` into parts of at most ``CHUNK`` cells."""
    for first in range(0, len(nodes), CHUNK):
        yield slice(first, first + CHUNK)


def coordinates(columns: FloatArray, nodes: IntArray) -> FloatArray:
    """Return (d, n, m) node coordinates from ``columns`` (d, N) and ``nodes`` (m, n)."""
    return np.take(columns, nodes.T, axis=1)


def corner_edges(vtk: int, at: FloatArray) -> FloatArray:
    """Return (e, d, k, m): the e edge vectors that leave each of the k corners.

    They are the rows of the corner matrices A_k (thesis Eq. 2.39 to 2.42, Table 2.3).
    """
    table = np.array(ELEMENTS[vtk].corners)
    ends = at[:, table[:, 1:].T]
    return np.moveaxis(ends - at[:, table[:, 0]][:, None], 1, 0)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross product of (3, ...) and (3, ...), broadcast."""
    return np.stack(
        (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar product of (d, ...) and (d, ...), broadcast."""
    return total(a * b)


def total(a: FloatArray) -> FloatArray:
    """Return the sum over the first axis, term by term.

    ``a.sum(axis=0)`` adds pairwise where a chunk has a single cell, so that the last bit of a
    result would depend on the size of the chunks.
    """
    return reduce(np.add, a)


def determinant(edges: FloatArray) -> FloatArray:
    """Return the determinants (...) of matrices with the rows ``edges`` (d, d, ...)."""
    if len(edges) == 2:
        a, b = edges
        return a[0] * b[1] - a[1] * b[0]
    return dot(cross(edges[0], edges[1]), edges[2])


def prism_coefficients(at: FloatArray) -> FloatArray:
    """Return (3, 3, m) Bernstein coefficients of det J of prisms, ``at`` (3, 6, m).

    The determinant is linear over the triangle and quadratic along the height: the entry
    ``[c, i]`` is coefficient c of the quadratic above corner i. Entries 0 and 2 are the corner
    Jacobians, and the volume is the sum of all, divided by 18.
    """
    low, top = at[:, :3], at[:, 3:]
    height = top - low
    a, b = low[:, 1] - low[:, 0], low[:, 2] - low[:, 0]
    c, d = top[:, 1] - top[:, 0], top[:, 2] - top[:, 0]
    normals = (cross(a, b), 0.5 * (cross(a, d) + cross(c, b)), cross(c, d))
    return np.stack([dot(normal[:, None], height) for normal in normals])


# Node of a hexahedron by its parameters (i, j, k), each 0 or 1.
_NODE = np.array([[[0, 4], [3, 7]], [[1, 5], [2, 6]]])


def hexahedron_coefficients(at: FloatArray) -> FloatArray:
    """Return (3, 3, 3, m) Bézier coefficients of det J of hexahedra, ``at`` (3, 8, m).

    The derivatives along u, v and w are bilinear, with the twelve edges as coefficients; so the
    coefficient (a, b, c) of their triple product, which is quadratic in each parameter, is the
    mean of the triple products of edges u[j, k], v[i, k'], w[i', j'] with i + i' = a,
    j + j' = b and k + k' = c. No subtraction is left, hence no cancellation either. The corner
    coefficients are the corner Jacobians, and the mean of all is the volume (A. Johnen,
    J.-F. Remacle, C. Geuzaine, Geometrical validity of curvilinear finite elements, 2013).
    """
    nodes = at[:, _NODE]
    u = nodes[:, 1] - nodes[:, 0]
    v = nodes[:, :, 1] - nodes[:, :, 0]
    w = nodes[:, :, :, 1] - nodes[:, :, :, 0]
    # (3, i, j, k, k', m): triple products need the normals of u and v edges only.
    normals = cross(u[:, None, :, :, None], v[:, :, None, None, :])
    thirds = np.stack(
        (
            normals[..., 0, 0, :],
            0.5 * (normals[..., 0, 1, :] + normals[..., 1, 0, :]),
            normals[..., 1, 1, :],
        ),
        axis=3,
    )
    found = np.zeros((3, 3, 3, at.shape[2]))
    for i, j, p, q in np.ndindex(2, 2, 2, 2):
        # 1 / binomial(2, a) for the sum of two linear Bernstein factors, for a and for b.
        weight = (0.5 if i != p else 1.0) * (0.5 if j != q else 1.0)
        found[i + p, j + q] += weight * dot(thirds[:, i, j], w[:, p, q, None])
    return found
