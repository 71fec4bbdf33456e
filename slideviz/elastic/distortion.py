"""The distortion energy of a deformed mesh, with its slopes and curvatures by nodes, compiled.

At each corner of a cell let F map the undeformed edges to the deformed ones, J = det F, and

    e(F) = (|F|^2 + |cof F|^2 / chi^2) / 4 - d / 2 + lam log^2 chi,

with chi = (J + sqrt(eps^2 + J^2)) / 2. Where eps = 0, the second term is |F^-1|^2 / 4: the energy
is infinite where a cell folds, and zero for rotations. A cell counts with the mean over its corners
of e + kappa e^2, whatever its size: thin cells of boundary layers keep their shape. lam couples the
lengths of a cell, but not where it is thin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from slideviz.elastic.stiffness import by_node
from slideviz.mesh.jacobians import CORNERS, LANES, cross3, dot3, edge, gather
from slideviz.mesh.model import Cells, FloatArray, IntArray, frozen_array, sealed
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

COUPLING = 1.5
THIN = 0.3
"""lam of round cells, and the thinness below which it is smaller."""

WORST = 5.0  # kappa

FLAT = 1e-12  # Jacobian of an undeformed corner over the product of its edges; flatter are left out


@dataclass(frozen=True, eq=False)
class Part:
    """The cells of one type."""

    vtk: int
    nodes: IntArray  # (m, n)
    coupling: FloatArray  # (m,): lam


@dataclass(frozen=True, eq=False)
class Distortion:
    """The distortion energy of a mesh, compared with its undeformed points."""

    points: FloatArray  # (n, d): undeformed
    parts: tuple[Part, ...]

    @property
    def count(self) -> int:
        """The number of cells."""
        return sum(len(part.nodes) for part in self.parts)

    @classmethod
    def of(cls, points: FloatArray, cells: Cells) -> Distortion:
        """Return the energy of ``cells`` with undeformed ``points`` (n, d)."""
        points = frozen_array(points, np.float64)
        parts = tuple(
            Part(vtk, sealed(nodes), sealed(_coupling(points[nodes])))
            for vtk, (_, nodes) in cells.by_type.items()
        )
        return cls(points, parts)

    def slopes(
        self, x: FloatArray, worst: float = WORST, epsilon: float = 0.0
    ) -> tuple[float, FloatArray, FloatArray]:
        """Return the energy at positions x (n, d), its gradient (n, d), and the least J of cells.

        ``worst``: kappa.
        """
        x = sealed(np.ascontiguousarray(x))
        values = np.zeros(self.count)
        least = np.empty(self.count)
        folded: list[bool] = []

        def add(part: Part, rows: slice, place: slice, out: FloatArray) -> None:
            if folded:
                return
            write_slopes(
                self.points,
                x,
                part.nodes[rows],
                CORNERS[part.vtk],
                part.coupling[rows],
                worst,
                epsilon,
                values[place],
                out,
                least[place],
            )
            if not np.isfinite(values[place.start]):
                folded.append(True)

        each = self._by_corner(add)
        if folded:
            return np.inf, np.zeros_like(x), np.full(self.count, -np.inf)
        return float(values.sum()), self._by_node(each), least

    def product(self, x: FloatArray, t: FloatArray) -> FloatArray:
        """Return the Hessian at x (n, d), where no cell is folded, times t (n, d)."""
        x = sealed(np.ascontiguousarray(x))
        t = sealed(np.ascontiguousarray(t))

        def add(part: Part, rows: slice, _place: slice, out: FloatArray) -> None:
            write_product(
                self.points,
                x,
                t,
                part.nodes[rows],
                CORNERS[part.vtk],
                part.coupling[rows],
                WORST,
                out,
            )

        return self._by_node(self._by_corner(add))

    def _by_corner(self, add: Callable[[Part, slice, slice, FloatArray], None]) -> FloatArray:
        """Return what ``add`` writes for the corners of all cells, one after the other."""
        each = np.empty((sum(part.nodes.size for part in self.parts), self.points.shape[1]))
        first = 0
        cell = 0
        for part in self.parts:
            m, a = part.nodes.shape
            corners = each[first : first + m * a].reshape(m, a, -1)
            in_parts(partial(_one_part, add, part, cell, corners), m)
            first += m * a
            cell += m
        return each

    def _by_node(self, each: FloatArray) -> FloatArray:
        """Return the sums (n, d) over the corners of each node."""
        out = np.empty(self.points.shape)
        indptr, entries = self._corners
        in_parts(
            lambda s: add_by_node(indptr[s.start : s.stop + 1], entries, each, out[s]), len(out)
        )
        return out

    @cached_property
    def _corners(self) -> tuple[IntArray, IntArray]:
        nodes = np.concatenate([part.nodes.ravel() for part in self.parts])
        return by_node(nodes, len(self.points))


def _one_part(
    add: Callable[[Part, slice, slice, FloatArray], None],
    part: Part,
    cell: int,
    corners: FloatArray,
    rows: slice,
) -> None:
    add(part, rows, slice(cell + rows.start, cell + rows.stop), corners[rows])


def _coupling(corners: FloatArray) -> FloatArray:
    """Return lam (m,) of cells with corner points (m, n, d)."""
    apart = corners - corners.mean(axis=1, keepdims=True)
    squares = np.linalg.eigvalsh(np.einsum("mai,maj->mij", apart, apart))
    thinness = np.sqrt(np.maximum(squares[:, 0], 0.0) / np.maximum(squares[:, -1], 1e-300))
    t = np.minimum(thinness / THIN, 1.0)
    return COUPLING * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)


@njit
def add_by_node(indptr, entries, each, out):  # type: ignore[no-untyped-def]
    """Write the sums of rows ``entries`` of each (m, d) to out (n, d)."""
    for row in range(len(out)):
        for i in range(out.shape[1]):
            total = 0.0
            for k in range(indptr[row], indptr[row + 1]):
                total += each[entries[k], i]
            out[row, i] = total


@njit(inline="always")
def _edges(points, nodes, e, corner, out):  # type: ignore[no-untyped-def]
    """Write the edges that leave a corner as columns of out (3, 3)."""
    d = points.shape[1]
    o = nodes[e, corner[0]]
    for k in range(3):
        for i in range(3):
            out[i, k] = 0.0
    out[2, 2] = 1.0
    for k in range(d):
        other = nodes[e, corner[1 + k]]
        for i in range(d):
            out[i, k] = points[other, i] - points[o, i]


@njit(inline="always")
def _cofactors(f, out):  # type: ignore[no-untyped-def]
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        for a in range(3):
            b = (a + 1) % 3
            c = (a + 2) % 3
            out[i, a] = f[j, b] * f[k, c] - f[j, c] * f[k, b]
    return f[0, 0] * out[0, 0] + f[0, 1] * out[0, 1] + f[0, 2] * out[0, 2]


@njit(inline="always")
def _times(a, b, out):  # type: ignore[no-untyped-def]
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(inline="always")
def _gram(a, b, out):  # type: ignore[no-untyped-def]
    """Write a^T b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]


