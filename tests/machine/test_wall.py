"""Walls about an axis, and flat ones that have none."""

import numpy as np

from slideviz.machine.wall import turn_about_axis


def sheet(place, n=8):
    """Return the nodes and quadrilaterals of a square of n x n cells, put to its place."""
    u, v = (part.ravel() for part in np.meshgrid(*[np.linspace(0.0, 1.0, n + 1)] * 2))
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    cells = np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=-1)
    return np.stack(place(u, v), axis=1), cells.reshape(-1, 4)


def turned(radius, height, around=2.0 * np.pi):
    def place(u, v):
        return (
            radius(v) * np.cos(around * u),
            radius(v) * np.sin(around * u),
            height(v) + 0.0 * u,
        )

    return sheet(place, 16)


def test_a_cylinder_and_a_flat_ring_turn_about_the_axis():
    tube, cells = turned(lambda v: 1.0 + 0.0 * v, lambda v: v)
    assert turn_about_axis(tube, [cells])
    ring, cells = turned(lambda v: 1.0 + v, lambda v: 0.0 * v)
    assert turn_about_axis(ring, [cells])
    both = np.concatenate([tube, ring + np.array([0.0, 0.0, 2.0])])
    assert turn_about_axis(both, [cells, cells + len(tube)])


def test_flat_walls_beside_a_wing_have_no_axis():
    plane, cells = sheet(lambda u, v: (u - 0.5, v - 0.5, 0.0 * u))
    assert not turn_about_axis(plane, [cells])
    other, _ = sheet(lambda u, v: (u - 0.5, v - 0.5, 1.0 + 0.0 * u))
    assert not turn_about_axis(np.concatenate([plane, other]), [cells, cells + len(plane)])
    half, cells = turned(lambda v: 1.0 + v, lambda v: 0.0 * v, np.pi)
    assert not turn_about_axis(half, [cells])
    upright, cells = sheet(lambda u, v: (2.0 + u, 0.0 * u, v))
    assert not turn_about_axis(upright, [cells])
