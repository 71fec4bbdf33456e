"""Projection: the closest points on the boundary, to which freely displaced nodes slide.

The exact closest point on the node's own piece, not the thesis's nearest-midpoint iteration
(section 2.4.3), which approximates it and can cycle for ever. Pieces are taken at the
undeformed boundary, in the working frame, so an arc about the axis stays an arc, and a slid
node never leaves its curve or surface however many steps are made. With periodic displacement
pieces are continued beyond the periodic boundaries by their own images.

A blade that moves along its hub leaves the place where it stood, and nodes of the hub slide into
that place, where the hub has no facets. So beyond the rim of a moving boundary a sliding surface
goes on flat, in the plane of its last facet, or on the facets that close the hole.

While the primitive that a closest point is on (facet, edge or vertex) stays the same, the closest
point of x is ``a + P (x - a)``: P is I - n n^T on a facet, t t^T on an edge and zero at a vertex,
and is the derivative of the projection (`projection_matrices`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.fans import Fans, components
from slideviz.mesh.model import (
    BoolArray,
    FloatArray,
    IntArray,
    largest_norm,
    mask_of,
    row_dots,
    row_norms,
)
from slideviz.mesh.topology import Boundary, corner_vectors, find_joints, unit
from slideviz.rbf.classify import MERGE_FRACTION, Classes
from slideviz.rbf.closest import ClosestPoints
from slideviz.system.grouping import grouped
from slideviz.system.threads import ordered_map
from slideviz.terms import ROLES

CLOSE = 2e-6
"""A closest point is on a facet (or an edge) when the foot of the node on its plane (or line) is
within this part of the node's distance from it. So a node that slides along a line of the mesh on
a flat boundary is on a facet, whatever rounding says, and the choice of the search among equally
near facets does not matter."""

ROUNDING = 1e-9  # part of the facet's size by which that limit is increased


def projection_matrices(corners: FloatArray, x: FloatArray, closest: FloatArray) -> FloatArray:
    """Return the derivatives P (m, d, d) of closest points with respect to their nodes.

    ``corners`` (m, c, d): of the segment (c = 2) or triangle (c = 3) that each closest point is on.
    ``x`` and ``closest`` (m, d): nodes, and their closest points on the simplices.
    """
    m, count, d = corners.shape
    size = np.ptp(corners, axis=1).max(axis=1)
    near = CLOSE * row_norms(x - closest) + ROUNDING * size
    out = np.zeros((m, d, d))
    done = np.zeros(m, bool)
    if count == 3:
        out, done = _facets(corners, x, closest, near)
    sides = [(0, 1)] if count == 2 else [(0, 1), (1, 2), (2, 0)]
    for one, two in sides:
        along = corners[:, two] - corners[:, one]
        length = row_norms(along)
        use = ~done & (length > 0)
        t = along / np.where(length > 0, length, 1.0)[:, None]
        reach = row_dots(x - corners[:, one], t)
        foot = corners[:, one] + reach[:, None] * t
        use &= row_norms(foot - closest) <= near
        out[use] = t[use, :, None] * t[use, None, :]
        done |= use
    return out


def _facets(
    corners: FloatArray, x: FloatArray, closest: FloatArray, near: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return projections on planes of triangles (m, 3, 3), and a mask (m,) where these apply.

    They apply where the foot on the plane is within ``near`` (m,) of the closest point; elsewhere
    the matrix is zero.
    """
    one = corners[:, 1] - corners[:, 0]
    two = corners[:, 2] - corners[:, 0]
    normal = np.cross(one, two)
    area = row_norms(normal)
    flat = area > 0
    normal /= np.where(flat, area, 1.0)[:, None]
    height = row_dots(x - corners[:, 0], normal)
    foot = x - height[:, None] * normal
    on = flat & (row_norms(foot - closest) <= near)
    out = np.zeros((len(x), 3, 3))
    out[on] = np.eye(3) - normal[on, :, None] * normal[on, None, :]
    return out, on


