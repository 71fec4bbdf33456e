"""Zones: the meshes of a file with several, as one mesh, and each of them alone again.

They share no points, even where these coincide (`slideviz.mesh.interfaces`). A boundary keeps its
name where no other zone has one of that name; else the number of its zone comes first: ``1:blade``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Sized
from dataclasses import fields, replace
from itertools import accumulate, pairwise

import numpy as np

from slideviz.errors import MeshError
from slideviz.mesh.halo import Halo
from slideviz.mesh.interfaces import find_interfaces
from slideviz.mesh.model import (
    Assembly,
    Cells,
    IntArray,
    Marker,
    Mesh,
    Part,
    Skin,
    SkinAssembly,
    ZoneInterface,
    ZonePart,
    sealed,
)


def numbered(zone: int, name: str) -> str:
    """Return the name of a boundary with the number of its zone: ``1:blade``."""
    return f"{zone}:{name}"


def without_zone(name: str) -> str:
    """Return the name of a boundary without the number of its zone, if it has one."""
    number, _, alone = name.partition(":")
    return alone if number.isdecimal() and alone else name


def join_zones(zones: Sequence[Mesh]) -> Mesh:
    """Return the mesh of all zones of a file; of a single one, that.

    Raises MeshError if they have different dimensions.
    """
    first = zones[0]
    if len(zones) == 1:
        return first
    if len({zone.dim for zone in zones}) > 1:
        dims = ", ".join(f"{zone.dim}D" for zone in zones)
        raise MeshError(
            f"{first.name}: its zones are {dims}, which cannot be one mesh; choose one with ZONE= "
            "in a case, or --zone"
        )
    names = unique_names([zone.marker_names for zone in zones])
    points = _slices([zone.points for zone in zones])
    cells = _slices([zone.cells for zone in zones])
    markers = _slices([zone.markers for zone in zones])
    *first_point, n_points = accumulate((zone.file_counts[0] for zone in zones), initial=0)
    *first_cell, n_cells = accumulate((zone.file_counts[1] for zone in zones), initial=0)
    coords = sealed(np.concatenate([zone.points for zone in zones]))
    alone = [
        replace(zone, points=coords[part], interfaces=())
        for zone, part in zip(zones, points, strict=True)
    ]
    mesh = Assembly(
        points=coords,
        cells=Cells.joined(
            [_shifted(zone.cells, part.start) for zone, part in zip(zones, points, strict=True)]
        ),
        markers=tuple(
            Marker(name, _shifted(marker.cells, part.start))
            for zone, part, own in zip(zones, points, names, strict=True)
            for name, marker in zip(own, zone.markers, strict=True)
        ),
        origin=first.origin,
        name=first.name,
        zone=None,
        zones=len(zones),
        parts=tuple(map(ZonePart, alone, points, cells, markers, first_point, first_cell)),
        source=first.source,
        remarks=tuple(f"zone {zone.zone}: {text}" for zone in zones for text in zone.remarks),
    )
    mesh = replace(mesh, halo=_halo(mesh), interfaces=tuple(_interfaces(mesh)))
    if not all(isinstance(zone, Skin) for zone in zones):
        return mesh
    whole = [zone.numbering for zone in zones]
    numbers = [part.points + first for part, first in zip(whole, first_point, strict=True)]
    ids = [part.cells + first for part, first in zip(whole, first_cell, strict=True)]
    part = Part(sealed(np.concatenate(numbers)), sealed(np.concatenate(ids)), n_points, n_cells)
    return SkinAssembly(**{one.name: getattr(mesh, one.name) for one in fields(mesh)}, part=part)


def unique_names(zones: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return the names of the boundaries of zones, numbered as ``1:blade`` where two share one."""
    uses = Counter(name for names in zones for name in names)
    return [
        [numbered(k, name) if uses[name] > 1 else name for name in names]
        for k, names in enumerate(zones, 1)
    ]


def zones_of(mesh: Mesh) -> tuple[Mesh, ...]:
    """Return each zone of a mesh alone, its boundaries with their names in the file."""
    out = []
    for part in mesh.parts:
        points = mesh.points[part.points]
        before = part.mesh.points
        same = points.ctypes.data == before.ctypes.data
        out.append(part.mesh if same else replace(part.mesh, points=points))
    return tuple(out)


