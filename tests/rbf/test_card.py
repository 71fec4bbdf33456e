"""The loops on a graphics card against those of the processor, on an array module over NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slideviz.rbf import card
from slideviz.rbf.evaluate import Basis, evaluate, matrix
from slideviz.rbf.operations import many
from slideviz.rbf.solve import NOTHING, extend
from slideviz.system.device import HOST, card_arrays
from tests.fake_cupy import fake_cupy, needs_compiler
from tests.oracles.kernels import KERNELS

__all__ = ["fake_cupy"]
pytestmark = needs_compiler

NEAR = 1e-12  # of the sum of absolute values: what METHOD asks of a card


def features(rng, count, rows, period):
    """Features as of `Frame.features`: with a period r, sine, cosine and z."""
    if not period:
        return rng.uniform(-1.0, 1.0, (rows, count))
    angle = np.pi * rng.uniform(0.0, 2.0 * np.pi, count) / period
    r, z = rng.uniform(0.0, 1.0, (2, count))
    return np.stack([r, np.sin(angle), np.cos(angle), z])


@settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    kernel=st.sampled_from(sorted(KERNELS)),
    rows=st.sampled_from([2, 3, 4]),
    period=st.sampled_from([0.0, 0.0, np.pi / 6, 2.0 * np.pi]),
    radius=st.sampled_from([0.3, 1.0, 7.0]),
    sizes=st.tuples(st.integers(0, 70), st.integers(0, 40)),
    width=st.integers(1, 3),
    same=st.booleans(),
    directions=st.integers(0, 3),
    seed=st.integers(0, 999),
)
def test_all_loops_agree(
    fake_cupy, kernel, rows, period, radius, sizes, width, same, directions, seed
):
    fake_cupy()
    rng = np.random.default_rng(seed)
    host = Basis(radius, period, kernel)
    basis = replace(host, place="gpu")
    x, c = (features(rng, count, rows, period) for count in sizes)
    if same:
        x[:, : c.shape[1]] = c[:, : x.shape[1]]
    weights = rng.normal(size=(3, c.shape[1], width))
    places = (x, rng.normal(size=(x.shape[1], directions)) if directions else None)
    columns = (c, rng.normal(size=(c.shape[1], directions)) if directions else None)
    wanted = matrix(host, places, columns)
    size = max(1.0, np.abs(wanted).max(initial=0.0))
    np.testing.assert_allclose(matrix(basis, places, columns), wanted, rtol=0, atol=NEAR * size)
    size = max(1.0, np.abs(matrix(host, (x, None), (c, None))).max(initial=0.0))
    size *= max(1.0, np.abs(weights).sum())
    for sums, each in ((evaluate, weights[0]), (many, weights))[: 1 + bool(weights.size)]:
        found, wanted = (sums(one, x, c, each) for one in (basis, host))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=NEAR * size)


@pytest.mark.parametrize("free", [1, 5000, 1 << 30])
def test_the_memory_of_the_card_bounds_the_blocks_and_they_change_no_bit(
    fake_cupy, free, monkeypatch
):
    asked = []
    module = fake_cupy(free=free)
    empty = module.empty
    monkeypatch.setattr(
        module, "empty", lambda shape: asked.append(8 * np.prod(shape)) or empty(shape)
    )
    rng = np.random.default_rng(0)
    x, c, weights = rng.normal(size=(3, 90)), rng.normal(size=(3, 20)), rng.normal(size=(20, 2))
    basis = Basis(2.0, place="gpu")
    ticks = []
    found = evaluate(basis, x, c, weights, ticks.append)
    assert ticks[-1] == 1.0
    filled = matrix(basis, (x, None), (c, None))
    one_row = 8 * 20
    assert max(asked) <= max(free / card.PART, one_row)
    assert (len(ticks) == 1) is (free == 1 << 30)
    fake_cupy()
    assert np.array_equal(evaluate(basis, x, c, weights), found)
    assert np.array_equal(matrix(basis, (x, None), (c, None)), filled)


def test_pairs_and_entries_bound_the_blocks_too(fake_cupy, monkeypatch):
    fake_cupy(free=1 << 50)
    loops = card.CardLoops()
    assert loops.sum_rows(20_000) == card.PAIRS // 20_000
    assert loops.matrix_rows(20_000) == card.ENTRIES // 20_000
    assert loops.product_rows(1) == card.PRODUCT_ROWS
    assert loops.sum_rows(0) == card.PAIRS


@pytest.mark.parametrize("repeated", [0, 3])
def test_factors_are_those_of_the_host(fake_cupy, repeated):
    fake_cupy()
    rng = np.random.default_rng(2)
    x = rng.uniform(size=(3, 1300))
    x[:, 700 : 700 + repeated] = x[:, :repeated]  # dependent rows, which the guard leaves out
    system = matrix(Basis(0.4), (x, None))
    lower = []
    for arrays in (HOST, card_arrays()):
        before = extend(NOTHING, system[:600, :600], arrays=arrays)
        factor = extend(before, system[600:], arrays=arrays)
        assert type(factor.lower) is np.ndarray
        assert len(factor.dropped) == repeated
        lower.append(factor.lower)
    np.testing.assert_allclose(*lower, rtol=0, atol=1e-12)
