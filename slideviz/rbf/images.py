"""Periodic images: one node represents all images of it, and all move alike.

The displacement of an image, computed by itself, would differ by rounding at least, and by more
where only one image is at a corner, a normal or the end of a curve. So one image represents all,
its displacement in the frame is copied to the others, and after every step the deformed mesh is
checked: images must have moved alike. Periodic pairs are found in `slideviz.mesh.periodic`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import NodeError, point_words
from slideviz.mesh.fans import components
from slideviz.mesh.model import (
    FloatArray,
    IntArray,
    column_bounds,
    largest_coordinate,
    mask_of,
    row_dots,
    row_norms,
)
from slideviz.mesh.nearest import nearest
from slideviz.mesh.periodic import Pair
from slideviz.rbf.classify import Classes, directions
from slideviz.rbf.constraint_rows import refuse
from slideviz.rbf.frames import Frame
from slideviz.rbf.tape import value

COINCIDENT = 1e-12  # nodes nearer than this part of the mesh's extent are in one place

ROUNDING = 1e-12
"""Part of the mesh's extent by which images may move differently: ten thousand times the
rounding of a coordinate, and a millionth of the first cells of a fine boundary layer."""

FAR = 1e-14
"""Part of the largest coordinate that is added to `ROUNDING`, for meshes far from the origin."""


def find_images(
    pairs: Sequence[Pair], frame: Frame, coords: FloatArray, nodes: IntArray, extent: float
) -> IntArray:
    """Return for each node, (n,), the number of the periodic image that represents all its images.

    The first image along the period, of those on a periodic boundary if any is. Images are the
    nodes of the pairs, and boundary nodes that coincide with another one after one period without
    being on a periodic boundary, as in layers of cells beyond it. A node without images represents
    itself.
    ``coords`` (n, d): undeformed, in the frame.
    ``nodes`` (b,): all nodes of the boundary.
    ``extent``: of the mesh, in its length unit.
    """
    count = len(coords)
    if not pairs:
        return np.arange(count)
    links = np.concatenate([pair.nodes for pair in pairs])
    paired = mask_of(count, links)
    near = COINCIDENT * extent + 2.0 * max(pair.mismatch for pair in pairs)
    # Nearly all nodes have no image, which a search without bound takes long to find out.
    gap, at = nearest(coords[nodes], coords[nodes] + frame.shift(), 2.0 * near, 2.0 * near)
    found = np.flatnonzero(gap <= near)
    coincident_pairs = np.stack([nodes[found], nodes[at[found]]], axis=1)
    links = np.concatenate([links, coincident_pairs[~paired[coincident_pairs].all(axis=1)]])
    linked, ends = np.unique(links, return_inverse=True)
    label = components(len(linked), *ends.reshape(links.shape).T)
    order = np.lexsort((coords[linked] @ frame.shift(), ~paired[linked], label))
    representative = np.arange(count)
    representative[linked] = linked[order[np.searchsorted(label[order], label)]]
    return representative


@record
class ImageDisplacements:
    """Copies the displacements of given nodes to their periodic images."""

    prescribed: IntArray  # (k,): sorted, each once
    vectors: FloatArray  # (k, d): the displacements of the given nodes in the frame
    representative: IntArray
    """(n,): for each node, the number of the periodic image that represents it."""

    @cached_property
    def _row(self) -> IntArray:
        """Place of the first image of each representative (n,) in ``prescribed``, from 1; or 0."""
        # Memory for zeros is taken only where something is written.
        row = np.zeros(len(self.representative), np.int64)
        row[self.representative[self.prescribed[::-1]]] = np.arange(len(self.prescribed), 0, -1)
        return row

    def source(self, nodes: IntArray) -> IntArray:
        """Return the given node whose displacement each of nodes (m,) has, (m,); -1 if none."""
        return np.r_[-1, self.prescribed][self._row[self.representative[nodes]]]

    def at(self, nodes: IntArray) -> FloatArray:
        """Return the displacements (m, d) of nodes (m,); zero for nodes without a given image."""
        row = self._row[self.representative[nodes]]
        return np.concatenate([np.zeros((1, self.vectors.shape[1])), self.vectors])[row]

    def require_alike(self, allowed: float) -> None:
        """Raise DeformError when given displacements of images differ by more than ``allowed``."""
        gap = np.abs(self.vectors - self.at(self.prescribed)).max(axis=1, initial=0.0)
        if gap.max(initial=0.0) > allowed:
            worst = int(np.argmax(gap))
            node = self.prescribed[worst]
            refuse(int(node), int(self.source(node[None])[0]), float(gap[worst]))


def require_free(
    spread: ImageDisplacements,
    nodes: IntArray,
    classes: Classes,
    normals: FloatArray,
    allowed: float,
) -> None:
    """Raise DeformError when the boundary does not let nodes move as their given images do.

    ``nodes`` (m,): nodes that move only because an image is given.
    ``classes``: the classes of all nodes, found as if there were no images.
    ``normals`` (f, d): of all fans, in the frame.
    ``allowed``: largest displacement across the constraints, in the mesh's length unit.
    """
    off = np.zeros(classes.total)
    held = classes.fixed[np.isin(classes.fixed, nodes)]
    off[held] = np.abs(spread.at(held)).max(axis=1, initial=0.0)
    rows, across = directions(classes, normals)
    np.maximum.at(off, rows, np.abs(row_dots(spread.at(rows), value(across))))
    worst = int(nodes[np.argmax(off[nodes])])
    if off[worst] > allowed:
        refuse(worst, int(spread.source(np.array([worst]))[0]), float(off[worst]))


def misfits(frame: Frame, coords: FloatArray, points: FloatArray, images: IntArray) -> FloatArray:
    """Return the difference of the displacements of images, (k,), in the mesh's length unit.

    ``coords`` (n, d): undeformed, in the frame.
    ``points`` (n, d): Cartesian, as they are now.
    ``images`` (k, 2): nodes and their images.
    """
    one = frame.coords(points[images[:, 0]])
    two = frame.coords(points[images[:, 1]])
    gap = (two - one) - (coords[images[:, 1]] - coords[images[:, 0]])
    if frame.cylindrical:
        # Angles as lengths of arcs, whichever turn they are counted in.
        turn = 2 * np.pi * frame.radius
        gap[:, 1] = (gap[:, 1] - turn * np.round(gap[:, 1] / turn)) * one[:, 0] / frame.radius
    return row_norms(gap)


def largest_misfit(
    frame: Frame, coords: FloatArray, points: FloatArray, images: IntArray
) -> float | None:
    """Return the largest of `misfits`, in the mesh's length unit; None where there are no images.

    Raises DeformError if images moved differently by more than rounding.
    """
    if not len(images):
        return None
    found = misfits(frame, coords, points, images)
    worst = int(np.argmax(found))
    origin = 0.0 if frame.origin is None else float(np.abs(frame.origin).max())
    low, high = column_bounds(points)
    allowed = ROUNDING * float((high - low).max()) + FAR * (largest_coordinate(points) + origin)
    if not found[worst] <= allowed:
        one, two = images[worst]
        where = point_words(points[two])
        raise NodeError(
            f"node {{}}, now at {where}, and its periodic image, node {{}}, have moved "
            f"differently, by {found[worst]:.3g}; rounding makes {allowed:.1g} at most; let the "
            "boundaries at both periodic sides move alike, or choose PERIODIC_MODE= none",
            int(two),
            int(one),
        )
    return float(found[worst])
