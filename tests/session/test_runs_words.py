"""What sets runs apart, in words: motions, roles, settings, names."""

from dataclasses import replace
from pathlib import Path

import pytest

from slideviz.case.keys import KEYS, METHOD, PERIODICITY, QUALITY, REDUCTION
from slideviz.case.model import Case
from slideviz.case.motion_words import describe, motion_labels
from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness, FfdTwist
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.kinds import KINDS
from slideviz.case.motions.onto import Onto
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.mesh.quality import quality
from slideviz.rbf.reduction import Reduction
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.panes import choices
from slideviz.session.runs_words import run_words, summary
from slideviz.session.state import Run, Session, StepFrame

BASE = Case(roles={"blade": "moving", "in": "sliding"}, motions=(Rotate("blade", 5.0),), steps=3)

SETTINGS = [
    key
    for key in KEYS.values()
    if key.group in (PERIODICITY, METHOD, REDUCTION, QUALITY)
    # DOUBLE_EDGE is another word for SELECTION; of STEPS those that were made are told; the others
    # change nothing of a run.
    and key.name
    not in ("DOUBLE_EDGE", "STEPS", "GENERATE_QUALITY", "CURVED", "PERIODIC_DIRECTION", "LIMITS")
]


def runs_of(*cases):
    return tuple(Run(number, case, end="done") for number, case in enumerate(cases, 1))


def moved(*motions):
    return BASE.change(motions=motions)


def words(*cases):
    runs = runs_of(*cases)
    return [summary(run, runs) for run in runs]


def test_motions_are_told_where_they_differ():
    turned, shifted = moved(Rotate("blade", 5.0)), moved(Translate("blade", (0.0, 0.05)))
    assert words(turned, turned) == ["0 steps"] * 2
    first, second = words(turned, shifted)
    assert first.startswith("rotate +5° · ")
    assert second.startswith("translate y +0.05 · ")


def test_settings_without_effect_tell_no_runs_apart():
    assert words(BASE, BASE.change(curved=True), BASE.change(direction=1)) == ["0 steps"] * 3


@pytest.mark.parametrize(
    ("motion", "label"),
    [
        (Translate("blade", (0.1, 0.05)), "translate (0.1, 0.05)"),
        (Translate("blade", (0.0, 0.0, -2.0)), "translate z -2"),
        (Rotate("blade", -12.5, (1.0, 2.0)), "rotate -12.5°"),
        (Scale("blade", (1.1, 1.1)), "scale 1.1"),
        (Scale("blade", (1.1, 1.0)), "scale 1.1 × 1"),
        (Radial("blade", 1.03), "radially +3 %"),
        (SpanMotion("blade", "stagger", (0.0,), (-2.0,)), "stagger -2°"),
        (SpanMotion("blade", "twist", (0.0, 0.5), (0, 1.5)), "twist 0° at 0 %, 1.5° at 50 % span"),
        (Radial("blade", 1.0, -0.2), "radially -0.2"),
        (FromFile(Path("/far/away/shape.txt"), "blade"), "shape.txt"),
    ],
)
def test_a_motion_in_few_words(motion, label):
    assert motion_labels([BASE, moved(motion)]) == ["rotate +5°", label]


def test_several_motions_are_told_in_their_order():
    both = moved(Rotate("blade", 5.0), Translate("blade", (0.0, 0.05)))
    assert motion_labels([both, BASE])[0] == "rotate +5° + translate y +0.05"
    assert motion_labels([both, moved()])[1] == "no motion"
    # What is the same in all would push the difference out of a narrow list.
    other = moved(Rotate("blade", 5.0), Translate("blade", (0.0, 0.04)))
    assert motion_labels([both, other]) == ["translate y +0.05", "translate y +0.04"]


def test_the_boundary_is_named_where_several_move():
    two = moved(Rotate("blade", 5.0), Translate("flap", (0.0, 0.05)))
    assert motion_labels([two, BASE]) == [
        "blade: rotate +5° + flap: translate y +0.05",
        "blade: rotate +5°",
    ]
    whole = moved(FromFile(Path("all.txt")))
    assert motion_labels([whole, BASE]) == ["all.txt", "rotate +5°"]


