"""The threshold of the view: the cells whose value is in a range, also those of sections."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.sections.polygons import Polygons

ONLY_INVERTED = (-1.0, -0.5)
"""The threshold for inverted cells alone: a range from below 0, which no value is in."""


@dataclass(frozen=True)
class CellsInRange:
    """The cells of a mesh within a threshold; instances with the same cells are equal."""

    key: bytes
    """The mask, packed to bits, for comparing and hashing."""
    mask: np.ndarray = field(compare=False, repr=False)
    """(m,): whether each cell is within."""
    words: str = field(compare=False)
    """The range in words."""

    @classmethod
    def of(cls, values: FloatArray, threshold: tuple[float, float]) -> CellsInRange:
        """Return the cells whose value is in a range (see `cells_in_range`)."""
        mask = np.zeros(len(values), bool)
        mask[cells_in_range(values, threshold)] = True
        mask.flags.writeable = False
        return cls(np.packbits(mask).tobytes(), mask, range_words(threshold))

    def among(self, polygons: Polygons) -> Polygons:
        """Return the polygons whose cells are in the range; all points stay."""
        return polygons.take(np.flatnonzero(self.mask[polygons.cells]))


def cells_in_range(values: FloatArray, threshold: tuple[float, float]) -> IntArray:
    """Return the ascending numbers of the cells whose value is in a closed range.

    Parameters
    ----------
    values : (m,) float64
        Values of the cells, nan for an inverted cell, as of ``Frame.shown_values``.
    threshold : (float, float)
        Lowest and highest value. Where the lowest is 0 or below, inverted cells are in, too.
    """
    low, high = threshold
    inside = (values >= low) & (values <= high)
    return np.flatnonzero(inside | np.isnan(values) if low <= 0.0 else inside)


def range_words(threshold: tuple[float, float]) -> str:
    """Return a threshold in words."""
    if threshold[1] < 0.0:
        return "inverted cells"
    return f"{threshold[0]:.3g} to {threshold[1]:.3g}"
