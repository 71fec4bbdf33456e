"""Intersection check: refuses motions that put boundaries through each other, before solving."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import ceil, floor, pi

import numpy as np

from slideviz.case.model import Case
from slideviz.case.moving_nodes import moving_nodes
from slideviz.case.spans import periodic_pairs
from slideviz.errors import CaseError, Message, point_words
from slideviz.mesh.axis_frame import axis_basis, in_axis_frame
from slideviz.mesh.cached_boundary import boundary_of, shell_of
from slideviz.mesh.crossing import (
    Crossing,
    fanned,
    first_crossing,
    self_crossing,
    swept_crossing,
)
from slideviz.mesh.fans import components
from slideviz.mesh.jacobians import cross3, dot3
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh, row_norms, sealed
from slideviz.mesh.topology import facet_vectors, unit
from slideviz.solver.domain import find_period
from slideviz.system.jit_cache import njit
from slideviz.system.threads import PART, in_parts

MOST = 30_000
"""Most facets of moving boundaries that are tested for crossing each other: takes three seconds."""
LOOKED_AT = 5
"""Facets of a moved body that are tested; the body is in the mesh where one of them is."""
ARCS = 16  # places on the way of nodes that move on arcs, between which it is taken as straight
ROUNDING = 1e-9
"""Part of the largest displacement by which an affine motion may differ from its matrix."""
BESIDE = 1e-4  # distance from a facet of a point in the cells beside it, over the size of the facet
OPEN = 0.1
"""The markers form a closed surface, but for small gaps, where their winding around a point inside
differs from 1 by no more than this."""
Others = list[tuple[str, Cells]]  # names and elements of boundaries
Path = Sequence[FloatArray]  # all points (n, d) at places of a motion, the first before it
HALF = 0.5  # a point is outside of a surface that winds around it less often than this


def intersection_message(
    case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray
) -> str | None:
    """Return a sentence when a moved boundary crosses another one or ends up out of the mesh.

    None when it does neither. Boundaries that share nodes are not compared: a blade and the hub on
    which it slides have a common line, but the facets of a curved hub only come near to it.
    Nor are boundaries that give way: internal ones, and periodic ones that are displaced.
    ``nodes`` and ``vectors`` (k,), (k, d): the moving nodes and their displacement.
    """
    after = np.array(mesh.points)
    after[nodes] += vectors
    for name in _movers(case, mesh, nodes, vectors):
        hit, _ = _first_new(_at_end, mesh, (mesh.points, after), name, _others(case, mesh, name))
        if hit is not None:
            return (
                f"the motion puts {name} through {hit.marker} near {_place(hit)}; move {name} "
                f"less, or {_giving_way(case, hit.marker)}"
            )
    return _outside(case, mesh, nodes, after)


def _movers(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> list[str]:
    """Return the names of the moving markers, last those with most nodes at zero displacement."""
    still = np.ones(len(mesh.points), bool)
    still[nodes] = ~vectors.any(axis=1)
    stays = {n: still[mesh.marker(n).nodes].sum() for n in case.markers_with("moving")}
    return sorted(stays, key=lambda name: bool(2 * stays[name] > len(mesh.marker(name).nodes)))


def _giving_way(case: Case, wall: str) -> str:
    """Return words on how to let the boundary ``wall`` move with the one that goes through it."""
    if case.roles.get(wall) == "periodic":
        mode = "fixed" if case.sliding == "none" else "moving"
        return f"choose PERIODIC_MODE= {mode}, with which {wall} moves along"
    return f"let {wall} move with it (role moving, internal or periodic)"


def _at_end(path: Path, moved: Cells, others: Others) -> Crossing | None:
    return first_crossing(path[-1], moved, others)


def _on_way(path: Path, moved: Cells, others: Others) -> Crossing | None:
    hits = (swept_crossing(*pair, moved, others) for pair in pairwise(path))
    return next(filter(None, hits), None)


def _first_new(
    find: Callable[[Path, Cells, Others], Crossing | None],
    mesh: Mesh,
    path: Path,
    name: str,
    others: Others,
) -> tuple[Crossing | None, Others]:
    """Return where a moved boundary crosses one that it did not cross before the motion, or None.

    With it those of the ``others`` that are left: twisted quadrilaterals close to each other, each
    taken as two triangles, may cross before the motion, or where those `fanned` do not.
    ``find``: returns the first crossing.
    """
    moved = mesh.marker(name).cells
    while (hit := find(path, moved, others)) is not None:
        wall = next(cells for other, cells in others if other == hit.marker)
        if first_crossing(mesh.points, moved, [(hit.marker, wall)]) is None:
            fans = [fanned(points, (moved, wall)) for points in path]
            body, side = fans[0][1]
            if find([points for points, _ in fans], body, [(hit.marker, side)]) is not None:
                break
        others = [other for other in others if other[0] != hit.marker]
    return hit, others


def jump_message(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> str | None:
    """Return a sentence when a moved node crosses another boundary on its way, or None.

    None too where it crosses none on an arc (`_arcs`): steps go straight, but a body that turns
    beside a curved wall can come out right. Boundaries that cross before the motion, as twisted
    quadrilaterals close to each other may, are not compared. Parameters are those of
    `intersection_message`.
    """
    after = np.array(mesh.points)
    after[nodes] += vectors
    for name in case.markers_with("moving"):
        straight = (mesh.points, after)
        hit, others = _first_new(_on_way, mesh, straight, name, _others(case, mesh, name))
        if hit is not None and (arcs := _arcs(case, mesh, nodes, vectors)):
            hit, _ = _first_new(_on_way, mesh, (mesh.points, *arcs), name, others)
        if hit is not None:
            return (
                f"the motion takes {name} through {hit.marker} near {_place(hit)} on its way; move "
                f"{name} less, around {hit.marker} in several runs, or "
                f"{_giving_way(case, hit.marker)}"
            )
    return None


def _arcs(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> list[FloatArray]:
    """Return the points (n, d) at ``ARCS`` places of their path; none if it is straight.

    The path is an arc in a cylindrical frame, about its axis, and for motions that rotate.
    """
    frame = find_period(case, mesh, boundary_of(mesh))[1]
    at = mesh.points[nodes]
    parts = np.arange(1, ARCS + 1) / ARCS
    if frame.cylindrical:
        start = frame.coords(at)
        shift = frame.difference(at, vectors)
        places = [frame.points(start + part * shift) for part in parts]
    elif any(motion.turned(0.0) is not motion for motion in case.motions):
        try:
            still = _turned(case, mesh, 0.0)
            turned = [_turned(case, mesh, part) for part in parts]
        except CaseError:
            return []  # markers with common nodes turn differently
        if not np.array_equal(turned[-1], vectors):
            return []  # the displacements are not those of the motions
        places = [
            at + there - (1.0 - part) * still for part, there in zip(parts, turned, strict=True)
        ]
    else:
        return []
    path = [np.array(mesh.points) for _ in places]
    for points, there in zip(path, places, strict=True):
        points[nodes] = there
    return path


def _turned(case: Case, mesh: Mesh, part: float) -> FloatArray:
    """Return the displacements (k, d) of the motions, with a part of all turns."""
    motions = tuple(motion.turned(part) for motion in case.motions)
    return moving_nodes(case.change(motions=motions), mesh).vectors


def folding_message(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> Message | None:
    """Return a message when moving boundaries cross themselves or each other after the motion.

    None when they do not, when they did so before, or when they have more than ``MOST`` facets.
    """
    if not vectors.any() or _affine(mesh.points[nodes], vectors):
        return None
    after = np.array(mesh.points)
    after[nodes] += vectors
    names = _movers(case, mesh, nodes, vectors)
    parts = [mesh.marker(name).cells for name in names]
    if not 0 < sum(map(len, parts)) <= MOST:
        return None
    body = Cells.joined(parts)
    hit = self_crossing(after, body)
    if hit is None or self_crossing(mesh.points, body) is not None:
        return None
    points, fans = fanned(after, (body,))
    if self_crossing(points, fans[0]) is None:
        return None
    ends = np.cumsum([len(part) for part in parts])
    one, two = sorted(np.searchsorted(ends, hit[1:], "right"))
    first = names[one]
    other = names[two]
    where = "itself" if first == other else other
    place = point_words(hit[0], mesh.extent, digits=4)
    rule = f"{first} goes through {where} near ({place}), so cells will overlap there"
    return Message(rule, "more steps cannot help: move it otherwise, or move it less")


def _affine(points: FloatArray, vectors: FloatArray) -> bool:
    terms = np.column_stack([points - points.mean(axis=0), np.ones(len(points))])
    found = np.linalg.lstsq(terms, vectors)[0]
    tolerance = ROUNDING * np.abs(vectors).max(initial=0.0)
    keeps_sides = np.linalg.det(np.eye(points.shape[1]) + found[:-1]) > 0.0
    return bool(keeps_sides and np.abs(terms @ found - vectors).max(initial=0.0) <= tolerance)


def _outside(case: Case, mesh: Mesh, nodes: IntArray, after: FloatArray) -> str | None:
    """Return a sentence when a whole moving body is out of the mesh, whatever its way, or None.

    A body is a connected part of a moving marker. One that is partly out crosses a boundary.
    """
    boundary = boundary_of(mesh)
    for name in case.markers_with("moving"):
        facets = boundary.facets[boundary.marker == boundary.names.index(name)]
        facets = facets[np.isin(facets, nodes).all(axis=1)]
        found, here = np.unique(facets, return_inverse=True)
        here = here.reshape(facets.shape)
        label = components(len(found), here[:, :-1].ravel(), here[:, 1:].ravel())[here[:, 0]]
        for body in np.unique(label):
            if not _is_lost(case, mesh, after, facets[label == body]):
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
    """Return whether a moved body, of facets (k, c), is out of the mesh and its periodic images."""
    some = facets[np.linspace(0, len(facets) - 1, LOOKED_AT).astype(np.int64)]
    before = _beside(mesh.points, some)
    there = _beside(after, some)
    shell = boundary_of(mesh).facets
    # The markers have holes, so that they have no inside: take all sides of one cell alone.
    if abs(winding_number(mesh.points, shell, before[0]) - 1.0) > OPEN:
        shell = shell_of(mesh)
    left = []
    for start, end in zip(before, there, strict=True):
        # Beside twisted facets, which are taken for triangles, a point may be on the wrong side.
        if _is_out(shell, mesh.points, start[None]):
            continue
        if not _is_out(shell, after, end[None]):
            return False
        left.append(end)
    others = np.setdiff1d(shell, facets)
    images = _images(case, mesh, np.array(left), after[others]) if left else ()
    return bool(left) and all(_is_out(shell, after, image) for image in images)


def _beside(points: FloatArray, facets: IntArray) -> FloatArray:
    """Return a point (k, d) inside the mesh, close to the middle of each facet (k, c)."""
    # Of a quadrilateral the first three nodes, which are in one plane.
    facets = facets if facets.shape[1] == 2 else facets[:, [0, 1, 2, 2]]
    vectors = facet_vectors(points, facets)
    sizes = row_norms(vectors) ** (1.0 / (points.shape[1] - 1))
    corners = points[facets[:, : points.shape[1]]]
    return np.asarray(corners.mean(axis=1) - BESIDE * sizes[:, None] * unit(vectors))


def _is_out(facets: IntArray, points: FloatArray, at: FloatArray) -> bool:
    """Return whether all points ``at`` (m, d) are outside of a closed surface of facets (f, k)."""
    return all(winding_number(points, facets, point) < HALF for point in at)


def _images(case: Case, mesh: Mesh, at: FloatArray, around: FloatArray) -> Iterator[FloatArray]:
    """Yield the periodic images (m, d) of points ``at`` that may lie among ``around`` (n, d).

    A translational image is left out where its range along the period misses that of ``around``.
    """
    pairs = periodic_pairs(case, mesh) if case.periodic in ("fixed", "moving") else ()
    if not pairs:
        return
    pair = pairs[0]
    if pair.kind == "translational":
        along = pair.vector / pair.period**2
        far = at @ along
        place = around @ along
        first = floor(place.min() - far.max())
        last = ceil(place.max() - far.min())
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


def _others(case: Case, mesh: Mesh, moved: str) -> Others:
    """Return names and elements of the boundaries that the moving marker ``moved`` must not cross.

    These share no node with it, and do not give way (`intersection_message`).
    """
    nodes = mesh.marker(moved).nodes
    passable = ("internal", "periodic") if case.periodic in ("fixed", "moving") else ("internal",)
    return [
        (marker.name, marker.cells)
        for marker in mesh.markers
        if marker.name != moved
        and case.roles.get(marker.name, "fixed") not in passable
        and not np.isin(marker.nodes, nodes).any()
    ]


def _place(hit: Crossing) -> str:
    return f"({point_words(hit.point, digits=4)})"


def winding_number(points: FloatArray, facets: IntArray, p: FloatArray) -> float:
    """Return the winding number of a surface around a point: 1 inside it, 0 outside.

    An integer, but for rounding, for any closed surface; close to one where it has small gaps. It
    is the sum of the signed angles under which the point sees the facets, over the full angle: in
    3D the solid angles of two triangles for each quadrilateral, by Van Oosterom and Strackee (IEEE
    Trans. Biomed. Eng. 30, 1983).
    ``facets`` (f, k): the surface, its normals outwards, as of a ``Boundary``.
    ``p`` (d,): a point that is not on it.
    """
    if facets.shape[1] == 2:
        a, b, c, d = (points[facets] - p).reshape(-1, 4).T
        return float(np.arctan2(a * d - b * c, a * c + b * d).sum() / (2.0 * np.pi))
    # The sums of the parts are added in order: the bits do not depend on the number of threads.
    sums = np.zeros(-(-len(facets) // PART))

    def add(part: slice) -> None:
        sums[part.start // PART] = _solid_angles(sealed(points), sealed(facets[part]), p)

    in_parts(add, len(facets))
    return float(sums.sum() / (4.0 * np.pi))


@njit(inline="always")
def _arm(points, node, p):  # type: ignore[no-untyped-def]
    return points[node, 0] - p[0], points[node, 1] - p[1], points[node, 2] - p[2]


@njit
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
            ab = dot3(a, b)
            bc = dot3(b, c)
            ca = dot3(c, a)
            u = np.sqrt(dot3(a, a))
            v = np.sqrt(dot3(b, b))
            w = np.sqrt(dot3(c, c))
            volume = dot3(a, cross3(b, c))
            total += 2.0 * np.arctan2(volume, u * v * w + ab * w + bc * u + ca * v)
    return total
