"""The icons, drawn from SVG files in the color of the text."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files

from qtpy.QtCore import QByteArray, QRectF, QSize, Qt
from qtpy.QtGui import QAction, QIcon, QPainter, QPixmap
from qtpy.QtSvg import QSvgRenderer
from qtpy.QtWidgets import QAbstractButton, QWidget

from slideviz.gui.widgets.theme import icon_color
from slideviz.terms import ROLES, Role

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
