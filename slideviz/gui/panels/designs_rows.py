"""The view of a table of designs, and the fields by which designs are added."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStackedWidget,
    QTableView,
    QWidget,
)

from slideviz.case.model import Case
from slideviz.gui.panels.designs_model import DesignsModel
from slideviz.gui.widgets.build import Do, hint_label, in_column, in_row, push_button
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import TextField
from slideviz.mesh.model import Mesh
from slideviz.session.design_table import DesignTable, column_choices

ABOUT = (
    "Each row is a design: a run with other numbers of the motions, or other settings. Choose a "
    "number, give its values, and add them; another number is combined with all that there are, "
    "and more values of the same come below. A click on a design that was run, here or in the "
    "plot, shows its mesh."
)
RANGE = "-8 to 0 in 9, or 1, 2, 5"
"""Placeholder of the field for values."""


class DesignRows(QWidget):
    """The table of designs, and above it the fields for the number that varies and its values.

    Parameters
    ----------
    add : callable
        Called when the user clicks “Add” or presses Return.
    """

    def __init__(self, add: Do) -> None:
        super().__init__()
        self._mesh: Mesh | None = None
        self.column = Choice({}, "What varies: a number of a motion, or a setting.", "column")
        self.values = TextField()
        self.values.setObjectName("values")
        self.values.setPlaceholderText(RANGE)
        self.values.setToolTip("A range, as -8 to 0 in 9, or values with commas between them.")
        self.column.chosen.connect(lambda _: self.values.clear())
        self.values.returnPressed.connect(add)
        self.add = push_button(
            "Add",
            "Give each design there is each of these values; of a number that varies already, "
            "designs with the new values come below.",
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
        kept = self.column.currentIndex() > 0 or bool(self.values.text())
        chosen = self.column.currentData() if kept and mesh is self._mesh else None
        if mesh is not self._mesh:
            self.values.clear()
        self._mesh = mesh
        self.column.clear()
        if mesh is not None:
            for name, value in column_choices(case, mesh.dim).items():
                self.column.addItem(f"{name}   (now {value})", name)
        self.column.show_value(chosen)

    def show_table(self, table: DesignTable, editable: bool) -> None:
        """Show a table; if it has no rows, show a hint instead."""
        if table is not self.model.table:
            self.model.show(table)
        self.model.editable = editable
        self._stack.setCurrentWidget(self.view if table.rows else self.hint)

    @property
    def selected(self) -> set[int]:
        """Return the indices of the selected rows, from 0."""
        return {index.row() for index in self.view.selectionModel().selectedRows()}