Place = Callable[[IntArray], FloatArray]
"""Returns the corners (m, k, d) of facets or segments (m, k), undeformed and in the frame."""


def surface_rim(
    boundary: Boundary, member: BoolArray, moving: BoolArray, place: Place
) -> FloatArray:
    """Return the ends (e, d - 1, d) of sides where moving boundaries end a surface, in 2D a curve.

    ``member`` (f,) bool: facets of the surface. ``moving`` (n,) bool: nodes of moving boundaries.
    """
    one, two = boundary.joints.T
    rim = (member[one] != member[two]) & moving[boundary.joint_nodes].all(axis=1)
    return place(boundary.joint_nodes[rim])


ROLE_NUMBER: dict[str, int] = {role: number for number, role in enumerate(ROLES)}
"""A number for each role of a marker, to compare arrays of roles."""


@record
class Tracks:
    """The tracks (curves and surfaces on which nodes slide), and the track of each sliding node."""

    tracks: tuple[ClosestPoints, ...]  # the curves and surfaces on which nodes slide
    of_node: IntArray  # (n,): index of the node's track; -1 for nodes that do not slide
    curved: bool
    """Whether any track bends or has an end within reach of its own tangent plane: whether
    projection does more than removing the normal component."""

    def farthest(self, coords: FloatArray) -> float:
        """Return the largest distance of nodes, at ``coords`` (n, d), from their tracks."""
        out = 0.0
        for index, track in enumerate(self.tracks):
            at = coords[self.of_node == index]
            out = max(out, largest_norm(track.query(at) - at))
        return out

    def project(self, coords: FloatArray, nodes: IntArray, free: FloatArray) -> FloatArray:
        """Return the displacements (m, d) from ``coords`` to the closest points on the tracks.

        ``coords`` (n, d): current positions in the frame, on the tracks.
        ``nodes`` (m,).
        ``free`` (m, d): displacements as interpolated. Zero displacements stay exactly zero. Those
        of nodes without a track become zero.
        """
        out = np.zeros_like(free)
        label = self.of_node[nodes]
        moved = np.any(free != 0, axis=1) & (label >= 0)
        for index in np.unique(label[moved]):
            rows = np.flatnonzero(moved & (label == index))
            start = coords[nodes[rows]]
            out[rows] = self.tracks[index].query(start + free[rows]) - start
        return out


def find_tracks(
    boundary: Boundary,
    fans: Fans,
    classes: Classes,
    place: Place,
    *,
    roles: Mapping[str, str],
    feature_angle_deg: float,
    shift: FloatArray | None,
    holes: IntArray,
) -> Tracks:
    """Return the tracks of all sliding nodes.

    ``place``: corners (f, k, d) of facets or segments (f, k) in the undeformed working frame.
    ``roles``: role of each marker, by its name.
    ``shift`` (d,) or None: one period, by which tracks are continued beyond periodic boundaries;
    None: they end there.
    ``holes`` (t, 4): facets that close holes of surfaces, between nodes of these.
    """
    of_node = np.full(classes.total, -1, np.int64)
    simplices: list[tuple[FloatArray, FloatArray]] = []
    curved = False
    moving = mask_of(classes.total, classes.moving)
    across = across_period(boundary, classes.representative, roles) if shift is not None else None
    vectors = corner_vectors(place(boundary.facets))
    labels = surface_labels(boundary, vectors, roles, feature_angle_deg, across)
    on_surface = classes.edge if boundary.dim == 2 else classes.surface
    fan_facet = np.zeros(len(fans.fan_node), np.int64)
    fan_facet[fans.fan] = fans.facet
    row_label = labels[fan_facet[classes.row_fan]]
    row_node = classes.cluster_node[classes.row_cluster]
    for nodes, chosen in _by_surfaces(on_surface, row_node, row_label):
        member = np.isin(labels, chosen)
        of_node[nodes] = len(simplices)
        curved |= _bends(vectors[member])
        facets = boundary.facets[member]
        closing = holes[np.isin(holes, facets).all(axis=1)]
        beside = moving.copy()
        beside[closing] = False
        rim = surface_rim(boundary, member, beside, place)
        simplices.append((as_simplices(place(np.concatenate([facets, closing]))), rim))
    if boundary.dim == 3:
        for nodes, ends in _edge_chains(boundary, fans, classes):
            of_node[nodes] = len(simplices)
            corners = place(ends)
            curved |= _bends(corners[:, 1] - corners[:, 0], either_way=True)
            node, count = np.unique(ends, return_counts=True)
            simplices.append((corners, place(node[(count == 1) & moving[node], None])))
    tracks = tuple(ordered_map(lambda track: ClosestPoints(track[0], shift, track[1]), simplices))
    return Tracks(tracks, of_node, bool(curved))


