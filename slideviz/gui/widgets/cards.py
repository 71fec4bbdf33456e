"""The small pictures of the sample cases: mesh lines about a moving body, drawn as SVG.

They are drawn from formulas, like the samples themselves, so that they fit both themes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from qtpy.QtCore import QByteArray, QRectF, QSize, Qt
from qtpy.QtGui import QPainter, QPixmap
from qtpy.QtSvg import QSvgRenderer

from slideviz.terms import ROLES

SIZE = (152, 96)  # width and height of a picture in pixels, at a device pixel ratio of 1
BODY, WALL, REPEAT = (ROLES[role].color for role in ("moving", "sliding", "periodic"))
"""Colors of moving, sliding and periodic boundaries."""

Map = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""A map from coordinates (u, v) in the unit square, (n,) each, to pixels (x, y) of a picture."""


def card(name: str, line: str) -> QPixmap:
    """Return the picture of a sample by its name, with mesh lines in the color ``line``."""
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE[0]} {SIZE[1]}">'
        f"{_drawing(name).replace('{line}', line)}</svg>"
    )
    pixmap = QPixmap(QSize(2 * SIZE[0], 2 * SIZE[1]))
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    QSvgRenderer(QByteArray(svg.encode())).render(painter, QRectF(pixmap.rect()))
    painter.end()
    pixmap.setDevicePixelRatio(2.0)
    return pixmap


@lru_cache(maxsize=16)
def _drawing(name: str) -> str:
    made = _DRAWINGS.get(name)
    return made() if made is not None else _grid(_square, 10, 7)


def _path(x: np.ndarray, y: np.ndarray, style: str) -> str:
    """Return the SVG of a polyline through pixels x and y, (n,) each."""
    points = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<path d="M{points}" stroke-linejoin="round" stroke-linecap="round" {style}/>'


def _lines(to: Map, columns: int, rows: int) -> str:
    """Return the SVG of the lines of a structured mesh of a mapped square."""
    along, style = np.linspace(0, 1, 25), 'fill="none" stroke="{line}" stroke-width="0.6"'
    paths = [_path(*to(np.full(25, u), along), style) for u in np.linspace(0, 1, columns + 1)]
    return "".join(
        paths + [_path(*to(along, np.full(25, v)), style) for v in np.linspace(0, 1, rows + 1)]
    )


def _grid(to: Map, columns: int, rows: int, walls: bool = True) -> str:
    """Return the SVG of a mapped mesh: v = 0 and 1 are periodic, u = 0 and 1 sliding boundaries."""
    along = np.linspace(0, 1, 33)
    zero, one = np.zeros(33), np.ones(33)
    edges = [(along, zero, REPEAT), (along, one, REPEAT), (zero, along, WALL), (one, along, WALL)]
    drawn = [
        _path(*to(u, v), f'fill="none" stroke="{color}" stroke-width="1.8"')
        for u, v, color in edges
    ]
    return _lines(to, columns, rows) + "".join(drawn if walls else ())


def _body(x: np.ndarray, y: np.ndarray) -> str:
    return _path(x, y, f'fill="{BODY}" stroke="{BODY}" stroke-width="1.2"')


