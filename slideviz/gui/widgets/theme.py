"""Light and dark: palettes for Qt's Fusion style, and the look of the view that goes with them."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import Qt
from qtpy.QtGui import QColor, QPalette
from qtpy.QtWidgets import QApplication, QToolTip

from slideviz.color_scheme import DARK, LIGHT, Look

THEMES = ("system", "light", "dark")

_COLOURS = {
    "light": {
        "Window": "#f4f6f8",
        "WindowText": "#20262e",
        "Base": "#ffffff",
        "AlternateBase": "#f2f5f8",
        "Text": "#20262e",
        "Button": "#eef1f4",
        "ButtonText": "#20262e",
        "Highlight": "#2f6fb5",
        "HighlightedText": "#ffffff",
        "ToolTipBase": "#ffffff",
        "ToolTipText": "#20262e",
        "PlaceholderText": "#7b8591",
        "Link": "#1f5f9f",
        "Mid": "#c3cad2",
        "disabled": "#7f8994",
    },
    "dark": {
        "Window": "#262b31",
        "WindowText": "#e6eaf0",
        "Base": "#1d2126",
        "AlternateBase": "#23282e",
        "Text": "#e6eaf0",
        "Button": "#333a42",
        "ButtonText": "#e6eaf0",
        "Highlight": "#3d7fc4",
        "HighlightedText": "#ffffff",
        "ToolTipBase": "#3a424b",
        "ToolTipText": "#f2f5f8",
        "PlaceholderText": "#8a95a2",
        "Link": "#77b0ea",
        "Mid": "#47505a",
        "Light": "#4d5763",
        "disabled": "#7d8894",
    },
}

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
QStatusBar {{ border-top: 1px solid {line}; }}
QStatusBar::item {{ border: none; }}
QMainWindow::separator {{ width: 5px; height: 5px; background: {window}; }}
QToolTip {{ padding: 4px; border: 1px solid {frame}; background: {tip}; color: {tip_text}; }}
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
    background: {base}; }}
QPushButton#open_page:hover {{ background: {hover}; }}
QPushButton#open_page:focus, QPushButton#run:focus {{ border: 2px solid {noted};
    padding: 5px 16px; }}
QToolButton[card="true"] {{ background: {base}; border: 1px solid {line}; border-radius: 6px;
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

_EXTRA = {
    "light": {
        "title": "#e4e9ee",
        "hover": "#e0e6ec",
        "checked": "#d3e2f2",
        "line": "#ccd3da",
        "window": "#f4f6f8",
        "soft": "#5d6874",
        "base": "#ffffff",
        "bad": "#b3261e",
        "accent": "#2f6fb5",
        "accent_hover": "#265c98",
        "mid": "#d9dfe5",
        "banner": "#fdeceb",
        "note": "#eaf2fb",
        "noted": "#8fb3dc",
        "frame": "#87919c",
    },
    "dark": {
        "title": "#30363e",
        "hover": "#3a424b",
        "checked": "#34516f",
        "line": "#3e464f",
        "window": "#262b31",
        "soft": "#a3adb8",
        "base": "#1d2126",
        "bad": "#ff9186",
        "accent": "#3d7fc4",
        "accent_hover": "#4c8fd6",
        "mid": "#3a424b",
        "banner": "#45282a",
        "note": "#24364a",
        "noted": "#4f76a3",
        "frame": "#818c98",
    },
}


FRAMED = (
    "QCheckBox",
    "QRadioButton",
    "QLineEdit",
    "QAbstractSpinBox",
    "QComboBox",
    "QTableView",
    "QListView",
)
"""Widgets whose frames or boxes must stand out from what is around them."""

_OUTLINE = 140
"""Fusion draws outlines in the colour of windows, darker by so many percent."""


def resolved(theme: str) -> str:
    """Return ``light`` or ``dark`` for a theme; ``system`` asks the desktop."""
    if theme in _COLOURS:
        return theme
    scheme = _app().styleHints().colorScheme()
    return "dark" if scheme == Qt.ColorScheme.Dark else "light"


def _app() -> QApplication:
    app = QApplication.instance()
    assert isinstance(app, QApplication)
    return app


def apply(theme: str) -> Look:
    """Give the application that theme and return the view's look."""
    name = resolved(theme)
    colours, palette = _COLOURS[name], QPalette()
    for role, colour in colours.items():
        if role != "disabled":
            palette.setColor(getattr(QPalette.ColorRole, role), QColor(colour))
    for role in ("WindowText", "Text", "ButtonText"):
        group = QPalette.ColorGroup.Disabled
        palette.setColor(group, getattr(QPalette.ColorRole, role), QColor(colours["disabled"]))
    app = _app()
    app.setStyle("Fusion")
    app.setPalette(palette)
    # Tool tips keep a palette of their own, which no change of the application's reaches.
    QToolTip.setPalette(palette)
    framed = QPalette(palette)
    outline = QColor(_EXTRA[name]["frame"]).lighter(_OUTLINE)
    framed.setColor(QPalette.ColorRole.Window, outline)
    for kind in FRAMED:
        app.setPalette(framed, kind)  # type: ignore[arg-type]  # a str is taken, too
    tip = {"tip": colours["ToolTipBase"], "tip_text": colours["ToolTipText"]}
    signs = {"name": name, "signs": Path(__file__).with_name("dock_signs").as_posix()}
    app.setStyleSheet(_SHEET.format(**_EXTRA[name], **tip, **signs))
    return DARK if name == "dark" else LIGHT


def icon_colour(look: Look) -> str:
    """Return the colour of icons on that theme's toolbars."""
    return "#dfe5ec" if look.name == "dark" else "#3b4652"


def alarm() -> str:
    """Return the colour of words about inverted cells, readable in the theme that is shown."""
    window = QApplication.palette().color(QPalette.ColorRole.Window)
    return _EXTRA["dark" if window.lightness() < 128 else "light"]["bad"]
