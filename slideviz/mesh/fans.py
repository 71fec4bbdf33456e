"""Fans: the facets around a node that join smoothly; and pieces, the smooth parts of a marker.

Two neighbouring facets of one marker join smoothly if the angle between their normals is below the
feature angle. Smoothly joined facets around a node form a *fan*, which has one normal; a node where
boundaries meet, or on a feature edge, has several fans. Fans are found node by node, not piece by
piece: so the sharp trailing edge of a profile that is one closed marker is found too.

`slideviz.rbf.classify` and `slideviz.rbf.projection` apply further limits to the same angles, with
``MERGE_FRACTION`` of the feature angle.
"""

from __future__ import annotations

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import (
    DEFAULT_FEATURE_ANGLE_DEG,
    BoolArray,
    FloatArray,
    IntArray,
    frozen_array,
    mask_of,
    row_dots,
    sealed,
)
from slideviz.mesh.topology import (
    TINY,
    Boundary,
    corner_vectors,
    facet_vectors,
    real_corners,
    unit,
)
from slideviz.system.jit_cache import njit


@record
class Fans:
    """Groups of smoothly joined facets of one marker around one node."""

    facet: IntArray
    node: IntArray
    fan: IntArray
    """`facet`, `node`, `fan` (i,): one entry for each pair of a facet and a node of it: the fan, an
    index below m, that the facet belongs to at that node."""
    fan_node: IntArray
    fan_marker: IntArray  # `fan_node`, `fan_marker` (m,): the node and the marker of each fan


def smooth_joints(boundary: Boundary, points: FloatArray, feature_angle_deg: float) -> BoolArray:
    """Return a mask (j,) of the joints of facets of one marker at less than the feature angle.

    ``points`` (n, d) are the Cartesian coordinates of the undeformed mesh.
    """
    normal = unit(facet_vectors(points, boundary.facets))
    a, b = boundary.joints.T
    along = row_dots(normal[a], normal[b])
    return (along > np.cos(np.radians(feature_angle_deg))) & (
        boundary.marker[a] == boundary.marker[b]
    )


def find_fans(
    boundary: Boundary, points: FloatArray, feature_angle_deg: float = DEFAULT_FEATURE_ANGLE_DEG
) -> Fans:
    """Return the fans of smoothly joined facets around every boundary node."""
    count, width = boundary.facets.shape
    facet = np.repeat(np.arange(count), width)
    node = boundary.facets.ravel()
    real = real_corners(boundary.facets).ravel()
    facet = facet[real]
    node = node[real]
    row = np.full(count * width, -1, np.int64)
    row[np.flatnonzero(real)] = np.arange(len(node))
    smooth = smooth_joints(boundary, points, feature_angle_deg)
    links = []
    for shared in boundary.joint_nodes[smooth].T:
        ends = [
            row[side * width + (boundary.facets[side] == shared[:, None]).argmax(axis=1)]
            for side in boundary.joints[smooth].T
        ]
        links.append(np.stack(ends))
    a, b = np.concatenate(links, axis=1) if links else np.empty((2, 0), np.int64)
    fan = components(len(node), a, b)
    # By position, so that the fans of a node, and the normals of a fan, are added up in one order
    # however facets are numbered.
    corners = points[boundary.facets].swapaxes(0, 1)  # of a mean the fastest order
    place = np.lexsort((sum(corners[1:], corners[0]) / width).T)
    order = row.reshape(-1, width)[place].ravel()
    order = order[order >= 0]
    facet = facet[order]
    node = node[order]
    fan = fan[order]
    total = int(fan.max(initial=-1)) + 1
    first = np.empty(total, np.int64)
    first[fan[::-1]] = np.arange(len(fan))[::-1]
    is_first = mask_of(len(fan), first)
    fan = (np.cumsum(is_first) - 1)[first][fan]
    fan_node = np.empty(total, np.int64)
    fan_marker = np.empty(total, np.int64)
    fan_node[fan] = node
    fan_marker[fan] = boundary.marker[facet]
    return Fans(*map(frozen_array, (facet, node, fan, fan_node, fan_marker)))


