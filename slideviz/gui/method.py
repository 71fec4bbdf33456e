"""The method panel: sliding, periodicity, steps, and the numbers of the interpolation."""

from __future__ import annotations

import math
from collections.abc import Sequence

from qtpy.QtWidgets import QFormLayout, QLabel, QSpinBox, QVBoxLayout, QWidget

from slideviz.gui.fields import Choice, NumberField, VectorField, angle_limit, positive
from slideviz.mesh.periodic import Pair
from slideviz.view import changes
from slideviz.view.state import Session
from slideviz.view.store import Store

AXES = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
MAX_STEPS = 9999

TIPS = {
    "sliding": "Whether the nodes of sliding boundaries stay (none), slide and are put back on the "
    "boundary in stages (pseudo), or slide as part of the system itself (direct).",
    "periodic": "What the periodic boundaries do: nothing special (none), only the distance "
    "repeats (periodic), or both sides deform alike with the corners of the domain held (fixed "
    "vertices) or sliding along (moving vertices).",
    "periodic_type": "Whether one side is the other one shifted or turned; automatic takes what "
    "matches.",
    "axis": "The axis that the mesh repeats about, for rotational periodicity.",
    "origin": "A point on that axis.",
    "steps": "Into how many equal parts the motion is divided; more steps take longer and keep "
    "large motions valid.",
    "influence_factor": "How far a boundary node reaches into the mesh, as a multiple of the "
    "mesh's largest extent.",
    "feature_angle_deg": "A boundary that turns by more than this angle has an edge there, which "
    "sliding nodes do not cross.",
    "quality_metric": "How cells are judged: Knupp's published size-skew, or as the program "
    "RBF-SliDe computes it for hexahedra.",
}


class MethodPanel(QWidget):
    """Shows the settings of the case and changes them."""

    def __init__(self, store: Store, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        layout = QVBoxLayout(self)
        layout.setContentsMargins(6, 6, 6, 4)
        self.form = QFormLayout()
        self.form.setVerticalSpacing(4)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        layout.addLayout(self.form)
        self._make_fields()
        self.reason = QLabel()
        self.reason.setWordWrap(True)
        self.reason.setProperty("hint", True)
        layout.addWidget(self.reason)
        layout.addStretch(1)
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def _make_fields(self) -> None:
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
        self.axis = VectorField((0.0, 0.0, 1.0))
        self.origin = VectorField((0.0, 0.0, 0.0))
        self.found = QLabel()
        self.found.setWordWrap(True)
        self.found.setProperty("hint", True)
        self.steps = QSpinBox()
        self.steps.setRange(0, MAX_STEPS)
        self.steps.setSpecialValueText("automatic")
        self.steps.setMinimumHeight(self.sliding.sizeHint().height())
        self.influence_factor = NumberField(2.5, positive)
        self.feature_angle_deg = NumberField(40.0, angle_limit)
        self.quality_metric = Choice({"knupp": "Knupp", "rbf-slide": "as RBF-SliDe"})
        rows = (
            ("Sliding", "sliding"),
            ("Periodicity", "periodic"),
            ("Type", "periodic_type"),
            ("Axis", "axis"),
            ("Through", "origin"),
        )
        for title, name in rows:
            self._add_row(title, name)
        self.form.addRow("", self.found)
        rows = (
            ("Steps", "steps"),
            ("Support radius ×", "influence_factor"),
            ("Feature angle (°)", "feature_angle_deg"),
            ("Quality", "quality_metric"),
        )
        for title, name in rows:
            self._add_row(title, name)
        self._connect()

    def _add_row(self, title: str, name: str) -> None:
        label, field = QLabel(title), getattr(self, name)
        field.setObjectName(name)
        label.setToolTip(TIPS[name.removesuffix("_")])
        self._tip(field, TIPS[name])
        self.form.addRow(label, field)

    def _tip(self, field: QWidget, text: str) -> None:
        if hasattr(field, "set_tip"):
            field.set_tip(text)
        field.setToolTip(text)

    def _connect(self) -> None:
        for name in ("sliding", "periodic", "periodic_type", "quality_metric"):
            getattr(self, name).chosen.connect(lambda value, name=name: self._set(name, value))
        for name in ("influence_factor", "feature_angle_deg"):
            getattr(self, name).changed.connect(lambda value, name=name: self._set(name, value))
        self.axis.changed.connect(self._axis_changed)
        self.origin.changed.connect(lambda value: self._set("origin", value))
        self.steps.valueChanged.connect(lambda value: self._set("steps", value))

    def _set(self, name: str, value: object) -> None:
        if getattr(self.store.session.case, name) != value:
            self.store.change(changes.set_case, **{name: value})

    def _axis_changed(self, value: tuple[float, ...]) -> None:
        if any(value):
            self._set("axis", value)

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Show the session."""
        case = session.case
        for name in ("sliding", "periodic", "periodic_type", "quality_metric"):
            getattr(self, name).show_value(getattr(case, name))
        for name in ("influence_factor", "feature_angle_deg"):
            getattr(self, name).show_value(getattr(case, name))
        self.axis.show_value(case.axis)
        self.origin.show_value(case.origin)
        if self.steps.value() != case.steps:
            self.steps.blockSignals(True)
            self.steps.setValue(case.steps)
            self.steps.blockSignals(False)
        self._sync_reasons(session)
        text = found_text(session)
        self.found.setText(text)
        self.form.setRowVisible(self.found, bool(text))

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
            field = getattr(self, name)
            field.setEnabled(not why)
            self._tip(field, f"Not available: {why}." if why else TIPS[name])
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


def _kinds(session: Session) -> set[str]:
    names = set(session.case.markers_with("periodic"))
    return {pair.kind for pair in session.pairs if {pair.first, pair.second} <= names}


def period_text(pair: Pair) -> str:
    """Return the period of a pair in a few words: λ or θ, and along or about what."""
    if pair.kind == "rotational":
        return f"θ = {math.degrees(pair.period):.6g}° about {axis_text(pair.axis)}"
    return f"λ = {pair.period:.6g} along {axis_text(pair.vector / pair.period)}"


def axis_text(direction: Sequence[float]) -> str:
    """Return a direction as x, y or z where it is one, else its components."""
    whole = (*direction, 0.0)[:3]
    for axis, name in AXES.items():
        if abs(abs(sum(a * b for a, b in zip(axis, whole, strict=True))) - 1.0) < 1e-6:
            return name
    return f"({', '.join(f'{v:.4g}' for v in direction)})"


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
