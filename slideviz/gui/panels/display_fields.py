"""Fields of the display panel: neighbouring passages in words, two rising numbers, maps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from qtpy.QtGui import QIcon, QImage, QPixmap, QValidator
from qtpy.QtWidgets import QHBoxLayout, QLabel, QWidget

from slideviz.gui.widgets.fields import NumberBox, NumberField, number_text

MOST_COPIES = 9
"""Neighbours on each side that can be chosen where a row has no end."""


class Copies(NumberBox):
    """How many neighbouring passages are drawn, in words; the last value is all of a wheel."""

    letters = "al"  # of "all"

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("copies")
        self.around: int | None = None
        self.set_around(None)

    def set_around(self, around: int | None) -> None:
        """Take how many passages the wheel has; None: a row without an end."""
        self.around = around
        self.setRange(0, MOST_COPIES if around is None else max(around // 2, 1))

    def textFromValue(self, value: int) -> str:  # noqa: N802
        """Return the words for a number of neighbours."""
        if value == 0:
            return "0"
        if self.around is not None and value == self.maximum():
            return f"all {self.around} around"
        return f"{value} on each side"

    def valueFromText(self, text: str) -> int:  # noqa: N802
        """Return the number that is typed, or that words stand for."""
        if text.strip().startswith("all"):
            return self.maximum()
        digits = "".join(sign for sign in text if sign.isdigit())
        return min(int(digits), self.maximum()) if digits else 0

    def validate(self, text: str, at: int) -> tuple[QValidator.State, str, int]:
        """Let anything be typed that a number can be read from."""
        good = any(sign.isdigit() for sign in text) or text.strip() == "all"
        state = QValidator.State.Acceptable if good else QValidator.State.Intermediate
        return state, text, at


class Span(QWidget):
    """Two numbers, the first below the second."""

    def __init__(self, name: str, changed: Callable[[tuple[float, float]], object]) -> None:
        super().__init__()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        self.low = NumberField(0.0, lambda value: self._must(value < self.high.value, value, "<"))
        self.high = NumberField(1.0, lambda value: self._must(value > self.low.value, value, ">"))
        for end, field in (("low", self.low), ("high", self.high)):
            field.setObjectName(f"{name}_{end}")
            field.setAccessibleName(f"{name} {end}")
            field.changed.connect(lambda _: changed((self.low.value, self.high.value)))
        row.addWidget(self.low, 1)
        row.addWidget(QLabel("to"))
        row.addWidget(self.high, 1)

    def _must(self, good: bool, value: float, sign: str) -> str:
        """Return why a number may not be at its end; empty where it may."""
        if good:
            return ""
        than, other = ("less", self.high) if sign == "<" else ("greater", self.low)
        return f"{number_text(value)} must be {than} than {number_text(other.value)}"

    def show_values(self, values: tuple[float, float]) -> None:
        """Show two numbers without telling."""
        for field, value in zip((self.low, self.high), values, strict=True):
            if value != field.value:
                field.show_value(value)

    def set_tip(self, text: str) -> None:
        """Explain both."""
        self.low.set_tip(text)
        self.high.set_tip(text)


def map_icon(name: str) -> QIcon:
    """Return a picture of a colour map, from low to high."""
    from matplotlib import colormaps

    row = (np.asarray(colormaps[name](np.linspace(0.0, 1.0, 64))) * 255).astype(np.uint8)
    pixels = np.ascontiguousarray(np.repeat(row[None], 12, axis=0))
    image = QImage(pixels.tobytes(), 64, 12, 64 * 4, QImage.Format.Format_RGBA8888)
    return QIcon(QPixmap.fromImage(image.copy()))
