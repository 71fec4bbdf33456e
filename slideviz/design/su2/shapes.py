"""Design variables of SU2 that move the boundary by a formula of its undeformed points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.variables import DesignVariable, angle_notes
from slideviz.errors import CaseError, Doubt, Remark
from slideviz.ffd.box import Box
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.terms import Side

UNIT_CHORD = ("HICKS_HENNE", "CST", "NACA_4DIGITS", "PARABOLIC")
"""Kinds for which the airfoil lies between x = 0 and 1."""
OFF_CHORD = 0.05  # how far its ends may be from there without a warning


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
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
        apart = np.linalg.norm(self.points[:, :2] - trailing, axis=1)
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


@dataclass(frozen=True)
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


def _scaled(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del variable
    return (amount - 1.0) * on.points


def _scaling(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    del variable, amount
    return on.points


def _rotated(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    return _turned(variable, on.points, np.radians(amount), derivative=False)


def _rotating(variable: DesignVariable, on: MovedNodes, amount: float) -> FloatArray:
    return np.radians(1.0) * _turned(variable, on.points, np.radians(amount), derivative=True)


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
    "SCALE": Formula(_scaled, _scaling),
    "HICKS_HENNE": Formula(_hicks_henne),
    "CST": Formula(_cst),
    "SURFACE_BUMP": Formula(_bumped),
    "HICKS_HENNE_CAMBER": Formula(_cambered, relaxed=False),
    "NACA_4DIGITS": Formula(_naca, _still),
    "PARABOLIC": Formula(_parabolic, _still),
    "TRANSLATE_GRID": Formula(_shifted_mesh),
    "ROTATE_GRID": Formula(_rotated, _rotating),
    "SCALE_GRID": Formula(_scaled, _scaling),
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


def _turned(
    variable: DesignVariable, points: FloatArray, angle: float, derivative: bool
) -> FloatArray:
    """Return the displacement of points (m, d) by a rotation about a line, ``angle`` in radians.

    Or, with ``derivative``, its derivative with respect to the angle. The line goes through the
    two points that are the variable's numbers, in 2D along z. Rodrigues:
    ``sin(a) k x v + (1 - cos(a)) k x (k x v)``. Raises CaseError where the points define no line.
    """
    dim = points.shape[1]
    first, second = np.array(variable.numbers).reshape(2, 3)
    axis = second - first if dim == 3 else np.array([0.0, 0.0, 1.0])
    if dim == 2 and (first != second)[:2].any():
        raise CaseError(
            f"the line from {_shown(first)} to {_shown(second)} leaves the normal of a "
            "mesh of 2 dimensions; give both points the same x and y"
        )
    length = np.linalg.norm(axis)
    if length == 0.0:
        raise CaseError("its two points coincide, so the line between them has no direction")
    arm = np.zeros((len(points), 3))
    arm[:, :dim] = points - first[:dim]
    across = np.cross(axis / length, arm)
    twice = np.cross(axis / length, across)
    if derivative:
        out = np.cos(angle) * across + np.sin(angle) * twice
    else:
        out = np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * twice
    return np.asarray(out[:, :dim])
