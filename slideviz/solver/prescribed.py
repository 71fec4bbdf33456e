"""What a case prescribes at the boundary, and the support radius fitted to it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from slideviz.argument_types import record
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.moving_nodes import ROUNDING, moving_nodes, same
from slideviz.errors import CaseError, DeformError, Message, Remark
from slideviz.mesh.fans import components
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import (
    FloatArray,
    IntArray,
    Mesh,
    largest_coordinate,
    largest_norm,
    row_norms,
)
from slideviz.mesh.periodic import TOLERANCE, Pair
from slideviz.rbf.images import ImageDisplacements, require_free
from slideviz.rbf.rims import Rims
from slideviz.solver.domain import Domain, find_classes
from slideviz.solver.intersection import folding_message, intersection_message, jump_message
from slideviz.solver.rims import displaced_on

APART = 100.0
"""Allowed difference of the displacements of images over the largest displacement, divided by their
mismatch in place over the mesh's extent."""


EXTENTS = 2.5
"""Largest automatic support radius over the extent of the mesh: the thesis's rule, for passages."""

BODIES = 15.0
"""Automatic support radius over the largest extent of a moving body. A larger one carries a far
field along where the body turns or stretches, a smaller one gives worse cells beside the body."""

DISPLACEMENTS = 20.0
"""Automatic support radius over the largest displacement, at least: a body that moves by more than
its size needs a radius that fits the way."""


def displaced(moved: Displacements, mesh: Mesh) -> Displacements:
    """Return the prescribed displacements, made to fit the halo of the mesh, if it has one.

    Copies of moving nodes follow these; nodes beyond the sides of the domain are left out. Raises
    CaseError if a copy and the node that it is a copy of have different prescribed displacements.
    ``moved``: the displacements of all nodes of the moving markers.
    """
    halo = mesh.halo
    if halo is None:
        return moved
    asked = np.zeros_like(mesh.points)
    asked[moved.nodes] = moved.vectors
    follows = np.einsum("hij,hj->hi", halo.rotations, asked[halo.donors])
    gap = np.abs(follows - asked[halo.receivers]).max(axis=1, initial=0.0)
    # A motion displaces a copy that is a little out of place otherwise, too.
    largest = largest_norm(moved.vectors)
    gap -= np.minimum(TOLERANCE, APART * halo.mismatch / mesh.extent) * largest
    gap[~np.isin(halo.receivers, moved.nodes)] = 0.0
    if gap.max(initial=0.0) > same(moved.vectors, mesh):
        k = int(np.argmax(gap))
        raise CaseError(
            f"{mesh.name}: nodes {halo.receivers[k]} and {halo.donors[k]} are halo copies, but "
            f"their displacements differ by {gap[k]:.3g}; let the boundary move alike on both "
            "periodic sides"
        )
    asked[halo.receivers] = follows
    with_copies = np.union1d(moved.nodes, halo.receivers[np.isin(halo.donors, moved.nodes)])
    nodes = np.setdiff1d(with_copies, halo.outer)
    return replace(moved, nodes=nodes, vectors=asked[nodes])


def image_tolerance(case: Case, mesh: Mesh, pairs: tuple[Pair, ...]) -> float:
    """Return the allowed difference of the displacements of images, over the largest displacement.

    Formulas displace images alike, except for the mismatch of their positions. Displacements from
    files or arrays may be rounded to few digits.
    """
    if any(motion.lists_nodes for motion in case.motions):
        return TOLERANCE
    mismatch = max((pair.mismatch for pair in pairs), default=0.0)
    if mesh.halo is not None:
        mismatch = max(mismatch, float(mesh.halo.mismatch.max(initial=0.0)))
    return min(TOLERANCE, APART * mismatch / mesh.extent)


@record
class BoundaryConditions:
    """What is prescribed: nodes of known displacement, and that displacement."""

    known: IntArray  # (a,): moving and fixed nodes
    target: FloatArray  # (a, d): their displacement in the frame after the last step
    moved: Displacements  # of moving nodes, as `displaced` returns it
    warnings: tuple[Remark, ...]

    @cached_property
    def largest(self) -> float:
        """Return the largest displacement, in the frame."""
        return largest_norm(self.target)


