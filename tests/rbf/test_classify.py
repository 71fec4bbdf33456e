"""Which node may do what: against counting on grids, and where the topology is awkward."""

from __future__ import annotations

import numpy as np
import pytest

from slideviz.mesh.fans import fan_normals, find_fans
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.topology import find_boundary
from slideviz.rbf.classify import classify, directions, fan_roles
from tests import builders
from tests.oracles import geometry

MODES = [
    (sliding, periodic)
    for sliding in ("none", "ps")
    for periodic in ("none", "periodic", "fixed", "moving")
    if (sliding, periodic) != ("none", "moving")
]


def found(mesh, roles, method=("ps", "none"), angle=40.0, images=()):
    boundary = find_boundary(mesh)
    fans = find_fans(boundary, mesh.points, angle)
    normals = fan_normals(boundary, fans, mesh.points)
    representative = np.arange(len(mesh.points))
    for first, second in images:
        representative[second] = first
    role = fan_roles(boundary, fans, roles)
    classes = classify(
        fans,
        role,
        normals,
        representative,
        sliding=method[0],
        periodic=method[1],
        feature_angle_deg=angle,
    )
    return classes, directions(classes, normals)


def box_roles(dim, across=1):
    sides = ("x_m", "x_p", "y_m", "y_p", "z_m", "z_p")[: 2 * dim]
    roles = dict.fromkeys(sides, "sliding")
    roles |= dict.fromkeys(sides[2 * across : 2 * across + 2], "periodic")
    return roles | {"BLOCK": "moving"}


def node_at(mesh, *place):
    return int(np.argmin(np.linalg.norm(mesh.points - np.array(place), axis=1)))


@pytest.mark.parametrize("method", MODES)
@pytest.mark.parametrize(
    ("build", "n"),
    [
        (lambda: builders.square(6), 6),
        (lambda: builders.square(6, "simplex"), 6),
        (lambda: builders.square(6, "mixed"), 6),
        (lambda: builders.cube(6), 6),
        (lambda: builders.cube(6, "simplex"), 6),
        (lambda: builders.cube(6, "prism"), 6),
        (lambda: builders.cube(6, "mixed"), 6),
    ],
    ids=["quad", "tri", "mixed 2D", "hex", "tet", "prism", "mixed 3D"],
)
def test_classes_of_a_box_by_counting(build, n, method):
    mesh = build()
    classes, (nodes, normals) = found(mesh, box_roles(mesh.dim), method)
    places = (mesh.points * n).round(6)
    block = set(mesh.marker("BLOCK").nodes.tolist())
    expected = geometry.box_classes(places, n, block, *method, axis=1)
    assert set(classes.moving.tolist()) == block
    assert set(classes.fixed.tolist()) == expected["fixed"]
    assert set(classes.edge.tolist()) == expected["edge"]
    assert set(classes.surface.tolist()) == expected["surface"]
    assert classes.counts()["internal"] == len(expected["internal"])
    for node in classes.sliding:
        rows = normals[nodes == node]
        np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-13)
        solid = [
            a
            for a in range(mesh.dim)
            if places[node, a] in (0, n) and not (a == 1 and method[1] in ("fixed", "moving"))
        ]
        along = np.delete(np.eye(mesh.dim), solid, axis=0)
        np.testing.assert_allclose(rows @ along.T, 0.0, atol=1e-13)


@pytest.mark.parametrize("kind", ["plain", "simplex", "prism", "mixed"])
def test_one_marker_around_the_box_gives_the_same_classes(kind):
    """Edges and corners inside one marker, which counting facets cannot see."""
    mesh = builders.cube(6, kind)
    outer = [
        b
        for m in mesh.markers
        if m.name != "BLOCK"
        for b in ((t, nodes) for t, (_, nodes) in m.cells.by_type.items())
    ]
    joined = Mesh(
        mesh.points, mesh.cells, (Marker("all", Cells.from_blocks(outer)), mesh.marker("BLOCK"))
    )
    one, _ = found(joined, {"all": "sliding", "BLOCK": "moving"})
    six, _ = found(mesh, {**box_roles(3), "y_m": "sliding", "y_p": "sliding"})
    for name in ("moving", "fixed", "edge", "surface"):
        np.testing.assert_array_equal(getattr(one, name), getattr(six, name))


