"""Linear elasticity: patch tests, scikit-fem's assembly as judge, and every kind of condition."""

from __future__ import annotations

import dataclasses
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import bsr_array
from threadpoolctl import ThreadpoolController

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.elastic import laplacian, linear, linear_systems
from slideviz.elastic.stiffness import (
    _CORNERS,
    Conditions,
    ElasticMesh,
    Stiffness,
    blocks,
    cell_volumes,
    shape,
)
from slideviz.errors import Cancelled, DeformError
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.terms import STIFFNESS_TYPES
from tests import builders
from tests.oracles import elasticity
from tools.study.flows import c_mesh

SIDES = ("x_m", "x_p", "y_m", "y_p", "z_m", "z_p")
KINDS = [(2, "plain"), (2, "simplex"), (2, "mixed"), (3, "plain"), (3, "simplex"), (3, "prism")]
ALL_KINDS = [*KINDS, (3, "mixed")]
RATIOS = 0.3, 0.49, 1e6


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def wavy(p):
    """A distorted unit box."""
    out = np.array(p)
    out[:, 0] += 0.08 * np.sin(2.0 * p[:, 1] + 0.3)
    out[:, 1] += 0.05 * p[:, 0] ** 2 + 0.02 * p[:, -1]
    return out


def distorted(dim, kind, n=4):
    shape_ = (n,) * dim
    return builders.grid(shape_, kind=kind, place=lambda p: wavy(p / n))


def free_body(mesh):
    """Conditions of a body that nothing holds."""
    n, d = mesh.points.shape
    eye = np.tile(np.eye(d), (n, 1, 1))
    return Conditions(np.arange(n), eye, np.ones(n, bool), np.zeros((n, d)), eye)


def body_of(mesh, kind="INVERSE_VOLUME", poisson=0.3):
    """A mesh as an elastic body, with walls on the first boundary."""
    walls = mesh.markers[0].nodes if mesh.markers else np.array([0])
    return ElasticMesh.at(mesh.points, blocks(mesh.cells), Stiffness(kind, poisson, walls))


def stiffness(mesh, kind="INVERSE_VOLUME", poisson=0.3):
    return body_of(mesh, kind, poisson).matrix(free_body(mesh)).toarray()


def patch(mesh, matrix, **settings):
    """Displace the whole boundary by a linear field; the displacement that all nodes got."""
    field = mesh.points @ np.asarray(matrix).T
    return displaced(mesh, field, **settings), field


def displaced(mesh, field, **settings):
    """The displacement of all nodes where all boundaries are displaced as ``field`` (n, d) is."""
    outer = np.unique(np.concatenate([m.nodes for m in mesh.markers]))
    roles = dict.fromkeys(mesh.marker_names, "moving")
    motions = (sv.Prescribed(outer, field[outer]),)
    case = Case(roles=roles, motions=motions, method="elastic", **settings)
    return last(case, mesh).mesh.points - mesh.points


@pytest.fixture
def by_iterations(monkeypatch):
    """Small systems are solved by conjugate gradients, too, on several levels."""
    monkeypatch.setattr(linear_systems, "DIRECT", {2: 0, 3: 0})
    monkeypatch.setattr(laplacian, "COARSE", 20)


# Shape functions and the matrix


@pytest.mark.parametrize("vtk", [5, 9, 10, 12, 13, 14])
def test_shape_functions_reproduce_linear_fields(vtk):
    found = shape(vtk)
    corners = np.array(_CORNERS[vtk], float)
    np.testing.assert_allclose(found.gradients.sum(axis=1), 0.0, atol=1e-14)
    linear = np.einsum("qad,ae->qde", found.gradients, corners)
    np.testing.assert_allclose(
        linear, np.broadcast_to(np.eye(corners.shape[1]), linear.shape), atol=1e-14
    )
    assert found.weights.sum() == pytest.approx(
        {5: 0.5, 9: 1, 10: 1 / 6, 12: 1, 13: 0.5, 14: 2 / 3}[vtk]
    )


