"""What a handle moves: a boundary by its motions, control points of a box, or a section.

A handle changes numbers of the session and nothing else: a `Placed` has them, says where they put
the thing, and returns the session with other numbers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from slideviz.argument_types import record
from slideviz.case.motions.box import Ffd
from slideviz.case.motions.motion import Motion, MotionStart, Target, applies_to, named
from slideviz.case.motions.rigid import ByFormula, Radial, Rotate, Scale, Translate, rotated
from slideviz.ffd.box import CoordinateSystem, points_at
from slideviz.mesh.model import FloatArray, Mesh, row_norms
from slideviz.mesh.surfaces import padded
from slideviz.sections.around_axis import AboutAxis
from slideviz.sections.model import Section
from slideviz.sections.shape import triple
from slideviz.session import changes
from slideviz.session.motions import lattices, machine_axis, new_target
from slideviz.session.section_cuts import Cuts, can_cut
from slideviz.session.state import Session
from slideviz.terms import WholeNumbers

Act = Literal["move", "turn", "grow"]
Grip = tuple[Act, WholeNumbers]
Grips = tuple[Grip, ...]
"""A part of a handle: what it does, and along or about which of `Placed.axes`; () where it is
free."""
Kind = TypeVar("Kind", bound=Motion)

_PLANES: Grips = (("move", (0, 1)), ("move", (1, 2)), ("move", (0, 2)))
_SHOVES: Grips = (("move", (0,)), ("move", (1,)), ("move", (2,)))
_RINGS: Grips = (("turn", (0,)), ("turn", (1,)), ("turn", (2,)))
_TILTS: Grips = (("turn", (4,)), ("turn", (5,)))
_BALL: Grip = ("move", ())
_SIZE: Grip = ("grow", ())
SPACE: Grips = (_BALL, *_PLANES, *_SHOVES)
"""Grips that move something in space; `FLAT`: in the plane of a 2D mesh."""
FLAT: Grips = (_BALL, *_SHOVES[:2])
_ALONG = 1.0 - 1e-9  # cosine from which two directions are the same
_LEAST = 1e-3
"""Least factor or size, relative to that before; distance from the largest one, relative to it."""
_MOST = 400  # about how many places of a cut are offered: enough for one to be in any close-up
_DECIMALS = 4  # of a direction: nobody aims at more, and they would fill the fields


class Number(NamedTuple):
    """A number of the session that a handle changes."""

    value: float
    put: Callable[[float], Session]
    """Returns the session with another value."""
    path: Callable[[float, FloatArray], FloatArray]
    """Returns where a point (3,), which is there at ``value``, is at another one."""
    circle: tuple[FloatArray, FloatArray] | None = None
    """Of an angle in degrees: a point (3,) on the axis, and the axis's direction (3,)."""


def _turned(points: FloatArray, about: tuple[FloatArray, FloatArray], degrees: float) -> FloatArray:
    """Return points (k, 3) after a rotation about an axis: a point on it, and its direction."""
    return points + rotated(points - about[0], degrees, triple(about[1]))


def _in_space(numbers: ArrayLike) -> FloatArray:
    """Return two or three numbers as three (3,), of two with 0."""
    return padded(np.array([numbers]))[0]


