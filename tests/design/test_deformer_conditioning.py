"""Nearly singular systems: right to six digits against 50, or said, in runs and in deformers."""

from __future__ import annotations

import lzma
import re
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.design.deformer import warn_of_condition, warn_of_error_estimate
from slideviz.design.frozen_step import full_factor
from slideviz.errors import ConditionWarning, DeformError, ToleranceWarning, messages_of
from slideviz.rbf.evaluate import Basis
from slideviz.rbf.reduction import Reduction
from slideviz.rbf.refine import ROUNDING
from slideviz.samples.table import sample
from slideviz.solver.stepping import _doubt_warning, _dropped_warning
from tests import builders
from tests.oracles.digits import interpolated

SHARED = Path(__file__).parents[2] / ".." / "shared" / "meshes" / "design"


def thin(stretch=3.0, height=1.0):
    """A profile of 40 nodes in a far field of 40, thirty times as wide."""
    mesh = builders.airfoil(40, 3)
    off = mesh.points - [0.5, 0.0]
    far = np.maximum(np.linalg.norm(off, axis=1, keepdims=True) - 0.5, 0.0)
    return mesh.with_points([0.5, 0.0] + off * (1.0 + stretch * far**2) * [1.0, height])


def asked(*motions, **settings):
    """A case with the support radius that makes the system badly conditioned."""
    settings = {"influence_factor": 2.5, **settings}
    return Case(roles={"airfoil": "moving", "far": "fixed"}, motions=motions, **settings)


def errors(mesh, case, nodes, designs, found):
    """By how much points (k, n, d) are wrong, and by how much rounding alone makes them so.

    Both (k,), in parts of the largest displacements.
    """
    boundary = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    values = np.zeros((len(designs), *mesh.points.shape))
    values[:, nodes] = designs
    radius = case.influence_factor * np.ptp(mesh.points, axis=0).max()
    wide = np.concatenate(list(values[:, boundary]), axis=1)
    exact, weights = interpolated(mesh.points, mesh.points[boundary], wide, radius, case.kernel)
    exact = exact.reshape(len(mesh.points), len(designs), -1).swapaxes(0, 1)
    off = np.abs(found - mesh.points - exact).max(axis=(1, 2))
    rounding = ROUNDING * np.abs(weights).sum(axis=0).reshape(len(designs), -1).max(axis=1)
    largest = np.abs(designs).max(axis=(1, 2))
    return off / largest, rounding / largest


@pytest.mark.parametrize("motion", [Rotate("airfoil", 5.0), Scale("airfoil", (1.0, 1.5))])
def test_a_run_is_right_and_says_that_it_was_refined(motion):
    """Without refinement they are wrong by 0.7 % and 6 %, beside the profile."""
    mesh, case = thin(), asked(motion)
    *_, last = sv.deform(case, mesh)
    deformer = sv.Deformer(mesh, case)
    moved = last.mesh.points[None]
    off, rounding = errors(mesh, case, deformer.nodes, deformer.displacement[None], moved)
    assert off < rounding
    (note,) = [message for message in last.messages if "singular" in str(message)]
    assert note.level == "note"
    assert str(note).startswith("step 1: nothing is wrong: the system is nearly singular")
    assert "so it was refined with twice the digits" in str(note)
    assert np.abs(deformer.deform() - last.mesh.points).max() < 1e-7


def test_a_run_says_where_it_cannot_be_trusted():
    """Weights so large that their sum loses the digits, however right they are."""
    mesh, case = thin(height=0.1), asked(Scale("airfoil", (1.0, 1.5)))
    *_, last = sv.deform(case, mesh)
    with pytest.warns(ConditionWarning, match="condition number of the system is .* % of the"):
        deformer = sv.Deformer(mesh, case)
    moved = last.mesh.points[None]
    (off,), _ = errors(mesh, case, deformer.nodes, deformer.displacement[None], moved)
    (said,) = [text for text in last.warnings if "nearly singular" in text]
    assert "may be wrong by" in said
    assert "a less smooth RBF_KERNEL" in said
    percent = float(said.split("may be wrong by up to ")[1].split(" %")[0])
    assert 1e-6 < off < 0.01 * percent
    levels = [one.level for one in messages_of(last.messages) if str(one) == said]
    assert levels == ["note" if percent <= 0.1 else "warning"]
    rough = sv.deform(case.change(kernel="wendland-c0"), mesh)
    assert not any("singular" in text for text in [*rough][-1].warnings)


@pytest.mark.parametrize("kernel", ["gaussian", "thin-plate"])
def test_kernels_that_cannot_be_refined_are_measured_too(kernel):
    mesh = thin()
    case = asked(Scale("airfoil", (1.0, 1.5)), kernel=kernel, influence_factor=20.0)
    *_, last = sv.deform(case, mesh)
    told = [text for text in last.warnings if "may be wrong by" in text]
    assert bool(told) == (kernel == "gaussian")
    assert all("or more; how much more is unknown; use" in text for text in told)


