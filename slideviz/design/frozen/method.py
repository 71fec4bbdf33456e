"""Base of the methods of a frozen step: known nodes, and the projection of sliding nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from dataclasses import field as made_by
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.design.frozen.normals import sliding_normals
from slideviz.design.frozen.operations import features
from slideviz.design.frozen.tape import (
    Array,
    Variable,
    dot,
    gather,
    multiply,
    put,
    take,
    transform,
    value,
)
from slideviz.mesh.model import FloatArray, IntArray, largest_coordinate
from slideviz.rbf.constraint_rows import AGREE, refuse
from slideviz.rbf.projection import projection_matrices

if TYPE_CHECKING:
    from slideviz.design.frozen.step import FrozenStep, StepState

ROUNDING = 1e-14
"""Part of the largest coordinate below which a distance is rounding."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The result of a method in one step."""

    displacement: Array
    """(..., n, d): of all nodes, in the frame."""
    carried: Array | None
    """(..., b, d) or None: the errors that the interpolants of all steps so far left at the
    boundary nodes ``of`` (b,); None without data reduction."""
    of: IntArray
    max_error: FloatArray
    lost: FloatArray
    error_estimate: FloatArray = made_by(default_factory=lambda: np.zeros(()))
    """`max_error`, `lost`, `error_estimate` (...,): as of a ``Solution``."""


