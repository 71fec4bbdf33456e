"""``--stream`` of the commands that look at a mesh: it is read block by block."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.deformation.rated import Whole, Zone
    from slideviz.mesh.model import Mesh


@contextmanager
def rated(
    arguments: argparse.Namespace, case: Case | None = None
) -> Iterator[tuple[Mesh, Whole, Path | None]]:
    """Return the skin of a mesh, what all its cells gave, and the file of the reference.

    Raises
    ------
    MeshError
        It is no SU2 binary mesh, or has a mistake, or the reference has other cells.
    """
    from slideviz.cli.progress import Bar
    from slideviz.deformation.rated import rated_whole
    from slideviz.deformation.steps import Progress
    from slideviz.deformation.streaming import require_binary
    from slideviz.mesh.skin import read_skin

    mesh = arguments.mesh, arguments.zone
    require_binary(arguments.mesh)
    with ExitStack() as stack:
        with Bar() as bar:
            skin = read_skin(*mesh, lambda part: bar.phase(Progress(1, 1, "read", part)))
            reference = reference_file(arguments, skin, case)
            whole = rated_whole(
                stack,
                Path(tempfile.gettempdir()),
                mesh,
                reference,
                metric=getattr(arguments, "metric", "knupp"),
                tick=lambda part: bar.phase(Progress(1, 1, "quality", part)),
            )
        yield skin, whole, reference[0] if reference else None


def reference_file(arguments: argparse.Namespace, skin: Mesh, case: Case | None) -> Zone | None:
    """Return file and zone of the undeformed mesh, as `slideviz.cli.options.reference_of` does.

    Raises
    ------
    MeshError
        ``--reference`` has other cells, or it is no SU2 binary mesh.
    """
    from slideviz.deformation.rated import has_cells_of
    from slideviz.deformation.streaming import require_binary
    from slideviz.errors import MeshError

    mesh = arguments.mesh, skin.zone
    given = getattr(arguments, "reference", None)
    if given is not None:
        require_binary(given)
        if not has_cells_of(mesh, (given, arguments.zone)):
            raise MeshError(
                f"{given} cannot be the reference of {skin.name}: it must have the same cells; "
                "give the undeformed mesh"
            )
        return given, arguments.zone
    if case is None or case.mesh_file is None or not case.mesh_file.is_file():
        return None
    require_binary(case.mesh_file)
    zone = arguments.zone or case.zone
    return (case.mesh_file, zone) if has_cells_of(mesh, (case.mesh_file, zone)) else None


def require_no_file(arguments: argparse.Namespace) -> None:
    """Raise where all cells are to be written.

    Raises
    ------
    CaseError
        There is an ``-o``.
    """
    from slideviz.errors import CaseError

    if arguments.output is not None:
        raise CaseError("-o needs the mesh in memory; leave it out, or --stream")
