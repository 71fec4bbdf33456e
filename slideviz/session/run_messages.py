"""What a run says of itself when it is over: how it ended, and what would help if it went badly."""

from __future__ import annotations

import numpy as np

from slideviz.case.model import Case
from slideviz.errors import Note
from slideviz.mesh.model import Mesh
from slideviz.session.state import Run
from slideviz.session.window_words import in_window_words

LARGE = 1e9
"""Bytes from which on it is told beforehand what a run takes."""
RATE = 2e10
"""Operations a second of a machine with few cores, when it factors a large matrix."""


def exact_cost(case: Case, mesh: Mesh) -> str:
    """Return in a sentence what a large run without data reduction takes; else an empty text.

    All boundary nodes are control nodes then: memory grows with the square of their number, and
    time with the cube.
    """
    from slideviz.deformation.solver import free_memory

    if case.method != "rbf" or case.reduction is not None:
        return ""
    counted = [m.nodes for m in mesh.markers if case.roles.get(m.name, "fixed") != "internal"]
    count = len(np.unique(np.concatenate([*counted, np.empty(0, np.int64)])))
    size = 8.0 * 2.6 * count**2
    if size < LARGE:
        return ""
    minutes = max(case.steps, 1) * 2.0 / 3.0 * count**3 / RATE / 60.0
    time = f"{minutes:.0f} minutes" if minutes >= 1.5 else "a minute"
    free = free_memory()
    left = f" ({free / 1e9:.0f} GB are free)" if np.isfinite(free) else ""
    return (
        f"{count:,} control nodes, without data reduction: about {size / 1e9:.0f} GB of "
        f"memory{left} and {time}, more or less."
    )


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
    found = () if step is None else step.warnings
    return tuple(in_window_words(text) for text in found if not isinstance(text, Note))


def notes_of(run: Run) -> tuple[str, ...]:
    """Return what a run remarks that is harmless."""
    step = run.last.step if run.last is not None else None
    found = () if step is None else step.warnings
    return tuple(in_window_words(text) for text in found if isinstance(text, Note))
