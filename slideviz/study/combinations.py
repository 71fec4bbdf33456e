"""The comparison of methods: one case by several methods, periodic modes, numbers of steps.

What depends on the method and the periodic mode only (topology, classes of nodes, tracks) is
computed once for all numbers of steps. An impossible combination is a row with the reason; it
does not end the comparison.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from slideviz import terms
from slideviz.argument_types import frozen, record
from slideviz.case.check import check_case
from slideviz.case.limits import MET, check_case_limits, outcome
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.errors import Cancelled, why_failed
from slideviz.mesh.model import Assembly, FloatArray, Mesh, frozen_array
from slideviz.mesh.quality import Quality, quality
from slideviz.rbf.problem import Cycle
from slideviz.samples.table import sample
from slideviz.session.jit_warmup import warm_up
from slideviz.session.jobs import Job
from slideviz.solver.deform import deform
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import Setup, make_setup
from slideviz.solver.steps import Progress, Step
from slideviz.system import csv_table
from slideviz.system.grouping import grouped
from slideviz.terms import SLIDING, PeriodicMode

Value = str | int | float


@frozen
class StudyColumn:
    """A column of the table."""

    value: Callable[[Result], Value]  # returns the value of a result
    head: str = ""
    form: str = ""
    """`head`, `form`: head and format on a terminal; columns with an empty head are not shown
    there."""


COLUMNS: Mapping[str, StudyColumn] = {
    "steps_made": StudyColumn(lambda r: r.steps, "steps", "d"),  # which STEPS= auto chooses
    "min": StudyColumn(lambda r: r.quality.min, "min", ".6f"),
    "mean": StudyColumn(lambda r: r.quality.mean, "mean", ".6f"),
    "inverted": StudyColumn(lambda r: r.quality.inverted, "inverted", "d"),
    "unproven": StudyColumn(lambda r: r.quality.unproven),
    "control_nodes": StudyColumn(lambda r: r.control_nodes, "control nodes", "d"),
    "max_error": StudyColumn(lambda r: r.max_error, "max error", ".1e"),
    "condition": StudyColumn(lambda r: r.condition),
    "seconds": StudyColumn(lambda r: r.seconds, "seconds", ".3f"),
    "processor_seconds": StudyColumn(lambda r: r.processor_seconds),
}
"""The columns of ``compare.csv`` between `KEY_COLUMNS` and the last one, ``problem``."""

KEY_COLUMNS = ("method", "periodic", "steps")


def csv_text(rows: Sequence[CombinationRow]) -> str:
    """Return the table as CSV, with all digits; ``limits`` only if the case has some."""
    columns = dict(COLUMNS)
    if any(row.result is not None and row.result.limits for row in rows):
        columns["limits"] = StudyColumn(lambda r: r.limits)
    lines: list[list[object]] = [[*KEY_COLUMNS, *columns, "problem"]]
    for row in rows:
        tried = row.combination
        result = row.result
        values = [None if result is None else c.value(result) for c in columns.values()]
        lines.append([tried.method, tried.periodic, tried.steps or "auto", *values, row.problem])
    return csv_table.csv_text(lines)


def history_text(rows: Sequence[CombinationRow]) -> str:
    """Return the convergence of the greedy selections as CSV, a line for each cycle."""
    columns = ("step", "cycle", "level", "error", "control_nodes", "seconds")
    lines: list[list[object]] = [[*KEY_COLUMNS, *columns]]
    for row in rows:
        tried = row.combination
        for step, cycle in row.result.history if row.result else ():
            values = [getattr(cycle, name) for name in columns[1:]]
            lines.append([tried.method, tried.periodic, tried.steps or "auto", step, *values])
    return csv_table.csv_text(lines)


def terminal_head() -> str:
    """Return the line above the rows on a terminal."""
    shown = [_cell(column.head, column) for column in COLUMNS.values() if column.head]
    return "  ".join([f"{'method':<7} {'periodic':<8}", *shown])


def terminal_line(row: CombinationRow, given: list[str] | None = None) -> str:
    """Return a row for a terminal; the reason where there is no result.

    ``given`` are the reasons written so far, and a new one is appended: a reason is written once,
    and later as its number.
    """
    tried = row.combination
    begin = f"{tried.method:<7} {tried.periodic:<8}"
    if row.result is None:
        steps = _cell(str(tried.steps or "auto"), COLUMNS["steps_made"])
        return f"{begin}  {steps}  not possible {_reason(row.problem, given)}"
    shown = [
        _cell(format(column.value(row.result), column.form), column)
        for column in COLUMNS.values()
        if column.head
    ]
    missed = [] if row.result.limits in ("", MET) else [f"not {row.result.limits}"]
    return "  ".join([begin, *shown, *missed])


def _reason(problem: str, given: list[str] | None) -> str:
    """Return the number of a reason in ``given``, with the reason itself if it is new."""
    given = [] if given is None else given
    if problem in given:
        return f"[{given.index(problem) + 1}]"
    given.append(problem)
    return f"[{len(given)}]: {' '.join(problem.split())}"


def _cell(text: str, column: StudyColumn) -> str:
    return text.rjust(max(len(column.head), 8 if column.form.endswith("f") else 5))


COMPARED_METHODS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    sliding: (term.name, {"method": "rbf", "sliding": sliding})
    for sliding, term in terms.SLIDING.items()
} | {
    method: (
        term.name,
        {"method": method, "sliding": term.slides_by, "relax": "no", "layers": "no"},
    )
    for method, term in terms.METHODS.items()
    if method != "rbf"
}
"""For each method its name, and the fields of a case that it changes."""

MODES = terms.names(terms.PERIODIC_MODES)  # the name of each PERIODIC_MODE
AUTO = 0  # number of steps that means STEPS= auto: the solver chooses it
STEPS = (1, 5, 20)  # numbers of steps that are compared by default


@frozen
class Combination:
    """A method, a periodic mode and a number of steps."""

    method: str
    """One of ``COMPARED_METHODS``: none, ps, ds, idw or elastic."""
    periodic: PeriodicMode
    steps: int
    """``AUTO``: the solver chooses."""

    @property
    def label(self) -> str:
        """Return method and mode in words."""
        return f"{COMPARED_METHODS[self.method][0]}, {MODES[self.periodic]}"

    def applied(self, case: Case) -> Case:
        """Return the case with this method, mode and number of steps."""
        return case.change(
            periodic=self.periodic, steps=self.steps, **COMPARED_METHODS[self.method][1]
        )


@record
class Result:
    """The result of a combination: quality, errors and time."""

    steps: int  # steps made
    mesh: Mesh | None
    """After the last step; None where it was not kept, so that there is no picture of it."""
    quality: Quality  # of that mesh
    minimum: FloatArray
    mean: FloatArray  # `minimum`, `mean` (steps,): lowest and mean quality after each step
    control_nodes: int  # in the last step
    max_error: float  # the largest of all steps, in the mesh's length unit
    condition: float  # the largest of all steps; NaN where the method has no system
    seconds: float
    processor_seconds: float
    """`seconds`, `processor_seconds`: of the deformation: by the clock, and of all processors
    together."""
    tolerance: float | None  # of the greedy selection, in the mesh's length unit
    history: tuple[tuple[int, Cycle], ...]
    """tuple of (int, Cycle): number of the step, and a cycle of its greedy selection."""
    warnings: tuple[str, ...]
    limits: str = ""  # whether the limits of the case are met (`slideviz.case.limits.outcome`)


@record
class CombinationRow:
    """A combination with its result, or with the reason why there is none."""

    combination: Combination
    result: Result | None = None
    problem: str = ""


def bounded(rows: Iterable[CombinationRow], bytes_kept: int) -> Iterator[CombinationRow]:
    """Yield the rows, without meshes once the points of all meshes exceed ``bytes_kept`` bytes."""
    kept = 0
    for row in rows:
        result = row.result
        if result is not None and result.mesh is not None:
            kept += result.mesh.points.nbytes
            if kept > bytes_kept:
                yield replace(row, result=replace(result, mesh=None))
                continue
        yield row


@record
class _Shared:
    first: Combination
    setup: Setup | None  # None of a mesh of several zones, each of which has its own
    seconds: float
    processor_seconds: float

    def serves(self, combination: Combination) -> bool:
        """Return whether a combination differs from ``first`` in the number of steps only."""
        return replace(combination, steps=self.first.steps) == self.first


def warm(methods: Iterable[str]) -> None:
    """Load and compile what the methods need once, by small runs, so that no run's time has it."""
    warm_up(lambda: None, Job())
    made = sample("square", 4, "motion")
    (block,) = made.case.markers_with("moving")
    case = made.case.change(motions=(Translate(block, (1e-3, 0.0)),))
    for method in set(methods) - set(terms.SLIDING):
        for _ in deform(Combination(method, "none", 1).applied(case), made.mesh):
            pass