ALMOST = [
    (Rotate("blade", 5.0), Rotate("blade", 5.0, (0.0, 1.0))),
    (Rotate("blade", 5.0), Rotate("blade", 5.0, "centroid", (0.0, 1.0, 0.0))),
    (Rotate("blade", 5.0), Rotate("blade", 5.000001)),
    (Scale("blade", (2.0, 2.0)), Scale("blade", (2.0, 2.0), (0.5, 0.0))),
    (Scale("blade", (2.0, 2.0)), Scale("blade", (2.0, 2.0000001))),
    (Radial("blade", 1.03), Radial("blade", 1.03, 0.0, (1.0, 0.0, 0.0))),
    (Radial("blade", 1.03), Radial("blade", 1.0300001)),
    (
        SpanMotion("blade", "lean", (0.0,), (1.0,)),
        SpanMotion("blade", "lean", (0.0,), (1.0,), (1, 2, 3)),
    ),
    (
        SpanMotion("blade", "chord", (0.0,), (1.1,)),
        SpanMotion("blade", "chord", (0.0,), (1.1000001,)),
    ),
    (Translate("blade", (0.1, 0.2)), Translate("blade", (0.1, 0.2000001))),
    (FromFile(Path("a/shape.txt")), FromFile(Path("b/shape.txt"))),
    (Onto(Path("a/shape.stl")), Onto(Path("b/shape.stl"))),
    (Onto(Path("shape.stl")), Onto(Path("shape.stl"), limit=0.1)),
    (HicksHenne("blade", 0.1), HicksHenne("blade", 0.1, 0.5000001)),
    (HicksHenne("blade", 0.1), HicksHenne("blade", 0.1, side="lower")),
    (HicksHenne("blade", 0.1), HicksHenne("blade", 0.1, chord=(0.0, 1.0000001))),
    (Cst("blade", 0.1), Cst("blade", 0.1, (1, 2))),
    (Bump("blade", 0.1), Bump("blade", 0.1000001)),
    (Ffd("blade", "A", (0, 1, 2), (0.0, 0.0, 1.0)), Ffd("blade", "B", (0, 1, 2), (0.0, 0.0, 1.0))),
    (Ffd("blade", "A", (0, 1, 2), (0.0, 0.0, 1.0)), Ffd("blade", "A", (0, 2, 2), (0.0, 0.0, 1.0))),
    (FfdCamber("blade", "A", (0, 1), 1.0), FfdCamber("blade", "A", (0, -1), 1.0)),
    (FfdThickness("blade", "A", (0, 1), 1.0), FfdThickness("blade", "A", (0, 1), 1.0000001)),
    (FfdTwist("blade", "A", 0, 5.0), FfdTwist("blade", "A", 0, 5.0, (1.0, 0.0, 0.0))),
    (FfdTwist("blade", "A", 0, 5.0), FfdTwist("blade", "A", 0, 5.0, axis=(1.0, 0.0, 0.0))),
    (FfdTwist("blade", "A", 0, 5.0), FfdTwist("blade", "A", 1, 5.0)),
]
"""Two motions each that differ in little, or where labels that are not exact have no word for."""


def test_there_are_such_motions_of_every_kind():
    assert {type(one) for one, _ in ALMOST} == {*KINDS}


@pytest.mark.parametrize(("one", "other"), ALMOST)
def test_different_motions_never_read_alike(one, other):
    labels = motion_labels([moved(one), moved(other), moved(Translate("blade", (9.0, 9.0)))])
    assert len(set(labels)) == 3
    assert labels[2] == "translate (9, 9)", "no more words than it takes"


def test_roles_that_differ_are_told():
    fixed = BASE.change(roles={"blade": "moving"})
    assert [text.split(" · ")[0] for text in words(BASE, fixed)] == ["in sliding", "in fixed"]