@pytest.mark.parametrize(
    ("vtk", "dim", "kind"),
    [(5, 2, "simplex"), (9, 2, "plain"), (10, 3, "simplex"), (12, 3, "plain"), (13, 3, "prism")],
)
@pytest.mark.parametrize("poisson", RATIOS)
@pytest.mark.parametrize("modulus", STIFFNESS_TYPES)
def test_the_matrix_is_that_of_scikit_fem(vtk, dim, kind, modulus, poisson):
    # Parallelepipeds: there SU2's number of integration points is enough.
    skew = np.array([[1.0, 0.2, 0.1], [0.0, 0.8, 0.3], [0.1, 0.0, 1.3]])[:dim, :dim]
    sizes = np.array([0.0, 0.2, 0.5, 1.0])
    mesh = builders.grid(
        (3, 3, 2)[:dim], kind=kind, place=lambda p: sizes[p.round().astype(int)] @ skew.T
    )
    nodes = mesh.cells.by_type[vtk][1]
    wall = mesh.points[mesh.markers[0].nodes]
    distance = np.linalg.norm(mesh.points[:, None] - wall, axis=2).min(axis=1)[nodes].mean(axis=1)
    moduli = {
        "INVERSE_VOLUME": None,
        "CONSTANT_STIFFNESS": np.ones(len(nodes)),
        "SOLID_WALL_DISTANCE": 1.0 / np.where(distance > 0, distance, distance[distance > 0].min()),
    }
    wanted = elasticity.stiffness(mesh.points, vtk, nodes, poisson, moduli[modulus])
    found = stiffness(mesh, modulus, poisson)
    np.testing.assert_allclose(found, wanted, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_rigid_motions_cost_nothing_and_all_else_does(dim, kind):
    mesh = distorted(dim, kind, n=3)
    matrix = stiffness(mesh)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * np.abs(matrix).max())
    values = np.linalg.eigvalsh(matrix)
    rigid = 3 if dim == 2 else 6
    assert np.all(np.abs(values[:rigid]) < 1e-10 * values[-1])
    assert values[rigid] > 1e-6 * values[-1]


def test_a_pyramid_treats_its_base_corners_alike():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.7]], float)
    cells = Cells.from_blocks([(14, [[0, 1, 2, 3, 4]])])
    first = stiffness(Mesh(points, cells))
    turned = Mesh(points, Cells.from_blocks([(14, [[1, 2, 3, 0, 4]])]))
    np.testing.assert_allclose(first, stiffness(turned), atol=1e-12)
    # Per unit of modulus: the work of a growth alike along all axes is that of the volume.
    spread = points.ravel()
    lam_mu = (2 * 0.3 / (1.3 * 0.4) * 9 / 2 + 3 * 1 / 1.3) * 1.0
    assert spread @ first @ spread == pytest.approx(lam_mu)


@pytest.mark.parametrize(
    ("dim", "kind"), [(2, "plain"), (2, "simplex"), (3, "plain"), (3, "prism"), (3, "simplex")]
)
def test_linear_displacement_of_the_boundary_is_carried_on_inside(dim, kind):
    mesh = builders.grid((4,) * dim, kind=kind)
    rng = np.random.default_rng(1)
    found, wanted = patch(mesh, 0.1 * rng.normal(size=(dim, dim)))
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def graded(dim, kind, seed, decades=3.0):
    """A box of cells whose sizes are random, over some decades along each axis."""
    rng = np.random.default_rng(seed)
    sizes = 10 ** rng.uniform(-decades, 0.0, (dim, 4))
    ends = np.c_[np.zeros(dim), np.cumsum(sizes, axis=1)]

    def place(p):
        return np.stack([np.interp(p[:, a], np.arange(5), ends[a]) for a in range(dim)], axis=1)

    return builders.grid((4,) * dim, kind=kind, place=place)


@given(
    seed=st.integers(0, 10_000),
    shape=st.sampled_from(ALL_KINDS),
    modulus=st.sampled_from(list(STIFFNESS_TYPES)),
    poisson=st.sampled_from(RATIOS),
)
@settings(max_examples=20, deadline=None)
def test_a_mesh_of_any_grading_is_translated_exactly(seed, shape, modulus, poisson):
    mesh = graded(*shape, seed)
    shift = np.tile([0.3, -0.2, 0.1][: mesh.dim], (len(mesh.points), 1))
    settings_ = {"deform_stiffness_type": modulus, "deform_coeff": poisson}
    np.testing.assert_allclose(displaced(mesh, shift, **settings_), shift, atol=1e-9)


