"""Linear elasticity: the mesh as an elastic body, as SU2 deforms it by default.

Small cells are stiff: Young's modulus is the inverse of the cell's volume. The displacement of
moving and fixed nodes is known, that of sliding nodes is zero along their normals, and periodic
images have equal displacements, turned where the mesh repeats by rotation; all other nodes are
free. Each step begins with the deformed mesh, without stresses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.baselines.multigrid import LinearSolution, solve
from slideviz.baselines.stiffness import Conditions, ShapeBlock, assemble
from slideviz.errors import DeformError
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.classify import RANK_TOLERANCE
from slideviz.rbf.constraint_rows import AGREE, merge
from slideviz.rbf.frames import Frame
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


@dataclass(frozen=True, eq=False)
class Body:
    """The mesh as an elastic body, the same over all steps."""

    parts: list[ShapeBlock]
    """Its elements."""
    frame: Frame
    """The frame of the problem's displacements; the body is solved in Cartesian ones."""
    axis: np.ndarray
    """(n,): nodes on the axis of a cylindrical frame, which move along it only."""


def conditions(problem: Problem, body: Body, nodes: IntArray, values: FloatArray) -> Conditions:
    """Return the conditions of the body when ``nodes`` (m,) are displaced by ``values`` (m, d).

    ``values`` are in the frame. Coinciding nodes and periodic images share one block of unknowns.
    Sliding nodes that are not among ``nodes`` do not move along their normals. Nodes of no cell
    have displacement zero.

    Raises
    ------
    DeformError
        Coinciding nodes are asked to move differently.
    """
    same = problem.same_as
    first, data = merge(problem, nodes, values)
    given = np.zeros(problem.coords.shape)
    given[first] = data
    place, turn = unknowns(problem, body, first)
    known = np.where(np.isin(same, first)[:, None], given[same], 0.0)
    free = _projections(problem, body, place, int(place.max(initial=-1)) + 1)
    return held(place, turn, free, _cartesian(problem, body.frame, known))


def unknowns(problem: Problem, body: Body, known: IntArray) -> tuple[IntArray, FloatArray]:
    """Return each node's block of unknowns (n,), -1 if it has none, and R_i (n, d, d).

    Parameters
    ----------
    known : (m,)
        Nodes with known displacement; of coinciding nodes, the one that represents them.
    """
    same = problem.same_as
    n, d = problem.coords.shape
    used = np.zeros(n, bool)
    for part in body.parts:
        used[part.nodes] = True
    open_nodes = np.flatnonzero(used & ~np.isin(same, known))
    place = np.full(n, -1, np.int64)
    place[open_nodes] = np.unique(same[open_nodes], return_inverse=True)[1]
    turn = np.tile(np.eye(d), (n, 1, 1))
    images = open_nodes[same[open_nodes] != open_nodes]
    turn[images] = _turns(problem, body.frame, images)
    return place, turn


def held(place: IntArray, turn: FloatArray, free: FloatArray, known: FloatArray) -> Conditions:
    """Return the conditions with the unknowns restricted by the projections ``free``.

    Parameters
    ----------
    place, turn : (n,), (n, d, d)
        As ``unknowns`` returns them.
    free : (k, d, d)
        P_k of each block of unknowns.
    known : (n, d)
        g_i.
    """
    inside = np.flatnonzero(place >= 0)
    turn = turn.copy()
    turn[inside] = turn[inside] @ free[place[inside]]
    plain = np.all(turn == np.eye(turn.shape[1]), axis=(1, 2))
    return Conditions(place, turn, plain, known, free)


def _cartesian(problem: Problem, frame: Frame, displacement: FloatArray) -> FloatArray:
    """Return Cartesian displacements (n, d) of displacements in the frame; zero rows stay zero."""
    if not frame.cylindrical:
        return displacement
    moved = frame.points(problem.coords + displacement) - frame.points(problem.coords)
    return np.where(np.any(displacement != 0, axis=1, keepdims=True), moved, 0.0)


