"""Frames: there and back, features, and the shift of one period."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.mesh.periodic import match
from slideviz.rbf.frames import Frame, _middle_angle, make_frame
from tests import builders

SEEDS = st.integers(0, 10_000)
VECTOR = st.tuples(*[st.floats(-2, 2)] * 3)


def rotational(points, angle=pi / 6, axis=(0.0, 0.0, 1.0), origin=(0.0, 0.0, 0.0)):
    made = builders.pair("rotational", points.shape[1], angle=angle, axis=axis, origin=origin)
    return make_frame(points, [made], periodic_distance=True)[0]


@settings(max_examples=40, deadline=None)
@given(axis=VECTOR.filter(lambda a: np.linalg.norm(a) > 0.1), origin=VECTOR, seed=st.integers(0, 9))
def test_points_come_back(axis, origin, seed):
    x = np.random.default_rng(seed).normal(size=(20, 3))
    frame = rotational(x, axis=axis, origin=origin)
    np.testing.assert_allclose(frame.points(frame.coords(x)), x, atol=1e-13)
    local = frame.coords(x)
    e = np.array(axis) / np.linalg.norm(axis)
    arm = x - np.array(origin)
    np.testing.assert_allclose(local[:, 2], arm @ e, atol=1e-12)
    np.testing.assert_allclose(local[:, 0], np.linalg.norm(np.cross(arm, e), axis=1), atol=1e-12)


def test_the_cut_of_theta_lies_in_the_empty_sector():
    # A sector across the negative x axis, where arctan2 jumps.
    mesh = builders.sector(6, 40.0, start_deg=160.0)
    frame = make_frame(mesh.points, [match(mesh, "per1", "per2")], periodic_distance=True)[0]
    theta = frame.coords(mesh.points)[:, 1] / frame.radius
    assert np.ptp(theta) == pytest.approx(np.radians(40.0))
    assert frame.shift()[1] / frame.radius == pytest.approx(np.radians(40.0))


@settings(max_examples=60, deadline=None)
@given(
    seed=SEEDS,
    count=st.integers(1, 40),
    width=st.sampled_from([0.01, 1.0, 6.28]),
    full=st.booleans(),
)
def test_the_empty_sector_is_that_between_neighbours(seed, count, width, full):
    """Also where it is narrower than what the circle is divided into."""
    rng = np.random.default_rng(seed)
    angles = (rng.uniform(-pi, pi) + width * rng.random(count) + pi) % (2 * pi) - pi
    if full:
        angles = np.r_[angles, rng.uniform(-pi, pi, 5000), -pi, pi]
    ordered = np.sort(angles)
    gaps = np.diff(np.r_[ordered, ordered[0] + 2 * pi])
    k = np.argmax(gaps)
    assert _middle_angle(np.ones_like(angles), angles) == ordered[k] + gaps[k] / 2 + pi


def test_small_displacements_are_components_along_r_and_theta():
    x = np.array([[0.0, 2.0, 1.0]])
    frame = rotational(np.array([[0.0, 2.0, 1.0], [1.0, 1.0, 0.0]]))
    step = frame.difference(x, np.array([[-1e-7, 2e-7, 3e-7]]))
    np.testing.assert_allclose(step, [[2e-7, 1e-7 * frame.radius / 2, 3e-7]], rtol=1e-6)


def test_a_zero_displacement_stays_zero_to_the_bit():
    x = np.random.default_rng(0).normal(size=(20, 3))
    assert not rotational(x).difference(x, np.zeros((20, 3))).any()


def test_a_displacement_across_the_cut_takes_the_short_way():
    # Points all around: the cut is somewhere, and each point turns by 0.1 only.
    t = np.linspace(0, 2 * pi, 50)[:-1]
    x = np.stack([np.cos(t), np.sin(t)], axis=1)
    frame = rotational(x)
    turned = np.stack([np.cos(t + 0.1), np.sin(t + 0.1)], axis=1) - x
    np.testing.assert_allclose(
        frame.difference(x, turned), np.tile([0, 0.1 * frame.radius], (49, 1)), atol=1e-12
    )


def test_nodes_on_the_axis_have_the_middle_angle():
    mesh = builders.grid((4, 4), place=builders.ring((4, 4), 0.0, 1.0, 60.0))
    frame = make_frame(
        mesh.points, [match(mesh, "y_m", "y_p", "rotational")], periodic_distance=True
    )[0]
    coords = frame.coords(mesh.points)
    on_axis = np.hypot(*mesh.points.T) < 1e-12
    assert on_axis.any()
    assert not coords[on_axis].any()
    np.testing.assert_allclose(frame.points(coords), mesh.points, atol=1e-14)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_period_along_any_direction(dim):
    rng = np.random.default_rng(0)
    u = rng.normal(size=dim)
    u /= np.linalg.norm(u)
    frame = Frame(dim, direction=u, period=0.7)
    x = rng.normal(size=(10, dim))
    a, b = frame.features(x), frame.features(x + 0.7 * u)
    np.testing.assert_allclose(a, b, atol=1e-12)
    gap = np.linalg.norm(a[:, 0] - a[:, 1])
    along = (x[0] - x[1]) @ u
    rest = np.linalg.norm(x[0] - x[1] - along * u)
    expected = np.hypot(rest, 0.7 / pi * np.sin(pi * along / 0.7))
    assert gap == pytest.approx(expected, abs=1e-13)
    np.testing.assert_allclose(frame.shift(), 0.7 * u)


def test_what_is_not_periodic_has_no_shift():
    assert not Frame(3).shift().any()
    mesh = builders.sector(6)
    frame = make_frame(mesh.points, [match(mesh, "per1", "per2")], periodic_distance=False)[0]
    assert frame.cylindrical
    assert not frame.shift().any()
    square = builders.square(4)
    plain = make_frame(square.points, [match(square, "x_m", "x_p")], periodic_distance=False)[0]
    assert not plain.cylindrical
    assert not plain.shift().any()
