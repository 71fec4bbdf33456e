"""Tables as CSV: numbers keep their digits, and what is nothing is an empty cell."""

from math import nan

import pytest

from slideviz.errors import CaseError
from slideviz.system.csv_table import csv_rows, csv_text, write_csv

ROWS = [["name", "a, b"], ["Größe", 0.1 + 0.2], [None, nan], ['"', "two\nlines"]]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_what_is_written_is_read(delimiter):
    text = csv_text(ROWS, delimiter)
    assert "\r" not in text
    assert csv_rows(text, delimiter) == [
        ["name", "a, b"],
        ["Größe", "0.30000000000000004"],
        ["", ""],
        ['"', "two\nlines"],
    ]


def test_spaces_after_a_separator_are_left_out():
    assert csv_rows('a, b\n1,  "2, 3"\n') == [["a", "b"], ["1", "2, 3"]]
    assert csv_rows("") == []


def test_a_cell_without_end_is_an_error():
    with pytest.raises(ValueError, match="field larger than field limit"):
        csv_rows("a" * 200_000)


def test_a_table_is_written_whole_or_not_at_all(tmp_path):
    write_csv(tmp_path / "table.csv", ROWS, CaseError)
    assert (tmp_path / "table.csv").read_text() == csv_text(ROWS)
    with pytest.raises(CaseError, match="the folder does not exist"):
        write_csv(tmp_path / "nowhere" / "table.csv", ROWS, CaseError)
