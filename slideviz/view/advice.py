"""What a run says of itself when it is over: how it ended, and what would help if it went badly."""

from __future__ import annotations

from slideviz.case.model import Case
from slideviz.errors import Note
from slideviz.view.session.state import Run


def ended(run: Run) -> str:
    """Return how a run ended, in a few words."""
    step = run.last.step if run.last is not None else None
    if run.last is None or step is None:
        return "Ready."
    bad = inverted_words(run)
    if step.index < step.total:
        return f"Stopped after step {step.index} of {step.total}" + (f": {bad}." if bad else ".")
    return f"Done: {bad}" if bad else "Done."


def inverted_words(run: Run) -> str:
    """Return how many cells are inverted after the last step; empty when none is."""
    count = run.last.quality.inverted if run.last is not None else 0
    return f"{count:,} inverted cell{'' if count == 1 else 's'}" if count else ""


def help_for(case: Case) -> str:
    """Return what would help against inverted cells, most promising first, in a sentence."""
    helps = []
    if case.method != "rbf":
        helps.append("radial basis functions as the method")
    if case.sliding == "none" and {"sliding", "periodic"} & set(case.roles.values()):
        helps.append("sliding boundary nodes")
    if case.steps:
        helps.append("more steps, or automatic steps")
    helps.append("a smaller motion")
    return f"What may help: {'; '.join(helps)}."


def warnings_of(run: Run) -> tuple[str, ...]:
    """Return what a run warns of, without what is harmless."""
    step = run.last.step if run.last is not None else None
    return () if step is None else tuple(t for t in step.warnings if not isinstance(t, Note))


def notes_of(run: Run) -> tuple[str, ...]:
    """Return what a run remarks that is harmless."""
    step = run.last.step if run.last is not None else None
    return () if step is None else tuple(t for t in step.warnings if isinstance(t, Note))
