"""Motions of camber, thickness and twist by boxes, and boxes in other coordinates."""

from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.check import check_case
from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motion_words import describe, motion_labels
from slideviz.case.moving_nodes import displacements
from slideviz.design.sweeps.table import numbers_of, sources_of
from slideviz.errors import CaseError
from slideviz.ffd.box import CoordinateSystem, plane_corners, regular_box
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.session.reach import moves_nothing
from tests.ffd.ffd_samples import square
from tests.oracles.freeform import blended, rotated

CORNERS = np.array([[-0.1, -0.2], [1.1, -0.2], [1.1, 0.3], [-0.1, 0.3]])
UNIT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]] * 2, float)
UNIT[4:, 2] = 1.0
LOW, HIGH = np.array([-0.1, -0.2, -0.3]), np.array([1.2, 1.1, 0.4])
CAMBER = sv.FfdCamber("z_low", "BOX", (1, -1), 0.2)
THICK = sv.FfdThickness("z_low", "BOX", (2, 1), 0.1)
TWIST = sv.FfdTwist("z_low", "BOX", 1, 25.0, (0.4, 0.0, 0.1), (0.1, 2.0, 0.0))
SHIFT = sv.Ffd("z_low", "BOX", (1, 1, 1), (0.1, -0.2, 0.3))
CURVED = {"ffd_system": "CYLINDRICAL", "ffd_axis": (-0.5, -1.5, -2.0)}


def solid(system=None):
    """A cube with a box around its lower side."""
    corners = LOW + UNIT * (HIGH - LOW)
    box = regular_box("BOX", corners, (3, 2, 2), None)
    if system is not None:
        box = regular_box("BOX", system.points_of(corners), (3, 2, 2), None, system)
    return with_boxes(square(3, 3), [box])


def flat():
    return with_boxes(square(), [regular_box("BOX", plane_corners(CORNERS), (3, 2, 1), None)])


def case(*motions, marker="z_low", **values):
    return sv.Case(roles={marker: "moving"}, motions=motions, **values)


def after(points, motion):
    """The control points (I, J, K, 3) after a motion, in 3D."""
    new = points.copy()
    if isinstance(motion, sv.FfdTwist):
        for i, k in np.ndindex(points.shape[0], points.shape[2]):
            at, angle = points[i, motion.plane, k], np.radians(motion.angle_deg)
            new[i, motion.plane, k] = rotated(at, np.array(motion.point), motion.axis, angle)
        return new
    for i, j, k in np.ndindex(*points.shape[:3]):
        if any(w not in (-1, at) for w, at in zip(motion.index, (i, j, k), strict=False)):
            continue
        if isinstance(motion, sv.Ffd):
            new[i, j, k] += motion.vector
        elif isinstance(motion, sv.FfdCamber):
            new[i, j, k, 2] += motion.amount
        else:
            new[i, j, k, 2] += (-1.0, 0.0, 1.0)[k] * motion.amount
    return new


@pytest.mark.parametrize(
    "motions",
    [(CAMBER,), (THICK,), (TWIST,), (SHIFT, TWIST, CAMBER, THICK), (TWIST, SHIFT, TWIST)],
)
def test_control_points_move_one_motion_after_the_other(motions):
    mesh = solid()
    found = displacements(case(*motions), mesh)
    points = boxes_of(mesh)[0].points
    for motion in motions:
        points = after(points, motion)
    for node, by in zip(found.nodes, found.vectors, strict=True):
        at = mesh.points[node]
        right = blended(points, (at - LOW) / (HIGH - LOW)) - at
        np.testing.assert_allclose(by, right, rtol=0, atol=1e-14)
    assert found.vectors.any()
    *_, last = sv.deform(case(*motions, reduction=None), mesh)
    np.testing.assert_allclose(boxes_of(last.mesh)[0].points, points, rtol=0, atol=1e-14)


@pytest.mark.parametrize("kind", [sv.FfdCamber, sv.FfdThickness])
def test_columns_of_a_plane_mesh_go_along_y(kind):
    mesh = flat()
    found = displacements(case(kind("y_low", "BOX", (1, -1), 0.4), marker="y_low"), mesh)
    u, v = (mesh.points[found.nodes, 0] + 0.1) / 1.2, 0.2 / 0.5
    weight = 3 * u * (1 - u) ** 2
    side = 1.0 if kind is sv.FfdCamber else v**2 - (1 - v) ** 2
    np.testing.assert_allclose(found.vectors[:, 1], 0.4 * side * weight, atol=1e-15)
    assert not found.vectors[:, 0].any()