def _square(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 34 + 84 * u, 6 + 84 * v


def _turned(to: Map, width: float, height: float, degrees: float) -> str:
    """Return the SVG of a turned rectangle in the middle; width and height in the unit square."""
    turn = np.radians(degrees)
    x = np.array([-1, 1, 1, -1, -1]) * width / 2
    y = np.array([-1, -1, 1, 1, -1]) * height / 2
    u, v = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    return _body(*to(0.5 + u, 0.5 + v))


def _sector(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    radius, angle = 60 + 84 * u, np.radians(-17 + 34 * v)
    return radius * np.cos(angle) - 18, 48 + radius * np.sin(angle)


def _solid(front: Map, depth: tuple[float, float], body: str, top: int = 1) -> str:
    """Return the SVG of a solid: a mapped front, and its upper and right sides at a depth (x, y).

    ``top``: the front's upper edge is at v = 0 if 1, at v = 1 if 0.
    """
    dx, dy = depth

    def above(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = front(u, np.full_like(u, 1 - top))
        return x + dx * v, y + dy * v

    def right(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = front(np.ones_like(v), v)
        return x + dx * u, y + dy * u

    return _lines(above, 8, 4) + _grid(right, 4, 7, walls=False) + _grid(front, 8, 7) + body


def _cube(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 34 + 62 * u, 26 + 62 * v


def _sector_front(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, y = _sector(u, v)
    return 0.8 * x + 6, 0.8 * y + 18


def _channel(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map to a blade passage that bends with its cambered blade."""
    arch = np.sin(np.pi * np.clip((u - 0.1) / 0.85, 0, 1)) ** 2
    bend = 14 * arch - 34 * np.clip(u - 0.3, 0, 1) ** 1.2
    return 6 + 140 * u, 14 + 50 * v - bend


def _blade(to: Map, start: float, end: float, thickness: float) -> str:
    """Return the SVG of a blade along v = 0.5, from u = start to end; thickness in pixels."""
    part = np.linspace(0, 1, 30)
    half = thickness * (1.6 * np.sqrt(part) - 0.9 * part - 0.7 * part**3)
    u = start + (end - start) * part
    x, y = to(u, np.full_like(u, 0.5))
    return _body(np.r_[x, x[::-1]], np.r_[y - half, (y + half)[::-1]])


def _cascade(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x = 6 + 140 * u
    return x, 28 + 34 * v + 44 * np.clip(u - 0.25, 0, 0.5) ** 1.1 - 10


def _row() -> str:
    """Return the SVG of three vanes of a row, the middle one with its mesh."""

    def shifted(by: float) -> Map:
        return lambda u, v: (_cascade(u, v)[0], _cascade(u, v)[1] + by)

    ghosts = "".join(
        f'<g opacity="0.3">{_blade(shifted(by), 0.2, 0.75, 5)}</g>' for by in (-34, 34)
    )
    return ghosts + _grid(_cascade, 16, 6) + _blade(_cascade, 0.2, 0.75, 5)


def _row_3d() -> str:
    """Return the SVG of a vane between hub, with its mesh, and shroud, faint."""

    def at(span: float) -> Map:
        def to(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            x, y = _cascade(u, v)
            return 0.88 * x + 1 + 16 * span, 0.84 * y + 24 - 26 * span

        return to

    vane = "".join(_blade(at(span), 0.2, 0.75, 4) for span in np.linspace(0, 1, 40))
    ends = _blade(at(0.0), 0.2, 0.75, 4) + _blade(at(1.0), 0.2, 0.75, 4)
    shroud = f'<g opacity="0.35">{_grid(at(1.0), 16, 6)}</g>'
    return f'{shroud}{_grid(at(0.0), 16, 6)}<g opacity="0.4">{vane}</g>{ends}'


def _annulus(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map to a part of a casing seen from ahead, u around and v outwards."""
    radius, angle = 82 + 46 * v, np.radians(-122 + 64 * u)
    return 76 + radius * np.cos(angle), 136 + radius * np.sin(angle)


def _stator() -> str:
    """Return the SVG of three blades between hub and casing, the outer two faint."""
    along = np.linspace(0, 1, 25)
    walls = [
        _path(*_annulus(along, np.full(25, v)), f'fill="none" stroke="{WALL}" stroke-width="1.8"')
        for v in (0.0, 1.0)
    ]
    sides = [
        _path(*_annulus(np.full(25, u), along), f'fill="none" stroke="{REPEAT}" stroke-width="1.8"')
        for u in (0.3, 0.7)
    ]
    blades = []
    for middle in (0.1, 0.5, 0.9):
        lean = 0.03 * np.sin(np.pi * along)
        left, right = _annulus(middle - 0.035 + lean, along), _annulus(middle + 0.035 + lean, along)
        shape = _body(np.r_[left[0], right[0][::-1]], np.r_[left[1], right[1][::-1]])
        blades.append(shape if middle == 0.5 else f'<g opacity="0.3">{shape}</g>')
    return _lines(_annulus, 20, 7) + "".join(walls + sides + blades)


def _around(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map to an O-mesh, u around an airfoil and v outwards."""
    angle, half = 2 * np.pi * u, 22 * np.exp(1.05 * v)
    thick = half * (v + (1 - v) * 0.16 * (1 - np.cos(angle)))
    return 76 + 1.15 * half * np.cos(angle), 48 - 0.68 * thick * np.sin(angle)


def _airfoil() -> str:
    """Return the SVG of an airfoil in its O-mesh."""
    along = np.linspace(0, 1, 61)
    far = _around(along, np.ones(61))
    rim = _path(*far, f'fill="none" stroke="{WALL}" stroke-width="1.8"')
    return _lines(_around, 24, 7) + rim + _body(*_around(along, np.zeros(61)))


_DRAWINGS: dict[str, Callable[[], str]] = {
    "square": lambda: _grid(_square, 10, 10) + _turned(_square, 0.34, 0.14, 20),
    "polar": lambda: _grid(_sector, 10, 8) + _turned(_sector, 0.34, 0.2, 16),
    "hexahedron": lambda: _solid(_cube, (24, -18), _turned(_cube, 0.36, 0.2, 20)),
    "cylindrical": lambda: _solid(_sector_front, (20, -20), _turned(_sector_front, 0.34, 0.22, 16)),
    "passage": lambda: _grid(_channel, 18, 8) + _blade(_channel, 0.16, 0.84, 11),
    "airfoil": _airfoil,
    "turbine-row": _row,
    "turbine-row-3d": _row_3d,
    "stator": _stator,
}
"""The function that draws each sample; others get a plain square mesh."""
