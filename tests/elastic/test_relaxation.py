"""Relaxation: turned cells are at rest, conditions hold, and no cell becomes worse."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy.sparse import csr_array
from threadpoolctl import threadpool_limits

import slideviz as sv
from slideviz.case.moving_nodes import moving_nodes
from slideviz.cli import run
from slideviz.elastic import relaxation
from slideviz.elastic.distortion import Distortion
from slideviz.elastic.laplacian import PART, LaplacianCycle, laplacian
from slideviz.errors import DeformError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.jacobians import CORNERS
from slideviz.session.opening import guess_case, guess_roles
from slideviz.solver.prescribed import displaced, support_radius
from slideviz.solver.setup import RELAXED_CELLS
from tests import builders


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def airfoil(angle=25.0, **values):
    mesh = builders.airfoil(40, 10, 1e-3)
    motions = (sv.Rotate("airfoil", angle, (0.5, 0.0)),)
    return mesh, sv.Case(roles={"airfoil": "moving"}, motions=motions, **values)


def passage(**values):
    """A twisted blade between a sliding hub and shroud, both curved, in a rotational period."""
    mesh = builders.passage((6, 8, 8))
    roles = {"hub": "sliding", "shroud": "sliding", "blade": "moving"}
    roles |= {"per1": "periodic", "per2": "periodic", "inflow": "sliding", "outflow": "sliding"}
    case = sv.Case(roles=roles, sliding="ps", periodic="moving", **values)
    return mesh, case.change(motions=(sv.Rotate("blade", 3.0),))


def test_cells_go_back_to_their_shapes():
    mesh, case = airfoil()
    plain, relaxed = last(case, mesh), last(case.change(relax="yes"), mesh)
    found = [sv.quality(step.mesh, mesh).mean for step in (plain, relaxed)]
    assert found[1] > found[0] + 0.004
    assert plain.relaxed is None
    assert 0.0 < relaxed.relaxed.residual <= relaxation.RESIDUAL
    assert relaxed.relaxed.rounds < 40


def test_a_turned_mesh_is_at_rest():
    mesh = builders.airfoil(24, 6)
    case = sv.Case(
        roles={"airfoil": "moving", "far": "moving"},
        motions=(sv.Rotate("", 30.0, (0.0, 0.0)),),
        relax="yes",
        influence_factor=0.5,  # too short to turn the mesh by itself
    )
    cos, sin = np.cos(np.pi / 6), np.sin(np.pi / 6)
    exact = mesh.points @ np.array([[cos, sin], [-sin, cos]])
    errors = [
        np.abs(last(c, mesh).mesh.points - exact).max() for c in (case.change(relax="no"), case)
    ]
    assert errors[1] < 0.05 * errors[0]


def test_sliding_nodes_stay_on_curved_walls_and_images_together():
    mesh, case = passage(relax="yes")
    step = last(case, mesh)
    r = np.linalg.norm(step.mesh.points[:, :2], axis=1)
    start = np.linalg.norm(mesh.points[:, :2], axis=1)
    plain = np.linalg.norm(last(case.change(relax="no"), mesh).mesh.points[:, :2], axis=1)
    for marker in ("hub", "shroud"):
        nodes = np.unique(mesh.marker(marker).nodes)
        np.testing.assert_allclose(r[nodes], plain[nodes], atol=2e-3)
        np.testing.assert_allclose(r[nodes], start[nodes], atol=1e-2)
    assert step.periodic_misfit < 1e-12
    for marker in ("inflow", "outflow"):
        nodes = np.unique(mesh.marker(marker).nodes)
        np.testing.assert_array_equal(step.mesh.points[nodes, 2], mesh.points[nodes, 2])
    assert np.abs(step.mesh.points - last(case.change(relax="no"), mesh).mesh.points).max() > 1e-4


def test_a_cell_without_area_does_not_stop_the_others():
    mesh, case = airfoil()
    points = mesh.points.copy()
    (one, two, three, four), *_ = mesh.cells.by_type[9][1][200:]
    points[two], points[three] = points[one], points[four]
    flat = mesh.with_points(points)
    before, after = (last(case.change(relax=relax), flat) for relax in ("no", "yes"))
    assert 0.0 < after.relaxed.residual <= relaxation.RESIDUAL
    assert sv.quality(after.mesh, flat).mean > sv.quality(before.mesh, flat).mean


@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.parametrize("steps", [1, 3])
def test_sliding_nodes_are_on_the_facets_of_their_curved_wall(sliding, steps):
    mesh = builders.annulus(24, 5)
    motions = (sv.Rotate("wall", 20.0, (0.1, 0.0)),)
    case = sv.Case(roles={"wall": "moving", "far0": "sliding"}, motions=motions, sliding=sliding)
    plain, relaxed = (
        last(case.change(relax=relax, steps=steps), mesh).mesh.points for relax in ("no", "yes")
    )
    one, two = np.swapaxes(mesh.points[mesh.marker("far0").cells.by_type[3][1]], 0, 1)
    nodes, along = np.unique(mesh.marker("far0").nodes), two - one
    away = relaxed[nodes, None] - one
    place = np.einsum("nfd,fd->nf", away, along) / np.einsum("fd,fd->f", along, along)
    off = np.linalg.norm(away - np.clip(place, 0.0, 1.0)[:, :, None] * along, axis=2).min(axis=1)
    assert off.max() < 1e-12 * mesh.extent
    assert np.abs(relaxed[nodes] - plain[nodes]).max() > 0.02
    known = np.unique(mesh.marker("wall").nodes)
    np.testing.assert_array_equal(relaxed[known], plain[known])


@pytest.mark.parametrize("make", [airfoil, passage])
@pytest.mark.parametrize("steps", [1, 2, 0])
def test_without_motion_no_bit_changes(make, steps):
    mesh, case = make(relax="yes", layers="keep", steps=steps)
    (motion,) = case.motions
    step = last(case.change(motions=(replace(motion, angle_deg=0.0),)), mesh)
    np.testing.assert_array_equal(step.mesh.points, mesh.points)
    assert step.relaxed is None


@pytest.mark.parametrize("shape", [(1, 4), (1, 1, 3)])
def test_a_mesh_without_free_nodes_is_left_alone(shape):
    mesh = builders.grid(shape)
    lower, *others = mesh.marker_names
    case = sv.Case(
        roles=dict.fromkeys(others, "fixed") | {lower: "moving"},
        motions=(sv.Translate(lower, (0.02,) * mesh.dim),),
    )
    step = last(case.change(relax="yes", layers="keep"), mesh)
    np.testing.assert_array_equal(step.mesh.points, last(case, mesh).mesh.points)


def test_the_bits_do_not_depend_on_threads_nor_on_what_was_kept(monkeypatch):
    mesh, case = airfoil(relax="yes")
    monkeypatch.setattr("slideviz.rbf.compiled.SMALL", 0)
    first = last(case, mesh).mesh.points
    again = last(case, mesh).mesh.points
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        alone = last(case, airfoil()[0]).mesh.points
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, alone)


def test_the_preconditioner_is_symmetric_positive_and_holds_components():
    mesh = builders.grid((20, 20))
    body, place = Distortion.of(mesh.points, mesh.cells), np.arange(len(mesh.points))
    place[mesh.marker("x_m").nodes] = -1
    place[place >= 0] = np.arange((place >= 0).sum())
    count = int(place.max()) + 1
    held = np.zeros((count, 2), bool)
    held[::7, 1] = True
    cycle = LaplacianCycle.of(body, place, held, np.eye(2))
    each = [cycle(e.reshape(count, 2)).ravel() for e in np.eye(2 * count)]
    np.testing.assert_allclose(each, np.transpose(each), atol=1e-12 * np.abs(each).max())
    assert np.linalg.eigvalsh(each).min() > -1e-12
    assert np.abs(np.array(each)[:, held.ravel()]).max() < 1e-20
    indptr, indices, data = laplacian(body, place, count)
    matrix = csr_array((data[:, 0], indices, indptr), shape=(count, count)).toarray()
    products = np.array(each).reshape(count, 2, count, 2)[:, 0, :, 0] @ matrix
    assert np.linalg.eigvals(products).real.min() > 0.3
    assert np.linalg.eigvals(products).real.max() < 1.5


@pytest.mark.parametrize("kind", ["plain", "prism", "pyramid", "tetra"])
def test_the_laplacian_is_the_sum_over_corners_of_products_along_edges(kind):
    mesh = builders.cube(3, kind)
    body = Distortion.of(mesh.points, mesh.cells)
    place = np.arange(len(mesh.points)) // 2 - 3  # images in and across elements, known nodes
    count = int(place.max()) + 1
    place[:6], dense = -1, np.zeros((count, count))
    for part in body.parts:
        for nodes, coupling in zip(part.nodes, part.coupling, strict=True):
            table = CORNERS[part.vtk]
            at = place[nodes]
            use = np.ix_(at >= 0, at >= 0)
            for o, *others in table:
                edges = mesh.points[nodes[others]] - mesh.points[nodes[o]]
                slopes = np.zeros((3, len(nodes)))
                slopes[:, others] = np.linalg.inv(edges)
                slopes[:, o] = -slopes.sum(axis=1)
                apart = np.eye(len(nodes)) - np.eye(len(nodes))[o]
                one = np.zeros((len(nodes), len(nodes)))
                for a, b in itertools.product(others, others):
                    if a == b or {a, b} in map(set, ELEMENTS[part.vtk].edges):
                        one += slopes[:, a] @ slopes[:, b] * np.outer(apart[a], apart[b])
                one *= (1.0 + coupling) / len(table)
                np.add.at(dense, np.ix_(at[at >= 0], at[at >= 0]), one[use])
    indptr, indices, data = laplacian(body, place, count)
    assert all(np.all(np.diff(indices[a:b]) > 0) for a, b in itertools.pairwise(indptr))
    found = csr_array((data[:, 0], indices, indptr), shape=dense.shape).toarray()
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_allclose(found, dense, rtol=0, atol=1e-6 * np.abs(dense).max())


def test_the_cycle_in_several_parts_is_symmetric_with_the_same_bits_for_any_threads(monkeypatch):
    monkeypatch.setattr("slideviz.rbf.compiled.SMALL", 0)
    body = Distortion.of((mesh := builders.grid((200, 200))).points, mesh.cells)
    place = np.arange(len(mesh.points))
    held = np.zeros((len(place), 2), bool)
    held[mesh.marker("x_m").nodes], held[mesh.marker("y_m").nodes, 1] = True, True
    rng = np.random.default_rng(0)
    u, v = np.where(held, 0.0, rng.standard_normal((2, *held.shape)))
    cycle = LaplacianCycle.of(body, place, held, np.eye(2))
    assert len(cycle.levels) > 1
    assert len(cycle.levels[0].middle) > 2 * PART
    left, right = np.vdot(u, cycle(v)), np.vdot(cycle(u), v)
    assert abs(left - right) < 1e-12 * np.linalg.norm(u) * np.linalg.norm(cycle(v))
    indptr, indices, data = laplacian(body, place, len(place))
    matrix = csr_array((data[:, 0], indices, indptr))
    np.testing.assert_allclose(matrix.sum(axis=1), 0.0, atol=1e-14)
    for _ in range(4):  # the error of a few cycles alone
        left, u = np.vdot(u, matrix @ u), np.where(held, 0.0, u - cycle(matrix @ u))
        assert np.vdot(u, matrix @ u) < 0.35 * left
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        alone = LaplacianCycle.of(body, place, held, np.eye(2))(v)
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(cycle(v), alone)
    for threads in (1, 2):
        with threadpool_limits(threads, "blas"):
            other = LaplacianCycle.of(body, place, held, np.eye(2))(v)
        np.testing.assert_array_equal(other, alone)


def test_automatic_steps_are_chosen_before_relaxation(monkeypatch):
    mesh, case = airfoil(60.0, relax="yes", steps=0)
    plain = last(case.change(relax="no"), mesh)
    calls, relaxed = [], relaxation.Relaxation.relaxed
    monkeypatch.setattr(
        relaxation.Relaxation, "relaxed", lambda *args: calls.append(1) or relaxed(*args)
    )
    steps = list(sv.deform(case, mesh))
    assert len(plain.tried) > 1
    assert steps[-1].tried == plain.tried
    assert len(calls) == 1
    assert [step.total for step in steps] == [plain.total] * plain.total
    fixed = last(case.change(steps=plain.total), mesh)
    np.testing.assert_array_equal(steps[-1].mesh.points, fixed.mesh.points)
    assert steps[-1].relaxed == fixed.relaxed


def test_auto_leaves_out_large_meshes_and_other_methods(monkeypatch):
    mesh, case = airfoil(relax="auto")
    assert last(case, mesh).relaxed is not None
    assert last(case.change(method="idw"), mesh).relaxed is None
    monkeypatch.setattr("slideviz.solver.setup.RELAXED_CELLS", 10)
    step = last(case, mesh)
    assert step.relaxed is None
    assert any("RELAX= AUTO does not relax a mesh of more than" in text for text in step.warnings)
    assert last(case.change(relax="yes"), mesh).relaxed is not None
    assert RELAXED_CELLS == 1_000_000


def test_the_report_says_how_the_mesh_was_relaxed(tmp_path, capsys):
    mesh, case = airfoil(relax="yes", mesh_file=tmp_path / "m.su2", mesh_out=tmp_path / "out.su2")
    sv.write(tmp_path / "m.su2", mesh)
    case.write(tmp_path / "c.cfg")
    assert "RELAX= yes" in (tmp_path / "c.cfg").read_text()
    assert run(["run", str(tmp_path / "c.cfg"), "--json", str(tmp_path / "r.json")]) == 0
    assert re.search(r"relaxation +\d+ iterations, to \de-\d\d", capsys.readouterr().out)
    report = json.loads((tmp_path / "r.json").read_text())["relax"]
    assert set(report) == {"rounds", "residual"}


def test_relaxation_asks_for_memory_before_it_begins(monkeypatch):
    mesh, case = airfoil(relax="yes")
    monkeypatch.setattr("slideviz.solver.deform.free_memory", lambda: 1000.0)
    with pytest.raises(DeformError, match=r"relaxation of 440 nodes needs .* use RELAX= NO"):
        last(case, mesh)


def test_cases_that_the_window_begins_are_relaxed():
    mesh = builders.airfoil(8, 2)
    case = guess_case(mesh, guess_roles(mesh), ())
    assert (case.relax, case.layers) == ("auto", "auto")
    assert (sv.Case().relax, sv.Case().layers) == ("no", "no")


def test_a_mesh_at_rest_and_one_without_inner_nodes_are_not_relaxed():
    mesh, case = airfoil(0.0, relax="yes")
    step = last(case, mesh)
    assert step.relaxed is None
    np.testing.assert_array_equal(step.mesh.points, mesh.points)
    mesh = builders.grid((1, 1))
    motions = (sv.Translate("x_p", (0.2, 0.0)),)
    assert (
        last(sv.Case(roles={"x_p": "moving"}, motions=motions, relax="yes"), mesh).relaxed is None
    )


def boxed(dim):
    """A block that is moved and turned between sliding walls, one pair of them periodic."""
    mesh = builders.square(10) if dim == 2 else builders.cube(6)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    roles |= {"y_m": "periodic", "y_p": "periodic"}
    motions = (sv.Rotate("BLOCK", 15.0), sv.Translate("BLOCK", (0.03, 0.02, -0.04)[:dim]))
    periodic = {"periodic": "moving", "periodic_type": "translational"}
    return mesh, sv.Case(roles=roles, motions=motions, sliding="ps", **periodic)


def mirrored(cells):
    """The cells with their nodes in an order that a mirror makes positive again."""
    order = {3: [1, 0], 5: [0, 2, 1], 9: [0, 3, 2, 1], 12: [0, 3, 2, 1, 4, 7, 6, 5]}
    rows = np.split(cells.connectivity, cells.offsets[1:-1])
    kinds = zip(cells.types.tolist(), rows, strict=True)
    return sv.Cells.from_types(cells.types, np.concatenate([row[order[k]] for k, row in kinds]))


def turned(dim, about_z):
    cos, sin = np.cos(0.6), np.sin(0.6)
    turn = np.eye(dim)
    turn[:2, :2] = [[cos, -sin], [sin, cos]]
    if dim == 3 and not about_z:
        turn = turn @ np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    return turn


@pytest.mark.parametrize("relax", ["no", "yes"])
@pytest.mark.parametrize("change", ["turned", "mirrored", "scaled", "renumbered"])
@pytest.mark.parametrize(
    "make", [airfoil, lambda: boxed(2), lambda: boxed(3), passage], ids=["2D", "box", "cube", "row"]
)
def test_the_same_problem_has_the_same_mesh(make, change, relax):
    mesh, case = make()
    moved = displaced(moving_nodes(case, mesh), mesh)
    radius = support_radius(case, mesh, moved)
    place = np.eye(mesh.dim)
    order = np.arange(len(mesh.points))
    other = mesh
    if change == "turned":
        place = turned(mesh.dim, make is passage)
    elif change == "scaled":
        place *= 0.37
    elif change == "mirrored":
        place[0, 0] = -1.0
        markers = [sv.Marker(marker.name, mirrored(marker.cells)) for marker in mesh.markers]
        other = sv.Mesh(mesh.points, mirrored(mesh.cells), tuple(markers))
    else:
        order, other = builders.shuffled(mesh, 3)
    other = other.with_points(other.points @ place.T)
    row = np.argsort(order)
    found = []
    for one, nodes, vectors, factor in (
        (mesh, moved.nodes, moved.vectors, 1.0),
        (other, row[moved.nodes], moved.vectors @ place.T, 0.37 if change == "scaled" else 1.0),
    ):
        sort = np.argsort(nodes)
        motions = (sv.Prescribed(nodes[sort], vectors[sort]),)
        own = case.change(motions=motions, support_radius=factor * radius, relax=relax)
        found.append(last(own, one).mesh.points)
    back = found[1][row] @ np.linalg.inv(place).T
    assert np.abs(back - found[0]).max() < 1e-9 * mesh.extent


@pytest.mark.parametrize(("dim", "part"), [(2, 0.5), (2, 0.9), (3, 0.5), (3, 0.7)])
def test_one_step_nearly_goes_as_far_as_there_is_room(dim, part):
    """A block is moved into a corner, over a part of the gap: at first cells are folded."""
    mesh = builders.square(20) if dim == 2 else builders.cube(8)
    corner = mesh.points[mesh.marker("BLOCK").nodes].min(axis=0)
    away = part * (mesh.points.min(axis=0) - corner)
    roles = dict.fromkeys(mesh.marker_names, "fixed") | {"BLOCK": "moving"}
    case = sv.Case(roles=roles, motions=(sv.Translate("BLOCK", tuple(away)),), steps=1)
    window = {"relax": "auto", "layers": "auto", "repair": "auto"}
    found = [sv.quality(last(one, mesh).mesh, mesh) for one in (case, case.change(**window))]
    assert found[1].inverted == 0
    assert found[0].inverted > 0 or found[1].mean > found[0].mean


def test_derivatives_where_a_motion_nearly_closes_a_gap():
    mesh = builders.square(20)
    gap = mesh.points[mesh.marker("BLOCK").nodes, 0].min() - mesh.points[:, 0].min()
    roles = dict.fromkeys(mesh.marker_names, "fixed") | {"BLOCK": "moving"}
    motions = (sv.Translate("BLOCK", (-0.9 * gap, 0.0)),)
    deformer = sv.Deformer(mesh, sv.Case(roles=roles, motions=motions, relax="yes"))
    design = deformer.displacement
    rng = np.random.default_rng(0)
    change = rng.standard_normal(design.shape)
    seed = rng.standard_normal(mesh.points.shape)
    forward = np.vdot(seed, deformer.jvp(design, change))
    assert forward == pytest.approx(np.vdot(deformer.vjp(design, seed), change), rel=1e-9)
    assert sv.quality(mesh.with_points(deformer.deform(design)), mesh).inverted == 0
