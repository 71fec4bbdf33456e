"""The solver: steps, progress, cancel, errors, and geometry that is asking for trouble."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.errors import Cancelled, CaseError, DeformError, MeshError
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.rbf import exact as solve
from slideviz.solver import deform as solver
from slideviz.solver.prepare import prepare
from slideviz.terms import SLIDING
from tests import builders
from tests.slow import one_of_each_fast

METHODS = list(SLIDING)
BOX = dict.fromkeys(("x_m", "x_p", "y_m", "y_p", "z_m", "z_p"), "sliding")


def roles(mesh, **changed):
    return dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"} | changed


def square_case(mesh, vector=(0.1, 0.05), **settings):
    given = {n: r for n, r in roles(mesh).items() if n in mesh.marker_names}
    return Case(roles=given, motions=(Translate("BLOCK", vector),), **settings)


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def from_file(tmp_path, mesh, marker, vectors):
    """A displacement file for the nodes of a marker."""
    path = tmp_path / "move.txt"
    nodes = mesh.marker(marker).nodes
    rows = zip(nodes.tolist(), vectors.tolist(), strict=True)
    path.write_text("\n".join(" ".join(map(repr, (n, *v))) for n, v in rows))
    return FromFile(path, marker)


# Steps, progress and cancel


def test_steps_are_counted_and_the_mesh_keeps_its_cells():
    mesh = builders.square(6)
    steps = list(sv.deform(square_case(mesh, steps=3, sliding="ds"), mesh))
    assert [(s.index, s.total) for s in steps] == [(1, 3), (2, 3), (3, 3)]
    for step in steps:
        assert step.mesh.cells is mesh.cells
        assert step.mesh.markers == mesh.markers
        assert not step.mesh.points.flags.writeable
        assert sum(step.node_counts.values()) == len(mesh.points)
        assert step.control_nodes == 32
        assert step.warnings == ()
    assert "classify" in steps[0].seconds
    assert "classify" not in steps[1].seconds
    assert {"solve", "evaluate"} <= set(steps[1].seconds)
    assert all(v >= 0 for s in steps for v in s.seconds.values())


def test_warnings_of_the_case_are_passed_on():
    mesh = builders.square(6)
    assert last(square_case(mesh, warnings=("odd line",)), mesh).warnings == ("odd line",)


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_through_every_phase_of_every_step(method):
    mesh = builders.annulus(far_parts=2)
    heard = []
    case = Case(
        roles={"wall": "moving", "far0": "sliding", "far1": "sliding"},
        motions=(Rotate("wall", 5.0),),
        sliding=method,
        steps=2,
    )
    list(sv.deform(case, mesh, heard.append))
    assert all(0.0 <= p.fraction <= 1.0 and p.total == 2 for p in heard)
    assert [p.step for p in heard] == sorted(p.step for p in heard)
    phases = {p.phase for p in heard if p.step == 2}
    assert {"solve", "evaluate"} <= phases
    assert ("project" in phases) == (method != "none")
    assert heard[0].phase == "classify"


def calls_of(case, mesh):
    heard = []
    list(sv.deform(case, mesh, heard.append))
    return len(heard)


@pytest.mark.parametrize("method", METHODS)
def test_a_callback_that_raises_ends_the_run_at_once_wherever_it_is(method):
    mesh = builders.square(6)
    case = square_case(mesh, sliding=method, steps=2)
    for stop in range(calls_of(case, mesh)):
        heard = []

        def cancel(progress, heard=heard, stop=stop):
            heard.append(progress)
            if len(heard) > stop:
                raise Cancelled("enough")

        run = sv.deform(case, mesh, cancel)
        with pytest.raises(Cancelled, match="enough"):
            list(run)
        assert len(heard) == stop + 1
        assert list(run) == []
    # And nothing is left locked.
    assert last(case, mesh).index == 2


@pytest.mark.parametrize("steps", [1, 3])
def test_a_plan_made_before_gives_the_same_mesh(steps, monkeypatch):
    from slideviz.samples.table import sample
    from slideviz.solver.setup import make_setup

    made = sample("square", 10, "motion")
    case, mesh = made.case.change(steps=steps), made.mesh
    *_, alone = sv.deform(case, mesh)
    setup = make_setup(prepare(case.change(steps=7), mesh))
    monkeypatch.setattr(solver, "make_setup", None)
    *_, shared = sv.deform(case, mesh, setup=setup)
    assert np.array_equal(shared.mesh.points, alone.mesh.points)
    assert shared.warnings == alone.warnings


def test_the_generator_can_be_closed_in_the_middle():
    mesh = builders.square(6)
    heard = []
    run = sv.deform(square_case(mesh, steps=5), mesh, heard.append)
    first = next(run)
    before = len(heard)
    run.close()
    assert len(heard) == before
    assert list(run) == []
    assert first.index == 1
    assert np.isfinite(first.mesh.points).all()


def test_nothing_is_done_before_the_first_step_is_pulled():
    heard = []
    mesh = builders.square(6)
    sv.deform(square_case(mesh, vector=(np.nan, 0.0)), mesh, heard.append)
    assert heard == []


# Errors


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_coordinates_that_are_not_finite_are_refused_by_node(bad):
    mesh = builders.square(6)
    points = mesh.points.copy()
    points[[7, 9], 1] = bad
    with pytest.raises(MeshError, match=r"node 7 is at .*must be finite numbers \(2 nodes"):
        next(sv.deform(square_case(mesh), mesh.with_points(points)))


@pytest.mark.parametrize("method", METHODS)
def test_a_displacement_that_overflows_is_told(method):
    mesh = builders.square(6)
    case = square_case(mesh, vector=(9e49, 9e49), sliding=method)
    with pytest.raises(CaseError, match="so move it less"):
        last(case.change(motions=2 * case.motions), mesh)


def test_nothing_known_is_refused():
    mesh = builders.square(6)
    empty = Marker("BLOCK", Cells.from_types([], []))
    free = Mesh(mesh.points, mesh.cells, (*mesh.markers[:4], empty), name="a.su2")
    case = square_case(mesh).change(
        roles=dict.fromkeys(mesh.marker_names, "internal") | {"BLOCK": "moving"}
    )
    with pytest.raises(DeformError, match=r"a\.su2: no boundary node has a known displacement"):
        next(sv.deform(case, free))


@pytest.mark.parametrize(("method", "unknowns"), [("none", 32), ("ps", 32), ("ds", 44)])
def test_a_system_too_large_for_memory_is_refused_before_it_is_built(method, unknowns, monkeypatch):
    mesh = builders.square(6)
    monkeypatch.setattr(solver, "free_memory", lambda: 1000.0)
    monkeypatch.setattr(solve, "extend", lambda *_: pytest.fail("the system was built"))
    text = rf"{unknowns} unknowns need 0\.0 GB of memory, 0\.0 GB are free; give large bound"
    with pytest.raises(DeformError, match=text):
        next(sv.deform(square_case(mesh, sliding=method), mesh))


def test_direct_sliding_along_axes_needs_memory_for_one_axis_at_a_time(monkeypatch):
    mesh = builders.square(6)
    monkeypatch.setattr(solver, "free_memory", lambda: 15_000.0)  # 44 unknowns: 40,000
    case = square_case(mesh, sliding="ds")
    last(case, mesh)
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    with pytest.raises(DeformError, match="44 unknowns need"):
        last(case, mesh.with_points(mesh.points @ turn))


def testfree_memory_is_a_number_of_bytes():
    assert solver.free_memory() > 1e7


def test_a_marker_element_that_is_no_side_is_told():
    mesh = builders.square(6)
    odd = Marker("odd", Cells.from_blocks([(3, [[0, 8]])]))
    wrong = Mesh(mesh.points, mesh.cells, (*mesh.markers, odd))
    with pytest.raises(MeshError, match=r"'odd' .* not a side of any cell"):
        next(sv.deform(square_case(mesh), wrong))


def periodic_case(mesh, mode="periodic", kind="translational", **settings):
    given = roles(mesh, y_m="periodic", y_p="periodic")
    return Case(
        roles=given,
        motions=(Translate("BLOCK", (0.05, 0.03)[: mesh.dim]),),
        periodic=mode,
        periodic_type=kind,
        sliding="ds",
        **settings,
    )


def test_periodic_markers_that_do_not_match_are_told():
    mesh = builders.square(6)
    points = mesh.points.copy()
    points[mesh.marker("y_p").nodes[3]] += [0.01, 0.0]
    with pytest.raises(MeshError, match="'y_m' and 'y_p' do not match: with the best"):
        next(sv.deform(periodic_case(mesh), mesh.with_points(points)))
    with pytest.raises(MeshError, match="best rotational transformation"):
        next(sv.deform(periodic_case(mesh, kind="rotational"), mesh))


def test_periodic_markers_of_different_size_are_told():
    mesh = builders.grid(
        (6, 4),
        rules=[
            *builders.box_rules((6, 4))[:3],
            ("half", lambda p: bool(np.all(p[:, 1] == 4) and p[:, 0].max() <= 3)),
            ("y_p", lambda p: True),
        ],
    )
    case = Case(
        roles={"y_m": "periodic", "half": "periodic", "x_m": "moving"},
        motions=(Translate("x_m", (0.0, 0.0)),),
        periodic="periodic",
        sliding="ds",
    )
    with pytest.raises(MeshError, match="'y_m' and 'half' do not match: 7 and 4 nodes"):
        next(sv.deform(case, mesh))


def test_without_periodicity_markers_need_not_match():
    mesh = builders.square(6)
    points = mesh.points.copy()
    points[mesh.marker("y_p").nodes[3]] += [0.01, 0.0]
    assert last(periodic_case(mesh, mode="none"), mesh.with_points(points)).index == 1


def test_an_odd_number_of_periodic_markers_is_told():
    mesh = builders.square(6)
    case = periodic_case(mesh).change(roles=roles(mesh, y_m="periodic"))
    with pytest.raises(CaseError, match="come in pairs"):
        next(sv.deform(case, mesh))


def test_pairs_of_different_periods_are_told():
    mesh = builders.square(6)
    sides = dict.fromkeys(("x_m", "x_p", "y_m", "y_p"), "periodic")
    with pytest.raises(MeshError, match="differ; only one period is possible"):
        next(sv.deform(periodic_case(mesh).change(roles=roles(mesh, **sides)), mesh))


def test_a_zero_axis_is_told():
    mesh = builders.passage((2, 4, 4))
    case = Case(
        roles=dict.fromkeys(mesh.marker_names, "sliding")
        | {"blade": "moving", "per1": "periodic", "per2": "periodic"},
        motions=(Translate("blade", (0.0, 0.0, 0.01)),),
        periodic="periodic",
        periodic_type="rotational",
    )
    with pytest.raises(CaseError, match=r"the axis \(0, 0, 0\) has no direction"):
        case.change(axis=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("method", ["none", "ds"])
def test_a_moved_periodic_boundary_must_move_like_its_image(method):
    """A body that cuts a periodic boundary, displaced on one side only."""
    mesh = builders.square(6, block=False)
    case = Case(
        roles={"x_m": "moving", "x_p": "sliding", "y_m": "periodic", "y_p": "periodic"},
        motions=(Scale("x_m", (1.0, 0.9)),),
        periodic="periodic",
        sliding=method,
    )
    with pytest.raises(DeformError, match=r"coincide .*one period apart\) but are asked to move"):
        last(case, mesh)


# Geometry that is asking for trouble


@pytest.mark.parametrize("first", [1e-5, 1e-6])
@pytest.mark.parametrize("method", METHODS)
def test_a_boundary_layer_of_a_millionth(method, first, tmp_path):
    """Walls beside the layer have nodes so near that the system is singular: the guard acts."""
    mesh = builders.layered(20, first)
    x = mesh.points[mesh.marker("y_m").nodes]
    bump = np.stack([np.zeros(len(x)), 0.02 * np.sin(np.pi * x[:, 0]) ** 2], axis=1)
    case = Case(
        roles={"y_m": "moving", "y_p": "fixed", "x_m": "sliding", "x_p": "sliding"},
        motions=(from_file(tmp_path, mesh, "y_m", bump),),
        sliding=method,
    )
    found = last(case, mesh)
    wall = mesh.marker("y_m").nodes
    np.testing.assert_allclose(found.mesh.points[wall] - x, bump, rtol=0, atol=1e-16)
    for side, value in (("x_m", 0.0), ("x_p", 1.0)):
        np.testing.assert_array_equal(found.mesh.points[mesh.marker(side).nodes, 0], value)
    if first == 1e-6:
        (warning,) = found.warnings
        assert "they nearly coincide with others (first: node " in warning
        node = int(warning.split("first: node ")[1].split(" at ")[0])
        where = [float(v) for v in warning.split(" at ")[1].split(")")[0].split(", ")]
        np.testing.assert_allclose(mesh.points[node], where, rtol=1e-5)
    assert sv.quality(found.mesh, mesh).inverted == 0


@pytest.mark.parametrize("method", METHODS)
def test_the_faces_of_a_thin_plate_move_together(method):
    mesh = builders.plate(12)
    case = Case(
        roles=BOX | {"below": "moving", "above": "moving"},
        motions=(Translate("below", (0.1, -0.1)), Translate("above", (0.1, -0.1))),
        sliding=method,
        steps=2,
    )
    case = case.change(roles={k: v for k, v in case.roles.items() if k in mesh.marker_names})
    found = last(case, mesh)
    assert found.warnings == ()
    assert sv.quality(found.mesh, mesh).inverted == 0
    for name in ("below", "above"):
        nodes = mesh.marker(name).nodes
        np.testing.assert_allclose(
            found.mesh.points[nodes] - mesh.points[nodes], [[0.1, -0.1]] * len(nodes), atol=1e-15
        )


@pytest.mark.parametrize("method", ["ps", "ds"])
def test_a_plate_may_slide_along_its_moving_other_face(method):
    mesh = builders.plate(8)
    given = dict.fromkeys(mesh.marker_names, "sliding") | {"below": "moving"}
    case = Case(roles=given, motions=(Translate("below", (0.02, 0.0)),), sliding=method)
    found = last(case, mesh)
    assert found.warnings == ()
    above = mesh.marker("above").nodes
    assert np.ptp(found.mesh.points[above, 1]) == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_a_plate_that_opens_is_refused(method):
    """The interpolation is continuous: two nodes in one place cannot part."""
    mesh = builders.plate(8)
    given = dict.fromkeys(mesh.marker_names, "sliding") | {"below": "moving"}
    nodes = mesh.marker("below").nodes
    case = Case(roles=given, motions=(Translate("below", (0.0, -0.02)),), sliding=method)
    assert len(nodes) == 5
    with pytest.raises(DeformError, match=r"coincide .* asked to move differently, by 0\.02"):
        last(case, mesh)


@pytest.mark.parametrize("parts", [1, 2])
@pytest.mark.parametrize("method", METHODS)
def test_a_full_annulus(method, parts):
    mesh = builders.annulus(n=40, far_parts=parts)
    far = [n for n in mesh.marker_names if n != "wall"]
    case = Case(
        roles={"wall": "moving"} | dict.fromkeys(far, "sliding"),
        motions=(Rotate("wall", 15.0), Translate("wall", (0.2, 0.1))),
        sliding=method,
        steps=2,
    )
    found = last(case, mesh)
    assert sv.quality(found.mesh, mesh).inverted == 0
    assert found.node_counts["fixed"] == (40 if method == "none" else 0)
    nodes = np.concatenate([mesh.marker(n).nodes for n in far])
    radius = np.linalg.norm(found.mesh.points[nodes], axis=1)
    assert np.all(radius <= 2 + 1e-12)
    assert np.all(radius >= 2 * np.cos(np.pi / 40) - 1e-12)
    if method != "none":
        assert np.abs(found.mesh.points[nodes] - mesh.points[nodes]).max() > 1e-3


@pytest.mark.parametrize("periodic", ["none", "periodic", "fixed", "moving"])
@pytest.mark.parametrize("method", ["ps", "ds"])
def test_periodic_boundaries_that_meet_on_the_axis(method, periodic):
    mesh = builders.wedge(8)
    case = Case(
        roles={"outer": "sliding", "per1": "periodic", "per2": "periodic", "BLOCK": "moving"},
        motions=(Rotate("BLOCK", 5.0, (0.0, 0.0)),),
        sliding=method,
        periodic=periodic,
        periodic_type="rotational",
        steps=2,
    )
    found = last(case, mesh)
    axis = int(np.argmin(np.linalg.norm(mesh.points, axis=1)))
    np.testing.assert_array_equal(found.mesh.points[axis], mesh.points[axis])
    assert sv.quality(found.mesh, mesh).inverted == 0
    outer = np.linalg.norm(found.mesh.points[mesh.marker("outer").nodes], axis=1)
    np.testing.assert_allclose(outer, 1.0, atol=1e-14)
    one, two = (mesh.marker(n).nodes for n in ("per1", "per2"))
    if periodic in ("none", "periodic"):
        for nodes, angle in ((one, 0.0), (two, 60.0)):
            across = np.array([-np.sin(np.radians(angle)), np.cos(np.radians(angle))])
            np.testing.assert_allclose(found.mesh.points[nodes] @ across, 0.0, atol=1e-14)
    else:
        c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
        turned = found.mesh.points[one] @ np.array([[c, s], [-s, c]])
        order = [np.argsort(np.linalg.norm(mesh.points[n], axis=1)) for n in (one, two)]
        np.testing.assert_allclose(turned[order[0]], found.mesh.points[two][order[1]], atol=1e-13)


@pytest.mark.parametrize("method", METHODS)
def test_a_moving_body_that_touches_sliding_walls(method):
    mesh = builders.channel()
    case = Case(
        roles=dict.fromkeys(mesh.marker_names, "sliding") | {"bump": "moving"},
        motions=(Translate("bump", (0.05, 0.0)),),
        sliding=method,
        steps=2,
    )
    found = last(case, mesh)
    assert sv.quality(found.mesh, mesh).inverted == 0
    for name in ("low1", "low2"):
        nodes = mesh.marker(name).nodes
        np.testing.assert_array_equal(found.mesh.points[nodes, 1], 0.0)
    shared = np.intersect1d(mesh.marker("low1").nodes, mesh.marker("bump").nodes)
    np.testing.assert_allclose(found.mesh.points[shared, 0], mesh.points[shared, 0] + 0.05)


@pytest.mark.parametrize("method", ["ps", "ds"])
def test_an_airfoil_keeps_its_trailing_edge_and_its_shape(method):
    """Near the edge the profile is thinner than the way its nodes are pushed across it."""
    mesh = builders.airfoil(n=80, layers=10)
    case = Case(
        roles={"airfoil": "sliding", "far": "moving"},
        motions=(Rotate("far", 1.0, (0.5, 0.0)),),
        sliding=method,
        steps=2,
    )
    found = last(case, mesh)
    edge = int(np.argmin(np.linalg.norm(mesh.points - [1.0, 0.0], axis=1)))
    np.testing.assert_array_equal(found.mesh.points[edge], mesh.points[edge])
    nodes = mesh.marker("airfoil").nodes
    assert on_polygon(found.mesh.points[nodes], mesh, "airfoil") < 1e-12
    assert sv.quality(found.mesh, mesh).inverted == 0


def on_polygon(x, mesh, marker):
    """Largest distance of points to the undeformed sides of a 2D marker."""
    sides = mesh.points[mesh.marker(marker).cells.by_type[3][1]]
    a, u = sides[:, 0], sides[:, 1] - sides[:, 0]
    t = np.einsum("psd,sd->ps", x[:, None] - a, u) / np.einsum("sd,sd->s", u, u)
    spot = a + np.clip(t, 0, 1)[..., None] * u
    return np.linalg.norm(spot - x[:, None], axis=2).min(axis=1).max()


@pytest.mark.parametrize("method", ["ps", "ds"])
def test_a_turning_sphere_keeps_the_box_and_the_box_the_sphere(method):
    mesh = builders.sphere_in_box(6)
    sides = [n for n in mesh.marker_names if n != "sphere"]
    case = Case(
        roles=dict.fromkeys(sides, "sliding") | {"sphere": "moving"},
        motions=(Rotate("sphere", 15.0, axis=(1.0, 2.0, 0.5)),),
        sliding=method,
    )
    found = last(case, mesh)
    assert sv.quality(found.mesh, mesh).inverted == 0
    for axis in range(3):
        for letter, value in (("m", -1.0), ("p", 1.0)):
            nodes = mesh.marker(f"{'xyz'[axis]}_{letter}").nodes
            np.testing.assert_array_equal(found.mesh.points[nodes, axis], value)
            assert np.abs(found.mesh.points[nodes]).max() <= 1.0
    slid = mesh.marker("x_m").nodes
    assert np.abs(found.mesh.points[slid] - mesh.points[slid]).max() > 1e-3


@pytest.mark.parametrize(
    ("periodic", "method"), one_of_each_fast(["none", "periodic", "fixed", "moving"], ["ps", "ds"])
)
@pytest.mark.parametrize("rim", ["sliding", "internal"])
@pytest.mark.parametrize("kind", ["plain", "simplex", "prism"])
def test_the_rims_of_a_passage_stay_circles(kind, rim, method, periodic):
    mesh = builders.passage((4, 6, 8), kind=kind)
    case = Case(
        roles={
            "hub": rim,
            "shroud": rim,
            "inflow": "sliding",
            "outflow": "sliding",
            "per1": "periodic",
            "per2": "periodic",
            "blade": "moving",
        },
        motions=(Rotate("blade", 3.0, (0.0, 0.0, 0.0)), Translate("blade", (0.0, 0.0, 0.05))),
        sliding=method,
        periodic=periodic,
        periodic_type="rotational",
        steps=2,
    )
    found = last(case, mesh)
    points = found.mesh.points
    assert sv.quality(found.mesh, mesh).inverted == 0
    for name, radius in (("hub", 0.5), ("shroud", 1.0)):
        nodes = mesh.marker(name).nodes
        r = np.hypot(*points[nodes, :2].T)
        if rim == "sliding":
            np.testing.assert_allclose(r, radius, atol=1e-14)
        for ring, z in (("inflow", 0.0), ("outflow", 1.0)):
            both = np.intersect1d(nodes, mesh.marker(ring).nodes)
            np.testing.assert_allclose(np.hypot(*points[both, :2].T), radius, atol=1e-14)
            np.testing.assert_allclose(points[both, 2], z, atol=1e-15)
    one, two = (mesh.marker(n).nodes for n in ("per1", "per2"))
    theta = np.arctan2(points[:, 1], points[:, 0])
    if periodic in ("none", "periodic"):
        np.testing.assert_allclose(theta[one], 0.0, atol=1e-15)
        np.testing.assert_allclose(theta[two], np.pi / 6, atol=1e-15)
    else:
        keys = [
            np.lexsort([mesh.points[n, 2], np.hypot(*mesh.points[n, :2].T).round(9)])
            for n in (one, two)
        ]
        one, two = one[keys[0]], two[keys[1]]
        np.testing.assert_allclose(theta[two] - theta[one], np.pi / 6, atol=1e-13)
        np.testing.assert_allclose(points[two, 2], points[one, 2], atol=1e-14)


@pytest.mark.parametrize("role", ["moving", "fixed", "sliding", "internal"])
@pytest.mark.parametrize("method", METHODS)
def test_a_marker_inside_the_domain(method, role):
    mesh = builders.square(8, block=False)
    row = np.flatnonzero(np.isclose(mesh.points[:, 1], 0.5))
    inside = Marker("line", Cells.from_blocks([(3, np.stack([row[:-1], row[1:]], axis=1))]))
    mesh = Mesh(mesh.points, mesh.cells, (*mesh.markers, inside))
    given = dict.fromkeys(mesh.marker_names, "sliding") | {"y_m": "moving", "line": role}
    motions = tuple(Translate(n, (0.0, 0.05)) for n, r in given.items() if r == "moving")
    found = last(Case(roles=given, motions=motions, sliding=method), mesh)
    assert sv.quality(found.mesh, mesh).inverted == 0
    if role in ("fixed", "sliding"):
        np.testing.assert_array_equal(found.mesh.points[row, 1], 0.5)


def test_a_node_at_the_open_end_of_a_marker_stays_on_it():
    """Direct sliding on flat boundaries projects nothing, but no node may leave its piece."""
    base = builders.square(8)
    upper = base.marker("x_p").cells.by_type[3][1][:-1]
    markers = tuple(
        Marker(m.name, Cells.from_blocks([(3, upper)])) if m.name == "x_p" else m
        for m in base.markers
        if m.name != "y_p"
    )
    mesh = Mesh(base.points, base.cells, markers)
    case = Case(roles=roles(mesh), motions=(Translate("BLOCK", (0.2, 0.15)),), sliding="ds")
    found = last(case, mesh)
    nodes = mesh.marker("x_p").nodes
    np.testing.assert_allclose(found.mesh.points[nodes, 0], 1.0, atol=1e-15)
    assert found.mesh.points[nodes, 1].max() <= mesh.points[nodes, 1].max() + 1e-15


def test_a_step_is_a_frozen_value():
    step = last(square_case(builders.square(6)), builders.square(6))
    with pytest.raises(dataclasses.FrozenInstanceError):
        step.index = 2
