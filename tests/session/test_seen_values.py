"""Values of some cells only are those of all cells, and displacements those of a slow loop."""

import numpy as np
import pytest

from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.session.state import StepFrame, cell_displacement


@pytest.fixture(scope="module", params=["square", "hexahedron", "cylindrical"])
def pair(request):
    mesh = sample(request.param, size=5).mesh
    rng = np.random.default_rng(3)
    return mesh, mesh.with_points(mesh.points + 0.01 * rng.normal(size=mesh.points.shape))


def test_displacement_is_the_mean_over_the_nodes(pair):
    mesh, moved = pair
    found = cell_displacement(moved, mesh)
    for cell in range(len(mesh.cells)):
        begin, end = mesh.cells.offsets[cell : cell + 2]
        nodes = mesh.cells.connectivity[begin:end]
        way = np.linalg.norm(moved.points[nodes] - mesh.points[nodes], axis=1)
        assert found[cell] == pytest.approx(way.mean(), rel=1e-14)


@pytest.mark.parametrize("what", ["size-skew", "size", "skew", "displacement"])
def test_some_cells_have_the_values_they_have_among_all(pair, what):
    mesh, moved = pair
    frame = StepFrame(moved, quality(moved, mesh))
    some = np.array([len(mesh.cells) - 1, 0, 3, 3])
    np.testing.assert_array_equal(
        frame.shown_values(what, mesh, some), frame.shown_values(what, mesh)[some]
    )


def test_furthest_is_the_longest_way_of_a_node(pair):
    mesh, moved = pair
    way = np.linalg.norm(moved.points - mesh.points, axis=1)
    frame = StepFrame(moved, quality(moved, mesh))
    assert frame.largest_displacement(mesh) == pytest.approx(way.max(), rel=1e-15)
    assert frame.largest_displacement(moved) == 0.0


def test_an_undeformed_mesh_is_displaced_nowhere(pair):
    mesh, _ = pair
    assert not cell_displacement(mesh, mesh).any()


def test_bounds_hold_all_points(pair):
    mesh, _ = pair
    low, high = mesh.bounds
    np.testing.assert_array_equal(low, mesh.points.min(axis=0))
    np.testing.assert_array_equal(high, mesh.points.max(axis=0))
