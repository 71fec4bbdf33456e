"""Distances, angles and radii between points that were picked, and move with the mesh."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import ROUNDING, point_words
from slideviz.mesh.model import FloatArray, IntArray, Marker, Mesh, row_norms
from slideviz.mesh.periodic import Pair
from slideviz.mesh.surfaces import padded
from slideviz.rbf.closest import ClosestPoints
from slideviz.session.changes import set_view
from slideviz.session.inspect import coordinates, nearest_boundary, triangles
from slideviz.session.motions import machine_pair
from slideviz.session.state import Session, second_view

HINT = (
    "Click a node or a face: its distance from the nearest other boundary. A second one: their "
    "distance. A third: angle and radius. Esc takes the last one back."
)
MOST = 3  # most points; the next one begins again


@frozen
class Pick:
    """A picked point: a node, or a place between nodes."""

    nodes: tuple[int, ...]
    weights: tuple[float, ...] = (1.0,)  # of the nodes' positions; their sum is 1

    @classmethod
    def between(cls, mesh: Mesh, nodes: IntArray, place: FloatArray) -> Pick:
        """Return a place (d,) between nodes (k,), by the weights of least squares."""
        away = mesh.points[nodes] - place
        away = away / max(float(np.abs(away).max()), 1e-300)
        rows = np.vstack([away.T, np.ones(len(nodes))])
        weights = np.linalg.lstsq(rows, np.eye(mesh.dim + 1)[-1], rcond=None)[0]
        return cls(tuple(nodes.tolist()), tuple(weights.tolist()))

    def place(self, mesh: Mesh) -> FloatArray:
        """Return where it is (d,) in a state of the mesh."""
        return np.asarray(np.array(self.weights) @ mesh.points[list(self.nodes)])


@record
class Measure:
    """What the picked points measure."""

    points: FloatArray
    """(k, d): the points; after a single one, the closest point of the nearest other boundary."""
    label: str  # the number, for the view
    words: str  # all numbers


def measure(session: Session) -> Measure | None:
    """Return what the points measure in the step that is shown; None without points."""
    picks = session.view.picks
    if not picks or session.frame is None:
        return None
    mesh = session.frame.mesh
    points = np.array([pick.place(mesh) for pick in picks])
    if len(picks) == 1:
        return _to_boundary(mesh, picks[0], points)
    sides = np.diff(padded(points), axis=0)
    lengths = row_norms(sides)
    if len(picks) == 2:
        length = point_words(lengths, mesh.extent)
        words = ", ".join(_shifts(points, machine_pair(session), mesh.extent))
        return Measure(points, length, f"Distance {length}: {words}")
    twice_area = float(np.linalg.norm(np.cross(*sides)))
    angle = float(np.degrees(np.arctan2(twice_area, -(sides[0] @ sides[1]))))
    third = float(np.linalg.norm(points[2] - points[0]))
    straight = twice_area <= ROUNDING * float(lengths.max()) ** 2
    radius = np.inf if straight else lengths.prod() * third / (2.0 * twice_area)
    words = f"Angle {angle:.6g}°, radius {radius:.6g}, sides {point_words(lengths)}, {third:.6g}"
    return Measure(points, f"{angle:.4g}°, r = {radius:.4g}", words)


def _to_boundary(mesh: Mesh, pick: Pick, points: FloatArray) -> Measure:
    node = f"Node {mesh.number(pick.nodes[0])}" if len(pick.nodes) == 1 else "Point"
    words = f"{node} at ({point_words(points[0], mesh.extent)})"
    near = nearest_boundary(mesh, points[0], beyond=1e-9 * mesh.extent)
    if near is None:
        return Measure(points, "", words)
    name, far, closest = near
    words += f": {far:.6g} from {name}, the nearest other boundary"
    return Measure(np.stack([points[0], closest]), f"{far:.5g} to {name}", words)


def _shifts(points: FloatArray, machine: Pair | None, extent: float) -> Iterator[str]:
    """Yield the differences of the coordinates of two points, in a machine the cylindrical too."""
    for around in dict.fromkeys((None, machine)):
        names, places = coordinates(points, around)
        for name, shift in zip(names, places[1] - places[0], strict=True):
            if "°" in name:
                yield f"Δθ {(shift + 180.0) % 360.0 - 180.0:.6g}°"
            elif around is None or name not in "xyz":
                yield f"Δ{name} {point_words([shift], extent)}"


def measure_words(session: Session) -> str:
    """Return what is measured, in words, with the number in a second view; "" if nothing is."""
    if session.view.picks is None:
        return ""
    other = second_view(session)
    beside = None if other is session else measure(other)
    found = measure(session)
    if found is None:
        return HINT
    return found.words if beside is None else f"{found.words}; in the other view {beside.label}"


# Changes ---------------------------------------------------------------------------------
def toggle_measure(session: Session) -> Session:
    """Return the session in which clicks pick points, or no longer.

    Of two selected boundaries the points nearest to each other are picked at once.
    """
    if session.view.picks is not None or session.frame is None:
        return set_view(session, picks=None)
    mesh = session.frame.mesh
    both = [marker for marker in mesh.markers if marker.name in session.view.selected]
    picks = _closest_pair(mesh, *both) if len(both) == 2 else ()
    return set_view(session, picks=picks, handle="")


def _closest_pair(mesh: Mesh, first: Marker, second: Marker) -> tuple[Pick, ...]:
    """Return a node of one boundary and the nearest place on the other, the closest such pair."""
    found: list[tuple[float, tuple[Pick, ...]]] = []
    for one, other in ((first, second), (second, first)):
        facets = triangles(other.cells)
        starts = mesh.points[one.nodes]
        places, which = ClosestPoints(mesh.points[facets]).nearest(starts)
        far = row_norms(places - starts)
        at = int(far.argmin())
        end = Pick.between(mesh, facets[which[at]], places[at])
        found.append((float(far[at]), (Pick((int(one.nodes[at]),)), end)))
    return min(found, key=lambda pair: pair[0])[1]


def add_pick(session: Session, pick: Pick) -> Session:
    """Return the session with one more point; after `MOST` it is the first again."""
    picks = session.view.picks or ()
    return set_view(session, picks=(*picks, pick) if len(picks) < MOST else (pick,))


def drop_pick(session: Session) -> Session:
    """Return the session without the last point; without any, clicks pick none any more."""
    picks = session.view.picks
    return set_view(session, picks=picks[:-1] if picks else None)
