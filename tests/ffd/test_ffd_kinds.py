"""Moves of control points by SU2's kinds of FFD variables, against formulas written out."""

import numpy as np
import pytest

from slideviz.ffd.box import CoordinateSystem, lattice, polar_corners, regular_box
from slideviz.ffd.kinds import KINDS, Request, moves_of, variable_problem
from tests.oracles.freeform import moved

CUBE = 1.0 * np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
LINE = (0.3, -0.2, 0.1, 0.4, 1.3, 0.2)
CASES = [
    ("FFD_CONTROL_POINT", (1, 2, 0), (0.1, 0.2, -0.3)),
    ("FFD_CONTROL_POINT", (-1, 2, 1), (0.1, 0.2, -0.3)),
    ("FFD_CONTROL_POINT", (1, -1, 1), (0.0, 0.0, 0.0)),
    ("FFD_CONTROL_POINT", (2, -1, -1), (0.1, 0.2, -0.3)),
    ("FFD_CONTROL_POINT", (-1, -1, -1), (0.1, 0.2, -0.3)),
    ("FFD_CONTROL_POINT_2D", (1, 2), (0.1, 0.2)),
    ("FFD_CONTROL_POINT_2D", (-1, 2), (0.0, 0.0)),
    ("FFD_CONTROL_POINT_2D", (-1, -1), (0.1, 0.2)),
    ("FFD_CAMBER", (1, 2), ()),
    ("FFD_CAMBER_2D", (2,), ()),
    ("FFD_THICKNESS", (2, 1), ()),
    ("FFD_THICKNESS_2D", (1,), ()),
    ("FFD_GULL", (2,), ()),
    ("FFD_TWIST", (2,), LINE),
    ("FFD_TWIST", (4,), (0.3, -0.2, 0.1, 0.4, 0.7, 0.2)),  # ends before the plane
    ("FFD_TWIST", (1,), (0.3, 0.2, 0.1, 0.3, 0.2, 0.1)),  # a point
    ("FFD_ROTATION", (), LINE),
    ("FFD_CONTROL_SURFACE", (), LINE),
    ("FFD_NACELLE", (1, 1, 0), (0.1, 0.2)),
    ("FFD_NACELLE", (1, 2, 0), (0.1, 0.2)),  # its own mirror image
    ("FFD_NACELLE", (-1, 0, 1), (0.1, 0.2)),
    ("FFD_NACELLE", (2, -1, -1), (0.1, 0.2)),
    ("FFD_NACELLE", (-1, -1, -1), (0.1, 0.2)),
]
VALUES = (0.1, 0.2, 0.3)
HELD = [((), (), ()), ((0,), (4,), ()), ((1,), (), ()), ((), (2,), (0,)), ((3,), (0,), (2,))]


def box(degrees=(3, 4, 2)):
    """A sheared box whose control points have been moved already."""
    shear = np.array([[1.0, 0.1, 0.0], [0.2, 1.0, 0.0], [0.0, 0.1, 1.0]])
    found = regular_box("B", CUBE @ shear, degrees, None)
    return found.moved(0.02 * np.sin(np.arange(found.points.size)).reshape(found.points.shape))


def after(one, kind, index, numbers, values, held):
    """The control points after a variable, by the moves of its kind."""
    request = Request(kind, index, numbers, length=1.7)
    points = one.points
    moves = moves_of(one, request, tuple(map(frozenset, held)))
    factor = 1.0 if request.direct else 0.5
    for move, value in zip(moves, values, strict=False):
        points = points + move.change(points, factor * value)
    return points


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize(("kind", "index", "numbers"), CASES)
def test_each_kind_moves_what_su2_moves(kind, index, numbers, held):
    one, values = box(), (0.31, -0.2, 0.4)
    right = moved(kind, index, numbers, values, one.points, held, relax=0.5, length=1.7)
    np.testing.assert_allclose(
        after(one, kind, index, numbers, values, held), right, rtol=0, atol=1e-15
    )


def test_each_kind_has_a_case_in_which_it_moves_points():
    one = box()
    moving = {kind for kind, at, by in CASES if any(moves_of(one, Request(kind, at, by)))}
    assert moving == set(KINDS) - {"FFD_ANGLE_OF_ATTACK"}
    assert moves_of(one, Request("FFD_ANGLE_OF_ATTACK", (), (1.0,))) == ()


@pytest.mark.parametrize(("kind", "index", "numbers"), CASES)
def test_moves_have_exact_derivatives(kind, index, numbers):
    one, step = box(), 1e-6
    rates = np.cos(np.arange(one.points.size)).reshape(one.points.shape)
    for move in moves_of(one, Request(kind, index, numbers, length=1.7)):
        points, amount = one.points, 0.4

        def at(by, points=points, move=move):
            return points + move.change(points, by)

        slope = (at(amount + step) - at(amount - step)) / (2 * step)
        np.testing.assert_allclose(move.slope(points, amount), slope, rtol=0, atol=1e-8)
        ends = [at(amount, points + s * step * rates) for s in (1.0, -1.0)]
        pushed = move.pushed(points, amount, rates)
        np.testing.assert_allclose(pushed, (ends[0] - ends[1]) / (2 * step), rtol=0, atol=1e-8)


