"""The sample ``stator``: a passage of an annular turbine stator (in the manner of thesis 4.2.3).

The grid of ``passage``, an O-grid in a channel, is smoothed at three radii in the plane of z
and r theta; between them z and theta are quadratic in r. The annulus has the dimensions of the
thesis's Aachen stator; its blade is our own. A fine grid is interpolated from a smoothed coarse one
(`refined`) and smoothed, the finest are not smoothed again. Nodes and cells are
computed from these planes by their numbers, so that any part of a mesh can be made without the
rest. The displacement moves the blade as an optimiser might: twist, lean and bumps
(`reshaped`).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise, product
from typing import ClassVar

import numpy as np
from scipy.interpolate import RectBivariateSpline

from slideviz.argument_types import record
from slideviz.case.displacement import Displacements
from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker
from slideviz.samples.passage import (
    BladeSection,
    Grid,
    Shares,
    blade_nodes,
    camber,
    counts,
    layer_parts,
    make_grid,
    smoothed,
    straight_points,
)
from slideviz.samples.thesis import LARGEST, QUADRILATERAL

TWIST_DEG = -8.0  # rotation about the stacking line at the shroud; 0 at the hub
LEAN_DEG = -3.0
"""Shift in theta at the shroud, which moves the blade out of its old passage; 0 at the hub."""
BUMPS = 40  # their number
SEED = 41  # of their random places, widths and heights
HEIGHT = 6e-4
WIDTH = (3e-3, 9e-3)
"""Greatest height of a bump, and its least and greatest radius, in the mesh's length unit."""


def reshaped(points: FloatArray, radii: tuple[float, float], stack_z: float) -> FloatArray:
    """Return displacements (k, 3) of blade nodes that keep their distance from the axis.

    ``points`` (k, 3): nodes of the blade; the axis is z. ``radii`` (float, float): radii of hub and
    shroud. ``stack_z``: z of the stacking line, which has theta = 0.
    """
    r = np.hypot(points[:, 0], points[:, 1])
    theta = np.arctan2(points[:, 1], points[:, 0])
    z = points[:, 2]
    arc = r * theta
    span = (r - radii[0]) / (radii[1] - radii[0])
    twist = np.radians(TWIST_DEG) * span**2
    away = z - stack_z
    moved_z = stack_z + np.cos(twist) * away - np.sin(twist) * arc
    moved_arc = np.sin(twist) * away + np.cos(twist) * arc
    moved_arc += r * np.radians(LEAN_DEG) * np.sin(np.pi / 2 * span) + _bumps(points)
    angle = moved_arc / r
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), moved_z]) - points


def _bumps(points: FloatArray) -> FloatArray:
    """Return the sum (k,) at points (k, 3) of Gaussian bumps along theta, placed randomly."""
    random = np.random.default_rng(SEED)
    low = points.min(axis=0)
    high = points.max(axis=0)
    total = np.zeros(len(points))
    for _ in range(BUMPS):
        centre = random.uniform(low, high)
        width = random.uniform(*WIDTH)
        height = random.uniform(-HEIGHT, HEIGHT)
        near = np.sum((points - centre) ** 2, axis=1) / width**2
        total += height * np.exp(-near)
    return total


def refined(coarse: Grid, points: FloatArray, fine: Grid, section: BladeSection) -> FloatArray:
    """Return the nodes (m, 2) of the fine grid, interpolated from ``points`` of the coarse one.

    Nodes of the blade are moved onto it, those of the O-grid with them, less the further out.
    """
    nodes = np.full((int(fine.quads.max()) + 1, 2), np.nan)
    for old, new in zip(_channel_blocks(coarse), _channel_blocks(fine), strict=True):
        nodes[new] = _spline(points[old], new.shape)
    for old, new in zip(_ring_sides(coarse), _ring_sides(fine), strict=True):
        nodes[new[:-1]] = _spline(points[old], new.shape)[:-1]
    blade = blade_nodes(fine.n.lower, fine.ring.shape[1] - fine.n.lower, section)
    fade = 1 - layer_parts(fine.n)[:-1, None, None]
    nodes[fine.ring[:-1]] += fade * (blade - nodes[fine.ring[0]])
    return nodes


def _channel_blocks(grid: Grid) -> Iterator[IntArray]:
    """Yield the nodes of each block of the channel around the hole."""
    n = grid.n
    along = pairwise(np.cumsum([0, n.ahead, n.along, n.behind]).tolist())
    beside = pairwise(np.cumsum([0, n.below, n.beside, n.above]).tolist())
    for k, ((left, right), (low, high)) in enumerate(product(along, beside)):
        if k != 4:  # the hole
            yield grid.number[left : right + 1, low : high + 1]


