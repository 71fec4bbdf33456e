"""Corotated forces of an elastic body, and their derivatives; no matrix is stored.

With R the rotation of a cell, the polar part of the least-squares map from its undeformed corners X
to its corners x, and K its stiffness (`slideviz.elastic.stiffness`),

    f = sum R u', u' = K u,     u = R^T x - X,

so cells that are only turned have no forces. With K constant and R changing by R [omega]x, the
forces of a cell change, as x does by t, by

    R (omega x K u + K (R^T t - omega x u)),     (tr(S) I - S) omega = axial(R^T T - T^T R),

with S = R^T F, F the least-squares map and T its change (`slideviz.rbf.polar`); K has no forces for
small rotations. Loops run over `LANES` elements at a time, in vectors of the processor, and write
the forces at each corner; those of a node are then added in the order of its elements: the same
bits for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from slideviz.elastic.stiffness import (
    POISSON,
    ReferenceShape,
    ShapeBlock,
    by_node,
    cell_volumes,
)
from slideviz.mesh.jacobians import add3, cross3, dot3
from slideviz.mesh.model import FloatArray, IntArray, frozen_array, sealed
from slideviz.rbf.polar import rotation, spin
from slideviz.system.jit_cache import OPTIONS, njit
from slideviz.system.threads import in_parts

MU = 1.0 / (2.0 * (1.0 + POISSON))
LAM = POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))  # Lamé's constants for a modulus of 1

LANES = 64
"""Elements that are computed together: loops over fewer are unrolled, and become no vectors."""

NEWTON = 6
CLOSE = 1e-7
"""Newton's iterations for the polar part, and the change in the last one that proves that it
converged (quadratically)."""

Elements = tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray]
"""Points, nodes, gradients and weights of the shape, and moduli."""


@dataclass(frozen=True, eq=False)
class Corotated:
    """An elastic body whose cells turn. Elements are numbered through all ``parts``."""

    points: FloatArray  # (n, d): undeformed positions X
    parts: list[ShapeBlock]  # the elements
    moduli: tuple[FloatArray, ...]
    """(m,) of each part: Young's modulus of each element."""

    @classmethod
    def of(cls, points: FloatArray, parts: list[ShapeBlock]) -> Corotated:
        """Return the body with undeformed ``points`` (n, d), as stiff as its cells are small."""
        volume = cell_volumes(points, parts)
        if not volume.all():  # cells without volume have no stiffness
            solid = [np.flatnonzero(volume[part.cell]) for part in parts]
            parts = [
                replace(part, nodes=sealed(part.nodes[some]), cell=part.cell[some])
                for part, some in zip(parts, solid, strict=True)
            ]
        moduli = tuple(sealed(1.0 / volume[part.cell]) for part in parts)
        return cls(frozen_array(points, np.float64), parts, moduli)

    def rotations(self, x: FloatArray) -> FloatArray:
        """Return the rotations R (c, d, d) of the elements at positions x (n, d)."""
        d = x.shape[1]
        out = np.empty((sum(len(part.nodes) for part in self.parts), d, d))
        x = _plain(x)
        for rows, part, _ in self._slices():
            one = partial(_turn_part, _plain(self.points), sealed(part.nodes), x, out[rows])
            in_parts(one, len(part.nodes))
        return out

    def forces(self, x: FloatArray, rotations: FloatArray | None = None) -> FloatArray:
        """Return the forces f (n, d) at positions x (n, d), by default with its own rotations."""
        return self._summed(x, self.rotations(x) if rotations is None else rotations, 1.0)

    def product(self, rotations: FloatArray | None, p: FloatArray) -> FloatArray:
        """Return the sum of R K R^T p (n, d); None for cells that are not turned."""
        if rotations is None:
            count = sum(len(part.nodes) for part in self.parts)
            rotations = np.tile(np.eye(p.shape[1]), (count, 1, 1))
        return self._summed(p, rotations, 0.0)

    def pushed(self, x: FloatArray, t: FloatArray, turns: FloatArray | None = None) -> FloatArray:
        """Return the change (n, d) of the forces as positions x (n, d) change by t (n, d).

        ``turns`` (c, d, d) are the rotations at x, if they are known.
        """
        return self._changed(x, t, turns, reverse=False)

    def pulled(self, x: FloatArray, g: FloatArray, turns: FloatArray | None = None) -> FloatArray:
        """Return the gradient (n, d) of ``(g * forces).sum()`` with respect to positions x."""
        return self._changed(x, g, turns, reverse=True)

    def _slices(self) -> list[tuple[slice, ShapeBlock, FloatArray]]:
        """Return the elements, block and moduli of each part."""
        stops = np.cumsum([len(part.nodes) for part in self.parts]).tolist()
        return [
            (slice(stop - len(part.nodes), stop), part, modulus)
            for stop, part, modulus in zip(stops, self.parts, self.moduli, strict=True)
        ]

    def _summed(self, field: FloatArray, rotations: FloatArray, shapes: float) -> FloatArray:
        """Return the sum of R K (R^T field - shapes X)."""
        turn = _plain(rotations)
        y = _plain(field)

        def add(elements: Elements, rows: slice, out: FloatArray) -> None:
            turned(elements, turn[rows], y, shapes, out)

        return self._gathered(add)

    def _changed(
        self, x: FloatArray, along: FloatArray, turns: FloatArray | None, *, reverse: bool
    ) -> FloatArray:
        turn = _plain(self.rotations(x) if turns is None else turns)
        at = _plain(x)
        t = _plain(along)

        def add(elements: Elements, rows: slice, out: FloatArray) -> None:
            changed(elements, turn[rows], at, t, reverse, out)

        return self._gathered(add)

    def _gathered(self, add: Callable[[Elements, slice, FloatArray], None]) -> FloatArray:
        """Return the sums (n, d) of what ``add`` writes for the corners (m, a, d) of elements."""
        n, d = self.points.shape
        each = np.empty((sum(part.nodes.size for part in self.parts), d))
        first = 0
        for rows, part, modulus in self._slices():
            m, a = part.nodes.shape
            corners = each[first : first + m * a].reshape(m, a, d)
            first += m * a

            body = _plain(self.points), sealed(part.nodes), part.shape, sealed(modulus)
            in_parts(partial(_add_part, add, body, rows.start, corners), m)
        out = np.empty((n, d))
        indptr, entries = self._corners
        in_parts(lambda s: gather(indptr[s.start : s.stop + 1], entries, each, out[s]), n)
        return out

    @cached_property
    def _corners(self) -> tuple[IntArray, IntArray]:
        nodes = np.concatenate([part.nodes.ravel() for part in self.parts])
        return by_node(nodes, len(self.points))