@njit(inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += a[i, j] * b[i, j]
    return total


@njit(inline="always")
def _inverse(points, nodes, e, corner, edges, inverse):  # type: ignore[no-untyped-def]
    _edges(points, nodes, e, corner, edges)
    cof = np.empty((3, 3))
    det = _cofactors(edges, cof)
    size = 1.0
    for k in range(3):
        size *= np.sqrt(edges[0, k] ** 2 + edges[1, k] ** 2 + edges[2, k] ** 2)
    if not abs(det) > FLAT * size:
        return False
    for i in range(3):
        for j in range(3):
            inverse[i, j] = cof[j, i] / det
    return True


@njit(inline="always")
def _mixed(h, a, b, c):  # type: ignore[no-untyped-def]
    """Return h_0 a + h_1 b + h_2 c, of triples."""
    return (
        h[0] * a[0] + h[1] * b[0] + h[2] * c[0],
        h[0] * a[1] + h[1] * b[1] + h[2] * c[1],
        h[0] * a[2] + h[1] * b[2] + h[2] * c[2],
    )


@njit
def _write_maps(start, at, corner, d, count, duals, maps, jacobian, squares, cofactors):  # type: ignore[no-untyped-def]
    """Write the dual edges of undeformed corners, (3, 3, LANES), and the maps F, by columns.

    And of F the determinant, and the squares of F and of its cofactors, (LANES,).
    """
    o = corner[0]
    i = corner[1]
    j = corner[2]
    k = corner[d] if d == 3 else corner[2]
    up = 1.0 if d == 2 else 0.0
    for c in range(count):
        a = edge(start, o, i, c)
        b = edge(start, o, j, c)
        last = edge(start, o, k, c)
        last = (last[0] * (1.0 - up), last[1] * (1.0 - up), last[2] + up)
        x = cross3(b, last)
        y = cross3(last, a)
        z = cross3(a, b)
        det = dot3(a, x)
        size = np.sqrt(dot3(a, a) * dot3(b, b) * dot3(last, last))
        solid = abs(det) > FLAT * size
        scale = 1.0 / det if solid else 0.0
        x = (scale * x[0], scale * x[1], scale * x[2])
        y = (scale * y[0], scale * y[1], scale * y[2])
        z = (scale * z[0], scale * z[1], scale * z[2])
        a = edge(at, o, i, c)
        b = edge(at, o, j, c)
        last = edge(at, o, k, c)
        last = (last[0] * (1.0 - up), last[1] * (1.0 - up), last[2] + up)
        one = 0.0 if solid else 1.0
        f = _mixed((x[0], y[0], z[0]), a, b, last)
        g = _mixed((x[1], y[1], z[1]), a, b, last)
        h = _mixed((x[2], y[2], z[2]), a, b, last)
        f = (f[0] + one, f[1], f[2])
        g = (g[0], g[1] + one, g[2])
        h = (h[0], h[1], h[2] + one)
        for axis in range(3):
            duals[0, axis, c] = x[axis]
            duals[1, axis, c] = y[axis]
            duals[2, axis, c] = z[axis]
            maps[0, axis, c] = f[axis]
            maps[1, axis, c] = g[axis]
            maps[2, axis, c] = h[axis]
        p = cross3(g, h)
        q = cross3(h, f)
        r = cross3(f, g)
        jacobian[c] = dot3(f, p)
        squares[c] = dot3(f, f) + dot3(g, g) + dot3(h, h)
        cofactors[c] = dot3(p, p) + dot3(q, q) + dot3(r, r)


@njit
def write_slopes(points, x, nodes, table, coupling, worst, epsilon, values, out, least):  # type: ignore[no-untyped-def]
    """Write the energies of cells (m,), their slopes (m, n, d) by nodes, and least J (m,).

    It ends at the first cell whose energy is infinite.
    """
    d = points.shape[1]
    n = nodes.shape[1]
    start, at, slope = np.zeros((3, 3, n, LANES))
    duals, maps = np.empty((2, 3, 3, LANES))
    jacobian, squares, cofactors, first_part, second_part, third_part, value, low = np.empty(
        (8, LANES)
    )
    share = 1.0 / len(table)
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, start)
        gather(x, nodes, first, count, at)
        slope[:] = 0.0
        value[:] = 0.0
        low[:] = np.inf
        for k in range(len(table)):
            _write_maps(start, at, table[k], d, count, duals, maps, jacobian, squares, cofactors)
            for c in range(count):
                j = jacobian[c]
                root = np.sqrt(epsilon * epsilon + j * j)
                chi = 0.5 * (j + root) if j > 0.0 else 0.5 * epsilon * epsilon / (root - j)
                low[c] = min(low[c], j)
                if not chi > 0.0:
                    values[0] = np.inf
                    return
                lam = coupling[first + c]
                log = np.log(chi) if lam > 0.0 else 0.0
                inverse = 1.0 / chi
                q = cofactors[c] * inverse * inverse
                one = 0.25 * (squares[c] + q) - 1.5 + lam * log * log
                value[c] += share * (one + worst * one * one)
                weight = share * (1.0 + 2.0 * worst * one)
                first_part[c] = 0.5 * weight
                second_part[c] = 0.5 * weight * inverse * inverse
                force = (-0.5 * q + 2.0 * lam * log) * inverse
                third_part[c] = weight * force * chi / root
            _add_slopes(
                table[k], d, count, duals, maps, squares, first_part, second_part, third_part, slope
            )
        for c in range(count):
            values[first + c] = value[c]
            least[first + c] = low[c]
        for c in range(count):
            for j in range(n):
                for axis in range(d):
                    out[first + c, j, axis] = slope[axis, j, c]


