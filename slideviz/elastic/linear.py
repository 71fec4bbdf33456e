"""Linear elasticity: the mesh as an elastic body, as SU2 deforms it.

Small cells, or those near walls, are stiff (`slideviz.elastic.stiffness`). The displacement of
moving and fixed nodes is known, that of sliding nodes is zero along their normals, and periodic
images have equal displacements, turned where the mesh repeats by rotation; all other nodes are
free. Each step begins with the deformed mesh, without stresses.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from slideviz.elastic.conditions import (
    Body,
    cartesian_normals,
    conditions,
    held,
    held_rows,
    rigid_motions,
    unknowns,
)
from slideviz.elastic.forces import Forces
from slideviz.elastic.multigrid import LIMIT, Level, conjugate_gradients, hierarchy, solve
from slideviz.elastic.stiffness import POISSON, ElasticMesh, Stiffness
from slideviz.errors import DeformError
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.classify import RANK_TOLERANCE
from slideviz.rbf.constraint_rows import AGREE, merge
from slideviz.rbf.frames import Frame
from slideviz.rbf.methods import within
from slideviz.rbf.operations import difference_from, each_of, points
from slideviz.rbf.problem import PhaseTimer, Problem, Solution
from slideviz.rbf.tape import (
    Array,
    Variable,
    dot,
    function,
    gather,
    inverse,
    join,
    length,
    multiply,
    put,
    recorded,
    solution,
    take,
    transform,
    unit,
    value,
)

EXACT = 1e-13  # error at which the solver ends: derivatives are to be exact

ENOUGH = 1e-8  # largest error that is accepted


class Equilibrium:
    """The displacement of an elastic body, at given positions.

    ``problem``: the step; its positions and normals may be variables of a tape.
    ``nodes`` (m,): nodes with known displacement, ascending; of coinciding nodes, the one that
    represents them.
    ``name``: begins the names of its choices, to tell two solutions of one step apart.
    """

    def __init__(self, problem: Problem, body: Body, nodes: IntArray, *, name: str) -> None:
        assert problem.frozen is not None
        if (body.stiffness.kind, body.stiffness.poisson) != (Stiffness().kind, POISSON):
            raise DeformError(
                "derivatives of METHOD= elastic are there for small cells alone; use "
                f"DEFORM_STIFFNESS_TYPE= {Stiffness().kind} and DEFORM_COEFF= {POISSON}, or "
                "METHOD= rbf"
            )
        self._body, self._coords, self._same = body, problem.coords, problem.same_as
        self._nodes, self._name = nodes, name
        self._place, self._turn = unknowns(problem, body, nodes)
        self._inside = np.flatnonzero(self._place >= 0)
        self._count = int(self._place.max(initial=-1)) + 1
        self._at = points(body.frame, problem.coords)
        self._nothing = np.zeros_like(value(problem.coords))
        self._held = self._directions(problem)
        self._forces = Forces.at(value(self._at), body.parts)
        self._levels = self._make()

    def displacement(self, data: Array) -> Array:
        """Return the displacement (..., n, d) in the frame, of all nodes.

        ``data`` (..., m, d) is that of the known nodes, in the frame. Raises DeformError if the
        equations cannot be solved well enough.
        """
        known = self._known(data)
        right = -value(self._collected(self._force(known)))
        inverse_times = partial(each_of, self._solved)
        solved: Array = inverse_times(right)
        if any(isinstance(x, Variable) for x in (self._coords, data)):
            left = self._collected(self._force(self._moved(value(solved)) + known))
            solved = solution(left, value(solved), inverse_times)
        return difference_from(self._body.frame, self._at, self._moved(solved) + known)

    def _make(self) -> list[Level]:
        """Return the multigrid levels of the stiffness matrix."""
        at = value(self._at)
        axes = np.tile(np.eye(at.shape[1])[:, None], (self._count, 1))
        held_by = [(at, value(direction)) for at, direction in self._held]
        free = np.moveaxis(value(_without(axes, held_by)), 0, 1)
        given = held(self._place, self._turn, free, np.zeros_like(at))
        matrix = ElasticMesh.at(at, self._body.parts, self._body.stiffness).matrix(given)
        return hierarchy(matrix, rigid_motions(at, given))

    def _solved(self, right: FloatArray) -> FloatArray:
        """Return the unknowns (k, d) for a right-hand side (k, d); DeformError above `ENOUGH`."""
        if not right.any():
            return np.zeros_like(right)
        solved = conjugate_gradients(
            self._levels[0].matrix, self._levels, right.ravel(), tolerance=EXACT
        )
        if not solved.error <= ENOUGH:
            raise DeformError(
                f"the equations of linear elasticity were solved to {solved.error:.1g} only, so "
                "that derivatives would not be exact; use more STEPS, or METHOD= rbf"
            )
        return solved.x.reshape(right.shape)

    def _known(self, data: Array) -> Array:
        """Return the Cartesian displacement (..., n, d) of known nodes; zero for other nodes."""
        frame, same = self._body.frame, self._same
        rows = np.flatnonzero(np.isin(same, self._nodes))
        base = take(self._coords, rows)
        by = take(data, np.searchsorted(self._nodes, same[rows]))
        moved = points(frame, base + by) - points(frame, base) if frame.cylindrical else by
        return put(self._nothing, rows, moved)

    def _force(self, moved: Array) -> Array:
        """Return the nodal forces (..., n, d) of a Cartesian displacement (..., n, d)."""
        forces, u = self._forces, value(moved)
        each = partial(each_of, forces.of)
        return recorded(
            each(u),
            (moved, each, each),
            (
                self._at,
                partial(each_of, lambda t: forces.pushed(u, t)),
                partial(each_of, lambda g: forces.pulled(u, g)),
            ),
        )

    def _moved(self, unknown: Array) -> Array:
        """Return the displacement (..., n, d) of unknowns (..., k, d); zero for known nodes."""
        free = take(_without(unknown, self._held), self._place[self._inside])
        turned = transform(self._turn[self._inside], free)
        return put(self._nothing, self._inside, turned)

    def _collected(self, forces: Array) -> Array:
        """Return the forces (..., k, d) on the unknowns, of nodal forces (..., n, d)."""
        inside = take(forces, self._inside)
        back = np.swapaxes(self._turn[self._inside], 1, 2)
        displacement = gather(transform(back, inside), self._place[self._inside], self._count)
        return _without(displacement, self._held)

    def _directions(self, problem: Problem) -> list[tuple[IntArray, Array]]:
        """Return pairs of blocks of unknowns (h,) and unit directions (h, d) that hold them.

        A block is in a pair once. Directions of a block are orthonormal (`conditions`).
        """
        rows = held_rows(problem, self._body, self._place)
        cartesian = _cartesian(
            self._body.frame, take(self._coords, problem.normal_nodes), problem.normals
        )
        full = join(cartesian, rows.axis) if len(rows.axis) else cartesian
        if len(rows.images):
            full = put(full, rows.images, transform(rows.back, take(full, rows.images)))
        out: list[tuple[IntArray, Array]] = []
        for k in range(int(rows.turn.max(initial=-1)) + 1):
            here = np.flatnonzero(rows.turn == k)
            at = rows.place[here]
            left = take(full, rows.order[here])
            for others, direction in out:
                row = np.full(self._count, len(others))
                row[others] = np.arange(len(others))
                before = take(
                    join(direction, np.zeros((1, value(problem.coords).shape[1]))), row[at]
                )
                left = left - multiply(before, dot(left, before))
            size = length(left)
            new = problem.choose(
                f"{self._name} held {k}", partial(_longer, value(size), RANK_TOLERANCE)
            )
            out.append((at[new], unit(take(left, new))))
        return out


def _without(vectors: Array, directions: Sequence[tuple[IntArray, Array]]) -> Array:
    """Return vectors (..., k, d) of unknowns without their part along the held directions."""
    for at, direction in directions:
        along = multiply(direction, dot(take(vectors, at), direction))
        vectors = vectors - gather(along, at, value(vectors).shape[-2])
    return vectors


def _longer(size: FloatArray, least: float) -> IntArray:
    """Return the indices where ``size`` (m, 1) is above ``least``."""
    return np.flatnonzero(size[:, 0] > least)


def _cartesian(frame: Frame, coords: Array, normals: Array) -> Array:
    """Return what ``slideviz.elastic.linear.cartesian_normals`` does, on a tape."""
    if not any(isinstance(x, Variable) for x in (coords, normals)):
        return cartesian_normals(frame, value(coords), value(normals))
    if not frame.cylindrical:
        return normals
    assert frame.axis is not None
    d = value(normals).shape[1]
    basis = axis_basis(frame.axis)[:, :d]

    def column(x: Array, k: int) -> Array:
        return transform(np.eye(d)[k : k + 1], x)

    angle = value(column(coords, 1)) / frame.radius + frame.theta0
    turn = column(coords, 1)
    slope = 1.0 / frame.radius
    cos = function(turn, np.cos(angle), -slope * np.sin(angle))
    sin = function(turn, np.sin(angle), slope * np.cos(angle))
    r, least = column(coords, 0), 1e-9 * frame.radius
    far = value(r) > least
    per = inverse(function(r, np.maximum(value(r), least), far.astype(float)))
    across, around = column(normals, 0), multiply(column(normals, 1) * frame.radius, per)
    parts = [
        multiply(across, cos) - multiply(around, sin),
        multiply(across, sin) + multiply(around, cos),
        *([column(normals, 2)] if d == 3 else []),
    ]
    total: Array = np.zeros(value(normals).shape)
    for part, row in zip(parts, basis, strict=False):
        total = total + transform(row[:, None], part)
    return unit(total)


ASSEMBLING = 0.2  # the part of the phase solve that the matrix takes


def deform_elastic(problem: Problem, timer: PhaseTimer, body: Body) -> Solution:
    """Return the solution of one step as an elastic body.

    Sliding nodes move in the tangent planes of their boundary. Where a boundary is curved, or a
    node slid past its end, sliding nodes are then projected on it, and a second solution has them
    as known nodes. Raises DeformError if a cell has no volume, the solver does not converge, or
    coinciding nodes are asked to move differently.
    """
    nodes, values = problem.known, problem.values
    displacement = _equilibrium(problem, timer, body, nodes, values)
    sliding = np.concatenate([problem.edge, problem.surface])
    if len(sliding):
        free = within(problem, sliding, take(displacement, sliding))
        with timer.phase("project"):
            slid: Array = problem.project(sliding, free)
        nodes, values = np.concatenate([nodes, sliding]), join(values, slid)
        gap = np.abs(value(slid) - value(free)).max()
        if problem.choose("again", lambda: gap > AGREE * problem.basis.radius):
            displacement = _equilibrium(problem, timer, body, nodes, values, displacement)
    return Solution(
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

    In a frozen step it is solved to rounding, for derivatives are to be exact (`Equilibrium`).
    Raises DeformError if the solver's error is above `LIMIT` of the largest displacement.
    ``nodes``, ``values`` (m,), (..., m, d): nodes with known displacement, in the frame.
    ``start`` (n, d): a guess of the displacement, in the frame.
    """
    if problem.frozen is not None:
        merged, data = merge(problem, nodes, values)
        name = "free" if start is None else "slid"
        equilibrium: Equilibrium = problem.frozen.fixed(
            f"{name} body", lambda: Equilibrium(problem, body, merged, name=name)
        )
        return equilibrium.displacement(data)
    coords = value(problem.coords)
    with timer.phase("solve") as tick:
        at = body.frame.points(coords)
        prescribed = conditions(problem, body, nodes, value(values))
        mesh = ElasticMesh.at(at, body.parts, body.stiffness)
        matrix = mesh.matrix(prescribed, lambda f: tick(ASSEMBLING * f))
        inside = np.flatnonzero(prescribed.place >= 0)
        place, turn = prescribed.place[inside], prescribed.turn[inside]
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
            lambda: matrix if mesh.lame[1] >= 0.0 else mesh.definite().matrix(prescribed),
            residual,
            rigid_motions(at, prescribed),
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
