"""Handles of points, drawn in pixels over the scene, by which the mouse drags a section.

VTK's widgets for these sections are worse to use. Those of cylinder and cone take the mouse
wherever their surface is seen, where it should turn the camera or mark a cell, and that surface
does not follow the mouse. That of a line has only its ends, which are out of view in a detail; for
a circle in a plane there is none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
import pyvista as pv
from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QMouseEvent
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.scene.actors import draw_in_front
from slideviz.scene.axis_handle import dragged_size, frame_of, patch_in, pixel_and_slope
from slideviz.scene.pick import on_plane, to_display
from slideviz.scene.scene import Scene
from slideviz.sections.around_axis import Patch, PlaceOnSection, axis_section
from slideviz.sections.handles import HandleParts, Part, handle_parts, part_at, rounded
from slideviz.sections.line import Box
from slideviz.sections.model import Section

HANDLE_COLOR = "#2f6fb5"  # color of a handle that the mouse is not over
POINT_PX = 11.0  # diameter of a handle's point, in pixels
RIM_PX = 15.0  # and of the rim around it
REACH_PX = 10.0  # distance from a point up to which the mouse takes it, in pixels
EDGE_PX = 22.0
"""Distance that a handle's points keep from the view's edges and the legend, in pixels."""

Moved = Callable[[Section], None]
"""Called with the new section while it is dragged, at most once per turn of the event loop."""
Dragging = Callable[[bool], None]  # called with True when a drag begins and with False when it ends


Grasp = TypeVar("Grasp")
"""The state in which the mouse took a handle: a tuple whose first item is the section."""


class PointHandle(QObject, Generic[Grasp]):
    """The base of handles of points; subclasses place them and apply drags to the section.

    ``moved`` and ``dragging``: see `Moved` and `Dragging`.
    """

    def __init__(self, view: View3D, scene: Scene, moved: Moved, dragging: Dragging) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self._moved = moved
        self._dragging = dragging
        self.section: Section | None = None
        self._scheme = scene.scheme
        self._part: Part | None = None
        self._mouse = QPoint(-1, -1)
        self._start: tuple[Grasp, FloatArray] | None = None
        self._at: FloatArray | None = None
        self._overlay = Overlay(view)
        self._soon = single_shot(self, self.report)
        view.installEventFilter(self)
        # Each drawing may have another camera or size.
        watched = view.renderer
        event = "StartEvent"
        put = self.put
        tag = watched.AddObserver(event, lambda *_: put())
        self._unwatch = lambda: watched.RemoveObserver(tag)

    @property
    def dragging(self) -> bool:
        return self._start is not None

    def close(self) -> None:
        """Remove the handle from the view for good."""
        self._soon.stop()
        self._unwatch()
        self._overlay.remove()
        self.view.removeEventFilter(self)
        self.view.unsetCursor()
        self._start = self.section = None
        self.deleteLater()

    def show(self, section: Section, scheme: ColorScheme, _mesh: Mesh, _deformed: Mesh) -> None:
        """Show the handle of a section in a color scheme."""
        self.section = section
        self._scheme = scheme
        self.put()

    # Subclasses ------------------------------------------------------------------------
    def parts(self) -> list[tuple[Part, FloatArray]]:
        """Return the parts in pixels, (k, 2) each, the preferred one first; a line's are joined."""
        raise NotImplementedError

    def arrow(self) -> FloatArray | None:
        """Return the unit vector (2,) of arrows to both sides of the points; None for none."""
        return None

    def place_of(self, where: QPoint) -> FloatArray:
        """Return a position in the widget, (2,), in the coordinates of `dragged`."""
        raise NotImplementedError

    def grasp(self) -> Grasp:
        """Return the present state, kept while the mouse drags: a tuple, the section first."""
        raise NotImplementedError

    def dragged(self, grasp: Grasp, start: FloatArray, end: FloatArray) -> Section:
        """Return the section after a drag.

        ``grasp``: what `grasp` returned when the drag began. ``start`` and ``end`` (2,) float64:
        where the drag began and where the mouse is now, as `place_of` returns them.
        """
        raise NotImplementedError

    # Drawing ---------------------------------------------------------------------------
    def put(self) -> None:
        """Draw the points in the visible part of the view, with those under the mouse marked."""
        if self.section is None:
            return
        points = [(part, at) for part, at in self.parts() if part != "line"]
        held = [at for part, at in points if part == self._part]
        self._overlay.draw([at for _, at in points], held, self.arrow(), self._scheme)
        if self._part is not None and not self.dragging and self.part_at(self._mouse) is None:
            # The handle moved away from under the mouse.
            self._point_at(None)

    # Mouse -----------------------------------------------------------------------------
    def part_at(self, where: QPoint) -> Part | None:
        """Return the part of the handle at a position in the widget; None if none is in reach."""
        if self.section is None:
            return None
        reach = REACH_PX * self.view.devicePixelRatioF()
        return part_at(self.parts(), np.array(self.view.to_pixels(where)), reach)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if not isinstance(event, QMouseEvent):
            return False
        where = event.position().toPoint()
        if kind == QEvent.Type.MouseButtonPress and event.button() == Qt.MouseButton.LeftButton:
            return self._press(where)
        if kind == QEvent.Type.MouseMove:
            return self._move(where, bool(event.buttons()))
        if kind == QEvent.Type.MouseButtonRelease and self.dragging:
            return self._release(where)
        return False

    def _press(self, where: QPoint) -> bool:
        self._mouse = where
        part = self.part_at(where)
        if part is None:
            return False
        self._point_at(part)
        self._start = self.grasp(), self.place_of(where)
        self._at = None
        self._dragging(True)
        return True

    def _move(self, where: QPoint, pressed: bool) -> bool:
        self._mouse = where
        if self.dragging:
            self._at = self.place_of(where)
            self._soon.start()
            return True
        if not pressed:
            self._point_at(self.part_at(where))
        return False

    def _release(self, where: QPoint) -> bool:
        self._soon.stop()
        self._mouse = where
        if self._at is not None:
            self._at = self.place_of(where)
            self.report()
        self._start = self._at = None
        self._dragging(False)
        self.put()
        self._point_at(self.part_at(where))
        self.view.render_soon()
        return True

    def _point_at(self, part: Part | None) -> None:
        """Mark the part under the mouse, and set the cursor; None for no part."""
        if part == self._part:
            return
        self._part = part
        if part is None:
            self.view.unsetCursor()
        else:
            self.view.setCursor(Qt.CursorShape.SizeAllCursor)
        self.put()
        self.view.render_soon()

    def report(self) -> None:
        """Call ``moved`` with the section as dragged so far."""
        if self._start is not None and self._at is not None:
            self._moved(self.dragged(*self._start, self._at))


