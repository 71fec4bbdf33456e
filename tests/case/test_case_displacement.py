"""Displacement files."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.displacement import Displacements, read_displacements
from slideviz.errors import CaseError
from tests import builders

NODES = np.array([2, 3, 5, 8])


def of_ten(dim):
    """A mesh of ten points."""
    cells = sv.Cells.from_blocks([(9, [[0, 1, 2, 3]])])
    return sv.Mesh(np.zeros((10, dim)), cells)


@pytest.fixture
def read(tmp_path):
    def read(text: str | bytes, dim: int = 2) -> Displacements:
        path = tmp_path / "d.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_displacements(path, of_ten(dim), NODES, "a moving marker")

    return read


def test_listed_nodes_move_and_the_others_stay(read):
    found = read("8\t0.1\t-2e-3\n3 1 2\n")
    assert found.nodes.tolist() == [2, 3, 5, 8]
    assert found.vectors.tolist() == [[0, 0], [1, 2], [0, 0], [0.1, -2e-3]]
    (warning,) = found.warnings
    assert warning.endswith("d.txt: 2 of 4 nodes on a moving marker are not listed; they stay")
    assert found.at(np.array([8, 3])).tolist() == [[0.1, -2e-3], [1, 2]]


def test_a_complete_file_has_no_warning_and_all_digits(read):
    value = 0.1 + 0.2
    found = read("".join(f"{node} {value!r} {-value!r} 5e-324\n" for node in NODES), dim=3)
    assert found.warnings == ()
    assert (found.vectors == [value, -value, 5e-324]).all()
    assert not found.vectors.flags.writeable


@pytest.mark.parametrize(
    "text",
    [
        "% node dx dy\n\n3 1 2 % here\n  \n8 0.5 0 # there\n$ end",
        "3 1 2\r\n8 0.5 0\r\n",
        "3 1 2\r8 0.5 0",
        "3, 1, 2\n8;0.5;0",
        "\ufeff3 1 2\n8 .5 0.",
        "3.0 1 2\n8e0 0.5 0\n3 1 2\n",
    ],
)
def test_ways_to_write_the_same(read, text):
    found = read(text)
    assert found.vectors.tolist() == [[0, 0], [1, 2], [0, 0], [0.5, 0]]


def test_latin_1_comments_are_no_obstacle(read):
    found = read("% größer\n3 1 2\n".encode("latin-1"))
    assert found.vectors[1].tolist() == [1, 2]
    assert "was read as Latin-1" in found.warnings[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"d\.txt: the file is empty; expected a displacement file"),
        ("% nothing\n", r"d\.txt: the file lists no node; expected lines node dx dy$"),
        (b"3 1 2\n\0", r"d\.txt: is a binary file"),
        ("\n3 1\n", r"d\.txt:2: '3 1' has 2 columns; expected 3: node dx dy"),
        ("3 1 2\n8 1 2 0\n", r"d\.txt:2: '8 1 2 0' has 4 columns; expected 3"),
        ("node dx dy\n3 1 2\n", r"d\.txt:1: 'node' is not a number"),
        ("node dx\n3 1 2\n", r"d\.txt:1: 'node dx' has 2 columns; .*\(put % before a heading\)"),
        ("3 1 2\n8 nan 0\n", r"d\.txt:2: 'nan' is not a number"),
        ("8 inf 0\n", r"d\.txt:1: 'inf' is not a number"),
        ("8 1e999 0\n", r"d\.txt:1: '1e999' is too large"),
        ("8 1_0 0\n", r"d\.txt:1: '1_0' is not a number"),
        ("3 1 2\n\n% x\n10 0 0\n", r"d\.txt:4: node 10 is not in the mesh; its nodes are 0 to 9"),
        ("-1 0 0\n", r"d\.txt:1: node -1 is not in the mesh"),
        ("1e300 0 0\n", r"d\.txt:1: node 1e\+300 is not in the mesh"),
        ("2.5 0 0\n", r"d\.txt:1: 2\.5 is not a node number"),
        ("3 1 2\n4 0 0\n", r"d\.txt:2: node 4 is not on a moving marker; remove the line or"),
        ("3 1 2\n5 0 0\n\n3 1 3\n", r"d\.txt:4: node 3 has another displacement in line 1; keep"),
    ],
)
def test_mistakes(read, text, words):
    with pytest.raises(CaseError, match=words):
        read(text)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (
            "1 2 3 4 5 6",
            r"d\.txt:1: '1 2 3 4 5 6' has 6 columns; expected .* \(and 24 more lines l",
        ),
        ("a " * 99, r"d\.txt:1: '.{0,70}\.\.\.' has 99 columns; .* \(and 24 more lines like it\)"),
        ("99 0 0", r"d\.txt:1: node 99 is not in the mesh; .* \(and 24 more lines like it\)"),
        ("0.5 0 0", r"d\.txt:1: 0\.5 is not a node number \(and 24 more lines like it\)"),
        (
            "{n} 0 0",
            r"d\.txt:1: node 0 is not on a moving marker; .* \(and \d+ more lines",
        ),
        ("3 {n} 0", r"d\.txt:2: node 3 has another displacement in line 1; .* \(and 23 more lines"),
    ],
)
def test_mistakes_of_one_kind_are_one_sentence(read, row, said):
    with pytest.raises(CaseError, match=said) as caught:
        read("\n".join(row.replace("{n}", str(n % 10)) for n in range(25)))
    assert "\n" not in str(caught.value)


def test_columns_of_a_mesh_in_3d(read):
    with pytest.raises(CaseError, match="has 3 columns; expected 4: node dx dy dz"):
        read("3 1 2\n", dim=3)


def test_all_mistakes_at_once_in_order(read):
    with pytest.raises(CaseError) as caught:
        read("4 0 0\n3 1 2\n99 0 0\n3 9 9\n2.5 0 0\n")
    numbers = [line.rpartition("d.txt:")[2][:2] for line in str(caught.value).splitlines()]
    assert numbers == ["1:", "3:", "4:", "5:"]
    with pytest.raises(CaseError) as caught:
        read("a 0 0\n3 1 2\n3 b c\n4 0\n")
    numbers = [line.rpartition("d.txt:")[2][:2] for line in str(caught.value).splitlines()]
    assert numbers == ["1:", "4:"]


def test_a_file_of_another_mesh_gives_a_short_answer(read):
    with pytest.raises(CaseError) as caught:
        read("".join(f"{node} 0 0\n" for node in range(100, 5000)))
    assert str(caught.value).endswith("its nodes are 0 to 9 (and 4899 more lines like it)")


def test_missing_file(tmp_path):
    with pytest.raises(CaseError, match=r"no\.txt: there is no such displacement file; check"):
        read_displacements(tmp_path / "no.txt", of_ten(2), NODES, "a moving marker")


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3, 1e6])
def test_displacements_in_another_unit_are_told_as_that(scale, tmp_path):
    mesh = builders.square(6)
    mesh = mesh.with_points(scale * mesh.points)
    nodes = mesh.marker("BLOCK").nodes
    moved = 0.08 * (mesh.points[nodes] - mesh.points[nodes].mean(axis=0))
    for factor in (1.0, 1e-3, 100.0, 1000.0):
        rows = np.column_stack([nodes, factor * moved])
        np.savetxt(tmp_path / "d.txt", rows, fmt=["%d", "%.17g", "%.17g"])
        case = sv.Case(
            roles={"BLOCK": "moving"}, motions=(sv.FromFile(tmp_path / "d.txt", "BLOCK"),)
        )
        if factor <= 1.0:
            said = "\n".join(map(str, next(sv.deform(case, mesh)).warnings))
            assert ("multiply them by 1000 if they are in metres" in said) == (factor < 1.0)
            continue
        with pytest.raises(CaseError, match=r"times the extent of .*: are they in another unit"):
            next(sv.deform(case, mesh))
