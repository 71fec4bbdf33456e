"""Relaxation: a few iterations of corotated elasticity after radial basis functions.

Radial functions give the large scales and the boundary; what they leave is local and stiff. The
mesh becomes an elastic body whose undeformed shape is without forces however its cells are turned
(`slideviz.elastic.corotated`), and goes towards its equilibrium by nonlinear conjugate gradients
(Polak and Ribiere), preconditioned by one multigrid cycle (`slideviz.elastic.laplacian`):

    r = -f(x),   p = C r + beta p,   x <- x + alpha s p,   f <- f + alpha (f(x + s p) - f),

with the constant s, and alpha such that the energy is least along p if rotations stay; so one
evaluation of f gives step and next forces. (Where nodes slide on curved boundaries, they are
projected after each step, and f is evaluated there.)

Moving and fixed nodes stay, sliding ones move along their boundary, periodic images as one. A
safeguard goes back, in part, where cells would become worse. Steps alpha and beta, tangents and the
part of the safeguard are choices, so that a frozen step is a chain of forces and linear maps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import block_array, csr_array
from scipy.sparse.csgraph import dijkstra

from slideviz.elastic.conditions import Body, conditions
from slideviz.elastic.corotated import Corotated
from slideviz.elastic.laplacian import LaplacianCycle
from slideviz.elastic.multigrid import MAKING, while_ticking
from slideviz.elastic.stiffness import Conditions
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.jacobians import INVERTED, VALID
from slideviz.mesh.model import FloatArray, IntArray, Mesh, sealed
from slideviz.mesh.quality import Quality, quality
from slideviz.rbf.evaluate import Tick
from slideviz.rbf.operations import difference_from, each_of, points
from slideviz.rbf.problem import PhaseTimer, Problem, Relaxed
from slideviz.rbf.tape import Array, add_at, multiply, put, recorded, take, transform, value
from slideviz.terms import SkewMetric

ITERATIONS = 6  # enough to come to the mean quality of the equilibrium within 0.001 to 0.003

SIZE = 1.5
"""The step, as a part of the direction, at which the energy's slope is found for the best step."""

TRIES = 20
SLOWER = 0.85
"""How often the safeguard changes the parts of the relaxation that it leaves, and how much slower
they grow each time."""

LEAST = 0.2  # a part below this becomes zero where cells are still worse

STRAINS = 0.6, 0.15
"""Along an edge, the part may grow by so much that the edge is strained by this: the first is
better for most meshes, the second for some."""

PARTS = 0.5, 0.25  # parts of the relaxation that are tried everywhere

TINY = 1e-9  # growth along edges of no length, and between periodic images

WORSE = 0.9
ENOUGH = 0.3
"""The lowest quality may become ``WORSE`` times what it was, or ``ENOUGH`` if that is less."""

Constraints = Callable[[FloatArray], tuple[IntArray, FloatArray]]
"""Takes coordinates (n, d); returns sliding nodes (q,) and the directions (q, d) that hold them."""


_MADE: WeakKeyDictionary[Mesh, tuple[Corotated, IntArray, np.ndarray, LaplacianCycle]]
_MADE = WeakKeyDictionary()
"""Of each mesh its forces, and the last preconditioner with the conditions that it was made for:
the unknowns (n,) of the nodes, and which of their components are held, (k, d)."""


