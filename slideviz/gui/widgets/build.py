"""The small parts of panels and dialogs: layouts, buttons, labels, tooltips, drop-down lists."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, TypeVar

from qtpy.QtCore import (
    QEvent,
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QSize,
    Qt,
    Signal,
    SignalInstance,
)
from qtpy.QtGui import (
    QFocusEvent,
    QFont,
    QFontDatabase,
    QFontMetrics,
    QHelpEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QStandardItemModel,
    QWheelEvent,
)
from qtpy.QtWidgets import (
    QAbstractItemView,
    QBoxLayout,
    QCheckBox,
    QComboBox,
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
    QSizePolicy,
    QSpinBox,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionComboBox,
    QStyleOptionViewItem,
    QStylePainter,
    QToolButton,
    QToolTip,
    QVBoxLayout,
    QWidget,
)

from slideviz.gui.widgets.theme import set_icon


def rich_label(text: str) -> QLabel:
    """Return a label for rich text; names in it must be escaped."""
    return QLabel(text, textFormat=Qt.TextFormat.RichText)


class LinkLabel(QLabel):
    """A word-wrapped label for rich text, whose links are reached by the tab key too."""

    def __init__(self) -> None:
        super().__init__(wordWrap=True, textFormat=Qt.TextFormat.RichText)

    def setText(self, text: str) -> None:
        super().setText(text)
        keyboard = Qt.TextInteractionFlag.LinksAccessibleByKeyboard
        flags = Qt.TextInteractionFlag.LinksAccessibleByMouse
        # Without a link, the tab key passes over the label.
        self.setTextInteractionFlags(flags | keyboard if "<a " in text else flags)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        # Qt would give the focus to the label first, and to a link by the next Tab.
        if event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason):
            self.focusNextPrevChild(event.reason() == Qt.FocusReason.TabFocusReason)


def fixed_font() -> QFont:
    """Return the system's monospaced font."""
    return QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)


def plain_labels(widget: QWidget) -> None:
    """Set the labels in a widget to plain text, except those made for rich text.

    By default Qt guesses: a boundary named ``<img src=...>`` would be shown as a picture.
    """
    for label in widget.findChildren(QLabel):
        if label.textFormat() == Qt.TextFormat.AutoText:
            label.setTextFormat(Qt.TextFormat.PlainText)


LETTERS = 60  # average number of letters in a line of a tooltip


def wrapped(text: str) -> str:
    """Return a tooltip's text, wrapped at about `LETTERS` letters by means of rich text.

    A text of short lines is returned as it is. Markup in the text, which may be the name of a
    boundary or file, is escaped.
    """
    short = all(len(line) <= LETTERS + 10 for line in text.splitlines())
    if short and not Qt.mightBeRichText(text):  # type: ignore[attr-defined]  # not in PySide's stubs
        return text
    width = round(1.05 * LETTERS * QFontMetrics(QToolTip.font()).averageCharWidth())
    lines = html.escape(text, quote=False).replace("\n", "<br>")
    return f"<table width='{width}'><tr><td>{lines}</td></tr></table>"


ALIGN_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
ALIGN_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter

ModelIndex: TypeAlias = QModelIndex | QPersistentModelIndex
"""An index into an item model, as Qt passes it to a delegate."""


class ElidedLabel(QLabel):
    """A label whose text is cut with an ellipsis where it is too long; its width is free.

    ``mode``: where the ellipsis is.
    """

    def __init__(
        self, text: str = "", mode: Qt.TextElideMode = Qt.TextElideMode.ElideRight
    ) -> None:
        super().__init__(text)
        self._mode = mode
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        # A long text must not make its container wider.
        set_policy(self, "Ignored", "Fixed")

    @property
    def shown(self) -> str:
        """Return the text as painted: cut with an ellipsis if it is too long."""
        room = self.contentsRect().width()
        return self.fontMetrics().elidedText(self.text(), self._mode, room)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        self.style().drawItemText(
            painter,
            self.contentsRect(),
            self.alignment().value,
            self.palette(),
            self.isEnabled(),
            self.shown,
            self.foregroundRole(),
        )


