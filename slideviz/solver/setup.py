"""The setup of a deformation: its domain, what is prescribed on it, and what a step needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cached_property, partial, reduce
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import record
from slideviz.baselines.idw import Weights, deform_idw
from slideviz.case.check import file_before_motions, idle_settings, motion_doubts
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.motions.span import moves_over_span
from slideviz.case.spans import span_field
from slideviz.errors import Message, note
from slideviz.machine.span import Span
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import (
    NO_NODES,
    FloatArray,
    IntArray,
    Mesh,
    Skin,
    largest_norm,
    mask_of,
    row_norms,
    row_numbers,
)
from slideviz.mesh.topology import TINY
from slideviz.mesh.zones import require_one_zone
from slideviz.rbf.classify import Classes, directions
from slideviz.rbf.evaluate import Basis
from slideviz.rbf.frames import Frame, hold_on_axis
from slideviz.rbf.frames import corners as corners_of
from slideviz.rbf.layers import LayerZone
from slideviz.rbf.methods import SLIDING_METHODS
from slideviz.rbf.operations import add_displacement
from slideviz.rbf.problem import PhaseTimer, Problem, StepSolution
from slideviz.rbf.projection import Tracks, find_tracks
from slideviz.rbf.reduction import Reduction
from slideviz.rbf.rims import Keep, Rims
from slideviz.rbf.tape import (
    Array,
    Variable,
    add,
    cross,
    function,
    gather,
    inverse,
    join,
    length,
    multiply,
    put,
    take,
    transform,
    unit,
    value,
)
from slideviz.solver.domain import Domain, find_domain
from slideviz.solver.layers import layer_zone, thickness_warnings
from slideviz.solver.prepare import Prepared
from slideviz.solver.prescribed import (
    BoundaryConditions,
    fitted_radius,
    prescribe,
    support_radius,
)
from slideviz.solver.rims import find_rims
from slideviz.system.device import Place, choose_place, free_on_card
from slideviz.system.platform import free_memory
from slideviz.terms import KERNELS, NOT_WALLS

if TYPE_CHECKING:
    from slideviz.elastic.conditions import Body
    from slideviz.elastic.relaxation import Relaxation
    from slideviz.elastic.stiffness import Stiffness


EXACT_NODES = 2000
"""Most candidates with which DATA_REDUCTION= AUTO makes all of them control nodes. The text in
`slideviz.case.keys` has this number and the next in words."""

SYSTEM_BYTES = 24.0
"""Memory of a system, over the square of its unknowns: matrix, factor, and what a product takes."""

AUTO_TOLERANCE = 1e-3
"""The tolerance of DATA_REDUCTION= AUTO, as a part of the largest displacement."""

LAYER = 0.5
"""Largest tolerance of DATA_REDUCTION= AUTO, as a part of the smallest distance between a moving
node and a sliding one beside it (`sliding_gap`). The tolerance is an error of where nodes slide to,
which no correction takes back: above half of that distance, cells between both may be inverted."""

SMALLEST = 1e-7
"""Smallest tolerance of DATA_REDUCTION= AUTO, as a part of the largest displacement: below it
nearly all candidates are chosen, at a higher cost than that of all at once."""

RELAXED_CELLS = 1_000_000  # most cells of a mesh that RELAX= AUTO relaxes

ON_TRACK = 1e-6  # most distance of a node from the wall it slid along, over the extent

LOOSE = 0.1  # a tolerance above this part of the largest displacement gets a warning


def sliding_gap(points: FloatArray, facets: IntArray, classes: Classes) -> float:
    """Return the smallest distance between a moving and a sliding node on one edge; or inf.

    ``points`` (n, d).
    ``facets`` (f, k): of the boundary, so that a streamed mesh has the same.
    """
    moving = mask_of(len(points), classes.moving)
    sliding = mask_of(len(points), classes.sliding)
    near = facets[moving[facets].any(axis=1) & sliding[facets].any(axis=1)]
    ends = np.stack([near, np.roll(near, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends = np.concatenate([ends, ends[:, ::-1]])
    one, two = ends[moving[ends[:, 0]] & sliding[ends[:, 1]]].T
    gaps = row_norms(points[one] - points[two])
    return float(gaps[gaps > 0.0].min(initial=np.inf))


def needed_by_layers(reduction: Reduction | None, gap: float) -> float:
    """Return the tolerance that layers need where that of the reduction is larger; else 0."""
    return LAYER * gap if reduction is not None and reduction.tolerance > LAYER * gap else 0.0


def most_exact(case: Case, dim: int, place: Place) -> int:
    """Return the most candidates with which DATA_REDUCTION= AUTO takes all of them.

    On a card, as many as its memory and the host's have room for, in dimension ``dim``.
    """
    if place == "cpu":
        return EXACT_NODES
    unknowns = sqrt(min(free_on_card(), free_memory()) / SYSTEM_BYTES)
    return max(EXACT_NODES, int(unknowns / (dim if case.sliding == "ds" else 1)))


def find_reduction(
    case: Case,
    extent: float,
    largest: float,
    candidates: int,
    gap: float,
    exact_nodes: int,
) -> Reduction | None:
    """Return the settings of the selection of control nodes; None where all candidates are taken.

    ``extent`` and ``largest``: the extent of the mesh, and the largest displacement.
    ``candidates``: nodes that could be control nodes.
    ``gap``: the smallest distance between a moving and a sliding node (`sliding_gap`).
    ``exact_nodes``: most candidates that AUTO takes without a selection (`most_exact`).
    """
    reduction = case.reduction
    if reduction is None or case.method != "rbf":
        return None
    if not reduction.auto:
        tolerance = reduction.relative * extent if reduction.relative else reduction.tolerance
    elif candidates <= exact_nodes or not largest > 0.0:
        return None
    else:
        tolerance = max(min(AUTO_TOLERANCE * largest, LAYER * gap), SMALLEST * largest)
    return replace(reduction, tolerance=tolerance, relative=None, auto=False)


def loose_warnings(
    case: Case, reduction: Reduction | None, largest: float, extent: float, gap: float
) -> list[str]:
    """Return a warning where the tolerance is too large for the motion, or AUTO's for layers."""
    if reduction is None or not largest > 0.0:
        return []
    assert case.reduction is not None
    if case.reduction.auto and (needed := needed_by_layers(reduction, gap)):
        sentence = (
            f"the layer between moving and sliding nodes ({gap:.3g}) is too thin for the tolerance "
            f"of DATA_REDUCTION= AUTO ({reduction.tolerance:.3g}, {SMALLEST:g} of the largest "
            "displacement); cells there may invert; use DATA_REDUCTION= NO, or YES with "
            f"DATA_RED_TOLERANCE= {needed:.2g}"
        )
        return [sentence]
    if reduction.tolerance <= LOOSE * largest:
        return []
    absolute = f"{largest / 100:.2g}"
    relative = f"{largest / extent / 100:.2g}"
    remedy = f"use DATA_RED_RELATIVE= {relative} or less"
    if not case.reduction.relative:
        remedy = f"use DATA_RED_TOLERANCE= {absolute} or less (or DATA_RED_RELATIVE= {relative})"
    is_ = "not below"
    so = "no control node is needed to meet it, and only the cells"
    if reduction.tolerance < largest:
        is_ = "more than a tenth of"
        so = "control nodes follow the motion roughly, and the cells"
    sentence = (
        f"the tolerance of the data reduction is {reduction.tolerance:.3g}, {is_} the largest "
        f"displacement, {largest:.3g}: {so} near the boundary absorb the rest, which may invert "
        f"them; {remedy}, a hundredth of the displacement"
    )
    return [sentence]


