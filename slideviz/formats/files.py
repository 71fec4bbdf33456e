"""Reading and writing mesh files, by slideviz's own code or, for most formats, meshio.

Meshes of other formats than SU2 are read in a process of their own: some readers of meshio run for
hours on a wrong count, allocate all memory, or crash in a C library. The process has limits of time
and memory, can be stopped at any moment, and leaves the window responsive.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slideviz.argument_types import check_types
from slideviz.errors import MeshError, path_error, printable
from slideviz.formats.losses import warning_of_losses
from slideviz.formats.openfoam_paths import mesh_path
from slideviz.formats.table import (
    MESHIO,
    WriteOptions,
    format_for,
    format_of,
    holds_quality,
)
from slideviz.mesh.check import check_mesh, check_size
from slideviz.mesh.metrics import MetricValues
from slideviz.mesh.model import Cells, Marker, Mesh, Origin
from slideviz.mesh.quality import Quality, quality
from slideviz.mesh.walls import Walls
from slideviz.system.cleanup import killed_at_end
from slideviz.system.platform import (
    end_with,
    limit_process,
    limits_time,
    ran_out_of_time,
    total_memory,
)
from slideviz.system.threads import Tick
from slideviz.terms import (
    FILE_FORMATS,
    SIZE_SKEW,
    WALL_VALUES,
    FileFormat,
    Metric,
    Quantity,
    field_of,
)

# Limits of the process: several times what the slowest of meshio's readers needs.
_SECONDS = 20
_SECONDS_PER_BYTE = 20e-6
_MEMORY = 2 << 30
_MEMORY_PER_BYTE = 400
_ON_THE_CLOCK = 3  # limit of time over that of processor time, where there is none of that
_TICK_SECONDS = 0.05  # seconds between two calls of the progress function
_BYTES_PER_SECOND = 5e6  # speed of reading that the progress assumes


def read_surface(path: Path) -> Mesh:
    """Return the surface in a file: its facets as cells of a mesh, or a mesh with its boundaries.

    Raises MeshError if the file cannot be read.
    """
    path = _checked_path(path, None)
    row = format_of(path)
    if row.isolated and row.reader == MESHIO.reader:
        return read_in_subprocess(path, lambda _: None, "meshio.bridge:read_surface")
    return read(path)


def read_in_subprocess(path: Path, progress: Tick, function: str = "") -> Mesh:
    """Return the mesh of a file, read by the isolated reader of its format, or another one.

    Raises MeshError as the reader does, and if the process takes too long, crashes or does not
    start.
    """
    begun = time.monotonic()
    expected = 1.0 + path.stat().st_size / _BYTES_PER_SECOND
    # Without -P a file numpy.py in the folder of the mesh would be run.
    seconds, memory = _limits(path.stat().st_size)
    command = [sys.executable, "-P", "-c", f"from {__name__} import main; main()"]
    command += [*map(str, (os.getpid(), seconds, memory)), str(path)]
    command += [function or format_for(path).reader]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(part for part in sys.path if part),
        # Threads reserve memory, which counts against the limit.
        "OPENBLAS_NUM_THREADS": "1",
    }
    try:
        reader = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
    except OSError as problem:
        raise path_error(
            path,
            f"cannot be read: its reader does not start: {problem.strerror}; close other programs",
        ) from problem
    with reader, killed_at_end(reader):
        answer = None
        while answer is None:
            spent = time.monotonic() - begun
            progress(0.9 * spent / (spent + expected))
            if spent > _ON_THE_CLOCK * seconds and not limits_time():
                raise _too_slow(path)
            with suppress(subprocess.TimeoutExpired):
                answer, _ = reader.communicate(timeout=_TICK_SECONDS)
    mesh = _unpacked(path, answer, reader.returncode)
    progress(1.0)
    return mesh


def _too_slow(path: Path) -> MeshError:
    return path_error(
        path,
        "cannot be read: it takes longer than a file of this size should; check its counts, "
        "or use another format, such as .su2 or .vtu",
    )


def _limits(size: int) -> tuple[int, int]:
    memory = min(_MEMORY + _MEMORY_PER_BYTE * size, 0.8 * total_memory())
    return int(_SECONDS + _SECONDS_PER_BYTE * size), int(memory)


def _unpacked(path: Path, answer: bytes, code: int) -> Mesh:
    """Return the mesh that the process sent, or raise MeshError with its message or exit code."""
    if ran_out_of_time(code):
        raise _too_slow(path)
    if code or not answer:
        library = "meshio" if format_for(path).reader == MESHIO.reader else "HDF5"
        raise path_error(
            path,
            f"cannot be read: {library} crashed on it (code {code}); check the file, "
            "or use another format, such as .su2 or .vtu",
        )
    content = pickle.loads(answer)
    if isinstance(content, str):
        raise MeshError(content)
    assert isinstance(content, Mesh)
    return content


def main() -> None:
    """Read a mesh and write it, pickled, to the standard output: the program of the subprocess.

    Its command-line arguments are the parent's process number, the limits (seconds and bytes of
    memory), the path, and the reader. If the file cannot be read, it writes the error's message.
    """
    if not end_with(int(sys.argv[1])):  # it was killed before
        sys.exit(1)
    # Whatever prints must not get into the answer.
    with os.fdopen(os.dup(1), "wb") as channel:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        limit_process(int(sys.argv[2]), int(sys.argv[3]))
        path = Path(sys.argv[4])
        try:
            mesh = replace(MESHIO, reader=sys.argv[5]).function("reader")(path)
        except MeshError as problem:
            pickle.dump(str(problem), channel)
        except MemoryError:
            too_large = path_error(
                path,
                "cannot be read: it needs more memory than a file of this size should; check its "
                "counts, or use another format, such as .su2 or .vtu",
            )
            pickle.dump(str(too_large), channel)
        else:
            # Without what they have cached; by protocol 5 read-only arrays stay read-only.
            markers = tuple(Marker(one.name, _bare(one.cells)) for one in mesh.markers)
            pickle.dump(replace(mesh, cells=_bare(mesh.cells), markers=markers), channel, 5)


def _bare(cells: Cells) -> Cells:
    return Cells(cells.types, cells.offsets, cells.connectivity)


@check_types
def convert(
    source: str | Path,
    target: str | Path,
    zone: int | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
    *,
    warn: Callable[[str], object] | None = None,
) -> Mesh:
    """Write a mesh in the format that the ending of ``target`` names, and return it.

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
        The file cannot be read, the format cannot hold the mesh, or its zones are 2D and 3D.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> sv.write("square.su2", square)
    >>> sv.convert("square.su2", "square.su2b")
    Mesh('square.su2', 2D, 4 points, Cells(1 quadrilateral), markers: none)
    """
    source = mesh_path(Path(source))
    target = mesh_path(Path(target))
    row = format_for(target)
    mesh = read(source, zone)
    alone = zone is not None and mesh.zones > 1
    if warn is not None:
        if alone and mesh.origin.ending == row.ending:
            warn(
                f"{target} gets only the mesh of zone {mesh.zone} of {mesh.name}; leave out --zone "
                "to keep FFD boxes and other zones"
            )
        warn(warning_of_losses(target, mesh, alone=alone))
    if row.quality and cell_data is None:
        cell_data = quality_data(target, quality(mesh))
    # One of several zones is a mesh of its own there.
    written = replace(mesh, zone=1, zones=1, origin=Origin()) if alone else mesh
    write(target, written, cell_data=cell_data)
    return mesh


@check_types
def read(
    path: str | Path,
    zone: int | None = None,
    progress: Tick | None = None,
    file_format: FileFormat | None = None,
) -> Mesh:
    """Return the mesh of a file.

    Parameters
    ----------
    path : str or Path
        An SU2 file, text or binary, the folder of an OpenFOAM case, or a file of another format (by
        its ending).
    zone : int, optional
        The zone of an SU2 file, or the region of an OpenFOAM case, from 1; all of them, as one
        mesh, when left out.
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
    path = _checked_path(path, file_format)
    tick = progress or (lambda _: None)
    try:
        row = format_of(path, file_format)
        if not row.zones and zone not in (None, 1):
            raise path_error(
                path,
                f"there is no zone {zone}; only SU2 files and OpenFOAM cases have zones, so leave "
                "it out",
            )
        if not row.reader:
            raise path_error(
                path, "is written for ParaView, but not read; use the mesh it is made of"
            )
        if row.isolated:
            mesh = read_in_subprocess(path, tick)
        else:
            mesh = row.function("reader")(path, zone, tick)
    except MemoryError as problem:
        raise path_error(
            path, "there is not enough memory to read it; use a machine with more"
        ) from problem
    check_size(mesh, printable(path))
    return mesh


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
    point_data: Mapping[str, ArrayLike] | None = None,
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
    point_data : mapping of str to (n,) or (n, k), optional
        Values on the points by name, as ``cell_data``.

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
    values = _arrays("cell", len(mesh.cells), cell_data or {})
    at_points = _arrays("point", len(mesh.points), point_data or {})
    row = format_for(path, file_format)
    if (values or at_points) and row.solver:
        kind, names = ("cell", values) if values else ("point", at_points)
        raise path_error(
            path,
            f"a {row.ending} file has no place for {kind} data ({', '.join(names)}); write a .vtu "
            "file",
        )
    if base is not None and not row.solver:
        at_points["displacement"] = mesh.points - base.points
    replaces = path if overwrite else None
    options = WriteOptions(values, at_points, replaces, going_on or (lambda: None))
    if row.ending[1:] not in FILE_FORMATS:  # SU2's writers look at what they write anew only
        check_mesh(mesh)
    row.function("writer")(path, mesh, options)


