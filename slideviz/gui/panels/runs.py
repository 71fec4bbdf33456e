"""The runs panel: settings and quality of each run, in a list with two lines for each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from qtpy.QtCore import QAbstractItemModel, QPoint, QSignalBlocker, QSize, Qt, Signal
from qtpy.QtGui import QColor, QIcon, QKeyEvent, QMouseEvent, QPainter, QPalette
from qtpy.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QHeaderView,
    QLineEdit,
    QMenu,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from slideviz.color_scheme import ColorScheme
from slideviz.gui.commands import BY_NAME, RUN_MENU, Command, fill_compare
from slideviz.gui.widgets.build import (
    ALIGN_LEFT,
    ModelIndex,
    TwoPartRow,
    hint_label,
    in_column,
    tool_button,
    wrapped,
)
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.theme import icon
from slideviz.session import changes
from slideviz.session.runs_words import (
    QUALITY_FORMAT,
    best_runs,
    describe_run,
    run_words,
    summary,
    table_rows,
)
from slideviz.session.state import UNDEFORMED, Run, Session
from slideviz.system.csv_table import csv_text

RUN, MIN, MEAN, INVERTED = range(4)  # the columns of the list
NUMBER = Qt.ItemDataRole.UserRole
WORDS = NUMBER + 1
NAME = NUMBER + 2
"""Item data roles of column `RUN`: the run's number (0: the undeformed mesh), the row's second
line, the run's own name."""

PAD = 4  # space around the text of a row, in pixels
TIPS = (
    "Run and name (F2 renames); below: how it differs. Ctrl+click: side by side.",
    "Lowest quality of a cell after the last step; the best of the runs with one motion is bold.",
    "Mean quality of the cells after the last step.",
    "Inverted cells after the last step.",
)


class _FirstLine(QStyledItemDelegate):
    """The delegate that draws an item in the upper half of its row, and edits a run's name."""

    renamed = Signal(int, str)
    """The number of a run, and its new name."""

    def sizeHint(self, option: QStyleOptionViewItem, index: ModelIndex) -> QSize:
        item = QStyleOptionViewItem(option)
        self.initStyleOption(item, index)  # the best is bold, thus wider
        width = item.fontMetrics.horizontalAdvance(item.text) + 2 * PAD + 4
        return QSize(width, 2 * option.fontMetrics.height() + 2 * PAD)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: ModelIndex) -> None:
        item = QStyleOptionViewItem(option)
        self.initStyleOption(item, index)
        element = QStyle.PrimitiveElement.PE_PanelItemViewItem
        item.widget.style().drawPrimitive(element, item, painter, item.widget)
        rect = item.rect.adjusted(PAD, PAD, -PAD, 0)
        rect.setHeight(item.fontMetrics.height())
        painter.save()
        painter.setFont(item.font)
        painter.setPen(text_color(item, QPalette.ColorRole.Text))
        image = index.data(Qt.ItemDataRole.DecorationRole)
        if image is not None and not image.isNull():
            image.paint(painter, rect.right() - 15, rect.top(), 16, rect.height())
            rect.setRight(rect.right() - 18)
        shown = item.fontMetrics.elidedText(item.text, Qt.TextElideMode.ElideRight, rect.width())
        painter.drawText(rect, item.displayAlignment, shown)
        painter.restore()

    def createEditor(  # type: ignore[override]  # Qt takes None, too
        self, parent: QWidget, _option: QStyleOptionViewItem, index: ModelIndex
    ) -> QLineEdit | None:
        if index.column() != RUN or not index.data(NUMBER):
            return None  # the undeformed mesh has no name of its own
        return QLineEdit(parent, placeholderText=f"Name of run {index.data(NUMBER)}")

    def setEditorData(self, editor: QWidget, index: ModelIndex) -> None:
        assert isinstance(editor, QLineEdit)
        # Qt calls this again when the row changes, as its run goes on: keep what is being typed.
        if not editor.isModified():
            editor.setText(index.data(NAME))

    def setModelData(self, editor: QWidget, _model: QAbstractItemModel, index: ModelIndex) -> None:
        assert isinstance(editor, QLineEdit)
        self.renamed.emit(index.data(NUMBER), editor.text())

    def updateEditorGeometry(
        self, editor: QWidget, option: QStyleOptionViewItem, _index: ModelIndex
    ) -> None:
        width = editor.parentWidget().width() - option.rect.left()
        editor.setGeometry(option.rect.left(), option.rect.top(), width, option.rect.height())


