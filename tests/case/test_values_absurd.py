"""Absurd but finite numbers in a case are refused in a sentence, or do what they say."""

import re

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.key import METHOD, REDUCTION, VIEW
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.errors import ArgumentError, CaseError, UnsoundError
from slideviz.rbf.kernels import KERNELS
from slideviz.rbf.reduction import Reduction
from tests import builders
from tests.slow import one_of_each_fast

TEXTS = ("1e300", "1.7e308", "1e30", "1e-30", "1e-300", "1e-320", "5e-324")
FIELDS = [key for key in KEYS.values() if key.group in (METHOD, REDUCTION)]
REALS = [key.name for key in FIELDS if key.kind.allowed.startswith("a number")]
REFUSED = {
    "small": [
        name for name in REALS if not re.search(r"(above|least) 0\b(?!\.)", KEYS[name].kind.allowed)
    ],
    "large": [name for name in REALS if re.search("below|up to", KEYS[name].kind.allowed)],
}
ENDS = [
    *[("INFLUENCE_FACTOR", text, kernel) for text in ("1.1e-6", "9e5") for kernel in KERNELS],
    *[("IDW_POWER", text, "") for text in ("20", "1e-320")],
    *[("IDW_FIXED_WEIGHT", text, "") for text in ("1.1e-12", "9e11")],
]


def case_with(name, text, sliding, kernel="wendland-c2"):
    key = KEYS[name]
    mesh = builders.square(6) if sliding != "ps" else builders.sector(5)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    reduction = Reduction(tolerance=1e-4, multilevel=sliding == "ps", criterion="tol")
    case = Case(
        roles=roles,
        motions=(Translate("BLOCK", (0.02, 0.01)),),
        sliding=sliding,
        method="idw" if name.startswith("IDW") else "rbf",
        kernel=kernel,
        reduction=reduction if key.group == REDUCTION or sliding == "none" else None,
        steps=2 if name != "STEPS_GAIN" else 0,
    )
    return key.put(case, key.kind.read(text)), mesh


def test_the_real_keys_are_found():
    assert {"INFLUENCE_FACTOR", "GAMMA", "FEATURE_ANGLE", "LVL_TOL_CRIT", "IDW_POWER"} < {*REALS}
    both = {"INFLUENCE_FACTOR", "IDW_FIXED_WEIGHT"}
    assert both <= {*REFUSED["small"]}
    assert both | {"IDW_POWER", "FEATURE_ANGLE", "STEPS_GAIN", "LVL_TOL_CRIT"} <= {
        *REFUSED["large"]
    }
    assert not {"GAMMA", "DATA_RED_TOLERANCE", "DATA_RED_RELATIVE"} & {*REFUSED["large"]}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("text", "sliding"), one_of_each_fast(TEXTS, ["none", "ps", "ds"]))
@pytest.mark.parametrize("name", REALS)
def test_an_absurd_number_is_refused_or_works(name, text, sliding):
    if name in REFUSED["small" if float(text) < 1 else "large"]:
        with pytest.raises(CaseError, match=f"{text} is out of range; expected a number "):
            KEYS[name].kind.read(text)
        return
    case, mesh = case_with(name, text, sliding)
    if name == "SUPPORT_RADIUS":
        with pytest.raises(CaseError, match=r"SUPPORT_RADIUS: .* does not fit .*; expected a"):
            next(sv.deform(case, mesh))
        return
    *_, last = sv.deform(case, mesh)
    assert np.all(np.isfinite(last.mesh.points))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("end", "sliding"), one_of_each_fast(ENDS, ["none", "ps", "ds"]))
def test_the_ends_of_what_is_allowed_work(end, sliding):
    name, text, kernel = end
    case, mesh = case_with(name, text, sliding, kernel or "wendland-c2")
    try:
        *_, last = sv.deform(case, mesh)
    except UnsoundError:  # of a smooth kernel nearly all values are 1
        assert text == "9e5"
        assert kernel not in ("wendland-c0", "ctps-c0")
        return
    assert np.all(np.isfinite(last.mesh.points))
    moved = mesh.marker("BLOCK").nodes
    np.testing.assert_allclose(last.mesh.points[moved], mesh.points[moved] + (0.02, 0.01))


