"""Data reduction: from the settings of a case to those of the solver; warnings of loose tolerances.

The text on DATA_REDUCTION in `slideviz.case.reduction_keys` has the two numbers of AUTO in words.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.classify import Classes
from slideviz.rbf.problem import GreedySettings

EXACT_NODES = 2000
"""Most candidates with which DATA_REDUCTION= AUTO makes all of them control nodes."""

AUTO_TOLERANCE = 1e-3
"""The tolerance of DATA_REDUCTION= AUTO, as a part of the largest displacement."""

LAYER = 0.5
"""Largest tolerance of DATA_REDUCTION= AUTO, as a part of the smallest distance between a moving
node and a sliding one beside it (`sliding_gap`). The tolerance is an error of where nodes slide to,
which no correction takes back: above half of that distance, cells between both may be inverted."""

SMALLEST = 1e-7
"""Smallest tolerance of DATA_REDUCTION= AUTO, as a part of the largest displacement: below it
nearly all candidates are chosen, at a higher cost than that of all at once."""

LOOSE = 0.1
"""A tolerance above this part of the largest displacement gets a warning."""


def sliding_gap(points: FloatArray, facets: IntArray, classes: Classes) -> float:
    """Return the smallest distance between a moving and a sliding node on one edge; or inf.

    Parameters
    ----------
    points : (n, d)
    facets : (f, k)
        Of the boundary, so that a streamed mesh has the same.
    """
    moving, sliding = np.zeros((2, len(points)), bool)
    moving[classes.moving], sliding[classes.sliding] = True, True
    near = facets[moving[facets].any(axis=1) & sliding[facets].any(axis=1)]
    ends = np.stack([near, np.roll(near, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends = np.concatenate([ends, ends[:, ::-1]])
    one, two = ends[moving[ends[:, 0]] & sliding[ends[:, 1]]].T
    gaps = np.linalg.norm(points[one] - points[two], axis=1)
    return float(gaps[gaps > 0.0].min(initial=np.inf))


def needed_by_layers(reduction: GreedySettings | None, gap: float) -> float:
    """Return the tolerance that layers need where that of the reduction is larger; else 0."""
    return LAYER * gap if reduction is not None and reduction.tolerance > LAYER * gap else 0.0


def find_reduction(
    case: Case, extent: float, largest: float, candidates: int, gap: float
) -> GreedySettings | None:
    """Return the settings of the selection of control nodes; None where all candidates are taken.

    Parameters
    ----------
    extent, largest : float
        The extent of the mesh, and the largest displacement.
    candidates : int
        Nodes that could be control nodes.
    gap : float
        The smallest distance between a moving and a sliding node (`sliding_gap`).
    """
    given = case.reduction
    if given is None or case.method != "rbf":
        return None
    if given.auto:
        if candidates <= EXACT_NODES or not largest > 0.0:
            return None
        tolerance = max(min(AUTO_TOLERANCE * largest, LAYER * gap), SMALLEST * largest)
        given = replace(given, tolerance=tolerance, relative=None)
    level: Literal["none", "size", "ratio"] = "none"
    if given.multilevel:
        level = "size" if given.criterion == "size" else "ratio"
    return GreedySettings(
        tolerance=given.relative * extent if given.relative else given.tolerance,
        pick=given.selection,
        level=level,
        level_size=given.level_size,
        level_ratio=given.level_tolerance,
        max_nodes=given.max_nodes,
        gamma=given.gamma,
    )


def loose_warnings(
    case: Case, reduction: GreedySettings | None, largest: float, extent: float, gap: float
) -> list[str]:
    """Return a warning where the tolerance is too large for the motion, or AUTO's for layers."""
    if reduction is None or not largest > 0.0:
        return []
    assert case.reduction is not None
    if case.reduction.auto and (needed := needed_by_layers(reduction, gap)):
        sentence = (
            f"sliding nodes are {gap:.3g} from moving ones, too little for DATA_REDUCTION= AUTO: "
            f"its tolerance is {reduction.tolerance:.3g}, {SMALLEST:g} of the largest "
            "displacement, so that cells between them may be inverted; use DATA_REDUCTION= NO, or "
            f"YES with DATA_RED_TOLERANCE= {needed:.2g}"
        )
        return [sentence]
    if reduction.tolerance <= LOOSE * largest:
        return []
    absolute, relative = f"{largest / 100:.2g}", f"{largest / extent / 100:.2g}"
    remedy = f"use DATA_RED_RELATIVE= {relative} or less"
    if not case.reduction.relative:
        remedy = f"use DATA_RED_TOLERANCE= {absolute} or less (or DATA_RED_RELATIVE= {relative})"
    is_, so = "not below", "no control node is needed to meet it, and only the cells"
    if reduction.tolerance < largest:
        is_, so = "more than a tenth of", "control nodes follow the motion roughly, and the cells"
    sentence = (
        f"the tolerance of the data reduction is {reduction.tolerance:.3g}, {is_} the largest "
        f"displacement, {largest:.3g}: {so} near the boundary take up what is left, which may "
        f"invert them; {remedy}, a hundredth of the displacement"
    )
    return [sentence]
