"""A case that does not fit itself or its mesh."""

from dataclasses import replace
from pathlib import Path

import pytest

from slideviz.case.check import check_case
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.errors import CaseError
from slideviz.rbf.reduction import Reduction
from slideviz.solver.prepare import prepare

UP = Translate("UPPER", (0.0, 0.1))


def good(**values) -> Case:
    roles = {"UPPER": "moving", "LEFT": "periodic", "RIGHT": "periodic"} | values.pop("roles", {})
    return Case(roles=roles, motions=(UP,)).change(**values)


@pytest.mark.parametrize(
    "case",
    [
        good(),
        good(periodic="periodic", periodic_type="translational", direction=0),
        good(periodic="moving", sliding="ps"),
        good(motions=(FromFile(Path("not-read-here.txt")),)),
        good(motions=(Rotate("UPPER", 5.0), Scale("UPPER", (1.0, 2.0), (0.0, 0.0)))),
        good(motions=(Rotate("UPPER", 5.0, (0.0, 0.0), (0.0, 0.0, -2.0)),)),
        good(reduction=Reduction(), zone=1),
        # What is not used may be anything.
        good(direction=2, axis=(1.0, 0.0, 0.0)),
    ],
)
def test_good_cases(square, case):
    assert check_case(case, square) == ()
    prepare(case, square)


@pytest.mark.parametrize(
    ("case", "words"),
    [
        (
            good(roles={"UPER": "fixed"}),
            "MARKER_FIXED: square.su2 has no marker 'UPER'; did you mean UPPER?",
        ),
        (
            good(roles={"HUB": "internal"}),
            "MARKER_INTERNAL: square.su2 has no marker 'HUB'; it has LOWER, RIGHT, UPPER, LEFT",
        ),
        (Case(), "no marker moves: MARKER_MOVING is missing; write MARKER_MOVING= (...)"),
        (
            Case(motions=(UP,)),
            "no marker moves: MARKER_MOVING is missing; write MARKER_MOVING= (UPPER)",
        ),
        (
            good(roles={"LOWER": "moving"}),
            (
                "moving marker 'LOWER' has no motion; add MOTION= (LOWER, translate, ...) or "
                "DEFORMATION_FILENAME, or name it in MARKER_FIXED instead if it stays"
            ),
        ),
        (
            good(motions=(UP, Translate("LEFT", (1.0, 0.0)))),
            (
                "motion 2 names 'LEFT', which does not move: MARKER_MOVING= (UPPER) does not have "
                "it; one of the two is wrong"
            ),
        ),
        (
            good(motions=(UP, Translate("UPER", (1.0, 0.0)))),
            "MOTION: square.su2 has no marker 'UPER'; did you mean UPPER?",
        ),
        (
            good(motions=(Translate("UPPER", (0.0, 0.0, 1.0)),)),
            "motion 1: the shift has 3 components, and the mesh has 2 dimensions; give 2",
        ),
        (
            good(motions=(UP, Rotate("UPPER", 5.0, (0.0, 0.0, 0.0)))),
            "motion 2: the point has 3 coordinates, and the mesh has 2 dimensions; give 2",
        ),
        (
            good(motions=(Rotate("UPPER", 5.0, "centroid", (1.0, 0.0, 0.0)),)),
            "motion 1: the axis (1.0, 0.0, 0.0) leaves the plane; in 2D leave the axis out",
        ),
        (
            good(motions=(Radial("UPPER", 1.1),)),
            "motion 1: the point has 3 coordinates, and the mesh has 2 dimensions; give 2",
        ),
        (
            good(motions=(Scale("UPPER", (1.0, 1.0, 1.0)),)),
            "motion 1: 3 factors are given, and the mesh has 2 dimensions; give 1 or 2",
        ),
        (
            good(motions=(Scale("UPPER", (2.0,), (0.0, 0.0, 0.0)),)),
            "motion 1: the point has 3 coordinates, and the mesh has 2 dimensions; give 2",
        ),
        (
            good(motions=(Rotate("UPPER", float("nan")),)),
            "motion 1: 'nan' is not a number",
        ),
        (
            good(motions=(Rotate("UPPER", 5.0, "centroid", (0.0, 0.0, 0.0)),)),
            "motion 1: the axis (0, 0, 0) has no direction; write x, y, z or another vector",
        ),
        (
            good(zone=2),
            "ZONE= 2, but square.su2 is zone 1 of 1; read that zone or change ZONE",
        ),
        (
            Case(roles={"UPPER": "moving"}, motions=(UP,), periodic="fixed"),
            (
                "PERIODIC_MODE= fixed needs MARKER_PERIODIC: name the boundaries that repeat, or "
                "choose none"
            ),
        ),
        (
            good(roles={"LEFT": "fixed"}),
            (
                "MARKER_PERIODIC has an odd number of markers (RIGHT); they come in pairs: name "
                "the partner too"
            ),
        ),
        (
            good(periodic="moving"),
            (
                "PERIODIC_MODE= moving needs a sliding method: set SLIDING_MODE= ps or ds, or "
                "choose PERIODIC_MODE= fixed"
            ),
        ),
        (
            good(periodic="fixed", direction=2),
            "PERIODIC_DIRECTION= 2 is z, and the mesh has 2 dimensions; choose x or y",
        ),
        (
            good(periodic="fixed", axis=(1.0, 0.0, 0.0)),
            "PERIODIC_AXIS= (1.0, 0.0, 0.0) leaves the plane; in 2D it is z",
        ),
        (
            good(periodic_type="rotational", direction=0),
            (
                "rotational periodicity repeats in theta, not in r (PERIODIC_DIRECTION= 0); write "
                "theta, or PERIODIC_TYPE= translational"
            ),
        ),
    ],
)
def test_one_problem(square, case, words):
    assert [str(message) for message in check_case(case, square)] == [words]
    with pytest.raises(CaseError) as caught:
        prepare(case, square)
    assert str(caught.value) == words


