"""The mesh: points, cells and named boundaries, as frozen values with read-only arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slideviz.argument_types import CheckedFields, check_fields, check_types, record
from slideviz.errors import MeshError
from slideviz.mesh.elements import ELEMENTS, SIZES
from slideviz.system.threads import in_parts

if TYPE_CHECKING:
    from slideviz.mesh.halo import Halo
    from slideviz.mesh.polyhedra import Polyhedra
    from slideviz.terms import Role

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
CellRows = tuple[NDArray[np.uint8], IntArray, IntArray]
"""Types (k,) of cells, their nodes one after the other, and the index of each (k,)."""
Signs = NDArray[np.int8]
"""(m,): 1, or -1 for a cell that is numbered the other way round."""
Index = slice | IntArray
"""Rows of an array: a slice where they follow one another, which selects without a copy."""

DEFAULT_FEATURE_ANGLE_DEG = 40.0
"""Angle in degrees between smoothly joined facets; also the default in `Case.feature_angle_deg`."""


def sealed(values: NDArray) -> NDArray:
    """Return a read-only view of ``values``, which the caller must not write to afterwards."""
    view = values.view()
    view.flags.writeable = False
    return view


def row_norms(vectors: FloatArray) -> FloatArray:
    """Return the lengths (...,) of vectors (..., d)."""
    lengths: FloatArray = np.linalg.norm(vectors, axis=-1)
    return lengths


def largest_norm(vectors: FloatArray) -> float:
    """Return the length of the longest row of an array, 0 without rows."""
    return float(row_norms(vectors).max(initial=0.0))


def largest_size(values: FloatArray) -> float:
    """Return the largest absolute value of an array, 0 of an empty one."""
    return float(np.abs(values).max(initial=0.0))


def row_dots(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the scalar products (m,) of the rows of two arrays (m, d)."""
    return np.einsum("md,md->m", one, other)


def frozen_array(values: ArrayLike, dtype: type | None = None) -> NDArray:
    """Return ``values`` as a C-contiguous, read-only array; copies what is writable.

    ``dtype``: None keeps that of an array.
    """
    array: NDArray = np.ascontiguousarray(values, dtype=dtype)
    if array.flags.writeable:
        array = array.copy() if array is values else array
        array.flags.writeable = False
    return array


NO_NODES: IntArray = np.empty(0, np.int64)  # and no rows, no cells


def mask_of(count: int, chosen: NDArray | slice) -> BoolArray:
    """Return the mask (count,) of the rows whose numbers, or mask, are ``chosen``."""
    mask = np.zeros(count, bool)
    mask[chosen] = True
    return mask


def row_numbers(count: int, chosen: IntArray) -> IntArray:
    """Return the place in ``chosen`` of each of ``count`` numbers, -1 of those not in it."""
    places = np.full(count, -1)
    places[chosen] = np.arange(len(chosen))
    return places


def places_in(ordered: IntArray, wanted: IntArray) -> IntArray:
    """Return the places (m,) of numbers (m,) in ordered ones (n,), -1 of those not among them."""
    at = np.searchsorted(ordered, wanted).clip(max=len(ordered) - 1)
    return np.where(ordered[at] == wanted, at, -1)


def run_begins(rows: NDArray) -> BoolArray:
    """Return the mask (n,) of rows (n, ...) that differ from the row before, and of the first."""
    new = rows[1:] != rows[:-1]
    return np.r_[True, new.any(axis=tuple(range(1, new.ndim)))][: len(rows)]


def offsets_of(sizes: ArrayLike) -> IntArray:
    """Return the offsets (k + 1,) of parts with ``sizes`` (k,), one after the other."""
    return np.concatenate(([0], np.cumsum(sizes)))


def ranges(first: IntArray, sizes: IntArray) -> IntArray:
    """Return first, first + 1, ... of each of the ranges with ``first`` (k,) and ``sizes`` (k,)."""
    return np.arange(sizes.sum()) + np.repeat(first - np.cumsum(sizes) + sizes, sizes)


