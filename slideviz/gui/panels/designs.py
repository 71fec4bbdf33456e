"""The panel of designs: a table of them, run beside the window, and curves of their quality."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure
from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QMouseEvent
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QSplitter,
    QStackedWidget,
    QTableView,
    QVBoxLayout,
)

from slideviz.case.model import Case
from slideviz.color_scheme import Look
from slideviz.design.sweep_designs import read_designs
from slideviz.design.sweep_row import Row
from slideviz.errors import CaseError, SlidevizError
from slideviz.gui.panels.designs_model import DesignsModel
from slideviz.gui.responsiveness.settings import ROWS_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    QuietBar,
    boxed,
    hint_label,
    in_column,
    in_row,
    push_button,
    set_style,
)
from slideviz.gui.widgets.fields import Choice
from slideviz.gui.widgets.labels import ElidedLabel
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import PlotArea, PlotCanvas, ask_and_write_plot
from slideviz.gui.widgets.plot_image import Draw
from slideviz.gui.widgets.services import Services
from slideviz.mesh.model import Mesh
from slideviz.plots.designs import RESULTS, against_designs, design_curves, nearest_design
from slideviz.plots.style import Style
from slideviz.session.design_table import (
    DesignTable,
    column_choices,
    read_table,
    values_of,
    write_results,
)
from slideviz.session.jobs import Doing
from slideviz.session.jobs_designs import run_designs
from slideviz.session.state import Session

ABOUT = (
    "Each row is a design: a run with other numbers of the motions, or other settings. Choose a "
    "number, give its values, and add them; another number is combined with all that there are. "
    "A click on a design that was run, here or in the plot, shows its mesh."
)
EMPTY = "Here are the curves of quality: give the designs, and run them."
TABLES = "Table (*.csv)"
RANGE = "-8 to 0 in 9, or 1, 2, 5"


class DesignCanvas(PlotCanvas):
    """A plot that hands over the design whose point was clicked."""

    def __init__(self, drawing: Callable[[], Draw]) -> None:
        super().__init__(drawing)
        self.picked: Callable[[float, float], None] = lambda *_: None
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or self.wiped or not self.figure.axes:
            return
        wide, high = self._scale
        at = event.position()
        self.picked(at.x() * wide, (self.height() - at.y()) * high)


class DesignsPanel(Panel):
    """The table of designs, and their results as curves.

    Attributes
    ----------
    table : DesignTable
    case, mesh
        Of the results there are: a change of the session does not change them.
    shown : int or None
        The design whose mesh was asked for last.
    """

    def __init__(self, services: Services) -> None:
        super().__init__(services.store)
        self.services = services
        self.table = DesignTable()
        self.case: Case | None = None
        self.mesh: Mesh | None = None
        self.shown: int | None = None
        self._drawn: tuple[object, object] = (None, None)
        self._news, self._fraction = "", 0.0
        self.runner = JobRunner(self)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setObjectName("designs_split")
        split.addWidget(boxed(self._make_left()))
        split.addWidget(boxed(self._make_right()))
        split.setChildrenCollapsible(False)
        foot = self._make_foot()
        in_column(split, foot, wide=[split], spacing=4, on=self, margins=(6, 4, 6, 4))
        self._arrived: list[Row] = []
        self._soon = later(self, self._take, ROWS_MS)
        self._connect()
        self.follow()

    def sizeHint(self) -> QSize:
        return QSize(600, 330)

    # Parts -----------------------------------------------------------------------------

    def _make_left(self) -> QVBoxLayout:
        self.column = Choice({}, "What varies: a number of a motion, or a setting.", "column")
        self.values = QLineEdit()
        self.values.setObjectName("values")
        self.values.setPlaceholderText(RANGE)
        self.values.setToolTip("A range, as -8 to 0 in 9, or values with commas between them.")
        self.column.chosen.connect(lambda _: self.values.clear())
        self.add = push_button("Add", "Give each design there is each of these values.", self._add)
        self.add.setMaximumWidth(64)
        self.model = DesignsModel()
        self.model.edited = self._edited
        self.view = QTableView()
        self.view.setObjectName("designs_table")
        self.view.setModel(self.model)
        self.view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.view.setAlternatingRowColors(True)
        self.view.setWordWrap(False)
        self.view.setShowGrid(False)
        self.view.setTabKeyNavigation(False)
        self.view.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        heads = self.view.horizontalHeader()
        heads.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        heads.setResizeContentsPrecision(50)
        self.load = push_button(
            "Load…", "Read the designs from a CSV file: a head, and a row for each.", self._load
        )
        self.remove = push_button("Remove", "Remove the selected designs.", self._remove)
        self.save = push_button(
            "Save…", "Save designs and results as a CSV table.", self._save, "save_designs"
        )
        self.hint = hint_label(ABOUT, Qt.AlignmentFlag.AlignTop)
        self.hint.setMargin(6)
        self.left = QStackedWidget()
        self.left.addWidget(self.hint)
        self.left.addWidget(self.view)
        fill = in_row(
            self.column, self.values, self.add, wide=[self.column, self.values], spacing=4
        )
        return in_column(fill, self.left, wide=[self.left], spacing=4)

    def _make_right(self) -> QVBoxLayout:
        self.across = Choice(
            {}, "The number that the plot has along its horizontal axis.", "across"
        )
        words = {name: text.partition(" [")[0].capitalize() for name, text in RESULTS.items()}
        self.what = Choice(words, "The result that the plot shows.", "what")
        self.save_plot = push_button(
            "Save…", "Save the plot as PNG, SVG or PDF.", self._save_plot, "save_design_plot"
        )
        self.save_plot.setMaximumWidth(72)
        self.canvas = DesignCanvas(self.drawing)
        self.canvas.picked = self._picked
        self.area = PlotArea(self.canvas)
        head = in_row(self.what, self.across, self.save_plot, wide=[self.across], spacing=4)
        return in_column(head, self.area, wide=[self.area], spacing=4)

    def _make_foot(self) -> QHBoxLayout:
        self.run = push_button(
            "Run", "Run the designs that have no result yet.", self.start, "run_designs"
        )
        self.stop = push_button(
            "Stop", "Stop; the results that are there stay.", self.runner.cancel
        )
        self.bar = QuietBar()
        self.bar.setObjectName("designs_bar")
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setFixedWidth(110)
        self.said = ElidedLabel()
        self.said.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        files = (self.load, self.save, self.remove)
        return in_row(self.run, self.stop, self.bar, self.said, *files, wide=[self.said], spacing=4)

    def _connect(self) -> None:
        self.values.returnPressed.connect(self._add)
        for choice in (self.across, self.what):
            choice.chosen.connect(lambda _: self._other_plot())
        self.view.clicked.connect(lambda index: self.show_design(index.row() + 1))
        self.view.activated.connect(lambda index: self.show_design(index.row() + 1))
        self.runner.doing.connect(self._doing)
        self.runner.kept.connect(self._came)
        self.runner.finished.connect(lambda _: self._ended(""))
        self.runner.cancelled.connect(lambda: self._ended("Stopped; the results stay."))
        self.runner.failed.connect(lambda error: self._ended(str(error), wrong=True))

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Follow the session: another mesh has other designs, another case other numbers."""
        now = (session.mesh, session.case)
        if now[0] is self._drawn[0] and now[1] is self._drawn[1]:
            return
        if session.mesh is not self._drawn[0]:
            self.runner.cancel()
            self.case = self.mesh = self.shown = None
            self._put(DesignTable())
            self._say("")
        self._drawn = now
        chosen = self.column.currentData()
        self.column.clear()
        if session.mesh is not None:
            for name, value in column_choices(session.case).items():
                self.column.addItem(f"{name}   (now {value})", name)
        self.column.show_value(chosen)
        if self.table.results and self.case != session.case and not self.runner.busy:
            self._say("The settings have changed since: Run does all designs again.")
        self._sync()

    def take_theme(self, look: Look) -> None:
        """Draw the plot in the colours of another theme."""
        self.canvas.set_look(look)

    def _put(self, table: DesignTable) -> None:
        """Show another table."""
        columns = self.table.columns
        self.table = table
        self.model.show(table)
        if table.columns != columns:
            self.across.clear()
            for name in table.columns:
                self.across.addItem(name, name)
        self._sync()

    def _sync(self) -> None:
        busy, rows = self.runner.busy, bool(self.table.rows)
        in_file = self.store.session.in_file
        opened = self.store.session.mesh is not None and not in_file
        self.left.setCurrentWidget(self.view if rows else self.hint)
        self.model.editable = not busy
        for widget, able in (
            (self.add, opened and not busy),
            (self.load, opened and not busy),
            (self.remove, rows and not busy),
            (self.run, rows and opened and not busy),
            (self.stop, busy),
            (self.save, rows),
        ):
            widget.setEnabled(able)
        if in_file:
            self._say("This mesh stays in its file: sweep it with `slideviz sweep`.")
        count = len(self.table.rows)
        self.run.setText(f"Run {count} design{'' if count == 1 else 's'}" if rows else "Run")
        self.bar.setVisible(busy)
        for button in (self.load, self.remove):  # the words about what runs need the room
            button.setVisible(not busy)
        plotted = any(not row.problem for row in self.table.results.values())
        self.save_plot.setEnabled(plotted)
        self.across.setVisible(len(self.table.columns) > 1)
        if plotted:
            self.area.plot()
        else:
            self.area.say(EMPTY)

    def _say(self, text: str, wrong: bool = False) -> None:
        self.said.setText(text)
        self.said.setToolTip(text)
        set_style(self.said, "bad", wrong)

    # Drawing ---------------------------------------------------------------------------

    def drawing(self) -> Draw:
        """Return the function that draws the plot."""
        column, what = self.across.currentData(), self.what.currentData()
        if column is None or not self.table.results:
            return lambda _figure, _style: None
        return partial(_draw, self.table, column, what, self.shown)

    def _other_plot(self) -> None:
        self.canvas.wipe()
        self._sync()

    def _picked(self, x: float, y: float) -> None:
        column, what = self.across.currentData(), self.what.currentData()
        found = nearest_design(
            self.canvas.figure.axes[0], design_curves(self.table, column, what), x, y
        )
        if found is not None:
            self.view.selectRow(found - 1)
            self.show_design(found)

    def _save_plot(self) -> None:
        ask_and_write_plot(self, "Save plot", "designs", self.drawing())

    # What the user does ----------------------------------------------------------------

    def _try(self, change: Callable[[], DesignTable]) -> None:
        """Change the table, or say why that cannot be."""
        try:
            table = change()
        except SlidevizError as error:
            self._say(str(error).splitlines()[0], wrong=True)
            return
        self._say(f"{len(table.rows):,} designs" if table.rows else "")
        self._put(table)

    def _add(self) -> None:
        name = self.column.currentData()

        def crossed() -> DesignTable:
            values = values_of(self.values.text())
            read_designs(self.store.session.case, {name: values})
            return self.table.crossed(name, values)

        if name is not None and not self.runner.busy:
            self._try(crossed)

    def _edited(self, row: int, column: int, text: str) -> None:
        def changed() -> DesignTable:
            name = self.table.columns[column]
            read_designs(self.store.session.case, {name: [text]})
            return self.table.with_cell(row, column, text)

        self._try(changed)

    def _load(self) -> None:
        path = questions.ask_table(self, self.services.files.folder())
        if path is not None:
            self._try(lambda: read_table(self.store.session.case, path))

    def _remove(self) -> None:
        rows = {index.row() for index in self.view.selectionModel().selectedRows()}
        self._try(lambda: self.table.without(rows))

    def _save(self) -> None:
        default = self.services.files.folder() / f"{self.services.files.stem()}_designs.csv"
        path = questions.ask_save(self, "Save designs and results", default, TABLES)
        if path is None:
            return
        try:
            write_results(path, self.table)
        except SlidevizError as error:
            self._say(str(error), wrong=True)
        else:
            self._say(f"Saved {path}")

    def show_design(self, number: int) -> None:
        """Show the mesh of a design in the window; it is deformed once more for that."""
        session = self.store.session
        row = self.table.results.get(number)
        if session.mesh is None or session.mesh is not (self.mesh or session.mesh):
            return
        if session.in_file:
            return  # only its boundary is in memory
        case = session.case if row is None or self.case is None else self.case
        if row is not None and row.problem:
            self._say(f"Design {number}: {row.problem}", wrong=True)
            return
        try:
            values = self.table.designs()[number - 1]
            (design,) = read_designs(case, [values]).rows
        except CaseError as error:
            self._say(str(error), wrong=True)
            return
        if not self.services.show_design(design.case, f"design {number}"):
            self._say("Another job runs in the window; wait for it, or cancel it.", wrong=True)
            return
        self.shown = number
        self._say(f"Design {number} is shown.")
        self._sync()

    # The job ---------------------------------------------------------------------------

    def start(self) -> None:
        """Run the designs that have no result yet, or all again."""
        session = self.store.session
        if self.runner.busy or session.mesh is None or session.in_file or not self.table.rows:
            return
        done = {number: row for number, row in self.table.results.items() if not row.problem}
        table = self.table.without_results()
        if self.case == session.case and len(done) < len(table.rows):
            table = table.with_results(done.values())
        self.case, self.mesh = session.case, session.mesh
        self._put(table)
        self._say("")
        self.runner.start(run_designs, self.case, self.mesh, table)
        self._sync()

    def _doing(self, doing: Doing) -> None:
        self._news, self._fraction = doing.text, doing.fraction or 0.0
        if not self._soon.isActive():
            self._soon.start()

    def _came(self, rows: list[Row]) -> None:
        self._arrived += rows
        if not self._soon.isActive():  # not for each: the whole window is painted for it
            self._soon.start()

    def _take(self) -> None:
        """Show the results that came since the last time."""
        self._soon.stop()
        rows, self._arrived = self._arrived, []
        if rows and self.mesh is self.store.session.mesh:
            self._put(self.table.with_results(rows))
        if self.runner.busy:
            self.bar.setValue(round(1000 * self._fraction))
            self._say(self._news)

    def _ended(self, text: str, wrong: bool = False) -> None:
        self._take()
        failed = [row for row in self.table.results.values() if row.problem]
        bad = sum(row.inverted > 0 for row in self.table.results.values())
        if not text:
            parts = [f"{len(self.table.results):,} designs done"]
            parts += [f"{bad} with inverted cells"] * bool(bad)
            parts += [f"{len(failed)} failed: {failed[0].problem}"] if failed else []
            text = "; ".join(parts)
        self._say(text, wrong or bool(failed))
        self._sync()

    def end(self) -> None:
        """End what runs, without a word: the window closes."""
        self.runner.close()


def _draw(
    table: DesignTable, column: str, what: str, shown: int | None, figure: Figure, style: Style
) -> None:
    """Draw the results of a table against a column."""
    against_designs(
        figure.add_subplot(), design_curves(table, column, what), column, what, shown, style
    )
