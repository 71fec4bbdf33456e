"""The mouse over a view: tooltips and marks of cells, selection and menu of boundaries.

While it moves something whose drawing is slow, boundaries are drawn coarsely.
"""

from __future__ import annotations

from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QHelpEvent, QKeyEvent
from qtpy.QtWidgets import QToolTip

from slideviz.gui.panels.boundaries import boundary_menu
from slideviz.gui.panels.worst import info_text
from slideviz.gui.responsiveness.timers import SLOW_FRAME_S, STILL_MS, single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.scene.flat_scene import FlatScene
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.store import Store


class CoarseWhileMoving(QObject):
    """Switches a slow scene to coarse boundaries while something is moved, and back afterwards.

    The mouse may move the camera or, for example, the handle of a section. ``scene``: the scene
    drawn in the view.
    """

    def __init__(self, view: View3D, scene: Scene) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self._timer = single_shot(self, self._draw_fully, STILL_MS)
        view.signals.moving.connect(self._draw_coarsely)
        view.signals.released.connect(self._draw_fully)

    def _draw_coarsely(self) -> None:
        """Draw coarse boundaries from now on, if the last frame in full detail was slow."""
        if self.view.veiled or not (self.scene.coarse or self.view.frame_s > SLOW_FRAME_S):
            return
        self.scene.draw_coarse(True)
        self._timer.start()

    def _draw_fully(self) -> None:
        self._timer.stop()
        if self.scene.draw_coarse(False):
            self.view.render_soon()


class CellMouse(QObject):
    """The mouse over the cells of one view: shows tooltips, and marks the cell that is clicked.

    ``scene``: what it draws.
    """

    def __init__(self, view: View3D, scene: Scene | FlatScene, store: Store) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self.store = store
        view.setMouseTracking(True)
        view.installEventFilter(self)
        view.signals.cell_clicked.connect(self.mark)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QHelpEvent) and event.type() == QEvent.Type.ToolTip:
            self._show_tooltip(event)
            return True
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress:
            return event.key() == Qt.Key.Key_Escape and self._escape()
        return False

    def _show_tooltip(self, event: QHelpEvent) -> None:
        cell = self.scene.pick_cell(*self.view.to_pixels(event.pos()))
        if cell is None:
            QToolTip.hideText()
        else:
            QToolTip.showText(event.globalPos(), info_text(self.scene.session, cell), self.view)

    def mark(self, where: QPoint) -> None:
        """Mark the cell at a position in the view; clear the mark if there is none, or the same."""
        cell = self.scene.pick_cell(*self.view.to_pixels(where))
        marked = self.store.session.view.marked_cell
        self.store.change(changes.mark_cell, None if cell == marked else cell)

    def _escape(self) -> bool:
        """Remove the mark of a cell, or else the threshold; return whether there was either."""
        view = self.store.session.view
        if view.marked_cell is not None:
            self.store.change(changes.mark_cell, None)
        elif view.threshold is not None:
            self.store.change(changes.set_view, threshold=None)
        else:
            return False
        return True


class BoundaryMouse(QObject):
    """The mouse over the boundaries of one view: a click selects one, a right click opens its menu.

    ``scene``: what it draws.
    """

    def __init__(self, view: View3D, scene: Scene, store: Store) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self.store = store
        view.signals.clicked.connect(self._select)
        view.signals.menu_wanted.connect(self._show_menu)

    def _select(self, where: QPoint, modifiers: Qt.KeyboardModifier) -> None:
        name = self.scene.pick(*self.view.to_pixels(where))
        selected = self.store.session.view.selected
        if modifiers & Qt.KeyboardModifier.ControlModifier and name:
            others = tuple(other for other in selected if other != name)
            self.store.change(changes.select, others if name in selected else (*selected, name))
        else:
            self.store.change(changes.select, (name,) if name else ())

    def _show_menu(self, where: QPoint) -> None:
        if self.store.session.mesh is None:
            return
        name = self.scene.pick(*self.view.to_pixels(where))
        if name is not None and name not in self.store.session.view.selected:
            self.store.change(changes.select, (name,))
        selected = self.store.session.view.selected
        if selected:
            menu = boundary_menu(self.view.window(), self.store, selected)
            menu.popup(self.view.mapToGlobal(where))
