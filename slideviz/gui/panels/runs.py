"""The runs panel: settings and quality of each run."""

from __future__ import annotations

from qtpy.QtCore import QPoint, QSignalBlocker, Qt
from qtpy.QtGui import QIcon
from qtpy.QtWidgets import QMenu, QTreeWidgetItem

from slideviz.color_scheme import ColorScheme
from slideviz.gui.panels.runs_actions import RunActions
from slideviz.gui.panels.runs_tree import MIN, NAME, NUMBER, RUN, WORDS, RunTree
from slideviz.gui.widgets.build import hint_label, in_column
from slideviz.gui.widgets.icons import icon
from slideviz.gui.widgets.labels import wrapped
from slideviz.gui.widgets.panel import Panel
from slideviz.session import changes
from slideviz.session.runs_table import QUALITY, best, described
from slideviz.session.runs_words import brief, run_words
from slideviz.session.state import Run, Session
from slideviz.session.store import Store

EMPTY = "Nothing was computed yet. Each run will be listed here with its settings and its quality."


class RunsPanel(Panel):
    """The panel with the list of the runs: a click shows a run, Ctrl+click shows it beside."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self._drawn: tuple[object, ...] = ()
        self.empty = hint_label(EMPTY, Qt.AlignmentFlag.AlignTop)
        self.tree = RunTree()
        self.actions_table = RunActions(self, self.tree, store)
        self.buttons = self.actions_table.buttons
        self._connect()
        parts = (self.empty, self.tree, self.actions_table.row)
        in_column(*parts, wide=parts[:2], spacing=4, on=self, margins=(6, 6, 6, 4))
        self.follow()

    def _connect(self) -> None:
        self.tree.session = lambda: self.store.session
        self.tree.currentItemChanged.connect(self._chosen)
        self.tree.itemDoubleClicked.connect(lambda *_: self._double_clicked())
        self.tree.beside_wanted.connect(self.actions_table.show_beside)
        self.tree.renamed.connect(
            lambda number, name: self.store.change(changes.rename_run, number, name)
        )
        self.tree.customContextMenuRequested.connect(self._menu_wanted)

    def take_theme(self, _scheme: ColorScheme) -> None:
        """Draw the icons of the rows in the colors of another theme."""
        self._drawn = ()
        if self.store.session.runs:
            self.sync(self.store.session)

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Fill the list from the session; playing only selects another row."""
        key = (session.runs, session.shown, session.view.beside)
        with QSignalBlocker(self.tree):
            if key != self._drawn:
                self._drawn = key
                self._fill(session)
            self._select(session)
        self.empty.setVisible(not session.runs)
        self.tree.setVisible(bool(session.runs))
        self.actions_table.sync(session)

    def _select(self, session: Session) -> None:
        """Select the row of the shown run, or that of the undeformed mesh at its step 0."""
        run, place = session.run_shown, -1
        if run is not None:
            # A run without steps, as one that failed, has no other than step 0.
            place = 1 + session.runs.index(run) if session.view.frame or not run.frames else 0
        index = self.tree.model().index(place, 0)
        if index != self.tree.currentIndex():
            self.tree.setCurrentIndex(index)

    def _fill(self, session: Session) -> None:
        tree, runs = self.tree, session.runs
        count = len(runs) + 1 if runs else 0
        while tree.topLevelItemCount() > count:
            tree.takeTopLevelItem(tree.topLevelItemCount() - 1)
        while tree.topLevelItemCount() < count:
            item = QTreeWidgetItem()
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
            tree.addTopLevelItem(item)
        champions = best(runs)
        for place, run in enumerate((None, *runs) if runs else ()):
            row = tree.topLevelItem(place)
            assert row is not None
            self._sync_row(row, run, session, run is not None and run.number in champions)

    def _sync_row(
        self, item: QTreeWidgetItem, run: Run | None, session: Session, champion: bool
    ) -> None:
        """Fill the row of a run; None: of the undeformed mesh."""
        number = changes.UNDEFORMED if run is None else run.number
        last = session.frames[0] if run is None else run.last
        texts = ["Undeformed" if run is None else f"{number}  {run_words(run)}", "–", "–", "–"]
        if last is not None:
            quality = last.quality
            texts[1:] = (
                format(quality.min, QUALITY),
                format(quality.mean, QUALITY),
                f"{quality.inverted:,}",
            )
        beside = number == session.view.beside
        tip = "The mesh before it is deformed." if run is None else described(run)
        words = "step 0 of each run" if run is None else brief(run, session.runs)
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
            self.actions_table.show(item.data(RUN, NUMBER))

    def _double_clicked(self) -> None:
        """Show the run beside the one shown before the double click, or end that comparison."""
        number, seen = self.tree.number, self.tree.seen_before
        if number is None:
            return
        if seen.run is None or seen.run == number:
            self.store.change(changes.show_beside, None)
            return
        self.store.change(changes.show_run, seen.run)
        self.store.change(changes.show_beside, None if seen.beside == number else number)
        self.store.change(changes.show_frame, seen.frame)

    def _menu_wanted(self, where: QPoint) -> None:
        item = self.tree.itemAt(where)
        if item is None:
            return
        self.menu(item.data(RUN, NUMBER)).popup(self.tree.viewport().mapToGlobal(where))

    def menu(self, number: int) -> QMenu:
        """Return the menu of a run."""
        return self.actions_table.menu(number)
