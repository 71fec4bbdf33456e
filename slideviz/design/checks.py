"""Checks of each design: whether its result can be right, and its largest error."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slideviz.case.model import Case
from slideviz.case.moving_nodes import ROUNDING
from slideviz.case.words import counted, wrong_by
from slideviz.design.frozen.solve import REMEDY
from slideviz.design.frozen.step import FrozenStep, StepState
from slideviz.errors import (
    ConditionWarning,
    DeformError,
    Message,
    Remark,
    ToleranceWarning,
    UnsoundError,
    note,
)
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.rbf.images import FAR, largest_misfit, misfits
from slideviz.rbf.loops import farthest
from slideviz.rbf.operations import flat
from slideviz.rbf.problem import Solution
from slideviz.rbf.refine import NOTED, TRUSTED
from slideviz.rbf.tape import value
from slideviz.solver.growth import GROWTH, HOPELESS, unsoundness
from slideviz.solver.setup import AUTO_TOLERANCE, Setup

BADLY_CONDITIONED = 1e14
"""Above this condition number, the effect of moving a single node has few correct digits."""


def largest_condition(steps: Sequence[FrozenStep]) -> float:
    """Return the largest condition number of the steps' systems at the reference; 1.0 if none."""
    return max((step.condition for step in steps), default=1.0)


def note_of_refinement(steps: Sequence[FrozenStep]) -> tuple[Message, ...]:
    """Return a note about systems that are solved with twice the digits; empty if none is."""
    refined = max((step.refined for step in steps), default=0.0)
    if not refined:
        return ()
    return (
        note(
            f"the system is nearly singular (condition number {largest_condition(steps):.0e}): "
            f"between the boundary nodes designs would be wrong by up to {100 * refined:.2g} % "
            "of the largest displacement, so all are solved with twice the digits; a "
            "ConditionWarning names those for which that does not suffice"
        ),
    )


def without_repair(case: Case) -> tuple[Case, tuple[Remark, ...]]:
    """Return the case without repair, and a note or, where it is asked for, a warning of that."""
    if case.repair == "no":
        return case, ()
    said = (
        f"REPAIR= {case.repair.upper()} is ignored by a Deformer, because repaired positions are "
        "not differentiable; points and derivatives are those before the repair"
    )
    return case.change(repair="no"), (said if case.repair == "yes" else note(said),)


def warn_of_condition(steps: Sequence[FrozenStep]) -> None:
    """Warn where designs that are less smooth than the reference may have few digits."""
    worst = max((step.condition for step in steps if not step.refined), default=0.0)
    error_estimate = max((step.error_estimate for step in steps), default=0.0)
    if error_estimate > TRUSTED:
        worst = largest_condition(steps)
        amount = f"may be wrong by {wrong_by(error_estimate, bounded=False)}"
    elif worst > BADLY_CONDITIONED:  # that of a method without a system is NaN
        amount = "may have few correct digits"
    else:
        return
    said = (
        f"the condition number of the system is {worst:.0e}, so that derivatives by single "
        "nodes, and displacements between the boundary nodes where neighbours move very "
        f"differently, {amount}; {REMEDY}"
    )
    little = TRUSTED < error_estimate <= NOTED
    warnings.warn(ConditionWarning(note(said) if little else said), stacklevel=3)


def warn_of_error_estimate(steps: Sequence[FrozenStep], error_estimate: FloatArray) -> bool:
    """Warn if the error estimate (...,) of a design is above `TRUSTED`; return whether it is."""
    worst = float(error_estimate.max(initial=0.0))
    if worst <= TRUSTED:
        return False
    of = (
        ""
        if error_estimate.ndim == 0
        else f" of {counted(int((error_estimate > TRUSTED).sum()), 'design')}"
    )
    said = (
        f"the condition number of the system is {largest_condition(steps):.0e}: derivatives may "
        f"have few correct digits, and displacements{of} between the boundary nodes may be wrong "
        f"by {wrong_by(worst, bounded=all(step.refined for step in steps))}; {REMEDY}"
    )
    warnings.warn(ConditionWarning(said if worst > NOTED else note(said)), stacklevel=3)
    return True


