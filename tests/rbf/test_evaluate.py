"""Compiled sums and matrices against the literal formulas of the thesis."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.rbf import evaluate as module
from slideviz.rbf.evaluate import Basis, evaluate, matrix
from slideviz.rbf.frames import Frame, make_frame
from tests import builders
from tests.oracles import radial


def frames(dim):
    """Each rule of distance: frame, oracle, and the oracle's coordinates of Cartesian points."""
    rng = np.random.default_rng(3)
    x = rng.uniform(0.2, 1.0, (30, dim))

    def polar(points):
        columns = [np.hypot(*points.T[:2]), np.arctan2(points[:, 1], points[:, 0])]
        return np.column_stack([*columns, points[:, 2:]])

    rotation = builders.pair("rotational", dim, angle=pi / 6)
    return {
        "euclidean": (Frame(dim), radial.euclidean, x),
        "translational": (
            make_frame(
                x, [builders.pair("translational", dim, (0, -1.1, 0))], periodic_distance=True
            )[0],
            radial.translational(1.1, 1),
            x,
        ),
        "cylindrical": (
            make_frame(x, [rotation], periodic_distance=False)[0],
            radial.cylindrical,
            polar(x),
        ),
        "rotational": (
            make_frame(x, [rotation], periodic_distance=True)[0],
            radial.rotational(pi / 6),
            polar(x),
        ),
    }, x


RULES = ("euclidean", "translational", "cylindrical", "rotational")


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("dim", [2, 3])
def test_sums_and_matrices_are_the_literal_ones(dim, rule):
    table, x = frames(dim)
    frame, distance, places = table[rule]
    rng = np.random.default_rng(1)
    weights = rng.normal(size=(12, dim))
    basis = Basis(2.5 * 0.8, frame.period if frame.cylindrical else 0.0)
    features = frame.features(frame.coords(x))
    found = evaluate(basis, features[:, 12:], features[:, :12], weights)
    expected = radial.sums(places[12:], places[:12], weights, 2.0, distance)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-13)
    plain = matrix(basis, (features, None))
    np.testing.assert_allclose(plain, radial.phi(places, places, 2.0, distance), atol=2e-13)
    np.testing.assert_allclose(np.diag(plain), 1.0, atol=1e-14)
    normals = rng.normal(size=(30, dim))
    np.testing.assert_allclose(
        matrix(basis, (features, normals)), plain * (normals @ normals.T), atol=1e-12
    )
    part = matrix(basis, (features[:, :5], normals[:5]), (features[:, 7:], normals[7:]))
    np.testing.assert_allclose(part, (plain * (normals @ normals.T))[:5, 7:], atol=1e-12)


def test_beyond_the_support_there_is_nothing():
    basis = Basis(0.5)
    far = np.array([[0.0, 0.5, 0.500001, 3.0], [0.0, 0.0, 0.0, 0.0]])
    at = evaluate(basis, far, far[:, :1], np.ones((1, 2)))
    np.testing.assert_array_equal(at[:, 0], at[:, 1])
    assert at[0, 0] == 1.0
    np.testing.assert_allclose(at[1:], 0.0, atol=1e-300)


@pytest.mark.parametrize("xi", np.linspace(0, 1.2, 13))
def test_the_function_is_wendlands(xi):
    at = evaluate(Basis(2.0), np.array([[2 * xi], [0.0]]), np.zeros((2, 1)), np.ones((1, 1)))
    assert at[0, 0] == pytest.approx(radial.wendland_c2(xi), abs=1e-14)


@settings(max_examples=30, deadline=None)
@given(chunk=st.integers(1, 4000), seed=st.integers(0, 9), rule=st.sampled_from(RULES))
def test_chunk_size_never_matters(chunk, seed, rule):
    table, x = frames(3)
    frame = table[rule][0]
    basis = Basis(2.0, frame.period if frame.cylindrical else 0.0)
    features = frame.features(frame.coords(x))
    weights = np.random.default_rng(seed).normal(size=(30, 3))
    whole = evaluate(basis, features, features, weights)
    square = matrix(basis, (features, weights))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", chunk)
        np.testing.assert_array_equal(evaluate(basis, features, features, weights), whole)
        np.testing.assert_array_equal(matrix(basis, (features, weights)), square)


def test_thread_count_never_matters():
    import numba

    table, x = frames(3)
    frame = table["rotational"][0]
    basis, features = Basis(2.0, frame.period), frame.features(frame.coords(x))
    weights = np.random.default_rng(0).normal(size=(30, 3))
    before = numba.get_num_threads()
    results = []
    try:
        for threads in {1, before}:
            numba.set_num_threads(threads)
            results.append(evaluate(basis, features, features, weights))
    finally:
        numba.set_num_threads(before)
    for other in results[1:]:
        np.testing.assert_allclose(other, results[0], rtol=0, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    dim=st.sampled_from([2, 3]),
    rule=st.sampled_from(["translational", "rotational"]),
    k=st.integers(-3, 3),
)
def test_one_period_more_changes_no_distance(dim, rule, k):
    table, x = frames(dim)
    frame = table[rule][0]
    basis = Basis(2.0, frame.period if frame.cylindrical else 0.0)
    coords = frame.coords(x)
    there = matrix(basis, (frame.features(coords + k * frame.shift()), None))
    across = matrix(
        basis, (frame.features(coords + k * frame.shift()), None), (frame.features(coords), None)
    )
    plain = matrix(basis, (frame.features(coords), None))
    np.testing.assert_allclose(there, plain, atol=1e-12)
    np.testing.assert_allclose(across, plain, atol=1e-12)


def test_the_tick_hears_all_fractions_and_may_stop():
    heard = []
    x = np.random.default_rng(0).uniform(size=(2, 50))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", 500)
        evaluate(Basis(1.0), x, x, np.ones((50, 1)), heard.append)
        assert heard == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
        heard.clear()
        evaluate(Basis(1.0), x[:, :24], x, np.ones((50, 1)), heard.append)
        assert heard == pytest.approx([10 / 24, 20 / 24, 1.0]), "the last part is smaller"

        def stop(fraction):
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            matrix(Basis(1.0), (x, None), tick=stop)
        # The lock was given back.
        evaluate(Basis(1.0), x, x, np.ones((50, 1)))


def test_no_targets_and_no_controls():
    x, none = np.zeros((2, 3)), np.zeros((2, 0))
    assert evaluate(Basis(1.0), none, x, np.ones((3, 2))).shape == (0, 2)
    np.testing.assert_array_equal(evaluate(Basis(1.0), x, none, np.ones((0, 2))), np.zeros((3, 2)))


@pytest.mark.parametrize("angle", [1.0, 30.0, 90.0, 180.0, 360.0])
def test_the_polynomial_holds_up_to_a_full_turn(angle):
    period = np.radians(angle)
    theta = np.linspace(-period / 2, period / 2, 21)
    points = np.stack([np.full(21, 0.7), theta], axis=1)
    frame = Frame(2, period=period, axis=np.array([0.0, 0, 1]), origin=np.zeros(3))
    found = matrix(Basis(3.0, period), (frame.features(points), None))
    expected = radial.phi(points, points, 3.0, radial.rotational(period))
    np.testing.assert_allclose(found, expected, atol=2e-12)
