"""The Qt model of a table of designs: editable values, and the results beside them."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qtpy.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt
from qtpy.QtGui import QBrush, QColor

from slideviz.design.sweeps.table import NUMBERS, DesignRow
from slideviz.gui.widgets.labels import wrapped
from slideviz.gui.widgets.theme import alarm
from slideviz.session.design_table import DesignTable

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
            shown = role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole)
            name = self.table.columns[section]
            # In two lines: columns are many, and the room is not wide.
            sign = "." if "." in name else "_"
            head, found, part = name.rpartition(sign)
            short = f"{head}{sign.strip('.')}\n{part}" if found else name
            return short if role == Qt.ItemDataRole.DisplayRole else name if shown else None
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
        at, column = index.row(), index.column() - len(self.table.columns)
        row = self.table.results.get(at + 1)
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        if role == Qt.ItemDataRole.ToolTipRole and row is not None:
            return wrapped("\n".join(filter(None, [row.problem, *row.warnings]))) or None
        if column < 0:
            shown = role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole)
            return self.table.rows[at][index.column()] if shown else None
        if role == Qt.ItemDataRole.ForegroundRole and row is not None:
            bad = row.problem or row.inverted
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
