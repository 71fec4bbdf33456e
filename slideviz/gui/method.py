"""The method panel: sliding, periodicity, steps, data reduction, and more."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from qtpy.QtCore import Qt, QTimer
from qtpy.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from slideviz.case.model import Reduction
from slideviz.gui.fields import Choice, NumberField, VectorField, a_direction, positive
from slideviz.gui.method_more import NO_REDUCTION, MoreSettings, enable, not_used, set_tip
from slideviz.mesh.periodic import Pair
from slideviz.view import changes
from slideviz.view.motion_words import direction_words
from slideviz.view.state import Session
from slideviz.view.store import Store

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


class MethodPanel(QWidget):
    """Shows the settings of the case and changes them."""

    def __init__(self, store: Store, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        self._mesh = None
        self._extent = 0.0
        self._reduction: Reduction | None = None
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
        self.more.changed.connect(self._set)
        self.more.button.toggled.connect(
            # When its form has been laid out.
            lambda on: on and QTimer.singleShot(0, self, self._show_more)
        )
        layout.addWidget(self.more)
        layout.addStretch(1)
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def _make_scroll(self) -> QVBoxLayout:
        outside = QVBoxLayout(self)
        outside.setContentsMargins(0, 0, 0, 0)
        self.scroll = QScrollArea()
        self.scroll.setWidgetResizable(True)
        self.scroll.setFrameShape(QFrame.Shape.NoFrame)
        self.scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        outside.addWidget(self.scroll)
        inside = QWidget()
        self.scroll.setWidget(inside)
        layout = QVBoxLayout(inside)
        layout.setContentsMargins(6, 6, 6, 4)
        return layout

    def _show_more(self) -> None:
        """Scroll to the settings that have opened below the others."""
        self.scroll.widget().adjustSize()
        bar = self.scroll.verticalScrollBar()
        bar.setValue(min(self.more.y(), bar.maximum()))

    def _make_fields(self) -> None:
        self.method = Choice(
            {
                "rbf": "RBF interpolation",
                "idw": "Inverse distance weighting",
                "elastic": "Linear elasticity",
            }
        )
        self.sliding = Choice({"none": "none", "ps": "pseudo sliding", "ds": "direct sliding"})
        self.periodic = Choice(
            {
                "none": "none",
                "periodic": "periodic distance",
                "fixed": "periodic, fixed vertices",
                "moving": "periodic, moving vertices",
            }
        )
        self.periodic_type = Choice(
            {"auto": "automatic", "translational": "translational", "rotational": "rotational"}
        )
        self.axis = VectorField((0.0, 0.0, 1.0), a_direction)
        self.origin = VectorField((0.0, 0.0, 0.0))
        self.found = QLabel()
        self.found.setWordWrap(True)
        self.found.setProperty("hint", True)
        self.steps = StepsBox()
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
        self._connect()

    def _add_row(self, title: str, name: str, widget: QWidget | None = None) -> None:
        label, field = QLabel(title), getattr(self, name)
        field.setObjectName(name)
        label.setToolTip(TIPS[name])
        set_tip(field, TIPS[name])
        self.form.addRow(label, widget or field)

    def _connect(self) -> None:
        for name in ("method", "sliding", "periodic", "periodic_type"):
            getattr(self, name).chosen.connect(lambda value, name=name: self._set(name, value))
        self.axis.changed.connect(lambda value: self._set("axis", value))
        self.origin.changed.connect(lambda value: self._set("origin", value))
        self.steps.valueChanged.connect(lambda value: self._set("steps", value))
        self.reduction.toggled.connect(self._reduction_toggled)
        self.tolerance.changed.connect(self._tolerance_changed)

    def _set(self, name: str, value: object) -> None:
        if getattr(self.store.session.case, name) != value:
            self.store.change(changes.set_case, **{name: value})

    def _reduction_toggled(self, on: bool) -> None:
        # What was set before it was switched off comes back with it.
        mesh = self.store.session.mesh
        first = self._reduction or (changes.suggested_reduction(mesh) if mesh else Reduction())
        self._set("reduction", first if on else None)

    def _tolerance_changed(self, value: float) -> None:
        given = self.store.session.case.reduction or Reduction()
        self._set("reduction", replace(given, tolerance=value, relative=None))

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Show the session."""
        case = session.case
        for name in ("method", "sliding", "periodic", "periodic_type"):
            getattr(self, name).show_value(getattr(case, name))
        self.axis.show_value(case.axis)
        self.origin.set_scale(self._extent)
        self.origin.show_value(case.origin)
        if self.steps.value() != case.steps:
            self.steps.blockSignals(True)
            self.steps.setValue(case.steps)
            self.steps.blockSignals(False)
        self._sync_reduction(session)
        self.more.sync(session)
        self._sync_reasons(session)
        text = found_text(session)
        self.found.setText(text)
        self.form.setRowVisible(self.found, bool(text))

    def _sync_reduction(self, session: Session) -> None:
        given = session.case.reduction
        if session.mesh is not self._mesh:
            self._mesh, self._reduction = session.mesh, None
            # Once for each mesh: it takes 10 ms where there are 250,000 cells.
            self._extent = session.mesh.extent if session.mesh is not None else 0.0
        self._reduction = given or self._reduction
        self.reduction.blockSignals(True)
        self.reduction.setChecked(given is not None)
        self.reduction.blockSignals(False)
        no_method = not_used(session.case)
        enable(self.reduction, no_method, TIPS["reduction"])
        enable(self.tolerance, no_method or ("" if given else NO_REDUCTION), TIPS["tolerance"])
        extent = self._extent
        if self._reduction is not None:
            of_extent = self._reduction.relative
            absolute = of_extent * extent if of_extent else self._reduction.tolerance
            self.tolerance.show_value(float(f"{absolute:.6g}"))
        part = f"{self.tolerance.value / extent:.3g} of the extent" if extent and given else ""
        self.tolerance_hint.setText(part)
        self.guess_text.setText(session.reduction_guess)
        self.form.setRowVisible(self.guess_text, bool(session.reduction_guess))

    def _sync_reasons(self, session: Session) -> None:
        case = session.case
        roles = set(case.roles.values())
        no_pair = "" if "periodic" in roles else "no boundary has the role “periodic”"
        slides = roles & {"sliding", "periodic", "internal"}
        no_slide = "" if slides else "no boundary has the role “sliding” or “periodic”"
        rotational = case.periodic_type != "translational" and "rotational" in _kinds(session)
        rotational = rotational or case.periodic_type == "rotational"
        no_axis = no_pair or ("" if rotational else "only rotational periodicity has an axis")
        for name, why in (
            ("sliding", no_slide),
            ("periodic", no_pair),
            ("periodic_type", no_pair),
            ("axis", no_axis),
            ("origin", no_axis),
        ):
            enable(getattr(self, name), why, TIPS[name])
        for name in ("axis", "origin"):
            self.form.setRowVisible(getattr(self, name), not no_axis)
        reasons = list(
            dict.fromkeys(
                f"{title}: {why}."
                for title, why in (("Sliding", no_slide), ("Periodicity", no_pair))
                if why
            )
        )
        self.reason.setText(
            "\n".join(reasons) if session.mesh is not None else "Open a mesh first."
        )
        self.reason.setVisible(bool(self.reason.text()))


