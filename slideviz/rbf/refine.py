"""Error estimates of solved systems, and refined solutions of nearly singular systems.

A solution w with the residual r = b - G w has an error between the control nodes: the interpolant
of r. It can be thousands of times as large as r, between the nodes of a small profile and a wide
far field, for example. So neither r nor the condition number shows it. One step of refinement
does: its field, at some points between control nodes, is the error of the solution there. Rows
that the pivot guard left out are included, for the error at their nodes spreads in the same way.

Where the error is too large, the system is solved again with `double_double` precision, and
the solution meets the rows that the guard left out, too: with a factor of that precision, and for a
large system by conjugate gradients with the ordinary factor as preconditioner. Residuals are those
of twice the precision: ordinary ones lose as many digits as the weights are larger than the data,
so that refinement with them adds noise.
"""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import NO_NODES, FloatArray, row_dots
from slideviz.rbf.double_double import DoubleFactor, Residuals, supports
from slideviz.rbf.evaluate import Basis, Rows, Tick, evaluate, matrix, no_tick
from slideviz.rbf.solve import Factor, enough_threads, solve_lower
from slideviz.system.weak_cache import WeakCache

_FACTORS = WeakCache()  # of systems, with twice the digits

TRUSTED = 1e-5
"""Largest error of a field between control nodes, as a part of the largest displacement. Above it
the solution is refined, and where refinement does not help the user is warned."""

NOTED = 1e-3  # up to this part the warning is a note

SETTLED = 1e-4 * TRUSTED
VERIFIED = 1e-3 * TRUSTED
"""Conjugate gradients end when a step changes the field by less than the first part of the largest
displacement; refinement ends when the field's error is below the second."""

