"""The distortion energy of a deformed mesh, with its slopes and curvatures by nodes, compiled.

At each corner of a cell let F map the undeformed edges to the deformed ones, J = det F, and

    e(F) = (|F|^2 + |cof F|^2 / chi^2) / 4 - d / 2 + lam log^2 chi,

with chi = (J + sqrt(eps^2 + J^2)) / 2. Where eps = 0, the second term is |F^-1|^2 / 4: the energy
is infinite where a cell folds, and zero for rotations. A cell counts with the mean over its corners
of e + kappa e^2, whatever its size: thin cells of boundary layers keep their shape. lam couples the
lengths of a cell, but not where it is thin.

Loops over ``LANES`` cells, a constant number of arrays of their own, are vectorised; in the last
round some work on what the one before left. A cell in a plane has a third edge (0, 0, 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np

from slideviz.argument_types import record
from slideviz.elastic.stiffness import by_node
from slideviz.mesh.jacobians import (
    CORNERS,
    LANES,
    add3,
    corner_edges,
    corner_ends,
    cross3,
    dot3,
    gather,
    scaled3,
)
from slideviz.mesh.model import Cells, FloatArray, IntArray, frozen_array, sealed
from slideviz.system.jit_cache import njit
from slideviz.system.threads import PART, in_parts

COUPLING = 1.5
THIN = 0.3
"""lam of round cells, and the thinness below which it is smaller."""

WORST = 5.0  # kappa

LEAST = 1e-3  # part of a cell's largest curvature that others have at least

FLAT = 1e-12  # Jacobian of an undeformed corner over the product of its edges; flatter are left out


@record
class Part:
    """The cells of one type."""

    vtk: int
    nodes: IntArray  # (m, n)
    rows: IntArray  # (m, n): of `Distortion.owners`, one after the other in each part of the cells
    coupling: FloatArray  # (m,): lam


@record
class Distortion:
    """The distortion energy of a mesh, compared with its undeformed points."""

    points: FloatArray  # (n, d): undeformed
    parts: tuple[Part, ...]
    owners: IntArray
    """(r,): the nodes of each part of the cells that threads share, whose sums are added last."""

    @property
    def count(self) -> int:
        """The number of cells."""
        return sum(len(part.nodes) for part in self.parts)

    @property
    def weights(self) -> FloatArray:
        """Return the weights (m,) of the Laplacian like it: 1 + lam."""
        return 1.0 + np.concatenate([part.coupling for part in self.parts])

    @classmethod
    def of(cls, points: FloatArray, cells: Cells) -> Distortion:
        """Return the energy of ``cells`` with undeformed ``points`` (n, d)."""
        points = frozen_array(points, np.float64)
        last = np.full(len(points), -1, np.int32)
        owners = []
        parts = []
        count = 0
        for vtk, (_, nodes) in cells.by_type.items():
            rows = np.empty(nodes.shape, np.int32)
            own = np.empty(nodes.size, np.int32)
            own = own[: number_rows(nodes, PART, count, last, rows, own)].copy()
            owners.append(own)
            count += len(own)
            coupling = np.empty(len(nodes))
            in_parts(partial(_write_coupling, points, nodes, coupling), len(nodes))
            parts.append(Part(vtk, sealed(nodes), sealed(rows), sealed(coupling)))
        return cls(points, tuple(parts), sealed(np.concatenate(owners)))

    def slopes(
        self, x: FloatArray, worst: float = WORST, epsilon: float = 0.0
    ) -> tuple[float, FloatArray, FloatArray]:
        """Return the energy at positions x (n, d), its gradient (n, d), and the least J of cells.

        ``worst``: kappa.
        """
        sums = np.zeros((len(self.owners), x.shape[1]))
        rows = [part.rows for part in self.parts]
        values, least = self._add_slopes(x, None, rows, sums, worst, epsilon)
        energy = float(values.sum())
        if not np.isfinite(energy):
            return np.inf, np.zeros_like(x), np.full(self.count, -np.inf)
        return energy, self._by_node(sums), least

    def product(self, x: FloatArray, t: FloatArray) -> FloatArray:
        """Return the Hessian at x (n, d), where no cell is folded, times t (n, d)."""
        sums = np.zeros((len(self.owners), x.shape[1]))
        self._add_slopes(x, t, [part.rows for part in self.parts], sums)
        return self._by_node(sums)

    def stiffness(self, x: FloatArray) -> FloatArray:
        """Return the mean curvatures of cells at x (n, d) by rows of their maps F, (m, d, d, d).

        Of each cell, the matrix of each row; what is not positive in it is left out.
        """
        d = x.shape[1]
        out = np.empty((self.count, d, d, d))
        sizes = [part.nodes.size for part in self.parts]
        ends = np.cumsum(sizes)
        corners = [
            np.arange(end - size, end, dtype=np.int32).reshape(part.nodes.shape)
            for part, size, end in zip(self.parts, sizes, ends, strict=True)
        ]
        for i, j in np.ndindex(d, d):
            stretch = np.zeros_like(x)
            stretch[:, i] = self.points[:, j]
            each = np.zeros((sum(sizes), d))
            self._add_slopes(x, stretch, corners, each)
            cell = 0
            for part, rows in zip(self.parts, corners, strict=True):
                m = len(part.nodes)
                edges = self.points[part.nodes] - self.points[part.nodes[:, :1]]
                out[cell : cell + m, i, j] = np.einsum("mn,mnk->mk", each[rows, i], edges)
                cell += m
        size, along = np.linalg.eigh(out)
        size = np.maximum(size, LEAST * np.abs(size).max(axis=-1, keepdims=True))
        return np.einsum("mixk,mik,miyk->mixy", along, size, along)

    def _add_slopes(
        self,
        x: FloatArray,
        t: FloatArray | None,
        rows: Sequence[IntArray],
        out: FloatArray,
        worst: float = WORST,
        epsilon: float = 0.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Return energies and least J of cells; add the slopes of each to ``rows`` (m, n) of out.

        With ``t`` (n, d) the Hessians times it in place of the slopes. Where a cell is folded, some
        energy is infinite, and others are missing.
        """
        x = sealed(np.ascontiguousarray(x))
        along = None if t is None else sealed(np.ascontiguousarray(t))
        values = np.zeros(self.count)
        least = np.empty(self.count)
        folded = False
        first = 0

        def add(part: Part, of_corners: IntArray, cells: slice) -> None:
            nonlocal folded
            place = slice(first + cells.start, first + cells.stop)
            if not folded:
                write_slopes(
                    self.points,
                    x,
                    along,
                    part.nodes[cells],
                    of_corners[cells],
                    CORNERS[part.vtk],
                    part.coupling[cells],
                    worst,
                    epsilon,
                    values[place],
                    out,
                    least[place],
                )
                folded = folded or (along is None and not np.isfinite(values[place.start]))

        for part, of_corners in zip(self.parts, rows, strict=True):
            in_parts(partial(add, part, of_corners), len(part.nodes))
            first += len(part.nodes)
        return values, least

    def _by_node(self, sums: FloatArray) -> FloatArray:
        """Return the sums (n, d) over the rows of each node."""
        out = np.empty(self.points.shape)
        indptr, entries = self._rows_of_nodes
        in_parts(
            lambda s: add_by_node(indptr[s.start : s.stop + 1], entries, sums, out[s]), len(out)
        )
        return out

    @cached_property
    def _rows_of_nodes(self) -> tuple[IntArray, IntArray]:
        return by_node(self.owners, len(self.points))


