"""Classes of nodes: the constraints of each, from topology and roles (thesis 2.4 and 4).

Every boundary node collects the normals of its fans. The rank of the normals decides: 1, the node
slides on the surface (3D) or the curve (2D); 2, it slides along an edge (3D) or is fixed (2D);
3, it is fixed. A moving marker wins over a fixed one, and both over all others, at shared nodes.

Periodic images are classified as one node, with the fans of all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slideviz.mesh.fans import Fans
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import Boundary, unit
from slideviz.rbf.slide_rows import FansAround, nodes_with, slide_rows

MERGE_FRACTION = 0.25
"""Boundaries that meet at a smaller angle than this part of the feature angle are one surface
for a node between them (a circular far field in two markers); the full feature angle would
round off true corners of the domain. Which boundaries are one surface is also decided in
`slideviz.mesh.fans.smooth_joints`, `slideviz.rbf.slide_rows` and ``projection._surface_labels``:
change them together."""


@dataclass(frozen=True, eq=False)
class Classes:
    """The nodes of a mesh by class: moving, fixed, sliding on edges or on surfaces, internal."""

    moving: IntArray
    fixed: IntArray
    """`moving`, `fixed` (a,), (b,): nodes whose displacement is known: prescribed, or zero."""
    edge: IntArray
    surface: IntArray
    """`edge`, `surface` (c,), (e,): nodes that slide along a curve (in 2D all sliding nodes), and
    on a surface."""
    cluster_node: IntArray
    """(q,): the node of each cluster, sorted. A cluster is the fans of a sliding node that share a
    normal; a node has as many clusters as different normals."""
    row_fan: IntArray
    row_cluster: IntArray
    """`row_fan`, `row_cluster` (p,): pairs of a fan and the cluster that it belongs to."""
    representative: IntArray
    """(n,): for each node of the mesh, the number of the periodic image that represents it (itself,
    if it has none)."""
    beyond: int = 0
    """Number of nodes beyond the periodic sides (in a halo), which `counts` leaves out."""

    @property
    def total(self) -> int:
        """Return the number of all nodes of the mesh."""
        return len(self.representative)

    @property
    def sliding(self) -> IntArray:
        """Return edge and surface nodes, sorted."""
        return np.sort(np.concatenate([self.edge, self.surface]))

    def counts(self) -> dict[str, int]:
        """Return the number of nodes of each class, by its name in the report."""
        known = {
            "moving": len(self.moving),
            "fixed": len(self.fixed),
            "sliding_edge": len(self.edge),
            "sliding_surface": len(self.surface),
        }
        return {**known, "internal": self.total - self.beyond - sum(known.values())}


def fan_roles(boundary: Boundary, fans: Fans, roles: Mapping[str, str]) -> np.ndarray:
    """Return the role of each fan's marker, (m,); a marker without a role is fixed."""
    given = [roles.get(name, "fixed") for name in boundary.names]
    return np.array(given, object)[fans.fan_marker] if given else np.empty(0, object)


def classify(
    fans: Fans,
    fan_role: np.ndarray,
    normals: FloatArray,
    representative: IntArray,
    *,
    sliding: str,
    periodic: str,
    feature_angle_deg: float,
) -> Classes:
    """Return the classes of all nodes.

    Parameters
    ----------
    fan_role : (m,)
        ``moving``, ``fixed``, ``sliding``, ``periodic`` or ``internal``.
    normals : (m, d)
        Unit normals of the undeformed fans, turned about the axis so that those of a node and of
        its images can be compared (``Frame.turned_back``).
    representative : (n,)
        For each node, the number of the periodic image that represents it.
    sliding
        ``none``, ``ps`` or ``ds``.
    periodic
        ``none``, ``periodic``, ``fixed`` or ``moving``.
    """
    at = representative[fans.fan_node]
    effect = _effects(fan_role, at, sliding, periodic)
    total = len(representative)
    moving = nodes_with(at, effect == "moving", total)
    fixed = nodes_with(at, effect == "fixed", total) & ~moving
    active = (effect == "slide") & ~(moving | fixed)[at]
    smooth, merge = np.cos(np.radians(feature_angle_deg * np.array([1.0, MERGE_FRACTION])))
    around = FansAround(at, fans.fan_node, fan_role, normals, float(smooth), float(merge))
    rows, extra = slide_rows(around, active)
    if periodic == "fixed":
        # Vertices are held: nodes that would be fixed if the periodic markers slid, too.
        watched = active | ((fan_role == "periodic") & ~(moving | fixed)[at])
        _, held = slide_rows(around, watched)
        touched = nodes_with(at, active, total)
        extra = np.concatenate([extra, held[touched[held]]])
    fixed[extra] = True
    keep = ~fixed[at[rows[:, 0]]]
    return _collect(
        moving[representative],
        fixed[representative],
        rows[keep],
        at,
        representative,
        normals.shape[1],
    )


