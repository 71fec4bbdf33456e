"""The moved part of a mesh, and the direction from which it is shown."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import SlidevizError, not_one_of, point_words
from slideviz.mesh.model import FloatArray, IntArray, Mesh, row_norms

TINY = 0.05  # size of the moved boundaries, relative to the mesh's, below which a detail is shown
MARGIN = 2.5  # width of a detail relative to that of the moved boundaries


@frozen
class Detail:
    """A part of the mesh to show."""

    centre: tuple[float, ...]
    """Its centre, two or three coordinates in the mesh's length unit."""
    width: float
    """The width that is seen, in the mesh's length unit."""


Zoom = Detail | Literal["auto", "all", "view"]
"""What a picture shows: a given detail, the whole mesh (``all``), or automatically one of both.

``auto`` is the surroundings of the moved boundaries if these are tiny in the mesh, else all.
``view`` is the view of the window, as the keys VIEW_... of the case have it."""


def require_detail(zoom: Zoom, mesh: Mesh) -> None:
    """Raise SlidevizError if a detail is not in the mesh or has the wrong dimension.

    A word that `Zoom` does not have raises it, too.
    """
    if not isinstance(zoom, Detail):
        if zoom not in (words := get_args(get_args(Zoom)[1])):
            raise SlidevizError(f"zoom: {not_one_of(zoom, words)}")
        return
    place = point_words(zoom.centre)
    if len(zoom.centre) != mesh.dim:
        raise SlidevizError(
            f"a detail about {place} is not a place in a {mesh.dim}D mesh; give {mesh.dim} "
            "coordinates and a width"
        )
    low = mesh.points.min(axis=0)
    high = mesh.points.max(axis=0)
    # Boundaries may move out of the box by some of its size.
    far = 0.5 * zoom.width + 0.5 * float((high - low).max())
    if np.any(zoom.centre < low - far) or np.any(zoom.centre > high + far):
        ends = zip("xyz", low, high, strict=False)
        box = ", ".join(f"{axis} from {a:.6g} to {b:.6g}" for axis, a, b in ends)
        raise SlidevizError(f"a detail about {place} misses the mesh, which has {box}")


@record
class Overview:
    """The default view of a deformed mesh: the cells that are drawn, and the camera's direction."""

    cells: IntArray  # (k,): indices of the cells that are drawn
    towards: FloatArray
    up: FloatArray  # `towards`, `up` (3,): direction from the mesh to the camera, and the up vector
    detail: Detail | None  # the part that is seen; None for everything

    @classmethod
    def of(cls, mesh: Mesh, base: Mesh, zoom: Zoom = "auto") -> Overview:
        """Return the overview of a deformed mesh whose undeformed one is ``base``.

        A 2D mesh is seen along z. Of a 3D mesh, the whole cells behind a plane are seen, which
        goes through the boundary that moved most, along its displacement. Raises SlidevizError if
        the detail has not as many coordinates as the mesh, or is outside the mesh.
        """
        require_detail(zoom, base)
        detail = tiny_motion(mesh, base) if zoom == "auto" else zoom
        return cls(*half_of(mesh, base), detail if isinstance(detail, Detail) else None)


def tiny_motion(mesh: Mesh, base: Mesh) -> Detail | None:
    """Return the surroundings of the moved inner boundaries, if these are tiny in the mesh.

    An example is an airfoil in a wide far field. None if they are large enough, or if only outer
    boundaries moved.
    """
    bodies = _inner_bodies(base, lengths(mesh, base))
    if not bodies:
        return None
    nodes = np.concatenate(bodies)
    points = np.concatenate([base.points[nodes], mesh.points[nodes]])
    low = points.min(axis=0)
    extent = np.ptp(points, axis=0)
    width = float(np.linalg.norm(extent))
    if width >= TINY * float(np.linalg.norm(np.ptp(base.points, axis=0))):
        return None
    return Detail(tuple((low + extent / 2.0).tolist()), MARGIN * width)


def lengths(mesh: Mesh, base: Mesh) -> FloatArray:
    """Return the length of the displacement of each node, (n,)."""
    return row_norms(mesh.points - base.points)


def _inner_bodies(base: Mesh, length: FloatArray) -> list[IntArray]:
    """Return the nodes of each moved boundary inside the mesh's bounding box.

    ``length`` (n,) is the displacement of each node. A boundary counts as moved from 5 % of the
    largest displacement on.
    """
    least = 0.05 * float(length.max())
    bodies = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return [at for at in bodies if _is_inside(base, at) and length[at].max() > least]


def _is_inside(base: Mesh, nodes: IntArray) -> bool:
    """Return whether nodes are strictly inside the mesh's box in two directions or more.

    Those of an airfoil or blade are.
    """
    low = base.points.min(axis=0)
    high = base.points.max(axis=0)
    at = base.points[nodes]
    return int(((at.min(axis=0) > low) & (at.max(axis=0) < high)).sum()) >= 2


def half_of(mesh: Mesh, base: Mesh) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the cells (k,) to show, the direction (3,) to the camera, and the up vector (3,).

    See `Overview.of`.
    """
    if mesh.dim == 2:
        return np.arange(len(mesh.cells)), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    low = base.points.min(axis=0)
    extent = np.ptp(base.points, axis=0)
    centre = low + extent / 2.0
    across = int(np.argmin(extent))
    length = lengths(mesh, base)
    if length.max() > 0:
        strong = _moved_body(base, length)
        centre = base.points[strong].mean(axis=0)
        along = np.abs(mesh.points - base.points)[strong].mean(axis=0)
        # The plane contains the motion; of such planes, the one normal to the longest side.
        free = along < 0.5 * along.max()
        across = int(np.argmax(np.where(free, extent, -1.0))) if free.any() else int(along.argmin())
    # By undeformed positions, so that a layer of cells of a structured mesh stays together.
    middle = base.cells.means(base.points[:, across])
    behind = np.flatnonzero(middle <= centre[across] + 1e-3 * extent[across])
    normal = np.zeros(3)
    normal[across] = 1.0
    up = np.array([0.0, 1.0, 0.0]) if across == 2 else np.array([0.0, 0.0, 1.0])
    shown = behind if len(behind) else np.arange(len(middle))
    return shown, normal + 0.4 * np.cross(up, normal) + 0.3 * up, up


def _moved_body(base: Mesh, length: FloatArray) -> IntArray:
    """Return the nodes of the boundary to cut through: of the inner ones, that which moved most.

    Inner boundaries, such as a blade, precede outer ones, which may slide further. Without
    boundaries: the nodes that moved most. ``length`` (n,) is the displacement of each node.
    """

    def rank(nodes: IntArray) -> tuple[bool, float]:
        return _is_inside(base, nodes), float(length[nodes].mean())

    every = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return max(every, key=rank, default=np.flatnonzero(length > 0.7 * length.max()))
