"""From a case and a mesh to arrays: frame, classes, tracks and prescribed displacements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.check import idle_settings
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.motion import displacements, require_valid
from slideviz.errors import MeshError
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.check import check_size, within
from slideviz.mesh.fans import Fans, components, fan_normals, find_fans
from slideviz.mesh.halo import Halo, without_halo
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.nearest import near_duplicates
from slideviz.mesh.periodic import TOLERANCE, Pair
from slideviz.mesh.topology import Boundary
from slideviz.rbf.axis import corners as corners_of
from slideviz.rbf.axis import hold_on_axis, on_axis
from slideviz.rbf.classify import Classes, directions
from slideviz.rbf.evaluate import Basis
from slideviz.rbf.frames import Frame
from slideviz.rbf.images import COINCIDENT
from slideviz.rbf.methods import SLIDING_METHODS
from slideviz.rbf.problem import GreedySettings, PhaseTimer, Problem, Solution
from slideviz.rbf.projection import Tracks, find_tracks
from slideviz.solver.classes import find_classes, find_period, roles_of_copies
from slideviz.solver.prescribed import displaced, image_tolerance, prescribed
from slideviz.solver.radius import fitted_radius, support_radius
from slideviz.solver.reduction import (
    find_reduction,
    loose_warnings,
    needed_by_layers,
    sliding_gap,
)

if TYPE_CHECKING:
    from slideviz.baselines.elastic import Body
    from slideviz.baselines.idw import Weights

REACH = 1.5
"""How far surfaces are continued beyond moving boundaries, over the largest displacement: nodes
that slide past the end of their surface have something to slide on."""


@dataclass(frozen=True, eq=False)
class Setup:
    """Everything made of a case and a mesh that stays the same over the steps of a deformation."""

    frame: Frame
    basis: Basis
    coords: FloatArray
    """(n, d): undeformed positions in the frame."""
    classes: Classes
    known: IntArray
    """(a,): moving and fixed nodes."""
    target: FloatArray
    """(a, d): their displacement in the frame after the last step."""
    same_as: IntArray
    """(n,): for each node the one that represents all that coincide with it."""
    images: IntArray
    """(p, 2): pairs of periodic images, which move alike; the first represents the second."""
    candidates: int
    """Nodes that could be control nodes; periodic images count as one."""
    reduction: GreedySettings | None
    """Settings of the greedy selection; None: all candidates are control nodes."""
    layers: float
    """As of a ``Step``."""
    axis: np.ndarray
    """(n,): nodes on the axis of a cylindrical frame."""
    held: IntArray
    """(h,): sliding nodes on the axis that stay in place."""
    boundary: Boundary
    fans: Fans
    """`boundary`, `fans`: facets of the boundary, and their fans around each node."""
    tracks: Tracks
    """The edges and surfaces along which nodes slide."""
    pairs: tuple[Pair, ...]
    """Periodic pairs of markers."""
    solve: Callable[[Problem, PhaseTimer], Solution]
    """Solves one step by the method of the case."""
    fitted_radius: float
    """The support radius that fits the motion, whatever the case says."""
    halo: Halo | None
    """Copies that follow their donors."""
    warnings: tuple[str, ...]
    """What the user should know of case and mesh."""

    @cached_property
    def largest(self) -> float:
        """Return the largest displacement that is asked for, in the frame."""
        return float(np.linalg.norm(self.target, axis=1).max(initial=0.0))

    @cached_property
    def copies(self) -> IntArray:
        """Return the halo's pairs (k,) whose copies follow their donors.

        Periodic images move alike in the frame already; by a rotation of the halo, which differs a
        little from the period, or from where files with few digits put them, they would not.
        """
        halo = self.halo
        outside = halo is not None and ~np.isin(halo.receivers, self.images)
        return np.flatnonzero(outside)

    def once(self, nodes: IntArray) -> np.ndarray:
        """Return a mask (k,) of the nodes (k,) that represent their images, or have none."""
        return np.asarray(self.classes.representative[nodes] == nodes)

    def constraints(self, coords: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return nodes (q,) and unit normals (q, d) along which sliding nodes may not move.

        A node has a row for each of its normals; nodes on the axis come last, with axes of the
        frame instead (`hold_on_axis`). Of periodic images only the representative has any. Where
        no boundary is curved, the normals are those of the undeformed mesh, so that flat
        boundaries stay flat to the bit; else those at ``coords`` (n, d).
        """
        at = coords if self.tracks.curved else self.coords
        corners = corners_of(at, self.boundary.facets, self.axis)
        nodes, normals = directions(
            self.classes, fan_normals(self.boundary, self.fans, at, corners)
        )
        once = self.once(nodes)
        return hold_on_axis(nodes[once], normals[once], self.axis)[:2]

    def project(self, coords: FloatArray, nodes: IntArray, free: FloatArray) -> FloatArray:
        """Return the displacements (m, d) after which nodes are on their edge or surface.

        Nodes on the axis stay on it, and in place where another surface meets it.

        Parameters
        ----------
        coords : (n, d)
            Coordinates of all nodes before the step.
        nodes : (m,)
            Sliding nodes.
        free : (m, d)
            Their displacements in the step, which may lead off the boundary.
        """
        out = self.tracks.project(coords, nodes, free)
        self._tie(nodes, out)
        out[self.axis[nodes], :2] = 0.0
        out[np.isin(nodes, self.held)] = 0.0
        return out

    def _tie(self, nodes: IntArray, slid: FloatArray) -> None:
        """Overwrite displacements ``slid`` (m, d) of halo copies among ``nodes`` by their donors'.

        Only where both slide; turned as the halo turns them.
        """
        if self.halo is None:
            return
        row = np.full(len(self.coords), -1)
        row[nodes] = np.arange(len(nodes))
        copy, origin = row[self.halo.receivers], row[self.halo.donors]
        both = (copy >= 0) & (origin >= 0)
        moved = slid[origin[both]]
        if not self.frame.cylindrical:
            moved = np.einsum("hij,hj->hi", self.halo.rotations[both], moved)
        slid[copy[both]] = moved