def _write_coupling(points: FloatArray, nodes: IntArray, out: FloatArray, rows: slice) -> None:
    write_coupling(points, nodes[rows], out[rows])


@njit
def write_coupling(points, nodes, out):  # type: ignore[no-untyped-def]
    """Write lam of cells (m,) with ``nodes`` (m, n): of their thinness, by their inertia."""
    n = nodes.shape[1]
    d = points.shape[1]
    inertia = np.empty((d, d))
    centre = np.empty(d)
    for cell in range(len(nodes)):
        inertia[:] = 0.0
        centre[:] = 0.0
        for k in range(n):
            for i in range(d):
                centre[i] += points[nodes[cell, k], i] / n
        for k in range(n):
            for i in range(d):
                for j in range(d):
                    a = points[nodes[cell, k], i] - centre[i]
                    inertia[i, j] += a * (points[nodes[cell, k], j] - centre[j])
        mean = 0.0
        for i in range(d):
            mean += inertia[i, i] / d
        for i in range(d):
            inertia[i, i] -= mean
        # The extreme eigenvalues, by the trigonometric solution of the characteristic equation.
        size = 0.0
        for i in range(d):
            for j in range(d):
                size += inertia[i, j] ** 2
        size = np.sqrt(size / 6.0) if d == 3 else np.sqrt(0.125 * size)
        angle = 0.0
        if d == 3 and size > 0.0:
            det = dot3(inertia[0], cross3(inertia[1], inertia[2]))
            angle = np.arccos(min(max(0.5 * det / size**3, -1.0), 1.0)) / 3.0
        most = mean + 2.0 * size * np.cos(angle)
        turn = 2.0 * np.pi / 3.0 if d == 3 else np.pi
        least = mean + 2.0 * size * np.cos(angle + turn)
        t = min(np.sqrt(max(least, 0.0) / max(most, 1e-300)) / THIN, 1.0)
        out[cell] = COUPLING * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)


