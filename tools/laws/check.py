"""One run held against all laws, its refusal judged, and a broken law with a simpler case."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from tools.laws.cases import Run
from tools.laws.laws import LAWS, told, tried
from tools.laws.oracle import distance, goals, nodes_with, simplices

PLAIN = (
    "reduction",
    "steps",
    "kernel",
    "polynomial",
    "influence_factor",
    "curved",
    "layers",
    "feature_angle_deg",
    "method",
    "sliding",
    "periodic",
)
"""Fields that are given their usual value, where the law stays broken."""

KINDS = {
    r"nodes (\d+) and (\d+) coincide": "images asked to move differently",
    r"the motion (?:puts|takes) (\S+) through (\S+) near": "motion through a boundary",
    r"which displace it differently": "two moving markers disagree",
    r"would move by \S+, more than": "an overshoot",
    r"misses its own control nodes": "a system that was not solved",
    r"equations of linear elasticity were not solved": "elasticity not solved",
}
"""What a message has, and the kind of the refusal; all others are not refusals of such runs."""


@dataclass(frozen=True)
class Outcome:
    """The result of one seed: how its run ended, and the laws that it breaks.

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


def simplified(run: Run) -> Run:
    """Return a run that ends like this one and breaks a law of it, changed as far as possible."""
    first = check(run)
    laws = {law for law, _ in first.broken}
    again = bool(laws)
    while again:
        again = False
        for case in _plainer(run.case):
            plainer = replace(run, case=case)
            now = check(plainer)
            if now.ended == first.ended and laws & {law for law, _ in now.broken}:
                run, again = plainer, True
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


def kind_of(problem: SlidevizError) -> str:
    """Return the kind of a refusal."""
    for pattern, kind in KINDS.items():
        if re.search(pattern, str(problem)):
            return f"refused: {kind}"
    return "refused: " + re.sub(r"[-+]?\d[\d.e+-]*", "#", str(problem))[:70]


def unlikely(run: Run, problem: SlidevizError) -> Iterator[str]:
    """Yield why the reason of a refusal cannot be true."""
    text = str(problem)
    kind = kind_of(problem).removeprefix("refused: ")
    if kind not in KINDS.values():
        yield text[:300]
    pair = re.search(r"nodes (\d+) and (\d+) coincide", text)
    if pair:
        nodes = np.array([int(pair[1]), int(pair[2])])
        if not np.isin(nodes, nodes_with(run.case, run.mesh, "moving")).any():
            yield f"neither of the nodes moves: {text[:120]}"
    through = re.search(r"the motion (?:puts|takes) (\S+) through (\S+) near", text)
    if through:
        yield from _too_far(run, through[1], through[2])


def _too_far(run: Run, one: str, other: str) -> Iterator[str]:
    """Yield a sentence when a marker cannot have reached another one."""
    where = goals(run.case, run.mesh)
    nodes = np.array(list(where))
    reach = np.linalg.norm(np.array(list(where.values())) - run.mesh.points[nodes], axis=1).max()
    sides = simplices(run.mesh, [run.mesh.marker(other)], run.mesh.points)
    gap = distance(run.mesh.points[run.mesh.marker(one).nodes], sides).min()
    mine = simplices(run.mesh, [run.mesh.marker(one)], run.mesh.points)
    back = distance(run.mesh.points[run.mesh.marker(other).nodes], mine).min()
    if reach < min(gap, back) - 1e-9 * run.mesh.extent:
        yield f"{one} moves {reach:.3g}, {other} is {min(gap, back):.3g} away"
