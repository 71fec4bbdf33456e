"""Direct sliding by the nonsymmetric system of Eq. 2.22, and pseudo sliding by planes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.oracles.radial import Distance, Terms, euclidean, no_terms, phi, regular, sums


def tangents(normals: np.ndarray) -> np.ndarray:
    """Unit vectors perpendicular to the normals (k, d) and each other: (d - k, d)."""
    return np.linalg.svd(np.atleast_2d(normals))[2][len(np.atleast_2d(normals)) :]


def direct(
    targets: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
    slides: Sequence[tuple[np.ndarray, np.ndarray]],
    radius: float,
    distance: Distance = euclidean,
    terms: Terms = no_terms,
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the targets, and the coefficients alpha (N_c, d).

    ``known``: positions and displacements of the moving nodes; ``slides``: position and unit
    normals (k, d) of each sliding node. Unknowns are ordered alpha_x, alpha_y, alpha_z as in
    Eq. 2.22; each sliding node has its normal conditions (2.18, 2.20) and its tangential ones
    (2.19, 2.21). The polynomial's coefficients beta_x, beta_y, beta_z follow, with the side
    conditions of Eq. 2.3 for each component.
    """
    where, values = known
    d, m = values.shape[1], len(where)
    controls = np.concatenate([where, [x for x, _ in slides]])
    count = len(controls)
    matrix, along = phi(controls, controls, radius, distance), terms(controls)
    q = along.shape[1]
    rows, right = [], []
    for i in range(m):
        for axis in range(d):
            row = np.zeros(d * (count + q))
            row[axis * count : (axis + 1) * count] = matrix[i]
            row[d * count + axis * q :][:q] = along[i]
            rows.append(row)
            right.append(values[i, axis])
    for i, (_, normals) in enumerate(slides, start=m):
        for n in np.atleast_2d(normals):
            rows.append(np.concatenate([np.kron(n, matrix[i]), np.kron(n, along[i])]))
            right.append(0.0)
        for t in tangents(normals):
            row = np.zeros(d * (count + q))
            row[i : d * count : count] = t
            rows.append(row)
            right.append(0.0)
    for side in np.kron(np.eye(d), along.T):
        rows.append(np.concatenate([side, np.zeros(d * q)]))
        right.append(0.0)
    system = np.array(rows)
    if np.linalg.matrix_rank(system) == len(system):
        found = np.linalg.solve(system, np.array(right))
    else:  # periodic images are at distance zero
        found = np.linalg.lstsq(system, np.array(right), rcond=1e-13)[0]
    alpha, beta = found[: d * count].reshape(d, count).T, found[d * count :].reshape(d, q).T
    return sums(targets, controls, alpha, radius, distance) + terms(targets) @ beta, alpha


def pseudo(
    targets: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
    levels: Sequence[Sequence[tuple[np.ndarray, np.ndarray]]],
    radius: float,
    distance: Distance = euclidean,
    terms: Terms = no_terms,
) -> np.ndarray:
    """Displacement of the targets; levels are edge nodes, then surface nodes (section 2.4.2).

    Every level is displaced freely, loses what is normal to its planes, and is known then.
    """
    where, values = known
    for level in levels:
        if not len(level):
            continue
        spots = np.array([x for x, _ in level])
        free = regular(spots, where, values, radius, distance, terms)
        slid = []
        for u, (_, normals) in zip(free, level, strict=True):
            along = tangents(normals)
            slid.append(sum((t * (u @ t) for t in along), np.zeros_like(u)))
        where = np.concatenate([where, spots])
        values = np.concatenate([values, slid])
    return regular(targets, where, values, radius, distance, terms)
