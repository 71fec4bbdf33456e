"""Writing meshes as VTU, by our own code, or in one of meshio's formats, by meshio.

meshio writes VTU too, but reorders cells of mixed type and loses the names of boundaries.
"""

from __future__ import annotations

import shutil
from base64 import b64encode
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import meshio
import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError, path_error
from slideviz.formats.meshio.bridge import MESHIO_TYPES, formats_of, load, meshio_errors
from slideviz.formats.table import WriteOptions, write_blocks
from slideviz.mesh.model import Cells, IntArray, Mesh
from slideviz.mesh.surfaces import padded
from slideviz.system.atomic import atomic_write
from slideviz.system.cleanup import draft
from slideviz.system.grouping import grouped

_NAMES = {vtk: name for name, vtk in MESHIO_TYPES.items()}
"""meshio's name of an element type by VTK identifier."""
# Name of the cell data with the numbers of the boundaries, by format; else "marker".
_TAG = {
    "med": "cell_tags",
    "medit": "medit:ref",
    "nastran": "nastran:ref",
    "netgen": "netgen:index",
    "ugrid": "ugrid:ref",
}
_EXACT = 1e-12  # largest error of a coordinate in a written file, as a fraction of the extent

_TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "u1": "UInt8"}
"""VTK's name of a data type by NumPy's."""
_BLOCK_BYTES = 3 << 18  # a multiple of 3, so that the encoded blocks join
# Order of a prism's nodes in VTU files. Until VTK 9.7 (vtk!12988) the first triangle faced outward.
# Files do not say which order they have; other readers (older ParaView, meshio) expect this one.
# VTKHDF files have the new order.
_PRISM = np.array([0, 2, 1, 3, 5, 4])


