"""Motions: laws of rotation, scaling and sequence, and nodes that two markers share."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slideviz.case.check import check_case
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.moving_nodes import (
    displacement_of,
    displacements,
    moved_together,
    required_displacements,
)
from slideviz.errors import CaseError

coordinate = st.floats(-1e3, 1e3)
clouds = st.sampled_from([2, 3]).flatmap(
    lambda dim: arrays(np.float64, st.tuples(st.integers(1, 6), st.just(dim)), elements=coordinate)
)
angles = st.floats(-720, 720)
axes = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: math.hypot(*axis) > 1e-3)


def moved_points(motions, points):
    return points + displacement_of(motions, points)


def turn(points, angle_deg, point="centroid", axis=(0.0, 0.0, 1.0)):
    axis = axis if points.shape[1] == 3 else (0.0, 0.0, 1.0)
    return moved_points([Rotate("A", angle_deg, point, axis)], points)


def rotation_matrix(angle, axis):
    """Return the rotation as the exponential of the cross product, by its power series."""
    a, b, c = np.array(axis) / np.linalg.norm(axis)
    cross = angle * np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    total, term = np.eye(3), np.eye(3)
    for k in range(1, 80):
        term = term @ cross / k
        total = total + term
    return total


@given(clouds, angles, axes)
def test_rotation_agrees_with_the_exponential_of_the_cross_product(points, angle, axis):
    dim = points.shape[1]
    matrix = rotation_matrix(math.radians(angle % 360), axis if dim == 3 else (0, 0, 1))[:dim, :dim]
    centre = points.mean(axis=0)
    expected = centre + (points - centre) @ matrix.T
    np.testing.assert_allclose(turn(points, angle, axis=axis), expected, atol=1e-8)


def test_positive_angles_turn_counter_clockwise_and_right_handed():
    np.testing.assert_allclose(turn(np.array([[1.0, 0.0]]), 90, (0.0, 0.0)), [[0, 1]], atol=1e-15)
    for axis, start, end in [
        ((0, 0, 2.0), [1, 0, 0], [0, 1, 0]),
        ((3.0, 0, 0), [0, 1, 0], [0, 0, 1]),
        ((0, 0.5, 0), [0, 0, 1], [1, 0, 0]),
    ]:
        found = turn(np.array([start], float), 90, (0.0, 0.0, 0.0), axis)
        np.testing.assert_allclose(found, [end], atol=1e-15)
    flipped = moved_points([Rotate("A", 90, (0.0, 0.0), (0.0, 0.0, -1.0))], np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(flipped, [[0, -1]], atol=1e-15)


@given(clouds, angles, axes)
def test_rotation_and_back_gives_the_points(points, angle, axis):
    origin = (1.0, -2.0, 3.0)[: points.shape[1]]
    there = turn(points, angle, origin, axis)
    np.testing.assert_allclose(turn(there, -angle, origin, axis), points, atol=1e-9)


@given(clouds)
def test_motions_of_nothing_change_no_bit(points):
    dim = points.shape[1]
    motions = [
        Translate("A", (0.0,) * dim),
        Rotate("A", 0.0),
        Rotate("A", 0.0, (0.3,) * dim),
        Scale("A", (1.0,)),
        Scale("A", (1.0,) * dim, (0.7,) * dim),
    ]
    assert (displacement_of(motions, points) == 0).all()
    assert (moved_points(motions, points) == points).all()


def test_small_displacements_of_far_points_keep_their_digits():
    far = np.array([[1e6, 1e6], [1e6 + 1, 1e6]])
    vector = (1.2345678901234567e-7, 0.0)
    assert (displacement_of([Translate("A", vector)], far) == vector).all()
    small = displacement_of([Rotate("A", 1e-6, (1e6, 1e6))], far)[1]
    angle = math.radians(1e-6)
    np.testing.assert_allclose(small, [-(angle**2) / 2, angle], rtol=1e-14)


@given(clouds)
def test_scaling(points):
    dim = points.shape[1]
    centre = points.mean(axis=0)
    double = moved_points([Scale("A", (2.0,))], points)
    np.testing.assert_allclose(double, centre + 2 * (points - centre), atol=1e-9)
    stretched = moved_points([Scale("A", (3.0, 1.0, 1.0)[:dim], (1.0,) * dim)], points)
    np.testing.assert_allclose(stretched[:, 0], 1 + 3 * (points[:, 0] - 1), atol=1e-9)
    assert (stretched[:, 1:] == points[:, 1:]).all()


def test_the_centroid_is_that_of_the_moment():
    points = np.array([[0.0, 0.0], [2.0, 0.0]])
    shift, grow = Translate("A", (10.0, 0.0)), Scale("A", (2.0,))
    assert moved_points([shift, grow], points).tolist() == [[9, 0], [13, 0]]
    about = Scale("A", (2.0,), (0.0, 0.0))
    assert moved_points([shift, about], points).tolist() == [[20, 0], [24, 0]]
    assert moved_points([about, shift], points).tolist() == [[10, 0], [14, 0]]


def test_no_points():
    empty = np.empty((0, 3))
    motions = [Rotate("A", 3.0), Scale("A", (2.0,)), Translate("A", (1.0, 2.0, 3.0))]
    assert moved_points(motions, empty).shape == (0, 3)


def case(*motions, moving=("UPPER",), **values):
    return Case(roles=dict.fromkeys(moving, "moving"), motions=motions, **values)


class TestDisplacements:
    def test_nodes_are_sorted_and_read_only(self, square):
        found = displacements(case(Translate("UPPER", (0.5, 1.0))), square)
        assert found.nodes.tolist() == [12, 13, 14, 15]
        assert found.vectors.tolist() == [[0.5, 1.0]] * 4
        assert not found.vectors.flags.writeable
        assert found.warnings == ()

    def test_3d(self, cube):
        motion = Rotate("TOP", 180.0, "centroid", (0.0, 0.0, 1.0))
        found = displacements(case(motion, moving=("TOP",)), cube)
        opposite = cube.points[[6, 7, 4, 5]] - cube.points[[4, 5, 6, 7]]
        np.testing.assert_allclose(found.vectors, opposite, atol=1e-15)

    def test_shared_nodes_that_agree(self, square):
        both = case(
            Translate("UPPER", (1.0, 0.0)),
            Translate("RIGHT", (1.0, 0.0)),
            moving=("UPPER", "RIGHT"),
        )
        found = displacements(both, square)
        assert found.nodes.tolist() == [3, 7, 11, 12, 13, 14, 15]
        assert (found.vectors == [1.0, 0.0]).all()

    @pytest.mark.parametrize("moving", [("UPPER", "RIGHT"), ("RIGHT", "UPPER")])
    def test_the_first_marker_decides_within_the_tolerance(self, square, moving):
        given = {"UPPER": (1.0, 0.0), "RIGHT": (1.0 + 2e-9, 0.0)}
        motions = [Translate(name, vector) for name, vector in given.items()]
        found = displacements(case(*motions, moving=moving), square)
        assert found.at(np.array([15]))[0].tolist() == list(given[moving[0]])

    def test_shared_nodes_that_do_not_agree(self, square):
        wrong = case(
            Translate("UPPER", (1.0, 0.0)),
            Translate("RIGHT", (1.0, 4e-9)),
            moving=("UPPER", "RIGHT"),
        )
        match = (
            "node 15 is on the moving markers 'UPPER' and 'RIGHT', which displace it "
            "differently; give both the same motion"
        )
        with pytest.raises(CaseError, match=match):
            displacements(wrong, square)

    def test_every_pair_that_disagrees_is_told(self, cube):
        motions = [Translate(name, (float(i), 0, 0)) for i, name in enumerate(cube.marker_names)]
        with pytest.raises(CaseError) as caught:
            displacements(case(*motions, moving=cube.marker_names), cube)
        assert [line.split(",")[0] for line in str(caught.value).splitlines()] == [
            "node 0 (and 1 more) is on the moving markers 'BOTTOM' and 'FRONT'",
            "node 4 (and 1 more) is on the moving markers 'TOP' and 'FRONT'",
        ]

    def test_file_of_all_moving_markers_and_a_motion_after_it(self, square, tmp_path):
        (tmp_path / "d.txt").write_text("15 1 0\n3 2 0\n")
        file = FromFile(tmp_path / "d.txt")
        found = displacements(
            case(file, Translate("RIGHT", (0.0, 0.0)), moving=("UPPER", "RIGHT")), square
        )
        assert found.nodes.tolist() == [3, 7, 11, 12, 13, 14, 15]
        assert found.vectors[:, 0].tolist() == [2, 0, 0, 0, 0, 0, 1]
        (warning,) = found.warnings
        assert "5 of 7 nodes on a moving marker are not listed; they stay" in warning

    def test_several_markers_turn_about_their_common_centroid(self, square):
        names = ("UPPER", "RIGHT")
        nodes = [3, 7, 11, 12, 13, 14, 15]
        centre = square.points[nodes].mean(axis=0)
        for target in (names, names[::-1], ""):
            found = displacements(case(Rotate(target, 30.0), moving=names), square)
            assert found.nodes.tolist() == nodes
            one = displacement_of([Rotate("A", 30.0, tuple(centre.tolist()))], square.points[nodes])
            assert (found.vectors == one).all(), "as one body, to the bit"
            grown = displacements(case(Scale(target, (2.0,)), moving=names), square)
            assert (grown.vectors == square.points[nodes] - centre).all()

    def test_where_they_are_at_that_moment(self, square):
        names = ("UPPER", "RIGHT")
        shift = Translate(names, (5.0, -1.0))
        turned = displacements(case(shift, Rotate(names, 180.0), moving=names), square)
        apart = displacements(case(Rotate(names, 180.0), shift, moving=names), square)
        np.testing.assert_allclose(turned.vectors, apart.vectors, atol=1e-14)

    def test_one_that_moves_beside_them_is_left_alone(self, square):
        moving = ("UPPER", "LOWER", "RIGHT")
        several = case(
            Translate(("UPPER", "RIGHT"), (1.0, 0.0)), Translate("LOWER", (1.0, 0.0)), moving=moving
        )
        assert (displacements(several, square).vectors == [1.0, 0.0]).all()
        lost = case(Translate(("UPPER", "RIGHT"), (1.0, 0.0)), moving=moving)
        with pytest.raises(CaseError, match="moving marker 'LOWER' has no motion"):
            displacements(lost, square)
        wrong = case(Rotate(("UPPER", "LEFT"), 1.0))
        (told,) = check_case(wrong, square)
        assert "motion 1 names 'LEFT', which does not move" in str(told)

    def test_file_of_several_markers(self, square, tmp_path):
        (tmp_path / "d.txt").write_text("15 1 0\n3 2 0\n")
        names = ("UPPER", "RIGHT")
        found = displacements(case(FromFile(tmp_path / "d.txt", names), moving=names), square)
        assert found.vectors[:, 0].tolist() == [2, 0, 0, 0, 0, 0, 1]
        (tmp_path / "d.txt").write_text("0 1 0\n")
        match = r"d\.txt:1: node 0 is not on marker 'UPPER' or 'RIGHT'"
        with pytest.raises(CaseError, match=match):
            displacements(case(FromFile(tmp_path / "d.txt", names), moving=names), square)

    def test_file_of_one_marker(self, square, tmp_path):
        (tmp_path / "d.txt").write_text("12 1 0\n13 1 0\n14 1 0\n15 1 0\n")
        one = case(FromFile(tmp_path / "d.txt", "UPPER"), Scale("UPPER", (2.0,)))
        found = displacements(one, square)
        assert found.vectors[:, 0].tolist() == [-0.5, 0.5, 1.5, 2.5]
        nodes = square.marker("UPPER").nodes
        files = required_displacements(one, square, {"UPPER": nodes})
        seen = moved_together(one.motions, square.points, {"UPPER": nodes}, files)["UPPER"]
        assert (seen == found.vectors).all()
        (tmp_path / "d.txt").write_text("3 1 0\n")
        with pytest.raises(CaseError, match=r"d\.txt:1: node 3 is not on marker 'UPPER'"):
            displacements(one, square)

    def test_problems_of_all_files_at_once(self, square, tmp_path):
        both = case(FromFile(tmp_path / "a.txt"), FromFile(tmp_path / "b.txt", "UPPER"))
        with pytest.raises(CaseError, match=r"a\.txt: there is no such(.|\n)*b\.txt: there is no"):
            displacements(both, square)

    def test_problems_of_the_case_at_once(self, square):
        wrong = case(Translate("UPPER", (1.0, 0.0, 0.0)), moving=("UPPER", "RIGHT", "LEFTT"))
        with pytest.raises(CaseError) as caught:
            displacements(wrong, square)
        assert str(caught.value).splitlines() == [
            "MARKER_MOVING: square.su2 has no marker 'LEFTT'; did you mean LEFT?",
            (
                "moving marker 'RIGHT' has no motion; add MOTION= (RIGHT, translate, ...) or "
                "DEFORMATION_FILENAME, or name it in MARKER_FIXED instead if it stays"
            ),
            "motion 1: the shift has 3 components, and the mesh has 2 dimensions; give 2",
        ]

    def test_the_thesis_displacements(self):
        root = Path(__file__).parents[2] / ".." / "shared" / "meshes" / "thesis"
        if not root.is_dir():
            pytest.skip("the meshes of the thesis are not here")
        import slideviz

        mesh = slideviz.read(root / "square_25.su2")
        given = FromFile(root / "square_25_severe.txt")
        found = displacements(Case(roles={"BLOCK": "moving"}, motions=(given,)), mesh)
        rows = np.loadtxt(given.path)
        assert (found.at(rows[:, 0].astype(int)) == rows[:, 1:]).all()
        # The severe deformation turns the block by 60 degrees and shifts it by (-0.2, -0.3).
        points = mesh.points[found.nodes]
        fit = displacement_of(
            [Rotate("BLOCK", 60.0, "centroid"), Translate("BLOCK", (-0.2, -0.3))], points
        )
        np.testing.assert_allclose(found.vectors, fit, atol=1e-9)


def test_a_radial_push_changes_the_radius_only():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(20, 3))
    axis, point = np.array([1.0, 2.0, -0.5]), np.array([0.3, -1.0, 2.0])
    motion = Radial("A", 1.03, 0.2, tuple(axis), tuple(point))
    moved = moved_points([motion], points)
    unit = axis / np.linalg.norm(axis)

    def parts(at):
        arm = at - point
        along = arm @ unit
        across = arm - along[:, None] * unit
        radius = np.linalg.norm(across, axis=1)
        return along, radius, across / radius[:, None]

    for now, before, wanted in zip(parts(moved), parts(points), (0, 1, 2), strict=True):
        expected = 1.03 * before + 0.2 if wanted == 1 else before
        assert np.allclose(now, expected, rtol=0, atol=1e-12)


def test_a_radial_push_in_2d_leaves_its_centre_where_it_is():
    points = np.array([[1.0, 2.0], [3.0, 2.0]])
    moved = moved_points([Radial("A", 2.0, 0.5, point=(1.0, 2.0))], points)
    assert np.array_equal(moved, [[1.0, 2.0], [5.5, 2.0]])


def test_a_radial_push_by_nothing_changes_no_bit():
    points = np.random.default_rng(1).normal(size=(9, 3))
    assert np.array_equal(moved_points([Radial("A")], points), points)
