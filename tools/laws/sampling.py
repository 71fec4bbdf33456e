"""Jacobians of cells at many points, by isoparametric formulas, to judge their validity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from tools.laws.draw import Rng

Edges = tuple[FloatArray, ...]
"""The derivatives (m, k, d) of the map of a cell along its parameters, at k points of m cells."""


def smallest_jacobians(mesh: Mesh, rng: Rng, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the least and mean Jacobian (m,) of each cell, at its corners and ``count`` points.

    They are positive where a cell is valid in the order of its nodes.
    """
    least, mean = np.empty(len(mesh.cells)), np.empty(len(mesh.cells))
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1)
    params = np.concatenate([corners, rng.uniform(size=(3, count))], axis=1)
    for vtk, (cells, nodes) in mesh.cells.by_type.items():
        edges = np.stack(_EDGES[vtk](mesh.points[nodes], *params), axis=-1)
        found = np.linalg.det(edges)
        least[cells], mean[cells] = found.min(axis=1), found.mean(axis=1)
    return least, mean


def _simplex(x: FloatArray, u: FloatArray, _v: FloatArray, _w: FloatArray) -> Edges:
    """Return the edges of triangles and tetrahedra, the same everywhere."""
    flat = [np.repeat(x[:, None, k] - x[:, None, 0], len(u), axis=1) for k in range(1, x.shape[1])]
    return tuple(flat)


def _quad(x: FloatArray, u: FloatArray, v: FloatArray, _w: FloatArray) -> Edges:
    a, b, c, d = (x[:, None, k] for k in range(4))
    u, v = u[:, None], v[:, None]
    return (1 - v) * (b - a) + v * (c - d), (1 - u) * (d - a) + u * (c - b)


def _bilinear(x: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    a, b, c, d = (x[:, None, k] for k in range(4))
    u, v = u[:, None], v[:, None]
    found: FloatArray = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * c)
    return found


def _hexahedron(x: FloatArray, u: FloatArray, v: FloatArray, w: FloatArray) -> Edges:
    low, high = x[:, :4], x[:, 4:]
    z = w[:, None]
    along = [
        (1 - z) * a + z * b for a, b in zip(_quad(low, u, v, w), _quad(high, u, v, w), strict=True)
    ]
    return *along, _bilinear(high, u, v) - _bilinear(low, u, v)


def _prism(x: FloatArray, u: FloatArray, v: FloatArray, w: FloatArray) -> Edges:
    # Points of the square beyond its diagonal are turned into the triangle.
    beyond = u + v > 1
    u, v = np.where(beyond, 1 - u, u), np.where(beyond, 1 - v, v)
    low, high, z = x[:, :3], x[:, 3:], w[:, None]
    one, two = (
        (1 - z) * (low[:, None, k] - low[:, None, 0]) + z * (high[:, None, k] - high[:, None, 0])
        for k in (1, 2)
    )
    weights = np.stack([1 - u - v, u, v], axis=1)
    up = np.einsum("kn,mnd->mkd", weights, high - low)
    return one, two, up


def _pyramid(x: FloatArray, u: FloatArray, v: FloatArray, w: FloatArray) -> Edges:
    """Return the edges of the map that collapses a face into the tip, over its factor (1 - w)²."""
    base = x[:, :4]
    return *_quad(base, u, v, w), x[:, None, 4] - _bilinear(base, u, v)


_EDGES: dict[int, Callable[[FloatArray, FloatArray, FloatArray, FloatArray], Edges]] = {
    5: _simplex,
    9: _quad,
    10: _simplex,
    12: _hexahedron,
    13: _prism,
    14: _pyramid,
}
