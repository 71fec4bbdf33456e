"""Reading and writing CGNS meshes: the zones of a base as one mesh, with its boundaries.

Read with h5py: VTK's reader returns neither one-to-one interfaces nor where each coordinate is in
the file, which writing needs; and meshes need no VTK elsewhere. The standard is the SIDS (CGNS 4),
mapped onto HDF5. A mesh is written as a copy of its file with other coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from slideviz.errors import path_error, printable
from slideviz.formats.cgns.join import JOINED, Joined, join
from slideviz.formats.cgns.tree import Node, cgns_file
from slideviz.formats.cgns.zone import CgnsZone, conditions, facets_of, read_zone, region_of
from slideviz.formats.hdf5 import free_name, hdf5_write
from slideviz.formats.meshio.bridge import flattened, require_own_folder
from slideviz.formats.meshio.markers import in_node_sets
from slideviz.formats.table import WriteOptions
from slideviz.mesh.cached_boundary import outer_facets, smooth_parts
from slideviz.mesh.check import check_mesh
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh, Origin, frozen_array
from slideviz.mesh.nearest import row_groups


@dataclass(frozen=True, eq=False)
class CgnsForm(Origin):
    """Where the coordinates of a mesh are in the CGNS file it was read from."""

    ending = ".cgns"
    extras = "other contents of the CGNS file, such as zones and solutions"
    datasets: tuple[tuple[str, ...], ...]
    """For each zone the paths of the datasets of its coordinates."""
    numbers: tuple[IntArray, ...]
    """tuple of (n_z,) int64: for each zone the index of each of its vertices among the points of
    the mesh."""
    points: FloatArray  # (n, d): the points as read


def read_cgns(path: Path) -> Mesh:
    """Return the mesh of a CGNS file based on HDF5: all zones of its base.

    Boundaries are the families of boundary conditions, named by the condition where it has no
    family; for a zone without conditions, its sections of boundary elements; if there are none of
    these at all, the outer surface divided at its edges. Open interfaces are boundaries with their
    names, those of the same period together. Raises MeshError if it cannot be read, or has what
    slideviz cannot use: the node, the rule and the remedy.
    """
    with cgns_file(path) as root:
        require_own_folder(path)
        base = _base(root)
        dim, physical = base.integers(2).tolist()
        if dim not in (2, 3) or not dim <= physical <= 3:
            raise base.fault(
                f"has cells of dimension {dim} and {physical} coordinates; expected 2 or 3, and "
                "as many coordinates or more: export the volume mesh"
            )
        zones = [read_zone(node, dim, physical) for node in base.children("Zone_t")]
        joined = join(zones)
        return _mesh(path, base, zones, joined)


def _base(root: Node) -> Node:
    bases = root.children("CGNSBase_t")
    full = [base for base in bases if base.children("Zone_t")]
    if len(full) == 1:
        return full[0]
    if full:
        raise path_error(
            root.file,
            f"has {len(full)} bases ({', '.join(base.name for base in full)}), each a mesh of its "
            "own; export one base to a file",
        )
    raise path_error(
        root.file, "has no zones (CGNSBase_t, Zone_t in it), so there is no mesh; export it again"
    )


def _mesh(path: Path, base: Node, zones: Sequence[CgnsZone], joined: Joined) -> Mesh:
    """Return the mesh of joined zones, with its boundaries; raise MeshError if it is unusable."""
    cells = _renumbered([zone.cells for zone in zones], joined.numbers)
    dim = zones[0].dim
    points = (
        joined.points if joined.points.shape[1] == dim else flattened(path, joined.points, cells)
    )
    form = CgnsForm(
        tuple(zone.datasets[:dim] for zone in zones), joined.numbers, frozen_array(points, float)
    )
    mesh = Mesh(form.points, cells, name=printable(path.name), source=path.resolve(), origin=form)
    check_mesh(mesh)
    markers, remarks = _markers(mesh, base, zones, joined)
    mesh = replace(mesh, markers=markers, remarks=remarks)
    check_mesh(mesh)
    return mesh


def _renumbered(parts: Sequence[Cells], numbers: Sequence[IntArray]) -> Cells:
    """Return the cells of all zones together, with the node ``numbers`` of `Joined`."""
    each = zip(parts, numbers, strict=True)
    return Cells.joined([Cells.from_types(c.types, n[c.connectivity]) for c, n in each])


def _markers(
    mesh: Mesh, base: Node, zones: Sequence[CgnsZone], joined: Joined
) -> tuple[tuple[Marker, ...], tuple[str, ...]]:
    """Return the boundaries, and remarks (sentences) on those that are empty or not joined."""
    groups: dict[str, list[Cells]] = {}
    remarks: list[str] = []
    inner: Cells | None = None
    for zone, number in zip(zones, joined.numbers, strict=True):
        given = list(conditions(zone))
        for node, facets in _of_conditions(zone, given):
            if not len(facets):
                remarks.append(f"{node.path} covers no face of its zone and is left out.")
                continue
            groups.setdefault(_family(base, node), []).append(_renumbered([facets], [number]))
        if given or zone.sides is None:
            continue
        inner = outer_facets(mesh) if inner is None else inner
        for index, section in enumerate(zone.sections):
            facets = _renumbered([zone.sides.where(zone.sides.section == index).cells], [number])
            facets = facets.take(among(facets, inner))
            if len(facets):
                groups.setdefault(section.name, []).append(facets)
    _add_open(groups, remarks, zones, joined)
    if len(zones) > 1 and joined.parts.max() > 0:
        parts = [
            " and ".join(zones[k].node.name for k in np.flatnonzero(joined.parts == part).tolist())
            for part in range(joined.parts.max() + 1)
        ]
        remarks.append(
            f"The zones are not all joined: {'; '.join(parts)}. Where they touch, nothing keeps "
            "them together; export the mesh with its one-to-one interfaces if they should be."
        )
    if not groups:
        return smooth_parts(mesh, outer_facets(mesh)), tuple(remarks)
    markers = [Marker(name, Cells.joined(parts)) for name, parts in groups.items()]
    return tuple(markers), tuple(remarks)


def _of_conditions(zone: CgnsZone, nodes: Sequence[Node]) -> list[tuple[Node, Cells]]:
    """Return the facets of each boundary condition of a zone.

    A facet of several conditions that are given by vertices goes to the one with fewest.
    """
    regions = {node: region_of(zone, node) for node in nodes}
    by_nodes = {node: at for node, at in regions.items() if not isinstance(at, Cells)}
    sets = in_node_sets(len(zone.points), zone.outer, by_nodes) if by_nodes else {}
    return [
        (node, at if isinstance(at, Cells) else Cells.from_blocks(sets[node]))
        for node, at in regions.items()
    ]


def _family(base: Node, node: Node) -> str:
    """Return the name of the boundary that a condition is a part of."""
    name = node.word("FamilyName_t", "", "FamilyName").removeprefix(f"{base.path}/")
    return name or node.name


def _add_open(
    groups: dict[str, list[Cells]], remarks: list[str], zones: Sequence[CgnsZone], joined: Joined
) -> None:
    """Add the facets of open interfaces that are in no group yet, and remarks on these."""
    known = Cells.joined([part for parts in groups.values() for part in parts])
    names: dict[object, str] = {}
    taken = list(groups)
    for one in joined.open:
        facets = _renumbered([facets_of(zones[one.zone], one.node)], [joined.numbers[one.zone]])
        facets = facets.take(~among(facets, known))
        key = one.period or (one.node.name,)
        if len(facets):
            names.setdefault(key, free_name(one.node.name, [*taken, *names.values()]))
            groups.setdefault(names[key], []).append(facets)
        if one.why:
            where = f" {names[key]!r}" if len(facets) else ", as the file has it"
            remarks.append(
                f"{one.node.path} is not joined: {one.why}. Its faces are a boundary{where}."
            )


def among(facets: Cells, others: Cells) -> NDArray[np.bool_]:
    """Return a mask (m,) of the facets that have the same nodes as any of the others."""
    tables = []
    for cells in (facets, others):
        table = np.zeros((len(cells), 4), np.int64)
        for ids, nodes in cells.by_type.values():
            table[ids, : nodes.shape[1]] = np.sort(nodes, axis=1) + 1
        tables.append(table)
    groups = row_groups(np.concatenate(tables))
    return np.isin(groups[: len(facets)], groups[len(facets) :])


def write_cgns(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh that was read from a CGNS file as a copy of that file with its points.

    Coordinates that did not change keep the bits of the file; others are rounded to the file's
    type, R4 or R8. Raises MeshError if the mesh was not read from a CGNS file, that file was
    changed, or the new one cannot be written.
    """
    check_mesh(mesh)
    form, source = require_cgns(mesh, path)
    try:
        with hdf5_write(path, options.replaces, source) as draft:
            _replace(path, source, draft.tree, form, mesh.points)
    except OSError as problem:
        raise path_error(
            path,
            f"cannot be written: {printable(source)}, of which it is a copy, cannot be read: "
            f"{problem.strerror or problem}; put that file back, or write .su2",
        ) from problem