@pytest.mark.parametrize("value", [1e-300, 1e300])
def test_a_program_is_told_of_an_absurd_radius(value):
    with pytest.raises(CaseError, match=r"INFLUENCE_FACTOR: 1e[-+]300 is out of range; expected"):
        Case(influence_factor=value)


NUMBERS = [key for key in FIELDS if key.kind.entry in ("real", "whole")]
WRONG = {"axis": (0.0, 0.0, 0.0), "origin": (np.inf, 0.0, 0.0)}


@pytest.mark.parametrize("key", NUMBERS, ids=lambda key: key.name)
@pytest.mark.parametrize("value", [-1, float("nan")])
def test_a_program_is_told_at_once_of_a_number_that_a_file_cannot_have(key, value):
    """With the sentence of a file: when the case is made, and when it is changed."""
    if key.kind.entry == "whole" and value != -1:
        return
    in_reduction = key.group == REDUCTION and not hasattr(Case(), key.field)
    wrong = {"reduction": Reduction(**{key.field: value})} if in_reduction else {key.field: value}
    for made in (lambda: Case(**wrong), lambda: Case().change(**wrong)):
        with pytest.raises(CaseError, match=f"^{key.name}: .*"):
            made()


@pytest.mark.parametrize("field", WRONG)
def test_a_program_is_told_at_once_of_an_axis_or_point(field):
    with pytest.raises(CaseError, match=r"^PERIODIC_(AXIS|ORIGIN): .*"):
        Case(**{field: WRONG[field]})


@pytest.mark.filterwarnings("error")
def test_a_program_is_told_of_absurd_steps_and_names():
    case = Case(roles={"BLOCK": "moving"}, motions=(Translate("BLOCK", (0.02, 1e300)),))
    with pytest.raises(CaseError, match=r"takes node \d+ to \(.*, 1e\+300\); .* so move it less"):
        next(sv.deform(case, builders.square(6)))
    assert case.change(steps="auto").steps == Case(steps="AUTO").steps == 0
    with pytest.raises(CaseError, match="a case has no 'stepz'; did you mean steps"):
        case.change(stepz=3)
    with pytest.raises(ArgumentError, match="steps is 'many'; expected a whole number"):
        case.change(steps="many")


CHOSEN = [
    key
    for key in KEYS.values()
    if key.kind.entry == "choice" and key.group != VIEW and key.name != "DATA_REDUCTION"
]


@pytest.mark.parametrize("key", CHOSEN, ids=lambda key: key.name)
def test_a_program_gives_the_words_of_a_case_file(key):
    """The sentence of the file, but for its key."""
    kind = Reduction if key.group == REDUCTION else Case
    usual = getattr(kind(), key.field)
    wrong = f"{usual[:-1]}{usual[-1] * 2}"
    with pytest.raises(CaseError) as found:
        kind(**{key.field: wrong})
    assert str(found.value) == f"{key.field}: {key.kind.problem(wrong)}"
    assert f"did you mean {usual}?" in str(found.value)


def test_a_program_is_told_of_wrong_words():
    case = Case(mesh_format="su2b")
    with pytest.raises(
        CaseError, match=r"method: 'elstic' is not one of rbf \| idw \| elastic; did"
    ):
        case.change(method="elstic")
    with pytest.raises(CaseError, match=r"sliding: None is not one of none \| ps \| ds"):
        case.change(sliding=None)
    with pytest.raises(CaseError, match=r"mesh_format: 'cgns' is not one of su2 \| su2b"):
        case.change(mesh_format="cgns")
    with pytest.raises(
        CaseError, match=r"roles: 'A': 'movng' is not one of .*; did you mean moving"
    ):
        Case(roles={"A": "movng"})
