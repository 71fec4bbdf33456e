"""Runs in words: names, the settings that distinguish them, and a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from slideviz.argument_types import frozen
from slideviz.case.keys import BY_WEIGHT, METHOD, PERIODICITY, QUALITY, REDUCTION, Key
from slideviz.case.limits import outcome
from slideviz.case.model import Case
from slideviz.case.motion_words import deformation, describe, motion_labels
from slideviz.session.run_messages import remarks_of
from slideviz.session.state import Run
from slideviz.session.walls_table import angle_change, height_ratios
from slideviz.terms import KERNELS, METHODS, PERIODIC_MODES, SLIDING

WORDED = {METHOD: 0, REDUCTION: 0, QUALITY: 0, PERIODICITY: 1}
"""Groups of keys whose values are named in the words on a run, with their rank: lowest first."""


def method_words(case: Case) -> str:
    """Return the method of a case in words."""
    return (SLIDING[case.sliding] if case.method == "rbf" else METHODS[case.method]).name


def run_words(run: Run) -> str:
    """Return the name of a run, or else its method."""
    return run.name or method_words(run.case)


def _number_words(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def reduction_words(case: Case) -> str:
    """Return the data reduction of a case in words."""
    reduction = case.reduction
    if reduction is None or case.method != "rbf":
        return "all nodes"
    if reduction.auto:
        return "automatic data reduction"
    part = _number_words(reduction.relative or reduction.tolerance)
    part += " of the extent" if reduction.relative else ""
    levels = ", in levels" if reduction.multilevel else ""
    most = f", at most {reduction.max_nodes:,} nodes" if reduction.max_nodes else ""
    return f"reduced to {part}{levels}{most}"


def steps_words(run: Run) -> str:
    """Return the number of steps of a run in words; of a run not done, how many of all it made."""
    made = len(run.frames)
    planned = run.planned
    if run.end != "done":
        planned = planned or run.case.steps
    auto = ", automatic" if not run.case.steps else ""
    if made == planned:
        return f"{made} step{'' if made == 1 else 's'}{auto}"
    return f"{made} of {planned} steps{auto}"


def seconds_words(seconds: float) -> str:
    """Return a time in words: in seconds, with few digits; from 100 s on in minutes and seconds."""
    if seconds < 100:
        return f"{seconds:.3g} s" if seconds >= 0.1 else f"{seconds:.2f} s"
    return f"{int(seconds // 60)} min {seconds % 60:.0f} s"


def control_nodes(run: Run) -> int | None:
    """Return the number of control nodes in a run's last step, or None."""
    return run.last_step.control_nodes if run.last_step is not None else None


SETTINGS: tuple[Key, ...] = tuple(
    sorted(
        (key for key in BY_WEIGHT if key.group in WORDED and key.run_label != ""),
        key=lambda key: WORDED[key.group],
    )
)
"""Keys that distinguish runs, in the order of their words; motions and roles are not among them."""


def _setting_words(key: Key, case: Case) -> str:
    """Return a setting in words; "" where it is at its default, or has no effect."""
    value = key.get(case)
    if key.is_default(value) or key.idle(case):
        return ""
    if key.field == "reduction":
        return reduction_words(case)
    text = key.kind.value_label(key.kind.write(value)).partition(" (")[0]  # "Gaussian (global)"
    if key.kind.entry in ("axis", "point"):
        text = f"({', '.join(map(_number_words, value))})"
    elif key.kind.entry == "real":
        text = _number_words(value)
    said = key.run_label or f"{key.label or key.name.replace('_', ' ')} {{}}".lower()
    return said.format(text + key.unit)


def _roles_words(case: Case, others: Sequence[Case]) -> str:
    """Return in words the roles of the boundaries whose role differs in ``others``."""
    names = dict.fromkeys(name for other in others for name in other.roles)
    differ = [n for n in names if len({one.roles.get(n, "fixed") for one in others}) > 1]
    return ", ".join(f"{name} {case.roles.get(name, 'fixed')}" for name in differ)


def _settings_words(run: Run, cases: Sequence[Case]) -> Iterator[tuple[str, bool]]:
    """Yield the words for each setting of a run, and whether it differs in any of ``cases``."""
    case = run.case

    def differs(name: str) -> bool:
        return any(getattr(other, name) != getattr(case, name) for other in cases)

    if case.periodic != "none" or differs("periodic"):
        yield PERIODIC_MODES[case.periodic].name.removeprefix("periodic, "), differs("periodic")
    yield steps_words(run), differs("steps")
    for key in SETTINGS:
        # A setting at its default has no words: those of the other runs are enough.
        words = _setting_words(key, case)
        of = reduction_words if key.field == "reduction" else key.get
        is_different = bool(words) and any(of(other) != of(case) for other in cases)
        if is_different or (words and key.field == "kernel"):
            yield words, is_different
    nodes = control_nodes(run)
    if nodes is not None:
        yield f"{nodes:,} nodes", False


