"""Repair of a mesh: bad cells are mended by moving nodes near them.

Patches of bad cells and their surroundings (`slideviz.mesh.repair.patches`) are unfolded by the
energy of `slideviz.mesh.repair.energy`, whose epsilon falls from round to round. Nothing else
changes a bit. A patch keeps the best state by (cells not proved, lowest quality), so that no cell
count or lowest quality is worse than before.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slideviz.mesh.jacobians import CORNERS, VALID, write_corners
from slideviz.mesh.model import FloatArray, IntArray, Mesh, sealed
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality import Quality, cell_quality, checked_reference, quality
from slideviz.mesh.repair.descent import descend
from slideviz.mesh.repair.energy import targets
from slideviz.mesh.repair.freedom import Freedom
from slideviz.mesh.repair.patches import Patch, find_patches
from slideviz.system.threads import cores
from slideviz.terms import SkewMetric

RINGS = 3, 5, 8
"""Rings of cells around bad ones; a patch that fails grows to the next."""

ROUNDS, VAIN = 40, 10
"""Most outer rounds of a patch, and those in a row that may mend nothing."""

ITERATIONS, DECREASE = 200, 1e-3
"""Most iterations of a descent, and the least relative decrease in ten of them."""

BELOW = 0.1
"""Cells of a lower quality are mended, too."""

Report = Callable[[str, float], object]
"""Called with what is done and the fraction of it; what it raises ends the repair."""


@dataclass(frozen=True, eq=False)
class Impossible:
    """A cell that no motion of free nodes mends."""

    cell: int
    nodes: IntArray
    """(k,): its nodes that are held and make it fold."""
    boundaries: tuple[str, ...]
    """The markers that these nodes are on."""


@dataclass(frozen=True, eq=False)
class Repaired:
    """A mesh after repair."""

    points: FloatArray
    """(n, d)"""
    bad_before: IntArray
    bad_after: IntArray
    """`bad_before`, `bad_after` (k,): the cells, ascending, that are not proved valid, or whose
    quality is too low."""
    moved: IntArray
    """(m,): the nodes that were moved, ascending."""
    largest_move: float
    """The longest way of a node, in the mesh's length unit."""
    impossible: tuple[Impossible, ...]
    """The cells that cannot be mended; they are in ``bad_after``."""


@dataclass(frozen=True, eq=False)
class _Work:
    """What all patches have in common."""

    mesh: Mesh
    reference: Mesh | None
    freedom: Freedom
    sums: FloatArray
    signs: NDArray[np.int8]
    metric: SkewMetric
    below: float
    report: Callable[[float], object]
    pool: ThreadPoolExecutor


def repair(
    mesh: Mesh,
    freedom: Freedom,
    reference: Mesh | None = None,
    *,
    below: float = BELOW,
    metric: SkewMetric = "knupp",
    report: Report = lambda _phase, _fraction: None,
) -> Repaired:
    """Return the mesh's points with bad cells mended: those not proved valid, or too low.

    Parameters
    ----------
    mesh : Mesh
        The mesh with bad cells.
    freedom : Freedom
        Which of its nodes may move, and how.
    reference : Mesh, optional
        The undeformed mesh, whose shapes the cells shall have. Without it they shall have the
        ideal shape of their type, in the local size.
    below : float
        Limit of the quality, from 0 to 1; with 0, only cells that are not proved valid are bad.
    metric : {"knupp", "rbf-slide"}
        Of the quality (`slideviz.mesh.quality.Quality`).
    report : callable
        Called with a phase and the fraction of it; may raise, to cancel.

    Raises
    ------
    MeshError
        As `quality` raises it.
    """
    report("Repair", 0.0)
    found = quality(mesh, reference, metric)
    before = _bad(found, below)
    sums, signs = reference_of(mesh if reference is None else checked_reference(reference, mesh))
    points, hopeless = np.array(mesh.points), _impossible(mesh, found, freedom)
    bad = before.copy()
    bad[[one.cell for one in hopeless]] = False
    with ThreadPoolExecutor(cores(), "slideviz-repair") as pool:
        for stage, rings in enumerate(RINGS):
            if not bad.any():
                break

            def staged(fraction: float, stage: int = stage) -> None:
                report("Repair", (stage + fraction) / len(RINGS))

            now = mesh.with_points(points)
            work = _Work(now, reference, freedom, sums, signs, metric, below, staged, pool)
            _mend_patches(work, bad, rings, points)
            after = _bad(quality(mesh.with_points(points), reference, metric), below)
            bad &= after
    after = _bad(quality(mesh.with_points(points), reference, metric), below)
    way = np.linalg.norm(points - mesh.points, axis=1)
    return Repaired(
        points=sealed(points),
        bad_before=sealed(np.flatnonzero(before)),
        bad_after=sealed(np.flatnonzero(after)),
        moved=sealed(np.flatnonzero((points != mesh.points).any(axis=1))),
        largest_move=float(way.max(initial=0.0)),
        impossible=hopeless,
    )


