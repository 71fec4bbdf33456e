"""The formats that a mesh can be saved in, and the parts of a mesh that each leaves out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from slideviz.formats.su2b.write import OTHER_ZONES, listed, lost_in_binary, lost_of_mesh
from slideviz.mesh.model import Mesh


@dataclass(frozen=True)
class MeshFormat:
    """A format: its name, and the parts of a mesh that files of it have.

    ``quality`` is whether cells can have values; ``boundaries`` whether boundaries keep their
    names or get numbers; ``dims`` are the dimensions of meshes that it can store.
    """

    name: str
    quality: bool
    boundaries: Literal["names", "numbers"]
    dims: tuple[int, ...] = (2, 3)


MESH_FORMATS: dict[str, MeshFormat] = {
    ".su2": MeshFormat("SU2 (keeps all markers and sections)", False, "names"),
    ".su2b": MeshFormat("SU2 binary (keeps all markers)", False, "names"),
    ".vtu": MeshFormat("VTU for ParaView, with quality and displacement", True, "names"),
    ".vtkhdf": MeshFormat("VTKHDF for ParaView: boundaries as blocks, steps", True, "names"),
    ".vtk": MeshFormat("Legacy VTK, with quality", True, "numbers"),
    ".xdmf": MeshFormat("XDMF, with quality", True, "numbers"),
    ".cgns": MeshFormat("CGNS (a copy of the file, with other coordinates)", False, "names"),
    ".med": MeshFormat("MED for Salome, with quality", True, "names"),
    ".msh": MeshFormat("Gmsh", False, "names"),
    ".inp": MeshFormat("Abaqus", False, "names"),
    ".vol": MeshFormat("Netgen", False, "names"),
    ".mesh": MeshFormat("Medit", False, "numbers"),
    ".bdf": MeshFormat("Nastran", False, "numbers", (3,)),
}
"""Formats by ending; meshio writes more, but hardly any that stores boundaries besides cells."""


def formats_for(mesh: Mesh) -> dict[str, MeshFormat]:
    """Return the formats that can store a mesh, by ending; CGNS only if it was read from CGNS."""
    return {
        end: row
        for end, row in MESH_FORMATS.items()
        if mesh.dim in row.dims and (end != ".cgns" or mesh.origin.ending == ".cgns")
    }


def holds_quality(path: Path) -> bool:
    """Return whether a file of that name can have values of the cells."""
    row = MESH_FORMATS.get(path.suffix.lower())
    return row is not None and row.quality


def left_out(path: Path, mesh: Mesh) -> str:
    """Return a sentence on the parts of a mesh that a file of that name leaves out; "" if none."""
    end = path.suffix.lower()
    has_quality = end in (".su2", ".su2b", ".cgns") or holds_quality(path)
    lost = [*([] if has_quality else ["the quality of the cells"]), *lost_in(end, mesh)]
    return f"{path.name} does not hold {listed(lost)}." if lost else ""


def lost_in(end: str, mesh: Mesh) -> list[str]:
    """Return words for the parts of a mesh and its file that a file of ending ``end`` lacks."""
    if end == ".cgns":
        return []
    lost: list[str] = []
    if end == ".su2b":
        lost += lost_in_binary(mesh)
    elif end != ".su2":
        row = MESH_FORMATS.get(end)
        if mesh.markers and (row is None or row.boundaries == "numbers"):
            lost.append("the names of the boundaries (they are numbers now)")
        lost += lost_of_mesh(mesh)
    elif mesh.zones > 1 and mesh.origin.ending != end:
        lost.append(OTHER_ZONES)
    if mesh.origin.ending == ".cgns":
        lost.append("other contents of the CGNS file, such as its zones and solutions")
    return lost
