"""Reading and writing mesh files, by slideviz's own code or, for most formats, meshio."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slideviz.argument_types import check_types
from slideviz.errors import MeshError, path_error, printable
from slideviz.formats.source import open_source, unreadable
from slideviz.formats.su2.read import read_su2
from slideviz.formats.su2.scan import Progress
from slideviz.formats.su2.write import su2_blocks
from slideviz.formats.su2b.read import is_su2b, read_su2b
from slideviz.formats.su2b.write import su2b_blocks
from slideviz.mesh.check import check_mesh, check_size
from slideviz.mesh.model import Mesh
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import require_regular_file
from slideviz.terms import FILE_FORMATS, FileFormat

_SNIFFED_BYTES = 1 << 16
"""Bytes of a file that are searched for ``NDIME=``."""
_UNSURE = ("", ".txt", ".dat", ".mesh", ".grid")
"""Endings of files that may be SU2's, depending on their content."""
_NDIME = re.compile(rb"^\s*NDIME\s*=", re.IGNORECASE | re.MULTILINE)


@check_types
def read(
    path: str | Path,
    zone: int | None = None,
    progress: Progress | None = None,
    file_format: FileFormat | None = None,
) -> Mesh:
    """Return the mesh of a file.

    Parameters
    ----------
    path : str or Path
        An SU2 file, text or binary, or one of a format that meshio reads (by its ending).
    zone : int, optional
        The zone of an SU2 file, from 1; the first when left out.
    progress : callable, optional
        Called with the fraction done, 0 to 1; what it raises stops the reading and passes on.
    file_format : {"su2", "su2b"}, optional
        SU2's text or binary; found out by the ending and the content when left out.

    Raises
    ------
    MeshError
        The file cannot be read, or has a mistake: the place and the remedy.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> sv.write("square.su2", square)
    >>> sv.read("square.su2")
    Mesh('square.su2', 2D, 4 points, Cells(1 quadrilateral), markers: none)
    """
    mesh = _read(_checked_path(path, file_format), zone, progress or (lambda _: None), file_format)
    check_size(mesh, printable(path))
    return mesh


def _read(path: Path, zone: int | None, tick: Progress, file_format: FileFormat | None) -> Mesh:
    """Return the mesh of a file, as `read` does, whatever the size of its coordinates."""
    try:
        kind = format_of(path, file_format)
        if kind == "su2b":
            return read_su2b(path, zone, tick)
        if kind == "su2":
            return read_su2(open_source(path), zone, tick)
        if zone not in (None, 1):
            raise path_error(
                path, f"there is no zone {zone}, for only SU2 files have zones; leave it out"
            )
        from slideviz.formats.subprocess_reader import read_in_subprocess

        return read_in_subprocess(path, tick)
    except MemoryError as problem:
        raise path_error(
            path, "there is not enough memory to read it; use a machine with more"
        ) from problem


def format_of(path: Path, given: FileFormat | None) -> FileFormat | None:
    """Return the SU2 format of a file as ``given``, or by ending and content; None if neither is.

    Raises
    ------
    MeshError
        The file cannot be read, or is no ordinary file.
    """
    ending = path.suffix.lower()
    try:
        require_regular_file(path, MeshError)
        if given is None and ending not in (".su2", ".su2b", *_UNSURE):
            return None
        binary = is_su2b(path)
        if given is not None:
            return given
        if binary or ending == ".su2b":
            return "su2b"
        if ending == ".su2":
            return "su2"
        with path.open("rb") as file:
            return "su2" if _NDIME.search(file.read(_SNIFFED_BYTES)) else None
    except (OSError, ValueError) as problem:
        raise unreadable(path, problem) from problem


def usual_ending(mesh: Mesh) -> str:
    """Return the ending, as ``.su2``, that is proposed for saving a mesh."""
    return mesh.origin.ending or ".su2"


