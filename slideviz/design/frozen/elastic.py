"""The elastic body of a frozen step (`slideviz.baselines.elastic`), on a tape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from slideviz.baselines.elastic import (
    Body,
    cartesian_normals,
    held,
    held_rows,
    rigid_motions,
    unknowns,
)
from slideviz.baselines.elastic_forces import Forces
from slideviz.baselines.multigrid import Level, conjugate_gradients, hierarchy
from slideviz.baselines.stiffness import assemble
from slideviz.design.frozen.operations import difference_from, each_of, points
from slideviz.design.frozen.tape import (
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
from slideviz.errors import DeformError
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.classify import RANK_TOLERANCE
from slideviz.rbf.frames import Frame
from slideviz.rbf.problem import Problem
from slideviz.rbf.solve import enough_threads

EXACT = 1e-13
"""Residual ratio at which the solver ends: derivatives are to be exact."""

ENOUGH = 1e-8
"""Largest residual ratio that is accepted."""

Keep = Callable[[str, Callable[[], Any]], Any]
"""As ``slideviz.design.frozen.fit.Keep``."""


class Equilibrium:
    """The displacement of an elastic body, at given positions.

    Parameters
    ----------
    problem : Problem
        The step, with positions as they are.
    coords, normals : (n, d), (q, d)
        The same positions, and the problem's normals, on a tape.
    nodes : (m,) int64
        Nodes with known displacement, ascending; of coinciding nodes, the one that represents them.
    chosen : callable
        Keeps what is discrete, by name.
    name : str
        Begins these names, to tell two solutions of one step apart.
    """

    def __init__(
        self,
        problem: Problem,
        body: Body,
        coords: Array,
        normals: Array,
        nodes: IntArray,
        *,
        chosen: Keep,
        name: str,
    ) -> None:
        self._body, self._coords, self._same = body, coords, problem.same_as
        self._nodes, self._chosen, self._name = nodes, chosen, name
        self._place, self._turn = unknowns(problem, body, nodes)
        self._inside = np.flatnonzero(self._place >= 0)
        self._count = int(self._place.max(initial=-1)) + 1
        self._at = points(body.frame, coords)
        self._nothing = np.zeros_like(problem.coords)
        self._held = self._directions(problem, normals)
        self._forces = Forces.at(value(self._at), body.parts)
        self._levels = self._make()

    def displacement(self, data: Array) -> Array:
        """Return the displacement (..., n, d) in the frame, of all nodes.

        Parameters
        ----------
        data : (..., m, d)
            Displacement of the known nodes, in the frame.

        Raises
        ------
        DeformError
            The equations cannot be solved well enough.
        """
        known = self._known(data)
        right = -value(self._collected(self._force(known)))
        solve = partial(each_of, self._solved)
        found: Array = solve(right)
        if any(isinstance(x, Variable) for x in (self._coords, data)):
            left = self._collected(self._force(self._moved(value(found)) + known))
            found = solution(left, value(found), solve)
        return difference_from(self._body.frame, self._at, self._moved(found) + known)

    def _make(self) -> list[Level]:
        """Return the multigrid levels of the stiffness matrix."""
        at = value(self._at)
        axes = np.tile(np.eye(at.shape[1])[:, None], (self._count, 1))
        held_by = [(at, value(direction)) for at, direction in self._held]
        free = np.moveaxis(value(_without(axes, held_by)), 0, 1)
        given = held(self._place, self._turn, free, np.zeros_like(at))
        matrix = assemble(at, self._body.parts, given)[0]
        with enough_threads(0.0):  # the coarsest matrix is small
            return hierarchy(matrix, rigid_motions(at, given))

    def _solved(self, right: FloatArray) -> FloatArray:
        """Return the unknowns (k, d) for a right-hand side (k, d); DeformError above `ENOUGH`."""
        if not right.any():
            return np.zeros_like(right)
        start = np.zeros(right.size)
        with enough_threads(0.0):
            found = conjugate_gradients(self._levels, right.ravel(), start, tolerance=EXACT)
        if not found.residual_ratio <= ENOUGH:
            raise DeformError(
                f"the equations of linear elasticity were solved to {found.residual_ratio:.1g} "
                f"only, in {found.iterations} iterations, so that derivatives would not be exact; "
                "use more STEPS, or METHOD= rbf"
            )
        return found.x.reshape(right.shape)

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
        found = gather(transform(back, inside), self._place[self._inside], self._count)
        return _without(found, self._held)

    def _directions(self, problem: Problem, normals: Array) -> list[tuple[IntArray, Array]]:
        """Return pairs of blocks of unknowns (h,) and unit directions (h, d) that hold them.

        A block is in a pair once. Directions of a block are orthonormal. As ``_projections`` in
        `slideviz.baselines.elastic`, on a tape.
        """
        rows = held_rows(problem, self._body, self._place)
        cartesian = _cartesian(self._body.frame, take(self._coords, problem.normal_nodes), normals)
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
                before = take(join(direction, np.zeros((1, problem.coords.shape[1]))), row[at])
                left = left - multiply(before, dot(left, before))
            size = length(left)
            new = self._chosen(
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
    """Return what ``slideviz.baselines.elastic.cartesian_normals`` does, on a tape."""
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
