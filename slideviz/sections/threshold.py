"""The cells within the threshold of the view, of a section too."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.sections.polygons import Polygons

ONLY_INVERTED = (-1.0, -0.5)
"""A range that no value is in: it chooses the inverted cells alone."""


@dataclass(frozen=True)
class CellsInRange:
    """The cells of a mesh within a threshold; two of the same cells are equal.

    Attributes
    ----------
    key : bytes
        Which they are, packed.
    mask : (m,) bool
        The same for every cell.
    words : str
        Which values they have.
    """

    key: bytes
    mask: np.ndarray = field(compare=False, repr=False)
    words: str = field(compare=False)

    @classmethod
    def of(cls, values: FloatArray, threshold: tuple[float, float]) -> CellsInRange:
        """Return the cells whose value is in a range (see `cells_in_range`)."""
        mask = np.zeros(len(values), bool)
        mask[cells_in_range(values, threshold)] = True
        mask.flags.writeable = False
        return cls(np.packbits(mask).tobytes(), mask, range_words(threshold))

    def among(self, polygons: Polygons) -> Polygons:
        """Return the polygons whose cells are in the range; their points stay."""
        return polygons.take(np.flatnonzero(self.mask[polygons.cells]))


def cells_in_range(values: FloatArray, threshold: tuple[float, float]) -> IntArray:
    """Return the cells whose value is in a closed range, in rising order.

    Parameters
    ----------
    values : (m,) float64
        As ``Frame.shown_values`` gives them: not a number for an inverted cell.
    threshold : (float, float)
        Lowest and highest value. From 0 or below, inverted cells are too.
    """
    low, high = threshold
    inside = (values >= low) & (values <= high)
    return np.flatnonzero(inside | np.isnan(values) if low <= 0.0 else inside)


def range_words(threshold: tuple[float, float]) -> str:
    """Return a range in words."""
    if threshold[1] < 0.0:
        return "inverted cells"
    return f"{threshold[0]:.3g} to {threshold[1]:.3g}"
