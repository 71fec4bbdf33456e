"""The deformer: a deformation prepared once, for many displacements, with exact derivatives."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, Translate
from slideviz.case.motion import ROUNDING, displacements
from slideviz.deformation.growth import GROWTH, HOPELESS, unsoundness
from slideviz.deformation.prescribed import displaced
from slideviz.deformation.reduction import AUTO_TOLERANCE
from slideviz.deformation.setup import Setup, make_setup
from slideviz.deformation.solver import Progress
from slideviz.design.choosing import choose_steps
from slideviz.design.frozen_step import FrozenStep, State
from slideviz.design.given import given_input
from slideviz.design.loops import farthest, to_points
from slideviz.design.operations import difference, flat
from slideviz.design.tape import Array, Tape, Variable, put, take, transform, value
from slideviz.errors import (
    CaseError,
    ConditionWarning,
    DeformError,
    Note,
    ToleranceWarning,
    UnsoundError,
)
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.mesh.periodic import TOLERANCE
from slideviz.rbf.images import FAR, Spread, largest_misfit, misfits
from slideviz.rbf.problem import Solution
from slideviz.rbf.refine import TRUSTED

BADLY_CONDITIONED = 1e14
"""From this condition number on, what a single node moves alone has few correct digits."""

REMEDY = (
    "use DATA_REDUCTION= YES with a larger tolerance, a less smooth RBF_KERNEL such as "
    "wendland-c0, or a smaller INFLUENCE_FACTOR"
)

TOGETHER = 128
"""Designs that are deformed together, and share the radial functions."""

Tell = Callable[[Progress], None]


class Deformer:
    """A deformation prepared once, for many displacements of the moving nodes.

    Everything discrete is chosen at the reference, the (first) displacement that it is made with,
    and kept: number of steps, control nodes, the facet, edge or vertex that each sliding node is
    on, nearest boundary nodes and radius of the correction. So results are smooth functions of the
    displacement, and `jvp` and `vjp` are their exact derivatives. They depend on the arguments
    alone, to the bit. It can be pickled.

    Attributes
    ----------
    mesh : Mesh
        Undeformed.
    case : Case
    nodes : (m,) int64
        The nodes of the moving markers, ascending.
    displacement : (m, d) float64
        What the case's motions ask of them, in the mesh's length unit.
    warnings : tuple of str
        About case and mesh.

    Notes
    -----
    Displacements, directions and gradients have Cartesian components, also where the mesh repeats
    by rotation. Nodes that are periodic images of each other must be displaced alike (turned by the
    angle of the period); the one with the lowest number counts for all of them, and gradients are
    those with respect to moving all of them, at this one. The same holds for copies in a halo and
    the nodes that they are copies of.

    Examples
    --------
    >>> import numpy as np
    >>> import slideviz as sv
    >>> mesh = sv.Mesh(
    ...     np.array([[0.0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]),
    ...     sv.Cells.from_blocks([(9, [[0, 1, 4, 3], [1, 2, 5, 4]])]),
    ...     (
    ...         sv.Marker("left", sv.Cells.from_blocks([(3, [[0, 3]])])),
    ...         sv.Marker("right", sv.Cells.from_blocks([(3, [[2, 5]])])),
    ...     ),
    ... )
    >>> case = sv.Case(roles={"right": "moving"}, motions=(sv.Translate("right", (0.5, 0.0)),))
    >>> deformer = sv.Deformer(mesh, case)
    >>> deformer.nodes
    array([2, 5])
    >>> deformer.deform()[:3, 0].round(2)
    array([0.  , 1.28, 2.5 ])
    >>> deformer.jvp(deformer.displacement, deformer.displacement)[:3, 0].round(2)
    array([0.  , 0.28, 0.5 ])
    """

    def __init__(
        self,
        mesh: Mesh,
        case: Case,
        displacements: FloatArray | None = None,
        progress: Tell | None = None,
    ) -> None:
        """Choose and prepare all that is kept.

        Parameters
        ----------
        mesh
            The undeformed mesh.
        case
            Roles, motions and settings. Where ``displacements`` are given it needs no motions.
        displacements : (m, d) or (k, m, d), optional
            Of the moving nodes; those of the case's motions if not given. Of several, the control
            nodes are enough for all of them, and the first is the reference of all else.
        progress
            Called often with a ``Progress``; an exception it raises ends the work at once.

        Raises
        ------
        CaseError, MeshError
            The case does not fit the mesh, or displacements are not as the mesh repeats.
        DeformError
            The system cannot be solved, or the method has no derivative here.

        Warns
        -----
        ConditionWarning
            The system is so badly conditioned that derivatives, or points too, have few digits.
        """
        if displacements is not None and not case.motions:
            case = case.change(motions=(Translate("", (0.0,) * mesh.dim),))
        asked = _asked(case, mesh)
        self.mesh, self.case = mesh, case
        self.nodes, self.displacement = asked.nodes, asked.vectors
        given = asked.vectors if displacements is None else displacements
        given = self._checked(given, "displacements")
        references = given.reshape(-1, *asked.vectors.shape)
        sizes = np.linalg.norm(references, axis=2).max(axis=1, initial=0.0)
        most = Displacements(asked.nodes, references[int(np.argmax(sizes))], asked.warnings)
        setup = make_setup(case, mesh, displaced(most, mesh))
        if setup.reduction is not None and not sizes.any():
            raise DeformError(
                "no displacement is given by which control nodes could be chosen: all are zero; "
                "give `displacements` as large as the designs to come, or use DATA_REDUCTION= NO"
            )
        self._setup, self._input = setup, given_input(mesh, setup, asked)
        self._size = largest_coordinate(mesh.points)
        self._least = max(float(sizes.max()), _usual_edge(setup))
        self.warnings = (*case.warnings, *setup.warnings)
        targets = [value(self._target(reference)) for reference in references]
        tell = progress or (lambda _: None)
        self._steps: tuple[FrozenStep, ...] = choose_steps(case, mesh, setup, targets, tell)
        # What is discrete is chosen at the first design, and kept.
        states = self._run(targets[0])
        self._facets = self._nearest(value(states[-1].coords))
        self.warnings += self._note_of_refinement()
        if not self._warn_of_doubt(np.max([state.doubt for state in states], axis=0)):
            self._warn_of_condition()

    def deform(self, displacement: FloatArray | None = None) -> FloatArray:
        """Return the deformed points, (n, d), or (k, n, d) of k designs.

        Parameters
        ----------
        displacement : (m, d) or (k, m, d), optional
            Of the moving nodes, from the undeformed mesh; the case's own if not given.

        Raises
        ------
        DeformError
            The result cannot be right, or images are displaced differently.

        Warns
        -----
        ToleranceWarning
            The control nodes of the reference do not suffice for a design.
        ConditionWarning
            Between the boundary nodes, the points of a design cannot be trusted.
        """
        given = self.displacement if displacement is None else displacement
        given = self._checked(given, "displacement")
        points, errors, doubt = self._deformed(given)
        self._warn_of_doubt(doubt)
        self._warn(errors, self._tolerance(given))
        return points

    def max_error(self, displacement: FloatArray) -> float | FloatArray:
        """Return by how much boundary nodes miss what they must do, at most: a float, or (k,).

        What interpolation misses at the boundary nodes before they are set, or how far sliding ones
        are off their boundary because they left the facet that they are kept on, in the mesh's
        length unit.
        """
        found = self._deformed(self._checked(displacement, "displacement"))[1]
        return float(found) if found.ndim == 0 else found

    def jvp(self, displacement: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the derivative of the points in a direction, (n, d), or in several, (k, n, d).

        Parameters
        ----------
        displacement : (m, d)
            The design.
        direction : (m, d) or (k, m, d)
            Changes of the displacement.
        """
        _, start, end = self._taped(displacement)
        return np.array(start.tape.push(start, self._checked(direction, "direction"), end))

    def vjp(self, displacement: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the gradient of ``(weights * points).sum()``, (m, d), or of several, (k, m, d).

        Parameters
        ----------
        displacement : (m, d)
            The design.
        weights : (n, d) or (k, n, d)
            Sensitivities of a function with respect to all points, such as those of an adjoint
            solver: the result is its gradient with respect to the displacement of the moving nodes.
        """
        _, start, end = self._taped(displacement)
        adjoint = self._shaped(weights, self.mesh.points.shape, "weights")
        return np.array(start.tape.pull(end, adjoint, start))

    def refresh(self, displacement: FloatArray) -> Deformer:
        """Return a deformer whose choices are those at another design (or at several)."""
        return Deformer(self.mesh, self.case, displacement)

    def _checked(self, vectors: FloatArray, name: str) -> FloatArray:
        return self._shaped(vectors, self.displacement.shape, name)

    def _shaped(self, vectors: FloatArray, shape: tuple[int, ...], name: str) -> FloatArray:
        """Return finite numbers of this shape, or several of them.

        Raises
        ------
        CaseError
            They are none.
        """
        out = np.asarray(vectors, np.float64)
        if out.shape[-2:] != shape or out.ndim not in (2, 3):
            raise CaseError(
                f"{name} has the shape {out.shape}; needed is {shape}, a row for each node, or "
                f"(k, {shape[0]}, {shape[1]}) for k of them"
            )
        if not np.isfinite(out).all():
            raise CaseError(f"{name} has numbers that are not finite")
        return out

    def _target(self, vectors: Array) -> Array:
        """Return the displacement (..., a, d) of the known nodes, in the frame."""
        setup, given = self._setup, self._input
        own = take(vectors, given.rows)
        if given.turn is not None:
            own = transform(given.turn, own)
        moved = difference(setup.frame, given.points, own)
        self._require_alike(value(vectors), value(moved))
        shape = (len(setup.known), self.mesh.dim)
        return put(np.zeros(shape), given.known, take(moved, given.source))

    def _require_alike(self, vectors: FloatArray, moved: FloatArray) -> None:
        """Raise where images, or copies and their originals, are displaced differently.

        Parameters
        ----------
        vectors, moved : (..., m, d), (..., s, d)
            As given, and of those that count in the frame.
        """
        given, setup, mesh = self._input, self._setup, self.mesh
        if len(given.others):
            own = vectors[..., given.others, :]
            follow = difference(setup.frame, mesh.points[self.nodes[given.others]], own)
            gap = np.abs(value(follow) - moved[..., given.followed, :])
            largest = np.linalg.norm(moved, axis=-1).max(axis=-1, initial=0.0)
            allowed = TOLERANCE * largest + ROUNDING * self._size
            if (gap.max(axis=(-1, -2)) > allowed).any():
                self._refuse(vectors)
        if mesh.halo is not None:
            self._refuse(vectors)

    def _refuse(self, vectors: FloatArray) -> None:
        """Raise what the solver raises where nodes that should be alike are not."""
        setup, mesh = self._setup, self.mesh
        for each in vectors.reshape(-1, *vectors.shape[-2:]):
            moved = displaced(Displacements(self.nodes, each), mesh)
            there = setup.frame.difference(mesh.points[moved.nodes], moved.vectors)
            largest = float(np.linalg.norm(there, axis=1).max(initial=0.0))
            allowed = TOLERANCE * largest + ROUNDING * self._size
            Spread(moved.nodes, there, setup.classes.stands).require_alike(allowed)

    def _run(self, target: Array) -> list[State]:
        """Return the states after all steps."""
        states = [State(self._setup.coords)]
        for step in self._steps:
            states.append(step.run(states[-1], target))
        return states[1:]

    def _deformed(self, displacement: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points (..., n, d), largest errors and doubts (...,), all of them checked."""
        if displacement.ndim == 2:
            target = value(self._target(displacement))
            states = self._run(target)
            doubt = np.max([state.doubt for state in states], axis=0)
            return value(states[-1].points), self._errors(target, states), doubt
        points = np.empty((len(displacement), *self.mesh.points.shape))
        if len(self._steps) > 1 or self.mesh.halo is not None:
            errors, doubt = np.empty((2, len(points)))
            for k, each in enumerate(displacement):
                points[k], errors[k], doubt[k] = self._deformed(each)
            return points, errors, doubt
        found = [
            self._together(displacement[first : first + TOGETHER], points[first : first + TOGETHER])
            for first in range(0, len(points), TOGETHER)
        ]
        errors, doubt = np.concatenate([np.empty((2, 0)), *found], axis=1)
        return points, errors, doubt

    def _together(self, displacement: FloatArray, room: FloatArray) -> FloatArray:
        """Deform designs in one step into ``room`` (k, n, d); return their errors and doubts."""
        setup, (step,) = self._setup, self._steps
        targets = value(self._target(displacement))
        state = step.moved(State(setup.coords), targets, room)
        errors = np.maximum(self._off_track(room), state.max_error)
        self._require_sound(1, 1.0, targets, state)
        one, two = setup.images.T
        apart = (room[:, two] - room[:, one]) - (setup.coords[two] - setup.coords[one])
        alike = np.abs(apart).max(initial=0.0) <= FAR * self._size
        to_points(setup.frame, room, setup.coords, self.mesh.points)
        for points in room[:0] if alike else room:
            self._require_alike_after(points)
        return np.stack([errors, np.broadcast_to(state.doubt, errors.shape)])

    def _taped(self, displacement: FloatArray) -> tuple[list[State], Variable, Variable]:
        """Return the states of a design, and input and points as variables of one tape."""
        given = self._shaped(displacement, self.displacement.shape, "displacement")
        if given.ndim == 3:
            raise CaseError("derivatives are those at one displacement, not at several")
        start = Tape().variable(given)
        states = self._run(self._target(start))
        end = states[-1].points
        assert isinstance(end, Variable)
        return states, start, end

    def _errors(self, targets: FloatArray, states: list[State]) -> FloatArray:
        """Return the largest error of each design, (...,).

        Raises
        ------
        DeformError
            Coordinates became infinite, nodes go far beyond the motion, or images apart.
        """
        errors = self._off_track(value(states[-1].coords))
        for index, (step, state) in enumerate(zip(self._steps, states, strict=True), start=1):
            self._require_sound(index, step.part, targets, state)
            self._require_alike_after(value(state.points))
            errors = np.maximum(errors, state.max_error)
        return errors

    def _require_sound(self, index: int, part: float, targets: FloatArray, state: State) -> None:
        """Raise where the results of a step cannot be right: what every run checks.

        Nodes may go as far as by the reference, or by an edge of what moves: the finite difference
        that moves one node alone by next to nothing has no other motion to be judged by.
        """
        shape = self.mesh.points.shape
        coords = value(state.coords).reshape(-1, *shape)
        targets = targets.reshape(len(coords), *targets.shape[-2:])
        lost = np.broadcast_to(state.lost.reshape(-1), len(coords))
        far = farthest(coords, self._setup.coords)
        for k, target in enumerate(targets):
            if not np.isfinite(far[k]):
                raise DeformError(f"step {index}: coordinates became infinite; use more steps")
            largest = part * float(np.linalg.norm(target, axis=1).max(initial=0.0))
            reach = max(largest, part * self._least)
            if far[k] > GROWTH * reach or lost[k] > HOPELESS * largest:
                solution = Solution(
                    coords[k], 0, 0.0, self.nodes[:0], self._condition(), lost=float(lost[k])
                )
                setup = replace(self._setup, target=target)
                unsound = unsoundness(setup, self.mesh, solution, coords[k], part, self._least)
                if unsound:
                    raise UnsoundError(f"step {index}: {unsound}")

    def _require_alike_after(self, points: FloatArray) -> None:
        """Raise where periodic images have moved differently."""
        setup = self._setup
        if not len(setup.images):
            return
        found = misfits(setup.frame, setup.coords, points, setup.images)
        if not found.max() <= FAR * self._size:  # else it is rounding, without a closer look
            largest_misfit(setup.frame, setup.coords, points, setup.images)

    def _nearest(self, coords: FloatArray) -> dict[int, IntArray]:
        """Return the facets that the sliding nodes of each track are on at the reference."""
        tracks, sliding = self._setup.tracks, self._setup.classes.sliding
        label = tracks.of_node[sliding]
        return {
            index: tracks.tracks[index].nearest(coords[sliding[label == index]])[1]
            for index in np.unique(label[label >= 0]).tolist()
        }

    def _off_track(self, coords: FloatArray) -> FloatArray:
        """Return how far sliding nodes are off their boundary, at most, (...,)."""
        tracks, sliding = self._setup.tracks, self._setup.classes.sliding
        label, off = tracks.of_node[sliding], np.zeros(coords.shape[:-2])
        for index, facets in self._facets.items():
            at = flat(coords[..., sliding[label == index], :])
            guess = np.tile(facets, len(at) // len(facets))
            gap = np.linalg.norm(tracks.tracks[index].nearest(at, guess)[0] - at, axis=1)
            off = np.maximum(off, gap.reshape(*off.shape, -1).max(axis=-1))
        return off

    def _tolerance(self, designs: FloatArray) -> FloatArray:
        """Return what errors may be, (...,): by the data reduction, or a part of the motion."""
        if self._setup.reduction is not None:
            return np.full(designs.shape[:-2], self._setup.reduction.tolerance)
        largest = np.linalg.norm(designs, axis=-1).max(axis=-1, initial=0.0)
        return AUTO_TOLERANCE * largest + ROUNDING * self.mesh.extent

    def _condition(self) -> float:
        """Return the largest condition number of the systems at the reference."""
        return max((step.condition for step in self._steps), default=1.0)

    def _note_of_refinement(self) -> tuple[str, ...]:
        """Return the sentence about systems that are solved with twice the digits."""
        refined = max((step.refined for step in self._steps), default=0.0)
        if not refined:
            return ()
        return (
            Note(
                f"the system is nearly singular (condition number {self._condition():.0e}): "
                f"between the boundary nodes designs would be wrong by up to {100 * refined:.2g} % "
                "of the largest displacement, so all are solved with twice the digits; those for "
                "which that does not suffice are told by a ConditionWarning"
            ),
        )

    def _warn_of_condition(self) -> None:
        """Warn where designs that are less smooth than the reference may have few digits."""
        steps = [step for step in self._steps if not step.refined]
        worst = max((step.condition for step in steps), default=0.0)
        doubt = max((step.doubt for step in self._steps), default=0.0)
        if doubt > TRUSTED:
            worst = self._condition()
            amount = f"may be wrong by {100 * doubt:.2g} % of the largest displacement"
        elif worst > BADLY_CONDITIONED:  # that of a method without a system is NaN
            amount = "may have few correct digits"
        else:
            return
        warnings.warn(
            f"the condition number of the system is {worst:.0e}, so that derivatives by single "
            "nodes, and points between the boundary nodes where neighbours move very differently, "
            f"{amount}; {REMEDY}",
            ConditionWarning,
            stacklevel=3,
        )

    def _warn_of_doubt(self, doubt: FloatArray) -> bool:
        """Warn where the points of designs cannot be trusted, and tell whether that is so."""
        worst = float(doubt.max(initial=0.0))
        if worst <= TRUSTED:
            return False
        of = "" if doubt.ndim == 0 else f" of {np.count_nonzero(doubt > TRUSTED)} designs"
        warnings.warn(
            f"the condition number of the system is {self._condition():.0e}: derivatives, and "
            f"points{of} between the boundary nodes, may be wrong by {100 * worst:.2g} % of the "
            f"largest displacement; {REMEDY}",
            ConditionWarning,
            stacklevel=3,
        )
        return True

    def _warn(self, errors: FloatArray, allowed: FloatArray) -> None:
        above = errors > allowed
        if not above.any():
            return
        worst = np.unravel_index(int(np.argmax(errors - allowed)), errors.shape)
        of = "" if errors.ndim == 0 else f" of {np.count_nonzero(above)} designs"
        warnings.warn(
            f"the largest error{of} at the boundary is {errors[worst]:.3g}, above the tolerance of "
            f"{allowed[worst]:.3g}: control nodes and facets are those of another displacement; "
            "choose them anew with `deformer = deformer.refresh(displacement)`",
            ToleranceWarning,
            stacklevel=3,
        )


def _usual_edge(setup: Setup) -> float:
    """Return the median distance of neighbours on what moves, in the frame; 0 without any."""
    facets = setup.boundary.facets
    facets = facets[np.isin(facets, setup.classes.moving).all(axis=1)]
    ends = setup.coords[np.roll(facets, -1, axis=1)] - setup.coords[facets]
    gaps = np.linalg.norm(ends, axis=-1)
    gaps = gaps[gaps > 0.0]
    return float(np.median(gaps)) if len(gaps) else 0.0


def _asked(case: Case, mesh: Mesh) -> Displacements:
    return displacements(case, mesh)
