"""Cells under the mouse: told when it rests, marked by a double click or a click with Alt."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtCore import QEvent, QObject, Qt
from qtpy.QtWidgets import QToolTip

from slideviz.gui.panels.worst import info_text
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.store import Store


class CellHover(QObject):
    """Watches the mouse over one view.

    Parameters
    ----------
    view : View3D
    scene : Scene
        What it draws.
    store : Store
    """

    def __init__(self, view, scene: Scene, store: Store) -> None:
        super().__init__(view)
        self.view, self.scene, self.store = view, scene, store
        view.setMouseTracking(True)
        view.installEventFilter(self)
        view.told.clicked.connect(self._clicked)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.ToolTip:
            self._tell(event)
            return True
        if kind == QEvent.Type.MouseButtonDblClick:
            if event.button() == Qt.MouseButton.LeftButton:
                self.mark(event.position().toPoint())
            return True
        if kind == QEvent.Type.KeyPress and event.key() == Qt.Key.Key_Escape:
            return self._escape()
        return False

    def _clicked(self, where, keys) -> None:
        if keys & Qt.KeyboardModifier.AltModifier:
            self.mark(where)

    def _tell(self, event) -> None:
        cell = self.scene.pick_cell(*self.view.to_pixels(event.pos()))
        if cell is None:
            QToolTip.hideText()
        else:
            QToolTip.showText(event.globalPos(), info_text(self.scene.session, cell), self.view)

    def mark(self, where) -> None:
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
