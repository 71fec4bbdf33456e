"""How many cells of a frame have which value."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.plots.series import Distribution
from slideviz.session.state import Frame
from slideviz.terms import ColourBy

BINS = 25
"""So many that a step of an outline is wide enough for its dashes in a panel of the window."""


def distribution(
    frame: Frame,
    what: ColourBy,
    limits: tuple[float, float] = (0.0, 1.0),
    undeformed: Mesh | None = None,
) -> Distribution:
    """Return the counts of the cells of a frame in `BINS` equal intervals between limits."""
    edges = np.linspace(*limits, BINS + 1)
    return Distribution.of(_values(frame, what, undeformed), edges)


def spread(
    frame: Frame, what: ColourBy, undeformed: Mesh | None = None
) -> tuple[float, float] | None:
    """Return the lowest and the highest value of the cells of a frame; None if all are inverted."""
    values = _values(frame, what, undeformed)
    right = values[np.isfinite(values)]
    return (float(right.min()), float(right.max())) if len(right) else None


def _values(frame: Frame, what: ColourBy, undeformed: Mesh | None) -> FloatArray:
    """Return the values of the cells of a frame without those of a halo."""
    return np.asarray(frame.shown_values(what, undeformed)[frame.quality.counted])
