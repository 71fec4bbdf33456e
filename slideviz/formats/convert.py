"""Converting a mesh file into another format, with all its zones where both formats have zones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike

from slideviz.argument_types import check_types
from slideviz.errors import path_error
from slideviz.formats.files import read, write
from slideviz.formats.su2.write import su2_blocks
from slideviz.formats.su2b.write import su2b_blocks
from slideviz.mesh.model import Mesh, Origin
from slideviz.system.atomic import atomic_write

_ZONED = {".su2": "su2", ".su2b": "su2b"}
"""Formats with several zones, by file name ending."""


@check_types
def convert(
    source: str | Path,
    target: str | Path,
    zone: int | None = None,
    first: Mesh | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
) -> Mesh:
    """Write a mesh in the format that the ending of ``target`` names; return its first zone.

    Parameters
    ----------
    source, target : str or Path
        The file to read, and the one to write; one that exists is replaced.
    zone : int, optional
        The zone to convert, from 1; all of them when left out.
    first : Mesh, optional
        The zone, or the first one, if it was read already.
    cell_data : mapping of str to (n_cells,) or (n_cells, k), optional
        Values on its cells by name, as of `slideviz.write`.

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
    mesh = read(source, zone) if first is None else first
    kind = _ZONED.get(target.suffix.lower())
    if mesh.zones == 1 or (zone is None and mesh.origin.ending == f".{kind}"):
        write(target, mesh, cell_data=cell_data)  # which keeps what else the file has
        return mesh
    if zone is not None:
        alone = replace(mesh, zone=1, zones=1, origin=Origin())
        write(target, alone, cell_data=cell_data)
        return mesh
    if kind is None:
        raise path_error(
            target,
            f"{source.name} has {mesh.zones} zones, for which this format has no place; "
            "choose one with --zone",
        )
    rest = (read(source, number) for number in range(2, mesh.zones + 1))
    with atomic_write(target) as file:
        for block in _zones(kind, mesh, *rest):
            file.write(block)
    return mesh


def _zones(kind: str, *meshes: Mesh) -> Iterator[bytes]:
    """Yield the bytes, in blocks, of a file of ``kind`` su2 or su2b with a zone for each mesh."""
    if kind == "su2b":
        yield from su2b_blocks(*meshes)
        return
    yield f"NZONE= {len(meshes)}\n".encode()
    for number, mesh in enumerate(meshes, 1):
        yield f"IZONE= {number}\n".encode()
        yield from su2_blocks(mesh)
