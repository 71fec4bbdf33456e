"""The light and the dark theme: colors of widgets, icons and texts, in Qt's Fusion style."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import Qt
from qtpy.QtGui import QColor, QPalette
from qtpy.QtWidgets import QApplication, QToolTip

from slideviz.color_scheme import DARK, LIGHT, ColorScheme

THEMES = ("system", "light", "dark")  # the themes that can be chosen

_PALETTE = {
    "Window": ("#f4f6f8", "#262b31"),
    "WindowText": ("#20262e", "#e6eaf0"),
    "Base": ("#ffffff", "#1d2126"),
    "AlternateBase": ("#f2f5f8", "#23282e"),
    "Text": ("#20262e", "#e6eaf0"),
    "Button": ("#eef1f4", "#333a42"),
    "ButtonText": ("#20262e", "#e6eaf0"),
    "Highlight": ("#2f6fb5", "#3d7fc4"),
    "HighlightedText": ("#ffffff", "#ffffff"),
    "ToolTipBase": ("#ffffff", "#3a424b"),
    "ToolTipText": ("#20262e", "#f2f5f8"),
    "PlaceholderText": ("#7b8591", "#8a95a2"),
    "Link": ("#1f5f9f", "#77b0ea"),
    "Mid": ("#c3cad2", "#47505a"),
    "disabled": ("#7f8994", "#7d8894"),
    "Light": ("", "#4d5763"),
}
"""Colors of Qt's palette, by role, in the light and the dark theme; empty: Qt's own.

``disabled`` is the text color of all disabled widgets."""

_STYLE = {
    "title": ("#e4e9ee", "#30363e"),
    "hover": ("#e0e6ec", "#3a424b"),
    "checked": ("#d3e2f2", "#34516f"),
    "line": ("#ccd3da", "#3e464f"),
    "soft": ("#5d6874", "#a3adb8"),
    "bad": ("#b3261e", "#ff9186"),
    "accent": ("#2f6fb5", "#3d7fc4"),
    "accent_hover": ("#265c98", "#4c8fd6"),
    "mid": ("#d9dfe5", "#3a424b"),
    "banner": ("#fdeceb", "#45282a"),
    "note": ("#eaf2fb", "#24364a"),
    "noted": ("#8fb3dc", "#4f76a3"),
    "frame": ("#87919c", "#818c98"),
}
"""The other colors of the style sheet `_SHEET`, in the light and the dark theme.

``bad`` is for invalid fields, warning labels and the alarm banner's border; ``banner`` is that
banner's background; ``note`` and ``noted`` are background and border of the calm banner; ``soft``
is for hints; ``frame`` for outlines of fields, menus and tooltips."""

_SHEET = """
QDockWidget {{ font-weight: 600; titlebar-close-icon: url("{signs}/close_{name}.svg");
    titlebar-normal-icon: url("{signs}/float_{name}.svg"); }}
QDockWidget::title {{ background: {title}; padding: 5px 8px; }}
QDockWidget > QWidget {{ font-weight: 400; }}
QDialogButtonBox {{ dialogbuttonbox-buttons-have-icons: 0; }}
QToolBar {{ border: none; spacing: 2px; padding: 2px 4px; }}
QToolButton {{ padding: 3px; border-radius: 4px; border: 1px solid transparent; }}
QToolButton:hover {{ background: {hover}; }}
QToolButton:checked {{ background: {checked}; border: 1px solid {line}; }}
QToolButton:focus, QPlainTextEdit:focus, QListView:focus, QTreeView:focus,
QTableView:focus {{ border: 1px solid {accent}; }}
QStatusBar {{ border-top: 1px solid {line}; }}
QStatusBar::item {{ border: none; }}
QMainWindow::separator {{ width: 5px; height: 5px; background: {Window}; }}
QToolTip {{ padding: 4px; border: 1px solid {frame}; background: {ToolTipBase};
    color: {ToolTipText}; }}
QMenu {{ border: 1px solid {frame}; }}
QListWidget#motions::item {{ padding: 3px 2px; }}
QLabel[hint="true"] {{ color: {soft}; }}
QLabel[bad="true"] {{ color: {bad}; }}
QLineEdit[bad="true"],
QSpinBox[bad="true"] {{ border: 1.5px solid {bad}; border-radius: 2px; padding: 2px; }}
QPushButton#run {{ background: {accent}; color: white; font-weight: 600; border: none;
    border-radius: 4px; padding: 7px 18px; }}
