"""``--steps-file`` of ``slideviz run``: all steps in one file for ParaView."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slideviz.mesh.model import Mesh
    from slideviz.terms import Metric


def require_series(path: Path) -> None:
    """Raise where the name of the file is not one that all steps can be in.

    Raises
    ------
    CaseError
        It does not end in ``.vtkhdf``.
    """
    from slideviz.errors import CaseError
    from slideviz.mesh.io.vtkhdf import VTKHDF

    if path.suffix.lower() != VTKHDF:
        raise CaseError(
            f"{path}: only {VTKHDF} files hold all steps; end the name of --steps-file with it, or "
            "use --steps-dir"
        )


@contextmanager
def steps_file(path: Path | None, mesh: Mesh, metric: Metric) -> Iterator[Callable[[Mesh], object]]:
    """Return what takes the mesh of each step, after the undeformed one; nothing without a file.

    Each step has the quality of its cells and the displacement of its points.

    Raises
    ------
    MeshError
        The file cannot be written; none is left.
    """
    from slideviz import quality
    from slideviz.cli.report import cell_data
    from slideviz.mesh.io.vtkhdf import vtkhdf_series

    if path is None:
        yield lambda _: None
        return
    with vtkhdf_series(path, mesh) as series:

        def add(now: Mesh) -> None:
            values = cell_data(path, quality(now, reference=mesh, metric=metric))
            series.add(now.points, values or {}, {"displacement": now.points - mesh.points})

        add(mesh)
        yield add
