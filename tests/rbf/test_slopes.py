"""Derivatives of radial sums and of the frame's maps, against central differences."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.rbf.evaluate import Basis, evaluate
from slideviz.rbf.frames import Frame, coords_slopes, features_slopes, points_slopes
from slideviz.rbf.slopes import pull_positions, push_positions
from tests.oracles.kernels import KERNELS

DISTANCES = {"euclidean": (3, 0.0), "translational": (4, 0.0), "rotational": (4, 0.7)}
H = 1e-6


def nodes(rule, count, seed):
    rng = np.random.default_rng(seed)
    rows, period = DISTANCES[rule]
    x = rng.random((rows, count))
    if period:
        half = np.pi * (x[1] - 0.5)
        x[0], x[1], x[2] = 1.0 + 0.3 * x[0], np.sin(half), np.cos(half)
    return x


@pytest.mark.parametrize("rule", DISTANCES)
@pytest.mark.parametrize("kernel", KERNELS)
def test_slopes_of_radial_sums(kernel, rule):
    rng = np.random.default_rng(3)
    basis = Basis(1.1, DISTANCES[rule][1], kernel)
    x, c = nodes(rule, 70, 1), nodes(rule, 300, 2)
    dx, dc = rng.standard_normal(x.shape), rng.standard_normal(c.shape)
    w, back = rng.standard_normal((300, 3)), rng.standard_normal((70, 3))
    found = push_positions(basis, x, c, w, moved=dx, moved_controls=dc)
    ahead, carried_error = (evaluate(basis, x + h * dx, c + h * dc, w) for h in (H, -H))
    size = np.abs(found).max()
    # Where a function begins to be zero, its third derivative may jump.
    np.testing.assert_allclose((ahead - carried_error) / (2 * H), found, rtol=0, atol=2e-7 * size)
    of_targets = pull_positions(basis, x, c, back, w)
    of_controls = pull_positions(basis, c, x, w, back)
    both = (of_targets * dx).sum() + (of_controls * dc).sum()
    assert both == pytest.approx((back * found).sum(), rel=1e-12)


@pytest.mark.parametrize("rule", DISTANCES)
@pytest.mark.parametrize("kernel", KERNELS)
def test_a_node_that_is_a_control_node_stays_at_distance_zero(kernel, rule):
    basis = Basis(1.1, DISTANCES[rule][1], kernel)
    x = nodes(rule, 1, 1)
    found = push_positions(basis, x, x, np.ones((1, 3)), moved=x, moved_controls=x)
    np.testing.assert_allclose(found, 0.0, atol=1e-12)
    assert np.isfinite(pull_positions(basis, x, x, np.ones((1, 3)), np.ones((1, 3)))).all()


TILTED = np.array([0.6, 0.0, 0.8])
AROUND = Frame(
    3, period=0.7, axis=TILTED, origin=np.array([0.1, 0.2, -0.3]), theta0=0.4, radius=1.7
)
FRAMES = {
    "cartesian": Frame(3),
    "plane": Frame(2),
    "translational": Frame(3, direction=TILTED, period=1.3),
    "translational plane": Frame(2, direction=np.array([0.6, 0.8]), period=1.3),
    "rotational": AROUND,
    "rotational without period": replace(AROUND, period=0.0),
    "rotational plane": replace(AROUND, dim=2, axis=np.array([0.0, 0.0, 1.0])),
}


@pytest.mark.parametrize("name", FRAMES)
def test_slopes_of_a_frame(name):
    frame = FRAMES[name]
    rng = np.random.default_rng(5)
    points = 1.5 + rng.random((20, frame.dim))
    coords = frame.coords(points)
    for found, at, of in (
        (coords_slopes(frame, points), points, frame.coords),
        (points_slopes(frame, coords), coords, frame.points),
        (features_slopes(frame, coords), coords, lambda q: frame.features(q).T),
    ):
        t = rng.standard_normal(at.shape)
        change = (of(at + H * t) - of(at - H * t)) / (2 * H)
        np.testing.assert_allclose(np.einsum("ned,nd->ne", found, t), change, atol=1e-8)


def test_on_the_axis_radius_and_angle_do_not_change():
    frame = replace(AROUND, axis=np.array([0.0, 0.0, 1.0]), origin=np.zeros(3))
    found = coords_slopes(frame, np.array([[0.0, 0.0, 0.5]]))
    np.testing.assert_array_equal(found[0], np.diag([0.0, 0.0, 1.0]))
