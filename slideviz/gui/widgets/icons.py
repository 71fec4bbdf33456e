"""The icons, drawn here as SVG strokes, in the color of the text."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files

from qtpy.QtCore import QByteArray, QRectF, QSize, Qt
from qtpy.QtGui import QAction, QIcon, QPainter, QPixmap
from qtpy.QtSvg import QSvgRenderer
from qtpy.QtWidgets import QAbstractButton, QWidget

from slideviz.gui.widgets.theme import icon_color
from slideviz.terms import ROLES, Role

STROKES = {
    "open": '<path d="M3 19V5h6l2 3h8v3"/><path d="M3 19l3-8h16l-3 8z"/>',
    "save": '<path d="M4 4h12l4 4v12H4z"/><path d="M8 4v5h7V4M7 20v-7h10v7"/>',
    "undo": '<path d="M8 5L4 9l4 4"/><path d="M4 9h10a5.5 5.5 0 0 1 0 11h-4"/>',
    "redo": '<path d="M16 5l4 4-4 4"/><path d="M20 9H10a5.5 5.5 0 0 0 0 11h4"/>',
    "picture": '<rect x="3" y="5" width="18" height="14" rx="1.5"/>'
    '<path d="M3 16l5-5 4 4 3-3 6 5"/><circle cx="16" cy="9.5" r="1.4"/>',
    "case": '<path d="M6 3h8l4 4v14H6z"/><path d="M14 3v4h4M9 12h6M9 16h6"/>',
    "run": '<path d="M7 4.5v15l12-7.5z" fill="{c}"/>',
    "cancel": '<rect x="6" y="6" width="12" height="12" rx="1" fill="{c}"/>',
    "play": '<path d="M8 5v14l11-7z" fill="{c}"/>',
    "pause": '<path d="M8 5v14M16 5v14" stroke-width="3.4"/>',
    "first": '<path d="M19 5v14L8 12z" fill="{c}"/><path d="M5.5 5v14"/>',
    "last": '<path d="M5 5v14l11-7z" fill="{c}"/><path d="M18.5 5v14"/>',
    "loop": '<path d="M17 3l3 3-3 3"/><path d="M20 6H8a5 5 0 0 0-4 5"/>'
    '<path d="M7 21l-3-3 3-3"/><path d="M4 18h12a5 5 0 0 0 4-5"/>',
    "previous": '<path d="M15 6l-6 6 6 6"/>',
    "next": '<path d="M9 6l6 6-6 6"/>',
    "fit": '<path d="M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5"/><circle cx="12" cy="12" r="3"/>',
    "colors": '<rect x="4" y="3" width="7" height="18" rx="1"/><path d="M4 9h7M4 15h7"/>'
    '<path d="M17.5 4v16M14.5 7l3-3 3 3M14.5 17l3 3 3-3"/>',
    "edges": '<path d="M4 4h16v16H4zM4 9.3h16M4 14.6h16M9.3 4v16M14.6 4v16"/>',
    "undeformed": '<path d="M5 16c2-9 8-11 14-11" stroke-dasharray="2.5 2.5"/>'
    '<path d="M5 20c5-2 12-2 14-9"/>',
    "motion_ghost": '<path d="M4 17c3-8 9-10 15-10"/><path d="M15 3.5L19 7l-4 3.5"/>',
    "legend": '<rect x="4" y="5" width="4" height="4" fill="{c}"/><path d="M11 7h9"/>'
    '<rect x="4" y="14" width="4" height="4" fill="{c}"/><path d="M11 16h9"/>',
    "perspective": '<path d="M4 8l6-3 10 2v10l-10 2-6-3z"/><path d="M10 5v14M4 8v8"/>',
    "add": '<path d="M12 5v14M5 12h14"/>',
    "along": '<path d="M2.5 12s3.5-6 9.5-6 9.5 6 9.5 6-3.5 6-9.5 6-9.5-6-9.5-6z"/>'
    '<circle cx="12" cy="12" r="2.6"/>',
    "remove": '<path d="M5 12h14"/>',
    "beside": '<rect x="3" y="5" width="8" height="14" rx="1"/>'
    '<rect x="13" y="5" width="8" height="14" rx="1"/>',
    "settings": '<path d="M9 5L4 10l5 5"/><path d="M4 10h9a7 7 0 0 1 7 7v2"/>',
    "copy": '<rect x="8" y="8" width="12" height="12" rx="1.5"/><path d="M16 8V4H4v12h4"/>',
    "table": '<path d="M4 5h16v14H4zM4 10h16M10 10v9"/>',
    "triad": '<path d="M8 16V4M5.5 6.5L8 4l2.5 2.5M8 16h12M17.5 13.5L20 16l-2.5 2.5M8 16l-4 4.5"/>',
    "edit": '<path d="M4 20l1-4L16 5l3 3L8 19z"/><path d="M13.5 7.5l3 3"/>',
    "up": '<path d="M12 19V6M6 11l6-6 6 6"/>',
    "down": '<path d="M12 5v13M6 13l6 6 6-6"/>',
    "warning": '<path d="M12 4L2.5 20h19z"/><path d="M12 10v5M12 17.4v.2"/>',
    "check": '<path d="M4 12.5l5 5L20 6.5"/>',
    "log": '<path d="M4 5h16v14H4z"/><path d="M7 9l3 3-3 3M12 15h5"/>',
    "theme": '<circle cx="12" cy="12" r="8"/><path d="M12 4a8 8 0 0 1 0 16z" fill="{c}"/>',
}
"""SVG elements of each icon in a box of 24 by 24; ``{c}`` is the color."""

_ROLE_STROKES = {
    "moving": '<path d="M4 12h14M12.5 6l6 6-6 6"/>',
    "fixed": '<rect x="5.5" y="11" width="13" height="9" rx="1.5" fill="{c}"/>'
    '<path d="M8.5 11V8a3.5 3.5 0 0 1 7 0v3"/>',
    "sliding": '<path d="M3 9h15M14 5l4 4M21 15H6M10 19l-4-4"/>',
    "periodic": '<path d="M5 12a7 7 0 0 1 12-4.9L19 9M19 4v5h-5"/>'
    '<path d="M19 12a7 7 0 0 1-12 4.9L5 15M5 20v-5h5"/>',
    "internal": '<circle cx="12" cy="12" r="8" stroke-dasharray="3 2.4"/>'
    '<circle cx="12" cy="12" r="2.4" fill="{c}"/>',
}
"""SVG elements of the sign of each role, likewise."""

_SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 24 24"><g fill="none" stroke="{c}" '
    'stroke-width="{w}" stroke-linecap="round" stroke-linejoin="round">{body}</g></svg>'
)


def _pixmap(svg: str, size: int) -> QPixmap:
    pixmap = QPixmap(QSize(size, size))
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    QSvgRenderer(QByteArray(svg.encode())).render(painter, QRectF(0, 0, size, size))
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
    """Return the icon of a name in `STROKES`, in a color; by default in the theme's."""
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
    svg = _SVG.format(c=color, w=1.8, body=STROKES[name].format(c=color))
    icon = QIcon()
    for size in (20, 40):
        pixmap = _pixmap(svg, size)
        icon.addPixmap(pixmap)
        icon.addPixmap(_faded(pixmap), QIcon.Mode.Disabled)
    return icon


@lru_cache(maxsize=16)
def role_icon(role: Role) -> QIcon:
    """Return the icon of a role: a white sign, different for each role, on the role's color."""
    body = _ROLE_STROKES[role].format(c="#ffffff")
    sign = _SVG.format(c="#ffffff", w=2.4, body=body)
    inner = sign[sign.index("<g") : -len("</svg>")]
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="-4 -4 32 32"><rect x="-4" y="-4" '
        f'width="32" height="32" rx="6" fill="{ROLES[role].color}"/>{inner}</svg>'
    )
    return QIcon(_pixmap(svg, 40))


@lru_cache(maxsize=1)
def logo() -> QIcon:
    """Return the icon of the program, the one that is installed with its desktop file."""
    svg = (files("slideviz.gui") / "desktop" / "slideviz.svg").read_text(encoding="utf-8")
    icon = QIcon()
    for size in (16, 32, 64, 128):
        icon.addPixmap(_pixmap(svg, size))
    return icon
