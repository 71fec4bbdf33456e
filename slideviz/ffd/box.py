"""A box of control points, and surface points embedded in it.

Sederberg and Parry 1986, *Free-form deformation of solid geometric models*: a point of the box is
the sum of its control points, each times the product of one blending function in each direction,
at the point's parametric coordinates (u, v, w). In 2D the box is one cell thick, from z = -1/2 to
1/2, and its points lie in the middle, w = 1/2, as SU2 has it. All this is done in the coordinates q
of the box's coordinate system (`CoordinateSystem`), which mostly are x, y, z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, frozen_array
from slideviz.terms import FfdSystem

if TYPE_CHECKING:
    from scipy.sparse import csr_array

WEDGE = 0.1  # half the angle in radians of a box in 2D with polar coordinates, about the axis
POLAR_CORNERS = np.array([1, 2, 2, 1, 0, 3, 3, 0])
"""Which of the 4 corners that are given each of the 8 corners of a polar box in 2D is."""
POLAR_SIDES = np.array([-1, -1, 1, 1, -1, -1, 1, 1])  # side of the plane on which each of them is


@frozen
class CoordinateSystem:
    """A coordinate system q with its axis along x through ``origin``.

    Cylindrical: q = (r, theta, x - x0). Spherical and polar: q = (r, theta, phi), phi being the
    angle from the axis. theta is in (-3 pi/2, pi/2], measured from y to z.
    """

    kind: FfdSystem = "CARTESIAN"
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def q_of(self, points: FloatArray) -> FloatArray:
        """Return the coordinates q (..., 3) of Cartesian points (..., 3)."""
        if self.kind == "CARTESIAN":
            return points
        x, y, z = np.moveaxis(points - np.array(self.origin), -1, 0)
        theta = np.arctan2(z, y)
        theta = np.where(theta > 0.5 * np.pi, theta - 2.0 * np.pi, theta)
        if self.kind == "CYLINDRICAL":
            return np.stack([np.hypot(y, z), theta, x], axis=-1)
        radius = np.sqrt(x * x + y * y + z * z)
        cosine = np.divide(x, radius, out=np.ones_like(x), where=radius > 0.0)
        return np.stack([radius, theta, np.arccos(np.clip(cosine, -1.0, 1.0))], axis=-1)

    def points_of(self, q: FloatArray) -> FloatArray:
        """Return the Cartesian points (..., 3) of coordinates q (..., 3)."""
        if self.kind == "CARTESIAN":
            return q
        first, theta, last = np.moveaxis(q, -1, 0)
        x, r = (last, first) if self.kind == "CYLINDRICAL" else _spherical(first, last)
        return np.stack([x, r * np.cos(theta), r * np.sin(theta)], -1) + np.array(self.origin)

    def pushed(self, q: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the rates (..., 3) of points for rates (..., 3) of their q (..., 3)."""
        if self.kind == "CARTESIAN":
            return rates
        first, theta, last = np.moveaxis(q, -1, 0)
        d_first, d_theta, d_last = np.moveaxis(rates, -1, 0)
        if self.kind == "CYLINDRICAL":
            r = first
            dx = d_last
            dr = d_first
        else:
            x, r = _spherical(first, last)
            along, across = _spherical(d_first, last)
            dx = along - r * d_last
            dr = across + x * d_last
        sine = np.sin(theta)
        cosine = np.cos(theta)
        turned = r * d_theta
        return np.stack([dx, dr * cosine - turned * sine, dr * sine + turned * cosine], -1)


CARTESIAN = CoordinateSystem()


