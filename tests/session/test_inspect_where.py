"""Where cells are: about an axis, and beside which boundary."""

from types import SimpleNamespace

import numpy as np
import pytest

from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.session.inspect import coordinates, decimals, nearest_boundary


def about(axis, origin):
    return SimpleNamespace(axis=axis, origin=origin)


def test_places_are_told_about_an_axis():
    at = np.array([[3.0, 4.0, 7.0], [1.0, -2.0, 0.0]])
    names, values = coordinates(at, about((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    assert names == ("r", "\u03b8 [°]", "z")
    assert np.allclose(values[0], (20.0**0.5, np.degrees(np.arctan2(4, 2)), 7.0))
    assert np.allclose(values[1], (2.0, -90.0, 0.0))
    names, values = coordinates(at[:, :2], about((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    assert (names, values.shape) == (("r", "\u03b8 [°]"), (2, 2))
    assert coordinates(at, about((0.0, 1.0, 1.0), (0.0, 0.0, 0.0)))[0][2] == "axial"
    names, values = coordinates(at, None)
    assert names == ("x", "y", "z")
    assert values is at


@pytest.mark.parametrize(
    ("largest", "wanted"), [(0.2345, 4), (12.3, 2), (1234.0, 0), (0.05, 5), (0.0, 0)]
)
def test_the_largest_number_has_four_digits(largest, wanted):
    assert decimals(np.array([0.0, -largest])) == wanted


def one_cell(points, side, vtk):
    """Return a mesh of one triangle, away from a boundary of one element."""
    count = len(points)
    away = np.zeros((3, len(points[0])))
    away[:, :2] = [[50, 50], [51, 50], [50, 51]]
    markers = tuple(
        Marker(name, Cells.from_blocks([(kind, [nodes])]))
        for name, kind, nodes in (("near", vtk, side), ("far", 3, (count, count + 1)))
    )
    cells = Cells.from_blocks([(5, [(count, count + 1, count + 2)])])
    return Mesh(np.concatenate([points, away]), cells, markers)


@pytest.mark.parametrize(
    ("point", "wanted"),
    [((0.5, 0.3), 0.3), ((2.0, 0.0), 1.0), ((-3.0, 4.0), 5.0), ((0.25, 0.0), 0.0)],
)
def test_the_nearest_boundary_of_a_plane_mesh(point, wanted):
    mesh = one_cell(np.array([[0.0, 0.0], [1.0, 0.0]]), (0, 1), 3)
    name, far, _ = nearest_boundary(mesh, np.array(point))
    assert name == "near"
    assert far == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("point", "wanted"),
    [
        ((0.5, 0.5, 0.2), 0.2),
        ((0.1, 0.9, -0.3), 0.3),
        ((1.5, 0.5, 0.0), 0.5),
        ((2.0, 2.0, 1.0), 3.0**0.5),
        ((0.5, -1.0, 1.0), 2.0**0.5),
    ],
)
def test_the_nearest_face(point, wanted):
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    mesh = one_cell(corners, (0, 1, 2, 3), 9)
    name, far, _ = nearest_boundary(mesh, np.array(point))
    assert name == "near"
    assert far == pytest.approx(wanted)


def test_a_mesh_without_boundaries_has_no_nearest_one(square):
    bare = Mesh(square.points, square.cells, ())
    assert nearest_boundary(bare, np.zeros(2)) is None
