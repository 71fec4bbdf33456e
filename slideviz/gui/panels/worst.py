"""The panel of the worst cells of the shown step: a table; a click flies to a cell and marks it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from qtpy.QtCore import QAbstractTableModel, QModelIndex, Qt, Signal
from qtpy.QtGui import (
    QBrush,
    QColor,
    QGuiApplication,
    QKeyEvent,
    QKeySequence,
    QShortcut,
)
from qtpy.QtWidgets import QAbstractItemView, QHeaderView, QLabel, QStackedWidget, QTableView

from slideviz.color_scheme import ColorScheme
from slideviz.errors import ROUNDING, point_words
from slideviz.gui.commands import COMMANDS
from slideviz.gui.widgets.build import (
    ALIGN_LEFT,
    ALIGN_RIGHT,
    Fitted,
    ModelIndex,
    in_column,
    in_row,
    push_button,
)
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import words_label
from slideviz.gui.widgets.theme import alarm
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import Pair
from slideviz.plots.session_plots import shown_measure
from slideviz.session import changes
from slideviz.session.inspect import (
    WorstCells,
    cell_info,
    coordinates,
    decimals,
    measure,
    nearest_boundary,
    table_rows,
    worst_cells,
)
from slideviz.session.motions import machine_pair
from slideviz.session.run_messages import Requirement, to_mend
from slideviz.session.state import Session
from slideviz.terms import COLOR_BY, SIZE_SKEW, ColorBy, Texts

SHORT = {"triangle": "tri", "quadrilateral": "quad", "tetrahedron": "tet", "hexahedron": "hex"}
"""Short names of cell types."""

COLUMNS = ("Cell", "Quality", "Worst\nstep")
CELL, QUALITY, SINCE = range(3)
"""The first columns."""

ARROW = 20
GAP = "\N{NO-BREAK SPACE}"
"""Width of the sort arrow in a header, in pixels, and the space between title and arrow."""

FEWEST = 4  # decimals shown of a quality
MOST = 5
MOST_MORE = 4  # most decimals added to coordinates if the usual ones do not tell cells apart
TIPS = (
    "Number of the cell, from 0 as in an SU2 file",
    "Quality of the step that is shown",
    "The first step at which the cell was at its worst",
)
"""Of the first columns."""


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


def place_texts(names: Sequence[str], places: FloatArray) -> Iterator[list[str]]:
    """Yield the texts (n,) of each column of places (n, d), by their ``names``."""
    digits = place_digits(names, places)
    more = spare_digits(places, digits)
    for column, usual in zip(places.T, digits, strict=True):
        count = usual + more
        if usual < 8:
            # The sum turns -0 into 0.
            yield [f"{round(value, count) + 0.0:.{count}f}" for value in column.tolist()]
        else:  # tiny numbers, in scientific notation
            yield [f"{value:.{3 + count - decimals(column)}g}" for value in column.tolist()]


class Column(NamedTuple):
    """A column of the table."""

    title: str
    tip: str
    alignment: Qt.AlignmentFlag
    texts: list[str]
    """`texts` (n,), `keys` (n,): of each cell, the worst first; and what it is sorted by."""
    keys: np.ndarray


def measure_title(what: ColorBy) -> str:
    """Return the title of the column of values, in two lines if it is long."""
    if what in SIZE_SKEW:
        return COLUMNS[QUALITY]
    words = COLOR_BY[what].label.partition(" (")[0]
    return words.replace(" ", "\n").replace("-", "-\n", len(words) > 12).capitalize()


def columns_of(worst: WorstCells, around: Pair | None) -> list[Column]:
    """Return the columns for worst cells, in cylindrical coordinates about an axis if one is given.

    The first are `CELL`, `QUALITY` and `SINCE`; then come the zone if there are several, the
    coordinates, and the cell type if there are several.
    """
    digits = distinguishing_digits(worst.values[~worst.inverted])
    rated = zip(worst.values.tolist(), worst.inverted, strict=True)
    values = ["inverted" if bad else f"{value:.{digits}f}" for value, bad in rated]
    known_as = worst.known_as
    numbers = [str(number) for number in known_as]
    since = [str(step) for step in worst.steps]
    cell, quality, step = TIPS
    columns = [
        Column(COLUMNS[CELL], cell, ALIGN_RIGHT, numbers, known_as),
        Column(measure_title(worst.measure), quality, ALIGN_RIGHT, values, np.arange(len(worst))),
        Column(COLUMNS[SINCE], step, Qt.AlignmentFlag.AlignCenter, since, worst.steps),
    ]
    if worst.zones:
        zones = [str(zone) for zone in worst.zones]
        tip = "Zone of the mesh, from 1"
        columns.append(
            Column("Zone", tip, Qt.AlignmentFlag.AlignCenter, zones, np.array(worst.zones))
        )
    names, places = coordinates(worst.positions, around)
    for name, place, texts in zip(names, places.T, place_texts(names, places), strict=True):
        tip = f"{name} of the mean of its nodes, in mesh units or degrees"
        columns.append(Column(name, tip, ALIGN_RIGHT, texts, place))
    kinds, keys = np.unique(np.array(worst.kinds), return_inverse=True)
    if len(kinds) > 1:
        short = [SHORT.get(kind, kind) for kind in worst.kinds]
        columns.append(Column("Type", "Element type", ALIGN_LEFT, short, keys))
    return columns


NONE = np.empty(0, np.int64)
EMPTY = [Column(title, "", ALIGN_RIGHT, [], NONE) for title in COLUMNS]
"""The columns without a mesh: the header has its height from them."""


class WorstModel(QAbstractTableModel):
    """The Qt model of the worst cells."""

    def __init__(self) -> None:
        super().__init__()
        self.worst: WorstCells | None = None
        self.extent = 0.0
        """That of the mesh, in its length unit."""
        self.columns = EMPTY
        self.order = NONE
        """(n,): the index in ``worst`` of the cell in each row."""
        self._by = QUALITY
        self._down = False

    def show(self, worst: WorstCells | None, around: Pair | None = None) -> None:
        """Show other worst cells, in cylindrical coordinates about an axis if one is given."""
        self.beginResetModel()
        self.worst = worst
        self.columns = EMPTY if worst is None else columns_of(worst, around)
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
        return len(self.columns)

    @property
    def headers(self) -> Texts:
        return tuple(column.title for column in self.columns)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> object:
        if orientation != Qt.Orientation.Horizontal:
            return None
        column = self.columns[section]
        if role == Qt.ItemDataRole.ToolTipRole:
            return column.tip
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return column.alignment
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        # Qt draws the sort arrow right behind the last letter.
        return column.title + (GAP if section == QUALITY == self._by else "")

    def data(self, index: ModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        at = self.order[index.row()]
        column = self.columns[index.column()]
        if role == Qt.ItemDataRole.DisplayRole:
            return column.texts[at]
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return column.alignment
        worst = self.worst
        if role == Qt.ItemDataRole.ToolTipRole:
            place = worst.positions[at]
            where = point_words(place, self.extent, digits=8)
            return f"{worst.kinds[at]} at {'x, y, z'[: 3 * len(place) - 2]} = {where}"
        alarming = role == Qt.ItemDataRole.ForegroundRole and index.column() == QUALITY
        return QBrush(QColor(alarm())) if alarming and worst.inverted[at] else None

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        self._by = column
        self._down = order == Qt.SortOrder.DescendingOrder
        self.beginResetModel()
        self._sort_rows()
        self.endResetModel()

    def _sort_rows(self) -> None:
        """Sort the rows by the selected column; equal ones stay in the order of their quality."""
        key = self.columns[min(self._by, len(self.columns) - 1)].keys
        self.order = np.argsort(-key if self._down else key, kind="stable")


class WorstTable(Fitted, QTableView):
    """The view of the worst cells."""

    row_activated = Signal(int)
    """The row to which a key moved, or on which Return was pressed. Qt's own signal of the current
    row is emitted too often: the focus alone makes the first row current."""

    def __init__(self, model: WorstModel) -> None:
        super().__init__()
        self.setObjectName("worst")
        self.setTabKeyNavigation(False)  # the tab key goes on to the next panel
        self._titles: Texts = ()
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
        if model.headers != self._titles:
            self._titles = model.headers
            self._given = []
            self._needed = [0] * len(self._titles)
        metrics = self.fontMetrics()
        before = self._needed
        self._needed = []
        for place, column in enumerate(model.columns):
            texts = (*column.texts, *column.title.split())
            room = max(metrics.horizontalAdvance(text) for text in texts)
            # Qt's own size hint is wider than the panel has room for.
            room += 8 + (ARROW if place == QUALITY else 0)
            self._needed.append(max(room, before[place]))
        if self._needed != before:
            self.fit()

    def fit(self) -> None:
        """Spread the spare width over the columns, unless the user has resized one."""
        now = [self.columnWidth(column) for column in range(len(self._needed))]
        # The last column stretches: its width says nothing about the user.
        if not self._needed or (self._given and now[:-1] != self._given[:-1]):
            return
        spare = max(self.viewport().width() - sum(self._needed), 0) // len(self._needed)
        self._given = [needed + spare for needed in self._needed]
        for column, width in enumerate(self._given):
            self.setColumnWidth(column, width)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        before = self.currentIndex().row()
        super().keyPressEvent(event)
        row = self.currentIndex().row()
        enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if row >= 0 and (row != before or enter):
            self.row_activated.emit(row)


class WorstPanel(Panel):
    """The table of the worst cells (`WORST` of them); the marked cell is the current row."""

    def make(self) -> None:
        self._marked: int | None = None
        self._info_key: object = ()
        self.model = WorstModel()
        # The model's signals keep the panel alive: as its child, the model is deleted with it.
        self.model.setParent(self)
        self.table = WorstTable(self.model)
        self.table.row_activated.connect(self._fly_to_row)
        self.table.clicked.connect(self._clicked)
        self.model.modelReset.connect(lambda: self._sync_mark(self.session))
        self.words = words_label()
        self.info = QLabel()
        self.info.setObjectName("cell_info")
        self.info.setWordWrap(True)
        self.info.setTextFormat(Qt.TextFormat.RichText)
        self.info.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.stack = QStackedWidget()
        self.stack.addWidget(self.words)
        self.stack.addWidget(self.table)
        self.back = push_button(
            "Whole mesh",
            "Return to the view before the flight to a cell.",
            # The mark stays: that is how the cell is found in the whole mesh.
            self.services.viewing.fly_back,
        )
        self.export = push_button(
            "Export CSV…",
            "Write the list with every digit as comma-separated values.",
            self._export,
        )
        mend = COMMANDS["repair"]
        self.repair = push_button("Repair", mend.tip, lambda: mend.do(self.services), "repair")
        parts = (self.stack, self.info, in_row(self.back, self.repair, None, self.export))
        in_column(*parts, wide=[self.stack], spacing=3, on=self, margins=4)
        for keys, function in (
            (QKeySequence(Qt.Key.Key_Escape), self.unmark),
            (QKeySequence(QKeySequence.StandardKey.Copy), self.copy_rows),
        ):
            shortcut = QShortcut(keys, self, context=Qt.ShortcutContext.WidgetWithChildrenShortcut)
            shortcut.activated.connect(function)
        self.follow(seen=True)
        self.follow(_listed, self._fill, seen=True, rests=True)

    # State to widgets ------------------------------------------------------------------
    def take_theme(self, _scheme: ColorScheme) -> None:
        self._info_key = ()
        self._sync_mark(self.session)

    def sync(self, session: Session) -> None:
        there = session.frame is not None
        self.stack.setCurrentWidget(self.table if there else self.words)
        for widget in (self.back, self.export):
            widget.setVisible(there)
        self.repair.setVisible(to_mend(session) is not None)
        if not there:
            self.words.setText("Open a mesh first. Then this panel lists its worst cells.")
        self._sync_mark(session)

    def _fill(self, session: Session) -> None:
        """Show the worst cells of the session's step."""
        if session.frame is None:
            self.model.show(None)
            return
        at = session.frames.index(session.frame)
        what = measure(shown_measure(session))
        worst = worst_cells(session.frames, at, what, reference=session.reference)
        title = f"{COLOR_BY[what].axis}, of the step that is shown"
        self.table.horizontalHeader().setToolTip(title)
        self.model.extent = session.frame.mesh.extent
        self.model.show(worst, machine_pair(session))
        self.table.setColumnHidden(SINCE, what not in SIZE_SKEW)  # others are not followed

    def _sync_mark(self, session: Session) -> None:
        """Make the marked cell the current row, and show its facts."""
        cell = session.view.marked_cell
        row = self.model.row_of(cell)
        current = self.table.currentIndex()
        if row != (current.row() if current.isValid() else -1):
            if row >= 0:
                self.table.selectRow(row)
            elif self._marked is not None:  # what is selected to be copied stays
                self.table.clearSelection()
                self.table.setCurrentIndex(QModelIndex())
        self._marked = cell
        frame = session.frame
        cell = cell if frame is not None and frame.has(cell) else None
        self.info.setVisible(cell is not None)
        if cell is not None:
            key = session.frame, cell, machine_pair(session)
            if key != self._info_key:
                # Finding the nearest boundary of a large mesh takes a while.
                self._info_key = key
                self.info.setText(info_text(session, cell))
                self.info.setToolTip(info_text(session, cell, every=True))

    # What the user does ----------------------------------------------------------------
    def _fly_to_row(self, row: int) -> None:
        cell = self.model.cell(row)
        self.change(changes.mark_cell, cell)
        self.services.viewing.fly_to(cell)

    def focus_requirement(self, _missing: Requirement) -> None:
        """Fly to the worst cell of the last step."""
        self.change(changes.show_frame, len(self.session.frames) - 1)
        self._fill(self.session)
        if self.model.worst is not None:
            self._fly_to_row(self.model.row_of(int(self.model.worst.cells[0])))

    def _clicked(self, index: QModelIndex) -> None:
        if self.model.cell(index.row()) == self.session.view.marked_cell:
            self.unmark()
        else:
            self._fly_to_row(index.row())

    def unmark(self) -> None:
        if self.session.view.marked_cell is not None:
            self.change(changes.mark_cell, None)

    def copy_rows(self) -> None:
        """Copy the selected rows (all, if none is) to the clipboard, below the column names."""
        if self.model.worst is None:
            return
        chosen = sorted(index.row() for index in self.table.selectionModel().selectedRows())
        order = self.model.order[chosen] if chosen else self.model.order
        rows = table_rows(self.model.worst)
        lines = [rows[0], *(rows[1 + at] for at in order)]
        QGuiApplication.clipboard().setText("\n".join("\t".join(line) for line in lines) + "\n")

    def _export(self) -> None:
        self._fill(self.session)
        worst = self.model.worst
        if worst is None:
            return
        self.export_csv("Export worst cells", "worst_cells.csv", table_rows(worst))


