"""The panel of the worst cells of the shown step; a click flies to a cell and marks it."""

from __future__ import annotations

import time
from collections.abc import Callable
from html import escape

from qtpy.QtCore import QModelIndex, Qt, QTimer
from qtpy.QtGui import QGuiApplication, QKeySequence, QPaintEvent, QShortcut
from qtpy.QtWidgets import QLabel, QStackedWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.commands import COMMANDS
from slideviz.gui.panels.worst_table import SINCE, WorstModel, WorstTable
from slideviz.gui.responsiveness.timers import REST_MS, single_shot
from slideviz.gui.widgets.build import in_column, in_row, push_button
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import ask_and_write, is_seen, words_label
from slideviz.gui.widgets.services import folder_of, main_window
from slideviz.gui.widgets.theme import alarm
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import Pair
from slideviz.session import changes
from slideviz.session.inspect import (
    cell_info,
    coordinates,
    measure,
    nearest_boundary,
    table_rows,
    worst_cells,
)
from slideviz.session.motions import machine_pair
from slideviz.session.run_messages import to_mend
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.system.csv_table import write_csv
from slideviz.terms import COLOR_BY, SIZE_SKEW


class WorstPanel(Panel):
    """The table of the worst cells (`WORST` of them); the marked cell is the current row.

    ``fly_to`` and ``fly_back``: move the camera to a cell; move it back to where it was.
    """

    def __init__(
        self, store: Store, fly_to: Callable[[int], None], fly_back: Callable[[], None]
    ) -> None:
        super().__init__(store)
        self._fly_to = fly_to
        self._listed_key: tuple[object, ...] = ()
        self._last = 0.0
        self._marked: int | None = None
        self._info_key: tuple[object, ...] = ()
        self.model = WorstModel()
        # The model's signals keep the panel alive: as its child, the model is deleted with it.
        self.model.setParent(self)
        self.table = self._make_table()
        self.words = words_label()
        self.info = QLabel()
        self.info.setObjectName("cell_info")
        self.info.setWordWrap(True)
        self.info.setTextFormat(Qt.TextFormat.RichText)
        self.info.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.stack = QStackedWidget()
        self.stack.addWidget(self.words)
        self.stack.addWidget(self.table)
        self.back = push_button(
            "Whole mesh",
            "Return to the view before the flight to a cell.",
            # The mark stays: that is how the cell is found in the whole mesh.
            fly_back,
        )
        self.export = push_button(
            "Export CSV…",
            "Write the list with every digit as comma-separated values.",
            self._export,
        )
        mend = COMMANDS["repair"]
        self.repair = push_button("Repair", mend.tip, lambda: mend.do(main_window(self)), "repair")
        parts = (self.stack, self.info, in_row(self.back, self.repair, None, self.export))
        in_column(*parts, wide=[self.stack], spacing=3, on=self, margins=(4, 4, 4, 4))
        self._timer = single_shot(self, lambda: self.sync(self.session))
        for keys, function in (
            (QKeySequence(Qt.Key.Key_Escape), self.unmark),
            (QKeySequence(QKeySequence.StandardKey.Copy), self.copy_rows),
        ):
            shortcut = QShortcut(keys, self)
            shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            shortcut.activated.connect(function)
        self.follow()

    def _make_table(self) -> WorstTable:
        table = WorstTable(self.model)
        table.row_activated.connect(self._fly_to_row)
        table.clicked.connect(self._clicked)
        self.model.modelReset.connect(lambda: self._sync_mark(self.session))
        return table

    # State to widgets ------------------------------------------------------------------
    def take_theme(self, _scheme: ColorScheme) -> None:
        self._info_key = ()
        self._sync_mark(self.session)

    def sync(self, session: Session) -> None:
        """Show the worst cells of the session's step; during play, at most every `REST_MS`."""
        there = session.frame is not None
        self.stack.setCurrentWidget(self.table if there else self.words)
        for widget in (self.back, self.export):
            widget.setVisible(there)
        self.repair.setVisible(to_mend(session) is not None)
        if not there:
            self.info.hide()
            self.words.setText("Open a mesh first. Then this panel lists its worst cells.")
            self.model.show(None)
            self._listed_key = ()
        elif is_seen(self) and self._key(session) != self._listed_key:
            since = (time.monotonic() - self._last) * 1000.0
            if since >= REST_MS:
                self._fill(session)
            elif not self._timer.isActive():
                self._timer.start(round(REST_MS - since))
        if is_seen(self):
            self._sync_mark(session)

    @staticmethod
    def _key(session: Session) -> tuple[object, ...]:
        return (
            session.frame,
            len(session.frames),
            measure(session.view.color_by),
            machine_pair(session),
        )

    def _fill(self, session: Session) -> None:
        if session.frame is None or self._key(session) == self._listed_key:
            return
        self._listed_key = self._key(session)
        self._last = time.monotonic()
        at = session.frames.index(session.frame)
        what = measure(session.view.color_by)
        worst = worst_cells(session.frames, at, what)
        title = f"{COLOR_BY[what].axis}, of the step that is shown"
        self.table.horizontalHeader().setToolTip(title)
        self.model.show(worst, machine_pair(session))
        self.table.setColumnHidden(SINCE, what not in SIZE_SKEW)  # others are not followed

    def _sync_mark(self, session: Session) -> None:
        """Make the marked cell the current row, and show its facts."""
        cell = session.view.marked_cell
        row = self.model.row_of(cell)
        current = self.table.currentIndex()
        if row != (current.row() if current.isValid() else -1):
            if row >= 0:
                self.table.selectRow(row)
            elif self._marked is not None:  # what is selected to be copied stays
                self.table.clearSelection()
                self.table.setCurrentIndex(QModelIndex())
        self._marked = cell
        frame = session.frame
        cell = cell if frame is not None and frame.has(cell) else None
        self.info.setVisible(cell is not None)
        if cell is not None:
            key = session.frame, cell, machine_pair(session)
            if key != self._info_key:
                # Finding the nearest boundary of a large mesh takes a while.
                self._info_key = key
                self.info.setText(info_text(session, cell))
                self.info.setToolTip(info_text(session, cell, every=True))

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        session = self.session
        # While the panel was behind another tab, the list was not filled.
        if session.frame is not None and self._key(session) != self._listed_key:
            QTimer.singleShot(0, self, lambda: self.sync(self.session))

    # What the user does ----------------------------------------------------------------
    def _fly_to_row(self, row: int) -> None:
        cell = self.model.cell(row)
        self.change(changes.mark_cell, cell)
        self._fly_to(cell)

    def show_worst(self) -> None:
        self.change(changes.show_frame, len(self.session.frames) - 1)
        self._fill(self.session)
        if self.model.worst is not None:
            self._fly_to_row(self.model.row_of(int(self.model.worst.cells[0])))

    def _clicked(self, index: QModelIndex) -> None:
        if self.model.cell(index.row()) == self.session.view.marked_cell:
            self.unmark()
        else:
            self._fly_to_row(index.row())

    def unmark(self) -> None:
        if self.session.view.marked_cell is not None:
            self.change(changes.mark_cell, None)

    def copy_rows(self) -> None:
        """Copy the selected rows (all, if none is) to the clipboard, below the column names."""
        if self.model.worst is None:
            return
        chosen = sorted(index.row() for index in self.table.selectionModel().selectedRows())
        order = self.model.order[chosen] if chosen else self.model.order
        rows = table_rows(self.model.worst)
        lines = [rows[0], *(rows[1 + at] for at in order)]
        QGuiApplication.clipboard().setText("\n".join("\t".join(line) for line in lines) + "\n")

    def _export(self) -> None:
        self._fill(self.session)
        worst = self.model.worst
        if worst is None:
            return
        ask_and_write(
            self,
            "Export worst cells",
            folder_of(self) / "worst_cells.csv",
            "Comma-separated values (*.csv)",
            lambda path: write_csv(path, table_rows(worst)),
        )


