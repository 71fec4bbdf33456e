"""The 3D view: VTK in a Qt widget, with clicks, wheel and camera keys that belong to slideviz."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import numpy as np
from pyvistaqt import QtInteractor
from qtpy.QtCore import QObject, QPoint, Qt, QTimer, Signal
from qtpy.QtWidgets import QApplication


class ViewSignals(QObject):
    """What the view tells: a click on a place, a click with the right button.

    Positions are pixels of the widget. They sit in an object of their own because the view
    inherits several hundred names, which new ones must not hide.
    """

    clicked = Signal(QPoint, Qt.KeyboardModifier)
    menu_wanted = Signal(QPoint)
    zoomed = Signal(QPoint, float)
    resized = Signal()


class View3D(QtInteractor):
    """pyvistaqt's widget, painted only when something changed."""

    def __init__(self, parent=None, multi_samples: int = 4) -> None:
        super().__init__(parent, auto_update=False, multi_samples=multi_samples)
        # The window takes the dropped files: this widget would read them in its own way.
        self.setAcceptDrops(False)
        self.told = ViewSignals(self)
        self._pressed: QPoint | None = None
        self.flat = False
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.setInterval(0)
        self._soon.timeout.connect(self.render)

    def render(self) -> None:
        """Schedule one repaint; pyvista calls this everywhere."""
        if not getattr(self, "_closed", True):
            self._rendered = True
            self.update()

    def render_soon(self) -> None:
        """Repaint in the next turn of the event loop.

        Clicks and timers come between what changed the scene and the drawing of it, which takes
        as long again where no graphics card draws.
        """
        self._soon.start()

    def snapshot(self) -> np.ndarray:
        """Return what the view shows now, (height, width, 3)."""
        self._render()
        return np.asarray(self.screenshot(return_img=True))

    def spare_software(self) -> None:
        """Give up smooth edges where no graphics card draws: they take most of the time there."""
        drawn_by = self.render_window.ReportCapabilities().lower()
        if any(name in drawn_by for name in ("llvmpipe", "softpipe", "swrast")):
            self.render_window.SetMultiSamples(0)

    def set_flat(self, flat: bool) -> None:
        """Choose the mouse for a 2D mesh (drag moves it) or a 3D one (drag turns it)."""
        self.flat = flat
        self.enable_custom_trackball_style(left="pan" if flat else "rotate", shift_left="pan")

    # Keys belong to the window's actions, not to VTK's w, s, r, f, p, j, t and 3.
    def keyPressEvent(self, event) -> None:
        event.ignore()

    def keyReleaseEvent(self, event) -> None:
        event.ignore()

    # A click is a press and a release at one place; a drag turns the view and picks nothing.
    def mousePressEvent(self, event) -> None:
        self._pressed = event.position().toPoint()
        if event.button() == Qt.MouseButton.RightButton:
            event.accept()
            return
        super().mousePressEvent(event)

    def mouseReleaseEvent(self, event) -> None:
        where = event.position().toPoint()
        pressed, self._pressed = self._pressed, None
        still = pressed is not None and (
            (where - pressed).manhattanLength() < QApplication.startDragDistance()
        )
        if event.button() == Qt.MouseButton.RightButton:
            if still:
                self.told.menu_wanted.emit(where)
            return
        super().mouseReleaseEvent(event)
        if still and event.button() == Qt.MouseButton.LeftButton:
            self.told.clicked.emit(where, event.modifiers())

    def contextMenuEvent(self, event) -> None:
        event.accept()

    def wheelEvent(self, event) -> None:
        steps = event.angleDelta().y() / 120.0
        if steps:
            self.told.zoomed.emit(event.position().toPoint(), 1.2**steps)
        event.accept()

    def resizeEvent(self, event) -> None:
        super().resizeEvent(event)
        if hasattr(self, "told"):
            self.told.resized.emit()

    def to_pixels(self, where: QPoint) -> tuple[float, float]:
        """Return a position in the widget as VTK counts it: device pixels from the lower left."""
        ratio = self.devicePixelRatioF()
        return where.x() * ratio, (self.height() - 1 - where.y()) * ratio