def across_period(
    boundary: Boundary, representative: IntArray, roles: Mapping[str, str]
) -> IntArray:
    """Return pairs (j, 2) of facets, not of periodic markers, that meet only by images."""
    glued = mask_of(
        len(representative), representative[representative != np.arange(len(representative))]
    )
    across = glued[representative[boundary.facets]].any(axis=1)
    across &= _role_numbers(boundary, roles) != ROLE_NUMBER["periodic"]
    facets = np.flatnonzero(across)
    count = len(across)
    pairs, nodes = find_joints(representative[boundary.facets[facets]], boundary.dim)
    pairs = np.sort(facets[pairs[glued[nodes].all(axis=1)]], axis=1)
    beside = boundary.joints[across[boundary.joints].all(axis=1)]
    beside = np.sort(beside, axis=1) @ [count, 1]
    return pairs[~np.isin(pairs @ [count, 1], beside)]


def _role_numbers(boundary: Boundary, roles: Mapping[str, str]) -> IntArray:
    given = [ROLE_NUMBER[roles.get(name, "fixed")] for name in boundary.names]
    return np.array(given, np.int64)[boundary.marker]


def surface_labels(
    boundary: Boundary,
    vectors: FloatArray,
    roles: Mapping[str, str],
    angle_deg: float,
    across: IntArray | None,
) -> IntArray:
    """Return a label for each facet, (f,), equal for facets of one smooth surface.

    Surfaces continue over markers of one role (`slideviz.rbf.classify.MERGE_FRACTION`).
    ``vectors`` (f, d): normals of the facets, of any length.
    ``angle_deg``: the feature angle.
    ``across`` (j, 2) or None: pairs of facets that meet across a periodic boundary; None: surfaces
    end there.
    """
    normal = unit(vectors)
    a, b = boundary.joints.T
    along = row_dots(normal[a], normal[b])
    role = _role_numbers(boundary, roles)
    same = boundary.marker[a] == boundary.marker[b]
    smooth = np.where(
        same,
        along > np.cos(np.radians(angle_deg)),
        (role[a] == role[b]) & (along > np.cos(np.radians(angle_deg * MERGE_FRACTION))),
    )
    a = a[smooth]
    b = b[smooth]
    if across is not None:
        one, two = across.T
        along = row_dots(normal[one], normal[two])
        smooth = (role[one] == role[two]) & (along > np.cos(np.radians(angle_deg)))
        a = np.concatenate([a, one[smooth]])
        b = np.concatenate([b, two[smooth]])
    return components(len(boundary.facets), a, b)