@dataclass(frozen=True, eq=False)
class Relaxation:
    """The relaxation of deformed meshes."""

    mesh: Mesh  # undeformed, with its halo
    domain: Mesh  # undeformed, without the halo
    body: Body
    metric: SkewMetric  # of the quality that the safeguard keeps

    def relaxed(
        self,
        problem: Problem,
        displacement: Array,
        rigid: IntArray,
        constraints: Constraints,
        tie: Callable[[Array], Array],
        timer: PhaseTimer,
    ) -> tuple[Array, Relaxed | None]:
        """Return the displacement (..., n, d) of a step after relaxation, in the frame.

        And how it went; None for a mesh at rest, and one without nodes that could move.
        ``displacement`` (..., n, d): of the step, as radial functions have it.
        ``rigid`` (r,): nodes that stay where they are, besides the known ones.
        ``tie``: gives periodic images the displacement of the node that represents them.
        """
        if problem.frozen is None and not value(displacement).any():
            return displacement, None  # at rest, where rounding is all that would move
        with timer.phase("relax") as tick:
            at = value(problem.coords) + value(displacement)
            held = np.concatenate([problem.known, rigid])
            given: Conditions = problem.choose(
                "conditions", lambda: self._conditions(problem, at, held, constraints)
            )
            if not len(given.free):
                return displacement, None
            start = self.body.frame.coords(self.mesh.points)
            free = self._conditions(problem, start, held, constraints).free
            body = self._prepared(problem, given.place, free, tick)
            moved, residual = self._iterated(problem, displacement, *body, given, tie, tick)
            theta: FloatArray = problem.choose(
                "theta", lambda: self._kept_part(problem, displacement, moved, tie)
            )
            out = blended(problem, displacement, moved, theta, tie)
        limited = int(np.count_nonzero(theta[given.place >= 0] < 1.0))
        return out, Relaxed(ITERATIONS, residual, float(theta.min()), limited)

    def _conditions(
        self, problem: Problem, at: FloatArray, held: IntArray, constraints: Constraints
    ) -> Conditions:
        """Return the conditions of the body at coordinates (n, d) if nodes ``held`` stay."""
        nodes, normals = constraints(at)
        there = replace(problem, coords=at, normal_nodes=nodes, normals=normals)
        return conditions(there, self.body, held, np.zeros((len(held), at.shape[1])))

    def _prepared(
        self, problem: Problem, place: IntArray, free: FloatArray, tick: Tick
    ) -> tuple[Corotated, LaplacianCycle]:
        """Return the forces of this mesh and the preconditioner for these conditions.

        ``place`` (n,) and ``free`` (k, d, d) are those of undeformed conditions.
        """
        x = self.mesh.points
        frame = self.body.frame
        made = _MADE.get(self.mesh)
        axes = np.eye(x.shape[1])
        if frame.cylindrical:
            start = frame.coords(x)
            owner = np.zeros(len(free), np.int64)
            owner[place[place >= 0]] = problem.same_as[place >= 0]
            each = [frame.turned_back(start[owner], np.tile(row, (len(free), 1))) for row in axes]
            axes = np.stack(each, axis=2)
        held = _held(axes @ free @ np.swapaxes(axes, -1, -2))
        wanted = place, held, axes
        if made is None or not all(map(np.array_equal, (*made[1:3], made[3].axes), wanted)):
            forces = Corotated.of(x, self.body.parts) if made is None else made[0]
            cycle = while_ticking(partial(LaplacianCycle.of, forces, *wanted), tick)
            made = _MADE[self.mesh] = forces, place, held, cycle
        return made[0], made[3]

    def _iterated(
        self,
        problem: Problem,
        moved: Array,
        forces: Corotated,
        cycle: LaplacianCycle,
        given: Conditions,
        tie: Callable[[Array], Array],
        tick: Tick,
    ) -> tuple[Array, float]:
        """Return the relaxed displacement, and the last residual over the first."""
        frame = self.body.frame
        unknowns = _Unknowns.of(given)
        start = points(frame, problem.coords + moved)
        at = start
        force = unknowns.collected(_force(forces, start))
        along: Array = np.zeros_like(value(force))
        before = value(force)
        energies = list[float]()
        for k in range(ITERATIONS):
            tick(MAKING + (1.0 - MAKING) * k / (ITERATIONS + 1))
            steep = unknowns.within(_preconditioned(cycle, -force))
            energies.append(-_inner(force, steep))
            if k:
                last = max(energies[-2], 1e-300)
                turned = max(0.0, (energies[-1] + _inner(before, steep)) / last)
                steep = steep + multiply(along, problem.choose(f"beta {k}", partial(_one, turned)))
            along = steep
            before = value(force)
            step = unknowns.moved(along * SIZE)
            there = unknowns.collected(_force(forces, at + step))
            size = partial(_size, _inner(along, force), _inner(along, there))
            part = problem.choose(f"alpha {k}", size)
            if problem.curved:
                moved = moved + difference_from(frame, at, multiply(step, part))
                moved = _slid(problem, moved, tie)
                at = points(frame, problem.coords + moved)
                force = unknowns.collected(_force(forces, at))
            else:
                at = at + multiply(step, part)
                force = force + multiply(there - force, part)
        if not problem.curved:
            moved = _slid(problem, moved + difference_from(frame, start, at - start), tie)
        residual = float(np.sqrt(max(0.0, energies[-1]) / max(energies[0], 1e-300)))
        return moved, residual

    def _kept_part(
        self, problem: Problem, before: Array, after: Array, tie: Callable[[Array], Array]
    ) -> FloatArray:
        """Return the parts (n, 1) of the relaxation that make no cell worse.

        All of it if possible. Else the one with the best mean of `PARTS` of it everywhere, and of
        parts that are smaller near the cells that would be worse; zero if none is better.
        """
        first = self._quality(problem, before)
        n = len(self.mesh.points)

        def tried(theta: FloatArray) -> tuple[np.ndarray, float]:
            now = self._quality(problem, blended(problem, before, after, theta, tie))
            return np.flatnonzero(spoiled(first, now)), now.mean

        found = [(first.mean, np.zeros((n, 1)))]
        bad, mean = tried(np.ones((n, 1)))
        if not len(bad):
            return np.full((n, 1), float(mean >= first.mean))
        graph = self._graph(problem, value(before), value(after))
        for part in PARTS:
            worse, mean = tried(np.full((n, 1), part))
            if not len(worse):
                found.append((mean, np.full((n, 1), part)))
        for strain in STRAINS:
            found += self._held_back(graph, strain, bad, tried)
        return max(found, key=lambda each: each[0])[1]

    def _held_back(
        self,
        graph: csr_array,
        strain: float,
        bad: np.ndarray,
        tried: Callable[[FloatArray], tuple[np.ndarray, float]],
    ) -> Iterator[tuple[float, FloatArray]]:
        """Yield the mean quality, and the parts (n, 1) that make no cell worse; nothing if none do.

        At worse cells (``bad``; ``tried`` returns those of a part, and the mean) the part is
        halved, up to zero, and grows from there as far as that strains cells by ``strain``.
        """
        theta = np.ones(graph.shape[0])
        cap = np.full(graph.shape[0], np.inf)
        for k in range(1, TRIES):
            nodes = np.unique(self.domain.cells.take(bad).nodes)
            cap[nodes] = np.where(theta[nodes] > LEAST, 0.5 * theta[nodes], 0.0)
            apart = SLOWER**k * np.clip(strain * graph.data, TINY, 2.0)
            theta = _grown(csr_array((apart, graph.indices, graph.indptr), graph.shape), cap)
            bad, mean = tried(theta[:, None])
            if not len(bad):
                yield mean, theta[:, None]
                return

    def _graph(self, problem: Problem, before: FloatArray, after: FloatArray) -> csr_array:
        """Return the length of each edge of the mesh over how far its nodes are relaxed, (n, n)."""
        frame = self.body.frame
        n = len(self.mesh.points)
        coords = value(problem.coords)
        shift = frame.points(coords + after) - frame.points(coords + before)
        size = np.linalg.norm(shift, axis=1)
        pairs = [
            nodes[:, ELEMENTS[vtk].edges].reshape(-1, 2)
            for vtk, (_, nodes) in self.domain.cells.by_type.items()
        ]
        low, high = np.sort(np.concatenate(pairs), axis=1).T
        ends = np.stack(np.divmod(np.unique(low * n + high), n), axis=1)
        length = np.linalg.norm(np.diff(self.mesh.points[ends], axis=1)[:, 0], axis=1)
        far = np.maximum(size[ends].max(axis=1), TINY * length + 1e-300)
        images = np.flatnonzero(problem.same_as != np.arange(n))
        rows = np.concatenate([ends[:, 0], images])
        columns = np.concatenate([ends[:, 1], problem.same_as[images]])
        apart = np.concatenate([length / far, np.zeros(len(images))])
        return csr_array((apart, (rows, columns)), shape=(n, n))

    def _quality(self, problem: Problem, displacement: Array) -> Quality:
        at = self.body.frame.points(value(problem.coords) + value(displacement))
        return quality(self.domain.with_points(sealed(at)), self.domain, self.metric)


