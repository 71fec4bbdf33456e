"""The quality of all cells of a mesh, measured block by block, whatever its source.

Cells of negative volume are numbered the other way round, or folded. For a mesh in memory,
`mesh.orientation` compares neighbours. A mesh in a file is only proved to have no folded cell: each
facet gets a hash of its nodes, with the sign of the direction in which its cell traverses it, after
cells of negative volume were turned round. Two cells that are numbered alike traverse their common
facet in opposite directions, so their hashes cancel. The sum over all facets that are in no marker
is then 0 (modulo 2**64) where no cell is folded; where one is, it is 0 with a probability of about
2**-63.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import ExitStack, contextmanager
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError, Message
from slideviz.formats.su2b.read import read_markers
from slideviz.mesh.margin import SafeFraction, step_safety
from slideviz.mesh.metrics import MetricValues, rated_metric
from slideviz.mesh.model import BoolArray, Cells, FloatArray, Index, IntArray, Mesh
from slideviz.mesh.orientation import corner_sums, facets_of
from slideviz.mesh.quality import INVERTED, Quality, quality, quality_totals
from slideviz.solver.deform import folded_at
from slideviz.solver.growth import Farthest, farthest_node
from slideviz.streaming.interior import InteriorDisplacer
from slideviz.streaming.skin import index_of
from slideviz.streaming.source import CELLS, CellBlock, FileSource, MeshSource, Scratch, ZoneSource
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, cuts
from slideviz.terms import Metric, SkewMetric

Hashes = NDArray[np.uint64]


def orientations_of(signs: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return which of -1 and 1 occur in ``signs`` (k,): (1,), or both, (2,)."""
    return np.unique([signs.min(), signs.max()])


class QualityCollector:
    """Quality of all cells of a mesh in a file, collected block by block, in scratch files.

    They are in ``folder``, 9 bytes for each cell, and are removed when ``stack`` closes.
    """

    def __init__(self, stack: ExitStack, folder: Path, count: int, metric: SkewMetric) -> None:
        self._metric = metric
        self._files = [Scratch(stack, folder, count, kind) for kind in (float, np.uint8)]
        self._values = self._files[0].array
        self._status = self._files[1].array
        self.signs = np.zeros(0, np.int8)
        """Orientations that occur: 1, -1 (numbered the other way round), or both."""

    def of_cells(self, cells: slice) -> QualityCollector:
        """Return the collector of some of the cells, in the same scratch files."""
        some = copy(self)
        some._values = self._values[cells]
        some._status = self._status[cells]
        return some

    def add(
        self, ids: Index, values: FloatArray, status: NDArray[np.uint8], signs: NDArray[np.int8]
    ) -> None:
        """Add the values, statuses and signs of the cells ``ids`` (k,)."""
        self._values[ids] = values
        self._status[ids] = status
        self.signs = orientations_of(np.concatenate([self.signs, signs]))
        self._release()

    def quality(self, worst: int = 0) -> Quality:
        """Return the quality of all cells, without size and skew; ``worst`` as `quality_totals`."""
        none = np.empty(0)
        totals = quality_totals(self._values, self._status, self._release, worst)
        return Quality(
            self._values, none, none, self._status, self.signs, self._metric, of_mesh=totals
        )

    def _release(self) -> None:
        for file in self._files:
            file.release()


def quality_blocks(
    source: MeshSource, metric: SkewMetric, tick: Tick = lambda _: None, *, may_fold: bool = False
) -> Iterator[CellBlock]:
    """Yield all cells of a mesh with their quality, in the order of the file.

    With ``may_fold``, it is not checked whether cells numbered in both directions are folded.
    Raises MeshError if a file has a mistake, or cells are numbered in both directions and some are
    folded.
    """
    signs = np.zeros(0, np.int8)
    for block in source.blocks(tick):
        measured = quality(block.mesh, block.base, metric)
        if isinstance(source, FileSource) and not may_fold:
            before = len(signs)
            signs = orientations_of(np.concatenate([signs, measured.signs]))
            for zone in source.zones if before < 2 == len(signs) else ():
                remedy = ""
                if zone.base is None:
                    remedy = "compare a deformed mesh with --reference UNDEFORMED, "
                parts = cuts(0, zone.n_cells, CELLS)
                require_consistent_orientation(zone, parts, remedy=remedy)
        yield replace(block, quality=measured)


class CellCounts:
    """Counts the cells of a mesh by their VTK types, and its points that no cell uses."""

    def __init__(self, source: MeshSource) -> None:
        self.points = source.n_points  # how many the mesh has
        self._used = np.zeros(source.n_points, bool)
        self._types = np.zeros(256, np.int64)

    def add(self, block: CellBlock) -> None:
        """Count the cells of a block."""
        self._used[block.nodes[block.mesh.cells.nodes]] = True
        self._types += np.bincount(block.mesh.file_types, minlength=256)

    @property
    def unused(self) -> int:
        """Return the number of points that no cell uses."""
        return int(np.count_nonzero(~self._used))

    @property
    def types(self) -> dict[int, int]:
        """Return the number of cells of each VTK type."""
        return {vtk: int(self._types[vtk]) for vtk in np.flatnonzero(self._types).tolist()}


