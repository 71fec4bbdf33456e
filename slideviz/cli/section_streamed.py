"""``slideviz section --stream``: finds the cells that a section can cut, block by block."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from slideviz.cli.progress import Bar
from slideviz.cli.streamed import StreamedMesh, open_streamed
from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh, Part
from slideviz.mesh.quality import Quality
from slideviz.sections.model import Section
from slideviz.session.passages import keeps, moved
from slideviz.solver.steps import Progress
from slideviz.streaming.quality_blocks import QualityBlock, Zone, quality_blocks
from slideviz.terms import Metric

if TYPE_CHECKING:
    from slideviz.case.model import Case


@contextmanager
def skins(
    arguments: argparse.Namespace, case: Case | None
) -> Iterator[tuple[StreamedMesh, Mesh | None]]:
    """Context with a mesh to be read block by block, and the skin of the undeformed one or None.

    Raises
    ------
    CaseError
        The mesh is 2D.
    MeshError
        As by `slideviz.cli.streamed.open_streamed`.
    """
    with open_streamed(arguments, case) as seen:
        if seen.skin.dim == 2:
            raise CaseError(
                f"{seen.skin.name} is 2D, where all cells are shown around the cut; leave out "
                "--stream"
            )
        yield seen, None if seen.base is None else seen.base.skin(lambda _: None)


@dataclass(frozen=True, eq=False)
class _Kept:
    """Cells that a section can cut."""

    ids: IntArray
    types: np.ndarray
    """`ids`, `types` (k,): their numbers in the whole mesh, and VTK types."""
    flat: IntArray
    """(c,): the nodes of all cells, one cell after the other, by their numbers in the whole
    mesh."""
    values: FloatArray
    size: FloatArray
    skew: FloatArray
    status: np.ndarray
    signs: np.ndarray
    """`values`, `size`, `skew`, `status`, `signs` (k,): their quality."""
    nodes: IntArray
    """(n,): the numbers of their points in the whole mesh."""
    points: FloatArray
    before: FloatArray
    """`points`, `before` (n, d): their points now, and undeformed (where there is a reference)."""

    @classmethod
    def of(cls, part: QualityBlock, chosen: IntArray) -> _Kept:
        """Return the cells of a block with the places ``chosen`` (k,) in it."""
        cells, found = part.mesh.cells.take(chosen), part.quality
        base = part.mesh if part.base is None else part.base
        return cls(
            part.ids[chosen],
            cells.types,
            part.nodes[cells.connectivity],
            found.values[chosen],
            found.size[chosen],
            found.skew[chosen],
            found.status[chosen],
            found.signs[chosen],
            part.nodes[cells.nodes],
            part.mesh.points[cells.nodes],
            base.points[cells.nodes],
        )


def cells_near(
    skin: Mesh,
    mesh: Zone,
    reference: Zone | None,
    metric: Metric,
    section: Section,
    matrices: Mapping[int, FloatArray],
) -> tuple[Mesh, Mesh | None, Quality]:
    """Return the cells of a mesh that a section can cut in any passage.

    Parameters
    ----------
    skin : Mesh
        The skin of the mesh.
    mesh, reference : file and zone
        The cells of the mesh, and of the undeformed one.
    matrices : Mapping of int to (4, 4)
        The transformation of each passage.

    Returns
    -------
    mesh, base : Mesh
        A mesh of these cells and, where there is a reference, the undeformed one; by ascending
        number of the cells.
    quality : Quality
        The quality of these cells.
    """
    ways = [matrix for matrix in matrices.values() if not keeps(section, matrix)]
    if len(ways) < len(matrices):
        ways.append(np.eye(4))
    kept: list[_Kept] = []
    with Bar() as bar:
        tick = lambda part: bar.phase(Progress(1, 1, "quality", part))  # noqa: E731
        for part in quality_blocks(mesh, reference, metric, tick):
            near = np.zeros(len(part.ids), bool)
            for matrix in ways:
                near |= _meets(section, moved(part.mesh.points, matrix), part.mesh.cells)
            kept.append(_Kept.of(part, np.flatnonzero(near)))
    return _joined(skin, kept, metric, with_base=reference is not None)


def _meets(section: Section, points: FloatArray, cells: Cells) -> np.ndarray:
    """Return a mask (m,) of the cells with nodes on both sides of a section, or on it."""
    level = np.nan_to_num(section.distance(points), nan=np.inf)[cells.connectivity]
    starts = cells.offsets[:-1]
    low, high = np.minimum.reduceat(level, starts), np.maximum.reduceat(level, starts)
    return np.asarray((low <= 0) & (high >= 0))


def _joined(
    skin: Mesh, kept: Sequence[_Kept], metric: Metric, *, with_base: bool
) -> tuple[Mesh, Mesh | None, Quality]:
    assert skin.part is not None
    every = _Kept(
        *(np.concatenate([getattr(one, each.name) for one in kept]) for each in fields(_Kept))
    )
    order = np.argsort(every.ids, kind="stable")
    nodes, first = np.unique(every.nodes, return_index=True)
    flat = np.searchsorted(nodes, every.flat)
    mesh = Mesh(
        every.points[first].reshape(-1, skin.dim),
        Cells.from_types(every.types, flat).take(order),
        name=skin.name,
        zone=skin.zone,
        zones=skin.zones,
        part=Part(nodes, every.ids[order], skin.part.n_points, skin.part.n_cells),
    )
    found = Quality(
        values=every.values[order],
        size=every.size[order],
        skew=every.skew[order],
        status=every.status[order],
        signs=every.signs[order],
        metric=metric,
    )
    return mesh, mesh.with_points(every.before[first]) if with_base else None, found
