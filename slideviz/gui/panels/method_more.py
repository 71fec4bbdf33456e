"""The rarely used settings of the method: kernel, radius, angles, and how nodes are selected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QFormLayout, QLabel, QToolButton, QVBoxLayout, QWidget

from slideviz.case.keys import KEYS
from slideviz.case.model import Case, Reduction
from slideviz.errors import CaseError
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import NumberField, angle_limit, positive
from slideviz.gui.widgets.tips import wrapped
from slideviz.terms import KERNELS, LEVEL_CRITERIA, METHODS, METRICS, SELECTIONS, labels, names
from slideviz.view.session.state import Session

TIPS = {
    "kernel": "The radial function; a global one reaches through the whole mesh whatever the "
    "radius, and wants a smaller support radius.",
    "influence_factor": "How far a boundary node reaches into the mesh, as a multiple of the "
    "mesh's largest extent.",
    "feature_angle_deg": "A boundary that turns by more than this angle has an edge there, which "
    "sliding nodes do not cross.",
    "quality_metric": "How cells are judged: Knupp's published size-skew, or as the program "
    "RBF-SliDe computes it for hexahedra.",
    "selection": "How many control nodes data reduction takes in a cycle: a growing block "
    "(fastest), two with opposite errors, or the one with the largest error.",
    "levels": "Whether data reduction selects in levels, each on what the ones before left, and "
    "what ends a level.",
    "level_end": "Number of control nodes of a level, or the part of its error at which it ends.",
    "gamma": "How far the last correction of the boundary reaches, as a multiple of the largest "
    "error that the control nodes leave.",
}
TITLES = {
    "kernel": "Kernel",
    "influence_factor": "Support radius ×",
    "feature_angle_deg": "Feature angle (°)",
    "quality_metric": "Quality",
    "selection": "Selection",
    "levels": "Levels",
    "level_end": "A level ends at",
    "gamma": "Correction radius ×",
}
NO_REDUCTION = "data reduction is off"


class MoreSettings(QWidget):
    """A button that opens and closes a form.

    Signals
    -------
    changed(str, object)
        A setting of the case and its new value.
    """

    changed = Signal(str, object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._reduction = Reduction()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        self.button = QToolButton()
        self.button.setObjectName("more")
        self.button.setText("More settings")
        self.button.setToolTip("Kernel, support radius, feature angle, details of data reduction.")
        self.button.setCheckable(True)
        self.button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.button.toggled.connect(self._show_form)
        layout.addWidget(self.button)
        self.body = QWidget()
        self.form = QFormLayout(self.body)
        self.form.setContentsMargins(0, 0, 0, 0)
        self.form.setVerticalSpacing(4)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        layout.addWidget(self.body)
        self._make_fields()
        self._show_form(False)

    def _make_fields(self) -> None:
        self.kernel = Choice(names(KERNELS))
        self.influence_factor = NumberField(2.5, _radius_problem)
        self.feature_angle_deg = NumberField(40.0, angle_limit)
        self.quality_metric = Choice(labels(METRICS))
        self.selection = Choice(labels(SELECTIONS))
        self.levels = Choice({"none": "none"} | labels(LEVEL_CRITERIA))
        self.level_end = NumberField(16, self._level_problem)
        self.gamma = NumberField(25.0, positive)
        for name, title in TITLES.items():
            label, field = QLabel(title), getattr(self, name)
            field.setObjectName(name)
            label.setToolTip(wrapped(TIPS[name]))
            set_tip(field, TIPS[name])
            self.form.addRow(label, field)
        for name in ("kernel", "quality_metric"):
            getattr(self, name).chosen.connect(self._teller(name))
        for name in ("influence_factor", "feature_angle_deg"):
            getattr(self, name).changed.connect(self._teller(name))
        self.selection.chosen.connect(lambda value: self._reduce(selection=value))
        self.gamma.changed.connect(lambda value: self._reduce(gamma=value))
        self.levels.chosen.connect(self._levels_chosen)
        self.level_end.changed.connect(self._level_end_changed)

    def _teller(self, name: str) -> Callable[[object], None]:
        return lambda value: self.changed.emit(name, value)

    def _reduce(self, **values: object) -> None:
        self.changed.emit("reduction", replace(self._reduction, **values))

    def _levels_chosen(self, value: str) -> None:
        if value == "none":
            self._reduce(multilevel=False)
        else:
            self._reduce(multilevel=True, criterion=value)

    def _level_end_changed(self, value: float) -> None:
        if self._reduction.criterion == "size":
            self._reduce(level_size=round(value))
        else:
            self._reduce(level_tolerance=value)

    def _level_problem(self, value: float) -> str:
        if self._reduction.criterion == "size":
            return "" if value >= 1 and value == round(value) else "a whole number from 1 is needed"
        return "" if 0 < value < 1 else "a number between 0 and 1 is needed"

    def _show_form(self, shown: bool) -> None:
        self.button.setArrowType(Qt.ArrowType.DownArrow if shown else Qt.ArrowType.RightArrow)
        self.body.setVisible(shown)

    def sync(self, session: Session) -> None:
        """Show the session."""
        case = session.case
        for name in ("kernel", "influence_factor", "feature_angle_deg", "quality_metric"):
            getattr(self, name).show_value(getattr(case, name))
        self._reduction = case.reduction or Reduction()
        given = self._reduction
        self.selection.show_value(given.selection)
        self.levels.show_value(given.criterion if given.multilevel else "none")
        by_size = given.criterion == "size"
        self.level_end.show_value(given.level_size if by_size else given.level_tolerance)
        self.gamma.show_value(given.gamma)
        no_method = not_used(case)
        off = no_method or ("" if case.reduction is not None else NO_REDUCTION)
        no_level = off or ("" if given.multilevel else "there are no levels")
        for name, why in (
            ("kernel", no_method),
            ("influence_factor", no_method),
            ("selection", off),
            ("levels", off),
            ("level_end", no_level),
            ("gamma", off),
        ):
            enable(getattr(self, name), why, TIPS[name])


def not_used(case: Case) -> str:
    """Return why settings of radial basis functions do nothing; empty where they do."""
    return "" if case.method == "rbf" else f"{METHODS[case.method].label.lower()} does not use it"


def enable(field: QWidget, why_not: str, tip: str) -> None:
    """Enable a field and explain it, or disable it and say why."""
    field.setEnabled(not why_not)
    set_tip(field, f"Not available: {why_not}." if why_not else tip)


def set_tip(field: QWidget, text: str) -> None:
    """Explain a field and its parts."""
    if hasattr(field, "set_tip"):
        field.set_tip(text)
    if not isinstance(field, NumberField):  # that one may have more urgent things to say
        field.setToolTip(wrapped(text))


def _radius_problem(value: float) -> str:
    """Return why a number is no support radius, as a case file with it would be refused."""
    try:
        KEYS["INFLUENCE_FACTOR"].kind.read(repr(value))
    except CaseError as problem:
        return positive(value) or str(problem)
    return ""
