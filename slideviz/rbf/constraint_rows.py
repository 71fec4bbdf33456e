"""Constraint rows: the conditions of a step as scalar constraints, coinciding nodes once."""

from __future__ import annotations

from functools import partial
from typing import NoReturn

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import NodeError
from slideviz.mesh.fans import components
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, run_begins
from slideviz.rbf.problem import Problem
from slideviz.rbf.tape import (
    Array,
    divide,
    dot,
    gather,
    join,
    length,
    multiply,
    placed,
    put,
    reshape,
    take,
    value,
)

AGREE = 1e-7
"""Displacements of coinciding nodes agree when they differ by at most this part of the support
radius."""

INDEPENDENT = 1e-6
"""A unit direction is independent of others when what remains of it, orthogonal to them, is
longer."""

ALIGNED = 1e-10
"""Components of unit directions below this are rounding: far above the rounding of normals of flat
boundaries, far below any angle that a mesh could mean."""


@record
class ConstraintRows:
    """Scalar constraints: the displacement of ``nodes`` along ``normals`` is ``right``."""

    nodes: IntArray  # (r,): rows of one node are neighbours
    normals: Array | None
    """(r, d): None: every row stands for all axes, and ``right`` has a column for each."""
    right: Array  # (r, m): m = d without normals, and 1 with them

    def followed_by(self, more: ConstraintRows) -> ConstraintRows:
        """Return these rows followed by ``more``; neither may have normals."""
        nodes = np.concatenate([self.nodes, more.nodes])
        return ConstraintRows(nodes, None, join(self.right, more.right))

    @property
    def data(self) -> FloatArray:
        """The values of ``right``."""
        return value(self.right)

    @property
    def directions(self) -> FloatArray | None:
        """The values of ``normals``."""
        return None if self.normals is None else value(self.normals)

    def only(self, index: IntArray) -> ConstraintRows:
        """Return the rows with the numbers ``index`` (k,)."""
        normals = None if self.normals is None else take(self.normals, index)
        return ConstraintRows(self.nodes[index], normals, take(self.right, index))

    def by_position(self, coords: Array) -> ConstraintRows:
        """Return the rows ordered by the coordinates (n, d) of their nodes."""
        at = value(coords)[self.nodes]
        return self.only(np.lexsort([np.arange(len(at)), *at.T[::-1]]))


def full_rows(problem: Problem, nodes: IntArray, values: Array) -> ConstraintRows:
    """Return the rows of nodes (m,) with displacements ``values`` (m, d), coinciding nodes merged.

    What the interpolants of earlier steps lack there is added to ``values``.
    """
    merged, data = merge(problem, nodes, values + problem.carried_error(nodes))
    return ConstraintRows(merged, None, data)


def sliding_rows(problem: Problem) -> ConstraintRows:
    """Return the rows of direct sliding: axes of known nodes, normals of sliding ones, merged."""
    known = problem.known
    d = value(problem.values).shape[-1]
    nodes = np.concatenate([np.repeat(known, d), problem.normal_nodes])
    normals = join(np.tile(np.eye(d), (len(known), 1)), problem.normals)
    values = problem.values + problem.carried_error(known)
    across = dot(problem.carried_error(problem.normal_nodes), problem.normals)
    right = join(reshape(values, len(known) * d, 1), across)
    order = np.argsort(problem.same_as[nodes], kind="stable")
    nodes = nodes[order]
    normals = take(normals, order)
    right = take(right, order)
    representative = problem.same_as[nodes]
    starts = np.flatnonzero(run_begins(representative))
    count = np.diff(np.r_[starts, len(nodes)])
    mixed = np.maximum.reduceat(nodes, starts) != np.minimum.reduceat(nodes, starts)
    keep = np.ones(len(nodes), bool)
    for size in np.unique(count[mixed]).tolist():
        rows = starts[mixed & (count == size), None] + np.arange(size)
        normals, right = _orthonormalised(problem, nodes, normals, right, rows, keep)
    kept = np.flatnonzero(keep)
    return ConstraintRows(representative[kept], take(normals, kept), take(right, kept))


