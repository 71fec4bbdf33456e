"""Writing bulk data of Nastran: points in the long format, with as many digits as it holds.

A number has 16 places. Most doubles need 17 digits, a point, and a sign or exponent: the nearest
number of 16 places is written, which is off by less than 1e-13 of a coordinate from 0.1 to 1e14,
and 1e-9 of any other. Boundaries are shells whose property is their number.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slideviz.errors import path_error
from slideviz.formats.meshio.write import boundary_blocks
from slideviz.formats.table import WriteOptions, write_blocks
from slideviz.mesh.model import IntArray, Mesh
from slideviz.mesh.surfaces import padded

CARDS = {5: "CTRIA3", 9: "CQUAD4", 10: "CTETRA", 14: "CPYRAM", 13: "CPENTA", 12: "CHEXA"}
"""Name of an element by VTK identifier; both order nodes alike."""
PLACES = 16
FIRST = 6  # nodes on the first line of an element
BLOCK = 20_000  # cards that are written at once
MOST = 99_999_999  # largest number of a node or element in eight places


def write_nastran(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh as bulk data of Nastran, whose boundaries are numbers; or raise MeshError."""
    require_nastran(mesh, path)
    write_blocks(path, _blocks(mesh), options)


def require_nastran(mesh: Mesh, path: Path) -> None:
    """Raise MeshError if a file, ``path``, cannot hold a mesh: it is 2D, or too large."""
    if mesh.dim != 3 or max(len(mesh.points), len(mesh.cells)) > MOST // 2:
        raise path_error(
            path,
            "cannot be written: Nastran's bulk data hold 3D meshes whose numbers of nodes and "
            "elements have 8 places; write .su2",
        )


def _blocks(mesh: Mesh) -> Iterator[bytes]:
    yield b"BEGIN BULK\n"
    points = padded(mesh.points).tolist()
    for start in range(0, len(points), BLOCK):
        yield "".join(
            f"GRID*   {number:<16d}{'':16}{x:>16}{y:>16}\n*       {z:>16}\n"
            for number, row in enumerate(points[start : start + BLOCK], start + 1)
            for x, y, z in [map(real_text, row)]
        ).encode()
    groups = [
        (vtk, nodes, np.full(len(nodes), len(mesh.markers) + 1))
        for vtk, (_, nodes) in mesh.cells.by_type.items()
    ]
    first = 1
    for vtk, nodes, numbers in [*groups, *boundary_blocks(mesh)]:
        card = CARDS[vtk]
        for start in range(0, len(nodes), BLOCK):
            rows = zip(
                numbers[start : start + BLOCK], nodes[start : start + BLOCK] + 1, strict=True
            )
            yield "".join(
                f"{card:8}{first + start + k:<8d}{group:<8d}{_joined(row)}\n"
                for k, (group, row) in enumerate(rows)
            ).encode()
        first += len(nodes)
    yield b"ENDDATA\n"


def _joined(row: IntArray) -> str:
    """Return the nodes of an element in eight places each; after the sixth a new line begins."""
    fields = [f"{node:<8d}" for node in row.tolist()]
    more = "".join(fields[FIRST:])
    return "".join(fields[:FIRST]) + (f"\n+       {more}" if more else "")


def real_text(value: float) -> str:
    """Return a number in at most 16 places, as exactly as these hold it."""
    text = repr(value)
    if len(text) <= PLACES and "e" not in text:
        return text
    room = PLACES - 1 - (value < 0.0)  # for digits and the exponent
    exponent = f"{int(text.partition('e')[2] or np.floor(np.log10(abs(value)))):+d}"
    mantissa, _, power = f"{value:.{room - 1 - len(exponent)}e}".partition("e")
    texts = [f"{mantissa}{int(power):+d}"]
    values = [float(f"{mantissa}e{power}")]
    if 1e-3 < abs(value) < 1e14:
        whole = len(str(int(abs(value)))) if abs(value) >= 1.0 else 0
        fixed = f"{value:#.{room - whole}f}"
        texts.append(fixed if whole else fixed.replace("0.", ".", 1))
        values.append(float(fixed))
    best = min(range(len(texts)), key=lambda k: (len(texts[k]) > PLACES, abs(values[k] - value)))
    return texts[best]