def with_zones(mesh: Assembly, zones: Sequence[Mesh]) -> Assembly:
    """Return a mesh with the points and the origins of its zones as in ``zones``."""
    parts = [
        replace(part, mesh=replace(part.mesh, origin=zone.origin))
        for part, zone in zip(mesh.parts, zones, strict=True)
    ]
    points = sealed(np.concatenate([zone.points for zone in zones]))
    return replace(mesh, points=points, origin=zones[0].origin, parts=tuple(parts))


def names_in(mesh: Mesh, part: ZonePart) -> dict[str, str]:
    """Return the names that the boundaries of a zone have in its file, by those in the mesh."""
    names = mesh.marker_names[part.markers]
    return dict(zip(names, part.mesh.marker_names, strict=True))


def names_from(mesh: Mesh, part: ZonePart) -> dict[str, str]:
    """Return the names that the boundaries of a zone have in the mesh, by those in its file."""
    return {file: name for name, file in names_in(mesh, part).items()}


def marker_zones(mesh: Mesh) -> list[int]:
    """Return the number of the zone of each boundary, in their order."""
    return [
        number
        for number, part in enumerate(mesh.parts, mesh.zone or 1)
        for _ in range(part.markers.start, part.markers.stop)
    ]


def require_one_zone(mesh: Mesh, what: str) -> None:
    """Raise MeshError if a mesh has several zones; ``what`` is of one, for the message."""
    if isinstance(mesh, Assembly):
        raise MeshError(
            f"{mesh.name}: has {mesh.zones} zones, but {what} is of one; choose it with ZONE= in a "
            "case, or --zone"
        )


def spellings(mesh: Mesh) -> Mapping[str, str]:
    """Return the names of the boundaries by all that may be written for them, as ``1:blade``."""
    out: dict[str, str] = {}
    for number, part in enumerate(mesh.parts if mesh.zones > 1 else (), mesh.zone or 1):
        out |= {numbered(number, file): name for name, file in names_in(mesh, part).items()}
    return out


def _slices(parts: Sequence[Sized]) -> list[slice]:
    """Return the place of each part where all stand one after the other."""
    return [slice(*ends) for ends in pairwise(accumulate(map(len, parts), initial=0))]


def _shifted(cells: Cells, by: int) -> Cells:
    return Cells(cells.types, cells.offsets, sealed(cells.connectivity + by))


def _halo(mesh: Mesh) -> Halo | None:
    """Return the halos of all zones as one."""
    halos = [(part, part.mesh.halo) for part in mesh.parts if part.mesh.halo is not None]
    if not halos:
        return None
    cells = np.zeros(len(mesh.cells), bool)
    sides = []
    for part, halo in halos:
        cells[part.cells] = halo.cells
        name = names_from(mesh, part)
        sides += [(name[one], name[other]) for one, other in halo.sides]

    def nodes(field: str) -> IntArray:
        each = [getattr(halo, field) + part.points.start for part, halo in halos]
        return sealed(np.concatenate(each))

    return Halo(
        nodes("receivers"),
        nodes("donors"),
        sealed(np.concatenate([halo.rotations for _, halo in halos])),
        nodes("outer"),
        sealed(cells),
        tuple(sides),
        sealed(np.concatenate([halo.mismatch for _, halo in halos])),
    )


def _interfaces(mesh: Mesh) -> Iterator[ZoneInterface]:
    places = [
        (number, marker.name, mesh.points[marker.nodes])
        for number, part in enumerate(mesh.parts, 1)
        for marker in mesh.markers[part.markers]
        if len(marker.cells)
    ]
    for number, part in enumerate(mesh.parts, 1):
        pairs = zip(names_in(mesh, part), part.mesh.markers, strict=True)
        markers = tuple(Marker(name, marker.cells) for name, marker in pairs)
        others = [each for each in places if each[0] != number]
        for each in find_interfaces(replace(part.mesh, markers=markers), others):
            yield replace(
                each,
                nodes=sealed(each.nodes + part.points.start),
                partners=sealed(mesh.marker(each.other).nodes[each.partners]),
            )
