"""Interpolation of a fine grid around a blade from a coarse one, by splines on each block.

Blocks are the eight rectangles of the channel around the hole, and the four parts of the O-grid at
the hole's sides.
"""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
from scipy.interpolate import RectBivariateSpline

from slideviz.mesh.model import FloatArray
from slideviz.samples.blade import BladeSection, GridCounts, blade_nodes
from slideviz.samples.passage import Grid, layer_parts


def refined(coarse: Grid, points: FloatArray, fine: Grid, section: BladeSection) -> FloatArray:
    """Return the nodes (m, 2) of the fine grid, interpolated from ``points`` of the coarse one.

    Nodes of the blade are moved onto it, those of the O-grid with them, less the further out.
    """
    found = np.full((int(fine.quads.max()) + 1, 2), np.nan)
    places = [_channel_knots(grid.n) for grid in (coarse, fine)]
    for i, j in product(range(3), range(3)):
        if i == j == 1:
            continue
        old, new = (
            grid.number[a[i] : a[i + 1] + 1, b[j] : b[j + 1] + 1]
            for grid, (a, b) in zip((coarse, fine), places, strict=True)
        )
        found[new] = _spline(points[old], new.shape)
    turns = [_ring_knots(grid.n) for grid in (coarse, fine)]
    for side in range(4):
        old, new = (
            np.roll(grid.ring, -start, axis=1)[:, : stop - start + 1]
            for grid, knots in zip((coarse, fine), turns, strict=True)
            for start, stop in [list(pairwise(knots))[side]]
        )
        found[new[:-1]] = _spline(points[old], new.shape)[:-1]
    blade = blade_nodes(fine.n.lower, fine.ring.shape[1] - fine.n.lower, section)
    fade = 1 - layer_parts(fine.n)[:-1, None, None]
    found[fine.ring[:-1]] += fade * (blade - found[fine.ring[0]])
    return found


def _channel_knots(n: GridCounts) -> tuple[list[int], list[int]]:
    """Return the indices of grid lines between the blocks of the channel, in both directions."""
    along = np.cumsum([0, n.ahead, n.along, n.behind]).tolist()
    return along, np.cumsum([0, n.below, n.beside, n.above]).tolist()


def _ring_knots(n: GridCounts) -> list[int]:
    """Return the columns of the O-grid at the corners of the hole, the first one again."""
    return (n.nose + np.cumsum([0, n.along, n.beside, n.along, n.beside])).tolist()


def _spline(block: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return a block of points (a, b, 2) resampled by cubic splines: (*shape, 2)."""
    x, y = (np.linspace(0, 1, size) for size in block.shape[:2])
    new_x, new_y = (np.linspace(0, 1, size) for size in shape)
    kx, ky = min(3, len(x) - 1), min(3, len(y) - 1)
    columns = [
        RectBivariateSpline(x, y, block[..., k], kx=kx, ky=ky)(new_x, new_y) for k in range(2)
    ]
    return np.stack(columns, axis=2)