SHIFT = 1e-14
"""Added to the diagonal of the rows that the guard (``solve.PIVOT_GUARD``) left out, whose pivots
are little but rounding; the diagonal of a system is 1."""

ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Rounding error of a field, over the sum of the absolute weights: a few times the one measured."""

DENSE = 4000  # rows of the largest system that is factorised with twice the digits: 256 MB

SLOW = 0.3
"""Refinement ends after a round whose error is above this part of the error of the round before."""

ROUNDS = 4
STEPS = 40
"""Most rounds of a refinement, each with a new residual, and most conjugate gradient steps of a
round."""

MARGIN = 10.0
"""Factor of an error that conjugate gradients measure: up to seven times too small where nodes
nearly coincide, for the preconditioner does not see them."""

NOISES = 4  # columns of data that are rounding, by which its error is estimated

CHECKS = 60  # number of points between control nodes at each of four distances (`check_points`)


@record
class Refined:
    """A refined solution."""

    weights: FloatArray  # (n, m)
    error_estimate: FloatArray
    """(m,): error of each column's field, as a part of its largest data: a bound where ``exact``,
    an estimate times `MARGIN` else."""
    before: FloatArray
    """(m,): the same of the solution that was refined, measured in the first round."""
    exact: bool  # whether the system was factorised with twice the digits


@record
class System:
    """An interpolation system with its factor, to estimate errors and to refine solutions."""

    basis: Basis
    place: Rows
    """Features (k, n) of the node of each row, and its unit direction (n, d) or None."""
    factor: Factor  # without the rows that the pivot guard left out

    def rough_data(self) -> FloatArray:
        """Return test data (n, 3): a sine wave along each axis, over the extent of the nodes.

        If the rows have directions, the data are (n, 1): the components of the waves along them.
        """
        features, normals = self.place
        count = 3 if normals is None else normals.shape[1]
        at = features[:count] - features[:count].min(axis=1, keepdims=True)
        span = at.max(axis=1, keepdims=True)
        waves = np.sin(2.0 * np.pi * at / np.where(span > 0.0, span, 1.0)).T
        return waves if normals is None else (waves * normals).sum(axis=1, keepdims=True)

    def field_error(self, right: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the largest error (m,) of the field of weights (n, m) at some `check_points`.

        ``right`` (n, m): right-hand sides that the weights solve for; m = 1 with directions.
        """
        features, normals = self.place
        along = weights if normals is None else normals * weights
        met = evaluate(self.basis, features, features, along)
        if normals is not None:
            met = row_dots(met, normals)[:, None]
        with enough_threads(2.0 * len(right) ** 2):
            return self._field(self._full_factor.solve(right - met))

    def refined(
        self,
        right: FloatArray,
        largest: FloatArray,
        start: FloatArray,
        tick: Tick = no_tick,
        *,
        of_weights: bool = False,
    ) -> Refined:
        """Return the weights that meet all rows, also those that the guard left out.

        ``right`` and ``start`` (n, m): right-hand sides, and weights to begin with.
        ``largest`` (m,): the largest data of each column, relative to which errors of its field
        are.
        ``of_weights``: whether the weights themselves are the result, as of an adjoint system,
        where the field does not show errors in the weights of nodes that nearly coincide. The doubt
        is then the largest change of a weight in the last round, as a part of the largest weight.
        """
        weights = start.copy()
        low = np.zeros_like(start)
        residuals = self._residuals
        size = np.where(largest > 0.0, largest, 1.0)
        error_estimate = np.full(len(size), np.inf)
        first: FloatArray | None = None
        open_ = np.arange(len(size))
        for _ in range(ROUNDS):
            before = weights[:, open_]
            lacking = residuals(right[:, open_], before, low[:, open_], tick)
            step, field_error = self._step(
                lacking, before, size[open_], tick, of_weights=of_weights
            )
            first = field_error / size if first is None else first
            weights[:, open_] = before + step
            low[:, open_] += before - weights[:, open_] + step
            now = field_error / size[open_]
            if of_weights:
                most = np.abs(weights[:, open_]).max(axis=0)
                now = np.abs(step).max(axis=0) / np.where(most > 0.0, most, 1.0)
            going = (now > VERIFIED) & (now < SLOW * error_estimate[open_])
            error_estimate[open_] = now
            open_ = open_[going]
            if not len(open_):
                break
        assert first is not None
        factor = self._double_factor(tick)
        if not of_weights:
            margin = 1.0 if factor is not None else MARGIN
            rounding = ROUNDING * np.abs(weights).sum(axis=0) / size
            return Refined(weights, margin * error_estimate + rounding, first, factor is not None)
        if factor is not None:
            # Data of a reverse pass are sums, whose rounding the inverse of the system enlarges:
            # most where neighbours have different signs.
            signs = ROUNDING / 2.0 * np.where(np.arange(len(right)) % 2, 1.0, -1.0)
            most = np.abs(weights).max(axis=0)
            noise = np.abs(factor.solve(right * signs[:, None])).max(axis=0)
            error_estimate += noise / np.where(most > 0.0, most, 1.0)
        return Refined(weights, error_estimate, first, factor is not None)

    def noise(self, tick: Tick = no_tick) -> float:
        """Return the largest component of the field of data that are rounding, with random signs.

        Displacements are differences of coordinates. Where two nodes nearly coincide, as in a mesh
        that has collapsed, their rounding makes a steep field, however well the system is solved.
        """
        features = self.place[0]
        signs = np.random.default_rng(0).choice((-1.0, 1.0), (features.shape[1], NOISES))
        rounding = float(np.finfo(float).eps * np.abs(features).max())
        factor = self._double_factor(tick) or self._full_factor
        return float(self._field(factor.solve(rounding * signs)).max())

    def _step(
        self,
        lacking: FloatArray,
        weights: FloatArray,
        size: FloatArray,
        tick: Tick,
        *,
        of_weights: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the change of weights (n, m) in a round, and the error of their field before it.

        By conjugate gradients for the residual ``lacking`` (n, m). Each column ends by itself, so
        that its result does not depend on the others.
        """
        if (factor := self._double_factor(tick)) is not None:
            exact = factor.solve(lacking)
            return exact, self._field(exact)
        full_factor = self._full_factor
        residuals = self._residuals
        r = lacking.copy()
        total = np.zeros_like(r)
        z = full_factor.solve(r)
        p = z.copy()
        rz = (r * z).sum(axis=0)
        field_error = self._field(z)
        on = np.flatnonzero(((field_error > VERIFIED * size) | of_weights) & (rz > 0.0))
        for _ in range(STEPS):
            if not len(on):
                break
            nothing = np.zeros_like(p[:, on])
            q = residuals(nothing, -p[:, on], nothing, tick)
            curved = (p[:, on] * q).sum(axis=0)
            on = on[curved > 0.0]
            q = q[:, curved > 0.0]
            curved = curved[curved > 0.0]
            change = p[:, on] * (rz[on] / curved)
            total[:, on] += change
            r[:, on] -= q * (rz[on] / curved)
            most = np.abs(weights[:, on] + total[:, on]).max(axis=0)
            going = self._field(change) > SETTLED * size[on]
            on = on[going | (np.abs(change).max(axis=0) > SETTLED * most)]
            z = full_factor.solve(r[:, on])
            new = (r[:, on] * z).sum(axis=0)
            p[:, on] = z + p[:, on] * (new / rz[on])
            rz[on] = new
            on = on[new > 0.0]
        return total, field_error

    def _field(self, weights: FloatArray) -> FloatArray:
        """Return the largest component (m,) of the field of weights (n, m) at `check_points`."""
        normals = self.place[1]
        along = [weights] if normals is None else [weights * n[:, None] for n in normals.T]
        found = [np.abs(self._checks @ each).max(axis=0, initial=0.0) for each in along]
        return np.max(found, axis=0)

    @cached_property
    def _checks(self) -> FloatArray:
        """The matrix that evaluates a field at `check_points`."""
        features = self.place[0]
        return matrix(self.basis, (check_points(features), None), (features, None))

    @cached_property
    def _full_factor(self) -> Factor:
        """A factor of all rows; for those that were left out it is not exact (`SHIFT`)."""
        if not len(self.factor.dropped):
            return self.factor
        return with_dropped_rows(self.basis, self.place, self.factor)

    def _double_factor(self, tick: Tick) -> DoubleFactor | None:
        """Return the factor with twice the digits; None of a large or a singular system."""
        small = self.place[0].shape[1] <= DENSE and supports(self.basis)
        make = partial(DoubleFactor.of, self._residuals, tick)
        return _FACTORS.of(self, None, make) if small else None

    @cached_property
    def _residuals(self) -> Residuals:
        return Residuals(self.basis, self.place)


def with_dropped_rows(basis: Basis, place: Rows, factor: Factor) -> Factor:
    """Return ``factor`` with the rows appended that it left out, with `SHIFT` on their diagonal.

    Ten times `SHIFT`, and so on, where the rows are not positive definite with that.
    """
    kept = factor.retained
    dropped = factor.dropped
    features, normals = place
    outside = features[:, dropped], None if normals is None else normals[dropped]
    rows = matrix(basis, outside, place)
    k = len(kept)
    n = len(kept) + len(dropped)
    with enough_threads(2.0 * k * k * len(dropped)):
        beside = solve_lower(factor.lower, rows[:, kept].T).T
        rest = rows[:, dropped] - beside @ beside.T
        lower = np.zeros((n, n), order="F")
        lower[:k, :k] = factor.lower
        lower[k:, :k] = beside
        shift = SHIFT
        while True:
            try:
                corner = np.linalg.cholesky(rest + shift * np.eye(n - k))
                break
            except np.linalg.LinAlgError:
                shift *= 10.0
    lower[k:, k:] = corner
    return Factor(lower, np.concatenate([kept, dropped]), NO_NODES)


def check_points(features: FloatArray) -> FloatArray:
    """Return points (k, m) halfway between nodes with features (k, n), adjacent and distant ones.

    Adjacent in the order of the nodes, or a sixteenth, a quarter and a half of all nodes apart.
    """
    n = features.shape[1]
    ends = np.arange(0, n, max(1, n // CHECKS))
    others = [(ends + apart) % n for apart in (1, n // 16, n // 4, n // 2)]
    return np.concatenate([(features[:, ends] + features[:, o]) / 2 for o in others], axis=1)
