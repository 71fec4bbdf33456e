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

TIE = 1e-4
"""Boundary nodes farther than the nearest one by less than this part of its distance count too:
far above rounding, far below any difference of distances that a mesh could mean."""


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
    that radius, which is what makes it cheap, and goes on beyond periodic boundaries. Where
    several are equally near, as on symmetric meshes, it is the mean of their errors: one of them
    would be chosen by its number.

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
    # Nodes that coincide, or are images of each other, count once.
    once = np.unique(problem.same_as[nodes], return_index=True)[1]
    sources, lacking = points[nodes[once]], errors[once]
    if np.any(problem.shift):
        at = problem.coords[nodes[once]]
        images = [problem.cartesian(at + s * problem.shift) for s in (-1, 1)]
        sources, lacking = np.concatenate([sources, *images]), np.tile(lacking, (3, 1))
    tree = cKDTree(sources)
    free = np.ones(len(points), bool)
    free[nodes] = False
    targets = np.flatnonzero(free)
    for start in range(0, len(targets), CHUNK):
        part = targets[start : start + CHUNK]
        workers = -1 if len(part) == CHUNK else 1
        near = tree.query(points[part], k=2, distance_upper_bound=radius, workers=workers)
        distance, index = (np.asarray(found) for found in near)
        hit = np.isfinite(distance[:, 0])
        part, distance, index = part[hit], distance[hit], index[hit, 0]
        q = distance[:, 0] / radius
        share = (1.0 - q) ** 4 * (4.0 * q + 1.0)
        taken = lacking[index]
        tied = np.flatnonzero(distance[:, 1] <= (1.0 + TIE) * distance[:, 0])
        if len(tied):
            taken[tied] = _means(tree, lacking, points[part[tied]], distance[tied, 0])
        displacement[part] += share[:, None] * taken
        tick(min(1.0, (start + CHUNK) / len(targets)))


def _means(
    tree: cKDTree, lacking: FloatArray, points: FloatArray, distance: FloatArray
) -> FloatArray:
    """Return the mean (m, d) of the errors of the sources that are nearest to points (m, d).

    The weight of each falls to zero at ``TIE`` beyond the nearest, so that rounding, which moves
    the nodes of a symmetric mesh a little, changes the mean little.
    """
    found = tree.query_ball_point(points, (1.0 + TIE) * distance)
    row = np.repeat(np.arange(len(points)), [len(each) for each in found])
    source = np.concatenate([np.array(each, np.int64) for each in found])
    beyond = np.linalg.norm(points[row] - tree.data[source], axis=1) - distance[row]
    weight = np.clip(1.0 - beyond / np.maximum(TIE * distance[row], 1e-300), 0.0, 1.0)
    total = np.zeros((len(points), lacking.shape[1] + 1))
    np.add.at(total, row, weight[:, None] * np.c_[lacking[source], np.ones(len(source))])
    return total[:, :-1] / total[:, -1:]
