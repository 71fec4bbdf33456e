"""The cuts of sections through the frame that is shown: made once, and shared by all views.

Of a mesh too large for memory, only the cells that a section cuts (a slab) are read. The cells are
divided into groups in the order of the file. When the first section is cut, the whole file is read
to find a bounding ball of each group. After that, only the groups are read whose balls the section
meets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.argument_types import record
from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh, Skin, row_norms
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import Quality
from slideviz.mesh.surfaces import padded
from slideviz.sections.cut import BESIDE, Cutter, transformed
from slideviz.sections.model import ON_SECTION, Section, Triple
from slideviz.sections.polygons import CellsInRange, Polygons
from slideviz.sections.shape import round_middle, triple
from slideviz.session.large import block_frame
from slideviz.session.motions import machine_pair
from slideviz.session.saving import bound_sections
from slideviz.session.state import Session, StepFrame
from slideviz.streaming.source import CellBlock, FileSource, cut_cells
from slideviz.system.threads import Tick, in_parts
from slideviz.system.weak_cache import WeakCache

GROUP = 4096  # number of cells of a group
MOST = 1 << 18  # most cells that are read at a time
KEPT_SLABS = 8  # most slabs of a frame that are cached


@record
class Groups:
    """Bounding balls of groups of `GROUP` cells, in the order of the file."""

    centres: FloatArray  # (g, 3)
    radii: FloatArray  # (g,)
    scale: float  # the diagonal of the mesh's bounding box

    @classmethod
    def of(cls, source: FileSource, tick: Tick) -> Groups:
        """Return the balls of a deformed mesh; the whole file is read."""
        lows = []
        highs = []
        for block in source.blocks(tick, MOST):
            mesh = block.mesh
            at = mesh.points[mesh.cells.connectivity]
            starts = mesh.cells.offsets[:-1:GROUP]
            lows.append(np.minimum.reduceat(at, starts))
            highs.append(np.maximum.reduceat(at, starts))
        low = np.concatenate(lows)
        high = np.concatenate(highs)
        scale = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        return cls((low + high) / 2.0, row_norms(high - low) / 2.0, scale)

    def met_by(self, section: Section) -> IntArray:
        """Return the numbers (k,) of the groups that a section may cut."""
        # The distance from the section changes at most as much as one moves.
        beside = 1e-9 + 2.0 * BESIDE * section.near
        reach = self.radii * (1.0 + beside) + ON_SECTION * self.scale
        return np.flatnonzero(np.abs(section.distance(self.centres)) <= reach)


_GROUPS = WeakCache()
_SLABS: WeakKeyDictionary[Mesh, dict[Section, StepFrame]] = WeakKeyDictionary()


def cut_key(section: Section) -> Section:
    """Return a section with defaults for all that does not change which cells it cuts."""
    return replace(section, name="", shown=True, flat=False, whole_cells=False)


def slab_of(mesh: Mesh, section: Section) -> StepFrame | None:
    """Return the cached cells that a section cuts in a large mesh; None until they are read."""
    return _SLABS.get(mesh, {}).get(cut_key(section))


def keep_slab(mesh: Mesh, section: Section, slab: StepFrame) -> None:
    """Cache the slab of cells that a section cuts, for `slab_of`."""
    cache = _SLABS.setdefault(mesh, {})
    while len(cache) >= KEPT_SLABS:
        cache.pop(next(iter(cache)))
    cache[cut_key(section)] = slab


def read_slab(
    frame: StepFrame, section: Section, report: Tick, going_on: Callable[[], object]
) -> StepFrame:
    """Return the slab of cells that a section cuts: a frame of its own, with their quality.

    Raises MeshError if a file has changed, and has mistakes, and OSError if it cannot be read.
    """
    skin = frame.mesh
    metric = frame.quality.metric
    assert skin.source is not None
    with ExitStack() as stack:
        source = FileSource.open(stack, (skin.source, skin.zone), moved=frame.file or skin.source)

        def tick(part: float) -> None:
            going_on()
            report(0.8 * part)

        groups = _GROUPS.of(skin, None, lambda: Groups.of(source, tick))

        def blocks() -> Iterator[CellBlock]:
            met = groups.met_by(section)
            begin = 0
            for zone in source.zones:  # whose last group may have fewer cells
                end = begin - (-zone.n_cells // GROUP)
                here = met[(met >= begin) & (met < end)] - begin
                for first, count in _runs(here, zone.n_cells):
                    going_on()
                    yield zone.between(first, count)
                begin = end

        slab = cut_cells(blocks(), section, near=ON_SECTION * groups.scale)
    if len(slab.ids):
        return block_frame(slab, skin, metric)
    mesh = slab.mesh
    values = np.empty(0)
    codes = np.empty(0, np.uint8)
    none = Quality(values, values, values, codes, np.empty(0, np.int8), metric)
    return StepFrame(mesh, none, base=mesh)


def _runs(groups: IntArray, cells: int) -> Iterator[tuple[int, int]]:
    """Yield first cell and number of cells of each run of consecutive groups, of `MOST` cells."""
    most = MOST // GROUP
    breaks = np.flatnonzero(np.diff(groups) != 1) + 1
    for run in np.split(groups, breaks):
        for k in range(0, len(run), most):
            part = run[k : k + most]
            first = int(part[0]) * GROUP
            yield first, min(first + len(part) * GROUP, cells) - first


def cell_points(mesh: Mesh) -> FloatArray:
    """Return the points (u, 3) of the nodes that cells use."""
    nodes = mesh.cells.nodes
    # Mostly cells use all nodes, and nothing has to be copied.
    return padded(mesh.points if len(nodes) == len(mesh.points) else mesh.points[nodes])


def first_section(kind: str, session: Session, pair: Pair | None = None) -> Section:
    """Return a new section of the shape ``kind``, about through the middle of the mesh shown.

    Shapes with an axis get that of the rotational ``pair``, else in 3D that of the case, and in 2D
    a centre in the middle of the moving boundaries. A section of constant span cuts nothing where
    there are no hub and shroud.
    """
    mesh = session.opened_mesh
    case = session.case
    size = SECTION_SHAPES[kind].size
    pair = machine_pair(session) if pair is None else pair  # None, too, of zones that differ
    if pair is not None and pair.kind == "rotational":
        axis = pair.axis
        origin = pair.origin
    elif mesh.dim == 2:
        axis = (0.0, 0.0, 1.0)
        origin = triple(_middle_of_moving(session))
    else:
        axis = case.axis
        origin = case.origin
    at = triple(np.asarray(origin))
    way = triple(np.asarray(axis))
    section = Section.of(kind, at, way, size.usual if size else 0.0)
    section = replace(section, whole_cells=mesh.dim == 2)
    pairs = session.pairs if pair is None else (pair, *session.pairs)
    [section] = bound_sections([section], mesh, case, pairs)
    shown = mesh if session.frame is None else session.frame.mesh
    return section.first(cell_points(shown))


def _middle_of_moving(session: Session) -> FloatArray:
    """Return the centre (3,) of the bounding box of the moving boundaries, or else of the mesh."""
    mesh = session.opened_mesh
    names = [name for name in mesh.marker_names if session.role(name) == "moving"]
    points = padded(mesh.points[mesh.nodes_of(names) if names else mesh.cells.nodes])
    return (points.min(axis=0) + points.max(axis=0)) / 2.0


def position_range(section: Section, points: FloatArray) -> tuple[float, float]:
    """Return the lowest and highest position at which a section goes through points (n, 3)."""
    ends: list[float] = []

    def of_part(part: slice) -> None:
        positions = section.positions(points[part])
        ends.extend((float(positions.min()), float(positions.max())))

    in_parts(of_part, len(points))
    return min(ends), max(ends)


def with_direction(section: Section, direction: Triple, points: FloatArray) -> Section:
    """Return the section with another normal or axis, ``direction``.

    It keeps its position (place or size) if it goes through points (n, 3) there; else it gets one
    through their middle.
    """
    new = replace(section, direction=direction)
    positions = new.positions(points)
    if positions.min() < new.position < positions.max():
        return new
    return new.at_position(round_middle(positions))


NO_POLYGONS = Polygons(np.empty((0, 3)), *(np.zeros(n, np.int64) for n in (1, 0, 0)))  # no polygons
CACHE_SIZE = 24
"""Most cuts that are cached: dragging a section makes many that are not needed again."""


class Cuts:
    """Cuts sections through a mesh, and caches the last cuts.

    So the flat view of a section need not cut again what the 3D view has cut.
    """

    def __init__(self) -> None:
        self._cells: Cells | None = None
        self._cutter: Cutter | None = None
        self._points: FloatArray | None = None
        self._found: dict[tuple[Section, bytes, CellsInRange | None], Polygons] = {}
        self._slabs: dict[tuple[StepFrame, bool], Polygons] = {}

    def cutter(self, mesh: Mesh) -> Cutter:
        """Return the cutter of a mesh; the steps of a deformation share it."""
        if self._cutter is None or self._cells is not mesh.cells:
            self._cells = mesh.cells
            self._cutter = Cutter(mesh)
            self._points = None
        return self._cutter

    def of(
        self,
        mesh: Mesh,
        section: Section,
        matrix: FloatArray | None = None,
        only: CellsInRange | None = None,
    ) -> Polygons:
        """Return the cut of a section through a mesh, which ``matrix`` (4, 4) moves before.

        ``only`` are the cells that are shown at all; None: all of them. Empty for a mesh in its
        file until the cells of the section were read.
        """
        if isinstance(mesh, Skin):
            return self._of_slab(mesh, section, matrix)
        cutter = self.cutter(mesh)
        if self._points is not mesh.points:
            self._points = mesh.points
            self._found.clear()
        one = replace(section, name="", shown=True, flat=False)
        key = one, b"" if matrix is None else matrix.tobytes(), only
        if key not in self._found:
            while len(self._found) >= CACHE_SIZE:
                self._found.pop(next(iter(self._found)))
            points = mesh.points if matrix is None else transformed(mesh.points, matrix)
            self._found[key] = cutter.show(points, section, only)
        return self._found[key]

    def _of_slab(self, mesh: Mesh, section: Section, matrix: FloatArray | None) -> Polygons:
        """Return the cut through a mesh in its file; empty until its cells were read."""
        slab = slab_of(mesh, section)
        if slab is None or matrix is not None or not len(slab.mesh.cells):
            return NO_POLYGONS
        key = slab, section.whole_cells
        if key not in self._slabs:
            while len(self._slabs) >= CACHE_SIZE:
                self._slabs.pop(next(iter(self._slabs)))
            self._slabs[key] = Cutter(slab.mesh).show(slab.mesh.points, section)
        return self._slabs[key]


def cut_frame(frame: StepFrame, section: Section) -> StepFrame:
    """Return the frame in which a section's polygons have their cells.

    That is ``frame`` or, for a mesh in its file, the slab of cells that was read for the section.
    """
    slab = slab_of(frame.mesh, section)
    return frame if slab is None else slab


def is_awaited(mesh: Mesh, section: Section) -> bool:
    """Return whether the cells of a section are still to be read from the mesh's file."""
    return isinstance(mesh, Skin) and slab_of(mesh, section) is None


def can_cut(mesh: Mesh | None, section: Section) -> bool:
    """Return whether a section can cut a mesh at all (see `Section.can_cut`)."""
    return mesh is not None and section.can_cut(mesh.dim)
