"""The moved part of a mesh, and the direction from which it is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray, IntArray, Mesh

TINY = 0.05
"""Moved boundaries smaller than this part of the mesh are shown in detail."""
MARGIN = 2.5
"""A detail is this many times as wide as the boundaries that moved."""


@dataclass(frozen=True)
class Detail:
    """A part of the mesh to show.

    Attributes
    ----------
    centre : tuple of float
        Its middle, two or three coordinates in the mesh's length unit.
    width : float
        How much of the mesh is seen from left to right, in the mesh's length unit.
    """

    centre: tuple[float, ...]
    width: float


Zoom = Detail | Literal["auto", "all"]
"""A given detail, the whole mesh, or the whole unless what moved is tiny in it."""


def require_detail(zoom: Zoom, mesh: Mesh) -> None:
    """Raise SlidevizError where a given detail is no part of a mesh, before the work."""
    if not isinstance(zoom, Detail):
        return
    place = ", ".join(f"{x:g}" for x in zoom.centre)
    if len(zoom.centre) != mesh.dim:
        raise SlidevizError(
            f"a detail about {place} is not a place in a {mesh.dim}D mesh; give {mesh.dim} "
            "coordinates and a width"
        )
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    # Boundaries may move out of the box by some of its size.
    far = 0.5 * zoom.width + 0.5 * float((high - low).max())
    if np.any(zoom.centre < low - far) or np.any(zoom.centre > high + far):
        ends = zip("xyz", low, high, strict=False)
        box = ", ".join(f"{axis} from {a:.6g} to {b:.6g}" for axis, a, b in ends)
        raise SlidevizError(f"a detail about {place} misses the mesh, which has {box}")


@dataclass(frozen=True, eq=False)
class Overview:
    """The cells of a mesh that are shown, and from where, as long as nobody chooses otherwise.

    Attributes
    ----------
    cells : (k,) int64
        Those of a 3D mesh that are drawn.
    towards, up : (3,) float64
        From the mesh to the camera, and what is up.
    detail : Detail or None
        The part that is seen; None is everything.
    """

    cells: IntArray
    towards: FloatArray
    up: FloatArray
    detail: Detail | None

    @classmethod
    def of(cls, mesh: Mesh, base: Mesh, zoom: Zoom = "auto") -> Overview:
        """Return the overview of a deformed mesh whose undeformed one is ``base``.

        A 2D mesh is seen from above. Of a 3D mesh the half behind a plane is seen, cells uncut;
        the plane goes through what moved most and along the way it moved.

        Raises
        ------
        SlidevizError
            The detail has not as many coordinates as the mesh, or is no part of it.
        """
        require_detail(zoom, base)
        detail = tiny_motion(mesh, base) if zoom == "auto" else zoom
        return cls(*half_of(mesh, base), detail if isinstance(detail, Detail) else None)


def tiny_motion(mesh: Mesh, base: Mesh) -> Detail | None:
    """Return the surroundings of moved nodes that would be a dot in a view of the whole mesh.

    That are the boundaries inside the mesh that moved: an airfoil in a wide far field. None
    when they are large enough, or when it is an outer boundary that moved.
    """
    bodies = _inner_bodies(base, lengths(mesh, base))
    if not bodies:
        return None
    nodes = np.concatenate(bodies)
    points = np.concatenate([base.points[nodes], mesh.points[nodes]])
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    width = float(np.linalg.norm(extent))
    if width >= TINY * float(np.linalg.norm(np.ptp(base.points, axis=0))):
        return None
    return Detail(tuple((low + extent / 2.0).tolist()), MARGIN * width)


def lengths(mesh: Mesh, base: Mesh) -> FloatArray:
    """Return the length of the displacement of each node, (n,)."""
    return np.asarray(np.linalg.norm(mesh.points - base.points, axis=1))


def _inner_bodies(base: Mesh, length: FloatArray) -> list[IntArray]:
    """Return the nodes of each boundary that lies inside the mesh's box and moved."""
    least = 0.05 * float(length.max())
    bodies = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return [at for at in bodies if _is_inside(base, at) and length[at].max() > least]


def _is_inside(base: Mesh, nodes: IntArray) -> bool:
    """Tell whether nodes keep off the mesh's box in two directions or more, as a blade does."""
    low, high = base.points.min(axis=0), base.points.max(axis=0)
    at = base.points[nodes]
    return int(((at.min(axis=0) > low) & (at.max(axis=0) < high)).sum()) >= 2


def half_of(mesh: Mesh, base: Mesh) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the cells to show, the direction to the camera, and the direction that is up.

    All cells of a 2D mesh, seen from above; of a 3D mesh those behind a plane through what moved.
    """
    if mesh.dim == 2:
        return np.arange(len(mesh.cells)), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    low, extent = base.points.min(axis=0), np.ptp(base.points, axis=0)
    centre, across = low + extent / 2.0, int(np.argmin(extent))
    length = lengths(mesh, base)
    if length.max() > 0:
        strong = _moved_body(base, length)
        centre = base.points[strong].mean(axis=0)
        along = np.abs(mesh.points - base.points)[strong].mean(axis=0)
        # Cut along the motion, and of such planes the one across the longest side.
        free = along < 0.5 * along.max()
        across = int(np.argmax(np.where(free, extent, -1.0))) if free.any() else int(along.argmin())
    # By where the cells were: what lay in one layer of a structured mesh stays together.
    cells = base.cells
    total = np.add.reduceat(base.points[cells.connectivity, across], cells.offsets[:-1])
    middle = total / np.diff(cells.offsets)
    behind = np.flatnonzero(middle <= centre[across] + 1e-3 * extent[across])
    normal = np.zeros(3)
    normal[across] = 1.0
    up = np.array([0.0, 1.0, 0.0]) if across == 2 else np.array([0.0, 0.0, 1.0])
    shown = behind if len(behind) else np.arange(len(cells))
    return shown, normal + 0.4 * np.cross(up, normal) + 0.3 * up, up


def _moved_body(base: Mesh, length: FloatArray) -> IntArray:
    """Return the nodes of the boundary to cut through: of those inside, what moved most.

    A blade or a block lies inside the mesh's box in two directions or three; the outer
    boundaries, which may slide further than it, in none.
    """

    def rank(nodes: IntArray) -> tuple[bool, float]:
        return _is_inside(base, nodes), float(length[nodes].mean())

    every = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return max(every, key=rank, default=np.flatnonzero(length > 0.7 * length.max()))