def test_boxes_in_cylindrical_coordinates_move_along_them():
    system = CoordinateSystem(CURVED["ffd_system"], CURVED["ffd_axis"])
    mesh = square(3, 3)
    q = system.q_of(mesh.points)
    low, high = q.min(axis=0) - 0.1, q.max(axis=0) + 0.1
    corners = system.points_of(low + UNIT * (high - low))
    numbers = tuple(corners.ravel().tolist())
    values = {**CURVED, "ffd_boxes": (("BOX", numbers),), "ffd_degrees": ((3, 2, 2),)}
    whole = case(SHIFT, CAMBER, THICK, **values)
    assert check_case(whole, mesh) == ()
    found = displacements(whole, mesh)
    box = regular_box("BOX", corners, (3, 2, 2), None, system)
    points = box.q
    for motion in whole.motions:
        points = after(points, motion)
    for node, by in zip(found.nodes, found.vectors, strict=True):
        there = blended(points, (q[node] - low) / (high - low))
        np.testing.assert_allclose(by, system.points_of(there) - mesh.points[node], atol=1e-13)
    # The box of a mesh is read in the coordinates of the case, and follows.
    boxed = with_boxes(mesh, [box])
    again = case(SHIFT, CAMBER, THICK, reduction=None, **CURVED)
    np.testing.assert_allclose(displacements(again, boxed).vectors, found.vectors, atol=1e-13)
    *_, last = sv.deform(again, boxed)
    np.testing.assert_allclose(boxes_of(last.mesh, system)[0].q, points, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("motion", "values", "message"),
    [
        (sv.FfdTwist("y_low", "BOX", 0, 5.0), {}, "a box in 2D has no span to twist along"),
        (sv.FfdCamber("y_low", "BOX", (9, -1), 1.0), {}, "no control point with i = 9"),
        (sv.FfdCamber("y_low", "", (1, -1), 1.0), {}, "it names no FFD box"),
        (sv.FfdCamber("y_low", "B", (1, -1), 1.0), {}, "has no FFD box 'B'"),
    ],
)
def test_motions_that_do_not_fit_a_plane_mesh_are_told(motion, values, message):
    (said,) = check_case(case(motion, marker="y_low", **values), flat())
    assert message in str(said)


def test_motions_that_do_not_fit_the_coordinates_are_told():
    system = CoordinateSystem(CURVED["ffd_system"], CURVED["ffd_axis"])
    box = regular_box(
        "BOX", system.points_of(LOW + 3 + UNIT * (HIGH - LOW)), (3, 2, 2), None, system
    )
    (said,) = check_case(case(TWIST, **CURVED), with_boxes(square(3, 3), [box]))
    words = "ffd-twist turns control points in x, y and z, and FFD_COORD_SYSTEM is CYLIND"
    assert words in str(said)
    thick = case(sv.FfdCamber("y_low", "BOX", (1, -1), 0.1), marker="y_low", **CURVED)
    (said,) = check_case(thick, flat())
    assert "in 2D it needs FFD_COORD_SYSTEM= CARTESIAN, which is CYLINDRICAL" in str(said)
    by, turned = (
        check_case(case(sv.Ffd("y_low", "BOX", (1, -1, -1), to), marker="y_low", **CURVED), flat())
        for to in ((0.1, 0.0, 0.2), (0.0, 0.2, 0.0))
    )
    assert not by
    assert "dθ is 0.2, which leaves the plane; in 2D write 0" in str(turned[0])


def test_nested_boxes_of_a_run_stay_and_a_note_says_so():
    mesh = solid()
    outer = boxes_of(mesh)[0]
    text = with_boxes(mesh, [outer, replace(outer, name="IN")], anew=True).origin.ffd.decode()
    first, tag, second = text.replace("NLEVEL= 1", "NLEVEL= 2").partition("FFD_TAG= IN")
    first = first.replace("FFD_CHILDREN= 0", "FFD_CHILDREN= 1\nIN")
    second = second.replace("LEVEL= 0", "LEVEL= 1").replace("PARENTS= 0", "PARENTS= 1\nBOX")
    mesh = replace(mesh, origin=replace(mesh.origin, ffd=(first + tag + second).encode()))
    (note,) = displacements(case(CAMBER), mesh).warnings
    assert "'BOX' in the deformed mesh stays where it was, because boxes are nested" in str(note)
    *_, last = sv.deform(case(CAMBER, reduction=None), mesh)
    for box, before in zip(boxes_of(last.mesh), boxes_of(mesh), strict=True):
        np.testing.assert_array_equal(box.points, before.points)


