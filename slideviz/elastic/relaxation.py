"""Relaxation: the mesh goes to the least distortion energy, from what radial functions give.

Radial functions give the large scales and the boundary; what they leave is local and stiff. The
energy (`slideviz.elastic.distortion`) is zero for cells that are only turned, and infinite where
one folds; L-BFGS minimises it, preconditioned by one multigrid cycle of the undeformed Laplacian
(`slideviz.elastic.laplacian`). Moving and fixed nodes stay, sliding ones move along their boundary
(projected after each step, where it is curved), periodic images move as one.

Derivatives are those of the minimum, whatever way led to it: where the gradient g(x) of the
unknowns vanishes, a change t of the start, of which the unknowns keep nothing, changes x by

    t - T (T' H T)^-1 T' H t,

with the Hessian H and the maps T from unknowns to nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.elastic.conditions import Body, HeldRows, held_rows, projections, unknowns
from slideviz.elastic.distortion import WORST, Distortion
from slideviz.elastic.laplacian import LaplacianCycle, held_components
from slideviz.elastic.linear_systems import MAKING, while_ticking
from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.repair.descent import Function, Memory, dot, line_search
from slideviz.rbf.evaluate import Tick
from slideviz.rbf.operations import difference_from, each_of, points
from slideviz.rbf.problem import PhaseTimer, Problem, Relaxed
from slideviz.rbf.tape import Array, multiply, put, recorded, take, value

WINDOW = 3
NEAR = 0.25

SOON = 0.05
SMALL = 10_000
RESIDUAL = 1.3e-2
LOOSE = 0.1
"""The residual at which L-BFGS ends: its square is the part of the energy that an iteration takes
away, the mean over the last `WINDOW`. `SOON`: where derivatives are wanted, for which Newton's
method goes on. `RESIDUAL`: that of meshes of up to `SMALL` cells, where it goes on as well, if not
as far. That of others grows with the root of their number up to `LOOSE`, since the time grows, and
what could be gained concerns fewer and fewer of them. `NEAR`: the one at which the term for the
worst cells joins."""

SURE = 0.1
"""An iteration that promises to take away less than this part of that is the last one."""

NEWTON = 100
SEEN = 1e-6
"""Most steps of Newton's method, and the step, as a part of the extent, from which on energies
differ by more than rounding, so that the step is searched."""


@frozen
class End:
    """Where Newton's method ends."""

    still: float  # how far nodes may be from the least energy, as a part of the extent
    products: int  # most products with the Hessian of one step
    gives_up: bool  # whether it ends where a step is not found in these, with long thin cells


ALIKE = End(3e-11, 100, gives_up=True)
EXACT = End(1e-14, 300, gives_up=False)
"""Of a run, whose result is the same in other axes or numbers, and where derivatives are wanted."""

BEND = 1e-6  # step, as a part of the extent, by which changes of walls are found

FORCING = 0.03
SHARP = 1e-3
"""Largest and smallest residual of its linear systems."""

PAIRS = 6  # of steps and changes of the gradient that are remembered

ITERATIONS = 300
UNFOLDING = 40
"""Most iterations, and most of them with one regularisation of folded cells."""

ROUNDS = 10  # most regularisations

AT_REST = 1e-14  # energy of a cell that counts as nothing: rounding is a hundredth of it

SOLVED = 1e-13
PRODUCTS = 5000
"""Residual of the linear systems of derivatives, and most products with the Hessian."""

Constraints = Callable[[FloatArray], tuple[IntArray, FloatArray]]
"""Takes coordinates (n, d); returns sliding nodes (q,) and the directions (q, d) that hold them."""

Projection = Callable[[FloatArray, IntArray, FloatArray], FloatArray]
"""Takes coordinates (n, d), sliding nodes (m,) and their displacements (m, d) in the frame; returns
the displacements (m, d) with which they are on their boundary."""


@record
class Walls:
    """The boundaries on which nodes slide."""

    constraints: Constraints
    project: Projection


