"""The handle of a section about an axis: a frame around the cut, and a ball to change its size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv
from qtpy.QtCore import QPoint
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

from slideviz.color_scheme import SELECTED_COLOUR, ColorScheme
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.mouse_handle import (
    EDGE_PX,
    HANDLE_COLOUR,
    POINT_PX,
    REACH_PX,
    RIM_PX,
    MouseHandle,
)
from slideviz.mesh.model import FloatArray
from slideviz.scene.axis_handle import drag, dragged_size, frame_of
from slideviz.scene.marked_cell import IN_FRONT
from slideviz.scene.pick import to_display
from slideviz.sections.around_axis import Patch, PlaceOnSection, axis_shape
from slideviz.sections.handles import rounded
from slideviz.sections.model import Section


class RoundHandle(MouseHandle[tuple[Section, PlaceOnSection]]):
    """A ball on a section about an axis, by which the mouse changes the size of the section.

    It lies on what is cut of the mesh, where that is seen, and in front of everything.

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
        """Return the renderer: before each drawing the camera or the view's size may differ."""
        return self.view.renderer, "StartEvent"

    def show(self, section: Section, patch: Patch, scheme: ColorScheme) -> None:
        """Show the handle of a section, around a part of it."""
        self.section, self._patch = section, patch
        self._drawn.colour(scheme, self._part is not None)
        self._drawn.draw_frame(frame_of(section, patch))
        self.put()

    def close(self) -> None:
        """Remove the handle from the view for good."""
        self._patch = None
        self._drawn.remove()
        super().close()

    def seen(self, points: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) of points (n, 3), from the lower left of the view."""
        return to_display(self.view, points)

    def put(self) -> None:
        """Put the ball where it is in reach, with arrows to where it can be dragged."""
        if self.section is None or self._patch is None:
            return
        self.place = self._start[0][1] if self._start is not None else self._in_reach(self._patch)
        at, way, _ = drag(self.seen, self.section, self.place, self.section.size)
        self._drawn.draw_ball(at, way / np.linalg.norm(way))
        self._drawn.highlight(self._part is not None)
        if self._part is not None and not self.dragging and self.part_at(self._mouse) is None:
            # It went from below the mouse, which stayed.
            self._point_at(None)

    def _in_reach(self, patch: Patch) -> PlaceOnSection:
        """Return where the ball lies: in the middle, or beside it in a detail of the view."""
        assert self.section is not None
        places = np.concatenate([np.array([patch.middle]), patch.places])
        pixels = self.seen(
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
        """Return a position of the widget in pixels from the lower left, (2,)."""
        return np.array(self.view.to_pixels(where))

    def part_at(self, where: QPoint) -> str | None:
        """Return ``ball`` where the mouse would take it at a position of the widget, or None."""
        if self.section is None or self.place is None:
            return None
        at, *_ = drag(self.seen, self.section, self.place, self.section.size)
        reach = REACH_PX * self.view.devicePixelRatioF()
        return "ball" if np.linalg.norm(at - self.place_of(where)) <= reach else None

    def grasp(self) -> tuple[Section, PlaceOnSection]:
        """Return the section, and the place of the ball."""
        assert self.section is not None
        assert self.place is not None
        return self.section, self.place

    def pulled(
        self, grasp: tuple[Section, PlaceOnSection], start: FloatArray, end: FloatArray
    ) -> Section:
        """Return the section with another size."""
        section, place = grasp
        size = dragged_size(self.seen, section, place, start=start, now=end)
        return section.sized(rounded(size, section.size))


FRAME, RIM, BALL = "handle:frame", "handle:rim", "handle:ball"
_WIDTH = 1.5
_CORNERS = 32
"""Of the ball."""
_FAR_PX, _HEAD_PX, _SHAFT_PX = 25.0, 8.0, 2.5
"""How far the arrows reach from the middle, length of a head, thickness of the shaft."""
_NECK_PX = _FAR_PX - _HEAD_PX
_ARROW = (
    np.array([(0.0, -0.5), (_NECK_PX, -0.5), (_NECK_PX, 0.5), (0.0, 0.5)]) * (1.0, _SHAFT_PX),
    np.array([(_FAR_PX, 0.0), (_NECK_PX, 0.5), (_NECK_PX, -0.5)]) * (1.0, _HEAD_PX),
)
"""Shaft and head of one that points to the right."""


class HandleActors:
    """The actors of the handle: in front of all else, of one size wherever the camera is.

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
        # The ball is drawn after what sets it off.
        self._actors[BALL].SetLayerNumber(1)
        self._placed: tuple[float, ...] = ()
        self._text = "black"

    def remove(self) -> None:
        """Remove the actors from the view."""
        for name in (FRAME, RIM, BALL):
            self.view.remove_actor(name, reset_camera=False, render=False)  # type: ignore[arg-type]

    def colour(self, scheme: ColorScheme, held: bool) -> None:
        """Set the colours of a color scheme, and that of a held ball."""
        self._text = scheme.text
        self._actors[RIM].GetProperty().SetColor(*pv.Color(scheme.text).float_rgb)
        self.highlight(held)

    def highlight(self, held: bool) -> None:
        """Show whether the mouse would take the ball, or has taken it."""
        name = SELECTED_COLOUR if held else HANDLE_COLOUR
        self._actors[BALL].GetProperty().SetColor(*pv.Color(name).float_rgb)

    def draw_frame(self, lines: list[FloatArray]) -> None:
        """Draw the frame: lines of points (k, 3) each."""
        shape = pv.PolyData()
        # Given at once, points would be drawn as such.
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
        # Kept here: a data set that only VTK holds may come back from a mapper without points.
        self._frame = actor.mapper.dataset = shape
        actor.prop.color = self._text

    def draw_ball(self, at: FloatArray, way: FloatArray) -> None:
        """Draw the ball at a pixel (2,), and arrows along and against a unit vector (2,)."""
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
    """Put convex polygons (k, 2) into a data set, in pixels."""
    points = np.concatenate(polygons)
    shape.points = np.column_stack([points, np.zeros(len(points))])
    shape.SetPolys(_cells(polygons))
    shape.Modified()


def _cells(parts: list[FloatArray]) -> pv.CellArray:
    """Return a cell for each of so many rows of points, one after the other."""
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    return pv.CellArray.from_arrays(offsets, np.arange(offsets[-1]))


def _overlay(shape: pv.PolyData) -> vtkActor2D:
    """Return what draws a data set in pixels of the view, above all that is in space."""
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(shape)
    actor = vtkActor2D()
    actor.SetMapper(mapper)
    return actor