def _listed(session: Session) -> object:
    """Return what the list of worst cells depends on."""
    what = measure(shown_measure(session))
    return session.frame, session.reference, len(session.frames), what, machine_pair(session)


def info_text(session: Session, cell: int, every: bool = False) -> str:
    """Return the facts of a cell of the shown step, as rich text of a few lines.

    ``every``: list the Jacobian at every corner, not only their range.
    """
    info = cell_info(session.shown_frame, cell)
    least = ROUNDING * session.shown_frame.mesh.extent
    position = np.where(np.abs(info.position) > least, info.position, 0.0)
    red = f" style='color:{alarm()}'" if info.state == "inverted" else ""
    state = "" if info.state == "valid" else f", <span{red}>{info.state}</span>"
    around = machine_pair(session)
    parts = f"size {info.size:.4f}&nbsp; skew {info.skew:.4f}"
    zone = f" of zone {info.zone}" if info.zone is not None else ""
    lines = [
        f"<b>Cell {info.cell}</b>{zone}, {info.kind}{state}",
        f"size-skew <b>{info.size_skew:.4f}</b>&nbsp; {parts}",
        _place_text(position, around),
    ]
    if around is not None:
        lines.append(_place_text(position, None))
    near = nearest_boundary(session.shown_frame.mesh, info.position)
    if near is not None:
        lines.append(f"{near[1]:.4g} from {escape(near[0])}, the nearest boundary")
    ends = f"{info.jacobians.min():.3g} to {info.jacobians.max():.3g}"
    corners = ", ".join(f"{value:.3g}" for value in info.jacobians)
    lines.append(f"corner Jacobians: {corners if every else ends}")
    return "<br>".join(lines)


def _place_text(position: FloatArray, around: Pair | None) -> str:
    names, values = coordinates(position[None], around)
    return "&nbsp; ".join(
        f"{name.removesuffix(' [°]')} {value:.7g}{'°' if '°' in name else ''}"
        for name, value in zip(names, values[0], strict=True)
    )
