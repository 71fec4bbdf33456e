"""Residuals of interpolation systems in double-double arithmetic, twice the digits of a float64.

A number is the unevaluated sum of two float64: its rounding, and the rest (Dekker 1971); arguments
``a, al`` are the two of one number. Distances, radial functions, products and sums are computed so,
to about 1e-31, and only the final residual is rounded. Where weights are 1e9 times as large as
the data, a sum of ordinary products has lost nine digits; this one has not.
"""

from __future__ import annotations

from dataclasses import field as made_by

import numpy as np
from numba import prange

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray
from slideviz.rbf.compiled import _K, one_at_a_time
from slideviz.rbf.evaluate import Basis, Rows, Tick, no_tick
from slideviz.system.jit_cache import njit
from slideviz.terms import KERNELS

# Without "fastmath", which takes a + b - a for b.

FUNCTIONS: dict[str, tuple[int, tuple[float, ...]]] = {
    "wendland-c2": (4, (1.0, 4.0)),
    "wendland-c0": (2, (1.0,)),
    "wendland-c4": (6, (1.0, 6.0, 35.0 / 3.0)),
    "wendland-c6": (8, (1.0, 8.0, 25.0, 32.0)),
    "ctps-c0": (5, (1.0,)),
}
"""The radial functions that are (1 - xi)^p times a polynomial: p, and the polynomial's coefficients
from the constant on. The same functions are in `kernels` and `compiled`."""

PAIRS = 1_000_000  # pairs between two calls of ``tick``: some tens of milliseconds

ROWS = 16  # of a factor that a thread computes at once
STRIP = 256  # columns of it

KEPT = 2000  # rows of the largest system whose matrix is kept for further residuals: 64 MB


