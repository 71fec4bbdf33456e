"""``sv.wheel`` and ``slideviz wheel``: deformed passages in one file."""

import json
import re

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.zones import join_zones
from tests.builders import passage, sector, square, stage

SIDES = {"per1": "periodic", "per2": "periodic"}
MOVED = sv.Rotate("blade", 4.0, (0.75, 0.2, 0.5), (1.0, 0.3, 0.0))


def case_of(**changes):
    roles = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    settings = {"roles": roles, "motions": (MOVED,), "periodic_type": "rotational"}
    return sv.Case(**settings | changes)


def test_the_wheel_has_the_deformed_passage_in_each_copy(tmp_path):
    mesh, case = passage((2, 6, 6), 40.0), case_of(periodic="moving", sliding="ps")
    made = sv.wheel(tmp_path / "wheel.su2", case, mesh)
    *_, last = sv.deform(case, mesh)
    quality = sv.quality(last.mesh, mesh)
    whole = sv.read(made.path)
    assert (made.passages, made.is_closed, made.period) == (9, True, pytest.approx(40.0))
    assert (made.cells, made.points) == (len(whole.cells), len(whole.points))
    assert (made.min, made.inverted) == (quality.min, 0)
    assert made.mean == pytest.approx(quality.mean, rel=1e-14)
    assert made.boundaries == whole.marker_names
    assert made.gap < 1e-14
    # What was deformed is there: its first passage has the bits of the run.
    nodes = last.mesh.marker("blade").nodes
    blade = whole.points[whole.marker("blade").nodes]
    apart = np.linalg.norm(blade[:, None] - last.mesh.points[nodes], axis=2).min(axis=0)
    assert apart.max() == 0.0


def test_a_table_gives_passages_motions_of_their_own(tmp_path):
    mesh = passage((2, 6, 6), 40.0)
    case = case_of(periodic="none", motions=(sv.Translate("blade", (0.0, 0.0, 0.0)),))
    table = [{"blade.translate.z": 0.01}, {"blade.translate.z": 0.02}]
    made = sv.wheel(tmp_path / "w.su2b", case, mesh, numbered=True, designs=table, passages=4)
    whole, mean = sv.read(made.path), mesh.points[mesh.marker("blade").nodes, 2].mean()
    shifts = [whole.points[whole.marker(f"blade_{k}").nodes, 2].mean() - mean for k in range(1, 5)]
    assert shifts == pytest.approx([0.01, 0.02, 0.0, 0.0], abs=1e-12)
    with pytest.raises(CaseError, match="2 rows for 1 passages; give at most one row for each"):
        sv.wheel(tmp_path / "w.su2b", case, mesh, designs=table, passages=1)
    moving = case.change(periodic="fixed")
    with pytest.raises(MeshError, match="passages 1 and 2 do not meet"):
        sv.wheel(tmp_path / "w.su2b", moving, mesh, designs=table)


def test_cases_without_a_wheel_are_refused(tmp_path):
    path = tmp_path / "wheel.su2"
    with pytest.raises(CaseError, match="no periodic boundaries; passages are merged at these"):
        sv.wheel(path, sv.Case(), square(4))
    with pytest.raises(CaseError, match="zone 1: the case has no periodic boundaries"):
        sv.wheel(path, sv.Case(), join_zones([square(4), square(6)]))
    with pytest.raises(MeshError, match="do not match: with the best rotational"):
        sv.wheel(path, sv.Case(roles={"x_m": "periodic", "y_p": "periodic"}), square(4))
    with pytest.raises(CaseError, match=r"images by a translation \(.*\), so there is no wheel"):
        sv.wheel(path, sv.Case(roles={"x_m": "periodic", "x_p": "periodic"}), square(4))
    with pytest.raises(CaseError, match=r"35°, and 360° is not a multiple of it; give the number"):
        sv.wheel(path, case_of(motions=()), passage((2, 4, 4), 35.0))
    with pytest.raises(CaseError, match="0 passages; expected 1 or more, or all"):
        sv.wheel(path, case_of(motions=()), passage((2, 4, 4), 40.0), passages=0)
    with pytest.raises(CaseError, match=r"1000000000 passages of 40° are more .*; use 9 or fewer"):
        sv.wheel(path, case_of(motions=()), passage((2, 4, 4), 40.0), passages=1_000_000_000)
    with pytest.raises(CaseError, match="no MESH_FILENAME; give the mesh"):
        sv.wheel(path, case_of())
    assert not path.exists()