def blocks(rows: ConstraintRows) -> IntArray:
    """Return the block of each row, (r,); directions of different blocks are perpendicular.

    G_ab = phi_ab (n_a . n_b) is zero between them. Known nodes have a row for each axis of the
    frame, and where the sliding boundaries lie along axes too (the walls of a box; hub, inflow
    and periodic sides of an annular passage in its cylindrical frame), the system falls apart
    into one for each axis: a ninth of the work, with the same result.
    """
    if rows.normals is None or not len(rows.nodes):
        return np.zeros(len(rows.nodes), np.int64)
    along = np.abs(value(rows.normals)) > ALIGNED
    met = along.T.astype(float) @ along
    of_axis = components(len(met), *np.nonzero(met))
    return of_axis[np.argmax(along, axis=1)]


def _orthonormalised(
    problem: Problem,
    nodes: IntArray,
    normals: Array,
    right: Array,
    rows: IntArray,
    keep: BoolArray,
) -> tuple[Array, Array]:
    """Return normals and right-hand sides with those of coinciding nodes orthonormalised.

    Raises DeformError where the right-hand sides of dependent constraints contradict each other.
    ``nodes`` (r,), ``normals`` (r, d), ``right`` (..., r, 1): the constraints, ``right`` their
    right-hand sides.
    ``rows`` (g, k): the k rows of each group of coinciding nodes.
    ``keep`` (r,) bool: set to False where a constraint follows from others of its group.
    """
    for k, row in enumerate(rows.T):
        n = take(normals, row)
        b = take(right, row)
        for other in rows.T[:k]:
            share = multiply(dot(n, take(normals, other)), keep[other, None].astype(float))
            n = n - multiply(take(normals, other), share)
            b = b - multiply(share, take(right, other))
        size = length(n)
        new = problem.choose(
            f"independent {rows.shape[1]} {k}", partial(_above, value(size), INDEPENDENT)
        )
        off = np.abs(value(b)[..., 0])
        wrong = np.argwhere(~new & (off > AGREE * problem.basis.radius))
        if len(wrong):
            disagree(problem, nodes[rows[wrong[0][-1]]], k, float(off[tuple(wrong[0])]))
        mask = new[:, None].astype(float)
        scale = multiply(size, mask) + (1.0 - mask)
        keep[row] = new
        normals = put(normals, row, divide(n, scale))
        right = put(right, row, divide(b, scale))
    return normals, right


def _above(size: FloatArray, least: float) -> BoolArray:
    return size[:, 0] > least


def merge(problem: Problem, nodes: IntArray, values: Array) -> tuple[IntArray, Array]:
    """Return one node (c,) for each group of coinciding nodes (m,), and the mean of its values.

    Raises DeformError if coinciding nodes are asked to move differently.
    ``nodes`` and ``values`` (m,), (..., m, d): nodes, and their displacements in the frame.
    """
    controls, group, count = np.unique(
        problem.same_as[nodes], return_inverse=True, return_counts=True
    )
    given = value(values)
    gap = np.abs(placed(given, group, len(controls))[..., group, :] - given).max(
        axis=-1, initial=0.0
    )
    if gap.max(initial=0.0) > AGREE * problem.basis.radius:
        worst = np.unravel_index(int(np.argmax(gap)), gap.shape)
        disagree(problem, nodes, int(worst[-1]), float(gap[worst]))
    return controls, divide(gather(values, group, len(controls)), count[:, None].astype(float))


def disagree(problem: Problem, nodes: IntArray, row: int, gap: float) -> NoReturn:
    """Raise DeformError for node ``nodes[row]`` and one that coincides with it, ``gap`` apart."""
    node = int(nodes[row])
    group = nodes[problem.same_as[nodes] == problem.same_as[node]]
    refuse(node, next((int(n) for n in group if n != node), node), gap)


def refuse(node: int, other: int, gap: float) -> NoReturn:
    """Raise DeformError for two coinciding nodes whose displacements differ by ``gap``."""
    raise NodeError(
        "nodes {} and {} coincide (in the same place, or one period apart) but are "
        f"asked to move differently, by {gap:.3g}; a moving boundary must move alike at both "
        "periodic sides (in a rotational case: about the axis of periodicity) and may not reach "
        "into the next passage; or choose PERIODIC_MODE= none",
        node,
        other,
    )
