"""``--stream`` of info, quality and section: the mesh is read block by block."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.mesh.model import Mesh
    from slideviz.streaming.quality_blocks import MeshQuality, Zone
    from slideviz.streaming.stream_input import StreamInput
    from slideviz.terms import FileFormat


@dataclass(frozen=True, eq=False)
class StreamedMesh:
    """A mesh that is read block by block."""

    skin: Mesh
    """Its boundary and the cells at it."""
    mesh: Zone
    """(Path, int or None): file and zone of all its cells."""
    base: StreamInput | None = None
    """The undeformed mesh, if there is a reference."""
    reference: Path | None = None
    """The file of the reference, as the user gave it."""

    @property
    def base_zone(self) -> Zone | None:
        """Return file and zone of the cells of the reference, or None."""
        return None if self.base is None else (self.base.path, self.base.zone)


@contextmanager
def open_streamed(arguments: argparse.Namespace, case: Case | None) -> Iterator[StreamedMesh]:
    """Context with the mesh of a command, and its reference.

    The reference is found as by `slideviz.cli.options.reference_of`. Binary copies of texts are in
    the folder for temporary files until the context ends.

    Raises
    ------
    MeshError
        The mesh is of no format that can be streamed, or has a mistake; or ``--reference`` has
        other cells.
    """
    from slideviz.cli.progress import Bar
    from slideviz.errors import MeshError
    from slideviz.solver.steps import Progress
    from slideviz.streaming.quality_blocks import has_cells_of
    from slideviz.streaming.stream_input import open_read_only

    folder = Path(tempfile.gettempdir())
    with ExitStack() as stack, Bar() as bar:

        def tick(part: float) -> None:
            bar.phase(Progress(1, 1, "read", part))

        def opened(path: Path, zone: int | None, kind: FileFormat | None = None) -> StreamInput:
            return stack.enter_context(open_read_only(path, zone, tick, folder, kind))

        one = opened(arguments.mesh, arguments.zone)
        skin, mesh = one.skin(tick), (one.path, one.zone)
        found = StreamedMesh(skin, mesh)
        path = getattr(arguments, "reference", None)
        if path is not None:
            base = opened(path, arguments.zone)
            if not has_cells_of(mesh, (base.path, base.zone)):
                raise MeshError(
                    f"{path} cannot be the reference of {skin.name}: it must have the same cells; "
                    "give the undeformed mesh"
                )
            found = StreamedMesh(skin, mesh, base, path)
        elif case is not None and case.mesh_file is not None and case.mesh_file.is_file():
            base = opened(case.mesh_file, arguments.zone or case.zone, case.mesh_format)
            if has_cells_of(mesh, (base.path, base.zone)):
                found = StreamedMesh(skin, mesh, base, case.mesh_file)
        yield found


@contextmanager
def streamed_quality(
    arguments: argparse.Namespace, case: Case | None = None
) -> Iterator[tuple[Mesh, MeshQuality, Path | None]]:
    """Context with the skin of a mesh, quality and counts of all cells, and the reference's file.

    Raises
    ------
    MeshError
        As by `open_streamed`.
    """
    from slideviz.cli.progress import Bar
    from slideviz.solver.steps import Progress
    from slideviz.streaming.quality_blocks import measure_mesh

    with ExitStack() as stack:
        seen = stack.enter_context(open_streamed(arguments, case))
        with Bar() as bar:
            whole = measure_mesh(
                stack,
                Path(tempfile.gettempdir()),
                seen.mesh,
                seen.base_zone,
                metric=getattr(arguments, "metric", "knupp"),
                tick=lambda part: bar.phase(Progress(1, 1, "quality", part)),
            )
        yield seen.skin, whole, seen.reference


def require_no_file(arguments: argparse.Namespace) -> None:
    """Raise CaseError where ``-o`` is given with ``--stream``: writing needs the whole mesh."""
    from slideviz.errors import CaseError

    if arguments.output is not None:
        raise CaseError("-o needs the mesh in memory; leave it out, or --stream")