def _ring_sides(grid: Grid) -> Iterator[IntArray]:
    """Yield the nodes of the O-grid at each side of the hole, both corners among them."""
    n = grid.n
    corners = n.nose + np.cumsum([0, n.along, n.beside, n.along, n.beside])
    for start, stop in pairwise(corners.tolist()):
        yield np.roll(grid.ring, -start, axis=1)[:, : stop - start + 1]


def _spline(block: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    x = np.linspace(0, 1, block.shape[0])
    y = np.linspace(0, 1, block.shape[1])
    new_x = np.linspace(0, 1, shape[0])
    new_y = np.linspace(0, 1, shape[1])
    kx = min(3, len(x) - 1)
    ky = min(3, len(y) - 1)
    columns = [
        RectBivariateSpline(x, y, block[..., k], kx=kx, ky=ky)(new_x, new_y) for k in range(2)
    ]
    return np.stack(columns, axis=2)


SIZES = (5_000, 5_000_000)  # least and largest number of cells of a mesh in memory
BLADES = 41  # number of blades on the circumference (thesis Table 4.13)
RADII = (0.25, 0.275, 0.3)  # radii of hub, middle and shroud (thesis Table 4.13)
DEPTH = 0.1143  # extent of the mesh in z (thesis Table 4.13)
LEADING_EDGE = 0.035  # its z
CHORD = 0.045  # extent of the blade in z
STACK = 0.4
"""Place of the stacking line, which all sections have at theta = 0, as a part of the chord."""
ANGLES_DEG = ((4.0, -47.0), (7.0, -50.0), (10.0, -53.0))
"""`BladeSection.angles_deg` at hub, middle and shroud: a twisted blade."""
THICKNESS = (0.08, 0.17, 1.4)  # `BladeSection.thickness` at all radii
HOLE = (-0.12, 1.12, 0.16)  # `BladeSection.hole` at all radii
SHARES = Shares(ahead=26, along=50, behind=25, nose=0.5, tail=0.15)  # relative numbers of cells
COARSE = 24  # most cells along the inflow of a grid that is smoothed from straight lines
FINEST = 126  # most cells along the inflow of a grid that is smoothed
SPLINED = 48
"""Cells along the inflow of the smoothed grid that finer ones than FINEST are interpolated from."""
RADIAL = 0.62  # number of cells in r, divided by that along the inflow
ROUGH = 1e-3  # tolerance of `smooth` for interpolated grids, in chords


def stator(size: int, streams: bool) -> tuple[Stack, Displacements]:
    """Return a stator of about ``size`` hexahedra, and the displacement of its blade.

    Raises CaseError if ``size`` is out of range; a mesh that ``streams`` to its file may be larger.
    """
    most = LARGEST if streams else SIZES[1]
    if not SIZES[0] <= size <= most:
        rule = f"size {size} is out of range; a stator has {SIZES[0]} to {most}"
        if not streams:
            rule += f", or up to {LARGEST} as an SU2 binary mesh"
            rule += " (slideviz sample stator --format su2b)"
        raise CaseError(rule)
    stack = stator_stack(size)
    nodes = stack.markers()[0].nodes
    return stack, stator_displacement(nodes, stack.points(nodes))


@record
class Stack:
    """A `Structured` grid of smoothed grids at three radii, stacked between hub and shroud."""

    grid: Grid  # node numbers of a plane
    planes: FloatArray  # (3, m, 2): z and theta of the nodes at ``RADII``
    layers: int  # number of cells in r
    dim: ClassVar[int] = 3

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""
        return self.planes.shape[1] * (self.layers + 1)

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""
        return len(self.grid.quads) * self.layers

    def points(self, nodes: IntArray) -> FloatArray:
        """Return the coordinates (k, 3) of nodes (k,), which are numbered from hub to shroud.

        Layers at hub and shroud have about a third of the height of those in the middle.
        """
        layer, column, part = self.places(nodes)
        radius = (RADII[0] + (RADII[-1] - RADII[0]) * part)[layer]
        shares = (2 * (part - 0.5) * (part - 1), 4 * part * (1 - part), 2 * part * (part - 0.5))
        each = zip(shares, self.planes, strict=True)
        z, theta = np.sum([share[layer] * plane[column].T for share, plane in each], axis=0)
        return np.stack([radius * np.cos(theta), radius * np.sin(theta), z], axis=1)

    def places(self, nodes: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return layer and place in its plane (k,) of nodes (k,), and the spans of all layers."""
        layer, column = np.divmod(nodes, self.planes.shape[1])
        part = np.linspace(0.0, 1.0, self.layers + 1)
        return layer, column, part - np.sin(2 * np.pi * part) / (4 * np.pi)

    def cells(self, ids: IntArray) -> IntArray:
        """Return the nodes (k, 8) of cells (k,)."""
        layer, place = np.divmod(ids, len(self.grid.quads))
        nodes = self.planes.shape[1]
        shroud = self._shroud[place] + (nodes * layer)[:, None]
        return np.concatenate([shroud, shroud + nodes], axis=1)

    @property
    def _shroud(self) -> IntArray:
        """Return the cells (q, 4) of a plane, counter-clockwise as seen from outside the shroud."""
        return self.grid.quads[:, ::-1]

    def markers(self) -> tuple[Marker, ...]:
        """Return the boundaries, the blade first."""
        nodes = self.planes.shape[1]
        walls = {"HUB": self.grid.quads, "SHROUD": self._shroud + self.layers * nodes}
        for name, (low, high) in _sides(self.grid).items():
            strip = np.column_stack([low, high, high + nodes, low + nodes])
            walls[name] = _repeated(strip, nodes, self.layers)
        names = ("BLADE", "HUB", "SHROUD", "INFLOW", "OUTFLOW", "PER1", "PER2")
        return tuple(Marker(n, Cells.from_blocks([(QUADRILATERAL, walls[n])])) for n in names)


def stator_stack(size: int) -> Stack:
    """Return the stack of about ``size`` hexahedra; grids are smoothed, which may take long."""
    grid, layers = _grid_of(size)
    sections = zip(RADII, ANGLES_DEG, strict=True)
    return Stack(
        grid, np.stack([_plane(grid, radius, angles) for radius, angles in sections]), layers
    )


def stator_displacement(nodes: IntArray, points: FloatArray) -> Displacements:
    """Return the displacement (twist, lean, bumps) of the blade's nodes (k,), at points (k, 3)."""
    stack_z = LEADING_EDGE + STACK * CHORD
    return Displacements(nodes, reshaped(points, (RADII[0], RADII[-1]), stack_z))


def _sides(grid: Grid) -> dict[str, tuple[IntArray, IntArray]]:
    """Return first and second node (k,), (k,) of the edges on the sides of a plane, by marker."""
    names = {"blade": "BLADE", "inflow": "INFLOW", "outflow": "OUTFLOW"}
    names |= {"periodic_1": "PER1", "periodic_2": "PER2"}
    return {names[side]: (edges[:, 0], edges[:, 1]) for side, edges in grid.sides().items()}


def _grid_of(size: int) -> tuple[Grid, int]:
    along = next(n for n in range(12, 1000) if _cells(n) * RADIAL * (n + 0.5) > size)
    grid = make_grid(counts(along, SHARES))
    return grid, max(round(size / len(grid.quads)), 1)


def _cells(along: int) -> int:
    n = counts(along, SHARES)
    channel = (n.ahead + n.along + n.behind) * along - n.along * n.beside
    return channel + 2 * n.layers * (n.along + n.beside)


def _plane(grid: Grid, radius: float, angles_deg: tuple[float, float]) -> FloatArray:
    """Return z and theta (m, 2) of a smoothed cylinder grid; angles as of `BladeSection`."""
    pitch = 2 * np.pi * radius / BLADES / CHORD
    ends = (-LEADING_EDGE / CHORD, (DEPTH - LEADING_EDGE) / CHORD)
    section = BladeSection(angles_deg, THICKNESS, pitch, ends, HOLE)
    along = grid.n.below + grid.n.beside + grid.n.above
    if along <= COARSE:
        points = smoothed(grid, straight_points(grid, section))
    else:
        coarse = make_grid(counts(COARSE, SHARES))
        start = smoothed(coarse, straight_points(coarse, section))
        middle = grid if along <= FINEST else make_grid(counts(SPLINED, SHARES))
        points = smoothed(middle, refined(coarse, start, middle, section), ROUGH)
        if middle is not grid:
            points = refined(middle, points, grid, section)
    height = points[:, 1] - camber(np.array([STACK]), section)
    return np.column_stack([LEADING_EDGE + CHORD * points[:, 0], CHORD * height / radius])


def _repeated(cells: IntArray, nodes: int, layers: int) -> IntArray:
    """Return the elements (k, n) of a layer of ``nodes`` in all layers: (layers * k, n)."""
    shift = nodes * np.arange(layers)[:, None, None]
    return (cells + shift).reshape(-1, cells.shape[1])
