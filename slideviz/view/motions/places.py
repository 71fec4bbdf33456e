"""Where motions begin: the centroids of boundaries, and the axis of a machine."""

from __future__ import annotations

import math

from slideviz.mesh.model import Mesh
from slideviz.view.session.state import Session

DIGITS = 12
"""Of a centroid, counted from the first of the extent of the mesh."""

Axis = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Direction, and a point on it."""


def centroids(mesh: Mesh) -> dict[str, tuple[float, ...]]:
    """Return the centroid of each boundary, without the last digits, which are rounding."""
    digits = DIGITS - math.ceil(math.log10(mesh.extent)) if mesh.extent > 0.0 else DIGITS
    return {
        marker.name: tuple(
            round(float(v), digits) + 0.0 for v in mesh.points[marker.nodes].mean(axis=0)
        )
        for marker in mesh.markers
        if len(marker.nodes)
    }


def machine_axis(session: Session) -> Axis | None:
    """Return the axis about which periodic boundaries repeat, if they do."""
    for pair in session.pairs:
        both = {session.role(pair.first), session.role(pair.second)}
        if pair.kind == "rotational" and both == {"periodic"}:
            return pair.axis, pair.origin
    return None
