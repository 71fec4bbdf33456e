"""The guarded Cholesky: right where the matrix is sound, and honest where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.errors import Cancelled, DeformError
from slideviz.rbf import solve as module
from slideviz.rbf.evaluate import Basis, matrix
from slideviz.rbf.solve import PIVOT_GUARD, factorise


def system(x, radius=2.5):
    return matrix(Basis(radius), (np.ascontiguousarray(x.T), None))


@settings(max_examples=30, deadline=None)
@given(n=st.integers(1, 60), block=st.integers(1, 70), seed=st.integers(0, 5))
def test_the_solution_is_numpys_for_any_block_size(n, block, seed):
    rng = np.random.default_rng(seed)
    x = rng.uniform(size=(n, 3))
    right = rng.normal(size=(n, 2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "BLOCK", block)
        factor = factorise(system(x))
    assert len(factor.dropped) == 0
    expected = np.linalg.solve(system(x), right)
    np.testing.assert_allclose(factor.solve(right), expected, rtol=1e-7, atol=1e-9)


def test_coincident_nodes_are_left_out_and_told():
    rng = np.random.default_rng(0)
    x = rng.uniform(size=(20, 2))
    x[7], x[15] = x[3], x[3] + 1e-13
    factor = factorise(system(x))
    assert len(factor.dropped) == 2
    assert set(factor.dropped) < {3, 7, 15}
    assert sorted([*factor.retained, *factor.dropped]) == list(range(20))
    weights = factor.solve(np.ones((20, 1)))
    assert not weights[factor.dropped].any()
    # The others are met, and so are the twins.
    np.testing.assert_allclose(system(x) @ weights, 1.0, atol=1e-9)


def test_what_is_left_out_has_a_pivot_below_the_guard():
    # Nodes of a boundary layer: the pivot of each is known from the Schur complement.
    y = np.r_[0.0, np.cumsum(1e-7 * 2.0 ** np.arange(20))]
    x = np.stack([np.zeros(21), y], axis=1)
    full = system(x)
    factor = factorise(full)
    assert 0 < len(factor.dropped) < 21
    kept, dropped = factor.retained, factor.dropped
    inner = np.linalg.lstsq(full[np.ix_(kept, kept)], full[np.ix_(kept, dropped)], rcond=None)[0]
    pivots = 1.0 - np.einsum("kd,kd->d", full[np.ix_(kept, dropped)], inner)
    assert np.all(np.abs(pivots) < 30 * PIVOT_GUARD)


def test_the_factor_is_a_factor():
    x = np.random.default_rng(2).uniform(size=(40, 2))
    x[5] = x[9]
    full = system(x)
    factor = factorise(full)
    kept = np.ix_(factor.retained, factor.retained)
    np.testing.assert_allclose(factor.lower @ factor.lower.T, full[kept], atol=1e-12)
    np.testing.assert_array_equal(np.triu(factor.lower, 1), 0.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(bad):
    full = np.eye(3)
    full[1, 2] = bad
    with pytest.raises(DeformError, match="not finite; check the coordinates and displacements"):
        factorise(full)


def test_the_tick_may_stop_the_work():
    def stop(fraction):
        raise Cancelled("enough")

    with pytest.raises(Cancelled):
        factorise(np.eye(5), stop)


def test_the_matrix_is_not_changed():
    x = np.random.default_rng(2).uniform(size=(10, 2))
    full = system(x)
    before = full.copy()
    factorise(full)
    np.testing.assert_array_equal(full, before)
