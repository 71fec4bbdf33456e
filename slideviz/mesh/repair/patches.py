"""Patches: the cells near bad ones, with the nodes among them that may move.

Patches that share a node are one. A node moves only if all cells of its block (of the node, its
images and copies) are in the patch, so that everything outside keeps its bits.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np

from slideviz.mesh.fans import components
from slideviz.mesh.jacobians import CORNER_AT, CORNERS, LANES
from slideviz.mesh.model import BoolArray, Cells, FloatArray, IntArray, row_numbers
from slideviz.mesh.repair.energy import Targets, write_curvatures, write_energy
from slideviz.mesh.repair.freedom import Freedom
from slideviz.system.jit_cache import njit
from slideviz.system.threads import cores

CHUNK = 4 * LANES  # least number of cells that a thread works on at a time

FLAT = 1e-12  # curvature of a block, over its largest one, below which a direction counts as held


def find_patches(
    cells: Cells, freedom: Freedom, bad: BoolArray, rings: int
) -> tuple[list[IntArray], BoolArray]:
    """Return the cells (k,) of each patch, ascending, and a mask (n,) of nodes that may move.

    ``bad`` is a mask (m,) of cells; patches are these and ``rings`` rings of cells by nodes.
    """
    place = freedom.place
    count = len(freedom.place)
    chosen = bad.copy()
    for _ in range(rings):
        near = with_images(place, _nodes_of(cells, chosen, count))
        for ids, nodes in cells.by_type.values():
            chosen[ids] |= near[nodes].any(axis=1)
    inside = ~_nodes_of(cells, ~chosen, count) & (place >= 0)
    inside &= ~with_images(place, ~inside)
    ids = np.flatnonzero(chosen)
    part = cells.take(ids)
    first = part.connectivity[part.offsets[:-1]]
    sizes = np.diff(part.offsets)
    label = components(count, np.repeat(first, sizes), part.connectivity)
    label = _with_representative(place, label)[first]
    return [ids[label == one] for one in np.unique(label)], inside


def _nodes_of(cells: Cells, chosen: BoolArray, count: int) -> BoolArray:
    """Return a mask (count,) of the nodes of the cells in the mask ``chosen`` (m,)."""
    out = np.zeros(count, bool)
    for ids, nodes in cells.by_type.values():
        out[nodes[chosen[ids]]] = True
    return out


def with_images(place: IntArray, chosen: BoolArray) -> BoolArray:
    """Return the mask ``chosen`` (n,) with all nodes of the blocks of those in it."""
    blocks = np.zeros(int(place.max(initial=-1)) + 2, bool)  # the last one: of held nodes
    blocks[place[chosen]] = True
    blocks[-1] = False
    return chosen | blocks[place]


def _with_representative(place: IntArray, label: IntArray) -> IntArray:
    """Return labels (n,) of connected nodes in which blocks connect their nodes, too."""
    first = np.full(int(place.max(initial=-1)) + 1, -1)
    own = np.flatnonzero(place >= 0)
    first[place[own[::-1]]] = own[::-1]
    count = len(label)
    pairs = first[place[own]]
    a = np.r_[np.arange(count), own]
    b = np.r_[count + label, pairs]
    return components(2 * count, a, b)[:count]


class Patch:
    """A patch with numbers of its own, and the sums over its cells."""

    def __init__(
        self, points: FloatArray, freedom: Freedom, parts: list[Targets], pool: Executor
    ) -> None:
        """Take a patch: the points (k, d) of its nodes, their freedom, and its cells.

        Each block of the freedom moves. The nodes of the cells count from 0. ``pool`` does chunks
        of cells.
        """
        self.start = points
        self.freedom = freedom
        self.parts = parts
        self.blocks = int(freedom.place.max(initial=-1)) + 1
        self.maps = np.array(freedom.maps)
        self.still = np.zeros((self.blocks, points.shape[1]))
        self.row = row_numbers(len(points), freedom.bound)
        self._pool = pool
        self._flat = np.concatenate([part.nodes.ravel() for part in parts])
        owner = freedom.place[self._flat]
        order = np.argsort(owner, kind="stable")
        begins = np.searchsorted(owner[order], np.arange(self.blocks + 1))
        self._order = order
        self._begins = begins
        self._slopes = np.empty((len(self._flat), points.shape[1]))
        sizes = [len(part.nodes) for part in parts]
        self.values = np.empty(sum(sizes))
        self.least = np.empty(sum(sizes))
        self._chunks = []
        first = 0
        entry = 0
        for part, size in zip(parts, sizes, strict=True):
            width = part.nodes.shape[1]
            slopes = self._slopes[entry : entry + size * width].reshape(size, width, -1)
            step = self._step(size)
            for low in range(0, size, step):
                here = slice(low, min(low + step, size))
                whole = slice(first, first + size)
                self._chunks.append((part, here, whole, slopes))
            first = first + size
            entry = entry + size * width

    @staticmethod
    def _step(cells: int) -> int:
        """Return the number of cells in a chunk; results do not depend on it."""
        return max(CHUNK, -(-cells // (2 * cores()) // LANES) * LANES)

    def points(self, unknowns: FloatArray) -> FloatArray:
        """Return the points (k, d) of unknowns (b, d)."""
        out = np.array(self.start)
        _move(self.freedom.place, self.row, self.maps, unknowns, out)
        return out

    def of_cells(self, work: Callable[[Targets, slice, slice, FloatArray], None]) -> None:
        """Call ``work(part, here, whole, slopes)`` for each chunk of cells, on all cores.

        ``here`` is the chunk within the part, ``whole`` the part within all cells, and ``slopes``
        (m, n, d) are the part's, for `gathered`.
        """
        if len(self._chunks) == 1:
            work(*self._chunks[0])
        else:
            list(self._pool.map(lambda chunk: work(*chunk), self._chunks))

    def gathered(self) -> FloatArray:
        """Return the sum (b, d) of the slopes of the cells by unknowns."""
        out = np.empty((self.blocks, self.start.shape[1]))
        _gather_blocks(
            self._begins, self._order, self._flat, self.row, self.maps, self._slopes, out
        )
        return out

    def energy(self, unknowns: FloatArray, epsilon: float) -> tuple[float, FloatArray]:
        """Return the energy and its gradient (b, d); `least` has the least D of the cells."""
        points = self.points(unknowns)

        def work(part: Targets, here: slice, whole: slice, slopes: FloatArray) -> None:
            table = CORNERS[part.vtk]
            at = CORNER_AT[part.vtk]
            cells = part.nodes, table, at, part.scale, part.shape
            out = self.values[whole], slopes, self.least[whole]
            write_energy(part.vtk, points, *cells, epsilon, here.start, here.stop, *out)

        self.of_cells(work)
        return float(self.values.sum()), self.gathered()

    def curvature(self, epsilon: float) -> FloatArray:
        """Return the inverse (b, d, d) of each block of the positive Hessian, where it can move."""
        points = self.start
        d = self.start.shape[1]
        blocks = np.empty((len(self._flat), d, d))
        ends = np.cumsum([part.nodes.size for part in self.parts])
        each = dict(zip((part.vtk for part in self.parts), np.split(blocks, ends), strict=False))

        def work(part: Targets, here: slice, _whole: slice, _slopes: FloatArray) -> None:
            cells = part.nodes, CORNERS[part.vtk], CORNER_AT[part.vtk], part.scale, part.shape
            out = each[part.vtk].reshape(*part.nodes.shape, d, d)
            write_curvatures(part.vtk, points, *cells, epsilon, here.start, here.stop, out)

        self.of_cells(work)
        row = self.row[self._flat]
        bound = row >= 0
        maps = self.maps[row[bound]]
        blocks[bound] = np.swapaxes(maps, 1, 2) @ blocks[bound] @ maps
        total = np.empty((self.blocks, d, d))
        free = np.full_like(self.row, -1)
        by_node = self._begins, self._order, self._flat, free, self.maps
        _gather_blocks(*by_node, blocks.reshape(-1, d * d), total.reshape(-1, d * d))
        total[~np.isfinite(total).all(axis=(1, 2))] = 0.0  # beside cells without a size
        value, vector = np.linalg.eigh(total)
        keep = value > FLAT * value[:, -1:]
        inverse = np.where(keep, 1.0 / np.where(keep, value, 1.0), 0.0)
        return (vector * inverse[:, None, :]) @ np.swapaxes(vector, 1, 2)


@njit
def _move(place, row, maps, unknowns, out):  # type: ignore[no-untyped-def]
    """Add the displacements of unknowns (b, d) to the points ``out`` (k, d)."""
    d = out.shape[1]
    for i in range(len(out)):
        block = place[i]
        m = row[i]
        if block < 0:
            continue
        for a in range(d):
            if m < 0:
                out[i, a] += unknowns[block, a]
            else:
                total = 0.0
                for b in range(d):
                    total += maps[m, a, b] * unknowns[block, b]
                out[i, a] += total


@njit
def _gather_blocks(begins, order, nodes, row, maps, slopes, out):  # type: ignore[no-untyped-def]
    """Write the sums of slopes (e, d), each times its map's transpose, into ``out`` (b, d)."""
    d = out.shape[1]
    out[:] = 0.0
    for block in range(len(out)):
        for k in range(begins[block], begins[block + 1]):
            entry = order[k]
            m = row[nodes[entry]]
            for a in range(d):
                if m < 0:
                    out[block, a] += slopes[entry, a]
                else:
                    for b in range(d):
                        out[block, a] += maps[m, b, a] * slopes[entry, b]
