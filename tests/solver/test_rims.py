"""Rims: nodes that moving boundaries share with walls; they leave these, or stay on them."""

import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.moving_nodes import displacements
from slideviz.cli import run
from slideviz.mesh.zones import join_zones
from slideviz.rbf.rims import Bodies, side_weights
from slideviz.session.motions import Ghosts
from slideviz.session.run_messages import remedy_for
from slideviz.session.state import Run, StepFrame
from slideviz.solver.growth import wall_warnings
from slideviz.solver.interface_motion import check_motions
from slideviz.solver.prepare import prepare
from slideviz.solver.rims import rims_key
from slideviz.solver.setup import make_setup
from slideviz.streaming.run import stream
from tests import builders
from tests.advice import advice_for
from tests.design.test_deformer_derivatives import check

LEFT = r"has left (\w+) by ([-\d.e]+)(?:;|,)"


def turn(points, angles):
    """The points turned about x, y and z by angles in degrees, and moved."""
    for axis, angle in zip(np.eye(3), np.radians(angles), strict=True):
        k = np.cross(np.eye(3), axis)
        points = points @ (np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)
    return points + np.array([0.3, -0.2, 0.7])


def turned(mesh, angles):
    return mesh.with_points(turn(mesh.points, angles))


def box(mesh, moving="x_m"):
    """One side of a box moves, and the others slide: its edges are on one wall, corners on two."""
    return dict.fromkeys(mesh.marker_names, "sliding") | {moving: "moving"}


def blade(mesh):
    sides = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    return dict.fromkeys(mesh.marker_names, "sliding") | sides


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def case_of(roles, motions, **values):
    values = {"sliding": "ps", "rims": "slide", **values}
    return sv.Case(roles=roles, motions=tuple(motions), **values)


def off_planes(mesh, points, moving):
    """For each flat wall that shares nodes with a moving boundary, how far these are off it."""
    out, nodes = {}, mesh.marker(moving).nodes
    for marker in mesh.markers:
        rim = np.intersect1d(marker.nodes, nodes)
        if marker.name != moving and len(rim):
            at = mesh.points[marker.nodes]
            normal = np.linalg.svd(at - at.mean(axis=0))[2][-1]
            out[marker.name] = np.abs((points[rim] - at.mean(axis=0)) @ normal).max()
    return out


def radii(points, mesh, wall):
    rim = np.intersect1d(mesh.marker(wall).nodes, mesh.marker("blade").nodes)
    return np.hypot(*points[rim, :2].T)


amounts = st.floats(-0.03, 0.03)
ways = st.tuples(amounts, amounts, amounts)
axes = st.sampled_from([(1.0, 2.0, 3.0), (0.0, 0.0, 1.0)])


