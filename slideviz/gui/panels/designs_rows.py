"""The view of a table of designs, and the fields by which designs are added."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qtpy.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt
from qtpy.QtGui import QBrush, QColor
from qtpy.QtWidgets import QAbstractItemView, QHeaderView, QStackedWidget, QTableView, QWidget

from slideviz.case.limits import MET
from slideviz.case.model import Case
from slideviz.design.sweeps.table import NUMBERS, DesignRow
from slideviz.gui.widgets.build import (
    Choice,
    Slot,
    hint_label,
    in_column,
    in_row,
    push_button,
    wrapped,
)
from slideviz.gui.widgets.fields import TextField
from slideviz.gui.widgets.theme import alarm
from slideviz.mesh.model import Mesh
from slideviz.session.design_table import DesignTable, column_choices

Index = QModelIndex | QPersistentModelIndex
RESULTS = {
    "min": ("min", ".4f"),
    "mean": ("mean", ".4f"),
    "inverted": ("inverted", ",d"),
    "max_error": ("error", ".1e"),
    "seconds": ("s", ".2f"),
}
"""The results that are shown, by the field of `DesignRow`: column title and number format."""


class DesignsModel(QAbstractTableModel):
    """The model of a table of designs."""

    def __init__(self) -> None:
        super().__init__()
        self.table = DesignTable()
        self.edited: Callable[[int, int, str], None] = lambda *_: None
        """Called with row, column and text, when a value was typed."""
        self.editable = True
        """Whether values can be typed now."""

    def show(self, table: DesignTable) -> None:
        """Show a table; if only its results changed, selection and scroll position stay."""
        same = table.columns == self.table.columns and table.rows == self.table.rows
        if not same:
            self.beginResetModel()
        self.table = table
        if not same:
            self.endResetModel()
        elif table.rows:
            last = self.index(len(table.rows) - 1, self.columnCount() - 1)
            self.dataChanged.emit(self.index(0, 0), last)

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.table.rows)

    def columnCount(self, parent: Index | None = None) -> int:
        if (parent is not None and parent.isValid()) or not self.table.columns:
            return 0
        return len(self.table.columns) + len(RESULTS)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation == Qt.Orientation.Vertical:
            return str(section + 1) if role == Qt.ItemDataRole.DisplayRole else None
        values = len(self.table.columns)
        if section < values:
            name = self.table.columns[section]
            # In two lines: columns are many, and the room is not wide.
            sign = "." if "." in name else "_"
            head, found, part = name.rpartition(sign)
            short = f"{head}{sign.strip('.')}\n{part}" if found else name
            if role == Qt.ItemDataRole.DisplayRole:
                return short
            return name if role == Qt.ItemDataRole.ToolTipRole else None
        name = list(RESULTS)[section - values]
        if role == Qt.ItemDataRole.DisplayRole:
            return RESULTS[name][0]
        return NUMBERS[name][0] if role == Qt.ItemDataRole.ToolTipRole else None

    def flags(self, index: Index) -> Qt.ItemFlag:
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        if self.editable and index.column() < len(self.table.columns):
            flags |= Qt.ItemFlag.ItemIsEditable
        return flags

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        at = index.row()
        column = index.column() - len(self.table.columns)
        row = self.table.results.get(at + 1)
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        if role == Qt.ItemDataRole.ToolTipRole and row is not None:
            missed = f"Not met: {row.limits}" if row.limits.removesuffix(MET) else ""
            return wrapped("\n".join(filter(None, [row.problem, missed, *row.warnings]))) or None
        if column < 0:
            shown = role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole)
            return self.table.rows[at][index.column()] if shown else None
        if role == Qt.ItemDataRole.ForegroundRole and row is not None:
            bad = row.problem or row.inverted or row.limits.removesuffix(MET)
            return QBrush(QColor(alarm())) if bad and column < 3 else None
        if role == Qt.ItemDataRole.DisplayRole and row is not None:
            return self._text(row, list(RESULTS)[column])
        return None

    @staticmethod
    def _text(row: DesignRow, name: str) -> str:
        if row.problem:
            return "failed" if name == "min" else "–"
        return format(getattr(row, name), RESULTS[name][1])

    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        if role != Qt.ItemDataRole.EditRole or index.column() >= len(self.table.columns):
            return False
        if str(value).strip() != self.table.rows[index.row()][index.column()]:
            self.edited(index.row(), index.column(), str(value))
        return True


ABOUT = (
    "Each row is a design: a run with other numbers of the motions, or other settings. Choose a "
    "number, enter its values, and add them. Another number is combined with all designs of the "
    "table, and more values of the same number are added below. A click on a design that was run, "
    "here or in the plot, shows its mesh."
)
RANGE = "-8 to 0 in 9, or 1, 2, 5"  # placeholder of the field for values


class DesignRows(QWidget):
    """The table of designs, and above it the fields for the number that varies and its values.

    ``add``: called when the user clicks “Add” or presses Return.
    """

    def __init__(self, add: Slot) -> None:
        super().__init__()
        self._mesh: Mesh | None = None
        self.column = Choice({}, "What varies: a number of a motion, or a setting.", "column")
        self.values = TextField()
        self.values.setObjectName("values")
        self.values.setPlaceholderText(RANGE)
        self.values.setToolTip("A range, such as -8 to 0 in 9, or values separated by commas.")
        self.column.chosen.connect(lambda _: self.values.clear())
        self.values.returnPressed.connect(add)
        self.add = push_button(
            "Add",
            "Combine each design of the table with each of these values. If the number varies "
            "already, designs with the new values are added below.",
            add,
        )
        self.add.setMaximumWidth(64)
        self.model = DesignsModel()
        self.view = self._make_view()
        self.hint = hint_label(ABOUT, Qt.AlignmentFlag.AlignTop)
        self.hint.setMargin(6)
        self._stack = QStackedWidget()
        self._stack.addWidget(self.hint)
        self._stack.addWidget(self.view)
        fill = in_row(self.values, self.add, wide=[self.values], spacing=4)
        in_column(self.column, fill, self._stack, wide=[self._stack], spacing=4, on=self)

    def _make_view(self) -> QTableView:
        view = QTableView()
        view.setObjectName("designs_table")
        view.setModel(self.model)
        view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        view.setAlternatingRowColors(True)
        view.setWordWrap(False)
        view.setShowGrid(False)
        view.setTabKeyNavigation(False)
        view.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        heads = view.horizontalHeader()
        heads.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        heads.setResizeContentsPrecision(50)
        return view

    def show_columns(self, case: Case, mesh: Mesh | None) -> None:
        """Offer the numbers of a case that can vary; keep a choice unless the mesh is another.

        The first one is the default, not a choice, until values are typed for it.
        """
        edited = self.column.currentIndex() > 0 or bool(self.values.text())
        chosen = self.column.currentData() if edited and mesh is self._mesh else None
        if mesh is not self._mesh:
            self.values.clear()
        self._mesh = mesh
        offered = {} if mesh is None else column_choices(case, mesh.dim)
        self.column.offer({name: f"{name}   (now {value})" for name, value in offered.items()})
        self.column.setCurrentIndex(max(self.column.findData(chosen), 0) if offered else -1)

    def show_table(self, table: DesignTable, editable: bool) -> None:
        if table is not self.model.table:
            self.model.show(table)
        self.model.editable = editable
        self._stack.setCurrentWidget(self.view if table.rows else self.hint)

    @property
    def selected(self) -> set[int]:
        """Return the indices of the selected rows, from 0."""
        return {index.row() for index in self.view.selectionModel().selectedRows()}