def compare(
    case: Case,
    mesh: Mesh,
    wanted: Sequence[Combination] | None = None,
    report: Callable[[Combination, Progress], None] | None = None,
) -> Iterator[CombinationRow]:
    """Deform a mesh by several methods; yield a row for each combination, in order.

    Parameters
    ----------
    case : Case
        All settings but method, mode and number of steps, which are those of the combinations.
    mesh : Mesh
        The undeformed mesh.
    wanted : sequence of Combination, optional
        Methods, periodic modes and numbers of steps (`combinations`); by default the methods that
        suit the case, in 1, 5 and 20 steps.
    report : callable, optional
        Called often with the progress of a combination; raising `Cancelled` ends the comparison.

    Raises
    ------
    Cancelled
        ``report`` ended the comparison. The problem of a combination that fails is in its row.

    Examples
    --------
    >>> import slideviz as sv
    >>> from slideviz.samples.table import write_sample
    >>> files = write_sample("square", "try", 8)
    >>> case, mesh = sv.Case.read("try/square.cfg"), sv.read("try/mesh.su2")
    >>> rows = list(sv.compare(case, mesh))
    >>> sorted({row.combination.method for row in rows})
    ['ds', 'none', 'ps']
    """
    if wanted is None:
        wanted = combinations(wanted_methods(case), wanted_modes(case), STEPS)
    shared: _Shared | None = None
    for combination in wanted:
        try:
            if shared is None or not shared.serves(combination):
                shared = None  # the old one need not be kept while the new one is made
                shared = _share(combination, case, mesh)
            yield CombinationRow(combination, _result(combination, case, mesh, shared, report))
        except Cancelled:
            raise
        except Exception as problem:  # one that fails must not take the others with it
            reason = why_failed(problem, "DATA_REDUCTION= YES")
            yield CombinationRow(combination, problem=reason)


