"""The thesis's square, polar, hexahedral and cylindrical samples (sections 4.1 and 4.2).

All four are a structured grid of n cells in each direction, without the cells of a block in the
middle. They differ in dimension and in the coordinates of the nodes. The block moves as in
chapter 4.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import frozen
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import Motion
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.case.moving_nodes import displacement_of
from slideviz.errors import CaseError
from slideviz.formats.table import ZoneContent
from slideviz.mesh.model import CellRows, Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.terms import Role

LINE = 3  # VTK identifiers
QUADRILATERAL = 9
HEXAHEDRON = 12
LARGEST = 200_000_000  # most cells of a mesh that is written block by block


class Structured(Protocol):
    """A grid of quadrilaterals (2D) or hexahedra (3D), parts of which are computed on demand."""

    @property
    def dim(self) -> int:
        """Return 2 or 3."""

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""

    def points(self, nodes: IntArray) -> FloatArray:
        """Return the coordinates (k, d) of nodes (k,)."""

    def cells(self, ids: IntArray) -> IntArray:
        """Return the nodes (k, 4) in 2D, (k, 8) in 3D, of cells (k,)."""

    def markers(self) -> tuple[Marker, ...]:
        """Return the boundaries."""


def mesh_of(grid: Structured, name: str) -> Mesh:
    """Return the whole mesh of a grid."""
    cells = Cells.from_blocks([(_element(grid), grid.cells(np.arange(grid.n_cells)))])
    return Mesh(grid.points(np.arange(grid.n_points)), cells, grid.markers(), name=name)


def zone_of(grid: Structured) -> ZoneContent:
    """Return the zone of a grid to be written block by block; CaseError above ``LARGEST``."""
    if grid.n_cells > LARGEST:
        raise CaseError(f"{grid.n_cells} cells are too many; a sample has {LARGEST} at most")

    def types(i: int, j: int) -> NDArray[np.uint8]:
        return np.full(j - i, _element(grid), np.uint8)

    def cells(i: int, j: int) -> CellRows:
        ids = np.arange(i, j)
        return types(i, j), grid.cells(ids).ravel(), ids

    return ZoneContent(
        dim=grid.dim,
        n_cells=grid.n_cells,
        n_points=grid.n_points,
        cells=cells,
        types=types,
        points=lambda i, j: grid.points(np.arange(i, j)),
        markers=grid.markers(),
    )


def _element(grid: Structured) -> int:
    return QUADRILATERAL if grid.dim == 2 else HEXAHEDRON


# Dimension by sample; the sectors among them; the periodic sides.
DIMENSIONS = {"square": 2, "polar": 2, "hexahedron": 3, "cylindrical": 3}
POLAR = ("polar", "cylindrical")
PERIODIC = ("LOWER", "UPPER")
SHIFT = (-0.2, -0.3, 0.2)
"""Translation of the block, after a rotation by 60 degrees about z (Figures 4.3 and 4.15)."""
TRANSLATION = (-0.35, -0.43)
"""Translation of the block in the test of robustness, in five steps (Figure 4.4)."""
FILE = Path("displacement.txt")  # name of the displacement file of a sample

BLOCK_LENGTH = 0.2
BLOCK_HEIGHT = 0.04
"""Size of the block, as parts of the domain's (thesis Tables 4.1 and 4.9)."""
SIDES = ("LEFT", "RIGHT", "LOWER", "UPPER", "FRONT", "BACK")
"""Markers of the sides: first and last along each axis."""
_RING = ((0, 0), (1, 0), (1, 1), (0, 1))
_CORNERS = {1: ((0,), (1,)), 2: _RING, 3: tuple((*corner, up) for up in (0, 1) for corner in _RING)}
"""Corners of a cell as steps along each axis, in SU2's order, by dimension."""


