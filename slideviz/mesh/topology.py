"""Boundary topology: oriented facets and their neighbours.

A *facet* is one element of a marker.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cached_property

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import (
    NO_NODES,
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    frozen_array,
    mask_of,
    row_dots,
    run_begins,
    sorted_nodes,
)
from slideviz.mesh.nearest import row_groups, sorted_in_rows
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

TINY = float(np.finfo(float).tiny)  # smallest normal float: a divisor in place of 0


@record
class Boundary:
    """The facets of all markers, nodes ordered so that normals point out of the cells."""

    facets: IntArray
    """(f, k): node indices; k = 2 in 2D, 4 in 3D, where a triangle repeats its last node."""
    marker: IntArray  # (f,): index into names
    names: tuple[str, ...]  # the markers, in file order
    owner: IntArray  # (f,): the cell each facet is a side of
    joints: IntArray
    """(j, 2): pairs of facets of any markers that share a joint (node in 2D, edge in 3D)."""
    joint_nodes: IntArray  # (j, dim - 1): the nodes that each pair shares

    @property
    def dim(self) -> int:
        """Return the dimension of the mesh, 2 or 3."""
        return 2 if self.facets.shape[1] == 2 else 3

    @cached_property
    def nodes(self) -> IntArray:
        """Return the boundary nodes, sorted: (b,)."""
        return frozen_array(sorted_nodes(self.facets))

    def around(self, markers: Collection[str]) -> Boundary:
        """Return the facets of markers, and those of others that share a node with them."""
        wanted = np.isin(self.marker, [self.names.index(name) for name in markers])
        near = mask_of(int(self.facets.max(initial=-1)) + 1, self.facets[wanted])
        kept = np.asarray(near[self.facets].any(axis=1))
        joints = kept[self.joints].all(axis=1)
        return replace(
            self,
            facets=frozen_array(self.facets[kept]),
            marker=frozen_array(self.marker[kept]),
            owner=frozen_array(self.owner[kept]),
            joints=frozen_array((np.cumsum(kept) - 1)[self.joints[joints]]),
            joint_nodes=frozen_array(self.joint_nodes[joints]),
        )


def find_boundary(mesh: Mesh) -> Boundary:
    """Return the oriented boundary of a mesh, without the facets that belong to its halo.

    Raises MeshError if a marker element is not a side of any cell.
    """
    mesh, ids = without_halo(mesh)
    width = 2 if mesh.dim == 2 else 4
    tables = [np.empty((0, width), np.int64)]
    owners = [NO_NODES]
    for index, marker in enumerate(mesh.markers):
        for _, nodes in marker.cells.by_type.values():
            tables.append(_padded(nodes, width))
            owners.append(np.full(len(nodes), index))
    facets = np.concatenate(tables)
    marker_of = np.concatenate(owners)
    owner = _find_owners(mesh, facets, marker_of)
    facets = _turn_outward(mesh, facets, owner)
    joints, joint_nodes = find_joints(facets, mesh.dim)
    return Boundary(
        frozen_array(facets),
        frozen_array(marker_of),
        mesh.marker_names,
        frozen_array(owner if ids is None else ids[owner]),
        frozen_array(joints),
        frozen_array(_by_position(mesh.points, joint_nodes)),
    )


def _by_position(points: FloatArray, joint_nodes: IntArray) -> IntArray:
    """Return nodes (j, dim - 1) of joints, each row ordered by last coordinate, then the others.

    Given are rows ordered by node number; that order stays for nodes at the same place.
    """
    if joint_nodes.shape[1] == 1:
        return joint_nodes
    one = points[joint_nodes[:, 0]]
    two = points[joint_nodes[:, 1]]
    after = np.zeros(len(joint_nodes), bool)
    for a, b in zip(one.T, two.T, strict=True):
        after = np.where(a == b, after, a > b)
    return np.where(after[:, None], joint_nodes[:, ::-1], joint_nodes)


def _padded(nodes: IntArray, width: int) -> IntArray:
    """Return the table (m, k) with its last column repeated up to ``width`` columns."""
    missing = width - nodes.shape[1]
    return np.hstack([nodes, np.repeat(nodes[:, -1:], missing, axis=1)]) if missing else nodes


def _find_owners(mesh: Mesh, facets: IntArray, marker_of: IntArray) -> IntArray:
    """Return the index (f,) of the cell that each facet (f, k) is a side of.

    ``marker_of`` (f,) is for the message. Only sides whose nodes are all on the boundary are
    compared, so that the cost grows with the boundary, not with the volume. Raises MeshError if a
    facet is not a side of any cell.
    """
    on_boundary = mask_of(len(mesh.points), facets.ravel())
    sides = []
    cells = []
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        some = np.flatnonzero(_touch(nodes, on_boundary, mesh.dim))
        table = nodes[some]
        near = on_boundary[table]
        for local in ELEMENTS[vtk].facets:
            keep = near[:, local].all(axis=1)
            sides.append(_padded(table[keep][:, local], facets.shape[1]))
            cells.append(ids[some[keep]])
    table = sorted_in_rows(np.concatenate([facets, *sides]))
    # A padded triangle (a, b, c, c) and a quadrilateral differ after sorting only if the
    # repeated node is the same one on both sides: make it the largest.
    if mesh.dim == 3:
        table = _canonical_triangles(table)
    group = row_groups(table)
    cell_of_group = np.full(group.max(initial=-1) + 1, -1, np.int64)
    cell_of_group[group[len(facets) :]] = np.concatenate([NO_NODES, *cells])
    owner = cell_of_group[group[: len(facets)]]
    if np.any(owner < 0):
        lost = int(np.argmin(owner))
        raise MeshError(
            f"{mesh.name}: marker {mesh.marker_names[marker_of[lost]]!r} has an element with the "
            f"nodes {', '.join(map(str, np.unique(facets[lost])))} that is not a side of any cell; "
            "remove it from the marker or add the missing cell"
        )
    return owner


def _touch(nodes: IntArray, chosen: BoolArray, least: int) -> BoolArray:
    """Return a mask (m,) of cells (m, n) with at least ``least`` nodes in the mask ``chosen``."""
    mask = np.empty(len(nodes), bool)
    in_parts(lambda part: _mark(nodes[part], chosen, least, mask[part]), len(nodes))
    return mask


@njit
def _mark(nodes, chosen, least, found):  # type: ignore[no-untyped-def]
    """Write into ``found`` (m,) which of ``nodes`` (m, n) have ``least`` or more in ``chosen``."""
    for row in range(len(nodes)):
        count = 0
        for node in nodes[row]:
            count += chosen[node]
        found[row] = count >= least


def _canonical_triangles(table: IntArray) -> IntArray:
    """Return sorted rows (f, 4) of nodes, with a node that is there twice moved to the end."""
    out = table.copy()
    for column in (0, 1):
        twice = out[:, column] == out[:, column + 1]
        others = np.delete(out[twice], column, axis=1)
        out[twice] = np.hstack([others, others[:, -1:]])
    return out


def _turn_outward(mesh: Mesh, facets: IntArray, owner: IntArray) -> IntArray:
    """Return facets (f, k), nodes reversed where needed, whose normals point out of their owner.

    ``owner`` (f,) is the cell of each.
    """
    cells = mesh.cells.take(owner)
    sizes = np.diff(cells.offsets)
    out = mesh.points[facets].mean(axis=1)
    for axis, coords in enumerate(mesh.points.T):
        out[:, axis] -= np.add.reduceat(coords[cells.connectivity], cells.offsets[:-1]) / sizes
    inward = row_dots(facet_vectors(mesh.points, facets), out) < 0
    turned = facets.copy()
    if mesh.dim == 2:
        turned[inward] = facets[inward][:, ::-1]
    else:
        triangle = facets[:, 2] == facets[:, 3]
        turned[inward & ~triangle] = facets[inward & ~triangle][:, ::-1]
        turned[inward & triangle] = facets[inward & triangle][:, [1, 0, 2, 3]]
    return turned


def real_corners(facets: IntArray) -> BoolArray:
    """Return the mask (f, k) of the corners of facets that do not repeat the last node."""
    real = np.ones(facets.shape, bool)
    real[:, 3:] = facets[:, 3:] != facets[:, 2:-1]
    return real


def facet_vectors(coords: FloatArray, facets: IntArray) -> FloatArray:
    """Return a normal (f, d) of each facet: its length is the line's (2D) or twice the area (3D).

    In 3D it is the cross product of the diagonals, which for a triangle with its last node
    repeated is the cross product of two sides.
    """
    return corner_vectors(coords[facets])


def corner_vectors(x: FloatArray) -> FloatArray:
    """Return what `facet_vectors` does, given the corners ``x`` (f, k, d) of the facets."""
    if x.shape[1] == 2:
        t = x[:, 1] - x[:, 0]
        return np.stack([t[:, 1], -t[:, 0]], axis=1)
    a = x[:, 2] - x[:, 0]
    b = x[:, 3] - x[:, 1]
    out = np.empty_like(a)
    for k in range(3):  # in half the time of np.cross
        i = (k + 1) % 3
        j = (k + 2) % 3
        out[:, k] = a[:, i] * b[:, j] - a[:, j] * b[:, i]
    return out


def vertex_normals(points: FloatArray, facets: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the nodes (k,) of facets (f, 2 or 4), and at each its share of their normals, (k, d).

    Of a line that is a half, in 3D the part of a facet between its centre and the middles of the
    two edges at the node: the boundary of the node's cell of the median-dual mesh.
    """
    x = points[facets]
    if facets.shape[1] == 2:
        shares = np.repeat(0.5 * facet_vectors(points, facets)[:, None], 2, axis=1)
    else:
        triangle = facets[:, 2] == facets[:, 3]
        before = np.roll(x, 1, axis=1)
        after = np.roll(x, -1, axis=1)
        after[triangle, 2] = x[triangle, 0]
        centre = np.where(triangle[:, None], x[:, :3].mean(axis=1), x.mean(axis=1))[:, None]
        shares = np.cross(centre - x, 0.25 * (before - after))  # diagonals of each part
        shares[triangle, 3] = 0.0
    nodes, place = np.unique(facets, return_inverse=True)
    out = np.zeros((len(nodes), points.shape[1]))
    np.add.at(out, place.reshape(-1), shares.reshape(-1, points.shape[1]))
    return nodes, out


