"""The table of the worst cells: its model, which can be sorted, and its view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from qtpy.QtCore import QAbstractTableModel, Qt, Signal
from qtpy.QtGui import QBrush, QColor, QKeyEvent, QResizeEvent
from qtpy.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from slideviz.gui.widgets.labels import ModelIndex
from slideviz.gui.widgets.theme import alarm
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import Pair
from slideviz.session.inspect import WorstCells, coordinates, decimals
from slideviz.terms import COLOR_BY, SIZE_SKEW

SHORT = {"triangle": "tri", "quadrilateral": "quad", "tetrahedron": "tet", "hexahedron": "hex"}
"""Short names of cell types."""

COLUMNS = ("Cell", "Quality", "Worst\nstep")
CELL, QUALITY, SINCE = range(3)
"""The first columns; then come the zone if there are several, the coordinates, and the cell type
if there are several."""

ZONE = "Zone"  # titles of these columns
LAST = "Type"
ARROW = 20
GAP = "\N{NO-BREAK SPACE}"
"""Width of the sort arrow in a header, in pixels, and the space between title and arrow."""

_RIGHT = int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
_LEFT = int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
_MIDDLE = int(Qt.AlignmentFlag.AlignCenter)
FEWEST = 4  # decimals shown of a quality
MOST = 5
MOST_MORE = 4  # most decimals added to coordinates if the usual ones do not tell cells apart
TIPS = {
    CELL: "Number of the cell, from 0 as in an SU2 file",
    QUALITY: "Quality of the step that is shown",
    SINCE: "The first step at which the cell was at its worst",
}


def distinguishing_digits(values: FloatArray) -> int:
    """Return the number of decimals, `FEWEST` to `MOST`, that tell most of values (n,) apart."""
    different = len(np.unique(values.round(MOST)))
    for digits in range(FEWEST, MOST):
        if not len(values) or len(np.unique(values.round(digits))) > 0.5 * different:
            return digits
    return MOST


def place_digits(names: Sequence[str], places: FloatArray) -> list[int]:
    """Return the number of decimals of each column of places (n, d), by their ``names``.

    All lengths have equally many: enough for the smallest, but not many more than for the largest.
    """
    angles = ["°" in name for name in names]
    each = [decimals(column) for column in places.T]
    lengths = [n for n, angle in zip(each, angles, strict=True) if not angle and n]
    length = min(max(lengths), min(lengths) + MOST_MORE) if lengths else 0
    return [min(n, 2) if angle else length for n, angle in zip(each, angles, strict=True)]


def spare_digits(places: FloatArray, digits: Sequence[int]) -> int:
    """Return how many more digits than given tell places (n, d) apart, `MOST_MORE` at most."""
    different = len(np.unique(places, axis=0))
    for more in range(MOST_MORE):
        rounded = [
            column.round(count + more) for column, count in zip(places.T, digits, strict=True)
        ]
        if len(np.unique(np.column_stack(rounded), axis=0)) == different:
            return more
    return MOST_MORE


class WorstModel(QAbstractTableModel):
    """The Qt model of the worst cells."""

    def __init__(self) -> None:
        super().__init__()
        self.worst: WorstCells | None = None
        self.names: tuple[str, ...] = ()
        """Titles of the columns of coordinates."""
        self.places = np.empty((0, 0))
        """(n, d): the coordinates, in mesh units or degrees."""
        self._decimals: list[int] = []
        self._figures: list[int] = []
        self._more = 0
        self._mixed = False
        self._digits = FEWEST
        self.order = np.empty(0, np.int64)
        """(n,): the index in ``worst`` of the cell in each row."""
        self._by = QUALITY
        self._down = False

    def show(self, worst: WorstCells | None, around: Pair | None = None) -> None:
        """Show other worst cells, in cylindrical coordinates about an axis if one is given."""
        self.beginResetModel()
        self.worst = worst
        if worst is not None:
            self.names, self.places = coordinates(worst.positions, around)
            digits = place_digits(self.names, self.places)
            self._more = spare_digits(self.places, digits)
            self._decimals = [count + self._more for count in digits]
            self._figures = [
                3 + count - decimals(column)
                for count, column in zip(self._decimals, self.places.T, strict=True)
            ]
            self._digits = distinguishing_digits(worst.values[~worst.inverted])
            self._mixed = len(set(worst.kinds)) > 1
        self._sort_rows()
        self.endResetModel()

    def cell(self, row: int) -> int:
        return int(self.worst.cells[self.order[row]])

    def row_of(self, cell: int | None) -> int:
        """Return the row of a cell of the mesh; -1 if it is not in the table."""
        if self.worst is None or cell is None:
            return -1
        rows = np.flatnonzero(self.worst.cells[self.order] == cell)
        return int(rows[0]) if len(rows) else -1

    def rowCount(self, parent: ModelIndex | None = None) -> int:
        return len(self.order) if parent is None or not parent.isValid() else 0

    def columnCount(self, _parent: ModelIndex | None = None) -> int:
        return len(self.headers)

    @property
    def headers(self) -> tuple[str, ...]:
        first, _, since = COLUMNS
        zone = (ZONE,) if self._zoned else ()
        last = (LAST,) if self._mixed else ()
        return (first, self._measure, since, *zone, *self.names, *last)

    @property
    def _zoned(self) -> bool:
        return self.worst is not None and bool(self.worst.zones)

    @property
    def _measure(self) -> str:
        """Return the title of the column of values, in two lines if it is long."""
        if self.worst is None or self.worst.measure in SIZE_SKEW:
            return COLUMNS[QUALITY]
        words = COLOR_BY[self.worst.measure].label.partition(" (")[0]
        return words.replace(" ", "\n").replace("-", "-\n", len(words) > 12).capitalize()

    def _alignment(self, column: int) -> int:
        if column == SINCE or self.headers[column] == ZONE:
            return _MIDDLE
        return _LEFT if self.headers[column] == LAST else _RIGHT

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> object:
        if orientation != Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.ToolTipRole:
            place = f"{self.headers[section]} of the mean of its nodes, in mesh units or degrees"
            others = {LAST: "Element type", ZONE: "Zone of the mesh, from 1"}
            return others.get(self.headers[section]) or TIPS.get(section, place)
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return self._alignment(section)
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        # Qt draws the sort arrow right behind the last letter.
        return self.headers[section] + (GAP if section == QUALITY == self._by else "")

    def data(self, index: ModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        at = self.order[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return self._text(at, index.column())
        if role == Qt.ItemDataRole.ToolTipRole:
            where = ", ".join(f"{value:.8g}" for value in self.worst.positions[at])
            return f"{self.worst.kinds[at]} at {'x, y, z'[: 3 * len(self.names) - 2]} = {where}"
        if role == Qt.ItemDataRole.ForegroundRole and self.worst.inverted[at]:
            return QBrush(QColor(alarm())) if index.column() == QUALITY else None
        return (
            self._alignment(index.column()) if role == Qt.ItemDataRole.TextAlignmentRole else None
        )

    def _text(self, at: int, column: int) -> str:
        worst = self.worst
        if column == QUALITY:
            return "inverted" if worst.inverted[at] else f"{worst.values[at]:.{self._digits}f}"
        if column in (CELL, SINCE):
            return str((worst.known_as if column == CELL else worst.steps)[at])
        if self.headers[column] == ZONE:
            return str(worst.zones[at])
        axis = column - len(COLUMNS) - self._zoned
        if axis == len(self.names):
            return SHORT.get(worst.kinds[at], worst.kinds[at])
        value = float(self.places[at, axis])
        digits = self._decimals[axis]
        # The sum turns -0 into 0; a column of tiny numbers is shown in scientific notation.
        if digits - self._more < 8:
            return f"{round(value, digits) + 0.0:.{digits}f}"
        return f"{value:.{self._figures[axis]}g}"

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        self._by = column
        self._down = order == Qt.SortOrder.DescendingOrder
        self.beginResetModel()
        self._sort_rows()
        self.endResetModel()

    def _sort_rows(self) -> None:
        """Sort the rows by the selected column; equal ones stay in the order of their quality."""
        if self.worst is None:
            self.order = np.empty(0, np.int64)
            return
        worst = self.worst
        zones = [np.array(worst.zones)] if self._zoned else []
        kinds = np.unique(np.array(worst.kinds), return_inverse=True)[1]
        # In the order of `headers`.
        keys = [worst.known_as, np.arange(len(worst)), worst.steps, *zones, *self.places.T, kinds]
        key = keys[min(self._by, len(keys) - 1)]
        self.order = np.argsort(-key if self._down else key, kind="stable")


class WorstTable(QTableView):
    """The view of the worst cells."""

    row_activated = Signal(int)
    """The row to which a key moved, or on which Return was pressed. Qt's own signal of the current
    row is emitted too often: the focus alone makes the first row current."""

    def __init__(self, model: WorstModel) -> None:
        super().__init__()
        self.setObjectName("worst")
        self.setTabKeyNavigation(False)  # the tab key goes on to the next panel
        self._shared: tuple[str, ...] = ()
        self._needed: list[int] = []
        self._given: list[int] = []
        self.setModel(model)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setWordWrap(False)
        letters = self.font()
        letters.setPointSizeF(0.9 * letters.pointSizeF())
        self.setFont(letters)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(22)
        self.setToolTip(
            "Click a cell to fly there. Click it again, or press Esc, to remove the mark."
        )
        header = self.horizontalHeader()
        header.setHighlightSections(False)
        header.setFont(letters)
        header.setStretchLastSection(True)
        header.setMinimumSectionSize(32)
        model.modelReset.connect(self._measure_columns)
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        header.setSortIndicator(QUALITY, Qt.SortOrder.AscendingOrder)
        self.setSortingEnabled(True)

    def _measure_columns(self) -> None:
        """Measure the width that each column needs; it never shrinks for the same columns."""
        model = self.model()
        assert isinstance(model, WorstModel)
        if not model.rowCount():
            return
        if model.headers != self._shared:
            self._shared = model.headers
            self._given = []
            self._needed = [0] * len(self._shared)
        metrics = self.fontMetrics()
        rows = range(model.rowCount())
        before = self._needed
        self._needed = []
        for column, words in enumerate(self._shared):
            texts = [model.index(row, column).data() for row in rows]
            room = max(metrics.horizontalAdvance(text) for text in (*texts, *words.split()))
            # Qt's own size hint is wider than the panel has room for.
            room += 8 + (ARROW if column == QUALITY else 0)
            self._needed.append(max(room, before[column]))
        if self._needed != before:
            self._distribute_width()

    def _distribute_width(self) -> None:
        """Spread the spare width over the columns, unless the user has resized one."""
        now = [self.columnWidth(column) for column in range(len(self._needed))]
        # The last column stretches: its width says nothing about the user.
        if not self._needed or (self._given and now[:-1] != self._given[:-1]):
            return
        spare = max(self.viewport().width() - sum(self._needed), 0) // len(self._needed)
        self._given = [needed + spare for needed in self._needed]
        for column, width in enumerate(self._given):
            self.setColumnWidth(column, width)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._distribute_width()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        before = self.currentIndex().row()
        super().keyPressEvent(event)
        row = self.currentIndex().row()
        enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if row >= 0 and (row != before or enter):
            self.row_activated.emit(row)