def warn_of_errors(
    errors: FloatArray, allowed: FloatArray, reference: NDArray[np.bool_], *, reduced: bool
) -> None:
    """Warn where designs miss what they must do by more than is allowed.

    ``errors`` and ``allowed`` (...,). ``reference`` (...,) bool: whether all was chosen for a
    design.
    ``reduced``: whether control nodes were chosen, beside the facets of sliding nodes.
    """
    above = errors > allowed
    if not above.any():
        return
    worst = np.unravel_index(int(np.argmax(errors - allowed)), errors.shape)
    chosen = "control nodes and facets" if reduced else "the facets that nodes slide on"
    of = "" if errors.ndim == 0 else f" of {counted(int(above.sum()), 'design')}"
    why = f": {chosen} belong to another displacement"
    remedy = "renew them with `deformer = deformer.refresh(displacement)`"
    if reference[worst]:
        why = f", with {chosen} chosen for this displacement"
        remedy = "use more STEPS, a less smooth RBF_KERNEL such as wendland-c0, or a smaller "
        remedy += "displacement"
    rule = f"the largest error{of} at the boundary is {errors[worst]:.3g}, above the tolerance of "
    warnings.warn(
        ToleranceWarning(Message(f"{rule}{allowed[worst]:.3g}{why}", remedy)), stacklevel=3
    )


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

        Raises DeformError if coordinates are infinite, nodes move much farther than the boundary,
        or periodic images moved differently. ``targets`` (..., a, d): displacements of the known
        nodes, in the frame. ``states``: after each step.
        """
        errors = self.off_track(value(states[-1].coords))
        for index, (step, state) in enumerate(zip(self.steps, states, strict=True), start=1):
            self.require_sound(index, step.part, targets, state)
            self.require_alike(value(state.points))
            errors = np.maximum(errors, state.number("max_error"))
        return errors

    def require_sound(self, index: int, part: float, targets: FloatArray, state: StepState) -> None:
        """Raise DeformError where the results of a step cannot be right, as in every run.

        Nodes may always move as far as at the reference, or by an edge of the moving boundary: so
        a finite difference, which moves one node by next to nothing, is not refused. ``index``:
        number of the step, from 1, for the message. ``part``: part of the whole displacement after
        the step.
        """
        shape = self.mesh.points.shape
        coords = value(state.coords).reshape(-1, *shape)
        targets = targets.reshape(len(coords), *targets.shape[-2:])
        lost = np.broadcast_to(state.number("lost").reshape(-1), len(coords))
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
                unsound = unsoundness(
                    setup,
                    self.mesh,
                    solution,
                    coords[k],
                    part=part,
                    farthest=float(far[k]),
                    least=self.least,
                )
                if unsound:
                    raise UnsoundError(f"step {index}: {unsound}")

    def require_alike(self, points: FloatArray) -> None:
        """Raise DeformError where periodic images of Cartesian points (n, d) moved differently."""
        setup = self.setup
        if not len(setup.images):
            return
        gaps = misfits(setup.frame, setup.coords, points, setup.images)
        if not gaps.max() <= FAR * largest_coordinate(
            self.mesh.points
        ):  # else it is rounding, without a closer look
            largest_misfit(setup.frame, setup.coords, points, setup.images)

    def off_track(self, coords: FloatArray) -> FloatArray:
        """Return the largest distance, (...,), of a sliding node from its track, in the frame."""
        tracks = self.setup.tracks
        sliding = self.setup.classes.sliding
        label = tracks.of_node[sliding]
        off = np.zeros(coords.shape[:-2])
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
    """Return for each track the simplex (s,) of each sliding node, at ``coords`` in the frame."""
    tracks = setup.tracks
    sliding = setup.classes.sliding
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
