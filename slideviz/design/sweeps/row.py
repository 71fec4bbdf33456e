"""The result of a design, as a row of the table of results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import nan
from pathlib import Path

from slideviz.design.sweeps.columns import Value


@dataclass(frozen=True)
class DesignRow:
    """The result of a design, or the reason why there is none.

    Attributes
    ----------
    design : int
        Its number in the table of designs, from 1.
    values : mapping of str to str or float
        Its values, by column of that table.
    min, mean : float
        Quality of the deformed mesh; NaN where there is none.
    inverted : int
        Inverted cells.
    max_error : float
        Largest error of a boundary node before it is corrected, of all steps, in the mesh's
        length unit.
    control_nodes, steps : int
        Control nodes in the last step, and steps made.
    seconds : float
        Time that the worker spent on it.
    mesh : Path or None
        The file of the deformed mesh, where it was written.
    warnings : tuple of str
    problem : str
        Why there is no result; empty where there is one.
    lost : int
        How often its worker was lost, so that it was done again.
    earlier : bool
        Whether it was done before the sweep was stopped and resumed.
    """

    design: int
    values: Mapping[str, Value] = field(default_factory=dict)
    min: float = nan
    mean: float = nan
    inverted: int = 0
    max_error: float = nan
    control_nodes: int = 0
    steps: int = 0
    seconds: float = 0.0
    mesh: Path | None = None
    warnings: tuple[str, ...] = ()
    problem: str = ""
    lost: int = 0
    earlier: bool = False


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
