"""The deformer: a deformation prepared once, for many displacements, with exact derivatives."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from slideviz.argument_types import check_types, record
from slideviz.case.displacement import Displacements
from slideviz.case.keys import automatic_radius
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.case.moving_nodes import ROUNDING, moving_nodes
from slideviz.case.words import counted, wrong_by
from slideviz.design.frozen_step import REMEDY, FrozenStep, StepState, choose_steps
from slideviz.errors import (
    CaseError,
    ConditionWarning,
    DeformError,
    Message,
    Remark,
    SlidevizError,
    ToleranceWarning,
    UnsoundError,
    not_one_of,
    note,
)
from slideviz.mesh.interfaces import disjoint_interfaces, torn_interfaces
from slideviz.mesh.model import (
    Assembly,
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    frozen_array,
    largest_coordinate,
    largest_norm,
    places_in,
    row_norms,
    row_numbers,
)
from slideviz.mesh.periodic import TOLERANCE
from slideviz.mesh.quality import quality
from slideviz.mesh.quality_derivative import smooth_margin
from slideviz.rbf.images import FAR, ImageDisplacements, largest_misfit, misfits
from slideviz.rbf.loops import farthest, to_points
from slideviz.rbf.operations import difference_from, flat
from slideviz.rbf.problem import StepSolution
from slideviz.rbf.refine import NOTED, TRUSTED
from slideviz.rbf.tape import Array, Tape, Variable, put, take, transform, value
from slideviz.solver.growth import GROWTH, HOPELESS, unsoundness, wall_warnings
from slideviz.solver.interface_motion import InterfaceMotion
from slideviz.solver.prepare import Prepared, beginning_with, prepare
from slideviz.solver.prescribed import displaced, support_radius
from slideviz.solver.setup import AUTO_TOLERANCE, Setup, make_setup
from slideviz.solver.steps import Report

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
    errors: FloatArray, allowed: FloatArray, reference: BoolArray, *, reduced: bool
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


@record
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
            largest = part * largest_norm(target)
            reach = max(largest, part * self.least)
            if far[k] > GROWTH * reach or lost[k] > HOPELESS * largest:
                solution = StepSolution(
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
        # Below this it is rounding, without a closer look; not <=, so that NaN is looked at.
        if not gaps.max() <= FAR * largest_coordinate(self.mesh.points):
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
            gap = row_norms(tracks.tracks[index].nearest(at, guess)[0] - at)
            off = np.maximum(off, gap.reshape(*off.shape, -1).max(axis=-1))
        return off

    def tolerance(self, designs: FloatArray) -> FloatArray:
        """Return the allowed error of each design, (...,), in the mesh's length unit.

        The tolerance of the data reduction, or a part of the largest displacement of ``designs``
        (..., m, d).
        """
        if self.setup.reduction is not None:
            return np.full(designs.shape[:-2], self.setup.reduction.tolerance)
        largest = row_norms(designs).max(axis=-1, initial=0.0)
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
    gaps = row_norms(ends)
    gaps = gaps[gaps > 0.0]
    return float(np.median(gaps)) if len(gaps) else 0.0


Work = Callable[["Deformer", Array], Array]
"""Returns the points (..., n_z, d) of a zone from its deformer and displacements (..., m_z, d)."""


@record
class ZoneDesign:
    """The deformer of a zone, as a part of that of all zones."""

    number: int  # of the zone, from 1
    points: IntArray  # (n_z,): its points in the mesh of all zones
    rows: IntArray
    """(m_z,): for each of its moving nodes the row of the design that it goes by, which of one that
    follows another zone is that of the other node; -1 where there is none."""
    led: IntArray
    leaders: IntArray
    """`led`, `leaders` (f,): moving nodes that follow sliding nodes of zones before it, by their
    place among its own, and the nodes that they follow, by their number in the mesh."""
    deformer: Deformer

    @property
    def messages(self) -> tuple[Message, ...]:
        """Return the messages of its deformer, with the number of the zone."""
        return SlidevizError(*self.deformer.messages).within(f"zone {self.number}")

    def moved(self, design: Array, points: Array, start: FloatArray) -> Array:
        """Return the displacements (..., m_z, d) of its moving nodes, from those of a design.

        ``design`` (..., m, d). ``points`` (..., n, d): of all zones, those before it deformed,
        which were at ``start`` (n, d).
        """
        shift = take(points, self.leaders) - start[self.leaders]
        return put(zone_rows(self.rows, design), self.led, shift, overwrite=True)


def zone_rows(rows: IntArray, design: Array) -> Array:
    """Return rows (..., m_z, d) of a design (..., m, d), as `ZoneDesign.rows` has them."""
    moved = np.flatnonzero(rows >= 0)
    nothing = np.zeros((len(rows), value(design).shape[-1]))
    return put(nothing, moved, take(design, rows[moved]))


def zone_designs(
    prepared: Prepared,
    mesh: Assembly,
    nodes: IntArray,
    references: FloatArray,
    make: Callable[[Mesh, Case, FloatArray], Deformer],
) -> tuple[ZoneDesign, ...]:
    """Return the designs of the zones that move, in the order in which a run deforms them.

    ``nodes`` (m,): the nodes of the design. ``references`` (k, m, d): the designs to choose control
    nodes for. ``make`` returns a deformer for a zone, its case and its designs.
    """
    motion = InterfaceMotion(prepared, mesh)
    designs = list[ZoneDesign]()
    shared = np.concatenate([nodes[:0], *(each.nodes for each in motion.interfaces)])
    shift = np.zeros((len(references), *mesh.points.shape))
    deformed = np.zeros(len(mesh.points), bool)
    for index, ahead in motion.leaders_first():
        part = mesh.parts[index]
        own = motion.cases[index]
        points = np.arange(part.points.start, part.points.stop)
        mine = part.mesh.nodes_of(own.markers_with("moving")) + part.points.start
        leaders = motion.leader[mine]
        rows = places_in(nodes, leaders)
        # Rims that are kept on walls go otherwise than the design says.
        follows = motion.led[mine] & ((rows < 0) | (own.rims == "slide") & deformed[leaders])
        rows[follows] = -1
        led = np.flatnonzero(follows)
        leaders = leaders[led]
        asked = value(zone_rows(rows, references))
        asked[:, led] = shift[:, leaders]
        deformer = make(part.mesh, own, asked)
        deformed[points] = True
        designs.append(ZoneDesign(index + 1, points, rows, led, leaders, deformer))
        at = np.intersect1d(points, shared)
        for k, each in enumerate(asked if len(at) and ahead else ()):
            run = None if k else deformer.as_run()
            there = deformer._deformed(each)[0] if run is None else run
            shift[k, at] = there[at - points[0]] - mesh.points[at]
        moved = np.zeros_like(part.mesh.points)
        farthest = np.linalg.norm(shift[:, at], axis=2).argmax(axis=0)
        moved[at - points[0]] = shift[farthest, at]
        moving = np.flatnonzero(moved.any(axis=1))
        if not len(moving):  # at rest: other designs move all that is not fixed
            moving = np.setdiff1d(points - points[0], deformer._setup.classes.fixed)
        motion.slid(index, moved, moving, ahead)
    return tuple(designs)


@record
class KnownNodeMap:
    """The map from the displacement of the moving nodes to that of the known nodes."""

    mesh: Mesh
    setup: Setup
    nodes: IntArray  # (m,): the moving nodes, ascending
    points: FloatArray
    """(s, d): the sources, undeformed: nodes whose displacement all their periodic images have."""
    rows: IntArray
    turn: FloatArray | None
    """`rows`, `turn` (s,) int64, (s, d, d) float64 or None: the moving node, by its place in
    ``nodes``, whose displacement each source has, and the rotation of it (None: none is rotated).
    They differ for copies in a halo."""
    known: IntArray
    source: IntArray
    """`known`, `source` (k,): known nodes that move, by their place in ``setup.known``, and the
    source that each follows."""
    others: IntArray
    followed: IntArray
    """`others`, `followed` (o,): moving nodes that are not sources, by their place in ``nodes``,
    and the source that each must follow."""

    def target(self, vectors: Array) -> Array:
        """Return the displacement (..., a, d) of the known nodes, in the frame.

        From that of the moving nodes, ``vectors`` (..., m, d), Cartesian. Raises DeformError where
        images, or copies in a halo and their originals, are displaced differently.
        """
        setup = self.setup
        shift = take(vectors, self.rows)
        if self.turn is not None:
            shift = transform(self.turn, shift)
        moved = difference_from(setup.frame, self.points, shift)
        self._require_alike(value(vectors), value(moved))
        shape = (len(setup.known), self.mesh.dim)
        return put(np.zeros(shape), self.known, take(moved, self.source))

    def _require_alike(self, vectors: FloatArray, moved: FloatArray) -> None:
        """Raise DeformError where images, or copies and their originals, are displaced differently.

        ``vectors`` and ``moved`` (..., m, d), (..., s, d): Cartesian displacements of the moving
        nodes, and those of the sources in the frame.
        """
        setup = self.setup
        mesh = self.mesh
        if len(self.others):
            shift = vectors[..., self.others, :]
            follow = difference_from(setup.frame, mesh.points[self.nodes[self.others]], shift)
            gap = np.abs(value(follow) - moved[..., self.followed, :])
            largest = row_norms(moved).max(axis=-1, initial=0.0)
            allowed = TOLERANCE * largest + ROUNDING * largest_coordinate(self.mesh.points)
            if (gap.max(axis=(-1, -2)) > allowed).any():
                self._refuse(vectors)
        if mesh.halo is not None:
            self._refuse(vectors)

    def _refuse(self, vectors: FloatArray) -> None:
        setup = self.setup
        mesh = self.mesh
        for each in vectors.reshape(-1, *vectors.shape[-2:]):
            moved = displaced(Displacements(self.nodes, each), mesh)
            there = setup.frame.difference(mesh.points[moved.nodes], moved.vectors)
            largest = largest_norm(there)
            allowed = TOLERANCE * largest + ROUNDING * largest_coordinate(self.mesh.points)
            ImageDisplacements(moved.nodes, there, setup.classes.representative).require_alike(
                allowed
            )


def known_node_map(mesh: Mesh, setup: Setup, asked: Displacements) -> KnownNodeMap:
    """Return the map from the displacement of the moving nodes to that of the known nodes.

    Raises CaseError if a moving node in a halo is a copy of a node that does not move.
    """
    moved = displaced(asked, mesh)
    spread = ImageDisplacements(moved.nodes, moved.vectors, setup.classes.representative)
    of_known = spread.source(setup.known)
    known = np.flatnonzero(of_known >= 0)
    nodes, place = np.unique(of_known[known], return_inverse=True)
    given = nodes.copy()
    turn = None
    if mesh.halo is not None:
        turn = np.tile(np.eye(mesh.dim), (len(nodes), 1, 1))
        row = row_numbers(len(mesh.points), mesh.halo.receivers)
        copies = row[nodes] >= 0
        given[copies] = mesh.halo.donors[row[nodes[copies]]]
        turn[copies] = mesh.halo.rotations[row[nodes[copies]]]
    rows = np.searchsorted(asked.nodes, given)
    inside = np.isin(given, asked.nodes)
    if not inside.all():
        raise CaseError(
            f"{mesh.name}: node {nodes[~inside][0]} is a copy of node {given[~inside][0]}, which "
            "is on no moving marker; give both the same role"
        )
    lead = spread.source(moved.nodes)
    others = np.flatnonzero(lead != moved.nodes)
    return KnownNodeMap(
        mesh,
        setup,
        asked.nodes,
        frozen_array(mesh.points[nodes]),
        rows,
        turn,
        known,
        place,
        np.searchsorted(asked.nodes, moved.nodes[others]) if mesh.halo is None else others[:0],
        np.searchsorted(nodes, lead[others]) if mesh.halo is None else others[:0],
    )


TOGETHER = 128
"""Designs that are deformed together, so that each radial function is computed once for all."""


CONSTRAINTS = ("min", "mean", "margin")
"""The numbers of a mesh that have derivatives: names of `slideviz.case.limits.NUMBERS`."""


@record
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
        reference: Mesh | None = None,
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
        reference
            The undeformed mesh, if ``mesh`` was deformed from it, as of `slideviz.deform`.

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
        prepared = prepare(case, mesh if reference is None else mesh.with_reference(reference))
        with beginning_with(prepared.doubts):
            self._choose(prepared, left_out, displacements, progress)

    def _choose(
        self,
        prepared: Prepared,
        left_out: tuple[Remark, ...],
        displacements: FloatArray | None,
        progress: Report | None,
    ) -> None:
        """Choose all that designs have in common; as the constructor."""
        case = prepared.case
        mesh = prepared.mesh
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
            self.messages = (
                *prepared.alone.warnings,
                *left_out,
                *disjoint_interfaces(mesh, case.interfaces),
                *(text for zone in self._zones for text in zone.messages),
                *torn_interfaces(mesh, self.deform(references[0]), case.interfaces),
            )
            return
        sizes = np.linalg.norm(references, axis=2).max(axis=1, initial=0.0)
        most = Displacements(asked.nodes, references[int(np.argmax(sizes))], asked.warnings)
        held = _with_common_radius(case, mesh, asked, references)
        setup = make_setup(Prepared(held, mesh), displaced(most, mesh)).converging()
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

    def as_run(self) -> FloatArray | None:
        """Return the points (n, d) that ``sv.deform`` gives at the reference, to the bit.

        That is with ``converged=True``, if the mesh is relaxed.
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

    def setups(self) -> tuple[tuple[IntArray, Setup], ...]:
        """Return the points (z,) of each zone that moves, and its setup."""
        if self._zones:
            return tuple((zone.points, zone.deformer._setup) for zone in self._zones)
        return ((np.arange(len(self.mesh.points)), self._setup),)

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
        ``StepSolution``. Raises DeformError where a result cannot be right or images are displaced
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
        """Return the points (..., n, d) of all zones, each by ``work`` after those it follows.

        A zone that stays is undeformed. ``design`` (..., m, d).
        """
        start = self.mesh.points
        out: Array = start
        for zone in self._zones:
            out = put(out, zone.points, work(zone.deformer, zone.moved(design, out, start)))
        return out

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


def _with_common_radius(
    case: Case, mesh: Mesh, asked: Displacements, references: FloatArray
) -> Case:
    """Return the case with a support radius for several designs (k, m, d), if it is automatic."""
    if not automatic_radius(case) or len(references) < 2:
        return case
    far = np.linalg.norm(references, axis=2).argmax(axis=0)
    widest = references[far, np.arange(len(asked.nodes))]
    together = Displacements(asked.nodes, widest, asked.warnings)
    return case.change(support_radius=support_radius(case, mesh, together))