MOTIONS = [
    (CAMBER, "camber (1, all) of BOX +0.2", "(z_low, ffd-camber, BOX, 1, -1, 0.2)"),
    (THICK, "thickness (2, 1) of BOX +0.1", "(z_low, ffd-thickness, BOX, 2, 1, 0.1)"),
    (
        TWIST,
        "twist plane 1 of BOX +25° about (0.1, 2, 0) through (0.4, 0, 0.1)",
        "(z_low, ffd-twist, BOX, 1, 25.0, (0.1, 2.0, 0.0), (0.4, 0.0, 0.1))",
    ),
    (
        sv.FfdTwist("", "BOX", -1, -5.0),
        "twist all planes of BOX -5° about y through (0, 0, 0)",
        "(*, ffd-twist, BOX, -1, -5.0, y, (0.0, 0.0, 0.0))",
    ),
]


@pytest.mark.parametrize(("motion", "words", "text"), MOTIONS)
def test_motions_in_words_and_in_a_file(motion, words, text):
    assert describe(motion, 3).partition(": ")[2] == words
    assert write_motions((motion,)) == text
    assert read_motions(text) == (motion,)
    assert not moves_nothing(motion)
    other = replace(motion, box="OTHER")
    assert len(set(motion_labels([case(motion), case(other), case()]))) == 3
    if isinstance(motion, sv.FfdTwist):
        assert moves_nothing(replace(motion, angle_deg=0.0))
        apart = replace(motion, point=(7.0, 0.0, 0.0))
        assert len(set(motion_labels([case(motion), case(apart)]))) == 2
    else:
        assert moves_nothing(replace(motion, amount=0.0))


def test_forms_of_a_plane_mesh_and_of_short_axes_are_read():
    assert read_motions("(a, ffd-camber, BOX, 2, 0.1)") == (sv.FfdCamber("a", "BOX", (2, -1), 0.1),)
    right = sv.FfdTwist("a", "BOX", 2, 5.0, (1.0, 2.0, 3.0), (0.0, 1.0, 0.0))
    assert read_motions("(a, ffd-twist, BOX, 2, 5, Y, 1, 2, 3)") == (right,)
    assert read_motions("(a, ffd-twist, BOX, 2, 5, 0, 1, 0, 1, 2, 3)") == (right,)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("(a, ffd-camber, BOX, 1)", "expected the box, the column of control points i, j"),
        ("(a, ffd-thickness)", "in 2D ffd-thickness, BOX, 2, 0.01"),
        ("(a, ffd-thickness, BOX, 1.5, 0, 0.1)", r"invalid control point \(1.5, 0\); write int"),
        ("(a, ffd-twist, BOX, 1, 5, y, 0, 0)", "expected the box, the plane j of control points"),
        ("(a, ffd-twist, BOX, -2, 5, y, 0, 0, 0)", r"invalid control point \(-2\)"),
        ("(a, ffd-twist, BOX, 1, 5, 0, 0, 0, 1, 1, 1)", "has no direction"),
    ],
)
def test_wrong_forms_are_told(text, message):
    with pytest.raises(CaseError, match=message):
        read_motions(text)


def test_numbers_of_a_sweep_have_their_box_and_place():
    names = set(numbers_of(case(CAMBER, TWIST)))
    assert "z_low.ffd-camber.BOX.1.-1.amount" in names
    assert "z_low.ffd-twist.BOX.1.angle_deg" in names
    assert not any("plane" in name for name in names)


def test_coordinates_of_boxes_are_kept_in_a_case_file(tmp_path):
    case(CAMBER, **CURVED).write(tmp_path / "a.cfg")
    text = (tmp_path / "a.cfg").read_text()
    assert "FFD_COORD_SYSTEM= CYLINDRICAL" in text
    again = sv.Case.read(tmp_path / "a.cfg")
    assert (again.ffd_system, again.ffd_axis) == (CURVED["ffd_system"], CURVED["ffd_axis"])
    case(CAMBER).write(tmp_path / "a.cfg")
    assert "COORD_SYSTEM" not in (tmp_path / "a.cfg").read_text()


def test_results_of_a_sweep_know_boxes_in_other_coordinates():
    system = CoordinateSystem(CURVED["ffd_system"], CURVED["ffd_axis"])
    box = regular_box(
        "BOX", system.points_of(LOW + 3 + UNIT * (HIGH - LOW)), (3, 2, 2), None, system
    )
    mesh = with_boxes(square(3, 3), [box])
    first = sources_of(case(CAMBER, **CURVED), mesh)
    boxes_of(mesh, system)[0].at(np.full((1, 3), 0.5))
    assert sources_of(case(CAMBER, **CURVED), mesh) == first
    moved = with_boxes(mesh, [box.moved(np.full(box.points.shape, 0.1))])
    assert sources_of(case(CAMBER, **CURVED), moved) != first
