"""Reading meshes of other formats through meshio.

A mesh file from somebody else must not make the program read any file of this disk: files that it
names are read only if they are in its own folder, external links of HDF5 not at all.
"""

from __future__ import annotations

import math
import os
import re
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar
from xml.etree import ElementTree as ET

import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError, path_error, printable
from slideviz.formats.table import endings
from slideviz.mesh.cached_boundary import outer_facets, smooth_parts
from slideviz.mesh.check import check_mesh, check_size, first_fault
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh

if TYPE_CHECKING:
    import h5py

# The streams are redirected for the whole process, so two threads must not do it at once.
_STREAMS = threading.Lock()
_UNKNOWN = re.compile(r"Element type not available: (\S+)")
"""meshio's words on a type of element that it does not read."""


def formats_of(path: Path) -> list[str]:
    """Return meshio's formats with the file's ending, the likeliest first; MeshError if none."""
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

    Raises MeshError in place of any error of the block, as one sentence: ``path: cannot be <what>:
    ...``. A MeshError or MemoryError is raised as it is.
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

    Raises MeshError if it can be read in none of them; the message is that of the first.
    """
    problems = []
    for name in formats:
        try:
            with meshio_errors(path, f"read as {name}"):
                if name == "nastran":
                    _require_bulk_data(path)
                return meshio.read(path, file_format=name)
        except MeshError as problem:
            problems.append(problem)
    raise problems[0]


def _require_bulk_data(path: Path) -> None:
    """Raise MeshError if a Nastran file ends before its bulk data: meshio would read on forever."""
    with path.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            if line.strip().startswith("BEGIN BULK"):
                break
        # What meshio passes over: short lines and comments.
        if all(len(line) < 4 or line.startswith(("$", "//", "#")) for line in lines):
            raise path_error(path, "there are no data after a line BEGIN BULK; export it again")


MESHIO_TYPES = {
    "vertex": 1,
    "line": 3,
    "triangle": 5,
    "quad": 9,
    "tetra": 10,
    "hexahedron": 12,
    "wedge": 13,
    "pyramid": 14,
}
"""VTK identifier by meshio's name of an element type."""
_FLAT = 1e-9  # largest range of z, as a fraction of the extent, of a mesh in the xy-plane
_HDF5 = b"\x89HDF\r\n\x1a\n"  # first bytes of an HDF5 file
_MOST_SHRUNK = 1_100
"""Bytes that a byte of a compressed dataset has at most: zlib's 1,032, and some more."""
_UNWRITTEN = 1 << 20  # bytes of a dataset that may be missing in its file: HDF5 fills them
_INCLUDE = re.compile(rb"^\*INCLUDE\b[^=\n]*=([^\n]*)", re.IGNORECASE | re.MULTILINE)
_MOST_FILES = 100
"""Most files that are searched for names of further files: two may name each other."""


def read_with_meshio(path: Path, least: int = 2) -> Mesh:
    """Return the mesh of a file that meshio reads.

    Its cells are those of the highest dimension; those of one dimension less are its boundaries,
    with the names of the file. A file without named boundaries gets its outer surface, divided
    at its edges: ``boundary_1``, ``boundary_2`` and so on, the largest first. Raises MeshError if
    meshio cannot read the file, it names files elsewhere, or slideviz cannot use the mesh.
    ``least``: the lowest dimension of its cells.
    """
    with meshio_errors(path, "read"):
        require_own_folder(path)
    data = load(path, formats_of(path))
    with meshio_errors(path, "understood"):
        return _mesh(path, data, least)


def read_surface(path: Path) -> Mesh:
    """Return the facets, or lines, in a file as the cells of a mesh without markers.

    Of a file with a volume, it is that mesh with its boundaries. Otherwise as `read_with_meshio`.
    """
    return read_with_meshio(path, least=1)


def _mesh(path: Path, data: meshio.Mesh, least: int) -> Mesh:
    blocks = [
        _block(path, cells.type, cells.data, index)
        for index, cells in enumerate(data.cells)
        if len(cells.data) and cells.type != "empty"
    ]
    dim = max((ELEMENTS[block.vtk].dim for block in blocks), default=0)
    if dim < least:
        raise path_error(path, "there are no cells, only points and lines; export the mesh")
    cells = Cells.from_blocks(
        (block.vtk, block.nodes) for block in blocks if ELEMENTS[block.vtk].dim == dim
    )
    points = _points(path, data, cells)
    is_surface = least == 1 and dim < points.shape[1]
    _require_finite(path, points, cells, "facet" if is_surface else "cell")
    if is_surface:
        surface = Mesh(points=points, cells=cells, name=printable(path.name))
        check_size(surface, printable(path))
        return surface
    if dim == 2 and points.shape[1] == 3:
        points = flattened(path, points, cells)
    mesh = Mesh(points=points, cells=cells, name=printable(path.name), source=path.resolve())
    # The outer surface can be looked for only in sound cells.
    check_mesh(mesh)
    check_size(mesh, printable(path))
    sides = [block for block in blocks if ELEMENTS[block.vtk].dim == dim - 1]
    mesh = replace(mesh, markers=find_markers(mesh, data, sides))
    check_mesh(mesh)
    return mesh


