"""Who takes over what boundary nodes lack, kept: the correction of a frozen step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from slideviz.deformation.setup import Setup
from slideviz.design.frozen.operations import points
from slideviz.design.frozen.tape import (
    Array,
    function,
    length,
    take,
    value,
)
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.field import Correction, share
from slideviz.rbf.methods import GAMMA, NEGLIGIBLE


@dataclass(frozen=True, eq=False)
class FrozenSpread:
    """Who takes over what boundary nodes lack.

    Attributes
    ----------
    targets : (h,) int64
    row, source, weight : (k,)
        For targets, by their place, the boundary nodes, by theirs, and their weights.
    radius : float
    nearest, turn : (h,) int64
        The boundary node that is nearest to each target, and in which period it is.
    """

    targets: IntArray
    row: IntArray
    source: IntArray
    weight: FloatArray
    radius: float
    nearest: IntArray
    turn: IntArray

    def mixing(self, count: int) -> csr_array:
        """Return the matrix (h, count) that gives targets their means of boundary nodes."""
        shape = len(self.targets), count
        return csr_array((self.weight, (self.row, self.source)), shape=shape)


def chosen_spread(
    setup: Setup,
    coords: FloatArray,
    nodes: IntArray,
    errors: FloatArray,
    *,
    needed: bool,
) -> FrozenSpread | None:
    """Return who takes over what boundary nodes lack (`slideviz.rbf.methods.correction_of`).

    Parameters
    ----------
    nodes, errors : (b,), (b, d)
        Boundary nodes, and what they lack.
    needed
        Whether it is spread without data reduction too.
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
    return FrozenSpread(
        targets=targets[hit],
        row=row,
        source=once[source % len(once)],
        weight=weight,
        radius=radius,
        nearest=nodes[once[nearest % len(once)]],
        turn=np.array(shifts)[nearest // len(once)],
    )


def shares(setup: Setup, coords: Array, spread: FrozenSpread) -> Array:
    """Return the share that each target takes over, by its distance from the nearest node."""
    frame = setup.frame
    own = points(frame, take(coords, spread.targets))
    other = take(coords, spread.nearest) + spread.turn[:, None] * frame.shift()
    gap = length(own - points(frame, other))
    q = np.minimum(value(gap) / spread.radius, 1.0)
    return function(gap, share(q), -20.0 * q * (1.0 - q) ** 3 / spread.radius)
