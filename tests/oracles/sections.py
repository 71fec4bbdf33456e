"""Sections, slowly and literally: one cell at a time, by the sides of its nodes."""

from __future__ import annotations

import math

from slideviz.mesh.elements import ELEMENTS


def height(section, point):
    """Signed distance of one point from a plane or from a cylinder."""
    x = [float(v) for v in point] + [0.0] * (3 - len(point))
    away = [a - b for a, b in zip(x, section.origin, strict=True)]
    length = math.sqrt(sum(v * v for v in section.direction))
    unit = [v / length for v in section.direction]
    along = sum(a * b for a, b in zip(away, unit, strict=True))
    if section.kind == "plane":
        return along
    across = [a - along * u for a, u in zip(away, unit, strict=True)]
    return math.sqrt(sum(v * v for v in across)) - section.radius


def cut_cells(mesh, section, tolerance=1e-9):
    """Ids of the cells with nodes on both sides, or on the negative side with a side in the
    section."""
    heights = [height(section, point) for point in mesh.points]
    limit = tolerance * max(abs(h) for h in heights)
    found = []
    for cell in range(len(mesh.cells)):
        row = ELEMENTS[int(mesh.cells.types[cell])]
        nodes = mesh.cells.connectivity[mesh.cells.offsets[cell] : mesh.cells.offsets[cell + 1]]
        own = [heights[node] for node in nodes]
        below, above = min(own) < -limit, max(own) > limit
        lying = any(all(abs(own[k]) <= limit for k in side) for side in row.facets)
        if below and (above or lying):
            found.append(cell)
    return found
