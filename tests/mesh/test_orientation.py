"""Orientation: numbered the other way round is not folded."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.orientation import corner_sums, orientation
from slideviz.mesh.quality import INVERTED, VALID, quality
from tests.oracles import quality as oracle

# A cube (k, i, j order of the corners as VTK has them) cut into cells of one type.
CUTS = {
    5: [(0, 1, 2), (0, 2, 3)],
    9: [(0, 1, 2, 3)],
    10: [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)],
    12: [tuple(range(8))],
    13: [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)],
}


def grid(vtk, n=4):
    """Mesh of n^d unit cubes (squares), cut into cells of that type."""
    d = 2 if vtk in (5, 9) else 3
    index = np.arange((n + 1) ** d).reshape((n + 1,) * d)
    points = np.array(list(itertools.product(range(n + 1), repeat=d)), float)
    steps = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = steps if d == 2 else [(*s, z) for z in (0, 1) for s in steps]
    boxes = np.stack([index[tuple(slice(c, c + n) for c in corner)].ravel() for corner in corners])
    cells = boxes.T[:, CUTS[vtk]].reshape(-1, len(CUTS[vtk][0]))
    return Mesh(points, Cells.from_blocks([(vtk, cells)]))


def mirrored(mesh, vtk, which):
    nodes = mesh.cells.by_type[vtk][1].copy()
    nodes[which] = nodes[which][:, oracle.MIRRORS[vtk]]
    return Mesh(mesh.points, Cells.from_blocks([(vtk, nodes)]))


def folded(mesh, node, vector):
    points = mesh.points.copy()
    points[node] += vector
    return mesh.with_points(points)


@pytest.mark.parametrize("vtk", CUTS)
def test_mixed_numbering_is_found(vtk):
    mesh = grid(vtk)
    which = np.random.default_rng(0).permutation(len(mesh.cells))[: len(mesh.cells) // 3]
    found = quality(mirrored(mesh, vtk, which))
    assert found.valid == len(mesh.cells)
    np.testing.assert_array_equal(np.flatnonzero(found.signs < 0), np.sort(which))
    np.testing.assert_array_equal(found.values, quality(mesh).values)


@pytest.mark.parametrize("vtk", CUTS)
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_folded_cells_stay_inverted_in_any_numbering(vtk, share):
    mesh = grid(vtk)
    centre = len(mesh.points) // 2
    bent = folded(mesh, centre, np.full(mesh.dim, 1.3))
    expected = [min(oracle.jacobians(vtk, bent.points[n])) <= 0 for n in mesh.cells.by_type[vtk][1]]
    assert 0 < sum(expected) < len(mesh.cells) / 2
    which = np.flatnonzero(np.random.default_rng(1).random(len(mesh.cells)) < share)
    turned = mirrored(bent, vtk, which)
    for found in (
        quality(turned),
        quality(turned, turned.with_points(mesh.points)),
        quality(turned, turned),
    ):
        np.testing.assert_array_equal(found.status == INVERTED, expected)


@pytest.mark.parametrize("vtk", CUTS)
def test_cell_folded_over_altogether_is_not_taken_for_renumbered(vtk):
    """The cell's own Jacobians are all negative: only its neighbours can tell."""
    mesh = grid(vtk, 3)
    nodes = mesh.cells.by_type[vtk][1]
    inner = next(
        i for i, cell in enumerate(nodes) if ((mesh.points[cell] > 0).all(axis=1)).sum() >= 3
    )
    points = mesh.points.copy()
    near = points[nodes[inner]]
    points[nodes[inner]] = near[:, 0:1] * 0 + near.mean(axis=0) - 0.5 * (near - near.mean(axis=0))
    if mesh.dim == 2:
        points[nodes[inner], 0] = 2 * near[:, 0].mean() - points[nodes[inner], 0]
    bent = mesh.with_points(points)
    assert max(oracle.jacobians(vtk, bent.points[nodes[inner]])) < 0
    assert quality(bent).status[inner] == INVERTED


def test_prisms_and_hexahedra_side_by_side():
    """SU2 files number prisms either way; a neighbour of another type tells it too."""
    hexa = [0, 1, 2, 3, 4, 5, 6, 7]
    prism = np.array([1, 8, 2, 5, 9, 6])
    points = np.vstack((oracle.IDEAL[12], [(2, 0, 0), (2, 0, 1)]))
    for nodes in (prism, prism[list(oracle.MIRRORS[13])]):
        found = quality(Mesh(points, Cells.from_blocks([(12, [hexa]), (13, [nodes])])))
        np.testing.assert_array_equal(found.status, [VALID, VALID])
    points[8:, 0] = 0.5
    found = quality(Mesh(points, Cells.from_blocks([(12, [hexa]), (13, [prism])])))
    np.testing.assert_array_equal(found.status, [VALID, INVERTED])


def test_parts_without_a_common_facet_are_judged_apart():
    mesh = grid(9, 3)
    nodes = mesh.cells.by_type[9][1]
    points = np.vstack((mesh.points, mesh.points + 10))
    both = np.vstack((nodes, nodes[:, oracle.MIRRORS[9]] + len(mesh.points)))
    found = quality(Mesh(points, Cells.from_blocks([(9, both)])))
    assert found.valid == 18
    np.testing.assert_array_equal(found.signs, [1] * 9 + [-1] * 9)


def test_facet_of_three_cells_tells_nothing():
    """Three triangles on one edge: no numbering agrees, so each is judged by itself."""
    points = [(0, 0), (1, 0), (0.5, 1), (0.5, 2), (0.5, -1)]
    cells = Cells.from_blocks([(5, [(0, 1, 2), (0, 1, 3), (0, 1, 4)])])
    found = quality(Mesh(points, cells))
    assert found.valid == 3


def test_numbering_that_cannot_agree_is_kept():
    """A ring of squares with one twist, laid flat: every square is its own mirror image."""
    m = 5
    low, top = np.arange(m), np.arange(m) + m
    nodes = np.column_stack((low, np.roll(low, -1), np.roll(top, -1), top))
    nodes[-1] = [low[-1], top[0], low[0], top[-1]]
    cells = Cells.from_blocks([(9, nodes)])
    np.testing.assert_array_equal(orientation(cells, np.array([3.0, 1, 1, -1, 2])), 1)
    np.testing.assert_array_equal(orientation(cells, np.array([-3.0, -1, -1, 1, -2])), -1)


def test_one_sign_needs_no_neighbours():
    cells = grid(9, 2).cells
    for sums, sign in (([1, 2, 0, 1], 1), ([-1, 0, -1, -3], -1), ([0, 0, 0, 0], 1)):
        np.testing.assert_array_equal(orientation(cells, np.array(sums, float)), sign)


@pytest.mark.parametrize("vtk", CUTS)
def test_corner_sums_are_those_of_the_file_numbering(vtk):
    mesh = folded(grid(vtk, 2), 4, 0.3)
    expected = [sum(oracle.jacobians(vtk, mesh.points[n])) for n in mesh.cells.by_type[vtk][1]]
    np.testing.assert_allclose(corner_sums(mesh), expected, rtol=1e-13)
