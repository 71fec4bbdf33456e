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
    """Qualities of the cells of one mesh."""

    label: str
    values: FloatArray  # (m,): 0 to 1
    inverted: NDArray[np.bool_] | None = None  # (m,): cells to count apart, whatever their value
    series: int | None = None
    """Series number (see `slideviz.plots.style.Style.series`); by default its index in the plot."""


@dataclass(frozen=True, eq=False)
class Distribution:
    """The number of cells of one mesh in intervals of a value."""

    counts: IntArray  # (k,)
    edges: FloatArray
    """(k + 1,): limits of the intervals; values outside are counted in the first or the last."""
    inverted: int  # number of inverted cells, which are in no interval

    @classmethod
    def of(cls, values: FloatArray, edges: FloatArray) -> Distribution:
        """Return the distribution of values (m,) in equal intervals; NaN is an inverted cell."""
        right = values[np.isfinite(values)]
        low = edges[0]
        high = edges[-1]
        count = len(edges) - 1
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
    """Quality after each step of a run."""

    label: str
    steps: IntArray  # (k,): numbers of the steps; 0 is the undeformed mesh
    minimum: FloatArray  # (k,)
    mean: FloatArray  # (k,)
    series: int | None = None
    """Series number (see `slideviz.plots.style.Style.series`); by default its index in the plot."""


@dataclass(frozen=True, eq=False)
class GreedyRun:
    """The convergence of a greedy selection, cycle by cycle."""

    label: str
    control_nodes: IntArray  # (c,)
    error: FloatArray
    """(c,): largest error of the boundary after each cycle, in the mesh's length unit."""
    level: IntArray  # (c,): number of the level of each cycle
    tolerance: float | None = None
    series: int | None = None
    """Series number (see `slideviz.plots.style.Style.series`); by default its index in the plot."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of one run."""

    label: str  # the combination of methods; runs of one label are joined by a line
    steps: int
    minimum: float
    mean: float
    inverted: int = 0  # inverted cells
    seconds: float = float("nan")  # processor time of the deformation
    series: int | None = None
    """Series number of its label; by default the index of the label among all labels."""
