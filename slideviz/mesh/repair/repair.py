"""Repair of a mesh: bad cells are mended by moving nodes near them.

Patches of bad cells and their surroundings (`slideviz.mesh.repair.patches`) are unfolded by the
energy of `slideviz.mesh.repair.energy`, whose epsilon falls from round to round. Nothing else
changes a bit. A patch keeps the best state by (cells not proved, lowest quality), so that neither
is worse than before. In rounds the limit rises to the one that is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.jacobian_slopes import write_slopes
from slideviz.mesh.jacobians import CORNERS, INVERTED, VALID
from slideviz.mesh.model import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    Signs,
    checked_reference,
    row_norms,
    sealed,
)
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality import Quality, cell_quality, quality
from slideviz.mesh.repair.descent import descend
from slideviz.mesh.repair.energy import Targets, targets
from slideviz.mesh.repair.freedom import Freedom, places
from slideviz.mesh.repair.patches import Patch, find_patches
from slideviz.mesh.skew import EXPONENTS
from slideviz.mesh.surfaces import lifted, padded
from slideviz.system.threads import Tick, cores, equal_shares
from slideviz.terms import SkewMetric

RINGS = 3, 5, 8, 13, 21  # rings of cells around bad ones; a patch that fails grows to the next

SHARES = 1.0, 1.0, 0.2, 0.5, 0.2
"""Epsilon over the depth of the deepest fold, in patches of each size: the larger, the better the
cells that it ends with, and the sooner it is stuck."""

FEW = 5000  # most cells of a patch that grows to the last two

POOR = 2  # number of sizes that are tried for patches whose cells are all proved, but some too low

ROUNDS = 40  # most outer rounds of a patch
SHALLOWER = 0.9
STUCK = 3
"""Factor by which the deepest fold must become shallower, and how many rounds in a row may fail to
make it so, before a patch grows."""

ITERATIONS = 200
DECREASE = 5e-3
ENOUGH = 0.01
POLISH = 1e-3
"""Most iterations of a descent, and the least relative decrease of the energy in ten of them: while
a cell is folded, when none is, and in the last descent, which brings cells near their targets."""

LIFTS = 40
LIFTED = 1e-3
BETA = 1.01
GAIN = 0.003
"""Of a round that lifts the worst: most iterations, the epsilon of the preconditioner, the limit
over the largest 1 / quality, and the least relative gain, of which two rounds may bring less."""

TREND = 5  # rounds of a lift after which it ends if it will not reach the limit

SHAPE = 10.0
"""Weight of the energy of shape beside that of the lift, which does not see short edges."""

FLAT_SIDE = 1e-6
"""Sine of the angle between the normals of a side's corners, up to which it is flat. In a flat side
that folds on itself the Jacobian vanishes, wherever the other nodes are."""

BELOW = 0.1  # cells of a lower quality are mended, too

LIMITS = tuple(k / 20 for k in range(20))
"""Limits of the rounds that come before the last one: first cells are unfolded, then poor cells
lifted in smaller patches, whose energy they determine more."""


@record
class Impossible:
    """A cell that no motion of free nodes mends."""

    cell: int
    nodes: IntArray  # (k,): its nodes that are held and make it bad, ascending
    layered: bool  # whether some of these are nodes of layers


@record
class Region:
    """Cells of a mesh, with what their repair needs."""

    cells: IntArray
    nodes: IntArray
    """`cells`, `nodes` (m,), (n,): the numbers of its cells and nodes in the mesh, ascending."""
    mesh: Mesh
    reference: Mesh | None  # `mesh`, `reference`: the region itself, as it is now and undeformed
    freedom: Freedom
    layers: IntArray  # (l,): of its nodes those of layers, which move only where cells stay folded


class Regions(Protocol):
    """A mesh to repair, in memory or in a file, of which one region is in memory at a time."""

    def near(self, cells: IntArray, rings: int) -> Region | None:
        """Return a region with all cells at the nodes of some cells (k,) and rings around them.

        None: it is too large, and the cells stay as they are.
        """

    def move(self, region: Region, points: FloatArray) -> None:
        """Take the points (n, d) of the nodes of a region, some of which were moved."""


@record
class Repaired:
    """A mesh after repair."""

    points: FloatArray  # (n, d)
    bad_before: IntArray
    bad_after: IntArray
    """`bad_before`, `bad_after` (k,): the cells, ascending, that are not proved valid, or whose
    quality is too low."""
    folded_after: IntArray  # (f,): those of `bad_after` that are not proved valid
    moved: IntArray  # (m,): the nodes that were moved, ascending
    largest_move: float  # the longest way of a node, in the mesh's length unit
    impossible: tuple[Impossible, ...]  # the cells that cannot be mended; they are in bad_after


@record
class _Work:
    """What all patches have in common."""

    mesh: Mesh
    reference: Mesh | None
    freedom: Freedom
    sums: FloatArray
    signs: Signs
    metric: SkewMetric
    below: float
    report: Tick
    hopeless: BoolArray
    bad: BoolArray
    """`hopeless`, `bad` (m,): cells that cannot be mended, which no energy counts, and those that
    were bad before the first round."""
    wanted: float  # the limit of the last round
    share: float  # of the depth of the deepest fold: the next epsilon
    pool: ThreadPoolExecutor


def repair_mesh(
    mesh: Mesh,
    freedom: Freedom,
    reference: Mesh | None = None,
    *,
    layers: IntArray | tuple[()] = (),
    below: float = BELOW,
    metric: SkewMetric = "knupp",
    report: Tick = lambda _: None,
) -> Repaired:
    """Return the mesh's points with bad cells mended: those not proved valid, or too low.

    Raises MeshError as `quality` does.
    ``mesh``: the mesh with bad cells.
    ``freedom``: which of its nodes may move, and how.
    ``reference``: the undeformed mesh, whose shapes the cells shall have. Without it they shall
    have the ideal shape of their type, in the local size.
    ``layers`` (l,): nodes that move only where cells stay folded else.
    ``below``: limit of the quality, from 0 to 1; with 0, only cells that are not proved valid are
    bad.
    ``metric``: of the quality (`slideviz.mesh.quality.Quality`).
    ``report``: called with the fraction that is done; may raise, to cancel.
    """
    shapes = None if reference is None else checked_reference(reference, mesh).undeformed
    ratings = quality_ratings(quality(mesh, shapes, metric))
    before = np.flatnonzero(ratings < below)
    whole = _Whole(mesh, shapes, freedom, np.array(layers, np.int64))
    after, folded, impossible = mend_cells(whole, before, ratings[before], below, metric, report)
    points = whole.points
    way = row_norms(points - mesh.points)
    return Repaired(
        points=sealed(points),
        bad_before=sealed(before),
        bad_after=sealed(after),
        folded_after=sealed(folded),
        moved=sealed(np.flatnonzero((points != mesh.points).any(axis=1))),
        largest_move=float(way.max(initial=0.0)),
        impossible=impossible,
    )


class _Whole:
    """A mesh in memory: one region."""

    def __init__(
        self, mesh: Mesh, reference: Mesh | None, freedom: Freedom, layers: IntArray
    ) -> None:
        self.points = np.array(mesh.points)
        cells = np.arange(len(mesh.cells))
        nodes = np.arange(len(mesh.points))
        self._region = Region(cells, nodes, mesh, reference, freedom, layers)

    def near(self, _cells: IntArray, _rings: int) -> Region:
        return replace(self._region, mesh=self._region.mesh.with_points(self.points))

    def move(self, _region: Region, points: FloatArray) -> None:
        self.points = points


def mend_cells(
    regions: Regions,
    bad: IntArray,
    ratings: FloatArray,
    below: float,
    metric: SkewMetric,
    report: Tick,
) -> tuple[IntArray, IntArray, tuple[Impossible, ...]]:
    """Mend the bad cells (k,) of a mesh, in rounds whose limit rises to ``below``.

    Each round begins with the mesh of the one before. So a limit that cannot be reached loses
    nothing, and a stricter one ends with no worse mesh. Nodes of layers stay, but near cells that
    are folded after these rounds: there they move as well, until the cells are unfolded.

    Return those that are bad then, those that are not proved valid, and those that cannot be
    mended.
    ``ratings`` (k,): of the bad cells, as of `quality_ratings`.
    The other arguments are as of `repair`.
    """
    report(0.0)
    limits = [*(limit for limit in LIMITS if limit < below), below]
    unfold, lift, *ticks = equal_shares(report, len(limits) + 2)
    with ThreadPoolExecutor(cores(), "slideviz-repair") as pool:
        mending = _Rounds(regions, bad, ratings, below, metric, pool)
        for limit, tick in zip(limits, ticks, strict=True):
            if limit == below or mending.reached:
                mending.mend(limit, tick)
        if mending.layered and (mending.ratings < 0.0).any():
            mending.mend(0.0, unfold, layers_stay=False)
            if not (mending.ratings < 0.0).any():
                mending.mend(below, lift)
    impossible = tuple(sorted(mending.impossible.values(), key=lambda one: one.cell))
    return mending.cells, mending.cells[mending.ratings < 0.0], impossible


class _Rounds:
    """The rounds of a repair.

    ``cells`` (k,): the cells that are rated below ``below``, ascending, with ``ratings`` (k,).
    ``impossible``: those that cannot be mended, by number.
    ``layered``: whether nodes of layers were held near them.
    """

    def __init__(
        self,
        regions: Regions,
        cells: IntArray,
        ratings: FloatArray,
        below: float,
        metric: SkewMetric,
        pool: ThreadPoolExecutor,
    ) -> None:
        self.regions = regions
        self.cells = cells
        self.ratings = ratings
        self.before = cells
        self.below = below
        self.metric = metric
        self.pool = pool
        self.impossible = dict[int, Impossible]()
        self.layered = False
        self.reached = True  # whether no cell that can be mended is below the limit of the round

    def mend(self, limit: float, report: Tick, layers_stay: bool = True) -> None:
        """Mend the cells that are rated below a limit, in patches that grow."""
        bad = self.cells[self.ratings < limit]
        for stage, tick in enumerate(equal_shares(report, len(RINGS))):
            region = self.regions.near(bad, RINGS[stage]) if len(bad) else None
            if region is None:
                return
            self.layered |= len(region.layers) > 0
            if layers_stay:
                region = replace(region, freedom=region.freedom.without(region.layers))
            mesh = region.mesh
            reference = region.reference
            sums, signs = reference_of(mesh if reference is None else reference)
            wanted = np.isin(region.cells, bad)
            points = np.array(mesh.points)
            if not stage:
                for cell in bad:
                    self.impossible.pop(cell, None)
                for one in _impossible(region, wanted, signs, sums, self.metric):
                    self.impossible[one.cell] = one
            hopeless = np.isin(region.cells, list(self.impossible))
            wanted &= ~hopeless
            work = _Work(
                mesh=mesh,
                reference=reference,
                freedom=region.freedom,
                sums=sums,
                signs=signs,
                metric=self.metric,
                below=limit,
                report=tick,
                hopeless=hopeless,
                bad=np.isin(region.cells, self.before),
                wanted=self.below,
                share=SHARES[stage],
                pool=self.pool,
            )
            _mend_patches(work, wanted, RINGS[stage], points)
            now = quality_ratings(quality(mesh.with_points(points), reference, self.metric))
            if self._rate(region.cells, now):
                self.regions.move(region, points)
            else:
                now = quality_ratings(quality(mesh, reference, self.metric))
            self.reached = not (wanted & (now < limit)).any()
            bad = region.cells[wanted & (now < (limit if stage + 1 < POOR else 0.0))]

    def _rate(self, cells: IntArray, ratings: FloatArray) -> bool:
        """Take new ratings (m,) of the cells (m,) of a region, unless they are worse; return that.

        They are if more cells are folded, or as many and more poor than at first and than before.
        """
        beyond = ~np.isin(self.cells, cells)
        poor = ratings < self.below
        every = np.concatenate([self.cells[beyond], cells[poor]])
        now = np.concatenate([self.ratings[beyond], ratings[poor]])
        folded = (now < 0.0).sum() - (self.ratings < 0.0).sum()
        most = max(len(self.before), len(self.cells))
        if folded > 0 or (folded == 0 and len(now) > most):
            return False
        order = np.argsort(every)
        self.cells = every[order]
        self.ratings = now[order]
        return True


def quality_ratings(found: Quality) -> FloatArray:
    """Return the quality (m,) of the cells, and -1 for those that are not proved valid."""
    return np.where(found.status == VALID, found.values, -1.0)


def _impossible(
    region: Region,
    bad: BoolArray,
    signs: Signs,
    sums: FloatArray,
    metric: SkewMetric,
) -> list[Impossible]:
    """Return the bad cells (mask (m,)) that no motion of free nodes mends.

    All their nodes are held, or those of a corner that folds, or of a side that folds on itself.
    """
    out = list[Impossible]()
    points = region.mesh.points
    held = region.freedom.place < 0
    for vtk, (ids, table) in region.mesh.cells.by_type.items():
        few = np.flatnonzero(bad[ids] & (held[table].sum(axis=1) >= points.shape[1]))
        cells = ids[few]
        nodes = table[few]
        status = cell_quality(points, vtk, nodes, signs[cells], sums[cells], metric)[2]
        for cell, own, proved in zip(cells, nodes, status == VALID, strict=True):
            wrong = own if held[own].all() else None
            if wrong is None and not proved:
                wrong = _fold(vtk, own, held[own], points[own], int(signs[cell]))
            if wrong is not None:
                layered = bool(np.isin(wrong, region.layers).any())
                wrong = sealed(np.sort(region.nodes[wrong]))
                out.append(Impossible(int(region.cells[cell]), wrong, layered))
    return out


def _fold(vtk: int, nodes: IntArray, held: BoolArray, at: FloatArray, sign: int) -> IntArray | None:
    """Return the nodes of a folded corner or side of a cell that are all held, or None."""
    for corner in CORNERS[vtk]:
        if held[corner].all() and not sign * np.linalg.det(at[corner[1:]] - at[corner[0]]) > 0:
            return nodes[corner]
    for side in ELEMENTS[vtk].facets if at.shape[1] == 3 else ():
        local = np.array(side)
        if held[local].all():
            x = at[local]
            normals = np.cross(np.roll(x, -1, 0) - x, np.roll(x, 1, 0) - x)
            mean = normals.sum(axis=0)
            size = row_norms(normals).max()
            flat = np.abs(np.cross(normals, mean)).max() <= FLAT_SIDE * size * np.linalg.norm(mean)
            if flat and not (normals @ mean).min() > 0:
                return nodes[local]
    return None


def _mend_patches(work: _Work, bad: BoolArray, rings: int, points: FloatArray) -> None:
    """Mend all patches; write the points (n, d)."""
    patches, free = find_patches(work.mesh.cells, work.freedom, bad, rings)
    for number, cells in enumerate(patches):
        if rings > RINGS[2] and len(cells) > FEW:
            continue

        def numbered(fraction: float, number: int = number) -> None:
            work.report((number + fraction) / len(patches))

        numbered(0.0)
        if free[work.mesh.cells.take(cells).nodes].any():
            patch = _Mending(work, cells, free, numbered)
            points[patch.nodes] = patch.mended()


class _Score(NamedTuple):
    """How good a patch is; the greater tuple is better."""

    proved: int
    fewer: int
    """`proved`, `fewer`: minus the number of cells that are not proved, and minus that of bad cells
    beyond those before the first round."""
    lowest: float  # the lowest quality


class _Mending:
    """The work on one patch."""

    def __init__(self, work: _Work, cells: IntArray, free: BoolArray, tell: Tick) -> None:
        """Take the cells (k,) of a patch, and a mask (n,) of the nodes that may move."""
        self.work = work
        self.tell = tell
        self.round = 0
        shapes = work.reference
        nodes = work.mesh.cells.take(cells).nodes
        # In the order of coordinates sums have the same bits, however the mesh is numbered.
        at = work.mesh.points[nodes] if shapes is None else shapes.points[nodes]
        self.nodes = nodes[np.lexsort(at.T)]
        cells = cells[~work.hopeless[cells]]
        tables = dict[int, IntArray]()
        order = []
        for vtk, (some, table) in work.mesh.cells.take(cells).by_type.items():
            local = places(self.nodes, table)
            rank = np.lexsort(np.sort(local, axis=1).T)
            tables[vtk] = local[rank]
            order.append(cells[some[rank]])
        ids = np.concatenate(order)
        self.signs = work.signs[ids]
        self.sums = work.sums[ids]
        self.most = int(work.bad[ids].sum())
        length = _local_lengths(work.mesh.points[self.nodes], tables)
        self.parts = []
        for (vtk, local), some in zip(tables.items(), order, strict=True):
            signs = work.signs[some].astype(float)
            if shapes is not None:
                at = shapes.points[self.nodes[local]]
            else:
                at = IDEAL[vtk] * length[local].mean(axis=1)[:, None, None]
                at[..., 0] *= signs[:, None]
            self.parts.append(targets(vtk, local, at, signs))
        self.patch = self._patch(np.array(work.mesh.points[self.nodes]), free[self.nodes])
        # With sliding nodes held, to go on where projection folds a cell.
        moves = free[self.nodes]
        moves[self.patch.freedom.curved] = False
        self.moves = moves
        self.best_points = self.patch.start
        self.best = self.score(self.best_points)

    def _patch(self, points: FloatArray, moves: BoolArray) -> Patch:
        """Return the patch, in which the nodes of the mask ``moves`` (k,) move."""
        freedom = self.work.freedom.of_part(self.nodes).only(moves)
        return Patch(points, freedom, self.parts, self.work.pool)

    def ratings(self, points: FloatArray) -> FloatArray:
        """Return the quality (m,) of the cells at points (k, d), and -1 if they are not proved."""
        out = np.empty(len(self.signs))
        first = 0
        for part in self.parts:
            here = slice(first, first + len(part.nodes))
            cells = part.nodes, self.signs[here], self.sums[here]
            size, skew, status = cell_quality(points, part.vtk, *cells, self.work.metric)
            values = np.sqrt(size) * skew if self.work.reference is not None else skew
            out[here] = np.where(status == VALID, values, -1.0)
            first = here.stop
        return out

    def score(self, points: FloatArray) -> _Score:
        """Return how good points (k, d) are."""
        ratings = self.ratings(points)
        bad = int((ratings < self.work.wanted).sum())
        return _Score(-int((ratings < 0).sum()), min(self.most - bad, 0), float(ratings.min()))

    def _keep(self, points: FloatArray) -> _Score:
        """Take points (k, d) where they are better than all before; return their score."""
        score = self.score(points)
        if score > self.best:
            self.best = score
            self.best_points = points
        return score

    @property
    def good(self) -> bool:
        """Whether all cells are as they should be."""
        return self.best >= (0, 0, self.work.below)

    def mended(self) -> FloatArray:
        """Return the best points (k, d)."""
        if self.best.proved < 0:
            self._unfold()
        if self.best.proved == 0:
            self.patch.start = self.best_points
            self._keep(self._settled(self._descended(self.patch, LIFTED, POLISH), LIFTED))
        # The quality of a cell that is folded in the reference is 0, however it is lifted.
        if self.best.proved == 0 and self.best.lowest > 0 and not self.good:
            self._lift()
        return self.best_points

    def _unfold(self) -> None:
        """Unfold cells in rounds in which epsilon falls with the depth of the deepest fold.

        It ends where this no longer gets shallower: then the patch is too small.
        """
        patch = self.patch
        epsilon = 1.0
        deepest = np.inf
        stuck = 0
        for _ in range(ROUNDS):
            patch.start = self._settled(self._descended(patch, epsilon), epsilon)
            self._keep(patch.start)
            depth = max(-float(patch.least.min()), 0.0)
            stuck = stuck + 1 if depth > SHALLOWER * deepest else 0
            deepest = min(deepest, depth)
            if self.best.proved == 0 or stuck >= STUCK:
                break
            epsilon = float(np.hypot(1e-6, self.work.share * depth))

    def _descended(self, patch: Patch, epsilon: float, least: float | None = None) -> FloatArray:
        """Return points (k, d) of lower energy; ``least`` is the decrease that ends it."""
        inverse = patch.curvature(epsilon)
        edges = self._edges(patch)

        def decrease() -> float:
            self._progress()
            return least or (DECREASE if patch.least.min() <= 0 else ENOUGH)

        found = descend(
            lambda unknowns: patch.energy(unknowns, epsilon),
            patch.still,
            lambda gradient: np.einsum("bij,bj->bi", inverse, gradient),
            lambda _unknowns, direction: self._longest(patch, edges, direction),
            iterations=ITERATIONS,
            decrease=decrease,
        )
        return patch.points(found)

    def _settled(self, points: FloatArray, epsilon: float) -> FloatArray:
        """Return points (k, d) with sliding nodes on their boundary, and tangents there."""
        freedom = self.patch.freedom
        if freedom.project is None or not len(freedom.curved):
            return points
        points = points.copy()
        points[freedom.curved], maps = freedom.project(freedom.curved, points[freedom.curved])
        self.patch.maps[self.patch.row[freedom.curved]] = maps
        self.patch.start = points
        self.patch.energy(self.patch.still, epsilon)
        if self.patch.least.min() > 0 or not self.moves.any():
            return points
        return self._descended(self._patch(points, self.moves), epsilon)

    def _edges(self, patch: Patch) -> FloatArray:
        """Return the length (s,) of the shortest edge at each node on a curved boundary."""
        out = np.full(len(self.nodes), np.inf)
        for part in self.parts if len(patch.freedom.curved) else ():
            for local in ELEMENTS[part.vtk].edges:
                pair = part.nodes[:, local]
                length = row_norms(patch.start[pair[:, 1]] - patch.start[pair[:, 0]])
                np.minimum.at(out, pair, length[:, None])
        return out[patch.freedom.curved]

    def _longest(self, patch: Patch, edges: FloatArray, direction: FloatArray) -> float:
        """Return the step by which no node on a curved boundary goes further than half an edge."""
        curved = patch.freedom.curved
        way = row_norms(direction[patch.freedom.place[curved]])
        return float(np.min(0.5 * edges[way > 0] / way[way > 0], initial=np.inf))

    def _lift(self) -> None:
        """Lift the worst cells in rounds."""
        patch = self.patch
        work = self.work
        vain = 0
        first = self.best.lowest
        spares = False
        sized = work.reference is not None
        for count in range(1, ROUNDS + 1):
            patch.start = self.best_points
            before = self.best
            beta = np.full(len(self.signs), BETA / before.lowest)
            if spares:
                rated = self.ratings(self.best_points)
                spared = rated >= work.wanted
                beta[spared] = np.maximum(1.0 / work.wanted, BETA / rated[spared])
            inverse = patch.curvature(LIFTED)
            edges = self._edges(patch)

            def longest(_unknowns: FloatArray, direction: FloatArray) -> float:
                self._progress()
                return self._longest(patch, edges, direction)  # noqa: B023

            def raised(unknowns: FloatArray) -> tuple[float, FloatArray]:
                """Return what falls where the worst cells rise, and no edge gets short."""
                cells = self.signs, self.sums, sized, work.metric
                total, slopes = lift_energy(patch, unknowns, *cells, beta)  # noqa: B023
                if np.isfinite(total):
                    energy, pull = patch.energy(unknowns, LIFTED)
                    total = total + SHAPE * energy
                    slopes = slopes + SHAPE * pull
                return total, slopes

            found = descend(
                raised,
                patch.still,
                lambda gradient: np.einsum("bij,bj->bi", inverse, gradient),  # noqa: B023
                longest,
                iterations=LIFTS,
                decrease=lambda: ENOUGH,
            )
            self._keep(self._settled(patch.points(found), LIFTED))
            vain = 0 if self.best.lowest > before.lowest * (1 + GAIN) else vain + 1
            # The lowest quality after all rounds, if it rises as it did so far.
            end = first * (self.best.lowest / first) ** (ROUNDS / count)
            hopeless = count >= TREND and end < work.below
            if not spares and (self.best is before or self.best.fewer < 0):
                spares = True
            elif self.good or vain >= 2 or self.best is before or hopeless:
                break

    def _progress(self) -> None:
        self.round += 1
        self.tell(1 - 0.995**self.round)


def _local_lengths(points: FloatArray, tables: Mapping[int, IntArray]) -> FloatArray:
    """Return the mean length (k,) of the edges at each of the points (k, d) of cells.

    ``tables``: nodes (m, n) of the cells of each type, by VTK identifier.
    """
    total, count = np.zeros((2, len(points)))
    for vtk, table in tables.items():
        for pair in ELEMENTS[vtk].edges:
            ends = table[:, pair]
            length = row_norms(points[ends[:, 1]] - points[ends[:, 0]])
            for end in ends.T:
                total += np.bincount(end, length, len(points))
                count += np.bincount(end, minlength=len(points))
    return total / np.maximum(count, 1)


_H = np.sqrt(3) / 2
_TRIANGLE = np.array([[0, 0], [1, 0], [0.5, _H]])
_SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
IDEAL: dict[int, FloatArray] = {
    5: _TRIANGLE,
    9: _SQUARE,
    10: np.array([*padded(_TRIANGLE), [0.5, _H / 3, np.sqrt(2 / 3)]]),
    12: np.concatenate([lifted(_SQUARE, z) for z in (0, 1)]),
    13: np.concatenate([lifted(_TRIANGLE, z) for z in (0, 1)]),
    14: np.array([*padded(_SQUARE), [0.5, 0.5, np.sqrt(0.5)]]),
}
"""Nodes (n, d) of the ideal cell with edges of length 1, by VTK identifier."""


def lift_energy(
    patch: Patch,
    unknowns: FloatArray,
    signs: Signs,
    sums: FloatArray,
    sized: bool,
    metric: SkewMetric,
    beta: FloatArray,
) -> tuple[float, FloatArray]:
    """Return the lift of a patch, which rises without bound as a cell comes near a limit.

    It is the sum over the cells of Q / (beta - Q), with Q = 1 / quality and beta a little above the
    largest Q, infinity beyond: as the worst-case metric of MFEM's TMOP. And its gradient (b, d).

    ``signs``, ``sums`` (m,): of the patch's cells, in its order, as `reference_of` in
    `slideviz.mesh.orientation` has them. ``sized``: whether the quality compares sizes: whether
    there is an undeformed mesh.
    """
    points = patch.points(unknowns)

    def work(part: Targets, here: slice, whole: slice, slopes: FloatArray) -> None:
        cells = slice(whole.start + here.start, whole.start + here.stop)
        nodes = part.nodes[here]
        turn = signs[cells]
        before = sums[cells]
        size, skew, status = cell_quality(points, part.vtk, nodes, turn, before, metric)
        with np.errstate(all="ignore"):
            inverse = 1.0 / (np.sqrt(size) * skew if sized else skew)
            limit = beta[cells]
            good = (status != INVERTED) & (inverse < limit)
            gap = limit - inverse
            patch.values[cells] = np.where(good, inverse / gap, np.inf)
            powers = np.array(EXPONENTS[metric][part.vtk], float)
            compared = before if sized else np.full(len(nodes), np.inf)
            write_slopes(
                part.vtk, points, nodes, CORNERS[part.vtk], turn, powers, compared, slopes[here]
            )
            slopes[here] *= np.where(good, -limit * inverse / gap**2, 0.0)[:, None, None]

    patch.of_cells(work)
    return float(patch.values.sum()), patch.gathered()
