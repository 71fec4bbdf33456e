"""The straight span of a wing, or of a blade of a linear cascade: sections are planes.

Coordinates are the lengths (m, h, t) along unit vectors: h along the span, from root to tip; m
along x, or along y where the span is along x, normal to the span; t = m x h, across both. Where
passages repeat by a translation, t is along that, and m across. The span is
``s = (h - h_root) / (h_tip - h_root)``: 0 at the lowest node of the root, 1 at the highest of the
tip. Motions change m and t alone: a root in a plane normal to the span stays in it, to the bit
where the span is along x, y or z.
"""

from __future__ import annotations

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.machine.span import Curves, Distances, Span, facets_of
from slideviz.machine.wall import plane_normal, turn_about_axis
from slideviz.mesh.axis_frame import Triple, along, in_axis_frame
from slideviz.mesh.model import NO_NODES, FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.topology import unit
from slideviz.system.weak_cache import weak_cache

PARALLEL = 1e-6  # largest sine of the angle between directions that are one
EXACT = 1e-12  # components of a wall's unit normal below this are rounding


@record
class StraightSpan(Span):
    """The span along a direction, and the lengths (m, h, t)."""

    axis: Triple
    origin: Triple
    """`axis`, `origin`: the unit direction from root to tip, and a point where the span is 0."""
    basis: FloatArray  # (3, 3): unit vectors along m, h and t as rows
    low: float
    high: float
    """`low`, `high`: h where the span is 0, and 1."""
    middle: float
    radius = 1.0
    holes = NO_NODES.reshape(0, 4)
    words = ("m", "h")
    ends = ("root", "tip")
    about = None
    revolved = True
    level_scale = 1.0

    @property
    def curves(self) -> StraightCurves:
        return StraightCurves(self, 0.0)

    @property
    def first_coords(self) -> FloatArray:
        return self.begin(np.array([0.5]))

    def curves_through(self, start: FloatArray) -> StraightCurves:
        return StraightCurves(self, float(start[0]))

    def meridional(self, points: FloatArray) -> FloatArray:
        return along(self.basis, points)

    def points(self, coords: FloatArray) -> FloatArray:
        return along(self.basis.T, coords)

    def slopes(self, coords: FloatArray) -> FloatArray:
        return np.broadcast_to(self.basis.T, (len(coords), 3, 3))

    def girth(self, coords: FloatArray) -> FloatArray:
        return np.ones(len(coords))

    def branch(self, coords: FloatArray) -> FloatArray:
        return coords

    def shift(self, pair: Pair) -> float:
        step = float(pair.vector @ self.basis[2])
        return step if abs(step) > PARALLEL * pair.period else 0.0

    def begin(self, spans: FloatArray) -> FloatArray:
        h = self.low + spans * (self.high - self.low)
        return np.column_stack([np.zeros(len(spans)), h, np.full(len(spans), self.middle)])

    def distances(self, coords: FloatArray) -> list[Distances]:
        h = coords[:, 1]
        up = np.zeros((len(h), 2))
        up[:, 1] = 1.0
        return [(h - self.low, up, 0.0 * h), (self.high - h, -up, 0.0 * h)]


