"""The handle of a plane section in the 3D view: drag the plane, or its normal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from vtkmodules.vtkInteractionWidgets import (
    vtkImplicitPlaneRepresentation,
    vtkImplicitPlaneWidget2,
)

from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.mouse_handle import HANDLE_COLOR
from slideviz.sections.model import Section, Triple

HANDLE_PX = 11.0
"""Size of the ball and of the arrow's tips, in pixels."""


Bounds = tuple[float, float, float, float, float, float]


class PlaneHandle:
    """The handle of a plane section: VTK's plane widget, with frame, normal arrow and ball.

    Parameters
    ----------
    view : View3D
    moved : callable
        Called with origin and normal while they are dragged, at most once per turn of the event
        loop.
    dragging : callable
        Called with True when a drag begins and with False when it ends.
    """

    def __init__(
        self,
        view: View3D,
        moved: Callable[[Triple, Triple], None],
        dragging: Callable[[bool], None] = lambda _dragging: None,
    ) -> None:
        self.view = view
        self._moved, self._dragging = moved, dragging
        self.shape = vtkImplicitPlaneRepresentation()
        self.shape.SetPlaceFactor(1.0)
        self.shape.OutlineTranslationOff()
        self.shape.ScaleEnabledOff()
        self.shape.OutsideBoundsOff()
        self.shape.SetDrawOutline(False)
        self.shape.SetHandleSize(HANDLE_PX)
        self.widget = vtkImplicitPlaneWidget2()
        self.widget.SetRepresentation(self.shape)
        self.widget.SetInteractor(view.iren.interactor)
        self._bounds: Bounds | None = None
        self.dragging = False
        self._soon = later(None, self.report)
        for event, call in (
            ("StartInteractionEvent", lambda *_: self._grab(True)),
            ("InteractionEvent", lambda *_: self._soon.start()),
            ("EndInteractionEvent", lambda *_: self._grab(False)),
        ):
            self.widget.AddObserver(event, call)  # type: ignore[arg-type]  # a name is taken, too

    def show(self, section: Section, bounds: Bounds, scheme: ColorScheme) -> None:
        """Show the handle of a section, its frame in a box; during a drag the plane stays."""
        self._color(scheme)
        if bounds != self._bounds:
            self._bounds = bounds
            self.shape.PlaceWidget(list(bounds))
        if not self.dragging:
            self.shape.SetOrigin(*section.origin)
            self.shape.SetNormal(*section.basis[2])
        if not self.widget.GetEnabled():
            self.widget.On()

    def close(self) -> None:
        """Remove the handle from the view for good."""
        self._soon.stop()
        self.dragging = False
        self.widget.Off()
        self.widget.RemoveAllObservers()
        self.widget.SetInteractor(None)  # type: ignore[arg-type]  # None is taken, too

    def report(self) -> None:
        """Call ``moved`` with origin and normal of the dragged plane."""
        origin, normal = np.array(self.shape.GetOrigin()), np.array(self.shape.GetNormal())
        # Nobody aims at more decimals, and they would fill the fields of the normal.
        normal = normal.round(4) + 0.0
        self._moved(tuple(origin.tolist()), tuple(normal.tolist()))

    def _grab(self, dragging: bool) -> None:
        self.dragging = dragging
        if (
            dragging
            and self.shape.GetInteractionState() == vtkImplicitPlaneRepresentation.MovingOrigin
        ):
            # VTK drags the ball within the plane, which changes nothing visible: push instead.
            self.shape.SetInteractionState(vtkImplicitPlaneRepresentation.Pushing)
        if not dragging:
            self._soon.stop()
            self.report()
        self._dragging(dragging)

    def _color(self, scheme: ColorScheme) -> None:
        strong, plain = (pv.Color(name).float_rgb for name in (SELECTED_COLOR, scheme.text))
        shape = self.shape
        shape.SetForegroundColor(*plain)
        shape.SetEdgeColor(*plain)
        shape.SetHandleColor(*pv.Color(HANDLE_COLOR).float_rgb)
        shape.SetInteractionColor(*strong)
        shape.GetPlaneProperty().SetColor(*plain)
        shape.GetPlaneProperty().SetOpacity(0.06)
        shape.GetSelectedPlaneProperty().SetColor(*strong)
        shape.GetSelectedPlaneProperty().SetOpacity(0.12)
