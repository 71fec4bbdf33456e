"""The support radius of the radial functions: as the case says, or fitted to the motion."""

from __future__ import annotations

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.mesh.fans import components
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import FloatArray, Mesh

EXTENTS = 2.5
"""Largest automatic support radius over the extent of the mesh: the thesis's rule, for passages."""

BODIES = 15.0
"""Automatic support radius over the largest extent of a moving body. A larger one carries a far
field along where the body turns or stretches, a smaller one gives worse cells beside the body."""

DISPLACEMENTS = 20.0
"""Automatic support radius over the largest displacement, at least: a body that moves by more than
its size needs a radius that fits the way."""


def support_radius(case: Case, mesh: Mesh, moved: Displacements) -> float:
    """Return the support radius R, in the mesh's length unit.

    Parameters
    ----------
    moved : Displacements
        The prescribed displacements.
    """
    if case.support_radius is not None:
        return case.support_radius
    if case.influence_factor:
        return case.influence_factor * mesh.extent
    return fitted_radius(case, mesh, moved)


def fitted_radius(case: Case, mesh: Mesh, moved: Displacements) -> float:
    """Return the support radius of ``INFLUENCE_FACTOR= AUTO``; parameters as `support_radius`."""
    sizes = np.ptp(moving_bodies(case, mesh, moved), axis=1)
    farthest = np.linalg.norm(moved.vectors, axis=1).max(initial=0.0)
    needed = max(BODIES * sizes.max(initial=0.0), DISPLACEMENTS * farthest)
    return min(EXTENTS * mesh.extent, float(needed) or np.inf)


def moving_bodies(case: Case, mesh: Mesh, moved: Displacements) -> FloatArray:
    """Return the bounding boxes of the moving bodies, (b, 2, d): lowest and highest coordinates.

    A body is a connected part of the moving boundaries. Those of which no node is displaced do not
    count, unless no node at all is displaced.
    """
    inside, names = without_halo(mesh)[0], case.markers_with("moving")
    tables = [table for name in names for _, table in inside.marker(name).cells.by_type.values()]
    links = [table[:, [0, k]] for table in tables for k in range(1, table.shape[1])]
    pairs = np.concatenate([np.empty((0, 2), np.int64), *links])
    nodes, ends = np.unique(pairs, return_inverse=True)
    body = components(len(nodes), *ends.reshape(-1, 2).T)
    boxes = np.full((int(body.max(initial=-1)) + 1, 2, mesh.dim), np.inf)
    boxes[:, 1] = -np.inf
    np.minimum.at(boxes[:, 0], body, mesh.points[nodes])
    np.maximum.at(boxes[:, 1], body, mesh.points[nodes])
    displaced = np.isin(nodes, moved.nodes[moved.vectors.any(axis=1)])
    return boxes[np.unique(body[displaced])] if displaced.any() else boxes