@njit
def number_rows(nodes, size, count, last, rows, owners):  # type: ignore[no-untyped-def]
    """Write the row of each corner of cells (m, n), from ``count`` on; return how many there are.

    Each part of ``size`` cells has one for each of its nodes, which is written to ``owners``.
    ``last``: the row that a node had last, or -1.
    """
    stop = count
    for first in range(0, len(nodes), size):
        begin = stop
        for cell in range(first, min(first + size, len(nodes))):
            for k in range(nodes.shape[1]):
                node = nodes[cell, k]
                if last[node] < begin:
                    last[node] = stop
                    owners[stop - count] = node
                    stop += 1
                rows[cell, k] = last[node]
    return stop - count


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
def _mixed(s, a, t, b, u, c):  # type: ignore[no-untyped-def]
    """Return s a + t b + u c, of triples a, b and c."""
    return (
        s * a[0] + t * b[0] + u * c[0],
        s * a[1] + t * b[1] + u * c[1],
        s * a[2] + t * b[2] + u * c[2],
    )


@njit(inline="always")
def _crosses(a, b, c, d):  # type: ignore[no-untyped-def]
    return add3(cross3(a, b), cross3(c, d))


@njit(inline="always")
def _duals(start, ends, scale, c):  # type: ignore[no-untyped-def]
    """Return the dual edges of an undeformed corner; ``scale`` is one over its Jacobian."""
    a, b, last = corner_edges(start, ends, ends[4], c)
    x = cross3(b, last)
    y = cross3(last, a)
    z = cross3(a, b)
    return scaled3(scale, x), scaled3(scale, y), scaled3(scale, z)


@njit(inline="always")
def _map(duals, edges, flat):  # type: ignore[no-untyped-def]
    """Return the columns of the map to ``edges``, plus ``flat`` times the identity."""
    x, y, z = duals
    a, b, last = edges
    f = _mixed(x[0], a, y[0], b, z[0], last)
    g = _mixed(x[1], a, y[1], b, z[1], last)
    h = _mixed(x[2], a, y[2], b, z[2], last)
    return (f[0] + flat, f[1], f[2]), (g[0], g[1] + flat, g[2]), (h[0], h[1], h[2] + flat)


@njit(inline="always")
def _write_scales(start, ends, scale):  # type: ignore[no-untyped-def]
    """Write one over the Jacobian of an undeformed corner, (LANES,); 0 where it is flat."""
    for c in range(LANES):
        a, b, last = corner_edges(start, ends, ends[4], c)
        det = dot3(a, cross3(b, last))
        size = np.sqrt(dot3(a, a) * dot3(b, b) * dot3(last, last))
        scale[c] = 1.0 / det if abs(det) > FLAT * size else 0.0


@njit(inline="always")
def _write_jacobians(at, ends, scale, jacobian):  # type: ignore[no-untyped-def]
    """Write J of a corner, (LANES,); 1 where it was flat."""
    for c in range(LANES):
        a, b, last = corner_edges(at, ends, ends[4], c)
        det = dot3(a, cross3(b, last)) * scale[c]
        jacobian[c] = det if scale[c] != 0.0 else 1.0


