"""Closest points on the boundary: where a freely displaced node slides to.

The exact closest point on the node's own piece, not the thesis's nearest-midpoint iteration
(section 2.4.3), which approximates it and can cycle for ever. Pieces are taken at the
undeformed boundary, in the working frame, so an arc about the axis stays an arc, and a slid
node never leaves its curve or surface however many steps are made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import Boundary, Fans, facet_vectors, unit
from slideviz.rbf.classify import MERGE_FRACTION, Classes

FIRST_TRY = 8


@dataclass(frozen=True, eq=False)
class Track:
    """One curve or surface on which nodes slide.

    Attributes
    ----------
    corners : (s, c, d) float64
        Simplices in the working frame: segments (c = 2) or triangles (c = 3).
    """

    corners: FloatArray
    tree: cKDTree = field(init=False, repr=False)
    reach: float = field(init=False)

    def __post_init__(self) -> None:
        centre = self.corners.mean(axis=1)
        span = np.linalg.norm(self.corners - centre[:, None], axis=2)
        object.__setattr__(self, "tree", cKDTree(centre))
        object.__setattr__(self, "reach", float(span.max()))

    def closest(self, x: FloatArray) -> FloatArray:
        """Return the closest point of the track for each x, (m, d).

        The nearest centres are tried first; a point is settled when every simplex further away
        must be farther than the best one found.
        """
        out = np.empty_like(x)
        open_, tried = np.arange(len(x)), min(FIRST_TRY, len(self.corners))
        while len(open_):
            near = self.tree.query(x[open_], k=list(range(1, tried + 1)))
            distance, index = (np.asarray(found) for found in near)
            points = _closest_on_simplices(x[open_][:, None, :], self.corners[index])
            gaps = np.linalg.norm(points - x[open_][:, None, :], axis=2)
            best = np.argmin(gaps, axis=1)
            rows = np.arange(len(open_))
            out[open_] = points[rows, best]
            if tried == len(self.corners):
                break
            open_ = open_[gaps[rows, best] > distance[:, -1] - self.reach]
            tried = min(4 * tried, len(self.corners))
        return out


def _closest_on_simplices(x: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the closest point to x (m, 1, d) on each simplex (m, k, c, d): (m, k, d)."""
    if corners.shape[2] == 2:
        return _closest_on_segments(x, corners[:, :, 0], corners[:, :, 1])
    a, b, c = (corners[:, :, i] for i in range(3))
    u, v, w = b - a, c - a, x - a
    uu, uv, vv = _dot(u, u), _dot(u, v), _dot(v, v)
    wu, wv = _dot(w, u), _dot(w, v)
    area = uu * vv - uv * uv
    safe = np.where(area > 0, area, 1.0)
    s, t = (vv * wu - uv * wv) / safe, (uu * wv - uv * wu) / safe
    inside = (area > 0) & (s >= 0) & (t >= 0) & (s + t <= 1)
    result = a + s[..., None] * u + t[..., None] * v
    sides = np.stack([_closest_on_segments(x, *ends) for ends in ((a, b), (b, c), (c, a))])
    nearest = np.argmin(np.linalg.norm(sides - x, axis=3), axis=0)
    border = np.take_along_axis(sides, nearest[None, :, :, None], axis=0)[0]
    return np.where(inside[..., None], result, border)


