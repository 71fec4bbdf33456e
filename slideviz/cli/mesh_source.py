"""The mesh of info, quality and section: in memory, or with ``--stream`` in its file."""

from __future__ import annotations

import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.case.zone_cases import with_marker_names
from slideviz.cli.progress import Bar
from slideviz.cli.report import print_remarks
from slideviz.errors import MeshError
from slideviz.formats.files import read
from slideviz.mesh.model import Mesh
from slideviz.solver.steps import Progress
from slideviz.streaming.quality import measure_mesh
from slideviz.streaming.source import FileSource, MemorySource, has_cells_of
from slideviz.streaming.stream_input import open_read_only

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.mesh.metrics import MetricValues
    from slideviz.mesh.quality import Quality
    from slideviz.streaming.quality import CellCounts
    from slideviz.streaming.source import MeshSource
    from slideviz.streaming.stream_input import StreamInput
    from slideviz.terms import FileFormat, Metric


@dataclass(frozen=True, eq=False)
class OpenMesh:
    """A mesh that a command reads, and the undeformed one if there is a reference."""

    source: MeshSource
    case: Case | None  # with the names of the boundaries as the mesh has them
    reference: Path | None  # the file of the undeformed mesh
    read_base: Callable[[], Mesh | None]
    """Returns the undeformed mesh or, of a mesh in its file, its boundary."""
    stack: ExitStack  # closes files, and removes temporary ones

    def quality(
        self,
        arguments: Namespace,
        counts: CellCounts | None = None,
        metrics: MutableMapping[Metric, MetricValues | None] | None = None,
    ) -> Quality:
        """Return the quality of all cells; ``counts`` and ``metrics`` as for `measure_mesh`."""
        folder = Path(tempfile.gettempdir())
        with progress_of(arguments, "quality") as tick:
            return measure_mesh(
                self.stack,
                folder,
                self.source,
                metric=arguments.metric,
                counts=counts,
                tick=tick,
                metrics=metrics,
            )


@contextmanager
def progress_of(arguments: Namespace, phase: str) -> Iterator[Callable[[float], None]]:
    """Context with a function that shows the progress of a phase, if ``--stream`` is set."""
    with Bar(arguments.stream) as bar:
        yield lambda part: bar.phase(Progress(1, 1, phase, part))


@contextmanager
def open_mesh(arguments: Namespace, case: Case | None = None) -> Iterator[OpenMesh]:
    """Context with the mesh of a command, and the undeformed one.

    That is of ``--reference`` or else of ``--case``, but only where it has the same cells: the case
    may have been given only for its periodic boundaries. Binary copies of texts are in the folder
    for temporary files until the context ends. Raises MeshError if the mesh has a mistake or, with
    ``--stream``, is of no format that can be streamed; or ``--reference`` has other cells.
    """
    folder = Path(tempfile.gettempdir())
    reference = arguments.reference
    with ExitStack() as stack:
        with progress_of(arguments, "read") as tick:

            def open_one(
                path: Path, zone: int | None, kind: FileFormat | None = None
            ) -> Mesh | StreamInput:
                if not arguments.stream:
                    return read(path, zone=zone, file_format=kind)
                return stack.enter_context(open_read_only(path, zone, tick, folder, kind))

            zone = arguments.zone if case is None else arguments.zone or case.zone
            mesh = open_one(arguments.mesh, zone)
            skin = _mesh_of(mesh, tick)
            base = None
            if reference is not None:
                base = open_one(reference, zone)
                if arguments.stream and not _same_cells(mesh, base):
                    raise MeshError(
                        f"{reference} cannot be the reference of {skin.name}: it must have the "
                        "same cells; give the undeformed mesh"
                    )
            elif case is not None and case.mesh_file is not None and case.mesh_file.is_file():
                base = open_one(case.mesh_file, zone, case.mesh_format)
                base = base if _same_cells(mesh, base) else None
                reference = None if base is None else case.mesh_file
        source = _source(stack, mesh, base, skin)
        if case is not None:
            known = len(case.warnings)
            case = with_marker_names(case, skin)
            print_remarks(case.warnings[known:], quiet=False)
        read_base = partial(_mesh_of, base) if base is not None else lambda: None
        yield OpenMesh(source, case, reference, read_base, stack)


def _mesh_of(mesh: Mesh | StreamInput, tick: Callable[[float], object] = lambda _: None) -> Mesh:
    """Return a mesh in memory or, of one in its file, its boundary and the cells at it."""
    return mesh if isinstance(mesh, Mesh) else mesh.skin(tick)


def _same_cells(mesh: Mesh | StreamInput, base: Mesh | StreamInput) -> bool:
    if isinstance(mesh, Mesh) and isinstance(base, Mesh):
        return base.points.shape == mesh.points.shape and base.cells.same_as(mesh.cells)
    assert not isinstance(mesh, Mesh)
    assert not isinstance(base, Mesh)
    return has_cells_of((mesh.path, mesh.zone), (base.path, base.zone))


def _source(
    stack: ExitStack, mesh: Mesh | StreamInput, base: Mesh | StreamInput | None, skin: Mesh
) -> MeshSource:
    if isinstance(mesh, Mesh):
        assert base is None or isinstance(base, Mesh)
        return MemorySource(mesh, base)
    assert not isinstance(base, Mesh)
    zone = None if base is None else (base.path, base.zone)
    return FileSource.open(stack, (mesh.path, mesh.zone), zone, skin=skin)
