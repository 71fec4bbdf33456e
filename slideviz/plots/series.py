"""The series of plots: qualities, steps, greedy selections, outcomes of runs."""

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
        Cells to count apart instead of at 0.
    series : int, optional
        Number of its look; its place in the sequence when left out.
    """

    label: str
    values: FloatArray
    inverted: NDArray[np.bool_] | None = None
    series: int | None = None


@dataclass(frozen=True, eq=False)
class Distribution:
    """Counts of the cells of one mesh.

    Attributes
    ----------
    counts : (k,) int64
    edges : (k + 1,) float64
        Of the intervals; what is outside is in the first or the last.
    inverted : int
        Cells that are inverted and in no interval.
    """

    counts: IntArray
    edges: FloatArray
    inverted: int

    @classmethod
    def of(cls, values: FloatArray, edges: FloatArray) -> Distribution:
        """Return the counts of values (m,) in equal intervals; NaN is an inverted cell."""
        right = values[np.isfinite(values)]
        low, high, count = edges[0], edges[-1], len(edges) - 1
        places = np.clip((right - low) * (count / (high - low)), 0, count - 1).astype(np.int64)
        return cls(np.bincount(places, minlength=count), edges, len(values) - len(right))


@dataclass(frozen=True, eq=False)
class Bars:
    """A distribution drawn as bars: its words, and a colour for each bar or for all."""

    label: str
    distribution: Distribution
    colours: Sequence[Any] | None = None


@dataclass(frozen=True, eq=False)
class Outline:
    """A distribution to compare with: its words, and the number of its series.

    ``series`` None is the undeformed mesh, in a thin line of its own.
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
        Number of its look; its place in the sequence when left out.
    """

    label: str
    steps: IntArray
    minimum: FloatArray
    mean: FloatArray
    series: int | None = None


@dataclass(frozen=True, eq=False)
class GreedyRun:
    """Convergence of a greedy selection.

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
        Number of its look; its place in the sequence when left out.
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
        Number of the look of its label; the place of the label among all when left out.
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
