"""Planes of control points that SU2 holds, so that a surface stays smooth where it leaves a box.

FFD_CONTINUITY: the sides of a box that a moving boundary passes through are held, with none, one or
two planes beside them (SU2 8, ``CheckFFDIntersections``). Which variables heed them, and how, is in
`slideviz.ffd.kinds`.
"""

from __future__ import annotations

import numpy as np

from slideviz.case.words import list_of
from slideviz.design.su2.config import CONTINUITIES, SU2_CONTINUITY, Su2Config
from slideviz.design.su2.variables import DesignVariable
from slideviz.ffd.box import Box
from slideviz.ffd.kinds import DIRECTIONS, NONE, Move, Planes, Request, moves_of
from slideviz.mesh.model import FloatArray, Mesh


def held_planes(config: Su2Config, mesh: Mesh, box: Box, continuity: str) -> Planes:
    """Return the planes of a box that are held; ``continuity`` is a value of FFD_CONTINUITY."""
    depth = CONTINUITIES[continuity]
    if not depth:
        given = [list_of(config.words[f"FFD_FIX_{letter}"]) for letter in "IJK"]
        i, j, k = (frozenset(int(word.text) for word in words) for words in given)
        return i & _planes(box, 0), j & _planes(box, 1), k & _planes(box, 2)
    ends = _edges(mesh, config.markers, box)
    symmetric = config.words["FFD_SYMMETRY_PLANE"].upper() == "YES" and mesh.dim == 3
    cartesian = box.system.kind == "CARTESIAN"
    held = []
    for axis, degree in enumerate(box.degrees):
        planes: set[int] = set()
        flat = mesh.dim == 2 and axis == 2
        if not flat and (depth < CONTINUITIES["2ND_DERIVATIVE"] or degree > 1):
            for first, inwards in ((0, 1), (degree, -1)):
                if symmetric and axis == 1 and (first == 0 or cartesian):
                    continue
                side = np.take(box.q, first, axis=axis)
                corners = side[[0, 0, -1, -1], [0, -1, 0, -1]]
                if _meets(ends, corners, mesh.dim):
                    planes |= {first + inwards * k for k in range(depth)}
        held.append(frozenset(planes) & _planes(box, axis))
    return held[0], held[1], held[2]


def _planes(box: Box, axis: int) -> frozenset[int]:
    return frozenset(range(box.degrees[axis] + 1))


def _edges(mesh: Mesh, markers: tuple[str, ...], box: Box) -> FloatArray:
    """Return the ends (e, 2, 3) of all segments between two nodes of a facet of some markers.

    They are in the coordinates of the box.
    """
    pairs = []
    for name in markers:
        for _, nodes in mesh.marker(name).cells.by_type.values():
            first, second = np.triu_indices(nodes.shape[1], 1)
            pairs.append(np.stack([nodes[:, first].ravel(), nodes[:, second].ravel()], axis=1))
    every = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    points = np.zeros((*every.shape, 3))
    points[..., : mesh.dim] = mesh.points[every]
    return box.system.q_of(points)


def _meets(ends: FloatArray, corners: FloatArray, dim: int) -> bool:
    """Return whether any segment (e, 2, 3) meets the side of a box with ``corners`` (4, 3).

    In 3D the side is two triangles; in 2D it is a line, which SU2 continues beyond the box.
    """
    if dim == 2:
        return _crossed(ends[..., :2], corners[0, :2], corners[2, :2])
    return _pierced(ends, corners[[0, 1, 2]]) or _pierced(ends, corners[[3, 2, 1]])


def _crossed(ends: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Return whether any segment (e, 2, 2) meets the line through ``one`` and ``other``."""

    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    start, end = ends[:, 0], ends[:, 1]
    across = side(one, other, start) * side(one, other, end) <= 0.0
    # Segments on the line itself do not cross it.
    apart = (side(one, other, start) == 0.0) & (side(one, other, end) == 0.0)
    return bool((across & ~apart).any())


def _pierced(ends: FloatArray, triangle: FloatArray) -> bool:
    """Return whether any segment (e, 2, 3) meets a triangle (3, 3)."""
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


def request_of(config: Su2Config, variable: DesignVariable) -> Request:
    """Return what a variable asks of its box."""
    count = len(DIRECTIONS[variable.kind])
    index = tuple(int(number) for number in variable.numbers[:count])
    length = float(config.words["REF_LENGTH"])
    return Request(variable.kind, index, variable.numbers[count:], length)


def reach(move: Move) -> int:
    """Return how many control points a move moves."""
    return int(np.count_nonzero(move.chosen))


def held_by_continuity(
    config: Su2Config, mesh: Mesh, boxes: dict[str, Box]
) -> tuple[dict[str, Planes], list[str]]:
    """Return the planes of each box that are held, and warnings about what they do.

    None are where FFD_CONTINUITY is not given, but a warning says which ones SU2 would hold.
    """
    asked = config.words["FFD_CONTINUITY"].upper()
    continuity = asked or SU2_CONTINUITY
    every, warnings = {}, []
    for name, box in boxes.items():
        every[name] = held = held_planes(config, mesh, box, continuity)
        stuck, partly = [], []
        for place, variable in enumerate(config.variables, 1):
            if variable.box != name:
                continue
            request = request_of(config, variable)
            free, left = (sum(map(reach, moves_of(box, request, to))) for to in (NONE, held))
            stuck += [place] * (left == 0 < free)
            partly += [place] * (0 < left < free)
        effects = [(stuck, "do nothing"), (partly, "leave the control points there")]
        if asked:
            note = f"FFD_CONTINUITY= {asked} holds {_words(held)} of the box {name}: "
            warnings += [f"{note}{places_words(at)} will {effect}" for at, effect in effects if at]
        elif stuck or partly:
            done = " and ".join(
                f"{places_words(at)} would {effect}" for at, effect in effects if at
            )
            warnings.append(
                f"SU2 would hold {_words(held)} of the box {name}, since the surface leaves it "
                f"there, by its default FFD_CONTINUITY= {continuity}, so that {done}; here they "
                "move. Write that key to hold them, or FFD_CONTINUITY= USER_INPUT to hold what "
                "FFD_FIX_I, FFD_FIX_J, FFD_FIX_K name"
            )
    return (every if asked else dict.fromkeys(boxes, NONE)), warnings


def _words(held: Planes) -> str:
    """Return held planes in words: ``i = 0, 1, j = 4``."""
    return ", ".join(
        f"{letter} = {', '.join(map(str, sorted(planes)))}"
        for letter, planes in zip("ijk", held, strict=True)
        if planes
    )


def places_words(places: list[int]) -> str:
    """Return numbers of variables, from 1, in words, six at most."""
    more = f" and {len(places) - 6} more" if len(places) > 6 else ""
    listed = f"variable{'s' * (len(places) > 1)} {', '.join(map(str, places[:6]))}{more}"
    return f"{listed} of DV_KIND"