def motion_messages(
    case: Case, mesh: Mesh, moved: Displacements
) -> tuple[str | None, Message | None]:
    """Return why a motion of boundaries is impossible, and where cells will overlap; or None.

    ``case`` has the roles of a ``Domain``. ``moved``: as `displaced` returns it.
    """
    asked = case, mesh, moved.nodes, moved.vectors
    problem = intersection_message(*asked) or jump_message(*asked)
    return problem, None if problem else folding_message(*asked)


def prescribe(
    case: Case,
    mesh: Mesh,
    domain: Domain,
    moved: Displacements | None,
    rims: Rims | None,
) -> BoundaryConditions:
    """Return what a case prescribes at the moving and fixed nodes of a domain.

    Raises CaseError if the motion takes a boundary through another one, or out of the mesh, and
    DeformError if no node is moving or fixed, or images are asked to move differently.
    ``moved``: displacements of moving nodes, as ``displaced`` returns them; None: by the case's
    motions.
    ``rims``: those that are kept on their walls after each step; checks are made with them there.
    """
    tolerance = TOLERANCE if moved else image_tolerance(case, mesh, domain.pairs)
    moved = moved or displaced(moving_nodes(case, mesh), mesh)
    classes = domain.classes
    frame = domain.frame
    case = case.change(roles=domain.roles)
    problem, folded = motion_messages(case, mesh, displaced_on(rims, mesh, moved))
    if problem:
        raise CaseError(f"{mesh.name}: {problem}")
    known = np.concatenate([classes.moving, classes.fixed])
    if not len(known):
        raise DeformError(
            f"{mesh.name}: no boundary node has a known displacement; make a marker moving"
        )
    vectors = frame.difference(mesh.points[moved.nodes], moved.vectors)
    allowed = tolerance * largest_norm(vectors) + ROUNDING * largest_coordinate(mesh.points)
    spread = ImageDisplacements(moved.nodes, vectors, classes.representative)
    spread.require_alike(allowed)
    follow = np.setdiff1d(classes.moving, moved.nodes)
    if len(follow):
        alone = find_classes(
            case, mesh, domain.boundary, domain.fans, frame, np.arange(len(mesh.points))
        )
        require_free(spread, follow, alone, domain.normals, allowed)
    warnings = (*moved.warnings, *([folded] if folded else []))
    return BoundaryConditions(known, spread.at(known), moved, warnings)


def support_radius(case: Case, mesh: Mesh, moved: Displacements) -> float:
    """Return the support radius R for the displacements ``moved``, in the mesh's length unit."""
    if case.support_radius is not None:
        return case.support_radius
    if case.influence_factor:
        return case.influence_factor * mesh.extent
    return fitted_radius(case, mesh, moved)


def fitted_radius(case: Case, mesh: Mesh, moved: Displacements) -> float:
    """Return the support radius of ``INFLUENCE_FACTOR= AUTO``; parameters as `support_radius`."""
    sizes = np.ptp(moving_bodies(case, mesh, moved), axis=1)
    farthest = row_norms(moved.vectors).max(initial=0.0)
    needed = max(BODIES * sizes.max(initial=0.0), DISPLACEMENTS * farthest)
    return min(EXTENTS * mesh.extent, float(needed) or np.inf)


def moving_bodies(case: Case, mesh: Mesh, moved: Displacements) -> FloatArray:
    """Return the bounding boxes of the moving bodies, (b, 2, d): lowest and highest coordinates.

    A body is a connected part of the moving boundaries. Those of which no node is displaced do not
    count, unless no node at all is displaced.
    """
    inside = without_halo(mesh)[0]
    names = case.markers_with("moving")
    tables = [table for name in names for _, table in inside.marker(name).cells.by_type.values()]
    links = [table[:, [0, k]] for table in tables for k in range(1, table.shape[1])]
    pairs = np.concatenate([np.empty((0, 2), np.int64), *links])
    nodes, ends = np.unique(pairs, return_inverse=True)
    body = components(len(nodes), *ends.reshape(-1, 2).T)
    boxes = np.full((int(body.max(initial=-1)) + 1, 2, mesh.dim), np.inf)
    boxes[:, 1] = -np.inf
    np.minimum.at(boxes[:, 0], body, mesh.points[nodes])
    np.maximum.at(boxes[:, 1], body, mesh.points[nodes])
    displaced = np.isin(nodes, moved.nodes[moved.vectors.any(axis=1)])
    return boxes[np.unique(body[displaced])] if displaced.any() else boxes
