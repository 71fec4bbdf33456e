"""Limits on numbers of a deformed mesh, as ``min > 0.3``: their text, and the cells that fail them.

A limit is ``NAME > VALUE``, with ``>``, ``>=``, ``<``, ``<=`` or ``=``. ``NAME`` is a row of
`NUMBERS`. A number that each cell has must be within the limit in every cell.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slideviz.argument_types import CheckedFields, check_types, frozen, record
from slideviz.case.values import Kind
from slideviz.case.words import first_of, name_text, number
from slideviz.errors import CaseError, Message, Remark, nearest, not_one_of, raise_all, shown
from slideviz.mesh.metrics import metric
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.quality import INVERTED, PIECE, UNPROVEN, Quality
from slideviz.mesh.quality import quality as quality_of
from slideviz.mesh.quality_derivative import cell_margins
from slideviz.mesh.walls import CHANGES, LAYERS, walls
from slideviz.terms import METRICS, SIZE_SKEW, Metric, SkewMetric, field_of

if TYPE_CHECKING:
    from slideviz.case.model import Case

OPERATORS: Mapping[str, Callable[[Any, Any], Any]] = {
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
    "=": operator.eq,
}
_LIMIT = re.compile(
    r'(?P<name>[\w-]+)(?:@(?:"(?P<quoted>(?:[^"]|"")+)"|(?P<plain>[^\s<>="]+)))?'
    r"\s*(?P<sign>[<>=]+)\s*(?P<value>\S+)\Z"
)
MOST_CELLS = 1e12  # more than any mesh has
_ITEM = re.compile(r'(?:"[^"]*"|[^",;])+')


@record
class MeasuredMesh:
    """A deformed mesh with its quality, whose limits are checked."""

    quality: Quality
    mesh: Mesh | None = None
    reference: Mesh | None = None
    """`mesh`, `reference`: the mesh, and the undeformed one; None where they are in files."""
    boundaries: Sequence[str] | None = None
    """Those of which walls are measured where a limit names none, if they have layers; None: all
    with layers."""


class Values(NamedTuple):
    """The values of a number in cells."""

    values: FloatArray  # (k,): NaN where a cell has none
    cells: IntArray | None = None  # (k,): the numbers of the cells; None: all
    boundary: IntArray | None = None
    """(k,): the place in `names` of the boundary that a value belongs to; None: to none."""
    names: Sequence[str] = ()


@frozen
class LimitNumber:
    """A number that can be limited: of the whole mesh (``total``), of each cell, or both."""

    meaning: str
    signs: str  # the first characters of the operators that make sense
    values: Callable[[MeasuredMesh, str], Values] | None = None
    """Returns the values of cells; the text is the boundary after ``@``, or "" for all."""
    total: Callable[[Quality], float] | None = None  # returns the number of the whole mesh
    status: int | None = None  # the status of the cells that ``total`` counts
    on_boundary: bool = False
    """Whether it is measured at boundaries, so that one can be named after ``@``."""
    streamed: bool = False  # whether it is known of a mesh in a file
    compares: bool = False
    """Whether it compares with the undeformed mesh, and has no value without it."""
    range: tuple[float, float] = (-inf, inf)  # its values, but those of folded cells
    counts: bool = False  # whether it is a whole number


def _of_quality(name: str) -> Callable[[MeasuredMesh, str], Values]:
    return lambda measured, _: Values(getattr(measured.quality, name))


def _of_metric(name: Metric) -> Callable[[MeasuredMesh, str], Values]:
    if name in SIZE_SKEW:
        return _of_quality({"size-skew": "values"}.get(name, name))

    def values(measured: MeasuredMesh, _: str) -> Values:
        assert measured.mesh is not None
        return Values(metric(measured.mesh, name, measured.reference).of_cells)

    return values


def _margins(measured: MeasuredMesh, _: str) -> Values:
    mesh = measured.mesh
    assert mesh is not None
    assert measured.reference is not None
    margins = cell_margins(mesh, measured.reference)
    return Values(margins, mesh.first_parts(np.arange(len(margins))))


def _of_walls(name: str) -> Callable[[MeasuredMesh, str], Values]:
    """Return the function of a number of `slideviz.mesh.walls`: at the corners of facets."""

    def values(measured: MeasuredMesh, marker: str) -> Values:
        assert measured.mesh is not None
        names = (marker,) if marker else measured.boundaries
        found = walls(measured.mesh, measured.reference, names)
        boundary = found.columns.boundary
        corner = found.columns.corner
        wanted = [one for one in found.markers if marker or one in found.layered]
        some = np.isin(boundary.marker, [boundary.names.index(one) for one in wanted])
        width = corner.shape[1]
        cells = np.repeat(measured.mesh.first_parts(boundary.owner[some]), width)
        at = np.repeat(boundary.marker[some], width)
        return Values(found.values[name][corner[some].ravel()], cells, at, boundary.names)

    return values


def _wall(name: str, meaning: str, signs: str, low: float = 0.0, high: float = inf) -> LimitNumber:
    row = LimitNumber(meaning, signs, _of_walls(name), on_boundary=True, range=(low, high))
    return replace(row, compares=name in CHANGES, counts=name == "equal_layers")


def _count(meaning: str, total: Callable[[Quality], float], status: int) -> LimitNumber:
    return LimitNumber(
        meaning, "<=", None, total, status, streamed=True, range=(0.0, MOST_CELLS), counts=True
    )


NUMBERS: Mapping[str, LimitNumber] = {
    "min": LimitNumber(
        "lowest quality",
        ">",
        _of_quality("values"),
        total=lambda q: q.min,
        streamed=True,
        range=(0.0, 1.0),
    ),
    "mean": LimitNumber(
        "mean quality", ">", total=lambda q: q.mean, streamed=True, range=(0.0, 1.0)
    ),
    "inverted": _count("inverted cells", lambda q: q.inverted, INVERTED),
    "unproven": _count(
        "cells neither proved valid nor found inverted", lambda q: q.unproven, UNPROVEN
    ),
    "margin": LimitNumber(
        "least coefficient of a cell's Jacobian over that before; 0 folds",
        ">",
        _margins,
        compares=True,
    ),
    "first_height": _wall("first_height", "distance of the first node from its wall", "<>"),
    "height_ratio": _wall("height_ratio", "first height over that before", "<>"),
    "growth": _wall("growth", "ratio of successive layers", "<", 1.0),
    "equal_layers": _wall(
        "equal_layers", "first layers of equal height, up to five", ">", high=LAYERS
    ),
    "wall_angle": _wall(
        "wall_angle", "between first edge and wall in degrees, 90 best", ">", -90.0, 90.0
    ),
    "angle_change": _wall("angle_change", "change of that angle in degrees", "<", high=180.0),
    **{
        field_of(name): LimitNumber(
            f"{term.label} {term.unit}".strip(),
            "<>"[term.best == "high"],
            _of_metric(name),
            range=term.range,
            compares=term.compares,
        )
        for name, term in METRICS.items()
    },
}
"""The numbers that can be limited, by name: totals, those of `slideviz.mesh.walls`, measured at the
boundary after @ or at all with layers, and all metrics."""


@frozen
class Limit(CheckedFields):
    """A limit on a number of a deformed mesh, such as ``Limit("min", ">", 0.3)``.

    ``slideviz keys`` lists the names at LIMITS. ``sign`` is ``>``, ``>=``, ``<``, ``<=`` or ``=``.
    A number of walls can be limited at the boundary ``marker`` alone.
    """

    name: str
    sign: str
    value: float
    marker: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        row = NUMBERS.get(self.name)
        if row is None:
            likely = nearest(self.name, NUMBERS)
            if likely:
                raise CaseError(
                    f"LIMITS has no number {shown(self.name)}{likely} (`slideviz keys` lists all)"
                )
            raise CaseError(not_one_of(self.name, NUMBERS))
        if self.sign not in OPERATORS:
            raise CaseError(f"{self}: {not_one_of(self.sign, OPERATORS)}")
        if self.sign[0] not in row.signs:
            signs = " or ".join(row.signs)
            raise CaseError(f"{self}: a limit of {self.name} ({row.meaning}) needs {signs}")
        if self.marker and not row.on_boundary:
            raise CaseError(f"{self}: {self.name} is of the whole mesh; leave out @{self.marker}")
        if not np.isfinite(self.value):
            raise CaseError(f"{self}: expected a finite number as the limit")
        low, high = row.range
        # The end that nothing passes, or everything; folded layers have first heights below 0.
        lowest = low if row.signs == ">" else -inf
        end = {"<": low, ">": high, "<=": high, ">=": lowest}.get(self.sign)
        fits = low <= self.value <= high and self.value != end
        if not fits or (row.counts and not float(self.value).is_integer()):
            below = "below " if end == high else ""
            upper = f" to {below}{high:g}" if high < inf else ""
            raise CaseError(
                f"{self}: expected a {'whole number' if row.counts else 'number'} "
                f"{'above' if end == low else 'from'} {low:g}{upper} for {self.name} "
                f"({row.meaning})"
            )

    def __str__(self) -> str:
        place = f"@{name_text(self.marker)}" if self.marker else ""
        return f"{self.name}{place} {self.sign} {repr(float(self.value)).removesuffix('.0')}"

    def holds(self, values: Any) -> Any:
        """Return whether values, or each of an array, are within the limit; NaN is not."""
        return OPERATORS[self.sign](values, self.value)


@record
class LimitResult:
    """Whether a mesh meets a limit."""

    limit: Limit
    actual: float
    """The number; of one of each cell, the value farthest beyond the limit, or nearest to it. NaN
    where no cell has a value."""
    cells: IntArray  # (k,): the cells that fail, the worst first; none for a mean
    boundaries: tuple[str, ...] = ()
    """Of a number of walls, the boundaries where it fails, the worst first; where no cell has a
    value, all that were to have one."""

    @property
    def passed(self) -> bool:
        """Return whether the limit is met; it is not where no cell has a value."""
        return bool(self.limit.holds(self.actual))

    @property
    def value_words(self) -> str:
        """Return the number as text; "infinite", or why there is none."""
        return value_words(self.actual, len(self.cells), self.boundaries)


def value_words(actual: float | None, failing: int, boundaries: Sequence[str]) -> str:
    """Return the number of a limit as text: ``failing`` cells and ``boundaries`` where it fails."""
    if actual is not None and np.isfinite(actual):
        return f"{actual:.6g}"
    if failing:
        return "infinite"
    return f"no boundary layers at {first_of(boundaries)}" if boundaries else "no value"


@check_types
def quality(
    mesh: Mesh,
    reference: Mesh | None = None,
    metric: SkewMetric = "knupp",
    going_on: Callable[[], object] = lambda: None,
    *,
    derivative: bool = False,
    p: float = 50.0,
    limits: Sequence[Limit] | str = (),
) -> Quality:
    """Return the quality of each cell, compared with the undeformed mesh.

    Parameters
    ----------
    mesh : Mesh
        The deformed mesh.
    reference : Mesh, optional
        The undeformed mesh, with the same cells; without it ``size`` is 1 for all cells that are
        not inverted. The signs of the cells are found from it, too.
    metric : {"knupp", "rbf-slide"}
        See `Quality`.
    going_on : callable
        Called every few thousand cells; what it raises ends the work.
    derivative : bool
        Find the derivatives of minimum and mean by the points too (`QualityDerivative`), for an
        optimiser. Give the undeformed mesh then: without it a mesh that is wholly inverted is taken
        for one numbered the other way round.
    p : float
        The exponent of the smooth minimum that is differentiated, at least 1: higher is closer to
        the minimum, and less smooth.
    limits : sequence of Limit, or str
        Limits on numbers of the mesh, or a text as ``min > 0.3, inverted = 0``; whether it meets
        each of them is in `Quality.limits`.

    Raises
    ------
    MeshError
        The mesh has no cells or unusable ones, coordinates too large, or the reference is another
        mesh. With ``derivative`` also: a point is not finite, or the reference has cells without a
        positive volume.
    CaseError
        The metric is unknown, the exponent below 1, or a limit is wrong, or compares with the
        undeformed mesh and there is no reference.

    Examples
    --------
    A square, and the same with a corner drawn in to its centre and beyond:

    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> sv.quality(square).min
    1.0
    >>> folded = square.with_points([[0, 0], [1, 0], [0.4, 0.4], [0, 1]])
    >>> found = sv.quality(folded, reference=square, limits="inverted = 0, skewness < 4")
    >>> found.inverted
    1
    >>> [(str(one.limit), one.passed) for one in found.limits]
    [('inverted = 0', False), ('skewness < 4', True)]

    The way that the drawn corner must go for the minimum to rise:

    >>> slope = sv.quality(folded, reference=square, derivative=True).derivative
    >>> slope.of_minimum[2] > 0
    array([ True,  True])
    """
    wanted = read_limits(limits) if isinstance(limits, str) else limits
    rated = quality_of(mesh, reference, metric, going_on, derivative=derivative, p=p)
    if not wanted:
        return rated
    return replace(rated, limits=check_limits(wanted, MeasuredMesh(rated, mesh, reference)))


def check_limits(limits: Sequence[Limit], measured: MeasuredMesh) -> tuple[LimitResult, ...]:
    """Return for each limit whether a mesh meets it.

    Raises CaseError for a limit on a number that compares with the undeformed mesh where there is
    none, and for one at a boundary that is not a wall.
    """
    problems = list[Remark]()
    if measured.boundaries is not None:
        problems += not_walls(limits, measured.boundaries)
    if measured.reference is None and measured.mesh is not None:
        problems += [
            f"LIMITS: {limit} compares with the undeformed mesh; give it (--reference UNDEFORMED)"
            for limit in limits
            if NUMBERS[limit.name].compares
        ]
    raise_all(problems)
    return tuple(_result(limit, measured) for limit in limits)


def not_walls(limits: Iterable[Limit], walls: Sequence[str]) -> list[Message]:
    """Return a message for each limit at a boundary that is none of the ``walls``."""
    named = ", ".join(walls) or "none: all boundaries are periodic or internal"
    return [
        Message(
            f"{limit}: {limit.marker} is periodic or internal, so it has no wall layers",
            f"walls are {named}",
            place=("LIMITS",),
        )
        for limit in limits
        if limit.marker and limit.marker not in walls
    ]


def check_case_limits(
    case: Case, quality: Quality, mesh: Mesh, reference: Mesh
) -> tuple[LimitResult, ...]:
    """Return for each limit of a case whether its deformed mesh meets it."""
    names = case.walls(mesh.marker_names)
    return check_limits(case.limits, MeasuredMesh(quality, mesh, reference, names))


def rated_limits(case: Case, reference: Mesh, mesh: Mesh) -> tuple[LimitResult, ...]:
    """Return `check_case_limits` of a mesh whose quality is not known."""
    rated = quality_of(mesh, reference, case.quality_metric)
    return check_case_limits(case, rated, mesh, reference)


MET = "met"  # what `outcome` returns where all limits are met


def outcome(results: Sequence[LimitResult]) -> str:
    """Return a cell of a table: `MET`, or as ``min > 0.3: 0.21; inverted = 0: 5``; "" if none."""
    missed = [f"{one.limit}: {one.value_words}" for one in results if not one.passed]
    if missed:
        return "; ".join(missed)
    return MET if results else ""


def _result(limit: Limit, measured: MeasuredMesh) -> LimitResult:
    row = NUMBERS[limit.name]
    quality = measured.quality
    actual = np.nan
    total = row.total is not None
    if row.total is not None:
        actual = float(row.total(quality))
        if row.values is None:
            cells = np.empty(0, np.int64)
            if row.status is not None and not limit.holds(actual):
                cells = quality.cells_with(row.status)
            return LimitResult(limit, actual, cells)
    assert row.values is not None
    values, ids, boundary, names = row.values(measured, limit.marker)
    low = limit.sign[0] == ">"
    failing = [np.empty(0, np.int64)]
    by_how_much = [np.empty(0)]
    places = [np.empty(0, np.int64)]
    for first in range(0, len(values), PIECE):  # they may be in a file, and not fit into memory
        some = values[first : first + PIECE]
        cells = np.arange(first, first + len(some)) if ids is None else ids[first : first + PIECE]
        counts = ~np.isnan(some) & (True if quality.copies is None else ~quality.copies[cells])
        if counts.any() and not total:
            worst = some[counts].min() if low else some[counts].max()
            actual = float(np.fmin(actual, worst) if low else np.fmax(actual, worst))
        bad = counts & ~limit.holds(some)
        failing.append(cells[bad])
        by_how_much.append(some[bad] if low else -some[bad])
        if boundary is not None:
            places.append(boundary[first : first + PIECE][bad])
    order = np.argsort(np.concatenate(by_how_much), kind="stable")
    found = np.concatenate(failing)[order]
    at = [] if boundary is None else np.concatenate(places)[order].tolist()
    first_of = np.sort(np.unique(found, return_index=True)[1])  # a cell may have several walls
    fails_at = tuple(names[k] for k in dict.fromkeys(at))
    if row.on_boundary and np.isnan(actual):
        fails_at = (limit.marker,) if limit.marker else tuple(measured.boundaries or names)
    return LimitResult(limit, actual, found[first_of], fails_at)


def require_streamed(limits: Iterable[Limit]) -> None:
    """Raise CaseError for a limit on a number that is not known of a mesh in a file."""
    for limit in limits:
        if not NUMBERS[limit.name].streamed:
            known = ", ".join(name for name, row in NUMBERS.items() if row.streamed)
            raise CaseError(
                f"LIMITS: {limit} needs the mesh in memory, for a streamed run measures only "
                f"{known}; leave this limit out, or --stream"
            )


def read_limits(text: str) -> tuple[Limit, ...]:
    """Return the limits of ``( min > 0.3, inverted = 0 )``; () for ``( )`` or NONE."""
    inside = text.strip()
    if inside.count('"') % 2:
        raise CaseError(f"the quotation mark in {shown(text)} is not closed; close it")
    if inside.startswith("(") != inside.endswith(")"):
        raise CaseError(f"a bracket of {shown(text)} is missing; write ( min > 0.3, inverted = 0 )")
    inside = inside.removeprefix("(").removesuffix(")").strip()
    if not inside or inside.upper() == "NONE":
        return ()
    limits = []
    problems = list[Message]()
    for item in _ITEM.findall(inside):
        try:
            limits.append(_read_limit(item.strip()))
        except CaseError as problem:
            problems += problem.messages
    raise_all(problems)
    return tuple(limits)


def _read_limit(text: str) -> Limit:
    match = _LIMIT.match(text)
    if match is None:
        raise CaseError(
            f"{shown(text)}: cannot read this limit; write e.g. min > 0.3, and separate limits by "
            "commas"
        )
    quoted = match["quoted"]
    marker = match["plain"] or "" if quoted is None else quoted.replace('""', '"')
    return Limit(field_of(match["name"]).lower(), match["sign"], number(match["value"]), marker)


def write_limits(limits: tuple[Limit, ...]) -> str:
    """Return the text of limits, which `read_limits` reads back without loss."""
    return f"( {', '.join(map(str, limits))} )" if limits else "( )"


LIMITS = Kind(
    "( NAME > NUMBER, ... ), also with >=, <, <=, =",
    read_limits,
    write_limits,
    details=tuple(f"{name:<20}{row.meaning}" for name, row in NUMBERS.items()),
)
