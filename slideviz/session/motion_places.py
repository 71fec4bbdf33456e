"""Where motions begin: centroids, the axis of a machine, and which boundaries a new one is for."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from slideviz.case.model import Target, moves
from slideviz.mesh.model import Mesh
from slideviz.session.state import Session

DIGITS = 12
"""Of a centroid, counted from the first of the extent of the mesh."""

Axis = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Direction, and a point on it."""


def centroid(mesh: Mesh, names: Iterable[str]) -> tuple[float, ...]:
    """Return the centroid of boundaries together, without the last digits, which are rounding."""
    digits = DIGITS - math.ceil(math.log10(mesh.extent)) if mesh.extent > 0.0 else DIGITS
    found = [mesh.marker(name).nodes for name in names if name in mesh.marker_names]
    nodes = np.unique(np.concatenate([*found, np.empty(0, np.int64)]))
    middle = mesh.points[nodes].mean(axis=0) if len(nodes) else np.zeros(mesh.dim)
    return tuple(round(float(v), digits) + 0.0 for v in middle)


def radial(axis: Axis, point: tuple[float, ...]) -> tuple[float, float, float] | None:
    """Return the direction from an axis to a point, across the axis; None where it is on it."""
    direction, origin = (np.array(values) for values in axis)
    arm = np.array((*point, 0.0)[:3]) - origin
    arm = arm - direction * (arm @ direction) / (direction @ direction)
    length = float(np.linalg.norm(arm))
    if not length > 0.0:
        return None
    x, y, z = (round(float(v), DIGITS) + 0.0 for v in arm / length)
    return x, y, z


def new_target(session: Session) -> Target:
    """Return what a new motion moves: what is selected, else what has none yet, else all."""
    case = session.case
    moving = case.markers_with("moving")
    without = [n for n in moving if not any(moves(motion, n) for motion in case.motions)]
    names = tuple(name for name in moving if name in session.view.selected) or tuple(without)
    if len(names) == 1:
        return names[0]
    return names if names and names != moving else "" if len(moving) > 1 else "".join(moving)


def targets(session: Session) -> tuple[Target, ...]:
    """Return what a motion may move: each, what is selected where that are several, and all."""
    moving = session.case.markers_with("moving")
    selected = tuple(name for name in moving if name in session.view.selected)
    several = (selected,) if 1 < len(selected) < len(moving) else ()
    return (*moving, *several, *(("",) if len(moving) > 1 else ()))


def machine_axis(session: Session) -> Axis | None:
    """Return the axis about which periodic boundaries repeat, if they do."""
    for pair in session.pairs:
        both = {session.role(pair.first), session.role(pair.second)}
        if pair.kind == "rotational" and both == {"periodic"}:
            return pair.axis, pair.origin
    return None