def differences_from_all(run: Run, among: Sequence[Run]) -> str:
    """Return words that distinguish a run from the runs ``among``, to be put beside its name.

    "" where no other has the same name or, without names, the same method.
    """
    if not any(other is not run and run_words(other) == run_words(run) for other in among):
        return ""
    words = [method_words(run.case)] if run.name else []
    return ", ".join(filter(None, [*words, differences_from(run, among)]))


def differences_from(run: Run, among: Sequence[Run]) -> str:
    """Return in words the settings of a run that differ among ``among``, which has it, too.

    The method is not among them.
    """
    cases = [other.case for other in among]
    words = [motion_labels(cases)[among.index(run)], _roles_words(run.case, cases)]
    words += [text for text, differs in _settings_words(run, cases) if differs]
    return ", ".join(filter(None, words))


def summary(run: Run, among: Sequence[Run] = (), method: bool = False) -> str:
    """Return a line on a run's settings, to be put beside its name.

    Settings that differ in the runs ``among`` come first, since the end of the line may be cut off.
    The method is one of them where the run has a name of its own, or with ``method``.
    """
    cases = [other.case for other in among]
    words: list[str] = [] if run.end == "done" else [run.end or "running"]
    named = [method_words(run.case)] if run.name or method else []
    if len({method_words(case) for case in cases}) > 1:
        words += named
        named = []
    if run in among:
        words.append(motion_labels(cases)[among.index(run)])
        words.append(_roles_words(run.case, cases))
    settings = list(_settings_words(run, cases))
    words += [text for text, differs in settings if differs]
    words += named
    words += [text for text, differs in settings if not differs]
    if run.frames:
        words.append(seconds_words(run.seconds))
    return " · ".join(filter(None, words))


DIGITS = 4  # decimals of qualities in the window
QUALITY_FORMAT = f".{DIGITS}f"  # format of qualities in the window


def _of_last(run: Run, name: str) -> float | None:
    return getattr(run.last.quality, name) if run.last is not None else None


def _motions(run: Run) -> str | None:
    dim = run.last.mesh.dim if run.last is not None else 2
    return "; ".join(describe(motion, dim) for motion in run.case.motions) or None


def _misfit(run: Run) -> float | None:
    misfits = [frame.step.periodic_misfit for frame in run.frames if frame.step is not None]
    return max((value for value in misfits if value is not None), default=None)


@frozen
class Column:
    """A column of the table: title, function from a run to its value, its format and unit."""

    title: str
    value: Callable[[Run], str | float | None]
    form: str = ""
    unit: str = ""

    def text(self, run: Run) -> str:
        """Return the formatted value of a run; a dash where it has none."""
        value = self.value(run)
        return "–" if value is None else f"{value:{self.form}}{self.unit}"


COLUMNS: tuple[Column, ...] = (
    Column("run", lambda run: run.number),
    Column("name", lambda run: run.name or None),
    Column("motion", _motions),
    Column("method", lambda run: method_words(run.case)),
    Column("periodicity", lambda run: PERIODIC_MODES[run.case.periodic].name),
    Column("steps", lambda run: len(run.frames)),
    Column("kernel", lambda run: KERNELS[run.case.kernel].name),
    Column("support radius", lambda run: getattr(run.last_step, "support_radius", None), ".4g"),
    Column("control nodes chosen", lambda run: reduction_words(run.case)),
    Column("minimum quality", lambda run: _of_last(run, "min"), QUALITY_FORMAT),
    Column("mean quality", lambda run: _of_last(run, "mean"), QUALITY_FORMAT),
    Column("inverted cells", lambda run: _of_last(run, "inverted"), ",d"),
    Column("limits", lambda run: outcome(run.last.limits) or None if run.last else None),
    Column("lowest first height, ratio", lambda run: height_ratios(run.last, run.case)[0], ".3f"),
    Column("highest first height, ratio", lambda run: height_ratios(run.last, run.case)[1], ".3f"),
    Column(
        "largest change of a wall angle", lambda run: angle_change(run.last, run.case), ".2g", "°"
    ),
    Column("control nodes", control_nodes, ",d"),
    Column("largest error at control", lambda r: getattr(r.last_step, "max_error", None), ".3g"),
    Column("periodic misfit", _misfit, ".3g"),
    Column("seconds", lambda run: run.seconds, ".3f"),
    Column("end", lambda run: run.end or "running"),
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
    warned = (*remarks_of(run, "warning"), *remarks_of(run, "note"))
    if warned:
        lines += ["", *(f"{text[:1].upper()}{text[1:]}." for text in warned)]
    return "\n".join(lines)


def table_rows(runs: Sequence[Run]) -> list[list[object]]:
    """Return the cells of the table: a row of titles, and one for each run."""
    rows: list[list[object]] = [[column.title for column in COLUMNS]]
    return rows + [[column.value(run) for column in COLUMNS] for run in runs]
