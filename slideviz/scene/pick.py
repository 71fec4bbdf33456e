"""Find the boundary or the cell under the mouse; pixels are counted from the lower left."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkCellPicker

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.scene.actors import DrawnBoundary

REACH = 9.0  # distance in pixels from a line up to which a click hits it


@record
class Projection:
    """How a view shows points: parallel, or in perspective; pixels are from the lower left."""

    matrix: FloatArray  # (4, 4): from homogeneous points to a cube from -1 to 1
    size: FloatArray  # (2,): of the view, in pixels

    @classmethod
    def of(cls, plotter: Any) -> Projection:
        """Return the projection of a plotter's camera."""
        renderer = plotter.renderer
        aspect = renderer.GetTiledAspectRatio()
        matrix = renderer.camera.GetCompositeProjectionTransformMatrix(aspect, -1, 1)
        size = np.array(plotter.render_window.GetSize())
        return cls(np.asarray(pv.array_from_vtkmatrix(matrix), np.float64), size)

    def pixels(self, points: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) of points (n, 3)."""
        clip = np.column_stack([points, np.ones(len(points))]) @ self.matrix.T
        return (clip[:, :2] / clip[:, 3:] + 1.0) / 2.0 * self.size

    def ray(self, pixel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the line of sight through a pixel (2,): its nearest point, and its direction."""
        across = 2.0 * np.asarray(pixel) / self.size - 1.0
        ends = np.array([[*across, -1.0, 1.0], [*across, 1.0, 1.0]])
        found = np.linalg.solve(self.matrix, ends.T).T
        near = found[0, :3] / found[0, 3]
        far = found[1, :3] / found[1, 3]
        return near, (far - near) / np.linalg.norm(far - near)

    def on_plane(self, pixel: FloatArray, point: FloatArray, normal: FloatArray) -> FloatArray:
        """Return where (3,) the line of sight through a pixel meets a plane."""
        start, way = self.ray(pixel)
        return start + (point - start) @ normal / (way @ normal) * way

    def sight(self, point: FloatArray) -> FloatArray:
        """Return the unit direction (3,) in which a point (3,) is seen."""
        return self.ray(self.pixels(point[None])[0])[1]

    def pixel_length(self, point: FloatArray) -> float:
        """Return the length of a pixel at a point (3,), across the line of sight."""
        sight = self.sight(point)
        (at,) = self.pixels(point[None])
        beside = self.on_plane(at + np.array([1.0, 0.0]), point, sight)
        return float(np.linalg.norm(beside - point))


def to_display(plotter: Any, points: FloatArray) -> FloatArray:
    """Return the display coordinates (n, 2), in pixels from the lower left, of points (n, 3)."""
    return Projection.of(plotter).pixels(points)


def distances(at: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the distances (...) of a place (d,) from straight lines (..., d)."""
    way = end - start
    share = ((at - start) * way).sum(-1) / np.maximum((way * way).sum(-1), 1e-30)
    return np.linalg.norm(start + np.clip(share, 0.0, 1.0)[..., None] * way - at, axis=-1)


def nearest_line(plotter: Any, x: float, y: float, drawn: Iterable[DrawnBoundary]) -> str | None:
    """Return the name of a 2D mesh's boundary nearest to a pixel; None if none is in `REACH`."""
    best = REACH
    name = None
    at = np.array([x, y])
    for one in drawn:
        seen = to_display(plotter, np.asarray(one.shape.points))
        a, b = seen[one.surface.facets].swapaxes(0, 1)
        distance = float(distances(at, a, b).min())
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
) -> tuple[Any, int, FloatArray]:
    """Return the foremost of some actors at a pixel, or None, its polygon there, and the point.

    ``tolerance``: distance up to which the actor is hit, relative to the view's diagonal.
    """
    picker = vtkCellPicker()
    picker.SetTolerance(tolerance)
    picker.PickFromListOn()
    for actor in actors:
        picker.AddPickList(actor)
    picker.Pick(x, y, 0.0, plotter.renderer)
    return picker.GetActor(), picker.GetCellId(), np.array(picker.GetPickPosition())


def on_plane(plotter: Any, x: float, y: float) -> tuple[float, float]:
    """Return the point (x, y) where the line of sight through a pixel meets the plane z = 0."""
    at = Projection.of(plotter).on_plane(np.array([x, y]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    return float(at[0]), float(at[1])


def front_cell(
    plotter: Any, x: float, y: float, shown: Sequence[tuple[Any, IntArray | FloatArray]]
) -> tuple[int, FloatArray] | None:
    """Return the index of the cell of the foremost polygon at a pixel, and the point (3,), or None.

    ``x`` and ``y``: pixels from the lower left. ``shown``: the actors to look at, each with the
    index of the cell that each of its polygons is of.
    """
    owners = dict(shown)
    actor, polygon, point = _foremost(plotter, x, y, owners)
    return (int(owners[actor][polygon]), point) if actor in owners else None
