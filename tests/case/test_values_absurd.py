"""Absurd but finite numbers in a case are refused in a sentence, or do what they say."""

import re

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.keys import KEYS, METHOD, REDUCTION, VIEW
from slideviz.case.limits import read_limits
from slideviz.case.model import Case
from slideviz.case.motion_text import read_motions
from slideviz.case.motions.rigid import Translate
from slideviz.cli import run
from slideviz.errors import ArgumentError, CaseError, UnsoundError
from slideviz.mesh.check import LARGEST
from slideviz.rbf.reduction import Reduction
from slideviz.sections.model import Section
from tests import builders
from tests.oracles.kernels import KERNELS
from tests.slow import one_of_each_fast

TEXTS = ("1e300", "1.7e308", "1e49", "1e30", "1e-30", "1e-300", "1e-320", "5e-324")
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
    if float(text) > LARGEST:
        with pytest.raises(CaseError, match=re.escape(f"'{text}' is too large to compute with")):
            KEYS[name].kind.read(text)
        return
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


@pytest.mark.parametrize("value", [1e-300, 1e49])
def test_a_program_is_told_of_an_absurd_radius(value):
    with pytest.raises(CaseError, match=r"INFLUENCE_FACTOR: 1e[-+]\d+ is out of range; expected"):
        Case(influence_factor=value)


MOTIONS = (
    "(BLOCK, translate, #, 0.02)",
    "(BLOCK, rotate, #, centroid)",
    "(BLOCK, rotate, 5, #, 0.5)",
    "(BLOCK, scale, #, centroid)",
    "(BLOCK, scale, 1.1, 1.2, (0.5, #))",
    "(BLOCK, radial, #, 0.01, (0.5, 0.5))",
    "(BLOCK, radial, 1.03, #, (0.5, 0.5))",
    "(BLOCK, radial, 1.03, 0.01, (#, 0.5))",
    "(BLOCK, hicks-henne, upper, #, 0.01, 0.3, 0.7)",
    "(BLOCK, hicks-henne, upper, 0.5, #, 0.3, 0.7)",
    "(BLOCK, cst, upper, 1, 4, 0.01, #, 0.7)",
    "(BLOCK, bump, 0.5, 0.01, 0.3, #)",
    "(BLOCK, ffd, BOX, 1, 1, #, 0.01)",
    "(BLOCK, ffd-camber, BOX, 1, #)",
)
BOX = "FFD_DEFINITION= (BOX, 0, 0, 0, #, 0, 0, 1, 1, 0, 0, 1, 0)\nFFD_DEGREE= (2, 2, 0)\n"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("text", ["1e300", "-1e300", "1e49", "-1e49", "1e-300", "5e-324"])
@pytest.mark.parametrize("motion", [*MOTIONS, BOX], ids=lambda text: text[:26])
def test_an_absurd_number_of_a_motion_is_refused_or_works(motion, text, tmp_path, capsys):
    sv.write(tmp_path / "mesh.su2", builders.square(6))
    case = "MESH_FILENAME= mesh.su2\nMARKER_MOVING= ( BLOCK )\n"
    if motion == BOX:
        case += BOX.replace("#", text) + f"MOTION= {MOTIONS[-1].replace('#', '0.01')}\n"
    else:
        case += BOX.replace("#", "1") + f"MOTION= {motion.replace('#', text)}\n"
    (tmp_path / "a.cfg").write_text(case)
    assert run(["run", str(tmp_path / "a.cfg"), "-q", "-o", str(tmp_path / "out.su2")]) in (0, 1, 3)
    said = capsys.readouterr().err
    assert "internal error" not in said
    if abs(float(text)) > LARGEST:
        assert f"'{text}' is too large to compute with; expected a number up to 1e+50" in said


@pytest.mark.parametrize(
    "motion",
    [
        "(BLADE, rotate, #, centroid)",
        "(BLADE, ffd-twist, BOX, 1, #, y, 0, 0, 0)",
        "(BLADE, twist, 0:0, 1:#)",
        "(BLADE, stagger, #)",
    ],
)
def test_an_angle_without_a_digit_that_counts_is_refused(motion):
    for angle in ("1e10", "-1e20", "1e49"):
        with pytest.raises(CaseError, match="is too large: expected degrees up to 1e"):
            read_motions(motion.replace("#", angle))
    read_motions(motion.replace("#", "1e9"))


@pytest.mark.parametrize("text", ["inverted = 1e300", "min > -1e51"])
def test_a_limit_too_large_to_compute_with_is_refused(text):
    with pytest.raises(CaseError, match="too large to compute with"):
        read_limits(text)


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("value", [1e300, -1e300, 1e51])
def test_a_section_with_a_number_too_large_is_refused(place, value):
    numbers = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5]
    numbers[place] = value
    with pytest.raises(CaseError, match="has a number too large to compute with; expected numbers"):
        Section.of("cylinder", numbers[:3], numbers[3:6], numbers[6])


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


COUNTS = {key.name: "999999999" for key in KEYS.values() if key.kind.entry == "whole"}


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        *((name, value, "") for name, value in COUNTS.items() if name != "STEPS"),
        ("STEPS", "100000000", "100000000 is too large; expected a whole number from 1 to 9999"),
        ("FFD_DEGREE", "(1e30, 1, 0)", f"the degree of i is {int(1e30)}; expected 1 to 50"),
        ("FFD_DEGREE", "(2, 51, 0)", "the degree of j is 51; expected 1 to 50"),
    ],
)
def test_a_count_has_a_limit_or_takes_no_time(key, value, words, tmp_path, capsys):
    sv.write(tmp_path / "mesh.su2", builders.square(6))
    case = "MESH_FILENAME= mesh.su2\nMARKER_MOVING= ( BLOCK )\nDATA_REDUCTION= YES\n"
    box = BOX.replace("#", "1") + f"MOTION= {MOTIONS[-2].replace('#', '0.01')}\n"
    (tmp_path / "a.cfg").write_text(case + box)
    call = ["run", str(tmp_path / "a.cfg"), "--set", f"{key}={value}"]
    code = run([*call, "-q", "-o", str(tmp_path / "out.su2")])
    assert code in ((1,) if words else (0, 1))
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("field", WRONG)
def test_a_program_is_told_at_once_of_an_axis_or_point(field):
    with pytest.raises(CaseError, match=r"^PERIODIC_(AXIS|ORIGIN): .*"):
        Case(**{field: WRONG[field]})


@pytest.mark.filterwarnings("error")
def test_a_program_is_told_of_absurd_steps_and_names():
    case = Case(
        roles={"BLOCK": "moving"},
        motions=(Translate("BLOCK", (0.02, 9e49)), Translate("BLOCK", (0.0, 9e49))),
    )
    with pytest.raises(CaseError, match=r"takes node \d+ to \(.*, 1.8e\+50\); .* so move it less"):
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
