"""Live fields: the mesh while a hand moves its boundaries, as a sum of stored fields.

With control nodes and all other choices frozen, the displacement of all nodes is linear in that of
the moving boundary. An affine motion of a body has d² + d parameters, so as many fields give every
translation, rotation and scale of it; of other motions each number has a field.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import qr

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.case.motions.motion import Motion, applies_to
from slideviz.case.moving_nodes import moving_nodes
from slideviz.design.deformer import Deformer, facets_of
from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray, Mesh, frozen_array, row_norms
from slideviz.solver.setup import Setup
from slideviz.solver.steps import Report
from slideviz.system.grouping import grouped
from slideviz.system.platform import free_memory

TURN = np.radians(5.0)
"""Angle in radians: what moves is displaced by it, times a third of its size, where control nodes
are chosen."""

MOST = 48  # most fields that are made: a motion of many numbers is not previewed
COPIES = 4  # arrays of the size of all fields that making them takes
COVERED = 0.05  # largest part of a displacement of the boundary that fields may lack
NUDGE = 1e-4  # change of a number by which the displacement per unit is found
ROUNDING = 1e-9  # part of a displacement below which it depends on others


@record
class LiveFields:
    """The displacements of all nodes that make up those by the motions of a case."""

    case: Case  # one step, without relaxation, layers and repair
    mesh: Mesh
    boundary: FloatArray
    """(k, m d): displacements of the m moving nodes, orthogonal and of length 1."""
    fields: FloatArray
    """(k, n d): the displacements of all nodes that belong to them."""
    walls: tuple[tuple[IntArray, Setup, dict[int, IntArray]], ...] = ()
    """For each zone its points, its setup, and the facets that its nodes slide on at rest."""
    base: FloatArray | None = None
    added: FloatArray | None = None
    """`base` (m d,), `added` (n d,): the displacement of the boundary in a run, and what that run
    adds to these fields; None without one."""
    start: FloatArray | None = None  # (n, d): the points of that run

    @classmethod
    def of(cls, case: Case, mesh: Mesh, progress: Report) -> LiveFields:
        """Return the fields for the motions of a case; ``progress`` may raise an error to stop.

        Raises CaseError where the case does not fit the mesh, and DeformError where there would be
        more than `MOST` fields, or memory is short.
        """
        case = simplified(case)
        asked = moving_nodes(case, mesh)
        size = asked.vectors.size
        found = [each.ravel() for each in displacements_of(case, mesh, asked.nodes)]
        if len(found) > MOST:
            raise DeformError(f"the motions have {len(found)} numbers, and live fields {MOST}")
        needed = COPIES * 8 * len(found) * mesh.points.size
        if needed > free_memory():
            raise DeformError(f"live fields need {needed / 1e9:.1f} GB of memory")
        boundary = independent(np.reshape(found, (len(found), size)))
        vectors = boundary.reshape(-1, *asked.vectors.shape)
        points = mesh.points[asked.nodes]
        designs = np.stack([each * factor_of(each, points) for each in vectors])
        deformer = Deformer(mesh, case, designs, progress)
        at_rest = np.zeros_like(asked.vectors)
        fields = deformer.jvp(at_rest, vectors).reshape(len(vectors), -1)
        zones = deformer.setups()
        walls = tuple((nodes, one, facets_of(one, one.coords)) for nodes, one in zones)
        return cls(case, mesh, boundary, fields, walls)

    @property
    def nbytes(self) -> int:
        """Return the memory that the fields take."""
        return self.fields.nbytes

    def fits(self, case: Case) -> bool:
        """Return whether these are the fields of a case, apart from numbers of its motions."""
        return settings(simplified(case)) == settings(self.case)

    def after(self, case: Case, points: FloatArray) -> LiveFields:
        """Return the fields such that ``case`` gives ``points`` (n, d), those of its run.

        So a preview begins at the result of the last run, with its relaxation and its layers.
        """
        base = moving_nodes(case, self.mesh).vectors.ravel()
        bare = replace(self, base=None, added=None).moved(case)
        if bare is None or not base.any():
            return replace(self, base=None, added=None, start=points)
        return replace(self, base=base, added=(points - bare).ravel(), start=points)

    def moved(self, case: Case) -> FloatArray | None:
        """Return the points (n, d) of a case; None where these fields are of other settings."""
        if not self.fits(case):
            return None
        wanted = moving_nodes(case, self.mesh).vectors.ravel()
        if wanted.size != self.boundary.shape[1]:
            return None
        parts = self.boundary @ wanted
        lacks = np.linalg.norm(wanted - parts @ self.boundary)
        if lacks > COVERED * np.linalg.norm(wanted):
            return None
        shift = parts @ self.fields
        if self.base is not None and self.added is not None:
            shift += np.clip(wanted @ self.base / (self.base @ self.base), 0.0, 1.0) * self.added
        points = self.mesh.points + shift.reshape(self.mesh.points.shape)
        for nodes, setup, facets in self.walls:
            project(points, nodes, setup, facets)
        return frozen_array(points)


def simplified(case: Case) -> Case:
    """Return the case in one step of radial functions, without what comes after these."""
    return case.change(steps=1, relax="no", layers="no", repair="no", limits=())


def settings(case: Case) -> tuple[object, ...]:
    """Return what the fields of a case depend on, apart from numbers of its motions."""
    kinds = tuple((type(one), one.marker) for one in case.motions)
    return kinds, case.change(motions=(), warnings=(), view={}, source=None, mesh_out=None)


def displacements_of(case: Case, mesh: Mesh, nodes: IntArray) -> Iterator[FloatArray]:
    """Yield displacements (m, d) of the moving ``nodes`` (m,) that those of the motions add up to.

    Of bodies that only affine motions move, all affine ones; for each number of the others, the
    displacement by a unit of it.
    """
    bodies = grouped(
        (tuple(k for k, one in enumerate(case.motions) if applies_to(one, name)), name)
        for name in case.markers_with("moving")
    )
    others = set[int]()
    for by, names in bodies.items():
        if not all(case.motions[k].affine for k in by):
            others.update(by)
            continue
        rows = np.searchsorted(nodes, mesh.nodes_of(names))
        arm = mesh.points[nodes[rows]]
        arm = arm - arm.mean(axis=0)
        for factor in (np.ones(len(rows)), *arm.T):
            for axis in range(mesh.dim):
                one = np.zeros((len(nodes), mesh.dim))
                one[rows, axis] = factor
                yield one
    now = moving_nodes(case, mesh).vectors
    if others and now.any():
        yield now
    for k in sorted(others):
        for changed in nudged(case.motions[k]):
            motions = (*case.motions[:k], changed, *case.motions[k + 1 :])
            yield (moving_nodes(case.change(motions=motions), mesh).vectors - now) / NUDGE


def nudged(motion: Motion) -> Iterator[Motion]:
    """Yield the motion with each of the numbers that say how far it goes changed by `NUDGE`."""
    for field, value, _ in motion.amounts():
        several = value if isinstance(value, tuple) else (value,)
        for k, one in enumerate(several):
            changed = (*several[:k], one + NUDGE, *several[k + 1 :])
            yield replace(motion, **{field: changed if isinstance(value, tuple) else changed[0]})


def independent(rows: FloatArray) -> FloatArray:
    """Return orthogonal rows (r, q) of length 1 that span the same as rows (k, q)."""
    lengths = row_norms(rows)
    rows = rows[lengths > 0.0] / lengths[lengths > 0.0, None]
    if not len(rows):
        raise DeformError("the motions move nothing, and have no numbers that could")
    found, triangle, _ = qr(rows.T, mode="economic", pivoting=True)
    return np.ascontiguousarray(found[:, np.abs(np.diag(triangle)) > ROUNDING].T)


def factor_of(vectors: FloatArray, points: FloatArray) -> float:
    """Return the factor of displacements (m, d) of ``points`` with which control nodes suffice."""
    lengths = row_norms(vectors)
    size = np.ptp(points[lengths > 0.0], axis=0).max()
    return float(TURN * size / 3.0 / lengths.max())


def project(points: FloatArray, nodes: IntArray, setup: Setup, facets: dict[int, IntArray]) -> None:
    """Move sliding nodes of a zone onto their walls, in ``points`` (n, d) of all zones.

    ``nodes`` (z,): the points of the zone. ``facets``: for each track, those to look at first.
    """
    sliding = setup.classes.sliding
    label = setup.tracks.of_node[sliding]
    for index, guess in facets.items():
        rows = nodes[sliding[label == index]]
        at = setup.frame.coords(points[rows])
        points[rows] = setup.frame.points(setup.tracks.tracks[index].nearest(at, guess)[0])