def test_settings_that_differ_come_before_what_all_have():
    other = BASE.change(periodic="moving", influence_factor=1.5, reduction=Reduction(1e-4))
    same = BASE.change(periodic="moving")
    assert words(other, same)[0].startswith("radius × 1.5 · reduced to 0.0001 · moving vertices · ")
    assert words(other, same)[1].startswith("moving vertices · "), "the usual is not told"
    more = same.change(steps=7)
    first, second = (text.split(" · ") for text in words(same, more))
    assert "step" in first[0]
    assert "step" in second[0]
    assert first[1] == second[1] == "moving vertices"


def test_settings_of_another_method_are_not_told():
    elastic = BASE.change(method="elastic", kernel="gaussian", influence_factor=0.5)
    assert "gaussian" not in words(BASE, elastic)[1]
    assert "radius" not in words(BASE, elastic)[1]


def test_a_run_can_have_a_name_of_its_own():
    session = Session(runs=runs_of(BASE, BASE))
    session = changes.rename_run(session, 2, "  stiff \n blade ")
    plain, named = session.runs
    assert (named.name, plain.name) == ("stiff blade", "")
    assert (run_words(named), run_words(plain)) == ("stiff blade", "no sliding")
    assert summary(named, session.runs).startswith("no sliding · "), "what it is, is told still"
    assert (named.label, plain.label) == ("run 2: stiff blade", "run 1")
    assert (
        replace(named, name="a name of many letters in all").label == "run 2: a name of many lett…"
    )
    assert changes.rename_run(session, 2, "stiff blade") is session
    assert changes.rename_run(session, 9, "nobody") is session
    assert changes.rename_run(session, 2, "").runs[1].label == "run 2"


def test_the_names_of_views_tell_runs_apart(square):
    session = open_mesh(StepFrame(square, quality(square)), None)
    frames = (session.first,)
    runs = (
        Run(1, BASE, frames, "done"),
        Run(2, moved(Rotate("blade", -5.0)), frames, "done", name="back"),
    )
    titles = choices(replace(session, runs=runs))
    assert titles[1].startswith("Run 1: rotate +5° · no sliding · ")
    assert titles[2].startswith("Run 2: back · rotate -5° · no sliding · ")


def test_a_motion_in_full():
    assert describe(Rotate("blade", 5.0, (1.0, 0.5))) == "blade: rotate by 5° about (1, 0.5)"
    assert describe(Scale("blade", (2.0, 1.0))) == "blade: scale by 2 × 1 about its centroid"
    assert describe(FromFile(Path())) == "all moving: displace as in (no file yet)"
    assert describe(Radial("blade", 1.0, 0.0)) == "blade: push radially by +0"
    camber = SpanMotion("blade", "camber", (0.0, 1.0), (0.0, 0.02), (1.0, 0.5, 0.0))
    words = "blade: camber 0 at 0 %, 0.02 at 100 % span about (1, 0.5, 0)"
    assert describe(camber, 3) == words


def other_value(key, case):
    """Return a value of a key that the case does not have."""
    value, kind = key.get(case), key.kind
    texts = {
        "choice": list(kind.words),
        "switch": ["YES", "NO"],
        "real": ["0.250000001", "0.25", "2.5"],
        "whole": ["7", "8"],
        "axis": ["(1.0, 0.0, 1e-9)"],
        "point": ["(1.0, 0.0, 1e-9)"],
        "text": ["( A, B )", "x"],
    }[kind.entry]
    allowed = [text for text in texts if not kind.problem(text)]
    return next(kind.read(text) for text in allowed if kind.read(text) != value)


@pytest.mark.parametrize("key", SETTINGS, ids=lambda key: key.name)
def test_every_setting_that_changes_a_result_tells_runs_apart(key):
    base = BASE.change(
        roles={**BASE.roles, "up": "periodic"},
        method=key.method or "rbf",
        reduction=Reduction(0.25, multilevel=True),
        relax="yes",
        layers="keep",
        repair="yes",
        steps=0 if key.name == "STEPS_GAIN" else 3,  # it counts where steps are found only
    )
    runs = runs_of(base, key.put(base, other_value(key, base)))
    first, second = (f"{run_words(run)}: {summary(run, runs)}" for run in runs)
    assert first != second
