"""The layer zone of a case: its walls, their thickness, and the nodes that go with them.

The thickness is found from the cells at the boundary alone, as a streamed mesh has them: a layer of
height h on facets of length l, growing by a fifth from cell to cell, is 2 l - 6 h thick where its
cells are a third as high as long; where they are h from the beginning, the zone fades over h. Of a
wall it is the median of its facets, and less where these are shorter.
"""

from __future__ import annotations

import numpy as np

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.errors import point_words
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.fans import components
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh, Skin, row_dots, row_norms
from slideviz.mesh.topology import TINY, facet_vectors, unit
from slideviz.mesh.walls import BADNESS, Columns, Walls, find_columns
from slideviz.rbf.layers import KeptLayers, LayerZone, Wall, find_zone, wall_nodes
from slideviz.rbf.tape import value
from slideviz.solver.domain import Domain

STEEP = 3.0  # largest first height that is kept, over the median of the wall
SHARP = -0.25
"""Cosine between the normals of the sides of a sharp edge, at most: it has an angle below 75°. The
sides of blunter edges turn as one: nodes that see both would come nearer to the edge else."""
CHANGED = 1.5  # ratio of first heights, after over before or reverse, from which on a run warns
TOUCHING = 1e-9  # distance over the thickness of a zone up to which walls touch each other
ALONG = 0.5  # cosine to the normal of the wall from which an edge leads out of its layers
LEAST = 0.02  # least part of the heights of layers that is left
SIZE = 0.02  # largest automatic thickness of a zone over the largest extent of its wall
NARROW = 1.5  # largest thickness of a zone at a node over that by the facets there


def layer_zone(case: Case, mesh: Mesh, domain: Domain, known: IntArray) -> LayerZone | None:
    """Return the nodes that go with walls (LAYERS), or None; ``known`` (a,): moving and fixed."""
    if case.layers == "no" or case.method != "rbf":
        return None
    walls = _walls(case, mesh, domain)
    if not walls:
        return None
    free = domain.classes.representative == np.arange(len(mesh.points))
    free &= ~domain.axis
    free[known] = False
    if mesh.halo is not None:
        free[np.setdiff1d(mesh.halo.receivers, domain.images)] = False
        free[mesh.halo.outer] = False
    nodes = np.flatnonzero(free)
    frame = domain.frame
    targets = frame.points(domain.coords[nodes])
    slides = np.isin(nodes, domain.classes.sliding)
    return find_zone(wall_nodes(frame, domain.coords, known, walls), nodes, targets, slides)


