"""The table of designs of the window: ranges, combinations, edits, files."""

import csv
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import slideviz as sv
from slideviz.design.sweeps import sweep as sweeping
from slideviz.design.sweeps.table import DesignRow
from slideviz.errors import CaseError
from slideviz.samples.table import sample
from slideviz.session import design_table
from slideviz.session.design_table import (
    DesignTable,
    column_choices,
    read_table,
    values_of,
    write_results,
)
from slideviz.session.jobs import Job, JobProgress, run_designs


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("-8 to 0 in 5", ["-8", "-6", "-4", "-2", "0"]),
        ("0 to 0.3 in 4", ["0", "0.1", "0.2", "0.3"]),
        (" 1e-3 TO 3e-3 in 3 ", ["0.001", "0.002", "0.003"]),
        ("1, 2,5, 2", ["1", "2", "5"]),
        ("ps, ds", ["ps", "ds"]),
        ("7", ["7"]),
    ],
)
def test_values(text, values):
    assert values_of(text) == values


def test_values_have_no_more_digits_than_their_steps_need():
    found = values_of("-24 to 0 in 60")
    assert found[1] == "-23.59322"
    assert [float(text) for text in found] == pytest.approx(np.linspace(-24, 0, 60), abs=1e-6)
    assert values_of("100000 to 100001 in 3") == ["100000", "100000.5", "100001"]
    assert values_of("0 to 1e-30 in 2") == ["0.0", "1e-30"]
    assert values_of("1 to 1 in 2") == ["1", "1"]


@pytest.mark.parametrize(
    "text", ["", "1,,2", "1 to 2 in 1", "a to b in 3", "1 to 2 in 9999999", "0:0.1:0.01", "0:1"]
)
def test_no_values(text):
    with pytest.raises(CaseError, match="as -8 to 0 in 9"):
        values_of(text)


def test_numbers_are_combined(monkeypatch):
    table = DesignTable().crossed("a", ["1", "2"]).crossed("b", ["x", "y"])
    assert table.columns == ("a", "b")
    assert table.rows == (("1", "x"), ("1", "y"), ("2", "x"), ("2", "y"))
    # The same number again: the designs stay, and those that are new follow.
    again = table.crossed("a", ["2", "7"])
    assert again.columns == table.columns
    assert again.rows == (*table.rows, ("7", "x"), ("7", "y"))
    monkeypatch.setattr(design_table, "MOST", 7)
    with pytest.raises(CaseError, match="8 designs exceed the limit of"):
        table.crossed("c", ["1", "2"])


def test_results_stay_with_their_designs():
    table = DesignTable().crossed("a", ["1", "2", "3"])
    table = table.with_results(DesignRow(n, min=n / 10) for n in (1, 2, 3))
    assert set(table.with_cell(1, 0, " 9 ").results) == {1, 3}
    assert table.with_cell(1, 0, " 9 ").rows[1] == ("9",)
    left = table.without([0])
    assert left.rows == (("2",), ("3",))
    assert {n: row.min for n, row in left.results.items()} == {1: 0.2, 2: 0.3}
    assert all(row.design == n for n, row in left.results.items())
    assert table.without([0, 1, 2]) == DesignTable()
    assert table.without_results().results == {}


@pytest.fixture(scope="module")
def passage():
    return sample("passage", 12)


def test_choices_have_what_the_case_has(passage):
    found = column_choices(passage.case, 2)
    assert found["airfoil.rotate.angle_deg"] == "-8"
    assert found["airfoil.translate.y"] == "0.12"
    assert found["STEPS"] == "5"
    assert not {"MOTION", "MESH_FILENAME", "DEFORMATION_FILENAME"} & set(found)


def test_choices_leave_out_what_does_nothing_in_2d(passage):
    case = passage.case.change(
        motions=(
            sv.Rotate("airfoil", 5.0, point=(0.1, 0.2)),
            sv.Ffd("airfoil", "BOX", (1, 0, 0), (0.1, 0.2, 0.0)),
            sv.Radial("airfoil", 1.1),
        )
    )
    parts = {name.removeprefix("airfoil.") for name in column_choices(case, 2) if "." in name}
    ffd = {"ffd.BOX.1.0.0.x", "ffd.BOX.1.0.0.y"}
    radial = {f"radial.{part}" for part in ("factor", "distance", "point_x", "point_y")}
    assert parts == {f"rotate.{n}" for n in ("angle_deg", "point_x", "point_y")} | ffd | radial
    spatial = column_choices(case, 3)
    assert {"airfoil.rotate.axis_z", "airfoil.ffd.BOX.1.0.0.z"} <= set(spatial)