@check_types
def write(
    path: str | Path,
    mesh: Mesh,
    overwrite: bool = False,
    cell_data: Mapping[str, ArrayLike] | None = None,
    base: Mesh | None = None,
    going_on: Callable[[], object] | None = None,
    *,
    file_format: FileFormat | None = None,
) -> None:
    """Write a mesh, in the format that the ending of ``path`` names, whole or not at all.

    Parameters
    ----------
    path : str or Path
        The file; one that exists is replaced.
    mesh : Mesh
        What to write. From SU2 text to text, and from binary to binary, everything else in the
        file is kept.
    overwrite : bool
        Whether ``path`` may be the file that the mesh was read from.
    cell_data : mapping of str to (n_cells,) or (n_cells, k), optional
        Values on the cells by name; not for SU2, which has no place for them.
    base : Mesh, optional
        The undeformed mesh: VTU and VTKHDF files get the displacement of every point, as vectors.
    going_on : callable, optional
        Called between the blocks of an SU2 file; what it raises stops the writing, and what was
        at ``path`` stays.
    file_format : {"su2", "su2b"}, optional
        SU2's text or binary, whatever the ending.

    Raises
    ------
    MeshError
        The file cannot be written, or the mesh does not fit the format.

    Examples
    --------
    For SU2, and with the quality of each cell for ParaView:

    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> sv.write("square.su2", square)
    >>> sv.write("square.vtu", square, cell_data={"quality": sv.quality(square).values})
    """
    path = _checked_path(path, file_format)
    if not overwrite and is_source(path, mesh):
        raise path_error(
            path,
            "this is the file that the mesh was read from; choose another name, or ask "
            "for overwriting",
        )
    replaces = path if overwrite else None
    values = _cell_arrays(mesh, cell_data or {})
    kind = file_format or path.suffix.lower().removeprefix(".")
    if kind not in ("su2", "su2b"):
        moved = {} if base is None else {"displacement": mesh.points - base.points}
        _write_other(path, mesh, values, moved, replaces)
        return
    if values:
        raise path_error(
            path, f"an SU2 file has no place for cell data ({', '.join(values)}); write a .vtu file"
        )
    with atomic_write(path, replaces=replaces) as file:
        for block in su2b_blocks(mesh) if kind == "su2b" else su2_blocks(mesh):
            file.write(block)
            if going_on is not None:
                going_on()


def _write_other(
    path: Path,
    mesh: Mesh,
    values: dict[str, NDArray],
    point_data: dict[str, NDArray],
    replaces: Path | None,
) -> None:
    """Write a mesh in the format of the path's ending, which is none of SU2's."""
    ending = path.suffix.lower()
    if ending == ".cgns":
        from slideviz.formats.cgns.write import write_cgns

        if values:
            raise path_error(
                path, f"a CGNS file gets no cell data ({', '.join(values)}); write a .vtu file"
            )
        check_mesh(mesh)
        write_cgns(path, mesh, replaces)
    elif ending == ".vtkhdf":
        from slideviz.formats.vtkhdf import write_vtkhdf

        check_mesh(mesh)
        write_vtkhdf(path, mesh, values, point_data, replaces)
    else:
        from slideviz.formats.meshio.write import write_other_format

        write_other_format(path, mesh, values, point_data, replaces)


def _checked_path(path: str | Path, file_format: FileFormat | None) -> Path:
    """Return the path of a file whose format, where it is given, is one of SU2.

    Raises
    ------
    MeshError
        It is none.
    """
    if file_format not in (None, *FILE_FORMATS):
        known = " | ".join(FILE_FORMATS)
        raise path_error(Path(path), f"file_format {file_format!r} is not one of {known}")
    return Path(path)


def is_source(path: Path, mesh: Mesh) -> bool:
    """Return whether ``path`` is the file that a mesh was read from, and that still exists."""
    try:
        return mesh.source is not None and path.samefile(mesh.source)
    except OSError:
        # One of the two does not exist (any more), so there is nothing to protect.
        return False


def _cell_arrays(mesh: Mesh, cell_data: Mapping[str, ArrayLike]) -> dict[str, NDArray]:
    """Return the cell data as arrays; raise MeshError if one does not fit the number of cells."""
    values = {name: np.asarray(given) for name, given in cell_data.items()}
    for name, array in values.items():
        if array.ndim not in (1, 2) or len(array) != len(mesh.cells):
            raise MeshError(
                f"cell data {name!r} has shape {array.shape}, but the mesh has {len(mesh.cells)} "
                "cells; give one value or one row for each cell"
            )
    return values
