"""Nearest rotations of matrices: the orthogonal polar factor with determinant +1, and its slopes.

The rotation R nearest to M maximises tr(R^T M). In 2D it is an angle in closed form; in 3D a unit
quaternion, the eigenvector of the largest eigenvalue of a symmetric matrix 4 by 4 that is linear in
M (Horn, J. Opt. Soc. Am. A 4, 1987). So reflections and singular matrices have one, too. With the
spins J_k, one in 2D and three in 3D, and N_k = R J_k, M changes by T and R by

    dR = sum_k omega_k N_k,      sum_l -tr((N_l J_k)^T M) omega_l = tr(N_k^T T)

This map is symmetric (R is the gradient of a function of M), hence its own transpose.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.rbf.tape import Array, recorded, value

UNIQUE = 1e-12  # where R is not unique to this precision (relative), its derivative is taken as 0

_EYE = np.eye(3)

SPINS = -np.cross(_EYE[:, None], _EYE)
"""(3, 3, 3): J_k, the slope of a rotation about each axis by its angle."""

_PRODUCTS = np.zeros((3, 3, 4, 4))
"""The entries of a rotation as quadratic forms of its quaternion, whose real part is the last."""
_PRODUCTS[..., :3, :3] = np.einsum("ai,bj->abij", _EYE, _EYE) + np.einsum("aj,bi->abij", _EYE, _EYE)
_PRODUCTS[..., :3, :3] -= np.multiply.outer(_EYE, _EYE)
_PRODUCTS[..., :3, 3] = _PRODUCTS[..., 3, :3] = SPINS.transpose(1, 2, 0)
_PRODUCTS[..., 3, 3] = _EYE


def nearest_rotations(matrices: Array, d: int) -> Array:
    """Return the rotations (m, d d) nearest to matrices (m, d d), row by row; I for zeros."""
    m = value(matrices).reshape(-1, d, d)
    out = rotations(m)

    @cache
    def slopes() -> FloatArray:
        return rotation_slopes(m, out)

    def change(t: FloatArray) -> FloatArray:
        return np.einsum("mij,...mj->...mi", slopes(), t)

    return recorded(out.reshape(-1, d * d), (matrices, change, change))


def rotations(matrices: FloatArray) -> FloatArray:
    """Return the rotations nearest to matrices (m, d, d)."""
    if matrices.shape[1] == 2:
        (a, b), (c, d) = matrices.transpose(1, 2, 0)
        turn = a + d + 1j * (c - b)
        turn[turn == 0.0] = 1.0
        turn /= np.abs(turn)
        return np.array([[turn.real, -turn.imag], [turn.imag, turn.real]]).transpose(2, 0, 1)
    forms = np.einsum("mab,abij->mij", matrices, _PRODUCTS)
    quaternion = np.linalg.eigh(forms)[1][:, :, -1]
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    squares = quaternion[:, :, None] * quaternion[:, None]
    return np.einsum("mij,abij->mab", squares, _PRODUCTS)


def rotation_slopes(matrices: FloatArray, turned: FloatArray) -> FloatArray:
    """Return the derivatives (m, d d, d d) of the rotations ``turned`` by the matrices.

    Both (m, d, d).
    """
    m, d, _ = matrices.shape
    spins = SPINS[6 - 2 * d :, :d, :d]
    changes = np.einsum("mij,kjn->mkin", turned, spins)
    system = -np.einsum("mlij,kjn,min->mkl", changes, spins, matrices)
    trace = np.trace(system, axis1=1, axis2=2)
    unique = np.linalg.det(system) > UNIQUE * trace ** len(spins)
    inverse = np.zeros_like(system)
    inverse[unique] = np.linalg.inv(system[unique])
    flat = changes.reshape(m, -1, d * d)
    return np.swapaxes(flat, 1, 2) @ inverse @ flat
