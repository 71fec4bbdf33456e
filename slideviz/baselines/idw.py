"""Inverse distance weighting, an explicit method (Witteveen and Bijl, AIAA 2009-3996).

    s(x) = sum_j g_j |x - x_j|^-c v_j / sum_j g_j |x - x_j|^-c

over all boundary nodes j with known displacement v_j; no system is solved. The power c is the
number of dimensions (2 in the plane, 3 in space) if not given. g_j is 1 for nodes that move and
the factor ``fixed_weight`` for those that stay: above 1 it keeps the mesh at rest near walls,
below 1 it lets the motion reach further. Distances are those of the working frame, so they are
periodic where the case is. Sliding nodes go the way of pseudo sliding: edges first, then surfaces,
each displaced by what is known before and projected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.baselines import weighting
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf import compiled
from slideviz.rbf.evaluate import CHUNK, Basis, Tick, no_tick
from slideviz.rbf.methods import within
from slideviz.rbf.problem import Problem, Solution, Watch
from slideviz.rbf.rows import merge


@dataclass(frozen=True)
class Weights:
    """The settings.

    Attributes
    ----------
    power : float
        c.
    fixed_weight : float
        g_j of nodes that stay.
    """

    power: float
    fixed_weight: float = 1.0


def weighted_means(
    basis: Basis,
    targets: FloatArray,
    sources: FloatArray,
    data: tuple[FloatArray, FloatArray],
    power: float,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return s at the targets, (N, d).

    Parameters
    ----------
    basis
        Its radius is the length that distances are divided by, which changes nothing but
        rounding; its period chooses the distance.
    targets, sources : (k, N), (k, n)
        Features, as ``Frame.features`` gives them.
    data : (n, d), (n,)
        Values v_j and weights g_j.
    power
        c.
    tick
        Called between chunks with the fraction done; may raise to stop.
    """
    # Only lengths are scaled: sine and cosine of the angle are none.
    scale = np.full((4, 1), 1.0 / basis.radius)
    if basis.period > 0:
        scale[1:3] = 1.0
    x, c = _rows(targets, 4) * scale, _rows(sources, 4) * scale
    v, g = _rows(data[0].T, 3), np.ascontiguousarray(data[1], float)
    total = x.shape[1]
    out = np.empty((3, total))
    size = max(1, CHUNK // max(1, c.shape[1]))
    for start in range(0, total, size):
        part = np.ascontiguousarray(x[:, start : start + size])
        result = np.empty_like(part[:3])
        with compiled.one_at_a_time(part.shape[1] * c.shape[1]):
            if basis.period > 0:
                weighting.weigh_rotational(part, c, v, g, power, basis.half, result)
            else:
                weighting.weigh(part, c, v, g, power, result)
        out[:, start : start + size] = result
        tick(min(1.0, (start + size) / total))
    return np.ascontiguousarray(out[: data[0].shape[1]].T)


def _rows(values: FloatArray, rows: int) -> FloatArray:
    """Return the array (k, n) with zero rows added up to ``rows``."""
    out = np.zeros((rows, values.shape[1]))
    out[: len(values)] = values
    return out


def deform_idw(problem: Problem, watch: Watch, weights: Weights) -> Solution:
    """Return the displacement as weighted means of that of the boundary.

    Raises
    ------
    DeformError
        Coinciding nodes are asked to move differently.
    """
    nodes, values = problem.known, problem.values
    for level in (problem.edge, problem.surface):
        if not len(level):
            continue
        free = _at(problem, watch, (nodes, values), level, weights)
        if problem.curved:
            free = within(problem, level, free)
        with watch.phase("project"):
            slid = problem.project(level, free)
        nodes, values = np.concatenate([nodes, level]), np.concatenate([values, slid])
    everywhere = np.arange(len(problem.coords))
    displacement = _at(problem, watch, (nodes, values), everywhere, weights)
    errors = np.linalg.norm(displacement[nodes] - values, axis=1)
    displacement[nodes] = values
    return Solution(
        displacement,
        len(merge(problem, nodes, values)[0]),
        float(errors.max(initial=0.0)),
        np.empty(0, np.int64),
        float("nan"),
    )


def _at(
    problem: Problem,
    watch: Watch,
    known: tuple[IntArray, FloatArray],
    targets: IntArray,
    weights: Weights,
) -> FloatArray:
    """Return the displacements (m, d) of nodes from those of the known ones."""
    nodes, values = merge(problem, *known)
    own = np.where(np.any(values != 0, axis=1), 1.0, weights.fixed_weight)
    features = problem.features
    with watch.phase("evaluate") as tick:
        return weighted_means(
            problem.basis,
            features[:, targets],
            features[:, nodes],
            (values, own),
            weights.power,
            tick,
        )