def require_cgns(mesh: Mesh, path: Path) -> tuple[CgnsForm, Path]:
    """Return where the coordinates of a mesh are in the CGNS file it was read from, and that file.

    ``path`` is the file to write, for messages. Raises MeshError if it was not read from a CGNS
    file, so it cannot be written as one.
    """
    form = mesh.origin
    source = mesh.source
    if not (isinstance(form, CgnsForm) and source and len(mesh.points) == len(form.points)):
        raise path_error(
            path,
            "a CGNS file is written as a copy of the one that the mesh was read from, with other "
            f"coordinates, but {mesh.name} is from none; write .su2, or .vtu for ParaView",
        )
    return form, source


def _replace(path: Path, source: Path, tree: h5py.File, form: CgnsForm, points: FloatArray) -> None:
    """Write ``points`` (n, d) into the copy of the file, whose root is ``tree``.

    Raises MeshError if the coordinates there are not those that were read, or if the new ones are
    too large for their type. ``path`` is the new file, ``source`` the one it is a copy of.
    """
    tolerance = JOINED * float(np.ptp(form.points, axis=0).max())
    for names, numbers in zip(form.datasets, form.numbers, strict=True):
        for axis, name in enumerate(names):
            dataset = tree.get(name)
            before = form.points[numbers, axis]
            after = points[numbers, axis]
            if not isinstance(dataset, h5py.Dataset) or dataset.size != len(numbers):
                raise _changed(path, source, name)
            values = np.asarray(dataset[()])
            if not (np.abs(values.ravel() - before) <= tolerance).all():
                raise _changed(path, source, name)
            with np.errstate(over="ignore"):
                rounded = after.astype(values.dtype)
            if not np.isfinite(rounded).all():
                raise path_error(
                    path,
                    f"cannot be written: a coordinate is larger than {values.dtype} holds, the "
                    f"type of {printable(name)}; write .su2, or scale the mesh",
                )
            moved = before != after
            dataset[...] = np.where(moved, rounded, values.ravel()).reshape(values.shape)


def _changed(path: Path, source: Path, name: str) -> Exception:
    return path_error(
        path,
        f"cannot be written: {printable(source)}, of which it is a copy, was changed after the "
        f"mesh was read ({printable(name)}); read that file again",
    )
