"""Facts about cells: those within a threshold, the worst ones, a single one, and where it is.

The *measure* of a cell is the metric or number of walls that the view is colored by, or size-skew
where the view is colored by something else. Inverted cells count as below every value: a threshold
from 0 has them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.axis_frame import in_axis_frame
from slideviz.mesh.elements import CELL_NAMES
from slideviz.mesh.model import Assembly, Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.polyhedra import outlines
from slideviz.mesh.quality import INVERTED, Quality, corner_jacobians, lowest, quality
from slideviz.mesh.surfaces import padded
from slideviz.mesh.walls import BADNESS
from slideviz.rbf.closest import ClosestPoints
from slideviz.session.state import StepFrame
from slideviz.terms import (
    CELL_STATES,
    RANKED,
    SIZE_SKEW,
    WALL_VALUES,
    CellState,
    ColorBy,
    field_of,
)

NEAR = 4  # the nearest point of a boundary is looked for in the elements at so many nearest nodes


def coordinates(positions: FloatArray, around: Pair | None) -> tuple[tuple[str, ...], FloatArray]:
    """Return d names and the values (k, d) of coordinates, of Cartesian ``positions`` (k, d).

    They are radius, angle in degrees and height about the axis of ``around``; Cartesian for None.
    """
    dim = positions.shape[1]
    if around is None:
        return tuple("xyz"[:dim]), positions
    at = in_axis_frame(positions, around.axis, around.origin)
    angle = np.degrees(np.arctan2(at[:, 1], at[:, 0]))
    along = [name for name, part in zip("xyz", around.axis, strict=True) if abs(part) > 0]
    names = ("r", "\u03b8 [°]", along[0] if len(along) == 1 else "axial")
    return names[:dim], np.column_stack([np.hypot(at[:, 0], at[:, 1]), angle, at[:, 2]])[:, :dim]


def decimals(values: FloatArray) -> int:
    """Return the decimals that give the largest of some numbers (k,) four significant digits."""
    largest = float(np.abs(values).max(initial=0.0))
    return 0 if not largest > 0 else int(np.clip(3 - np.floor(np.log10(largest)), 0, 12))


def nearest_boundary(
    mesh: Mesh, point: FloatArray, beyond: float = -1.0
) -> tuple[str, float, FloatArray] | None:
    """Return the name of the boundary nearest to a point (d,), its distance and closest point (d,).

    Only boundaries farther than ``beyond`` count; None if there is none.
    """
    best: tuple[str, float, FloatArray] | None = None
    for marker in mesh.markers:
        if len(marker.nodes):
            closest = _closest(mesh, marker, point)
            far = float(np.linalg.norm(closest - point))
            if beyond < far < np.inf and (best is None or far < best[1]):
                best = marker.name, far, closest
    return best


def _closest(mesh: Mesh, marker: Marker, point: FloatArray) -> FloatArray:
    """Return the point (d,) closest to a point (d,) on the elements at a boundary's nearest nodes.

    The boundary has nodes.
    """
    nodes = marker.nodes
    cells = marker.cells
    shifts = mesh.points[nodes] - point
    squares = np.einsum("nd,nd->n", shifts, shifts)
    some = min(NEAR, len(nodes))
    near = nodes[np.argpartition(squares, some - 1)[:some]]
    at = np.flatnonzero(np.isin(cells.connectivity, near))
    elements = np.unique(np.searchsorted(cells.offsets, at, side="right") - 1)
    return ClosestPoints(mesh.points[triangles(cells.take(elements))]).query(point[None])[0]


def triangles(facets: Cells) -> IntArray:
    """Return the triangles (t, 3), as nodes, of a boundary's facets; of a segment its end twice."""
    parts: list[IntArray] = []
    for _, table in facets.by_type.values():
        corners = np.column_stack([table, table[:, -1:]])
        parts += [corners[:, [0, k, k + 1]] for k in range(1, table.shape[1])]
    return np.concatenate(parts)


WORST = 100  # length of the list of the worst cells


@record
class CellInfo:
    """The facts about one cell."""

    cell: int  # its number in the mesh, from 0, as in an SU2 file
    kind: str  # the name of its element type
    state: CellState
    size_skew: float
    size: float
    skew: float  # `size_skew`, `size`, `skew`: its qualities, 0 to 1
    zone: int | None  # its zone, from 1; None where there is only one
    jacobians: FloatArray
    """(k,): its corner Jacobians, an area or volume; negative at folded corners."""
    position: FloatArray  # (d,): the mean of its nodes, in the mesh's length unit


