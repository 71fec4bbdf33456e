"""The three methods, one function each, on one deformation step.

Every condition is a scalar constraint "the displacement of node i along n is b"; see
``constrained`` for the system. Regular interpolation has all axes of all boundary nodes as
constraints, direct sliding only the normals of the nodes that slide (thesis section 2.4.1), and
pseudo sliding (2.4.2) finds their displacement by projection first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Basis, Tick, evaluate, matrix
from slideviz.rbf.solve import factorise

AGREE = 1e-9
"""Largest difference of the data of coinciding nodes, as a fraction of the support radius."""

Project = Callable[[IntArray, FloatArray], FloatArray]


@dataclass(eq=False)
class Watch:
    """Seconds spent in each phase, and the progress callback of the step."""

    report: Callable[[str, float], None]
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[Tick]:
        """Time a phase; gives the callback to call with the fraction done."""
        start = perf_counter()
        self.report(name, 0.0)
        try:
            yield lambda fraction: self.report(name, fraction)
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


@dataclass(frozen=True, eq=False)
class Problem:
    """One step in the working frame.

    Attributes
    ----------
    basis : Basis
    features : (k, n) float64
        Of all nodes, at their current positions.
    known : (a,) int64
        Nodes whose displacement is given, by ``values`` (a, d).
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


@dataclass(frozen=True, eq=False)
class Solution:
    """What one step found.

    Attributes
    ----------
    displacement : (n, d) float64
        Of all nodes, in the frame.
    control_nodes : int
        Nodes in the final system, coinciding ones counted once.
    max_error : float
        Largest misfit of the interpolant at the nodes whose displacement is known or projected,
        before these are set exactly.
    dropped : (m,) int64
        Nodes that the pivot guard left out.
    """

    displacement: FloatArray
    control_nodes: int
    max_error: float
    dropped: IntArray


def regular(problem: Problem, watch: Watch) -> Solution:
    """Interpolate the known displacements (thesis section 2.1)."""
    return _finish(problem, watch, problem.known, problem.values)


def pseudo_sliding(problem: Problem, watch: Watch) -> Solution:
    """Displace sliding nodes freely, project, and interpolate: edges first, then surfaces."""
    nodes, values = problem.known, problem.values
    for level in (problem.edge, problem.surface):
        if len(level):
            slid = _slide(problem, watch, (nodes, values), level)
            nodes, values = np.concatenate([nodes, level]), np.concatenate([values, slid])
    return _finish(problem, watch, nodes, values)


def direct_sliding(problem: Problem, watch: Watch) -> Solution:
    """Let sliding nodes move within their boundary by the system itself (section 2.4.1).

    On curved boundaries the slid nodes are projected, and interpolated like known ones.
    """
    if not len(problem.normal_nodes):
        return regular(problem, watch)
    found = _constrained(problem, watch)
    sliding = np.concatenate([problem.edge, problem.surface])
    if not problem.curved:
        return found
    with watch.phase("project"):
        slid = problem.project(sliding, found.displacement[sliding])
    nodes = np.concatenate([problem.known, sliding])
    return _finish(problem, watch, nodes, np.concatenate([problem.values, slid]))


METHODS: dict[str, Callable[[Problem, Watch], Solution]] = {
    "none": regular,
    "ps": pseudo_sliding,
    "ds": direct_sliding,
}
"""Method by the value of SLIDING_MODE."""


def _slide(
    problem: Problem, watch: Watch, data: tuple[IntArray, FloatArray], level: IntArray
) -> FloatArray:
    """Return the projected displacements (m, d) of sliding nodes from the data known so far."""
    controls, weights, _ = _solve_full(problem, watch, *data)
    with watch.phase("evaluate") as tick:
        free = evaluate(
            problem.basis,
            problem.features[:, level],
            problem.features[:, controls],
            weights,
            tick,
        )
    with watch.phase("project"):
        return problem.project(level, free)