@pytest.mark.parametrize("mesh", [passage((4, 6, 4), 180.0), sector(8, 180.0)])
def test_sides_that_match_by_a_shift_and_by_a_turn_are_one_of_both(tmp_path, mesh):
    both = r"translation \(1\.5 along .* rotation \(180° about z\)"
    case = case_of(periodic_type="auto", periodic="fixed", motions=())
    moved = next(name for name in ("blade", "BLOCK") if name in mesh.marker_names)
    shift = sv.Translate(moved, (0.0, 0.01, 0.0)[: mesh.dim])
    case = case.change(roles={**SIDES, moved: "moving"}, motions=(shift,))
    note = f"per1 and per2 match by a {both}; PERIODIC_TYPE= AUTO takes the translation: write"
    for kind, count in (("auto", 1), ("translational", 0), ("rotational", 0)):
        *_, step = sv.deform(case.change(periodic_type=kind), mesh)
        assert sum(bool(re.match(note, text)) for text in step.warnings) == count
    for kind in ("auto", "translational"):
        one = case.change(periodic_type=kind)
        with pytest.raises(CaseError, match=rf"{both}, and PERIODIC_TYPE= {kind.upper()} takes"):
            sv.wheel(tmp_path / "wheel.su2", one, mesh)
    made = sv.wheel(tmp_path / "wheel.su2", case.change(periodic_type="rotational"), mesh)
    assert (made.passages, made.is_closed) == (2, True)