@record
class Placed(ABC):
    """Something with a place in space, which a handle moves, turns or enlarges."""

    session: Session
    origin: FloatArray  # (3,): where its handle is
    axes: FloatArray  # (k, 3): unit vectors along which it moves, and about which it turns
    names: str
    """The key that chooses each axis: x, y, z; a, r, t for axial, radial and tangential; n for a
    normal."""

    free: ClassVar[WholeNumbers] = ()
    """The axes along which it moves where none was chosen; () for all."""

    @property
    def dim(self) -> int:
        """Return the dimension of the mesh."""
        return self.session.opened_mesh.dim

    def allows(self, act: Act, axis: int) -> bool:
        """Return whether one can act along or about an axis: in 2D it stays in the plane."""
        return self.dim == 3 or (axis == 2) == (act == "turn")

    @property
    def edge(self) -> FloatArray:
        """Return where (3,) the grip is that changes its size."""
        return self.origin

    @property
    @abstractmethod
    def grips(self) -> Grips:
        """Return the parts of its handle."""

    @property
    @abstractmethod
    def numbers(self) -> FloatArray:
        """Return the numbers (3,) that say where it is."""

    @abstractmethod
    def put(self, numbers: FloatArray) -> Session:
        """Return the session with other `numbers` (3,)."""

    def at(self, numbers: FloatArray) -> FloatArray:
        """Return where (3,) `origin` is with other `numbers` (3,)."""
        return self.origin + numbers - self.numbers

    def along(self, axis: int) -> Number:
        """Return the number that moves it along one of its axes."""
        start = self.numbers
        way = self.way(axis)
        value = float(start @ way)

        def there(to: float) -> FloatArray:
            moved = start + (to - value) * way
            moved[way == 1.0] = to  # to the last bit
            return moved

        return Number(
            value,
            lambda to: self.put(there(to)),
            lambda to, point: point + self.at(there(to)) - self.origin,
        )

    def way(self, axis: int) -> FloatArray:
        """Return the direction (3,) of its numbers along one of its axes."""
        return self.axes[axis]

    def number(self, act: Act, axis: int | None) -> Number | None:
        """Return the number that an act changes along or about an axis; None where it has none."""
        if act == "move":
            return None if axis is None else self.along(axis)
        return self.turn(axis) if act == "turn" else self.grow(axis)

    def turn(self, axis: int | None) -> Number | None:
        """Return its angle about one of its axes, None: about its own; None where it has none."""
        return None

    def grow(self, axis: int | None) -> Number | None:
        """Return its factor or size along an axis, None: along all; None where it has none."""
        return None

    @property
    def anchors(self) -> FloatArray:
        """Return places (k, 3) where its handle may be, the preferred one first."""
        return np.asarray(self.origin)[None]

    def anchored(self, place: int) -> Self:
        """Return it with its handle at one of `anchors`."""
        return self if place == 0 else replace(self, origin=self.anchors[place])


def _axes(session: Session, origin: FloatArray) -> tuple[FloatArray, str]:
    """Return the axes (k, 3) of something at a point (3,), and their keys."""
    machine = machine_axis(session)
    if machine is None or session.opened_mesh.dim == 2:
        return np.eye(3), "xyz"
    along = np.array(machine[0]) / np.linalg.norm(machine[0])
    arm = origin - machine[1]
    arm = arm - (arm @ along) * along
    length = float(np.linalg.norm(arm))
    if not length > 0.0:
        return np.eye(3), "xyz"
    return np.stack([*np.eye(3), along, arm / length, np.cross(along, arm / length)]), "xyzart"


