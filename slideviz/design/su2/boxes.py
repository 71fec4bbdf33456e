"""FFD boxes of a configuration: their control points move by design variables, and nodes inside."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slideviz.case.boxes import boxes_for, defined_boxes, embedding, missing_box, off_points
from slideviz.case.check import raise_all
from slideviz.case.ffd_keys import ffd_contradictions
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.markers import problems_of_markers
from slideviz.design.su2.planes import idle_variables
from slideviz.design.su2.variables import DesignVariable
from slideviz.errors import CaseError
from slideviz.ffd.box import Box, Embedding
from slideviz.ffd.section import with_boxes
from slideviz.mesh.model import FloatArray, IntArray, Mesh


@dataclass(frozen=True, eq=False)
class MovedBoxes:
    """FFD boxes whose control points move (a `Displacer`)."""

    config: Su2Config
    mesh: Mesh
    nodes: IntArray
    boxes: dict[str, Box]
    """The boxes that variables move, by name."""
    embedded: dict[str, Embedding]
    """The nodes in each box, by their place in ``nodes``."""
    idle: tuple[bool, ...]
    """For each variable, whether its control point is held, so that it has no effect."""
    warnings: tuple[str, ...]

    @property
    def inside(self) -> dict[str, int]:
        """Return how many nodes are in each box."""
        return {name: len(found.nodes) for name, found in self.embedded.items()}

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes by all variables."""
        total = np.zeros((len(self.nodes), self.mesh.dim))
        for place, variable in enumerate(self.config.variables):
            for part, value in enumerate(variable.values):
                if not self.idle[place]:
                    total += (self._rate(place) * value) * self._unit(place, part)
        return total

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to a value, which is the same everywhere."""
        del undeformed
        return self._rate(place) * self._unit(place, part)

    def _unit(self, place: int, part: int) -> FloatArray:
        """Return the displacement (m, d) of the nodes by a value of 1 alone."""
        variable = self.config.variables[place]
        inside = self.embedded[variable.box]
        change = self.boxes[variable.box].change(variable.index, variable.shifts[part])
        out = np.zeros((len(self.nodes), self.mesh.dim))
        out[inside.nodes] = inside.sums(change)[:, : self.mesh.dim]
        return out

    def _rate(self, place: int) -> float:
        """Return OPT_RELAX_FACTOR; or 1 for several values, which SU2 does not multiply by it."""
        return 1.0 if len(self.config.variables[place].values) > 1 else self.config.relaxation

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return a deformed mesh with its FFD boxes moved by the design."""
        moved = []
        for name, box in self.boxes.items():
            change = np.zeros(box.points.shape)
            for place, variable in enumerate(self.config.variables):
                if variable.box == name and not self.idle[place]:
                    for value, shift in zip(variable.values, variable.shifts, strict=True):
                        vector = np.array(shift) * (self._rate(place) * value)
                        change += box.change(variable.index, tuple(vector.tolist()))
            moved.append(box.moved(change))
        return with_boxes(mesh, moved)


def move_boxes(config: Su2Config, mesh: Mesh, nodes: IntArray) -> MovedBoxes:
    """Return the boxes that the variables move, with the nodes (m,) that are inside.

    Raises
    ------
    CaseError
        A box has no node inside.
    """
    known = boxes_for(config.case, mesh)
    boxes, inside, warnings = {}, {}, []
    for name in dict.fromkeys(variable.box for variable in config.variables):
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
    warnings += [*held, *_overlaps(inside)]
    return MovedBoxes(config, mesh, nodes, boxes, inside, idle, tuple(warnings))


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


def problems_of_boxes(config: Su2Config, mesh: Mesh) -> list[str]:
    """Return which variables move what is not there."""
    try:
        known = boxes_for(config.case, mesh)
    except CaseError as problem:
        return str(problem).splitlines()
    problems = []
    for place, variable in enumerate(config.variables, start=1):
        if variable.box not in known:
            said = missing_box(mesh, variable.box, known, "define it with FFD_DEFINITION")
            problems.append(f"variable {place}: {said}")
        elif wrong := known[variable.box].problem(variable.index):
            problems.append(f"variable {place}: {wrong}")
        elif mesh.dim == 2 and _leaves_plane(variable):
            problems.append(f"variable {place}: its direction leaves the plane; write dz = 0")
    return [f"{config.source}: {text}" for text in problems]


def _leaves_plane(variable: DesignVariable) -> bool:
    shifts = zip(variable.values, variable.shifts, strict=True)
    several = len(variable.values) > 1
    return any(dz and (value or not several) for value, (_, _, dz) in shifts)


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


def _overlaps(inside: dict[str, Embedding]) -> list[str]:
    """Return a warning if nodes are in several boxes; or none."""
    every = [found.nodes for found in inside.values()]
    shared = sum(map(len, every)) - len(np.unique(np.concatenate([*every, np.empty(0, int)])))
    said = (
        f"{shared} nodes are in several of the FFD boxes {', '.join(inside)}: what these do is "
        "added up, where SU2 takes the last"
    )
    return [said] if shared else []
