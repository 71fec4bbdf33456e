"""DATA_REDUCTION= AUTO: exact for few boundary nodes, data reduction for many."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh.quality import quality
from slideviz.rbf.reduction import AUTO, Reduction
from slideviz.samples.table import sample
from slideviz.session.run_messages import remedy_for
from slideviz.session.state import Run, StepFrame
from slideviz.solver import setup
from slideviz.solver.deform import Step
from slideviz.solver.prepare import prepare
from slideviz.streaming.run import stream
from tests import builders
from tests.advice import advice_for


@pytest.fixture(scope="module")
def passage():
    return sample("passage", 24)


def _last(case: sv.Case, mesh: sv.Mesh) -> Step:
    *_, last = sv.deform(case, mesh)
    return last


def test_up_to_its_limit_it_is_the_exact_method_to_the_bit(passage):
    exact = _last(passage.case.change(reduction=None, steps=2), passage.mesh)
    found = _last(passage.case.change(reduction=AUTO, steps=2), passage.mesh)
    assert np.array_equal(found.mesh.points, exact.mesh.points)
    assert found.tolerance is None
    assert found.candidates == found.control_nodes == exact.candidates


def test_the_limit_counts_periodic_images_once(passage, monkeypatch):
    count = _last(passage.case.change(steps=1), passage.mesh).candidates
    monkeypatch.setattr(setup, "EXACT_NODES", count)
    assert setup.make_setup(prepare(passage.case, passage.mesh)).reduction is None
    monkeypatch.setattr(setup, "EXACT_NODES", count - 1)
    assert setup.make_setup(prepare(passage.case, passage.mesh)).reduction is not None


def test_beyond_its_limit_it_follows_the_motion_to_a_thousandth(passage, monkeypatch):
    case, mesh = passage.case.change(steps=2), passage.mesh
    exact = _last(case.change(reduction=None), mesh)
    monkeypatch.setattr(setup, "EXACT_NODES", 10)
    found = _last(case, mesh)
    prepared = setup.make_setup(prepare(case, mesh))
    largest = np.linalg.norm(prepared.target, axis=1).max()
    assert found.tolerance == pytest.approx(1e-3 * largest)
    assert found.max_error <= found.tolerance
    assert found.control_nodes < found.candidates
    # Prescribed displacements are exact all the same, and the cells nearly those of the exact one.
    known = prepared.known
    assert np.array_equal(found.mesh.points[known], exact.mesh.points[known])
    assert quality(found.mesh, mesh).min >= 0.97 * quality(exact.mesh, mesh).min


def test_a_motion_of_nothing_changes_no_bit(passage, monkeypatch):
    monkeypatch.setattr(setup, "EXACT_NODES", 10)
    blade = passage.case.markers_with("moving")[0]
    still = passage.case.change(motions=(sv.Translate(blade, (0.0, 0.0)),))
    assert np.array_equal(_last(still, passage.mesh).mesh.points, passage.mesh.points)


def test_a_tolerance_that_it_does_not_use_is_remarked(passage):
    asked = passage.case.change(reduction=Reduction(auto=True, tolerance=1e-6))
    (remark,) = [w for w in _last(asked, passage.mesh).warnings if "DATA_RED_TOLERANCE" in w]
    assert remark == (
        "DATA_RED_TOLERANCE has no effect: DATA_REDUCTION= AUTO finds the tolerance; YES uses "
        "this one"
    )


def test_a_relative_tolerance_is_a_length_of_the_step(passage):
    asked = passage.case.change(reduction=Reduction(relative=1e-3), steps=1)
    assert _last(asked, passage.mesh).tolerance == pytest.approx(1e-3 * passage.mesh.extent)


def _layers(monkeypatch):
    """A cylinder that changes its shape between sliding walls, with layers of 1e-6."""
    monkeypatch.setattr(setup, "EXACT_NODES", 10)
    roles = {"wall": "moving", "far": "fixed", "hub": "sliding", "shroud": "sliding"}
    motions = sv.Scale("wall", (1.1, 0.95, 1.0)), sv.Translate("wall", (0.1, 0.0, 0.0))
    return builders.layered_cylinder(), sv.Case(roles=roles, motions=motions, sliding="ps")


@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_it_stays_below_half_of_the_first_layer_beside_sliding_walls(monkeypatch, sliding):
    mesh, case = _layers(monkeypatch)
    found = _last(case.change(sliding=sliding), mesh)
    assert found.tolerance == pytest.approx(0.5e-6)
    assert (found.layers, quality(found.mesh, mesh).inverted) == (0.0, 0)
    assert quality(found.mesh, mesh).min > 0.85
    # A thousandth of the motion, as AUTO without layers, is two hundred layers.
    loose = case.change(sliding=sliding, reduction=Reduction(tolerance=2e-4))
    bad = _last(loose, mesh)
    assert bad.layers == pytest.approx(0.5e-6)
    assert not any("is too thin for" in text for text in bad.warnings)
    state = quality(bad.mesh, mesh)
    assert state.inverted > 0
    keys = "what may help: DATA_RED_TOLERANCE= 5e-07, half of the smallest distance"
    assert advice_for(loose, bad, mesh, state).startswith(keys)
    relative = loose.change(reduction=Reduction(relative=1e-4))
    keys = "DATA_RED_TOLERANCE= 5e-07 instead of DATA_RED_RELATIVE, half of"
    assert keys in advice_for(relative, bad)
    shown = remedy_for(Run(1, loose, (StepFrame(bad.mesh, state, bad),), "done"), mesh)
    assert "What may help: a data reduction with the tolerance 5e-07, half of" in shown


def test_layers_that_it_cannot_follow_are_told(monkeypatch):
    mesh, case = _layers(monkeypatch)
    monkeypatch.setattr(setup, "SMALLEST", 1e-3)
    found = _last(case, mesh)
    (said,) = [text for text in found.warnings if "is too thin for" in text]
    assert said.startswith("the layer between moving and sliding nodes (1e-06) is too thin for")
    assert said.endswith("use DATA_REDUCTION= NO, or YES with DATA_RED_TOLERANCE= 5e-07")
    assert "YES with DATA_RED_TOLERANCE= 5e-07" in advice_for(case, found)


def test_a_fixed_wall_beside_layers_changes_no_tolerance(monkeypatch):
    mesh, case = _layers(monkeypatch)
    roles = case.roles | {"hub": "fixed", "shroud": "fixed"}
    assert setup.make_setup(prepare(case.change(roles=roles), mesh)).reduction.tolerance > 9e-5


def test_a_streamed_run_stays_below_half_of_the_first_layer_too(tmp_path, monkeypatch):
    mesh, case = _layers(monkeypatch)
    sv.write(tmp_path / "mesh.su2b", mesh)
    case = case.change(mesh_file=tmp_path / "mesh.su2b")
    last = _last(case, mesh)
    done = stream(case, tmp_path / "out.su2b")
    assert done.steps[-1].tolerance == last.tolerance < 1e-6
    assert sv.read(tmp_path / "out.su2b").points.tobytes() == last.mesh.points.tobytes()