QPushButton#run:hover {{ background: {accent_hover}; }}
QPushButton#run:disabled {{ background: {mid}; color: {soft}; }}
QPushButton#open_page {{ padding: 6px 17px; border: 1px solid {line}; border-radius: 4px;
    background: {Base}; }}
QPushButton#open_page:hover {{ background: {hover}; }}
QPushButton#open_page:focus, QPushButton#run:focus {{ border: 2px solid {noted};
    padding: 5px 16px; }}
QToolButton[card="true"] {{ background: {Base}; border: 1px solid {line}; border-radius: 6px;
    padding: 8px 4px 6px 4px; }}
QToolButton[card="true"]:hover {{ background: {note}; border: 1px solid {noted}; }}
QToolButton[card="true"]:focus {{ border: 2px solid {accent}; }}
QPushButton[recent="true"] {{ border: 1px solid transparent; border-radius: 4px;
    background: transparent; text-align: left; }}
QPushButton[recent="true"]:hover {{ background: {hover}; }}
QPushButton[recent="true"]:focus {{ border: 1px solid {accent}; }}
QFrame#banner {{ background: {banner}; border: 1px solid {bad}; border-radius: 4px; }}
QFrame#banner[calm="true"] {{ background: {note}; border: 1px solid {noted}; }}
"""
"""The style sheet, with the keys of `_PALETTE` and `_STYLE` in place of colors."""

FRAMED = (
    "QCheckBox",
    "QRadioButton",
    "QLineEdit",
    "QAbstractSpinBox",
    "QComboBox",
    "QTableView",
    "QListView",
)
"""Classes of widgets whose frame or box is drawn in the color ``frame``."""

_OUTLINE = 140
"""Percentage for `QColor.lighter`, as Fusion draws outlines in the window color, darkened."""


def resolved(theme: str) -> str:
    """Return ``light`` or ``dark`` for one of `THEMES`; ``system``: what the desktop uses."""
    if theme in ("light", "dark"):
        return theme
    scheme = _app().styleHints().colorScheme()
    return "dark" if scheme == Qt.ColorScheme.Dark else "light"


def _app() -> QApplication:
    app = QApplication.instance()
    assert isinstance(app, QApplication)
    return app


def apply(theme: str) -> ColorScheme:
    """Set style, palette and style sheet of the application; return the view's color scheme."""
    name = resolved(theme)
    dark = name == "dark"
    colors = {role: pair[dark] for role, pair in (_PALETTE | _STYLE).items()}
    palette = QPalette()
    for role in _PALETTE:
        if role != "disabled" and colors[role]:
            palette.setColor(getattr(QPalette.ColorRole, role), QColor(colors[role]))
    for role in ("WindowText", "Text", "ButtonText"):
        group = QPalette.ColorGroup.Disabled
        palette.setColor(group, getattr(QPalette.ColorRole, role), QColor(colors["disabled"]))
    app = _app()
    app.setStyle("Fusion")
    app.setPalette(palette)
    # Tooltips have a palette of their own.
    QToolTip.setPalette(palette)
    framed = QPalette(palette)
    outline = QColor(colors["frame"]).lighter(_OUTLINE)
    framed.setColor(QPalette.ColorRole.Window, outline)
    for kind in FRAMED:
        app.setPalette(framed, kind)  # type: ignore[arg-type]  # a str is taken, too
    signs = Path(__file__).with_name("dock_signs").as_posix()
    app.setStyleSheet(_SHEET.format(**colors, name=name, signs=signs))
    return DARK if dark else LIGHT


def is_dark() -> bool:
    """Return whether the present theme is dark."""
    return QApplication.palette().color(QPalette.ColorRole.Window).lightness() < 128


def icon_color() -> str:
    """Return the color of icons in the present theme."""
    return "#dfe5ec" if is_dark() else "#3b4652"


def alarm() -> str:
    """Return the color of texts about inverted cells in the present theme."""
    return _STYLE["bad"][is_dark()]
