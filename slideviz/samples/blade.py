"""The turbine blade of ``passage`` and ``stator``, and the channel around it.

The blade has a parabolic camber line and rounded ends; the channel has a hole for the O-grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray

NOSE = (0.05, 0.04)
TAIL = (0.07, 0.012)
"""Part of the nodes drawn to the end, as a length, and the distance over which it fades."""


@dataclass(frozen=True)
class BladeSection:
    """A blade and the channel it stands in. The axial chord is 1, from x = 0.

    Attributes
    ----------
    angles_deg : (float, float)
        Of the camber line against the x axis, at the leading and at the trailing edge.
    thickness : (float, float, float)
        a, b, c of the half thickness sqrt(x (1 - x)) (a + b (1 - x)^c). The root rounds both
        ends: the radii are (a + b)^2 / 2 in front and a^2 / 2 behind.
    pitch : float
        Distance of the periodic sides in y.
    ends : (float, float)
        x of inflow and outflow.
    hole : (float, float, float)
        First and last x of the hole that the O-grid fills, before smoothing, and its half
        height about the camber line.
    """

    angles_deg: tuple[float, float] = (30.0, -50.0)
    thickness: tuple[float, float, float] = (0.1, 0.2, 1.4)
    pitch: float = 0.75
    ends: tuple[float, float] = (-0.5, 1.6)
    hole: tuple[float, float, float] = (-0.1, 1.12, 0.14)


PASSAGE = BladeSection()
"""Of the sample ``passage``."""


def camber(x: FloatArray, section: BladeSection = PASSAGE) -> FloatArray:
    """Return y of the camber line, with its tangents before x = 0 and behind x = 1."""
    first, last = np.tan(np.radians(section.angles_deg))
    inside = np.clip(x, 0.0, 1.0)
    ahead, behind = np.minimum(x, 0.0), np.maximum(x - 1.0, 0.0)
    return first * (inside + ahead) + (last - first) / 2 * inside**2 + last * behind


def blade_nodes(lower: int, upper: int, section: BladeSection = PASSAGE) -> FloatArray:
    """Return the nodes counter-clockwise from the leading edge: (lower + upper, 2).

    ``lower`` edges lead along the pressure side to the trailing edge, ``upper`` back along the
    suction side.
    """
    phi = np.linspace(0.0, np.pi, 20001)
    there = _spread(_surface(phi, -1.0, section), lower)
    back = _spread(_surface(phi, 1.0, section), upper)
    return np.concatenate([there[:-1], back[:0:-1]])


def _surface(phi: FloatArray, side: float, section: BladeSection) -> FloatArray:
    """Return the points of one side at x = (1 - cos phi) / 2: (m, 2)."""
    x = (1 - np.cos(phi)) / 2
    a, b, c = section.thickness
    half = side * np.sin(phi) / 2 * (a + b * (1 - x) ** c)
    first, last = np.tan(np.radians(section.angles_deg))
    slope = first + (last - first) * x
    normal = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(1.0, slope)[:, None]
    return np.column_stack([x, camber(x, section)]) + half[:, None] * normal


def _spread(curve: FloatArray, edges: int) -> FloatArray:
    """Return ``edges`` + 1 points of a fine curve (m, 2), denser at its ends."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    weight = arc + NOSE[0] * np.arctan(arc / NOSE[1])
    weight -= TAIL[0] * np.arctan((arc[-1] - arc) / TAIL[1])
    at = np.interp(np.linspace(weight[0], weight[-1], edges + 1), weight, arc)
    return np.column_stack([np.interp(at, arc, curve[:, 0]), np.interp(at, arc, curve[:, 1])])


@dataclass(frozen=True)
class Shares:
    """Shares of the cells (as for 36 along the inflow), and how the O-grid is turned in its hole.

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
class GridCounts:
    """Numbers of cells of the channel and of the O-grid around the blade.

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


def counts(size: int, shares: Shares = PASSAGE_SHARES) -> GridCounts:
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
    return GridCounts(
        ahead=ahead,
        along=along,
        behind=behind,
        below=below,
        beside=beside,
        above=above,
        layers=layers,
        nose=nose,
        tail=tail,
    )


def channel_numbers(n: GridCounts) -> IntArray:
    """Return the node number at each place of the channel, -1 inside the hole."""
    shape = (n.ahead + n.along + n.behind + 1, n.below + n.beside + n.above + 1)
    kept = np.ones(shape, bool)
    kept[n.ahead + 1 : n.ahead + n.along, n.below + 1 : n.below + n.beside] = False
    return np.where(kept, np.cumsum(kept).reshape(shape) - 1, -1)


def channel_points(n: GridCounts, section: BladeSection = PASSAGE) -> FloatArray:
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