def thesis_case(name: str, size: int, variant: str) -> tuple[Layout, Case, Displacements | None]:
    """Return grid, case and the displacement file's content, None if ``variant`` is ``motion``.

    ``variant`` is one of ``SAMPLES[name].variants``. Raises CaseError if the size is below 3.
    """
    grid = layout(name, size)
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
        return grid, case, None
    nodes = grid.block_nodes()
    block = grid.points(nodes)
    vectors = _polar_shift(block) if grid.polar else displacement_of(motions, block)
    return grid, case, Displacements(nodes, vectors)


def _roles(markers: tuple[Marker, ...]) -> dict[str, Role]:
    roles: dict[str, Role] = {marker.name: "sliding" for marker in markers}
    return roles | dict.fromkeys(PERIODIC, "periodic") | {"BLOCK": "moving"}


def _motions(dim: int, variant: str) -> tuple[Motion, ...]:
    if variant == "translate":
        return (Translate("BLOCK", TRANSLATION),)
    shift = (*SHIFT[:2], 0.0) if variant == "flat" else SHIFT[:dim]
    return (Rotate("BLOCK", 60.0, (0.5,) * dim), Translate("BLOCK", shift))


def _polar_shift(points: FloatArray) -> FloatArray:
    """Return the shift (k, d) by 0.2 in r, -10 degrees, 0.2 in z, which no motions describe."""
    x, y = points[:, :2].T
    radius = np.hypot(x, y) + 0.2
    angle = np.arctan2(y, x) - np.radians(10.0)
    moved = [radius * np.cos(angle) - x, radius * np.sin(angle) - y]
    return np.column_stack([*moved, np.full((len(x), points.shape[1] - 2), 0.2)])


@frozen
class HollowGrid:
    """Numbers of the places of a grid, m in each direction, without those in a box.

    The *linear index* of a place counts all places, the first axis fastest; its *number* only those
    outside the box, in the same order.
    """

    m: int  # places in each direction
    start: tuple[int, ...]
    stop: tuple[int, ...]
    """`start`, `stop`: the box has the places ``start[a]`` to ``stop[a] - 1`` along axis a."""

    @property
    def size(self) -> int:
        """Return the number of places outside the box."""
        return int(self.m ** len(self.start)) - len(self._gaps) * self._length

    def number(self, linear: IntArray) -> IntArray:
        """Return the numbers of places with linear indices of any shape; -1 in the box."""
        before = np.searchsorted(self._gaps, linear, side="right")
        ends = np.concatenate([[0], self._gaps + self._length])
        return np.where(linear < ends[before], -1, linear - before * self._length)

    def linear(self, numbers: IntArray) -> IntArray:
        """Return the linear indices (k,) of places with ``numbers`` (k,)."""
        shift = self._gaps - np.arange(len(self._gaps)) * self._length
        return numbers + np.searchsorted(shift, numbers, side="right") * self._length

    @property
    def _length(self) -> int:
        """Return how many places the box has along the first axis."""
        return max(self.stop[0] - self.start[0], 0)

    @cached_property
    def _gaps(self) -> IntArray:
        """Return the linear indices (b,), ascending, of the first place of each row of the box."""
        first = np.array([self.start[0]])
        for axis in range(1, len(self.start)):
            steps = np.arange(self.start[axis], self.stop[axis]) * self.m**axis
            first = (steps[:, None] + first).ravel()
        return first if self._length else first[:0]


