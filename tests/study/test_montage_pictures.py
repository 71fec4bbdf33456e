"""Figures of comparisons, and montages with a picture of each mesh."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from slideviz.case.motions.rigid import Translate
from slideviz.errors import CaseError
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import sample
from slideviz.study.combinations import COMPARED_METHODS, MODES, combinations, compare, history_text
from slideviz.study.montage import NOT_KEPT, montage
from slideviz.study.plots import facets, figures, profiler, save_figure, steps_name


@pytest.fixture(scope="module")
def square():
    return sample("square", 10, "motion")


@pytest.fixture(scope="module")
def rows(square):
    wanted = combinations(("none", "ps"), ("none", "fixed", "moving"), (1, 4))
    return list(compare(square.case, square.mesh, wanted))


def test_facets_are_methods_and_a_mode_has_the_same_line_in_each(rows):
    none, ps = facets(rows)
    assert (none.title, ps.title) == ("no sliding", "pseudo sliding")
    lines = {(facet.title, line.label): line.series for facet in (none, ps) for line in facet.lines}
    assert lines["no sliding", MODES["fixed"]] == lines["pseudo sliding", MODES["fixed"]] == 1
    assert ("no sliding", MODES["moving"]) not in lines


def test_with_one_mode_the_methods_are_lines(rows):
    (facet,) = facets([row for row in rows if row.combination.periodic == "fixed"])
    assert facet.title == ""
    assert {line.label for line in facet.lines} == {"no sliding", "pseudo sliding"}
    assert facets([row for row in rows if row.result is None]) == ()


def test_where_modes_are_fewer_than_methods_they_are_the_facets(rows):
    group = [row for row in rows if row.combination.periodic != "none"]
    third = [
        replace(row, combination=replace(row.combination, method="ds"))
        for row in group
        if row.combination.method == "ps"
    ]
    fixed, moving = facets([*group, *third])
    assert (fixed.title, moving.title) == (MODES["fixed"], MODES["moving"])
    names = [COMPARED_METHODS[name][0] for name in ("none", "ps", "ds")]
    assert list(dict.fromkeys(line.label for line in fixed.lines)) == names
    assert {line.label: line.series for line in moving.lines} == {names[1]: 1, names[2]: 2}


def test_times_that_differ_much_have_a_logarithmic_axis_with_plain_numbers(rows):
    def timed(row, seconds):
        return replace(row, result=replace(row.result, processor_seconds=seconds))

    group = [row for row in rows if row.result and row.combination.method == "ps"]
    for factor, scale in ((1.2, "linear"), (6.0, "log")):
        shown = [timed(row, 0.03 * factor**k) for k, row in enumerate(group)]
        axes = dict(figures(shown, None))["steps"].axes[2]
        assert axes.get_ylabel().startswith("processor time")
        assert axes.get_yscale() == scale
        axes.figure.draw_without_rendering()
        low, high = axes.get_ylim()
        ticks = zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
        words = [text.get_text() for at, text in ticks if low <= at <= high]
        assert 3 <= len(words) <= 9
        assert all(float(word) >= 0 for word in words), "numbers, not powers of ten"


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
    assert len(limits) == 1, "one scale, so that facets can be compared"
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
    assert drawn["spanwise_01_steps"].axes[0].get_ylabel() == "r [mesh units]"
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
    ((line,),) = [facet.lines for facet in facets([row])]
    assert make(line).coordinate == coordinate
    assert make(line).count.sum() == len(made.mesh.cells)


def texts_of(figure):
    """Return the foot, and the names, numbers and words of each facet."""
    texts = [*figure.texts]
    for axes in figure.axes:
        texts += [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
    return [text for text in texts if text.get_text()]


def words_on(figure):
    return [text.get_text() for text in texts_of(figure)]


def overlaps(figure):
    """Return pairs of words, or of words and a picture, that cover each other."""
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in texts_of(figure)]
    boxes += [
        ("picture", axes.images[0].get_window_extent(renderer))
        for axes in figure.axes
        if axes.images
    ]
    outside = [words for words, box in boxes if not figure.bbox.padded(1).containsx(box.x1)]
    assert outside == []
    return [
        (first[0], second[0])
        for k, first in enumerate(boxes)
        for second in boxes[k + 1 :]
        if first[1].overlaps(second[1])
    ]


@pytest.fixture
def plain_pictures(monkeypatch):
    """Grey squares instead of pictures of meshes, where words and places are what matters."""

    def draw(frames, base, side):
        picture = np.full((side, side, 3), 255, np.uint8)
        picture[side // 10 : -side // 10, side // 10 : -side // 10] = 120
        return [picture] * len(frames)

    monkeypatch.setattr("slideviz.study.montage.pictures_alike", draw)


def test_the_montage_shows_every_mesh_and_why_one_is_missing(rows, square, tmp_path, monkeypatch):
    monkeypatch.setattr("slideviz.study.montage.DPI", 100)
    group = [row for row in rows if row.combination.steps == 4]
    figure = montage(group, square.mesh)
    assert figure is not None
    (path,) = save_figure(figure, tmp_path, "montage", 100, (".png",))
    words = words_on(figure)
    assert words.count("not possible [1]") == 1
    foot = " ".join(figure.texts[0].get_text().split())
    assert foot.startswith(f"[1] no sliding with {MODES['moving']}: not possible: PERIODIC_MODE=")
    assert foot.endswith("choose PERIODIC_MODE= fixed"), "the reason is there to its end"
    assert sum(text.startswith("min") for text in words) == 5
    pictures = [axes.images[0].get_array() for axes in figure.axes if axes.images]
    assert len(pictures) == 5
    assert len({picture.shape[:2] for picture in pictures[:2]}) == 1, "one scale"
    assert all((picture.min(axis=2) < 200).mean() > 0.2 for picture in pictures)
    assert overlaps(figure) == []
    with Image.open(path) as image:
        assert image.width > 500
    assert montage([row for row in rows if row.result is None], square.mesh) is None


@pytest.mark.usefixtures("plain_pictures")
def test_what_cannot_be_at_all_has_no_place_but_a_note(rows, square):
    long = "the motion puts BLADE through PER1; " * 6 + "the end"
    group = [
        replace(row, result=None, problem=long) if row.combination.periodic == "fixed" else row
        for row in rows
        if row.combination.steps == 4
    ]
    figure = montage(group, square.mesh)
    words = words_on(figure)
    assert MODES["fixed"] not in words
    assert {MODES["none"], MODES["moving"]} <= set(words)
    foot = " ".join(" ".join(words).split())
    assert f"[2] no sliding with {MODES['moving']}: not possible: PERIODIC_MODE=" in foot
    assert f"[1] {MODES['fixed']}: not possible: the motion puts BLADE" in foot
    assert "the end" in foot
    assert overlaps(figure) == []


@pytest.mark.parametrize(
    "modes", [("moving",), pytest.param(("fixed", "moving"), marks=pytest.mark.slow)]
)
def test_many_methods_stand_beside_each_other(rows, square, monkeypatch, modes):
    monkeypatch.setattr("slideviz.study.montage.DPI", 100)
    (row,) = [
        r
        for r in rows
        if r.combination == replace(r.combination, method="ps", periodic="moving", steps=4)
    ]
    group = [
        replace(row, combination=replace(row.combination, method=method, periodic=mode))
        for method in COMPARED_METHODS
        for mode in modes
    ]
    figure = montage(group, square.mesh)
    assert overlaps(figure) == []
    spots = {text.get_text(): text.get_window_extent() for text in texts_of(figure)}
    heights = [spots[title].y0 for title, _ in COMPARED_METHODS.values()]
    assert np.ptp(heights) < 1.0, "in one line"
    width, height = figure.get_size_inches()
    assert height < width


def test_a_figure_that_cannot_be_written_is_told(rows, tmp_path):
    figure = next(figures(rows, None))[1]
    with pytest.raises(CaseError, match=r"nowhere.*cannot be written"):
        save_figure(figure, tmp_path / "nowhere", "a", 50)
    assert [path.suffix for path in save_figure(figure, tmp_path, "a", 50)] == [".png", ".svg"]


def test_names_of_files_sort_by_steps():
    assert [steps_name(n) for n in (0, 1, 20)] == ["auto_steps", "01_steps", "20_steps"]


@pytest.mark.parametrize(("cells", "edges"), [(6, True), (80, False)])
def test_edges_that_would_hide_the_colors_are_left_out(monkeypatch, cells, edges):
    monkeypatch.setattr("slideviz.study.montage.DPI", 100)
    made = sample("square", cells, "motion")
    (block,) = made.case.markers_with("moving")
    case = made.case.change(motions=(Translate(block, (1e-9, 0.0)),))
    (row,) = compare(case, made.mesh, combinations(("ps",), ("none",), (1,)))
    figure = montage([row], made.mesh)
    image = figure.axes[0].images[0].get_array()
    high, wide = (length // 4 for length in image.shape[:2])
    middle = image[high // 2 : high, wide : 3 * wide]
    # All cells are perfect: without edges there is one color.
    assert (len(np.unique(middle.reshape(-1, 3), axis=0)) > 3) == edges


@pytest.mark.usefixtures("plain_pictures")
def test_a_mesh_that_was_not_kept_leaves_its_numbers_and_the_reason(rows, square):
    group = [row for row in rows if row.combination.steps == 4 and row.result]
    first, *others = group
    figure = montage(
        [replace(first, result=replace(first.result, mesh=None)), *others], square.mesh
    )
    words = words_on(figure)
    assert words.count("not drawn [1]") == 1
    assert f"[1] {NOT_KEPT}" in " ".join(" ".join(words).split())
    assert sum(text.startswith("min") for text in words) == len(group)
    bare = [replace(row, result=replace(row.result, mesh=None)) for row in group]
    assert montage(bare, square.mesh) is None