def column_bounds(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest coordinates (d,), (d,) of points (n, d)."""
    # One column after the other is five times as fast as all at once.
    return np.array([c.min() for c in points.T]), np.array([c.max() for c in points.T])


def largest_coordinate(points: FloatArray) -> float:
    """Return the largest absolute value of the coordinates (n, d)."""
    low, high = column_bounds(points)
    return float(max(-low.min(), high.max()))


def sorted_nodes(nodes: IntArray) -> IntArray:
    """Return the nodes that an array of any shape contains, ascending, each once: (u,)."""
    used = mask_of(nodes.max(initial=-1) + 1, nodes)
    return np.flatnonzero(used)


@dataclass(frozen=True, eq=False, repr=False)
class Cells(CheckedFields):
    """Elements of mixed type, in file order."""

    types: NDArray[np.uint8]
    """(m,): VTK identifier of each element."""
    offsets: IntArray
    """(m + 1,): element ``i`` has the nodes ``connectivity[offsets[i]:offsets[i + 1]]``."""
    connectivity: IntArray
    """(k,): node indices, zero-based."""

    @classmethod
    @check_types
    def from_types(cls, types: ArrayLike, connectivity: ArrayLike) -> Cells:
        """Return cells from VTK identifiers (m,) and the flat connectivity (k,).

        Raises
        ------
        MeshError
            An identifier is not in ``ELEMENTS``, or the connectivity has another length.
        """
        ids = frozen_array(types, np.uint8)
        counts = SIZES[ids] if ids.min(initial=255) < ids.max(initial=0) else SIZES[ids[:1]]
        if np.any(counts == 0):
            raise MeshError(f"element type {ids[np.argmin(counts)]} is not supported")
        if len(counts) == len(ids):
            offsets = offsets_of(counts)
        else:  # all of one type
            offsets = np.arange(0, counts[0] * len(ids) + 1, counts[0])
        flat = frozen_array(connectivity, np.int64)
        if flat.shape != (offsets[-1],):
            raise MeshError(f"{offsets[-1]} node indices are needed, {flat.size} are given")
        return cls(ids, sealed(offsets), flat)

    @classmethod
    @check_types
    def from_blocks(cls, blocks: Iterable[tuple[int, ArrayLike]]) -> Cells:
        """Return cells from ``(vtk, connectivity (m, n))`` blocks, in that order."""
        types = [np.empty(0, np.uint8)]
        flats = [NO_NODES]
        for vtk, nodes in blocks:
            table = np.asarray(nodes, np.int64).reshape(-1, ELEMENTS[vtk].n_nodes)
            types.append(np.full(len(table), vtk, np.uint8))
            flats.append(table.ravel())
        return cls.from_types(np.concatenate(types), np.concatenate(flats))

    @classmethod
    def joined(cls, parts: Sequence[Cells]) -> Cells:
        """Return the elements of some parts, one after the other."""
        types = np.concatenate([np.empty(0, np.uint8), *(part.types for part in parts)])
        flat = np.concatenate([NO_NODES, *(part.connectivity for part in parts)])
        return cls.from_types(sealed(types), sealed(flat))

    def __len__(self) -> int:
        return len(self.types)

    @cached_property
    def by_type(self) -> dict[int, tuple[IntArray, IntArray]]:
        """Indices (m_t,) and nodes (m_t, n_t) of the elements of each type, by VTK identifier."""
        blocks = {}
        alike = len(self) > 0 and self.types.min() == self.types.max()
        present = self.types[:1] if alike else np.flatnonzero(np.bincount(self.types))
        for vtk in present.tolist():
            ids = np.arange(len(self)) if alike else np.flatnonzero(self.types == vtk)
            width = ELEMENTS[vtk].n_nodes
            if ids[-1] - ids[0] + 1 == len(ids):  # one block: nothing need be copied
                block = self.connectivity[self.offsets[ids[0]] : self.offsets[ids[-1] + 1]]
                nodes = block.reshape(-1, width)
            else:
                nodes = self.connectivity[self.offsets[ids][:, None] + np.arange(width)]
            blocks[vtk] = sealed(ids), sealed(nodes)
        return blocks

    def in_parts(
        self,
        work: Callable[[int, Index, IntArray], object],
        going_on: Callable[[], object] = lambda: None,
    ) -> None:
        """Call ``work(vtk, rows, nodes)`` for parts of the elements of each type, on all cores.

        ``rows``: the indices of the elements. ``going_on`` is called every few thousand elements;
        what it raises ends the work.
        """
        for vtk, (ids, nodes) in self.by_type.items():
            first = int(ids[0])
            is_block = int(ids[-1]) - first + 1 == len(ids)

            def of_part(part: slice) -> None:
                block = slice(first + part.start, first + part.stop)  # noqa: B023
                work(vtk, block if is_block else ids[part], nodes[part])  # noqa: B023

            in_parts(of_part, len(ids), lambda _: going_on())

    @cached_property
    def nodes(self) -> IntArray:
        """Return the indices of all nodes used, ascending, each once: (u,)."""
        return sealed(sorted_nodes(self.connectivity))

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{len(ids)} {ELEMENTS[vtk].name}" for vtk, (ids, _) in self.by_type.items()
        )
        return f"Cells({counts})"

    def take(self, which: IntArray | BoolArray) -> Cells:
        """Return elements by indices ``which`` (k,), in that order, or by a mask (m,)."""
        sizes = np.diff(self.offsets)
        if which.dtype == bool:
            entries = np.repeat(which, sizes)
        else:
            entries = ranges(self.offsets[which], sizes[which])
        return Cells.from_types(self.types[which], self.connectivity[entries])

    def means(self, values: FloatArray) -> FloatArray:
        """Return the means (m, ...) of values (n, ...) at nodes over the nodes of each cell."""
        totals = np.add.reduceat(values[self.connectivity], self.offsets[:-1])
        return (totals.T / np.diff(self.offsets)).T

    def same_as(self, other: Cells) -> bool:
        """Return whether both have the same types and connectivity."""
        return np.array_equal(self.types, other.types) and np.array_equal(
            self.connectivity, other.connectivity
        )


@record
class Marker(CheckedFields):
    """A named boundary: its elements, of one dimension less than the mesh."""

    name: str
    cells: Cells

    @property
    def nodes(self) -> IntArray:
        """Return the indices of its nodes, ascending, each once: (u,)."""
        return self.cells.nodes


@record
class Part:
    """Where the points and cells of a part of a mesh are in the whole mesh."""

    points: IntArray
    cells: IntArray
    """`points`, `cells` (n,), (m,): index in the whole mesh of each point and cell of the part,
    ascending."""
    n_points: int
    n_cells: int
    """`n_points`, `n_cells`: numbers of points and cells of the whole mesh."""


@record
class ZoneInterface:
    """A boundary whose nodes coincide with nodes of ``other`` in another zone."""

    marker: str
    zone: int
    other: str
    nodes: IntArray  # (k,): its nodes that coincide
    partners: IntArray
    """(k,): the nodes of ``other`` there: in a mesh of all zones their indices, else their places
    among the nodes of ``other``."""

    def describe(self) -> str:
        """Return the interface in words."""
        count = len(self.nodes)
        return f"an interface with {self.other} of zone {self.zone} ({count} nodes in common)"


@record
class Origin:
    """What a mesh keeps of its file besides points, cells and boundaries, to write it back.

    A format whose files have more than that has a subclass of its own.
    """

    ending: ClassVar[str] = ""
    """File name ending of the format, with its dot; "" where no more of the file is kept."""
    extras: str = field(default="", kw_only=True)
    """What else its file has that no other format keeps, in words."""
    ffd: bytes | None = field(default=None, kw_only=True)
    """Text of the boxes for free-form deformation that an SU2 file gets in place of those it had;
    None: those it had."""
    ffd_at: tuple[range, ...] = field(default=(), kw_only=True)
    """The lines of the file, from 0, that its boxes are on, if that is known."""
    ffd_elsewhere: Mapping[str, int] = field(default_factory=dict, kw_only=True)
    """Names of the boxes that other zones of the file have, and the numbers of these zones."""
    roles: Mapping[str, Role] = field(default_factory=dict, kw_only=True)
    """Roles that boundaries have by the file, by their names in it, where a case gives none."""
    polyhedra: Polyhedra | None = field(default=None, kw_only=True)
    """The cells of the file where cells of the mesh may be parts of these; None: they are not."""


@record
class ZonePart:
    """Where a zone is in a mesh (`Mesh.parts`)."""

    mesh: Mesh  # the zone alone, as it was read
    points: slice
    cells: slice
    markers: slice
    """`points`, `cells`, `markers`: its points, cells and boundaries in the mesh of all zones."""
    first_point: int
    first_cell: int
    """`first_point`, `first_cell`: numbers of its first point and cell in the file of all zones;
    other than in the mesh where that is a `Skin`."""


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Points, cells and boundaries."""

    points: FloatArray
    """(n, d): Cartesian coordinates, d = 2 or 3, in the file's length unit."""
    cells: Cells
    """The volume elements (3D) or faces (2D)."""
    markers: tuple[Marker, ...] = ()
    """The named boundaries, in file order."""
    origin: Origin = Origin()
    """What else of its file is kept, to write it back."""
    name: str = "mesh"
    """Name of its file or sample, for messages."""
    zone: int | None = 1
    zones: int = 1
    """`zone`, `zones`: number of this zone in the file (from 1; None: it has all), and how many the
    file has."""
    source: Path | None = None
    """The file it was read from, which is overwritten only on request."""
    halo: Halo | None = None
    """Copies of cells beyond the periodic sides, which only follow the cells they copy."""
    remarks: tuple[str, ...] = ()
    """Warnings of the reader, a sentence each."""
    interfaces: tuple[ZoneInterface, ...] = ()
    """The boundaries that coincide with boundaries of other zones of the file."""
    reference: Mesh | None = None
    """The undeformed mesh of the same cells that this one was deformed from; None: it is undeformed
    itself. `with_reference` gives it one."""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "points", frozen_array(self.points, np.float64))
        if self.points.ndim != 2 or self.points.shape[1] not in (2, 3):
            raise MeshError(f"points have shape {self.points.shape}; expected (n, 2) or (n, 3)")

    def __repr__(self) -> str:
        return (
            f"Mesh({self.name!r}, {self.dim}D, {len(self.points)} points, {self.cells!r}, "
            f"markers: {', '.join(self.marker_names) or 'none'})"
        )

    @property
    def parts(self) -> tuple[ZonePart, ...]:
        """Return where each zone is: this mesh is one."""
        points = slice(0, len(self.points))
        cells = slice(0, len(self.cells))
        return (ZonePart(self, points, cells, slice(0, len(self.markers)), 0, 0),)

    @property
    def undeformed(self) -> Mesh:
        """Return the mesh with the undeformed cells: its reference, or itself without one."""
        return self if self.reference is None else self.reference

    @property
    def roles(self) -> dict[str, Role]:
        """Return the roles that boundaries have by the file, where it says so."""
        return {
            name: part.mesh.origin.roles[alone.name]
            for part in self.parts
            for name, alone in zip(self.marker_names[part.markers], part.mesh.markers, strict=True)
            if alone.name in part.mesh.origin.roles
        }

    @cached_property
    def whole_cells(self) -> IntArray | None:
        """Return the number (m,) of the file's cell that each cell is in, ascending.

        None where each is one itself.
        """
        of_parts = [part.mesh.origin.polyhedra for part in self.parts]
        if None in of_parts:
            return None
        cells = [one.cell for one in of_parts if one is not None]
        begin = offsets_of([one[-1] + 1 for one in cells])
        return sealed(np.concatenate([one + a for one, a in zip(cells, begin, strict=False)]))

    @cached_property
    def file_types(self) -> NDArray[np.uint8]:
        """Return the VTK identifier (c,) of each cell of the file; see `CELL_NAMES`."""
        if self.whole_cells is None:
            return self.cells.types
        first = run_begins(self.whole_cells)
        polyhedron = 7 if self.dim == 2 else 42
        several = np.bincount(self.whole_cells) > 1
        return np.where(several, polyhedron, self.cells.types[first]).astype(np.uint8)

    def file_cells(self, cells: IntArray) -> IntArray:
        """Return the numbers (k,) that cells (k,) have in the file: parts have their polyhedron's.

        ``cells``: indices; of a mesh in its file, such numbers already.
        """
        return cells if self.whole_cells is None else self.whole_cells[cells]

    def first_parts(self, cells: IntArray) -> IntArray:
        """Return the first part (k,) of the polyhedron that each of cells (k,) is in."""
        whole = self.whole_cells
        return cells if whole is None else np.searchsorted(whole, whole[cells])

    @check_types
    def with_reference(self, reference: Mesh | None) -> Self:
        """Return the mesh as one that was deformed from ``reference``; None: it was from none.

        Raises MeshError if that has other cells. Its own reference, if it has one, takes its place.
        """
        mesh = self if reference is None else self.with_parts_of(reference)
        base = None if reference is None else checked_reference(reference, mesh).undeformed
        if not isinstance(self, Assembly):
            return replace(mesh, reference=base)
        bases = [None] * len(self.parts) if base is None else [part.mesh for part in base.parts]
        parts = tuple(
            replace(
                part, mesh=part.mesh.with_points(self.points[part.points]).with_reference(of_part)
            )
            for part, of_part in zip(self.parts, bases, strict=True)
        )
        return replace(self, reference=base, parts=parts)

    def with_parts_of(self, other: Mesh) -> Self:
        """Return the mesh with its polyhedra divided as in ``other``, if that has the same ones.

        How a polyhedron is divided depends on its shape. Its added node goes along with the mean of
        its other ones.
        """
        mine = self.origin.polyhedra
        theirs = other.origin.polyhedra
        if mine is None or theirs is None or not mine.faces.same_as(theirs.faces):
            return self
        count = len(other.points) - theirs.added
        if isinstance(self, Assembly) or len(self.points) - mine.added != count:
            return self
        nodes = other.cells.connectivity
        cell = np.repeat(theirs.cell, np.diff(other.cells.offsets))
        inside = nodes < count
        moved = (self.points[:count] - other.points[:count])[nodes[inside]]
        sums = np.stack([np.bincount(cell[inside], column) for column in moved.T], axis=1)
        means = sums / np.bincount(cell[inside])[:, None]
        around = np.empty(theirs.added, np.int64)
        around[nodes[~inside] - count] = cell[~inside]
        points = np.concatenate([self.points[:count], other.points[count:] + means[around]])
        origin = replace(self.origin, polyhedra=theirs)
        return replace(self, points=points, cells=other.cells, markers=other.markers, origin=origin)

    @property
    def dim(self) -> int:
        """Return the dimension of the points, 2 or 3."""
        return int(self.points.shape[1])

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest coordinates of all points: (d,), (d,)."""
        return column_bounds(self.points)

    @cached_property
    def extent(self) -> float:
        """Return the longest side of the bounding box of the points, without the halo."""
        if self.halo is None:
            low, high = self.bounds
        else:
            low, high = column_bounds(np.delete(self.points, self.halo.outer, 0))
        return float((high - low).max())

    @property
    def marker_names(self) -> tuple[str, ...]:
        """Return the names of the boundaries, in file order."""
        return tuple(marker.name for marker in self.markers)

    def marker(self, name: str) -> Marker:
        """Return the boundary of that name.

        Raises
        ------
        MeshError
            There is none.
        """
        for marker in self.markers:
            if marker.name == name:
                return marker
        raise MeshError(f"no marker {name!r}; the mesh has {', '.join(self.marker_names)}")

    def nodes_of(self, names: Iterable[str]) -> IntArray:
        """Return the nodes (k,) of some boundaries, sorted, each once."""
        return np.unique(np.concatenate([NO_NODES, *(self.marker(name).nodes for name in names)]))

    @property
    def file_counts(self) -> tuple[int, int]:
        """Return the numbers of points and cells that the mesh of its file has."""
        return len(self.points), len(self.file_types)

    @property
    def numbering(self) -> Part:
        """Return where its points and cells are in the mesh of its file: all, but of a `Skin`.

        The arrays are made each time; `numbers` and `file_counts` need none.
        """
        cells = self.file_cells(np.arange(len(self.cells)))
        return Part(np.arange(len(self.points)), cells, *self.file_counts)

    def numbers(self, nodes: IntArray) -> IntArray:
        """Return the numbers (k,) that nodes (k,) have in the file."""
        return nodes

    def number(self, node: int) -> int:
        """Return the number that a node has in its file, for messages."""
        return node

    def cell_number(self, cell: int) -> int:
        """Return the number that a cell has in its file, for messages."""
        return int(self.file_cells(np.array(cell)))

    @check_types
    def with_points(self, points: ArrayLike) -> Self:
        """Return the same mesh with other ``points`` (n, d).

        Raises
        ------
        MeshError
            They have another shape than those of the mesh.
        """
        moved = np.asarray(points, np.float64)
        if moved.shape != self.points.shape:
            raise MeshError(f"points have shape {moved.shape}; expected {self.points.shape}")
        return replace(self, points=moved)


def checked_reference(reference: Mesh, mesh: Mesh) -> Mesh:
    """Return ``reference`` if it has the cells of ``mesh``, and raise MeshError otherwise."""
    fault = _difference(mesh, reference)
    if fault:
        raise MeshError(
            f"{reference.name} ({len(reference.cells)} cells, {len(reference.points)} points) "
            f"cannot be the reference of {mesh.name} ({len(mesh.cells)} cells, "
            f"{len(mesh.points)} points): it must have the same cells, but {fault}; give the "
            "undeformed mesh"
        )
    return reference


def _difference(mesh: Mesh, other: Mesh) -> str:
    """Return how points and cells of ``other`` differ from those of ``mesh``; "" if they do not."""
    for word, ours, theirs in (
        ("dimensions", mesh.dim, other.dim),
        ("zones", len(mesh.parts), len(other.parts)),
        ("points", len(mesh.points), len(other.points)),
        ("cells", len(mesh.cells), len(other.cells)),
    ):
        if ours != theirs:
            return f"it has {theirs} {word} instead of {ours}"
    cells = mesh.cells
    changed = np.flatnonzero(cells.types != other.cells.types)
    if len(changed):
        cell = changed[0]
        kinds = (ELEMENTS[int(each.types[cell])].name for each in (other.cells, cells))
        return f"cell {mesh.cell_number(cell)} is a {' instead of a '.join(kinds)}"
    changed = np.flatnonzero(cells.connectivity != other.cells.connectivity)
    if not len(changed):
        return ""
    cell = int(np.searchsorted(cells.offsets, changed[0], "right")) - 1
    return f"cell {mesh.cell_number(cell)} has other nodes, or the same in another order"


@dataclass(frozen=True, eq=False, repr=False)
class Skin(Mesh):
    """Those points and cells of a mesh in a file that are in memory: mostly at its boundary."""

    part: Part = field(kw_only=True)
    """Where they are in the file."""

    @property
    def file_counts(self) -> tuple[int, int]:
        """Return the numbers of points and cells that the mesh of its file has."""
        return self.part.n_points, self.part.n_cells

    @property
    def numbering(self) -> Part:
        """Return where its points and cells are in the mesh of its file."""
        return self.part

    def numbers(self, nodes: IntArray) -> IntArray:
        """Return the numbers (k,) that nodes (k,) have in the file."""
        numbers: IntArray = self.part.points[nodes]
        return numbers

    def number(self, node: int) -> int:
        """Return the number that a node has in its file."""
        return int(self.part.points[node])

    def cell_number(self, cell: int) -> int:
        """Return the number that a cell has in its file."""
        return int(self.part.cells[cell])


@dataclass(frozen=True, eq=False, repr=False)
class Assembly(Mesh):
    """Several zones of a file as one mesh (`slideviz.mesh.zones`)."""

    parts: tuple[ZonePart, ...] = ()
    """Where each zone is; they share no points."""


@dataclass(frozen=True, eq=False, repr=False)
class SkinAssembly(Assembly, Skin):
    """The skins of several zones of a file as one mesh."""
