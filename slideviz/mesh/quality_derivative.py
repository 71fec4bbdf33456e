"""Derivatives of the smooth minimum and of the mean of the quality by the points of a mesh.

Where all corners are positive, each metric is a constant divided by ``Σ_k t_k``, with
``t_k = s_kᵃ / α_kᵇ`` of the spread s and the Jacobian α of corner k
(`slideviz.mesh.skew.EXPONENTS`). So, with ``θ_k = t_k / Σ t``, the differential of the
logarithm of size-skew (``f_ss``, `slideviz.mesh.quality`) is

    d ln f_ss = Σ_k θ_k (b dα_k / α_k - a ds_k / s_k) ± ½ Σ_k dα_k / Σ_k α_k

with + for a cell that is smaller than the undeformed one, - for one that is larger.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.jacobian_slopes import add_to_points, pull_coefficients, write_slopes
from slideviz.mesh.jacobians import CORNER_AT, CORNERS, INVERTED, coefficients, coords_of, corners
from slideviz.mesh.model import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    Signs,
    frozen_array,
    mask_of,
    sealed,
)
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.skew import EXPONENTS
from slideviz.system.threads import PART, cores, in_parts, ordered_map

if TYPE_CHECKING:
    from slideviz.mesh.quality import Quality

FOLDED_AT_ONCE = 4096  # inverted cells whose coefficients (up to 27 each) are in memory at a time


@record
class QualityDerivative:
    """The smooth minimum and the mean of the quality, and their derivatives by the points.

    The *smooth minimum* of the qualities q of all cells is ``(Σ q^-p)^(-1/p)``. It is never above
    the minimum, and not below it by more than the factor ``n^(-1/p)``, n the number of cells
    about as bad as the worst (0.96 for ten and p = 50).

    Inverted cells have quality 0, whose derivative leads nowhere. While a cell is inverted, the
    smooth minimum is ``-(Σ |b|^p)^(1/p)`` instead: b are the corner Jacobians that are not
    positive, divided by the mean corner Jacobian of the undeformed cell; for a prism or hexahedron
    that is folded inside, between positive corners, the Bernstein coefficients that are not
    positive. So it is finite, 0 or below as long as a cell is inverted, lower the further cells are
    folded, and its derivative points to where they unfold. It is continuous where a corner folds.
    """

    p: float
    """The exponent."""
    minimum: float
    mean: float
    """`minimum`, `mean`: the smooth minimum, and the mean as `Quality` has it, where inverted cells
    count as 0."""
    of_minimum: FloatArray
    of_mean: FloatArray
    """`of_minimum`, `of_mean` (n, d): their derivatives by the points, per unit of length.
    Inverted cells add nothing to that of the mean. Where a cell is as large as the undeformed
    one, at the kink of ``min(τ, 1/τ)``, its factor of size adds 0, the mean of both sides. Else
    all are exact."""


def derivative_of(
    mesh: Mesh,
    found: Quality,
    sums: FloatArray | None,
    p: float,
    going_on: Callable[[], object],
) -> QualityDerivative:
    """Return the smooth minimum and the mean of a mesh's quality, with their derivatives.

    ``found`` is the quality of the deformed mesh, ``p`` the exponent of the smooth minimum.
    ``sums`` (m,): those of the corner Jacobians of the undeformed cells. None if there is no
    undeformed mesh: there is no factor of size then, and Jacobians of inverted cells are not
    divided by a mean. ``going_on`` is called every few thousand cells; what it raises ends the
    work. Raises MeshError if a point is not finite, or an undeformed cell has no positive volume to
    compare with, and CaseError if the exponent is below 1 or no number.
    """
    _check_exponent(p)
    _check(mesh, found, sums)
    counted = mask_of(len(found), found.counted)
    folded = counted & (found.status == INVERTED)
    counted &= ~folded
    gradients = np.zeros((2, *mesh.points.shape))
    if folded.any():
        minimum = _unfold(mesh, found, sums, folded, p, gradients[0])
        shares = np.zeros(len(found))
    else:
        minimum, shares = _smooth_minimum(found.values, counted, p)
    weights = np.array([shares, np.where(counted, found.values / found.cells, 0.0)])
    _add_slopes(mesh, found, sums, weights, gradients, going_on)
    if not np.isfinite(gradients).all():
        raise MeshError(
            f"the derivative of the quality of {mesh.name} is too large for a number: a cell is "
            f"flat to rounding (lowest quality {found.min:g}); move its nodes apart"
        )
    return QualityDerivative(
        p=float(p),
        minimum=minimum,
        mean=found.mean,
        of_minimum=frozen_array(gradients[0]),
        of_mean=frozen_array(gradients[1]),
    )


def _check_exponent(p: float) -> None:
    """Raise CaseError if the exponent of a smooth minimum is below 1 or no number."""
    if not 1 <= p < np.inf:
        raise CaseError(
            f"the exponent of the smooth minimum is p = {p}; give a finite p >= 1, e.g. 50"
        )


def _check(mesh: Mesh, found: Quality, sums: FloatArray | None) -> None:
    """Raise MeshError if a point is not finite, or an undeformed cell has no positive volume."""
    wrong = ~np.isfinite(mesh.points).all(axis=1)
    if wrong.any():
        node = int(wrong.argmax())
        raise MeshError(
            f"point {node} of {mesh.name} is {mesh.points[node].tolist()}; the derivative of the "
            "quality needs numbers"
        )
    if sums is not None:
        flat = np.zeros(len(sums), bool)
        flat[found.counted] = ~(sums[found.counted] > 0)
        if flat.any():
            raise MeshError(_flat_sentence(int(flat.argmax()), mesh))


def _flat_sentence(cell: int, mesh: Mesh) -> str:
    """Return the message that an undeformed cell has no positive volume."""
    return (
        f"cell {mesh.cell_number(cell)} of the undeformed mesh has no positive volume to compare "
        f"{mesh.name} with; repair it, or leave out the reference"
    )


def _smooth_minimum(values: FloatArray, counted: BoolArray, p: float) -> tuple[float, FloatArray]:
    """Return ``(Σ q^-p)^(-1/p)`` of the values q of ``counted`` cells, and its derivatives by ln q.

    The derivatives are (m,), 0 for cells that are not counted.
    """
    # A product of tiny factors may have become 0.
    q = np.maximum(values[counted], np.finfo(float).tiny)
    least = float(q.min())
    ratio = (least / q) ** p
    minimum = least * float(ratio.sum()) ** (-1 / p)
    shares = np.zeros(len(values))
    shares[counted] = minimum * (ratio / ratio.sum())
    return minimum, shares


def _add_slopes(
    mesh: Mesh,
    found: Quality,
    sums: FloatArray | None,
    weights: FloatArray,
    gradients: FloatArray,
    going_on: Callable[[], object],
) -> None:
    """Add the derivatives of ln f_ss of all cells, times ``weights`` (w, m), to ``gradients``.

    ``gradients`` are (w, n, d): one sum over the cells for each of w sets of weights.
    """
    lanes = cores()
    batch = PART * max(8, 2 * lanes)
    with ThreadPoolExecutor(lanes) as pool:
        for vtk, (ids, nodes) in mesh.cells.by_type.items():
            for first in range(0, len(ids), batch):
                going_on()
                here = ids[first : first + batch]
                of_these = nodes[first : first + batch]
                slopes = _slopes(mesh, found, sums, vtk, here, of_these)
                part = np.ascontiguousarray(weights[:, here])
                add = partial(add_to_points, sealed(of_these), part, slopes)
                list(pool.map(add, range(lanes), [lanes] * lanes, [gradients] * lanes))


def _slopes(
    mesh: Mesh, found: Quality, sums: FloatArray | None, vtk: int, ids: IntArray, nodes: IntArray
) -> FloatArray:
    """Return the derivatives (m, n, d) of ln f_ss of cells ``ids`` (m,) by their nodes (m, n)."""
    table = CORNERS[vtk]
    powers = np.array(EXPONENTS[found.metric][vtk], float)
    turn = found.signs[ids]
    before = np.full(len(ids), np.inf) if sums is None else sums[ids]
    out = np.empty((*nodes.shape, mesh.dim))

    def write(part: slice) -> None:
        of_part = turn[part], powers, before[part], out[part]
        write_slopes(vtk, mesh.points, nodes[part], table, *of_part)

    in_parts(write, len(ids))
    return out


def _unfold(
    mesh: Mesh,
    found: Quality,
    sums: FloatArray | None,
    folded: BoolArray,
    p: float,
    gradient: FloatArray,
) -> float:
    """Return the smooth minimum for ``folded`` cells (mask (m,)); add its derivative to (n, d)."""
    parts = []
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        of_type = np.flatnonzero(folded[ids])
        for first in range(0, len(of_type), FOLDED_AT_ONCE):
            some = of_type[first : first + FOLDED_AT_ONCE]
            scale = found.signs[ids[some]].astype(float)
            if sums is not None:
                scale *= len(CORNERS[vtk]) / sums[ids[some]]
            parts.append((vtk, nodes[some], scale))
    # ``scale`` times a cell's Jacobians, as its sign is in it, is positive where the cell is valid.
    depths = [_depths(vtk, coords_of(mesh.points[nodes]), scale) for vtk, nodes, scale in parts]
    deepest = max(float(depth.max()) for depth in depths)
    if deepest > 0:
        shares = [np.where(depth > 0, depth / deepest, 0.0) for depth in depths]
        norm = sum(float((share**p).sum()) for share in shares) ** (1 / p)
        shares = [np.where(share > 0, (share / norm) ** (p - 1), 0.0) for share in shares]
    else:  # all are exactly 0: equal shares
        norm = 1.0
        flat = sum(int((depth == 0).sum()) for depth in depths)
        shares = [(depth == 0) / flat for depth in depths]
    for (vtk, nodes, scale), share in zip(parts, shares, strict=True):
        np.add.at(gradient, nodes, _by_nodes(mesh, vtk, nodes, share * scale))
    return -deepest * norm


def _depths(vtk: int, at: FloatArray, scale: FloatArray) -> FloatArray:
    """Return minus each scaled coefficient (k, m) of inverted cells, and -1 for positive ones.

    Coefficients that are not corner Jacobians count only where all of these are positive: they may
    be negative in a valid cell, and there would be a jump where the first corner folds.
    """
    depths = coefficients(vtk, at)
    outer = CORNER_AT[vtk]
    # As those that a cell is inverted by, to the last bit.
    jacobians = np.empty((len(outer), at.shape[2]))
    corners(at, CORNERS[vtk], at.shape[2], jacobians)
    depths[outer] = jacobians
    depths *= -scale
    depths[~(depths >= 0)] = -1.0
    inner = np.delete(np.arange(len(depths)), outer)
    depths[np.ix_(inner, (depths[outer] >= 0).any(axis=0))] = -1.0
    return depths


def _by_nodes(mesh: Mesh, vtk: int, nodes: IntArray, weights: FloatArray) -> FloatArray:
    """Return the derivatives (m, n, d) of ``Σ_k weights_k coefficients_k`` by the nodes (m, n)."""
    out = np.empty((*nodes.shape, mesh.dim))
    pull_coefficients(vtk, mesh.points, nodes, CORNERS[vtk], weights, out)
    return out


LEAST_SCALE = 0.1
"""Smallest value that a coefficient is divided by, over the mean one of the undeformed cell."""
NEGLIGIBLE = 1e-20
"""Share of a cell in the smooth minimum of the margins below which it is left out."""


@record
class SmoothMargin:
    """The smooth minimum of the margins of all cells, and its derivative by the points.

    The *margin* of a cell is the smallest of its Jacobian's coefficients, each over the value it
    had before: 1 for a cell that is only moved, 0 where it folds. Coefficients are the corner
    Jacobians and, of prisms and hexahedra, the other Bernstein coefficients: while all margins are
    positive, all cells are proved valid. (Coefficients below a tenth of the mean one of the
    undeformed cell are divided by that tenth.) The smooth minimum of the coefficients r of all
    cells is ``(Σ r^-p)^(-1/p)``, or where some are negative ``-(Σ |r|^p)^(1/p)`` of these. So it is
    never above the smallest margin.
    """

    p: float  # the exponent
    value: float
    of_points: FloatArray  # (n, d): the derivative by the points, per unit of length


def cell_margins(mesh: Mesh, reference: Mesh) -> FloatArray:
    """Return the margin (m,) of each cell (`SmoothMargin`).

    Raises MeshError if an undeformed cell has no positive volume to compare with.
    """
    out = np.empty(len(mesh.cells))
    blocks = _blocks(mesh)
    _, signs = reference_of(reference)

    def least_of(block: Block) -> FloatArray:
        least: FloatArray = _ratios(mesh, reference, signs, block)[1].min(axis=0)
        return least

    for (_, ids, _), least in zip(blocks, ordered_map(least_of, blocks), strict=True):
        out[ids] = least
    return out


def smooth_margin(mesh: Mesh, reference: Mesh, p: float = 50.0) -> SmoothMargin:
    """Return the smooth minimum of the margins of the cells, with its derivative by the points.

    ``mesh``, ``reference``: the deformed mesh, and the undeformed one, with the same cells. ``p``:
    the exponent. Raises CaseError if it is below 1 or no number, and MeshError if an undeformed
    cell has no positive volume to compare with.
    """
    _check_exponent(p)
    margins = cell_margins(mesh, reference)
    halo = np.zeros(len(margins), bool) if mesh.halo is None else mesh.halo.cells
    least = float(margins[~halo].min())
    total = 0.0
    gradient = np.zeros(mesh.points.shape)
    power = p - 1 if least < 0 else 1
    if least > 0:
        power = p + 1
    _, signs = reference_of(reference)

    def pull(block: Block) -> tuple[float, IntArray, FloatArray]:
        vtk, ids, nodes = block
        factor, ratio = _ratios(mesh, reference, signs, block)
        ratio[:, halo[ids]] = np.inf
        part = np.array(ratio == 0, float)
        if least != 0:
            part = np.maximum(least / ratio if least > 0 else ratio / least, 0.0)
        some = np.flatnonzero(part.max(axis=0) ** power > NEGLIGIBLE)
        part = part[:, some]
        used = nodes[some]
        # The derivatives of the minimum by the ratios, up to a factor that all have.
        weights = np.where(part > 0, part**power, 0.0) * factor[:, some]
        return float((part**p).sum()), used, _by_nodes(mesh, vtk, used, weights)

    for share, used, by_nodes in ordered_map(pull, _blocks(mesh)):  # the order fixes the bits
        total += share
        np.add.at(gradient, used, by_nodes)
    power = -1 / p if least > 0 else 1 / p
    gradient *= total ** (power - 1) if least else 1 / total
    return SmoothMargin(float(p), least * total**power, sealed(gradient))


Block = tuple[int, IntArray, IntArray]
"""Some cells of one type: VTK type, numbers (m,) and nodes (m, n)."""


def _blocks(mesh: Mesh) -> list[Block]:
    return [
        (vtk, ids[first : first + PART], nodes[first : first + PART])
        for vtk, (ids, nodes) in mesh.cells.by_type.items()
        for first in range(0, len(ids), PART)
    ]


def _ratios(
    mesh: Mesh, reference: Mesh, signs: Signs, block: Block
) -> tuple[FloatArray, FloatArray]:
    """Return for each coefficient (k, m) of a block of cells its factor, and the product.

    The factor is the cell's sign over the coefficient's undeformed value.
    """
    vtk, ids, nodes = block
    before = signs[ids] * coefficients(vtk, coords_of(reference.points[nodes]))
    scale = np.maximum(before, LEAST_SCALE * before.mean(axis=0))
    flat = ~(scale > 0).all(axis=0)
    if flat.any():
        raise MeshError(_flat_sentence(int(ids[flat.argmax()]), mesh))
    factor = signs[ids] / scale
    return factor, factor * coefficients(vtk, coords_of(mesh.points[nodes]))