def measure_mesh(
    stack: ExitStack,
    folder: Path,
    source: MeshSource,
    *,
    metric: SkewMetric = "knupp",
    worst: int = 0,
    counts: CellCounts | None = None,
    may_fold: bool = False,
    tick: Tick = lambda _: None,
    metrics: MutableMapping[Metric, MetricValues | None] | None = None,
) -> Quality:
    """Return the quality of all cells of a mesh.

    Of a mesh in a file it is without size and skew, and its arrays are in scratch files.
    Raises MeshError as `quality_blocks` does, or if there is no disk space for the scratch files.
    ``stack``: removes the scratch files when it closes.
    ``folder``: where they are made, that for temporary files: 9 bytes for each cell.
    ``worst``: as for `quality_totals`.
    ``counts``: counts all cells, too.
    ``may_fold``: as for `quality_blocks`.
    ``metrics``: gets the values of the metrics that are its keys; of a mesh in a file only those
    of single cells (``METRICS[name].alone``) are possible.
    """
    collector: QualityCollector | None = None
    files: dict[Metric, Scratch] = {}
    rated = {} if metrics is None else metrics
    for block in quality_blocks(source, metric, tick, may_fold=may_fold):
        found = block.quality
        assert found is not None
        if isinstance(source, FileSource):
            if collector is None:
                try:
                    collector = QualityCollector(stack, folder, source.n_cells, metric)
                    for name in rated:
                        files[name] = Scratch(stack, folder, source.n_cells, float)
                except MeshError as problem:
                    raise MeshError(f"{problem} (TMPDIR names another folder)") from problem
            collector.add(index_of(block.ids), found.values, found.status, found.signs[:1])
        for name in rated:
            values = rated_metric(block.mesh, name, block.base, found)
            if name in files:
                every = files[name].array
                every[index_of(block.ids)] = values.values
                files[name].release()
                values = MetricValues(name, every, every, slice(None))
            rated[name] = values
        if counts is not None:
            counts.add(block)
    if collector is not None:
        return collector.quality(worst)
    assert found is not None
    return found


@record
class MeasuredBlock:
    """The quality of a block of cells, undeformed and deformed, without its meshes."""

    ids: Index  # (k,) int64 or slice: the numbers of the cells in the whole mesh
    values: FloatArray
    before: FloatArray
    """`values`, `before` (k,): quality of the deformed and of the undeformed cells."""
    status: NDArray[np.uint8]
    old: NDArray[np.uint8]
    """`status`, `old` (k,): status (``Quality.status``) of the deformed and of the undeformed
    cells."""
    signs: NDArray[np.int8]
    """(1,) or (2,) int8: orientations that occur: 1, -1 (numbered the other way round), or both."""
    inverted: dict[int, tuple[int, IntArray]]
    """dict of int to (int, (n,) int64): VTK type and nodes of inverted cells, by their number:
    those with the lowest numbers."""
    farthest: Farthest  # the node with the largest displacement
    safe: list[SafeFraction]  # how far each step may go

    @classmethod
    def of(
        cls,
        block: CellBlock,
        metric: SkewMetric,
        listed: int,
        displacer: InteriorDisplacer | None = None,
    ) -> MeasuredBlock:
        """Return the quality of a block, with the ``listed`` inverted cells of lowest numbers.

        It says how far each step may go if it gets the steps, with ``displacer``.
        """
        base = block.base
        mesh = block.mesh
        assert base is not None
        before = quality(base, metric=metric)
        after = quality(mesh, base, metric)
        ends = mesh.cells.offsets
        inverted = np.flatnonzero(after.status == INVERTED)
        first = inverted[np.argsort(block.ids[inverted])][:listed].tolist()
        nodes = {k: block.nodes[mesh.cells.connectivity[ends[k] : ends[k + 1]]] for k in first}
        return cls(
            index_of(block.ids),
            after.values,
            before.values,
            after.status,
            before.status,
            orientations_of(before.signs),
            {int(block.ids[k]): (int(mesh.cells.types[k]), nodes[k]) for k in first},
            farthest_node(base.points, mesh.points, block.nodes),
            [] if displacer is None else _safe_fractions(block, displacer),
        )


def _safe_fractions(block: CellBlock, displacer: InteriorDisplacer) -> list[SafeFraction]:
    """Return how far each step may go, by the cells of a block."""
    base = block.base
    steps = displacer.steps
    found = []
    assert base is not None
    meshes = [block.mesh]
    if len(steps) > 1:
        moved = displacer.after_steps(block.nodes, base.points)
        meshes = [base.with_points(points) for points in moved]
        meshes[-1] = block.mesh  # where cells were repaired, not what the last step left
    before = base
    done = 0.0
    for step, mesh in zip(steps, meshes, strict=True):
        safe = step_safety(before, mesh, base, (done, step.part), step.index)
        cell = None if safe.cell is None else int(block.ids[safe.cell])
        found.append(replace(safe, cell=cell))
        before = mesh
        done = step.part
    return found


