"""Smallest distances between surfaces: against brute force, and known ones of blades."""

import numpy as np
import pytest

from slideviz.errors import MeshError
from slideviz.machine.smallest_distances import (
    bodies,
    level_lines,
    nearest_on_segments,
    neighbours,
    smallest,
)
from slideviz.rbf.closest import ClosestPoints


def brute(first, second, n=40):
    """The smallest distance between points spread over two triangles."""
    i, j = np.indices((n + 1, n + 1)).reshape(2, -1)
    keep = i + j <= n
    weights = np.stack([i, j, n - i - j], axis=1)[keep] / n
    a, b = (np.einsum("pk,tkd->tpd", weights, each).reshape(-1, 3) for each in (first, second))
    return min(np.linalg.norm(a - point, axis=1).min() for point in b)


def test_distances_of_triangles_are_exact():
    # Two crossed edges: no corner is near the other triangle.
    low = np.array([[[-1.0, 0, 0], [1, 0, 0], [0, 0, -1]]])
    high = np.array([[[0.2, -1, 0.3], [0.2, 1, 0.3], [0.2, 0, 2]]])
    found = smallest(low, high)
    assert found.distance == pytest.approx(0.3, rel=1e-9)
    assert found.start == pytest.approx([0.2, 0, 0], abs=1e-6)
    assert found.end == pytest.approx([0.2, 0, 0.3], abs=1e-6)
    rng = np.random.default_rng(3)
    for _ in range(10):
        first, second = rng.normal(size=(2, 3, 3, 3))
        second[..., 0] += 3.0 + np.ptp(first[..., 0])
        found = smallest(first, second)
        assert found.distance <= brute(first, second) + 1e-12
        assert found.distance >= brute(first, second) - 0.05
        assert np.linalg.norm(found.start - found.end) == pytest.approx(found.distance)
        back = smallest(second, first)
        assert back.distance == pytest.approx(found.distance, rel=1e-6)


def test_a_segment_is_measured_between_its_ends():
    # A roof whose ridge lies below the middle of the segment.
    roof = ClosestPoints(np.array([[[0.0, 0.0], [0.37, 1.0]], [[0.37, 1.0], [1.0, 0.0]]]))
    found = nearest_on_segments(np.array([[[0.0, 1.5], [1.0, 1.5]]]), roof)
    assert found.distance == pytest.approx(0.5, rel=1e-9)
    assert found.start == pytest.approx([0.37, 1.5], abs=1e-4)
    none = nearest_on_segments(np.empty((0, 2, 2)), roof)
    assert none.distance == np.inf
    assert np.isnan(none.start).all()


def test_level_lines_of_triangles():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1.0, 0, 0], [1, 1, 0], [0, 1, 0]]])
    segments = level_lines(corners, corners[..., 0], 0.25)
    assert segments[..., 0] == pytest.approx(0.25)
    assert np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum() == pytest.approx(1.0)
    assert not len(level_lines(corners, corners[..., 0], 3.0))


def test_a_blade_that_the_periodic_side_cuts_is_put_together():
    # Nodes 0 to 3 are a part at the lower side, 4 to 7 one at the upper side, 8 to 9 a splitter.
    nodes = np.array([[0, 1], [1, 2], [2, 3], [4, 5], [5, 6], [6, 7], [8, 9]])
    sides = np.array([[0, 4], [3, 7], [20, 21]])
    made = bodies(nodes, sides)
    assert [body.facets.tolist() for body in made] == [[0, 1, 2, 3, 4, 5], [6]]
    assert np.diff(made[0].turns[[0, 3]]).item() == -1  # the lower part belongs one period on
    points = np.zeros((10, 2))
    points[:4] = [[0, 0], [0.3, 0.2], [0.6, 0.2], [1, 0]]
    points[4:8] = [[0, 1], [0.3, 0.8], [0.6, 0.8], [1, 1]]
    points[8:] = [[0.5, 0.5], [0.6, 0.5]]

    def turn(x, by):
        return x + np.array([0.0, by])

    corners = points[nodes]
    blade, splitter = (body.placed(corners, turn) for body in made)
    assert np.ptp(blade[..., 1]) == pytest.approx(0.4)
    others = list(neighbours(made, corners, turn, (-1, 0, 1)))
    assert smallest(blade, others[0]).distance == pytest.approx(0.3)
    assert smallest(splitter, others[1]).distance == pytest.approx(0.3)
    alone = bodies(nodes[:3], np.empty((0, 2), np.int64))
    assert [len(one) for one in neighbours(alone, corners[:3], turn, (0,))] == [0]


def test_a_blade_over_three_passages_is_put_together():
    nodes = np.array([[0, 1], [1, 2], [4, 5], [5, 6], [8, 9]])
    [body] = bodies(nodes, np.array([[0, 5], [4, 9]]))
    assert body.facets.tolist() == [0, 1, 2, 3, 4]
    assert body.turns.tolist() == [0, 0, -1, -1, -2]


def test_a_boundary_that_goes_around_is_no_blade():
    with pytest.raises(
        MeshError, match="continues through the periodic side, so it is not a blade"
    ):
        bodies(np.array([[0, 1], [1, 2]]), np.array([[0, 2]]))