class InPlaneHandle(PointHandle[tuple[Section, Box]]):
    """The handle of a line or circle of a 2D mesh; the curve itself can be dragged, too.

    Places are in the mesh's plane, in its length unit.
    """

    _in_view: tuple[tuple[object, ...], HandleParts | None] = (), None
    """The parts in the visible part of the plane, after what they depend on."""

    def seen_box(self) -> Box:
        """Return the lower and upper corner of the part of the mesh's plane that the view shows.

        A margin at the edges, and the strip of the legend, are not part of it.
        """
        wide, high = self.view.window_size
        strip = self.scene.stage.strip()
        corners = (
            on_plane(self.view, EDGE_PX, EDGE_PX),
            on_plane(self.view, wide - strip - EDGE_PX, high - EDGE_PX),
        )
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def in_view(self) -> HandleParts | None:
        """Return the parts in the visible part of the plane, where the mouse can reach them."""
        if self.section is None:
            return None
        seen = self.seen_box()
        key = (self.section, *seen[0], *seen[1])
        if key != self._in_view[0]:
            self._in_view = key, handle_parts(self.section, seen)
        return self._in_view[1]

    def parts(self) -> list[tuple[Part, FloatArray]]:
        """Return the ends, the middle and the curve in pixels."""
        seen = self.in_view()
        if seen is None:
            return []
        lines: list[tuple[Part, FloatArray]] = [("line", line) for line in seen.lines]
        points_of: list[tuple[Part, FloatArray]] = [("end", seen.ends), ("middle", seen.middle)]
        return [(part, self._pixels(points)) for part, points in points_of + lines if len(points)]

    def _pixels(self, points: FloatArray) -> FloatArray:
        return to_display(self.view, np.column_stack([points, np.zeros(len(points))]))

    def place_of(self, where: QPoint) -> FloatArray:
        """Return the point (2,) in the mesh's plane at a position in the widget."""
        return np.array(on_plane(self.view, *self.view.to_pixels(where)))

    def grasp(self) -> tuple[Section, Box]:
        """Return the section and the visible box."""
        assert self.section is not None
        return self.section, self.seen_box()

    def dragged(self, grasp: tuple[Section, Box], start: FloatArray, end: FloatArray) -> Section:
        """Return the line or circle moved, turned, or with another radius, after a drag."""
        section, box = grasp
        assert self._part is not None
        return section.in_plane.dragged(self._part, (start, end), box)