@record
class StraightCurves(Curves):
    """Straight lines along m: m' and m are both the length from ``start``."""

    field: StraightSpan
    start: float

    def plane(self, coords: FloatArray) -> FloatArray:
        m, h, t = coords.T
        field = self.field
        return np.stack([m - self.start, t, (h - field.low) / (field.high - field.low)], axis=1)

    def length(self, plane: FloatArray) -> FloatArray:
        return plane[:, 0]

    def at_length(self, m: FloatArray, span: FloatArray) -> FloatArray:
        return m

    def growth(self, m_prime: FloatArray, span: FloatArray) -> FloatArray:
        return np.ones(len(m_prime))

    def traced(self, plane: FloatArray) -> FloatArray:
        h = self.field.low + plane[:, 2] * (self.field.high - self.field.low)
        return np.stack([plane[:, 0] + self.start, h], axis=1)

    def coords_and_slopes(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        by = np.zeros((len(plane), 3, 2))
        by[:, 0, 0] = 1.0
        by[:, 2, 1] = 1.0
        return np.column_stack([self.traced(plane), plane[:, 1]]), by


def are_parallel(one: FloatArray, other: FloatArray) -> bool:
    """Return whether two directions (3,) are the same or opposite."""
    return float(np.linalg.norm(np.cross(one, other))) <= PARALLEL * float(
        np.linalg.norm(one) * np.linalg.norm(other)
    )


@weak_cache
def flat_normal(mesh: Mesh, name: str) -> FloatArray | None:
    """Return the unit normal (3,) of a flat boundary of a 3D mesh, without a sign; else None."""
    normal = plane_normal(mesh.points, facets_of(mesh, name))
    if normal is None:
        return None
    normal = unit(np.where(np.abs(normal) < EXACT, 0.0, normal))
    return normal * np.sign(normal[np.argmax(np.abs(normal))])


@weak_cache
def straight_direction(
    mesh: Mesh, root: str, tip: str, free: bool, axis: Triple, origin: Triple
) -> Triple | None:
    """Return the direction of the span between boundaries that have no axis; None if they have.

    The root must be flat, as must the tip, parallel to it, unless it is ``free``: a part of the
    wing. ``axis``, ``origin``: of the axis about which they may turn.
    """
    normal = flat_normal(mesh, root)
    if mesh.dim != 3 or normal is None:
        return None
    names = (root,) if free else (root, tip)
    other = normal if free else flat_normal(mesh, tip)
    tables = [facets_of(mesh, name) for name in names]
    if other is None or not are_parallel(normal, other):
        return None
    if turn_about_axis(in_axis_frame(mesh.points, axis, origin), tables):
        return None
    x, y, z = normal.tolist()
    return x, y, z


@weak_cache
def find_straight_span(
    mesh: Mesh, root: str, tip: str, direction: Triple, pitch: Triple | None = None
) -> StraightSpan:
    """Return the span along a direction, of either sign, from one boundary of a 3D mesh to another.

    ``pitch``: the translation by which passages repeat. Cached as long as the mesh lives. Raises
    MeshError if the mesh is 2D, a boundary is unknown or empty, or both are at one place.
    """
    if mesh.dim != 3:
        raise MeshError(f"{mesh.name}: the span between two boundaries needs a mesh in 3D")
    way = unit(np.array(direction) / np.abs(direction).max())
    first = mesh.points[np.unique(facets_of(mesh, root))]
    last = mesh.points[np.unique(facets_of(mesh, tip))]
    if root != tip and (last @ way).mean() < (first @ way).mean():
        way = -way
    low = float(along(way[None], first).min())
    high = float(along(way[None], last).max())
    if not high - low > PARALLEL * mesh.extent:
        raise MeshError(
            f"{mesh.name}: {root!r} and {tip!r} have no distance along "
            f"({', '.join(f'{v:.6g}' for v in way)}), so there is no span between them; name two "
            "boundaries in SPAN, or another direction in SPAN_AXIS"
        )
    flow = np.eye(3)[int(abs(way[0]) > 0.9)]
    if pitch is not None and not are_parallel(np.array(pitch), way):
        flow = np.cross(np.array(pitch), way)
        flow = flow * np.sign(flow[np.argmax(np.abs(flow))])
    flow = unit(flow - (flow @ way) * way)
    basis = np.stack([flow, way, np.cross(flow, way)]) + 0.0
    origin = tuple((low * way + 0.0).tolist())
    t = along(basis[2:], first)
    middle = 0.5 * float(t.min() + t.max())
    return StraightSpan(tuple((way + 0.0).tolist()), origin, basis, low, high, middle)
