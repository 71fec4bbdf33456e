import numpy as np
from scipy.spatial import cKDTree

from slideviz.deformation.setup import _crowded


def test_no_point_that_has_another_beside_it_is_overlooked():
    rng = np.random.default_rng(3)
    for dim in (2, 3):
        points = 1e3 + rng.random((400, dim))
        points[:50] = points[50:100] + 1e-12 * rng.random(dim)
        near = cKDTree(points).query_pairs(1e-9, output_type="ndarray")
        found = _crowded(points, 1e-9)
        assert set(np.unique(near)) <= set(found)
        assert len(found) < len(points) // 2
    assert not len(_crowded(points[1:2], 1e-9))
