"""Periodicity by hand, names that hint at roles, and small promises to who reads results."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from matplotlib.figure import Figure

from slideviz.case.motions.rigid import Translate
from slideviz.errors import MeshError
from slideviz.formats.files import write
from slideviz.mesh.periodic import find_pairs, pair_up
from slideviz.mesh.quality import quality
from slideviz.plots.figure_io import figure_bytes
from slideviz.session import changes
from slideviz.session.motions import pair_text
from slideviz.session.opening import guess_by_name, open_mesh
from slideviz.session.run_messages import run_requirements, with_field_labels
from slideviz.session.runs_words import best_runs
from slideviz.session.state import Run, StepFrame


@pytest.fixture
def plain(session):
    """A square whose boundaries all stay; opposite sides match each other."""
    mesh = session.mesh
    session = replace(session, pairs=find_pairs(mesh))
    session = changes.set_role(session, mesh.marker_names, "fixed")
    assert {frozenset((p.first, p.second)) for p in session.pairs} == {
        frozenset(("bottom", "top")), frozenset(("left", "right")),
    }  # fmt: skip
    return session


@pytest.mark.parametrize(
    ("sliding", "mode"), [("none", "fixed"), ("ps", "moving"), ("ds", "moving")]
)
def test_the_role_periodic_switches_periodicity_on(plain, sliding, mode):
    plain = changes.set_case(plain, sliding=sliding)
    one = changes.set_role(plain, ("left",), "periodic")
    assert one.case.periodic == mode
    both = changes.set_role(one, ("right",), "periodic")
    assert both.case.periodic == mode
    # Who has switched it off knows why.
    off = changes.set_case(both, periodic="none")
    more = changes.set_role(off, ("bottom", "top"), "periodic")
    assert more.case.periodic == "none"
    none = changes.set_role(both, ("left", "right"), "fixed")
    assert none.case.periodic == "none"


def test_a_guess_for_a_match_goes_with_the_role_of_the_other_side(square):
    markers = tuple(
        replace(m, name={"left": "x_m", "right": "x_p"}.get(m.name, m.name)) for m in square.markers
    )
    mesh = replace(square, markers=markers)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None, find_pairs(mesh))
    assert session.role("x_m") == session.guesses["x_m"].role == "periodic"
    kept = changes.set_role(session, ("x_p",), "periodic")
    assert "x_m" in kept.guesses
    alone = changes.set_role(session, ("x_p",), "moving")
    assert alone.role("x_m") == alone.guesses["x_m"].role == "fixed"
    assert alone.case.periodic == "none"


def test_the_axis_of_what_matches_comes_with_it(plain):
    pair = replace(plain.pairs[0], axis=(1.0, 0.0, 0.0), origin=(0.0, 2.0, 0.0))
    session = changes.set_role(replace(plain, pairs=(pair,)), (pair.second,), "periodic")
    assert (session.case.axis, session.case.origin) == (pair.axis, pair.origin)


def test_those_without_a_partner_are_named_beside_those_that_have_one(plain):
    session = changes.set_role(plain, ("left", "right", "bottom"), "periodic")
    text = pair_text(session)
    assert "Found: " in text
    assert "No match found yet for bottom; the run will try." in text
    whole = pair_text(changes.set_role(session, ("top",), "periodic"))
    assert "No match" not in whole


def test_the_error_names_the_pairs_that_match_and_those_that_do_not(square):
    points = np.array(square.points)
    top = square.marker("top").nodes
    points[top[2], 0] += 0.2
    bent = square.with_points(points)
    ends = "'bottom' and 'top' do not"
    match = (
        f"the periodic markers 'left' and 'right' match .4 along .4, 0.., but {ends}: "
        "with the best translational transformation .* a node is 0.16 from its image"
    )
    for names in (("left", "right", "bottom", "top"), ("bottom", "left", "top", "right")):
        with pytest.raises(MeshError, match=match):
            pair_up(bent, names)
    with pytest.raises(MeshError, match="'bottom' and 'top' do not match"):
        pair_up(bent, ("bottom", "top"))


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("stator_sidewall", "sliding"),
        ("rotor_interface", "sliding"),
        ("RotorHub", "sliding"),
        ("stator_inlet", "sliding"),
        ("rotor_periodic_1", "periodic"),
        ("rotor", "moving"),
        ("stator_1", "moving"),
        ("rotor_blade", "moving"),
        ("StatorVane", "moving"),
    ],
)
def test_a_machine_in_a_name_says_less_than_the_rest_of_it(name, role):
    assert guess_by_name(name).role == role


def test_the_best_minimum_is_that_of_a_run_that_ended(session):
    def run(number, low, end):
        quality = replace(session.first.quality, values=np.full(16, low))
        return Run(number, session.case, (StepFrame(session.mesh, quality),), end)

    runs = [run(1, 0.5, "done"), run(2, 0.4, "done"), run(3, 0.9, ""), run(4, 0.8, "cancelled")]
    assert best_runs(runs) == {1}
    assert best_runs([*runs[:3], run(4, 0.8, "done")]) == {4}


def test_letters_in_a_pdf_are_truetype(tmp_path):
    figure = Figure((2, 2))
    figure.text(0.5, 0.5, "θ 0.5")
    data = figure_bytes(figure, "pdf")
    assert b"/Type3" not in data
    assert b"/TrueType" in data or b"/CIDFontType2" in data
    assert figure_bytes(figure, "pdf") == data


@pytest.mark.parametrize("vector", [(0.5, 0.25)])
def test_a_vtu_file_has_the_displacement(square, tmp_path, vector):
    moved = square.with_points(square.points + vector)
    write(tmp_path / "a.vtu", moved, base=square)
    read = pv.read(tmp_path / "a.vtu")
    assert read.point_data["displacement"].tolist() == [[*vector, 0.0]] * len(square.points)
    write(tmp_path / "b.vtu", moved)
    assert not pv.read(tmp_path / "b.vtu").point_data.keys()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("choose PERIODIC_MODE= none", "choose Periodicity “none”"),
        (
            "PERIODIC_MODE= moving needs a sliding method: set SLIDING_MODE= ps or ds",
            (
                "Periodicity “periodic, moving vertices” needs a sliding method: set Sliding "
                "“pseudo sliding” or “direct sliding”"
            ),
        ),
        (
            (
                "gaussian is too smooth: use a RBF_KERNEL such as wendland-c0, a smaller "
                "INFLUENCE_FACTOR or RBF_KERNEL= ctps-c2a"
            ),
            (
                "Gaussian (global) is too smooth: use a Kernel such as CP C0 (compact), a "
                "smaller Radius × extent or Kernel “CTPS C2a (compact)”"
            ),
        ),
        (
            "with PERIODIC_MODE= moving (or fixed) they do",
            "with Periodicity “periodic, moving vertices” (or “periodic, fixed vertices”) they do",
        ),
        ("SUPPORT_RADIUS: 0.0 does not fit", "Support radius as a length: 0.0 does not fit"),
        ("STEPS= auto or less", "Steps “automatic” or less"),
        ("MARKER_MOVING= (a, b) does not have it", "the role “moving” (a, b) does not have it"),
        ("use more STEPS, or METHOD= rbf", "use more Steps, or Method “RBF interpolation”"),
        ("use DATA_REDUCTION= YES, or", "use Data reduction “on”, or"),
        ("MY_STEPS are kept", "MY_STEPS are kept"),
    ],
)
def test_messages_have_the_words_of_the_window(text, said):
    assert with_field_labels(text) == said


def test_what_is_missing_has_the_words_of_the_window(plain):
    session = changes.set_role(plain, ("left", "right", "bottom"), "periodic")
    session = changes.set_role(session, ("top",), "moving")
    session = changes.add_motion(session, Translate("top", (0.0, 0.1)))
    (told,) = {m.text for m in run_requirements(session)}
    assert told.startswith("The role “periodic” has an odd number of markers (bottom, right, left)")
