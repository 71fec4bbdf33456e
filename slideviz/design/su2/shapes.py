"""Design variables of SU2 that move the boundary by a formula of its undeformed points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.variables import DesignVariable
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh


@dataclass(frozen=True)
class Formula:
    """Displacement by a variable, as a formula of its value times OPT_RELAX_FACTOR."""

    moved: Callable[[DesignVariable, FloatArray, float], FloatArray]
    """Displacement (m, d) of points (m, d) by an amount."""
    rate: Callable[[DesignVariable, FloatArray, float], FloatArray] | None = None
    """Its derivative with respect to the amount; None: that of 1, since it is linear."""


def _shifted(variable: DesignVariable, points: FloatArray, amount: float) -> FloatArray:
    vector = np.array(variable.numbers[: points.shape[1]])
    return np.broadcast_to(amount * vector, points.shape)


def _scaled(variable: DesignVariable, points: FloatArray, amount: float) -> FloatArray:
    del variable
    return (amount - 1.0) * points


def _scaling(variable: DesignVariable, points: FloatArray, amount: float) -> FloatArray:
    del variable, amount
    return points


def _rotated(variable: DesignVariable, points: FloatArray, amount: float) -> FloatArray:
    return _turned(variable, points, np.radians(amount), derivative=False)


def _rotating(variable: DesignVariable, points: FloatArray, amount: float) -> FloatArray:
    return np.radians(1.0) * _turned(variable, points, np.radians(amount), derivative=True)


FORMULAS = {
    "TRANSLATION": Formula(_shifted),
    "ROTATION": Formula(_rotated, _rotating),
    "SCALE": Formula(_scaled, _scaling),
}
"""What each kind does; kinds that are not here move nothing."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """Formulas that move the boundary (a `Displacer`).

    As in SU2 each acts on the undeformed points, and their displacements are added up.
    """

    config: Su2Config
    mesh: Mesh
    nodes: IntArray

    warnings = ()

    @property
    def inside(self) -> dict[str, int]:
        """Return that no FFD box moves nodes."""
        return {}

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether its kind moves nothing."""
        return tuple(each.kind not in FORMULAS for each in self.config.variables)

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes by all variables."""
        points = self.mesh.points[self.nodes]
        total = np.zeros_like(points)
        for variable in self.config.variables:
            if variable.kind in FORMULAS and not variable.ignored:
                amount = self.config.relaxation * variable.value
                total += FORMULAS[variable.kind].moved(variable, points, amount)
        return total

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to the value of a variable."""
        del part  # all have one value
        variable = self.config.variables[place]
        points = self.mesh.points[self.nodes]
        formula, factor = FORMULAS[variable.kind], self.config.relaxation
        if formula.rate is None:
            return factor * formula.moved(variable, points, 1.0)
        amount = 0.0 if undeformed else factor * variable.value
        return factor * formula.rate(variable, points, amount)

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return the mesh: its FFD boxes stay."""
        return mesh


def _shown(point: FloatArray) -> str:
    """Return a point in words."""
    return f"({', '.join(f'{value:.6g}' for value in point)})"


def _turned(
    variable: DesignVariable, points: FloatArray, angle: float, derivative: bool
) -> FloatArray:
    """Return the displacement of points (m, d) by a rotation about a line, ``angle`` in radians.

    Or, with ``derivative``, its derivative with respect to the angle. The line goes through the
    two points that are the variable's numbers, in 2D along z. Rodrigues:
    ``sin(a) k x v + (1 - cos(a)) k x (k x v)``. Raises CaseError where the points define no line.
    """
    kind, dim = variable.kind, points.shape[1]
    first, second = np.array(variable.numbers).reshape(2, 3)
    axis = second - first if dim == 3 else np.array([0.0, 0.0, 1.0])
    if dim == 2 and (first != second)[:2].any():
        raise CaseError(
            f"{kind}: the line from {_shown(first)} to {_shown(second)} leaves the normal of a "
            "mesh of 2 dimensions; give both points the same x and y"
        )
    length = np.linalg.norm(axis)
    if length == 0.0:
        raise CaseError(f"{kind}: its two points are one; the line between them has no direction")
    arm = np.zeros((len(points), 3))
    arm[:, :dim] = points - first[:dim]
    across = np.cross(axis / length, arm)
    twice = np.cross(axis / length, across)
    if derivative:
        out = np.cos(angle) * across + np.sin(angle) * twice
    else:
        out = np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * twice
    return np.asarray(out[:, :dim])
