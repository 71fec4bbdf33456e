"""How far the field of a solved system can be trusted, and solutions of nearly singular systems.

What a solution w lacks, r = b - G w, makes the field between the control nodes wrong by the
interpolant of r, which can be thousands of times as large as r: between the nodes of a small
profile and a wide far field, for example. So neither r nor the condition number tells. One
step of refinement does: its field at some points between control nodes is what the solution is
wrong by there. Rows that the pivot guard left out count too, for what the field lacks at them
spreads in the same way.

Where that is too much, the system is solved again, by conjugate gradients with the factor as
preconditioner, and with residuals of twice the digits (`twofold`): ordinary residuals lose as
many digits as the weights are larger than the data, at each right-hand side others, so that
refinement with them adds noise. The rows that the guard left out are met too.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as made_by
from typing import Any

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.rbf.evaluate import Basis, Tick, evaluate, matrix, no_tick
from slideviz.rbf.solve import Factor, enough_threads, solve_lower
from slideviz.rbf.twofold import Residuals

TRUSTED = 1e-5
"""Part of the largest displacement by which a field may be wrong between control nodes: above, the
system is refined, and where that does not help the user is told."""

SETTLED, VERIFIED = 1e-4 * TRUSTED, 1e-3 * TRUSTED
"""Parts of it that the last step of a refinement may change, and that it may be wrong by then."""

SHIFT = 1e-14
"""What is added to the pivots of rows that the guard left out, for they are little but rounding."""

ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Error of the field of weights whose sizes add up to 1: a few times what was measured."""

SLOW = 0.3
"""A round that leaves more than this part of what the one before found wrong is the last."""

ROUNDS, STEPS = 4, 40
CHECKS = 60
"""Points between control nodes of each kind of neighbours."""


@dataclass(frozen=True, eq=False)
class Refined:
    """Weights (n, m), and by how much their field may be wrong, as a part of the data, (m,)."""

    weights: FloatArray
    doubt: FloatArray