def test_polar_control_points_have_their_second_index_along_k():
    flat = np.array([[0.5, 0.2], [0.6, 0.9], [1.6, 1.0], [1.5, 0.3]])
    polar = CoordinateSystem("POLAR", (0.0, 0.0, 0.0))
    one = regular_box("B", polar_corners(flat), (2, 1, 3), None, polar)
    (move,) = moves_of(one, Request("FFD_CONTROL_POINT_2D", (1, 3), (0.1, 0.2)))
    right = moved("FFD_CONTROL_POINT_2D", (1, 3), (0.1, 0.2), (0.5,), one.q, polar=1)
    np.testing.assert_allclose(one.q + move.change(one.q, 0.5), right, rtol=0, atol=1e-16)


@pytest.mark.parametrize(
    ("kind", "index", "numbers", "dim", "message"),
    [
        ("FFD_CAMBER", (-1, 0), (), 3, "FFD_CAMBER has no index -1; write one from 0"),
        ("FFD_GULL", (5,), (), 3, "no control point with j = 5"),
        ("FFD_TWIST", (7,), LINE, 3, "no control point with j = 7"),
        ("FFD_ROTATION", (), (1.0, 2.0, 3.0) * 2, 3, "its two points coincide"),
        (
            "FFD_ROTATION",
            (),
            LINE,
            2,
            "FFD_ROTATION moves points out of the plane of a mesh of 2 dim",
        ),
        ("FFD_TWIST", (0,), LINE, 2, "FFD_TWIST moves points out of the plane"),
        ("FFD_CAMBER", (1, 0), (), 2, "of a mesh of 2 dimensions; take FFD_CAMBER_2D"),
        (
            "FFD_CONTROL_POINT",
            (1, 0, 0),
            (0.0, 0.0, 1.0),
            2,
            "out of the plane of a mesh of 2 dimensions",
        ),
        ("FFD_NACELLE", (1, 0, 0), (0.0, 1.0), 2, "out of the plane of a mesh of 2 dimensions"),
    ],
)
def test_impossible_variables_are_told(kind, index, numbers, dim, message):
    assert message in variable_problem(box(), Request(kind, index, numbers), dim, VALUES)


def test_possible_variables_have_no_problem():
    for kind, index, numbers in CASES:
        assert variable_problem(box(), Request(kind, index, numbers), 3, VALUES) == ""
    assert variable_problem(box(), Request("FFD_CAMBER_2D", (1,), ()), 2, VALUES) == ""
    line = (0.1, 0.2, 0.0, 0.1, 0.2, 1.0)
    assert variable_problem(box(), Request("FFD_ROTATION", (), line), 2, VALUES) == ""


def test_second_polar_index_must_be_one_point():
    polar = CoordinateSystem("POLAR")
    flat = np.array([[0.5, 0.2], [0.6, 0.9], [1.6, 1.0], [1.5, 0.3]])
    one = regular_box("B", polar_corners(flat), (2, 1, 3), None, polar)
    said = variable_problem(one, Request("FFD_CONTROL_POINT_2D", (1, -1), (0.1, 0.2)), 2, VALUES)
    assert "no second index -1 in polar coordinates" in said
    assert "out of the plane" in variable_problem(
        one, Request("FFD_CAMBER_2D", (1,), ()), 2, VALUES
    )


@pytest.mark.parametrize("kind", ["CYLINDRICAL", "SPHERICAL", "POLAR"])
def test_coordinates_go_back_and_have_exact_derivatives(kind):
    system = CoordinateSystem(kind, (0.1, -0.2, 0.3))
    points = np.array([[1.0, 0.5, 0.2], [-1.0, 2.0, -0.7], [0.3, -0.9, -0.4], [0.2, -1.0, 0.9]])
    q = system.q_of(points)
    x, y, z = (points - np.array(system.origin)).T
    assert (q[:, 1] <= np.pi / 2).all()
    assert (q[:, 1] > -1.5 * np.pi).all()
    if kind == "CYLINDRICAL":
        np.testing.assert_allclose(q[:, 0] ** 2, y**2 + z**2, rtol=1e-15)
        np.testing.assert_allclose(q[:, 2], x)
    else:
        np.testing.assert_allclose(q[:, 0] ** 2, x**2 + y**2 + z**2, rtol=1e-15)
        np.testing.assert_allclose(np.cos(q[:, 2]) * q[:, 0], x, rtol=1e-14)
    np.testing.assert_allclose(np.tan(q[:, 1]), z / y, rtol=1e-14)
    np.testing.assert_allclose(system.points_of(q), points, rtol=0, atol=1e-15)
    rates, step = np.cos(np.arange(12.0)).reshape(4, 3), 1e-6
    ends = [system.points_of(q + s * step * rates) for s in (1.0, -1.0)]
    slope = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(system.pushed(q, rates), slope, rtol=0, atol=1e-9)


def test_box_in_a_system_is_regular_in_its_coordinates():
    system = CoordinateSystem("CYLINDRICAL", (0.0, 0.1, 0.0))
    r, theta, x = (0.5, 1.0), (-0.4, 0.5), (0.0, 2.0)
    q = np.array([[r[int(a)], theta[int(b)], x[int(c)]] for a, b, c in CUBE])
    one = regular_box("B", system.points_of(q), (2, 3, 4), None, system)
    np.testing.assert_allclose(one.q, lattice(q, (2, 3, 4)), rtol=0, atol=1e-15)