_FRAME = "handle:frame"
_FRAME_WIDTH = 1.5  # width of the frame's lines, in pixels


class AxisHandle(PointHandle[tuple[Section, PlaceOnSection]]):
    """The handle of a section about an axis: a ball by which the mouse changes its radius or angle.

    The ball lies on the cut cells, at a visible place; a frame in space is around them. Places are
    in pixels from the lower left.
    """

    _patch: Patch | None = None
    _drawn: pv.PolyData | None = None
    _arrow: FloatArray = np.array([0.0, 1.0])
    """The direction of the arrow, found with the ball's place."""

    def show(self, section: Section, scheme: ColorScheme, mesh: Mesh, deformed: Mesh) -> None:
        """Show the handle of a section, its frame around the patch that is cut of the mesh."""
        self._patch = patch_in(section, deformed, self.scene.sections.cuts)
        self._draw_frame(frame_of(section, self._patch), scheme.text)
        super().show(section, scheme, mesh, deformed)

    def close(self) -> None:
        """Remove the handle from the view for good."""
        self.view.remove_actor(_FRAME, reset_camera=False, render=False)  # type: ignore[arg-type]
        super().close()

    def pixels_of(self, points: FloatArray) -> FloatArray:
        """Return the display coordinates (n, 2) of points (n, 3), in pixels from the lower left."""
        return to_display(self.view, points)

    @property
    def place(self) -> PlaceOnSection:
        """Return the ball's place: the patch's middle, or if that is out of view, a visible one."""
        if self._start is not None:
            return self._start[0][1]
        section = self.section
        patch = self._patch
        assert section is not None
        assert patch is not None
        places = np.concatenate([np.array([patch.middle]), patch.places])
        pixels = self.pixels_of(axis_section(section).surface(places, section.size))
        wide, high = self.view.window_size
        end = np.array([wide - self.scene.stage.strip() - EDGE_PX, high - EDGE_PX])
        within = np.all((pixels >= EDGE_PX) & (pixels <= end), axis=1)
        if within[0] or not within.any():
            return patch.middle
        off = np.linalg.norm(pixels - (EDGE_PX + end) / 2.0, axis=1)
        angle, along = places[int(np.argmin(np.where(within, off, np.inf)))].tolist()
        return angle, along

    def parts(self) -> list[tuple[Part, FloatArray]]:
        """Return the ball, as the handle's middle."""
        assert self.section is not None
        size = self.section.size
        place = self.place
        at, slope, _ = pixel_and_slope(self.pixels_of, self.section, place, size)
        self._arrow = slope / np.linalg.norm(slope)
        return [("middle", at[None])]

    def arrow(self) -> FloatArray:
        """Return the unit vector in which the ball moves if the section grows."""
        return self._arrow

    def place_of(self, where: QPoint) -> FloatArray:
        """Return a position in the widget, (2,), in pixels from the lower left."""
        return np.array(self.view.to_pixels(where))

    def grasp(self) -> tuple[Section, PlaceOnSection]:
        """Return the section and the place of the ball."""
        assert self.section is not None
        return self.section, self.place

    def dragged(
        self, grasp: tuple[Section, PlaceOnSection], start: FloatArray, end: FloatArray
    ) -> Section:
        """Return the section with the radius or angle to which the ball was dragged."""
        section, place = grasp
        size = dragged_size(self.pixels_of, section, place, start=start, now=end)
        return section.sized(rounded(size, section.size))

    def _draw_frame(self, lines: list[FloatArray], color: str) -> None:
        # A reference in Python: a data set that only VTK holds may come back without points.
        self._drawn = shape = pv.PolyData()
        # Given to the constructor, the points would become vertex cells and be drawn.
        shape.points = np.concatenate(lines)
        shape.SetLines(_cells(lines))
        actor = self.view.actors.get(_FRAME)
        if actor is None:
            actor = self.view.add_mesh(
                shape,
                name=_FRAME,
                line_width=_FRAME_WIDTH * self.view.devicePixelRatioF(),
                lighting=False,
                reset_camera=False,
                render=False,
                pickable=False,
            )
            draw_in_front(actor.mapper)
        actor.mapper.dataset = shape
        actor.prop.color = color


