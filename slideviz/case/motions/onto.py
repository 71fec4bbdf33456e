"""Motions onto a target surface: its file, and the displacement of the boundaries laid onto it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.displacement import Displacements, NodesOn
from slideviz.case.motions.file import FromFile, read_path
from slideviz.case.motions.motion import Motion, Target, applies_to, number_texts
from slideviz.case.spans import periodic_pairs
from slideviz.case.words import Words, number
from slideviz.errors import CaseError, MeshError, Message, printable
from slideviz.formats.files import read as read_mesh
from slideviz.formats.files import read_surface
from slideviz.machine.onto import AGREE, Laid, Nearest, Wall, find_edges, lay_onto
from slideviz.machine.onto import Target as TargetSurface
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.topology import unit
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.frames import Frame, coords_slopes, corners, make_frame, on_axis
from slideviz.rbf.projection import as_simplices, simplex_vectors, surface_rim
from slideviz.system.weak_cache import WeakCache
from slideviz.terms import Term, Texts

if TYPE_CHECKING:
    from slideviz.case.model import Case

FARTHEST = 0.01
"""Largest distance from the target that may remain, over the boundary's size, by default."""
UNITS = {
    1000.0: ("metres", "millimetres"),
    100.0: ("metres", "centimetres"),
    39.37: ("metres", "inches"),
    25.4: ("inches", "millimetres"),
    10.0: ("centimetres", "millimetres"),
}
"""The larger and the smaller of two units, by how many of the smaller the larger is."""
NEAR = 1.24  # largest ratio of sizes over such a factor; 25.4 and 39.37 stay apart
MOST_AWAY = 0.05  # largest part of the nodes whose normals may not face the target

Key = tuple[object, ...]
_LAID = WeakCache()
_one_at_a_time = Lock()


@record
class Remaining(Message):
    """The note on how far boundaries remain from the target that they are laid onto."""

    report: Mapping[str, object] = field(default_factory=dict)
    """What the report of a run has: boundaries, file, distances."""


@frozen
class Onto(FromFile):
    """Lay a marker onto the surface in a file: an STL or VTU surface, or a boundary of a mesh.

    Nodes move to closest points, smoothly, from their undeformed places, so that no other motion of
    the marker may come before. Those at the rim stay on the boundaries that they have in common
    with. Of a mesh, the boundary with the marker's name counts, or its only one. ``limit`` is how
    far a node may stay from the surface, in the mesh's length unit; 0 is 1 % of the marker's size.
    """

    limit: float = 0.0

    kind_term = Term(
        "onto a surface", "A surface (STL, VTU), or a mesh with a boundary of that name."
    )
    verbs = ("onto",)
    grammar = (
        "(BLADE, onto, path[, limit])                  the surface in a file; limit: what remains",
    )
    rows = ("path", "limit")
    file_words = "surface to lie on"
    has_table = False
    takes_time = True
    one_zone = True
    checked_as_text = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.limit < math.inf:
            raise CaseError(
                f"the limit {self.limit:g} is not above 0; leave it out for 1 % of the size"
            )

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        if len(words) not in (1, 2) or not words[0].text:
            raise CaseError(
                "expected (MARKER, onto, path) or (MARKER, onto, path, limit), where the limit is "
                "the largest distance that may remain; a path with spaces, commas or brackets "
                "needs quotes"
            )
        limit = number(words[1].text) if words[1:] else 0.0
        if words[1:] and not limit:
            raise CaseError(f"the limit {limit:g} is not above 0; leave it out for 1 % of the size")
        return cls(read_path(words), marker, limit)

    @property
    def is_case_file(self) -> bool:
        return False

    def arguments(self) -> list[str]:
        return [*super().arguments(), *(number_texts(self.limit) if self.limit else [])]

    def described(self, dim: int, extent: float) -> str:
        return f"lay onto {self.path.name or '(no file yet)'}"

    def label(self, form: str, *, exact: bool) -> str:
        limit = f", at most {self.limit:{form}} away" if exact and self.limit else ""
        return f"lay onto {super().label(form, exact=exact)}{limit}"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        for marker in case.markers_with("moving"):
            before = [motion for motion in case.motions[:place] if applies_to(motion, marker)]
            if before and applies_to(self, marker):
                yield (
                    f"it begins at the undeformed places of {marker!r}, which another motion "
                    "leaves before; put this one first"
                )

    def listed(self, case: Case, mesh: Mesh, moved: NodesOn) -> Displacements:
        return laid_displacements(self, case, mesh, moved)