@st.composite
def motions(draw, marker):
    """One to three motions of a boundary, of any kind, that are small in a box of size 1."""
    kinds = {
        "translate": lambda: sv.Translate(marker, draw(ways)),
        "rotate": lambda: sv.Rotate(marker, draw(st.floats(-3, 3)), draw(ways), draw(axes)),
        "scale": lambda: sv.Scale(marker, (1.0 + draw(amounts),)),
        "radial": lambda: sv.Radial(marker, 1.0 + draw(amounts), point=(0.1, 0.2, 0.3)),
    }
    names = draw(st.lists(st.sampled_from(sorted(kinds)), min_size=1, max_size=3))
    return [kinds[name]() for name in names]


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_rims_are_on_flat_walls_and_corners_on_both_whatever_the_motion(data):
    angles = data.draw(st.tuples(*[st.floats(-180, 180)] * 3))
    kind = data.draw(st.sampled_from(["plain", "simplex"]))
    mesh = turned(builders.cube(4, kind, block=False), angles)
    case = case_of(box(mesh), data.draw(motions("x_m")), steps=data.draw(st.integers(1, 2)))
    for step in sv.deform(case, mesh):
        assert max(off_planes(mesh, step.mesh.points, "x_m").values()) < 1e-12
    assert not [text for text in step.warnings if "has left" in text]
    free = case.change(rims="free")
    asked, nodes = displacements(free, mesh).vectors, mesh.marker("x_m").nodes
    more = step.mesh.points[nodes] - mesh.points[nodes] - asked
    rim = np.isin(nodes, np.concatenate([m.nodes for m in mesh.markers if m.name != "x_m"]))
    size = np.linalg.norm(more, axis=1)
    # The rows beside take a part of what the rim takes, and those farthest from it nothing.
    assert size[~rim].max() <= size[rim].max() + 1e-15
    at = mesh.points[nodes]
    apart = np.linalg.norm(at[:, None] - at[rim], axis=2).min(axis=1)
    assert size[np.isclose(apart, apart.max())].max() <= 1e-15
    measured = off_planes(mesh, mesh.points + _placed(mesh, nodes, asked), "x_m")
    told = {
        wall: float(distance)
        for text in last(free, mesh).warnings
        for wall, distance in re.findall(LEFT, text)
    }
    # Rounding decides of a wall that is off by the threshold itself.
    assert set(told) >= {wall for wall, off in measured.items() if off > 1.001e-6}
    assert set(told) <= {wall for wall, off in measured.items() if off > 0.999e-6}
    for wall, distance in told.items():
        assert distance == pytest.approx(measured[wall], rel=6e-3)


def _placed(mesh, nodes, vectors):
    out = np.zeros_like(mesh.points)
    out[nodes] = vectors
    return out


@settings(max_examples=15, deadline=None)
@given(angles=st.tuples(*[st.floats(-180, 180)] * 3), some=motions("blade"))
def test_rims_are_on_a_hub_after_each_step(angles, some):
    mesh = turned(builders.passage((4, 6, 6)), angles)
    origin, end = turn(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), angles)
    about = {"axis": tuple((end - origin).tolist()), "origin": tuple(origin.tolist())}
    case = case_of(blade(mesh), some, periodic="moving", steps=2, **about)
    frame = make_setup(prepare(case, mesh)).frame
    for step in sv.deform(case, mesh):
        for wall, radius in (("hub", 0.5), ("shroud", 1.0)):
            rim = np.intersect1d(mesh.marker(wall).nodes, mesh.marker("blade").nodes)
            at = frame.coords(step.mesh.points[rim])
            np.testing.assert_allclose(at[:, 0], radius, rtol=0, atol=1e-12)
        assert step.periodic_misfit < 1e-12


IN_WALL = {
    "cube": (
        lambda: turned(builders.cube(4, block=False), (20.0, 50.0, -70.0)),
        lambda mesh: box(mesh),
        lambda mesh: sv.Translate("x_m", tuple(0.1 * _normal(mesh, "x_m"))),
        {},
    ),
    "square": (
        lambda: builders.square(6),
        lambda mesh: box(mesh),
        lambda mesh: sv.Translate("x_m", (-0.1, 0.0)),
        {},
    ),
    "hub": (
        builders.passage,
        blade,
        lambda mesh: sv.Rotate("blade", 3.0, (0.0, 0.0, 0.0)),
        {"periodic": "moving"},
    ),
}


def _normal(mesh, name):
    at = mesh.points[mesh.marker(name).nodes]
    return np.linalg.svd(at - at.mean(axis=0))[2][-1]


@pytest.mark.parametrize("name", IN_WALL)
@pytest.mark.parametrize("steps", [1, 3])
def test_a_motion_along_the_walls_changes_no_bit_and_has_no_warning(name, steps):
    make, roles, motion, settings = IN_WALL[name]
    mesh = make()
    case = case_of(roles(mesh), [motion(mesh)], steps=steps, **settings)
    step, free = last(case, mesh), last(case.change(rims="free"), mesh)
    assert np.array_equal(step.mesh.points, free.mesh.points)
    assert not [text for text in free.warnings if "has left" in text]


