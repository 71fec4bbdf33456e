"""The whole wheel of a case: its deformed passages, turned, merged and written to one file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import check_types
from slideviz.case.limits import LimitResult, check_case_limits
from slideviz.case.model import Case
from slideviz.design.sweeps.table import Table, read_designs
from slideviz.errors import CaseError, MeshError
from slideviz.formats.files import read
from slideviz.formats.table import ZoneContent, write_content
from slideviz.machine.wheel import Wheel
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import Pair, pair_up
from slideviz.mesh.quality import quality
from slideviz.mesh.zones import require_one_zone
from slideviz.solver.deform import deform
from slideviz.solver.steps import Progress


@dataclass(frozen=True, eq=False)
class WheelQuality:
    """A wheel that was written, and the quality of its cells: that of its passages."""

    path: Path
    """The file."""
    passages: int
    """Their number."""
    is_closed: bool
    """Whether they make a whole turn."""
    period: float
    """The angle between them, in degrees."""
    cells: int
    points: int
    """`cells`, `points`: their numbers in the wheel."""
    boundaries: tuple[str, ...]
    min: float
    mean: float
    """`min`, `mean`: lowest and mean size-skew quality, against the undeformed passage."""
    inverted: int
    unproven: int
    """`inverted`, `unproven`: numbers of cells."""
    gap: float
    """Largest distance of nodes of neighboring passages that became one, in the mesh's unit."""
    limits: tuple[LimitResult, ...] = ()
    """The limits of the case, met or not, for each passage that moves in another way."""
    warnings: tuple[str, ...] = ()
    """What the runs of the passages warn of."""


