"""The settings of data reduction: which of the boundary nodes are control nodes."""

from __future__ import annotations

from dataclasses import field

from slideviz.argument_types import CheckedFields, frozen
from slideviz.terms import LEVEL_CRITERIA, SELECTIONS, LevelCriterion, Selection

GAMMA = 25.0
"""Radius of the boundary correction over the largest error (Eq. 2.31), where nothing else is set,
with data reduction and without."""


@frozen
class Reduction(CheckedFields):
    """Settings of the greedy selection of control nodes (thesis sections 2.5 and 5.3)."""

    tolerance: float = 1e-3
    """Largest error at boundary nodes that is left to the correction, in the mesh's length unit."""
    multilevel: bool = False
    """Select in levels instead of all at once."""
    criterion: LevelCriterion = field(default="size", metadata=LEVEL_CRITERIA)
    """A level ends at ``level_size`` nodes, or when its error has shrunk by the factor
    ``level_tolerance``."""
    level_tolerance: float = 0.5
    level_size: int = 16
    selection: Selection = field(default="block", metadata=SELECTIONS)
    """Nodes taken in a cycle: a growing number of them; the one of largest error and the one of
    largest error in an opposite direction; or the one of largest error."""
    relative: float | None = None
    """The tolerance as a part of the mesh's largest extent, instead of ``tolerance``."""
    max_nodes: int | None = None
    """Stop at so many control nodes, whatever the error."""
    gamma: float = GAMMA
    """Radius of the correction over the largest error (thesis Eq. 2.31)."""
    auto: bool = False
    """Select only where the boundary has many nodes, to a tolerance that is a part of the largest
    displacement, whatever ``tolerance`` and ``relative`` are (`slideviz.solver.setup` has both
    numbers)."""


AUTO = Reduction(auto=True)  # DATA_REDUCTION= AUTO, the default
