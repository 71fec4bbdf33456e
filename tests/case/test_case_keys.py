"""Each key: what it means, what it allows, and how it is explained."""

import pytest

from slideviz.case.cfg import describe_keys, set_key
from slideviz.case.check import idle_settings
from slideviz.case.keys import GROUPS, KEYS
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Translate
from slideviz.errors import CaseError
from slideviz.rbf.reduction import Reduction

# MARKER_PERIODIC is not in the thesis's example file, but RBF-SliDe needs it.
RBF_SLIDE = {
    "MESH_FILENAME",
    "MESH_OUT_FILENAME",
    "DEFORMATION_FILENAME",
    "GENERATE_QUALITY",
    "MARKER_BDRY",
    "MARKER_MOVING",
    "MARKER_INTERNAL",
    "MARKER_PERIODIC",
    "PERIODIC_TYPE",
    "PERIODIC_DIRECTION",
    "CURVED",
    "SLIDING_MODE",
    "PERIODIC_MODE",
    "STEPS",
    "INFLUENCE_FACTOR",
    "DATA_REDUCTION",
    "DATA_RED_TOLERANCE",
    "MULTILEVEL",
    "MULTI_CRIT",
    "LVL_TOL_CRIT",
    "LVL_SIZE",
    "DOUBLE_EDGE",
    "GAMMA",
}


def test_which_keys_rbf_slide_has():
    assert {name for name, key in KEYS.items() if key.rbf_slide} == RBF_SLIDE


def test_reference_names_every_key_with_default_and_meaning():
    text = describe_keys()
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    words = " ".join(text.split())  # long heads have a second line
    for key in KEYS.values():
        assert key.group in GROUPS
        mark = " " if key.rbf_slide else "+"
        assert any(line.startswith(f"{mark} {key.name}= ") for line in lines)
        assert f"{key.name}= {key.kind.allowed} [{key.default}]" in words
        assert key.meaning.endswith(".")
        assert key.meaning in words
    assert "(BLADE, translate, dx, dy[, dz])" in text


@pytest.mark.parametrize("key", [k for k in KEYS.values() if k.default != "not set"])
def test_defaults_in_the_reference_are_those_of_the_case(key):
    base = Case(reduction=Reduction()) if key.name != "DATA_REDUCTION" else Case()
    assert key.put(base, key.kind.read(key.default)) == base