def fan_normals(
    boundary: Boundary, fans: Fans, coords: FloatArray, corners: FloatArray | None = None
) -> FloatArray:
    """Return the unit normal of each fan, (m, d), in the frame of ``coords`` (n, d).

    It is the mean of the facets' unit normals, weighted with the inverse distance from the node
    to the facet's centre (thesis section 2.4.4). ``corners`` (f, k, d) are those of the facets in
    that frame, where they are not ``coords[boundary.facets]`` (in cylindrical coordinates at the
    axis, where a node has no angle).
    """
    x = coords[boundary.facets] if corners is None else corners
    normal = unit(corner_vectors(x))
    width = boundary.facets.shape[1]
    share = np.array([[1 / width] * width, [1 / 3, 1 / 3, 1 / 6, 1 / 6][:width]])
    total = np.zeros((len(fans.fan_node), coords.shape[1]))
    # Sealed, whatever they came from: the loop is compiled once.
    incidence = (sealed(each) for each in (fans.facet, fans.node, fans.fan))
    _add_normals(sealed(coords), sealed(boundary.facets), x, share, normal, *incidence, total)
    return unit(total)


@njit
def _add_normals(coords, facets, x, share, normal, facet, node, fan, total):  # type: ignore[no-untyped-def]
    """Add the weighted normals (f, d) of facets with corners ``x`` to their fans' ``total``.

    ``share`` (2, k) has the weights of the corners in the centre of a facet (row 0) and of a
    triangle that repeats its last node (row 1).
    """
    for row in range(len(facet)):
        f = facet[row]
        squared = 0.0
        triangle = facets.shape[1] == 4 and facets[f, 2] == facets[f, 3]
        for axis in range(coords.shape[1]):
            centre = 0.0
            for k in range(facets.shape[1]):
                centre += share[1 if triangle else 0, k] * x[f, k, axis]
            off = coords[node[row], axis] - centre
            squared += off * off
        nearness = 1.0 / max(np.sqrt(squared), TINY)
        for axis in range(coords.shape[1]):
            total[fan[row], axis] += nearness * normal[f, axis]


def find_pieces(
    boundary: Boundary, points: FloatArray, feature_angle_deg: float = DEFAULT_FEATURE_ANGLE_DEG
) -> IntArray:
    """Return the index (f,) of the piece, a smooth part of one marker, that each facet is in."""
    smooth = smooth_joints(boundary, points, feature_angle_deg)
    a, b = boundary.joints[smooth].T
    return components(len(boundary.facets), a, b)


def components(count: int, a: IntArray, b: IntArray) -> IntArray:
    """Return the index (count,) of the connected part that each of ``count`` vertices is in.

    ``a`` and ``b`` (m,) are the pairs of vertices of a graph that are connected.
    """
    label = np.arange(count)
    _unite(np.ascontiguousarray(a, np.int64), np.ascontiguousarray(b, np.int64), label)
    return label


@njit
def _unite(a, b, label):  # type: ignore[no-untyped-def]
    """Replace ``label`` (count,), given as 0, 1, 2, ..., by the part that each vertex is in.

    Parts are trees whose root is their first vertex (R. E. Tarjan, Efficiency of a good but not
    linear set union algorithm, 1975), and are numbered in the order of their roots.
    """
    for k in range(len(a)):
        one = _root(label, a[k])
        two = _root(label, b[k])
        label[max(one, two)] = min(one, two)
    count = 0
    for i in range(len(label)):
        if label[i] == i:
            label[i] = count
            count += 1
        else:
            label[i] = label[label[i]]  # of a vertex before it, which has its number already


@njit
def _root(label, i):  # type: ignore[no-untyped-def]
    """Return the root of the tree that ``i`` is in; shorten the path there (path halving)."""
    while label[i] != i:
        label[i] = label[label[i]]
        i = label[i]
    return i
