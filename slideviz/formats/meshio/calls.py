"""Calls of meshio, with any failure raised as a ``MeshError``.

meshio prints, on some errors ends the process, and raises errors of any class.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.errors import MeshError, path_error
from slideviz.formats.table import endings

if TYPE_CHECKING:
    import meshio

# The streams are redirected for the whole process, so two threads must not do it at once.
_STREAMS = threading.Lock()
_UNKNOWN = re.compile(r"Element type not available: (\S+)")
"""meshio's words on a type of element that it does not read."""


def formats_of(path: Path) -> list[str]:
    """Return the names of meshio's formats that have the file's ending, the likeliest first.

    Raises
    ------
    MeshError
        There is no such format.
    """
    import meshio

    # Gmsh before ANSYS, which has the same ending but is rare.
    table = meshio.extension_to_filetypes
    suffixes = [s.lower() for s in path.suffixes]
    for ending in ("".join(suffixes[-2:]), "".join(suffixes[-1:])):
        if ending in table and ending != ".su2":
            return sorted(table[ending], key=lambda name: name != "gmsh")
    if path.suffix.lower() == ".cfg":
        raise path_error(path, "is a case file, not a mesh; name the mesh itself")
    raise path_error(
        path,
        f"no mesh format has the ending {path.suffix or '(none)'}; known are "
        f"{', '.join(endings(lambda row: row.reader))} and others of meshio, and for writing "
        f"{', '.join(endings(lambda row: not row.reader))}",
    )


@contextmanager
def meshio_errors(path: Path, what: str) -> Iterator[None]:
    """Context in which meshio neither prints nor ends the process.

    Raises
    ------
    MeshError
        In place of any error of the block, as one sentence: ``path: cannot be <what>: ...``. A
        MeshError or MemoryError is raised as it is.
    """
    said = StringIO()
    try:
        with _STREAMS, redirect_stdout(said), redirect_stderr(said):
            yield
    except ModuleNotFoundError as problem:
        raise path_error(
            path, f"cannot be {what}: this format needs the package {problem.name}; install it"
        ) from problem
    except (MeshError, MemoryError):
        raise
    except OSError as problem:
        # h5py raises this for its own reasons too, without a number.
        reason = problem.strerror if problem.errno else "it is not a file of this format"
        raise path_error(
            path, f"cannot be {what}: {reason}; check the file, its ending and the disk"
        ) from problem
    except (Exception, SystemExit) as problem:
        words = str(problem) if isinstance(problem, Exception) else ""
        reason = " ".join((words or said.getvalue()).split())[:160] or type(problem).__name__
        unknown = _UNKNOWN.search(reason)
        if unknown:
            raise path_error(
                path,
                f"cannot be {what}: elements of type {unknown[1]} are not read from files of this "
                "format; export the mesh in another one, such as .su2 or .vtu",
            ) from problem
        raise path_error(
            path,
            f"cannot be {what}: meshio says {reason!r}; use another format, such as .su2 or .vtu",
        ) from problem


def load(path: Path, formats: list[str]) -> meshio.Mesh:
    """Return meshio's mesh of a file, read in the first of ``formats`` that succeeds.

    Raises
    ------
    MeshError
        It can be read in none of them; the message is that of the first.
    """
    import meshio

    problems = []
    for name in formats:
        try:
            with meshio_errors(path, f"read as {name}"):
                return meshio.read(path, file_format=name)
        except MeshError as problem:
            problems.append(problem)
    raise problems[0]
