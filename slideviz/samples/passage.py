"""The sample ``passage``, one blade of a linear turbine cascade, and grids around blades.

An O-grid lies around the blade, in a rectangular hole of a channel of quadrilaterals (H-grid).
Both are made with straight lines first and then smoothed together; nodes of the periodic sides
move in pairs. The smooth mesh minimises the sum over all cell corners of

    (rho |a|^2 + |b|^2 / rho) / (2 a x b)

where a and b are the edges at the corner, the discrete counterpart of solving Winslow's
equations (S. A. Ivanenko, A. A. Charakhch'yan, "Curvilinear grids of convex quadrilaterals",
USSR Comput. Maths. Math. Phys. 28, 1988). The denominator is a barrier: a cell can never fold. At
boundaries whose nodes slide, the grid lines of the minimum are orthogonal to them. rho, the wanted
ratio |b| / |a|, makes cells thin at the wall.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from slideviz.argument_types import frozen, record
from slideviz.errors import CaseError
from slideviz.mesh.axis_frame import Triple
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh, row_dots

NOSE = (0.05, 0.04)
TAIL = (0.07, 0.012)
"""Concentration of nodes at leading and trailing edge: strength, and distance over which it fades.

Both are lengths; `_spread` adds strength x arctan(arc length / distance) to the arc length.
"""


@frozen
class BladeSection:
    """The shape of a blade and of the channel around it; its axial chord is 1, from x = 0."""

    angles_deg: tuple[float, float] = (30.0, -50.0)
    """(float, float): angles of the camber line to the x axis, at the leading and at the trailing
    edge."""
    thickness: Triple = (0.1, 0.2, 1.4)
    """(float, float, float): a, b, c of the half thickness sqrt(x (1 - x)) (a + b (1 - x)^c). The
    root rounds both ends: the radii are (a + b)^2 / 2 in front and a^2 / 2 behind."""
    pitch: float = 0.75  # distance of the periodic sides in y
    ends: tuple[float, float] = (-0.5, 1.6)  # (float, float): x of inflow and outflow
    hole: Triple = (-0.1, 1.12, 0.14)
    """(float, float, float): first and last x of the hole that the O-grid fills, before smoothing,
    and its half height about the camber line."""


PASSAGE = BladeSection()  # the section of the sample ``passage``


def camber(x: FloatArray, section: BladeSection = PASSAGE) -> FloatArray:
    """Return y of the camber line at x, continued by its tangents below 0 and above 1."""
    first, last = np.tan(np.radians(section.angles_deg))
    inside = np.clip(x, 0.0, 1.0)
    ahead = np.minimum(x, 0.0)
    behind = np.maximum(x - 1.0, 0.0)
    return first * (inside + ahead) + (last - first) / 2 * inside**2 + last * behind


def blade_nodes(lower: int, upper: int, section: BladeSection) -> FloatArray:
    """Return the blade's nodes, counter-clockwise from the leading edge, (lower + upper, 2)."""
    phi = np.linspace(0.0, np.pi, 20001)
    there = _spread(_surface(phi, -1.0, section), lower)
    back = _spread(_surface(phi, 1.0, section), upper)
    return np.concatenate([there[:-1], back[:0:-1]])


def _surface(phi: FloatArray, side: float, section: BladeSection) -> FloatArray:
    """Return points (m, 2) of a side (-1: pressure), x = (1 - cos phi) / 2 on the camber line."""
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


@frozen
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


@frozen
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
    layers: int  # in the O-grid, away from the blade
    nose: int
    tail: int
    """`nose`, `tail`: on the first and last side of the hole, from the lower corner to the grid
    line from leading and trailing edge."""

    @property
    def lower(self) -> int:
        """Return the number of cells on the pressure side of the blade."""
        return self.nose + self.along + self.tail


def counts(size: int, shares: Shares = PASSAGE_SHARES) -> GridCounts:
    """Return the numbers of cells for ``size`` cells along the inflow; CaseError below 12."""
    if size < 12:
        raise CaseError(f"size {size} is too coarse for the blade; expected 12 cells or more")
    ahead = round(size * shares.ahead / 36)
    along = round(size * shares.along / 36)
    behind = round(size * shares.behind / 36)
    beside = round(size * shares.beside / 36)
    layers = round(size * shares.layers / 36)
    below = (size - beside) // 2
    nose = round(beside * shares.nose)
    tail = round(beside * shares.tail)
    above = size - beside - below
    return GridCounts(ahead, along, behind, below, beside, above, layers, nose, tail)


def channel_numbers(n: GridCounts) -> IntArray:
    """Return the node number at each place (i, j) of the channel along x and y, -1 in the hole."""
    shape = (n.ahead + n.along + n.behind + 1, n.below + n.beside + n.above + 1)
    mask = np.ones(shape, bool)
    mask[n.ahead + 1 : n.ahead + n.along, n.below + 1 : n.below + n.beside] = False
    return np.where(mask, np.cumsum(mask).reshape(shape) - 1, -1)


def channel_points(n: GridCounts, section: BladeSection) -> FloatArray:
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


