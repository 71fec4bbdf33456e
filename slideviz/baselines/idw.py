"""Inverse distance weighting, an explicit method (Witteveen and Bijl, AIAA 2009-3996).

    s(x) = sum_j g_j |x - x_j|^-c v_j / sum_j g_j |x - x_j|^-c

over all boundary nodes j with known displacement v_j; no system is solved. The power c is the
number of dimensions (2 in the plane, 3 in space) if not given. g_j is 1 for nodes that move and
the factor ``fixed_weight`` for those that stay: above 1 it keeps the mesh at rest near walls,
below 1 it lets the motion reach further. Distances are those of the working frame, so they are
periodic where the case is. Sliding nodes are treated as in pseudo sliding: edges first, then
surfaces, each displaced by the nodes known before, and projected.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from slideviz.argument_types import frozen, record
from slideviz.mesh.model import NO_NODES, FloatArray, IntArray
from slideviz.rbf.compiled import fast, squared_distance
from slideviz.rbf.constraint_rows import merge
from slideviz.rbf.evaluate import Basis, Tick, no_tick, padded_rows, summed
from slideviz.rbf.methods import largest_norm, within
from slideviz.rbf.operations import columns
from slideviz.rbf.problem import PhaseTimer, Problem, StepSolution
from slideviz.rbf.tape import Array, join, put, take, value

TINY = 1e-24
"""Smallest square of a distance over the radius: the weight of a coinciding node is then so large
that no other node counts."""


@frozen
class Weights:
    """Settings of inverse distance weighting."""

    power: float  # the power c of the distance
    fixed_weight: float = 1.0  # the weight g_j of nodes with displacement zero

    def of(self, values: FloatArray) -> FloatArray:
        """Return g_j, (n,), of nodes with the displacements ``values`` (n, d)."""
        return np.where(np.any(values != 0, axis=1), 1.0, self.fixed_weight)


def weighted_means(
    basis: Basis,
    targets: FloatArray,
    sources: FloatArray,
    values: FloatArray,
    weights: FloatArray,
    *,
    power: float,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return s at the targets, (N, d).

    ``basis``: its radius is the length that distances are divided by, which changes nothing but
    rounding; its period chooses the distance. ``targets`` and ``sources``: features (k, N) and
    (k, n), as ``Frame.features`` gives them. ``values`` and ``weights``: v_j (n, d) and g_j (n,).
    ``power``: c. ``tick``: called between chunks with the fraction done; may raise to stop.
    """
    c = padded_rows(sources, 4)
    v = padded_rows(values.T, 3)
    g = np.ascontiguousarray(weights, float)
    metric = basis.period_over_pi, 1.0 / basis.radius**2

    def add_up(x: FloatArray, out: FloatArray) -> None:
        weigh(x, c, v, g, power, *metric, out)

    return summed(add_up, targets, c, values.shape[1], tick)


def deform_idw(problem: Problem, timer: PhaseTimer, weights: Weights) -> StepSolution:
    """Return the solution of one step: displacements are weighted means of those of the boundary.

    Raises DeformError if coinciding nodes are asked to move differently.
    """
    nodes = problem.known
    values = problem.values
    for level in (problem.edge, problem.surface):
        if not len(level):
            continue
        free = _means(problem, timer, nodes, values, columns(problem.features, level), weights)[0]
        if problem.curved:
            free = within(problem, level, free)
        with timer.phase("project"):
            slid: Array = problem.project(level, free)
        nodes = np.concatenate([nodes, level])
        values = join(values, slid)
    displacement, field = _means(problem, timer, nodes, values, problem.features, weights)
    errors = largest_norm(take(displacement, nodes) - values)
    return StepSolution(
        put(displacement, nodes, values, overwrite=True),
        len(field.values),
        errors,
        NO_NODES,
        float("nan"),
        field=field,
    )


def _means(
    problem: Problem,
    timer: PhaseTimer,
    known: IntArray,
    values: Array,
    targets: Array,
    weights: Weights,
) -> tuple[Array, WeightedField]:
    """Return the displacements (..., m, d) at features (k, m), and their field.

    From ``values`` (..., b, d) at nodes ``known`` (b,), coinciding nodes merged.
    """
    nodes, data = merge(problem, known, values)
    sources = columns(problem.features, nodes)
    power = weights.power
    node_weights = weights.of(value(data))
    field = WeightedField(problem.basis, value(sources), value(data), node_weights, power)
    with timer.phase("evaluate") as tick:
        return field.at(value(targets), np.empty(0), tick), field


@record
class WeightedField:
    """Displacement field: means of the displacements of sources, by their inverse distance."""

    basis: Basis
    sources: FloatArray  # (k, n): features of the boundary nodes
    values: FloatArray
    weights: FloatArray
    """`values`, `weights` (n, d), (n,): their displacements v_j in the frame, and g_j."""
    power: float  # c

    def at(self, features: FloatArray, _: FloatArray, /, tick: Tick = no_tick) -> FloatArray:
        """Return the displacement (m, d) at features (k, m)."""
        return weighted_means(
            self.basis,
            features,
            self.sources,
            self.values,
            self.weights,
            power=self.power,
            tick=tick,
        )


@fast(inline="always")
def _weight(squared, power):  # type: ignore[no-untyped-def]
    """Return distance^-power for the square of a distance."""
    if power == 2.0:
        return 1.0 / squared
    if power == 3.0:
        return 1.0 / (squared * np.sqrt(squared))
    return squared ** (-0.5 * power)


@fast(inline="always")
def _mean(x, c, w, g, power, period_over_pi, scale, out):  # type: ignore[no-untyped-def]
    """Write the weighted mean at one target x (4,) to out (3,); parameters as of ``weigh``."""
    c0 = c[0]
    c1 = c[1]
    c2 = c[2]
    c3 = c[3]
    w0 = w[0]
    w1 = w[1]
    w2 = w[2]
    x0 = x[0]
    x1 = x[1]
    x2 = x[2]
    x3 = x[3]
    s0 = 0.0
    s1 = 0.0
    s2 = 0.0
    total = 0.0
    for j in range(c.shape[1]):
        squared = squared_distance(x0, x1, x2, x3, c0[j], c1[j], c2[j], c3[j], period_over_pi, True)
        p = g[j] * _weight(max(squared * scale, TINY), power)
        s0 += w0[j] * p
        s1 += w1[j] * p
        s2 += w2[j] * p
        total += p
    out[0] = s0 / total
    out[1] = s1 / total
    out[2] = s2 / total


@fast(parallel=True)
def weigh(x, c, w, g, power, period_over_pi, scale, out):  # type: ignore[no-untyped-def]
    """Write the weighted means at targets x (4, N) to out (3, N).

    Of values w (3, n) at sources c (4, n), with weights g (n,) besides that of the distance.
    ``period_over_pi`` is theta_p / pi; ``scale`` is the factor of squared distances. The usual
    powers have loops of their own, which the compiler vectorises.
    """
    for i in prange(x.shape[1]):
        if power == 2.0:
            _mean(x[:, i], c, w, g, 2.0, period_over_pi, scale, out[:, i])
        elif power == 3.0:
            _mean(x[:, i], c, w, g, 3.0, period_over_pi, scale, out[:, i])
        else:
            _mean(x[:, i], c, w, g, power, period_over_pi, scale, out[:, i])
