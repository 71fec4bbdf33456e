"""Data reduction: from the settings of a case to those of the solver; warnings of loose tolerances.

The text on DATA_REDUCTION in `slideviz.case.reduction_keys` has the two numbers of AUTO in words.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from slideviz.case.model import Case
from slideviz.rbf.problem import GreedySettings

EXACT_NODES = 2000
"""Most candidates with which DATA_REDUCTION= AUTO makes all of them control nodes."""

AUTO_TOLERANCE = 1e-3
"""The tolerance of DATA_REDUCTION= AUTO, as a part of the largest displacement."""

LOOSE = 0.1
"""A tolerance above this part of the largest displacement gets a warning."""


def find_reduction(
    case: Case, extent: float, largest: float, candidates: int
) -> GreedySettings | None:
    """Return the settings of the selection of control nodes; None where all candidates are taken.

    Parameters
    ----------
    extent, largest : float
        The extent of the mesh, and the largest displacement.
    candidates : int
        Nodes that could be control nodes.
    """
    given = case.reduction
    if given is None or case.method != "rbf":
        return None
    if given.auto:
        if candidates <= EXACT_NODES or not largest > 0.0:
            return None
        given = replace(given, tolerance=AUTO_TOLERANCE * largest, relative=None)
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
    case: Case, reduction: GreedySettings | None, largest: float, extent: float
) -> list[str]:
    """Return a warning where the tolerance is not far below the largest displacement; else []."""
    if reduction is None or not largest > 0.0 or reduction.tolerance <= LOOSE * largest:
        return []
    assert case.reduction is not None
    whole, part = f"{largest / 100:.2g}", f"{largest / extent / 100:.2g}"
    remedy = f"use DATA_RED_RELATIVE= {part} or less"
    if not case.reduction.relative:
        remedy = f"use DATA_RED_TOLERANCE= {whole} or less (or DATA_RED_RELATIVE= {part})"
    is_, so = "not below", "no control node is needed to meet it, and only the cells"
    if reduction.tolerance < largest:
        is_, so = "more than a tenth of", "control nodes follow the motion roughly, and the cells"
    sentence = (
        f"the tolerance of the data reduction is {reduction.tolerance:.3g}, {is_} the largest "
        f"displacement, {largest:.3g}: {so} near the boundary take up what is left, which may "
        f"invert them; {remedy}, a hundredth of the displacement"
    )
    return [sentence]
