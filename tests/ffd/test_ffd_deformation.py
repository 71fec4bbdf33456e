"""Nodes in boxes that a design deforms: coordinates, nesting, overlap, limits, derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.errors import CaseError
from slideviz.ffd.box import CoordinateSystem, regular_box
from slideviz.ffd.deformation import BoxDeformation, DrivenMove, Limits, parametric
from slideviz.ffd.kinds import Request, moves_of
from tests.oracles.freeform import blended, moved

CUBE = 1.0 * np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
LINE = (0.3, -0.2, 0.1, 0.4, 1.3, 0.2)
POINTS = np.array(
    [[0.5, 0.5, 0.5], [0.2, 0.7, 0.3], [0.45, 0.3, 0.6], [0.8, 0.1, 0.9], [1.6, 0.2, 0.4]]
)
VARIABLES = [
    ("FFD_TWIST", (1,), LINE, 0.3),
    ("FFD_CAMBER", (1, 1), (), 0.2),
    ("FFD_ROTATION", (), LINE, 25.0),
    ("FFD_CONTROL_POINT", (1, -1, 0), (0.1, -0.2, 0.3), -0.4),
    ("FFD_TWIST", (2,), LINE, -0.2),
    ("FFD_THICKNESS", (2, 1), (), 0.15),
]


def outer(**changes):
    return replace(regular_box("OUT", 2.0 * CUBE - 0.2, (3, 2, 2), None), **changes)


def inner(**changes):
    return replace(regular_box("IN", 0.6 * CUBE + 0.15, (2, 2, 1), None), **changes)


def deformed(boxes, variables, scale=1.0, points=POINTS, relax=1.0, **limits):
    """The deformation by variables (box, kind, index, numbers, value), in the boxes' order."""
    inside = {}
    for box in boxes:
        uvw, within = parametric(box, points)
        inside[box.name] = box.embed(np.flatnonzero(within), uvw[within])
    by_name = {box.name: box for box in boxes}
    drives, values = [], []
    for name, kind, index, numbers, value in variables:
        request = Request(kind, index, numbers, 1.3)
        for move in moves_of(by_name[name], request):
            drives.append(DrivenMove(name, move, len(values), not request.direct))
            values.append(scale * value)
    return BoxDeformation(
        boxes, inside, drives, np.array(values), relax, len(points), Limits(**limits)
    )


def check_slopes(make, count, step=1e-6, atol=2e-9, idle=0):
    """Compare the slopes of make(extra values) with central differences; return them."""
    found = make(np.zeros(count))
    slopes = []
    for place in range(count):
        ends = [make(s * step * np.eye(count)[place]).nodes for s in (1.0, -1.0)]
        slopes.append(found.slope(place))
        right = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(slopes[-1], right, rtol=0, atol=atol)
    still = [place for place in range(count) if not slopes[place].any()]
    assert len(still) <= idle
    return slopes


def variables_of(name, extra):
    return [
        (name, kind, index, numbers, value + more)
        for (kind, index, numbers, value), more in zip(VARIABLES, extra, strict=True)
    ]


def test_moves_act_one_after_the_other_as_in_su2():
    box = inner()
    found = deformed([box], variables_of("IN", np.zeros(6)), relax=0.8)
    points = box.points
    for kind, index, numbers, value in VARIABLES:
        points = moved(kind, index, numbers, [value], points, relax=0.8, length=1.3)
    uvw, inside = parametric(box, POINTS)
    for node in np.flatnonzero(inside):
        right = blended(points, uvw[node]) - POINTS[node]
        np.testing.assert_allclose(found.nodes[node], right, rtol=0, atol=1e-14)
    assert not found.nodes[~inside].any()
    np.testing.assert_allclose(found.moved()["IN"].points, points, rtol=0, atol=1e-14)
    assert not found.notes


def test_slopes_go_through_the_list_of_moves():
    check_slopes(lambda extra: deformed([inner()], variables_of("IN", extra), relax=0.8), 6)


