"""Whether boundaries enclose a volume, and which lie inside all others; cached by mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.surfaces import Surface

_BESIDE = 1e-6
"""Least distance of an inner boundary from the box around all, as a part of its longest side."""


@dataclass(frozen=True)
class Enclosing:
    """Whether boundaries enclose a volume (`is_closed`), and names of inner ones (`enclosed`)."""

    closed: bool
    inner: frozenset[str]


_FOUND: WeakKeyDictionary[Mesh, dict[tuple[str, ...], Enclosing]] = WeakKeyDictionary()
"""Results of `enclosing_of`, by names of boundaries."""


def enclosing_of(mesh: Mesh, surfaces: Sequence[Surface]) -> Enclosing:
    """Return what boundaries of a mesh enclose; cached by their names as long as the mesh lives."""
    names = tuple(one.name for one in surfaces)
    kept = _FOUND.setdefault(mesh, {})
    if names not in kept:
        kept[names] = Enclosing(is_closed(surfaces), enclosed(surfaces, mesh.points))
    return kept[names]


def enclosed(surfaces: Sequence[Surface], points: FloatArray) -> frozenset[str]:
    """Return the names of boundaries of a 3D mesh that lie inside the others, as a wing in air.

    Inside are those whose bounding box touches no side of the box around all.

    Parameters
    ----------
    surfaces : sequence of Surface
    points : (n, d) float64
        Of the mesh.
    """
    boxes = {
        one.name: (points[one.nodes].min(axis=0), points[one.nodes].max(axis=0))
        for one in surfaces
        if not one.flat
    }
    if not boxes:
        return frozenset()
    low = np.min([box[0] for box in boxes.values()], axis=0)
    high = np.max([box[1] for box in boxes.values()], axis=0)
    beside = _BESIDE * float((high - low).max())
    return frozenset(
        name
        for name, box in boxes.items()
        if (box[0] > low + beside).all() and (box[1] < high - beside).all()
    )


def is_closed(surfaces: Sequence[Surface]) -> bool:
    """Return whether faces (3D) enclose a volume: each edge belongs to exactly two of them."""
    faces = [one.nodes[one.facets] for one in surfaces if one.facets.shape[1] == 4]
    if len(faces) != len(surfaces) or not faces:
        return False
    every = np.concatenate(faces)
    start, end = every.ravel(), np.roll(every, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    keys = np.sort((low * (every.max() + 1) + high)[low != high])
    pairs = len(keys) % 2 == 0 and bool(np.all(keys[::2] == keys[1::2]))
    return pairs and bool(np.all(keys[1:-1:2] != keys[2::2]))
