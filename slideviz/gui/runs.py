"""The runs panel: what was computed with which settings, and how good it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QIcon
from qtpy.QtWidgets import (
    QApplication,
    QHBoxLayout,
    QLabel,
    QMenu,
    QToolButton,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from slideviz.errors import SlidevizError
from slideviz.gui import dialogs
from slideviz.gui.beside import fill_compare
from slideviz.gui.icons import icon
from slideviz.gui.runs_tree import MIN, NUMBER, RUN, WORDS, RunTree
from slideviz.view import changes
from slideviz.view.look import Look
from slideviz.view.runs_table import best, brief, described, method_words, table_text, write_table
from slideviz.view.state import Run, Session
from slideviz.view.store import Store

EMPTY = "Nothing was computed yet. Each run will be listed here with its settings and its quality."
TIP_COMPARE = (
    "Show the undeformed mesh or another run beside the run that is shown. "
    "Ctrl+click on a run does so too."
)
TABLE_FILTERS = "Table (*.csv)"


class RunsPanel(QWidget):
    """Lists the runs; a click shows one, with Ctrl beside the one that is shown.

    Parameters
    ----------
    store : Store
    save_mesh : callable
        Asks for a name and writes the mesh that is shown.
    tell_error : callable
        Shows an error.
    say : callable
        Shows that something was done.
    """

    def __init__(
        self,
        store: Store,
        save_mesh: Callable[[], None] = lambda: None,
        tell_error: Callable[[BaseException], None] = lambda _: None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        super().__init__()
        self.store, self._save, self._tell_error, self._say = store, save_mesh, tell_error, say
        self._syncing = False
        self._drawn: tuple[object, ...] = ()
        self._colour = "#3b4652"
        layout = QVBoxLayout(self)
        layout.setContentsMargins(6, 6, 6, 4)
        layout.setSpacing(4)
        self.empty = QLabel(EMPTY)
        self.empty.setWordWrap(True)
        self.empty.setProperty("hint", True)
        self.empty.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.tree = RunTree()
        self.tree.session = lambda: self.store.session
        self.tree.currentItemChanged.connect(self._chosen)
        self.tree.itemDoubleClicked.connect(lambda *_: self._double_clicked())
        self.tree.beside_wanted.connect(self.show_beside)
        self.tree.customContextMenuRequested.connect(self._menu_wanted)
        layout.addWidget(self.empty, 1)
        layout.addWidget(self.tree, 1)
        layout.addLayout(self._make_buttons())
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def _make_buttons(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(2)
        self.buttons: dict[str, QToolButton] = {"compare": self._make_compare()}
        row.addWidget(self.buttons["compare"])
        for name, image, tip, function in (
            ("settings", "settings", "Put its settings back into the panels", self.take_settings),
            ("save", "save", "Save the mesh of this run", self.save_mesh),
            ("remove", "remove", "Remove this run from the list", self.remove),
            ("copy", "copy", "Copy the table of all runs", self.copy_table),
            ("export", "table", "Export the table of all runs as CSV", self.export_table),
        ):
            button = QToolButton()
            button.setObjectName(f"runs_{name}")
            button.setToolTip(tip)
            button.setIconSize(QSize(18, 18))
            button.setProperty("image", image)
            button.clicked.connect(lambda _=False, function=function: function())
            self.buttons[name] = button
            if name == "copy":
                row.addStretch(1)
            row.addWidget(button)
        self.take_theme(None, self._colour)
        return row

    def _make_compare(self) -> QToolButton:
        button = QToolButton()
        button.setObjectName("runs_compare")
        button.setText("Compare")
        button.setToolTip(TIP_COMPARE)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        button.setIconSize(QSize(18, 18))
        button.setProperty("image", "beside")
        menu = QMenu(button)
        menu.aboutToShow.connect(lambda: fill_compare(menu, self.store))
        button.setMenu(menu)
        return button

    def take_theme(self, _look: Look | None, colour: str) -> None:
        """Draw the icons in the colours of another theme."""
        self._colour = colour
        for button in self.buttons.values():
            button.setIcon(icon(button.property("image"), colour))
        self._drawn = ()
        if hasattr(self, "tree") and self.store.session.runs:
            self.sync(self.store.session)

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Show the session; the rows are touched only when a run or the choice differs."""
        key = (session.runs, session.shown, session.view.beside)
        if key == self._drawn:
            return
        self._drawn = key
        self._syncing = True
        try:
            self._fill(session)
        finally:
            self._syncing = False
        self.empty.setVisible(not session.runs)
        self.tree.setVisible(bool(session.runs))
        run = session.run_shown
        done = run is not None and run.last is not None
        for name, can in (
            ("compare", done),
            ("settings", run is not None),
            ("save", done and bool(run.end)),
            ("remove", run is not None and bool(run.end)),
            ("copy", bool(session.runs)),
            ("export", bool(session.runs)),
        ):
            self.buttons[name].setEnabled(can)

    def _fill(self, session: Session) -> None:
        tree, runs = self.tree, session.runs
        while tree.topLevelItemCount() > len(runs):
            tree.takeTopLevelItem(tree.topLevelItemCount() - 1)
        while tree.topLevelItemCount() < len(runs):
            tree.addTopLevelItem(QTreeWidgetItem())
        champion = best(runs)
        for place, run in enumerate(runs):
            self._sync_row(tree.topLevelItem(place), run, session, run.number == champion)
        shown = next((place for place, run in enumerate(runs) if run.number == session.shown), None)
        tree.setCurrentItem(tree.topLevelItem(shown) if shown is not None else None)

    def _sync_row(self, item: QTreeWidgetItem, run: Run, session: Session, champion: bool) -> None:
        last = run.last
        texts = [f"{run.number}  {method_words(run.case)}", "–", "–", "–"]
        if last is not None:
            quality = last.quality
            texts[1:] = f"{quality.min:.4f}", f"{quality.mean:.4f}", f"{quality.inverted:,}"
        beside = run.number == session.view.beside
        tip = described(run)
        if champion:
            tip += "\n\nIts minimum quality is the highest of all runs."
        for column, text in enumerate(texts):
            item.setText(column, text)
            item.setToolTip(column, tip)
            if column != RUN:
                item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight)
        font = item.font(MIN)
        font.setBold(champion)
        item.setFont(MIN, font)
        item.setData(RUN, NUMBER, run.number)
        item.setData(RUN, WORDS, ("beside · " if beside else "") + brief(run))
        item.setIcon(RUN, icon("beside", self._colour) if beside else QIcon())

    # Widgets to state ------------------------------------------------------------------

    @property
    def _number(self) -> int | None:
        item = self.tree.currentItem()
        return None if item is None else item.data(RUN, NUMBER)

    def _chosen(self, item: QTreeWidgetItem | None, _before: object = None) -> None:
        if not self._syncing and item is not None:
            self.store.change(changes.show_run, item.data(RUN, NUMBER))

    def _double_clicked(self) -> None:
        """Show the run beside the one that was shown before, or end the comparison with it."""
        number, (before, frame, beside) = self._number, self.tree.seen_before
        if number is None:
            return
        if before is None or before == number:
            self.store.change(changes.show_beside, None)
            return
        self.store.change(changes.show_run, before)
        self.store.change(changes.show_beside, None if beside == number else number)
        self.store.change(changes.show_frame, frame)

    def _menu_wanted(self, where) -> None:
        item = self.tree.itemAt(where)
        if item is None:
            return
        self.menu(item.data(RUN, NUMBER)).popup(self.tree.viewport().mapToGlobal(where))

    def menu(self, number: int) -> QMenu:
        """Return what can be done with a run."""
        session, menu = self.store.session, QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        run = session.run(number)
        # A click with the right button chooses no row: which one is meant, the menu says.
        menu.addAction(f"Run {number}: {method_words(run.case)}").setEnabled(False)
        menu.addSeparator()
        beside = session.view.beside == number
        for text, can, function in (
            ("Show", True, lambda: self.store.change(changes.show_run, number)),
            (
                "End the comparison" if beside else f"Show beside run {session.shown}",
                beside or number != session.shown,
                lambda: self.show_beside(number),
            ),
            ("Put its settings back into the panels", True, lambda: self.take_settings(number)),
            ("Save its mesh…", bool(run.frames and run.end), lambda: self.save_mesh(number)),
            ("Remove", bool(run.end), lambda: self.remove(number)),
            ("", True, None),
            ("Copy the table", True, self.copy_table),
            ("Export the table…", True, self.export_table),
        ):
            if not text:
                menu.addSeparator()
                continue
            act = menu.addAction(text)
            act.setEnabled(can)
            act.triggered.connect(lambda _=False, function=function: function())
        return menu

    # What can be done ------------------------------------------------------------------

    def show_beside(self, number: int) -> None:
        """Show a run beside the one that is shown, or no longer."""
        session = self.store.session
        if number != session.shown:
            ends = session.view.beside == number
            self.store.change(changes.show_beside, None if ends else number)

    def take_settings(self, number: int | None = None) -> None:
        """Put the settings of a run back into the panels."""
        self.store.change(changes.take_settings, number or self._number)

    def save_mesh(self, number: int | None = None) -> None:
        """Show a run and save the mesh of its last step."""
        self.store.change(changes.show_run, number or self._number)
        self._save()

    def remove(self, number: int | None = None) -> None:
        """Remove a run from the list."""
        self.store.change(changes.remove_run, number or self._number)

    def copy_table(self) -> None:
        """Put the table into the clipboard, for a spreadsheet."""
        QApplication.clipboard().setText(table_text(self.store.session.runs, "\t"))
        self._say("Copied the table of runs")

    def export_table(self) -> None:
        """Ask for a name and write the table."""
        session = self.store.session
        folder = session.path.parent if session.path is not None else Path.home()
        stem = session.path.stem if session.path is not None else "mesh"
        default = folder / f"{stem}_runs.csv"
        path = dialogs.ask_save(self, "Export the table of runs", default, TABLE_FILTERS)
        if path is None:
            return
        try:
            write_table(path, session.runs)
        except SlidevizError as error:
            self._tell_error(error)
            return
        self._say(f"Saved {path}")
