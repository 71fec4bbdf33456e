"""Writing SU2 meshes: the file that was read with other coordinates, or all of it anew.

Numbers are written with as few digits as identify the float64, so that nothing is lost.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slideviz.errors import MeshError
from slideviz.mesh.check import check_mesh, check_points
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.io.su2 import Document
from slideviz.mesh.io.su2_zone import SEND_RECEIVE
from slideviz.mesh.model import Cells, FloatArray, Marker, Mesh

_BLOCK_ROWS = 20_000


def su2_blocks(mesh: Mesh) -> Iterator[bytes]:
    """Yield the SU2 file of a mesh, block by block.

    A mesh that was read from an SU2 file and has the same cells and markers gives that file, in
    which only the coordinates that changed are replaced. Any other mesh is written anew; what
    slideviz does not know of the file it came from stands at the end of its zone.

    Raises
    ------
    MeshError
        The mesh cannot be used, or a marker's name cannot stand in an SU2 file.
    """
    document = mesh.document
    if document is not None and _only_points_differ(mesh, document):
        check_points(mesh)
        yield from _patched(document, mesh.points)
        return
    check_mesh(mesh)
    for marker in mesh.markers:
        _check_name(mesh, marker.name)
    if document is None:
        yield from _zone(mesh)
        yield from _markers(mesh.markers, 0)
        return
    raw, (begin, end) = document.raw, document.zone
    yield raw[:begin]
    yield from _zone(mesh)
    yield from _markers(mesh.markers, len(document.sends))
    yield from (_whole(raw[a:b]) for a, b in (*document.sends, *document.kept))
    yield raw[end:]


def _only_points_differ(mesh: Mesh, document: Document) -> bool:
    if mesh.points.shape != document.points.shape:
        return False
    if mesh.cells is not document.cells and not mesh.cells.same_as(document.cells):
        return False
    return mesh.marker_names == tuple(m.name for m in document.markers) and all(
        a is b or a.cells.same_as(b.cells)
        for a, b in zip(mesh.markers, document.markers, strict=True)
    )


def _patched(document: Document, points: FloatArray) -> Iterator[bytes]:
    """Yield the file with every coordinate that changed, in any bit, in its place."""
    changed = np.flatnonzero(points.view(np.int64) != document.points.view(np.int64))
    begins, ends = document.begins.ravel()[changed], document.ends.ravel()[changed]
    values = points.ravel()[changed]
    done = 0
    for i in range(0, len(changed), _BLOCK_ROWS):
        part = slice(i, i + _BLOCK_ROWS)
        stop = int(ends[part][-1])
        text = document.raw[done:stop].decode("latin-1")
        firsts = (begins[part] - done).tolist()
        afters = [0, *(ends[part] - done).tolist()]
        pieces = []
        for after, first, value in zip(afters, firsts, values[part].tolist(), strict=False):
            pieces.append(text[after:first])
            pieces.append(repr(value))
        yield "".join(pieces).encode("latin-1")
        done = stop
    yield document.raw[done:]


def _check_name(mesh: Mesh, name: str) -> None:
    """Raise when reading the file again would give another name."""
    if not name or name != name.strip() or not name.isprintable() or "%" in name:
        raise MeshError(
            f"{mesh.name}: the marker name {name!r} cannot stand in an SU2 file; rename it without "
            "percent sign, line break or blanks around it"
        )
    if name.upper() == SEND_RECEIVE:
        raise MeshError(
            f"{mesh.name}: a boundary cannot be named {name}, which SU2 uses for halos; rename it"
        )


def _zone(mesh: Mesh) -> Iterator[bytes]:
    """Yield dimension, elements and points."""
    yield f"NDIME= {mesh.dim}\nNELEM= {len(mesh.cells)}\n".encode()
    yield from _elements(mesh.cells, numbered=True)
    yield f"NPOIN= {len(mesh.points)}\n".encode()
    for i in range(0, len(mesh.points), _BLOCK_ROWS):
        rows = mesh.points[i : i + _BLOCK_ROWS].tolist()
        yield "".join(
            [f"{' '.join(map(repr, row))} {k}\n" for k, row in enumerate(rows, i)]
        ).encode()


def _markers(markers: tuple[Marker, ...], sends: int) -> Iterator[bytes]:
    yield f"NMARK= {len(markers) + sends}\n".encode()
    for marker in markers:
        yield f"MARKER_TAG= {marker.name}\nMARKER_ELEMS= {len(marker.cells)}\n".encode()
        yield from _elements(marker.cells, numbered=False)


def _elements(cells: Cells, *, numbered: bool) -> Iterator[bytes]:
    """Yield a line for each element: type, nodes, and its index where asked for."""
    form = {vtk: f"{vtk}{' %d' * (row.n_nodes + numbered)}\n" for vtk, row in ELEMENTS.items()}
    for i in range(0, len(cells), _BLOCK_ROWS):
        types = cells.types[i : i + _BLOCK_ROWS].tolist()
        offsets = cells.offsets[i : i + len(types) + 1]
        numbers = cells.connectivity[offsets[0] : offsets[-1]]
        if numbered:
            numbers = np.insert(numbers, offsets[1:] - offsets[0], np.arange(i, i + len(types)))
        yield ("".join([form[vtk] for vtk in types]) % tuple(numbers.tolist())).encode()


def _whole(text: bytes) -> bytes:
    """Return a section that ends with its line."""
    return text if text.endswith(b"\n") else text + b"\n"
