"""The turbine blade of the samples ``passage`` and ``stator``, and the channel around it.

The blade has a parabolic camber line and rounded ends. The channel (H-grid) has a rectangular hole
of cells, which the O-grid around the blade fills. Lengths are in axial chords.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray

NOSE = (0.05, 0.04)
TAIL = (0.07, 0.012)
"""Concentration of nodes at leading and trailing edge: strength, and distance over which it fades.

Both are lengths; `_spread` adds strength x arctan(arc length / distance) to the arc length.
"""


@dataclass(frozen=True)
class BladeSection:
    """The shape of a blade and of the channel around it; its axial chord is 1, from x = 0."""

    angles_deg: tuple[float, float] = (30.0, -50.0)
    """(float, float): angles of the camber line to the x axis, at the leading and at the trailing
    edge."""
    thickness: tuple[float, float, float] = (0.1, 0.2, 1.4)
    """(float, float, float): a, b, c of the half thickness sqrt(x (1 - x)) (a + b (1 - x)^c). The
    root rounds both ends: the radii are (a + b)^2 / 2 in front and a^2 / 2 behind."""
    pitch: float = 0.75
    """Distance of the periodic sides in y."""
    ends: tuple[float, float] = (-0.5, 1.6)
    """(float, float): x of inflow and outflow."""
    hole: tuple[float, float, float] = (-0.1, 1.12, 0.14)
    """(float, float, float): first and last x of the hole that the O-grid fills, before smoothing,
    and its half height about the camber line."""


PASSAGE = BladeSection()
"""The section of the sample ``passage``."""


def camber(x: FloatArray, section: BladeSection = PASSAGE) -> FloatArray:
    """Return y of the camber line at x, continued by its tangents below 0 and above 1."""
    first, last = np.tan(np.radians(section.angles_deg))
    inside = np.clip(x, 0.0, 1.0)
    ahead, behind = np.minimum(x, 0.0), np.maximum(x - 1.0, 0.0)
    return first * (inside + ahead) + (last - first) / 2 * inside**2 + last * behind


def blade_nodes(lower: int, upper: int, section: BladeSection = PASSAGE) -> FloatArray:
    """Return the nodes of the blade counter-clockwise from the leading edge: (lower + upper, 2).

    The pressure side has ``lower`` edges, the suction side ``upper``.
    """
    phi = np.linspace(0.0, np.pi, 20001)
    there = _spread(_surface(phi, -1.0, section), lower)
    back = _spread(_surface(phi, 1.0, section), upper)
    return np.concatenate([there[:-1], back[:0:-1]])


def _surface(phi: FloatArray, side: float, section: BladeSection) -> FloatArray:
    """Return points (m, 2) of one side, at x = (1 - cos phi) / 2 on the camber line.

    ``side`` is -1 for the pressure side, 1 for the suction side.
    """
    x = (1 - np.cos(phi)) / 2
    a, b, c = section.thickness
    half = side * np.sin(phi) / 2 * (a + b * (1 - x) ** c)
    first, last = np.tan(np.radians(section.angles_deg))
    slope = first + (last - first) * x
    normal = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(1.0, slope)[:, None]
    return np.column_stack([x, camber(x, section)]) + half[:, None] * normal


def _spread(curve: FloatArray, edges: int) -> FloatArray:
    """Return ``edges + 1`` points on a fine curve (m, 2), denser at its ends by NOSE and TAIL."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    weight = arc + NOSE[0] * np.arctan(arc / NOSE[1])
    weight -= TAIL[0] * np.arctan((arc[-1] - arc) / TAIL[1])
    at = np.interp(np.linspace(weight[0], weight[-1], edges + 1), weight, arc)
    return np.column_stack([np.interp(at, arc, curve[:, 0]), np.interp(at, arc, curve[:, 1])])


@dataclass(frozen=True)
class Shares:
    """Relative numbers of cells, and how the O-grid is turned in its hole; `counts` scales them."""

    ahead: int = 20
    along: int = 52
    behind: int = 22
    beside: int = 16
    layers: int = 18
    """`ahead`, `along`, `behind`, `beside`, `layers`: as of `GridCounts`, for 36 cells along the
    inflow."""
    nose: float = 0.25
    tail: float = 0.0
    """`nose`, `tail`: where the grid lines from leading and trailing edge end on the first and the
    last side of the hole, as a part of the side's length: 0 is the corner on the pressure side."""


PASSAGE_SHARES = Shares()
"""The shares of the sample ``passage``, with which its cells are nearly orthogonal."""


@dataclass(frozen=True)
class GridCounts:
    """Numbers of cells of the channel and of the O-grid around the blade."""

    ahead: int
    along: int
    behind: int
    """`ahead`, `along`, `behind`: in the channel along x: before, beside and behind the hole."""
    below: int
    beside: int
    above: int
    """`below`, `beside`, `above`: in the channel along y: below, beside and above the hole."""
    layers: int
    """In the O-grid, away from the blade."""
    nose: int
    tail: int
    """`nose`, `tail`: on the first and last side of the hole, from the lower corner to the grid
    line from leading and trailing edge."""

    @property
    def lower(self) -> int:
        """Return the number of cells on the pressure side of the blade."""
        return self.nose + self.along + self.tail


def counts(size: int, shares: Shares = PASSAGE_SHARES) -> GridCounts:
    """Return the numbers of cells for ``size`` cells along the inflow.

    Raises
    ------
    CaseError
        ``size`` is below 12, too few to follow the blade.
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
    """Return the node number at each place (i, j) of the channel along x and y, -1 in the hole."""
    shape = (n.ahead + n.along + n.behind + 1, n.below + n.beside + n.above + 1)
    kept = np.ones(shape, bool)
    kept[n.ahead + 1 : n.ahead + n.along, n.below + 1 : n.below + n.beside] = False
    return np.where(kept, np.cumsum(kept).reshape(shape) - 1, -1)


def channel_points(n: GridCounts, section: BladeSection = PASSAGE) -> FloatArray:
    """Return nodes (m, 2) at all places of the channel, also in the hole, before smoothing.

    Lines in y are straight; those in x follow the camber line.
    """
    first, last, half = section.hole
    x = _pieces((section.ends[0], first, last, section.ends[1]), (n.ahead, n.along, n.behind))
    y = _pieces((-section.pitch / 2, -half, half, section.pitch / 2), (n.below, n.beside, n.above))
    xs, ys = np.meshgrid(x, y, indexing="ij")
    return np.column_stack([xs.ravel(), ys.ravel() + camber(xs.ravel(), section)])


def _pieces(places: tuple[float, ...], cells: tuple[int, ...]) -> FloatArray:
    """Return coordinates (m,) that divide each interval between ``places`` into equal ``cells``."""
    starts = [
        np.linspace(a, b, count, endpoint=False)
        for a, b, count in zip(places[:-1], places[1:], cells, strict=True)
    ]
    return np.concatenate([*starts, places[-1:]])
