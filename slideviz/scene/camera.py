"""The camera of a scene: look from a side, fit, zoom; parallel or perspective projection."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.scene.pick import to_display
from slideviz.scene.stage import Stage
from slideviz.terms import Numbers

FILL = 0.92  # part of the free height or width that a fitted mesh takes
DETAIL = 0.5
"""Height of the view, relative to that which shows everything, below which it shows a detail."""

SLACK = 0.25
"""How far a bounding box may be outside the view, relative to its size, to count as seen."""

SAME = 1e-3
"""Difference of two views, relative to their height, below which they are the same."""

SIDES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "+x": ((1, 0, 0), (0, 0, 1)),
    "-x": ((-1, 0, 0), (0, 0, 1)),
    "+y": ((0, 1, 0), (0, 0, 1)),
    "-y": ((0, -1, 0), (0, 0, 1)),
    "+z": ((0, 0, 1), (0, 1, 0)),
    "-z": ((0, 0, -1), (0, 1, 0)),
    "iso": ((1, -1, 0.8), (0, 0, 1)),
}
"""For each side: the direction from the mesh to the camera, and the up vector."""


class Camera:
    """Places the VTK camera of a stage: fits, aims, zooms, and says what it sees.

    ``shapes``: returns the data sets that a fitted camera shows.
    """

    def __init__(self, stage: Stage, shapes: Callable[[], list[Any]]) -> None:
        self.stage = stage
        self._shapes = shapes
        self._fitted: Numbers = ()
        self._restored: tuple[Numbers, Numbers] = ((), ())
        self.beside: Camera | None = None
        """The linked camera of the view beside this one, in the same position; both are fitted to
        the data sets of both."""

    @property
    def _camera(self) -> Any:
        return self.stage.plotter.camera

    def look_from(self, side: str, parallel: bool) -> None:
        """Show all that is drawn from a side, a key of `SIDES`."""
        towards, up = SIDES[side]
        self.turn(np.asarray(towards, float), np.asarray(up, float), parallel)
        self.fit()

    def turn(self, towards: FloatArray, up: FloatArray, parallel: bool) -> None:
        """Turn the camera to a direction (3,), from the mesh to it, with an up vector (3,).

        It looks at the middle of everything drawn; `fit` sets distance and scale.
        """
        bounds = np.array(self.stage.plotter.bounds).reshape(3, 2)
        centre = bounds.mean(axis=1)
        camera = self._camera
        camera.focal_point = centre
        away = max(np.ptp(bounds, axis=1).max(), 1e-300)
        camera.position = centre + towards * away
        camera.up = up
        camera.parallel_projection = parallel

    def fit(self, clouds: Iterable[FloatArray] = ()) -> None:
        """Fit everything drawn to the view beside the legend's strip; the direction stays.

        ``clouds`` are further arrays of points (n, 3) to be seen, such as those of other steps.
        """
        self.shift()
        extent = self._extent(clouds)
        if extent is None:
            return
        centre, half, depth = extent
        self.aim(centre, half, depth)
        self._fitted = self.place

    def fit_part(self, clouds: Sequence[FloatArray]) -> None:
        """Fit the given points, arrays (n, 3), to the view; the direction stays."""
        self.shift()
        extent = self._extent()
        if extent is None or not clouds:
            return
        centre, half, _ = self._around(clouds)
        self.aim(centre, max(half, 1e-9 * extent[1]), 2.0 * extent[2])

    def _extent(self, clouds: Iterable[FloatArray] = ()) -> tuple[Any, float, float] | None:
        """Return centre (3,), half view height and diagonal of all that is drawn; None if nothing.

        ``clouds`` are further arrays of points (n, 3).
        """
        shapes = [shape for camera in self._cameras() for shape in camera._shapes()]
        if not shapes:
            return None
        return self._around(chain((np.asarray(shape.points) for shape in shapes), clouds))

    def _cameras(self) -> list[Camera]:
        return [self] if self.beside is None else [self, self.beside]

    def _around(self, clouds: Iterable[FloatArray]) -> tuple[Any, float, float]:
        """Return centre (3,), half the view height that shows them, and diagonal of points (n, 3).

        The box around the points is along the camera's axes.
        """
        axes = self._axes()
        # Not concatenated: for large meshes a copy would take most of the time.
        along = (axes @ points.T for points in clouds)
        ends = np.array([(one.min(axis=1), one.max(axis=1)) for one in along])
        low = ends[:, 0].min(axis=0)
        high = ends[:, 1].max(axis=0)
        extent = high - low
        half = max(camera._half(extent) for camera in self._cameras())
        return axes.T @ ((low + high) / 2.0), half, float(np.linalg.norm(extent))

    def _half(self, extent: Any, ratio: float = 0.0) -> float:
        """Return half the view height, in mesh units, that shows an extent (3,) along the axes.

        ``ratio``: the view's free width divided by its height; 0: that of this view.
        """
        ratio = ratio or self._ratio(self.stage)
        return float(max(extent[1], extent[0] / ratio, 1e-300) / 2.0 / FILL)

    def is_fit(self, view: Numbers) -> bool:
        """Return whether a `view`, in which the camera is, was fitted to what is drawn."""
        shapes = self._shapes()
        if len(view) < 11 or not shapes:
            return False
        along = np.concatenate([np.asarray(shape.points) @ self._axes().T for shape in shapes])
        low = along.min(axis=0)
        high = along.max(axis=0)
        half = self._half(high - low, view[10])
        off = (self._axes() @ np.array(view[3:6]) - (low + high) / 2.0)[:2]
        return bool(abs(view[9] - half) < SAME * half and np.abs(off).max() < SAME * half)

    def sees_detail(self) -> bool:
        """Return whether the view is zoomed in: its height is below `DETAIL` of the fitted one."""
        extent = self._extent()
        return extent is not None and self._camera.parallel_scale < DETAIL * extent[1]

    @property
    def fitted(self) -> bool:
        """Return whether the camera has not moved since `fit`."""
        return self._fitted == self.place

    @property
    def restored(self) -> Numbers:
        """Return the `view` that `go` restored last, if the camera has not moved since; or ()."""
        view, place = self._restored
        return view if place == self.place else ()

    def aim(self, centre: Any, half: float, depth: float = 0.0) -> None:
        """Move the camera to look at a point (3,) with half a height of view; the direction stays.

        ``depth``: extent along the line of sight of what should be seen; the camera stays outside.
        """
        camera = self._camera
        direction = self._axes()[2]
        away = max(depth, half)
        if not camera.parallel_projection:
            away = half / np.tan(np.radians(camera.view_angle / 2.0)) + depth / 2.0
        camera.focal_point = centre
        camera.position = centre - direction * away
        camera.parallel_scale = half
        self.stage.plotter.renderer.ResetCameraClippingRange()

    def _axes(self) -> Any:
        """Return the camera's right, up and forward unit vectors as rows (3, 3)."""
        camera = self._camera
        right = np.cross(camera.direction, np.array(camera.up))
        up = np.cross(right, camera.direction)
        return np.array([right / np.linalg.norm(right), up / np.linalg.norm(up), camera.direction])

    def shift(self) -> None:
        """Shift the picture to the left of the legend's strip; the focal point stays."""
        width = self.stage.plotter.window_size[0]
        self._camera.SetWindowCenter(self.stage.strip() / max(width, 1), 0.0)

    def zoom_at(self, x: float, y: float, factor: float) -> None:
        """Zoom by ``factor``; in parallel projection, pixel (x, y) keeps showing the same point.

        Pixels are counted from the lower left corner.
        """
        camera = self._camera
        renderer = self.stage.plotter.renderer
        if not camera.parallel_projection:
            camera.Dolly(factor)
            renderer.ResetCameraClippingRange()
            return
        width, height = self.stage.plotter.window_size
        right = np.cross(camera.direction, camera.up)
        middle = width / 2.0 * (1.0 - camera.GetWindowCenter()[0])
        # Pixels from the camera's centre, in the world's length unit at the present scale.
        unit = 2.0 * camera.parallel_scale / height
        offset = ((x - middle) * right + (y - height / 2) * np.asarray(camera.up)) * unit
        shift = offset * (1.0 - 1.0 / factor)
        camera.focal_point = np.asarray(camera.focal_point) + shift
        camera.position = np.asarray(camera.position) + shift
        camera.parallel_scale = camera.parallel_scale / factor
        renderer.ResetCameraClippingRange()

    def copy_from(self, other: Camera) -> None:
        """Copy another camera's position and projection, but not its shift beside a legend."""
        camera = self._camera
        theirs = other._camera
        camera.position = theirs.position
        camera.focal_point = theirs.focal_point
        camera.up = theirs.up
        camera.view_angle = theirs.view_angle
        camera.parallel_projection = theirs.parallel_projection
        camera.parallel_scale = theirs.parallel_scale
        self.shift()
        self.stage.plotter.renderer.ResetCameraClippingRange()

    def show_width_of(self, other: Camera) -> None:
        """Zoom out so that a relatively narrower view shows the width that another camera shows."""
        free = [self._ratio(stage) for stage in (self.stage, other.stage)]
        if self._camera.parallel_projection and free[0] < free[1]:
            self._camera.parallel_scale *= free[1] / free[0]

    @staticmethod
    def _ratio(stage: Stage) -> float:
        """Return a view's width, without the legend's strip, divided by its height."""
        width, height = stage.plotter.window_size
        return float(max(width - stage.strip(), 1.0) / max(height, 1))

    def sees_all(self, slack: float = SLACK) -> bool:
        """Return whether the bounding boxes of all data sets are within the view.

        They may be outside by ``slack``, relative to the view's size.
        """
        seen = np.concatenate([*self._boxes(), np.empty((0, 2))])
        size = np.array(self.stage.plotter.window_size)
        return bool((seen >= -slack * size).all() and (seen <= (1 + slack) * size).all())

    def loses_all(self) -> bool:
        """Return whether the bounding boxes of all data sets are outside the view."""
        size = np.array(self.stage.plotter.window_size)
        boxes = self._boxes()
        outside = ((box.max(axis=0) < 0).any() or (box.min(axis=0) > size).any() for box in boxes)
        return bool(boxes) and all(outside)

    def _boxes(self) -> list[FloatArray]:
        """Return the corners (8, 2) of each data set's bounding box, in pixels."""
        boxes = (np.array(shape.bounds).reshape(3, 2) for shape in self._shapes())
        corners = (np.stack(np.meshgrid(*box), -1).reshape(-1, 3) for box in boxes)
        return [to_display(self.stage.plotter, one) for one in corners]

    def loses_some(self, clouds: Iterable[FloatArray] = ()) -> bool:
        """Return whether a point of a data set is outside the view, or behind the legend.

        ``clouds`` are further arrays of points (n, 3).
        """
        width, height = self.stage.plotter.window_size
        free = np.array([width - self.stage.strip(), height])
        for points in chain((np.asarray(shape.points) for shape in self._shapes()), clouds):
            seen = to_display(self.stage.plotter, points)
            if (seen < 0).any() or (seen > free).any():
                return True
        return False

    def looks_like(self, other: Camera) -> bool:
        """Return whether another camera has the same position and projection."""
        camera = self._camera
        theirs = other._camera
        return (
            self.place == other.place
            and camera.parallel_projection == theirs.parallel_projection
            and camera.view_angle == theirs.view_angle
        )

    @property
    def place(self) -> Numbers:
        """Return ten numbers: position, focal point, up vector, and parallel scale.

        The scale is half the height of the view, in the mesh's length unit.
        """
        camera = self._camera
        numbers = (*camera.position, *camera.focal_point, *camera.up, camera.parallel_scale)
        return tuple(float(number) for number in numbers)

    @property
    def view(self) -> Numbers:
        """Return the ten numbers of `place`, and the view's free width divided by its height."""
        return (*self.place, self._ratio(self.stage))

    def move_to(self, place: Numbers) -> None:
        """Restore a `place` or a `view`; of a `view` all the width is seen, if need be smaller."""
        camera = self._camera
        camera.position = place[:3]
        camera.focal_point = place[3:6]
        camera.up = place[6:9]
        camera.parallel_scale = place[9]
        wider = max(place[10] / self._ratio(self.stage), 1.0) if len(place) > 10 else 1.0
        camera.parallel_scale *= wider
        if not camera.parallel_projection:
            camera.Dolly(1.0 / wider)
        self.shift()
        self._restored = (place, self.place) if len(place) > 10 else ((), ())
        self.stage.plotter.renderer.ResetCameraClippingRange()
