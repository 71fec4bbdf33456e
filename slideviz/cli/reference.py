"""The undeformed mesh that quality is measured against, and what is said where there is none."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.mesh.model import Mesh

NONE = "no reference: relative to itself"
"""Stands in pictures; sizes of cells are not rated then, only their shapes."""
REMEDY = "give --reference UNDEFORMED"


def add_reference(call: argparse.ArgumentParser, case_help: str) -> None:
    """Add the options ``--reference`` and ``--case``."""
    call.add_argument(
        "--reference",
        type=Path,
        metavar="UNDEFORMED",
        help="mesh to compare with; without it only the shape of cells is rated",
    )
    call.add_argument("--case", type=Path, metavar="CASE", help=case_help)


def reference_of(
    arguments: argparse.Namespace, mesh: Mesh, case: Case | None
) -> tuple[Path, Mesh] | None:
    """Return the undeformed mesh and its file: ``--reference``, or else that of ``--case``.

    The mesh of a case is taken only where it has the cells of ``mesh``: the case may have been
    given for its periodic boundaries alone.
    """
    from slideviz import read

    if arguments.reference is not None:
        return arguments.reference, read(arguments.reference, zone=arguments.zone)
    if case is None or case.mesh_file is None or not case.mesh_file.is_file():
        return None
    base = read(case.mesh_file, zone=arguments.zone or case.zone)
    same = base.points.shape == mesh.points.shape and base.cells.same_as(mesh.cells)
    return (case.mesh_file, base) if same else None


def words_of(found: tuple[Path, Mesh] | None) -> str:
    """Return the line about what the quality is measured against."""
    return f"{NONE}; {REMEDY}" if found is None else f"reference: {found[0]}"
