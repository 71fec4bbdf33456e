"""The cells that the range of the view leaves, of a section too."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.view.drawing.polygons import Polygons
from slideviz.view.inspect import chosen_cells
from slideviz.view.plots.session_histogram import range_words


@dataclass(frozen=True)
class Choice:
    """Some cells of a mesh; two that choose the same are equal.

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
    def of(cls, values: FloatArray, threshold: tuple[float, float]) -> Choice:
        """Return the cells whose value is in a range (see `chosen_cells`)."""
        mask = np.zeros(len(values), bool)
        mask[chosen_cells(values, threshold)] = True
        mask.flags.writeable = False
        return cls(np.packbits(mask).tobytes(), mask, range_words(threshold))

    def among(self, polygons: Polygons) -> Polygons:
        """Return those polygons whose cells are chosen; their points stay."""
        return polygons.take(np.flatnonzero(self.mask[polygons.cells]))