@pytest.mark.parametrize(("error_estimate", "little"), [(5e-4, True), (2e-3, False)])
def test_a_small_error_is_a_note(error_estimate, little):
    step: Any = SimpleNamespace(condition=1e12, refined=0.0, error_estimate=error_estimate)
    with pytest.warns(ConditionWarning) as told:
        warn_of_condition([step])
    with pytest.warns(ConditionWarning) as more:
        warn_of_error_estimate([step], np.array(error_estimate))
    said = [each.message.args[0] for each in (*told, *more)] + _doubt_warning(
        error_estimate, 0.0, 1, 1e12, "use less"
    )
    assert [each.level == "note" for each in messages_of(said)] == [little] * 3


@pytest.mark.parametrize(("count", "total"), [(1, 1), (2, 1), (1, 2)])
def test_nodes_without_control_are_counted(count, total):
    solution: Any = SimpleNamespace(dropped=np.arange(count), dropped_error=1.0)
    setup: Any = SimpleNamespace(basis=Basis(1.0))
    (said,) = _dropped_warning(setup, solution, 1, total, thin())
    assert said.startswith("from step 1 on, ") == (total > 1)
    assert ("boundary node 0 at" in said) == (count == 1)
    assert (
        "2 boundary nodes are left out of the control nodes because they nearly coincide with "
        "others (first: " in said
    ) == (count == 2)


@pytest.mark.parametrize("at_rest", [False, True], ids=["motion", "rest"])
def test_a_deformer_is_right_for_designs_that_its_reference_does_not_know(at_rest):
    mesh, case = thin(), asked(Rotate("airfoil", 5.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ConditionWarning)
        deformer = sv.Deformer(mesh, case)
        if at_rest:
            deformer = sv.Deformer(mesh, case, np.zeros_like(deformer.displacement))
    (note,) = deformer.messages
    assert note.level == "note"
    assert "designs would be wrong by up to" in str(note)
    x = mesh.points[deformer.nodes]
    bump = 0.02 * np.sin(np.pi * np.clip(x, 0.0, 1.0)) ** 3 * [0.0, 1.0]
    designs = np.stack([deformer.displacement, bump, 0.01 + 0.0 * x])
    with warnings.catch_warnings():
        warnings.simplefilter("error", ConditionWarning)
        found = deformer.deform(designs)
        one = deformer.deform(bump)
        again = deformer.deform(bump * (1.0 + 1e-13))
    off, rounding = errors(mesh, case, deformer.nodes, designs, found)
    assert (off < rounding).all()
    assert (rounding < 5e-6).all()  # without refinement they are wrong by 7e-3
    assert np.abs(one - found[1]).max() < 1e-8
    assert np.abs(one - again).max() < 1e-8  # noise: 1e-6 with residuals that are rounded
    # Derivatives are refined too, forward and in reverse alike.
    change = deformer.jvp(designs[0], bump)
    off, rounding = errors(mesh, case, deformer.nodes, bump[None], change[None] + mesh.points)
    assert off < rounding
    weights = np.random.default_rng(0).standard_normal(change.shape)
    back = (deformer.vjp(designs[0], weights) * bump).sum()
    assert back == pytest.approx((weights * change).sum(), rel=1e-5)


def test_a_design_that_cannot_be_trusted_is_told():
    mesh, case = thin(), asked(Translate("airfoil", (0.01, 0.0)))
    deformer = sv.Deformer(mesh, case)
    designs = np.zeros((2, *deformer.displacement.shape))
    designs[1, 0, 1] = 0.01  # the trailing edge alone
    with pytest.warns(ConditionWarning, match="displacements of 1 design between the"):
        deformer.deform(designs)


def test_well_conditioned_systems_keep_every_bit(monkeypatch):
    mesh, case = builders.airfoil(40, 3), asked(Rotate("airfoil", 5.0))
    *_, last = sv.deform(case, mesh)
    assert last.warnings == ()
    monkeypatch.setattr("slideviz.rbf.exact.System.field_error", lambda *_: np.zeros(1))
    *_, same = sv.deform(case, mesh)
    assert last.mesh.points.tobytes() == same.mesh.points.tobytes()
    assert last.mesh.points.tobytes() == sv.Deformer(mesh, case).deform().tobytes()


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the shared meshes")
@pytest.mark.parametrize("kernel", ["wendland-c2", "wendland-c4"])
def test_gradients_count_the_nodes_that_the_guard_left_out(tmp_path, kernel):
    """Their weights hardly show in a field, but are the gradient: it was wrong by 0.9 %."""
    name = "naca0012_inv.su2"
    (tmp_path / name).write_bytes(lzma.decompress((SHARED / f"{name}.xz").read_bytes()))
    mesh = sv.read(tmp_path / name)
    case = asked(Translate("airfoil", (0.0, 0.05)), reduction=None, kernel=kernel)
    case = case.change(roles={"airfoil": "moving", "farfield": "fixed"})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConditionWarning)
        deformer = sv.Deformer(mesh, case)
    at, weights = deformer.displacement, np.cos(3.0 * mesh.points)
    x, y = mesh.points[deformer.nodes].T
    thicker = np.column_stack([0.0 * x, (1.0 + x) * y])
    with pytest.warns(
        ConditionWarning, match="gradients with respect to nodes that nearly"
    ) as all_:
        gradient = deformer.vjp(at, weights)
    if kernel == "wendland-c4":
        return
    # Rounding of the weights alone changes the gradient by so much at nodes that nearly coincide.
    percent = float(str(all_[0].message).split("wrong by up to ")[1].split(" %")[0])
    noise = 1.0 + 2e-16 * np.random.default_rng(0).standard_normal(weights.shape)
    with pytest.warns(ConditionWarning, match="gradients"):
        again = deformer.vjp(at, weights * noise)
    off = np.abs(again - gradient).max() / np.abs(gradient).max()
    # How far depends on the rounding of the BLAS of this machine.
    assert 2e-4 * percent < off < 1e-2 * percent
    change = (weights * deformer.jvp(at, thicker)).sum()
    assert (gradient * thicker).sum() == pytest.approx(change, rel=1e-4)


