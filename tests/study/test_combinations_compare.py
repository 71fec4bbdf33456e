"""Comparisons: rows equal to single runs, failures as rows, tables."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import Cancelled, DeformError
from slideviz.samples.table import sample
from slideviz.study import combinations as comparing
from slideviz.study.combinations import (
    COMPARED_METHODS,
    KEYS,
    Combination,
    announcement,
    bounded,
    combinations,
    compare,
    csv_text,
    reasons,
    refused,
    terminal_head,
    terminal_line,
    wanted_methods,
    wanted_modes,
    words_for,
)


@pytest.fixture(scope="module")
def square():
    return sample("square", 10, "motion")


@pytest.fixture(scope="module")
def rows(square):
    wanted = combinations(("none", "ps"), ("none", "fixed", "moving"), (1, 4))
    return list(compare(square.case, square.mesh, wanted))


def test_combinations_that_share_a_plan_follow_each_other():
    found = combinations(("none", "ps"), ("none", "fixed"), (1, 5))
    assert len(set(found)) == 8
    assert [(row.method, row.periodic) for row in found[::2]] == [
        ("none", "none"),
        ("none", "fixed"),
        ("ps", "none"),
        ("ps", "fixed"),
    ]
    assert [row.steps for row in found] == [1, 5] * 4


def test_what_is_worth_trying_follows_from_the_roles(square):
    assert wanted_modes(square.case) == ("fixed", "moving")
    for mode in ("none", "periodic", "fixed"):
        assert wanted_modes(square.case.change(periodic=mode)) == (mode,)
    assert wanted_methods(square.case) == ("none", "ps", "ds")
    rigid = square.case.change(roles={"BLOCK": "moving"}, periodic="none")
    assert wanted_modes(rigid) == ("none",)
    assert wanted_methods(rigid) == ("none",)


def test_what_contradicts_the_case_is_known_before_anything_is_computed(square, monkeypatch):
    def never(*_):
        raise AssertionError("nothing is to be computed")

    monkeypatch.setattr(comparing, "make_setup", never)
    wanted = combinations(("none", "ps"), ("fixed", "moving"), (1, 4))
    found = refused(square.case, square.mesh, wanted)
    assert set(found) == {Combination("none", "moving", n) for n in (1, 4)}
    assert all("needs a sliding method" in text for text in found.values())
    text = announcement(wanted, found, {"methods": tuple(COMPARED_METHODS)})
    first, methods, modes, steps, left_out = text.splitlines()
    assert first == "6 combinations"
    assert methods.split("(")[0].split() == ["methods", "none,", "ps"]
    assert "(--methods takes ds, idw, elastic, too)" in methods
    assert (modes.split(), steps.split()) == (
        ["periodic", "fixed,", "moving"],
        ["steps", "1,", "4"],
    )
    assert "method none with periodic moving: PERIODIC_MODE= moving needs" in left_out


def test_a_mesh_that_does_not_repeat_is_told_in_words():
    made = sample("square", 6, "motion")
    case = made.case.change(roles={"BLOCK": "moving"})
    wanted = combinations(("none", "ps"), ("none", "fixed", "moving"), (1,))
    found = refused(case, made.mesh, wanted)
    assert {(one.method, one.periodic) for one in found} == {
        *((method, mode) for method in ("none", "ps") for mode in ("fixed", "moving")),
    }
    text = announcement(wanted, found, {})
    assert text.startswith("2 combinations\n")
    assert "periodic fixed: PERIODIC_MODE= fixed needs MARKER_PERIODIC" in text


def test_few_words_name_many_combinations():
    every = combinations(("none", "ps"), ("none", "fixed", "moving"), (1, 2))
    assert words_for(every[:1], every, KEYS) == "method none with periodic none"
    fixed = [one for one in every if one.periodic == "fixed"]
    assert words_for(fixed, every, KEYS) == "periodic fixed"
    assert words_for(every[:6], every, KEYS) == "method none"
    both = [one for one in every if one.method == "none" or one.periodic == "fixed"]
    assert set(words_for(both, every, KEYS).split("; ")) == {"method none", "periodic fixed"}
    assert reasons(dict.fromkeys(fixed, "it  cannot\n nor this")) == {"it cannot nor this": fixed}


def test_a_reason_is_written_once(rows):
    told = []
    first, second = [row for row in rows if row.result is None]
    assert "not possible [1]: PERIODIC_MODE= moving" in terminal_line(first, told)
    assert terminal_line(second, told).endswith("not possible [1]")
    other = comparing.CombinationRow(second.combination, problem="out of memory")
    assert terminal_line(other, told).endswith("not possible [2]: out of memory")


@pytest.mark.parametrize("method", list(COMPARED_METHODS))
def test_a_row_is_what_a_single_run_gives(square, method):
    (_, row) = compare(square.case, square.mesh, combinations((method,), ("fixed",), (1, 3)))
    *steps, last = sv.deform(row.combination.applied(square.case), square.mesh)
    assert row.result is not None
    assert np.array_equal(row.result.mesh.points, last.mesh.points)
    found = [sv.quality(step.mesh, square.mesh) for step in (*steps, last)]
    assert row.result.steps == 3
    assert row.result.minimum.tolist() == [q.min for q in found]
    assert row.result.mean.tolist() == [q.mean for q in found]
    assert row.result.control_nodes == last.control_nodes
    assert row.result.max_error == max(step.max_error for step in (*steps, last))


def test_methods_really_differ(square):
    wanted = combinations(tuple(COMPARED_METHODS), ("none",), (3,))
    means = [row.result.quality.mean for row in compare(square.case, square.mesh, wanted)]
    assert len({round(mean, 6) for mean in means}) == len(COMPARED_METHODS)


def test_the_plan_is_made_once_for_all_numbers_of_steps(square, monkeypatch):
    made = []

    def counted(prepared):
        made.append((prepared.case.sliding, prepared.case.periodic))
        return make_setup(prepared)

    make_setup = comparing.make_setup
    monkeypatch.setattr(comparing, "make_setup", counted)
    list(compare(square.case, square.mesh, combinations(("none", "ps"), ("none",), (1, 2, 3))))
    assert made == [("none", "none"), ("ps", "none")]


def test_a_combination_that_cannot_be_is_a_row_and_the_others_follow(rows):
    told = {row.combination: row.problem for row in rows if row.result is None}
    assert set(told) == {Combination("none", "moving", n) for n in (1, 4)}
    assert all("needs a sliding method" in text for text in told.values())
    assert all(row.result and not row.problem for row in rows if row.combination not in told)


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (DeformError("the system cannot be solved"), "the system cannot be solved"),
        (MemoryError(), "out of memory"),
        (ZeroDivisionError("oops"), "internal error (ZeroDivisionError: oops)"),
    ],
)
def test_a_run_that_fails_does_not_take_the_others_with_it(square, monkeypatch, problem, words):
    deform = comparing.deform

    def failing(case, mesh, progress=None, setup=None):
        if case.steps == 2:
            raise problem
        return deform(case, mesh, progress, setup)

    monkeypatch.setattr(comparing, "deform", failing)
    wanted = combinations(("ps",), ("none",), (1, 2, 3))
    first, second, third = compare(square.case, square.mesh, wanted)
    assert words in second.problem
    assert first.result
    assert third.result


@pytest.mark.parametrize("stop", [Cancelled, KeyboardInterrupt])
def test_a_cancel_ends_the_comparison(square, stop):
    def tell(combination, _):
        if combination.steps == 2:
            raise stop("enough")

    wanted = combinations(("ps",), ("none",), (1, 2, 3))
    pulled = compare(square.case, square.mesh, wanted, tell)
    assert next(pulled).result
    with pytest.raises(stop, match="enough"):
        next(pulled)


def test_automatic_steps_tell_how_many_were_made(square):
    (row,) = compare(square.case, square.mesh, combinations(("ps",), ("moving",), (0,)))
    assert row.result.steps > 1
    assert len(row.result.minimum) == row.result.steps
    assert csv_text([row]).splitlines()[1].startswith(f"ps,moving,auto,{row.result.steps},")


def test_the_table_reads_back(rows):
    table = list(csv.DictReader(csv_text(rows).splitlines()))
    assert len(table) == len(rows)
    for line, row in zip(table, rows, strict=True):
        assert line["method"] == row.combination.method
        assert line["periodic"] == row.combination.periodic
        assert int(line["steps"]) == row.combination.steps
        if row.result is None:
            assert line["min"] == ""
            assert line["problem"] == row.problem
        else:
            assert float(line["min"]) == row.result.quality.min
            assert float(line["mean"]) == row.result.quality.mean
            assert int(line["inverted"]) == row.result.quality.inverted
            assert float(line["processor_seconds"]) >= 0
            assert line["problem"] == ""


def test_what_is_no_number_is_left_empty(square):
    (row,) = compare(square.case, square.mesh, combinations(("idw",), ("none",), (1,)))
    (line,) = csv.DictReader(csv_text([row]).splitlines())
    assert np.isnan(row.result.condition)
    assert line["condition"] == ""


def test_terminal_lines_stand_in_columns(rows):
    head = terminal_head()
    for row in rows:
        line = terminal_line(row)
        if row.result is None:
            assert "not possible [1]: " in line
        else:
            assert len(line) == len(head)
            end = head.index(" min") + len(" min")
            assert line[:end].endswith(f" {row.result.quality.min:.6f}")


def test_meshes_are_kept_up_to_a_size_and_numbers_always(rows):
    size = rows[0].result.mesh.points.nbytes
    kept = list(bounded(rows, int(2.5 * size)))
    assert [row.combination for row in kept] == [row.combination for row in rows]
    done = [(old.result, new.result) for old, new in zip(rows, kept, strict=True) if old.result]
    assert [new.mesh is old.mesh for old, new in done] == [True] * 2 + [False] * (len(done) - 2)
    assert all(new.mesh is None for _, new in done[2:])
    assert all(new.quality is old.quality for old, new in done)
    assert csv_text(kept) == csv_text(rows)
