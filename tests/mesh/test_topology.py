"""Boundary topology: owners, outward normals, fans, pieces, against loops and by construction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from slideviz.errors import MeshError
from slideviz.mesh.fans import components, fan_normals, find_fans, find_pieces, smooth_joints
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.topology import facet_vectors, find_boundary, unit
from tests import builders
from tests.oracles import geometry

MESHES = {
    "square": lambda: builders.square(6),
    "triangles": lambda: builders.square(6, "simplex"),
    "mixed 2D": lambda: builders.square(6, "mixed"),
    "sector": lambda: builders.sector(6),
    "airfoil": lambda: builders.airfoil(),
    "cube": lambda: builders.cube(4),
    "tetrahedra": lambda: builders.cube(4, "simplex"),
    "prisms": lambda: builders.cube(4, "prism"),
    "mixed 3D": lambda: builders.cube(4, "mixed"),
    "passage": lambda: builders.passage(),
    "sphere": lambda: builders.sphere_in_box(),
}


@pytest.fixture(params=MESHES, scope="module")
def mesh(request):
    return MESHES[request.param]()


def fans_at(fans, node):
    return np.flatnonzero(fans.fan_node == node)


def node_at(mesh, *place):
    return int(np.argmin(np.linalg.norm(mesh.points - np.array(place), axis=1)))


def test_every_facet_belongs_to_the_cell_whose_side_it_is(mesh):
    boundary = find_boundary(mesh)
    for facet, owner in zip(boundary.facets, boundary.owner, strict=True):
        start, stop = mesh.cells.offsets[owner : owner + 2]
        assert set(facet) <= set(mesh.cells.connectivity[start:stop])


def test_normals_point_out_of_the_mesh(mesh):
    boundary = find_boundary(mesh)
    found = unit(facet_vectors(mesh.points, boundary.facets))
    for facet, normal in zip(boundary.facets.tolist(), found, strict=True):
        expected = geometry.outward_normal(mesh, list(dict.fromkeys(facet)))
        np.testing.assert_allclose(normal, expected, atol=1e-12)


def test_the_closed_boundary_has_no_net_area(mesh):
    # The divergence theorem for a constant field: the vectors of all facets add up to zero.
    vectors = facet_vectors(mesh.points, find_boundary(mesh).facets)
    np.testing.assert_allclose(vectors.sum(axis=0), 0.0, atol=1e-12)


def test_normals_do_not_depend_on_the_order_of_nodes_in_the_markers(mesh):
    turned = []
    for marker in mesh.markers:
        blocks = [(t, nodes[:, ::-1]) for t, (_, nodes) in marker.cells.by_type.items()]
        turned.append(Marker(marker.name, Cells.from_blocks(blocks)))
    other = Mesh(mesh.points, mesh.cells, tuple(turned))
    for one, two in zip(find_boundary(mesh).facets, find_boundary(other).facets, strict=True):
        a, b = (facet_vectors(mesh.points, f[None])[0] for f in (one, two))
        np.testing.assert_allclose(a, b, atol=1e-14)


def test_a_closed_boundary_has_each_joint_once(mesh):
    boundary = find_boundary(mesh)
    sides = sum(len(set(f)) for f in boundary.facets.tolist())
    assert len(boundary.joints) * 2 == sides
    for (a, b), shared in zip(boundary.joints, boundary.joint_nodes, strict=True):
        assert set(shared) <= set(boundary.facets[a]) & set(boundary.facets[b])


def test_fan_normals_are_the_inverse_distance_mean(mesh):
    boundary = find_boundary(mesh)
    fans = find_fans(boundary, mesh.points, 179.0)
    found = fan_normals(boundary, fans, mesh.points)
    for node in boundary.nodes[::3]:
        for fan in fans_at(fans, node):
            name = boundary.names[fans.fan_marker[fan]]
            # A block is smooth all round at 179 degrees; one fan for each marker at a node.
            expected = geometry.node_normal(mesh, node, name)
            np.testing.assert_allclose(found[fan], expected, atol=1e-12)


@pytest.mark.parametrize("kind", ["plain", "simplex", "prism", "mixed"])
def test_a_box_has_one_fan_for_each_side_a_node_is_on(kind):
    mesh = builders.cube(4, kind, block=False)
    boundary = find_boundary(mesh)
    fans = find_fans(boundary, mesh.points)
    on_side = (np.isclose(mesh.points, 0) | np.isclose(mesh.points, 1)).sum(axis=1)
    np.testing.assert_array_equal(np.bincount(fans.fan_node, minlength=len(on_side)), on_side)
    normals = fan_normals(boundary, fans, mesh.points)
    np.testing.assert_allclose(np.abs(normals).max(axis=1), 1.0, atol=1e-15)


@pytest.mark.parametrize("kind", ["plain", "simplex", "prism", "mixed"])
def test_one_marker_around_a_box_splits_into_six_pieces(kind):
    mesh = builders.cube(4, kind, block=False)
    blocks = [
        b for m in mesh.markers for b in ((t, nodes) for t, (_, nodes) in m.cells.by_type.items())
    ]
    whole = Mesh(mesh.points, mesh.cells, (Marker("wall", Cells.from_blocks(blocks)),))
    boundary = find_boundary(whole)
    piece = find_pieces(boundary, whole.points)
    assert piece.max() == 5
    normal = unit(facet_vectors(whole.points, boundary.facets))
    for k in range(6):
        assert np.ptp(normal[piece == k], axis=0).max() < 1e-14
    fans = find_fans(boundary, whole.points)
    corner = node_at(whole, 0, 0, 0)
    assert len(fans_at(fans, corner)) == 3


def test_the_feature_angle_decides():
    mesh = builders.sector(6, angle_deg=30.0)
    inner = mesh.marker("inner")
    only = Mesh(mesh.points, mesh.cells, (inner,))
    boundary = find_boundary(only)
    assert len(boundary.joints) == 5
    assert smooth_joints(boundary, mesh.points, 5.01).all()  # 30 degrees in six segments
    assert not smooth_joints(boundary, mesh.points, 4.99).any()
    assert find_pieces(boundary, mesh.points, 4.99).max() == 5


def test_a_sharp_trailing_edge_has_two_normals_though_the_marker_is_closed():
    mesh = builders.airfoil(n=40)
    boundary = find_boundary(mesh)
    fans = find_fans(boundary, mesh.points)
    edge = node_at(mesh, 1.0, 0.0)
    normals = fan_normals(boundary, fans, mesh.points)[fans_at(fans, edge)]
    assert len(normals) == 2
    # Into the profile: the boundary of the mesh looks out of the cells around it.
    assert sorted(np.sign(normals[:, 1])) == [-1, 1]
    np.testing.assert_allclose(normals[0, 1], -normals[1, 1], atol=1e-12)
    front = node_at(mesh, 0.0, 0.0)
    assert len(fans_at(fans, front)) <= 2
    assert find_pieces(boundary, mesh.points)[boundary.marker == 0].max() >= 0


def test_markers_split_smooth_surfaces():
    mesh = builders.annulus(far_parts=2)
    boundary = find_boundary(mesh)
    fans = find_fans(boundary, mesh.points)
    for angle in (0.0, np.pi):
        node = node_at(mesh, 2 * np.cos(angle), 2 * np.sin(angle))
        assert len(fans_at(fans, node)) == 2
    assert len(np.unique(find_pieces(boundary, mesh.points))) == 3


def test_the_two_faces_of_a_thin_plate_look_at_each_other():
    mesh = builders.plate()
    boundary = find_boundary(mesh)
    normal = unit(facet_vectors(mesh.points, boundary.facets))
    below = normal[boundary.marker == boundary.names.index("below")]
    above = normal[boundary.marker == boundary.names.index("above")]
    np.testing.assert_allclose(below, [[0, 1]] * 4, atol=1e-15)
    np.testing.assert_allclose(above, [[0, -1]] * 4, atol=1e-15)


def test_a_facet_that_is_no_side_of_a_cell_is_refused():
    mesh = builders.square(4, block=False)
    across = Marker("odd", Cells.from_blocks([(3, [[0, 6]])]))
    wrong = Mesh(mesh.points, mesh.cells, (*mesh.markers, across), name="a.su2")
    with pytest.raises(MeshError, match=r"a\.su2: marker 'odd' .* nodes 0, 6 .* not a side"):
        find_boundary(wrong)


def test_a_triangle_on_half_of_a_quadrilateral_is_no_side():
    mesh = builders.cube(2, block=False)
    quad = mesh.marker("z_m").cells.by_type[9][1][0]
    half = Marker("half", Cells.from_blocks([(5, [quad[:3]])]))
    with pytest.raises(MeshError, match=r"marker 'half'.*not a side of any cell"):
        find_boundary(Mesh(mesh.points, mesh.cells, (half,)))


def test_a_mesh_without_markers_has_an_empty_boundary():
    mesh = builders.square(4, block=False)
    boundary = find_boundary(Mesh(mesh.points, mesh.cells))
    assert boundary.facets.shape == (0, 2)
    fans = find_fans(boundary, mesh.points)
    assert len(fans.fan_node) == 0
    assert fan_normals(boundary, fans, mesh.points).shape == (0, 2)


def test_a_marker_inside_the_domain_looks_one_way():
    mesh = builders.square(6, block=False)
    row = np.flatnonzero(np.isclose(mesh.points[:, 1], 0.5))
    row = row[np.argsort(mesh.points[row, 0])]
    inside = Marker("interface", Cells.from_blocks([(3, np.stack([row[:-1], row[1:]], axis=1))]))
    boundary = find_boundary(Mesh(mesh.points, mesh.cells, (*mesh.markers, inside)))
    normal = unit(facet_vectors(mesh.points, boundary.facets))[boundary.marker == 4]
    assert np.ptp(normal, axis=0).max() < 1e-14


@settings(max_examples=60, deadline=None)
@given(count=st.integers(0, 30), data=st.data())
def test_parts_are_those_that_scipy_finds_in_its_order(count, data):
    place = st.integers(0, max(count - 1, 0))
    pairs = data.draw(st.lists(st.tuples(place, place), max_size=40 if count else 0))
    a, b = np.array(pairs, np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    expected = connected_components(graph, directed=False)[1] if count else np.empty(0)
    np.testing.assert_array_equal(components(count, a, b), expected)