@given(
    seed=st.integers(0, 10_000),
    shape=st.sampled_from(ALL_KINDS),
    poisson=st.sampled_from(RATIOS),
)
@settings(max_examples=20, deadline=None)
def test_cells_that_are_alike_carry_on_linear_displacements(seed, shape, poisson):
    mesh = graded(*shape, seed, 2.0)
    matrix = 0.1 * np.random.default_rng(seed).normal(size=(mesh.dim, mesh.dim))
    alike = {"deform_stiffness_type": "CONSTANT_STIFFNESS", "deform_coeff": poisson}
    found, wanted = patch(mesh, matrix, **alike)
    np.testing.assert_allclose(found, wanted, atol=1e-8 * mesh.extent)


@pytest.mark.parametrize("modulus", STIFFNESS_TYPES)
def test_cells_turn_and_grow_freely_in_a_plane_with_the_ratio_of_su2(modulus):
    """With lam = -mu, conformal motions cost nothing, even of 40 degrees, whatever the moduli."""
    angle = np.radians(40.0)
    turn = 1.2 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    free = {"deform_stiffness_type": modulus, "deform_coeff": 1e6}
    for kind in ("plain", "simplex"):
        found, wanted = patch(graded(2, kind, 0), turn - np.eye(2), **free)
        np.testing.assert_allclose(found, wanted, atol=1e-4)


@pytest.mark.parametrize("poisson", [0.3, 1e6])
@pytest.mark.parametrize("modulus", STIFFNESS_TYPES)
def test_a_far_field_of_a_thousand_chords_is_solved_exactly(modulus, poisson):
    """Volumes over 13 decades: what moves with the airfoil and what moves with the far field add up
    to the mesh that moves as a whole."""
    mesh = c_mesh(around=60, far=1000.0, first=1e-6)
    volume = cell_volumes(mesh.points, blocks(mesh.cells))
    assert volume.max() / volume.min() > 1e11
    way = np.array([0.03, 0.02])
    stiff = {"deform_stiffness_type": modulus, "deform_coeff": poisson}
    parts = []
    for moving in (mesh.marker_names, *((name,) for name in mesh.marker_names)):
        field = np.zeros(mesh.points.shape)
        field[np.concatenate([mesh.marker(name).nodes for name in moving])] = way
        parts.append(displaced(mesh, field, **stiff))
    whole, *others = parts
    np.testing.assert_allclose(whole, np.tile(way, (len(whole), 1)), rtol=1e-9)
    np.testing.assert_allclose(sum(others), whole, rtol=1e-9)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_a_small_rotation_is_carried_on_whatever_the_cells_are(dim, kind):
    spin = np.array([[0.0, -0.1, 0.05], [0.1, 0.0, 0.02], [-0.05, -0.02, 0.0]])[:dim, :dim]
    found, wanted = patch(distorted(dim, kind), spin)
    np.testing.assert_allclose(found, wanted, atol=1e-8)


def test_small_cells_are_the_stiffer_ones():
    sizes = np.r_[0.0, 0.02, 0.04, 0.06, 0.4, 0.7, 1.0]

    def place(p):
        return np.stack([sizes[p[:, 0].astype(int)], p[:, 1] / 6], axis=1)

    mesh = builders.grid((6, 6), place=place)
    case = Case(
        roles={"x_m": "moving", "y_m": "sliding", "y_p": "sliding"},
        motions=(Translate("x_m", (-0.1, 0.0)),),
        method="elastic",
        sliding="ds",
    )
    moved = (last(case, mesh).mesh.points - mesh.points)[:, 0]
    row = np.flatnonzero(mesh.points[:, 1] == 0.5)
    row = row[np.argsort(mesh.points[row, 0])]
    strain = np.diff(moved[row]) / np.diff(sizes)
    assert np.all(np.abs(strain[:3]) < 0.2 * np.abs(strain[3:]).min())
    # In one dimension, stress is the same everywhere: strain goes with the volume.
    np.testing.assert_allclose(
        strain[:-1] / strain[1:], np.diff(sizes)[:-1] / np.diff(sizes)[1:], rtol=1e-6
    )


# Conditions


