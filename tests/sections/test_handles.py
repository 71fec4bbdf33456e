"""Lines and circles through 2D meshes: where they are seen, held, and dragged to."""

import numpy as np
import pytest

from slideviz.sections.handles import handle_parts, part_at
from slideviz.sections.line import box_around
from slideviz.sections.model import Section

BOX = np.array([0.0, 0.0]), np.array([4.0, 2.0])
LINE = Section("plane", (1.0, 0.5, 0.0), (1.0, 0.0, 0.0), whole_cells=True)
SLOPE = Section("plane", (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0))
RING = Section("cylinder", (2.0, 1.0, 0.0), radius=0.5)


def at(*numbers):
    return np.array(numbers, float)


def test_a_line_is_clipped_to_the_box():
    assert np.allclose(LINE.ends(BOX), [[1, 0], [1, 2]])
    assert np.allclose(SLOPE.ends(BOX), [[0, 0], [2, 2]])
    assert Section("plane", (5.0, 0.0, 0.0), (1.0, 0.0, 0.0)).ends(BOX) is None
    assert Section("plane", (9.0, 0.0, 0.0), (1.0, 1.0, 0.0)).ends(BOX) is None
    assert Section("plane", (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)).trace(BOX) == []


def test_a_plane_that_leans_meets_the_mesh_beside_its_origin():
    leaning = Section("plane", (1.0, 0.0, 1.0), (1.0, 0.0, 1.0))
    (line,) = leaning.trace(BOX)
    assert line[:, 0] == pytest.approx(2.0)


def test_a_line_runs_to_the_positive_side():
    assert LINE.way == pytest.approx((0, 1))
    assert Section("plane", direction=(0.0, -2.0, 0.0)).way == pytest.approx((1, 0))


def test_a_circle_is_cut_where_it_leaves_the_box():
    (whole,) = RING.trace(BOX)
    assert np.hypot(*(whole - (2, 1)).T) == pytest.approx(0.5)
    assert np.allclose(whole[0], whole[-1])
    parts = Section("cylinder", (2.0, 1.0, 0.0), radius=1.5).trace(BOX)
    assert len(parts) in (2, 3)  # right and left, one of them where the angle begins
    every = np.concatenate(parts)
    assert (every >= BOX[0]).all()
    assert (every <= BOX[1]).all()
    assert Section("cylinder", (2.0, 1.0, 0.0), radius=9.0).trace(BOX) == []


def test_the_box_around_a_mesh_has_a_margin():
    low, high = box_around(np.array([[0.0, 0.0, 5.0], [10.0, 2.0, 5.0]]))
    assert low == pytest.approx((-0.3, -0.3))
    assert high == pytest.approx((10.3, 2.3))


def test_a_line_is_held_at_its_origin_or_in_the_middle_of_what_is_seen():
    held = handle_parts(LINE, BOX)
    assert np.allclose(held.middle, [[1.0, 0.5]])
    assert np.allclose(held.ends, [[1, 0], [1, 2]])
    away = Section("plane", (1.0, 77.0, 0.0), (1.0, 0.0, 0.0))
    assert np.allclose(handle_parts(away, BOX).middle, [[1.0, 1.0]])
    assert handle_parts(Section("plane", (5.0, 0.0, 0.0), (1.0, 0.0, 0.0)), BOX) is None


def test_a_circle_is_held_on_itself_and_in_its_middle_where_that_is_seen():
    held = handle_parts(RING, BOX)
    assert np.allclose(held.middle, [[2.0, 1.0]])
    assert np.hypot(*(held.ends[0] - (2, 1))) == pytest.approx(0.5)
    around = handle_parts(Section("cylinder", (-2.0, 1.0, 0.0), radius=3.0), BOX)
    assert len(around.middle) == 0
    assert (around.ends[0] > BOX[0]).all()
    assert (around.ends[0] < BOX[1]).all()


def test_the_mouse_takes_points_before_the_line():
    line = np.array([[0.0, 0.0], [100.0, 0.0]])
    shown = [("end", line), ("middle", line[:1] + 50.0 * at(1, 0)), ("line", line)]
    assert part_at(shown, at(98, 3), 10.0) == "end"
    assert part_at(shown, at(52, 4), 10.0) == "middle"
    assert part_at(shown, at(30, 4), 10.0) == "line"
    assert part_at(shown, at(30, 6), 10.0) is None
    assert part_at([("middle", np.empty((0, 2)))], at(0, 0), 10.0) is None


def test_a_line_moves_by_its_middle_and_across_itself_by_the_rest():
    way = at(1.0, 0.5), at(1.5, 0.9)
    assert LINE.dragged("middle", way, BOX).origin == pytest.approx((1.5, 0.9, 0.0))
    moved = LINE.dragged("line", way, BOX)
    assert moved.origin == pytest.approx((1.5, 0.5, 0.0))
    assert moved.direction == LINE.direction
    assert moved.whole_cells


def test_a_line_turns_about_its_middle():
    turned = LINE.dragged("end", (at(1, 2), at(2.0, 1.5)), BOX)
    assert turned.origin == pytest.approx((1.0, 0.5, 0.0))
    assert turned.direction == pytest.approx((0.7071, -0.7071, 0.0))
    # Past the vertical it does not flip to the other side.
    other = LINE.dragged("end", (at(1, 2), at(0.9, 2.0)), BOX)
    assert other.direction[0] > 0.9
    assert LINE.dragged("end", (at(1, 2), at(1.0, 0.5)), BOX) == LINE


def test_a_circle_moves_by_its_middle_and_grows_by_the_rest():
    way = at(2.0, 1.0), at(2.2, 1.3)
    assert RING.dragged("middle", way, BOX).origin == pytest.approx((2.2, 1.3, 0.0))
    for part in ("end", "line"):
        grown = RING.dragged(part, (at(2.5, 1.0), at(2.0, 1.8)), BOX)
        assert grown.radius == pytest.approx(0.8)
        assert grown.origin == RING.origin
    assert RING.dragged("end", (at(2.5, 1.0), at(2.0, 1.0)), BOX).radius > 0


def test_what_is_dragged_has_no_more_digits_than_the_mouse_can_aim():
    moved = LINE.dragged("middle", (at(0, 0), at(0.123456789, 0.0)), BOX)
    assert moved.origin[0] == 1.1235
    tiny = tuple(1e-6 * side for side in BOX)
    small = Section("plane", (1e-6, 0.0, 0.0), (1.0, 0.0, 0.0))
    shifted = small.dragged("middle", (at(0, 0), at(0.1234567e-6, 0.0)), tiny)
    assert shifted.origin[0] == pytest.approx(1.1235e-6, rel=1e-9)
