"""The display panel: colours and their range, chosen cells, points, neighbours, what is drawn."""

from __future__ import annotations

from typing import Any

from qtpy.QtCore import QSize, Qt
from qtpy.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from slideviz.gui.commands import COMMANDS, Now
from slideviz.gui.panels.display_fields import Copies, Span, map_icon
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.services import main_window
from slideviz.gui.widgets.tips import wrapped
from slideviz.mesh.periodic import Pair
from slideviz.scene.passages import Period
from slideviz.session import changes
from slideviz.session.colors import usual_range
from slideviz.session.passages import passages_around
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.terms import COLOUR_BY, COLOUR_MAPS, POINTS_SHOWN, SHOWN, Shown, labels

TIPS = {
    "map": "The colours of values; all are told apart by colour-blind people.",
    "range": "The values at the ends of the colour bar.",
    "fit": COMMANDS["fit_colours"].button,
}
ROLES_ONLY = "Roles have colours of their own: colour by a value first."
NOT_PERIODIC = "No boundary of this mesh repeats another, so it has no neighbouring passages."


class DisplayPanel(QWidget):
    """Shows how the mesh is looked at, and changes it."""

    def __init__(self, store: Store) -> None:
        super().__init__()
        self.store = store
        self._period = Period()
        self._key: tuple[object, ...] = ()
        self.form = QFormLayout(self._make_scroll())
        self.form.setContentsMargins(6, 6, 6, 4)
        self.form.setVerticalSpacing(5)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._make_colours()
        self._make_threshold()
        self._make_rest()
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def _make_scroll(self) -> QWidget:
        outside = QVBoxLayout(self)
        outside.setContentsMargins(0, 0, 0, 0)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        inside = QWidget()
        scroll.setWidget(inside)
        outside.addWidget(scroll)
        return inside

    def _make_colours(self) -> None:
        self.colour_by = self._choice("display_colour_by", labels(COLOUR_BY), "colour_by")
        self.colour_by.setToolTip("What the colours of the view say.")
        self.form.addRow("Colour by", self.colour_by)
        self.map = self._choice("colour_map", labels(COLOUR_MAPS), "colour_map")
        self.map.setIconSize(QSize(64, 12))
        for index, name in enumerate(COLOUR_MAPS):
            self.map.setItemIcon(index, map_icon(name))
        self.form.addRow("Colours", self.map)
        self.range = Span("range", lambda values: self._set(colour_range=values))
        row = QHBoxLayout()
        row.setSpacing(3)
        row.addWidget(self.range, 1)
        self.fit_range = self._button("fit_range", "Fit", "fit_colours")
        self.reset_range = self._button("reset_range", "Reset", "usual_colours")
        row.addWidget(self.fit_range)
        row.addWidget(self.reset_range)
        self.form.addRow("Range", row)

    def _make_threshold(self) -> None:
        self.only = QCheckBox("Only cells")
        self.only.setObjectName("only")
        self.only.setToolTip("Draw only the cells whose value is within these two numbers.")
        self.only.toggled.connect(self._only)
        self.threshold = Span("threshold", lambda values: self._set(threshold=values))
        self.form.addRow(self.only, self.threshold)

    def _make_rest(self) -> None:
        self.points = self._choice("points", labels(POINTS_SHOWN), "points")
        self.points.setToolTip(
            wrapped(
                "Draw nodes as points: those of the boundaries with what they may do, or the "
                "control nodes that the step was interpolated with."
            )
        )
        self.form.addRow("Points", self.points)
        self.copies = Copies()
        # Arrows as large as those of the fields above it.
        self.copies.setMinimumHeight(self.points.sizeHint().height())
        self.copies.valueChanged.connect(self._copies)
        self.copies_label = QLabel("Neighbours")
        self.form.addRow(self.copies_label, self.copies)
        grid = QGridLayout()
        grid.setVerticalSpacing(3)
        self.shown: dict[Shown, QCheckBox] = {}
        for index, (name, term) in enumerate(SHOWN.items()):
            box = QCheckBox(term.label)
            box.setObjectName(f"show_{name}")
            box.clicked.connect(lambda _=False, name=name: COMMANDS[name].do(main_window(self)))
            grid.addWidget(box, index // 2, index % 2)
            self.shown[name] = box
        self.form.addRow("Show", grid)

    def _choice(self, name: str, words: dict, field: str) -> Choice:
        choice = Choice(words)
        choice.setObjectName(name)
        choice.chosen.connect(lambda value: self._set(**{field: value}))
        return choice

    def _button(self, name: str, text: str, command: str) -> QPushButton:
        button = QPushButton(text)
        button.setObjectName(name)
        button.setFixedWidth(button.fontMetrics().horizontalAdvance(text) + 16)
        button.clicked.connect(lambda _=False: COMMANDS[command].do(main_window(self)))
        return button

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Show the session; nothing is done while only steps or selection change."""
        case, view = session.case, session.view
        periodic = case.markers_with("periodic"), case.periodic_type, case.axis, case.origin
        runs = session.runs if view.colour_by == "displacement" else ()
        key = (session.mesh, session.pairs, view.style, periodic, runs)
        if key == self._key:
            return
        self._key = key
        widgets = (self.only, self.copies)
        for widget in widgets:
            widget.blockSignals(True)
        try:
            self._sync(session)
        finally:
            for widget in widgets:
                widget.blockSignals(False)

    def _sync(self, session: Session) -> None:
        view, opened = session.view, session.mesh is not None
        self.setEnabled(opened)
        self.colour_by.show_value(view.colour_by)
        self.map.show_value(view.colour_map)
        valued = view.colour_by != "role"
        for widget in (self.map, self.range, self.fit_range):
            widget.setEnabled(valued)
        self.map.setToolTip(TIPS["map"] if valued else ROLES_ONLY)
        self.range.set_tip(TIPS["range"] if valued else ROLES_ONLY)
        self.fit_range.setToolTip(TIPS["fit"] if valued else ROLES_ONLY)
        self.range.show_values(session.colour_range)
        self.reset_range.setEnabled(valued and view.colour_range is not None)
        back = f"Back to {usual_range(session)}"
        self.reset_range.setToolTip(back if valued else ROLES_ONLY)
        low_high = "The lowest and highest value of the cells that are drawn."
        on = view.threshold is not None
        self.threshold.set_tip(low_high if on else "Switch on “Only cells” to choose a range.")
        self.only.setChecked(view.threshold is not None)
        self.threshold.setEnabled(view.threshold is not None)
        self.threshold.show_values(view.threshold or _worse_half(session))
        self.points.show_value(view.points)
        self._sync_copies(session, self._period.of(session) if opened else None)
        for name, box in self.shown.items():
            box.setChecked(name in view.drawn)
            able, term = COMMANDS[name].enabled(Now(session)), SHOWN[name]
            box.setEnabled(able)
            box.setToolTip(wrapped(term.not_in_2d if opened and not able else term.tip))

    def _sync_copies(self, session: Session, pair: Pair | None) -> None:
        self.copies.setEnabled(pair is not None)
        self.copies_label.setEnabled(pair is not None)
        if pair is None:
            self.copies.setToolTip(wrapped(NOT_PERIODIC))
            self.copies_label.setToolTip(wrapped(NOT_PERIODIC))
            self.copies.setValue(0)
            return
        self.copies.set_around(passages_around(pair))
        count = session.view.copies
        self.copies.setValue(self.copies.maximum() if count < 0 else count)
        tip = (
            f"Neighbouring passages drawn beside the mesh: {pair.first} and {pair.second} repeat "
            f"by {pair.describe()}."
        )
        self.copies.setToolTip(wrapped(tip))
        self.copies_label.setToolTip(wrapped(tip))

    # Widgets to state ------------------------------------------------------------------

    def _set(self, **values: Any) -> None:
        self.store.change(changes.set_view, **values)

    def _only(self, on: bool) -> None:
        self._set(threshold=_worse_half(self.store.session) if on else None)

    def _copies(self, value: int) -> None:
        whole = self.copies.around is not None and value == self.copies.maximum()
        self._set(copies=-1 if whole else value)


def _worse_half(session: Session) -> tuple[float, float]:
    """Return the lower half of the colours: of qualities, what one looks for."""
    low, high = session.colour_range
    return low, low + 0.5 * (high - low)