@njit(inline="always")
def _sum(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, rounded, and its rounding error."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@njit(inline="always")
def _product(a, b):  # type: ignore[no-untyped-def]
    """Return a b, rounded, and its rounding error."""
    t = 134217729.0 * a
    u = 134217729.0 * b
    a1 = t - (t - a)
    b1 = u - (u - b)
    a2 = a - a1
    b2 = b - b1
    p = a * b
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


@njit(inline="always")
def _joined(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, rounded, and its rounding error, for |a| >= |b|."""
    s = a + b
    return s, b - (s - a)


@njit(inline="always")
def _plus(a, al, b, bl):  # type: ignore[no-untyped-def]
    s, e = _sum(a, b)
    t, f = _sum(al, bl)
    s, e = _joined(s, e + t)
    return _joined(s, e + f)


@njit(inline="always")
def _times(a, al, b, bl):  # type: ignore[no-untyped-def]
    p, e = _product(a, b)
    return _joined(p, e + (a * bl + al * b))


@njit(inline="always")
def _root(a, al):  # type: ignore[no-untyped-def]
    first = np.sqrt(max(a, 1e-300))
    p, e = _product(first, first)
    rest, lost = _plus(a, al, -p, -e)
    return _joined(first, (rest + lost) * (0.5 / first))


@njit(inline="always")
def _one_minus_cos(g, gl):  # type: ignore[no-untyped-def]
    """Return 1 - cos g by the terms of ``compiled.one_minus_cos``."""
    t, tl = _times(g, gl, g, gl)
    p = _K[8]
    pl = 0.0
    for k in range(7, -1, -1):
        p, pl = _times(p, pl, t, tl)
        p, pl = _plus(p, pl, _K[k], 0.0)
    return _times(p, pl, t, tl)


@njit(inline="always")
def _plus_square(s, sl, a, b):  # type: ignore[no-untyped-def]
    d, dl = _sum(a, -b)
    p, pl = _times(d, dl, d, dl)
    return _plus(s, sl, p, pl)


@njit
def _distances(x, i, period_over_pi, scale, q, ql):  # type: ignore[no-untyped-def]
    """Write xi from node i to all nodes x (4, n) to q + ql, by ``compiled.squared_distance``."""
    c0 = x[0]
    c1 = x[1]
    c2 = x[2]
    c3 = x[3]
    x0 = x[0, i]
    x1 = x[1, i]
    x2 = x[2, i]
    x3 = x[3, i]
    for j in range(x.shape[1]):
        s, sl = _plus_square(0.0, 0.0, x0, c0[j])
        s, sl = _plus_square(s, sl, x3, c3[j])
        if period_over_pi > 0.0:
            a, al = _product(x1, c2[j])
            b, bl = _product(x2, c1[j])
            g, gl = _plus(a, al, -b, -bl)
            g, gl = _times(g, gl, period_over_pi, 0.0)
            h, hl = _one_minus_cos(g, gl)
            r, rl = _product(2.0 * x0, c0[j])
            h, hl = _times(h, hl, r, rl)
            s, sl = _plus(s, sl, h, hl)
        else:
            s, sl = _plus_square(s, sl, x1, c1[j])
            s, sl = _plus_square(s, sl, x2, c2[j])
        r, rl = _root(s, sl)
        q[j], ql[j] = _times(r, rl, scale, 0.0)


@njit
def _apply(power, terms, q, ql, v, vl):  # type: ignore[no-untyped-def]
    """Write the radial function of xi = q + ql (n,) to v + vl (n,); overwrites q and ql."""
    n = len(q)
    v[:] = terms[-1]
    vl[:] = 0.0
    for k in range(len(terms) - 2, -1, -1):
        for j in range(n):
            p, pl = _times(v[j], vl[j], q[j], ql[j])
            v[j], vl[j] = _plus(p, pl, terms[k], 0.0)
    for j in range(n):
        u, ul = _plus(1.0, 0.0, -q[j], -ql[j])
        inside = 1.0 if u > 0.0 else 0.0
        q[j] = inside * u
        ql[j] = inside * ul
    for _ in range(power):
        for j in range(n):
            v[j], vl[j] = _times(v[j], vl[j], q[j], ql[j])


@njit
def _turn(across, i, v, vl):  # type: ignore[no-untyped-def]
    """Multiply v + vl with the scalar products of direction i and all directions (d, n)."""
    for j in range(len(v)):
        dot = 0.0
        lost = 0.0
        for k in range(across.shape[0]):
            p, pl = _product(across[k, i], across[k, j])
            dot, lost = _plus(dot, lost, p, pl)
        v[j], vl[j] = _times(v[j], vl[j], dot, lost)


@njit(parallel=True)
def _fill(x, across, first, period_over_pi, scale, power, terms, v, vl):  # type: ignore[no-untyped-def]
    """Write rows of G from row ``first`` on to v + vl (p, n), of features x and directions."""
    n = x.shape[1]
    for row in prange(len(v)):
        q = np.empty(n)
        ql = np.empty(n)
        _distances(x, first + row, period_over_pi, scale, q, ql)
        _apply(power, terms, q, ql, v[row], vl[row])
        if across.shape[0] > 0:
            _turn(across, first + row, v[row], vl[row])


@njit(parallel=True)
def _lacking(v, vl, right, weights, low, out):  # type: ignore[no-untyped-def]
    """Write ``right - (v + vl) (weights + low)`` to out (p, m); weights and low are (m, n)."""
    for i in prange(len(v)):
        for k in range(len(weights)):
            total = right[i, k]
            lost = 0.0
            for j in range(v.shape[1]):
                p, e = _product(v[i, j], -weights[k, j])
                total, f = _sum(total, p)
                lost += e + f - (vl[i, j] * weights[k, j] + v[i, j] * low[k, j])
            out[i, k] = total + lost


@njit(inline="always")
def _over(a, al, b, bl):  # type: ignore[no-untyped-def]
    q = a / b
    p, pl = _times(b, bl, q, 0.0)
    r, rl = _plus(a, al, -p, -pl)
    return _joined(q, (r + rl) / b)


@njit(inline="always")
def _less_product(u, ul, k, j, first, last):  # type: ignore[no-untyped-def]
    """Subtract from row j of u + ul what row k makes of it, from column ``first`` to ``last``."""
    a = u[k, j]
    al = ul[k, j]
    b = u[k, first:last]
    bl = ul[k, first:last]
    s = u[j, first:last]
    lost = ul[j, first:last]
    for i in range(last - first):
        p, e = _product(-a, b[i])
        s[i], f = _sum(s[i], p)
        lost[i] += e + f - (a * bl[i] + al * b[i])


@njit(parallel=True)
def _factorise(u, ul, top):  # type: ignore[no-untyped-def]
    """Overwrite `ROWS` rows of u + ul (n, n) from ``top`` on by those of U with U^T U = u + ul.

    U is upper triangular; entries below its diagonal are undefined. Rows above ``top`` must be
    those of U already. Columns are processed in strips that fit into the cache. Returns False if
    there is no such U.
    """
    n = len(u)
    end = min(len(u), top + ROWS)
    for part in prange((n - top + STRIP - 1) // STRIP):
        first = top + part * STRIP
        last = min(n, top + (part + 1) * STRIP)
        for k in range(top):
            for j in range(top, min(end, last)):
                _less_product(u, ul, k, j, max(j, first), last)
    for j in range(top, end):
        for k in range(top, j):
            _less_product(u, ul, k, j, j, n)
        s, sl = _sum(u[j, j], ul[j, j])
        if not s > 0.0:
            return False
        d, dl = _root(s, sl)
        u[j, j] = d
        ul[j, j] = dl
        for i in range(j + 1, n):
            s, sl = _sum(u[j, i], ul[j, i])
            u[j, i], ul[j, i] = _over(s, sl, d, dl)
    return True


@njit(parallel=True)
def _solve(u, ul, x, xl):  # type: ignore[no-untyped-def]
    """Overwrite each row of x + xl (m, n) by its solution, with the factor from `_factorise`."""
    n = len(u)
    for c in prange(len(x)):
        for i in range(n):
            d, dl = _over(x[c, i], xl[c, i], u[i, i], ul[i, i])
            x[c, i] = d
            xl[c, i] = dl
            for k in range(i + 1, n):
                p, pl = _times(u[i, k], ul[i, k], -d, -dl)
                x[c, k], xl[c, k] = _plus(x[c, k], xl[c, k], p, pl)
        for i in range(n - 1, -1, -1):
            s = x[c, i]
            sl = xl[c, i]
            for k in range(i + 1, n):
                p, pl = _times(u[i, k], ul[i, k], -x[c, k], -xl[c, k])
                s, sl = _plus(s, sl, p, pl)
            x[c, i], xl[c, i] = _over(s, sl, u[i, i], ul[i, i])


@record
class Residuals:
    """Computes residuals of an interpolation system with twice the digits of a float64."""

    basis: Basis  # its kernel is one of ``FUNCTIONS``
    place: Rows
    """Features (k, n) of the node of each row, and its unit direction (n, d) or None."""
    _cache: dict[int, tuple[FloatArray, FloatArray]] = made_by(default_factory=dict)

    def __call__(
        self, right: FloatArray, weights: FloatArray, low: FloatArray, tick: Tick = no_tick
    ) -> FloatArray:
        """Return the residual ``right - G (weights + low)`` (n, m), rounded once.

        ``right``, ``weights``, ``low`` (n, m): ``low`` is the rest of weights beyond the digits of
        a float64.
        """
        out = np.empty_like(right)
        n = len(right)
        w = np.ascontiguousarray(weights.T)
        wl = np.ascontiguousarray(low.T)
        size = max(1, PAIRS // max(1, n))
        for first in range(0, n, size):
            part = slice(first, min(n, first + size))
            rows, rest = self._rows(part, n)
            with one_at_a_time(10 * rows.size * len(w)):
                _lacking(rows, rest, np.ascontiguousarray(right[part]), w, wl, out[part])
            tick(part.stop / n)
        return out

    def matrix(self) -> tuple[FloatArray, FloatArray]:
        """Return G (n, n), rounded, and its rounding errors."""
        n = self.place[0].shape[1]
        size = max(1, PAIRS // max(1, n))
        parts = [self._rows(slice(k, min(n, k + size)), n) for k in range(0, n, size)]
        rows, rest = zip(*parts, strict=True)
        return np.concatenate(rows), np.concatenate(rest)

    def _rows(self, part: slice, n: int) -> tuple[FloatArray, FloatArray]:
        """Return the rows ``part`` of G (p, n), rounded, and their rounding errors.

        Kept for the next call where G has at most `KEPT` rows.
        """
        if part.start in self._cache:
            return self._cache[part.start]
        features, normals = self.place
        x = np.zeros((4, n))
        x[: len(features)] = features
        across = np.zeros((0, n)) if normals is None else np.ascontiguousarray(normals.T)
        power, terms = FUNCTIONS[self.basis.kernel]
        found, rest = np.empty((2, part.stop - part.start, n))
        scale = 1.0 / self.basis.radius
        period_over_pi = self.basis.period_over_pi
        with one_at_a_time(100 * found.size):
            _fill(x, across, part.start, period_over_pi, scale, power, np.array(terms), found, rest)
        if n <= KEPT:
            self._cache[part.start] = found, rest
        return found, rest


@record
class DoubleFactor:
    """The double-double factor U = ``upper`` + ``low`` (n, n) of a system G = U^T U."""

    upper: FloatArray
    low: FloatArray

    @classmethod
    def of(cls, residuals: Residuals, tick: Tick = no_tick) -> DoubleFactor | None:
        """Return the factor of a system; None if it is singular in double-double arithmetic."""
        upper, low = residuals.matrix()
        for top in range(0, len(upper), ROWS):
            with one_at_a_time(40 * ROWS * (len(upper) - top) * top):
                if not _factorise(upper, low, top):
                    return None
            tick(top / len(upper))
        return cls(upper, low)

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the rounded solutions (n, m) for right-hand sides (n, m)."""
        x = np.array(right.T, order="C")
        low = np.zeros_like(x)
        with one_at_a_time(40 * len(x) * self.upper.size):
            _solve(self.upper, self.low, x, low)
        return np.ascontiguousarray(x.T)


def supports(basis: Basis) -> bool:
    """Return whether `Residuals` can be computed for the kernel of ``basis``."""
    return basis.kernel in FUNCTIONS and not KERNELS[basis.kernel].polynomial
