"""The panel of limits and walls: what the step must meet, and its layers before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from qtpy.QtCore import QSignalBlocker, QSize, Qt
from qtpy.QtGui import QBrush, QColor
from qtpy.QtWidgets import (
    QHeaderView,
    QLabel,
    QTreeWidget,
    QTreeWidgetItem,
    QTreeWidgetItemIterator,
)

from slideviz.case.limits import LimitResult, read_limits, write_limits
from slideviz.errors import CaseError
from slideviz.gui.widgets.build import (
    ALIGN_RIGHT,
    Fitted,
    hint_label,
    in_column,
    in_row,
    push_button,
    set_style,
    wrapped,
)
from slideviz.gui.widgets.fields import TextField
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import words_label
from slideviz.gui.widgets.theme import alarm
from slideviz.session import changes, walls_table
from slideviz.session.state import Session

NAME = Qt.ItemDataRole.UserRole
"""Item data role of the boundary, or the place of the limit, of a row."""
EXAMPLE = "min > 0.3, inverted = 0"
FIELD_TIP = (
    "What the deformed mesh must meet (LIMITS): names of numbers with >, >=, <, <= or = and a "
    "value, with commas between. `slideviz keys` lists the names."
)
LIMIT_TIPS = (
    "A click marks the cells that fail the limit with rings, and flies to the worst of them.",
    "The number at the step that is shown, or at its worst cell.",
    "How many cells fail.",
)
"""What each column of the list of limits has."""
ROW_HEIGHT = 20  # height of a row in pixels
NAME_MARGINS = 8  # space beside a name in pixels
WALLS = "Walls: worst number of each boundary, at the step that is shown."
NO_WALLS = "No boundary is a wall: all are periodic or internal."


class NamesTree(Fitted, QTreeWidget):
    """A table whose first column, of names, has the rest of its width, but never cuts a name."""

    def fit(self) -> None:
        """Set the width of the first column; where a name needs more, the table scrolls."""
        others = sum(self.columnWidth(column) for column in range(1, self.columnCount()))
        names = QTreeWidgetItemIterator(self)
        least = self.header().sectionSizeHint(0)
        while (item := names.value()) is not None:
            least = max(least, self._name_width(item))
            names += 1
        self.setColumnWidth(0, max(least, self.viewport().width() - others))

    def _name_width(self, item: QTreeWidgetItem) -> int:
        depth = int(self.rootIsDecorated()) + int(item.parent() is not None)
        name = self.fontMetrics().horizontalAdvance(item.text(0))
        return name + depth * self.indentation() + NAME_MARGINS


def _table(name: str, titles: Sequence[str], tips: Sequence[str], decorated: bool) -> NamesTree:
    tree = NamesTree()
    tree.setObjectName(name)
    tree.setHeaderLabels([title.replace(" ", "\n") for title in titles])
    tree.setRootIsDecorated(decorated)
    tree.setIndentation(12)
    tree.setAlternatingRowColors(True)
    tree.setUniformRowHeights(True)
    tree.setAllColumnsShowFocus(True)
    letters = tree.font()
    letters.setPointSizeF(0.9 * letters.pointSizeF())
    tree.setFont(letters)
    header = tree.header()
    header.setFont(letters)
    header.setStretchLastSection(False)
    header.setMinimumSectionSize(32)
    header.setSectionResizeMode(0, QHeaderView.ResizeMode.Fixed)
    header.sectionResized.connect(lambda column, *_: tree.fit() if column else None)
    for column, tip in enumerate(tips):
        tree.headerItem().setToolTip(column, wrapped(tip))
        if column:
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
            tree.headerItem().setTextAlignment(column, ALIGN_RIGHT)
    return tree


def _row(texts: Sequence[str], tip: str, key: object) -> QTreeWidgetItem:
    item = QTreeWidgetItem(list(texts))
    item.setData(0, NAME, key)
    item.setSizeHint(0, QSize(0, ROW_HEIGHT))
    for column in range(len(texts)):
        item.setToolTip(column, wrapped(tip))
        if column:
            item.setTextAlignment(column, ALIGN_RIGHT)
    return item


class LimitsPanel(Panel):
    """The limits of the case, met or not at the step that is shown, and the table of its walls."""

    def make(self) -> None:
        self.field = TextField()
        self.field.setObjectName("limits_text")
        self.field.setPlaceholderText(EXAMPLE)
        self.field.setToolTip(wrapped(FIELD_TIP))
        self.field.editingFinished.connect(self._typed)
        self.problem = QLabel(wordWrap=True)
        set_style(self.problem, "bad", True)
        self.limits = _table("limits", ("Limit", "Now", "Cells"), LIMIT_TIPS, False)
        self.limits.itemClicked.connect(self._limit_clicked)
        self.hint = hint_label(WALLS)
        self.walls = _table("walls", walls_table.COLUMNS, walls_table.TIPS, True)
        self.walls.itemSelectionChanged.connect(self._wall_chosen)
        self.words = words_label()
        self.export = push_button(
            "Export CSV…",
            "Write the walls with smallest, mean and largest of every number, and every digit.",
            self._export,
        )
        field = in_row(QLabel("Limits"), self.field)
        parts = (field, self.problem, self.limits, self.hint, self.walls, self.words)
        buttons = in_row(None, self.export)
        wide = [self.walls, self.words]
        in_column(*parts, buttons, wide=wide, spacing=3, on=self, margins=4)
        self.follow(lambda one: one.case.limits, self._show_text)
        self.follow(lambda one: (one.limit_results, one.checked, one.limit), self._show_limits)
        self.follow(lambda one: (one.frame, one.case.roles, one.mesh), self._show_walls, seen=True)

    # State to widgets ------------------------------------------------------------------
    def _show_text(self, session: Session) -> None:
        text = write_limits(session.case.limits).strip("() ")
        if text != self.field.text():
            self.field.setText(text)
            self.field.setCursorPosition(0)
        self.problem.hide()

    def _show_limits(self, session: Session) -> None:
        """Fill the list of limits; a dash where one is not checked yet."""
        limits = session.case.limits
        results = session.limit_results
        known = {} if not results else {result.limit: result for result in results}
        with QSignalBlocker(self.limits):
            self.limits.clear()
            for limit in limits:
                self.limits.addTopLevelItem(self._limit_row(str(limit), known.get(limit), session))
        self.limits.setVisible(bool(limits) and session.frame is not None)
        rows = self.limits.topLevelItemCount()
        if rows:
            height = self.limits.header().sizeHint().height() + 4
            height += min(rows, 6) * ROW_HEIGHT
            self.limits.setFixedHeight(height)
        self.limits.fit()
        if session.checked is not None and limits and session.checked.problem:
            self.problem.setText(session.checked.problem)
            self.problem.show()

    def _limit_row(
        self, text: str, result: LimitResult | None, session: Session
    ) -> QTreeWidgetItem:
        if result is None:
            return _row((f"   {text}", "…", ""), "It is being checked.", -1)
        place = (session.limit_results or ()).index(result)
        count = f"{len(result.cells):,}" if len(result.cells) else ""
        now = "–" if result.actual != result.actual else f"{result.actual:.5g}"
        sign, word = ("✓", "It is met.") if result.passed else ("✗", "It is not met.")
        item = _row((f"{sign} {text}", now, count), word, place)
        if not result.passed:
            for column in range(3):
                item.setForeground(column, QBrush(QColor(alarm())))
        if session.limit == place:
            letters = item.font(0)
            letters.setBold(True)
            item.setFont(0, letters)
        return item

    def _show_walls(self, session: Session) -> None:
        """Fill the table of walls."""
        frame = session.frame
        known = frame is not None and frame.walls is not None
        for widget in (self.hint, self.walls, self.export):
            widget.setVisible(known)
        self.words.setVisible(not known)
        if not known:
            opened = session.lacks_cells or "The walls of this mesh are not known."
            empty = "Open a mesh first. Then this panel has its limits and walls."
            self.words.setText(empty if session.mesh is None else opened)
            return
        with QSignalBlocker(self.walls):
            self.walls.clear()
            for row in walls_table.wall_rows(session):
                moved = session.view.frame > 0
                texts = (row.name, *(row.after if moved else row.before))
                item = _row(texts, row.tip, row.name)
                self.walls.addTopLevelItem(item)
                if moved:
                    item.addChild(_row(("before", *row.before), row.tip, row.name))
                    item.addChild(_row(("change", *row.change), row.tip, row.name))
                    item.setExpanded(row.layered)
        self.walls.fit()
        self.hint.setText(WALLS if self.walls.topLevelItemCount() else NO_WALLS)

    def take_theme(self, _scheme: object) -> None:
        self._show_limits(self.session)

    # What the user does ----------------------------------------------------------------
    def _typed(self) -> None:
        try:
            limits = read_limits(f"( {self.field.text()} )")
        except CaseError as error:
            self.problem.setText(str(error))
            self.problem.show()
            return
        self.problem.hide()
        if limits != self.session.case.limits:
            self.change(changes.set_case, limits=limits)

    def _limit_clicked(self, item: QTreeWidgetItem) -> None:
        session = self.session
        place = item.data(0, NAME)
        again = place == session.limit
        self.change(replace, limit=None if again or place < 0 else place)
        chosen = self.session.limit_chosen
        if chosen is not None and len(chosen.cells):
            cell = int(chosen.cells[0])
            self.change(changes.mark_cell, cell)
            self.services.viewing.fly_to(cell)

    def _wall_chosen(self) -> None:
        names = {item.data(0, NAME) for item in self.walls.selectedItems()}
        self.change(changes.select, tuple(names))

    def _export(self) -> None:
        rows = walls_table.table_rows(self.session)
        self.export_csv("Export the table of walls", "walls.csv", rows)
