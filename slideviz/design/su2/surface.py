"""Displacement of the moving boundaries by design variables, and its exact derivatives.

As in SU2 each variable acts on the undeformed boundary, and their displacements are added up.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from slideviz.case.boxes import boxes_for, defined_boxes, embedding, missing_box, off_points
from slideviz.case.check import raise_all
from slideviz.case.ffd_keys import ffd_contradictions
from slideviz.case.model import Case, Prescribed
from slideviz.deformation.setup import make_setup
from slideviz.deformation.steps import Step
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.markers import problems_of_markers
from slideviz.design.su2.planes import idle_variables
from slideviz.design.su2.positions import read_positions
from slideviz.design.su2.variables import BOXED, DesignVariable
from slideviz.errors import CaseError, Note, SlidevizError
from slideviz.ffd.box import Box, Embedding
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.model import FloatArray, IntArray, Mesh

RIGID = ("TRANSLATION", "ROTATION", "SCALE")
"""Kinds of variables that move boundaries as a rigid body, or scale them."""


@dataclass(frozen=True, eq=False)
class MovingSurface:
    """The moving boundaries of a configuration, and its design.

    Attributes
    ----------
    config : Su2Config
    mesh : Mesh
    nodes : (m,) int64
        Of all moving boundaries, ascending.
    boxes : dict of str to Box
        The FFD boxes that variables move, by name.
    inside : dict of str to Embedding
        The nodes in each box, by their place in ``nodes``.
    idle : tuple of bool
        For each variable, whether its control point is held, so that it has no effect.
    warnings : tuple of str
    """

    config: Su2Config
    mesh: Mesh
    nodes: IntArray
    boxes: dict[str, Box]
    inside: dict[str, Embedding]
    idle: tuple[bool, ...]
    warnings: tuple[str, ...]

    @property
    def scale(self) -> float:
        """Return OPT_RELAX_FACTOR, which multiplies all values."""
        return float(self.config.words["OPT_RELAX_FACTOR"])

    @cached_property
    def displacement(self) -> FloatArray:
        """Return the displacement of the nodes, (m, d), in the mesh's length unit."""
        points = self.mesh.points[self.nodes]
        if self.config.variables[0].kind == "SURFACE_FILE":  # which stands alone
            return self._listed[0] - points
        total = np.zeros_like(points)
        for place, variable in enumerate(self.config.variables):
            total += self._moved(place, variable, points)
        return total

    @cached_property
    def _listed(self) -> tuple[FloatArray, tuple[str, ...]]:
        """Return positions (m, d) of SURFACE_FILE, and warnings; the undeformed ones without it."""
        if self.config.variables[0].kind != "SURFACE_FILE":
            return self.mesh.points[self.nodes], ()
        config = self.config
        of = f"{config.named[config.markers[0]]}= ({', '.join(config.markers)})"
        return read_positions(config.files["DV_FILENAME"], self.nodes, self.mesh, of)

    def slope(self, place: int, undeformed: bool = False) -> FloatArray:
        """Return the derivative (m, d) of the displacement with respect to a variable's value.

        Parameters
        ----------
        place : int
            Number of the variable, from 0.
        undeformed : bool
            Whether at the design that moves nothing, instead of this one.
        """
        variable = self.config.variables[place]
        points = self.mesh.points[self.nodes]
        if variable.kind == "ROTATION":
            angle = 0.0 if undeformed else self.scale * variable.value
            rate = np.radians(self.scale)
            return rate * _turned(variable.numbers, points, angle, derivative=True)
        if variable.kind == "SCALE":
            return self.scale * points
        # The others are linear; what SURFACE_FILE does has no value to change.
        return self._moved(place, replace(variable, value=1.0), points)

    def _moved(self, place: int, variable: DesignVariable, points: FloatArray) -> FloatArray:
        """Return the displacement of points (m, d) by variable number ``place``."""
        value, dim = self.scale * variable.value, self.mesh.dim
        if variable.kind == "TRANSLATION":
            return np.broadcast_to(value * np.array(variable.numbers[:dim]), points.shape)
        if variable.kind == "ROTATION":
            return _turned(variable.numbers, points, value)
        if variable.kind == "SCALE":
            return (value - 1.0) * points
        out = np.zeros_like(points)
        if variable.kind in BOXED and not self.idle[place]:
            inside = self.inside[variable.box]
            change = self.boxes[variable.box].change(variable.index, variable.numbers)
            out[inside.nodes] = value * inside.sums(change)[:, :dim]
        return out

    def case(self) -> Case:
        """Return the case with this displacement as its motion."""
        case = self.config.case
        others = set(self.mesh.marker_names) - set(self.config.markers)
        kinds = {variable.kind for variable in self.config.variables}
        if not others and kinds <= {*RIGID} and case.kernel == Case().kernel:
            # All boundaries move as a body does, or grow: this kernel has that exactly inside.
            case = case.change(kernel="thin-plate")
        warnings = (*case.warnings, *self.warnings, *self._listed[1])
        motion = Prescribed(self.nodes, self.displacement)
        return case.change(motions=(motion,), warnings=warnings)

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return a deformed mesh with its FFD boxes moved by the design."""
        moved = []
        for name, box in self.boxes.items():
            change = np.zeros(box.points.shape)
            for place, variable in enumerate(self.config.variables):
                if variable.box == name and not self.idle[place]:
                    shift = np.array(variable.numbers) * (self.scale * variable.value)
                    change += box.change(variable.index, tuple(shift.tolist()))
            moved.append(box.moved(change))
        return with_boxes(mesh, moved) if moved else mesh


def make_surface(config: Su2Config, mesh: Mesh) -> MovingSurface:
    """Return the moving boundaries and boxes of a configuration.

    Raises
    ------
    CaseError
        Markers or boxes are missing, or a box lacks a variable's control point or has no node
        inside.
    """
    names = tuple(dict.fromkeys(v.box for v in config.variables if v.kind in BOXED))
    known, problems = {}, problems_of_markers(config, mesh)
    try:
        known = boxes_for(config.case, mesh) if names else {}
        problems += _problems_of_boxes(config, mesh, known)
    except CaseError as problem:
        problems += str(problem).splitlines()
    raise_all(tuple(problems))
    nodes = np.unique(np.concatenate([mesh.marker(name).nodes for name in config.markers]))
    boxes, inside, warnings = {}, {}, []
    for name in names:
        on = {marker: embedding(known[name], mesh, marker) for marker in config.markers}
        boxes[name], inside[name] = _embedded(known[name], on, nodes)
        if not len(inside[name].nodes):
            raise CaseError(
                f"{config.source}: no node of {', '.join(config.markers)} is in the FFD box "
                f"{name!r}; correct the box or DV_MARKER"
            )
    for box in boxes.values():
        warnings += [text for name in config.markers for text in off_points(box, mesh, name)]
    idle, held = idle_variables(config, mesh, boxes)
    warnings += [*held, *_overlaps(inside), *_left_behind(config, mesh)]
    return MovingSurface(config, mesh, nodes, boxes, inside, idle, tuple(warnings))


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
    )


def set_boxes(config: Su2Config, mesh: Mesh) -> tuple[Mesh, tuple[Box, ...]]:
    """Return the mesh with the boxes that a configuration defines, and the boxes (FFD_SETTING).

    Raises
    ------
    CaseError
        The configuration defines no box, or a box is not possible.
    """
    contradictions = (text for _, text in ffd_contradictions(config.case))
    raise_all((*problems_of_markers(config, mesh), *contradictions))
    boxes = []
    for box in defined_boxes(config.case, mesh).values():
        on = {name: embedding(box, mesh, name)[0] for name in config.markers}
        listed = {name: (found.nodes, found.uvw) for name, found in on.items() if len(found.nodes)}
        boxes.append(replace(box, embedded=listed))
    if not boxes:
        raise CaseError(f"{config.source}: FFD_SETTING needs FFD_DEFINITION, which has no box")
    return with_boxes(mesh, boxes, anew=True), tuple(boxes)


def _problems_of_boxes(config: Su2Config, mesh: Mesh, known: dict[str, Box]) -> list[str]:
    """Return which variables move what is not there."""
    problems = []
    for place, variable in enumerate(config.variables, start=1):
        if variable.kind not in BOXED:
            continue
        if variable.box not in known:
            said = missing_box(mesh, variable.box, known, "define it with FFD_DEFINITION")
            problems.append(f"variable {place}: {said}")
        elif wrong := known[variable.box].problem(variable.index):
            problems.append(f"variable {place}: {wrong}")
        elif mesh.dim == 2 and variable.numbers[2]:
            problems.append(f"variable {place}: its direction leaves the plane; write dz = 0")
    return [f"{config.source}: {text}" for text in problems]


def _embedded(
    box: Box, on: dict[str, tuple[Embedding, float]], nodes: IntArray
) -> tuple[Box, Embedding]:
    """Return the box with its nodes on each marker listed, and the nodes inside, by their place."""
    listed = {name: (found.nodes, found.uvw) for name, (found, _) in on.items() if len(found.nodes)}
    every = np.concatenate([found.nodes for found, _ in on.values()])
    uvw = np.concatenate([found.uvw for found, _ in on.values()])
    one, first = np.unique(every, return_index=True)
    inside = box.embed(np.searchsorted(nodes, one), uvw[first])
    return (box if box.embedded else replace(box, embedded=listed)), inside


def _left_behind(config: Su2Config, mesh: Mesh) -> list[str]:
    """Return a note if variables move the surface, but not the FFD boxes in the mesh; or none."""
    kinds = sorted({variable.kind for variable in config.variables} - {*BOXED})
    with suppress(SlidevizError):  # a mesh whose boxes cannot be read has none that could be used
        if kinds and boxes_of(mesh):
            said = (
                f"the FFD boxes in {config.case.mesh_out} follow their control points only, and "
                f"not {', '.join(kinds)}; set them anew to use them with that mesh"
            )
            return [Note(said)]
    return []


def _overlaps(inside: dict[str, Embedding]) -> list[str]:
    """Return a warning if nodes are in several boxes; or none."""
    every = [found.nodes for found in inside.values()]
    shared = sum(map(len, every)) - len(np.unique(np.concatenate([*every, np.empty(0, int)])))
    said = (
        f"{shared} nodes are in several of the FFD boxes {', '.join(inside)}: what these do is "
        "added up, where SU2 takes the last"
    )
    return [said] if shared else []


def _shown(point: FloatArray) -> str:
    """Return a point in words."""
    return f"({', '.join(f'{value:.6g}' for value in point)})"


def _turned(
    numbers: tuple[float, ...], points: FloatArray, angle_deg: float, derivative: bool = False
) -> FloatArray:
    """Return the displacement of points (m, d) by a rotation about a line.

    Or, with ``derivative``, its derivative with respect to the angle in radians. The line goes
    through both points of ``numbers``, in 2D along z. Rodrigues:
    ``sin(a) k x v + (1 - cos(a)) k x (k x v)``. Raises CaseError where the points define no line.
    """
    dim, angle = points.shape[1], np.radians(angle_deg)
    first, second = np.array(numbers).reshape(2, 3)
    axis = second - first if dim == 3 else np.array([0.0, 0.0, 1.0])
    if dim == 2 and (first != second)[:2].any():
        raise CaseError(
            f"ROTATION: the line from {_shown(first)} to {_shown(second)} leaves the normal of a "
            "mesh of 2 dimensions; give both points the same x and y"
        )
    length = np.linalg.norm(axis)
    if length == 0.0:
        raise CaseError("ROTATION: its two points are one; the line between them has no direction")
    arm = np.zeros((len(points), 3))
    arm[:, :dim] = points - first[:dim]
    across = np.cross(axis / length, arm)
    twice = np.cross(axis / length, across)
    if derivative:
        out = np.cos(angle) * across + np.sin(angle) * twice
    else:
        out = np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * twice
    return np.asarray(out[:, :dim])
