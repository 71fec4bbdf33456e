"""One deformation step as arrays, and its solution."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dataclasses import field as made_by
from functools import cached_property
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray, mask_of, places_in
from slideviz.rbf.evaluate import Basis, Tick, connected, no_tick
from slideviz.rbf.field import Field, RadialField
from slideviz.rbf.operations import columns, radial_sum, terms
from slideviz.rbf.reduction import Reduction
from slideviz.rbf.tape import Array, gather, join, product, put, take, value

Project = Callable[[IntArray, Any], Any]
"""Takes nodes (m,) and displacements (..., m, d); returns those that bring the nodes back on their
boundary, (..., m, d)."""

Levels = tuple[IntArray, ...]
"""The rows of each level of an interpolant, (r, 2), as ``exact.row_keys`` gives them: the node,
and the row's place among the rows of that node."""


@dataclass(eq=False)
class PhaseTimer:
    """Seconds spent in each phase, and the progress callback of the step."""

    report: Callable[[str, float], None]
    seconds: dict[str, float] = made_by(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[Tick]:
        """Context that times the phase ``name``; it yields the callback for its progress."""
        start = perf_counter()
        self.report(name, 0.0)
        try:
            yield lambda fraction: self.report(name, fraction)
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


@frozen
class Cycle:
    """One cycle of the selection: its number, its level, and what it found."""

    cycle: int
    level: int  # `cycle`, `level`: numbers from 1
    error: float  # largest error at the candidates, in the mesh's length unit
    control_nodes: int  # nodes chosen so far
    seconds: float  # since the selection began


class FrozenChoices(Protocol):
    """The discrete choices of a step, kept for any displacement (`slideviz.design.frozen_step`)."""

    out: FloatArray | None  # (..., n, d): an array for the displacement of all nodes, to be reused

    def choose(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the cached choice ``name``; the first call makes it with ``make``."""

    def fit(self, problem: Problem) -> Any:
        """Return a fit (`slideviz.rbf.exact.Fit`) whose rows were chosen before."""

    def correct(
        self, problem: Problem, displacement: Array, nodes: IntArray, errors: Array, *, needed: bool
    ) -> Array:
        """Return the displacement (..., n, d) corrected by the errors (..., b, d) of nodes (b,)."""

    def fixed(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the cached value ``name``, which ``make`` makes again when positions change."""

    def project(self, nodes: IntArray, free: Array) -> Array:
        """Project displacements (..., m, d) of sliding nodes (m,) onto the facets chosen before."""


@record
class Problem:
    """What the interpolation of one step needs, in the working frame.

    Of periodic images, ``known``, ``edge``, ``surface`` and ``normal_nodes`` have the one that
    represents them. For derivatives, ``features``, ``values``, ``normals`` and ``coords`` are
    variables on a tape; ``values`` may have leading axes, for several designs.
    """

    basis: Basis
    features: Array  # (k, n): of all nodes, at their current positions
    known: IntArray  # (a,): nodes whose displacement is given, by ``values`` (a, d)
    values: Array
    edge: IntArray
    surface: IntArray
    """`edge`, `surface` (c,), (e,): sliding nodes, in the order in which pseudo sliding projects
    them."""
    normal_nodes: IntArray
    normals: Array
    """`normal_nodes`, `normals` (q,) int64, (q, d) float64: the constraints of the sliding nodes:
    unit directions of no displacement."""
    same_as: IntArray
    """(n,): for each node, the node that represents all that coincide with it under the periodic
    distance (its images); itself, if there are none."""
    project: Project  # projects displacements of sliding nodes (`Project`)
    curved: bool  # whether slid nodes must be projected after direct sliding
    cartesian: Callable[[FloatArray], FloatArray]
    """Returns the Cartesian points (m, d) of coordinates (m, d)."""
    coords: Array
    shift: FloatArray
    """`coords`, `shift` (n, d), (d,): current positions in the frame, and one period in it (zero:
    none), for the correction."""
    reduction: Reduction | None = None  # none: all candidates are control nodes
    before: StepSolution | None = None  # of the step before; None in the first step
    stages: tuple[Levels, ...] = ()
    """The rows that were chosen for other data, of each system: a selection in levels takes them
    first."""
    lasting: bool = False
    """Whether the factor will be used for other data too (as for gradients). Then its accuracy is
    tested with other data, too."""
    frozen: FrozenChoices | None = None
    """The choices of a step whose derivatives are wanted; None in a run, which makes its own."""

    def choose(self, name: str, make: Callable[[], Any]) -> Any:
        """Return a discrete choice: made in a run, and kept under its name in a frozen step."""
        return make() if self.frozen is None else self.frozen.choose(name, make)

    @property
    def dim(self) -> int:
        """Components of a displacement."""
        return int(value(self.values).shape[-1])

    def place(self, nodes: IntArray) -> FloatArray:
        """Return the features (k, m) of nodes."""
        return value(self.features)[:, nodes]

    @cached_property
    def reach(self) -> tuple[IntArray, BoolArray]:
        """Return labels (n,) of boundary nodes that supports connect, and which labels move, (k,).

        All of them where no node is displaced, and where a polynomial moves every node.
        """
        nodes = np.concatenate([self.known, self.edge, self.surface, self.normal_nodes])
        nodes = np.unique(self.same_as[nodes])
        label = np.zeros(len(self.same_as), np.int64)
        label[nodes] = connected(self.basis, self.place(nodes))
        moves = mask_of(
            int(label.max(initial=0)) + 1,
            label[self.same_as[self.known[value(self.values).any(axis=1)]]],
        )
        return label, moves if moves.any() and not self.basis.tailed else np.ones_like(moves)

    def carried_error(self, nodes: IntArray) -> Array:
        """Return the errors (..., m, d) that the interpolants of earlier steps left at nodes."""
        if self.before is None or self.before.carried is None:
            return np.zeros((len(nodes), self.dim))
        return self.before.carried.at(nodes)

    def initial_control_nodes(self) -> IntArray:
        """Return the control nodes (c,) with which the selection of this step begins.

        They are those of the previous step. The array is empty if the selection has several levels,
        or if the previous step has ``max_nodes`` control nodes, so that none could be added.
        """
        settings = self.reduction
        before = self.before
        if settings is None or before is None or settings.multilevel:
            return NO_NODES
        full = settings.max_nodes is not None and len(before.control) >= settings.max_nodes
        return before.control[:0] if full else before.control


@record
class CarriedError:
    """The errors that the interpolants of all previous steps left at boundary nodes."""

    nodes: IntArray  # (b,): sorted, each once
    values: Array  # (..., b, d): prescribed less interpolated displacement, in the frame

    def at(self, nodes: IntArray) -> Array:
        """Return the errors (..., m, d) at nodes (m,); zero at nodes that are not in ``nodes``."""
        row = places_in(self.nodes, nodes)
        errors = take(self.values, row)
        outside = np.flatnonzero(row < 0)
        nothing = np.zeros((len(outside), value(errors).shape[-1]))
        return put(errors, outside, nothing) if len(outside) else errors


@frozen
class Relaxed:
    """How a step was relaxed (`slideviz.elastic.relaxation`)."""

    rounds: int  # iterations
    residual: float  # the root of the part of the energy that the last iterations took, each

    @classmethod
    def joined(cls, several: Sequence[Relaxed]) -> Relaxed | None:
        """Return the worst of each number, and the sum of the rounds; None of none."""
        if not several:
            return None
        return cls(
            sum(one.rounds for one in several),
            max(one.residual for one in several),
        )


@record
class StepSolution:
    """The result of one step: displacements, control nodes and errors."""

    displacement: Array  # (..., n, d): of all nodes, in the frame
    control_nodes: int  # nodes in the final system, coinciding ones counted once
    max_error: float
    """Largest misfit at the nodes whose displacement is known or projected, before the correction
    sets these exactly; with data reduction that of all steps so far."""
    dropped: IntArray  # (m,): nodes that the pivot guard left out
    condition: float  # estimated condition number of the final system
    history: tuple[Cycle, ...] = ()  # convergence of the selection; empty without data reduction
    warnings: tuple[str, ...] = ()  # what the user should know
    control: IntArray = made_by(default_factory=lambda: NO_NODES)
    """(c,): the nodes in the final system; empty where a method has no such system."""
    carried: CarriedError | None = None
    """The errors that the interpolants of all steps so far left at boundary nodes; None without
    data reduction."""
    dropped_error: float = 0.0
    """Largest misfit of this step at the nodes that the pivot guard left out."""
    short: str = ""
    """Why the selection ended above its tolerance, and a remedy; empty where it did not."""
    lost: float = 0.0
    """Largest error of an exact solution at its own control nodes, before they are set exactly; in
    the mesh's length unit."""
    error_estimate: float = 0.0
    """Estimated error of an exact solution between its control nodes, as a part of the largest
    displacement (`slideviz.rbf.refine`). With ``Problem.lasting``, also that for a wave over the
    whole mesh."""
    refined: float = 0.0
    """The same estimate for the solution before refinement, where refinement was needed and helped;
    else 0."""
    field: Field | None = None
    """The field that displaced the nodes inside the mesh; None where a method has no such field."""
    relaxed: Relaxed | None = None  # none where the step was not relaxed
    layer_height: FloatArray | None = None
    """(z,): the part of their height that is left of the layers of a zone; None: all of it."""
    stages: tuple[Levels, ...] = ()
    """The rows of each system that was solved, in order: pseudo sliding has up to three, direct
    sliding one or two; empty where a method has no such systems."""


@record
class Interpolant:
    """A sum of radial functions and, for some kernels, a linear polynomial (Eq. 2.1)."""

    nodes: IntArray  # (c,): the control nodes
    weights: Array
    """(..., c, d): coefficients alpha, ``sum_a w_a n_a`` over the constraints of each node."""
    tail: Array | None = None  # (..., q, d): coefficients beta of the polynomial's terms
    levels: Levels = ()  # the rows that it meets, of each level

    def at(
        self,
        problem: Problem,
        nodes: IntArray | slice,
        tick: Tick = no_tick,
        out: FloatArray | None = None,
    ) -> Array:
        """Return the displacements (..., m, d) of nodes in the frame, in ``out`` if given.

        ``nodes`` are numbers (m,), or ``slice(None)`` for all nodes.
        """
        x = problem.features
        here = x if isinstance(nodes, slice) else columns(x, nodes)
        if not len(self.nodes):
            return np.zeros((value(here).shape[1], value(self.weights).shape[-1]))
        s = radial_sum(problem.basis, here, columns(x, self.nodes), self.weights, out, tick)
        return s if self.tail is None else s + product(terms(problem.basis, here), self.tail)

    def field(self, problem: Problem) -> RadialField:
        """Return the field of this interpolant, without a correction."""
        tail = None if self.tail is None else value(self.tail)
        return RadialField(problem.basis, problem.place(self.nodes), value(self.weights), tail)

    def plus(self, other: Interpolant) -> Interpolant:
        """Return the sum of two interpolants, each node once, in the order of first occurrence."""
        nodes, place = first_occurrences(np.concatenate([self.nodes, other.nodes]))
        weights = gather(join(self.weights, other.weights), place, len(nodes))
        tail = other.tail if self.tail is None else self.tail
        if self.tail is not None and other.tail is not None:
            tail = self.tail + other.tail
        return Interpolant(nodes, weights, tail, (*self.levels, *other.levels))


def first_occurrences(nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Return each of nodes (r,) once, in the order of first occurrence, and its place, (r,)."""
    unique, first, group = np.unique(nodes, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return unique[order], rank[group]
