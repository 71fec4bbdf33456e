"""Motions that put boundaries through each other: told before anything is solved."""

from __future__ import annotations

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.crossing import Crossing, first_crossing, swept_crossing
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh


def clash(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> str | None:
    """Return a sentence when a moved boundary ends up inside another one, None when all is well.

    Boundaries that share nodes are not compared: where a blade stands on a sliding hub, both lie
    on the same curved surface only roughly. Nor are those that move along: internal ones, and
    periodic ones with periodic displacement.

    Parameters
    ----------
    nodes, vectors : (k,), (k, d)
        The displacement of the moving nodes.
    """
    after = np.array(mesh.points)
    after[nodes] += vectors
    for name in case.markers_with("moving"):
        hit = first_crossing(after, mesh.marker(name).cells, _others(case, mesh, name))
        if hit is not None:
            return (
                f"the motion puts {name} through {hit.marker} near {_place(hit)}; move {name} "
                f"less, or let {hit.marker} move with it (role moving, internal or periodic)"
            )
    return None


def jump(case: Case, mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> str | None:
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