@record
class Setup(Domain):
    """A domain, its prescribed displacements, and the data that are the same in all steps."""

    known: IntArray  # (a,): moving and fixed nodes
    target: FloatArray  # (a, d): their displacement in the frame after the last step
    basis: Basis
    candidates: int  # nodes that could be control nodes; periodic images count as one
    reduction: Reduction | None
    """Settings of the greedy selection; None: all candidates are control nodes."""
    layers: float  # as of a ``Step``
    tracks: Tracks  # the edges and surfaces along which nodes slide
    span: Span | None  # along which blades move; None: they do not
    solve: Callable[[Problem, PhaseTimer], StepSolution]  # of a step, by the method of the case
    zone: LayerZone | None  # the nodes that go with walls (LAYERS); None: there are none
    minimum_gap: float  # of the case, below which layers give way
    rims: Rims | None  # nodes that moving boundaries share with walls; None: there are none
    fitted_radius: float  # the support radius that fits the motion, whatever the case says
    relaxation: Relaxation | None = None
    """What relaxes the last step; None where RELAX has no effect."""

    def at_step(self, is_last: bool) -> Setup:
        """Return the setup of a step: only the last one is relaxed.

        Where its energy is least does not depend on the way, so relaxing once is enough.
        """
        return self if is_last or self.relaxation is None else replace(self, relaxation=None)

    def converging(self) -> Setup:
        """Return the setup with which relaxation goes on until only rounding is left."""
        if self.relaxation is None:
            return self
        return replace(self, relaxation=replace(self.relaxation, converged=True))

    @property
    def rigid(self) -> IntArray:
        """Return the nodes (r,) that walls carry nearly alone."""
        return self.known[:0] if self.zone is None else self.zone.rigid

    @cached_property
    def largest(self) -> float:
        """Return the largest displacement that is asked for, in the frame."""
        return largest_norm(self.target)

    @cached_property
    def copies(self) -> IntArray:
        """Return the halo's pairs (k,) whose copies follow their donors.

        Periodic images move alike in the frame already; by a rotation of the halo, which differs a
        little from the period, or from where files with few digits put them, they would not.
        """
        halo = self.halo
        outside = halo is not None and ~np.isin(halo.receivers, self.images)
        return np.flatnonzero(outside)

    def goal(self, target: Array, part: float, keep: Keep | None = None) -> Array:
        """Return the coordinates (..., a, d) of known nodes after a part of their displacement.

        With the rims on their walls (RIMS= SLIDE) after each part, where walls are curved, too.
        ``target`` (..., a, d): the whole displacement, in the frame.
        ``keep``: of derivatives, as of `Rims.projected`.
        """
        goal = add_displacement(self.coords[self.known], multiply(target, np.array([[part]])))
        if self.rims is None:
            return goal
        rows = np.arange(len(self.rims.nodes))  # known nodes begin with those that move
        moving = take(goal, rows)
        kept = self.rims.projected(moving, keep)
        return goal if kept is moving else put(goal, rows, kept)

    def constraints(self, coords: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return nodes (q,) and unit normals (q, d) along which sliding nodes may not move.

        A node has a row for each of its normals; nodes on the axis come last, with axes of the
        frame instead (`hold_on_axis`). Of periodic images only the representative has any. Where
        no boundary is curved, the normals are those of the undeformed mesh, so that flat
        boundaries stay flat to the bit; else those at ``coords`` (n, d).
        """
        normals_of_fans = self.normals_at(coords) if self.tracks.curved else self.normals
        nodes, normals = directions(self.classes, normals_of_fans)
        once = self.once(nodes)
        return hold_on_axis(nodes[once], value(normals)[once], self.axis)[:2]

    def project(self, coords: FloatArray, nodes: IntArray, free: FloatArray) -> FloatArray:
        """Return the displacements (m, d) after which nodes are on their edge or surface.

        Nodes on the axis stay on it, and in place where another surface meets it.
        ``coords`` (n, d): coordinates of all nodes before the step.
        ``nodes`` (m,): sliding nodes.
        ``free`` (m, d): their displacements in the step, which may lead off the boundary.
        """
        out = self.tracks.project(coords, nodes, free)
        copy, origin, turn = self.ties(nodes)
        out[copy] = np.einsum("hij,hj->hi", turn, out[origin])
        out[self.axis[nodes], :2] = 0.0
        out[np.isin(nodes, self.held)] = 0.0
        return out

    def ties(self, nodes: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return copies among ``nodes``, the nodes that they follow, both as places, and rotations.

        Rotations (t, d, d) turn displacements of the latter into those of the copies, in the frame.
        """
        halo = self.halo
        d = self.coords.shape[1]
        if halo is None:
            return NO_NODES, NO_NODES, np.empty((0, d, d))
        row = row_numbers(len(self.coords), nodes)
        copy = row[halo.receivers]
        origin = row[halo.donors]
        both = (copy >= 0) & (origin >= 0)
        turn = halo.rotations[both]
        if self.frame.cylindrical:
            turn = np.broadcast_to(np.eye(d), turn.shape)
        return copy[both], origin[both], turn


def make_setup(prepared: Prepared, moved: Displacements | None = None) -> Setup:
    """Return the setup of a deformation: all that stays the same over its steps.

    Raises MeshError if periodic markers do not match, a marker element is not a side of a cell, or
    a coordinate is not finite, or too large to compute with, and DeformError if no node is moving
    or fixed, or periodic images are asked to move differently.
    ``moved``: displacements of moving nodes, as ``displaced`` returns them; None: by the case's
    motions.
    """
    case = prepared.case
    mesh = prepared.mesh
    require_one_zone(mesh, "a setup")
    domain = find_domain(case, mesh)
    rims = find_rims(case, mesh, domain)
    return setup_of(case, mesh, domain, prescribe(case, mesh, domain, moved, rims), rims)


def setup_of(
    case: Case,
    mesh: Mesh,
    domain: Domain,
    conditions: BoundaryConditions,
    rims: Rims | None = None,
) -> Setup:
    """Return the setup of a deformation of a domain for what is prescribed on it."""
    case = case.change(roles=domain.roles)
    candidates = _candidates(domain.classes, conditions.known)
    gap = sliding_gap(mesh.points, domain.boundary.facets, domain.classes)
    place = choose_place(case.device if case.method == "rbf" else "cpu")
    most = most_exact(case, mesh.dim, place)
    reduction = find_reduction(case, mesh.extent, conditions.largest, candidates, gap, most)
    loose = loose_warnings(case, reduction, conditions.largest, mesh.extent, gap)
    frame = domain.frame
    coords = domain.coords
    axis = domain.axis
    span = span_field(case, mesh) if moves_over_span(case) else None
    undeformed = domain if mesh.reference is None else find_domain(case, mesh.reference)

    def tracks_of(coords: FloatArray) -> Tracks:
        return find_tracks(
            domain.boundary,
            domain.fans,
            domain.classes,
            lambda nodes: corners_of(coords, nodes, axis),
            roles=case.roles,
            feature_angle_deg=case.feature_angle_deg,
            shift=frame.shift() if case.periodic in ("fixed", "moving") and domain.pairs else None,
            holes=domain.boundary.facets[:0] if span is None else span.holes,
        )

    tracks = tracks_of(undeformed.coords)
    if undeformed is not domain and tracks.farthest(coords) > ON_TRACK * mesh.extent:
        tracks = tracks_of(coords)  # walls that were moved themselves
    warnings = (
        *domain.warnings,
        *conditions.warnings,
        *loose,
        *idle_settings(case),
        *file_before_motions(case),
        *motion_doubts(case, mesh),
    )
    zone = layer_zone(case, mesh.undeformed, undeformed, conditions.known)
    thickness = thickness_warnings(case, mesh.undeformed, undeformed, zone)
    warnings += (*_not_relaxed(case, mesh), *thickness)
    of_domain = {each.name: getattr(domain, each.name) for each in fields(domain)}
    angle = frame.period if frame.cylindrical else 0.0
    return Setup(
        **of_domain | {"warnings": warnings},
        known=conditions.known,
        target=conditions.target,
        basis=Basis(
            support_radius(case, mesh, conditions.moved),
            angle,
            case.kernel,
            polynomial=case.polynomial == "yes" and not KERNELS[case.kernel].polynomial,
            place=place,
        ),
        candidates=candidates,
        reduction=reduction,
        layers=needed_by_layers(reduction, gap),
        tracks=tracks,
        span=span,
        solve=_method(case, mesh, frame, axis),
        zone=zone,
        minimum_gap=case.layer_minimum_gap,
        rims=rims,
        fitted_radius=fitted_radius(case, mesh, conditions.moved),
        relaxation=relaxation_of(case, mesh, frame, axis),
    )


def _method(
    case: Case, mesh: Mesh, frame: Frame, axis: np.ndarray
) -> Callable[[Problem, PhaseTimer], StepSolution]:
    if case.method == "idw":
        weights = Weights(case.idw_power or float(mesh.dim), case.idw_fixed_weight)
        return partial(deform_idw, weights=weights)
    if case.method == "elastic":
        # Late: scikit-fem and pyamg take 0.2 s.
        from slideviz.elastic.linear import deform_elastic

        body = replace(elastic_body(mesh, frame, axis), stiffness=stiffness_of(case, mesh))
        return partial(deform_elastic, body=body)
    return SLIDING_METHODS[case.sliding]


def stiffness_of(case: Case, mesh: Mesh) -> Stiffness:
    """Return how stiff the cells of an elastic body are."""
    # Late: scikit-fem and pyamg take 0.2 s.
    from slideviz.elastic.stiffness import Stiffness

    walls = []
    for name in mesh.marker_names:
        role = case.roles.get(name, "fixed")
        is_wall = not any(word in name.lower() for word in NOT_WALLS)
        if role == "moving" or (role == "fixed" and is_wall):
            walls.append(name)
    return Stiffness(case.deform_stiffness_type, case.deform_coeff, mesh.nodes_of(walls))


def _not_relaxed(case: Case, mesh: Mesh) -> tuple[Message, ...]:
    """Return the note that RELAX= AUTO relaxes no such mesh."""
    if case.relax == "no":
        return ()
    if case.method != "rbf":
        return (
            note(
                f"METHOD= {case.method} is not relaxed; RELAX= AUTO relaxes with METHOD= rbf only"
            ),
        )
    if isinstance(mesh, Skin):
        return (note("RELAX= AUTO does not relax a streamed mesh"),)
    if case.relax == "auto" and len(mesh.cells) > RELAXED_CELLS:
        return (
            note(
                f"RELAX= AUTO does not relax a mesh of more than {RELAXED_CELLS:,} cells; YES does"
            ),
        )
    return ()


def relaxes(case: Case, mesh: Mesh) -> bool:
    """Return whether RELAX acts on a mesh."""
    return case.relax != "no" and not _not_relaxed(case, mesh)


def relaxation_of(case: Case, mesh: Mesh, frame: Frame, axis: np.ndarray) -> Relaxation | None:
    """Return the relaxation of a case's steps; None where they are not relaxed."""
    if not relaxes(case, mesh):
        return None
    # Late: scikit-fem and pyamg take 0.2 s.
    from slideviz.elastic.relaxation import Relaxation

    body = elastic_body(mesh, frame, axis)
    return Relaxation(mesh.undeformed, without_halo(mesh.undeformed)[0], body)


def elastic_body(mesh: Mesh, frame: Frame, axis: np.ndarray) -> Body:
    """Return the mesh as an elastic body, without its halo."""
    # Late: scikit-fem and pyamg take 0.2 s.
    from slideviz.elastic.conditions import Body
    from slideviz.elastic.stiffness import blocks

    return Body(blocks(without_halo(mesh)[0].cells), frame, axis)


def _candidates(classes: Classes, known: IntArray) -> int:
    """Return how many nodes could be control nodes, images once; ``known`` (a,): not sliding."""
    nodes = np.concatenate([known, classes.edge, classes.surface])
    return int((classes.representative[nodes] == nodes).sum())


TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""Rotates the direction of a segment (2D) into its normal."""


def sliding_normals(setup: Setup, coords: Array) -> tuple[IntArray, Array]:
    """Return nodes (q,) and unit normals (q, d) like ``Setup.constraints``, on a tape."""
    nodes, at = setup.constraints(value(coords))
    if not (setup.tracks.curved and isinstance(coords, Variable)) or not len(nodes):
        return nodes, at
    owner, along = directions(setup.classes, _fan_normals(setup, coords))
    # Nodes on the axis have directions of their own, which do not turn.
    turning = setup.once(owner) & ~setup.axis[owner]
    found = take(along, np.flatnonzero(turning))
    count = len(value(found))
    return nodes, join(found, at[count:]) if count < len(at) else found


def _corners(setup: Setup, coords: Array) -> list[Array]:
    """Return the corners of all facets, one array (f, d) for each place in a facet."""
    facets = setup.boundary.facets
    axis = setup.axis
    parts = [take(coords, column) for column in facets.T]
    touching = np.flatnonzero(axis[facets].any(axis=1) & ~axis[facets].all(axis=1))
    if not len(touching):
        return parts
    table = facets[touching]
    nodes = take(coords, table.ravel())
    # At the axis, corners are means of the nodes of their facet, component by component. Their
    # shares are found with ones at a node of each facet, which gets nodes of its own.
    own = np.arange(table.size).reshape(table.shape)
    own[:, 2:] = np.where(table[:, 2:3] == table[:, 3:], own[:, 2:3], own[:, 2:])
    shares = []
    for place in range(table.shape[1]):
        one = np.zeros((table.size, setup.coords.shape[1]))
        one[own[:, place]] = own[:, [place]] != own[:, [place - 1]]
        shares.append(corners_of(one, own, axis[table.ravel()]))
    for k, part in enumerate(parts):
        terms = [
            multiply(take(nodes, own[:, place]), share[:, k]) for place, share in enumerate(shares)
        ]
        parts[k] = put(part, touching, reduce(add, terms))
    return parts


def _fan_normals(setup: Setup, coords: Array) -> Array:
    """Return the unit normal of each fan (m, d), as ``slideviz.mesh.fans.fan_normals``."""
    boundary = setup.boundary
    fans = setup.wall_fans
    corners = _corners(setup, coords)
    if boundary.dim == 2:
        vectors = transform(TURN, corners[1] - corners[0])
    else:
        vectors = cross(corners[2] - corners[0], corners[3] - corners[1])
    width = boundary.facets.shape[1]
    share = np.full((len(boundary.facets), width), 1.0 / width)
    if width == 4:
        share[boundary.facets[:, 2] == boundary.facets[:, 3]] = [1 / 3, 1 / 3, 1 / 6, 1 / 6]
    centre = multiply(corners[0], share[:, :1])
    for k in range(1, width):
        centre = add(centre, multiply(corners[k], share[:, k : k + 1]))
    gap = length(take(coords, fans.node) - take(centre, fans.facet))
    size = value(gap)
    near = inverse(function(gap, np.maximum(size, TINY), (size > TINY).astype(float)))
    weighted = multiply(take(unit(vectors), fans.facet), near)
    return unit(gather(weighted, fans.fan, len(fans.fan_node)))
