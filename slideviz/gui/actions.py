"""Menus and tool bar of the window, made from the table of commands and kept up to date."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QAction, QActionGroup
from qtpy.QtWidgets import QLabel, QMenu, QMenuBar, QSizePolicy, QToolBar, QWidget

from slideviz.gui.commands import COMMANDS, MENUS
from slideviz.gui.widgets.build import Choice, tool_button
from slideviz.gui.widgets.command import CommandState, Menu, colored_by_value
from slideviz.session import changes
from slideviz.session.colors import not_drawable
from slideviz.session.motions import support_case, support_key, support_words
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.terms import COLOR_BY, SHOWN, labels

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow


class Actions:
    """The actions of the main window."""

    def __init__(self, window: MainWindow) -> None:
        self.window = window
        self.by_name: dict[str, QAction] = {}
        self.menus: dict[str, QMenu] = {}
        self._tables: dict[str, Menu] = {}
        for menu in MENUS:
            self._make(window.menuBar(), menu)
        self.bar = ToolBar(window, self)
        window.addToolBar(self.bar)
        window.store.listen(self._explain_colors)
        window.store.listen(self._explain_support)

    def _make(self, above: QMenu | QMenuBar, table: Menu) -> None:
        menu = self.menus[table.name] = above.addMenu(table.title)
        self._tables[table.name] = table
        menu.menuAction().setStatusTip(table.tip)
        menu.setToolTipsVisible(table.tooltips)
        if table.fill is not None and table.entries:
            table.fill(self.window, menu)
        elif table.fill is not None:
            menu.aboutToShow.connect(partial(table.fill, self.window, menu))
        group = QActionGroup(menu) if table.one_of else None
        for entry in table.entries:
            if entry is None:
                menu.addSeparator()
            elif isinstance(entry, Menu):
                self._make(menu, entry)
            else:
                act = self.by_name[entry.name] = entry.action(self.window)
                menu.addAction(act)
                if group is not None:
                    group.addAction(act)

    def _explain_colors(self, old: Session, new: Session) -> None:
        why = not_drawable(new)
        if why and why != not_drawable(old):
            self.window.show_status(why)

    def _explain_support(self, old: Session, new: Session) -> None:
        """Say the support radius when it is switched on, and when it changes while it is drawn."""
        if new.mesh is None or new.mesh is not old.mesh or "support" not in new.view.drawn:
            return
        before = support_case(old)
        now = support_case(new)
        changed = before is not now and support_key(before, new.mesh) != support_key(now, new.mesh)
        if changed or "support" not in old.view.drawn:
            self.window.show_status(support_words(new))

    def sync(self, now: CommandState) -> None:
        for name, command in COMMANDS.items():
            command.show(self.by_name[name], now)
        for name, table in self._tables.items():
            self.menus[name].setEnabled(table.enabled(now))
        self.bar.sync(now)


class ToolBar(QToolBar):
    """The tool bar: the commands used most, the quantity to color by, and the zone."""

    def __init__(self, window: MainWindow, actions: Actions) -> None:
        super().__init__("Tools")
        self.setObjectName("tools")
        self.setMovable(False)
        self.setIconSize(QSize(20, 20))
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self._actions = actions
        self._add("open", "save_mesh", "save_case", "save_picture")
        self.addSeparator()
        self._add("undo", "redo")
        self.addSeparator()
        self._add_color(window.store)
        self._add_range()
        self._add(*(name for name, term in SHOWN.items() if term.in_bar))
        self.addSeparator()
        self._add("fit", *(name for name, command in COMMANDS.items() if command.short))
        space = QWidget()
        space.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(space)
        self._add_zone(window.files.open_zone)

    def _add(self, *names: str) -> None:
        self.addActions([self._actions.by_name[name] for name in names])

    def _add_color(self, store: Store) -> None:
        self.addWidget(QLabel(" Color by "))
        tip = "What the colors of the view show; the panel Display has their range."
        self.color = Choice(labels(COLOR_BY), tip, "color_by")
        self.color.chosen.connect(lambda value: store.change(changes.set_view, color_by=value))
        self.color.setFixedWidth(self.color.fontMetrics().horizontalAdvance("m" * 16))
        self.addWidget(self.color)

    def _add_range(self) -> None:
        menu = self._actions.menus["colors"]
        self.range = tool_button(
            menu.menuAction().statusTip(), image="colors", menu=menu, name="color_range"
        )
        self.addWidget(self.range)
        self.addSeparator()

    def _add_zone(self, open_zone: Callable[[int], object]) -> None:
        self.zone = Choice({}, "Which zones of the file are open: all, or one.", "zone")
        self.zone.chosen.connect(open_zone)
        self.zone_label = self.addWidget(QLabel(" Zone "))
        self.zone_shown = self.addWidget(self.zone)

    def sync(self, now: CommandState) -> None:
        session: Session = now.session
        mesh = session.mesh
        self.color.setEnabled(mesh is not None)
        self.range.setEnabled(colored_by_value(now))
        self.color.show_value(session.view.color_by)
        zones = mesh.zones if mesh is not None else 1
        one_by_one = {zone: f"{zone} of {zones}" for zone in range(1, zones + 1)}
        self.zone.offer({0: f"all {zones}"} | one_by_one)
        self.zone.show_value((mesh.zone or 0) if mesh is not None else 0)
        for shown in (self.zone_label, self.zone_shown):
            shown.setVisible(zones > 1)