def test_files(passage, tmp_path):
    file = tmp_path / "designs.csv"
    file.write_text("airfoil.translate.y,STEPS\n0.1234567890123456,2\n-1e-9,\n")
    table = read_table(passage.case, file)
    assert table.rows == (("0.1234567890123456", "2"), ("-1e-09", ""))
    table = table.with_results([DesignRow(2, min=0.25, mean=0.5, max_error=0.0, steps=5)])
    write_results(tmp_path / "out.csv", table)
    with (tmp_path / "out.csv").open(newline="") as found:
        first, second = csv.DictReader(found)
    assert (first["min"], first["STEPS"]) == ("", "2")
    assert (second["design"], second["min"], second["mean"]) == ("2", "0.25", "0.5")
    # Of a table with results the designs are read.
    again = read_table(passage.case, tmp_path / "out.csv")
    assert (again.columns, again.rows) == (table.columns, table.rows)


def test_only_what_has_no_result_is_run(passage, monkeypatch):
    made = staticmethod(lambda _cls, *_: ThreadPoolExecutor(1))  # processes take seconds to start
    monkeypatch.setattr(sweeping, "Processes", type("Thread", (), {"__new__": made}))
    table = DesignTable().crossed("STEPS", ["1", "2", "3"]).with_results([DesignRow(2, min=0.5)])
    told = []
    run_designs(passage.case, passage.mesh, table, Job(told.append))
    rows = [one for one in told if isinstance(one, DesignRow)]
    assert sorted((row.design, row.steps) for row in rows) == [(1, 1), (3, 3)]
    news = [one for one in told if isinstance(one, JobProgress)]
    assert news[-1].fraction == 1.0
    assert news[-1].text == "3 of 3, 0 s left"


def test_it_can_be_stopped(passage):
    with pytest.raises(sv.SlidevizError, match="stopped"):
        run_designs(
            passage.case,
            passage.mesh,
            DesignTable().crossed("STEPS", ["1"]),
            Job(stopped=lambda: True),
        )


def test_another_table_keeps_the_results_of_the_same_designs():
    old = DesignTable(("a", "b"), (("1", "x"), ("2", "x"))).with_results(
        DesignRow(number, {}, seconds=float(number)) for number in (1, 2)
    )
    other = DesignTable(("b", "a"), (("y", "1"), ("x", "2"))).keeping(old)
    assert {number: (row.design, row.seconds) for number, row in other.results.items()} == {
        2: (2, 2.0)
    }
    assert not DesignTable(("a",), (("1",),)).keeping(old).results


def test_reasons_to_fail_are_told_once_with_their_designs(passage):
    table = DesignTable().crossed("STEPS", [str(k) for k in range(1, 11)])
    why = {n: DesignRow(n, problem="a.su2: too far") for n in range(1, 8)}
    rows = why | {3: DesignRow(3, problem="a.su2: too near"), 8: DesignRow(8, inverted=2)}
    assert table.with_results(rows.values()).summary().splitlines() == [
        "1 design done; 7 failed; 1 with inverted cells",
        "Designs 1, 2, 4, 5, 6 and 1 more: a.su2: too far",
        "Design 3: a.su2: too near",
    ]


def test_values_that_are_left_out_are_those_of_the_case(passage):
    table = DesignTable(("airfoil.translate.y", "STEPS"), (("0.1", ""), ("", "2")))
    assert table.filled(passage.case) is table
    table = table.with_results([DesignRow(1, min=0.5)])
    assert table.filled(passage.case).rows == (("0.1", "5"), ("0.12", "2"))
    whole = DesignTable(("STEPS",), (("1",),)).with_results([DesignRow(1, min=0.5)])
    assert whole.filled(passage.case) is whole
    assert table.filled(None) is table