@pytest.mark.parametrize("kind", ["CYLINDRICAL", "SPHERICAL", "POLAR"])
def test_other_coordinates_bend_what_is_straight(kind):
    system = CoordinateSystem(kind, (-1.0, -0.5, 0.1))
    low, high = system.q_of(POINTS).min(axis=0) - 0.1, system.q_of(POINTS).max(axis=0) + 0.1
    box = regular_box("IN", system.points_of(low + CUBE * (high - low)), (3, 2, 2), None, system)
    found = deformed([box], variables_of("IN", np.zeros(6)))
    points = box.q
    for name, index, numbers, value in VARIABLES:
        points = moved(name, index, numbers, [value], points, length=1.3)
    for node, at in enumerate((system.q_of(POINTS) - low) / (high - low)):
        right = system.points_of(blended(points, at)) - POINTS[node]
        np.testing.assert_allclose(found.nodes[node], right, rtol=0, atol=1e-13)
    check_slopes(lambda extra: deformed([box], variables_of("IN", extra)), 6, atol=1e-8)


def test_last_box_takes_the_nodes_and_says_what_is_lost():
    shift = ("FFD_CONTROL_POINT", (2, -1, -1), (0.0, 0.1, 0.0), 1.0)
    two = [("OUT", *shift), ("IN", *shift)]
    outside = deformed([outer(), inner()], two)
    alone = [deformed([box], [one]) for box, one in zip([outer(), inner()], two, strict=True)]
    within = alone[1].inside["IN"].nodes
    right = alone[0].nodes.copy()
    right[within] = alone[1].nodes[within]
    np.testing.assert_array_equal(outside.nodes, right)
    assert len(outside.notes) == 1
    assert f"{len(within)} nodes in the FFD box 'IN' are also in an earlier box" in outside.notes[0]
    assert not outside.slope(0)[within].any()
    still = deformed([outer(), inner()], two[:1])  # a box without variables takes them, too
    assert not still.nodes[within].any()
    assert still.notes
    assert not deformed([inner(), outer()], two[1:] * 0).notes


def nested(extra, part=0.5):
    boxes = [outer(), inner(level=1, parent="OUT")]
    variables = variables_of("OUT", np.zeros(6)) + variables_of("IN", np.zeros(6))
    parts = [(*one[:4], part * one[4] + e) for one, e in zip(variables, extra, strict=True)]
    return deformed(boxes, parts)


def test_parent_carries_nested_box():
    carried = deformed(
        [outer(), inner(level=1, parent="OUT")], variables_of("OUT", np.zeros(6)), 0.5
    )
    alone = deformed([outer()], variables_of("OUT", np.zeros(6)), 0.5)
    np.testing.assert_allclose(carried.nodes, alone.nodes, rtol=0, atol=1e-12)
    assert not carried.notes
    box = inner()
    uvw, _ = parametric(outer(), box.points.reshape(-1, 3))
    parent = alone.moved()["OUT"]
    right = parent.at(uvw).reshape(box.points.shape)
    np.testing.assert_allclose(carried.moved()["IN"].points, right, rtol=0, atol=1e-12)


def test_nested_box_moves_on_top_of_its_parent():
    both, outside = nested(np.zeros(12)), deformed([outer()], variables_of("OUT", np.zeros(6)), 0.5)
    within = both.inside["IN"].nodes
    # Where the carried box has the nodes, its control points move them.
    half = deformed([outer(), inner(level=1, parent="OUT")], variables_of("OUT", np.zeros(6)), 0.5)
    cage = half.moved()["IN"]
    points = cage.points
    for kind, index, numbers, value in VARIABLES:
        points = moved(kind, index, numbers, [0.5 * value], points, length=1.3)
    uvw, _ = parametric(cage, POINTS + outside.nodes)
    for node in within:
        if not np.isnan(uvw[node]).any():
            right = blended(points, uvw[node]) - POINTS[node]
            np.testing.assert_allclose(both.nodes[node], right, rtol=0, atol=1e-11)
    assert len(within) > 1
    check_slopes(nested, 12, atol=1e-8, idle=1)  # a twist whose segment ends too early
    for name, (nodes, there) in both.uvw().items():
        at = both.moved()[name].at(there)
        np.testing.assert_allclose(at, (POINTS + both.nodes)[nodes], rtol=0, atol=1e-12)
    assert set(both.uvw()) == {"IN", "OUT"}


