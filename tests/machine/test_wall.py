"""Walls about an axis, and flat ones that have none."""

import numpy as np
import pytest

from slideviz.machine.wall import closed_wall, turn_about_axis, wall_profile


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


ROWS = 8


def tube(columns, around, begin, holes=()):
    """Return (z, r, theta) of a cylinder's nodes, and its facets without those of the holes."""
    theta = begin + np.linspace(0.0, around, columns + 1)
    if around > 6.0:
        theta = theta[:-1]
    theta = (theta + np.pi) % (2.0 * np.pi) - np.pi
    height = np.linspace(0.0, 1.0, ROWS + 1)
    z, t = (part.ravel() for part in np.meshgrid(height, theta, indexing="ij"))
    kept = np.ones((ROWS, columns), bool)
    for low, high, first, last in holes:
        kept[low:high, first:last] = False
    i, k = np.nonzero(kept)
    n = len(theta)
    after = (k + 1) % n
    facets = np.stack([i * n + k, i * n + after, (i + 1) * n + after, (i + 1) * n + k], axis=1)
    return np.stack([z, np.ones(len(z)), t], axis=1), facets


SECTOR, WHEEL = (12, 1.0), (24, 2.0 * np.pi)
ONE, TWO = [(1, 7, 2, 7)], [(1, 7, 2, 7), (3, 5, 8, 9)]


@pytest.mark.parametrize("begin", [0.2, np.pi - 0.4, np.pi - 0.6], ids=["", "branch", "between"])
@pytest.mark.parametrize("holes", [[], ONE, TWO], ids=len)
@pytest.mark.parametrize("wall", [SECTOR, WHEEL], ids=["sector", "wheel"])
def test_the_holes_of_all_blades_are_closed_and_nothing_else(wall, holes, begin):
    columns, around = wall
    coords, facets = tube(columns, around, begin, holes)
    closed, closing = closed_wall(coords, facets, 1.0, around)
    flat = coords[closing[:, :3]][..., [0, 2]]
    flat[..., 1] -= 2.0 * np.pi * np.round((flat[..., 1] - flat[:, :1, 1]) / (2.0 * np.pi))
    (a, b), (c, d) = (np.moveaxis(flat[:, at] - flat[:, 0], -1, 0) for at in (1, 2))
    cells = sum((high - low) * (last - first) for low, high, first, last in holes)
    assert np.abs(a * d - b * c).sum() / 2.0 == pytest.approx(cells * around / columns / ROWS)
    assert (closing[:, 2] == closing[:, 3]).all()
    # No facet is wider than the hole, where theta jumps by a turn either.
    assert np.ptp(closed.corners[..., 2], axis=1).max() < 5.001 * around / columns


@pytest.mark.parametrize("turn", np.radians([0.0, 40.0, 130.0, 250.0]))
def test_the_profile_goes_from_end_to_end_however_it_lies(turn):
    """Through an arc of 150 degrees, in coordinates whose order says nothing about its ends."""
    arc = np.radians(np.linspace(-75.0, 75.0, 21)) + turn
    z, r = np.sin(arc), 3.0 + np.cos(arc)
    nodes, facets = sheet(
        lambda u, v: (
            np.interp(u, np.linspace(0, 1, 21), z),
            np.interp(u, np.linspace(0, 1, 21), r),
            v,
        ),
        20,
    )
    shuffled = np.random.default_rng(1).permutation(len(nodes))
    coords = np.empty_like(nodes)
    coords[shuffled] = nodes
    profile = wall_profile(coords, shuffled[facets])
    path = np.concatenate([profile[:, 0], profile[-1:, 1]])
    expected = np.stack([z, r], axis=1)
    assert np.allclose(path, expected) or np.allclose(path, expected[::-1])
