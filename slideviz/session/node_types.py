"""The types of boundary nodes for the view: moving, sliding, periodic and so on."""

from __future__ import annotations

import numpy as np

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.case.zone_cases import each_zone
from slideviz.errors import MeshError, SlidevizError
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.fans import Fans, find_fans
from slideviz.mesh.model import IntArray, Mesh
from slideviz.session.motions import shown_case
from slideviz.session.state import Session
from slideviz.solver.domain import find_classes, find_period, roles_of_copies
from slideviz.system.weak_cache import WeakCache, weak_cache
from slideviz.terms import NODE_TYPES, NodeType


@record
class TypedNodes:
    """Nodes to be drawn as points, each with its type."""

    nodes: IntArray  # (k,): the nodes, ascending
    kinds: IntArray  # (k,): the types of the nodes, as places in ``NODE_TYPES``

    @property
    def present(self) -> tuple[NodeType, ...]:
        """Return the types that occur, in the order of ``NODE_TYPES``."""
        there = set(np.unique(self.kinds).tolist())
        return tuple(kind for place, kind in enumerate(NODE_TYPES) if place in there)

    def only(self, nodes: IntArray) -> TypedNodes:
        """Return the typed nodes that are also in ``nodes``."""
        keep = np.isin(self.nodes, nodes)
        return TypedNodes(self.nodes[keep], self.kinds[keep])


NOTHING = TypedNodes(np.empty(0, np.int64), np.empty(0, np.int64))  # no nodes


def typed_nodes(session: Session) -> TypedNodes:
    """Return the nodes that a session's view shows as points; hidden boundaries count, too."""
    mesh = session.mesh
    if mesh is None or session.view.points == "none":
        return NOTHING
    if session.view.points == "control":
        return control_nodes(session)
    # A step has the types of its run's case, which the session's may have left since.
    case = shown_case(session)
    roles = tuple(case.roles.get(name, "fixed") for name in mesh.marker_names)
    period = case.periodic, case.periodic_type, case.axis, case.origin
    key = roles, case.sliding, period, case.feature_angle_deg
    return _TYPES.of(mesh, key, lambda: _classified(mesh, case))


_TYPES = WeakCache()


def _classified(mesh: Mesh, case: Case) -> TypedNodes:
    try:
        zones = list(each_zone(case, mesh))
    except SlidevizError:
        return NOTHING
    each = [_types_of_zone(one, zone) for one, zone in zones]
    first = [part.points.start for part in mesh.parts]
    return TypedNodes(
        np.concatenate([t.nodes + start for t, start in zip(each, first, strict=True)]),
        np.concatenate([typed.kinds for typed in each]),
    )


@weak_cache
def _fans(mesh: Mesh, angle_deg: float) -> Fans:
    return find_fans(boundary_of(mesh), mesh.points, angle_deg)


def _types_of_zone(case: Case, mesh: Mesh) -> TypedNodes:
    if not mesh.markers:
        return NOTHING
    case, _ = roles_of_copies(case, mesh)
    boundary = boundary_of(mesh)
    fans = _fans(mesh, case.feature_angle_deg)
    try:
        try:
            _, frame, _, stands = find_period(case, mesh, boundary)
        except MeshError:  # markers that do not match (yet) are taken as not periodic
            alone = case.change(periodic="none", periodic_type="translational")
            _, frame, _, stands = find_period(alone, mesh, boundary)
        classes = find_classes(case, mesh, boundary, fans, frame, stands)
    except SlidevizError:
        return NOTHING  # the message is beside the Run button
    place = {kind: index for index, kind in enumerate(NODE_TYPES)}
    kinds = np.full(len(mesh.points), place["internal"])
    for marker in mesh.markers:
        if case.roles.get(marker.name) == "periodic":
            kinds[marker.nodes] = place["periodic"]
    kinds[classes.surface] = place["sliding_surface"]
    kinds[classes.edge] = place["sliding_edge"]
    kinds[classes.fixed] = place["fixed"]
    kinds[classes.moving] = place["moving"]
    nodes = boundary.nodes
    return TypedNodes(nodes, kinds[nodes])


def control_nodes(session: Session) -> TypedNodes:
    """Return the control nodes of the step that is shown; none for the undeformed mesh."""
    step = session.frame.step if session.frame is not None else None
    if step is None:
        return NOTHING
    nodes = np.unique(step.control)
    return TypedNodes(nodes, np.full(len(nodes), list(NODE_TYPES).index("control")))
