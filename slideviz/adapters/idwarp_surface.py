"""The surface of a solver: its nodes, in the solver's order and with repetitions, in the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from slideviz.errors import CaseError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slideviz.mesh.model import FloatArray, IntArray, Mesh

COINCIDES = 1e-8
"""Largest distance of a node of the surface from its node of the mesh, in parts of the extent."""


@dataclass(frozen=True, eq=False)
class SolverSurface:
    """The nodes of a solver's surface, as nodes of a mesh."""

    mesh: Mesh
    """Undeformed."""
    moving: IntArray
    """(m,): the moving nodes of the case, ascending."""
    nodes: IntArray
    """(N,): the nodes of the surface, in the solver's order: all moving nodes and perhaps others,
    each once or several times."""

    @cached_property
    def start(self) -> FloatArray:
        """Return the undeformed coordinates (N, d)."""
        return self.mesh.points[self.nodes]

    @cached_property
    def tolerance(self) -> float:
        """Return the distance up to which two places are the same, in the mesh's length unit."""
        return COINCIDES * self.mesh.extent

    @cached_property
    def place(self) -> IntArray:
        """Return the place of each node among the moving ones (N,), or -1."""
        at = np.minimum(np.searchsorted(self.moving, self.nodes), len(self.moving) - 1)
        return np.where(self.moving[at] == self.nodes, at, -1)

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Return a mask (N, 1) of the nodes that are not moving nodes."""
        return self.place[:, None] < 0

    @cached_property
    def copies(self) -> IntArray:
        """Return the number of copies of each moving node in the surface, (m, 1)."""
        return np.bincount(self.place[self.place >= 0], minlength=len(self.moving))[:, None]

    def means(self, values: FloatArray) -> FloatArray:
        """Return the mean (m, c) of ``values`` (N, c) over the copies of each moving node."""
        out = np.zeros((len(self.moving), values.shape[1]))
        moves = self.place >= 0
        np.add.at(out, self.place[moves], values[moves])
        return out / self.copies

    def spread(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (m, c) of the moving nodes at all copies, (N, c); 0 at other nodes."""
        return np.where(self.held, 0.0, values[np.maximum(self.place, 0)])

    def displacement(self, given: FloatArray, now: FloatArray) -> FloatArray:
        """Return the displacement (m, d) of the moving nodes, of coordinates (N, d).

        Parameters
        ----------
        given : (N, d)
            Coordinates that the nodes are to have.
        now : (N, d)
            Coordinates that the nodes have. Those of a node that is not a moving one must be given
            as these, or undeformed.

        Raises
        ------
        CaseError
            The number of nodes is wrong, copies of a node disagree, or a node that is not a moving
            one was moved.
        """
        if len(given) != len(self.nodes):
            raise CaseError(
                f"{len(given)} nodes were given for a surface of {len(self.nodes)}; give as many "
                "as getSurfaceCoordinates returns"
            )
        moved = given - self.start
        out = self.means(moved)
        off = _lengths(np.where(self.held, 0.0, moved - self.spread(out)))
        if off.max(initial=0.0) > self.tolerance:
            raise CaseError(
                f"node {int(off.argmax())} of the surface is there several times, with coordinates "
                f"that are {off.max():g} from their mean; copies of a node must move alike"
            )
        off = np.minimum(_lengths(moved), _lengths(given - now)) * self.held[:, 0]
        if off.max(initial=0.0) > self.tolerance:
            worst = int(off.argmax())
            raise CaseError(
                f"node {worst} of the surface, at {self.start[worst].tolist()}, was moved by "
                f"{_lengths(moved)[worst]:g}, but its boundary is not a moving one in the case; "
                "give it the role moving, or leave the node"
            )
        return out


def surface_at(mesh: Mesh, moving: IntArray, given: FloatArray) -> SolverSurface:
    """Return the surface whose undeformed coordinates (N, d) are given.

    Raises
    ------
    CaseError
        A node is on none of the mesh's boundaries, or a moving node is not in the surface.
    """
    boundary = np.unique(np.concatenate([moving, *(marker.nodes for marker in mesh.markers)]))
    distance, found = cKDTree(mesh.points[boundary]).query(given)
    far, surface = np.asarray(distance), SolverSurface(mesh, moving, boundary[found])
    if far.max(initial=0.0) > surface.tolerance:
        worst = int(far.argmax())
        raise CaseError(
            f"node {worst} of the surface, at {given[worst].tolist()}, is {far[worst]:g} from the "
            f"next boundary node of {mesh.name}; give the undeformed surface of this mesh"
        )
    missing = np.setdiff1d(moving, surface.nodes)
    if len(missing):
        raise CaseError(
            f"{len(missing)} of {len(moving)} moving nodes of the case are not in the surface, the "
            f"first one at {mesh.points[missing[0]].tolist()}; give the whole surface, or other "
            "roles"
        )
    return surface


def _lengths(vectors: FloatArray) -> FloatArray:
    """Return the lengths (n,) of vectors (n, d)."""
    return np.asarray(np.linalg.norm(vectors, axis=1))
