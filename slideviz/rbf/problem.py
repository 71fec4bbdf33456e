"""One deformation step as arrays, and its solution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter
from typing import Literal, NoReturn

import numpy as np

from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Basis, Tick, evaluate, no_tick

AGREE = 1e-7
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


@dataclass(frozen=True)
class Reduction:
    """Settings of the greedy selection of control nodes (thesis section 2.5).

    Attributes
    ----------
    tolerance : float
        Largest error at the boundary, in the mesh's length unit, that may remain for the
        correction.
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
    pick: Literal["block", "double", "one"] = "block"
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
    coords, shift : (n, d), (d,) float64
        Current positions in the frame, and one period in it (zero: none), for the correction.
    reduction : Reduction or None
        None: all candidates are control nodes.
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
    reduction: Reduction | None = None


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
        before the correction sets these exactly.
    dropped : (m,) int64
        Nodes that the pivot guard left out.
    condition : float
        Estimated condition number of the final system.
    history : tuple of Cycle
        Convergence of the selection; empty without data reduction.
    """

    displacement: FloatArray
    control_nodes: int
    max_error: float
    dropped: IntArray
    condition: float
    history: tuple[Cycle, ...] = ()


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
    """

    nodes: IntArray
    weights: FloatArray
    tail: FloatArray | None = None

    def at(self, problem: Problem, nodes: IntArray, tick: Tick = no_tick) -> FloatArray:
        """Return the displacements (m, d) of nodes in the frame."""
        features = problem.features
        if not len(self.nodes):
            return np.zeros((len(nodes), problem.values.shape[1]))
        found = evaluate(
            problem.basis, features[:, nodes], features[:, self.nodes], self.weights, tick
        )
        if self.tail is not None:
            found += linear_terms(problem.basis, features[:, nodes]) @ self.tail
        return found

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
        return Interpolant(unique[order], total[order], tail)


def linear_terms(basis: Basis, features: FloatArray) -> FloatArray:
    """Return the terms of the linear polynomial at nodes, (n, q), periodic where the case is.

    1 and the features: with a translational period these include the circle's cosine and sine;
    with a rotational one the angle enters by the cosine and sine of its full period.
    """
    rows = [np.ones(features.shape[1])]
    if basis.period > 0:
        r, sine, cosine, z = features
        rows += [r, cosine**2 - sine**2, 2 * sine * cosine, z]
    else:
        rows += list(features)
    return np.stack(rows, axis=1)


def merge(problem: Problem, nodes: IntArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return nodes (m,) and values (m, d) with coinciding nodes taken once.

    Raises
    ------
    DeformError
        Coinciding nodes are asked to move differently.
    """
    controls, group = np.unique(problem.same_as[nodes], return_inverse=True)
    data = np.zeros((len(controls), values.shape[1]))
    data[group] = values
    gap = np.abs(data[group] - values).max(axis=1, initial=0.0)
    if gap.max(initial=0.0) > AGREE * problem.basis.radius:
        row = int(np.argmax(gap))
        disagree(problem, nodes, row, float(gap[row]))
    return controls, data


def disagree(problem: Problem, nodes: IntArray, row: int, gap: float) -> NoReturn:
    """Raise the error for two coinciding nodes that are asked to move differently."""
    node = int(nodes[row])
    group = nodes[problem.same_as[nodes] == problem.same_as[node]]
    other = next((int(n) for n in group if n != node), node)
    raise DeformError(
        f"nodes {node} and {other} coincide (in the same place, or one period apart) but are "
        f"asked to move differently, by {gap:.3g}; a moving boundary must move alike at both "
        "periodic sides (in a rotational case: about the axis of periodicity) and may not reach "
        "into the next passage; or choose PERIODIC_MODE= none"
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalar constraints: the displacement of ``nodes`` along ``normals`` is ``right``.

    Attributes
    ----------
    nodes : (r,) int64
        Rows of one node are neighbours.
    normals : (r, d) float64 or None
        None: every row stands for all axes, and ``right`` has a column for each.
    right : (r, m) float64
        m = d without normals, and 1 with them.
    """

    nodes: IntArray
    normals: FloatArray | None
    right: FloatArray

    def followed_by(self, more: Rows) -> Rows:
        """Return these rows and then others, both without normals."""
        nodes = np.concatenate([self.nodes, more.nodes])
        return Rows(nodes, None, np.concatenate([self.right, more.right]))


def full_rows(problem: Problem, nodes: IntArray, values: FloatArray) -> Rows:
    """Return the rows of nodes with known displacement, coinciding ones merged."""
    merged, data = merge(problem, nodes, values)
    return Rows(merged, None, data)


def sliding_rows(problem: Problem) -> Rows:
    """Return the rows of direct sliding: all axes of known nodes, normals of sliding ones."""
    d = problem.values.shape[1]
    nodes = np.concatenate([np.repeat(problem.known, d), problem.normal_nodes])
    normals = np.concatenate([np.tile(np.eye(d), (len(problem.known), 1)), problem.normals])
    right = np.concatenate([problem.values.ravel(), np.zeros(len(problem.normal_nodes))])
    stands = problem.same_as[nodes]
    order = np.argsort(stands, kind="stable")
    nodes, stands, normals, right = nodes[order], stands[order], normals[order], right[order]
    _, starts = np.unique(stands, return_index=True)
    stops = np.append(starts, len(nodes))[1:]
    mixed = np.maximum.reduceat(nodes, starts) != np.minimum.reduceat(nodes, starts)
    keep = np.ones(len(nodes), bool)
    for start, stop in zip(starts[mixed], stops[mixed], strict=True):
        span = slice(start, stop)
        keep[span] = _independent(problem, nodes[span], normals[span], right[span])
    return Rows(stands[keep], normals[keep], right[keep, None])


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
            disagree(problem, nodes, row, abs(float(right[row])))
    return keep
