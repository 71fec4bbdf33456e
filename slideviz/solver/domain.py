"""The domain of a deformation: a mesh with the roles of its boundaries, whatever the motion is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.case.spans import periodic_pairs
from slideviz.errors import MeshError, Message, Remark, note
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.check import check_size, within
from slideviz.mesh.fans import Fans, components, fan_normals, find_fans
from slideviz.mesh.halo import Halo, without_halo
from slideviz.mesh.model import FloatArray, IntArray, Mesh, frozen_array, mask_of
from slideviz.mesh.nearest import near_duplicates
from slideviz.mesh.periodic import Pair, turned_too
from slideviz.mesh.topology import Boundary
from slideviz.rbf.classify import Classes, classify, directions, fan_roles
from slideviz.rbf.frames import Frame, hold_on_axis, make_frame, on_axis
from slideviz.rbf.frames import corners as corners_of
from slideviz.rbf.images import COINCIDENT, find_images
from slideviz.rbf.tape import value
from slideviz.terms import Role


@record
class Domain:
    """A mesh with the roles of its boundaries: all that is computed before a motion is known."""

    roles: Mapping[str, Role]  # role of each marker; of halo copies, that of what they copy
    boundary: Boundary  # facets of the boundary
    fans: Fans  # the facets around each of its nodes, by marker and between edges
    wall_fans: Fans
    """Those of the normals during a motion, without facets at moving nodes where others remain: at
    a blade these are thin, and they tilt while the blade leaves the wall a little between steps."""
    pairs: tuple[Pair, ...]  # periodic pairs of markers
    frame: Frame
    coords: FloatArray  # (n, d): undeformed positions in the frame
    axis: np.ndarray  # (n,) bool: nodes on the axis of a cylindrical frame
    normals: FloatArray  # undeformed unit normals of the fans, in the frame
    classes: Classes
    held: IntArray  # (h,): sliding nodes on the axis that stay in place
    images: IntArray
    """(p, 2): pairs of periodic images, which move alike; the first represents the second."""
    same_as: IntArray  # (n,): for each node the one that represents all that coincide with it
    halo: Halo | None  # copies that follow their donors
    warnings: tuple[Remark, ...]  # what the user should know of mesh and roles

    def once(self, nodes: IntArray) -> np.ndarray:
        """Return a mask (k,) of the nodes (k,) that represent their images, or have none."""
        return np.asarray(self.classes.representative[nodes] == nodes)

    def normals_at(self, coords: FloatArray) -> FloatArray:
        """Return the unit normals of the fans at coordinates (n, d) in the frame."""
        corners = corners_of(coords, self.boundary.facets, self.axis)
        return fan_normals(self.boundary, self.wall_fans, coords, corners)


def find_domain(case: Case, mesh: Mesh) -> Domain:
    """Return the domain of a mesh with the roles of a case.

    If the mesh has a reference, all is found from that, but for coordinates and normals: where
    boundaries bend, a node that slides along two of them would else be the corner of a third.
    Raises MeshError if periodic markers do not match, a marker element is not a side of a cell, or
    a coordinate is not finite, or too large to compute with.
    """
    if mesh.reference is not None:
        return _deformed(find_domain(case, mesh.reference), mesh)
    case, notes = roles_of_copies(case, mesh)
    _require_finite(mesh)
    check_size(mesh)
    boundary = boundary_of(mesh)
    fans = find_fans(boundary, mesh.points, case.feature_angle_deg)
    pairs, frame, coords, representative = find_period(case, mesh, boundary)
    classes = find_classes(case, mesh, boundary, fans, frame, representative)
    axis = on_axis(frame, coords)
    normals = fan_normals(boundary, fans, coords, corners_of(coords, boundary.facets, axis))
    sliding, along = directions(classes, normals)
    second = np.flatnonzero(representative != np.arange(len(representative)))
    images = np.stack([representative[second], second], axis=1)
    return Domain(
        roles=case.roles,
        boundary=boundary,
        fans=fans,
        wall_fans=_without_rims(fans, boundary, classes),
        pairs=pairs,
        frame=frame,
        coords=coords,
        axis=axis,
        normals=normals,
        classes=replace(classes, beyond=0 if mesh.halo is None else len(mesh.halo.outer)),
        held=hold_on_axis(sliding, value(along), axis)[2],
        images=images,
        same_as=_coinciding(mesh, boundary.nodes, images),
        halo=mesh.halo,
        warnings=(*mesh.remarks, *notes, *_ambiguous_period(case, mesh, pairs)),
    )


def _deformed(domain: Domain, mesh: Mesh) -> Domain:
    """Return the domain of a mesh with the coordinates of a deformed one."""
    _require_finite(mesh)
    check_size(mesh)
    before = domain.frame.points(domain.coords)
    coords = domain.coords + domain.frame.difference(before, mesh.points - before)
    warnings = tuple(dict.fromkeys((*domain.warnings, *mesh.remarks)))
    return replace(domain, coords=coords, normals=domain.normals_at(coords), warnings=warnings)


def _without_rims(fans: Fans, boundary: Boundary, classes: Classes) -> Fans:
    moving = mask_of(classes.total, classes.moving)
    away = ~np.any(moving[boundary.facets[fans.facet]], axis=1)
    others = np.bincount(fans.fan, away, len(fans.fan_node)) > 0.0
    keep = away | ~others[fans.fan]
    return replace(
        fans,
        facet=frozen_array(fans.facet[keep]),
        node=frozen_array(fans.node[keep]),
        fan=frozen_array(fans.fan[keep]),
    )


def roles_of_copies(case: Case, mesh: Mesh) -> tuple[Case, tuple[str, ...]]:
    """Return the case where halo copies of boundaries have the others' roles, and notes."""
    roles = dict(case.roles)
    notes = []
    for copy, origin in mesh.halo.sides if mesh.halo is not None else ():
        role = case.roles.get(copy, "fixed")
        other = case.roles.get(origin, "fixed")
        roles[copy] = other
        if role == other == "periodic" and case.periodic == "none":
            notes.append(
                f"{copy} still follows {origin}: it is its halo copy (SEND_RECEIVE markers)"
            )
        if role != other:
            notes.append(
                f"{copy} follows {origin}, because it is its halo copy (SEND_RECEIVE markers); its "
                f"own role ({role}) has no effect"
            )
    return case.change(roles=roles), tuple(notes)