def box_case(dim, sliding="ds", periodic=None, angle=10.0, **settings):
    roles = dict.fromkeys(SIDES[: 2 * dim], "sliding")
    if periodic is not None:
        roles |= dict.fromkeys(("y_m", "y_p"), "periodic")
    return Case(
        roles=roles | {"BLOCK": "moving"},
        motions=(Rotate("BLOCK", angle), Translate("BLOCK", (0.06, -0.05, 0.04)[:dim])),
        method="elastic",
        sliding=sliding,
        periodic=periodic or "none",
        periodic_type="translational",
        **settings,
    )


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_known_nodes_are_exact_with_every_element_type(dim, kind):
    mesh = builders.square(8, kind) if dim == 2 else builders.cube(6, kind)
    case = Case(
        roles={"BLOCK": "moving"},
        motions=(Translate("BLOCK", (0.05, 0.02, -0.03)[:dim]),),
        method="elastic",
        steps=2,
    )
    step = last(case, mesh)
    moved = step.mesh.points - mesh.points
    block = mesh.marker("BLOCK").nodes
    np.testing.assert_allclose(moved[block], [(0.05, 0.02, -0.03)[:dim]] * len(block), atol=1e-15)
    outer = np.unique(np.concatenate([mesh.marker(name).nodes for name in SIDES[: 2 * dim]]))
    np.testing.assert_array_equal(step.mesh.points[outer], mesh.points[outer])
    inner = np.setdiff1d(np.arange(len(mesh.points)), np.r_[block, outer])
    assert np.abs(moved[inner]).max() > 0.01
    assert step.control_nodes == len(block) + len(outer)
    assert step.max_error == 0.0
    assert np.isnan(step.condition)
    assert sv.quality(step.mesh, reference=mesh).inverted == 0
    assert step.warnings == ()


@pytest.mark.parametrize("dim", [2, 3])
def test_sliding_nodes_keep_to_their_planes_bit_for_bit(dim):
    mesh = builders.square(8) if dim == 2 else builders.cube(4)
    step = last(box_case(dim, steps=2), mesh)
    for axis in range(dim):
        for name, place in zip(SIDES[2 * axis : 2 * axis + 2], (0.0, 1.0), strict=True):
            nodes = mesh.marker(name).nodes
            assert np.all(step.mesh.points[nodes, axis] == place)
            assert np.abs(step.mesh.points[nodes] - mesh.points[nodes]).max() > 1e-3


@pytest.mark.parametrize("periodic", [None, "moving"])
def test_turning_everything_turns_the_result(periodic):
    q, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    q *= np.sign(np.linalg.det(q))
    mesh = builders.cube(4)
    turned = mesh.with_points(mesh.points @ q.T)
    shift = np.array([0.06, -0.05, 0.04])
    case = box_case(3, periodic=periodic).change(motions=(Translate("BLOCK", tuple(shift)),))
    plain = last(case, mesh).mesh.points
    case = case.change(motions=(Translate("BLOCK", tuple(q @ shift)),))
    np.testing.assert_allclose(last(case, turned).mesh.points, plain @ q.T, atol=1e-8)


def test_nodes_slide_around_a_curved_far_field():
    mesh = builders.annulus()
    case = Case(
        roles={"wall": "moving", "far0": "sliding"},
        motions=(Rotate("wall", 20.0),),
        method="elastic",
        sliding="ds",
        feature_angle_deg=60.0,
        steps=2,
    )
    moved = last(case, mesh).mesh.points
    far = mesh.marker("far0").nodes
    assert np.all(np.hypot(*moved[far].T) <= 2.0 + 1e-12)
    assert np.all(np.hypot(*moved[far].T) >= 2.0 * np.cos(np.pi / 24) - 1e-12)
    # Nothing holds the far field, so it turns with the wall, all of it.
    angle = np.arctan2(*moved[far].T[::-1]) - np.arctan2(*mesh.points[far].T[::-1])
    np.testing.assert_allclose(np.degrees(np.mod(angle + 3, 2 * np.pi) - 3), 20.0, atol=1.0)


@pytest.mark.parametrize("periodic", ["periodic", "fixed", "moving"])
@pytest.mark.parametrize("dim", [2, 3])
def test_images_of_a_translation_move_alike(dim, periodic):
    mesh = builders.square(8) if dim == 2 else builders.cube(4)
    moved = last(box_case(dim, "ds", periodic), mesh).mesh.points - mesh.points
    low = mesh.marker("y_m").nodes
    high = [
        int(np.argmin(np.abs(mesh.points - p - np.eye(dim)[1]).sum(axis=1)))
        for p in mesh.points[low]
    ]
    np.testing.assert_allclose(moved[low], moved[high], atol=1e-13)
    assert np.abs(moved[low]).max() > 1e-3
    assert (np.abs(moved[low, 1]).max() > 1e-3) == (periodic != "periodic")