class Fitted:
    """Mixed into a class of widgets, before that of Qt: fits its content to each new size."""

    def fit(self) -> None:
        """Fit the content to the present size."""
        raise NotImplementedError

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)  # type: ignore[misc]  # of the widget's class
        self.fit()


class WideLabel(Fitted, QScrollArea):
    """A word-wrapped label as wide as its container, which scrolls a text of too many lines.

    ``lines``: most lines that are visible at once.
    """

    def __init__(self, lines: int) -> None:
        super().__init__()
        self.label = QLabel(
            textFormat=Qt.TextFormat.PlainText,
            wordWrap=True,
            alignment=Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop,
            textInteractionFlags=Qt.TextInteractionFlag.TextSelectableByMouse,
        )
        self._most = lines * self.label.fontMetrics().lineSpacing() + 2
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setWidgetResizable(True)
        self.setWidget(self.label)

    def show_text(self, text: str) -> None:
        """Show a text from its beginning; hide the label if it is empty."""
        self.label.setText(text)
        self.setVisible(bool(text))
        self.verticalScrollBar().setValue(0)
        self.fit()

    def fit(self) -> None:
        high = self.label.heightForWidth(self.viewport().width())
        self.setFixedHeight(max(min(high, self._most), 0))


class _Narrow(QStyledItemDelegate):
    """A delegate whose size hint has no width, so that items are as wide as the list."""

    def sizeHint(self, option: QStyleOptionViewItem, index: ModelIndex) -> QSize:
        return QSize(0, super().sizeHint(option, index).height())


def elide_items(items: QAbstractItemView) -> None:
    """Make the items of a list end with an ellipsis instead of scrolling sideways."""
    items.setItemDelegate(_Narrow(items))
    items.setTextElideMode(Qt.TextElideMode.ElideRight)
    items.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)


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
    margins: int | tuple[int, int, int, int] = 0,
) -> QVBoxLayout:
    """Return a vertical layout of parts; those in ``wide`` share the spare height.

    If ``on`` is given, the layout is set on this widget, with ``margins`` in pixels.
    """
    layout = QVBoxLayout()
    if on is not None:
        on.setLayout(layout)
        edges = (margins,) * 4 if isinstance(margins, int) else margins
        layout.setContentsMargins(*edges)
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


class TwoPartRow(Fitted, QWidget):
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

    def fit(self) -> None:
        widths = [half.minimumSize().width() for half in self._halves]
        wide = sum(widths) + self._row.spacing() <= self.width()
        kind = QBoxLayout.Direction
        self._row.setDirection(kind.LeftToRight if wide else kind.TopToBottom)

    def minimumSizeHint(self) -> QSize:
        widths = [half.minimumSize().width() for half in self._halves]
        return QSize(max(widths), super().minimumSizeHint().height())

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:
            self.fit()
        return super().event(event)


class PanelScroll(QScrollArea):
    """A scroll area for a panel; a field reached by the tab key is scrolled into view."""

    def __init__(self, content: QWidget) -> None:
        super().__init__(widgetResizable=True)
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
    if not text:
        button.setAccessibleName(tip)  # for screen readers
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
    low: float,
    high: float,
    value: float,
    changed: Slot | None = None,
    *,
    unit: str = "",
    tip: str = "",
) -> Any:
    """Return a spin box for a number from ``low`` to ``high``, with its unit as suffix.

    For whole numbers if ``low`` is an int, else for numbers with one decimal.
    """
    box: Any = QSpinBox() if isinstance(low, int) else QDoubleSpinBox(decimals=1)
    box.setRange(low, high)
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
    label = QLabel(text, wordWrap=True)
    label.setProperty("hint", True)
    if align is not None:
        label.setAlignment(align)
    return label


def drop(layout: QLayout, widgets: Iterable[QWidget]) -> None:
    """Take widgets out of a layout for good."""
    for widget in widgets:
        layout.removeWidget(widget)
        widget.hide()
        widget.deleteLater()


PolicyName = Literal["Fixed", "Preferred", "Expanding", "Ignored"]