@record
class Room:
    """The corners of cells beside the layers that walls hold."""

    zone: LayerZone
    rows: IntArray  # (c,): the nodes of the corners, by places in the zone
    corners: IntArray
    """(c, d + 1): these nodes, those beyond the layers, and those along the wall."""
    height: FloatArray  # (c,): undeformed, of the second over the others

    @classmethod
    def beside(cls, zone: LayerZone, cells: Cells, points: FloatArray) -> Room:
        """Return the room beside the layers of a zone; ``points`` (n, d): undeformed."""
        place = np.full(len(points), -1)
        rigid = np.flatnonzero(np.isin(zone.nodes, zone.rigid))
        place[zone.nodes[rigid]] = rigid
        normal = unit(zone.start - value(zone.feet(0.0 * zone.walls.places)) / zone.share)
        dim = points.shape[1]
        found = [np.empty((0, dim + 1), np.int64)]
        for vtk, (_, nodes) in cells.by_type.items():
            near = nodes[(place[nodes] >= 0).any(axis=1)]
            table = np.array(ELEMENTS[vtk].corners)
            if len(table) == 1:  # of a simplex all corners are alike
                table = np.stack([np.roll(table[0], k) for k in range(dim + 1)])
            for k in range(dim):
                turned = np.c_[table[:, :1], np.roll(table[:, 1:], k, axis=1)]
                found.append(near[:, turned].reshape(-1, dim + 1))
        corners = np.concatenate(found)
        row = place[corners[:, 0]]
        corners = corners[row >= 0]
        row = row[row >= 0]
        edges = points[corners[:, 1:]] - points[corners[:, :1]]
        rise = np.einsum("ckd,cd->ck", edges, normal[row]) / row_norms(edges)
        end = place[corners[:, 1]]
        alike = (end >= 0) & (row_dots(normal[row], normal[end]) > 0.0)
        height = _heights(points, corners)
        beyond = (rise[:, 0] > ALONG) & (rise[:, 1:] <= ALONG).all(axis=1) & ~alike
        beyond &= np.abs(height) > ALONG * row_norms(edges[:, 0])
        return cls(zone, row[beyond], corners[beyond], height[beyond])

    def heights(self, points: FloatArray, gap: float) -> FloatArray:
        """Return the part of their height (z,) that layers may keep, nodes at ``points`` (n, d).

        It is 1 where cells beside them keep at least the part ``gap`` of their height. Where they
        keep a part s it is (s / gap)^(3/2), at least s: cells beside layers are pressed more than
        these, by a factor of 1 / gap at most.
        """
        left = np.maximum(_heights(points, self.corners) / self.height, LEAST)
        height = np.ones(len(self.zone.nodes))
        np.minimum.at(height, self.rows, np.maximum((left / gap) ** 1.5, left))
        return self.zone.lowered(height) if (height < 1.0).any() else height


def _heights(points: FloatArray, corners: IntArray) -> FloatArray:
    """Return how high (c,) the second nodes of ``corners`` (c, d + 1) are over the others, signed.

    ``points`` (n, d).
    """
    edges = points[corners[:, 1:]] - points[corners[:, :1]]
    base = edges[:, 1] if edges.shape[1] == 2 else np.cross(edges[:, 1], edges[:, 2])
    return np.linalg.det(edges) / np.maximum(row_norms(base), TINY)


def _walls(case: Case, mesh: Mesh, domain: Domain) -> list[Wall]:
    boundary = domain.boundary
    points = mesh.points
    columns = find_columns(mesh, 1)
    height = columns.stack_thickness(points)
    edges = points[columns.nodes]
    rise = row_norms(edges[:, 1] - edges[:, 0])
    size = row_norms(facet_vectors(points, boundary.facets))
    length = size if mesh.dim == 2 else np.sqrt(size / 2)
    walls = []
    for role in ("moving", "fixed"):
        chosen = np.zeros(len(height), bool)
        for k, name in enumerate(boundary.names):
            mine = boundary.marker == k
            layered = case.layers == "keep" or 2 * np.count_nonzero(height[mine]) > mine.sum()
            if layered and domain.roles.get(name, "fixed") == role:
                chosen |= mine
        facets = boundary.facets[chosen]
        sides = _sides(domain, chosen)
        links = np.concatenate([facets[:, [0, k]] for k in range(1, facets.shape[1])])
        part = components(len(points), *links.T)[facets[:, 0]]
        for label in np.unique(part):
            some = np.flatnonzero(chosen)[part == label]
            extent = np.ptp(points[np.unique(boundary.facets[some])], axis=0).max()
            high = height[some]
            flat = high > 0.0
            fading = np.where(flat, np.maximum(2.0 * length[some] - 6.0 * high, high), np.inf)
            usual = np.median(fading[flat]) if flat.any() else np.inf
            thickness = _thickness(boundary.facets[some], fading, min(SIZE * extent, usual))
            if case.layer_thickness:
                thickness[:] = min(case.layer_thickness, mesh.extent)
            walls.append(
                Wall(
                    tuple(boundary.names[m] for m in np.unique(boundary.marker[some])),
                    boundary.facets[some],
                    sides[some],
                    thickness,
                    _first_heights(columns, rise, some, high[flat]),
                    role == "moving",
                )
            )
    return walls


