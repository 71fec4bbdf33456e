"""Nearest rotations of matrices: the orthogonal polar factor with determinant +1, and its slopes.

The rotation R nearest to M maximises tr(R^T M). In 2D it is an angle in closed form; in 3D a unit
quaternion, the eigenvector of the largest eigenvalue of a symmetric matrix 4 by 4 that is linear in
M (Horn, J. Opt. Soc. Am. A 4, 1987). So reflections and singular matrices have one, too. With
S = R^T M, symmetric, M changes by T and R by

    dR = R [omega]x,      (tr(S) I - S) omega = axial(R^T T - T^T R)

This map is symmetric (R is the gradient of a function of M), hence its own transpose.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from slideviz.mesh.model import FloatArray, sealed
from slideviz.rbf.operations import each_of
from slideviz.rbf.tape import Array, recorded, value
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

SWEEPS = 12  # most sweeps of Jacobi's eigenvalue algorithm; it needs up to six

UNIQUE = 1e-12  # where R is not unique to this precision (relative), its derivative is taken as 0


def nearest_rotations(matrices: Array, d: int) -> Array:
    """Return the rotations (m, d d) nearest to matrices (m, d d), row by row; I for zeros."""
    m = value(matrices)
    out = rotations(m.reshape(-1, d, d))

    def change(t: FloatArray) -> FloatArray:
        each = rotation_slopes(m.reshape(-1, d, d), out, t.reshape(-1, d, d))
        return each.reshape(t.shape)

    slope = partial(each_of, change)
    return recorded(out.reshape(m.shape), (matrices, slope, slope))


def rotations(matrices: FloatArray) -> FloatArray:
    """Return the rotations nearest to matrices (m, d, d)."""
    m = sealed(np.ascontiguousarray(matrices))
    out = np.empty(matrices.shape)
    in_parts(lambda part: _rotate_all(m[part], out[part]), len(m))
    return out


def rotation_slopes(matrices: FloatArray, turned: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the change (m, d, d) of the rotations ``turned`` as matrices change by directions.

    All (m, d, d). The same map takes adjoints of the rotations to those of the matrices.
    """
    m = sealed(np.ascontiguousarray(matrices))
    r = sealed(np.ascontiguousarray(turned))
    t = sealed(np.ascontiguousarray(directions))
    out = np.empty(m.shape)
    in_parts(lambda part: _change_all(m[part], r[part], t[part], out[part]), len(m))
    return out


@njit
def _rotate_all(m, out):  # type: ignore[no-untyped-def]
    work = np.empty((4, 4))
    vectors = np.empty((4, 4))
    for e in range(len(m)):
        rotation(m[e], out[e], work, vectors)


@njit
def _change_all(m, r, t, out):  # type: ignore[no-untyped-def]
    d = m.shape[1]
    s = np.empty((d, d))
    a = np.empty(3)
    omega = np.empty(3)
    for e in range(len(m)):
        stretch(m[e], r[e], s)
        for k in range(3):
            a[k] = 0.0
        for k in range(d):
            if d == 2:
                a[2] += r[e, k, 1] * t[e, k, 0] - r[e, k, 0] * t[e, k, 1]
            else:
                a[0] += r[e, k, 2] * t[e, k, 1] - r[e, k, 1] * t[e, k, 2]
                a[1] += r[e, k, 0] * t[e, k, 2] - r[e, k, 2] * t[e, k, 0]
                a[2] += r[e, k, 1] * t[e, k, 0] - r[e, k, 0] * t[e, k, 1]
        spin(s, a, omega)
        for i in range(d):
            if d == 2:
                out[e, i, 0] = r[e, i, 1] * omega[2]
                out[e, i, 1] = -r[e, i, 0] * omega[2]
            else:
                out[e, i, 0] = r[e, i, 1] * omega[2] - r[e, i, 2] * omega[1]
                out[e, i, 1] = r[e, i, 2] * omega[0] - r[e, i, 0] * omega[2]
                out[e, i, 2] = r[e, i, 0] * omega[1] - r[e, i, 1] * omega[0]


@njit
def stretch(m, r, s):  # type: ignore[no-untyped-def]
    """Write S = R^T M (d, d) to s."""
    d = len(m)
    for i in range(d):
        for j in range(d):
            s[i, j] = 0.0
            for k in range(d):
                s[i, j] += r[k, i] * m[k, j]


