import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slideviz.mesh.nearest import row_groups, sorted_in_rows

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
