"""A section through a mesh: a plane or a cylinder, as a value, and its signed distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import axis_basis
from slideviz.mesh.surfaces import padded
from slideviz.terms import SectionKind

Triple = tuple[float, float, float]

ON_SECTION = 1e-9
"""Nodes nearer than this part of the largest distance are on the section: a layer of nodes that
lies in it up to rounding gives one layer of cells, not a random mix of both."""
_DIGITS, _FEW = 4, 2
"""Digits of each number of a direction or point in words, and where there is little room."""


@dataclass(frozen=True)
class Section:
    """A plane or a cylinder that cuts a mesh.

    Attributes
    ----------
    kind : "plane" or "cylinder"
    origin : (3,) tuple of float
        A point of the plane, or of the cylinder's axis, in the mesh's length unit.
    direction : (3,) tuple of float
        The plane's normal, or the direction of the axis; any length but zero.
    radius : float
        Of the cylinder; a plane has none.
    whole : bool
        Show the cells it cuts whole, instead of cut.
    name : str
        What people call it; empty: see `describe`.
    shown : bool
        Whether a view draws it.
    flat : bool
        Whether it is laid flat beside the view: a cylinder unrolled, a plane along its normal.

    Raises
    ------
    CaseError
        A number is not finite, the direction has length zero, or the radius is not positive.
    """

    kind: SectionKind
    origin: Triple = (0.0, 0.0, 0.0)
    direction: Triple = (0.0, 0.0, 1.0)
    radius: float = 0.0
    whole: bool = False
    name: str = ""
    shown: bool = True
    flat: bool = False

    def __post_init__(self) -> None:
        numbers = (*self.origin, *self.direction, self.radius)
        if not np.isfinite(numbers).all():
            raise CaseError(f"{self.kind} section: {numbers} has a number that is not finite")
        if not np.linalg.norm(self.direction) > 0:
            word = "normal" if self.kind == "plane" else "axis"
            raise CaseError(
                f"{self.kind} section: the {word} 0, 0, 0 has no direction; give 0, 0, 1 or such"
            )
        if self.kind == "cylinder" and not self.radius > 0:
            raise CaseError(
                f"cylinder section: the radius {self.radius:.6g} is not positive; give the "
                "distance of the section from its axis"
            )

    @property
    def basis(self) -> FloatArray:
        """Return rows e1, e2, e3 (3, 3), right-handed, e3 along the normal or the axis.

        An axis has no sign: e3 points to the positive side of its largest component.
        """
        base = axis_basis(self.direction)
        if self.kind == "cylinder" and base[2, np.argmax(np.abs(base[2]))] < 0:
            return axis_basis(-base[2])
        return base

    def frame(self, points: FloatArray) -> FloatArray:
        """Return points (n, 2 or 3) as coordinates (n, 3) along e1, e2, e3 from the origin."""
        return (padded(points) - np.asarray(self.origin)) @ self.basis.T

    def distance(self, points: FloatArray) -> FloatArray:
        """Return signed distances (n,): along the normal, or outwards from the cylinder.

        What is on the section up to rounding is at 0 exactly (see `ON_SECTION`).
        """
        base, origin = self.basis, np.asarray(self.origin)
        dim = points.shape[1]

        def along(row: FloatArray) -> FloatArray:
            # Not by BLAS, whose threads wait for each other when the machine is busy.
            return np.einsum("nd,d->n", points, row[:dim]) - origin @ row

        if self.kind == "plane":
            gap = along(base[2])
        else:
            gap = np.hypot(along(base[0]), along(base[1])) - self.radius
        size = np.abs(gap)
        gap[size <= ON_SECTION * size.max(initial=0.0)] = 0.0
        return gap

    def reach(self, points: FloatArray) -> tuple[float, float]:
        """Return the range over points (n, d) of what a slider moves: offset, or radius.

        The offset of a plane is measured along its normal from its origin.
        """
        if self.kind == "plane":
            along = self.frame(points)[:, 2]
            return float(along.min()), float(along.max())
        local = self.frame(points)
        radii = np.hypot(local[:, 0], local[:, 1])
        return float(radii.min()), float(radii.max())

    def can_cut(self, dim: int) -> bool:
        """Tell whether it can cut meshes of 2 or 3 dimensions at all.

        A cylinder meets the plane of a 2D mesh in a circle where its axis is z.
        """
        return dim == 3 or self.kind == "plane" or _axis_word(self.direction) == "z"

    def describe(self, dim: int = 3) -> str:
        """Return the section in words, for people; in 2D it is a line or a circle."""
        where = _axis_word(self.direction)
        if dim == 2 and (self.kind == "cylinder") == (where == "z"):
            return self._in_plane(where)
        if self.kind == "cylinder":
            centre = np.asarray(self.origin)
            off_axis = np.linalg.norm(np.cross(centre, self.basis[2]))
            through = f" through {_triple(self.origin)}" if off_axis > 0 else ""
            return f"cylinder r = {self.radius:.6g} about {where}{through}"
        if where in "xyz":
            return f"plane {where} = {self.origin['xyz'.index(where)]:.6g}"
        return f"plane with normal {where} through {_triple(self.origin)}"

    def brief(self, dim: int = 3) -> str:
        """Return the section in few words, for a list that has what `describe` says beside it."""
        where = _axis_word(self.direction, _FEW)
        if dim == 2 or (self.kind == "plane" and where in "xyz"):
            return self.describe(dim)
        if self.kind == "plane":
            position = float(np.asarray(self.origin) @ self.basis[2])
            return f"plane ⊥ {where} at {position:.3g}"
        centre = np.asarray(self.origin)
        off_axis = np.linalg.norm(np.cross(centre, self.basis[2]))
        at = f" at {_triple(self.origin, _FEW)}" if off_axis > 0 else ""
        return f"cylinder r = {self.radius:.6g} about {where}{at}"

    def _in_plane(self, where: str) -> str:
        """Return in words what it is in the plane of a 2D mesh."""
        at = _triple(self.origin[:2])
        if self.kind == "cylinder":
            return f"circle r = {self.radius:.6g} about {at}"
        if where in "xyz":
            return f"line {where} = {self.origin['xyz'.index(where)]:.6g}"
        slope = float(np.degrees(np.arctan2(-self.direction[0], self.direction[1])))
        return f"line at {(slope + 90.0) % 180.0 - 90.0:.4g}° through {at}"


def _axis_word(direction: Triple, digits: int = _DIGITS) -> str:
    """Return x, y or z where the direction is that axis, either way, else its components."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    for word, axis in zip("xyz", np.eye(3), strict=True):
        if np.abs(unit @ axis) > 1.0 - 1e-12:
            return word
    return _triple(direction, digits)


def _triple(values: Sequence[float], digits: int = _DIGITS) -> str:
    return f"({', '.join(f'{value + 0.0:.{digits}g}' for value in values)})"
