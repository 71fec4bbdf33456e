"""One step of a deformation with everything discrete kept, for any displacement.

`slideviz.solver.stepping.one_step` with variables of a tape; without a variable it computes values
only. Discrete choices are made when the step runs first, at the reference design, and kept: rows
of the systems, primitives that nodes are projected on, nearest boundary nodes and radius of the
correction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from dataclasses import field as made_by
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from slideviz.design.frozen.fit import FrozenFit
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.rbf import tape
from slideviz.rbf.field import share
from slideviz.rbf.frames import Frame
from slideviz.rbf.loops import add_correction, keep_undeformed
from slideviz.rbf.methods import IMAGES, ROUNDING, correction_of
from slideviz.rbf.operations import add_displacement, points
from slideviz.rbf.operations import coords as coords_of
from slideviz.rbf.problem import Levels, PhaseTimer, Problem, Solution
from slideviz.rbf.projection import projection_matrices
from slideviz.rbf.tape import Array, Variable, value
from slideviz.solver.setup import Setup
from slideviz.solver.stepping import one_step


@dataclass(frozen=True, eq=False)
class FrozenCorrection:
    """Which nodes take over the errors of which boundary nodes."""

    targets: IntArray  # (h,): the nodes that take over an error
    row: IntArray
    source: IntArray
    weight: FloatArray
    """`row`, `source`, `weight` (k,): one entry for each pair of a target, by its place in
    ``targets``, and a boundary node, by its place in ``nodes`` (b,), with its weight
    in the mean of their errors."""
    radius: float  # distance at which the correction ends, in the mesh's length unit
    nearest: IntArray
    turn: IntArray
    """`nearest`, `turn` (h,): the boundary node nearest to each target, and the number of periods,
    -1, 0 or 1, by which it is shifted."""

    def mixing(self, count: int) -> csr_array:
        """Return the matrix (h, count) from values at boundary nodes to their means at targets."""
        shape = len(self.targets), count
        return csr_array((self.weight, (self.row, self.source)), shape=shape)


def frozen_correction(
    problem: Problem, nodes: IntArray, errors: FloatArray
) -> FrozenCorrection | None:
    """Return the correction of errors (b, d) at boundary nodes (b,); None where they are rounding.

    The radius and the sources are those of `slideviz.rbf.methods.correction_of`.
    """
    correction = correction_of(problem, nodes, errors)
    if correction is None:
        return None
    once = np.unique(problem.same_as[nodes], return_index=True)[1]
    coords = value(problem.coords)
    free = np.ones(len(coords), bool)
    free[nodes] = False
    targets = np.flatnonzero(free)
    hit, nearest, row, source, weight = correction.sources(problem.cartesian(coords[targets]))
    return FrozenCorrection(
        targets=targets[hit],
        row=row,
        source=once[source % len(once)],
        weight=weight,
        radius=correction.radius,
        nearest=nodes[once[nearest % len(once)]],
        turn=np.array(IMAGES)[nearest // len(once)],
    )


def shares(frame: Frame, coords: Array, correction: FrozenCorrection) -> Array:
    """Return the share (h,) of the error that each target takes over, by its distance."""
    here = points(frame, tape.take(coords, correction.targets))
    other = tape.take(coords, correction.nearest) + correction.turn[:, None] * frame.shift()
    gap = tape.length(here - points(frame, other))
    q = np.minimum(value(gap) / correction.radius, 1.0)
    return tape.function(gap, share(q), -20.0 * q * (1.0 - q) ** 3 / correction.radius)


CHECKED = 1e11
"""Above this condition number, the errors of solutions are estimated for each design; with data
reduction only those of derivatives, for points have a tolerance that is larger than rounding."""

_SILENT = PhaseTimer(lambda _phase, _fraction: None)


@dataclass(frozen=True, eq=False)
class StepState:
    """The state of a deformation after some steps."""

    coords: Array  # (..., n, d): positions in the frame
    solution: Solution | None = None
    """Of the step; its errors are arrays (...,). None before the first step."""
    points: Array = made_by(default_factory=lambda: np.empty((0, 0)))
    """(..., n, d): Cartesian positions; empty before the first step."""

    def number(self, name: str) -> FloatArray:
        """Return a number of the solution by its name, (...,); 0 before the first step."""
        return np.asarray(getattr(self.solution, name) if self.solution else 0.0)


@dataclass(frozen=True, eq=False)
class ChoiceCache:
    """A store of objects that are made once, by name."""

    items: dict[str, Any] = made_by(default_factory=dict)

    def __call__(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the object of this name; ``make`` makes it the first time."""
        if name not in self.items:
            self.items[name] = make()
        return self.items[name]


