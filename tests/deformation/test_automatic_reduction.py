"""DATA_REDUCTION= AUTO: exact for few boundary nodes, data reduction for many."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.reduction import AUTO, Reduction
from slideviz.deformation import reduction, setup
from slideviz.deformation.solver import Step
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample


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
    monkeypatch.setattr(reduction, "EXACT_NODES", count)
    assert setup.make_setup(passage.case, passage.mesh).reduction is None
    monkeypatch.setattr(reduction, "EXACT_NODES", count - 1)
    assert setup.make_setup(passage.case, passage.mesh).reduction is not None


def test_beyond_its_limit_it_follows_the_motion_to_a_thousandth(passage, monkeypatch):
    case, mesh = passage.case.change(steps=2), passage.mesh
    exact = _last(case.change(reduction=None), mesh)
    monkeypatch.setattr(reduction, "EXACT_NODES", 10)
    found = _last(case, mesh)
    prepared = setup.make_setup(case, mesh)
    largest = np.linalg.norm(prepared.target, axis=1).max()
    assert found.tolerance == pytest.approx(1e-3 * largest)
    assert found.max_error <= found.tolerance
    assert found.control_nodes < found.candidates
    # Prescribed displacements are exact all the same, and the cells nearly those of the exact one.
    known = prepared.known
    assert np.array_equal(found.mesh.points[known], exact.mesh.points[known])
    assert quality(found.mesh, mesh).min >= 0.97 * quality(exact.mesh, mesh).min


def test_a_motion_of_nothing_changes_no_bit(passage, monkeypatch):
    monkeypatch.setattr(reduction, "EXACT_NODES", 10)
    blade = passage.case.markers_with("moving")[0]
    still = passage.case.change(motions=(sv.Translate(blade, (0.0, 0.0)),))
    assert np.array_equal(_last(still, passage.mesh).mesh.points, passage.mesh.points)


def test_a_tolerance_that_it_does_not_use_is_remarked(passage):
    asked = passage.case.change(reduction=Reduction(auto=True, tolerance=1e-6))
    (remark,) = [w for w in _last(asked, passage.mesh).warnings if "DATA_RED_TOLERANCE" in w]
    assert remark == (
        "DATA_RED_TOLERANCE is without effect: DATA_REDUCTION= AUTO finds the tolerance, YES takes "
        "it"
    )


def test_a_relative_tolerance_is_a_length_of_the_step(passage):
    asked = passage.case.change(reduction=Reduction(relative=1e-3), steps=1)
    assert _last(asked, passage.mesh).tolerance == pytest.approx(1e-3 * passage.mesh.extent)
