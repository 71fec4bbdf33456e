"""The thesis's square, polar, hexahedral and cylindrical samples (sections 4.1 and 4.2).

All four are one structured grid of n cells in each direction, with the cells of a block in the
middle taken out, and differ only in where its nodes lie. The block moves as in chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, FromFile, Motion, Rotate, Translate
from slideviz.case.motion import displacement_of
from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.terms import Role

DIMENSIONS = {"square": 2, "polar": 2, "hexahedron": 3, "cylindrical": 3}
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
LINE, QUADRILATERAL, HEXAHEDRON = 3, 9, 12
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
    grid = layout(size, DIMENSIONS[name])
    polar = name in ("polar", "cylindrical")
    points = polar_points(grid) if polar else square_points(grid)
    mesh, nodes = grid_mesh(name, grid, points), grid.block_nodes()
    motions = _motions(grid.dim, variant)
    case = Case(
        roles=_roles(mesh),
        motions=motions if variant == "motion" else (FromFile(FILE),),
        sliding="ps",
        periodic="moving",
        periodic_type="rotational" if polar else "translational",
        steps=5 if variant == "translate" else 20,
    )
    if variant == "motion":
        return mesh, case, None
    block = mesh.points[nodes]
    vectors = _polar_shift(block) if polar else displacement_of(motions, block)
    return mesh, case, Displacements(nodes, vectors)


def _roles(mesh: Mesh) -> dict[str, Role]:
    """Return the roles of sliding sides with periodic displacement (Figures 4.6 and 4.17)."""
    roles: dict[str, Role] = dict.fromkeys(mesh.marker_names, "sliding")
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
class Layout:
    """The nodes and cells of an n x n (x n) grid with a block taken out.

    Attributes
    ----------
    n, dim : int
        Cells in each direction; directions.
    start, stop : tuple of int
        The block takes the cells ``start[a]`` to ``stop[a] - 1`` along axis a.
    """

    n: int
    dim: int
    start: tuple[int, ...]
    stop: tuple[int, ...]

    def index(self) -> FloatArray:
        """Return the grid indices of the nodes, first axis fastest: (m, d)."""
        axes = np.meshgrid(*[np.arange(self.n + 1)] * self.dim, indexing="ij")
        every = np.column_stack([axis.ravel(order="F") for axis in axes])
        return every[self._kept()].astype(float)

    def number(self) -> IntArray:
        """Return the node number at each place of the grid, -1 inside the block: (n + 1,) * d."""
        kept = self._kept()
        numbers = np.where(kept, np.cumsum(kept) - 1, -1)
        return numbers.reshape([self.n + 1] * self.dim, order="F")

    def block_nodes(self) -> IntArray:
        """Return the nodes on the surface of the block, sorted: (b,)."""
        box = self.number()[tuple(slice(a, b + 1) for a, b in self._spans())].ravel()
        return np.sort(box[box >= 0])

    def cells(self) -> Cells:
        """Return the quadrilaterals or hexahedra, first axis fastest, without the block."""
        shape = [self.n] * self.dim
        kept = np.ones(shape, bool)
        kept[tuple(slice(a, b) for a, b in self._spans())] = False
        nodes = _corners(self.number())
        return Cells.from_blocks(
            [(QUADRILATERAL if self.dim == 2 else HEXAHEDRON, nodes[kept.ravel(order="F")])]
        )

    def markers(self) -> tuple[Marker, ...]:
        """Return the sides of the domain and, last, the block."""
        number, outer = self.number(), [(0, self.n)] * self.dim
        kind = LINE if self.dim == 2 else QUADRILATERAL
        faces = [_face(number, outer, axis, end) for axis in range(self.dim) for end in (0, 1)]
        # The thesis's files list the long sides of the square's block before its short ones.
        order = (1, 0) if self.dim == 2 else range(self.dim)
        block = [_face(number, self._spans(), axis, end) for axis in order for end in (0, 1)]
        named = [
            Marker(name, Cells.from_blocks([(kind, face)]))
            for name, face in zip(SIDES, faces, strict=False)
        ]
        return (*named, Marker("BLOCK", Cells.from_blocks([(kind, np.concatenate(block))])))

    def _spans(self) -> list[tuple[int, int]]:
        return list(zip(self.start, self.stop, strict=True))

    def _kept(self) -> np.ndarray:
        inside = np.zeros([self.n + 1] * self.dim, bool)
        inside[tuple(slice(a + 1, b) for a, b in self._spans())] = True
        return ~inside.ravel(order="F")


def layout(n: int, dim: int) -> Layout:
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
    lengths = [_centred(BLOCK_LENGTH * n, n)] + [_centred(BLOCK_HEIGHT * n, n)] * (dim - 1)
    start = tuple((n - length) // 2 for length in lengths)
    stop = tuple(a + length for a, length in zip(start, lengths, strict=True))
    return Layout(n, dim, start, stop)


def square_points(grid: Layout) -> FloatArray:
    """Return the nodes of the unit square or cube: (m, d)."""
    return grid.index() / grid.n


def polar_points(grid: Layout) -> FloatArray:
    """Return the nodes of the 30 degree sector, r from 0.2 to 1, z from 0 to 0.8: (m, d)."""
    index = grid.index() / grid.n
    radius, angle = 0.2 + 0.8 * index[:, 0], np.radians(30.0) * index[:, 1]
    flat = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return np.column_stack([flat, 0.8 * index[:, 2:]])


def grid_mesh(name: str, grid: Layout, points: FloatArray) -> Mesh:
    """Return the mesh of a grid whose nodes lie at ``points`` (m, d)."""
    return Mesh(points, grid.cells(), grid.markers(), name=name)


def _centred(length: float, n: int) -> int:
    """Return the whole number nearest to ``length``, at least 1, as even or odd as n."""
    low = int(length) - (int(length) - n) % 2
    nearest = low if length - low <= low + 2 - length else low + 2
    return nearest if nearest >= 1 else nearest + 2


def _face(number: IntArray, spans: list[tuple[int, int]], axis: int, end: int) -> IntArray:
    """Return the elements of one side of a box in the grid, first axis fastest: (k, 2 or 4)."""
    box = number[tuple(slice(a, b + 1) for a, b in spans)]
    return _corners(np.take(box, -end, axis=axis))


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
