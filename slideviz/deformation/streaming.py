"""Streaming: a mesh larger than memory is deformed from file to file.

The skin is deformed as any mesh. What its steps found displaces all other nodes, block by block,
in a copy of the file; the same functions as of a mesh in memory are called for each block, and no
number depends on where a block ends. Last, cells are measured block by block.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from slideviz import __version__
from slideviz.case.model import Case
from slideviz.deformation.rest import Rest
from slideviz.deformation.setup import make_setup
from slideviz.deformation.solver import Progress, Step, folded_at, require_memory
from slideviz.deformation.stepping import Stepping
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.io.cleanup import draft
from slideviz.mesh.io.files import format_of
from slideviz.mesh.io.partial import partial_copy
from slideviz.mesh.io.su2b import Block, chosen_zone, element_blocks
from slideviz.mesh.io.su2b_layout import Source, ZonePlace, find_zones
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh
from slideviz.mesh.quality import INVERTED, Quality, quality
from slideviz.mesh.skin import read_skin
from slideviz.rbf.field import Field
from slideviz.rbf.problem import Watch
from slideviz.terms import Metric

CHUNK = 1 << 20
"""Nodes, or cells, that are in memory at a time."""
SPARSE = 8
"""A block of cells whose nodes lie within so many times their number is read with all between."""

Tell = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class Streamed:
    """The outcome of a streamed run.

    Attributes
    ----------
    skin : Mesh
        Undeformed.
    steps : tuple of Step
        With the skin as mesh, and the counts of the whole.
    quality, undeformed : Quality
        Of all cells; without ``size`` and ``skew``.
    folded : dict of int to (int, int)
        For cells that are inverted, those with the lowest numbers: type and the step after which.
    seconds : dict
        Spent by phase, beside those of the steps.
    """

    skin: Mesh
    steps: tuple[Step, ...]
    quality: Quality
    undeformed: Quality
    folded: dict[int, tuple[int, int]]
    seconds: dict[str, float]


def stream(
    case: Case,
    output: Path,
    *,
    tell: Tell = lambda _: None,
    resume: bool = False,
    replaces: Path | None = None,
    listed: int = 100,
) -> Streamed:
    """Deform the mesh of a case from file to file; what is in memory is its boundary.

    Parameters
    ----------
    output : Path
        Where the deformed mesh goes: whole or not at all.
    tell : callable
        Called often with a ``Progress``; an exception it raises ends the run at once.
    resume : bool
        Whether to go on where a run that was ended did.
    replaces : Path, optional
        The input that may be written over.
    listed : int
        Inverted cells that are followed through the steps.

    Raises
    ------
    CaseError, MeshError
        The case does not fit the mesh, or the mesh is of no format that can be streamed.
    DeformError
        The system cannot be solved, or the method needs the whole mesh.
    """
    assert case.mesh_file is not None
    path = case.mesh_file
    _require_streamable(case, path)
    seconds: dict[str, float] = {}
    watch = Watch(lambda phase, part: tell(Progress(1, max(1, case.steps), phase, part)), seconds)
    with watch.phase("read") as tick:
        skin = read_skin(path, case.zone, tick)
    setup_seconds = Watch(watch.report)
    with setup_seconds.phase("classify"):
        setup = make_setup(case, skin)
    require_memory(setup, case)
    fields: list[Field] = []
    stepping = Stepping(case, skin, setup, tell, setup_seconds.seconds, fields)
    steps = tuple(stepping.steps(case.steps))
    rest = Rest(skin, setup, steps, tuple(fields))
    with ExitStack() as stack:
        source = Source(path, stack.enter_context(path.open("rb")))
        place = chosen_zone(path, find_zones(source), case.zone)
        with partial_copy(
            output,
            path,
            _about(case, path),
            resume=resume,
            replaces=replaces,
            progress=lambda part: tell(Progress(case.steps, case.steps, "write", part)),
        ) as partial:
            done = partial.done
            total = place.n_points
            with watch.phase("evaluate") as tick:
                for first in range(done * CHUNK, total, CHUNK):
                    _move(
                        rest, source, place, partial.file, slice(first, min(first + CHUNK, total))
                    )
                    done += 1
                    partial.note(done)
                    tick(min(1.0, (first + CHUNK) / total))
            with watch.phase("quality") as tick:
                files = _Files(source, source.of(partial.file), place)
                rating = _Rating(stack, output.parent, place.cells.count, case.quality_metric)
                for block in element_blocks(source, place, place.cells, place.dim, CHUNK):
                    rating.add(block, *files.cells_of(block), listed)
                    tick((block.first + len(block.types)) / place.cells.count)
                folded = _folded(rest, files, rating.inverted)
    return Streamed(
        skin, _of_whole(steps, skin), rating.quality(), rating.undeformed(), folded, seconds
    )


def _require_streamable(case: Case, path: Path) -> None:
    """Raise where a case needs more of a mesh than can be streamed."""
    if not case.steps:
        raise CaseError("STEPS= auto cannot be streamed; give a number of steps")
    if case.method == "elastic":
        raise CaseError(
            "METHOD= elastic needs the whole mesh at once and cannot be streamed; use METHOD= rbf "
            "or idw, or run it without --stream"
        )
    if case.mesh_format == "su2" or format_of(path, None) != "su2b":
        raise MeshError(
            f"{path}: only SU2 binary meshes can be streamed; make one with `slideviz convert "
            f"{path.name} {path.stem}.su2b`"
        )


def _about(case: Case, path: Path) -> str:
    """Return what tells apart runs that give other points: case, files and program."""
    text = repr(
        (
            __version__,
            CHUNK,
            replace(case, mesh_out=None, view={}, warnings=()),
        )
    )
    for file in sorted(case.inputs()):
        if file not in (path, case.source):
            text += hashlib.sha256(file.read_bytes()).hexdigest()
    state = path.stat()
    return hashlib.sha256(f"{text}{state.st_size} {state.st_mtime_ns}".encode()).hexdigest()


def _move(rest: Rest, source: Source, place: ZonePlace, file: BinaryIO, part: slice) -> None:
    """Write the points of a part after the last step."""
    kind = source.point(place.dim)
    at = place.points + part.start * kind.itemsize
    rows = source.array(at, part.stop - part.start, kind, "the points")
    points = rows["x"].astype(np.float64)
    for now in rest.after_steps(np.arange(part.start, part.stop), points):
        points = now
    rows["x"] = points
    file.seek(at)
    file.write(rows.tobytes())


def _of_whole(steps: tuple[Step, ...], skin: Mesh) -> tuple[Step, ...]:
    """Return the steps with the counts of nodes of the whole mesh."""
    assert skin.part is not None
    more = skin.part.n_points - len(skin.points)
    return tuple(
        replace(
            step,
            node_counts={**step.node_counts, "internal": step.node_counts["internal"] + more},
        )
        for step in steps
    )


# Quality -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Files:
    """The points of a mesh in its file and in that of the deformed one."""

    before: Source
    after: Source
    place: ZonePlace

    def cells_of(self, block: Block) -> tuple[Mesh, Mesh]:
        """Return the cells of a block as a mesh, before and after."""
        low, high = int(block.nodes.min()), int(block.nodes.max()) + 1
        if high - low <= SPARSE * len(block.types):
            nodes, flat = np.arange(low, high), block.nodes - low
        else:
            nodes, flat = np.unique(block.nodes, return_inverse=True)
        cells = Cells.from_types(block.types, flat)
        base = Mesh(self.points(self.before, nodes), cells, name=self.before.name)
        return base, base.with_points(self.points(self.after, nodes))

    def points(self, source: Source, nodes: IntArray) -> FloatArray:
        """Return the points of nodes (k,), ascending; those close to each other in one piece."""
        kind = source.point(self.place.dim)
        out = np.empty((len(nodes), self.place.dim))
        a = 0
        while a < len(nodes):
            first = int(nodes[a])
            b = int(np.searchsorted(nodes, first + CHUNK))
            count = int(nodes[b - 1]) + 1 - first
            rows = source.array(
                self.place.points + first * kind.itemsize, count, kind, "the points"
            )
            out[a:b] = rows["x"][nodes[a:b] - first]
            a = b
        return out


class _Rating:
    """The quality of all cells, block by block; it is kept in files, which end with ``stack``.

    Attributes
    ----------
    inverted : dict of int to (int, (n,) int64)
        Type and nodes of the inverted cells with the lowest numbers.
    """

    def __init__(self, stack: ExitStack, folder: Path, count: int, metric: Metric) -> None:
        self._metric = metric
        self._values, self._before = (_scratch(stack, folder, count, float) for _ in range(2))
        self._status, self._old = (_scratch(stack, folder, count, np.uint8) for _ in range(2))
        self._signs = np.zeros(0, np.int8)
        self.inverted: dict[int, tuple[int, IntArray]] = {}

    def add(self, block: Block, base: Mesh, moved: Mesh, listed: int) -> None:
        """Measure a block; of inverted cells the ``listed`` with the lowest numbers are kept."""
        one, other = quality(base, metric=self._metric), quality(moved, base, self._metric)
        self._signs = np.unique(np.concatenate([self._signs, one.signs]))
        if len(self._signs) > 1:
            raise MeshError(
                f"{base.name}: some cells are numbered the other way round than others (near "
                f"element {block.first}), which only the whole mesh can tell from folded ones; run "
                "it without --stream, or mesh again"
            )
        self._values[block.ids], self._status[block.ids] = other.values, other.status
        self._before[block.ids], self._old[block.ids] = one.values, one.status
        ends = moved.cells.offsets
        for k in np.flatnonzero(other.status == INVERTED).tolist():
            nodes = block.nodes[ends[k] : ends[k + 1]]
            self.inverted[int(block.ids[k])] = int(block.types[k]), nodes.copy()
        self.inverted = dict(sorted(self.inverted.items())[:listed])

    def quality(self) -> Quality:
        """Return the quality of the deformed cells, without size and skew."""
        none = np.empty(0)
        return Quality(self._values, none, none, self._status, self._signs, self._metric)

    def undeformed(self) -> Quality:
        """Return the quality of the undeformed cells, without size and skew."""
        none = np.empty(0)
        return Quality(self._before, none, none, self._old, self._signs, self._metric)


def _scratch(stack: ExitStack, folder: Path, count: int, kind: type) -> NDArray:
    """Return an array in a file, which is removed with ``stack``."""
    path = stack.enter_context(draft(folder))
    return np.memmap(path, kind, "w+", shape=(count,))


def _folded(
    rest: Rest, files: _Files, cells: Mapping[int, tuple[int, IntArray]]
) -> dict[int, tuple[int, int]]:
    """Return the type of each cell, and after which step it is inverted for the first time."""
    if not cells:
        return {}
    types = [vtk for vtk, _ in cells.values()]
    nodes, flat = np.unique(
        np.concatenate([nodes for _, nodes in cells.values()]), return_inverse=True
    )
    points = files.points(files.before, nodes)
    part = Mesh(points, Cells.from_types(types, flat))
    moved = rest.after_steps(nodes, points)
    steps = [
        replace(step, mesh=part.with_points(now))
        for step, now in zip(rest.steps, moved, strict=True)
    ]
    when = folded_at(steps, part, np.arange(len(cells)))
    return dict(zip(cells, zip(types, when.tolist(), strict=True), strict=True))