def test_facets_of_a_curved_wall_are_not_what_a_blade_leaves():
    mesh = builders.passage()  # whose hub has facets of 5 degrees, in a Cartesian frame
    case = case_of(blade(mesh), [sv.Rotate("blade", 2.0, (0.0, 0.0, 0.0))], rims="free")
    step = last(case, mesh)
    assert not [text for text in step.warnings if "has left" in text]
    moved = case.change(motions=(sv.Translate("blade", (0.01, 0.0, 0.0)),))
    told = [re.findall(LEFT, text) for text in last(moved, mesh).warnings]
    assert {wall for found in told for wall, _ in found} == {"hub", "shroud"}


def test_a_blade_that_moves_over_the_span_is_on_hub_and_shroud_by_its_motion():
    mesh = builders.passage()
    lean = sv.SpanMotion("blade", "lean", (0.0, 1.0), (0.0, 0.02))
    case = case_of(blade(mesh), [lean], periodic="moving")
    step, free = last(case, mesh), last(case.change(rims="free"), mesh)
    assert np.array_equal(step.mesh.points, free.mesh.points)
    both = case.change(motions=(lean, sv.Translate("blade", (0.0, 0.02, 0.0))))
    rim = radii(last(both, mesh).mesh.points, mesh, "shroud")
    np.testing.assert_allclose(rim, 1.0, rtol=0, atol=1e-12)


def test_rims_are_found_again_where_the_span_goes_the_other_way():
    lean = sv.SpanMotion("blade", "lean", (0.0, 1.0), (0.0, 0.02))
    case = case_of(blade(builders.passage()), [lean], periodic="moving")
    assert rims_key(case) == rims_key(case.change(steps=2))
    assert rims_key(case) != rims_key(case.change(span=("shroud", "hub")))


def test_a_wall_that_a_moving_boundary_divides_is_one():
    """A plate across a channel: its foot may go from one part of the floor to the other."""
    mesh = builders.grid((6, 4), [(2, 4), (0, 4)])
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    motion = sv.Translate("BLOCK", (0.1, 0.02))
    points = last(case_of(roles, [motion]), mesh).mesh.points
    assert off_planes(mesh, points, "BLOCK") == {"y_m": 0.0, "y_p": 0.0}
    foot = np.intersect1d(mesh.marker("y_m").nodes, mesh.marker("BLOCK").nodes)
    np.testing.assert_allclose(points[foot, 0] - mesh.points[foot, 0], 0.1, atol=1e-15)


def test_boundaries_that_nothing_slides_on_are_no_walls():
    mesh = builders.cube(4, block=False)
    roles = {"x_m": "moving"} | dict.fromkeys(("y_m", "y_p"), "periodic")
    case = case_of(roles, [sv.Translate("x_m", (0.0, 0.0, 0.1))], periodic="moving")
    setup = make_setup(prepare(case, mesh))
    assert setup.rims is None
    internal = case.change(roles=roles | {"z_m": "internal"})
    assert [wall.names for wall in make_setup(prepare(internal, mesh)).rims.walls] == [("z_m",)]


@pytest.mark.parametrize("rims", ["free", "slide"])
@pytest.mark.parametrize("steps", [1, 2])
def test_a_fixed_wall_that_its_rim_leaves_is_told_of(rims, steps):
    """Along the wall the rim may go; its nodes go with the motion, whatever RIMS says."""
    mesh = builders.cube(4, block=False)
    roles = {"x_m": "moving", "y_m": "fixed", "z_m": "sliding"}
    nodes = np.intersect1d(mesh.marker("x_m").nodes, mesh.marker("y_m").nodes)
    for y, walls in ((0.0, []), (0.1, [("y_m", "0.1"), ("y_p", "0.1")])):
        motion = sv.Translate("x_m", (0.05, y, 0.0))
        case = case_of(roles, [motion], rims=rims, steps=steps)
        step = last(case, mesh)
        assert re.findall(LEFT + "?", "".join(step.warnings)) == walls
        assert ("fixed; let that boundary slide" in "".join(step.warnings)) == bool(walls)
        problem, said = check_motions(case, mesh)  # as the ghost does
        assert problem is None
        assert (said is not None) == bool(walls)
        assert said is None or str(said) in step.warnings
        moved = step.mesh.points[nodes] - mesh.points[nodes]
        np.testing.assert_allclose(moved, np.tile([0.05, y, 0.0], (len(nodes), 1)), atol=1e-15)