def _turn_part(
    points: FloatArray, nodes: IntArray, x: FloatArray, out: FloatArray, s: slice
) -> None:
    turns(points, nodes[s], x, out[s])


def _add_part(
    add: Callable[[Elements, slice, FloatArray], None],
    body: tuple[FloatArray, IntArray, ReferenceShape, FloatArray],
    start: int,
    corners: FloatArray,
    s: slice,
) -> None:
    points, nodes, shape, modulus = body
    elements = points, nodes[s], shape.gradients, shape.weights, modulus[s]
    add(elements, slice(start + s.start, start + s.stop), corners[s])


def _plain(values: FloatArray) -> FloatArray:
    """Return the values as those of a mesh are, so that the loops are compiled once."""
    return sealed(np.ascontiguousarray(values))


@njit(**OPTIONS)
def gather(indptr, entries, each, out):  # type: ignore[no-untyped-def]
    """Write the sums of rows ``entries`` of each (m, d) to out (n, d)."""
    for row in range(len(out)):
        for i in range(out.shape[1]):
            total = 0.0
            for k in range(indptr[row], indptr[row + 1]):
                total += each[entries[k], i]
            out[row, i] = total


@njit(**OPTIONS)
def _map_weights(x, w, r):  # type: ignore[no-untyped-def]
    """Write the weights w of the least-squares map F = sum_a x_a w_a^T from corners x.

    Both (a, d, LANES). By an orthogonal basis of the columns, with factors ``r`` (d, d, LANES):
    normal equations lose all digits of flat cells.
    """
    n, d, lanes = x.shape
    r[:] = 0.0
    for j in range(d):
        for a in range(n):
            for k in range(lanes):
                r[j, j, k] += x[a, j, k]
        for a in range(n):
            for k in range(lanes):
                w[a, j, k] = x[a, j, k] - r[j, j, k] / n
        r[j, j] = 0.0
    for j in range(d):
        for i in range(j):
            for a in range(n):
                for k in range(lanes):
                    r[i, j, k] += w[a, i, k] * w[a, j, k]
            for a in range(n):
                for k in range(lanes):
                    w[a, j, k] -= r[i, j, k] * w[a, i, k]
        for a in range(n):
            for k in range(lanes):
                r[j, j, k] += w[a, j, k] * w[a, j, k]
        for k in range(lanes):
            r[j, j, k] = 1.0 / np.sqrt(r[j, j, k])
        for a in range(n):
            for k in range(lanes):
                w[a, j, k] *= r[j, j, k]
    for j in range(d - 1, -1, -1):
        for a in range(n):
            for i in range(j + 1, d):
                for k in range(lanes):
                    w[a, j, k] -= w[a, i, k] * r[j, i, k]
            for k in range(lanes):
                w[a, j, k] *= r[j, j, k]


