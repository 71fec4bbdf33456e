"""Lines, comments, encodings: what a case file looks like, and files that are none."""

import codecs
import re
from pathlib import Path

import pytest

from slideviz.case.model import Case
from slideviz.errors import CaseError

EXAMPLE = """\
% ----- INPUT/ OUTPUT FILENAMES -----
MESH_FILENAME = 25x25.su2
MESH_OUT_FILENAME = 25x25_def.su2
DEFORMATION_FILENAME = 25x25_deformation.txt
GENERATE_QUALITY = YES
MARKER_BDRY = (LEFT, RIGHT, UPPER, LOWER, BLOCK)
MARKER_MOVING = (BLOCK)
MARKER_INTERNAL = ( )
PERIODIC_TYPE = 0
% Translational: x = 0, y = 1, z = 2, or Rotational: r = 0, theta = 1, z = 2
PERIODIC_DIRECTION = 1
CURVED = NO
SLIDING_MODE = ps
PERIODIC_MODE = none
STEPS = 1
INFLUENCE_FACTOR = 2.5
DATA_REDUCTION = YES
DATA_RED_TOLERANCE = 1e-3
MULTILEVEL = NO
MULTI_CRIT = size
LVL_TOL_CRIT = 0.5
LVL_SIZE = 16
$ Apply double edge control node selection (NO, Yes)
DOUBLE_EDGE = Yes
$ Greedy correction factor, Correction radius = GAMMA * max error
GAMMA = 25
"""


def test_the_example_of_rbf_slide_reads_unchanged(read, tmp_path):
    case = read(EXAMPLE)
    assert case.mesh_file == tmp_path / "25x25.su2"
    assert case.mesh_out == tmp_path / "25x25_def.su2"
    assert [m.path for m in case.motions] == [tmp_path / "25x25_deformation.txt"]
    assert case.roles == {
        **dict.fromkeys(("LEFT", "RIGHT", "UPPER", "LOWER"), "sliding"),
        "BLOCK": "moving",
    }
    assert (case.sliding, case.periodic, case.periodic_type) == ("ps", "none", "translational")
    assert (case.direction, case.steps, case.influence_factor) == (1, 1, 2.5)
    assert case.reduction is not None
    assert (case.reduction.tolerance, case.reduction.level_size) == (1e-3, 16)
    assert (case.reduction.selection, case.reduction.multilevel) == ("double", False)
    assert case.warnings == ()


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    "encode",
    [
        str.encode,
        lambda text: codecs.BOM_UTF8 + text.encode(),
        lambda text: text.encode("utf-16"),
        lambda text: codecs.BOM_UTF16_BE + text.encode("utf-16-be"),
    ],
)
def test_line_ends_and_encodings_do_not_matter(read, end, encode):
    text = "MARKER_MOVING= ( Flügel )\nSTEPS= 7\nCURVED= YES"
    plain = read(text)
    assert (plain.markers_with("moving"), plain.steps) == (("Flügel",), 7)
    assert read(encode(text.replace("\n", end))) == plain


def test_latin_1_is_read_with_a_warning(read):
    case = read("MARKER_MOVING= (Flügel) % größer".encode("latin-1"))
    assert case.markers_with("moving") == ("Flügel",)
    assert len(case.warnings) == 1
    assert re.search(r"a\.cfg: the file is not UTF-8; it was read as Latin-1", case.warnings[0])


@pytest.mark.parametrize("sign", "%#$")
def test_comments_end_a_line(read, sign):
    case = read(f"{sign} STEPS= 2\nSTEPS= 3 {sign} not 4\n  {sign}\nCURVED=YES{sign}")
    assert (case.steps, case.curved) == (3, True)


def test_keys_and_words_in_any_case_and_spacing(read):
    case = read("  steps=3\nSliding_Mode =DS\nCURVED\t=\tyes\n\n")
    assert (case.steps, case.sliding, case.curved) == (3, "ds", True)


def test_a_backslash_goes_on_in_the_next_line(read):
    case = read("MARKER_FIXED= ( A, \\\n  % the far field\n B, \\ # and\n C )\nSTEPS= 2\n")
    assert case.markers_with("fixed") == ("A", "B", "C")
    assert case.steps == 2


def test_lines_after_a_long_list_keep_their_number(read):
    with pytest.raises(CaseError, match=r"a\.cfg:4: STEPS: 0 is too small"):
        read("MARKER_FIXED= ( A, \\\n B, \\\n C )\nSTEPS= 0\n")


def test_an_empty_line_ends_a_long_list(read):
    with pytest.raises(CaseError, match=r"a\.cfg:1: MARKER_FIXED: a bracket of '\( A,' is missing"):
        read("MARKER_FIXED= ( A, \\\n\n B )\n")


def test_a_backslash_before_a_key_is_told(read):
    match = r"a\.cfg:2: the backslash at the end of the line before joins STEPS to it; take the"
    with pytest.raises(CaseError, match=match):
        read("MESH_FILENAME= meshes\\\nSTEPS= 2\n")


def test_a_backslash_at_the_very_end_is_harmless(read):
    assert read("STEPS= 2 \\").steps == 2
    assert read("STEPS= 2\n\\\n").steps == 2


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "the file is empty; expected a case file"),
        (b"\n \r\n", "the file is empty; expected a case file"),
        (b"% nothing\n", "has no `KEY= value` line; `slideviz keys` lists the keys"),
        (b"STEPS= 2\0", "is a binary file; expected a case file, which is text"),
        (b"NDIME= 2\nNELEM= 24\n", "is an SU2 mesh, not a case file; name it in MESH_FILENAME="),
        (b"NZONE= 2\n", "is an SU2 mesh, not a case file"),
    ],
)
def test_files_that_are_no_case_files(read, data, words):
    with pytest.raises(CaseError, match=rf"a\.cfg: {words}"):
        read(data)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(CaseError, match=r"no\.cfg: there is no such case file; check name"):
        Case.read(tmp_path / "no.cfg")
    with pytest.raises(CaseError, match=r"is a folder; expected a case file"):
        Case.read(tmp_path)


def test_unreadable_file(tmp_path, monkeypatch):
    def fail(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", fail)
    with pytest.raises(CaseError, match=r"a\.cfg: cannot be read: Permission denied"):
        Case.read(tmp_path / "a.cfg")


def test_all_problems_at_once_in_order(read):
    text = "STEP= 1\nCURVED= perhaps\nfoo\nSTEPS= 2\nsteps= 3\nGAMMA=\n"
    with pytest.raises(CaseError) as caught:
        read(text)
    lines = [line.rpartition("a.cfg:")[2] for line in str(caught.value).splitlines()]
    assert lines == [
        "1: unknown key 'STEP'; did you mean STEPS?",
        "2: CURVED: 'perhaps' is not one of YES | NO",
        "3: 'foo' is not `KEY= value`",
        "5: STEPS is in line 4 already; keep one of the two",
        "6: GAMMA: it has no value; expected a number above 0",
    ]


def test_an_unknown_key_far_from_all(read):
    with pytest.raises(CaseError, match=r"a\.cfg:1: unknown key 'QQ'; `slideviz keys` lists all"):
        read("QQ= 1\n")


def test_very_many_problems_are_cut(read):
    with pytest.raises(CaseError) as caught:
        read("STEPS= 1\n" + "foo\n" * 5000)
    lines = str(caught.value).splitlines()
    assert len(lines) == 31
    assert lines[-1].endswith("a.cfg: and 4970 more problems")