@dataclass(frozen=True, eq=False)
class FrozenStep:
    """One step with its choices."""

    setup: Setup
    mesh: Mesh  # undeformed
    part: float  # part of the whole displacement that is made after this step, up to 1
    first: bool  # whether positions are those of the undeformed mesh, the same for all designs
    stages: tuple[Levels, ...]  # rows of the systems
    dropped: IntArray  # (m,): nodes that the pivot guard left out of the systems
    condition: float  # estimated condition number of the last system, at the reference
    refined: float = 0.0
    """Where systems are solved with twice the digits, as at the reference: the estimated error of
    ordinary solutions, as of a ``Solution``; else 0."""
    error_estimate: float = 0.0  # as of a ``Solution``, at the reference
    reuse: bool = False
    """Whether a later step keeps the factors of the last positions that it began at."""
    choices: ChoiceCache = made_by(default_factory=ChoiceCache)
    constants: ChoiceCache = made_by(default_factory=ChoiceCache)
    """`choices`, `constants`: discrete choices; and, used in the first step only, what depends on
    positions only."""
    last: ChoiceCache = made_by(default_factory=ChoiceCache)
    """The last positions that a later step began at, and its factors there."""

    def factors(self, coords: FloatArray) -> ChoiceCache:
        """Return the store of the factors of systems at positions ``coords`` (n, d).

        An optimiser asks for points, ``jvp`` and ``vjp`` of one design: factors are most of the
        work of each.
        """
        if self.first:
            return self.constants
        at, kept = self.last.items.get("at", (None, ChoiceCache()))
        if at is None or not np.array_equal(at, coords):
            kept = ChoiceCache()
        if self.reuse:
            self.last.items["at"] = coords.copy(), kept
        return kept

    def forget(self, names: tuple[str, ...]) -> None:
        """Make the choices whose names begin with one of ``names`` anew when the step runs next."""
        for name in [name for name in self.choices.items if name.startswith(names)]:
            del self.choices.items[name]

    def run(self, before: StepState, target: Array) -> StepState:
        """Return the state after this step.

        ``target`` (..., a, d): the whole displacement of the known nodes, after the last step, in
        the frame.
        """
        state = self.moved(before, target)
        coords, at = self._with_points(state.coords)
        return replace(state, coords=coords, points=at)

    def moved(self, before: StepState, target: Array, out: FloatArray | None = None) -> StepState:
        """Return the state after this step, without points, and with copies in a halo not moved.

        ``out`` (..., n, d): where the coordinates are written, if nothing is a variable.
        """
        setup = self.setup
        goal = setup.goal(target, self.part, partial(self.choices, "rims"))
        run = _Run(self, before.coords, out)
        solution = one_step(setup, before.coords, goal, _SILENT, before.solution, run)
        displacement = solution.displacement
        if out is not None and displacement is not out:
            out[:] = value(displacement)
            displacement = out
        on = np.flatnonzero(setup.axis)
        if len(on):
            held = np.ones(setup.coords.shape[1])
            held[:2] = 0.0
            still = tape.multiply(tape.take(displacement, on), held[None])
            displacement = tape.put(displacement, on, still, overwrite=True)
        moved = add_displacement(before.coords, displacement, overwrite=True)
        moved = tape.put(moved, setup.known, goal, overwrite=True)
        return StepState(moved, replace(solution, displacement=np.empty((0, 0))))

    def _with_points(self, moved: Array) -> tuple[Array, Array]:
        """Return coordinates and Cartesian points, with copies in a halo moved, too."""
        setup = self.setup
        frame = self.setup.frame
        at = _at_rest(points(frame, moved), moved, setup.coords, self.mesh.points)
        halo = self.mesh.halo
        if halo is None:
            return moved, at
        rows = setup.copies
        donors = halo.donors[rows]
        copies = halo.receivers[rows]
        donor = self.mesh.points[donors]
        start = self.mesh.points[copies]
        follow = tape.transform(halo.rotations[rows], tape.take(at, donors) - donor)
        overwrite = at is not moved
        at = tape.put(at, copies, add_displacement(start, follow), overwrite=overwrite)
        return tape.put(
            moved, copies, coords_of(frame, tape.take(at, copies)), overwrite=overwrite
        ), at


