"""Which node carries which constraints, from topology and roles (thesis sections 2.4 and 4).

Every boundary node collects the normals of its fans. Their rank decides: 1, it slides on the
surface (3D) or the curve (2D); 2, it slides along an edge (3D) or is fixed (2D); 3, it is fixed.
A moving marker wins over a fixed one, and both over all others, at shared nodes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import Boundary, Fans, fan_normals, unit

MERGE_FRACTION = 0.25
"""Boundaries that meet at a smaller angle than this part of the feature angle are one surface
for a node between them (a circular far field in two markers); the full feature angle would
round off true corners of the domain."""

RANK_TOLERANCE = 0.02
"""Sine of the angle (about one degree) from which a further normal counts as independent."""


@dataclass(frozen=True, eq=False)
class Classes:
    """Nodes by what they may do.

    Attributes
    ----------
    moving, fixed : (a,), (b,) int64
        Nodes whose displacement is known: prescribed, or zero.
    edge, surface : (c,), (e,) int64
        Nodes that slide along a curve (in 2D all sliding nodes), and on a surface.
    cluster_node : (q,) int64
        The node of each independent normal of a sliding node, sorted.
    row_fan, row_cluster : (p,) int64
        The fans whose normals add up to each cluster's.
    total : int
        Number of all nodes of the mesh.
    beyond : int
        Number of those that lie beyond its sides (in a halo), and are counted nowhere.
    """

    moving: IntArray
    fixed: IntArray
    edge: IntArray
    surface: IntArray
    cluster_node: IntArray
    row_fan: IntArray
    row_cluster: IntArray
    total: int
    beyond: int = 0

    @property
    def sliding(self) -> IntArray:
        """Return edge and surface nodes, sorted."""
        return np.sort(np.concatenate([self.edge, self.surface]))

    def counts(self) -> dict[str, int]:
        """Return the number of nodes of each kind, under the report's names."""
        known = {
            "moving": len(self.moving),
            "fixed": len(self.fixed),
            "sliding_edge": len(self.edge),
            "sliding_surface": len(self.surface),
        }
        return {**known, "internal": self.total - self.beyond - sum(known.values())}


def classify(
    boundary: Boundary,
    fans: Fans,
    points: FloatArray,
    roles: Mapping[str, str],
    method: tuple[str, str],
    feature_angle_deg: float,
) -> Classes:
    """Return the classes of all nodes.

    Parameters
    ----------
    points : (n, d)
        Undeformed Cartesian coordinates.
    roles
        ``moving``, ``fixed``, ``sliding``, ``periodic`` or ``internal`` by marker name; a marker
        without a role is fixed.
    method
        ``(sliding, periodic)``: ``none``, ``ps`` or ``ds``, and ``none``, ``periodic``,
        ``fixed`` or ``moving``.
    """
    given = [roles.get(name, "fixed") for name in boundary.names]
    fan_role = np.array(given, object)[fans.fan_marker] if given else np.empty(0, object)
    effect = _effects(fan_role, fans, *method)
    total = len(points)
    moving = _nodes_with(fans, effect == "moving", total)
    fixed = _nodes_with(fans, effect == "fixed", total) & ~moving
    active = (effect == "slide") & ~(moving | fixed)[fans.fan_node]
    normals = fan_normals(boundary, fans, points)
    merge = np.cos(np.radians(feature_angle_deg * MERGE_FRACTION))
    rows, extra = _slide_rows(fans, active, fan_role, normals, merge)
    if method[1] == "fixed":
        # Vertices are held: nodes that would be fixed if the periodic markers slid, too.
        watched = active | ((fan_role == "periodic") & ~(moving | fixed)[fans.fan_node])
        _, held = _slide_rows(fans, watched, fan_role, normals, merge)
        touched = _nodes_with(fans, active, total)
        extra = np.concatenate([extra, held[touched[held]]])
    fixed[extra] = True
    keep = ~fixed[fans.fan_node[rows[:, 0]]]
    return _collect(moving, fixed, rows[keep], fans, boundary.dim)


def _effects(fan_role: np.ndarray, fans: Fans, sliding: str, periodic: str) -> np.ndarray:
    """Return what each fan does to its node: moving, fixed, slide or free."""
    effect = fan_role.copy()
    slide = "fixed" if sliding == "none" else "slide"
    effect[fan_role == "sliding"] = slide
    effect[fan_role == "periodic"] = slide if periodic in ("none", "periodic") else "free"
    # The border of an internal marker is where it meets a marker of another role.
    count = int(fans.fan_node.max(initial=-1)) + 1
    other = np.zeros(count, bool)
    other[fans.fan_node[fan_role != "internal"]] = True
    internal = fan_role == "internal"
    effect[internal] = np.where(other[fans.fan_node[internal]], slide, "free")
    return effect


def _nodes_with(fans: Fans, chosen: np.ndarray, total: int) -> np.ndarray:
    """Return a mask (total,) of the nodes of the chosen fans."""
    mask = np.zeros(total, bool)
    mask[fans.fan_node[chosen]] = True
    return mask


