from dataclasses import fields, replace

import pytest

from slideviz.case.model import Case
from slideviz.mesh.periodic import find_pairs
from slideviz.samples.table import sample
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
    names = {"bottom": "q1", "top": "q2", "left": "inlet", "right": "outlet"}
    markers = tuple(replace(m, name=names[m.name]) for m in square.markers)
    mesh = replace(square, markers=markers)
    guesses = guess_roles(mesh, find_pairs(mesh))
    assert guesses["q1"].role == guesses["q2"].role == "periodic"
    assert "q2" in guesses["q1"].reason
    assert guesses["inlet"].role == "sliding", "that it matches the outlet does not matter"
    assert guess_case(mesh, guesses, find_pairs(mesh)).periodic == "moving"


@pytest.mark.parametrize("name", ["square", "hexahedron"])
@pytest.mark.parametrize(("prefix", "role"), [("side", None), ("PER", "periodic")])
def test_a_box_that_matches_every_way_is_periodic_only_by_name(name, prefix, role):
    mesh = sample(name, 5).mesh
    markers = [replace(m, name=f"{prefix}_{k}") for k, m in enumerate(mesh.markers)]
    mesh = replace(mesh, markers=tuple(markers))
    pairs = find_pairs(mesh)
    assert len(pairs) == mesh.dim
    guesses = guess_roles(mesh, pairs)
    assert {guesses[p.first].role if p.first in guesses else None for p in pairs} == {role}
    assert guess_case(mesh, guesses, pairs).periodic == ("none" if role is None else "fixed")
    # Of a part of its sides a match tells more.
    some = guess_roles(mesh, pairs[1:])
    assert {some[p.first].role for p in pairs[1:]} == {"periodic"}


def test_without_a_pair_the_case_is_not_periodic(square):
    assert guess_case(square, guess_roles(square), ()).periodic == "none"


def test_a_new_case_has_other_values_than_a_file_without_keys_and_saves_them(passage, tmp_path):
    mesh, usual = passage.mesh, Case()
    pairs = find_pairs(mesh)
    case = guess_case(mesh, guess_roles(mesh, pairs), pairs)
    differ = {f.name for f in fields(Case) if getattr(case, f.name) != getattr(usual, f.name)}
    new = {"rims", "relax", "layers", "repair", "sliding", "periodic", "roles"}
    assert new <= differ <= new | {"axis", "origin"}
    assert (case.relax, case.layers, case.repair, case.sliding) == ("auto", "auto", "auto", "ps")
    assert (case.steps, case.periodic) == (1, "moving")
    assert (usual.relax, usual.layers, usual.repair, usual.steps) == ("no", "no", "no", 1)
    (tmp_path / "bare.cfg").write_text("MESH_FILENAME= mesh.su2\n")
    bare = Case.read(tmp_path / "bare.cfg")
    assert bare.change(mesh_file=None, source=None) == usual
    case.write(tmp_path / "new.cfg")
    assert Case.read(tmp_path / "new.cfg").change(source=None) == case


def test_a_new_case_has_several_steps_only_where_nothing_is_relaxed(passage, monkeypatch):
    guesses = guess_roles(passage.mesh)
    assert guess_case(passage.mesh, guesses, ()).steps == 1
    monkeypatch.setattr("slideviz.solver.setup.RELAXED_CELLS", len(passage.mesh.cells) - 1)
    assert guess_case(passage.mesh, guesses, ()).steps == 5


def test_the_passage_is_guessed_as_it_is_meant(passage):
    guesses = guess_roles(passage.mesh, find_pairs(passage.mesh))
    assert {name: guess.role for name, guess in guesses.items()} == {
        "airfoil": "moving",
        "inflow": "sliding",
        "outflow": "sliding",
        "periodic_1": "periodic",
        "periodic_2": "periodic",
    }
