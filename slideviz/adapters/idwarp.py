"""IDWarp's names for a deformation, for programs that call ``idwarp.USMesh`` (ADflow, DAFoam).

The methods take and return what IDWarp's do (mdolab/idwarp, ``UnstructuredMesh.py``), so that such
a program needs another import and other options. What deforms the mesh is a `slideviz.Deformer`:
sliding, periodic and data-reduced as its case says, with exact derivatives. One process only.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.design.deformer import Deformer
from slideviz.errors import CaseError
from slideviz.formats.cgns.read import CgnsForm
from slideviz.formats.files import read, write
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, Mesh, places_in, row_norms

COINCIDES = 1e-8
"""Largest distance of a node of the surface from its node of the mesh, in parts of the extent."""


@record
class SolverSurface:
    """The nodes of a solver's surface, as nodes of a mesh."""

    mesh: Mesh  # undeformed
    moving: IntArray  # (m,): the moving nodes of the case, ascending
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
        return places_in(self.moving, self.nodes)

    @cached_property
    def held(self) -> BoolArray:
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

        Raises CaseError if the number of nodes is wrong, copies of a node disagree, or a node that
        is not a moving one was moved. ``given`` and ``now`` (N, d): coordinates that the nodes are
        to have, and have; of a node that is not a moving one these, or undeformed, must be given.
        """
        if len(given) != len(self.nodes):
            raise CaseError(
                f"{len(given)} nodes were given for a surface of {len(self.nodes)}; give as many "
                "as getSurfaceCoordinates returns"
            )
        moved = given - self.start
        out = self.means(moved)
        off = row_norms(np.where(self.held, 0.0, moved - self.spread(out)))
        if off.max(initial=0.0) > self.tolerance:
            raise CaseError(
                f"node {int(off.argmax())} of the surface is there several times, with coordinates "
                f"that are {off.max():g} from their mean; copies of a node must move alike"
            )
        off = np.minimum(row_norms(moved), row_norms(given - now)) * self.held[:, 0]
        if off.max(initial=0.0) > self.tolerance:
            worst = int(off.argmax())
            raise CaseError(
                f"node {worst} of the surface, at {self.start[worst].tolist()}, was moved by "
                f"{row_norms(moved)[worst]:g}, but its boundary is not a moving one in the case; "
                "give it the role moving, or leave the node"
            )
        return out


def surface_at(mesh: Mesh, moving: IntArray, given: FloatArray) -> SolverSurface:
    """Return the surface of undeformed coordinates (N, d); CaseError if they are of another."""
    boundary = np.union1d(moving, mesh.nodes_of(mesh.marker_names))
    distance, found = cKDTree(mesh.points[boundary]).query(given)
    far = np.asarray(distance)
    surface = SolverSurface(mesh, moving, boundary[found])
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


_OURS = ("gridFile", "case", "displacements")
_THEIRS = (
    "fileType",
    "specifiedSurfaces",
    "symmetrySurfaces",
    "symmetryPlanes",
    "aExp",
    "bExp",
    "LdefFact",
    "alpha",
    "errTol",
    "evalMode",
    "symmTol",
    "useRotations",
    "zeroCornerRotations",
    "cornerAngle",
    "restartFile",
    "bucketSize",
)
"""Options of IDWarp; they are accepted and have no effect here."""


class USMesh:
    """A mesh that follows its surface, with the methods of IDWarp's ``USMesh``.

    Coordinates of the surface are (N, d), in the order of `setSurfaceDefinition`, or without it
    (m, d), the moving nodes of the case in ascending order; those of the grid are flat. Indices of
    `setExternalMeshIndices` are IDWarp's: of *coordinates* (d times the node plus the axis), in the
    order of the mesh; for a CGNS file in that of the file, block by block, with the nodes where
    blocks meet as often as it has them.

    Nodes of a surface that the case does not move (hub and casing, when they slide) belong to it
    too, but cannot be prescribed: their coordinates are where they were or where the last
    `warpMesh` took them, and their entries in `getdXs` are 0. Of a node that the surface has
    several times, all copies must agree; the derivative is shared among them. Raises CaseError if
    an option is missing or unknown, or there are several processes.

    Parameters
    ----------
    options : dict
        ``gridFile``: a mesh file or a `slideviz.Mesh`; ``case``: a case file or a `slideviz.Case`,
        with the roles of the boundaries and the method. ``displacements``: those that the
        deformation is prepared for, as for `slideviz.Deformer`; without them, those of the case's
        motions; without motions zero, which is enough without data reduction.
        Options of IDWarp that say how to deform are accepted with a warning, and have no effect.
    comm : mpi4py.MPI.Comm, optional
        Of one process.
    debug : bool
        Has no effect.
    """

    def __init__(
        self, options: Mapping[str, Any] | None = None, comm: Any = None, debug: bool = False
    ) -> None:
        del debug
        if comm is not None and comm.size > 1:
            raise CaseError(
                f"slideviz.idwarp works on one process, and was given {comm.size}; give it "
                "MPI.COMM_SELF, and the whole surface and grid"
            )
        mesh, case, displacements = _read(options or {})
        moving = case.markers_with("moving")
        if displacements is None and moving and not case.motions:
            displacements = np.zeros((len(mesh.nodes_of(moving)), mesh.dim))
        self.comm = comm
        self.deformer = Deformer(mesh, case, displacements)
        nodes = np.asarray(self.deformer.nodes)
        self._surface = SolverSurface(mesh, nodes, nodes)
        # The nodes of a CGNS file: those where its blocks meet are in it several times.
        self._order: IntArray = (
            np.concatenate(mesh.origin.numbers)
            if isinstance(mesh.origin, CgnsForm)
            else np.arange(len(mesh.points))
        )
        self._indices: IntArray = np.arange(self._order.size * mesh.dim)
        self._displacement = np.zeros((len(nodes), mesh.dim))
        self._coordinates = self._surface.start
        self._points = np.array(mesh.points)
        self._gradient = np.zeros_like(self._displacement)

    # What the solver says ------------------------------------------------------------------
    def setExternalMeshIndices(self, ind: ArrayLike) -> None:
        """Set which coordinates of the grid, counted from 0, the solver has, and in which order.

        Raises CaseError if there is no such coordinate.
        """
        indices = np.asarray(ind, np.int64).ravel()
        size = self._order.size * self._points.shape[1]
        if len(indices) and not 0 <= indices.min() <= indices.max() < size:
            raise CaseError(
                f"indices of the solver's grid go from {indices.min()} to {indices.max()}; the "
                f"file has {size} coordinates, numbered from 0: node times dimension plus axis"
            )
        self._indices = indices

    def setSurfaceDefinition(
        self,
        pts: ArrayLike,
        conn: ArrayLike = (),
        faceSizes: ArrayLike = (),
        cgnsBlockID: object = None,
    ) -> None:
        """Set the solver's surface by its undeformed coordinates ``pts`` (N, d).

        Its nodes are found in the mesh by their coordinates; so ``conn`` and the rest, which
        IDWarp needs, are not used. Raises CaseError if a node is on none of the mesh's boundaries,
        or a moving node is not in the surface.
        """
        del conn, faceSizes, cgnsBlockID
        nodes = np.asarray(self.deformer.nodes)
        self._surface = surface_at(self.deformer.mesh, nodes, self._shaped(pts))
        now = self._surface.start + self._surface.spread(self._displacement)
        self._coordinates = self._followed(now)

    # Coordinates ---------------------------------------------------------------------------
    def getSurfaceCoordinates(self) -> FloatArray:
        """Return the coordinates of the surface (N, d)."""
        return self._coordinates.copy()

    def setSurfaceCoordinates(self, coordinates: ArrayLike) -> None:
        """Set the coordinates of the surface (N, d); `warpMesh` moves the grid.

        Raises CaseError if the number of nodes is wrong, copies of a node disagree, or a node was
        moved that the case does not move.
        """
        shaped = self._shaped(coordinates)
        now = self._points[self._surface.nodes]
        self._displacement = self._surface.displacement(shaped, now)
        self._coordinates = shaped.copy()

    def warpMesh(self) -> None:
        """Move the grid to the surface that was set."""
        self._points = np.array(self.deformer.deform(self._displacement))
        self._coordinates = self._followed(self._coordinates)

    def getSolverGrid(self) -> FloatArray:
        """Return the coordinates of the grid, flat, that `setExternalMeshIndices` chose."""
        return self.getWarpGrid()[self._indices]

    def getWarpGrid(self) -> FloatArray:
        """Return all coordinates of the grid, flat, in the order of the file."""
        return self._points[self._order].ravel()

    def getCommonGrid(self) -> FloatArray:
        """Return all coordinates of the grid, flat, in the order of the file."""
        return self.getWarpGrid()

    def writeGrid(self, fileName: str | Path | None = None) -> None:
        """Write the grid into a file, of the format that its ending names.

        Raises CaseError if no name was given.
        """
        if fileName is None:
            raise CaseError("writeGrid needs the name of a file, e.g. writeGrid('warped.cgns')")
        write(fileName, self.deformer.mesh.with_points(self._points))

    # Derivatives ---------------------------------------------------------------------------
    def warpDeriv(self, dXv: ArrayLike, solverVec: bool = True) -> None:
        """Compute the transposed Jacobian times ``dXv``, flat, at the surface that was set.

        `getdXs` returns the product. ``solverVec``: the entries of ``dXv`` are those of
        `getSolverGrid`; else those of `getWarpGrid`.
        """
        weights = self._of_grid(dXv, solverVec)
        self._gradient = np.array(self.deformer.vjp(self._displacement, weights))

    def getdXs(self) -> FloatArray:
        """Return the result of `warpDeriv` at the nodes of the surface, (N, d)."""
        return self._surface.spread(self._gradient / self._surface.copies)

    def warpDerivFwd(self, dXs: ArrayLike, solverVec: bool = True) -> FloatArray:
        """Return the derivative of the grid, flat, as the surface changes by ``dXs``.

        ``dXs`` is (N, d) or flat. ``solverVec``: in the order of `getSolverGrid`; else of
        `getWarpGrid`.
        """
        change = self._surface.means(self._shaped(dXs))
        moved = self.deformer.jvp(self._displacement, change)[self._order].ravel()
        return moved[self._indices] if solverVec else moved

    def verifyWarpDeriv(
        self,
        dXv: ArrayLike | None = None,
        solverVec: bool = True,
        dofStart: int = 0,
        dofEnd: int = 10,
        h: float = 1e-6,
        randomSeed: int = 314,
    ) -> FloatArray:
        """Return derivatives beside central differences, (k, 2), where IDWarp prints them.

        They are those of ``dXv · grid`` (random numbers without ``dXv``) by the coordinates
        ``dofStart`` to ``dofEnd - 1`` of the surface, for steps of ``h`` in units of the mesh.
        """
        if dXv is None:
            weights = np.random.default_rng(randomSeed).random(self._points.shape)
        else:
            weights = self._of_grid(dXv, solverVec)
        exact = self.deformer.vjp(self._displacement, weights)
        exact = self._surface.spread(exact / self._surface.copies).ravel()
        rows = []
        for k in range(dofStart, min(dofEnd, len(exact))):
            unit = np.zeros(len(exact))
            unit[k] = h
            change = self._surface.means(self._shaped(unit))
            ends = [self.deformer.deform(self._displacement + s * change) for s in (1, -1)]
            rows.append((exact[k], (weights * (ends[0] - ends[1])).sum() / (2 * h)))
        return np.array(rows).reshape(-1, 2)

    # Between the orders of numbers ---------------------------------------------------------
    def _followed(self, coordinates: FloatArray) -> FloatArray:
        """Return coordinates (N, d), with those of nodes that are not moving from the grid."""
        return np.where(self._surface.held, self._points[self._surface.nodes], coordinates)

    def _shaped(self, values: ArrayLike) -> FloatArray:
        """Return values, flat or (N, d), as (N, d); CaseError if any is not finite."""
        out = np.asarray(values, np.float64).reshape(-1, self.deformer.mesh.dim)
        if not np.isfinite(out).all():
            raise CaseError("values of the surface are not finite; give finite numbers")
        return out

    def _of_grid(self, values: ArrayLike, solver: bool) -> FloatArray:
        """Return flat values of the grid as (n, d), summed over the copies of each point.

        ``solver``: in the order of `getSolverGrid`; else of `getWarpGrid`.
        """
        given = np.asarray(values, np.float64).ravel()
        dim = self._points.shape[1]
        places = (self._order[:, None] * dim + np.arange(dim)).ravel()
        if solver:
            places = places[self._indices]
        if len(given) != len(places):
            raise CaseError(
                f"a vector of the grid has {len(given)} numbers; expected {len(places)}, the "
                f"number that {'getSolverGrid' if solver else 'getWarpGrid'} returns"
            )
        sums = np.bincount(places, given, self._points.size)
        return sums.astype(np.float64).reshape(self._points.shape)


def _read(options: Mapping[str, Any]) -> tuple[Mesh, Case, Any]:
    """Return mesh, case and displacements (or None) of the options; CaseError if one is wrong."""
    unknown = sorted(set(options) - {*_OURS, *_THEIRS})
    missing = [name for name in ("gridFile", "case") if options.get(name) is None]
    if unknown or missing:
        wrong = [f"option {name!r} is unknown" for name in unknown]
        wrong += [f"option {name!r} is missing" for name in missing]
        raise CaseError(
            f"{'; '.join(wrong)}; give gridFile (a mesh) and case (roles of its boundaries and the "
            "method), and if wanted displacements"
        )
    idle = [name for name in _THEIRS[1:] if options.get(name) not in (None, [])]
    if idle:
        warnings.warn(
            f"options of IDWarp without effect here: {', '.join(idle)}; the case says how the "
            "mesh deforms",
            stacklevel=3,
        )
    mesh = options["gridFile"]
    case = options["case"]
    if not isinstance(mesh, Mesh):
        mesh = read(mesh)
    if not isinstance(case, Case):
        case = Case.read(case)
    return mesh, case, options.get("displacements")