def _turns(problem: Problem, frame: Frame, nodes: IntArray) -> FloatArray:
    """Return the rotations R_i (m, d, d) from the representatives' displacements to the nodes'."""
    d = problem.coords.shape[1]
    if not (frame.cylindrical and frame.period):
        return np.tile(np.eye(d), (len(nodes), 1, 1))
    apart = problem.coords[nodes, 1] - problem.coords[problem.same_as[nodes], 1]
    angle = np.round(apart / frame.shift()[1]) * frame.period
    turn = np.zeros((len(nodes), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0] = np.sin(angle)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    assert frame.axis is not None
    basis = axis_basis(frame.axis)
    return (basis.T @ turn @ basis)[:, :d, :d]


@dataclass(frozen=True, eq=False)
class HeldRows:
    """Directions in which unknowns may not move, as rows: normals of sliding nodes, then axis."""

    axis: FloatArray
    """(a, d): directions that hold nodes on the axis: rows after the problem's normals."""
    images: IntArray
    back: FloatArray
    """`images`, `back` (i,) int64, (i, d, d) float64: the rows of periodic images, and the
    rotations of their directions to the representative."""
    order: IntArray
    place: IntArray
    turn: IntArray
    """`order`, `place`, `turn` (r,): the rows that hold an unknown, sorted by its block; the block;
    and the number of the row among those of the block, from 0."""


def held_rows(problem: Problem, body: Body, place: IntArray) -> HeldRows:
    """Return the rows that hold blocks of unknowns; ``place`` (n,) is the block of each node."""
    nodes, across = problem.normal_nodes, np.zeros((0, problem.coords.shape[1]))
    on_axis = np.flatnonzero(body.axis)
    if len(on_axis):
        assert body.frame.axis is not None
        both = axis_basis(body.frame.axis)[:2, : across.shape[1]]
        nodes = np.concatenate([nodes, np.repeat(on_axis, 2)])
        across = np.tile(both, (len(on_axis), 1))
    images = np.flatnonzero(problem.same_as[nodes] != nodes)
    back = np.swapaxes(_turns(problem, body.frame, nodes[images]), 1, 2)
    rows = np.flatnonzero(place[nodes] >= 0)
    rows = rows[np.argsort(place[nodes[rows]], kind="stable")]
    at = place[nodes[rows]]
    return HeldRows(across, images, back, rows, at, np.arange(len(at)) - np.searchsorted(at, at))


def _projections(problem: Problem, body: Body, place: IntArray, count: int) -> FloatArray:
    """Return the projections P_k (count, d, d) on the directions in which unknowns may move."""
    nodes, held = problem.normal_nodes, held_rows(problem, body, place)
    own = cartesian_normals(body.frame, problem.coords[nodes], problem.normals)
    normals = np.concatenate([own, held.axis])
    normals[held.images] = np.einsum("mij,mj->mi", held.back, normals[held.images])
    normals = normals[held.order]
    free = np.tile(np.eye(problem.coords.shape[1]), (count, 1, 1))
    # The first constraint of each block, then the second of each, and so on.
    for k in range(int(held.turn.max(initial=-1)) + 1):
        here, normal = held.place[held.turn == k], normals[held.turn == k]
        left = np.einsum("mij,mj->mi", free[here], normal)
        length = np.linalg.norm(left, axis=1)
        # Normals that are nearly alike are one: those of the two sides of a periodic mesh.
        new = length > RANK_TOLERANCE
        unit = left[new] / length[new, None]
        free[here[new]] -= unit[:, :, None] * unit[:, None, :]
    return free


def cartesian_normals(frame: Frame, coords: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the unit directions (m, d) to which Cartesian displacements must be perpendicular.

    From normals (m, d) in the frame at ``coords`` (m, d). In a cylindrical frame displacements are
    (dr, rho dtheta[, dz]), and rho dtheta is rho / r times the distance along the circle.
    """
    if not frame.cylindrical:
        return np.array(normals)
    assert frame.axis is not None
    angle = coords[:, 1] / frame.radius + frame.theta0
    d = normals.shape[1]
    around = normals[:, 1] * frame.radius / np.maximum(coords[:, 0], 1e-9 * frame.radius)
    local = np.zeros((len(normals), 3))
    local[:, 0] = normals[:, 0] * np.cos(angle) - around * np.sin(angle)
    local[:, 1] = normals[:, 0] * np.sin(angle) + around * np.cos(angle)
    if d == 3:
        local[:, 2] = normals[:, 2]
    out = (local @ axis_basis(frame.axis))[:, :d]
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)


def rigid_motions(points: FloatArray, conditions: Conditions) -> FloatArray:
    """Return the rigid motions, projected on what the unknowns may do, (k d, 3) or (k d, 6).

    ``points`` (n, d) are those of all nodes.
    """
    place = conditions.place
    owner = np.zeros(len(conditions.free), np.int64)
    owner[place[place >= 0][::-1]] = np.flatnonzero(place >= 0)[::-1]
    d = points.shape[1]
    x = points[owner]
    x = (x - x.mean(axis=0)) / max(float(np.ptp(x)), 1e-300) if len(x) else x
    pairs = [(0, 1)] if d == 2 else [(0, 1), (1, 2), (2, 0)]
    modes = np.zeros((len(x), d, d + len(pairs)))
    modes[:, range(d), range(d)] = 1.0
    for column, (i, j) in enumerate(pairs, start=d):
        modes[:, i, column], modes[:, j, column] = -x[:, j], x[:, i]
    return (conditions.free @ modes).reshape(-1, modes.shape[2])
