"""The table of the worst cells: its rows, their order, and the keys."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import numpy as np
from qtpy.QtCore import QAbstractTableModel, QModelIndex, Qt, Signal
from qtpy.QtGui import QBrush, QColor
from qtpy.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from slideviz.view.inspect import WorstCells
from slideviz.view.look import INVERTED_COLOUR

SHORT = {"triangle": "tri", "quadrilateral": "quad", "tetrahedron": "tet", "hexahedron": "hex"}
COLUMNS = ("Cell", "Type", "Quality", "Since", "Position")
CELL, KIND, QUALITY, SINCE, POSITION = range(5)
_RIGHT = int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
_LEFT = int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
ALIGNMENT = (_RIGHT, _LEFT, _RIGHT, int(Qt.AlignmentFlag.AlignCenter), _LEFT)
TIPS = (
    "Number of the cell, from 0 as in an SU2 file",
    "Element type",
    "Quality of the step that is shown",
    "The step at which the cell was at its worst first",
    "Mean of its nodes, in the mesh's length unit",
)


class WorstModel(QAbstractTableModel):
    """The rows of the table, in the order that was asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.worst: WorstCells | None = None
        self.order = np.empty(0, np.int64)
        self._by, self._down = QUALITY, False

    def show(self, worst: WorstCells | None) -> None:
        """Show another list."""
        self.beginResetModel()
        self.worst = worst
        self._arrange()
        self.endResetModel()

    def cell(self, row: int) -> int:
        """Return the cell of a row."""
        return int(self.worst.cells[self.order[row]])

    def row_of(self, cell: int | None) -> int:
        """Return the row of a cell, or -1."""
        if self.worst is None or cell is None:
            return -1
        found = np.flatnonzero(self.worst.cells[self.order] == cell)
        return int(found[0]) if len(found) else -1

    def rowCount(self, parent: QModelIndex | None = None) -> int:
        return len(self.order) if parent is None or not parent.isValid() else 0

    def columnCount(self, _parent: QModelIndex | None = None) -> int:
        return len(COLUMNS)

    def headerData(self, section, orientation, role=Qt.ItemDataRole.DisplayRole):
        if orientation != Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.ToolTipRole:
            return TIPS[section]
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return ALIGNMENT[section]
        return COLUMNS[section] if role == Qt.ItemDataRole.DisplayRole else None

    def data(self, index, role=Qt.ItemDataRole.DisplayRole):
        at = self.order[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return self._text(at, index.column())
        if role == Qt.ItemDataRole.ToolTipRole and index.column() == POSITION:
            return ", ".join(f"{value:.8g}" for value in self.worst.positions[at])
        if role == Qt.ItemDataRole.ForegroundRole and self.worst.inverted[at]:
            return QBrush(QColor(INVERTED_COLOUR)) if index.column() == QUALITY else None
        return ALIGNMENT[index.column()] if role == Qt.ItemDataRole.TextAlignmentRole else None

    def _text(self, at: int, column: int) -> str:
        worst = self.worst
        if column == QUALITY:
            return "inverted" if worst.inverted[at] else f"{worst.values[at]:.4f}"
        if column == POSITION:
            return ", ".join(f"{value:.3g}" for value in worst.positions[at])
        if column == KIND:
            return SHORT.get(worst.kinds[at], worst.kinds[at])
        return str((worst.cells if column == CELL else worst.steps)[at])

    def sort(self, column: int, order=Qt.SortOrder.AscendingOrder) -> None:
        self._by, self._down = column, order == Qt.SortOrder.DescendingOrder
        self.beginResetModel()
        self._arrange()
        self.endResetModel()

    def _arrange(self) -> None:
        """Order the rows; equal ones stay in the order of their quality."""
        if self.worst is None:
            self.order = np.empty(0, np.int64)
            return
        worst = self.worst
        keys = {
            CELL: worst.cells,
            KIND: np.unique(np.array(worst.kinds), return_inverse=True)[1],
            QUALITY: np.arange(len(worst)),
            SINCE: worst.steps,
            POSITION: np.lexsort(worst.positions.T[::-1]).argsort(),
        }
        key = keys[self._by]
        self.order = np.argsort(-key if self._down else key, kind="stable")


class WorstTable(QTableView):
    """A table that tells to which row the keys have gone.

    The current row itself would tell too much: the focus alone makes the first one current.
    """

    gone_to = Signal(int)

    def __init__(self, model: WorstModel) -> None:
        super().__init__()
        self.setObjectName("worst")
        self.setModel(model)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setWordWrap(False)
        # What does not fit is in the tip, and below the table.
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(22)
        self.setToolTip("Click a cell to fly there; again, or Esc, to take the mark away.")
        header = self.horizontalHeader()
        header.setHighlightSections(False)
        header.setStretchLastSection(True)
        header.setMinimumSectionSize(36)
        for section, width in ((CELL, 54), (KIND, 40), (QUALITY, 60), (SINCE, 40)):
            header.resizeSection(section, width)
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        header.setSortIndicator(QUALITY, Qt.SortOrder.AscendingOrder)
        self.setSortingEnabled(True)

    def keyPressEvent(self, event) -> None:
        before = self.currentIndex().row()
        super().keyPressEvent(event)
        row = self.currentIndex().row()
        enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if row >= 0 and (row != before or enter):
            self.gone_to.emit(row)
