"""Writing OpenFOAM's meshes: ``points`` alone, in the format and compression that it had.

It goes into the case that the mesh was read from, one of its times, or a new case. That gets a copy
of all other files of ``polyMesh``, and of the folder ``system``.
"""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from filecmp import cmp
from pathlib import Path

import numpy as np

from slideviz.errors import path_error
from slideviz.formats.openfoam.read import PolyMesh
from slideviz.formats.openfoam_paths import REGIONS, instance_of
from slideviz.formats.source import open_source
from slideviz.formats.table import WriteOptions, write_blocks
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.zones import zones_of
from slideviz.system.atomic import make_folder

_CELLS = tuple(f"{name}{end}" for name in ("faces", "owner", "neighbour") for end in ("", ".gz"))
_POINT = re.compile(rb"(\([^()]*\))")


def write_polymesh(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write the points of a mesh that was read from OpenFOAM's files.

    Points that did not move keep the bytes of the file. Raises MeshError if the mesh was not read
    from such files, another mesh is there already, or a file cannot be written.
    """
    for origin, points in _regions(mesh, path):
        target = _target(path, origin)
        content = _content(target, origin, points)
        for file, place in _copies(target, origin).items():
            make_folder(place.parent)
            write_blocks(place, [open_source(file)[:]], WriteOptions({}, {}))
        make_folder(target.parent)
        write_blocks(target, [content], options)


def require_polymesh(mesh: Mesh, path: Path) -> None:
    """Raise MeshError if a mesh cannot be written to ``path`` by `write_polymesh`."""
    for origin, _ in _regions(mesh, path):
        _target(path, origin)


def _regions(mesh: Mesh, path: Path) -> Iterator[tuple[PolyMesh, FloatArray]]:
    """Yield the origin and the points of each region."""
    for zone in zones_of(mesh):
        origin = zone.origin
        if not isinstance(origin, PolyMesh) or (
            origin.layer is None and len(zone.points) < len(origin.points)
        ):
            raise path_error(
                path,
                "of OpenFOAM's meshes only the points are written, but "
                f"{mesh.name} is not read from one; write .su2, or .vtu for ParaView",
            )
        yield origin, zone.points


def _target(path: Path, origin: PolyMesh) -> Path:
    """Return the ``points`` to write; MeshError if another mesh is there."""
    folder = path.parent
    if path.name == REGIONS or origin.region:
        folder = instance_of(path.absolute())[0] / origin.region / "polyMesh"
    for name in _CELLS:
        here = origin.folder / name
        there = folder / name
        if here.exists() and there.exists() and not cmp(here, there, shallow=False):
            raise path_error(there, f"is of another mesh than {here}; choose another folder")
    names = dict.fromkeys((origin.file.path.name, "points", "points.gz"))
    present = [folder / name for name in names if (folder / name).exists()]
    return present[0] if present else folder / origin.file.path.name


def _copies(target: Path, origin: PolyMesh) -> dict[Path, Path]:
    """Return the files to copy into a new case, with their places; none for a time of a case."""
    folder = target.parent
    instance, region = instance_of(target.absolute())
    constant = instance.parent / "constant" / region / "polyMesh"
    if any(any(where.glob("faces*")) for where in (folder, constant)):
        return {}
    files = [one for one in origin.folder.iterdir() if one.is_file()]
    copies = {one: folder / one.name for one in files if not one.name.startswith("points")}
    before, _ = instance_of(origin.folder / target.name)
    if origin.region:
        copies[before / REGIONS] = instance / REGIONS
    system = before.parent / "system"
    for one in system.rglob("*"):
        if one.is_file():
            copies[one] = instance.parent / one.relative_to(before.parent)
    return {one: place for one, place in copies.items() if not place.exists()}


def _content(target: Path, origin: PolyMesh, points: FloatArray) -> bytes:
    """Return the bytes of a file with other points (n, d), in the form of that which was read."""
    moved = points[: len(origin.points)]
    if origin.layer is not None:
        moved = origin.layer.displaced(origin.points, points)
    changed = np.flatnonzero((moved != origin.points).any(axis=1))
    data = origin.file.data
    place = origin.place
    if origin.file.binary:
        values = np.frombuffer(data[place], origin.file.scalar).reshape(-1, 3).copy()
        with np.errstate(over="ignore"):
            values[changed] = moved[changed]
        if not np.isfinite(values).all():
            raise path_error(target, f"a coordinate is larger than {values.dtype} holds; scale it")
        body = values.tobytes()
    else:
        texts = _POINT.split(data[place])
        for index, (x, y, z) in zip(changed.tolist(), moved[changed].tolist(), strict=True):
            texts[2 * index + 1] = b"(%r %r %r)" % (x, y, z)
        body = b"".join(texts)
    content = data[: place.start] + body + data[place.stop :]
    return gzip.compress(content, mtime=0) if target.suffix == ".gz" else content
