"""Conditions of the elastic body: projections, rotations and known displacements of its nodes."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from slideviz.argument_types import record
from slideviz.elastic.stiffness import Conditions, ShapeBlock, Stiffness
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.classify import RANK_TOLERANCE
from slideviz.rbf.constraint_rows import merge
from slideviz.rbf.frames import Frame
from slideviz.rbf.problem import Problem
from slideviz.rbf.tape import value


@record
class Body:
    """The mesh as an elastic body, the same over all steps."""

    parts: list[ShapeBlock]  # its elements
    frame: Frame  # the frame of the problem's displacements; the body is solved in Cartesian ones
    axis: np.ndarray  # (n,): nodes on the axis of a cylindrical frame, which move along it only
    stiffness: Stiffness = field(default_factory=Stiffness)  # of its elements


def conditions(problem: Problem, body: Body, nodes: IntArray, values: FloatArray) -> Conditions:
    """Return the conditions of the body when ``nodes`` (m,) are displaced by ``values`` (m, d).

    ``values`` are in the frame. Coinciding nodes and periodic images share one block of unknowns.
    Sliding nodes that are not among ``nodes`` do not move along their normals. Nodes of no cell
    have displacement zero. Raises DeformError if coinciding nodes are asked to move differently.
    """
    same = problem.same_as
    first, data = merge(problem, nodes, values)
    prescribed = np.zeros(value(problem.coords).shape)
    prescribed[first] = value(data)
    place, turn = unknowns(problem, body, first)
    known = np.where(np.isin(same, first)[:, None], prescribed[same], 0.0)
    free = np.tile(np.eye(value(problem.coords).shape[1]), (int(place.max(initial=-1)) + 1, 1, 1))
    blocks, own = projections(problem, body, held_rows(problem, body, place))
    free[blocks] = own
    return held(place, turn, free, _cartesian(problem, body.frame, known))


def unknowns(problem: Problem, body: Body, known: IntArray) -> tuple[IntArray, FloatArray]:
    """Return each node's block of unknowns (n,), -1 if it has none, and R_i (n, d, d).

    ``known`` (m,): nodes with known displacement; of coinciding ones, the one that represents them.
    """
    same = problem.same_as
    n, d = value(problem.coords).shape
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

    ``place``, ``turn`` (n,), (n, d, d): as ``unknowns`` returns them.
    ``free`` (k, d, d): P_k of each block of unknowns.
    ``known`` (n, d): g_i.
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
    moved = frame.points(value(problem.coords) + displacement) - frame.points(value(problem.coords))
    return np.where(np.any(displacement != 0, axis=1, keepdims=True), moved, 0.0)


def _turns(problem: Problem, frame: Frame, nodes: IntArray) -> FloatArray:
    """Return the rotations R_i (m, d, d) from the representatives' displacements to the nodes'."""
    periods = np.zeros(len(nodes))
    if frame.cylindrical and frame.period:
        angle = value(problem.coords)[:, 1]
        apart = angle[nodes] - angle[problem.same_as[nodes]]
        periods = np.round(apart / frame.shift()[1])
    return frame.turns(periods)


@record
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
    nodes = problem.normal_nodes
    across = np.zeros((0, value(problem.coords).shape[1]))
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


def projections(problem: Problem, body: Body, held: HeldRows) -> tuple[IntArray, FloatArray]:
    """Return the blocks (h,) that are not free in all directions, and their P_k (h, d, d)."""
    nodes = problem.normal_nodes
    own = cartesian_normals(body.frame, value(problem.coords)[nodes], value(problem.normals))
    normals = np.concatenate([own, held.axis])
    normals[held.images] = np.einsum("mij,mj->mi", held.back, normals[held.images])
    normals = normals[held.order]
    blocks, rows = np.unique(held.place, return_inverse=True)
    free = np.tile(np.eye(value(problem.coords).shape[1]), (len(blocks), 1, 1))
    # The first constraint of each block, then the second of each, and so on.
    for k in range(int(held.turn.max(initial=-1)) + 1):
        here = rows[held.turn == k]
        normal = normals[held.turn == k]
        left = np.einsum("mij,mj->mi", free[here], normal)
        length = np.linalg.norm(left, axis=1)
        # Normals that are nearly alike are one: those of the two sides of a periodic mesh.
        new = length > RANK_TOLERANCE
        unit = left[new] / length[new, None]
        free[here[new]] -= unit[:, :, None] * unit[:, None, :]
    return blocks, free


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
