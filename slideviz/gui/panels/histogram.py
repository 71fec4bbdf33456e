"""The histogram: how many cells have which quality, and a brush that shows only some of them."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from functools import partial

import numpy as np
from qtpy.QtCore import Qt, QTimer
from qtpy.QtGui import QKeySequence, QPaintEvent, QShortcut
from qtpy.QtWidgets import QCheckBox, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from slideviz.color_scheme import Look
from slideviz.gui.panels.brush import BrushCanvas, Range
from slideviz.gui.responsiveness.settings import SELECTING_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.widgets.plot_canvas import (
    PLOT_FILTERS,
    PlotArea,
    ask_and_write,
    is_seen,
    write_plot,
)
from slideviz.gui.widgets.plot_image import Draw
from slideviz.gui.widgets.services import folder_of
from slideviz.gui.widgets.theme import alarm
from slideviz.plots.session_histogram import (
    Counts,
    draw_histogram,
    first_value,
    shown_measure,
)
from slideviz.sections.threshold import ONLY_INVERTED, chosen_cells, range_words
from slideviz.session import changes
from slideviz.session.state import Frame, Session
from slideviz.session.store import Store


class HistogramPanel(QWidget):
    """The values of the step that is shown, of the undeformed mesh and of other runs."""

    def __init__(self, store: Store, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        self._counts = Counts()
        self._wanted: Range | None = None
        self._told: Frame | None = None
        self.canvas = BrushCanvas(self.drawing)
        self.area = PlotArea(self.canvas)
        self.canvas.brushed.connect(self._brushed)
        self.canvas.held.connect(self._held)
        self.numbers = QLabel()
        self.numbers.setTextFormat(Qt.TextFormat.RichText)
        self.numbers.setWordWrap(True)
        self.range_text = QLabel()
        self.range_text.setWordWrap(True)
        column = QVBoxLayout(self)
        column.setContentsMargins(4, 4, 4, 4)
        column.setSpacing(3)
        column.addWidget(self.area, 1)
        column.addWidget(self.numbers)
        column.addWidget(self.range_text)
        column.addLayout(self._make_buttons())
        self._soon = later(self, self._choose, SELECTING_MS)
        escape = QShortcut(QKeySequence(Qt.Key.Key_Escape), self)
        escape.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        escape.activated.connect(self.clear_range)
        store.listen(self._changed)
        self.sync(store.session)

    def _make_buttons(self) -> QHBoxLayout:
        self.log = QCheckBox("log")
        self.log.setToolTip("Counts on a logarithmic axis, which shows a few bad cells.")
        self.log.setChecked(True)
        self.log.toggled.connect(lambda _: self.canvas.ask())
        self.whole = QCheckBox("0–1")
        self.whole.setObjectName("whole_range")
        self.whole.setToolTip("All values there can be, instead of those that the cells have.")
        self.whole.toggled.connect(lambda _: self.canvas.ask())
        self.show_all = QPushButton("Show all cells")
        self.show_all.setObjectName("show_all_cells")
        self.show_all.setToolTip("Show cells of any value again (Esc).")
        self.show_all.clicked.connect(self.clear_range)
        self.save = QPushButton("Save…")
        self.save.setToolTip("Save the histogram as PNG, SVG or PDF.")
        self.save.clicked.connect(self._save)
        row = QHBoxLayout()
        row.addWidget(self.log)
        row.addWidget(self.whole)
        row.addStretch(1)
        row.addWidget(self.show_all)
        row.addWidget(self.save)
        return row

    # State to widgets ------------------------------------------------------------------

    def _changed(self, old: Session, new: Session) -> None:
        parts = (
            old.frame is new.frame,
            old.runs is new.runs or old.runs == new.runs,
            old.view.colour_by == new.view.colour_by,
            old.view.colour_map == new.view.colour_map,
            old.colour_range == new.colour_range,
            old.view.threshold == new.view.threshold,
            old.view.beside == new.view.beside,
        )
        if not all(parts):
            self.sync(new)

    def sync(self, session: Session) -> None:
        """Show the session."""
        self.whole.setText("from 0" if session.view.colour_by == "displacement" else "0–1")
        for widget in (self.numbers, self.log, self.whole, self.save):
            widget.setVisible(session.frame is not None)
        self.show_all.setVisible(session.frame is not None)
        self.show_all.setEnabled(session.view.threshold is not None)
        if not self._soon.isActive():
            self.canvas.show_band(session.view.threshold)
        if session.frame is None:
            self._counts = Counts()
            self.range_text.hide()
            self.area.say("Open a mesh first: here is how many of its cells have which quality.")
            return
        self.area.plot()
        if is_seen(self):
            self._sync_words(session)
        else:
            self._told = None

    def _sync_words(self, session: Session) -> None:
        if session.frame is None:
            return
        self._told = session.frame
        what = shown_measure(session)
        counted = session.frame.quality.counted
        plain = session.frame.values(what, session.mesh)[counted]
        bad = session.frame.quality.inverted
        low = "highest" if what == "displacement" else "min"
        # Of a node: the values of cells are means of theirs.
        shifts = session.frame.mesh.points - session.mesh.points
        ends = np.linalg.norm(shifts, axis=1).max() if what == "displacement" else plain.min()
        form = ".4g" if what == "displacement" else ".4f"
        red = f" style='color:{alarm()}'" if bad else ""
        self.numbers.setText(
            f"{low} <b>{ends:{form}}</b>&nbsp; mean <b>{plain.mean():{form}}</b>&nbsp; "
            f"<span{red}>inverted <b>{bad:,}</b></span>"
        )
        threshold = session.view.threshold
        self.range_text.setVisible(threshold is not None)
        if threshold is not None:
            values = session.frame.shown_values(what, session.mesh)[counted]
            count = len(chosen_cells(values, threshold))
            self.range_text.setText(
                f"Shown: {range_words(threshold)}, {count:,} of {len(values):,} cells"
            )

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        # Behind another tab nothing was told.
        if self._told is None and self.store.session.frame is not None:
            QTimer.singleShot(0, self, lambda: self._sync_words(self.store.session))

    def take_theme(self, look: Look, _colour: str) -> None:
        """Take the colours of the theme."""
        self.canvas.set_look(look)

    # Drawing ---------------------------------------------------------------------------

    def drawing(self) -> Draw:
        """Return what draws the histogram of what is shown now."""
        session, how = self.store.session, (self.log.isChecked(), self.whole.isChecked())
        return partial(draw_histogram, self._counts, session, how)

    # What the user does ----------------------------------------------------------------

    def _brushed(self, band: Range | None) -> None:
        if band is None:
            self.clear_range()
            return
        # Left of the values only inverted cells are; from there on they belong to it.
        (low, high), left = band, first_value(self.canvas.figure.axes[0])
        self._wanted = ONLY_INVERTED if high < left else (0.0 if low < left else low, high)
        if not self._soon.isActive():
            self._soon.start()

    def _held(self, held: bool) -> None:
        if not held and self._soon.isActive():
            self._soon.stop()
            self._choose()
        self.store.hold(held)

    def _choose(self) -> None:
        if self._wanted is not None:
            self.store.change(changes.set_view, threshold=self._wanted)

    def clear_range(self) -> None:
        """Show cells of any value again."""
        self._soon.stop()
        self._wanted = None
        if self.store.session.view.threshold is not None:
            self.store.change(changes.set_view, threshold=None)
        self.canvas.show_band(None)

    def _save(self) -> None:
        default = folder_of(self) / "histogram.png"
        ask_and_write(
            self, "Save plot", default, PLOT_FILTERS, lambda path: write_plot(path, self.drawing())
        )