def test_one_period_does_what_two_periods_do():
    one = builders.grid((8, 6), [(3, 5), (2, 4)], place=lambda p: p / 6.0)
    rules = [
        (
            "B1",
            lambda p: bool(
                np.all((p[:, 0] >= 3) & (p[:, 0] <= 5) & (p[:, 1] >= 2) & (p[:, 1] <= 4))
            ),
        ),
        (
            "B2",
            lambda p: bool(
                np.all((p[:, 0] >= 3) & (p[:, 0] <= 5) & (p[:, 1] >= 8) & (p[:, 1] <= 10))
            ),
        ),
        *builders.box_rules((8, 12))[:4],
    ]
    whole = builders.grid((8, 12), place=lambda p: p / 6.0)
    middle = whole.points[whole.cells.by_type[9][1]].mean(axis=1) * 6
    hole = (np.abs(middle[:, 0] - 4) < 1) & (np.abs(middle[:, 1] % 6 - 3) < 1)
    two = builders.make_mesh(
        whole.points, [(9, whole.cells.by_type[9][1][~hole])], rules, whole.points * 6
    )
    settings = {"method": "elastic", "sliding": "ds", "periodic": "moving"}
    sides = {"x_m": "sliding", "x_p": "sliding", "y_m": "periodic", "y_p": "periodic"}
    turn = [Rotate(name, 15.0) for name in ("BLOCK", "B1", "B2")]
    first = Case(roles=sides | {"BLOCK": "moving"}, motions=(turn[0],), **settings)
    second = Case(
        roles=sides | {"B1": "moving", "B2": "moving"}, motions=tuple(turn[1:]), **settings
    )
    a = last(first, one).mesh.points - one.points
    b = last(second, two).mesh.points - two.points
    for shift in (0.0, 1.0):
        place = [
            int(np.argmin(np.abs(two.points - p - (0.0, shift)).sum(axis=1))) for p in one.points
        ]
        np.testing.assert_allclose(b[place], a, atol=1e-8)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_sector_does_what_the_whole_ring_does(dim, tmp_path):
    """The inner wall is twisted and pushed outwards; nothing but the ties holds the cuts."""
    whole_shape, part_shape = ((4, 12), (4, 3)) if dim == 2 else ((4, 12, 2), (4, 3, 2))
    walls = [("wall", lambda p: bool(np.all(p[:, 0] == 0)))]
    far = [("far", lambda p: bool(np.all(p[:, 0] == 4)))]
    cuts = [
        ("per1", lambda p: bool(np.all(p[:, 1] == 0))),
        ("per2", lambda p: bool(np.all(p[:, 1] == 3))),
    ]
    ends = [("ends", lambda p: True)]
    whole = builders.grid(
        whole_shape,
        place=builders.ring(whole_shape, angle_deg=360.0),
        rules=walls + far + ends,
        wrap=1,
    )
    part = builders.grid(
        part_shape, place=builders.ring(part_shape, angle_deg=90.0), rules=walls + far + cuts + ends
    )

    def motion(mesh, name):
        nodes = mesh.marker("wall").nodes
        x = mesh.points[nodes]
        # A bump that repeats four times around.
        push = (0.05 + 0.03 * np.sin(4 * np.arctan2(x[:, 1], x[:, 0])))[:, None]
        vectors = np.zeros_like(x)
        vectors[:, :2] = push * x[:, :2] + 0.05 * np.stack([-x[:, 1], x[:, 0]], axis=1)
        path = tmp_path / f"{name}.txt"
        rows = zip(nodes.tolist(), vectors.tolist(), strict=True)
        path.write_text("\n".join(" ".join(map(repr, (n, *v))) for n, v in rows))
        return FromFile(path)

    roles = {"wall": "moving"} | ({"ends": "sliding"} if dim == 3 else {})
    base = Case(method="elastic", sliding="ds")
    a = last(base.change(roles=roles, motions=(motion(whole, "whole"),)), whole).mesh.points
    cut = roles | {"per1": "periodic", "per2": "periodic"}
    case = base.change(
        roles=cut, motions=(motion(part, "part"),), periodic="moving", periodic_type="rotational"
    )
    b = last(case, part).mesh.points
    place = [int(np.argmin(np.abs(whole.points - p).sum(axis=1))) for p in part.points]
    np.testing.assert_allclose(b, a[place], atol=1e-8)
    assert np.abs(b - part.points)[part.marker("per1").nodes].max() > 1e-2