@record
class PlacedBoundary(Placed):
    """Boundaries that motions move, turn and scale: the chosen one, others of the same target.

    A motion that is not there yet is added.
    """

    index: int | None  # the place of the chosen motion in the case
    marker: Target

    @property
    def motions(self) -> tuple[Motion, ...]:
        """Return the motions of the case."""
        return self.session.case.motions

    @property
    def grips(self) -> Grips:
        if self.dim == 2:
            return *FLAT, _RINGS[2], ("grow", (0,)), ("grow", (1,))
        chosen = None if self.index is None else self.motions[self.index]
        mine: Grips = (("turn", ()),) if isinstance(chosen, Rotate) else ()
        return *SPACE, *mine, *_RINGS, ("grow", (0,)), ("grow", (1,)), ("grow", (2,))

    def _find(self, kind: type[Kind], fits: Callable[[Any], bool], new: Kind) -> tuple[int, Kind]:
        """Return place and value of the motion to change: the chosen one, or the last that fits.

        The new one, to be added, where none does.
        """
        last = [place for place, one in enumerate(self.motions) if one.marker == self.marker]
        for place in ([] if self.index is None else [self.index]) + last[::-1]:
            motion = self.motions[place]
            if isinstance(motion, kind) and fits(motion):
                return place, motion
        return len(self.motions), new

    def _with(self, place: int, motion: Motion) -> Session:
        if place == len(self.motions):
            return changes.add_motion(self.session, motion)
        changed = changes.replace_motion(self.session, place, motion)
        return changes.choose_motion(changed, place)

    def _later(self, place: int) -> Iterator[ByFormula]:
        """Yield the motions after one, if they move the boundary by a formula."""
        names = named(self.marker) or self.session.case.markers_with("moving")
        for motion in self.motions[place + 1 :]:
            if isinstance(motion, ByFormula) and any(applies_to(motion, name) for name in names):
                yield motion

    def _slopes(self, place: int, *, with_turns: bool) -> FloatArray:
        """Return the derivative (3, 3) of the place after all motions by that after one of them.

        ``with_turns``: of a direction; else of a shift, which rotations about a centroid keep.
        """
        slopes = np.eye(3)
        step = 1e-3 * max(float(np.abs(self.origin).max()), 1e-9)
        for motion in self._later(place):
            if with_turns or getattr(motion, "point", None) != "centroid":
                points = self.origin + np.concatenate([np.zeros((1, 3)), step * np.eye(3)])
                fixed = motion.as_one(points[:1, : self.dim])
                shift = padded(fixed.shift(points[:, : self.dim]))
                slopes = (np.eye(3) + (shift[1:] - shift[0]).T / step) @ slopes
        return slopes

    @cached_property
    def _shift(self) -> tuple[int, Translate, FloatArray]:
        none = Translate(self.marker, (0.0,) * self.dim)
        place, motion = self._find(Translate, lambda _: True, none)
        return place, motion, self._slopes(place, with_turns=False)

    @property
    def numbers(self) -> FloatArray:
        return _in_space(self._shift[1].vector)

    def put(self, numbers: FloatArray) -> Session:
        place, motion, _ = self._shift
        return self._with(place, replace(motion, vector=tuple(numbers[: self.dim].tolist())))

    def at(self, numbers: FloatArray) -> FloatArray:
        return self.origin + self._shift[2] @ (numbers - self.numbers)

    def turn(self, axis: int | None) -> Number:
        machine = machine_axis(self.session)
        new = Rotate.new(self.marker, MotionStart(self.dim, machine))
        assert isinstance(new, Rotate)
        if axis is not None:
            way = triple(np.round(self.axes[axis], 12))
            stays = new.point if self.names[axis] == "a" else "centroid"
            new = replace(new, point=stays, axis=way)

        def fits(motion: Rotate) -> bool:
            cosine = float(np.dot(motion.axis, new.axis))
            length = float(np.linalg.norm(motion.axis) * np.linalg.norm(new.axis))
            return axis is None or not motion.angle_deg or cosine > _ALONG * length

        place, motion = self._find(Rotate, fits, new)
        if axis is not None and not motion.angle_deg:
            motion = replace(motion, axis=new.axis)
        return self._turn_by(place, motion)

    def _turn_by(self, place: int, motion: Rotate) -> Number:
        centre = self.origin
        if motion.point != "centroid":
            centre = _in_space(motion.point)
            for later in self._later(place):
                here = centre[None, : self.dim]
                centre = centre + padded(later.as_one(self.origin[None, : self.dim]).shift(here))[0]
        about = centre, self._slopes(place, with_turns=True) @ np.array(motion.axis)

        def put(angle: float) -> Session:
            return self._with(place, replace(motion, angle_deg=angle))

        value = motion.angle_deg
        return Number(value, put, lambda to, p: _turned(p[None], about, to - value)[0], about)

    def grow(self, axis: int | None) -> Number | None:
        none = Scale(self.marker, (1.0,) * self.dim)
        place, motion = self._find(Scale, lambda _: True, none)
        factors = np.broadcast_to(motion.factors, self.dim)
        mine = np.arange(self.dim) == (np.arange(self.dim) if axis is None else axis)
        if not mine.any():
            return None
        value = float(factors[mine][0])

        def put(factor: float) -> Session:
            ratio = max(factor / value, _LEAST)
            changed = tuple(np.where(mine, factors * ratio, factors).tolist())
            return self._with(place, replace(motion, factors=changed))

        centre = self.origin if motion.point == "centroid" else _in_space(motion.point)

        def path(factor: float, point: FloatArray) -> FloatArray:
            ratio = _in_space(np.where(mine, factor / value, 1.0))
            return centre + (point - centre) * ratio

        return Number(value, put, path)