def _block(path: Path, name: str, nodes: object, index: int) -> MeshioBlock:
    if name not in MESHIO_TYPES:
        kind = "has many sides" if name.startswith(("poly", "pixel")) else "is of high order"
        raise path_error(
            path,
            f"the element type {name!r} {kind}, but slideviz needs linear elements "
            f"({', '.join(list(MESHIO_TYPES)[1:])}); export the mesh with these",
        )
    table = np.asarray(nodes)
    vtk = MESHIO_TYPES[name]
    if table.ndim != 2 or table.shape[1] != ELEMENTS[vtk].n_nodes or table.dtype.kind not in "iu":
        raise path_error(
            path,
            f"the nodes of its {ELEMENTS[vtk].name} cells cannot be understood; export "
            "the mesh again",
        )
    return MeshioBlock(index, vtk, table.astype(np.int64))


def _points(path: Path, data: meshio.Mesh, cells: Cells) -> FloatArray:
    points = np.asarray(data.points, float)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise path_error(
            path, f"the points have shape {points.shape}, not (n, 2) or (n, 3); export it again"
        )
    fault = first_fault(cells, len(points))
    if fault:
        raise path_error(path, f"cell {fault[0]}: {fault[1]}")
    return points


def _require_finite(path: Path, points: FloatArray, cells: Cells, what: str) -> None:
    """Raise MeshError if a corner of a cell, called ``what``, is NaN or infinite."""
    wrong = ~np.isfinite(points[cells.connectivity]).all(axis=1)
    if wrong.any():
        corner = int(np.argmax(wrong))
        cell = int(np.searchsorted(cells.offsets, corner, "right")) - 1
        node = cells.connectivity[corner]
        raise path_error(
            path,
            f"{what} {cell}: point {node} is at {tuple(points[node].tolist())}, which is not "
            "finite; correct the file",
        )


def flattened(path: Path, points: FloatArray, cells: Cells) -> FloatArray:
    """Return x and y (n, 2) of points (n, 3); MeshError if those of cells differ in z."""
    used = points[cells.nodes]
    if np.ptp(used[:, 2]) > _FLAT * np.ptp(used, axis=0).max():
        raise path_error(
            path,
            "this is a surface in space, but a mesh of triangles and quadrilaterals must "
            "lie in the xy-plane; export the volume mesh, or turn the surface into that plane",
        )
    return points[:, :2]


def require_own_folder(path: Path) -> None:
    """Raise if a file, or one that it names, names files that are not in its folder.

    Raises MeshError if it names a file in another folder, or has an external link of HDF5, and
    OSError if it cannot be read.
    """
    seen: set[Path] = set()
    waiting = [path]
    while waiting and len(seen) < _MOST_FILES:
        one = waiting.pop()
        seen.add(one)
        for name, found in _named_files(one):
            if found.parent != Path(os.path.realpath(path.parent)):
                raise path_error(
                    one,
                    f"names a file of another folder, {printable(name)!r}, which is not read; put "
                    "it into the same folder, or export the mesh as one file",
                )
            if found.is_file() and found not in seen:
                waiting.append(found)


def _named_files(path: Path) -> Iterator[tuple[str, Path]]:
    """Yield each name of another file in a file, and the path that meshio would read for it.

    Raises MeshError for an external link of HDF5.
    """
    with path.open("rb") as file:
        is_hdf5 = file.read(len(_HDF5)) == _HDF5
    if is_hdf5:
        _require_no_links(path)
    elif path.suffix.lower() in (".xdmf", ".xmf"):
        yield from _files_of_xdmf(path)
    elif path.suffix.lower() == ".inp":
        for match in _INCLUDE.finditer(path.read_bytes()):
            name = match[1].strip().decode("utf-8", "surrogateescape")
            yield name, _resolved(Path(name) if Path(name).exists() else path.parent / name)