def test_nested_box_at_rest_has_the_slopes_of_its_parent():
    assert not nested(np.zeros(12), 0.0).nodes.any()
    check_slopes(lambda extra: nested(extra, 0.0), 12, atol=1e-8, idle=1)


def test_nested_box_may_shrink_to_an_edge():
    wedge = CUBE.copy()
    wedge[[6, 7]] = CUBE[[5, 4]]  # at the top, w = 1, all v are one
    box = replace(regular_box("IN", 0.6 * wedge + 0.15, (2, 2, 1), None), level=1, parent="OUT")
    still = [("OUT", "FFD_CONTROL_POINT", (1, -1, -1), (0.3, 0.5, 0.1), 0.0)]
    points = np.array([[0.4, 0.15, 0.75], [0.4, 0.3, 0.3]])
    found, alone = (deformed(boxes, still, points=points) for boxes in ([outer(), box], [outer()]))
    assert len(found.inside["IN"].nodes) == 2
    np.testing.assert_allclose(found.slope(0), alone.slope(0), rtol=0, atol=1e-14)


def test_nested_box_must_be_inside_its_parent():
    with pytest.raises(CaseError, match="'OUT' is not inside its parent 'IN', which could not"):
        deformed([inner(), outer(level=1, parent="IN")], [])


def test_boxes_that_fold_cannot_carry_nested_ones():
    shift = ("OUT", "FFD_CONTROL_POINT", (1, -1, -1), (1.0, 0.0, 0.0), 9.0)
    with pytest.raises(CaseError, match="the FFD box 'IN' folds over, or loses nodes"):
        deformed([outer(), inner(level=1, parent="OUT")], [shift])


def test_bound_scales_back_and_keeps_its_derivative():
    shift = ("FFD_CONTROL_POINT", (1, -1, -1), (0.3, 0.5, 0.1), 0.7)

    def make(extra, **limits):
        more = ("FFD_GULL", (1,), (), 0.2 + extra[1])
        return deformed([inner()], [("IN", *shift[:3], 0.7 + extra[0]), ("IN", *more)], **limits)

    free, held = make(np.zeros(2)), make(np.zeros(2), bound=0.1)
    assert np.linalg.norm(free.nodes, axis=1).max() > 0.1
    size = np.linalg.norm(held.nodes, axis=1).max()
    assert abs(size - 0.1) < 1e-15
    np.testing.assert_allclose(
        held.nodes / size,
        free.nodes * 10 / np.linalg.norm(10 * free.nodes, axis=1).max(),
        rtol=0,
        atol=1e-14,
    )
    assert "OPT_LINE_SEARCH_BOUND: the FFD box 'IN' would move a node by" in held.notes[0]
    check_slopes(lambda extra: make(extra, bound=0.1), 2)
    assert not make(np.zeros(2), bound=10.0).notes


def test_bound_does_twice_what_has_several_values_and_lasts():
    three = ("IN", "FFD_CONTROL_POINT", (1, 1, 1), (0.0, 0.0, 0.0), 0.4)
    free = deformed([inner()], [three])
    held = deformed([inner()], [three], bound=0.01)
    np.testing.assert_allclose(held.nodes, 2.0 * free.nodes, rtol=1e-14)
    assert "variables with several values are applied twice" in held.notes[0]
    one = ("OUT", "FFD_GULL", (1,), (), 0.2)
    after = deformed([inner(), outer()], [three, one], bound=0.05)
    assert "the variables of OUT get -" in after.notes[0]
    assert "for OPT_RELAX_FACTOR" in after.notes[0]


