"""A session is a case file: how it was looked at comes back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.case.keys import read_sections, write_sections
from slideviz.case.model import Case
from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.errors import CaseError
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.saving import view_from_case, view_to_case
from slideviz.session.state import ViewState
from slideviz.terms import COLOR_BY, COLOR_MAPS, POINTS_SHOWN, SHOWN

number = st.floats(-1e3, 1e3)
triple = st.tuples(number, number, number)
direction = triple.filter(lambda v: np.linalg.norm(v) > 0)


def section_of(row):
    """Sections of one shape, with any numbers."""
    high = min(row.size.high, 1e3) if row.size is not None else 1e3
    size = st.floats(1e-3, high, exclude_max=True)
    made = st.builds(Section.of, st.just(row.value), triple, direction, size)
    names = ("whole_cells", "flat", "shown")
    flags = st.fixed_dictionaries({name: st.booleans() for name in names})
    return st.builds(lambda section, how: replace(section, **how), made, flags)


sections = st.one_of(*(section_of(row) for row in SECTION_SHAPES.values()))
rising = st.none() | st.tuples(st.floats(-5, 0.4), st.floats(0.5, 5))
views = st.builds(
    ViewState,
    st.sampled_from(list(COLOR_BY)),
    rising,
    st.sampled_from(list(COLOR_MAPS)),
    rising,
    st.sampled_from(list(POINTS_SHOWN)),
    st.sets(st.sampled_from(list(SHOWN))).map(frozenset),
    st.lists(sections, max_size=3).map(tuple),
    st.integers(-1, 5),
    st.sets(st.sampled_from(["left", "top"])).map(frozenset),
)


@settings(max_examples=60, deadline=None)
@given(views)
def test_a_view_comes_back_from_the_file(session, tmp_path_factory, view):
    file = tmp_path_factory.mktemp("keep") / "a.cfg"
    camera = (1.0, 2.0, 3.0, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.7)
    kept = view_to_case(replace(session, view=view), camera)
    kept.change(source=file).write(file)
    again = Case.read(file)
    assert view_from_case(again, ViewState(), session.mesh.marker_names) == view
    assert again.view["VIEW_CAMERA"] == camera


def test_a_fresh_view_needs_no_key(session):
    assert view_to_case(session).view == {}
    assert "VIEW_CAMERA" not in view_to_case(session).view


def test_a_view_is_no_setting_of_the_run(session):
    session = changes.add_frames(changes.start_run(session), [session.first])
    case = view_to_case(changes.set_view(session, color_by="skew"))
    assert not changes.set_case(session, view=case.view).outdated


def test_hidden_boundaries_of_another_mesh_are_passed_by():
    case = Case(view={"VIEW_HIDDEN": ("gone", "left")})
    assert view_from_case(case, ViewState(), ("left", "top")).hidden == {"left"}


def test_sections_are_read_as_written():
    text = "(plane, 0, 0, 1, 0, 0, 0.5, whole) ; (cylinder, 0.25, 0, 0, 1, 0, 0, 0, cut)"
    text += "; (cylinder, 0.25, 0, 0, 1, 0, 0, 0, cut, unrolled)"
    text += "; (plane, 0, 0, 1, 0, 0, 0.5, cut, flat) ; (plane, 1, 0, 0, 0, 0, 0, cut, hidden)"
    text += "; (plane, 1, 0, 0, 0, 0, 0, whole, flat, hidden)"
    found = read_sections(text)
    assert found == (
        ("plane", (0.0, 0.0, 1.0, 0.0, 0.0, 0.5), True, False, True),
        ("cylinder", (0.25, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), False, False, True),
        ("cylinder", (0.25, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), False, True, True),
        ("plane", (0.0, 0.0, 1.0, 0.0, 0.0, 0.5), False, True, True),
        ("plane", (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), False, False, False),
        ("plane", (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), True, True, False),
    )
    assert read_sections(write_sections(found)) == found
    assert read_sections(write_sections(())) == ()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("VIEW_SECTIONS", "(potato, 1, cut)", f"does not begin with {names()}"),
        (
            "VIEW_SECTIONS",
            "(plane, 1, 0, 0, 0, 0, 0, cut, unrolled)",
            "after that flat, hidden or nothing",
        ),
        ("VIEW_SECTIONS", "(plane, 1, 0, 0, cut)", "a plane has 6 numbers, 3 are given"),
        ("VIEW_SECTIONS", "(plane, 0, 0, 0, 1, 1, 1, cut)", "its direction has no length"),
        ("VIEW_SECTIONS", "(cylinder, 0, 0, 0, 1, 0, 0, 0, cut)", "the radius 0 is not positive"),
        ("VIEW_SECTIONS", "(cone, 90, 0, 0, 1, 0, 0, 0, cut)", "the half angle 90 is not below 90"),
        ("VIEW_RANGE", "(1, 0)", "does not rise"),
        ("VIEW_RANGE", "(1, 2, 3)", "has 3 numbers"),
        ("VIEW_SHOW", "( edges, egdes )", "'egdes' is not one of"),
        ("VIEW_MAP", "jet", "is not one of viridis"),
    ],
)
def test_mistakes_in_view_keys_are_told(key, value, message, tmp_path):
    file = tmp_path / "a.cfg"
    file.write_text(f"MESH_FILENAME= a.su2\n{key}= {value}\n")
    with pytest.raises(CaseError, match=message) as error:
        Case.read(file)
    assert "a.cfg:2:" in str(error.value)