def make_setup(case: Case, mesh: Mesh, moved: Displacements | None = None) -> Setup:
    """Return the setup of a deformation: all that stays the same over its steps.

    Parameters
    ----------
    moved : Displacements, optional
        Displacements of moving nodes, as ``displaced`` returns them; None: by the case's motions.

    Raises
    ------
    CaseError
        The case does not fit the mesh.
    MeshError
        Periodic markers do not match, a marker element is no side of a cell, or a coordinate is
        not finite, or too large to compute with.
    DeformError
        No node is moving or fixed, or periodic images are asked to move differently.
    """
    require_valid(case, mesh)
    _require_finite(mesh)
    check_size(mesh)
    asked, (case, notes) = case, roles_of_copies(case, mesh)
    boundary = boundary_of(mesh)
    fans = find_fans(boundary, mesh.points, case.feature_angle_deg)
    pairs, frame, coords, representative = find_period(case, mesh, boundary)
    beyond = 0 if mesh.halo is None else len(mesh.halo.outer)
    classes = replace(
        find_classes(case, mesh, boundary, fans, frame, representative), beyond=beyond
    )
    axis = on_axis(frame, coords)
    normals = fan_normals(boundary, fans, coords, corners_of(coords, boundary.facets, axis))
    tolerance = TOLERANCE if moved else image_tolerance(case, mesh, pairs)
    moved = moved or displaced(displacements(asked, mesh), mesh)
    known, target, warnings = prescribed(
        case, mesh, moved, tolerance, boundary=boundary, fans=fans, classes=classes, frame=frame
    )
    largest = float(np.linalg.norm(target, axis=1).max(initial=0.0))
    candidates = _candidates(classes, known)
    moves, slides = np.zeros((2, len(mesh.points)), bool)
    moves[classes.moving], slides[classes.sliding] = True, True
    gap = sliding_gap(mesh.points, boundary.facets, moves, slides)
    reduction = find_reduction(case, mesh.extent, largest, candidates, gap)
    loose = loose_warnings(case, reduction, largest, mesh.extent, gap)
    tracks = find_tracks(
        boundary,
        fans,
        classes,
        lambda nodes: corners_of(coords, nodes, axis),
        roles=case.roles,
        feature_angle_deg=case.feature_angle_deg,
        shift=frame.shift() if case.periodic in ("fixed", "moving") and pairs else None,
        reach=REACH * largest,
    )
    second = np.flatnonzero(representative != np.arange(len(representative)))
    images = np.stack([representative[second], second], axis=1)
    angle = frame.period if frame.cylindrical else 0.0
    basis = Basis(support_radius(case, mesh, moved), angle, case.kernel)
    return Setup(
        frame=frame,
        basis=basis,
        coords=coords,
        classes=classes,
        known=known,
        target=target,
        same_as=_coinciding(mesh, boundary.nodes, images),
        images=images,
        candidates=candidates,
        reduction=reduction,
        layers=needed_by_layers(reduction, gap),
        axis=axis,
        held=hold_on_axis(*directions(classes, normals), axis)[2],
        boundary=boundary,
        fans=fans,
        tracks=tracks,
        pairs=pairs,
        solve=_method(case, mesh, frame, axis),
        fitted_radius=fitted_radius(case, mesh, moved),
        halo=mesh.halo,
        warnings=(*mesh.remarks, *notes, *warnings, *loose, *idle_settings(case)),
    )


