"""Proof of validity: exact where it says so, never wrong where it decides."""

from __future__ import annotations

import numpy as np
import pytest

from slideviz.mesh.jacobians import (
    INVERTED,
    LEVELS,
    UNPROVEN,
    VALID,
    coefficients,
    subdivide,
)
from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.quality import quality
from tests.oracles import quality as oracle

# In twentieths; found by a search over random cells. All corner Jacobians are positive.
HEX_NEGATIVE_INSIDE = (
    *((3, -7, -5), (13, -10, -9), (14, 25, 8), (8, 21, -9)),
    *((6, -9, 27), (28, 8, 9), (10, 10, 23), (-6, 27, 11)),
)
HEX_VALID_WITH_NEGATIVE_COEFFICIENT = (
    *((11, -8, 4), (22, 9, -10), (27, 29, 2), (-9, 12, -10)),
    *((-9, 10, 22), (30, -5, 19), (22, 29, 15), (-11, 19, 11)),
)
HEX_TOO_CLOSE = (
    *((5, -8, -9), (17, 11, -9), (29, 27, 7), (-3, 17, 7)),
    *((-2, 9, 15), (17, 2, 14), (21, 11, 25), (11, 22, 14)),
)
PRISM_NEGATIVE_INSIDE = (
    *((12, -7, 12), (33, 13, -10), (-13, 12, 8)),
    *((-12, 3, 22), (16, -1, 24), (8, 27, 33)),
)
PRISM_VALID_WITH_NEGATIVE_COEFFICIENT = (
    *((-13, 10, 0), (25, -3, -14), (7, 34, 5)),
    *((1, -8, 31), (18, 14, 34), (-13, 11, 15)),
)


def shaken(vtk, m, amount, seed=0):
    rng = np.random.default_rng(seed)
    ideal = np.array(oracle.IDEAL[vtk])
    return ideal + rng.uniform(-amount, amount, (m, *ideal.shape))


def judged(vtk, cells):
    """Quality of separate cells, each in its own numbering (the reference is the ideal cell)."""
    cells = np.asarray(cells, float)
    nodes = np.arange(cells.shape[0] * cells.shape[1]).reshape(cells.shape[:2])
    ideal = np.tile(oracle.IDEAL[vtk], (len(cells), 1))
    mesh = Mesh(cells.reshape(-1, cells.shape[2]), Cells.from_blocks([(vtk, nodes)]))
    return quality(mesh, mesh.with_points(ideal))


def last(cells):
    """(d, n, m) as the coefficients take them."""
    return np.ascontiguousarray(np.transpose(cells, (2, 1, 0)))


def test_hexahedron_coefficients_are_those_of_the_sampled_determinant():
    cells = shaken(12, 30, 0.6)
    found = coefficients(12, last(cells)).reshape(3, 3, 3, -1)
    for i, points in enumerate(cells):
        expected = oracle.hexahedron_bezier(points)
        np.testing.assert_allclose(found[..., i], expected, rtol=0, atol=1e-12)


def test_hexahedron_coefficients_hold_corners_and_volume():
    cells = shaken(12, 30, 0.6)
    found = coefficients(12, last(cells)).reshape(3, 3, 3, -1)
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2)]
    for i, points in enumerate(cells):
        alpha = oracle.jacobians(12, points)
        for corner, value in zip([*corners, (0, 2, 2)], alpha, strict=True):
            assert found[(*corner, i)] == pytest.approx(value, abs=1e-14)
        assert found[..., i].mean() == pytest.approx(oracle.volume(12, points), abs=1e-14)


def test_prism_coefficients_hold_corners_middle_and_volume():
    cells = shaken(13, 30, 0.6)
    found = coefficients(13, last(cells)).reshape(3, 3, -1)
    for i, points in enumerate(cells):
        alpha = oracle.jacobians(13, points)
        np.testing.assert_allclose(found[[0, 2], :, i].ravel(), alpha, rtol=0, atol=1e-14)
        assert found[..., i].sum() / 18 == pytest.approx(oracle.volume(13, points), abs=1e-14)
        for k, (r, s) in enumerate([(0, 0), (1, 0), (0, 1)]):
            middle = oracle.determinant_at(13, points, r, s, 0.5)
            assert found[:, k, i] @ (0.25, 0.5, 0.25) == pytest.approx(middle, abs=1e-14)