@record
class WorstCells:
    """The worst cells of a frame, worst first."""

    cells: IntArray  # (k,): their numbers in the mesh
    values: FloatArray  # (k,): their measure; 0 for an inverted cell
    inverted: np.ndarray  # (k,): whether each is inverted
    positions: FloatArray  # (k, d): the means of their nodes, in the mesh's length unit
    steps: IntArray
    """(k,): the first frame at which each was worst; 0 is the undeformed mesh, -1 unknown."""
    kinds: tuple[str, ...]  # the names of their element types
    measure: ColorBy  # the quality in ``values``
    known_as: IntArray
    """(k,): the numbers of the cells that users see: those in the file."""
    zones: tuple[int, ...] = ()  # their zones, from 1; () where there is only one

    def __len__(self) -> int:
        return len(self.cells)


def measure(color_by: ColorBy) -> ColorBy:
    """Return ``color_by`` where one end of its values is worse, else size-skew."""
    return color_by if color_by in RANKED else "size-skew"


def badness(what: ColorBy, values: FloatArray) -> FloatArray:
    """Return numbers (m,) that are larger where values of a quantity of `RANKED` are worse."""
    if what in WALL_VALUES:
        return BADNESS[field_of(what)](values)
    return values if RANKED[what].best == "low" else -values


def worst_cells(
    frames: Sequence[StepFrame],
    at: int,
    what: ColorBy,
    count: int = WORST,
    reference: Mesh | Quality | None = None,
) -> WorstCells:
    """Return the worst cells of the frame ``at``, with the frame in which each was worst.

    Inverted cells come first, cells without a value are left out. Only these cells are followed
    through the frames, to save time and memory, and only by the numbers of the quality. Ties are in
    the order of the cells' numbers. ``reference``: see `Session.reference`; by default the mesh of
    the first frame.
    """
    frame = frames[at]
    what = measure(what)
    if frame.extra is not None:
        return _listed(frame, frame.extra, at, count)
    values = frame.values(what, reference or frames[0].mesh)
    copies = frame.quality.copies
    rank = np.where(frame.quality.status == INVERTED, -np.inf, -badness(what, values))
    there = ~np.isnan(values)
    cells = lowest(rank, count, there if copies is None else there & ~copies)
    followed = what in SIZE_SKEW
    history = np.stack([each.values(what)[cells] for each in frames if followed or each is frame])
    numbers = [frame.mesh.cell_number(int(cell)) for cell in cells]
    return WorstCells(
        cells,
        values[cells],
        frame.quality.status[cells] == INVERTED,
        cell_centers(frame.mesh, cells),
        history.argmin(axis=0) if followed else np.full(len(cells), -1),
        tuple(cell_kind(frame.mesh, int(cell)) for cell in cells),
        what,
        np.array(numbers),
        zones_of_cells(frame.mesh, numbers),
    )


def _listed(frame: StepFrame, extra: StepFrame, at: int, count: int) -> WorstCells:
    """Return the worst cells of a large mesh by size-skew: the first of ``extra`` of the frame."""
    assert extra.base is not None
    cells = np.arange(min(count, len(extra.mesh.cells)))
    numbers = extra.mesh.numbering.cells[cells]
    in_memory = frame.mesh.numbering.cells
    place = np.minimum(np.searchsorted(in_memory, numbers), len(in_memory) - 1)
    drawn = in_memory[place] == numbers  # those at the boundary are drawn as parts of it
    before = quality(extra.base, metric=extra.quality.metric).values[cells]
    values = extra.quality.values[cells]
    return WorstCells(
        np.where(drawn, place, len(frame.mesh.cells) + cells),
        values,
        extra.quality.status[cells] == INVERTED,
        cell_centers(extra.mesh, cells),
        np.where(before <= values, 0, at),
        tuple(cell_kind(extra.mesh, int(cell)) for cell in cells),
        "size-skew",
        numbers,
        zones_of_cells(frame.mesh, numbers),
    )


def zones_of_cells(mesh: Mesh, numbers: IntArray | Sequence[int]) -> tuple[int, ...]:
    """Return the zones, from 1, of cells with ``numbers`` (k,) in the file; () for only one."""
    if not isinstance(mesh, Assembly):
        return ()
    first = [part.first_cell for part in mesh.parts]
    return tuple(np.searchsorted(first, numbers, side="right").tolist())


def cell_kind(mesh: Mesh, cell: int) -> str:
    """Return the name of the type of a cell, of a part that of its polyhedron."""
    return CELL_NAMES[int(mesh.file_types[mesh.file_cells(np.array(cell))])]


