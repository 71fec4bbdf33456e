"""Writing SU2 binary meshes (``.su2b``), of arrays or of functions that return parts of them.

A mesh that was read from such a file is written as it was: with the same width, byte order and
order of its elements. Others are written as by SU2: counts of 8 bytes, little endian, elements
sorted by type. Each element has its index, so that a mesh is read back with its cells in the order
that it had.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.formats.su2.read import Document
from slideviz.formats.su2b.layout import NAME_BYTES, SEND_RECEIVE
from slideviz.formats.su2b.read import BLOCK, BinaryForm
from slideviz.formats.table import WriteOptions, ZoneContent, write_blocks
from slideviz.mesh.check import check_mesh
from slideviz.mesh.elements import SIZES
from slideviz.mesh.model import CellRows, Cells, IntArray, Mesh
from slideviz.mesh.zones import zones_of
from slideviz.system.threads import cuts

SORTED = (3, 5, 9, 10, 12, 13, 14)  # SU2's order of the types of elements: ascending
LARGEST_4 = 2**32 - 1


def write_su2b(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh as SU2 binary; MeshError as `su2b_blocks`, or if it cannot be written."""
    write_blocks(path, su2b_blocks(mesh), options)


def su2b_blocks(mesh: Mesh) -> Iterator[bytes]:
    """Yield the SU2 binary file of a mesh, block by block.

    For a mesh that is one zone of a ``.su2b`` file, the other zones are written, too. Raises
    MeshError if a mesh cannot be used, has a halo, or has a name that cannot stand in such a file.
    """
    zones = zones_of(mesh)
    for zone in zones:
        check_mesh(zone)
        require_binary(zone)
    form = zones[0].origin if isinstance(zones[0].origin, BinaryForm) else None
    around = form if len(zones) == 1 and form is not None and form.before else None
    yield b"".join(file_head(len(zones), form)) if around is None else around.before
    for number, zone in enumerate(zones, 1):
        own = zone.origin if form is not None and isinstance(zone.origin, BinaryForm) else None
        same = own is not None and (zone.cells is own.cells or zone.cells.same_as(own.cells))
        order = own.order if own is not None and same else _by_type(zone.cells)
        yield from zone_blocks(
            _zone(zone, order), number if around is None else zone.zone or 1, own
        )
    yield b"" if around is None else around.after


def require_binary(mesh: Mesh, _path: Path | None = None) -> None:
    """Raise MeshError for a halo, or a marker's name that an SU2 binary file cannot hold."""
    for zone in zones_of(mesh):
        if zone.halo is not None or (isinstance(zone.origin, Document) and zone.origin.sends):
            raise halo_error(zone.name)
        require_binary_names(zone.name, zone.marker_names)


def halo_error(name: str) -> MeshError:
    """Return the error for a mesh, called ``name``, with a halo."""
    return MeshError(
        f"{name}: has a halo ({SEND_RECEIVE} markers), which an SU2 binary mesh cannot hold; write "
        "a .su2 file, or make the mesh without its halo"
    )


def require_binary_names(mesh: str, names: Iterable[str]) -> None:
    """Raise if a name of a boundary of the mesh called ``mesh`` cannot be in an SU2 binary file.

    Raises MeshError if a name is empty, not printable, too long, or ``SEND_RECEIVE``.
    """
    for name in names:
        size = len(name.encode("utf-8", "replace"))
        if not name or not name.isprintable() or size >= NAME_BYTES or name.upper() == SEND_RECEIVE:
            raise MeshError(
                f"{mesh}: the marker name {name!r} cannot be written to an SU2 binary file, which "
                f"has room for {NAME_BYTES - 1} bytes ({size} given) and no {SEND_RECEIVE}; rename "
                "the marker"
            )


def content_blocks(contents: Sequence[ZoneContent], name: str) -> Iterator[bytes]:
    """Yield the SU2 binary file of zones whose parts are made by functions, block by block.

    Raises MeshError if a boundary has a name that cannot stand in such a file.
    """
    require_binary_names(name, (marker.name for content in contents for marker in content.markers))
    yield from file_head(len(contents))
    for number, content in enumerate(contents, 1):
        yield from zone_blocks(content, number)


def file_head(zones: int, form: BinaryForm | None = None) -> Iterator[bytes]:
    """Yield the head of a file, in width and byte order of ``form``, else 8 and little endian."""
    width, sign = (8, "<") if form is None else (form.width, form.byte_order)
    yield np.array([width, zones], f"{sign}i4").tobytes()


