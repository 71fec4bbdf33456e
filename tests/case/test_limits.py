"""Limits: their text, and which cells of a mesh fail them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.check import check_case
from slideviz.case.limits import (
    NUMBERS,
    OPERATORS,
    Limit,
    MeasuredMesh,
    check_limits,
    outcome,
    read_limits,
    require_streamed,
    write_limits,
)
from slideviz.case.model import Case
from slideviz.errors import CaseError
from slideviz.mesh.metrics import metric
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.quality import quality
from slideviz.mesh.walls import CHANGES, VALUES, walls
from slideviz.terms import METRICS, field_of
from tests.builders import grid, square
from tests.mesh.test_interfaces import zones as square_and_core


@st.composite
def limits(draw):
    name = draw(st.sampled_from(sorted(NUMBERS)))
    row = NUMBERS[name]
    sign = draw(st.sampled_from([one for one in OPERATORS if one[0] in row.signs]))
    marker = draw(st.text('a,;" <(@é', max_size=4)) if row.on_boundary else ""
    low, high = (None if abs(end) == np.inf else end for end in row.range)
    values = st.floats(low, high).filter(lambda value: abs(value) <= 1e50)
    values = st.integers(0, 5).map(float) if row.counts else values
    ends = {"<": low, ">": high, "<=": high, ">=": low}
    return Limit(name, sign, draw(values.filter(lambda value: value != ends.get(sign))), marker)


@given(st.lists(limits(), max_size=4))
def test_written_limits_are_read_back(some):
    assert read_limits(write_limits(tuple(some))) == tuple(some)


@pytest.mark.parametrize(
    "text",
    ["min>.3,inverted=0", " ( min > 0.3 , inverted = 0.0 ) ", "( Min > 0.3 ; INVERTED = 0 )"],
)
def test_spaces_and_brackets_may_be_left_out(text):
    assert read_limits(text) == (Limit("min", ">", 0.3), Limit("inverted", "=", 0.0))
    assert Case(limits=text).limits == read_limits(text)


@pytest.mark.parametrize("text", ["( )", "NONE", ""])
def test_no_limits(text):
    assert read_limits(text) == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "mni > 0.3",
            r"LIMITS has no number 'mni'; did you mean min\? \(`slideviz keys` lists all",
        ),
        ("foo > 0.3", r"'foo' is not one of min \| "),
        (
            "min",
            "'min': cannot read this limit; write e.g. min > 0.3, and separate limits by commas",
        ),
        ("min > 0.3 inverted = 0", r"cannot read this limit; .* separate limits by commas"),
        (
            "mean > 2",
            r"mean > 2: expected a number from 0 to below 1 for mean \(mean",
        ),
        ("min >= 1.5", r"expected a number above 0 to 1 for min \(lowest quality\)$"),
        ("min > 1", r"min > 1: expected a number from 0 to below 1 for min"),
        (
            "inverted = 0.5",
            r"inverted = 0.5: expected a whole number from 0 to 1e\+12 for inverted",
        ),
        ("unproven < 0", r"expected a whole number above 0 to 1e\+12 for unproven"),
        ("inverted <= -1", r"expected a whole number from 0 to below 1e\+12 for inverted"),
        ("first_height > -1", r"first_height > -1: expected a number from 0 for first_height"),
        ("height_ratio < 0", r"expected a number above 0 for height_ratio"),
        ("growth < 0.5", r"growth < 0.5: expected a number above 1 for growth"),
        ("growth < 1", r"growth < 1: expected a number above 1 for growth"),
        ("wall_angle > 90", r"expected a number from -90 to below 90 for wall_angle"),
        ("largest_angle < 50", r"expected a number above 60 to 360"),
        ("skew > 1.5", r"expected a number from 0 to below 1 for skew"),
        ("equal_layers > 6", r"expected a whole number from 0 to below 5"),
        ("equal_layers >= 2.5", r"expected a whole number above 0 to 5"),
        ("inverted = 1e20", r"inverted = 1e\+20: expected a whole number from 0 to 1e\+12"),
        ("min >= 0", r"min >= 0: expected a number above 0 to 1 for min"),
        ("wall_angle >= -90", r"expected a number above -90 to 90 for wall_angle"),
        ("largest_angle <= 360", r"expected a number from 60 to below 360"),
        ("min > 0,3", r"'3': cannot read this limit"),
        ("min > high", r"'high' is not a number"),
        ("min < 0.3", r"min < 0.3: a limit of min \(lowest quality\) needs >"),
        ("first_height >= -1", r"first_height >= -1: expected a number from 0 for first_height"),
        ("inverted >= 1", r"inverted >= 1: a limit of inverted .* needs < or ="),
        ("min => 0.3", r"min => 0.3: '=>' is not one of > \| >="),
        ("min@blade > 0.3", r"min@blade > 0.3: min is of the whole mesh; leave out @blade"),
        ("( min > 0.3", r"a bracket of '\( min > 0.3' is missing"),
        ('min@"a > 3', r"the quotation mark in .* is not closed"),
    ],
)
def test_mistakes_are_told(text, words):
    with pytest.raises(CaseError, match=words):
        read_limits(text)


def test_all_mistakes_are_told_at_once():
    with pytest.raises(CaseError, match=r"(?s)'a' is not one of.*'b': cannot read this limit"):
        read_limits("a > 1, b")
    with pytest.raises(CaseError, match="expected a finite number"):
        Limit("min", ">", float("nan"))


def test_a_case_keeps_its_limits_in_a_file(tmp_path):
    case = Case(roles={"BLOCK": "moving"}, limits="min > 0.25, inverted = 0")
    case.write(tmp_path / "case.cfg")
    assert "LIMITS= ( min > 0.25, inverted = 0 )" in (tmp_path / "case.cfg").read_text()
    assert Case.read(tmp_path / "case.cfg").limits == case.limits
    case.change(limits=()).write(tmp_path / "none.cfg")
    assert "LIMITS" not in (tmp_path / "none.cfg").read_text()


@pytest.fixture
def measured():
    """Return 4 x 4 squares; node 0 is drawn in, and node 7 so far that cells fold."""
    mesh = grid((4, 4))
    points = mesh.points.copy()
    points[0] += 0.1
    points[7] -= (0.4, 0.0)
    moved = mesh.with_points(points)
    return MeasuredMesh(quality(moved, mesh), moved, mesh)


def test_the_cells_that_fail_are_the_worst_first(measured):
    values = measured.quality.values
    (result,) = check_limits(read_limits("min > 0.9"), measured)
    assert not result.passed
    assert result.actual == values.min() == 0
    np.testing.assert_array_equal(np.sort(result.cells), np.flatnonzero(~(values > 0.9)))
    assert (np.diff(values[result.cells]) >= 0).all()
    assert len(result.cells) > 2
    worst = float(metric(measured.mesh, "skewness").of_cells.max())
    (at,) = check_limits([Limit("skewness", "<=", worst)], measured)
    assert at.passed
    assert not len(at.cells)
    (below,) = check_limits([Limit("skewness", "<", worst)], measured)
    assert not below.passed


def test_the_quality_of_a_mesh_says_whether_it_meets_limits(measured):
    text = "min > 0.9, inverted = 0, skewness < 4, margin > 0"
    found = sv.quality(measured.mesh, measured.reference, limits=text)
    for limits in (read_limits(text), [*read_limits(text)]):
        again = sv.quality(measured.mesh, measured.reference, limits=limits).limits
        assert [str(one.limit) for one in again] == text.split(", ")
    expected = check_limits(read_limits(text), measured)
    assert [one.passed for one in found.limits] == [one.passed for one in expected]
    for one, other in zip(found.limits, expected, strict=True):
        np.testing.assert_array_equal(one.cells, other.cells)
    assert sv.quality(measured.mesh, measured.reference).limits == ()
    np.testing.assert_array_equal(found.values, measured.quality.values)
    with pytest.raises(CaseError, match=r"'min': cannot read this limit; write e\.g\. min > 0.3"):
        sv.quality(measured.mesh, limits="min")
    with pytest.raises(CaseError, match="compares with the undeformed mesh; give it"):
        sv.quality(measured.mesh, limits=[sv.Limit("margin", ">", 0.0)])


@pytest.mark.parametrize("zones", [False, True])
def test_each_step_of_a_run_says_whether_it_meets_the_limits_of_the_case(zones, tmp_path):
    text = "min > 0.97, inverted = 0"
    mesh = sv.read(square_and_core(tmp_path)) if zones else square(6)
    case = sv.Case(
        roles={"BLOCK": "moving"},
        motions=(sv.Translate("BLOCK", (0.03, 0.0)),),
        steps=3,
        limits=text,
    )
    steps = [*sv.deform(case, mesh)]
    for step in steps:
        expected = sv.quality(step.mesh, mesh, limits=text).limits
        assert [(str(one.limit), one.passed) for one in step.limits] == [
            (str(one.limit), one.passed) for one in expected
        ]
    assert steps[0].limits[0].actual > steps[-1].limits[0].actual
    assert [*sv.deform(case.change(limits=()), mesh)][-1].limits == ()


def test_counts_and_the_mean(measured):
    texts = "inverted = 0, inverted <= 2, unproven = 0, mean > 0.99, mean > 0.1"
    results = check_limits(read_limits(texts), measured)
    assert [result.passed for result in results] == [False, True, True, False, True]
    np.testing.assert_array_equal(results[0].cells, measured.quality.inverted_cells())
    assert results[0].actual == measured.quality.inverted == 2
    assert results[3].actual == measured.quality.mean
    assert not len(results[3].cells)


def test_cells_of_a_halo_do_not_count(measured):
    halo = measured.quality.values < 0.9
    masked = replace(measured, quality=replace(measured.quality, halo=halo))
    low, folded = check_limits(read_limits("min > 0.9, inverted = 0"), masked)
    assert low.passed
    assert low.actual == measured.quality.values[~halo].min()
    assert folded.passed


def test_a_boundary_that_the_mesh_lacks_is_told():
    case = Case(roles={"BLOCK": "moving"}, limits="growth@BLOK < 1.5")
    problems = check_case(case, grid((4, 4), hole=((1, 2), (1, 2))))
    (problem,) = [text for text in map(str, problems) if "LIMITS" in text]
    assert "has no marker 'BLOK'; did you mean BLOCK?" in problem


def test_a_streamed_run_knows_some_numbers_only():
    require_streamed(read_limits("min > 0.3, mean > 0.3, inverted = 0, unproven = 0"))
    with pytest.raises(CaseError, match=r"size > 0.5 needs the mesh in memory.* min, mean, inv"):
        require_streamed(read_limits("min > 0.3, size > 0.5"))


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_can_be_limited(measured, name):
    values = metric(measured.mesh, name, measured.reference).of_cells
    high = METRICS[name].best == "high"
    bound = float(np.median(np.unique(values)))
    (result,) = check_limits(read_limits(f"{name} {'<>'[high]} {bound!r}"), measured)
    assert result.actual == (values.min() if high else values.max())
    failing = values <= bound if high else values >= bound
    np.testing.assert_array_equal(np.sort(result.cells), np.flatnonzero(failing))
    assert result.cells[0] in np.flatnonzero(values == result.actual)
    assert result.limit.name == field_of(name)
    with pytest.raises(CaseError, match="a limit of"):
        Limit(field_of(name), "<>"[not high], bound)


WALLS = {
    "first_height": ("<", ">="),
    "height_ratio": (">", "<"),
    "growth": ("<",),
    "equal_layers": (">=",),
    "wall_angle": (">",),
    "angle_change": ("<",),
}


@pytest.fixture(scope="module")
def layered():
    """Return 6 x 5 quadrilaterals with thin layers at LOWER, whose first nodes are moved."""
    mesh = layered_mesh()
    points = mesh.points.copy()
    points[8:12] += (0.01, 0.004)
    moved = mesh.with_points(points)
    return MeasuredMesh(quality(moved, mesh), moved, mesh)


def layered_mesh():
    x, y = np.meshgrid(np.arange(7.0), np.cumsum([0, 0.05, 0.05, 0.06, 0.08, 1.0]))
    corner = (7 * np.arange(5)[:, None] + np.arange(6)).ravel()
    sides = {"LOWER": 0, "UPPER": 35}
    return Mesh(
        np.c_[x.ravel(), y.ravel()],
        Cells.from_blocks([(9, corner[:, None] + [0, 1, 8, 7])]),
        tuple(
            Marker(name, Cells.from_blocks([(3, first + np.c_[:6] + [0, 1])]))
            for name, first in sides.items()
        ),
    )


@pytest.mark.parametrize(("name", "signs"), WALLS.items())
def test_every_number_of_walls_can_be_limited(layered, name, signs):
    assert {*WALLS} == {*VALUES, *CHANGES}
    found = walls(layered.mesh, layered.reference, ("LOWER",))
    at = found.values[name][found.columns.places("LOWER")]
    for sign in signs:
        worst = at.min() if sign[0] == ">" else at.max()
        little = 1.0 if name == "equal_layers" else 1e-9
        beyond = worst + (little if sign[0] == ">" else -little)
        (missed,) = check_limits([Limit(name, sign, beyond, "LOWER")], layered)
        within = worst if sign == ">=" else worst + (worst - beyond)  # 0 or more are all layers
        (met,) = check_limits([Limit(name, sign, within, "LOWER")], layered)
        assert missed.actual == met.actual == worst
        assert met.passed
        assert not missed.passed
        assert len(missed.cells)
        at_cells = found.at_cells(name)[missed.cells]
        assert np.isfinite(at_cells).all()
        if name != "height_ratio":  # whose worst value is the one farthest from 1
            assert (at_cells == worst).any()


def test_without_a_boundary_those_with_layers_count(layered):
    everywhere, there = check_limits(read_limits("growth < 1.3, growth@LOWER < 1.3"), layered)
    assert everywhere.actual == there.actual
    (outer,) = check_limits(read_limits("first_height@UPPER < 0.9"), layered)
    assert outer.actual == pytest.approx(1.0)
    assert len(outer.cells) == 6
    assert set(outer.cells.tolist()) == set(range(24, 30))
    none = replace(layered, boundaries=("UPPER",))  # which has none
    (unknown,) = check_limits(read_limits("growth < 1.3"), none)
    assert not unknown.passed
    assert np.isnan(unknown.actual)
    assert unknown.value_words == "no boundary layers at UPPER"
    assert outcome((unknown,)) == "growth < 1.3: no boundary layers at UPPER"


def test_limits_that_compare_need_the_undeformed_mesh(layered):
    alone = replace(layered, reference=None)
    for text in ("height_ratio > 0.5", "angle_change < 5", "margin > 0"):
        with pytest.raises(CaseError, match=rf"LIMITS: {text} compares with .*--reference"):
            check_limits(read_limits(text), alone)


def test_a_missed_limit_of_walls_names_the_boundaries_where_it_fails(layered):
    (both,) = check_limits(read_limits("first_height > 1.5"), replace(layered, boundaries=None))
    assert both.boundaries == ("LOWER",)  # UPPER has no layers
    (one,) = check_limits(read_limits("first_height@UPPER > 1.5"), layered)
    assert one.boundaries == ("UPPER",)
    (met,) = check_limits(read_limits("first_height@LOWER > 0.001"), layered)
    assert met.boundaries == ()


def test_a_boundary_that_is_no_wall_cannot_be_limited(layered):
    case = Case(roles={"LOWER": "moving", "UPPER": "periodic"}, limits="growth@UPPER < 1.5")
    problems = map(str, check_case(case, layered.mesh))
    (problem,) = [text for text in problems if "LIMITS" in text]
    assert problem == (
        "LIMITS: growth@UPPER < 1.5: UPPER is periodic or internal, so it has no wall layers; "
        "walls are LOWER"
    )
    with pytest.raises(CaseError, match="UPPER is periodic or internal"):
        check_limits(case.limits, replace(layered, boundaries=("LOWER",)))