def _bad(found: Quality, below: float) -> NDArray[np.bool_]:
    return (found.status != VALID) | (found.values < below)


def _impossible(mesh: Mesh, found: Quality, freedom: Freedom) -> tuple[Impossible, ...]:
    """Return the cells with a corner that folds and whose nodes are all held."""
    out = []
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        some = np.flatnonzero(found.status[ids] != VALID)
        table = CORNERS[vtk]
        alpha = np.empty((len(table), len(some)))
        write_corners(mesh.points, nodes[some], table, alpha)
        held = (freedom.place[nodes[some][:, table]] < 0).all(axis=2)
        wrong = held & ~(alpha.T * found.signs[ids[some], None] > 0)
        for row in np.flatnonzero(wrong.any(axis=1)):
            corner = nodes[some[row]][table[wrong[row].argmax()]]
            out.append(Impossible(int(ids[some[row]]), sealed(np.sort(corner)), ()))
    return tuple(sorted(out, key=lambda one: one.cell))


def _mend_patches(work: _Work, bad: NDArray[np.bool_], rings: int, points: FloatArray) -> None:
    """Mend all patches; write the points (n, d)."""
    patches, free = find_patches(work.mesh.cells, work.freedom, bad, rings)
    for number, cells in enumerate(patches):

        def numbered(fraction: float, number: int = number) -> None:
            work.report((number + fraction) / len(patches))

        numbered(0.0)
        patch = _Mending(work, cells, free, numbered)
        if patch.nodes_free:
            points[patch.nodes] = patch.mended()


class _Mending:
    """The work on one patch."""

    def __init__(
        self,
        work: _Work,
        cells: IntArray,
        free: NDArray[np.bool_],
        tell: Callable[[float], object],
    ) -> None:
        """Take the cells (k,) of a patch, and a mask (n,) of the nodes that may move."""
        self.work, self.tell, self.cells = work, tell, cells
        part = work.mesh.cells.take(cells)
        self.nodes = part.nodes
        place = np.where(free[self.nodes], work.freedom.place[self.nodes], -1)
        used = np.unique(place[place >= 0])
        here = work.freedom.of_part(self.nodes)
        moves = free[self.nodes]
        self.nodes_free = len(used)
        bound = moves[here.bound]
        self.freedom = Freedom(
            np.where(place >= 0, np.searchsorted(used, place), -1),
            here.bound[bound],
            here.maps[bound],
            here.curved[moves[here.curved]],
            here.project,
        )
        self.parts, self.of_part = [], []
        shapes = work.reference or work.mesh
        for vtk, (some, nodes) in part.by_type.items():
            signs = work.signs[cells[some]].astype(float)
            at = shapes.points[nodes]
            self.parts.append(targets(vtk, np.searchsorted(self.nodes, nodes), at, signs))
            self.of_part.append(some)
        start = np.array(work.mesh.points[self.nodes])
        self.patch = Patch(start, self.nodes, self.freedom, self.parts, work.pool)

    def score(self, points: FloatArray) -> tuple[int, float, bool]:
        """Return (minus cells not proved, lowest quality) at points, and whether all is good."""
        unproved, lowest = 0, np.inf
        for part, some in zip(self.parts, self.of_part, strict=True):
            ids = self.cells[some]
            signs, sums = self.work.signs[ids], self.work.sums[ids]
            size, skew, status = cell_quality(
                points, part.vtk, part.nodes, signs, sums, self.work.metric
            )
            unproved += int((status != VALID).sum())
            lowest = min(lowest, float((np.sqrt(size) * skew).min()))
        return -unproved, lowest, unproved == 0 and lowest >= self.work.below

    def mended(self) -> FloatArray:
        """Return the best points (k, d)."""
        patch = self.patch
        best_points, best = patch.start, self.score(patch.start)
        epsilon, vain, unknowns = 1.0, 0, np.zeros((patch.blocks, patch.start.shape[1]))
        for _ in range(ROUNDS):
            unknowns = self.descended(unknowns, epsilon)
            points = patch.points(unknowns)
            score = self.score(points)
            vain += 1
            if score > best:
                vain = 0 if score[0] > best[0] else vain
                best_points, best = points, score
            if best[2] or vain >= VAIN:
                break
            depth = min(float(patch.least.min()), 0.0)
            epsilon = float(np.sqrt(1e-12 + (0.2 * depth) ** 2))
        return best_points

    def descended(self, unknowns: FloatArray, epsilon: float) -> FloatArray:
        """Return unknowns (b, d) of lower energy."""
        patch = self.patch
        inverse = patch.curvature(unknowns, epsilon)

        def cancelled() -> bool:
            self.tell(0.0)
            return False

        found = descend(
            lambda q: patch.energy(q, epsilon),
            unknowns,
            lambda gradient: np.einsum("bij,bj->bi", inverse, gradient),
            lambda _q, _p: np.inf,
            iterations=ITERATIONS,
            enough=cancelled,
            decrease=DECREASE,
        )
        patch.energy(found.unknowns, epsilon)
        return found.unknowns
