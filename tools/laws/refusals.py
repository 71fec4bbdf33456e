"""Refusals: their kinds, and whether the reason that they give can be true."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from slideviz.errors import SlidevizError
from tools.laws.cases import Run
from tools.laws.oracle import distance, goals, nodes_with, simplices

KINDS = {
    r"nodes (\d+) and (\d+) coincide": "images asked to move differently",
    r"the motion puts (\S+) through (\S+) near": "motion through a boundary",
    r"which displace it differently": "two moving markers disagree",
    r"times the largest displacement that is asked for": "an overshoot",
    r"misses its own control nodes": "a system that was not solved",
    r"equations of linear elasticity were not solved": "elasticity not solved",
}
"""What a message has, and the kind of the refusal; all others are no refusals of such runs."""


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
    through = re.search(r"the motion puts (\S+) through (\S+) near", text)
    if through:
        yield from _too_far(run, through[1], through[2])


def _too_far(run: Run, one: str, other: str) -> Iterator[str]:
    """Yield a sentence when a marker cannot have reached another one."""
    where = goals(run.case, run.mesh)
    nodes = np.array(list(where))
    reach = np.linalg.norm(np.array(list(where.values())) - run.mesh.points[nodes], axis=1).max()
    sides = simplices(run.mesh, [run.mesh.marker(other)], run.mesh.points)
    gap = distance(run.mesh.points[run.mesh.marker(one).nodes], sides).min()
    own = simplices(run.mesh, [run.mesh.marker(one)], run.mesh.points)
    back = distance(run.mesh.points[run.mesh.marker(other).nodes], own).min()
    if reach < min(gap, back) - 1e-9 * run.mesh.extent:
        yield f"{one} moves {reach:.3g}, {other} is {min(gap, back):.3g} away"
