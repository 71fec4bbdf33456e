"""Tables of displacements as text."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.displacement import read_displacements
from slideviz.case.model import Case
from slideviz.errors import CaseError
from slideviz.session import motions
from slideviz.session.motions import TableRows, table_text, write_table
from tests.solver.test_interface_motion import stage

CASE = Case(roles={"bottom": "moving", "left": "moving", "top": "sliding"})


@pytest.fixture
def rows(square):
    return TableRows.on(square, CASE, "bottom")


def test_it_is_about_the_nodes_of_a_boundary_or_of_all_that_move(square, rows):
    assert rows.nodes.tolist() == [0, 1, 2, 3, 4]
    assert rows.of == "bottom"
    both = TableRows.on(square, CASE, "")
    assert both.of == "bottom, left"
    assert both.nodes.tolist() == [0, 1, 2, 3, 4, 5, 10, 15, 20]


@pytest.mark.parametrize("separator", ["\t", " ", ", ", "; "])
def test_it_says_what_the_rows_do(rows, separator):
    text = f"1{separator}0.3{separator}0.4\n2{separator}0{separator}0\n"
    assert rows.check(text) == "1 of 5 nodes of bottom move, by at most 0.5"


def test_it_says_what_is_wrong_and_where(rows):
    with pytest.raises(CaseError, match=r"^Type or paste rows: node dx dy$"):
        rows.check(" \n")
    with pytest.raises(CaseError, match=r"^Line 2: .* has 2 columns; expected 3: node dx dy"):
        rows.check("1 0 0\n2 0\n")
    with pytest.raises(CaseError, match=r"^Line 1: node 7 is not on bottom.*\(1 more\)$"):
        rows.check("7 0 0\n99 0 0\n")


def test_3d_tables_have_another_column(cube):
    name = cube.marker_names[0]
    rows = TableRows.on(cube, Case(roles={name: "moving"}), name)
    assert rows.heading == "node dx dy dz"
    assert rows.check(f"{rows.nodes[0]} 0 0 2").startswith(f"1 of {len(rows.nodes)} nodes")


def test_rows_of_zeros_are_added_for_nodes_without_one(rows):
    empty = rows.fill("")
    assert empty.splitlines() == ["% node dx dy", *(f"{node}\t0\t0" for node in range(5))]
    assert rows.check(empty) == "0 of 5 nodes of bottom move, by at most 0"
    some = rows.fill("% mine\n3, 0.1, 0.2\n")
    assert some.splitlines()[:2] == ["% mine", "3, 0.1, 0.2"]
    assert some.splitlines()[2:] == [f"{node}\t0\t0" for node in (0, 1, 2, 4)]
    assert rows.fill(some) == some


def test_it_is_written_as_a_displacement_file(square, rows, tmp_path):
    path = tmp_path / "table.txt"
    write_table(path, "% typed\n3\t0.25\t-0.5\n\n")
    read = read_displacements(path, square, rows.nodes, "bottom")
    assert np.array_equal(read.at(np.array([3, 4])), [[0.25, -0.5], [0.0, 0.0]])
    assert table_text(path) == "% typed\n3\t0.25\t-0.5\n"
    assert table_text(tmp_path / "none.txt") == ""
    with pytest.raises(CaseError, match="the folder does not exist"):
        write_table(tmp_path / "no" / "table.txt", "1 0 0")


def test_a_large_file_is_not_edited_by_hand(tmp_path, monkeypatch):
    path = tmp_path / "table.txt"
    path.write_text("1 0 0\n" * 10)
    monkeypatch.setattr(motions, "MOST_BYTES", 59)
    with pytest.raises(CaseError, match="too much to be edited here"):
        table_text(path)


def test_nodes_of_a_zone_have_the_numbers_of_the_zone(tmp_path):
    mesh = sv.read(stage(tmp_path))
    case = Case(roles={"1:BLOCK": "moving", "2:BLOCK": "moving"})
    alone = sv.read(tmp_path / "stage.su2", 2)
    rows = TableRows.on(mesh, case, "2:BLOCK")
    assert np.array_equal(rows.nodes, alone.marker("BLOCK").nodes)
    assert rows.mesh.points.shape == alone.points.shape
    assert len(TableRows.on(mesh, case, "").nodes) > len(rows.nodes)