@pytest.mark.parametrize("rims", ["free", "slide"])
def test_a_foot_that_left_its_fixed_wall_is_a_remedy_of_folded_cells(rims):
    """That wall must slide as well, which the warning says."""
    mesh = builders.cube(4, block=False)
    fixed = dict.fromkeys(mesh.marker_names, "fixed") | {"x_m": "moving"}
    motions = [sv.Rotate("x_m", 40.0, (0.0, 0.0, 0.0))]
    case = case_of(box(mesh), motions, rims=rims).change(roles=fixed)
    step = last(case, mesh)
    assert any("let that boundary slide" in text for text in step.warnings)
    assert ("RIMS= SLIDE" in advice_for(case, step)) == (rims == "free")


@pytest.mark.parametrize("rims", ["free", "slide"])
def test_rims_that_left_their_wall_are_a_remedy_of_folded_cells(rims):
    mesh = builders.cube(4, block=False)
    case = case_of(box(mesh), [sv.Rotate("x_m", 40.0, (0.0, 0.0, 0.0))], rims=rims)
    step = last(case, mesh)
    assert any("has left" in text for text in step.warnings) == (rims == "free")
    found = sv.quality(step.mesh, mesh)
    assert ("RIMS= SLIDE" in advice_for(case, step)) == (rims == "free")
    done = Run(1, case, (StepFrame(step.mesh, found, step),), "done")
    assert ("“stay on walls”" in remedy_for(done, mesh)) == (rims == "free")


def test_a_rim_that_cannot_be_brought_back_has_another_remedy():
    mesh = builders.cube(4, block=False)
    case = case_of(box(mesh), [sv.Translate("x_m", (0.0, 0.1, 0.1))])
    setup = make_setup(prepare(case, mesh))
    after = mesh.points + np.array([0.0, 0.1, 0.0])
    (text, *_) = wall_warnings(setup, case, mesh, after)
    assert str(text).endswith(", to which it cannot be brought back; move it less")


DERIVATIVES = {
    "corners": (lambda: builders.cube(4, block=False), box, "x_m", {}),
    "turned": (lambda: turned(builders.cube(4, block=False), (20.0, 50.0, -70.0)), box, "x_m", {}),
    "plane": (lambda: builders.square(6), box, "x_m", {}),
    "hub": (builders.passage, blade, "blade", {"periodic": "moving"}),
    "facets": (builders.passage, blade, "blade", {}),
}


@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("name", DERIVATIVES)
def test_derivatives(name, steps):
    make, roles, moving, settings = DERIVATIVES[name]
    mesh = make()
    some = sv.Translate(moving, (0.03, 0.02, 0.01)[: mesh.dim]), sv.Rotate(moving, 2.0)
    deformer = check(case_of(roles(mesh), some, steps=steps, **settings), mesh)
    rims = deformer._setup.rims
    rng = np.random.default_rng(3)
    one = rng.standard_normal((len(rims.rim), mesh.dim))
    other = rng.standard_normal((len(rims.bodies.share), mesh.dim))
    there, back = rims.bodies.spread(one), rims.bodies.gathered(other)
    assert (there * other).sum() == pytest.approx((one * back).sum(), rel=1e-12)


