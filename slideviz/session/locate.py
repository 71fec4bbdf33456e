"""Where a cell is: its coordinates, about the mesh's axis if it has one, and nearest boundary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.axis_frame import in_axis_frame
from slideviz.mesh.model import FloatArray, Marker, Mesh
from slideviz.session.state import Session

NEAR = 4
"""The nearest point of a boundary is looked for in the elements at so many nearest nodes."""


@dataclass(frozen=True)
class RotationAxis:
    """The axis of rotational periodicity."""

    axis: tuple[float, float, float]
    origin: tuple[float, float, float]
    """`axis`, `origin` (3,) tuple of float: its direction, and a point on it."""


def axis_of(session: Session) -> RotationAxis | None:
    """Return the axis of a session's rotational periodic pair of boundaries, or None."""
    names = session.case.markers_with("periodic")
    for pair in session.pairs:
        if pair.kind == "rotational" and pair.first in names and pair.second in names:
            return RotationAxis(pair.axis, pair.origin)
    return None


def coordinates(
    positions: FloatArray, around: RotationAxis | None
) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of coordinates: cylindrical about an axis, or Cartesian.

    Parameters
    ----------
    positions : (k, d) float64
        Cartesian, in the mesh's length unit.
    around : Around or None
        The axis for radius, angle in degrees and height; None: Cartesian.

    Returns
    -------
    names : tuple of d str
    values : (k, d) float64
    """
    dim = positions.shape[1]
    if around is None:
        return tuple("xyz"[:dim]), positions
    at = in_axis_frame(positions, around.axis, around.origin)
    angle = np.degrees(np.arctan2(at[:, 1], at[:, 0]))
    along = [name for name, part in zip("xyz", around.axis, strict=True) if abs(part) > 0]
    names = ("r", "\u03b8 [°]", along[0] if len(along) == 1 else "axial")
    return names[:dim], np.column_stack([np.hypot(at[:, 0], at[:, 1]), angle, at[:, 2]])[:, :dim]


def decimals(values: FloatArray) -> int:
    """Return the decimals that give the largest of some numbers (k,) four significant digits."""
    largest = float(np.abs(values).max(initial=0.0))
    return 0 if not largest > 0 else int(np.clip(3 - np.floor(np.log10(largest)), 0, 12))


def nearest_boundary(mesh: Mesh, point: FloatArray) -> tuple[str, float] | None:
    """Return the name of the boundary nearest to a point (d,) and its distance, or None."""
    distances = [(_distance(mesh, marker, point), marker.name) for marker in mesh.markers]
    far, name = min(distances, default=(np.inf, ""))
    return (name, far) if np.isfinite(far) else None


def _distance(mesh: Mesh, marker: Marker, point: FloatArray) -> float:
    """Return the distance from a point (d,) to the elements at a boundary's nearest nodes."""
    nodes, cells = marker.nodes, marker.cells
    if not len(nodes):
        return float("inf")
    shifts = mesh.points[nodes] - point
    squares = np.einsum("nd,nd->n", shifts, shifts)
    some = min(NEAR, len(nodes))
    near = nodes[np.argpartition(squares, some - 1)[:some]]
    at = np.flatnonzero(np.isin(cells.connectivity, near))
    elements = np.unique(np.searchsorted(cells.offsets, at, side="right") - 1)
    best = float(np.sqrt(squares.min()))
    for element in elements:
        begin, end = cells.offsets[element : element + 2]
        corners = mesh.points[cells.connectivity[begin:end]]
        best = min(best, _to_polygon(corners, point))
    return best


def _to_polygon(corners: FloatArray, point: FloatArray) -> float:
    """Return the distance of a point (d,) from a line segment (2, d) or a face (k, 3)."""
    start, end = corners, np.roll(corners, -1, axis=0)
    along = end - start
    square = np.maximum(np.einsum("nd,nd->n", along, along), 1e-300)
    part = np.clip(np.einsum("nd,nd->n", point - start, along) / square, 0.0, 1.0)
    far = float(np.linalg.norm(start + part[:, None] * along - point, axis=1).min())
    for k in range(1, len(corners) - 1 if corners.shape[1] == 3 else 0):
        u, v, w = corners[k] - corners[0], corners[k + 1] - corners[0], point - corners[0]
        normal = np.cross(u, v)
        area = float(normal @ normal)
        if area > 0:
            a, b = np.cross(w, v) @ normal / area, np.cross(u, w) @ normal / area
            if a >= 0 and b >= 0 and a + b <= 1:
                far = min(far, abs(float(w @ normal)) / area**0.5)
    return far
