"""Converting a mesh file into another format, with all its zones where both formats have zones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike

from slideviz.argument_types import check_types
from slideviz.errors import path_error
from slideviz.formats.files import quality_data, read, write
from slideviz.formats.losses import warning_of_losses
from slideviz.formats.table import FORMATS, format_for, usual_ending
from slideviz.mesh.model import Mesh, Origin
from slideviz.mesh.quality import quality
from slideviz.system.atomic import atomic_write


@check_types
def convert(
    source: str | Path,
    target: str | Path,
    zone: int | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
    *,
    warn: Callable[[str], object] | None = None,
) -> Mesh:
    """Write a mesh in the format that the ending of ``target`` names; return its first zone.

    Parameters
    ----------
    source, target : str or Path
        The file to read, and the one to write; one that exists is replaced.
    zone : int, optional
        The zone to convert, from 1; all of them when left out.
    cell_data : mapping of str to (n_cells,) or (n_cells, k), optional
        Values on the cells by name, as of `slideviz.write`; when left out, their quality where
        the format has a place for it: that of the shape alone.
    warn : callable, optional
        Called with a sentence on each loss: what the new file will not have of the mesh.

    Raises
    ------
    MeshError
        The file cannot be read, the format cannot hold the mesh, or it has no zones and the file
        has several.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> sv.write("square.su2", square)
    >>> sv.convert("square.su2", "square.su2b")
    Mesh('square.su2', 2D, 4 points, Cells(1 quadrilateral), markers: none)
    """
    source, target = Path(source), Path(target)
    row, mesh = format_for(target), read(source, zone)
    alone = zone is not None and mesh.zones > 1
    same = mesh.origin.ending == row.ending
    keeps_zones = bool(row.zones) and zone is None
    if warn is not None:
        for sentence in _warnings(source, target, mesh, alone):
            warn(sentence)
    if row.quality and cell_data is None and (alone or mesh.zones == 1):
        cell_data = quality_data(target, quality(mesh))
    if mesh.zones == 1 or (keeps_zones and same):
        write(target, mesh, cell_data=cell_data)  # which keeps what else the file has
    elif alone:
        only = replace(mesh, zone=1, zones=1, origin=Origin())
        write(target, only, cell_data=cell_data)
    elif not keeps_zones:
        raise path_error(
            target,
            f"{source.name} has {mesh.zones} zones, for which this format has no place; "
            "choose one with --zone",
        )
    else:
        others = (read(source, number) for number in range(2, mesh.zones + 1))
        with atomic_write(target) as file:
            for block in row.function("zones")(mesh, *others):
                file.write(block)
    return mesh


def _warnings(source: Path, target: Path, mesh: Mesh, alone: bool) -> Iterator[str]:
    """Yield a sentence for each loss of a conversion; ``alone``: one of several zones."""
    row = format_for(target)
    if alone and mesh.origin.ending == row.ending:
        yield (
            f"{target} will have zone {mesh.zone} alone, and of {mesh.name} nothing but that mesh: "
            "leave out --zone to keep FFD boxes and the rest"
        )
    # Without --zone no zone is lost.
    yield warning_of_losses(target, mesh if alone else replace(mesh, zones=1), alone=alone)
    if not alone and row.zones and not row.sections and FORMATS[usual_ending(mesh)].sections:
        for zone in range(2, mesh.zones + 1):
            other = replace(read(source, zone), zones=1, name=f"{mesh.name}, zone {zone}")
            yield warning_of_losses(target, other)
