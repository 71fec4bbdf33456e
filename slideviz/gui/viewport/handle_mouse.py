"""The mouse and the keys on the handle of a view: they move, turn and enlarge what is chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QFocusEvent, QKeyEvent, QMouseEvent
from qtpy.QtWidgets import QToolTip

from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.mesh.model import FloatArray, row_norms
from slideviz.scene.handle import (
    EDGE_PX,
    REACH_PX,
    Drag,
    HandleActor,
    Part,
    control_at,
    part_at,
    parts_of,
)
from slideviz.scene.pick import Projection
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.placed import Act, Placed, placed
from slideviz.session.store import Store
from slideviz.terms import WholeNumbers

ACTS: dict[int, Act] = {
    Qt.Key.Key_G: "move",
    Qt.Key.Key_R: "turn",
    Qt.Key.Key_S: "grow",
}
"""What each key begins."""
KEYS = "X Y Z: axis · Shift+X: plane · a number · Ctrl snaps · Shift: fine · Enter · Esc"
ARM_PX = 60.0  # distance from the middle at which a key takes hold if the mouse is in the middle
_NONE = Qt.KeyboardModifier.NoModifier
_MODIFIERS: dict[int, Qt.KeyboardModifier] = {
    Qt.Key.Key_Control: Qt.KeyboardModifier.ControlModifier,
    Qt.Key.Key_Shift: Qt.KeyboardModifier.ShiftModifier,
}
"""The modifier of its key: whether the event of the key itself has it differs by platform."""
_ELSEWHERE = (Qt.FocusReason.ActiveWindowFocusReason, Qt.FocusReason.PopupFocusReason)
_ENTER = (Qt.Key.Key_Return, Qt.Key.Key_Enter)


class HandleMouse(QObject):
    """The handle in one view, and what mouse and keys do with it.

    ``scene``: what the view draws. ``show_status``: called with the number that changes, in words.
    """

    def __init__(
        self, view: View3D, scene: Scene, store: Store, show_status: Callable[[str], object]
    ) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self.store = store
        self._show_status = show_status
        self.parts: list[Part] = []
        self.drag: Drag | None = None
        self._by_key = False
        self._under: Part | None = None
        self._mouse: QPoint | None = None
        self._origin: FloatArray | None = None
        self._known: tuple[tuple[object, ...], Placed | None] = (), None
        self._actor = HandleActor(view)
        self._soon = single_shot(self, self._apply)
        view.installEventFilter(self)
        # Each drawing may have another camera, size or session.
        put = self.put
        view.renderer.AddObserver("StartEvent", lambda *_: put())

    # Drawing ---------------------------------------------------------------------------
    def placed(self) -> Placed | None:
        """Return what the handle moves, with its middle in the view if it has a place there."""
        session = self.scene.session
        ghosts = self.scene.motion_ghosts
        key = session, *ghosts.values()
        if len(key) != len(self._known[0]) or any(
            new is not old for new, old in zip(key, self._known[0], strict=True)
        ):
            self._known = key, placed(session, ghosts, self.scene.sections.cuts)
        found = self._known[1]
        if found is None:
            return None
        if self._origin is not None:
            return replace(found, origin=self._origin)
        pixels = Projection.of(self.view).pixels(found.anchors)
        wide, high = self.view.window_size
        end = np.array([wide - self.scene.stage.strip(), high]) - EDGE_PX
        within = np.all((pixels >= EDGE_PX) & (pixels <= end), axis=1)
        if within[0] or not within.any():
            return found
        far = row_norms(pixels - (EDGE_PX + end) / 2.0)
        return found.anchored(int(np.argmin(np.where(within, far, np.inf))))

    def put(self) -> None:
        """Draw the handle where it is now."""
        now = self.placed()
        if self.drag is not None and now is None:
            self._soon.stop()  # another mesh is there, for example
            self._end()
        ratio = self.view.devicePixelRatioF()
        self.parts = [] if now is None else parts_of(now, Projection.of(self.view), ratio)
        held = None if self._under is None else self._under.grip
        self._actor.draw(self.parts, held, self.scene.scheme)

    # Mouse -----------------------------------------------------------------------------
    def _pixel(self, where: QPoint) -> FloatArray:
        return np.array(self.view.to_pixels(where))

    def part_at(self, where: QPoint) -> Part | None:
        """Return the part of the handle at a position in the widget, or None."""
        return part_at(self.parts, self._pixel(where), self.view.devicePixelRatioF())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if watched is not self.view:
            asked = kind == QEvent.Type.ShortcutOverride and self.drag is None
            return asked and isinstance(event, QKeyEvent) and self._key(event)
        if kind == QEvent.Type.Enter:
            self.view.window().installEventFilter(self)  # keys that the panels do not take
        if kind == QEvent.Type.Leave:
            self.view.window().removeEventFilter(self)
        if isinstance(event, QKeyEvent):
            return self._key(event)
        if isinstance(event, QFocusEvent):
            # What a panel changes now must not be lost by the next move; other windows may come.
            left = event.lostFocus() and event.reason() not in _ELSEWHERE
            if left and self.drag is not None:
                self._end()
        if not isinstance(event, QMouseEvent):
            return False
        where = event.position().toPoint()
        self._mouse = where
        if kind == QEvent.Type.MouseMove:
            return self._moved(where, event)
        if kind in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick):
            row = bool(event.modifiers() & Qt.KeyboardModifier.AltModifier)
            return self._press(where, event.button() == Qt.MouseButton.LeftButton, row=row)
        if kind == QEvent.Type.MouseButtonRelease and self.drag is not None:
            if not self._by_key:
                self._end()
            return True
        return False

    def _press(self, where: QPoint, left: bool, *, row: bool) -> bool:
        if self.drag is not None:
            self._end(keep=left)
            self._by_key = False
            return True
        if self.store.session.view.picks is not None:
            return False
        part = self.part_at(where) if left else None
        if left and (part is None or row) and self._choose_control(where, row=row):
            part = next((one for one in self.parts if one.grip == ("move", ())), None)
        if part is None:
            return False
        self.view.setFocus()
        self._point_at(part)
        self._by_key = False
        act, axes = part.grip
        self._begin(act, axes, self._pixel(where), part.point)
        return True

    def _choose_control(self, where: QPoint, *, row: bool) -> bool:
        """Choose the control points of a box at a position in the view; return whether any are."""
        session = self.scene.session
        reach = REACH_PX * self.view.devicePixelRatioF()
        seen = Projection.of(self.view)
        found = control_at(session, seen, self._pixel(where), reach, row=row)
        if found is not None:
            self.store.change(changes.choose_control, *found)
            self.put()
        return found is not None

    def _moved(self, where: QPoint, event: QMouseEvent) -> bool:
        if self.drag is not None:
            self._follow(event.modifiers())
            return True
        if not event.buttons():
            self._point_at(self.part_at(where))
        return False

    def _point_at(self, part: Part | None) -> None:
        """Mark the part under the mouse, and set the cursor; None for no part."""
        before = self._under
        self._under = part
        if (before and before.grip) == (part and part.grip):
            return
        if part is None:
            self.view.unsetCursor()
        else:
            self.view.setCursor(Qt.CursorShape.SizeAllCursor)
        self.view.render_soon()

    # Keys ------------------------------------------------------------------------------
    def _key(self, event: QKeyEvent) -> bool:
        """Handle a key; return whether it was one for the handle.

        A key that is also a shortcut is asked for first: accepted, it comes as a key press.
        """
        kind = event.type()
        if kind == QEvent.Type.KeyRelease and self.drag is not None:
            self._follow(event.modifiers() & ~_MODIFIERS.get(event.key(), _NONE))
            return True
        if kind not in (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress):
            return False
        starts = event.key() in ACTS and not event.modifiers() and self.placed() is not None
        if self.drag is None and not starts:
            return False
        if kind == QEvent.Type.ShortcutOverride:
            self.view.setFocus()  # the key press goes to what has the focus then
            event.accept()
            return True
        if self.drag is None:
            self._take_hold(ACTS[event.key()])
        else:
            self._choose(event, self.drag)
        return True

    def _take_hold(self, act: Act) -> None:
        """Begin to move, turn or enlarge what is chosen, from where the mouse is."""
        now = self.placed()
        assert now is not None
        projection = Projection.of(self.view)
        (middle,) = projection.pixels(now.origin[None])
        start = middle if self._mouse is None else self._pixel(self._mouse)
        arm = ARM_PX * self.view.devicePixelRatioF()
        held = start
        if act != "move" and np.linalg.norm(start - middle) < arm / 4.0:
            held = middle + np.array([arm, 0.0])
        point = projection.on_plane(held, now.origin, projection.sight(now.origin))
        self._by_key = True
        QToolTip.hideText()  # it would be in front of the handle
        self._begin(act, (), start, point)

    def _choose(self, event: QKeyEvent, drag: Drag) -> None:
        """Take a key while something is dragged: an axis, a plane, a number, or the end."""
        key = event.key()
        letter = event.text().lower()
        modifiers = event.modifiers() | _MODIFIERS.get(key, _NONE)
        if key == Qt.Key.Key_Escape or key in _ENTER:
            self._end(keep=key != Qt.Key.Key_Escape)
            return
        axis = drag.placed.names.find(letter) if letter else -1
        if axis >= 0 and drag.placed.allows(drag.act, axis):
            axes: WholeNumbers = (axis,)
            across = modifiers & Qt.KeyboardModifier.ShiftModifier and drag.placed.dim == 3
            if across and axis < 3 and drag.act == "move":
                axes = tuple(sorted({0, 1, 2} - {axis}))
            self.drag = replace(drag, axes=() if axes == drag.axes else axes)
        elif key in ACTS:
            self.drag = replace(drag, act=ACTS[key], axes=())
        elif key == Qt.Key.Key_Backspace:
            self.drag = replace(drag, typed=drag.typed[:-1])
        elif letter and letter in "0123456789.-e":
            self.drag = replace(drag, typed=drag.typed + letter)
        self._follow(modifiers)

    # The drag --------------------------------------------------------------------------
    def _begin(self, act: Act, axes: WholeNumbers, start: FloatArray, point: FloatArray) -> None:
        now = self.placed()
        assert now is not None
        projection = Projection.of(self.view)
        # What is held is at the mouse, as deep in the view as the part of the handle.
        if not self._by_key:
            point = projection.on_plane(start, point, projection.sight(point))
        self.drag = Drag(now, projection, act, axes, point, start, start)
        self.store.set_dragging(True)
        self._show_status(KEYS)

    def _follow(self, modifiers: Qt.KeyboardModifier) -> None:
        """Move what is held to the mouse, soon."""
        if self.drag is None:
            return
        now = self.drag.now if self._mouse is None else self._pixel(self._mouse)
        self.drag = self.drag.moved_to(
            now,
            fine=bool(modifiers & Qt.KeyboardModifier.ShiftModifier),
            snaps=bool(modifiers & Qt.KeyboardModifier.ControlModifier),
        )
        self._soon.start()

    def _apply(self) -> None:
        """Change the session to what the drag makes of it."""
        drag = self.drag
        result = None if drag is None else drag.result()
        if drag is None or result is None:
            return
        self._origin = result.origin
        self.drag = replace(drag, before=result.turned)
        self.store.change(changes.place, moved=result.session)
        self._show_status(f"{result.words}   {KEYS}")

    def _end(self, keep: bool = True) -> None:
        """End the drag; without ``keep`` everything is as it was before."""
        if keep and self._soon.isActive():
            self._apply()
        drag = self.drag
        assert drag is not None
        self._soon.stop()
        self.drag = self._origin = None
        if not keep:
            with self.store.reverting():
                self.store.change(changes.place, moved=drag.placed.session)
        result = drag.result() if keep else None
        self._show_status("" if result is None else result.words)
        self.store.set_dragging(False)
        self.view.signals.released.emit()
        self.view.render_soon()