def zone_blocks(zone: ZoneContent, number: int, form: BinaryForm | None = None) -> Iterator[bytes]:
    """Yield one zone of a file, in the width and byte order of ``form``, else 8 and little endian.

    Raises MeshError if its numbers do not fit into counts of 4 bytes.
    """
    width, sign = (8, "<") if form is None else (form.width, form.byte_order)
    conn = np.dtype(f"{sign}u{width}")

    def short(*values: int) -> bytes:
        return np.array(values, f"{sign}i4").tobytes()

    yield short(number, zone.dim) + np.array([zone.n_cells], conn).tobytes()
    start = 0
    for i, j in cuts(0, zone.n_cells, BLOCK):
        ends = start + np.cumsum(SIZES[zone.types(i, j)] + 2)
        yield np.concatenate([[start], ends[:-1]]).astype(conn).tobytes()
        start = int(ends[-1])
    if width == 4 and max(start, zone.n_points) > LARGEST_4:
        raise MeshError("the mesh has more cells than a file with counts of 4 bytes can hold")
    yield np.array([start], conn).tobytes()
    for i, j in cuts(0, zone.n_cells, BLOCK):
        yield rows_of(*zone.cells(i, j)).astype(conn, copy=False).tobytes()
    yield np.array([zone.n_points], conn).tobytes()
    kind = np.dtype([("x", f"{sign}f8", (zone.dim,)), ("i", conn)])
    for i, j in cuts(0, zone.n_points, BLOCK):
        block = np.empty(j - i, kind)
        block["x"] = zone.points(i, j)
        block["i"] = np.arange(i, j)
        yield block.tobytes()
    yield short(len(zone.markers))
    raw = {} if form is None else {name.partition(b"\0")[0]: name for name in form.names}
    for marker in zone.markers:
        name = marker.name.encode()
        yield raw.get(name, padded(name)) + marker_table(marker.cells, conn)


def padded(name: bytes) -> bytes:
    """Return the name of a marker padded with zeros to ``NAME_BYTES``."""
    return name.ljust(NAME_BYTES, b"\0")


def marker_table(cells: Cells, conn: np.dtype) -> bytes:
    """Return count, offsets and list, of type ``conn``, of a marker's elements, as bytes."""
    head = np.concatenate([[len(cells), 0], np.cumsum(SIZES[cells.types] + 1)])
    return np.concatenate([head, rows_of(cells.types, cells.connectivity)]).astype(conn).tobytes()


def rows_of(types: NDArray[np.uint8], nodes: IntArray, ids: IntArray | None = None) -> IntArray:
    """Return the list (n,) of elements in the file: type, nodes and, if given, index of each.

    ``types`` and ``ids`` are (k,), ``nodes`` those of all elements one after the other.
    """
    sizes = SIZES[types]
    more = 1 if ids is None else 2
    if len(types) and (types == types[0]).all():
        table = np.empty((len(types), int(sizes[0]) + more), np.int64)
        table[:, 0] = types[0]
        table[:, 1 : 1 + int(sizes[0])] = nodes.reshape(len(types), -1)
        if ids is not None:
            table[:, -1] = ids
        return table.ravel()
    ends = np.cumsum(sizes + more)
    out = np.empty(len(nodes) + more * len(types), np.int64)
    keep = np.ones(len(out), bool)
    keep[ends - sizes - more] = False
    out[ends - sizes - more] = types
    if ids is not None:
        keep[ends - 1] = False
        out[ends - 1] = ids
    out[keep] = nodes
    return out


def _by_type(cells: Cells) -> IntArray | None:
    """Return indices (m,) that sort cells by type as SU2 does, or None if they are sorted so."""
    types = cells.types
    return None if (types[1:] >= types[:-1]).all() else np.argsort(types, kind="stable")


def _zone(mesh: Mesh, order: IntArray | None) -> ZoneContent:
    """Return the content of a zone for a mesh; ``order`` has the cell at each place of the file."""
    cells = mesh.cells

    def part(i: int, j: int) -> CellRows:
        if order is not None:
            some = cells.take(order[i:j])
            return some.types, some.connectivity, order[i:j]
        begin, end = cells.offsets[[i, j]]
        return cells.types[i:j], cells.connectivity[begin:end], np.arange(i, j)

    def types(i: int, j: int) -> NDArray[np.uint8]:
        return cells.types[i:j] if order is None else cells.types[order[i:j]]

    return ZoneContent(
        dim=mesh.dim,
        n_cells=len(cells),
        n_points=len(mesh.points),
        cells=part,
        types=types,
        points=lambda i, j: mesh.points[i:j],
        markers=mesh.markers,
    )
