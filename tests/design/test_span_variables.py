"""Values of curves over span as design variables: derivatives, alone and through a deformer."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.design.sweeps.table import applied, columns_of
from slideviz.errors import CaseError
from slideviz.samples.table import sample

MOTIONS = (
    sv.SpanMotion("BLADE", "twist", (0.0, 0.4, 1.0), (1.0, 2.0, 5.0)),
    sv.SpanMotion("BLADE", "lean", (0.0, 0.5, 1.0), (0.001, 0.01, 0.03)),
    sv.SpanMotion("BLADE", "sweep", (0.0, 1.0), (0.01, 0.02)),
    sv.SpanMotion("BLADE", "chord", (0.0, 1.0), (1.01, 1.05)),
    sv.SpanMotion("BLADE", "camber", (0.0, 0.5, 1.0), (0.001, 0.01, 0.02)),
    sv.SpanMotion("BLADE", "stagger", (0.0,), (1.0,)),
)


@pytest.fixture(scope="module")
def impeller():
    return sample("impeller", 3000)


def errors_of_derivatives(design, rng):
    """Yield by how much derivatives of nodes (n,) are off; at last check those back and forth."""
    values = design.values * (1.0 + 0.1 * rng.normal(size=len(design.values)))
    for k in range(len(values)):
        direction = np.zeros(len(values))
        direction[k] = 1e-4 * max(abs(values[k]), 0.01)
        ahead, back = (design.displacement(values + sign * direction) for sign in (1.0, -1.0))
        exact = design.jvp(values, direction)
        yield np.abs(0.5 * (ahead - back) - exact).max(axis=1) / np.abs(exact).max()
    direction, weights = rng.normal(size=len(values)), rng.normal(size=exact.shape)
    forward = np.vdot(weights, design.jvp(values, direction))
    assert design.vjp(values, weights) @ direction == pytest.approx(forward, rel=1e-12)


def checked_gradient(design, deformer, weights, step):
    """Return the gradient through a deformer, compared with a difference along a step."""
    gradient = design.vjp(design.values, deformer.vjp(deformer.displacement, weights))
    ahead, back = (
        np.vdot(weights, deformer.deform(design.displacement(design.values + sign * step)))
        for sign in (1.0, -1.0)
    )
    assert gradient @ step == pytest.approx(0.5 * (ahead - back), rel=1e-6)
    return gradient


def test_derivatives_by_all_kinds_agree_with_differences_and_each_other(impeller):
    design = sv.SpanVariables(impeller.mesh, impeller.case.change(motions=MOTIONS))
    assert design.names[1] == "BLADE.twist.0.4"
    assert design.names[-1] == "BLADE.stagger.value"
    errors = errors_of_derivatives(design, np.random.default_rng(1))
    for name, wrong in zip(design.names, errors, strict=True):
        assert np.median(wrong) < 1e-9
        assert np.mean(wrong < 1e-6) > 0.97, name  # but where facets of walls meet


def test_the_gradient_goes_through_a_deformer(impeller):
    twist, lean = MOTIONS[:2]
    # Hub and shroud as inner nodes: the system of sliding ones has rounding errors of 1e-8 here.
    roles = {**impeller.case.roles, "HUB": "internal", "SHROUD": "internal"}
    case = impeller.case.change(
        roles=roles, motions=(twist, lean), steps=1, relax="no", layers="no"
    )
    design, deformer = sv.SpanVariables(impeller.mesh, case), sv.Deformer(impeller.mesh, case)
    assert np.array_equal(design.nodes, deformer.nodes)
    assert np.array_equal(design.displacement(design.values), deformer.displacement)
    weights = np.random.default_rng(2).normal(size=impeller.mesh.points.shape)
    step = 2e-4 * np.array([1.0, -1.0, 2.0, 0.01, 0.0, 0.02])
    checked_gradient(design, deformer, weights, step)


def test_the_case_has_the_values_and_other_motions_stay(impeller):
    turn = sv.Rotate("BLADE", 1.0, (0.0, 0.0, 0.0))
    case = impeller.case.change(motions=(turn, MOTIONS[0], MOTIONS[5]))
    design = sv.SpanVariables(impeller.mesh, case)
    changed = design.case_of(np.array([1.0, 2.0, 3.0, 4.0]))
    assert changed.motions[0] == turn
    assert changed.motions[1].values == (1.0, 2.0, 3.0)
    assert changed.motions[2].values == (4.0,)


def test_what_has_no_such_derivatives_is_refused(impeller):
    mesh, case = impeller.mesh, impeller.case
    with pytest.raises(CaseError, match="has no motion with derivatives; add one"):
        sv.SpanVariables(mesh, case.change(motions=(sv.Rotate("BLADE", 1.0),)))
    with pytest.raises(CaseError, match="motion 3 turns or scales nodes that motion 1 has moved"):
        sv.SpanVariables(mesh, case.change(motions=(*case.motions, sv.Rotate("BLADE", 1.0))))
    design = sv.SpanVariables(mesh, case)
    weights = np.ones((len(design.nodes), 3))
    for call in (
        lambda values: design.displacement(values),
        lambda values: design.jvp(values, design.values),
        lambda values: design.vjp(values, weights),
    ):
        with pytest.raises(CaseError, match=r"values has the shape \(2,\); expected \(5,\): a nu"):
            call(np.zeros(2))
        with pytest.raises(CaseError, match=r"values: BLADE.twist.0.5 is nan; expected a finite n"):
            call(np.array([0.0, np.nan, 0.0, 0.0, 0.0]))
    with pytest.raises(CaseError, match=r"direction has the shape \(3,\); expected \(5,\)"):
        design.jvp(design.values, np.zeros(3))
    for shape in ((5,), weights.shape[::-1], (2, *weights.shape), weights[:-1].shape):
        with pytest.raises(CaseError, match=r"weights has the shape .*; expected \(\d+, 3\), a r"):
            design.vjp(design.values, np.ones(shape))


def test_columns_of_a_sweep_are_points_of_curves(impeller):
    case = impeller.case.change(motions=MOTIONS)
    columns = columns_of(case, ("BLADE.twist.0.4", "motion2.1", "BLADE.stagger.value"))
    values = {"BLADE.twist.0.4": 9.0, "motion2.1": "8", "BLADE.stagger.value": 7}
    changed = applied(case, columns, values).motions
    assert changed[0].values == (1.0, 9.0, 5.0)
    assert changed[1].values == (0.001, 0.01, 8.0)
    assert changed[5].values == (7.0,)
    with pytest.raises(CaseError, match=r"BLADE.twist.0.5'.*did you mean BLADE.twist.0"):
        columns_of(case, ("BLADE.twist.0.5",))
