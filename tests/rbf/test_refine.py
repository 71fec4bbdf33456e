"""Nearly singular systems: residuals, measured errors and refined solutions, against 50 digits."""

from __future__ import annotations

from decimal import localcontext

import numpy as np
import pytest

from slideviz.rbf import refine
from slideviz.rbf.double_double import FUNCTIONS, DoubleFactor, Residuals
from slideviz.rbf.evaluate import Basis, matrix
from slideviz.rbf.refine import System
from slideviz.rbf.solve import factorise
from tests.oracles import digits


def profile(size):
    """Points of a thin profile in a far field, and whether they are of the profile."""
    t = 2.0 * np.pi * np.arange(24) / 24
    thin = np.stack([np.cos(t), 0.05 * np.sin(t) * np.sin(t / 2.0)], axis=1)
    far = np.stack([np.cos(t[::4]), np.sin(t[::4])], axis=1)
    return np.concatenate([size * thin, far]), np.arange(30) < 24


@pytest.mark.parametrize("kernel", FUNCTIONS)
@pytest.mark.parametrize("turned", [False, True], ids=["axes", "directions"])
def test_residuals_have_twice_the_digits(kernel, turned):
    rng = np.random.default_rng(0)
    points = rng.uniform(size=(12, 3)) * [1.0, 2.0, 4.0]
    normals = rng.normal(size=points.shape) if turned else None
    right, weights = rng.normal(size=(12, 2)), 1e12 * rng.normal(size=(12, 2))
    low = 1e-6 * rng.normal(size=(12, 2))
    basis = Basis(4.0, kernel=kernel)  # a power of two: the oracle divides by it
    with localcontext() as context:
        context.prec = 50
        system = digits.matrix(points, points, 4.0, kernel)
        if normals is not None:
            system = system * (digits.EXACT(normals) @ digits.EXACT(normals).T)
        exact = digits.EXACT(right) - system @ (digits.EXACT(weights) + digits.EXACT(low))
    found = Residuals(basis, (points.T.copy(), normals))(right, weights, low)
    np.testing.assert_allclose(found, exact.astype(float), rtol=1e-12)


def test_residuals_with_rotational_distances_are_those_of_the_matrix():
    rng = np.random.default_rng(1)
    points = rng.uniform(0.5, 1.5, size=(20, 3))
    basis = Basis(4.0, period=0.5)
    angle = points[:, 1] * np.pi / 0.5
    features = np.stack([points[:, 0], np.sin(angle), np.cos(angle), points[:, 2]])
    weights = rng.normal(size=(20, 1))
    nothing = np.zeros_like(weights)
    found = Residuals(basis, (features, None))(nothing, weights, nothing)
    np.testing.assert_allclose(found, -matrix(basis, (features, None)) @ weights, rtol=1e-12)


@pytest.mark.parametrize("dense", [refine.DENSE, 0], ids=["factor", "gradients"])
@pytest.mark.parametrize("turned", [False, True], ids=["axes", "directions"])
@pytest.mark.parametrize("dropped", [False, True], ids=["whole", "dropped"])
def test_the_error_is_measured_and_mended(monkeypatch, turned, dropped, dense):
    """By a factor with twice the digits, or by conjugate gradients, as of large systems."""
    monkeypatch.setattr(refine, "DENSE", dense)
    size = 1e-3 if dropped else 0.02
    points, inside = profile(size)
    values = np.sin(points[:, ::-1] / size) * inside[:, None]
    angle = np.random.default_rng(2).uniform(0.0, 0.5, size=len(points))
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1) if turned else None
    right = values if normals is None else (values * normals).sum(axis=1, keepdims=True)
    basis = Basis(4.0)
    features = points.T.copy()
    factor = factorise(matrix(basis, (features, normals)))
    assert bool(len(factor.dropped)) == dropped
    with localcontext() as context:
        context.prec = 50
        exact = digits.matrix(points, points, 4.0)
        if normals is not None:
            exact = exact * (digits.EXACT(normals) @ digits.EXACT(normals).T)
        weights = digits.solved(exact, digits.EXACT(right))
        all_digits = weights.astype(float)
        field = digits.matrix(0.9 * points, points, 4.0)
    system = System(basis, (features, normals), factor)

    def error(found):
        """The error of the field of these weights; the field itself has 50 digits."""
        with localcontext() as context:
            context.prec = 50
            off = digits.EXACT(found) - weights
            along = off if normals is None else off * digits.EXACT(normals)
            return np.abs((field @ along).astype(float)).max()

    first = factor.solve(right)
    refined = system.refined(right, np.ones(right.shape[1]), first)
    # A radial function is at most 1, so that rounded weights have a field off by half an eps each.
    rounding = np.finfo(float).eps / 2.0 * np.abs(all_digits).sum(axis=0).max()
    assert error(refined.weights) < rounding < 0.1 * error(first)
    assert error(refined.weights) <= refined.error_estimate.max()
    assert refined.error_estimate.max() < 1e-4
    assert refined.exact == (dense > 0)
    if refined.exact:
        off = np.abs(refined.weights - all_digits).max(axis=0)
        assert (off < 1e-12 * np.abs(all_digits).max(axis=0)).all()
        assert 0.3 * error(first) < refined.before.max() < 30.0 * error(first)
    assert 0.03 * error(first) < system.field_error(right, first).max() < 30.0 * error(first)


def test_nodes_in_one_place_have_no_factor_and_are_refined_by_conjugate_gradients():
    points = np.concatenate([profile(0.5)[0], profile(0.5)[0][:1]])
    place = points.T.copy(), None
    assert DoubleFactor.of(Residuals(Basis(4.0), place)) is None
    system = System(Basis(4.0), place, factorise(matrix(Basis(4.0), place)))
    right = points[:, :1]
    found = system.refined(right, np.ones(1), system.factor.solve(right))
    assert not found.exact
    assert found.error_estimate.max() < 1e-6


@pytest.mark.parametrize(("apart", "least", "most"), [(0.1, 1e-15, 1e-10), (1e-14, 0.01, 1e9)])
def test_rounding_of_data_counts_where_nodes_nearly_coincide(apart, least, most):
    points = profile(0.5)[0]
    points = np.concatenate([points, points[:1] + np.array([0.0, apart])])
    place = points.T.copy(), None
    system = System(Basis(4.0), place, factorise(matrix(Basis(4.0), place)))
    assert least < system.noise() < most


def test_a_factor_of_several_blocks_has_twice_the_digits():
    """Solutions of a matrix whose condition number is 1e13, against residuals."""
    points = np.random.default_rng(0).uniform(size=(300, 2)) * [1.0, 1e-3]
    residuals = Residuals(Basis(4.0), (points.T.copy(), None))
    right = np.sin(9.0 * points)
    factor = DoubleFactor.of(residuals)
    assert factor is not None
    weights = factor.solve(right)
    # What remains is the rounding of the weights: the residual of the next ones is far below.
    low = factor.solve(residuals(right, weights, np.zeros_like(weights)))
    left = np.abs(residuals(right, weights, low)).max()
    assert left < 1e-12 * np.finfo(float).eps * np.abs(weights).max()
