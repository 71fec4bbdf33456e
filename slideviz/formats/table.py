"""The one table of mesh formats: endings, names, readers, writers, and what each format keeps.

Reading, writing, the dialogs of the window, ``convert``, help texts and warnings of losses all go
by it. A new format is a folder with its reader and writer, and a table of ``table.toml``. This
module imports no reader or writer: a row names its functions, which are imported at the first use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from slideviz.errors import MeshError
from slideviz.formats.openfoam_paths import ending_of
from slideviz.formats.source import unreadable
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import require_regular_file
from slideviz.system.tables import table_beside
from slideviz.terms import FILE_FORMATS, FileFormat

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from slideviz.mesh.model import CellRows, FloatArray, Marker, Mesh

_UNSURE = ("", ".txt", ".dat", ".mesh", ".grid")
"""Endings of files whose format may be found by their content."""


@dataclass(frozen=True)
class WriteOptions:
    """What a writer gets besides path and mesh."""

    cell_data: Mapping[str, NDArray]  # (n_cells,) or (n_cells, k): values on the cells by name
    point_data: Mapping[str, NDArray]  # (n,) or (n, d): values on the points by name
    replaces: Path | None = None  # the input file that may be overwritten
    going_on: Callable[[], object] = lambda: None
    """Called between blocks of a file; what it raises stops the writing."""


@dataclass(frozen=True, eq=False)
class ZoneContent:
    """The content of a zone to write, with functions that return parts of its large arrays.

    The functions get numbers i, j and return the k = j - i items from i on.
    """

    dim: int  # 2 or 3
    n_cells: int
    n_points: int  # `n_cells`, `n_points`: numbers of cells and points
    cells: Callable[[int, int], CellRows]
    """Returns cells in the order of the file."""
    types: Callable[[int, int], NDArray[np.uint8]]  # returns the types (k,) of these cells
    points: Callable[[int, int], FloatArray]  # returns coordinates (k, d)
    markers: tuple[Marker, ...]  # the boundaries


@dataclass(frozen=True)
class MeshFormat:
    """A mesh format. Its functions are named as ``module:function``, below this package."""

    ending: str  # file name ending, with its dot
    name: str  # name and strengths, in file dialogs
    reader: str = "meshio.bridge:read_with_meshio"
    """Returns a mesh: ``read(path, zone, tick)``, or ``read(path)`` if isolated; "" for none."""
    writer: str = "meshio.write:write_with_meshio"
    """Writes a mesh: ``write(path, mesh, options)``, `WriteOptions`."""
    isolated: bool = True
    """Whether it is read in a process of its own, with limits of time and memory."""
    quality: bool = False  # whether cells can have values
    boundaries: Literal["names", "numbers"] = "names"
    """Whether boundaries keep their names, or get numbers."""
    dims: Sequence[int] = (2, 3)  # dimensions of the meshes that it can store
    solver: bool = False  # whether it is a solver's: cells have no values, and nobody expects any
    sections: bool = False
    """Whether it keeps other sections of SU2 texts, such as FFD boxes and halos."""
    copies: bool = False
    """Whether a mesh that was read from such a file is written as a copy of it."""
    require: str = ""  # raises MeshError where a file cannot hold a mesh: ``require(mesh, path)``
    zones: bool = False  # whether it keeps several zones apart
    content: str = ""
    """Yields a file of zones whose parts are made by functions: ``blocks(contents, name)``."""
    series: str = ""
    """Context with a file that holds all steps: ``series(path, mesh)``; "" where it holds one."""
    detects: str = ""  # returns whether a file is of this format, by its content: ``detects(path)``

    @property
    def value(self) -> FileFormat | None:
        """Return its value of MESH_FORMAT; only meshes of these formats can be streamed."""
        return next((name for name in FILE_FORMATS if self.ending == f".{name}"), None)

    def function(self, field: str) -> Callable[..., Any]:
        """Return the function that a field names, such as ``reader``."""
        module, _, name = getattr(self, field).partition(":")
        return getattr(import_module(f"slideviz.formats.{module}"), name)


MESHIO = MeshFormat("", "a format of meshio", boundaries="numbers")
"""Any other format: meshio knows it, or nobody."""

_TABLE = table_beside(__file__)
_ROWS = tuple(MeshFormat(ending, **row) for ending, row in _TABLE.items())
FORMATS: dict[str, MeshFormat] = {row.ending: row for row in _ROWS}
"""Formats by ending; meshio writes more, but hardly any that stores boundaries besides cells."""


def format_for(path: Path, file_format: FileFormat | None = None) -> MeshFormat:
    """Return the format of a file to write: ``file_format``, or that of its ending."""
    return FORMATS.get(f".{file_format}" if file_format else ending_of(path), MESHIO)


def format_of(path: Path, file_format: FileFormat | None = None) -> MeshFormat:
    """Return the format of a file to read: ``file_format``, or by its ending and its content.

    Raises MeshError if the file cannot be read, or is not an ordinary file.
    """
    try:
        require_regular_file(path, MeshError)
        ending = ending_of(path)
        row = format_for(path)
        if not (file_format or row.detects or ending in _UNSURE):
            return row
        path.open("rb").close()
        if file_format:
            return FORMATS[f".{file_format}"]
        # The text last: its own ending is enough for it.
        for known in reversed([one for one in _ROWS if one.detects]):
            if known is row or known.function("detects")(path):
                return known
        return row
    except (OSError, ValueError) as problem:
        raise unreadable(path, problem) from problem


def endings(select: Callable[[MeshFormat], object]) -> list[str]:
    """Return the endings of formats, e.g. ``.su2``, in the order of the table."""
    return [row.ending for row in _ROWS if select(row)]


def own_endings(*fields: str) -> str:
    """Return the endings of slideviz's own formats whose ``fields`` are true, with commas."""
    rows = (row for row in _ROWS if row.writer != MESHIO.writer)
    return ", ".join(row.ending for row in rows if all(getattr(row, name) for name in fields))


