"""Corotated forces: no forces of rigid motions, assembled matrices as judge, exact derivatives."""

import numpy as np
import pytest

from slideviz.elastic.corotated import Corotated
from slideviz.elastic.stiffness import blocks
from slideviz.rbf.polar import rotations
from slideviz.system.threads import core_limit
from tests.elastic.test_linear import ALL_KINDS, distorted, stiffness

rng = np.random.default_rng(8)


def body(dim, kind, n=3):
    mesh = distorted(dim, kind, n)
    return mesh, Corotated.of(mesh.points, blocks(mesh.cells))


def bent(x):
    """Points moved by large and different rotations, and stretched a little."""
    angle = 1.2 * x[:, 0] + 0.4
    out = 1.1 * x
    out[:, 0] = x[:, 0] * np.cos(angle) - x[:, 1] * np.sin(angle)
    out[:, 1] = x[:, 0] * np.sin(angle) + x[:, 1] * np.cos(angle)
    return out


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_rigid_motions_have_no_forces(dim, kind):
    mesh, elastic = body(dim, kind)
    (turn,) = rotations(rng.standard_normal((1, dim, dim)))
    x = mesh.points @ turn.T + 3.0
    size = np.abs(elastic.forces(bent(mesh.points))).max()
    np.testing.assert_allclose(
        elastic.rotations(x), turn[None] + 0 * elastic.rotations(x), atol=1e-13
    )
    np.testing.assert_allclose(elastic.forces(x), 0.0, atol=1e-12 * size)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_forces_are_those_of_assembled_matrices(dim, kind):
    mesh, elastic = body(dim, kind)
    u = rng.standard_normal(mesh.points.shape)
    expected = (stiffness(mesh) @ u.ravel()).reshape(u.shape)
    np.testing.assert_allclose(
        elastic.product(None, u), expected, atol=1e-12 * np.abs(expected).max()
    )
    # One rotation for all: f = R K (R^T x - X).
    (turn,) = rotations(rng.standard_normal((1, dim, dim)))
    alike = np.tile(turn, (sum(len(part.nodes) for part in elastic.parts), 1, 1))
    x = (mesh.points + u) @ turn.T
    size = np.abs(expected).max()
    np.testing.assert_allclose(elastic.forces(x, alike), expected @ turn.T, atol=1e-12 * size)
    np.testing.assert_allclose(
        elastic.product(alike, u @ turn.T), expected @ turn.T, atol=1e-12 * size
    )


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_rotations_are_those_of_the_least_squares_map(dim, kind):
    mesh, elastic = body(dim, kind)
    x, found = bent(mesh.points), iter(elastic.rotations(bent(mesh.points)))
    for part in elastic.parts:
        for nodes in part.nodes:
            before, after = (p[nodes] - p[nodes].mean(axis=0) for p in (mesh.points, x))
            fit = np.linalg.lstsq(before, after, rcond=None)[0].T
            np.testing.assert_allclose(next(found), rotations(fit[None])[0], atol=1e-12)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_derivatives_are_exact(dim, kind):
    mesh, elastic = body(dim, kind)
    x = bent(mesh.points)
    t, g = rng.standard_normal((2, *x.shape))
    pushed, h = elastic.pushed(x, t), 1e-6
    by_differences = (elastic.forces(x + h * t) - elastic.forces(x - h * t)) / (2 * h)
    np.testing.assert_allclose(pushed, by_differences, atol=1e-7 * np.abs(pushed).max())
    # The rotations' part counts.
    alone = elastic.product(elastic.rotations(x), t)
    assert np.abs(pushed - alone).max() > 1e-3 * np.abs(pushed).max()
    assert (pushed * g).sum() == pytest.approx((elastic.pulled(x, g) * t).sum(), rel=1e-12)


@pytest.mark.parametrize(("dim", "kind"), [(2, "mixed"), (3, "mixed")])
def test_any_number_of_threads_gives_the_same_bits(dim, kind, monkeypatch):
    monkeypatch.setattr("slideviz.system.threads.PART", 24)
    mesh, elastic = body(dim, kind, n=6)
    x = bent(mesh.points)

    def results():
        return elastic.forces(x), elastic.pushed(x, x), elastic.pulled(x, x)

    several = results()
    with core_limit(1):
        monkeypatch.setattr("slideviz.system.threads.PART", 10_000)
        alone = results()
    for one, other in zip(several, alone, strict=True):
        np.testing.assert_array_equal(one, other)