def laid_displacements(
    motion: Onto, case: Case, mesh: Mesh, markers: Iterable[str]
) -> Displacements:
    """Return the displacements that lay those of some markers onto a target; computed once.

    Raises CaseError if the target cannot be read, does not face the boundary, or remains too far
    from it.
    """
    names, key = _key(motion, case, markers)

    def lay() -> Displacements | CaseError:
        try:
            return _lay(motion, case, mesh, names)
        except CaseError as problem:
            return problem

    with _one_at_a_time:
        result = _LAID.of(mesh, key, lay)
    if isinstance(result, CaseError):
        raise CaseError(str(result))
    return result


def is_laid(case: Case, mesh: Mesh) -> bool:
    """Return whether the displacements of all motions onto surfaces are computed: it takes time."""
    moving = case.markers_with("moving")
    keys = (_key(motion, case, moving) for motion in case.motions if isinstance(motion, Onto))
    return all(_LAID.has(mesh, key) for names, key in keys if names)


def _key(motion: Onto, case: Case, markers: Iterable[str]) -> tuple[Texts, Key]:
    """Return the markers that a motion moves, and the key of their displacements."""
    names = tuple(name for name in markers if applies_to(motion, name))
    key = motion, names, case.markers_with("periodic"), case.periodic, case.periodic_type
    try:
        state = motion.path.stat()
    except OSError:
        return names, key
    return names, (*key, case.axis, case.origin, state.st_mtime_ns, state.st_size)


def _lay(motion: Onto, case: Case, mesh: Mesh, names: Texts) -> Displacements:
    boundary = boundary_of(mesh)
    index = [boundary.names.index(name) for name in names]
    facets = boundary.facets[np.isin(boundary.marker, index)]
    nodes = np.unique(facets)
    points = mesh.points[nodes]
    local = np.searchsorted(nodes, facets)
    rim = nodes[np.unique(find_edges(points, local)[1])]
    target, target_size = _read_target(motion.path, mesh, names)
    walls = _walls(case, mesh, nodes, index, rim)
    laid = lay_onto(points, local, target, list(walls.values()))
    size = float(np.ptp(points, axis=0).max())
    try:
        note = _checked(motion, names, laid, walls, size)
    except CaseError as problem:
        units = _units(target_size / size)
        if not units:
            raise
        raise CaseError(
            f"{printable(motion.path)}: the surface is {target_size / size:,.4g} times as large as "
            f"{' and '.join(names)}: {units}\n{problem}"
        ) from problem
    return Displacements(nodes, laid.vectors, (note,))


def _units(ratio: float) -> str:
    """Return which units may have been mixed up; "" where a size is no such factor apart."""
    for factor, (large, small) in UNITS.items():
        for value, ours, theirs in ((factor, large, small), (1.0 / factor, small, large)):
            if 1.0 / NEAR < ratio / value < NEAR:
                return f"{theirs} for {ours}? Multiply its coordinates by {1.0 / value:.6g} then"
    return ""


def _walls(
    case: Case, mesh: Mesh, nodes: IntArray, index: list[int], rim: IntArray
) -> dict[str, Wall]:
    """Return the boundaries on which the rim stays, as nodes that slide there see them.

    They are surfaces of the frame, as an annulus is round, and go on flat beyond the rim.
    """
    pairs = periodic_pairs(case, mesh)
    frame, _ = make_frame(
        mesh.points, pairs, periodic_distance=case.periodic in ("fixed", "moving")
    )
    coords = frame.coords(mesh.points)
    boundary = boundary_of(mesh)
    walls = dict[str, Wall]()
    shift = frame.shift()
    place = partial(corners, coords, axis=on_axis(frame, coords))
    moving = np.zeros(len(coords), bool)
    moving[nodes] = True
    for which, name in enumerate(boundary.names):
        member = boundary.marker == which
        on = np.intersect1d(rim, boundary.facets[member])
        if which not in index and len(on):
            tree = ClosestPoints(
                as_simplices(place(boundary.facets[member])),
                shift if shift.any() else None,
                surface_rim(boundary, member, moving, place),
            )
            walls[name] = Wall(np.searchsorted(nodes, on), partial(_on_wall, tree, frame))
    return walls


