"""Lines and circles through 2D meshes: where they are seen."""

import numpy as np
import pytest

from slideviz.sections.model import Section
from slideviz.sections.plane import box_around

BOX = np.array([0.0, 0.0]), np.array([4.0, 2.0])
LINE = Section("plane", (1.0, 0.5, 0.0), (1.0, 0.0, 0.0), whole_cells=True)
SLOPE = Section("plane", (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0))
RING = Section("cylinder", (2.0, 1.0, 0.0), radius=0.5)


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
