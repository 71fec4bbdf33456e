"""Reading OpenFOAM's ``polyMesh``: one mesh, or the regions of a case as zones."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import path_error, printable
from slideviz.formats.openfoam.cells import cells_of
from slideviz.formats.openfoam.foam_file import FoamFile, Patch, read_foam_file
from slideviz.formats.openfoam.plane import Layer, plane_of
from slideviz.formats.openfoam_paths import ENDING, REGIONS, instance_of, stem_of
from slideviz.mesh.check import LARGEST, check_mesh, within
from slideviz.mesh.model import FloatArray, Marker, Mesh, Origin, frozen_array
from slideviz.mesh.polyhedra import Faces, Polyhedra
from slideviz.mesh.zones import join_zones
from slideviz.system.threads import Tick
from slideviz.terms import Role

ROLES: dict[str, Role] = {
    "symmetry": "sliding",
    "symmetryPlane": "sliding",
    "wedge": "sliding",
    "empty": "sliding",
    "cyclic": "periodic",
}
"""The roles of boundaries by the types of their patches."""


@record
class PolyMesh(Origin):
    """The points of the files that a mesh was read from, to write them back."""

    ending = ENDING
    extras: str = field(
        default="the other files of the OpenFOAM case, and its polyhedra as such", kw_only=True
    )
    file: FoamFile
    place: slice  # the bytes that hold the points
    points: FloatArray  # (n, 3)
    folder: Path  # that has all other files
    region: str  # its name; empty for the only one of a case
    layer: Layer | None
    """Where each point is in the plane of a mesh of one layer; None: the mesh is not plane."""


def read_polymesh(path: Path, zone: int | None, progress: Tick) -> Mesh:
    """Return the mesh of a file ``points``, or the regions of a file ``regionProperties`` as zones.

    Raises MeshError if a file is missing or wrong. ``zone``: the zone, from 1; None for all.
    ``progress``: called with the fraction done; may raise to stop.
    """
    if path.name != REGIONS:
        if zone not in (None, 1):
            raise path_error(path, f"there is no zone {zone}: it has one region; leave it out")
        return _read_region(path, path)
    file = read_foam_file(path)
    lists = re.findall(rb"\(([^()]*)\)", file.data[file.begin :])
    names = [name.decode("utf-8", "backslashreplace") for text in lists for name in text.split()]
    for name in names:
        if Path(name).name != name or name == "..":
            raise path_error(
                path,
                f"names a region of another folder, {printable(name)!r}, which is not read; put it "
                "into the same folder",
            )
    if len(set(names)) < len(names):
        [(often, _)] = Counter(names).most_common(1)
        raise path_error(path, f"names the region {printable(often)!r} twice; name each once")
    numbers = range(1, len(names) + 1) if zone is None else (zone,)
    if not names:
        raise path_error(path, "names no region; write e.g. regions ( fluid ( air ) );")
    if not 1 <= numbers[0] <= len(names):
        raise path_error(path, f"there is no zone {zone or 1}: its regions are {', '.join(names)}")
    zones = []
    for number in numbers:
        points = path.parent / names[number - 1] / "polyMesh" / "points"
        mesh = _read_region(points, path, names[number - 1])
        zones.append(replace(mesh, zone=number, zones=len(names)))
        progress(len(zones) / len(numbers))
    return join_zones(zones)


def _read_region(path: Path, source: Path, region: str = "") -> Mesh:
    """Return the mesh of a file ``points``, of which the other files may be in ``constant``."""
    points_file = read_foam_file(path)
    folder = path.parent
    if not any(folder.glob("faces*")):
        instance, inside = instance_of(path.absolute())
        folder = instance.parent / "constant" / inside / "polyMesh"
    values, place = points_file.numbers(points_file.scalar, 3)
    points = frozen_array(values, float)
    if not within(points, LARGEST):
        wrong = int(np.argmax(~(np.abs(points) <= LARGEST).all(axis=1)))
        raise points_file.fault(
            f"point {wrong} is at {tuple(points[wrong].tolist())}, which is not finite, or larger "
            f"than {LARGEST:g}"
        )
    faces_file = read_foam_file(folder / "faces")
    owner_file = read_foam_file(folder / "owner")
    neighbour_file = read_foam_file(folder / "neighbour")
    boundary = read_foam_file(folder / "boundary")
    faces = Faces(*faces_file.faces(), owner_file.labels()[0], neighbour_file.labels()[0])
    patches = boundary.patches()
    _check(faces, len(points), (faces_file, owner_file, neighbour_file))
    _check_patches(boundary, patches, faces)
    name = printable(stem_of(path) + (f"/{region}" if region else ""))
    roles = {one.name: ROLES[one.kind] for one in patches if one.kind in ROLES}
    plane = plane_of(faces, points, patches)
    remarks: tuple[str, ...] = ()
    if plane is not None:
        built = plane.built
        faces = plane.faces
        markers = plane.markers
        roles[plane.axis] = "sliding"
    else:
        built, pieces, hidden = cells_of(faces, points, name)
        places = [(one, slice(one.start, one.start + one.count)) for one in patches if one.count]
        markers = tuple(Marker(one.name, pieces.cells(place)) for one, place in places)
        if hidden:
            remarks = (f"{hidden} polyhedra are not star-shaped and cannot be proved valid.",)
    origin = PolyMesh(
        roles=roles,
        polyhedra=Polyhedra(built.cell, built.face, faces),
        file=points_file,
        place=place,
        points=points,
        folder=folder,
        region=region,
        layer=None if plane is None else plane.layer,
    )
    mesh = Mesh(
        built.points,
        built.cells,
        markers,
        origin,
        name,
        source=source.resolve(),
        remarks=remarks,
    )
    check_mesh(mesh)
    return mesh


def _check(faces: Faces, n_points: int, files: tuple[FoamFile, FoamFile, FoamFile]) -> None:
    """Raise MeshError if the lists of faces, owners and neighbours do not fit each other."""
    count = len(faces.offsets) - 1
    of_faces, of_owner, of_neighbour = files
    wrong = (faces.nodes < 0) | (faces.nodes >= n_points)
    if wrong.any():
        raise of_faces.fault(
            f"has the node {faces.nodes[wrong][0]}, but there are {n_points} points"
        )
    if len(faces.owner) != count:
        raise of_owner.fault(f"has {len(faces.owner)} cells, one for each face, but {count} faces")
    if len(faces.neighbour) > count:
        raise of_neighbour.fault(f"has {len(faces.neighbour)} cells, but there are {count} faces")
    for file, cells in ((of_owner, faces.owner), (of_neighbour, faces.neighbour)):
        # A closed cell has four faces or more, so there are fewer cells than faces.
        bad = (cells < 0) | (cells >= count)
        if bad.any():
            raise file.fault(f"has the cell {cells[bad][0]}, which {count} faces cannot bound")
    sides = np.bincount(np.concatenate([faces.owner, faces.neighbour]))
    if sides.min(initial=4) < 4 or not count:
        raise of_owner.fault(f"cell {sides.argmin() if count else 0} has fewer than 4 faces")


def _check_patches(file: FoamFile, patches: list[Patch], faces: Faces) -> None:
    """Raise MeshError if patches do not divide the faces at the boundary."""
    start = len(faces.neighbour)
    for one in patches:
        if one.kind.startswith("processor"):
            raise path_error(
                file.path, f"{one.name} is of one processor; run reconstructParMesh -constant first"
            )
        if one.start != start or one.count < 0:
            raise file.fault(f"patch {one.name} starts at face {one.start}, expected {start}")
        start += one.count
    if start != len(faces.owner):
        raise file.fault(f"its patches end at face {start}, expected {len(faces.owner)}")
