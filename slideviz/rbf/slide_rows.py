"""The surfaces that meet at each sliding node, and the rank of their normals.

Rules of smoothness elsewhere: see `slideviz.rbf.classify.MERGE_FRACTION`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import unit
from slideviz.system.jit_cache import njit

RANK_TOLERANCE = 0.02
"""Sine of the angle (about one degree) from which a further normal counts as independent."""

IN_PLANE = np.sqrt(1.0 - RANK_TOLERANCE**2)
"""Cosine of that angle: fans at a smaller angle are in one plane."""


@dataclass(frozen=True, eq=False)
class FansAround:
    """All fans, with what decides which of them are one surface."""

    node: IntArray
    own: IntArray
    """`node`, `own` (m,): the node that represents the fan's node and its periodic images, and the
    fan's node itself."""
    role: np.ndarray
    """(m,) str: role of the fan's marker."""
    normals: FloatArray
    """(m, d): unit normals."""
    smooth: float
    merge: float
    """`smooth`, `merge`: fans of one role are one surface when the cosine of the angle between
    their normals is above these: ``smooth`` for fans of two periodic images, where a surface may
    continue beyond the periodic boundary, ``merge`` for fans of one node."""


def nodes_with(at: IntArray, chosen: np.ndarray, total: int) -> np.ndarray:
    """Return a mask (total,) of the nodes of the chosen fans."""
    mask = np.zeros(total, bool)
    mask[at[chosen]] = True
    return mask


def slide_rows(around: FansAround, active: np.ndarray) -> tuple[IntArray, IntArray]:
    """Return rows (r, 2) of a fan and its cluster within its node, and the nodes of full rank (f,).

    For the fans in the mask ``active`` (m,); nodes are representatives of periodic images.
    """
    chosen = np.flatnonzero(active)
    if not len(chosen):
        return np.empty((0, 2), np.int64), np.empty(0, np.int64)
    chosen = _one_sided(around, chosen)
    node = around.node[chosen]
    cluster = np.zeros(len(chosen), np.int64)
    starts = np.flatnonzero(np.r_[True, node[1:] != node[:-1]])
    size = np.diff(np.r_[starts, len(node)])
    several = np.flatnonzero(np.repeat(size > 1, size))
    if not len(several):
        return np.stack([chosen, cluster], axis=1), np.empty(0, np.int64)
    size = size[size > 1]
    group, local = np.repeat(np.arange(len(size)), size), chosen[several]
    label = _clusters(around, local, size)
    rank = _ranks(around.normals[local], group, label)
    # Boundaries of two roles in one plane (walls before and within a passage) have one normal.
    cluster[several] = np.where(rank[group] > 1, label, 0)
    first = np.cumsum(size) - size
    return np.stack([chosen, cluster], axis=1), node[several][
        first[rank >= around.normals.shape[1]]
    ]


def _one_sided(around: FansAround, chosen: IntArray) -> IntArray:
    """Return the fans ``chosen`` (k,) ordered by node, without the opposite sides of others.

    A periodic boundary and its image are one surface, seen from both sides: of its two opposite
    fans the one at the representative node is kept.
    """
    image = around.own[chosen] != around.node[chosen]
    chosen = chosen[np.lexsort([chosen, image, around.node[chosen]])]
    node, own = around.node[chosen], around.own[chosen]
    first = np.searchsorted(node, node)
    rows = np.flatnonzero(own != node)
    drop = np.zeros(len(chosen), bool)
    # The first fan of the node, then its second and so on, beside all fans of its images.
    while len(rows):
        mine = first[rows] < rows
        rows, other = rows[mine], first[rows[mine]]
        along = np.einsum("rd,rd->r", around.normals[chosen[rows]], around.normals[chosen[other]])
        drop[rows] |= (along < -around.merge) & (own[rows] != own[other])
        first[rows] += 1
    return chosen[~drop]