def _grown(graph: csr_array, cap: FloatArray) -> FloatArray:
    """Return the largest parts (n,), up to 1, below ``cap`` (n,) that grow as the graph allows."""
    rows = np.flatnonzero(np.isfinite(cap))
    n = len(cap)
    to = csr_array((np.maximum(cap[rows], TINY), (np.zeros(len(rows), int), rows)), shape=(1, n))
    whole = csr_array(block_array([[graph, None], [to, csr_array((1, 1))]], format="csr"))
    far = dijkstra(whole, directed=False, indices=np.array([n]), limit=1.0)[0, :n]  # type: ignore[arg-type]
    return np.where(far > LEAST / 4, np.minimum(far, 1.0), 0.0)


def blended(
    problem: Problem, before: Array, after: Array, theta: FloatArray, tie: Callable[[Array], Array]
) -> Array:
    """Return the displacement that is the parts (n, 1) of the way from ``before`` to ``after``."""
    if (theta == 1.0).all() or (theta == 0.0).all():
        return after if theta.all() else before
    return _slid(problem, before + multiply(after - before, theta), tie)


def spoiled(before: Quality, after: Quality) -> np.ndarray:
    """Return which cells (c,) are worse than before by the rules of the safeguard.

    They are inverted or unproved and were not, or their quality is below `WORSE` times the lowest
    before, and `ENOUGH`.
    """
    low = min(WORSE * before.min, ENOUGH)
    bad = (after.status != VALID) & (before.status == VALID)
    bad |= (after.status == INVERTED) & (before.status != INVERTED)
    return np.asarray(bad | (after.values < low))


