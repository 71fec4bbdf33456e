"""The channel around the blade of the sample ``passage``, with a hole for the O-grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.case.sample_blade import camber
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray

PITCH = 0.75
X_IN, X_OUT = -0.5, 1.6
HOLE = (-0.1, 1.12, 0.14)
"""First and last x of the hole before smoothing, and its half height about the camber line."""


@dataclass(frozen=True)
class Counts:
    """Numbers of cells.

    Attributes
    ----------
    ahead, along, behind : int
        Of the channel in x: before, beside and behind the hole.
    below, beside, above : int
        Of the channel in y, likewise.
    layers : int
        Of the O-grid, away from the blade.
    """

    ahead: int
    along: int
    behind: int
    below: int
    beside: int
    above: int
    layers: int


def counts(size: int) -> Counts:
    """Return the numbers of cells for ``size`` cells along the inflow.

    Raises
    ------
    CaseError
        There are too few to follow the blade.
    """
    if size < 12:
        raise CaseError(f"size {size} is too coarse for the blade; needed are 12 cells or more")
    ahead, along, behind, beside, layers = (
        round(size * share / 36) for share in (20, 52, 22, 16, 18)
    )
    below = (size - beside) // 2
    return Counts(ahead, along, behind, below, beside, size - beside - below, layers)


def channel_numbers(n: Counts) -> IntArray:
    """Return the node number at each place of the channel, -1 inside the hole."""
    shape = (n.ahead + n.along + n.behind + 1, n.below + n.beside + n.above + 1)
    kept = np.ones(shape, bool)
    kept[n.ahead + 1 : n.ahead + n.along, n.below + 1 : n.below + n.beside] = False
    return np.where(kept, np.cumsum(kept).reshape(shape) - 1, -1)


def channel_points(n: Counts) -> FloatArray:
    """Return the channel's nodes with straight lines, hole included: (m, 2)."""
    first, last, half = HOLE
    x = _pieces((X_IN, first, last, X_OUT), (n.ahead, n.along, n.behind))
    y = _pieces((-PITCH / 2, -half, half, PITCH / 2), (n.below, n.beside, n.above))
    xs, ys = np.meshgrid(x, y, indexing="ij")
    return np.column_stack([xs.ravel(), ys.ravel() + camber(xs.ravel())])


def _pieces(places: tuple[float, ...], cells: tuple[int, ...]) -> FloatArray:
    """Return points that divide each piece between two places into its number of cells."""
    starts = [
        np.linspace(a, b, count, endpoint=False)
        for a, b, count in zip(places[:-1], places[1:], cells, strict=True)
    ]
    return np.concatenate([*starts, places[-1:]])
