"""FFD boxes of a configuration: their control points move by design variables, and nodes inside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from slideviz.case.boxes import (
    boxes_for,
    defined_boxes,
    embedding,
    missing_box,
    off_points,
    system_of,
)
from slideviz.case.ffd_keys import ffd_contradictions
from slideviz.design.su2.config import CONTINUITIES, SU2_CONTINUITY, Su2Config
from slideviz.design.su2.on_mesh import problems_of_markers
from slideviz.design.su2.shapes import Displacer
from slideviz.design.su2.variables import DesignVariable, angle_notes, places_words
from slideviz.errors import CaseError, Message, raise_all
from slideviz.ffd.box import Box, Embedding
from slideviz.ffd.deformation import BoxDeformation, DrivenMove, Limits
from slideviz.ffd.kinds import DIRECTIONS, NONE, Move, Planes, Request, moves_of, variable_problem
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.model import FloatArray, IntArray, Mesh


def held_planes(config: Su2Config, mesh: Mesh, box: Box, continuity: str) -> Planes:
    """Return the planes of control points that FFD_CONTINUITY= ``continuity`` holds, by axis."""
    depth = CONTINUITIES[continuity]
    if not depth:
        i, j, k = (
            _planes(box, axis) & config.values[f"FFD_FIX_{'IJK'[axis]}"] for axis in range(3)
        )
        return i, j, k
    ends = _edges(mesh, config.markers, box)
    symmetric = config.values["FFD_SYMMETRY_PLANE"] and mesh.dim == 3
    cartesian = box.system.kind == "CARTESIAN"
    held = []
    for axis, degree in enumerate(box.degrees):
        planes: set[int] = set()
        flat = mesh.dim == 2 and axis == 2
        if not flat and (depth < CONTINUITIES["2ND_DERIVATIVE"] or degree > 1):
            for first, inwards in ((0, 1), (degree, -1)):
                if symmetric and axis == 1 and (first == 0 or cartesian):
                    continue
                side = np.take(box.q, first, axis=axis)
                corners = side[[0, 0, -1, -1], [0, -1, 0, -1]]
                if _meets(ends, corners, mesh.dim):
                    planes |= {first + inwards * k for k in range(depth)}
        held.append(frozenset(planes) & _planes(box, axis))
    return held[0], held[1], held[2]


def _planes(box: Box, axis: int) -> frozenset[int]:
    return frozenset(range(box.degrees[axis] + 1))


def _edges(mesh: Mesh, markers: tuple[str, ...], box: Box) -> FloatArray:
    """Return the ends (e, 2, 3) of all edges of the markers' facets, in the box's coordinates."""
    pairs = []
    for name in markers:
        for _, nodes in mesh.marker(name).cells.by_type.values():
            first, second = np.triu_indices(nodes.shape[1], 1)
            pairs.append(np.stack([nodes[:, first].ravel(), nodes[:, second].ravel()], axis=1))
    every = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    points = np.zeros((*every.shape, 3))
    points[..., : mesh.dim] = mesh.points[every]
    return box.system.q_of(points)


def _meets(ends: FloatArray, corners: FloatArray, dim: int) -> bool:
    """Return whether any segment (e, 2, 3) meets the side of a box with ``corners`` (4, 3).

    In 3D the side is two triangles; in 2D it is a line, which SU2 continues beyond the box.
    """
    if dim == 2:
        return _crossed(ends[..., :2], corners[0, :2], corners[2, :2])
    return _pierced(ends, corners[[0, 1, 2]]) or _pierced(ends, corners[[3, 2, 1]])


def _crossed(ends: FloatArray, first: FloatArray, second: FloatArray) -> bool:
    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    start = ends[:, 0]
    end = ends[:, 1]
    across = side(first, second, start) * side(first, second, end) <= 0.0
    # Segments on the line itself do not cross it.
    apart = (side(first, second, start) == 0.0) & (side(first, second, end) == 0.0)
    return bool((across & ~apart).any())


def _pierced(ends: FloatArray, triangle: FloatArray) -> bool:
    u = triangle[1] - triangle[0]
    v = triangle[2] - triangle[0]
    normal = np.cross(u, v)
    start = ends[:, 0] - triangle[0]
    along = ends[:, 1] - ends[:, 0]
    height = start @ normal
    rise = along @ normal
    # Whether it gets to the plane of the triangle; one within the plane pierces nothing.
    reaches = (np.abs(height) <= np.abs(rise)) & (height * rise <= 0.0) & (rise != 0.0)
    hits = start[reaches] - (height[reaches] / rise[reaches])[:, None] * along[reaches]
    area = float(normal @ normal)
    a = np.cross(hits, v) @ normal / area
    b = np.cross(u, hits) @ normal / area
    return bool(((a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)).any())


def request_of(config: Su2Config, variable: DesignVariable) -> Request:
    """Return what a variable asks of its box."""
    count = len(DIRECTIONS[variable.kind])
    index = tuple(int(number) for number in variable.numbers[:count])
    return Request(variable.kind, index, variable.numbers[count:], config.values["REF_LENGTH"])


def reach(move: Move) -> int:
    """Return how many control points a move moves."""
    return int(np.count_nonzero(move.chosen))


def held_by_continuity(
    config: Su2Config, mesh: Mesh, boxes: dict[str, Box]
) -> tuple[dict[str, Planes], list[str]]:
    """Return the planes of each box that are held, and warnings about what they do.

    What is held in one zone is held in all, so that boundaries which they share stay together. None
    are where no zone has FFD_CONTINUITY, but a warning says which ones SU2 would hold.
    """
    every = {}
    warnings = []
    for name, box in boxes.items():
        zones = [config, *(zone for zone in config.beside if name in _boxes_moved(zone))]
        asking = [zone for zone in zones if zone.values["FFD_CONTINUITY"]]
        held = _held_in(asking or zones, mesh, box)
        every[name] = held if asking else NONE
        stuck = []
        partly = []
        for place, variable in enumerate(config.variables, 1):
            if variable.box != name:
                continue
            request = request_of(config, variable)
            free = sum(map(reach, moves_of(box, request, NONE)))
            left = sum(map(reach, moves_of(box, request, held)))
            if left == 0 < free:
                stuck.append(place)
            elif left < free:
                partly.append(place)
        effects = [(stuck, "do nothing"), (partly, "leave the control points there")]
        if asking:
            asked = asking[0].values["FFD_CONTINUITY"]
            note = f"FFD_CONTINUITY= {asked} holds {_words(held)} of the box {name}: "
            warnings += [
                f"{note}{places_words(places)} will {effect}"
                for places, effect in effects
                if places
            ]
        elif stuck or partly:
            done = " and ".join(
                f"{places_words(places)} would {effect}" for places, effect in effects if places
            )
            warnings.append(
                f"SU2 would hold {_words(held)} of the box {name}, since the surface leaves it "
                f"there, by its default FFD_CONTINUITY= {SU2_CONTINUITY}, so that {done}; here "
                "they move. Write that key to hold them, or FFD_CONTINUITY= USER_INPUT to hold "
                "what FFD_FIX_I, FFD_FIX_J, FFD_FIX_K name"
            )
    return every, warnings


def _boxes_moved(config: Su2Config) -> set[str]:
    return {variable.box for variable in config.variables}


def _held_in(zones: list[Su2Config], mesh: Mesh, box: Box) -> Planes:
    """Return the planes of a box that any zone holds, by axis."""
    held_by_zone = [
        held_planes(zone, mesh, box, zone.values["FFD_CONTINUITY"] or SU2_CONTINUITY)
        for zone in zones
    ]
    i, j, k = zip(*held_by_zone, strict=True)
    return frozenset().union(*i), frozenset().union(*j), frozenset().union(*k)


def _words(held: Planes) -> str:
    return ", ".join(
        f"{letter} = {', '.join(map(str, sorted(planes)))}"
        for letter, planes in zip("ijk", held, strict=True)
        if planes
    )


@dataclass(frozen=True, eq=False)
class MovedBoxes(Displacer):
    """FFD boxes that a design deforms."""

    boxes: tuple[Box, ...]
    """Those in which variables move nodes or that others carry, in the order of the file."""
    embedded: dict[str, Embedding]  # the nodes in each box, by their place in ``nodes``
    held: dict[str, Planes]  # planes of control points of each box that do not move
    remarks: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what was found when nodes were looked for, and the design applied."""
        return self.remarks

    @property
    def inside(self) -> dict[str, int]:
        """Return how many nodes are in each box that variables move."""
        names = dict.fromkeys(variable.box for variable in self.config.variables)
        return {name: len(self.embedded[name].nodes) for name in names}

    @cached_property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect: none of its points may move."""
        places = range(len(self.config.variables))
        return tuple(not any(map(reach, self._moves(place))) for place in places)

    @property
    def _places(self) -> list[tuple[int, int]]:
        """Variable and number of the value, from 0, of each value."""
        variables = enumerate(self.config.variables)
        return [
            (place, part) for place, variable in variables for part in range(len(variable.values))
        ]

    def _moves(self, place: int) -> tuple[Move, ...]:
        variable = self.config.variables[place]
        box = next(box for box in self.boxes if box.name == variable.box)
        return moves_of(box, request_of(self.config, variable), self.held[box.name])

    @cached_property
    def at_design(self) -> BoxDeformation:
        """Return the deformation by this design."""
        values = [value for variable in self.config.variables for value in variable.values]
        return self._deformed(np.array(values), limits_of(self.config))

    @cached_property
    def _at_rest(self) -> BoxDeformation:
        """The deformation by the design that moves nothing."""
        return self._deformed(np.zeros(len(self._places)), Limits())

    def _deformed(self, values: FloatArray, limits: Limits) -> BoxDeformation:
        drives = []
        for value, (place, part) in enumerate(self._places):
            variable = self.config.variables[place]
            is_single = len(variable.values) == 1
            mine = self._moves(place)[part : part + 1]
            drives += [DrivenMove(variable.box, move, value, is_single) for move in mine]
        return BoxDeformation(
            self.boxes,
            self.embedded,
            drives,
            values,
            self.config.relaxation,
            len(self.nodes),
            limits,
        )

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes by all variables."""
        return self.at_design.nodes[:, : self.mesh.dim]

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to a value."""
        where = self._at_rest if undeformed else self.at_design
        return where.slope(self._places.index((place, part)))[:, : self.mesh.dim]

    def moved_boxes(self) -> dict[str, tuple[Box, bool]]:
        """Return the boxes after the design, and whether their nodes are placed anew."""
        moved = self.at_design.moved()
        renewed = self.at_design.uvw()
        for name, (places, uvw) in renewed.items():
            moved[name] = replace(moved[name], embedded=self._listed(moved[name], places, uvw))
        return {name: (box, name in renewed) for name, box in moved.items()}

    def _listed(
        self, box: Box, places: IntArray, uvw: FloatArray
    ) -> dict[str, tuple[IntArray, FloatArray]]:
        """Return the surface points of a box with new parametric coordinates (k, 3) of nodes."""
        nodes = self.nodes[places]
        surfaces = {}
        for marker, (listed, before) in box.embedded.items():
            rows = np.minimum(np.searchsorted(nodes, listed), len(nodes) - 1)
            moves = (nodes[rows] == listed) & (marker in self.config.markers)
            surfaces[marker] = listed, np.where(moves[:, None], uvw[rows], before)
        return surfaces


def limits_of(config: Su2Config) -> Limits:
    """Return what keeps boxes from being deformed too much."""
    values = config.values
    iterations = values["FFD_INTPREV_ITER"] if values["FFD_INTPREV"] else 0
    return Limits(values["OPT_LINE_SEARCH_BOUND"], iterations, values["FFD_INTPREV_DEPTH"])


def move_boxes(config: Su2Config, mesh: Mesh, nodes: IntArray) -> MovedBoxes:
    """Return the boxes that the variables deform, with the nodes (m,) inside; or CaseError."""
    known = boxes_for(config.case, mesh)
    names = _boxes_moved(config)
    nested = {name for box in known.values() if box.parent for name in (box.name, box.parent)}
    order = [box.name for box in boxes_of(mesh, system_of(config.case))]
    boxes = []
    inside = {}
    warnings = []
    for name in (*order, *(name for name in known if name not in order)):
        # As in SU2, a box without variables takes the nodes that the file lists for it, too.
        if name not in names | nested and not known[name].embedded.keys() & {*config.markers}:
            continue
        on, stay = _embeddings(known[name], mesh, config.markers)
        warnings += stay
        box, inside[name] = _embedded(known[name], on, nodes)
        boxes.append(box)
        if name in names and not len(inside[name].nodes):
            raise CaseError(
                f"{config.source}: no node of {', '.join(config.markers)} is in the FFD box "
                f"{name!r}; correct the box or DV_MARKER"
            )
        if name in names:
            warnings += [
                text for marker in config.markers for text in off_points(box, mesh, marker)
            ]
    held, stuck = held_by_continuity(config, mesh, {box.name: box for box in boxes})
    moved = MovedBoxes(config, mesh, nodes, tuple(boxes), inside, held)
    try:
        notes = moved.at_design.notes
    except CaseError as problem:
        raise CaseError(f"{config.source}: {problem}") from problem
    notes = [*notes, *_without_effect(moved), *angle_notes(config.variables, config.relaxation)]
    return replace(moved, remarks=(*warnings, *stuck, *notes))


def _without_effect(moved_boxes: MovedBoxes) -> list[str]:
    """Return sentences about variables that move nothing in SU2 either."""
    reasons: dict[str, list[int]] = {}
    missed = {moved_boxes._places[value][0] for value in moved_boxes.at_design.missed}
    for place, variable in enumerate(moved_boxes.config.variables):
        box = next(box for box in moved_boxes.boxes if box.name == variable.box)
        request = request_of(moved_boxes.config, variable)
        if place in missed:
            why = "its segment does not meet its plane of control points"
        elif any(map(reach, moves_of(box, request))) or variable.kind == "FFD_ANGLE_OF_ATTACK":
            continue
        elif variable.kind == "FFD_CONTROL_SURFACE":
            why = "the box has no control points with i two before the last one, and j two inside"
        else:
            why = "three indices of -1 move nothing"
        reasons.setdefault(f"{variable.kind}: {why}", []).append(place + 1)
    return [
        f"as in SU2, {places_words(places)} will have no effect; {why}"
        for why, places in reasons.items()
    ]


def set_boxes(config: Su2Config, mesh: Mesh) -> tuple[Mesh, tuple[Box, ...]]:
    """Return the mesh with the boxes that a configuration defines, and the boxes (FFD_SETTING).

    Raises CaseError if the configuration defines no box, a box is not possible, or no node is in
    any.
    """
    contradictions = (f"{config.source}: {text}" for text in ffd_contradictions(config.case))
    raise_all((*problems_of_markers(config, mesh), *contradictions))
    boxes = []
    for box in defined_boxes(config.case, mesh).values():
        on = {name: embedding(mesh, box, name)[0] for name in config.markers}
        listed = {
            name: (inside.nodes, inside.uvw) for name, inside in on.items() if len(inside.nodes)
        }
        boxes.append(replace(box, embedded=listed))
    if not boxes:
        raise CaseError(f"{config.source}: FFD_SETTING needs FFD_DEFINITION, which has no box")
    if not any(box.embedded for box in boxes):
        raise CaseError(
            f"{config.source}: no node of {', '.join(config.markers)} is in the FFD box "
            f"{', '.join(repr(box.name) for box in boxes)}; correct the box or DV_MARKER"
        )
    return with_boxes(mesh, boxes, anew=True), tuple(boxes)


def problems_of_boxes(config: Su2Config, mesh: Mesh) -> list[str | Message]:
    """Return which variables move what is not there."""
    try:
        known = boxes_for(config.case, mesh)
    except CaseError as problem:
        return [*problem.messages]
    problems = []
    for place, variable in enumerate(config.variables, start=1):
        if variable.box not in known:
            sentence = missing_box(mesh, variable.box, known, "define it with FFD_DEFINITION")
            problems.append(f"variable {place}: {sentence}")
            continue
        box = known[variable.box]
        request = request_of(config, variable)
        if wrong := variable_problem(box, request, mesh.dim, variable.values):
            problems.append(f"variable {place}: {wrong}")
        if box.level and config.case.ffd_system != "CARTESIAN":
            sentence = (
                f"the FFD box {box.name!r} is nested, which needs FFD_COORD_SYSTEM= CARTESIAN"
            )
            problems.append(f"variable {place}: {sentence}")
    return [f"{config.source}: {text}" for text in problems]


def _embeddings(
    box: Box, mesh: Mesh, markers: tuple[str, ...]
) -> tuple[dict[str, tuple[Embedding, float]], list[str]]:
    """Return the nodes of each marker in a box (`embedding`), and warnings.

    As in SU2, nodes inside stay where the box lists nodes of other boundaries only.
    """
    on = {marker: embedding(mesh, box, marker) for marker in markers}
    listed = [marker for marker in markers if marker in box.embedded]
    if not box.embedded:
        return on, []
    known = np.concatenate([np.empty(0, np.int64), *(on[marker][0].nodes for marker in listed)])
    warnings = []
    for marker in (name for name in markers if name not in listed):
        stay = np.setdiff1d(on[marker][0].nodes, known)
        if len(stay):
            warnings.append(
                f"{len(stay)} nodes of {marker} are inside the FFD box {box.name!r}, which lists "
                "none of that boundary: as in SU2, they stay; define the box again to move them"
            )
        on[marker] = box.embed(stay[:0], np.empty((0, 3))), 0.0
    return on, warnings


def _embedded(
    box: Box, on: dict[str, tuple[Embedding, float]], nodes: IntArray
) -> tuple[Box, Embedding]:
    """Return the box with its nodes on each marker listed, and the nodes inside, by their place."""
    listed = {name: (found.nodes, found.uvw) for name, (found, _) in on.items() if len(found.nodes)}
    every = np.concatenate([found.nodes for found, _ in on.values()])
    uvw = np.concatenate([found.uvw for found, _ in on.values()])
    one, first = np.unique(every, return_index=True)
    inside = box.embed(np.searchsorted(nodes, one), uvw[first])
    return (box if box.embedded else replace(box, embedded=listed)), inside
