"""IDWarp's names for a deformation, for programs that call ``idwarp.USMesh`` (ADflow, DAFoam).

The methods take and return what IDWarp's do (mdolab/idwarp, ``UnstructuredMesh.py``), so that such
a program needs another import and other options. What deforms the mesh is a `slideviz.Deformer`:
sliding, periodic and data-reduced as its case says, with exact derivatives. One process only.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from slideviz.case.model import Case

COINCIDES = 1e-8
"""How far a node of the surface may lie from one of the mesh, as a part of the mesh's extent."""

_OURS = ("gridFile", "case", "displacements")
_THEIRS = (
    *("fileType", "specifiedSurfaces", "symmetrySurfaces", "symmetryPlanes", "aExp", "bExp"),
    *("LdefFact", "alpha", "errTol", "evalMode", "symmTol", "useRotations", "zeroCornerRotations"),
    *("cornerAngle", "restartFile", "bucketSize"),
)
"""Options of IDWarp; those that say how it deforms do nothing here."""


class USMesh:
    """A mesh that follows its surface, with the methods of IDWarp's ``USMesh``.

    Coordinates of the surface are (N, d), in the order of `setSurfaceDefinition`, or without it
    (m, d), the moving nodes of the case in ascending order; those of the grid are flat. Indices of
    `setExternalMeshIndices` are IDWarp's: of *coordinates* (d times the node plus the axis).

    Nodes of a surface that the case does not move (hub and casing, when they slide) belong to it
    too, but cannot be prescribed: their coordinates are where they were or where the last
    `warpMesh` took them, and their entries in `getdXs` are 0. Of a node that the surface has
    several times, all copies must agree; the derivative is shared among them.

    Parameters
    ----------
    options : dict
        ``gridFile``: a mesh file or a `slideviz.Mesh`; ``case``: a case file or a `slideviz.Case`,
        with the roles of the boundaries and the method. ``displacements``: what the deformation
        is prepared for, as for `slideviz.Deformer`; without them the motions of the case, and
        without those none, which is enough without data reduction.
        Options of IDWarp that say how to deform are taken, with a warning, and do nothing.
    comm : mpi4py.MPI.Comm, optional
        Of one process.
    debug : bool
        Does nothing.

    Raises
    ------
    CaseError
        An option is missing or unknown, or there are several processes.
    """

    def __init__(
        self, options: Mapping[str, Any] | None = None, comm: Any = None, debug: bool = False
    ) -> None:
        from slideviz.design.deformer import Deformer

        del debug
        if comm is not None and comm.size > 1:
            raise CaseError(
                f"slideviz.idwarp works on one process, and was given {comm.size}; give it "
                "MPI.COMM_SELF, and the whole surface and grid"
            )
        mesh, case, displacements = _read(options or {})
        moving = [mesh.marker(name).nodes for name in case.markers_with("moving")]
        if displacements is None and moving and not case.motions:
            displacements = np.zeros((len(np.unique(np.concatenate(moving))), mesh.dim))
        self.comm = comm
        self.deformer = Deformer(mesh, case, displacements)
        self._surface: IntArray = np.asarray(self.deformer.nodes)
        self._of_moving, self._copies = _places(self._surface, self._surface)
        self._indices: IntArray = np.arange(mesh.points.size)
        self._displacement = np.zeros((len(self.deformer.nodes), mesh.dim))
        self._start = mesh.points[self._surface]
        self._coordinates = self._start.copy()
        self._points = np.array(mesh.points)
        self._gradient = np.zeros_like(self._displacement)

    # What the solver says ------------------------------------------------------------------

    def setExternalMeshIndices(self, ind: ArrayLike) -> None:
        """Say which coordinates of the grid, counted from 0, the solver has, and in which order.

        Raises
        ------
        CaseError
            There is no such coordinate.
        """
        indices, size = np.asarray(ind, np.int64).ravel(), self._points.size
        if len(indices) and not 0 <= indices.min() <= indices.max() < size:
            raise CaseError(
                f"indices of the solver's grid go from {indices.min()} to {indices.max()}; the "
                f"mesh has {size} coordinates, numbered from 0: node times dimension plus axis"
            )
        self._indices = indices

    def setSurfaceDefinition(
        self,
        pts: ArrayLike,
        conn: ArrayLike = (),
        faceSizes: ArrayLike = (),
        cgnsBlockID: object = None,
    ) -> None:
        """Say which surface the solver has: undeformed coordinates ``pts`` (N, d).

        Its nodes are found in the mesh by their coordinates; so ``conn`` and the rest, which
        IDWarp needs, are not used.

        Raises
        ------
        CaseError
            A node is none of the mesh, or a moving node of the case is not in the surface.
        """
        from scipy.spatial import cKDTree

        del conn, faceSizes, cgnsBlockID
        mesh, nodes = self.deformer.mesh, np.asarray(self.deformer.nodes)
        given = self._shaped(pts)
        boundary = np.unique(np.concatenate([nodes, *(m.nodes for m in mesh.markers)]))
        distance, found = cKDTree(mesh.points[boundary]).query(given)
        far = np.asarray(distance)
        if not far.max(initial=0.0) <= COINCIDES * mesh.extent:
            worst = int(far.argmax())
            raise CaseError(
                f"node {worst} of the surface, at {given[worst].tolist()}, is {far[worst]:g} from "
                f"the next boundary node of {mesh.name}; give the undeformed surface of this mesh"
            )
        surface = boundary[found]
        missing = np.setdiff1d(nodes, surface)
        if len(missing):
            raise CaseError(
                f"{len(missing)} of {len(nodes)} moving nodes of the case are not in the surface, "
                f"the first one at {mesh.points[missing[0]].tolist()}; give the whole surface, or "
                "other roles"
            )
        self._surface = surface
        self._of_moving, self._copies = _places(surface, nodes)
        self._start = mesh.points[surface]
        now = self._start + self._spread(self._displacement)
        self._coordinates = np.where(self._held, self._points[surface], now)

    # Coordinates ---------------------------------------------------------------------------

    def getSurfaceCoordinates(self) -> FloatArray:
        """Return the coordinates of the surface (N, d)."""
        return self._coordinates.copy()

    def setSurfaceCoordinates(self, coordinates: ArrayLike) -> None:
        """Set the coordinates of the surface (N, d); `warpMesh` moves the grid.

        Raises
        ------
        CaseError
            Their number is another, copies of a node disagree, or one was moved that the case
            does not move.
        """
        given = self._shaped(coordinates)
        if len(given) != len(self._surface):
            raise CaseError(
                f"{len(given)} nodes were given for a surface of {len(self._surface)}; give as "
                "many as getSurfaceCoordinates returns"
            )
        if not np.isfinite(given).all():
            raise CaseError("coordinates of the surface are infinite or no numbers; give numbers")
        moved = given - self._start
        displacement = self._gather(moved) / self._copies[:, None]
        tolerance = COINCIDES * self.deformer.mesh.extent
        off = _lengths(np.where(self._held, 0.0, moved - self._spread(displacement)))
        if off.max(initial=0.0) > tolerance:
            raise CaseError(
                f"node {int(off.argmax())} of the surface is there several times, with coordinates "
                f"that are {off.max():g} from their mean; copies of a node must move alike"
            )
        since = given - self._points[self._surface]
        off = np.where(self._held[:, 0], np.minimum(_lengths(moved), _lengths(since)), 0.0)
        if off.max(initial=0.0) > tolerance:
            worst = int(off.argmax())
            raise CaseError(
                f"node {worst} of the surface, at {self._start[worst].tolist()}, was moved by "
                f"{_lengths(moved)[worst]:g}, but its boundary is not a moving one in the case; "
                "give it the role moving, or leave the node"
            )
        self._displacement, self._coordinates = displacement, given.copy()

    def warpMesh(self) -> None:
        """Move the grid to the surface that was set."""
        self._points = np.array(self.deformer.deform(self._displacement))
        self._coordinates = np.where(self._held, self._points[self._surface], self._coordinates)

    def getSolverGrid(self) -> FloatArray:
        """Return the coordinates of the grid, flat, those of `setExternalMeshIndices`."""
        return self._points.ravel()[self._indices]

    def getWarpGrid(self) -> FloatArray:
        """Return all coordinates of the grid, flat, in the order of the mesh."""
        return self._points.ravel()

    def getCommonGrid(self) -> FloatArray:
        """Return all coordinates of the grid, flat, in the order of the mesh."""
        return self._points.ravel()

    def writeGrid(self, fileName: str | Path | None = None) -> None:
        """Write the grid into a file, of the format that its ending names.

        Raises
        ------
        CaseError
            No name was given.
        """
        from slideviz.mesh.io.files import write

        if fileName is None:
            raise CaseError("writeGrid needs the name of a file, as in writeGrid('warped.cgns')")
        write(fileName, self.deformer.mesh.with_points(self._points))

    # Derivatives ---------------------------------------------------------------------------

    def warpDeriv(self, dXv: ArrayLike, solverVec: bool = True) -> None:
        """Find the transposed product with ``dXv``, flat, at the surface that was set.

        `getdXs` returns it. ``solverVec``: ``dXv`` is as `getSolverGrid` is, else as `getWarpGrid`.
        """
        weights = self._of_grid(dXv, solverVec).reshape(self._points.shape)
        self._gradient = np.array(self.deformer.vjp(self._displacement, weights))

    def getdXs(self) -> FloatArray:
        """Return the product that `warpDeriv` found, for each node of the surface (N, d)."""
        return self._spread(self._gradient / self._copies[:, None])

    def warpDerivFwd(self, dXs: ArrayLike, solverVec: bool = True) -> FloatArray:
        """Return the change of the grid, flat, for a change of the surface, (N, d) or flat."""
        change = self._gather(self._shaped(dXs)) / self._copies[:, None]
        moved = self.deformer.jvp(self._displacement, change).ravel()
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
            weights = np.random.default_rng(randomSeed).random(self._points.size)
        else:
            weights = self._of_grid(dXv, solverVec)
        shape = self._displacement.shape
        exact = self.deformer.vjp(self._displacement, weights.reshape(self._points.shape))
        exact = self._spread(exact / self._copies[:, None]).ravel()
        rows = []
        for k in range(dofStart, min(dofEnd, len(exact))):
            unit = np.zeros(len(exact))
            unit[k] = h
            change = self._gather(unit.reshape(-1, shape[1])) / self._copies[:, None]
            ends = [self.deformer.deform(self._displacement + s * change) for s in (1, -1)]
            rows.append((exact[k], weights @ (ends[0] - ends[1]).ravel() / (2 * h)))
        return np.array(rows).reshape(-1, 2)

    # Between the orders of numbers ---------------------------------------------------------

    @property
    def _held(self) -> NDArray[np.bool_]:
        """Return which nodes of the surface the case does not move, (N, 1)."""
        return self._of_moving[:, None] < 0

    def _shaped(self, values: ArrayLike) -> FloatArray:
        return np.asarray(values, np.float64).reshape(-1, self.deformer.mesh.dim)

    def _gather(self, surface: FloatArray) -> FloatArray:
        """Return the sums over the copies of each moving node (m, d)."""
        out, moving = np.zeros_like(self._displacement), self._of_moving >= 0
        np.add.at(out, self._of_moving[moving], surface[moving])
        return out

    def _spread(self, moving: FloatArray) -> FloatArray:
        """Return what each node of the surface has of its moving node (N, d), or 0."""
        return np.where(self._held, 0.0, moving[np.maximum(self._of_moving, 0)])

    def _of_grid(self, values: ArrayLike, solver: bool) -> FloatArray:
        """Return numbers in the order of the mesh, flat; of a coordinate, those of all copies."""
        given = np.asarray(values, np.float64).ravel()
        if not solver:
            return given
        return np.bincount(self._indices, given, self._points.size).astype(np.float64)


def _read(options: Mapping[str, Any]) -> tuple[Mesh, Case, Any]:
    """Return mesh, case and displacements of the options."""
    from slideviz.case.model import Case
    from slideviz.mesh.io.files import read

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
            f"options of IDWarp that do nothing here: {', '.join(idle)}; the case says how the "
            "mesh deforms",
            stacklevel=3,
        )
    mesh, case = options["gridFile"], options["case"]
    if not isinstance(mesh, Mesh):
        mesh = read(mesh)
    if not isinstance(case, Case):
        case = Case.read(case)
    return mesh, case, options.get("displacements")


def _places(surface: IntArray, nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Return the place of each surface node among sorted nodes (N,), or -1, and copies (m,)."""
    at = np.minimum(np.searchsorted(nodes, surface), len(nodes) - 1)
    at = np.where(nodes[at] == surface, at, -1)
    return at, np.bincount(at[at >= 0], minlength=len(nodes))


def _lengths(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(vectors, axis=1))
