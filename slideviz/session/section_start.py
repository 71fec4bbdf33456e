"""New sections: their point, direction and size; and the range of a section's slider."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.surfaces import padded
from slideviz.sections.model import SHAPES, Section, Triple
from slideviz.sections.shape import round_middle, triple
from slideviz.session.state import Session
from slideviz.system.threads import in_parts


def cell_points(mesh: Mesh) -> FloatArray:
    """Return the points (u, 3) of the nodes that cells use."""
    nodes = mesh.cells.nodes
    # Mostly cells use all nodes, and nothing has to be copied.
    return padded(mesh.points if len(nodes) == len(mesh.points) else mesh.points[nodes])


def first_section(kind: str, session: Session, pair: Pair | None = None) -> Section:
    """Return a new section of the shape ``kind``, about through the middle of the mesh shown.

    Shapes with an axis get that of the rotational ``pair``, else in 3D that of the case, and in 2D
    a centre in the middle of the moving boundaries.
    """
    mesh, case, shape = session.mesh, session.case, SHAPES[kind]
    assert mesh is not None
    if pair is not None and pair.kind == "rotational":
        axis, origin = pair.axis, pair.origin
    elif mesh.dim == 2:
        axis, origin = (0.0, 0.0, 1.0), triple(_middle_of_moving(session))
    else:
        axis, origin = case.axis, case.origin
    at, way = triple(np.asarray(origin)), triple(np.asarray(axis))
    section = Section.of(kind, at, way, shape.terms.size.usual if shape.terms.size else 0.0)
    section = replace(section, whole=mesh.dim == 2)
    return shape.first(section, _shown_points(session))


def _shown_points(session: Session) -> FloatArray:
    """Return the points (u, 3) of the nodes that cells use, in the frame that is shown."""
    shown = session.mesh if session.frame is None else session.frame.mesh
    assert shown is not None
    return cell_points(shown)


def _middle_of_moving(session: Session) -> FloatArray:
    """Return the middle (3,) of the box around the moving boundaries; around the mesh if none."""
    mesh = session.mesh
    assert mesh is not None
    names = [name for name in mesh.marker_names if session.role(name) == "moving"]
    nodes = [mesh.marker(name).nodes for name in names] or [mesh.cells.nodes]
    points = padded(mesh.points[np.concatenate(nodes)])
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2.0)


def span(section: Section, points: FloatArray) -> tuple[float, float]:
    """Return the lowest and highest position at which a section goes through points (n, 3)."""
    ends: list[float] = []

    def of_part(part: slice) -> None:
        found = section.shape.positions(section, points[part])
        ends.extend((float(found.min()), float(found.max())))

    in_parts(of_part, len(points))
    return min(ends), max(ends)


def turned(section: Section, direction: Triple, points: FloatArray) -> Section:
    """Return the section with another normal or axis, ``direction``.

    It keeps its position (place or size) if it goes through points (n, 3) there; else it gets one
    through their middle.
    """
    new = replace(section, direction=direction)
    found = new.shape.positions(new, points)
    if found.min() < new.shape.position(new) < found.max():
        return new
    return new.shape.at_position(new, round_middle(found))
