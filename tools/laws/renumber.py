"""The same mesh with its nodes, cells and marker elements in another order."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import Cells, IntArray, Marker, Mesh
from tests import builders


def renumbered(mesh: Mesh, rng: np.random.Generator) -> tuple[Mesh, IntArray]:
    """Return the mesh in another order, and which old node each new one is (n,)."""
    order = rng.permutation(len(mesh.points))
    mesh = builders.permuted(mesh, order)
    markers = tuple(Marker(m.name, _shuffled(m.cells, rng)) for m in mesh.markers)
    return Mesh(mesh.points, _shuffled(mesh.cells, rng), markers, name=mesh.name), order


def _shuffled(cells: Cells, rng: np.random.Generator) -> Cells:
    order = rng.permutation(len(cells))
    parts = [cells.connectivity[cells.offsets[i] : cells.offsets[i + 1]] for i in order]
    return Cells.from_types(cells.types[order], np.concatenate(parts))
