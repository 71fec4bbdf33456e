"""The boxes of an SU2 mesh file, in its section ``FFD_NBOX=``: read, and written back.

Only rows of control points that changed are written anew; the rest of the section keeps its bytes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.ffd.box import Box
from slideviz.ffd.coordinates import CARTESIAN, CoordinateSystem, given_of_polar
from slideviz.ffd.reader import Entries, entries_of, key_of, read_boxes
from slideviz.formats.su2.keyword_blocks import is_ffd
from slideviz.formats.su2.read import Document
from slideviz.mesh.model import FloatArray, Mesh

_LETTERS = "IJK"
_BOXES: WeakKeyDictionary[Mesh, dict[CoordinateSystem, tuple[Box, ...]]] = WeakKeyDictionary()
"""The boxes that were read, by mesh."""


def boxes_of(mesh: Mesh, system: CoordinateSystem = CARTESIAN) -> tuple[Box, ...]:
    """Return the boxes of a mesh, in the order of its file, in a coordinate system.

    Raises
    ------
    MeshError
        The section has a mistake.
    """
    kept = _BOXES.setdefault(mesh, {})
    if system not in kept:
        kept[system] = read_boxes(mesh, _lines(mesh), system)
    return kept[system]


def with_boxes(
    mesh: Mesh, boxes: Sequence[Box], *, anew: bool = False, renewed: Collection[str] = ()
) -> Mesh:
    """Return the mesh with boxes in the section that its SU2 file will have.

    Parameters
    ----------
    mesh : Mesh
    boxes : sequence of Box
        Changed boxes, matched by name, and new ones; the mesh's other boxes stay.
    anew : bool
        Whether all boxes that the mesh had are dropped.
    renewed : collection of str
        Names of boxes whose surface points have other parametric coordinates than before.
    """
    lines = [] if anew else _lines(mesh)
    entries = entries_of(lines)
    by_name = {box.name: box for box in boxes}
    for one in reversed(entries):  # from below, so that the lines above keep their numbers
        box = by_name.pop(one["FFD_TAG"].value, None)
        if box is not None:
            _update(lines, one, box, box.name in renewed)
    if not entries:
        lines = [f"FFD_NBOX= {len(boxes)}\n", "FFD_NLEVEL= 1\n"]
    elif by_name:
        at = next(at for at, line in enumerate(lines) if key_of(line) == "FFD_NBOX")
        lines[at] = f"FFD_NBOX= {len(entries) + len(by_name)}\n"
    for box in by_name.values():
        lines += _written(box, mesh.dim)
    text = "".join(lines).encode("utf-8", "surrogateescape")
    text = text if text.endswith(b"\n") else text + b"\n"
    return replace(mesh, origin=replace(mesh.origin, ffd=text, ffd_at=()))


def _lines(mesh: Mesh) -> list[str]:
    """Return the lines of the section, with their line breaks; empty without a section."""
    origin = mesh.origin
    if origin.ffd is not None:
        text = origin.ffd
    elif isinstance(origin, Document):
        parts = (origin.raw[a:b] for a, b in origin.unknown)
        text = b"".join(part for part in parts if is_ffd(part))
    else:
        text = b""
    return [line.decode("utf-8", "surrogateescape") for line in text.splitlines(keepends=True)]


def _update(lines: list[str], entries: Entries, box: Box, renewed: bool) -> None:
    """Write the changed control points of a box into ``lines``, in place.

    Control points and surface points that the file does not list are written as a whole, and so
    are surface points that are ``renewed``.
    """
    surface = entries.get("FFD_SURFACE_POINTS")
    if surface is not None and box.embedded and (not surface.rows or renewed):
        last = surface.rows[-1][0] if surface.rows else surface.line
        lines[surface.line : last + 1] = _surface_lines(box)
    control = entries["FFD_CONTROL_POINTS"]
    if not control.rows:
        lines[control.line : control.line + 1] = _control_lines(box.points)
    for number, words in control.rows:
        i, j, k = (int(word) for word in words[:3])
        if [float(word) for word in words[3:]] != box.points[i, j, k].tolist():
            ending = lines[number][len(lines[number].rstrip("\r\n")) :]
            lines[number] = _control_row(box.points, i, j, k) + ending


def _written(box: Box, dim: int) -> Iterator[str]:
    """Yield all lines of a box."""
    letters = _LETTERS[:dim]
    axes = box.axes(dim)
    yield f"FFD_TAG= {box.name}\nFFD_LEVEL= 0\n"
    for letter, degree in zip(letters, (box.degrees[axis] for axis in axes), strict=True):
        yield f"FFD_DEGREE_{letter}= {degree}\n"
    yield f"FFD_BLENDING= {'BSPLINE_UNIFORM' if box.orders else 'BEZIER'}\n"
    orders = (box.orders[axis] for axis in axes) if box.orders else ()
    for letter, order in zip(letters, orders, strict=False):
        yield f"BSPLINE_ORDER_{letter}= {order}\n"
    corners = (
        given_of_polar(box.corners) if axes == (0, 2) else box.corners[: 4 if dim == 2 else 8, :dim]
    )
    yield f"FFD_PARENTS= 0\nFFD_CHILDREN= 0\nFFD_CORNER_POINTS= {len(corners)}\n"
    yield from (_tabbed(corner) + "\n" for corner in corners.tolist())
    yield from _control_lines(box.points)
    yield from _surface_lines(box)


def _control_lines(points: FloatArray) -> Iterator[str]:
    """Yield the lines of all control points (I, J, K, 3)."""
    yield f"FFD_CONTROL_POINTS= {points[..., 0].size}\n"
    for index in np.ndindex(points.shape[:3]):
        yield _control_row(points, *index) + "\n"


def _control_row(points: FloatArray, i: int, j: int, k: int) -> str:
    """Return the row of a control point, without a line break."""
    return f"{i}\t{j}\t{k}\t" + _tabbed(points[i, j, k].tolist())


def _surface_lines(box: Box) -> Iterator[str]:
    """Yield the lines of the embedded surface points of a box."""
    yield f"FFD_SURFACE_POINTS= {sum(len(nodes) for nodes, _ in box.embedded.values())}\n"
    for marker, (nodes, uvw) in box.embedded.items():
        for node, at in zip(nodes.tolist(), uvw.tolist(), strict=True):
            yield f"{marker}\t{node}\t{_tabbed(at)}\n"


def _tabbed(values: Sequence[float]) -> str:
    """Return numbers with all their digits, separated by tabs."""
    return "\t".join(repr(value) for value in values)