def unit(vectors: FloatArray) -> FloatArray:
    """Return the vectors (n, d) at length 1; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def facet_edges(facets: IntArray) -> IntArray:
    """Return the edges (e, 2) around each of facets (f, k), facet by facet, in their direction."""
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
    return edges[edges[:, 0] != edges[:, 1]]


def edge_keys(edges: IntArray) -> IntArray:
    """Return a number (e,) for each of edges (e, 2), one for both directions, as nodes ascend."""
    one, two = edges.T
    return np.minimum(one, two) * (int(edges.max(initial=0)) + 1) + np.maximum(one, two)


def distinct_edges(edges: IntArray) -> IntArray:
    """Return each of edges (e, 2) once, in either direction: nodes and edges ascending, (u, 2)."""
    keys = np.unique(edge_keys(edges))
    return np.stack(np.divmod(keys, int(edges.max(initial=0)) + 1), axis=1)


def single_edges(edges: IntArray) -> BoolArray:
    """Return a mask (e,) of the edges (e, 2) that are there once, in either direction."""
    keys = edge_keys(edges)
    distinct, count = np.unique(keys, return_counts=True)
    return count[np.searchsorted(distinct, keys)] == 1


def find_joints(facets: IntArray, dim: int) -> tuple[IntArray, IntArray]:
    """Return pairs (j, 2) of facets that share a node (2D) or an edge (3D), and its nodes.

    The nodes are (j, dim - 1), by number. Nodes and edges of more than two facets (a thin plate, a
    non-manifold edge) are left out: there facets never join smoothly.
    """
    count, width = facets.shape
    facet = np.repeat(np.arange(count), width)
    above = int(facets.max(initial=0)) + 1
    if dim == 2:
        keys = facets.ravel()
    else:
        one = facets.ravel()
        two = np.roll(facets, -1, axis=1).ravel()
        keys = np.minimum(one, two) * above + np.maximum(one, two)
        real = one != two
        keys = keys[real]
        facet = facet[real]
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    starts = np.flatnonzero(run_begins(keys))
    sizes = np.diff(np.r_[starts, len(keys)])
    first = starts[sizes == 2]
    joints = np.stack([facet[order[first]], facet[order[first + 1]]], axis=1)
    shared = keys[first]
    return joints, np.stack([shared] if dim == 2 else np.divmod(shared, above), axis=1)