def _files_of_xdmf(path: Path) -> Iterator[tuple[str, Path]]:
    try:
        items = [item for _, item in ET.iterparse(path) if item.tag == "DataItem"]
    except ET.ParseError:
        return  # meshio says what is wrong with it
    for item in items:
        text = (item.text or "").strip()
        kind = item.get("Format")
        if kind == "HDF":
            name = text.rpartition(":")[0]
            yield name, _resolved(path.parent / name)
        elif kind == "Binary":
            yield text, _resolved(Path(text))


def _resolved(path: Path) -> Path:
    """Return a path with its folder resolved (no ``..``, no links); its last part stays."""
    return Path(os.path.realpath(path.parent)) / path.name


def _require_no_links(path: Path) -> None:
    """Raise MeshError if an HDF5 file has a link to, or numbers in, another file, or lacks them."""
    # Late: h5py takes 0.1 s, and few formats need it.
    import h5py

    with h5py.File(path, "r") as file:
        seen: set[object] = set()
        groups: list[h5py.Group] = [file]
        while groups:
            group = groups.pop()
            for name in group:
                link = group.get(name, getlink=True)
                other = link.filename if isinstance(link, h5py.ExternalLink) else None
                thing = None if other else group.get(name)
                if isinstance(thing, h5py.Dataset):
                    other = _storage_file(thing)
                    _require_stored_size(path, thing)
                if other is not None:
                    raise path_error(
                        path,
                        f"{printable(f'{group.name}/{name}')!r} is an external link to "
                        f"{printable(other)!r}, which is not read; export the mesh as one file",
                    )
                if isinstance(thing, h5py.Group):
                    key = h5py.h5o.get_info(thing.id).addr
                    if key not in seen:  # a group may contain one of its own parents
                        seen.add(key)
                        groups.append(thing)


def _require_stored_size(path: Path, data: h5py.Dataset) -> None:
    """Raise MeshError if reading a dataset takes far more memory than the file has bytes for it."""
    stored = data.id.get_storage_size()
    needed = data.dtype.itemsize * max(data.size or 0, math.prod(data.chunks or (0,)))
    if not data.external and not data.is_virtual and needed > _MOST_SHRUNK * stored + _UNWRITTEN:
        raise path_error(
            path,
            f"{printable(data.name)!r} is said to have {needed / 1e6:,.0f} MB, and the file has "
            f"{stored:,} bytes for it; the file is damaged: export it again",
        )


def _storage_file(data: h5py.Dataset) -> str | None:
    """Return the other file that the numbers of a dataset are in, or None."""
    if data.external:
        return str(data.external[0][0])
    if data.is_virtual:
        names = [source.file_name for source in data.virtual_sources()]
        return next((name for name in names if name != "."), None)
    return None


Groups = dict[str, list[tuple[int, IntArray]]]
"""Blocks of boundary elements, VTK identifier and nodes (m, n), by the name of the boundary."""
Name = TypeVar("Name")

# Cell data with the number of a boundary, in order of preference, and the word before a number
# without a name.
_TAGS = {
    "marker": "marker",
    "gmsh:physical": "physical",
    "cell_tags": "family",
    "medit:ref": "ref",
    "ugrid:ref": "ref",
    "nastran:ref": "ref",
    "netgen:index": "index",
    "gmsh:geometrical": "geometrical",
}
# Cell data whose numbers a table in the file names.
_NAMED = ("marker", "gmsh:physical", "cell_tags", "netgen:index")
# Cell data in which 0 means that the element is in no group.
_ZERO_IS_NONE = ("marker", "gmsh:physical", "cell_tags")


@record
class MeshioBlock:
    """Elements of one type: index in meshio's list of blocks, VTK identifier, nodes (m, n)."""

    index: int
    vtk: int
    nodes: IntArray


def find_markers(mesh: Mesh, data: meshio.Mesh, sides: Sequence[MeshioBlock]) -> tuple[Marker, ...]:
    """Return the boundaries of a mesh.

    They are found by the first of these that the file has: named sets of boundary elements, numbers
    on boundary elements (with names where the file has them), named sets of points. Without any,
    they are the parts of the outer surface, divided at its edges. ``mesh``: points and cells.
    ``data``: what meshio read. ``sides``: its elements of one dimension less than the mesh.
    """
    groups = _by_cell_sets(data, sides) or _by_tags(mesh, data, sides)
    if groups:
        return tuple(Marker(name, Cells.from_blocks(parts)) for name, parts in groups.items())
    facets = outer_facets(mesh)
    return _by_point_sets(mesh, data, facets) or smooth_parts(mesh, facets)