class Method(ABC):
    """A method on one step, from one state; run once.

    ``goal`` (..., a, d) are the coordinates of the known nodes after the step, ``out``
    (..., n, d) or None is where the displacement of all nodes may be written.
    """

    def __init__(
        self, step: FrozenStep, before: StepState, goal: Array, out: FloatArray | None
    ) -> None:
        self._step, self._setup, self._before = step, step.setup, before
        self._out = out
        setup, keep = step.setup, step.constants if step.first else _uncached
        self._keep, self._coords = keep, before.coords
        self._features = keep("features", lambda: features(setup.frame, before.coords))
        nodes, self._normals = keep("normals", lambda: sliding_normals(setup, before.coords))
        self._normal_nodes = nodes
        once = np.flatnonzero(setup.once(setup.known))
        self._known = setup.known[once]
        self._values = take(goal, once) - take(before.coords, self._known)
        self._edge = setup.classes.edge[setup.once(setup.classes.edge)]
        self._surface = setup.classes.surface[setup.once(setup.classes.surface)]
        self._stages = list(step.stages)

    @abstractmethod
    def run(self) -> Solved:
        """Return the result of the step."""

    def _merged(self, nodes: IntArray, values: Array) -> tuple[IntArray, Array]:
        """Return one node (c,) for each group of coinciding nodes, and the mean of its values.

        As ``slideviz.rbf.constraint_rows.merge``; raises DeformError where the values differ.
        """
        same = self._setup.same_as[nodes]
        merged, first, group, count = np.unique(
            same, return_index=True, return_inverse=True, return_counts=True
        )
        if len(merged) == len(nodes):
            return merged, take(values, first)
        given = value(values)
        gap = np.abs(given - given[..., first[group], :]).max(axis=-1)
        if gap.max(initial=0.0) > AGREE * self._setup.basis.radius:
            row = int(np.unravel_index(int(np.argmax(gap)), gap.shape)[-1])
            refuse(int(nodes[row]), int(nodes[first[group[row]]]), float(gap.max()))
        return merged, multiply(gather(values, group, len(merged)), 1.0 / count[:, None])

    def _carried_error(self, nodes: IntArray) -> Array | None:
        """Return the errors that all steps before left at boundary nodes (m,); None without."""
        if self._before.carried is None:
            return None
        row = np.full(len(self._setup.coords), -1)
        row[self._before.of] = np.arange(len(self._before.of))
        return take(self._before.carried, row[nodes])

    def _with_carried(self, values: Array, nodes: IntArray) -> Array:
        """Return ``values`` plus the errors that all steps before left at nodes."""
        carried_error = self._carried_error(nodes)
        return values if carried_error is None else values + carried_error

    def _less_carried(self, values: Array, nodes: IntArray) -> Array:
        """Return ``values`` less the errors that all steps before left at nodes."""
        carried_error = self._carried_error(nodes)
        return values if carried_error is None else values - carried_error

    def _within(self, nodes: IntArray, free: Array) -> Array:
        """Return displacements of sliding nodes without their part along the normals."""
        row = np.full(len(self._setup.coords), -1)
        row[nodes] = np.arange(len(nodes))
        at = row[self._normal_nodes]
        use = np.flatnonzero(at >= 0)
        normals, at = take(self._normals, use), at[use]
        off = dot(take(free, at), normals)
        return free - gather(multiply(normals, off), at, len(nodes))

    def _project(self, nodes: IntArray, free: Array, name: str) -> Array:
        """Return the displacements (..., m, d) of sliding nodes projected on their boundary.

        On the plane of the facet, the line of the edge or the vertex that is closest at the
        reference. ``name`` is that of the kept choice.
        """
        setup, base = self._setup, take(self._coords, nodes)
        keep = self._step.choices
        anchor, matrix = keep(
            f"project {name}", partial(self._tracked, nodes, value(base), value(free))
        )
        away = transform(matrix - np.eye(matrix.shape[-1]), base - anchor)
        slid = _plus_unless_rounding(
            transform(matrix, free), away, ROUNDING * largest_coordinate(setup.coords)
        )
        copy, origin, turn = keep(f"ties {name}", lambda: self._ties(nodes))
        if len(copy):
            slid = put(slid, copy, transform(turn, take(slid, origin)))
        held = np.ones((len(nodes), matrix.shape[-1]))
        held[setup.axis[nodes], :2] = 0.0
        held[np.isin(nodes, setup.held)] = 0.0
        return slid if held.all() else multiply(slid, held)

    def _tracked(
        self, nodes: IntArray, base: FloatArray, free: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the closest point of each displaced node (m, d), and the projection (m, d, d).

        See `slideviz.rbf.projection.projection_matrices`.
        """
        tracks = self._setup.tracks
        label, at = tracks.of_node[nodes], base + free
        anchor, matrix = base.copy(), np.zeros((*base.shape, base.shape[1]))
        for index in np.unique(label[label >= 0]).tolist():
            rows = np.flatnonzero(label == index)
            found, which = tracks.tracks[index].nearest(at[rows])
            anchor[rows] = found
            matrix[rows] = projection_matrices(
                tracks.tracks[index].simplices(which), at[rows], found
            )
        return anchor, matrix

    def _ties(self, nodes: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return copies among ``nodes``, the nodes that they follow, both as places, and rotations.

        Rotations (t, d, d) turn displacements of the latter into those of the copies, in the frame.
        """
        setup, halo, d = self._setup, self._setup.halo, self._setup.coords.shape[1]
        if halo is None:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, d, d))
        row = np.full(len(setup.coords), -1)
        row[nodes] = np.arange(len(nodes))
        copy, origin = row[halo.receivers], row[halo.donors]
        both = (copy >= 0) & (origin >= 0)
        turn = halo.rotations[both]
        if setup.frame.cylindrical:
            turn = np.broadcast_to(np.eye(d), turn.shape)
        return copy[both], origin[both], turn

    def _into_out(self, displacement: Array) -> Array:
        """Return the displacement, copied to the method's ``out`` if it has one."""
        if self._out is None or displacement is self._out:
            return displacement
        self._out[:] = value(displacement)
        return self._out


def _uncached(_: str, make: Callable[[], Any]) -> Any:
    """Make something each time: a ``Keep`` that keeps nothing."""
    return make()


def _plus_unless_rounding(slid: Array, away: Array, least: float) -> Array:
    """Return ``slid + away``, without rows of ``away`` up to ``least``: rest keeps every bit."""
    off = value(away)
    off = np.where(np.abs(off).max(axis=-1, keepdims=True) <= least, 0.0, off)
    return slid + (replace(away, value=off) if isinstance(away, Variable) else off)