def _on_wall(tree: ClosestPoints, frame: Frame, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    at, which = tree.nearest(frame.coords(x))
    points = frame.points(at)
    normals = _normals(tree.simplices(which))
    return points, unit(np.einsum("mij,mi->mj", coords_slopes(frame, points), normals))


def _checked(
    motion: Onto, names: Texts, laid: Laid, walls: dict[str, Wall], size: float
) -> Remaining:
    """Return the note on a boundary laid onto a target; CaseError where they do not fit."""
    of = " and ".join(names)
    file = printable(motion.path)
    away = int(np.count_nonzero(laid.facing < AGREE))
    count = len(laid.facing)
    if away > MOST_AWAY * count:
        raise CaseError(
            f"{file}: {away:,} of {count:,} nodes of {of} do not face this surface: their "
            "normals are more than 70° apart; give a surface near the boundary and about parallel "
            "to it, whose facets are oriented alike"
        )
    farthest = float(laid.distances.max())
    limit = motion.limit or FARTHEST * size
    if farthest > limit:
        default = "" if motion.limit else f", {FARTHEST:.0%} of its size"
        raise CaseError(
            f"{file}: {of} remains up to {farthest:.4g} away from this surface, and the limit is "
            f"{limit:.4g}{default}; give a surface that is as large, or a larger limit: "
            f"({names[0]}, onto, {motion.path.name}, {1.1 * farthest:.2g})"
        )
    rim = np.zeros(count, bool)
    rim[[row for wall in walls.values() for row in wall.rows]] = True
    inner = float(laid.distances[~rim].max(initial=0.0))
    at_rim = float(laid.distances[rim].max(initial=0.0))
    words = f"{of} lies on {motion.path.name}, at most {inner:.3g} away from it"
    if walls:
        words += f"; its rim stays on {' and '.join(walls)}, at most {at_rim:.3g} away from it"
    report = {
        "boundaries": list(names),
        "file": str(motion.path),
        "distance": farthest,
        "rim_distance": at_rim,
        "farthest_move": float(np.linalg.norm(laid.vectors, axis=1).max()),
    }
    return Remaining(words, level="note", report=report)


def _read_target(path: Path, mesh: Mesh, names: Texts) -> tuple[TargetSurface, float]:
    """Return the surface in a file, all facets or markers of a mesh, and its size; or CaseError."""
    try:
        read = read_surface(path)
        if mesh.dim == 2 and _dims(read) == {2}:
            read = read_mesh(path)
    except MeshError as problem:
        raise CaseError(str(problem)) from problem
    if _dims(read) == {mesh.dim - 1} and read.dim >= mesh.dim:
        tables = (table for _, table in read.cells.by_type.values())
        facets = np.concatenate([_padded(table) for table in tables])
    elif _dims(read) == {mesh.dim}:
        facets = _facets_of(read, names, path)
    else:
        raise CaseError(
            f"{printable(path)}: it has no {'curve' if mesh.dim == 2 else 'surface'}, and "
            f"{mesh.name} has {mesh.dim} dimensions; give an STL or VTU surface, or a mesh with "
            "that boundary"
        )
    # Files such as STL have the corners of each facet.
    points, place = np.unique(read.points[:, : mesh.dim], axis=0, return_inverse=True)
    table = place.ravel()[facets]
    edges, _ = find_edges(points, table)
    size = float(np.ptp(points[table.ravel()], axis=0).max())
    return TargetSurface(_nearest(as_simplices(points[table])), _along(points[edges])), size


def _dims(mesh: Mesh) -> set[int]:
    return {ELEMENTS[vtk].dim for vtk in mesh.cells.by_type}


def _facets_of(read: Mesh, names: Texts, path: Path) -> IntArray:
    """Return the facets of markers of a mesh: those with the names, or its only marker."""
    there = read.marker_names
    if not set(names) <= {*there} and len(there) != 1:
        raise CaseError(
            f"{printable(path)}: it is a mesh without a boundary {' and '.join(names)} (it has "
            f"{', '.join(there) or 'none'}); give the target the same name, or a file with that "
            "surface alone"
        )
    boundary = boundary_of(read)
    wanted = [at for at, name in enumerate(there) if name in names or len(there) == 1]
    return boundary.facets[np.isin(boundary.marker, wanted)]


def _padded(table: IntArray) -> IntArray:
    """Return triangles (f, 3) as quadrilaterals that repeat their last node; others unchanged."""
    return table[:, [0, 1, 2, 2]] if table.shape[1] == 3 else table


def _nearest(simplices: FloatArray) -> Nearest:
    """Return a function of closest points on triangles or segments, and their normals there."""
    tree = ClosestPoints(np.ascontiguousarray(simplices))
    return partial(_closest, tree, _normals(simplices))


def _normals(simplices: FloatArray) -> FloatArray:
    """Return the unit normals (m, d) of triangles (m, 3, 3) or segments (m, 2, 2)."""
    return unit(simplex_vectors(simplices))


def _along(edges: FloatArray) -> Nearest | None:
    """Return a function of closest points and tangents on edges (e, 2, d), or corners (e, 1, 2)."""
    if not len(edges):
        return None
    if edges.shape[1] == 1:
        return partial(_corner, edges[:, 0])
    tree = ClosestPoints(np.ascontiguousarray(edges))
    return partial(_closest, tree, unit(edges[:, 1] - edges[:, 0]))


def _closest(
    tree: ClosestPoints, directions: FloatArray, x: FloatArray
) -> tuple[FloatArray, FloatArray]:
    at, which = tree.nearest(x)
    return at, directions[which]


def _corner(corners: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    return corners[cKDTree(corners).query(x)[1]], np.zeros_like(x)
