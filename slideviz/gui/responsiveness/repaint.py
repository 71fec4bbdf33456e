"""Coalesces the repaints of a view and of the widgets around it."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtCore import QCoreApplication, QEvent, QObject
from qtpy.QtWidgets import QWidget

from slideviz.gui.responsiveness.settings import REPAINT_MS
from slideviz.gui.responsiveness.timers import later


class RepaintCoalescer(QObject):
    """The coalescer of repaints: a view and the widgets around it are painted together, soon.

    After a scene has changed, Qt answers clicks and timers first; then the view is drawn. Labels
    around the view change at the same time, and Qt would paint each of them at once. Beside a view
    that OpenGL draws, every such paint sends the whole window to the screen, 10 to 20 ms each
    time; so they wait for the view.
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
        """Stop; the window is painted as any other."""
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
        # Asked for again in a millisecond: Qt takes it for done, and asks for none meanwhile.
        self._held = True
        return True