def _held(free: FloatArray) -> np.ndarray:
    """Return which components (k, d) stay zero where unknowns are free as projections (k, d, d).

    As many as are not free, those along which an unknown moves least.
    """
    along = np.einsum("kii->ki", free)
    count = np.rint(along.sum(axis=1)).astype(int)
    rank = np.argsort(np.argsort(-along, axis=1, kind="stable"), axis=1, kind="stable")
    return np.asarray(rank >= count[:, None])


def _slid(problem: Problem, displacement: Array, tie: Callable[[Array], Array]) -> Array:
    """Return the displacement with sliding nodes on their boundary."""
    sliding = np.concatenate([problem.edge, problem.surface])
    if not len(sliding):
        return tie(displacement)
    on = problem.project(sliding, take(displacement, sliding))
    return tie(put(displacement, sliding, on))


def _force(forces: Corotated, at: Array) -> Array:
    """Return the forces (n, d) on all nodes."""
    x = value(at)
    turns = forces.rotations(x)
    return recorded(
        forces.forces(x, turns),
        (
            at,
            partial(each_of, lambda t: forces.pushed(x, t, turns)),
            partial(each_of, lambda g: forces.pulled(x, g, turns)),
        ),
    )


def _preconditioned(cycle: LaplacianCycle, right: Array) -> Array:
    apply = partial(each_of, cycle)
    return recorded(apply(value(right)), (right, apply, apply))


def _inner(a: Array, b: Array) -> float:
    """Return the sum of all products, with the same bits for any number of threads."""
    return float((value(a) * value(b)).sum())


def _one(number: float) -> FloatArray:
    return np.array([[number]])


def _size(slope: float, there: float) -> FloatArray:
    """Return the part of a step to the least energy, whose slope is as given before and after it.

    (1, 1); all of it where the energy is not convex along the step.
    """
    return _one(slope / (slope - there) if slope < min(there, 0.0) else 1.0)


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """Maps between unknowns (k, d) and vectors of nodes (n, d), as conditions have them."""

    conditions: Conditions
    inside: IntArray  # nodes with unknowns
    owner: IntArray  # (k,): a node of each block of unknowns
    others: IntArray  # further nodes with the same unknowns as another
    turned: IntArray
    held: IntArray
    """`turned`, `held`: nodes whose displacement is not just their unknowns, and blocks that are
    not free in all directions."""

    @classmethod
    def of(cls, given: Conditions) -> _Unknowns:
        inside = np.flatnonzero(given.place >= 0)
        owner = np.zeros(len(given.free), np.int64)
        owner[given.place[inside[::-1]]] = inside[::-1]
        others = inside[owner[given.place[inside]] != inside]
        plain = np.all(given.free == np.eye(given.free.shape[1]), axis=(1, 2))
        turned = inside[~given.plain[inside]]
        return cls(given, inside, owner, others, turned, np.flatnonzero(~plain))

    def within(self, unknown: Array) -> Array:
        """Return unknowns (k, d) without their part in directions that are held."""
        free = transform(self.conditions.free[self.held], take(unknown, self.held))
        return put(unknown, self.held, free)

    def moved(self, unknown: Array) -> Array:
        """Return the Cartesian displacement (n, d) of unknowns (k, d); zero for known nodes."""
        given = self.conditions
        nothing = np.zeros_like(given.known)
        out = put(nothing, self.inside, take(unknown, given.place[self.inside]), overwrite=True)
        return put(out, self.turned, transform(given.turn[self.turned], take(out, self.turned)))

    def collected(self, forces: Array) -> Array:
        """Return the forces (k, d) on the unknowns, of forces (n, d) on nodes."""
        given = self.conditions
        back = np.swapaxes(given.turn[self.turned], 1, 2)
        forces = put(forces, self.turned, transform(back, take(forces, self.turned)))
        return add_at(take(forces, self.owner), given.place[self.others], take(forces, self.others))