def cell_centers(mesh: Mesh, cells: IntArray) -> FloatArray:
    """Return the mean (k, d) of the nodes of each of ``cells`` (k,)."""
    return np.array([mesh.points[nodes_of(mesh, int(cell))].mean(axis=0) for cell in cells])


def nodes_of(mesh: Mesh, cell: int) -> IntArray:
    """Return the nodes of a cell, (k,); of a part, those of its polyhedron, in 2D in order."""
    parts = _parts(mesh, cell)
    offsets = mesh.cells.offsets[parts.start : parts.stop + 1]
    nodes = mesh.cells.connectivity[offsets[0] : offsets[-1]]
    if mesh.dim == 3:
        return nodes if len(parts) == 1 else np.unique(nodes)
    return outlines(offsets - offsets[0], nodes, np.zeros(len(parts), int))[1]


def _parts(mesh: Mesh, cell: int) -> range:
    """Return the parts of the polyhedron that a cell is a part of; of others, itself."""
    whole = mesh.whole_cells
    if whole is None:
        return range(cell, cell + 1)
    begin, end = np.searchsorted(whole, whole[cell : cell + 1] + np.arange(2)).tolist()
    return range(begin, end)


def surroundings(mesh: Mesh, cell: int) -> tuple[FloatArray, float]:
    """Return the middle (3,) of a cell, and the diagonal of its bounding box as its size."""
    points = padded(mesh.points[nodes_of(mesh, cell)])
    return points.mean(axis=0), float(np.linalg.norm(np.ptp(points, axis=0)))


def cell_info(frame: StepFrame, cell: int) -> CellInfo:
    """Return the facts about a cell; raises MeshError if there is no such cell."""
    zoned = frame.mesh
    frame, cell = frame.place_of(cell)
    mesh = frame.mesh
    found = frame.quality
    signs = found.signs.take(_parts(mesh, cell), mode="clip").tolist()
    each = zip(_parts(mesh, cell), signs, strict=True)
    jacobians = [corner_jacobians(mesh, part, sign) for part, sign in each]
    status = found.status[cell]
    zones = zones_of_cells(zoned, [mesh.cell_number(cell)])
    return CellInfo(
        mesh.cell_number(cell),
        cell_kind(mesh, cell)
        + (" of the halo" if found.halo is not None and found.halo[cell] else ""),
        CELL_STATES[status],
        float(found.values[cell]),
        float(found.size[cell]),
        float(found.skew[cell]),
        zones[0] if zones else None,
        np.concatenate(jacobians),
        mesh.points[nodes_of(mesh, cell)].mean(axis=0),
    )


def cell_at(mesh: Mesh, x: float, y: float, values: FloatArray) -> int | None:
    """Return the number of the cell of a 2D mesh around a point, or None.

    Of several cells around it, that with the lowest of ``values`` (m,) is returned; nan is ignored.
    """
    at = mesh.points[mesh.cells.connectivity]
    first = mesh.cells.offsets[:-1]
    low = np.minimum.reduceat(at, first)
    high = np.maximum.reduceat(at, first)
    here = np.array([x, y])
    near = ((low <= here) & (here <= high)).all(axis=1) & ~np.isnan(values)
    inside = [cell for cell in np.flatnonzero(near) if _inside(mesh, int(cell), x, y)]
    best = sorted(inside, key=lambda cell: values[cell])[:1]
    return int(mesh.first_parts(np.array(best))[0]) if best else None


def _inside(mesh: Mesh, cell: int, x: float, y: float) -> bool:
    """Return whether a point is inside a cell of a 2D mesh, by the even-odd rule."""
    a = mesh.points[nodes_of(mesh, cell)]
    b = np.roll(a, -1, axis=0)
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    a = a[crosses]
    b = b[crosses]
    at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return int((at > x).sum()) % 2 == 1


def table_rows(worst: WorstCells) -> list[list[str]]:
    """Return the worst cells as rows of texts, numbers with all digits, below their titles."""
    names = "xyz"[: worst.positions.shape[1]]
    measured = worst.measure.replace("-", "_")
    zoned = ["zone"] if worst.zones else []
    rows = [["cell", *zoned, "type", measured, "inverted", *names, "worst_at_step"]]
    for at, cell in enumerate(worst.known_as):
        numbers = (worst.values[at], *worst.positions[at])
        texts = [repr(float(number)) for number in numbers]
        state = "yes" if worst.inverted[at] else "no"
        since = "" if worst.steps[at] < 0 else str(worst.steps[at])
        zone = [str(number) for number in worst.zones[at : at + 1]]
        rows.append([str(cell), *zone, worst.kinds[at], texts[0], state, *texts[1:], since])
    return rows
