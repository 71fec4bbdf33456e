"""Coalesces the repaints of a view and of the widgets around it."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtCore import QCoreApplication, QEvent, QObject
from qtpy.QtWidgets import QWidget

from slideviz.gui.responsiveness.settings import REPAINT_MS
from slideviz.gui.responsiveness.timers import later


class RepaintCoalescer(QObject):
    """Delays repaints so that a view and the widgets around it are painted together, soon.

    After a change of the scene, Qt handles pending clicks and timers first; then the view is
    drawn. Labels around it change at the same time, and Qt would paint each at once. In a window
    with an OpenGL view, every such paint composes the whole window (10 to 20 ms without a graphics
    card), so the window's update requests are held back until the view is painted.
    """

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        self._view = view
        self._window: QWidget | None = None
        self._held = False
        self._timer = later(self, self._paint, REPAINT_MS)

    def ask(self) -> None:
        """Schedule a repaint."""
        window = self._view.window()
        if window is not self._window:
            self._let_go()
            window.installEventFilter(self)
            self._window = window
        if not self._timer.isActive():
            self._timer.start()

    def end(self) -> None:
        """Stop delaying repaints of the window."""
        self._timer.stop()
        self._let_go()

    def _paint(self) -> None:
        self._view.update()
        self._let_go()

    def _let_go(self) -> None:
        if self._held and self._window is not None:
            self._held = False
            QCoreApplication.postEvent(self._window, QEvent(QEvent.Type.UpdateRequest))

    def eventFilter(self, _window: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.UpdateRequest or not self._timer.isActive():
            return False
        # The event is filtered out and posted again by `_let_go`: Qt takes it for handled.
        self._held = True
        return True
