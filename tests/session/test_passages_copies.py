"""Neighbouring passages, and what a section shows of them."""

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.periodic import match
from slideviz.sections.cut import Cutter, transformed
from slideviz.sections.model import Section
from slideviz.session.passages import find_period, keeps, passages, show_passages
from tests.builders import cube, grid, passage, ring, sector
from tests.oracles.sections import cut_cells


def sector_mesh(angle_deg=30.0):
    shape = (3, 4, 3)
    return grid(shape, place=ring(shape, angle_deg=angle_deg))


def test_a_copy_begins_where_the_one_before_ends():
    for mesh, names in ((passage(), ("per1", "per2")), (cube(4), ("y_m", "y_p"))):
        pair = match(mesh, *names)
        copies = passages(pair, 2)
        assert sorted(copies) == [-2, -1, 0, 1, 2]
        assert np.array_equal(copies[0], np.eye(4))
        for number in (-2, -1, 0, 1):
            ends = transformed(mesh.points[pair.nodes[:, 1]], copies[number])
            starts = transformed(mesh.points[pair.nodes[:, 0]], copies[number + 1])
            assert np.abs(ends - starts).max() < 1e-12


def test_a_2d_mesh_has_copies_in_its_plane():
    mesh = sector()
    pair = find_period(mesh)
    copies = passages(pair, 1)
    ends = transformed(mesh.points[pair.nodes[:, 1]], copies[0])
    assert ends.shape[1] == 2
    assert transformed(mesh.points[pair.nodes[:, 0]], copies[1]) == pytest.approx(ends)


@pytest.mark.parametrize(("angle", "around"), [(30.0, 12), (360 / 41, 41), (120.0, 3)])
def test_the_whole_wheel_has_every_passage_once(angle, around):
    pair = match(sector_mesh(angle), "y_m", "y_p", "rotational")
    assert pair.around == around
    copies = passages(pair, "wheel")
    assert sorted(copies) == list(range(-((around - 1) // 2), around // 2 + 1))
    at = np.array([transformed(np.array([[1.0, 0, 0]]), m)[0] for m in copies.values()])
    angles = np.sort(np.arctan2(at[:, 1], at[:, 0]))
    assert np.diff(angles) == pytest.approx(np.radians(angle))
    # No passage twice, however many are asked for.
    assert passages(pair, around).keys() == copies.keys()


def test_what_makes_no_wheel_says_so():
    flat = match(cube(4), "y_m", "y_p")
    odd = match(sector_mesh(31.0), "y_m", "y_p", "rotational")
    assert flat.around is None
    assert odd.around is None
    for pair in (flat, odd):
        with pytest.raises(CaseError, match="do not close a wheel; give the number"):
            passages(pair, "wheel")
    assert len(passages(odd, 20)) == 41


def test_the_number_of_neighbours_is_not_negative():
    with pytest.raises(CaseError, match="-1 neighbouring passages; give 0 or more"):
        passages(match(cube(4), "y_m", "y_p"), -1)


def test_the_case_says_what_is_periodic():
    mesh = cube(4)
    case = Case(roles={"x_m": "periodic", "x_p": "periodic"})
    assert find_period(mesh, case).vector == pytest.approx([1, 0, 0])
    with pytest.raises(MeshError, match="do not match"):
        find_period(mesh, Case(roles={"x_m": "periodic", "y_p": "periodic"}))


def test_without_a_case_names_and_rotations_come_first():
    # Inflow and outflow of a straight passage match too, by a translation.
    shape = (4, 6, 8)
    mesh = grid(shape, place=ring(shape))
    assert find_period(mesh).kind == "rotational"
    assert {find_period(passage()).first, find_period(passage()).second} == {"per1", "per2"}
    lone = grid((2, 2, 2), rules=[("all", lambda p: True)])
    assert find_period(lone) is None


def test_sections_that_the_period_keeps():
    turn = passages(match(passage(), "per1", "per2"), 1)[1]
    assert keeps(Section("cylinder", (0, 0, 5), (0, 0, -3), 0.7), turn)
    assert keeps(Section("plane", (1, 2, 0.5), (0, 0, 1)), turn)
    assert not keeps(Section("cylinder", (0, 0.1, 0), (0, 0, 1), 0.7), turn)
    assert not keeps(Section("cylinder", (0, 0, 0), (1, 0, 0), 0.7), turn)
    assert not keeps(Section("plane", (0.5, 0, 0), (1, 0, 0)), turn)
    shift = passages(match(cube(4), "y_m", "y_p"), 1)[1]
    assert keeps(Section("plane", (0, 0, 0.5), (0, 0, 1)), shift)
    assert keeps(Section("plane", (0.5, 0, 0.5), (1, 0, 1)), shift)
    assert not keeps(Section("plane", (0, 0.5, 0), (0, 1, 0)), shift)


@pytest.mark.parametrize(
    "section",
    [
        Section("cylinder", radius=0.71),
        Section("plane", (0.6, 0.3, 0), (1, 0.2, 0)),
        Section("plane", (0.6, 0.3, 0), (1, 0.2, 0), whole_cells=True),
    ],
)
def test_one_section_cuts_all_passages(section):
    mesh = passage()
    found = show_passages(
        Cutter(mesh), mesh.points, section, passages(match(mesh, "per1", "per2"), 2)
    )
    assert any(len(piece) for number, piece in found.items() if number)
    for number, matrix in passages(match(mesh, "per1", "per2"), 2).items():
        there = mesh.with_points(transformed(mesh.points, matrix))
        assert found[number].cell_ids.tolist() == cut_cells(there, section)
        if not section.whole_cells:
            assert np.abs(section.distance(found[number].points)).max(initial=0) < 1e-12
