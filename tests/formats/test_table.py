"""The table of formats: each row names functions that exist, and the documentation lists it."""

from dataclasses import replace
from pathlib import Path

import pytest

import slideviz as sv
from slideviz.formats import table
from slideviz.formats.table import FORMATS, format_for, format_of, own_endings
from tests.builders import square

FUNCTIONS = ("reader", "writer", "require", "series", "detects")


@pytest.mark.parametrize("row", FORMATS.values(), ids=str)
def test_a_row_names_functions_that_exist(row):
    for field in FUNCTIONS:
        assert not getattr(row, field) or callable(row.function(field))


def test_the_documentation_lists_every_row():
    page = (Path(__file__).parents[2] / "docs/reference/files.md").read_text()
    for row in FORMATS.values():
        assert f"| `{row.ending}` |" in page


def test_the_content_tells_where_the_ending_does_not(tmp_path):
    mesh = square(3)
    sv.write(tmp_path / "a.su2", mesh)
    sv.write(tmp_path / "b.su2b", mesh)
    for old, new in (("a.su2", "a"), ("a.su2", "a.mesh"), ("b.su2b", "b"), ("b.su2b", "b.su2")):
        path = tmp_path / f"copy_of_{new}"
        path.write_bytes((tmp_path / old).read_bytes())
        assert format_of(path) is FORMATS[f".{old.partition('.')[2]}"]
    (tmp_path / "c.mesh").write_text("MeshVersionFormatted 2\n")
    assert format_of(tmp_path / "c.mesh") is FORMATS[".mesh"]


def test_a_new_format_is_a_row(tmp_path, monkeypatch):
    row = replace(FORMATS[".su2"], ending=".mine", detects="")
    monkeypatch.setattr(table, "FORMATS", FORMATS | {".mine": row})
    path = tmp_path / "a.mine"
    sv.write(path, square(3))
    assert format_for(path) is row
    assert len(sv.read(path).cells) == 5


def test_own_endings():
    assert own_endings("quality") == ".vtu, .vtkhdf"
    assert own_endings("series") == ".vtkhdf"
