"""Classes of nodes: the constraints of each, from topology and roles (thesis 2.4 and 4).

Every boundary node collects the normals of its fans. The rank of the normals decides: 1, the node
slides on the surface (3D) or the curve (2D); 2, it slides along an edge (3D) or is fixed (2D);
3, it is fixed. A moving marker wins over a fixed one, and both over all others, at shared nodes.

Periodic images are classified as one node, with the fans of all of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh import topology
from slideviz.mesh.fans import Fans, components
from slideviz.mesh.model import (
    NO_NODES,
    BoolArray,
    FloatArray,
    IntArray,
    mask_of,
    ranges,
    row_dots,
    run_begins,
)
from slideviz.mesh.topology import Boundary
from slideviz.rbf.tape import (
    Array,
    dot,
    gather,
    join,
    multiply,
    put,
    recorded,
    take,
    unit,
    value,
)

RANK_TOLERANCE = 0.02
"""Sine of the angle (about one degree) from which a further normal counts as independent."""

IN_PLANE = np.sqrt(1.0 - RANK_TOLERANCE**2)
"""Cosine of that angle: fans at a smaller angle are in one plane."""


@record
class FansAround:
    """All fans, with what decides which of them are one surface."""

    node: IntArray
    fan_node: IntArray
    """`node`, `fan_node` (m,): the node that represents the fan's node and its periodic images, and
    the fan's node itself."""
    role: np.ndarray  # (m,) str: role of the fan's marker
    normals: FloatArray  # (m, d): unit normals
    smooth: float
    merge: float
    """`smooth`, `merge`: fans of one role are one surface when the cosine of the angle between
    their normals is above these: ``smooth`` for fans of two periodic images, where a surface may
    continue beyond the periodic boundary, ``merge`` for fans of one node."""


def slide_rows(around: FansAround, active: BoolArray) -> tuple[IntArray, IntArray]:
    """Return rows (r, 2) of a fan and its cluster within its node, and the nodes of full rank (f,).

    For the fans in the mask ``active`` (m,); nodes are representatives of periodic images.
    """
    chosen = np.flatnonzero(active)
    if not len(chosen):
        return np.empty((0, 2), np.int64), NO_NODES
    chosen = _one_sided(around, chosen)
    node = around.node[chosen]
    cluster = np.zeros(len(chosen), np.int64)
    starts = np.flatnonzero(run_begins(node))
    size = np.diff(np.r_[starts, len(node)])
    several = np.flatnonzero(np.repeat(size > 1, size))
    if not len(several):
        return np.stack([chosen, cluster], axis=1), NO_NODES
    size = size[size > 1]
    group = np.repeat(np.arange(len(size)), size)
    local = chosen[several]
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
    image = around.fan_node[chosen] != around.node[chosen]
    chosen = chosen[np.lexsort([chosen, image, around.node[chosen]])]
    node = around.node[chosen]
    own = around.fan_node[chosen]
    first = np.searchsorted(node, node)
    rows = np.flatnonzero(own != node)
    drop = np.zeros(len(chosen), bool)
    # The first fan of the node, then its second and so on, beside all fans of its images.
    while len(rows):
        mine = first[rows] < rows
        rows = rows[mine]
        other = first[rows]
        along = row_dots(around.normals[chosen[rows]], around.normals[chosen[other]])
        drop[rows] |= (along < -around.merge) & (own[rows] != own[other])
        first[rows] += 1
    return chosen[~drop]


def _clusters(around: FansAround, local: IntArray, size: IntArray) -> IntArray:
    """Return the cluster of each fan, (m,): equal for fans of one node that are one surface.

    Fans of one role at a small angle are one surface, and fans in one plane whatever their roles.
    So are fans connected by others between them: the order of the fans does not matter. Clusters
    are numbered 0, 1, ... at each node.
    ``local`` (m,): the fans, those of a node together.
    ``size`` (g,): the number of fans of each node.
    """
    role = np.unique(around.role[local].astype(str), return_inverse=True)[1]
    own = around.fan_node[local]
    fans = np.repeat(size, size)  # at the node of each
    first = np.repeat(np.cumsum(size) - size, size)
    begin = np.cumsum(fans) - fans
    # All pairs of fans i and j of a node: begin[i] + j - first[i].
    i = np.repeat(np.arange(len(local)), fans)
    j = ranges(first, fans)
    alike = row_dots(around.normals[local[i]], around.normals[local[j]])
    one_role = role[i] == role[j]
    images = own[i] != own[j]
    # At each image a surface continues in at most one fan, of the same role, at the smallest angle.
    some = np.flatnonzero(one_role & images)
    some = some[np.lexsort((-alike[some], own[j[some]], i[some]))]
    best = some[run_begins(np.stack([i[some], own[j[some]]], axis=1))]
    goes_on = np.zeros(len(i), bool)
    goes_on[best] = alike[best] > around.smooth
    linked = one_role & ~images & (alike > around.merge)
    linked |= (goes_on & goes_on[begin[j] + i - first[j]]) | (alike > IN_PLANE)
    part = components(len(local), i[linked], j[linked])
    return part - part[first]


def _ranks(normals: FloatArray, group: IntArray, label: IntArray) -> IntArray:
    """Return the rank of the mean normals of each node's clusters, (g,).

    Where two are opposite (a thin tip) it counts as full, d.
    ``normals`` (m, d), ``group`` (m,), ``label`` (m,): the normals of fans, the number of their
    node, and of their cluster there.
    """
    dim = normals.shape[1]
    means = np.zeros((int(group[-1]) + 1, int(label.max()) + 1, dim))
    np.add.at(means, (group, label), normals)
    means = topology.unit(means)
    opposite = (means @ means.swapaxes(1, 2)).min(axis=(1, 2)) < -1.0 + 1e-4
    found = np.sum(np.linalg.svd(means, compute_uv=False) > RANK_TOLERANCE, axis=1)
    return np.where(opposite, dim, found)


