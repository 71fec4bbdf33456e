"""Find the boundary or the cell under the mouse; pixels are counted from the lower left."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkCellPicker

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.scene.actors import DrawnBoundary

REACH = 9.0  # distance in pixels from a line up to which a click hits it


def to_display(plotter: Any, points: FloatArray) -> FloatArray:
    """Return the display coordinates (n, 2), in pixels from the lower left, of points (n, 3)."""
    renderer = plotter.renderer
    aspect = renderer.GetTiledAspectRatio()
    matrix = renderer.camera.GetCompositeProjectionTransformMatrix(aspect, -1, 1)
    full = pv.array_from_vtkmatrix(matrix)
    clip = np.column_stack([points, np.ones(len(points))]) @ full.T
    size = np.array(plotter.render_window.GetSize())
    return (clip[:, :2] / clip[:, 3:] + 1.0) / 2.0 * size


def nearest_line(plotter: Any, x: float, y: float, drawn: Iterable[DrawnBoundary]) -> str | None:
    """Return the name of a 2D mesh's boundary nearest to a pixel; None if none is in `REACH`."""
    best = REACH
    name = None
    at = np.array([x, y])
    for one in drawn:
        seen = to_display(plotter, np.asarray(one.shape.points))
        a = seen[one.surface.facets[:, 0]]
        b = seen[one.surface.facets[:, 1]]
        along = b - a
        length2 = np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
        part = np.clip(np.einsum("ij,ij->i", at - a, along) / length2, 0.0, 1.0)
        distance = float(np.linalg.norm(a + part[:, None] * along - at, axis=1).min())
        if distance < best:
            best = distance
            name = one.surface.name
    return name


def front_surface(plotter: Any, x: float, y: float, drawn: Iterable[DrawnBoundary]) -> str | None:
    """Return the name of a 3D mesh's foremost boundary at a pixel; None if there is none."""
    names = {one.actor: one.surface.name for one in drawn}
    return names.get(_foremost(plotter, x, y, names, 0.0005)[0])


def meets(plotter: Any, x: float, y: float, actors: Sequence[Any]) -> bool:
    """Return whether one of the given actors is visible at a pixel, or hidden by others there."""
    return bool(actors) and _foremost(plotter, x, y, actors)[0] is not None


def _foremost(
    plotter: Any, x: float, y: float, actors: Iterable[Any], tolerance: float = 0.0
) -> tuple[Any, int]:
    """Return the foremost of some actors at a pixel, or None, and the number of its polygon there.

    ``tolerance``: distance up to which the actor is hit, relative to the view's diagonal.
    """
    picker = vtkCellPicker()
    picker.SetTolerance(tolerance)
    picker.PickFromListOn()
    for actor in actors:
        picker.AddPickList(actor)
    picker.Pick(x, y, 0.0, plotter.renderer)
    return picker.GetActor(), picker.GetCellId()


def on_plane(plotter: Any, x: float, y: float) -> tuple[float, float]:
    """Return the point (x, y) where the line of sight through a pixel meets the plane z = 0."""
    renderer = plotter.renderer
    ends = []
    for depth in (0.0, 1.0):
        renderer.SetDisplayPoint(x, y, depth)
        renderer.DisplayToWorld()
        point = np.array(renderer.GetWorldPoint())
        ends.append(point[:3] / point[3])
    near, far = ends
    along = near[2] / (near[2] - far[2])
    at = near + along * (far - near)
    return float(at[0]), float(at[1])


def front_cell(
    plotter: Any, x: float, y: float, shown: Sequence[tuple[Any, IntArray | FloatArray]]
) -> int | None:
    """Return the index of the cell of the foremost polygon at a pixel; None if there is none.

    ``x`` and ``y``: pixels from the lower left. ``shown``: the actors to look at, each with the
    index of the cell that each of its polygons is of.
    """
    owners = dict(shown)
    actor, polygon = _foremost(plotter, x, y, owners)
    return int(owners[actor][polygon]) if actor in owners else None
