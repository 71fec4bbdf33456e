"""Nearest rotations against SVD, and their derivative against differences."""

import numpy as np
import pytest

from slideviz.rbf.nearest_rotation import nearest_rotations, rotation_slopes, rotations
from slideviz.rbf.tape import Tape

EPS = float(np.finfo(float).eps)
rng = np.random.default_rng(5)


def not_orthogonal(r):
    return np.abs(r @ np.swapaxes(r, 1, 2) - np.eye(r.shape[1])).max()


def by_svd(m):
    u, _, vt = np.linalg.svd(m)
    u[:, :, -1] *= np.linalg.det(u @ vt)[:, None]
    return u @ vt


def matrices(d, kind):
    m = rng.standard_normal((400, d, d))
    if kind == "reflections":
        m[..., 0] *= -np.sign(np.linalg.det(m))[:, None]
    if kind == "flat":
        m[..., -1] *= 1e-9
    if kind == "near":
        m = by_svd(m) @ (np.eye(d) + 1e-7 * m)
    return m


@pytest.mark.parametrize("kind", ["any", "reflections", "flat", "near"])
@pytest.mark.parametrize("d", [2, 3])
def test_rotations_are_those_of_svd(d, kind):
    m = matrices(d, kind)
    expected, found = by_svd(m), rotations(m)
    # A unit quaternion is off by an eps or two; each entry of R is a sum of four of its products.
    assert not_orthogonal(found) <= 16.0 * EPS
    np.testing.assert_allclose(np.linalg.det(found), 1.0, atol=16.0 * EPS)
    # Where the two smallest singular values cancel, the rotation is not unique.
    size = np.linalg.svd(m, compute_uv=False)
    gap = size[:, -2] + np.sign(np.linalg.det(m)) * size[:, -1]
    error = np.abs(found - expected).max(axis=(1, 2))
    # The oracle multiplies two matrices that are as far from orthogonal as their product.
    rounding = 2.0 * not_orthogonal(expected) + 16.0 * EPS
    assert (error <= rounding * size[:, 0] / gap).all()


@pytest.mark.parametrize("d", [2, 3])
def test_matrices_without_a_polar_part_have_a_rotation(d):
    line = np.zeros((d, d))
    line[-1, 0] = 3.0
    for m in (np.zeros((d, d)), line, -np.eye(d), 1e-200 * np.eye(d), np.diag(np.arange(d) - 1.0)):
        (found,) = rotations(m[None])
        np.testing.assert_allclose(found @ found.T, np.eye(d), atol=1e-15)
        assert np.linalg.det(found) == pytest.approx(1.0)
        assert np.trace(found.T @ m) == pytest.approx(np.trace(by_svd(m[None])[0].T @ m))
        assert np.isfinite(rotation_slopes(m[None], found[None])).all()
    np.testing.assert_array_equal(rotations(np.zeros((1, d, d)))[0], np.eye(d))


@pytest.mark.parametrize("kind", ["any", "reflections"])
@pytest.mark.parametrize("d", [2, 3])
def test_the_derivative_is_exact(d, kind):
    m = by_svd(matrices(d, kind)) @ (np.eye(d) + 0.2 * rng.standard_normal((400, d, d)))
    m = m.reshape(-1, d * d)
    t, g = rng.standard_normal((2, 3, *m.shape))
    start = Tape().variable(m)
    end = nearest_rotations(start, d)
    pushed, pulled = end.tape.push(start, t, end), end.tape.pull(end, g, start)
    h = 1e-6
    ahead, behind = (nearest_rotations(m + s * h * t[0], d) for s in (1.0, -1.0))
    np.testing.assert_allclose(pushed[0], (ahead - behind) / (2 * h), atol=1e-7)
    assert (pushed * g).sum() == pytest.approx((pulled * t).sum(), rel=1e-12)