MERGE_FRACTION = 0.25
"""Boundaries that meet at a smaller angle than this part of the feature angle are one surface
for a node between them (a circular far field in two markers); the full feature angle would
round off true corners of the domain. Which boundaries are one surface is also decided in
`slideviz.mesh.fans.smooth_joints`, `slide_rows` and ``projection.surface_labels``:
change them together."""


@record
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

    ``fan_role`` (m,): ``moving``, ``fixed``, ``sliding``, ``periodic`` or ``internal``.
    ``normals`` (m, d): unit normals of the undeformed fans, turned about the axis so that those of
    a node and of its images can be compared (``Frame.turned_back``).
    ``representative`` (n,): for each node, the number of the periodic image that represents it.
    ``sliding``: ``none``, ``ps`` or ``ds``.
    ``periodic``: ``none``, ``periodic``, ``fixed`` or ``moving``.
    """
    at = representative[fans.fan_node]
    effect = _effects(fan_role, at, sliding, periodic)
    total = len(representative)
    moving = mask_of(total, at[effect == "moving"])
    fixed = mask_of(total, at[effect == "fixed"]) & ~moving
    active = (effect == "slide") & ~(moving | fixed)[at]
    smooth, merge = np.cos(np.radians(feature_angle_deg * np.array([1.0, MERGE_FRACTION])))
    around = FansAround(at, fans.fan_node, fan_role, normals, float(smooth), float(merge))
    rows, extra = slide_rows(around, active)
    if periodic == "fixed":
        # Vertices are held: nodes that would be fixed if the periodic markers slid, too.
        watched = active | ((fan_role == "periodic") & ~(moving | fixed)[at])
        _, held = slide_rows(around, watched)
        touched = mask_of(total, at[active])
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
    other = mask_of(int(at.max(initial=-1)) + 1, at[fan_role != "internal"])
    internal = fan_role == "internal"
    effect[internal] = np.where(other[at[internal]], slide, "free")
    return effect


def _collect(
    moving: BoolArray,
    fixed: BoolArray,
    rows: IntArray,
    at: IntArray,
    representative: IntArray,
    dim: int,
) -> Classes:
    """Return the classes, with clusters numbered over all sliding nodes, images included.

    ``moving`` and ``fixed`` (n,) bool.
    ``rows`` (p, 2): what `slide_rows` returns: fan, and cluster within its node.
    ``at`` (m,): the node of each fan, with images as their representative.
    ``representative`` (n,).
    """
    order = np.argsort(at[rows[:, 0]], kind="stable")
    rows = rows[order]
    # Every image has the rows of the node that stands for it.
    active = np.zeros(len(representative), bool)
    active[at[rows[:, 0]]] = True
    slid = np.flatnonzero(active[representative])
    start = np.searchsorted(at[rows[:, 0]], representative[slid], "left")
    stop = np.searchsorted(at[rows[:, 0]], representative[slid], "right")
    node = np.repeat(slid, stop - start)
    rows = rows[ranges(start, stop - start)]
    order = np.lexsort((rows[:, 1], node))
    rows = rows[order]
    node = node[order]
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


def directions(classes: Classes, normals: Array) -> tuple[IntArray, Array]:
    """Return the constraints of the sliding nodes: nodes (q,) and unit directions (q, d).

    The directions of one node are orthonormal and span the normals of its clusters. Periodic
    images have the same directions, from the fans of all of them, because surfaces continue beyond
    the periodic boundary.
    ``normals`` (m, d): of all fans, in the working frame.
    """
    node = classes.cluster_node
    total = unit(gather(take(normals, classes.row_fan), classes.row_cluster, len(node)))
    _, starts, size = np.unique(node, return_index=True, return_counts=True)
    first = starts[size == 2]
    if len(first):
        one = take(total, first)
        two = take(total, first + 1)
        total = put(total, first + 1, unit(two - multiply(one, dot(two, one))))
    keep = np.ones(len(node), bool)
    several = size > 2
    leading = []
    for start, count in zip(starts[several].tolist(), size[several].tolist(), strict=True):
        leading.append(_leading(take(total, np.arange(start, start + count))))
        keep[start + 2 : start + count] = False
    if leading:
        rows = np.add.outer(starts[several], np.arange(2)).ravel()
        total = put(total, rows, join(*leading))
    return node[keep], take(total, np.flatnonzero(keep))


def _leading(rows: Array) -> Array:
    """Return the two leading right singular vectors of rows (k, 3) of rank 2.

    The derivative does not contain their rotation within the plane that they span: no result
    depends on it.
    """
    a = value(rows)
    vectors = np.linalg.svd(a)[2]
    sizes = np.zeros(3)
    found = np.linalg.svd(a, compute_uv=False)
    sizes[: len(found)] = found**2
    lead = vectors[:2]
    rest = vectors[2]
    gap = 1.0 / (sizes[:2] - sizes[2])

    def there(t: FloatArray) -> FloatArray:
        change = np.einsum("...kd,ke->...de", t, a)
        change = change + np.swapaxes(change, -1, -2)
        off = np.einsum("d,...de,ie->...i", rest, change, lead) * gap
        return off[..., None] * rest

    def back(g: FloatArray) -> FloatArray:
        off = (g @ rest) * gap
        change = np.einsum("...i,d,ie->...de", off, rest, lead)
        change = change + np.swapaxes(change, -1, -2)
        return np.einsum("...de,ke->...kd", change, a)

    return recorded(lead, (rows, there, back))
