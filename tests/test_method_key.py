"""METHOD as a key of the case: reading, what does not apply, the report, and all samples."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.cfg import set_key
from slideviz.case.check import effective, idle_settings
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate
from slideviz.cli import run
from slideviz.errors import CaseError, DeformError
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import SAMPLES, sample, write_sample
from slideviz.solver import deform as solver
from slideviz.solver.setup import stiffness_of
from slideviz.terms import METHODS
from tests import builders
from tests.slow import one_of_each_fast


def test_the_method_is_read_written_and_rbf_by_default(tmp_path):
    assert Case().method == "rbf"
    case = set_key(Case(), "METHOD", "elastic")
    assert case.method == "elastic"
    case = set_key(set_key(case, "IDW_POWER", "2.5"), "IDW_FIXED_WEIGHT", "3")
    case.write(tmp_path / "a.cfg")
    again = Case.read(tmp_path / "a.cfg")
    assert (again.method, again.idw_power, again.idw_fixed_weight) == ("elastic", 2.5, 3.0)
    with pytest.raises(CaseError, match="METHOD"):
        set_key(Case(), "METHOD", "spring")
    with pytest.raises(CaseError, match="above 0"):
        set_key(Case(), "IDW_POWER", "0")
    with pytest.raises(CaseError, match="above 1e-12"):
        set_key(Case(), "IDW_FIXED_WEIGHT", "-1")


def test_settings_that_the_method_does_not_use_are_told():
    assert idle_settings(Case()) == ()
    assert idle_settings(Case(sliding="ps", reduction=Reduction(), kernel="gaussian")) == ()
    assert idle_settings(Case(method="idw", sliding="ps", idw_power=2.0)) == ()
    assert idle_settings(Case(method="elastic", sliding="ds")) == ()
    case = Case(method="elastic", reduction=Reduction(), kernel="gaussian", influence_factor=1.0)
    assert tuple(map(str, idle_settings(case))) == (
        "METHOD= elastic does not use INFLUENCE_FACTOR, RBF_KERNEL, DATA_REDUCTION= YES",
    )
    assert tuple(map(str, idle_settings(Case(idw_power=2.0, idw_fixed_weight=2.0)))) == (
        "METHOD= rbf does not use IDW_POWER, IDW_FIXED_WEIGHT",
    )
    assert "acts like pseudo sliding" in str(idle_settings(Case(method="idw", sliding="ds"))[0])
    assert "acts like direct sliding" in str(idle_settings(Case(method="elastic", sliding="ps"))[0])


@pytest.mark.parametrize("method", ["idw", "elastic"])
@pytest.mark.parametrize("setting", [{"relax": "yes"}, {"layers": "keep"}])
def test_what_only_radial_functions_have_is_refused_of_other_methods(method, setting):
    mesh = builders.square(6)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 1.0),), method=method)
    (name,) = setting
    with pytest.raises(CaseError, match=rf"{name.upper()}= {setting[name].upper()} acts after"):
        list(sv.deform(case.change(**setting), mesh))
    assert KEYS[name.upper()].idle(case)  # so that the window shows that it is off
    assert not KEYS[name.upper()].idle(case.change(**setting))  # and lets users switch it off
    *_, left = sv.deform(case.change(relax="auto", layers="auto"), mesh)
    *_, plain = sv.deform(case, mesh)
    assert left.mesh.points.tobytes() == plain.mesh.points.tobytes()
    assert any("is not relaxed" in text for text in left.warnings)


def test_stiffness_of_su2_is_read_written_and_only_for_elasticity(tmp_path):
    case = set_key(Case(method="elastic"), "DEFORM_STIFFNESS_TYPE", "wall_distance")
    case = set_key(case, "DEFORM_COEFF", "1e6")
    case.write(tmp_path / "a.cfg")
    again = Case.read(tmp_path / "a.cfg")
    assert (again.deform_stiffness_type, again.deform_coeff) == ("SOLID_WALL_DISTANCE", 1e6)
    for text in ("0.5", "0.7", "1", "-0.1", "nan"):
        with pytest.raises(CaseError, match=r"below 0\.5, or above 1|not a number"):
            set_key(case, "DEFORM_COEFF", text)
    said = "METHOD= rbf does not use DEFORM_STIFFNESS_TYPE, DEFORM_COEFF"
    assert tuple(map(str, idle_settings(case.change(method="rbf")))) == (said,)
    assert idle_settings(case.change(sliding="ds")) == ()


def test_walls_are_moving_boundaries_and_fixed_ones_by_their_names():
    """Cells near these are the stiffer ones, not those near a far field."""
    mesh = builders.square(12)
    names = dict(zip(("x_m", "x_p", "y_m", "y_p"), ("Far", "OUTLET", "wall", "sym"), strict=True))
    markers = tuple(replace(m, name=names.get(m.name, m.name)) for m in mesh.markers)
    mesh = replace(mesh, markers=markers)
    case = Case(roles={"BLOCK": "moving"}, method="elastic")
    found = stiffness_of(case, mesh).walls
    nodes = np.concatenate([mesh.marker(name).nodes for name in ("BLOCK", "wall")])
    np.testing.assert_array_equal(found, np.unique(nodes))
    sliding = case.change(roles={"BLOCK": "moving", "wall": "sliding"})
    expected = np.unique(mesh.marker("BLOCK").nodes)
    np.testing.assert_array_equal(stiffness_of(sliding, mesh).walls, expected)


def test_settings_without_effect_are_told_and_change_no_result():
    made = sample("square", 6, "motion")
    given = made.case.change(curved=True, direction=1)
    direction, curved = map(str, idle_settings(given))
    assert curved.startswith("CURVED= YES has no effect")
    assert direction.startswith("PERIODIC_DIRECTION has no effect")
    assert effective(given) == effective(made.case) == made.case
    last, other = (list(sv.deform(case, made.mesh))[-1] for case in (given, made.case))
    assert last.mesh.points.tobytes() == other.mesh.points.tobytes()
    for key in ("CURVED", "PERIODIC_DIRECTION"):
        assert "no effect" in KEYS[key].meaning.lower()


def test_a_mesh_too_large_for_elasticity_is_refused_and_for_the_explicit_method_is_not(
    monkeypatch,
):
    mesh = builders.square(6)
    monkeypatch.setattr(solver, "free_memory", lambda: 1000.0)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 1.0),), method="elastic")
    with pytest.raises(DeformError, match=r"elasticity of 48 nodes needs .* METHOD= idw"):
        list(sv.deform(case, mesh))
    assert len(list(sv.deform(case.change(method="idw"), mesh))) == 1


@pytest.mark.parametrize("method", ["idw", "elastic"])
def test_automatic_steps_work_with_every_method(method):
    mesh = builders.square(8)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 20.0),), method=method, steps=0)
    *_, last = sv.deform(case, mesh)
    assert last.tried
    assert sv.quality(last.mesh, reference=mesh).inverted == 0


SIZES = {
    "square": 10,
    "polar": 10,
    "hexahedron": 6,
    "cylindrical": 6,
    "passage": 12,
    "turbine-row": 5_000,
    "turbine-row-3d": 10_000,
    "stator": 5_000,
    "impeller": 3_000,
    "wing": 2_000,
    "airfoil": 24,
}


@pytest.mark.parametrize(("name", "method"), one_of_each_fast(list(SAMPLES), list(METHODS)))
def test_every_sample_runs_with_every_method_and_reports_valid_json(tmp_path, name, method):
    write_sample(name, tmp_path / name, SIZES[name])
    report = tmp_path / "report.json"
    words = ["run", str(tmp_path / name / f"{name}.cfg"), "--quiet", "--json", str(report)]
    words += ["--set", f"METHOD={method}", "--set", "STEPS=1", "-o", str(tmp_path / "out.su2")]
    code = run(words)
    assert code in (0, 3)

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    found = json.loads(report.read_text(), parse_constant=refuse)
    assert found["method"] == method
    assert (found["condition"] == [None]) == (method != "rbf")
    assert found["control_nodes"][0] > 0
    assert found["convergence"] == [] or method == "rbf"
    if method != "rbf":
        counts = found["node_counts"]
        boundary = sum(counts[k] for k in counts if k != "internal")
        assert found["control_nodes"][0] <= boundary
        assert found["max_error"] < 1e-9
    assert np.isfinite(sv.read(tmp_path / "out.su2").points).all()


def test_the_terminal_names_the_method_and_what_may_help(tmp_path, capsys):
    write_sample("square", tmp_path, 10)
    words = ["run", str(tmp_path / "square.cfg"), "--set", "METHOD=idw", "--set", "STEPS=1"]
    run([*words, "-o", str(tmp_path / "out.su2")])
    told = capsys.readouterr()
    assert "1 step, method idw, sliding ps, periodic moving" in told.out
    assert "inverted" in told.err
    assert "METHOD= rbf" in told.err