class PlacedRadius(PlacedBoundary):
    """Boundaries that a motion pushes away from an axis."""

    @property
    def grips(self) -> Grips:
        return (("grow", ()),)

    def grow(self, axis: int | None) -> Number | None:
        assert self.index is not None
        index = self.index
        motion = self.motions[index]
        assert isinstance(motion, Radial)
        value = motion.distance
        along = np.array(motion.axis) / np.linalg.norm(motion.axis)

        def path(distance: float, point: FloatArray) -> FloatArray:
            arm = point - _in_space(motion.point)
            arm = arm - (arm @ along) * along
            return point + (distance - value) * arm / max(np.linalg.norm(arm), 1e-300)

        def put(distance: float) -> Session:
            return self._with(index, replace(motion, distance=distance))

        return Number(value, put, path)


@record
class PlacedControl(Placed):
    """Control points of a box, which a motion moves along the axes of the box's coordinates."""

    index: int  # the place of the motion in the case
    q: FloatArray  # (3,): the mean of the control points as they are moved, in these coordinates
    system: CoordinateSystem

    @property
    def motion(self) -> Ffd:
        """Return the motion."""
        motion = self.session.case.motions[self.index]
        assert isinstance(motion, Ffd)
        return motion

    @property
    def grips(self) -> Grips:
        if self.dim == 2:
            return FLAT
        return SPACE if self.system.kind == "CARTESIAN" else (_BALL, *_SHOVES)

    @property
    def numbers(self) -> FloatArray:
        return np.array(self.motion.vector)

    def put(self, numbers: FloatArray) -> Session:
        moved = replace(self.motion, vector=triple(numbers))
        return changes.replace_motion(self.session, self.index, moved)

    def at(self, numbers: FloatArray) -> FloatArray:
        return self.system.points_of(self.q + numbers - self.numbers)

    def way(self, axis: int) -> FloatArray:
        return self.axes[axis] if self.system.kind == "CARTESIAN" else np.eye(3)[axis]


