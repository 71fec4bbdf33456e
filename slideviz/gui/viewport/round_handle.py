"""The handle of a section about an axis: a frame around the cut, and a ball to change its size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv
from qtpy.QtCore import QPoint
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.mouse_handle import (
    EDGE_PX,
    HANDLE_COLOR,
    POINT_PX,
    REACH_PX,
    RIM_PX,
    MouseHandle,
)
from slideviz.mesh.model import FloatArray
from slideviz.scene.axis_handle import dragged_size, frame_of, pixel_and_slope
from slideviz.scene.marked_cell import IN_FRONT
from slideviz.scene.pick import to_display
from slideviz.sections.around_axis import Patch, PlaceOnSection, axis_shape
from slideviz.sections.handles import rounded
from slideviz.sections.model import Section


class RoundHandle(MouseHandle[tuple[Section, PlaceOnSection]]):
    """The handle of a section about an axis: a ball by which the mouse changes its radius or angle.

    The ball lies on the cut cells, at a visible place, and is drawn in front of everything.

    Parameters
    ----------
    view, *others
        As for `slideviz.gui.viewport.mouse_handle.MouseHandle`.
    """

    def __init__(self, view: View3D, *others: Callable[..., Any]) -> None:
        super().__init__(view, *others)
        self._patch: Patch | None = None
        self.place: PlaceOnSection | None = None
        self._drawn = HandleActors(view)

    def watched(self) -> tuple[vtkObject, str]:
        """Return the renderer and its event: each drawing may have another camera or size."""
        return self.view.renderer, "StartEvent"

    def show(self, section: Section, patch: Patch, scheme: ColorScheme) -> None:
        """Show the handle of a section, its frame around the patch that is cut of the mesh."""
        self.section, self._patch = section, patch
        self._drawn.color(scheme, self._part is not None)
        self._drawn.draw_frame(frame_of(section, patch))
        self.put()

    def close(self) -> None:
        """Remove the handle from the view for good."""
        self._patch = None
        self._drawn.remove()
        super().close()

    def pixels_of(self, points: FloatArray) -> FloatArray:
        """Return the display coordinates (n, 2) of points (n, 3), in pixels from the lower left."""
        return to_display(self.view, points)

    def put(self) -> None:
        """Draw the ball at a visible place, with arrows in the directions of a drag."""
        if self.section is None or self._patch is None:
            return
        self.place = self._start[0][1] if self._start is not None else self._in_reach(self._patch)
        at, way, _ = pixel_and_slope(self.pixels_of, self.section, self.place, self.section.size)
        self._drawn.draw_ball(at, way / np.linalg.norm(way))
        self._drawn.highlight(self._part is not None)
        if self._part is not None and not self.dragging and self.part_at(self._mouse) is None:
            # The ball moved away from under the mouse.
            self._point_at(None)

    def _in_reach(self, patch: Patch) -> PlaceOnSection:
        """Return the ball's place: the patch's middle, or if that is out of view, a visible one."""
        assert self.section is not None
        places = np.concatenate([np.array([patch.middle]), patch.places])
        pixels = self.pixels_of(
            axis_shape(self.section).surface(self.section, places, self.section.size)
        )
        wide, high = self.view.window_size
        end = np.array([wide - self._strip() - EDGE_PX, high - EDGE_PX])
        within = np.all((pixels >= EDGE_PX) & (pixels <= end), axis=1)
        if within[0] or not within.any():
            return patch.middle
        off = np.linalg.norm(pixels - (EDGE_PX + end) / 2.0, axis=1)
        angle, along = places[int(np.argmin(np.where(within, off, np.inf)))].tolist()
        return angle, along

    # Mouse -----------------------------------------------------------------------------

    def place_of(self, where: QPoint) -> FloatArray:
        """Return a position in the widget, (2,), in pixels from the lower left."""
        return np.array(self.view.to_pixels(where))

    def part_at(self, where: QPoint) -> str | None:
        """Return ``"ball"`` if it is in reach of a position in the widget, else None."""
        if self.section is None or self.place is None:
            return None
        at, *_ = pixel_and_slope(self.pixels_of, self.section, self.place, self.section.size)
        reach = REACH_PX * self.view.devicePixelRatioF()
        return "ball" if np.linalg.norm(at - self.place_of(where)) <= reach else None

    def grasp(self) -> tuple[Section, PlaceOnSection]:
        """Return the section and the place of the ball, as they are when a drag begins."""
        assert self.section is not None
        assert self.place is not None
        return self.section, self.place

    def dragged(
        self, grasp: tuple[Section, PlaceOnSection], start: FloatArray, end: FloatArray
    ) -> Section:
        """Return the section with the radius or angle to which the ball was dragged."""
        section, place = grasp
        size = dragged_size(self.pixels_of, section, place, start=start, now=end)
        return section.sized(rounded(size, section.size))


FRAME, RIM, BALL = "handle:frame", "handle:rim", "handle:ball"
"""Names of the actors."""

_WIDTH = 1.5
"""Width of the frame's lines, in pixels."""