def bisection(value, worst, iterations, depth):
    """The part of a value that SU2's search ends at, and its passes; ``worst`` just folds."""
    if value <= worst:
        return 1.0, []
    f, h, level, steps = 0.5, 0.5, 0, [-0.5]
    for it in range(1, iterations + 1):
        good = f * value <= worst
        level += good
        if good and level == depth:
            break
        h = abs(h) / 2 if good else -abs(h) / 2
        if it < iterations:
            f += h
            steps.append(h)
    return f, steps


@pytest.mark.parametrize(
    ("value", "iterations", "depth"),
    [
        (0.2, 10, 3),
        (2.0, 10, 3),
        (2.0, 10, 6),
        (5.0, 10, 3),
        (40.0, 3, 3),
        (3.1, 2, 9),
    ],
)
def test_self_intersection_is_taken_back_by_bisection(value, iterations, depth):
    def make(by, **limits):
        variables = [("IN", "FFD_CONTROL_POINT", (1, -1, -1), (1.0, 0.0, 0.0), by)]
        return deformed([inner()], variables, points=POINTS[:3], **limits)

    u = parametric(inner(), POINTS[:3])[0][:, 0]
    # x = 0.15 + 0.6 u + 2 u (1 - u) v has a negative slope at u > 1/2 from there on
    worst = 0.6 / (2.0 * (2.0 * u - 1.0).max())
    part, steps = bisection(value, worst, iterations, depth)
    found = make(value, iterations=iterations, depth=depth)
    np.testing.assert_allclose(found.nodes, make(part * value).nodes, rtol=0, atol=1e-14)
    assert bool(found.notes) == bool(steps)
    if steps:
        assert f"is deformed by {100 * part:g} % only" in found.notes[0]
        assert ("still intersects itself" in found.notes[0]) == (part * value > worst)
        right = part * make(value).slope(0)
        np.testing.assert_allclose(found.slope(0), right, rtol=0, atol=1e-14)


def test_box_that_passes_the_range_of_angles_does_not_fold():
    system = CoordinateSystem("CYLINDRICAL")
    ends = np.array([1.0, 0.1 * np.pi, 0.0]) + CUBE * (0.5, 0.3 * np.pi, 1.0)
    box = regular_box("IN", system.points_of(ends), (2, 2, 2), None, system)
    points = system.points_of(np.array([[1.2, 0.35 * np.pi, 0.5], [1.3, 0.3 * np.pi, 0.2]]))
    turn = ("IN", "FFD_CONTROL_POINT", (-1, 2, -1), (0.0, 1.0, 0.0), 0.4)
    found = deformed([box], [turn], points=points, iterations=10)
    assert system.q_of(points + found.nodes)[:, 1].min() > 0.3 * np.pi
    assert not found.notes


def test_later_boxes_get_the_last_values_of_the_search():
    shift = ("FFD_CONTROL_POINT", (1, -1, -1), (1.0, 0.0, 0.0), 5.0)
    apart = replace(outer(), points=outer().points + 10.0)
    points = np.concatenate([POINTS, POINTS + 10.0])
    variables = [("IN", *shift), ("OUT", "FFD_GULL", (1,), (), 0.2)]
    found = deformed([inner(), apart], variables, points=points, iterations=10)
    alone = deformed([apart], variables[1:], points=points)
    last = found.nodes[5:] / np.where(alone.nodes[5:], alone.nodes[5:], 1.0)
    factor = last[last != 0.0]
    assert np.ptp(factor) < 1e-12
    assert abs(factor[0]) in (0.25, 0.125, 0.0625, 0.03125)
    assert f"the variables of OUT get {factor[0]:g} times their values" in found.notes[0]