def _spherical(radius: FloatArray, phi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the part of a radius along the axis, and that across it."""
    return radius * np.cos(phi), radius * np.sin(phi)


def polar_corners(corners: FloatArray) -> FloatArray:
    """Return the corners (8, 3) of a polar box in 2D from its corners (4, 2) in the plane.

    Its directions are i along given 1 to 2, j about the axis and k along given 1 to 0.
    """
    x, y = corners[POLAR_CORNERS].T
    return np.stack([x, y * np.cos(WEDGE), POLAR_SIDES * y * np.sin(WEDGE)], axis=-1)


def given_of_polar(corners: FloatArray) -> FloatArray:
    """Return the corners (4, 2) from which `polar_corners` makes ``corners`` (8, 3)."""
    first: IntArray = np.array([4, 0, 1, 5])
    x, y, z = corners[first].T
    return np.stack([x, np.copysign(np.hypot(y, z), y)], axis=-1)


def knots(count: int, order: int) -> FloatArray:
    """Return the knots of ``count`` functions of an order, (count + order,)."""
    inner = np.arange(1, count - order + 1) / (count - order + 1)
    return np.concatenate([np.zeros(order), inner, np.ones(order)])


def blending(count: int, order: int, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the functions and their derivatives at parametric coordinates.

    Returns ``values, slopes`` (m, count): the functions, and their derivatives with respect to the
    coordinate.
    ``count`` and ``order``: control points, and the order of the functions, from 1 to ``count``.
    ``at`` (m,) float64: parametric coordinates; outside of [0, 1] the outermost polynomials are
    continued.
    """
    knot = knots(count, order)
    degree = order - 1
    span = np.clip(np.searchsorted(knot, at, "right") - 1, degree, count - 1)

    def around(degree: int) -> tuple[FloatArray, FloatArray]:
        """Return the two knots around each function of degree - 1 that is not zero in the span."""
        begin = span[:, None]
        return knot[begin + np.arange(1 - degree, 1)], knot[begin + np.arange(1, degree + 1)]

    lower = np.zeros((len(at), 0))
    basis = np.ones((len(at), 1))
    for j in range(1, order):
        lower = basis
        left, right = around(j)
        part = lower / (right - left)
        basis = np.zeros((len(at), j + 1))
        basis[:, :-1] = (right - at[:, None]) * part
        basis[:, 1:] += (at[:, None] - left) * part
    slope = np.zeros_like(basis)
    if degree:
        left, right = around(degree)
        part = degree * lower / (right - left)
        slope[:, :-1] -= part
        slope[:, 1:] += part
    return _placed(basis, span - degree, count), _placed(slope, span - degree, count)


def _placed(values: FloatArray, first: np.ndarray, count: int) -> FloatArray:
    """Return values (m, k) of the functions from ``first`` (m,) on in (m, count); others are 0."""
    out = np.zeros((len(values), count))
    rows = np.arange(len(values))[:, None]
    out[rows, first[:, None] + np.arange(values.shape[1])] = values
    return out


Index = tuple[int, int, int]
"""A control point (i, j, k); an index of -1 means all of that direction."""

MOST_DEGREE = 50
MOST_POINTS = 20_000
"""The largest degree and number of control points; with more it takes minutes to find nodes."""

HALF = 0.5  # half the thickness of a box in 2D, in the mesh's length unit
CORNERS = np.array([(i, j, k) for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])
"""SU2's order of the corners, by their (u, v, w)."""


@record
class Embedding:
    """Nodes in a box, with their weights of the control points (I, J, K)."""

    nodes: IntArray  # (m,): sorted
    uvw: FloatArray  # (m, 3): parametric coordinates of the nodes
    factors: tuple[FloatArray, FloatArray, FloatArray]
    """tuple of (m, I), (m, J), (m, K) float64: blending functions at the nodes in each direction;
    their products are the weights."""

    def sums(self, lattice: FloatArray) -> FloatArray:
        """Return the weighted sums (m, c), for each node, of values (I, J, K, c)."""
        return _sums(*self.factors, lattice)

    def gathered(self, values: FloatArray) -> FloatArray:
        """Return the transposed product of `sums`: (I, J, K, c) of values (m, c) at the nodes."""
        u, v, w = self.factors
        return np.einsum("mi,mj,mk,mc->ijkc", u, v, w, values, optimize=True)

    def matrix(self) -> csr_array:
        """Return the weights (m, I J K), also the derivatives of each coordinate of the nodes."""
        # Late: scipy.sparse takes 0.1 s.
        from scipy.sparse import csr_array

        u, v, w = self.factors
        return csr_array(np.einsum("mi,mj,mk->mijk", u, v, w).reshape(len(u), -1))


@record
class Box:
    """A box for free-form deformation."""

    name: str
    points: FloatArray  # (I, J, K, 3): the control points, in the mesh's length unit
    orders: Index | None  # (int, int, int) or None: orders of the uniform B-splines; None: Bézier
    corners: FloatArray  # (8, 3): corners of the undeformed box, in SU2's order (`CORNERS`)
    embedded: Mapping[str, tuple[IntArray, FloatArray]] = field(default_factory=dict)
    """mapping of str to (nodes, uvw): for each marker that the mesh file lists for the box, nodes
    (m,) and parametric coordinates (m, 3)."""
    system: CoordinateSystem = CARTESIAN  # of the coordinates q in which control points are blended
    level: int = 0
    parent: str = ""
    """`level`, `parent`: of a nested box: 1 or more, and the name of the box whose control points
    move its own."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen_array(self.points, np.float64))
        object.__setattr__(self, "corners", frozen_array(self.corners, np.float64))

    @property
    def degrees(self) -> Index:
        """Return the polynomial degree along each direction: number of control points less one."""
        i, j, k, _ = self.points.shape
        return i - 1, j - 1, k - 1

    @property
    def q(self) -> FloatArray:
        """Return the coordinates (I, J, K, 3) of the control points in the box's system."""
        return self.system.q_of(self.points)

    def axes(self, dim: int) -> tuple[int, ...]:
        """Return its directions, 0 to 2, in 2D or 3D; in 2D a polar box has i and k."""
        polar = self.system.kind == "POLAR" or self.degrees[2] > 1
        return (0, 2) if dim == 2 and polar else (0, 1, 2)[:dim]

    def describe(self, dim: int) -> str:
        """Return degrees, blending and the number of surface points in words, for 2D or 3D."""
        axes = self.axes(dim)
        words = f"degree {' x '.join(str(self.degrees[axis]) for axis in axes)}, "
        words += "Bézier" if self.orders is None else "uniform B-splines of order "
        words += " x ".join(str(self.orders[axis]) for axis in axes if self.orders)
        words += f", in {self.parent}" if self.parent else ""
        count = sum(len(nodes) for nodes, _ in self.embedded.values())
        if count:
            words += f", {count:,} surface points of {', '.join(self.embedded)}"
        return words

    def factors(self, uvw: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return for each direction the blending functions and their slopes at uvw, (m, count)."""
        counts = self.points.shape[:3]
        orders = self.orders or counts
        return [blending(n, o, t) for n, o, t in zip(counts, orders, uvw.T, strict=True)]

    def embed(self, nodes: IntArray, uvw: FloatArray) -> Embedding:
        """Return the embedding of nodes (m,) at parametric coordinates (m, 3)."""
        (u, _), (v, _), (w, _) = self.factors(uvw)
        return Embedding(nodes, uvw, (u, v, w))

    def at(self, uvw: FloatArray) -> FloatArray:
        """Return the points (m, 3) at parametric coordinates (m, 3)."""
        return self.system.points_of(self.embed(np.arange(len(uvw)), uvw).sums(self.q))

    def slopes(self, uvw: FloatArray) -> FloatArray:
        """Return the derivatives (m, 3, 3) of q with respect to (u, v, w), the last axis."""
        functions = self.factors(uvw)
        columns = []
        for axis in range(3):
            u = functions[0][axis == 0]
            v = functions[1][axis == 1]
            w = functions[2][axis == 2]
            columns.append(_sums(u, v, w, self.q))
        return np.stack(columns, axis=-1)

    def change(self, index: Index, vector: tuple[float, ...]) -> FloatArray:
        """Return the change (I, J, K, 3) of all control points that moves those of ``index``.

        Raises CaseError if the box has no such control point.
        """
        problem = self.problem(index)
        if problem:
            raise CaseError(problem)
        out = np.zeros(self.points.shape)
        out[points_at(index)] = vector
        return out

    def problem(self, index: Index) -> str:
        """Return why the box has no control point of this index; "" if it has one."""
        for name, at, most in zip("ijk", index, self.degrees, strict=True):
            if not -1 <= at <= most:
                return (
                    f"the box {self.name!r} has no control point with {name} = {at}; {name} goes "
                    f"from 0 to {most}, and -1 is all"
                )
        return ""

    def moved(self, change: FloatArray) -> Box:
        """Return the box with its control points moved by ``change`` (I, J, K, 3) of q."""
        return replace(self, points=self.system.points_of(self.q + change))


def points_at(index: tuple[int, ...]) -> tuple[int | slice, ...]:
    """Return an index (i, j, k) for arrays, with slices for -1."""
    return tuple(slice(None) if at < 0 else at for at in index)


def _sums(u: FloatArray, v: FloatArray, w: FloatArray, lattice: FloatArray) -> FloatArray:
    """Return the sums (m, c) of values (I, J, K, c) times factors (m, I), (m, J), (m, K)."""
    m = len(u)
    i, j, k, c = lattice.shape
    plane = (u @ lattice.reshape(i, -1)).reshape(m, j, k * c)
    line = np.einsum("mj,mjx->mx", v, plane).reshape(m, k, c)
    return np.einsum("mk,mkc->mc", w, line)


def lattice(corners: FloatArray, degrees: Index) -> FloatArray:
    """Return the regular control points (I, J, K, 3) between corners (8, 3), trilinear."""
    u = np.linspace(0.0, 1.0, degrees[0] + 1)
    v = np.linspace(0.0, 1.0, degrees[1] + 1)
    w = np.linspace(0.0, 1.0, degrees[2] + 1)
    out = np.zeros((len(u), len(v), len(w), 3))
    for (a, b, c), corner in zip(CORNERS.tolist(), corners, strict=True):
        part = [t if side else 1.0 - t for side, t in zip((a, b, c), (u, v, w), strict=True)]
        out += np.einsum("i,j,k,c->ijkc", *part, corner)
    return out


def regular_box(
    name: str,
    corners: FloatArray,
    degrees: Index,
    orders: Index | None,
    system: CoordinateSystem = CARTESIAN,
) -> Box:
    """Return the undeformed box between corners (8, 3), with a regular lattice in q.

    Raises CaseError if a degree or an order is not possible, there are too many control points, or
    the corners in this order enclose no volume.
    """
    for letter, degree in zip("ijk", degrees, strict=True):
        if not 1 <= degree <= MOST_DEGREE:
            raise CaseError(f"the degree of {letter} is {degree}; expected 1 to {MOST_DEGREE}")
    count = (degrees[0] + 1) * (degrees[1] + 1) * (degrees[2] + 1)
    if count > MOST_POINTS:
        raise CaseError(f"it has {count} control points; expected at most {MOST_POINTS}")
    for letter, order, degree in zip("ijk", orders or (2, 2, 2), degrees, strict=True):
        if not 2 <= order <= degree + 1:
            raise CaseError(
                f"the B-splines of {letter} have the order {order}, and {degree + 1} control "
                f"points; expected an order from 2 to {degree + 1}"
            )
    control = system.points_of(lattice(system.q_of(corners), degrees))
    box = Box(name, control, orders, corners, system=system)
    ends = np.array(list(product((0.0, 0.5, 1.0), repeat=3)))
    volume = np.linalg.det(box.slopes(ends))
    # The box may be left-handed, and sides may shrink to an edge.
    if volume.min() < 0.0 < volume.max() or not volume.any():
        raise CaseError(
            "the corners enclose no volume in their order; expected the bottom corners "
            "counter-clockwise, then the corners above them"
        )
    return box


def plane_corners(corners: FloatArray) -> FloatArray:
    """Return the corners (8, 3) of a box in 2D from its corners (4, 2) in the plane."""
    return np.concatenate([np.column_stack([corners, np.full(4, z)]) for z in (-HALF, HALF)])
