"""The boundaries panel: a row per marker with visibility, elements and role, below its zone."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from qtpy.QtCore import QItemSelectionModel, QPoint, QSignalBlocker, Qt, Signal
from qtpy.QtGui import QAction, QBrush, QContextMenuEvent, QKeyEvent
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QMenu,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from slideviz.gui.widgets.build import (
    ALIGN_LEFT,
    ALIGN_RIGHT,
    Choice,
    Fitted,
    hint_label,
    in_column,
    in_row,
    push_button,
    wrapped,
)
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.services import main_window
from slideviz.gui.widgets.theme import role_icon
from slideviz.mesh.zones import marker_zones
from slideviz.session import changes
from slideviz.session.run_messages import idle_text
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.terms import ROLES, Texts, labels

NAME = 0  # the columns of the table
COUNT = 1
ROLE = 2
NARROW = 290  # width of the table in pixels below which it has no room for the numbers of elements
ROLE_WIDTH = 136  # of the roles, in pixels
LEAST_ROLE_WIDTH = 112  # in a narrow table


class BoundariesTable(Fitted, QTableWidget):
    """The table of the boundaries; the tab key leaves it instead of going through the cells."""

    menu_wanted = Signal(int, QPoint)
    role_wanted = Signal(int)
    """`menu_wanted`, `role_wanted`: the user asks for the menu of a row, at a position on the
    screen; for the list of its roles (F2, Return, Alt+Down)."""

    def __init__(self) -> None:
        super().__init__(0, 3)
        self.setTabKeyNavigation(False)

    def chosen_row(self) -> int:
        """Return the row a key acts on: the current row if selected, else the first selected."""
        rows = sorted({index.row() for index in self.selectionModel().selectedRows()})
        return rows[0] if rows and self.currentRow() not in rows else self.currentRow()

    def fit(self) -> None:
        """Show names whole: they take the width of the numbers where there is no more room."""
        room = self.viewport().width()
        names = self.sizeHintForColumn(NAME)
        narrow = self.width() < NARROW or names + self.sizeHintForColumn(COUNT) > room - ROLE_WIDTH
        self.setColumnHidden(COUNT, narrow)
        role = LEAST_ROLE_WIDTH if narrow else ROLE_WIDTH
        self.setColumnWidth(ROLE, role)
        count = 0 if narrow else self.columnWidth(COUNT)
        self.setColumnWidth(NAME, max(names, room - role - count))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        if event.reason() == QContextMenuEvent.Reason.Keyboard:
            row = self.chosen_row()
            where = self.visualRect(self.model().index(row, NAME)).center()
        else:
            where = event.pos()
            row = self.rowAt(where.y())
        if row >= 0:
            self.menu_wanted.emit(row, self.viewport().mapToGlobal(where))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key()
        alt = event.modifiers() & Qt.KeyboardModifier.AltModifier
        plain = (Qt.Key.Key_F2, Qt.Key.Key_Return, Qt.Key.Key_Enter)
        row = self.chosen_row()
        if row >= 0 and (key in plain or (alt and key == Qt.Key.Key_Down)):
            self.role_wanted.emit(row)
            return
        super().keyPressEvent(event)


class BoundariesPanel(Panel):
    """The panel of the boundaries' visibility and roles; selected rows are changed together."""

    def make(self) -> None:
        self._rows: tuple[tuple[str, int], ...] = ()  # name of each row and its zone; "" of a zone
        self._choices: list[Choice | None] = []
        self.table = self._make_table()
        self.guess_text = hint_label()
        self.keep = push_button(
            "Keep all",
            "Confirm every guessed role.",
            lambda: self.change(changes.confirm_guesses),
            "keep",
        )
        guesses = in_row(self.guess_text, self.keep, wide=[self.guess_text])
        self.idle_text = hint_label()
        self.idle_text.setToolTip("The panel Method says what they do.")
        parts = (self.table, self.idle_text, guesses)
        in_column(*parts, wide=[self.table], spacing=4, on=self, margins=(6, 6, 6, 4))
        self.setFocusProxy(self.table)
        self.follow()
        # Another mesh, even with the same boundaries, is shown from its first one.
        self.follow(lambda session: session.mesh, lambda _: self.table.scrollToTop())

    def _make_table(self) -> BoundariesTable:
        table = BoundariesTable()
        table.setObjectName("boundaries")
        table.setHorizontalHeaderLabels(["Boundary", "Elements", "Role"])
        table.verticalHeader().hide()
        table.verticalHeader().setDefaultSectionSize(28)
        header = table.horizontalHeader()
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(COUNT, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(ROLE, QHeaderView.ResizeMode.Fixed)
        header.setHighlightSections(False)
        name = table.horizontalHeaderItem(NAME)
        name.setTextAlignment(ALIGN_LEFT)
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setShowGrid(False)
        table.setAlternatingRowColors(True)
        table.setMinimumHeight(90)
        table.itemSelectionChanged.connect(self._selection_changed)
        table.itemChanged.connect(self._item_changed)
        table.menu_wanted.connect(self._menu_wanted)
        table.role_wanted.connect(self._role_wanted)
        return table

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        names = session.mesh.marker_names if session.mesh else ()
        with QSignalBlocker(self.table):
            rows = _rows_of(session)
            if rows != self._rows or len(self._choices) != len(rows):
                self._fill(session, rows)
            elif session.mesh is not None:
                self._count(session)
            for row, (name, _) in enumerate(rows):
                if name:
                    self._sync_row(session, row, name)
                else:
                    hidden = session.view.hidden.issuperset(self._boundaries(row))
                    self._show_checked(self.table.item(row, NAME), not hidden)
            self._sync_selection(session)
        self.idle_text.setText("\n".join(idle_text(session.case)))
        self.idle_text.setVisible(bool(self.idle_text.text()))
        count = len(session.guesses)
        self.keep.setVisible(count > 0)
        self.guess_text.setVisible(count > 0 or (session.mesh is not None and not names))
        guesses = "role is a guess" if count == 1 else "roles are guesses"
        self.guess_text.setText(
            f"{count} {guesses} (marked ?)." if count else "This mesh has no named boundaries."
        )

    def _fill(self, session: Session, rows: tuple[tuple[str, int], ...]) -> None:
        self._rows = rows
        self._choices = []
        self.table.setRowCount(0)
        self.table.clearSpans()
        self.table.setRowCount(len(rows))
        for row, (name, zone) in enumerate(rows):
            item = QTableWidgetItem(name or f"Zone {zone}")
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            self.table.setItem(row, NAME, item)
            if not name:
                font = item.font()
                font.setBold(True)
                item.setFont(font)
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsSelectable)
                item.setToolTip(
                    wrapped("The check mark shows or hides the boundaries of the zone.")
                )
                self.table.setSpan(row, NAME, 1, 3)
                self._choices.append(None)
                continue
            count = QTableWidgetItem()
            count.setTextAlignment(ALIGN_RIGHT)
            self.table.setItem(row, COUNT, count)
            tips = {role: f"{role}: {ROLES[role].tip}" for role in ROLES}
            choice = Choice(labels(ROLES), tips=tips)
            choice.setFrame(False)
            # The tab key goes on to the next panel: F2 opens the roles. A click on one gives the
            # focus to the table: arrows go to other rows, and change no role. With the table as
            # focus proxy, Shift+Tab would go from the view to the table and back, and no farther.
            choice.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            for index, role in enumerate(ROLES):
                choice.setItemIcon(index, role_icon(role))
            choice.chosen.connect(partial(self._role_chosen, name))
            self.table.setCellWidget(row, ROLE, choice)
            self._choices.append(choice)
        self._count(session)
        self.table.fit()

    def _count(self, session: Session) -> None:
        for row, (name, _) in enumerate(self._rows):
            if name:
                text = f"{len(session.mesh.marker(name).cells):,}"
                self.table.item(row, COUNT).setText(text)

    def _sync_row(self, session: Session, row: int, name: str) -> None:
        role = session.role(name)
        guess = session.guesses.get(name)
        item = self.table.item(row, NAME)
        choice = self._choices[row]
        self._show_checked(item, name not in session.view.hidden)
        about = "".join(
            f"\nIt is {each.describe()}." for each in session.mesh.interfaces if each.marker == name
        )
        item.setToolTip(wrapped(f"{name}{about}\nThe check mark shows or hides it in the view."))
        choice.show_value(role)
        for index, each in enumerate(ROLES):
            choice.setItemText(index, f"{each} ?" if guess and each == role else each)
        font = choice.font()
        font.setItalic(guess is not None)
        choice.setFont(font)
        tip = f"{role}: {ROLES[role].tip}."
        if guess:
            tip += f"\nA guess: {guess.reason}. Choose a role, or “Keep all”, to confirm it."
        choice.setToolTip(wrapped(tip))

    def _show_checked(self, item: QTableWidgetItem | None, shown: bool) -> None:
        item.setCheckState(Qt.CheckState.Checked if shown else Qt.CheckState.Unchecked)
        item.setForeground(QBrush() if shown else self.palette().placeholderText())

    def _sync_selection(self, session: Session) -> None:
        wanted = set(session.view.selected)
        if wanted == set(self.selected()):
            return
        model = self.table.selectionModel()
        model.clearSelection()
        flags = QItemSelectionModel.SelectionFlag.Select | QItemSelectionModel.SelectionFlag.Rows
        for row, (name, _) in enumerate(self._rows):
            if name in wanted:
                index = self.table.model().index(row, 0)
                if not model.selectedRows():
                    # The arrow keys start from the current row.
                    model.setCurrentIndex(index, QItemSelectionModel.SelectionFlag.NoUpdate)
                model.select(index, flags)
                self.table.scrollTo(index)

    # Widgets to state ------------------------------------------------------------------
    def selected(self) -> Texts:
        rows = sorted({index.row() for index in self.table.selectionModel().selectedRows()})
        return tuple(self._rows[row][0] for row in rows if self._rows[row][0])

    def _selection_changed(self) -> None:
        self.change(changes.select, self.selected())

    def _item_changed(self, item: QTableWidgetItem) -> None:
        if item.column() != NAME:
            return
        shown = item.checkState() == Qt.CheckState.Checked
        names = self._boundaries(item.row())
        self.change(changes.show_boundaries, names, shown)

    def _role_chosen(self, name: str, role: object) -> None:
        self.change(changes.set_role, self._with_selected(name), role)

    def _role_wanted(self, row: int) -> None:
        if (choice := self._choices[row]) is not None:
            choice.showPopup()

    def _boundaries(self, row: int) -> Texts:
        """Return the boundaries of a row: one, with those selected with it, or all of a zone."""
        name, zone = self._rows[row]
        if name:
            return self._with_selected(name)
        return tuple(name for name, other in self._rows if name and other == zone)

    def _with_selected(self, name: str) -> Texts:
        """Return the selected boundaries if one is among them; else only this one."""
        chosen = self.selected()
        return chosen if name in chosen else (name,)

    def _menu_wanted(self, row: int, where: QPoint) -> None:
        boundary_menu(self, self.store, self._boundaries(row)).popup(where)