@check_types
def wheel(
    path: str | Path,
    case: Case,
    mesh: Mesh | None = None,
    *,
    passages: int | Literal["all"] = "all",
    numbered: bool = False,
    designs: Table | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> WheelQuality:
    """Deform a passage, and write the wheel that its copies make; return its quality.

    The periodic boundaries of the case, images by a rotation, are where passages meet: their nodes
    are merged. A part of a wheel keeps the two outer ones.

    Parameters
    ----------
    path : str or Path
        The file: SU2 text or binary.
    case : Case
        What is deformed and how; without motions the passages are the undeformed mesh.
    mesh : Mesh, optional
        The undeformed passage; read from the case's file when left out.
    passages : int or "all"
        Their number; "all" for a whole turn.
    numbered : bool
        Whether each passage has boundaries of its own (``blade_1``, ``blade_2``), rather than one
        for all.
    designs : str, Path or table, optional
        A table as of `sweep`, a row for each passage from the first one on; the others move as the
        case says. Neighbors must agree where they meet: hold the sides by
        ``PERIODIC_MODE= none`` and ``SLIDING_MODE= none``.
    progress : callable, optional
        Called with each ``Progress``; an exception it raises ends the call.

    Raises
    ------
    CaseError, MeshError, DeformError
        The case has no periodic boundaries that are turned images, their angle is no whole part of
        a turn, passages do not meet, or one cannot be deformed.

    Examples
    --------
    A quarter of a ring of one cell:

    >>> import slideviz as sv
    >>> mesh = sv.Mesh(
    ...     [[1, 0], [2, 0], [0, 2], [0, 1]],
    ...     sv.Cells.from_blocks([(9, [[0, 1, 2, 3]])]),
    ...     (
    ...         sv.Marker("low", sv.Cells.from_blocks([(3, [[0, 1]])])),
    ...         sv.Marker("high", sv.Cells.from_blocks([(3, [[2, 3]])])),
    ...     ),
    ... )
    >>> case = sv.Case(roles={"low": "periodic", "high": "periodic"})
    >>> made = sv.wheel("wheel.su2", case, mesh)
    >>> made.passages, made.cells, made.points, made.is_closed
    (4, 4, 8, True)
    """
    if mesh is None:
        if case.mesh_file is None:
            raise CaseError("the case has no MESH_FILENAME; give the mesh")
        mesh = read(case.mesh_file, case.zone, file_format=case.mesh_format)
    *_, count = _repeated(case, mesh, passages)
    rows = read_designs(case, designs).rows if designs is not None else ()
    if len(rows) > count:
        raise CaseError(f"the table has {len(rows)} rows for {count} passages; one for each")
    cases = [*(row.case for row in rows), *[case] * (len(rows) < count)]
    points, warnings = [], list[str]()
    for each in cases:
        points.append(mesh.points)
        if each.motions:
            *_, last = deform(each, mesh, progress)
            points[-1] = last.mesh.points
            warnings += last.warnings
    made = write_wheel(Path(path), cases, mesh, points, count, numbered, progress)
    return replace(made, warnings=tuple(dict.fromkeys(warnings)))


def _repeated(
    case: Case, mesh: Mesh, passages: int | Literal["all"]
) -> tuple[Mesh, tuple[Pair, ...], int]:
    """Return the passage without halo, its periodic sides, and the number of its copies."""
    require_one_zone(mesh, "a wheel")
    names = case.markers_with("periodic")
    if not names:
        raise CaseError("the case has no periodic boundaries; passages are merged at these")
    base = without_halo(mesh)[0]
    known = [name for name in names if len(base.marker(name).cells)]  # halos have none
    try:
        pairs = pair_up(base, known, "rotational", case.axis, case.origin)
    except MeshError:
        with suppress(MeshError):
            shift = pair_up(base, known, "translational")[0].describe()
            raise CaseError(
                f"{mesh.name}: its periodic boundaries are images by a translation ({shift}), so "
                "there is no wheel; a wheel needs passages that are turned about an axis"
            ) from None
        raise
    period = Wheel((base,), pairs).period
    count = round(2.0 * np.pi / period) if passages == "all" else passages
    if passages == "all" and abs(count * period - 2.0 * np.pi) > 1e-9:
        raise CaseError(
            f"the period is {np.degrees(period):.6g}°, which is no whole part of a turn; give "
            "the number of passages"
        )
    if count < 1:
        raise CaseError(f"{count} passages; expected 1 or more, or all")
    return base, pairs, count


def write_wheel(
    path: Path,
    cases: Sequence[Case],
    mesh: Mesh,
    points: Sequence[FloatArray],
    passages: int | Literal["all"] = "all",
    numbered: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> WheelQuality:
    """Write the wheel of deformed passages; parameters and errors as `wheel`.

    ``cases`` and ``points`` (n, d) of passages, one after the other; those of the last one are
    repeated.
    """
    base, pairs, count = _repeated(cases[-1], mesh, passages)
    meshes, measured, limits = [], [], list[LimitResult]()
    for case, moved in zip(cases, points, strict=True):
        meshes.append(Mesh(moved, base.cells, base.markers, name=base.name))
        measured.append(quality(meshes[-1], base, case.quality_metric))
        limits += check_case_limits(case, measured[-1], meshes[-1], base)
    end = len(cases) - 1  # of which all further passages are copies
    whole = Wheel([meshes[min(k, end)] for k in range(count)], pairs, numbered)
    gap, content = whole.require_meeting(), whole.content()
    _write(path, content, progress or (lambda _: None))
    qualities = [measured[min(k, end)] for k in range(count)]
    return WheelQuality(
        path=path,
        passages=count,
        is_closed=whole.is_closed,
        period=float(np.degrees(whole.period)),
        cells=content.n_cells,
        points=content.n_points,
        boundaries=tuple(marker.name for marker in content.markers),
        min=min(one.min for one in qualities),
        mean=float(np.mean([one.mean for one in qualities])),
        inverted=sum(one.inverted for one in qualities),
        unproven=sum(one.unproven for one in qualities),
        gap=gap,
        limits=tuple(limits),
    )


def _write(path: Path, content: ZoneContent, progress: Callable[[Progress], None]) -> None:
    """Write a wheel, and call ``progress`` after each block."""
    done = 0.0

    def points(i: int, j: int) -> FloatArray:
        nonlocal done  # cells come before points, and take as long
        done = max(done, 0.5 + 0.5 * j / content.n_points)
        return content.points(i, j)

    def cells(i: int, j: int) -> tuple[NDArray[np.uint8], IntArray, IntArray]:
        nonlocal done
        done = max(done, 0.5 * j / content.n_cells)
        return content.cells(i, j)

    def going_on() -> None:
        progress(Progress(1, 1, "write", done))

    write_content(path, replace(content, points=points, cells=cells), going_on=going_on)