def set_policy(widget: QWidget, across: PolicyName, down: PolicyName) -> None:
    """Set how a widget's width and height follow the space that there is, by Qt's names."""
    widget.setSizePolicy(QSizePolicy.Policy[across], QSizePolicy.Policy[down])


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


Value = TypeVar("Value")
MARGIN = 4  # space that the style leaves beside the text, in pixels


class Choice(QComboBox):
    """A drop-down list of values, each shown by a text; the wheel does not change the value."""

    chosen = Signal(object)
    """The value that the user has chosen; not emitted by `show_value`."""

    def __init__(
        self,
        words: Mapping[Value, str],
        tip: str = "",
        name: str = "",
        tips: Mapping[Any, str] | None = None,
    ) -> None:
        super().__init__()
        self.setToolTip(wrapped(tip))
        self.setObjectName(name)
        self.offer(words)
        self.set_tips(tips or {})
        self.setMinimumContentsLength(8)
        self.activated.connect(lambda _: self.chosen.emit(self.currentData()))

    def offer(self, words: Mapping[Value, str]) -> None:
        """Offer other values, each shown by a text; none is chosen anew where they are the same."""
        rows = range(self.count())
        if [(self.itemData(row), self.itemText(row)) for row in rows] != list(words.items()):
            self.clear()
            for value, text in words.items():
                self.addItem(text, value)

    def show_value(self, value: object) -> None:
        """Select the entry of a value, if there is one; `chosen` is not emitted."""
        index = self.findData(value)
        if index >= 0 and index != self.currentIndex():
            self.setCurrentIndex(index)

    def set_item_enabled(self, value: object, offered: bool) -> None:
        """Let the entry of a value be chosen, or not."""
        model = self.model()
        assert isinstance(model, QStandardItemModel)
        model.item(self.findData(value)).setEnabled(offered)

    def set_tips(self, tips: Mapping[Any, str]) -> None:
        """Set the tooltips of entries, by their values."""
        for value, tip in tips.items():
            self.setItemData(self.findData(value), wrapped(tip), Qt.ItemDataRole.ToolTipRole)

    def showPopup(self) -> None:
        # Make the list as wide as its longest text: the closed box may be narrower.
        frame = self.style().pixelMetric(QStyle.PixelMetric.PM_ScrollBarExtent) + 2 * MARGIN
        self.view().setMinimumWidth(self.view().sizeHintForColumn(0) + frame)
        # After Escape, Qt would open the list at the entry that was under the mouse.
        self.view().setCurrentIndex(self.model().index(self.currentIndex(), self.modelColumn()))
        super().showPopup()

    @property
    def shown(self) -> str:
        """Return the text as painted: cut with an ellipsis if it is too long."""
        return self._option().currentText

    def _option(self) -> QStyleOptionComboBox:
        """Return the style option to paint, its text cut with an ellipsis if it is too long."""
        option = QStyleOptionComboBox()
        self.initStyleOption(option)
        part = QStyle.SubControl.SC_ComboBoxEditField
        kind = QStyle.ComplexControl.CC_ComboBox
        room = self.style().subControlRect(kind, option, part, self).width() - MARGIN
        option.currentText = option.currentText or self.placeholderText()
        if not option.currentIcon.isNull():
            room -= option.iconSize.width() + MARGIN
        elided = Qt.TextElideMode.ElideRight
        option.currentText = self.fontMetrics().elidedText(option.currentText, elided, room)
        return option

    def event(self, event: QEvent) -> bool:
        """Show the whole text above the tooltip, where the box is too narrow for it."""
        if isinstance(event, QHelpEvent) and self.shown not in ("", self.currentText()):
            parts = (html.escape(self.currentText()), self.toolTip())
            QToolTip.showText(event.globalPos(), "<br>".join(filter(None, parts)), self)
            return True
        return super().event(event)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QStylePainter(self)
        option = self._option()
        painter.drawComplexControl(QStyle.ComplexControl.CC_ComboBox, option)
        painter.drawControl(QStyle.ControlElement.CE_ComboBoxLabel, option)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()
