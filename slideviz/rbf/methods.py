"""Regular interpolation, pseudo and direct sliding: one function each, for one step.

Every condition is a scalar constraint "the displacement of node i along n is b" (see
`ConstraintRows`). Regular interpolation has all axes of all boundary nodes as constraints,
direct sliding only the normals of the nodes that slide (thesis section 2.4.1), and pseudo
sliding (2.4.2) finds the displacement of these by projection first. The fit meets the
constraints: `ExactFit` all at once, `GreedyFit` by a selection of them. The errors that are left
at boundary nodes are spread to the nodes near them (section 2.5.1, Eq. 2.30 and 2.31).

Everything here is made of operations on arrays or on variables of a tape (`slideviz.rbf.tape`), so
that derivatives follow. What is discrete is chosen by ``Problem.choose``, and what is fitted,
projected and corrected in a frozen step by ``Problem.frozen``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from slideviz.mesh.model import (
    NO_NODES,
    FloatArray,
    IntArray,
    largest_coordinate,
    row_norms,
    row_numbers,
)
from slideviz.rbf.constraint_rows import AGREE, full_rows, merge, sliding_rows
from slideviz.rbf.evaluate import Tick
from slideviz.rbf.exact import ExactFit, Fit
from slideviz.rbf.field import Correction
from slideviz.rbf.greedy import GreedyFit
from slideviz.rbf.problem import (
    CarriedError,
    PhaseTimer,
    Problem,
    StepSolution,
)
from slideviz.rbf.reduction import GAMMA
from slideviz.rbf.tape import Array, add_at, dot, join, multiply, put, take, value
from slideviz.system.threads import in_parts

ROUNDING = 1e-14
"""Projection moves a point of a flat boundary by at most this part of the largest coordinate."""

LOST = 1e-9
"""Errors of an exact solution at control nodes above this part of the largest displacement are
spread around the nodes: badly conditioned systems have weights so large that their sum loses
digits, which no refinement of the weights brings back."""

NEGLIGIBLE = 1e-14  # errors below this part of the support radius are rounding, and are not spread


IMAGES = (0, -1, 1)  # periods by which the sources of the correction are shifted, in this order


def regular(problem: Problem, timer: PhaseTimer) -> StepSolution:
    """Interpolate the known displacements (thesis section 2.1)."""
    fit = _fit(problem, timer)
    fit.add(full_rows(problem, problem.known, problem.values))
    return _finish(problem, timer, fit, problem.known, problem.values)


def pseudo_sliding(problem: Problem, timer: PhaseTimer) -> StepSolution:
    """Displace sliding nodes by interpolation, project them, and add them to the known nodes.

    Edges first, then surfaces; then interpolate with all of them (section 2.4.2).
    """
    fit = _fit(problem, timer)
    fit.add(full_rows(problem, problem.known, problem.values))
    nodes = problem.known
    values = problem.values
    for level in (problem.edge, problem.surface):
        if len(level):
            slid = _slide(problem, timer, fit, level)
            # A node that coincides with one of an earlier level is in the system already.
            new = np.flatnonzero(~np.isin(problem.same_as[level], problem.same_as[nodes]))
            nodes = np.concatenate([nodes, level])
            values = join(values, slid)
            merge(problem, nodes, values)
            fit.add(full_rows(problem, level[new], take(slid, new)))
    return _finish(problem, timer, fit, nodes, values)


def direct_sliding(problem: Problem, timer: PhaseTimer) -> StepSolution:
    """Let sliding nodes move within their boundary by the system itself (section 2.4.1).

    Where the boundary is curved, or a node slid past the end of its piece, the slid nodes are
    projected, and a second system interpolates with them as known nodes.
    """
    if not len(problem.normal_nodes):
        return regular(problem, timer)
    fit = _fit(problem, timer)
    fit.add(sliding_rows(problem))
    sliding = np.concatenate([problem.edge, problem.surface])
    nodes = np.concatenate([problem.known, sliding])
    free = _at(problem, timer, fit, sliding) - problem.carried_error(sliding)
    if not problem.curved:
        free = within(problem, sliding, free)
    with timer.phase("project"):
        slid = problem.project(sliding, free)
    gap = np.abs(value(slid) - value(free)).max(axis=-1, initial=0.0)
    nearly = AGREE * problem.basis.radius
    if problem.choose("flat", lambda: not problem.curved and gap.max(initial=0.0) <= nearly):
        # A straight edge of a curved surface: its nodes leave it a little along the normals.
        rounding = ROUNDING * largest_coordinate(value(problem.coords))
        off = problem.choose("off", lambda: np.flatnonzero(gap > rounding))
        slid = put(free, off, take(slid, off))
        return _finish(problem, timer, fit, nodes, join(problem.values, slid))
    values = join(problem.values, slid)
    second = _fit(problem, timer, fit)
    second.add(full_rows(problem, nodes, values))
    solution = _finish(problem, timer, second, nodes, values)
    return replace(
        solution,
        stages=(*fit.stages, *solution.stages),
        error_estimate=np.maximum(fit.error_estimate, solution.error_estimate),
        refined=max(fit.refined, solution.refined),
    )


def within(problem: Problem, nodes: IntArray, free: Array) -> Array:
    """Return displacements ``free`` (..., m, d) of sliding nodes less their part along normals."""
    row = row_numbers(len(problem.same_as), nodes)
    at = row[problem.normal_nodes]
    normals = take(problem.normals, np.flatnonzero(at >= 0))
    at = at[at >= 0]
    return add_at(free, at, -multiply(normals, dot(take(free, at), normals)))


SLIDING_METHODS: dict[str, Callable[[Problem, PhaseTimer], StepSolution]] = {
    "none": regular,
    "ps": pseudo_sliding,
    "ds": direct_sliding,
}
"""Method by the value of SLIDING_MODE."""


def _fit(problem: Problem, timer: PhaseTimer, first: Fit | None = None) -> Fit:
    """Return an empty fit, greedy with data reduction; ``first`` is the previous fit, if any."""
    if problem.frozen is not None:
        frozen: Fit = problem.frozen.fit(problem)
        return frozen
    if problem.reduction is None:
        return ExactFit(problem, timer)
    if first is None:
        return GreedyFit(problem, timer)
    return GreedyFit(problem, timer, first.history, done=len(first.stages))


def _at(problem: Problem, timer: PhaseTimer, fit: Fit, nodes: IntArray | slice) -> Array:
    """Return the interpolated displacements (..., m, d) of nodes."""
    out = problem.frozen.out if problem.frozen and isinstance(nodes, slice) else None
    with timer.phase("evaluate") as tick:
        return fit.interpolant.at(problem, nodes, tick, out)


def _slide(problem: Problem, timer: PhaseTimer, fit: Fit, level: IntArray) -> Array:
    """Return the interpolated displacements (..., m, d) of sliding nodes (m,), projected.

    On curved boundaries the part along the normals is removed before the projection: the point
    closest to a node that was pushed through a thin profile is on the profile's other side.
    """
    free = _at(problem, timer, fit, level) - problem.carried_error(level)
    if problem.curved:
        free = within(problem, level, free)
    with timer.phase("project"):
        slid: Array = problem.project(level, free)
    return slid


def largest_norm(vectors: Array) -> Any:
    """Return the largest length of rows (..., n, d): a float, or (...,) of several designs."""
    size = row_norms(value(vectors)).max(axis=-1, initial=0.0)
    return float(size) if size.ndim == 0 else size


def _finish(
    problem: Problem, timer: PhaseTimer, fit: Fit, nodes: IntArray, values: Array
) -> StepSolution:
    """Return the solution, exact at ``nodes`` (b,) by ``values``; elsewhere errors are spread."""
    displacement = _at(problem, timer, fit, slice(None))
    errors = values - take(displacement, nodes)
    total = problem.carried_error(nodes) + errors
    carried = None
    if problem.reduction is not None:
        order = np.argsort(nodes)
        carried = CarriedError(nodes[order], take(total, order))
    left_out = np.isin(problem.same_as[nodes], fit.dropped)
    lost = 0.0
    if problem.reduction is None:
        lost = largest_norm(take(errors, np.flatnonzero(~left_out)))
    off = np.any(lost > LOST * largest_norm(values))
    needed = bool(problem.reduction is not None or len(fit.dropped) or off)
    correction = None
    if problem.frozen is not None:
        displacement = problem.frozen.correct(problem, displacement, nodes, errors, needed=needed)
    elif needed:
        correction = correction_of(problem, nodes, value(errors))
    if correction is not None:
        with timer.phase("correct") as tick:
            correct(problem, value(displacement), nodes, correction, tick)
    solution = StepSolution(
        put(displacement, nodes, values, overwrite=True),
        0,
        largest_norm(total),
        fit.dropped,
        fit.condition(),
        fit.history,
        carried=carried,
        short=fit.short,
        lost=lost,
        error_estimate=fit.error_estimate,
        refined=fit.refined,
        stages=fit.stages,
    )
    if problem.frozen is not None:
        return solution
    # Without the nodes that the pivot guard left out.
    kept = [NO_NODES, *(level[:, 0] for level in fit.stages[-1])]
    control = fit.interpolant.nodes[np.isin(fit.interpolant.nodes, np.concatenate(kept))]
    return replace(
        solution,
        control_nodes=len(control),
        control=control,
        dropped_error=largest_norm(take(errors, np.flatnonzero(left_out))),
        field=replace(fit.interpolant.field(problem), correction=correction),
    )


def correction_of(problem: Problem, nodes: IntArray, errors: FloatArray) -> Correction | None:
    """Return the correction that spreads errors at boundary nodes; None where they are rounding.

    Its radius is ``gamma`` times the largest error (Eq. 2.31).
    ``nodes`` and ``errors`` (b,), (b, d): boundary nodes with known displacement, and the errors
    there, in the frame.
    """
    largest = largest_norm(errors)
    if largest <= NEGLIGIBLE * problem.basis.radius:
        return None
    radius = (problem.reduction.gamma if problem.reduction else GAMMA) * largest
    # Nodes that coincide, or are images of each other, count once.
    once = np.unique(problem.same_as[nodes], return_index=True)[1]
    at = value(problem.coords)[nodes[once]]
    sources = problem.cartesian(at)
    lacking = errors[once]
    if np.any(problem.shift):
        images = [problem.cartesian(at + s * problem.shift) for s in IMAGES[1:]]
        sources = np.concatenate([sources, *images])
        lacking = np.tile(lacking, (3, 1))
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    return Correction(cKDTree(sources), lacking, radius)


def correct(
    problem: Problem, displacement: FloatArray, nodes: IntArray, correction: Correction, tick: Tick
) -> None:
    """Add the correction to ``displacement`` (n, d), except at boundary nodes ``nodes`` (b,)."""
    free = np.ones(len(displacement), bool)
    free[nodes] = False

    def correct_part(part: slice) -> None:
        targets = part.start + np.flatnonzero(free[part])
        hit, taken = correction.near(problem.cartesian(value(problem.coords)[targets]))
        displacement[targets[hit]] += taken

    in_parts(correct_part, len(displacement), tick)
