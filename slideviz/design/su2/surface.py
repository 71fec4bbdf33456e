"""Displacement of the moving boundaries by design variables, and its exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from slideviz.case.check import raise_all
from slideviz.case.model import Case, Prescribed
from slideviz.design.su2.boxes import move_boxes, problems_of_boxes
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.markers import problems_of_markers
from slideviz.design.su2.positions import ListedPositions
from slideviz.design.su2.shapes import Shapes
from slideviz.design.su2.variables import Group
from slideviz.errors import CaseError, Note, SlidevizError
from slideviz.ffd.section import boxes_of
from slideviz.mesh.interfaces import torn_interfaces
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.solver.setup import make_setup
from slideviz.solver.steps import Step

RIGID = ("TRANSLATION", "ROTATION", "SCALE")
"""Kinds of variables that move boundaries as a rigid body, or scale them."""


class Displacer(Protocol):
    """Displaces the moving nodes by the design variables of one group."""

    @property
    def idle(self) -> tuple[bool, ...]:
        """For each variable, whether it has no effect."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for the user."""

    @property
    def inside(self) -> dict[str, int]:
        """How many moving nodes are in each FFD box that moves some."""

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the moving nodes by all variables."""

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to a value; see `MovingSurface.slope`."""

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return a deformed mesh with its FFD boxes moved by the design."""


DISPLACERS: dict[Group, Callable[[Su2Config, Mesh, IntArray], Displacer]] = {
    "nothing": Shapes,
    "surface": Shapes,
    "naca": Shapes,
    "parabolic": Shapes,
    "grid": Shapes,
    "file": ListedPositions,
    "ffd": move_boxes,
}
"""What moves the nodes, by the group of the first design variable."""


@dataclass(frozen=True, eq=False)
class MovingSurface:
    """The moving boundaries of a configuration, and its design."""

    config: Su2Config
    mesh: Mesh
    nodes: IntArray
    """(m,): of all moving boundaries, or of the mesh (``*_GRID``), ascending."""
    displacer: Displacer
    warnings: tuple[str, ...]

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect."""
        ignored = (each.ignored for each in self.config.variables)
        return tuple(map(max, ignored, self.displacer.idle))

    @property
    def values(self) -> tuple[tuple[int, int], ...]:
        """Return (variable, number among its values) of each value, both from 0."""
        variables = enumerate(self.config.variables)
        return tuple((place, part) for place, each in variables for part in range(len(each.values)))

    @cached_property
    def displacement(self) -> FloatArray:
        """Return the displacement of the nodes, (m, d), in the mesh's length unit.

        Raises CaseError where it is not finite.
        """
        with _large_numbers_told(self.config):
            return self._finite(self.displacer.displacement())

    def slope(self, place: int, part: int = 0, undeformed: bool = False) -> FloatArray:
        """Return the derivative (m, d) of the displacement with respect to a value.

        Parameters
        ----------
        place : int
            Number of the variable, from 0.
        part : int
            Number of the value among those of the variable, from 0.
        undeformed : bool
            Whether at the design that moves nothing, instead of this one.
        """
        if self.idle[place]:
            return np.zeros((len(self.nodes), self.mesh.dim))
        with _large_numbers_told(self.config):
            return self._finite(self.displacer.slope(place, part, undeformed))

    def _finite(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (m, d) that must be finite."""
        if not np.isfinite(vectors).all():
            raise OverflowError
        return vectors

    @property
    def whole(self) -> bool:
        """Return whether all nodes of the mesh move as the variables say (``*_GRID``)."""
        return self.config.variables[0].group == "grid"

    def moved(self) -> Mesh:
        """Return the mesh with the nodes moved, and no others."""
        points = self.mesh.points.copy()
        points[self.nodes] += self.displacement
        return self.mesh.with_points(points)

    def case(self) -> Case:
        """Return the case with this displacement as its motion."""
        case = self.config.case
        others = set(self.mesh.marker_names) - set(self.config.markers)
        moving = (each for each in self.config.variables if not each.ignored)
        if (
            not others
            and {each.kind for each in moving} <= {*RIGID}
            and case.kernel == Case().kernel
        ):
            # All boundaries move as a body does, or grow: this kernel has that exactly inside.
            case = case.change(kernel="thin-plate")
        nodes, vectors, warnings = self.nodes, self.displacement, self.warnings
        if self.whole or not self.config.markers:
            every = dict.fromkeys(self.mesh.marker_names, "moving")
            case = case.change(roles=every, sliding="none", periodic="none")
        if self.whole:  # the mesh is moved already
            listed = [marker.nodes for marker in self.mesh.markers]
            nodes = np.unique(np.concatenate([np.empty(0, np.int64), *listed]))
            vectors = np.zeros((len(nodes), self.mesh.dim))
            warnings = (*warnings, *torn_interfaces(self.mesh, self.moved().points))
        motions = (Prescribed(nodes, vectors),)
        return case.change(motions=motions, warnings=(*case.warnings, *warnings))


@contextmanager
def _large_numbers_told(config: Su2Config) -> Iterator[None]:
    """Context in which an OverflowError is a CaseError about the variables."""
    try:
        with np.errstate(all="ignore"):
            yield
    except OverflowError as problem:
        raise CaseError(
            f"{config.source}: the variables take nodes farther than can be computed with; correct "
            "DV_PARAM or DV_VALUE"
        ) from problem


def make_surface(config: Su2Config, mesh: Mesh) -> MovingSurface:
    """Return the moving boundaries of a configuration, and what moves them.

    Raises
    ------
    CaseError
        Markers or boxes are missing, or variables do not fit the mesh.
    """
    group = config.variables[0].group
    problems = problems_of_markers(config, mesh, needed=group not in ("grid", "nothing"))
    if group == "ffd":
        problems += problems_of_boxes(config, mesh)
    raise_all(tuple(problems))
    listed = [mesh.marker(name).nodes for name in config.markers]
    nodes = np.unique(np.concatenate([np.empty(0, np.int64), *listed]))
    nodes = np.arange(len(mesh.points)) if group == "grid" else nodes
    with _large_numbers_told(config):
        displacer = DISPLACERS[group](config, mesh, nodes)
    left = [] if group == "ffd" else _left_behind(config, mesh)
    if group == "grid" and mesh.halo is not None:
        sentence = f"the transformations of the halo in {mesh.name} (SEND_RECEIVE) stay as they are"
        left.append(f"{sentence}; they do not fit where the axis or the vector of its period moves")
    return MovingSurface(config, mesh, nodes, displacer, (*displacer.warnings, *left))


def at_rest(case: Case, mesh: Mesh) -> Step:
    """Return the one step of a design that moves nothing: often the first of an optimiser."""
    setup = make_setup(case, mesh)
    return Step(
        index=1,
        total=1,
        mesh=mesh,
        control_nodes=0,
        max_error=0.0,
        condition=np.nan,
        node_counts=setup.classes.counts(),
        seconds={},
        warnings=(*case.warnings, *setup.warnings),
        candidates=setup.candidates,
        support_radius=setup.basis.radius if case.method == "rbf" else None,
    )


def _left_behind(config: Su2Config, mesh: Mesh) -> list[str]:
    """Return a note if variables move the surface, but not the FFD boxes in the mesh; or none."""
    moving = [each for each in config.variables if not each.ignored and each.group != "nothing"]
    kinds = sorted({each.kind for each in moving})
    with suppress(SlidevizError):  # a mesh whose boxes cannot be read has none that could be used
        if kinds and boxes_of(mesh):
            sentence = (
                f"the FFD boxes in {config.case.mesh_out} follow their control points only, and "
                f"not {', '.join(kinds)}; set them anew to use them with that mesh"
            )
            return [Note(sentence)]
    return []
