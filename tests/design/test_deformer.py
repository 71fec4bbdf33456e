"""The deformer: one preparation, many displacements, results that depend on these alone."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.errors import (
    CaseError,
    ConditionWarning,
    DeformError,
    NodeError,
    ToleranceWarning,
    UnsoundError,
)
from slideviz.rbf.reduction import Reduction
from tests import builders
from tests.test_laws import box, box_case, sector, sector_case

REDUCED = Reduction(tolerance=1e-4)


def turned(mesh, marker="BLOCK", size=0.04):
    return (Translate(marker, (size, -0.7 * size, 0.3 * size)[: mesh.dim]), Rotate(marker, 3.0))


def made(kind, **settings):
    """A mesh with its case: plane with the boundary flat, curved, or periodic by rotation."""
    if kind == "rotational":
        mesh = sector(2)
        return mesh, sector_case(mesh, ("ps", "moving"), turned(mesh), **settings)
    if kind == "curved":
        mesh = builders.annulus(24, 5, 2)
        roles = {"wall": "moving", "far0": "sliding", "far1": "sliding"}
        return mesh, Case(roles=roles, motions=turned(mesh, "wall"), sliding="ds", **settings)
    mesh = box(2)
    return mesh, box_case(mesh, ("ps", "moving"), turned(mesh), **settings)


KINDS = pytest.mark.parametrize("kind", ["flat", "curved", "rotational"])
STEPS = pytest.mark.parametrize("steps", [1, 3])
QUIET = pytest.mark.filterwarnings("ignore::slideviz.errors.ToleranceWarning")


@KINDS
@STEPS
@QUIET
def test_results_depend_on_the_arguments_alone(kind, steps):
    mesh, case = made(kind, steps=steps, reduction=REDUCED)
    deformer = sv.Deformer(mesh, case)
    one, other = deformer.displacement, 0.3 * deformer.displacement
    weights = np.random.default_rng(0).standard_normal(mesh.points.shape)

    def results(of):
        of.deform(other)
        return [of.deform(one), of.jvp(one, other), of.vjp(one, weights), of.max_error(one)]

    first = results(deformer)
    deformer.vjp(other, weights)
    again = results(deformer)
    sent = results(pickle.loads(pickle.dumps(deformer)))
    fresh = results(sv.Deformer(mesh, case))
    for found in (again, sent, fresh):
        for a, b in zip(first, found, strict=True):
            assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


@KINDS
@STEPS
@QUIET
def test_designs_together_are_what_they_are_alone(kind, steps):
    mesh, case = made(kind, steps=steps)
    deformer = sv.Deformer(mesh, case)
    designs = deformer.displacement * np.linspace(0.2, 1.2, 5)[:, None, None]
    together, errors = deformer.deform(designs), deformer.max_error(designs)
    for points, error, design in zip(together, errors, designs, strict=True):
        np.testing.assert_allclose(points, deformer.deform(design), rtol=0, atol=1e-13)
        assert error == pytest.approx(deformer.max_error(design), abs=1e-13)
    directions = designs[:3]
    stacked = deformer.jvp(designs[1], directions)
    for change, direction in zip(stacked, directions, strict=True):
        np.testing.assert_allclose(change, deformer.jvp(designs[1], direction), atol=1e-12)
    weights = np.random.default_rng(1).standard_normal((3, *mesh.points.shape))
    gradients = deformer.vjp(designs[1], weights)
    for gradient, weight in zip(gradients, weights, strict=True):
        np.testing.assert_allclose(gradient, deformer.vjp(designs[1], weight), atol=1e-11)


@KINDS
@STEPS
@QUIET
def test_nothing_moves_without_a_displacement_and_fixed_nodes_never(kind, steps):
    mesh, case = made(kind, steps=steps, reduction=None)
    held = sorted(set(mesh.marker_names) & {"x_m", "inner"})
    case = case.change(roles=dict(case.roles) | dict.fromkeys(held, "fixed"))
    mesh = mesh.with_points(np.where(mesh.points == 0, -0.0, mesh.points))
    deformer = sv.Deformer(mesh, case)
    for name in held:
        fixed = mesh.marker(name).nodes
        assert deformer.deform()[fixed].tobytes() == mesh.points[fixed].tobytes()
    if kind != "curved":  # where each node keeps the facet that it is on at the reference
        still = deformer.deform(np.zeros_like(deformer.displacement))
        assert still.tobytes() == mesh.points.tobytes()
    still = sv.Deformer(mesh, case, np.zeros_like(deformer.displacement)).deform()
    moved = deformer.nodes
    np.testing.assert_array_equal(still[moved], deformer.deform()[moved])
    at_rest = deformer.refresh(np.zeros_like(deformer.displacement))
    points = at_rest.deform(np.zeros_like(deformer.displacement))
    assert points.tobytes() == mesh.points.tobytes()


def test_moving_nodes_are_all_that_is_asked_for():
    mesh, case = made("flat")
    deformer = sv.Deformer(mesh, case)
    np.testing.assert_array_equal(deformer.nodes, np.unique(mesh.marker("BLOCK").nodes))
    assert not deformer.nodes.flags.writeable
    assert not deformer.displacement.flags.writeable
    assert (deformer.mesh, deformer.case) == (mesh, case)
    moved = deformer.deform()[deformer.nodes]
    np.testing.assert_allclose(moved - mesh.points[deformer.nodes], deformer.displacement)


def test_one_flat_step_is_linear():
    mesh, case = made("flat", steps=1, reduction=None)
    deformer = sv.Deformer(mesh, case)
    change = deformer.deform() - mesh.points
    np.testing.assert_allclose(
        deformer.jvp(0.3 * deformer.displacement, deformer.displacement), change, atol=1e-14
    )


def test_a_case_needs_no_motions_where_displacements_are_given():
    mesh, case = made("flat")
    given = sv.Deformer(mesh, case)
    bare = sv.Deformer(mesh, case.change(motions=()), given.displacement)
    assert not bare.displacement.any()
    np.testing.assert_array_equal(bare.nodes, given.nodes)
    np.testing.assert_array_equal(bare.deform(given.displacement), given.deform())


def test_the_number_of_steps_is_that_of_the_reference():
    mesh = builders.square(8)
    roles = dict.fromkeys(mesh.marker_names, "fixed") | {"BLOCK": "moving"}
    case = Case(roles=roles, motions=(Rotate("BLOCK", 45.0),), steps=0)
    *_, last = sv.deform(case, mesh)
    assert last.total > 1
    deformer = sv.Deformer(mesh, case)
    np.testing.assert_allclose(deformer.deform(), last.mesh.points, rtol=0, atol=1e-13)
    assert len(deformer._steps) == last.total


@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.parametrize("levels", ["none", "size", "tol"])
def test_control_nodes_suffice_for_all_displacements_together(levels, sliding):
    mesh = builders.square(24)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    settings = {"multilevel": True, "criterion": levels, "level_size": 16}
    reduction = Reduction(tolerance=2e-5, **(settings if levels != "none" else {}))
    case = Case(roles=roles, sliding=sliding, reduction=reduction, steps=2)
    shape = (len(np.unique(mesh.marker("BLOCK").nodes)), 2)
    rng = np.random.default_rng(0)
    basis = np.stack([np.full(shape, [0.02, 0.0]), 0.01 * rng.standard_normal(shape)])
    with pytest.warns(ToleranceWarning, match="refresh"):
        sv.Deformer(mesh, case, basis[0]).deform(basis[1])
    both = sv.Deformer(mesh, case, basis)
    assert (both.max_error(basis) <= 2e-5).all()
    both.deform(basis)
    # One that needs no control nodes leaves those of the others.
    rest = sv.Deformer(mesh, case, np.stack([basis[0], 0.0 * basis[0]]))
    assert rest.max_error(basis[0]) <= 2e-5


def test_a_design_off_its_facets_warns_of_them_alone():
    mesh, case = made("curved", reduction=None)
    deformer = sv.Deformer(mesh, case)
    with pytest.warns(ToleranceWarning, match=": the facets that nodes slide on belong to"):
        deformer.deform(-2.0 * deformer.displacement)


def test_a_design_outside_the_tolerance_warns_until_refreshed():
    mesh, case = made("curved", reduction=REDUCED)
    deformer = sv.Deformer(mesh, case)
    design = -2.0 * deformer.displacement
    with pytest.warns(ToleranceWarning, match=r"above the tolerance of 0.0001: .* `deformer ="):
        deformer.deform(design)
    with pytest.warns(ToleranceWarning, match="of 1 design at"):
        deformer.deform(np.stack([deformer.displacement, design]))
    fresh = deformer.refresh(design)
    assert fresh.max_error(design) <= 1e-4 < deformer.max_error(design)
    asked = case.change(motions=())
    np.testing.assert_array_equal(fresh.displacement, deformer.displacement)
    np.testing.assert_array_equal(
        fresh.deform(design), sv.Deformer(mesh, asked, design).deform(design)
    )
    # The first is what it was.
    assert deformer.max_error(deformer.displacement) <= 1e-4


def test_sliding_nodes_that_left_their_facet_count_as_an_error():
    mesh, case = made("curved", reduction=None)
    deformer = sv.Deformer(mesh, case)
    assert deformer.max_error(deformer.displacement) <= 1e-12
    design = -deformer.displacement
    with pytest.warns(ToleranceWarning):
        points = deformer.deform(design)
    far = np.union1d(mesh.marker("far0").nodes, mesh.marker("far1").nodes)
    # A node that goes the other way round is kept on the facet before it, beyond its end: outside.
    off = np.linalg.norm(points[far], axis=1).max() - 2.0
    assert deformer.max_error(design) >= off > 1e-5
    fresh = deformer.refresh(design)
    assert fresh.max_error(design) <= 1e-12
    assert np.linalg.norm(fresh.deform(design)[far], axis=1).max() <= 2.0 + 1e-14


def test_images_must_move_alike():
    mesh = builders.channel(8)
    roles = {"bump": "moving", "x_m": "periodic", "x_p": "periodic", "y_p": "moving"}
    case = Case(roles=roles, motions=(Translate("", (0.0, 0.02)),), periodic="periodic")
    case = case.change(periodic_type="translational")
    deformer = sv.Deformer(mesh, case)
    wrong = deformer.displacement.copy()
    side = np.intersect1d(mesh.marker("y_p").nodes, mesh.marker("x_p").nodes)
    row = np.searchsorted(deformer.nodes, side[0])
    wrong[row] += 0.01
    with pytest.raises(NodeError, match="asked to move differently"):
        deformer.deform(wrong)
    # The gradient of both images together is at the one with the lower number.
    other = np.intersect1d(mesh.marker("y_p").nodes, mesh.marker("x_m").nodes)
    weights = np.zeros(mesh.points.shape)
    weights[[side[0], other[0]], 1] = 1.0
    gradient = deformer.vjp(deformer.displacement, weights)
    pair = gradient[
        np.searchsorted(deformer.nodes, [min(side[0], other[0]), max(side[0], other[0])])
    ]
    np.testing.assert_allclose(pair, [[0.0, 2.0], [0.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (np.zeros((3, 2)), r"has the shape \(3, 2\); expected \(8, 2\)"),
        (np.zeros(16), "has the shape"),
        (np.zeros((1, 1, 8, 2)), "has the shape"),
        (np.full((8, 2), np.nan), "not finite"),
    ],
)
def test_wrong_displacements(values, sentence):
    mesh, case = made("flat")
    deformer = sv.Deformer(mesh, case)
    for call in (deformer.deform, deformer.max_error, deformer.refresh):
        with pytest.raises(CaseError, match=sentence):
            call(values)
    with pytest.raises(CaseError, match=sentence):
        deformer.jvp(deformer.displacement, values)


def test_derivatives_are_those_at_one_design():
    mesh, case = made("flat")
    deformer = sv.Deformer(mesh, case)
    with pytest.raises(CaseError, match="at one displacement"):
        deformer.jvp(np.zeros((2, 8, 2)), deformer.displacement)
    with pytest.raises(CaseError, match="weights has the shape"):
        deformer.vjp(deformer.displacement, np.zeros((8, 2)))


def test_a_badly_conditioned_system_is_told():
    mesh, case = made("flat", reduction=None)
    with pytest.warns(ConditionWarning, match="condition number of the system is"):
        sv.Deformer(mesh, case.change(kernel="gaussian", influence_factor=20.0))


def test_a_reduction_needs_a_displacement_to_choose_by():
    mesh, case = made("flat", reduction=REDUCED)
    with pytest.raises(DeformError, match="all displacements are zero, so control nodes"):
        sv.Deformer(mesh, case, np.zeros((8, 2)))


@QUIET
def test_a_design_that_goes_beyond_all_bounds_is_refused():
    mesh = builders.layered(8, 1e-6)
    roles = {"y_m": "moving", "x_m": "sliding", "x_p": "sliding", "y_p": "fixed"}
    case = Case(roles=roles, motions=(Translate("y_m", (0.0, 0.05)),), sliding="ps")
    roles["x_m"] = roles["x_p"] = "fixed"
    case = case.change(roles=roles, reduction=None)
    up = np.tile([0.0, 0.05], (len(np.unique(mesh.marker("y_m").nodes)), 1))
    with pytest.warns(ConditionWarning):
        deformer = sv.Deformer(mesh, case, np.zeros_like(up))
    with pytest.raises(UnsoundError, match=r"step 1: the interpolation misses its own"):
        deformer.deform(up)


@KINDS
@STEPS
@QUIET
@pytest.mark.parametrize("reference", [1.0, 0.0], ids=["motion", "rest"])
def test_one_node_may_move_by_next_to_nothing_from_the_undeformed_mesh(kind, steps, reference):
    mesh, case = made(kind, steps=steps)
    own = sv.Deformer(mesh, case).displacement
    deformer = sv.Deformer(mesh, case, reference * own)
    still, size = np.zeros_like(own), 1e-6
    np.testing.assert_array_equal(deformer.deform(still), mesh.points)
    units = np.eye(own.size).reshape(-1, *own.shape)
    ends = [deformer.deform(sign * size * units) for sign in (1, -1)]
    exact = deformer.jvp(still, units)
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * size), exact, rtol=1e-5, atol=1e-6)
    assert np.abs(exact).max() >= 1.0


def test_a_design_that_overshoots_is_refused_only_beyond_what_the_reference_moves():
    mesh = builders.grid((14, 14))
    roles = dict.fromkeys(mesh.marker_names, "internal") | {"y_m": "moving"}
    case = Case(roles=roles, motions=(Translate("y_m", (0.0, 0.05)),), kernel="wendland-c6")
    deformer = sv.Deformer(mesh, case)
    jagged = deformer.displacement * (-1.0) ** np.arange(len(deformer.nodes))[:, None]
    small = 1e-3 * jagged
    overshoot = np.abs(deformer.deform(small) - mesh.points).max()
    assert overshoot > 10 * np.abs(small).max()
    with pytest.raises(UnsoundError, match=r"step 1: node .* would move"):
        deformer.deform(jagged)
    with pytest.raises(UnsoundError):
        deformer.deform(np.stack([small, jagged]))


def test_designs_that_turn_far_in_a_cylindrical_frame_are_as_each_alone():
    mesh, case = made("rotational", steps=1)
    deformer = sv.Deformer(mesh, case)
    x = mesh.points[deformer.nodes]

    def turned_by(angle):
        c, s = np.cos(angle), np.sin(angle)
        return x @ np.array([[c, s], [-s, c]]) - x

    angles = [0.0, 1e-9, -0.05, 0.2, -0.249, 0.251, 0.4]
    designs = np.stack([turned_by(angle) for angle in angles])
    each = np.stack([deformer.deform(design) for design in designs])
    np.testing.assert_allclose(deformer.deform(designs), each, rtol=0, atol=2e-14)


def test_whoever_watches_can_stop_it():
    mesh, case = made("flat", steps=2)
    seen = []

    def tell(progress):
        seen.append(progress.step)
        if progress.step == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sv.Deformer(mesh, case, progress=tell)
    assert seen[0] == 1
