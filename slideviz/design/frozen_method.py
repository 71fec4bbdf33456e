"""The method of a frozen step: interpolation, sliding, distance weighting, or elasticity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from dataclasses import field as made_by
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.baselines.conditions import Body
from slideviz.baselines.idw import Weights
from slideviz.deformation.stepping import problem_at
from slideviz.design.frozen_elastic import Equilibrium
from slideviz.design.frozen_fit import FrozenFit, Rows
from slideviz.design.frozen_spread import Spread, chosen_spread, shares
from slideviz.design.loops import take_over
from slideviz.design.normals import sliding_normals
from slideviz.design.operations import columns, features, weighted_mean
from slideviz.design.tape import (
    Array,
    Variable,
    dot,
    gather,
    inverse,
    join,
    length,
    mixed,
    multiply,
    put,
    reshape,
    take,
    transform,
    value,
)
from slideviz.mesh.model import FloatArray, IntArray, largest_coordinate
from slideviz.rbf.constraint_rows import AGREE, INDEPENDENT, refuse
from slideviz.rbf.methods import LOST
from slideviz.rbf.methods import ROUNDING as FLAT
from slideviz.rbf.primitives import primitives

if TYPE_CHECKING:
    from slideviz.design.frozen_step import FrozenStep, State

CHECKED = 1e11
"""From this condition number on, solutions of further designs are checked as those of a run. Data
reduction makes more of a difference than rounding."""

ROUNDING = 1e-14
"""Part of the largest coordinate below which a distance is rounding."""


def _anew(_: str, make: Callable[[], Any]) -> Any:
    return make()


@dataclass(frozen=True, eq=False)
class _Solved:
    displacement: Array
    lag: Array | None
    of: IntArray
    max_error: FloatArray
    lost: FloatArray
    doubt: FloatArray = made_by(default_factory=lambda: np.zeros(()))


class Method:
    """The method on one step, run once."""

    def __init__(
        self, step: FrozenStep, before: State, goal: Array, room: FloatArray | None
    ) -> None:
        self._step, self._setup, self._before = step, step.setup, before
        self._room = room
        setup, keep = step.setup, step.constants if step.first else _anew
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

    def run(self) -> _Solved:
        """Return what the method finds."""
        if self._step.weights is not None:
            return self._weighted(self._step.weights)
        if self._step.body is not None:
            return self._elastic(self._step.body)
        if self._step.sliding == "ps":
            return self._pseudo()
        if self._step.sliding == "ds" and len(self._normal_nodes):
            return self._direct()
        fit = self._fit()
        self._meet(fit, self._known, self._values)
        return self._finished(fit, self._known, self._values)

    def _pseudo(self) -> _Solved:
        """Edges slide first, then surfaces (`slideviz.rbf.methods.pseudo_sliding`)."""
        setup, fit = self._setup, self._fit()
        self._meet(fit, self._known, self._values)
        nodes, values = self._known, self._values
        for name, level in (("edge", self._edge), ("surface", self._surface)):
            if not len(level):
                continue
            free = self._less_behind(fit.at(level), level)
            if setup.tracks.curved:
                free = self._within(level, free)
            slid = self._project(level, free, name)
            new = np.flatnonzero(~np.isin(setup.same_as[level], setup.same_as[nodes]))
            nodes, values = np.concatenate([nodes, level]), join(values, slid)
            self._merged(nodes, values)
            self._meet(fit, level[new], take(slid, new))
        return self._finished(fit, nodes, values)

    def _direct(self) -> _Solved:
        """Sliding by the system itself (`slideviz.rbf.methods.direct_sliding`)."""
        setup, fit = self._setup, self._fit()
        fit.add(self._sliding_rows(), self._stages.pop(0), "first")
        doubt = fit.doubt
        sliding = np.concatenate([self._edge, self._surface])
        nodes = np.concatenate([self._known, sliding])
        free = self._less_behind(fit.at(sliding), sliding)
        if not setup.tracks.curved:
            free = self._within(sliding, free)
        slid = self._project(sliding, free, "slid")
        if not self._stages:
            off = self._step.choices("off", lambda: self._off(value(slid), value(free)))
            slid = put(free, off, take(slid, off)) if len(off) else free
            return self._finished(fit, nodes, join(self._values, slid))
        values = join(self._values, slid)
        second = self._fit()
        second.doubt = doubt
        self._meet(second, nodes, values)
        return self._finished(second, nodes, values)

    def _weighted(self, weights: Weights) -> _Solved:
        """Inverse distance weighting (`slideviz.baselines.idw.deform_idw`)."""
        setup, nodes, values = self._setup, self._known, self._values

        def mean(name: str, targets: IntArray | slice) -> Array:
            merged, given = self._merged(nodes, values)
            own = self._step.choices(f"weights {name}", lambda: weights.of(value(given)))
            x = self._features
            at = x if isinstance(targets, slice) else columns(x, targets)
            return weighted_mean(setup.basis, at, columns(x, merged), given, own, weights.power)

        for name, level in (("edge", self._edge), ("surface", self._surface)):
            if len(level):
                free = mean(name, level)
                if setup.tracks.curved:
                    free = self._within(level, free)
                slid = self._project(level, free, name)
                nodes, values = np.concatenate([nodes, level]), join(values, slid)
        displacement = self._in_room(mean("all", slice(None)))
        errors = np.linalg.norm(value(values) - value(displacement)[..., nodes, :], axis=-1)
        displacement = put(displacement, nodes, values, own=True)
        most = errors.max(axis=-1, initial=0.0)
        return _Solved(displacement, None, nodes, most, np.zeros(most.shape))

    def _elastic(self, body: Body) -> _Solved:
        """Return that of an elastic body (`slideviz.baselines.elastic.deform_elastic`)."""
        setup, nodes, values = self._setup, self._known, self._values
        displacement = self._balanced(body, "free", nodes, values)
        sliding = np.concatenate([self._edge, self._surface])
        if len(sliding):
            free = self._within(sliding, take(displacement, sliding))
            slid = self._project(sliding, free, "slid")
            nodes, values = np.concatenate([nodes, sliding]), join(values, slid)
            gap = np.abs(value(slid) - value(free)).max()
            if self._step.choices("again", lambda: gap > AGREE * setup.basis.radius):
                displacement = self._balanced(body, "slid", nodes, values)
        displacement = put(self._in_room(displacement), nodes, values, own=True)
        nothing = np.zeros(value(displacement).shape[:-2])
        return _Solved(displacement, None, nodes, nothing, nothing)

    def _balanced(self, body: Body, name: str, nodes: IntArray, values: Array) -> Array:
        """Return the displacement of an elastic body by that of some nodes."""
        coords = value(self._coords)
        merged, data = self._merged(nodes, values)
        body_at = self._keep(
            f"{name} body",
            lambda: Equilibrium(
                problem_at(self._setup, coords, coords[self._setup.known]),
                body,
                self._coords,
                self._normals,
                merged,
                chosen=self._step.choices,
                name=name,
            ),
        )
        return body_at.displacement(data)

    def _off(self, slid: FloatArray, free: FloatArray) -> IntArray:
        """Return which slid nodes leave a straight edge of a curved surface."""
        gap = np.abs(slid - free).max(axis=1, initial=0.0)
        return np.flatnonzero(gap > FLAT * largest_coordinate(value(self._coords)))

    def _fit(self) -> FrozenFit:
        setup = self._setup
        return FrozenFit(
            setup.basis,
            self._features,
            setup.coords.shape[1],
            chosen=self._step.choices,
            fixed=self._keep,
            refined=self._step.refined > 0.0,
            checked=setup.reduction is None and self._step.condition > CHECKED,
        )

    def _meet(self, fit: FrozenFit, nodes: IntArray, values: Array) -> None:
        """Give a fit the rows of nodes with known displacement."""
        merged, data = self._merged(nodes, self._plus_behind(values, nodes))
        stage = f"stage {len(self._stages)}"
        fit.add(Rows(merged, None, data), self._stages.pop(0), stage)

    def _merged(self, nodes: IntArray, values: Array) -> tuple[IntArray, Array]:
        """Return nodes (m,) and values (m, d), those of coinciding nodes as their mean."""
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

    def _behind(self, nodes: IntArray) -> Array | None:
        if self._before.lag is None:
            return None
        row = np.full(len(self._setup.coords), -1)
        row[self._before.of] = np.arange(len(self._before.of))
        return take(self._before.lag, row[nodes])

    def _plus_behind(self, values: Array, nodes: IntArray) -> Array:
        behind = self._behind(nodes)
        return values if behind is None else values + behind

    def _less_behind(self, values: Array, nodes: IntArray) -> Array:
        behind = self._behind(nodes)
        return values if behind is None else values - behind

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
        """Return the displacements of nodes brought back on their boundary."""
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
        """Return for each node a point of its primitive (m, d), and the projection on it."""
        tracks = self._setup.tracks
        label, at = tracks.of_node[nodes], base + free
        anchor, matrix = base.copy(), np.zeros((*base.shape, base.shape[1]))
        for index in np.unique(label[label >= 0]).tolist():
            rows = np.flatnonzero(label == index)
            found, which = tracks.tracks[index].nearest(at[rows])
            anchor[rows] = found
            matrix[rows] = primitives(tracks.tracks[index].simplices(which), at[rows], found)
        return anchor, matrix

    def _ties(self, nodes: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return copies within the domain, whom they follow, and how their vectors are turned."""
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

    def _sliding_rows(self) -> Rows:
        """Return the rows of direct sliding (`slideviz.rbf.constraint_rows.sliding_rows`)."""
        known, same = self._known, self._setup.same_as
        d = self._setup.coords.shape[1]
        nodes = np.concatenate([np.repeat(known, d), self._normal_nodes])
        normals = join(np.tile(np.eye(d), (len(known), 1)), self._normals)
        values = reshape(self._plus_behind(self._values, known), len(known) * d, 1)
        behind = self._behind(self._normal_nodes)
        across: Array = np.zeros((len(self._normal_nodes), 1))
        if behind is not None:
            across = dot(behind, self._normals)
        right = join(values, across)
        order = np.argsort(same[nodes], kind="stable")
        nodes, normals, right = nodes[order], take(normals, order), take(right, order)
        stands = same[nodes]
        starts = np.flatnonzero(np.r_[True, stands[1:] != stands[:-1]])
        count = np.diff(np.r_[starts, len(nodes)])
        mixed = np.maximum.reduceat(nodes, starts) != np.minimum.reduceat(nodes, starts)
        keep = np.ones(len(nodes), bool)
        for size in np.unique(count[mixed]).tolist():
            rows = starts[mixed & (count == size), None] + np.arange(size)
            normals, right = self._orthonormal(nodes, normals, right, rows, keep)
        kept = np.flatnonzero(keep)
        return Rows(stands[kept], take(normals, kept), take(right, kept))

    def _orthonormal(
        self, nodes: IntArray, normals: Array, right: Array, rows: IntArray, keep: np.ndarray
    ) -> tuple[Array, Array]:
        """Orthonormalise the constraints of coinciding nodes, and mark those to leave out."""
        for k, row in enumerate(rows.T):
            n, b = take(normals, row), take(right, row)
            for other in rows.T[:k]:
                along = multiply(dot(n, take(normals, other)), keep[other, None].astype(float))
                n = n - multiply(take(normals, other), along)
                b = b - multiply(along, take(right, other))
            size = length(n)
            new = self._step.choices(
                f"independent {rows.shape[1]} {k}",
                partial(_above, value(size), INDEPENDENT),
            )
            wrong = ~new & (np.abs(value(b)[..., 0]) > AGREE * self._setup.basis.radius)
            if wrong.any():
                at = rows[int(np.argwhere(wrong)[0][-1])]
                refuse(int(nodes[at[k]]), int(nodes[at[0]]), float(np.abs(value(b)).max()))
            mask = new[:, None].astype(float)
            scale = inverse(multiply(size, mask) + (1.0 - mask))
            keep[row] = new
            normals = put(normals, row, multiply(n, scale))
            right = put(right, row, multiply(b, scale))
        return normals, right

    def _finished(self, fit: FrozenFit, nodes: IntArray, values: Array) -> _Solved:
        """Evaluate at all nodes; boundary nodes are set, and what they lack is spread."""
        setup = self._setup
        displacement = self._in_room(fit.at(slice(None), room=self._room))
        errors = values - take(displacement, nodes)
        total = self._plus_behind(errors, nodes)
        lag = total if setup.reduction is not None else None
        size = np.linalg.norm(value(total), axis=-1)
        lost = np.zeros(size.shape[:-1])
        if setup.reduction is None:
            inside = ~np.isin(setup.same_as[nodes], self._step.dropped)
            gap = np.linalg.norm(value(errors), axis=-1)
            lost = np.where(inside, gap, 0.0).max(axis=-1, initial=0.0)

        def choose() -> Spread | None:
            most = float(np.linalg.norm(value(values), axis=-1).max(initial=0.0))
            needed = float(np.max(lost)) > LOST * most or len(self._step.dropped) > 0
            return chosen_spread(setup, value(self._coords), nodes, value(errors), needed=needed)

        spread = self._step.choices("correction", choose)
        if spread is not None:
            displacement = self._spread(displacement, spread, errors)
        displacement = put(displacement, nodes, values, own=True)
        most = size.max(axis=-1, initial=0.0)
        return _Solved(displacement, lag, nodes, most, lost, doubt=fit.doubt)

    def _in_room(self, displacement: Array) -> Array:
        """Return the displacement where it is to go."""
        if self._room is None or displacement is self._room:
            return displacement
        self._room[:] = value(displacement)
        return self._room

    def _spread(self, displacement: Array, spread: Spread, errors: Array) -> Array:
        """Add what targets take over."""
        setup = self._setup
        means = spread.mixing(value(errors).shape[-2])
        part = self._keep("shares", lambda: shares(setup, self._coords, spread))
        if displacement is self._room and not isinstance(part, Variable):
            take_over(self._room, spread.targets, means, part[:, 0], value(errors))
            return displacement
        taken = mixed(means, errors)
        taken = multiply(taken, part)
        more = take(displacement, spread.targets) + taken
        return put(displacement, spread.targets, more, own=True)


def _above(size: FloatArray, least: float) -> np.ndarray:
    return np.asarray(size[:, 0] > least)


def _plus_unless_rounding(slid: Array, away: Array, least: float) -> Array:
    """Return the sum; what is rounding is not added, so that nodes at rest keep every bit."""
    off = value(away)
    off = np.where(np.abs(off).max(axis=-1, keepdims=True) <= least, 0.0, off)
    return slid + (replace(away, value=off) if isinstance(away, Variable) else off)
