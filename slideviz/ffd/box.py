"""A box of control points, and surface points embedded in it.

Sederberg and Parry 1986, *Free-form deformation of solid geometric models*: a point of the box is
the sum of its control points, each times the product of one blending function in each direction,
at the point's parametric coordinates (u, v, w). In 2D the box is one cell thick, from z = -1/2 to
1/2, and its points lie in the middle, w = 1/2, as SU2 has it. All this is done in the coordinates q
of the box's coordinate system (`slideviz.ffd.coordinates`), which mostly are x, y, z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from slideviz.errors import CaseError
from slideviz.ffd.blending import blending
from slideviz.ffd.coordinates import CARTESIAN, CoordinateSystem
from slideviz.mesh.model import FloatArray, IntArray, frozen_array

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Index = tuple[int, int, int]
"""A control point (i, j, k); an index of -1 means all of that direction."""

HALF = 0.5
"""Half the thickness of a box in 2D, in the mesh's length unit."""
CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
"""SU2's order of the corners, by their (u, v, w)."""


@dataclass(frozen=True, eq=False)
class Embedding:
    """Nodes in a box, with their weights of the control points (I, J, K)."""

    nodes: IntArray
    """(m,): sorted."""
    uvw: FloatArray
    """(m, 3): parametric coordinates of the nodes."""
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
        from scipy.sparse import csr_array  # takes long to load

        u, v, w = self.factors
        return csr_array(np.einsum("mi,mj,mk->mijk", u, v, w).reshape(len(u), -1))


@dataclass(frozen=True, eq=False)
class Box:
    """A box for free-form deformation."""

    name: str
    points: FloatArray
    """(I, J, K, 3): the control points, in the mesh's length unit."""
    orders: Index | None
    """(int, int, int) or None: orders of the uniform B-splines; None: Bézier."""
    corners: FloatArray
    """(8, 3): corners of the undeformed box, in SU2's order (`CORNERS`)."""
    embedded: Mapping[str, tuple[IntArray, FloatArray]] = field(default_factory=dict)
    """mapping of str to (nodes, uvw): for each marker that the mesh file lists for the box, nodes
    (m,) and parametric coordinates (m, 3)."""
    system: CoordinateSystem = CARTESIAN
    """Of the coordinates q in which control points are blended."""
    level: int = 0
    parent: str = ""
    """`level`, `parent`: of a nested box: 1 or more, and the name of the box whose control points
    move its own."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen_array(self.points, np.float64))
        object.__setattr__(self, "corners", frozen_array(self.corners, np.float64))

    @property
    def degrees(self) -> Index:
        """Return the degree of each direction: the number of control points less one."""
        i, j, k = (count - 1 for count in self.points.shape[:3])
        return i, j, k

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
        return words + f", {count:,} surface points of {', '.join(self.embedded)}" * bool(count)

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
            u, v, w = (both[axis == k] for k, both in enumerate(functions))
            columns.append(_sums(u, v, w, self.q))
        return np.stack(columns, axis=-1)

    def change(self, index: Index, vector: tuple[float, ...]) -> FloatArray:
        """Return the change (I, J, K, 3) of all control points that moves those of ``index``.

        Raises
        ------
        CaseError
            The box has no such control point.
        """
        problem = self.problem(index)
        if problem:
            raise CaseError(problem)
        out = np.zeros(self.points.shape)
        i, j, k = (slice(None) if at < 0 else at for at in index)
        out[i, j, k] = vector
        return out

    def problem(self, index: Index) -> str:
        """Return why the box has no control point of this index; empty where it has."""
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


def _sums(u: FloatArray, v: FloatArray, w: FloatArray, lattice: FloatArray) -> FloatArray:
    """Return the sums (m, c) of values (I, J, K, c) times factors (m, I), (m, J), (m, K)."""
    m, (i, j, k, c) = len(u), lattice.shape
    plane = (u @ lattice.reshape(i, -1)).reshape(m, j, k * c)
    line = np.einsum("mj,mjx->mx", v, plane).reshape(m, k, c)
    return np.einsum("mk,mkc->mc", w, line)


def lattice(corners: FloatArray, degrees: Index) -> FloatArray:
    """Return the regular control points (I, J, K, 3) between corners (8, 3), trilinear."""
    u, v, w = (np.linspace(0.0, 1.0, degree + 1) for degree in degrees)
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

    Raises
    ------
    CaseError
        A degree or an order is not possible, or the corners in this order enclose no volume.
    """
    for letter, degree in zip("ijk", degrees, strict=True):
        if degree < 1:
            raise CaseError(f"the degree of {letter} is {degree}; needed is 1 or more")
    for letter, order, degree in zip("ijk", orders or (2, 2, 2), degrees, strict=True):
        if not 2 <= order <= degree + 1:
            raise CaseError(
                f"the B-splines of {letter} have the order {order}, and {degree + 1} control "
                f"points; needed is an order from 2 to {degree + 1}"
            )
    control = system.points_of(lattice(system.q_of(corners), degrees))
    box = Box(name, control, orders, corners, system=system)
    ends = np.array(list(product((0.0, 0.5, 1.0), repeat=3)))
    volume = np.linalg.det(box.slopes(ends))
    # The box may be left-handed, and sides may shrink to an edge.
    if volume.min() < 0.0 < volume.max() or not volume.any():
        raise CaseError(
            "the corners enclose no volume in their order; needed are those of the bottom "
            "counter-clockwise, then those above them"
        )
    return box


def plane_corners(corners: FloatArray) -> FloatArray:
    """Return the corners (8, 3) of a box in 2D from its corners (4, 2) in the plane."""
    return np.concatenate([np.column_stack([corners, np.full(4, z)]) for z in (-HALF, HALF)])
