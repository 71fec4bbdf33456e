"""Boxes as motions of a case: of the mesh or defined, in sequence with others, checked."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.check import check_case
from slideviz.case.moving_nodes import displacements
from slideviz.errors import CaseError
from slideviz.ffd.box import plane_corners, regular_box
from slideviz.ffd.section import boxes_of, with_boxes
from tests.ffd.ffd_samples import square, unpacked

CORNERS = np.array([[-0.1, -0.2], [1.1, -0.2], [1.1, 0.3], [-0.1, 0.3]])
NUMBERS = tuple(np.column_stack([CORNERS, np.zeros(4)]).ravel()) + (0.0,) * 12


def boxed(mesh, name="BOX", degrees=(3, 1, 1)):
    return with_boxes(mesh, [regular_box(name, plane_corners(CORNERS), degrees, None)])


def case(*motions, **values):
    roles = {"y_low": "moving", "y_high": "fixed"}
    return sv.Case(roles=roles, motions=motions, **values)


def bernstein(u):
    return np.array([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])


@pytest.mark.parametrize("defined", [False, True])
def test_control_point_moves_what_is_in_the_box(defined):
    mesh, values = square(), {}
    if defined:
        values = {"ffd_boxes": (("BOX", NUMBERS),), "ffd_degrees": ((3, 1, 0),)}
    else:
        mesh = boxed(mesh)
    given = displacements(
        case(sv.Ffd("y_low", "BOX", (2, -1, -1), (0.0, 0.5, 0.0)), **values), mesh
    )
    x = mesh.points[given.nodes, 0]
    np.testing.assert_allclose(given.vectors[:, 1], 0.5 * bernstein((x + 0.1) / 1.2)[2], atol=1e-14)
    assert not given.vectors[:, 0].any()
    assert not given.warnings


def test_one_side_in_2d_moves_half_as_far_and_the_rows_add_up():
    mesh = boxed(square())

    def moved(*motions):
        return displacements(case(*motions), mesh).vectors

    one = sv.Ffd("y_low", "BOX", (1, 0, 0), (0.0, 0.5, 0.0))
    other = sv.Ffd("y_low", "BOX", (1, 0, 1), (0.0, 0.5, 0.0))
    both = sv.Ffd("y_low", "BOX", (1, 0, -1), (0.0, 0.5, 0.0))
    np.testing.assert_allclose(moved(one), 0.5 * moved(both), atol=1e-15)
    np.testing.assert_allclose(moved(one, other), moved(both), atol=1e-15)
    np.testing.assert_allclose(moved(both, both), 2 * moved(both), atol=1e-15)


def test_boxes_go_by_undeformed_places_and_other_motions_by_those_of_the_moment():
    mesh = boxed(square())
    ffd = sv.Ffd("y_low", "BOX", (2, -1, -1), (0.0, 0.5, 0.0))
    shift = sv.Translate("y_low", (0.0, 0.25))
    turn = sv.Rotate("y_low", 90.0, (0.0, 0.0))
    first = displacements(case(ffd, shift), mesh)
    second = displacements(case(shift, ffd), mesh)
    np.testing.assert_allclose(first.vectors, second.vectors, atol=1e-15)
    bent = displacements(case(ffd), mesh).vectors + mesh.points[first.nodes]
    turned = displacements(case(ffd, turn), mesh).vectors + mesh.points[first.nodes]
    np.testing.assert_allclose(turned, np.column_stack([-bent[:, 1], bent[:, 0]]), atol=1e-14)


def test_all_control_points_translate_the_mesh_like_translate():
    mesh = boxed(square())
    ffd = case(sv.Ffd("y_low", "BOX", (-1, -1, -1), (0.0, 0.05, 0.0)))
    plain = case(sv.Translate("y_low", (0.0, 0.05)))
    *_, one = sv.deform(ffd, mesh)
    *_, other = sv.deform(plain, mesh)
    np.testing.assert_allclose(one.mesh.points, other.mesh.points, atol=1e-13)


def test_in_3d_and_with_splines():
    mesh = square(4, 3)
    corners = tuple(float(v) for z in (-0.5, 1.5) for x, y in CORNERS for v in (x, y, z))
    values = {
        "ffd_boxes": (("B", corners),),
        "ffd_degrees": ((4, 1, 3),),
        "ffd_blending": "BSPLINE_UNIFORM",
        "ffd_orders": (3, 2, 4),
    }
    alone = case(sv.Ffd("y_low", "B", (2, 0, 1), (0.1, 0.2, 0.3)), **values)
    found = displacements(alone, mesh)
    assert np.ptp(found.vectors[:, 0]) > 0.01
    np.testing.assert_allclose(found.vectors[:, 2], 3 * found.vectors[:, 0], atol=1e-15)
    whole = case(sv.Ffd("y_low", "B", (-1, -1, -1), (0.1, 0.2, 0.3)), **values)
    vectors = displacements(whole, mesh).vectors
    np.testing.assert_allclose(vectors, np.broadcast_to([0.1, 0.2, 0.3], vectors.shape), atol=1e-14)


def test_box_of_the_mesh_goes_before_one_of_the_case():
    mesh = boxed(square(), degrees=(3, 1, 1))
    values = {"ffd_boxes": (("BOX", NUMBERS),), "ffd_degrees": ((7, 1, 0),)}
    problems = check_case(case(sv.Ffd("y_low", "BOX", (5, 0, 0), (0, 1, 0)), **values), mesh)
    assert "i goes from 0 to 3" in str(problems[0])


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (("BOXX", (0, 0, 0), (0, 1, 0)), "motion 1: mesh has no FFD box 'BOXX'; did you mean BOX"),
        (("", (0, 0, 0), (0, 1, 0)), "motion 1: it names no FFD box; choose one of the mesh"),
        (("BOX", (4, 0, 0), (0, 1, 0)), "no control point with i = 4; i goes from 0 to 3, and -1"),
        (("BOX", (0, 0, 2), (0, 1, 0)), "no control point with k = 2; k goes from 0 to 1"),
        (("BOX", (0, 0, 0), (0, 1, 0.3)), "dz is 0.3, which leaves the plane; in 2D write 0"),
    ],
)
def test_mistakes_are_told_before_the_run(motion, message):
    with pytest.raises(CaseError, match=message):
        next(sv.deform(case(sv.Ffd("y_low", *motion)), boxed(square())))


def test_box_without_a_node_inside_is_told():
    far = regular_box("FAR", plane_corners(CORNERS + 7.0), (1, 1, 1), None)
    mesh = with_boxes(square(), [far])
    with pytest.raises(CaseError, match="motion 1: no node of 'y_low' is in the FFD box 'FAR'"):
        next(sv.deform(case(sv.Ffd("y_low", "FAR", (0, 0, 0), (0, 1, 0))), mesh))


def test_moving_marker_without_a_motion_is_told_with_remedies_that_help():
    ffd = ("BOX", (2, 0, 0), (0.0, 0.1, 0.0))
    mesh = boxed(square())
    roles = {"y_low": "moving", "y_high": "moving"}
    found = check_case(case(sv.Ffd("y_low", *ffd)).change(roles=roles), mesh)
    assert "moving marker 'y_high' has no motion" in str(found[0])
    assert "or name it in MARKER_FIXED instead if it stays, or move all movin" in str(found[0])
    every = displacements(case(sv.Ffd("", *ffd)).change(roles=roles), mesh)
    alone = displacements(case(sv.Ffd("y_low", *ffd)), mesh)
    assert np.array_equal(every.vectors[np.isin(every.nodes, alone.nodes)], alone.vectors)
    assert not every.vectors[~np.isin(every.nodes, alone.nodes)].any()
    assert alone.vectors.any()


def test_mesh_without_boxes_and_wrong_definitions_are_told():
    motion = sv.Ffd("y_low", "BOX", (0, 0, 0), (0.0, 1.0, 0.0))
    assert "none is in it, or in FFD_DEFINITION" in str(check_case(case(motion), square())[0])
    flat = case(motion, ffd_boxes=(("BOX", (0.0,) * 24),), ffd_degrees=((3, 1, 0),))
    assert "box 'BOX': the corners enclose no volume" in str(check_case(flat, square())[0])
    fewer = case(motion, ffd_boxes=(("BOX", NUMBERS),))
    (said, *_) = check_case(fewer, square())
    assert "FFD_DEGREE is missing; give a degree (i, j, k) for each" in str(said)
    more = case(motion, ffd_boxes=(("BOX", NUMBERS),), ffd_degrees=((3, 1, 0),) * 2)
    assert "FFD_DEFINITION has 1 and FFD_DEGREE 2; give a" in str(check_case(more, square())[0])


def test_case_file_with_boxes_as_su2_writes_them(tmp_path):
    sv.write(tmp_path / "mesh.su2", square())
    numbers = ", ".join(map(str, NUMBERS))
    (tmp_path / "a.cfg").write_text(
        "MESH_FILENAME= mesh.su2\nMARKER_MOVING= (y_low)\n"
        f"FFD_DEFINITION= (BOX, {numbers}); (TWO, {numbers})\n"
        "FFD_DEGREE= (3, 1, 0); (2, 1, 0)\nFFD_BLENDING= BSPLINE_UNIFORM\n"
        "FFD_BSPLINE_ORDER= 3, 2, 4\n"
        "MOTION= (y_low, ffd, BOX, 2, 0, -1, 0.0, 0.1, 0.0) ; (y_low, ffd, TWO, 1, 0, 0.0, 0.1)\n"
    )
    read = sv.Case.read(tmp_path / "a.cfg")
    assert read.ffd_degrees == ((3, 1, 0), (2, 1, 0))
    assert read.motions[1] == sv.Ffd("y_low", "TWO", (1, 0, -1), (0.0, 0.1, 0.0))
    read.write(tmp_path / "b.cfg")
    again = sv.Case.read(tmp_path / "b.cfg")
    assert again.change(source=None, mesh_file=None) == read.change(source=None, mesh_file=None)
    assert displacements(again, square()).vectors[:, 1].max() > 0.05


def test_usual_case_file_says_nothing_of_boxes(tmp_path):
    case(sv.Translate("y_low", (0.0, 0.1))).write(tmp_path / "a.cfg")
    assert "FFD" not in (tmp_path / "a.cfg").read_text()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("FFD_DEFINITION= (BOX, 1, 2, 3)", "box 'BOX' has 3 numbers; expected its name and 24"),
        ("FFD_DEGREE= (3, 1)", r"\(3, 1\) is not three whole numbers from 0"),
        ("FFD_BSPLINE_ORDER= 3, 0, 4", r"\(3, 0, 4\) is not three whole numbers from 1"),
        ("FFD_BLENDING= NURBS", "'NURBS' is not one of BEZIER | BSPLINE_UNIFORM"),
    ],
)
def test_wrong_keys_are_told_with_their_line(line, message, tmp_path):
    (tmp_path / "a.cfg").write_text(f"MARKER_MOVING= (y_low)\n{line}\n")
    with pytest.raises(CaseError, match=rf"a.cfg:2: {line.split('=')[0]}: {message}"):
        sv.Case.read(tmp_path / "a.cfg")


def test_coordinates_of_another_mesh_are_warned_about(tmp_path):
    mesh = sv.read(unpacked("naca0012_two_ffd_boxes.su2", tmp_path))
    assert len(boxes_of(mesh)) == 2
    roles = {"airfoil_upper": "moving", "airfoil_lower": "moving"}
    motions = (
        sv.Ffd("airfoil_upper", "UPPER", (2, 1, -1), (0.0, 0.01, 0.0)),
        sv.Ffd("airfoil_lower", "LOWER", (2, 0, -1), (0.0, -0.01, 0.0)),
    )
    good = displacements(sv.Case(roles=roles, motions=motions), mesh)
    assert not good.warnings
    assert (np.abs(good.vectors[:, 1]) > 0).sum() == 80
    shifted = mesh.with_points(mesh.points + np.array([0.0, 0.001]))
    found = displacements(sv.Case(roles=roles, motions=motions), shifted)
    assert "differ from the mesh by up to 0.0" in found.warnings[0]


def test_prescribed_displacements_move_their_nodes_and_leave_others():
    mesh = square()
    nodes = np.sort(mesh.marker("y_low").nodes[2:4])
    given = sv.Prescribed(nodes, np.array([[0.0, 0.01], [0.0, 0.02]]))
    *_, last = sv.deform(case(given), mesh)
    moved = last.mesh.points - mesh.points
    np.testing.assert_allclose(moved[nodes], given.vectors, atol=1e-15)
    others = np.setdiff1d(mesh.marker("y_low").nodes, nodes)
    np.testing.assert_allclose(moved[others], 0.0, atol=1e-15)


def test_boxes_of_the_mesh_move_with_the_surface(tmp_path):
    mesh = boxed(square())
    one = sv.Ffd("y_low", "BOX", (1, 0, -1), (0.0, 0.05, 0.0))
    two = sv.Ffd("y_low", "BOX", (2, -1, -1), (0.02, 0.0, 0.0))
    steps = list(sv.deform(case(one, two, steps=2), mesh))
    (before,), (after,) = boxes_of(mesh), boxes_of(steps[-1].mesh)
    change = before.change(one.index, one.vector) + before.change(two.index, two.vector)
    np.testing.assert_allclose(after.points - before.points, change, atol=1e-15)
    np.testing.assert_allclose(boxes_of(steps[0].mesh)[0].points - before.points, 0.5 * change)
    sv.write(tmp_path / "out.su2", steps[-1].mesh)
    again = sv.read(tmp_path / "out.su2")
    # The surface is still that of the box: it can be moved on from there.
    found = displacements(case(one), again)
    assert not found.warnings
    nodes = mesh.marker("y_low").nodes
    first = displacements(case(one), mesh).vectors
    np.testing.assert_allclose(found.vectors, first, atol=1e-12)
    assert not np.allclose(again.points[nodes], mesh.points[nodes])


def test_boxes_that_cannot_follow_stay_and_a_note_says_so():
    mesh = boxed(square())
    one = sv.Ffd("y_low", "BOX", (1, 0, -1), (0.0, 0.05, 0.0))
    *_, last = sv.deform(case(one, sv.Translate("y_low", (0.0, 0.01))), mesh)
    assert np.array_equal(boxes_of(last.mesh)[0].points, boxes_of(mesh)[0].points)
    (note,) = [text for text in last.warnings if "FFD" in text]
    assert "the FFD box 'BOX' in the deformed mesh stays where it was" in note


def test_wrong_prescribed_displacements_are_told():
    mesh = square()
    inner = 40
    with pytest.raises(CaseError, match=r"motion 1: node 40 is on none of the markers that it mov"):
        next(sv.deform(case(sv.Prescribed([inner], [[0.0, 0.1]])), mesh))
    low = mesh.marker("y_low").nodes[2:3]
    with pytest.raises(CaseError, match="its vectors have 3 components, and the mesh 2 dimensions"):
        next(sv.deform(case(sv.Prescribed(low, [[0.0, 0.1, 0.0]])), mesh))
    with pytest.raises(CaseError, match=r"the shapes \(2,\) and \(1, 2\); expected"):
        sv.Prescribed([1, 2], [[0.0, 0.1]])
    with pytest.raises(CaseError, match="nodes must be ascending, each once"):
        sv.Prescribed([2, 1], [[0.0, 0.1], [0.0, 0.1]])
