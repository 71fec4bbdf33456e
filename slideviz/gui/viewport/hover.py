"""Cells under the mouse: described where it rests, marked by a click that means a cell."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QHelpEvent, QKeyEvent
from qtpy.QtWidgets import QToolTip

from slideviz.gui.panels.worst import info_text
from slideviz.gui.viewport.canvas import View3D
from slideviz.scene.flat_scene import FlatScene
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.store import Store


class CellHover(QObject):
    """The cell under the mouse, in one view: its tooltip, and its mark.

    Parameters
    ----------
    view : View3D
    scene : Scene
        What it draws.
    store : Store
    """

    def __init__(self, view: View3D, scene: Scene | FlatScene, store: Store) -> None:
        super().__init__(view)
        self.view, self.scene, self.store = view, scene, store
        view.setMouseTracking(True)
        view.installEventFilter(self)
        view.signals.cell_clicked.connect(self.mark)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QHelpEvent) and event.type() == QEvent.Type.ToolTip:
            self._tell(event)
            return True
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress:
            return event.key() == Qt.Key.Key_Escape and self._escape()
        return False

    def _tell(self, event: QHelpEvent) -> None:
        cell = self.scene.pick_cell(*self.view.to_pixels(event.pos()))
        if cell is None:
            QToolTip.hideText()
        else:
            QToolTip.showText(event.globalPos(), info_text(self.scene.session, cell), self.view)

    def mark(self, where: QPoint) -> None:
        """Mark the cell at a place of the view; beside the mesh, or on the marked one: none."""
        cell = self.scene.pick_cell(*self.view.to_pixels(where))
        marked = self.store.session.view.marked
        self.store.change(changes.mark, None if cell == marked else cell)

    def _escape(self) -> bool:
        """Take away the mark, then the choice of cells; tell whether there was any."""
        view = self.store.session.view
        if view.marked is not None:
            self.store.change(changes.mark, None)
        elif view.threshold is not None:
            self.store.change(changes.set_view, threshold=None)
        else:
            return False
        return True