def test_hub_and_shroud_of_a_passage_are_followed():
    mesh = builders.passage()
    roles = {
        "blade": "moving",
        "hub": "sliding",
        "shroud": "sliding",
        "per1": "periodic",
        "per2": "periodic",
        "inflow": "sliding",
        "outflow": "sliding",
    }
    case = Case(
        roles=roles,
        motions=(Rotate("blade", 3.0, (0.0, 0.0, 0.0)), Translate("blade", (0.0, 0.0, 0.02))),
        method="elastic",
        sliding="ds",
        periodic="moving",
        periodic_type="rotational",
        steps=2,
    )
    moved = last(case, mesh).mesh.points
    for name, r in (("hub", 0.5), ("shroud", 1.0)):
        nodes = mesh.marker(name).nodes
        np.testing.assert_allclose(np.hypot(*moved[nodes, :2].T), r, atol=1e-12)
    for name, z in (("inflow", 0.0), ("outflow", 1.0)):
        assert np.all(moved[mesh.marker(name).nodes, 2] == z)
    first, second = mesh.marker("per1").nodes, mesh.marker("per2").nodes
    order = [
        np.lexsort((mesh.points[n, 2].round(9), np.hypot(*mesh.points[n, :2].T).round(9)))
        for n in (first, second)
    ]
    first, second = first[order[0]], second[order[1]]
    angle = np.radians(30.0)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    np.testing.assert_allclose(moved[second], moved[first] @ turn.T, atol=1e-12)
    assert np.abs(moved[first] - mesh.points[first]).max() > 1e-3


def test_nodes_on_the_axis_stay_on_it():
    mesh = builders.wedge()
    axis = np.flatnonzero(np.hypot(*mesh.points.T) < 1e-12)
    names = [name for name in mesh.marker_names if name.startswith("per")]
    moving = next(name for name in mesh.marker_names if name not in names)
    case = Case(
        roles={moving: "moving"} | dict.fromkeys(names, "periodic"),
        motions=(Scale(moving, (1.1,), (0.0, 0.0)),),
        method="elastic",
        sliding="ds",
        periodic="moving",
        periodic_type="rotational",
    )
    moved = last(case, mesh).mesh.points
    np.testing.assert_array_equal(moved[axis], mesh.points[axis])
    first, second = (mesh.marker(name).nodes for name in names)
    by_radius = [n[np.argsort(np.hypot(*mesh.points[n].T))] for n in (first, second)]
    turn = np.array([[0.5, -np.sqrt(0.75)], [np.sqrt(0.75), 0.5]])
    np.testing.assert_allclose(moved[by_radius[1]], moved[by_radius[0]] @ turn.T, atol=1e-12)
    assert np.abs(moved - mesh.points)[first].max() > 0.01


# Trouble, progress and cancel


def test_nodes_of_no_cell_stay_where_they_are():
    mesh = builders.square(6)
    extra = dataclasses.replace(mesh, points=np.vstack([mesh.points, [[0.5, 0.95]]]))
    assert np.array_equal(last(box_case(2), extra).mesh.points[-1], [0.5, 0.95])


def test_a_cell_without_volume_is_an_error_that_names_it():
    mesh = builders.square(6)
    points = np.array(mesh.points)
    inner = mesh.cells.by_type[9][1][3]
    points[inner] = points[inner[0]]
    with pytest.raises(DeformError, match="has no volume"):
        last(box_case(2), mesh.with_points(points))


def test_folded_cells_do_not_stop_it():
    mesh = builders.square(10)
    step = last(box_case(2, angle=75.0, steps=3), mesh)
    assert sv.quality(step.mesh, reference=mesh).inverted > 0
    assert np.isfinite(step.mesh.points).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_what_iterations_do_not_reach_is_factorised_or_refused(by_iterations, monkeypatch, dim):
    mesh = builders.square(10) if dim == 2 else builders.cube(6)
    iterated = last(box_case(dim), mesh).mesh.points
    monkeypatch.setattr(linear_systems, "MAX_ITERATIONS", 3)
    with pytest.raises(
        DeformError, match=r"were not solved: the error is about .* use METHOD= rbf"
    ):
        last(box_case(dim), mesh)
    monkeypatch.setattr(linear_systems, "DIRECT", {2: 100, 3: 500})
    factorised = last(box_case(dim), mesh).mesh.points
    np.testing.assert_allclose(factorised, iterated, atol=1e-9)


