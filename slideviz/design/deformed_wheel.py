"""The whole wheel of a case: its deformed passages, turned, merged and written to one file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from slideviz.argument_types import check_types, record
from slideviz.case.limits import LimitResult, check_case_limits
from slideviz.case.model import Case
from slideviz.case.zone_cases import zone_cases
from slideviz.design.sweeps.table import Table, read_designs
from slideviz.errors import CaseError, MeshError, Remark, SlidevizError
from slideviz.formats.files import read
from slideviz.formats.table import ZoneContent, write_content
from slideviz.machine.wheel import Wheel
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import Assembly, CellRows, FloatArray, Mesh
from slideviz.mesh.periodic import Pair, pair_up
from slideviz.mesh.quality import Quality, quality
from slideviz.mesh.zones import unique_names, zones_of
from slideviz.solver.deform import deform
from slideviz.solver.steps import Progress, Report

Count = int | Literal["all"]
"""A number of passages: "all" for a whole turn."""


@record
class WheelQuality:
    """A wheel that was written, and the quality of its cells: that of its passages."""

    path: Path
    """The file."""
    passages: int
    """Their number."""
    is_closed: bool
    """Whether they make a whole turn."""
    period: float | None
    """The angle between them, in degrees; None where zones have different ones."""
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
    messages: tuple[Remark, ...] = ()
    """What the runs of the passages warn of."""
    zones: tuple[WheelQuality, ...] = ()
    """The wheel of each zone, with the names of its file, where the mesh has several."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """The texts of ``messages``."""
        return tuple(map(str, self.messages))


@check_types
def wheel(
    path: str | Path,
    case: Case,
    mesh: Mesh | None = None,
    *,
    passages: Count | Sequence[Count] = "all",
    numbered: bool = False,
    designs: Table | None = None,
    progress: Report | None = None,
) -> WheelQuality:
    """Deform a passage, and write the wheel that its copies make; return its quality.

    The periodic boundaries of the case, images by a rotation, are where passages meet: their nodes
    are merged. A part of a wheel keeps the two outer ones. Of several zones each has a wheel with
    its own period, and they are the zones of the file.

    Parameters
    ----------
    path : str or Path
        The file: SU2 text or binary.
    case : Case
        What is deformed and how; without motions the passages are the undeformed mesh.
    mesh : Mesh, optional
        The undeformed passage; read from the case's file when left out.
    passages : int or "all", or a sequence of these
        Their number; "all" for a whole turn. Of several zones one number for all, or one for each.
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
        The case has no periodic boundaries that are turned images, their angle is not a whole part
        of a turn, passages do not meet, or one cannot be deformed.

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
    counts = [count for *_, count in _repeated(case, mesh, passages)]
    rows = read_designs(case, designs).rows if designs is not None else ()
    if len(rows) > max(counts):
        raise CaseError(
            f"the table has {len(rows)} rows for {max(counts)} passages; give at most one row for "
            "each"
        )
    _require_passages(case, mesh, [row.case for row in rows], counts)
    cases = [row.case for row in rows]
    if len(rows) < max(counts):
        cases.append(case)
    points = []
    messages = list[Remark]()
    for each in cases:
        points.append(mesh.points)
        if each.motions:
            *_, last = deform(each, mesh, progress)
            points[-1] = last.mesh.points
            messages += last.messages
    made = write_wheel(Path(path), cases, mesh, points, counts, numbered, progress)
    return replace(made, messages=tuple(dict.fromkeys(messages)))


def _require_passages(case: Case, mesh: Mesh, rows: Sequence[Case], counts: Sequence[int]) -> None:
    """Raise CaseError if a row of a table moves a passage that a zone does not have."""
    moved = [[zone.motions for zone in zone_cases(each, mesh, False)] for each in (case, *rows)]
    for zone, count in enumerate(counts):
        for number, motions in enumerate(moved[1 + count :], count + 1):
            if motions[zone] != moved[0][zone]:
                raise CaseError(
                    f"row {number} of the table moves zone {zone + 1}, which has {count} passages "
                    f"only; let zone {zone + 1} move there as in the case"
                )


@contextmanager
def _in_zone(mesh: Mesh, index: int) -> Iterator[None]:
    """Let errors begin with the number of the zone, if the mesh has several."""
    try:
        yield
    except SlidevizError as problem:
        if isinstance(mesh, Assembly):
            problem.args = problem.within(f"zone {index + 1}")
        raise


def _repeated(
    case: Case, mesh: Mesh, passages: Count | Sequence[Count]
) -> list[tuple[Mesh, tuple[Pair, ...], int]]:
    """Return the passage of each zone without halo, its periodic sides, and how many it has."""
    cases = zone_cases(case, mesh, False)
    zones = zones_of(mesh)
    each = [passages] * len(zones) if isinstance(passages, int | str) else passages
    if len(each) != len(zones):
        raise CaseError(
            f"{len(each)} numbers of passages for {len(zones)} zones; give one for all, or one for "
            "each"
        )
    out = []
    for index, (one, zone, count) in enumerate(zip(cases, zones, each, strict=True)):
        with _in_zone(mesh, index):
            out.append(_repeated_zone(one, zone, count))
    return out


