"""Motions of control points of boxes for free-form deformation, and of the nodes inside."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.displacement import Displacements, NodesOn, PlacedDisplacements
from slideviz.case.motions.motion import (
    Motion,
    MotionStart,
    Target,
    applies_to,
    axis_length,
    direction_words,
    marker_words,
    number_texts,
    place_words,
    vector_words,
    without_brackets,
)
from slideviz.case.values import axis_text, read_axis, read_vector, vector_text
from slideviz.case.words import Words, angle_deg, name_text, number
from slideviz.errors import CaseError, Message, SlidevizError, nearest, note
from slideviz.ffd.box import (
    CARTESIAN,
    Box,
    CoordinateSystem,
    Embedding,
    Index,
    plane_corners,
    polar_corners,
    regular_box,
)
from slideviz.ffd.deformation import parametric
from slideviz.ffd.kinds import Turn
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.model import FloatArray, Mesh, ZonePart
from slideviz.system.weak_cache import WeakCache, weak_cache
from slideviz.terms import Numbers, Term, Vector, WholeNumbers

if TYPE_CHECKING:
    from slideviz.case.model import Case

OFF = 1e-6
"""Largest distance between a node and the point that the mesh file's parametric coordinates give
for it, over the size of the box, that gets no warning."""

_DEFINED = WeakCache()


def boxes_for(case: Case, mesh: Mesh) -> dict[str, Box]:
    """Return the boxes of mesh and case by name; of two with one name that of the mesh."""
    boxes = boxes_of(mesh, system_of(case))
    return {**defined_boxes(case, mesh), **{box.name: box for box in boxes}}


def system_of(case: Case) -> CoordinateSystem:
    """Return the coordinate system of the boxes of a case."""
    plain = case.ffd_system == "CARTESIAN"  # which has no axis
    return CARTESIAN if plain else CoordinateSystem(case.ffd_system, case.ffd_axis)


def box_definition(case: Case) -> tuple[object, ...]:
    """Return the values of a case that its boxes depend on."""
    shape = case.ffd_boxes, case.ffd_degrees, case.ffd_blending, case.ffd_orders
    return *shape, case.ffd_system, case.ffd_axis


def defined_boxes(case: Case, mesh: Mesh) -> dict[str, Box]:
    """Return the undeformed boxes of FFD_DEFINITION by name; CaseError if values make no box."""

    def boxes() -> dict[str, Box]:
        return {
            name: _defined(case, mesh.dim, name, corners, degrees)
            for (name, corners), degrees in zip(case.ffd_boxes, case.ffd_degrees, strict=False)
        }

    return _DEFINED.of(mesh, box_definition(case), boxes)


def _defined(
    case: Case, dim: int, name: str, numbers: Numbers, degrees: tuple[int, int, int]
) -> Box:
    corners = np.array(numbers).reshape(8, 3)
    system = system_of(case)
    i, j, k = (*degrees[:dim], 1)[:3]
    first, second, third = (*case.ffd_orders[:dim], 2)[:3]
    if dim == 2 and system.kind == "POLAR":  # j goes about the axis
        corners = polar_corners(corners[:4, :2])
        j, k, second, third = k, j, third, second
    elif dim == 2:
        corners = plane_corners(corners[:4, :2])
    orders = (first, second, third) if case.ffd_blending == "BSPLINE_UNIFORM" else None
    try:
        return regular_box(name, corners, (i, j, k), orders, system)
    except CaseError as problem:
        raise CaseError(f"FFD_DEFINITION: box {name!r}: {problem}") from problem


def missing_box(mesh: Mesh, name: str, boxes: Iterable[str], none: str) -> str:
    """Return the message that there is no box of a name, with those there are.

    ``boxes``: the names of the boxes there are. ``none``: the end of the message where there are
    none.
    """
    zone = mesh.origin.ffd_elsewhere.get(name)
    if zone is not None:
        return (
            f"{mesh.name}: the FFD box {name!r} is in zone {zone}, and this is zone {mesh.zone}; "
            f"choose that zone (ZONE= {zone} in a case, or --zone {zone}), or a box of this one"
        )
    known = ", ".join(boxes)
    why = nearest(name, boxes) or f"; {f'it has {known}' if known else none}"
    return f"{mesh.name} has no FFD box {name!r}{why}"


@weak_cache
def embedding(mesh: Mesh, box: Box, marker: str) -> tuple[Embedding, float]:
    """Return the nodes of a marker in a box, embedded there, and how far off they are at most.

    Their parametric coordinates are read from the mesh file, where it has some for this marker;
    else they are computed. How far off: the distance of a node from the point of its parametric
    coordinates, over the size of the box. Both are found once for each mesh.
    """
    on = mesh.marker(marker).nodes
    if marker in box.embedded:
        nodes, uvw = box.embedded[marker]
        inside = np.isin(nodes, on)
    else:
        nodes = on
        uvw, inside = parametric(box, mesh.points[on])
    embedded = box.embed(nodes[inside], uvw[inside])
    size = np.ptp(box.points.reshape(-1, 3), axis=0)[: mesh.dim]
    there = box.system.points_of(embedded.sums(box.q))[:, : mesh.dim]
    gap = np.abs(there - mesh.points[embedded.nodes]) / size
    return embedded, float(gap.max(initial=0.0))


def off_points(box: Box, mesh: Mesh, marker: str) -> list[str]:
    """Return a warning where the nodes of a marker in a box are off (`embedding`); else []."""
    _, off = embedding(mesh, box, marker)
    sentence = (
        f"{mesh.name}: the surface points of the FFD box {box.name!r} on {marker} differ from the "
        f"mesh by up to {off:.1g} of the box; if the mesh was moved without it, define the box "
        "again; if it is in other coordinates, set FFD_COORD_SYSTEM"
    )
    return [sentence] if off > OFF else []


_STAYS = (
    "the FFD box {} in the deformed mesh stays where it was, because boxes are nested or other "
    "motions move boundaries, too; define it again to use it with that mesh"
)


class BoxMotion(Motion):
    """A motion of control points of a box; those of one box act one after the other."""

    box: str

    chosen = ("index", "plane")

    def lattice_index(self, dim: int) -> Index:
        """Return the index (i, j, k) of the control points that move; -1 means all."""
        raise NotImplementedError

    def control_change(self, box: Box, q: FloatArray, dim: int) -> FloatArray:
        """Return the change (I, J, K, 3) of control points, now at ``q``."""
        raise NotImplementedError

    def unfit(self, case: Case, box: Box, dim: int) -> Iterator[str]:
        """Yield why the motion is impossible with its box, a sentence for each reason."""
        yield from ()

    @property
    def place_in_box(self) -> WholeNumbers:
        """Return the indices of the control points that move, as the user gives them."""
        raise NotImplementedError

    @property
    def box_words(self) -> str:
        """Return the name of the box, in words."""
        return self.box or "(no box yet)"

    def control_words(self, dim: int = 3) -> str:
        """Return the control points that move, and their box, in words; in 2D all layers do."""
        place = self.place_in_box
        if dim == 2 and place[-1] < 0:
            place = place[:-1]
        index = ", ".join("all" if index < 0 else str(index) for index in place)
        return f"({index}) of {self.box_words}"

    def described(self, dim: int, extent: float) -> str:
        return self.label(".4g", exact=False)

    def incomplete(self) -> str:
        if self.box:
            return ""
        return "it names no FFD box; choose one of the mesh, or define one with FFD_DEFINITION"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        try:
            boxes = boxes_for(case, mesh)
        except SlidevizError as problem:
            yield str(problem)
            return
        if self.box not in boxes:
            none = "none is in it, or in FFD_DEFINITION"
            yield missing_box(mesh, self.box, boxes, none)
            return
        box = boxes[self.box]
        if unknown := box.problem(self.lattice_index(mesh.dim)):
            yield unknown
        yield from self.unfit(case, box, mesh.dim)

    @classmethod
    def placed(
        cls, case: Case, mesh: Mesh, on: NodesOn, problems: list[Message]
    ) -> PlacedDisplacements:
        motions = box_motions(case)
        boxes = boxes_for(case, mesh) if motions else {}
        found: PlacedDisplacements = {}
        outside: dict[int, Message] = {}
        alone = len(motions) == len(case.motions) and not any(box.level for box in boxes.values())
        for name, changes in box_changes(case, mesh, boxes).items():
            for place, q, change in changes:
                motion = case.motions[place]
                mine = {name: nodes for name, nodes in on.items() if applies_to(motion, name)}
                moved = _moved(boxes[name], mesh, q, change, mine)
                if moved is not None:
                    if not alone and any(b.name == name for b in boxes_of(mesh, system_of(case))):
                        stays = note(_STAYS.format(repr(name)))
                        moved = replace(moved, warnings=(*moved.warnings, stays))
                    found[place] = moved
                elif mine:
                    outside[place] = Message(
                        f"motion {place + 1}: no node of {marker_words(motion.marker)} is in the "
                        f"FFD box {name!r}; move the box, or take another boundary"
                    )
        problems += [outside[place] for place in sorted(outside)]
        return found

    def of_zone(self, part: ZonePart, zone: Case) -> Motion | None:
        elsewhere = not self.marker and self.box not in boxes_for(zone, part.mesh)
        return None if elsewhere else self

    def design_name(self) -> str:
        return ".".join([super().design_name(), self.box, *map(str, self.place_in_box)])


@frozen
class Ffd(BoxMotion):
    """Move control points of a box for free-form deformation, and with them the nodes inside.

    ``box`` is the name of a box of the mesh or of ``Case.ffd_boxes``, ``index`` the control point
    (i, j, k), where -1 takes all of a direction, ``vector`` its shift (dx, dy, dz), dz 0 in 2D. The
    displacement of a node depends on its undeformed place in the undeformed box, whatever motions
    come before.
    """

    marker: Target
    box: str
    index: tuple[int, int, int]
    vector: Vector

    kind_term = Term("free-form box")
    verbs = ("ffd",)
    grammar = (
        "(BLADE, ffd, BOX, i, j, k, dx, dy, dz)        control point of a box; -1: all of an index",
    )
    rows = ("index", "box", "vector")
    proportional = ("vector",)

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        items = without_brackets(words)
        _require_words(
            items,
            (5, 7),
            "the control point i, j, k (-1 is all of a direction) and its shift: "
            "ffd, BOX, 2, 1, 0, dx, dy, dz; in 2D ffd, BOX, 2, 1, dx, dy will do",
        )
        count = (len(items) - 1) // 2
        i, j, k = (*_integers(items[1 : 1 + count]), -1)[:3]
        dx, dy, dz = (*(number(word.text) for word in items[1 + count :]), 0.0)[:3]
        return cls(marker, items[0].text, (i, j, k), (dx, dy, dz))

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(marker, _first_box(start), (0, 0, _last_index(start)), (0.0, 0.0, 0.0))

    def arguments(self) -> list[str]:
        return [name_text(self.box), *map(str, self.index), *number_texts(*self.vector)]

    def described(self, dim: int, extent: float) -> str:
        by = place_words(self.vector[:dim], extent)
        return f"move {self.control_words(dim)} by {by}"

    def label(self, form: str, *, exact: bool) -> str:
        return f"{self.control_words()} {vector_words(self.vector, form)}"

    @property
    def place_in_box(self) -> WholeNumbers:
        return self.index

    def lattice_index(self, dim: int) -> Index:
        return self.index

    def control_change(self, box: Box, q: FloatArray, dim: int) -> FloatArray:
        return box.change(self.index, self.vector)

    def unfit(self, case: Case, box: Box, dim: int) -> Iterator[str]:
        name, across = ("dz", 2) if box.system.kind == "CARTESIAN" else ("dθ", 1)
        if dim == 2 and (shift := self.vector[across]):
            yield f"{name} is {shift:g}, which leaves the plane; in 2D write 0"


class _Column(BoxMotion):
    """A motion of a column of control points of a box; ``index`` (i, j), -1 takes all."""

    index: tuple[int, int]
    amount: float
    what: str

    rows = ("index", "box", "amount")
    proportional = ("amount",)

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        items = without_brackets(words)
        _require_words(
            items,
            (3, 4),
            "the column of control points i, j (-1 is all of a direction) and the amount: "
            f"{verb}, BOX, 2, 1, 0.01; in 2D {verb}, BOX, 2, 0.01",
        )
        i, j = (*_integers(items[1:-1]), -1)[:2]
        amount = number(items[-1].text)
        return cls(marker, items[0].text, (i, j), amount)  # type: ignore[call-arg]

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        index = (0, _last_index(start))
        return cls(marker, _first_box(start), index, 0.0)  # type: ignore[call-arg]

    def arguments(self) -> list[str]:
        return [name_text(self.box), *map(str, self.index), *number_texts(self.amount)]

    def label(self, form: str, *, exact: bool) -> str:
        return f"{self.what} {self.control_words()} {self.amount:+{form}}"

    @property
    def place_in_box(self) -> WholeNumbers:
        return self.index

    def lattice_index(self, dim: int) -> Index:
        i, j = self.index
        return i, (j if dim == 3 else -1), -1

    def control_change(self, box: Box, q: FloatArray, dim: int) -> FloatArray:
        shift = [0.0, 0.0, 0.0]
        shift[_across(dim)] = self.amount
        return box.change(self.lattice_index(dim), (shift[0], shift[1], shift[2]))

    def unfit(self, case: Case, box: Box, dim: int) -> Iterator[str]:
        if dim == 2 and case.ffd_system != "CARTESIAN":
            yield f"in 2D it needs FFD_COORD_SYSTEM= CARTESIAN, which is {case.ffd_system}"


@frozen
class FfdCamber(_Column):
    """Shift a column of control points of a box as one, and with it the nodes inside.

    ``index`` (i, j) is the column, which goes along z; in 2D that of i, along y. -1 takes all.
    """

    marker: Target
    box: str
    index: tuple[int, int]
    amount: float

    kind_term = Term("camber by box")
    verbs = ("ffd-camber",)
    grammar = (
        "(BLADE, ffd-camber, BOX, i, j, dz)            a column of control points; 2D: no j",
    )
    what = "camber"


@frozen
class FfdThickness(_Column):
    """Stretch a column of control points of a box, and with it the nodes inside.

    Its first control point goes by -``amount``, its last one by ``amount``. ``index`` as in
    `FfdCamber`.
    """

    marker: Target
    box: str
    index: tuple[int, int]
    amount: float

    kind_term = Term("thickness by box")
    verbs = ("ffd-thickness",)
    grammar = (
        "(BLADE, ffd-thickness, BOX, i, j, dz)         its first one by -dz, its last by dz",
    )
    what = "thickness"

    def control_change(self, box: Box, q: FloatArray, dim: int) -> FloatArray:
        across = _across(dim)
        sides = np.linspace(-1.0, 1.0, box.points.shape[across])  # from lowest to highest layer
        others = [axis for axis in range(4) if axis != across]
        return super().control_change(box, q, dim) * np.expand_dims(sides, others)


@frozen
class FfdTwist(BoxMotion):
    """Rotate a plane j of control points of a box in 3D, and with it the nodes inside.

    It turns by ``angle_deg`` about the axis through ``point`` (right-handed; any length). A
    ``plane`` of -1 takes all.
    """

    marker: Target
    box: str
    plane: int
    angle_deg: float
    point: Numbers = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 1.0, 0.0)

    kind_term = Term("twist by box")
    verbs = ("ffd-twist",)
    grammar = (
        "(BLADE, ffd-twist, BOX, j, degrees, AXIS, (px, py, pz))  a plane of control points",
    )
    rows = ("plane", "box", "angle", "point", "axis")
    proportional = ("angle_deg",)
    words = (("degrees", "angle_deg"),)
    only_3d = True

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        items = without_brackets(words)
        n_axis = axis_length(items, 3, 0)
        _require_words(
            items,
            (6 + n_axis,),
            "the plane j of control points (-1 is all), the angle in degrees, the axis (x, y, z or "
            "three numbers) and a point on it: ffd-twist, BOX, 2, 5.0, y, 0.25, 0, 0",
        )
        (plane,) = _integers(items[1:2])
        axis = read_axis(items[3 : 3 + n_axis])
        point = read_vector(items[3 + n_axis :], "the point")
        return cls(marker, items[0].text, plane, angle_deg(items[2].text), point, axis)

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(marker, _first_box(start), 0, 0.0)

    def arguments(self) -> list[str]:
        turn = [*number_texts(self.angle_deg), axis_text(self.axis), vector_text(self.point)]
        return [name_text(self.box), str(self.plane), *turn]

    def described(self, dim: int, extent: float) -> str:
        through = place_words(self.point, extent)
        words = self.label(".4g", exact=False)
        return f"{words} about {direction_words(self.axis)} through {through}"

    def label(self, form: str, *, exact: bool) -> str:
        planes = "all planes" if self.plane < 0 else f"plane {self.plane}"
        return f"twist {planes} of {self.box_words} {self.angle_deg:+{form}}°"

    @property
    def place_in_box(self) -> WholeNumbers:
        return (self.plane,)

    def lattice_index(self, dim: int) -> Index:
        return -1, self.plane, -1

    def control_change(self, box: Box, q: FloatArray, dim: int) -> FloatArray:
        chosen = box.change(self.lattice_index(dim), (1.0, 1.0, 1.0))[..., 0] > 0.0
        point = (*self.point, 0.0)[:3]
        turn = Turn(chosen, np.array(point), np.array(self.axis), math.pi / 180.0)
        return turn.change(q, self.angle_deg)

    def unfit(self, case: Case, box: Box, dim: int) -> Iterator[str]:
        if dim == 2:
            yield "a box in 2D has no span to twist along; write rotate"
        if case.ffd_system != "CARTESIAN":
            yield (
                f"ffd-twist turns control points in x, y and z, and FFD_COORD_SYSTEM is "
                f"{case.ffd_system}; move them along θ with ffd"
            )


def _require_words(items: Words, counts: WholeNumbers, after_box: str) -> None:
    """Raise CaseError where the name of a box and what follows it are not in one of the counts."""
    if len(items) not in counts or not items[0].text:
        raise CaseError(f"expected the box, {after_box}")


def _across(dim: int) -> int:
    """Return the direction of a column of control points."""
    return 2 if dim == 3 else 1


def _first_box(start: MotionStart) -> str:
    return start.boxes[0] if start.boxes else ""


def _last_index(start: MotionStart) -> int:
    return 0 if start.dim == 3 else -1


def _integers(words: Words) -> list[int]:
    values = [number(word.text) for word in words]
    if any(value != int(value) or value < -1 for value in values):
        text = ", ".join(word.text for word in words)
        raise CaseError(f"invalid control point ({text}); write integers from 0, or -1 for all")
    return [int(value) for value in values]


def box_motions(case: Case) -> tuple[BoxMotion, ...]:
    """Return the motions of a case that move control points of boxes."""
    return tuple(motion for motion in case.motions if isinstance(motion, BoxMotion))


def box_changes(
    case: Case, mesh: Mesh, boxes: Mapping[str, Box]
) -> dict[str, list[tuple[int, FloatArray, FloatArray]]]:
    """Return how motions change control points, for each box that some move, in their order.

    Place of the motion, the control points (I, J, K, 3) before it, in the box's coordinates, and
    their change by it. Motions that do not fit their box change nothing.
    """
    changes: dict[str, list[tuple[int, FloatArray, FloatArray]]] = {}
    for place, motion in enumerate(case.motions):
        if not isinstance(motion, BoxMotion) or motion.box not in boxes:
            continue
        box = boxes[motion.box]
        if box.problem(motion.lattice_index(mesh.dim)):
            continue
        mine = changes.setdefault(motion.box, [])
        q = mine[-1][1] + mine[-1][2] if mine else box.q
        mine.append((place, q, motion.control_change(box, q, mesh.dim)))
    return changes


def _moved(
    box: Box, mesh: Mesh, q: FloatArray, change: FloatArray, on: NodesOn
) -> Displacements | None:
    """Return the displacements that a change of control points gives all nodes of some markers.

    None where no node is in the box. ``q`` (I, J, K, 3) are the control points before, ``on`` has
    the nodes (k,) of each marker.
    """
    nodes = mesh.nodes_of(on)
    vectors = np.zeros((len(nodes), mesh.dim))
    warnings = []
    any_inside = False
    for name in on:
        inside, _ = embedding(mesh, box, name)
        any_inside |= bool(len(inside.nodes))
        shift = inside.sums(change)
        if box.system.kind != "CARTESIAN":
            before = inside.sums(q)
            shift = box.system.points_of(before + shift) - box.system.points_of(before)
        vectors[np.searchsorted(nodes, inside.nodes)] = shift[:, : mesh.dim]
        warnings += off_points(box, mesh, name)
    return Displacements(nodes, vectors, tuple(warnings)) if any_inside else None


def moved_boxes(case: Case, mesh: Mesh, part: float = 1.0) -> Mesh:
    """Return the mesh with its boxes deformed by the motions of the case times ``part``, 0 to 1.

    Where the case has motions of other kinds too, or boxes are nested, they are left as they are:
    no control points could follow these.
    """
    motions = box_motions(case)
    if not motions or len(motions) < len(case.motions):
        return mesh
    boxes = {box.name: box for box in boxes_of(mesh, system_of(case))}
    if any(box.level for box in boxes.values()):
        return mesh
    moved = []
    for name, changes in box_changes(case, mesh, boxes).items():
        total = np.sum([change for _, _, change in changes], axis=0)
        moved.append(boxes[name].moved(part * total))
    return with_boxes(mesh, moved) if moved else mesh
