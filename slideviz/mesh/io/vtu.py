"""Writing VTU files, which carry values on cells to ParaView.

meshio writes VTU too, but reorders cells of mixed type and loses the names of boundaries.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from slideviz.mesh.model import IntArray, Mesh

_TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "u1": "UInt8"}
_BLOCK_BYTES = 3 << 18
"""A multiple of 3, so that the encoded blocks join."""
# VTK counts the nodes of a prism so that its first triangle faces outward.
_PRISM = np.array([0, 2, 1, 3, 5, 4])


def vtu_blocks(
    mesh: Mesh, cell_data: Mapping[str, NDArray], point_data: Mapping[str, NDArray] | None = None
) -> Iterator[bytes]:
    """Yield a VTU file, block by block.

    The cells come first, in their order, then the elements of the markers. The cell data
    ``marker`` is 0 on cells and 1, 2, ... on the markers; the field data has for each marker
    name its number and dimension.

    Parameters
    ----------
    cell_data : mapping of str to (n_cells,) or (n_cells, k)
        Values by name; they are NaN on the elements of the markers.
    point_data : mapping of str to (n,) or (n, d), optional
        Values on the points; vectors get a third component, as ParaView's arrows want.
    """
    groups = [mesh.cells, *(marker.cells for marker in mesh.markers)]
    lengths = [len(cells) for cells in groups]
    types = np.concatenate([cells.types for cells in groups])
    offsets = np.cumsum(np.concatenate([np.diff(cells.offsets) for cells in groups]))
    nodes = np.concatenate([cells.connectivity for cells in groups])
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.dim] = mesh.points

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
        f'</FieldData>\n<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(types)}">\n'
        "<Points>\n"
    ).encode()
    yield from _array("Points", points)
    yield b"</Points>\n<Cells>\n"
    yield from _array("connectivity", _in_vtk_order(nodes, offsets, types))
    yield from _array("offsets", offsets)
    yield from _array("types", types)
    yield b"</Cells>\n<CellData>\n"
    yield from _array("marker", np.repeat(np.arange(len(groups)), lengths))
    for name, values in cell_data.items():
        padded = np.full((len(types), *values.shape[1:]), np.nan)
        padded[: len(values)] = values
        yield from _array(name, padded)
    yield b"</CellData>\n<PointData>\n"
    for name, values in (point_data or {}).items():
        vectors = values.ndim == 2 and values.shape[1] == 2
        yield from _array(name, np.pad(values, ((0, 0), (0, 1))) if vectors else values)
    yield b"</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"


def _in_vtk_order(nodes: IntArray, offsets: IntArray, types: NDArray[np.uint8]) -> IntArray:
    """Return the connectivity with the nodes of prisms in VTK's order."""
    first = offsets[types == 13][:, None] - len(_PRISM)
    turned = nodes.copy()
    turned[first + np.arange(len(_PRISM))] = nodes[first + _PRISM]
    return turned


def _array(name: str, values: NDArray) -> Iterator[bytes]:
    """Yield one array, uncompressed: its length in bytes and its bytes in base64."""
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
