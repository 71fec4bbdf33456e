"""Boxes: literal oracles of the blending, the laws of free-form deformation, and the inverse."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.errors import CaseError
from slideviz.ffd.box import CORNERS, Box, blending, lattice, plane_corners, regular_box
from slideviz.ffd.deformation import parametric

WARPED = CORNERS * [3.0, 2.0, 1.0] + np.random.default_rng(1).normal(size=(8, 3)) * 0.1
BLENDINGS = {
    "bezier": ((5, 3, 1), None),
    "cubic splines": ((6, 4, 3), (4, 3, 2)),
    "linear splines": ((4, 2, 2), (2, 2, 2)),
}


def de_casteljau(points, t):
    """The point of a Bézier curve at ``t``, by repeated means of neighbours."""
    points = [np.array(p, float) for p in points]
    while len(points) > 1:
        points = [(1 - t) * a + t * b for a, b in pairwise(points)]
    return points[0]


def cox_de_boor(knots, i, order, t):
    """A B-spline by its recursion, literally; 0/0 is 0, and the last is closed at t = 1."""
    if order == 1:
        last = knots[i] < knots[i + 1] == knots[-1]
        return float(knots[i] <= t < knots[i + 1] or (last and t == knots[-1]))
    out = 0.0
    if knots[i + order - 1] > knots[i]:
        part = (t - knots[i]) / (knots[i + order - 1] - knots[i])
        out += part * cox_de_boor(knots, i, order - 1, t)
    if knots[i + order] > knots[i + 1]:
        part = (knots[i + order] - t) / (knots[i + order] - knots[i + 1])
        out += part * cox_de_boor(knots, i + 1, order - 1, t)
    return out


def box(kind, corners=WARPED):
    degrees, orders = BLENDINGS[kind]
    return regular_box("B", corners, degrees, orders)


def bent(kind, amount=0.05):
    regular = box(kind)
    return regular.moved(np.random.default_rng(2).normal(size=regular.points.shape) * amount)


def inside(count):
    return np.random.default_rng(3).random((count, 3))


@pytest.mark.parametrize("t", [0.0, 0.1, 0.5, 0.77, 1.0])
def test_bezier_box_is_de_casteljau(t):
    uvw = np.array([[t, 0.3, 0.9]])
    whole = bent("bezier")
    curves = [[de_casteljau(row, 0.9) for row in plane] for plane in whole.points]
    expected = de_casteljau([de_casteljau(curve, 0.3) for curve in curves], t)
    np.testing.assert_allclose(whole.at(uvw)[0], expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("count", "order"), [(2, 2), (5, 2), (5, 3), (9, 4), (4, 4), (7, 1)])
def test_splines_are_cox_de_boor_on_clamped_uniform_knots(count, order):
    inner = [(k + 1) / (count - order + 1) for k in range(count - order)]
    knots = [0.0] * order + inner + [1.0] * order
    at = np.concatenate([np.linspace(0, 1, 29), inner])
    expected = [[cox_de_boor(knots, i, order, t) for i in range(count)] for t in at]
    np.testing.assert_allclose(blending(count, order, at)[0], expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("count", "order"), [(5, 2), (5, 3), (9, 4), (6, 6)])
def test_slopes_are_central_differences(count, order):
    at, step = np.linspace(0.013, 0.987, 40), 1e-6  # no knot
    rise = blending(count, order, at + step)[0] - blending(count, order, at - step)[0]
    np.testing.assert_allclose(blending(count, order, at)[1], rise / (2 * step), atol=1e-8)


@pytest.mark.parametrize("kind", BLENDINGS)
def test_all_control_points_moved_alike_translate(kind):
    whole, uvw = bent(kind), inside(40)
    shift = np.array([1.0, -2.0, 0.5])
    moved = whole.moved(np.broadcast_to(shift, whole.points.shape))
    np.testing.assert_allclose(moved.at(uvw), whole.at(uvw) + shift, atol=1e-13)


@pytest.mark.parametrize("kind", BLENDINGS)
def test_affine_motion_of_the_lattice_is_affine_inside(kind):
    whole, uvw = bent(kind), inside(40)
    rng = np.random.default_rng(4)
    matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = whole.moved(whole.points @ matrix + shift - whole.points)
    np.testing.assert_allclose(moved.at(uvw), whole.at(uvw) @ matrix + shift, atol=1e-12)


def test_regular_bezier_box_is_trilinear():
    whole, uvw = box("bezier"), inside(40)
    weights = np.where(CORNERS, uvw[:, None], 1 - uvw[:, None]).prod(axis=2)
    np.testing.assert_allclose(whole.at(uvw), weights @ WARPED, atol=1e-14)


@pytest.mark.parametrize("kind", BLENDINGS)
def test_matrix_is_the_derivative_and_gathering_its_transpose(kind):
    whole, uvw = bent(kind), inside(30)
    embedding = whole.embed(np.arange(30), uvw)
    change = np.random.default_rng(5).normal(size=whole.points.shape)
    moved = embedding.sums(change)
    np.testing.assert_allclose(moved, whole.moved(change).at(uvw) - whole.at(uvw), atol=1e-13)
    np.testing.assert_allclose(embedding.matrix() @ change.reshape(-1, 3), moved, atol=1e-14)
    values = np.random.default_rng(6).normal(size=(30, 3))
    pulled = embedding.matrix().T @ values
    np.testing.assert_allclose(embedding.gathered(values).reshape(-1, 3), pulled, atol=1e-13)


@pytest.mark.parametrize("kind", BLENDINGS)
def test_weights_are_a_partition_of_one_and_not_negative(kind):
    matrix = box(kind).embed(np.arange(200), inside(200)).matrix().toarray()
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-14)
    assert matrix.min() >= 0.0


@pytest.mark.parametrize("kind", BLENDINGS)
@pytest.mark.parametrize("of", [box, bent])
def test_inverse_finds_the_parametric_coordinates(kind, of):
    whole = of(kind)
    uvw = np.concatenate([inside(300), CORNERS, [[0.5, 1.0, 0.0]]])
    found, within = parametric(whole, whole.at(uvw))
    assert within.all()
    np.testing.assert_allclose(found, uvw, rtol=0, atol=1e-9)


def test_inverse_tells_which_points_are_outside():
    whole = box("bezier", CORNERS * 1.0)
    points = np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, -1e-3, 0.5], [1.0, 1.0, 1.0]])
    found, within = parametric(whole, points)
    assert within.tolist() == [True, False, False, True]
    assert np.isnan(found[1]).all()
    # A point between the box and the cuboid around it.
    slanted = box("bezier", (CORNERS * 1.0) @ [[1, 0, 0], [1, 1, 0], [0, 0, 1]])
    _, within = parametric(slanted, np.array([[0.1, 0.9, 0.5], [1.0, 0.5, 0.5]]))
    assert within.tolist() == [False, True]


def test_thin_box_in_2d_has_its_points_in_the_middle():
    corners = plane_corners(np.array([[0, -1e-4], [3e-3, -1e-4], [3e-3, 1e-4], [0, 1e-4]]))
    whole = regular_box("B", corners, (6, 1, 1), None)
    uv = inside(50)[:, :2]
    found, within = parametric(whole, corners[0, :2] + uv * [3e-3, 2e-4])
    assert within.all()
    np.testing.assert_allclose(found, np.column_stack([uv, np.full(50, 0.5)]), atol=1e-12)


def test_box_without_points_has_none_inside():
    found, within = parametric(box("bezier"), np.empty((0, 3)))
    assert found.shape == (0, 3)
    assert within.shape == (0,)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 8), st.integers(2, 5))
def test_bent_boxes_are_inverted(seed, degree, order):
    rng = np.random.default_rng(seed)
    degrees = (degree, 2, 1)
    orders = (min(order, degree + 1), 2, 2)
    whole = regular_box("B", CORNERS * rng.uniform(0.5, 2, 3), degrees, orders)
    whole = whole.moved(rng.uniform(-0.05, 0.05, whole.points.shape) / (degree + 1))
    uvw = rng.random((20, 3))
    found, within = parametric(whole, whole.at(uvw))
    assert within.all()
    np.testing.assert_allclose(whole.at(found), whole.at(uvw), atol=1e-11)


def test_minus_one_is_all_of_an_index():
    whole = box("bezier")
    change = whole.change((-1, 2, -1), (0.0, 1.0, 0.0))
    assert change[:, 2, :, 1].min() == 1.0
    assert change.sum() == 6 * 2


@pytest.mark.parametrize("index", [(6, 0, 0), (0, 4, 0), (0, 0, 2), (-2, 0, 0)])
def test_unknown_control_point_is_told(index):
    with pytest.raises(CaseError, match=r"has no control point with . = -?[2-6]; . goes from 0 to"):
        box("bezier").change(index, (1.0, 0.0, 0.0))


def test_impossible_boxes_are_refused():
    with pytest.raises(CaseError, match="the degree of j is 0; expected 1 to 50"):
        regular_box("B", WARPED, (3, 0, 1), None)
    with pytest.raises(CaseError, match="it has 68921 control points; expected at most 20000"):
        regular_box("B", WARPED, (40, 40, 40), None)
    with pytest.raises(CaseError, match="of j have the order 4, and 2 control points; expected"):
        regular_box("B", WARPED, (5, 1, 1), (4, 4, 2))
    with pytest.raises(CaseError, match="enclose no volume in their order"):
        regular_box("B", WARPED[[0, 2, 1, 3, 4, 6, 5, 7]], (1, 1, 1), None)
    with pytest.raises(CaseError, match="enclose no volume in their order"):
        regular_box("B", WARPED * [1, 1, 0], (1, 1, 1), None)


def test_boxes_of_the_other_hand_and_with_collapsed_sides_are_boxes():
    turned = WARPED[[0, 3, 2, 1, 4, 7, 6, 5]]
    wedge = CORNERS * 1.0
    wedge[[2, 6]] = wedge[[1, 5]]
    for corners in (turned, wedge):
        box = regular_box("B", corners, (3, 2, 1), None)
        uvw = 0.05 + 0.9 * inside(50)
        found, within = parametric(box, box.at(uvw))
        assert within.all()
        np.testing.assert_allclose(found, uvw, atol=1e-9)


def test_lattice_is_even_between_the_corners():
    points = lattice(CORNERS * [2.0, 1.0, 1.0], (4, 1, 1))
    assert points[:, 0, 0, 0].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert isinstance(box("bezier"), Box)
    with pytest.raises(ValueError, match="read-only"):
        box("bezier").points[0] = 1.0
