"""Polyhedra: cells of any faces, which a mesh has as parts around a node added in the middle.

The parts are tetrahedra and pyramids, in 2D triangles. Valid parts prove that the polyhedron is
valid and star-shaped. Its metrics of faces are those of its true faces.
"""

from __future__ import annotations

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray, Mesh, offsets_of, ranges, row_dots, row_norms


@record
class Faces:
    """The faces of all cells, those between two cells first; in 2D edges."""

    offsets: IntArray
    nodes: IntArray
    """`offsets`, `nodes` (f + 1,), (k,): face i has the nodes ``nodes[offsets[i]:offsets[i + 1]]``;
    its normal leads out of the owner."""
    owner: IntArray
    neighbour: IntArray
    """`owner`, `neighbour` (f,), (g,): the cells on both sides; the last f - g are outer faces."""

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""
        return 1 + max(self.owner.max(initial=-1), self.neighbour.max(initial=-1))

    def same_as(self, other: Faces) -> bool:
        """Return whether both have the same nodes and cells."""
        return all(
            np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("offsets", "nodes", "owner", "neighbour")
        )

    def next_nodes(self) -> IntArray:
        """Return the node (k,) that follows each of ``nodes`` round its face."""
        after = np.roll(self.nodes, -1)
        after[self.offsets[1:] - 1] = self.nodes[self.offsets[:-1]]
        return after

    def geometry(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return centres (f, d) and area vectors (f, d), as OpenFOAM's primitiveMesh has them."""
        start = self.offsets[:-1]
        here = points[self.nodes]
        if points.shape[1] == 2:
            along = here[1::2] - here[::2]
            return (here[1::2] + here[::2]) / 2, np.stack([along[:, 1], -along[:, 0]], 1)
        sizes = np.diff(self.offsets)
        middle = np.repeat(np.add.reduceat(here, start) / sizes[:, None], sizes, axis=0)
        there = points[self.next_nodes()]
        normals = np.cross(there - here, middle - here)
        areas = row_norms(normals)
        moments = np.add.reduceat(areas[:, None] * (here + there + middle), start)
        total = 3 * np.add.reduceat(areas, start)[:, None]
        with np.errstate(all="ignore"):
            centres = np.where(total > 0, moments / total, middle[start])
        return centres, np.add.reduceat(normals, start) / 2

    def cell_geometry(
        self, points: FloatArray, centres: FloatArray, areas: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return centres (c, d) and volumes (c,) of the cells, as OpenFOAM has them.

        Each is divided into pyramids on its faces (``centres`` and ``areas`` of `geometry`), their
        tops at the mean of the faces' centres.
        """
        dim = points.shape[1]
        count = self.n_cells
        inner = len(self.neighbour)
        cells = np.concatenate([self.owner, self.neighbour])
        middles = np.concatenate([centres, centres[:inner]])
        normals = np.concatenate([areas, -areas[:inner]])

        def summed(values: FloatArray) -> FloatArray:
            return np.stack([np.bincount(cells, column, count) for column in values.T], 1)

        top = summed(middles) / np.bincount(cells, minlength=count)[:, None]
        volumes = row_dots(normals, middles - top[cells])
        tops = (dim * middles + top[cells]) / (dim + 1)
        total = np.bincount(cells, volumes, count)
        with np.errstate(all="ignore"):
            found = summed(volumes[:, None] * tops) / total[:, None]
        return np.where(np.isfinite(found), found, top), total / dim

    def worst_of_faces(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return non-orthogonality in degrees, skewness, and expansion of the cells (c,), each.

        They are the worst of the faces, by OpenFOAM's primitiveMeshTools.
        """
        centres, areas = self.geometry(points)
        middles, volumes = self.cell_geometry(points, centres, areas)
        inner = len(self.neighbour)
        own = centres - middles[self.owner]
        with np.errstate(all="ignore"):
            normals = areas / row_norms(areas)[:, None]
            across = normals * row_dots(normals, own)[:, None]
            across[:inner] = middles[self.neighbour] - middles[self.owner[:inner]]
            reach = np.where(np.arange(len(own)) < inner, 0.2, 0.4) * row_norms(across)
            through = row_dots(areas, own) / row_dots(areas, across)
            off = own - through[:, None] * across
            length = row_norms(off)
            sizes = np.diff(self.offsets)
            ways = np.repeat(off / length[:, None], sizes, axis=0)
            arms = points[self.nodes] - np.repeat(centres, sizes, axis=0)
            along = np.maximum.reduceat(np.abs(row_dots(ways, arms)), self.offsets[:-1])
            skewness = np.where(length > 0, length / np.fmax(reach, along), 0.0)
            cosine = row_dots(normals[:inner], across[:inner]) / row_norms(across[:inner])
            here = volumes[self.owner[:inner]]
            there = volumes[self.neighbour]
            ratio = np.where(
                np.minimum(here, there) > 0, np.fmax(here / there, there / here), np.inf
            )
        angle = np.degrees(np.arccos(np.clip(np.nan_to_num(cosine), -1.0, 1.0)))
        found = []
        for values, least in (
            (angle, 0.0),
            (np.nan_to_num(skewness, nan=np.inf), 0.0),
            (ratio, 1.0),
        ):
            worst = np.full(len(volumes), least)
            np.maximum.at(worst, self.owner[: len(values)], values)
            np.maximum.at(worst, self.neighbour, values[:inner])
            found.append(worst)
        return found[0], found[1], found[2]


@record
class Polyhedra:
    """The cells of a file, some of which are several cells of the mesh."""

    cell: IntArray  # (m,): number of the file's cell that each cell of the mesh is in, ascending
    face: IntArray  # (m,): of a part, number of the file's face that it stands on; -1 for others
    faces: Faces

    @property
    def added(self) -> int:
        """Return the number of nodes added in polyhedra, one in each."""
        return int(np.count_nonzero(np.bincount(self.cell) > 1))


def whole_polygons(
    mesh: Mesh, offsets: IntArray, nodes: IntArray, cells: IntArray, *, sides: bool
) -> tuple[IntArray, IntArray, IntArray]:
    """Return polygons of cells of a mesh with polyhedra as those of the file's cells.

    The polygons of the parts of a polyhedron are one, around them all; ``sides`` of parts are one
    where they are pieces of one face. ``offsets`` (q + 1,), ``nodes`` (k,): as those of `Faces`.
    ``cells`` (q,): the cell of each. Also returns the index (p,) of the first polygon in each.
    """
    whole = mesh.whole_cells
    assert whole is not None
    groups = whole[cells]
    if sides:
        of_zones = (zone.mesh.origin.polyhedra for zone in mesh.parts)
        face = np.concatenate([one.face for one in of_zones if one is not None])[cells]
        groups = groups * (face.max(initial=0) + 1) + face
        groups[face < 0] = -1 - np.flatnonzero(face < 0)
    return outlines(offsets, nodes, groups)


def outlines(
    offsets: IntArray, nodes: IntArray, groups: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return polygons in which those of one group (q,) are one, and the index (p,) of its first.

    Those of a group around which there is not one simple line stay.
    """
    sizes = np.diff(offsets)
    _, first, group, counts = np.unique(
        groups, return_index=True, return_inverse=True, return_counts=True
    )
    some = np.repeat(counts[group] > 1, sizes)
    after = np.roll(nodes, -1)
    after[offsets[1:] - 1] = nodes[offsets[:-1]]
    start = nodes[some]
    end = after[some]
    of = np.repeat(group, sizes)[some]
    above = int(nodes.max(initial=0)) + 1
    edge = np.unique(np.minimum(start, end) * above + np.maximum(start, end), return_inverse=True)[
        1
    ]
    edge += of * len(edge)
    _, edge, times = np.unique(edge, return_inverse=True, return_counts=True)
    outer = times[edge] == 1
    begins = of[outer] * above + start[outer]
    order = np.argsort(begins)
    begins = begins[order]
    ends = (of[outer] * above + end[outer])[order]
    follow = np.minimum(np.searchsorted(begins, ends), max(len(begins) - 1, 0))
    of, heads, lengths = np.unique(of[outer], return_index=True, return_counts=True)
    heads = offsets_of(lengths)[:-1]
    # Walk along all lines at once: a simple one is back only when it has been everywhere.
    place = np.full(len(begins), -1)
    at = heads
    for step in range(lengths.max(initial=0)):
        new = place[at] < 0
        place[at[new]] = step
        at = follow[at]
    closed = begins[follow] == ends
    simple = np.minimum.reduceat(np.where(closed, place, -1), heads) >= 0 if len(heads) else closed
    walk = np.argsort(np.repeat(np.arange(len(of)), lengths) * len(begins) + place)
    line = (begins % above)[walk][np.repeat(simple, lengths)]
    stays = np.flatnonzero(~np.isin(group, of[simple]))
    kept = np.concatenate([stays, first[of[simple]]])
    size = np.concatenate([sizes[stays], lengths[simple]])
    flat = np.concatenate([nodes[ranges(offsets[stays], sizes[stays])], line])
    order = np.argsort(kept)
    flat = flat[ranges(offsets_of(size)[:-1][order], size[order])]
    return offsets_of(size[order]), flat, kept[order]


def parts_words(cell: IntArray | None) -> str:
    """Return in words how many polyhedra a mesh has, and how many parts of them; "" for none.

    ``cell`` is `Mesh.whole_cells`.
    """
    counts = np.bincount(cell) if cell is not None else np.empty(0, np.int64)
    several = counts[counts > 1]
    if not len(several):
        return ""
    return (
        f"{len(counts):,} cells, of which {len(several):,} polyhedra are {several.sum():,} parts "
        f"around {len(several):,} added points"
    )
