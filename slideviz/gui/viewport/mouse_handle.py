"""The base of handles that the mouse drags."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QMouseEvent
from vtkmodules.vtkCommonCore import vtkObject

from slideviz.gui.responsiveness.timers import later
from slideviz.gui.viewport.canvas import View3D
from slideviz.mesh.model import FloatArray
from slideviz.sections.model import Section

HANDLE_COLOR = "#2f6fb5"
"""Color of a handle that the mouse is not over."""

POINT_PX, RIM_PX = 11.0, 15.0
"""Diameters of a handle's point and of the rim around it, in pixels."""

REACH_PX = 10.0
"""Distance from a point up to which the mouse takes it, in pixels."""

EDGE_PX = 22.0
"""Distance that a handle's points keep from the view's edges and the legend, in pixels."""

Grasp = TypeVar("Grasp")
"""The state in which the mouse took a handle: a tuple whose first item is the section."""


class MouseHandle(QObject, Generic[Grasp]):
    """The base of a section's handle in a view; subclasses draw it and apply drags to the section.

    Parameters
    ----------
    view : View3D
    strip : callable
        Returns the width of the legend at the right of the view, in pixels.
    moved : callable
        Called with the new section while it is dragged, at most once per turn of the event loop.
    dragging : callable
        Called with True when a drag begins and with False when it ends.
    """

    def __init__(
        self,
        view: View3D,
        strip: Callable[[], float],
        moved: Callable[[Section], None],
        dragging: Callable[[bool], None] = lambda _dragging: None,
    ) -> None:
        super().__init__(view)
        self.view, self._strip = view, strip
        self._moved, self._dragging = moved, dragging
        self.section: Section | None = None
        self._part: str | None = None
        self._mouse = QPoint(-1, -1)
        self._start: tuple[Grasp, FloatArray] | None = None
        self._at: FloatArray | None = None
        self._soon = later(self, self.report)
        view.installEventFilter(self)
        watched, event = self.watched()
        tag = watched.AddObserver(event, lambda *_: self.put())  # type: ignore[arg-type]
        self._unwatch = lambda: watched.RemoveObserver(tag)

    @property
    def dragging(self) -> bool:
        """Return whether the mouse is dragging the handle."""
        return self._start is not None

    def close(self) -> None:
        """Remove the handle from the view for good."""
        self._soon.stop()
        self._unwatch()
        self.view.removeEventFilter(self)
        self.view.unsetCursor()
        self._start = self.section = None
        self.deleteLater()

    # What differs ----------------------------------------------------------------------

    def watched(self) -> tuple[vtkObject, str]:
        """Return a VTK object and the name of its event after which the handle is redrawn."""
        raise NotImplementedError

    def part_at(self, where: QPoint) -> str | None:
        """Return the part of the handle at a position in the widget; None if none is in reach."""
        raise NotImplementedError

    def place_of(self, where: QPoint) -> FloatArray:
        """Return a position in the widget, (2,), in the handle's coordinates.

        These are in the mesh's plane, in its length unit (line, circle), or pixels from the lower
        left (about an axis).
        """
        raise NotImplementedError

    def grasp(self) -> Grasp:
        """Return the present state, kept while the mouse drags: a tuple, the section first."""
        raise NotImplementedError

    def put(self) -> None:
        """Draw the handle at its place, with the part under the mouse highlighted."""
        raise NotImplementedError

    def dragged(self, grasp: Grasp, start: FloatArray, end: FloatArray) -> Section:
        """Return the section after a drag.

        Parameters
        ----------
        grasp : tuple
            What `grasp` returned when the drag began.
        start, end : (2,) float64
            Where the drag began and where the mouse is now, as `place_of` returns them.
        """
        raise NotImplementedError

    # Mouse -----------------------------------------------------------------------------

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if not isinstance(event, QMouseEvent):
            return False
        if kind == QEvent.Type.MouseButtonPress and event.button() == Qt.MouseButton.LeftButton:
            return self._press(event.position().toPoint())
        if kind == QEvent.Type.MouseMove:
            return self._move(event.position().toPoint(), bool(event.buttons()))
        if kind == QEvent.Type.MouseButtonRelease and self.dragging:
            return self._release(event.position().toPoint())
        return False

    def _press(self, where: QPoint) -> bool:
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

    def _point_at(self, part: str | None) -> None:
        """Highlight the part under the mouse, and set the cursor; None for no part."""
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