@pytest.mark.parametrize("modulus", STIFFNESS_TYPES)
def test_the_ratio_of_su2_is_solved_by_iterations_where_walls_slide(request, modulus):
    """In 3D the matrix is indefinite then."""
    stiff = {"deform_stiffness_type": modulus, "deform_coeff": 1e6}
    mesh, points = builders.cube(6), []
    for _ in range(2):
        points.append(last(box_case(3, **stiff), mesh).mesh.points)
        request.getfixturevalue("by_iterations")
    np.testing.assert_allclose(*points, atol=1e-8)


def test_a_singular_matrix_is_left_to_iterations():
    """A factorisation has no answer for a body that nothing holds; its forces are consistent."""
    mesh = builders.square(4)
    body, n = body_of(mesh), mesh.points.size
    bent = 0.1 * np.sin(3.0 * mesh.points)
    target = body.forces(bent).ravel()

    def residual(x):
        return target - body.forces(x.reshape(mesh.points.shape)).ravel()

    matrix = body.matrix(free_body(mesh))

    def preconditioner():
        return linear.preconditioner(body, free_body(mesh))

    found = linear_systems.solve(matrix, preconditioner, residual, np.zeros(n), 0.0)
    assert np.abs(residual(found.x)).max() < 1e-6 * np.abs(target).max()


@pytest.mark.parametrize("kind", STIFFNESS_TYPES)
@pytest.mark.parametrize("poisson", RATIOS)
def test_conjugate_gradients_have_not_solved_what_is_wrong(kind, poisson, monkeypatch):
    monkeypatch.setattr(laplacian, "COARSE", 20)
    mesh = c_mesh(around=40, wake=8)
    known = np.unique(np.concatenate([m.nodes for m in mesh.markers]))
    n, free = len(mesh.points), np.setdiff1d(np.arange(len(mesh.points)), known)
    place = np.full(n, -1)
    place[free] = np.arange(len(free))
    eye = np.tile(np.eye(2), (n, 1, 1))
    given_ = Conditions(place, eye, np.ones(n, bool), np.zeros((n, 2)), eye[: len(free)])
    body = body_of(mesh, kind, poisson)
    matrix = body.matrix(given_)
    wanted = np.random.default_rng(0).standard_normal(matrix.shape[0])
    precondition = linear.preconditioner(body, given_)
    right = linear_systems._product(matrix, wanted)
    errors = []
    for most in (10, 30, 100, 300):
        monkeypatch.setattr(linear_systems, "MAX_ITERATIONS", most)
        found = linear_systems.conjugate_gradients(matrix, precondition, right)
        errors.append((found.error, np.abs(found.x - wanted).max() / np.abs(found.x).max()))
    assert all(said > min(error, 0.01) for said, error in errors)


def test_progress_rises_and_a_callback_that_raises_ends_the_run(by_iterations):
    mesh = builders.cube(6)
    heard = []
    assert last(box_case(3), mesh).index == 1
    list(sv.deform(box_case(3), mesh, heard.append))
    solve = [p.fraction for p in heard if p.phase == "solve"]
    assert solve == sorted(solve)
    assert 0.0 <= solve[0] < solve[-1] <= 1.0
    assert len(solve) > 5
    for stop in range(0, len(heard), 4):
        count = []

        def cancel(progress, count=count, stop=stop):
            count.append(progress)
            if len(count) > stop:
                raise Cancelled("enough")

        with pytest.raises(Cancelled, match="enough"):
            list(sv.deform(box_case(3), mesh, cancel))


