"""Reading SU2 text meshes; with the mesh is kept what is needed to write the file again."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import printable
from slideviz.formats.source import Source, open_source
from slideviz.formats.su2.lines import FirstAndEnd, Lines, Rows, boxes_elsewhere
from slideviz.formats.su2.numbers import parse_cells, parse_points
from slideviz.formats.su2.text import SendRows, Text, TextZone, boundaries_elsewhere, find_texts
from slideviz.mesh.halo import FITS, Halo, RigidMotion, fit_motion, make_halo
from slideviz.mesh.interfaces import find_interfaces
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh, Origin
from slideviz.mesh.zones import join_zones
from slideviz.system.threads import Tick, equal_shares, progress_share

HaloAndRemarks = tuple[Halo | None, tuple[str, ...]]
"""The halo, None if there is none or it cannot be used; and remarks, a sentence each."""


def find_halo(lines: Lines, zone: TextZone, mesh: Mesh) -> HaloAndRemarks:
    """Return the halo that the ``SEND_RECEIVE`` markers of a zone describe, and remarks on it."""
    if not zone.sends:
        return None, ()
    sends = [one for one in zone.sends if one.domain == b"1"]
    receives = [one for one in zone.sends if one.domain == b"-1"]
    tables = [_table(lines, part, len(mesh.points)) for part in (sends, receives)]
    if any(t is None for t in tables) or len(zone.sends) != len(sends) + len(receives):
        return None, (
            _unused("their rows are not `1 node transform`, or they belong to another partition"),
        )
    donors, receivers = map(np.asarray, tables)
    if len(donors) != len(receivers):
        return None, (_unused(f"{len(donors)} nodes send and {len(receivers)} receive"),)
    if len(np.unique(receivers[:, 0])) != len(receivers):
        return None, (_unused("a node receives twice"),)
    return _tied(mesh, donors[:, 0], receivers, _transforms(lines, zone))


def _unused(why: str) -> str:
    return (
        f"the SEND_RECEIVE markers are inconsistent ({why}); they are kept, but the halo is "
        "ignored: rebuild it"
    )


def _tied(
    mesh: Mesh, donors: IntArray, receivers: IntArray, given: dict[int, FloatArray]
) -> HaloAndRemarks:
    """Return the halo of those pairs whose motion is found, and remarks.

    ``donors`` (h,): nodes. ``receivers`` (h, 2): nodes and their ``PERIODIC_INDEX``. ``given``:
    centre, angles and translation by ``PERIODIC_INDEX``.
    """
    remarks: list[str] = []
    motions: list[RigidMotion] = []
    which = np.full(len(donors), -1)
    for index in np.unique(receivers[:, 1]).tolist():
        mine = receivers[:, 1] == index
        nodes = receivers[mine, 0]
        tries = list(_readings(given[index], mesh.dim)) if index in given else []
        motion, remark = _best(mesh, index, donors[mine], nodes, tries)
        remarks += [remark] if remark else []
        if motion is not None:
            which[mine] = len(motions)
            motions.append(motion)
    used = which >= 0
    if not used.any():
        return None, tuple(remarks)
    return make_halo(mesh, receivers[used, 0], donors[used], motions, which[used]), tuple(remarks)


def _best(
    mesh: Mesh, index: int, donors: IntArray, receivers: IntArray, tries: Sequence[RigidMotion]
) -> tuple[RigidMotion | None, str]:
    """Return the motion that best moves donors (k,) to receivers (k,), and a remark ("" if none).

    It is one of ``tries`` if any fits, else possibly the one fitted to the points. None if it
    misses most receivers. ``index`` is their ``PERIODIC_INDEX``.
    """
    before = mesh.points[donors]
    after = mesh.points[receivers]
    allowed = FITS * float(np.ptp(mesh.points, axis=0).max())

    def misfit(motion: RigidMotion) -> FloatArray:
        return np.asarray(np.linalg.norm(motion.at(before) - after, axis=1))

    def rank(motion: RigidMotion) -> tuple[int, float]:
        far = misfit(motion)
        return int(np.count_nonzero(far > allowed)), float(far.max())

    fitted = fit_motion(before, after)
    # A motion of the file is preferred to the fitted one, as long as it fits.
    motion = min(tries, key=rank, default=fitted)
    if rank(motion)[0]:
        motion = min(motion, fitted, key=rank)
    far = misfit(motion)
    name = f"PERIODIC_INDEX= {index}"
    wrong = int(np.count_nonzero(far > allowed))
    if 2 * wrong > len(far):
        return None, _unused(f"no motion brings the donors of {name} onto their receivers")
    if wrong:
        worst = int(np.argmax(far))
        return motion, (
            f"{wrong} of {len(far)} halo nodes are not where {name} puts them (node "
            f"{receivers[worst]} is {far[worst]:.3g} off); they follow their donors from there; "
            "rebuild the halo if the solver needs it exact"
        )
    if motion is fitted:
        what = "does not fit its halo" if tries else "is missing"
        return motion, f"{name} {what}; the motion found by matching the nodes is used"
    return motion, ""


def _table(lines: Lines, parts: Sequence[SendRows], count: int) -> IntArray | None:
    """Return node, below ``count``, and ``PERIODIC_INDEX`` of each row, (r, 2), or None."""
    pieces = (piece for part in parts for piece in part.rows)
    rows = [row.split()[:3] for piece in pieces for _, row in lines.numeric(piece)]
    if not rows or any(len(row) < 3 or not all(w.isdigit() for w in row) for row in rows):
        return None
    table = np.array(rows, dtype="S18").astype(np.int64)
    return table[:, 1:] if table[:, 1].max() < count else None


def _transforms(lines: Lines, zone: TextZone) -> dict[int, FloatArray]:
    """Return centre, angles and translation (rows of (3, 3)) by PERIODIC_INDEX, where readable."""
    markers = {}
    for section in zone.unknown:
        if section.key == "PERIODIC_INDEX" and section.value.isdigit():
            words = b" ".join(lines.line(k) for k in range(section.line + 1, section.stop)).split()
            try:
                numbers = np.array([float(word) for word in words[:9]])
            except ValueError:
                continue
            if len(numbers) == 9 and np.isfinite(numbers).all():
                markers[int(section.value)] = numbers.reshape(3, 3)
    return markers


def _readings(transform: FloatArray, dim: int) -> Iterator[RigidMotion]:
    """Yield the 16 motions that centre, angles and translation (rows of (3, 3)) may mean.

    They differ in the unit of the angles, the order of rotations, whether the translation comes
    before or after, and the direction.
    """
    centre = transform[0]
    angles = transform[1]
    shift = transform[2]
    for unit, order in product((1.0, np.pi / 180.0), ((2, 1, 0), (0, 1, 2))):
        rotation = np.eye(3)
        for axis in order:
            rotation = rotation @ _about(axis, unit * float(angles[axis]))
        for before in (0.0, 1.0):  # is the translation made after, or before the rotation
            moved = rotation @ (before * shift - centre) + centre + (1.0 - before) * shift
            yield RigidMotion(rotation[:dim, :dim], moved[:dim])
            back = rotation.T
            yield RigidMotion(back[:dim, :dim], (-back @ moved)[:dim])


def _about(axis: int, angle: float) -> FloatArray:
    i = (axis + 1) % 3
    j = (axis + 2) % 3
    out = np.eye(3)
    out[i, i] = out[j, j] = np.cos(angle)
    out[j, i] = np.sin(angle)
    out[i, j] = -out[j, i]
    return out


_SCANNED = 0.2
"""Part of the time of reading a file, as told to the progress, that finding its lines takes."""


_SNIFFED_BYTES = 1 << 16  # bytes of a file that are searched for ``NDIME=``
_NDIME = re.compile(rb"^\s*NDIME\s*=", re.IGNORECASE | re.MULTILINE)


@record
class Document(Origin):
    """An SU2 file as it was read, with the places of its parts, so that it can be written again."""

    ending = ".su2"
    raw: Source  # the whole file
    rows: Rows  # the rows of the points in it
    points: FloatArray  # (n, d): the points as read
    cells: Cells  # the cells as read
    markers: tuple[Marker, ...]  # the boundaries as read
    zone: FirstAndEnd  # (int, int): first byte and end of the zone, without its ``IZONE`` line
    sends: tuple[FirstAndEnd, ...]
    unknown: tuple[FirstAndEnd, ...]
    """`sends`, `unknown`: first byte and end of each ``SEND_RECEIVE`` marker, and of each unknown
    section."""


def is_su2(path: Path) -> bool:
    """Return whether a file begins as an SU2 text does, by its ``NDIME=``; or raise OSError."""
    with path.open("rb") as file:
        return _NDIME.search(file.read(_SNIFFED_BYTES)) is not None


def read_su2_file(path: Path, zone: int | None, progress: Tick) -> Mesh:
    """Return one zone of an SU2 file, or all of them, as `read_su2` does."""
    return read_su2(open_source(path), zone, progress)


def read_su2(raw: Source, zone: int | None, progress: Tick) -> Mesh:
    """Return one zone of an SU2 file, or all of them as one mesh.

    Raises MeshError if the file has a mistake; the message has the line. ``raw``: the file.
    ``zone``: the zone, from 1; None for all. ``progress``: called with the fraction done; may raise
    to stop.
    """
    texts = find_texts(raw, zone, lambda done: progress(_SCANNED * done))
    shares = equal_shares(progress, len(texts))
    each = zip(texts, shares, strict=True)
    return join_zones([_read_zone(text, tick, alone=len(texts) == 1) for text, tick in each])


def _read_zone(text: Text, progress: Tick, *, alone: bool) -> Mesh:
    """Return a zone, with its interfaces to the others if it is read ``alone``."""
    lines = text.lines
    text_zone = text.zone
    n_points = text.n_points
    raw = lines.raw
    sizes = [
        rows[-1].end - rows[0].begin if rows else 0
        for rows in (text_zone.elements, text_zone.points, *(m.rows for m in text_zone.markers))
    ]
    first, second, *rest = _shares(sizes, progress)
    cells = parse_cells(lines, text_zone.elements, text_zone.dim, n_points, first)
    points = parse_points(lines, text_zone.points, text_zone.dim, second)
    markers = tuple(
        Marker(part.name, parse_cells(lines, part.rows, text_zone.dim - 1, n_points, share))
        for part, share in zip(text_zone.markers, rest, strict=True)
    )
    raw.require_same()
    progress(1.0)
    document = Document(
        raw=raw,
        rows=text_zone.points,
        points=points,
        cells=cells,
        markers=markers,
        zone=lines.bytes_of((text_zone.bounds.begin, text_zone.bounds.end))[0],
        sends=lines.bytes_of(*((part.begin, part.end) for part in text_zone.sends)),
        unknown=text.unknown,
        ffd_at=text_zone.ffd_at,
        ffd_elsewhere=boxes_elsewhere(text.sections, text_zone.bounds),
    )
    mesh = Mesh(
        points=points,
        cells=cells,
        markers=markers,
        origin=document,
        name=printable(raw.path.name),
        zone=text_zone.bounds.number,
        zones=text_zone.bounds.zones,
        source=raw.path.resolve(),
    )
    halo, remarks = find_halo(lines, text_zone, mesh)
    others = boundaries_elsewhere(text, progress) if alone else ()
    return replace(
        mesh,
        halo=halo,
        remarks=(*text_zone.remarks, *remarks),
        interfaces=find_interfaces(mesh, others),
    )


def _shares(sizes: list[int], progress: Tick) -> list[Tick]:
    """Return a function for each part that turns its progress (0 to 1) into that of all parts."""
    total = max(sum(sizes), 1)
    edges = [_SCANNED + (1.0 - _SCANNED) * sum(sizes[:k]) / total for k in range(len(sizes) + 1)]
    return [progress_share(progress, *ends) for ends in pairwise(edges)]