def test_a_mesh_of_many_or_no_markers(square):
    many = replace(
        square, markers=tuple(replace(square.markers[0], name=f"M{i}") for i in range(40))
    )
    (first, *_) = check_case(Case(roles={"wall": "fixed"}), many)
    assert str(first).endswith("it has M0, M1, M2, M3, M4, M5, M6, M7, M8, M9, M10, M11, ...")
    (first, *_) = check_case(Case(roles={"wall": "fixed"}), replace(square, markers=()))
    assert str(first).endswith("has no marker 'wall'; it has none")


def test_dimensions_in_3d(cube):
    def problems(motion):
        case = Case(roles={"TOP": "moving"}, motions=(motion,))
        return tuple(map(str, check_case(case, cube)))

    assert problems(Rotate("TOP", 5.0, (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))) == ()
    assert problems(Rotate("TOP", 5.0)) == ()
    assert problems(Translate("TOP", (1.0, 0.0))) == (
        "motion 1: the shift has 2 components, and the mesh has 3 dimensions; give 3",
    )
    assert problems(Rotate("TOP", 5.0, (1.0, 0.0))) == (
        "motion 1: the point has 2 coordinates, and the mesh has 3 dimensions; give 3",
    )


def test_all_problems_at_once(square):
    case = Case(roles={"A": "fixed", "LEFT": "periodic"}, periodic="moving")
    assert len(check_case(case, square)) == 4
    with pytest.raises(CaseError) as caught:
        prepare(case, square)
    assert str(caught.value).splitlines() == [str(message) for message in check_case(case, square)]


@pytest.mark.parametrize(("mesh_has", "case_has"), [("airfoil", "AIRFOIL"), ("blade1", "blade_1")])
@pytest.mark.parametrize("motion_too", [False, True])
def test_the_list_that_the_mesh_contradicts_is_the_wrong_one(
    square, mesh_has, case_has, motion_too
):
    first, *others = square.markers
    mesh = replace(square, markers=(replace(first, name=mesh_has), *others))
    motions = (Translate(case_has if motion_too else mesh_has, (0.0, 1.0)),)
    (said,) = check_case(Case(roles={case_has: "moving"}, motions=motions), mesh)
    words = f"square.su2 has no marker '{case_has}'; did you mean {mesh_has}?"
    assert str(said) == f"MARKER_MOVING: {words}"
    case = Case(roles={mesh_has: "moving"}, motions=(Translate(case_has, (0.0, 1.0)),))
    assert str(check_case(case, mesh)[0]) == f"MOTION: {words}"


def test_several_markers_with_a_plus_are_told_their_brackets(square):
    roles = dict.fromkeys(("UPPER", "LEFT"), "moving")
    case = Case(roles=roles, motions=(UP, UP.with_marker("LEFT"), UP.with_marker("UPPER+LEFT")))
    (said,) = check_case(case, square)
    assert str(said).endswith("write several in brackets, e.g. ((UPPER, LEFT), translate, ...)")