@pytest.mark.parametrize(
    ("line", "field", "value"),
    [
        ("ZONE= 2", "zone", 2),
        ("STEPS= +20", "steps", 20),
        ("CURVED= true", "curved", True),
        ("GENERATE_QUALITY= False", "generate_quality", False),
        ("PERIODIC_TYPE= 1", "periodic_type", "rotational"),
        ("PERIODIC_TYPE= Translational", "periodic_type", "translational"),
        ("PERIODIC_MODE= Moving", "periodic", "moving"),
        ("PERIODIC_AXIS= X", "axis", (1.0, 0.0, 0.0)),
        ("PERIODIC_AXIS= (0, .5, -1e-1)", "axis", (0.0, 0.5, -0.1)),
        ("PERIODIC_ORIGIN= 1 2 3", "origin", (1.0, 2.0, 3.0)),
        ("PERIODIC_ORIGIN= (1, 2)", "origin", (1.0, 2.0, 0.0)),
        ("FEATURE_ANGLE= 180", "feature_angle_deg", 180.0),
        ("INFLUENCE_FACTOR= 1E+2", "influence_factor", 100.0),
        ("QUALITY_METRIC= RBF-SliDe", "quality_metric", "rbf-slide"),
        ("MESH_FILENAME= NONE", "mesh_file", None),
    ],
)
def test_values(read, line, field, value):
    assert getattr(read(line), field) == value


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("STEPS= 1.5", r"STEPS: '1.5' is not a whole number from 1"),
        ("STEPS= -3", r"STEPS: -3 is too small; expected a whole number from 1"),
        ("STEPS= 10000", r"STEPS: 10000 is too large; expected a whole number from 1 to 9999"),
        ("ZONE= 0", r"ZONE: 0 is too small"),
        ("STEPS= 99999999999", r"STEPS: '99999999999' is not a whole number"),
        ("GAMMA= 2,5", r"GAMMA: '2,5' is not a number; write decimals with a point"),
        ("GAMMA= nan", r"GAMMA: 'nan' is not a number"),
        ("GAMMA= 1_0", r"GAMMA: '1_0' is not a number"),
        ("GAMMA= 1e999", r"GAMMA: '1e999' is too large to compute with; expected a n"),
        ("GAMMA= 0", r"GAMMA: 0 is out of range; expected a number above 0"),
        ("INFLUENCE_FACTOR= 1e-300", r"FACTOR: 1e-300 is out of range; .* above 1e-06 and below"),
        ("INFLUENCE_FACTOR= 1e49", r"FACTOR: 1e49 is out of range; .* and below 1e\+06"),
        ("IDW_POWER= 1e49", r"IDW_POWER: 1e49 is out of range; .* above 0 up to 20"),
        ("IDW_FIXED_WEIGHT= 1e49", r"WEIGHT: 1e49 is out of range; .* 1e-12 and below 1e\+12"),
        ("LVL_TOL_CRIT= 1", r"LVL_TOL_CRIT: 1 is out of range; .* above 0 and below 1"),
        ("FEATURE_ANGLE= 181", r"FEATURE_ANGLE: 181 is out of range; .* above 0 up to 180"),
        ("SLIDING_MODE= sp", r"SLIDING_MODE: 'sp' is not one of none \| ps \| ds"),
        ("PERIODIC_MODE= fix", r"is not one of none \| .* moving; did you mean fixed\?"),
        ("PERIODIC_TYPE= 2", r"'2' is not one of auto \| translational \| rotational"),
        ("PERIODIC_AXIS= w", r"'w' is not an axis; write x, y, z or three numbers"),
        ("PERIODIC_AXIS= (0, 0, 0)", r"the axis \(0, 0, 0\) has no direction"),
        ("PERIODIC_AXIS= (1, a, 0)", r"PERIODIC_AXIS: 'a' is not a number"),
        ("PERIODIC_ORIGIN= 1", r"the point has 1 values; expected 2 or 3 numbers"),
        ('MESH_FILENAME= "a" b', r"""'"a" b' is not one file name; write it as "name\""""),
        ('MESH_FILENAME= ""', r"the file name is empty; give one, or NONE"),
        ("MESH_OUT_FILENAME= /", r"'/' is a folder; expected the name of a file"),
        ("MESH_OUT_FILENAME= ..", r"'\.\.' is a folder; expected the name of a file"),
        ('MESH_FILENAME= "a', r"""the quotation mark in '"a' is not closed; close it"""),
        ("MARKER_FIXED= (A, A)", r"MARKER_FIXED: marker 'A' is listed twice; list it once"),
        ('MARKER_FIXED= ("")', r"a marker has an empty name; give one"),
        ("MARKER_FIXED= (A", r"a bracket of '\(A' is missing; .* needs a backslash"),
        ("MARKER_FIXED= (A), (B)", r"'\(A\), \(B\)' is not one list of names; write \( A, B \)"),
        ("MARKER_PERIODIC= (A, B, 1, 2)", r"there are numbers among the names; write \( A, B \)"),
    ],
)
def test_wrong_values(read, line, words):
    with pytest.raises(CaseError, match=rf"a\.cfg:1: .*{words}"):
        read(line)


def test_settings_of_data_reduction_are_checked_even_without_it(read):
    case = read("DATA_REDUCTION= NO\nGAMMA= 3\nLVL_SIZE= 16\nDATA_RED_TOLERANCE= 2e-3")
    assert case.reduction is None
    (said,) = case.warnings
    assert str(said).endswith("a.cfg: DATA_REDUCTION= NO does not use DATA_RED_TOLERANCE, GAMMA")
    assert said.level == "note"
    assert read("GAMMA= 3\nLVL_SIZE= 4\nDATA_REDUCTION= YES").reduction == Reduction(
        gamma=3.0, level_size=4
    )
    with pytest.raises(CaseError, match="GAMMA: -1 is out of range"):
        read("DATA_REDUCTION= NO\nGAMMA= -1")


@pytest.mark.parametrize("text", ["( )", "()", "NONE", "( none )"])
def test_empty_lists(read, text):
    assert read(f"MARKER_INTERNAL= {text}").roles == {}


@pytest.mark.parametrize("text", ["(A, B)", "( A B )", "A, B", "A B", "(A,B,)", '("A", B)'])
def test_lists_with_commas_or_spaces(read, text):
    assert read(f"MARKER_FIXED= {text}").roles == {"A": "fixed", "B": "fixed"}