def _checked_path(path: str | Path, file_format: FileFormat | None) -> Path:
    """Return the path of a file; MeshError if ``file_format`` is given and none of SU2's.

    For a folder of an OpenFOAM case, that is the file which stands for its mesh.
    """
    if file_format not in (None, *FILE_FORMATS):
        known = " | ".join(FILE_FORMATS)
        raise path_error(Path(path), f"file_format {file_format!r} is not one of {known}")
    return mesh_path(Path(path))


def quality_data(path: Path, found: Quality) -> dict[str, NDArray] | None:
    """Return qualities as cell data; None where the format of ``path`` has no cell data."""
    if not holds_quality(path):
        return None
    return {"size-skew": found.values, "size": found.size, "skew": found.skew}


def metric_data(
    found: Mapping[Metric, MetricValues], layers: Walls | None, names: Sequence[Quantity]
) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Return metrics, and numbers of walls among ``names``, as data of cells and of points.

    Those of `quality_data` are left out.
    """
    rows = [(field_of(name), one) for name, one in found.items() if name not in SIZE_SKEW]
    cells = {field: one.of_cells for field, one in rows}
    points = {field: one.values for field, one in rows if one.term.where == "nodes"}
    if layers is not None:
        fields = (field_of(name) for name in names if name in WALL_VALUES)
        at_walls = layers.with_layers()
        cells |= {field: at_walls.at_cells(field) for field in fields}
    return cells, points


def is_source(path: Path, mesh: Mesh) -> bool:
    """Return whether ``path`` is the file that a mesh was read from, and that still exists."""
    try:
        return mesh.source is not None and path.samefile(mesh.source)
    except OSError:
        # One of the two does not exist (any more), so there is nothing to protect.
        return False


def _arrays(what: str, count: int, data: Mapping[str, ArrayLike]) -> dict[str, NDArray]:
    """Return data of cells or points as arrays; raise MeshError if one does not fit the number."""
    values = {name: np.asarray(given) for name, given in data.items()}
    for name, array in values.items():
        if array.ndim not in (1, 2) or len(array) != count:
            raise MeshError(
                f"{what} data {name!r} has shape {array.shape}, but the mesh has {count} "
                f"{what}s; give one value or one row for each {what}"
            )
    return values
