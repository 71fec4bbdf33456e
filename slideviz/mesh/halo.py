"""Halo layers: copies of cells beyond the periodic sides of a mesh (``SEND_RECEIVE`` in SU2).

Older SU2 meshes repeat the layer of cells at one periodic side beyond the other. A *receiver* is a
node that is a copy of its *donor*, moved by the period. Receivers on a periodic side belong to the
domain as images of the other side's nodes; those beyond it (*outer* receivers) only to the halo,
with every cell and every element of a boundary that has one of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import (
    NO_NODES,
    BoolArray,
    Cells,
    FloatArray,
    IntArray,
    Marker,
    Mesh,
    frozen_array,
    mask_of,
    row_norms,
    row_numbers,
)
from slideviz.system.weak_cache import weak_cache

FITS = 1e-5
"""Largest distance between a receiver and its donor's image, as a part of the mesh's extent."""


@record
class RigidMotion:
    """A rigid motion ``x -> rotation x + shift``: rotation (d, d) and shift (d,)."""

    rotation: FloatArray
    shift: FloatArray

    def at(self, points: FloatArray) -> FloatArray:
        """Return the moved points (k, d)."""
        return points @ self.rotation.T + self.shift


@record
class Halo:
    """The halo of a mesh: copies of nodes, and the cells beyond the periodic sides."""

    receivers: IntArray
    donors: IntArray
    """`receivers`, `donors` (h,): each copy, and the node that it is a copy of. A donor is never a
    copy itself."""
    rotations: FloatArray
    """(h, d, d): matrices that turn the displacement of a donor into that of its receiver."""
    outer: IntArray  # (o,): the receivers that belong to no cell of the domain, sorted
    cells: BoolArray  # (m,): the cells of the halo: those with an outer receiver
    sides: tuple[tuple[str, str], ...]
    """tuple of (str, str): pairs of boundaries of the domain: the first is a copy of the second."""
    mismatch: FloatArray
    """(h,): distance of each copy from where the motion of the halo puts its donor, undeformed."""

    def move_receivers(self, before: FloatArray, after: FloatArray, rows: IntArray) -> FloatArray:
        """Return ``after`` (n, d) with receivers displaced like their donors, and rotated.

        ``before``, ``after`` (n, d): undeformed points, at which the halo is in place, and deformed
        ones. ``rows`` (k,): the pairs that are moved.
        """
        moved = np.einsum("hij,hj->hi", self.rotations[rows], (after - before)[self.donors[rows]])
        out = np.array(after)
        start = before[self.receivers[rows]]
        # Adding zero would turn -0.0 into 0.0: copies of nodes at rest keep every bit.
        out[self.receivers[rows]] = np.where(moved == 0, start, start + moved)
        return out

    def describe(self) -> str:
        """Return the size of the halo in words."""
        sides = ", ".join(f"{copy} of {origin}" for copy, origin in self.sides)
        more = f"; of the boundaries, {sides} is a copy" if sides else ""
        return (
            f"a halo of {np.count_nonzero(self.cells)} cells and {len(self.outer)} nodes beyond "
            f"the periodic sides{more}"
        )


def make_halo(
    mesh: Mesh,
    receivers: IntArray,
    donors: IntArray,
    motions: Sequence[RigidMotion],
    which: IntArray,
) -> Halo:
    """Return the halo of a mesh.

    ``receivers``, ``donors`` (h,): each receiver once; donors may be receivers of another side (a
    mesh with two periods).
    ``motions``: the motions that occur, each from donors to receivers.
    ``which`` (h,): index into ``motions`` for each pair.
    """
    rotations = np.stack([motion.rotation for motion in motions])[which]
    sides = _sides(mesh, receivers, donors)
    inner = [mesh.marker(copy).nodes for copy, _ in sides]
    outer = np.setdiff1d(receivers, np.concatenate([*inner, NO_NODES]))
    beyond = mask_of(len(mesh.points), outer)
    mismatch = np.empty(len(receivers))
    for index, motion in enumerate(motions):
        some = which == index
        image = motion.at(mesh.points[donors[some]])
        mismatch[some] = row_norms(mesh.points[receivers[some]] - image)
    donors, rotations = _rooted(len(mesh.points), receivers, donors, rotations, mismatch)
    return Halo(
        frozen_array(receivers),
        frozen_array(donors),
        frozen_array(rotations),
        frozen_array(outer),
        frozen_array(_touching(mesh.cells, beyond)),
        sides,
        frozen_array(mismatch),
    )


def _rooted(
    count: int, receivers: IntArray, donors: IntArray, rotations: FloatArray, mismatch: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return donors (h,) and rotations (h, d, d) without chains: donors that are not receivers.

    ``mismatch`` (h,) is summed along the chains, in place.
    """
    row = row_numbers(count, receivers)
    donors = donors.copy()
    rotations = rotations.copy()
    for _ in range(3):  # as many as there are periods at most
        copied = np.flatnonzero(row[donors] >= 0)
        via = row[donors[copied]]
        rotations[copied] = rotations[copied] @ rotations[via]
        mismatch[copied] += mismatch[via]
        donors[copied] = donors[via]
    return donors, rotations


