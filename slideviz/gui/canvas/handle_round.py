"""The handle of a cylinder through a 3D mesh: a frame around the cut, and a ball to pull it by."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from qtpy.QtCore import QEvent, QObject, QPoint, Qt, QTimer

from slideviz.gui.canvas.canvas import View3D
from slideviz.gui.canvas.handle_flat import EDGE_PX, REACH_PX
from slideviz.gui.canvas.pull_mark import PullMark
from slideviz.mesh.model import FloatArray
from slideviz.view.drawing.look import Look
from slideviz.view.drawing.pick import to_display
from slideviz.view.sections.grip import rounded
from slideviz.view.sections.grip_round import (
    Patch,
    Place,
    frame_of,
    on_cylinder,
    pull,
    radius_at,
)
from slideviz.view.sections.model import Section


class RoundHandle(QObject):
    """A ball on a cylinder that the mouse changes its radius by.

    It lies on what is cut of the mesh, where that is seen, and in front of everything.

    Parameters
    ----------
    view : View3D
    strip : callable
        Returns the pixels at the right that are the legend's.
    moved : callable
        Gets the section while it is dragged, at most once per turn of the event loop.
    held : callable
        Gets whether the mouse begins to drag, or ends it.
    """

    def __init__(
        self,
        view: View3D,
        strip: Callable[[], float],
        moved: Callable[[Section], None],
        held: Callable[[bool], None] = lambda _held: None,
    ) -> None:
        super().__init__(view)
        self.view, self._strip = view, strip
        self._moved, self._held = moved, held
        self.section: Section | None = None
        self._patch: Patch | None = None
        self.place: Place | None = None
        self._mark = PullMark(view)
        self._over = False
        self._mouse = QPoint(-1, -1)
        self._start: tuple[Section, Place, FloatArray] | None = None
        self._at: FloatArray | None = None
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.setInterval(0)
        self._soon.timeout.connect(self.tell)
        view.installEventFilter(self)
        # Before each drawing, whatever moved the camera or changed the size of the view.
        self._watching = view.renderer.AddObserver("StartEvent", lambda *_: self.put())

    @property
    def dragging(self) -> bool:
        """Tell whether the mouse holds it."""
        return self._start is not None

    def show(self, section: Section, patch: Patch, look: Look) -> None:
        """Stand where the section is, around that part of it."""
        self.section, self._patch = section, patch
        self._mark.colour(look, self._over)
        self._mark.draw_frame(frame_of(section, patch))
        self.put()

    def close(self) -> None:
        """Leave the view for ever."""
        self._soon.stop()
        self.view.removeEventFilter(self)
        self.view.renderer.RemoveObserver(self._watching)
        self.view.unsetCursor()
        self._start = self.section = self._patch = None
        self._mark.remove()
        self.deleteLater()

    def seen(self, points: FloatArray) -> FloatArray:
        """Return where points (n, 3) are seen, (n, 2) in pixels from the lower left."""
        return to_display(self.view, points)

    def put(self) -> None:
        """Put the ball where it is in reach, and what points to where it can be pulled."""
        if self.section is None or self._patch is None:
            return
        self.place = self._start[1] if self._start is not None else self._in_reach(self._patch)
        at, way, _ = pull(self.seen, self.section, self.place, self.section.radius)
        self._mark.draw_ball(at, way / np.linalg.norm(way))
        if self._over and not self.dragging and not self._is_at(self._mouse):
            # It went from below the mouse, which stayed.
            self._point_at(False)

    def _in_reach(self, patch: Patch) -> Place:
        """Return where the ball lies: in the middle, or beside it in a detail of the view."""
        assert self.section is not None
        places = np.concatenate([np.array([patch.middle]), patch.places])
        pixels = self.seen(on_cylinder(self.section, places, self.section.radius))
        wide, high = self.view.window_size
        end = np.array([wide - self._strip() - EDGE_PX, high - EDGE_PX])
        within = ((pixels >= EDGE_PX) & (pixels <= end)).all(axis=1)
        if within[0] or not within.any():
            return patch.middle
        off = np.linalg.norm(pixels - (EDGE_PX + end) / 2.0, axis=1)
        angle, along = places[int(np.argmin(np.where(within, off, np.inf)))].tolist()
        return angle, along

    # Mouse -----------------------------------------------------------------------------

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.MouseButtonPress and event.button() == Qt.MouseButton.LeftButton:
            return self._press(event.position().toPoint())
        if kind == QEvent.Type.MouseMove:
            return self._move(event.position().toPoint(), bool(event.buttons()))
        if kind == QEvent.Type.MouseButtonRelease and self.dragging:
            return self._release(event.position().toPoint())
        return False

    def _pixel(self, where: QPoint) -> FloatArray:
        return np.array(self.view.to_pixels(where))

    def _is_at(self, where: QPoint) -> bool:
        """Tell whether the mouse would take the ball at a position of the widget."""
        if self.section is None or self.place is None:
            return False
        ball = on_cylinder(self.section, np.array([self.place]), self.section.radius)
        reach = REACH_PX * self.view.devicePixelRatioF()
        return bool(np.linalg.norm(self.seen(ball)[0] - self._pixel(where)) <= reach)

    def _press(self, where: QPoint) -> bool:
        if not self._is_at(where) or self.section is None or self.place is None:
            return False
        self._point_at(True)
        self._start = self.section, self.place, self._pixel(where)
        self._at = None
        self._held(True)
        return True

    def _move(self, where: QPoint, pressed: bool) -> bool:
        self._mouse = where
        if self.dragging:
            self._at = self._pixel(where)
            self._soon.start()
            return True
        if not pressed:
            self._point_at(self._is_at(where))
        return False

    def _release(self, where: QPoint) -> bool:
        self._soon.stop()
        self._mouse = where
        if self._at is not None:
            self._at = self._pixel(where)
            self.tell()
        self._start = self._at = None
        self._held(False)
        self.put()
        self._point_at(self._is_at(where))
        self.view.render_soon()
        return True

    def _point_at(self, over: bool) -> None:
        """Show whether the mouse would take it, or has taken it."""
        if over == self._over:
            return
        self._over = over
        if over:
            self.view.setCursor(Qt.CursorShape.SizeAllCursor)
        else:
            self.view.unsetCursor()
        self._mark.highlight(over)
        self.view.render_soon()

    def tell(self) -> None:
        """Tell which radius the section has now."""
        if self._start is None or self._at is None:
            return
        section, place, pressed = self._start
        radius = radius_at(self.seen, section, place, (pressed, self._at))
        self._moved(replace(section, radius=rounded(radius, section.radius)))
