"""Writing Gmsh's format 4.1, binary: each boundary is an entity with a physical group of its name.

The parts are those of the section "MSH file format" of Gmsh's manual.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slideviz.formats.table import WriteOptions, write_blocks
from slideviz.mesh.model import Mesh
from slideviz.mesh.surfaces import padded

TYPES = {3: 1, 5: 2, 9: 3, 10: 4, 12: 5, 13: 6, 14: 7}
"""Gmsh's number of an element type by VTK identifier; both order nodes alike."""


def write_gmsh(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh in Gmsh's format 4.1, with names of boundaries; or raise MeshError."""
    write_blocks(path, _blocks(mesh, options), options)


def _blocks(mesh: Mesh, options: WriteOptions) -> Iterator[bytes]:
    points = padded(mesh.points)
    dim = mesh.dim
    names = [name.replace('"', "'") for name in mesh.marker_names]
    yield b"$MeshFormat\n4.1 1 8\n" + _ints(1) + b"\n$EndMeshFormat\n$PhysicalNames\n"
    lines = [f'{dim - 1} {number} "{name}"' for number, name in enumerate(names, 1)]
    yield "\n".join([str(len(names)), *lines, "$EndPhysicalNames", "$Entities", ""]).encode()
    counts = [0, 0, 0, 0]
    counts[dim - 1 : dim + 1] = len(names), 1
    yield _sizes(*counts)
    box = np.concatenate([points.min(axis=0), points.max(axis=0)]).astype("<f8").tobytes()
    entities = [*range(1, len(names) + 1), 1]
    for group, entity in enumerate(entities, 1):
        yield _ints(entity) + box + _sizes(1) + _ints(group) + _sizes(0)
    yield b"\n$EndEntities\n$Nodes\n"
    count = len(points)
    yield _sizes(1, count, 1, count) + _ints(dim, 1, 0) + _sizes(count)
    yield np.arange(1, count + 1, dtype="<u8").tobytes()
    yield points.astype("<f8").tobytes()
    yield b"\n$EndNodes\n$Elements\n"
    groups = [(dim, 1, mesh.cells)]
    groups += [(dim - 1, number, one.cells) for number, one in enumerate(mesh.markers, 1)]
    total = sum(len(cells) for *_, cells in groups)
    blocks = [
        (level, entity, vtk, nodes)
        for level, entity, cells in groups
        for vtk, (_, nodes) in cells.by_type.items()
    ]
    yield _sizes(len(blocks), total, 1, total)
    order = np.concatenate([ids for ids, _ in mesh.cells.by_type.values()])
    first = 1
    for level, entity, vtk, nodes in blocks:
        yield _ints(level, entity, TYPES[vtk]) + _sizes(len(nodes))
        tags = np.arange(first, first + len(nodes))
        yield np.column_stack([tags, nodes + 1]).astype("<u8").tobytes()
        first += len(nodes)
    yield b"\n$EndElements\n"
    for name, values in options.cell_data.items():
        rows = np.full((total, int(np.prod(values.shape[1:]))), np.nan)
        rows[: len(order)] = values.reshape(len(values), -1)[order]
        head = f'$ElementData\n1\n"{name}"\n1\n0.0\n3\n0\n{rows.shape[1]}\n{total}\n'
        kind = [("tag", "<i4"), ("values", "<f8", rows.shape[1:])]
        table = np.zeros(total, kind)
        table["tag"] = np.arange(1, total + 1)
        table["values"] = rows
        yield head.encode() + table.tobytes() + b"\n$EndElementData\n"


def _ints(*values: int) -> bytes:
    return np.array(values, "<i4").tobytes()


def _sizes(*values: int) -> bytes:
    return np.array(values, "<u8").tobytes()
