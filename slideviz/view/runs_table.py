"""The runs of a session in words and numbers, as a table for people and for a file."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from slideviz.mesh.atomic import atomic_write
from slideviz.view.state import Run

SLIDING = {"none": "no sliding", "ps": "pseudo sliding", "ds": "direct sliding"}
OTHER = {"idw": "inverse distance", "elastic": "linear elasticity"}
PERIODIC = {
    "none": "not periodic",
    "periodic": "periodic distance",
    "fixed": "periodic, fixed vertices",
    "moving": "periodic, moving vertices",
}
USUAL_KERNEL = Case().kernel


def method_words(case: Case) -> str:
    """Return which method a case asks for, in words."""
    return OTHER.get(case.method, SLIDING[case.sliding])


def reduction_words(case: Case) -> str:
    """Return how control nodes are chosen, in words."""
    given = case.reduction
    if given is None or case.method != "rbf":
        return "all nodes"
    part = f"{given.relative:g} of the extent" if given.relative else f"{given.tolerance:g}"
    levels = ", in levels" if given.multilevel else ""
    most = f", at most {given.max_nodes:,} nodes" if given.max_nodes else ""
    return f"reduced to {part}{levels}{most}"


def steps_words(run: Run) -> str:
    """Return how many steps a run made, or has made of how many."""
    made = len(run.frames)
    step = run.last.step if run.last is not None else None
    total = step.total if step is not None else run.case.steps
    auto = ", automatic" if not run.case.steps else ""
    if run.end == "done" or made == total:
        return f"{made} step{'' if made == 1 else 's'}{auto}"
    return f"{made} of {total} steps{auto}" if total else f"{made} steps{auto}"


def seconds_words(seconds: float) -> str:
    """Return a time, as exactly as it matters."""
    if seconds < 100:
        return f"{seconds:.3g} s" if seconds >= 0.1 else f"{seconds:.2f} s"
    return f"{int(seconds // 60)} min {seconds % 60:.0f} s"


def end_words(run: Run) -> str:
    """Return how a run ended, or that it goes on."""
    return run.end or "running"


def _control(run: Run) -> int | None:
    step = run.last.step if run.last is not None else None
    return step.control_nodes if step is not None else None


def _of_last(run: Run, name: str) -> float | None:
    return getattr(run.last.quality, name) if run.last is not None else None


def _error(run: Run) -> float | None:
    step = run.last.step if run.last is not None else None
    return step.max_error if step is not None else None


@dataclass(frozen=True)
class Column:
    """A column: its title, what it says of a run, and how that is written for people."""

    title: str
    value: Callable[[Run], str | float | None]
    form: str = ""

    def text(self, run: Run) -> str:
        """Return what it says of a run, for people; a dash where nothing is known."""
        value = self.value(run)
        return "–" if value is None else format(value, self.form)


COLUMNS: tuple[Column, ...] = (
    Column("run", lambda run: run.number),
    Column("method", lambda run: method_words(run.case)),
    Column("periodicity", lambda run: PERIODIC[run.case.periodic]),
    Column("steps", lambda run: len(run.frames)),
    Column("kernel", lambda run: run.case.kernel),
    Column("support radius / extent", lambda run: run.case.influence_factor, "g"),
    Column("control nodes chosen", lambda run: reduction_words(run.case)),
    Column("minimum quality", lambda run: _of_last(run, "min"), ".4f"),
    Column("mean quality", lambda run: _of_last(run, "mean"), ".4f"),
    Column("inverted cells", lambda run: _of_last(run, "inverted"), ",d"),
    Column("control nodes", _control, ",d"),
    Column("largest error at control", _error, ".3g"),
    Column("seconds", lambda run: run.seconds, ".3f"),
    Column("end", end_words),
)
"""What a table of runs has; qualities and control nodes are those of the last step."""


def best(runs: Sequence[Run]) -> int | None:
    """Return the number of the run of highest minimum quality; None for less than two."""
    known = [run for run in runs if run.last is not None]
    if len(known) < 2:
        return None
    return max(known, key=lambda run: run.last.quality.min if run.last else 0.0).number


def brief(run: Run) -> str:
    """Return what sets a run apart, beside its method, in one short line."""
    case, parts = run.case, []
    if case.periodic != "none":
        parts.append(
            {"moving": "moving vertices", "fixed": "fixed vertices"}.get(case.periodic, "periodic")
        )
    parts.append(steps_words(run))
    if case.kernel != USUAL_KERNEL and case.method == "rbf":
        parts.append(case.kernel)
    control = _control(run)
    if control is not None:
        parts.append(f"{control:,} nodes")
    if run.frames:
        parts.append(seconds_words(run.seconds))
    if run.end != "done":
        parts.insert(0, end_words(run))
    return " · ".join(parts)


def described(run: Run) -> str:
    """Return all that the table says of a run, a line for each column, and what it remarks."""
    lines = [f"{column.title}: {column.text(run)}" for column in COLUMNS]
    step = run.last.step if run.last is not None else None
    if step is not None and step.warnings:
        lines += ["", *(f"{text[:1].upper()}{text[1:]}." for text in step.warnings)]
    return "\n".join(lines)


def table_text(runs: Sequence[Run], delimiter: str = ",") -> str:
    """Return the table with a line of titles; numbers keep every digit."""
    out = io.StringIO()
    rows = csv.writer(out, delimiter=delimiter, lineterminator="\n")
    rows.writerow([column.title for column in COLUMNS])
    for run in runs:
        values = [column.value(run) for column in COLUMNS]
        rows.writerow(["" if value is None else value for value in values])
    return out.getvalue()


def write_table(path: Path, runs: Sequence[Run]) -> None:
    """Write the table as CSV.

    Raises
    ------
    SlidevizError
        It cannot be written.
    """
    with atomic_write(path, SlidevizError) as file:
        file.write(table_text(runs).encode())