@pytest.mark.filterwarnings("ignore:the condition number:slideviz.errors.ConditionWarning")
def test_a_deformer_at_its_own_reference_does_not_blame_another_displacement():
    """Nodes that the pivot guard leaves out are off by more than a thousandth of the motion."""
    mesh = builders.cube(6, "prism")
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    motion = Translate("BLOCK", (0.04, -0.03, 0.015))
    case = Case(roles=roles, motions=(motion,), sliding="ds", kernel="gaussian")
    with pytest.warns(ConditionWarning, match="of the largest or more; how much more is unknown"):
        deformer = sv.Deformer(mesh, case.change(reduction=None, influence_factor=2.5))
    with pytest.warns(ToleranceWarning, match="nodes slide on chosen for this displacement; use"):
        deformer.deform()
    with pytest.warns(ToleranceWarning, match="belong to another displacement; renew"):
        deformer.deform(1.01 * deformer.displacement)
    both = np.stack([0.5 * deformer.displacement, deformer.displacement])
    with pytest.warns(ToleranceWarning, match=r"of 2 designs .* nodes slide on chosen for this"):
        deformer.deform(both)


def test_what_is_measured_at_a_reference_is_no_bound_for_single_nodes():
    made = sample("airfoil")
    with pytest.warns(
        ConditionWarning, match="single nodes, .* or more; how much more is unknown"
    ) as told:
        deformer = sv.Deformer(made.mesh, made.case.change(kernel="wendland-c6"))
    alone = np.zeros_like(deformer.displacement)
    alone[0, 1] = 1.0
    with pytest.warns(ConditionWarning, match="derivative is nearly singular") as more:
        deformer.jvp(deformer.displacement, alone)
    few, many = (re.search(r"wrong by (?:up to )?(\S+) %", str(w[0].message)) for w in (told, more))
    assert float(many[1]) > 100.0 * float(few[1])


@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-9)], ids=["exact", "reduced"])
def test_a_derivative_that_cannot_be_trusted_is_told(reduction):
    mesh, case = thin(), asked(Rotate("airfoil", 5.0))
    deformer = sv.Deformer(mesh, case.change(reduction=reduction))
    alone = np.zeros_like(deformer.displacement)
    alone[0, 1] = 1.0
    with pytest.warns(ConditionWarning, match="system of the derivative is nearly singular: betw"):
        deformer.jvp(deformer.displacement, alone)


def test_designs_with_data_reduction_get_no_warning_of_rounding():
    """Their system is nearly singular, but a tolerance is larger than its rounding."""
    made = sample("square", 20, "motion")
    reduction = Reduction(relative=1e-9)
    settings = {"sliding": "none", "periodic": "none", "steps": 1, "reduction": reduction}
    case = made.case.change(kernel="wendland-c2", influence_factor=2000.0, **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ConditionWarning)
        warnings.simplefilter("ignore", ToleranceWarning)
        sv.Deformer(made.mesh, case).deform()


def test_a_singular_system_of_a_design_is_refused():
    with pytest.raises(DeformError, match=r"system of the 2 control rows is singular at this des"):
        full_factor(np.ones((2, 2)))
