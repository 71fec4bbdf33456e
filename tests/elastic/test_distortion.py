"""The distortion energy: its formula as judge, rotations, folded cells, exact derivatives."""

import numpy as np
import pytest

from slideviz.elastic.distortion import COUPLING, THIN, WORST, Distortion
from slideviz.mesh.jacobians import CORNERS
from tests.elastic.test_linear import ALL_KINDS, distorted

rng = np.random.default_rng(3)


def bent(x):
    """Points turned by 50 degrees and on, and stretched: no cell folds."""
    out = x + 0.1 * np.sin(2.0 * x[:, ::-1] + 0.3)
    cos, sin = np.cos(0.9), np.sin(0.9)
    out[:, :2] = out[:, :2] @ np.array([[cos, sin], [-sin, cos]])
    return out


def body(dim, kind):
    mesh = distorted(dim, kind, 3)
    return mesh, Distortion.of(mesh.points, mesh.cells)


def by_formula(mesh, x, worst, epsilon):
    """The energy, cell by cell and corner by corner."""
    total = 0.0
    for vtk, (_, cells) in mesh.cells.by_type.items():
        for nodes in cells:
            corners = mesh.points[nodes]
            apart = corners - corners.mean(axis=0)
            sizes = np.linalg.svd(apart, compute_uv=False)
            t = min(sizes[-1] / sizes[0] / THIN, 1.0)
            lam = COUPLING * (10 * t**3 - 15 * t**4 + 6 * t**5)
            each = []
            for o, *others in CORNERS[vtk]:
                edges = (mesh.points[nodes[others]] - mesh.points[nodes[o]]).T
                f = (x[nodes[others]] - x[nodes[o]]).T @ np.linalg.inv(edges)
                det = np.linalg.det(f)
                chi = 0.5 * (det + np.hypot(epsilon, det))
                sigma = np.linalg.svd(f, compute_uv=False)
                # In a plane the third stretch is 1: its cofactor is the determinant.
                cofactors = np.sum((np.prod(sigma) / sigma) ** 2)
                size = np.sum(sigma**2)
                if mesh.dim == 2:
                    cofactors += det**2
                    size += 1.0
                e = 0.25 * (size + cofactors / chi**2) - 1.5 + lam * np.log(chi) ** 2
                each.append(e + worst * e**2)
            total += np.mean(each)
    return total


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
@pytest.mark.parametrize("epsilon", [0.0, 0.3])
def test_the_energy_is_that_of_its_formula(dim, kind, epsilon):
    mesh, energy = body(dim, kind)
    x = bent(mesh.points) + 0.01 * rng.standard_normal(mesh.points.shape)
    found = energy.slopes(x, WORST, epsilon)[0]
    assert found == pytest.approx(by_formula(mesh, x, WORST, epsilon), rel=1e-11)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_rigid_motions_have_no_energy_and_no_slopes(dim, kind):
    mesh, energy = body(dim, kind)
    turn = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    value, slopes, least = energy.slopes(mesh.points @ turn.T + 3.0)
    assert abs(value) < 1e-12 * energy.count
    size = np.abs(energy.slopes(bent(mesh.points))[1]).max()
    np.testing.assert_allclose(slopes, 0.0, atol=1e-12 * size)
    np.testing.assert_allclose(least, 1.0, atol=1e-12)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
@pytest.mark.parametrize("epsilon", [0.0, 0.3])
def test_slopes_agree_with_differences(dim, kind, epsilon):
    mesh, energy = body(dim, kind)
    x = bent(mesh.points) + 0.01 * rng.standard_normal(mesh.points.shape)
    if epsilon:  # some cells folded
        x += 0.2 * rng.standard_normal(x.shape)
    t = rng.standard_normal(x.shape)
    slope = np.vdot(energy.slopes(x, WORST, epsilon)[1], t)
    h = 1e-6
    ahead, behind = (energy.slopes(x + s * t, WORST, epsilon)[0] for s in (h, -h))
    assert slope == pytest.approx((ahead - behind) / (2 * h), rel=1e-6)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_products_with_the_hessian_agree_with_differences_and_are_symmetric(dim, kind):
    mesh, energy = body(dim, kind)
    x = bent(mesh.points) + 0.01 * rng.standard_normal(mesh.points.shape)
    t, u = rng.standard_normal((2, *x.shape))
    found = energy.product(x, t)
    h = 1e-6
    ahead, behind = (energy.slopes(x + s * t)[1] for s in (h, -h))
    expected = (ahead - behind) / (2 * h)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    assert np.vdot(u, found) == pytest.approx(np.vdot(energy.product(x, u), t), rel=1e-10)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_a_folded_cell_has_infinite_energy_unless_it_is_regularised(dim, kind):
    mesh, energy = body(dim, kind)
    x = mesh.points.copy()
    x[0] += 2.0 * (x.mean(axis=0) - x[0])
    assert energy.slopes(x)[0] == np.inf
    value, slopes, least = energy.slopes(x, 0.0, 0.5)
    assert np.isfinite(value)
    assert np.isfinite(slopes).all()
    assert least.min() < 0.0