@njit
def _add_slopes(corner, d, count, duals, maps, squares, one, two, three, slope):  # type: ignore[no-untyped-def]
    """Add the slopes of a corner to slope (3, n, LANES).

    They are ``one F + two (|F|^2 F - F C) + three cof F``.
    """
    o = corner[0]
    i = corner[1]
    j = corner[2]
    for c in range(count):
        f = maps[0, 0, c], maps[0, 1, c], maps[0, 2, c]
        g = maps[1, 0, c], maps[1, 1, c], maps[1, 2, c]
        h = maps[2, 0, c], maps[2, 1, c], maps[2, 2, c]
        fg = dot3(f, g)
        gh = dot3(g, h)
        hf = dot3(h, f)
        near = one[c] + two[c] * squares[c]
        u = cross3(g, h)
        v = cross3(h, f)
        w = cross3(f, g)
        s = two[c]
        p = _mixed((near - s * dot3(f, f), -s * fg, -s * hf), f, g, h)
        q = _mixed((-s * fg, near - s * dot3(g, g), -s * gh), f, g, h)
        r = _mixed((-s * hf, -s * gh, near - s * dot3(h, h)), f, g, h)
        t = three[c]
        p = (p[0] + t * u[0], p[1] + t * u[1], p[2] + t * u[2])
        q = (q[0] + t * v[0], q[1] + t * v[1], q[2] + t * v[2])
        r = (r[0] + t * w[0], r[1] + t * w[1], r[2] + t * w[2])
        a = _mixed((duals[0, 0, c], duals[0, 1, c], duals[0, 2, c]), p, q, r)
        b = _mixed((duals[1, 0, c], duals[1, 1, c], duals[1, 2, c]), p, q, r)
        for axis in range(3):
            slope[axis, i, c] += a[axis]
            slope[axis, j, c] += b[axis]
            slope[axis, o, c] -= a[axis] + b[axis]
        if d == 3:
            k = corner[3]
            last = _mixed((duals[2, 0, c], duals[2, 1, c], duals[2, 2, c]), p, q, r)
            for axis in range(3):
                slope[axis, k, c] += last[axis]
                slope[axis, o, c] -= last[axis]


