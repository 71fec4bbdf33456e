"""The handles of the selected section, one in each view, by which the mouse drags it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyvista as pv
from vtkmodules.vtkInteractionWidgets import vtkImplicitPlaneRepresentation, vtkImplicitPlaneWidget2

from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.point_handle import (
    HANDLE_COLOR,
    POINT_PX,
    AxisHandle,
    Dragging,
    InPlaneHandle,
    Moved,
)
from slideviz.mesh.model import Mesh
from slideviz.scene.scene import Scene
from slideviz.sections.model import Section

_MARGIN = 0.03
"""Margin between the mesh and the frame of a plane handle, relative to the mesh's length."""


class Handles:
    """The handles of a section, one in each view, by which it is dragged.

    Parameters
    ----------
    moved, dragging : callable
        See `Moved` and `Dragging`.
    """

    def __init__(self, moved: Moved, dragging: Dragging) -> None:
        self._moved, self._dragging = moved, dragging
        self._of: dict[View3D, Handle] = {}

    def of(self, view: View3D) -> Handle | None:
        """Return the handle in a view; None if it has none."""
        return self._of.get(view)

    def __bool__(self) -> bool:
        return bool(self._of)

    def show(
        self,
        views: list[tuple[View3D, Scene, Mesh]],
        section: Section,
        mesh: Mesh,
        scheme: ColorScheme,
    ) -> None:
        """Show a handle of a section in every view.

        Parameters
        ----------
        views : list of (View3D, Scene, Mesh)
            Each view, its scene, and the mesh as deformed in the step it shows.
        mesh : Mesh
            The undeformed mesh.
        """
        kind = kind_of(section, mesh)
        for view, scene, deformed in views:
            if not isinstance(self._of.get(view), kind):
                self.drop(view)
                self._of[view] = kind(view, scene, self._moved, self._dragging)
            self._of[view].show(section, scheme, mesh, deformed)
            view.render_soon()

    def drop(self, view: View3D) -> None:
        """Remove the handle from a view."""
        handle = self._of.pop(view, None)
        if handle is not None:
            handle.close()
            view.render_soon()

    def clear(self) -> None:
        """Remove the handles from all views."""
        for view in list(self._of):
            self.drop(view)


class PlaneHandle:
    """The handle of a plane section: VTK's plane widget, with frame, normal arrow and ball.

    Parameters
    ----------
    moved, dragging : callable
        See `Moved` and `Dragging`.
    """

    def __init__(self, view: View3D, scene: Scene, moved: Moved, dragging: Dragging) -> None:
        self.view, self.scene = view, scene
        self._moved, self._dragging = moved, dragging
        self.section: Section | None = None
        self.shape = vtkImplicitPlaneRepresentation()
        self.shape.SetPlaceFactor(1.0)
        self.shape.OutlineTranslationOff()
        self.shape.ScaleEnabledOff()
        self.shape.OutsideBoundsOff()
        self.shape.SetDrawOutline(False)
        self.shape.SetHandleSize(POINT_PX)
        self.widget = vtkImplicitPlaneWidget2()
        self.widget.SetRepresentation(self.shape)
        self.widget.SetInteractor(view.iren.interactor)
        self._bounds: list[float] = []
        self.dragging = False
        self._soon = single_shot(None, self.report)
        for event, call in (
            ("StartInteractionEvent", lambda *_: self._grab(True)),
            ("InteractionEvent", lambda *_: self._soon.start()),
            ("EndInteractionEvent", lambda *_: self._grab(False)),
        ):
            self.widget.AddObserver(event, call)  # type: ignore[arg-type]  # a name is taken, too

    def show(self, section: Section, scheme: ColorScheme, mesh: Mesh, _deformed: Mesh) -> None:
        """Show the handle of a section, its frame around a mesh; during a drag the plane stays."""
        self.section = section
        self._color(scheme)
        low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
        margin = _MARGIN * (high - low).max()
        bounds = np.stack([low - margin, high + margin], axis=1).ravel().tolist()
        if bounds != self._bounds:
            self._bounds = bounds
            self.shape.PlaceWidget(bounds)
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
        """Call ``moved`` with the section at origin and normal of the dragged plane."""
        section = self.section
        if section is None:
            return
        # Nobody aims at more decimals, and they would fill the fields of the normal.
        normal = np.array(self.shape.GetNormal()).round(4) + 0.0
        origin = np.array(self.shape.GetOrigin())
        moved = replace(section, origin=tuple(origin.tolist()), direction=tuple(normal.tolist()))
        if not np.allclose(moved.origin, section.origin) or not np.allclose(
            moved.basis[2], section.basis[2]
        ):
            self._moved(moved)

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


Handle = PlaneHandle | InPlaneHandle | AxisHandle


def kind_of(section: Section, mesh: Mesh) -> type[Handle]:
    """Return the class of the handle for a section: by the mesh's dimension, then by its shape."""
    if mesh.dim == 2:
        return InPlaneHandle
    return PlaneHandle if section.shape.handle == "push" else AxisHandle