def _share(combination: Combination, case: Case, mesh: Mesh) -> _Shared:
    clock = _Clock()
    with clock:
        prepared = prepare(combination.applied(case), mesh)
        setup = None if isinstance(mesh, Assembly) else make_setup(prepared)
    return _Shared(combination, setup, clock.seconds, clock.processor)


def _result(
    combination: Combination,
    case: Case,
    mesh: Mesh,
    shared: _Shared,
    report: Callable[[Combination, Progress], None] | None,
) -> Result:
    applied = combination.applied(case)
    progress = (lambda now: report(combination, now)) if report else None
    pulled = deform(applied, mesh, progress, shared.setup)
    clock = _Clock(shared.seconds, shared.processor_seconds)
    steps: list[Step] = []
    quality_of: list[tuple[float, float]] = []
    while True:
        with clock:
            step = next(pulled, None)
        if step is None:
            break
        if steps:  # of the steps before the last only the numbers are needed
            steps[-1] = replace(steps[-1], mesh=mesh)
        steps.append(step)
        measured = quality(step.mesh, mesh, applied.quality_metric)
        quality_of.append((measured.min, measured.mean))
    minimum, mean = np.array(quality_of).T
    return Result(
        steps=len(steps),
        mesh=steps[-1].mesh,
        quality=measured,
        minimum=frozen_array(minimum),
        mean=frozen_array(mean),
        control_nodes=steps[-1].control_nodes,
        max_error=max(step.max_error for step in steps),
        condition=max(step.condition for step in steps),
        seconds=clock.seconds,
        processor_seconds=clock.processor,
        tolerance=steps[-1].tolerance,
        history=tuple((step.index, cycle) for step in steps for cycle in step.history),
        warnings=steps[-1].warnings,
        limits=outcome(check_case_limits(applied, measured, steps[-1].mesh, mesh)),
    )


class _Clock:
    """Stopwatch: ``with clock:`` adds the block's wall time and the time of all processors."""

    def __init__(self, seconds: float = 0.0, processor: float = 0.0) -> None:
        self.seconds = seconds
        self.processor = processor

    def __enter__(self) -> None:
        self.seconds -= time.perf_counter()
        self.processor -= time.process_time()

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter()
        self.processor += time.process_time()


