"""SU2's kinds of FFD variables: which control points of a box each moves, and how.

SU2 8, ``CSurfaceMovement::SetFFDCPChange`` and its neighbours. Directions 1 to 3 are those of the
box's coordinates q: x, y, z in Cartesian ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.ffd.box import Box, points_at
from slideviz.mesh.model import FloatArray

NEARLY = 1e-6
"""SU2's shift of the plane in which a twist finds its centre (``SegmentIntersectsPlane``)."""
NORMAL = np.array([NEARLY, 1.0 + NEARLY, NEARLY])  # normal of that plane


@record
class Shift:
    """The change ``unit`` (I, J, K, 3) times the amount."""

    unit: FloatArray

    @property
    def chosen(self) -> np.ndarray:
        """Return which control points it moves, (I, J, K) bool."""
        return np.asarray(self.unit.any(axis=-1))

    def change(self, _points: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3), whatever the points."""
        return amount * self.unit

    def slope(self, _points: FloatArray, _amount: float) -> FloatArray:
        """Return the derivative (I, J, K, 3)."""
        return self.unit

    def pushed(self, _points: FloatArray, _amount: float, rates: FloatArray) -> FloatArray:
        """Return the rates (I, J, K, 3) unchanged."""
        return rates


@record
class Turn:
    """A rotation of the control points ``chosen`` (I, J, K) bool about a line.

    The line goes through ``point`` along ``axis`` (right-hand rule, any length). The angle is
    ``rate`` radians times the amount, or with a ``length`` the arc tangent of amount over length.
    """

    chosen: np.ndarray
    point: FloatArray
    axis: FloatArray
    rate: float = 1.0
    length: float | None = None

    def change(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3) of points."""
        return self.turned(points - self.point, amount)

    def slope(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the derivative (I, J, K, 3) with respect to the amount."""
        across, twice = self._crossed(points - self.point)
        angle = self._angle(amount)
        turned = np.cos(angle) * across + np.sin(angle) * twice
        if self.length is None:
            return self.rate * turned
        return turned * self.length / (self.length**2 + amount**2)

    def pushed(self, _points: FloatArray, amount: float, rates: FloatArray) -> FloatArray:
        """Return the derivative (I, J, K, 3) of the moved points along ``rates`` of the points."""
        return rates + self.turned(rates, amount)

    def turned(self, arm: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3) of vectors: ``sin k x v + (1 - cos) k x (k x v)``."""
        angle = self._angle(amount)
        across, twice = self._crossed(arm)
        return np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * twice

    def _angle(self, amount: float) -> float:
        if self.length is None:
            return self.rate * amount
        return float(np.arctan(amount / self.length))

    def _crossed(self, arm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ``k x v`` and ``k x (k x v)`` of vectors (I, J, K, 3); 0 where not chosen."""
        axis = self.axis / np.linalg.norm(self.axis)
        across = np.cross(axis, np.where(self.chosen[..., None], arm, 0.0))
        return across, np.cross(axis, across)


@record
class Twist:
    """A rotation of control points about y, through the point where a segment meets a plane.

    The segment goes from ``first`` to ``end`` (3,), the plane through the control point
    (0, ``row``, 0) across y. The angle is the arc tangent of the amount over ``length``. Nothing
    moves where segment and plane do not meet.
    """

    chosen: np.ndarray
    first: FloatArray
    end: FloatArray
    row: int
    length: float

    def turn(self, points: FloatArray) -> Turn | None:
        """Return the rotation that it is for these points; None where nothing moves."""
        along = float(NORMAL @ (self.end - self.first))
        if along == 0.0:
            return None
        at = float(NORMAL @ (points[0, self.row, 0] + NEARLY - self.first)) / along
        centre = self.first + at * (self.end - self.first)
        axis = np.array([0.0, 1.0, 0.0])
        return Turn(self.chosen, centre, axis, length=self.length) if 0.0 <= at <= 1.0 else None

    def change(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3) of points."""
        turn = self.turn(points)
        return turn.change(points, amount) if turn else np.zeros_like(points)

    def slope(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the derivative (I, J, K, 3) with respect to the amount."""
        turn = self.turn(points)
        return turn.slope(points, amount) if turn else np.zeros_like(points)

    def pushed(self, points: FloatArray, amount: float, rates: FloatArray) -> FloatArray:
        """Return the derivative (I, J, K, 3) of the moved points along ``rates`` of the points."""
        turn = self.turn(points)
        if turn is None:
            return rates
        span = self.end - self.first
        centre = span * float(NORMAL @ rates[0, self.row, 0]) / float(NORMAL @ span)
        return rates + turn.turned(rates - centre, amount)


Move = Shift | Turn | Twist
"""A way to move the control points of a box, scaled by an amount."""
Moves = tuple[Move, ...]
Planes = tuple[frozenset[int], frozenset[int], frozenset[int]]
"""Indices of held planes of control points in each direction i, j, k of a box."""
NONE: Planes = (frozenset(), frozenset(), frozenset())


@frozen
class Request:
    """What an FFD variable asks of its box."""

    kind: str  # a key of `KINDS`
    index: tuple[int, ...]  # the indices among its parameters, as SU2 lists them; -1 means all
    numbers: tuple[float, ...]  # its other parameters
    length: float = 1.0  # REF_LENGTH, over which the value of FFD_TWIST is a slope

    @property
    def direct(self) -> bool:
        """Return whether the values are the shift itself, one for each coordinate."""
        return self.kind in ("FFD_CONTROL_POINT", "FFD_CONTROL_POINT_2D") and not any(self.numbers)


MovesOf = Callable[[Box, Request, Planes], Moves]
"""A function that returns the moves of a kind of variables."""


def moves_of(box: Box, request: Request, held: Planes = NONE) -> Moves:
    """Return the move of a box for each value of a variable; () where held planes leave none."""
    return KINDS[request.kind](box, request, held)


def variable_problem(box: Box, request: Request, dim: int, values: Sequence[float]) -> str:
    """Return why a variable cannot move a box; "" if it can. ``dim`` is that of the mesh."""
    kind = request.kind
    index = request.index
    if kind not in WHOLE_LINES and -1 in index:
        return f"{kind} has no index -1; write one from 0"
    if _is_polar(box, kind) and index[1] == -1:
        return f"{kind} has no second index -1 in polar coordinates; write one from 0"
    full = [0, 0, 0]
    for at, axis in zip(index, _directions(box, kind), strict=True):
        full[axis] = at
    if unknown := box.problem((full[0], full[1], full[2])):
        return unknown
    if (
        kind in ("FFD_ROTATION", "FFD_CONTROL_SURFACE")
        and request.numbers[:3] == request.numbers[3:]
    ):
        return f"{kind}: its two points coincide, so the line between them has no direction"
    across = 2 if box.system.kind == "CARTESIAN" else 1  # in which a plane mesh must not move
    moves = moves_of(box, request)
    for move, value in zip(moves, values, strict=False):
        if dim == 2 and (value or len(moves) == 1) and _leaves(move, across):
            two = f"; take {kind}_2D" if f"{kind}_2D" in KINDS and len(moves) == 1 else ""
            return f"{kind} moves points out of the plane of a mesh of 2 dimensions{two}"
    return ""


def _leaves(move: Move, across: int) -> bool:
    """Return whether a move takes control points along a direction, 0 to 2, or turns them there."""
    if isinstance(move, Shift):
        return bool(move.unit[..., across].any())
    axis = move.axis if isinstance(move, Turn) else np.array([0.0, 1.0, 0.0])
    return bool(np.delete(axis, across).any())


def _is_polar(box: Box, kind: str) -> bool:
    return kind == "FFD_CONTROL_POINT_2D" and box.system.kind == "POLAR"


def _directions(box: Box, kind: str) -> tuple[int, ...]:
    return (0, 2) if _is_polar(box, kind) else DIRECTIONS[kind]


def _is_held(index: tuple[int, ...], held: Planes) -> bool:
    return any(at in planes for at, planes in zip(index, held, strict=True))


def _shift(box: Box, chosen: list[tuple[int | slice, ...]], vector: FloatArray) -> Shift:
    """Return the shift by a vector (3,) of control points ``chosen``, each as often as it is."""
    unit = np.zeros(box.points.shape)
    for each in chosen:
        unit[each] += vector
    return Shift(unit)


def _control_point(box: Box, request: Request, held: Planes) -> Moves:
    index = request.index
    lines = [axis for axis in range(3) if index[axis] == -1]
    if len(lines) == 3 or _is_held(index, held):
        return ()
    free = np.ones(box.points.shape[:3], bool)
    if len(lines) == 1:  # whole layers move whatever is held
        np.moveaxis(free, lines[0], 0)[sorted(held[lines[0]])] = False
    return _by(box, request, [points_at(index)], free)


def _control_point_2d(box: Box, request: Request, held: Planes) -> Moves:
    axes = _directions(box, request.kind)
    layers = 3 - sum(axes)  # the direction of the layers that move together
    index = [0, 0, 0]
    index[axes[0]], index[axes[1]] = request.index
    if _is_held(tuple(index), held):
        return ()
    both = []
    for layer in (0, 1):
        index[layers] = layer
        both.append(points_at(tuple(index)))
    return _by(box, request, both, np.ones(box.points.shape[:3], bool))


def _by(
    box: Box, request: Request, chosen: list[tuple[int | slice, ...]], free: np.ndarray
) -> Moves:
    """Return the shift along the variable's direction, or one along each axis without one."""
    axes = _directions(box, request.kind)
    if request.direct:
        vectors = [np.eye(3)[axis] for axis in axes]
    else:
        vectors = [np.zeros(3)]
        vectors[0][list(axes)] = request.numbers
    return tuple(Shift(_shift(box, chosen, each).unit * free[..., None]) for each in vectors)


def _pair(sign: float, flat: bool) -> MovesOf:
    """Return the kind that moves the first two layers, the first one by ``sign`` times as much."""

    def moved(box: Box, request: Request, held: Planes) -> Moves:
        i = request.index[0]
        vector = np.array([0.0, 1.0, 0.0] if flat else [0.0, 0.0, 1.0])
        unit = np.zeros(box.points.shape)
        for layer in (0, 1):
            at = (i, layer, slice(2)) if flat else (i, request.index[1], layer)
            if not flat and _is_held(at, held):  # type: ignore[arg-type]
                return ()
            unit[at] = vector if layer else sign * vector
        return (Shift(unit),)

    return moved


def _gull(box: Box, request: Request, held: Planes) -> Moves:
    (j,) = request.index
    if j in held[1]:
        return ()
    return (_shift(box, [(slice(None), j, slice(None))], np.array([0.0, 0.0, 1.0])),)


def _nacelle(box: Box, request: Request, held: Planes) -> Moves:
    index = request.index
    last = box.degrees
    if index == (-1, -1, -1):
        return ()
    i, j, k = index
    mirror = (i, last[1] - j if j >= 0 else j, k)
    # The second pass of SU2's loop checks where the first one ended.
    ended = (i if i >= 0 else last[0], mirror[1] if j >= 0 else 0, k if k >= 0 else last[2])
    passes = [(index, index), (mirror, ended)][: 1 if j >= 0 and mirror == index else 2]
    chosen = []
    for moved, checked in passes:
        if _is_held(checked, held):
            break
        chosen.append(points_at(moved))
    vector = np.array([request.numbers[0], 0.0, request.numbers[1]])
    return (_shift(box, chosen, vector),) if chosen else ()


def _twist(box: Box, request: Request, held: Planes) -> Moves:
    (j,) = request.index
    if j in held[1]:
        return ()
    chosen = np.zeros(box.points.shape[:3], bool)
    chosen[:, j] = True
    chosen[sorted(held[0])] = False
    chosen[:, :, sorted(held[2])] = False
    first, second = np.array(request.numbers).reshape(2, 3)
    return (Twist(chosen, first, second, j, request.length),)


def _rotation(box: Box, request: Request, _held: Planes) -> Moves:
    return (_about(request, np.ones(box.points.shape[:3], bool), np.pi / 180.0),)


def _control_surface(box: Box, request: Request, _held: Planes) -> Moves:
    chosen = np.zeros(box.points.shape[:3], bool)
    chosen[:-2, 2:-2] = True
    return (_about(request, chosen, -np.pi / 180.0),)


def _about(request: Request, chosen: np.ndarray, rate: float) -> Turn:
    first, second = np.array(request.numbers).reshape(2, 3)
    return Turn(chosen, first, second - first, rate)


KINDS: dict[str, MovesOf] = {
    "FFD_CONTROL_POINT": _control_point,
    "FFD_CONTROL_POINT_2D": _control_point_2d,
    "FFD_CAMBER": _pair(1.0, flat=False),
    "FFD_CAMBER_2D": _pair(1.0, flat=True),
    "FFD_THICKNESS": _pair(-1.0, flat=False),
    "FFD_THICKNESS_2D": _pair(-1.0, flat=True),
    "FFD_GULL": _gull,
    "FFD_TWIST": _twist,
    "FFD_ROTATION": _rotation,
    "FFD_CONTROL_SURFACE": _control_surface,
    "FFD_NACELLE": _nacelle,
    "FFD_ANGLE_OF_ATTACK": lambda *_: (),
}
"""The moves of each kind of FFD variable."""
DIRECTIONS: dict[str, tuple[int, ...]] = {
    "FFD_CONTROL_POINT": (0, 1, 2),
    "FFD_CONTROL_POINT_2D": (0, 1),
    "FFD_CAMBER": (0, 1),
    "FFD_CAMBER_2D": (0,),
    "FFD_THICKNESS": (0, 1),
    "FFD_THICKNESS_2D": (0,),
    "FFD_GULL": (1,),
    "FFD_TWIST": (1,),
    "FFD_ROTATION": (),
    "FFD_CONTROL_SURFACE": (),
    "FFD_NACELLE": (0, 1, 2),
    "FFD_ANGLE_OF_ATTACK": (),
}
"""The direction, 0 to 2, of each index among the parameters of a kind."""
WHOLE_LINES = ("FFD_CONTROL_POINT", "FFD_CONTROL_POINT_2D", "FFD_NACELLE")
"""Kinds whose index may be -1, which means all."""