def _clusters(around: FansAround, local: IntArray, size: IntArray) -> IntArray:
    """Return the cluster of each fan, (m,): equal for fans of one node that are one surface.

    Fans of one role at a small angle are one surface, and fans in one plane whatever their roles.
    So are fans connected by others between them: the order of the fans does not matter. Clusters
    are numbered 0, 1, ... at each node.

    Parameters
    ----------
    local : (m,)
        The fans, those of a node together.
    size : (g,)
        The number of fans of each node.
    """
    label = np.empty(len(local), np.int64)
    role = np.unique(around.role[local].astype(str), return_inverse=True)[1]
    normals, own = around.normals[local], around.own[local]
    _join(size, normals, role, own, around.smooth, around.merge, label)
    return label


@njit(nogil=True, cache=True)
def _join(size, normals, role, own, smooth, merge, label):  # type: ignore[no-untyped-def]
    """Write what `_clusters` returns to ``label`` (m,); ``role`` (m,) are numbers."""
    start = 0
    for count in size:
        stop = start + count
        roles, nodes, labels = role[start:stop], own[start:stop], label[start:stop]
        alike = _cosines(normals[start:stop])
        goes_on = _continuations(alike, roles, nodes, smooth)
        for i in range(count):
            labels[i] = i
        for i in range(count):
            for j in range(i):
                one = roles[i] == roles[j] and nodes[i] == nodes[j] and alike[i, j] > merge
                if one or (goes_on[i, j] and goes_on[j, i]) or alike[i, j] > IN_PLANE:
                    _replace(labels, labels[i], labels[j])
        _close_gaps(labels)
        start = stop


@njit(nogil=True, cache=True)
def _cosines(normals):  # type: ignore[no-untyped-def]
    """Return the cosines of the angles between unit normals (c, d): (c, c)."""
    count = len(normals)
    alike = np.zeros((count, count))
    for i in range(count):
        for j in range(count):
            for axis in range(normals.shape[1]):
                alike[i, j] += normals[i, axis] * normals[j, axis]
    return alike


@njit(nogil=True, cache=True)
def _continuations(alike, roles, nodes, smooth):  # type: ignore[no-untyped-def]
    """Return a mask (c, c): whether the surface of fan i continues in fan j of an image.

    At each image at most in one fan: of the same role, and at the smallest angle.
    """
    count = len(roles)
    goes_on = np.zeros((count, count), np.bool_)
    for i in range(count):
        for k in range(count):  # nodes[k]: an image
            most = -1
            for j in range(count):
                if nodes[j] == nodes[k] and nodes[j] != nodes[i] and roles[j] == roles[i]:
                    most = j if most < 0 or alike[i, j] > alike[i, most] else most
            if most >= 0 and alike[i, most] > smooth:
                goes_on[i, most] = True
    return goes_on


@njit(nogil=True, cache=True)
def _replace(labels, old, new):  # type: ignore[no-untyped-def]
    """Replace label ``old`` by ``new``, in place."""
    for k in range(len(labels)):
        if labels[k] == old:
            labels[k] = new


@njit(nogil=True, cache=True)
def _close_gaps(labels):  # type: ignore[no-untyped-def]
    """Renumber labels 0, 1, ... in place, in order; `np.unique` would take long to compile."""
    number = np.zeros(len(labels), np.int64)
    for label in labels:
        number[label] = 1
    for i in range(1, len(number)):
        number[i] += number[i - 1]
    for i in range(len(labels)):
        labels[i] = number[labels[i]] - 1


def _ranks(normals: FloatArray, group: IntArray, label: IntArray) -> IntArray:
    """Return the rank of the mean normals of each node's clusters, (g,).

    Where two are opposite (a thin tip) it counts as full, d.

    Parameters
    ----------
    normals, group, label : (m, d), (m,), (m,)
        The normals of fans, the number of their node, and of their cluster there.
    """
    dim = normals.shape[1]
    means = np.zeros((int(group[-1]) + 1, int(label.max()) + 1, dim))
    np.add.at(means, (group, label), normals)
    means = unit(means)
    opposite = (means @ means.swapaxes(1, 2)).min(axis=(1, 2)) < -1.0 + 1e-4
    found = np.sum(np.linalg.svd(means, compute_uv=False) > RANK_TOLERANCE, axis=1)
    return np.where(opposite, dim, found)