def _rows_of(session: Session) -> tuple[tuple[str, int], ...]:
    """Return name and zone of each row: the boundaries, below their zone if there are several."""
    mesh = session.mesh
    if mesh is None:
        return ()
    zones = marker_zones(mesh)
    rows: list[tuple[str, int]] = []
    for name, zone in zip(mesh.marker_names, zones, strict=True):
        if len(mesh.parts) > 1 and (not rows or rows[-1][1] != zone):
            rows.append(("", zone))
        rows.append((name, zone))
    return tuple(rows)


def boundary_menu(parent: QWidget, store: Store, names: Texts) -> QMenu:
    """Return a new menu for the named boundaries: role, visibility. The 3D view shows it too."""
    menu = QMenu(parent)
    menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    menu.setToolTipsVisible(True)
    title = names[0] if len(names) == 1 else f"{len(names)} boundaries"
    menu.addSection(title)
    roles = {store.session.role(name) for name in names}
    for role in ROLES:
        act = QAction(
            role_icon(role),
            f"&{role.capitalize()}",
            menu,
            toolTip=ROLES[role].tip,
            checkable=True,
            checked=roles == {role},
        )
        act.setIconVisibleInMenu(roles != {role})  # in its place there is the check mark
        act.triggered.connect(_slot(store, changes.set_role, names, role))
        menu.addAction(act)
    menu.addSeparator()
    if any(name in store.session.guesses for name in names):
        keep = menu.addAction("&Keep the guess")
        keep.triggered.connect(_slot(store, changes.confirm_guesses, names))
    for text, function, values in (
        ("&Hide", changes.show_boundaries, (names, False)),
        ("Show &only this" if len(names) == 1 else "Show &only these", changes.isolate, (names,)),
        ("Show &all", changes.show_boundaries, (store.session.mesh.marker_names,)),
    ):
        menu.addAction(text).triggered.connect(_slot(store, function, *values))
    window = main_window(parent)
    if window is not None:
        fit = window.viewing.fit
        menu.addAction("Fit to &boundary").triggered.connect(lambda *_: fit(names))
    return menu


def _slot(store: Store, function: Callable[..., Session], *values: object) -> Callable[..., None]:
    """Return a slot that makes a change of the session and ignores the signal's arguments."""
    return lambda *_: store.change(function, *values)
