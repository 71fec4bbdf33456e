"""Inverse distance weighting and linear elasticity on a frozen step."""

from __future__ import annotations

import numpy as np

from slideviz.baselines.elastic import Body
from slideviz.design.frozen.elastic import Equilibrium
from slideviz.design.frozen.method import Method, Solved
from slideviz.design.frozen.operations import columns, weighted_mean
from slideviz.design.frozen.tape import Array, join, put, take, value
from slideviz.mesh.model import IntArray
from slideviz.rbf.constraint_rows import AGREE
from slideviz.solver.stepping import problem_at


class Weighting(Method):
    """Inverse distance weighting (`slideviz.baselines.idw.deform_idw`)."""

    def run(self) -> Solved:
        """Return the displacement as weighted means, and its errors."""
        weights = self._step.weights
        assert weights is not None
        setup, nodes, values = self._setup, self._known, self._values

        def mean(name: str, targets: IntArray | slice) -> Array:
            merged, given = self._merged(nodes, values)
            source_weights = self._step.choices(f"weights {name}", lambda: weights.of(value(given)))
            x = self._features
            at = x if isinstance(targets, slice) else columns(x, targets)
            return weighted_mean(
                setup.basis, at, columns(x, merged), given, source_weights, weights.power
            )

        for name, level in (("edge", self._edge), ("surface", self._surface)):
            if len(level):
                free = mean(name, level)
                if setup.tracks.curved:
                    free = self._within(level, free)
                slid = self._project(level, free, name)
                nodes, values = np.concatenate([nodes, level]), join(values, slid)
        displacement = self._into_out(mean("all", slice(None)))
        errors = np.linalg.norm(value(values) - value(displacement)[..., nodes, :], axis=-1)
        displacement = put(displacement, nodes, values, overwrite=True)
        most = errors.max(axis=-1, initial=0.0)
        return Solved(displacement, None, nodes, most, np.zeros(most.shape))


class Elasticity(Method):
    """An elastic body (`slideviz.baselines.elastic.deform_elastic`)."""

    def run(self) -> Solved:
        """Return the displacement in equilibrium."""
        body = self._step.body
        assert body is not None
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
        displacement = put(self._into_out(displacement), nodes, values, overwrite=True)
        nothing = np.zeros(value(displacement).shape[:-2])
        return Solved(displacement, None, nodes, nothing, nothing)

    def _balanced(self, body: Body, name: str, nodes: IntArray, values: Array) -> Array:
        """Return the displacement of all nodes (n, d), from ``values`` (m, d) at ``nodes`` (m,).

        ``name`` tells the first solution of the step from the second.
        """
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
