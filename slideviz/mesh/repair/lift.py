"""Lift of the worst quality: a function that rises without bound as a cell comes near a limit.

``Σ Q / (beta - Q)`` with Q = 1 / quality, and beta a little above the largest Q: as the worst-case
metric of MFEM's TMOP.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slideviz.mesh.jacobian_slopes import write_slopes
from slideviz.mesh.jacobians import CORNERS, INVERTED
from slideviz.mesh.model import FloatArray
from slideviz.mesh.quality import cell_quality
from slideviz.mesh.repair.energy import Targets
from slideviz.mesh.repair.patches import Patch
from slideviz.mesh.skew import EXPONENTS
from slideviz.terms import SkewMetric


def lift_energy(
    patch: Patch,
    unknowns: FloatArray,
    signs: NDArray[np.int8],
    sums: FloatArray,
    sized: bool,
    metric: SkewMetric,
    beta: float,
) -> tuple[float, FloatArray]:
    """Return the sum over the cells of a patch, and its gradient (b, d); infinity beyond beta.

    ``signs``, ``sums`` (m,): of the patch's cells, in its order, as `reference_of` in
    `slideviz.mesh.orientation` has them. ``sized``: whether the quality compares sizes: whether
    there is an undeformed mesh.
    """
    points = patch.points(unknowns)

    def work(part: Targets, here: slice, whole: slice, slopes: FloatArray) -> None:
        cells = slice(whole.start + here.start, whole.start + here.stop)
        nodes = part.nodes[here]
        turn = signs[cells]
        before = sums[cells]
        size, skew, status = cell_quality(points, part.vtk, nodes, turn, before, metric)
        with np.errstate(all="ignore"):
            inverse = 1.0 / (np.sqrt(size) * skew if sized else skew)
            good = (status != INVERTED) & (inverse < beta)
            gap = beta - inverse
            patch.values[cells] = np.where(good, inverse / gap, np.inf)
            powers = np.array(EXPONENTS[metric][part.vtk], float)
            compared = before if sized else np.full(len(nodes), np.inf)
            write_slopes(
                part.vtk, points, nodes, CORNERS[part.vtk], turn, powers, compared, slopes[here]
            )
            slopes[here] *= np.where(good, -beta * inverse / gap**2, 0.0)[:, None, None]

    patch.of_cells(work)
    return float(patch.values.sum()), patch.gathered()