@njit(**OPTIONS)
def _map(x, w, f):  # type: ignore[no-untyped-def]
    """Write the sum of x_a w_a^T to f (9 LANES,): element (i, j) begins at (3 i + j) LANES."""
    n, d, lanes = x.shape
    f[:] = 0.0
    for i in range(d):
        for j in range(d):
            at = (3 * i + j) * LANES
            for a in range(n):
                for k in range(lanes):
                    f[at + k] += x[a, i, k] * w[a, j, k]


@njit(inline="always", **OPTIONS)
def _row(m, i, k):  # type: ignore[no-untyped-def]
    """Return row i, a triple, of matrix k of m (9 LANES,), as of `_map`."""
    return m[3 * i * LANES + k], m[(3 * i + 1) * LANES + k], m[(3 * i + 2) * LANES + k]


@njit(inline="always", **OPTIONS)
def _set_row(m, i, k, row):  # type: ignore[no-untyped-def]
    m[3 * i * LANES + k] = row[0]
    m[(3 * i + 1) * LANES + k] = row[1]
    m[(3 * i + 2) * LANES + k] = row[2]


@njit(inline="always", **OPTIONS)
def _half_change(cofactors, row, det):  # type: ignore[no-untyped-def]
    """Return (cofactors / det - row) / 2: the change of a row of M in Newton's iteration."""
    h = 1.0 / det
    return (
        0.5 * (h * cofactors[0] - row[0]),
        0.5 * (h * cofactors[1] - row[1]),
        0.5 * (h * cofactors[2] - row[2]),
    )


@njit(inline="always", **OPTIONS)
def _combined(h, a, b, c):  # type: ignore[no-untyped-def]
    """Return h_0 a + h_1 b + h_2 c, of triples."""
    return (
        h[0] * a[0] + h[1] * b[0] + h[2] * c[0],
        h[0] * a[1] + h[1] * b[1] + h[2] * c[1],
        h[0] * a[2] + h[1] * b[2] + h[2] * c[2],
    )


@njit(**OPTIONS)
def _polar(m, change):  # type: ignore[no-untyped-def]
    """Replace m (9 LANES,) by orthogonal matrices: Newton's M <- (M + M^-T) / 2 (Higham).

    Write the last change to ``change`` (LANES,), and infinity for a reflection.
    """
    for _ in range(NEWTON):
        for k in range(LANES):
            a = _row(m, 0, k)
            b = _row(m, 1, k)
            c = _row(m, 2, k)
            x = cross3(b, c)
            y = cross3(c, a)
            z = cross3(a, b)
            det = dot3(a, x)
            x = _half_change(x, a, det)
            y = _half_change(y, b, det)
            z = _half_change(z, c, det)
            size = abs(x[0]) + abs(x[1]) + abs(x[2]) + abs(y[0]) + abs(y[1]) + abs(y[2])
            change[k] = size + abs(z[0]) + abs(z[1]) + abs(z[2]) if det > 0.0 else np.inf
            _set_row(m, 0, k, add3(a, x))
            _set_row(m, 1, k, add3(b, y))
            _set_row(m, 2, k, add3(c, z))


@njit(**OPTIONS)
def turns(points, nodes, x, out):  # type: ignore[no-untyped-def]
    """Write the rotations of elements at positions x (n, d) to out (m, d, d)."""
    n = nodes.shape[1]
    d = points.shape[1]
    corners = np.empty((n, d, LANES))
    w = np.empty((n, d, LANES))
    r = np.empty((d, d, LANES))
    f = np.empty(9 * LANES)
    fast = np.empty(9 * LANES)
    change = np.empty(LANES)
    one = np.empty((d, d))
    work = np.empty((4, 4))
    vectors = np.empty((4, 4))
    change[:] = np.inf
    for first in range(0, len(nodes), LANES):
        _corners(points, nodes, first, corners)
        _map_weights(corners, w, r)
        _corners(x, nodes, first, corners)
        _map(corners, w, f)
        if d == 3:
            fast[:] = f
            _polar(fast, change)
        for lane in range(min(LANES, len(nodes) - first)):
            for i in range(d):
                for j in range(d):
                    one[i, j] = f[(3 * i + j) * LANES + lane]
                    out[first + lane, i, j] = fast[(3 * i + j) * LANES + lane]
            if not change[lane] <= CLOSE:
                rotation(one, out[first + lane], work, vectors)


