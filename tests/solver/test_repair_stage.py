"""Repair as users meet it: a run's stage, alone, its report and its words."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError, MeshError, UnsoundError, messages_of
from slideviz.mesh.quality import VALID
from slideviz.solver import repair_stage
from slideviz.solver.repair_stage import LOSS, find_freedom, repair_case
from tests import builders

MOTIONS = (sv.Translate("", (0.25, 0.1)), sv.Rotate("", 50.0))


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def folded(**values):
    """A block that is turned in a square, so far that cells beside it fold."""
    mesh = builders.square(12)
    case = sv.Case(roles={"BLOCK": "moving"}, motions=MOTIONS, reduction=None)
    return mesh, case.change(**values)


def scrambled(mesh, share=1.0, seed=3):
    """The mesh with its inner nodes moved at random, by up to ``share`` of its extent."""
    rng = np.random.default_rng(seed)
    points = mesh.points + share * mesh.extent * (rng.random(mesh.points.shape) - 0.5)
    outer = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    points[outer] = mesh.points[outer]
    return mesh.with_points(points)


def passage(role="sliding"):
    """A folded passage about z, whose hub and shroud are curved."""
    mesh = builders.passage((6, 8, 8))
    roles = {"hub": role, "shroud": role, "blade": "fixed"}
    roles |= {"per1": "periodic", "per2": "periodic", "inflow": "sliding", "outflow": "sliding"}
    return mesh, sv.Case(roles=roles, sliding="ps", periodic="moving", repair="yes")


def test_a_run_mends_its_folded_cells_and_keeps_all_else():
    mesh, case = folded()
    plain, mended = last(case, mesh), last(case.change(repair="yes"), mesh)
    before, after = (sv.quality(step.mesh, mesh) for step in (plain, mended))
    assert before.inverted
    assert (after.status == VALID).all()
    assert after.min >= 0.1
    done = mended.repaired
    assert plain.repaired is None
    assert set(before.inverted_cells()) <= set(done.cells)
    assert not len(done.left)
    changed = (plain.mesh.points != mended.mesh.points).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(changed), done.nodes)
    np.testing.assert_array_equal(done.points, plain.mesh.points[done.nodes])
    held = np.concatenate([marker.nodes for marker in mesh.markers])
    assert not changed[held].any()
    assert not np.isin(done.nodes, held).any()
    far = np.linalg.norm(plain.mesh.points - mended.mesh.points, axis=1).max()
    assert done.largest_move == pytest.approx(far)
    assert mended.seconds["repair"] > 0.0


@given(angle=st.floats(5.0, 45.0), shift=st.floats(0.0, 0.1))
@example(angle=10.0, shift=0.0)  # only a second round lifts
@settings(max_examples=8, deadline=None)
def test_after_relaxation_the_lowest_qualities_are_raised_and_the_mean_stays(angle, shift):
    mesh, case = folded(motions=(sv.Translate("", (shift, 0.0)), sv.Rotate("", angle)), relax="yes")
    plain, lifted = last(case, mesh), last(case.change(repair="yes"), mesh)
    before, after = (sv.quality(step.mesh, mesh) for step in (plain, lifted))
    assert after.min > before.min
    assert after.mean >= before.mean - LOSS
    changed = (plain.mesh.points != lifted.mesh.points).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(changed), lifted.repaired.nodes)
    assert not changed[np.concatenate([marker.nodes for marker in mesh.markers])].any()


def test_no_cell_is_lifted_where_the_mean_would_fall(monkeypatch):
    mesh, case = folded(motions=(sv.Rotate("", 20.0),), relax="yes")
    monkeypatch.setattr(repair_stage, "LOSS", -1.0)
    plain, mended = last(case, mesh), last(case.change(repair="yes"), mesh)
    np.testing.assert_array_equal(plain.mesh.points, mended.mesh.points)
    assert not len(mended.repaired.nodes)


def test_a_good_mesh_keeps_its_bits():
    mesh, case = folded(motions=(sv.Rotate("", 5.0),))
    plain, mended = last(case, mesh), last(case.change(repair="auto"), mesh)
    np.testing.assert_array_equal(plain.mesh.points, mended.mesh.points)
    assert mended.repaired.report()["cells_before"] == 0
    assert mended.repaired.words() == "no cell needs repair"


def test_each_step_is_mended_on_request_and_each_trial_is_not():
    mesh, case = folded(steps=2, motions=(sv.Translate("", (0.3, 0.15)), sv.Rotate("", 60.0)))
    each = list(sv.deform(case.change(repair="yes", repair_steps=True), mesh))
    assert [step.repaired is not None for step in each] == [True, True]
    alone = list(sv.deform(case.change(repair="yes"), mesh))
    assert [step.repaired is not None for step in alone] == [False, True]
    assert all(not sv.quality(step.mesh, mesh).inverted for step in (each[-1], alone[-1]))
    auto = list(sv.deform(case.change(repair="yes", steps=0), mesh))
    assert [step.repaired is not None for step in auto] == [False] * (len(auto) - 1) + [True]


@pytest.mark.parametrize("steps", [1, 2])
@pytest.mark.parametrize("values", [{"repair": "no"}, {"repair": "yes", "repair_steps": True}])
def test_repair_does_not_hide_nodes_that_run_away(values, steps):
    heights = np.array([0.0, 5e-4, 2e-3, 6e-3, 0.017, 0.048, 0.13, 0.36, 1.0])
    mesh = builders.grid(
        (8, 8), place=lambda p: np.stack([p[:, 0] / 8, heights[p[:, 1].astype(int)]], 1)
    )
    case = sv.Case(
        roles={"y_m": "moving", "y_p": "sliding", "x_m": "internal"},
        motions=(sv.Translate("y_m", (0.0, -0.036)),),
        sliding="ds",
        relax="no",
        **values,
    )
    with pytest.raises(UnsoundError, match=r"would move by .*, more than 5 times the"):
        list(sv.deform(case.change(steps=steps), mesh))


@pytest.mark.parametrize("role", ["sliding", "internal"])
def test_nodes_slide_on_curved_walls_and_images_move_alike(role):
    mesh, case = passage(role)
    bad = scrambled(mesh, 0.3)
    done = sv.repair(
        bad,
        mesh,
        sliding=("hub", "shroud", "inflow", "outflow"),
        periodic=("per1", "per2"),
    )
    after = sv.quality(done.mesh, mesh)
    assert sv.quality(bad, mesh).inverted > 100
    assert (after.status == VALID).all()
    radius = np.linalg.norm(done.mesh.points[:, :2], axis=1)
    for wall, r in (("hub", 0.5), ("shroud", 1.0)):
        np.testing.assert_allclose(radius[mesh.marker(wall).nodes], r, rtol=1e-12)
    assert np.isin(mesh.marker("hub").nodes, done.nodes).any()
    freedom = find_freedom(case, mesh, bad.points)
    place, one, two = freedom.place, mesh.marker("per1").nodes, mesh.marker("per2").nodes
    turn = np.array(
        [[np.cos(np.pi / 6), -np.sin(np.pi / 6)], [np.sin(np.pi / 6), np.cos(np.pi / 6)]]
    )
    there = {int(block): node for node in two if (block := place[node]) >= 0}
    images = [(node, there[int(place[node])]) for node in one if place[node] >= 0]
    assert len(images) > 20
    first, second = np.array(images).T
    expected = done.mesh.points[first]
    expected[:, :2] = expected[:, :2] @ turn.T
    np.testing.assert_allclose(done.mesh.points[second], expected, atol=1e-12)
    assert (place[mesh.marker("blade").nodes] < 0).all()


def test_nodes_off_their_wall_are_put_back_with_their_images():
    mesh, case = passage()
    freedom = find_freedom(case, mesh, mesh.points)
    hub = np.intersect1d(freedom.curved, mesh.marker("hub").nodes)
    off = mesh.points[hub] * 1.01
    points, maps = freedom.project(hub, off)
    np.testing.assert_allclose(np.linalg.norm(points[:, :2], axis=1), 0.5, rtol=1e-12)
    moved = np.linalg.norm(points[:, :2] - off[:, :2], axis=1)
    np.testing.assert_allclose(moved, 0.005, rtol=1e-6)
    radial = points[:, :2] / 0.5
    np.testing.assert_allclose(np.einsum("ki,kij->kj", radial, maps[:, :2]), 0.0, atol=1e-9)


def test_internal_boundaries_slide_and_without_a_sliding_method_others_stay():
    mesh = builders.passage((2, 4, 4), 40.0)
    roles = {"hub": "internal", "inflow": "sliding", "per1": "periodic", "per2": "periodic"}
    case = sv.Case(roles=roles, periodic_type="rotational", sliding="none", periodic="none")
    assert repair_case(case).roles == roles | {"hub": "sliding"}
    freedom = find_freedom(case, mesh, mesh.points)
    free = freedom.place >= 0
    others = np.unique(np.concatenate([m.nodes for m in mesh.markers if m.name != "hub"]))
    assert not free[others].any()
    hub = np.setdiff1d(mesh.marker("hub").nodes, others)
    assert free[hub].all()
    assert np.isin(hub, freedom.bound).all()
    sides = find_freedom(case.change(sliding="ds", periodic="moving"), mesh, mesh.points)
    assert (
        sides.place[np.setdiff1d(mesh.marker("per1").nodes, mesh.marker("hub").nodes)] >= 0
    ).any()


def test_nodes_that_a_run_took_off_an_internal_boundary_keep_their_distance_from_it():
    mesh = builders.passage((2, 6, 6), 40.0)
    case = sv.Case(
        roles={"hub": "internal", "blade": "moving", "per1": "periodic", "per2": "periodic"},
        periodic_type="rotational",
        sliding="none",
        periodic="none",
    )
    hub = mesh.marker("hub").nodes
    off = np.array(mesh.points)
    off[hub, :2] *= 1.0 + 0.02 * np.sin(40 * off[hub, 2:])
    freedom = find_freedom(case, mesh, off)
    nodes = freedom.curved[np.isin(freedom.curved, hub)]
    there = off[nodes] + np.random.default_rng(1).normal(0, 0.01, (len(nodes), 3))
    points, maps = freedom.project(nodes, there)
    radius = np.linalg.norm(off[nodes, :2], axis=1)
    np.testing.assert_allclose(np.linalg.norm(points[:, :2], axis=1), radius, rtol=1e-12)
    radial = points[:, :2] / radius[:, None]
    np.testing.assert_allclose(np.einsum("ki,kij->kj", radial, maps[:, :2]), 0.0, atol=1e-9)
    assert np.array_equal(freedom.project(nodes, off[nodes])[0], off[nodes])


def test_outer_sides_without_a_boundary_stay():
    whole = builders.square(6, block=False)
    some = sv.Mesh(whole.points, whole.cells, whole.markers[:1])
    bad = scrambled(whole, 0.4)
    for mesh in (some, sv.Mesh(whole.points, whole.cells)):
        done = sv.repair(mesh.with_points(bad.points), mesh, sliding=mesh.marker_names)
        assert (sv.quality(done.mesh, mesh).status == VALID).all()
        outer = np.flatnonzero(((whole.points == 0) | (whole.points == 1)).any(axis=1))
        slid = outer[(whole.points[outer] == 0)[:, 0]] if mesh.markers else outer[:0]
        rest = np.setdiff1d(outer, slid)
        np.testing.assert_array_equal(done.mesh.points[rest], whole.points[rest])
        assert (done.mesh.points[slid, 0] == 0).all()


def test_cells_that_cannot_be_mended_are_named_with_their_boundary():
    mesh = builders.square(6, block=False)
    points = mesh.points.copy()
    corner = int(np.flatnonzero((points == 0).all(axis=1))[0])
    points[corner] = 0.9 / 6  # beyond the diagonal of its cell, whose neighbours are held
    done = sv.repair(mesh.with_points(points), mesh)
    assert len(done.left) == 1
    assert [cell for cell, _ in done.unmendable] == list(done.left)
    assert "x_m" in done.unmendable[0][1]
    assert "cannot be mended" in done.warnings[0]
    assert done.report()["unmendable"][0]["cell"] == done.left[0]


def test_a_deformer_leaves_repair_out_and_says_so():
    mesh, case = folded()
    plain = sv.Deformer(mesh, case)
    for value, harmless in (("auto", True), ("yes", False)):
        deformer = sv.Deformer(mesh, case.change(repair=value))
        said = [one for one in messages_of(deformer.messages) if "REPAIR" in str(one)]
        assert [one.level == "note" for one in said] == [harmless]
        np.testing.assert_array_equal(deformer.deform(), plain.deform())
        assert deformer.as_run() is None


def test_wrong_requests_are_refused():
    mesh = builders.square(6)
    with pytest.raises(CaseError, match="'x_m' is both fixed and sliding"):
        sv.repair(mesh, fixed=["x_m"], sliding=["x_m"])
    with pytest.raises(CaseError, match="no marker 'wall'"):
        sv.repair(mesh, sliding=["wall"])
    with pytest.raises(CaseError, match=r"below: 2\.0 is out of range"):
        sv.repair(mesh, below=2.0)
    with pytest.raises(CaseError, match="needs the undeformed mesh"):
        sv.repair(mesh, target="reference")
    with pytest.raises(MeshError, match="must have the same cells"):
        sv.repair(mesh, builders.square(4))
    with pytest.raises(MeshError, match=r"do not match: .*; name two that are|same nodes") as found:
        sv.repair(mesh, periodic=["x_m", "y_p"])
    assert "PERIODIC_" not in str(found.value)
    for name in ("target", "metric"):
        with pytest.raises(CaseError, match=f"{name}: 'foo' is not one of "):
            sv.repair(mesh, mesh, **{name: "foo"})


def test_all_mistakes_are_told_at_once():
    with pytest.raises(CaseError) as found:
        sv.repair(
            builders.square(6), fixed=["foo"], periodic=["x_m"], below=-1.0, target="reference"
        )
    lines = str(found.value).splitlines()
    assert [line.partition(":")[0] for line in lines] == ["target", "fixed", "below", "periodic"]


def test_below_0_only_cells_that_are_not_valid_are_mended():
    mesh = scrambled(builders.square(6, block=False), 0.1)
    assert 0 < sv.quality(mesh).min < 0.9
    assert not len(sv.repair(mesh, below=0).cells)
    assert len(sv.repair(mesh, below=0.9).cells)


def test_the_command_mends_a_file_and_reports(tmp_path, capsys):
    mesh, case = folded()
    bad = last(case, mesh).mesh
    for name, each in (("base.su2", mesh), ("bad.su2", bad)):
        sv.write(tmp_path / name, each)
    out, report = tmp_path / "out.su2", tmp_path / "report.json"
    words = ["repair", str(tmp_path / "bad.su2"), "-o", str(out)]
    options = ["--reference", str(tmp_path / "base.su2"), "--fixed", "x_m, BLOCK"]
    assert run([*words, *options, "--sliding", "x_p", "--json", str(report)]) == 0
    said = json.loads(report.read_text())
    assert said["repair"]["cells_before"] > 0 == said["repair"]["cells_after"]
    assert said["target"] == "reference"
    assert said["quality"]["inverted"] == 0 < said["quality"]["before"]["inverted"]
    assert not sv.quality(sv.read(out), mesh).inverted
    assert "folded cells mended" in capsys.readouterr().out
    assert run([*words, "--sliding", "wall"]) == 1
    assert "no marker 'wall'" in capsys.readouterr().err
    assert run([*words[:2], "-o", str(tmp_path / "bad.su2")]) == 1
    for value in ("2", "1", "nan", "-0.1", "x"):
        assert run([*words, "--below", value]) == 2, value
        assert "argument --below: " in capsys.readouterr().err


def test_the_command_says_which_cells_are_left(tmp_path, capsys):
    mesh = builders.square(6, block=False)
    points = mesh.points.copy()
    points[np.flatnonzero((points == 0).all(axis=1))] = 0.9 / 6
    sv.write(tmp_path / "bad.su2", mesh.with_points(points))
    assert run(["repair", str(tmp_path / "bad.su2"), "-o", str(tmp_path / "out.su2")]) == 3
    said = capsys.readouterr().err
    assert "cannot be mended" in said
    assert "1 of 36 cells are still inverted" in said
    assert "--sliding for adjacent boundaries that did not move, or remesh there" in said


def test_a_run_reports_its_repair(tmp_path, capsys):
    mesh, case = folded(generate_quality=False)
    sv.write(tmp_path / "mesh.su2", mesh)
    case.change(mesh_file=tmp_path / "mesh.su2").write(tmp_path / "case.cfg")
    report = tmp_path / "report.json"
    words = ["run", str(tmp_path / "case.cfg"), "-o", str(tmp_path / "out.su2")]
    assert run([*words, "--set", "REPAIR=YES", "--json", str(report)]) == 0
    found = json.loads(report.read_text())
    assert found["repair"]["cells_before"] > 0 == found["repair"]["cells_after"]
    assert found["seconds"]["repair"] > 0.0
    assert "repair " in capsys.readouterr().out
    assert run([*words, "--json", str(report)]) == 3
    assert json.loads(report.read_text())["repair"] is None
    assert "REPAIR= YES" in capsys.readouterr().err
    words += ["--stream", "--json", str(report), "--set", "REPAIR=AUTO"]
    assert run(words) == 0
    streamed = json.loads(report.read_text())
    assert streamed["repair"] == found["repair"]
    assert streamed["seconds"]["repair"] > 0.0
    assert run([*words, "--set", "REPAIR_STEPS=YES"]) == 1
    assert "REPAIR_STEPS= YES needs the whole mesh after each step" in capsys.readouterr().err


def test_a_run_says_that_it_raised_the_lowest_qualities(tmp_path, capsys):
    mesh, case = folded(motions=(sv.Rotate("BLOCK", 20.0),), relax="yes", repair="yes")
    sv.write(tmp_path / "mesh.su2", mesh)
    case.change(mesh_file=tmp_path / "mesh.su2").write(tmp_path / "case.cfg")
    assert run(["run", str(tmp_path / "case.cfg"), "-o", str(tmp_path / "out.su2")]) == 0
    assert "lowest qualities raised; " in capsys.readouterr().out


def test_poor_cells_beside_a_boundary_that_nobody_chose_to_fix_advise_to_let_it_slide(
    tmp_path, capsys
):
    mesh, case = folded(repair="yes", repair_below=0.9, sliding="none")
    sides = [name for name in mesh.marker_names if name != "BLOCK"]
    advised = [text for text in last(case, mesh).warnings if "stay poor after repair" in text]
    assert len(advised) == 1
    assert "below 0.9, beside " in advised[0]
    assert advised[0].endswith("no role was chosen; let them slide, with SLIDING_MODE= ps or ds")
    chosen = case.change(roles={"BLOCK": "moving"} | dict.fromkeys(sides, "fixed"))
    assert not any("stay poor" in text for text in last(chosen, mesh).warnings)
    others = {name: role for name, role in chosen.roles.items() if name != "x_m"}
    one = case.change(roles=others, sliding="ps")
    (text,) = [text for text in last(one, mesh).warnings if "poor after repair" in text]
    assert "beside x_m, which is fixed only because no role was chosen; let it slide" in text
    sv.write(tmp_path / "mesh.su2", mesh)
    case.change(mesh_file=tmp_path / "mesh.su2").write(tmp_path / "case.cfg")
    for more in ((), ("--stream",)):
        report = tmp_path / f"report{len(more)}.json"
        words = ["run", str(tmp_path / "case.cfg"), "-o", str(tmp_path / f"{len(more)}.su2")]
        assert run([*words, *more, "--json", str(report)]) == 0
        assert advised[0] in capsys.readouterr().err
        assert advised[0] in json.loads(report.read_text())["warnings"]