def info_text(session: Session, cell: int, every: bool = False) -> str:
    """Return the facts of a cell of the shown step, as rich text of a few lines.

    ``every``: list the Jacobian at every corner, not only their range.
    """
    assert session.frame is not None
    info = cell_info(session.frame, cell)
    red = f" style='color:{alarm()}'" if info.state == "inverted" else ""
    state = "" if info.state == "valid" else f", <span{red}>{info.state}</span>"
    around = machine_pair(session)
    parts = f"size {info.size:.4f}&nbsp; skew {info.skew:.4f}"
    zone = f" of zone {info.zone}" if info.zone is not None else ""
    lines = [
        f"<b>Cell {info.cell}</b>{zone}, {info.kind}{state}",
        f"size-skew <b>{info.size_skew:.4f}</b>&nbsp; {parts}",
        _place_text(info.position, around),
    ]
    if around is not None:
        lines.append(_place_text(info.position, None))
    near = nearest_boundary(session.frame.mesh, info.position)
    if near is not None:
        lines.append(f"{near[1]:.4g} from {escape(near[0])}, the nearest boundary")
    ends = f"{info.jacobians.min():.3g} to {info.jacobians.max():.3g}"
    corners = ", ".join(f"{value:.3g}" for value in info.jacobians)
    lines.append(f"corner Jacobians: {corners if every else ends}")
    return "<br>".join(lines)


def _place_text(position: FloatArray, around: Pair | None) -> str:
    names, values = coordinates(position[None], around)
    return "&nbsp; ".join(
        f"{name.removesuffix(' [°]')} {value:.7g}{'°' if '°' in name else ''}"
        for name, value in zip(names, values[0], strict=True)
    )
