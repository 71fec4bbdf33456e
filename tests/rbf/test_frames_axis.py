"""At the axis of a cylindrical frame: corners of facets, and nodes that stay on it."""

from __future__ import annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.mesh.topology import corner_vectors, unit
from slideviz.rbf.frames import Frame, corners, hold_on_axis, on_axis
from tests import builders

# (r, rho theta, z): two nodes on the axis, and a sector of 0.4 at r = 1, z = 0 and 1.
COORDS = np.array(
    [[0, 0, 0], [0, 0, 1], [1, -0.2, 0], [1, 0.2, 0], [1, -0.2, 1], [1, 0.2, 1.0]], float
)
AXIS = COORDS[:, 0] == 0


@pytest.mark.parametrize("turn", range(3))
def test_a_triangle_with_a_corner_on_the_axis_is_a_rectangle(turn):
    nodes = np.roll([0, 2, 3], turn)
    (found,) = corners(COORDS, np.array([[*nodes, nodes[-1]]]), AXIS)
    assert {tuple(p) for p in found} == {(0, -0.2, 0), (0, 0.2, 0), (1, -0.2, 0), (1, 0.2, 0)}
    # A proper ring in the order of the triangle: its area is that of the rectangle.
    np.testing.assert_allclose(corner_vectors(found[None]), [[0, 0, 2 * 0.4]], atol=1e-15)


def test_a_facet_along_the_axis_lies_in_its_plane():
    found = corners(COORDS, np.array([[0, 2, 4, 1], [0, 1, 4, 4]]), AXIS)
    np.testing.assert_array_equal(found[..., 1], -0.2)
    np.testing.assert_allclose(np.abs(unit(corner_vectors(found))), [[0, 1, 0]] * 2, atol=1e-15)


def test_segments_and_facets_off_the_axis():
    np.testing.assert_array_equal(
        corners(COORDS, np.array([[0, 3], [0, 1], [2, 3]]), AXIS),
        [[[0, 0.2, 0], [1, 0.2, 0]], [[0, 0, 0], [0, 0, 1]], [[1, -0.2, 0], [1, 0.2, 0]]],
    )
    table = np.array([[2, 3, 5, 4]])
    np.testing.assert_array_equal(corners(COORDS, table, AXIS), COORDS[table])


def test_which_nodes_are_on_the_axis():
    frame = Frame(3, axis=np.array([0.0, 0, 1]), origin=np.zeros(3), radius=0.5)
    assert on_axis(frame, COORDS).tolist() == AXIS.tolist()
    assert not on_axis(Frame(3), COORDS).any()


def test_nodes_on_the_axis_move_along_it_only():
    nodes = np.array([0, 1, 1, 5])
    normals = np.array([[0, 1.0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0]])
    found, rows, held = hold_on_axis(nodes, normals, AXIS)
    assert held.tolist() == [1]
    np.testing.assert_array_equal(rows[found == 0], np.eye(3)[:2])
    np.testing.assert_array_equal(rows[found == 1], np.eye(3))
    np.testing.assert_array_equal(rows[found == 5], [[1, 0, 0]])
    same = hold_on_axis(nodes, normals, np.zeros(6, bool))
    assert same[0] is nodes
    assert same[1] is normals


def pie(n=4, angle_deg=20.0):
    """A wedge of a cylinder with its axis: prisms inside, hexahedra outside, and a moving top."""
    flat = builders.wedge(n + n % 2, angle_deg)
    layers = 4
    count = len(flat.points)
    points = np.concatenate(
        [np.column_stack([flat.points, np.full(count, k / layers)]) for k in range(layers + 1)]
    )
    blocks = []
    for vtk, solid in ((5, 13), (9, 12)):
        table = flat.cells.by_type[vtk][1]
        blocks.append(
            (
                solid,
                np.concatenate(
                    [np.hstack([table + k * count, table + (k + 1) * count]) for k in range(layers)]
                ),
            )
        )
    angle = np.radians(angle_deg)

    def side(p, theta):
        return bool(np.allclose(p[:, 1] * np.cos(theta), p[:, 0] * np.sin(theta), atol=1e-12))

    rules = [
        ("bottom", lambda p: bool(np.all(p[:, 2] == 0))),
        ("top", lambda p: bool(np.all(p[:, 2] == 1))),
        ("per1", lambda p: side(p, 0.0)),
        ("per2", lambda p: side(p, angle)),
        ("outer", lambda p: bool(np.all(np.hypot(p[:, 0], p[:, 1]) > 0.99))),
        ("BLOCK", lambda p: True),
    ]
    return builders.make_mesh(points, blocks, rules)


@pytest.mark.parametrize("periodic", ["none", "periodic", "fixed", "moving"])
@pytest.mark.parametrize("method", ["ps", "ds"])
@pytest.mark.parametrize("angle", [8.0, pytest.param(20.0, marks=pytest.mark.slow), 60.0])
def test_a_wedge_of_a_cylinder(method, periodic, angle):
    mesh = pie(angle_deg=angle)
    case = Case(
        roles=dict.fromkeys(("bottom", "top", "outer"), "sliding")
        | {"per1": "periodic", "per2": "periodic", "BLOCK": "moving"},
        motions=(Rotate("BLOCK", angle / 20, (0.0,) * 3), Translate("BLOCK", (0.0, 0.0, 0.0))),
        sliding=method,
        periodic=periodic,
        periodic_type="rotational",
        steps=2,
    )
    *_, last = sv.deform(case, mesh)
    points = last.mesh.points
    assert last.warnings == ()
    assert sv.quality(last.mesh, mesh).inverted == 0
    middle = np.hypot(*mesh.points[:, :2].T) < 1e-12
    assert middle.sum() == 5
    np.testing.assert_array_equal(points[middle, :2], mesh.points[middle, :2])
    for name, z in (("bottom", 0.0), ("top", 1.0)):
        np.testing.assert_allclose(points[mesh.marker(name).nodes, 2], z, rtol=0, atol=1e-14)
    outer = mesh.marker("outer").nodes
    np.testing.assert_allclose(np.hypot(*points[outer, :2].T), 1.0, atol=1e-14)
    if periodic in ("none", "periodic"):
        for name, theta in (("per1", 0.0), ("per2", np.radians(angle))):
            x, y, _ = points[mesh.marker(name).nodes].T
            np.testing.assert_allclose(y * np.cos(theta) - x * np.sin(theta), 0.0, atol=1e-13)
