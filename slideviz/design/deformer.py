"""The deformer: a deformation prepared once, for many displacements, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np

from slideviz.argument_types import check_types
from slideviz.case.displacement import Displacements
from slideviz.case.method_keys import automatic_radius
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.case.moving_nodes import moving_nodes
from slideviz.design.checks import (
    Checks,
    facets_of,
    note_of_refinement,
    usual_edge,
    warn_of_condition,
    warn_of_error_estimate,
    warn_of_errors,
    without_repair,
)
from slideviz.design.choosing import choose_steps
from slideviz.design.frozen.step import FrozenStep, StepState
from slideviz.design.known_nodes import known_node_map
from slideviz.design.zone_designs import Work, ZoneDesign, over_zones, zone_designs
from slideviz.errors import CaseError, DeformError, Remark, SlidevizError, not_one_of, note
from slideviz.mesh.interfaces import disjoint_interfaces, torn_interfaces
from slideviz.mesh.model import Assembly, FloatArray, Mesh, largest_coordinate
from slideviz.mesh.quality import quality
from slideviz.mesh.quality_derivative import smooth_margin
from slideviz.rbf.images import FAR
from slideviz.rbf.loops import to_points
from slideviz.rbf.tape import Array, Tape, Variable, value
from slideviz.solver.deform import Progress
from slideviz.solver.growth import wall_warnings
from slideviz.solver.prepare import Prepared, prepare
from slideviz.solver.prescribed import displaced, support_radius
from slideviz.solver.setup import make_setup

TOGETHER = 128
"""Designs that are deformed together, so that each radial function is computed once for all."""

RELAXING = ("alpha", "beta", "theta")
"""How the names of relaxation's coefficients begin among the choices."""

Report = Callable[[Progress], None]


CONSTRAINTS = ("min", "mean", "margin")
"""The numbers of a mesh that have derivatives: names of `slideviz.case.limits.NUMBERS`."""


@dataclass(frozen=True, eq=False)
class Constraint:
    """A number of a deformed mesh, with exact derivatives by the design."""

    value: float
    of_points: FloatArray  # (n, d): its derivative by the points of the mesh
    _start: Variable
    _end: Variable

    def jvp(self, direction: FloatArray) -> float:
        """Return the derivative of the number in a direction (m, d) of the displacement."""
        moved = self._start.tape.push(self._start, np.asarray(direction, float), self._end)
        return float(np.vdot(self.of_points, moved))

    def vjp(self, weight: float = 1.0) -> FloatArray:
        """Return the gradient (m, d) of ``weight`` times the number by the displacement."""
        return np.array(self._start.tape.pull(self._end, weight * self.of_points, self._start))