def test_names_between_quotes(read):
    case = read('MARKER_FIXED= ( "tip #2, upper", "NONE", "5", "a""b", "x\\" )')
    assert case.markers_with("fixed") == ("tip #2, upper", "NONE", "5", 'a"b', "x\\")


def test_periodic_markers_as_su2_writes_them(read):
    case = read(
        "STEPS= 2\nMARKER_PERIODIC= (A, B, 0,0,0, 0,0,30.0, 0,0,0, C, D, 1,2,3,4,5,6,7,8,9)"
    )
    assert case.markers_with("periodic") == ("A", "B", "C", "D")
    assert len(case.warnings) == 1
    assert "a.cfg:2: MARKER_PERIODIC: the numbers after the names are not used" in case.warnings[0]


def test_names_that_are_numbers(read):
    case = read("MARKER_PERIODIC= (1, 2)\nMARKER_FIXED= (3 4)")
    assert case.roles == {"1": "periodic", "2": "periodic", "3": "fixed", "4": "fixed"}
    assert case.warnings == ()


def test_a_marker_has_one_role(read):
    with pytest.raises(CaseError) as caught:
        read("MARKER_FIXED= (A, B, C)\nMARKER_MOVING= (A)\nMARKER_INTERNAL= (B)\nSTEPS= 1")
    lines = [line.rpartition("a.cfg:")[2] for line in str(caught.value).splitlines()]
    end = "a marker has one role: take it out of one of the lists"
    assert lines == [
        f"2: MARKER_MOVING: marker 'A' is in MARKER_FIXED too, line 1; {end}",
        f"3: MARKER_INTERNAL: marker 'B' is in MARKER_FIXED too, line 1; {end}",
    ]


def test_markers_in_the_boundary_only_slide_wherever_the_line_stands(read):
    case = read("MARKER_BDRY= (A, B, C, D)\nMARKER_MOVING= (B)\nMARKER_PERIODIC= (C, D)")
    assert case.roles == {"A": "sliding", "B": "moving", "C": "periodic", "D": "periodic"}


@pytest.mark.parametrize(
    ("word", "given", "kind", "direction"),
    [
        ("0", "auto", "auto", 0),
        ("x", "auto", "translational", 0),
        ("Y", "0", "translational", 1),
        ("z", "auto", "auto", 2),
        ("z", "0", "translational", 2),
        ("theta", "auto", "rotational", 1),
        ("1", "1", "rotational", 1),
    ],
)
def test_periodic_direction(read, word, given, kind, direction):
    case = read(f"PERIODIC_DIRECTION= {word}\nPERIODIC_TYPE= {given}")
    assert (case.direction, case.periodic_type) == (direction, kind)


@pytest.mark.parametrize(
    ("word", "given", "words"),
    [
        ("x", "1", "x is a direction of translational periodicity, and PERIODIC_TYPE= rotational"),
        ("theta", "0", "theta is a direction of rotational periodicity, and PERIODIC_TYPE= tr"),
        ("0", "1", r"rotational periodicity repeats in theta, not in r \(PERIODIC_DIRECTION= 0\)"),
        ("2", "1", "repeats in theta, not in z .*; write theta, or PERIODIC_TYPE= translational"),
        ("z", "1", "repeats in theta, not in z"),
        ("r", "auto", "repeats in theta, not in r"),
    ],
)
def test_wrong_periodic_direction(read, word, given, words):
    with pytest.raises(CaseError, match=rf"a\.cfg:2: .*{words}"):
        read(f"PERIODIC_TYPE= {given}\nPERIODIC_DIRECTION= {word}")


def test_no_follow_up_error_when_the_moving_markers_are_not_readable(read):
    with pytest.raises(CaseError) as caught:
        read("MARKER_MOVING= (BLADE\nMOTION= (BLADE, translate, 1, 0)")
    assert "a bracket" in str(caught.value)
    assert "does not move" not in str(caught.value)


def test_overwriting_the_mesh_is_warned_of(read):
    case = read("MESH_FILENAME= a.su2\nMESH_OUT_FILENAME= ./b/../a.su2")
    assert len(case.warnings) == 1
    assert "the undeformed mesh would be overwritten" in case.warnings[0]