@njit(**OPTIONS)
def _lanes(elements, first, turn, field, shapes, y):  # type: ignore[no-untyped-def]
    """Write R^T field - shapes X of the elements from ``first`` on to y (a, d, LANES).

    The last element fills the lanes that are left over.
    """
    points = elements[0]
    nodes = elements[1]
    n = nodes.shape[1]
    d = points.shape[1]
    for lane in range(LANES):
        e = min(first + lane, len(nodes) - 1)
        for a in range(n):
            node = nodes[e, a]
            for i in range(d):
                total = -shapes * points[node, i]
                for j in range(d):
                    total += turn[e, j, i] * field[node, j]
                y[a, i, lane] = total


@njit(**OPTIONS)
def _placed(elements, first, turn, f, out):  # type: ignore[no-untyped-def]
    """Write R f of the elements from ``first`` on, f (a, d, LANES), to out (m, a, d)."""
    n = f.shape[0]
    d = f.shape[1]
    for lane in range(min(LANES, len(elements[1]) - first)):
        for a in range(n):
            for i in range(d):
                total = 0.0
                for j in range(d):
                    total += turn[first + lane, i, j] * f[a, j, lane]
                out[first + lane, a, i] = total


@njit(**OPTIONS)
def _corners(points, nodes, first, x):  # type: ignore[no-untyped-def]
    """Write the corners of the elements from ``first`` on to x (a, d, LANES)."""
    for lane in range(LANES):
        e = min(first + lane, len(nodes) - 1)
        for a in range(nodes.shape[1]):
            for i in range(points.shape[1]):
                x[a, i, lane] = points[nodes[e, a], i]


@njit(**OPTIONS)
def _stiffness_times(elements, first, x, y, f, scratch):  # type: ignore[no-untyped-def]
    """Write K y of the elements from ``first`` on, with corners x, to f; all (a, d, LANES).

    Loops over lanes become vectors, which they only do with places that are known in advance.
    """
    gradients = elements[2]
    weights = elements[3]
    moduli = elements[4]
    jacobian, slopes, modulus = scratch
    for k in range(LANES):
        modulus[k] = moduli[min(first + k, len(moduli) - 1)]
    n = x.shape[0]
    d = x.shape[1]
    f[:] = 0.0
    for q in range(len(weights)):
        jacobian[:] = 0.0
        slopes[:] = 0.0
        if d == 2:
            jacobian[8 * LANES :] = 1.0
        for a in range(n):
            for j in range(d):
                c = gradients[q, a, j]
                for i in range(d):
                    at = (3 * j + i) * LANES
                    there = (3 * i + j) * LANES
                    for k in range(LANES):
                        jacobian[at + k] += c * x[a, i, k]
                    for k in range(LANES):
                        slopes[there + k] += c * y[a, i, k]
        for k in range(LANES):
            one = _row(jacobian, 0, k)
            two = _row(jacobian, 1, k)
            three = _row(jacobian, 2, k)
            a = cross3(two, three)
            b = cross3(three, one)
            c = cross3(one, two)
            # The cofactors are det J^-1: the gradients are divided by det here, the forces there.
            size = modulus[k] * weights[q] / abs(dot3(one, a))
            g = _combined(_row(slopes, 0, k), a, b, c)
            h = _combined(_row(slopes, 1, k), a, b, c)
            u = _combined(_row(slopes, 2, k), a, b, c)
            trace = LAM * (g[0] + h[1] + u[2])
            s01 = size * (MU * (g[1] + h[0]))
            s02 = size * (MU * (g[2] + u[0]))
            s12 = size * (MU * (h[2] + u[1]))
            stress = size * (trace + 2.0 * MU * g[0]), s01, s02
            _set_row(slopes, 0, k, (dot3(stress, a), dot3(stress, b), dot3(stress, c)))
            stress = s01, size * (trace + 2.0 * MU * h[1]), s12
            _set_row(slopes, 1, k, (dot3(stress, a), dot3(stress, b), dot3(stress, c)))
            stress = s02, s12, size * (trace + 2.0 * MU * u[2])
            _set_row(slopes, 2, k, (dot3(stress, a), dot3(stress, b), dot3(stress, c)))
        for a in range(n):
            for j in range(d):
                c = gradients[q, a, j]
                for i in range(d):
                    at = (3 * i + j) * LANES
                    for k in range(LANES):
                        f[a, i, k] += c * slopes[at + k]