class _Run:
    """One run of a step: `slideviz.rbf.problem.FrozenChoices` at some positions."""

    def __init__(self, step: FrozenStep, coords: Array, out: FloatArray | None) -> None:
        self._step = step
        self._setup = step.setup
        self._coords = coords
        self.out = out
        self._kept = step.choices
        self._projections = count()
        self._stages = ((f"stage {k}", levels) for k, levels in enumerate(step.stages))

    def choose(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the choice of this name, made the first time."""
        return self._step.choices(name, partial(self._tried, make))

    def _tried(self, make: Callable[[], Any]) -> Any:
        """Return what ``make`` returns; projections that it tries are not kept."""
        before = self._kept, self._projections
        self._kept = ChoiceCache()
        self._projections = count()
        try:
            return make()
        finally:
            self._kept, self._projections = before

    def fixed(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what depends on positions only: kept in the first step."""
        return self._step.constants(name, make) if self._step.first else make()

    def fit(self, problem: Problem) -> FrozenFit:
        """Return a fit of this step without rows."""
        step = self._step
        return FrozenFit(
            problem,
            self._stages,
            step.dropped,
            chosen=step.choices,
            fixed=step.factors(value(self._coords)),
            refined=step.refined > 0.0,
            checked=step.condition > CHECKED,
        )

    def correct(
        self, problem: Problem, displacement: Array, nodes: IntArray, errors: Array, *, needed: bool
    ) -> Array:
        """Return the displacement with the boundary correction of errors added."""
        correction: FrozenCorrection | None = self.choose(
            "correction",
            lambda: frozen_correction(problem, nodes, value(errors)) if needed else None,
        )
        if correction is None:
            return displacement
        frame = self._setup.frame
        means = correction.mixing(value(errors).shape[-2])
        part = self.fixed("shares", lambda: shares(frame, self._coords, correction))
        if displacement is self.out and not isinstance(part, Variable):
            add_correction(self.out, correction.targets, means, part[:, 0], value(errors))
            return displacement
        more = tape.multiply(tape.mixed(means, errors), part)
        more = tape.take(displacement, correction.targets) + more
        return tape.put(displacement, correction.targets, more, overwrite=True)

    def project(self, nodes: IntArray, free: Array) -> Array:
        """Return the displacements (..., m, d) of sliding nodes projected on their boundary.

        On the plane of the facet, the line of the edge or the vertex that is closest at the
        reference.
        """
        setup = self._setup
        base = tape.take(self._coords, nodes)
        name = f"project {next(self._projections)}"
        anchor, matrix = self._kept(name, partial(self._tracked, nodes, value(base), value(free)))
        away = tape.transform(matrix - np.eye(matrix.shape[-1]), base - anchor)
        slid = _plus_unless_rounding(
            tape.transform(matrix, free), away, ROUNDING * largest_coordinate(setup.coords)
        )
        copy, origin, turn = self._kept(f"ties of {name}", lambda: self._ties(nodes))
        if len(copy):
            slid = tape.put(slid, copy, tape.transform(turn, tape.take(slid, origin)))
        held = np.ones((len(nodes), matrix.shape[-1]))
        held[setup.axis[nodes], :2] = 0.0
        held[np.isin(nodes, setup.held)] = 0.0
        return slid if held.all() else tape.multiply(slid, held)

    def _tracked(
        self, nodes: IntArray, base: FloatArray, free: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the closest point of each displaced node (m, d), and the projection (m, d, d).

        See `slideviz.rbf.projection.projection_matrices`.
        """
        tracks = self._setup.tracks
        label = tracks.of_node[nodes]
        at = base + free
        anchor = base.copy()
        matrix = np.zeros((*base.shape, base.shape[1]))
        for index in np.unique(label[label >= 0]).tolist():
            rows = np.flatnonzero(label == index)
            found, which = tracks.tracks[index].nearest(at[rows])
            anchor[rows] = found
            matrix[rows] = projection_matrices(
                tracks.tracks[index].simplices(which), at[rows], found
            )
        return anchor, matrix

    def _ties(self, nodes: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return copies among ``nodes``, the nodes that they follow, both as places, and rotations.

        Rotations (t, d, d) turn displacements of the latter into those of the copies, in the frame.
        """
        setup = self._setup
        halo = self._setup.halo
        d = self._setup.coords.shape[1]
        if halo is None:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, d, d))
        row = np.full(len(setup.coords), -1)
        row[nodes] = np.arange(len(nodes))
        copy = row[halo.receivers]
        origin = row[halo.donors]
        both = (copy >= 0) & (origin >= 0)
        turn = halo.rotations[both]
        if setup.frame.cylindrical:
            turn = np.broadcast_to(np.eye(d), turn.shape)
        return copy[both], origin[both], turn


def _plus_unless_rounding(slid: Array, away: Array, least: float) -> Array:
    """Return ``slid + away``, without rows of ``away`` up to ``least``: rest keeps every bit."""
    off = value(away)
    off = np.where(np.abs(off).max(axis=-1, keepdims=True) <= least, 0.0, off)
    return slid + (replace(away, value=off) if isinstance(away, Variable) else off)


def _at_rest(at: Array, moved: Array, start: FloatArray, before: FloatArray) -> Array:
    """Return points ``at``; those with coordinates ``moved`` as at the start become ``before``."""
    if at is moved:
        return at
    keep_undeformed(value(at), value(moved), start, before)
    return at