@njit
def write_product(points, x, t, nodes, table, coupling, worst, out):  # type: ignore[no-untyped-def]
    """Write the Hessians of cells times t (n, d), (m, n, d) by nodes."""
    d = points.shape[1]
    g0 = np.empty((3, 3))
    edges = np.empty((3, 3))
    f = np.empty((3, 3))
    h = np.empty((3, 3))
    cof = np.empty((3, 3))
    dcof = np.empty((3, 3))
    c = np.empty((3, 3))
    dc = np.empty((3, 3))
    fc = np.empty((3, 3))
    hc = np.empty((3, 3))
    fdc = np.empty((3, 3))
    p = np.empty((3, 3))
    dp = np.empty((3, 3))
    share = 1.0 / len(table)
    for e in range(len(nodes)):
        out[e] = 0.0
        lam = coupling[e]
        for k in range(len(table)):
            if not _inverse(points, nodes, e, table[k], edges, g0):
                continue
            _edges(x, nodes, e, table[k], edges)
            _times(edges, g0, f)
            _edges(t, nodes, e, table[k], edges)
            if d == 2:
                edges[2, 2] = 0.0
            _times(edges, g0, h)
            chi = _cofactors(f, cof)
            _gram(f, f, c)
            _gram(f, h, dc)
            for i in range(3):
                for j in range(i, 3):
                    both = dc[i, j] + dc[j, i]
                    dc[i, j] = both
                    dc[j, i] = both
            a = c[0, 0] + c[1, 1] + c[2, 2]
            da = dc[0, 0] + dc[1, 1] + dc[2, 2]
            q = 0.5 * (a * a - _dot(c, c))
            dq = a * da - _dot(c, dc)
            dchi = _dot(cof, h)
            log = np.log(chi)
            one = 0.25 * (a + q / (chi * chi)) - 1.5 + lam * log * log
            force = -0.5 * q / (chi * chi * chi) + 2.0 * lam * log / chi
            dforce = (
                -0.5 * dq / (chi * chi * chi)
                + 1.5 * q / (chi * chi * chi * chi) * dchi
                + 2.0 * lam * (1.0 - log) / (chi * chi) * dchi
            )
            for i in range(3):
                j = (i + 1) % 3
                m = (i + 2) % 3
                for u in range(3):
                    v = (u + 1) % 3
                    w = (u + 2) % 3
                    dcof[i, u] = (
                        h[j, v] * f[m, w]
                        + f[j, v] * h[m, w]
                        - h[j, w] * f[m, v]
                        - f[j, w] * h[m, v]
                    )
            _times(f, c, fc)
            _times(h, c, hc)
            _times(f, dc, fdc)
            i2 = 1.0 / (chi * chi)
            for i in range(3):
                for j in range(3):
                    big = a * f[i, j] - fc[i, j]
                    p[i, j] = 0.5 * f[i, j] + 0.5 * big * i2 + force * cof[i, j]
                    dbig = da * f[i, j] + a * h[i, j] - hc[i, j] - fdc[i, j]
                    dp[i, j] = (
                        0.5 * h[i, j]
                        + 0.5 * dbig * i2
                        - big * dchi * i2 / chi
                        + dforce * cof[i, j]
                        + force * dcof[i, j]
                    )
            w1 = share * (1.0 + 2.0 * worst * one)
            w2 = share * 2.0 * worst * _dot(p, h)
            for i in range(3):
                for j in range(3):
                    dp[i, j] = w1 * dp[i, j] + w2 * p[i, j]
            for j in range(d):
                for i in range(d):
                    pull = dp[i, 0] * g0[j, 0] + dp[i, 1] * g0[j, 1] + dp[i, 2] * g0[j, 2]
                    out[e, table[k, 1 + j], i] += pull
                    out[e, table[k, 0], i] -= pull


@njit
def write_laplacians(points, nodes, table, coupling, out):  # type: ignore[no-untyped-def]
    """Write ``1 + lam`` times the mean over corners of grad N_a . grad N_b to ``out`` (m, n, n)."""
    d = points.shape[1]
    edges = np.empty((3, 3))
    dual = np.empty((3, 3))
    for e in range(len(nodes)):
        out[e] = 0.0
        share = (1.0 + coupling[e]) / len(table)
        for k in range(len(table)):
            if not _inverse(points, nodes, e, table[k], edges, dual):
                continue
            o = table[k, 0]
            for a in range(d):
                for b in range(d):
                    one = 0.0
                    for i in range(d):
                        one += dual[a, i] * dual[b, i]
                    one *= share
                    i = table[k, 1 + a]
                    j = table[k, 1 + b]
                    out[e, i, j] += one
                    out[e, o, j] -= one
                    out[e, i, o] -= one
                    out[e, o, o] += one