def _by_cell_sets(data: meshio.Mesh, sides: Sequence[MeshioBlock]) -> Groups:
    groups: Groups = {}
    for name, members in data.cell_sets.items():
        if name is not None and name.startswith("gmsh:"):
            continue
        for block in sides:
            # Some readers leave out the blocks at the end, or put None for an empty set.
            chosen = members[block.index] if block.index < len(members) else None
            if chosen is not None and len(chosen):
                _add(groups, name, block.vtk, block.nodes[np.asarray(chosen, np.int64)])
    return groups


def _by_tags(mesh: Mesh, data: meshio.Mesh, sides: Sequence[MeshioBlock]) -> Groups:
    """Return boundary elements grouped by the first cell data that has numbers of groups."""
    others = [key for key in data.cell_data if key not in _TAGS]
    for key in [*_TAGS, *others]:
        values = _numbers(data, key, sides)
        if values is None:
            continue
        names = _names(data, mesh.dim - 1) if key in _NAMED else {}
        groups: Groups = {}
        # By size, for MED counts downward from -1.
        for number in sorted(np.unique(np.concatenate(values)).tolist(), key=abs):
            if number == 0 and key in _ZERO_IS_NONE and 0 not in names:
                continue
            for name in names.get(number, [f"{_TAGS.get(key, key)}_{number}"]):
                for block, numbers in zip(sides, values, strict=True):
                    _add(groups, name, block.vtk, block.nodes[numbers == number])
        if groups:
            return groups
    return {}


def _numbers(data: meshio.Mesh, key: str, sides: Sequence[MeshioBlock]) -> list[NDArray] | None:
    """Return the integers (m,) of cell data ``key`` on each block of boundary elements, or None.

    None if there are none, or nearly all differ: then they are identifiers, not groups.
    """
    if not sides or key not in data.cell_data:
        return None
    values = [np.asarray(data.cell_data[key][block.index]) for block in sides]
    if any(array.ndim != 1 or array.dtype.kind not in "iu" for array in values):
        return None
    if key not in _TAGS:
        # A different number on each element is an identifier, not a group.
        distinct = len(np.unique(np.concatenate(values)))
        if distinct > 1 and distinct > 0.5 * sum(map(len, values)):
            return None
    return values


def _names(data: meshio.Mesh, dim: int) -> dict[int, list[str]]:
    """Return the names in the file for each number of a group of elements of dimension ``dim``."""
    found: dict[int, list[str]] = {}
    for name, value in data.field_data.items():
        pair = np.ravel(value)
        if pair.dtype.kind in "iu" and len(pair) == 2 and pair[1] == dim:
            found.setdefault(int(pair[0]), []).append(str(name))
    for number, names in getattr(data, "cell_tags", {}).items():
        found.setdefault(int(number), []).extend(names)
    return found


def _add(groups: Groups, name: str | None, vtk: int, nodes: IntArray) -> None:
    """Add elements to the group of a name, cleaned of what is not printable, or ``unnamed``."""
    # Readers give None to a set that its file does not name.
    clean = "".join(c for c in name or "" if c.isprintable()).strip() or "unnamed"
    groups.setdefault(clean, []).append((vtk, nodes))


def _by_point_sets(mesh: Mesh, data: meshio.Mesh, facets: Cells) -> tuple[Marker, ...]:
    """Return a marker for each named set of points that has all nodes of some outer facets."""
    groups: Groups = {}
    for name, parts in in_node_sets(len(mesh.points), facets, data.point_sets).items():
        for vtk, nodes in parts:
            _add(groups, name, vtk, nodes)
    return tuple(Marker(name, Cells.from_blocks(parts)) for name, parts in groups.items())


def in_node_sets(
    n_points: int, facets: Cells, sets: Mapping[Name, ArrayLike]
) -> dict[Name, list[tuple[int, IntArray]]]:
    """Return for each set of nodes the facets with all their nodes in it, as blocks of one type.

    A facet goes only to the smallest of such sets, so that a set of all points takes none from
    the others.
    """
    free = np.ones(len(facets), bool)
    sets_of: dict[Name, list[tuple[int, IntArray]]] = {name: [] for name in sets}
    members = {name: np.asarray(nodes, np.int64) for name, nodes in sets.items()}
    for name, chosen in sorted(members.items(), key=lambda item: len(item[1])):
        inside = np.zeros(n_points, bool)
        inside[chosen] = True
        for vtk, (ids, nodes) in facets.by_type.items():
            taken = free[ids] & inside[nodes].all(axis=1)
            free[ids[taken]] = False
            if taken.any():
                sets_of[name].append((vtk, nodes[taken]))
    return sets_of
