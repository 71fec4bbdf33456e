"""The data of plots: qualities, steps, greedy selections, outcomes of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class QualityRun:
    """Qualities of the cells of one mesh.

    Attributes
    ----------
    label : str
    values : (m,) float64
        0 to 1.
    inverted : (m,) bool, optional
        Cells to count apart, whatever their value.
    series : int, optional
        Series number (see `slideviz.plots.style.Style.series`); by default its index in the plot.
    """

    label: str
    values: FloatArray
    inverted: NDArray[np.bool_] | None = None
    series: int | None = None


@dataclass(frozen=True, eq=False)
class Distribution:
    """The number of cells of one mesh in intervals of a value.

    Attributes
    ----------
    counts : (k,) int64
    edges : (k + 1,) float64
        Limits of the intervals; values outside are counted in the first or the last.
    inverted : int
        Number of inverted cells, which are in no interval.
    """

    counts: IntArray
    edges: FloatArray
    inverted: int

    @classmethod
    def of(cls, values: FloatArray, edges: FloatArray) -> Distribution:
        """Return the distribution of values (m,) in equal intervals; NaN is an inverted cell."""
        right = values[np.isfinite(values)]
        low, high, count = edges[0], edges[-1], len(edges) - 1
        places = np.clip((right - low) * (count / (high - low)), 0, count - 1).astype(np.int64)
        return cls(np.bincount(places, minlength=count), edges, len(values) - len(right))


@dataclass(frozen=True, eq=False)
class Bars:
    """A distribution drawn as bars: its label, and a color per bar (or a list of one for all)."""

    label: str
    distribution: Distribution
    colors: Sequence[Any] | None = None


@dataclass(frozen=True, eq=False)
class Outline:
    """A distribution drawn as an outline, with its label and series number.

    ``series`` None is the undeformed mesh, drawn as a thin dotted line.
    """

    label: str
    distribution: Distribution
    series: int | None


@dataclass(frozen=True, eq=False)
class StepRun:
    """Quality after each step of a run.

    Attributes
    ----------
    label : str
    steps : (k,) int64
        Numbers of the steps; 0 is the undeformed mesh.
    minimum, mean : (k,) float64
    series : int, optional
        Series number (see `slideviz.plots.style.Style.series`); by default its index in the plot.
    """

    label: str
    steps: IntArray
    minimum: FloatArray
    mean: FloatArray
    series: int | None = None


@dataclass(frozen=True, eq=False)
class GreedyRun:
    """The convergence of a greedy selection, cycle by cycle.

    Attributes
    ----------
    label : str
    control_nodes : (c,) int64
    error : (c,) float64
        Largest error of the boundary after each cycle, in the mesh's length unit.
    level : (c,) int64
        Number of the level of each cycle.
    tolerance : float or None
    series : int, optional
        Series number (see `slideviz.plots.style.Style.series`); by default its index in the plot.
    """

    label: str
    control_nodes: IntArray
    error: FloatArray
    level: IntArray
    tolerance: float | None = None
    series: int | None = None


@dataclass(frozen=True)
class Outcome:
    """The outcome of one run.

    Attributes
    ----------
    label : str
        The combination of methods; runs of one label are joined by a line.
    steps : int
    minimum, mean : float
    inverted : int
        Inverted cells.
    seconds : float
        Processor time of the deformation.
    control_nodes : int
    max_error : float
        In the mesh's length unit.
    series : int, optional
        Series number of its label; by default the index of the label among all labels.
    """

    label: str
    steps: int
    minimum: float
    mean: float
    inverted: int = 0
    seconds: float = float("nan")
    control_nodes: int = 0
    max_error: float = float("nan")
    series: int | None = None
