"""A ball between two arrows, and a frame: what shows where a section can be pulled."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

from slideviz.color_scheme import SELECTED_COLOUR, Look
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.handle import HANDLE_COLOUR
from slideviz.gui.viewport.pulled import POINT_PX, RIM_PX
from slideviz.mesh.model import FloatArray
from slideviz.scene.marked_cell import IN_FRONT

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


class PullMark:
    """Draws into a view, in front of all else and of one size wherever the camera is.

    Parameters
    ----------
    view : View3D
    """

    def __init__(self, view: View3D) -> None:
        self.view = view
        self._shapes = {name: pv.PolyData() for name in (RIM, BALL)}
        self._actors = {name: _overlay(shape) for name, shape in self._shapes.items()}
        for name, actor in self._actors.items():
            view.add_actor(actor, name=name, reset_camera=False, render=False, pickable=False)
        # The ball is drawn after what sets it off.
        self._actors[BALL].SetLayerNumber(1)
        self._placed: tuple[float, ...] = ()
        self._text = "black"

    def remove(self) -> None:
        """Leave the view."""
        for name in (FRAME, RIM, BALL):
            self.view.remove_actor(name, reset_camera=False, render=False)

    def colour(self, look: Look, held: bool) -> None:
        """Take the colours of a look, and that of what the mouse holds."""
        self._text = look.text
        self._actors[RIM].GetProperty().SetColor(*pv.Color(look.text).float_rgb)
        self.highlight(held)

    def highlight(self, held: bool) -> None:
        """Show whether the mouse would take the ball, or has taken it."""
        name = SELECTED_COLOUR if held else HANDLE_COLOUR
        self._actors[BALL].GetProperty().SetColor(*pv.Color(name).float_rgb)

    def draw_frame(self, lines: list[FloatArray]) -> None:
        """Draw the frame, lines (k, 3) each."""
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
