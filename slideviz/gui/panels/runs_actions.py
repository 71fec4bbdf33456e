"""The actions for runs: buttons below their list, and the menu of a row."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from qtpy.QtCore import QSize, Qt
from qtpy.QtWidgets import QApplication, QMenu, QToolButton, QWidget

from slideviz.gui.commands import COMPARE
from slideviz.gui.panels.runs_tree import RunTree
from slideviz.gui.widgets.build import FoldingRow, tool_button
from slideviz.gui.widgets.command import Command
from slideviz.gui.widgets.plot_canvas import ask_and_write
from slideviz.gui.widgets.runs_menu import fill_compare
from slideviz.gui.widgets.services import Services, main_window
from slideviz.session import changes
from slideviz.session.runs_table import table_text, write_table
from slideviz.session.runs_words import run_words
from slideviz.session.state import Session
from slideviz.session.store import Store

TABLE_FILTERS = "Table (*.csv)"
OF_ALL = ("copy", "export")
"""Commands for all runs, whichever row is selected."""


class RunActions:
    """The actions of the runs panel, for the selected run or the run with a given number."""

    def __init__(self, panel: QWidget, tree: RunTree, store: Store) -> None:
        self.panel, self.tree, self.store = panel, tree, store
        self.buttons: dict[str, QToolButton] = {"compare": self._make_compare()}
        for command in filter(None, RUN_COMMANDS):
            self.buttons[command.name] = tool_button(
                command.tip, lambda _=False, command=command: command.do(self), image=command.image
            )
        for name, button in self.buttons.items():
            button.setObjectName(f"runs_{name}")
            button.setIconSize(QSize(18, 18))
        every, left = list(self.buttons.values()), 1 + RUN_COMMANDS.index(None)
        self.row = FoldingRow(every[:left], every[left:], spacing=2)
        """The buttons."""

    @property
    def _window(self) -> Services:
        window = main_window(self.panel)
        assert window is not None
        return window

    def _make_compare(self) -> QToolButton:
        menu, tip = QMenu(), f"{COMPARE.tip} Ctrl+click on a run does so too."
        menu.aboutToShow.connect(lambda: fill_compare(menu, self.store))
        return tool_button(tip, image="beside", text="Compare", menu=menu)

    def sync(self, session: Session) -> None:
        """Enable the buttons of the actions that the shown run allows, or the undeformed mesh."""
        run = session.run_shown
        self.buttons["compare"].setEnabled(run is not None and run.last is not None)
        for command in filter(None, RUN_COMMANDS):
            able = run is not None and command.enabled(run)
            selected = command.name in OF_ALL or self.tree.number != changes.UNDEFORMED
            self.buttons[command.name].setEnabled(able and selected)

    def menu(self, number: int) -> QMenu:
        """Return the menu of a run."""
        session, menu = self.store.session, QMenu(self.panel)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        run = session.run(number)
        # A right click selects no row: the menu's first line names its run.
        title = "Undeformed mesh" if run is None else f"Run {number}: {run_words(run)}"
        menu.addAction(title).setEnabled(False)
        menu.addSeparator()
        beside = session.view.beside == number
        for text, can, function in (
            ("Show", True, lambda: self.show(number)),
            (
                "End the comparison" if beside else f"Show beside run {session.shown}",
                beside or number != session.shown,
                lambda: self.show_beside(number),
            ),
            ("Rename\tF2", run is not None, lambda: self.tree.edit_name(number)),
        ):
            menu.addAction(text, function).setEnabled(can)
        for command in RUN_COMMANDS:
            if command is None:
                menu.addSeparator()
                continue
            act = menu.addAction(command.title, self._doing(command, number))
            act.setEnabled(command.name in OF_ALL or (run is not None and command.enabled(run)))
        return menu

    def show(self, number: int) -> None:
        """Show the last step of a run, or the undeformed mesh."""
        if number == changes.UNDEFORMED:
            self.store.change(changes.show_frame, 0)
        else:
            self.store.change(changes.show_run, number)

    def _doing(self, command: Command, number: int) -> Callable[[], object]:
        return lambda: command.do(self, number)

    def show_beside(self, number: int) -> None:
        """Show a run beside the shown one; if it is there already, end the comparison."""
        session = self.store.session
        if number != session.shown:
            ends = session.view.beside == number
            self.store.change(changes.show_beside, None if ends else number)

    def take_settings(self, number: int | None = None) -> None:
        """Put the settings of a run back into the panels."""
        self.store.change(changes.take_settings, number or self.tree.number)

    def save_mesh(self, number: int | None = None) -> None:
        """Show a run and save the mesh of its last step."""
        self.store.change(changes.show_run, number or self.tree.number)
        self._window.files.save_mesh()

    def remove(self, number: int | None = None) -> None:
        """Remove a run from the list."""
        number = number or self.tree.number
        if number is None:
            return
        self.store.change(changes.remove_run, number)
        self._window.say(f"Run {number} removed (Ctrl+Z brings it back)")

    def copy_table(self, _number: int | None = None) -> None:
        """Copy the table of all runs to the clipboard, with tabs, for a spreadsheet."""
        QApplication.clipboard().setText(table_text(self.store.session.runs, "\t"))
        self._window.say("Copied the table of runs")

    def export_table(self, _number: int | None = None) -> None:
        """Ask for a file name and write the table of all runs as CSV."""
        session = self.store.session
        folder = session.path.parent if session.path is not None else Path.home()
        stem = session.path.stem if session.path is not None else "mesh"
        ask_and_write(
            self.panel,
            "Export the table of runs",
            folder / f"{stem}_runs.csv",
            TABLE_FILTERS,
            lambda path: write_table(path, session.runs),
        )


# fmt: off
RUN_COMMANDS: tuple[Command | None, ...] = (
    Command("settings", "Put its settings back into the panels",
            "Put its settings back into the panels", RunActions.take_settings, image="settings"),
    Command("save", "Save its mesh…", "Save the mesh of this run", RunActions.save_mesh,
            image="save", enabled=lambda run: bool(run.frames and run.end)),
    Command("remove", "Remove", "Remove this run from the list", RunActions.remove,
            image="remove", enabled=lambda run: bool(run.end)),
    None,
    Command("copy", "Copy the table", "Copy the table of all runs", RunActions.copy_table,
            image="copy"),
    Command("export", "Export the table…", "Export the table of all runs as CSV",
            RunActions.export_table, image="table"),
)
# fmt: on
"""The buttons' commands, which the menu of a row has too (None: a separator in the menu).

``do`` is called with the `RunActions`, and from the menu with the number of its run; ``enabled``
is called with a `Run`."""
