"""The table of runs: its columns as text in the window and as CSV, and which runs are best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from slideviz.case.motion_words import deformation, describe
from slideviz.errors import SlidevizError
from slideviz.session.run_messages import notes_of, warnings_of
from slideviz.session.runs_words import control_nodes, end_words, method_words, reduction_words
from slideviz.session.state import Run
from slideviz.system.csv_table import csv_text, write_csv
from slideviz.terms import KERNELS, PERIODIC_MODES

DIGITS = 4
"""Decimals of qualities in the window."""
QUALITY = f".{DIGITS}f"
"""Format of qualities in the window."""


def _of_last(run: Run, name: str) -> float | None:
    return getattr(run.last.quality, name) if run.last is not None else None


def _motions(run: Run) -> str | None:
    dim = run.last.mesh.dim if run.last is not None else 2
    return "; ".join(describe(motion, dim) for motion in run.case.motions) or None


def _error(run: Run) -> float | None:
    step = run.last.step if run.last is not None else None
    return step.max_error if step is not None else None


def _radius(run: Run) -> float | None:
    step = run.last.step if run.last is not None else None
    return step.support_radius if step is not None else None


def _misfit(run: Run) -> float | None:
    misfits = [frame.step.periodic_misfit for frame in run.frames if frame.step is not None]
    return max((value for value in misfits if value is not None), default=None)


@dataclass(frozen=True)
class Column:
    """A column of the table: title, function from a run to its value, and format of the value."""

    title: str
    value: Callable[[Run], str | float | None]
    form: str = ""

    def text(self, run: Run) -> str:
        """Return the formatted value of a run; a dash where it has none."""
        value = self.value(run)
        return "–" if value is None else format(value, self.form)


COLUMNS: tuple[Column, ...] = (
    Column("run", lambda run: run.number),
    Column("name", lambda run: run.name or None),
    Column("motion", _motions),
    Column("method", lambda run: method_words(run.case)),
    Column("periodicity", lambda run: PERIODIC_MODES[run.case.periodic].name),
    Column("steps", lambda run: len(run.frames)),
    Column("kernel", lambda run: KERNELS[run.case.kernel].name),
    Column("support radius", _radius, ".4g"),
    Column("control nodes chosen", lambda run: reduction_words(run.case)),
    Column("minimum quality", lambda run: _of_last(run, "min"), QUALITY),
    Column("mean quality", lambda run: _of_last(run, "mean"), QUALITY),
    Column("inverted cells", lambda run: _of_last(run, "inverted"), ",d"),
    Column("control nodes", control_nodes, ",d"),
    Column("largest error at control", _error, ".3g"),
    Column("periodic misfit", _misfit, ".3g"),
    Column("seconds", lambda run: run.seconds, ".3f"),
    Column("end", end_words),
)
"""The columns of the table; qualities and control nodes are those of a run's last step."""


def best_runs(runs: Sequence[Run]) -> frozenset[int]:
    """Return the numbers of the runs with the highest minimum quality for their motion.

    Runs of different motions cannot be compared, nor runs that did not come to their end. Minima
    that are equal when rounded count as equal; where those of all runs are, none is best.
    """
    alike: dict[object, dict[int, float]] = {}
    for run in runs:
        if run.last is not None and run.end == "done":
            group = alike.setdefault(deformation(run.case), {})
            group[run.number] = round(run.last.quality.min, DIGITS)
    best: set[int] = set()
    for group in alike.values():
        if len(set(group.values())) > 1:
            best |= {number for number, value in group.items() if value == max(group.values())}
    return frozenset(best)


def describe_run(run: Run) -> str:
    """Return a line for each column with a run's value, and lines with its warnings and notes."""
    shown = [column for column in COLUMNS if column.title != "name" or run.name]
    lines = [f"{column.title}: {column.text(run)}" for column in shown]
    warned = (*warnings_of(run), *notes_of(run))
    if warned:
        lines += ["", *(f"{text[:1].upper()}{text[1:]}." for text in warned)]
    return "\n".join(lines)


def table_text(runs: Sequence[Run], delimiter: str = ",") -> str:
    """Return the table as CSV, with a line of titles; numbers have all digits."""
    return csv_text(_rows(runs), delimiter)


def write_table(path: Path, runs: Sequence[Run]) -> None:
    """Write the table as CSV.

    Raises SlidevizError if the file cannot be written.
    """
    write_csv(path, _rows(runs), SlidevizError)


def _rows(runs: Sequence[Run]) -> list[list[object]]:
    """Return the cells of the table: a row of titles, and one for each run."""
    rows: list[list[object]] = [[column.title for column in COLUMNS]]
    return rows + [[column.value(run) for column in COLUMNS] for run in runs]
