"""Displacement of the moving boundaries by design variables, and its exact derivatives.

Variables move the boundary by a formula of its undeformed points, or the control points of FFD
boxes, and the nodes inside.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cached_property
from itertools import pairwise, starmap
from pathlib import Path
from typing import TypeVar

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.displacement import Columns, in_zones, parse_rows
from slideviz.case.keys import ffd_contradictions
from slideviz.case.lines import read_text
from slideviz.case.model import Case
from slideviz.case.motions.airfoil import (
    Cst,
    HicksHenne,
    OneSided,
    hicks_henne,
    kulfan,
    normals_at,
    require_peak,
    side_of,
    surface_bump,
    term_of,
)
from slideviz.case.motions.box import (
    boxes_for,
    defined_boxes,
    embedding,
    missing_box,
    off_points,
    system_of,
)
from slideviz.case.motions.file import Prescribed
from slideviz.case.zone_cases import each_zone
from slideviz.design.su2.config import (
    CONTINUITIES,
    SU2_CONTINUITY,
    WITHOUT_VALUE,
    DesignVariable,
    Group,
    Su2Config,
    angle_notes,
    joined,
    places_words,
    problems_of_markers,
    zone_of,
)
from slideviz.errors import (
    CaseError,
    DeformError,
    Doubt,
    Message,
    Remark,
    SlidevizError,
    note,
    raise_all,
)
from slideviz.ffd.box import Box, Embedding
from slideviz.ffd.deformation import BoxDeformation, DrivenMove, Limits
from slideviz.ffd.kinds import (
    DIRECTIONS,
    NONE,
    Move,
    Moves,
    Planes,
    Request,
    Turn,
    moves_of,
    variable_problem,
)
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.interfaces import torn_interfaces
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh, places_in, row_norms
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import padded
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from slideviz.solver.steps import Step
from slideviz.system.grouping import grouped
from slideviz.terms import Side

UNIT_CHORD = ("HICKS_HENNE", "CST", "NACA_4DIGITS", "PARABOLIC")
"""Kinds for which the airfoil lies between x = 0 and 1."""
OFF_CHORD = 0.05  # how far its ends may be from there without a warning


@record
class Displacer:
    """Displaces the moving nodes by the design variables of one group; without a group none."""

    config: Su2Config
    mesh: Mesh
    nodes: IntArray

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect."""
        return (False,) * len(self.config.variables)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Return sentences for the user."""
        return ()

    @property
    def inside(self) -> dict[str, int]:
        """Return how many moving nodes are in each FFD box that moves some."""
        return {}

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the moving nodes by all variables."""
        return np.zeros((len(self.nodes), self.mesh.dim))

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to a value; see `MovingSurface.slope`."""
        del place, part, undeformed
        return np.zeros((len(self.nodes), self.mesh.dim))

    def moved_boxes(self) -> dict[str, tuple[Box, bool]]:
        """Return the FFD boxes that the design moves, and whether their nodes are placed anew."""
        return {}


@record
class MovedNodes:
    """Moving nodes of a mesh: what the formulas depend on."""

    mesh: Mesh
    markers: tuple[str, ...]
    nodes: IntArray

    @cached_property
    def points(self) -> FloatArray:
        """Return the points (m, d) of the nodes."""
        return self.mesh.points[self.nodes]

    @cached_property
    def normals(self) -> FloatArray:
        """Return the normals (m, d) into the mesh; those of SU2's median-dual mesh."""
        return normals_at(self.mesh, self.markers, self.nodes)

    @cached_property
    def side(self) -> FloatArray:
        """Return 1 for nodes (m,) of the upper side, -1 for those of the lower one; 0 between."""
        return side_of(self.normals)

    def along_y(self, shift: FloatArray) -> FloatArray:
        """Return displacements (m, d) of the nodes by ``shift`` (m,) along y."""
        out = np.zeros_like(self.points)
        out[:, 1] = shift
        return out

    @cached_property
    def chord(self) -> tuple[FloatArray, float]:
        """Return leading edge (2,), and angle of attack in radians, as SU2 finds them for camber.

        The trailing edge is between the first node of the last marker and its last one with
        x > 0, or the first if its normal is nearer to x; the leading edge is farthest from it.
        """
        mesh = self.mesh
        markers = [name for name in self.mesh.marker_names if name in self.markers]
        listed = mesh.marker(markers[-1]).cells.connectivity
        order = listed[np.sort(np.unique(listed, return_index=True)[1])]
        first = mesh.points[order[0], :2]
        nx, ny = np.abs(self.normals[np.searchsorted(self.nodes, order[0]), :2])
        positive = order[mesh.points[order, 0] > 0.0]
        other = mesh.points[positive[-1], :2] if ny > nx and len(positive) else first
        trailing = 0.5 * (first + other)
        apart = row_norms(self.points[:, :2] - trailing)
        leading = self.points[int(np.argmax(apart)), :2]
        width = trailing[0] - leading[0]
        if width == 0.0:
            raise CaseError("HICKS_HENNE_CAMBER: the chord of DV_MARKER is along y; turn the mesh")
        return leading, float(np.arctan((leading[1] - trailing[1]) / width))

    def chord_doubts(self, variables: Sequence[DesignVariable], relaxation: float) -> list[Doubt]:
        """Return a doubt where the chord is not that which some variables expect."""
        x = self.points[:, 0]
        notes = []
        kinds = {each.kind for each in variables}
        unit = [kind for kind in UNIT_CHORD if kind in kinds]
        if unit and max(abs(x.min()), abs(x.max() - 1.0)) > OFF_CHORD:
            motions = [_as_motion(each, self.markers, relaxation) for each in variables]
            texts = [motion.on_chord(x).text for motion in motions if motion is not None]
            remedy = f"scale the mesh to that, by 1 / {np.ptp(x):.4g}"
            if texts:
                remedy += f", or write MOTION= {' ; '.join(texts)} into a case file (slideviz run)"
            notes.append(
                Doubt(
                    f"{', '.join(unit)}: the chord is x from 0 to 1, as in SU2, and DV_MARKER goes "
                    f"from {x.min():.4g} to {x.max():.4g}",
                    remedy,
                )
            )
        if "HICKS_HENNE_CAMBER" in kinds:
            leading, angle = self.chord
            length = (x.max() - leading[0]) / max(np.cos(angle), OFF_CHORD)
            if abs(length - 1.0) > OFF_CHORD or leading[0] - x.min() > OFF_CHORD:
                at = ", ".join(f"{value:.4g}" for value in leading)
                notes.append(
                    Doubt(
                        "HICKS_HENNE_CAMBER: the chord is 1 long from the leading edge, as in SU2, "
                        f"which takes ({at}) for it, and DV_MARKER goes from {x.min():.4g} to "
                        f"{x.max():.4g} in x; it begins its search at the first node of the marker",
                        "scale the mesh to that, or begin the marker at the trailing edge",
                    )
                )
        return notes