def _repeated_zone(case: Case, mesh: Mesh, passages: Count) -> tuple[Mesh, tuple[Pair, ...], int]:
    names = case.markers_with("periodic")
    if not names:
        raise CaseError("the case has no periodic boundaries; passages are merged at these")
    base = without_halo(mesh)[0]
    known = [name for name in names if len(base.marker(name).cells)]  # halos have none
    shift = None
    with suppress(MeshError):
        shift = pair_up(base, known, "translational")[0].describe()
    try:
        pairs = pair_up(base, known, "rotational", case.axis, case.origin)
    except MeshError:
        if shift is None:
            raise
        raise CaseError(
            f"{mesh.name}: its periodic boundaries are images by a translation ({shift}), so "
            "there is no wheel; a wheel needs passages that are turned about an axis"
        ) from None
    if shift is not None and case.periodic_type != "rotational":
        raise CaseError(
            f"{mesh.name}: its periodic boundaries are images by a translation ({shift}) and by a "
            f"rotation ({pairs[0].describe()}), and PERIODIC_TYPE= {case.periodic_type.upper()} "
            "takes the translation; a wheel needs PERIODIC_TYPE= ROTATIONAL"
        )
    period = Wheel((base,), pairs).period
    count = round(2.0 * np.pi / period) if passages == "all" else passages
    if passages == "all" and abs(count * period - 2.0 * np.pi) > 1e-9:
        raise CaseError(
            f"the period is {np.degrees(period):.6g}°, and 360° is not a multiple of it; give the "
            "number of passages"
        )
    most = int(2.0 * np.pi / period + 1e-9)
    if count > most:
        raise CaseError(
            f"{mesh.name}: {count} passages of {np.degrees(period):.6g}° are more than a turn; use "
            f"{most} or fewer"
        )
    if count < 1:
        raise CaseError(f"{count} passages; expected 1 or more, or all")
    return base, pairs, count


def write_wheel(
    path: Path,
    cases: Sequence[Case],
    mesh: Mesh,
    points: Sequence[FloatArray],
    passages: Count | Sequence[Count],
    numbered: bool,
    progress: Report | None,
) -> WheelQuality:
    """Write the wheel of deformed passages; parameters and errors as `wheel`.

    ``cases`` and ``points`` (n, d) of passages, one after the other; those of the last one are
    repeated.
    """
    moved = [mesh.with_points(each) for each in points]
    measured = [quality(each, mesh, cases[0].quality_metric) for each in moved]
    limits = [
        result
        for case, rated, each in zip(cases, measured, moved, strict=True)
        for result in check_case_limits(case, rated, each, mesh)
    ]
    contents = []
    zones = []
    first = 0
    for index, (base, pairs, count) in enumerate(_repeated(cases[-1], mesh, passages)):
        copies = [base.with_points(zones_of(each)[index].points) for each in moved]
        size = len(zones_of(mesh)[index].cells)
        rated = [each.take(np.arange(first, first + size)) for each in measured]
        # Of ``end`` all further passages are copies.
        end = len(cases) - 1
        first = first + size
        wheel = Wheel([copies[min(k, end)] for k in range(count)], pairs, numbered)
        with _in_zone(mesh, index):
            contents.append(wheel.content())
            zones.append(_zone_wheel(path, wheel, [rated[min(k, end)] for k in range(count)]))
    _write(path, contents, progress or (lambda _: None))
    return replace(_together(zones), limits=tuple(limits))


def _zone_wheel(path: Path, wheel: Wheel, rated: Sequence[Quality]) -> WheelQuality:
    """Return the numbers of the wheel of a zone with the quality of its passages."""
    return WheelQuality(
        path=path,
        passages=len(rated),
        is_closed=wheel.is_closed,
        period=float(np.degrees(wheel.period)),
        cells=wheel.n_cells,
        points=wheel.n_points,
        boundaries=tuple(marker.name for marker in wheel.markers()),
        min=min(one.min for one in rated),
        mean=float(np.mean([one.mean for one in rated])),
        inverted=sum(one.inverted for one in rated),
        unproven=sum(one.unproven for one in rated),
        gap=wheel.require_meeting(),
    )


def _together(zones: Sequence[WheelQuality]) -> WheelQuality:
    """Return the wheels of all zones as one."""
    if len(zones) == 1:
        return zones[0]
    periods = {zone.period for zone in zones}
    names = unique_names([zone.boundaries for zone in zones])
    return WheelQuality(
        path=zones[0].path,
        passages=sum(zone.passages for zone in zones),
        is_closed=all(zone.is_closed for zone in zones),
        period=periods.pop() if len(periods) == 1 else None,
        cells=sum(zone.cells for zone in zones),
        points=sum(zone.points for zone in zones),
        boundaries=tuple(name for some in names for name in some),
        min=min(zone.min for zone in zones),
        mean=float(np.average([zone.mean for zone in zones], weights=[z.cells for z in zones])),
        inverted=sum(zone.inverted for zone in zones),
        unproven=sum(zone.unproven for zone in zones),
        gap=max(zone.gap for zone in zones),
        zones=tuple(zones),
    )


def _write(path: Path, contents: Sequence[ZoneContent], progress: Report) -> None:
    """Write the wheels of zones, and call ``progress`` after each block."""
    total = sum(each.n_cells + each.n_points for each in contents)
    done = 0

    def counted(content: ZoneContent) -> ZoneContent:
        def points(i: int, j: int) -> FloatArray:
            nonlocal done
            done += j - i
            return content.points(i, j)

        def cells(i: int, j: int) -> CellRows:
            nonlocal done
            done += j - i
            return content.cells(i, j)

        return replace(content, points=points, cells=cells)

    def going_on() -> None:
        progress(Progress(1, 1, "write", done / total))

    write_content(path, [counted(each) for each in contents], going_on=going_on)