def _effects(fan_role: np.ndarray, at: IntArray, sliding: str, periodic: str) -> np.ndarray:
    """Return the effect of each fan on its node, (m,): ``moving``, ``fixed``, ``slide``, ``free``.

    ``at`` (m,) is the node of each fan, with images as their representative.
    """
    effect = fan_role.copy()
    slide = "fixed" if sliding == "none" else "slide"
    effect[fan_role == "sliding"] = slide
    effect[fan_role == "periodic"] = slide if periodic in ("none", "periodic") else "free"
    # The border of an internal marker is where it meets a marker of another role.
    other = np.zeros(int(at.max(initial=-1)) + 1, bool)
    other[at[fan_role != "internal"]] = True
    internal = fan_role == "internal"
    effect[internal] = np.where(other[at[internal]], slide, "free")
    return effect


def _collect(
    moving: np.ndarray,
    fixed: np.ndarray,
    rows: IntArray,
    at: IntArray,
    representative: IntArray,
    dim: int,
) -> Classes:
    """Return the classes, with clusters numbered over all sliding nodes, images included.

    Parameters
    ----------
    moving, fixed : (n,) bool
    rows : (p, 2)
        What `slide_rows` returns: fan, and cluster within its node.
    at : (m,)
        The node of each fan, with images as their representative.
    representative : (n,)
    """
    order = np.argsort(at[rows[:, 0]], kind="stable")
    rows = rows[order]
    # Every image has the rows of the node that stands for it.
    active = np.zeros(len(representative), bool)
    active[at[rows[:, 0]]] = True
    slid = np.flatnonzero(active[representative])
    start, stop = (
        np.searchsorted(at[rows[:, 0]], representative[slid], side) for side in ("left", "right")
    )
    node = np.repeat(slid, stop - start)
    row = np.arange(len(node)) - np.repeat(np.cumsum(stop - start) - stop, stop - start)
    rows = rows[row]
    order = np.lexsort((rows[:, 1], node))
    rows, node = rows[order], node[order]
    new = np.ones(len(rows), bool)
    new[1:] = (node[1:] != node[:-1]) | (rows[1:, 1] != rows[:-1, 1])
    cluster_node = node[new]
    slid, per_node = np.unique(cluster_node, return_counts=True)
    on_surface = (per_node == 1) if dim == 3 else np.zeros(len(slid), bool)
    return Classes(
        moving=np.flatnonzero(moving),
        fixed=np.flatnonzero(fixed),
        edge=slid[~on_surface],
        surface=slid[on_surface],
        cluster_node=cluster_node,
        row_fan=rows[:, 0],
        row_cluster=np.cumsum(new) - 1,
        representative=representative,
    )


def directions(classes: Classes, normals: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the constraints of the sliding nodes: nodes (q,) and unit directions (q, d).

    The directions of one node are orthonormal and span the normals of its clusters. Periodic
    images have the same directions, from the fans of all of them, because surfaces continue beyond
    the periodic boundary.

    Parameters
    ----------
    normals : (m, d)
        Of all fans, in the working frame.
    """
    total = np.zeros((len(classes.cluster_node), normals.shape[1]))
    np.add.at(total, classes.row_cluster, normals[classes.row_fan])
    total = unit(total)
    node = classes.cluster_node
    _, starts, size = np.unique(node, return_index=True, return_counts=True)
    first = starts[size == 2]
    share = np.einsum("pd,pd->p", total[first + 1], total[first])
    total[first + 1] = unit(total[first + 1] - share[:, None] * total[first])
    keep = np.ones(len(node), bool)
    for start, count in zip(starts[size > 2], size[size > 2], strict=True):
        # More than two normals of rank 2: the two leading right singular vectors.
        total[start : start + 2] = np.linalg.svd(total[start : start + count])[2][:2]
        keep[start + 2 : start + count] = False
    return node[keep], total[keep]