@pytest.mark.parametrize("method", MODES)
def test_moving_wins_over_fixed_and_fixed_over_sliding(method):
    mesh = builders.cube(4, block=False)
    roles = box_roles(3) | {"x_m": "moving", "z_m": "fixed"}
    roles.pop("BLOCK")
    classes, _ = found(mesh, roles, method)
    assert set(classes.moving) == set(mesh.marker("x_m").nodes)
    held = set(mesh.marker("z_m").nodes) - set(classes.moving)
    assert held <= set(classes.fixed)


def test_a_marker_without_role_is_fixed():
    mesh = builders.square(6)
    classes, _ = found(mesh, {"BLOCK": "moving"})
    assert classes.counts() == {
        "moving": 8,
        "fixed": 24,
        "sliding_edge": 0,
        "sliding_surface": 0,
        "internal": 16,
    }


PASSAGE = {
    "hub": "internal",
    "shroud": "internal",
    "inflow": "sliding",
    "outflow": "sliding",
    "per1": "periodic",
    "per2": "periodic",
    "blade": "moving",
}


def passage_node(shape, i, j, k):
    r, t, z = 0.5 + 0.5 * i / shape[0], np.radians(30.0 * j / shape[1]), k / shape[2]
    return r * np.cos(t), r * np.sin(t), z


@pytest.mark.parametrize("kind", ["plain", "simplex", "prism"])
def test_hub_and_shroud_of_a_passage(kind):
    """Thesis section 4.2.3: internal surfaces, whose rim keeps them in place."""
    shape = (4, 6, 8)
    mesh = builders.passage(shape, kind=kind)
    classes, (nodes, normals) = found(mesh, PASSAGE, ("ds", "moving"))
    assert set(classes.moving) == set(mesh.marker("blade").nodes)
    assert len(classes.fixed) == 0
    on = {name: set(mesh.marker(name).nodes.tolist()) for name in mesh.marker_names}
    rim = (on["hub"] | on["shroud"]) - on["blade"]
    rings = on["inflow"] | on["outflow"]
    periodic = on["per1"] | on["per2"]
    assert set(classes.edge) == rim & rings
    expected = ((rings - rim) | (rim & periodic)) - rings | (rings - rim)
    assert set(classes.surface) == expected
    inside = rim - rings - periodic
    assert inside
    assert not inside & set(classes.sliding)
    # hub with inflow: the normals of both, so the node slides along the ring.
    node = node_at(mesh, *passage_node(shape, 0, 2, 0))
    rows = normals[nodes == node]
    ring = np.cross([0, 0, 1], mesh.points[node])
    # Triangles do not lie evenly around the node, so its normal leans a little.
    np.testing.assert_allclose(rows @ ring, 0.0, atol=0.01 if kind == "simplex" else 1e-12)
    # hub with a periodic boundary: the hub's normal alone, which is radial but for the facets.
    node = node_at(mesh, *passage_node(shape, 0, 0, 4))
    rows = normals[nodes == node]
    assert len(rows) == 1
    radius = mesh.points[node] * [1, 1, 0]
    assert abs(rows[0] @ radius) / np.linalg.norm(radius) > 0.99


def test_hub_of_a_passage_with_fixed_vertices():
    shape = (4, 6, 8)
    mesh = builders.passage(shape)
    classes, _ = found(mesh, PASSAGE, ("ds", "fixed"))
    corners = {
        node_at(mesh, *passage_node(shape, i, j, k)) for i in (0, 4) for j in (0, 6) for k in (0, 8)
    }
    assert set(classes.fixed) == corners


def test_an_internal_marker_that_meets_no_other_is_free():
    mesh = builders.annulus()
    classes, _ = found(mesh, {"wall": "moving", "far0": "internal"})
    assert not len(classes.sliding)
    assert not len(classes.fixed)
    assert classes.counts()["internal"] == len(mesh.points) - 24


def test_a_sharp_trailing_edge_stays_and_the_rest_of_the_profile_slides():
    mesh = builders.airfoil(n=40)
    classes, _ = found(mesh, {"far": "moving", "airfoil": "sliding"})
    assert node_at(mesh, 1.0, 0.0) in classes.fixed
    # Blunt corners of a coarse nose may be held too, nothing else.
    held = mesh.points[np.setdiff1d(classes.fixed, [node_at(mesh, 1.0, 0.0)])]
    assert np.all(held[:, 0] < 0.05) if len(held) else True
    assert len(classes.edge) >= 36


