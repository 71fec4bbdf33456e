"""The handle of a section of a 2D mesh: a line with points to move and turn it, or a circle."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from qtpy.QtCore import QEvent, QObject, QPoint, Qt, QTimer

from slideviz.gui.canvas.canvas import View3D
from slideviz.gui.canvas.handle import HANDLE_COLOUR
from slideviz.mesh.model import FloatArray
from slideviz.view.drawing.look import SELECTED_COLOUR, Look
from slideviz.view.drawing.pick import to_display
from slideviz.view.drawing.pick_cell import on_plane
from slideviz.view.sections.grip import Grips, Part, dragged, grips, nearest
from slideviz.view.sections.line import Box
from slideviz.view.sections.model import Section

POINT_PX, RIM_PX = 11.0, 15.0
"""Sizes of the points, and of what sets them off."""
REACH_PX = 10.0
EDGE_PX = 22.0
"""Points keep so far from the edges of the view, and from the legend."""
NAMES = ("handle:rim", "handle:points", "handle:held")


class FlatHandle(QObject):
    """Points on a line or circle that the mouse moves it by.

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
        self._look: Look | None = None
        self._lift = 0.0
        self._grips: Grips | None = None
        self._placed: tuple[object, ...] = ()
        self._part: Part | None = None
        self._start: tuple[Section, FloatArray, Box] | None = None
        self._at: FloatArray | None = None
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.setInterval(0)
        self._soon.timeout.connect(self.tell)
        view.installEventFilter(self)
        self._watching = view.camera.AddObserver("ModifiedEvent", lambda *_: self._place())

    @property
    def dragging(self) -> bool:
        """Tell whether the mouse holds it."""
        return self._start is not None

    def show(self, section: Section, lift: float, look: Look) -> None:
        """Stand where the section is, so far above the mesh."""
        self.section, self._lift, self._look = section, lift, look
        self._place()

    def close(self) -> None:
        """Leave the view for ever."""
        self._soon.stop()
        self.view.removeEventFilter(self)
        self.view.camera.RemoveObserver(self._watching)
        self.view.unsetCursor()
        self._start = self.section = None
        for name in NAMES:
            self.view.remove_actor(name, reset_camera=False, render=False)
        self.deleteLater()

    # Drawing ---------------------------------------------------------------------------

    def seen(self) -> Box:
        """Return what the view shows of the mesh's plane, without its edges."""
        wide, high = self.view.window_size
        corners = (
            on_plane(self.view, EDGE_PX, EDGE_PX),
            on_plane(self.view, wide - self._strip() - EDGE_PX, high - EDGE_PX),
        )
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def _place(self) -> None:
        """Put the points where they are in reach."""
        if self.section is None:
            return
        seen = self.seen()
        # To draw moves the near and far planes of the camera, too.
        key = (self.section, self._lift, self._look, self._part, *seen[0], *seen[1])
        if key == self._placed:
            return
        self._placed = key
        self._grips = grips(self.section, seen)
        empty = np.empty((0, 2))
        points = empty
        if self._grips is not None:
            points = np.concatenate([self._grips.middle, self._grips.ends])
        held = {"middle": self._grips.middle, "end": self._grips.ends} if self._grips else {}
        look = self._look
        assert look is not None
        # Points are balls to VTK: one above another must be more than its radius higher.
        ball = RIM_PX * float((seen[1] - seen[0]).max()) / max(self.view.window_size)
        self._draw(NAMES[0], points, ball, (look.text, RIM_PX))
        self._draw(NAMES[1], points, 2.0 * ball, (HANDLE_COLOUR, POINT_PX))
        taken = held.get(self._part or "", empty)
        self._draw(NAMES[2], taken, 3.0 * ball, (SELECTED_COLOUR, POINT_PX))

    def _draw(self, name: str, points: FloatArray, above: float, style: tuple[str, float]) -> None:
        actor = self.view.actors.get(name)
        if not len(points):
            if actor is not None:
                actor.visibility = False
            return
        height = np.full(len(points), self._lift + above)
        shape = pv.PolyData(np.column_stack([points, height]))
        colour, size = style
        if actor is None:
            actor = self.view.add_mesh(
                shape,
                name=name,
                point_size=size * self.view.devicePixelRatioF(),
                render_points_as_spheres=True,
                lighting=False,
                reset_camera=False,
                render=False,
                pickable=False,
            )
        actor.mapper.dataset = shape
        actor.prop.color = colour
        actor.visibility = True

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

    def part_at(self, where: QPoint) -> Part | None:
        """Return what the mouse would take at a position of the widget."""
        if self._grips is None:
            return None
        shown: list[tuple[Part, FloatArray]] = [
            ("end", self._pixels(self._grips.ends)),
            ("middle", self._pixels(self._grips.middle)),
            *(("line", self._pixels(line)) for line in self._grips.lines),
        ]
        reach = REACH_PX * self.view.devicePixelRatioF()
        return nearest(shown, np.array(self.view.to_pixels(where)), reach)

    def _pixels(self, points: FloatArray) -> FloatArray:
        if not len(points):
            return points
        return to_display(self.view, np.column_stack([points, np.zeros(len(points))]))

    def _world(self, where: QPoint) -> FloatArray:
        return np.array(on_plane(self.view, *self.view.to_pixels(where)))

    def _press(self, where: QPoint) -> bool:
        part = self.part_at(where)
        if part is None or self.section is None:
            return False
        self._point_at(part)
        self._start = self.section, self._world(where), self.seen()
        self._at = None
        self._held(True)
        return True

    def _move(self, where: QPoint, pressed: bool) -> bool:
        if self.dragging:
            self._at = self._world(where)
            self._soon.start()
            return True
        if not pressed:
            self._point_at(self.part_at(where))
        return False

    def _release(self, where: QPoint) -> bool:
        self._soon.stop()
        if self._at is not None:
            self._at = self._world(where)
            self.tell()
        self._start = self._at = None
        self._held(False)
        self._point_at(self.part_at(where))
        return True

    def _point_at(self, part: Part | None) -> None:
        """Show what the mouse would take, or has taken."""
        if part == self._part:
            return
        self._part = part
        if part is None:
            self.view.unsetCursor()
        else:
            self.view.setCursor(Qt.CursorShape.SizeAllCursor)
        self._place()
        self.view.render_soon()

    def tell(self) -> None:
        """Tell where the section is now."""
        if self._start is None or self._at is None or self._part is None:
            return
        section, start, box = self._start
        self._moved(dragged(section, self._part, (start, self._at), box))
