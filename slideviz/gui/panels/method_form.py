"""The fields of the method panel, in a form that scrolls."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtCore import QPoint, QRect, Qt
from qtpy.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from slideviz.gui.panels.method_more import MoreSettings, set_tip
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import (
    NumberBox,
    NumberField,
    VectorField,
    a_direction,
    positive,
)
from slideviz.gui.widgets.tips import wrapped
from slideviz.terms import METHODS, PERIODIC_MODES, PERIODIC_TYPES, SLIDING, labels, tips

MAX_STEPS = 9999

TIPS = {
    "method": "How the inner nodes follow: by radial basis functions, or to compare with them, as "
    "means weighted with the inverse distance to the boundary, or as an elastic body whose cells "
    "are the stiffer the smaller they are (as SU2 deforms by default).",
    "sliding": "Whether the nodes of sliding boundaries stay (none), slide and are put back on the "
    "boundary in stages (pseudo), or slide as part of the system itself (direct).",
    "periodic": "What the periodic boundaries do: nothing special (none), only the distance "
    "repeats (periodic), or both sides deform alike with the corners of the domain held (fixed "
    "vertices) or sliding along (moving vertices).",
    "periodic_type": "Whether one side is the other one shifted or turned; automatic takes what "
    "matches.",
    "axis": "The axis that the mesh repeats about, for rotational periodicity.",
    "origin": "A point on that axis.",
    "steps": "Into how many equal parts the motion is divided: more keep large motions valid and "
    "take longer; automatic (0) takes as few as give no inverted cell.",
    "reduction": "Interpolate with some of the boundary nodes, as many as the tolerance needs, and "
    "correct the rest: for meshes whose boundary has more than some thousand nodes.",
    "tolerance": "The largest error at the boundary that the control nodes may leave to the "
    "correction, in the mesh's length unit.",
}


class MethodForm(QWidget):
    """The fields; who shows a case in them says which there are."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        layout = self._make_scroll()
        self.form = QFormLayout()
        self.form.setVerticalSpacing(4)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        layout.addLayout(self.form)
        self._make_fields()
        self.reason = QLabel()
        self.reason.setWordWrap(True)
        self.reason.setProperty("hint", True)
        layout.addWidget(self.reason)
        self.more = MoreSettings()
        layout.addWidget(self.more)
        layout.addStretch(1)

    def _make_scroll(self) -> QVBoxLayout:
        outside = QVBoxLayout(self)
        outside.setContentsMargins(0, 0, 0, 0)
        self.scroll = WholeScroll()
        self.scroll.setWidgetResizable(True)
        self.scroll.setFrameShape(QFrame.Shape.NoFrame)
        self.scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        outside.addWidget(self.scroll)
        inside = QWidget()
        self.scroll.setWidget(inside)
        layout = QVBoxLayout(inside)
        layout.setContentsMargins(6, 6, 6, 4)
        return layout

    def _make_fields(self) -> None:
        self.method = Choice(labels(METHODS))
        self.sliding = Choice(labels(SLIDING))
        self.sliding.explain(tips(SLIDING))
        self.periodic = Choice(labels(PERIODIC_MODES))
        self.periodic.explain(tips(PERIODIC_MODES))
        self.periodic_type = Choice(labels(PERIODIC_TYPES))
        self.axis = VectorField((0.0, 0.0, 1.0), a_direction)
        self.origin = VectorField((0.0, 0.0, 0.0))
        self.found = QLabel()
        self.found.setWordWrap(True)
        self.found.setProperty("hint", True)
        self.steps = NumberBox()
        self.steps.setRange(0, MAX_STEPS)
        self.steps.setSpecialValueText("automatic")
        self.steps.setMinimumHeight(self.sliding.sizeHint().height())
        self.reduction = QCheckBox("Use fewer control nodes")
        self.tolerance = NumberField(1e-3, positive)
        self.tolerance_hint = QLabel()
        self.tolerance_hint.setProperty("hint", True)
        self.guess_text = QLabel()
        self.guess_text.setWordWrap(True)
        self.guess_text.setProperty("hint", True)
        rows = (
            ("Method", "method"),
            ("Sliding", "sliding"),
            ("Periodicity", "periodic"),
            ("Type", "periodic_type"),
            ("Axis", "axis"),
            ("Through", "origin"),
        )
        for title, name in rows:
            self._add_row(title, name)
        self.form.addRow("", self.found)
        self._add_row("Steps", "steps")
        self._add_row("Data reduction", "reduction")
        both = QWidget()
        line = QHBoxLayout(both)
        line.setContentsMargins(0, 0, 0, 0)
        line.addWidget(self.tolerance, 1)
        line.addWidget(self.tolerance_hint)
        self._add_row("Tolerance", "tolerance", both)
        self.form.addRow(self.guess_text)

    def _add_row(self, title: str, name: str, widget: QWidget | None = None) -> None:
        label, field = QLabel(title), getattr(self, name)
        field.setObjectName(name)
        label.setToolTip(wrapped(TIPS[name]))
        set_tip(field, TIPS[name])
        self.form.addRow(label, widget or field)


class WholeScroll(QScrollArea):
    """Shows a field whole when the tab key comes to it, not only where its cursor is."""

    def focusNextPrevChild(self, forwards: bool) -> bool:
        moved = super().focusNextPrevChild(forwards)
        field = self.widget().focusWidget()
        if moved and field is not None:
            place = QRect(field.mapTo(self.widget(), QPoint(0, 0)), field.size())
            for y in (place.bottom(), place.top()):
                self.ensureVisible(place.left(), y, 0, 6)
        return moved
