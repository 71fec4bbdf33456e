"""The rims of a case: nodes that moving boundaries share with walls, which they leave or stay on.

Walls are boundaries that slide, or are internal. A wall is as smooth surfaces continue, over
boundaries of any role but moving and periodic ones: what is on it may go from one to the next.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.motions.motion import applies_to
from slideviz.case.motions.span import moves_over_span
from slideviz.case.spans import span_ends
from slideviz.case.zone_cases import each_zone
from slideviz.mesh.fans import components
from slideviz.mesh.model import FloatArray, IntArray, Mesh, mask_of, run_begins
from slideviz.mesh.topology import corner_vectors, unit
from slideviz.rbf.classify import MERGE_FRACTION
from slideviz.rbf.frames import corners
from slideviz.rbf.projection import across_period, as_simplices, surface_labels, surface_rim
from slideviz.rbf.rims import Bodies, CurvedWall, FlatWall, Rims, RimWall, side_weights
from slideviz.solver.domain import Domain, find_domain
from slideviz.system.grouping import grouped
from slideviz.system.weak_cache import WeakCache
from slideviz.terms import Role

WALLS: tuple[Role, ...] = ("sliding", "internal")  # roles of boundaries that rims are on
APART: tuple[Role, ...] = ("moving", "periodic")  # roles of those into which no wall goes on

FLAT = 1e-12  # part of the largest coordinate by which the nodes of a flat wall may be off a plane

_RIMS = WeakCache()


def find_rims(
    case: Case, mesh: Mesh, domain: Domain, wall_roles: tuple[Role, ...] = WALLS
) -> Rims | None:
    """Return the rims of a case; None where no moving boundary shares nodes with a wall.

    Walls have one of ``wall_roles``. Nodes that move over the span alone are not among the rims on
    hub and shroud: they stay on these by their motion.
    """
    boundary = domain.boundary
    moving = domain.classes.moving
    roles = np.array([domain.roles.get(name, "fixed") for name in boundary.names], object)
    is_moving = mask_of(len(mesh.points), moving)
    facets = np.isin(roles[boundary.marker].astype(str), wall_roles)
    facets &= is_moving[boundary.facets].any(axis=1)
    facet, column = np.nonzero(facets[:, None] & is_moving[boundary.facets])
    node = boundary.facets[facet, column]
    keep = domain.once(node) & ~domain.axis[node] & ~_over_span(case, mesh, domain, node, facet)
    facet = facet[keep]
    node = node[keep]
    if not len(node):
        return None
    rim, walls = _walls(case, domain, is_moving, node, facet)
    representative = np.searchsorted(moving, domain.classes.representative[moving])
    place = moving[:0]
    bodies = None
    if case.rims == "slide":
        of_moving = boundary.facets[roles[boundary.marker] == "moving"]
        place, bodies = _bodies(mesh, of_moving, moving, representative, rim)
    return Rims(
        frame=domain.frame,
        nodes=moving,
        start=domain.coords[moving],
        representative=representative,
        rim=rim,
        walls=walls,
        bodies=bodies,
        place=place,
    )


def _over_span(
    case: Case, mesh: Mesh, domain: Domain, node: IntArray, facet: IntArray
) -> np.ndarray:
    """Return which pairs (p,) of a node and a facet of a wall need no check: blades along a hub."""
    out = np.zeros(len(node), bool)
    if not moves_over_span(case):
        return out
    boundary = domain.boundary
    other = np.zeros(len(mesh.points), bool)
    for name in case.markers_with("moving"):
        motions = [motion for motion in case.motions if applies_to(motion, name)]
        if not all(motion.keeps_span for motion in motions):
            other[mesh.marker(name).nodes] = True
    ends = [boundary.names.index(name) for name in span_ends(case, mesh)]
    return np.isin(boundary.marker[facet], ends) & ~other[node]


def _walls(
    case: Case, domain: Domain, is_moving: np.ndarray, node: IntArray, facet: IntArray
) -> tuple[IntArray, tuple[RimWall, ...]]:
    """Return the rim (r,), as places among the moving nodes, and the walls that its nodes are on.

    ``node`` and ``facet`` (p,): pairs of a node of the rim and a facet of a wall there.
    """
    boundary = domain.boundary
    rim = np.unique(node)
    walls = list[RimWall]()
    marker = boundary.marker[facet]
    for which in np.unique(marker):
        plane = _plane(case, domain, boundary.marker == which)
        if plane is not None:
            rows = np.searchsorted(rim, np.unique(node[marker == which]))
            walls.append(FlatWall((boundary.names[which],), rows, *plane))
            node = node[marker != which]
            facet = facet[marker != which]
            marker = marker[marker != which]
    if len(node):
        walls += _curved_walls(case, domain, is_moving, rim, node, facet)
    return np.searchsorted(domain.classes.moving, rim), tuple(walls)


def _plane(case: Case, domain: Domain, member: np.ndarray) -> tuple[FloatArray, FloatArray] | None:
    """Return a point (d,) and the normal (d,) of the plane that facets are in; None if in none.

    Nor is there any if they go on smoothly out of it. ``member`` (f,) bool: the facets.
    """
    boundary = domain.boundary
    coords = domain.coords
    x = corners(coords, boundary.facets[member], domain.axis)
    vectors = corner_vectors(x)
    normal = unit(vectors.sum(axis=0))
    point = x[0, 0]
    flat = FLAT * np.abs(x).max()
    if not normal.any() or np.abs((x - point) @ normal).max() > flat:
        return None
    one, two = boundary.joints[member[boundary.joints].sum(axis=1) == 1].T
    beside = np.where(member[one], two, one)
    apart = np.array([domain.roles.get(name, "fixed") in APART for name in boundary.names])
    beside = boundary.facets[beside[~apart[boundary.marker[beside]]]]
    beside = corners(coords, beside, domain.axis)
    along = np.abs(unit(corner_vectors(beside)) @ normal)
    smooth = along > np.cos(np.radians(case.feature_angle_deg * MERGE_FRACTION))
    if np.abs((beside[smooth] - point) @ normal).max(initial=0.0) > flat:
        return None
    return point, normal


def _curved_walls(
    case: Case,
    domain: Domain,
    is_moving: np.ndarray,
    rim: IntArray,
    node: IntArray,
    facet: IntArray,
) -> Iterator[CurvedWall]:
    """Yield the smooth surfaces that nodes are on, of a ``rim`` (r,); parameters as of `_walls`."""
    boundary = domain.boundary
    frame = domain.frame
    place = partial(corners, domain.coords, axis=domain.axis)
    roles = {name: domain.roles.get(name, "fixed") for name in boundary.names}
    roles = {name: role if role in APART else "sliding" for name, role in roles.items()}
    shift = frame.shift() if case.periodic in ("fixed", "moving") and domain.pairs else None
    across = None
    if shift is not None:
        across = across_period(boundary, domain.classes.representative, roles)
    vectors = corner_vectors(place(boundary.facets))
    labels = surface_labels(boundary, vectors, roles, case.feature_angle_deg, across)
    merge = np.cos(np.radians(case.feature_angle_deg * MERGE_FRACTION))
    pairs = _surfaces(node, labels[facet], unit(vectors)[facet], float(merge))
    for chosen, nodes in grouped(pairs).items():
        member = np.isin(labels, chosen)
        there, some = np.unique(boundary.facets[member], return_inverse=True)
        of_rim = np.isin(node, nodes) & member[facet]
        yield CurvedWall(
            names=tuple(boundary.names[k] for k in np.unique(boundary.marker[facet[of_rim]])),
            rows=np.searchsorted(rim, np.sort(nodes)),
            coords=domain.coords[there],
            facets=some.reshape(-1, boundary.facets.shape[1]),
            simplices=as_simplices(place(boundary.facets[member])),
            shift=shift,
            ends=surface_rim(boundary, member, is_moving, place),
        )


def _surfaces(
    node: IntArray, label: IntArray, normal: FloatArray, merge: float
) -> Iterator[tuple[tuple[int, ...], int]]:
    """Yield the labels of a wall, and a node on it, once for each wall of each node.

    Surfaces whose normals at the node have a cosine above ``merge`` are one wall: a blade that
    divides a hub has it on both sides. ``node``, ``label`` (p,), ``normal`` (p, d): of each pair of
    a node and a facet.
    """
    pairs, group = np.unique(np.stack([node, label], axis=1), axis=0, return_inverse=True)
    normals = np.zeros((len(pairs), normal.shape[1]))
    np.add.at(normals, group.reshape(-1), normal)
    normals = unit(normals)
    starts = np.flatnonzero(run_begins(pairs[:, 0]))
    for first, last in zip(starts, np.r_[starts[1:], len(pairs)], strict=True):
        if last == first + 1:
            yield (int(pairs[first, 1]),), int(pairs[first, 0])
            continue
        alike = normals[first:last] @ normals[first:last].T > merge
        wall = components(last - first, *np.nonzero(alike))
        for k in range(wall.max() + 1):
            yield tuple(pairs[first:last, 1][wall == k].tolist()), int(pairs[first, 0])


def _bodies(
    mesh: Mesh, facets: IntArray, moving: IntArray, representative: IntArray, rim: IntArray
) -> tuple[IntArray, Bodies]:
    """Return the place in a body of each moving node, (m,), -1 for none, and the bodies with rims.

    ``facets`` (f, k): of the moving boundaries.
    ``moving``: the nodes of `Rims`, which has ``representative`` and ``rim``, too.
    """
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    edges, weights = side_weights(mesh.points, facets)
    edges = representative[np.searchsorted(moving, edges)]
    body = components(len(moving), *edges.T)[representative]
    with_rim = np.isin(body, body[rim])
    kept = with_rim[edges[:, 0]]
    places, place = np.unique(np.where(with_rim, representative, -1), return_inverse=True)
    place = place.reshape(-1) - int(places[0] < 0)
    at = mesh.points[moving[with_rim]]
    of_rim = np.isin(representative[with_rim], rim)
    distance = np.full(int(place.max()) + 1, np.inf)
    np.minimum.at(distance, place[with_rim], cKDTree(at[of_rim]).query(at)[0])
    reach = np.zeros(len(moving))
    np.maximum.at(reach, body[with_rim], distance[place[with_rim]])
    near = np.zeros_like(distance)
    near[place[with_rim]] = reach[body[with_rim]]
    near = 1.0 - distance / np.where(near > 0.0, near, 1.0)
    share = near**2 * (3.0 - 2.0 * near)
    return place, Bodies(place[edges[kept]], weights[kept], place[rim], share)


def rims_key(case: Case) -> object:
    """Return what the rims of a mesh depend on."""
    over_span = case.motions if moves_over_span(case) else ()
    return case.around_span, case.periodic, case.sliding, case.feature_angle_deg, over_span


def are_ready(case: Case, mesh: Mesh) -> bool:
    """Return whether `on_walls` needs no time: rims are free, or were found for this mesh."""
    return case.rims == "free" or all(
        one.rims == "free" or _RIMS.has(zone, rims_key(one)) for one, zone in each_zone(case, mesh)
    )


def on_walls(case: Case, mesh: Mesh, moved: Displacements) -> Displacements:
    """Return the displacements with the rims that a case keeps on their walls (RIMS= SLIDE).

    They are found once for the roles of a mesh. Raises MeshError as `find_domain`.
    """
    vectors = moved.vectors.copy()
    for part, (one, zone) in zip(mesh.parts, each_zone(case, mesh), strict=True):
        first = part.points.start
        here = slice(*np.searchsorted(moved.nodes, [first, part.points.stop]))
        mine = Displacements(moved.nodes[here] - first, moved.vectors[here])
        vectors[here] = _on_walls_of_zone(one, zone, mine).vectors
    return replace(moved, vectors=vectors)


def _on_walls_of_zone(case: Case, mesh: Mesh, moved: Displacements) -> Displacements:
    if case.rims == "free":
        return moved

    def prepared() -> Rims | None:
        rims = find_rims(case, mesh, find_domain(case, mesh))
        if rims is not None and rims.bodies is not None:
            rims.bodies.prepare()  # takes time: not in the thread that draws ghosts
        return rims

    return displaced_on(_RIMS.of(mesh, rims_key(case), prepared), mesh, moved)


def displaced_on(rims: Rims | None, mesh: Mesh, moved: Displacements) -> Displacements:
    """Return the displacements with rims on their walls, if there are any that are kept there."""
    if rims is None or rims.bodies is None:
        return moved
    vectors = rims.displaced(moved.nodes, mesh.points[moved.nodes], moved.vectors)
    return replace(moved, vectors=vectors)
