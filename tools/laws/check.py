"""One run held against all laws."""

from __future__ import annotations

import time
from dataclasses import dataclass

from slideviz.errors import SlidevizError
from tools.laws.attempt import told, tried
from tools.laws.cases import Run
from tools.laws.laws import LAWS
from tools.laws.refusals import kind_of, unlikely


@dataclass(frozen=True)
class Outcome:
    """What became of one seed.

    Attributes
    ----------
    seed : int
    ended : str
        ``done``, or the kind of the refusal.
    broken : tuple of (str, str)
        The laws that do not hold, and by how much or where.
    seconds : float
    """

    seed: int
    ended: str
    broken: tuple[tuple[str, str], ...]
    seconds: float


def check(run: Run) -> Outcome:
    """Return whether all laws hold for a run."""
    start = time.perf_counter()
    broken: list[tuple[str, str]] = []
    steps, problem = tried(run.case, run.mesh)
    ended = "done"
    if steps is not None:
        for name, law in LAWS.items():
            broken += [(name, text) for text in law(run, steps)]
    elif isinstance(problem, SlidevizError):
        ended = kind_of(problem)
        broken += [("refusal", text) for text in unlikely(run, problem)]
    else:
        ended = "failed"
        broken.append(("ending", told(problem)))
    return Outcome(run.seed, ended, tuple(broken), time.perf_counter() - start)
