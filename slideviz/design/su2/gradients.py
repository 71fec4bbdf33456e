"""Gradients for design variables: sensitivities of all points, pulled back to the boundaries."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from slideviz.design.deformer import Deformer
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.sensitivities import (
    CLOSE,
    Matched,
    Sensitivities,
    angle_sensitivity,
    match,
    read_sensitivities,
)
from slideviz.design.su2.surface import MovingSurface, convex_part, make_surface
from slideviz.errors import ConditionWarning, Remark, ToleranceWarning
from slideviz.mesh.model import FloatArray, Mesh, largest_coordinate
from slideviz.solver.deform import deform
from slideviz.solver.steps import Progress

DIRECTIONS = 16  # most displacements for which control nodes are chosen at a design of zeros
REACH = 1e-3  # size of these displacements, as a part of the mesh's extent

INSUFFICIENT = (
    "boundary nodes still get exactly their displacement, and the gradient belongs to such a "
    "deformation; see what `slideviz def` warns of"
)


@dataclass(frozen=True, eq=False)
class Gradients:
    """Gradients of an objective at a design."""

    surface: FloatArray
    """(m, d): with respect to the displacement of each moving node, with all inner points
    following."""
    variables: FloatArray  # (v,): with respect to each value of the design variables
    points: FloatArray  # (m, d): positions of the moving nodes at the design
    at_design: bool
    """Whether the design is that of the configuration; else it is the undeformed mesh."""
    source: str  # path of the sensitivities
    warnings: tuple[Remark, ...]


def design_gradients(
    config: Su2Config, mesh: Mesh, progress: Callable[[Progress], None] | None = None
) -> tuple[MovingSurface, Gradients]:
    """Return the moving boundaries of a configuration, and the gradients (`find_gradients`).

    With CONVEXITY_CHECK both are of the part of the design that `slideviz def` does; gradients are
    with respect to the values in the configuration.
    """
    if not config.values["CONVEXITY_CHECK"]:
        surface = make_surface(config, mesh)
        return surface, find_gradients(surface, progress)

    def attempt(config: Su2Config) -> tuple[MovingSurface, Mesh]:
        surface = make_surface(config, mesh)
        if surface.moves_whole_mesh or not surface.displacement.any():
            return surface, surface.moved()
        *_, last = deform(surface.case(), mesh, progress)
        return surface, last.mesh

    part, (surface, _), messages = convex_part(config, mesh, attempt, lambda each: each[1])
    gradients = find_gradients(surface, progress)
    variables = part * gradients.variables if gradients.at_design else gradients.variables
    return surface, replace(
        gradients, variables=variables, warnings=(*gradients.warnings, *messages)
    )


def find_gradients(
    surface: MovingSurface, progress: Callable[[Progress], None] | None = None
) -> Gradients:
    """Return the gradients of the objective whose sensitivities the configuration names.

    Raises SlidevizError if the sensitivities are missing or of another mesh, or the deformation is
    not possible. The warnings of the `Deformer` are among the warnings of the result.
    """
    mesh = surface.mesh
    markers = surface.config.markers
    sensitivities = read_sensitivities(surface.config, mesh, surface.nodes)
    displacement = surface.displacement
    if surface.moves_whole_mesh:
        matched = match(sensitivities, mesh, surface.nodes, (), lambda: surface.moved().points)
        moved = displacement if matched.at_design else np.zeros_like(displacement)
        warnings = (*surface.case().warnings, *matched.warnings)
        return _gradients(surface, sensitivities, matched, matched.values, moved, warnings)
    moves = bool(displacement.any())
    prepared: list[Deformer] = []
    written: list[FloatArray] = []

    def design() -> FloatArray:  # as `slideviz def` writes it
        prepared.append(_deformer(surface, displacement, progress))
        points = prepared[0].as_run()
        if points is None:
            *_, last = deform(surface.case(), mesh, progress)
            points = last.mesh.points
        written.append(points)
        return points

    messages: list[Remark] = []
    with _heard(messages):
        matched = match(sensitivities, mesh, surface.nodes, markers, design if moves else None)
        if moves and not matched.at_design:
            displacement = np.zeros_like(displacement)
            prepared.clear()
        deformer = (prepared or [_deformer(surface, displacement, progress)])[0]
        if written and matched.at_design:
            messages += _difference(deformer.deform(displacement), written[0])
        pulled = deformer.vjp(displacement, matched.values)
    messages = [*deformer.warnings, *matched.warnings, *dict.fromkeys(messages)]
    return _gradients(surface, sensitivities, matched, pulled, displacement, messages)


def _gradients(
    surface: MovingSurface,
    found: Sensitivities,
    matched: Matched,
    pulled: FloatArray,
    displacement: FloatArray,
    said: Sequence[Remark],
) -> Gradients:
    """Return the gradients from that for each moving node, ``pulled`` (m, d)."""
    slopes = (
        surface.slope(place, part, undeformed=not matched.at_design)
        for place, part in surface.values
    )
    gradient = np.array([float((pulled * slope).sum()) for slope in slopes])
    angles = np.array([surface.config.variables[place].is_angle for place, _ in surface.values])
    if angles.any():
        rate = angle_sensitivity(found.path)
        gradient[angles] = rate or 0.0
        lacks = (
            f"{found.path} has no SENS_AOA= (SU2's text files have it): 0 is written for the angle"
        )
        said = [*said, lacks] if rate is None else said
    return Gradients(
        surface=pulled,
        variables=gradient,
        points=surface.mesh.points[surface.nodes] + displacement,
        at_design=matched.at_design,
        source=str(found.path),
        warnings=tuple(said),
    )


@contextmanager
def _heard(said: list[Remark]) -> Iterator[None]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConditionWarning)
        warnings.simplefilter("always", ToleranceWarning)
        yield
    for one in caught:
        assert isinstance(one.message, Warning)
        if one.category is ConditionWarning:
            said.append(one.message.args[0])  # a `note`, where little
        elif one.category is ToleranceWarning:  # its remedy is one for Python
            said.append(f"{one.message.args[0].rule}; {INSUFFICIENT}")
        else:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


def _difference(found: FloatArray, written: FloatArray) -> list[str]:
    """Return a message if ``found`` (n, d) is not what ``slideviz def`` writes; else none."""
    gap = float(np.abs(found - written).max(initial=0.0))
    if gap <= CLOSE * largest_coordinate(written):
        return []
    messages = f"the gradient belongs to a deformation whose points differ by up to {gap:.2g} from"
    return [f"{messages} the points that `slideviz def` writes"]


def _deformer(
    surface: MovingSurface, displacement: FloatArray, progress: Callable[[Progress], None] | None
) -> Deformer:
    """Return a deformer made at ``displacement`` (m, d); if zero, also for `_directions`."""
    reference = displacement[None]
    if not displacement.any():
        reference = np.concatenate([reference, _directions(surface)])
    deformer = Deformer(surface.mesh, surface.case(), reference, progress)
    assert np.array_equal(deformer.nodes, surface.nodes)
    return deformer


def _directions(surface: MovingSurface) -> FloatArray:
    """Return k displacements (k, m, d), `DIRECTIONS` sums of all variables, each up to `REACH`."""
    sums: list[FloatArray] = []
    for k, (place, part) in enumerate(surface.values):
        slope = surface.slope(place, part, undeformed=True)
        largest = float(np.abs(slope).max(initial=0.0))
        unit = slope * (REACH * surface.mesh.extent / largest) if largest else slope
        if len(sums) < DIRECTIONS:
            sums.append(np.array(unit))
        else:
            sums[k % DIRECTIONS] += unit
    moving = [each for each in sums if each.any()]
    if not moving:  # such as an angle of attack: any displacement tells how the rest follows
        moving = [np.full((len(surface.nodes), surface.mesh.dim), REACH * surface.mesh.extent)]
    return np.array(moving).reshape(-1, len(surface.nodes), surface.mesh.dim)
