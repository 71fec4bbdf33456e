"""The channel around the blade of ``passage`` and ``stator``, with a hole for the O-grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.samples.blade import PASSAGE, Section, camber


@dataclass(frozen=True)
class Shares:
    """Numbers of cells for 36 along the inflow, and how the O-grid is turned against the hole.

    Attributes
    ----------
    ahead, along, behind, beside, layers : int
        As of `Counts`.
    nose, tail : float
        Where the lines of leading and trailing edge meet the first and the last side of the
        hole, over its length: 0 is the corner on the pressure side.
    """

    ahead: int = 20
    along: int = 52
    behind: int = 22
    beside: int = 16
    layers: int = 18
    nose: float = 0.25
    tail: float = 0.0


PASSAGE_SHARES = Shares()
"""Of the sample ``passage``; they leave its cells nearly orthogonal."""


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
    nose, tail : int
        Beside the hole, from its lower corners to the lines of leading and trailing edge.
    """

    ahead: int
    along: int
    behind: int
    below: int
    beside: int
    above: int
    layers: int
    nose: int
    tail: int

    @property
    def lower(self) -> int:
        """Return the cells on the pressure side of the blade."""
        return self.nose + self.along + self.tail


def counts(size: int, shares: Shares = PASSAGE_SHARES) -> Counts:
    """Return the numbers of cells for ``size`` cells along the inflow.

    Raises
    ------
    CaseError
        There are too few to follow the blade.
    """
    if size < 12:
        raise CaseError(f"size {size} is too coarse for the blade; needed are 12 cells or more")
    cells = (shares.ahead, shares.along, shares.behind, shares.beside, shares.layers)
    ahead, along, behind, beside, layers = (round(size * share / 36) for share in cells)
    below = (size - beside) // 2
    nose, tail = round(beside * shares.nose), round(beside * shares.tail)
    above = size - beside - below
    return Counts(ahead, along, behind, below, beside, above, layers, nose, tail)


def channel_numbers(n: Counts) -> IntArray:
    """Return the node number at each place of the channel, -1 inside the hole."""
    shape = (n.ahead + n.along + n.behind + 1, n.below + n.beside + n.above + 1)
    kept = np.ones(shape, bool)
    kept[n.ahead + 1 : n.ahead + n.along, n.below + 1 : n.below + n.beside] = False
    return np.where(kept, np.cumsum(kept).reshape(shape) - 1, -1)


def channel_points(n: Counts, section: Section = PASSAGE) -> FloatArray:
    """Return the channel's nodes with straight lines, hole included: (m, 2)."""
    first, last, half = section.hole
    x = _pieces((section.ends[0], first, last, section.ends[1]), (n.ahead, n.along, n.behind))
    y = _pieces((-section.pitch / 2, -half, half, section.pitch / 2), (n.below, n.beside, n.above))
    xs, ys = np.meshgrid(x, y, indexing="ij")
    return np.column_stack([xs.ravel(), ys.ravel() + camber(xs.ravel(), section)])


def _pieces(places: tuple[float, ...], cells: tuple[int, ...]) -> FloatArray:
    """Return points that divide each piece between two places into its number of cells."""
    starts = [
        np.linspace(a, b, count, endpoint=False)
        for a, b, count in zip(places[:-1], places[1:], cells, strict=True)
    ]
    return np.concatenate([*starts, places[-1:]])
