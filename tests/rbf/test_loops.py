"""Loops over the nodes of several designs, against NumPy."""

from math import pi

import numpy as np
import pytest
from scipy.sparse import csr_array

from slideviz.rbf.frames import make_frame
from slideviz.rbf.loops import add_correction, farthest, keep_undeformed, to_points
from tests import builders


def test_a_correction_adds_a_share_of_a_mean_at_its_targets():
    rng = np.random.default_rng(0)
    out = rng.normal(size=(2, 7, 3))
    lacking = rng.normal(size=(2, 4, 3))
    means = csr_array(rng.uniform(size=(3, 4)) * (rng.uniform(size=(3, 4)) > 0.4))
    targets, part = np.array([6, 0, 3]), np.array([1.0, 0.5, 0.25])
    expected = out.copy()
    expected[:, targets] += part[:, None] * (means.toarray() @ lacking)
    add_correction(out, targets, means, part, lacking)
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("dim", [2, 3])
def test_coordinates_become_points_and_nodes_at_rest_keep_their_bits(dim):
    rng = np.random.default_rng(1)
    before = rng.uniform(0.2, 1.0, (30, dim))
    pair = builders.pair("rotational", dim, angle=pi / 6)
    frame, _ = make_frame(before, [pair], periodic_distance=True)
    start = frame.coords(before)
    moved = np.stack([start, start + rng.normal(scale=0.01, size=start.shape)])
    moved[1, ::3] = start[::3]
    points = moved.copy()
    to_points(frame, points, start, before)
    np.testing.assert_array_equal(points[0], before)
    np.testing.assert_array_equal(points[1, ::3], before[::3])
    np.testing.assert_allclose(points[1], frame.points(moved[1]), rtol=0, atol=1e-14)
    at = keep_undeformed(rng.normal(size=moved.shape), moved, start, before)
    np.testing.assert_array_equal(at[0], before)
    assert (at[1, 1::3] != before[1::3]).all()
    np.testing.assert_allclose(
        farthest(moved, start), np.linalg.norm(moved - start, axis=2).max(axis=1), rtol=1e-14
    )
