"""Planes of control points that SU2 holds, so that a surface stays smooth where it leaves a box.

FFD_CONTINUITY: the sides of a box that a moving boundary passes through are held, with none, one or
two planes beside them. A variable that moves a control point of a held plane has no effect; one
that moves all control points of an index (-1) has (SU2 8, ``CheckFFDIntersections``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.case.words import list_of
from slideviz.design.su2.config import CONTINUITIES, SU2_CONTINUITY, Su2Config
from slideviz.design.su2.variables import DesignVariable
from slideviz.ffd.box import Box
from slideviz.mesh.model import FloatArray, Mesh

Planes = tuple[set[int], set[int], set[int]]
"""Indices of planes of control points in each direction i, j, k of a box."""


def held_planes(config: Su2Config, mesh: Mesh, box: Box, continuity: str) -> Planes:
    """Return the planes of a box that are held; ``continuity`` is a value of FFD_CONTINUITY."""
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
    """Return the ends (e, 2, d) of all segments between two nodes of a facet of some markers."""
    pairs = []
    for name in markers:
        for _, nodes in mesh.marker(name).cells.by_type.values():
            first, second = np.triu_indices(nodes.shape[1], 1)
            pairs.append(np.stack([nodes[:, first].ravel(), nodes[:, second].ravel()], axis=1))
    every = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    return np.asarray(mesh.points[every])


def _meets(ends: FloatArray, corners: FloatArray) -> bool:
    """Tell whether any segment (e, 2, d) meets the side of a box with ``corners`` (4, 3).

    In 3D the side is two triangles, in 2D a line.
    """
    if ends.shape[2] == 2:
        return _crossed(ends, corners[0, :2], corners[2, :2])
    return _pierced(ends, corners[[0, 1, 2]]) or _pierced(ends, corners[[3, 2, 1]])


def _crossed(ends: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Tell whether any segment (e, 2, 2) meets the one from ``one`` to ``other``."""

    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    start, end = ends[:, 0], ends[:, 1]
    across = side(one, other, start) * side(one, other, end) <= 0.0
    between = side(start, end, one) * side(start, end, other) <= 0.0
    # Segments on the line itself do not cross it.
    apart = (side(one, other, start) == 0.0) & (side(one, other, end) == 0.0)
    return bool((across & between & ~apart).any())


def _pierced(ends: FloatArray, triangle: FloatArray) -> bool:
    """Tell whether any segment (e, 2, 3) meets a triangle (3, 3)."""
    u, v = triangle[1] - triangle[0], triangle[2] - triangle[0]
    normal = np.cross(u, v)
    start, along = ends[:, 0] - triangle[0], ends[:, 1] - ends[:, 0]
    height, rise = start @ normal, along @ normal
    # Whether it gets to the plane of the triangle; one within the plane pierces nothing.
    reaches = (np.abs(height) <= np.abs(rise)) & (height * rise <= 0.0) & (rise != 0.0)
    at = start[reaches] - (height[reaches] / rise[reaches])[:, None] * along[reaches]
    area = float(normal @ normal)
    a = np.cross(at, v) @ normal / area
    b = np.cross(u, at) @ normal / area
    return bool(((a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)).any())


def idle_variables(
    config: Su2Config, mesh: Mesh, boxes: dict[str, Box]
) -> tuple[tuple[bool, ...], list[str]]:
    """Return for each variable whether it has no effect, as its control point is held; warnings.

    No variable is without effect where FFD_CONTINUITY is not given, but a warning says which ones
    SU2 would hold.
    """
    asked = config.words["FFD_CONTINUITY"].upper()
    continuity = asked or SU2_CONTINUITY
    held = {name: held_planes(config, mesh, box, continuity) for name, box in boxes.items()}
    idle = tuple(
        any(at in planes for at, planes in zip(_checked(variable), held[variable.box], strict=True))
        for variable in config.variables
    )
    warnings = []
    for name, planes in held.items():
        mine = zip(config.variables, idle, strict=True)
        stuck = [place for place, (v, is_idle) in enumerate(mine, 1) if v.box == name and is_idle]
        if stuck and asked:
            warnings.append(
                f"FFD_CONTINUITY= {asked} holds {_words(planes)} of the box {name}: "
                f"{_listed(stuck)} of DV_KIND will do nothing"
            )
        elif stuck:
            warnings.append(
                f"SU2 would hold {_words(planes)} of the box {name}, since the surface leaves it "
                f"there, by its default FFD_CONTINUITY= {continuity}, so that {_listed(stuck)} of "
                "DV_KIND did nothing; here they move. Write that key to hold them, or "
                "FFD_CONTINUITY= USER_INPUT to hold what FFD_FIX_I, FFD_FIX_J, FFD_FIX_K name"
            )
    return (idle if asked else (False,) * len(idle)), warnings


def _checked(variable: DesignVariable) -> tuple[int, int, int]:
    """Return the index (i, j, k) that SU2 compares with the held planes; k = 0 in 2D."""
    i, j, k = variable.index
    return (i, j, 0) if variable.kind == "FFD_CONTROL_POINT_2D" else (i, j, k)


def _words(held: Sequence[set[int]]) -> str:
    """Return held planes in words: ``i = 0, 1, j = 4``."""
    return ", ".join(
        f"{letter} = {', '.join(map(str, sorted(planes)))}"
        for letter, planes in zip("ijk", held, strict=True)
        if planes
    )


def _listed(places: list[int]) -> str:
    """Return numbers of variables in words, six at most."""
    more = f" and {len(places) - 6} more" if len(places) > 6 else ""
    return f"variable{'s' * (len(places) > 1)} {', '.join(map(str, places[:6]))}{more}"
