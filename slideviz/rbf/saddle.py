"""Saddle-point systems: symmetric indefinite, of radial functions that need a polynomial."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning, lstsq, qr, solve

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.solve import PIVOT_GUARD, require_finite

RANK = 1e-10
"""A polynomial term depends on the others at the control nodes when its diagonal entry in a pivoted
QR is at most this part of the largest one."""


@dataclass(frozen=True, eq=False)
class Saddle:
    """Solution of a system with a polynomial (Eq. 2.4)."""

    weights: FloatArray
    """(n, m)."""
    tail: FloatArray
    """(q, m): coefficients of the polynomial's terms."""
    rank_deficient: bool
    """Whether the system was singular, so that this is its least-squares solution."""


def solve_saddle(matrix: FloatArray, terms: FloatArray, right: FloatArray) -> Saddle:
    """Return weights and polynomial of ``[[G, P], [P^T, 0]] [w, c] = [b, 0]``.

    Symmetric indefinite, solved with Bunch and Kaufman's pivoting. Terms that are dependent at
    the given nodes (all in one plane) are left out.

    Parameters
    ----------
    matrix : (n, n)
    terms : (n, q)
        The polynomial's terms in each row.
    right : (n, m)

    Raises
    ------
    DeformError
        Numbers are not finite.
    """
    require_finite(matrix)
    system, use = saddle_system(matrix, terms)
    n = len(matrix)
    full = np.concatenate([right, np.zeros((len(use), right.shape[1]))])
    found = _regular(system, full)
    deficient = found is None
    if found is None:
        found = lstsq(system, full, cond=PIVOT_GUARD, check_finite=False, lapack_driver="gelsy")[0]
    tail = np.zeros((terms.shape[1], right.shape[1]))
    tail[use] = found[n:]
    return Saddle(found[:n], tail, deficient)


def _regular(system: FloatArray, right: FloatArray) -> FloatArray | None:
    """Return the solution of a symmetric system; None where it is singular."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", LinAlgWarning)
        try:
            return np.asarray(solve(system, right, assume_a="sym", check_finite=False))
        except (LinAlgError, LinAlgWarning):
            return None


def is_singular(system: FloatArray) -> bool:
    """Return whether a symmetric system (n, n) is singular, so that least squares solve it."""
    return _regular(system, np.zeros((len(system), 1))) is None


def pseudo_inverse(system: FloatArray, rank: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return the k largest eigenvalues (k,), by absolute value, and eigenvectors (n, k).

    Of a singular symmetric system; k is its ``rank``, found with the threshold of the least-squares
    solution if not given.
    """
    values, vectors = np.linalg.eigh(system)
    order = np.argsort(-np.abs(values), kind="stable")
    size = np.abs(values[order])
    if rank is None:
        rank = int(np.count_nonzero(size > PIVOT_GUARD * size[0]))
    return values[order[:rank]], vectors[:, order[:rank]]


def saddle_condition(matrix: FloatArray, terms: FloatArray) -> float:
    """Return the condition number (1-norm) of a system with a polynomial; inf when singular."""
    return float(np.linalg.cond(saddle_system(matrix, terms)[0], 1))


def saddle_system(matrix: FloatArray, terms: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return ``[[G, P], [P^T, 0]]`` with P the independent columns of terms, and their indices."""
    scale = np.maximum(np.abs(terms).max(axis=0), 1e-300)
    r, order = qr(terms / scale, pivoting=True, mode="r")
    size = np.abs(np.diag(r))
    use = np.sort(order[: len(size)][size > RANK * size.max(initial=0.0)])
    n, q = len(matrix), len(use)
    system = np.zeros((n + q, n + q))
    system[:n, :n] = matrix
    system[:n, n:] = terms[:, use]
    system[n:, :n] = terms[:, use].T
    return system, use
