"""Period, frame and classes of the nodes of a mesh, from the roles of a case."""

from __future__ import annotations

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.fans import Fans, fan_normals
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import Pair, pair_up
from slideviz.mesh.topology import Boundary
from slideviz.rbf.classify import Classes, classify, fan_roles
from slideviz.rbf.frames import Frame, make_frame
from slideviz.rbf.images import find_images


def roles_of_copies(case: Case, mesh: Mesh) -> tuple[Case, tuple[str, ...]]:
    """Return the case with the roles of halo copies replaced, and notes for the user.

    A boundary that is a copy of another one, by the mesh's halo, gets the other's role.
    """
    roles, notes = dict(case.roles), []
    for copy, origin in mesh.halo.sides if mesh.halo is not None else ():
        role, other = (case.roles.get(name, "fixed") for name in (copy, origin))
        roles[copy] = other
        if role == other == "periodic" and case.periodic == "none":
            notes.append(
                f"{copy} follows {origin} all the same, whose copy it is by the mesh's "
                "SEND_RECEIVE markers"
            )
        if role != other:
            notes.append(
                f"{copy} follows {origin}, whose copy it is by the mesh's SEND_RECEIVE markers; "
                f"its own role ({role}) has no effect"
            )
    return case.change(roles=roles), tuple(notes)


def find_period(
    case: Case, mesh: Mesh, boundary: Boundary
) -> tuple[tuple[Pair, ...], Frame, FloatArray, IntArray]:
    """Return periodic pairs, frame, coordinates (n, d) in it, and representatives (n,) of nodes.

    The representative of a node is the one of its periodic images that stands for all of them in
    the system; of a node without images, itself (`Classes.representative`).

    Raises
    ------
    MeshError
        Periodic markers do not match.
    """
    pairs = _pairs(case, without_halo(mesh)[0])
    periodic = case.periodic != "none"
    inside = mesh.points if mesh.halo is None else np.delete(mesh.points, mesh.halo.outer, axis=0)
    frame, coords = make_frame(inside, pairs, periodic_distance=periodic)
    if mesh.halo is not None:
        coords = frame.coords(mesh.points)
    representative = find_images(
        pairs if periodic else (), frame, coords, boundary.nodes, mesh.extent
    )
    return pairs, frame, coords, representative


def _pairs(case: Case, mesh: Mesh) -> tuple[Pair, ...]:
    """Return the periodic pairs of the case; none where neither images nor frame need them.

    With PERIODIC_MODE= none a rotational case needs them still: they give the cylindrical frame.
    """
    names = case.markers_with("periodic")
    if not names or (case.periodic == "none" and case.periodic_type != "rotational"):
        return ()
    return pair_up(mesh, names, case.periodic_type, case.axis, case.origin)


def find_classes(
    case: Case, mesh: Mesh, boundary: Boundary, fans: Fans, frame: Frame, representative: IntArray
) -> Classes:
    """Return the classes of all nodes, given their representatives ``representative`` (n,)."""
    normals = fan_normals(boundary, fans, mesh.points)
    return classify(
        fans,
        fan_roles(boundary, fans, case.roles),
        frame.turned_back(frame.coords(mesh.points[fans.fan_node]), normals),
        representative,
        sliding=case.sliding,
        periodic=case.periodic,
        feature_angle_deg=case.feature_angle_deg,
    )
