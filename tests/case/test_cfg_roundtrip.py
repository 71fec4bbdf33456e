"""What is written reads back without loss, or is not written at all."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slideviz.case.cfg import write_case
from slideviz.case.model import Case
from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness, FfdTwist
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.kinds import KINDS
from slideviz.case.motions.onto import Onto
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.case.moving_nodes import displacement_of
from slideviz.case.values import MAX_STEPS
from slideviz.errors import CaseError
from slideviz.rbf.reduction import Reduction
from slideviz.terms import FFD_BLENDINGS, PERIODIC_MODES, ROLES, SIDES, SLIDING, SPAN_KINDS

finite = st.floats(-1e50, 1e50)
angle = st.floats(-1e9, 1e9)
positive = st.floats(0, 1e50, exclude_min=True)
text = st.text(
    st.characters(codec="utf-8", exclude_characters="\n\r\0"), min_size=1, max_size=12
) | st.sampled_from(
    ["A", "NONE", "none", "5", "1e3", "*", "(", "a b", 'q"q', "50%", "x\\", "centroid"]
)
point = st.just("centroid") | st.tuples(finite, finite) | st.tuples(finite, finite, finite)
axis = st.tuples(finite, finite, finite).filter(any)
whole = st.integers(1, 999_999_999)
index = st.tuples(*[st.integers(-1, 99)] * 3)
degrees = st.tuples(*[st.integers(0, 99)] * 3)
box = st.tuples(text, st.tuples(*[finite] * 24))
boxes = st.lists(box, max_size=2, unique_by=lambda named: named[0]).map(tuple)


def is_file_name(name: str) -> bool:
    return "/" not in name and "\\" not in name and name not in (".", "..") and len(name) < 100


names = text.filter(is_file_name)


def motions_of(marker: st.SearchStrategy[str], path: st.SearchStrategy[Path]):
    factors = st.lists(positive, min_size=1, max_size=3).map(tuple)
    several = st.lists(marker, min_size=2, max_size=4).map(dict.fromkeys).map(tuple)
    marker = marker | several.filter(lambda found: len(found) > 1) | st.just("")
    three = st.tuples(finite, finite, finite)
    vector = st.tuples(finite, finite) | three
    side = st.sampled_from(list(SIDES))
    peak = st.floats(0, 1, exclude_min=True, exclude_max=True)
    chord = st.lists(finite, min_size=2, max_size=2, unique=True).map(sorted).map(tuple)
    term = st.lists(st.integers(1, 100), min_size=2, max_size=2).map(sorted).map(tuple)
    number = st.integers(-1, 99)
    column = marker, text, st.tuples(number, number), finite
    kinds = {
        Translate: st.builds(Translate, marker, vector),
        Rotate: st.builds(Rotate, marker, angle, point, axis),
        Scale: st.builds(Scale, marker, factors, point),
        Radial: st.builds(Radial, marker, positive, finite, axis, three)
        | st.builds(Radial, marker, positive, finite, point=st.tuples(finite, finite)),
        HicksHenne: st.builds(HicksHenne, marker, finite, peak, side, chord),
        Cst: st.builds(Cst, marker, finite, term, side, chord),
        Bump: st.builds(Bump, marker, finite, peak, chord),
        Ffd: st.builds(Ffd, marker, text, index, three),
        FfdCamber: st.builds(FfdCamber, *column),
        FfdThickness: st.builds(FfdThickness, *column),
        FfdTwist: st.builds(FfdTwist, marker, text, number, angle, three, axis),
        SpanMotion: curves(marker),
        FromFile: st.builds(FromFile, path, marker),
        Onto: st.builds(Onto, path, marker, st.just(0.0) | positive),
    }
    assert {*kinds} == {*KINDS}
    return st.one_of(*kinds.values())


@st.composite
def curves(draw: st.DrawFn, marker) -> SpanMotion:
    kind = draw(st.sampled_from(list(SPAN_KINDS)))
    spans = draw(st.lists(st.floats(0, 1), min_size=1, max_size=4, unique=True))
    spans = tuple(sorted(spans if kind != "stagger" else spans[:1]))
    value = {"chord": positive, "twist": angle, "stagger": angle}.get(kind, finite)
    values = st.tuples(*[value] * len(spans))
    three = st.tuples(finite, finite, finite)
    return SpanMotion(draw(marker), kind, spans, draw(values), draw(st.none() | three))


reductions = st.builds(
    Reduction,
    positive,
    st.booleans(),
    st.sampled_from(["size", "tol"]),
    st.floats(0, 1, exclude_min=True, exclude_max=True),
    whole,
    st.sampled_from(["block", "double", "one"]),
    st.none() | positive,
    st.none() | whole,
    positive,
)


@st.composite
def cases(draw: st.DrawFn, folder: Path) -> Case:
    path = st.lists(names, min_size=1, max_size=2).map(lambda parts: folder.joinpath(*parts))
    roles = draw(st.dictionaries(text, st.sampled_from(list(ROLES)), max_size=5))
    moving = [name for name, role in roles.items() if role == "moving"]
    motions = ()
    if moving:
        motion = motions_of(st.sampled_from(moving), path)
        motions = tuple(draw(st.lists(motion, max_size=4)))
    kind, direction = draw(
        st.sampled_from(
            [("auto", None), ("auto", 2), ("translational", 0), ("rotational", 1), ("auto", 1)]
        )
    )
    defined = draw(boxes)
    return Case(
        mesh_file=draw(st.none() | path),
        mesh_out=draw(st.none() | path),
        zone=draw(st.none() | whole),
        roles=roles,
        motions=motions,
        ffd_boxes=defined,
        ffd_degrees=tuple(draw(degrees) for _ in defined),
        ffd_blending=draw(st.sampled_from(list(FFD_BLENDINGS))),
        ffd_orders=draw(st.tuples(*[st.integers(1, 99)] * 3)),
        sliding=draw(st.sampled_from(list(SLIDING))),
        periodic=draw(st.sampled_from(list(PERIODIC_MODES))),
        periodic_type=kind,
        direction=direction,
        axis=draw(axis),
        origin=draw(st.tuples(finite, finite, finite)),
        feature_angle_deg=draw(st.floats(0, 180, exclude_min=True)),
        curved=draw(st.booleans()),
        steps=draw(st.integers(1, MAX_STEPS)),
        influence_factor=draw(st.floats(1e-6, 1e6, exclude_min=True, exclude_max=True)),
        reduction=draw(st.none() | reductions),
        quality_metric=draw(st.sampled_from(["knupp", "rbf-slide"])),
        generate_quality=draw(st.booleans()),
    )


@settings(max_examples=70, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_read_gives_back_what_was_written(data, tmp_path):
    case = data.draw(cases(tmp_path / "deep" / "down"))
    folder = data.draw(st.sampled_from(["", "deep", "deep/down", "elsewhere"]))
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    path = tmp_path / folder / "a.cfg"
    write_case(path, case)
    again = Case.read(path)
    assert repr(again.change(source=None, warnings=(), roles={})) == repr(case.change(roles={}))
    assert again.roles == case.roles
    assert [again.markers_with(role) for role in ROLES] == [
        case.markers_with(role) for role in ROLES
    ]
    # And the text is settled: a second round changes nothing.
    first = path.read_bytes()
    write_case(path, again)
    assert path.read_bytes() == first


@given(st.lists(motions_of(text, names.map(Path)), max_size=5).map(tuple))
def test_motions_read_back_to_the_bit(motions):
    assert repr(read_motions(write_motions(motions).replace("\\\n", " "))) == repr(motions)


def test_a_saved_motion_moves_points_to_the_same_bits(tmp_path):
    motions = (Rotate("A", 1 / 3, (0.1, 0.7), (0.0, 0.0, 1.0)), Translate("A", (0.1 + 0.2, 1e-300)))
    case = Case(roles={"A": "moving"}, motions=motions)
    case.write(tmp_path / "a.cfg")
    points = np.random.default_rng(7).random((50, 2))
    again = Case.read(tmp_path / "a.cfg").motions
    found = displacement_of(again, points)
    assert found.tobytes() == displacement_of(motions, points).tobytes()


def test_paths_are_written_relative_and_survive_a_move(tmp_path):
    (tmp_path / "old" / "cases").mkdir(parents=True)
    mesh = tmp_path / "old" / "meshes" / "wing.su2"
    write_case(tmp_path / "old" / "cases" / "a.cfg", Case(mesh_file=mesh))
    assert "MESH_FILENAME= ../meshes/wing.su2\n" in (tmp_path / "old/cases/a.cfg").read_text()
    (tmp_path / "old").rename(tmp_path / "new")
    assert Case.read(tmp_path / "new/cases/a.cfg").mesh_file == tmp_path / "new/meshes/wing.su2"


def test_files_far_away_are_written_with_their_full_path(tmp_path):
    mesh = Path("/nowhere/near/wing.su2")
    write_case(tmp_path / "a.cfg", Case(mesh_file=mesh))
    assert "MESH_FILENAME= /nowhere/near/wing.su2\n" in (tmp_path / "a.cfg").read_text()
    assert Case.read(tmp_path / "a.cfg").mesh_file == mesh


def test_paths_relative_to_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    write_case(Path("sub/a.cfg"), Case(mesh_file=Path("wing.su2")))
    assert "MESH_FILENAME= ../wing.su2\n" in Path("sub/a.cfg").read_text()
    assert Case.read(Path("sub/a.cfg")).mesh_file == Path("wing.su2")


def test_links_lead_to_the_right_file(tmp_path):
    """``link/..`` is the folder of the link's target, also for the reader."""
    (tmp_path / "real" / "cases").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "real" / "cases")
    mesh, decoy = tmp_path / "real" / "m.su2", tmp_path / "m.su2"
    for file in (mesh, decoy):
        file.write_text(file.as_posix())
    write_case(tmp_path / "link" / "a.cfg", Case(mesh_file=mesh, mesh_out=decoy))
    case = Case.read(tmp_path / "link" / "a.cfg")
    assert case.mesh_file is not None
    assert case.mesh_out is not None
    assert case.mesh_file.read_text() == mesh.as_posix()
    assert case.mesh_out.read_text() == decoy.as_posix()