@frozen
class Layout:
    """A `Structured` grid of n x n (x n) cells, without those of a block."""

    n: int
    dim: int  # `n`, `dim`: cells in each direction; dimension
    start: tuple[int, ...]
    stop: tuple[int, ...]
    """`start`, `stop`: the block has the cells ``start[a]`` to ``stop[a] - 1`` along axis a."""
    polar: bool  # whether it is a sector of 30 degrees instead of a square or a cube

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""
        return self._nodes.size

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""
        return self._cells.size

    def points(self, nodes: IntArray) -> FloatArray:
        """Return the coordinates (k, d) of nodes (k,).

        Square and cube have side 1; the sector has r from 0.2 to 1 and z from 0 to 0.8.
        """
        parts = _places(self._nodes.linear(nodes), self.n + 1, self.dim) / self.n
        if not self.polar:
            return parts
        radius = 0.2 + 0.8 * parts[:, 0]
        angle = np.radians(30.0) * parts[:, 1]
        flat = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        return np.column_stack([flat, 0.8 * parts[:, 2:]])

    def cells(self, ids: IntArray) -> IntArray:
        """Return the nodes (k, 4 or 8) of cells (k,), numbered with the first axis fastest."""
        first = _places(self._cells.linear(ids), self.n, self.dim) @ self._strides
        steps: IntArray = np.array(_CORNERS[self.dim])
        return self._nodes.number(first[:, None] + steps @ self._strides)

    def block_nodes(self) -> IntArray:
        """Return the nodes (b,) on the surface of the block, ascending."""
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
        return HollowGrid(self.n + 1, tuple(a + 1 for a in self.start), self.stop)

    @cached_property
    def _cells(self) -> HollowGrid:
        return HollowGrid(self.n, self.start, self.stop)

    @property
    def _strides(self) -> IntArray:
        """Return the step (d,) of a node's linear index along each axis."""
        return (self.n + 1) ** np.arange(self.dim)

    def _spans(self) -> list[tuple[int, int]]:
        """Return first and last node place of the block along each axis."""
        return list(zip(self.start, self.stop, strict=True))

    def _grid(self, spans: list[tuple[int, int]]) -> IntArray:
        """Return node numbers (i, j[, k]) of a box of places, ends included; -1 in the block."""
        axes = np.meshgrid(*[np.arange(a, b + 1) for a, b in spans], indexing="ij")
        places: IntArray = np.stack(axes, axis=-1)
        return self._nodes.number(places @ self._strides)

    def _face(self, spans: list[tuple[int, int]], axis: int, end: int) -> IntArray:
        """Return the elements (k, 2 or 4) of one side of a box, first or last across an axis."""
        at = spans[axis][end]
        side = [*spans[:axis], (at, at), *spans[axis + 1 :]]
        return _corners(self._grid(side).squeeze(axis))


def layout(name: str, n: int) -> Layout:
    """Return the grid of a sample with n cells in each direction, the block in its middle.

    The block is 0.2 n cells long and 0.04 n wide, as in the thesis for 25 and 200; for another n
    it has the nearest numbers of cells, at least one, with which it can be in the middle. Raises
    CaseError if n is below 3, so that the block would touch the sides.
    """
    if n < 3:
        raise CaseError(f"size {n} leaves no room for the block; expected 3 cells or more")
    dim = DIMENSIONS[name]
    lengths = [_centred(BLOCK_LENGTH * n, n)] + [_centred(BLOCK_HEIGHT * n, n)] * (dim - 1)
    start = tuple((n - length) // 2 for length in lengths)
    stop = tuple(a + length for a, length in zip(start, lengths, strict=True))
    return Layout(n, dim, start, stop, polar=name in POLAR)


def _places(linear: IntArray, m: int, dim: int) -> IntArray:
    """Return the indices (k, d) along each axis of places with linear indices (k,), m in each."""
    return np.column_stack([linear // m**axis % m for axis in range(dim)])


def _centred(length: float, n: int) -> int:
    """Return the whole number of the parity of n that is nearest to ``length``, at least 1."""
    low = int(length) - (int(length) - n) % 2
    nearest = low if length - low <= low + 2 - length else low + 2
    return nearest if nearest >= 1 else nearest + 2


def _corners(number: IntArray) -> IntArray:
    """Return the nodes (m, 2^d) of each line, quadrilateral or hexahedron of a grid of nodes."""
    parts = [
        number[
            tuple(
                slice(step, size - 1 + step) for step, size in zip(steps, number.shape, strict=True)
            )
        ]
        for steps in _CORNERS[number.ndim]
    ]
    return np.column_stack([part.ravel(order="F") for part in parts])
