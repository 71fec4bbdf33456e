"""Checks of each design: whether its result can be right, and its largest error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from slideviz.case.motion import ROUNDING
from slideviz.design.accuracy_warnings import largest_condition
from slideviz.design.frozen.step import FrozenStep, StepState
from slideviz.errors import DeformError, UnsoundError
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.rbf.images import FAR, largest_misfit, misfits
from slideviz.rbf.loops import farthest
from slideviz.rbf.operations import flat
from slideviz.rbf.problem import Solution
from slideviz.rbf.tape import value
from slideviz.solver.growth import GROWTH, HOPELESS, unsoundness
from slideviz.solver.setup import AUTO_TOLERANCE, Setup


@dataclass(frozen=True, eq=False)
class Checks:
    """The checks of a design."""

    mesh: Mesh
    setup: Setup
    steps: tuple[FrozenStep, ...]
    facets: Mapping[int, IntArray]
    """dict of int to (s,) int64: for each track, by its index, the simplex that each of its sliding
    nodes is on at the reference."""
    least: float
    """A motion that nodes may make in any design, in the frame: the reference's, or an edge of the
    moving boundary."""

    def errors(self, targets: FloatArray, states: list[StepState]) -> FloatArray:
        """Return the largest error of each design, (...,), in the mesh's length unit.

        Parameters
        ----------
        targets : (..., a, d)
            Displacements of the known nodes, in the frame.
        states
            After each step.

        Raises
        ------
        DeformError
            Coordinates are infinite, nodes move much farther than the boundary, or periodic images
            moved differently.
        """
        errors = self.off_track(value(states[-1].coords))
        for index, (step, state) in enumerate(zip(self.steps, states, strict=True), start=1):
            self.require_sound(index, step.part, targets, state)
            self.require_alike(value(state.points))
            errors = np.maximum(errors, state.max_error)
        return errors

    def require_sound(self, index: int, part: float, targets: FloatArray, state: StepState) -> None:
        """Raise DeformError where the results of a step cannot be right, as in every run.

        Nodes may always move as far as at the reference, or by an edge of the moving boundary: so
        a finite difference, which moves one node by next to nothing, is not refused.

        Parameters
        ----------
        index
            Number of the step, from 1, for the message.
        part
            Part of the whole displacement after the step.
        """
        shape = self.mesh.points.shape
        coords = value(state.coords).reshape(-1, *shape)
        targets = targets.reshape(len(coords), *targets.shape[-2:])
        lost = np.broadcast_to(state.lost.reshape(-1), len(coords))
        far = farthest(coords, self.setup.coords)
        for k, target in enumerate(targets):
            if not np.isfinite(far[k]):
                raise DeformError(f"step {index}: coordinates became infinite; use more steps")
            largest = part * float(np.linalg.norm(target, axis=1).max(initial=0.0))
            reach = max(largest, part * self.least)
            if far[k] > GROWTH * reach or lost[k] > HOPELESS * largest:
                solution = Solution(
                    coords[k],
                    0,
                    0.0,
                    self.setup.known[:0],
                    largest_condition(self.steps),
                    lost=float(lost[k]),
                )
                setup = replace(self.setup, target=target)
                unsound = unsoundness(setup, self.mesh, solution, coords[k], part, self.least)
                if unsound:
                    raise UnsoundError(f"step {index}: {unsound}")

    def require_alike(self, points: FloatArray) -> None:
        """Raise DeformError where periodic images of Cartesian points (n, d) moved differently."""
        setup = self.setup
        if not len(setup.images):
            return
        found = misfits(setup.frame, setup.coords, points, setup.images)
        if not found.max() <= FAR * largest_coordinate(
            self.mesh.points
        ):  # else it is rounding, without a closer look
            largest_misfit(setup.frame, setup.coords, points, setup.images)

    def off_track(self, coords: FloatArray) -> FloatArray:
        """Return the largest distance, (...,), of a sliding node from its track, in the frame."""
        tracks, sliding = self.setup.tracks, self.setup.classes.sliding
        label, off = tracks.of_node[sliding], np.zeros(coords.shape[:-2])
        for index, facets in self.facets.items():
            at = flat(coords[..., sliding[label == index], :])
            guess = np.tile(facets, len(at) // len(facets))
            gap = np.linalg.norm(tracks.tracks[index].nearest(at, guess)[0] - at, axis=1)
            off = np.maximum(off, gap.reshape(*off.shape, -1).max(axis=-1))
        return off

    def tolerance(self, designs: FloatArray) -> FloatArray:
        """Return the allowed error of each design, (...,), in the mesh's length unit.

        The tolerance of the data reduction, or a part of the largest displacement of ``designs``
        (..., m, d).
        """
        if self.setup.reduction is not None:
            return np.full(designs.shape[:-2], self.setup.reduction.tolerance)
        largest = np.linalg.norm(designs, axis=-1).max(axis=-1, initial=0.0)
        return AUTO_TOLERANCE * largest + ROUNDING * self.mesh.extent


def facets_of(setup: Setup, coords: FloatArray) -> dict[int, IntArray]:
    """Return for each track, by its index, the simplex (s,) that each of its sliding nodes is on.

    ``coords`` (n, d) are in the frame.
    """
    tracks, sliding = setup.tracks, setup.classes.sliding
    label = tracks.of_node[sliding]
    return {
        index: tracks.tracks[index].nearest(coords[sliding[label == index]])[1]
        for index in np.unique(label[label >= 0]).tolist()
    }


def usual_edge(setup: Setup) -> float:
    """Return the median edge length of the moving boundary, in the frame; 0 without one."""
    facets = setup.boundary.facets
    facets = facets[np.isin(facets, setup.classes.moving).all(axis=1)]
    ends = setup.coords[np.roll(facets, -1, axis=1)] - setup.coords[facets]
    gaps = np.linalg.norm(ends, axis=-1)
    gaps = gaps[gaps > 0.0]
    return float(np.median(gaps)) if len(gaps) else 0.0
