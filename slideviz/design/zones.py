"""A design of several zones: each zone's deformer, and the rows of the design that it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.rbf.tape import Array, put, take, value
from slideviz.solver.zones import InterfaceMotion

if TYPE_CHECKING:
    from slideviz.design.deformer import Deformer


@dataclass(frozen=True, eq=False)
class ZoneDesign:
    """The deformer of a zone, as a part of that of all zones."""

    number: int  # of the zone, from 1
    points: IntArray  # (n_z,): its points in the mesh of all zones
    rows: IntArray
    """(m_z,): for each of its moving nodes the row of the design that it goes by, which of one that
    follows another zone is that of the other node; -1 where it stays."""
    deformer: Deformer

    def of(self, design: Array) -> Array:
        """Return the rows (..., m_z, d) of a design (..., m, d)."""
        return zone_rows(self.rows, design)


def zone_rows(rows: IntArray, design: Array) -> Array:
    """Return rows (..., m_z, d) of a design (..., m, d), as `ZoneDesign.rows` has them."""
    shape = value(design).shape
    out = np.zeros((*shape[:-2], len(rows), shape[-1]))
    moved = np.flatnonzero(rows >= 0)
    return put(out, moved, take(design, rows[moved]), overwrite=True)


def zone_designs(
    case: Case,
    mesh: Mesh,
    nodes: IntArray,
    references: FloatArray,
    make: Callable[[Mesh, Case, FloatArray], Deformer],
) -> tuple[ZoneDesign, ...]:
    """Return the designs of the zones that move.

    ``nodes`` (m,): the nodes of the design. ``references`` (k, m, d): the designs to choose control
    nodes for. ``make`` returns a deformer for a zone, its case and its designs. Nodes that follow
    a boundary that slides stay: their motion is no displacement of the design.
    """
    motion = InterfaceMotion(case, mesh)
    designs = []
    for index in motion.moving(range(len(motion.cases))):
        part, own = mesh.zone_parts[index], motion.cases[index]
        on = [part.mesh.marker(name).nodes for name in own.markers_with("moving")]
        leaders = motion.leader[np.unique(np.concatenate(on)) + part.points.start]
        place = np.searchsorted(nodes, leaders).clip(max=len(nodes) - 1)
        rows = np.where(nodes[place] == leaders, place, -1)
        deformer = make(part.mesh, own, value(zone_rows(rows, references)))
        points = np.arange(part.points.start, part.points.stop)
        designs.append(ZoneDesign(index + 1, points, rows, deformer))
    return tuple(designs)
