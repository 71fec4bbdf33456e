"""The result of a design, as a row of the table of results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import nan
from pathlib import Path

from slideviz.design.sweeps.columns import Value


@dataclass(frozen=True)
class DesignRow:
    """The result of a design, or the reason why there is none."""

    design: int
    """Its number in the table of designs, from 1."""
    values: Mapping[str, Value] = field(default_factory=dict)
    """Its values, by column of that table."""
    min: float = nan
    mean: float = nan
    """`min`, `mean`: quality of the deformed mesh; NaN where there is none."""
    inverted: int = 0
    """Inverted cells."""
    max_error: float = nan
    """Largest error of a boundary node before it is corrected, of all steps, in the mesh's length
    unit."""
    control_nodes: int = 0
    steps: int = 0
    """`control_nodes`, `steps`: control nodes in the last step, and steps made."""
    seconds: float = 0.0
    """Time that the worker spent on it."""
    mesh: Path | None = None
    """The file of the deformed mesh, where it was written."""
    warnings: tuple[str, ...] = ()
    problem: str = ""
    """Why there is no result; empty where there is one."""
    lost: int = 0
    """How often its worker was lost, so that it was done again."""
    earlier: bool = False
    """Whether it was done before the sweep was stopped and resumed."""


NUMBERS: Mapping[str, tuple[str, Callable[[str], float]]] = {
    "min": ("lowest quality", float),
    "mean": ("mean quality", float),
    "inverted": ("inverted cells", int),
    "max_error": ("largest error of the boundary before it is corrected", float),
    "control_nodes": ("control nodes in the last step", int),
    "steps": ("steps made", int),
    "seconds": ("seconds that the worker spent", float),
}
"""The numbers of a result, in the order of their columns: meaning, and how a cell is read."""