def find_period(
    case: Case, mesh: Mesh, boundary: Boundary
) -> tuple[tuple[Pair, ...], Frame, FloatArray, IntArray]:
    """Return periodic pairs, frame, coordinates (n, d) in it, and representatives (n,) of nodes.

    The representative of a node is the one of its periodic images that stands for all of them in
    the system; of a node without images, itself (`Classes.representative`). Raises MeshError if
    periodic markers do not match.
    """
    periodic = case.periodic != "none"
    # A rotational case needs them also without images: they give the cylindrical frame.
    needed = periodic or case.periodic_type == "rotational"
    pairs = periodic_pairs(case, mesh) if needed else ()
    inside = mesh.points if mesh.halo is None else np.delete(mesh.points, mesh.halo.outer, axis=0)
    frame, coords = make_frame(inside, pairs, periodic_distance=periodic)
    if mesh.halo is not None:
        coords = frame.coords(mesh.points)
    representative = find_images(
        pairs if periodic else (), frame, coords, boundary.nodes, mesh.extent
    )
    return pairs, frame, coords, representative


def _ambiguous_period(case: Case, mesh: Mesh, pairs: tuple[Pair, ...]) -> tuple[Message, ...]:
    """Return a note where PERIODIC_TYPE= AUTO takes a translation, and a rotation fits as well."""
    if case.periodic == "none" or case.periodic_type != "auto":
        return ()
    turned = turned_too(without_halo(mesh)[0], pairs, case.axis, case.origin)
    if turned is None:
        return ()
    text = (
        f"{turned.first} and {turned.second} match by a translation ({pairs[0].describe()}) and by "
        f"a rotation ({turned.describe()}); PERIODIC_TYPE= AUTO takes the translation: write "
        "TRANSLATIONAL or ROTATIONAL"
    )
    return (note(text),)


def find_classes(
    case: Case, mesh: Mesh, boundary: Boundary, fans: Fans, frame: Frame, representative: IntArray
) -> Classes:
    """Return the classes of all nodes, given their representatives (n,)."""
    normals = fan_normals(boundary, fans, mesh.points)
    return classify(
        fans,
        fan_roles(boundary, fans, case.roles),
        frame.turned_back(frame.coords(mesh.points[fans.fan_node]), normals),
        representative,
        sliding=case.sliding,
        periodic=case.periodic,
        feature_angle_deg=case.feature_angle_deg,
    )


def _require_finite(mesh: Mesh) -> None:
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
    ``boundary_nodes`` (b,): the nodes that are compared.
    ``images`` (p, 2): pairs of periodic images, which are taken to coincide.
    """
    apart = COINCIDENT * mesh.extent
    some = boundary_nodes[near_duplicates(mesh.points[boundary_nodes], apart)]
    links = images
    if len(some):
        # Late: scipy.spatial takes 0.1 s.
        from scipy.spatial import cKDTree

        close = some[cKDTree(mesh.points[some]).query_pairs(apart, output_type="ndarray")]
        links = np.concatenate([close.reshape(-1, 2), images])
    out = np.arange(len(mesh.points))
    nodes, ends = np.unique(links, return_inverse=True)
    label = components(len(nodes), *ends.reshape(links.shape).T)
    order = np.lexsort(mesh.points[nodes].T[::-1])
    _, first, group = np.unique(label[order], return_index=True, return_inverse=True)
    out[nodes[order]] = nodes[order][first[group]]
    return out
