"""The panel of designs: a table of them, a job that runs them, and a plot of their quality."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from matplotlib.figure import Figure
from qtpy.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSize,
    Qt,
    Signal,
)
from qtpy.QtGui import QBrush, QColor, QMouseEvent
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QSplitter,
    QStackedWidget,
    QTableView,
    QWidget,
)

from slideviz.case.limits import MET
from slideviz.case.model import Case
from slideviz.case.words import counted
from slideviz.design.sweeps.table import NUMBERS, DesignRow, read_designs
from slideviz.errors import CaseError, SlidevizError
from slideviz.gui.responsiveness.timers import ROWS_MS, single_shot
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    ALIGN_RIGHT,
    Choice,
    QuietBar,
    Slot,
    WideLabel,
    hint_label,
    in_column,
    in_row,
    push_button,
    set_style,
    wrapped,
)
from slideviz.gui.widgets.fields import TextField
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import Draw, PlotArea, PlotCanvas
from slideviz.gui.widgets.theme import alarm
from slideviz.mesh.model import Mesh
from slideviz.plots.designs import (
    RESULTS,
    against_designs,
    design_curves,
    failed_designs,
    nearest_design,
)
from slideviz.plots.style import Style
from slideviz.session.design_table import (
    DesignTable,
    column_choices,
    read_table,
    values_of,
    write_results,
)
from slideviz.session.jobs import JobProgress, run_designs
from slideviz.session.run_messages import stopped_words
from slideviz.session.state import Session

Index = QModelIndex | QPersistentModelIndex
SHOWN_RESULTS = {
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
        return len(self.table.columns) + len(SHOWN_RESULTS)

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
        name = list(SHOWN_RESULTS)[section - values]
        if role == Qt.ItemDataRole.DisplayRole:
            return SHOWN_RESULTS[name][0]
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
            return ALIGN_RIGHT
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
            return self._text(row, list(SHOWN_RESULTS)[column])
        return None

    @staticmethod
    def _text(row: DesignRow, name: str) -> str:
        if row.problem:
            return "failed" if name == "min" else "–"
        return format(getattr(row, name), SHOWN_RESULTS[name][1])

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
        self.view = view
        self.hint = hint_label(ABOUT, Qt.AlignmentFlag.AlignTop)
        self.hint.setMargin(6)
        self._stack = QStackedWidget()
        self._stack.addWidget(self.hint)
        self._stack.addWidget(self.view)
        fill = in_row(self.values, self.add, wide=[self.values], spacing=4)
        in_column(self.column, fill, self._stack, wide=[self._stack], spacing=4, on=self)

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


EMPTY = "This plot shows curves of quality: add designs, and run them."
FAILED = "No design has a result yet: all that were run failed."


class DesignCanvas(PlotCanvas):
    """A plot that calls ``picked`` with a click's position, in the figure's pixels from below."""

    picked: Callable[[float, float], None]

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or self.wiped or not self.figure.axes:
            return
        wide, high = self._scale
        at = event.position()
        self.picked(at.x() * wide, (self.height() - at.y()) * high)


class DesignPlot(QWidget):
    """The plot of a result of the designs against a varied number, with choices of both."""

    def __init__(self) -> None:
        super().__init__()
        self.picked: Callable[[int], None] = lambda _: None
        """Called with the number of the design whose point was clicked."""
        self._table = DesignTable()
        self._shown: int | None = None
        self.across = Choice({}, "The number on the horizontal axis of the plot.", "across")
        words = {name: text.partition(" [")[0].capitalize() for name, text in RESULTS.items()}
        self.what = Choice(words, "The result that the plot shows.", "what")
        self.save = push_button(
            "Save plot…",
            "Save the plot as PNG, SVG or PDF.",
            lambda: self.canvas.save("designs"),
            "save_design_plot",
        )
        self.canvas = DesignCanvas(self.drawing)
        self.canvas.picked = self._picked
        self.canvas.setCursor(Qt.CursorShape.PointingHandCursor)
        self.area = PlotArea(self.canvas)
        head = in_row(self.what, self.across, wide=[self.what, self.across], spacing=4)
        in_column(head, self.area, wide=[self.area], spacing=4, on=self)
        for choice in (self.across, self.what):
            choice.chosen.connect(lambda _: self._other_plot())

    # The button that saves it is beside those of the table.

    def show_table(self, table: DesignTable, shown: int | None) -> None:
        """Draw the results of a table; the design ``shown`` has a ring."""
        self.across.offer({name: name for name in table.columns})
        self._table = table
        self._shown = shown
        plotted = table.count_done() > 0
        self.save.setEnabled(plotted)
        self.across.setVisible(len(table.columns) > 1)
        if plotted:
            self.area.plot()
        else:
            self.area.show_text(FAILED if table.results else EMPTY)

    def drawing(self) -> Draw:
        column = self.across.currentData()
        what = self.what.currentData()
        if column is None or not self._table.count_done():
            return lambda _figure, _style: None
        return partial(_draw, self._table, column, what, self._shown)

    def _other_plot(self) -> None:
        self.canvas.wipe()
        self.show_table(self._table, self._shown)

    def _picked(self, x: float, y: float) -> None:
        column = self.across.currentData()
        what = self.what.currentData()
        curves = design_curves(self._table, column, what)
        failed = failed_designs(self._table, column)
        nearest = nearest_design(self.canvas.figure.axes[0], curves, x, y, failed)
        if nearest is not None:
            self.picked(nearest)


def _draw(
    table: DesignTable, column: str, what: str, shown: int | None, figure: Figure, style: Style
) -> None:
    curves = design_curves(table, column, what)
    failed = failed_designs(table, column)
    against_designs(figure.add_subplot(), curves, column, what, shown, style, failed=failed)


class DesignsJob(QObject):
    """The job that runs the designs of a table in a thread.

    ``ended``: called with a sentence, empty if all designs were run, and whether it is an error.
    """

    results_arrived = Signal(list)  # list of Row
    """Results since the last emission: not one by one, as each repaints the whole window."""
    progressed = Signal(str, float)
    """The progress, in words and from 0 to 1."""

    def __init__(self, ended: Callable[[str, bool], None], parent: QObject) -> None:
        super().__init__(parent)
        self._text = ""
        self._fraction = 0.0
        self._rows: list[DesignRow] = []
        self._ended = ended
        self.runner = JobRunner(self)
        self._timer = single_shot(self, self._flush, ROWS_MS)
        self.runner.progressed.connect(self._progressed)
        self.runner.yielded.connect(self._rows_done)
        self.runner.finished.connect(lambda _: self._end(""))
        self.runner.cancelled.connect(lambda: self._end("Stopped; the results are kept."))
        self.runner.failed.connect(lambda error: self._end(str(error), wrong=True))

    def start(self, case: Case, mesh: Mesh, table: DesignTable) -> None:
        self.runner.start(run_designs, case, mesh, table)

    def _progressed(self, doing: JobProgress) -> None:
        self._text = doing.text
        self._fraction = doing.fraction or 0.0
        if not self._timer.isActive():
            self._timer.start()

    def _rows_done(self, rows: list[DesignRow]) -> None:
        self._rows += rows
        if not self._timer.isActive():
            self._timer.start()

    def _flush(self) -> None:
        """Emit the results since the last emission, and the progress."""
        self._timer.stop()
        rows = self._rows
        self._rows = []
        if rows:
            self.results_arrived.emit(rows)
        if self.runner.busy:
            self.progressed.emit(self._text, self._fraction)

    def _end(self, text: str, wrong: bool = False) -> None:
        self._flush()
        self._ended(text, wrong)


def _end_shown(session: Session) -> object:
    run = session.run_shown
    return () if run is None else (run.number, run.end)


RUN = "Run the designs that have no result yet, or failed."


class DesignsPanel(Panel):
    """The table of designs, and their results as curves."""

    changed = Signal()
    """The table or its results have changed."""

    def make(self) -> None:
        self.table = DesignTable()
        self.case: Case | None = None
        """`case`, `mesh`: the case and the mesh that the results were computed with; the session
        may have others."""
        self.mesh: Mesh | None = None
        self.shown: int | None = None
        """The number, from 1, of the design that the user last asked to see."""
        self.written: DesignTable | None = None
        """The table as it was saved last."""
        self._mistakes = ""
        self.job = DesignsJob(self._ended, self)
        self.runner = self.job.runner
        self.rows = DesignRows(self._add)
        self.plot = DesignPlot()
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setObjectName("designs_split")
        for part in (self.rows, self.plot):
            split.addWidget(part)
        split.setChildrenCollapsible(False)
        split.setSizes([1000, 1000])
        in_column(
            split,
            self._make_foot(),
            self.status,
            wide=[split],
            spacing=4,
            on=self,
            margins=(6, 4, 6, 4),
        )
        self.rows.model.edited = self._edited
        self.rows.view.clicked.connect(lambda index: self.show_design(index.row() + 1))
        self.rows.view.activated.connect(lambda index: self.show_design(index.row() + 1))
        self.plot.picked = self._design_clicked
        self.job.results_arrived.connect(self._results_arrived)
        self.job.progressed.connect(self._progressed)
        self.follow(lambda session: session.mesh, self._clear)
        self.follow(lambda session: (session.mesh, session.case))
        self.follow(_end_shown, self._say_shown)

    def sizeHint(self) -> QSize:
        return QSize(600, 330)

    def _make_foot(self) -> QHBoxLayout:
        self.load = push_button(
            "Load…",
            "Read the designs from a CSV file: a header line, and a row for each design.",
            self._load,
        )
        self.remove = push_button("Remove", "Remove the selected designs.", self._remove)
        self.save = push_button(
            "Save table…", "Save designs and results as CSV.", self.save_table, "save_designs"
        )
        self.every = push_button(
            "As steps",
            "Deform the mesh for every design, and show them as the steps of a run: to play them, "
            "or to film and save them (File > Export).",
            self.show_all,
        )
        self.run = push_button("Run", RUN, self.start, "run_designs")
        self.stop = push_button("Stop", "Stop; the results so far are kept.", self.runner.cancel)
        self.bar = QuietBar()
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setFixedWidth(110)
        self.status = WideLabel(lines=3)
        files = (self.every, self.load, self.remove, self.save, self.plot.save)
        return in_row(self.run, self.stop, self.bar, None, *files, spacing=4)

    # State to widgets ------------------------------------------------------------------
    def _clear(self, _session: Session) -> None:
        """Stop and clear the table, as another mesh is shown."""
        self.runner.cancel()
        self.case = self.mesh = self.shown = None
        self.put(DesignTable())
        self._show_status("")

    def sync(self, session: Session) -> None:
        self.rows.show_columns(session.case, session.mesh)
        if self.table.results and not self.runner.busy and not self._with_valid_results().results:
            self._show_status("The settings have changed since: Run computes all designs again.")
        self._sync()

    def _with_valid_results(self) -> DesignTable:
        """Return the table with only those results that are valid for the present case."""
        return self.table.left(self.case, self.session.case)

    def put(self, table: DesignTable) -> None:
        """Show another table; forget the shown design if its values differ there."""
        at = slice((self.shown or 1) - 1, self.shown)
        if table.columns != self.table.columns or table.rows[at] != self.table.rows[at]:
            self.shown = None
        self.table = table
        self._sync()
        self.changed.emit()

    def _sync(self) -> None:
        busy = self.runner.busy
        rows = bool(self.table.rows)
        lacking = self.session.lacks_cells
        opened = self.session.mesh is not None and not lacking
        count = 0 if busy else len(self.table.rows) - len(self._with_valid_results().results)
        self.rows.show_table(self.table, editable=not busy)
        self.plot.show_table(self.table.filled(self.case), self.shown)
        for widget, able in (
            (self.rows.add, opened and not busy),
            (self.load, opened and not busy),
            (self.remove, rows and not busy),
            (self.every, rows and opened),
            (self.run, count > 0 and opened and not busy),
            (self.save, rows),
        ):
            widget.setEnabled(able)
        if lacking:
            self._show_status("This mesh stays in its file: sweep it with `slideviz sweep`.")
        self.run.setText(f"Run {counted(count, 'design')}" if count else "Run")
        done = rows and not count
        self.run.setToolTip("All designs are done with these settings." if done else RUN)
        for part, seen in ((self.bar, busy), (self.stop, busy), (self.run, not busy)):
            part.setVisible(seen)

    def _show_status(self, text: str, wrong: bool = False) -> None:
        self.status.show_text(text)
        set_style(self.status.label, "bad", wrong)

    # What the user does ----------------------------------------------------------------
    @property
    def unsaved(self) -> str:
        """Return a sentence about results that closing would lose; empty if there are none."""
        return self.table.unsaved(self.runner.busy, self.written)

    def _apply(self, change: Callable[[], DesignTable]) -> None:
        """Show the table that ``change`` returns, or the error that it raises."""
        self.services.banner.withdraw(self._mistakes)
        self._mistakes = ""
        try:
            table = change()
        except SlidevizError as error:
            first, *more = map(str, error.messages)
            self._show_status(f"{first} (and {len(more)} more)" if more else first, wrong=True)
            if more:
                self._mistakes = str(error)
                self.services.banner.show_error(error)
            return
        self._show_status(counted(len(table.rows), "design") if table.rows else "")
        if (table.columns, table.rows) != (self.table.columns, self.table.rows):
            self.store.remember("designs", partial(self._restore, self.case), self.table, table)
        self.put(table)

    def _restore(self, case: Case | None, table: DesignTable) -> bool:
        """Show a table again, whose results are for ``case``, with those that came since.

        Returns whether it is shown: not while designs are being run.
        """
        if self.runner.busy:
            self._show_status("The designs are being run: stop that first, then undo.", wrong=True)
            return False
        known = table if case is self.case else table.without_results()
        self.put(known.keeping(self.table))
        self._show_status(counted(len(table.rows), "design") if table.rows else "")
        return True

    def restore(self, table: DesignTable, case: Case | None) -> None:
        """Show the table of a session that was opened, whose results are for ``case``."""
        self.case = case
        self.mesh = self.session.mesh
        self.put(table)

    def _design_clicked(self, number: int) -> None:
        self.rows.view.selectRow(number - 1)
        self.show_design(number)

    def _add(self) -> None:
        name = self.rows.column.currentData()

        def crossed() -> DesignTable:
            values = values_of(self.rows.values.text())
            read_designs(self.session.case, {name: values})
            return self._replacing(self.table.crossed(name, values))

        if name is not None and not self.runner.busy:
            self._apply(crossed)

    def _edited(self, row: int, column: int, text: str) -> None:
        def changed() -> DesignTable:
            read_designs(self.session.case, {self.table.columns[column]: [text]})
            return self.table.with_cell(row, column, text)

        self._apply(changed)

    def _load(self) -> None:
        path = questions.ask_table(self, self.services.files.folder())
        if path is not None:
            self._apply(lambda: self._replacing(read_table(self.session.case, path)))

    def _replacing(self, table: DesignTable) -> DesignTable:
        """Return another table, with the results it shares; this one if the user cancels."""
        table = table.keeping(self.table)
        return table if self._confirm_replacing(table, " Ctrl+Z brings that back.") else self.table

    def _confirm_replacing(self, table: DesignTable, more: str = "") -> bool:
        """Return whether a table may replace this one; asks to save results that would be lost.

        ``more`` is the end of the question.
        """
        lost = self.table.count_done() - table.count_done()
        if lost <= 0 or self.table is self.written:
            return True
        what = f"the results of {lost:,} designs" if lost > 1 else "the result of a design"
        text = f"Save the table of designs first?\nThe next step removes {what}.{more}"
        answer = questions.ask_unsaved(self, text, ["table"])
        return self.save_table() if answer == "table" else answer == "discard"

    def _remove(self) -> None:
        self._apply(lambda: self.table.without(self.rows.selected))

    def save_table(self) -> bool:
        """Ask for a file and save the table there; return whether it was written."""
        default = self.services.files.folder() / f"{self.services.files.stem()}_designs.csv"
        path = questions.ask_save(self, "Save designs and results", default, "Table (*.csv)")
        if path is None:
            return False
        table = self.table  # a question waits, and results come meanwhile
        try:
            write_results(path, table)
        except SlidevizError as error:
            self._show_status(str(error), wrong=True)
            return False
        self.written = table
        self._show_status(f"Saved {path}")
        return True

    def show_design(self, number: int) -> None:
        """Show the mesh of a design, numbered from 1, in the window: deform it as a run there."""
        session = self.session
        row = self.table.results.get(number)
        other = session.mesh is not (self.mesh or session.mesh)
        if session.mesh is None or session.lacks_cells or other:
            return
        case = session.case if row is None or self.case is None else self.case
        if row is not None and row.problem:
            self._show_status(f"Design {number}: {row.problem}", wrong=True)
            return
        try:
            values = self.table.designs()[number - 1]
            (design,) = read_designs(case, [values]).rows
        except CaseError as error:
            self._show_status(str(error), wrong=True)
            return
        if not self.services.running.show_design(design.case, f"design {number}"):
            self._show_status(
                "Another job runs in the window; wait for it, or cancel it.", wrong=True
            )
            return
        self.services.viewing.refit()  # no job ends if the design was shown before
        self.shown = number
        self._show_status(f"Design {number} is being computed.")
        self._say_shown(self.session)
        self._sync()

    def show_all(self) -> None:
        """Show the meshes of all designs that did not fail, as the steps of a run."""
        if self.services.running.runner.busy:
            self._show_status("Another job runs; wait for it, or cancel it.", wrong=True)
            return
        case = self.case if self.table.results and self.case is not None else self.session.case
        failed = {number for number, row in self.table.results.items() if row.problem}
        try:
            rows = read_designs(case, self.table.designs()).rows
        except CaseError as error:
            self._show_status(str(error), wrong=True)
            return
        cases = {row.number: row.case for row in rows if row.number not in failed}
        self.services.running.show_designs(case, cases)

    def _say_shown(self, session: Session) -> None:
        """Say that the design asked for is shown, once it is; or how far its run came."""
        run = session.run_shown
        if run is None or run.panels is None or run.name != f"design {self.shown}":
            return
        name = run.name.capitalize()
        if run.end == "done":
            self._show_status(f"{name} is shown.")
        elif run.end and run.frames:
            self._show_status(f"{stopped_words(run)} Click it again for all of it.", wrong=True)
        elif run.end:
            self._show_status(f"{name} was not computed: its run has no step.", wrong=True)

    # The job ---------------------------------------------------------------------------
    def start(self) -> None:
        session = self.session
        table = self._with_valid_results()
        if self.runner.busy or session.mesh is None or session.lacks_cells:
            return
        if len(table.results) == len(table.rows) or not self._confirm_replacing(table):
            return
        self.case = session.case
        self.mesh = session.mesh
        self.put(table)
        self._show_status("")
        self.job.start(self.case, self.mesh, table)
        self._sync()

    def _results_arrived(self, rows: list[DesignRow]) -> None:
        if self.mesh is self.session.mesh:
            self.put(self.table.with_results(rows))

    def _progressed(self, words: str, fraction: float) -> None:
        self.bar.setValue(round(1000 * fraction))
        self._show_status(words)

    def _ended(self, text: str, wrong: bool) -> None:
        failed = self.table.count_done() < len(self.table.results)
        self._show_status(text or self.table.summary(), wrong or failed)
        self._sync()
