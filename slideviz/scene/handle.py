"""The handle: what the mouse takes to move, turn and enlarge something, in pixels over the scene.

The point under the mouse stays under it, in parallel projection and in perspective. VTK's widgets
are worse to use: they take the mouse wherever their surface is seen, where it should turn the
camera, and what they move does not follow it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

from slideviz.argument_types import record
from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.errors import point_words
from slideviz.ffd.box import Index
from slideviz.mesh.model import FloatArray, row_norms
from slideviz.scene.actors import add_overlay, remove_actor
from slideviz.scene.pick import Projection, distances
from slideviz.session.motions import chosen_control, lattices
from slideviz.session.placed import Act, Grip, Number, Placed
from slideviz.session.state import Session
from slideviz.terms import WholeNumbers

AXIS_COLORS = ("#d1495b", "#3c9d4e", "#2f6fb5", "#8a5fbf", "#c77f1a", "#1f9e9e")
"""Colors of the axes x, y, z and of the others; the ball in the middle has that of the third."""
ARROW_PX = 86.0
HEAD_PX = 15.0
RING_PX = 62.0
BOX_PX = 104.0
SIZE_PX = 25.0
SQUARE_PX = (24.0, 40.0)
"""Lengths in pixels from the middle: an arrow's tip, its head, a ring, the box that enlarges, the
tips of the two arrows that change a size, near and far side of the square that moves in a plane."""
BALL_PX = 7.0
HALF_PX = 5.0  # `BALL_PX`, `HALF_PX`: radius of a ball, half a box, in pixels
WIDE_PX = 3.0  # width of shafts and rings
REACH_PX = 8.0  # distance up to which the mouse takes a part
EDGE_PX = 22.0  # distance that the middle keeps from the edges of the view
SHORT = 0.15  # foreshortening from which on an arrow or a square is not there
STEEP = 0.15  # slope in pixels, relative to that across the line of sight, that is too small
STEP_PX = 20.0  # least distance of snapped values, in pixels; finely a tenth
ANGLES = (5.0, 1.0)  # degrees to which angles snap, and finely
FINE = 0.1  # how far the mouse moves things with Shift, relative to without
_TURNS = 64  # straight pieces of a ring
_ROUNDS = 12  # of Newton's method at most


def on_path(
    projection: Projection, path: Callable[[float], FloatArray], value: float, target: FloatArray
) -> tuple[float, float]:
    """Return the value at which a path is nearest to a pixel (2,), and the value of a pixel.

    ``path`` returns the point (3,) of a value; ``value``: from which to search. Where the path goes
    nearly along the line of sight, upwards is towards larger values.
    """
    pixel = projection.pixel_length(path(value))
    # A path may be of degrees, factors or lengths.
    moved = float(np.linalg.norm(path(value + pixel) - path(value)))
    if not moved > 1e-9 * pixel:
        return value, pixel
    step = pixel * pixel / moved  # a pixel across the line of sight

    def at(to: float) -> FloatArray:
        return projection.pixels(path(to)[None])[0]

    slope = at(value + step) - at(value)
    if float(np.linalg.norm(slope)) < STEEP:
        return value + step * float((target - at(value))[1]), step
    for _ in range(_ROUNDS):
        slope = at(value + step) - at(value)
        change = step * float((target - at(value)) @ slope / max(float(slope @ slope), 1e-300))
        value += change
        if abs(change) < 1e-4 * step:
            break
    return value, step / max(float(np.linalg.norm(slope)), STEEP)


def angle_to(
    projection: Projection,
    about: tuple[FloatArray, FloatArray],
    pixels: tuple[FloatArray, FloatArray],
) -> float:
    """Return by how many degrees a rotation takes what is at one pixel to another one.

    ``about``: a point on the axis, and its direction, which is not across the line of sight.
    """
    centre, axis = about
    start = projection.on_plane(pixels[0], centre, axis) - centre
    end = projection.on_plane(pixels[1], centre, axis) - centre
    unit = axis / np.linalg.norm(axis)
    return float(np.degrees(np.arctan2(np.cross(start, end) @ unit, start @ end)))


def rounded(value: float, unit: float) -> float:
    """Return the number with few digits that is nearest to a value, within half a ``unit``."""
    digits = -int(np.floor(np.log10(max(unit, 1e-300))))
    return round(value, digits) + 0.0


def nice(least: float) -> float:
    """Return the least of 1, 2 or 5 times a power of ten that is at least ``least``."""
    power = 10.0 ** np.floor(np.log10(max(least, 1e-300)))
    return float(next(n * power for n in (1.0, 2.0, 5.0, 10.0) if n * power >= 0.999999 * least))


class Result(NamedTuple):
    """What a drag makes of the session."""

    session: Session
    words: str  # the number that the session has then
    origin: FloatArray  # (3,): where the handle is then
    turned: float = 0.0  # degrees since the drag began


@record
class Drag:
    """A change that the mouse or keys make: what they hold, where, and how far they have moved."""

    placed: Placed
    projection: Projection
    act: Act
    axes: WholeNumbers  # along or about which; () for all, or its own
    point: FloatArray  # (3,): what the mouse holds
    start: FloatArray  # (2,): the pixel where the mouse took it
    now: FloatArray  # (2,): and where it is now
    snaps: bool = False
    fine: bool = False
    typed: str = ""  # a number that was typed
    before: float = 0.0  # degrees of the last result, so that turns add up

    def moved_to(self, now: FloatArray, *, fine: bool, snaps: bool) -> Drag:
        """Return the drag after the mouse has moved to a pixel (2,)."""
        gain = FINE if fine else 1.0
        return replace(self, now=now, start=self.start + (1.0 - gain) * (now - self.now),
                       snaps=snaps, fine=fine)  # fmt: skip

    def result(self) -> Result | None:
        """Return what the drag changes; None where it is impossible."""
        free = self.axes or (self.placed.free if self.act == "move" else ())
        typed = _number(self.typed)
        if self.act == "move" and len(free) != 1 and typed is None:
            return self._shifted(free)
        axis = free[0] if free else None
        if self.act == "move":
            axis = axis or 0
        number = self.placed.number(self.act, axis)
        if number is None:
            return None
        value = self._value(number) if typed is None else typed
        name = "" if axis is None else f" {self.placed.names[axis]}"
        sign = "°" if self.act == "turn" else ""
        words = f"{WORDS[self.act]}{name}: {self.typed or f'{value:.10g}'}{sign}"
        turned = value - number.value if self.act == "turn" else 0.0
        return Result(number.put(value), words, number.path(value, self.placed.origin), turned)

    def _value(self, number: Number) -> float:
        projection = self.projection
        by = self.now - self.start
        if number.circle is not None:
            sight = projection.sight(number.circle[0])
            facing = abs(sight @ number.circle[1]) / np.linalg.norm(number.circle[1])
            if facing > STEEP:
                turned = angle_to(projection, number.circle, (self.start, self.now))
                turned += 360.0 * round((self.before - turned) / 360.0)
                return self._even(number.value, turned, ANGLES[1] / 10.0, ANGLES[0], ANGLES[1])
        (at,) = projection.pixels(self.point[None])
        value, unit = on_path(
            projection, lambda to: number.path(to, self.point), number.value, at + by
        )
        step = ANGLES if number.circle else (nice(STEP_PX * unit), nice(FINE * STEP_PX * unit))
        return self._even(0.0, value, unit, *step)

    def _even(self, start: float, value: float, unit: float, step: float, small: float) -> float:
        """Return a value snapped, or with no more digits than the mouse can aim at."""
        if self.snaps:
            size = small if self.fine else step
            return rounded(size * round((start + value) / size), size / 10.0)
        return rounded(start + value, unit / 2.0 * (FINE if self.fine else 1.0))

    def _shifted(self, axes: WholeNumbers) -> Result:
        """Return the result of a drag in a plane: across the line of sight, or of two axes."""
        placed = self.placed
        projection = self.projection
        normal = projection.sight(self.point)
        if axes:
            normal = np.cross(*placed.axes[list(axes)])
        held = projection.on_plane(self.start, self.point, normal)
        there = placed.origin + projection.on_plane(self.now, self.point, normal) - held
        unit = projection.pixel_length(placed.origin)
        first = numbers = placed.numbers
        step = unit * np.eye(3)
        for _ in range(_ROUNDS):
            here = placed.at(numbers)
            slopes = np.array([placed.at(numbers + row) - here for row in step]).T / unit
            change = np.linalg.lstsq(slopes, there - here, rcond=None)[0]
            numbers = numbers + change
            if np.abs(change).max() < 1e-4 * unit:
                break
        units = unit / np.linalg.norm(slopes, axis=0)
        sizes = [nice((FINE if self.fine else 1.0) * STEP_PX * each) for each in units]
        pairs = zip(numbers, units, sizes, strict=True)
        even = [self._even(0.0, value, each, size, size) for value, each, size in pairs]
        kept = np.where(np.abs(numbers - first) > 1e-9 * units, even, first)
        words = point_words(kept[: placed.dim], unit, 10)
        return Result(placed.put(kept), f"{WORDS['move']}: ({words})", placed.at(kept))


WORDS = {"move": "Move", "turn": "Turn", "grow": "Size"}


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


# What is drawn ----------------------------------------------------------------------------
@record
class Part:
    """A part of a handle on the screen."""

    grip: Grip
    polygons: list[FloatArray]  # list of (k, 2): in pixels
    line: FloatArray  # (k, 2): at which the mouse takes it, in pixels
    color: str
    point: FloatArray  # (3,): what the mouse holds by it, near enough
    opacity: float = 1.0


def parts_of(placed: Placed, projection: Projection, ratio: float) -> list[Part]:
    """Return the parts of a handle that can be seen, the preferred one first.

    ``ratio``: device pixels of a pixel.
    """
    unit = projection.pixel_length(placed.origin) * ratio
    sight = projection.sight(placed.origin)
    found = []
    for grip in placed.grips:
        part = _PARTS[grip[0]](placed, projection, grip, (unit, ratio, sight))
        if part is not None:
            found.append(part)
    return found


Scale = tuple[float, float, FloatArray]
"""Length of a pixel, device pixels of one, and the direction (3,) of sight."""


def _move(placed: Placed, projection: Projection, grip: Grip, scale: Scale) -> Part | None:
    unit, ratio, sight = scale
    origin = placed.origin
    axes = grip[1]
    (middle,) = projection.pixels(origin[None])
    if not axes:
        return Part(grip, [middle + _disc(BALL_PX * ratio)], middle[None], AXIS_COLORS[2], origin)
    if len(axes) == 2:
        first, second = placed.axes[list(axes)]
        if abs(sight @ np.cross(first, second)) < SHORT:
            return None
        near, far = SQUARE_PX
        corners = ((near, near), (far, near), (far, far), (near, far))
        points = np.array([origin + unit * (a * first + b * second) for a, b in corners])
        (other,) = {0, 1, 2} - {*axes}
        seen = projection.pixels(points)
        centre = seen.mean(axis=0)[None]
        return Part(grip, [seen], centre, AXIS_COLORS[other], points.mean(axis=0), 0.55)
    way = placed.axes[axes[0]]
    if np.linalg.norm(np.cross(way, sight)) < SHORT:
        return None
    points = origin + unit * np.outer((BALL_PX, ARROW_PX), way)
    root, tip = projection.pixels(points)
    shapes = _arrow(root, tip, ratio)
    return Part(grip, shapes, np.stack([root, tip]), AXIS_COLORS[axes[0]], points[1])


def _grow(placed: Placed, projection: Projection, grip: Grip, scale: Scale) -> Part | None:
    unit, ratio, sight = scale
    if not grip[1]:
        number = placed.grow(None)
        edge = placed.edge
        if number is None:
            return None
        (middle,) = projection.pixels(edge[None])
        step = unit / max(
            float(np.linalg.norm(number.path(number.value + unit, edge) - edge)), 1e-300
        )
        there = projection.pixels(number.path(number.value + step * unit, edge)[None])[0] - middle
        length = float(np.linalg.norm(there))
        way = there / length if length > STEEP * ratio else np.array([0.0, 1.0])
        shapes = [middle + _disc(BALL_PX * ratio)]
        for sign in (1.0, -1.0):
            shapes += _arrow(middle, middle + sign * SIZE_PX * ratio * way, 0.6 * ratio)
        return Part(grip, shapes, middle[None], AXIS_COLORS[2], edge)
    way = placed.axes[grip[1][0]]
    if np.linalg.norm(np.cross(way, sight)) < SHORT:
        return None
    point = placed.origin + unit * BOX_PX * way
    (middle,) = projection.pixels(point[None])
    box = middle + HALF_PX * ratio * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return Part(grip, [box], middle[None], AXIS_COLORS[grip[1][0]], point)


def _turn(placed: Placed, projection: Projection, grip: Grip, scale: Scale) -> Part | None:
    unit, ratio, sight = scale
    axis = grip[1][0] if grip[1] else None
    number = placed.turn(axis)
    if number is None or number.circle is None:
        return None
    centre, way = number.circle if axis is None else (placed.origin, placed.axes[axis])
    way = way / np.linalg.norm(way)
    arm = placed.origin - centre
    arm = arm - (arm @ way) * way
    radius = float(np.linalg.norm(arm))
    middle = placed.origin - arm
    whole = radius > RING_PX * unit
    if not whole:
        radius = RING_PX * unit
        arm = np.cross(way, np.eye(3)[int(np.argmin(np.abs(way)))])
        arm *= radius / np.linalg.norm(arm)
    angle = np.linspace(0.0, 2.0 * np.pi, (8 if whole else 1) * _TURNS + 1)
    round_ = np.outer(np.cos(angle), arm) + np.outer(np.sin(angle), np.cross(way, arm))
    # Of a ring that is not seen from straight ahead, the half behind would only be in the way.
    front = round_ @ sight <= 1e-6 * radius if abs(sight @ way) < 0.95 and not whole else angle >= 0
    last = int(np.argmax(~front)) if not front.all() else 0
    order = np.roll(np.arange(len(angle) - 1), -last) if last else np.arange(len(angle))
    order = order[front[order]]
    line = projection.pixels(middle + round_[order])
    color = AXIS_COLORS[5 if axis is None else axis % 6]
    held = middle + round_[order[len(order) // 2]]
    return Part(grip, _bar(line, WIDE_PX * ratio), line, color, held)


_PARTS: dict[Act, Callable[[Placed, Projection, Grip, Scale], Part | None]] = {
    "move": _move, "turn": _turn, "grow": _grow,
}  # fmt: skip


def part_at(parts: list[Part], pixel: FloatArray, ratio: float) -> Part | None:
    """Return the part that the mouse takes at a pixel (2,), or None."""
    for lines in (False, True):  # points before lines
        near = [(_distance(part.line, pixel), k) for k, part in enumerate(parts)
                if (len(part.line) > 1) == lines]  # fmt: skip
        far, k = min(near, default=(np.inf, 0))
        if far <= REACH_PX * ratio:
            return parts[k]
    return None


def control_at(
    session: Session, projection: Projection, pixel: FloatArray, reach: float, *, row: bool
) -> tuple[str, Index] | None:
    """Return box and index (i, j, k) of the control point at a pixel (2,), or None.

    ``row``: of the row of control points there; where it is chosen already, of a plane with it.
    """
    mesh = session.mesh
    if mesh is None or "ffd" not in session.view.drawn:
        return None
    boxes, moved = lattices(session.case, mesh)
    best: tuple[float, str, WholeNumbers] = (reach, "", ())
    for name, box in (boxes | moved).items():
        layers = box.points if mesh.dim == 3 else box.points[:, :, :1] * [1.0, 1.0, 0.0]
        seen = projection.pixels(layers.reshape(-1, 3)).reshape(*layers.shape[:3], 2)
        for axis in range(mesh.dim):
            ends = np.moveaxis(seen, axis, 0)
            far = (
                distances(pixel, ends[:-1], ends[1:])
                if row
                else np.linalg.norm(ends - pixel, axis=-1)
            )
            place = np.unravel_index(int(np.argmin(far)), far.shape)
            here = [int(one) for one in place[1:]]
            here.insert(axis, -1 if row else int(place[0]))
            best = min(best, (float(far[place]), name, tuple(here)))
    if not best[1]:
        return None
    _, name, at = best
    i, j, k = (*at[: mesh.dim], -1)[:3]
    planes = [(-1, j, k), (i, -1, k), (i, j, -1)]
    shown = [(name, index) for index in ((i, j, k), *planes[: mesh.dim] * row)]
    kinds = list(dict.fromkeys(shown))  # a row, then the planes with it, in turns
    now = chosen_control(session)
    return kinds[(kinds.index(now) + 1) % len(kinds)] if row and now in kinds else kinds[0]


def _distance(line: FloatArray, at: FloatArray) -> float:
    """Return the distance of a point (2,) from a polyline (k, 2)."""
    if len(line) == 1:
        return float(np.linalg.norm(line[0] - at))
    return float(distances(at, line[:-1], line[1:]).min())


def _disc(radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _arrow(root: FloatArray, tip: FloatArray, ratio: float) -> list[FloatArray]:
    """Return shaft and head of an arrow between pixels (2,), its head as long as fits."""
    way = tip - root
    length = float(np.linalg.norm(way))
    neck = tip - min(HEAD_PX * ratio, 0.5 * length) / max(length, 1e-30) * way
    wing = 0.4 * HEAD_PX * ratio * _across(way)
    return [
        *_bar(np.stack([root, neck]), WIDE_PX * ratio),
        np.stack([tip, neck + wing, neck - wing]),
    ]


def _across(way: FloatArray) -> FloatArray:
    """Return the unit vectors (..., 2) to the left of vectors (..., 2)."""
    left = np.stack([-way[..., 1], way[..., 0]], axis=-1)
    return left / np.maximum(np.linalg.norm(left, axis=-1, keepdims=True), 1e-30)


def _bar(line: FloatArray, width: float) -> list[FloatArray]:
    """Return quadrilaterals (4, 2) that draw a polyline (k, 2) with a width."""
    side = 0.5 * width * _across(np.diff(line, axis=0))
    return list(np.stack([line[:-1] - side, line[1:] - side, line[1:] + side, line[:-1] + side], 1))


class HandleActor:
    """The actor that draws the parts of a handle in a plotter, with the held one marked."""

    def __init__(self, plotter: Any) -> None:
        self.plotter = plotter
        self._shape = pv.PolyData()
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(self._shape)
        mapper.SetScalarModeToUseCellData()
        self.actor = vtkActor2D()
        self.actor.SetMapper(mapper)

    def draw(self, parts: list[Part], held: Grip | None, scheme: ColorScheme) -> None:
        """Draw parts, the last one at the bottom; that of the grip ``held`` in another color."""
        edge = (*pv.Color(scheme.background).int_rgb, 153)
        rim = []
        fill = []
        for part in parts[::-1]:
            color = SELECTED_COLOR if part.grip == held else part.color
            opacity = 1.0 if part.grip == held or held is None else 0.35 * part.opacity
            opacity = min(opacity, part.opacity)
            paint = (*pv.Color(color).int_rgb, round(255 * opacity))
            fill += [(polygon, paint) for polygon in part.polygons]
            rim += [(_wider(polygon), edge) for polygon in part.polygons
                    if opacity > 0.5 and len(part.line) < 3]  # fmt: skip
        every = rim + fill
        there = NAME in self.plotter.actors
        if not every:
            if there:
                remove_actor(self.plotter, NAME)
            return
        if not there:  # at first, and after the scene was cleared
            add_overlay(self.plotter, self.actor, NAME)
        flat = np.concatenate([polygon for polygon, _ in every])
        offsets = np.cumsum([0, *(len(polygon) for polygon, _ in every)])
        self._shape.points = np.column_stack([flat, np.zeros(len(flat))])
        self._shape.SetPolys(pv.CellArray.from_arrays(offsets, np.arange(offsets[-1])))
        array = numpy_to_vtk(np.array([paint for _, paint in every], np.uint8), deep=True)
        array.SetName("colors")
        self._shape.GetCellData().SetScalars(array)
        self._shape.Modified()


NAME = "handle:parts"


def _wider(polygon: FloatArray) -> FloatArray:
    """Return a polygon (k, 2) grown by about a pixel and a half to all sides."""
    arm = polygon - polygon.mean(axis=0)
    return polygon + 1.5 * arm / np.maximum(row_norms(arm)[:, None], 1e-30)
