"""The stiffness of the mesh as an elastic body, with its conditions, as SU2 has it.

Young's modulus of a cell is the inverse of its volume, Poisson's ratio 0.3, plane strain in two
dimensions (SU2's DEFORM_STIFFNESS_TYPE= INVERSE_VOLUME and DEFORM_POISSONS_RATIO). Conditions
enter while the matrix is added up, node by node: the displacement of node i is

    u_i = T_i z_k + g_i,      k = place_i

with T_i = R_i P_k: P_k projects on the directions in which the node is free, R_i turns its
periodic image into it. Known nodes have no place, only g_i. The matrix stays symmetric and its
blocks stay d by d, which the multigrid solver likes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csr_array

from slideviz.baselines import element_loops
from slideviz.baselines.shapes import Block
from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Tick, no_tick

CHUNK = 20_000
"""Elements between two calls of ``tick``: some tens of milliseconds."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """What the nodes may do.

    Attributes
    ----------
    place : (n,) int64
        Number of the block of unknowns of each node; -1 for known ones. Images share one.
    turn : (n, d, d) float64
        T_i; the identity for most.
    plain : (n,) bool
        Whether T_i is the identity.
    known : (n, d) float64
        g_i.
    free : (k, d, d) float64
        P_k of each block of unknowns.
    """

    place: IntArray
    turn: FloatArray
    plain: np.ndarray
    known: FloatArray
    free: FloatArray


def assemble(
    points: FloatArray, parts: list[Block], conditions: Conditions, tick: Tick = no_tick
) -> tuple[bsr_array, FloatArray]:
    """Return the matrix (k d, k d) and the right-hand side (k d,) of the unknowns z.

    Parameters
    ----------
    points : (n, d)
        Current positions. Folded elements count with the size of their Jacobian, so that the
        matrix stays positive definite.

    Raises
    ------
    DeformError
        An element has no volume.
    """
    count, d = len(conditions.free), points.shape[1]
    indptr, indices = _pattern(parts, conditions.place, count)
    data = np.zeros((len(indices), d, d))
    right = np.zeros((count, d))
    entry = conditions.place, conditions.turn, conditions.plain, conditions.known
    total = sum(len(part.nodes) for part in parts)
    done = 0
    volume = np.zeros(max((int(p.cell.max(initial=-1)) + 1 for p in parts), default=0))
    for part in parts:
        each = np.empty(len(part.nodes))
        given = points, part.nodes, part.shape.gradients, part.shape.weights
        element_loops.volumes(*given, each)
        np.add.at(volume, part.cell, part.share * each)
    for part in parts:
        for start in range(0, len(part.nodes), CHUNK):
            rows = slice(start, start + CHUNK)
            with np.errstate(divide="ignore"):  # found below
                modulus = part.share / volume[part.cell[rows]]
            elements = points, part.nodes[rows], part.shape.gradients, part.shape.weights
            bad = element_loops.add(elements, modulus, entry, (indptr, indices), data, right)
            if bad >= 0:
                raise DeformError(
                    f"cell {part.cell[start + bad]} has no volume, so linear elasticity cannot "
                    "give it a stiffness; use more STEPS, or METHOD= rbf, or repair the mesh"
                )
            done += len(part.nodes[rows])
            tick(done / total)
    _hold(indptr, indices, data, conditions.free)
    matrix = bsr_array((data, indices, indptr), shape=(count * d, count * d))
    return matrix, right.ravel()


def _pattern(parts: list[Block], place: IntArray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return indptr and indices of the blocks: which unknowns share an element."""
    rows, columns, offset = [], [], 0
    for part in parts:
        at = place[part.nodes]
        element = offset + np.arange(len(at))[:, None] + np.zeros_like(at)
        rows.append(at[at >= 0])
        columns.append(element[at >= 0])
        offset += len(at)
    row = np.concatenate(rows).astype(np.int32)
    column = np.concatenate(columns).astype(np.int32)
    touches = csr_array((np.ones(len(row), np.int32), (row, column)), shape=(count, offset))
    touches.data[:] = 1
    pattern = csr_array(touches @ touches.T)
    pattern.sort_indices()
    return pattern.indptr, pattern.indices


def _hold(indptr: np.ndarray, indices: np.ndarray, data: FloatArray, free: FloatArray) -> None:
    """Add stiffness in the directions in which blocks of unknowns may not move, in place."""
    held = np.eye(free.shape[1]) - free
    rows = np.flatnonzero(np.any(held != 0, axis=(1, 2)))
    row_of = np.repeat(np.arange(len(free)), np.diff(indptr))
    diagonal = np.flatnonzero(row_of == indices)[rows]
    there = data[diagonal]
    size = np.einsum("kii->k", there) / np.maximum(np.einsum("kii->k", free[rows]), 1.0)
    data[diagonal] += np.where(size > 0, size, 1.0)[:, None, None] * held[rows]
