"""Derivatives where a boundary is laid onto a target: those of a displacement file."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.moving_nodes import displacements
from slideviz.samples.table import sample
from tests.builders import airfoil
from tests.machine.test_onto import blade, reshaped, stator_onto, write_target


def check_parameter(case_at, mesh, agree=1e-6):
    """The derivative by a parameter, about 1: by a deformer's jvp and vjp, and by differences."""
    case, step = case_at(1.0), 1e-3
    deformer = sv.Deformer(mesh, case)
    ahead, behind = (displacements(case_at(1.0 + s), mesh).vectors for s in (step, -step))
    direction = (ahead - behind) / (2 * step)
    assert np.abs(direction).max() > 1e-3
    forward = deformer.jvp(deformer.displacement, direction)
    change = (deformer.deform(ahead) - deformer.deform(behind)) / (2 * step)
    np.testing.assert_allclose(forward, change, rtol=0, atol=agree * np.abs(change).max())
    weights = np.random.default_rng(3).standard_normal(mesh.points.shape)
    reverse = deformer.vjp(deformer.displacement, weights)
    size = np.abs(weights * forward).sum()
    assert abs((weights * forward).sum() - (reverse * direction).sum()) <= 1e-12 * size
    return deformer, direction


@pytest.mark.parametrize("after", [False, True])
def test_a_motion_onto_a_target_counts_as_a_displacement_file(after, tmp_path):
    mesh = airfoil(40)
    sv.write(tmp_path / "high.su2", mesh.with_points(mesh.points + np.array([0.02, 0.1])))
    onto = sv.Onto(tmp_path / "high.su2", "airfoil")

    def case_at(parameter, first=onto):
        other = sv.Rotate("airfoil", 5.0 * parameter, (0.3, 0.0)) if after else None
        other = other or sv.Translate("far", (0.1 * parameter, 0.05))
        roles = {"airfoil": "moving", "far": "fixed" if after else "moving"}
        return sv.Case(
            roles=roles, motions=(first, other), kernel="wendland-c0", steps=2, relax="no"
        )

    deformer, direction = check_parameter(case_at, mesh)
    # What is turned is the place after the motion onto the target.
    nodes = mesh.marker("airfoil").nodes
    rows = np.searchsorted(deformer.nodes, nodes)
    laid = displacements(case_at(0.0), mesh).vectors[rows]
    arm = mesh.points[nodes] + laid - [0.3, 0.0]
    turn = np.radians(5.0)
    c, s = np.cos(turn), np.sin(turn)
    slope = turn * arm @ np.array([[-s, c], [-c, -s]])
    np.testing.assert_allclose(direction[rows], slope if after else 0.0, rtol=0, atol=1e-9)
    # A displacement file with the same displacements gives the same derivatives.
    listed = "\n".join(f"{n} {x!r} {y!r}" for n, (x, y) in zip(nodes, laid.tolist(), strict=True))
    (tmp_path / "d.txt").write_text(listed)
    twin = sv.Deformer(mesh, case_at(1.0, sv.FromFile(tmp_path / "d.txt", "airfoil")))
    forward, other = (d.jvp(deformer.displacement, direction) for d in (deformer, twin))
    np.testing.assert_allclose(forward, other, rtol=0, atol=1e-12 * np.abs(other).max())


@pytest.mark.filterwarnings("ignore::slideviz.errors.ToleranceWarning")
def test_variables_over_span_add_to_a_motion_onto_a_target(tmp_path):
    mesh = sample("stator", 5000).mesh
    nodes, quads = blade(mesh)
    write_target(tmp_path / "target.stl", reshaped(mesh.points[nodes]), quads)
    case = stator_onto(tmp_path / "target.stl")
    lean = sv.SpanMotion("BLADE", "lean", (0.0, 1.0), (0.001, 0.002))
    plain = {"kernel": "wendland-c0", "relax": "no", "layers": "no", "repair": "no"}
    case = case.change(motions=(*case.motions, lean), steps=1, **plain)
    design, deformer = sv.SpanVariables(mesh, case), sv.Deformer(mesh, case)
    laid = displacements(stator_onto(tmp_path / "target.stl"), mesh).vectors
    assert np.array_equal(design.displacement(np.zeros(2)), laid)
    assert np.array_equal(design.displacement(design.values), deformer.displacement)
    step = np.array([1e-4, -2e-4])
    ahead, behind = (
        deformer.deform(design.displacement(design.values + sign * step)) for sign in (1.0, -1.0)
    )
    forward = deformer.jvp(deformer.displacement, design.jvp(design.values, step))
    change = 0.5 * (ahead - behind)
    np.testing.assert_allclose(forward, change, rtol=0, atol=1e-6 * np.abs(change).max())
    weights = np.random.default_rng(3).standard_normal(mesh.points.shape)
    gradient = design.vjp(design.values, deformer.vjp(deformer.displacement, weights))
    size = np.abs(weights * forward).sum()
    assert abs(gradient @ step - (weights * forward).sum()) <= 1e-12 * size
