"""Constraint rows: the conditions of a step as scalar constraints, coinciding nodes once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from slideviz.errors import NodeError
from slideviz.mesh.fans import components
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.problem import Problem

AGREE = 1e-7
"""Displacements of coinciding nodes agree when they differ by at most this part of the support
radius."""

INDEPENDENT = 1e-6
"""A unit direction is independent of others when what remains of it, orthogonal to them, is
longer."""

ALIGNED = 1e-10
"""Components of unit directions below this are rounding: far above the rounding of normals of flat
boundaries, far below any angle that a mesh could mean."""


@dataclass(frozen=True, eq=False)
class ConstraintRows:
    """Scalar constraints: the displacement of ``nodes`` along ``normals`` is ``right``."""

    nodes: IntArray
    """(r,): rows of one node are neighbours."""
    normals: FloatArray | None
    """(r, d): None: every row stands for all axes, and ``right`` has a column for each."""
    right: FloatArray
    """(r, m): m = d without normals, and 1 with them."""

    def followed_by(self, more: ConstraintRows) -> ConstraintRows:
        """Return these rows followed by ``more``; neither may have normals."""
        nodes = np.concatenate([self.nodes, more.nodes])
        return ConstraintRows(nodes, None, np.concatenate([self.right, more.right]))

    def only(self, index: IntArray) -> ConstraintRows:
        """Return the rows with the numbers ``index`` (k,)."""
        normals = None if self.normals is None else self.normals[index]
        return ConstraintRows(self.nodes[index], normals, self.right[index])

    def by_position(self, coords: FloatArray) -> ConstraintRows:
        """Return the rows ordered by the coordinates (n, d) of their nodes."""
        at = coords[self.nodes]
        return self.only(np.lexsort([np.arange(len(at)), *at.T[::-1]]))


def full_rows(problem: Problem, nodes: IntArray, values: FloatArray) -> ConstraintRows:
    """Return the rows of nodes (m,) with displacements ``values`` (m, d), coinciding nodes merged.

    What the interpolants of earlier steps lack there is added to ``values``.
    """
    merged, data = merge(problem, nodes, values + problem.carried_error(nodes))
    return ConstraintRows(merged, None, data)


def sliding_rows(problem: Problem) -> ConstraintRows:
    """Return the rows of direct sliding: all axes of known nodes, normals of sliding nodes.

    Those of coinciding nodes are merged. Raises DeformError where they contradict each other.
    """
    d = problem.values.shape[1]
    nodes = np.concatenate([np.repeat(problem.known, d), problem.normal_nodes])
    normals = np.concatenate([np.tile(np.eye(d), (len(problem.known), 1)), problem.normals])
    values = problem.values + problem.carried_error(problem.known)
    across = np.einsum("qd,qd->q", problem.carried_error(problem.normal_nodes), problem.normals)
    right = np.concatenate([values.ravel(), across])
    order = np.argsort(problem.same_as[nodes], kind="stable")
    nodes, normals, right = nodes[order], normals[order], right[order]
    representative = problem.same_as[nodes]
    starts = np.flatnonzero(np.r_[True, representative[1:] != representative[:-1]])
    count = np.diff(np.r_[starts, len(nodes)])
    mixed = np.maximum.reduceat(nodes, starts) != np.minimum.reduceat(nodes, starts)
    keep = np.ones(len(nodes), bool)
    for size in np.unique(count[mixed]):
        rows = starts[mixed & (count == size), None] + np.arange(size)
        _orthonormalise(problem, nodes, normals, right, rows, keep)
    return ConstraintRows(representative[keep], normals[keep], right[keep, None])


def blocks(rows: ConstraintRows) -> IntArray:
    """Return the block of each row, (r,); directions of different blocks are perpendicular.

    G_ab = phi_ab (n_a . n_b) is zero between them. Known nodes have a row for each axis of the
    frame, and where the sliding boundaries lie along axes too (the walls of a box; hub, inflow
    and periodic sides of an annular passage in its cylindrical frame), the system falls apart
    into one for each axis: a ninth of the work, with the same result.
    """
    if rows.normals is None or not len(rows.nodes):
        return np.zeros(len(rows.nodes), np.int64)
    along = np.abs(rows.normals) > ALIGNED
    met = along.T.astype(float) @ along
    of_axis = components(len(met), *np.nonzero(met))
    return of_axis[np.argmax(along, axis=1)]


def _orthonormalise(
    problem: Problem,
    nodes: IntArray,
    normals: FloatArray,
    right: FloatArray,
    rows: IntArray,
    keep: np.ndarray,
) -> None:
    """Orthonormalise the constraints of coinciding nodes in place; mark dependent ones in ``keep``.

    Raises DeformError where the right-hand sides of dependent constraints contradict each other.

    Parameters
    ----------
    nodes, normals, right : (r,), (r, d), (r,)
        The constraints, ``right`` their right-hand sides.
    rows : (g, k)
        The k rows of each group of coinciding nodes.
    keep : (r,) bool
        Set to False where a constraint follows from others of its group.
    """
    for k, row in enumerate(rows.T):
        n, b = normals[row], right[row]
        for other in rows.T[:k]:
            share = np.einsum("gd,gd->g", n, normals[other]) * keep[other]
            n = n - share[:, None] * normals[other]
            b = b - share * right[other]
        length = np.linalg.norm(n, axis=1)
        new = length > INDEPENDENT
        wrong = np.flatnonzero(~new & (np.abs(b) > AGREE * problem.basis.radius))
        if len(wrong):
            group = wrong[0]
            disagree(problem, nodes[rows[group]], k, abs(float(b[group])))
        scale = np.where(new, length, 1.0)
        keep[row], normals[row], right[row] = new, n / scale[:, None], b / scale


def merge(problem: Problem, nodes: IntArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return one node (c,) for each group of coinciding nodes (m,), and the mean of its values.

    Parameters
    ----------
    nodes, values : (m,), (m, d)
        Nodes, and their displacements in the frame.

    Raises
    ------
    DeformError
        Coinciding nodes are asked to move differently.
    """
    controls, group, count = np.unique(
        problem.same_as[nodes], return_inverse=True, return_counts=True
    )
    data = np.zeros((len(controls), values.shape[1]))
    data[group] = values
    gap = np.abs(data[group] - values).max(axis=1, initial=0.0)
    if gap.max(initial=0.0) > AGREE * problem.basis.radius:
        row = int(np.argmax(gap))
        disagree(problem, nodes, row, float(gap[row]))
    data[:] = 0.0
    np.add.at(data, group, values)
    return controls, data / count[:, None]


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