def _method(
    case: Case, mesh: Mesh, frame: Frame, axis: np.ndarray
) -> Callable[[Problem, PhaseTimer], Solution]:
    """Return the function that solves one step, by METHOD and SLIDING_MODE of the case."""
    if case.method == "idw":
        from slideviz.baselines.idw import deform_idw

        return partial(deform_idw, weights=idw_weights(case, mesh.dim))
    if case.method == "elastic":
        from slideviz.baselines.elastic import deform_elastic

        return partial(deform_elastic, body=elastic_body(mesh, frame, axis))
    return SLIDING_METHODS[case.sliding]


def elastic_body(mesh: Mesh, frame: Frame, axis: np.ndarray) -> Body:
    """Return the mesh as an elastic body, without its halo."""
    from slideviz.baselines.elastic import Body
    from slideviz.baselines.stiffness import blocks

    return Body(blocks(without_halo(mesh)[0].cells), frame, axis)


def idw_weights(case: Case, dim: int) -> Weights:
    """Return the settings of inverse distance weighting; its power is ``dim`` if none is given."""
    from slideviz.baselines.idw import Weights

    return Weights(case.idw_power or float(dim), case.idw_fixed_weight)


def _require_finite(mesh: Mesh) -> None:
    """Raise MeshError when a coordinate is NaN or infinite."""
    if within(mesh.points, np.finfo(float).max):
        return
    bad = np.flatnonzero(~np.isfinite(mesh.points).all(axis=1))
    where = ", ".join(f"{v:.6g}" for v in mesh.points[bad[0]])
    raise MeshError(
        f"{mesh.name}: node {bad[0]} is at {where}; coordinates must be finite numbers "
        f"({len(bad)} nodes are not), so correct the mesh"
    )


def _coinciding(mesh: Mesh, boundary_nodes: IntArray, images: IntArray) -> IntArray:
    """Return for each node the one that represents all that coincide with it, (n,); images count.

    It is the first of them by position and not by number, because the selection of control nodes,
    where it represents all of them, must not depend on how nodes are numbered.

    Parameters
    ----------
    boundary_nodes : (b,)
        The nodes that are compared.
    images : (p, 2)
        Pairs of periodic images, which are taken to coincide.
    """
    apart = COINCIDENT * mesh.extent
    some, links = boundary_nodes[near_duplicates(mesh.points[boundary_nodes], apart)], images
    if len(some):
        from scipy.spatial import cKDTree  # takes long to load

        coincident_pairs = some[
            cKDTree(mesh.points[some]).query_pairs(apart, output_type="ndarray")
        ]
        links = np.concatenate([coincident_pairs.reshape(-1, 2), images])
    out = np.arange(len(mesh.points))
    nodes, ends = np.unique(links, return_inverse=True)
    label = components(len(nodes), *ends.reshape(links.shape).T)
    order = np.lexsort(mesh.points[nodes].T[::-1])
    _, first, group = np.unique(label[order], return_index=True, return_inverse=True)
    out[nodes[order]] = nodes[order][first[group]]
    return out


def _candidates(classes: Classes, known: IntArray) -> int:
    """Return the number of nodes that could be control nodes; periodic images count as one.

    ``known`` (a,) are the moving and fixed nodes.
    """
    nodes = np.concatenate([known, classes.edge, classes.surface])
    return int((classes.representative[nodes] == nodes).sum())