def _thickness(facets: IntArray, fading: FloatArray, most: float) -> FloatArray:
    """Return how thick the zone is at the nodes of ``facets`` (f, 2 or 4), ascending, (w,).

    At most ``most``, and `NARROW` times the least ``fading`` (f,) of the facets at each: where
    these are short, as at a leading edge, cells are round near the wall, and would be held.
    """
    nodes, corners = np.unique(facets, return_inverse=True)
    out = np.full(len(nodes), most)
    np.minimum.at(out, corners.reshape(facets.shape), NARROW * fading[:, None])
    return out


def _sides(domain: Domain, chosen: np.ndarray) -> IntArray:
    """Return the number (f, 2 or 4) of the side of the wall that each corner of a facet belongs to.

    Fans of a node are sides of a sharp edge where their normals differ by more than `SHARP`.
    ``chosen`` (f,) bool: the facets of walls.
    """
    fans = domain.fans
    normals = domain.normals
    order = np.unique(fans.fan[chosen[fans.facet]])
    links = [np.empty((2, 0), int)]
    apart = 1
    order = order[np.argsort(fans.fan_node[order], kind="stable")]
    node = fans.fan_node[order]
    while len(at := np.flatnonzero(node[apart:] == node[: len(node) - apart])):
        one = order[at]
        two = order[at + apart]
        alike = np.einsum("jd,jd->j", normals[one], normals[two]) > SHARP
        links.append(np.stack([one[alike], two[alike]]))
        apart += 1
    side = components(len(fans.fan_node), *np.concatenate(links, axis=1))
    sides = np.zeros(domain.boundary.facets.shape, np.int64)
    for k, corner in enumerate(domain.boundary.facets.T):
        at = np.flatnonzero(fans.node == corner[fans.facet])
        sides[fans.facet[at], k] = side[fans.fan[at]]
    return sides


def _first_heights(
    columns: Columns, rise: FloatArray, some: IntArray, flat: FloatArray
) -> FloatArray:
    """Return the heights (w,) of the first layer at the nodes of facets ``some``, ascending.

    Those of the columns there, whose first edges are ``rise`` (c,) long, but at most `STEEP` times
    the median of ``flat``, the heights of flat cells; this median where there are no columns, and 0
    where no cell is flat.
    """
    facets = columns.boundary.facets[some]
    nodes = np.unique(facets)
    usual = float(np.median(flat)) if len(flat) else 0.0
    first = np.zeros(len(nodes))
    column = np.unique(columns.corner[some])
    column = column[column < len(rise)]
    np.maximum.at(first, np.searchsorted(nodes, columns.nodes[column, 0]), rise[column])
    return np.where(first > 0.0, np.minimum(first, STEEP * usual), usual)