@record
class PlacedSection(Placed):
    """A section of the view; its axes are x, y, z, its normal or axis, and two across."""

    section: Section
    points: FloatArray  # (k, 3): of its cut, or of the mesh where it cuts nothing

    @property
    def is_plane(self) -> bool:
        """Return whether it is a plane, or in 2D a line."""
        return not isinstance(self.section, AboutAxis)

    @property
    def free(self) -> WholeNumbers:  # type: ignore[override]  # differs by shape
        return (3,) if self.is_plane and self.dim == 3 else ()

    @property
    def grips(self) -> Grips:
        if self.is_plane:
            return _BALL, ("move", (3,)), *(_RINGS[2:] if self.dim == 2 else _TILTS)
        return (*FLAT, _SIZE) if self.dim == 2 else (_SIZE,)

    @property
    def numbers(self) -> FloatArray:
        return self.section.point

    def put(self, numbers: FloatArray) -> Session:
        return self._with(replace(self.section, origin=triple(numbers + 0.0)))

    def _with(self, section: Section) -> Session:
        index = self.session.view.section_index
        assert index is not None
        return changes.replace_section(self.session, index, section)

    def turn(self, axis: int | None) -> Number | None:
        if not self.is_plane:
            return None
        usual = 2 if self.dim == 2 else 4
        about = self.origin, self.axes[usual if axis is None else axis]
        normal = self.section.basis[2][None]

        def put(angle: float) -> Session:
            turned = _turned(normal, (np.zeros(3), about[1]), angle)[0].round(_DECIMALS) + 0.0
            way = triple(turned)
            return self._with(replace(self.section, origin=triple(self.origin), direction=way))

        return Number(0.0, put, lambda to, point: _turned(point[None], about, to)[0], about)

    def grow(self, axis: int | None) -> Number | None:
        section = self.section
        if not isinstance(section, AboutAxis):
            return None
        size = section.size
        places = section.places(self.edge[None])
        limits = _LEAST * size, section.size_terms.high * (1.0 - _LEAST)

        def path(to: float, point: FloatArray) -> FloatArray:
            sizes = (size, float(np.clip(to, *limits)))
            ends = np.concatenate([section.surface(places, one) for one in sizes])
            return point + ends[1] - ends[0]

        return Number(size, lambda to: self._with(section.sized(float(np.clip(to, *limits)))), path)

    @property
    def edge(self) -> FloatArray:
        if self.dim == 3:
            return self.origin
        return self.origin + self.section.size * np.array([np.sqrt(0.5)] * 2 + [0.0])

    @cached_property
    def anchors(self) -> FloatArray:
        section = self.section
        if not isinstance(section, AboutAxis):
            some = self.points[:: max(len(self.points) // _MOST, 1)]
            across = np.outer(section.distance(some), section.basis[2])
            return np.concatenate([self.origin[None], some - across])
        if self.dim == 2:
            return self.origin[None]
        places = section.patch(self.points).places
        return np.concatenate([self.origin[None], section.surface(places, section.size)])


def placed(session: Session, ghosts: Mapping[str, FloatArray], cuts: Cuts) -> Placed | None:
    """Return what the handle of a session moves; None where it has none.

    ``ghosts``: where motions take the nodes (u, d) of each boundary. ``cuts``: of its sections.
    """
    view = session.view
    if session.mesh is None or session.frame is None:
        return None
    if view.handle == "section" and view.section is not None:
        return _section(session, view.section, cuts)
    return _boundary(session, ghosts) if view.handle in ("motion", "boundary") else None


def _section(session: Session, section: Section, cuts: Cuts) -> PlacedSection | None:
    mesh = session.shown_frame.mesh
    if not section.shown or not can_cut(mesh, section):
        return None
    points = points_near(section, mesh, cuts)
    origin = section.point
    if isinstance(section, AboutAxis) and mesh.dim == 3:
        (origin,) = section.surface(np.array([section.patch(points).middle]), section.size)
    elif mesh.dim == 2:
        origin = _in_space(section.in_plane.middle)
    across = section.basis[[2, 0, 1]]
    axes = np.concatenate([np.eye(3), across])
    return PlacedSection(session, origin, axes, "xyznuv", section, points)


def points_near(section: Section, mesh: Mesh, cuts: Cuts) -> FloatArray:
    """Return the points (n, 3) of a section's cut; the mesh's nodes if it cuts no cell."""
    cut = cuts.of(mesh, section)
    return cut.points if len(cut) else padded(mesh.points[cuts.cutter(mesh).used])


def _boundary(session: Session, ghosts: Mapping[str, FloatArray]) -> Placed | None:
    mesh = session.opened_mesh
    by_motion = session.view.handle == "motion"
    index = session.motion_index if by_motion else None
    motion = None if index is None else session.case.motions[index]
    if isinstance(motion, Ffd) and index is not None:
        return _control(session, index, motion)
    if by_motion and not isinstance(motion, ByFormula):
        return None
    marker = new_target(session) if motion is None else motion.marker
    names = named(marker) or session.case.markers_with("moving")
    nodes = {name: mesh.marker(name).nodes for name in names if name in mesh.marker_names}
    if not nodes:
        return None
    once = np.unique(np.concatenate([*nodes.values()]), return_index=True)[1]
    moved = [ghosts.get(name, mesh.points[mine]) for name, mine in nodes.items()]
    origin = _in_space(np.concatenate(moved)[once].mean(axis=0))
    kind = PlacedRadius if isinstance(motion, Radial) else PlacedBoundary
    return kind(session, origin, *_axes(session, origin), index, marker)


def _control(session: Session, index: int, motion: Ffd) -> PlacedControl | None:
    mesh = session.opened_mesh
    boxes, moved = lattices(session.case, mesh)
    box = moved.get(motion.box) or boxes.get(motion.box)
    if box is None or box.problem(motion.index):
        return None
    system = box.system
    q = box.q[points_at(motion.index)].reshape(-1, 3).mean(axis=0)
    origin = system.points_of(q)
    axes, names = _axes(session, origin)
    if system.kind != "CARTESIAN":
        ways = system.pushed(np.tile(q, (3, 1)), np.eye(3))
        axes = ways / row_norms(ways)[:, None]
        names = "rta"
        if mesh.dim == 2:
            return None
    return PlacedControl(session, origin, axes, names, index, q, system)