def test_windows_paths(read, tmp_path):
    case = read('MESH_FILENAME= meshes\\fine\\wing 2.su2 \nDEFORMATION_FILENAME= "m\\d.txt"')
    assert case.mesh_file == tmp_path / "meshes" / "fine" / "wing 2.su2"
    assert case.motions == (FromFile(tmp_path / "m" / "d.txt"),)


class TestSetKey:
    def test_plain(self):
        assert set_key(Case(), "steps", " 7 ") == Case(steps=7)

    def test_a_list_replaces_the_list_and_takes_markers_from_others(self):
        case = Case(roles={"A": "moving", "B": "fixed", "C": "sliding"})
        changed = set_key(case, "MARKER_MOVING", "(B)")
        assert changed.roles == {"B": "moving", "C": "sliding"}
        assert set_key(case, "MARKER_MOVING", "( )").roles == {"B": "fixed", "C": "sliding"}

    def test_boundary_leaves_other_roles(self):
        case = set_key(Case(roles={"A": "moving"}), "MARKER_BDRY", "(A, B)")
        assert case.roles == {"A": "moving", "B": "sliding"}

    def test_motions_and_file(self):
        case = Case(roles={"A": "moving"}, motions=(Translate("A", (1.0, 0.0)),))
        case = set_key(case, "DEFORMATION_FILENAME", "d.txt")
        assert [type(m) for m in case.motions] == [FromFile, Translate]
        assert case.motions[0].path.as_posix() == "d.txt"
        case = set_key(case, "MOTION", "(A, translate, 2, 0)")
        assert case.motions[1:] == (Translate("A", (2.0, 0.0)),)
        case = set_key(case, "DEFORMATION_FILENAME", "other.txt")
        assert len(case.motions) == 2
        case = set_key(case, "DEFORMATION_FILENAME", "NONE")
        assert case.motions == (Translate("A", (2.0, 0.0)),)

    def test_data_reduction_comes_and_goes(self):
        case = set_key(set_key(Case(), "DATA_REDUCTION", "YES"), "GAMMA", "3")
        assert case.reduction == Reduction(gamma=3.0)
        assert set_key(case, "DATA_REDUCTION", "YES").reduction == case.reduction
        assert set_key(case, "DATA_REDUCTION", "NO") == Case(reduction=None)
        assert set_key(case, "DATA_REDUCTION", "AUTO").reduction == Reduction(gamma=3.0, auto=True)
        assert set_key(Case(), "DATA_REDUCTION", "auto") == Case()

    def test_settings_of_data_reduction_need_it(self):
        with pytest.raises(CaseError, match="--set GAMMA=5: it needs DATA_REDUCTION= YES; set tha"):
            set_key(Case(reduction=None), "GAMMA", "5")

    @pytest.mark.parametrize(("word", "selection"), [("YES", "double"), ("NO", "one")])
    def test_double_edge_is_a_selection(self, word, selection):
        case = set_key(set_key(Case(), "DATA_REDUCTION", "YES"), "DOUBLE_EDGE", word)
        assert case.reduction == Reduction(selection=selection)
        assert set_key(case, "SELECTION", "block").reduction == Reduction()

    def test_remark(self):
        case = set_key(Case(), "MARKER_PERIODIC", "(A, B, 0,0,0, 0,0,0, 0,1,0)")
        assert case.warnings[0].startswith("--set MARKER_PERIODIC=(A, B")

    @pytest.mark.parametrize(
        ("key", "value", "words"),
        [
            ("STEP", "1", "--set STEP=1: unknown key 'STEP'; did you mean STEPS?"),
            ("STEPS", "0", "--set STEPS=0: 0 is too small; expected a whole number from 1"),
            ("MOTION", "(A)", "--set MOTION=(A): motion 1: expected a marker and one of"),
        ],
    )
    def test_wrong(self, key, value, words):
        with pytest.raises(CaseError) as caught:
            set_key(Case(), key, value)
        assert str(caught.value).startswith(words)


def test_a_mistyped_key_or_two_roles_tell_no_more_than_that(read):
    motion = "MOTION= (A, translate, 1, 0) ; (A, translate, 0, 1)"
    with pytest.raises(CaseError) as caught:
        read(f"FFD_DEFINITION= (B{', 0.0' * 24})\nFFD_DEGRE= (1, 1, 0)")
    assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(CaseError) as caught:
        read(f"MARKER_MOVNG= (A)\n{motion}")
    assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(CaseError) as caught:
        read(f"MARKER_MOVING= (A)\nMARKER_SLIDING= (A)\n{motion}")
    assert len(str(caught.value).splitlines()) == 1
    # Whether MOTION or MARKER_MOVING is wrong, the mesh tells (`check_case`).
    assert len(read(f"MARKER_MOVING= (B)\n{motion}").motions) == 2


