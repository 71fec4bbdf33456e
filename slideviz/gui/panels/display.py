"""The display panel: colors and their range, threshold, points, passages, toggles."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import colormaps
from qtpy.QtCore import QSignalBlocker, QSize
from qtpy.QtGui import QIcon, QImage, QPixmap, QValidator
from qtpy.QtWidgets import QCheckBox, QFormLayout, QGridLayout, QLabel, QPushButton, QWidget

from slideviz.gui.commands import COMMANDS, CommandState
from slideviz.gui.widgets.build import (
    Choice,
    PanelScroll,
    check_box,
    grow_fields,
    in_column,
    in_row,
    push_button,
    wrapped,
)
from slideviz.gui.widgets.fields import NumberBox, VectorField, number_text
from slideviz.gui.widgets.panel import Panel
from slideviz.mesh.periodic import Pair
from slideviz.session import changes
from slideviz.session.colors import usual_range
from slideviz.session.passages import periods_of
from slideviz.session.state import Session
from slideviz.terms import (
    COLOR_BY,
    COLOR_MAPS,
    DIFFERENCES,
    POINTS_SHOWN,
    RANKED,
    SHOWN,
    Range,
    Shown,
    WholeNumbers,
    labels,
    quantity_of,
)

TIPS = {
    "map": "The colors of values; color-blind people can distinguish all of them.",
    "range": "The values at the ends of the color bar.",
    "fit": COMMANDS["fit_colors"].button_tip,
}
ROLES_ONLY = "Roles have colors of their own: color by a value first."
DIVERGING = "Differences go from orange below 0 by white to purple above."
NOT_PERIODIC = "No boundary of this mesh repeats another, so it has no neighbouring passages."


MOST_PASSAGES = 9
"""Most neighbouring passages on each side for translational periodicity, which is endless."""

_PASSAGES = re.compile(r"(\d{1,9})(?: on each side)?|all(?: [\d and]+ around)?")
"""What can be typed as a number of passages."""

ONLY = "Draw only the cells whose value is within these two numbers."
POINTS = (
    "Draw nodes as points: boundary nodes by the way they may move, or the control nodes of the "
    "step."
)


class PassagesBox(NumberBox):
    """A spin box for the number of neighbouring passages; its maximum means the whole wheel."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("passages")
        self.around: WholeNumbers = ()
        self.set_around(())

    def set_around(self, around: WholeNumbers) -> None:
        """Set the passages in the wheel of each zone; () for translational periodicity."""
        self.around = around
        self.setRange(0, max(max(around) // 2, 1) if around else MOST_PASSAGES)

    def textFromValue(self, value: int) -> str:
        if value == 0:
            return "0"
        if self.around and value == self.maximum():
            return f"all {' and '.join(map(str, self.around))} around"
        return f"{value} on each side"

    def valueFromText(self, text: str) -> int:
        typed = _PASSAGES.fullmatch(text.strip())
        if typed is None:
            return 0
        return self.maximum() if typed[1] is None else int(typed[1])

    def validate(self, text: str, at: int) -> tuple[QValidator.State, str, int]:
        good = _PASSAGES.fullmatch(text.strip()) and self.valueFromText(text) <= self.maximum()
        return QValidator.State.Acceptable if good else QValidator.State.Intermediate, text, at


class RangeField(VectorField):
    """Two number fields for a range; the low number must stay below the high one."""

    def __init__(self, name: str) -> None:
        super().__init__((0.0, 1.0), _not_ascending, ("", "to"))
        self._labels[0].hide()
        self.low, self.high = self.fields
        for end, field in (("low", self.low), ("high", self.high)):
            field.setObjectName(f"{name}_{end}")
            field.setAccessibleName(f"{name} {end}")


def _not_ascending(ends: Sequence[float]) -> str:
    low, high = ends
    return "" if low < high else f"{number_text(low)} must be less than {number_text(high)}"


def map_icon(name: str) -> QIcon:
    """Return an icon of a color map, from low to high."""
    row = (np.asarray(colormaps[name](np.linspace(0.0, 1.0, 64))) * 255).astype(np.uint8)
    pixels = np.ascontiguousarray(np.repeat(row[None], 12, axis=0))
    image = QImage(pixels.tobytes(), 64, 12, 64 * 4, QImage.Format.Format_RGBA8888)
    return QIcon(QPixmap.fromImage(image.copy()))


class DisplayPanel(Panel):
    """The panel of the view's colors, threshold, points, passages and toggles."""

    def make(self) -> None:
        content = QWidget()
        in_column(PanelScroll(content), on=self)
        self.form = QFormLayout(content, rowWrapPolicy=QFormLayout.RowWrapPolicy.WrapLongRows)
        self.form.setContentsMargins(6, 6, 6, 4)
        grow_fields(self.form, 5)
        self._make_colors()
        self._make_rest()
        self.follow(_shown)

    def _make_colors(self) -> None:
        self.color_by = self._choice("display_color_by", labels(COLOR_BY), "color_by")
        self.color_by.setToolTip("What the colors of the view show.")
        self.form.addRow("Color by", self.color_by)
        self.map = self._choice("color_map", labels(COLOR_MAPS), "color_map")
        self.map.setIconSize(QSize(64, 12))
        for index, name in enumerate(COLOR_MAPS):
            self.map.setItemIcon(index, map_icon(name))
        self.form.addRow("Colors", self.map)
        self.range = RangeField("range")
        self.range.changed.connect(lambda values: self._set(color_range=values))
        self.fit_range = self._button("fit_range", "Fit", "fit_colors")
        self.reset_range = self._button("reset_range", "Reset", "usual_colors")
        parts = (self.range, self.fit_range, self.reset_range)
        self.form.addRow("Range", in_row(*parts, wide=[self.range], spacing=3))
        self.only = check_box("Only cells", ONLY, self._only, "only")
        self.threshold = RangeField("threshold")
        self.threshold.changed.connect(lambda values: self._set(threshold=values))
        self.form.addRow(self.only, self.threshold)

    def _make_rest(self) -> None:
        self.points = self._choice("points", labels(POINTS_SHOWN), "points")
        self.points.setToolTip(wrapped(POINTS))
        self.form.addRow("Points", self.points)
        self.passages = PassagesBox()
        # As high as the fields above it, so that the arrows are.
        self.passages.setMinimumHeight(self.points.sizeHint().height())
        self.passages.valueChanged.connect(self._passages)
        self.passages_label = QLabel("Neighbours")
        self.form.addRow(self.passages_label, self.passages)
        grid = QGridLayout()
        grid.setVerticalSpacing(3)
        self.shown: dict[Shown, QCheckBox] = {}
        for index, (name, term) in enumerate(SHOWN.items()):
            box = QCheckBox(term.label)
            box.setObjectName(f"show_{name}")
            box.clicked.connect(lambda _=False, name=name: COMMANDS[name].do(self.services))
            grid.addWidget(box, index // 2, index % 2)
            self.shown[name] = box
        self.form.addRow("Show", grid)

    def _choice(self, name: str, words: dict, field: str) -> Choice:
        choice = Choice(words, name=name)
        choice.chosen.connect(lambda value: self._set(**{field: value}))
        return choice

    def _button(self, name: str, text: str, command: str) -> QPushButton:
        button = push_button(text, "", lambda: COMMANDS[command].do(self.services), name)
        button.setFixedWidth(button.fontMetrics().horizontalAdvance(text) + 16)
        return button

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        with QSignalBlocker(self.only), QSignalBlocker(self.passages):
            self._sync(session)

    def _sync(self, session: Session) -> None:
        view = session.view
        opened = session.mesh is not None
        self.setEnabled(opened)
        self.color_by.show_value(view.color_by)
        self.map.show_value(view.color_map)
        valued = view.color_by != "role"
        for widget in (self.range, self.fit_range):
            widget.setEnabled(valued)
        own = bool(COLOR_BY[view.color_by].color_map)
        self.map.setEnabled(valued and not own)
        tip = DIVERGING if own else TIPS["map"]
        self.map.setToolTip(tip if valued else ROLES_ONLY)
        self.range.set_tip(TIPS["range"] if valued else ROLES_ONLY)
        self.fit_range.setToolTip(TIPS["fit"] if valued else ROLES_ONLY)
        self.range.show_value(session.color_range)
        self.reset_range.setEnabled(valued and view.color_range is not None)
        back = f"Back to {usual_range(session)}"
        self.reset_range.setToolTip(back if valued else ROLES_ONLY)
        low_high = "The lowest and highest value of the cells that are drawn."
        on = view.threshold is not None
        self.threshold.set_tip(low_high if on else "Switch on “Only cells” to choose a range.")
        self.only.setChecked(view.threshold is not None)
        if session.lacks_cells:
            self.only.setEnabled(False)
        self.only.setToolTip(wrapped(session.lacks_cells or ONLY))
        self.threshold.setEnabled(view.threshold is not None)
        self.threshold.show_value(view.threshold or _worse_half(session))
        self.points.show_value(view.points)
        self._sync_passages(session, periods_of(session))
        for name, box in self.shown.items():
            box.setChecked(name in view.drawn)
            able = COMMANDS[name].enabled(CommandState(session))
            term = SHOWN[name]
            box.setEnabled(able)
            box.setToolTip(wrapped(term.why_not if opened and not able else term.tip))

    def _sync_passages(self, session: Session, pairs: Sequence[Pair]) -> None:
        tip = NOT_PERIODIC
        count = 0
        if pairs:
            around = tuple(pair.around for pair in pairs if pair.around is not None)
            self.passages.set_around(around if len(around) == len(pairs) else ())
            count = session.view.passages
            by = (f"{one.first} and {one.second} repeat by {one.describe()}" for one in pairs)
            tip = f"Neighbouring passages drawn beside the mesh: {'; '.join(by)}."
        if not self.passages.fault:
            self.passages.setValue(self.passages.maximum() if count < 0 else count)
        for widget in (self.passages, self.passages_label):
            widget.setEnabled(bool(pairs))
        self.passages.set_tip(tip)
        self.passages_label.setToolTip(wrapped(tip))

    # Widgets to state ------------------------------------------------------------------
    def _set(self, **values: Any) -> None:
        self.change(changes.set_view, **values)

    def _only(self, on: bool) -> None:
        self._set(threshold=_worse_half(self.session) if on else None)

    def _passages(self, value: int) -> None:
        whole = bool(self.passages.around) and value == self.passages.maximum()
        self._set(passages=-1 if whole else value)


def _shown(session: Session) -> object:
    case = session.case
    view = session.view
    periodic = case.markers_with("periodic"), case.periodic_type, case.axis, case.origin
    runs = session.runs if view.color_by in ("displacement", *DIFFERENCES) else ()
    style = replace(view.style, handle="")
    return session.reference, session.pairs, style, periodic, runs


def _worse_half(session: Session) -> Range:
    """Return the worse half of the color range, which is the first threshold."""
    low, high = session.color_range
    middle = low + 0.5 * (high - low)
    term = RANKED.get(quantity_of(session.view.color_by))
    return (middle, high) if term is not None and term.best == "low" else (low, middle)