def test_the_command_writes_and_reports_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sv.write("mesh.su2", passage((2, 4, 4), 40.0))
    lines = ["MESH_FILENAME= mesh.su2", "MARKER_PERIODIC= ( per1, per2 )"]
    (tmp_path / "a.cfg").write_text("\n".join([*lines, "PERIODIC_TYPE= rotational"]))
    assert run(["wheel", "a.cfg", "-o", "wheel.su2"]) == 0
    assert "wheel.su2: 9 passages of 40°, a whole turn" in capsys.readouterr().out
    assert run(["wheel", "a.cfg", "-o", "b.su2", "--passages", "2", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["passages"], report["is_closed"]) == (2, False)
    assert {"per1", "per2"} <= set(report["boundaries"])
    assert run(["wheel", "a.cfg", "-o", "mesh.su2"]) == 1  # its own input
    limited = ["wheel", "a.cfg", "-o", "c.su2", "--set", "LIMITS=( aspect_ratio < 1.001 )"]
    assert run(limited) == 4
    assert "the limit aspect_ratio < 1.001 is not met" in capsys.readouterr().err


def test_it_has_the_warnings_of_its_runs(tmp_path):
    mesh = passage((2, 6, 6), 40.0)
    reduction = sv.Reduction(tolerance=0.1)
    case = case_of(periodic="moving", sliding="ps", reduction=reduction)
    *_, last = sv.deform(case, mesh)
    made = sv.wheel(tmp_path / "wheel.su2", case, mesh)
    assert last.warnings
    assert set(made.warnings) == set(last.warnings)


def stage_case(**changes):
    roles = {f"{zone}:{name}": "periodic" for zone in (1, 2) for name in ("per1", "per2")}
    roles |= {"1:blade": "moving", "2:blade": "moving"}
    motion = sv.Translate(("1:blade", "2:blade"), (0.0, 0.0, 0.0))
    return case_of(**{"roles": roles, "motions": (motion,), "periodic": "none"} | changes)


@pytest.mark.parametrize("ending", [".su2", ".su2b"])
def test_each_zone_has_a_wheel_with_its_own_period_as_it_has_alone(tmp_path, ending):
    mesh, case = stage(), stage_case(motions=(sv.Translate("1:blade", (0.01, 0.0, 0.0)),))
    case = case.change(roles=case.roles | {"2:blade": "fixed"})
    made = sv.wheel(tmp_path / f"stage{ending}", case, mesh)
    assert [(zone.passages, zone.period) for zone in made.zones] == [
        (9, pytest.approx(40.0)),
        (12, pytest.approx(30.0)),
    ]
    assert (made.passages, made.period, made.is_closed) == (21, None, True)
    whole = sv.read(made.path)
    assert (whole.zones, len(whole.cells), len(whole.points)) == (2, made.cells, made.points)
    assert whole.marker_names == made.boundaries
    assert "2:blade" in made.boundaries
    *_, last = sv.deform(case, mesh)
    assert made.min == sv.quality(last.mesh, mesh).min
    for number, roles in enumerate(({"blade": "moving"}, {}), 1):
        sides = {"per1": "periodic", "per2": "periodic"}
        moved = (sv.Translate("blade", (0.01, 0.0, 0.0)),) if roles else ()
        one = case_of(roles=roles | sides, motions=moved, periodic="none")
        alone = mesh.parts[number - 1].mesh
        path = sv.wheel(tmp_path / f"alone{ending}", one, alone).path
        there, here = sv.read(path), sv.read(made.path, zone=number)
        assert np.array_equal(there.points, here.points)
        assert there.cells.same_as(here.cells)
        assert there.marker_names == here.marker_names
        path.unlink()


def test_zones_have_numbers_of_passages_and_rows_of_a_table_of_their_own(tmp_path):
    mesh, case, path = stage(), stage_case(), tmp_path / "stage.su2"
    made = sv.wheel(path, case, mesh, passages=[2, "all"], numbered=True)
    assert [zone.passages for zone in made.zones] == [2, 12]
    assert {"1:per1", "2:per1"} & set(made.boundaries) == set()
    assert {"per1", "1:blade_2", "blade_12"} <= set(made.boundaries)
    with pytest.raises(CaseError, match="3 numbers of passages for 2 zones; give one for all"):
        sv.wheel(path, case, mesh, passages=[1, 2, 3])
    with pytest.raises(CaseError, match=r"zone 1: .*10 passages of 40° are more than a turn"):
        sv.wheel(path, case, mesh, passages=10)
    motions = tuple(sv.Translate(f"{zone}:blade", (0.0, 0.0, 0.0)) for zone in (1, 2))
    case = case.change(motions=motions)
    rows = [{"1:blade.translate.z": 0.0, "2:blade.translate.z": 0.01 * k} for k in range(3)]
    made = sv.wheel(path, case, mesh, designs=rows, passages=[2, 3], numbered=True)
    whole = sv.read(path)
    shifts = [whole.points[whole.marker(name).nodes, 2].mean() for name in ("2:blade_1", "blade_3")]
    assert shifts[1] - shifts[0] == pytest.approx(0.02)
    rows[2]["1:blade.translate.z"] = 0.01
    with pytest.raises(CaseError, match="row 3 of the table moves zone 1, which has 2 passages"):
        sv.wheel(path, case, mesh, designs=rows, passages=[2, 3])


def test_the_command_reports_each_zone(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sv.write("stage.su2", stage())
    stage_case(mesh_file=tmp_path / "stage.su2", motions=()).write("stage.cfg")
    assert run(["wheel", "stage.cfg", "-o", "w.su2", "--passages", "2,all"]) == 0
    said = capsys.readouterr().out
    assert "zone 1: 2 passages of 40°, 80°" in said
    assert "zone 2: 12 passages of 30°, a whole turn" in said
    assert run(["wheel", "stage.cfg", "-o", "w.su2", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [zone["passages"] for zone in report["zones"]] == [9, 12]
    assert report["period"] is None
