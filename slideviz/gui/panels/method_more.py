"""The rarely used settings of the method: kernel, radius, angles, and how nodes are selected."""

from __future__ import annotations

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QToolButton, QVBoxLayout, QWidget

from slideviz.case.key import Key
from slideviz.case.keys import KEYS
from slideviz.case.model import Case, Reduction
from slideviz.gui.panels.key_form import KeyForm
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import NumberField, number_text
from slideviz.terms import LEVEL_CRITERIA, labels

LEVEL_ENDS = {"size": KEYS["LVL_SIZE"], "tol": KEYS["LVL_TOL_CRIT"]}
"""The key that says where a level ends, by the criterion."""


class MoreSettings(QWidget):
    """A button that opens and closes a form.

    Signals
    -------
    changed(object, object)
        The row of the table of keys, and the new value.
    """

    changed = Signal(object, object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._criterion = Reduction().criterion
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
        self.levels = Choice({"none": "none", **labels(LEVEL_CRITERIA)})
        self.levels.setObjectName("levels")
        self.levels.chosen.connect(self._levels_chosen)
        self.level_end = NumberField(16, lambda value: self._level.kind.problem(number_text(value)))
        self.level_end.setObjectName("level_end")
        self.level_end.changed.connect(self._level_end_changed)
        self.form = KeyForm("more", {"MULTILEVEL": self.levels, "LVL_SIZE": self.level_end})
        self.form.setContentsMargins(0, 0, 0, 0)
        self.form.changed.connect(self.changed)
        self.body = QWidget()
        self.body.setLayout(self.form)
        layout.addWidget(self.body)
        self._show_form(False)

    @property
    def _level(self) -> Key:
        return LEVEL_ENDS[self._criterion]

    def _levels_chosen(self, value: str) -> None:
        self.changed.emit(KEYS["MULTILEVEL"], value != "none")
        if value != "none":
            self.changed.emit(KEYS["MULTI_CRIT"], value)

    def _level_end_changed(self, value: float) -> None:
        self.changed.emit(self._level, self._level.kind.read(number_text(value)))

    def _show_form(self, shown: bool) -> None:
        self.button.setArrowType(Qt.ArrowType.DownArrow if shown else Qt.ArrowType.RightArrow)
        self.body.setVisible(shown)

    def sync(self, case: Case, spare: Case) -> None:
        """Show the settings of a case, and of a spare one those that the case has not."""
        given = case.reduction or spare.reduction
        self._criterion = given.criterion
        self.levels.show_value(given.criterion if given.multilevel else "none")
        self.level_end.show_value(self._level.get(case.change(reduction=given)))
        self.form.sync(case, spare, {})
