"""The tabs of docks: a double click takes a dock out, a right click has its menu."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Iterable

from qtpy.QtCore import QEvent, QObject, QPoint, Qt
from qtpy.QtGui import QContextMenuEvent, QMouseEvent
from qtpy.QtWidgets import QDockWidget, QMainWindow, QMenu, QTabBar, QWidget

from slideviz.gui.responsiveness.timers import later

TIP = "Double click: a window of its own. Drag it away to put the panel elsewhere."
_DOWN = 24
"""Pixels below its tab where a panel appears that is taken out."""


class DockTabs(QObject):
    """The tab bars that Qt makes for docks, on which a double click takes a dock out.

    A right click asks what to do with it. A panel that a tab names has no title bar.

    Parameters
    ----------
    window : QMainWindow
    docks : iterable of QDockWidget
    bare : set of QDockWidget
        Those that have no title bar where they are alone, either.
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
        """Return the present tab bars of docks."""
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        return [bar for bar in self.window.findChildren(QTabBar, options=direct) if bar.count()]

    def watch(self) -> None:
        """Watch every tab bar, and give the docks without one their titles."""
        for dock in self._docks.values():
            tabbed = bool(self.window.tabifiedDockWidgets(dock))
            self._set_title(dock, dock.isFloating() or not (tabbed or dock in self._bare))
        for bar in self.bars():
            bar.removeEventFilter(self)
            bar.installEventFilter(self)
            for index in range(bar.count()):
                bar.setTabToolTip(index, TIP)

    def _set_title(self, dock: QDockWidget, titled: bool) -> None:
        # What stands in the place of a title bar hides it.
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
        """Return the menu of a dock: take it out, close it."""
        menu = QMenu(self.window)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Own window", lambda: self.take_out(dock))
        menu.addAction("Close", dock.close)
        return menu

    def take_out(self, dock: QDockWidget) -> None:
        """Make a dock a window of its own, near its old place, of the same size."""
        size, at = dock.size(), dock.mapToGlobal(QPoint(-_DOWN, _DOWN))
        for other in self.window.tabifiedDockWidgets(dock):
            # Behind another tab it may be as small as it was long ago.
            size = size.expandedTo(other.size())
        dock.setFloating(True)
        dock.resize(size)
        dock.move(at)
        dock.raise_()
