"""How far a motion may go: along a straight path, and along the steps of a run."""

from __future__ import annotations

import pytest

import slideviz as sv
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.margin import SafeFraction, chain
from slideviz.samples.table import sample
from slideviz.terms import FARTHEST
from tests.builders import cube, grid


@pytest.fixture(scope="module")
def square():
    made = sample("square", 25, "motion")
    return made.mesh, made.case.change(sliding="none", periodic="none", steps=1)


def inverted(mesh, reference):
    return sv.quality(mesh, reference).inverted_cells()


def test_a_motion_that_folds_is_safe_up_to_the_first_cell(square):
    mesh, case = square
    (step,) = sv.deform(case, mesh)
    safe = sv.safe_fraction(step.mesh, mesh)
    assert 0 < safe.fraction < 1
    for part, folded in ((1 - 1e-9, []), (1 + 1e-6, [safe.cell])):
        way = safe.fraction * part * (step.mesh.points - mesh.points)
        assert inverted(mesh.with_points(mesh.points + way), mesh).tolist() == folded
    nodes = mesh.cells.connectivity[4 * safe.cell : 4 * safe.cell + 4]
    assert safe.where == pytest.approx(mesh.points[nodes].mean(axis=0))
    assert sv.safe_fraction(case, mesh) == safe
    assert safe.words.startswith(f"the motion is safe up to {100 * safe.fraction:.0f}"[:-1])
    values = sv.metrics(step.mesh, ["straight-margin"], mesh)["straight-margin"]
    assert (values.min, values.worst_at) == (safe.fraction, safe.cell)


def test_a_run_of_several_steps_is_a_chain_of_straight_paths(square):
    mesh, case = square
    steps = list(sv.deform(case.change(steps=4), mesh, certify=True))
    before = mesh
    for step in steps:
        assert step.safe is not None
        own = sv.safe_fraction(step.mesh, before).fraction
        assert own == FARTHEST or step.safe.fraction == pytest.approx((step.index - 1 + own) / 4)
        before = step.mesh
    whole = sv.safe_fraction(case.change(steps=4), mesh)
    folded = [step for step in steps if len(inverted(step.mesh, mesh))]
    assert whole == (folded[0] if folded else steps[-1]).safe
    assert whole.fraction > sv.safe_fraction(case, mesh).fraction
    assert next(sv.deform(case, mesh)).safe is None


def test_the_chain_ends_with_the_step_that_folds():
    one, two, three = (SafeFraction(f, 7, step=k) for k, f in enumerate((0.9, 0.6, 3.0), 1))
    assert chain([(0.5, one), (1.0, three)]) == three
    assert chain([(0.5, one), (0.7, two), (1.0, three)]) == two


def test_a_repaired_run_has_the_number_of_its_path_with_the_repair(square):
    mesh, case = square
    (step,) = sv.deform(case.change(repair="yes"), mesh, certify=True)
    assert step.safe == sv.safe_fraction(step.mesh, mesh)
    assert step.safe.fraction > 1 > sv.safe_fraction(case, mesh).fraction


def test_after_several_steps_the_straight_margin_says_how_far_all_is_scaled(square):
    mesh, case = square
    *_, last = sv.deform(case.change(steps=4), mesh)
    run = sv.safe_fraction(case.change(steps=4), mesh).fraction
    straight = sv.metrics(last.mesh, ["straight-margin"], mesh)["straight-margin"].min
    assert run > straight
    for scale, folds in ((0.999 * straight, False), (1.001 * straight, True), (0.999 * run, True)):
        way = scale * (last.mesh.points - mesh.points)
        assert bool(len(inverted(mesh.with_points(mesh.points + way), mesh))) == folds


def test_words_say_that_a_cell_which_folds_on_the_way_unfolds():
    safe = SafeFraction(0.835, 256, "quadrilateral", (0.0, 0.0), step=2)
    assert safe.ending(0, True) == " in step 2; after repair no cell is inverted at the end"
    assert safe.ending(0, False) == " in step 2; no cell is inverted at the end"
    assert safe.ending(3, True) == SafeFraction(1.1, 3).ending(0, True) == ""
    assert SafeFraction(0.0, 3).ending(0, False) == ""


def test_nothing_folds_where_nothing_changes_shape():
    mesh = cube(3)
    moved = mesh.with_points(mesh.points + 0.3)
    assert sv.safe_fraction(moved, mesh) == SafeFraction(FARTHEST)
    assert sv.safe_fraction(mesh, mesh) == SafeFraction(FARTHEST)


def test_an_undeformed_mesh_that_is_not_valid_is_not_safe(square):
    mesh = grid((4, 4))
    points = mesh.points.copy()
    points[6] += 1.7 * (points[12] - points[6])
    safe = sv.safe_fraction(mesh, mesh.with_points(points))
    assert safe.fraction == 0
    assert safe.words.startswith("the undeformed mesh is not valid: cell 1 (quadrilateral) at (0.")


HARDLY = "is safe, but could hardly go farther"


@pytest.mark.parametrize(
    ("fraction", "words"),
    [
        (0.62999, "the motion is safe up to 62.9 %, until cell 7 (prism) at (1, 0.5) folds"),
        (1.8888, "the motion could go 1.88 times as far, until cell 7 (prism) at (1, 0.5) folds"),
        (1.00099, f"the motion {HARDLY}: next, cell 7 (prism) at (1, 0.5) folds"),
        (0.9999, "the motion is safe up to 99.9 %, until cell 7 (prism) at (1, 0.5) folds"),
    ],
)
def test_numbers_are_rounded_down_in_words(fraction, words):
    safe = SafeFraction(fraction, 7, "prism", (1.0, 0.5))
    assert safe.words == words
    report = safe.report()
    assert (report["safe_fraction"], report["safe_cell"]) == (fraction, 7)


def test_without_a_limit_it_is_more_than_the_largest():
    assert SafeFraction(FARTHEST).words == "the motion could go more than 10 times as far"


def test_a_reference_is_needed_and_must_have_the_same_cells(square):
    with pytest.raises(CaseError, match="straight-margin compares with the undeformed mesh"):
        sv.metrics(square[0], ["straight-margin"])
    assert "straight-margin" not in sv.metrics(square[0])
    with pytest.raises(MeshError, match="cannot be the reference"):
        sv.safe_fraction(square[0], grid((2, 2)))
