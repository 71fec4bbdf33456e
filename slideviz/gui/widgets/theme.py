"""The light and the dark theme in Qt's Fusion style: colors of widgets and texts, icons."""

from __future__ import annotations

import json
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from string import Template

from qtpy.QtCore import QByteArray, QRectF, QSize, Qt
from qtpy.QtGui import QAction, QColor, QIcon, QPainter, QPalette, QPixmap
from qtpy.QtSvg import QSvgRenderer
from qtpy.QtWidgets import QAbstractButton, QApplication, QToolTip, QWidget

from slideviz.color_scheme import DARK, LIGHT, ColorScheme
from slideviz.terms import ROLES, Role

THEMES = ("system", "light", "dark")  # the themes that can be chosen
_COLORS: dict[str, list[str]] = json.loads(
    Path(__file__).with_name("theme.json").read_text(encoding="utf-8")
)
"""Colors in the light and the dark theme: of Qt's palette, by role, in capitals (empty: Qt's own),
and the others of the style sheet ``theme.qss``.

``disabled`` is the text color of all disabled widgets; ``bad`` is for invalid fields, warning
labels and the alarm banner's border; ``banner`` is that banner's background; ``note`` and ``noted``
are background and border of the calm banner; ``soft`` is for hints; ``frame`` for outlines of
fields, menus and tooltips."""

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
    scheme = DARK if dark else LIGHT
    colors = {role: pair[dark] for role, pair in _COLORS.items()}
    here = Path(__file__)
    template = Template(here.with_name("theme.qss").read_text(encoding="utf-8"))
    signs = here.with_name("dock_signs").as_posix()
    sheet = template.substitute(colors, name=name, signs=signs)
    app = _app()
    if app.styleSheet() == sheet:  # to polish all widgets anew takes 0.2 s
        return scheme
    palette = QPalette()
    for role, color in colors.items():
        if role[0].isupper() and color:
            palette.setColor(getattr(QPalette.ColorRole, role), QColor(color))
    for role in ("WindowText", "Text", "ButtonText"):
        group = QPalette.ColorGroup.Disabled
        palette.setColor(group, getattr(QPalette.ColorRole, role), QColor(colors["disabled"]))
    app.setStyle("Fusion")
    app.setPalette(palette)
    # Tooltips have a palette of their own.
    QToolTip.setPalette(palette)
    framed = QPalette(palette)
    outline = QColor(colors["frame"]).lighter(_OUTLINE)
    framed.setColor(QPalette.ColorRole.Window, outline)
    for kind in FRAMED:
        app.setPalette(framed, kind)  # type: ignore[arg-type]  # a str is taken, too
    app.setStyleSheet(sheet)
    return scheme


def is_dark() -> bool:
    """Return whether the present theme is dark."""
    return QApplication.palette().color(QPalette.ColorRole.Window).lightness() < 128


def icon_color() -> str:
    """Return the color of icons in the present theme."""
    return "#dfe5ec" if is_dark() else "#3b4652"


def alarm() -> str:
    """Return the color of texts about inverted cells in the present theme."""
    return _COLORS["bad"][is_dark()]


FOLDER = files("slideviz.gui") / "icons"  # SVG files; ``currentColor`` in them is replaced
NAMES = frozenset(file.name.removesuffix(".svg") for file in FOLDER.iterdir())


def _svg(name: str, color: str) -> str:
    return (FOLDER / f"{name}.svg").read_text(encoding="utf-8").replace("currentColor", color)


def svg_pixmap(svg: str, width: int, height: int) -> QPixmap:
    """Return the picture of an SVG text, of a size in pixels."""
    pixmap = QPixmap(QSize(width, height))
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    QSvgRenderer(QByteArray(svg.encode())).render(painter, QRectF(pixmap.rect()))
    painter.end()
    return pixmap


def _faded(pixmap: QPixmap) -> QPixmap:
    out = QPixmap(pixmap.size())
    out.fill(Qt.GlobalColor.transparent)
    painter = QPainter(out)
    painter.setOpacity(0.35)
    painter.drawPixmap(0, 0, pixmap)
    painter.end()
    return out


def icon(name: str, color: str = "") -> QIcon:
    """Return the icon of a name in `NAMES`, in a color; by default in the theme's."""
    return _drawn(name, color or icon_color())


def set_icon(button: QAbstractButton | QAction, name: str) -> None:
    """Set the icon of a button or action; `redraw_icons` draws it again in another theme."""
    button.setProperty("icon_name", name)
    button.setIcon(icon(name))


def redraw_icons(window: QWidget) -> None:
    """Draw the icons set by `set_icon` in a window again, in the color of the present theme."""
    drawn: list[QAbstractButton | QAction] = [
        *window.findChildren(QAbstractButton),
        *window.findChildren(QAction),
    ]
    for button in drawn:
        name = button.property("icon_name")
        if name:
            set_icon(button, name)


@lru_cache(maxsize=256)
def _drawn(name: str, color: str) -> QIcon:
    svg = _svg(name, color)
    icon = QIcon()
    for size in (20, 40):
        pixmap = svg_pixmap(svg, size, size)
        icon.addPixmap(pixmap)
        icon.addPixmap(_faded(pixmap), QIcon.Mode.Disabled)
    return icon


@lru_cache(maxsize=16)
def role_icon(role: Role) -> QIcon:
    """Return the icon of a role: a white sign, different for each role, on the role's color."""
    sign = _svg(f"role_{role}", "#ffffff")
    inner = sign[sign.index("<g") : sign.index("</svg>")]
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="-4 -4 32 32"><rect x="-4" y="-4" '
        f'width="32" height="32" rx="6" fill="{ROLES[role].color}"/>{inner}</svg>'
    )
    return QIcon(svg_pixmap(svg, 40, 40))


@lru_cache(maxsize=1)
def logo() -> QIcon:
    """Return the icon of the program, the one that is installed with its desktop file."""
    svg = (files("slideviz.gui") / "desktop" / "slideviz.svg").read_text(encoding="utf-8")
    icon = QIcon()
    for size in (16, 32, 64, 128):
        icon.addPixmap(svg_pixmap(svg, size, size))
    return icon