def text_color(option: QStyleOptionViewItem, plain: QPalette.ColorRole) -> QColor:
    """Return the text color of a row: ``plain``, or the palette's color of selected rows."""
    chosen = bool(option.state & QStyle.StateFlag.State_Selected)
    active = bool(option.state & QStyle.StateFlag.State_Active)
    group = QPalette.ColorGroup.Active if active else QPalette.ColorGroup.Inactive
    return option.palette.color(group, QPalette.ColorRole.HighlightedText if chosen else plain)


class ShownRun(NamedTuple):
    """The run, its step and the run beside it that were shown when the mouse was pressed."""

    run: int | None = None
    frame: int = 0
    beside: int | None = None


class RunTree(QTreeWidget):
    """The list of runs: per row numbers in columns, and below them a line over the whole width."""

    beside_wanted = Signal(int)
    """The number of a run that was clicked with Ctrl."""
    renamed = Signal(int, str)
    """The number of a run, and its new name."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("runs")
        self.setColumnCount(4)
        self.setHeaderLabels(["Run", "Min", "Mean", "Inv."])
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setAlternatingRowColors(True)
        self.setAllColumnsShowFocus(True)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        first = _FirstLine(self)
        first.renamed.connect(self.renamed)
        self.setItemDelegate(first)
        self.setMinimumHeight(80)
        for column, tip in enumerate(TIPS):
            self.headerItem().setToolTip(column, wrapped(tip))
        header = self.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(36)
        header.setSectionResizeMode(RUN, QHeaderView.ResizeMode.Stretch)
        for column in (MIN, MEAN, INVERTED):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
            self.headerItem().setTextAlignment(column, Qt.AlignmentFlag.AlignRight)
        self.seen_before = ShownRun()
        self.session: Callable[[], Session] = Session

    @property
    def number(self) -> int | None:
        """Return the number of the run whose row is selected, or None."""
        item = self.currentItem()
        return None if item is None else item.data(RUN, NUMBER)

    def edit_name(self, number: int | None = None) -> None:
        """Open the field for the name of a run, by default of the selected one."""
        number = self.number if number is None else number
        for place in range(self.topLevelItemCount()):
            item = self.topLevelItem(place)
            if item is not None and item.data(RUN, NUMBER) == number:
                self.editItem(item, RUN)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_F2:
            self.edit_name()
            return
        super().keyPressEvent(event)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.RightButton:
            event.accept()  # the menu is about the run below the mouse; another may stay shown
            return
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            item = self.itemAt(event.position().toPoint())
            if item is not None:
                self.beside_wanted.emit(item.data(RUN, NUMBER))
            event.accept()
            return
        # A double click begins with a click, which shows the run: keep what was shown before,
        # as a double click compares the run with that.
        now = self.session()
        self.seen_before = ShownRun(now.shown, now.view.frame, now.view.beside)
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        # A drag with Ctrl or the right button selects no row.
        if event.buttons() == Qt.MouseButton.LeftButton and not event.modifiers():
            super().mouseMoveEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and not event.modifiers():
            super().mouseReleaseEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and not event.modifiers():
            super().mouseDoubleClickEvent(event)

    def dataChanged(self, first: ModelIndex, last: ModelIndex, roles: Sequence[int] = ()) -> None:
        super().dataChanged(first, last, roles)
        # The second line spans all columns, but Qt repaints only the changed column.
        self.viewport().update()

    def drawRow(self, painter: QPainter, option: QStyleOptionViewItem, index: ModelIndex) -> None:
        super().drawRow(painter, option, index)
        rect = self.visualRect(index.siblingAtColumn(RUN))
        height = option.fontMetrics.height()
        rect = rect.adjusted(PAD, height + PAD, 0, 0)
        rect.setRight(self.viewport().width() - PAD)
        rect.setHeight(height)
        row = QStyleOptionViewItem(option)
        if self.selectionModel().isSelected(index):
            row.state |= QStyle.StateFlag.State_Selected
        painter.save()
        painter.setPen(text_color(row, QPalette.ColorRole.PlaceholderText))
        text = str(index.siblingAtColumn(RUN).data(WORDS))
        shown = option.fontMetrics.elidedText(text, Qt.TextElideMode.ElideRight, rect.width())
        painter.drawText(rect, ALIGN_LEFT, shown)
        painter.restore()


OF_ALL = ("copy", "export")  # commands for all runs, whichever row is selected

EMPTY = "Nothing was computed yet. Each run will be listed here with its settings and its quality."


class RunsPanel(Panel):
    """The panel with the list of the runs: a click shows a run, Ctrl+click shows it beside."""

    def make(self) -> None:
        self.empty = hint_label(EMPTY, Qt.AlignmentFlag.AlignTop)
        self.tree = RunTree()
        menu = QMenu()
        menu.aboutToShow.connect(lambda: fill_compare(menu, self.store))
        tip = f"{BY_NAME['compare'].tip} Ctrl+click on a run does so too."
        self.buttons = {"compare": tool_button(tip, image="beside", text="Compare", menu=menu)}
        for command in RUN_MENU.commands():
            self.buttons[command.name] = tool_button(
                command.tip, lambda _=False, command=command: command.do(self), image=command.image
            )
        for name, button in self.buttons.items():
            button.setObjectName(f"runs_{name}")
            button.setIconSize(QSize(18, 18))
        self.tree.session = lambda: self.session
        self.tree.currentItemChanged.connect(self._chosen)
        self.tree.itemDoubleClicked.connect(lambda *_: self._double_clicked())
        self.tree.beside_wanted.connect(self.show_beside)
        self.tree.renamed.connect(
            lambda number, name: self.change(changes.rename_run, number, name)
        )
        self.tree.customContextMenuRequested.connect(self._menu_wanted)
        every = list(self.buttons.values())
        left = 1 + RUN_MENU.entries.index(None)
        row = TwoPartRow(every[:left], every[left:], spacing=2)
        parts = (self.empty, self.tree, row)
        in_column(*parts, wide=parts[:2], spacing=4, on=self, margins=(6, 6, 6, 4))
        self.follow(lambda one: (one.runs, one.shown, one.view.beside), self._fill)
        self.follow()

    def take_theme(self, _scheme: ColorScheme) -> None:
        self._fill(self.session)

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        """Select the row of the session's run; playing does not fill the list again."""
        with QSignalBlocker(self.tree):
            self._select(session)
        self.empty.setVisible(not session.runs)
        self.tree.setVisible(bool(session.runs))
        run = session.run_shown
        self.buttons["compare"].setEnabled(run is not None and run.last is not None)
        for command in RUN_MENU.commands():
            able = run is not None and command.enabled(run)
            selected = command.name in OF_ALL or self.tree.number != UNDEFORMED
            self.buttons[command.name].setEnabled(able and selected)

    def _select(self, session: Session) -> None:
        """Select the row of the shown run, or that of the undeformed mesh at its step 0."""
        run = session.run_shown
        place = -1
        if run is not None:
            # A run without steps, as one that failed, has no other than step 0.
            place = 1 + session.runs.index(run) if session.view.frame or not run.frames else 0
        index = self.tree.model().index(place, 0)
        if index != self.tree.currentIndex():
            self.tree.setCurrentIndex(index)

    def _fill(self, session: Session) -> None:
        with QSignalBlocker(self.tree):
            tree = self.tree
            runs = session.runs
            count = len(runs) + 1 if runs else 0
            while tree.topLevelItemCount() > count:
                tree.takeTopLevelItem(tree.topLevelItemCount() - 1)
            while tree.topLevelItemCount() < count:
                item = QTreeWidgetItem()
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
                tree.addTopLevelItem(item)
            champions = best_runs(runs)
            for place, run in enumerate((None, *runs) if runs else ()):
                row = tree.topLevelItem(place)
                assert row is not None
                self._sync_row(row, run, session, run is not None and run.number in champions)

    def _sync_row(
        self, item: QTreeWidgetItem, run: Run | None, session: Session, champion: bool
    ) -> None:
        """Fill the row of a run; None: of the undeformed mesh."""
        number = UNDEFORMED if run is None else run.number
        last = session.frames[0] if run is None else run.last
        texts = ["Undeformed" if run is None else f"{number}  {run_words(run)}", "–", "–", "–"]
        if last is not None:
            quality = last.quality
            texts[1:] = (
                format(quality.min, QUALITY_FORMAT),
                format(quality.mean, QUALITY_FORMAT),
                f"{quality.inverted:,}",
            )
        beside = number == session.view.beside
        tip = "The mesh before it is deformed." if run is None else describe_run(run)
        words = "step 0 of each run" if run is None else summary(run, session.runs)
        if champion:
            tip += "\n\nIts minimum quality is the highest of the runs with the same motion."
        for column, text in enumerate(texts):
            item.setText(column, text)
            item.setToolTip(column, wrapped(tip))
            if column != RUN:
                item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight)
        font = item.font(MIN)
        font.setBold(champion)
        item.setFont(MIN, font)
        item.setData(RUN, NUMBER, number)
        item.setData(RUN, NAME, "" if run is None else run.name)
        item.setData(RUN, WORDS, ("beside · " if beside else "") + words)
        item.setIcon(RUN, icon("beside") if beside else QIcon())

    # Widgets to state ------------------------------------------------------------------
    def _chosen(self, item: QTreeWidgetItem | None, _before: object = None) -> None:
        if item is not None:
            self.show_run(item.data(RUN, NUMBER))

    def _double_clicked(self) -> None:
        """Show the run beside the one shown before the double click, or end that comparison."""
        number = self.tree.number
        seen = self.tree.seen_before
        if number is None:
            return
        if seen.run is None or seen.run == number:
            self.change(changes.show_beside, None)
            return
        self.change(changes.show_run, seen.run)
        self.change(changes.show_beside, None if seen.beside == number else number)
        self.change(changes.show_frame, seen.frame)

    def _menu_wanted(self, where: QPoint) -> None:
        item = self.tree.itemAt(where)
        if item is None:
            return
        menu = self.menu(item.data(RUN, NUMBER))
        menu.popup(self.tree.viewport().mapToGlobal(where))

    # Actions, of the selected run or that with a number --------------------------------
    def menu(self, number: int) -> QMenu:
        session = self.session
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        run = session.run(number)
        # A right click selects no row: the menu's first line names its run.
        title = "Undeformed mesh" if run is None else f"Run {number}: {run_words(run)}"
        menu.addAction(title).setEnabled(False)
        menu.addSeparator()
        beside = session.view.beside == number
        for text, can, function in (
            ("Show", True, lambda: self.show_run(number)),
            (
                "End the comparison" if beside else f"Show beside run {session.shown}",
                beside or number != session.shown,
                lambda: self.show_beside(number),
            ),
            ("Rename\tF2", run is not None, lambda: self.tree.edit_name(number)),
        ):
            menu.addAction(text, function).setEnabled(can)
        for command in RUN_MENU.entries:
            if not isinstance(command, Command):
                menu.addSeparator()
                continue
            act = menu.addAction(command.title, self._doing(command, number))
            act.setEnabled(command.name in OF_ALL or (run is not None and command.enabled(run)))
        return menu

    def show_run(self, number: int) -> None:
        """Show the last step of a run, or the undeformed mesh."""
        if number == UNDEFORMED:
            self.change(changes.show_frame, 0)
        else:
            self.change(changes.show_run, number)

    def _doing(self, command: Command, number: int) -> Callable[[], object]:
        return lambda: command.do(self, number)

    def show_beside(self, number: int) -> None:
        """Show a run beside the shown one; if it is there already, end the comparison."""
        session = self.session
        if number != session.shown:
            ends = session.view.beside == number
            self.change(changes.show_beside, None if ends else number)

    def take_settings(self, number: int | None = None) -> None:
        """Put the settings of a run back into the panels."""
        self.change(changes.adopt_settings, number or self.tree.number)

    def save_mesh(self, number: int | None = None) -> None:
        self.change(changes.show_run, number or self.tree.number)
        self.services.files.save_mesh()

    def remove(self, number: int | None = None) -> None:
        number = number or self.tree.number
        if number is None:
            return
        self.change(changes.remove_run, number)
        self.services.show_status(f"Run {number} removed (Ctrl+Z brings it back)")

    def copy_table(self, _number: int | None = None) -> None:
        """Copy the table of all runs to the clipboard, with tabs, for a spreadsheet."""
        QApplication.clipboard().setText(csv_text(table_rows(self.session.runs), "\t"))
        self.services.show_status("Copied the table of runs")

    def export_table(self, _number: int | None = None) -> None:
        """Ask for a file name and write the table of all runs as CSV."""
        name = f"{self.services.files.stem()}_runs.csv"
        self.export_csv("Export the table of runs", name, table_rows(self.session.runs))
