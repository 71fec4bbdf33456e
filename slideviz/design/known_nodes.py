"""The map from the displacement of the moving nodes, a deformer's input, to all known nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.moving_nodes import ROUNDING
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh, frozen_array, largest_coordinate
from slideviz.mesh.periodic import TOLERANCE
from slideviz.rbf.images import ImageDisplacements
from slideviz.rbf.operations import difference
from slideviz.rbf.tape import Array, put, take, transform, value
from slideviz.solver.prescribed import displaced
from slideviz.solver.setup import Setup


@dataclass(frozen=True, eq=False)
class KnownNodeMap:
    """The map from the displacement of the moving nodes to that of the known nodes."""

    mesh: Mesh
    setup: Setup
    nodes: IntArray  # (m,): the moving nodes, ascending
    points: FloatArray
    """(s, d): the sources, undeformed: nodes whose displacement all their periodic images have."""
    rows: IntArray
    turn: FloatArray | None
    """`rows`, `turn` (s,) int64, (s, d, d) float64 or None: the moving node, by its place in
    ``nodes``, whose displacement each source has, and the rotation of it (None: none is rotated).
    They differ for copies in a halo."""
    known: IntArray
    source: IntArray
    """`known`, `source` (k,): known nodes that move, by their place in ``setup.known``, and the
    source that each follows."""
    others: IntArray
    followed: IntArray
    """`others`, `followed` (o,): moving nodes that are not sources, by their place in ``nodes``,
    and the source that each must follow."""

    def target(self, vectors: Array) -> Array:
        """Return the displacement (..., a, d) of the known nodes, in the frame.

        From that of the moving nodes, ``vectors`` (..., m, d), Cartesian. Raises DeformError where
        images, or copies in a halo and their originals, are displaced differently.
        """
        setup = self.setup
        overwrite = take(vectors, self.rows)
        if self.turn is not None:
            overwrite = transform(self.turn, overwrite)
        moved = difference(setup.frame, self.points, overwrite)
        self._require_alike(value(vectors), value(moved))
        shape = (len(setup.known), self.mesh.dim)
        return put(np.zeros(shape), self.known, take(moved, self.source))

    def _require_alike(self, vectors: FloatArray, moved: FloatArray) -> None:
        """Raise DeformError where images, or copies and their originals, are displaced differently.

        ``vectors`` and ``moved`` (..., m, d), (..., s, d): Cartesian displacements of the moving
        nodes, and those of the sources in the frame.
        """
        setup = self.setup
        mesh = self.mesh
        if len(self.others):
            overwrite = vectors[..., self.others, :]
            follow = difference(setup.frame, mesh.points[self.nodes[self.others]], overwrite)
            gap = np.abs(value(follow) - moved[..., self.followed, :])
            largest = np.linalg.norm(moved, axis=-1).max(axis=-1, initial=0.0)
            allowed = TOLERANCE * largest + ROUNDING * largest_coordinate(self.mesh.points)
            if (gap.max(axis=(-1, -2)) > allowed).any():
                self._refuse(vectors)
        if mesh.halo is not None:
            self._refuse(vectors)

    def _refuse(self, vectors: FloatArray) -> None:
        setup = self.setup
        mesh = self.mesh
        for each in vectors.reshape(-1, *vectors.shape[-2:]):
            moved = displaced(Displacements(self.nodes, each), mesh)
            there = setup.frame.difference(mesh.points[moved.nodes], moved.vectors)
            largest = float(np.linalg.norm(there, axis=1).max(initial=0.0))
            allowed = TOLERANCE * largest + ROUNDING * largest_coordinate(self.mesh.points)
            ImageDisplacements(moved.nodes, there, setup.classes.representative).require_alike(
                allowed
            )


def known_node_map(mesh: Mesh, setup: Setup, asked: Displacements) -> KnownNodeMap:
    """Return the map from the displacement of the moving nodes to that of the known nodes.

    Raises CaseError if a moving node in a halo is a copy of a node that does not move.
    """
    moved = displaced(asked, mesh)
    spread = ImageDisplacements(moved.nodes, moved.vectors, setup.classes.representative)
    of_known = spread.source(setup.known)
    known = np.flatnonzero(of_known >= 0)
    nodes, place = np.unique(of_known[known], return_inverse=True)
    given = nodes.copy()
    turn = None
    if mesh.halo is not None:
        turn = np.tile(np.eye(mesh.dim), (len(nodes), 1, 1))
        row = np.full(len(mesh.points), -1)
        row[mesh.halo.receivers] = np.arange(len(mesh.halo.receivers))
        copies = row[nodes] >= 0
        given[copies] = mesh.halo.donors[row[nodes[copies]]]
        turn[copies] = mesh.halo.rotations[row[nodes[copies]]]
    rows = np.searchsorted(asked.nodes, given)
    inside = np.isin(given, asked.nodes)
    if not inside.all():
        raise CaseError(
            f"{mesh.name}: node {nodes[~inside][0]} is a copy of node {given[~inside][0]}, which "
            "is on no moving marker; give both the same role"
        )
    lead = spread.source(moved.nodes)
    others = np.flatnonzero(lead != moved.nodes)
    return KnownNodeMap(
        mesh,
        setup,
        asked.nodes,
        frozen_array(mesh.points[nodes], np.float64),
        rows,
        turn,
        known,
        place,
        np.searchsorted(asked.nodes, moved.nodes[others]) if mesh.halo is None else others[:0],
        np.searchsorted(nodes, lead[others]) if mesh.halo is None else others[:0],
    )
