"""Layouts, buttons and labels in a line each, for panels and dialogs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from qtpy.QtCore import QEvent, QPoint, QRect, QSize, Qt, SignalInstance
from qtpy.QtGui import QResizeEvent
from qtpy.QtWidgets import (
    QBoxLayout,
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QMenu,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QSpinBox,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from slideviz.gui.widgets.icons import set_icon
from slideviz.gui.widgets.labels import wrapped

Part = QWidget | QLayout | int | None
"""An item of a row or column; None is a stretch, a number a space in pixels."""
Slot = Callable[..., object] | SignalInstance
Box = TypeVar("Box", bound=QBoxLayout)


# Layouts -----------------------------------------------------------------------------------
def in_row(*parts: Part, wide: Sequence[Part] = (), spacing: int = -1) -> QHBoxLayout:
    """Return a horizontal layout of parts, of which those in ``wide`` share the spare width."""
    return _filled(QHBoxLayout(), parts, wide, spacing)


def in_column(
    *parts: Part,
    wide: Sequence[Part] = (),
    spacing: int = -1,
    on: QWidget | None = None,
    margins: tuple[int, int, int, int] = (0, 0, 0, 0),
) -> QVBoxLayout:
    """Return a vertical layout of parts; those in ``wide`` share the spare height.

    If ``on`` is given, the layout is set on this widget, with ``margins`` in pixels.
    """
    layout = QVBoxLayout()
    if on is not None:
        on.setLayout(layout)
        layout.setContentsMargins(*margins)
    return _filled(layout, parts, wide, spacing)


def _filled(layout: Box, parts: Sequence[Part], wide: Sequence[Part], spacing: int) -> Box:
    if spacing >= 0:
        layout.setSpacing(spacing)
    for part in parts:
        stretch = int(any(part is one for one in wide))
        if part is None:
            layout.addStretch(1)
        elif isinstance(part, int):
            layout.addSpacing(part)
        elif isinstance(part, QLayout):
            layout.addLayout(part, stretch)
        else:
            layout.addWidget(part, stretch)
    return layout


def as_widget(layout: QLayout) -> QWidget:
    """Return a new widget with a layout, without margins."""
    widget = QWidget()
    layout.setContentsMargins(0, 0, 0, 0)
    widget.setLayout(layout)
    return widget


def grow_fields(form: QFormLayout, spacing: int = 4) -> None:
    """Make the fields of a form as wide as it is, with a vertical spacing in pixels."""
    form.setVerticalSpacing(spacing)
    form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)


class WrappingRow(QWidget):
    """A row with some parts at the left and some at the right, which are below where it is narrow.

    ``spacing``: space between the parts in pixels; negative: the style's. ``apart``: whether the
    parts at the right are at the end of the row.
    """

    def __init__(
        self,
        left: Sequence[QWidget],
        right: Sequence[QWidget],
        spacing: int = -1,
        apart: bool = True,
    ) -> None:
        super().__init__()
        rights = (None, *right) if apart else (*right, None)
        self._halves = [in_row(*left, None, spacing=spacing), in_row(*rights, spacing=spacing)]
        self._row = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(max(spacing, 2))
        for half in self._halves:
            self._row.addLayout(half)
        self._row.setStretch(1, 1)

    def _fold(self) -> None:
        widths = [half.minimumSize().width() for half in self._halves]
        wide = sum(widths) + self._row.spacing() <= self.width()
        kind = QBoxLayout.Direction
        self._row.setDirection(kind.LeftToRight if wide else kind.TopToBottom)

    def minimumSizeHint(self) -> QSize:
        widths = [half.minimumSize().width() for half in self._halves]
        return QSize(max(widths), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fold()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:
            self._fold()
        return super().event(event)


class PanelScroll(QScrollArea):
    """A scroll area for a panel; a field reached by the tab key is scrolled into view."""

    def __init__(self, content: QWidget) -> None:
        super().__init__()
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setWidget(content)
        # Opaque children would leave nothing of a dock's visible region.
        for part in (self.viewport(), content):
            part.setAutoFillBackground(False)

    def focusNextPrevChild(self, forwards: bool) -> bool:
        moved = super().focusNextPrevChild(forwards)
        if moved:
            reveal(self.window().focusWidget())
        return moved


def reveal(field: QWidget | None) -> None:
    """Scroll a field, if there is one, into view in the scroll areas of panels around it."""
    area = field
    while field is not None and area is not None:
        inside = area.widget() if isinstance(area, PanelScroll) else None
        if inside is not None and isinstance(area, PanelScroll):
            # Qt itself scrolls only the text cursor into view.
            place = QRect(field.mapTo(inside, QPoint(0, 0)), field.size())
            for y in (place.bottom(), place.top()):
                area.ensureVisible(place.left(), y, 0, 6)
        area = area.parentWidget()


def on_screen(content: QWidget, dialog: QWidget) -> QWidget:
    """Return the content of a dialog; in a scroll area if the screen is too small."""
    # The dialog has margins, a title, and buttons below.
    room = dialog.screen().availableSize() - QSize(40, 120)
    wanted = content.sizeHint()
    if wanted.boundedTo(room) == wanted:
        return content
    area = PanelScroll(content)
    area.setMinimumSize((wanted + QSize(20, 20)).boundedTo(room))
    return area


# Buttons -----------------------------------------------------------------------------------
def push_button(text: str, tip: str, do: Slot, name: str = "") -> QPushButton:
    """Return a push button with a text that calls ``do`` when clicked; ``name``: object name."""
    button = QPushButton(text)
    button.setObjectName(name)
    button.setToolTip(wrapped(tip))
    button.clicked.connect(do)
    return button


def tool_button(
    tip: str,
    do: Slot | None = None,
    *,
    image: str = "",
    text: str = "",
    menu: QMenu | None = None,
    name: str = "",
) -> QToolButton:
    """Return a tool button with an icon, a text or both, which calls ``do`` or opens a menu."""
    button = QToolButton()
    button.setObjectName(name)
    button.setToolTip(wrapped(tip))
    button.setText(text)
    if image:
        set_icon(button, image)
    if image and text:
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
    if menu is not None:
        if menu.parent() is None:
            menu.setParent(button, menu.windowFlags())
        button.setMenu(menu)
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
    if do is not None:
        button.clicked.connect(do)
    return button


def check_box(text: str, tip: str, toggled: Slot | None = None, name: str = "") -> QCheckBox:
    """Return a check box."""
    box = QCheckBox(text)
    box.setObjectName(name)
    box.setToolTip(wrapped(tip))
    if toggled is not None:
        box.toggled.connect(toggled)
    return box


def number_box(
    low: int, high: int, value: int, changed: Slot | None = None, *, unit: str = "", tip: str = ""
) -> QSpinBox:
    """Return a spin box for a whole number from ``low`` to ``high``, with its unit as suffix."""
    box = QSpinBox()
    box.setRange(low, high)
    return _completed(box, value, changed, unit, tip)


def decimal_box(
    low: float,
    high: float,
    value: float,
    changed: Slot | None = None,
    *,
    unit: str = "",
    tip: str = "",
) -> QDoubleSpinBox:
    """Return a spin box for a number with one decimal, from ``low`` to ``high``, with its unit."""
    box = QDoubleSpinBox()
    box.setRange(low, high)
    box.setDecimals(1)
    return _completed(box, value, changed, unit, tip)


def _completed(box: Any, value: float, changed: Slot | None, unit: str, tip: str) -> Any:
    box.setValue(value)
    box.setSuffix(unit)
    box.setToolTip(tip)
    if changed is not None:
        box.valueChanged.connect(changed)
    return box


def dialog_buttons(dialog: QDialog, *kinds: QDialogButtonBox.StandardButton) -> QDialogButtonBox:
    """Return the buttons of a dialog, connected to its ``accept`` and ``reject``."""
    buttons = QDialogButtonBox()
    for kind in kinds:
        buttons.addButton(kind)
    buttons.accepted.connect(dialog.accept)
    buttons.rejected.connect(dialog.reject)
    return buttons


# Labels and bars ---------------------------------------------------------------------------
def hint_label(text: str = "", align: Qt.AlignmentFlag | None = None) -> QLabel:
    """Return a label for a hint: word-wrapped, in the theme's soft color."""
    label = QLabel(text)
    label.setWordWrap(True)
    label.setProperty("hint", True)
    if align is not None:
        label.setAlignment(align)
    return label


def set_style(widget: QWidget, name: str, value: bool) -> None:
    """Set a property of a widget that the style sheet selects by, such as ``bad``; restyle it."""
    if widget.property(name) != value:
        widget.setProperty(name, value)
        widget.style().unpolish(widget)
        widget.style().polish(widget)


class QuietBar(QProgressBar):
    """A progress bar that is repainted in the next turn of the event loop, not at each `setValue`.

    Qt's own repaints itself at once. In a window with an OpenGL view, each repaint composes the
    whole window, which takes 10 to 20 ms without a graphics card.
    """

    def setValue(self, value: int) -> None:
        self.setUpdatesEnabled(False)
        super().setValue(value)
        self.setUpdatesEnabled(True)
