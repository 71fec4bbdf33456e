"""A half-transparent plate below letters that may lie over a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import Look
from slideviz.mesh.model import FloatArray

OPACITY = 0.82
"""How much of a mesh a plate covers."""

Rect = tuple[float, float, float, float]
"""Left, bottom, right and top, in pixels from the lower left corner of the view."""


class Plate:
    """A rectangle in the colours of the background: seen only where something is behind it.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
    name : str
        Of the actor. What is drawn after it lies above it.
    look : Look
    """

    def __init__(self, plotter: Any, name: str, look: Look) -> None:
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

        self.plotter = plotter
        self._look = look
        self._shape = pv.PolyData(np.zeros((4, 3)), faces=[4, 0, 1, 2, 3])
        mapper, actor = vtkPolyDataMapper2D(), vtkActor2D()
        mapper.SetInputData(self._shape)
        mapper.SetScalarModeToUsePointData()
        actor.SetMapper(mapper)
        actor.SetPickable(False)
        # Kept here: what only VTK holds may come back without its Python part.
        self.actor = actor
        plotter.add_actor(actor, name=name, reset_camera=False, render=False, pickable=False)

    def place(self, rect: Rect) -> None:
        """Cover a rectangle of the view as it is now."""
        left, bottom, right, top = rect
        high = max(self.plotter.window_size[1], 1)
        corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
        self._shape.points = np.array([(*corner, 0.0) for corner in corners])
        colours = [self.colour_at(y / high) for _, y in corners]
        self._shape.point_data["colour"] = np.array(colours, np.uint8)
        self._shape.set_active_scalars("colour", preference="point")

    def colour_at(self, height: float) -> tuple[int, ...]:
        """Return red, green, blue and opacity at a part of the view's height."""
        below, above = (
            np.array(pv.Color(name).int_rgb, float)
            for name in (self._look.background, self._look.background_top)
        )
        mixed: FloatArray = below + np.clip(height, 0.0, 1.0) * (above - below)
        return (*(int(part) for part in mixed.round()), round(255 * OPACITY))