@njit
def spin(s, a, omega):  # type: ignore[no-untyped-def]
    """Write the solution of (tr(S) I - S) omega = a to omega (3,); 2D: of tr(S) omega_2 = a_2."""
    omega[0] = omega[1] = omega[2] = 0.0
    if len(s) == 2:
        trace = s[0, 0] + s[1, 1]
        if trace > 0.0:
            omega[2] = a[2] / trace
        return
    b00 = s[1, 1] + s[2, 2]
    b11 = s[0, 0] + s[2, 2]
    b22 = s[0, 0] + s[1, 1]
    b01 = -0.5 * (s[0, 1] + s[1, 0])
    b02 = -0.5 * (s[0, 2] + s[2, 0])
    b12 = -0.5 * (s[1, 2] + s[2, 1])
    c00 = b11 * b22 - b12 * b12
    c01 = b02 * b12 - b01 * b22
    c02 = b01 * b12 - b02 * b11
    c11 = b00 * b22 - b02 * b02
    c12 = b01 * b02 - b00 * b12
    c22 = b00 * b11 - b01 * b01
    det = b00 * c00 + b01 * c01 + b02 * c02
    size = b00 + b11 + b22
    if det > UNIQUE * size * size * size:
        omega[0] = (c00 * a[0] + c01 * a[1] + c02 * a[2]) / det
        omega[1] = (c01 * a[0] + c11 * a[1] + c12 * a[2]) / det
        omega[2] = (c02 * a[0] + c12 * a[1] + c22 * a[2]) / det


@njit
def rotation(m, r, work, vectors):  # type: ignore[no-untyped-def]
    """Write the rotation nearest to m (d, d) to r; ``work`` and ``vectors`` (4, 4) are scratch."""
    if len(m) == 2:
        c = m[0, 0] + m[1, 1]
        s = m[1, 0] - m[0, 1]
        size = np.hypot(c, s)
        c, s = (c / size, s / size) if size > 0.0 else (1.0, 0.0)
        r[0, 0] = c
        r[0, 1] = -s
        r[1, 0] = s
        r[1, 1] = c
        return
    work[0, 0] = m[0, 0] + m[1, 1] + m[2, 2]
    work[1, 1] = m[0, 0] - m[1, 1] - m[2, 2]
    work[2, 2] = m[1, 1] - m[0, 0] - m[2, 2]
    work[3, 3] = m[2, 2] - m[0, 0] - m[1, 1]
    work[0, 1] = m[2, 1] - m[1, 2]
    work[0, 2] = m[0, 2] - m[2, 0]
    work[0, 3] = m[1, 0] - m[0, 1]
    work[1, 2] = m[0, 1] + m[1, 0]
    work[1, 3] = m[0, 2] + m[2, 0]
    work[2, 3] = m[1, 2] + m[2, 1]
    _eigenvectors(work, vectors)
    best = 0
    for k in range(1, 4):
        if work[k, k] > work[best, best]:
            best = k
    w = vectors[0, best]
    x = vectors[1, best]
    y = vectors[2, best]
    z = vectors[3, best]
    size = np.sqrt(w * w + x * x + y * y + z * z)
    w = w / size
    x = x / size
    y = y / size
    z = z / size
    r[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    r[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    r[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    r[0, 1] = 2.0 * (x * y - w * z)
    r[1, 0] = 2.0 * (x * y + w * z)
    r[0, 2] = 2.0 * (x * z + w * y)
    r[2, 0] = 2.0 * (x * z - w * y)
    r[1, 2] = 2.0 * (y * z - w * x)
    r[2, 1] = 2.0 * (y * z + w * x)


@njit
def _eigenvectors(a, v):  # type: ignore[no-untyped-def]
    """Diagonalise a (4, 4), of which the upper triangle is used, by Jacobi; columns of v."""
    size = 0.0
    for i in range(4):
        for j in range(4):
            v[i, j] = 1.0 if i == j else 0.0
        for j in range(i, 4):
            size = max(size, abs(a[i, j]))
    for _ in range(SWEEPS):
        off = 0.0
        for p in range(3):
            for q in range(p + 1, 4):
                off = max(off, abs(a[p, q]))
        if off <= 1e-17 * size:
            return
        for p in range(3):
            for q in range(p + 1, 4):
                if a[p, q] == 0.0:
                    continue
                ratio = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                t = 1.0 / (abs(ratio) + np.sqrt(1.0 + ratio * ratio))
                t = -t if ratio < 0.0 else t
                c = 1.0 / np.sqrt(1.0 + t * t)
                s = t * c
                a[p, p] -= t * a[p, q]
                a[q, q] += t * a[p, q]
                a[p, q] = 0.0
                for k in range(4):
                    if k != p and k != q:
                        i, j = (k, p) if k < p else (p, k)
                        n, m = (k, q) if k < q else (q, k)
                        one = a[i, j]
                        two = a[n, m]
                        a[i, j] = c * one - s * two
                        a[n, m] = s * one + c * two
                    one = v[k, p]
                    two = v[k, q]
                    v[k, p] = c * one - s * two
                    v[k, q] = s * one + c * two