def test_what_follows_a_moving_boundary_follows_its_rim(tmp_path):
    """Two channels, of which the first follows the bottom of the second, that leaves its sides."""
    lower = builders.grid((4, 3), place=lambda p: p / [4.0, 3.0] - [0.0, 1.0])
    zones = [
        replace(mesh, zone=k, zones=2)
        for k, mesh in enumerate((lower, builders.square(4, block=False)), 1)
    ]
    mesh = join_zones(zones)
    roles = {f"{zone}:{side}": "sliding" for zone in (1, 2) for side in ("x_m", "x_p")}
    case = case_of(roles | {"2:y_m": "moving"}, [sv.Translate("2:y_m", (0.05, 0.02))], steps=2)
    step, deformer = last(case, mesh), sv.Deformer(mesh, case)
    for points in (
        step.mesh.points,
        deformer.deform(),
        deformer.deform(0.7 * deformer.displacement),
    ):
        one, two = (points[mesh.marker(name).nodes] for name in ("1:y_p", "2:y_m"))
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-15)
        assert set(two[[0, -1], 0]) == {0.0, 1.0}
    np.testing.assert_allclose(deformer.deform(), step.mesh.points, rtol=0, atol=1e-13)
    copy = pickle.loads(pickle.dumps(deformer))
    assert np.array_equal(copy.deform(), deformer.deform())


def test_a_correction_is_between_those_of_the_rim_and_linear_in_them():
    """On a strip of 8 rows it depends on the row alone, as a cubic, if that of the rim is alike."""
    axis = np.linspace(0.0, 1.0, 9)
    points = np.stack([*np.meshgrid(axis, axis), np.zeros((9, 9))], axis=-1).reshape(-1, 3)
    number = np.arange(81).reshape(9, 9)
    facets = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], -1)
    edges, weights = side_weights(points, facets.reshape(-1, 4))
    near = 1.0 - points[:, 1]
    bodies = Bodies(edges, weights, number[0], near**2 * (3.0 - 2.0 * near))
    np.testing.assert_allclose(
        bodies.spread(np.full((9, 1), 2.0))[:, 0], 2.0 * near**2 * (3.0 - 2.0 * near), atol=1e-13
    )
    ramp = bodies.spread(axis[:, None])[:, 0]
    assert ramp.min() >= 0.0
    assert ramp.max() == 1.0
    assert (np.diff(ramp.reshape(9, 9)[:-1], axis=1) > 0.0).all()


def test_the_ghost_is_where_the_run_takes_the_boundary():
    mesh = builders.stage()
    of_zone = blade(mesh.parts[0].mesh).items()
    roles = {f"{zone}:{name}": role for zone in (1, 2) for name, role in of_zone}
    some = sv.Translate("", (0.02, 0.01, 0.01)), sv.Rotate("1:blade", 2.0)
    case = case_of(roles, some, periodic="moving", periodic_type="rotational")
    ghosts = Ghosts(mesh)
    early = ghosts.moved(case)  # nothing is computed in the thread that draws
    points = last(case, mesh).mesh.points
    assert np.abs(early["2:blade"] - points[mesh.marker("2:blade").nodes]).max() > 1e-3
    for found in (ghosts.moved(case, wait=True), ghosts.moved(case)):  # then it is known
        for name in ("1:blade", "2:blade"):
            nodes = mesh.marker(name).nodes
            np.testing.assert_allclose(found[name], points[nodes], rtol=0, atol=1e-13)


def test_what_a_file_lists_with_few_digits_has_left_no_wall(tmp_path):
    mesh = builders.cube(4, block=False)
    lines = [f"{node} 0.1 {1e-8 * (-1) ** node} 0.0" for node in mesh.marker("x_m").nodes]
    (tmp_path / "d.txt").write_text("\n".join(lines))
    case = case_of(box(mesh), [sv.FromFile(tmp_path / "d.txt", "x_m")], rims="free")
    assert not [text for text in last(case, mesh).warnings if "has left" in text]
    points = last(case.change(rims="slide"), mesh).mesh.points
    assert max(off_planes(mesh, points, "x_m").values()) == 0.0


