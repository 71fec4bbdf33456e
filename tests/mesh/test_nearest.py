import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial import cKDTree

from slideviz.mesh import nearest as module
from slideviz.mesh.nearest import near_duplicates, nearest, row_groups, sorted_in_rows


@pytest.mark.parametrize("dim", [2, 3])
def test_no_point_that_has_another_beside_it_is_overlooked(dim):
    rng = np.random.default_rng(3)
    points = 1e3 + rng.random((400, dim))
    points[:50] = points[50:100] + 1e-12 * rng.random(dim)
    near = cKDTree(points).query_pairs(1e-9, output_type="ndarray")
    found = near_duplicates(points, 1e-9)
    assert set(np.unique(near)) <= set(found)
    assert len(found) < len(points) // 2
    assert not len(near_duplicates(points[1:2], 1e-9))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("bound", [1e-6, np.inf])
@pytest.mark.parametrize("twins", [0, 3])
def test_the_nearest_are_those_of_a_tree(dim, bound, twins):
    rng = np.random.default_rng(5)
    points = rng.random((300, dim))
    at = np.concatenate([points[::2] + 1e-7 * rng.random((150, dim)), rng.random((20, dim))])
    points = np.concatenate([points, points[:twins] + 1e-8])
    expected = cKDTree(points).query(at, distance_upper_bound=bound)
    for found, right in zip(nearest(points, at, bound, 1e-6), expected, strict=True):
        np.testing.assert_array_equal(found, right)


def test_no_tree_is_built_where_each_has_one_neighbour():
    points = np.random.default_rng(7).random((300, 3))
    distance, number = module._alone(points, points[::-1] + 1e-9, 1e-6)
    np.testing.assert_array_equal(number, np.arange(300)[::-1])
    assert distance.max() < 1e-8


TABLES = hnp.arrays(
    np.int64,
    st.tuples(st.integers(0, 30), st.integers(1, 5)),
    elements=st.sampled_from([0, 1, 2, 3, 2_999_999_999]),
)


@given(TABLES)
def test_equal_rows_share_the_number_that_numpy_gives_them(table):
    _, inverse = np.unique(table, axis=0, return_inverse=True)
    np.testing.assert_array_equal(row_groups(table), inverse.ravel())


@given(TABLES)
def test_rows_are_sorted_as_numpy_sorts_them(table):
    np.testing.assert_array_equal(sorted_in_rows(table), np.sort(table, axis=1))


@pytest.mark.parametrize("shape", [(0, 4), (0, 0)])
def test_an_empty_table_has_no_groups(shape):
    assert row_groups(np.empty(shape, np.int64)).shape == (0,)