_CORNERS = 32  # number of corners of the polygon that is drawn as a point
_FAR_PX = 25.0
_HEAD_PX = 8.0
_SHAFT_PX = 2.5
"""Of an arrow, in pixels: distance of its tip from the middle, head length, shaft thickness."""

_NECK_PX = _FAR_PX - _HEAD_PX  # distance from the middle to where an arrow's head begins, in pixels
_ARROW = (
    np.array([(0.0, -0.5), (_NECK_PX, -0.5), (_NECK_PX, 0.5), (0.0, 0.5)]) * (1.0, _SHAFT_PX),
    np.array([(_FAR_PX, 0.0), (_NECK_PX, 0.5), (_NECK_PX, -0.5)]) * (1.0, _HEAD_PX),
)
"""Shaft and head of an arrow that points right: polygons (k, 2) in pixels from the middle."""


class Overlay:
    """Actors that draw points with rims and arrows in pixels over the scene: rims, points, held."""

    def __init__(self, view: View3D) -> None:
        self.view = view
        self._layers: dict[str, tuple[pv.PolyData, vtkActor2D]] = {}
        for layer, name in enumerate(("handle:rim", "handle:points", "handle:held")):
            shape = pv.PolyData()
            mapper = vtkPolyDataMapper2D()
            actor = vtkActor2D()
            mapper.SetInputData(shape)
            actor.SetMapper(mapper)
            actor.SetLayerNumber(layer)
            view.add_actor(actor, name=name, reset_camera=False, render=False, pickable=False)  # type: ignore[arg-type]
            self._layers[name] = shape, actor
        self._placed: tuple[object, ...] = ()

    def remove(self) -> None:
        """Remove the actors from the view."""
        for name in self._layers:
            self.view.remove_actor(name, reset_camera=False, render=False)  # type: ignore[arg-type]

    def draw(
        self,
        points: list[FloatArray],
        held: list[FloatArray],
        arrow: FloatArray | None,
        scheme: ColorScheme,
    ) -> None:
        """Draw points at pixels (k, 2), those of ``held`` marked, with arrows along ``arrow``."""
        ratio = self.view.devicePixelRatioF()
        key = [np.round(at, 2).tolist() for at in points], [np.round(at, 2).tolist() for at in held]
        direction = None if arrow is None else arrow.round(4).tolist()
        placed = (*key, direction, ratio, scheme)
        if placed == self._placed:
            return
        self._placed = placed
        rim = [_disc(RIM_PX / 2.0)]
        if arrow is not None:
            turn = np.stack([arrow, (-arrow[1], arrow[0])])
            rim += [sign * part @ turn for sign in (1.0, -1.0) for part in _ARROW]
        dot = [_disc(POINT_PX / 2.0)]
        drawn = (
            (rim, points, scheme.text),
            (dot, points, HANDLE_COLOR),
            (dot, held, SELECTED_COLOR),
        )
        for (shape, actor), (polygons, at, color) in zip(self._layers.values(), drawn, strict=True):
            every = [point + ratio * part for row in at for point in row for part in polygons]
            actor.SetVisibility(bool(every))
            actor.GetProperty().SetColor(*pv.Color(color).float_rgb)
            if every:
                flat = np.concatenate(every)
                shape.points = np.column_stack([flat, np.zeros(len(flat))])
                shape.SetPolys(_cells(every))
                shape.Modified()


def _disc(radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _cells(parts: list[FloatArray]) -> pv.CellArray:
    """Return cells for points in a row, one per part: as many points as the part is long."""
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    return pv.CellArray.from_arrays(offsets, np.arange(offsets[-1]))
