"""The sample ``stator``: a passage of an annular turbine stator (in the manner of thesis 4.2.3).

The grid of ``passage``, an O-grid in a channel, is smoothed at three radii in the plane of z
and r theta; between them z and theta are quadratic in r. The annulus has the extents of the
thesis's Aachen stator; its blade is our own. A fine grid is a smoothed coarse one with cubic
splines on each of its blocks; one of more than five million cells is that without further
smoothing. Nodes and cells follow from the planes and the layer alone, so that any part of a mesh
can be made without the rest of it. The variant ``optimise`` moves the blade as an optimiser might:
twist, lean and bumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, FromFile
from slideviz.case.reduction import Reduction
from slideviz.errors import CaseError
from slideviz.mesh.io.su2b.write import ZoneContent
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.samples.blade import BladeSection, Shares, camber, counts
from slideviz.samples.passage import Grid, make_grid, smoothed, straight_points
from slideviz.samples.refined import refined
from slideviz.samples.reshaping import reshaped
from slideviz.samples.structured import LARGEST, QUADRILATERAL, mesh_of, zone_of
from slideviz.samples.thesis import FILE

SIZES = (5_000, 5_000_000)
BLADES = 41
RADII = (0.25, 0.275, 0.3)
DEPTH = 0.1143
"""Blades on the circumference, hub, middle and shroud, and extent in z (thesis Table 4.13)."""
LEADING_EDGE, CHORD = 0.035, 0.045
"""z of the leading edge, and extent of the blade in z."""
STACK = 0.4
"""Part of the chord at which the sections stand above each other."""
ANGLES_DEG = ((4.0, -47.0), (7.0, -50.0), (10.0, -53.0))
"""Of the camber line at hub, middle and shroud: the twist."""
THICKNESS = (0.08, 0.17, 1.4)
HOLE = (-0.12, 1.12, 0.16)
SHARES = Shares(ahead=26, along=50, behind=25, nose=0.5, tail=0.15)
COARSE = 24
"""Cells along the inflow of the finest grid that is smoothed from straight lines."""
FINEST, SPLINED = 126, 48
"""Cells along the inflow of the finest grid that is smoothed, and of the one that the nodes of
finer ones are interpolated from."""
RADIAL = 0.62
"""Cells in r over those along the inflow."""
ROUGH = 1e-3
"""Step of the smoothing of a finer grid at which it ends, in chords."""


def stator_mesh(size: int) -> Mesh:
    """Return the mesh of about ``size`` hexahedra.

    Raises
    ------
    CaseError
        ``size`` is not within ``SIZES``.
    """
    if not SIZES[0] <= size <= SIZES[1]:
        raise CaseError(
            f"size {size} is out of range; a stator has {SIZES[0]} to {SIZES[1]}, or up to "
            f"{LARGEST} as an SU2 binary mesh (slideviz sample stator --format su2b)"
        )
    return mesh_of(stator_stack(size), "stator")


def stator_zone(size: int) -> tuple[ZoneContent, Displacements]:
    """Return what a file of the mesh is written from, block by block, and its displacement.

    Raises
    ------
    CaseError
        ``size`` is below ``SIZES`` or above ``LARGEST``.
    """
    if not SIZES[0] <= size <= LARGEST:
        raise CaseError(f"size {size} is out of range; a stator has {SIZES[0]} to {LARGEST}")
    stack = stator_stack(size)
    zone = zone_of(stack)
    nodes = zone.markers[0].nodes
    return zone, stator_displacement(nodes, stack.points(nodes))


@dataclass(frozen=True, eq=False)
class Stack:
    """The smoothed grids at three radii, and the layers of cells between hub and shroud.

    Attributes
    ----------
    grid : Grid
    planes : (3, m, 2) float64
        z and theta of the nodes at ``RADII``.
    layers : int
    """

    grid: Grid
    planes: FloatArray
    layers: int
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
        """Return the coordinates of nodes (k, 3), which are numbered from hub to shroud.

        Layers are half as high at hub and shroud as in the middle, more or less.
        """
        layer, column = np.divmod(nodes, self.planes.shape[1])
        part = np.linspace(0.0, 1.0, self.layers + 1)
        part = part - np.sin(2 * np.pi * part) / (4 * np.pi)
        radius = (RADII[0] + (RADII[-1] - RADII[0]) * part)[layer]
        shares = (2 * (part - 0.5) * (part - 1), 4 * part * (1 - part), 2 * part * (part - 0.5))
        z, theta = (
            sum(share[layer] * plane[column] for share, plane in zip(shares, planes, strict=True))
            for planes in np.moveaxis(self.planes, 2, 0)
        )
        return np.stack([radius * np.cos(theta), radius * np.sin(theta), z], axis=1)

    def cells(self, ids: IntArray) -> IntArray:
        """Return the nodes of cells (k, 8)."""
        layer, place = np.divmod(ids, len(self.grid.quads))
        nodes = self.planes.shape[1]
        shroud = self._shroud[place] + (nodes * layer)[:, None]
        return np.concatenate([shroud, shroud + nodes], axis=1)

    @property
    def _shroud(self) -> IntArray:
        """Return the cells of a plane, right-handed as seen from outside, where the shroud is."""
        return self.grid.quads[:, ::-1]

    def markers(self) -> tuple[Marker, ...]:
        """Return the boundaries."""
        nodes = self.planes.shape[1]
        walls = {"HUB": self.grid.quads, "SHROUD": self._shroud + self.layers * nodes}
        for name, (low, high) in _sides(self.grid).items():
            strip = np.column_stack([low, high, high + nodes, low + nodes])
            walls[name] = _repeated(strip, nodes, self.layers)
        names = ("BLADE", "HUB", "SHROUD", "INFLOW", "OUTFLOW", "PER1", "PER2")
        return tuple(Marker(n, Cells.from_blocks([(QUADRILATERAL, walls[n])])) for n in names)


def stator_stack(size: int) -> Stack:
    """Return the grids that a mesh of about ``size`` hexahedra is made from."""
    grid, layers = _grid_of(size)
    sections = zip(RADII, ANGLES_DEG, strict=True)
    return Stack(
        grid, np.stack([_plane(grid, radius, angles) for radius, angles in sections]), layers
    )


def stator_case() -> Case:
    """Return the case of thesis section 4.2.3, whose hub and shroud follow the blade."""
    return Case(
        roles={
            "BLADE": "moving",
            "HUB": "internal",
            "SHROUD": "internal",
            "INFLOW": "sliding",
            "OUTFLOW": "sliding",
            "PER1": "periodic",
            "PER2": "periodic",
        },
        motions=(FromFile(FILE),),
        sliding="ps",
        periodic="moving",
        periodic_type="rotational",
        reduction=Reduction(tolerance=1e-5),
    )


def stator_displacement(nodes: IntArray, points: FloatArray) -> Displacements:
    """Return the displacement of nodes (k,) of the blade at points (k, 3): twist, lean, bumps."""
    stack_z = LEADING_EDGE + STACK * CHORD
    return Displacements(nodes, reshaped(points, (RADII[0], RADII[-1]), stack_z))


def _sides(grid: Grid) -> dict[str, tuple[IntArray, IntArray]]:
    """Return the edges' first and second nodes on the sides of a plane, by marker."""
    names = {"blade": "BLADE", "inflow": "INFLOW", "outflow": "OUTFLOW"}
    names |= {"periodic_1": "PER1", "periodic_2": "PER2"}
    return {names[side]: (edges[:, 0], edges[:, 1]) for side, edges in grid.sides().items()}


def _grid_of(size: int) -> tuple[Grid, int]:
    """Return the grid of a plane, and the layers between hub and shroud, for ``size`` cells."""
    along = next(n for n in range(12, 1000) if _cells(n) * RADIAL * (n + 0.5) > size)
    grid = make_grid(counts(along, SHARES))
    return grid, max(round(size / len(grid.quads)), 1)


def _cells(along: int) -> int:
    """Return the cells of a plane with ``along`` cells along the inflow."""
    n = counts(along, SHARES)
    channel = (n.ahead + n.along + n.behind) * along - n.along * n.beside
    return channel + 2 * n.layers * (n.along + n.beside)


def _plane(grid: Grid, radius: float, angles_deg: tuple[float, float]) -> FloatArray:
    """Return z and theta of the smoothed grid on the cylinder of that radius: (m, 2)."""
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
    """Return the cells of the first layer in all layers: (layers * k, n)."""
    shift = nodes * np.arange(layers)[:, None, None]
    return (cells + shift).reshape(-1, cells.shape[1])
