"""Small OpenFOAM cases, written as OpenFOAM's user guide describes the files of ``polyMesh``."""

import gzip
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Mesh

Sides = list[tuple[int, ...]]  # the faces of a cell, their nodes counter-clockwise from outside

HEADER = """/*--- C++ ---*\\
\\*-----------*/
FoamFile
{{
    version     2.0;
    format      {form};
{arch}    class       {kind};
    location    "constant/polyMesh";
    object      {name};
}}
// * * * * * * //

"""


@dataclass
class Form:
    """How files are written: ASCII or binary, compressed or not, and the size of numbers."""

    binary: bool = False
    packed: bool = False
    label: int = 32
    scalar: int = 64

    def write(self, folder: Path, name: str, kind: str, *lists, ascii_kind: str = "") -> None:
        """Write a file: its lists are texts, or arrays of labels or scalars."""
        binary = self.binary and not any(isinstance(one, str) for one in lists)
        arch = f'    arch        "LSB;label={self.label};scalar={self.scalar}";\n'
        form = "binary" if binary else "ascii"
        kind = kind if binary or not ascii_kind else ascii_kind
        text = HEADER.format(form=form, arch=arch if binary else "", kind=kind, name=name)
        data = text.encode()
        for values in lists:
            data += self._list(values, binary=binary) + b"\n\n"
        data += b"// ***** //\n"
        path = folder / (f"{name}.gz" if self.packed else name)
        path.write_bytes(gzip.compress(data) if self.packed else data)

    def _list(self, values, *, binary: bool) -> bytes:
        if isinstance(values, str):
            return values.encode()
        if binary:
            kind = f"<f{self.scalar // 8}" if values.dtype.kind == "f" else f"<i{self.label // 8}"
            return b"%d\n(%b)" % (len(values), values.astype(kind).tobytes())
        items = [
            str(one) if values.ndim == 1 else f"({' '.join(map(repr, one))})"
            for one in values.tolist()
        ]
        if len(values) > 1 and len({*items}) == 1:  # as OpenFOAM writes lists of equal values
            return f"{len(values)}{{{items[0]}}}".encode()
        return f"{len(values)}\n(\n{chr(10).join(items)}\n)\n".encode()


def sides_of(mesh: Mesh) -> list[Sides]:
    """Return the faces of each cell of a mesh in three dimensions."""
    cells = mesh.cells
    return [
        [
            tuple(int(cells.connectivity[cells.offsets[i] + k]) for k in facet)
            for facet in ELEMENTS[int(cells.types[i])].facets
        ]
        for i in range(len(cells))
    ]


def merged(cells: Sequence[Sides], groups: Sequence[int]) -> list[Sides]:
    """Return the cells in which those of one group (a number for each cell) are one."""
    found: dict[int, Sides] = {}
    for sides, group in zip(cells, groups, strict=True):
        found.setdefault(group, []).extend(sides)
    for group, sides in found.items():
        keys = [frozenset(side) for side in sides]
        found[group] = [side for side, key in zip(sides, keys, strict=True) if keys.count(key) == 1]
    return [found[group] for group in sorted(found)]


def extruded(points: np.ndarray, polygons: Sequence[Sequence[int]], heights: Sequence[float]):
    """Return points (n, 3), and prisms on polygons (counter-clockwise) in layers."""
    count = len(points)
    layers = [np.column_stack([points, np.full(count, height)]) for height in heights]
    cells = []
    for layer in range(len(heights) - 1):
        for polygon in polygons:
            low = [node + layer * count for node in polygon]
            high = [node + count for node in low]
            sides = [tuple(reversed(low)), tuple(high)]
            for k in range(len(low)):
                after = (k + 1) % len(low)
                sides.append((low[k], low[after], high[after], high[k]))
            cells.append(sides)
    return np.concatenate(layers), cells


def patches_of(mesh: Mesh) -> dict[str, set[frozenset]]:
    """Return the nodes of the elements of each boundary of a mesh, by name."""
    found = {}
    for marker in mesh.markers:
        parts = np.split(marker.cells.connectivity, marker.cells.offsets[1:-1])
        found[marker.name] = {frozenset(nodes.tolist()) for nodes in parts}
    return found


