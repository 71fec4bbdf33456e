"""``sv.gaps`` and ``slideviz gap``: throat, tip gap and other distances, before and after."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure

import slideviz as sv
from slideviz.cli import run
from slideviz.design.blade_gaps import PLACES
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.model import Origin
from slideviz.plots.gap_curves import draw_gaps
from tests.builders import _renamed, grid, passage, ring, sector, stage

ROLES = {"blade": "moving", "per1": "periodic", "per2": "periodic", "shroud": "sliding"}
SHAPE = (8, 8, 8)
NAMES = ("hub", "shroud", "per1", "per2", "inflow", "outflow", "blade")


@cache
def tipped():
    """An annular sector of 40° with a blade from r 0.5 to 0.9375: its gap is 0.0625."""
    rules = _renamed(SHAPE, NAMES)
    rules[-1] = ("blade", rules[-1][1])
    return grid(SHAPE, [(0, 7), (3, 5), (3, 5)], place=ring(SHAPE, 0.5, 1.0, 40.0), rules=rules)


def case_of(**changes):
    return sv.Case(**{"roles": ROLES, "periodic_type": "rotational"} | changes)


def chord(radius, angle_deg):
    return 2.0 * radius * np.sin(np.radians(angle_deg) / 2.0)


def test_throat_and_tip_gap_of_a_block():
    throat, tip = sv.gaps(case_of(), tipped(), between=[])
    assert (throat.name, throat.along) == ("throat", "span")
    assert (tip.name, tip.along) == ("tip gap", "chord")
    # The block is 10° wide in a passage of 40°: at each radius 30° are left.
    assert throat.distance == pytest.approx(chord(0.5, 30.0), rel=1e-6)
    assert throat.place == pytest.approx(0.0, abs=1e-9)
    inside = PLACES < 0.86
    expected = chord(0.5 + 0.5 * PLACES[inside], 30.0)
    assert throat.distances[inside] == pytest.approx(expected, rel=1e-4)
    assert np.isnan(throat.distances[PLACES > 0.88]).all()
    # The casing's facets are chords of 5°, as the block's: they are parallel.
    assert tip.distance == pytest.approx(0.0625 * np.cos(np.radians(2.5)), rel=1e-6)
    assert tip.distances == pytest.approx(tip.distance, rel=1e-6)
    assert np.hypot(*tip.start[:2]) > np.hypot(*tip.end[:2])
    assert tip.words == "tip gap between blade and shroud"


def test_other_distances_and_no_period():
    mesh = tipped()
    *_, far = sv.gaps(case_of(), mesh, between=[("inflow", "blade")])
    assert far.words == "inflow to blade"
    assert far.distance == pytest.approx(3.0 / 8.0)
    alone = sv.gaps(case_of(roles={"blade": "moving"}), mesh)
    assert [gap.name for gap in alone] == ["tip gap"]
    # In 2D there is no span.
    [throat] = sv.gaps(case_of(roles=ROLES | {"BLOCK": "moving", "blade": "fixed"}), sector())
    assert throat.along == ""
    assert throat.summary()["place"] is None
    assert not len(throat.distances)


def test_a_deformed_mesh_has_the_period_of_its_reference():
    mesh = tipped()
    points = mesh.points.copy()
    points[mesh.marker("per2").nodes, 2] += 0.01
    moved = mesh.with_points(points)
    with pytest.raises(MeshError, match="do not match"):
        sv.gaps(case_of(), moved)
    throat, *_ = sv.gaps(case_of(), moved, reference=mesh)
    assert throat.distance == pytest.approx(chord(0.5, 30.0), rel=1e-6)


def test_wrong_cases_are_refused():
    mesh = tipped()
    with pytest.raises(CaseError, match="no boundary moves besides hub and shroud"):
        sv.gaps(case_of(roles={"shroud": "moving"}), mesh)
    with pytest.raises(CaseError, match=r"SPAN: .* has no marker 'nub'; did you mean hub"):
        sv.gaps(case_of(span=("nub", "shroud")), mesh)
    with pytest.raises(MeshError, match="no marker 'x'"):
        sv.gaps(case_of(), mesh, between=[("blade", "x")])


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sv.write("mesh.su2", tipped())
    motion = sv.Translate("blade", (0.0, 0.0, 0.05))
    case = case_of(mesh_file=tmp_path / "mesh.su2", motions=(motion,), sliding="ps")
    case.write(tmp_path / "case.cfg")
    return tmp_path


def test_the_command_reports_before_and_after(files, capsys):
    words = ["gap", "case.cfg", "-o", "gap.svg", "--between", "inflow,blade", "--json", "gap.json"]
    assert run(words) == 0
    out = capsys.readouterr().out
    assert "throat of blade\n  span" in out
    assert "inflow to blade" in out
    assert "+13.33 %" in out  # 0.375 + 0.05
    report = json.loads((files / "gap.json").read_text())
    assert [one["name"] for one in report["gaps"]] == ["throat", "tip gap", "inflow to blade"]
    far = report["gaps"][2]
    assert far["deformed"]["distance"] == pytest.approx(0.425, abs=1e-4)
    assert report["gaps"][0]["undeformed"]["distances"][-1] is None
    assert (files / "gap.svg").read_text().count("undeformed") >= 1


def test_boundaries_that_touch_are_said_to(files, capsys):
    words = ["gap", "case.cfg", "--between", "shroud,per1", "--between", "inflow,hub"]
    assert run([*words, "-o", "gap.svg", "--json", "gap.json"]) == 0
    out = capsys.readouterr().out
    assert "inflow to hub: they touch (distance 0)\n" in out
    assert "nan" not in out
    assert "they touch" in (files / "gap.svg").read_text()
    text = (files / "gap.json").read_text()
    touching = json.loads(text)["gaps"][-1]
    assert touching["undeformed"]["distance"] == touching["deformed"]["distance"] == 0.0
    assert "nan" not in text.lower()


def test_in_2d_there_are_no_tip_gaps_by_span(files, capsys):
    mesh = grid((8, 8), hole=((3, 5), (3, 5)))
    sv.write("plane.su2", mesh)
    case = sv.Case(mesh_file=files / "plane.su2", roles={"BLOCK": "moving"})
    case.write("plane.cfg")
    assert run(["gap", "plane.cfg"]) == 1
    said = capsys.readouterr().err
    assert "tip gaps by span are for 3D meshes" in said
    example = said.split()[-1]
    assert {*example.split(",")} < {*mesh.marker_names}
    assert run(["gap", "plane.cfg", "--between", example]) == 0
    capsys.readouterr()
    assert run(["gap", "plane.cfg", "--between", f"{mesh.marker_names[0]},BLOCK"]) == 0
    assert f"{mesh.marker_names[0]} to BLOCK\n" in capsys.readouterr().out
    assert run(["gap", "plane.cfg", "--between", "BLOCK,BLOCK"]) == 1
    assert "between: 'BLOCK' is given twice; name two boundaries" in capsys.readouterr().err


def test_the_command_without_motions_or_with_nothing_to_do(files, capsys):
    case = sv.Case.read("case.cfg")
    case.change(motions=()).write("still.cfg")
    assert run(["gap", "still.cfg"]) == 0
    assert "after" not in capsys.readouterr().out
    sv.write("full.su2", passage((2, 6, 6), 40.0))
    roles = {"blade": "moving"}
    case.change(mesh_file=files / "full.su2", motions=(), roles=roles).write("one.cfg")
    assert run(["gap", "one.cfg"]) == 1
    assert (
        "nothing to measure; name boundaries, e.g. --between blade,hub" in capsys.readouterr().err
    )
    assert run(["gap", "one.cfg", "--between", "blade"]) == 2
    assert "'blade': expected two boundaries, e.g. BLADE,HUB" in capsys.readouterr().err
    flat = sector()
    sv.write("flat.su2", flat)
    roles = {"BLOCK": "moving", "per1": "periodic", "per2": "periodic"}
    case.change(mesh_file=files / "flat.su2", motions=(), roles=roles).write("flat.cfg")
    assert run(["gap", "flat.cfg", "-o", "gap.png"]) == 1
    assert "in 2D each distance is one number, not a curve; leave out -o" in capsys.readouterr().err
    case.change(mesh_file=files / "bare.su2", motions=()).write("bare.cfg")
    bare = sv.read("mesh.su2")
    names = [replace(one, name=one.name.replace("hub", "inner")) for one in bare.markers]
    sv.write("bare.su2", replace(bare, markers=tuple(names), origin=Origin()))
    assert run(["gap", "bare.cfg", "-o", "gap.png"]) == 1
    assert "there are no curves over the span; set SPAN" in capsys.readouterr().err


def test_each_zone_has_the_gaps_that_it_has_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mesh = stage()
    names = [f"{zone}:{name}" for zone in (1, 2) for name in ("per1", "per2")]
    roles = dict.fromkeys(names, "periodic") | {"1:blade": "moving", "2:blade": "moving"}
    case = case_of(roles=roles, mesh_file=tmp_path / "stage.su2")
    between = [("2:inflow", "2:blade")]
    front, behind, far = sv.gaps(case, mesh, between=between)
    assert [one.words for one in (front, behind, far)] == [
        "zone 1: throat of 1:blade",
        "zone 2: throat of 2:blade",
        "zone 2: 2:inflow to 2:blade",
    ]
    for one, part in zip((front, behind), mesh.parts, strict=True):
        [alone] = sv.gaps(case_of(), part.mesh)
        assert one.distance == alone.distance
        assert np.array_equal(one.distances, alone.distances)
    figure = Figure(layout="constrained")
    draw_gaps(figure, [("undeformed", 4, (front, behind)), ("deformed", 0, (front, behind))])
    figure.draw_without_rendering()
    axes = figure.axes[0]
    below, above = (
        next(line for line in axes.lines if line.get_gid() == f"{name}, zone 2")
        for name in ("undeformed", "deformed")
    )
    assert below.get_linewidth() > 2.0 * above.get_linewidth(), "it is seen at the same places"
    assert axes.get_legend().get_window_extent().y0 >= axes.bbox.y1 - 1.0
    # One row only moves: the other has no blade.
    still = case.change(roles=roles | {"1:blade": "fixed"})
    assert [one.zone for one in sv.gaps(still, mesh)] == [2]
    assert [one.zone for one in sv.gaps(still, mesh, between=[("1:hub", "1:blade")])] == [1, 2]
    with pytest.raises(CaseError, match="1:hub and 2:hub belong to zones with different periods"):
        sv.gaps(case, mesh, between=[("1:hub", "2:hub")])
    with pytest.raises(CaseError, match="no boundary moves besides hub and shroud"):
        sv.gaps(case.change(roles={}), mesh)
    sv.write("stage.su2", mesh)
    moved = sv.Translate(("1:blade", "2:blade"), (0.0, 0.0, 0.02))
    case.change(motions=(moved,), periodic="none").write("stage.cfg")
    assert run(["gap", "stage.cfg", "-o", "gap.svg", "--json", "gap.json"]) == 0
    assert "zone 2: throat of 2:blade" in capsys.readouterr().out
    report = json.loads((tmp_path / "gap.json").read_text())
    assert [(one["zone"], one["name"]) for one in report["gaps"]] == [(1, "throat"), (2, "throat")]
    drawn = (tmp_path / "gap.svg").read_text()
    for words in ("undeformed, zone 1", "deformed, zone 2"):
        assert f'id="{words}"' in drawn
