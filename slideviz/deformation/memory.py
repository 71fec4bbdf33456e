"""Whether a mesh needs more memory than is free."""

from __future__ import annotations

from pathlib import Path

from slideviz.case.model import Case
from slideviz.deformation.solver import free_memory
from slideviz.mesh.io.files import format_of
from slideviz.mesh.io.su2.text import find_text
from slideviz.terms import FileFormat

NEEDED: dict[FileFormat, float] = {"su2b": 5.0, "su2": 4.0}
"""Memory of a run that is not streamed over the size of its file: 4.2 and 3.1 on hexahedra."""


def missing_memory(case: Case) -> str:
    """Return in words that a mesh that can be streamed needs more memory than is free, or nothing.

    Raises
    ------
    MeshError
        The mesh cannot be read.
    """
    path = case.mesh_file
    if path is None or case.method == "elastic":
        return ""
    kind = format_of(path, case.mesh_format)
    if kind is None:
        return ""
    said = missing_memory_of(path, kind)
    return "" if said and kind == "su2" and find_text(path, case.zone).zone.sends else said


def missing_memory_of(path: Path, kind: FileFormat) -> str:
    """Return in words that an SU2 mesh needs more memory than is free, or nothing."""
    needed, free = NEEDED[kind] * path.stat().st_size, free_memory()
    if needed <= free:
        return ""
    return f"{path.name} needs about {needed / 1e9:.0f} GB of memory, {free / 1e9:.0f} GB are free"
