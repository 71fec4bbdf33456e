"""The law of sliding: nodes stay on the undeformed surface that they were on.

Surfaces are taken in the working frame. A node may go over from one sliding marker into another
where both go on smoothly (below ``SMOOTH_DEG``, the angle at which the program takes them for
one). Beyond the rim where a moving boundary stands on a surface there are no facets; nodes that
follow it stay in the plane of the last ones, as far as the boundary moves.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from slideviz.mesh.model import FloatArray, Marker
from tools.laws.cases import Run
from tools.laws.oracle import Frame, distance, goals, nodes_with, planes, simplices

SMOOTH_DEG = 10.0
CURVED = 1e-9
"""Part of the extent by which a node on a curved surface may be off."""

REACH = 1.6
"""How far surfaces go on beyond moving rims, in largest displacements."""


def off_surface(run: Run, points: FloatArray, rounding: float) -> Iterator[str]:
    """Yield a sentence for each marker that nodes have left."""
    case, mesh = run.case, run.mesh
    if case.sliding == "none":
        return
    frame = Frame(mesh, run.period)
    before, after = frame.coords(mesh.points), frame.coords(points)
    roles = ["sliding", "internal"]
    free = case.periodic in ("fixed", "moving")
    roles += [] if free else ["periodic"]
    slide = [m for m in mesh.markers if case.roles.get(m.name, "fixed") in roles]
    known = nodes_with(case, mesh, "moving", "fixed")
    not_internal = nodes_with(case, mesh, "moving", "fixed", "sliding", "periodic")
    for marker in slide:
        nodes = np.setdiff1d(marker.nodes, known)
        nodes = nodes[~frame.on_axis(before[nodes])]
        if case.roles[marker.name] == "internal":
            nodes = np.intersect1d(nodes, not_internal)
        if not len(nodes):
            continue
        turns = [turn * _shift(run, frame) for turn in ((0, -1, 1) if free else (0,))]
        remaining = [m for m in slide if m is not marker]
        near = [m for m in remaining if any(_smooth(run, marker, m, before, by) for by in turns)]
        near.insert(0, marker)
        sides = frame.opened(simplices(mesh, near, before))
        flat = _flat(sides, rounding)
        if free:
            sides = np.concatenate([sides, sides - _shift(run, frame), sides + _shift(run, frame)])
        gap = distance(after[nodes], sides)
        beyond = gap > (rounding if flat else CURVED * mesh.extent)
        if beyond.any():
            # Also where the boundary moves that is one period further.
            for turn in (-1, 0, 1) if free else (0,):
                at = after[nodes[beyond]] + turn * _shift(run, frame)
                gap[beyond] = np.minimum(gap[beyond], _beyond(run, near, frame, at))
        # A flat surface that ends: its plane to rounding, its rim to what a curve may be off.
        allowed = rounding if flat else CURVED * mesh.extent
        if gap.max() > allowed:
            worst = gap.argmax()
            part = gap[worst] / mesh.extent
            yield f"{marker.name}: node {nodes[worst]} is {part:.2g} off ({'flat' * flat})"


def _shift(run: Run, frame: Frame) -> FloatArray:
    if run.period is None:
        return np.zeros(run.mesh.dim)
    return frame.turn if run.period.angle_deg else run.period.vector


def _smooth(run: Run, one: Marker, other: Marker, coords: FloatArray, by: FloatArray) -> bool:
    """Return whether a marker and another, shifted ``by`` (d,), share nodes and go on smoothly."""
    same = 1e-9 * run.mesh.extent
    gap, _ = cKDTree(coords[other.nodes] + by).query(coords[one.nodes])
    shared = coords[one.nodes[gap < same]]
    if not len(shared):
        return False
    normals = []
    for marker, shift in ((one, 0.0), (other, by)):
        sides = simplices(run.mesh, [marker], coords) + shift
        near = distance_to_any(sides, shared) < same
        normals.append(planes(sides[near])[1])
    along = np.abs(normals[0] @ normals[1].T)
    return bool(along.max(initial=0.0) > np.cos(np.radians(SMOOTH_DEG)))


def distance_to_any(sides: FloatArray, x: FloatArray) -> FloatArray:
    """Return how far the nearest corner of each simplex is from any of the points, (s,)."""
    gap = np.linalg.norm(sides[:, :, None] - x[None, None], axis=3)
    return gap.min(axis=(1, 2), initial=np.inf)


def _flat(sides: FloatArray, rounding: float) -> bool:
    corners = sides.reshape(-1, sides.shape[2])
    middle = corners - corners.mean(axis=0)
    normal = np.linalg.svd(middle, full_matrices=False)[2][-1]
    return bool(np.abs(middle @ normal).max() <= rounding)


def _beyond(run: Run, near: list[Marker], frame: Frame, x: FloatArray) -> FloatArray:
    """Return how far points (m, d) are from the planes at rims of moving boundaries."""
    moving = nodes_with(run.case, run.mesh, "moving")
    rim = np.intersect1d(np.concatenate([m.nodes for m in near]), moving)
    if not len(rim):
        return np.full(len(x), np.inf)
    coords, where = frame.coords(run.mesh.points), goals(run.case, run.mesh)
    ways = frame.way(run.mesh.points[list(where)], np.array(list(where.values())))
    reach = np.linalg.norm(ways, axis=1).max()
    sides = simplices(run.mesh, near, coords)
    sides = sides[distance_to_any(sides, coords[rim]) == 0.0]
    foot, normal = planes(sides)
    height = np.abs(np.einsum("smd,sd->sm", x[None] - foot[:, None], normal))
    to_rim = distance(x, sides)
    return np.where(to_rim <= REACH * reach, height.min(axis=0), np.inf)