def test_pyramid_volume_is_the_mean_of_its_corner_jacobians_over_three():
    for points in shaken(14, 30, 0.6):
        volume = sum(oracle.jacobians(14, points)) / 12
        assert volume == pytest.approx(oracle.volume(14, points), abs=1e-14)


@pytest.mark.parametrize(("vtk", "amount"), [(9, 0.6), (12, 0.5), (13, 0.6), (14, 0.6)])
def test_status_agrees_with_a_dense_sample(vtk, amount):
    cells = shaken(vtk, 30, amount, seed=5)
    found = judged(vtk, cells)
    least = np.array([oracle.least_determinant(vtk, points, 5) for points in cells])
    assert (found.status[least <= 0] == INVERTED).all()
    assert (least[found.status == VALID] > 0).all()
    assert 3 < found.valid < 28
    assert (found.values > 0).tolist() == (found.status != INVERTED).tolist()


@pytest.mark.parametrize(("vtk", "cell"), [(12, HEX_NEGATIVE_INSIDE), (13, PRISM_NEGATIVE_INSIDE)])
def test_positive_corners_do_not_hide_a_negative_inside(vtk, cell):
    points = np.array(cell) / 20
    assert min(oracle.jacobians(vtk, points)) > 0.4
    assert oracle.least_determinant(vtk, points) < 0
    found = judged(vtk, [points])
    assert found.status[0] == INVERTED
    assert (found.values[0], found.size[0], found.skew[0]) == (0, 0, 0)


def test_hexahedron_with_a_negative_coefficient_is_proved_by_subdivision():
    points = np.array(HEX_VALID_WITH_NEGATIVE_COEFFICIENT) / 20
    assert oracle.hexahedron_bezier(points).min() < -0.02
    assert oracle.least_determinant(12, points) > 0
    assert judged(12, [points]).status[0] == VALID


def test_prism_with_a_negative_coefficient_is_decided_exactly():
    points = np.array(PRISM_VALID_WITH_NEGATIVE_COEFFICIENT) / 20
    assert coefficients(13, last([points])).min() < -1.4
    assert oracle.least_determinant(13, points, 41) > 0
    assert judged(13, [points]).status[0] == VALID


def test_prism_is_never_unproven():
    found = judged(13, shaken(13, 5000, 0.7))
    assert found.unproven == 0
    assert found.valid > 500
    assert found.inverted > 500


def test_hexahedron_too_close_to_call_is_unproven_and_keeps_its_quality():
    points = np.array(HEX_TOO_CLOSE) / 20
    found = judged(12, [points])
    assert found.status[0] == UNPROVEN
    assert (found.unproven, found.valid, found.inverted) == (1, 0, 0)
    value = oracle.size_skew(12, points, oracle.IDEAL[12])[0]
    assert found.values[0] == pytest.approx(value, rel=1e-12)


def parabola(root, lift):
    """Coefficients of (x - root)² + lift along the first parameter, constant along the others."""
    line = [root**2 + lift, root**2 - root + lift, (1 - root) ** 2 + lift]
    return np.broadcast_to(np.reshape(line, (3, 1, 1, 1)), (3, 3, 3, 1))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(
    ("root", "lift", "status"),
    [
        (0.5, 1e-9, VALID),
        (0.5, 0.0, INVERTED),
        (0.5, -1e-9, INVERTED),
        (0.3, 0.01, VALID),
        (0.3, -0.01, INVERTED),
        (0.3, 1e-12, UNPROVEN),
        (0.3, -1e-12, UNPROVEN),
    ],
)
def test_subdivision_decides_what_it_can(axis, root, lift, status):
    assert subdivide(np.moveaxis(parabola(root, lift), 0, axis))[0] == status


def test_subdivision_needs_levels_to_prove():
    coefficients = parabola(0.3, 0.01)
    assert subdivide(coefficients, levels=0)[0] == UNPROVEN
    assert subdivide(coefficients, levels=LEVELS)[0] == VALID


def test_subdivision_keeps_cells_apart():
    kinds = [(0.3, 0.01), (0.5, 0.0), (0.3, 1e-12), (0.7, 0.01)]
    together = np.concatenate([parabola(*kind) for kind in kinds], axis=-1)
    np.testing.assert_array_equal(subdivide(together), [VALID, INVERTED, UNPROVEN, VALID])
