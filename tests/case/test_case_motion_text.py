"""The grammar of MOTION."""

import re
from pathlib import Path

import pytest

from slideviz.case.motion_text import GRAMMAR, read_motions, write_motions
from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
from slideviz.case.motions.box import Ffd
from slideviz.case.motions.file import FromFile, Prescribed
from slideviz.case.motions.kinds import KIND_OF, KINDS
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.errors import CaseError

KNOWN = {*KIND_OF, "centroid", "path", "upper", "lower", "a", "stl", "z"}
"""Words of examples that are no numbers."""
X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("text", "motion"),
    [
        ("(B, translate, 1, -2)", Translate("B", (1.0, -2.0))),
        ("( B translate 1 2 3e-1 )", Translate("B", (1.0, 2.0, 0.3))),
        ("(B, translate, (1, 2, 3))", Translate("B", (1.0, 2.0, 3.0))),
        ("(B, rotate, 5, centroid)", Rotate("B", 5.0, "centroid", Z)),
        ("(B, ROTATE, 5, Centroid)", Rotate("B", 5.0, "centroid", Z)),
        ("(B, rotate, 5, 1, 2)", Rotate("B", 5.0, (1.0, 2.0), Z)),
        ("(B, rotate, 5, (1, 2))", Rotate("B", 5.0, (1.0, 2.0), Z)),
        ("(B, rotate, 5, x, centroid)", Rotate("B", 5.0, "centroid", X)),
        ("(B, rotate, 5, X, 1, 2, 3)", Rotate("B", 5.0, (1.0, 2.0, 3.0), X)),
        ("(B, rotate, 5, 1, 0, 0, centroid)", Rotate("B", 5.0, "centroid", X)),
        ("(B, rotate, 5.0, 1, 0, 0, 1, 2, 3)", Rotate("B", 5.0, (1.0, 2.0, 3.0), X)),
        ("(B, rotate, 5.0, (1, 0, 0), (1, 2, 3))", Rotate("B", 5.0, (1.0, 2.0, 3.0), X)),
        ("(B, rotate, 5, z, 1, 2)", Rotate("B", 5.0, (1.0, 2.0), Z)),
        ("(B, scale, 1.1, centroid)", Scale("B", (1.1,))),
        ("(B, scale, 1, 2, 3, centroid)", Scale("B", (1.0, 2.0, 3.0))),
        ("(B, scale, 2, 0, 1)", Scale("B", (2.0,), (0.0, 1.0))),
        ("(B, scale, 2, (0, 1))", Scale("B", (2.0,), (0.0, 1.0))),
        ("(B, scale, 2, (0, 1, 2))", Scale("B", (2.0,), (0.0, 1.0, 2.0))),
        ("(B, scale, 2, 3, (0, 1))", Scale("B", (2.0, 3.0), (0.0, 1.0))),
        ("(B, scale, (2, 3), (0, 1))", Scale("B", (2.0, 3.0), (0.0, 1.0))),
        ("(B, scale, 2, 3, 4, 0, 1, 2)", Scale("B", (2.0, 3.0, 4.0), (0.0, 1.0, 2.0))),
        ("(B, stagger, -2)", SpanMotion("B", "stagger", (0.0,), (-2.0,))),
        ("(B, TWIST, 0:0 0.5:1.5, 1:4)", SpanMotion("B", "twist", (0, 0.5, 1), (0, 1.5, 4))),
        ("((A, B), camber, 0.5:.1)", SpanMotion(("A", "B"), "camber", (0.5,), (0.1,))),
        (
            "(*, chord, 0:1, 1:1.1, (1, 2, 3))",
            SpanMotion("", "chord", (0.0, 1.0), (1.0, 1.1), (1.0, 2.0, 3.0)),
        ),
        ("(B, radial, 1.03, 0, 1, 2)", Radial("B", 1.03, 0.0, Z, (1.0, 2.0))),
        ("(B, radial, 1, -0.5, (1, 2))", Radial("B", 1.0, -0.5, Z, (1.0, 2.0))),
        ("(B, radial, 1.03, 0, x, (1, 2, 3))", Radial("B", 1.03, 0.0, X, (1.0, 2.0, 3.0))),
        ("(B, radial, 1.1, 0, (1, 0, 0), (1, 2, 3))", Radial("B", 1.1, 0.0, X, (1.0, 2.0, 3.0))),
        ("(B, ffd, BOX, 2, 1, 0, 0, 0.1, 0)", Ffd("B", "BOX", (2, 1, 0), (0.0, 0.1, 0.0))),
        ('(*, ffd, "my box", -1, 1, 0, 1, 2, 3)', Ffd("", "my box", (-1, 1, 0), (1.0, 2.0, 3.0))),
        ("(B, ffd, BOX, 2, 1, 0.5, -1)", Ffd("B", "BOX", (2, 1, -1), (0.5, -1.0, 0.0))),
        ("(B, ffd, BOX, (2, 1, 0), (0, 1, 0))", Ffd("B", "BOX", (2, 1, 0), (0.0, 1.0, 0.0))),
        ("(B, hicks-henne, upper, 0.3, 0.02)", HicksHenne("B", 0.02, 0.3)),
        (
            "(B, Hicks-Henne, LOWER, 0.3, -1e-2, 2, 4)",
            HicksHenne("B", -0.01, 0.3, "lower", (2.0, 4.0)),
        ),
        ("(B, cst, lower, 2, 6, 0.1)", Cst("B", 0.1, (2, 6), "lower")),
        ("(*, cst, upper, 1, 1, 0.1, -1, 1)", Cst("", 0.1, (1, 1), "upper", (-1.0, 1.0))),
        ("(B, bump, 0.5, 0.1, 0.2, 0.9)", Bump("B", 0.1, 0.5, (0.2, 0.9))),
        ("(B, file, a\\b.txt)", FromFile(Path("a/b.txt"), "B")),
        ('(B, file, "my, (file).txt")', FromFile(Path("my, (file).txt"), "B")),
        ("(*, file, b.txt)", FromFile(Path("b.txt"))),
        ("(*, translate, 1, 0)", Translate("", (1.0, 0.0))),
        ("(*, rotate, 5, centroid)", Rotate("", 5.0)),
        ('("*", rotate, 5, centroid)', Rotate("*", 5.0)),
        ("((A, B), rotate, 5, centroid)", Rotate(("A", "B"), 5.0)),
        ("( ( A B ) , scale, 2, (0, 1) )", Scale(("A", "B"), (2.0,), (0.0, 1.0))),
        ('(("A, B", "*"), translate, (1, 2))', Translate(("A, B", "*"), (1.0, 2.0))),
        ("((A, B, C), radial, 1.03, 0, 1, 2)", Radial(("A", "B", "C"), 1.03, 0.0, Z, (1.0, 2.0))),
        ("((A, B), file, b.txt)", FromFile(Path("b.txt"), ("A", "B"))),
        ("((A), translate, 1, 2)", Translate("A", (1.0, 2.0))),
        ('("*", file, b.txt)', FromFile(Path("b.txt"), "*")),
        ('("a b", translate, 0, 0)', Translate("a b", (0.0, 0.0))),
    ],
)
def test_motions(text, motion):
    assert read_motions(text) == (motion,)