def _slide_rows(
    fans: Fans, active: np.ndarray, fan_role: np.ndarray, normals: FloatArray, merge: float
) -> tuple[IntArray, IntArray]:
    """Return rows (fan, cluster within its node) of active fans, and the nodes of full rank."""
    chosen = np.flatnonzero(active)
    if not len(chosen):
        return np.empty((0, 2), np.int64), np.empty(0, np.int64)
    chosen = chosen[np.argsort(fans.fan_node[chosen], kind="stable")]
    node = fans.fan_node[chosen]
    cluster = np.zeros(len(chosen), np.int64)
    full = []
    starts = np.flatnonzero(np.r_[True, node[1:] != node[:-1]])
    for start, stop in zip(starts, np.r_[starts[1:], len(node)], strict=True):
        if stop - start == 1:
            continue
        local = chosen[start:stop]
        labels = _cluster(normals[local], fan_role[local], merge)
        rank = _rank(normals[local], labels)
        # Boundaries of two roles in one plane (walls before and within a passage) have one normal.
        cluster[start:stop] = labels if rank > 1 else 0
        if rank >= normals.shape[1]:
            full.append(node[start])
    return np.stack([chosen, cluster], axis=1), np.array(full, np.int64)


def _cluster(normals: FloatArray, roles: np.ndarray, merge: float) -> IntArray:
    """Return labels (m,) that join fans of one role whose normals differ by a small angle."""
    labels = np.arange(len(normals))
    for i in range(1, len(normals)):
        for j in range(i):
            if roles[i] == roles[j] and normals[i] @ normals[j] > merge:
                labels[i] = labels[j]
                break
    return np.unique(labels, return_inverse=True)[1]


def _rank(normals: FloatArray, labels: IntArray) -> int:
    """Return the rank of the clusters' normals; opposite ones (a thin tip) count as full."""
    dim = normals.shape[1]
    means = unit(np.stack([normals[labels == k].sum(axis=0) for k in range(labels.max() + 1)]))
    products = means @ means.T
    if products.min() < -1.0 + 1e-4:
        return dim
    return int(np.sum(np.linalg.svd(means, compute_uv=False) > RANK_TOLERANCE))


def _collect(
    moving: np.ndarray, fixed: np.ndarray, rows: IntArray, fans: Fans, dim: int
) -> Classes:
    """Return the classes, with clusters numbered over all sliding nodes."""
    node = fans.fan_node[rows[:, 0]]
    order = np.lexsort((rows[:, 1], node))
    rows, node = rows[order], node[order]
    new = np.ones(len(rows), bool)
    new[1:] = (node[1:] != node[:-1]) | (rows[1:, 1] != rows[:-1, 1])
    cluster_node = node[new]
    slid, per_node = np.unique(cluster_node, return_counts=True)
    on_surface = (per_node == 1) if dim == 3 else np.zeros(len(slid), bool)
    return Classes(
        np.flatnonzero(moving),
        np.flatnonzero(fixed),
        slid[~on_surface],
        slid[on_surface],
        cluster_node,
        rows[:, 0],
        np.cumsum(new) - 1,
        len(moving),
    )


def directions(
    classes: Classes, normals: FloatArray, images: Mapping[int, int] | None = None
) -> tuple[IntArray, FloatArray]:
    """Return the constraints of the sliding nodes: nodes (q,) and unit directions (q, d).

    The directions of one node are orthonormal and span the clusters' normals.

    Parameters
    ----------
    normals : (m, d)
        Of all fans, in the working frame.
    images
        Periodic partner of each node; partners get the mean of both normals, because the
        surface goes on beyond the periodic boundary.
    """
    total = np.zeros((len(classes.cluster_node), normals.shape[1]))
    np.add.at(total, classes.row_cluster, normals[classes.row_fan])
    total = unit(total)
    node = classes.cluster_node
    slid, starts = np.unique(node, return_index=True)
    stops = np.append(starts, len(node))[1:]
    size = stops - starts
    if images:
        total = _averaged(total, (slid, starts, size), images)
    first = starts[size == 2]
    share = np.einsum("pd,pd->p", total[first + 1], total[first])
    total[first + 1] = unit(total[first + 1] - share[:, None] * total[first])
    keep = np.ones(len(node), bool)
    for start, stop in zip(starts[size > 2], stops[size > 2], strict=True):
        # More than two normals of rank 2: the two leading right singular vectors.
        total[start : start + 2] = np.linalg.svd(total[start:stop])[2][:2]
        keep[start + 2 : stop] = False
    return node[keep], total[keep]


def _averaged(
    total: FloatArray, spans: tuple[IntArray, IntArray, IntArray], images: Mapping[int, int]
) -> FloatArray:
    """Return cluster normals averaged with those of the periodic partner where they are alike.

    Parameters
    ----------
    spans
        Each node, its first row in ``total``, and the number of its rows.
    """
    slid, starts, size = spans
    pairs = np.array([(a, b) for a, b in images.items()], np.int64).reshape(-1, 2)
    pairs = pairs[np.isin(pairs, slid).all(axis=1)]
    own, other = np.searchsorted(slid, pairs).T
    row = starts[own].repeat(size[own])
    row += np.arange(len(row)) - (np.cumsum(size[own]) - size[own]).repeat(size[own])
    partner = other.repeat(size[own])
    most, like = np.full(len(row), 0.5), np.full(len(row), -1)
    for k in range(int(size.max(initial=0))):
        at = np.minimum(starts[partner] + k, len(total) - 1)
        along = np.einsum("rd,rd->r", total[row], total[at])
        closer = (k < size[partner]) & (along > most)
        most[closer], like[closer] = along[closer], at[closer]
    alike = like >= 0
    out = total.copy()
    out[row[alike]] += total[like[alike]]
    return unit(out)