class Deformer:
    """A deformation prepared once, for many displacements of the moving nodes.

    Everything discrete is chosen at the reference, the first displacement that the deformer is
    made with, and kept: number of steps, support radius, control nodes, the facet, edge or vertex
    that each sliding node is on, nearest boundary nodes and radius of the correction. So results
    are smooth functions of the displacement, and `jvp` and `vjp` are their exact derivatives.
    Results depend on the arguments alone, to the bit. A deformer can be pickled.

    Attributes
    ----------
    mesh : Mesh
        Undeformed.
    case : Case
    nodes : (m,) int64
        The nodes of the moving markers, ascending.
    displacement : (m, d) float64
        Displacement of these nodes by the case's motions, in the mesh's length unit.

    Notes
    -----
    Displacements, directions and gradients have Cartesian components, also where the mesh repeats
    by rotation. Nodes that are periodic images of each other must be displaced alike (turned by the
    angle of the period). The image with the lowest number represents all: its displacement is
    used, and its row of a gradient is the derivative with respect to moving all of them; the rows
    of the others are zero. The same holds for copies in a halo and the nodes that they copy.

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

    @check_types
    def __init__(
        self,
        mesh: Mesh,
        case: Case,
        displacements: FloatArray | None = None,
        progress: Report | None = None,
    ) -> None:
        """Run the solver at the reference, and keep its choices.

        Parameters
        ----------
        mesh
            The undeformed mesh.
        case
            Roles, motions and settings. It needs no motions if ``displacements`` are given.
        displacements : (m, d) or (k, m, d), optional
            Of the moving nodes; those of the case's motions if not given. If k are given, the
            control nodes suffice for all of them, the support radius fits all together, and all
            else is chosen at the first.
        progress
            Called often with a ``Progress``; an exception it raises ends the work at once.

        Raises
        ------
        CaseError, MeshError
            The case does not fit the mesh, or periodic images are displaced differently.
        DeformError
            The system cannot be solved, the result cannot be right, or all displacements are zero
            so that no control nodes can be selected.

        Warns
        -----
        ConditionWarning
            The system is so badly conditioned that derivatives, or points too, have few digits.
        """
        if case.method != "rbf":
            raise CaseError(
                f"METHOD= {case.method} has no derivatives, so it has no Deformer; use METHOD= "
                "rbf, or deform for each design"
            )
        case, left_out = without_repair(case)
        if displacements is not None and not case.motions:
            case = case.change(motions=(Translate("", (0.0,) * mesh.dim),))
        prepared = prepare(case, mesh)
        case = prepared.case
        asked = moving_nodes(case, mesh)
        self.mesh = mesh
        self.case = case
        self.nodes = asked.nodes
        self.displacement = asked.vectors
        designs = asked.vectors if displacements is None else displacements
        designs = self._checked(designs, "displacements")
        references = designs.reshape(-1, *asked.vectors.shape)
        report = progress or (lambda _: None)
        self._zones: tuple[ZoneDesign, ...] = ()
        self.messages: tuple[Remark, ...]
        """About case and mesh, zones that no longer fit at the reference, and systems that are
        solved with twice the digits (a note)."""
        if isinstance(mesh, Assembly):
            make = partial(Deformer, progress=report)
            self._zones = zone_designs(prepared, mesh, asked.nodes, references, make)
            points = self.deform(references[0])
            left_out = *left_out, *disjoint_interfaces(mesh, case.interfaces)
            self.messages = (*prepared.alone.warnings, *left_out)
            for zone in self._zones:
                said = SlidevizError(*zone.deformer.messages)
                self.messages += said.within(f"zone {zone.number}")
            self.messages += (*torn_interfaces(mesh, points, case.interfaces),)
            return
        sizes = np.linalg.norm(references, axis=2).max(axis=1, initial=0.0)
        most = Displacements(asked.nodes, references[int(np.argmax(sizes))], asked.warnings)
        held = case
        if automatic_radius(case) and len(references) > 1:
            far = np.linalg.norm(references, axis=2).argmax(axis=0)
            widest = references[far, np.arange(len(asked.nodes))]
            together = Displacements(asked.nodes, widest, asked.warnings)
            held = case.change(support_radius=support_radius(case, mesh, together))
        setup = make_setup(Prepared(held, mesh), displaced(most, mesh))
        if setup.reduction is not None and not sizes.any():
            raise DeformError(
                "all displacements are zero, so control nodes cannot be chosen; give "
                "`displacements` as large as the designs to come, or use DATA_REDUCTION= NO"
            )
        self._setup = setup
        self._input = known_node_map(mesh, setup, asked)
        self._references = references
        self.messages = (*case.warnings, *left_out, *setup.warnings)
        targets = [value(self._input.target(reference)) for reference in references]
        self._steps: tuple[FrozenStep, ...]
        self._steps, points = choose_steps(case, mesh, setup, targets, report)
        refined = any(step.refined for step in self._steps)
        self._as_run = None if refined or left_out else points
        # What is discrete is chosen at the first design, and kept.
        states = self._run(targets[0])
        if setup.relaxation is not None and not targets[0].any():
            self._relax_from_rest(targets)
        facets = facets_of(setup, value(states[-1].coords))
        least = max(float(sizes.max()), usual_edge(setup))
        self._checks = Checks(mesh, setup, self._steps, facets, least)
        self.messages += (*note_of_refinement(self._steps), *torn_interfaces(mesh, points))
        self.messages += (*wall_warnings(setup, case, mesh, points),)
        if not warn_of_error_estimate(
            self._steps, np.max([state.number("error_estimate") for state in states], axis=0)
        ):
            warn_of_condition(self._steps)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The texts of ``messages``."""
        return tuple(map(str, self.messages))

    @check_types
    def deform(self, displacement: FloatArray | None = None) -> FloatArray:
        """Return the deformed points, (n, d), or (k, n, d) of k designs.

        Parameters
        ----------
        displacement : (m, d) or (k, m, d), optional
            Of the moving nodes, from the undeformed mesh; the case's own if not given.

        Raises
        ------
        CaseError
            The displacement has another shape, or numbers that are not finite.
        DeformError
            The result cannot be right, or periodic images are displaced differently.

        Warns
        -----
        ToleranceWarning
            Control nodes or facets of the reference do not suffice for a design.
        ConditionWarning
            Between the boundary nodes, the points of a design cannot be trusted.
        """
        design = self.displacement if displacement is None else displacement
        design = self._checked(design, "displacement")
        if self._zones:
            return value(self._joined(design, lambda zone, moved: zone.deform(value(moved))))
        points, errors, error_estimate = self._deformed(design)
        warn_of_error_estimate(self._steps, error_estimate)
        reduced = self._setup.reduction is not None
        same = design[..., None, :, :] == self._references
        reference = same.all(axis=(-1, -2)).any(axis=-1)
        allowed = self._checks.tolerance(design)
        warn_of_errors(errors, allowed, reference, reduced=reduced)
        return points

    @check_types
    def max_error(self, displacement: FloatArray) -> float | FloatArray:
        """Return the largest error at boundary nodes: a float, or (k,) of k designs.

        In the mesh's length unit: the error of the interpolation at boundary nodes, before they
        are set exactly; or the distance of a sliding node from its boundary, because it left the
        plane of the facet that it was on at the reference. The larger of both.
        """
        design = self._checked(displacement, "displacement")
        if self._zones:
            errors = list[FloatArray]()

            def deformed(zone: Deformer, moved: Array) -> FloatArray:
                points, error, _ = zone._deformed(value(moved))
                errors.append(error)
                return points

            self._joined(design, deformed)
            error = reduce(np.maximum, errors)
        else:
            error = self._deformed(design)[1]
        return float(error) if error.ndim == 0 else error

    @check_types
    def jvp(self, displacement: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the derivative of the points in a direction, (n, d), or in several, (k, n, d).

        Parameters
        ----------
        displacement : (m, d)
            The design; of several, call it for each.
        direction : (m, d) or (k, m, d)
            Changes of the displacement, all of them at this one.
        """
        start, end = self._taped(displacement)
        return np.array(start.tape.push(start, self._checked(direction, "direction"), end))

    @check_types
    def vjp(self, displacement: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the gradient of ``(weights * points).sum()``, (m, d), or of several, (k, m, d).

        Parameters
        ----------
        displacement : (m, d)
            The design; of several, call it for each.
        weights : (n, d) or (k, n, d)
            Sensitivities of a function with respect to all points, such as those of an adjoint
            solver: the result is its gradient with respect to the displacement of the moving nodes.
        """
        start, end = self._taped(displacement)
        adjoint = self._checked(weights, "weights", self.mesh.points.shape)
        return np.array(start.tape.pull(end, adjoint, start))

    @check_types
    def constraint(
        self, name: str, displacement: FloatArray | None = None, p: float = 50.0
    ) -> Constraint:
        """Return a number of the deformed mesh that an optimiser can constrain, with its gradient.

        Parameters
        ----------
        name : {"min", "mean", "margin"}
            The smooth minimum or the mean of the quality (`slideviz.QualityDerivative`), or the
            smooth minimum of the margins: for each cell the smallest coefficient of its Jacobian
            over that before, 1 where the cell is only moved, 0 where it folds.
        displacement : (m, d), optional
            The design; the case's own if not given.
        p : float
            The exponent of the smooth minimum.

        Raises
        ------
        CaseError
            The number has no derivative, or the exponent is below 1.
        MeshError
            An undeformed cell has no positive volume to compare with.
        """
        design = self.displacement if displacement is None else displacement
        if name not in CONSTRAINTS:
            raise CaseError(f"constraint: {not_one_of(name, CONSTRAINTS)}")
        start, end = self._taped(design)
        mesh = self.mesh.with_points(value(end))
        if name == "margin":
            margin = smooth_margin(mesh, self.mesh, p)
            return Constraint(margin.value, margin.of_points, start, end)
        slope = quality(mesh, self.mesh, self.case.quality_metric, derivative=True, p=p).derivative
        assert slope is not None
        if name == "min":
            return Constraint(slope.minimum, slope.of_minimum, start, end)
        return Constraint(slope.mean, slope.of_mean, start, end)

    def _relax_from_rest(self, targets: list[FloatArray]) -> None:
        """Take the coefficients of relaxation from the second design: the first one has none."""
        *before, last = self._steps
        if len(targets) > 1:
            last.forget(RELAXING)
            self._run(targets[1])
            return
        self._steps = (*before, replace(last, setup=last.setup.at_step(False)))
        text = "nothing is relaxed: the reference has no displacement; give `displacements`"
        self.messages += (note(text),)

    def as_run(self) -> FloatArray | None:
        """Return the points (n, d) that ``sv.deform`` gives at the reference, to the bit.

        None where a system is nearly singular: the deformer solves it with more digits than a run.
        Of several zones, nodes that follow others are equal to them up to rounding.
        """
        if self._zones:
            out = self.mesh.points.copy()
            for zone in self._zones:
                points = zone.deformer.as_run()
                if points is None:
                    return None
                out[zone.points] = points
            return out
        return self._as_run

    @check_types
    def refresh(self, displacement: FloatArray) -> Deformer:
        """Return a deformer that is made anew with another displacement, (m, d) or (k, m, d)."""
        return Deformer(self.mesh, self.case, displacement)

    def _checked(
        self, vectors: FloatArray, name: str, shape: tuple[int, ...] | None = None
    ) -> FloatArray:
        """Return ``vectors`` as float64 of ``shape`` (n, d), or (k, n, d); by default of designs.

        Raises CaseError if they have another shape, or numbers that are not finite.
        """
        shape = shape or self.displacement.shape
        out = np.asarray(vectors, np.float64)
        if out.shape[-2:] != shape or out.ndim not in (2, 3):
            raise CaseError(
                f"{name} has the shape {out.shape}; expected {shape}, a row for each node, or "
                f"(k, {shape[0]}, {shape[1]}) for k of them"
            )
        if not np.isfinite(out).all():
            raise CaseError(f"{name} has numbers that are not finite")
        return out

    def _run(self, target: Array) -> list[StepState]:
        """Return the state after each step; ``target`` (..., a, d) by `KnownNodeMap.target`."""
        states = [StepState(self._setup.coords)]
        for step in self._steps:
            states.append(step.run(states[-1], target))
        return states[1:]

    def _deformed(self, displacement: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points (..., n, d), errors and error estimates (...,) of designs (..., m, d).

        The largest error at the boundary, and the estimate between boundary nodes as of a
        ``Solution``. Raises DeformError where a result cannot be right or images are displaced
        differently.
        """
        if displacement.ndim == 2:
            target = value(self._input.target(displacement))
            states = self._run(target)
            error_estimate = np.max([state.number("error_estimate") for state in states], axis=0)
            return value(states[-1].points), self._checks.errors(target, states), error_estimate
        points = np.empty((len(displacement), *self.mesh.points.shape))
        alone = self.mesh.halo is not None or self._setup.relaxation is not None
        if len(self._steps) > 1 or alone:
            errors, error_estimate = np.empty((2, len(points)))
            for k, each in enumerate(displacement):
                points[k], errors[k], error_estimate[k] = self._deformed(each)
            return points, errors, error_estimate
        estimates = [
            self._together(displacement[first : first + TOGETHER], points[first : first + TOGETHER])
            for first in range(0, len(points), TOGETHER)
        ]
        errors, error_estimate = np.concatenate([np.empty((2, 0)), *estimates], axis=1)
        return points, errors, error_estimate

    def _together(self, displacement: FloatArray, out: FloatArray) -> FloatArray:
        """Write the points of k designs (k, m, d) to ``out`` (k, n, d), deformed in one step.

        Returns their errors and error estimates, (2, k). Raises as `_deformed`.
        """
        setup = self._setup
        (step,) = self._steps
        targets = value(self._input.target(displacement))
        state = step.moved(StepState(setup.coords), targets, out)
        errors = np.maximum(self._checks.off_track(out), state.number("max_error"))
        self._checks.require_sound(1, 1.0, targets, state)
        one, two = setup.images.T
        apart = (out[:, two] - out[:, one]) - (setup.coords[two] - setup.coords[one])
        alike = np.abs(apart).max(initial=0.0) <= FAR * largest_coordinate(self.mesh.points)
        to_points(setup.frame, out, setup.coords, self.mesh.points)
        for points in out[:0] if alike else out:
            self._checks.require_alike(points)
        return np.stack([errors, np.broadcast_to(state.number("error_estimate"), errors.shape)])

    def _joined(self, design: Array, work: Work) -> Array:
        return over_zones(self._zones, self.mesh.points, design, work)

    def _points(self, design: Array) -> Array:
        """Return the points (n, d) of a design (m, d)."""
        if self._zones:
            return self._joined(design, Deformer._points)
        return self._run(self._input.target(design))[-1].points

    def _taped(self, displacement: FloatArray) -> tuple[Variable, Variable]:
        """Return a design (m, d) and its points as variables of a tape."""
        design = self._checked(displacement, "displacement")
        if design.ndim == 3:
            raise CaseError(
                "derivatives are taken at one displacement; call it for each displacement"
            )
        start = Tape().variable(design)
        end = self._points(start)
        assert isinstance(end, Variable)
        return start, end