def write_vtu(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh as VTU, with values and the names of its boundaries; or raise MeshError."""
    write_blocks(path, vtu_blocks(mesh, options.cell_data, options.point_data), options)


def write_with_meshio(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh in the format of meshio that the ending names, without values on its points.

    Netgen, MED and Abaqus files have the names of boundaries; other formats have their numbers at
    most. What meshio wrote is read again and compared, for meshio leaves out what a format cannot
    hold. Raises MeshError if the file cannot be written, or the format cannot hold the mesh.
    """
    name = formats_of(path)[0]
    data = _to_meshio(mesh, options.cell_data, name)
    with atomic_write(path, replaces=options.replaces) as file:
        # meshio wants a name, and some formats write several files.
        try:
            with draft(path.parent, is_folder=True) as folder:
                trial = folder / path.name
                _write(path, trial, data, name)
                _compare(path, trial, data, name)
                with trial.open("rb") as source:
                    shutil.copyfileobj(source, file)
        except OSError as problem:
            raise path_error(
                path,
                f"cannot be written: {problem.strerror or problem}; free some space or "
                "choose another folder",
            ) from problem


def _write(path: Path, trial: Path, data: meshio.Mesh, name: str) -> None:
    """Write meshio's mesh to ``trial``, in a folder of its own, in the format ``name``.

    Raises MeshError, which names ``path``, if it cannot be written or needs several files.
    """
    try:
        _write_by_meshio(path, trial, data, name)
    except MeshError as problem:
        # A full disk or a missing package says nothing of the mesh.
        if isinstance(problem.__cause__, ImportError) or getattr(problem.__cause__, "errno", None):
            raise
        lost = _not_written(path, trial, data, name)
        raise _not_held(path, name, lost) if lost else _fault(path, name, problem) from problem
    if len(list(trial.parent.iterdir())) != 1:
        raise path_error(
            path,
            f"cannot be written: the format {name} needs several files; use another, such as .vtu",
        )


def _write_by_meshio(path: Path, trial: Path, data: meshio.Mesh, name: str) -> None:
    # Without this XDMF puts the numbers in a second file.
    options = {"data_format": "XML"} if name == "xdmf" else {}
    with meshio_errors(path, f"written as {name}"):
        meshio.write(trial, data, file_format=name, **options)


def _not_written(path: Path, trial: Path, data: meshio.Mesh, name: str) -> list[str]:
    """Return words for the types of cells that the format lacks, by writing one of each alone.

    It has simple coordinates: some of meshio's writers fail on long numbers.
    """
    lost = []
    for block in data.cells:
        nodes = np.arange(block.data.shape[1])
        points = np.stack([nodes, nodes**2, nodes**3], axis=1).astype(float)
        part = meshio.Mesh(points[:, : data.points.shape[1]], [(block.type, nodes[None])])
        try:
            _write_by_meshio(path, trial, part, name)
        except MeshError:
            lost.append(f"{block.type} cells")
    return lost


def _fault(path: Path, name: str, problem: MeshError) -> MeshError:
    """Return the error for a mesh that the format could hold, but meshio does not write."""
    said = str(problem.__cause__) or type(problem.__cause__).__name__
    return path_error(
        path,
        f"cannot be written: meshio's writer of {name} fails on this mesh ({said[:80]}), but the "
        "mesh is valid; use another format, such as .vtu",
    )


def _not_held(path: Path, name: str, lost: list[str]) -> MeshError:
    return path_error(
        path,
        f"cannot be written: the format {name} does not hold the {', '.join(lost)} of "
        "this mesh; use another, such as .vtu",
    )


def _compare(path: Path, trial: Path, data: meshio.Mesh, name: str) -> None:
    """Raise MeshError, which names ``path``, if the file ``trial`` lacks some of ``data``."""
    try:
        loaded = load(trial, [name])
    except MeshError as problem:
        raise path_error(
            path,
            f"cannot be written: meshio cannot read again what it writes as {name}; use "
            "another format, such as .vtu",
        ) from problem
    lost = []
    if loaded.points.shape != data.points.shape:
        lost.append("points")
    elif np.abs(loaded.points - data.points).max() > _EXACT * np.ptp(data.points, axis=0).max():
        lost.append("digits of the coordinates")
    counts = [
        {kind: sum(len(c.data) for c in m.cells if c.type == kind) for kind in _NAMES.values()}
        for m in (data, loaded)
    ]
    lost += [f"{kind} cells" for kind in _NAMES.values() if counts[0][kind] != counts[1][kind]]
    lost += [f"cell data {key!r}" for key in data.cell_data if key not in loaded.cell_data]
    if lost:
        raise _not_held(path, name, lost)


def _to_meshio(mesh: Mesh, cell_data: Mapping[str, NDArray], name: str) -> meshio.Mesh:
    """Return the mesh for meshio and its format ``name``, a block for each type of element.

    Blocks of cells come first, then those of boundary elements, whose cell data are NaN.
    """
    blocks = []
    tags = []
    values: dict[str, list[NDArray]] = {key: [] for key in cell_data}
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        blocks.append((_NAMES[vtk], nodes))
        tags.append(np.zeros(len(nodes), np.int32))
        for key, array in cell_data.items():
            values[key].append(array[ids].astype(float))
    for vtk, nodes, numbers in boundary_blocks(mesh):
        blocks.append((_NAMES[vtk], nodes))
        tags.append(numbers.astype(np.int32))
        for key, array in cell_data.items():
            values[key].append(np.full((len(nodes), *array.shape[1:]), np.nan))
    names = dict(enumerate(mesh.marker_names, 1))
    # Only MED keeps two coordinates.
    points = mesh.points if name == "med" else padded(mesh.points)
    data = meshio.Mesh(points, blocks, cell_data=values)
    if name == "abaqus":
        data.cell_sets = {
            marker: [np.flatnonzero(t == number) for t in tags] for number, marker in names.items()
        }
        return data
    if name == "med":
        # Families of elements have negative numbers there.
        tags = [-t for t in tags]
        data.cell_tags = {-number: [marker] for number, marker in names.items()}
    if name == "netgen":
        data.field_data = {
            marker: np.array([number, mesh.dim - 1]) for number, marker in names.items()
        }
    if names:
        data.cell_data[_TAG.get(name, "marker")] = tags
    return data


def boundary_blocks(mesh: Mesh) -> list[tuple[int, NDArray, NDArray]]:
    """Return for each type of boundary element: type, nodes (m, n), marker's number from 1 (m,)."""
    blocks = grouped(
        (vtk, (nodes, np.full(len(nodes), number)))
        for number, marker in enumerate(mesh.markers, 1)
        for vtk, (_, nodes) in marker.cells.by_type.items()
    )
    return [
        (vtk, np.concatenate([n for n, _ in parts]), np.concatenate([t for _, t in parts]))
        for vtk, parts in blocks.items()
    ]


def vtu_blocks(
    mesh: Mesh, cell_data: Mapping[str, NDArray], point_data: Mapping[str, NDArray]
) -> Iterator[bytes]:
    """Yield a VTU file, block by block.

    The cells come first, in their order, then the elements of the markers. The cell data
    ``marker`` is 0 on cells and 1, 2, ... on the markers; the field data has for each marker
    name its number and dimension. ``cell_data``: values by name; they are NaN on the elements of
    the markers. ``point_data``: values on the points; vectors get a third component, as ParaView's
    arrows want.
    """
    groups = [mesh.cells, *(marker.cells for marker in mesh.markers)]
    every = Cells.joined(groups)
    types = every.types

    yield (
        b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" '
        b'byte_order="LittleEndian" header_type="UInt64">\n<UnstructuredGrid>\n<FieldData>\n'
    )
    for number, marker in enumerate(mesh.markers, 1):
        name = quoteattr(marker.name)
        yield (
            f'<DataArray type="Int64" Name={name} NumberOfComponents="2" NumberOfTuples="1" '
            f'format="ascii">{number} {mesh.dim - 1}</DataArray>\n'
        ).encode()
    yield (
        f'</FieldData>\n<Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{len(types)}">\n'
        "<Points>\n"
    ).encode()
    yield from _array("Points", padded(mesh.points))
    yield b"</Points>\n<Cells>\n"
    yield from _array("connectivity", _in_vtk_order(every))
    yield from _array("offsets", every.offsets[1:])
    yield from _array("types", types)
    yield b"</Cells>\n<CellData>\n"
    yield from _array("marker", np.repeat(np.arange(len(groups)), list(map(len, groups))))
    for name, values in cell_data.items():
        filled = np.full((len(types), *values.shape[1:]), np.nan)
        filled[: len(values)] = values
        yield from _array(name, filled)
    yield b"</CellData>\n<PointData>\n"
    for name, values in point_data.items():
        vectors = values.ndim == 2 and values.shape[1] == 2
        yield from _array(name, np.pad(values, ((0, 0), (0, 1))) if vectors else values)
    yield b"</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"


def _in_vtk_order(cells: Cells) -> IntArray:
    """Return the connectivity with the nodes of prisms in the order of VTU files."""
    first = cells.offsets[:-1][cells.types == 13][:, None]
    turned = cells.connectivity.copy()
    turned[first + np.arange(len(_PRISM))] = turned[first + _PRISM]
    return turned


def _array(name: str, values: NDArray) -> Iterator[bytes]:
    kind = values.dtype.str[1:]
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    yield (
        f'<DataArray type="{_TYPES[kind]}" Name={quoteattr(name)}{width} format="binary">'
    ).encode()
    little = np.ascontiguousarray(values, dtype=f"<{kind}" if kind != "u1" else "u1")
    content = np.array([little.nbytes], "<u8").tobytes() + little.tobytes()
    for begin in range(0, len(content), _BLOCK_BYTES):
        yield b64encode(content[begin : begin + _BLOCK_BYTES])
    yield b"</DataArray>\n"
