"""Which planes of control points SU2 holds, so that a surface stays smooth where it leaves a box.

FFD_CONTINUITY: the sides of a box that a moving boundary passes through are held, with none, one or
two planes beside them. A variable that moves a control point of a held plane does nothing; one that
moves all of an index does (SU2 8, ``CheckFFDIntersections``).
"""

from __future__ import annotations

import numpy as np

from slideviz.case.words import list_of
from slideviz.design.su2_config import CONTINUITIES, Su2Config
from slideviz.ffd.box import Box
from slideviz.mesh.model import FloatArray, Mesh

Planes = tuple[set[int], set[int], set[int]]


def held_planes(config: Su2Config, mesh: Mesh, box: Box, continuity: str) -> Planes:
    """Return the held planes of each direction, with a value of FFD_CONTINUITY."""
    degrees = box.degrees
    held: Planes = (set(), set(), set())
    depth = CONTINUITIES[continuity]
    if not depth:
        for planes, letter, degree in zip(held, "IJK", degrees, strict=True):
            given = {int(word.text) for word in list_of(config.words[f"FFD_FIX_{letter}"])}
            planes |= {plane for plane in given if plane <= degree}
        return held
    ends = _edges(mesh, config.markers)
    symmetric = config.words["FFD_SYMMETRY_PLANE"].upper() == "YES" and mesh.dim == 3
    for axis, (planes, degree) in enumerate(zip(held, degrees, strict=True)):
        if (mesh.dim == 2 and axis == 2) or (symmetric and axis == 1):
            continue
        if depth == CONTINUITIES["2ND_DERIVATIVE"] and degree < 2:
            continue
        for first, inwards in ((0, 1), (degree, -1)):
            side = np.take(box.points, first, axis=axis)
            corners = side[[0, 0, -1, -1], [0, -1, 0, -1]]
            if _meets(ends, corners):
                planes |= {first + inwards * k for k in range(depth)}
        planes &= set(range(degree + 1))
    return held


def _edges(mesh: Mesh, markers: tuple[str, ...]) -> FloatArray:
    """Return the ends of all segments between two nodes of a facet, (e, 2, d)."""
    pairs = []
    for name in markers:
        for _, nodes in mesh.marker(name).cells.by_type.values():
            first, second = np.triu_indices(nodes.shape[1], 1)
            pairs.append(np.stack([nodes[:, first].ravel(), nodes[:, second].ravel()], axis=1))
    every = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    return np.asarray(mesh.points[every])


def _meets(ends: FloatArray, corners: FloatArray) -> bool:
    """Tell whether a segment meets a side with corners (4, 3): two triangles, or in 2D a line."""
    if ends.shape[2] == 2:
        return _crossed(ends, corners[0, :2], corners[2, :2])
    return _pierced(ends, corners[[0, 1, 2]]) or _pierced(ends, corners[[3, 2, 1]])


def _crossed(ends: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Tell whether a segment (e, 2, 2) meets the one between two points."""

    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    start, end = ends[:, 0], ends[:, 1]
    across = side(one, other, start) * side(one, other, end) <= 0.0
    between = side(start, end, one) * side(start, end, other) <= 0.0
    # Two that lie on one line have nothing on either side.
    apart = (side(one, other, start) == 0.0) & (side(one, other, end) == 0.0)
    return bool((across & between & ~apart).any())


def _pierced(ends: FloatArray, triangle: FloatArray) -> bool:
    """Tell whether a segment (e, 2, 3) meets a triangle (3, 3)."""
    u, v = triangle[1] - triangle[0], triangle[2] - triangle[0]
    normal = np.cross(u, v)
    start, along = ends[:, 0] - triangle[0], ends[:, 1] - ends[:, 0]
    height, rise = start @ normal, along @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        part = -height / rise
        at = start + part[:, None] * along
    area = float(normal @ normal)
    a = np.cross(at, v) @ normal / area
    b = np.cross(u, at) @ normal / area
    inside = (part >= 0.0) & (part <= 1.0) & (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)
    return bool(inside.any())
