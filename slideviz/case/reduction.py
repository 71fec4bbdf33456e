"""The settings of data reduction, and the check of dataclass fields that are enumerations."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

from slideviz.argument_types import check_fields
from slideviz.case.words import not_one_of
from slideviz.errors import CaseError
from slideviz.terms import LEVEL_CRITERIA, SELECTIONS, LevelCriterion, Selection

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def require_chosen(given: DataclassInstance) -> None:
    """Raise where a field that is an enumeration has another value.

    Such a field has the terms of the enumeration as its metadata. Its default is always allowed.

    Raises
    ------
    CaseError
        A value is neither one of the terms nor the default.
    """
    for each in fields(given):
        value, terms = getattr(given, each.name), each.metadata
        if terms and value not in (*terms, each.default):
            raise CaseError(f"{each.name}: {not_one_of(value, terms)}")


@dataclass(frozen=True)
class Reduction:
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
    gamma: float = 25.0
    """Radius of the correction over the largest error (thesis Eq. 2.31); the default is
    `slideviz.rbf.problem.GAMMA`, which holds without data reduction, too."""
    auto: bool = False
    """Select only where the boundary has many nodes, to a tolerance that is a part of the largest
    displacement, whatever ``tolerance`` and ``relative`` are (`slideviz.solver.setup` has both
    numbers)."""

    def __post_init__(self) -> None:
        check_fields(self)
        require_chosen(self)


AUTO = Reduction(auto=True)
"""DATA_REDUCTION= AUTO, the default."""
