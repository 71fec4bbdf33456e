"""The list of the runs: a row has two lines, numbers in columns and words below them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from qtpy.QtCore import QAbstractItemModel, QSize, Qt, Signal
from qtpy.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPalette
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeWidget,
    QWidget,
)

from slideviz.gui.widgets.labels import ModelIndex, wrapped
from slideviz.session.state import Session

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
        editor = QLineEdit(parent)
        editor.setPlaceholderText(f"Name of run {index.data(NUMBER)}")
        return editor

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
        painter.drawText(rect, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, shown)
        painter.restore()
