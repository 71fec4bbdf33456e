"""The 3D views, and the flat views of the selected section beside them."""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QSplitter, QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.viewport.flat_views import FRAME_PX, CurveView, FlatView, FlatViews
from slideviz.gui.viewport.viewing import Viewing
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.panes import second_session
from slideviz.session.placed import points_near
from slideviz.session.section_cuts import can_cut
from slideviz.session.state import Session

BESIDE_PX = 1000
"""Width of the splitter, in pixels, below which the flat view is always below the 3D view."""

_SHARE = 9 / 20  # largest part of the splitter's length that the flat view gets
_LONG = 1.5
"""Ratio of the drawn sizes, below to beside, from which the flat view goes below the 3D view."""


class SectionViews(QSplitter):
    """The 3D views, and beside or below them the flat views of the selected section."""

    def __init__(self, viewing: Viewing, multi_samples: int, parent: QWidget) -> None:
        super().__init__(Qt.Orientation.Vertical, parent)
        self.setChildrenCollapsible(False)
        self.viewing = viewing
        self.store = viewing.store
        self.addWidget(viewing)
        self._multi_samples = multi_samples
        self.flats: FlatViews | None = None
        """The flat views; None while no section is laid flat."""
        self._kind: object = ()
        self.scheme = viewing.scene.scheme
        """The colors of the flat views."""
        self.store.listen(self._session_changed)

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
        another = old.mesh is not new.mesh
        if another:
            # A 2D mesh has a curve where a 3D one has flat views.
            self._drop_flats()
        if another or self.flats is not None or old.view.sections != new.view.sections:
            self._sync_flat(new)

    def redraw(self) -> None:
        """Draw the sections again, after their cells were read from the mesh's file."""
        session = self.store.session
        self.viewing.sync(session, session)
        self._sync_flat(session)

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

    def close_views(self) -> None:
        """Release the graphics resources; call this before the 3D views are closed."""
        if self.flats is not None:
            self.flats.close_views()
            self.flats = None


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
