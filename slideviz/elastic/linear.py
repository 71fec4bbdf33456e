"""Linear elasticity: the mesh as an elastic body, as SU2 deforms it.

Small cells, or those near walls, are stiff (`slideviz.elastic.stiffness`). The displacement of
moving and fixed nodes is known, that of sliding nodes is zero along their normals, and periodic
images have equal displacements, turned where the mesh repeats by rotation; all other nodes are
free. Each step begins with the deformed mesh, without stresses.
"""

from __future__ import annotations

import numpy as np

from slideviz.elastic.conditions import Body, conditions
from slideviz.elastic.laplacian import LaplacianCycle, held_components
from slideviz.elastic.linear_systems import LIMIT, solve
from slideviz.elastic.stiffness import Conditions, ElasticMesh
from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.constraint_rows import AGREE, merge
from slideviz.rbf.methods import within
from slideviz.rbf.problem import PhaseTimer, Problem, StepSolution
from slideviz.rbf.tape import (
    Array,
    Linear,
    join,
    put,
    take,
    value,
)

ASSEMBLING = 0.2  # the part of the phase solve that the matrix takes


def deform_elastic(problem: Problem, timer: PhaseTimer, body: Body) -> StepSolution:
    """Return the solution of one step as an elastic body.

    Sliding nodes move in the tangent planes of their boundary. Where a boundary is curved, or a
    node slid past its end, sliding nodes are then projected on it, and a second solution has them
    as known nodes. Raises DeformError if a cell has no volume, the solver does not converge, or
    coinciding nodes are asked to move differently.
    """
    nodes = problem.known
    values = problem.values
    displacement = _equilibrium(problem, timer, body, nodes, values)
    sliding = np.concatenate([problem.edge, problem.surface])
    if len(sliding):
        free = within(problem, sliding, take(displacement, sliding))
        with timer.phase("project"):
            slid: Array = problem.project(sliding, free)
        nodes = np.concatenate([nodes, sliding])
        values = join(values, slid)
        gap = np.abs(value(slid) - value(free)).max()
        if gap > AGREE * problem.basis.radius:
            displacement = _equilibrium(problem, timer, body, nodes, values, displacement)
    return StepSolution(
        put(displacement, nodes, values, overwrite=True),
        len(merge(problem, nodes, values)[0]),
        0.0,
        np.empty(0, np.int64),
        float("nan"),
    )


def _equilibrium(
    problem: Problem,
    timer: PhaseTimer,
    body: Body,
    nodes: IntArray,
    values: Array,
    start: Array | None = None,
) -> Array:
    """Return the displacement of all nodes in the frame (..., n, d).

    Raises DeformError if the solver's error is above `LIMIT` of the largest displacement.
    ``nodes``, ``values`` (m,), (..., m, d): nodes with known displacement, in the frame.
    ``start`` (n, d): a guess of the displacement, in the frame.
    """
    coords = value(problem.coords)
    with timer.phase("solve") as tick:
        at = body.frame.points(coords)
        prescribed = conditions(problem, body, nodes, value(values))
        mesh = ElasticMesh.at(at, body.parts, body.stiffness)
        matrix = mesh.matrix(prescribed, lambda f: tick(ASSEMBLING * f))
        inside = np.flatnonzero(prescribed.place >= 0)
        place = prescribed.place[inside]
        turn = prescribed.turn[inside]
        guess = np.zeros((len(prescribed.free), at.shape[1]))
        if start is not None:
            moved = body.frame.points(coords + value(start)) - at
            guess[place] = np.einsum("mji,mj->mi", turn, moved[inside])

        def shifted(unknown: FloatArray) -> FloatArray:
            shift = prescribed.known.copy()
            shift[inside] = np.einsum("mij,mj->mi", turn, unknown.reshape(guess.shape)[place])
            return shift

        def residual(unknown: FloatArray) -> FloatArray:
            forces = np.einsum("mji,mj->mi", turn, mesh.forces(shifted(unknown))[inside])
            out = np.zeros_like(guess)
            np.subtract.at(out, place, forces)
            return out.ravel()

        solved = solve(
            matrix,
            lambda: preconditioner(mesh, prescribed),
            residual,
            guess.ravel(),
            float(np.abs(prescribed.known).max(initial=0.0)),
            lambda f: tick(ASSEMBLING + (1.0 - ASSEMBLING) * f),
        )
        if not solved.error <= LIMIT:
            raise DeformError(
                "the equations of linear elasticity were not solved: the error is about "
                f"{solved.error:.2g} of the largest displacement, more than {LIMIT:.0e}; cells "
                "much smaller or flatter than their neighbors do this, so use METHOD= rbf, or "
                "DEFORM_STIFFNESS_TYPE= CONSTANT_STIFFNESS"
            )
        return body.frame.difference(at, shifted(solved.x))


def preconditioner(mesh: ElasticMesh, conditions: Conditions) -> Linear:
    """Return about the inverse of the matrix of a body, of unknowns (k d,) to (k d,)."""
    free = conditions.free
    axes = np.eye(free.shape[1])
    held = held_components(axes, free)
    cycle = LaplacianCycle.of(mesh, conditions.place, held, axes)

    def within(unknown: FloatArray) -> FloatArray:
        return np.einsum("kij,kj->ki", free, unknown)

    return lambda right: within(cycle(within(right.reshape(-1, len(axes))))).ravel()