def test_a_run_can_be_stopped_while_the_hierarchy_is_made(monkeypatch):
    begun, end = threading.Event(), threading.Event()

    def slow(*_):
        begun.set()
        end.wait(30)
        raise ValueError("nobody waits for this")

    def tick(fraction):
        if begun.is_set():
            raise Cancelled("enough")

    with pytest.raises(Cancelled, match="enough"):
        linear_systems.while_ticking(slow, tick)
    end.set()
    with pytest.raises(ValueError, match="a failure in there comes out here"):
        linear_systems.while_ticking(
            lambda: (_ for _ in ()).throw(ValueError("a failure in there comes out here")), tick
        )


def test_no_motion_changes_no_bit():
    mesh = builders.cube(4, "mixed")
    case = box_case(3, angle=0.0).change(motions=(Translate("BLOCK", (0.0, 0.0, 0.0)),))
    np.testing.assert_array_equal(last(case, mesh).mesh.points, mesh.points)


@pytest.mark.parametrize("way", ["factorised", "iterated"])
def test_the_same_case_gives_the_same_bits(way, request):
    if way == "iterated":
        request.getfixturevalue("by_iterations")
    mesh = builders.square(32)
    case = Case(
        roles={"BLOCK": "moving"},
        motions=(Translate("BLOCK", (0.01, 0.02)),),
        method="elastic",
    )
    first, second = (list(sv.deform(case, mesh))[-1].mesh.points for _ in range(2))
    assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize("way", ["factorised", "iterated"])
def test_any_number_of_threads_of_blas_gives_the_same_bits(way, request):
    if way == "iterated":
        request.getfixturevalue("by_iterations")
    mesh, points = builders.square(90), []  # with sums of more than 10,000 terms, which it divides
    case = sv.Case(roles={"BLOCK": "moving"}, motions=(sv.Rotate("BLOCK", 10.0),), method="elastic")
    libraries = ThreadpoolController().select(user_api="blas").lib_controllers
    before = [library.get_num_threads() for library in libraries]
    try:
        for threads in (1, 2):
            for library in libraries:
                library.set_num_threads(threads)
                library.clear_controlling_thread()
            points.append([step.mesh.points for step in sv.deform(case, mesh)])
    finally:
        for library, threads in zip(libraries, before, strict=True):
            library.set_num_threads(threads)
            library.clear_controlling_thread()
    np.testing.assert_array_equal(*points)


def test_a_product_has_the_same_bits_from_the_cache_as_from_the_compiler():
    """With reassociated sums, the first run after an installation differed from later ones."""
    rng = np.random.default_rng(0)
    matrix = bsr_array(
        (rng.random((50, 3, 3)), np.tile(np.arange(10), 5), np.arange(0, 51, 5)), shape=(30, 30)
    )
    x = rng.random((10, 3))
    strict, compiled = np.empty((2, 10, 3))
    parts = matrix.indptr, matrix.indices, matrix.data, x
    linear_systems.product.py_func(*parts, strict)
    linear_systems.product(*parts, compiled)
    assert strict.tobytes() == compiled.tobytes()


def test_renumbering_the_nodes_renumbers_the_result():
    mesh = builders.cube(4)
    order = np.random.default_rng(0).permutation(len(mesh.points))
    plain = last(box_case(3), mesh).mesh.points
    other = last(box_case(3), builders.permuted(mesh, order)).mesh.points
    np.testing.assert_allclose(other, plain[order], atol=1e-8)


def test_a_baffle_of_two_faces_moves_as_one():
    mesh = builders.plate()
    assert isinstance(mesh.markers[0], Marker)
    case = Case(
        roles={"below": "moving", "above": "moving"},
        motions=(Translate("below", (0.0, 0.1)), Translate("above", (0.0, 0.1))),
        method="elastic",
    )
    moved = last(case, mesh).mesh.points - mesh.points
    for name in ("below", "above"):
        np.testing.assert_allclose(moved[mesh.marker(name).nodes, 1], 0.1, atol=1e-15)


@pytest.mark.parametrize(("dim", "kind"), ALL_KINDS)
def test_forces_are_those_of_the_matrix(dim, kind):
    mesh = distorted(dim, kind, n=3)
    moved = np.random.default_rng(0).standard_normal(mesh.points.shape)
    for modulus in STIFFNESS_TYPES:
        for poisson in RATIOS:
            by_matrix = stiffness(mesh, modulus, poisson) @ moved.ravel()
            by_cells = body_of(mesh, modulus, poisson).forces(moved).ravel()
            np.testing.assert_allclose(by_cells, by_matrix, atol=1e-12 * np.abs(by_matrix).max())