WALL = 0.05  # height of the O-grid's cells at the blade, divided by that of its outermost ones
LINE = 3  # VTK identifiers
QUADRILATERAL = 9

# For edges e = (ax, ay, bx, by): a x b = e S e / 2 with this matrix S.
_CROSS = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], float)
# From the coordinates (x, y) of a corner and its two neighbours to these edges.
_EDGES = np.kron([[-1, 1, 0], [-1, 0, 1]], np.eye(2)) + 0.0  # 0.0 for -0.0


@record
class Grid:
    """The node numbers of O-grid and channel, which do not depend on the shape of the blade."""

    n: GridCounts  # numbers of cells
    number: IntArray  # (i, j) int: node at each place of the channel, -1 inside the hole
    ring: IntArray
    """(layers + 1, k) int: nodes of the O-grid, from the blade out, counter-clockwise; the last are
    the hole's rim."""
    quads: IntArray  # (m, 4) int: nodes of the cells, counter-clockwise

    def sides(self) -> dict[str, IntArray]:
        """Return the edges (k, 2) of blade, inflow, outflow and periodic sides, by name."""
        number = self.number
        return {
            "blade": np.column_stack([self.ring[0], np.roll(self.ring[0], -1)]),
            "inflow": _line(number[0]),
            "outflow": _line(number[-1]),
            "periodic_1": _line(number[:, 0]),
            "periodic_2": _line(number[:, -1]),
        }


def passage_mesh(size: int) -> Mesh:
    """Return the mesh of ``passage``, with ``size`` cells along the inflow; CaseError below 12."""
    grid = make_grid(counts(size))
    points = smoothed(grid, straight_points(grid, PASSAGE))
    sides = {"airfoil" if k == "blade" else k: side for k, side in grid.sides().items()}
    markers = [Marker(name, Cells.from_blocks([(LINE, side)])) for name, side in sides.items()]
    cells = Cells.from_blocks([(QUADRILATERAL, grid.quads)])
    return Mesh(points, cells, tuple(markers), name="passage")


def make_grid(n: GridCounts) -> Grid:
    """Return the grid with these numbers of cells."""
    number = channel_numbers(n)
    ring = _ring(n, number)
    return Grid(n, number, ring, _quads(n, number, ring))


def straight_points(grid: Grid, section: BladeSection) -> FloatArray:
    """Return the nodes (m, 2) of a grid before smoothing; lines from the blade are straight."""
    channel = channel_points(grid.n, section)[grid.number.ravel() >= 0]
    rim = channel[grid.ring[-1]]
    blade = blade_nodes(grid.n.lower, len(rim) - grid.n.lower, section)
    part = layer_parts(grid.n)[:-1, None, None]
    return np.concatenate([channel, (blade + part * (rim - blade)).reshape(-1, 2)])


def smoothed(grid: Grid, points: FloatArray, tolerance: float = 1e-7) -> FloatArray:
    """Return the points (m, 2) of a grid smoothed by `smooth`, with thin cells at the blade.

    Nodes of the blade are fixed, those of the sides as `_unknowns` has them.
    """
    heights = np.diff(layer_parts(grid.n))
    heights /= heights[-1]
    n_channel = len(grid.quads) - grid.ring[1:].size
    rho = np.concatenate([np.ones(n_channel), np.repeat(heights, grid.ring.shape[1])])
    unknown = _unknowns(len(points), grid.number, grid.ring)
    return smooth(points, grid.quads, rho, unknown, tolerance)


def layer_parts(n: GridCounts) -> FloatArray:
    """Return the place (layers + 1,) of O-grid rows, from the blade (0) to the hole's rim (1)."""
    heights = WALL ** (np.arange(n.layers)[::-1] / (n.layers - 1))
    return np.concatenate([[0.0], np.cumsum(heights) / heights.sum()])


def _ring(n: GridCounts, number: IntArray) -> IntArray:
    """Return the O-grid's nodes from the blade out, counter-clockwise from the leading edge."""
    hole = number[n.ahead : n.ahead + n.along + 1, n.below : n.below + n.beside + 1]
    rim = np.concatenate([hole[:-1, 0], hole[-1, :-1], hole[:0:-1, -1], hole[0, :0:-1]])
    rim = np.roll(rim, n.nose)
    inner = number.max() + 1 + np.arange(n.layers * len(rim)).reshape(n.layers, -1)
    return np.concatenate([inner, rim[None]])


def _quads(n: GridCounts, number: IntArray, ring: IntArray) -> IntArray:
    around = np.roll(ring, -1, axis=1)
    channel = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    o_grid = [ring[1:], around[1:], around[:-1], ring[:-1]]
    h_quads = np.column_stack([part.ravel() for part in channel])
    inside = np.zeros([size - 1 for size in number.shape], bool)
    inside[n.ahead : n.ahead + n.along, n.below : n.below + n.beside] = True
    h_quads = h_quads[~inside.ravel()]
    o_quads = np.column_stack([part.ravel() for part in o_grid])
    return np.concatenate([h_quads, o_quads])


