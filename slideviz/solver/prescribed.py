"""The displacements that a case prescribes, at moving nodes and all their images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, FromFile, Prescribed
from slideviz.case.motion import ROUNDING, same
from slideviz.errors import CaseError, DeformError
from slideviz.mesh.fans import Fans, fan_normals
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.mesh.periodic import TOLERANCE, Pair
from slideviz.mesh.topology import Boundary
from slideviz.rbf.axis import corners as corners_of
from slideviz.rbf.axis import on_axis
from slideviz.rbf.classify import Classes
from slideviz.rbf.frames import Frame
from slideviz.rbf.images import ImageDisplacements, require_free
from slideviz.solver.classes import find_classes
from slideviz.solver.intersection import folding_message, intersection_message, jump_message

APART = 100.0
"""Allowed difference of the displacements of images over the largest displacement, divided by their
mismatch in place over the mesh's extent."""


def displaced(moved: Displacements, mesh: Mesh) -> Displacements:
    """Return the prescribed displacements, made to fit the halo of the mesh, if it has one.

    Copies of moving nodes follow these; nodes beyond the sides of the domain are left out.

    Parameters
    ----------
    moved : Displacements
        The displacements of all nodes of the moving markers.

    Raises
    ------
    CaseError
        A copy and the node that it is a copy of have different prescribed displacements.
    """
    halo = mesh.halo
    if halo is None:
        return moved
    asked = np.zeros_like(mesh.points)
    asked[moved.nodes] = moved.vectors
    follows = np.einsum("hij,hj->hi", halo.rotations, asked[halo.donors])
    gap = np.abs(follows - asked[halo.receivers]).max(axis=1, initial=0.0)
    # A motion displaces a copy that is a little out of place otherwise, too.
    largest = float(np.linalg.norm(moved.vectors, axis=1).max(initial=0.0))
    gap -= np.minimum(TOLERANCE, APART * halo.mismatch / mesh.extent) * largest
    gap[~np.isin(halo.receivers, moved.nodes)] = 0.0
    if gap.max(initial=0.0) > same(moved.vectors, mesh):
        k = int(np.argmax(gap))
        raise CaseError(
            f"{mesh.name}: node {halo.receivers[k]} is asked to move otherwise than node "
            f"{halo.donors[k]}, whose copy it is by the mesh's halo, by {gap[k]:.3g}; a boundary "
            "that moves must move alike on both periodic sides"
        )
    asked[halo.receivers] = follows
    with_copies = np.union1d(moved.nodes, halo.receivers[np.isin(halo.donors, moved.nodes)])
    nodes = np.setdiff1d(with_copies, halo.outer)
    return replace(moved, nodes=nodes, vectors=asked[nodes])


def image_tolerance(case: Case, mesh: Mesh, pairs: tuple[Pair, ...]) -> float:
    """Return the allowed difference of the displacements of images, over the largest displacement.

    Formulas displace images alike, but for the mismatch of their places; displacements from files
    or given as arrays may be rounded to few digits.
    """
    if any(isinstance(motion, FromFile | Prescribed) for motion in case.motions):
        return TOLERANCE
    mismatch = max((pair.mismatch for pair in pairs), default=0.0)
    if mesh.halo is not None:
        mismatch = max(mismatch, float(mesh.halo.mismatch.max(initial=0.0)))
    return min(TOLERANCE, APART * mismatch / mesh.extent)


def prescribed(
    case: Case,
    mesh: Mesh,
    moved: Displacements,
    tolerance: float,
    *,
    boundary: Boundary,
    fans: Fans,
    classes: Classes,
    frame: Frame,
) -> tuple[IntArray, FloatArray, tuple[str, ...]]:
    """Return moving and fixed nodes (a,), their displacement (a, d) in the frame, and warnings.

    Parameters
    ----------
    moved : Displacements
        What moving nodes are asked for, as `displaced` returns it.
    tolerance
        Allowed difference of the displacements of images, over the largest displacement.

    Raises
    ------
    CaseError
        The motion takes a boundary through another one, or out of the mesh.
    DeformError
        No node is moving or fixed, or images are asked to move differently.
    """
    asked = case, mesh, moved.nodes, moved.vectors
    problem = intersection_message(*asked) or jump_message(*asked)
    if problem:
        raise CaseError(f"{mesh.name}: {problem}")
    known = np.concatenate([classes.moving, classes.fixed])
    if not len(known):
        raise DeformError(
            f"{mesh.name}: no boundary node has a known displacement; make a marker moving"
        )
    vectors = frame.difference(mesh.points[moved.nodes], moved.vectors)
    largest = float(np.linalg.norm(vectors, axis=1).max(initial=0.0))
    allowed = tolerance * largest + ROUNDING * largest_coordinate(mesh.points)
    spread = ImageDisplacements(moved.nodes, vectors, classes.representative)
    spread.require_alike(allowed)
    follow = np.setdiff1d(classes.moving, moved.nodes)
    if len(follow):
        alone = find_classes(case, mesh, boundary, fans, frame, np.arange(len(mesh.points)))
        coords = frame.coords(mesh.points)
        corners = corners_of(coords, boundary.facets, on_axis(frame, coords))
        normals = fan_normals(boundary, fans, coords, corners)
        require_free(spread, follow, alone, normals, allowed)
    folded = folding_message(*asked)
    warnings = (*moved.warnings, *([f"{folded}; move it less"] if folded else []))
    return known, spread.at(known), warnings