@njit(**OPTIONS)
def turned(elements, turn, field, shapes, out):  # type: ignore[no-untyped-def]
    """Write the forces R K (R^T field - shapes X) at the corners of elements to out (m, a, d).

    ``elements``: points, nodes, gradients and weights of the shape, and moduli (m,).
    """
    n = out.shape[1]
    d = out.shape[2]
    x = np.empty((n, d, LANES))
    y = np.empty((n, d, LANES))
    f = np.empty((n, d, LANES))
    scratch = np.empty(9 * LANES), np.empty(9 * LANES), np.empty(LANES)
    for first in range(0, len(out), LANES):
        _corners(elements[0], elements[1], first, x)
        _lanes(elements, first, turn, field, shapes, y)
        _stiffness_times(elements, first, x, y, f, scratch)
        _placed(elements, first, turn, f, out)


@njit(**OPTIONS)
def _add_crossed(u, v, lane, sign, out):  # type: ignore[no-untyped-def]
    """Add ``sign`` times the sum of u_a x v_a, of a lane of (a, d, LANES), to out (3,)."""
    n = u.shape[0]
    d = u.shape[1]
    for a in range(n):
        for k in range(2 if d == 2 else 0, 3):
            i = (k + 1) % 3
            j = (k + 2) % 3
            out[k] += sign * (u[a, i, lane] * v[a, j, lane] - u[a, j, lane] * v[a, i, lane])


@njit(**OPTIONS)
def _add_spun(omega, u, lane, sign, out):  # type: ignore[no-untyped-def]
    """Add ``sign`` times omega x u_a, of a lane of u (a, d, LANES), to that of out."""
    n = u.shape[0]
    d = u.shape[1]
    for a in range(n):
        if d == 2:
            out[a, 0, lane] -= sign * omega[2] * u[a, 1, lane]
            out[a, 1, lane] += sign * omega[2] * u[a, 0, lane]
        else:
            for k in range(3):
                i = (k + 1) % 3
                j = (k + 2) % 3
                out[a, k, lane] += sign * (omega[i] * u[a, j, lane] - omega[j] * u[a, i, lane])


@njit(**OPTIONS)
def changed(elements, turn, at, along, reverse, out):  # type: ignore[no-untyped-def]
    """Write the derivative of the forces at positions ``at`` (n, d), or its transpose.

    Parts (m, a, d) of the corners of elements, as ``turned``; ``along`` (n, d) is the change of the
    positions or, with ``reverse``, the adjoint of the forces.
    """
    n = out.shape[1]
    d = out.shape[2]
    x = np.empty((n, d, LANES))
    u = np.empty((n, d, LANES))
    y = np.empty((n, d, LANES))
    k_u = np.empty((n, d, LANES))
    k_y = np.empty((n, d, LANES))
    w = np.empty((n, d, LANES))
    scratch = np.empty(9 * LANES), np.empty(9 * LANES), np.empty(LANES)
    s = np.empty((d, d))
    r = np.empty((d, d, LANES))
    f = np.empty(9 * LANES)
    omega = np.empty((LANES, 3))
    moment = np.empty((LANES, 3))
    for first in range(0, len(out), LANES):
        _corners(elements[0], elements[1], first, x)
        _lanes(elements, first, turn, at, 1.0, u)
        _lanes(elements, first, turn, along, 0.0, y)
        _stiffness_times(elements, first, x, u, k_u, scratch)
        if reverse:
            _stiffness_times(elements, first, x, y, k_y, scratch)
        _map_weights(x, w, r)
        _map(u, w, f)  # S = R^T F = I + sum_a u_a w_a^T
        for lane in range(LANES):
            for i in range(d):
                for j in range(d):
                    s[i, j] = f[(3 * i + j) * LANES + lane] + (1.0 if i == j else 0.0)
            moment[lane] = 0.0
            if reverse:
                _add_crossed(k_u, y, lane, 1.0, moment[lane])
                _add_crossed(u, k_y, lane, -1.0, moment[lane])
            else:
                _add_crossed(w, y, lane, 1.0, moment[lane])
            spin(s, moment[lane], omega[lane])
            if reverse:
                _add_spun(omega[lane], w, lane, 1.0, k_y)
            else:
                _add_spun(omega[lane], u, lane, -1.0, y)
        if not reverse:
            _stiffness_times(elements, first, x, y, k_y, scratch)
            for lane in range(LANES):
                _add_spun(omega[lane], k_u, lane, 1.0, k_y)
        _placed(elements, first, turn, k_y, out)
