"""Motions that put boundaries through each other."""

from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.case.moving_nodes import displacements
from slideviz.errors import CaseError
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.session.jobs import Job, find_intersection
from slideviz.solver import intersection
from slideviz.solver.intersection import folding_message, jump_message
from slideviz.solver.intersection import intersection_message as message
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from tests.builders import airfoil, cube, make_mesh, passage, sector, sphere_in_box
from tools.laws.cases import random_run


@pytest.fixture
def square():
    found = sample("square")
    roles = dict.fromkeys(("LEFT", "RIGHT", "LOWER", "UPPER"), "sliding") | {"BLOCK": "moving"}
    return found.mesh, found.case.change(roles=roles, periodic="none", sliding="ps", steps=1)


def two_blocks():
    """A wide box with two square holes, at x from 2 to 3 and from 5 to 6: ``one``, ``other``."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(12), np.arange(6), indexing="ij"))
    points = np.stack([x, y], axis=1).astype(float)
    first = np.flatnonzero((x < 11) & (y < 5) & ~((y == 2) & np.isin(x, (2, 5))))
    cells = first[:, None] + [0, 6, 7, 1]

    def around(left):
        low, high = np.array([left, 2]), np.array([left + 1, 3])
        return lambda p: bool(np.all((p >= low) & (p <= high)))

    rules = [("one", around(2)), ("other", around(5)), ("outer", lambda p: True)]
    return make_mesh(points, [(9, cells)], rules)


def moved(case, mesh, *motions):
    case = case.change(motions=motions)
    found = displacements(case, mesh)
    return case, mesh, found.nodes, found.vectors


def test_a_block_in_the_wall_is_told_with_place_and_remedy(square):
    mesh, case = square
    case, *_ = arguments = moved(case, mesh, Translate("BLOCK", (-0.45, 0.0)))
    text = message(*arguments)
    assert text is not None
    assert text.startswith("the motion puts BLOCK through LEFT near (0, 0.")
    assert "move BLOCK less" in text
    with pytest.raises(CaseError, match="through LEFT near"):
        next(sv.deform(case, mesh))


@pytest.mark.parametrize("vector", [(-0.39, 0.0), (0.0, -0.47), (0.2, 0.3)])
def test_a_block_near_the_wall_is_fine(square, vector):
    mesh, case = square
    arguments = moved(case, mesh, Translate("BLOCK", vector))
    assert message(*arguments) is None
    assert jump_message(*arguments) is None


def test_a_periodic_boundary_that_moves_along_may_be_passed(square):
    mesh, case = square
    roles = {**case.roles, "LOWER": "periodic", "UPPER": "periodic"}
    free = case.change(roles=roles, periodic="moving")
    up = Translate("BLOCK", (0.0, 0.49))
    assert message(*moved(free, mesh, up)) is None
    for sliding, mode in (("ps", "moving"), ("none", "fixed")):
        kept = free.change(periodic="none", sliding=sliding)
        text = message(*moved(kept, mesh, up))
        assert text.endswith(f"or choose PERIODIC_MODE= {mode}, with which UPPER moves along")
        assert message(*moved(kept.change(periodic=mode), mesh, up)) is None
    assert "through UPPER" in message(*moved(free.change(periodic="periodic"), mesh, up))
    assert "through UPPER" in message(*moved(case, mesh, up))


@pytest.mark.parametrize(
    ("vector", "wall"), [((1.5, 0.0), "RIGHT"), ((-2.0, 0.3), "LEFT"), ((0.0, 40.0), "UPPER")]
)
def test_a_body_that_ends_out_of_the_mesh_is_refused(square, vector, wall):
    mesh, case = square
    case, *_ = arguments = moved(case, mesh, Translate("BLOCK", vector))
    text = message(*arguments)
    assert text.startswith(f"the motion takes BLOCK out of the mesh, through {wall} near (")
    assert "move BLOCK less" in text
    with pytest.raises(CaseError, match="takes BLOCK out of the mesh"):
        next(sv.deform(case, mesh))


def test_nor_may_one_come_out_by_a_turn(square):
    mesh, case = square
    turn = moved(case, mesh, Rotate("BLOCK", 180.0, (2.0, 0.5)))
    assert "takes BLOCK out of the mesh" in message(*turn)
    assert message(*moved(case, mesh, Rotate("BLOCK", 180.0, (0.45, 0.5)))) is None


def test_a_jump_over_a_wall_inside_is_refused():
    mesh = two_blocks()
    roles = dict.fromkeys(mesh.marker_names, "fixed") | {"one": "moving"}
    case = Case(roles=roles)
    case, *_ = arguments = moved(case, mesh, Translate("one", (6.0, 0.4)))
    assert message(*arguments) is None
    text = jump_message(*arguments)
    assert text.startswith("the motion takes one through other near (5, 2")
    assert "move one less, around other in several runs, or let other move with it" in text
    with pytest.raises(CaseError, match="takes one through other near"):
        next(sv.deform(case, mesh))
    said, _ = find_intersection(case, mesh, Job())
    assert said.startswith("The motion takes one through other near")
    assert jump_message(*moved(case, mesh, Translate("one", (2.0, 0.4)))) is None
    both = case.change(roles=roles | {"other": "moving"})
    far = Translate("one", (4.0, 0.4)), Translate("other", (4.0, 0.4))
    assert jump_message(*moved(both, mesh, *far)) is None
    lost = moved(case, mesh, Translate("one", (60.0, 0.0)))
    assert "takes one out of the mesh" in message(*lost)


def test_nodes_that_move_on_arcs_do_not_cut_corners():
    """The chord of a turn by 100 degrees would go through the inner wall of the sector."""
    mesh = sector(8)
    roles = {"BLOCK": "moving", "inner": "sliding", "outer": "sliding"}
    roles |= dict.fromkeys(("per1", "per2"), "periodic")
    case = Case(roles=roles, sliding="ps", periodic="moving", periodic_type="rotational")
    turned = moved(case, mesh, Rotate("BLOCK", 100.0, (0.0, 0.0)))
    assert jump_message(*turned) is None
    next(sv.deform(turned[0], mesh))
    straight = moved(case.change(periodic_type="auto", roles=roles), mesh, *turned[0].motions)
    assert jump_message(*straight) is None
    alone = {name: role for name, role in roles.items() if role != "periodic"}
    cut = moved(Case(roles=alone), mesh, *turned[0].motions)
    assert "BLOCK through " in jump_message(*cut)


def test_a_turn_beside_a_curved_wall_is_not_refused():
    """The chord of a turn by 60 degrees goes through the inner wall, the arc does not."""
    mesh = sector(24, 300.0, 0.8)
    roles = {"BLOCK": "moving", "inner": "sliding", "outer": "sliding"}
    case = Case(roles=roles, sliding="ps", steps=4)
    case, *_ = arguments = moved(case, mesh, Rotate("BLOCK", 60.0, (0.0, 0.0)))
    *_, last = sv.deform(case, mesh)
    assert quality(last.mesh, mesh).inverted == 0
    away = Rotate("BLOCK", 60.0, (0.0, 0.0)), Translate("BLOCK", (0.0, 0.02))
    assert jump_message(*moved(case, mesh, *away)) is None
    given = case.change(motions=(Prescribed(arguments[2], arguments[3]),))
    assert "takes BLOCK through inner near" in jump_message(given, *arguments[1:])


def test_a_motion_by_very_many_periods_is_looked_at_at_once(monkeypatch):
    found = sample("passage", size=12)
    mesh, looked = found.mesh, []
    inside = intersection.winding_number
    monkeypatch.setattr(
        intersection, "winding_number", lambda *a: looked.append(None) or inside(*a)
    )
    for far in (1.0, 1e9):
        looked.clear()
        message(*moved(found.case, mesh, Translate("airfoil", (0.0, far))))
        assert 0 < len(looked) < 60


@pytest.mark.parametrize("gone", ["RIGHT", "UPPER"])
def test_markers_that_are_not_closed_are_no_excuse(square, gone):
    mesh, case = square
    markers = tuple(marker for marker in mesh.markers if marker.name != gone)
    mesh = Mesh(mesh.points, mesh.cells, markers, name=mesh.name)
    case = case.change(roles={n: role for n, role in case.roles.items() if n != gone})
    assert "takes BLOCK out of the mesh" in message(
        *moved(case, mesh, Translate("BLOCK", (-3, 0.0)))
    )
    assert "takes BLOCK out of the mesh" in message(
        *moved(case, mesh, Translate("BLOCK", (9.0, 7.0)))
    )
    assert message(*moved(case, mesh, Translate("BLOCK", (0.1, 0.2)))) is None


def test_a_domain_that_moves_as_a_whole_and_an_outer_wall_are_fine(square):
    mesh, case = square
    names = mesh.marker_names
    every = case.change(roles=dict.fromkeys(names, "moving"))
    shift = [Translate(name, (7.0, -3.0)) for name in names]
    assert message(*moved(every, mesh, *shift)) is None
    wall = case.change(roles={**case.roles, "BLOCK": "fixed", "RIGHT": "moving"})
    assert message(*moved(wall, mesh, Translate("RIGHT", (1.5, 0.0)))) is None
    assert message(*moved(wall, mesh, Translate("RIGHT", (-0.3, 0.0)))) is None
    beyond = message(*moved(wall, mesh, Translate("RIGHT", (-1.5, 0.0))))
    assert "takes RIGHT out of the mesh, through" in beyond


def test_an_airfoil_may_turn_around_in_its_far_field():
    mesh = airfoil()
    case = Case(roles={"airfoil": "moving", "far": "fixed"})
    for motions in ((Rotate("airfoil", 180.0),), (Translate("airfoil", (1.5, 0.5)),)):
        assert message(*moved(case, mesh, *motions)) is None
    out = message(*moved(case, mesh, Translate("airfoil", (-9.0, 0.0))))
    assert "takes airfoil out of the mesh, through far" in out


@pytest.mark.parametrize("pitches", [0.7, 1.0, 3.3, -2.0])
def test_a_blade_may_go_on_in_the_neighbouring_passages(square, pitches):
    mesh, case = square
    roles = {**case.roles, "LOWER": "periodic", "UPPER": "periodic"}
    free = case.change(roles=roles, periodic="moving")
    assert message(*moved(free, mesh, Translate("BLOCK", (0.0, pitches)))) is None
    assert "out of the mesh" in message(*moved(free, mesh, Translate("BLOCK", (2.0, pitches))))


@pytest.mark.parametrize("angle_deg", [20.0, 30.0, -75.0, 180.0])
def test_and_around_the_axis(angle_deg):
    found = sample("polar", 10)
    mesh, case = found.mesh, found.case.change(periodic="moving", sliding="ps")
    round_ = Rotate("BLOCK", angle_deg, (0.0, 0.0))
    assert message(*moved(case, mesh, round_)) is None
    out = moved(case, mesh, round_, Translate("BLOCK", (9.0, 0.0)))
    assert "out of the mesh" in message(*out)


def test_what_leaves_a_mesh_with_internal_boundaries_is_told_where_they_are_not():
    found = sample("hexahedron", 6)
    mesh = found.mesh
    roles = {**found.case.roles, "FRONT": "internal", "BACK": "internal"}
    case = found.case.change(roles=roles, periodic="moving", sliding="ps")
    assert message(*moved(case, mesh, Translate("BLOCK", (0.0, 0.0, 5.0)))) is None
    out = message(*moved(case, mesh, Translate("BLOCK", (5.0, 0.0, 0.0))))
    assert "takes BLOCK out of the mesh, through RIGHT" in out


@pytest.mark.parametrize("mesh", [cube(4), sphere_in_box(), passage()], ids=lambda mesh: mesh.name)
def test_nothing_moved_nothing_out(mesh):
    roles = dict.fromkeys(mesh.marker_names, "fixed")
    for name in mesh.marker_names:
        case = Case(roles={**roles, name: "moving"})
        still = moved(case, mesh, Translate(name, (0.0, 0.0, 0.0)))
        assert message(*still) is None


def test_a_turn_that_cuts_is_told(square):
    mesh, case = square
    near = Translate("BLOCK", (0.0, -0.45))
    assert message(*moved(case, mesh, near)) is None
    assert "through LOWER" in message(*moved(case, mesh, near, Rotate("BLOCK", 60.0)))


def test_boundaries_with_common_nodes_are_not_compared():
    found = sample("hexahedron", 5)
    mesh = found.mesh
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"LEFT": "moving"}
    case = found.case.change(roles=roles, periodic="none")
    arguments = moved(case, mesh, Translate("LEFT", (-0.1, 0.0, 0.0)))
    assert message(*arguments) is None
    inward = moved(case, mesh, Translate("LEFT", (0.5, 0.0, 0.0)))
    assert "through BLOCK" in message(*inward)
    assert np.array_equal(mesh.points, found.mesh.points)


def test_what_crosses_before_the_motion_is_no_fault_of_it(square):
    # Twisted facets close to each other are taken for triangles, which may cross from the start.
    mesh, case = square
    points = np.array(mesh.points)
    node = int(mesh.marker("BLOCK").nodes[0])
    points[node, 0] -= 0.7
    crossed = mesh.with_points(points)
    assert message(*moved(case, mesh.with_points(points), Translate("BLOCK", (0.0, 0.0)))) is None
    text = message(*moved(case, crossed, Translate("BLOCK", (0.45, 0.0))))
    assert text is not None
    assert "through RIGHT near" in text


def test_a_body_whose_sides_are_twisted_is_not_lost_by_a_small_motion():
    run = random_run(1464)
    assert message(*moved(run.case, run.mesh, *run.case.motions)) is None


def test_a_body_with_twisted_sides_may_come_near_to_a_wall_but_not_go_through():
    run = random_run(30677)
    assert message(*moved(run.case, run.mesh, *run.case.motions)) is None
    further = [replace(m, vector=tuple(5.0 * v for v in m.vector)) for m in run.case.motions]
    text = message(*moved(run.case, run.mesh, *further))
    assert text is not None
    assert text.startswith("the motion puts BLOCK through y_m near (")


def pushed(mesh, name):
    """A case, and the upper part of a body pushed down through its lower part."""
    nodes = mesh.marker(name).nodes
    high = mesh.points[nodes][:, -1] > 0.5 * np.ptp(mesh.points[nodes][:, -1]) * 0.5
    vectors = np.where(high[:, None], -np.eye(mesh.dim)[-1] * 0.7, 0.0)
    return Case(roles={name: "moving"}), mesh, nodes, vectors


def test_a_body_that_goes_through_itself_is_told():
    case, mesh, nodes, vectors = pushed(sphere_in_box(6), "sphere")
    said = folding_message(case, mesh, nodes, vectors)
    assert said is not None
    assert str(said).startswith("sphere goes through itself near (")
    assert folding_message(case, mesh, nodes, 0.1 * vectors) is None
    # What was so before is not told of the motion.
    points = np.array(mesh.points)
    points[nodes] += vectors
    folded = mesh.with_points(points)
    assert folding_message(case, folded, nodes, 0.0 * vectors) is None


def test_two_parts_of_a_body_that_go_through_each_other_are_named():
    _, mesh, nodes, vectors = pushed(sphere_in_box(6), "sphere")
    whole, others = mesh.marker("sphere"), [one for one in mesh.markers if one.name != "sphere"]
    quads = whole.cells.connectivity.reshape(-1, 4)
    top = np.isin(quads, nodes[vectors.any(axis=1)]).any(axis=1)
    parts = [
        sv.Marker(n, sv.Cells.from_blocks([(9, quads[k])]))
        for n, k in (("low", ~top), ("top", top))
    ]
    split = Mesh(mesh.points, mesh.cells, (*parts, *others), name="split")
    both = Case(roles={"low": "moving", "top": "moving"})
    said = folding_message(both, split, nodes, vectors)
    assert said is not None
    # The one that moves comes first.
    assert str(said).startswith("top goes through low near (")


@pytest.mark.parametrize(("mesh", "name"), [(sphere_in_box(), "sphere"), (airfoil(), "airfoil")])
def test_a_body_that_turns_as_it_is_does_not_go_through_itself(mesh, name):
    nodes = mesh.marker(name).nodes
    turned = (
        mesh.points[nodes] @ np.linalg.qr(np.random.default_rng(3).normal(size=(mesh.dim,) * 2))[0]
    )
    vectors = turned - mesh.points[nodes]
    assert folding_message(Case(roles={name: "moving"}), mesh, nodes, vectors) is None


def test_of_very_many_facets_nobody_waits(monkeypatch):
    monkeypatch.setattr(intersection, "MOST", 3)
    assert folding_message(*pushed(sphere_in_box(6), "sphere")) is None


def test_a_run_warns_of_a_body_that_goes_through_itself():
    case, mesh, nodes, vectors = pushed(sphere_in_box(6), "sphere")
    moved = Prescribed(nodes, vectors)
    case = case.change(motions=(moved,), steps=1)
    assert any(
        text.startswith("sphere goes through itself near (") and text.endswith("move it less")
        for text in map(str, make_setup(prepare(case, mesh)).warnings)
    )
    less = case.change(motions=(Prescribed(nodes, 0.1 * vectors),))
    assert not make_setup(prepare(less, mesh)).warnings