@pytest.mark.parametrize("sign", [";", " ; ", ",", " ", ";;"])
def test_sequences(sign):
    first, second = Translate("B", (1.0, 0.0)), Translate("C", (0.0, 1.0))
    assert read_motions(f"(B, translate, 1, 0){sign}(C, translate, 0, 1)") == (first, second)
    assert read_motions(f"(B, translate, 1, 0){sign}") == (first,)


@pytest.mark.parametrize("text", ["NONE", "( )", "()"])
def test_no_motion(text):
    assert read_motions(text) == ()


def test_examples_of_the_reference_are_read():
    for line in GRAMMAR[:-1]:
        text = line.split("  ")[0]
        for word, value in {
            "i, j, k, dx, dy, dz": "0, -1, 1, 1, 2, 3",
            "i, j, dz": "0, 1, 2",
            "j, degrees": "1, 5",
            "dx, dy[, dz]": "1, 2",
            "degrees": "5",
            "px, py[, pz]": "1, 2",
            "path[, limit]": "a.stl, 0.1",
            "SIDE, peak, h[, x0, x1]": "upper, 0.5, 1",
            "SIDE, k, n, h[, x0, x1]": "lower, 1, 2, 1, 0, 1",
            "peak, h, x0, x1": "0.5, 1, 0, 1",
            "px, py, pz": "1, 2, 3",
            "px, py": "1, 2",
            "AXIS": "0, 1, 0",
            "FACTORS": "2",
            "FACTOR": "2",
            "dr": "0.1",
            "VERB, ...": "translate, 1, 2",
        }.items():
            text = text.replace(word, value)
        unknown = {*re.findall(r"[a-z][a-z-]*", text)} - KNOWN
        assert not unknown, f"{line}: a word without a value in the table above"
        assert len(read_motions(text)) == 1, line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("B, translate, 1, 0", r"each motion needs a pair of brackets, e.g. \(BLADE, translate"),
        ("(B, translate, 1, 0) C", "each motion needs a pair of brackets"),
        ("(B, translate, 1, 0))", "each motion needs a pair of brackets"),
        ("(B, translate, 1, 0", "a bracket is not closed; .* needs a backslash at the end"),
        ('(B, file, "a)', "the quotation mark .* is not closed"),
        ("(B)", f"motion 1: expected a marker and one of {', '.join(KIND_OF)}"),
        ("(B, translate, 1, 0) ; ()", "motion 2: expected a marker and one of"),
        ('("", translate, 1, 0)', "motion 1: it does not begin with the name of a marker"),
        ("(B, twist, 0:1, 1)", "'0:1 1' is not a curve over the span; write span:value, e.g. 0:0"),
        ("(B, twist)", "is not a curve over the span"),
        ("(B, twist, 1:2:3)", "is not a curve over the span"),
        ("(B, twist, 0:a)", "'a' is not a number"),
        ("(B, twist, 0.5:1, 0.2:2)", "the spans 0.5, 0.2 do not ascend from 0 .* sort them"),
        ("(B, twist, 0:1, 1.2:2)", "the spans 0, 1.2 do not ascend from 0"),
        ("(B, twist, 0:1, 0:2)", "the spans 0, 0 do not ascend from 0"),
        ("(B, stagger, 0:1, 1:2)", "stagger has one angle .* a curve of them is a twist"),
        ("(B, chord, 0:1, 1:0)", "the chord's factor 0 is not above 0"),
        ("(B, twist, 0:1, (1, 2))", "the point of the stacking line needs three coordinates"),
        ("(B, rotat, 5)", "'rotat' is not one of translate, .*; did you mean rotate?"),
        (
            "((), translate, 1, 0)",
            r"its first brackets are not a list of markers; write \(\(A, B\)",
        ),
        ("(((A), B), translate, 1, 0)", "its first brackets are not a list of markers"),
        ("((A, B, A), translate, 1, 0)", r"\(A, B, A\) names a marker twice; name each once"),
        ("((A, B))", "'' is not one of translate, rotate"),
        ("(B, ffd, BOX)", "expected the box, the control point i, j, k"),
        ("(B, ffd, BOX, 1, 2, 3, 4, 5)", "expected the box, the control point i, j, k"),
        ("(B, ffd, BOX, 1, 2, x, 4, 5, 6)", "'x' is not a number"),
        ("(B, ffd, BOX, 1, -2, 0, 4, 5, 6)", r"invalid control point \(1, -2, 0\); write int"),
        ("(B, ffd, BOX, 1, 0.5, 0, 4, 5, 6)", r"invalid control point \(1, 0.5, 0\); write"),
        ("(B, hicks-henne, upper, 0.5)", "expected hicks-henne, upper, peak, height, or besides"),
        (
            "(B, hicks-henne, lower, 0.3, 0,01)",
            "3 numbers given; expected hicks-henne, lower, peak, .*; decimals are written with a",
        ),
        ("(B, hicks-henne, 0.5, 0.1, 0.2)", "'0.5' is not one of upper | lower"),
        ("(B, hicks-henne, uper, 0.5, 0.1)", "'uper' is not one of .*; did you mean upper?"),
        ("(B, hicks-henne, upper, 1.5, 0.1)", "the peak is at x = 1.5; it must lie between 0 and"),
        ("(B, hicks-henne, upper, 0.5, 0.1, 1, 0)", "the chord goes from x = 1 to 0; give the lo"),
        ("(B, cst, upper, 3, 2, 0.1)", "CST term 3 of 2 is out of range; write whole numbers"),
        ("(B, cst, upper, 1.5, 2, 0.1)", "CST term 1.5 of 2 is out of range; write whole"),
        ("(B, bump, 0.5, 0.1)", "expected bump, peak, height, x0, x1"),
        ("(B, translate, 1)", "the shift has 1 values; expected 2 or 3 numbers"),
        ("(B, translate, 1, 2, 3, 4)", "the shift has 4 values"),
        ("(B, translate, 1, y)", "'y' is not a number"),
        ("(B, rotate)", "the angle is missing; write rotate, angle in degrees, centroid"),
        ("(B, rotate, centroid)", "'centroid' is not a number"),
        ("(B, rotate, nan, centroid)", "'nan' is not a number"),
        ("(B, rotate, 5)", "expected after the angle: the axis"),
        ("(B, rotate, 5, x)", "expected after the angle: the axis"),
        ("(B, rotate, 5, 1, 0, 0)", "expected after the angle: the axis"),
        ("(B, rotate, 5, 1, 0, 0, 1)", "expected after the angle: the axis"),
        ("(B, rotate, 5, 1, centroid)", "expected after the angle"),
        ("(B, rotate, 5, 1, 2, 3, 4, 5, 6, 7)", "expected after the angle: the axis"),
        ("(B, rotate, 5, 0, 0, 0, centroid)", "the axis .* has no direction"),
        ("(B, rotate, 5, w, centroid)", "expected after the angle"),
        ("(B, radial, 1.03)", "expected the factor of the radius, the distance, the axis"),
        ("(B, radial, 1.03, 0, z, (0, 0))", "and a point on it; in 2D no axis"),
        ("(B, radial, 1.03, 0, 0, 0, 0)", "and a point on it; in 2D no axis"),
        ("(B, radial, 0, 1, (0, 0))", "the factor 0 is not above 0: it would fold the marker"),
        ("(B, scale, 2)", "expected one factor .* put the point in brackets"),
        ("(B, scale)", "expected one factor or one for each axis"),
        ("(B, scale, centroid)", "0 factors are given; expected one, or one for each axis"),
        ("(B, scale, 2, 3, 0, 1)", r"put the point in brackets: scale, 1.1, \(0, 0, 0\)"),
        ("(B, scale, 1, 2, 3, 4, centroid)", "4 factors are given"),
        ("(B, scale, (0, 1))", "0 factors are given"),
        ("(B, scale, -2, centroid)", "the factor -2 is not above 0: it would fold the marker"),
        ("(B, file)", "expected .MARKER, file, path.; a path with spaces, .* needs quotes"),
        ("(B, file, a b.txt)", "a path with spaces, commas or brackets needs quotes"),
        ('(B, file, "")', "expected .MARKER, file, path."),
    ],
)
def test_wrong_motions(text, words):
    with pytest.raises(CaseError, match=words):
        read_motions(text)


def test_all_wrong_motions_at_once():
    with pytest.raises(CaseError) as caught:
        read_motions("(B) ; (B, translate, 1, 0) ; (B, scale)")
    assert [line.split(":")[0] for line in str(caught.value).splitlines()] == [
        "motion 1",
        "motion 3",
    ]


def test_displacements_of_a_program_cannot_be_written():
    with pytest.raises(CaseError, match="cannot be written to a case file; write them to a disp"):
        write_motions((Prescribed([0], [[1.0, 0.0]]),))


def test_a_word_of_a_motions_grammar_has_one_meaning_in_all_kinds():
    """A design's column may be named by it: ``BLADE.rotate.angle``."""
    meanings: dict[str, set[str]] = {}
    for kind in KINDS:
        for word, name in kind.words:
            meanings.setdefault(word, set()).add(name)
    assert all(len(names) == 1 for names in meanings.values()), meanings
