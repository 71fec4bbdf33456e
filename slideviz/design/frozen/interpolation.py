"""Interpolation by radial basis functions on a frozen step, with each way of sliding."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from slideviz.design.frozen.fit import FrozenFit, TapedRows
from slideviz.design.frozen.loops import add_correction
from slideviz.design.frozen.method import Method, Solved
from slideviz.design.frozen.spread import FrozenCorrection, chosen_correction, shares
from slideviz.design.frozen.tape import (
    Array,
    Variable,
    dot,
    inverse,
    join,
    length,
    mixed,
    multiply,
    put,
    reshape,
    take,
    value,
)
from slideviz.mesh.model import FloatArray, IntArray, largest_coordinate
from slideviz.rbf.constraint_rows import AGREE, INDEPENDENT, refuse
from slideviz.rbf.methods import LOST
from slideviz.rbf.methods import ROUNDING as FLAT
from slideviz.terms import Sliding

CHECKED = 1e11
"""Above this condition number, the errors of solutions are estimated for each design; with data
reduction only those of derivatives, for points have a tolerance that is larger than rounding."""


class Interpolation(Method):
    """Radial basis functions (`slideviz.rbf.methods`)."""

    def run(self) -> Solved:
        """Return the result of the method for the case's sliding (`WAYS`)."""
        return WAYS[self._step.sliding](self)

    def _regular(self) -> Solved:
        """Solve without sliding (`slideviz.rbf.methods.regular`)."""
        fit = self._fit()
        self._meet(fit, self._known, self._values)
        return self._finished(fit, self._known, self._values)

    def _pseudo(self) -> Solved:
        """Solve with pseudo sliding (`slideviz.rbf.methods.pseudo_sliding`)."""
        setup, fit = self._setup, self._fit()
        self._meet(fit, self._known, self._values)
        nodes, values = self._known, self._values
        for name, level in (("edge", self._edge), ("surface", self._surface)):
            if not len(level):
                continue
            free = self._less_carried(fit.at(level), level)
            if setup.tracks.curved:
                free = self._within(level, free)
            slid = self._project(level, free, name)
            new = np.flatnonzero(~np.isin(setup.same_as[level], setup.same_as[nodes]))
            nodes, values = np.concatenate([nodes, level]), join(values, slid)
            self._merged(nodes, values)
            self._meet(fit, level[new], take(slid, new))
        return self._finished(fit, nodes, values)

    def _direct(self) -> Solved:
        """Solve with direct sliding (`slideviz.rbf.methods.direct_sliding`)."""
        if not len(self._normal_nodes):
            return self._regular()
        setup, fit = self._setup, self._fit()
        fit.add(self._sliding_rows(), self._stages.pop(0), "first")
        error_estimate = fit.error_estimate
        sliding = np.concatenate([self._edge, self._surface])
        nodes = np.concatenate([self._known, sliding])
        free = self._less_carried(fit.at(sliding), sliding)
        if not setup.tracks.curved:
            free = self._within(sliding, free)
        slid = self._project(sliding, free, "slid")
        if not self._stages:
            off = self._step.choices("off", lambda: self._off(value(slid), value(free)))
            slid = put(free, off, take(slid, off)) if len(off) else free
            return self._finished(fit, nodes, join(self._values, slid))
        values = join(self._values, slid)
        second = self._fit()
        second.error_estimate = error_estimate
        self._meet(second, nodes, values)
        return self._finished(second, nodes, values)

    def _off(self, slid: FloatArray, free: FloatArray) -> IntArray:
        """Return the places of nodes that projection moves, from ``free`` to ``slid`` (m, d)."""
        gap = np.abs(slid - free).max(axis=1, initial=0.0)
        return np.flatnonzero(gap > FLAT * largest_coordinate(value(self._coords)))

    def _fit(self) -> FrozenFit:
        """Return a fit of this step without rows."""
        setup = self._setup
        return FrozenFit(
            setup.basis,
            self._features,
            setup.coords.shape[1],
            chosen=self._step.choices,
            fixed=self._step.factors(value(self._coords)),
            refined=self._step.refined > 0.0,
            checked=self._step.condition > CHECKED,
        )

    def _meet(self, fit: FrozenFit, nodes: IntArray, values: Array) -> None:
        """Add the rows of nodes with known displacement to a fit, coinciding nodes merged."""
        merged, data = self._merged(nodes, self._with_carried(values, nodes))
        stage = f"stage {len(self._stages)}"
        fit.add(TapedRows(merged, None, data), self._stages.pop(0), stage)

    def _sliding_rows(self) -> TapedRows:
        """Return the rows of direct sliding (`slideviz.rbf.constraint_rows.sliding_rows`)."""
        known, same = self._known, self._setup.same_as
        d = self._setup.coords.shape[1]
        nodes = np.concatenate([np.repeat(known, d), self._normal_nodes])
        normals = join(np.tile(np.eye(d), (len(known), 1)), self._normals)
        values = reshape(self._with_carried(self._values, known), len(known) * d, 1)
        carried_error = self._carried_error(self._normal_nodes)
        across: Array = np.zeros((len(self._normal_nodes), 1))
        if carried_error is not None:
            across = dot(carried_error, self._normals)
        right = join(values, across)
        order = np.argsort(same[nodes], kind="stable")
        nodes, normals, right = nodes[order], take(normals, order), take(right, order)
        representative = same[nodes]
        starts = np.flatnonzero(np.r_[True, representative[1:] != representative[:-1]])
        count = np.diff(np.r_[starts, len(nodes)])
        mixed = np.maximum.reduceat(nodes, starts) != np.minimum.reduceat(nodes, starts)
        keep = np.ones(len(nodes), bool)
        for size in np.unique(count[mixed]).tolist():
            rows = starts[mixed & (count == size), None] + np.arange(size)
            normals, right = self._orthonormal(nodes, normals, right, rows, keep)
        kept = np.flatnonzero(keep)
        return TapedRows(representative[kept], take(normals, kept), take(right, kept))

    def _orthonormal(
        self, nodes: IntArray, normals: Array, right: Array, rows: IntArray, keep: np.ndarray
    ) -> tuple[Array, Array]:
        """Return normals and right-hand sides with those of coinciding nodes orthonormalised.

        Sets ``keep`` to False where a constraint follows from others, as
        ``slideviz.rbf.constraint_rows._orthonormalise`` does.
        """
        for k, row in enumerate(rows.T):
            n, b = take(normals, row), take(right, row)
            for other in rows.T[:k]:
                along = multiply(dot(n, take(normals, other)), keep[other, None].astype(float))
                n = n - multiply(take(normals, other), along)
                b = b - multiply(along, take(right, other))
            size = length(n)
            new = self._step.choices(
                f"independent {rows.shape[1]} {k}",
                partial(_above, value(size), INDEPENDENT),
            )
            wrong = ~new & (np.abs(value(b)[..., 0]) > AGREE * self._setup.basis.radius)
            if wrong.any():
                at = rows[int(np.argwhere(wrong)[0][-1])]
                refuse(int(nodes[at[k]]), int(nodes[at[0]]), float(np.abs(value(b)).max()))
            mask = new[:, None].astype(float)
            scale = inverse(multiply(size, mask) + (1.0 - mask))
            keep[row] = new
            normals = put(normals, row, multiply(n, scale))
            right = put(right, row, multiply(b, scale))
        return normals, right

    def _finished(self, fit: FrozenFit, nodes: IntArray, values: Array) -> Solved:
        """Evaluate at all nodes, set boundary nodes exactly, and spread their errors.

        As ``slideviz.rbf.methods._finish``; ``values`` (..., b, d) at boundary ``nodes`` (b,).
        """
        setup = self._setup
        displacement = self._into_out(fit.at(slice(None), out=self._out))
        errors = values - take(displacement, nodes)
        total = self._with_carried(errors, nodes)
        carried = total if setup.reduction is not None else None
        size = np.linalg.norm(value(total), axis=-1)
        lost = np.zeros(size.shape[:-1])
        if setup.reduction is None:
            inside = ~np.isin(setup.same_as[nodes], self._step.dropped)
            gap = np.linalg.norm(value(errors), axis=-1)
            lost = np.where(inside, gap, 0.0).max(axis=-1, initial=0.0)

        def choose() -> FrozenCorrection | None:
            most = float(np.linalg.norm(value(values), axis=-1).max(initial=0.0))
            needed = float(np.max(lost)) > LOST * most or len(self._step.dropped) > 0
            return chosen_correction(
                setup, value(self._coords), nodes, value(errors), needed=needed
            )

        spread = self._step.choices("correction", choose)
        if spread is not None:
            displacement = self._spread(displacement, spread, errors)
        displacement = put(displacement, nodes, values, overwrite=True)
        most = size.max(axis=-1, initial=0.0)
        error_estimate = (
            fit.error_estimate if setup.reduction is None else np.zeros_like(fit.error_estimate)
        )
        return Solved(displacement, carried, nodes, most, lost, error_estimate=error_estimate)

    def _spread(self, displacement: Array, spread: FrozenCorrection, errors: Array) -> Array:
        """Return the displacement with the boundary correction added."""
        setup = self._setup
        means = spread.mixing(value(errors).shape[-2])
        part = self._keep("shares", lambda: shares(setup, self._coords, spread))
        if displacement is self._out and not isinstance(part, Variable):
            add_correction(self._out, spread.targets, means, part[:, 0], value(errors))
            return displacement
        taken = mixed(means, errors)
        taken = multiply(taken, part)
        more = take(displacement, spread.targets) + taken
        return put(displacement, spread.targets, more, overwrite=True)


def _above(size: FloatArray, least: float) -> np.ndarray:
    """Return a mask (m,) of ``size`` (m, 1) above ``least``."""
    return np.asarray(size[:, 0] > least)


WAYS: Mapping[Sliding, Callable[[Interpolation], Solved]] = {
    "none": Interpolation._regular,
    "ps": Interpolation._pseudo,
    "ds": Interpolation._direct,
}
"""Method by the value of SLIDING_MODE, as `slideviz.rbf.methods.SLIDING_METHODS`."""