@njit(inline="always")
def _write_pulls(duals, columns, c, pull):  # type: ignore[no-untyped-def]
    """Write the slopes by the edges of a corner, from those by the columns of its map."""
    for k in range(3):
        one = _mixed(duals[k][0], columns[0], duals[k][1], columns[1], duals[k][2], columns[2])
        for axis in range(3):
            pull[k, axis, c] = one[axis]


@njit(inline="always")
def _add_pulls(pull, corner, slope):  # type: ignore[no-untyped-def]
    """Add slopes by the edges of a corner, (3, 3, LANES), to those by nodes, (3, n, LANES)."""
    for k in range(1, len(corner)):
        for axis in range(3):
            for c in range(LANES):
                slope[axis, corner[k], c] += pull[k - 1, axis, c]
            for c in range(LANES):
                slope[axis, corner[0], c] -= pull[k - 1, axis, c]


@njit
def write_slopes(  # type: ignore[no-untyped-def]
    points, x, along, nodes, rows, table, coupling, worst, epsilon, values, out, least
):
    """Write the energies of cells (m,) and least J (m,); add their slopes to ``rows`` of out.

    ``rows`` (m, n): of each node of the cells.
    With a direction ``along`` (n, d): the Hessian times it in place of the slopes, without
    regularisation; of a folded cell it is not finite. Else it ends at the first cell whose energy
    is infinite.
    """
    n = nodes.shape[1]
    start = np.zeros((3, n, LANES))
    at = np.zeros((3, n, LANES))
    way = np.zeros((3, n, LANES))
    slope = np.zeros((3, n, LANES))
    pull = np.empty((3, 3, LANES))
    scale = np.empty(LANES)
    jacobian = np.empty(LANES)
    chi = np.empty(LANES)
    lam = np.zeros(LANES)
    log = np.zeros(LANES)
    value = np.empty(LANES)
    share = 1.0 / len(table)
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, start)
        gather(x, nodes, first, count, at)
        if along is not None:
            gather(along, nodes, first, count, way)
        for c in range(count):
            lam[c] = coupling[first + c]
            least[first + c] = np.inf
        slope[:] = 0.0
        value[:] = 0.0
        for corner in table:
            ends = corner_ends(corner)
            _write_scales(start, ends, scale)
            _write_jacobians(at, ends, scale, jacobian)
            for c in range(LANES):
                j = jacobian[c]
                root = np.sqrt(epsilon * epsilon + j * j)
                chi[c] = 0.5 * (j + root) if j > 0.0 else 0.5 * epsilon * epsilon / (root - j)
            for c in range(count):
                least[first + c] = min(least[first + c], jacobian[c])
                if along is None and not chi[c] > 0.0:
                    values[0] = np.inf
                    return
                log[c] = np.log(chi[c]) if lam[c] > 0.0 else 0.0
            for c in range(LANES):
                duals = _duals(start, ends, scale[c], c)
                flat = 0.0 if scale[c] != 0.0 else 1.0
                f, g, h = _map(duals, corner_edges(at, ends, ends[4], c), flat)
                p = cross3(g, h)
                q = cross3(h, f)
                r = cross3(f, g)
                # The slopes of half the square of the cofactors.
                a = _crosses(q, h, g, r)
                b = _crosses(r, f, h, p)
                last = _crosses(p, g, f, q)
                inverse = 1.0 / chi[c]
                cof = (dot3(p, p) + dot3(q, q) + dot3(r, r)) * inverse * inverse
                squares = dot3(f, f) + dot3(g, g) + dot3(h, h)
                one = 0.25 * (squares + cof) - 1.5 + lam[c] * log[c] * log[c]
                value[c] += share * (one + worst * one * one)
                weight = share * (1.0 + 2.0 * worst * one)
                s = 0.5 * weight
                t = s * inverse * inverse
                pressure = 2.0 * lam[c] * log[c] - 0.5 * cof
                if along is None:
                    root = np.sqrt(epsilon * epsilon + jacobian[c] * jacobian[c])
                    u = weight * pressure / root
                    columns = (
                        _mixed(s, f, t, a, u, p),
                        _mixed(s, g, t, b, u, q),
                        _mixed(s, h, t, last, u, r),
                    )
                else:
                    df, dg, dh = _map(duals, corner_edges(way, ends, 0.0, c), 0.0)
                    dp = _crosses(dg, h, g, dh)
                    dq = _crosses(dh, f, h, df)
                    dr = _crosses(df, g, f, dg)
                    da = add3(_crosses(dq, h, q, dh), _crosses(dg, r, g, dr))
                    db = add3(_crosses(dr, f, r, df), _crosses(dh, p, h, dp))
                    dlast = add3(_crosses(dp, g, p, dg), _crosses(df, q, f, dq))
                    dlog = (dot3(p, df) + dot3(q, dg) + dot3(r, dh)) * inverse
                    square = inverse * inverse
                    dcof = 2.0 * (dot3(a, df) + dot3(b, dg) + dot3(last, dh)) * square
                    force = pressure * inverse
                    dforce = (2.0 * lam[c] + cof) * dlog - 0.5 * dcof
                    dforce = dforce * inverse - force * dlog
                    slopes = (
                        _mixed(0.5, f, 0.5 * square, a, force, p),
                        _mixed(0.5, g, 0.5 * square, b, force, q),
                        _mixed(0.5, h, 0.5 * square, last, force, r),
                    )
                    more = dot3(slopes[0], df) + dot3(slopes[1], dg) + dot3(slopes[2], dh)
                    more = 2.0 * share * worst * more
                    u = weight * force
                    v = -2.0 * t * dlog
                    w = weight * dforce
                    columns = (
                        add3(_mixed(s, df, t, da, u, dp), _mixed(v, a, w, p, more, slopes[0])),
                        add3(_mixed(s, dg, t, db, u, dq), _mixed(v, b, w, q, more, slopes[1])),
                        add3(
                            _mixed(s, dh, t, dlast, u, dr), _mixed(v, last, w, r, more, slopes[2])
                        ),
                    )
                _write_pulls(duals, columns, c, pull)
            _add_pulls(pull, corner, slope)
        values[first : first + count] = value[:count]
        for c in range(count):
            for j in range(n):
                for axis in range(out.shape[1]):
                    out[rows[first + c, j], axis] += slope[axis, j, c]