def _by_surfaces(
    wanted: IntArray, row_node: IntArray, row_label: IntArray
) -> list[tuple[IntArray, IntArray]]:
    """Return groups of nodes (m,) that slide on the same surfaces, and the surfaces' labels (k,).

    Most nodes slide on one surface. Where surfaces of two roles meet in one plane, the nodes
    between slide on both.
    ``wanted``: the nodes to be grouped.
    ``row_node`` and ``row_label`` (p,): pairs of a node and the label of a surface that it slides
    on.
    """
    rows = np.isin(row_node, wanted)
    pairs = np.unique(np.stack([row_node[rows], row_label[rows]], axis=1), axis=0)
    several = np.bincount(pairs[:, 0], minlength=1)[pairs[:, 0]] > 1
    single = pairs[~several]
    more = pairs[several]
    groups = {(int(label),): single[single[:, 1] == label, 0] for label in np.unique(single[:, 1])}
    together = grouped(
        (tuple(more[more[:, 0] == node, 1].tolist()), int(node)) for node in np.unique(more[:, 0])
    )
    found = [*groups.items(), *((key, np.array(nodes)) for key, nodes in together.items())]
    return [(nodes, np.array(key)) for key, nodes in found]


def as_simplices(sides: FloatArray) -> FloatArray:
    """Return segments (s, 2, 2) or triangles (s, 3, 3) of corners (f, k, d); 4 corners give two."""
    if sides.shape[1] == 2:
        return sides
    quad = sides[np.any(sides[:, 2] != sides[:, 3], axis=1)]
    return np.concatenate([sides[:, :3], quad[:, [0, 2, 3]]])


def simplex_vectors(simplices: FloatArray) -> FloatArray:
    """Return normals (m, d), of any length, of triangles (m, 3, 3) or segments (m, 2, 2)."""
    flat = simplices.shape[1] == 2
    return corner_vectors(simplices if flat else simplices[:, [0, 1, 2, 2]])


def _bends(vectors: FloatArray, either_way: bool = False) -> bool:
    """Return whether vectors (m, d) have different directions; ``either_way``: up to their sign."""
    directions = unit(vectors)
    along = directions @ directions[0]
    return bool(np.min(np.abs(along) if either_way else along) < 1.0 - 1e-12)


def _edge_chains(
    boundary: Boundary, fans: Fans, classes: Classes
) -> list[tuple[IntArray, IntArray]]:
    """Return for each chain of feature edges its sliding nodes (m,) and its segments (s, 2).

    A segment belongs to a sliding node when the two facets that meet in it are in different
    clusters of that node. Chains end at nodes that do not slide along edges. A chain that ends at
    a periodic boundary includes the one that begins at the image of its last node.
    """
    cluster = np.full(len(fans.fan_node), -1, np.int64)
    representative = classes.representative
    mine = representative[classes.cluster_node] == classes.cluster_node
    mine = mine[classes.row_cluster]
    cluster[classes.row_fan[mine]] = classes.row_cluster[mine]
    is_edge = mask_of(fans.node.max(initial=0) + 1, classes.edge)
    order = np.flatnonzero(is_edge[fans.node])
    key = fans.facet[order] * len(is_edge) + fans.node[order]
    order = order[np.argsort(key)]
    key = np.sort(key)
    keep = np.zeros(len(boundary.joints), bool)
    for column in range(boundary.joint_nodes.shape[1]):
        near = np.flatnonzero(is_edge[boundary.joint_nodes[:, column]])
        node = boundary.joint_nodes[near, column]
        rows = [
            order[np.searchsorted(key, side * len(is_edge) + node)]
            for side in boundary.joints[near].T
        ]
        first = cluster[fans.fan[rows[0]]]
        second = cluster[fans.fan[rows[1]]]
        keep[near] |= (first >= 0) & (second >= 0) & (first != second)
    ends = boundary.joint_nodes[keep]
    # Link segments at edge nodes only: number each end by its node, or by itself elsewhere.
    count = len(is_edge)
    own = count + np.arange(ends.size).reshape(ends.shape)
    tied = np.where(is_edge[ends], representative[ends], own)
    label = components(count + ends.size, tied[:, 0], tied[:, 1])
    chains = []
    node_label = label[representative[classes.edge]]
    for value in np.unique(node_label):
        segments = ends[label[tied[:, 0]] == value]
        if len(segments):
            chains.append((classes.edge[node_label == value], segments))
    return chains
