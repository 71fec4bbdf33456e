import pytest

from slideviz.mesh.periodic import find_pairs
from slideviz.session.opening import guess_by_name, guess_case, guess_roles


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("airfoil", "moving"),
        ("BLADE", "moving"),
        ("NACA0012", "moving"),
        ("RotorBlade", "moving"),
        ("periodic_1", "periodic"),
        ("PER2", "periodic"),
        ("inflow", "sliding"),
        ("Fluid_INLET", "sliding"),
        ("HUB", "sliding"),
        ("shroud", "sliding"),
        ("wall", "fixed"),
        ("farfield", "fixed"),
        ("upper", "fixed"),
    ],
)
def test_names_hint_at_roles(name, role):
    assert guess_by_name(name).role == role


@pytest.mark.parametrize("name", ["plate", "persona", "MARKER_7", "windscreen", "1", ""])
def test_other_names_say_nothing(name):
    assert guess_by_name(name) is None


def test_opposite_sides_of_a_box_are_not_periodic_because_they_match(square):
    pairs = find_pairs(square)
    assert pairs, "the sides do match"
    assert {guess.role for guess in guess_roles(square, pairs).values()} == {"fixed"}


def test_a_match_decides_where_the_names_say_nothing(square):
    from dataclasses import replace

    names = {"bottom": "q1", "top": "q2", "left": "inlet", "right": "outlet"}
    markers = tuple(replace(m, name=names[m.name]) for m in square.markers)
    mesh = replace(square, markers=markers)
    guesses = guess_roles(mesh, find_pairs(mesh))
    assert guesses["q1"].role == guesses["q2"].role == "periodic"
    assert "q2" in guesses["q1"].reason
    assert guesses["inlet"].role == "sliding", "that it matches the outlet does not matter"
    assert guess_case(mesh, guesses, find_pairs(mesh)).periodic == "moving"


def test_without_a_pair_the_case_is_not_periodic(square):
    assert guess_case(square, guess_roles(square), ()).periodic == "none"


def test_the_passage_is_guessed_as_it_is_meant(passage):
    guesses = guess_roles(passage.mesh, find_pairs(passage.mesh))
    assert {name: guess.role for name, guess in guesses.items()} == {
        "airfoil": "moving",
        "inflow": "sliding",
        "outflow": "sliding",
        "periodic_1": "periodic",
        "periodic_2": "periodic",
    }
