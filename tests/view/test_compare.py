"""Comparisons: rows equal to single runs, failures as rows, tables, figures, sheets."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from PIL import Image

import slideviz as sv
from slideviz.case.model import Reduction, Translate
from slideviz.case.samples import sample
from slideviz.errors import Cancelled, CaseError, DeformError
from slideviz.view import compare as comparing
from slideviz.view.compare import (
    METHODS,
    MODES,
    Combination,
    combinations,
    compare,
    wanted_methods,
    wanted_modes,
)
from slideviz.view.compare_panels import panels, profiler
from slideviz.view.compare_plots import figures, save_figure, steps_name
from slideviz.view.compare_sheets import sheet
from slideviz.view.compare_table import csv_text, history_text, terminal_head, terminal_line


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
    assert wanted_modes(square.case) == ("none", "periodic", "fixed", "moving")
    assert wanted_methods(square.case) == ("none", "ps", "ds")
    rigid = square.case.change(roles={"BLOCK": "moving"})
    assert wanted_modes(rigid) == ("none",)
    assert wanted_methods(rigid) == ("none",)


@pytest.mark.parametrize("method", list(METHODS))
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
    wanted = combinations(tuple(METHODS), ("none",), (3,))
    means = [row.result.quality.mean for row in compare(square.case, square.mesh, wanted)]
    assert len({round(mean, 6) for mean in means}) == len(METHODS)


def test_the_plan_is_made_once_for_all_numbers_of_steps(square, monkeypatch):
    made = []

    def counted(case, mesh):
        made.append((case.sliding, case.periodic))
        return make_plan(case, mesh)

    make_plan = comparing.make_plan
    monkeypatch.setattr(comparing, "make_plan", counted)
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

    def failing(case, mesh, progress=None, plan=None):
        if case.steps == 2:
            raise problem
        return deform(case, mesh, progress, plan)

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
            assert "not possible: " in line
        else:
            assert len(line) == len(head)
            end = head.index(" min") + len(" min")
            assert line[:end].endswith(f" {row.result.quality.min:.6f}")


def test_panels_are_methods_and_a_mode_has_the_same_line_in_each(rows):
    none, ps = panels(rows)
    assert (none.title, ps.title) == ("no sliding", "pseudo sliding")
    lines = {(panel.title, line.label): line.series for panel in (none, ps) for line in panel.lines}
    assert lines["no sliding", MODES["fixed"]] == lines["pseudo sliding", MODES["fixed"]] == 1
    assert ("no sliding", MODES["moving"]) not in lines


def test_with_one_mode_the_methods_are_lines(rows):
    (panel,) = panels([row for row in rows if row.combination.periodic == "fixed"])
    assert panel.title == ""
    assert {line.label for line in panel.lines} == {"no sliding", "pseudo sliding"}
    assert panels([row for row in rows if row.result is None]) == ()


def test_figures_show_the_rows(rows, square):
    drawn = dict(figures(rows, None))
    assert set(drawn) == {
        "steps",
        "histogram_01_steps",
        "histogram_04_steps",
        "by_step_04_steps",
    }
    figure = drawn["steps"]
    assert len(figure.axes) == 6
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:3] == [MODES["none"], MODES["fixed"], MODES["moving"]]
    assert min(text.get_fontsize() for text in legend.get_texts()) >= 8
    limits = {axes.get_ylim() for axes in figure.axes[::3]}
    assert len(limits) == 1, "one scale, so that panels can be compared"
    assert figure.get_size_inches()[0] <= 7.01
    ps = [row for row in rows if row.combination.method == "ps"]
    drawn_lines = [line for line in figure.axes[3].lines if not line.get_gid()]
    for index, line in enumerate(drawn_lines):
        for steps, shown, row in zip((1, 4), line.get_ydata(), ps[2 * index :], strict=False):
            assert row.combination.steps == steps
            lowest = row.result.quality.min if not row.result.quality.inverted else np.nan
            np.testing.assert_equal(shown, lowest)
    assert len(drawn_lines) == 3


def test_convergence_and_span_are_drawn_when_there_is_something_to_draw():
    made = sample("cylindrical", 6)
    (block,) = made.case.markers_with("moving")
    case = made.case.change(
        reduction=Reduction(tolerance=1e-2), motions=(Translate(block, (0.01, 0.0, 0.02)),)
    )
    rows = list(compare(case, made.mesh, combinations(("ps", "idw"), ("moving",), (1,))))
    assert all(row.result for row in rows), [row.problem for row in rows]
    drawn = dict(figures(rows, profiler(case, made.mesh)))
    assert set(drawn) == {"histogram_01_steps", "convergence_01_steps", "spanwise_01_steps"}
    assert drawn["spanwise_01_steps"].axes[0].get_ylabel() == "r [mesh unit]"
    (axes,) = drawn["convergence_01_steps"].axes
    assert [text.get_text() for text in axes.texts] == ["tolerance 0.01"]
    assert axes.get_legend_handles_labels()[1] == ["pseudo sliding"]
    lines = list(csv.DictReader(history_text(rows).splitlines()))
    assert len(lines) == len(rows[0].result.history)
    assert float(lines[-1]["error"]) <= 1e-2


@pytest.mark.parametrize(
    ("name", "span", "coordinate"),
    [
        ("square", None, None),
        ("square", "y", "y"),
        ("hexahedron", None, "z"),
        ("cylindrical", None, "r"),
        ("cylindrical", "z", "z"),
    ],
)
def test_the_span_follows_from_the_case(name, span, coordinate):
    made = sample(name, 5)
    (block,) = made.case.markers_with("moving")
    case = made.case.change(motions=(Translate(block, (0.01,) * made.mesh.dim),))
    make = profiler(case, made.mesh, span)
    if coordinate is None:
        assert make is None
        return
    (row,) = compare(case, made.mesh, combinations(("ps",), ("none",), (1,)))
    ((line,),) = [panel.lines for panel in panels([row])]
    assert make(line).coordinate == coordinate
    assert make(line).count.sum() == len(made.mesh.cells)


def test_the_sheet_shows_every_mesh_and_why_one_is_missing(rows, square, tmp_path):
    group = [row for row in rows if row.combination.steps == 4]
    figure = sheet(group, square.mesh)
    assert figure is not None
    (path,) = save_figure(figure, tmp_path, "sheet", 100, (".png",), tight=True)
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert len(words) == 1
    assert "not possible" in words[0]
    numbers = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel().startswith("min")]
    assert len(numbers) == 5
    pictures = [axes.images[0].get_array() for axes in figure.axes if axes.images]
    assert len({picture.shape[:2] for picture in pictures[:3]}) == 1, "one scale"
    coloured = [picture for picture in pictures if picture.ndim == 3]
    assert len(coloured) == 5
    assert all((picture.min(axis=2) < 200).mean() > 0.2 for picture in coloured)
    with Image.open(path) as image:
        assert image.width > 500
    assert sheet([row for row in rows if row.result is None], square.mesh) is None


def test_a_figure_that_cannot_be_written_is_told(rows, tmp_path):
    figure = next(figures(rows, None))[1]
    with pytest.raises(CaseError, match=r"nowhere.*cannot be written"):
        save_figure(figure, tmp_path / "nowhere", "a", 50)
    assert [path.suffix for path in save_figure(figure, tmp_path, "a", 50)] == [".png", ".svg"]


def test_names_of_files_sort_by_steps():
    assert [steps_name(n) for n in (0, 1, 20)] == ["auto_steps", "01_steps", "20_steps"]


@pytest.mark.parametrize(("cells", "edges"), [(6, True), (240, False)])
def test_edges_that_would_hide_the_colours_are_left_out(cells, edges):
    made = sample("square", cells, "motion")
    (block,) = made.case.markers_with("moving")
    case = made.case.change(motions=(Translate(block, (1e-9, 0.0)),))
    (row,) = compare(case, made.mesh, combinations(("ps",), ("none",), (1,)))
    figure = sheet([row], made.mesh)
    image = figure.axes[0].images[0].get_array()
    middle = image[image.shape[0] // 8 : image.shape[0] // 4, image.shape[1] // 4 :]
    # All cells are perfect: without edges there is one colour.
    assert (len(np.unique(middle.reshape(-1, 3), axis=0)) > 3) == edges