Names = tuple[Callable[[str], str], Callable[[str], str]]
"""Functions that return the name of a method and of a periodic mode."""

KEYS: Names = (lambda method: f"method {method}", lambda mode: f"periodic {mode}")
"""Names as in the options of the command."""

TITLES: Names = (lambda method: COMPARED_METHODS[method][0], lambda mode: MODES[mode])
"""Names as in figures."""


def combinations(
    methods: Sequence[str], modes: Sequence[PeriodicMode], steps: Sequence[int]
) -> tuple[Combination, ...]:
    """Return all combinations; those of one method and mode, which share a setup, are adjacent."""
    return tuple(Combination(*row) for row in product(methods, modes, steps))


def wanted_modes(case: Case) -> tuple[PeriodicMode, ...]:
    """Return the modes that are compared by default: the case's own, and with ``moving`` ``fixed``.

    For ``moving`` is not possible without sliding.
    """
    return ("fixed", "moving") if case.periodic == "moving" else (case.periodic,)


def wanted_methods(case: Case) -> tuple[str, ...]:
    """Return the methods compared by default: all of SLIDING_MODE, or ``none`` without sliding."""
    slides = any(case.markers_with(role) for role in ("sliding", "periodic", "internal"))
    return tuple(SLIDING) if slides else ("none",)


def refused(case: Case, mesh: Mesh, wanted: Iterable[Combination]) -> dict[Combination, str]:
    """Return the combinations that contradict the case or the mesh, each with the reason.

    Nothing is deformed: other combinations may turn out to be impossible later.
    """
    problems: dict[tuple[str, str], str] = {}
    reason_of = {}
    for one in wanted:
        kind = one.method, one.periodic
        if kind not in problems:
            problems[kind] = "; ".join(map(str, dict.fromkeys(check_case(one.applied(case), mesh))))
        if problems[kind]:
            reason_of[one] = problems[kind]
    return reason_of


def reasons(problems: Mapping[Combination, str]) -> dict[str, list[Combination]]:
    """Return for each reason the combinations that have it."""
    return grouped((" ".join(problem.split()), one) for one, problem in problems.items())


def words_for(some: Iterable[Combination], every: Iterable[Combination], names: Names) -> str:
    """Return words for ``some`` of ``every`` combination, whatever their numbers of steps.

    A mode with all methods is named by the mode only, a method with all modes by the method only.
    """
    pairs = dict.fromkeys((one.method, one.periodic) for one in some)
    others = {(one.method, one.periodic) for one in every} - pairs.keys()
    spoilt = [{pair[axis] for pair in others} for axis in (0, 1)]
    words: dict[str, None] = {}
    for method, mode in pairs:
        if mode not in spoilt[1]:
            words[names[1](mode)] = None
        elif method not in spoilt[0]:
            words[names[0](method)] = None
        else:
            words[f"{names[0](method)} with {names[1](mode)}"] = None
    return "; ".join(words)


def announcement(
    wanted: Sequence[Combination],
    cannot: Mapping[Combination, str],
    more: Mapping[str, Sequence[str]],
) -> str:
    """Return lines about the work of a comparison, before it begins.

    ``cannot``: those that are left out, with the reason; see `refused`. ``more``: further values
    that each option (``methods``, ``periodic``) takes; empty where the user has chosen.
    """
    tried: dict[str, Iterable[str]] = {
        "methods": dict.fromkeys(one.method for one in wanted),
        "periodic": dict.fromkeys(one.periodic for one in wanted),
        "steps": dict.fromkeys(str(one.steps or "auto") for one in wanted),
    }
    count = len(wanted) - len(cannot)
    lines = [f"{count} combination{'' if count == 1 else 's'}"]
    for option, values in tried.items():
        also = [value for value in more.get(option, ()) if value not in values]
        hint = f"   (--{option} takes {', '.join(also)}, too)" if also else ""
        lines.append(f"  {option:<8}  {', '.join(values)}{hint}")
    for problem, left_out in reasons(cannot).items():
        lines.append(f"  left out  {words_for(left_out, wanted, KEYS)}: {problem}")
    return "\n".join(lines)
