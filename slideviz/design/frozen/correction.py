"""The boundary correction of a frozen step: its radius, and the sources of each node, are kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.field import share
from slideviz.rbf.frames import Frame
from slideviz.rbf.methods import IMAGES, correction_of
from slideviz.rbf.operations import points
from slideviz.rbf.problem import Problem
from slideviz.rbf.tape import Array, function, length, take, value


@dataclass(frozen=True, eq=False)
class FrozenCorrection:
    """Which nodes take over the errors of which boundary nodes."""

    targets: IntArray
    """(h,): the nodes that take over an error."""
    row: IntArray
    source: IntArray
    weight: FloatArray
    """`row`, `source`, `weight` (k,): one entry for each pair of a target, by its place in
    ``targets``, and a boundary node, by its place in ``nodes`` (b,), with its weight
    in the mean of their errors."""
    radius: float
    """Distance at which the correction ends, in the mesh's length unit."""
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
    """Return the share (h,) of the error that each target takes over (`slideviz.rbf.field.share`).

    It depends on the target's distance from its nearest boundary node.
    """
    here = points(frame, take(coords, correction.targets))
    other = take(coords, correction.nearest) + correction.turn[:, None] * frame.shift()
    gap = length(here - points(frame, other))
    q = np.minimum(value(gap) / correction.radius, 1.0)
    return function(gap, share(q), -20.0 * q * (1.0 - q) ** 3 / correction.radius)