class StepsBox(QSpinBox):
    """The number of steps; the wheel scrolls the panel instead of changing it."""

    def wheelEvent(self, event) -> None:
        event.ignore()


def _kinds(session: Session) -> set[str]:
    names = set(session.case.markers_with("periodic"))
    return {pair.kind for pair in session.pairs if {pair.first, pair.second} <= names}


def period_text(pair: Pair) -> str:
    """Return the period of a pair in a few words: λ or θ, and along or about what."""
    if pair.kind == "rotational":
        return f"θ = {math.degrees(pair.period):.6g}° about {_axis(pair.axis)}"
    return f"λ = {pair.period:.6g} along {_axis(pair.vector / pair.period)}"


def _axis(direction: Sequence[float]) -> str:
    """Return an axis in words: which of its two ways it is told does not matter."""
    return direction_words(direction).removeprefix("-")


def found_text(session: Session) -> str:
    """Return the period of the periodic boundaries that matched, in words."""
    names = session.case.markers_with("periodic")
    lines = [
        f"Found: {pair.first} → {pair.second}, {period_text(pair)}"
        for pair in session.pairs
        if pair.first in names and pair.second in names
    ]
    if not lines and len(names) >= 2 and session.mesh is not None:
        lines.append("No match found yet between the periodic boundaries; the run will try.")
    return "\n".join(lines)
