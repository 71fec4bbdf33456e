"""A broken law with a case as plain as it can be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from slideviz.case.model import Case
from tools.laws.cases import Run
from tools.laws.check import check

PLAIN = (
    "reduction",
    "steps",
    "kernel",
    "influence_factor",
    "curved",
    "feature_angle_deg",
    "method",
    "sliding",
    "periodic",
)
"""Fields that are given their usual value, where the law stays broken."""


def simplified(run: Run) -> Run:
    """Return a run that ends like this one and breaks a law of it, changed as far as possible."""
    first = check(run)
    laws = {law for law, _ in first.broken}
    again = bool(laws)
    while again:
        again = False
        for case in _plainer(run.case):
            tried = replace(run, case=case)
            now = check(tried)
            if now.ended == first.ended and laws & {law for law, _ in now.broken}:
                run, again = tried, True
                break
    return run


def _plainer(case: Case) -> Iterator[Case]:
    """Yield the case with one thing less."""
    usual = Case()
    for field in PLAIN:
        if getattr(case, field) != getattr(usual, field):
            yield case.change(**{field: getattr(usual, field)})
    if case.reduction is not None and case.reduction.multilevel:
        yield case.change(reduction=replace(case.reduction, multilevel=False))
    for name in case.roles:
        if case.roles[name] in ("sliding", "internal"):
            yield case.change(roles={m: r for m, r in case.roles.items() if m != name})
    markers = len({motion.marker for motion in case.motions})
    if len(case.motions) > markers:
        yield case.change(motions=case.motions[:markers])
        yield case.change(motions=case.motions[markers:])