@record
class FlatWalls:
    """Planes and lines, one for each sliding node: a `Projection`."""

    anchor: FloatArray  # (m, d): a point of each, in the frame
    matrix: FloatArray  # (m, d, d): the projections on their directions

    def __call__(self, coords: FloatArray, nodes: IntArray, free: FloatArray) -> FloatArray:
        """Return the displacements (m, d) of all sliding nodes on their walls."""
        away = coords[nodes] + free - self.anchor
        return self.anchor + np.einsum("mij,mj->mi", self.matrix, away) - coords[nodes]


@record
class _Prepared:
    """What is kept of a mesh: its energy, and its last preconditioner."""

    energy: Distortion
    wanted: tuple[IntArray, np.ndarray, FloatArray]
    """The conditions that the preconditioner was made for: the unknowns (n,) of the nodes, which of
    their components are held, (k, d), and their axes."""
    cycle: LaplacianCycle


_MADE: WeakKeyDictionary[Mesh, _Prepared] = WeakKeyDictionary()


@record
class Relaxation:
    """The relaxation of deformed meshes."""

    mesh: Mesh  # undeformed, with its halo
    domain: Mesh  # undeformed, without the halo
    body: Body
    converged: bool = False
    """Whether it goes on until only rounding is left, as derivatives need it."""

    def relaxed(
        self,
        problem: Problem,
        displacement: Array,
        rigid: IntArray,
        constraints: Constraints,
        project: Projection,
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
            if self.body.axis.any():
                off_axis = np.ones(self.mesh.points.shape)
                off_axis[self.body.axis, :2] = 0.0
                displacement = multiply(displacement, off_axis)
            held = np.concatenate([problem.known, rigid])
            walls = Walls(constraints, project)
            unknowns = Unknowns.of(problem, self.body, held)
            if not len(unknowns.owner):
                return displacement, None
            made = self._prepared(unknowns, constraints, tick)

            def way_on(walls: Walls) -> _Way:
                return _Way(self, problem, value(displacement), made, unknowns, walls)

            if self.converged and problem.curved:
                walls = problem.choose("walls", lambda: way_on(walls).frozen_walls(tick))
            way = way_on(walls)
            if self.converged:
                way.go(tick, SOON)
                way.finish(EXACT)
            else:
                size = max(1.0, made.energy.count / SMALL)
                unfolded = way.go(tick, min(RESIDUAL * np.sqrt(size), LOOSE))
                if unfolded and size == 1.0:
                    way.finish(ALIKE)
            start = points(self.body.frame, problem.coords + displacement)
            end = recorded(
                way.x,
                (start, partial(each_of, way.pushed), partial(each_of, way.pulled)),
            )
            moved = displacement + difference_from(self.body.frame, start, end - start)
            moved = tie(moved) if way.curved else _slid(problem, moved, tie)
            return moved, Relaxed(way.iterations, way.residual)

    def _prepared(self, unknowns: Unknowns, constraints: Constraints, tick: Tick) -> _Prepared:
        """Return the energy of this mesh, and the preconditioner for undeformed conditions."""
        x = self.mesh.points
        frame = self.body.frame
        start = frame.coords(x)
        undeformed = unknowns.on(constraints, start)
        axes = np.eye(x.shape[1])
        if frame.cylindrical:
            shape = len(unknowns.owner), 1
            at = start[unknowns.owner]
            axes = np.stack([frame.turned_back(at, np.tile(row, shape)) for row in axes], axis=2)
        wanted = unknowns.place, _held(axes, undeformed), axes
        made = _MADE.get(self.mesh)
        if made is not None and all(map(np.array_equal, made.wanted, wanted)):
            return made
        energy = Distortion.of(x, self.domain.cells) if made is None else made.energy
        cycle = while_ticking(partial(LaplacianCycle.of, energy, *wanted), tick)
        made = _MADE[self.mesh] = _Prepared(energy, wanted, cycle)
        return made


class _Way:
    """The way of a mesh to its least energy, with the derivative of where it ends."""

    def __init__(
        self,
        relaxation: Relaxation,
        problem: Problem,
        displacement: FloatArray,
        made: _Prepared,
        unknowns: Unknowns,
        walls: Walls,
    ) -> None:
        self._frame = relaxation.body.frame
        self._energy = made.energy
        self._cycle = made.cycle
        self._wanted = made.wanted
        self._walls = walls
        self._extent = relaxation.mesh.extent
        self._sliding = np.concatenate([problem.edge, problem.surface])
        self._coords = value(problem.coords)
        self._at = self._coords + displacement  # of sliding nodes as they are, of others at first
        self._begin = self._frame.points(self._at)
        self._start = displacement
        self._unknowns = unknowns.on(walls.constraints, self._at)
        self.curved = len(self._sliding) > 0 and (problem.curved or self._frame.cylindrical)
        self._slid, self._leader = _copies(problem, self._sliding)
        self._bends: FloatArray | None = None
        self.x = self._begin  # (n, d): Cartesian positions
        self.iterations = 0
        self.residual = 0.0

    def go(self, tick: Tick, residual: float) -> bool:
        """Go near the least energy, with regularisation as long as corners are folded.

        Return whether none is.
        """
        memory = Memory(
            len(self._unknowns.owner) * self.x.shape[1], self._preconditioned, PAIRS, np.float32
        )
        least = self._energy.slopes(self.x, 0.0, 1.0)[2]
        folded = np.count_nonzero(least <= 0.0)
        for _ in range(ROUNDS):
            if least.min() > 0.0:
                break
            epsilon = float(np.hypot(1e-6, 0.2 * least.min()))
            self._descend(memory, tick, residual, 0.0, epsilon)
            least = self._energy.slopes(self.x, 0.0, epsilon)[2]
        if least.min() > 0.0:
            self._descend(memory, tick, NEAR, 0.0)
            self._descend(memory, tick, residual, WORST)
            return True
        self.residual = 1.0
        if np.count_nonzero(least <= 0.0) > folded:
            self._go_to(self._begin)
        return False

    def frozen_walls(self, tick: Tick) -> Walls:
        """Return the walls of sliding nodes, flat as they are where these come to lie."""
        self.go(tick, SOON)
        self.finish(EXACT)
        nodes = self._sliding
        end = self._coords_of(self.x, nodes) - self._coords[nodes]
        d = end.shape[1]
        length = BEND * self._extent
        matrix = np.empty((len(nodes), d, d))
        for axis in range(d):
            by = length * np.eye(d)[axis]
            ahead = self._walls.project(self._coords, nodes, end + by)
            behind = self._walls.project(self._coords, nodes, end - by)
            matrix[:, :, axis] = (ahead - behind) / (2.0 * length)
        size, vectors = np.linalg.eigh(0.5 * (matrix + np.swapaxes(matrix, 1, 2)))
        free = np.where(size[:, None, :] > 0.5, vectors, 0.0)
        row, column = np.nonzero(size <= 0.5)
        others, normals = self._walls.constraints(self._at)
        more = ~np.isin(others, nodes)
        rows = (
            np.concatenate([nodes[row], others[more]]),
            np.concatenate([vectors[row, :, column], normals[more]]),
        )
        anchor = self._coords[nodes] + end
        return Walls(lambda _: rows, FlatWalls(anchor, free @ np.swapaxes(free, 1, 2)))

    def finish(self, end: End) -> None:
        """Go on by Newton's method, until all nodes are where ``end`` has them."""
        before = 0.0
        last = np.inf
        left = 1.0
        for _ in range(NEWTON):
            if left == 1.0:
                self._cycle = LaplacianCycle.of(
                    self._energy, *self._wanted, self._energy.stiffness(self.x)
                )
            along = self._function(WORST, 0.0)
            nothing = np.zeros((len(self._unknowns.owner), self.x.shape[1]))
            now, gradient = along(nothing)
            step, size, left = self._solved(-gradient, end.products, before)
            found_all = left < 1.0
            farthest = float(np.abs(self._unknowns.moved(step)).max())
            slope = dot(gradient.ravel(), step.ravel())
            if farthest > SEEN * self._extent:
                found = line_search(along, nothing, now, step, slope, 1.0)
                if found is None:
                    break
                step *= found[0]
                left = left if found[0] == 1.0 else 1.0
            self._go_to(self._placed(self.x + self._unknowns.moved(step)))
            self.iterations += 1
            if farthest * max(left, farthest / last) <= end.still * self._extent:
                nothing_left = AT_REST * self._energy.count
                self.residual = float(np.sqrt(max(-slope, 0.0) / max(now, nothing_left)))
                break
            if end.gives_up and not found_all:
                break
            before = size
            last = farthest

    def _function(self, worst: float, epsilon: float) -> Function:
        """Return the energy and its slopes by the unknowns, after a step of these (k, d)."""

        def along(step: FloatArray) -> tuple[float, FloatArray]:
            there = self._placed(self.x + self._unknowns.moved(step))
            energy, slopes, _ = self._energy.slopes(there, worst, epsilon)
            return energy, self._unknowns.collected(slopes)

        return along

    def _go_to(self, x: FloatArray) -> None:
        """Take positions (n, d), and the directions in which nodes slide there."""
        self.x = x
        self._bends = None
        if self.curved:
            self._unknowns = self._unknowns_at(x)

    def _unknowns_at(self, x: FloatArray) -> Unknowns:
        self._at[self._slid] = self._coords_of(x, self._slid)
        return self._unknowns.on(self._walls.constraints, self._at)

    def _coords_of(self, x: FloatArray, nodes: IntArray) -> FloatArray:
        """Return the coordinates (m, d) of nodes (m,) at positions x (n, d)."""
        begin = self._begin[nodes]
        by = self._frame.difference(begin, x[nodes] - begin)
        return self._coords[nodes] + self._start[nodes] + by

    def _descend(
        self,
        memory: Memory,
        tick: Tick,
        residual: float,
        worst: float,
        epsilon: float = 0.0,
    ) -> None:
        """Minimise the energy with one ``worst`` (kappa) and one regularisation of folded cells."""
        now, slopes, _ = self._energy.slopes(self.x, worst, epsilon)
        gradient = self._unknowns.collected(slopes)
        memory.clear()
        along = self._function(worst, epsilon)
        nothing = AT_REST * self._energy.count
        values = [now]
        for k in range(UNFOLDING if epsilon else ITERATIONS):
            tick(MAKING + (1.0 - MAKING) * k / (k + 10.0))
            direction = -memory.inverse_times(gradient)
            gain = -dot(gradient.ravel(), direction.ravel())
            lately = values[-1 - WINDOW] - now if len(values) > WINDOW else np.inf
            left = min(gain / SURE, lately / WINDOW)
            self.residual = float(np.sqrt(max(left, 0.0) / max(now, nothing)))
            if self.residual <= residual:
                break
            if gain > 2.0 * now:  # half of it is expected: more than all the energy
                direction *= 2.0 * now / gain
                gain = 2.0 * now
            found = line_search(along, np.zeros_like(direction), now, direction, -gain, np.inf)
            if found is None:
                break
            length, now, slopes = found
            values.append(now)
            step = length * direction
            self._go_to(self._placed(self.x + self._unknowns.moved(step)))
            if self.curved:
                slopes = self._unknowns.within(slopes)
            memory.add(step, slopes - gradient, slopes)
            gradient = slopes
            self.iterations += 1

    def _placed(self, x: FloatArray) -> FloatArray:
        """Return positions (n, d), written over, with sliding nodes on their curved boundary."""
        if self.curved:
            nodes = self._sliding
            by = self._coords_of(x, nodes) - self._coords[nodes]
            on = self._walls.project(self._coords, nodes, by)
            x[self._slid] = self._frame.points(self._coords[self._slid] + on[self._leader])
        return x

    def _preconditioned(self, gradient: FloatArray) -> FloatArray:
        within = self._unknowns.within
        return within(self._cycle(within(gradient)))

    def pushed(self, t: FloatArray) -> FloatArray:
        """Return how positions at the least energy change as those at the start do by t (n, d)."""
        known = np.where(self._unknowns.place[:, None] < 0, t, 0.0)
        right = self._unknowns.collected(self._energy.product(self.x, known))
        return known - self._unknowns.moved(self._solved(right)[0])

    def pulled(self, g: FloatArray) -> FloatArray:
        """Return the transpose of `pushed`, times g (n, d)."""
        left = self._unknowns.moved(self._solved(self._unknowns.collected(g))[0])
        out = g - self._energy.product(self.x, left)
        return np.where(self._unknowns.place[:, None] < 0, out, 0.0)

    def _bent(self) -> FloatArray:
        """Return how the slopes change as unknowns move along curved boundaries, (k, d, d).

        With the projection P on the free directions of an unknown, which changes with its position,
        and the gradient g, that is P dP g, by central differences.
        """
        count = len(self._unknowns.owner)
        d = self.x.shape[1]
        out = np.zeros((count, d, d))
        if not self.curved:
            return out
        slopes = self._energy.slopes(self.x)[1]
        length = BEND * self._extent
        for axis in range(d):
            along = self._unknowns.moved(np.tile(length * np.eye(d)[axis], (count, 1)))
            ahead = self._unknowns_at(self.x + along).collected(slopes)
            behind = self._unknowns_at(self.x - along).collected(slopes)
            out[:, :, axis] = self._unknowns.within((ahead - behind) / (2.0 * length))
        return out

    def _hessian(self, step: FloatArray) -> FloatArray:
        """Return the Hessian of the unknowns times a step (k, d)."""
        if self._bends is None:
            self._bends = self._bent()
        change = self._unknowns.collected(self._energy.product(self.x, self._unknowns.moved(step)))
        return change + np.einsum("kij,kj->ki", self._bends, self._unknowns.within(step))

    def _solved(
        self, right: FloatArray, most: int = PRODUCTS, before: float | None = None
    ) -> tuple[FloatArray, float, float]:
        """Return the solution (k, d) of the Hessian of the unknowns, by conjugate gradients.

        And the size of the right-hand side, and the part of it that is left. ``before``, of a step
        of Newton's method: the size at the step before, or 0. The nearer the least energy, the less
        is left (Eisenstat and Walker 1996); and it ends where the energy is not convex (Steihaug
        1983). ``most``: products with the Hessian.
        """
        found = np.zeros_like(right)
        left = right.copy()
        steep = self._preconditioned(left)
        along = steep
        size = dot(left.ravel(), steep.ravel())
        first = size
        newton = before is not None
        goal = SOLVED
        if before is not None:
            goal = float(np.clip(first / before if before else 1.0, SHARP, FORCING))
        for _ in range(most):
            if size <= goal**2 * first:
                return found, first, goal
            change = self._hessian(along)
            curvature = dot(along.ravel(), change.ravel())
            if not np.isfinite(curvature):  # of a cell that is folded still
                break
            if curvature <= 0.0 and newton:
                return found if found.any() else along, first, 1.0
            length = size / curvature
            found += length * along
            left -= length * change
            steep = self._preconditioned(left)
            after = dot(left.ravel(), steep.ravel())
            along = steep + after / size * along
            size = after
        if newton:
            return found, first, 1.0
        raise DeformError(
            "the relaxed mesh does not converge to where its energy is least, which derivatives "
            "need; use a smaller motion, or RELAX= NO"
        )


def _held(axes: FloatArray, unknowns: Unknowns) -> np.ndarray:
    """Return which components (k, d), along ``axes`` (d, d) or (k, d, d), stay zero."""
    out = np.zeros((len(unknowns.owner), axes.shape[-1]), bool)
    axes = axes[unknowns.blocks] if axes.ndim == 3 else axes
    out[unknowns.blocks] = held_components(axes, unknowns.free)
    return out


def _copies(problem: Problem, nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Return the nodes (m,) that coincide with nodes (q,) or are their images, and which (m,)."""
    row = np.full(len(problem.same_as), -1)
    row[problem.same_as[nodes]] = np.arange(len(nodes))
    leader = row[problem.same_as]
    copies = np.flatnonzero(leader >= 0)
    return copies, leader[copies]


def _slid(problem: Problem, displacement: Array, tie: Callable[[Array], Array]) -> Array:
    """Return the displacement with sliding nodes on their boundary."""
    sliding = np.concatenate([problem.edge, problem.surface])
    if not len(sliding):
        return tie(displacement)
    on = problem.project(sliding, take(displacement, sliding))
    return tie(put(displacement, sliding, on))


@record
class Unknowns:
    """Maps between unknowns (k, d) and vectors of nodes (n, d).

    Each block of unknowns is the displacement of a node; those that coincide with it, and periodic
    images, have the same one, turned.
    """

    problem: Problem
    body: Body
    place: IntArray  # (n,): number of each node's block; -1 for known nodes
    known: IntArray  # nodes without unknowns
    owner: IntArray  # (k,): the node of each block
    others: IntArray  # further nodes with the block of another
    turned: IntArray
    turn: FloatArray  # `turned`, `turn` (t,), (t, d, d): nodes that are turned, and how
    rows: HeldRows
    blocks: IntArray
    free: FloatArray
    """`blocks`, `free` (h,), (h, d, d): those that are not free in all directions, and the
    projections on the directions in which they are."""

    @classmethod
    def of(cls, problem: Problem, body: Body, held: IntArray) -> Unknowns:
        """Return the unknowns where nodes ``held`` (m,) stay, all of them free."""
        place, turn = unknowns(problem, body, np.unique(problem.same_as[held]))
        known = np.flatnonzero(place < 0)
        inside = np.flatnonzero(place >= 0)
        owner = np.zeros(int(place.max(initial=-1)) + 1, np.int64)
        owner[place[inside[::-1]]] = inside[::-1]
        others = inside[owner[place[inside]] != inside]
        turned = inside[~np.all(turn[inside] == np.eye(turn.shape[1]), axis=(1, 2))]
        rows = held_rows(problem, body, place)
        none = np.empty(0, np.int64)
        return cls(
            problem, body, place, known, owner, others, turned, turn[turned], rows, none, turn[:0]
        )

    def on(self, constraints: Constraints, at: FloatArray) -> Unknowns:
        """Return the unknowns of sliding nodes at coordinates (n, d)."""
        nodes, normals = constraints(at)
        there = replace(self.problem, coords=at, normal_nodes=nodes, normals=normals)
        rows = self.rows
        if not np.array_equal(nodes, self.problem.normal_nodes):
            rows = held_rows(there, self.body, self.place)
        blocks, free = projections(there, self.body, rows)
        return replace(self, problem=there, rows=rows, blocks=blocks, free=free)

    def maps(self, nodes: IntArray) -> FloatArray:
        """Return the maps (m, d, d) from their blocks to the displacements of nodes (m,)."""
        d = self.turn.shape[1]
        out = np.tile(np.eye(d), (len(nodes), 1, 1))
        turned = np.isin(nodes, self.turned)
        out[turned] = self.turn[np.searchsorted(self.turned, nodes[turned])]
        bound = np.isin(self.place[nodes], self.blocks)
        out[bound] @= self.free[np.searchsorted(self.blocks, self.place[nodes[bound]])]
        return out

    def within(self, unknown: FloatArray) -> FloatArray:
        """Return unknowns (k, d) without their part in directions that are held."""
        out = unknown.copy()
        out[self.blocks] = np.einsum("kij,kj->ki", self.free, unknown[self.blocks])
        return out

    def moved(self, unknown: FloatArray) -> FloatArray:
        """Return the Cartesian displacement (n, d) of unknowns (k, d); zero for known nodes."""
        out = self.within(unknown)[self.place]
        out[self.known] = 0.0
        out[self.turned] = np.einsum("nij,nj->ni", self.turn, out[self.turned])
        return out

    def collected(self, slopes: FloatArray) -> FloatArray:
        """Return the slopes (k, d) by the unknowns, of slopes (n, d) by the nodes."""
        own = slopes
        if len(self.turned):
            own = slopes.copy()
            own[self.turned] = np.einsum("nji,nj->ni", self.turn, slopes[self.turned])
        out = own[self.owner]
        np.add.at(out, self.place[self.others], own[self.others])
        return self.within(out)
