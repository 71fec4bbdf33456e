"""What the window shows: pictures of its states, and the words of its menus, panels and dialogs.

`main` puts them into a folder; it is to be the first in its process, with a screen of its own.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock
from PIL import Image
from qtpy.QtCore import QModelIndex, Qt
from qtpy.QtGui import QTextDocument
from qtpy.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QDialog,
    QGroupBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QListWidget,
    QMenu,
    QMessageBox,
    QTableWidget,
    QToolBar,
    QTreeWidget,
    QWidget,
)

from slideviz.gui.widgets import questions
from slideviz.samples.table import write_sample
from slideviz.session import changes
from tests.golden.desk import Desk, keep_picture
from tests.golden.parts import FONT
from tools import shots
from tools.shots import settle

SMALL = 0.45

ask_unsaved = questions.ask_unsaved
"""That of the program: `open_window` puts one in its place that answers by itself."""

PLACE = Path(tempfile.gettempdir()) / "slideviz_golden_window"
"""The folder of the files that are opened: its name is seen."""


def main(folder: Path) -> None:
    """Put all that the window shows into a folder."""
    shots.STATOR_CELLS = 6_000
    desk = Desk(folder)
    with FileLock(f"{PLACE}.lock"), shots.display():
        shutil.rmtree(PLACE, ignore_errors=True)
        write_sample("passage", PLACE / "flat", 12)
        for state in shots.STATES:
            with shots.open_window(PLACE) as window:
                state.bring(window, PLACE)
                photograph(desk, window, state.name)
        with shots.open_window(PLACE) as window:
            bare(desk, window)
        with shots.open_window(PLACE) as window:
            opened(desk, window, PLACE)
        shutil.rmtree(PLACE)


def photograph(desk: Desk, window, name: str) -> None:
    """Keep a small picture of the window as the screen shows it."""
    window.statusBar().clearMessage()  # it goes by itself after a while
    path = desk.folder / "large.png"
    with Image.open(shots.photograph(window, path)) as image:
        keep_picture(image, desk.folder / f"{name}.png", SMALL)
    path.unlink()


def bare(desk: Desk, window) -> None:
    """Keep the window without a mesh, and its menus."""
    photograph(desk, window, "start")
    desk.say(f"{FONT}{window.fontInfo().family()}")
    desk.close("font")
    for action in window.menuBar().actions():
        tell_menu(desk, action.menu())
    for bar in window.findChildren(QToolBar):
        tell_menu(desk, bar)
    desk.close("menus")
    tell_panels(desk, window, "panels_empty")


def opened(desk: Desk, window, place: Path) -> None:
    """Keep the window with two runs: each panel in front, and all dialogs."""
    window.files.open_path(place / "flat" / "passage.cfg")
    settle(window)
    window.store.change(changes.set_case, steps=2)
    for sliding in ("none", "ds"):
        shots._run(window, sliding=sliding, periodic="none")
    for left, right, lower in (
        ("motion", "histogram", "runs"),
        ("method", "worst", "display"),
        ("motion", "curves", "sections"),
    ):
        for name in (left, right, lower):
            window.dock_manager.bring_to_front(name)
        if lower == "sections":
            window.dock_manager.panels["sections"].add["plane"].click()
        photograph(desk, window, f"panels_{right}_{lower}")
    tell_panels(desk, window, "panels")
    tell_contexts(desk, window)
    tell_dialogs(desk, window, place)


def tell_menu(desk: Desk, menu: QWidget, depth: int = 0) -> None:
    """Write down a menu or tool bar: what it says, its keys, and what the status bar says of it."""
    title = menu.title() if isinstance(menu, QMenu) else menu.windowTitle()
    if not depth:
        desk.say(f"$ {title}")
    for action in menu.actions():
        if action.isSeparator():
            continue
        keys = ", ".join(key.toString() for key in action.shortcuts())
        state = "" if action.isEnabled() else " (off)"
        state += " (checked)" if action.isChecked() else ""
        about = " | ".join(filter(None, (action.statusTip(), plain(action.toolTip()))))
        desk.say(f"{'  ' * (depth + 1)}{action.text()} [{keys}]{state}: {about}")
        if action.menu() is not None:
            tell_menu(desk, action.menu(), depth + 1)


def tell_panels(desk: Desk, window, name: str) -> None:
    """Write down the words and tips of every panel."""
    for dock in window.dock_manager.by_name.values():
        tell_words(desk, dock.windowTitle(), dock.widget())
    desk.close(name)


def tell_words(desk: Desk, title: str, widget: QWidget) -> None:
    """Write down what can be read in a widget, by the alphabet: pictures have the order."""
    desk.say(f"$ {title}")
    found = {
        f"  {plain(text)} | {plain(tip)}"
        for inner in (widget, *widget.findChildren(QWidget))
        for text, tip in words_of(inner)
        if text or tip
    }
    for line in sorted(found):
        if "numpy" not in line:  # the versions of what is installed
            desk.say(line)


def words_of(widget: QWidget) -> Iterator[tuple[str, str]]:
    """Yield the texts of a widget and its entries, each with its tooltip."""
    role = Qt.ItemDataRole.ToolTipRole
    if isinstance(widget, QComboBox):
        yield widget.currentText(), widget.toolTip()
        for row in range(widget.count()):
            yield f"choice {widget.itemText(row)}", widget.itemData(row, role) or ""
    elif isinstance(widget, QLabel | QAbstractButton | QLineEdit):
        yield widget.text(), widget.toolTip()
    elif isinstance(widget, QGroupBox):
        yield widget.title(), widget.toolTip()
    elif isinstance(widget, QListWidget):
        items = [widget.item(row) for row in range(widget.count())]
        yield from ((item.text(), item.toolTip()) for item in items)
        yield "", widget.toolTip()
    elif isinstance(widget, QTreeWidget | QTableWidget):
        model = widget.model()
        for column in range(model.columnCount()):
            head = model.headerData(column, Qt.Orientation.Horizontal)
            yield f"column {head}", model.headerData(column, Qt.Orientation.Horizontal, role) or ""
        yield from cells_of(model)
        yield "", widget.toolTip()
    elif not isinstance(widget, QHeaderView):
        yield "", widget.toolTip()


def cells_of(model, above: QModelIndex | None = None) -> Iterator[tuple[str, str]]:
    """Yield text and tooltip of every cell of a table or tree."""
    above = above or QModelIndex()
    for row in range(model.rowCount(above)):
        for column in range(model.columnCount(above)):
            at = model.index(row, column, above)
            yield str(at.data() or ""), str(at.data(Qt.ItemDataRole.ToolTipRole) or "")
            if column == 0 and model.rowCount(at):
                yield from cells_of(model, at)


def plain(text: str) -> str:
    """Return a text, which may have marks of HTML, in one line."""
    if Qt.mightBeRichText(text):
        page = QTextDocument()
        page.setHtml(text)
        text = page.toPlainText()
    return " ".join(text.split())


def tell_contexts(desk: Desk, window) -> None:
    """Write down the menus of the right mouse button."""
    from slideviz.gui.panels.boundaries import boundary_menu

    store = window.store
    for names in ((), store.session.mesh.marker_names[:1], store.session.mesh.marker_names[:2]):
        if names:
            desk.say(f"of {', '.join(names)}")
            tell_menu(desk, boundary_menu(window, store, tuple(names)))
    for button in window.findChildren(QAbstractButton):
        menu = button.menu() if hasattr(button, "menu") else None
        if menu is not None:
            desk.say(f"of the button {button.text()}")
            menu.aboutToShow.emit()
            tell_menu(desk, menu)
    desk.close("menus_of_panels")


def tell_dialogs(desk: Desk, window, place: Path) -> None:
    """Keep the words of every dialog, and pictures of those that a user fills in."""
    from slideviz.samples.table import SAMPLES

    here = [place / name for name in ("a.su2", "b.su2")]
    with answered(desk):
        questions.ask_sample(
            window,
            {name: row.words() for name, row in SAMPLES.items()},
            {name: row.size for name, row in SAMPLES.items()},
        )
        questions.ask_replace(window, here[:1])
        questions.ask_replace(window, here)
        questions.ask_overwrite_input(window, here[0])
        for able in (("session",), ("session", "case"), ("session", "case", "mesh"), ("table",)):
            ask_unsaved(window, "Save it?\nIt would be lost.", able)
        window.exports.picture()
    window.help.palette()
    window.help.about()
    window.exports.make_film()
    settle(window)
    for dialog in [box for box in window.findChildren(QDialog) if box.isVisible()]:
        keep_dialog(desk, dialog)
        dialog.close()
    desk.close("dialogs")


@contextmanager
def answered(desk: Desk) -> Iterator[None]:
    """Keep each dialog that waits for an answer, and answer with "cancel"."""

    def run(dialog: QDialog) -> int:
        keep_dialog(desk, dialog)
        return 0

    kept = QDialog.exec, QMessageBox.exec
    QDialog.exec = QMessageBox.exec = run
    try:
        yield
    finally:
        QDialog.exec, QMessageBox.exec = kept


def keep_dialog(desk: Desk, dialog: QDialog) -> None:
    """Write down the words of a dialog, and keep its picture if it has fields."""
    from tools.shots import wait

    if isinstance(dialog, QMessageBox):
        desk.say(f"message {dialog.windowTitle()} | {dialog.text()} | {dialog.informativeText()}")
        desk.say(", ".join(button.text() for button in dialog.buttons()))
        return
    title = dialog.windowTitle()
    dialog.show()
    waits = iter(range(100))
    wait(lambda: next(waits) > 90)  # a preview is drawn a little later
    tell_words(desk, title, dialog)
    if title.startswith("Export"):
        path = desk.folder / f"dialog_{title.split()[-1]}.png"
        dialog.grab().save(str(path))
        with Image.open(path) as image:
            image.load()
        keep_picture(image, path, 0.6)
    dialog.hide()
