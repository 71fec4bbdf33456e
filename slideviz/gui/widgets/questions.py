"""Questions to the user, each a function that opens a dialog and returns the answer."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from qtpy.QtCore import Qt, QTimer
from qtpy.QtWidgets import QDialog, QDialogButtonBox, QFileDialog, QFormLayout, QMessageBox, QWidget

from slideviz.formats.table import MeshFormat, formats_for, readable_patterns
from slideviz.gui.responsiveness.timers import ROWS_MS
from slideviz.gui.widgets.build import Choice, dialog_buttons, hint_label, number_box
from slideviz.gui.widgets.fields import NumberBox
from slideviz.mesh.model import Mesh
from slideviz.session.session_file import ENDING
from slideviz.terms import FILE_FORMATS

PICTURE_FILTERS = "PNG picture (*.png)"
CASE_FILTERS = "Case (*.cfg)"
WITH_MESH = f"Session with a copy of the mesh (*{ENDING})"


def mesh_filters(mesh: Mesh) -> str:
    """Return the formats a mesh can be saved in, as filters of a file dialog."""
    return ";;".join(map(mesh_filter, formats_for(mesh).values()))


def mesh_filter(row: MeshFormat) -> str:
    """Return a format as a filter of a file dialog."""
    return f"{row.name} (*{row.ending})"


def ask_open(parent: QWidget, folder: Path) -> Path | None:
    """Return the mesh, case or session that the user wants to open, or None."""
    ours = " ".join(f"*.{ending}" for ending in FILE_FORMATS)
    filters = (
        f"SU2 meshes, cases and sessions ({ours} *.cfg *{ENDING});;"
        f"All meshes ({readable_patterns()});;{PICTURE_FILTERS};;All files (*)"
    )
    name, _ = QFileDialog.getOpenFileName(parent, "Open a mesh or case", str(folder), filters)
    return Path(name) if name else None


def ask_table(parent: QWidget, folder: Path) -> Path | None:
    """Return the table of designs that the user wants to open, or None."""
    filters = "Tables (*.csv *.txt *.tsv);;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Open a table of designs", str(folder), filters)
    return Path(name) if name else None


def ask_save(parent: QWidget, title: str, default: Path, filters: str) -> Path | None:
    """Return the file to write, or None; a file is not replaced without a question.

    Its suffix is one of the ``filters``: another one, as that of the mesh, gets it behind.
    """
    return _save_name(parent, title, default, filters, QFileDialog.Option(0))[0]


def ask_session(parent: QWidget, default: Path) -> tuple[Path | None, bool]:
    """Return the session file to write, or None; and whether it is to have copies of its files."""
    filters = f"Session (*{ENDING});;{WITH_MESH}"
    option = QFileDialog.Option(0)
    path, chosen = _save_name(parent, "Save session", default, filters, option)
    return path, chosen == WITH_MESH


def ask_numbered(parent: QWidget, title: str, default: Path, filters: str) -> Path | None:
    """Return the name, with a suffix, of a series of files that each get a number, or None."""
    # A file of just that name is not replaced: no question.
    option = QFileDialog.Option.DontConfirmOverwrite
    return _save_name(parent, title, default, filters, option)[0]


def _save_name(
    parent: QWidget, title: str, default: Path, filters: str, option: QFileDialog.Option
) -> tuple[Path | None, str]:
    """Return the chosen name, with the suffix of the chosen filter if it has none; or None.

    Also the chosen filter.
    """
    call = QFileDialog.getSaveFileName
    while True:
        name, chosen = call(parent, title, str(default), filters, options=option)
        if not name:
            return None, chosen
        path = Path(name)
        if path.name.lower().endswith(tuple(_suffixes(filters))):
            return path, chosen
        suffix = next(iter(_suffixes(chosen)), default.suffix)
        path = path.with_name(f"{path.name.rstrip('.')}{suffix}")
        # The dialog has asked about the name without the suffix.
        asks = option != QFileDialog.Option.DontConfirmOverwrite and path.exists()
        if not asks or ask_replace(parent, [path]):
            return path, chosen
        default = path


def _suffixes(filters: str) -> list[str]:
    """Return the suffixes of the filters of a file dialog, such as ``.csv``."""
    return re.findall(r"\*((?:\.\w+)+)", filters)


def ask_unsaved(
    parent: QWidget,
    what: str,
    can_save: Sequence[str] = ("case",),
    now: Callable[[], str] | None = None,
) -> str:
    """Ask what to do with unsaved changes when they would be lost.

    Return ``session``, ``case``, ``mesh`` or ``table`` to save that, ``run`` to stop the run first,
    ``discard``, ``cancel``, or ``again`` where the question has become another one. Called by
    `slideviz.gui.files.Files.ask_about_unsaved`, which has the text from
    `slideviz.session.saving`. ``what``: the question; the text after a line break is shown in
    smaller letters. ``can_save``: what can be saved now. ``now``: returns the question as it is
    now, for what goes on meanwhile; "" where it is to be asked again.
    """
    box = QMessageBox(parent, icon=QMessageBox.Icon.Question)
    box.setWindowTitle("Unsaved changes")
    box.setTextFormat(Qt.TextFormat.PlainText)

    def show(text: str) -> None:
        question, _, more = text.partition("\n")
        box.setText(question)
        box.setInformativeText(more)
        if not text:
            box.done(0)

    show(what)
    if now is not None:
        tick = QTimer(box)
        tick.timeout.connect(lambda: show(now()))
        tick.start(ROWS_MS)
    going = "run" in can_save
    words = {
        "session": "Save &session…",
        "case": "Save &case…",
        "mesh": "Save &mesh…",
        "table": "Save &table…",
        "run": "&Stop it",
    }
    role = QMessageBox.ButtonRole
    buttons = {name: box.addButton(words[name], role.AcceptRole) for name in can_save}
    buttons["discard"] = box.addButton("&Don’t save", role.DestructiveRole)
    # Not &Cancel: Alt+C saves the case.
    buttons["cancel"] = box.addButton("Let it &run" if going else "C&ancel", role.RejectRole)
    box.setEscapeButton(buttons["cancel"])
    box.setDefaultButton(next(iter(buttons.values())))
    box.exec()
    clicked = box.clickedButton()
    answer = next((name for name, button in buttons.items() if button is clicked), "cancel")
    if now is not None and not now():
        answer = "again"
    # Its parent would keep it, and the timer would go on asking `now`.
    box.deleteLater()
    return answer


def ask_folder(parent: QWidget, title: str, default: Path) -> Path | None:
    """Return an existing folder, or None."""
    name = QFileDialog.getExistingDirectory(parent, title, str(default))
    return Path(name) if name else None


def ask_sample(
    parent: QWidget, samples: Mapping[str, str], sizes: Mapping[str, int]
) -> tuple[str, int] | None:
    """Return the name and size of the sample to open, or None.

    ``samples`` has a description, ``sizes`` the size that is offered first, by name.
    """
    dialog = QDialog(parent)
    name = Choice({name: name for name in samples})
    dialog.setWindowTitle("Open a sample")
    size = NumberBox()
    about = hint_label()
    size.setRange(2, 10_000_000)
    size.setGroupSeparatorShown(True)

    def show(chosen: str) -> None:
        size.setValue(sizes[chosen])
        about.setText(f"{samples[chosen]}.")

    name.currentIndexChanged.connect(lambda _: show(name.currentData()))
    show(name.currentData())
    kinds = QDialogButtonBox.StandardButton
    form = QFormLayout(dialog)
    form.addRow("Sample", name)
    form.addRow("Size", size)
    form.addRow(about)
    buttons = dialog_buttons(dialog, kinds.Open, kinds.Cancel)
    size.marked.connect(lambda: buttons.button(kinds.Open).setEnabled(not size.fault))
    form.addRow(buttons)
    dialog.setMinimumWidth(420)
    return (name.currentData(), size.value()) if dialog.exec() else None


def ask_paper(parent: QWidget, width: float, height: float) -> tuple[float, float] | None:
    """Return the width and largest height of a picture on paper, in cm, or None."""
    dialog = QDialog(parent)
    dialog.setWindowTitle("Size of the picture")
    form = QFormLayout(dialog)
    wide = number_box(4.0, 100.0, width, unit=" cm")
    high = number_box(4.0, 100.0, height, unit=" cm")
    form.addRow("Width", wide)
    form.addRow("Height, at most", high)
    kinds = QDialogButtonBox.StandardButton
    form.addRow(dialog_buttons(dialog, kinds.Ok, kinds.Cancel))
    return (wide.value(), high.value()) if dialog.exec() else None


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
    """Return whether the user answers a question with yes; its text is plain text."""
    yes = QMessageBox.StandardButton.Yes
    no = QMessageBox.StandardButton.Cancel
    box = QMessageBox(icon, title, text, yes | no, parent, textFormat=Qt.TextFormat.PlainText)
    box.setDefaultButton(no)
    return box.exec() == yes
