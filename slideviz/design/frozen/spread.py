"""The boundary correction of a frozen step: its radius, and the sources of each node, are kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from slideviz.design.frozen.operations import points
from slideviz.design.frozen.tape import Array, function, length, take, value
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.field import Correction, share
from slideviz.rbf.methods import NEGLIGIBLE
from slideviz.rbf.reduction import GAMMA
from slideviz.solver.setup import Setup


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


def chosen_correction(
    setup: Setup,
    coords: FloatArray,
    nodes: IntArray,
    errors: FloatArray,
    *,
    needed: bool,
) -> FrozenCorrection | None:
    """Return the correction of errors at boundary nodes; None where they are not spread.

    The radius and the sources are those of `slideviz.rbf.methods.correction_of`.

    Parameters
    ----------
    coords : (n, d)
        Of all nodes before the step, in the frame.
    nodes, errors : (b,), (b, d)
        Boundary nodes, and the errors there, in the frame.
    needed
        Whether errors are spread without data reduction, too.
    """
    largest = float(np.linalg.norm(errors, axis=1).max(initial=0.0))
    if setup.reduction is None and not needed:
        return None
    if largest <= NEGLIGIBLE * setup.basis.radius:
        return None
    radius = (setup.reduction.gamma if setup.reduction else GAMMA) * largest
    once = np.unique(setup.same_as[nodes], return_index=True)[1]
    shifts = (0,) if not np.any(setup.frame.shift()) else (0, -1, 1)
    at = [setup.frame.points(coords[nodes[once]] + s * setup.frame.shift()) for s in shifts]
    tree = cKDTree(np.concatenate(at))
    free = np.ones(len(coords), bool)
    free[nodes] = False
    targets = np.flatnonzero(free)
    lacking = np.zeros((tree.n, 1))
    found = Correction(tree, lacking, radius).sources(setup.frame.points(coords[targets]))
    hit, nearest, row, source, weight = found
    return FrozenCorrection(
        targets=targets[hit],
        row=row,
        source=once[source % len(once)],
        weight=weight,
        radius=radius,
        nearest=nodes[once[nearest % len(once)]],
        turn=np.array(shifts)[nearest // len(once)],
    )


def shares(setup: Setup, coords: Array, spread: FrozenCorrection) -> Array:
    """Return the share (h,) of the error that each target takes over (`slideviz.rbf.field.share`).

    It depends on the target's distance from its nearest boundary node.
    """
    frame = setup.frame
    here = points(frame, take(coords, spread.targets))
    other = take(coords, spread.nearest) + spread.turn[:, None] * frame.shift()
    gap = length(here - points(frame, other))
    q = np.minimum(value(gap) / spread.radius, 1.0)
    return function(gap, share(q), -20.0 * q * (1.0 - q) ** 3 / spread.radius)