def _sides(mesh: Mesh, receivers: IntArray, donors: IntArray) -> tuple[tuple[str, str], ...]:
    """Return pairs of names: a boundary whose elements are copies of another's, and that other.

    Inflow and outflow, whose elements in the halo are copies of others of the same boundary, are
    no such pairs.
    """
    donor = np.arange(len(mesh.points))
    donor[receivers] = donors
    copied = mask_of(len(mesh.points), receivers)
    marker_of: dict[tuple[int, ...], str] = {}
    for marker in mesh.markers:
        for _, nodes in marker.cells.by_type.values():
            marker_of |= {tuple(row): marker.name for row in np.sort(nodes, axis=1).tolist()}
    pairs = []
    for marker in mesh.markers:
        if not copied[marker.nodes].all():
            continue
        for _, nodes in marker.cells.by_type.values():
            origins = np.sort(donor[nodes], axis=1).tolist()
            pairs += [(marker.name, marker_of.get(tuple(row), marker.name)) for row in origins]
    return tuple(dict.fromkeys(pair for pair in pairs if pair[0] != pair[1]))


def _touching(cells: Cells, nodes: BoolArray) -> BoolArray:
    """Return a mask (m,) of the cells that have any node of the mask ``nodes`` (n,)."""
    mask = np.zeros(len(cells), bool)
    for ids, table in cells.by_type.values():
        mask[ids] = nodes[table].any(axis=1)
    return mask


def without_halo(mesh: Mesh) -> tuple[Mesh, IntArray | None]:
    """Return the mesh without its halo's cells, and the indices (k,) that its cells had before.

    All points stay, with their numbers. Without a halo: the same mesh and None.
    """
    return (mesh, None) if mesh.halo is None else _inside(mesh, mesh.halo)


@weak_cache
def _inside(mesh: Mesh, halo: Halo) -> tuple[Mesh, IntArray]:
    beyond = mask_of(len(mesh.points), halo.outer)
    markers = tuple(
        Marker(marker.name, marker.cells.take(~_touching(marker.cells, beyond)))
        for marker in mesh.markers
    )
    domain = Mesh(
        mesh.points, mesh.cells.take(~halo.cells), markers, name=mesh.name, source=mesh.source
    )
    return domain, np.flatnonzero(~halo.cells)


def fit_motion(before: FloatArray, after: FloatArray) -> RigidMotion:
    """Return the rigid motion of ``before`` (k, d) nearest to ``after`` (k, d) in the mean square.

    Reflections are excluded (Kabsch 1976).
    """
    here = before.mean(axis=0)
    there = after.mean(axis=0)
    u, _, vt = np.linalg.svd((before - here).T @ (after - there))
    flip = np.ones(before.shape[1])
    flip[-1] = np.sign(np.linalg.det(vt.T @ u.T)) or 1.0
    rotation = vt.T @ np.diag(flip) @ u.T
    return RigidMotion(rotation, there - rotation @ here)
