"""Periodic pairs: matched node by node, with the transformation, or refused with the reason."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.errors import MeshError
from slideviz.mesh.axis_frame import axis_basis, in_axis_frame
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.periodic import find_pairs, match, pair_up
from tests import builders


def turned(mesh, axis, origin):
    """The mesh with the z axis laid along ``axis`` through ``origin``."""
    basis = axis_basis(axis)
    return mesh.with_points(mesh.points @ basis + np.array(origin))


def only(mesh, *names):
    return Mesh(mesh.points, mesh.cells, tuple(mesh.marker(n) for n in names), name="m.su2")


def test_a_translation_is_found_and_pairs_are_images():
    mesh = builders.cube(4)
    pair = match(mesh, "y_m", "y_p")
    assert (pair.first, pair.second, pair.kind) == ("y_m", "y_p", "translational")
    np.testing.assert_allclose(pair.vector, [0, 1, 0], atol=1e-15)
    assert pair.period == pytest.approx(1.0, rel=1e-15)
    assert pair.mismatch < 1e-15
    gap = mesh.points[pair.nodes[:, 1]] - mesh.points[pair.nodes[:, 0]]
    np.testing.assert_allclose(gap, np.tile([0, 1, 0], (25, 1)), atol=1e-15)
    assert sorted(pair.nodes[:, 0]) == mesh.marker("y_m").nodes.tolist()
    assert sorted(pair.nodes[:, 1]) == mesh.marker("y_p").nodes.tolist()


def test_the_other_order_gives_the_opposite_vector():
    mesh = builders.square(6)
    forth, back = match(mesh, "x_m", "x_p"), match(mesh, "x_p", "x_m")
    np.testing.assert_allclose(forth.vector, -back.vector)
    np.testing.assert_array_equal(forth.nodes, back.nodes[np.argsort(back.nodes[:, 1])][:, ::-1])


@settings(max_examples=25, deadline=None)
@given(
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1),
    origin=st.tuples(*[st.floats(-3, 3)] * 3),
    angle=st.floats(5, 170),
)
def test_a_rotation_is_found_about_any_axis(axis, origin, angle):
    mesh = turned(builders.passage((2, 4, 4), angle_deg=angle), axis, origin)
    pair = match(mesh, "per1", "per2", "rotational", axis, origin)
    assert pair.kind == "rotational"
    assert np.degrees(pair.period) == pytest.approx(angle, rel=1e-9)
    assert pair.mismatch < 1e-9
    assert match(mesh, "per1", "per2", "auto", axis, origin).kind == "rotational"


def test_a_rotation_in_2d_is_about_z_whatever_the_axis_says():
    mesh = builders.sector(6, 40.0)
    pair = match(mesh, "per1", "per2", "rotational", (1, 0, 0))
    assert np.degrees(pair.angle) == pytest.approx(40.0)
    assert pair.axis == (0, 0, 1)


def test_half_a_turn():
    pair = match(builders.sector(6, 180.0), "per1", "per2", "rotational")
    assert np.degrees(pair.period) == pytest.approx(180.0)


def test_a_boundary_that_touches_the_axis():
    mesh = builders.grid((4, 4), place=builders.ring((4, 4), 0.0, 1.0, 60.0))
    pair = match(mesh, "y_m", "y_p", "rotational")
    assert np.degrees(pair.period) == pytest.approx(60.0)


def test_words_for_people():
    mesh = builders.sector(6)
    assert match(mesh, "per1", "per2").describe() == "30° about z"
    assert match(builders.square(4), "x_m", "x_p").describe() == "1 along (1, 0)"
    tilted = turned(builders.passage((2, 4, 4)), (1, 1, 0), (0, 0, 0))
    pair = match(tilted, "per1", "per2", axis=(1, 1, 0))
    assert pair.describe() == "30° about (1, 1, 0)"
    assert (
        "about x"
        in match(
            turned(builders.passage((2, 4, 4)), (1, 0, 0), (0, 0, 0)),
            "per1",
            "per2",
            axis=(1, 0, 0),
        ).describe()
    )


def test_a_node_moved_beyond_the_tolerance_is_named():
    mesh = builders.square(6)
    points = mesh.points.copy()
    node = int(mesh.marker("y_p").nodes[2])
    for shift, fine in ((5e-6, True), (1e-3, False)):
        points[node, 1] = 1.0 + shift
        moved = mesh.with_points(points)
        if fine:
            assert match(moved, "y_m", "y_p").mismatch > 1e-6
        else:
            with pytest.raises(MeshError, match=r"best translational.*is 0\.000857 from its im"):
                match(moved, "y_m", "y_p", "translational")


def test_markers_that_do_not_match_are_refused_with_numbers():
    mesh = builders.square(6)
    with pytest.raises(MeshError, match=r"'x_m' and 'BLOCK' do not match: 7 and 8 nodes"):
        match(mesh, "x_m", "BLOCK")
    with pytest.raises(MeshError, match=r"allowed is 1e-05; check the markers, PERIODIC_TYPE"):
        match(mesh, "x_m", "y_p", "translational")
    # The opposite sides of a square match by half a turn about its middle, not about 0.
    with pytest.raises(MeshError, match="best rotational transformation"):
        match(mesh, "x_m", "x_p", "rotational")
    pair = match(mesh, "x_m", "x_p", "rotational", origin=(0.5, 0.5, 0.0))
    assert np.degrees(pair.period) == pytest.approx(180.0)


def test_a_marker_is_no_image_of_itself():
    mesh = builders.square(6)
    with pytest.raises(MeshError, match="do not match"):
        match(mesh, "x_m", "x_m")


def test_two_nodes_may_not_share_an_image():
    # Same number of nodes and the same mean, but two of the images fall on one node.
    mesh = builders.square(4, block=False)
    points = mesh.points.copy()
    top = mesh.marker("y_p").nodes[np.argsort(points[mesh.marker("y_p").nodes, 0])]
    points[top, 0] = [0.0, 0.4999999, 0.5, 0.5000001, 1.0]
    with pytest.raises(MeshError, match="do not match"):
        match(mesh.with_points(points), "y_m", "y_p")


def test_a_zero_axis_is_refused():
    with pytest.raises(MeshError, match="axis of rotation has length zero; give a direction"):
        match(builders.passage((2, 4, 4)), "per1", "per2", "rotational", (0, 0, 0))
    with pytest.raises(MeshError, match="length zero"):
        axis_basis((float("nan"), 0, 0))


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda a: np.linalg.norm(a) > 1e-3))
def test_the_basis_of_an_axis_is_right_handed_and_orthonormal(axis):
    basis = axis_basis(axis)
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(basis) == pytest.approx(1.0)
    np.testing.assert_allclose(basis[2] * np.linalg.norm(axis), axis, atol=1e-13)


@pytest.mark.parametrize("k", range(3))
def test_the_basis_of_a_coordinate_axis_is_the_coordinate_axes(k):
    np.testing.assert_array_equal(axis_basis(np.eye(3)[k]), np.roll(np.eye(3), -k - 1, axis=0))


def test_the_axis_frame_pads_2d_points():
    out = in_axis_frame(np.array([[1.0, 2.0]]), origin=(1.0, 1.0, 0.0))
    np.testing.assert_array_equal(out, [[0.0, 1.0, 0.0]])


def test_pairs_are_found_in_any_order():
    mesh = builders.cube(4)
    shifted = only(mesh, "y_p", "y_m")
    assert [(p.first, p.second) for p in pair_up(shifted, ("y_p", "y_m"))] == [("y_p", "y_m")]


def two_pairs(second):
    """A square in four markers on the periodic sides: lower and upper halves of left, right."""
    return builders.grid(
        (4, 4),
        rules=[
            ("left1", lambda p: np.all(p[:, 0] == 0) and p[:, 1].max() <= 2),
            ("left2", lambda p: np.all(p[:, 0] == 0)),
            ("right1", lambda p: np.all(p[:, 0] == 4) and p[:, 1].max() <= 2),
            ("right2", lambda p: np.all(p[:, 0] == 4)),
            ("low", lambda p: np.all(p[:, 1] == 0)),
            ("top", lambda p: True),
        ],
        place=lambda p: p / 4 * np.array([1.0, second]),
    )


@pytest.mark.parametrize("order", ["left1 right1 left2 right2", "left1 right2 left2 right1"])
def test_two_pairs_of_one_period(order):
    # left1 also fits right2, by a shift along the diagonal; then left2 and right1 do not agree.
    pairs = pair_up(two_pairs(1.0), order.split())
    found = {frozenset((p.first, p.second)) for p in pairs}
    assert found == {frozenset(("left1", "right1")), frozenset(("left2", "right2"))}


def test_two_pairs_of_different_periods_are_refused():
    with pytest.raises(MeshError, match=r"'left1', 'right1' \(1 along .* differ; only one period"):
        pair_up(two_pairs(2.0), ("left1", "right1", "left2", "right2", "low", "top"))


def test_two_pairs_of_one_length_in_different_directions_are_refused():
    mesh = builders.square(4, block=False)
    with pytest.raises(MeshError, match=r"\(1 along \(1, 0\)\) and .* \(1 along \(0, 1\)\) differ"):
        pair_up(mesh, ("x_m", "x_p", "y_m", "y_p"))


@pytest.mark.parametrize(
    ("names", "text"),
    [(("x_m",), r"1 periodic markers \(x_m\); they come in pairs"), ((), r"\(none\)")],
)
def test_markers_come_in_pairs(names, text):
    with pytest.raises(MeshError, match=text):
        pair_up(builders.square(4), names)


def test_a_marker_without_partner_gives_the_reason():
    with pytest.raises(MeshError, match=r"'x_m' and 'BLOCK' do not match: 7 and 8 nodes"):
        pair_up(builders.square(6), ("x_m", "BLOCK"))


def test_markers_that_the_mesh_lacks_are_named_beside_a_pair_that_matches():
    with pytest.raises(MeshError, match=r"no marker '1:x_m'; the mesh has "):
        pair_up(builders.square(6), ("x_m", "x_p", "1:x_m", "1:x_p"))


def test_pairs_are_guessed():
    found = find_pairs(only(builders.passage((2, 4, 6)), "per1", "per2", "hub", "blade"))
    assert [(p.first, p.second, p.kind) for p in found] == [("per1", "per2", "rotational")]
    found = find_pairs(builders.square(6))
    assert [(p.first, p.second) for p in found] == [("x_m", "x_p"), ("y_m", "y_p")]
    assert find_pairs(builders.airfoil()) == ()


def test_a_marker_is_guessed_into_one_pair_only():
    mesh = builders.cube(4)
    found = find_pairs(mesh)
    names = [n for p in found for n in (p.first, p.second)]
    assert len(names) == len(set(names))


def test_duplicate_nodes_within_a_marker_do_not_match_by_accident():
    mesh = builders.square(4, block=False)
    a, b = mesh.marker("x_m"), mesh.marker("y_m")
    both = Marker(
        "both",
        Cells.from_blocks([(3, np.concatenate([a.cells.by_type[3][1], b.cells.by_type[3][1]]))]),
    )
    other = Marker(
        "other",
        Cells.from_blocks(
            [(3, np.concatenate([mesh.marker(n).cells.by_type[3][1] for n in ("x_p", "y_p")]))]
        ),
    )
    two = Mesh(mesh.points, mesh.cells, (both, other))
    with pytest.raises(MeshError, match="do not match"):
        match(two, "both", "other", "translational")
