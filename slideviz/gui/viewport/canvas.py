"""The 3D view: VTK in a Qt widget, with clicks, wheel and camera keys that belong to slideviz."""

from __future__ import annotations

import contextlib
from itertools import chain

import numpy as np
import pyvista as pv
from pyvistaqt import QtInteractor
from qtpy.QtCore import QCoreApplication, QEvent, QObject, QPoint, Qt, QTimer, Signal
from qtpy.QtGui import QContextMenuEvent, QKeyEvent, QMouseEvent, QResizeEvent, QWheelEvent
from qtpy.QtWidgets import QApplication, QWidget
from vtkmodules.vtkRenderingCore import vtkProp

from slideviz.gui.responsiveness.timers import REPAINT_MS, single_shot
from slideviz.session.pieces import PART_CELLS, actor_groups


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
        self._timer = single_shot(self, self._paint, REPAINT_MS)

    def request(self) -> None:
        """Schedule a repaint."""
        window = self._view.window()
        if window is not self._window:
            self._release_updates()
            window.installEventFilter(self)
            self._window = window
        if not self._timer.isActive():
            self._timer.start()

    def end(self) -> None:
        """Stop delaying repaints of the window."""
        self._timer.stop()
        self._release_updates()

    def _paint(self) -> None:
        self._view.update()
        self._release_updates()

    def _release_updates(self) -> None:
        if self._held and self._window is not None:
            self._held = False
            QCoreApplication.postEvent(self._window, QEvent(QEvent.Type.UpdateRequest))

    def eventFilter(self, _window: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.UpdateRequest or not self._timer.isActive():
            return False
        # The event is filtered out and posted again by `_release_updates`: Qt takes it for handled.
        self._held = True
        return True


ONE_LIGHT = 0.95  # the intensity of the one light that replaces pyvista's five


def one_light() -> pv.Light:
    """Return a light that goes with the camera and shades faces much as pyvista's five do."""
    light = pv.Light(light_type="camera light", intensity=ONE_LIGHT)
    light.position = (0.1, 0.35, 0.93)
    return light


class ViewSignals(QObject):
    """The signals of a `View3D`, in an object of their own: the view inherits hundreds of names."""

    clicked = Signal(QPoint, Qt.KeyboardModifier)
    cell_clicked = Signal(QPoint)
    menu_wanted = Signal(QPoint)
    """`clicked`, `cell_clicked`, `menu_wanted`: a left click, at a position in pixels of the
    widget; a double click or one with Alt, which is about a cell; a right click."""
    zoomed = Signal(QPoint, float)
    """The wheel was turned: the position of the mouse, and the factor to zoom by."""
    resized = Signal()
    unveiled = Signal()
    """`resized`, `unveiled`: the size of the view changed; the last new actor was drawn (see
    `View3D.unveil`)."""
    moving = Signal()
    released = Signal()
    """`moving`, `released`: the mouse or its wheel moves the camera, or a handle; the mouse button
    was released."""


class View3D(QtInteractor):
    """A 3D view: pyvistaqt's widget, repainted only when something changed."""

    def __init__(self, parent: QWidget | None = None, multi_samples: int = 4) -> None:
        super().__init__(parent, auto_update=False, multi_samples=multi_samples)
        # The window takes the dropped files: this widget would read them in its own way.
        self.setAcceptDrops(False)
        self.signals = ViewSignals(self)
        self._pressed: QPoint | None = None
        self.flat = False
        """Whether dragging moves the camera (2D mesh) rather than turns it."""
        self._repaints = RepaintCoalescer(self)
        self._veiled: list[list[vtkProp]] = []
        self._resizing = False
        self.frame_s = 0.0
        """How long the last frame took to draw, in seconds."""
        # Each movement of the mouse would be drawn at once, and then once more by Qt.
        self._Iren.EnableRenderOff()
        event = "RenderEvent"
        wanted = self._drawing_wanted
        self._Iren.AddObserver(event, lambda *_: wanted())  # type: ignore[arg-type]  # a name, too

    def _drawing_wanted(self) -> None:
        if not self._in_paint:
            self.render()

    def render(self) -> None:  # type: ignore[override]  # pyvista's, not Qt's
        """Schedule one repaint; pyvista calls this after almost every change of the scene."""
        if hasattr(self, "_repaints") and not self._closed:
            self._rendered = True
            self._repaints.request()

    render_soon = render

    def unveil(self) -> None:
        """Show the scene's actors a portion at a time, one more in each turn of the event loop.

        The upload of a large mesh to the graphics card takes longer than drawing it, and the
        window must respond meanwhile.
        """
        while self._veiled:
            self._unveil_next()
        self._veiled = actor_groups(self.renderer.actors.values(), PART_CELLS)[1:]
        self.render()

    @property
    def veiled(self) -> bool:
        """Return whether actors still wait for their first drawing (see `unveil`)."""
        return bool(self._veiled)

    def _unveil_next(self) -> None:
        if not self._veiled:
            return
        for actor in self._veiled.pop(0):
            actor.SetVisibility(True)
        if not self._veiled:
            # Whoever listens updates the scene: the session may hide some of these actors.
            self.signals.unveiled.emit()
        self.render()

    def paintGL(self) -> None:
        if self._resizing:
            return
        # A change of the scene meanwhile may have shown veiled actors.
        for actor in chain(*self._veiled):
            actor.SetVisibility(False)
        self._Iren.EnableRenderOn()
        try:
            super().paintGL()
        finally:
            self._Iren.EnableRenderOff()
        self.frame_s = self.renderer.GetLastRenderTimeInSeconds()
        if self._veiled:
            QTimer.singleShot(0, self._unveil_next)

    def close(self) -> None:  # type: ignore[override]  # pyvista's, not Qt's
        """Release the graphics resources; the view is never painted again."""
        # Qt may have destroyed the repaint timer already, with the parent.
        with contextlib.suppress(RuntimeError):
            self._repaints.end()
        super().close()
        # Qt destroys the surface now, but PySide's wrapper keeps its address: a later object at
        # that address, an action for example, would be taken for the surface.
        self._surface = None

    def snapshot(self) -> np.ndarray:
        """Return a screenshot (height, width, 3), drawn now with all actors."""
        while self._veiled:
            self._unveil_next()
        self._render()  # type: ignore[call-arg]  # pyvistaqt's decorator hides it
        return np.asarray(self.screenshot(return_img=True))

    def reduce_effects(self) -> None:
        """Switch off costly effects if OpenGL draws in software, without a graphics card.

        They are antialiasing, order-independent transparency, and four of five lights.
        """
        drawn_by = self.render_window.ReportCapabilities().lower()
        if not any(name in drawn_by for name in ("llvmpipe", "softpipe", "swrast")):
            return
        self.render_window.SetMultiSamples(0)
        self.renderer.SetUseOIT(False)
        if len(self.renderer.lights) > 1:
            self.renderer.remove_all_lights()
            self.renderer.add_light(one_light())

    def set_flat(self, flat: bool) -> None:
        """Set what dragging does: move the camera (2D mesh) or turn it (3D mesh)."""
        self.flat = flat
        self.enable_custom_trackball_style(  # type: ignore[call-arg]  # the decorator loses self
            left="pan" if flat else "rotate", shift_left="pan"
        )

    # Keys belong to the window's actions, not to VTK's w, s, r, f, p, j, t and 3.
    def keyPressEvent(self, event: QKeyEvent) -> None:
        event.ignore()

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        event.ignore()

    # A click is a press and a release at one place; a drag turns the view and picks nothing.
    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = event.position().toPoint()
        if event.button() == Qt.MouseButton.RightButton:
            event.accept()
            return
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        before = self.camera.GetMTime()
        super().mouseMoveEvent(event)
        if event.buttons() and self.camera.GetMTime() != before:
            self.signals.moving.emit()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        where = event.position().toPoint()
        pressed = self._pressed
        self._pressed = None
        still = pressed is not None and (
            (where - pressed).manhattanLength() < QApplication.startDragDistance()
        )
        if event.button() == Qt.MouseButton.RightButton:
            if still:
                self.signals.menu_wanted.emit(where)
            return
        super().mouseReleaseEvent(event)
        self.signals.released.emit()
        if not still or event.button() != Qt.MouseButton.LeftButton:
            return
        if event.modifiers() & Qt.KeyboardModifier.AltModifier:
            self.signals.cell_clicked.emit(where)
        else:
            self.signals.clicked.emit(where, event.modifiers())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        # Not handed on to VTK, for which it would be a press.
        if event.button() == Qt.MouseButton.LeftButton:
            self.signals.cell_clicked.emit(event.position().toPoint())

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        # The menu comes at the button's release, if the mouse stayed: see `menu_wanted`.
        event.accept()

    def wheelEvent(self, event: QWheelEvent) -> None:
        steps = event.angleDelta().y() / 120.0
        if steps:
            self.signals.moving.emit()
            self.signals.zoomed.emit(event.position().toPoint(), 1.2**steps)
        event.accept()

    def resizeEvent(self, event: QResizeEvent) -> None:
        # Qt paints at once, and again when the layout is settled: the sizes in between are not
        # worth a drawing.
        self._resizing = True
        try:
            super().resizeEvent(event)
        finally:
            self._resizing = False
        self.update()
        if hasattr(self, "signals"):
            self.signals.resized.emit()

    def to_pixels(self, where: QPoint) -> tuple[float, float]:
        """Return a position in the widget in VTK's display coordinates.

        They are device pixels from the lower left corner.
        """
        ratio = self.devicePixelRatioF()
        return where.x() * ratio, (self.height() - 1 - where.y()) * ratio