def formats_for(mesh: Mesh) -> dict[str, MeshFormat]:
    """Return the formats that can store a mesh, by ending; OpenFOAM only if it was read from it."""
    return {
        row.ending: row
        for row in _ROWS
        if mesh.dim in row.dims
        and (not (row.copies and row.require) or mesh.origin.ending == row.ending)
    }


def holds_quality(path: Path) -> bool:
    """Return whether a file of that name can have values of the cells."""
    return format_for(path).quality


def usual_ending(mesh: Mesh) -> str:
    """Return the ending, e.g. ``.su2``, that is proposed for saving a mesh."""
    return mesh.origin.ending or ".su2"


def readable_patterns() -> str:
    """Return the patterns of all files that can be read, e.g. ``*.su2 *.su2b``, for a dialog."""
    # Late: meshio takes 0.1 s.
    import meshio

    readable = endings(lambda row: row.reader)
    return " ".join(
        f"*{end}" for end in dict.fromkeys([*readable, *sorted(meshio.extension_to_filetypes)])
    )


def write_blocks(path: Path, blocks: Iterable[bytes], options: WriteOptions) -> None:
    """Write a file block by block, whole or not at all.

    Raises MeshError if it cannot be written; what was at ``path`` is as before.
    """
    with atomic_write(path, replaces=options.replaces) as file:
        for block in blocks:
            file.write(block)
            options.going_on()


def write_content(
    path: Path,
    contents: Sequence[ZoneContent],
    replaces: Path | None = None,
    going_on: Callable[[], None] = lambda: None,
) -> None:
    """Write zones whose parts are made by functions, as SU2's text or binary, whole or not at all.

    Raises MeshError if it cannot be written, or a name of a boundary cannot be.
    """
    row = format_for(path)
    if not row.content:
        raise MeshError(
            f"{path}: such a file is not written piece by piece; end its name in "
            f"{' or '.join(endings(lambda one: one.content))}, and convert it afterwards"
        )
    blocks = row.function("content")(contents, path.name)
    write_blocks(path, blocks, WriteOptions({}, {}, replaces, going_on))