@pytest.mark.parametrize(
    ("case", "words"),
    [
        (Case(roles={"a\nb": "moving"}), r"MARKER_MOVING: 'a\\nb' cannot be written .* line break"),
        (Case(roles={"": "fixed"}), "MARKER_FIXED: an empty name cannot be written"),
        (Case(roles={"a\udcff": "fixed"}), "it is not UTF-8; rename it"),
        (Case(mesh_file=Path("a\\b.su2")), r"MESH_FILENAME: .* it has a backslash; rename it"),
        (
            Case(roles={"A": "moving"}, motions=(Translate("A", (1.0,)), Scale("A", (0.0,)))),
            r"motion 1: the shift has 1 values(.|\n)*motion 2: the factor 0 is not above 0",
        ),
        (Case(view={"VIEW": 3}), "a case file cannot hold some of its values; check points"),
    ],
)
def test_what_cannot_be_read_back_is_not_written(tmp_path, case, words):
    path = tmp_path / "a.cfg"
    path.write_text("old")
    with pytest.raises(CaseError, match=rf"a\.cfg: cannot be written: (.|\n)*{words}"):
        write_case(path, case)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.cfg"]  # noqa: PTH208


def test_missing_folder(tmp_path):
    with pytest.raises(CaseError, match=r"a\.cfg: cannot be written: the folder does not exist"):
        write_case(tmp_path / "no" / "a.cfg", Case())


def test_long_motions_stand_one_in_a_line(tmp_path):
    motions = (Translate("A", (1.0, 2.0)), Rotate("A", 5.0), Scale("A", (2.0,), (0.0, 1.0)))
    write_case(tmp_path / "a.cfg", Case(roles={"A": "moving"}, motions=motions))
    assert (
        "MOTION= (A, translate, 1.0, 2.0) ; \\\n"
        "    (A, rotate, 5.0, centroid) ; \\\n"
        "    (A, scale, 2.0, (0.0, 1.0))\n"
    ) in (tmp_path / "a.cfg").read_text()