def _solve_full(
    problem: Problem, watch: Watch, nodes: IntArray, values: FloatArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return controls (m,), weights (m, d) and dropped nodes of the regular system."""
    controls, group = np.unique(problem.same_as[nodes], return_inverse=True)
    data = np.zeros((len(controls), values.shape[1]))
    data[group] = values
    gap = np.abs(data[group] - values).max(axis=1, initial=0.0)
    if gap.max(initial=0.0) > AGREE * problem.basis.radius:
        row = int(np.argmax(gap))
        _disagree(problem, nodes, row, gap[row])
    with watch.phase("solve") as tick:
        factor = factorise(matrix(problem.basis, problem.features[:, controls], None, tick), tick)
        weights = factor.solve(data)
    return controls, weights, controls[factor.dropped]


def _disagree(problem: Problem, nodes: IntArray, row: int, gap: float) -> None:
    """Raise the error for two coinciding nodes that are asked to move differently."""
    node = int(nodes[row])
    group = nodes[problem.same_as[nodes] == problem.same_as[node]]
    other = next((int(n) for n in group if n != node), node)
    raise DeformError(
        f"nodes {node} and {other} coincide (in the same place, or one period apart) but are "
        f"asked to move differently, by {gap:.3g}; give both the same displacement, or choose "
        "PERIODIC_MODE= none"
    )


def _finish(problem: Problem, watch: Watch, nodes: IntArray, values: FloatArray) -> Solution:
    """Solve the regular system and evaluate it at all nodes; known nodes are set exactly."""
    controls, weights, dropped = _solve_full(problem, watch, nodes, values)
    with watch.phase("evaluate") as tick:
        displacement = evaluate(
            problem.basis, problem.features, problem.features[:, controls], weights, tick
        )
    error = np.linalg.norm(displacement[nodes] - values, axis=1).max(initial=0.0)
    displacement[nodes] = values
    return Solution(displacement, len(controls), float(error), dropped)


def _constrained(problem: Problem, watch: Watch) -> Solution:
    """Solve ``G w = b`` with G_ab = phi_ab (n_a . n_b) and evaluate it at all nodes."""
    nodes, normals, right = _constraints(problem)
    with watch.phase("solve") as tick:
        factor = factorise(matrix(problem.basis, problem.features[:, nodes], normals, tick), tick)
        weights = factor.solve(right[:, None]) * normals
    controls, group = np.unique(nodes, return_inverse=True)
    total = np.zeros((len(controls), normals.shape[1]))
    np.add.at(total, group, weights)
    with watch.phase("evaluate") as tick:
        displacement = evaluate(
            problem.basis, problem.features, problem.features[:, controls], total, tick
        )
    known, values = problem.known, problem.values
    error = np.linalg.norm(displacement[known] - values, axis=1).max(initial=0.0)
    displacement[known] = values
    sliding, n = problem.normal_nodes, problem.normals
    # What is left of the displacement along the normals is rounding: take it away.
    off = np.einsum("qd,qd->q", displacement[sliding], n)
    error = max(error, float(np.abs(off).max(initial=0.0)))
    np.subtract.at(displacement, sliding, off[:, None] * n)
    return Solution(displacement, len(controls), float(error), np.unique(nodes[factor.dropped]))


def _constraints(problem: Problem) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return nodes (m,), unit directions (m, d) and values (m,), coinciding nodes merged."""
    d = problem.values.shape[1]
    nodes = np.concatenate([np.repeat(problem.known, d), problem.normal_nodes])
    normals = np.concatenate([np.tile(np.eye(d), (len(problem.known), 1)), problem.normals])
    right = np.concatenate([problem.values.ravel(), np.zeros(len(problem.normal_nodes))])
    stands = problem.same_as[nodes]
    order = np.argsort(stands, kind="stable")
    nodes, stands, normals, right = nodes[order], stands[order], normals[order], right[order]
    starts = np.flatnonzero(np.r_[True, stands[1:] != stands[:-1]])
    keep = np.ones(len(nodes), bool)
    for start, stop in zip(starts, np.r_[starts[1:], len(nodes)], strict=True):
        if nodes[start] != nodes[start:stop].max() or nodes[start] != nodes[start:stop].min():
            span = slice(start, stop)
            keep[span] = _independent(problem, nodes[span], normals[span], right[span])
    return stands[keep], normals[keep], right[keep]


def _independent(
    problem: Problem, nodes: IntArray, normals: FloatArray, right: FloatArray
) -> list[bool]:
    """Orthonormalise the constraints of coinciding nodes in place; tell which ones remain."""
    keep: list[bool] = []
    for row in range(len(normals)):
        for other in np.flatnonzero(keep):
            share = normals[row] @ normals[other]
            normals[row] -= share * normals[other]
            right[row] -= share * right[other]
        length = np.linalg.norm(normals[row])
        keep.append(bool(length > 1e-6))
        if keep[row]:
            normals[row] /= length
            right[row] /= length
        elif abs(right[row]) > AGREE * problem.basis.radius:
            _disagree(problem, nodes, row, abs(float(right[row])))
    return keep
