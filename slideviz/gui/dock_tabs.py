"""The tabs of docks: a double click makes a dock a window, a right click opens its menu."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Iterable

from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QContextMenuEvent, QMouseEvent
from qtpy.QtWidgets import QDockWidget, QMainWindow, QMenu, QTabBar, QWidget

from slideviz.gui.responsiveness.timers import later

TIP = "Double click: a window of its own. Drag it away to put the panel elsewhere."
"""Tooltip of a tab."""

_DOWN = 24
"""Distance in pixels, left and down, at which a dock appears that is made a window of its own."""


class DockTabs(QObject):
    """Watches the tab bars that Qt makes for docks: double click, right click, and title bars.

    A double click makes a dock a window of its own; a right click opens its menu. A dock whose
    name is on a tab has no title bar.

    Parameters
    ----------
    window : QMainWindow
    docks : iterable of QDockWidget
    bare : set of QDockWidget
        The docks that have no title bar even without a tab.
    """

    def __init__(
        self, window: QMainWindow, docks: Iterable[QDockWidget], bare: set[QDockWidget]
    ) -> None:
        super().__init__(window)
        self.window, self._bare = window, bare
        self._docks = {dock.windowTitle(): dock for dock in docks}
        for dock in self._docks.values():
            for change in (dock.dockLocationChanged, dock.topLevelChanged, dock.visibilityChanged):
                change.connect(self._soon)
        self._timer = later(self, self.watch)
        self.watch()

    def _soon(self, _: object = None) -> None:
        # Qt makes its tab bars when it lays the docks out.
        self._timer.start()

    def bars(self) -> list[QTabBar]:
        """Return the tab bars that docks have at present."""
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        return [bar for bar in self.window.findChildren(QTabBar, options=direct) if bar.count()]

    def watch(self) -> None:
        """Install the event filter on every tab bar; show a title bar on docks without a tab."""
        for dock in self._docks.values():
            tabbed = bool(self.window.tabifiedDockWidgets(dock))
            self._set_title(dock, dock.isFloating() or not (tabbed or dock in self._bare))
        for bar in self.bars():
            bar.removeEventFilter(self)
            bar.installEventFilter(self)
            for index in range(bar.count()):
                bar.setTabToolTip(index, f"{bar.tabText(index)}\n{TIP}")

    def _set_title(self, dock: QDockWidget, titled: bool) -> None:
        # An empty widget in place of the title bar hides it.
        if (dock.titleBarWidget() is None) != titled:
            dock.setTitleBarWidget(None if titled else QWidget())  # type: ignore[arg-type]

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        twice = event.type() == QEvent.Type.MouseButtonDblClick
        if isinstance(event, QMouseEvent) and twice:
            dock = self._dock_at(watched, event.position().toPoint())
            if dock is not None:
                self.take_out(dock)
        elif isinstance(event, QContextMenuEvent):
            dock = self._dock_at(watched, event.pos())
            if dock is not None:
                self.menu_of(dock).popup(event.globalPos())
        else:
            return False
        return dock is not None

    def _dock_at(self, bar: QObject, where: QPoint) -> QDockWidget | None:
        assert isinstance(bar, QTabBar)
        return self._docks.get(bar.tabText(bar.tabAt(where)))

    def menu_of(self, dock: QDockWidget) -> QMenu:
        """Return the menu of a dock: make it a window of its own, close it."""
        menu = QMenu(self.window)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Own window", lambda: self.take_out(dock))
        menu.addAction("Close", dock.close)
        return menu

    def take_out(self, dock: QDockWidget) -> None:
        """Make a dock a window of its own, near its old place, of the same size."""
        size, at = dock.size(), dock.mapToGlobal(QPoint(-_DOWN, _DOWN))
        for other in self.window.tabifiedDockWidgets(dock):
            # A dock behind another tab keeps an old size.
            size = size.expandedTo(other.size())
        dock.setFloating(True)
        dock.resize(size)
        dock.move(at)
        dock.raise_()