def test_a_streamed_run_keeps_rims_as_one_in_memory_does(tmp_path):
    mesh = builders.passage()
    some = sv.Translate("blade", (0.02, 0.01, 0.01)), sv.Rotate("blade", 2.0)
    case = case_of(blade(mesh), some, periodic="moving", mesh_file=tmp_path / "mesh.su2b")
    sv.write(case.mesh_file, mesh)
    stream(case, tmp_path / "out.su2b")
    points = sv.read(tmp_path / "out.su2b").points
    assert np.array_equal(points, last(case, sv.read(case.mesh_file)).mesh.points)
    np.testing.assert_allclose(radii(points, mesh, "hub"), 0.5, rtol=0, atol=1e-12)
    free = stream(case.change(rims="free"), tmp_path / "free.su2b")
    assert "has left hub" in str(free.steps[-1].warnings)


@pytest.mark.parametrize("steps", [1, 2])
def test_displacements_of_any_kind_are_corrected(steps, tmp_path):
    """A box, a bump and an array of displacements: their sum is corrected, whatever it is of."""
    mesh = builders.square(6, block=False)
    nodes = mesh.marker("y_m").nodes
    lines = [f"{node} {0.01 * k} {0.02}" for k, node in enumerate(nodes.tolist())]
    (tmp_path / "d.txt").write_text("\n".join(lines))
    corners = (-0.1, -0.1, 0, 1.1, -0.1, 0, 1.1, 0.2, 0, -0.1, 0.2, 0) + (0.0,) * 12
    some = (
        sv.FromFile(tmp_path / "d.txt", "y_m"),
        sv.Bump("y_m", 0.05),
        sv.Ffd("y_m", "BOX", (0, 0, 0), (0.1, 0.0, 0.0)),
    )
    boxes = {"ffd_boxes": (("BOX", corners),), "ffd_degrees": ((2, 1, 0),)}
    case = case_of(box(mesh, "y_m"), some, steps=steps, **boxes)
    points = last(case, mesh).mesh.points
    assert off_planes(mesh, points, "y_m") == {"x_m": 0.0, "x_p": 0.0}
    asked = displacements(case, mesh).at(nodes)
    middle = np.argmin(np.abs(mesh.points[nodes, 0] - 0.5))
    assert np.allclose((points - mesh.points)[nodes][middle], asked[middle], rtol=0, atol=1e-15)
    ends = [np.argmin(mesh.points[nodes, 0]), np.argmax(mesh.points[nodes, 0])]
    assert np.abs(asked[ends, 0]).min() > 1e-3


def test_symmetry_planes_of_su2_stay_planes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mesh = builders.cube(4, block=False)
    sv.write("mesh.su2", mesh)
    Path("a.cfg").write_text(
        "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nMARKER_SYM= ( y_m )\n"
        "DV_KIND= TRANSLATION\nDV_MARKER= ( z_m )\nDV_PARAM= ( 0, 1, 0 )\nDV_VALUE= 0.02\n"
    )
    assert run(["def", "a.cfg"]) == 0
    said = capsys.readouterr().err
    assert re.findall(LEFT, said) == [("y_m", "0.02"), ("y_p", "0.02")]
    assert "of z_m at" in said
    assert run(["def", "a.cfg", "--set", "RIMS=SLIDE"]) == 0
    said = capsys.readouterr().err
    assert re.findall(LEFT, said) == [("y_p", "0.02")]  # y_p is fixed: nobody gave it another role
    assert off_planes(mesh, sv.read("out.su2").points, "z_m")["y_m"] == 0.0


def test_a_wall_with_edges_is_told_of_once():
    mesh = builders.passage((3, 8, 6))
    roles = blade(mesh) | {"per1": "fixed", "per2": "fixed"}  # so that facets of the hub are flat
    case = case_of(roles, [sv.Translate("blade", (0.02, 0.01, 0.0))], rims="free")
    case = case.change(feature_angle_deg=1.0)
    setup = make_setup(prepare(case, mesh))
    step = last(case, mesh)
    told = re.findall(LEFT, "\n".join(step.warnings))
    names = [wall for wall, _ in told]
    assert len(setup.rims.walls) > len(set(names)) > 0
    assert len(names) == len(set(names))
