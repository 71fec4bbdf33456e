"""The views of the selected section: its handles in the 3D views, and its flat views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyvista as pv
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QSplitter, QWidget
from vtkmodules.vtkInteractionWidgets import vtkImplicitPlaneRepresentation, vtkImplicitPlaneWidget2

from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.flat_views import FRAME_PX, CurveView, FlatView, FlatViews
from slideviz.gui.viewport.point_handle import (
    HANDLE_COLOR,
    POINT_PX,
    AxisHandle,
    Dragging,
    InPlaneHandle,
    Moved,
)
from slideviz.gui.viewport.viewing import Viewing
from slideviz.mesh.model import Mesh
from slideviz.scene.axis_handle import points_near
from slideviz.scene.scene import Scene
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.panes import second_session
from slideviz.session.section_cuts import can_cut
from slideviz.session.state import Session

_MARGIN = 0.03
"""Margin between the mesh and the frame of a plane handle, relative to the mesh's length."""


class Handles:
    """The handles of a section, one in each view, by which it is dragged.

    ``moved`` and ``dragging``: see `Moved` and `Dragging`.
    """

    def __init__(self, moved: Moved, dragging: Dragging) -> None:
        self._moved = moved
        self._dragging = dragging
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

        ``views``: each view, its scene, and the mesh as deformed in the step it shows. ``mesh``:
        the undeformed mesh.
        """
        kind = kind_of(section, mesh)
        for view, scene, deformed in views:
            if not isinstance(self._of.get(view), kind):
                self.drop(view)
                self._of[view] = kind(view, scene, self._moved, self._dragging)
            self._of[view].show(section, scheme, mesh, deformed)
            view.render_soon()

    def drop(self, view: View3D) -> None:
        handle = self._of.pop(view, None)
        if handle is not None:
            handle.close()
            view.render_soon()

    def clear(self) -> None:
        for view in list(self._of):
            self.drop(view)


class PlaneHandle:
    """The handle of a plane section: VTK's plane widget, with frame, normal arrow and ball.

    ``moved`` and ``dragging``: see `Moved` and `Dragging`.
    """

    def __init__(self, view: View3D, scene: Scene, moved: Moved, dragging: Dragging) -> None:
        self.view = view
        self.scene = scene
        self._moved = moved
        self._dragging = dragging
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
        self.section = section
        self._color(scheme)
        low = mesh.points.min(axis=0)
        high = mesh.points.max(axis=0)
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
        strong = pv.Color(SELECTED_COLOR).float_rgb
        plain = pv.Color(scheme.text).float_rgb
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
    return PlaneHandle if section.handle == "push" else AxisHandle


BESIDE_PX = 1000
"""Width of the splitter, in pixels, below which the flat view is always below the 3D view."""

_SHARE = 9 / 20  # largest part of the splitter's length that the flat view gets
_LONG = 1.5
"""Ratio of the drawn sizes, below to beside, from which the flat view goes below the 3D view."""


class SectionViews(QSplitter):
    """The 3D views, and beside or below them the flat views of the selected section."""

    def __init__(self, viewing: Viewing, multi_samples: int, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Vertical, parent)
        self.setChildrenCollapsible(False)
        self.viewing = viewing
        self.store = viewing.store
        self.addWidget(viewing)
        self._multi_samples = multi_samples
        self.handles = Handles(self._replaced, self.store.set_dragging)
        """The handles of the selected section, one in each 3D view while they are switched on."""
        self.flats: FlatViews | None = None
        """The flat views; None while no section is laid flat."""
        self._closed = False
        self._kind: tuple[object, ...] = ()
        self.scheme = viewing.scene.scheme
        """The colors of handles and flat views."""
        self.store.listen(self._session_changed)
        viewing.second_made.connect(lambda: self._sync_handles(self.store.session))
        viewing.second_leaves.connect(self._second_leaves)

    def _second_leaves(self) -> None:
        assert self.viewing.second is not None
        self.handles.drop(self.viewing.second)

    # What is wanted --------------------------------------------------------------------
    @property
    def section(self) -> Section | None:
        return self.store.session.view.section

    @property
    def flat(self) -> FlatView | CurveView | None:
        """Return the flat view of the first 3D view (of a 2D mesh the curve), or None."""
        return None if self.flats is None else self.flats.first

    @property
    def is_flat(self) -> bool:
        return self.section is not None and self.section.flat

    def want_flat(self, wanted: bool) -> None:
        """Lay the selected section flat beside the 3D view; False: lay none flat."""
        if wanted != self.is_flat or not wanted:
            at = self.store.session.view.section_index if wanted else None
            self.store.change(changes.lay_flat, at)

    def look_along(self) -> None:
        """Turn the camera to face the selected section, from outside if it is about an axis."""
        section = self.section
        session = self.store.session
        if section is None or session.frame is None or session.frame.mesh.dim == 2:
            return
        scene = self.viewing.scene
        points = points_near(section, session.frame.mesh, scene.sections.cuts)
        rows = section.facing(points)
        camera = scene.plotter.camera
        camera.position = np.asarray(camera.focal_point) + rows[2] * camera.distance
        camera.up = rows[1]
        self.viewing.fit()

    # What is shown ---------------------------------------------------------------------
    def _session_changed(self, old: Session, new: Session) -> None:
        if old.mesh is not new.mesh:
            # A 2D mesh has a curve where a 3D one has flat views.
            self._drop_flats()
        idle = self.flats is None and not self.handles and not new.view.handle
        if not idle or old.mesh is not new.mesh or old.view.sections != new.view.sections:
            self._sync()

    def redraw(self) -> None:
        """Draw the sections again, after their cells were read from the mesh's file."""
        session = self.store.session
        self.viewing.sync(session, session)
        self._sync()

    def _sync(self) -> None:
        session = self.store.session
        self._sync_handles(session)
        self._sync_flat(session)

    def _sync_handles(self, session: Session) -> None:
        mesh = session.mesh
        section = self.section
        wanted = session.view.handle and session.frame is not None and not self._closed
        usable = section is not None and section.shown and can_cut(mesh, section)
        if wanted and usable and section is not None and mesh is not None:
            self.handles.show(self._shown(session), section, mesh, self.scheme)
        else:
            self.handles.clear()

    def _shown(self, session: Session) -> list[tuple[View3D, Scene, Mesh]]:
        sessions = (session, second_session(session) or session)
        pairs = zip(self.viewing.views_and_scenes(), sessions, strict=False)
        return [(view, scene, one.frame.mesh) for (view, scene), one in pairs if one.frame]

    def _replaced(self, section: Section) -> None:
        if self.section is not None and section != self.section:
            at = self.store.session.view.section_index
            self.store.change(changes.replace_section, at, section)

    def _sync_flat(self, session: Session) -> None:
        at = session.view.flat_index
        section = session.view.sections[at] if at is not None else None
        if section is None or session.frame is None or not can_cut(session.mesh, section):
            self._drop_flats()
            return
        made = self.flats is None
        if self.flats is None:
            self.flats = FlatViews(self.viewing, self.scheme, self._multi_samples)
            self.flats.closed.connect(lambda: self.want_flat(False))
        sees_all = self.viewing.scene.camera.sees_all()
        if made:
            self.addWidget(self.flats)
        self.flats.show_section(session, section)
        # A change of the radius must not rearrange the views.
        compared = second_session(session) is not None
        kind = (session.mesh, compared, section.kind, section.direction, session.view.passages)
        if made or kind != self._kind:
            self._kind = kind
            self._arrange(self.flats.extent, compared)
            if sees_all:
                self.viewing.fit()

    def _arrange(self, extent: tuple[float, float] | None, compared: bool) -> None:
        """Put the flat view beside or below the 3D view, whichever draws its section larger.

        It is always below if two views are compared, and for a curve (``extent`` None).
        """
        wide = False
        share = _SHARE
        if extent is not None and not compared:
            wide, share = arrangement_for(extent, (self.width(), self.height()))
        self.setOrientation(Qt.Orientation.Horizontal if wide else Qt.Orientation.Vertical)
        size = self.width() if wide else self.height()
        flat = round(share * size)
        self.setSizes([size - flat, flat])

    def _drop_flats(self) -> None:
        flats = self.flats
        self.flats = None
        if flats is None:
            return
        sees_all = self.viewing.scene.camera.sees_all()
        flats.close_views()
        flats.setParent(None)
        flats.deleteLater()
        if sees_all:
            self.viewing.fit()

    def set_scheme(self, scheme: ColorScheme) -> None:
        self.scheme = scheme
        if self.flats is not None:
            self.flats.set_scheme(scheme)
        self._sync()

    def close_views(self) -> None:
        """Release the graphics resources; call this before the 3D views are closed."""
        self.handles.clear()
        if self.flats is not None:
            self.flats.close_views()
            self.flats = None
        self._closed = True


def arrangement_for(extent: tuple[float, float], available: tuple[int, int]) -> tuple[bool, float]:
    """Return whether a flat section goes beside the 3D view (else below), and its part of the room.

    ``extent`` (float, float): width and height of the section, in the mesh's length unit.
    ``available`` (int, int): width and height of the 3D view and the flat view together, in pixels.
    """
    wide, high = np.maximum(extent, 1e-300)
    width, height = np.maximum(available, 1)
    beside_scale = min(_SHARE * width / wide, height / high)
    below_scale = min(width / wide, _SHARE * height / high)
    if width >= BESIDE_PX and below_scale < _LONG * beside_scale:
        return True, _SHARE
    # A long, low section does not fill the share: the 3D view gets the rest.
    needed = (high / wide * width + FRAME_PX) / height
    return False, float(np.clip(needed, 0.6 * _SHARE, _SHARE))
