"""``sv.wheel`` and ``slideviz wheel``: deformed passages in one file."""

import json

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.zones import join_zones
from tests.builders import passage, square

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
    with pytest.raises(CaseError, match="2 rows for 1 passages; one for each"):
        sv.wheel(tmp_path / "w.su2b", case, mesh, designs=table, passages=1)
    moving = case.change(periodic="fixed")
    with pytest.raises(MeshError, match="passages 1 and 2 do not meet"):
        sv.wheel(tmp_path / "w.su2b", moving, mesh, designs=table)


def test_cases_without_a_wheel_are_refused(tmp_path):
    path = tmp_path / "wheel.su2"
    with pytest.raises(CaseError, match="no periodic boundaries; passages are merged at these"):
        sv.wheel(path, sv.Case(), square(4))
    with pytest.raises(MeshError, match="has 2 zones, but a wheel is of one; choose it with ZONE="):
        sv.wheel(path, sv.Case(), join_zones([square(4), square(6)]))
    with pytest.raises(MeshError, match="do not match: with the best rotational"):
        sv.wheel(path, sv.Case(roles={"x_m": "periodic", "y_p": "periodic"}), square(4))
    with pytest.raises(CaseError, match=r"images by a translation \(.*\), so there is no wheel"):
        sv.wheel(path, sv.Case(roles={"x_m": "periodic", "x_p": "periodic"}), square(4))
    with pytest.raises(CaseError, match=r"35°, which is no whole part of a turn; give the number"):
        sv.wheel(path, case_of(motions=()), passage((2, 4, 4), 35.0))
    with pytest.raises(CaseError, match="0 passages; expected 1 or more, or all"):
        sv.wheel(path, case_of(motions=()), passage((2, 4, 4), 40.0), passages=0)
    with pytest.raises(CaseError, match="no MESH_FILENAME; give the mesh"):
        sv.wheel(path, case_of())
    assert not path.exists()


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