def _closest_on_segments(x: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the closest points to x on segments from a to b, all (m, k, d)."""
    u = b - a
    length = _dot(u, u)
    t = np.clip(_dot(x - a, u) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    return a + t[..., None] * u


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("mkd,mkd->mk", a, np.broadcast_to(b, a.shape))


@dataclass(frozen=True, eq=False)
class Tracks:
    """All tracks, and which one each sliding node is on.

    Attributes
    ----------
    tracks : tuple of Track
    of_node : (n,) int64
        Index of the node's track; -1 for nodes that do not slide.
    curved : bool
        Whether any track bends or has an end within reach of its own tangent plane: whether
        projection does more than removing the normal component.
    """

    tracks: tuple[Track, ...]
    of_node: IntArray
    curved: bool

    def project(self, coords: FloatArray, nodes: IntArray, free: FloatArray) -> FloatArray:
        """Return the displacements (m, d) that bring the nodes back on their tracks.

        Parameters
        ----------
        coords : (n, d)
            Current positions in the frame, on the tracks.
        nodes : (m,)
        free : (m, d)
            Displacements as interpolated. Zero ones stay exactly zero.
        """
        out = np.zeros_like(free)
        label = self.of_node[nodes]
        moved = np.any(free != 0, axis=1)
        for index in np.unique(label[moved]):
            rows = np.flatnonzero(moved & (label == index))
            start = coords[nodes[rows]]
            out[rows] = self.tracks[index].closest(start + free[rows]) - start
        return out


def find_tracks(
    boundary: Boundary,
    fans: Fans,
    classes: Classes,
    coords: FloatArray,
    settings: tuple[Mapping[str, str], float, FloatArray | None],
) -> Tracks:
    """Return the tracks of all sliding nodes.

    Parameters
    ----------
    coords : (n, d)
        Undeformed coordinates in the working frame.
    settings
        Roles by marker, feature angle in degrees, and the shift (d,) of one period by which
        tracks are continued beyond periodic boundaries (None: they end there).
    """
    roles, angle_deg, shift = settings
    of_node = np.full(len(coords), -1, np.int64)
    tracks: list[Track] = []
    curved = False
    labels = _surface_labels(boundary, coords, roles, angle_deg)
    on_surface = classes.edge if boundary.dim == 2 else classes.surface
    fan_facet = np.zeros(len(fans.fan_node), np.int64)
    fan_facet[fans.fan] = fans.facet
    row_label = labels[fan_facet[classes.row_fan]]
    row_node = classes.cluster_node[classes.row_cluster]
    for nodes, chosen in _by_surfaces(on_surface, row_node, row_label):
        facets = boundary.facets[np.isin(labels, chosen)]
        of_node[nodes] = len(tracks)
        corners = _simplices(coords, facets)
        curved |= _bends(facet_vectors(coords, facets))
        tracks.append(Track(_continued(corners, shift)))
    if boundary.dim == 3:
        for nodes, ends in _edge_chains(boundary, fans, classes):
            of_node[nodes] = len(tracks)
            corners = coords[ends]
            curved |= _bends(corners[:, 1] - corners[:, 0], either_way=True)
            tracks.append(Track(_continued(corners, shift)))
    return Tracks(tuple(tracks), of_node, bool(curved))


def _surface_labels(
    boundary: Boundary, coords: FloatArray, roles: Mapping[str, str], angle_deg: float
) -> IntArray:
    """Return labels (f,) of facets joined smoothly, also across markers of one role."""
    normal = unit(facet_vectors(coords, boundary.facets))
    a, b = boundary.joints.T
    along = np.einsum("jd,jd->j", normal[a], normal[b])
    role = np.array([roles.get(name, "fixed") for name in boundary.names])[boundary.marker]
    same = boundary.marker[a] == boundary.marker[b]
    smooth = np.where(
        same,
        along > np.cos(np.radians(angle_deg)),
        (role[a] == role[b]) & (along > np.cos(np.radians(angle_deg * MERGE_FRACTION))),
    )
    return _components(len(boundary.facets), a[smooth], b[smooth])


def _by_surfaces(
    wanted: IntArray, row_node: IntArray, row_label: IntArray
) -> list[tuple[IntArray, IntArray]]:
    """Return nodes (m,) that slide on the same surfaces, and the labels of these (k,).

    Most slide on one. Where surfaces of two roles meet in one plane it is both of them.
    """
    rows = np.isin(row_node, wanted)
    pairs = np.unique(np.stack([row_node[rows], row_label[rows]], axis=1), axis=0)
    several = np.bincount(pairs[:, 0], minlength=1)[pairs[:, 0]] > 1
    single, more = pairs[~several], pairs[several]
    groups = {(int(label),): single[single[:, 1] == label, 0] for label in np.unique(single[:, 1])}
    together: dict[tuple[int, ...], list[int]] = {}
    for node in np.unique(more[:, 0]):
        key = tuple(int(label) for label in more[more[:, 0] == node, 1])
        together.setdefault(key, []).append(int(node))
    found = [*groups.items(), *((key, np.array(nodes)) for key, nodes in together.items())]
    return [(nodes, np.array(key)) for key, nodes in found]


def _components(count: int, a: IntArray, b: IntArray) -> IntArray:
    graph = coo_array((np.ones(len(a), np.int8), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _simplices(coords: FloatArray, facets: IntArray) -> FloatArray:
    """Return segments (2D) or triangles (3D, quadrilaterals as two) with corners in the frame."""
    if facets.shape[1] == 2:
        return coords[facets]
    quad = facets[facets[:, 2] != facets[:, 3]]
    return coords[np.concatenate([facets[:, :3], quad[:, [0, 2, 3]]])]


def _continued(corners: FloatArray, shift: FloatArray | None) -> FloatArray:
    """Return the simplices with their images one period before and after."""
    if shift is None:
        return corners
    return np.concatenate([corners, corners - shift, corners + shift])


def _bends(vectors: FloatArray, either_way: bool = False) -> bool:
    """Tell whether the directions of vectors (m, d) differ."""
    directions = unit(vectors)
    along = directions @ directions[0]
    return bool(np.min(np.abs(along) if either_way else along) < 1.0 - 1e-12)


def _edge_chains(
    boundary: Boundary, fans: Fans, classes: Classes
) -> list[tuple[IntArray, IntArray]]:
    """Return for each chain of feature edges its sliding nodes (m,) and its segments (s, 2).

    A segment belongs to a sliding node when the two facets that meet in it are in different
    clusters of that node's constraints. Chains end at nodes that do not slide along edges.
    """
    cluster = np.full(len(fans.fan_node), -1, np.int64)
    cluster[classes.row_fan] = classes.row_cluster
    key = np.sort(fans.facet * (fans.node.max(initial=0) + 1) + fans.node)
    order = np.argsort(fans.facet * (fans.node.max(initial=0) + 1) + fans.node)
    is_edge = np.zeros(fans.node.max(initial=0) + 1, bool)
    is_edge[classes.edge] = True
    keep = np.zeros(len(boundary.joints), bool)
    for column in range(boundary.joint_nodes.shape[1]):
        node = boundary.joint_nodes[:, column]
        rows = [
            order[np.searchsorted(key, side * len(is_edge) + node)] for side in boundary.joints.T
        ]
        first, second = (cluster[fans.fan[row]] for row in rows)
        keep |= is_edge[node] & (first >= 0) & (second >= 0) & (first != second)
    ends = boundary.joint_nodes[keep]
    # Link segments at edge nodes only: number each end by its node, or by itself elsewhere.
    count = len(is_edge)
    own = count + np.arange(ends.size).reshape(ends.shape)
    tied = np.where(is_edge[ends], ends, own)
    label = _components(count + ends.size, tied[:, 0], tied[:, 1])
    chains = []
    node_label = label[classes.edge]
    for value in np.unique(node_label):
        segments = ends[label[tied[:, 0]] == value]
        if len(segments):
            chains.append((classes.edge[node_label == value], segments))
    return chains