def _unknowns(n_points: int, number: IntArray, ring: IntArray) -> IntArray:
    """Return the number (n, 2) of each coordinate's unknown, -1 if fixed (``dof`` of `smooth`).

    The blade is fixed, nodes of inflow and outflow move in y only, and those of the second periodic
    side as those of the first.
    """
    free = np.ones((n_points, 2), bool)
    free[ring[0]] = False
    free[[number[0], number[-1]], 0] = False
    free[number[:, -1]] = False
    unknown = np.where(free, np.cumsum(free).reshape(-1, 2) - 1, -1)
    unknown[number[:, -1]] = unknown[number[:, 0]]
    return unknown


def _line(nodes: IntArray) -> IntArray:
    return np.column_stack([nodes[:-1], nodes[1:]])


def smooth(
    points: FloatArray, quads: IntArray, rho: FloatArray, dof: IntArray, tolerance: float = 1e-7
) -> FloatArray:
    """Return the points (n, 2) that minimise the functional (see above), by Newton's method.

    ``points`` (n, 2): where to start; no cell may be folded.
    ``quads`` (m, 4): nodes of the cells, counter-clockwise.
    ``rho`` (m,): wanted length of a cell's edges 1-2 and 3-0, divided by that of its edges 0-1 and
    2-3.
    ``dof`` (n, 2): number of the unknown that moves each coordinate, -1 where it is fixed.
    Coordinates with the same number move alike.
    ``tolerance``: it ends when a step moves no coordinate by more than this length.
    """
    corners = np.concatenate([np.roll(quads, -k, axis=1)[:, [0, 1, 3]] for k in range(4)])
    ratio = np.concatenate([rho, 1 / rho, rho, 1 / rho])
    unknown = dof[corners].reshape(-1, 6)
    n = int(dof.max()) + 1
    energy = _energy(points[corners], ratio)
    for _ in range(60):
        step = _newton_step(points[corners], ratio, unknown, n)
        shift = np.where(dof >= 0, step[dof], 0.0)
        length = 1.0
        while (lower := _energy((points + length * shift)[corners], ratio)) >= energy:
            length /= 2
            if length < 1e-6:
                return points
        points = points + length * shift
        energy = lower
        if length * np.abs(shift).max() < tolerance:
            break
    return points


def _energy(xyz: FloatArray, ratio: FloatArray) -> float:
    """Return the functional, infinite if a corner is folded.

    ``xyz`` (k, 3, 2) has each corner with its neighbours, ``ratio`` (k,) its rho.
    """
    edges = xyz.reshape(-1, 6) @ _EDGES.T
    cross = np.einsum("ki,ij,kj->k", edges, _CROSS, edges) / 2
    if cross.min() <= 0:
        return float("inf")
    return float(np.sum(_stretch(edges, ratio) / (2 * cross)))


def _stretch(edges: FloatArray, ratio: FloatArray) -> FloatArray:
    """Return the functional's numerator (k,) for edges (k, 4): rho |a|^2 + |b|^2 / rho."""
    a = edges[:, :2]
    b = edges[:, 2:]
    return ratio * row_dots(a, a) + row_dots(b, b) / ratio


def _newton_step(xyz: FloatArray, ratio: FloatArray, unknown: IntArray, n: int) -> FloatArray:
    """Return the Newton step (n,) of all unknowns; negative eigenvalues of Hessians become 0.

    ``unknown`` (k, 6) has the number of the unknown of each coordinate of ``xyz`` (k, 3, 2).
    """
    edges = xyz.reshape(-1, 6) @ _EDGES.T
    scale = np.column_stack([ratio, ratio, 1 / ratio, 1 / ratio])
    num = _stretch(edges, ratio)
    num1 = 2 * scale * edges
    det1 = edges @ _CROSS
    det = row_dots(edges, det1) / 2
    gradient = num1 / (2 * det)[:, None] - det1 * (num / (2 * det**2))[:, None]
    mixed = num1[:, :, None] * det1[:, None, :]
    hessian = (
        scale[:, :, None] * np.eye(4) / det[:, None, None]
        - (mixed + mixed.transpose(0, 2, 1)) / (2 * det**2)[:, None, None]
        - _CROSS * (num / (2 * det**2))[:, None, None]
        + det1[:, :, None] * det1[:, None, :] * (num / det**3)[:, None, None]
    )
    values, vectors = np.linalg.eigh(hessian)
    hessian = (vectors * np.maximum(values, 0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return _solve(_EDGES.T @ hessian @ _EDGES, gradient @ _EDGES, unknown, n)


def _solve(hessian: FloatArray, gradient: FloatArray, unknown: IntArray, n: int) -> FloatArray:
    """Return the step (n,) from the corners' Hessians (k, 6, 6) and gradients (k, 6), summed up."""
    free = unknown >= 0
    right = np.bincount(unknown[free], gradient[free], minlength=n)
    rows, columns = np.broadcast_arrays(unknown[:, :, None], unknown[:, None, :])
    both = free[:, :, None] & free[:, None, :]
    matrix = coo_array((hessian[both], (rows[both], columns[both])), shape=(n, n)).tocsc()
    return -splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).solve(right)
