"""Primitives of closest points: facets, edges and vertices."""

import numpy as np
import pytest

from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.projection_matrices import projection_matrices

TRIANGLE = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
SEGMENT = np.array([[[0.0, 0], [2, 0]]])


def found(corners, x):
    x = np.array([x], float)
    closest, which = ClosestPoints(corners).nearest(x)
    return projection_matrices(corners[which], x, closest)[0]


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        ((0.2, 0.3, 0.4), np.diag([1.0, 1, 0])),
        ((0.2, -0.3, 0.4), np.diag([1.0, 0, 0])),
        ((-0.2, -0.3, 0.4), np.zeros((3, 3))),
        ((0.2, 0.0, 0.4), np.diag([1.0, 1, 0])),
        ((0.2, -1e-9, 0.4), np.diag([1.0, 1, 0])),
    ],
    ids=["facet", "edge", "vertex", "border", "rounding"],
)
def test_a_triangle(x, expected):
    np.testing.assert_allclose(found(TRIANGLE, x), expected, atol=1e-15)


@pytest.mark.parametrize(
    ("x", "expected"),
    [((0.5, 0.2), np.diag([1.0, 0])), ((2.5, 0.2), np.zeros((2, 2)))],
    ids=["inside", "end"],
)
def test_a_segment(x, expected):
    np.testing.assert_array_equal(found(SEGMENT, x), expected)


def test_a_node_that_slides_along_a_line_of_the_mesh_is_on_a_facet():
    """Two triangles in one plane: on their common edge the boundary is as smooth as elsewhere."""
    quad = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]])
    for s in np.linspace(0.1, 0.9, 7):
        np.testing.assert_allclose(found(quad, (s, s, 1e-3)), np.diag([1.0, 1, 0]), atol=1e-15)


def test_near_a_closest_point_the_map_is_affine():
    rng = np.random.default_rng(0)
    corners = rng.random((40, 3, 3))
    track = ClosestPoints(corners)
    x = rng.random((200, 3)) * 2 - 0.5
    closest, which = track.nearest(x)
    matrix = projection_matrices(corners[which], x, closest)
    t = 1e-7 * rng.standard_normal(x.shape)
    moved = track.query(x + t)
    np.testing.assert_allclose(moved - closest, np.einsum("mij,mj->mi", matrix, t), atol=1e-13)