def thickness_warnings(case: Case, mesh: Mesh, domain: Domain, zone: LayerZone | None) -> list[str]:
    """Return warnings of a LAYER_THICKNESS that does not fit its walls.

    It is more than the distance to another wall, or less than the height of the first layer. Other
    walls are moving and fixed boundaries that do not touch this one, and periodic images.
    """
    if zone is None:
        return []
    if not len(zone.nodes) and not isinstance(mesh, Skin):  # which may have none
        thickness = max(float(wall.thickness.max()) for wall, *_ in zone.walls.walls)
        sentence = (
            f"LAYERS= {case.layers.upper()} has no effect, since no node is nearer to a wall than "
            f"{thickness:.3g}; write a LAYER_THICKNESS of several cells"
        )
        return [sentence]
    if not case.layer_thickness:
        return []
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    frame = domain.frame
    coords = domain.coords
    boundary = domain.boundary
    held = [domain.roles.get(name, "fixed") in ("moving", "fixed") for name in boundary.names]
    facets = boundary.facets[np.array(held)[boundary.marker]]
    links = np.concatenate([facets[:, [0, k]] for k in range(1, facets.shape[1])])
    part = components(len(coords), *links.T)
    nodes = np.unique(facets)
    periods = [-1, 1] if np.any(frame.shift()) else []
    warnings = []
    for wall, *_ in zone.walls.walls:
        first = float(np.median(wall.first))
        thickness = float(wall.thickness.max())
        if thickness < first:
            warnings.append(
                f"LAYER_THICKNESS= {case.layer_thickness:g} is less than the height of the first "
                f"layer at {' and '.join(wall.names)}, {first:.3g}: only this layer goes with the "
                "wall; write several times that, or AUTO"
            )
        mine = np.unique(wall.facets)
        own = part[nodes] == part[mine[0]]
        near = [(nodes[~own], k) for k in (0, *periods)] + [(nodes[own], k) for k in periods]
        tree = cKDTree(frame.points(coords[mine]))
        points = (frame.points(coords[some] + k * frame.shift()) for some, k in near)
        gaps = [np.min(tree.query(each)[0], initial=np.inf) for each in points]
        room = min((gap for gap in gaps if gap > TOUCHING * thickness), default=np.inf)
        if thickness > room:
            warnings.append(
                f"LAYER_THICKNESS= {case.layer_thickness:g} is more than the distance from "
                f"{' and '.join(wall.names)} to the next wall, {room:.3g}: cells between them may "
                f"be folded; write less than {0.5 * room:.2g}, or AUTO"
            )
    return warnings


def height_warnings(
    case: Case, walls: Walls, mesh: Mesh, kept: KeptLayers | None = None
) -> list[str]:
    """Return warnings of layers whose first heights a run changed by more than `CHANGED`.

    Those at sliding boundaries count where layers are to be kept.

    ``walls``: of the deformed ``mesh``, beside the undeformed one.
    ``kept``: the layers that walls kept. Those that gave way have a warning of their own.
    """
    warnings = []
    told = [] if kept is None else [name for one in kept.gave_way for name in one.names]
    roles = ("moving", "fixed") if case.layers == "no" else ("moving", "fixed", "sliding")
    for name in walls.markers:
        known = name not in walls.layered or name in told
        if known or case.roles.get(name, "fixed") not in roles:
            continue
        at = walls.columns.places(name)
        ratio = walls.values["height_ratio"][at]
        k = int(np.argmax(np.nan_to_num(BADNESS["height_ratio"](ratio), nan=0.0)))
        if not 1.0 / CHANGED <= ratio[k] <= CHANGED and np.isfinite(ratio[k]):
            point = walls.columns.at(mesh.points, at[k])
            where = point_words(point, mesh.extent)
            warnings.append(
                f"the first height of the layers at {name} is {ratio[k]:.3g} times that before at "
                f"({where}), beyond {1.0 / CHANGED:.2g} to {CHANGED}: "
                f"{_remedy(case, mesh, name, point)}"
            )
    return warnings


def _remedy(case: Case, mesh: Mesh, name: str, point: FloatArray) -> str:
    """Return what keeps the first height that a run changed at a point of a wall."""
    if case.roles.get(name) == "sliding":
        moving = " and ".join(case.markers_with("moving"))
        return (
            f"only moving and fixed boundaries keep their layers; move {moving} less, above all "
            f"towards {name} and in turns about lines that lie in it"
        )
    if case.method != "rbf":
        return "METHOD= rbf with LAYERS= AUTO keeps it"
    if case.layers == "no":
        return "LAYERS= AUTO keeps it"
    for other in case.markers_with("sliding"):
        if other != name and (mesh.points[mesh.marker(other).nodes] == point).all(axis=1).any():
            return f"{name} leans more against {other} there; move it less"
    away = f"move {name} less" if case.roles.get(name) == "moving" else f"stay farther from {name}"
    return f"{away}, or set a smaller LAYER_THICKNESS"
