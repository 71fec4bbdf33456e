"""One deformation step as arrays, and its solution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from dataclasses import field as made_by
from time import perf_counter
from typing import Literal

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Basis, Tick, no_tick
from slideviz.rbf.field import Field, RadialField
from slideviz.terms import Selection

Project = Callable[[IntArray, FloatArray], FloatArray]
Levels = tuple[IntArray, ...]
"""The rows (r, 2) of each level of an interpolant: node, and which of the rows of that node."""


@dataclass(eq=False)
class Watch:
    """Seconds spent in each phase, and the progress callback of the step."""

    report: Callable[[str, float], None]
    seconds: dict[str, float] = made_by(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[Tick]:
        """Time a phase; gives the callback to call with the fraction done."""
        start = perf_counter()
        self.report(name, 0.0)
        try:
            yield lambda fraction: self.report(name, fraction)
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


@dataclass(frozen=True)
class GreedySettings:
    """Settings of the greedy selection of control nodes (thesis section 2.5).

    Attributes
    ----------
    tolerance : float
        Largest error at the boundary, in the mesh's length unit, that may remain for the
        correction, summed over the steps.
    pick : "block", "double" or "one"
        Nodes added in a cycle: a growing number of them, the worst and the worst with an error
        in an opposite direction, or the worst one.
    level : "none", "size" or "ratio"
        Single level, or levels that end at ``level_size`` nodes, or when the error has fallen
        by the factor ``level_ratio``.
    max_nodes : int or None
        Stop at so many control nodes even if the error is larger.
    gamma : float
        Correction radius over largest error (Eq. 2.31).
    """

    tolerance: float
    pick: Selection = "block"
    level: Literal["none", "size", "ratio"] = "none"
    level_size: int = 16
    level_ratio: float = 0.5
    max_nodes: int | None = None
    gamma: float = 25.0


@dataclass(frozen=True)
class Cycle:
    """One cycle of the selection: its level, the largest error, control nodes, seconds."""

    cycle: int
    level: int
    error: float
    control_nodes: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Problem:
    """One step in the working frame.

    Attributes
    ----------
    basis : Basis
    features : (k, n) float64
        Of all nodes, at their current positions.
    known : (a,) int64
        Nodes whose displacement is given, by ``values`` (a, d). Of periodic images, here and
        below, the one that stands for them.
    edge, surface : (c,), (e,) int64
        Sliding nodes, in the order in which pseudo sliding projects them.
    normal_nodes, normals : (q,) int64, (q, d) float64
        The constraints of the sliding nodes: unit directions of no displacement.
    same_as : (n,) int64
        A node that stands for all that coincide with it (periodic images), itself included.
    project : callable
        Displacements of nodes brought back on their boundary.
    curved : bool
        Whether slid nodes must be projected after direct sliding.
    coords, shift : (n, d), (d,) float64
        Current positions in the frame, and one period in it (zero: none), for the correction.
    reduction : GreedySettings or None
        None: all candidates are control nodes.
    before : Solution or None
        That of the step before.
    stages : tuple of Levels
        Rows of each system that was chosen for other data, in levels: a selection in levels takes
        them first.
    lasting : bool
        Whether the system is to be solved for other data too, so that these alone do not tell
        whether its solutions can be trusted.
    """

    basis: Basis
    features: FloatArray
    known: IntArray
    values: FloatArray
    edge: IntArray
    surface: IntArray
    normal_nodes: IntArray
    normals: FloatArray
    same_as: IntArray
    project: Project
    curved: bool
    cartesian: Callable[[FloatArray], FloatArray]
    coords: FloatArray
    shift: FloatArray
    reduction: GreedySettings | None = None
    before: Solution | None = None
    stages: tuple[Levels, ...] = ()
    lasting: bool = False

    def behind(self, nodes: IntArray) -> FloatArray:
        """Return how much the interpolants of all steps before lack at nodes, (m, d)."""
        if self.before is None or self.before.lag is None:
            return np.zeros((len(nodes), self.values.shape[1]))
        return self.before.lag.at(nodes)

    def beginning(self) -> IntArray:
        """Return the control nodes with which a selection begins.

        Those of the step before, where one level is made; not if their number reached its
        limit, for then they could not follow a changing error.
        """
        settings, before = self.reduction, self.before
        if settings is None or before is None or settings.level != "none":
            return np.empty(0, np.int64)
        full = settings.max_nodes is not None and len(before.control) >= settings.max_nodes
        return before.control[:0] if full else before.control


@dataclass(frozen=True, eq=False)
class Lag:
    """What interpolants lack at some nodes, (b,), each once and sorted: (b, d); zero elsewhere."""

    nodes: IntArray
    values: FloatArray

    def at(self, nodes: IntArray) -> FloatArray:
        """Return what they lack at nodes, (m, d)."""
        row = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        return np.where((self.nodes[row] == nodes)[:, None], self.values[row], 0.0)


@dataclass(frozen=True, eq=False)
class Solution:
    """The result of one step: displacements, control nodes and errors.

    Attributes
    ----------
    displacement : (n, d) float64
        Of all nodes, in the frame.
    control_nodes : int
        Nodes in the final system, coinciding ones counted once.
    max_error : float
        Largest misfit at the nodes whose displacement is known or projected, before the
        correction sets these exactly; with data reduction that of all steps so far.
    dropped : (m,) int64
        Nodes that the pivot guard left out.
    condition : float
        Estimated condition number of the final system.
    history : tuple of Cycle
        Convergence of the selection; empty without data reduction.
    warnings : tuple of str
        What the user should know.
    control : (c,) int64
        The nodes in the final system; empty where a method has no such system.
    lag : Lag or None
        How much less than the boundary nodes the interpolants of all steps so far have moved
        there; None without data reduction.
    dropped_error : float
        Largest misfit of this step at the nodes that the pivot guard left out.
    short : str
        Why the selection ended above its tolerance, and a remedy; empty where it did not.
    lost : float
        By how much the solution of an exact system misses its own control nodes, before they
        are set.
    doubt : float
        By how much the field of an exact system may be wrong between its control nodes, measured
        at some points, as a part of the largest displacement. Where the system is to last, for a
        wave over the whole mesh too.
    refined : float
        The same of the ordinary solution, where it was too much and a refined one was found; else
        0.
    field : Field or None
        What displaced the nodes that are no boundary; None where a method has no such thing.
    stages : tuple of Levels
        The rows of each system that was solved, in order: pseudo sliding has up to three, direct
        sliding one or two; empty where a method has no such systems.
    """

    displacement: FloatArray
    control_nodes: int
    max_error: float
    dropped: IntArray
    condition: float
    history: tuple[Cycle, ...] = ()
    warnings: tuple[str, ...] = ()
    control: IntArray = made_by(default_factory=lambda: np.empty(0, np.int64))
    lag: Lag | None = None
    dropped_error: float = 0.0
    short: str = ""
    lost: float = 0.0
    doubt: float = 0.0
    refined: float = 0.0
    field: Field | None = None
    stages: tuple[Levels, ...] = ()


@dataclass(frozen=True, eq=False)
class Interpolant:
    """A sum of radial functions and, for some kernels, a linear polynomial (Eq. 2.1).

    Attributes
    ----------
    nodes : (c,) int64
        The control nodes.
    weights : (c, d) float64
        Coefficients alpha, ``sum_a w_a n_a`` over the constraints of each node.
    tail : (q, d) float64 or None
        Coefficients beta of the polynomial's terms.
    levels : Levels
        The rows that it meets.
    """

    nodes: IntArray
    weights: FloatArray
    tail: FloatArray | None = None
    levels: Levels = ()

    def at(self, problem: Problem, nodes: IntArray | slice, tick: Tick = no_tick) -> FloatArray:
        """Return the displacements (m, d) of nodes in the frame."""
        return self.field(problem).interpolated(problem.features[:, nodes], tick)

    def field(self, problem: Problem) -> RadialField:
        """Return what gives it anywhere, without a correction."""
        controls = problem.features[:, self.nodes]
        return RadialField(problem.basis, controls, self.weights, self.tail)

    def plus(self, other: Interpolant) -> Interpolant:
        """Return the sum of both, each node once, in the order of first occurrence."""
        nodes = np.concatenate([self.nodes, other.nodes])
        weights = np.concatenate([self.weights, other.weights])
        unique, first, group = np.unique(nodes, return_index=True, return_inverse=True)
        total = np.zeros((len(unique), weights.shape[1]))
        np.add.at(total, group, weights)
        order = np.argsort(first)
        tail = other.tail if self.tail is None else self.tail
        if self.tail is not None and other.tail is not None:
            tail = self.tail + other.tail
        return Interpolant(unique[order], total[order], tail, (*self.levels, *other.levels))
