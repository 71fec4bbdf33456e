"""Questions to the user, each a function, and the banner that tells what went wrong."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QMessageBox,
    QPlainTextEdit,
    QPushButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from slideviz.errors import SlidevizError
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.faults import details_of
from slideviz.gui.widgets.fields import NumberBox
from slideviz.mesh.model import Mesh
from slideviz.session.formats import formats_for

PICTURE_FILTERS = "PNG picture (*.png)"
CASE_FILTERS = "Case (*.cfg)"


def mesh_filters(mesh: Mesh) -> str:
    """Return the formats a mesh can be saved in, for a file dialog."""
    return ";;".join(f"{row.name} (*{end})" for end, row in formats_for(mesh).items())


def ask_open(parent: QWidget, folder: Path) -> Path | None:
    """Return the file to open, or None."""
    import meshio

    every = " ".join("*" + suffix for suffix in sorted(meshio.extension_to_filetypes))
    ours = "*.su2 *.su2b"
    filters = f"SU2 meshes and cases ({ours} *.cfg);;All meshes ({ours} {every});;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Open a mesh or case", str(folder), filters)
    return Path(name) if name else None


def ask_save(parent: QWidget, title: str, default: Path, filters: str) -> Path | None:
    """Return the file to write, with an ending, or None. It asks before one is replaced."""
    name, chosen = QFileDialog.getSaveFileName(parent, title, str(default), filters)
    return _with_ending(name, chosen, default) if name else None


def ask_numbered(parent: QWidget, title: str, default: Path, filters: str) -> Path | None:
    """Return the name of files that each get a number, with an ending, or None."""
    # Of that name itself there is no file.
    option = QFileDialog.Option.DontConfirmOverwrite
    call = QFileDialog.getSaveFileName
    name, chosen = call(parent, title, str(default), filters, options=option)
    return _with_ending(name, chosen, default) if name else None


def _with_ending(name: str, chosen: str, default: Path) -> Path:
    """Return a name with the ending of the chosen filter, where it has none."""
    path = Path(name)
    if not path.suffix:
        suffix = chosen.rpartition("*")[2].partition(")")[0].strip() if "*" in chosen else ""
        path = path.with_suffix(suffix or default.suffix)
    return path


def ask_unsaved(parent: QWidget, what: str, can_save: Sequence[str] = ("case",)) -> str:
    """Return ``case``, ``mesh`` or ``both`` to save, ``discard`` or ``cancel``.

    Parameters
    ----------
    what : str
        The question; what follows after a line break is said in smaller letters.
    can_save : sequence of {"case", "mesh"}
        What can be saved now.
    """
    box = QMessageBox(parent)
    box.setIcon(QMessageBox.Icon.Question)
    box.setWindowTitle("Unsaved changes")
    box.setTextFormat(Qt.TextFormat.PlainText)
    question, _, more = what.partition("\n")
    box.setText(question)
    box.setInformativeText(more)
    several = len(can_save) > 1
    words = {"case": "Save &case…", "mesh": "Save &mesh…", "both": "Save &both…"}
    offered = [*can_save, "both"] if several else list(can_save)
    role = QMessageBox.ButtonRole
    buttons = {
        name: box.addButton(words[name] if several else "&Save…", role.AcceptRole)
        for name in offered
    }
    buttons["discard"] = box.addButton("&Don’t save", role.DestructiveRole)
    # Not &Cancel: Alt+C is the case.
    buttons["cancel"] = box.addButton("C&ancel", role.RejectRole)
    box.setEscapeButton(buttons["cancel"])
    box.setDefaultButton(next(iter(buttons.values())) if can_save else buttons["cancel"])
    box.exec()
    clicked = box.clickedButton()
    return next((name for name, button in buttons.items() if button is clicked), "cancel")


def ask_folder(parent: QWidget, title: str, default: Path) -> Path | None:
    """Return a folder that exists, or None."""
    name = QFileDialog.getExistingDirectory(parent, title, str(default))
    return Path(name) if name else None


def ask_sample(
    parent: QWidget, samples: Mapping[str, str], sizes: Mapping[str, int]
) -> tuple[str, int] | None:
    """Return the name of a sample and its size, or None; ``sizes`` are those offered at first."""
    dialog = QDialog(parent)
    dialog.setWindowTitle("Open a sample")
    form = QFormLayout(dialog)
    name, size, about = Choice({name: name for name in samples}), NumberBox(), QLabel()
    size.setRange(2, 10_000_000)
    size.setGroupSeparatorShown(True)
    about.setWordWrap(True)
    about.setProperty("hint", True)

    def show(chosen: str) -> None:
        size.setValue(sizes[chosen])
        large = sizes[chosen] > 1000
        what = "of all cells, about" if large else "of cells along one side"
        about.setText(f"{samples[chosen]}. Size: number {what}.")

    name.currentIndexChanged.connect(lambda _: show(name.currentData()))
    show(name.currentData())
    buttons = QDialogButtonBox(
        QDialogButtonBox.StandardButton.Open | QDialogButtonBox.StandardButton.Cancel
    )
    buttons.accepted.connect(dialog.accept)
    buttons.rejected.connect(dialog.reject)
    form.addRow("Sample", name)
    form.addRow("Size", size)
    form.addRow(about)
    form.addRow(buttons)
    dialog.setMinimumWidth(420)
    accepted = dialog.exec() == QDialog.DialogCode.Accepted
    return (name.currentData(), size.value()) if accepted else None


def ask_paper(parent: QWidget, width: float, height: float) -> tuple[float, float] | None:
    """Return how wide and at most how high a picture is on paper, in cm, or None."""
    dialog = QDialog(parent)
    dialog.setWindowTitle("Size of the picture")
    form = QFormLayout(dialog)
    boxes = QDoubleSpinBox(), QDoubleSpinBox()
    for box, words, value in zip(boxes, ("Width", "Height, at most"), (width, height), strict=True):
        box.setRange(4.0, 100.0)
        box.setDecimals(1)
        box.setSuffix(" cm")
        box.setValue(value)
        form.addRow(words, box)
    buttons = QDialogButtonBox(
        QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel
    )
    buttons.accepted.connect(dialog.accept)
    buttons.rejected.connect(dialog.reject)
    form.addRow(buttons)
    accepted = dialog.exec() == QDialog.DialogCode.Accepted
    return (boxes[0].value(), boxes[1].value()) if accepted else None


def ask_replace(parent: QWidget, paths: Sequence[Path]) -> bool:
    """Return whether files that exist may be replaced."""
    names = ", ".join(path.name for path in paths[:3]) + (", …" if len(paths) > 3 else "")
    several = len(paths) > 1
    text = f"{names} exists already. Replace it?"
    if several:
        text = f"{len(paths)} files exist already ({names}). Replace them?"
    return _agreed(parent, QMessageBox.Icon.Question, "Replace files?", text)


def ask_overwrite_input(parent: QWidget, path: Path) -> bool:
    """Return whether the mesh that was opened may be replaced by the deformed one."""
    text = f"{path.name} is the mesh you opened. Replacing it cannot be undone."
    return _agreed(parent, QMessageBox.Icon.Warning, "Replace the input mesh?", text)


def _agreed(parent: QWidget, icon: QMessageBox.Icon, title: str, text: str) -> bool:
    """Return whether a question is answered with yes; names in it are shown as they are."""
    yes, no = QMessageBox.StandardButton.Yes, QMessageBox.StandardButton.Cancel
    box = QMessageBox(icon, title, text, yes | no, parent)
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setDefaultButton(no)
    return box.exec() == yes


def message_of(error: BaseException) -> str:
    """Return what an error means for the user."""
    if isinstance(error, SlidevizError):
        return str(error)
    return f"Something unexpected went wrong ({type(error).__name__}): {error}"


class DetailsDialog(QDialog):
    """The full text of an error, to be copied."""

    def __init__(self, parent: QWidget, text: str) -> None:
        super().__init__(parent)
        self.setWindowTitle("Details")
        self.resize(720, 380)
        layout = QVBoxLayout(self)
        self.text = QPlainTextEdit(text)
        self.text.setReadOnly(True)
        self.text.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        layout.addWidget(self.text)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        self.copy = buttons.addButton("Copy", QDialogButtonBox.ButtonRole.ActionRole)
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(text))
        buttons.rejected.connect(self.close)
        layout.addWidget(buttons)


class Banner(QFrame):
    """A message across the top of the view that stays until it is closed."""

    shown = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("banner")
        self._full = ""
        self._row = row = QHBoxLayout(self)
        row.setContentsMargins(10, 6, 6, 6)
        self.text = QLabel()
        self.text.setWordWrap(True)
        self.text.setTextFormat(Qt.TextFormat.RichText)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.details = QPushButton("Details…")
        self.details.clicked.connect(self._show_details)
        self.copy = QPushButton("Copy details")
        self.copy.setToolTip("Copy the message with its trace, versions and platform.")
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(self._full))
        close = QToolButton()
        close.setText("✕")
        close.setToolTip("Close the message")
        close.clicked.connect(self._closed)
        row.addWidget(self.text, 1)
        row.addWidget(self.details)
        row.addWidget(self.copy)
        row.addWidget(close)
        self.answers: dict[str, QPushButton] = {}
        self._later: Callable[[], object] | None = None
        self._full = ""
        self._brief = ""
        self.hide()

    def tell(self, text: str, full: str = "", calm: bool = True) -> None:
        """Show a message, with a longer text behind “Details”; calm ones are no error."""
        self.setProperty("calm", calm)
        self.style().unpolish(self)
        self.style().polish(self)
        lines = text.splitlines() or [""]
        brief = "\n".join(lines[:4]) + ("\n…" if len(lines) > 4 else "")
        self._brief = html.escape(brief, quote=False).replace("\n", "<br>")
        self.text.setText(self._brief)
        self._full = full or (text if len(lines) > 4 else "")
        self.details.setVisible(bool(self._full))
        self.copy.setVisible(bool(full))
        self.show()
        self.shown.emit(text)

    def tell_error(self, error: BaseException) -> None:
        """Show what an error means; the trace is behind “Details” if it was not expected."""
        full = ""
        if not isinstance(error, SlidevizError):
            full = details_of(error)
        self.tell(message_of(error), full, calm=False)

    def ask(
        self,
        text: str,
        answers: Mapping[str, Callable[[], object]],
        full: str = "",
        later: Callable[[], object] | None = None,
    ) -> None:
        """Show a question with a button for each answer; ``later`` when it is closed instead."""
        self._forget_answers()
        for name, function in answers.items():
            button = QPushButton(name)
            button.clicked.connect(lambda _=False, function=function: function())
            self.answers[name] = button
            self._row.insertWidget(self._row.count() - 1, button)
        self._later = later
        self.tell(text, full)

    def _forget_answers(self) -> None:
        for button in self.answers.values():
            self._row.removeWidget(button)
            button.hide()
            button.deleteLater()
        self.answers = {}

    def _closed(self) -> None:
        later, self._later = self._later, None
        self.hide()
        if later is not None:
            later()

    def count(self, times: int) -> None:
        """Show how often what the message tells has happened."""
        self.text.setText(f"{self._brief} <i>({times:,} times)</i>")

    def _show_details(self) -> None:
        self.dialog = DetailsDialog(self, self._full)
        self.dialog.open()