@dataclass(frozen=True, eq=False)
class System:
    """A system with its factor.

    Attributes
    ----------
    basis : Basis
    place : tuple
        Features (k, n) of the node of each row, and its unit direction (n, d) or None.
    factor : Factor
        Some rows may be left out of it.
    """

    basis: Basis
    place: tuple[FloatArray, FloatArray | None]
    factor: Factor
    _kept: dict[str, Any] = made_by(default_factory=dict)

    def rough_data(self) -> FloatArray:
        """Return data (n, m) with a wave along each axis, for data that are not yet known."""
        features, normals = self.place
        count = 3 if normals is None else normals.shape[1]
        at = features[:count] - features[:count].min(axis=1, keepdims=True)
        span = at.max(axis=1, keepdims=True)
        waves = np.sin(2.0 * np.pi * at / np.where(span > 0.0, span, 1.0)).T
        return waves if normals is None else (waves * normals).sum(axis=1, keepdims=True)

    def wrong(self, right: FloatArray, weights: FloatArray) -> FloatArray:
        """Return by how much the field of weights (n, m) is wrong, measured at some points, (m,).

        Parameters
        ----------
        right : (n, m)
            The data; m = 1 with directions.
        """
        features, normals = self.place
        along = weights if normals is None else normals * weights
        met = evaluate(self.basis, features, features, along)
        if normals is not None:
            met = np.einsum("rd,rd->r", met, normals)[:, None]
        with enough_threads(2.0 * len(right) ** 2):
            return self._field(self._whole().solve(right - met))

    def refined(
        self,
        right: FloatArray,
        largest: FloatArray,
        start: FloatArray,
        tick: Tick = no_tick,
        *,
        settle: bool = False,
    ) -> Refined:
        """Return the weights that meet all rows, those that the guard left out too.

        Parameters
        ----------
        right, start : (n, m)
            The data, and weights to begin with.
        largest : (m,)
            The size of the data of each column, by which its field is judged.
        settle
            Whether the weights themselves are the result, as of an adjoint system, where no field
            tells of the weights of nodes that nearly coincide. The doubt is then by how much the
            last round changed them, as a part of the largest.
        """
        weights, low = start.copy(), np.zeros_like(start)
        residuals = self._residuals()
        size = np.where(largest > 0.0, largest, 1.0)
        doubt = np.full(len(size), np.inf)
        open_ = np.arange(len(size))
        for _ in range(ROUNDS):
            before = weights[:, open_]
            lacking = residuals(right[:, open_], before, low[:, open_], tick)
            step, wrong = self._step(lacking, before, size[open_], tick, settle=settle)
            weights[:, open_] = before + step
            low[:, open_] += before - weights[:, open_] + step
            now = wrong / size[open_]
            if settle:
                most = np.abs(weights[:, open_]).max(axis=0)
                now = np.abs(step).max(axis=0) / np.where(most > 0.0, most, 1.0)
            going = (now > VERIFIED) & (now < SLOW * doubt[open_])
            doubt[open_] = now
            open_ = open_[going]
            if not len(open_):
                break
        rounding = 0.0 if settle else ROUNDING * np.abs(weights).sum(axis=0)
        return Refined(weights, doubt + rounding / size)

    def _step(
        self,
        lacking: FloatArray,
        weights: FloatArray,
        size: FloatArray,
        tick: Tick,
        *,
        settle: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """Return what is to be added to weights (n, m), and by how much their field is wrong, (m,).

        Columns end by themselves: what one does must not depend on the others.
        """
        whole, residuals, r = self._whole(), self._residuals(), lacking.copy()
        total, z = np.zeros_like(r), whole.solve(r)
        p, rz = z.copy(), (r * z).sum(axis=0)
        wrong = self._field(z)
        on = np.flatnonzero(((wrong > VERIFIED * size) | settle) & (rz > 0.0))
        for _ in range(STEPS):
            if not len(on):
                break
            nothing = np.zeros_like(p[:, on])
            q = residuals(nothing, -p[:, on], nothing, tick)
            curved = (p[:, on] * q).sum(axis=0)
            on, q, curved = on[curved > 0.0], q[:, curved > 0.0], curved[curved > 0.0]
            change = p[:, on] * (rz[on] / curved)
            total[:, on] += change
            r[:, on] -= q * (rz[on] / curved)
            most = np.abs(weights[:, on] + total[:, on]).max(axis=0)
            going = self._field(change) > SETTLED * size[on]
            on = on[going | (np.abs(change).max(axis=0) > SETTLED * most)]
            z = whole.solve(r[:, on])
            new = (r[:, on] * z).sum(axis=0)
            p[:, on] = z + p[:, on] * (new / rz[on])
            rz[on] = new
            on = on[new > 0.0]
        return total, wrong

    def _field(self, weights: FloatArray) -> FloatArray:
        """Return the largest component of the field of each column of weights (n, m), (m,)."""
        features, normals = self.place
        if "checks" not in self._kept:
            points = between(features)
            self._kept["checks"] = matrix(self.basis, (points, None), (features, None))
        checks: FloatArray = self._kept["checks"]
        along = [weights] if normals is None else [weights * n[:, None] for n in normals.T]
        found = [np.abs(checks @ each).max(axis=0, initial=0.0) for each in along]
        return np.asarray(np.max(found, axis=0))

    def _whole(self) -> Factor:
        """Return a factor of all rows, which is not exact for those that were left out."""
        if not len(self.factor.dropped):
            return self.factor
        if "whole" not in self._kept:
            self._kept["whole"] = with_dropped_rows(self.basis, self.place, self.factor)
        whole: Factor = self._kept["whole"]
        return whole

    def _residuals(self) -> Residuals:
        if "residuals" not in self._kept:
            self._kept["residuals"] = Residuals(self.basis, self.place)
        residuals: Residuals = self._kept["residuals"]
        return residuals


def with_dropped_rows(
    basis: Basis, place: tuple[FloatArray, FloatArray | None], factor: Factor
) -> Factor:
    """Return a factor with the rows that another left out, whose pivots are a little too large."""
    kept, dropped = factor.kept, factor.dropped
    features, normals = place
    outside = features[:, dropped], None if normals is None else normals[dropped]
    rows = matrix(basis, outside, place)
    k, n = len(kept), len(kept) + len(dropped)
    with enough_threads(2.0 * k * k * len(dropped)):
        beside = solve_lower(factor.lower, rows[:, kept].T).T
        rest = rows[:, dropped] - beside @ beside.T
        lower = np.zeros((n, n), order="F")
        lower[:k, :k], lower[k:, :k] = factor.lower, beside
        shift = SHIFT
        while True:
            try:
                corner = np.linalg.cholesky(rest + shift * np.eye(n - k))
                break
            except np.linalg.LinAlgError:
                shift *= 10.0
    lower[k:, k:] = corner
    return Factor(lower, np.concatenate([kept, dropped]), np.empty(0, np.int64))


def between(features: FloatArray) -> FloatArray:
    """Return points (k, m) halfway between the features (k, n) of nodes, near and far ones."""
    n = features.shape[1]
    ends = np.arange(0, n, max(1, n // CHECKS))
    others = [(ends + apart) % n for apart in (1, n // 16, n // 4, n // 2)]
    return np.concatenate([(features[:, ends] + features[:, o]) / 2 for o in others], axis=1)