_CORNERS = 32
"""Number of corners of the polygon that is drawn as the ball."""

_FAR_PX, _HEAD_PX, _SHAFT_PX = 25.0, 8.0, 2.5
"""Of an arrow, in pixels: distance of its tip from the middle, head length, shaft thickness."""

_NECK_PX = _FAR_PX - _HEAD_PX
"""Distance from the middle to where an arrow's head begins, in pixels."""

_ARROW = (
    np.array([(0.0, -0.5), (_NECK_PX, -0.5), (_NECK_PX, 0.5), (0.0, 0.5)]) * (1.0, _SHAFT_PX),
    np.array([(_FAR_PX, 0.0), (_NECK_PX, 0.5), (_NECK_PX, -0.5)]) * (1.0, _HEAD_PX),
)
"""Shaft and head of an arrow that points right: polygons (k, 2) in pixels from the middle."""


class HandleActors:
    """The actors of a round handle: the frame in space, ball and arrows in pixels over everything.

    Parameters
    ----------
    view : View3D
    """

    def __init__(self, view: View3D) -> None:
        self.view = view
        self._shapes = {name: pv.PolyData() for name in (RIM, BALL)}
        self._actors = {name: _overlay(shape) for name, shape in self._shapes.items()}
        for name, actor in self._actors.items():
            view.add_actor(actor, name=name, reset_camera=False, render=False, pickable=False)  # type: ignore[arg-type]
        # The ball is drawn after its rim.
        self._actors[BALL].SetLayerNumber(1)
        self._placed: tuple[float, ...] = ()
        self._text = "black"

    def remove(self) -> None:
        """Remove the actors from the view."""
        for name in (FRAME, RIM, BALL):
            self.view.remove_actor(name, reset_camera=False, render=False)  # type: ignore[arg-type]

    def color(self, scheme: ColorScheme, held: bool) -> None:
        """Set the colors from a color scheme; ``held``: the mouse is over the ball or drags it."""
        self._text = scheme.text
        self._actors[RIM].GetProperty().SetColor(*pv.Color(scheme.text).float_rgb)
        self.highlight(held)

    def highlight(self, held: bool) -> None:
        """Color the ball as selected if the mouse is over it or drags it."""
        name = SELECTED_COLOR if held else HANDLE_COLOR
        self._actors[BALL].GetProperty().SetColor(*pv.Color(name).float_rgb)

    def draw_frame(self, lines: list[FloatArray]) -> None:
        """Draw the frame: polylines of points (k, 3)."""
        shape = pv.PolyData()
        # Given to the constructor, the points would become vertex cells and be drawn.
        shape.points = np.concatenate(lines)
        shape.SetLines(_cells(lines))
        actor = self.view.actors.get(FRAME)
        if actor is None:
            actor = self.view.add_mesh(
                shape,
                name=FRAME,
                line_width=_WIDTH * self.view.devicePixelRatioF(),
                lighting=False,
                reset_camera=False,
                render=False,
                pickable=False,
            )
            mapper = actor.mapper
            mapper.SetResolveCoincidentTopologyToPolygonOffset()
            mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, IN_FRONT)
        # A reference in Python: a data set that only VTK holds may come back without points.
        self._frame = actor.mapper.dataset = shape
        actor.prop.color = self._text

    def draw_ball(self, at: FloatArray, way: FloatArray) -> None:
        """Draw the ball at pixel ``at`` (2,), and arrows along and against unit vector ``way``."""
        ratio = self.view.devicePixelRatioF()
        key = (*at.round(2).tolist(), *way.round(4).tolist(), ratio)
        if key == self._placed:
            return
        self._placed = key
        across = np.array([-way[1], way[0]])
        parts = [_disc(RIM_PX / 2.0)]
        for sign in (1.0, -1.0):
            parts += [sign * part @ np.stack([way, across]) for part in _ARROW]
        _fill(self._shapes[RIM], [at + ratio * part for part in parts])
        _fill(self._shapes[BALL], [at + ratio * _disc(POINT_PX / 2.0)])


def _disc(radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _fill(shape: pv.PolyData, polygons: list[FloatArray]) -> None:
    """Replace the cells of a data set by convex polygons (k, 2), in pixels."""
    points = np.concatenate(polygons)
    shape.points = np.column_stack([points, np.zeros(len(points))])
    shape.SetPolys(_cells(polygons))
    shape.Modified()


def _cells(parts: list[FloatArray]) -> pv.CellArray:
    """Return cells for points in a row, one per part: as many points as the part is long."""
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    return pv.CellArray.from_arrays(offsets, np.arange(offsets[-1]))


def _overlay(shape: pv.PolyData) -> vtkActor2D:
    """Return an actor that draws a data set given in pixels of the view, over the 3D scene."""
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(shape)
    actor = vtkActor2D()
    actor.SetMapper(mapper)
    return actor
