"""Repair of a streamed mesh: the cells near bad ones are read from the file, and mended there."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from slideviz.case.model import Case
from slideviz.formats.su2b.read import ElementBlock
from slideviz.mesh.elements import SIZES
from slideviz.mesh.model import (
    BoolArray,
    Cells,
    FloatArray,
    IntArray,
    Mesh,
    Part,
    Skin,
    row_norms,
    sealed,
)
from slideviz.mesh.quality import VALID, Quality
from slideviz.mesh.repair.freedom import Freedom
from slideviz.mesh.repair.patches import with_images
from slideviz.mesh.repair.repair import Region, mend_cells
from slideviz.solver.repair_stage import (
    find_freedom,
    moved_layers,
    slide_advice,
    unmarked_sides,
    unmendable_words,
)
from slideviz.solver.setup import Setup
from slideviz.solver.steps import MeshRepair
from slideviz.streaming.source import CELLS, ZoneSource
from slideviz.system.platform import free_memory
from slideviz.system.threads import Tick

BYTES = 3000  # of memory that repair takes for each cell of a region: measured on hexahedra

Chosen = Callable[[ElementBlock, IntArray], BoolArray]
"""Takes cells (k,) of a file, and where the nodes of each begin; returns which of them count."""

Layers = Callable[[IntArray, FloatArray], IntArray]
"""Takes nodes (m,) and their undeformed points (m, d); returns the places of those of layers."""


class FileRegions:
    """A deformed mesh in a file, of which one region is in memory at a time.

    ``source``: the mesh, and the undeformed points.
    ``file``: descriptor of the file of its points, to which moved ones are written.
    ``skin`` and ``freedom``: the boundary and the cells at it, and the freedom of its nodes.
    ``facets`` (f, 2 or 4): the sides that are on a boundary, by nodes of the skin.
    ``layers``: which nodes move only where cells stay folded else.
    ``going_on``: called with each block of cells; what it raises ends the work.
    """

    def __init__(
        self,
        source: ZoneSource,
        file: int,
        skin: Mesh,
        freedom: Freedom,
        facets: IntArray,
        layers: Layers,
        going_on: Callable[[], object],
    ) -> None:
        self._source = source
        self._file = file
        self._going_on = going_on
        self._skin = skin.numbering.points
        self._freedom = freedom
        self._facets = facets
        self._layers = layers
        self.nodes = self._skin[:0]
        self.before = np.empty((0, skin.dim))
        self.moved_layers = self._skin[:0]
        """`nodes`, `before`, `moved_layers` (m,), (m, d), (l,): nodes in regions that were moved,
        where they were, and which of them are of layers."""
        self.warnings: tuple[str, ...] = ()

    def near(self, cells: IntArray, rings: int) -> Region | None:
        """Return a region with all cells at the nodes of some cells (k,) and rings around them.

        None where it does not fit into memory.
        """
        near = self._nodes_of(lambda block, _: np.isin(block.ids, cells))
        for _ in range(rings):
            near = self._nodes_of(_touching(near))
        blocks = []
        count = 0
        free = free_memory()
        for block in self._blocks(_touching(near)):
            blocks.append(block)
            count += len(block.ids)
            if BYTES * count > free:
                sentence = (
                    f"{len(cells)} bad cells stay as they are: with the cells near them, their "
                    f"repair needs more than the {free / 1e9:.1f} GB of memory that are free"
                )
                self.warnings = (sentence,)
                return None
        ids = np.concatenate([block.ids for block in blocks])
        flat = np.concatenate([block.nodes for block in blocks])
        nodes, connectivity = np.unique(flat, return_inverse=True)
        types = np.concatenate([block.types for block in blocks])
        order = np.argsort(ids, kind="stable")
        ids = ids[order]
        table = Cells.from_types(types, connectivity).take(order)
        assert self._source.base is not None
        mesh = Mesh(self._source.points.at(nodes), table, name=self._source.file.name)
        reference = mesh.with_points(self._source.base.at(nodes))
        freedom = self._freedom_of(nodes, near[nodes], reference)
        layers = self._layers(nodes, reference.points)
        return Region(ids, nodes, mesh, reference, freedom, layers)

    def cells(self, which: IntArray) -> Cells:
        """Return the cells with some numbers (k,), ascending."""
        blocks = list(self._blocks(lambda block, _: np.isin(block.ids, which)))
        every = Cells.from_types(
            np.concatenate([block.types for block in blocks]),
            np.concatenate([block.nodes for block in blocks]),
        )
        return every.take(np.argsort(np.concatenate([block.ids for block in blocks])))

    def move(self, region: Region, points: FloatArray) -> None:
        """Write the points (n, d) of the nodes of a region that were moved."""
        moved = np.flatnonzero((points != region.mesh.points).any(axis=1))
        nodes = region.nodes[moved]
        self.moved_layers = np.union1d(self.moved_layers, nodes[np.isin(moved, region.layers)])
        new = ~np.isin(nodes, self.nodes)
        every = np.concatenate([self.nodes, nodes[new]])
        order = np.argsort(every)
        before = np.concatenate([self.before, region.mesh.points[moved[new]]])
        self.nodes = every[order]
        self.before = before[order]
        self._source.points.write(self._file, nodes, points[moved])

    def _blocks(self, chosen: Chosen) -> Iterator[ElementBlock]:
        """Yield the chosen cells of the file, block by block."""
        for block in self._source.elements(CELLS):
            self._going_on()
            sizes = SIZES[block.types]
            which = chosen(block, np.cumsum(sizes) - sizes)
            if which.any():
                nodes = block.nodes[np.repeat(which, sizes)]
                yield ElementBlock(0, block.types[which], nodes, block.ids[which])

    def _nodes_of(self, chosen: Chosen) -> BoolArray:
        """Return a mask (n,) of the nodes of the chosen cells, and of their images."""
        mask = np.zeros(self._source.n_points, bool)
        for block in self._blocks(chosen):
            mask[block.nodes] = True
        mask[self._skin] = with_images(self._freedom.place, mask[self._skin])
        return mask

    def _freedom_of(self, nodes: IntArray, inside: BoolArray, undeformed: Mesh) -> Freedom:
        """Return the freedom of the nodes (n,) of a region.

        ``inside`` (n,): those of which all cells are in the region.
        """
        shared = np.flatnonzero(np.isin(self._skin, nodes))
        places = np.searchsorted(nodes, self._skin[shared])
        of_skin = np.full(len(self._skin), -1)
        of_skin[shared] = places
        facets = of_skin[self._facets]
        sides = unmarked_sides(undeformed, facets[(facets >= 0).all(axis=1)])
        bare = np.unique(sides[inside[sides].all(axis=1)])
        return self._freedom.of_part(shared).embedded(places, len(nodes)).without(bare)


def _touching(near: BoolArray) -> Chosen:
    """Return what chooses the cells with a node in the mask ``near`` (n,)."""
    return lambda block, first: np.logical_or.reduceat(near[block.nodes], first)


def mend_file(
    case: Case,
    source: ZoneSource,
    file: int,
    tick: Tick,
    skin: Mesh,
    layers: Layers,
    setup: Setup,
    points: FloatArray,
    before: Quality,
    after: Quality,
) -> MeshRepair:
    """Return a streamed mesh with its bad cells mended in the file.

    ``source`` and ``file``: as of `FileRegions`.
    ``skin`` and ``setup``: the undeformed skin, with its cells, and its setup.
    ``layers``: as of `FileRegions`.
    ``points`` (k, d): of the deformed skin.
    ``before`` and ``after``: quality of all cells, undeformed and deformed.
    """
    below = min(case.repair_below, before.min)
    count = source.n_cells
    parts = [slice(first, first + CELLS) for first in range(0, count, CELLS)]
    folded = np.concatenate([p.start + np.flatnonzero(after.status[p] != VALID) for p in parts])
    poor = np.concatenate([p.start + np.flatnonzero(after.values[p] < below) for p in parts])
    bad = np.union1d(folded, poor)
    if not len(bad):
        return MeshRepair(skin, bad, bad, bad, bad, bad, points[bad], 0.0)
    done = 0.0

    def report(fraction: float) -> None:
        nonlocal done
        done = fraction
        tick(done)

    freedom = find_freedom(case, skin, points, setup)
    facets = setup.boundary.facets
    regions = FileRegions(source, file, skin, freedom, facets, layers, lambda: tick(done))
    ratings = np.where(np.isin(bad, folded), -1.0, after.values[bad])
    left, still, impossible = mend_cells(regions, bad, ratings, below, case.quality_metric, report)
    if regions.warnings and not len(regions.nodes):
        none = bad[:0]
        same = bad, bad, folded, folded
        return MeshRepair(skin, *same, none, points[none], 0.0, warnings=regions.warnings)
    cells = regions.cells(bad)
    nodes = np.union1d(cells.nodes, regions.nodes)
    cells = Cells.from_types(cells.types, np.searchsorted(nodes, cells.connectivity))
    part = Part(sealed(nodes), sealed(bad), source.n_points, count)
    mesh = Skin(source.points.at(nodes), cells, name=skin.name, part=part)
    moved = np.searchsorted(nodes, regions.nodes)
    way = row_norms(mesh.points[moved] - regions.before)
    # Later regions may have moved a node back to where it was.
    kept = np.flatnonzero(way > 0.0)
    unmendable, warnings = unmendable_words(impossible, skin)
    kept_nodes = regions.nodes[kept]
    layers_moved = moved_layers(np.isin(regions.moved_layers, kept_nodes))
    advice = tuple[str, ...]()
    if len(poor := np.setdiff1d(left, still)):
        advice = slide_advice(case, skin, regions.cells(poor), below)
    return MeshRepair(
        mesh,
        bad,
        left,
        folded,
        still,
        kept_nodes,
        regions.before[kept],
        float(way.max(initial=0.0)),
        unmendable,
        (*warnings, *layers_moved, *advice, *regions.warnings),
    )
