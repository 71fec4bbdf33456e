"""The dialog in which a table of nodal displacements is typed or pasted."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import QSize
from qtpy.QtWidgets import QDialog, QDialogButtonBox, QLabel, QPlainTextEdit, QWidget

from slideviz.errors import SlidevizError
from slideviz.gui.responsiveness.timers import TABLE_MS, single_shot
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import dialog_buttons, in_column, set_style
from slideviz.gui.widgets.labels import fixed_font
from slideviz.session.motions import TableRows, table_text, write_table

FILTERS = "Displacements (*.txt)"
ABOUT = (
    "A row for each node: its number, counted from 0 as in the mesh file, and its displacement in "
    "the mesh's length unit. Columns are separated by tabs, spaces, commas or semicolons, so that "
    "rows of a spreadsheet can be pasted. Nodes without a row stay."
)


class TableDialog(QDialog):
    """The dialog for a table of displacements; a text below it shows its effect or its error.

    Parameters
    ----------
    rows : TableRows
        The nodes it may list; checks the text.
    text : str
        The initial table.
    """

    def __init__(self, parent: QWidget | None, rows: TableRows, text: str = "") -> None:
        super().__init__(parent)
        self.rows = rows
        self.setWindowTitle(f"Displacements of {rows.of}")
        self.resize(QSize(520, 560).boundedTo(self.screen().availableSize()))
        about = QLabel(ABOUT)
        about.setWordWrap(True)
        self.edit = QPlainTextEdit(text)
        self.edit.setObjectName("table")
        self.edit.setFont(fixed_font())
        self.edit.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.edit.setPlaceholderText(f"{rows.heading}\n…")
        self.answer = QLabel()
        self.answer.setWordWrap(True)
        self.buttons = dialog_buttons(self)
        kind = QDialogButtonBox.ButtonRole
        self.fill = self.buttons.addButton("List all nodes", kind.ActionRole)
        self.fill.setToolTip("Add a row of zeros for each node that has none yet.")
        self.fill.setAutoDefault(False)
        self.save = self.buttons.addButton("Save as…", kind.AcceptRole)
        self.save.setToolTip("Save the table as a displacement file, which the case then uses.")
        self.buttons.addButton(QDialogButtonBox.StandardButton.Cancel)
        self.setLayout(in_column(about, self.edit, self.answer, self.buttons, wide=[self.edit]))
        self.fill.clicked.connect(self._fill)
        self._soon = single_shot(self, self.check, TABLE_MS)
        self.edit.textChanged.connect(self._soon.start)
        self.edit.setFocus()
        self.check()

    @property
    def text(self) -> str:
        """Return the text of the table."""
        return self.edit.toPlainText()

    def _fill(self) -> None:
        self.edit.selectAll()
        # Unlike `setPlainText`, this can be undone.
        self.edit.insertPlainText(self.rows.fill(self.text))
        self.check()

    def check(self) -> None:
        """Show the effect of the table, or its error, and enable the save button accordingly."""
        self._soon.stop()
        try:
            said, wrong = self.rows.check(self.text), False
        except SlidevizError as error:
            said, wrong = str(error), True
        self.answer.setText(said)
        set_style(self.answer, "bad", wrong and bool(self.text.strip()))
        self.save.setEnabled(not wrong)

    def accept(self) -> None:
        """Close the dialog if the table is valid."""
        self.check()
        if self.save.isEnabled():
            super().accept()


def ask_table(parent: QWidget, rows: TableRows, path: Path, default: Path) -> Path | None:
    """Open the dialog of a table; return the file it was saved to, or None if it was not saved.

    Raises SlidevizError if the file cannot be read or written.

    Parameters
    ----------
    rows : TableRows
        The nodes the table may list; checks the text.
    path : Path
        The displacement file to edit, if it exists.
    default : Path
        The name that is offered for a new file.
    """
    dialog = TableDialog(parent, rows, table_text(path))
    there = path.is_file()
    while dialog.exec() == QDialog.DialogCode.Accepted:
        target = questions.ask_save(parent, "Save the table", path if there else default, FILTERS)
        if target is not None:
            write_table(target, dialog.text, path)
            return target
    return None
