"""Whether a mesh needs more memory than is free, so that it should be streamed."""

from __future__ import annotations

from pathlib import Path

from slideviz.case.model import Case
from slideviz.formats.files import format_of
from slideviz.formats.su2.text import find_text
from slideviz.solver.deform import free_memory
from slideviz.terms import FileFormat

NEEDED: dict[FileFormat, float] = {"su2b": 5.0, "su2": 4.0}
"""Memory of a run that is not streamed, over the size of the mesh file, with some reserve: measured
4.2 and 3.1 on hexahedra."""


def missing_memory(case: Case) -> str:
    """Return the sentence that the mesh of a case needs more memory than is free; "" if it fits.

    Also "" where streaming would not help: it can stream neither this format, nor a mesh with
    a halo, nor linear elasticity.

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
    """Return the sentence that an SU2 mesh needs more memory than is free; "" if it fits."""
    needed, free = NEEDED[kind] * path.stat().st_size, free_memory()
    if needed <= free:
        return ""
    return f"{path.name} needs about {needed / 1e9:.0f} GB of memory, {free / 1e9:.0f} GB are free"
