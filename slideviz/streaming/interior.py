"""Displacement of a streamed mesh's interior nodes by the fields of all steps.

The skin is the boundary and the cells at it: the only part of the mesh that is in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import DeformError, MeshError, UnsoundError, point_words
from slideviz.mesh.model import FloatArray, IntArray, Mesh, sealed
from slideviz.rbf.frames import on_axis
from slideviz.rbf.images import largest_misfit
from slideviz.rbf.layers import LayerZone, find_zone
from slideviz.rbf.tape import value
from slideviz.solver.growth import overshoot_of_rest
from slideviz.solver.setup import Setup
from slideviz.solver.stepping import cartesian, shifted
from slideviz.solver.steps import MeshRepair, Step


@record
class InteriorDisplacer:
    """Displaces any nodes of a mesh, by the steps of its skin."""

    skin: Mesh  # the undeformed skin, without its cells
    setup: Setup  # the setup of the skin
    steps: Sequence[Step]  # the steps of the skin, with their ``field``

    def repaired(self, repair: MeshRepair) -> InteriorDisplacer:
        """Return the same after the repair of the whole mesh, with its nodes in the skin moved."""
        last = self.steps[-1]
        mesh = repair.mesh
        skin = self.skin.numbering.points
        points = np.array(last.mesh.points)
        nodes = repair.nodes[np.isin(repair.nodes, skin)]
        now = mesh.points[np.searchsorted(mesh.numbering.points, nodes)]
        points[np.searchsorted(skin, nodes)] = now
        last = replace(
            last,
            mesh=last.mesh.with_points(sealed(points)),
            repaired=repair,
            messages=(*last.messages, *repair.warnings),
            periodic_misfit=largest_misfit(
                self.setup.frame, self.setup.coords, points, self.setup.images
            ),
        )
        return replace(self, steps=(*self.steps[:-1], last))

    def after_steps(self, nodes: IntArray, points: FloatArray) -> Iterator[FloatArray]:
        """Yield the points (m, d) of some nodes after each step.

        Raises DeformError if coordinates became infinite, or a node would go far beyond the motion,
        and MeshError if a node is outside of the sector that the skin spans in a cylindrical frame.
        ``nodes`` (m,): their numbers in the whole mesh, ascending. ``points`` (m, d): their
        undeformed points.
        """
        frame = self.setup.frame
        start = frame.coords(points)
        at, where = self._in_skin(nodes)
        inner = np.ones(len(points), bool)
        inner[at] = False
        self._require_enclosed(nodes, points, start, inner)
        axis = on_axis(frame, start)
        coords = start
        zone = self._zone(start, inner & ~axis)
        for step, motion in zip(self.steps, self._motions, strict=True):
            assert step.field is not None
            displacement = step.field.at(frame.features(coords), frame.points(coords))
            if zone is not None:
                by = displacement[zone.nodes]
                carried = zone.carried(motion)
                moved = zone.displacement(coords[zone.nodes], by, carried)
                displacement[zone.nodes] = value(moved)
            coords = shifted(coords, displacement, axis)
            now = cartesian(frame, points, start, coords)
            if not np.all(np.isfinite(now)):
                raise DeformError(f"step {step.index}: coordinates became infinite; use more steps")
            self._require_sound(step, nodes, points, coords - start, at)
            # A Cartesian frame has the points as coordinates, which are those of the next step.
            out = now.copy()
            out[at] = step.mesh.points[where]
            yield out

    @cached_property
    def _motions(self) -> list[Any]:
        """Return the motion of the walls that carry nodes after each step (`WallNodes.motion`)."""
        setup = self.setup
        if setup.zone is None:
            return [None] * len(self.steps)
        start = setup.coords[setup.known]
        return [setup.zone.walls.motion(start + setup.target * step.part) for step in self.steps]

    def _zone(self, start: FloatArray, free: np.ndarray) -> LayerZone | None:
        """Return the zone of walls among the nodes of a mask (m,), with coordinates (m, d)."""
        zone = self.setup.zone
        nodes = np.flatnonzero(free)
        if zone is None:
            return None
        return find_zone(
            zone.walls, nodes, self.setup.frame.points(start[nodes]), np.zeros(len(nodes), bool)
        )

    def rigid(self, nodes: IntArray, points: FloatArray) -> IntArray:
        """Return the places (l,) in ``nodes`` of those that walls carry nearly alone.

        ``nodes`` (m,), ``points`` (m, d): as of `after_steps`.
        """
        frame = self.setup.frame
        start = frame.coords(points)
        at, where = self._in_skin(nodes)
        inner = ~on_axis(frame, start)
        inner[at] = False
        zone = self._zone(start, inner)
        skin = at[np.isin(where, self.setup.rigid)]
        return skin if zone is None else np.concatenate([skin, zone.rigid])

    def _in_skin(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Return the places (b,) in ``nodes`` of those that are in the skin, and in the skin (b,).

        ``nodes`` (m,) are ascending numbers in the whole mesh.
        """
        skin = self.skin.numbering.points
        low, high = np.searchsorted(skin, [nodes[0], nodes[-1] + 1])
        numbers = skin[low:high]
        at = np.searchsorted(nodes, numbers)
        same = np.flatnonzero(nodes[at] == numbers)
        return at[same], low + same

    def _require_enclosed(
        self, nodes: IntArray, points: FloatArray, start: FloatArray, inner: np.ndarray
    ) -> None:
        """Raise where a node is farther from the axis than the skin, or outside of its sector.

        The largest radius and the sector of the whole mesh would give another frame then. ``start``
        (m, d): coordinates of the nodes in the frame. ``inner`` (m,) bool: nodes that are not in
        the skin.
        """
        frame = self.setup.frame
        if not frame.cylindrical:
            return
        angles = self.setup.coords[:, 1]
        outside = (start[:, 1] < angles.min()) | (start[:, 1] > angles.max())
        out = outside | (start[:, 0] > frame.radius)
        out &= inner
        if out.any():
            k = int(np.argmax(out))
            where = point_words(points[k], self.skin.extent)
            raise MeshError(
                f"{self.skin.name}: node {nodes[k]} at ({where}) is outside the sector that the "
                "boundaries enclose, so the mesh cannot be streamed; give all its sides markers, "
                "or run it without --stream"
            )

    def _require_sound(
        self, step: Step, nodes: IntArray, points: FloatArray, shift: FloatArray, at: IntArray
    ) -> None:
        """Raise where a node overshoots, but for those ``at`` (b,), which are in the skin."""
        squared = np.einsum("nd,nd->n", shift, shift)
        squared[at] = 0.0
        k = int(np.argmax(squared))
        far = float(np.linalg.norm(shift[k])) if squared[k] else 0.0
        after = step.mesh.points
        message = overshoot_of_rest(self.setup, self.skin, after, step.part, far)
        if message:
            where = point_words(points[k], self.skin.extent)
            raise UnsoundError(f"step {step.index}: node {nodes[k]} at ({where}) {message}")
