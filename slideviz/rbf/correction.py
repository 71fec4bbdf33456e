"""The explicit boundary correction (thesis section 2.5.1, Eq. 2.30 and 2.31)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Tick
from slideviz.rbf.problem import Problem

GAMMA = 25.0
NEGLIGIBLE = 1e-14
"""Errors below this part of the support radius are rounding, and are not spread."""

CHUNK = 50_000


def correct(
    problem: Problem,
    displacement: FloatArray,
    nodes: IntArray,
    errors: FloatArray,
    tick: Tick,
) -> None:
    """Spread what boundary nodes lack to the nodes near them, in place.

    Each node takes over the error of its nearest boundary node, weighted with Wendland's C2
    function of the distance over ``gamma`` times the largest error. The search is bounded by
    that radius, which is what makes it cheap, and goes on beyond periodic boundaries.

    Parameters
    ----------
    displacement : (n, d)
        Changed in place.
    nodes : (b,)
        Boundary nodes with known displacement, and ``errors`` (b, d): what they lack.
    """
    largest = float(np.linalg.norm(errors, axis=1).max(initial=0.0))
    if largest <= NEGLIGIBLE * problem.basis.radius:
        return
    radius = (problem.reduction.gamma if problem.reduction else GAMMA) * largest
    points = problem.cartesian(problem.coords)
    sources, owner = points[nodes], np.arange(len(nodes))
    if np.any(problem.shift):
        images = [problem.cartesian(problem.coords[nodes] + s * problem.shift) for s in (-1, 1)]
        sources, owner = np.concatenate([sources, *images]), np.tile(owner, 3)
    tree = cKDTree(sources)
    free = np.ones(len(points), bool)
    free[nodes] = False
    targets = np.flatnonzero(free)
    for start in range(0, len(targets), CHUNK):
        part = targets[start : start + CHUNK]
        workers = -1 if len(part) == CHUNK else 1
        near = tree.query(points[part], distance_upper_bound=radius, workers=workers)
        distance, index = (np.asarray(found) for found in near)
        hit = np.isfinite(distance)
        q = distance[hit] / radius
        share = (1.0 - q) ** 4 * (4.0 * q + 1.0)
        displacement[part[hit]] += share[:, None] * errors[owner[index[hit]]]
        tick(min(1.0, (start + CHUNK) / len(targets)))
