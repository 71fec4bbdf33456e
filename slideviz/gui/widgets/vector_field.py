"""A field for a point or a direction: two or three numbers that are checked together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QLabel, QSizePolicy, QWidget

from slideviz.gui.widgets.build import in_row
from slideviz.gui.widgets.fields import NumberField, unless


class VectorField(QWidget):
    """A row of fields for two or three numbers.

    ``allowed`` returns why the numbers are not valid together, or an empty text. While they are
    not, they are marked and ``changed`` is not emitted.
    """

    changed = Signal(tuple)

    def __init__(
        self,
        values: Sequence[float] = (0.0, 0.0, 0.0),
        allowed: Callable[[Sequence[float]], str] | None = None,
        names: Sequence[str] = "xyz",
        tip: str = "",
    ) -> None:
        super().__init__()
        self._allowed = allowed or (lambda _: "")
        self.fields = [NumberField(value, tip=tip) for value in values]
        self._labels = [QLabel(name) for name in names]
        for label, field in zip(self._labels, self.fields, strict=True):
            field.setAccessibleName(label.text())
            field.changed.connect(lambda _: self._emit_changed())
        pairs = chain(*zip(self._labels, self.fields, strict=True))
        line = in_row(*pairs, wide=self.fields, spacing=4)
        line.setContentsMargins(0, 0, 0, 0)
        self.setLayout(line)
        self.count = len(self.fields)
        self._good = self.value
        self._scale = 0.0
        self._compare()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    @property
    def value(self) -> tuple[float, ...]:
        """Return the numbers, as many as the mesh has dimensions."""
        return tuple(field.value for field in self.fields[: self.count])

    @property
    def problem(self) -> str:
        """Return why the numbers are not valid together; empty if they are."""
        return self._allowed(self.value)

    def _emit_changed(self) -> None:
        if not self.problem:
            self._good = self.value
            self.changed.emit(self.value)
        self._mark()

    def restore(self) -> None:
        """Replace invalid texts by the last valid numbers, without emitting a signal."""
        for field in self.fields:
            field.restore()
        self._write(self._good)

    def _mark(self) -> None:
        for field in self.fields:
            field.together = self.problem
            field.mark()

    def set_count(self, count: int) -> None:
        """Show only the first ``count`` numbers."""
        self.count = count
        for index, (label, field) in enumerate(zip(self._labels, self.fields, strict=True)):
            label.setVisible(index < count)
            field.setVisible(index < count)

    def set_scale(self, scale: float) -> None:
        """Set the length beside which rounding errors are shown as 0."""
        self._scale = scale
        self._compare()

    def show_value(self, values: Sequence[float]) -> None:
        """Set the numbers; nothing is emitted, and invalid numbers being typed stay."""
        if not (self.problem and tuple(values) == self._good):
            self._write(values)

    def _write(self, values: Sequence[float]) -> None:
        self._good = tuple(values)
        for field, value in zip(self.fields, values, strict=False):
            field.show_value(value)
        self._compare()
        self._mark()

    def _compare(self) -> None:
        """Make each field show 0 for a rounding error, compared with the largest number."""
        scale = max(self._scale, *(abs(field.value) for field in self.fields))
        for field in self.fields:
            field.set_scale(scale)

    def set_tip(self, text: str) -> None:
        for field in self.fields:
            field.set_tip(text)
        self._mark()


a_direction = unless(any, "an axis needs a direction: not all may be 0")
"""The check of an axis."""
control_point_problem = unless(
    lambda values: all(value == int(value) and value >= -1 for value in values),
    "expected whole numbers from 0, or -1 for all",
)
"""The check of the index of a control point."""
