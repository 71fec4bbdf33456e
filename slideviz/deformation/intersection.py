"""Intersection check: refuses motions that put boundaries through each other, before solving."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, floor, pi

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.axis_frame import axis_basis, in_axis_frame
from slideviz.mesh.cached_boundary import boundary_of, shell_of
from slideviz.mesh.caching import njit
from slideviz.mesh.crossing import Crossing, first_crossing, self_crossing, swept_crossing
from slideviz.mesh.fans import components
from slideviz.mesh.jacobians import cross3, dot3
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh, sealed
from slideviz.mesh.periodic import pair_up
from slideviz.mesh.threads import PART, in_parts
from slideviz.mesh.topology import facet_vectors, unit

MOST = 30_000
"""Facets that are compared with each other while somebody waits: three seconds."""
LOOKED_AT = 5
"""Facets of a moved body that are asked whether they are inside; one that is will do."""
BESIDE = 1e-4
"""How far off its surface, in sizes of a facet, the mesh beside a body is looked for."""
OPEN = 0.1
"""What the winding of markers may miss of 1 where they are closed but for small gaps."""
HALF = 0.5
"""Winding between those of inside and outside."""


def intersection_message(
    case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray
) -> str | None:
    """Return a sentence when a moved boundary ends up inside another one or out of the mesh.

    None when all is well. Boundaries that share nodes are not compared: where a blade stands on a
    sliding hub, both lie on the same curved surface only roughly. Nor are those that move along:
    internal ones, and periodic ones with periodic displacement.

    Parameters
    ----------
    nodes, vectors : (k,), (k, d)
        The displacement of the moving nodes.
    """
    after = np.array(mesh.points)
    after[nodes] += vectors
    for name in _movers(case, mesh, nodes, vectors):
        hit = _new_crossing(mesh, after, mesh.marker(name).cells, _others(case, mesh, name))
        if hit is not None:
            return (
                f"the motion puts {name} through {hit.marker} near {_place(hit)}; move {name} "
                f"less, or {_giving_way(case, hit.marker)}"
            )
    return _outside(case, mesh, nodes, after)


def _movers(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> list[str]:
    """Return the moving markers, last those of which most nodes stay where they are."""
    still = np.ones(len(mesh.points), bool)
    still[nodes] = ~vectors.any(axis=1)
    stays = {n: still[mesh.marker(n).nodes].sum() for n in case.markers_with("moving")}
    return sorted(stays, key=lambda name: bool(2 * stays[name] > len(mesh.marker(name).nodes)))


def _giving_way(case: Case, wall: str) -> str:
    """Return what would let a boundary move with the one that goes through it."""
    if case.roles.get(wall) == "periodic":
        mode = "fixed" if case.sliding == "none" else "moving"
        return f"choose PERIODIC_MODE= {mode}, with which {wall} moves along"
    return f"let {wall} move with it (role moving, internal or periodic)"


def _new_crossing(
    mesh: Mesh, after: FloatArray, moved: Cells, others: list[tuple[str, Cells]]
) -> Crossing | None:
    """Return where a moved boundary goes through one that it did not cross before.

    Twisted quadrilaterals close to each other do, for each is taken for two triangles.
    """
    while (hit := first_crossing(after, moved, others)) is not None:
        wall = [(name, cells) for name, cells in others if name == hit.marker]
        if first_crossing(mesh.points, moved, wall) is None:
            return hit
        others = [(name, cells) for name, cells in others if name != hit.marker]
    return None


def jump_message(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> str | None:
    """Return a sentence when a moved node crosses another boundary on its straight way."""
    after = np.array(mesh.points)
    after[nodes] += vectors
    for name in case.markers_with("moving"):
        others = _others(case, mesh, name)
        hit = swept_crossing(mesh.points, after, mesh.marker(name).cells, others)
        if hit is not None:
            return (
                f"{name} goes through {hit.marker} near {_place(hit)} on its way; cells will be "
                "inverted there, unless its real path is not straight and goes around"
            )
    return None


def folding_message(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> str | None:
    """Return a sentence when what moves goes through itself, where it did not before.

    Of more than ``MOST`` facets that is not asked.
    """
    after = np.array(mesh.points)
    after[nodes] += vectors
    names = _movers(case, mesh, nodes, vectors)
    parts = [mesh.marker(name).cells for name in names]
    if not 0 < sum(map(len, parts)) <= MOST:
        return None
    types, corners = ([getattr(p, name) for p in parts] for name in ("types", "connectivity"))
    body = Cells.from_types(np.concatenate(types), np.concatenate(corners))
    hit = self_crossing(after, body)
    if hit is None or self_crossing(mesh.points, body) is not None:
        return None
    ends = np.cumsum([len(part) for part in parts])
    first, other = (names[k] for k in sorted(np.searchsorted(ends, hit[1:], "right")))
    where = "itself" if first == other else other
    place = ", ".join(f"{value:.4g}" for value in hit[0])
    return f"{first} goes through {where} near ({place}); cells will be inverted there"


def _outside(case: Case, mesh: Mesh, nodes: IntArray, after: FloatArray) -> str | None:
    """Return a sentence when a body is beyond the boundaries as a whole, however it came there.

    What only reaches out of them crosses one.
    """
    boundary = boundary_of(mesh)
    for name in case.markers_with("moving"):
        mine = boundary.facets[boundary.marker == boundary.names.index(name)]
        mine = mine[np.isin(mine, nodes).all(axis=1)]
        found, here = np.unique(mine, return_inverse=True)
        here = here.reshape(mine.shape)
        label = components(len(found), here[:, :-1].ravel(), here[:, 1:].ravel())[here[:, 0]]
        for body in np.unique(label):
            if not _is_lost(case, mesh, after, mine[label == body]):
                continue
            others = _others(case, mesh, name)
            hit = swept_crossing(mesh.points, after, mesh.marker(name).cells, others)
            if hit is None and "internal" in case.roles.values():
                continue  # it left through one that gives way
            way = f", through {hit.marker} near {_place(hit)}" if hit else ""
            return (
                f"the motion takes {name} out of the mesh{way}; move {name} less, or let the "
                "boundaries around it move with it"
            )
    return None


def _is_lost(case: Case, mesh: Mesh, after: FloatArray, facets: IntArray) -> bool:
    """Tell whether all of a moved body (k, c) is out of the mesh and of its periodic images."""
    some = facets[np.linspace(0, len(facets) - 1, LOOKED_AT).astype(np.int64)]
    before, there = (_beside(points, some) for points in (mesh.points, after))
    whole = boundary_of(mesh).facets
    # A surface with holes has no inside.
    if abs(winding(mesh.points, whole, before[:1])[0] - 1.0) > OPEN:
        whole = shell_of(mesh)
    # Beside twisted facets, which are taken for triangles, a point may be on the wrong side.
    there = there[[not _is_out(whole, mesh.points, point[None]) for point in before]]
    if not len(there) or not _is_out(whole, after, there):
        return False
    others = np.setdiff1d(whole, facets)
    return all(_is_out(whole, after, image) for image in _images(case, mesh, there, after[others]))


def _beside(points: FloatArray, facets: IntArray) -> FloatArray:
    """Return a point (k, d) of the mesh close to the middle of each facet (k, c)."""
    # Three corners are in one plane.
    facets = facets if facets.shape[1] == 2 else facets[:, [0, 1, 2, 2]]
    vectors = facet_vectors(points, facets)
    sizes = np.linalg.norm(vectors, axis=1) ** (1.0 / (points.shape[1] - 1))
    corners = points[facets[:, : points.shape[1]]]
    return np.asarray(corners.mean(axis=1) - BESIDE * sizes[:, None] * unit(vectors))


def _is_out(facets: IntArray, points: FloatArray, at: FloatArray) -> bool:
    """Tell whether all points are outside of a closed surface."""
    return all(winding(points, facets, point[None])[0] < HALF for point in at)


def _images(case: Case, mesh: Mesh, at: FloatArray, around: FloatArray) -> Iterator[FloatArray]:
    """Yield the images of points (m, d) that may be within points ``around`` (n, d), by periods."""
    names = case.markers_with("periodic")
    if case.periodic not in ("fixed", "moving") or not names:
        return
    pair = pair_up(mesh, names, case.periodic_type, case.axis, case.origin)[0]
    if pair.kind == "translational":
        along = pair.vector / pair.period**2
        far, place = at @ along, around @ along
        first, last = floor(place.min() - far.max()), ceil(place.max() - far.min())
        for count in range(first, last + 1):
            yield at + float(count) * pair.vector
        return
    basis = axis_basis(pair.axis)
    local = in_axis_frame(at, pair.axis, pair.origin)
    for count in range(1, ceil(pi / pair.period) + 1):
        for angle in (count * pair.angle, -count * pair.angle):
            turned = (local[:, 0] + 1j * local[:, 1]) * np.exp(1j * angle)
            there = np.stack([turned.real, turned.imag, local[:, 2]], axis=1)
            yield (there @ basis + np.asarray(pair.origin))[:, : mesh.dim]


def _others(case: Case, mesh: Mesh, moved: str) -> list[tuple[str, Cells]]:
    """Return the boundaries that a moving one must not enter."""
    own = mesh.marker(moved).nodes
    passable = ("internal", "periodic") if case.periodic in ("fixed", "moving") else ("internal",)
    return [
        (marker.name, marker.cells)
        for marker in mesh.markers
        if marker.name != moved
        and case.roles.get(marker.name, "fixed") not in passable
        and not np.isin(marker.nodes, own).any()
    ]


def _place(hit: Crossing) -> str:
    return f"({', '.join(f'{value:.4g}' for value in hit.point)})"


def winding(points: FloatArray, facets: IntArray, at: FloatArray) -> FloatArray:
    """Return how often a surface winds around each point, (m,): 1 inside it, 0 outside.

    Whole numbers for a closed surface, whatever its shape; near them where it has small gaps.

    Parameters
    ----------
    points : (n, d) float64
    facets : (f, k) int64
        The surface, its normals outwards: k = 2 in 2D; 4 in 3D, where a triangle repeats its last
        node. (``Boundary.facets``)
    at : (m, d) float64
        Points that are not on it.

    Notes
    -----
    The sum of the angles that the facets are seen at: in 3D solid ones, by Van Oosterom and
    Strackee (IEEE Trans. Biomed. Eng. 30, 1983), of two triangles for each quadrilateral.
    """
    if facets.shape[1] == 2:
        return np.array([_plane(points[facets] - p) for p in at])
    return np.array([_space(points, facets, p) for p in at])


def _plane(arms: FloatArray) -> float:
    """Return the winding of lines with these ends (f, 2, 2) around 0."""
    (a, b), (c, d) = arms[:, 0].T, arms[:, 1].T
    return float(np.arctan2(a * d - b * c, a * c + b * d).sum() / (2.0 * np.pi))


def _space(points: FloatArray, facets: IntArray, p: FloatArray) -> float:
    """Return the winding of facets (f, 4) around a point; sums of parts are added in order."""
    sums = np.zeros(-(-len(facets) // PART))

    def add(part: slice) -> None:
        sums[part.start // PART] = _solid_angles(sealed(points), sealed(facets[part]), p)

    in_parts(add, len(facets))
    return float(sums.sum() / (4.0 * np.pi))


@njit(inline="always", nogil=True, cache=True)
def _arm(points, node, p):  # type: ignore[no-untyped-def]
    return points[node, 0] - p[0], points[node, 1] - p[1], points[node, 2] - p[2]


@njit(nogil=True, cache=True)
def _solid_angles(points, facets, p):  # type: ignore[no-untyped-def]
    """Return the sum of the solid angles of facets (f, 4), each two triangles, seen from ``p``."""
    total = 0.0
    for f in range(len(facets)):
        for k in range(1, 3):
            if facets[f, k] == facets[f, k + 1]:
                continue
            a = _arm(points, facets[f, 0], p)
            b = _arm(points, facets[f, k], p)
            c = _arm(points, facets[f, k + 1], p)
            ab, bc, ca = dot3(a, b), dot3(b, c), dot3(c, a)
            u, v, w = np.sqrt(dot3(a, a)), np.sqrt(dot3(b, b)), np.sqrt(dot3(c, c))
            volume = dot3(a, cross3(b, c))
            total += 2.0 * np.arctan2(volume, u * v * w + ab * w + bc * u + ca * v)
    return total