@njit
def write_couplings(points, nodes, table, numbers, weight, out):  # type: ignore[no-untyped-def]
    """Write the Laplacians of cells (m,), with W (m, d, d), as couplings (m, e) of their edges.

    At a corner o, u has the gradient sum_a g_a (u_a - u_o), and the mean over corners of g_a . W
    g_b (u_a - u_o) (u_b - u_o), summed over a and b, is that of couplings times squares of
    differences along edges. Pairs a, b that no edge joins are left out: in hexahedra whose edges
    are orthogonal they are zero. ``numbers`` (n, n): the edge of two nodes, or -1.
    """
    n = nodes.shape[1]
    d = points.shape[1]
    start = np.zeros((3, n, LANES))
    entries = np.empty((out.shape[1], LANES))
    scale = np.empty(LANES)
    products = np.empty((3, 3, LANES))
    w = np.zeros((3, 3, LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, start)
        for c in range(count):
            for a in range(d):
                for b in range(d):
                    w[a, b, c] = weight[first + c, a, b] / len(table)
        entries[:] = 0.0
        for corner in table:
            ends = corner_ends(corner)
            _write_scales(start, ends, scale)
            for c in range(LANES):
                duals = _duals(start, ends, scale[c], c)
                for b in range(3):
                    x, y, z = duals[b]
                    one = _mixed(
                        x,
                        (w[0, 0, c], w[1, 0, c], w[2, 0, c]),
                        y,
                        (w[0, 1, c], w[1, 1, c], w[2, 1, c]),
                        z,
                        (w[0, 2, c], w[1, 2, c], w[2, 2, c]),
                    )
                    for a in range(b + 1):
                        products[a, b, c] = dot3(duals[a], one)
            for b in range(d):
                along = numbers[corner[0], corner[1 + b]]
                for c in range(LANES):
                    entries[along, c] += products[b, b, c]
                for a in range(b):
                    other = numbers[corner[0], corner[1 + a]]
                    across = numbers[corner[1 + a], corner[1 + b]]
                    if across >= 0:
                        for c in range(LANES):
                            entries[along, c] += products[a, b, c]
                        for c in range(LANES):
                            entries[other, c] += products[a, b, c]
                        for c in range(LANES):
                            entries[across, c] -= products[a, b, c]
        for c in range(count):
            for k in range(out.shape[1]):
                out[first + c, k] = entries[k, c]
