"""A design of several zones: each zone's deformer, and what moves the nodes that it takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh
from slideviz.rbf.tape import Array, put, take, value
from slideviz.solver.interface_motion import InterfaceMotion
from slideviz.solver.prepare import Prepared

if TYPE_CHECKING:
    from slideviz.design.deformer import Deformer

Work = Callable[["Deformer", Array], Array]
"""Returns the points (..., n_z, d) of a zone from its deformer and displacements (..., m_z, d)."""


@dataclass(frozen=True, eq=False)
class ZoneDesign:
    """The deformer of a zone, as a part of that of all zones."""

    number: int  # of the zone, from 1
    points: IntArray  # (n_z,): its points in the mesh of all zones
    rows: IntArray
    """(m_z,): for each of its moving nodes the row of the design that it goes by, which of one that
    follows another zone is that of the other node; -1 where there is none."""
    led: IntArray
    leaders: IntArray
    """`led`, `leaders` (f,): moving nodes that follow sliding nodes of zones before it, by their
    place among its own, and the nodes that they follow, by their number in the mesh."""
    deformer: Deformer

    def moved(self, design: Array, points: Array, start: FloatArray) -> Array:
        """Return the displacements (..., m_z, d) of its moving nodes, from those of a design.

        ``design`` (..., m, d). ``points`` (..., n, d): of all zones, those before it deformed,
        which were at ``start`` (n, d).
        """
        shift = take(points, self.leaders) - start[self.leaders]
        return put(zone_rows(self.rows, design), self.led, shift, overwrite=True)


def zone_rows(rows: IntArray, design: Array) -> Array:
    """Return rows (..., m_z, d) of a design (..., m, d), as `ZoneDesign.rows` has them."""
    shape = value(design).shape
    out = np.zeros((*shape[:-2], len(rows), shape[-1]))
    moved = np.flatnonzero(rows >= 0)
    return put(out, moved, take(design, rows[moved]), overwrite=True)


def over_zones(zones: Sequence[ZoneDesign], start: FloatArray, design: Array, work: Work) -> Array:
    """Return the points (..., n, d) of all zones, each by ``work`` after those that it follows.

    A zone that stays is at ``start`` (n, d). ``design`` (..., m, d).
    """
    out: Array = start
    for zone in zones:
        out = put(out, zone.points, work(zone.deformer, zone.moved(design, out, start)))
    return out


def zone_designs(
    prepared: Prepared,
    mesh: Assembly,
    nodes: IntArray,
    references: FloatArray,
    make: Callable[[Mesh, Case, FloatArray], Deformer],
) -> tuple[ZoneDesign, ...]:
    """Return the designs of the zones that move, in the order in which a run deforms them.

    ``nodes`` (m,): the nodes of the design. ``references`` (k, m, d): the designs to choose control
    nodes for. ``make`` returns a deformer for a zone, its case and its designs.
    """
    motion = InterfaceMotion(prepared, mesh)
    designs = list[ZoneDesign]()
    shared = np.concatenate([nodes[:0], *(each.nodes for each in motion.interfaces)])
    shift = np.zeros((len(references), *mesh.points.shape))
    deformed = np.zeros(len(mesh.points), bool)
    for index, ahead in motion.leaders_first():
        part = mesh.parts[index]
        own = motion.cases[index]
        points = np.arange(part.points.start, part.points.stop)
        on = [part.mesh.marker(name).nodes for name in own.markers_with("moving")]
        mine = np.unique(np.concatenate(on)) + part.points.start
        leaders = motion.leader[mine]
        place = np.searchsorted(nodes, leaders).clip(max=len(nodes) - 1)
        rows = np.where(nodes[place] == leaders, place, -1)
        # Rims that are kept on walls go otherwise than the design says.
        follows = motion.led[mine] & ((rows < 0) | (own.rims == "slide") & deformed[leaders])
        rows[follows] = -1
        led = np.flatnonzero(follows)
        leaders = leaders[led]
        asked = value(zone_rows(rows, references))
        asked[:, led] = shift[:, leaders]
        deformer = make(part.mesh, own, asked)
        deformed[points] = True
        designs.append(ZoneDesign(index + 1, points, rows, led, leaders, deformer))
        at = np.intersect1d(points, shared)
        for k, each in enumerate(asked if len(at) and ahead else ()):
            run = None if k else deformer.as_run()
            there = deformer._deformed(each)[0] if run is None else run
            shift[k, at] = there[at - points[0]] - mesh.points[at]
        moved = np.zeros_like(part.mesh.points)
        farthest = np.linalg.norm(shift[:, at], axis=2).argmax(axis=0)
        moved[at - points[0]] = shift[farthest, at]
        moving = np.flatnonzero(moved.any(axis=1))
        if not len(moving):  # at rest: other designs move all that is not fixed
            moving = np.setdiff1d(points - points[0], deformer._setup.classes.fixed)
        motion.slid(index, moved, moving, ahead)
    return tuple(designs)