def write_polymesh(
    folder: Path,
    points: np.ndarray,
    cells: Sequence[Sides],
    patches: Mapping[str, object],
    kinds: Mapping[str, str] | None = None,
    form: Form | None = None,
) -> Path:
    """Write ``points``, ``faces``, ``owner``, ``neighbour`` and ``boundary`` into a folder.

    ``patches``: for each the nodes of its faces (frozensets), or a function that returns whether a
    face is of it, from its corners (k, 3). ``kinds``: their types; ``patch`` where left out.
    """
    form = form or Form()
    owner: dict[frozenset, int] = {}
    neighbour: dict[frozenset, int] = {}
    nodes: dict[frozenset, tuple[int, ...]] = {}
    for cell, sides in enumerate(cells):
        for side in sides:
            key = frozenset(side)
            if key in owner:
                neighbour[key] = cell
            else:
                owner[key], nodes[key] = cell, side
    inner = sorted(neighbour, key=lambda key: (owner[key], neighbour[key]))
    order, entries = list(inner), []
    left = [key for key in owner if key not in neighbour]
    for name, has in patches.items():
        mine = [k for k in left if (has(points[list(nodes[k])]) if callable(has) else k in has)]
        left = [key for key in left if key not in mine]
        kind = (kinds or {}).get(name, "patch")
        entries.append(
            f"    {name}\n    {{\n        type {kind};\n        inGroups 1({kind});\n"
            f"        nFaces {len(mine)};\n        startFace {len(order)};\n    }}\n"
        )
        order += mine
    assert not left, "a face is of no patch"
    folder.mkdir(parents=True, exist_ok=True)
    lists = [nodes[key] for key in order]
    if form.binary:
        sizes = np.cumsum([0, *map(len, lists)])
        form.write(folder, "faces", "faceCompactList", sizes, np.concatenate(lists))
    else:
        text = "\n".join(f"{len(one)}({' '.join(map(str, one))})" for one in lists)
        form.write(folder, "faces", "faceList", f"{len(lists)}\n(\n{text}\n)\n")
    form.write(folder, "points", "vectorField", points.astype(float))
    form.write(folder, "owner", "labelList", np.array([owner[key] for key in order]))
    inside = np.array([neighbour[key] for key in inner], int)
    form.write(folder, "neighbour", "labelList", inside)
    form.write(folder, "boundary", "polyBoundaryMesh", f"{len(entries)}\n(\n{''.join(entries)})\n")
    return folder


def write_mesh(folder: Path, mesh: Mesh, kinds=None, form: Form | None = None) -> Path:
    """Write a mesh of elements as a case; return its folder."""
    where = folder / "constant" / "polyMesh"
    write_polymesh(where, mesh.points, sides_of(mesh), patches_of(mesh), kinds, form)
    return folder


def honeycomb(rows: int = 3, columns: int = 3):
    """Return points (n, 2) and hexagons, counter-clockwise, of a piece of a honeycomb."""
    numbers: dict[tuple[float, float], int] = {}
    points = []
    hexagons = []
    for row in range(rows):
        for column in range(columns):
            centre = np.array([np.sqrt(3) * (column + row % 2 / 2), 1.5 * row])
            hexagon = []
            for angle in np.radians(30 + 60 * np.arange(6)):
                corner = centre + np.array([np.cos(angle), np.sin(angle)])
                key = (round(corner[0], 6), round(corner[1], 6))
                if key not in numbers:
                    points.append(corner)
                hexagon.append(numbers.setdefault(key, len(numbers)))
            hexagons.append(hexagon)
    return np.array(points), hexagons


def honeycomb_case():
    """Return points, cells and patches of hexagonal prisms around a body, between two planes."""
    flat, hexagons = honeycomb(24, 20)
    middles = np.array([flat[hexagon].mean(axis=0) for hexagon in hexagons])
    middle = middles[10 + 20 * 12]
    outside = np.hypot(*((middles - middle) / [5.0, 2.5]).T) > 1
    kept = [hexagon for hexagon, out in zip(hexagons, outside, strict=True) if out]
    used = np.unique(kept)
    flat = flat[used] - middle
    kept = [np.searchsorted(used, hexagon).tolist() for hexagon in kept]
    points, cells = extruded(flat, kept, [0.0, 1.0, 2.0, 3.0])
    patches = {
        "ends": lambda corners: np.ptp(corners[:, 2]) == 0,
        "body": lambda corners: np.hypot(*corners[:, :2].mean(axis=0)) < 8,
        "far": lambda corners: True,
    }
    return points, cells, patches