@pytest.mark.parametrize("parts", [1, 2, 3, 4])
def test_a_circular_far_field_in_several_markers_slides_all_round(parts):
    mesh = builders.annulus(n=48, far_parts=parts)
    roles = {"wall": "moving"} | {f"far{k}": "sliding" for k in range(parts)}
    classes, (nodes, normals) = found(mesh, roles)
    assert len(classes.fixed) == 0
    assert len(classes.edge) == 48
    out = mesh.points[nodes] / np.linalg.norm(mesh.points[nodes], axis=1)[:, None]
    np.testing.assert_allclose(normals, out, atol=1e-12)


def halves(dim):
    """A box whose lower side is two markers in one plane."""
    shape = (4,) * dim
    rules = builders.box_rules(shape)
    rules[2] = ("low1", lambda p: bool(np.all(p[:, 1] == 0) and p[:, 0].max() <= 2))
    rules.insert(3, ("low2", lambda p: bool(np.all(p[:, 1] == 0))))
    return builders.grid(shape, rules=rules)


@pytest.mark.parametrize("second", ["sliding", "periodic", "internal"])
@pytest.mark.parametrize("dim", [2, 3])
def test_two_roles_in_one_plane_are_one_constraint(dim, second):
    mesh = halves(dim)
    sides = ("x_m", "x_p", "y_p", "z_m", "z_p")
    roles = {s: "sliding" for s in sides if s in mesh.marker_names}
    roles |= {"x_p": "moving", "low1": "sliding", "low2": second}
    classes, (nodes, normals) = found(mesh, roles, ("ds", "none"))
    between = np.isclose(mesh.points[:, 0], 0.5) & np.isclose(mesh.points[:, 1], 0)
    if dim == 3:
        between &= (mesh.points[:, 2] > 0) & (mesh.points[:, 2] < 1)
    assert np.all(np.isfinite(normals))
    for node in np.flatnonzero(between):
        rows = normals[nodes == node]
        assert len(rows) == 1
        np.testing.assert_allclose(np.abs(rows[0]), np.eye(dim)[1], atol=1e-14)
        assert node in (classes.edge if dim == 2 else classes.surface)


def test_the_faces_of_a_thin_plate_slide_but_its_tips_do_not():
    mesh = builders.plate()
    roles = dict.fromkeys(("below", "above"), "sliding") | {"x_m": "moving"}
    classes, _ = found(mesh, roles)
    tips = {node_at(mesh, 0.25, 0.5), node_at(mesh, 0.75, 0.5)}
    assert tips <= set(classes.fixed)
    assert len(classes.edge) == 6


def test_normals_of_sliding_nodes_are_the_inverse_distance_mean():
    mesh = builders.sphere_in_box(6)
    roles = {"x_m": "moving", "sphere": "sliding"}
    _, (nodes, normals) = found(mesh, roles)
    assert set(nodes) == set(mesh.marker("sphere").nodes)
    for node, normal in list(zip(nodes, normals, strict=True))[::5]:
        np.testing.assert_allclose(normal, geometry.node_normal(mesh, node, "sphere"), atol=1e-12)


def test_periodic_partners_have_one_normal():
    """On a periodic edge a curved surface goes on beyond it: both sides count."""
    from slideviz.mesh.periodic import match

    n = 6
    height = 1 + 0.05 * np.sin(2 * np.pi * np.arange(n + 1) / n + 1.2)
    mesh = builders.grid(
        (n, n, n),
        place=lambda p: np.column_stack(
            [p[:, 0] / n, p[:, 1] / n, p[:, 2] / n * height[p[:, 1].astype(int)]]
        ),
    )
    roles = {
        "x_m": "moving",
        "x_p": "sliding",
        "z_p": "sliding",
        "z_m": "sliding",
        "y_m": "periodic",
        "y_p": "periodic",
    }
    pairs = match(mesh, "y_m", "y_p").nodes
    _, (nodes, normals) = found(mesh, roles, ("ds", "moving"), images=pairs)
    one, two = node_at(mesh, 0.5, 0, 1), node_at(mesh, 0.5, 1, 1)
    a, b = normals[nodes == one], normals[nodes == two]
    np.testing.assert_allclose(a, b, atol=1e-13)
    # The same wave one period on: the facets before and after the node, equally far from it.
    slopes = np.array([height[1] - height[0], height[n] - height[n - 1]]) * n
    sides = np.stack([0 * slopes, -slopes, 1 + 0 * slopes], axis=1)
    mean = (sides / np.linalg.norm(sides, axis=1)[:, None]).sum(axis=0)
    np.testing.assert_allclose(a[0], mean / np.linalg.norm(mean), atol=1e-12)
    assert abs(slopes[0] - slopes[1]) > 0.1