def _as_motion(
    variable: DesignVariable, markers: tuple[str, ...], relaxation: float
) -> OneSided | None:
    """Return a variable as a motion of a case, whose chord is free; None if there is none."""
    on = markers[0] if len(markers) == 1 else markers
    height = variable.value * relaxation
    side: Side = "upper" if variable.parameter("side") else "lower"
    if variable.kind == "HICKS_HENNE":
        return HicksHenne(on, height, variable.parameter("x"), side)
    if variable.kind == "CST":
        term = term_of(variable.parameter("k"), variable.parameter("n"))
        return Cst(on, height, term, side)
    return None


@frozen
class Formula:
    """Displacement by a variable, as a formula of its value times OPT_RELAX_FACTOR."""

    moved: Callable[[DesignVariable, MovedNodes, float], FloatArray]
    """Displacement (m, d) of the nodes by an amount."""
    rate: Callable[[DesignVariable, MovedNodes, float], FloatArray] | None = None
    """Its derivative with respect to the amount; None: that of 1, since it is linear."""
    relaxed: bool = True  # whether OPT_RELAX_FACTOR multiplies its value


def _shifted(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    vector = np.array(variable.numbers[: on.mesh.dim])
    return np.broadcast_to(amount * vector, on.points.shape)


def _shifted_mesh(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    vector = np.array(variable.numbers[: on.mesh.dim])
    length = np.linalg.norm(vector)
    if length == 0.0:
        raise CaseError("its direction has no length; give e.g. (1, 0, 0)")
    return np.broadcast_to(amount * (vector / length), on.points.shape)


def _resized(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del variable
    return (amount - 1.0) * on.points


def _scaling(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del variable, amount
    return on.points


def _rotated(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    return _turn(variable, on).change(padded(on.points), amount)[:, : on.mesh.dim]


def _rotating(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    return _turn(variable, on).slope(padded(on.points), amount)[:, : on.mesh.dim]


def _hicks_henne(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    side, peak = variable.numbers
    require_peak(peak)
    outwards = np.maximum(on.side, 0.0) if side else np.minimum(on.side, 0.0)
    return on.along_y(amount * outwards * hicks_henne(on.points[:, 0], peak))


def _cst(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    side, k, n = variable.numbers
    there = on.side > 0.0 if side else on.side < 0.0
    return on.along_y(amount * there * kulfan(on.points[:, 0], k, n))


def _bumped(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    return on.along_y(amount * surface_bump(on.points[:, 0], *variable.numbers))


def _cambered(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    (peak,) = variable.numbers
    require_peak(peak)
    leading, angle = on.chord
    arm = on.points[:, :2] - leading
    x = arm[:, 0] * np.cos(angle) - arm[:, 1] * np.sin(angle)
    shift = np.where(x > 0.99, 0.0, amount * hicks_henne(x, peak))
    out = np.zeros_like(on.points)
    out[:, :2] = shift[:, None] * np.array([np.sin(angle), np.cos(angle)])
    return out


def _naca(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del amount  # SU2 uses the digits only
    most, where, thickness = np.array(variable.numbers) / (100.0, 10.0, 100.0)
    if not 0.0 < where < 1.0 and most:
        raise CaseError(
            f"the second digit is {variable.numbers[1]:g}; the largest camber must "
            "lie between 0 and 10 tenths of the chord"
        )
    x = on.points[:, 0]
    camber = np.zeros_like(x)
    if most:
        front = most / where**2 * (2.0 * where * x - x**2)
        back = most / (1.0 - where) ** 2 * (1.0 - 2.0 * where + 2.0 * where * x - x**2)
        camber = np.where(x < where, front, back)
    root = np.sqrt(np.maximum(x, 0.0))  # SU2 has no number where x is below 0
    polynomial = 1.4845 * root - 0.63 * x - 1.758 * x**2 + 1.4215 * x**3 - 0.518 * x**4
    return _put(on, camber + on.side * thickness * polynomial)


def _parabolic(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del amount  # SU2 uses the parameters only
    centre, thickness = variable.numbers
    if centre in (0.0, 1.0):
        raise CaseError(f"the centre is {centre:g}; it must not be 0 or 1")
    x = on.points[:, 0]
    half = 0.01 * thickness * (x**2 - x) / (2.0 * (centre**2 - centre))
    return _put(on, on.side * half)


def _put(on: MovedNodes, y: FloatArray) -> FloatArray:
    """Return displacements (m, d) that put the nodes of both sides onto y (m,)."""
    return on.along_y(np.where(on.side == 0.0, 0.0, y - on.points[:, 1]))


def _still(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del variable, amount
    return np.zeros_like(on.points)


FORMULAS = {
    "TRANSLATION": Formula(_shifted),
    "ROTATION": Formula(_rotated, _rotating),
    "SCALE": Formula(_resized, _scaling),
    "HICKS_HENNE": Formula(_hicks_henne),
    "CST": Formula(_cst),
    "SURFACE_BUMP": Formula(_bumped),
    "HICKS_HENNE_CAMBER": Formula(_cambered, relaxed=False),
    "NACA_4DIGITS": Formula(_naca, _still),
    "PARABOLIC": Formula(_parabolic, _still),
    "TRANSLATE_GRID": Formula(_shifted_mesh),
    "ROTATE_GRID": Formula(_rotated, _rotating),
    "SCALE_GRID": Formula(_resized, _scaling),
}
"""What each kind does; kinds that are not here move nothing."""


class Shapes(Displacer):
    """Formulas that move nodes: each acts on undeformed points, as in SU2."""

    @cached_property
    def _surface(self) -> MovedNodes:
        return MovedNodes(self.mesh, self.config.markers, self.nodes)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Return what a variable does to the flow only, and where SU2 would do otherwise."""
        variables = self.config.variables
        notes: list[Remark] = [*angle_notes(variables, self.config.relaxation)]
        heights = {each.numbers[2] for each in variables if each.kind == "ROTATION"}
        if self.mesh.dim == 3 and heights - {*variables[0].numbers[2:3]}:
            notes.append(
                "SU2 turns all ROTATION about lines through the z0 of the first variable; here "
                "each has its own"
            )
        if len(self.nodes):
            acting = [each for each in variables if not each.ignored]
            notes += self._surface.chord_doubts(acting, self.config.relaxation)
        return tuple(notes)

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether its kind moves nothing."""
        return tuple(each.kind not in FORMULAS for each in self.config.variables)

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes by all variables."""
        total = np.zeros_like(self._surface.points)
        for place, variable in enumerate(self.config.variables, start=1):
            if variable.kind in FORMULAS and not variable.ignored:
                formula = FORMULAS[variable.kind]
                amount = self._factor(formula) * variable.value
                try:
                    total += formula.moved(variable, self._surface, amount)
                except CaseError as problem:
                    at = f"{self.config.source}: variable {place} ({variable.kind})"
                    raise CaseError(f"{at}: {problem}") from problem
        return total

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to the value of a variable."""
        del part  # all have one value
        variable = self.config.variables[place]
        formula = FORMULAS[variable.kind]
        factor = self._factor(formula)
        if formula.rate is None:
            return factor * formula.moved(variable, self._surface, 1.0)
        amount = 0.0 if undeformed else factor * variable.value
        return factor * formula.rate(variable, self._surface, amount)

    def _factor(self, formula: Formula) -> float:
        return self.config.relaxation if formula.relaxed else 1.0


def _shown(point: FloatArray) -> str:
    return f"({', '.join(f'{value:.6g}' for value in point)})"


def _turn(variable: DesignVariable, on: MovedNodes) -> Turn:
    """Return the rotation about the line through two points, the variable's numbers; in degrees.

    In 2D the line is along z. Raises CaseError where the points define no line.
    """
    first, second = np.array(variable.numbers).reshape(2, 3)
    axis = second - first if on.mesh.dim == 3 else np.array([0.0, 0.0, 1.0])
    if on.mesh.dim == 2 and (first != second)[:2].any():
        raise CaseError(
            f"the line from {_shown(first)} to {_shown(second)} leaves the normal of a "
            "mesh of 2 dimensions; give both points the same x and y"
        )
    if np.linalg.norm(axis) == 0.0:
        raise CaseError("its two points coincide, so the line between them has no direction")
    return Turn(np.ones(len(on.points), bool), first, axis, np.radians(1.0))


def held_planes(config: Su2Config, mesh: Mesh, box: Box, continuity: str) -> Planes:
    """Return the planes of control points that FFD_CONTINUITY= ``continuity`` holds, by axis."""
    depth = CONTINUITIES[continuity]
    if not depth:
        fixed = [config.values[f"FFD_FIX_{letter}"] for letter in "IJK"]
        return _planes(box, 0) & fixed[0], _planes(box, 1) & fixed[1], _planes(box, 2) & fixed[2]
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


@record
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

    def _moves(self, place: int) -> Moves:
        variable = self.config.variables[place]
        box = next(box for box in self.boxes if box.name == variable.box)
        return moves_of(box, request_of(self.config, variable), self.held[box.name])

    @cached_property
    def at_design(self) -> BoxDeformation:
        """Return the deformation by this design."""
        design = [value for variable in self.config.variables for value in variable.values]
        values = self.config.values
        iterations = values["FFD_INTPREV_ITER"] if values["FFD_INTPREV"] else 0
        bound = values["OPT_LINE_SEARCH_BOUND"]
        limits = Limits(bound, iterations, values["FFD_INTPREV_DEPTH"])
        return self._deformed(np.array(design), limits)

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
            rows = places_in(nodes, listed)
            moves = (rows >= 0) & (marker in self.config.markers)
            surfaces[marker] = listed, np.where(moves[:, None], uvw[rows], before)
        return surfaces


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


Attempt = TypeVar("Attempt")


def scaled(config: Su2Config, part: float) -> Su2Config:
    """Return a configuration with ``part`` of its design."""
    if config.zones:
        zones = (scaled(z, part) if _is_checked(z) else z for z in config.zones)
        return joined(config, tuple(zones))
    variables = []
    for variable in config.variables:
        # The value that moves nothing.
        neutral = 1.0 if variable.kind in ("SCALE", "SCALE_GRID") else 0.0
        values = tuple(neutral + part * (value - neutral) for value in variable.values)
        variables.append(replace(variable, values=values))
    return replace(config, variables=tuple(variables))


def _is_checked(config: Su2Config) -> bool:
    return bool(config.values["CONVEXITY_CHECK"])


def convex_part(
    config: Su2Config,
    mesh: Mesh,
    attempt: Callable[[Su2Config], Attempt],
    deformed: Callable[[Attempt], Mesh],
) -> tuple[float, Attempt, Sequence[str]]:
    """Reduce the design by CONVEXITY_CHECK; return its factor, the deformation, and warnings.

    Raises CaseError or DeformError if not even the smallest part that is tried can be done.
    ``mesh``: the undeformed mesh. ``attempt`` and ``deformed``: deforms the mesh by a
    configuration; returns the mesh of what that returned.
    """
    if not _is_checked(config):
        return 1.0, attempt(config), ()
    least = quality(mesh).inverted
    kind = config.variables[0]
    impossible: list[CaseError | DeformError] = []

    def tried(config: Su2Config) -> tuple[Attempt | None, int]:
        try:
            surface = attempt(config)
        except (CaseError, DeformError) as problem:  # a boundary goes through another one
            impossible.append(problem)
            return None, 1
        return surface, max(0, quality(deformed(surface), reference=mesh).inverted - least)

    full, first = tried(config)
    if full is not None and not first:
        return 1.0, full, ()
    if kind.group in WITHOUT_VALUE and full is not None:
        note = (
            f"CONVEXITY_CHECK scales values, but {kind.kind} has no values: it is applied in full"
        )
        return 1.0, full, (note,)
    best: tuple[float, Attempt] | None = None
    part = 1.0
    step = 1.0
    depth = 0
    valid = False
    for _ in range(config.values["CONVEXITY_CHECK_ITER"]):
        step /= 2.0
        part += step if valid else -step
        found, inverted = tried(scaled(config, part))
        valid = found is not None and not inverted
        if found is not None and valid:  # which is larger than the one before
            best = (part, found)
            depth = depth + 1
        if depth == config.values["CONVEXITY_CHECK_DEPTH"]:
            break
    note = f"CONVEXITY_CHECK: all of the design would invert {first} more cells"
    note = f"CONVEXITY_CHECK: {impossible[0]}" if full is None else note
    if best is None and full is None:
        raise impossible[0]
    if best is None:
        assert full is not None
        return 1.0, full, (f"{note}, and so does the smallest part that was tried, {part:g}",)
    return *best, (f"{note}; {best[0]:g} of it is done: its values times {best[0]:g}",)


POSITION = Columns("position", ("x", "y", "z"), flat=True)


class ListedPositions(Displacer):
    """New positions of nodes, as a file lists them: there is no value to change."""

    @cached_property
    def _listed(self) -> tuple[FloatArray, tuple[str, ...]]:
        config = self.config
        of = f"{config.named[config.markers[0]]}= ({', '.join(config.markers)})"
        return read_positions(config.files["DV_FILENAME"], self.nodes, self.mesh, of)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what reading the file found."""
        return self._listed[1]

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes."""
        return self._listed[0] - self.mesh.points[self.nodes]


def read_positions(
    path: Path, nodes: IntArray, mesh: Mesh, of: str
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the new positions of nodes, (m, d), and warnings; nodes that are not listed stay.

    Lines are ``index x y [z]`` in any order, with blanks, tabs or commas between; a plane mesh may
    have a z of 0. As in SU2, nodes that are on none of the moving boundaries are ignored, but with
    a warning. Raises CaseError if the file cannot be read, has mistakes (a line ``file:line:
    sentence`` for each), or none of these nodes. ``path``: the file, whose nodes have the numbers
    that `in_zones` tells. ``nodes`` (m,) int64: of the moving boundaries, ascending. ``of``: key
    and moving boundaries for messages: ``DV_MARKER= (low)``.
    """
    text, warnings = read_text(path, "surface file")
    tables = []
    for first, _, part, lines in in_zones(text, path, mesh, nodes):
        every = np.arange(len(part.points))
        tables.append(parse_rows(lines, path, every, part.points.shape, "the mesh", POSITION))
        tables[-1][:, 0] += first
    table = np.concatenate(tables)
    listed = table[:, 0].astype(np.int64)
    moving = np.isin(listed, nodes)
    others = int(np.count_nonzero(~moving))
    if others == len(listed):
        raise CaseError(
            f"{path}: none of its {others} nodes is on {of}, so nothing would move; correct the "
            "file or the boundaries"
        )
    positions = mesh.points[nodes]
    positions[np.searchsorted(nodes, listed[moving])] = table[moving, 1:]
    if others:
        sentence = f"{path}: {others} of {len(listed)} nodes are not on {of}; they are ignored"
        warnings = (*warnings, sentence)
    return positions, warnings


RIGID = ("TRANSLATION", "ROTATION", "SCALE")
"""Kinds of variables that move boundaries as a rigid body, or scale them."""


@record
class ZoneDisplacers(Displacer):
    """The displacers of zones with a configuration each, as one."""

    zones: tuple[MovingSurface, ...]

    @cached_property
    def _rows(self) -> list[slice]:
        """The rows of the nodes of each zone."""
        ends = np.cumsum([0, *(len(zone.nodes) for zone in self.zones)]).tolist()
        return list(starmap(slice, pairwise(ends)))

    @cached_property
    def _owners(self) -> list[list[tuple[int, int]]]:
        """The zones that have each variable, and its place in their lists."""
        having = grouped((zone.config.variables, k) for k, zone in enumerate(self.zones))
        return [[(k, at) for k in some] for each, some in having.items() for at in range(len(each))]

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect in any zone."""
        return tuple(all(self.zones[k].idle[at] for k, at in some) for some in self._owners)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Return those of all zones, each once."""
        return tuple(dict.fromkeys(text for zone in self.zones for text in zone.warnings))

    @property
    def inside(self) -> dict[str, int]:
        """Return how many nodes of all zones are in each box."""
        counts: Counter[str] = Counter()
        for zone in self.zones:
            counts.update(zone.displacer.inside)
        return dict(counts)

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes of all zones."""
        return np.concatenate([zone.displacement for zone in self.zones])

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to a value, in all zones that have it."""
        out = np.zeros((len(self.nodes), self.mesh.dim))
        for k, at in self._owners[place]:
            out[self._rows[k]] = self.zones[k].slope(at, part, undeformed)
        return out

    def moved_boxes(self) -> dict[str, tuple[Box, bool]]:
        """Return the boxes of all zones, each as the first zone moves it, as in SU2."""
        out: dict[str, tuple[Box, bool]] = {}
        for zone in self.zones:
            for name, (box, anew) in zone.displacer.moved_boxes().items():
                first, before = out.get(name, (box, False))
                mine = {k: v for k, v in box.embedded.items() if k in zone.config.markers}
                out[name] = replace(first, embedded={**first.embedded, **mine}), anew or before
        return out


DISPLACERS: dict[Group, Callable[[Su2Config, Mesh, IntArray], Displacer]] = {
    "nothing": Shapes,
    "surface": Shapes,
    "naca": Shapes,
    "parabolic": Shapes,
    "grid": Shapes,
    "file": ListedPositions,
    "ffd": move_boxes,
}
"""What moves the nodes, by the group of the first design variable."""


@record
class MovingSurface:
    """The moving boundaries of a configuration, and its design."""

    config: Su2Config
    mesh: Mesh
    nodes: IntArray  # (m,): of all moving boundaries, or of the mesh (``*_GRID``), ascending
    displacer: Displacer
    warnings: tuple[Remark, ...]
    zones: tuple[MovingSurface, ...] = ()  # that of each, with CONFIG_LIST

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect."""
        ignored = (each.ignored for each in self.config.variables)
        return tuple(map(max, ignored, self.displacer.idle))

    @property
    def values(self) -> tuple[tuple[int, int], ...]:
        """Return (variable, number among its values) of each value, both from 0."""
        variables = enumerate(self.config.variables)
        return tuple((place, part) for place, each in variables for part in range(len(each.values)))

    @cached_property
    def displacement(self) -> FloatArray:
        """Return the displacement of the nodes, (m, d); CaseError where it is not finite."""
        with _overflow_as_case_error(self.config):
            return self._finite(self.displacer.displacement())

    def slope(self, place: int, part: int = 0, undeformed: bool = False) -> FloatArray:
        """Return the derivative (m, d) of the displacement with respect to a value.

        ``place``: number of the variable, from 0. ``part``: number of the value among those of the
        variable, from 0. ``undeformed``: whether at the design that moves nothing, instead of this
        one.
        """
        if self.idle[place]:
            return np.zeros((len(self.nodes), self.mesh.dim))
        with _overflow_as_case_error(self.config):
            return self._finite(self.displacer.slope(place, part, undeformed))

    def _finite(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (m, d) that must be finite."""
        if not np.isfinite(vectors).all():
            raise OverflowError
        return vectors

    @property
    def moves_whole_mesh(self) -> bool:
        """Return whether the variables displace all nodes of the mesh directly (``*_GRID``)."""
        return self.config.variables[0].group == "grid"

    def moved(self) -> Mesh:
        """Return the mesh with the nodes moved, and no others."""
        points = self.mesh.points.copy()
        points[self.nodes] += self.displacement
        return self.mesh.with_points(points)

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return a deformed mesh with its FFD boxes moved by the design."""
        moved = self.displacer.moved_boxes()
        if not moved:
            return mesh
        renewed = [name for name, (_, anew) in moved.items() if anew]
        return with_boxes(mesh, [box for box, _ in moved.values()], renewed=renewed)

    def case(self) -> Case:
        """Return the case with this displacement as its motion."""
        if not self.zones:
            return self._case()
        cases = [zone._case() for zone in self.zones]
        settings = {zone.zone: zone.case for zone in self.config.zones}
        settings |= {zone.config.zone: case for zone, case in zip(self.zones, cases, strict=True)}
        moved = [motion.content for case in cases for motion in case.motions]
        nodes, vectors = zip(*moved, strict=True)
        motion = Prescribed(np.concatenate(nodes), np.concatenate(vectors))
        warnings = *self.config.case.warnings, *self.warnings
        if self.moves_whole_mesh:
            warnings = *warnings, *torn_interfaces(self.mesh, self.moved().points)
        return self.config.case.change(
            roles={name: role for each in settings.values() for name, role in each.roles.items()},
            motions=(motion,),
            zone_settings=tuple(settings.values()),
            warnings=warnings,
        )

    def _case(self) -> Case:
        case = self.config.case
        _, markers = zone_of(self.config, self.mesh)
        names = [marker.name for marker in markers]
        others = set(names) - set(self.config.markers)
        moving = (each for each in self.config.variables if not each.ignored)
        if (
            not others
            and {each.kind for each in moving} <= {*RIGID}
            and case.kernel == Case().kernel
        ):
            # All boundaries move as a body does, or grow: this kernel has that exactly inside.
            case = case.change(kernel="thin-plate")
        nodes = self.nodes
        vectors = self.displacement
        warnings = self.warnings
        if self.moves_whole_mesh or not self.config.markers:
            every = dict.fromkeys(names, "moving")
            case = case.change(roles=every, sliding="none", periodic="none")
        if self.moves_whole_mesh:  # the mesh is moved already
            nodes = self.mesh.nodes_of(names)
            vectors = np.zeros((len(nodes), self.mesh.dim))
            if self.config.zone is None:
                warnings = (*warnings, *torn_interfaces(self.mesh, self.moved().points))
        motions = (Prescribed(nodes, vectors),)
        return case.change(motions=motions, warnings=(*case.warnings, *warnings))


@contextmanager
def _overflow_as_case_error(config: Su2Config) -> Iterator[None]:
    try:
        with np.errstate(all="ignore"):
            yield
    except OverflowError as problem:
        raise CaseError(
            f"{config.source}: the variables move nodes too far for the arithmetic; correct "
            "DV_PARAM or DV_VALUE"
        ) from problem


def make_surface(config: Su2Config, mesh: Mesh) -> MovingSurface:
    """Return the moving boundaries of a configuration, and what moves them; or CaseError."""
    if config.zones:
        return _of_zones(config, mesh)
    group = config.variables[0].group
    needed = group not in ("grid", "nothing")
    problems: list[str | Message] = [*problems_of_markers(config, mesh, needed)]
    if group == "ffd":
        problems += problems_of_boxes(config, mesh)
    raise_all(problems)
    nodes = zone_of(config, mesh)[0] if group == "grid" else mesh.nodes_of(config.markers)
    with _overflow_as_case_error(config):
        displacer = DISPLACERS[group](config, mesh, nodes)
    left = [] if group == "ffd" else _left_behind(config, mesh)
    if group == "grid" and mesh.halo is not None:
        sentence = f"the transformations of the halo in {mesh.name} (SEND_RECEIVE) stay as they are"
        left.append(f"{sentence}; they are wrong if the axis or the vector of the period moves")
    return MovingSurface(config, mesh, nodes, displacer, (*displacer.warnings, *left))


def _of_zones(config: Su2Config, mesh: Mesh) -> MovingSurface:
    """Return the moving boundaries of the zones of a CONFIG_LIST."""
    moving = [zone for zone in config.zones if zone.variables[0].group != "nothing"]
    moving = moving or [*config.zones[:1]]
    zones = tuple(make_surface(zone, mesh) for zone in moving)
    nodes = np.concatenate([np.empty(0, np.int64), *(zone.nodes for zone in zones)])
    displacer = ZoneDisplacers(config, mesh, nodes, zones)
    return MovingSurface(config, mesh, nodes, displacer, displacer.warnings, zones)


def at_rest(case: Case, mesh: Mesh) -> Step:
    """Return the one step of a design that moves nothing: often the first of an optimiser."""
    if isinstance(mesh, Assembly):
        zones = enumerate(each_zone(case, mesh))
        steps = {k: at_rest(*each) for k, each in zones if each[0].markers_with("moving")}
        step = Step.joined(mesh, mesh, steps, steps, next(iter(steps.values())))
        return replace(step, messages=(*case.warnings, *step.messages))
    setup = make_setup(prepare(case, mesh))
    return Step(
        index=1,
        total=1,
        mesh=mesh,
        control_nodes=0,
        max_error=0.0,
        condition=np.nan,
        node_counts=setup.classes.counts(),
        seconds={},
        messages=(*case.warnings, *setup.warnings),
        candidates=setup.candidates,
        support_radius=setup.basis.radius if case.method == "rbf" else None,
    )


def _left_behind(config: Su2Config, mesh: Mesh) -> list[Remark]:
    """Return a note if variables move the surface, but not the FFD boxes in the mesh; or none."""
    moving = [each for each in config.variables if not each.ignored and each.group != "nothing"]
    kinds = sorted({each.kind for each in moving})
    with suppress(SlidevizError):  # a mesh whose boxes cannot be read has none that could be used
        if kinds and boxes_of(mesh):
            sentence = (
                f"the FFD boxes in {config.case.mesh_out} follow their control points only, and "
                f"not {', '.join(kinds)}; define them again to use them with that mesh"
            )
            return [note(sentence)]
    return []
