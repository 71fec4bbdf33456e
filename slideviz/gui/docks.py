"""The docks around the view: the table of them, their places, and how they share the room."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

from qtpy.QtCore import QByteArray, QEvent, QObject, QPoint, QRect, QSettings, Qt, QTimer
from qtpy.QtGui import QContextMenuEvent, QMouseEvent
from qtpy.QtWidgets import (
    QApplication,
    QDockWidget,
    QMainWindow,
    QMenu,
    QTabBar,
    QTabWidget,
    QWidget,
)

from slideviz.argument_types import frozen
from slideviz.gui.panels.boundaries import BoundariesPanel
from slideviz.gui.panels.curves import CurvesPanel
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.panels.display import DisplayPanel
from slideviz.gui.panels.histogram import HistogramPanel
from slideviz.gui.panels.limits import LimitsPanel
from slideviz.gui.panels.log import LogPanel
from slideviz.gui.panels.method import MethodPanel
from slideviz.gui.panels.motions import MotionPanel
from slideviz.gui.panels.run import RunPanel
from slideviz.gui.panels.runs import RunsPanel
from slideviz.gui.panels.sections import SectionsPanel
from slideviz.gui.panels.worst import WorstPanel
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.widgets.build import PanelScroll, set_style
from slideviz.gui.widgets.services import Services

TAB_TIP = "Double click: a window of its own. Drag it away to put the panel elsewhere."
"""Tooltip of a tab."""

_DOWN = 24
"""Distance in pixels, left and down, at which a dock appears that is made a window of its own."""


TAB_MARGINS = 24  # space in pixels that the style leaves beside the text of a tab


def _fit_texts(bar: QTabBar) -> None:
    """Leave less space beside the texts of tabs, instead of cutting them, where it is short."""
    metrics = bar.fontMetrics()
    tabs = range(bar.count())
    wide = sum(metrics.horizontalAdvance(bar.tabText(k)) + TAB_MARGINS for k in tabs)
    set_style(bar, "tight", wide > bar.width())


class DockTabs(QObject):
    """Watches the tab bars that Qt makes for docks: double click, right click, and title bars.

    A double click makes a dock a window of its own; a right click opens its menu. A dock whose
    name is on a tab has no title bar. ``bare``: the docks that have no title bar even without a
    tab.
    """

    def __init__(
        self, window: QMainWindow, docks: Iterable[QDockWidget], bare: set[QDockWidget]
    ) -> None:
        super().__init__(window)
        self.window = window
        self._bare = bare
        self._docks = {dock.windowTitle(): dock for dock in docks}
        for dock in self._docks.values():
            for change in (dock.dockLocationChanged, dock.topLevelChanged, dock.visibilityChanged):
                change.connect(self._soon)
        self._timer = single_shot(self, self.watch)
        self.watch()

    def _soon(self, _: object = None) -> None:
        # Qt makes its tab bars when it lays the docks out.
        self._timer.start()

    def bars(self) -> list[QTabBar]:
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        return [bar for bar in self.window.findChildren(QTabBar, options=direct) if bar.count()]

    def watch(self) -> None:
        """Install the event filter on every tab bar; show a title bar on docks without a tab."""
        for dock in self._docks.values():
            tabbed = bool(self.window.tabifiedDockWidgets(dock))
            titled = dock.isFloating() or not (tabbed or dock in self._bare)
            # An empty widget in place of the title bar hides it.
            if (dock.titleBarWidget() is None) != titled:
                dock.setTitleBarWidget(None if titled else QWidget())  # type: ignore[arg-type]
        for bar in self.bars():
            bar.removeEventFilter(self)
            bar.installEventFilter(self)
            for index in range(bar.count()):
                bar.setTabToolTip(index, f"{bar.tabText(index)}\n{TAB_TIP}")
            _fit_texts(bar)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and isinstance(watched, QTabBar):
            _fit_texts(watched)
            return False
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
        menu = QMenu(self.window)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Own window", lambda: self.take_out(dock))
        menu.addAction("Close", dock.close)
        return menu

    def take_out(self, dock: QDockWidget) -> None:
        """Make a dock a window of its own, near its old place, of the same size."""
        size = dock.size()
        at = dock.mapToGlobal(QPoint(-_DOWN, _DOWN))
        for other in self.window.tabifiedDockWidgets(dock):
            # A dock behind another tab keeps an old size.
            size = size.expandedTo(other.size())
        dock.setFloating(True)
        dock.resize(size)
        dock.move(at)
        dock.raise_()


Panel = TypeVar("Panel", bound=QWidget)
Side = Qt.DockWidgetArea
LEFT = Qt.DockWidgetArea.LeftDockWidgetArea
RIGHT = Qt.DockWidgetArea.RightDockWidgetArea
BOTTOM = Qt.DockWidgetArea.BottomDockWidgetArea
LEFT_WIDTH = 356
RIGHT_WIDTH = 316
"""Least initial width in pixels of the docks on each side of a window of `FULL_WIDTH`."""

NARROWEST = {LEFT: 236, RIGHT: 224}  # least width in pixels of the docks on each side
FULL_WIDTH = 1280  # width of a window in pixels below which the initial widths shrink in proportion
LOW_HEIGHT = 600
"""Height of the window in pixels below which the boundaries are a tab beside motion and method."""

TITLE_BAR_HEIGHT = 40  # height in pixels of a screen that is left for the window's title bar
HEIGHTS = {
    LEFT: {"boundaries": 260, "motion": 352, "run": 48},
    RIGHT: {"histogram": 410, "runs": 290},
}
"""Initial height of the docks on each side, relative to one another."""

FIRST = {LEFT: "boundaries", RIGHT: "histogram"}
"""The dock whose width is set for each side before the window is shown."""

SIDE_FRACTION = 0.22  # initial width of each side's docks, relative to the window's


def available_area(window: QWidget) -> QRect:
    """Return the part of the screen that a window may fill so that its title bar is visible too."""
    room = window.screen().availableGeometry()
    # A maximized window has its title bar within this.
    return (
        room
        if window.isMaximized() or window.isFullScreen()
        else room.adjusted(0, 0, 0, -TITLE_BAR_HEIGHT)
    )


@frozen
class DockRow:
    """A row of the table of docks: name, title, area, and the function that makes its panel.

    ``tabbed_with`` names the dock that it is tabbed with; ``tabbed_with_if_low`` is used instead in
    a window of small height. ``untitled``: it has no title bar. ``shown``: it is visible at first.
    """

    name: str
    title: str
    area: Qt.DockWidgetArea
    make: Callable[[Services], QWidget]
    tabbed_with: str = ""
    tabbed_with_if_low: str = ""
    untitled: bool = False
    shown: bool = True


DOCKS: tuple[DockRow, ...] = (
    DockRow("boundaries", "Boundaries", LEFT, BoundariesPanel),
    DockRow("motion", "Motion", LEFT, MotionPanel, tabbed_with_if_low="boundaries"),
    DockRow("method", "Method", LEFT, MethodPanel, "motion"),
    DockRow("run", "Run", LEFT, RunPanel, untitled=True),
    DockRow("histogram", "Histogram", RIGHT, HistogramPanel),
    DockRow("worst", "Worst cells", RIGHT, WorstPanel, "histogram"),
    DockRow("limits", "Limits", RIGHT, LimitsPanel, "histogram"),
    DockRow("curves", "Curves", RIGHT, CurvesPanel, "histogram"),
    DockRow("runs", "Runs", RIGHT, RunsPanel),
    DockRow("sections", "Sections", RIGHT, SectionsPanel, "runs"),
    DockRow("display", "Display", RIGHT, DisplayPanel, "runs"),
    DockRow("designs", "Designs", BOTTOM, DesignsPanel, shown=False),
    DockRow("log", "Log", BOTTOM, lambda _: LogPanel(), shown=False),
)
"""Every dock; ``make`` is called with the window."""


class Docks(QObject):
    """The docks of a window, by name in ``by_name``; their panels in ``panels``."""

    def __init__(self, window: Services) -> None:
        super().__init__(window)
        self.window = window
        self._widths: dict[Side, int] = {}
        self._hidden: QByteArray | None = None
        self._low = False
        window.installEventFilter(self)
        window.setDockOptions(
            QMainWindow.DockOption.AnimatedDocks
            | QMainWindow.DockOption.AllowTabbedDocks
            | QMainWindow.DockOption.GroupedDragging  # a tab can be dragged out of its bar
        )
        window.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QTabWidget.TabPosition.North)
        window.setCorner(Qt.Corner.BottomLeftCorner, LEFT)
        window.setCorner(Qt.Corner.BottomRightCorner, RIGHT)
        self.by_name: dict[str, QDockWidget] = {}
        self.panels: dict[str, QWidget] = {}
        for row in DOCKS:
            self._make(row)
        bare = {self.by_name[row.name] for row in DOCKS if row.untitled}
        self.tabs = DockTabs(window, self.by_name.values(), bare)

    def _make(self, row: DockRow) -> None:
        dock = QDockWidget(row.title, self.window)
        dock.setObjectName(row.title.lower())
        panel = row.make(self.window)
        fixed = row.untitled or panel.findChild(PanelScroll) is not None
        dock.setWidget(panel if fixed else PanelScroll(panel))
        # A window made small and large again must not leave names and fields cut off.
        if row.area != BOTTOM:
            dock.setMinimumWidth(NARROWEST[row.area])
        # Keys must not go to a field in a dock that is hidden behind another tab.
        dock.visibilityChanged.connect(lambda shown: None if shown else _clear_focus(dock))
        self.by_name[row.name] = dock
        self.panels[row.name] = panel

    def panel(self, kind: type[Panel]) -> Panel:
        return next(panel for panel in self.panels.values() if isinstance(panel, kind))

    def save(self, settings: QSettings) -> None:
        """Save the geometry of the window and the layout of the docks in the settings."""
        # Docks hidden together and full screen are not kept for the next start.
        self.show_hidden()
        window = self.window
        window.setWindowState(window.windowState() & ~Qt.WindowState.WindowFullScreen)
        settings.setValue("geometry", window.saveGeometry())
        settings.setValue("state", window.saveState())

    def restore(self, settings: QSettings) -> None:
        """Restore the window's geometry and the docks' layout; the initial one if none is saved."""
        window = self.window
        state = settings.value("state")
        geometry = settings.value("geometry")
        if geometry is not None:
            window.restoreGeometry(geometry)
        self._fit_screen()
        if state is None or not window.restoreState(state):
            self.restore_layout()
            return
        for row in DOCKS:
            dock = self.by_name[row.name]
            if window.dockWidgetArea(dock) == Side.NoDockWidgetArea and not dock.isFloating():
                window.addDockWidget(row.area, dock)  # a dock that an older version did not have
        tabs = window.tabifiedDockWidgets(self.by_name["boundaries"])
        self._low = self.by_name["motion"] in tabs
        # After Qt has laid the docks out.
        QTimer.singleShot(0, self, self.follow)
        QTimer.singleShot(0, self, self._follow_height)

    def _fit_screen(self) -> None:
        """Shrink and move the window so that all of it is on the screen."""
        window = self.window
        room = available_area(self.window)
        window.resize(window.size().boundedTo(room.size()))
        corner = window.pos()
        x = min(max(corner.x(), room.left()), room.right() + 1 - window.width())
        y = min(max(corner.y(), room.top()), room.bottom() + 1 - window.height())
        if (x, y) != (corner.x(), corner.y()):
            window.move(x, y)

    def restore_layout(self) -> None:
        """Put every dock back to its initial place and size."""
        self._arrange()
        self._distribute_space()

    def _tab_neighbour(self, row: DockRow) -> str:
        """Return the name of the dock that a dock is tabbed with at the window's height."""
        return (self._low and row.tabbed_with_if_low) or row.tabbed_with

    def _arrange(self, side: Side | None = None) -> None:
        """Put the docks of a side to their places, as they are shown; or all, as at first."""
        window = self.window
        rows = [row for row in DOCKS if side in (None, row.area)]
        docks = {row: self.by_name[row.name] for row in rows}
        shown = {row: row.shown if side is None else not docks[row].isHidden() for row in rows}
        front = [dock for dock in docks.values() if side is not None and _is_in_front(dock)]
        self._low = window.height() < LOW_HEIGHT
        for dock in docks.values():
            dock.setFloating(False)
            # Without this, Qt leaves orphaned tab bars over the panels.
            window.removeDockWidget(dock)
        for row in rows:
            if self._tab_neighbour(row):
                window.tabifyDockWidget(self.by_name[self._tab_neighbour(row)], docks[row])
            else:
                window.addDockWidget(row.area, docks[row])
            docks[row].setVisible(shown[row])
        for row in rows:
            if not self._tab_neighbour(row) and any(
                self._tab_neighbour(other) == row.name for other in rows
            ):
                docks[row].raise_()
        for dock in front:
            dock.raise_()

    def _distribute_space(self, side: Side | None = None) -> None:
        self._distribute_width()
        for area, heights in HEIGHTS.items():
            rows = [row for row in DOCKS if row.name in heights and not self._tab_neighbour(row)]
            docks = [self.by_name[row.name] for row in rows if side in (None, area)]
            # The room of the boundaries is that of the motions, too, where these are tabs.
            wanted = [heights[row.name] for row in rows]
            wanted[0] += sum(heights.values()) - sum(wanted)
            self.window.resizeDocks(docks, wanted[: len(docks)], Qt.Orientation.Vertical)

    def _follow_height(self) -> None:
        """Make the boundaries a tab in a low window, unless the user has moved these panels."""
        low = self.window.height() < LOW_HEIGHT
        rows = [row for row in DOCKS if row.area == LEFT]
        if low != self._low and all(self._has_initial_place(row, rows) for row in rows):
            self._arrange(LEFT)
            self._distribute_space(LEFT)

    def _has_initial_place(self, row: DockRow, rows: Sequence[DockRow]) -> bool:
        """Return whether a dock has its initial place, among those of its side."""
        window = self.window
        dock = self.by_name[row.name]
        first = {one.name: self._tab_neighbour(one) or one.name for one in rows}
        tab = {name: first[after] for name, after in first.items()}
        beside = {self.by_name[name] for name in tab if tab[name] == tab[row.name]}
        here = window.dockWidgetArea(dock) == row.area and not dock.isFloating()
        return here and {dock, *window.tabifiedDockWidgets(dock)} == beside

    def _usual_widths(self) -> dict[Side, int]:
        """Return the width in pixels that each side has unless the user has changed it."""
        width = self.window.width()
        part = round(SIDE_FRACTION * width)
        wide = min(1.0, width / FULL_WIDTH)
        usual = {LEFT: round(wide * LEFT_WIDTH), RIGHT: round(wide * RIGHT_WIDTH)}
        return {side: max(part, usual[side], least) for side, least in NARROWEST.items()}

    def _distribute_width(self) -> None:
        """Set the width of both sides to their part of the window's width."""
        self._widths = self._usual_widths()
        # Before the window is shown, no dock is in front.
        docks = [self._front_dock(side) or self.by_name[FIRST[side]] for side in self._widths]
        self.window.resizeDocks(docks, list(self._widths.values()), Qt.Orientation.Horizontal)

    def _front_dock(self, side: Side) -> QDockWidget | None:
        """Return a dock of a side that is in front, or None; one behind a tab has an old width."""
        for dock in self.by_name.values():
            here = self.window.dockWidgetArea(dock) == side and not dock.isFloating()
            if here and _is_in_front(dock):
                return dock
        return None

    def follow(self) -> None:
        """Let the sides follow the window's width from now on, if they have their usual width."""
        shares = self._usual_widths()
        self._widths = shares if self._has_widths(shares) else {}

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        """Set the sides' widths when the window is resized, unless the user has changed them."""
        resized = event.type() == QEvent.Type.Resize
        if resized and self._widths and self._has_widths(self._widths):
            QTimer.singleShot(0, self, self._distribute_width)
        if resized:
            QTimer.singleShot(0, self, self._follow_height)
        return False

    def _has_widths(self, widths: Mapping[Side, int]) -> bool:
        seen = {side: self._front_dock(side) for side in widths}
        return all(dock is None or abs(dock.width() - widths[s]) < 4 for s, dock in seen.items())

    def is_behind(self, widget: QWidget | None) -> bool:
        """Return whether a widget is in a dock that another tab hides."""
        if widget is None:
            return False
        docks = (dock for dock in self.by_name.values() if dock.isAncestorOf(widget))
        return any(not _is_in_front(dock) for dock in docks)

    def toggle_all(self) -> None:
        """Hide all docks; if none is visible, show those again that were hidden together."""
        if any(dock.isVisible() for dock in self.by_name.values()):
            self._hidden = self.window.saveState()
            for dock in self.by_name.values():
                dock.hide()
        else:
            self.show_hidden()

    def show_hidden(self) -> None:
        """Show the docks again that `toggle_all` has hidden, unless one is visible already."""
        state = self._hidden
        self._hidden = None
        if state is not None and not any(dock.isVisible() for dock in self.by_name.values()):
            self.window.restoreState(state)

    def toggle(self, name: str) -> None:
        """Hide a dock if it is in front; otherwise bring it to the front."""
        if _is_in_front(self.by_name[name]):
            self.by_name[name].hide()
        else:
            self.bring_to_front(name)

    def bring_next(self, by: int = 1) -> None:
        """Bring the panel after that with the focus to the front, in the order of `DOCKS`."""
        names = [row.name for row in DOCKS if not self.by_name[row.name].isHidden()]
        at = self.window.focusWidget()
        inside = (at is not None and self.by_name[name].isAncestorOf(at) for name in names)
        here = next((k for k, found in enumerate(inside) if found), -1 if by > 0 else 0)
        if names:
            self.bring_to_front(names[(here + by) % len(names)])

    def bring_to_front(self, name: str) -> None:
        """Show a dock in front and give it the keyboard focus, unless one of its fields has it."""
        dock = self.by_name[name]
        dock.show()
        dock.raise_()
        at = self.window.focusWidget()
        if at is None or not dock.isAncestorOf(at):
            self.panels[name].setFocus()


def _is_in_front(dock: QDockWidget) -> bool:
    """Return whether a dock is visible and not behind another tab."""
    return dock.isVisible() and not dock.visibleRegion().isEmpty()


def _clear_focus(dock: QDockWidget) -> None:
    field = QApplication.focusWidget()
    if field is not None and dock.isAncestorOf(field):
        field.clearFocus()
