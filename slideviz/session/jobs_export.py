"""Long jobs that write exports: quality as a table, the meshes of all steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from slideviz.errors import SlidevizError
from slideviz.formats.vtkhdf import VTKHDF, vtkhdf_series
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.session.jobs import (
    JobProgress,
    Report,
    Stopped,
    cell_values,
    raise_if_cancelled,
    save_mesh,
)
from slideviz.session.state import StepFrame
from slideviz.system.atomic import atomic_write
from slideviz.terms import CELL_STATES

_ROWS = 5_000
"""Cells that are written before the job looks again whether it is to stop."""


def save_quality(path: Path, frame: StepFrame, report: Report, stopped: Stopped) -> Path:
    """Write a CSV file with number, type, qualities, status and middle of every cell.

    Raises
    ------
    SlidevizError
        The file cannot be written.
    """
    mesh, found = frame.mesh, frame.quality
    middles = centroids(mesh)
    axes = ",".join("xyz"[: mesh.dim])
    names = {vtk: ELEMENTS[vtk].name for vtk in mesh.cells.by_type}
    with atomic_write(path, SlidevizError) as file:
        file.write(f"cell,type,size,skew,size_skew,status,{axes}\n".encode())
        for start in range(0, len(found), _ROWS):
            raise_if_cancelled(stopped)
            report(JobProgress(f"Writing {path.name}", start / len(found)))
            part = slice(start, start + _ROWS)
            rows = zip(
                mesh.cells.types[part].tolist(),
                found.size[part].tolist(),
                found.skew[part].tolist(),
                found.values[part].tolist(),
                found.status[part].tolist(),
                middles[part].tolist(),
                strict=True,
            )
            lines = [
                f"{cell},{names[kind]},{size!r},{skew!r},{value!r},{CELL_STATES[status]},"
                + ",".join(map(repr, middle))
                for cell, (kind, size, skew, value, status, middle) in enumerate(rows, start)
            ]
            file.write(("\n".join(lines) + "\n").encode())
    return path


def centroids(mesh: Mesh) -> FloatArray:
    """Return the mean of the nodes of each cell, (m, d)."""
    offsets = mesh.cells.offsets
    total = np.add.reduceat(mesh.points[mesh.cells.connectivity], offsets[:-1], axis=0)
    return np.asarray(total / np.diff(offsets)[:, None])


def step_paths(path: Path, count: int) -> list[Path]:
    """Return the files of ``count`` steps: the name of ``path`` with a number before its ending.

    Only ``path`` for VTKHDF, where all steps are in one file.
    """
    if path.suffix.lower() == VTKHDF:
        return [path]
    width = len(str(count))
    return [path.with_name(f"{path.stem}_{k:0{width}d}{path.suffix}") for k in range(1, count + 1)]


def save_steps(
    path: Path,
    frames: Sequence[StepFrame],
    report: Report,
    stopped: Stopped,
    first: StepFrame | None = None,
) -> list[Path]:
    """Write the mesh of every step, whole files only, and return their paths.

    A VTKHDF file has all steps, and before them the undeformed mesh ``first``.

    Parameters
    ----------
    path : Path
        The name to put numbers into (see `step_paths`).
    frames : sequence of StepFrame
        The steps, without the undeformed mesh.

    Raises
    ------
    SlidevizError
        A file cannot be written; those before it stay.
    """
    paths = step_paths(path, len(frames))
    if path.suffix.lower() == VTKHDF:
        _save_series(path, [*([first] if first else []), *frames], report, stopped)
        return paths
    for k, (target, frame) in enumerate(zip(paths, frames, strict=True)):
        raise_if_cancelled(stopped)
        report(JobProgress(f"Writing {target.name}", k / len(frames)))
        save_mesh(target, frame, False, lambda _: None, stopped)
    return paths


def _save_series(path: Path, frames: Sequence[StepFrame], report: Report, stopped: Stopped) -> None:
    """Write all frames into one VTKHDF file, with quality, and displacement from the first one."""
    start = frames[0].mesh
    with vtkhdf_series(path, start) as series:
        for k, frame in enumerate(frames):
            raise_if_cancelled(stopped)
            report(JobProgress(f"Writing {path.name}", k / len(frames)))
            moved = {"displacement": frame.mesh.points - start.points}
            series.add(frame.mesh.points, cell_values(frame), moved)
