"""Linear elasticity: the mesh as an elastic body, as SU2 deforms it by default.

Small cells are stiff: Young's modulus is the inverse of the cell's volume. The displacement of
moving and fixed nodes is known, that of sliding nodes is zero along their normals, and periodic
images have equal displacements, turned where the mesh repeats by rotation; all other nodes are
free. Each step begins with the deformed mesh, without stresses.
"""

from __future__ import annotations

import numpy as np

from slideviz.baselines.conditions import Body, conditions, rigid_motions
from slideviz.baselines.multigrid import LinearSolution, solve
from slideviz.baselines.stiffness import assemble
from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.constraint_rows import AGREE, merge
from slideviz.rbf.methods import within
from slideviz.rbf.problem import PhaseTimer, Problem, Solution

HOPELESS = 1e-3
"""Largest residual ratio of a usable solution; above ``multigrid.TOLERANCE`` there is a warning."""

ASSEMBLING = 0.2
"""The part of the phase ``solve`` that the matrix takes."""


def deform_elastic(problem: Problem, timer: PhaseTimer, body: Body) -> Solution:
    """Return the solution of one step as an elastic body.

    Sliding nodes move in the tangent planes of their boundary. Where a boundary is curved, or a
    node slid past its end, sliding nodes are then projected on it, and a second solution has them
    as known nodes.

    Raises
    ------
    DeformError
        A cell has no volume, the solver does not converge, or coinciding nodes are asked to
        move differently.
    """
    nodes, values = problem.known, problem.values
    displacement, warnings = _equilibrium(problem, timer, body, nodes, values)
    sliding = np.concatenate([problem.edge, problem.surface])
    if len(sliding):
        free = within(problem, sliding, displacement[sliding])
        with timer.phase("project"):
            slid = problem.project(sliding, free)
        nodes, values = np.concatenate([nodes, sliding]), np.concatenate([values, slid])
        if np.abs(slid - free).max() > AGREE * problem.basis.radius:
            start = displacement
            displacement, warnings = _equilibrium(problem, timer, body, nodes, values, start)
    displacement[nodes] = values
    return Solution(
        displacement,
        len(merge(problem, nodes, values)[0]),
        0.0,
        np.empty(0, np.int64),
        float("nan"),
        warnings=warnings,
    )


def _equilibrium(
    problem: Problem,
    timer: PhaseTimer,
    body: Body,
    nodes: IntArray,
    values: FloatArray,
    start: FloatArray | None = None,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the displacement of all nodes in the frame (n, d), and warnings of the solver.

    Parameters
    ----------
    nodes, values : (m,), (m, d)
        Nodes with known displacement, in the frame.
    start : (n, d), optional
        A guess of the displacement, in the frame.
    """
    with timer.phase("solve") as tick:
        points = body.frame.points(problem.coords)
        given = conditions(problem, body, nodes, values)
        matrix, right = assemble(points, body.parts, given, lambda f: tick(ASSEMBLING * f))
        guess = np.zeros((len(given.free), points.shape[1]))
        inside = np.flatnonzero(given.place >= 0)
        if start is not None:
            moved = body.frame.points(problem.coords + start) - points
            turned = np.einsum("mji,mj->mi", given.turn[inside], moved[inside])
            guess[given.place[inside]] = turned
        found = solve(
            matrix,
            right,
            rigid_motions(points, given),
            guess.ravel(),
            lambda f: tick(ASSEMBLING + (1.0 - ASSEMBLING) * f),
        )
        warnings = _warnings(found)
        shift = given.known.copy()
        unknown = found.x.reshape(guess.shape)[given.place[inside]]
        shift[inside] = np.einsum("mij,mj->mi", given.turn[inside], unknown)
        displacement = body.frame.difference(points, shift)
    return displacement, warnings


def _warnings(found: LinearSolution) -> tuple[str, ...]:
    """Return a warning if the solver did not reach its tolerance; empty if it did.

    Raises
    ------
    DeformError
        The residual ratio is above `HOPELESS`.
    """
    if found.converged:
        return ()
    if not found.residual_ratio <= HOPELESS:
        raise DeformError(
            f"the equations of linear elasticity were not solved: after {found.iterations} "
            f"iterations the residual is {found.residual_ratio:.2g} of what it was; cells much "
            "smaller or flatter than their neighbours do this, so use more STEPS, or METHOD= rbf"
        )
    sentence = (
        f"the equations of linear elasticity were solved to {found.residual_ratio:.1g} only, in "
        f"{found.iterations} iterations; look at the result with care, or use more STEPS"
    )
    return (sentence,)
