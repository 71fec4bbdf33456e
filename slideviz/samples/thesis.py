"""The thesis's square, polar, hexahedral and cylindrical samples (sections 4.1 and 4.2).

All four are one structured grid of n cells in each direction, with the cells of a block in the
middle taken out, and differ only in where its nodes lie. The block moves as in chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, FromFile, Motion, Rotate, Translate
from slideviz.case.motion import displacement_of
from slideviz.errors import CaseError
from slideviz.mesh.io.su2b.write import ZoneContent
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.samples.structured import LINE, QUADRILATERAL, mesh_of, zone_of
from slideviz.terms import Role

DIMENSIONS = {"square": 2, "polar": 2, "hexahedron": 3, "cylindrical": 3}
POLAR = ("polar", "cylindrical")
PERIODIC = ("LOWER", "UPPER")
SHIFT = (-0.2, -0.3, 0.2)
"""Of the block of square and cube, after its turn by 60 degrees about z (Figures 4.3, 4.15)."""
TRANSLATION = (-0.35, -0.43)
"""Of the block in the test of robustness, in five steps (Figure 4.4)."""
FILE = Path("displacement.txt")

BLOCK_LENGTH, BLOCK_HEIGHT = 0.2, 0.04
"""Of the block, as parts of the domain (thesis Tables 4.1 and 4.9)."""
SIDES = ("LEFT", "RIGHT", "LOWER", "UPPER", "FRONT", "BACK")
"""Markers of the first and last layer along each axis."""
_RING = ((0, 0), (1, 0), (1, 1), (0, 1))
_CORNERS = {
    1: ((0,), (1,)),
    2: _RING,
    3: tuple((*corner, up) for up in (0, 1) for corner in _RING),
}
"""Steps from a cell's place in the grid to its corners, in SU2's order."""


def thesis_case(name: str, size: int, variant: str) -> tuple[Mesh, Case, Displacements | None]:
    """Return mesh, case and, unless ``variant`` is ``motion``, the displacement file's content.

    ``variant`` is one of ``SAMPLES[name].variants``.

    Raises
    ------
    CaseError
        The size is below 3.
    """
    grid = layout(name, size)
    return mesh_of(grid, name), *_case(grid, variant)


def thesis_zone(
    name: str, size: int, variant: str
) -> tuple[ZoneContent, Case, Displacements | None]:
    """Return the same, but for the mesh: what its file is written from, block by block.

    Raises
    ------
    CaseError
        The size is below 3, or has too many cells.
    """
    grid = layout(name, size)
    return zone_of(grid), *_case(grid, variant)


def _case(grid: Layout, variant: str) -> tuple[Case, Displacements | None]:
    motions = _motions(grid.dim, variant)
    case = Case(
        roles=_roles(grid.markers()),
        motions=motions if variant == "motion" else (FromFile(FILE),),
        sliding="ps",
        periodic="moving",
        periodic_type="rotational" if grid.polar else "translational",
        steps=5 if variant == "translate" else 20,
    )
    if variant == "motion":
        return case, None
    nodes = grid.block_nodes()
    block = grid.points(nodes)
    vectors = _polar_shift(block) if grid.polar else displacement_of(motions, block)
    return case, Displacements(nodes, vectors)


def _roles(markers: tuple[Marker, ...]) -> dict[str, Role]:
    """Return the roles of sliding sides with periodic displacement (Figures 4.6 and 4.17)."""
    roles: dict[str, Role] = {marker.name: "sliding" for marker in markers}
    return roles | dict.fromkeys(PERIODIC, "periodic") | {"BLOCK": "moving"}


def _motions(dim: int, variant: str) -> tuple[Motion, ...]:
    """Return what moves the block of the square (dim 2) or the cube (dim 3)."""
    if variant == "translate":
        return (Translate("BLOCK", TRANSLATION),)
    shift = (*SHIFT[:2], 0.0) if variant == "flat" else SHIFT[:dim]
    return (Rotate("BLOCK", 60.0, (0.5,) * dim), Translate("BLOCK", shift))


def _polar_shift(points: FloatArray) -> FloatArray:
    """Return the displacement by 0.2 in r, -10 degrees and, in 3D, 0.2 in z: (k, d).

    A shift in r turns its direction with the angle, so no sequence of motions is the same.
    """
    x, y = points[:, :2].T
    radius, angle = np.hypot(x, y) + 0.2, np.arctan2(y, x) - np.radians(10.0)
    moved = [radius * np.cos(angle) - x, radius * np.sin(angle) - y]
    return np.column_stack([*moved, np.full((len(x), points.shape[1] - 2), 0.2)])


@dataclass(frozen=True)
class HollowGrid:
    """The places of a grid, m in each direction, without those in a box; numbered in order.

    The first axis is fastest; ``linear`` counts the places in the box, too.

    Attributes
    ----------
    m : int
    start, stop : tuple of int
        The box takes the places ``start[a]`` to ``stop[a] - 1`` along axis a.
    """

    m: int
    start: tuple[int, ...]
    stop: tuple[int, ...]

    @property
    def size(self) -> int:
        """Return how many places there are outside the box."""
        return int(self.m ** len(self.start)) - len(self._gaps) * self._length

    def number(self, linear: IntArray) -> IntArray:
        """Return the numbers of places by their linear index, -1 in the box."""
        before = np.searchsorted(self._gaps, linear, side="right")
        ends = np.concatenate([[0], self._gaps + self._length])
        return np.where(linear < ends[before], -1, linear - before * self._length)

    def linear(self, numbers: IntArray) -> IntArray:
        """Return the linear indices of numbered places."""
        shift = self._gaps - np.arange(len(self._gaps)) * self._length
        return numbers + np.searchsorted(shift, numbers, side="right") * self._length

    @property
    def _length(self) -> int:
        """Return how many places the box has along the first axis."""
        return max(self.stop[0] - self.start[0], 0)

    @cached_property
    def _gaps(self) -> IntArray:
        """Return the linear index of the first place of each row of the box, rising."""
        first = np.array([self.start[0]])
        for axis in range(1, len(self.start)):
            steps = np.arange(self.start[axis], self.stop[axis]) * self.m**axis
            first = (steps[:, None] + first).ravel()
        return first if self._length else first[:0]


@dataclass(frozen=True)
class Layout:
    """The nodes and cells of an n x n (x n) grid with a block taken out.

    Attributes
    ----------
    n, dim : int
        Cells in each direction; directions.
    start, stop : tuple of int
        The block takes the cells ``start[a]`` to ``stop[a] - 1`` along axis a.
    polar : bool
        Whether it is a sector of 30 degrees instead of a square or a cube.
    """

    n: int
    dim: int
    start: tuple[int, ...]
    stop: tuple[int, ...]
    polar: bool

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""
        return self._nodes.size

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""
        return self._cells.size

    def points(self, nodes: IntArray) -> FloatArray:
        """Return the coordinates of nodes (k, d).

        The sector has r from 0.2 to 1 and z from 0 to 0.8.
        """
        parts = _places(self._nodes.linear(nodes), self.n + 1, self.dim) / self.n
        if not self.polar:
            return parts
        radius, angle = 0.2 + 0.8 * parts[:, 0], np.radians(30.0) * parts[:, 1]
        flat = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        return np.column_stack([flat, 0.8 * parts[:, 2:]])

    def cells(self, ids: IntArray) -> IntArray:
        """Return the nodes of quadrilaterals or hexahedra (k, 4 or 8), first axis fastest."""
        first = _places(self._cells.linear(ids), self.n, self.dim) @ self._strides
        steps: IntArray = np.array(_CORNERS[self.dim])
        return self._nodes.number(first[:, None] + steps @ self._strides)

    def block_nodes(self) -> IntArray:
        """Return the nodes on the surface of the block, sorted: (b,)."""
        box = self._grid(self._spans()).ravel()
        return np.sort(box[box >= 0])

    def markers(self) -> tuple[Marker, ...]:
        """Return the sides of the domain and, last, the block."""
        kind = LINE if self.dim == 2 else QUADRILATERAL
        outer = [(0, self.n)] * self.dim
        faces = [self._face(outer, axis, end) for axis in range(self.dim) for end in (0, 1)]
        # The thesis's files list the long sides of the square's block before its short ones.
        order = (1, 0) if self.dim == 2 else range(self.dim)
        block = [self._face(self._spans(), axis, end) for axis in order for end in (0, 1)]
        named = [
            Marker(name, Cells.from_blocks([(kind, face)]))
            for name, face in zip(SIDES, faces, strict=False)
        ]
        return (*named, Marker("BLOCK", Cells.from_blocks([(kind, np.concatenate(block))])))

    @cached_property
    def _nodes(self) -> HollowGrid:
        """Return the places of nodes: those inside the block are left out."""
        return HollowGrid(self.n + 1, tuple(a + 1 for a in self.start), self.stop)

    @cached_property
    def _cells(self) -> HollowGrid:
        return HollowGrid(self.n, self.start, self.stop)

    @property
    def _strides(self) -> IntArray:
        return (self.n + 1) ** np.arange(self.dim)

    def _spans(self) -> list[tuple[int, int]]:
        return list(zip(self.start, self.stop, strict=True))

    def _grid(self, spans: list[tuple[int, int]]) -> IntArray:
        """Return the node numbers of a box of places, its ends included, -1 inside the block."""
        axes = np.meshgrid(*[np.arange(a, b + 1) for a, b in spans], indexing="ij")
        places: IntArray = np.stack(axes, axis=-1)
        return self._nodes.number(places @ self._strides)

    def _face(self, spans: list[tuple[int, int]], axis: int, end: int) -> IntArray:
        """Return the elements of one side of a box, first axis fastest: (k, 2 or 4)."""
        at = spans[axis][end]
        side = [*spans[:axis], (at, at), *spans[axis + 1 :]]
        return _corners(self._grid(side).squeeze(axis))


def layout(name: str, n: int) -> Layout:
    """Return the grid with the block in its middle.

    The block is 0.2 n cells long and 0.04 n wide, as the thesis has it for 25 and 200; for
    another n it has the nearest numbers of cells, at least one, that leave it in the middle.

    Raises
    ------
    CaseError
        The grid is too small to hold a block that does not touch its sides.
    """
    if n < 3:
        raise CaseError(f"size {n} leaves no room for the block; needed are 3 cells or more")
    dim = DIMENSIONS[name]
    lengths = [_centred(BLOCK_LENGTH * n, n)] + [_centred(BLOCK_HEIGHT * n, n)] * (dim - 1)
    start = tuple((n - length) // 2 for length in lengths)
    stop = tuple(a + length for a, length in zip(start, lengths, strict=True))
    return Layout(n, dim, start, stop, polar=name in POLAR)


def _places(linear: IntArray, m: int, dim: int) -> IntArray:
    """Return the indices along each axis of places in a grid of m in each direction: (k, d)."""
    return np.column_stack([linear // m**axis % m for axis in range(dim)])


def _centred(length: float, n: int) -> int:
    """Return the whole number nearest to ``length``, at least 1, as even or odd as n."""
    low = int(length) - (int(length) - n) % 2
    nearest = low if length - low <= low + 2 - length else low + 2
    return nearest if nearest >= 1 else nearest + 2


def _corners(number: IntArray) -> IntArray:
    """Return the nodes of each line, quadrilateral or hexahedron of a grid: (m, 2^d)."""
    parts = [
        number[
            tuple(
                slice(step, size - 1 + step) for step, size in zip(steps, number.shape, strict=True)
            )
        ]
        for steps in _CORNERS[number.ndim]
    ]
    return np.column_stack([part.ravel(order="F") for part in parts])