class RunCollector:
    """The quality of all cells of a zone before and after a run, collected block by block."""

    def __init__(self, after: QualityCollector, before: QualityCollector) -> None:
        self.after = after
        self.before = before
        self.inverted: dict[int, tuple[int, IntArray]] = {}
        """VTK type and nodes of inverted cells, by their number: those with the lowest numbers."""
        self.farthest = Farthest(-1.0, 0, np.empty(0))
        """The node with the largest displacement."""
        self.safe: list[SafeFraction] = []
        """How far each step may go."""

    def add(self, found: MeasuredBlock, listed: int) -> None:
        """Add a block; the ``listed`` inverted cells with the lowest numbers so far are kept."""
        self.after.add(found.ids, found.values, found.status, found.signs)
        self.before.add(found.ids, found.before, found.old, found.signs)
        self.farthest = self.farthest.further(found.farthest)
        self.inverted = dict(sorted((self.inverted | found.inverted).items())[:listed])
        both = zip(self.safe or found.safe, found.safe, strict=True)
        self.safe = [min(pair, key=lambda one: (one.fraction, one.cell or 0)) for pair in both]


@contextmanager
def facet_sums(path: Path, zone: int) -> Iterator[Callable[[tuple[int, int]], int]]:
    """Context with a function that sums the signed hashes of the inner facets of some cells.

    Its argument is the first of these cells and the one after the last, by place in the file.
    """
    with ExitStack() as stack:
        (source,) = FileSource.open(stack, (path, zone)).zones
        markers = read_markers(source.file, source.place)
        tables = (nodes for m in markers for _, nodes in m.cells.by_type.values())
        marked = np.unique(np.concatenate([_NONE, *(_hashes(np.sort(t, axis=1)) for t in tables)]))

        def add(part: tuple[int, int]) -> int:
            block = source.between(part[0], part[1] - part[0])
            cells = block.mesh.cells
            turned = corner_sums(block.mesh) < 0
            total = 0
            numbered = Cells.from_types(cells.types, block.nodes[cells.connectivity])
            for owner, facet, turn in facets_of(numbered):
                hashes = _hashes(facet)
                inside = ~_is_among(hashes, marked)
                signed = np.where(turn ^ turned[owner], hashes, np.negative(hashes))
                total += int(signed[inside].sum(dtype=np.uint64))
            return total

        yield add


def require_consistent_orientation(
    zone: ZoneSource, parts: Sequence[tuple[int, int]], ranks: SerialPool = SERIAL, remedy: str = ""
) -> None:
    """Raise where the sums of the hashes of all facets of a zone do not add up to 0.

    Raises MeshError if the sum is not 0: some cell is folded, or a part of the boundary is in no
    marker.
    ``parts``: of the cells, as `facet_sums` takes them.
    ``remedy``: one more remedy for the message.
    """
    with ranks.sharing(facet_sums, *zone.undeformed) as do:
        total = sum(do(parts))
    if total % 2**64:
        rule = (
            "some cells are numbered the other way round than others, and others are folded, or a "
            "part of the boundary is in no marker, which only the whole mesh can tell"
        )
        remedy += "run it without --stream, or mesh again"
        raise MeshError(Message(rule, remedy, (zone.file.name,)))


def folded_steps(
    displacer: InteriorDisplacer, source: ZoneSource, cells: Mapping[int, tuple[int, IntArray]]
) -> dict[int, tuple[int, int]]:
    """Return VTK type and first inverted step by number of ``cells``: VTK type and nodes each."""
    if not cells:
        return {}
    types = [vtk for vtk, _ in cells.values()]
    nodes, flat = np.unique(
        np.concatenate([nodes for _, nodes in cells.values()]), return_inverse=True
    )
    points = (source.base or source.points).at(nodes)
    part = Mesh(points, Cells.from_types(types, flat))
    moved = displacer.after_steps(nodes, points)
    steps = [
        replace(step, mesh=part.with_points(now))
        for step, now in zip(displacer.steps, moved, strict=True)
    ]
    when = folded_at(steps, part, np.arange(len(cells)))
    return dict(zip(cells, zip(types, when.tolist(), strict=True), strict=True))


_NONE = np.empty(0, np.uint64)


def _hashes(facets: IntArray) -> Hashes:
    """Return a hash (f,) of each facet (f, k) of ascending nodes: splitmix64, node by node."""
    out = np.zeros(len(facets), np.uint64)
    for column in facets.T:
        out += column.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        out = (out ^ (out >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        out = (out ^ (out >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        out ^= out >> np.uint64(31)
    return out


def _is_among(hashes: Hashes, some: Hashes) -> BoolArray:
    if not len(some):
        return np.zeros(len(hashes), bool)
    at = np.minimum(np.searchsorted(some, hashes), len(some) - 1)
    return np.asarray(some[at] == hashes)