def test_a_key_that_the_method_panel_shows_has_what_its_field_needs():
    shown = [key for key in KEYS.values() if key.form]
    assert len({key.field for key in shown}) == len(shown) > 10
    for key in shown:
        assert key.label, key.name
        assert key.kind.entry != "text", key.name
        assert key.default != "not set", f"{key.name}: a field cannot show nothing"
        assert (key.tip or key.meaning).endswith("."), key.name


def test_a_kind_says_why_a_text_is_no_value_and_what_the_window_calls_one():
    assert KEYS["GAMMA"].kind.problem("25") == ""
    assert KEYS["GAMMA"].kind.problem("-1") == "-1 is out of range; expected a number above 0"
    for name, text, called in (
        ("SLIDING_MODE", "PS", "pseudo sliding"),
        ("PERIODIC_TYPE", "1", "rotational"),
        ("RBF_KERNEL", "gaussian", "Gaussian (global)"),
        ("DATA_REDUCTION", "YES", "on"),
        ("STEPS", "auto", "automatic"),
        ("STEPS", "3", "3"),
        ("METHOD", "magic", "magic"),
    ):
        assert KEYS[name].kind.value_label(text) == called


AUTO = "DATA_REDUCTION= AUTO"


@pytest.mark.parametrize(
    ("name", "case", "reason"),
    [
        ("RBF_KERNEL", Case(method="idw"), "inverse distance weighting does not use it"),
        ("IDW_POWER", Case(), "RBF interpolation does not use it"),
        ("IDW_POWER", Case(method="elastic"), "linear elasticity does not use it"),
        ("GAMMA", Case(method="elastic"), "linear elasticity does not use it"),
        ("GAMMA", Case(reduction=None), "data reduction is off"),
        ("GAMMA", Case(), ""),
        ("DATA_RED_TOLERANCE", Case(), f"{AUTO} finds the tolerance; YES uses this one"),
        ("DATA_RED_TOLERANCE", Case(reduction=Reduction()), ""),
        ("LVL_SIZE", Case(reduction=Reduction()), "there are no levels"),
        ("LVL_SIZE", Case(reduction=Reduction(multilevel=True)), ""),
        ("PERIODIC_AXIS", Case(), "no boundary has the role “periodic”"),
        ("SLIDING_MODE", Case(roles={"hub": "sliding"}), ""),
        ("STEPS", Case(method="idw"), ""),
    ],
)
def test_a_key_says_why_it_does_nothing_in_a_case(name, case, reason):
    assert KEYS[name].idle(case) == reason


@pytest.mark.parametrize("name", [key.name for key in KEYS.values() if key.switch(Case())])
def test_a_setting_whose_switch_is_off_is_told(name):
    key = KEYS[name]
    value = {"whole": 7, "real": 0.375, "switch": True}.get(key.kind.entry)
    if key.kind.entry == "choice":
        value = next(k for k in key.kind.words if key.kind.write(k) != key.default)
    if name in ("FFD_DEGREE", "FFD_BSPLINE_ORDER", "FFD_AXIS"):
        value = ((3, 3, 0),) if name == "FFD_DEGREE" else (3, 2, 4)
    case = key.put(Case(), value)
    (said,) = idle_settings(case)
    assert str(said).startswith(name)
    assert key.switch(case) in str(said)
    assert said.level == "note"


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("LAYERS= YES", "keep"),
        ("LAYERS= OFF", "no"),
        ("RELAX= KEEP", "yes"),
        ("RIMS= NO", "free"),
        ("RIMS= TRUE", "slide"),
        ("SLIDING_MODE= NO", "none"),
    ],
)
def test_words_that_switch_have_the_value_that_is_meant(line, meant, tmp_path):
    (tmp_path / "case.cfg").write_text(f"MESH_FILENAME= mesh.su2\nMARKER_MOVING= ( w )\n{line}\n")
    with pytest.raises(CaseError, match=f"did you mean {meant}\\?"):
        Case.read(tmp_path / "case.cfg")
