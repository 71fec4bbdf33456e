"""What is checked of each design: that its result can be right, and how far it is off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from slideviz.case.motion import ROUNDING
from slideviz.deformation.growth import GROWTH, HOPELESS, unsoundness
from slideviz.deformation.reduction import AUTO_TOLERANCE
from slideviz.deformation.setup import Setup
from slideviz.design.doubt import largest_condition
from slideviz.design.frozen.loops import farthest
from slideviz.design.frozen.operations import flat
from slideviz.design.frozen.step import FrozenStep, StepState
from slideviz.design.frozen.tape import value
from slideviz.errors import DeformError, UnsoundError
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.rbf.images import FAR, largest_misfit, misfits
from slideviz.rbf.problem import Solution


@dataclass(frozen=True, eq=False)
class Checks:
    """The checks of a design.

    Attributes
    ----------
    mesh : Mesh
    setup : Setup
    steps : tuple of FrozenStep
    facets : dict of int to (s,) int64
        The facets that the sliding nodes of each track are on at the reference.
    least : float
        How far nodes may go at least, in the frame.
    """

    mesh: Mesh
    setup: Setup
    steps: tuple[FrozenStep, ...]
    facets: Mapping[int, IntArray]
    least: float

    def errors(self, targets: FloatArray, states: list[StepState]) -> FloatArray:
        """Return the largest error of each design, (...,).

        Raises
        ------
        DeformError
            Coordinates became infinite, nodes go far beyond the motion, or images apart.
        """
        errors = self.off_track(value(states[-1].coords))
        for index, (step, state) in enumerate(zip(self.steps, states, strict=True), start=1):
            self.require_sound(index, step.part, targets, state)
            self.require_alike(value(state.points))
            errors = np.maximum(errors, state.max_error)
        return errors

    def require_sound(self, index: int, part: float, targets: FloatArray, state: StepState) -> None:
        """Raise where the results of a step cannot be right: what every run checks.

        Nodes may go as far as by the reference, or by an edge of what moves: the finite difference
        that moves one node alone by next to nothing has no other motion to be judged by.
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
        """Raise where periodic images have moved differently."""
        setup = self.setup
        if not len(setup.images):
            return
        found = misfits(setup.frame, setup.coords, points, setup.images)
        if not found.max() <= FAR * largest_coordinate(
            self.mesh.points
        ):  # else it is rounding, without a closer look
            largest_misfit(setup.frame, setup.coords, points, setup.images)

    def off_track(self, coords: FloatArray) -> FloatArray:
        """Return how far sliding nodes are off their boundary, at most, (...,)."""
        tracks, sliding = self.setup.tracks, self.setup.classes.sliding
        label, off = tracks.of_node[sliding], np.zeros(coords.shape[:-2])
        for index, facets in self.facets.items():
            at = flat(coords[..., sliding[label == index], :])
            guess = np.tile(facets, len(at) // len(facets))
            gap = np.linalg.norm(tracks.tracks[index].nearest(at, guess)[0] - at, axis=1)
            off = np.maximum(off, gap.reshape(*off.shape, -1).max(axis=-1))
        return off

    def tolerance(self, designs: FloatArray) -> FloatArray:
        """Return what errors may be, (...,): by the data reduction, or a part of the motion."""
        if self.setup.reduction is not None:
            return np.full(designs.shape[:-2], self.setup.reduction.tolerance)
        largest = np.linalg.norm(designs, axis=-1).max(axis=-1, initial=0.0)
        return AUTO_TOLERANCE * largest + ROUNDING * self.mesh.extent


def facets_of(setup: Setup, coords: FloatArray) -> dict[int, IntArray]:
    """Return the facets that the sliding nodes of each track are on at the reference."""
    tracks, sliding = setup.tracks, setup.classes.sliding
    label = tracks.of_node[sliding]
    return {
        index: tracks.tracks[index].nearest(coords[sliding[label == index]])[1]
        for index in np.unique(label[label >= 0]).tolist()
    }


def usual_edge(setup: Setup) -> float:
    """Return the median distance of neighbours on what moves, in the frame; 0 without any."""
    facets = setup.boundary.facets
    facets = facets[np.isin(facets, setup.classes.moving).all(axis=1)]
    ends = setup.coords[np.roll(facets, -1, axis=1)] - setup.coords[facets]
    gaps = np.linalg.norm(ends, axis=-1)
    gaps = gaps[gaps > 0.0]
    return float(np.median(gaps)) if len(gaps) else 0.0
